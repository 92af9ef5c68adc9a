"""Orbits from parameters: symmetric breathers, their asymmetric arms, and orbits of finite lattices
shot from impact to impact, from whatever is known of them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from contbreather.checks import flag, kind_of, number, one_of, real, state_rows
from contbreather.continuation.branches.switching import switch
from contbreather.continuation.curve.point import Point
from contbreather.continuation.curve.problem import Problem
from contbreather.continuation.walk.trace import trace
from contbreather.errors import BadInput, NoSolution, NotConverged, partial_result
from contbreather.lattice.band_averages import UniformLattice
from contbreather.lattice.chain import Ring, lattice_of
from contbreather.lattice.conditions import Conditions, Walls, in_time_of_drive
from contbreather.lattice.finite import Finite, finite
from contbreather.lattice.forcing import Drive
from contbreather.lattice.formula import forcing_of
from contbreather.one_thread import one_thread
from contbreather.orbits.by_impacts import ByImpacts, impact_problem
from contbreather.orbits.clearance import check_admissible
from contbreather.orbits.closed_form import symmetric as symmetric
from contbreather.orbits.closed_form import symmetric_roots as symmetric_roots
from contbreather.orbits.orbit import Orbit, in_order, orbit_at
from contbreather.orbits.orbit_events import pitchfork
from contbreather.orbits.section import (
    Impact,
    ImpossibleSequence,
    Section,
    Sequenced,
)
from contbreather.parameters import NAMES, NEEDED
from contbreather.stability.verdict import THRESHOLD

LONGEST = 10_000  # periods of the forcing that a seed is followed over
MOST = 200  # impacts in one section
TOGETHER = 8  # digits to which the times of impacts are compared


@partial_result()
def asymmetric(
    a: float,
    gamma: float,
    k: float,
    *,
    arm: int = 1,
    forcing: Drive | None = None,
    lattice: UniformLattice | None = None,
    omega: float = 1.0,
    inadmissible: bool = False,
) -> Orbit:
    """The asymmetric breather at given parameters, followed from its pitchfork.

    Parameters
    ----------
    a, gamma, k : float
        Amplitude of the forcing, coupling, restitution coefficient.
    arm : {1, -1}
        Which of the two mirror images: t2 - t1 > pi for 1.
    forcing : Forcing, str or function of t, optional
        `Harmonic` unless given.
    lattice : InfiniteChain, Ring or Lattice, optional
        `InfiniteChain` unless given.
    omega : float
        Frequency of the drive, as for `symmetric`.
    inadmissible : bool
        Return the solution of the equations also where it is no orbit of the chain, beyond GR.

    Raises
    ------
    NoSolution
        If the arms do not reach that amplitude; the sentence says where they are. `Inadmissible`,
        which carries the `orbit`, if a `site` meets a wall before, and at what `time`.

    Examples
    --------
    >>> orbit = asymmetric(0.82, 0.04, 0.8)
    >>> round(orbit.p, 7), round(abs(orbit.c), 7)
    (1.093139, 0.0373542)
    """
    one_of("arm", arm, (1, -1))
    drive, lattice = forcing_of(forcing), lattice_of(lattice)
    start = symmetric(a, gamma, k, forcing=drive, lattice=lattice, omega=omega, root=1)
    a, gamma, k = start.a, start.gamma, start.k
    reach = {"a": (0.05 * a, 20.0 * a)}
    # with walls lifted, there and on the arms: the end is judged below
    branch = trace(
        start, "a", within=reach, events=[pitchfork()], inadmissible=True, progress=False
    )
    tried = []
    for point in (p for p in branch.special if p.kind == "PF"):
        # (t2 - t1 - pi)^2 = coefficient (a - a_PF) to leading order: its sign has the side of the
        # arms
        up = point.detail.get("coefficient", a - point["a"]) > 0.0
        tried.append(f"{point['a']:.6g} ({'upwards' if up else 'downwards'})")
        if (a > point["a"]) != up:
            continue
        window = {"a": (point["a"], a) if up else (a, point["a"])}
        for last in (one[-1] for one in switch(point, within=window, events=(), progress=False)):
            # the edge of the window is met to rounding, whatever else ends the branch comes before
            if arm * last.solution.asymmetry > 0.0 and abs(last["a"] - a) <= 1e-12 * a:
                return _solved(last.problem.at(a=a), inadmissible)
    where = f"pitchforks at a = {', '.join(tried)}" if tried else "no pitchfork was found"
    raise NoSolution(
        f"no asymmetric breather at a = {a!r} (gamma = {gamma}, k = {k}, {drive.describe()}) "
        f"on the arms that leave the symmetric branch: {where}."
    )


def _solved(problem: Problem, inadmissible: bool) -> Orbit:
    orbit = orbit_at(problem.solve(tolerance=1e-11)[0])
    at = f"a = {orbit.a!r} (gamma = {orbit.gamma}, k = {orbit.k})"
    check_admissible(orbit, inadmissible, f"no asymmetric breather at {at}: ")
    return orbit


@one_thread
def shooting(
    seed: Any,
    *,
    sites: int | None = None,
    lattice: Finite | None = None,
    sequence: Sequence[tuple[int, int]] | None = None,
    period: float = 2.0 * math.pi,
    symmetric: bool | None = None,
    a: float | None = None,
    gamma: float | None = None,
    k: float | None = None,
    damping: float | None = None,
    spring: float | None = None,
    walls: Any = None,
    omega: float | None = None,
    forcing: Drive | None = None,
    t: float = 0.0,
    threshold: float = THRESHOLD,
    inadmissible: bool = False,
) -> Problem:
    """An orbit with impacts on a finite lattice, shot from impact to impact: a problem to trace.

    Parameters
    ----------
    seed : Orbit, Problem or Point, pair of arrays, or dict
        Where to begin. An orbit, a problem or a point of a branch of orbits; a state
        ``(u, v)`` of the ring at time `t`, of a simulation for instance; or impact times by hand,
        ``{"t1": ..., "t2": ...}``.
    sites : int, optional
        N of a ring, 1 to some hundred; that of the seed unless given. 1 is the single oscillator.
    lattice : Ring or Lattice, optional
        Any finite lattice, in place of `sites`. Seeds of other lattices are taken there by their
        impact times.
    sequence : sequence of (site, wall), optional
        The impacts of a period in order (of half a period if symmetric). For a breather or an
        orbit that of the seed; for a state what it is seen to hit, if not given.
    period : float
        ``2 pi n``, for states and impact times; n odd for symmetric orbits.
    symmetric : bool, optional
        Shoot half the period and close with ``u -> -u``. By default as the seed: True for a
        symmetric breather. False on a symmetric seed opens it up, so that it may become
        asymmetric.
    a, gamma, k, forcing, damping, spring, omega : optional
        The first three are needed for states and times; all overrule those of other seeds.
    walls : (low, high), one of each site, or dict of site and (low, high), optional
        -1 and 1 unless given; None in place of a wall that is not there.
    t : float
        Time of a state.
    threshold : float
        Modulus over the whole period that counts as a Neimark-Sacker point on this ring.
    inadmissible : bool
        Return the solution of the equations also where a site is behind a wall between impacts.

    Returns
    -------
    Problem
        Its start solves the equations. ``orbit_at(problem)`` is the orbit.

    Raises
    ------
    BadInput
        Times out of order, parameters out of range; `ImpossibleSequence`, with the `sequence`,
        for impacts that cannot be, or that the seed does not have.
    NotConverged
        If Newton's iteration does not end at an orbit of this sequence; carries `residual`,
        `iterations` and, as `last`, what it ended at.
    Inadmissible
        If what solves the equations is no orbit of the ring; a `NoSolution`, it carries the
        `orbit`, and the `site` and the `time` of the contact.

    Examples
    --------
    >>> import contbreather as cb
    >>> b = cb.symmetric(a=0.7, gamma=0.04, k=0.8)
    >>> shot = shooting(b, sites=20)
    >>> orbit = orbit_at(shot)
    >>> orbit.stability()
    <ring of 20: unstable, 2 multipliers; largest |multiplier| over 2 pi 1.00607444 > threshold \
