"""The baseline: stability as the paper computes it, with dense matrices, written from its text.

Nothing here comes from contbreather, so that both its speed and its numbers are a second road.
Ring of N sites, state (u, u'): A = [[0, 1], [gamma L, 0]], Q = expm(pi A), S the saltation (19)
at site 0, multipliers = eigenvalues of (Q S)^2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Breather:
    """The exact symmetric breather (13) on a ring of N sites under F = -a cos t."""

    sites: int
    a: float
    gamma: float
    k: float

    def means(self) -> tuple[float, float]:
        """chi = <tan(pi w/2)/w> and eta = <w tan(pi w/2)>, summed over the modes of the ring."""
        w = 2 * np.sqrt(self.gamma) * np.abs(np.sin(np.pi * np.arange(self.sites) / self.sites))
        tangent = np.tan(np.pi * w / 2)
        chi = np.full(self.sites, np.pi / 2)
        np.divide(tangent, w, out=chi, where=w > 0)
        return float(chi.mean()), float((w * tangent).mean())

    def p(self) -> float:
        """The root of (11) with the larger p: (1 - p chi)^2 + (p q)^2 = a^2."""
        chi, _ = self.means()
        q = (1 - self.k) / (1 + self.k)
        square = chi**2 + q**2
        return float((chi + np.sqrt(chi**2 - square * (1 - self.a**2))) / square)

    def half_map(self) -> Array:
        """Q S, 2N x 2N, half a period from just before one impact to just before the next."""
        n = self.sites
        ring = np.roll(np.eye(n), 1, axis=0) + np.roll(np.eye(n), -1, axis=0) - 2 * np.eye(n)
        generator = np.zeros((2 * n, 2 * n))
        generator[:n, n:] = np.eye(n)
        generator[n:, :n] = self.gamma * ring
        chi, eta = self.means()
        p = self.p()
        saltation = np.eye(2 * n)
        saltation[0, 0] = saltation[n, n] = -self.k
        saltation[n, 0] = (1 + self.k) ** 2 * (p * (chi - eta) - 1) / (2 * p)
        return linalg.expm(np.pi * generator) @ saltation

    def multipliers(self) -> NDArray[np.complex128]:
        half = self.half_map()
        return linalg.eigvals(half @ half)


def furthest(ours: NDArray[np.complex128], reference: NDArray[np.complex128]) -> float:
    """Largest distance of an eigenvalue of `reference` from the nearest of `ours`."""
    return float(np.abs(reference[:, None] - ours[None, :]).min(axis=1).max())
