"""Second roads for the stability tests: the paper's dense matrices, 30-digit means, eq. (13)."""

from __future__ import annotations

import math
from collections.abc import Callable

import mpmath as mp
import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import linear_sum_assignment

from contbreather.lattice import InfiniteChain


def _b_of(a: float, gamma: float, k: float) -> float:
    chain = InfiniteChain()
    chi, eta, q = chain.chi(gamma), chain.eta(gamma), (1 - k) / (1 + k)
    p = (chi + math.sqrt((chi * a) ** 2 - q * q * (1 - a * a))) / (chi**2 + q * q)
    return (1 + k) ** 2 * (p * (chi - eta) - 1) / (2 * p)


def _paper_matrix(sites: int, gamma: float, k: float, b: float) -> np.ndarray:
    laplacian = np.zeros((sites, sites))
    for n in range(sites):
        laplacian[n, n] -= 2
        laplacian[n, (n + 1) % sites] += 1
        laplacian[n, (n - 1) % sites] += 1
    A = np.zeros((2 * sites, 2 * sites))
    A[:sites, sites:] = np.eye(sites)
    A[sites:, :sites] = gamma * laplacian
    S = np.eye(2 * sites)
    S[0, 0] = S[sites, sites] = -k
    S[sites, 0] = b
    return expm(np.pi * A) @ S


def _exact_G(gamma: float, nu: complex, sites: int | None) -> np.ndarray:
    with mp.workdps(30):
        g = mp.mpf(gamma)
        mu = mp.exp(1j * mp.pi * mp.mpmathify(nu))

        def entries(theta):
            w = 2 * mp.sqrt(g) * mp.sin(theta / 2)
            det = 1 - 2 * mu * mp.cos(mp.pi * w) + mu * mu
            sine_over_w = mp.sin(mp.pi * w) / w if w != 0 else mp.pi
            return (
                (1 - mu * mp.cos(mp.pi * w)) / det,
                -mu * sine_over_w / det,
                mu * w * mp.sin(mp.pi * w) / det,
            )

        if sites is None:  # periodic trapezoid, converging with the distance from the band
            sites = 4000 if abs(mp.im(nu)) < 0.3 and abs(mp.re(nu)) < 1 else 400
        total = [mp.mpf(0)] * 3
        for j in range(sites // 2 + 1):
            weight = 1 if j == 0 or 2 * j == sites else 2
            total = [
                x + weight * y for x, y in zip(total, entries(2 * mp.pi * j / sites), strict=True)
            ]
        g11, g12, g21 = (complex(x / sites) for x in total)
        return np.array([[g11, g12], [g21, g11]])


def _apart(x: np.ndarray, y: np.ndarray) -> float:
    assert x.shape == y.shape
    cost = np.abs(np.asarray(x)[:, None] - np.asarray(y)) / np.maximum(1.0, np.abs(y))
    rows, columns = linear_sum_assignment(cost)
    return float(cost[rows, columns].max())


@pytest.fixture(scope="session")
def b_of() -> Callable[..., float]:
    """b of the harmonic breather by the closed form (13) and theory section 1."""
    return _b_of


@pytest.fixture(scope="session")
def paper_matrix() -> Callable[..., np.ndarray]:
    """QS as the paper computes it, by expm."""
    return _paper_matrix


@pytest.fixture(scope="session")
def exact_G() -> Callable[..., np.ndarray]:
    """G in its matrix form, averaged over modes with 30 digits."""
    return _exact_G


@pytest.fixture(scope="session")
def apart() -> Callable[..., float]:
    """Largest distance between two sets of multipliers matched one to one, relative above 1."""
    return _apart
