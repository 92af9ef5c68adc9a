"""Impact-to-impact shooting on a finite lattice: from any seed to a problem to trace."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from contbreather.checks import flag, kind_of, number, real
from contbreather.continuation import Point, Problem
from contbreather.errors import BadInput, NotConverged
from contbreather.lattice import Forcing, Ring, forcing_of
from contbreather.lattice.conditions import Conditions, Walls
from contbreather.lattice.finite import Finite, finite
from contbreather.orbits.clearance import LIMIT
from contbreather.orbits.exact_modes import ExactModes, modal_problem
from contbreather.orbits.initial_guesses import from_orbit, from_state, from_times
from contbreather.orbits.orbit import Orbit, checked, orbit_at
from contbreather.orbits.refusals import Inadmissible
from contbreather.orbits.section import Section, check_possible, checked_impacts
from contbreather.parameters import NAMES, NEEDED
from contbreather.stability.verdict import THRESHOLD

LONGEST = 10_000  # periods of the forcing that a seed is followed over


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
    forcing: Forcing | str | None = None,
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
    a, gamma, k, forcing, damping, spring : optional
        The first three are needed for states and times; all overrule those of other seeds.
    walls : (low, high) or dict of site and (low, high), optional
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
    given: dict[str, Any] = {
        "a": a, "gamma": gamma, "k": k, "damping": damping, "spring": spring, "forcing": forcing,
        "walls": walls,
    }  # fmt: skip
    t = number("t", t, -math.inf, math.inf, "the time of a state")
    threshold = number("threshold", threshold, 1.0, 1e300, "a modulus above 1")
    sign = None if symmetric is None else -1 if flag("symmetric", symmetric) else 1
    flight = _guess(seed, given, _lattice(lattice, sites), sequence, _turns(period), sign, t)
    check_possible(flight.section, flight.conditions)
    problem = modal_problem(Orbit(flight), threshold)
    try:
        solved, found = problem.solve()
    except NotConverged as error:
        raise NotConverged(
            f"no orbit of {Orbit(flight).describe()} near the seed: {error}",
            residual=error.residual,
            iterations=error.iterations,
            last=orbit_at(error.last) if isinstance(error.last, Problem) else None,
        ) from error
    orbit = orbit_at(solved)
    checked(orbit, found.iterations)
    verdict = orbit.admissibility()
    if not flag("inadmissible", inadmissible) and verdict.margin < -LIMIT:
        raise Inadmissible(
            f"{verdict.reason} What solves the equations is returned with inadmissible=True.",
            orbit=orbit,
        )
    return solved


def _turns(period: float) -> int:
    given = real(period)
    turns = round(given / (2.0 * math.pi)) if abs(given) < math.inf else 0
    if not 1 <= turns <= LONGEST or abs(given - 2.0 * math.pi * turns) > 1e-9 * turns:
        raise BadInput(
            f"period = {period!r}: the forcing has period 2 pi, so an orbit has a multiple of it, "
            f"2 pi n with n = 1, 2, ... up to {LONGEST}."
        )
    return turns


def _lattice(given: Any, sites: int | None) -> Finite | None:
    """The finite lattice that was asked for, None where that of the seed is meant."""
    if given is None:
        return None if sites is None else Ring(sites)
    lattice = finite(given)
    if sites is not None and sites != lattice.sites:
        raise BadInput(f"sites = {sites} and the {lattice.describe()}: give one of the two.")
    return lattice


def _guess(
    seed: Any,
    given: dict[str, Any],
    lattice: Finite | None,
    sequence: Sequence[tuple[int, int]] | None,
    turns: int,
    sign: int | None,
    t: float,
) -> ExactModes:
    """A first guess from any kind of seed."""
    if isinstance(seed, Problem):
        seed = orbit_at(seed)
    if isinstance(seed, Point):
        seed = seed.solution
    if isinstance(seed, Orbit):
        if lattice is None and seed.lattice.sites is None:
            raise BadInput("the seed lives on the infinite chain: say on which ring, sites=N.")
        on = _conditions(given, lattice or seed.lattice, seed)
        return from_orbit(seed, on, sequence, sign)
    if isinstance(seed, Mapping):
        if lattice is None or sequence is None:
            raise BadInput("a seed of impact times needs sites=... and sequence=..., too.")
        section = Section(checked_impacts(sequence), turns, sign or 1).placed(lattice)
        return from_times(_conditions(given, lattice), section, seed)
    listed = isinstance(seed, Sequence) or (isinstance(seed, np.ndarray) and seed.ndim)
    if isinstance(seed, str) or not listed or len(seed) != 2:
        raise BadInput(
            f"a seed is an orbit, a point of a branch, a state (u, v) or a dict of impact times; "
            f"got {kind_of(seed)}."
        )
    size = np.size(seed[0])
    if lattice is not None and lattice.sites != size:
        raise BadInput(f"the state has {size} sites, but sites = {lattice.sites} was asked for.")
    on = _conditions(given, lattice or Ring(size))
    return from_state(on, tuple(seed), t, sequence, turns=turns, sign=sign or 1)


def _conditions(given: Mapping[str, Any], lattice: Finite, seed: Orbit | None = None) -> Conditions:
    values: dict[str, Any] = {
        name: getattr(seed, name, None) if value is None else value for name, value in given.items()
    }
    missing = [name for name in NEEDED if values[name] is None]
    if missing:
        raise BadInput(f"this seed does not know {', '.join(missing)}: give them by name.")
    known = {name: values[name] for name in NAMES if values[name] is not None}
    walls, drive = Walls.given(values["walls"]), forcing_of(values["forcing"])
    return Conditions(**known, forcing=drive, walls=walls, lattice=lattice).checked()
