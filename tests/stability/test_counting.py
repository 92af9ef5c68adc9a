"""The number of multipliers outside the circle, against everything else that can count; and they
themselves."""

from __future__ import annotations

import math

import numpy as np
import pytest

from contbreather.lattice import InfiniteChain, Ring
from contbreather.stability import ns_points
from contbreather.stability.chain_map import OrbitMap
from contbreather.stability.one_impact import HalfMap, half_map
from tests.stability.by_hand import fold_b, paper_matrix, pitchfork_b
from tests.stability.half import D, half_multipliers, unstable_count, unstable_multipliers


def test_without_coupling_multipliers_are_those_of_the_single_oscillator():
    rng = np.random.default_rng(0)
    for i in range(200):
        k, b = rng.choice([rng.uniform(), 0.0, 1.0], p=[0.8, 0.1, 0.1]), rng.normal() * 2
        single = np.linalg.eigvals(paper_matrix(1, 0.0, k, b))
        outside = np.sort(np.abs(single[np.abs(single) > 1 + 1e-9]))
        if abs(np.abs(single).max() - 1) > 1e-9:
            count = unstable_count(0.0, k, b)
            assert count.count == outside.size
            assert count.pairs == int(outside.size == 2 and abs(single[0].imag) > 0)
        if i % 10 == 0:
            found = np.sort(np.abs(unstable_multipliers(0.0, k, b)))
            assert found == pytest.approx(outside, rel=1e-12)


@pytest.mark.parametrize(("gamma", "k"), [(0.12, 0.8), (0.2, 0.4), (0.05, 0.95), (0.24, 0.3)])
def test_the_count_changes_by_two_at_a_neimark_sacker_point_and_by_one_on_the_real_axis(gamma, k):
    jumps = {point.b: 2 for point in ns_points(gamma, k)}
    assert len(jumps) == 2
    jumps |= {fold_b(gamma, k): 1, pitchfork_b(gamma, k): 1}
    for b, jump in jumps.items():
        below, above = (unstable_count(gamma, k, b + step) for step in (-1e-9, 1e-9))
        assert abs(below.count - above.count) == jump
        assert abs(below.pairs - above.pairs) == (jump == 2)
        assert below.certain
        assert above.certain
    edges = sorted(jumps)
    for low, high in zip([edges[0] - 5, *edges], [*edges, edges[-1] + 5], strict=True):
        inside = np.linspace(low, high, 40)[1:-1]
        assert len({unstable_count(gamma, k, b).count for b in inside}) == 1


@pytest.mark.parametrize("k", [0.4, 0.8])
def test_on_a_bifurcation_the_count_says_that_it_is_not_certain_and_where(k):
    places = {pitchfork_b(0.12, k): 0.0, fold_b(0.12, k): 1.0}
    places |= {point.b: point.nu for point in ns_points(0.12, k)}
    for b, nu in places.items():
        at = unstable_count(0.12, k, b)
        assert not at.certain
        assert at.nu == pytest.approx(nu, abs=1e-10)
        beside = [unstable_count(0.12, k, b + step) for step in (-1e-7, 1e-7)]
        assert all(count.certain and 1e-10 < count.distance < 1e-5 for count in beside)
        assert beside[0].count != beside[1].count


def test_nearly_elastic_impacts_can_bring_a_neutral_multiplier_out():
    # at k = 1 two multipliers sit between the band and -1; less than 1 brings one pair out
    gamma, b = 0.0786466119116157, -0.06944721779417279
    assert unstable_count(gamma, 1.0, b).count == 0
    assert unstable_count(gamma, 1.0 - 1e-6, b).count == 2
    assert np.all(np.abs(unstable_multipliers(gamma, 1.0 - 1e-6, b)) > 1)


def test_a_ring_is_counted_outside_its_band_like_its_dense_matrix():
    rng = np.random.default_rng(5)
    for sites in (1, 2, 3, 8, 41):
        for _ in range(12):
            gamma, k, b = rng.uniform(0, 0.25), rng.uniform(), rng.normal() * 2
            dense = np.abs(np.linalg.eigvals(paper_matrix(sites, gamma, k, b)))
            for radius in (math.sqrt(1.005), 1.05, 1.5):
                if np.abs(dense - radius).min() > 1e-9:
                    map = half_map(gamma, k, b, Ring(sites))
                    assert map.unstable(radius**2) == np.sum(dense > radius)
                    assert map.reduced.around(radius).outside == np.sum(dense > radius)


