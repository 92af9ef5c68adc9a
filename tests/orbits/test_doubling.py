"""Orbits of twice the period: the cascade of a single oscillator, doubled breathers of a chain."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from contbreather.continuation import boundary, trace
from contbreather.continuation.branches.switching import switch
from contbreather.lattice import Ring
from contbreather.lattice.finite import OpenChain
from contbreather.orbits.constructors import asymmetric, shooting

from .by_hand import repeats


def first_doubling(gamma, k, a, **given):
    start = asymmetric(a, gamma, k, **given).problem
    return trace(start, "a", towards="up", within={"a": (0, 0.999)}).first("PD")


def test_a_doubled_breather_of_the_infinite_chain_is_repeated_by_a_ring():
    point = first_doubling(0.002, 0.95, 0.8)
    (branch,) = switch(point, within={"a": (0, 0.999)})
    assert branch["a"][0] == pytest.approx(point["a"], abs=1e-14)
    assert branch["a"][1] > branch["a"][0]
    assert branch[0].parent is point
    assert branch.stop.name in ("EVENT", "BOUND")
    orbit = branch[len(branch) // 2].solution
    assert orbit.admissibility().ok
    assert orbit.stability().stable
    error, half = repeats(orbit, 16)
    assert error < 1e-12
    assert half > 1e-3


def test_an_orbit_run_through_twice_has_the_squares_of_its_multipliers():
    point = first_doubling(0.002, 0.95, 0.8)
    orbit = point.solution
    big = orbit.doubled()
    assert big.residual < 1e-13
    ring = orbit.on(Ring(9))
    mu, square = ring.multipliers(), ring.doubled().multipliers()
    gaps = np.abs((mu**2)[:, None] - square)
    assert gaps.min(axis=1).max() < 1e-7
    n, t = np.arange(3)[:, None], np.linspace(0, 12, 7)
    assert np.abs(orbit.displacement(n, t) - big.displacement(n, t)).max() < 1e-13


def test_a_doubling_just_before_an_impact_vanishes_is_not_lost_in_its_pole():
    alone = {"lattice": Ring(1), "sequence": [(0, 1)], "walls": {0: (None, 0.58)}}
    given = {"a": 0.717, "gamma": 0.0, "k": 0.5, "damping": 0.02, "spring": 2.0}
    branch = trace(shooting({"t1": 1.0}, **alone, **given), "spring", within={"spring": (2, 4)})
    assert [point.kind for point in branch.special] == ["EP", "PD", "VI"]
    point = branch.first("PD")
    assert branch.first("VI")["spring"] - point["spring"] < 1e-3
    assert np.abs(point.solution.multipliers() + 1.0).min() < 1e-9


def test_curves_of_doublings_end_where_an_impact_vanishes_in_resonance():
    """What a shallow impact sets off, which grows as one over its speed, has died away when the
    next one comes if half of the oscillator's own periods fit into that of the drive."""
    loss, wall = 0.02, 0.1
    given = {"a": 1.0, "gamma": 0.0, "k": 0.8, "damping": 2 * loss, "spring": 1.0, "omega": 2.3}
    alone = {"lattice": Ring(1), "sequence": [(0, 1)], "walls": (None, wall)}
    hit = shooting({"t1": 0.0}, **alone, **given)
    doubling = trace(hit, "omega", within={"omega": (2.3, 2.6)}).first("PD")
    line = boundary(doubling, ("omega", "a"), within={"omega": (1.2, 2.6), "a": (0.1, 1.5)})
    omega, end = 2 * np.sqrt(1 - loss**2), line.first("PD-VI")
    assert line.stop.name == "BOUND"
    assert end["omega"] == pytest.approx(omega, abs=1e-12)
    # there the oscillation without impacts touches the wall
    touching = wall * np.hypot(1 - omega**2, 2 * loss * omega)
    assert end["a"] == pytest.approx(touching, abs=1e-12)


@pytest.mark.slow
def test_where_an_impact_vanishes_doublings_are_met_from_both_curves():
    """The multipliers that stay finite are those of the free flight in which the site that hits is
    at its wall when it begins and ends."""
    given = {"gamma": 0.2, "k": 0.74, "damping": 0.06, "spring": 0.5, "walls": (None, 0.4)}
    chain = {"lattice": OpenChain(2), "sequence": [(0, 1)], "a": 1.0, "omega": 1.7}
    branch = trace(shooting({"t1": 0.6}, **chain, **given), "omega", within={"omega": (1.4, 1.8)})
    window = {"omega": (1.4, 1.74), "a": (0.1, 5)}
    doubling, vanishing = (
        boundary(branch.first(kind), ("omega", "a"), within=window) for kind in ("PD", "VI")
    )
    ends = [point for point in doubling.special if point.kind == "PD-VI"]
    met = [point for point in vanishing.special if point.kind == "VI-PD"]
    assert len(ends) == len(met) == 2
    for one, other in zip(ends, met, strict=True):
        assert [one["omega"], one["a"]] == pytest.approx([other["omega"], other["a"]], abs=1e-10)
        # in time of the drive: u'' + damping u' + K u = 0 with K of two sites
        w = other["omega"]
        pull = (0.5 * np.eye(2) + 0.2 * np.array([[1, -1], [-1, 1]])) / w**2
        free = np.block([[np.zeros((2, 2)), np.eye(2)], [-pull, -0.06 / w * np.eye(2)]])
        flown, others = expm(2 * np.pi * free), [1, 3]
        # the velocity of the site that hits is what brings it back to its wall
        back = np.outer(flown[others, 2], flown[0, others]) / flown[0, 2]
        finite = np.linalg.eigvals(flown[np.ix_(others, others)] - back)
        assert abs(finite + 1).min() < 1e-8
