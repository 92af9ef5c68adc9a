"""Finite lattices whose springs or dampings differ from site to site, where no mode decouples.

With ``K = gamma L/m + spring s`` and ``C = damping d``, s and d the proportions of the sites,
``u'' + C u' + K u = drive`` is of first order in (u, u'), and the eigenvectors of that generator,
complex in pairs, are what normal modes are elsewhere. They depend on every parameter, and some are
defective. So answers are means over a circle around a parameter, and slopes in it, too: analytic
wherever no harmonic of the orbit meets a mode, whatever the modes do among themselves.

At another frequency of the drive the medium is the same, and runs at another pace: answers are made
of modes in the medium's own time, which are found once, and so is their slope along that pace.
Responses are sums over the modes of a medium in its own time, by sites in place of modes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from contbreather.errors import BadInput
from contbreather.lattice.finite import PACE, Basis, Finite, NormalModes, stiffness_of
from contbreather.lattice.forcing import EPS, Forcing
from contbreather.lattice.modal_flow import DrivenSpectrum, driven_spectrum, forces_of
from contbreather.lattice.modal_waves import RADIUS
from contbreather.lattice.periodic_green import Responses
from contbreather.lattice.response import (
    HELD,
    RESONANT,
    ModalResponse,
    Response,
    Sites,
    as_table,
    harmonics,
)
from contbreather.one_thread import one_thread

FloatArray = NDArray[np.float64]
Array = NDArray[Any]

PRECISION = np.finfo(float).precision
PLACES = np.exp(1j * math.pi * (np.arange(8) + 0.5) / 8.0)  # with their conjugates all 16


@dataclass(frozen=True, eq=False)
class SiteModes:
    """Modes of a medium in its own time: rates, values at sites, and shares in what follows a unit
    impulse at each site, or the drive; answers are the real parts of sums over them."""

    rates: Array
    values: Array
    kicks: Array
    push: Array

    @cached_property
    def orders(self) -> Array:
        """Powers of the rates, those of derivatives up to the third, in rows."""
        return np.asarray(self.rates ** np.arange(4)[:, None])

    @cached_property
    def level(self) -> FloatArray:
        """Minus the mean of what follows an impulse, times the length of a section, of each site
        after one at each: that mean belongs to the offsets."""
        return np.asarray(((self.values / self.rates[:, None]).T @ self.kicks).real)

    def recurring(self, length: float, sign: int) -> tuple[Array, Array]:
        """Sums of all laps, and what each grows by with a longer section, in proportion."""
        turns = self.rates * length
        laps = 1.0 / (1.0 + np.exp(turns) if sign < 0 else -np.expm1(turns))
        return laps, sign * turns * np.exp(turns) * laps

    def driven(self, w: FloatArray) -> Array:
        """Complex amplitudes at sites of the answer to the drive at frequencies w, a column for
        each, and their slopes along the pace, times its square."""
        s = np.multiply.outer((1j, -1j), w).reshape(-1, 1)
        gaps = 1.0 / (s - self.rates)
        shares = self.push * gaps
        both = np.concatenate([shares, shares * (s * gaps - 2.0)]) @ self.values
        there, conjugate = both.reshape(2, 2, *w.shape, both.shape[1]).swapaxes(0, 1)
        return np.asarray(0.5 * (there + conjugate.conj()).swapaxes(1, 2))


@dataclass(frozen=True)
class Medium:
    """A lattice with all that acts on its sites between impacts but the drive."""

    lattice: Finite
    gamma: float
    spring: float
    damping: float

    @cached_property
    def pull(self) -> FloatArray:
        """K, the stiffness per mass."""
        return self.gamma * self.slope("gamma")[0] + self.spring * self.slope("spring")[0]

    @cached_property
    def loss(self) -> FloatArray:
        """The diagonal of C."""
        return np.asarray(self.damping * self.lattice.dampings)

    @cached_property
    def _fastest(self) -> float:
        return math.sqrt(_norm(self.pull))

    @cached_property
    def _brake(self) -> float:
        return float(abs(self.loss).max())

    def slope(self, name: str) -> tuple[FloatArray, FloatArray]:
        """Derivatives of K and of C's diagonal in a parameter; without one in a spring that is the
        same everywhere."""
        lattice, size = self.lattice, self.lattice.sites
        if name == "gamma":
            return _bonds_per_mass(lattice), np.zeros(size)
        if name == "damping":
            return np.zeros((size, size)), lattice.dampings
        return np.diag(lattice.springs if name else np.ones(size)), np.zeros(size)

    def dynamic(self, w: FloatArray) -> Array:
        """``K - w^2 + i w C``, what forces of these frequencies act against."""
        w = w[:, None, None]
        return self.pull + np.eye(self.lattice.sites) * (1j * w * self.loss - w * w)

    def answers(self, m: FloatArray, forces: Array) -> Array:
        """Motions under forces of these frequencies, a column for each."""
        out = np.zeros_like(forces)
        driven = np.flatnonzero(forces.any(axis=0))
        matrices = self.dynamic(m[driven])
        if (high := np.linalg.cond(matrices) > 1e12).any():
            raise BadInput(
                f"the drive is in resonance: a mode of the {self.lattice.describe()} has the "
                f"frequency {m[driven][high][0]:g} of one of its harmonics; change gamma, spring "
                "or damping."
            )
        out[:, driven] = np.linalg.solve(matrices, forces.T[driven, :, None])[..., 0].T
        return out

    def generator(self, pull: Array, loss: Array) -> Array:
        """Generator of (u, u'), for one K and C or many."""
        n = self.lattice.sites
        out = np.zeros((*pull.shape[:-2], 2 * n, 2 * n), dtype=np.result_type(pull, loss))
        out[..., :n, n:] = np.eye(n)
        out[..., n:, :n] = -pull
        out[..., range(n, 2 * n), range(n, 2 * n)] = -loss
        return out

    @one_thread
    def flight(self, time: float) -> FloatArray:
        """The map of (u, u') over a time."""
        from scipy.linalg import expm  # dear to import, and needed by these alone

        return np.asarray(expm(time * self.generator(self.pull, self.loss)))

    def room(self, first: float, step: float, by: str = "") -> tuple[float, float]:
        """Change of a parameter up to which all modes certainly are off all harmonics, and the
        harmonic that one of them meets first."""
        pull, loss = _strengths(self, by)
        # no mode is faster than the root of K's norm
        last = 2.0 * step + self._fastest
        count = math.ceil((last - first) / step) + 1
        harmonics = [first + i * step for i in range(count)]
        return min((self._least(w) / (pull + w * loss), w) for w in harmonics)

    def _least(self, w: float) -> float:
        """Bound of the singular values of `dynamic`, which move no faster than the matrix does: by
        those at a frequency near by, for many others."""
        near = 2.0 ** (round(16.0 * math.log2(w)) / 16.0)
        there = _least_singular(self, near)
        bound = there - abs(w - near) * (w + near + self._brake)
        return bound if 2.0 * bound > there else _least_singular(self, w)

    @one_thread
    def modes(self, radius: float, by: str) -> SiteModes:
        """Modes with a parameter at places of a circle, without their conjugates, weighted so that
        sums over all are means, or slopes."""
        n, moved = self.lattice.sites, radius * PLACES[:, None]
        dK, dC = self.slope(by)
        # what drifts has the rate 0, of which means over a section are 0/0: so a spring at every
        # site turns with the square of the place, which leaves first orders as they are
        held = RADIUS * radius * PLACES[:, None, None] ** 2 * np.eye(n)
        generators = self.generator(
            self.pull + moved[..., None] * dK + held,
            np.broadcast_to(self.loss, dC.shape) + moved * dC,
        )
        rates, vectors = np.linalg.eig(generators)
        kicks = np.linalg.inv(vectors)[..., n:]  # impulses are velocities
        values = vectors[:, :n, :].swapaxes(1, 2) / (len(moved) * (moved[..., None] if by else 1.0))
        kicks = kicks.reshape(-1, n)
        return SiteModes(rates.ravel(), values.reshape(-1, n), kicks, kicks @ self.lattice.drive)


@lru_cache(maxsize=16)
def _bonds_per_mass(lattice: Finite) -> FloatArray:
    return np.asarray(stiffness_of(lattice).toarray() / lattice.masses[:, None])


def _norm(matrix: FloatArray) -> float:
    """Bound of a matrix's norm."""
    sizes = abs(matrix)
    return math.sqrt(float(sizes.sum(axis=0).max() * sizes.sum(axis=1).max()))


@lru_cache(maxsize=256)
@one_thread
def _least_singular(medium: Medium, w: float) -> float:
    return float(np.linalg.svd(medium.dynamic(np.array([w])), compute_uv=False)[0, -1])


@lru_cache(maxsize=64)
def _strengths(medium: Medium, by: str) -> tuple[float, float]:
    dK, dC = medium.slope(by)
    return _norm(dK), float(abs(dC).max())


# kept: along a branch in omega, or in what does not concern it, a medium stays as it is
medium_of, modes_of = lru_cache(maxsize=64)(Medium), lru_cache(maxsize=64)(Medium.modes)


@lru_cache(maxsize=64)
def forced_spectrum(
    lattice: Finite, forcing: Forcing, gamma: float, spring: float, damping: float
) -> DrivenSpectrum:
    """`driven_spectrum` of any finite lattice."""
    if lattice.even:
        return driven_spectrum(lattice, forcing, gamma, spring, damping)
    m, F = forces_of(forcing, "")
    medium = Medium(lattice, gamma, spring, damping)
    return DrivenSpectrum(m, medium.answers(m, np.outer(lattice.drive, F)))


# --- as a response --------------------------------------------------------------------------------

# A velocity in a medium's own time is less by the pace, and so are parameters: powers of it in
# answers to impulses, and in their slopes.
_UNITS = {"": -1, "damping": -2, "gamma": -3, "spring": -3}


_POWERS = np.arange(-1.0, 2.0)[:, None, None]  # of the pace, in each derivative of h(e t)/e


class SiteWaves(NamedTuple):
    """Sums of ``Re left_jn right_jp exp(l_j t)``, site n after an impulse at p, and a constant."""

    rates: Array
    left: Array
    right: Array
    level: FloatArray


@dataclass(frozen=True, eq=False)
class UnevenResponse(ModalResponse):
    """Response of a finite lattice whose springs or dampings differ, of sites in place of modes."""

    at_impacts = Response.at_impacts

    @cached_property
    def own(self) -> tuple[Medium, float]:
        """The medium in its own time, and how many of its units of time are one of the drive's: the
        same one, but for rounding, at every frequency of the drive."""
        pace = math.sqrt(self.gamma + self.spring) or 1.0
        held = self.gamma / pace**2, self.spring / pace**2, self.damping / pace
        own = (float(f"{value:.{PRECISION}g}") for value in held)
        return medium_of(self.lattice, *own), pace

    def interactions(self, times: FloatArray, by: str = "") -> FloatArray:
        return _site_place(self, times.tobytes(), by if by != PACE else "")[by == PACE]

    def slopes_at_impacts(
        self, times: FloatArray, rates: Mapping[str, float]
    ) -> tuple[FloatArray, FloatArray]:
        state = 2.0 * self.gamma, 2.0 * self.spring, self.damping
        ways = [(rates.get(name, 0.0), value) for name, value in zip(HELD, state, strict=True)]
        square = sum(value * value for value in state)
        pace = sum(rate * value for rate, value in ways) / (square or 1.0)
        # but for rounding along the pace: no modes of other media are asked for
        along = all(abs(rate - pace * value) <= 4.0 * EPS * abs(rate) for rate, value in ways)
        if along and rates.keys().isdisjoint(self.drive.params):
            rates = {PACE: pace}
        return Response.slopes_at_impacts(self, times, rates)

    def _spectrum(self, by: str) -> DrivenSpectrum:
        return _site_spectra(self, by if by != PACE else "")[by == PACE]

    @cached_property
    def basis(self) -> Basis:
        size = self.lattice.sites
        return NormalModes(np.zeros(size), np.empty(0), np.eye(size))

    def table(self, sites: Sites, by: str = "") -> Responses:
        return _site_table(self, sites, by)

    def modes(self, times: FloatArray, impulses: FloatArray, at: FloatArray) -> FloatArray:
        """Displacement, velocity and acceleration of all sites, see `ModalResponse.modes`."""
        waves, hits = _site_waves(self, ""), list(self.hits)
        laps, past = self.since(at[:, None] - times)
        J = np.where(laps % 2 != 0, float(self.sign), 1.0) * impulses
        turned = np.exp(np.multiply.outer(past, waves.rates))
        moved = (turned * J[..., None] * waves.right.T[hits]).sum(axis=1)
        orders = [((moved * waves.rates**order) @ waves.left).real for order in range(3)]
        return np.array([orders[0] + J @ waves.level[:, hits].T, *orders[1:]])


@lru_cache(maxsize=64)
def _site_spectra(of: UnevenResponse, by: str) -> list[DrivenSpectrum]:
    """Answers to the drive, or to what a parameter changes, and their slopes along the pace."""
    own, pace = by in of.drive.params, of.own[1]
    m, F = forces_of(of.drive, by if own else "")
    modes = _modes(of, "" if own else by)
    unit = pace ** (_UNITS["" if own else by] - 1)
    return [DrivenSpectrum(m, A) for A in unit * F * modes.driven(m / pace)]


@lru_cache(maxsize=64)
def _site_table(of: UnevenResponse, sites: Sites, by: str) -> Responses:
    waves, each, hit = _site_waves(of, by), list(sites), list(of.hit)
    level = waves.level[each][:, hit].ravel()
    grown = (waves.left.T[each][:, None] * waves.right.T[hit]).reshape(level.size, -1)
    return as_table(of, sites, level, waves.rates, grown)


@lru_cache(maxsize=16)
def _site_place(of: UnevenResponse, times: bytes, by: str) -> tuple[FloatArray, FloatArray]:
    """Answers at impacts, or what a parameter changes, and their slopes along the pace, of
    ``h(e t)/e`` at e = 1."""
    at, modes, hits, pace = np.frombuffer(times), _modes(of, by), list(of.hits), of.own[1]
    laps, age = of.since(at[:, None] - at)
    recurring, longer = modes.recurring(pace * of.length, of.sign)
    moved = recurring[:, None, None] * np.exp(np.multiply.outer(modes.rates, pace * age))
    moved *= modes.values[:, hits, None] * modes.kicks[:, None, hits]
    units = pace ** (_UNITS[by] + np.arange(4.0)[:, None, None]) * np.where(laps % 2, of.sign, 1.0)
    rows = np.stack([modes.orders, modes.orders * longer]) @ moved.reshape(longer.size, -1)
    h, grown = units * rows.real.reshape(2, 4, *age.shape)
    if of.sign > 0:
        level = pace ** (_UNITS[by] - 1) / of.length * modes.level[hits][:, hits]
        h[0], grown[0] = h[0] + level, grown[0] - level
    grown[:3] += _POWERS * h[:3] + age * h[1:]
    return of.at_itself(h, by), of.at_itself(grown, PACE)


@lru_cache(maxsize=64)
def _site_waves(of: UnevenResponse, by: str) -> SiteWaves:
    modes, pace = _modes(of, by), of.own[1]
    length, unit = pace * of.length, pace ** _UNITS[by]
    left = unit * modes.values * modes.recurring(length, of.sign)[0][:, None]
    level = unit * modes.level / length if of.sign > 0 else np.zeros((of.lattice.sites,) * 2)
    return SiteWaves(pace * modes.rates, left, modes.kicks, level)


@lru_cache(maxsize=64)
def _modes(of: UnevenResponse, by: str) -> SiteModes:
    medium, pace = of.own
    first, step = harmonics(of.turns, of.sign)
    room, nearest = medium.room(first / pace, step / pace, by)
    if not room * pace * pace > RESONANT:
        raise of.resonance(nearest * pace)
    return modes_of(medium, 2.0 ** math.floor(math.log2(RADIUS * room)), by)
