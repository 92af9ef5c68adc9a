"""How close is close, of orbits: on either side of every tolerance, neither may be ten thousand
times larger or smaller."""

from __future__ import annotations

import math
from dataclasses import replace

import networkx as nx
import numpy as np
import pytest

import contbreather as cb
from contbreather.lattice.conditions import Conditions
from contbreather.orbits.constructors import asymmetric
from contbreather.orbits.orbit import Orbit, orbit_at
from contbreather.orbits.section import Section, check_both_walls
from contbreather.orbits.symmetries import simpler_than

B = cb.symmetric(0.7, 0.04, 0.8)


def late(orbit: Orbit, by: float, harder: float = 0.0) -> Orbit:
    """With its last impact a little later, and harder."""
    *others, last = orbit.impacts
    moved = last._replace(time=last.time + by, impulse=last.impulse * (1.0 + harder))
    return Orbit(replace(orbit.representation, impacts=(*others, moved)))


def test_halves_that_are_alike() -> None:
    whole, twice = B.unfolded(), B.unfolded().doubled()
    assert [late(twice, by).repeats for by in (1e-9, -1e-9, 1e-5)] == [1, 1, 0]
    assert [simpler_than(late(whole, by)) is None for by in (1e-9, -1e-9, 1e-5)] == [0, 0, 1]
    labels = [late(whole, by).problem.label for by in (1e-11, -1e-11, 1e-7)]
    assert labels == ["orbit with impacts", "orbit with impacts", "asymmetric breather"]
    assert late(whole, 0.0, 1e-11).p == pytest.approx(B.p)
    with pytest.raises(cb.BadInput, match="different momenta"):
        _ = late(whole, 0.0, 1e-7).p


def test_a_spring_brings_sites_back_from_a_strength_on() -> None:
    one = Section(((0, 1),))
    check_both_walls(one, Conditions(0.5, 0.1, 0.8, spring=1e-5))
    with pytest.raises(cb.BadInput, match="only: every impact"):
        check_both_walls(one, Conditions(0.5, 0.1, 0.8, spring=1e-7))


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_seed_may_be_behind_a_wall_by_rounding(side: float) -> None:
    on = {"a": 0.7, "gamma": 0.04, "k": 0.8}
    b = cb.symmetric(**on, site=1, lattice=cb.Ring(3))
    t = b.times[0] + (0.0 if side > 0.0 else math.pi)
    u, v = b.state(t=t)
    v[1] /= -b.k  # just before its impact
    u[1] = side * (1.0 + 1e-7)
    assert orbit_at(cb.shooting((u, v), t=t, **on)).p == pytest.approx(b.p, abs=1e-9)
    u[1] = side * (1.0 + 1e-4)
    with pytest.raises(
        cb.BadInput, match=r"u\[1\] = .* of the seed is outside the walls at -1 and"
    ):
        cb.shooting((u, v), t=t, **on)


def test_a_mode_is_in_resonance_with_half_a_period_to_rounding_only() -> None:
    on = {"a": 0.5, "k": 0.8, "lattice": cb.OpenChain(2)}  # its second mode has w^2 = 2 gamma
    assert cb.symmetric(**on, gamma=0.5 * (1 - 1e-5)).p < 1e-3
    with pytest.raises(cb.BadInput, match="in resonance with the orbit"):
        cb.symmetric(**on, gamma=0.5 * (1 + 1e-8))


@pytest.mark.parametrize(("off", "seen"), [(0.0, 2), (1e-13, 2), (1e-6, 3), (1e-3, 3)])
def test_modes_of_one_frequency_are_one_space(off: float, seen: int) -> None:
    """Of a star with three arms the hub moves two modes; a third, if they differ."""
    star = nx.star_graph(3)
    nx.set_edge_attributes(star, {(0, 1): 1.0, (0, 2): 1.0, (0, 3): 1.0 + off}, "weight")
    basis = cb.Lattice.from_graph(star).basis((0,))
    assert (basis.lam.size, basis.unseen.size) == (seen, 4 - seen)
    assert basis.unseen == pytest.approx(np.ones(4 - seen), abs=1e-12)  # of the two alike arms
    assert np.sort([*basis.lam, *basis.unseen]) == pytest.approx([0, 1, 1, 4], abs=2 * off + 1e-12)


@pytest.mark.parametrize("gamma", [1e-4, 1e-7, 1e-12, 0.0])
def test_pitchforks_of_rings_are_seen_down_to_no_coupling_at_all(gamma: float) -> None:
    """There all other sites have a multiplier 1 of their own."""
    shot = cb.shooting(cb.symmetric(0.7, gamma, 0.8), sites=4)
    branch = cb.trace(shot, "a", within={"a": (0.65, 0.8)})
    alone = 0.691778556508  # of the single oscillator
    assert branch.first("PF")["a"] == pytest.approx(alone, abs=3 * gamma + 1e-9)


def test_arms_close_to_their_pitchfork_are_no_symmetric_orbits() -> None:
    fork = cb.trace(B, "a", within={"a": (0.6, 0.8)}).first("PF")["a"]
    arm = asymmetric(fork + 1e-7, 0.04, 0.8)
    assert 1e-5 < arm.asymmetry < 1e-2
    assert simpler_than(arm) is None
