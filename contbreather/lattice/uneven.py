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
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from contbreather.errors import BadInput
from contbreather.lattice.finite import PACE, Finite, stiffness_of
from contbreather.one_thread import one_thread

FloatArray = NDArray[np.float64]
Array = NDArray[Any]

PLACES = np.exp(1j * math.pi * (np.arange(8) + 0.5) / 8.0)  # with their conjugates all 16


class SiteWaves(NamedTuple):
    """Sums of ``Re left_jn right_jp exp(l_j t)``, site n after an impulse at p, and a constant."""

    rates: Array
    left: Array
    right: Array
    level: FloatArray


class SiteModes(NamedTuple):
    """Modes of a medium: values at sites, and shares in what follows a unit impulse at each."""

    rates: Array
    values: Array
    kicks: Array


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

    def slope(self, name: str) -> tuple[FloatArray, FloatArray]:
        """Derivatives of K and of C's diagonal in a parameter or along the pace; without one in a
        spring that is the same everywhere."""
        lattice, size = self.lattice, self.lattice.sites
        if name == PACE:
            return 2.0 * self.pull, self.loss
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
        least, most = np.linalg.svd(matrices, compute_uv=False)[:, [-1, 0]].T
        if (high := most > 1e12 * least).any():
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

    @one_thread
    def room(self, first: float, step: float, by: str = "") -> float:
        """Change of a parameter up to which all modes certainly are off all harmonics."""
        dK, dC = self.slope(by)
        pull, loss = _strength(dK), abs(dC).max()
        # no mode is faster than the root of K's norm
        last = 2.0 * step + math.sqrt(_strength(self.pull))
        w = np.arange(first, last + step, step)
        least = np.linalg.svd(self.dynamic(w), compute_uv=False)[:, -1]
        return float((least / (pull + w * loss)).min())

    @one_thread
    def modes(self, radius: float, by: str) -> SiteModes:
        """Modes with a parameter at places of a circle, without their conjugates, weighted so that
        sums over all are means, or slopes."""
        moved = radius * PLACES[:, None]
        dK, dC = self.slope(by)
        generators = self.generator(
            self.pull + moved[..., None] * dK, np.broadcast_to(self.loss, dC.shape) + moved * dC
        )
        rates, vectors = np.linalg.eig(generators)
        n = self.lattice.sites
        kicks = np.linalg.inv(vectors)[..., n:]  # impulses are velocities
        values = vectors[:, :n, :].swapaxes(1, 2) / (len(moved) * (moved[..., None] if by else 1.0))
        return SiteModes(rates.ravel(), values.reshape(-1, n), kicks.reshape(-1, n))


@lru_cache(maxsize=16)
def _bonds_per_mass(lattice: Finite) -> FloatArray:
    return np.asarray(stiffness_of(lattice).toarray() / lattice.masses[:, None])


def _strength(matrix: FloatArray) -> float:
    """Bound of a matrix's norm."""
    sizes = abs(matrix)
    return math.sqrt(float(sizes.sum(axis=0).max() * sizes.sum(axis=1).max()))


# kept: along a branch in omega, or in what does not concern it, a medium stays as it is
medium_of = lru_cache(maxsize=64)(Medium)


@lru_cache(maxsize=64)
def modes_of(medium: Medium, radius: float, by: str) -> SiteModes:
    """Return `Medium.modes`, kept."""
    return medium.modes(radius, by)


def waves_of(modes: SiteModes, length: float, sign: int, pace: bool = False) -> SiteWaves:
    """Answers of modes to impulses that recur after a section; or what a longer one changes in
    them, in proportion: their slope along the pace but for that of the unit of time."""
    turns = modes.rates * length
    # of all laps before: 1/(1 - sign exp(turns))
    laps = 1.0 / (1.0 + np.exp(turns) if sign < 0 else -np.expm1(turns))
    level = np.zeros((modes.values.shape[1],) * 2)
    if sign > 0:  # the mean belongs to the offsets
        level = ((modes.values / turns[:, None]).T @ modes.kicks).real
    if pace:
        laps, level = sign * turns * np.exp(turns) * laps * laps, -level
    return SiteWaves(modes.rates, modes.values * laps[:, None], modes.kicks, level)
