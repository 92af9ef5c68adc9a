"""Finite lattices whose springs or dampings differ from site to site, where no mode decouples.

With ``K = gamma L/m + spring s`` and ``C = damping d``, s and d the proportions of the sites,
``u'' + C u' + K u = drive`` is of first order in (u, u'), and the eigenvectors of that generator,
complex in pairs, are what normal modes are elsewhere. They depend on every parameter, and some are
defective. So answers are means over a circle around a parameter, and slopes in it, too: analytic
wherever no harmonic of the orbit meets a mode, whatever the modes do among themselves.

At another frequency of the drive the medium is the same, and runs at another pace: answers are made
of modes in the medium's own time, which are found once, and so is their slope along that pace.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contbreather.errors import BadInput
from contbreather.lattice.finite import Finite, stiffness_of
from contbreather.lattice.modal_waves import RADIUS
from contbreather.one_thread import one_thread

FloatArray = NDArray[np.float64]
Array = NDArray[Any]

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
