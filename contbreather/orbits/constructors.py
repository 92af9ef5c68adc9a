"""Orbits from parameters: symmetric breathers, their asymmetric arms, and orbits of finite lattices
shot from impact to impact, from whatever is known of them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from contbreather.checks import flag, kind_of, number, one_of, real
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
from contbreather.orbits.initial_guesses import from_orbit, from_state, from_times
from contbreather.orbits.orbit import Orbit, in_order, orbit_at
from contbreather.orbits.orbit_events import pitchfork
from contbreather.orbits.section import Section, checked_impacts
from contbreather.parameters import NAMES, NEEDED
from contbreather.stability.verdict import THRESHOLD

LONGEST = 10_000  # periods of the forcing that a seed is followed over


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
    solved, _ = problem.solve(tolerance=1e-11)
    orbit = orbit_at(solved)
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
    sequence: Sequence[tuple[int, int]] | None,
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
        section = Section(checked_impacts(sequence), turns, sign or 1).placed(lattice)
        guess = partial(from_times, seed, section)
    else:
        listed = isinstance(seed, Sequence) or (isinstance(seed, np.ndarray) and seed.ndim)
        if isinstance(seed, str) or not listed or len(seed) != 2:
            raise BadInput(
                "a seed is an orbit, a point of a branch, a state (u, v) or a dict of impact "
                f"times; got {kind_of(seed)}."
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
