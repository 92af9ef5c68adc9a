"""An impacting lattice, simulated exactly: eq. (1), the reset law (2), damping and springs.

Between impacts the flow is summed to rounding (`contbreather.dynamics.flow`), impacts are bracketed
so that none can be missed and polished to 1e-12 (`contact`), and rests on a wall are part of the
motion (`cruise`). The only error left is rounding.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, TypeVar, Unpack

import numpy as np
from numpy.typing import NDArray

from contbreather.checks import MOST, number, one_of, whole
from contbreather.columns import Columns
from contbreather.display import Shown
from contbreather.dynamics.states import (
    PERIOD,
    On,
    State,
    check_state,
    conditions_of,
    reduced,
    within,
)
from contbreather.dynamics.stretches import (
    IMPACT,
    REST,
    Part,
    RunStop,
    Sample,
    Stretch,
    check_sample,
    fraction,
    walk,
)
from contbreather.lattice.conditions import Conditions
from contbreather.progress import Bar

if TYPE_CHECKING:
    from xarray import Dataset

Array = NDArray[Any]

LONGEST = 1e12  # periods; beyond, not even their number is exact enough to keep time


class Record(NamedTuple):
    """Chosen sites at many times: `u` and `v` have shape (times, sites)."""

    times: Array
    sites: tuple[int, ...]
    u: Array
    v: Array

    def __repr__(self) -> str:
        return f"<Record of sites {list(self.sites)} at {len(self.times)} times>"


def states_of(run: Any) -> dict[str, Any]:
    """States of a run as variables: at the strobe, at the end, of sampled sites."""
    found = {
        "time": ("strobe", run.times),
        "u": (("strobe", "site"), run.strobe.u),
        "v": (("strobe", "site"), run.strobe.v),
        "final_u": ("site", run.final.u),
        "final_v": ("site", run.final.v),
        "end": ((), run.end),
    }
    if run.record is not None:
        sampled = ("sample", "sampled_site")
        found["sample_time"] = ("sample", run.record.times)
        found["sampled_sites"] = ("sampled_site", np.array(run.record.sites))
        found |= {"sample_u": (sampled, run.record.u), "sample_v": (sampled, run.record.v)}
    return found


@dataclass(frozen=True, eq=False)
class Run(Columns, Shown):
    """What `simulate` leaves behind.

    Attributes
    ----------
    impacts : structured ndarray
        One row for each impact in order of time: ``time``, ``period`` (number of the period since
        t0), ``phase`` (time modulo 2 pi, to 1e-15 however long the run), ``site``, ``wall``
        (+1 or -1), velocities ``before`` and ``after``, ``acceleration`` just before.
    rests : structured ndarray
        Where a site came to rest on a wall after a chatter (``begins`` True) or left it (False). A
        site that rests from the start has no row until it leaves. Of a chatter the impacts below a
        rebound velocity of 1e-6 (more where k is close to 1 and rounding is) are summed, not
        listed: their end, where the rest begins, comes after the last impact that is.
    strobe : State
        ``u``, ``v`` of shape (periods + 1, N) at ``times`` = t0 + 2 pi j.
    final : State
        The state at the end, ready to be simulated again.
    end : float
        The time of `final`.
    record : Record or None
        Chosen sites at many times.
    conditions : Conditions
    stop : RunStop
    reason : str
        Says more where the run did not go through all its periods.
    """

    impacts: NDArray[np.void]
    rests: NDArray[np.void]
    times: Array
    strobe: State
    final: State
    end: float
    record: Record | None
    conditions: Conditions
    stop: RunStop
    reason: str = ""

    along = "impact"

    def columns(self) -> dict[str, Array]:
        """The table of impacts; `to_xarray` has the states as well."""
        return {name: self.impacts[name] for name in IMPACT.names or ()}

    def to_xarray(self) -> Dataset:
        """Everything: impacts, rests, the states at the strobe, sampled sites."""
        from xarray import Dataset

        tables = {"impact": self.impacts, "rest": self.rests}
        found: dict[str, Any] = {
            f"{what}_{name}": (what, table[name])
            for what, table in tables.items()
            for name in table.dtype.names or ()
        }
        return Dataset({**found, **states_of(self)})

    @property
    def sites(self) -> int:
        return self.final.u.size

    @property
    def periods(self) -> int:
        """Whole periods completed."""
        return len(self.times) - 1

    def at_site(self, n: int, wall: int | None = None) -> NDArray[np.void]:
        """The impacts of one site, on one wall or on both."""
        chosen = self.impacts["site"] == whole("n", n, -MOST) % self.sites
        if wall is not None:
            chosen &= self.impacts["wall"] == one_of("wall", wall, (1, -1))
        return self.impacts[chosen]

    def __repr__(self) -> str:
        what = self.reason or self.stop.value
        return (
            f"<Run of {self.sites} sites over {self.periods} periods: "
            f"{len(self.impacts)} impacts; {what}>"
        )


def simulate(
    state: Any,
    *,
    periods: float,
    t0: float = 0.0,
    sample: Sample | None = None,
    progress: bool | Bar | None = None,
    **on: Unpack[On],
) -> Run:
    """Let a lattice of impacting sites go from any state.

    Parameters
    ----------
    state : pair of array_like, shape (N,)
        Displacements and velocities of all sites at t0; N = 1 is a single oscillator.
    periods : float
        Length of the run in periods 2 pi of the forcing; a fraction is allowed at the end.
    t0 : float
        Time of the state; the forcing depends on it.
    sample : Sample, optional
        Sites to record densely, in whole periods. Impacts and the states once in a period are
        always recorded.
    progress : bool, optional
        Show progress on standard error; by default on long runs at a terminal.
    a, gamma, k : float
        Amplitude of the forcing, coupling (below 1/4 on a ring), restitution in [0, 1].
    damping, spring : float
        Of ``u'' + damping u' + spring u + ...``, per unit mass; damping up to 1e4, for steps are
        3/damping at most.
    forcing : Forcing or str, optional
        `Harmonic`, F = -a cos t, unless given.
    lattice : Ring or Lattice, optional
        A ring of as many sites as the state has, unless given.
    walls : pair or dict, optional
        ``(low, high)`` for all sites, or a dict of sites and pairs, None where there is no wall;
        -1 and 1 unless given.

    Returns
    -------
    Run
        After Ctrl-C as well, with the periods completed until then.

    Raises
    ------
    BadInput
        A state outside the walls, or a parameter outside its range.
    NotConverged
        If velocities grow beyond all reason.

    Examples
    --------
    >>> from contbreather.breathers import symmetric
    >>> b = symmetric(a=0.5, gamma=0.08, k=0.8)
    >>> run = simulate(b.state(20), a=0.5, gamma=0.08, k=0.8, periods=1)
    >>> bool(abs(run.final.u - run.strobe.u[0]).max() < 1e-13)
    True
    >>> len(run.impacts)
    2
    """
    start = check_state(state)
    conditions = conditions_of(start.u.size, **on)
    return advance(start, conditions, periods=periods, t0=t0, sample=sample, progress=progress)


def advance(
    state: State,
    conditions: Conditions,
    *,
    periods: float,
    t0: float = 0.0,
    sample: Sample | None = None,
    progress: bool | Bar | None = None,
) -> Run:
    """`simulate`, of a state and conditions that have been checked."""
    check_sample(sample, state.u.size)
    start = within(state, conditions.walls)
    length = number("periods", periods, 0.0, LONGEST, "a length in periods from 0 to 1e12")
    count, rest = int(length), length - int(length)
    stretches: list[Stretch] = []
    stop, reason = RunStop.DONE, ""
    t = reduced(t0)
    try:
        for one in walk(start, conditions, periods=count, t0=t, sample=sample, progress=progress):
            stretches.append(one)
            if one.stop is not None:
                stop, reason = one.stop, one.reason
        if rest > 0.0 and stop is RunStop.DONE:
            stretches.append(fraction(_after(start, stretches), conditions, t, rest, count))
            stop, reason = stretches[-1].stop or stop, stretches[-1].reason
    except KeyboardInterrupt:
        stop = RunStop.INTERRUPTED
    last = _after(start, stretches)
    end = float(t0) + PERIOD * sum(one.periods for one in stretches if type(one) is Stretch)
    if any(isinstance(one, Part) and one.stop is None for one in stretches):
        end += PERIOD * rest
    return _gathered(start, stretches, last, end, float(t0), conditions, sample, stop, reason)


def _after(start: State, stretches: list[Stretch]) -> State:
    filled = [one for one in stretches if one.periods]
    if not filled:
        return start
    return State(filled[-1].u[-1].copy(), filled[-1].v[-1].copy())


def _gathered(
    start: State,
    stretches: list[Stretch],
    final: State,
    end: float,
    t0: float,
    conditions: Conditions,
    sample: Sample | None,
    stop: RunStop,
    reason: str,
) -> Run:
    """One run from its stretches, with times counted from t0."""
    full = [one for one in stretches if one.periods and one.u.size]
    whole_ones = [one for one in full if not isinstance(one, Part)]
    u = np.concatenate([start.u[None], *(one.u for one in whole_ones)])
    v = np.concatenate([start.v[None], *(one.v for one in whole_ones)])
    impacts = np.concatenate([np.empty(0, IMPACT), *(one.impacts for one in stretches)])
    rests = np.concatenate([np.empty(0, REST), *(one.rests for one in stretches)])
    for table in (impacts, rests):
        table["time"] += t0
    record = None
    if sample is not None:
        record = _record(full, sample, start.u.size, t0)
    times = t0 + PERIOD * np.arange(len(u))
    return Run(impacts, rests, times, State(u, v), final, end, record, conditions, stop, reason)


def _record(stretches: list[Stretch], sample: Sample, sites: int, t0: float) -> Record:
    count = sample.per_period
    empty = np.empty((0, len(sample.sites)))
    u = np.concatenate([empty, *(one.dense_u.reshape(-1, len(sample.sites)) for one in stretches)])
    v = np.concatenate([empty, *(one.dense_v.reshape(-1, len(sample.sites)) for one in stretches)])
    times = t0 + PERIOD / count * np.arange(len(u))
    return Record(times, tuple(n % sites for n in sample.sites), u, v)


class Stopped(Protocol):
    """A run or a sweep, which may have been interrupted."""

    @property
    def stop(self) -> RunStop: ...


S = TypeVar("S", bound=Stopped)


def completed(run: S) -> S:
    """What an inner call gave; where Ctrl-C cut that short, the call around it ends, too."""
    if run.stop is RunStop.INTERRUPTED:
        raise KeyboardInterrupt
    return run
