"""Do the sites of a shot orbit keep off their walls wherever the itinerary has no impact?

Margins as in `contbreather.breathers.admissibility`: floats that are positive inside, zero at the
limit and continuous in everything. A site that hits a wall is measured between its impacts, where
``1 - u^2`` vanishes at both ends: what counts is its ratio to ``(s + k) s (L - s)``, s the time
since the one impact, L - s to the next. That margin vanishes, too, when an incoming velocity does.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from contbreather.breathers.admissibility import Admissibility

if TYPE_CHECKING:
    from contbreather.breathers.ring_orbit import Hit, RingOrbit

FloatArray = NDArray[np.float64]

FINE = 64  # points to a half period of the forcing; sixteen to that of its highest harmonic
CLOSE = 1e-4  # crests this close to the highest, by a parabola on the grid, are all polished
LIMIT = 1e-9  # a margin this small is said to be at the limit; whether it is ok its sign decides
NO_WALLS = (-math.inf, math.inf)
ALIKE = 1e-9  # sites whose motions differ by less are images of each other
ENDS = 1e-9  # relative distance from its impacts at which a flight counts as at them


class Gap(NamedTuple):
    """The smallest of the margins of one site: by how much, where, when, and on which flight."""

    margin: float
    site: int
    time: float
    flight: int = -1  # number of the impact it starts from, in order of time; -1: never hits


def clearance(orbit: RingOrbit) -> Admissibility:
    """Whether, and by how much, an orbit keeps off all walls it must not touch.

    Parameters
    ----------
    orbit : RingOrbit

    Returns
    -------
    Admissibility
        ``centre`` is the least margin of the sites that hit a wall, ``neighbours`` that of all
        others, ``max_neighbour`` the largest displacement of those next to a site that does (1 less
        its distance from the nearer wall).
    """
    flights, others = list(gaps_of_flights(orbit)), gaps_of_others(orbit)
    worst = min(flights + others, key=lambda gap: gap.margin)
    beside = _beside(orbit)
    heights = [1.0 - gap.margin for gap in others if gap.site in beside]
    return Admissibility(
        ok=worst.margin > 0.0,
        max_neighbour=max(heights, default=0.0),
        margin=worst.margin,
        reason=_reason(orbit, worst),
        site=worst.site,
        time=worst.time,
        neighbours=min((gap.margin for gap in others), default=1.0),
        centre=min(gap.margin for gap in flights),
        far=1.0,
    )


def _reason(orbit: RingOrbit, worst: Gap) -> str:
    there = orbit.displacement(worst.site, worst.time)
    told = f"site {worst.site} is at u = {there:.9g} at t = {worst.time:.9g}"
    if worst.flight >= 0:
        start, end = flights_of(orbit)[worst.flight]
        if not start.time < worst.time < end.time:
            hit = start if worst.time <= start.time else end
            told = (
                f"site {worst.site} meets its wall at {hit.wall:+d} with the velocity "
                f"{hit.before * hit.wall:.6g} at t = {hit.time:.9g}"
            )
        else:
            told += ", between its impacts"
    if abs(worst.margin) < LIMIT:
        return f"at the limit: {told}."
    if worst.margin > 0.0:
        return f"every site keeps off its walls; closest to the limit: {told}."
    return f"no orbit of these impacts: {told}."


# --- sites that hit a wall ------------------------------------------------------------------


class Room(NamedTuple):
    """Product of the distances of a site from its walls, ``1 - u^2`` between -1 and 1; a wall that
    is not there does not count."""

    low: float
    high: float

    @property
    def one(self) -> bool:
        """Whether there is one wall only."""
        return math.isinf(self.low) or math.isinf(self.high)

    @property
    def width(self) -> float:
        """Size of the slope at a wall."""
        return 1.0 if self.one else self.high - self.low

    @property
    def bend(self) -> float:
        return 0.0 if self.one else -2.0

    def of(self, u: Any) -> Any:
        if math.isinf(self.low):
            return self.high - u
        return u - self.low if math.isinf(self.high) else (self.high - u) * (u - self.low)

    def slope(self, u: float) -> float:
        if math.isinf(self.low):
            return -1.0
        return 1.0 if math.isinf(self.high) else self.high + self.low - 2.0 * u


def flights_of(orbit: RingOrbit) -> list[tuple[Hit, Hit]]:
    """Impacts of one site and the next ones of the same site, over one section."""
    count = orbit.itinerary.count
    hits = orbit.hits
    found = []
    for i, start in enumerate(hits[:count]):
        later = [hit for hit in hits[i + 1 :] if hit.site == start.site]
        if not later:
            first = next(hit for hit in hits if hit.site == start.site)
            later = [first._replace(time=first.time + orbit.period)]
        found.append((start, later[0]))
    return found


def gaps_of_flights(orbit: RingOrbit) -> Iterator[Gap]:
    """The margin of each flight of a site from one impact to its next."""
    for i, (start, end) in enumerate(flights_of(orbit)):
        length = end.time - start.time
        if length <= 0.0:  # the order of two impacts of one site is lost
            yield Gap(length, start.site, end.time, i)
            continue
        s = _grid(_points(orbit, length)) * length
        room = Room(*orbit.conditions.walls.at(start.site))
        u = orbit.displacement(start.site, start.time + s)
        ratio = room.of(u) / ((s + orbit.k) * s * (length - s))
        left, right = (room.width * end for end in _ends(orbit, start, end, length))
        fenced = np.concatenate([[0.1 * s[0]], s, [length - 0.1 * (length - s[-1])]])
        inner = min(
            _deepest(
                orbit, room, start, length, float(s[j]), (float(fenced[j]), float(fenced[j + 2]))
            )
            for j in _dips(ratio)
        )
        least, when = min(inner, (left, 0.0), (right, length))
        scale = 0.25 * length * length * (0.5 * length + orbit.k)
        yield Gap(least * scale, start.site, start.time + when, i)


def _ends(orbit: RingOrbit, start: Hit, end: Hit, length: float) -> tuple[float, float]:
    """The ratio at both impacts, by de l'Hospital, in units of the width of the room."""
    right = end.before * end.wall / (length * (length + orbit.k))
    if orbit.k > 0.0:
        return start.before * start.wall / length, right
    return -0.5 * start.acceleration * start.wall / length, right


