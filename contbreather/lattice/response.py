"""Answers of a lattice to impulses that recur: all that the equations of an orbit ask of it.

``h_nj(s)`` is the motion of site n at a time s after a unit impulse at the site of impact j, which
comes again after each section T, with the sign e = +-1 of the section. A mode ``z = w^2`` answers

    ``r(s) = [exp(l1 s)/(1 - e exp(l1 T)) - exp(l2 s)/(1 - e exp(l2 T))]/(l1 - l2)``,

l1 and l2 the roots of ``l^2 + damping l + z = 0``. With e = +1 its mean 1/(z T) belongs to the
offsets of the sites that are hit, and is taken out. What is left is analytic in z wherever no
harmonic of the orbit is: it is its own mean over a circle around z, which is how modes are taken
that drift (z -> 0), or are critically damped. Derivatives in z are such means, too, and that in the
damping is the velocity of that in z. So each answer is a sum of waves ``Re A exp(l s)``.

Where a mode has a harmonic of the orbit for its frequency, the impacts alone do not tell how
strongly it moves: of such a mode that harmonic is taken out, too, and its amplitude is an unknown
of the orbit.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from contbreather.errors import BadInput
from contbreather.lattice.finite import PACE, Basis, stiffness_of
from contbreather.lattice.forcing import (
    Forcing,
    Harmonics,
    TrigonometricSeries,
    even_harmonics,
    mean_of,
)
from contbreather.lattice.modal_waves import (
    BY_DAMPING,
    BY_GAMMA,
    BY_SPRING,
    GROWTH,
    MODAL_PLACE,
    MOST,
    RATE,
    SIZE,
    VALUE,
    WAVES,
    HeldModes,
    ModeWaves,
    Recurring,
)
from contbreather.lattice.periodic_green import (
    INTERACTIONS,
    LATE,
    SLACK,
    Responses,
    half_period_green,
    periodic_green,
)

if TYPE_CHECKING:
    from contbreather.lattice.modal_flow import DrivenSpectrum

FloatArray = NDArray[np.float64]
HELD = "gamma", "spring", "damping"  # what a response depends on besides the drive
Array = NDArray[Any]
Sites = tuple[int, ...]
Resonant = tuple[tuple[int, float], ...]  # modes of a basis, with a harmonic of the orbit

BY = {"gamma": BY_GAMMA, "spring": BY_SPRING, "damping": BY_DAMPING}  # first rows of derivatives
RESONANT = 1e-7  # in z, from a harmonic: there a recurring impulse drives a mode beyond all bounds


class Resonance(BadInput):
    """A mode of the lattice follows the impacts without bound."""


@dataclass(frozen=True, eq=False)  # `answers_of` keeps them, and finds each again
class Response:
    """Answer of a lattice to the drive and to recurring impulses at some of its sites."""

    lattice: Any
    drive: Forcing
    gamma: float
    spring: float
    damping: float
    hits: Sites  # the site of each impact of a section
    turns: int
    sign: int
    resonant: Resonant = ()  # modes whose amplitude at a harmonic of the orbit is an unknown

    @cached_property
    def hit(self) -> Sites:
        return tuple(sorted({*self.hits}))

    @cached_property
    def length(self) -> float:
        return math.pi * self.turns * (2 if self.sign > 0 else 1)

    # ------------------------------------------------------------------------ to impulses

    def table(self, sites: Sites, by: str = "") -> Responses:
        """Responses of sites to each impact, or their derivatives in gamma, spring or damping."""
        raise NotImplementedError

    def at(self, site: int, since: ArrayLike, by: str = "") -> FloatArray:
        """Value and three derivatives of a site, times since each impact in the last axis."""
        of = self.table((site,), by)
        return of.at(since, of.which[0])

    def interactions(self, times: FloatArray, by: str = "") -> FloatArray:
        """``h_ij`` and three derivatives at t_i - t_j, of sites that are hit to each impact, shape
        (4, m, m); at the impact itself the mean velocity, and the acceleration just before."""
        out = np.empty((4, times.size, times.size))
        INTERACTIONS(self.table(self.hits, by), np.ascontiguousarray(times, dtype=float), out)
        return self.at_itself(out, by)

    def at_itself(self, after: FloatArray, by: str) -> FloatArray:
        """`interactions`, where those of impacts with themselves are known just after them."""
        i = np.arange(len(self.hits))
        # u' jumps by 1 at an impulse, and the damping brakes it by that much
        after[1, i, i] -= 0.5 * (not by)
        jump = {"": self.damping, "damping": 1.0, PACE: self.damping}.get(by, 0.0)
        if jump:
            after[2, i, i] += jump * self.lattice.dampings[list(self.hits)]
        return after

    def at_impacts(self, times: FloatArray) -> tuple[FloatArray, FloatArray]:
        """`interactions`, and the forced motion of each impact's site."""
        return self.interactions(times), self.forced(self.hits, times)

    def slopes_at_impacts(
        self, times: FloatArray, rates: Mapping[str, float]
    ) -> tuple[FloatArray, FloatArray]:
        """Derivatives of both along a direction of the parameters, without the third."""
        h, f = np.zeros((3, times.size, times.size)), np.zeros((3, times.size))
        for name, rate in rates.items():
            f += rate * self.forced(self.hits, times, name)[:3]
            if name in (*HELD, PACE) and name not in self.drive.params:
                h += rate * self.interactions(times, name)[:3]
        return h, f

    # ------------------------------------------------------------------------ to the drive

    def forced(self, sites: Sequence[int], times: FloatArray, by: str = "") -> FloatArray:
        """Motion of each site at its time, and three derivatives, at unit amplitude, (4, m); or
        how they change with a parameter."""
        if by in HELD and by not in self.drive.params:
            return np.zeros((4, times.size))
        series = self.drive.slope_harmonics(by) if by else self.drive.harmonics
        return np.array(TrigonometricSeries(series).motion(times))

    def harmonics(self, site: int) -> Harmonics:
        return self.drive.harmonics

    # ------------------------------------------------------------------------ at rest

    def profile(self, sites: Any) -> FloatArray:
        """Static displacement of sites for offsets of size 1, a column for each; without coupling
        nothing holds idle sites to those that are hit, and they stay at 0."""
        raise NotImplementedError

    def profile_slope(self, name: str, site: int) -> FloatArray:
        return np.zeros(len(self.hit))

    def links(self, by: str = "") -> FloatArray:
        """Stiffness between the offsets, per mass, or its derivative."""
        raise NotImplementedError

    def still(self, by: str = "") -> tuple[FloatArray, FloatArray]:
        """Displacement of sites by a mean of the drive at unit amplitude, where those that are hit
        are held at 0, and what it pulls at these with, per mass; or derivatives."""
        return np.zeros(1), np.zeros(len(self.hit))

    def varied(self, *names: str) -> Response:
        """Itself, as one that has derivatives in parameters."""
        return self


