"""D(mu): what the impact makes of the free multipliers."""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest

from contbreather.lattice import InfiniteChain, Ring
from contbreather.stability import saltation
from contbreather.stability.one_impact import half_map
from tests.stability.by_hand import b_of, det_by_modes, exact_G, paper_matrix, slope
from tests.stability.half import D

GAMMAS = (0.0, 1e-6, 0.05, 0.2499)
LATTICES = (InfiniteChain(), Ring(1), Ring(2), Ring(7), Ring(40))
OFF_BAND = (0.9 - 0.05j, 1 - 0.9j, -0.99j, 0.1 - 1.9j)


def by_G(G: np.ndarray, k: float, b: float) -> complex:
    return complex(np.linalg.det(np.eye(2) + (saltation(k, b) - np.eye(2)) @ G))


@pytest.mark.parametrize("gamma", GAMMAS)
@pytest.mark.parametrize("lattice", LATTICES, ids=str)
def test_D_is_the_determinant_of_the_mean_over_modes_to_thirty_digits(gamma, lattice):
    sites = lattice.sites if isinstance(lattice, Ring) else None
    for nu in OFF_BAND:
        if sites is None and gamma > 0.1 and nu == 0.9 - 0.05j:
            continue  # the reference's trapezoid rule converges too slowly next to the band
        G = exact_G(gamma, nu, sites)
        size = 1 + np.abs(G).max() ** 2
        for k, b in ((0.8, 0.3), (0.0, -2.0), (1.0, 5.0)):
            assert abs(D(gamma, nu, k, b, lattice) - by_G(G, k, b)) < 3e-14 * size * (1 + abs(b))


def shifted_path(gamma: float, nu: float, h: float) -> np.ndarray:
    """G on the arc by theory section 3: theta -> x + i h sin x keeps clear of the band."""
    x = 2 * np.pi * (np.arange(4000) + 0.5) / 4000
    theta = x + 1j * h * np.sin(x)
    weight = (1 + 1j * h * np.cos(x)) / x.size
    w = 2 * math.sqrt(gamma) * np.sin(theta / 2)
    mu = cmath.exp(1j * math.pi * nu)
    det = 1 - 2 * mu * np.cos(np.pi * w) + mu**2
    g11 = np.sum(weight * (1 - mu * np.cos(np.pi * w)) / det)
    g12 = np.sum(weight * -mu * np.sin(np.pi * w) / w / det)
    g21 = np.sum(weight * mu * w * np.sin(np.pi * w) / det)
    return np.array([[g11, g12], [g21, g11]])


@pytest.mark.parametrize("gamma", [0.02, 0.0969710, 0.2, 0.24])
@pytest.mark.parametrize("part", [0.2, 0.5, 0.9])
def test_on_the_band_D_is_the_limit_from_outside(gamma, part):
    nu = 2 * math.sqrt(gamma) * part
    at = D(gamma, nu, 0.8, 0.3)
    assert at == pytest.approx(by_G(shifted_path(gamma, nu, 0.3), 0.8, 0.3), abs=2e-12)
    assert at == pytest.approx(D(gamma, nu - 1e-9j, 0.8, 0.3), abs=1e-6)


@pytest.mark.parametrize("lattice", LATTICES[1:], ids=str)
@pytest.mark.parametrize("at", [(0.1, 0.4 - 0.1j, 0.8, 0.3), (0.22, 0.85 - 0.02j, 0.3, -1.4)])
def test_the_gradient_of_D_is_that_of_finite_differences(at, lattice):
    gamma, nu, k, b = at
    radius = math.exp(-math.pi * nu.imag)
    exact = half_map(gamma, k, b, lattice).gradient(nu.real, radius)
    assert exact.value == pytest.approx(det_by_modes(*at, lattice.sites), abs=1e-13)
    for name, along in zip(("d_gamma", "d_nu", "d_k", "d_b"), np.eye(4), strict=True):
        wanted = slope(lambda e, y=along: det_by_modes(*shifted(at, e * y), lattice.sites), 2e-4)
        assert getattr(exact, name) == pytest.approx(wanted, rel=1e-7, abs=1e-9), name


def shifted(at, by):
    """gamma, nu, k and b, of which nu alone is complex."""
    return [x + float(y) for x, y in zip(at, by, strict=True)]


@pytest.mark.parametrize("sites", [40, 200])
@pytest.mark.parametrize(("a", "gamma"), [(0.2, 0.11), (0.8, 0.045), (0.5, 0.08)])
def test_every_even_eigenvalue_of_the_dense_matrix_is_a_zero_of_D(sites, a, gamma):
    b = b_of(a, gamma, 0.8)
    half = paper_matrix(sites, gamma, 0.8, b)
    mirror = np.concatenate([(-np.arange(sites)) % sites, sites + (-np.arange(sites)) % sites])
    even = half + half[:, mirror]  # twice QS on even states, zero on odd ones
    mu = np.linalg.eigvals(even / 2)
    mu = mu[np.abs(mu) > 1e-6]
    assert mu.size == sites + 2
    map = half_map(gamma, 0.8, b, Ring(sites))
    for one in mu:
        at = map.gradient(float(np.angle(one)) / math.pi, float(abs(one)))
        assert abs(at.value / at.d_nu) < 2e-13  # the distance to the zero, in nu