@lru_cache(maxsize=32)
def _grid(size: int) -> FloatArray:
    """Between 0 and 1, without the ends, finer towards the start: for small k it is flat."""
    step = 1.0 / size
    return np.concatenate([step * 0.5 ** np.arange(6, 0, -0.5), step * np.arange(1, size)])


def _points(orbit: RingOrbit, length: float) -> int:
    return math.ceil(max(FINE, 16 * orbit.forcing.highest) * max(1.0, length / math.pi))


def _dips(ratio: FloatArray) -> NDArray[np.int64]:
    """Local minima on the grid that may be the lowest; the grid misses less than a tenth."""
    lowest = float(ratio.min())
    low = ratio <= lowest + 0.1 * max(abs(lowest), 0.1 * float(abs(ratio[-1])))
    low[1:] &= ratio[1:] <= ratio[:-1]
    low[:-1] &= ratio[:-1] <= ratio[1:]
    return np.flatnonzero(low)


def _deepest(
    orbit: RingOrbit, room: Room, start: Hit, length: float, s: float, within: tuple[float, float]
) -> tuple[float, float]:
    """Value and place of the minimum of the ratio next to s: Newton, kept in by bisection."""
    best, (low, high), k = (math.inf, s), within, orbit.k
    for _ in range(60):
        u, v, w = orbit.at(start.site, start.time + s)
        n, tilt, bend = room.of(u), room.slope(u), room.bend
        n1, n2 = tilt * v, tilt * w + bend * v * v
        d = (s + k) * s * (length - s)
        d1 = (2.0 * s + k) * (length - s) - (s + k) * s
        d2 = 2.0 * (length - s) - 2.0 * (2.0 * s + k)
        best = min(best, (n / d, s))
        tilt, bend = n1 * d - n * d1, n2 * d - n * d2
        low, high = (low, s) if tilt > 0.0 else (s, high)
        last, s = s, s - tilt / bend if bend > 0.0 else low
        if not low < s < high:
            s = 0.5 * (low + high)
        if abs(s - last) <= 1e-9:  # the value is flat there: this is 1e-18 of it
            break
    return best


