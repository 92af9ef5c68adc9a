"""Waves come back amplified or not, and what long rings make of it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from contbreather.lattice import Ring
from contbreather.stability import OverReflection, ns_points
from tests.stability.by_hand import b_of, det_by_modes, even_half_map, pitchfork_b
from tests.stability.half import amplified, half_multipliers, over_reflection, over_reflects


def limit(gamma: float, nu: float, k: float, b: float, side: complex) -> complex:
    """D on the arc from one side, by its modes and Richardson's extrapolation in the distance."""
    h = np.array([4e-3, 6e-3, 8e-3, 12e-3, 16e-3, 24e-3])
    values = det_by_modes(gamma, nu + side * h, k, b, 3000)
    return complex(np.polynomial.polynomial.polyfit(h, values, 5)[0])


@pytest.mark.parametrize(
    ("gamma", "k", "b"), [(0.08, 0.8, 0.468), (0.2, 0.4, -0.7), (0.1, 0.0, 0.1)]
)
def test_S_is_D_from_inside_over_D_from_outside(gamma, k, b):
    for part in (0.3, 0.5, 0.8):
        nu = 2 * math.sqrt(gamma) * part
        expected = abs(limit(gamma, nu, k, b, 1j) / limit(gamma, nu, k, b, -1j))
        assert amplified(gamma, nu, k, b)[0] == pytest.approx(expected, rel=1e-5)


def test_without_dissipation_nothing_is_lost_or_won():
    nu = 2 * math.sqrt(0.1) * np.linspace(0.01, 0.99, 50)
    for b in (-1.0, 0.03, 0.7):
        np.testing.assert_allclose(amplified(0.1, nu, 1.0, b), 1.0, atol=1e-13)
        assert not over_reflection(0.1, 1.0, b).over_reflecting


def test_a_wave_once_round_the_ring_closes_on_itself():
    # exp(i N theta) = S next to the arc: the ring's multipliers by another equation
    gamma, k, sites = 0.08, 0.8, 600
    b = b_of(0.5, gamma, k)
    mu = half_multipliers(Ring(sites), gamma, k, b)
    mu = mu[np.abs(mu) != 1.0]
    nu = np.log(mu[(mu.imag > 0.1) & (np.abs(np.abs(mu) - 1) < 0.01)]) / (1j * np.pi)
    nu = nu[(nu.real < 2 * math.sqrt(gamma) - 0.05) & (nu.imag < -1e-9)]
    theta = 2 * np.arcsin(nu / (2 * math.sqrt(gamma)))
    assert nu.size > 100
    size = np.exp(-sites * theta.imag)
    np.testing.assert_allclose(size, amplified(gamma, nu.real, k, b), rtol=0.02)


@pytest.mark.parametrize(
    ("gamma", "k", "b", "spring"),
    [(0.08, 0.8, 0.468, 0.0), (0.03, 0.6, 0.3, 0.0), (0.05, 0.8, 0.0, 0.2)],
)
def test_long_rings_grow_as_the_largest_gain_says(gamma, k, b, spring):
    worst = over_reflection(gamma, k, b, spring)
    assert worst.over_reflecting
    scaled = []
    for sites in (200, 400):
        size = np.abs(np.linalg.eigvals(even_half_map(sites, spring, gamma, k, b)))
        scaled.append(sites * (size[size < 1.01].max() - 1))
    assert 2 * scaled[1] - scaled[0] == pytest.approx(worst.growth, rel=3e-3)
    assert over_reflects(gamma, k, b, spring)
    assert not over_reflects(gamma, 1.0, b, spring)
    gain = amplified(gamma, worst.nu, k, b, spring)[0]
    assert gain == pytest.approx(math.exp(worst.gain))


@pytest.mark.parametrize("gamma", [1e-6, 0.02, 0.0965, 0.12, 0.24])
@pytest.mark.parametrize("k", [0.3, 0.8, 0.999])
def test_the_maxima_are_those_of_a_very_fine_grid(gamma, k):
    edge = 2 * math.sqrt(gamma)
    alpha = np.linspace(0, np.pi / 2, 20001)[1:-1]
    for b in (-0.8, -0.12, 0.1, 0.3):
        worst = over_reflection(gamma, k, b)
        log = np.log(amplified(gamma, edge * np.sin(alpha), k, b))
        growth = np.pi * math.sqrt(gamma) * np.cos(alpha) * log
        if not worst.over_reflecting:
            assert log.max() < 1e-12
            continue
        for found, fine in ((worst.gain, log), (worst.growth, growth)):
            missed = np.abs(np.diff(fine, 2)).max() / 8  # between nodes, by the fine grid
            assert -1e-12 <= found - fine.max() <= 1.1 * missed + 1e-12


def test_at_a_neimark_sacker_point_S_has_a_pole():
    nu, b = ns_points(0.12, 0.8)[1]
    worst = over_reflection(0.12, 0.8, b)
    assert worst.nu == pytest.approx(nu, abs=1e-7)
    assert 25 < worst.gain < 50  # as large as rounding allows, yet a number


@pytest.mark.parametrize(("gamma", "k"), [(0.05, 0.8), (0.15, 0.5), (0.2, 0.1)])
def test_where_nothing_is_amplified_no_ring_is_unstable_through_its_band(gamma, k):
    pitchfork = pitchfork_b(gamma, k)
    b = np.linspace(pitchfork - 2, pitchfork - 1e-6, 401)
    flags = np.array([over_reflects(gamma, k, x) for x in b])
    threshold = b[np.flatnonzero(flags)[-1]]
    assert not flags[b > threshold].any()
    quiet, loud = threshold + 0.3 * (pitchfork - threshold), threshold - 0.05
    for sites in (3, 10, 41, 200, 400):
        assert np.abs(half_multipliers(Ring(sites), gamma, k, quiet)).max() < 1 + 1e-13
    assert np.abs(half_multipliers(Ring(400), gamma, k, loud)).max() > 1 + 1e-7


@pytest.mark.parametrize(("gamma", "k"), [(0.05, 0.8), (0.15, 0.5), (0.2, 0.1)])
def test_the_slowest_waves_are_the_first_to_be_amplified(gamma, k):
    def gain_of_slow_waves(b: float) -> float:
        slow = 4e-3 * math.sqrt(gamma) * np.array([0.5, 1.0])
        size = np.log(amplified(gamma, slow, k, b)) / slow**2
        return float(2 * size[0] - size[1])  # ln|S|/nu^2 at nu = 0

    b = brentq(gain_of_slow_waves, -2, pitchfork_b(gamma, k) - 1e-3)
    assert over_reflects(gamma, k, b - 1e-5)
    assert not over_reflects(gamma, k, b + 1e-5)


def test_there_are_no_waves_without_coupling():
    assert not over_reflection(0.0, 0.8, 0.3).over_reflecting


def test_at_the_onset_waves_are_amplified_by_nothing() -> None:
    gamma, k, low, high = 0.1, 0.8, 0.0, 2.0
    while low < (middle := 0.5 * (low + high)) < high:
        low, high = (middle, high) if over_reflects(gamma, k, middle) else (low, middle)
    assert over_reflection(gamma, k, low) == OverReflection(True, 0, 0, 0, 0)
    assert over_reflection(gamma, k, high) == OverReflection(False, 0, 0, 0, 0)
    assert over_reflection(gamma, k, low - 1e-3).gain > 0.0
