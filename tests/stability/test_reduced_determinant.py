"""Multipliers next to a circle by the reduced determinant, against all of them at once."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from contbreather.lattice import Ring
from contbreather.lattice.finite import Grid
from contbreather.stability.modal_map import ModalMap
from contbreather.stability.saltation import Saltation
from contbreather.stability.zeros import REAL, beyond, outermost
from tests.stability.by_hand import ring_map

ONE = (Saltation(0, 0.0, 0.3),)
ARM = (Saltation(0, 0.0, 0.5), Saltation(0, 2.9, 0.2))
PAIR = (
    Saltation(0, 0.0, 0.9),
    Saltation(5, 1.2, -0.4),
    Saltation(0, 3.1, 0.8),
    Saltation(5, 4.4, 0.1),
)


def grid_map(damping: float) -> ModalMap:
    import contbreather as cb

    on = {"a": 0.6, "gamma": 0.03, "k": 0.8, "spring": 0.2, "damping": damping}
    return cb.symmetric(**on, lattice=Grid(6, 6), site=14).representation.map


FAR = (Saltation(3, 3.2, -2.2),)  # a pair of modulus 2, and eight more just outside
MAPS = {
    "far outside": ring_map(Ring(109), 0.0916, 0.378, FAR),
    "one impact": ring_map(Ring(40), 0.04, 0.8, ONE),
    "many outside": ring_map(Ring(40), 0.12, 0.8, ONE),
    "two impacts": ring_map(Ring(40), 0.08, 0.8, ARM),
    "two sites": ring_map(Ring(40), 0.06, 0.8, PAIR),
    "a grid": grid_map(0.0),
    "with damping": grid_map(0.02),
}


@pytest.mark.parametrize("name", MAPS)
def test_the_reduced_determinant_is_the_product_over_all_multipliers(name: str) -> None:
    map, mu = MAPS[name], np.array([1.3, -1.2, 0.7 + 1.1j, -0.4 + 1.2j])
    poles = map.reduced.poles
    free = np.concatenate([poles, poles.conj()])
    wanted = [np.prod((map.coupled - one) / (free - one)) for one in mu]
    assert map.reduced.D(mu) == pytest.approx(np.array(wanted), rel=1e-9)


@pytest.mark.parametrize("threshold", [1.005, 1.05, 1.2])
@pytest.mark.parametrize("name", MAPS)
def test_the_first_pair_to_leave_is_that_of_all_multipliers(name: str, threshold: float) -> None:
    map, determinant = MAPS[name], MAPS[name].reduced
    mu = map.coupled
    found, wanted = determinant.outermost(threshold), outermost(mu[mu.imag > 1e-8], threshold)
    floor = abs(determinant.poles).max() / threshold - 1.0
    assert found is not None
    if wanted > -1e-3 * (threshold - 1.0) or found > floor:
        assert found == pytest.approx(wanted, abs=1e-9)
    assert (found > 0.0) == (wanted > 0.0)
    around = determinant.around(threshold)
    assert around is not None
    assert around.outside == np.count_nonzero(abs(mu) > threshold)


@pytest.mark.parametrize("name", MAPS)
@pytest.mark.parametrize("place", [1.001, 1.1, -1.001, -1.1])
def test_real_multipliers_beyond_a_place_are_counted(name: str, place: float) -> None:
    assert MAPS[name].reduced.beyond(place) == beyond(MAPS[name].coupled, place)


# rings with two real multipliers on one side, 0.04, 0.02 and 0.00001 apart: b is tuned so that the
# last two all but meet, far closer to each other than the places that are looked at first
TWINS = {
    "next to the circle": (
        132,
        0.18,
        0.613,
        (Saltation(0, 0.45, -0.625), Saltation(0, 8.625, -0.439)),
    ),
    "next to another": (
        61,
        0.081,
        0.586,
        (Saltation(0, 6.474, 1.012), Saltation(32, 10.127, 5.37)),
    ),
    "about to meet": (
        61,
        0.081,
        0.586,
        (Saltation(0, 6.474, 1.841105), Saltation(32, 10.127, 5.37)),
    ),
}


@pytest.mark.parametrize("name", TWINS)
def test_two_real_multipliers_close_to_each_other_are_two(name: str) -> None:
    sites, gamma, k, kicks = TWINS[name]
    turns = 1 + (kicks[-1].time > 2.0 * math.pi)
    map = ring_map(Ring(sites), gamma, k, kicks, 2.0 * math.pi * turns)
    count = [map.reduced.beyond(place) for place in (1.000001, -1.000001)]
    assert count == [beyond(map.coupled, 1.0), beyond(map.coupled, -1.0)]
    assert max(count) >= 2


@pytest.mark.parametrize("radius", [1.0, 1.005])
@pytest.mark.parametrize("sites", [40, 100, 200])
def test_of_small_and_large_lattices_the_same_is_told_next_to_a_circle(sites: int, radius: float):
    map = ring_map(Ring(sites), 0.13, 0.8, ARM)
    told = map.outermost(radius), map.beyond(1.0), map.beyond(-1.0)
    mu = np.linalg.eigvals(map.matrix)
    wanted = outermost(mu[mu.imag > REAL], radius), beyond(mu, 1.0), beyond(mu, -1.0)
    assert told == pytest.approx(wanted, abs=1e-9)


@pytest.mark.parametrize(("side", "within"), [(1.0, (0.3, 0.5)), (-1.0, (-1.0, -0.75))])
def test_a_real_multiplier_next_to_the_circle_is_on_its_side(side, within):
    def at(b: float) -> ModalMap:
        return ring_map(Ring(100), 0.04, 0.8, (Saltation(0, 0.0, b),))

    def largest(b: float) -> float:
        mu = at(b).coupled
        return float((side * mu.real[mu.imag == 0.0]).max(initial=0.0))

    for size in (1.004, 0.996):
        map = replace(at(brentq(lambda b, size=size: largest(b) - size, *within, xtol=1e-6)))
        assert map.beyond(side) == (size > 1.0)  # it knows no multiplier yet
        assert map.beyond(-side) == 0
        assert map.beyond(side * 1.003) == (size > 1.003)
