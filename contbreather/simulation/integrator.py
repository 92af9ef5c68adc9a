"""A run in chunks of some periods, whoever integrates it: what `simulate` and `record` drive.

Behind that the integrators of rigid walls: the event-driven loop with its parameters and its
workspace, and the same under white noise.
"""

from __future__ import annotations

import enum
import math
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import pairwise
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from contbreather.checks import whole
from contbreather.errors import BadInput, NotConverged, deferred
from contbreather.lattice.chain import Ring
from contbreather.lattice.conditions import Conditions
from contbreather.lattice.finite import Finite, stiffness_of
from contbreather.lattice.forcing import Forcing
from contbreather.progress import Bar
from contbreather.simulation.event_loop import (
    ASKS,
    ASTRAY,
    BEGINS_REST,
    CHATTER,
    DONE,
    EVENT_LOOP,
    FULL,
    HIT,
    MOST,
)
from contbreather.simulation.states import PERIOD, State, wall_rows, within_period
from contbreather.simulation.taylor import (
    NEVER,
    STEP,
    Couplings,
    DenseOutput,
    EventLog,
    Parameters,
    Workspace,
    powers_needed,
)

Array = NDArray[Any]

WHERE = [("time", "f8"), ("period", "i8"), ("phase", "f8"), ("site", "i8"), ("wall", "i1")]
IMPACT = np.dtype([*WHERE, ("before", "f8"), ("after", "f8"), ("acceleration", "f8")])
REST = np.dtype([*WHERE, ("begins", "?")])
EVENTS = ("impacts", "rests")  # tables of what happens between rigid walls


class RunStop(enum.Enum):
    """Reason for which a run ended; the value is the sentence a user reads."""

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
        several = isinstance(self.sites, Sequence | np.ndarray)
        if not several or getattr(self.sites, "ndim", 1) != 1 or not len(self.sites):
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
    check_sites("sample", sample.sites if sample else (), sites)


def check_sites(name: str, chosen: Iterable[int], sites: int) -> None:
    """Refuse sites that a lattice of so many has not; negative ones count from its end."""
    for n in chosen:
        if not -sites <= n < sites:
            raise BadInput(
                f"{name}: there is no site {n} among {sites}; sites are 0 to {sites - 1}."
            )


@dataclass(frozen=True, repr=False)
class Chunk:
    """Some successive periods of a run: what happened in them, and the states after each."""

    first: int
    u: Array
    v: Array
    dense_u: Array  # (periods, times, sites) of a `Sample`
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


def blank(sample: Sample | None, u: Array, v: Array) -> Chunk:
    """Some states between which nothing happened."""
    each = (sample.per_period, len(sample.sites)) if sample else (0, 0)
    return Chunk(0, u, v, *np.empty((2, 0, *each)))


