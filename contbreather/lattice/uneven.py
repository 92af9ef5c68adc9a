"""Finite lattices whose springs or dampings differ from site to site, where no mode decouples.

With ``K = gamma L/m + spring s`` and ``C = damping d``, s and d the proportions of the sites,
``u'' + C u' + K u = drive`` is of first order in (u, u'), and the eigenvectors of that generator,
complex in pairs, are what normal modes are elsewhere. They depend on every parameter, and some are
defective. So answers are means over a circle around a parameter, and slopes in it, too: analytic
wherever no harmonic of the orbit meets a mode, whatever the modes do among themselves.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from contbreather.errors import BadInput
from contbreather.lattice.finite import Finite, stiffness_of
from contbreather.one_thread import one_thread

FloatArray = NDArray[np.float64]
Array = NDArray[Any]


class SiteWaves(NamedTuple):
    """Sums of ``Re left_jn right_jp exp(l_j t)``, site n after an impulse at p, and a constant."""

    rates: Array
    left: Array
    right: Array
    level: FloatArray


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
        """Derivatives of K and of C's diagonal in a parameter; without one in a spring that is the
        same everywhere."""
        lattice, size = self.lattice, self.lattice.sites
        if name == "gamma":
            bonds = stiffness_of(lattice).toarray() / lattice.masses[:, None]
            return np.asarray(bonds), np.zeros(size)
        if name == "damping":
            return np.zeros((size, size)), lattice.dampings
        return np.diag(lattice.springs if name else np.ones(size)), np.zeros(size)

    def dynamic(self, w: float) -> Array:
        """``K - w^2 + i w C``, what forces of that frequency act against."""
        return self.pull + np.diag(1j * w * self.loss - w * w)

    def answers(self, m: FloatArray, forces: Array) -> Array:
        """Motions under forces of these frequencies, a column for each."""
        out = np.zeros_like(forces)
        for i in np.flatnonzero(forces.any(axis=0)).tolist():
            if np.linalg.cond(matrix := self.dynamic(m[i])) > 1e12:
                raise BadInput(
                    f"the drive is in resonance: a mode of the {self.lattice.describe()} has the "
                    f"frequency {m[i]:g} of one of its harmonics; change gamma, spring or damping."
                )
            out[:, i] = np.linalg.solve(matrix, forces[:, i])
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
        pull, loss = np.linalg.norm(dK, 2), np.linalg.norm(dC, math.inf)
        # no mode is faster than the root of K's norm
        last = 2.0 * step + math.sqrt(float(np.linalg.norm(self.pull, 2)))
        w = np.arange(first, last + step, step)
        least = [np.linalg.svd(self.dynamic(x), compute_uv=False)[-1] for x in w.tolist()]
        return float((np.array(least) / (pull + w * loss)).min())

    @one_thread
    def waves(self, length: float, sign: int, radius: float, places: Array, by: str) -> SiteWaves:
        """Answers to impulses that recur after a section, or their slopes in a parameter: means
        over the places of a circle of that radius, and their conjugates."""
        moved = radius * places[:, None]
        dK, dC = self.slope(by)
        generators = self.generator(
            self.pull + moved[..., None] * dK, np.broadcast_to(self.loss, dC.shape) + moved * dC
        )
        rates, vectors = np.linalg.eig(generators)
        n = self.lattice.sites
        right = np.linalg.inv(vectors)[..., n:]  # impulses are velocities
        recurring = 1.0 + np.exp(rates * length) if sign < 0 else -np.expm1(rates * length)
        weight = (moved ** -(1 if by else 0) / len(places) / recurring)[..., None]
        left = (vectors[:, :n, :].swapaxes(1, 2) * weight).reshape(-1, n)
        right, rates = right.reshape(-1, n), rates.ravel()
        level = np.zeros((n, n))
        if sign > 0:  # the mean belongs to the offsets
            means = recurring.ravel() / (rates * length)
            level = ((left * means[:, None]).T @ right).real
        return SiteWaves(rates, left, right, level)
