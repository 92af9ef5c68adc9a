"""Springs to the ground on the infinite chain: closed forms, rings, an integrator."""

from __future__ import annotations

import math

import numpy as np
import pytest

import contbreather as cb
from contbreather.lattice import InfiniteChain
from contbreather.lattice.conditions import spring_response
from contbreather.orbits import neighbour_peak, smallest_amplitude
from contbreather.stability.one_impact import window
from tests.orbits.field import Field


def at_pitchfork(b: cb.Orbit) -> float:
    """The momentum that theory has there: ``1/p = chi - 2 sigma - q^2/tau``."""
    chain, q = InfiniteChain(b.spring), (1 - b.k) / (1 + b.k)
    return 1 / (chain.chi(b.gamma) - 2 * chain.sigma(b.gamma) - q * q / chain.tau(b.gamma))


def branch_in_a(spring: float, gamma: float, k: float = 0.8) -> cb.Branch:
    start = cb.symmetric(0.5 * (1 - spring), gamma, k, spring=spring)
    return cb.trace(start, "a", within={"a": (0.01, 1.5)}, towards="both")


@pytest.mark.parametrize(("spring", "gamma", "k"), [(0.2, 0.05, 0.8), (0.6, 0.05, 0.3)])
def test_amplitude_fold_and_pitchfork_are_those_of_the_theory(spring, gamma, k) -> None:
    chain, q = InfiniteChain(spring), (1 - k) / (1 + k)
    chi = chain.chi(gamma)
    fold = (1 - spring) * q / math.hypot(chi, q)
    least = smallest_amplitude(gamma, k, spring_response(cb.Harmonic(), spring))
    assert least == pytest.approx(fold, abs=1e-12)
    for a in (1.1 * fold, 0.9 * (1 - spring)):
        for b in cb.orbits.symmetric_roots(a, gamma, k, spring=spring):
            assert b.residual < 1e-14
            assert a / (1 - spring) == pytest.approx(math.hypot(1 - b.p * chi, b.p * q), abs=1e-13)
            assert b.chi == chi


@pytest.mark.parametrize(("spring", "gamma", "k"), [(0.02, 0.02, 0.8), (0.1, 0.005, 0.4)])
def test_the_pitchfork_depends_on_the_loss_where_springs_hold_the_chain(spring, gamma, k) -> None:
    branch = branch_in_a(spring, gamma, k)
    fork = branch.first("PF")
    assert fork["p"] == pytest.approx(at_pitchfork(fork.solution), abs=1e-10)
    counts = [
        cb.symmetric(fork["a"] + e, gamma, k, spring=spring).stability().unstable
        for e in (-1e-6, 1e-6)
    ]
    assert abs(counts[0] - counts[1]) == 1
    near = fork.solution.multipliers(sites=60, half=True)
    assert abs(near - 1).min() < 1e-6


@pytest.mark.parametrize("seed", range(6))
def test_any_forcing_spring_and_loss_agree_with_the_modes_of_a_ring(seed: int) -> None:
    rng = np.random.default_rng(seed)
    spring, k = rng.uniform(0.01, 0.8), rng.uniform(0, 1)
    gamma = rng.uniform(0.005, 0.15) * (1 - spring)
    cos = {1: 1.0, 3: rng.uniform(-0.3, 0.3), 5: rng.uniform(-0.1, 0.1)}
    forcing = cb.Fourier.from_response(cos=cos, sin={3: rng.uniform(-0.3, 0.3)})
    a = rng.uniform(0.6, 0.9) * (1 - spring)
    for b in cb.orbits.symmetric_roots(a, gamma, k, spring=spring, forcing=forcing):
        own = b.on(cb.Ring(48))
        assert (own.p, own.phi) == pytest.approx((b.p, b.phi), abs=1e-11)
        n, t = np.arange(4)[:, None], np.linspace(0, 7, 9)
        for order in ("displacement", "velocity", "acceleration"):
            both = (getattr(one, order)(n, t) for one in (own, b))
            assert next(both) == pytest.approx(next(both), abs=1e-10)
        margins, theirs = b.admissibility(), own.admissibility()
        assert margins.neighbours == pytest.approx(theirs.neighbours, abs=1e-9)
        assert margins.centre == pytest.approx(theirs.centre, abs=1e-9)
        for mu in b.stability().multipliers:
            if abs(mu) > 1.1:
                assert abs(own.multipliers(half=True) - mu).min() < 1e-6


