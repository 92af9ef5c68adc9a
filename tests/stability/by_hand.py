"""Second roads for the stability tests: the paper's dense matrices, 30-digit means, eq. (13)."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import mpmath as mp
import numpy as np
from scipy.linalg import expm
from scipy.optimize import linear_sum_assignment

from contbreather.lattice import InfiniteChain, Ring
from contbreather.stability.modal_map import ModalMap, section_map
from contbreather.stability.saltation import Saltation


def ring_map(
    ring: Ring, gamma: float, k: float, kicks: tuple[Saltation, ...], period: float = 2.0 * math.pi
) -> ModalMap:
    """The map of a ring without losses over a whole period."""
    return section_map(ring, (gamma, 0.0, 0.0), k, kicks, period)


def b_of(a: float, gamma: float, k: float) -> float:
    """b of the harmonic breather by the closed form (13) and theory section 1."""
    chain = InfiniteChain()
    chi, eta, q = chain.chi(gamma), chain.eta(gamma), (1 - k) / (1 + k)
    p = (chi + math.sqrt((chi * a) ** 2 - q * q * (1 - a * a))) / (chi**2 + q * q)
    return (1 + k) ** 2 * (p * (chi - eta) - 1) / (2 * p)


def pitchfork_b(gamma: float, k: float) -> float:
    return (1 + k) ** 2 * InfiniteChain().psi(gamma) / 2


def fold_b(gamma: float, k: float) -> float:
    """Where D(-1) = 0."""
    chain = InfiniteChain()
    return -((1 - k) ** 2) / (2 * chain.chi(gamma)) - (1 + k) ** 2 * chain.eta(gamma) / 2


def flight(sites: int, gamma: float, time: float) -> np.ndarray:
    """Between impacts, on all sites of a ring."""
    beside = np.roll(np.eye(sites), 1, axis=0) + np.roll(np.eye(sites), -1, axis=0)
    A = np.zeros((2 * sites, 2 * sites))
    A[:sites, sites:], A[sites:, :sites] = np.eye(sites), gamma * (beside - 2 * np.eye(sites))
    return expm(time * A)


def impact(sites: int, site: int, k: float, b: float) -> np.ndarray:
    S = np.eye(2 * sites)
    S[site, site] = S[sites + site, sites + site] = -k
    S[sites + site, site] = b
    return S


def paper_matrix(sites: int, gamma: float, k: float, b: float) -> np.ndarray:
    """QS as the paper computes it, by expm."""
    return flight(sites, gamma, np.pi) @ impact(sites, 0, k, b)


def even_half_map(sites: int, spring: float, gamma: float, k: float, b: float) -> np.ndarray:
    """QS of a ring in the modes that the impact sees."""
    _, weight, w = Ring(sites).nodes(gamma)
    w = np.sqrt(w * w + spring)
    size, share = w.size, np.sqrt(weight)
    cosine, pull = np.diag(np.cos(np.pi * w)), np.diag(-w * np.sin(np.pi * w))
    Q = np.block([[cosine, np.diag(np.pi * np.sinc(w))], [pull, cosine]])
    E = np.zeros((2 * size, 2))
    E[:size, 0] = E[size:, 1] = share
    return Q @ (np.eye(2 * size) + E @ np.array([[-k - 1, 0], [b, -k - 1]]) @ E.T)


def exact_G(gamma: float, nu: complex, sites: int | None) -> np.ndarray:
    """G in its matrix form, averaged over modes with 30 digits."""
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
            sites = 2000 if abs(mp.im(nu)) < 0.1 and abs(mp.re(nu)) < 1 else 200
        total = [mp.mpf(0)] * 3
        for j in range(sites // 2 + 1):
            weight = 1 if j == 0 or 2 * j == sites else 2
            total = [
                x + weight * y for x, y in zip(total, entries(2 * mp.pi * j / sites), strict=True)
            ]
        g11, g12, g21 = (complex(x / sites) for x in total)
        return np.array([[g11, g12], [g21, g11]])


def apart(x: np.ndarray, y: np.ndarray) -> float:
    """Largest distance between two sets of multipliers matched one to one, relative above 1."""
    assert x.shape == y.shape
    cost = np.abs(np.asarray(x)[:, None] - np.asarray(y)) / np.maximum(1.0, np.abs(y))
    rows, columns = linear_sum_assignment(cost)
    return float(cost[rows, columns].max(initial=0.0))


def slope(of: Callable[[float], Any], h: float) -> Any:
    """The derivative at 0 by differences of sixth order."""
    up = [of(m * h) - of(-m * h) for m in (1, 2, 3)]
    return (45 * up[0] - 9 * up[1] + up[2]) / (60 * h)


def det_by_modes(gamma: float, nu: Any, k: float, b: float, sites: int) -> Any:
    """D at ``mu = exp(i pi nu)`` of a ring, by its definition as a mean over the modes."""
    theta = 2 * np.pi * np.arange(sites) / sites
    w = 2 * math.sqrt(gamma) * np.sin(theta / 2)
    mu = np.exp(1j * np.pi * np.asarray(nu, dtype=complex))[..., None]
    q = 1.0 / (1 - 2 * mu * np.cos(np.pi * w) + mu**2)
    g11 = ((1 - mu * np.cos(np.pi * w)) * q).mean(axis=-1)
    g12 = (-mu * np.pi * np.sinc(w) * q).mean(axis=-1)
    g21 = (mu * w * np.sin(np.pi * w) * q).mean(axis=-1)
    c = 1 + k
    return (1 - c * g11) ** 2 + g12 * (b - c * c * g21)
