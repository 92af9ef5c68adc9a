"""The motion of the sites of an orbit,

    ``u_n(t) = c_n + a f_n(t) + sum over impacts j of J_j h_nj(t - t_j)
               + sum over modes i in resonance of e_ni (A_i cos w_i t + B_i sin w_i t)``:

a static and a forced motion, the responses to impacts that recur, and modes whose amplitudes are
unknowns. What an orbit does not have is empty.

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

from contbreather.kernels import Counts, Kernel, Matrix, Vector, fixed, inlined
from contbreather.lattice.band_averages import UniformLattice
from contbreather.lattice.forcing import Forcing, harmonic, peak_of
from contbreather.lattice.periodic_green import Responses, response_since
from contbreather.lattice.response import HELD, ModalResponse, UniformResponse
from contbreather.orbits.section import Section

FloatArray = NDArray[np.float64]
Terms = tuple[float, float, float]  # a value and its first two derivatives
Wall = tuple[float, float]

FINE = 64  # points to half a period of the forcing, sixteen to that of its highest harmonic
NEAR = 13  # (0.072)^13 < 1e-14: the third harmonic has died out two sites earlier
USUAL = (-1.0, 1.0)
NO_WALLS = (-math.inf, math.inf)

OFFSET, LOW, HIGH, BACK = range(4)  # columns of places
TIME, IMPULSE, SITE, WALL = range(4)  # rows of impacts
IMAGE = 1e-9  # sites as far off their walls but for less are images of each other
MANY = 4096  # sites whose responses are written down at once


@fixed
class Forced(NamedTuple):
    """The motion at unit amplitude: ``sum over m of A cos mt + B sin mt``."""

    orders: Vector  # m
    cosines: Matrix  # A of each site, in one row where all move alike
    sines: Matrix  # B
    peak: float  # largest of all values


class Motion(NamedTuple):
    """Motion of the sites that impact, and behind them of sites that do not."""

    a: float
    start: float  # of a section
    length: float
    sign: float  # with which the motion goes on after it
    fine: int  # points of a grid to half a period of the forcing
    forced: Forced
    responses: Responses
    impacts: Matrix  # of a period: times, impulses, sites, walls
    flights: int  # impacts of a section
    busy: int  # sites that impact
    places: Matrix  # of each site c, its low and its high wall, its k


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
    return u, v, w


def state(motion: Motion, site: int, t: float) -> tuple[float, float, float]:
    """Displacement, velocity and acceleration, asked once: `site_state` is written out in loops."""
    return site_state(motion, site, t)


def states(motion: Motion, sites: Counts, times: Vector, out: Matrix) -> None:
    """Displacement, velocity and acceleration of each site at its time, in columns."""
    for i in range(times.size):
        out[0, i], out[1, i], out[2, i] = site_state(motion, sites[i], times[i])


STATES = Kernel(states)


def points_of(fine: int, length: float) -> int:
    return math.ceil(fine * max(1.0, length / math.pi) - 1e-9)


def _later(gaps: FloatArray, half_periods: int) -> list[FloatArray]:
    """How far a motion is off its walls as symmetries, which may turn its sign, too, have it at
    another site: later by half periods of the forcing."""
    return [np.roll(gaps, j * gaps.size // half_periods) for j in range(half_periods)]


# --- of an orbit ----------------------------------------------------------------------------------


_FIRST = np.zeros(1, dtype=np.int64)


class SiteMotion:
    """Motion of an orbit over a section, and the sites that decide on its clearance."""

    def __init__(self, representation: Any) -> None:
        self.representation, self.on = representation, representation.conditions
        self.section: Section = representation.section
        self.response: UniformResponse | ModalResponse = representation.response
        self.lattice = self.response.lattice
        self.sign, self.hit = self.section.sign, self.section.hit
        self.length, self.period = self.section.length, self.section.period
        self.endless = self.lattice.sites is None  # with a far field
        # points to half a period of the forcing
        self.fine = max(FINE, 16 * int(self.response.drive.highest))
        self.impacts = self.section.course(representation.impacts)  # those of a section first
        self.start = float(self.impacts[0].time)  # of a section

    # ------------------------------------------------------------------------ which sites

    @cached_property
    def idle(self) -> Sequence[int]:
        """Sites that never hit a wall, all that may come closest to one."""
        # between walls of their own sites are no mirror images, and far ones may come closest
        if isinstance(self.response, UniformResponse) and not self.on.walls.own:
            return _around(self.lattice, self.hit)
        sites = np.setdiff1d(np.arange(self.lattice.sites), self.hit).tolist()
        return [n for n in sites if self.walls(n) != NO_WALLS]

    @property
    def beside(self) -> Collection[int]:
        return {n for site in self.hit for n in self.lattice.beside(site)}

    def walls(self, site: int) -> Wall:
        pair: Wall = self.on.walls.at(site)
        return pair

    # ------------------------------------------------------------------------ far away

    @property
    def far(self) -> float:
        """The margin of the far field, 1 where there is none."""
        if not self.endless:
            return 1.0
        # far from all impacts u_n = c + a f(t)
        return min(self._far_at(1), self._far_at(-1))

    def _far_at(self, sign: int) -> float:
        """Its margin at one wall, with the larger offset of both ends; without coupling none."""
        ends = self.representation.offsets if self.on.gamma else (0.0,)
        offset = max(sign * ends[0], sign * ends[-1])
        return float(1.0 - offset - self.on.a * peak_of(self.response.drive.harmonics, sign))

    def far_time(self) -> float:
        """When it is closest to a wall."""
        if not self.endless:
            return self.start
        sign = min((1, -1), key=self._far_at)
        return _highest(self.response.drive, sign)

    # ------------------------------------------------------------------------ motion

    def states(self, n: ArrayLike, t: ArrayLike) -> FloatArray:
        """Displacements, velocities, accelerations of sites at times; just after an impact."""
        n, t = np.broadcast_arrays(n, np.asarray(t, dtype=float))
        sites, times = n.flatten(), t.flatten()
        if isinstance(self.response, ModalResponse):  # sites and times each once
            (those, i), (moments, j) = (np.unique(x, return_inverse=True) for x in (sites, times))
            return self._paths(moments, those)[:, j, i].reshape(3, *t.shape)
        out = np.empty((3, t.size))
        for first in range(0, t.size, MANY):
            part = slice(first, first + MANY)
            those, which = np.unique(sites[part], return_inverse=True)
            block = np.empty((3, which.size))
            STATES(self._of(tuple(those.tolist())), which, times[part], block)
            out[:, part] = block
        return out.reshape(3, *t.shape)

    def _paths(self, times: FloatArray, sites: Any) -> FloatArray:
        """States of sites at all of many times, shape (3, times, sites)."""
        response: Any = self.response
        orbit, basis = self.representation, response.basis
        hits = np.array([impact[2:] for impact in orbit.impacts])
        modes = response.modes(*hits.T, times)
        if orbit.resonant:
            for j, (i, w) in enumerate(orbit.resonant):
                cosine, sine = orbit.amplitudes[2 * j : 2 * j + 2]
                wave = complex(cosine, -sine) * np.exp(1j * w * times)
                modes[:, :, i] += [((1j * w) ** order * wave).real for order in range(3)]
        every = np.array_equal(sites, np.arange(self.lattice.sites))  # sooner, by transforms
        paths = basis.to_sites(modes) if every else modes @ basis.at(sites).T
        for order in range(3):
            forced = self.on.a * response.driven().everywhere(times, order)
            paths[order] += forced if forced.shape[-1] == 1 else forced[:, sites]
        paths[0] += self.offset(sites)
        return np.asarray(paths)

    def at(self, site: int, t: float) -> Terms:
        """Displacement, velocity and acceleration of one site at one time."""
        out = np.empty((3, 1))
        STATES(self._of((site,)), _FIRST, np.array([t]), out)
        (u,), (v,), (w,) = out.tolist()
        return u, v, w

    def offset(self, n: ArrayLike) -> FloatArray:
        offsets = self.representation.offsets
        if not any(offsets):
            return np.zeros(np.shape(n))
        return np.asarray(self.response.profile(np.asarray(n)) @ offsets)

    def slopes(
        self, site: int, t: float, names: Collection[str], share: FloatArray | None = None
    ) -> dict[str, FloatArray]:
        """Derivatives of displacement and velocity at a time: in the impulses J1, J2, ..., times
        t1, t2, ... and offsets of a section, by name, in a, k and parameters named; and in the
        time t. With `share` that of the offsets does not change."""
        response, orbit, a = self.response, self.representation, self.on.a
        then, there = np.array([t]), (site,)
        since = np.array([t - impact.time for impact in orbit.impacts])
        impulses = np.array([impact.impulse for impact in orbit.impacts])
        h, forced = response.at(site, since), response.forced(there, then)[:, 0]
        slopes = {"a": forced[:2], "k": np.zeros(2), "t": a * forced[1:3] + h[1:3] @ impulses}
        for i, J in enumerate(impulses):
            slopes[f"J{i + 1}"] = h[:2, i]
            # an answer is a function of t - t_i: its derivative in t_i is minus that in t
            slopes[f"t{i + 1}"] = -J * h[1:3, i]
        if orbit.offsets:
            weights = response.profile(site) if share is None else share
            columns = self.section.offset_names(response.drive.params)
            slopes |= {c: np.array([w, 0.0]) for c, w in zip(columns, weights, strict=True)}
        if isinstance(response, ModalResponse) and orbit.resonant:
            swing = response.swing(there, then)[:, 0]
            slopes["modes"] = swing[:2]
            slopes["t"] = slopes["t"] + swing[1:3] @ orbit.amplitudes
        for name in {*HELD, *response.drive.params}.intersection(names):
            of = response.varied(name)
            slopes[name] = a * of.forced(there, then, name)[:2, 0]
            if name in HELD:
                slopes[name] = slopes[name] + of.at(site, since, name)[:2] @ impulses
            if share is None and orbit.offsets:
                slopes[name][0] += of.profile_slope(name, site) @ orbit.offsets
        return slopes

    def differences(self, sites: Sequence[int], other: int) -> FloatArray:
        """Root mean squares of motions less that of another, of that less its forced one; where
        some symmetry has both as far off their walls, of that."""
        turns = 2 * self.section.turns
        times: FloatArray = self.start + math.pi / 8.0 * np.arange(8.0 * turns)
        paths = self.states(np.array([other, *sites])[:, None], times)[0]
        forced = self.on.a * self.response.forced((other,) * times.size, times)[0]
        same = np.array(sites) == other
        apart = np.where(same[:, None], paths[0] - forced, paths[1:] - paths[0])
        gaps = self._gaps((other, *sites), paths)
        nearest = ((gaps[1:, None] - _later(gaps[0], turns)) ** 2).mean(axis=2).min(axis=1)
        squares = np.maximum(np.mean(apart**2, axis=1), nearest)  # walls may differ, too
        return np.sqrt(np.where(same | (nearest > IMAGE**2), squares, nearest))

    def _gaps(self, sites: Sequence[int], paths: FloatArray) -> FloatArray:
        """How far sites are off their nearest walls along their paths."""
        low, high = np.array([self.walls(n) for n in sites]).T[:, :, None]
        return np.minimum(high - paths, paths - low)

    # ------------------------------------------------------------------------ for kernels

    def with_idle(
        self, idle: Sequence[int], near: Collection[int] = (), touching: int | None = None
    ) -> tuple[Motion, Sequence[int]]:
        """The motion of the sites that impact, and behind them of those of others that are near or
        may come closest to a wall, besides one that touches it; and which these are."""
        if isinstance(self.response, UniformResponse) or not idle:
            return self._of((*self.hit, *idle)), idle
        candidates, size = np.array(idle, dtype=int), points_of(self.fine, self.length)
        times = self.start + self.length / size * np.arange(size)
        profiles, speeds, curvatures = self._paths(times, candidates).swapaxes(1, 2)
        gaps = self._gaps(idle, profiles)
        # between two places of the grid a site comes closer by no more than Taylor's first terms
        half = self.length / size / 2.0
        most = abs(curvatures).max(axis=1, keepdims=True)
        lowest = (gaps - half * (abs(speeds) + half / 2.0 * most)).min(axis=1)
        closest = gaps.min(axis=1)
        if touching is not None and touching in candidates:
            half_periods = 1 if self.section.symmetric else 2 * self.section.turns
            for later in _later(gaps[idle.index(touching)], half_periods):
                closest[abs(gaps - later).max(axis=1) <= IMAGE] = math.inf
        wanted = lowest <= closest.min()
        # far away sites move alike: of those the first
        wanted &= np.isin(
            np.arange(candidates.size), np.unique(closest.round(12), return_index=True)[1]
        )
        wanted |= np.isin(candidates, list(near))
        sites = candidates[wanted].tolist()
        return self._of((*self.hit, *sites)), sites

    def _of(self, sites: tuple[int, ...]) -> Motion:
        rows = [(t, J, self.hit.index(site), wall) for site, wall, t, J in self.impacts]
        impacts = np.array([*zip(*rows, strict=True)], dtype=float)
        places = np.empty((len(sites), 4))
        places[:, OFFSET], places[:, BACK] = self.offset(sites), self.on.at_sites("k", sites)
        places[:, LOW:BACK] = [self.walls(n) for n in sites]
        a, forced = self._forced(sites)
        section = self.start, self.length, float(self.sign), self.fine
        parts = forced, self.response.table(sites), impacts
        return Motion(a, *section, *parts, self.section.count, len(self.hit), places)

    def _forced(self, sites: tuple[int, ...]) -> tuple[float, Forced]:
        """The forced motion with that of modes in resonance, and its amplitude."""
        a, response, orbit = float(self.on.a), self.response, self.representation
        if isinstance(response, UniformResponse):
            return a, _alike(response.drive)
        alike = len(response.driven().table) == 1 and not orbit.resonant
        series = [response.harmonics(site) for site in (sites[:1] if alike else sites)]
        m, A, B = np.moveaxis(np.array(series, dtype=float), 2, 0)
        orders, share = m[0], a
        if orbit.resonant:
            modes, frequencies = zip(*orbit.resonant, strict=True)
            shapes = response.basis.at(np.array(sites))[:, list(modes)]
            swings = np.reshape(orbit.amplitudes, (-1, 2)).T
            A, B = (np.hstack([a * x, shapes * y]) for x, y in zip((A, B), swings, strict=True))
            orders, share = np.append(orders, frequencies), 1.0
        A, B = np.ascontiguousarray(A), np.ascontiguousarray(B)
        return share, Forced(np.ascontiguousarray(orders), A, B, math.inf)


@lru_cache(maxsize=64)
def _alike(forcing: Forcing) -> Forced:
    """Forced motion of all sites where nothing but the walls holds them."""
    m, A, B = np.array(forcing.harmonics, dtype=float).reshape(-1, 3).T.copy()
    return Forced(m, A[None], B[None], float(forcing.peak()))


@lru_cache(maxsize=64)
def _around(lattice: UniformLattice, hit: tuple[int, ...]) -> Sequence[int]:
    """The sites near those that impact, but those."""
    ring, sites = lattice.sites, {*range(hit[0] - NEAR, hit[-1] + NEAR + 1)}
    if len(hit) == 1:  # both sides are alike
        sites = {hit[0] + lattice.distance(site - hit[0]) for site in sites}
    return sorted({site % ring for site in sites} - set(hit) if ring else sites - set(hit))


@lru_cache(maxsize=64)
def _highest(forcing: Forcing, sign: float) -> float:
    """When f is largest in one direction."""
    t = np.linspace(0.0, 2.0 * math.pi, 64 * forcing.highest, endpoint=False)
    return float(t[int((sign * forcing.f(t)).argmax())])
