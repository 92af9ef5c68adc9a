"""D(mu): what the impact makes of the free multipliers."""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest

from contbreather.lattice import InfiniteChain, Ring
from contbreather.stability import D, D_gradient, D_slope, G, dense_half_map, saltation
from contbreather.stability.characteristic import regular
from tests.stability.by_hand import b_of, exact_G, slope

GAMMAS = (0.0, 1e-6, 0.05, 0.2499)
LATTICES = (InfiniteChain(), Ring(1), Ring(2), Ring(7), Ring(40))
OFF_BAND = (0.9 - 0.05j, 1 - 0.9j, -0.99j, 0.3 + 0.2j, 0.1 - 7j)


@pytest.mark.parametrize("gamma", GAMMAS)
@pytest.mark.parametrize("lattice", LATTICES, ids=str)
def test_lattice_sums_agree_with_the_mean_over_modes_to_thirty_digits(gamma, lattice):
    sites = lattice.sites if isinstance(lattice, Ring) else None
    for nu in OFF_BAND:
        if sites is None and gamma > 0.1 and nu == 0.9 - 0.05j:
            continue  # the reference's trapezoid rule converges too slowly next to the band
        exact = exact_G(gamma, nu, sites)
        error = np.abs(G(gamma, nu, lattice) - exact).max() / np.abs(exact).max()
        assert error < 1e-14, (nu, error)


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
def test_on_the_band_G_is_the_limit_from_outside(gamma, part):
    nu = 2 * math.sqrt(gamma) * part
    np.testing.assert_allclose(G(gamma, nu), shifted_path(gamma, nu, 0.3), rtol=0, atol=2e-13)
    beside = G(gamma, nu - 1e-9j)
    np.testing.assert_allclose(G(gamma, nu), beside, rtol=0, atol=1e-6)


@pytest.mark.parametrize("gamma", [0.0, 1e-9, 0.05, 0.12, 0.2499])
@pytest.mark.parametrize("lattice", LATTICES, ids=str)
def test_at_the_ends_of_the_circle_G_is_made_of_the_means_of_the_breather(gamma, lattice):
    at_minus_one = G(gamma, 1.0, lattice)
    assert 2 * at_minus_one[0, 1].real == pytest.approx(lattice.chi(gamma), rel=1e-14)
    assert -2 * at_minus_one[1, 0].real == pytest.approx(lattice.eta(gamma), rel=1e-13, abs=1e-15)
    assert at_minus_one[0, 0] == pytest.approx(0.5, abs=1e-13)
    sites = lattice.sites if isinstance(lattice, Ring) else None
    pole_left_out = regular(gamma, np.zeros(1), sites).C[0]
    assert 2 * pole_left_out == pytest.approx(lattice.psi(gamma), rel=1e-14)
    if sites is None and gamma > 1e-3:  # a ring's mode w = 0 takes 2/(pi N) off at mu = 1
        assert 2 * G(gamma, -1e-9j)[1, 0].real == pytest.approx(lattice.psi(gamma), abs=1e-7)


@pytest.mark.parametrize("lattice", LATTICES, ids=str)
def test_D_is_the_determinant_it_was_simplified_from(lattice):
    rng = np.random.default_rng(2)
    for _ in range(50):
        gamma, k, b = rng.uniform(0, 0.25), rng.uniform(), rng.normal() * 2
        nu = rng.uniform(-1, 1) + 1j * rng.choice([-1, 1]) * rng.uniform(0.02, 2.0)
        plain = np.linalg.det(np.eye(2) + (saltation(k, b) - np.eye(2)) @ G(gamma, nu, lattice))
        size = 1 + np.abs(G(gamma, nu, lattice)).max() ** 2 * (1 + abs(b))
        assert abs(D(gamma, nu, k, b, lattice) - plain) < 1e-13 * size


@pytest.mark.parametrize("lattice", LATTICES, ids=str)
def test_the_slope_of_D_is_that_of_its_power_series(lattice):
    turn = np.exp(2j * np.pi * np.arange(64) / 64)
    for nu in (0.3 - 0.4j, 0.8 - 0.2j, 1.0 - 0.9j, 0.5 - 1.5j, 0.95 + 0.1j, 2.0 + 0.7j):
        radius = 0.05
        around = D(0.1, nu + radius * turn, 0.7, 0.3, lattice)
        cauchy = np.mean(around / turn) / radius  # D' by Cauchy's formula
        value, slope = D_slope(0.1, nu, 0.7, 0.3, lattice)
        assert abs(value - np.mean(around)) < 1e-12
        assert abs(slope - cauchy) < 1e-11


@pytest.mark.parametrize("lattice", LATTICES, ids=str)
@pytest.mark.parametrize("at", [(0.1, 0.4 - 0.1j, 0.8, 0.3), (0.22, 0.85 - 0.02j, 0.3, -1.4)])
def test_the_gradient_of_D_is_that_of_finite_differences(at, lattice):
    exact = D_gradient(*at, lattice)
    assert abs(exact.value - D(*at, lattice)) < 1e-13
    for name, along in zip(("d_gamma", "d_nu", "d_k", "d_b"), np.eye(4), strict=True):
        wanted = slope(lambda e, along=along: D(*shifted(at, e * along), lattice), 2e-4)
        assert getattr(exact, name) == pytest.approx(wanted, rel=1e-7, abs=1e-9), name


def shifted(at, by):
    """gamma, nu, k and b, of which nu alone is complex."""
    return [x + float(y) for x, y in zip(at, by, strict=True)]


def test_D_is_real_on_the_real_axis_conjugate_across_it_and_one_far_away():
    nu = np.array([0.2 - 0.3j, 0.7 - 0.1j, 0.9 - 0.02j])
    D_here = D(0.1, nu, 0.8, -0.3)
    np.testing.assert_allclose(D(0.1, -nu.conj(), 0.8, -0.3), D_here.conj(), rtol=1e-13)
    np.testing.assert_allclose(D(0.1, nu + 4, 0.8, -0.3), D_here, rtol=1e-11)
    assert np.abs(D(0.1, np.array([-0.3j, 1 - 0.3j]), 0.8, -0.3).imag).max() < 1e-14
    assert abs(D(0.1, 0.4 - 12j, 0.8, -0.3) - 1) < 1e-14


@pytest.mark.parametrize("sites", [40, 200])
@pytest.mark.parametrize(("a", "gamma"), [(0.2, 0.11), (0.8, 0.045), (0.5, 0.08)])
def test_every_even_eigenvalue_of_the_dense_matrix_is_a_zero_of_D(sites, a, gamma):
    b = b_of(a, gamma, 0.8)
    half = dense_half_map(sites, gamma, 0.8, b)
    mirror = np.concatenate([(-np.arange(sites)) % sites, sites + (-np.arange(sites)) % sites])
    even = half + half[:, mirror]  # twice QS on even states, zero on odd ones
    mu = np.linalg.eigvals(even / 2)
    mu = mu[np.abs(mu) > 1e-6]
    assert mu.size == sites + 2
    value, slope = D_slope(gamma, np.log(mu) / (1j * np.pi), 0.8, b, Ring(sites))
    assert np.abs(value / slope).max() < 2e-13  # the distance to the zero, in nu