@dataclass(frozen=True, eq=False)
class UniformResponse(Response):
    """Response of the infinite chain, and of rings without losses, in closed form, to drives
    without a mean."""

    def varied(self, *names: str) -> Response:
        held = {"damping", "spring"}.intersection(names) - self.drive.params.keys()
        return ModalResponse(*(getattr(self, f.name) for f in fields(self))) if held else self

    def table(self, sites: Sites, by: str = "") -> Responses:
        if self.sign < 0:
            apart = tuple(self.lattice.distance(n - self.hits[0]) for n in sites)
            of = half_period_green(self.lattice, self.gamma, apart, by)
            # to each impact of the one site alike
            return of._replace(which=np.repeat(of.which, len(self.hits), axis=1))
        return periodic_green(self.lattice, self.gamma, sites, self.hits, self.turns, by)

    def profile(self, sites: Any) -> FloatArray:
        n, hit, ring = np.asarray(sites, dtype=float), list(self.hit), self.lattice.sites
        around = {"period": ring} if ring is not None and len(hit) > 1 else {}
        straight = [np.interp(n % ring if ring else n, hit, e, **around) for e in np.eye(len(hit))]
        held = 1.0 if self.gamma else np.isin(n, hit)
        return np.stack([line * held for line in straight], axis=-1)

    def links(self, by: str = "") -> FloatArray:
        bonds = _bonds_between(self.lattice.sites, self.hit)
        return bonds if by == "gamma" else self.gamma * bonds


@lru_cache(maxsize=256)
def _bonds_between(ring: int | None, hit: Sites) -> FloatArray:
    """Stiffness between sites of a chain or a ring that are held: bonds in a row have 1/bonds."""
    r = len(hit)
    stiffness = np.zeros((r, r))
    pairs = [(i, i + 1, hit[i + 1] - hit[i]) for i in range(r - 1)]
    if ring is not None and r > 1:  # and on around the ring
        pairs.append((r - 1, 0, ring - hit[-1] + hit[0]))
    for i, j, bonds in pairs:
        stiffness[[i, j, i, j], [i, j, j, i]] += np.array([1.0, 1.0, -1.0, -1.0]) / bonds
    return stiffness


