"""A parameter varied slowly, up and down, with the state kept: hysteresis, and where it is lost.

The parameter stands still for a number of periods at each value, so each row of a sweep is a motion
under one set of conditions, and can be laid beside the continued branch. A branch that ends at a
value is left by a sweep a little beyond it, the later the faster the sweep.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any, Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray

from contbreather.checks import MOST, check_kind, row, whole
from contbreather.columns import Columns
from contbreather.errors import BadInput, NotConverged
from contbreather.progress import Bar
from contbreather.simulation.integrator import RunStop
from contbreather.simulation.measures import localised
from contbreather.simulation.simulate import SimulationRun, completed, let_go
from contbreather.simulation.states import ModelParameters, State, ranged, start_of
from contbreather.tables import Column, HtmlRepr, Sheet

Array = NDArray[Any]


@dataclass(frozen=True, eq=False)
class Sweep(Columns, HtmlRepr):
    """Record of a sweep, one row for each value of the parameter, in the order of time.

    Attributes
    ----------
    name : str
        The parameter.
    value : ndarray, shape (M,)
    u, v : ndarray, shape (M, N)
        State after the last period at each value.
    participation : ndarray
        Mean participation ratio over the second half of the periods at this value, as are the
        other means.
    centre : ndarray of int
        Site with the largest energy.
    amplitude : ndarray
        Largest speed, relative to the forced motion, that the centre has at the strobe: of order 1
        in a breather, 0 where the ring follows its forcing.
    p : ndarray
        Half the mean momentum of an impact of the centre; NaN on smooth rings, which have no
        impacts, 0 where there were none.
    tilt : ndarray
        Flight time of the centre from the wall +1 to -1, less pi: 0 in a symmetric breather, +-2 d
        in an asymmetric one; NaN on smooth rings.
    impacts, others : ndarray
        Impacts in a period, of the centre and of all other sites together; NaN on smooth rings.
    change : ndarray
        Largest difference between the states after the last two periods.
    stop : RunStop
    """

    name: str
    value: Array
    u: Array
    v: Array
    participation: Array
    centre: Array
    amplitude: Array
    p: Array
    tilt: Array
    impacts: Array
    others: Array
    change: Array
    stop: RunStop

    along = "step"

    def table(self) -> Sheet:
        names = {"value": self.name, "p": "p", "amplitude": "amplitude"}
        names |= {name: name for name in ("participation", "tilt", "change")}
        return Sheet([Column(h, getattr(self, n).tolist(), digits=5) for n, h in names.items()])

    def columns(self) -> dict[str, Array]:
        """Its columns, the values under the name of its parameter."""
        return {self.name: self.value, **{name: getattr(self, name) for name in COLUMNS[1:]}}

    @property
    def final(self) -> State:
        return State(self.u[-1].copy(), self.v[-1].copy())

    def lost(self, site: int | None = None) -> float:
        """The first value at which there is no breather at the site any more, the centre at the
        first value unless given.

        Between rigid walls a breather hits as often in a period as at the first value, once where
        there is one wall, and nobody else does, or so do the others that hit there as well; on
        smooth ones most of the energy is at the site. NaN if it was never lost.
        """
        site = int(self.centre[0]) if site is None else whole("site", site, -MOST)
        several = self.others[0] > 0.0  # of which any may have most of the energy
        with np.errstate(invalid="ignore"):
            hard = (self.impacts > 0.0) & (np.abs(self.impacts - self.impacts[0]) < 0.3)
            hard &= np.abs(self.others - self.others[0]) <= 0.3 * several
        alive = np.where(np.isnan(self.impacts), self.participation < 3.0, hard)
        alive &= several | (self.centre == site % self.u.shape[1])
        gone = np.flatnonzero(~alive)
        return float(self.value[gone[0]]) if gone.size else math.nan

    def __repr__(self) -> str:
        first, last = self.value[[0, -1]]
        turn = self.value[np.abs(self.value - first).argmax()]
        way = f" by way of {turn:g}" * bool(turn != last)
        return (
            f"<Sweep in {self.name} from {first:g}{way} to {last:g}: "
            f"{len(self.value)} values; {self.stop.value}>"
        )


COLUMNS = tuple(field.name for field in fields(Sweep))[1:-1]  # all but the name and the stop


def there_and_back(values: ArrayLike) -> Array:
    """The values up to the last and back to the first, the turning point once.

    Examples
    --------
    >>> there_and_back([1.0, 2.0, 3.0])
    array([1., 2., 3., 2., 1.])
    """
    there = row("values", values, "the values of a sweep")
    return np.concatenate([there, there[-2::-1]])


def sweep(
    state: Any,
    name: str,
    values: ArrayLike,
    *,
    periods: int,
    m: float | None = None,
    t0: float = 0.0,
    progress: bool | None = None,
    **on: Unpack[ModelParameters],
) -> Sweep:
    """Vary a parameter slowly and keep the state.

    Parameters
    ----------
    state : pair of array_like, shape (N,), or Orbit
        At the first value.
    name : str
        ``a, gamma, k, damping, spring, omega`` or a parameter of the forcing; on smooth rings
        ``m`` or ``lam`` as well, and no ``omega``.
    values : array_like
        In the order in which they are taken; `there_and_back` makes a loop of them.
    periods : int
        At each value.
    t0, on
        As in `simulate`; the swept one is ignored, and may be left out.
    m : float, optional
        Take the smooth ring (21) of this hardness instead of the impacting one.

    Returns
    -------
    Sweep
        After Ctrl-C as well, with the values completed until then.

    Examples
    --------
    >>> from contbreather.orbits import symmetric
    >>> start = symmetric(a=0.2, gamma=0.04, k=0.8).state(10)
    >>> down = sweep(start, "a", [0.2, 0.1, 0.05], periods=100,
    ...              a=0.2, gamma=0.04, k=0.8, damping=0.01)
    >>> float(down.lost())  # the fold is at 0.075
    0.05
    """
    steps = row("values", values, "the values of a sweep")
    check_kind(name, str, "the name of a parameter")
    needed: Any = {name: float(steps[0])} if name in ("a", "gamma", "k", "omega") else {}
    start, conditions = start_of(state, m, t0, **{**on, **needed})
    names = (*conditions.params, "omega" if m is None else "k")
    if name not in names:
        raise BadInput(f"no parameter {name!r} to sweep; there are {', '.join(names)}")
    how: dict[str, Any] = {"periods": whole("periods", periods, 2), "t0": t0, "progress": False}
    rows: list[tuple[Any, ...]] = []
    stop = RunStop.DONE
    with Bar(progress, len(steps), "values") as bar:
        try:
            for value in steps.tolist():
                there, before = ranged(conditions.at({name: value})), conditions.omega
                start = State(start.u, start.v * (before / there.omega))  # in d omega
                run: Any = let_go(start, there, **how)
                conditions = there
                # a Ctrl-C inside the run ends the sweep, too: its value is not complete
                start, stop = run.final, completed(run).stop
                if run.periods:  # else nothing was seen at this value
                    rows.append((value, *start, *_seen(run)))
                bar.advance(len(rows))
                if stop is not RunStop.DONE:
                    break
        except KeyboardInterrupt:
            if not rows:
                raise
            stop = RunStop.INTERRUPTED
    if not rows:
        raise NotConverged(f"at {name} = {steps[0]:g}: {run.reason}")
    table = zip(COLUMNS, zip(*rows, strict=True), strict=True)
    columns: dict[str, Any] = {label: np.array(column) for label, column in table}
    return Sweep(name=name, stop=stop, **columns)


def _seen(run: Any) -> tuple[Any, ...]:
    late = run.since(run.periods // 2)
    u, v = (x[1:] for x in late.strobe)  # the first is the end of the period before
    energies = localised(u, v, late.times[1:], run.conditions)
    centre = int(np.bincount(energies.centre).argmax())
    mass = run.conditions.lattice.masses[centre]
    # what the site would have with that energy, all of it kinetic
    speed = float(np.sqrt(2.0 * energies.energy[:, centre].max() / mass))
    change = np.abs(np.diff([x[-2:] for x in run.strobe], axis=1))
    hits = _impacts(late, centre) if isinstance(run, SimulationRun) else 4 * (math.nan,)
    return float(energies.participation.mean()), centre, speed, *hits, float(change.max())


def _impacts(run: SimulationRun, centre: int) -> tuple[float, ...]:
    """p, tilt, impacts of the centre in a period, impacts of all others."""
    hits = run.at_site(centre)
    # an impact changes the velocity by 2 p
    p = 0.5 * float(np.abs(hits["before"] - hits["after"]).mean()) if hits.size else 0.0
    upper, lower = (np.exp(1j * hits["phase"][hits["wall"] == wall]) for wall in (1, -1))
    both = upper.size and lower.size
    # phases are averaged as directions, for 0 and 2 pi are one; pi is half a period
    tilt = float(np.angle(-lower.mean() / upper.mean())) if both else 0.0
    count = run.periods
    return p, tilt, len(hits) / count, (len(run.impacts) - len(hits)) / count
