"""Impact-to-impact shooting on a finite lattice: any sequence of impacts as a problem.

Unknown are the times of all impacts of a section and the state of the lattice just before the
first one. The equations: each impact finds its site on its wall, and the section closes. The state
includes the mean of a ring, which nothing pins between impacts: where the ring comes to sit is part
of the answer, and no mode needs a treatment of its own.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contbreather.breathers.clearance import LIMIT
from contbreather.breathers.flight_map import Section
from contbreather.breathers.itinerary import Itinerary, check_walls
from contbreather.breathers.refusals import ImpossibleSequence, Inadmissible
from contbreather.breathers.ring_orbit import RingOrbit
from contbreather.breathers.shooting_events import LIFTS, events_of
from contbreather.breathers.shooting_images import images_of, simpler_than
from contbreather.breathers.shooting_seeds import (
    by_hand,
    checked,
    flown,
    listed_section,
    moved,
)
from contbreather.checks import number, real
from contbreather.continuation import Point, Problem
from contbreather.continuation.problem import Curve
from contbreather.errors import BadInput, NotConverged
from contbreather.lattice import Forcing, Ring, check_gamma, forcing_of
from contbreather.lattice.conditions import OWN, Conditions, Walls
from contbreather.lattice.finite import Finite, finite
from contbreather.stability.verdict import THRESHOLD as PAPER

FloatArray = NDArray[np.float64]

WEAK = 1e-9  # below this coupling sites do not feel each other: they may rest anywhere


@dataclass(frozen=True)
class Shooting:
    """The equations of one itinerary, as functions of all that can change.

    ``x = (t1 .. tm, q, r)``; `params` names those of the `Conditions`.
    """

    itinerary: Itinerary
    conditions: Conditions

    def section(self, x: FloatArray, params: Mapping[str, float]) -> Section:
        """The section flown from these unknowns; kept, because residual, derivatives and events
        ask for the same few in turn."""
        return _flown(
            self.itinerary, self.conditions.at(params), np.asarray(x, dtype=float).tobytes()
        )

    def residual(self, x: FloatArray, params: Mapping[str, float]) -> FloatArray:
        return self.section(x, params).residual()

    def jacobian(self, x: FloatArray, params: Mapping[str, float]) -> FloatArray:
        return self.section(x, params).jacobian()

    def sensitivity(self, x: FloatArray, params: Mapping[str, float], name: str) -> FloatArray:
        return self.section(x, params).sensitivity(name)

    def interpret(self, point: Point) -> RingOrbit:
        return RingOrbit(self.section(point.x, point.params))

    def images(self, x: FloatArray, params: Mapping[str, float]) -> tuple[FloatArray, ...]:
        """Other solutions that are the same orbit, or its mirror image."""
        found = images_of(self.section(x, params))
        return tuple(np.concatenate([one.t, one.q, one.r]) for one in found)

    def simpler(self, point: Point) -> Problem | None:
        """The problem of half the period, where the orbit repeats itself after half of it."""
        found = simpler_than(self.section(point.x, point.params))
        return None if found is None else problem_of(RingOrbit(found))


def check_coupling(itinerary: Itinerary, on: Conditions) -> None:
    """`BadInput` where nothing brings the sites back: then no one state belongs to an orbit."""
    lattice = itinerary.lattice
    check_walls(itinerary, on.walls)
    if lattice.highest_gamma <= on.gamma:
        check_gamma(on.gamma)  # says why
    if max(on.gamma, on.spring) < WEAK and itinerary.sites > 1:
        raise BadInput(
            f"gamma = {on.gamma!r} on the {lattice.describe()}: sites that do not feel each other "
            "may rest anywhere, so there is no one orbit; take sites=1, or a spring."
        )
    walls = {wall for _, wall in itinerary.impacts}
    if (
        on.spring < WEAK
        and not itinerary.symmetric
        and len(walls) == 1
        and itinerary.basis.lam.min() < WEAK
    ):
        raise ImpossibleSequence(
            f"the sequence {itinerary.impacts} hits the wall at {walls.pop():+d} only: every "
            "impact pushes a lattice that nothing holds the same way and it never comes back; let "
            "it hit both, or give it a spring.",
            sequence=itinerary.impacts,
        )


def _loose(itinerary: Itinerary, on: Conditions) -> bool:
    """Whether idle sites may rest anywhere without coupling; an orbit that comes back with the
    opposite sign has them rest at 0."""
    return on.spring < WEAK and itinerary.sites > 1 and not itinerary.symmetric


@lru_cache(maxsize=64)
def _flown(itinerary: Itinerary, on: Conditions, unknowns: bytes) -> Section:
    x, m = np.frombuffer(unknowns), itinerary.count
    K = (x.size - m) // 2
    return Section(itinerary, x[:m], x[m : m + K], x[m + K :], on)


def problem_of(orbit: RingOrbit, *, threshold: float = PAPER) -> Problem:
    """The shooting equations with an orbit as their start, and all its events.

    Columns: ``t1, t2, ...`` and the arrays ``q, r`` of unknowns; a, gamma, k, damping, spring and
    the parameters of the forcing; ``p``, half the momentum (``p1, p2, ...`` unless all are the
    same), the offset ``c``, for two impacts ``asymmetry``, t2 - t1 less half a period;
    ``unstable``, the number of multipliers beyond the threshold, and the condition number
    ``condition``: computed when asked for.

    Parameters
    ----------
    orbit : RingOrbit
    threshold : float
        Modulus over the whole period from which a multiplier counts as unstable.
    """
    section, itinerary = orbit.section, orbit.itinerary
    shooting = Shooting(itinerary, section.conditions)
    times = {f"t{j + 1}": float(time) for j, time in enumerate(section.t)}
    return Problem(
        shooting.residual,
        {**times, "q": section.q, "r": section.r},
        section.conditions.params,
        jacobian=shooting.jacobian,
        sensitivity=shooting.sensitivity,
        events=events_of(itinerary, threshold),
        record=_columns(itinerary, threshold),
        domain={
            "gamma": (
                WEAK if _loose(itinerary, section.conditions) else 0.0,
                itinerary.lattice.highest_gamma,
            ),
            "k": (0.0, 1.0),
            "a": (0.0, math.inf),
            "damping": (0.0, math.inf),
            "spring": (0.0, math.inf),
        },
        interpret=shooting.interpret,
        images=shooting.images,
        simpler=shooting.simpler,
        lifts=LIFTS,
        label=f"shooting, {itinerary.describe()}",
    )


def _columns(itinerary: Itinerary, threshold: float) -> dict[str, Any]:
    """What is recorded besides the unknowns."""

    def momentum(j: int) -> Any:
        return lambda point: 0.5 * abs(float(point.solution.impulses[j]))

    count = itinerary.count
    same = count == 1 or (count == 2 and itinerary.local and not itinerary.symmetric)
    names = {"p": 0} if same else {f"p{j + 1}": j for j in range(count)}
    columns: dict[str, Any] = {name: momentum(j) for name, j in names.items()}
    if not itinerary.symmetric:
        columns["c"] = lambda point: point.solution.c
    if same and count == 2:
        columns["asymmetry"] = lambda point: point["t2"] - point["t1"] - 0.5 * itinerary.period
    columns["unstable"] = lambda point: point.solution.stability(threshold=threshold).unstable
    return {**columns, "condition": lambda point: point.solution.condition}


def shot_orbit(problem: Problem) -> RingOrbit:
    """The orbit that a shooting problem starts from."""
    here = Curve(problem, ())
    orbit: RingOrbit = Point(here, here.start).solution
    return orbit


# --- the front door -------------------------------------------------------------------------


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
    threshold: float = PAPER,
    inadmissible: bool = False,
) -> Problem:
    """An orbit with impacts on a finite lattice, shot from impact to impact: a problem to trace.

    Parameters
    ----------
    seed : Breather, orbit or Point, pair of arrays, or dict
        Where to begin. A breather; an orbit, a problem or a point of a branch of orbits; a state
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
        Its start solves the equations. ``shot_orbit(problem)`` is the orbit.

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
    >>> orbit = shot_orbit(shot)
    >>> orbit.stability()
    <ring of 20: unstable, 2 multipliers; largest |multiplier| over 2 pi 1.00607444 > threshold \
