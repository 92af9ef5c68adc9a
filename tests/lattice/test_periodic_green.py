"""The periodic Green's function, held against mode sums at 30 digits and against known limits."""

from __future__ import annotations

import math

import mpmath as mp
import numpy as np
import pytest

from contbreather.errors import BadInput
from contbreather.lattice import Harmonic, InfiniteChain, Ring
from contbreather.lattice.periodic_green import periodic_green
from contbreather.orbits.orbit_equations import answers_of
from tests.lattice.by_hand import ring_mean

CHAIN = InfiniteChain()


def mode_sum(sites, gamma, distance, periods, s):
    """h of a ring as in the module's docstring, mode by mode, the zero mode in its limit."""
    T = 2 * mp.pi * periods

    def mode(w):
        if not w:
            return T / 24 - (T / 2 - s) ** 2 / (2 * T)
        return mp.cos(w * (T / 2 - s)) / (2 * w * mp.sin(w * T / 2)) - 1 / (w * w * T)

    return ring_mean(mode, gamma, sites, distance)


RINGS = [(7, 0.12, 2, 1), (20, 0.24, 1, 1), (20, 0.03, 3, 2), (1, 0.2, 0, 1), (2, 0.2, 1, 1)]
# harmonics inside the band: the modes of such rings are summed, some of them slow
RESONANT = [(10, 0.0626, 0, 2), (5, 0.2, 1, 2), (12, 0.11, 2, 3), (30, 0.2, 3, 8)]


def table(sites, gamma, distance, periods, by=""):
    """By the response of a ring, in closed form where that is known."""
    held = gamma, 0.0, 0.0
    return answers_of(Ring(sites), Harmonic(), held, (0,), periods, 1).table((distance,), by)


@pytest.mark.parametrize(("sites", "gamma", "distance", "periods"), RINGS + RESONANT)
def test_it_is_the_mean_over_the_modes_with_three_derivatives(sites, gamma, distance, periods):
    answer = table(sites, gamma, distance, periods)
    with mp.workdps(30):
        for s in (mp.mpf(0), mp.mpf("0.3"), mp.mpf(2), periods * mp.mpf(6)):
            exact = [
                mp.diff(lambda x: mode_sum(sites, mp.mpf(gamma), distance, periods, x), s, order)
                for order in range(4)
            ]
            for value, wanted in zip(answer.at(float(s)), exact, strict=True):
                assert abs(value - float(wanted)) < 2e-13 * (1 + abs(float(wanted)))


@pytest.mark.parametrize(("sites", "gamma", "distance", "periods"), RINGS + RESONANT)
def test_its_slope_in_gamma_is_the_derivative_of_the_mean(sites, gamma, distance, periods):
    answer = table(sites, gamma, distance, periods, "gamma")
    with mp.workdps(30):
        for s in (mp.mpf(0), mp.mpf("0.7"), periods * mp.mpf(4)):
            for order in range(2):
                wanted = mp.diff(
                    lambda g, x: mode_sum(sites, g, distance, periods, x),
                    (mp.mpf(gamma), s),
                    (1, order),
                )
                off, size = abs(answer.at(float(s))[order] - float(wanted)), abs(answer.at(0.0)[0])
                assert off < 1e-11 * (1 + abs(float(wanted))) + 1e-14 * size


@pytest.mark.parametrize("gamma", [0.0, 0.001, 0.12, 0.2])
@pytest.mark.parametrize("distance", [0, 1, 7])
def test_infinite_chain_is_the_limit_of_rings(gamma, distance):
    s = np.linspace(0.0, 6.2, 15)
    near = periodic_green(Ring(240), gamma, (distance,)).at(s)
    for value, wanted in zip(periodic_green(CHAIN, gamma, (distance,)).at(s), near, strict=True):
        assert np.abs(value - wanted).max() < 2e-14


@pytest.mark.parametrize("gamma", [0.0, 0.04, 0.2, 0.2499])
def test_mid_period_is_the_papers_chi_and_sigma(gamma):
    h = periodic_green(CHAIN, gamma, (0,))
    rise = h.at(math.pi)[0] - h.at(0.0)[0]
    assert rise == pytest.approx(CHAIN.chi(gamma) / 2, rel=1e-14)
    assert h.at(math.pi)[2] == pytest.approx(-CHAIN.sigma(gamma) / 2, rel=1e-13)


def test_doubled_period_is_the_same_function_on_a_slower_clock():
    s = np.linspace(0.0, 12.0, 11)
    slow = periodic_green(CHAIN, 0.03, (1,), periods=2).at(s)
    fast = periodic_green(CHAIN, 0.12, (1,)).at(s / 2)
    assert np.abs(slow[0] - 2 * fast[0]).max() < 1e-14
    assert np.abs(slow[1] - fast[1]).max() < 1e-14


def test_infinite_chain_refuses_a_period_whose_harmonic_it_radiates():
    periodic_green(CHAIN, 0.0624, (0,), periods=2)
    with pytest.raises(BadInput, match=r"harmonic 1/2.*radiates.*gamma = 1/16"):
        periodic_green(CHAIN, 0.0626, (0,), periods=2)