def test_neimark_sacker_points_are_ends_of_the_window_and_seen_on_a_ring() -> None:
    branch = branch_in_a(0.3, 0.05)
    points = [point for point in branch.special if point.kind == "NS"]
    assert len(points) == 2
    ring = []
    for point in points:
        b = point.solution
        assert abs(window(b.gamma, b.k, 0.3).miss(b.representation.b)) < 1e-10
        pairs = [
            cb.symmetric(point["a"] + e, 0.05, 0.8, spring=0.3).stability().unstable
            for e in (-1e-6, 1e-6)
        ]
        assert sorted(pairs) == [0, 2]
        assert math.sqrt(0.3) < point["nu"] < math.sqrt(0.5)
        ring.append(point["a"])
    inside = cb.symmetric(0.5 * sum(ring), 0.05, 0.8, spring=0.3)
    mu = inside.stability().multipliers
    assert inside.stability(sites=300).largest == pytest.approx(abs(mu[0]) ** 2, rel=2e-3)
    assert inside.stability().over_reflecting


@pytest.mark.slow
def test_the_spring_is_traced_and_freed_in_boundaries() -> None:
    branch = branch_in_a(0.02, 0.02)
    within = {"spring": (0.01, 0.06)}
    for kind in ("LP", "PF", "GR"):
        line = cb.boundary(branch.first(kind), ("spring", "a"), within=within, towards="both")
        assert not line.stop.failed
        assert np.ptp(line["spring"]) > 0.01
        for point in line:
            b = point.base_point.solution
            assert b.residual < 1e-11
            if kind == "LP":
                least = smallest_amplitude(b.gamma, b.k, spring_response(b.forcing, b.spring))
                assert b.a == pytest.approx(least, abs=1e-10)
            elif kind == "PF":
                assert b.p == pytest.approx(at_pitchfork(b), abs=1e-9)
            else:
                assert neighbour_peak(b)[1] == pytest.approx(1, abs=1e-9)
    point = next(p for p in branch_in_a(0.3, 0.05).special if p.kind == "NS")
    line = cb.boundary(point, ("spring", "a"), within={"spring": (0.28, 0.32)})
    assert np.ptp(line["spring"]) > 0.02
    assert not line.stop.failed
    for point in line:
        b = point.base_point.solution
        assert abs(window(b.gamma, b.k, b.spring).miss(b.representation.b)) < 1e-9


def test_a_spring_is_traced_from_none() -> None:
    start = cb.symmetric(0.5, 0.08, 0.8)
    assert "spring" not in start.problem.params
    branch = cb.trace(start, "spring", within={"spring": (0, 0.1)})
    assert branch[-1]["spring"] == pytest.approx(0.1)
    there = cb.symmetric(0.5, 0.08, 0.8, spring=0.1)
    assert branch[-1].solution.p == pytest.approx(there.p, abs=1e-12)


@pytest.mark.parametrize(
    ("more", "says"),
    [
        ({"spring": 0.85}, r"\[spring, spring \+ 4 gamma\] of w\^2 must stay below 1"),
        ({"spring": 1.3}, "0 <= spring < 1"),
        ({"spring": -0.1}, "0 <= spring"),
        ({"spring": 0.1, "damping": 0.1}, "without damping"),
        ({"lattice": InfiniteChain(0.1)}, r"lattice = InfiniteChain\(0\.1\): .* by spring="),
    ],
)
def test_what_the_chain_cannot_be_held_by_is_refused(more, says) -> None:
    with pytest.raises(cb.BadInput, match=says):
        cb.symmetric(0.1, 0.05, 0.8, **more)


def test_what_is_not_known_of_springs_says_where_it_is() -> None:
    start = cb.symmetric(0.5, 0.02, 0.8, spring=0.02)
    with pytest.raises(cb.BadInput, match="one site hits its walls in turn; take a finite lattice"):
        cb.switch(cb.trace(start, "a", towards="up").first("PF"))
    found = cb.diagram(start, "a", within={"a": (0.45, 0.8)})  # what cannot be followed is said
    assert "1 arm not followed" in repr(found)


def fork(spring: float) -> cb.continuation.Point:
    start = cb.symmetric(0.7, 0.05, 0.8, spring=spring)
    return cb.trace(start, "a", within={"a": (0.5, 0.9)}).first("PF")


