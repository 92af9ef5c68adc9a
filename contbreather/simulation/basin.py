"""How far a breather attracts: many starts over a plane of initial conditions, in parallel.

A row's result depends on its starts alone, so the picture is the same whoever computes it.
"""

from __future__ import annotations

import enum
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from typing import Any, Unpack

import numpy as np
from numpy.typing import NDArray

from contbreather.checks import MOST, check_kind, number, one_of, row, whole
from contbreather.columns import Columns
from contbreather.errors import BadInput, Interrupted
from contbreather.lattice.conditions import Conditions
from contbreather.simulation.integrator import RunStop, check_sites
from contbreather.simulation.measures import localised
from contbreather.simulation.simulate import completed, let_go
from contbreather.simulation.states import (
    GivenOrbit,
    ModelParameters,
    State,
    orbit_given,
    start_of,
    wall_rows,
    within,
)
from contbreather.tables import HtmlRepr, Sheet
from contbreather.workers import Failed, each

Array = NDArray[Any]


class Outcome(enum.IntEnum):
    """End of a start: the values are those of `Basin.outcome`, with what pictures and tables
    call them."""

    words: str

    def __new__(cls, value: int, words: str = "") -> Outcome:
        outcome = int.__new__(cls, value)
        outcome._value_, outcome.words = value, words
        return outcome

    PENDING = -1, "not computed"  # the run was interrupted, or its worker killed
    OUTSIDE = 0, "behind a wall"
    QUIET = 1, "no impacts"
    SPREAD = 2, "impacts, no breather"
    OTHER = 3, "a breather, another or not back yet"
    RETURNED = 4, "back at the breather"  # to the motion asked about


@dataclass(frozen=True)
class Axis:
    """One direction of the plane: displacement ``"u"`` or velocity ``"v"`` of a site, and values.

    The values are those of the coordinate itself, not its distance from the reference.

    Examples
    --------
    >>> Axis("v", 1, [-0.5, 0.0, 0.5]).label
    'v_1'
    """

    name: str
    site: int
    values: Sequence[float]

    def __post_init__(self) -> None:
        one_of("the coordinate of an axis", self.name, ("u", "v"))
        along = row("values", self.values, "the values of an axis")
        object.__setattr__(self, "site", whole("site", self.site, -(10**9)))
        object.__setattr__(self, "values", tuple(along.tolist()))

    @property
    def label(self) -> str:
        return f"{self.name}_{self.site}"


@dataclass(frozen=True, eq=False)
class Basin(Columns, HtmlRepr):
    """The outcomes of all starts over a plane.

    Attributes
    ----------
    x, y : Axis
    outcome : ndarray of int8, shape (len(y.values), len(x.values))
        Values of `Outcome`.
    distance : ndarray
        Largest difference to the reference state at the end.
    complete : bool
        False after an interruption or without workers: rows not computed are `Outcome.PENDING`.
    """

    x: Axis
    y: Axis
    outcome: NDArray[np.int8]
    distance: Array
    complete: bool

    along = "start"

    def table(self) -> Sheet:
        counts = [(outcome.words, int(np.sum(self.outcome == outcome))) for outcome in Outcome]
        rows: list[Any] = [row for row in counts if row[1]]
        return Sheet.of([*rows, ("share that returned", self.share)])

    def columns(self) -> dict[str, Any]:
        """Starts row by row, with the names of their outcomes."""
        x, y = np.meshgrid(self.x.values, self.y.values)
        outcomes = np.array([Outcome(int(outcome)).name for outcome in self.outcome.flat])
        table = {self.x.label: x, self.y.label: y, "outcome": outcomes, "distance": self.distance}
        return {name: np.ravel(column) for name, column in table.items()}

    def __repr__(self) -> str:
        counts = [(int(np.sum(self.outcome == outcome)), outcome) for outcome in reversed(Outcome)]
        outcomes = [f"{count} {outcome.words}" for count, outcome in counts if count]
        rows, columns = self.outcome.shape
        cut = "" if self.complete else "; cut short"
        return (
            f"<Basin of {columns} x {rows} starts over {self.x.label} and {self.y.label}: "
            f"{'; '.join(outcomes)}{cut}>"
        )

    @property
    def share(self) -> float:
        """Which part of the starts inside the walls returned."""
        inside = self.outcome > Outcome.OUTSIDE
        return float(np.mean(self.outcome[inside] == Outcome.RETURNED)) if np.any(inside) else 0.0


