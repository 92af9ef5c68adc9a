"""The motion of the sites of an orbit by the closed form of the symmetric breather, by the Green's
function of chain and ring, or by the modes of any finite lattice.

Beyond a dozen sites from the last that impacts the response of the chain is one harmonic, whose
amplitude shrinks and changes sign from site to site. The largest displacement is a convex function
of that amplitude, so the first two such sites and the far field bound all the others.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contbreather.lattice.band_averages import UniformLattice
from contbreather.lattice.finite import Finite, drive_of, stiffness_of
from contbreather.lattice.forcing import Forcing
from contbreather.lattice.free_flight import POWERS, Responses, response_weights
from contbreather.lattice.periodic_green import bounds, is_resonant, responses
from contbreather.orbits.margins import IMAGE, Forced, FreeModes, Motion, points_of
from contbreather.orbits.section import Section

FloatArray = NDArray[np.float64]
Terms = tuple[float, float, float]  # a value and its first two derivatives
Wall = tuple[float, float]

FINE = 64  # points to half a period of the forcing, sixteen to that of its highest harmonic
NEAR = 13  # (0.072)^13 < 1e-14: the third harmonic has died out two sites earlier
USUAL = (-1.0, 1.0)
NO_WALLS = (-math.inf, math.inf)
_ORDERS = 12  # of the coupling by which sites may be told apart; beyond them all is rounding
_ALIKE = 1e-9  # relative: sites that differ by less are told alike
LOW = 0.1  # sites whose lowest distance on the grid is this close to the least may have it

_NO_VECTOR, _NO_MATRIX = np.empty(0), np.empty((0, 0))
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
        # of a period, those of a section first
        sections = 1 if self.sign > 0 else 2
        self.impacts = self.section.course(representation.impacts, sections)
        self.start = float(self.impacts[0].time)  # of a section

    @cached_property
    def idle(self) -> Sequence[int]:
        """Sites that never hit a wall, all that may come closest to one."""
        raise NotImplementedError

    @property
    def beside(self) -> Collection[int]:
        """Sites coupled to one that hits a wall."""
        return {n for site in self.hit for n in self.lattice.beside(site)}

    def walls(self, site: int) -> Wall:
        return USUAL

    @property
    def far(self) -> float:
        """The margin of the far field, 1 where there is none."""
        return float(self.far_of(self.on.a))

    def far_of(self, a: Any) -> Any:
        """The same of other amplitudes."""
        return 1.0

    def far_time(self) -> float:
        """When it is closest to a wall."""
        return self.start

    def influence(self, site: int, other: int | None = None) -> float:
        """How strongly a site feels the impacts, or how much it moves otherwise than another does,
        to first order in the coupling."""
        order = self._order(site, site if other is None else other)
        return self._strongest * float(self.on.gamma**order)  # |xi| of (A3) is gamma to first order

    @cached_property
    def _strongest(self) -> float:
        return 0.5 * max(abs(impact.impulse) for impact in self.impacts)

    def _order(self, site: int, other: int) -> float:
        """The power of the coupling in which a site first moves otherwise than another, or, given
        twice, than without impacts."""
        raise NotImplementedError

    def with_idle(
        self, idle: Sequence[int], near: Collection[int] = (), touching: int | None = None
    ) -> tuple[Motion, Sequence[int]]:
        """The motion of the sites that impact, and behind them of those of others that are near or
        may come closest to a wall, besides one that touches it; and which these are."""
        sites = (*self.hit, *idle)
        return self._motion(sites, *self._parts(sites)), idle

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

    def _parts(self, sites: tuple[int, ...]) -> tuple[Forced, Responses, FreeModes]:
        raise NotImplementedError

    def _places(self, sites: Sequence[int]) -> FloatArray:
        """Offset and walls of each site."""
        return np.array([(0.0, *self.walls(n)) for n in sites])


@lru_cache(maxsize=64)
def _alike(forcing: Forcing) -> Forced:
    """What all sites follow where nothing but the walls holds them."""
    m, A, B = np.array(forcing.harmonics, dtype=float).reshape(-1, 3).T.copy()
    return Forced(m, A[None], B[None], float(forcing.peak()))


# --- chain and ring, with impacts that recur --------------------------------------------------


class ChainMotion(SiteMotion):
    """By its impacts: responses depend on the distance of a site from each of them."""

    @cached_property
    def idle(self) -> Sequence[int]:
        resonant = is_resonant(self.lattice, self.on.gamma, self.section.turns)
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

    def _order(self, site: int, other: int) -> float:
        return _bonds(self.lattice, self.hit, site, other)


@lru_cache(maxsize=4096)
def _bonds(lattice: UniformLattice, hit: tuple[int, ...], site: int, other: int) -> float:
    """How far away the impacts are that one of two sites feels before the other, or that the one
    site feels first."""
    far = [[lattice.distance(n - busy) for busy in hit] for n in (site, other)]
    unlike = [min(pair) for pair in zip(*far, strict=True) if len({*pair}) == 2]
    return min(unlike if site != other else far[0], default=math.inf)


@lru_cache(maxsize=64)
def _around(lattice: UniformLattice, hit: tuple[int, ...], everywhere: bool) -> Sequence[int]:
    """The sites near those that impact, or all, but those."""
    ring = lattice.sites
    sites = set(range(ring or 0) if everywhere else range(hit[0] - NEAR, hit[-1] + NEAR + 1))
    if len(hit) == 1:  # both sides are alike
        sites = {hit[0] + lattice.distance(site - hit[0]) for site in sites}
    return sorted({site % ring for site in sites} - set(hit) if ring else sites - set(hit))


class ClosedFormMotion(ChainMotion):
    """A symmetric breather, of which site 0 impacts."""

    def _parts(self, sites: tuple[int, ...]) -> tuple[Forced, Responses, FreeModes]:
        responses = _odd_responses(self.lattice, self.on.gamma, sites)
        return _alike(self.forcing), responses, _NO_MODES


@lru_cache(maxsize=64)
def _odd_responses(lattice: UniformLattice, gamma: float, sites: tuple[int, ...]) -> Responses:
    """To the impulse -2p, of which `FreeFlight` is the response per unit p."""
    table = np.zeros((len(sites), POWERS + 2))
    np.matmul(lattice.powers(gamma, sites), -0.5 * _WEIGHTS, out=table[:, :POWERS])
    # in `FreeFlight` it is -(4/pi) g sin y; J = -2p halves it and takes the sign away
    table[:, POWERS] = 2.0 / math.pi * lattice.first_harmonic(gamma, np.array(sites))  # of sin y
    rows, none = np.arange(len(sites))[:, None], np.empty((len(sites), 0))
    largest = bounds(table, _odd_basis())
    return Responses(rows, table, _NO_VECTOR, none, none, largest, 1.0, True)


_WEIGHTS = response_weights()[::-1].T  # the highest power first


@lru_cache(maxsize=1)
def _odd_basis() -> FloatArray:
    y, odd = np.linspace(0.0, 0.5 * math.pi, 65), 2.0 * np.arange(POWERS)[::-1, None] + 1.0
    return np.vstack([y**odd, np.sin(y), np.sin(2.0 * y)])


class GreenMotion(ChainMotion):
    """An orbit with any impacts, by the periodic Green's function."""

    def _parts(self, sites: tuple[int, ...]) -> tuple[Forced, Responses, FreeModes]:
        hits = tuple(impact.site for impact in self.impacts)
        to_impacts = responses(self.lattice, self.on.gamma, sites, hits, self.section.turns)
        return _alike(self.forcing), to_impacts, _NO_MODES

    def _places(self, sites: Sequence[int]) -> FloatArray:
        places = super()._places(sites)
        places[:, 0] = self.representation.offset(sites)
        return places