# --- any finite lattice -----------------------------------------------------------------------


class AnswerWaves(NamedTuple):
    """Sums of ``Re A exp(l s)``, mode after mode, and a constant for every mode."""

    rates: Array
    sizes: Array
    modes: NDArray[np.int64]
    level: FloatArray


def harmonics(turns: int, sign: int) -> tuple[float, float]:
    """The lowest harmonic of an orbit besides 0, and the distance between two."""
    return (1.0 / turns,) * 2 if sign > 0 else (1.0 / turns, 2.0 / turns)


@dataclass(frozen=True, eq=False)
class ModalResponse(Response):
    """Response of any finite lattice with masses, damping and springs, mode by mode."""

    @cached_property
    def basis(self) -> Basis:
        basis: Basis = self.lattice.basis(self.hit)
        return basis

    @cached_property
    def z(self) -> FloatArray:
        """Squared frequencies of the modes."""
        return np.asarray(self.gamma * self.basis.lam + self.spring)

    # ------------------------------------------------------------------------ to impulses

    def _waves(self, modes: HeldModes, part: int) -> AnswerWaves:
        """Waves of the modes with these sizes."""
        waves = _room(modes.lam.size)
        WAVES(modes, self._section, waves)
        self._check_apart(waves)
        n, level = int(waves.filled[0]), waves.level[:, int(part == GROWTH)]
        rates, sizes = (waves.parts[i, :n].copy() for i in (RATE, part))
        return AnswerWaves(rates, sizes, waves.modes[:n], level.copy())

    @cached_property
    def _held_modes(self) -> HeldModes:
        lam = self.basis.lam
        swings = np.zeros(lam.size)  # the harmonic that is taken out of each mode
        for i, w in self.resonant:
            swings[i] = w
        held = float(self.gamma), float(self.spring), float(self.damping)
        return HeldModes(lam, swings, *held, False)

    def _check_apart(self, waves: ModeWaves) -> None:
        if not waves.apart.min() > RESONANT:
            w = math.sqrt(abs(float(self.z[waves.apart.argmin()])))
            raise self.resonance(w)

    def resonance(self, w: float) -> Resonance:
        return Resonance(
            f"a mode of the {self.lattice.describe()} with {w:.9g} times the frequency of the "
            "drive is in resonance with the orbit: change gamma, spring or omega, or give it "
            "damping."
        )

    @property
    def _section(self) -> Recurring:
        return Recurring(float(self.turns), self.sign < 0)

    @cached_property
    def _answers(self) -> AnswerWaves:
        return self._waves(self._held_modes, SIZE)

    @cached_property
    def _slopes(self) -> AnswerWaves:
        """Derivatives in z."""
        return self._waves(self._held_modes._replace(circles=True), GROWTH)

    def interactions(self, times: FloatArray, by: str = "") -> FloatArray:
        rows = _modal_place(self, times.tobytes())[0]
        return rows[BY[by] : BY[by] + 3] if by else rows[VALUE:4]

    def at_impacts(self, times: FloatArray) -> tuple[FloatArray, FloatArray]:
        h, f = _modal_place(self, times.tobytes())
        return h[VALUE:4], f[VALUE:4]

    def slopes_at_impacts(
        self, times: FloatArray, rates: Mapping[str, float]
    ) -> tuple[FloatArray, FloatArray]:
        if not rates.keys().isdisjoint(self.drive.params):
            return super().slopes_at_impacts(times, rates)
        way, rows = [rates.get(name, 0.0) for name in BY], _modal_place(self, times.tobytes())
        h, f = (np.dot(way, of[4:].reshape(3, -1)).reshape(3, *of.shape[1:]) for of in rows)
        return h, f

    def table(self, sites: Sites, by: str = "") -> Responses:
        return _modal_table(self, sites, by)

    def modes(self, times: FloatArray, impulses: FloatArray, at: FloatArray) -> FloatArray:
        """Displacement, velocity and acceleration of all modes at times ``at``, without offsets,
        from the times and impulses of a section, shape (3, times, K)."""
        waves, kicks = self._answers, _kicks(self.lattice, self.hit, self.hits)
        laps, age = self.since(at[:, None] - times)
        last, row = age.argmin(axis=1), np.arange(at.size)  # the latest impact of each time
        before, ages = self.since(times[:, None] - times)
        J = np.where(before % 2 != 0, float(self.sign), 1.0) * impulses
        # all waves as they are just after each impact; from the latest one on they turn freely
        turned = np.exp(np.multiply.outer(ages, waves.rates))
        moved = (turned * (J[..., None] * kicks[:, waves.modes])).sum(axis=1) * waves.sizes
        signs = np.where(laps[row, last] % 2 != 0, float(self.sign), 1.0)
        moved = (
            signs[:, None] * moved[last] * np.exp(np.multiply.outer(age[row, last], waves.rates))
        )
        out = np.empty((3, at.size, waves.level.size))
        first = np.searchsorted(waves.modes, np.arange(waves.level.size))
        for order in range(3):
            out[order] = np.add.reduceat(moved.real, first, axis=1)
            moved *= waves.rates
        out[0] += (impulses @ kicks) * waves.level  # none where signs alternate
        return out

    def since(self, times: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Laps that impacts so long ago have recurred since, and what is beyond them."""
        laps = np.floor((times + LATE + SLACK * abs(times)) / self.length)
        return laps, times - laps * self.length

    # ------------------------------------------------------------------------ in resonance

    def swing(self, sites: Sequence[int], times: FloatArray) -> FloatArray:
        """``e cos wt, e sin wt`` of each mode whose amplitude is an unknown, at sites and times,
        and three derivatives, (4, n, 2 modes)."""
        modes, w = [i for i, _ in self.resonant], np.array([w for _, w in self.resonant])
        wave: Array = self.basis.at(np.array(sites))[:, modes] * np.exp(
            np.multiply.outer(times, -1j * w)
        )
        out = np.empty((4, *wave.shape, 2))
        for order in range(4):
            out[order, ..., 0], out[order, ..., 1] = wave.real, -wave.imag
            wave = -1j * w * wave
        return out.reshape(4, times.size, 2 * w.size)

    def gaps(self, by: str = "") -> FloatArray:
        """``T/2 (z - w^2 + i w damping)`` of each, as matrices of the amplitudes, or derivatives:
        what impacts at times t drive them by is the sum of J exp(iwt)."""
        out = np.zeros((2 * len(self.resonant),) * 2)
        for j, (i, w) in enumerate(self.resonant):
            near = {"gamma": self.basis.lam[i], "spring": 1.0, "": self.z[i] - w * w}.get(by, 0.0)
            loss = {"damping": w, "": w * self.damping}.get(by, 0.0)
            out[2 * j : 2 * j + 2, 2 * j : 2 * j + 2] = [[near, loss], [-loss, near]]
        return 0.5 * self.length * out

    # ------------------------------------------------------------------------ to the drive

    @cached_property
    def has_mean(self) -> bool:
        """Tell whether its drive has a mean, be it 0 just now."""
        return 0 in even_harmonics(self.drive)

    def driven(self, by: str = "") -> Any:
        """The forced motion of all sites at unit amplitude, or its derivative; by a mean that of
        sites which are not hit, the others held at 0."""
        waves = self._spectrum(by)
        if not self.has_mean:
            return waves
        still = self.still(by)[0]
        table = np.broadcast_to(waves.table, (still.size, waves.m.size))
        return type(waves)(np.append(waves.m, 0.0), np.column_stack([table, still]))

    def _spectrum(self, by: str) -> DrivenSpectrum:
        from contbreather.lattice.modal_flow import driven_spectrum  # a breather needs none

        return driven_spectrum(self.lattice, self.drive, self.gamma, self.spring, self.damping, by)

    def still(self, by: str = "") -> tuple[FloatArray, FloatArray]:
        if not self.has_mean:
            return super().still(by)
        own = by in self.drive.params
        mean, held = mean_of(self.drive, by if own else ""), (self.gamma, self.spring)
        rest, pull = mean_displacement(self.lattice, self.hit, *held, "" if own else by)
        return mean * rest, mean * pull

    def forced(self, sites: Sequence[int], times: FloatArray, by: str = "") -> FloatArray:
        return np.asarray(self.driven(by).along(sites, times))

    def harmonics(self, site: int) -> Harmonics:
        return self.driven().harmonics(site)

    # ------------------------------------------------------------------------ at rest

    @cached_property
    def _at_rest(self) -> AtRest:
        # without coupling sites rest as they do next to none, unless springs hold them
        ratio = self.spring / self.gamma if self.gamma else math.inf if self.spring else 0.0
        return _at_rest(self.lattice, self.hit, ratio)

    def profile(self, sites: Any) -> FloatArray:
        sites = np.asarray(sites) % self.lattice.sites
        if not self.gamma:
            return np.asarray((sites[..., None] == np.array(self.hit)) * 1.0)
        return self._at_rest.profile[sites]

    def profile_slope(self, name: str, site: int) -> FloatArray:
        # it depends on spring/gamma alone, or next to no coupling on gamma/spring
        gamma, spring, change = self.gamma, self.spring, dict[str, float]()
        if gamma:
            change = {"gamma": -spring / gamma**2, "spring": 1.0 / gamma}
        elif spring:
            change = {"gamma": 1.0 / spring}
        return np.asarray(change.get(name, 0.0) * self._at_rest.slope[site])

    def links(self, by: str = "") -> FloatArray:
        # the energy at rest is least in all other sites: its slopes are direct ones
        weights = {"gamma": (1.0, 0.0), "spring": (0.0, 1.0)}.get(by, (self.gamma, self.spring))
        return weights[0] * self._at_rest.bonds + weights[1] * self._at_rest.springs


@lru_cache(maxsize=16)
def _modal_place(of: ModalResponse, times: bytes) -> tuple[FloatArray, FloatArray]:
    """What it answers at the impacts, and what that changes by: kept, as equations and their slopes
    ask in turn."""
    at, modes = np.frombuffer(times), of._held_modes
    waves = _room(modes.lam.size)
    out, forced = np.empty((13, at.size, at.size)), np.empty((13, at.size))
    weights = _passed_on(of.lattice, of.hit, of.hits, of.hits)
    drive = _pushes(of.lattice, of.drive, of.hits)
    MODAL_PLACE(modes, weights, of._section, drive, at, waves, out, forced)
    of._check_apart(waves)
    if math.isnan(forced[VALUE].sum()):
        of.driven()  # says why
    return out, forced


@lru_cache(maxsize=64)
def _kicks(lattice: Any, hit: Sites, hits: Sites) -> FloatArray:
    """Kicks of the modes by an impulse at the site of each impact, (m, K)."""
    sites = np.array(hits)
    return np.asarray(lattice.basis(hit).at(sites) * lattice.masses[sites][:, None])


@lru_cache(maxsize=64)
def _passed_on(lattice: Any, hit: Sites, sites: Sites, hits: Sites) -> FloatArray:
    """How strongly each mode passes an impulse on from each impact to each site, (n, m, K)."""
    values = lattice.basis(hit).at(np.array(sites))[:, None]
    return np.asarray(values * _kicks(lattice, hit, hits))


def _room(K: int) -> ModeWaves:
    parts = np.empty((4, MOST * K), complex), np.empty(MOST * K, dtype=np.int64)
    return ModeWaves(*parts, np.empty((K, 2)), np.empty(K), np.zeros(1, dtype=np.int64))


@lru_cache(maxsize=64)
def _pushes(lattice: Any, drive: Forcing, hits: Sites) -> FloatArray:
    """Rows for `driven_motion`."""
    from contbreather.lattice.modal_flow import driven_modes

    m, shapes, lam, pushes, limits = driven_modes(lattice, drive)
    shapes = shapes[list(hits)] if len(shapes) > 1 else shapes[np.zeros(len(hits), dtype=int)]
    rows = np.broadcast_arrays(lam, m, pushes.real, pushes.imag, limits)
    at = [np.broadcast_to(shape[:, None], pushes.shape) for shape in shapes]
    return np.array([*rows, *at]).reshape(5 + len(hits), -1).T.copy()


@lru_cache(maxsize=256)
def _modal_table(of: ModalResponse, sites: Sites, by: str) -> Responses:
    waves = of._slopes if by else of._answers
    sizes, level = waves.sizes, waves.level
    if by == "damping":
        sizes, level = sizes * waves.rates, 0.0 * level
    weights = _passed_on(of.lattice, of.hit, sites, of.hit).reshape(-1, level.size)
    if by == "gamma":
        weights = weights * of.basis.lam  # dz/dgamma
    grown = weights[:, waves.modes] * sizes
    return as_table(of, sites, weights @ level, waves.rates, grown)


def as_table(
    of: ModalResponse, sites: Sites, level: FloatArray, waves: Array, grown: Array
) -> Responses:
    """Arguments of kernels, of constants and of sizes of waves by their rates."""
    r, own = len(of.hit), np.array([of.hit.index(n) for n in of.hits])
    which = r * np.arange(len(sites))[:, None] + own
    table = np.zeros((level.size, 3))
    table[:, 0] = level
    rates = np.column_stack([waves.real, waves.imag])
    parts = np.ascontiguousarray(grown.real), np.ascontiguousarray(grown.imag)
    unbounded = np.full(level.size, math.inf)
    return Responses(which, table, rates, *parts, unbounded, float(of.turns), of.sign < 0)


@lru_cache(maxsize=64)
def mean_displacement(
    lattice: Any, hit: Sites, gamma: float, spring: float, by: str = ""
) -> tuple[FloatArray, FloatArray]:
    """A lattice at rest under its drive at 1, sites that are hit held at 0: displacements of all,
    and the force per mass at those; or derivatives in gamma or spring, 0 in others."""
    bonds, held = stiffness_of(lattice), lattice.masses * lattice.springs
    matrix, solved = _at_other_sites(lattice, hit, gamma, spring)

    def moved(force: FloatArray) -> FloatArray:
        try:
            out = solved(force)
            if abs(out).max() * abs(matrix).max() > 1e12 * abs(force).max():
                raise RuntimeError  # singular but for rounding
        except RuntimeError:
            raise BadInput(
                f"the drive has a mean, and nothing holds sites of the {lattice.describe()} "
                f"against it (gamma = {gamma:.9g}, spring = {spring:.9g}): give it springs or, "
                "where others hit their walls, coupling; a simulation takes it as it is."
            ) from None
        return out

    force: Any = lattice.masses * lattice.drive
    still = moved(force)
    if by:  # K u = F: K du = -dK u
        pulls = {"gamma": bonds @ still, "spring": held * still, PACE: 2.0 * (matrix @ still)}
        force = -pulls.get(by, 0.0 * force)
        still = moved(force)
    return still, (force - matrix @ still)[list(hit)] / lattice.masses[list(hit)]


def _at_other_sites(
    lattice: Any, hit: Sites, gamma: float, spring: float
) -> tuple[Any, Callable[[FloatArray], FloatArray]]:
    """The stiffness with coupling and springs, and how forces, in columns, displace the sites that
    are not hit, the others held at 0."""
    from scipy import sparse
    from scipy.sparse.linalg import splu

    held = sparse.diags_array(lattice.masses * lattice.springs)
    matrix = sparse.csc_array(gamma * stiffness_of(lattice) + spring * held)
    rest = np.setdiff1d(np.arange(lattice.sites), hit)

    def solved(forces: FloatArray) -> FloatArray:
        out = np.zeros_like(forces)
        if rest.size:
            out[rest] = splu(matrix[rest][:, rest]).solve(forces[rest])
        return out

    return matrix, solved


class AtRest(NamedTuple):
    """A lattice at rest if one of the sites that are hit is held at 1 and the others at 0."""

    profile: FloatArray  # of all sites, a column for each
    slope: FloatArray  # its derivative in the ratio of springs to coupling, or where that is
    # infinite in the ratio of coupling to springs
    bonds: FloatArray  # stiffness between the sites that are hit by bonds alone, per mass
    springs: FloatArray  # and by springs


@lru_cache(maxsize=64)
def _at_rest(lattice: Any, hit: Sites, ratio: float) -> AtRest:
    """Rest with springs of so many times the coupling; an infinite one holds all others at 0."""
    from scipy.sparse.csgraph import connected_components

    held = (lattice.masses * lattice.springs)[:, None]
    profile = np.eye(lattice.sites)[:, list(hit)]
    if ratio == math.inf:
        slope = np.zeros_like(profile)
        np.divide(stiffness_of(lattice) @ -profile, held, out=slope, where=held > 0.0)
        slope[list(hit)] = 0.0
    else:
        _, part = connected_components(stiffness_of(lattice))
        apart = np.flatnonzero(~np.isin(part, part[list(hit)]))  # no bond leads there: they stay
        matrix, solved = _at_other_sites(lattice, (*hit, *apart), 1.0, ratio)
        profile -= solved(matrix @ profile)
        slope = -solved(held * profile)
    own = lattice.masses[list(hit)][:, None]
    bonds = profile.T @ (stiffness_of(lattice) @ profile) / own
    return AtRest(profile, slope, bonds, profile.T @ (held * profile) / own)