def attraction(
    reference: Any,
    x: Axis,
    y: Axis,
    *,
    periods: int = 500,
    site: int | None = None,
    t0: float = 0.0,
    tolerance: float = 1e-3,
    executor: Executor | int | None = None,
    progress: bool | None = None,
    **on: Unpack[ModelParameters],
) -> Basin:
    """Find the starts over a plane from which a lattice comes to a given periodic motion.

    Parameters
    ----------
    reference : pair of array_like, shape (N,), or Orbit
        A state of the motion at t0, of `periodic(...)` for instance; all coordinates but the two
        of the plane start there.
    x, y : Axis
        The plane.
    t0, on
        As in `simulate`.
    periods : int
        After which the outcome is read off; the slowest multiplier decides how many are needed.
    site : int, optional
        Where the breather is: 0 unless given, or where an orbit impacts.
    tolerance : float
        How close to the reference counts as returned.
    executor : concurrent.futures.Executor or int, optional
        Who computes: an executor, or a number of processes, 1 for this one. All cores unless given,
        where there is more than a second of work.
    progress : bool, optional
        Show how many rows are done; by default at a terminal or in a notebook only.

    Returns
    -------
    Basin
        After Ctrl-C, or when a worker was killed, as well: with the rows completed until then.

    Raises
    ------
    NotConverged
        If no worker came to a result.

    Examples
    --------
    >>> from contbreather.orbits import symmetric
    >>> state = symmetric(a=0.5, gamma=0.02, k=0.4).state(5)
    >>> u, v = Axis("u", 0, [-0.9, 0.9]), Axis("v", 0, [-1.0, 0.0, 1.0])
    >>> basin = attraction(state, u, v, a=0.5, gamma=0.02, k=0.4)
    >>> basin.outcome.shape
    (3, 2)
    """
    state, conditions = start_of(reference, None, t0, **on)
    orbit = orbit_given(reference)
    if orbit is not None:
        _check_alone(orbit, on, periods)
    if site is None:
        site = 0 if orbit is None else orbit.section.hit[0]
    for axis in (x, y):
        check_kind(axis, Axis, "an Axis")
    site = whole("site", site, -MOST)
    tolerance = number("tolerance", tolerance, 0.0, 1e300, "a distance")
    check_sites("attraction", (site, x.site, y.site), state.u.size)
    if x.name == y.name and (x.site - y.site) % state.u.size == 0:
        raise BadInput(f"both axes are {x.label}: a plane has two coordinates.")
    state = within(state, conditions.walls)
    run: dict[str, Any] = {"periods": whole("periods", periods, 2), "t0": t0, "progress": False}
    shape = len(y.values), len(x.values)
    outcome = np.full(shape, Outcome.PENDING, np.int8)
    distance = np.full(shape, np.nan)
    # what a worker needs for a row: picklable, and nothing else decides its result
    ends = partial(_outcome, state, conditions, run, site % state.u.size, tolerance)
    work = partial(_row, x, y, ends)
    try:
        rows = [*each(work, range(shape[0]), executor=executor, progress=progress, unit="rows")]
    except Interrupted as stop:
        rows = list(stop.partial or ())  # type: ignore[call-overload]
    else:
        if all(isinstance(row, Failed) for row in rows):
            raise rows[0].error
    done = [j for j, row in enumerate(rows) if not isinstance(row, Failed)]
    for j in done:
        outcome[j], distance[j] = zip(*rows[j], strict=True)
    return Basin(x, y, outcome, distance, len(done) == shape[0])


def _check_alone(orbit: GivenOrbit, on: Mapping[str, Any], periods: int) -> None:
    """Refuse what an orbit is no motion of, or what ends within its period."""
    if on:
        raise BadInput(
            f"{', '.join(on)} beside an orbit: starts are seen to come back to it, and under other "
            "conditions it is no motion; give the state of periodic(orbit, ...) there"
        )
    if isinstance(periods, int) and periods % orbit.section.turns:
        raise BadInput(
            f"periods = {periods}: the orbit repeats after {orbit.section.turns}, so a multiple of "
            "that was expected"
        )


def _row(x: Axis, y: Axis, ends: Any, j: int) -> list[tuple[int, float]]:
    return [ends((x, value), (y, y.values[j])) for value in x.values]


def _outcome(
    reference: State, conditions: Conditions, settings: Any, site: int, tolerance: float,
    *places: tuple[Axis, float],
) -> tuple[int, float]:  # fmt: skip
    start = State(reference.u.copy(), reference.v.copy())
    for axis, value in places:
        getattr(start, axis.name)[axis.site % start.u.size] = value
    low, high = wall_rows(conditions.walls, start.u.size)
    if ((start.u < low) | (start.u > high)).any():
        return Outcome.OUTSIDE, np.nan
    run = completed(let_go(start, conditions, **settings))
    gap = float(np.abs(np.subtract(run.final, reference)).max())
    if run.stop is not RunStop.DONE:
        return Outcome.SPREAD, gap
    if gap < tolerance:
        return Outcome.RETURNED, gap
    # quiet, spread, or a breather at the site, judged by the last tenth of the run
    late = run.since(run.periods - max(2, run.periods // 10))
    if not late.impacts.size:
        return Outcome.QUIET, gap
    if set(late.impacts["site"].tolist()) == {site}:
        return Outcome.OTHER, gap
    u, v = run.strobe
    seen = localised(u[-5:], v[-5:], run.times[-5:], conditions)
    at_site = np.all(seen.centre == site) and seen.participation.mean() < 2.0
    return (Outcome.OTHER if at_site else Outcome.SPREAD), gap