# --- all other sites ------------------------------------------------------------------------


def gaps_of_others(orbit: RingOrbit, besides: tuple[int, float] | None = None) -> list[Gap]:
    """The margins of the sites that never hit a wall: the highest, and those beside it that may
    be higher still; of mirror images the one to the right.

    ``besides`` names a crest, by its site and time, that is not to be counted, on sites that move
    alike by symmetry either.
    """
    walls = orbit.conditions.walls
    watched = np.array(
        [n for n in orbit.lattice.idle(orbit.itinerary.hit).tolist() if walls.at(n) != NO_WALLS],
        dtype=np.int64,
    )
    if watched.size == 0:
        return []
    T = orbit.itinerary.length
    size = _points(orbit, T)
    times: FloatArray = orbit.times[0] + T / size * np.arange(size, dtype=float)
    low, high = np.array([walls.at(n) for n in watched.tolist()]).T
    motion = orbit.motion(times)
    u = _height(motion[:, watched], low, high)  # of period T, by symmetry
    before, after = np.roll(u, 1, axis=0), np.roll(u, -1, axis=0)
    crest = (u >= before) & (u >= after)
    bend = np.where(crest, 2.0 * u - before - after, 1.0)
    lift = np.divide((after - before) ** 2, 8.0 * bend, out=np.zeros_like(u), where=bend > 0.0)
    tops = np.where(crest, u + lift, -np.inf)
    if besides is not None:
        apart = (times - besides[1] + 0.5 * T) % T - 0.5 * T
        alike = np.abs(motion[:, watched] - motion[:, [besides[0]]]).max(axis=0) < ALIKE
        tops[np.ix_(np.abs(apart) < 2.5 * T / size, alike)] = -np.inf
    top = tops.max(axis=0)
    enough = float(top.max()) - CLOSE * abs(float(top.max()))
    beside = _beside(orbit)
    near = [i for i, n in enumerate(watched.tolist()) if n in beside or top[i] >= enough]
    chosen = [i for i in near if top[i] > -np.inf]  # some site may have the excepted crest only
    found = []
    for i in chosen:
        crests = np.flatnonzero(tops[:, i] >= top[i] - CLOSE * abs(top[i]))
        n = int(watched[i])
        height, time = max(_crest(orbit, n, float(times[j]), T / size) for j in crests)
        found.append(Gap(1.0 - height, n, time))
    return found


def _height(u: Any, low: Any, high: Any) -> Any:
    """1 less the distance from the nearer wall: ``|u|`` between -1 and 1."""
    return 1.0 + np.maximum(u - high, low - u)


def _beside(orbit: RingOrbit) -> set[int]:
    """Sites coupled to one that hits a wall."""
    return {n for hit in orbit.itinerary.hit for n in orbit.lattice.beside(hit)}


def _crest(orbit: RingOrbit, n: int, time: float, step: float) -> tuple[float, float]:
    """Height and time of the extremum of site n next to a time on the grid."""
    best = (-math.inf, time)
    walls = orbit.conditions.walls.at(n)
    low, high = time - step, time + step
    for _ in range(30):
        u, v, w = orbit.at(n, time)
        best = max(best, (float(_height(u, *walls)), time))
        last, time = time, min(max(time - v / w, low), high) if w else time
        if abs(time - last) <= 1e-9:  # the height is flat there: this is 1e-18 of it
            break
    return best
