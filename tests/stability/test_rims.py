"""Elastic impacts, no coupling, a multiplier on the circle: where formulas degenerate."""

from __future__ import annotations

import math

import numpy as np
import pytest

from contbreather.errors import NotConverged
from contbreather.lattice import Ring
from contbreather.stability import (
    dense_half_map,
    neimark_sacker,
    orbit,
    unstable_count,
    unstable_multipliers,
)
from contbreather.stability.half_map import eigenvector, half_multipliers
from contbreather.stability.orbit import OrbitMap
from tests.stability.by_hand import pitchfork_b

# --- counts ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("gamma", [0.0, 1e-6, 0.03, 0.12, 0.2])
def test_elastic_counts_are_those_of_a_long_ring_well_outside(gamma: float) -> None:
    """For k = 1 the map keeps areas: multipliers come with their inverses, none is left inside."""
    rng = np.random.default_rng(int(1e6 * gamma))
    for b in rng.normal(size=12) * 2:
        mu = unstable_multipliers(gamma, 1.0, float(b))
        count = unstable_count(gamma, 1.0, float(b))
        assert count.count == mu.size
        if mu.size and np.abs(mu).min() < 1.05:
            continue
        ring = half_multipliers(Ring(60), gamma, 1.0, float(b))
        assert np.sum(np.abs(ring) > 1.04) == np.sum(np.abs(ring) < 1 / 1.04) == count.count


# --- counts of orbits -----------------------------------------------------------------------------


def zeros_outside(map: OrbitMap, radius: float) -> float:
    """(1/2 pi i) times the integral of D'/D over a circle around all but the zeros outside."""
    n = 1024
    depth = math.log(radius) / (2 * math.pi)
    kappa = (np.arange(n) + 0.5) / n - 0.5 - 1j * depth
    values = map.D(kappa)
    turned = np.angle(np.append(values[1:], values[:1]) * values.conj()).sum()
    return -float(turned) / (2 * math.pi)


def test_the_winding_number_of_an_orbit_is_the_argument_of_its_determinant() -> None:
    """Random orbits of two and three impacts, where the ring about the circle is clear of zeros."""
    rng = np.random.default_rng(8)
    counts = []
    while len(counts) < 8:
        gamma, k = rng.uniform(0.01, 0.2), rng.uniform(0.3, 1)
        times = np.sort(rng.uniform(0, 2 * math.pi, int(rng.integers(2, 4))))
        kicks = [(0, float(t), 1.5 * float(rng.normal())) for t in times]
        map = OrbitMap(gamma, k, kicks)
        if abs(zeros_outside(map, 1.05) - zeros_outside(map, 1.2)) > 0.01:
            continue
        count = map.count()
        if count.distance < 1e-3 or np.abs(map.unstable_multipliers()).min(initial=9) < 1.05:
            continue
        assert count.count == round(zeros_outside(map, 1.05))
        assert count.certain
        counts.append(count.count)
    assert {0, 1} <= set(counts)


def test_poles_are_taken_off_alike_whatever_sites_are_hit() -> None:
    """F is D without the poles of the band, and they are those of the lattice alone."""
    one = OrbitMap(0.08, 0.8, [(0, 0.0, 0.4), (0, 2.0, -0.3)])
    two = OrbitMap(0.08, 0.8, [(0, 0.0, 0.7), (1, 0.9, 0.2), (3, 2.5, -0.6)])
    edge = 2 * 0.08**0.5  # in units of the circle, 0.566: all aliases overlap above 1 - edge
    for kappa in (0.07, 0.25, 0.42, 0.45, 0.49):
        assert kappa < edge
        at = np.array([kappa + 0j])
        ratio = [complex(map.F(at)[0] / map.D(at)[0]) for map in (one, two)]
        assert ratio[1] == pytest.approx(ratio[0], rel=1e-9)


@pytest.mark.parametrize("gamma", [0.01, 0.05, 0.0624, 0.09, 0.2])
def test_the_scalar_at_minus_one_is_the_determinant_over_the_size_of_the_resolvent(gamma) -> None:
    """``D(-1)/(1 + |g|^2)`` with ``|g|^-2 = s^2 |s^2 - 4 gamma|`` at s = 1/2."""
    map = OrbitMap(gamma, 0.8, [(0, 0.0, 0.5), (0, 2.7, 0.3)])
    size = 0.25 * abs(0.25 - 4 * gamma)
    whole = complex(map.D(np.array([0.5 - 1e-13j]))[0])
    assert map.crosses(-1.0) == pytest.approx(whole.real * size / (1 + size), rel=1e-6)


@pytest.mark.parametrize("wrong", [-1, 1])
def test_multipliers_of_an_orbit_are_held_to_its_winding_number(monkeypatch, wrong: int) -> None:
    """Newton's method that loses one, or finds one that is none, is not believed."""
    find = orbit._zeros

    def other(*args: object) -> np.ndarray:
        found = find(*args)
        return found[:-1] if wrong < 0 else np.append(found, 1.5)

    map = OrbitMap(0.11, 0.8, [(0, 0.0, -0.28657), (0, math.pi, -0.28657)])
    assert map.unstable_multipliers().size == map.count().count == 2
    monkeypatch.setattr(orbit, "_zeros", other)
    with pytest.raises(NotConverged, match=f"says 2 multipliers .* found {2 + wrong}"):
        map.unstable_multipliers()


def test_an_orbit_with_a_multiplier_on_the_circle_is_not_certain_and_says_where() -> None:
    gamma, k = 0.1, 0.8
    for b, nu in [(pitchfork_b(gamma, k), 0.0)] + [(p.b, p.nu) for p in neimark_sacker(gamma, k)]:
        map = OrbitMap(gamma, k, [(0, 0.3, b), (0, 0.3 + math.pi, b)])
        count = map.count()
        assert not count.certain
        # squares of the half map's: twice the angle, folded onto the upper half circle
        angle = 2 * nu % 2
        assert min(angle, 2 - angle) == pytest.approx(count.nu, abs=1e-5)


# --- eigenvectors ---------------------------------------------------------------------------------


@pytest.mark.parametrize("sites", [5, 8])
def test_each_mode_that_does_not_see_the_impact_has_its_own_eigenvector(sites: int) -> None:
    """Odd under n -> -n; a wave with a node at the impacting site."""
    gamma, k, b = 0.11, 0.8, -0.28
    half = dense_half_map(sites, gamma, k, b)
    n = np.arange(sites)
    for j in range(1, (sites + 1) // 2):
        w = 2 * math.sqrt(gamma) * math.sin(math.pi * j / sites)
        wave = np.sin(2 * math.pi * j * n / sites)
        for sign in (1, -1):
            mu = complex(np.exp(1j * math.pi * sign * w))
            v = eigenvector(Ring(sites), gamma, k, b, mu)
            assert np.linalg.norm(half @ v - mu * v) < 1e-12
            shape = np.concatenate([wave, 1j * sign * w * wave])
            shape = shape / np.linalg.norm(shape)
            assert abs(np.vdot(shape, v)) == pytest.approx(1.0, abs=1e-10)


def test_without_coupling_an_idle_site_keeps_its_place() -> None:
    v = eigenvector(Ring(4), 0.0, 0.8, 1.1, 1.0)
    np.testing.assert_allclose(dense_half_map(4, 0.0, 0.8, 1.1) @ v, v, atol=1e-13)
    assert abs(v[0]) == 0.0
