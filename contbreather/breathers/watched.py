"""What the clearance of an orbit is measured on: its motion by the closed form of the symmetric
breather, by the Green's function of chain and ring, or by the modes of any finite lattice.

Beyond a dozen sites from the last that impacts the answer of the chain is one harmonic, whose
amplitude shrinks and changes sign from site to site. The largest displacement is a convex function
of that amplitude, so the first two such sites and the far field bound all the others.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from contbreather.breathers.clearance import Between, Terms, Wall, Watch, fineness
from contbreather.lattice import Forcing, Lattice
from contbreather.lattice.green import POWERS, TERMS, Flight, response_weights
from contbreather.lattice.periodic import is_resonant, wave, wave_basis, wave_rows, wave_table

FloatArray = NDArray[np.float64]
Sites = NDArray[np.int64]

HALF_PI = 0.5 * math.pi
NEAR = 13  # (0.072)^13 < 1e-14: the third harmonic has died out two sites earlier
FAINT = 1e-17  # an answer to the impacts this small moves a site by less than rounding
NO_WALLS = (-math.inf, math.inf)


class Packed(NamedTuple):
    """The motion of an orbit as `clearance_loops` take it."""

    data: FloatArray
    sites: tuple[int, ...]  # those that hit, and the others that are looked at
    table: FloatArray
    own: int  # numbers that are filled in, apart from
    points: int  # those on the grids of all sites together


# --- the closed form ------------------------------------------------------------------------


class ClosedWatch(Watch):
    """A symmetric breather of chain or ring, with the site 0 that impacts; of each pair of sites
    that are mirror images one is watched."""

    length = math.pi
    sign = -1
    beside = (1,)

    def __init__(self, breather: Any) -> None:
        self.breather = breather
        self.k, self.start = float(breather.k), float(breather.phi)
        self.highest = int(breather.forcing.highest)
        self._flights: dict[int, Flight] = {}

    @cached_property
    def flights(self) -> tuple[Between]:
        b = self.breather
        speed, end = b.w_minus, self.start + math.pi
        return (Between(0, self.start, end, math.pi, speed, speed, -b.acceleration),)

    @cached_property
    def idle(self) -> Sites:
        b, sites = self.breather, _distances(self.breather.lattice)
        first = _answers(b.lattice, b.gamma, tuple(sites.tolist()))[0]
        # sites that the impacts do not reach move as the first of them does
        return sites[: 1 + int(np.count_nonzero(b.p * np.abs(first) > FAINT))]

    def packed(self) -> Packed | None:
        """None with springs."""
        b = self.breather
        if b.lattice.spring:
            return None
        idle = tuple(_distances(b.lattice).tolist())
        impacts = ((0, b.phi, -2.0 * b.p), (0, b.phi + math.pi, 2.0 * b.p))
        return _packed(self, b, 1, (0,), idle, impacts, None)

    def far(self) -> tuple[float, float]:
        b = self.breather
        endless = b.lattice.sites is None
        return b.phi, 1.0 - b.a * b.forcing.peak() if endless else 1.0

    def felt(self, site: int) -> float:
        b = self.breather
        return float(b.p * b.gamma ** b.lattice.distance(site))

    def at(self, site: int, t: float) -> Terms:
        b = self.breather
        y, sign = phase(b, t)
        own = self._flights.get(site)
        if own is None:
            own = self._flights[site] = b.flight(site)
        u, v, w = own.at(y)
        f, df, d2f = b.forcing.motion(t)
        a, p = b.a, sign * b.p
        return a * f + p * u, a * df + p * v, a * d2f + p * w

    def path(self, site: int, t: FloatArray) -> FloatArray:
        """Between two impacts."""
        b = self.breather
        own = b.flight(site).value(t - self.start - HALF_PI)
        return np.asarray(b.a * b.forcing.f(t) + b.p * own)

    def profiles(self, sites: Sites, size: int) -> FloatArray:
        b, (s, sine, powers) = self.breather, _grid(size)
        first, own = _answers(b.lattice, b.gamma, tuple(sites.tolist()))
        return np.asarray(
            b.a * b.forcing.f(b.phi + s) + b.p * (own @ powers - first[:, None] * sine)
        )


def _packed(
    watch: Watch,
    orbit: Any,
    turns: int,
    hit: tuple[int, ...],
    idle: tuple[int, ...],
    impacts: tuple[tuple[int, float, float], ...],
    offsets: FloatArray | None,
) -> Packed | None:
    sites, f, beside = (*hit, *idle), orbit.forcing, tuple(watch.beside)
    distances, places = _places(orbit.lattice, sites, beside, tuple(one[0] for one in impacts))
    table = wave_rows(orbit.lattice, orbit.gamma, distances, turns)
    if table is None:
        return None
    if offsets is not None:
        places = places.copy()
        places[:, 0] = offsets
    head = watch.k, orbit.a, turns, watch.start, watch.length, watch.far()[1]
    flights = len(impacts) if watch.sign > 0 else len(impacts) // 2
    fine = fineness(f.highest)
    counts = len(f.harmonics), len(impacts), flights, len(hit), len(sites), fine
    series = [entry for harmonic in f.harmonics for entry in harmonic]
    hits = [entry for site, t, J in impacts for entry in (t, J, hit.index(site))]
    given = np.array([*head, f.peak(), *counts, *series, *hits], dtype=float)
    data = np.concatenate([given, places.ravel()])
    return Packed(data, sites, table, 4 + len(sites), (2 * turns * fine + 1) * (len(sites) + 4))


@lru_cache(maxsize=256)
def _places(
    lattice: Lattice, sites: tuple[int, ...], beside: tuple[int, ...], hits: tuple[int, ...]
) -> tuple[tuple[int, ...], FloatArray]:
    """Distances that occur, and for each site no offset, whether it is next to one that hits, and
    which of the distances it has from each impact."""
    apart = [[lattice.distance(site - other) for other in hits] for site in sites]
    found = tuple(sorted({one for row in apart for one in row}))
    rows = [
        [0.0, float(site in beside), *map(found.index, row)]
        for site, row in zip(sites, apart, strict=True)
    ]
    return found, np.array(rows, dtype=float)


def phase(breather: Any, t: float) -> tuple[float, float]:
    """Time from the middle of the flight, and its sign."""
    flights = math.floor((t - breather.phi) / math.pi)
    sign = -1.0 if flights % 2 else 1.0
    return t - breather.phi - (flights + 0.5) * math.pi, sign


@lru_cache(maxsize=16)
def _grid(size: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Times of one flight, sin y and the odd powers of y there."""
    s = math.pi * np.arange(size) / size
    y = s - HALF_PI
    return s, np.sin(y), y ** (2.0 * np.arange(POWERS)[:, None] + 1.0)


