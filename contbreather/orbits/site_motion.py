"""The motion of the sites of an orbit, whatever represents it,

    ``u_n(t) = c_n + a f_n(t) + sum over impacts j of J_j h_nj(t - t_j)
               + sum over modes i of e_ni y_i(t)``:

a forced motion, the responses to impacts that recur (closed form and Green's function of chain and
ring), the free flights of the modes (any finite lattice). What an orbit does not have is empty.

Beyond a dozen sites from the last that impacts the response of the chain is one harmonic, whose
amplitude shrinks and changes sign from site to site. The largest displacement is a convex function
of that amplitude, so the first two such sites and the far field bound all the others.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from contbreather.kernels import Counts, Cube, Kernel, Matrix, Vector, fixed, inlined
from contbreather.lattice.band_averages import UniformLattice
from contbreather.lattice.finite import mode_solutions
from contbreather.lattice.forcing import Forcing, harmonic
from contbreather.lattice.periodic_green import (
    LATE,
    RESPONSES,
    SLACK,
    Responses,
    half_period_green,
    periodic_green,
    response_since,
)
from contbreather.orbits.section import Section

FloatArray = NDArray[np.float64]
Terms = tuple[float, float, float]  # a value and its first two derivatives
Wall = tuple[float, float]

FINE = 64  # points to half a period of the forcing, sixteen to that of its highest harmonic
NEAR = 13  # (0.072)^13 < 1e-14: the third harmonic has died out two sites earlier
USUAL = (-1.0, 1.0)
NO_WALLS = (-math.inf, math.inf)
NEARLY = 0.1  # sites whose lowest distance on the grid is this close to the least may have it

OFFSET, LOW, HIGH = range(3)  # columns of places
TIME, IMPULSE, SITE, WALL = range(4)  # rows of impacts
IMAGE = 1e-9  # displacements that differ by less are images of each other
MANY = 4096  # sites whose responses are written down at once


@fixed
class Forced(NamedTuple):
    """The motion at unit amplitude: ``sum over m of A cos mt + B sin mt``."""

    orders: Vector  # m
    cosines: Matrix  # A of each site, in one row where all move alike
    sines: Matrix  # B
    peak: float  # largest of all values


@fixed
class FreeModes(NamedTuple):
    """Free flights of the modes ``y'' + damping y' + z y = 0``, one after each impact."""

    starts: Vector
    q: Matrix  # displacements and velocities at the start of each flight
    r: Matrix
    z: Vector
    damping: float
    shapes: Matrix  # e, a row for each site
    profiles: Matrix  # displacements at equal steps of the section, of each site without impacts


class Motion(NamedTuple):
    """Motion of the sites that impact, and behind them of sites that do not."""

    a: float
    k: float
    start: float  # of a section
    length: float
    sign: float  # with which the motion goes on after it
    fine: int  # points of a grid to half a period of the forcing
    forced: Forced
    responses: Responses
    modes: FreeModes
    impacts: Matrix  # of a period: times, impulses, sites, walls
    flights: int  # impacts of a section
    busy: int  # sites that impact
    places: Matrix  # of each site c, its low and its high wall


@inlined
def site_state(motion: Motion, site: int, t: float) -> tuple[float, float, float]:
    """Displacement, velocity and acceleration; at an impact just after it."""
    forced, responses = motion.forced, motion.responses
    row = site if forced.cosines.shape[0] > 1 else 0
    f = df = d2f = 0.0
    for i in range(forced.orders.size):
        value, slope, curvature, _ = harmonic(
            forced.orders[i], forced.cosines[row, i], forced.sines[row, i], t
        )
        f, df, d2f = f + value, df + slope, d2f + curvature
    u, v, w = motion.places[site, OFFSET] + motion.a * f, motion.a * df, motion.a * d2f
    for j in range(responses.which.shape[1]):
        J = motion.impacts[IMPULSE, j]
        h, dh, d2h, _ = response_since(
            responses, responses.which[site, j], t - motion.impacts[TIME, j]
        )
        u, v, w = u + J * h, v + J * dh, w + J * d2h
    if motion.modes.z.size > 0:
        y, dy, d2y = free(motion, site, t)
        u, v, w = u + y, v + dy, w + d2y
    return u, v, w


