"""GR: a site comes to touch a wall that it must not touch. One test, one locus for every orbit.

The test is the clearance from the walls, the locus ``u = wall, u' = 0`` at an unknown time for the
site that is closest. A road says how the motion of that site depends on its unknowns.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from contbreather.breathers.clearance import Gap, Terms, Watch, closest, gaps_of_idle, rivals
from contbreather.breathers.orbit import Orbit
from contbreather.continuation import Event, Locus, Point
from contbreather.continuation.curve import Curve
from contbreather.continuation.newton import Undefined
from contbreather.continuation.point import Meeting

Array = NDArray[np.float64]

VANISHED = 1e-8  # an impact at a smaller velocity is none
ALIKE = 1e-5  # a coupling below which sites are told apart as they would be there
SAME = 1e-9  # displacements that differ by less are mirror images
AT_IMPACT = 1e-9  # a contact this close to an impact of its site, in periods, is that impact


class Crest(NamedTuple):
    """One site whose crest is followed."""

    motion: Callable[[Orbit, float], Terms]
    slopes: Callable[[Curve, Orbit, float], Any]
    """Derivatives of displacement and velocity in all unknowns and free parameters, (2, n)."""


class Ends(NamedTuple):
    """What else ends the grazing of a crest besides another one."""

    events: tuple[Event, ...] = ()
    scale: Callable[[Point], float] = lambda point: 1.0
    meets: Mapping[str, tuple[Event, ...]] = {}


def _refused(orbit: Orbit) -> Locus:
    raise Undefined("an impact itself loses its velocity: no grazing to follow")


def grazing(
    crest: Callable[[Orbit, int], Crest],
    *,
    ends: Callable[[Orbit], Ends] = lambda orbit: Ends(),
    shallow: Callable[[Orbit], Locus] = _refused,
    weakly: Callable[[Orbit], Watch] | None = None,
) -> Event:
    """GR, and VI where an impact itself loses its velocity.

    Parameters
    ----------
    crest : callable
        How a road follows one site.
    ends : callable, optional
        What ends the curve of an orbit besides.
    shallow : callable, optional
        The locus of VI, where the road has one.
    weakly : callable, optional
        The same orbit with a little coupling: without it all idle sites climb alike, and the one
        is meant that does highest with it.
    """

    def locus(point: Point) -> Locus:
        orbit = solution_at(point)
        worst = closest(orbit.watch)
        if worst.flight < 0 and weakly is not None and orbit.gamma < ALIKE:
            worst = min(gaps_of_idle(weakly(orbit)))
        return follow(orbit, worst.site, worst.time)

    def follow(orbit: Orbit, site: int, t: float) -> Locus:
        if _is_impact(orbit, site, t):
            return shallow(orbit)
        there, own = orbit.watch.at(site, t)[0], crest(orbit, site)
        place = min(orbit.walls.at(site), key=lambda wall: abs(there - wall))

        def conditions(curve: Curve, z: Array, extra: Array) -> Array:
            u, v, _ = own.motion(solution_at(Point(curve, z)), float(extra[0]))
            return np.array([u - place, v])

        def derivative(curve: Curve, z: Array, extra: Array) -> Array:
            orbit, t = solution_at(Point(curve, z)), float(extra[0])
            return np.column_stack([own.slopes(curve, orbit, t), own.motion(orbit, t)[1:]])

        more = ends(orbit)
        rival = _rival_of(site, mirrored=_is_mirrored(orbit, site, t))
        events = (*more.events, _other_crest(rival, more.scale, follow))
        return Locus({"t": t}, conditions, derivative, events=events, meets=more.meets)

    def test(point: Point) -> float:
        return solution_at(point).admissibility().margin

    return Event("GR", test, ends="domain", locus=locus, examine=_vanishing)


@lru_cache(maxsize=4)
def solution_at(point: Point) -> Orbit:
    """The orbit of a point; kept, for all events ask about the same one in turn."""
    orbit: Orbit = point.solution
    return orbit


def _is_impact(orbit: Orbit, site: int, t: float) -> bool:
    near = AT_IMPACT * orbit.period
    return site in orbit.section.hit and any(
        hit.site == site and abs(math.remainder(t - hit.time, orbit.period)) < near
        for hit in orbit.hits
    )


def _vanishing(point: Point) -> dict[str, str]:
    least = float(np.abs(solution_at(point.ground).incoming).min())
    return {"kind": "VI"} if least < VANISHED else {}


def _is_mirrored(orbit: Orbit, site: int, t: float) -> bool:
    """Whether the crest comes again at the other wall because the orbit is its own mirror image."""
    if orbit.symmetric or orbit.section.turns % 2 == 0:
        return False
    both = [orbit.watch.at(site, time)[0] for time in (t, t + 0.5 * orbit.period)]
    return abs(sum(both)) < SAME


def _rival_of(site: int, *, mirrored: bool) -> Callable[[Point], Gap]:
    def rival(point: Point) -> Gap:
        return min(rivals(solution_at(point).watch, site, point["t"], mirrored=mirrored))

    return rival


def _other_crest(
    rival: Callable[[Point], Gap],
    scale: Callable[[Point], float],
    follow: Callable[[Orbit, int, float], Locus],
) -> Event:
    """Where one crest grazes, all else must still keep off the walls: other sites, and other crests
    of the same one. Where it does not, the limit of existence goes on with that."""

    def margin(point: Point) -> float:
        return rival(point).margin

    def test(point: Point) -> float:
        return margin(point) / scale(point)

    def examine(point: Point) -> dict[str, Any]:
        other = rival(point)
        return {"site": other.site, "time": other.time}

    def locus(point: Point) -> Locus:
        return follow(solution_at(point), point.detail["site"], point.detail["time"])

    base = Event("GR", margin, ends="domain", locus=locus)
    return Meeting("GR-GR", test, ends="domain", base=base, examine=examine)
