"""All multipliers of QS on a ring, against the paper's dense matrices and without them."""

from __future__ import annotations

import math

import mpmath as mp
import numpy as np
import pytest

from contbreather.lattice import Ring
from contbreather.stability import ns_points
from tests.stability.by_hand import apart, b_of, fold_b, paper_matrix, pitchfork_b
from tests.stability.half import half_multipliers

BREATHERS = [  # a, gamma, k: stable, unstable either way, elastic, perfectly plastic
    (0.2, 0.11, 0.8),
    (0.2, 0.09, 0.8),
    (0.8, 0.045, 0.8),
    (0.5, 0.12, 0.8),
    (0.5, 0.2, 0.4),
    (0.3, 0.1, 1.0),
    (0.9, 0.1, 0.0),
    (0.95, 0.2, 0.01),
    (0.3, 0.2499, 0.9),
]


def test_random_maps_agree_with_dense_matrices():
    rng = np.random.default_rng(1)
    for _ in range(100):
        gamma = rng.choice(
            [rng.uniform(0, 0.25), 10 ** rng.uniform(-5, -1), 0.25 - 10 ** rng.uniform(-5, -1)]
        )
        k = rng.choice([rng.uniform(), 0.0, 1.0, 10 ** rng.uniform(-8, -1)])
        b = rng.choice([0.3, 1.5, 30.0]) * rng.normal()
        sites = int(rng.integers(1, 60))
        dense = np.linalg.eigvals(paper_matrix(sites, gamma, k, b))
        assert apart(half_multipliers(Ring(sites), gamma, k, b), dense) < 1e-11


@pytest.mark.parametrize("sites", [2, 5])
@pytest.mark.parametrize("gamma", [1e-12, 1e-7])
def test_next_to_no_coupling_they_agree_with_forty_digits(sites, gamma):
    # a cluster of Jordan blocks, which the dense matrix of the sites has lost in double precision;
    # of the modes each turns for itself, and they are known to the rounding over their distances
    with mp.workdps(40):
        half = mp.matrix(2 * sites, 2 * sites)
        w = [2 * mp.sqrt(mp.mpf(gamma)) * mp.sin(mp.pi * j / sites) for j in range(sites)]
        for n in range(sites):
            for m in range(sites):
                wave = [mp.cos(2 * mp.pi * j * (n - m) / sites) / sites for j in range(sites)]
                sine = [mp.sin(mp.pi * x) / x if x else mp.pi for x in w]
                half[n, m] = half[sites + n, sites + m] = sum(
                    c * mp.cos(mp.pi * x) for c, x in zip(wave, w, strict=True)
                )
                half[n, sites + m] = sum(c * s for c, s in zip(wave, sine, strict=True))
                half[sites + n, m] = -sum(
                    c * x * mp.sin(mp.pi * x) for c, x in zip(wave, w, strict=True)
                )
        kick = mp.eye(2 * sites)
        k, b = mp.mpf("0.7"), mp.mpf("0.3")
        kick[0, 0] = kick[sites, sites] = -k
        kick[sites, 0] = b
        exact, _ = mp.eig(half * kick)
    exact = np.array([complex(x) for x in exact])
    assert apart(half_multipliers(Ring(sites), gamma, 0.7, 0.3), exact) < 1e-10


@pytest.mark.parametrize("sites", [400, 401])
def test_on_long_rings_trace_and_determinant_vouch_for_them(sites):
    for a, gamma, k in BREATHERS[sites % 2 : 4 : 2]:
        b = b_of(a, gamma, k)
        ring = Ring(sites)
        mu = half_multipliers(ring, gamma, k, b)
        assert mu.size == 2 * sites
        log = np.sum(np.log(mu))  # prod mu = det QS = k^2, positive
        assert log.real == pytest.approx(2 * math.log(k), abs=1e-11)
        w = ring.frequencies(gamma)
        free = 2 * np.sum(np.cos(np.pi * w))
        at_impact = (-2 * k - 2) * np.mean(np.cos(np.pi * w)) + b * np.mean(np.pi * np.sinc(w))
        assert np.sum(mu) == pytest.approx(free + at_impact, abs=1e-10)


@pytest.mark.parametrize("k", [0.8, 0.3, 0.0])
def test_on_a_bifurcation_the_critical_multiplier_is_there(k):
    gamma = 0.15
    for sites in (61, 200):  # so long that the ring has the means of the infinite chain
        for b, critical in ((pitchfork_b(gamma, k), 1.0), (fold_b(gamma, k), -1.0)):
            mu = half_multipliers(Ring(sites), gamma, k, b)
            assert np.abs(mu - critical).min() < 1e-12
    for nu, b in ns_points(gamma, k):
        for sites in (50, 400):  # the ring's own waves keep off it by about 1/N
            mu = half_multipliers(Ring(sites), gamma, k, b)
            assert np.abs(mu - np.exp(1j * np.pi * nu)).min() < 20 / sites


def test_on_a_pitchfork_of_any_ring_the_multiplier_is_one():
    rng = np.random.default_rng(2)
    for _ in range(40):
        ring = Ring(int(rng.integers(1, 120)))
        gamma = rng.choice([rng.uniform(0, 0.25), 10 ** rng.uniform(-8, -1)])
        k = rng.choice([rng.uniform(), 0.0])
        mu = half_multipliers(ring, gamma, k, (1 + k) ** 2 * ring.psi(gamma) / 2)
        assert np.abs(mu[: ring.sites // 2 * 2 + 2] - 1).min() < 1e-12