def state(motion: Motion, site: int, t: float) -> tuple[float, float, float]:
    """Displacement, velocity and acceleration, asked once: `site_state` is written out in loops."""
    return site_state(motion, site, t)


def free(motion: Motion, site: int, t: float) -> tuple[float, float, float]:
    """The share of the modes in displacement, velocity and acceleration of a site."""
    modes = motion.modes
    i, since, flip = in_flight(modes, motion.length, motion.sign, t)
    u = v = w = 0.0
    for j in range(modes.z.size):
        e = flip * modes.shapes[site, j]
        y, dy = mode_state(modes, i, j, since)
        u, v, w = u + e * y, v + e * dy, w - e * (modes.z[j] * y + modes.damping * dy)
    return u, v, w


@inlined
def in_flight(modes: FreeModes, length: float, sign: float, t: float) -> tuple[int, float, float]:
    """In which flight a time is, how long since its start, and the sign of that section; within
    rounding of an impact it is in the flight after it."""
    late = LATE + SLACK * abs(t)
    past = math.floor((t - modes.starts[0] + late) / length)
    back, i = t - past * length, modes.starts.size - 1
    while i > 0 and modes.starts[i] > back + late:
        i -= 1
    return i, back - modes.starts[i], sign if past % 2 != 0 else 1.0


@inlined
def mode_state(modes: FreeModes, i: int, j: int, since: float) -> tuple[float, float]:
    """Displacement and velocity of mode j in flight i."""
    z, q, r = modes.z[j], modes.q[i, j], modes.r[i, j]
    C, S, dS = mode_solutions(z, modes.damping, since)
    return C * q + S * r, dS * r - z * S * q


def modes_at(modes: FreeModes, length: float, sign: float, times: Vector, out: Cube) -> None:
    """Displacements and velocities of all modes at each time."""
    for k in range(times.size):
        i, since, flip = in_flight(modes, length, sign, times[k])
        for j in range(modes.z.size):
            y, dy = mode_state(modes, i, j, since)
            out[0, k, j], out[1, k, j] = flip * y, flip * dy


def states(motion: Motion, sites: Counts, times: Vector, out: Matrix) -> None:
    """Displacement, velocity and acceleration of each site at its time, in columns."""
    for i in range(times.size):
        out[0, i], out[1, i], out[2, i] = site_state(motion, sites[i], times[i])


MODES, STATES = Kernel(modes_at), Kernel(states)


def points_of(fine: int, length: float) -> int:
    """Number of points of a grid over a time."""
    return math.ceil(fine * max(1.0, length / math.pi) - 1e-9)


# --- of an orbit ----------------------------------------------------------------------------------


_NO_VECTOR, _NO_MATRIX, _FIRST = np.empty(0), np.empty((0, 0)), np.zeros(1, dtype=np.int64)
_NO_MODES = FreeModes(_NO_VECTOR, _NO_MATRIX, _NO_MATRIX, _NO_VECTOR, 0.0, _NO_MATRIX, _NO_MATRIX)


