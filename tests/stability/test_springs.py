"""Springs to the ground on the infinite chain: sums over modes, and long rings solved dense."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest

import contbreather as cb
from contbreather.lattice import InfiniteChain
from contbreather.stability import ns_points, stability
from contbreather.stability.one_impact import HalfMap, window
from tests.lattice.by_hand import response
from tests.stability.by_hand import even_half_map, slope
from tests.stability.half import D, on_arc, unstable_count, unstable_multipliers

NAMES = ("chi", "eta", "sigma", "psi", "tau")
SPRUNG = [(0.2, 0.05), (0.05, 0.2), (0.6, 0.09), (0.9, 0.02), (1e-3, 0.1)]


def modes(spring: float, gamma: float, sites: int = 6000) -> tuple[np.ndarray, np.ndarray]:
    theta = 2 * np.pi * np.arange(sites) / sites
    return theta, np.sqrt(spring + 4 * gamma * np.sin(theta / 2) ** 2)


def summed(name: str, w: np.ndarray) -> float:
    half = 0.5 * np.pi * w
    of = {
        "chi": np.tan(half) / w,
        "eta": w * np.tan(half),
        "sigma": w / np.sin(2 * half),
        "psi": w / np.tan(half),
        "tau": 1 / np.tan(half) / w,
    }
    return float(of[name].mean())


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(("spring", "gamma"), SPRUNG)
def test_means_are_sums_over_the_modes(name: str, spring: float, gamma: float) -> None:
    found = getattr(InfiniteChain(spring), name)(gamma)
    assert found == pytest.approx(summed(name, modes(spring, gamma)[1]), rel=2e-14)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(("spring", "gamma"), SPRUNG[:4])
def test_slopes_are_those_of_the_means(name: str, spring: float, gamma: float) -> None:
    chain = InfiniteChain(spring)
    in_spring = slope(lambda e: getattr(InfiniteChain(spring + e), name)(gamma), 1e-5)
    in_gamma = slope(lambda e: getattr(chain, name)(gamma + e), 1e-5)
    if name == "tau":  # less its pole in the lower edge of the band
        in_spring -= slope(
            lambda e: 2 / math.pi / math.sqrt((spring + e) * (spring + e + 4 * gamma)), 1e-5
        )
    assert chain.by_spring(gamma, name) == pytest.approx(in_spring, rel=1e-7)
    found = chain.dtau(gamma) if name == "tau" else chain.slope(gamma, name)
    assert found == pytest.approx(in_gamma, rel=1e-7)


@pytest.mark.parametrize(("spring", "gamma"), SPRUNG)
@pytest.mark.parametrize("n", [0, 1, 4])
def test_flights_are_sums_over_the_modes(spring: float, gamma: float, n: int) -> None:
    chain, (theta, w) = InfiniteChain(spring), modes(spring, gamma)
    s = np.linspace(0, math.pi, 9)[:-1]
    y = 0.5 * math.pi - s[:, None]
    share = np.cos(n * theta) / np.cos(0.5 * np.pi * w)
    exact = (
        (np.sin(w * y) / w * share).mean(axis=1),
        (-np.cos(w * y) * share).mean(axis=1),
        (-w * np.sin(w * y) * share).mean(axis=1),
    )
    scale = float(chain.first_harmonic(gamma, 0))
    for found, wanted in zip(response(chain, gamma, n, s), exact, strict=True):
        assert found == pytest.approx(wanted, abs=3e-14 * scale)
    moved = {
        "spring": lambda e: response(InfiniteChain(spring + e), gamma, n, s)[0],
        "gamma": lambda e: response(chain, gamma + e, n, s)[0],
    }
    for name, of in moved.items():
        if spring > 0.01:
            answer = response(chain, gamma, n, s, name)[0]
            assert answer == pytest.approx(slope(of, 1e-4), rel=2e-5, abs=1e-7)


def test_isolated_multipliers_are_those_of_a_long_ring() -> None:
    rng = np.random.default_rng(11)
    seen = set()
    for i in range(18):
        spring = rng.uniform(0.01, 0.7) * (i % 3 > 0)
        gamma, k, b = rng.uniform(0.01, 0.24) * (1 - spring), rng.uniform(0, 1), rng.uniform(-3, 4)
        chain = InfiniteChain(spring)
        count, mu = unstable_count(gamma, k, b, chain), unstable_multipliers(gamma, k, b, chain)
        seen.add(count.count)
        assert count.certain
        assert mu.size == count.count
        assert abs(D(gamma, np.log(mu + 0j) / (1j * math.pi), k, b, chain)).max(initial=0) < 1e-9
        ring = np.linalg.eigvals(even_half_map(240, spring, gamma, k, b))
        ring, far = ring[abs(ring) > 1.08], mu[abs(mu) > 1.08]
        assert ring.size == far.size
        off = [abs(ring - one).min() for one in far]
        assert all(np.array(off) < np.where(abs(far) > 1.6, 1e-10 * abs(far), 1e-7))
    assert seen >= {0, 1, 2}


@pytest.mark.parametrize(("spring", "gamma"), [(0.2, 0.05), (0.2, 0.15), (0.6, 0.05)])
def test_elastic_impacts_free_a_pair_between_two_neutral_gaps(spring: float, gamma: float) -> None:
    centre, square, *_ = window(gamma, 1.0, spring)
    for b in centre + math.sqrt(square) * np.array([-1.1, -0.9, 0.0, 0.9, 1.1]):
        ring = np.linalg.eigvals(even_half_map(120, spring, gamma, 1.0, float(b)))
        outside = np.count_nonzero(abs(ring) > 1 + 1e-5)
        assert unstable_count(gamma, 1.0, float(b), InfiniteChain(spring)).count == outside


@pytest.mark.parametrize(("spring", "gamma"), SPRUNG[:3])
def test_plus_and_minus_one_are_where_the_scalars_vanish(spring: float, gamma: float) -> None:
    chain, k = InfiniteChain(spring), 0.8
    d = 0.5 * (1 - k)
    fork = (1 + k) ** 2 * chain.psi(gamma) / 2 + 2 * d * d / chain.tau(gamma)
    fold = -2 * d * d / chain.chi(gamma) - (1 + k) ** 2 * chain.eta(gamma) / 2
    assert abs(D(gamma, 1e-13, k, fork, chain)) < 1e-10
    assert abs(HalfMap(gamma, k, fork, chain).crosses(1.0)) < 1e-13
    assert abs(HalfMap(gamma, k, fold, chain).crosses(-1.0)) < 1e-13
    for b, place in ((fork, 1.0), (fold, -1.0)):
        near = np.linalg.eigvals(even_half_map(400, spring, gamma, k, b))
        assert abs(near - place).min() < 1e-7
        before, after = (unstable_count(gamma, k, b + e, chain).count for e in (-1e-6, 1e-6))
        assert abs(before - after) == 1


def test_neimark_sacker_points_are_on_the_arc_with_their_slopes() -> None:
    gamma, k, spring = 0.12, 0.7, 0.2
    points, chain = ns_points(gamma, k, spring), InfiniteChain(spring)
    assert len(points) == 2
    for nu, b in points:
        assert math.sqrt(spring) < nu < math.sqrt(spring + 4 * gamma)
        at = on_arc(gamma, nu, k, b, spring)
        assert abs(at.value) < 1e-13
        place, found = np.array([gamma, nu, k, b, spring]), (at.d_gamma, at.d_nu, *at[3:])
        for one, along in zip(found, np.eye(5), strict=True):
            wanted = slope(lambda e, x=place, y=along: on_arc(*(x + e * y)).value, 2e-6)
            assert one == pytest.approx(wanted, rel=1e-6, abs=1e-7)
        pairs = [unstable_count(gamma, k, b + e, chain).pairs for e in (-1e-7, 1e-7)]
        assert sorted(pairs) == [0, 1]
    assert stability(gamma, k, 0.5 * sum(b for _, b in points), chain).unstable >= 2


def test_no_spring_is_the_limit_of_a_weak_one() -> None:
    weak, none = InfiniteChain(1e-9), InfiniteChain()
    for b in (-0.6, 0.3, 1.4):
        counts = [unstable_count(0.1, 0.8, b, chain).count for chain in (weak, none)]
        assert counts[0] == counts[1]
    nu = np.array([0.3 - 0.2j, 0.8 - 0.01j])
    assert D(0.1, nu, 0.8, 0.4, weak) == pytest.approx(D(0.1, nu, 0.8, 0.4), abs=1e-6)


@pytest.mark.parametrize("spring", [np.array(0.1), np.float64(0.1), Fraction(1, 10)])
def test_a_spring_is_whatever_is_a_number(spring) -> None:
    on = {"a": 0.5, "gamma": 0.05, "k": 0.8}
    assert cb.symmetric(**on, spring=spring).p == cb.symmetric(**on, spring=0.1).p
    assert cb.symmetric(**on, spring=spring).stability().stable
