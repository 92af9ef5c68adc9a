"""What is compiled says the same as it is, and shares its constants with the arrays beside it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from contbreather.kernels import Kernel
from contbreather.lattice import free_flight
from contbreather.orbits import closure_kernels
from contbreather.stability import arc
from contbreather.stability.characteristic import D
from contbreather.stability.half_period import HalfMap

RANDOM = np.random.default_rng(3)
PLACES = [(0.24 * x + 1e-3, y) for x, y in RANDOM.random((12, 2))]
# a pair of roots just opened, or not yet, between two nodes of the grid
# where two roots have met, to seven digits of k, and opened: both between two nodes
PLACES += [(0.1, 0.781761944709733 + 1e-7), (0.1, 0.781761944709733 + 1e-5)]
PLACES += [(0.0969, 0.8), (0.09514, 0.8), (0.0951, 0.8), (1e-6, 0.9), (0.2499, 0.5)]


def test_a_flight_has_as_many_powers_compiled_as_not() -> None:
    assert closure_kernels.POWERS == free_flight.POWERS
    assert closure_kernels.TERMS == free_flight.TERMS + 1


@pytest.mark.parametrize("spring", [0.0, 0.3])
@pytest.mark.parametrize(("gamma", "k"), PLACES)
def test_compiled_or_not_the_equations_of_a_pair_and_its_window_are_the_same(
    gamma: float, k: float, spring: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    gamma *= 1.0 - spring
    nu = math.sqrt(spring + 1.7 * gamma)

    def told() -> tuple[list[float], ...]:
        arc.window.cache_clear()
        equations = np.ravel(arc.on_arc(gamma, nu, k, 0.7 - 3.0 * gamma, spring)).tolist()
        return equations, [*arc.window(gamma, k, spring)]

    found = told()
    monkeypatch.setattr(Kernel, "code", lambda kernel: None)
    assert told() == found


@pytest.mark.parametrize(("gamma", "k"), PLACES)
def test_the_window_of_b_in_which_a_pair_is_outside_ends_where_f_vanishes(
    gamma: float, k: float
) -> None:
    found, points = arc.window(gamma, k), arc.neimark_sacker(gamma, k)
    if found.square < 0.0:
        assert points == ()
        return
    low, high = sorted(points, key=lambda point: point.b)
    assert (found.low, found.high) == (low.nu, high.nu)
    for nu, b in points:
        assert abs(found.miss(b)) < 1e-13 * (1.0 + abs(found.centre))
        assert abs(arc.on_arc(gamma, nu, k, b).value).max() < 1e-13 * (1.0 + b * b)


@pytest.mark.parametrize("b", [-0.4, 0.6])
def test_on_the_band_a_half_map_is_asked_by_its_equations(b: float) -> None:
    half = HalfMap(0.1, 0.8, b)
    for nu in (0.1, 0.4):
        real, imag = arc.on_arc(0.1, nu, 0.8, b).value
        assert half.on_circle(nu) == complex(real, imag)
        assert half.on_circle(nu) != half.on_circle(nu, 1.1)
        assert half.on_circle(nu, 1.1) == D(0.1, nu - 1j * math.log(1.1) / math.pi, 0.8, b)