@pytest.mark.parametrize("pair", [("spring", "a"), ("a", "spring"), ("spring", "gamma")])
def test_the_curve_of_pitchforks_begins_without_a_spring(pair) -> None:
    free = fork(0.0)
    line = cb.boundary(free, pair, within={"spring": (0, 0.05)}, towards="up")
    assert line["spring"][[0, -1]] == pytest.approx([0, 0.05], abs=1e-15)
    for point in line[1:]:
        b = point.base_point.solution
        assert b.p == pytest.approx(at_pitchfork(b), abs=1e-10)


def test_pitchforks_begin_like_the_root_of_the_spring() -> None:
    """With ``1/tau = pi edge sqrt(gamma)`` at first: a regular curve in the edge of the band."""
    a = fork(0.0)["a"]
    line = cb.boundary(fork(0.03), ("spring", "a"), within={"spring": (0, 0.05)}, towards="down")
    assert line[-1]["spring"] == pytest.approx(0, abs=1e-20)
    assert line[-1]["a"] == pytest.approx(a, abs=1e-12)
    start = cb.Steps(first=1e-5, largest=1e-5, most=2)
    near = cb.boundary(fork(0.0), ("spring", "a"), towards="up", steps=start)[1]
    assert near["edge"] == pytest.approx(math.sqrt(near["spring"]), rel=1e-9)
    chain, q = InfiniteChain(), 1 / 9
    p, sigma = 1 / (chain.chi(0.05) - 2 * chain.sigma(0.05)), chain.sigma(0.05)
    # of a = sqrt((1 - p chi)^2 + p^2 q^2), 1/p = chi - 2 sigma - q^2/tau
    rise = p * p * q * q * math.pi * math.sqrt(0.05)
    slope = ((p * chain.chi(0.05) - 1) * chain.chi(0.05) + p * q * q) * rise / a
    assert 1 - p * chain.chi(0.05) == pytest.approx(-2 * p * sigma, abs=1e-14)
    assert slope == pytest.approx(0.0162, abs=1e-4)
    assert (near["a"] - a) / near["edge"] == pytest.approx(slope, rel=1e-3)


@pytest.mark.parametrize("other", ["a", "spring"])
def test_a_curve_of_grazing_by_springs_goes_on_to_no_coupling(other: str) -> None:
    """Where the idle site answers its drive alone, off centre no more."""
    on = {"a": 0.5, "gamma": 0.03, "k": 0.8, "spring": 0.1, "damping": 0.02}
    walls = {1: (-0.8, 1.2), 0: 0.9}
    both = {"lattice": cb.OpenChain(3, masses=[1, 1.2, 0.8]), "sequence": [(1, 1), (1, -1)]}
    shot = cb.shooting({"t1": -2.9, "t2": 0.2}, walls=walls, **both, **on)
    grazing = cb.trace(shot, "a", towards="up").first("GR")
    line = cb.boundary(grazing, ("gamma", other), within={"gamma": (0, 0.05)}, towards="down")
    end = line.special[-1]
    assert (end.kind, end["gamma"]) == ("EP", 0.0)
    assert end["a"] == pytest.approx(0.9 * math.hypot(1 - end["spring"], 0.02), abs=1e-12)


@pytest.mark.slow
def test_a_curve_of_grazing_from_no_springs_is_one_beyond() -> None:
    """The idle sites are held off centre less and less: each point flown until it touches."""
    start = cb.symmetric(0.6, 0.01, 0.88, lattice=cb.Ring(3), damping=0.005)
    within = {"a": (0.1, 1.3), "spring": (0.0, 0.05)}
    arm = cb.switch(cb.trace(start, "a", within=within).first("PF"), within=within)[0]
    line = cb.boundary(arm.first("GR"), ("spring", "a"), within=within)
    assert line.special[-1]["spring"] == 0.05
    for point in line.points[::4]:
        orbit, touch = point.solution, point["t"]
        flight = Field(orbit.lattice, orbit.conditions)
        before = touch - 0.1  # between the impacts of the site that makes them
        x = flight.flown(before, np.concatenate(orbit.state(t=before)), 0.1)
        assert (x[1], x[4]) == pytest.approx((1.0, 0.0), abs=1e-11)