@lru_cache(maxsize=64)
def _distances(lattice: Lattice) -> Sites:
    """Distances of the sites to look at."""
    return np.array(sorted({lattice.distance(n) for n in range(1, NEAR + 1)} - {0}), dtype=int)


@lru_cache(maxsize=64)
def _answers(
    lattice: Lattice, gamma: float, sites: tuple[int, ...]
) -> tuple[FloatArray, FloatArray]:
    """Amplitudes of -sin y and of the odd powers of y, per unit p, for several sites."""
    first = 4.0 / math.pi * lattice.first_harmonic(gamma, np.array(sites, dtype=int))
    powers = np.array([lattice.powers(gamma, n) for n in sites]).reshape(len(sites), TERMS + 1)
    return first, powers @ response_weights().T


class OrbitWatch(Watch):
    """An orbit with any impacts."""

    def __init__(self, orbit: Any) -> None:
        self.orbit = orbit
        self.k, self.sign = float(orbit.k), int(orbit.section.sign)
        self.start, self.length = float(orbit.times[0]), float(orbit.section.length)
        self.highest = int(orbit.forcing.highest)
        self.hit = orbit.section.hit

    @cached_property
    def flights(self) -> tuple[Between, ...]:
        """Of each impact of a section until the next one of the same site; times count modulo the
        period, but for a flight that is none because two impacts have changed places."""
        orbit, found = self.orbit, []
        T = orbit.period
        order = sorted(orbit.hits, key=lambda one: (one.time - self.start) % T)
        for i, own in enumerate(order[: orbit.section.count]):
            later = (one for one in (*order[i + 1 :], *order[:i]) if one.site == own.site)
            again = next(later, own)
            length = T if again is own else (again.time - own.time) % T
            speed, next_speed = own.wall * own.before, again.wall * again.before
            push = -own.wall * own.acceleration
            found.append(Between(own.site, own.time, again.time, length, speed, next_speed, push))
        for i, j in orbit.section.repeats:
            length = orbit.times[j] - orbit.times[i]
            if length <= 0.0:
                site = orbit.section.impacts[j][0]
                found.append(Between(site, orbit.times[i], orbit.times[j], length, 0.0, 0.0, 0.0))
        return tuple(found)

    @property
    def beside(self) -> Collection[int]:
        return {n for site in self.hit for n in self.orbit.lattice.beside(site)}


# --- the periodic Green's function ----------------------------------------------------------