@pytest.mark.parametrize("k", [1.0, 1.0 - 1e-8, 0.9])
def test_a_pitchfork_of_elastic_impacts_is_counted_without_noise(k):
    """F vanishes like nu^2 at the angle 0 there, down to rounding: nothing to be resolved."""
    b = pitchfork_b(0.05, k)
    count = unstable_count(0.05, k, b)
    assert not count.certain
    assert count.pairs == 0
    assert count.count in (0, 1)


def test_many_counts_at_once_are_those_of_one_by_one():
    rng = np.random.default_rng(7)
    for gamma, k in ((0.1, 0.8), (0.2499, 0.3), (1e-6, 0.99), (0.12, 1.0), (0.05, 0.0), (0.0, 0.7)):
        near = [pitchfork_b(gamma, k), fold_b(gamma, k), *(p.b for p in ns_points(gamma, k))]
        beside = [b * (1.0 + s * 10.0**-i) for b in near for s in (-1, 1) for i in range(2, 16)]
        b = np.append(beside, rng.choice([0.3, 1.0, 8.0], 60) * rng.normal(size=60))
        single = [unstable_count(gamma, k, one).count for one in b.tolist()]
        assert HalfMap(gamma, k, b).unstable(1.0).tolist() == single
        assert len(set(single)) > 1


def test_a_distance_is_relative_to_terms_that_grow_with_b():
    for b in (-1.0, 1.0):
        one, other = (unstable_count(0.1, 0.8, b * size).distance for size in (1e4, 1e7))
        assert one == pytest.approx(other, rel=1e-2)
        assert 0.1 < one < 1.0


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


# --- the multipliers themselves ------------------------------------------------------------------


def test_newton_finds_all_that_the_winding_number_counts_and_each_is_a_zero():
    rng = np.random.default_rng(7)
    for _ in range(80):
        gamma = rng.choice(
            [rng.uniform(0, 0.25), 10 ** rng.uniform(-12, -1), 0.25 - 10 ** rng.uniform(-8, -1)]
        )
        k = rng.choice([rng.uniform(), 0.0, 1.0])
        b = rng.choice([0.3, 1.5, 30.0]) * rng.normal()
        mu = unstable_multipliers(gamma, k, b)
        assert mu.size == unstable_count(gamma, k, b).count
        assert np.all(np.abs(mu) > 1)
        assert np.allclose(np.sort_complex(mu), np.sort_complex(mu.conj()), rtol=1e-14, atol=0)
        if mu.size:
            nu = np.log(mu) / (1j * np.pi)
            step = np.abs(D(gamma, nu, k, b)) * 2e-8
            step /= np.abs(D(gamma, nu + 1e-8, k, b) - D(gamma, nu - 1e-8, k, b))
            assert step.max() < 1e-12


@pytest.mark.parametrize(("gamma", "k"), [(0.12, 0.8), (0.2, 0.4), (0.24, 0.1), (0.05, 0.95)])
def test_the_nearest_angle_is_that_of_the_neimark_sacker_point_beside(gamma, k):
    for point in ns_points(gamma, k):
        assert HalfMap(gamma, k, point.b).nearest() == point.nu
        assert HalfMap(gamma, k, point.b + 1e-3).nearest() == point.nu


def test_where_no_pair_comes_out_yet_the_nearest_angle_is_where_both_points_will_part():
    # at gamma = 0.1 they meet at k = 0.78176...
    nearest = HalfMap(0.1, 0.7817, 0.3).nearest()
    low, high = (point.nu for point in ns_points(0.1, 0.7818))
    assert low < nearest < high


def turning(gamma: float, k: float, b: float, spring: float) -> int:
    """Zeros outside by the turning of the bordered determinant of one impact."""
    return OrbitMap(gamma, k, [(0, 0.0, b)], 0.5, spring).count().count


def test_the_closed_form_counts_as_the_turning_on_the_circle_does():
    rng = np.random.default_rng(3)
    for _ in range(120):
        spring = rng.choice([0.0, rng.uniform(0, 0.8)])
        gamma = rng.uniform(1e-3, 0.2499) * (1 - spring)
        k, b = rng.uniform(), rng.choice([0.3, 1.5, 30.0]) * rng.normal()
        found = unstable_count(gamma, k, b, InfiniteChain(spring))
        if found.distance > 1e-4:
            assert turning(gamma, k, b, spring) == found.count


def test_a_pair_outside_by_rounding_alone_is_found_as_counted():
    # next to k = 1 pairs leave the circle by about 1 - k
    mu = unstable_multipliers(0.2499701535554768, 0.9999999978968345, -280.91272758667736)
    assert mu.size == 3
    assert np.abs(mu[1:]) == pytest.approx(1.0, abs=1e-12)