class SiteMotion:
    """The motion of an orbit over a section, by its representation, and which sites decide on its
    clearance."""

    def __init__(self, representation: Any, forcing: Any = None, lattice: Any = None) -> None:
        self.representation, self.on = representation, representation.conditions
        self.section: Section = representation.section
        # where springs hold the sites a closed form has its own
        self.forcing = self.on.forcing if forcing is None else forcing
        self.lattice = self.on.lattice if lattice is None else lattice
        self.k, self.sign, self.hit = float(self.on.k), self.section.sign, self.section.hit
        self.length, self.period = self.section.length, self.section.period
        self.endless = self.lattice.sites is None  # with a far field
        self.fine = max(FINE, 16 * int(self.forcing.highest))  # points to half a period of it
        self.impacts = self.section.course(representation.impacts)  # those of a section first
        self.start = float(self.impacts[0].time)  # of a section

    @property
    def idle(self) -> Sequence[int]:
        """Sites that never hit a wall, all that may come closest to one."""
        raise NotImplementedError

    @property
    def beside(self) -> Collection[int]:
        """Sites coupled to one that hits a wall."""
        return {n for site in self.hit for n in self.lattice.beside(site)}

    def walls(self, site: int) -> Wall:
        pair: Wall = self.on.walls.at(site)
        return pair

    @property
    def far(self) -> float:
        """The margin of the far field, 1 where there is none."""
        return float(self.far_of(self.on.a))

    def far_of(self, a: Any) -> Any:
        """Margin of the far field at other amplitudes."""
        return 1.0

    def far_time(self) -> float:
        """When it is closest to a wall."""
        return self.start

    def differences(self, sites: Sequence[int], other: int) -> FloatArray:
        """How far the motions of sites are from that of another, and that from its forced motion:
        root mean squares over a period."""
        times: FloatArray = self.start + math.pi / 8.0 * np.arange(16.0 * self.section.turns)
        paths = self.states(np.array([other, *sites])[:, None], times)[0]
        forced = self.on.a * self.driven(other, times)
        same = np.array(sites) == other
        apart = np.where(same[:, None], paths[0] - forced, paths[1:] - paths[0])
        return np.sqrt(np.mean(apart**2, axis=1))

    def driven(self, site: int, times: FloatArray) -> FloatArray:
        """The forced motion of a site at unit amplitude."""
        return np.asarray(self.forcing.f(times))

    def states(self, n: ArrayLike, t: ArrayLike) -> FloatArray:
        """Displacements, velocities and accelerations, one after the other, of sites at times,
        broadcast against each other; at an impact those just after it."""
        raise NotImplementedError

    def at(self, site: int, t: float) -> Terms:
        """Displacement, velocity and acceleration of one site at one time."""
        u, v, w = self.states(site, t).tolist()
        return u, v, w

    def with_idle(
        self, idle: Sequence[int], near: Collection[int] = (), touching: int | None = None
    ) -> tuple[Motion, Sequence[int]]:
        """The motion of the sites that impact, and behind them of those of others that are near or
        may come closest to a wall, besides one that touches it; and which these are."""
        raise NotImplementedError

    def _motion(
        self, sites: tuple[int, ...], forced: Forced, responses: Responses, modes: FreeModes
    ) -> Motion:
        rows = [(t, J, self.hit.index(site), wall) for site, wall, t, J in self.impacts]
        impacts = np.array([*zip(*rows, strict=True)], dtype=float)
        section = self.start, self.length, float(self.sign), self.fine
        parts = forced, responses, modes
        counts = self.section.count, len(self.hit)
        return Motion(
            float(self.on.a), self.k, *section, *parts, impacts, *counts, self._places(sites)
        )

    def _places(self, sites: Sequence[int]) -> FloatArray:
        """Offset and walls of each site."""
        return np.array([(0.0, *self.walls(n)) for n in sites])


@lru_cache(maxsize=64)
def _alike(forcing: Forcing) -> Forced:
    """Forced motion of all sites where nothing but the walls holds them."""
    m, A, B = np.array(forcing.harmonics, dtype=float).reshape(-1, 3).T.copy()
    return Forced(m, A[None], B[None], float(forcing.peak()))


# --- chain and ring, with impacts that recur --------------------------------------------------