class GreenWatch(OrbitWatch):
    """An orbit of chain or ring with any impacts."""

    def __init__(self, orbit: Any) -> None:
        super().__init__(orbit)
        self._offsets: dict[int, float] = {}

    @property
    def _resonant(self) -> bool:
        return is_resonant(self.orbit.lattice, self.orbit.gamma, self.orbit.section.turns)

    @cached_property
    def idle(self) -> Sites:
        first, last, ring = self.hit[0], self.hit[-1], self.orbit.lattice.sites
        left = 1 if len(self.hit) == 1 else -NEAR  # around one site both sides are alike
        near = range(ring or 0) if self._resonant else range(first + left, last + NEAR + 1)
        sites = {site % ring for site in near} if ring else set(near)
        return np.array(sorted(sites - set(self.hit)), dtype=int)

    def packed(self) -> Packed | None:
        """None on a ring whose modes are summed one by one."""
        o, idle = self.orbit, tuple(self.idle.tolist())
        impacts = tuple((one.site, one.time, one.impulse) for one in o.impacts)
        offsets = o.flight.offset((*self.hit, *idle))
        return _packed(self, o, o.section.turns, self.hit, idle, impacts, offsets)

    def far(self) -> tuple[float, float]:
        """The offset there is the larger of those at both ends, none where there is no coupling."""
        orbit, offsets = self.orbit, self.orbit.offsets
        if orbit.lattice.sites is not None:
            return self.start, 1.0
        offset = max((offsets[0], offsets[-1]), key=abs) if orbit.gamma else 0.0
        margin = 1.0 - abs(offset) - orbit.a * orbit.forcing.peak()
        return _highest(orbit.forcing, math.copysign(1.0, offset)), margin

    def felt(self, site: int) -> float:
        orbit = self.orbit
        away = min(orbit.lattice.distance(site - busy) for busy in self.hit)
        return float(0.5 * np.abs(orbit.impulses).max() * orbit.gamma**away)

    def at(self, site: int, t: float) -> Terms:
        u, v, w = moved(self.orbit, site, t)
        if site not in self._offsets:
            self._offsets[site] = float(self.orbit.flight.offset(site))
        return u + self._offsets[site], v, w

    def path(self, site: int, t: FloatArray) -> FloatArray:
        return self._many([site], t)[0]

    def profiles(self, sites: Sites, size: int) -> FloatArray:
        step = self.length / size
        return self._many(sites.tolist(), self.start + step * np.arange(size, dtype=float))

    def _many(self, sites: Sequence[int], t: FloatArray) -> FloatArray:
        orbit = self.orbit
        lattice, gamma, n = orbit.lattice, orbit.gamma, orbit.section.turns
        u = orbit.flight.offset(sites)[:, None] + orbit.a * np.asarray(orbit.forcing.f(t))
        for impact in orbit.impacts:
            apart = tuple(lattice.distance(site - impact.site) for site in sites)
            table = wave_table(lattice, gamma, apart, n)
            if table is None:
                answer = np.array(
                    [wave(lattice, gamma, d, n).at(t - impact.time)[0] for d in apart]
                )
            else:
                answer = table @ wave_basis(t - impact.time, n)
            u += impact.impulse * answer
        return np.asarray(u)


@lru_cache(maxsize=64)
def _highest(forcing: Forcing, sign: float) -> float:
    """When f is largest in one direction."""
    t = np.linspace(0.0, 2.0 * math.pi, 64 * forcing.highest, endpoint=False)
    return float(t[int((sign * forcing.f(t)).argmax())])


def moved(orbit: Any, site: int, t: float) -> Terms:
    """Displacement, velocity and acceleration of a site at one time, without its static offset."""
    a, (u, v, w) = orbit.a, orbit.forcing.motion(t)
    u, v, w = a * u, a * v, a * w
    for impact in orbit.impacts:
        distance = orbit.lattice.distance(site - impact.site)
        h = wave(orbit.lattice, orbit.gamma, distance, orbit.section.turns).motion(t - impact.time)
        u, v, w = u + impact.impulse * h[0], v + impact.impulse * h[1], w + impact.impulse * h[2]
    return u, v, w


# --- modes of a finite lattice --------------------------------------------------------------


class ModalWatch(OrbitWatch):
    """A shot orbit of any finite lattice."""

    def walls(self, site: int) -> Wall:
        found: Wall = self.orbit.walls.at(site)
        return found

    @cached_property
    def idle(self) -> Sites:
        sites = self.orbit.lattice.idle(self.hit)
        watched = [self.walls(n) != NO_WALLS for n in sites.tolist()]
        return np.asarray(sites[np.array(watched, dtype=bool)])

    def at(self, site: int, t: float) -> Terms:
        found: Terms = self.orbit.flight.at(site, t)
        return found

    def path(self, site: int, t: FloatArray) -> FloatArray:
        return np.asarray(self.orbit.displacement(site, t))

    def profiles(self, sites: Sites, size: int) -> FloatArray:
        step = self.length / size
        motion = self.orbit.flight.motion(self.start + step * np.arange(size, dtype=float))
        return np.asarray(motion[:, sites].T)