1.005>
    """
    overrides: dict[str, Any] = {
        "a": a, "gamma": gamma, "k": k, "damping": damping, "spring": spring, "forcing": forcing,
        "walls": walls, "omega": omega,
    }  # fmt: skip
    t = number("t", t, -math.inf, math.inf, "the time of a state")
    threshold = number("threshold", threshold, 1.0, 1e300, "a modulus above 1")
    sign = None if symmetric is None else -1 if flag("symmetric", symmetric) else 1
    guess = _guess(seed, overrides, _lattice(lattice, sites), sequence, _turns(period), sign, t)
    problem = guess.driven(impact_problem(Orbit(guess.representation), threshold))
    try:
        solved, convergence = problem.solve()
    except NotConverged as error:
        raise NotConverged(
            f"no orbit of {guess.describe()} near the seed: {error}",
            residual=error.residual,
            iterations=error.iterations,
            last=orbit_at(error.last) if isinstance(error.last, Problem) else None,
        ) from error
    orbit = orbit_at(solved)
    # the equations hold, too, with impacts out of order, or from outside of a wall
    in_order(orbit, convergence.iterations)
    check_admissible(orbit, inadmissible)
    return solved


def _turns(period: float) -> int:
    length = real(period)
    # a period that was computed is 2 pi n to its rounding only
    turns = round(length / (2.0 * math.pi)) if abs(length) < math.inf else 0
    if not 1 <= turns <= LONGEST or abs(length - 2.0 * math.pi * turns) > 1e-9 * turns:
        raise BadInput(
            f"period = {period!r}: the forcing has period 2 pi, so an orbit has a multiple of it, "
            f"2 pi n with n = 1, 2, ... up to {LONGEST}."
        )
    return turns


def _lattice(source: Any, sites: int | None) -> Finite | None:
    """The finite lattice that was asked for, None where that of the seed is meant."""
    if source is None:
        return None if sites is None else Ring(sites)
    lattice = finite(source)
    if sites is not None and sites != lattice.sites:
        raise BadInput(f"sites = {sites} and the {lattice.describe()}: give one of the two.")
    return lattice


def _guess(
    seed: Any,
    overrides: dict[str, Any],
    lattice: Finite | None,
    sequence: Any,
    turns: int,
    sign: int | None,
    t: float,
) -> Orbit:
    if isinstance(seed, Problem):
        seed = orbit_at(seed)
    if isinstance(seed, Point):
        seed = seed.solution
    guess: Callable[[Conditions], ByImpacts]
    if isinstance(seed, Orbit):
        lattice = lattice or seed.lattice
        if lattice.sites is None:
            raise BadInput("the seed lives on the infinite chain: say on which ring, sites=N.")
        guess = partial(from_orbit, seed, sequence, sign)
    elif isinstance(seed, Mapping):
        if lattice is None or sequence is None:
            raise BadInput("a seed of impact times needs sites=... and sequence=..., too.")
        # times tell nothing of a symmetry: without a word on it the whole period is shot
        section = Section(sequence, turns, sign or 1).placed(lattice)
        guess = partial(from_times, seed, section)
    else:
        listed = isinstance(seed, Sequence) or (isinstance(seed, np.ndarray) and seed.ndim)
        if isinstance(seed, str) or not listed or len(seed) != 2:
            raise BadInput(
                "a seed is an orbit, a point of a branch, a state (u, v), of a periodic motion its "
                f"state, or a dict of impact times; got {kind_of(seed)}."
            )
        size = np.size(seed[0])
        if lattice is not None and lattice.sites != size:
            raise BadInput(
                f"the state has {size} sites, but sites = {lattice.sites} was asked for."
            )
        lattice = lattice or Ring(size)
        guess = partial(from_state, tuple(seed), t, sequence, turns, sign or 1)
    on = _conditions(overrides, lattice, seed)
    with in_time_of_drive(on) as scaled:
        return Orbit(guess(scaled), on.omega, on.params)


def _conditions(overrides: Mapping[str, Any], lattice: Finite, seed: Any) -> Conditions:
    values: dict[str, Any] = {
        name: getattr(seed, name, None) if value is None and isinstance(seed, Orbit) else value
        for name, value in overrides.items()
    }
    missing = [name for name in NEEDED if values[name] is None]
    if missing:
        raise BadInput(f"this seed does not know {', '.join(missing)}: give them by name.")
    params = {name: values[name] for name in NAMES if values[name] is not None}
    walls, drive = Walls.given(values["walls"]), forcing_of(values["forcing"])
    return Conditions(**params, forcing=drive, walls=walls, lattice=lattice).checked()


# --- first guesses at impacts ---------------------------------------------------------------------

# A seed is an orbit, a state, or impact times alone. A state is simulated over a section; where
# only times are known, impulses and offsets are those that suit them best, a linear problem.


def from_state(
    state: Any, time: float, sequence: Any, turns: int, sign: int, on: Conditions
) -> ByImpacts:
    """A state of the lattice, simulated over one section: its impacts in order."""
    # dear to import
    from contbreather.simulation.integrator import RunStop
    from contbreather.simulation.simulate import completed, let_go
    from contbreather.simulation.states import PERIOD, State, wall_rows

    u, v = state_rows(state)
    low, high = wall_rows(on.walls, u.size)
    beyond = np.maximum(u - high, low - u)
    n = int(beyond.argmax())
    if beyond[n] > 1e-6:  # a seed may be beyond a wall by this much
        raise BadInput(
            f"u[{n}] = {u[n]:.9g} of the seed is outside the walls at {low[n]:g} and {high[n]:g}."
        )
    T = math.pi * turns * (1.0 if sign < 0 else 2.0)
    start, length = State(np.clip(u, low, high), v), T / PERIOD
    run = completed(let_go(start, on, periods=length, t0=time, progress=False))
    impacts: list[Impact] = []
    for hit in run.impacts[: MOST + 1]:
        impulse = float(hit["after"] - hit["before"])
        contact = Impact(int(hit["site"]), int(hit["wall"]), float(hit["time"]), impulse)
        # a section that begins at an impact ends at it, too
        late = [contact.time - e.time - T for e in impacts if e.site == contact.site]
        if not any(abs(apart) < 10.0**-TOGETHER for apart in late):
            impacts.append(contact)
    words = " ".join(f"({hit.site}, {hit.wall:+d}) at t = {hit.time:.6g}" for hit in impacts[:12])
    if not impacts or len(impacts) > MOST or run.stop is not RunStop.DONE:
        raise BadInput(
            f"the seed meets {'no wall' if not impacts else 'walls too often'} within a section of "
            f"length {T:.6g} from t = {time:.6g}: {words or 'it flies free'}; give another seed, "
            "or its impact times by hand."
        )
    impacts.sort(key=lambda hit: (round(hit.time, TOGETHER), hit.site))
    # three sections hold every start there is: it goes on as it was, or turned over
    m, walls = len(impacts), tuple((hit.site, hit.wall) for hit in impacts)
    course = Section(walls, turns, sign).course(impacts, 3)
    first = _start(course, sequence, on.lattice, words)
    chosen = course[first : first + m]
    section = Section(tuple((c.site, c.wall) for c in chosen), turns, sign)
    times = np.array([hit.time for hit in chosen])
    # the first impact within half a period of 0
    times -= section.period * math.floor((times[0] + 0.5 * section.period) / section.period)
    return ByImpacts.closest(on, section, times, [hit.impulse for hit in chosen])


def _beginning(course: Sequence[Impact], wanted: Sequenced) -> int | None:
    """Which of the impacts of three sections comes first in a sequence of one."""
    m, impacts = len(course) // 3, tuple(impact[:2] for impact in course)
    return next((i for i in range(2 * m) if impacts[i : i + m] == wanted), None)


def _start(course: Sequence[Impact], sequence: Any, lattice: Finite, words: str) -> int:
    if sequence is None:  # the first on the wall at +1, by choice
        return next((i for i, impact in enumerate(course) if impact.wall > 0), 0)
    wanted = Section(sequence).placed(lattice).impacts
    if (first := _beginning(course, wanted)) is not None:
        return first
    m = len(course) // 3
    raise ImpossibleSequence(
        f"the seed does not hit its walls in the order {wanted}: followed over one section it "
        f"meets {words}; give that sequence, another seed, or the impact times by hand.",
        sequence=wanted,
        met=tuple((impact.site, impact.wall) for impact in course[:m]),
    )


def from_times(times: Mapping[str, float], section: Section, on: Conditions) -> ByImpacts:
    """Guess from impact times alone, ``{"t1": ..., "t2": ...}``."""
    names = [f"t{j + 1}" for j in range(section.count)]
    unknown, missing = sorted(set(times) - set(names)), sorted(set(names) - set(times))
    if unknown or missing:
        raise BadInput(
            f"a seed by hand has one time for each impact, {names}: "
            f"missing {missing}, not known {unknown}."
        )
    wanted = "a time of impact"
    t = [number(name, times[name], -math.inf, math.inf, wanted) for name in names]
    return ByImpacts.closest(on, section, t)


def from_orbit(orbit: Orbit, sequence: Any, sign: int | None, on: Conditions) -> ByImpacts:
    """Put an orbit under conditions of a finite lattice, opened up or by its half if asked for."""
    if sign == -1 and not orbit.symmetric:
        raise BadInput("this orbit was not shot as a symmetric one; start from a breather.")
    if sign == 1:
        orbit = orbit.unfolded()
    if sequence is not None:
        return _otherwise(orbit, on, sequence)
    section = orbit.section.on(on.lattice)
    return ByImpacts.closest(on, section, orbit.times, orbit.impulses)


def _otherwise(orbit: Orbit, on: Conditions, sequence: Any) -> ByImpacts:
    """Begin a seed with another impact; or put the same times at other sites."""
    section = replace(orbit.section, impacts=sequence).placed(on.lattice)
    m = orbit.section.count
    if section.count != m:
        raise BadInput(
            f"the seed has {m} impacts in a section, the sequence {section.impacts} "
            f"{section.count}: give impact times by hand."
        )
    former = orbit.section.placed(on.lattice)
    impacts = [
        Impact(*hit, *impact[2:]) for hit, impact in zip(former.impacts, orbit.impacts, strict=True)
    ]
    course = former.course(impacts, 3)
    first = _beginning(course, section.impacts) or 0
    return ByImpacts.closest(on, section, [impact.time for impact in course[first : first + m]])
