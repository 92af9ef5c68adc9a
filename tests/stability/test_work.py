"""How many places are looked at for an answer: a tenth more than it takes would be noticed."""

from __future__ import annotations

import numpy as np
import pytest

import contbreather as cb
from contbreather.lattice import Ring
from contbreather.stability import (
    counting,
    half_multipliers,
    ring_multipliers,
    unstable_count,
    unstable_multipliers,
)
from contbreather.stability.chain_map import OrbitMap

UNSTABLE = (0.11, 0.8, -0.28657)
STABLE = (0.05, 0.8, 0.2)


@pytest.mark.parametrize(
    ("at", "most"), [((0.1, 0.8, 0.1), 96), (UNSTABLE, 71), (STABLE, 71), ((0.15, 0.8, 0.3), 104)]
)
def test_the_circle_is_sampled_where_the_characteristic_function_turns(at, most) -> None:
    arc, F, _ = counting.resolved_arc(*at)
    assert 65 <= arc.nu.size <= most
    turn = np.abs(np.angle(F[1:] * F[:-1].conj()))
    assert turn.max() < 1.0


def test_multipliers_of_the_chain_are_found_from_a_few_starts(counted) -> None:
    calls = counted(counting, "_slopes")
    assert unstable_multipliers(*UNSTABLE).size == 2
    assert calls["calls"] <= 15
    assert calls["places"] <= 268
    calls.clear()
    assert unstable_multipliers(*STABLE).size == 0
    assert calls["places"] == 0  # where there is none, nothing is looked for


def test_waves_of_a_ring_are_found_in_four_steps(counted) -> None:
    calls = counted(ring_multipliers, "_wave_step")
    assert half_multipliers(Ring(40), *UNSTABLE).size == 80
    assert calls["calls"] <= 5
    assert calls["places"] <= 55


def test_a_count_on_a_ring_takes_places_in_proportion_to_its_waves(counted) -> None:
    calls = counted(counting, "D")
    assert unstable_count(*UNSTABLE, Ring(40), radius=1.0025).count == 22
    assert calls["calls"] <= 10
    assert calls["places"] <= 1030


def test_multipliers_of_an_orbit_are_found_from_a_few_starts(counted) -> None:
    calls = counted(OrbitMap, "D")
    orbit = OrbitMap(0.11, 0.8, [(0, 0.0, -0.5), (0, 3.0, -0.5)])
    assert orbit.unstable_multipliers().size == 2
    assert calls["calls"] <= 126
    assert calls["places"] <= 3200


def test_margins_of_a_breather_are_found_on_a_grid_of_its_highest_harmonic(counted) -> None:
    calls = counted(cb.Harmonic, "f")
    assert cb.symmetric(0.5, 0.04, 0.8).admissibility().ok
    assert calls["places"] <= 153
    more = counted(cb.Fourier, "f")
    cb.symmetric(0.5, 0.04, 0.8, forcing=cb.Fourier(cos={1: -1.0, 3: 0.1})).admissibility()
    assert more["places"] <= 198


def test_margins_of_an_asymmetric_orbit_take_twice_as_many_places(counted) -> None:
    branch = cb.trace(cb.symmetric(0.7, 0.04, 0.8), "a", within={"a": (0.5, 0.9)})
    arm = cb.switch(branch.first("PF"), within={"a": (0.5, 0.85)})[0]
    calls = counted(cb.Harmonic, "f")
    assert arm[-1].solution.admissibility().ok
    assert calls["places"] <= 323
