"""Reduced determinants, counts and multipliers of orbits, by dense matrices and known cases."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from contbreather.errors import BadInput, NotConverged
from contbreather.lattice import InfiniteChain, Ring
from contbreather.stability import ns_points
from contbreather.stability.chain_map import OrbitMap
from contbreather.stability.saltation import Saltation
from contbreather.stability.verdict import verdict
from contbreather.stability.zeros import as_counted
from tests.stability.by_hand import apart, flight, impact, pitchfork_b, ring_map
from tests.stability.half import D, determinant, unstable_count, unstable_multipliers


def dense(sites, gamma, k, kicks, periods):
    """Product of matrix exponentials and saltation matrices on all sites."""
    M = np.eye(2 * sites)
    ends = [*(kick[1] for kick in kicks[1:]), kicks[0][1] + 2 * np.pi * periods]
    for (site, time, b), end in zip(kicks, ends, strict=True):
        M = flight(sites, gamma, end - time) @ impact(sites, site, k, b) @ M
    return M


def on_ring(sites, gamma, k, kicks, periods=1):
    return ring_map(Ring(sites), gamma, k, tuple(Saltation(*one) for one in kicks), TURN * periods)


TURN, LONG = 2.0 * np.pi, 101
CASES = [
    (1, 0.1, 0.7, ((0, 0.0, 0.4), (0, 2.0, -0.9)), 1),
    (2, 0.1, 0.7, ((0, 0.1, 0.4), (1, 2.0, 0.9)), 1),
    (9, 0.2, 0.8, ((0, 0.0, 0.4), (0, 2.0, 0.9)), 1),
    (10, 0.2, 0.8, ((3, 0.5, 0.4), (3, 2.0, 0.9), (3, 4.0, -0.3)), 1),
    (12, 0.06, 0.5, ((2, 0.0, 0.4), (4, 0.7, 0.9), (4, 5.0, 1.3), (2, 9.0, -0.6)), 2),
    (7, 0.0, 0.9, ((0, 0.0, 0.4), (1, 0.5, 0.2), (0, 3.0, 0.9)), 1),
]


@pytest.mark.parametrize(("sites", "gamma", "k", "kicks", "periods"), CASES)
def test_multipliers_are_the_eigenvalues_of_flights_and_saltations(sites, gamma, k, kicks, periods):
    mu = on_ring(sites, gamma, k, kicks, periods).multipliers()
    assert mu.size == 2 * sites
    # a double eigenvalue (a zero mode) is known to the root of rounding
    assert apart(mu, np.linalg.eigvals(dense(sites, gamma, k, kicks, periods))) < 1e-6
    assert abs(np.prod(mu) - k ** (2 * len(kicks))) < 1e-12


def test_reduced_determinant_is_that_of_the_whole_matrix():
    sites, gamma, k, kicks = 150, 0.06, 0.5, CASES[4][3]
    map = OrbitMap(gamma, k, kicks, 2)
    M = dense(sites, gamma, k, kicks, 2)
    free = flight(sites, gamma, 4 * np.pi)
    # the same in units of speeds, which take the pole of each out of it and turn no count
    speeds = [-0.3, *np.linspace(0.2, 1.4, len(kicks) - 1)]
    slow = [(n, t, v * b, v) for (n, t, b), v in zip(kicks, speeds, strict=True)]
    in_speeds = OrbitMap(gamma, k, slow, 2)
    for mu in (2.3, -2.1 + 0.4j, 6.0j):
        whole = np.linalg.det(M - mu * np.eye(2 * sites)) / np.linalg.det(
            free - mu * np.eye(2 * sites)
        )
        kappa = np.log(complex(mu)) / (2j * np.pi)
        assert determinant(map, kappa) == pytest.approx(whole, rel=1e-10)
        assert determinant(in_speeds, kappa) == pytest.approx(whole * np.prod(speeds), rel=1e-10)
    counts = in_speeds.count(), map.count()
    assert len({(count.count, count.pairs) for count in counts}) == 1


@pytest.mark.parametrize("gamma", [0.01, 0.025, 0.03, 0.06])
def test_several_multipliers_at_1_are_not_outside(gamma):
    """Elastic impacts have them at the pitchfork, and rounding alone puts them on a side."""
    b = 2.0 * InfiniteChain().psi(gamma)
    count = OrbitMap(gamma, 1.0, [(0, 0.0, b), (0, math.pi, b)]).count()
    assert (count.count, count.certain) == (0, False)


def test_symmetric_breather_is_its_half_map_twice():
    gamma, k, b = 0.1, 0.8, 0.7
    map = OrbitMap(gamma, k, [(0, 0.3, b), (0, 0.3 + math.pi, b)])
    for kappa in ([0.2 - 0.1j, 0.45 - 0.7j, 0.1 - 0.02j], [0.2 + 0j, 0.05, 0.42]):
        kappa = np.array(kappa, dtype=complex)  # mu^2 of the half map: the second row on the band
        halves = D(gamma, kappa, k, b) * D(gamma, kappa + 1, k, b)
        assert np.abs(determinant(map, kappa) - halves).max() < 1e-13


@pytest.mark.parametrize(("gamma", "k"), [(0.1, 0.8), (0.2, 0.7)])
@pytest.mark.parametrize("off", [1e-3, 1e-5, 1e-6])
def test_just_beside_the_circle_the_count_of_the_whole_period_is_that_of_half_of_it(gamma, k, off):
    roots = ns_points(gamma, k)
    assert roots
    for root in roots:
        seen = set()
        for b in (root.b - off, root.b + off):
            whole = OrbitMap(gamma, k, [(0, 0.3, b), (0, 0.3 + math.pi, b)])
            assert whole.count().count == unstable_count(gamma, k, b).count
            assert whole.count().certain
            assert 0.5 * whole.nearest() == pytest.approx(min(root.nu, 1 - root.nu), abs=off)
            assert whole.approach() < 10 * off
            seen.add(whole.count().count)
        assert max(seen) - min(seen) == 2


@pytest.mark.parametrize("b", [-2.5, -0.9, 0.4, 0.7, 3.0])
def test_a_count_by_all_multipliers_names_the_one_nearest_to_the_circle(b):
    kicks = [(0, 0.0, b), (0, 2.0, 0.7)]
    map = OrbitMap(0.0, 0.8, kicks)
    found = map.count()
    mu = on_ring(1, 0.0, 0.8, kicks).over_period
    gaps = np.abs(np.abs(mu) - 1.0)
    assert found.count == np.count_nonzero(np.abs(mu) > 1.0)
    assert found.distance == pytest.approx(gaps.min(), abs=1e-12)
    at = np.exp(1j * np.pi * found.nu)
    assert 0 <= found.nu <= 1
    assert min(abs(mu - at)) == pytest.approx(found.distance, abs=1e-9)
    assert found.pairs == np.count_nonzero((np.abs(mu) > 1.0) & (mu.imag > 0))
    assert found.certain
    outside = np.sort(np.abs(mu[np.abs(mu) > 1.0]))
    assert np.sort(np.abs(map.unstable_multipliers())) == pytest.approx(outside)


def test_a_pair_on_the_circle_of_sites_for_themselves_is_told_with_its_angle() -> None:
    map = OrbitMap(0.0, 1.0, [(0, 0.0, 0.5), (0, math.pi, 0.5)])  # elastic: of modulus 1
    angle = abs(np.angle(on_ring(1, 0.0, 1.0, map.kicks).multipliers()[0])) / np.pi
    assert 0.1 < angle < 0.9
    assert f"at the angle {angle:.6g} pi" in repr(verdict(map))


def random_orbit(rng, several):
    periods = int(rng.integers(1, 3))
    m = int(rng.integers(1, 5))
    times = np.sort(rng.uniform(0, 2 * np.pi * periods, m))
    sites = rng.integers(0, 3, m) if several else np.zeros(m, dtype=int)
    kicks = tuple(
        (int(n), t, b) for n, t, b in zip(sites, times.tolist(), rng.normal(size=m), strict=True)
    )
    return rng.uniform(5e-4, 0.2495) / periods**2, rng.uniform(0.2, 1), kicks, periods


@pytest.mark.parametrize("several", [False, True])
def test_winding_number_newton_and_a_long_ring_agree(several):
    """Multipliers well outside the circle do not know whether the chain is infinite."""
    rng = np.random.default_rng(3)
    outside = 0
    for _ in range(8 if several else 20):
        gamma, k, kicks, periods = random_orbit(rng, several)
        found = OrbitMap(gamma, k, kicks, periods).unstable_multipliers()
        ring = on_ring(LONG, gamma, k, kicks, periods).over_period
        far, wanted = found[np.abs(found) > 1.6], ring[np.abs(ring) > 1.6]
        assert far.size == wanted.size
        assert apart(far, wanted) < 1e-7
        outside += far.size
    assert outside >= 5


def test_pairs_are_what_is_left_without_lone_real_multipliers():
    rng = np.random.default_rng(11)
    seen = set()
    for _ in range(40):
        gamma, k, kicks, periods = random_orbit(rng, several=False)
        map = OrbitMap(gamma, k, kicks, periods)
        mu = map.unstable_multipliers()
        lone = sum(np.count_nonzero((mu.imag == 0) & (s * mu.real > 1)) % 2 for s in (1, -1))
        assert map.count().pairs == (mu.size - lone) // 2
        seen.add((map.count().pairs, lone))
    assert len(seen) >= 4


def test_multipliers_come_largest_first_and_in_pairs():
    mu = OrbitMap(0.11, 0.8, [(0, 0.0, -0.28657), (0, math.pi, -0.28657)]).unstable_multipliers()
    half = unstable_multipliers(0.11, 0.8, -0.28657)
    assert mu.size == 2
    assert mu[0] == mu[1].conjugate()
    assert mu[0].imag > 0.0
    assert apart(mu, half**2) < 1e-11


def test_a_multiplier_of_minus_one_is_a_zero_of_its_scalar():
    def on(b, ring):
        kicks = [(0, 0.0, b), (0, 2.7, 0.3)]
        return on_ring(30, 0.04, 0.8, kicks) if ring else OrbitMap(0.04, 0.8, kicks)

    for ring in (False, True):
        low = brentq(lambda b, ring=ring: on(b, ring).crosses(-1.0), 0.0, 6.0, xtol=1e-15)
        gap = np.abs(on(low, True).multipliers() + 1).min()
        assert gap < (1e-12 if ring else 1e-9)


@pytest.mark.parametrize("mu", [1.0, -1.0])
def test_scalars_of_real_multipliers_are_smooth_where_an_impact_vanishes(mu):
    """Its speed changes sign, and nothing else does: that of -1 jumped from +0.03 to -0.03."""
    speeds = np.linspace(-1e-3, 1e-3, 6)
    kicks = [[(0, 0.0, 0.9, 1.0), (0, 2.0, 0.5, float(speed))] for speed in speeds]
    values = [OrbitMap(0.06, 0.8, each).crosses(mu) for each in kicks]
    assert np.ptp(values) < 1e-3 < np.abs(values).min()


def test_counts_change_by_one_across_plus_and_minus_one():
    def of(b):
        return OrbitMap(0.04, 0.8, [(0, 0.0, b), (0, 2.7, 0.3)])

    grid = np.linspace(-9.0, 6.0, 61)
    counts = np.array([of(b).count().count for b in grid])
    signs = np.array([(of(b).crosses(1.0) > 0, of(b).crosses(-1.0) > 0) for b in grid])
    pairs = np.array([of(b).count().pairs for b in grid])
    steps = np.diff(counts) - 2 * np.diff(pairs)
    crossings = (signs[1:] != signs[:-1]).sum(axis=1)
    assert crossings.sum() >= 2
    assert np.array_equal(np.abs(steps) % 2, crossings % 2)


def test_uncoupled_sites_answer_each_for_itself():
    kicks = ((0, 0.0, 0.4), (1, 0.5, 3.0), (0, 3.0, 0.9), (1, 4.0, 2.0))
    each = [
        OrbitMap(0.0, 0.8, [(0, t, b) for n, t, b in kicks if n == site]).count().count
        for site in (0, 1)
    ]
    assert OrbitMap(0.0, 0.8, kicks).count().count == sum(each)
    assert OrbitMap(1e-5, 0.8, kicks).count().count == sum(each)


def test_verdicts_name_their_chain():
    map = OrbitMap(0.04, 0.8, [(0, 0.0, 1.1), (0, math.pi, 1.1)])
    chain = verdict(map)
    assert not chain.stable
    assert "infinite chain: unstable, 1 multiplier of the orbit" in repr(chain)
    assert chain.multipliers.size == 1
    assert chain.largest == abs(chain.multipliers[0])
    with pytest.raises(BadInput, match="over-reflection is known of symmetric breathers"):
        _ = chain.over_reflecting
    ring = verdict(on_ring(20, 0.04, 0.8, map.kicks))
    assert "ring of 20" in repr(ring)
    assert "threshold 1.005" in repr(ring)
    assert ring.largest == pytest.approx(abs(ring.multipliers[0]))


@pytest.mark.parametrize("wrong", [-1, 1])
def test_multipliers_of_an_orbit_are_held_to_its_winding_number(wrong: int) -> None:
    """Newton's method that loses one, or finds one that is none, is not believed."""
    map = OrbitMap(0.11, 0.8, [(0, 0.0, -0.28657), (0, math.pi, -0.28657)])
    count, found = map.count(), map.unstable_multipliers()
    assert found.size == count.count == 2
    other = found[:-1] if wrong < 0 else np.append(found, 1.5)
    with pytest.raises(NotConverged, match=f"says 2 multipliers .* found {2 + wrong}"):
        as_counted(count, lambda sites: other, (40,))


def test_an_orbit_with_a_multiplier_on_the_circle_is_not_certain_and_says_where() -> None:
    gamma, k = 0.1, 0.8
    for b, nu in [(pitchfork_b(gamma, k), 0.0)] + [(p.b, p.nu) for p in ns_points(gamma, k)]:
        map = OrbitMap(gamma, k, [(0, 0.3, b), (0, 0.3 + math.pi, b)])
        count = map.count()
        assert not count.certain
        # squares of the half map's: twice the angle, folded onto the upper half circle
        angle = 2 * nu % 2
        assert min(angle, 2 - angle) == pytest.approx(count.nu, abs=1e-5)