def periods_at_once(sites: int, sample: Sample | None) -> int:
    """The most periods that one chunk may have."""
    dense = sample.per_period * len(sample.sites) if sample else 0
    return max(1, 2**21 // (2 * sites + 2 * dense))  # numbers: 16 MB


def joined_chunks(chunks: Sequence[Chunk], *names: str) -> dict[str, Any]:
    """Join the arrays of successive chunks."""
    names = names or ("u", "v", "dense_u", "dense_v", *EVENTS)
    return {name: np.concatenate([getattr(chunk, name) for chunk in chunks]) for name in names}


class Integrator(Protocol):
    """Carrier of a state, between walls of either kind: over as many periods as asked for (or one
    of another length), or fewer with a reason; `most_periods` is the most that a chunk may have."""

    state: State
    conditions: Any
    sample: Sample | None

    @property
    def most_periods(self) -> int: ...
    def advance(self, periods: int, first: int, *, span: float = PERIOD) -> Chunk: ...


def in_chunks(
    integrator: Integrator, *, periods: int, first: int = 0, progress: bool | Bar | None = None
) -> Iterator[Chunk]:
    """Yield a run in chunks of about a fifth of a second.

    Times of events are counted from t0. Where chunks are cut has no influence on anything.
    """
    count, done = min(4, integrator.most_periods), 0
    with Bar(progress, periods) as bar:
        while done < periods:
            began = time.perf_counter()
            chunk = integrator.advance(min(count, periods - done), first + done)
            done += chunk.periods
            bar.advance(done)
            yield chunk
            if chunk.stop is not None:
                return
            # towards a tenth of a second, as an interruption waits for a chunk; never shorter, as
            # machines are slow for a while
            longer = 0.1 / (time.perf_counter() - began)
            count = min(int(count * min(max(longer, 1.0), 8.0)), integrator.most_periods)


# --- what the kernels take ------------------------------------------------------------------------


@lru_cache(maxsize=64)
def parameters_of(conditions: Conditions) -> Parameters:
    """Parameters of the kernels under these conditions, for a whole run."""
    c = conditions.scaled
    lattice, mu = c.lattice, float(c.damping)
    motion, force = forced_motion(c.forcing, float(c.a), mu)
    bonds, norm = _couplings(lattice, float(c.gamma), float(c.spring), mu)
    low, high = wall_rows(c.walls, lattice.sites)
    # no eigenvalue of K is beyond its norm (Gershgorin), so no mode is faster than its root
    fastest = mu + float(bonds.pulls[3].max())
    rate, top = max(math.sqrt(norm), fastest, 0.25), float(motion[:, 0].max())
    if bonds.pulls[1:].any():  # the series are those of the forcing as well
        rate = max(rate, top)
    # (w h)^j/j! is at most 3^3/3! = 4.5, so that a mode's series loses less than a digit
    step = min(STEP, 3.0 / rate)
    # a site that rests on its wall moves, in v, with the forcing: its harmonics must converge too
    rest_step = step * rate / max(rate, top)
    mean = float(force[force[:, 0] == 0.0, 1].sum())
    ring = isinstance(lattice, Ring) and c.spring == 0.0 and mean == 0.0
    # a function of the speed takes the place of k, not of the shares that sites have of it
    back = lattice.restitutions if c.restitution is not None else float(c.k) * lattice.restitutions
    walls = np.array([low, high, np.minimum(high, -low), back])
    where = (ring, float(c.gamma), bonds, walls)
    steps = step, rest_step, powers_needed(step * rate)
    return Parameters(*where, mu, c.restitution is not None, *steps, mean, motion, force)


@lru_cache(maxsize=64)
def forced_motion(forcing: Forcing, a: float, damping: float) -> tuple[Array, Array]:
    """a g(t) with ``g'' + mu g' = F/a``, the forced motion without couplings and without what a
    mean does; and F(t). Of each harmonic m, A and B in a row."""
    m, A, B = np.array(forcing.harmonics, dtype=float).reshape(-1, 3).T
    A, B = a * A, a * B  # of f, f'' = F
    # -m^2 g + i m mu g = -m^2 f for f = (A - i B) exp(i m t)
    waves, weight = m > 0.0, np.where(m > 0.0, -(m**2), 1.0)
    turned = waves * (A - 1j * B) / (1.0 - 1j * damping / np.where(waves, m, 1.0))
    motion = np.column_stack([m, turned.real, -turned.imag])
    return motion, np.column_stack([m, weight * A, weight * B])


def _couplings(
    lattice: Finite, gamma: float, spring: float, damping: float
) -> tuple[Couplings, float]:
    """Couplings and springs per unit mass, and the largest sum over a row of their sizes."""
    start, other, weight, own, ground, size = _bonds(lattice)
    springs = spring * lattice.springs
    slow = damping * (lattice.dampings - 1.0)  # beyond the damping of the forced motion
    pulls = np.array([gamma * own + springs, lattice.drive - 1.0, gamma * ground + springs, slow])
    norm = float((abs(gamma) * size + springs).max())  # derivatives are taken beyond 0, too
    return Couplings(start, other, gamma * weight, pulls), norm


@lru_cache(maxsize=64)
def _bonds(lattice: Finite) -> tuple[Array, Array, Array, Array, Array, Array]:
    """Bonds of sites to others, in rows, those entries of the stiffness that are sites' own, and
    sums over its rows and of their sizes: all per unit mass and coupling."""
    from scipy import sparse  # the installation compiles this module's neighbours without it

    table = sparse.csr_array(stiffness_of(lattice) / np.asarray(lattice.masses)[:, None])
    own: Array = table.diagonal()
    ground: Array = table.sum(axis=1)
    size: Array = abs(table).sum(axis=1)
    # what rounding leaves of a sum that is zero would drive the lattice
    ground[abs(ground) <= 1e-14 * size] = 0.0
    beside = sparse.csr_array(sparse.diags_array(own) - table)
    beside.eliminate_zeros()
    start, other = (x.astype(np.int64) for x in (beside.indptr, beside.indices))
    return start, other, np.asarray(beside.data, dtype=np.float64), own, ground, size


def workspace_of(sites: int, size: int, harmonics: int) -> Workspace:
    """Room for a step of so many powers, driven by so many harmonics."""
    v, w, origin, last_v, last_w, reach, when = np.zeros((7, sites))
    side, held, released, listed = np.zeros((4, sites), np.int8)
    hits, candidates, due, many = (np.zeros(n, np.int64) for n in (sites, sites + 1, sites, 2))
    # a change at one site reaches every second power one site farther
    wide = 4 * ((size - 1) // 2) + 1
    rows, patch, near = np.empty((size, sites)), np.empty((size, wide)), np.empty((5, wide))
    push, column, drive = np.empty((size, 1)), np.empty(size), np.empty((harmonics, 3))
    step = (v, w, rows, origin, last_v, last_w, reach, patch, near, push, column, drive, when)
    waits = np.full(2, np.nan), np.array([NEVER, 0.0]), np.zeros(1, np.int64)
    return Workspace(*step, side, held, released, hits, *waits, candidates, listed, due, many)


# --- the integrator -------------------------------------------------------------------------------


@dataclass
class EventDriven:
    state: State
    conditions: Conditions
    t0: float
    sample: Sample | None = None
    parameters: Parameters = field(init=False)
    workspace: Workspace = field(init=False)
    log: EventLog = field(init=False)

    def __post_init__(self) -> None:
        self.parameters = on = parameters_of(self.conditions)
        self.workspace = workspace_of(self.state.u.size, on.size, len(on.force))
        kinds = ("i8", "i8", "f8", "i8", "i1", "i1", "f8", "f8", "f8")
        self.log = EventLog(*(np.zeros(256, kind) for kind in kinds))
        self.state = State(self.state.u.copy(), self.state.v.copy())

    @property
    def most_periods(self) -> int:
        return periods_at_once(self.state.u.size, self.sample)

    def advance(self, periods: int, first: int, *, span: float = PERIOD) -> Chunk:
        u, v = self.state
        strobe_u, strobe_v = np.empty((2, periods, u.size))
        sample, ended = self.sample, np.zeros(3, np.int64)
        chosen = np.array([n % u.size for n in sample.sites] if sample else [], np.int64)
        count = sample.per_period if sample else 0
        grid: Array = PERIOD / max(count, 1) * np.arange(count)
        dense_u, dense_v = np.full((2, periods, count, chosen.size), np.nan)
        self.log.used[0] = done = 0
        self.workspace.pause[:] = NEVER, 0.0
        status, answer = ASKS, self.workspace.answer
        with deferred():
            while status in (ASKS, FULL):
                here = (self.t0, span, first + done, self.parameters, self.workspace, self.log)
                dense = DenseOutput(chosen, grid, dense_u[done:], dense_v[done:])
                EVENT_LOOP(u, v, *here, dense, strobe_u[done:], strobe_v[done:], ended)
                count, status, site = ended.tolist()
                done += count
                if status == ASKS:
                    answer[1] = self.conditions.restitution_at(float(answer[0]))
                elif status == FULL:  # its last period once more, with twice the room
                    twice: list[Any] = [np.append(x, np.zeros_like(x)) for x in self.log]
                    self.log = EventLog(*twice)
        if status not in (DONE, CHATTER):
            raise NotConverged(self._failed(status, first + done))
        impacts, rests = event_tables(self.log, self.t0)
        kept = (strobe_u[:done], strobe_v[:done], dense_u[:done], dense_v[:done], impacts, rests)
        if status != CHATTER:
            return Chunk(first, *kept)
        return Chunk(first, *kept, RunStop.CHATTER, self._chatter(site, first + done))

    def _chatter(self, site: int, period: int) -> str:
        """Tell what was seen; whether it would come to rest is not known."""
        first = int(self.log.used[0])  # those of the period are behind it
        there = slice(first, first + int(self.workspace.hits.sum()))
        here = self.log.site[there] == site
        walls, speeds = self.log.wall[there][here][-2:], np.abs(self.log.before[there][here])
        how = f"chattering on the wall {walls[-1]:+d}, at {speeds[-1]:.2g} in the end"
        if walls[0] != walls[-1]:
            how = f"from wall to wall at a speed of {speeds[-1]:.3g}"
        return (
            f"site {site} has more than {MOST} impacts in period {period}, {how} "
            f"(k = {self.conditions.k}); the state before that period is kept"
        )

    def _failed(self, status: int, period: int) -> str:
        if status == ASTRAY:
            return (
                f"in period {period} the search for the next impact did not come to an end "
                f"({self.conditions}): please report it with the state"
            )
        return (
            f"the motion blows up in period {period} (a = {self.conditions.a}, k = "
            f"{self.conditions.k}): velocities beyond all reason; check the state and the forcing"
        )


def event_tables(log: EventLog, t0: float) -> tuple[NDArray[np.void], NDArray[np.void]]:
    """Impacts, and rests and releases, with times counted from t0."""
    used = int(log.used[0])
    _, period, phase, site, kind, wall, before, after, push = (column[:used] for column in log)

    def table(rows: NDArray[np.bool_], dtype: np.dtype[Any]) -> NDArray[np.void]:
        events = np.empty(int(rows.sum()), dtype)
        # rebounds that are summed up may go on into the next period
        late = np.where(kind[rows] == BEGINS_REST, push[rows], 0.0)
        when = phase[rows] + late
        events["time"] = PERIOD * period[rows] + (when - t0)
        events["period"] = period[rows] + ((late > 0.0) & (when - t0 >= PERIOD))
        events["phase"] = when % PERIOD
        events["site"], events["wall"] = site[rows], wall[rows]
        return events

    hits = kind == HIT
    impacts, rests = table(hits, IMPACT), table(~hits, REST)
    impacts["before"], impacts["after"] = before[hits], after[hits]
    impacts["acceleration"] = push[hits]
    rests["begins"] = kind[~hits] == BEGINS_REST
    return impacts, rests


# --- white noise on every site: u'' = ... + noise xi(t) -------------------------------------------


@dataclass
class Noisy(EventDriven):
    """An integrator of rigid walls whose sites are kicked.

    Over a time dt white noise changes a velocity by a normal number of variance noise^2 dt. All of
    it comes in the middle of dt, so that moments of a smooth motion are right to (omega dt)^2.
    Kicks depend on the seed and the number of the period alone, not on where chunks are cut.
    """

    noise: float = 0.0
    seed: int = 0

    def advance(self, periods: int, first: int, *, span: float = PERIOD) -> Chunk:
        chunks: list[Chunk] = []
        for period in range(first, first + periods):
            chunks.append(self._period(period, span))
            if chunks[-1].stop is not None:
                break
        return replace(chunks[-1], first=first, **joined_chunks(chunks))

    def _period(self, period: int, span: float) -> Chunk:
        """Half a dt, a kick, a whole dt, a kick, ..., half a dt; no state where it chatters."""
        start, t0 = State(*(x.copy() for x in self.state)), self.t0
        # 16 kicks in a step of the series: 64 in a period, more where modes are fast
        count = math.ceil(16 * span / self.parameters.step)
        dt = span / count
        size = self.noise * math.sqrt(dt)
        kicks = size * np.random.default_rng([self.seed, period]).normal(size=(count, start.u.size))
        ends = [0.0, *(dt * (np.arange(count) + 0.5)).tolist(), span]
        chunks = []
        for i, (begin, end) in enumerate(pairwise(ends)):
            self.t0 = within_period(t0 + begin)
            chunks.append(super().advance(1, period, span=end - begin))
            self.t0 = t0
            for table in (chunks[-1].impacts, chunks[-1].rests):
                table["time"] += begin
            if chunks[-1].stop is not None:  # nothing is kept of a period that does not end
                self.state = start
                return chunks[-1]
            if i < count:
                self.state.v[:] += kicks[i]
        return replace(chunks[-1], **joined_chunks(chunks, *EVENTS))