@lru_cache(maxsize=64)
def _highest(forcing: Forcing, sign: float) -> float:
    """When f is largest in one direction."""
    t = np.linspace(0.0, 2.0 * math.pi, 64 * forcing.highest, endpoint=False)
    return float(t[int((sign * forcing.f(t)).argmax())])


# --- modes of a finite lattice --------------------------------------------------------------


class ModalMotion(SiteMotion):
    """A shot orbit of any finite lattice."""

    def walls(self, site: int) -> Wall:
        pair: Wall = self.on.walls.at(site)
        return pair

    @cached_property
    def idle(self) -> Sequence[int]:
        sites = self.lattice.idle(self.hit).tolist()
        return [n for n in sites if self.walls(n) != NO_WALLS]

    def _order(self, site: int, other: int) -> float:
        if self.walls(site) != self.walls(other):
            return 0.0
        walks = _walks(self.lattice, self.hit)
        apart = walks[:, site, 1:] if site == other else walks[:, site] - walks[:, other]
        unlike = (abs(apart) > _ALIKE).any(axis=1)
        return float(unlike.argmax()) if unlike.any() else math.inf

    def with_idle(
        self, idle: Sequence[int], near: Collection[int] = (), touching: int | None = None
    ) -> tuple[Motion, Sequence[int]]:
        flight, candidates = self.representation, np.array(idle, dtype=int)
        size = points_of(self.fine, self.length)
        times = self.start + self.length / size * np.arange(size)
        profiles = flight.displacements(times)[:, candidates].T
        if candidates.size:
            low, high = self._places(candidates.tolist())[:, 1:].T[:, :, None]
            gaps = np.minimum(high - profiles, profiles - low).min(axis=1)
            if touching is not None and touching in candidates:
                image = profiles[candidates == touching]
                gaps[abs(profiles - image).max(axis=1) <= IMAGE] = math.inf
            wanted = gaps <= gaps.min() + LOW * max(abs(gaps.min()), LOW)
            # far away sites move alike: of those the first
            wanted &= np.isin(
                np.arange(candidates.size), np.unique(gaps.round(12), return_index=True)[1]
            )
            wanted |= np.isin(candidates, list(near))
            candidates, profiles = candidates[wanted], profiles[wanted]
        idle = candidates.tolist()
        sites = (*self.hit, *idle)
        legs = flight.legs[1:]
        starts = np.array([leg.since for leg in legs])
        q, r = np.array([leg.q for leg in legs]), np.array([leg.r for leg in legs])
        shapes = np.ascontiguousarray(flight.basis.at(sites))
        z, damping = flight.z, float(flight.conditions.damping)
        modes = FreeModes(starts, q, r, z, damping, shapes, np.ascontiguousarray(profiles))
        return self._motion(sites, self._forced(sites), _no_responses(len(sites)), modes), idle

    def _forced(self, sites: tuple[int, ...]) -> Forced:
        forced = self.representation.forced
        if forced.alike:
            return _alike(self.forcing)
        series = np.array([forced.harmonics(site) for site in sites], dtype=float)
        m, A, B = (np.ascontiguousarray(part) for part in np.moveaxis(series, 2, 0))
        return Forced(m[0], A, B, math.inf)


@lru_cache(maxsize=64)
def _walks(lattice: Finite, hit: tuple[int, ...]) -> FloatArray:
    """What each power of the coupling matrix makes of the drive and of each impact at each site,
    the largest being 1."""
    coupling = stiffness_of(lattice) / lattice.masses[:, None]
    walks = [np.column_stack([drive_of(lattice), *np.eye(lattice.sites)[list(hit)]])]
    for _ in range(_ORDERS):
        there = coupling @ walks[-1]
        walks.append(there / (abs(there).max() or 1.0))
    return np.array(walks)


@lru_cache(maxsize=64)
def _no_responses(sites: int) -> Responses:
    which = np.empty((sites, 0), dtype=np.int64)
    none = _NO_VECTOR, _NO_MATRIX, _NO_MATRIX, _NO_VECTOR
    return Responses(which, _NO_MATRIX, *none, 1.0, False)
