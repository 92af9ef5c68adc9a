"""What happens to orbits with impacts on their branch: LP, PF, PD, NS, GR, each with its locus.

A multiplier +1 is a zero of the orbit's own equations, offsets included, so folds (and, in
`contbreather.breathers.wave_road`, branch points) are the engine's; -1 is one scalar, a pair on
the circle is counted and located by two equations for its angle, grazing by two and the time.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contbreather.breathers.clearance import Terms
from contbreather.breathers.grazing import Crest, Ends, grazing, solution_at
from contbreather.breathers.images import simpler_than
from contbreather.breathers.multipliers import (
    STEP,
    Conditions,
    OnCircle,
    by_differences,
    examine_angle,
    examine_real,
    pair_beyond,
    real_multiplier,
)
from contbreather.breathers.orbit import Orbit
from contbreather.breathers.problem import counted
from contbreather.breathers.watched import moved
from contbreather.continuation import Event, Lift, Locus, Point, fold
from contbreather.continuation.boundary import meeting
from contbreather.continuation.curve import Curve
from contbreather.continuation.newton import Undefined
from contbreather.continuation.point import Always
from contbreather.lattice import Lattice, Ring
from contbreather.lattice.periodic import Wave, wave, wave_slope
from contbreather.stability.orbit import OrbitMap
from contbreather.stability.verdict import check_threshold

Array = NDArray[np.float64]

EQUAL = 1e-9  # flights that differ by less are equal

# As k -> 1 the line of Neimark-Sacker points of arms runs into their pitchfork, angle and asymmetry
# shrinking like sqrt(1 - k), or the angle into the edge of the band, like (1 - k)^2: within
# rounding of that it cannot be followed.
_ELASTIC = 1.0 - 1e-5


def orbit_fold() -> Event:
    """LP of an orbit with two impacts and unequal flights.

    Where its flights become equal the branch turns back as well, but that is its pitchfork. There
    the test of a fold and the asymmetry vanish together, and their ratio does not.
    """
    return replace(_off_pitchfork(fold()), locus=_fold_locus)


def _off_pitchfork(event: Event) -> Event:
    return replace(event, test=partial(_per_asymmetry, event))


def _per_asymmetry(event: Event, point: Point) -> float:
    asymmetry = solution_at(point.ground).asymmetry
    return math.nan if asymmetry == 0.0 else event.value(point) / asymmetry


def _fold_locus(point: Point) -> Locus:
    # on its curve, so does the test of a cusp where both folds of mirror images meet
    plain = fold()
    assert plain.locus is not None
    own = plain.locus(point)
    return replace(own, events=tuple(map(_off_pitchfork, own.events)))


def pitchfork_of_arms() -> Event:
    """PF of an orbit with two impacts: both flights become equal, ``t2 - t1 = pi``.

    Nothing changes sign there but the asymmetry itself: both arms are mirror images.
    """
    return Event("PF", _asymmetry, locus=Always(Locus({}, _equal_flights, _equal_flights_slope)))


def _asymmetry(point: Point) -> float:
    return solution_at(point).asymmetry


def period_doubling() -> Event:
    """PD: a multiplier passes -1 (`OrbitMap.crosses`)."""
    locus, examine = Always(OnCircle(nu=1.0).locus()), partial(examine_real, -1.0)
    return Event("PD", _minus_one, count=_outside, locus=locus, examine=examine)


def orbit_neimark_sacker() -> Event:
    """NS: a complex pair of multipliers of the infinite chain leaves the unit circle."""
    off, outside = partial(_pairs, 0), partial(_pairs, 1)
    return Event("NS", off, count=outside, locus=_arc_locus, examine=examine_angle)


def events_on(lattice: Lattice, threshold: float) -> tuple[Event, ...]:
    """The events that any orbit with impacts can meet, apart from multipliers +1."""
    touch = grazing(_crest, ends=_ends_of_grazing)
    if isinstance(lattice, Ring):
        check_threshold(threshold)
        return real_multiplier("PD", -1.0), pair_beyond(threshold), touch
    return period_doubling(), orbit_neimark_sacker(), touch, tally()


def _minus_one(point: Point) -> float:
    return solution_at(point).map.crosses(-1.0)


def _outside(point: Point) -> int:
    """Beside PD: two multipliers that pass -1 within one step are seen by it."""
    return counted(point.solution.map).count


def tally() -> Event:
    """What no label explains: the number of multipliers outside changes, on the infinite chain."""
    return Event("MX", None, count=_certainly_outside)


def _certainly_outside(point: Point) -> float | int:
    found = counted(solution_at(point).map)
    return found.count if found.certain else math.nan


# --- equal flights ------------------------------------------------------------------------------


def _equal_flights(curve: Curve, z: Array, extra: Array) -> Array:
    return np.array([z[curve.slots["t2"]] - z[curve.slots["t1"]] - math.pi])


def _equal_flights_slope(curve: Curve, z: Array, extra: Array) -> Array:
    row = np.zeros((1, z.size))
    row[0, curve.slots["t2"]], row[0, curve.slots["t1"]] = 1.0, -1.0
    return row


def symmetric_again(point: Point) -> Lift:
    """The branch of symmetric breathers, in its own problem."""
    breather = simpler_than(solution_at(point))
    if breather is None:
        raise Undefined("the flights are not equal here")
    return Lift(breather.problem, point.curve.free[-1])


# --- Neimark-Sacker -------------------------------------------------------------------------------


@lru_cache(maxsize=512)
def _asked(map: OrbitMap) -> tuple[float, int]:
    return map.pairs()


def _pairs(which: int, point: Point) -> float | int:
    """How far the next pair is off the circle (0), or how many are outside (1)."""
    return _asked(solution_at(point).map)[which]


def _arc_locus(point: Point) -> Locus:
    """F = 0 on the circle, at the angle where it is nearest to that."""
    map = solution_at(point).map
    if map.gamma == 0.0:
        raise Undefined("at gamma = 0 there is no band for a pair to come out of")
    ends = {"k": (0.0, _ELASTIC)}
    return OnCircle(_off_the_edge).locus(2.0 * map.nearest(), domain=ends)


def _off_the_edge(conditions: Conditions, curve: Curve, z: Array, extra: Array) -> Array:
    """By steps of gamma and the angle that keep off the edge of the band, where F has a root."""
    map = solution_at(Point(curve, z)).map
    steepness = 4.0 * map.periods**2 / map.edge  # of the edge, as nu, in gamma
    room = 0.02 * abs(2.0 * map.edge - float(extra[0])) / (1.0 + steepness)
    return by_differences(conditions, curve, z, extra, step=min(STEP, max(room, 1e-8)))


# --- grazing --------------------------------------------------------------------------------------


def _crest(orbit: Orbit, site: int) -> Crest:
    """A site with its share of the offsets as it is where the curve sets out."""
    share = _offset_share(orbit, site)
    slopes, motion = partial(_motion_slopes, site, share), partial(_motion, site, share)
    return Crest(site, slopes, motion)


def _motion(site: int, share: Array, orbit: Orbit, t: float) -> Terms:
    u, v, w = moved(orbit, site, t)
    return u + float(share @ orbit.offsets), v, w


def _offset_share(orbit: Orbit, site: int) -> Array:
    """Weights of the offsets in the static displacement of a site.

    On a boundary that runs into gamma = 0 a site keeps to what holds for gamma > 0.
    """
    size = len(orbit.offsets)
    if orbit.gamma == 0.0 and site not in orbit.section.hit:
        return np.zeros(size)
    flight = orbit.flight
    unit = [replace(flight, offsets=tuple(row)).offset(site) for row in np.eye(size).tolist()]
    return np.array(unit, dtype=float)


def _motion_slopes(site: int, share: Array, curve: Curve, orbit: Orbit, t: float) -> Array:
    """Of displacement and velocity at a fixed time."""
    f, a, impulses = orbit.forcing, orbit.a, orbit.impulses
    answers = _answers(orbit, site, t, wave)
    slopes: dict[str, Any] = {"a": (f.f(t), f.df(t)), "k": (0.0, 0.0), "c": (share[0], 0.0)}
    slopes["p"] = 2.0 * np.sign(impulses) @ answers[:, :2]
    for i, (row, impulse) in enumerate(zip(answers, impulses, strict=True), start=1):
        slopes[f"J{i}"], slopes[f"t{i}"] = row[:2], -impulse * row[1:]
    slopes |= {f"c{i}": (own, 0.0) for i, own in enumerate(share, start=1)}
    if "gamma" in curve.free:
        slopes["gamma"] = impulses @ _answers(orbit, site, t, wave_slope)[:, :2]
    for name in {*f.params} & {*curve.free}:
        slopes[name] = a * f.f_param(name, t, 0), a * f.f_param(name, t, 1)
    return np.array([slopes[name] for name in (*curve.problem.start, *curve.free)]).T


def _answers(orbit: Orbit, site: int, t: float, make: Callable[..., Wave]) -> Array:
    """What a unit impulse of each impact does to a site: value, slope, curvature."""
    lattice, found = orbit.lattice, []
    for one in orbit.impacts:
        distance = lattice.distance(site - one.site)
        answer = make(lattice, orbit.gamma, distance, orbit.section.turns)
        found.append(answer.at(t - one.time)[:3])
    return np.array(found)


def _ends_of_grazing(orbit: Orbit) -> Ends:
    """The grazing of an arm ends at its pitchfork, on the side of the arm.

    There that of the other arm begins: the margin of the mirrored crest vanishes together with the
    asymmetry, and their ratio does not. So that this end is known by one name, margins are those
    per asymmetry.
    """
    asymmetry = orbit.asymmetry if orbit.section.two_impacts else 0.0
    if abs(asymmetry) <= EQUAL:
        return Ends(meets={"PF": ()})
    side = math.copysign(1.0, asymmetry)
    off = partial(_towards, side)
    pitchfork = replace(meeting("GR", pitchfork_of_arms()), test=off, ends="domain")
    return Ends((pitchfork,), partial(_while_asymmetric, side), {"PF": ()})


def _towards(side: float, point: Point) -> float:
    return side * solution_at(point.ground).asymmetry


def _while_asymmetric(side: float, point: Point) -> float:
    asymmetry = _towards(side, point)
    return asymmetry if asymmetry > EQUAL else math.nan