class ChainMotion(SiteMotion):
    """By its impacts: responses depend on the distance of a site from each of them. Half symmetric
    orbits are those of site 0 alone."""

    def states(self, n: ArrayLike, t: ArrayLike) -> FloatArray:
        n, t = np.broadcast_arrays(n, np.asarray(t, dtype=float))
        sites, times, out = n.flatten(), t.flatten(), np.empty((3, t.size))
        for first in range(0, t.size, MANY):
            part = slice(first, first + MANY)
            those, which = np.unique(sites[part], return_inverse=True)
            block = np.empty((3, which.size))
            STATES(self._of(tuple(those.tolist())), which, times[part], block)
            out[:, part] = block
        return out.reshape(3, *t.shape)

    def at(self, site: int, t: float) -> Terms:  # the same, sooner
        out = np.empty((3, 1))
        STATES(self._of((site,)), _FIRST, np.array([t]), out)
        (u,), (v,), (w,) = out.tolist()
        return u, v, w

    def with_idle(
        self, idle: Sequence[int], near: Collection[int] = (), touching: int | None = None
    ) -> tuple[Motion, Sequence[int]]:
        return self._of((*self.hit, *idle)), idle

    def _of(self, sites: tuple[int, ...]) -> Motion:
        return self._motion(sites, _alike(self.forcing), self._responses(sites), _NO_MODES)

    def _responses(self, sites: tuple[int, ...], by: str = "") -> Responses:
        """Responses of sites to the impacts of a section, or their derivatives in a parameter."""
        if self.section.symmetric:
            return half_period_green(self.lattice, self.on.gamma, sites, by)
        hits = tuple(impact.site for impact in self.impacts)
        return periodic_green(self.lattice, self.on.gamma, sites, hits, self.section.turns, by)

    def slopes(self, site: int, t: float, names: Collection[str]) -> dict[str, FloatArray]:
        """Derivatives of displacement and velocity at a time: in the impulses J1, J2, ... and times
        t1, t2, ... of the impacts of a section, in a, k and parameters named; and in the time t."""
        f, a, impacts = self.forcing, self.on.a, self.representation.impacts
        since = np.array([t - impact.time for impact in impacts])
        impulses = np.array([impact.impulse for impact in impacts])

        def answers(by: str) -> FloatArray:
            out, responses = np.empty((4, since.size)), self._responses((site,), by)
            RESPONSES(responses, since, responses.which[0], out)
            return out

        h, forced = answers(""), np.array(f.motion(t))
        slopes = {"a": forced[:2], "k": np.zeros(2), "t": a * forced[1:] + h[1:3] @ impulses}
        for i, J in enumerate(impulses):
            slopes[f"J{i + 1}"] = h[:2, i]
            # an answer is a function of t - t_i: its derivative in t_i is minus that in t
            slopes[f"t{i + 1}"] = -J * h[1:3, i]
        for name in {"gamma", "spring"}.intersection(names):
            slopes[name] = answers(name)[:2] @ impulses
        for name in {*f.params}.intersection(names):
            driven = a * np.array([f.f_param(name, t, order) for order in (0, 1)])
            slopes[name] = slopes.get(name, 0.0) + driven
        return slopes

    def _places(self, sites: Sequence[int]) -> FloatArray:
        places = np.empty((len(sites), 3))
        places[:, LOW:] = USUAL
        places[:, OFFSET] = self.offset(sites) if any(self.representation.offsets) else 0.0
        return places

    def offset(self, n: ArrayLike) -> FloatArray:
        """Static displacement of sites: straight lines between the impacting ones, level beyond.

        At gamma = 0 nothing holds the others to them: they stay where they are, at 0.
        """
        sites, places = np.asarray(n, dtype=float), list(self.hit)
        values, ring = list(self.representation.offsets), self.lattice.sites
        if self.on.gamma == 0.0:
            return np.asarray(np.where(np.isin(sites, places), np.interp(sites, places, values), 0))
        if ring is None or len(places) == 1:
            return np.asarray(np.interp(sites, places, values))
        return np.asarray(np.interp(sites % ring, places, values, period=ring))

    @property
    def idle(self) -> Sequence[int]:
        # of a ring with modes at or above the lowest harmonic of the orbit all
        resonant = not self.endless and 4.0 * self.section.turns**2 * self.on.gamma >= 1.0
        return _around(self.lattice, self.hit, resonant)

    @property
    def _far_offset(self) -> float:
        """The larger of those at both ends, none where there is no coupling."""
        offsets = self.representation.offsets
        return max((offsets[0], offsets[-1]), key=abs) if self.on.gamma else 0.0

    def far_of(self, a: Any) -> Any:
        if not self.endless:
            return 1.0
        # far from all impacts u_n = c + a f(t)
        return 1.0 - abs(self._far_offset) - a * self.forcing.peak()

    def far_time(self) -> float:
        if not self.endless:
            return self.start
        return _highest(self.forcing, math.copysign(1.0, self._far_offset))


@lru_cache(maxsize=64)
def _around(lattice: UniformLattice, hit: tuple[int, ...], everywhere: bool) -> Sequence[int]:
    """The sites near those that impact, or all, but those."""
    ring = lattice.sites
    sites = set(range(ring or 0) if everywhere else range(hit[0] - NEAR, hit[-1] + NEAR + 1))
    if len(hit) == 1:  # both sides are alike
        sites = {hit[0] + lattice.distance(site - hit[0]) for site in sites}
    return sorted({site % ring for site in sites} - set(hit) if ring else sites - set(hit))


