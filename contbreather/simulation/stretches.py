"""A lattice in motion, stretch by stretch; of an impacting one the compiled loop with its room."""

from __future__ import annotations

import enum
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from contbreather.checks import whole
from contbreather.errors import BadInput, NotConverged
from contbreather.lattice.conditions import Conditions
from contbreather.progress import Bar, line_of
from contbreather.signals import deferred
from contbreather.simulation.states import PERIOD, State

if TYPE_CHECKING:
    from contbreather.simulation.room import Law, Log, Watch, Work

Array = NDArray[Any]

WHERE = [("time", "f8"), ("period", "i8"), ("phase", "f8"), ("site", "i8"), ("wall", "i1")]
IMPACT = np.dtype([*WHERE, ("before", "f8"), ("after", "f8"), ("acceleration", "f8")])
REST = np.dtype([*WHERE, ("begins", "?")])
MOST = 150_000  # impacts of one site in one period: some seconds
MOMENT = 0.2  # seconds a stretch should take: how long an interruption waits
ROOM = 2**21  # numbers a stretch may hold: 16 MB


class RunStop(enum.Enum):
    """Why a run ended; the value is the sentence a user reads."""

    DONE = "went through all its periods"
    INTERRUPTED = "interrupted; all periods up to here are kept"
    CHATTER = "ended before a period of more impacts than can be followed"


@dataclass(frozen=True)
class Sample:
    """Sites to record densely, and at how many equal times in each whole period.

    Of a run of 1.5 periods the first one is recorded.

    Examples
    --------
    >>> Sample(sites=(0, 1), per_period=128).per_period
    128
    """

    sites: Sequence[int] = (0,)
    per_period: int = 64

    def __post_init__(self) -> None:
        whole("per_period", self.per_period, 1)
        if not isinstance(self.sites, Sequence | np.ndarray) or not np.size(self.sites):
            raise BadInput(
                f"sites = {self.sites!r}: one site or several were expected, as in (0, 1)."
            )
        for n in self.sites:
            if not isinstance(n, int | np.integer) or isinstance(n, bool):
                raise BadInput(
                    f"sites = {self.sites!r}: whole numbers were expected, {n!r} is none."
                )
        object.__setattr__(self, "sites", tuple(int(n) for n in self.sites))


def check_sample(sample: object, sites: int) -> None:
    """Refuse what is no `Sample` of a lattice of so many sites."""
    if not isinstance(sample, Sample | None):
        raise BadInput(f"sample = {sample!r}: a Sample was expected, as in Sample(sites=(0, 1)).")
    for n in sample.sites if sample else ():
        if not -sites <= n < sites:
            raise BadInput(
                f"sample: there is no site {n} among {sites}; sites are 0 to {sites - 1}."
            )


@dataclass(frozen=True, repr=False)
class Stretch:
    """Some successive periods of a run: what happened in them, and the states after each."""

    first: int
    u: Array
    v: Array
    dense_u: Array
    dense_v: Array
    impacts: NDArray[np.void] = field(default_factory=lambda: np.empty(0, IMPACT))
    rests: NDArray[np.void] = field(default_factory=lambda: np.empty(0, REST))
    stop: RunStop | None = None
    reason: str = ""

    @property
    def periods(self) -> int:
        return len(self.u)

    def __repr__(self) -> str:
        return f"<{type(self).__name__} of {self.periods} periods from {self.first}>"


class Propagator(Protocol):
    """What carries a state on, between walls of either kind: as many periods as asked for (or one
    of another length), fewer with a reason, or, but one at least, where there is no room for all
    their impacts; `roomy` is the most that one stretch may have."""

    state: State
    conditions: Any
    sample: Sample | None

    @property
    def roomy(self) -> int: ...
    def advance(self, periods: int, first: int, *, span: float = PERIOD) -> Stretch: ...


def walk(
    machine: Propagator, *, periods: int, first: int = 0, progress: bool | Bar | None = None
) -> Iterator[Stretch]:
    """Yield a run in stretches of about a fifth of a second: what `simulate` and `record` drive.

    Times of events are counted from t0. Where the stretches are cut has no influence on anything.
    """
    count, done = min(4, machine.roomy), 0
    with line_of(progress, lambda own: Bar(own, periods)) as bar:
        while done < periods:
            began = time.perf_counter()
            one = machine.advance(min(count, periods - done), first + done)
            done += one.periods
            bar.advance(done)
            yield one
            if one.stop is not None:
                return
            longer = 0.5 * MOMENT / (time.perf_counter() - began)
            count = min(int(count * min(max(longer, 1.0), 8.0)), machine.roomy)