1.005>
    """
    given: dict[str, Any] = {
        "a": a, "gamma": gamma, "k": k, "damping": damping, "spring": spring, "forcing": forcing,
        "walls": walls,
    }  # fmt: skip
    turns = _turns(period)
    threshold = number("threshold", threshold, 1.0, 1e300, "a modulus above 1")
    section = _section(seed, given, _lattice(lattice, sites), sequence, turns, symmetric, real(t))
    check_coupling(section.itinerary, section.conditions)
    problem = problem_of(RingOrbit(section), threshold=threshold)
    try:
        solved, found = problem.solve()
    except NotConverged as error:
        raise NotConverged(
            f"no orbit of {section.itinerary.describe()} near the seed: {error}",
            residual=error.residual,
            iterations=error.iterations,
            last=shot_orbit(error.last) if isinstance(error.last, Problem) else None,
        ) from error
    orbit = shot_orbit(solved)
    checked(orbit.section, found.iterations)
    verdict = orbit.admissibility()
    if not inadmissible and verdict.margin < -LIMIT:
        raise Inadmissible(
            f"{verdict.reason} What solves the equations is returned with inadmissible=True.",
            orbit=orbit,
            site=verdict.site,
            time=verdict.time,
        )
    return solved


def _turns(period: float) -> int:
    turns = round(period / (2.0 * math.pi)) if math.isfinite(period) else 0
    if turns < 1 or abs(period - 2.0 * math.pi * turns) > 1e-9 * turns:
        raise BadInput(
            f"period = {period!r}: the forcing has period 2 pi, so an orbit has a multiple of it, "
            "2 pi n with n = 1, 2, ..."
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


def _section(
    seed: Any,
    given: dict[str, Any],
    lattice: Finite | None,
    sequence: Sequence[tuple[int, int]] | None,
    turns: int,
    symmetric: bool | None,
    t: float,
) -> Section:
    """A first guess from any kind of seed."""
    if isinstance(seed, Mapping):
        if lattice is None or sequence is None:
            raise BadInput("a seed of impact times needs sites=... and sequence=..., too.")
        itinerary = Itinerary(lattice, tuple(sequence), turns, bool(symmetric))
        return by_hand(_conditions(given, None), itinerary, seed)
    if isinstance(seed, Problem):
        seed = shot_orbit(seed)
    if isinstance(seed, Point):
        seed = seed.solution
    if isinstance(seed, RingOrbit):
        return _from_orbit(seed, given, lattice, sequence, symmetric)
    if hasattr(seed, "state"):
        return _from_motion(seed, _conditions(given, seed), lattice, sequence, symmetric)
    if isinstance(seed, str) or not isinstance(seed, Sequence | np.ndarray) or len(seed) != 2:
        raise BadInput(
            f"a seed is a breather, an orbit, a point of a branch, a state (u, v) or a dict of "
            f"impact times; got {type(seed).__name__}."
        )
    on = _conditions(given, seed)
    size = np.size(seed[0])
    if lattice is not None and lattice.sites != size:
        raise BadInput(f"the state has {size} sites, but sites = {lattice.sites} was asked for.")
    where = lattice or Ring(size)
    return flown(on, where, tuple(seed), t, sequence, turns=turns, symmetric=bool(symmetric))


def _conditions(given: Mapping[str, Any], seed: Any) -> Conditions:
    values: dict[str, Any] = {
        name: getattr(seed, name, None) if value is None else value for name, value in given.items()
    }
    missing = [name for name in ("a", "gamma", "k") if values[name] is None]
    if missing:
        raise BadInput(f"this seed does not know {', '.join(missing)}: give them by name.")
    known = {name: values[name] for name in OWN if values[name] is not None}
    walls = Walls.given(values["walls"])
    return Conditions(**known, forcing=forcing_of(values["forcing"]), walls=walls).checked()


def _from_orbit(
    orbit: RingOrbit,
    given: Mapping[str, Any],
    lattice: Finite | None,
    sequence: Sequence[tuple[int, int]] | None,
    symmetric: bool | None,
) -> Section:
    """A shot orbit, on the same lattice or another one, opened up if asked for."""
    section = orbit.section
    if symmetric and not orbit.symmetric:
        raise BadInput("this orbit was not shot as a symmetric one; start from a breather.")
    if symmetric is False:
        section = opened(section)
    if sequence is not None:
        wanted = replace(section.itinerary, impacts=tuple(sequence)).impacts
        if wanted != section.itinerary.impacts:
            raise BadInput(
                f"this orbit has the impacts {section.itinerary.impacts}, not {wanted}; give a "
                "state or times for another sequence."
            )
    section = replace(section, conditions=_conditions(given, orbit))
    if lattice is not None and lattice != section.itinerary.lattice:
        section = moved(section, lattice)
    return section


def opened(section: Section) -> Section:
    """The whole period of a symmetric orbit, as one that need not be symmetric."""
    itinerary = section.itinerary
    if not itinerary.symmetric:
        return section
    times = np.concatenate([section.t, section.t + itinerary.length])
    return replace(section, itinerary=itinerary.whole(), t=times)


def _from_motion(
    seed: Any,
    on: Conditions,
    lattice: Finite | None,
    sequence: Sequence[tuple[int, int]] | None,
    symmetric: bool | None,
) -> Section:
    """A breather or an orbit of any lattice: its impact times, or its state followed."""
    if lattice is None:
        lattice = _lattice(getattr(seed, "lattice", None), None) if _is_finite(seed) else None
    if lattice is None:
        raise BadInput("the seed lives on the infinite chain: say on which ring, sites=N.")
    turns = _turns(getattr(seed, "period", 2.0 * math.pi))
    half = bool(hasattr(seed, "phi") if symmetric is None else symmetric)
    listed = _listed(seed, half)
    if listed is None or not isinstance(lattice, Ring):
        return _without_state(seed, on, lattice, listed, sequence, turns, half)
    times, impacts = listed
    itinerary = Itinerary(lattice, impacts, turns, half)
    start = 0.5 * (times[0] + max(times) - itinerary.length)  # between the last and the first
    state = seed.state(lattice.sites, start)
    if sequence is not None:
        wanted = replace(itinerary, impacts=tuple(sequence))
        if wanted.impacts != itinerary.impacts:
            return flown(on, lattice, state, start, sequence, turns=turns, symmetric=half)
    return listed_section(on, itinerary, np.array(times), state, start)


def _is_finite(seed: Any) -> bool:
    return getattr(getattr(seed, "lattice", None), "sites", None) is not None


def _without_state(
    seed: Any,
    on: Conditions,
    lattice: Finite,
    listed: tuple[list[float], tuple[tuple[int, int], ...]] | None,
    sequence: Sequence[tuple[int, int]] | None,
    turns: int,
    half: bool,
) -> Section:
    """On a lattice that the seed knows nothing of, its impact times; else its state, followed."""
    if listed is None:
        state = seed.state(lattice.sites, 0.0)
        return flown(on, lattice, state, 0.0, sequence, turns=turns, symmetric=half)
    times, impacts = listed
    itinerary = Itinerary(lattice, tuple(sequence or impacts), turns, half)
    if itinerary.count != len(times):
        raise BadInput(
            f"the seed has {len(times)} impacts in a section, the sequence {itinerary.impacts} "
            f"{itinerary.count}: give impact times by hand."
        )
    return by_hand(on, itinerary, {f"t{j + 1}": time for j, time in enumerate(times)})


def _listed(seed: Any, half: bool) -> tuple[list[float], tuple[tuple[int, int], ...]] | None:
    """Times and (site, wall) of the impacts of a seed that knows them."""
    if hasattr(seed, "phi"):
        times, impacts = [float(seed.phi), float(seed.phi) + math.pi], ((0, 1), (0, -1))
        return (times[:1], impacts[:1]) if half else (times, impacts)
    if half or not (hasattr(seed, "times") and hasattr(seed, "sequence")):
        return None
    return [float(time) for time in seed.times], tuple(seed.sequence)
