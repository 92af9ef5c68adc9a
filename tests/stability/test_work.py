"""How many places are looked at for an answer: a tenth more than it takes would be noticed."""

from __future__ import annotations

import contbreather as cb
from contbreather.stability.chain_map import OrbitMap
from tests.stability.half import unstable_multipliers

UNSTABLE = (0.11, 0.8, -0.28657)
STABLE = (0.05, 0.8, 0.2)


def test_multipliers_of_the_chain_are_found_from_a_few_starts(counted) -> None:
    calls = counted(OrbitMap, "F")
    assert unstable_multipliers(*UNSTABLE).size == 2
    assert calls["calls"] <= 20
    assert calls["places"] <= 530
    calls.clear()
    assert unstable_multipliers(*STABLE).size == 0
    assert calls["places"] == 0  # where there is none, nothing is looked for


def test_multipliers_of_an_orbit_are_found_from_a_few_starts(counted) -> None:
    calls = counted(OrbitMap, "F")
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