@lru_cache(maxsize=64)
def _highest(forcing: Forcing, sign: float) -> float:
    """When f is largest in one direction."""
    t = np.linspace(0.0, 2.0 * math.pi, 64 * forcing.highest, endpoint=False)
    return float(t[int((sign * forcing.f(t)).argmax())])


# --- modes of a finite lattice --------------------------------------------------------------


class ModalMotion(SiteMotion):
    """A shot orbit of any finite lattice."""

    @cached_property
    def idle(self) -> Sequence[int]:
        sites = self.lattice.idle(self.hit).tolist()
        return [n for n in sites if self.walls(n) != NO_WALLS]

    def states(self, n: ArrayLike, t: ArrayLike) -> FloatArray:
        n, t = np.broadcast_arrays(n, np.asarray(t, dtype=float))
        sites, i = np.unique(n.ravel(), return_inverse=True)
        times, j = np.unique(t.ravel(), return_inverse=True)
        flight, basis = self.representation, self.representation.basis
        q, r = flight.modes(times)
        free = np.stack([q, r, flight.pulled(q, r)])
        every = np.array_equal(sites, np.arange(self.lattice.sites))  # sooner, by transforms
        paths = basis.to_sites(free) if every else free @ basis.at(sites).T
        for order in range(3):
            forced = self.on.a * flight.forced.everywhere(times, order)
            paths[order] += forced if forced.shape[-1] == 1 else forced[:, sites]
        return np.asarray(paths[:, j, i]).reshape(3, *t.shape)

    def driven(self, site: int, times: FloatArray) -> FloatArray:
        return np.array([self.representation.forced.at(site, t)[0] for t in times.tolist()])

    def displacements(self, times: FloatArray) -> FloatArray:
        """Displacements of all sites at many times, shape (times, sites)."""
        flight = self.representation
        free = flight.basis.to_sites(flight.modes(times)[0])
        return np.asarray(free + self.on.a * flight.forced.everywhere(times, 0))

    def with_idle(
        self, idle: Sequence[int], near: Collection[int] = (), touching: int | None = None
    ) -> tuple[Motion, Sequence[int]]:
        flight, candidates = self.representation, np.array(idle, dtype=int)
        size = points_of(self.fine, self.length)
        times = self.start + self.length / size * np.arange(size)
        profiles = self.displacements(times)[:, candidates].T
        if candidates.size:
            low, high = self._places(candidates.tolist())[:, 1:].T[:, :, None]
            gaps = np.minimum(high - profiles, profiles - low).min(axis=1)
            if touching is not None and touching in candidates:
                image = profiles[candidates == touching]
                gaps[abs(profiles - image).max(axis=1) <= IMAGE] = math.inf
            wanted = gaps <= gaps.min() + NEARLY * max(abs(gaps.min()), NEARLY)
            # far away sites move alike: of those the first
            wanted &= np.isin(
                np.arange(candidates.size), np.unique(gaps.round(12), return_index=True)[1]
            )
            wanted |= np.isin(candidates, list(near))
            candidates, profiles = candidates[wanted], profiles[wanted]
        idle = candidates.tolist()
        sites = (*self.hit, *idle)
        shapes = np.ascontiguousarray(flight.basis.at(sites))
        modes = flight.free_modes._replace(shapes=shapes, profiles=np.ascontiguousarray(profiles))
        return self._motion(sites, self._forced(sites), _no_responses(len(sites)), modes), idle

    def _forced(self, sites: tuple[int, ...]) -> Forced:
        forced = self.representation.forced
        if forced.alike:
            return _alike(self.forcing)
        series = np.array([forced.harmonics(site) for site in sites], dtype=float)
        m, A, B = (np.ascontiguousarray(part) for part in np.moveaxis(series, 2, 0))
        return Forced(m[0], A, B, math.inf)


@lru_cache(maxsize=64)
def _no_responses(sites: int) -> Responses:
    which = np.empty((sites, 0), dtype=np.int64)
    none = _NO_VECTOR, _NO_MATRIX, _NO_MATRIX, _NO_VECTOR
    return Responses(which, _NO_MATRIX, *none, 1.0, False)
