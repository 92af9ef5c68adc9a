"""What the panels say of an orbit is what the library says of it."""

from __future__ import annotations

import math

import numpy as np
import pytest

import contbreather as cb
from contbreather.explorer import summary
from contbreather.explorer.state import Named

B = cb.symmetric(a=0.5, gamma=0.08, k=0.8)


def test_profile_has_the_site_that_impacts_at_its_wall() -> None:
    found = summary.profile(B)
    centre = list(found.sites).index(0)
    assert found.at_impact[centre] == pytest.approx(1.0, abs=1e-14)
    assert found.highest[centre] == pytest.approx(1.0, abs=1e-12)
    assert found.highest[centre + 1] == pytest.approx(B.admissibility().max_neighbour, abs=1e-4)
    np.testing.assert_array_equal(found.walls, np.tile([-1.0, 1.0], (found.sites.size, 1)))


def test_curves_are_named_by_what_not_all_of_them_share() -> None:
    window = {"a": (0.49, 0.51), "gamma": (0.07, 0.09)}
    curves = [
        Named(f"branch{i}", cb.trace(orbit, free, within={free: window[free]}))
        for i, (orbit, free) in enumerate([(B, "a"), (B.on(cb.Ring(12)), "a"), (B, "gamma")])
    ]
    assert summary.names(curves[:1]) == {"branch0": "branch0"}
    assert list(summary.names(curves[:2])) == ["branch0: infinite chain", "branch1: ring of 12"]
    assert list(summary.names(curves)) == [
        "branch0: in a, infinite chain, gamma = 0.08",
        "branch1: in a, ring of 12, gamma = 0.08",
        "branch2: in gamma, infinite chain, a = 0.5",
    ]


def test_small_lattices_are_shown_whole() -> None:
    ends = cb.symmetric(a=0.6, gamma=0.05, k=0.8, lattice=cb.OpenChain(9), site=0, damping=0.01)
    assert list(summary.profile(ends).sites) == list(range(9))
    assert list(summary.profile(B.on(cb.Ring(20))).sites) == list(range(20))


def test_motion_marks_every_impact_on_its_wall() -> None:
    found = summary.sites_wanted(B, (0, 1))
    assert {(site, wall) for site, _, wall in found.hits} == {(0, -1.0), (0, 1.0)}
    for site, time, wall in found.hits:
        assert B.displacement(site, 2 * np.pi * time) == pytest.approx(wall, abs=1e-12)
    assert found.walls == (-1.0, 1.0)


def test_sites_that_a_lattice_lacks_are_left_out() -> None:
    ring = B.on(cb.Ring(10))
    assert list(summary.sites_wanted(ring, (0, 3, 40)).by_site) == [0, 3]
    assert list(summary.sites_wanted(ring, (-1,)).by_site) == [-1]
    assert list(summary.sites_wanted(ring, (40,)).by_site) == [0]


def test_multipliers_of_a_symmetric_breather_are_those_of_half_a_period() -> None:
    found = summary.multipliers_shown(B, 100)
    np.testing.assert_array_equal(found.mu, B.multipliers(sites=100, half=True))
    assert found.about == "over half a period, ring of 100"
    edge = math.tau * 0.08**0.5  # exp(+-i pi w), w up to 2 sqrt(gamma)
    assert np.angle(found.waves[:, -1]) == pytest.approx([edge, -edge])
    assert found.alone.sum() == 2


def test_multipliers_of_a_finite_lattice_are_its_own() -> None:
    damped = cb.symmetric(a=0.6, gamma=0.05, k=0.8, lattice=cb.Ring(12), damping=0.02)
    found = summary.multipliers_shown(damped, 400)
    assert found.mu.size == 24
    assert np.median(abs(found.waves)) == pytest.approx(math.exp(-0.01 * math.pi))  # half a period


def test_verdicts_are_those_of_the_library() -> None:
    said = dict(summary.verdicts(B, 400))
    assert said["own lattice"] == B.stability().describe()
    assert said["ring of 400"] == B.stability(sites=400).describe()
    assert f"{B.stability().over_reflection.growth:.6g}/N" in said["over-reflection"]
    assert said["admissible"] == B.admissibility().reason


def test_nothing_is_said_of_the_stability_of_what_goes_through_a_wall() -> None:
    through = cb.symmetric(a=0.9, gamma=0.08, k=0.8, root=1)
    said = dict(summary.verdicts(through, 400))
    assert said["not admissible"] == through.admissibility().reason
    assert said["stability"].startswith("nothing is said of it")
    assert len(said) == 2


def test_arms_are_described_by_their_impacts() -> None:
    arm = cb.switch(
        cb.trace(cb.symmetric(a=0.7, gamma=0.04, k=0.8), "a", within={"a": (0.7, 0.9)}).first("PF")
    )[0]
    names = [name for name, _ in arm[3].solution.table().rows]
    assert names == ["a", "gamma", "k", "t1", "impulse 1", "t2", "impulse 2", "c"]
    assert "over-reflection" not in dict(summary.verdicts(arm[3].solution, 60))