@dataclass
class Machine:
    """The compiled loop of rigid walls with its state and its room."""

    state: State
    conditions: Conditions
    t0: float
    sample: Sample | None = None
    law: Law = field(init=False)
    work: Work = field(init=False)
    log: Log = field(init=False)
    full: bool = field(init=False, default=False)  # whether another period found no room in the log

    def __post_init__(self) -> None:
        from contbreather.simulation.law import law_of

        self.law = law_of(self.conditions)._replace(most=MOST)
        self.work = work_of(self.state.u.size, self.law)
        self.log = log_of(256)
        self.state = State(self.state.u.copy(), self.state.v.copy())

    @property
    def roomy(self) -> int:
        """How many periods one stretch may have."""
        dense = self.sample.per_period * len(self.sample.sites) if self.sample else 0
        return max(1, ROOM // (2 * self.state.u.size + 2 * dense))

    def advance(self, periods: int, first: int, *, span: float = PERIOD) -> Stretch:
        from contbreather.simulation.cruise import CHATTER, CRUISE, DONE, FULL

        if self.full:  # before anything is flown that Ctrl-C could drop
            self.log, self.full = log_of(2 * self.log.phase.size), False
        u, v = self.state
        strobe_u, strobe_v = np.empty((2, periods, u.size))
        watch = watch_of(self.sample, periods, u.size)
        here, ended = (self.t0, span, first, self.law, self.work, self.log), np.zeros(3, np.int64)
        self.log.used[0] = 0
        with deferred():
            CRUISE(u, v, *here, watch, strobe_u, strobe_v, ended)
        done, status, site = ended.tolist()
        self.full = status == FULL
        if self.full and not done:
            return self.advance(periods, first, span=span)
        if status not in (DONE, CHATTER, FULL):
            raise NotConverged(self._failed(status, first + done))
        impacts, rests = tables(self.log, self.t0)
        kept = (strobe_u[:done], strobe_v[:done], watch.u[:done], watch.v[:done], impacts, rests)
        if status != CHATTER:
            return Stretch(first, *kept)
        return Stretch(first, *kept, RunStop.CHATTER, self._chatter(site, first + done))

    def _chatter(self, site: int, period: int) -> str:
        """What was seen; whether it would come to rest is not known."""
        first = int(self.log.used[0])  # those of the period are behind it
        there = slice(first, first + int(self.work.hits.sum()))
        own = self.log.site[there] == site
        walls, speeds = self.log.wall[there][own][-2:], np.abs(self.log.before[there][own])
        how = f"chattering on the wall {walls[-1]:+d}, at {speeds[-1]:.2g} in the end"
        if walls[0] != walls[-1]:
            how = f"from wall to wall at a speed of {speeds[-1]:.3g}"
        return (
            f"site {site} has more than {self.law.most} impacts in period {period}, {how} "
            f"(k = {self.conditions.k}); the state before that period is kept"
        )

    def _failed(self, status: int, period: int) -> str:
        from contbreather.simulation.cruise import ASTRAY

        if status == ASTRAY:
            return (
                f"in period {period} the search for the next impact did not come to an end "
                f"({self.conditions}): please report it with the state"
            )
        return (
            f"the motion blows up in period {period} (a = {self.conditions.a}, k = "
            f"{self.conditions.k}): velocities beyond all reason; check the state and the forcing"
        )


def work_of(sites: int, law: Law) -> Work:
    from contbreather.simulation.room import Work

    count = law.size
    v, w, origin, last_v, last_w, reach, when, place = np.zeros((8, sites))
    side, held, fresh, changed, listed = np.zeros((5, sites), np.int8)
    rows, patch = np.empty((count, sites)), np.empty((count, 4 * ((count - 1) // 2) + 1))
    lift, (column, shifted) = np.empty((count, 1)), np.empty((2, count))
    push = np.empty((2, law.force.m.size))
    hits, busy = np.zeros(sites, np.int64), np.zeros(sites + 1, np.int64)
    many = np.zeros(1, np.int64)
    buffers = (v, w, rows, origin, last_v, last_w, reach, patch, lift, column, shifted, push, when)
    return Work(*buffers, side, held, place, fresh, changed, hits, busy, many, listed)


def log_of(size: int) -> Log:
    """An empty log."""
    from contbreather.simulation.room import Log

    kinds: tuple[Any, ...] = ("i8", "f8", "i8", "i1", "i1", "f8", "f8", "f8")
    columns: list[NDArray[Any]] = [np.zeros(size, kind) for kind in kinds]
    return Log(np.zeros(1, np.int64), *columns)


def watch_of(sample: Sample | None, periods: int, sites: int) -> Watch:
    from contbreather.simulation.room import Watch

    if sample is None:
        empty = np.empty((periods, 0, 0))
        return Watch(np.empty(0, np.int64), np.empty(0), empty, empty)
    chosen = np.array([n % sites for n in sample.sites], np.int64)
    grid: Array = PERIOD / sample.per_period * np.arange(sample.per_period)
    u, v = np.full((2, periods, grid.size, chosen.size), np.nan)
    return Watch(chosen, grid, u, v)


def tables(log: Log, t0: float) -> tuple[NDArray[np.void], NDArray[np.void]]:
    """Impacts, and rests and releases, with times counted from t0."""
    from contbreather.simulation.cruise import HIT
    from contbreather.simulation.cruise import REST as COMES_TO_REST

    used = int(log.used[0])
    _, period, phase, site, kind, wall, before, after, push = (column[:used] for column in log)
    found = []
    for dtype, chosen in ((IMPACT, kind == HIT), (REST, kind != HIT)):
        table = np.empty(int(chosen.sum()), dtype)
        # rebounds that are summed up may go on into the next period
        late = np.where(kind[chosen] == COMES_TO_REST, push[chosen], 0.0)
        when = phase[chosen] + late
        table["time"] = PERIOD * period[chosen] + (when - t0)
        table["period"] = period[chosen] + ((late > 0.0) & (when - t0 >= PERIOD))
        table["phase"] = when % PERIOD
        table["site"], table["wall"] = site[chosen], wall[chosen]
        if dtype is IMPACT:
            table["before"], table["after"] = before[chosen], after[chosen]
            table["acceleration"] = push[chosen]
        else:
            table["begins"] = kind[chosen] == COMES_TO_REST
        found.append(table)
    return found[0], found[1]
