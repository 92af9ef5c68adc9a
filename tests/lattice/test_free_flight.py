"""The forced response in closed form against the sum over modes and the equation of motion."""

from __future__ import annotations

import math

import mpmath as mp
import pytest

from contbreather.lattice import InfiniteChain, Ring
from tests.lattice.by_hand import response, ring_mean

CHAIN = InfiniteChain()
NEAR = 1e-9
TIMES = [0.0, NEAR, 0.4, 1.7, math.pi - NEAR]


def mode_sum(gamma, n, s, sites):
    """v, v', v'' at 30 digits over the modes of a ring, the impacts in floating point pi."""
    with mp.workdps(30):
        y = mp.pi / 2 - mp.mpf(s)
        modes = (
            lambda w: mp.sin(w * y) / (w * mp.cos(mp.pi * w / 2)) if w else y,
            lambda w: -mp.cos(w * y) / mp.cos(mp.pi * w / 2),
            lambda w: -w * mp.sin(w * y) / mp.cos(mp.pi * w / 2),
        )
        return [ring_mean(of, gamma, sites, n) for of in modes]


@pytest.mark.parametrize("gamma", [0.0, 0.07, 0.2499])
@pytest.mark.parametrize("sites", [1, 2, 10, 11])
@pytest.mark.parametrize("n", [0, 1, 4])
def test_response_of_a_ring_is_the_sum_over_its_modes(gamma, sites, n):
    for s in TIMES:
        got = response(Ring(sites), gamma, n, s)
        exact = mode_sum(gamma, n, s, sites)
        scale = float(Ring(sites).first_harmonic(gamma, 0))
        assert max(abs(float(x) - y) for x, y in zip(got, exact, strict=True)) < 3e-15 * scale


@pytest.mark.parametrize(("gamma", "n"), [(0.12, 0), (0.12, 1), (0.12, 300), (0.2499, 2)])
def test_response_of_the_chain_is_that_of_a_ring_too_long_to_go_round(gamma, n):
    r = math.sqrt(1 - 4 * gamma)
    laps = int(38 / (2 * math.atanh(r))) + 2 * n
    for s in (0.0, NEAR, 2.0):
        got = response(CHAIN, gamma, n, s)
        exact = mode_sum(gamma, n, s, laps)
        assert max(abs(float(x) - y) for x, y in zip(got, exact, strict=True)) < 1e-15 / r


@pytest.mark.parametrize("gamma", [1e-6, 0.1, 0.2499])
@pytest.mark.parametrize("sites", [None, 1, 2, 9, 60])
def test_slope_of_a_flight_in_gamma_is_that_of_the_sum_over_modes(gamma, sites):
    lattice = Ring(sites) if sites else CHAIN
    size = sites or int(45 / (2 * math.atanh(math.sqrt(1 - 4 * gamma)))) + 20
    scale = lattice.slope(gamma, "chi") + 1.0
    for n, s in ((0, 0.0), (0, 2.27), (3, 2.27)):
        with mp.workdps(30):
            h = mp.mpf(10) ** -12
            more, less = (mode_sum(gamma + x, n, s, size) for x in (h, -h))
            exact = [float((a - b) / (2 * h)) for a, b in zip(more, less, strict=True)]
        slope = response(lattice, gamma, n, s, "gamma")
        assert slope == pytest.approx(exact, abs=5e-15 * scale)
