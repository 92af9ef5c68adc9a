"""Means over the modes against 30-digit quadrature, and the resolvent against what it must be."""

from __future__ import annotations

import math

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from contbreather.errors import BadInput
from contbreather.lattice import InfiniteChain, Ring, check_gamma
from contbreather.lattice.chain import Chains
from contbreather.lattice.periodic_green import half_period_green, half_period_tables
from tests.lattice.by_hand import MEANS, ring_mean
from tests.orbits.field import dense

CHAIN = InfiniteChain()
GAMMAS = [0.0, 1e-9, 0.12, 0.24, 0.24999999]
couplings = st.floats(0.0, 0.2499)


def mean(of, gamma):
    """30 digits by quadrature over theta = pi - t, split towards the band's edge at t = 0."""
    with mp.workdps(30):
        gamma = mp.mpf(gamma)
        edge = mp.sqrt(1 - 4 * gamma)
        splits = [0, edge / 3, edge, 3 * edge, 10 * edge, 30 * edge, 300 * edge]
        splits = [t for t in splits if t < 1] + [1, mp.pi]
        return mp.quad(lambda t: of(2 * mp.sqrt(gamma) * mp.cos(t / 2)), splits) / mp.pi


@pytest.mark.parametrize("gamma", GAMMAS)
@pytest.mark.parametrize("name", MEANS)
def test_means_over_the_infinite_band_are_exact_up_to_its_edge(name, gamma):
    exact = mean(MEANS[name], gamma)
    assert abs(getattr(CHAIN, name)(gamma) - exact) <= 5e-16 * abs(exact)


@pytest.mark.parametrize("sites", [1, 2, 3, 20])
@pytest.mark.parametrize("gamma", [0.0, 1e-12, 0.1, 0.24999999])
@pytest.mark.parametrize("name", MEANS)
def test_means_over_a_ring_are_the_sums_over_its_modes(name, gamma, sites):
    with mp.workdps(30):
        exact = ring_mean(MEANS[name], gamma, sites)
    assert abs(getattr(Ring(sites), name)(gamma) - exact) < 1e-15 * max(1, abs(exact))


@pytest.mark.parametrize("sites", [None, 1, 2, 7, 60])
@pytest.mark.parametrize("gamma", [0.05, 0.2499])
@pytest.mark.parametrize("name", MEANS)
def test_slopes_in_gamma_are_those_of_the_means(name, gamma, sites):
    lattice = Ring(sites) if sites else CHAIN
    with mp.workdps(30):
        h, of = mp.mpf(10) ** -11, MEANS[name]
        ends = [ring_mean(of, g, sites) if sites else mean(of, g) for g in (gamma + h, gamma - h)]
        exact = (ends[0] - ends[1]) / (2 * h)
    got = lattice.slope(gamma, name)
    # the finite step misses (h/(1/4 - gamma))^2 of it
    assert abs(got - exact) < 2e-13 * max(1e-2, abs(exact))


@settings(max_examples=40)
@given(couplings, st.integers(1, 40))
def test_every_mean_of_a_ring_tends_to_the_chain_s_exponentially(gamma, sites):
    r = math.sqrt(1 - 4 * gamma)
    lap = ((1 - r) / (1 + r)) ** sites  # what goes once round
    for name in MEANS:
        gap = abs(getattr(Ring(sites), name)(gamma) - getattr(CHAIN, name)(gamma))
        # from the pole next to the band; the next, two or three times as far, adds much less
        assert gap <= (4 / math.pi) * 2.5 * lap / (r * (1 - lap)) + 3e-15 / r


SEVERAL = np.array([0.01, 0.2, 0.12, 1e-6])


@pytest.mark.parametrize("spring", [0.0, 0.1, 0.5 * SEVERAL], ids=["none", "one", "each"])
def test_many_chains_have_the_means_and_responses_of_each(spring):
    sites, times = (0, 1, 2, 9), np.linspace(0.0, math.pi / 2, 301)
    springs, chains = np.broadcast_to(spring, SEVERAL.shape), Chains(SEVERAL, spring)
    tables, largest = half_period_tables(SEVERAL, spring, sites)
    for i, (gamma, held) in enumerate(zip(SEVERAL.tolist(), springs.tolist(), strict=True)):
        one = InfiniteChain(held)
        for name in MEANS:
            assert chains.mean(SEVERAL, name)[i] == pytest.approx(one.mean(gamma, name), rel=4e-15)
        assert chains.tau(SEVERAL)[i] == pytest.approx(one.tau(gamma), rel=1e-14)
        of = half_period_green(one, gamma, sites)
        np.testing.assert_allclose(tables[i], of.table, rtol=1e-14, atol=1e-16)
        # of one bound for all the widest band decides
        assert (abs(of.at(times, np.arange(4)[:, None])[0]).max(axis=1) <= largest[i]).all()


