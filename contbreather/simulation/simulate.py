"""Runs of lattices: eq. (1) with the reset law (2), damping and springs, or the smooth walls (21).

Between impacts on rigid walls the flow is summed to rounding (`contbreather.simulation.taylor`),
impacts are bracketed so that none can be missed and polished to 1e-12, and rests on a wall are part
of the motion: the only error left is rounding. Smooth walls have a solver (`smooth`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, TypeVar, Unpack

import numpy as np
from numpy.typing import NDArray

from contbreather.checks import MOST, number, one_of, whole
from contbreather.columns import Columns, Variable
from contbreather.errors import BadInput
from contbreather.lattice.conditions import Conditions
from contbreather.lattice.parse import as_typed
from contbreather.parameters import NAMES, NEEDED, parameter
from contbreather.progress import Bar
from contbreather.simulation.integrator import (
    EVENTS,
    IMPACT,
    REST,
    Chunk,
    EventDriven,
    Integrator,
    Noisy,
    RunStop,
    Sample,
    blank,
    check_sample,
    in_chunks,
    joined_chunks,
)
from contbreather.simulation.smooth import TOLERANCE, SmoothIntegrator
from contbreather.simulation.states import (
    LONGEST,
    PERIOD,
    LatticeParameters,
    ModelParameters,
    SmoothConditions,
    State,
    ranged,
    start_of,
    within,
    within_period,
)
from contbreather.storage.netcdf import check_lengths
from contbreather.storage.serialise import NotSerialisable, serialised, to_dict
from contbreather.tables import HtmlRepr, Sheet

Array = NDArray[Any]


class Record(NamedTuple):
    """Chosen sites at many times: `u` and `v` have shape (times, sites)."""

    times: Array
    sites: tuple[int, ...]
    u: Array
    v: Array

    def __repr__(self) -> str:
        return f"<Record of sites {list(self.sites)} at {len(self.times)} times>"


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class States(Columns, HtmlRepr):
    """Run between walls of either kind; attributes as in `SimulationRun`."""

    times: Array
    strobe: State
    final: State
    end: float
    record: Record | None
    conditions: Any
    stop: RunStop
    reason: str = ""

    along = "strobe"

    def table(self) -> Sheet:
        """Its size, its end, and what it moved under."""
        on = self.conditions
        rows: list[Any] = [("sites", self.sites), ("periods", self.periods)]
        if hasattr(self, "impacts"):
            rows.append(("impacts", len(self.impacts)))
        rows += [("until t =", self.end), ("then |u| <=", abs(self.final.u).max())]
        names = (*NEEDED, "damping", *(["omega"] if on.omega != 1.0 else []))
        numbers = ((name, getattr(on, name)) for name in names)
        return Sheet.of(rows + [(name, x) for name, x in numbers if not math.isnan(x)])

    def columns(self) -> dict[str, Array]:
        return {"time": self.times, "u": self.strobe.u, "v": self.strobe.v}

    def attributes(self) -> dict[str, Any]:
        """Conditions it was simulated under, and how it ended."""
        on = self.conditions
        about = {name: getattr(on, name) for name in (*NAMES, "lam", "m") if hasattr(on, name)}
        about |= {"forcing": on.forcing.describe(), "lattice": on.lattice.describe()}
        about |= {"walls": as_typed(on.walls)} if hasattr(on, "walls") else {}
        about |= {"noise": getattr(self, "noise", 0.0), "stop": self.stop.value}
        return {name: value for name, value in about.items() if value != ""}

    def variables(self) -> dict[str, Variable]:
        """Everything: the states at the strobe and at the end, sampled sites."""
        grid = ("strobe", "site")
        data: dict[str, Variable] = {
            "time": (("strobe",), self.times),
            "u": (grid, self.strobe.u),
            "v": (grid, self.strobe.v),
            "final_u": (("site",), self.final.u),
            "final_v": (("site",), self.final.v),
            "end": ((), self.end),
        }
        if self.record is not None:
            sampled = ("sample", "sampled_site")
            data["sample_time"] = ("sample",), self.record.times
            data["sampled_sites"] = ("sampled_site",), np.array(self.record.sites)
            data |= {"sample_u": (sampled, self.record.u), "sample_v": (sampled, self.record.v)}
        return data

    @property
    def sites(self) -> int:
        return self.final.u.size

    @property
    def periods(self) -> int:
        """Whole periods completed."""
        return len(self.times) - 1

    @property
    def length(self) -> str:
        """Its periods as they are told, with the fraction at its end."""
        return f"{(self.end - float(self.times[0])) / PERIOD:.10g}"

    @property
    def span(self) -> str:
        """Its length in words."""
        return f"{self.length} period{'s' * (self.length != '1')}"

    def since(self, period: int) -> Any:
        """Its whole periods from one on, as a run that begins with that one."""
        # without the fraction of a period at its end: sections are of whole ones
        states = State(self.strobe.u[period:], self.strobe.v[period:])
        left: dict[str, Any] = {"times": self.times[period:], "strobe": states}
        left |= {"final": State(*(x[-1].copy() for x in states)), "end": float(self.times[-1])}
        for name in {*EVENTS} & {*vars(self)}:
            table = getattr(self, name)
            left[name] = table[table["period"] >= period].copy()
            left[name]["period"] -= period
        return replace(self, **left, record=None)


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class SimulationRun(States):
    """Run between rigid walls, from `simulate`.

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
    noise : float
        Strength of the noise it was under.
    """

    impacts: NDArray[np.void]
    rests: NDArray[np.void]
    noise: float = 0.0

    along = "impact"

    def columns(self) -> dict[str, Array]:
        """The table of impacts; `to_xarray` has the states as well."""
        return {name: self.impacts[name] for name in IMPACT.names or ()}

    def variables(self) -> dict[str, Variable]:
        """Everything: impacts, rests, the states at the strobe, sampled sites."""
        tables = {"impact": self.impacts, "rest": self.rests}
        return super().variables() | {
            f"{kind}_{name}": ((kind,), table[name])
            for kind, table in tables.items()
            for name in table.dtype.names or ()
        }

    def at_site(self, n: int, wall: int | None = None) -> NDArray[np.void]:
        """The impacts of one site, on one wall or on both."""
        chosen = self.impacts["site"] == whole("n", n, -MOST) % self.sites
        if wall is not None:
            chosen &= self.impacts["wall"] == one_of("wall", wall, (1, -1))
        return self.impacts[chosen]

    def __repr__(self) -> str:
        what = self.reason or self.stop.value
        return f"<Run of {self.sites} sites over {self.span}: {len(self.impacts)} impacts; {what}>"


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class SmoothRun(States):
    """Run between smooth walls, from `simulate_smooth`: attributes of `Run` but for impacts."""

    def __repr__(self) -> str:
        return (
            f"<SmoothRun of {self.sites} sites over {self.span}, "
            f"m = {self.conditions.m:g}; {self.stop.value}>"
        )


def simulate(
    state: Any,
    *,
    periods: float,
    t0: float = 0.0,
    sample: Sample | None = None,
    progress: bool | Bar | None = None,
    noise: float = 0.0,
    seed: int = 0,
    **on: Unpack[ModelParameters],
) -> SimulationRun:
    """Let a lattice of impacting sites go from any state.

    Parameters
    ----------
    state : pair of array_like, shape (N,), or Orbit, or Point
        Displacements and velocities of all sites at t0; N = 1 is a single oscillator. An orbit of
        a finite lattice, or a point of a branch of such, is taken at t0, with its own lattice,
        walls, forcing and parameters, but for those that are given.
    periods : float
        Length of the run in periods 2 pi of the forcing; a fraction is allowed at the end.
    t0 : float
        Time of the state; the forcing depends on it.
    sample : Sample, optional
        Sites to record densely, in whole periods. Impacts and the states once in a period are
        always recorded.
    progress : bool, optional
        Show progress on standard error; by default on long runs at a terminal.
    noise : float
        Strength of white noise on every site, ``u'' = ... + noise xi(t)`` with ``<xi(t) xi(s)> =
        delta(t - s)``: kicks of the velocities, at least 64 in a period, between exact flights.
        The time is that in which `omega` is measured, as it is of `a` and `damping`.
    seed : int
        Of the noise: the same seed gives the same run, to the last digit.
    a, gamma, k : float
        Amplitude of the forcing, coupling (below 1/4 on a ring), restitution in [0, 1]; needed
        for a state that is no orbit.
    restitution : callable, optional
        In place of k: ``restitution(speed)``, from 0 to 1, of the speed before an impact. It is
        asked at each of them; nothing that is written to files has it.
    damping, spring : float
        Of ``u'' + damping u' + spring u + ...``, per unit mass; damping up to 1e4, for steps are
        3/damping at most.
    omega : float
        Frequency of the drive, ``F = a f(omega t)``, 1 unless given. Times are phases omega t,
        velocities are in d omega, and so is the speed that `restitution` is asked for.
    forcing : Forcing or str, optional
        `Harmonic`, F = -a cos t, unless given.
    lattice : Ring or Lattice, optional
        A ring of as many sites as the state has, unless given.
    walls : pair, array_like or dict, optional
        ``(low, high)`` for all sites, one of each, or a dict of sites and pairs, None where there
        is no wall, a number for both; -1 and 1 unless given.

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
    >>> from contbreather.lattice import Ring
    >>> from contbreather.orbits import symmetric
    >>> b = symmetric(a=0.5, gamma=0.08, k=0.8, lattice=Ring(20))
    >>> run = simulate(b, periods=1)
    >>> bool(abs(run.final.u - run.strobe.u[0]).max() < 1e-13)
    True
    >>> len(run.impacts)
    2
    """
    start, conditions = start_of(state, None, t0, **on)
    strength = number("noise", noise, 0.0, 1e6, "the strength of the noise, from 0 to 1e6")
    kicked: Any = {"noise": strength, "seed": whole("seed", seed, 0)}
    shared: Any = {"periods": periods, "t0": t0, "sample": sample, "progress": progress}
    run: SimulationRun = let_go(start, conditions, **shared, **kicked)
    return run


class SmoothModelParameters(LatticeParameters, total=False):
    """The keywords of `simulate_smooth` that say what a lattice moves under."""

    k: float | None
    lam: float | None


def simulate_smooth(
    state: Any,
    *,
    m: float,
    periods: float,
    t0: float = 0.0,
    sample: Sample | None = None,
    tolerance: float = TOLERANCE,
    progress: bool | Bar | None = None,
    **on: Unpack[SmoothModelParameters],
) -> SmoothRun:
    """Let a lattice with smooth walls (21) go from any state.

    Parameters
    ----------
    state : pair of array_like, shape (N,), or Orbit
    periods, t0, sample, progress, on
        As in `simulate`, without walls: they are at -1 and 1.
    m : float
        Hardness of the walls, from 0.5 to 1e4; (21) has natural numbers, a real one is taken with
        |u|.
    k, lam : float
        Among `on`: restitution of the impacting limit, or lambda of (21), one of the two.
    tolerance : float
        Relative and absolute, of the solver: Dormand and Prince's method of order 8.

    Raises
    ------
    BadInput
        Parameters outside their range, or a state far behind the walls.
    NotConverged
        If the energy blows up or the solver cannot go on.

    Examples
    --------
    >>> from contbreather.orbits import symmetric
    >>> b = symmetric(a=0.5, gamma=0.08, k=0.8)
    >>> run = simulate_smooth(b.state(20), a=0.5, gamma=0.08, k=0.8, m=20, periods=1)
    >>> bool(abs(run.final.u - run.strobe.u[0]).max() < 0.05)
    True
    """
    start, conditions = start_of(state, parameter("m", m), t0, **on)
    settings: dict[str, Any] = {"sample": sample, "tolerance": tolerance, "progress": progress}
    run: SmoothRun = let_go(start, conditions, periods=periods, t0=t0, **settings)
    return run


def let_go(
    state: State,
    on: Conditions | SmoothConditions,
    *,
    periods: float,
    t0: float = 0.0,
    sample: Sample | None = None,
    progress: bool | Bar | None = None,
    tolerance: float = TOLERANCE,
    noise: float = 0.0,
    seed: int = 0,
) -> Any:
    """The run of a state under rigid or smooth walls that have been checked."""
    check_sample(sample, state.u.size)
    shared: Any = {"periods": periods, "t0": t0, "progress": progress}
    if isinstance(on, SmoothConditions):
        number("tolerance", tolerance, 1e-16, 0.01, "that of the solver, from 1e-16 to 0.01")
        left = gathered(SmoothIntegrator(state, on, within_period(t0), sample, tolerance), **shared)
        return SmoothRun(**{name: x for name, x in left.items() if name not in EVENTS})
    start = within(state, on.walls), on, within_period(t0), sample
    if noise and sample is not None:
        raise BadInput("sample: sites are not recorded densely under noise; leave one out")
    # a velocity over the root of a time, as it is with the time in units of 1/omega
    scaled = noise / on.omega**1.5
    integrator = Noisy(*start, scaled, seed) if noise else EventDriven(*start)
    return SimulationRun(**gathered(integrator, **shared), noise=noise)


def length_of(periods: float, sites: int) -> float:
    """The length of a run, or a sentence; also where the states of so many sites would not fit into
    memory."""
    length = number("periods", periods, 0.0, LONGEST, "a length in periods from 0 to 1e12")
    size = 16e-9 * sites * (length + 1.0)
    if size > 1.0:  # GB; twice that while it is put together
        raise BadInput(
            f"periods = {periods:.12g}: the states of {sites} sites once in each would be "
            f"{size:.3g} GB, and a run in memory may have 1; shorten it, "
            "or keep it on disk: record(...), contbreather simulate --stream"
        )
    return length


def gathered(
    integrator: Integrator, *, periods: float, t0: float, progress: bool | Bar | None
) -> dict[str, Any]:
    """Let it go: what a run has, its impacts and rests among it; times count from t0."""
    sample, length = integrator.sample, length_of(periods, integrator.state.u.size)
    count, rest = int(length), length - int(length)
    start = State(integrator.state.u.copy(), integrator.state.v.copy())
    chunks: list[Chunk] = []
    last: dict[str, Any] = {}
    try:
        for chunk in in_chunks(integrator, periods=count, progress=progress):
            chunks.append(chunk)
        if rest > 0.0 and not (chunks and chunks[-1].stop):
            end = integrator.advance(1, count, span=PERIOD * rest)
            # its state is none once in a period, and none at all where it chatters before its end
            of_end: Any = {name: getattr(end, name) for name in (*EVENTS, "stop", "reason")}
            chunks.append(replace(blank(sample, end.u[:0], end.v[:0]), **of_end))
            if end.periods:
                time = float(t0) + PERIOD * count + PERIOD * rest
                last = {"final": State(end.u[-1], end.v[-1]), "end": time}
    except KeyboardInterrupt:
        last["stop"] = RunStop.INTERRUPTED
    return {**joined(chunks, start, float(t0), sample), **last, "conditions": integrator.conditions}


def joined(chunks: list[Chunk], start: State, t0: float, sample: Sample | None) -> dict[str, Any]:
    """Fields of a run of successive chunks, from the state before them on; t0 is that of period 0,
    from which their times count."""
    sampled = ("dense_u", "dense_v") if sample else ()
    before = blank(sample, start.u[None], start.v[None])
    table = joined_chunks([before, *chunks], "u", "v", *EVENTS, *sampled)
    u, v, first = table["u"], table["v"], chunks[0].first if chunks else 0
    begin, record = t0 + PERIOD * first, None
    if sample is not None:
        dense = [table[name].reshape(-1, len(sample.sites)) for name in sampled]
        times = begin + PERIOD / sample.per_period * np.arange(len(dense[0]))
        record = Record(times, tuple(n % start.u.size for n in sample.sites), *dense)
    for name in EVENTS:
        table[name]["time"] += t0
        table[name]["period"] -= first
    return {
        "times": begin + PERIOD * np.arange(len(u)),
        "strobe": State(u, v),
        "final": State(u[-1].copy(), v[-1].copy()),
        "end": begin + PERIOD * (len(u) - 1),
        "record": record,
        "stop": (chunks[-1].stop if chunks else None) or RunStop.DONE,
        "reason": chunks[-1].reason if chunks else "",
        **{name: table[name] for name in EVENTS},
    }


S = TypeVar("S", bound=Any)  # a run or a sweep


def completed(run: S) -> S:
    """Hand over an inner run; where Ctrl-C cut it short, the call around it ends, too."""
    if run.stop is RunStop.INTERRUPTED:
        raise KeyboardInterrupt
    return run


# --- on disk --------------------------------------------------------------------------------------

Values = Mapping[str, Any]


def to_content(run: States) -> dict[str, Any]:
    try:
        conditions = to_dict(run.conditions)
    except NotSerialisable as error:
        raise BadInput(
            f"{error.args[0]!r} is of your own making, and a file holds numbers only: give the "
            "forcing as Fourier, Symbolic or Samples, and k as a number, and simulate with that"
        ) from error
    return {
        "conditions": conditions,
        "stop": run.stop.name,
        "reason": run.reason,
        "columns": {name: (*variable, {}) for name, variable in run.variables().items()},
        **({"noise": run.noise} if isinstance(run, SimulationRun) and run.noise else {}),
    }


def states_of(columns: Values, stop: str, reason: str) -> dict[str, Any]:
    record = None
    check_lengths(columns, ("time", "u", "v"), "states")
    check_lengths({**columns, "u": columns["u"].T}, ("final_u", "final_v", "u"), "sites")
    if "sample_time" in columns:
        check_lengths(columns, ("sample_time", "sample_u", "sample_v"), "samples")
        sites = tuple(columns["sampled_sites"].tolist())
        record = Record(columns["sample_time"], sites, columns["sample_u"], columns["sample_v"])
    return {
        "times": columns["time"],
        "strobe": State(columns["u"], columns["v"]),
        "final": State(columns["final_u"], columns["final_v"]),
        "end": float(columns["end"]),
        "record": record,
        "stop": RunStop[stop],
        "reason": reason,
    }


def event_table(columns: Values, what: str, dtype: np.dtype[Any]) -> Any:
    """Events from the columns of a file."""
    check_lengths(columns, [f"{what}_{name}" for name in dtype.names or ()], f"{what}s")
    table = np.empty(columns[f"{what}_time"].size, dtype)
    for name in dtype.names or ():
        table[name] = columns[f"{what}_{name}"]
    return table


@serialised("simulated run", SimulationRun, to_content)
def _run(
    columns: Values, conditions: Conditions, stop: str, reason: str, noise: float = 0.0
) -> SimulationRun:
    impacts, rests = event_table(columns, "impact", IMPACT), event_table(columns, "rest", REST)
    shared = states_of(columns, stop, reason)
    return SimulationRun(
        impacts=impacts, rests=rests, conditions=ranged(conditions), noise=noise, **shared
    )


@serialised("smooth run", SmoothRun, to_content)
def _smooth_run(columns: Values, conditions: dict[str, Any], stop: str, reason: str) -> SmoothRun:
    on = ranged(SmoothConditions(**conditions))
    return SmoothRun(conditions=on, **states_of(columns, stop, reason))