# ------------------------------------------------------------------------------------ modes


@pytest.mark.parametrize("sites", [1, 2, 3, 4, 5, 8, 9])
def test_frequencies_and_nodes_of_a_ring_are_the_modes_of_its_stiffness(sites):
    gamma, ring = 0.17, Ring(sites)
    squares = np.linalg.eigvalsh(gamma * dense(ring))
    np.testing.assert_allclose(np.sort(ring.frequencies(gamma)) ** 2, squares, atol=1e-15)
    theta, weight, w = ring.nodes(gamma)
    assert weight.sum() == pytest.approx(1.0, abs=1e-15)
    assert np.sum(weight * w**4) == pytest.approx(np.mean(squares**2), abs=1e-15)
    np.testing.assert_allclose(w, 2 * math.sqrt(gamma) * np.sin(theta / 2), atol=1e-15)


@pytest.mark.parametrize("gamma", [0.0, 0.01, 0.1, 0.2, 0.2499, 0.25 - 1e-6])
@pytest.mark.parametrize("n", [0, 1, 9, 300])
def test_the_first_harmonic_of_the_chain_is_known_up_to_the_edge(gamma, n):
    """``<cos(n theta)/(1 - w^2)>``, whose pole comes near: in closed form by residues."""
    root = math.sqrt(1 - 4 * gamma)
    exact = (-2 * gamma / (1 - 2 * gamma + root)) ** n / root
    assert float(CHAIN.first_harmonic(gamma, n)) == pytest.approx(exact, abs=1e-12 / root**2)


@pytest.mark.parametrize("sites", [None, 1, 2, 3, 8, 61])
@pytest.mark.parametrize("n", [0, 1, 2, 5, 59])
def test_moments_and_first_harmonic_are_means_over_the_modes(sites, n):
    gamma, size = 0.2, sites or 4000
    theta = 2 * np.pi * np.arange(size) / size
    q, wave = np.sin(theta / 2) ** 2, np.cos(theta[n * np.arange(size) % size])
    lattice = Ring(sites) if sites else CHAIN
    exact = [np.mean(q**j * wave) for j in range(19)]
    np.testing.assert_allclose(lattice.moments(n), exact, atol=5e-16)
    exact = np.mean(wave / (1 - 4 * gamma * q))
    assert abs(float(lattice.first_harmonic(gamma, n)) - exact) < 2e-15


def test_distance_counts_bonds_the_shorter_way():
    assert [CHAIN.distance(n) for n in (0, -3, 7)] == [0, 3, 7]
    assert [Ring(5).distance(n) for n in (0, 1, 2, 3, 4, 5, -1, 12)] == [0, 1, 2, 2, 1, 0, 1, 2]
    assert CHAIN.sites is None
    assert Ring(5).sites == 5


# ------------------------------------------------------------------------------------ errors


@pytest.mark.parametrize("gamma", [-1e-300, 0.25, 1.0, math.nan, math.inf, "x", None, 1j])
def test_a_coupling_outside_its_range_is_refused_with_the_range(gamma):
    with pytest.raises(BadInput, match=r"0 <= gamma < 1/4"):
        check_gamma(gamma)


ASKED = [*((name,) for name in (*MEANS, "nodes", "frequencies"))]
ASKED += [
    ("first_harmonic", 1),
    ("first_harmonic", 1, "gamma"),
    *(("slope", name) for name in MEANS),
]


@pytest.mark.parametrize("lattice", [CHAIN, Ring(4)])
@pytest.mark.parametrize("asked", ASKED, ids=lambda asked: "-".join(map(str, asked)))
@pytest.mark.parametrize("gamma", [-0.1, 0.25, math.nan])
def test_no_mean_exists_outside_the_attenuation_zone(lattice, asked, gamma):
    name, *more = asked
    if hasattr(lattice, name):
        with pytest.raises(BadInput, match="gamma"):
            getattr(lattice, name)(gamma, *more)
