"""Motions that the flow brings back: what bifurcates from them, arms, curves, normal forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

import contbreather as cb
from contbreather.orbits.orbit import orbit_at
from contbreather.simulation import periodic, rotation, simulate, simulate_smooth
from tests.simulation.zoo import breather

RING = {"gamma": 0.04, "k": 0.8, "damping": 0.02}


def settled(state, periods, **on):
    run = simulate_smooth if "m" in on else simulate
    return run(state, periods=periods, **on).final


@pytest.fixture(scope="module")
def pitchfork():
    start = breather(6, a=0.7, t0=1.0, **RING)
    return cb.trace(start, "a", within={"a": (0.6, 0.9)}, towards="up").first("PF")


def test_pitchfork_of_a_damped_ring_is_that_of_its_shot_orbit(pitchfork):
    orbit = cb.symmetric(0.7, lattice=cb.Ring(6), **RING)
    wanted = cb.trace(orbit, "a", within={"a": (0.6, 0.9)}).first("PF")
    assert pitchfork["a"] == pytest.approx(wanted["a"], abs=1e-9)
    assert pitchfork.solution.symmetric
    assert np.abs(pitchfork.solution.half - 1.0).min() < 1e-8
    assert pitchfork.detail["criticality"] == "supercritical"


@pytest.mark.slow
def test_its_curve_in_damping_and_amplitude_is_that_of_the_shot_orbit(pitchfork):
    window = {"damping": (0.005, 0.03)}
    line = cb.boundary(pitchfork, ("damping", "a"), within=window, events=())
    orbit = cb.symmetric(0.7, lattice=cb.Ring(6), **RING)
    shot = cb.trace(orbit, "a", within={"a": (0.6, 0.9)}).first("PF")
    wanted = cb.boundary(shot, ("damping", "a"), within=window)
    for one, other in ((line[0], wanted[0]), (line[-1], wanted[-1])):
        assert one["damping"] == pytest.approx(other["damping"], abs=1e-9)
        assert one["a"] == pytest.approx(other["a"], abs=1e-8)


@pytest.mark.slow
def test_its_arms_are_what_simulation_settles_to_and_double_their_period(pitchfork):
    (arm,) = cb.switch(pitchfork, within={"a": (0.7, 0.87)})
    last = arm[-1].solution
    assert (last.symmetric, last.periods) == (False, 1)
    assert last.largest < 1.0
    state = settled(last.state, 100, a=last.conditions.a, t0=1.0, **RING)
    assert np.abs(np.subtract(state, last.state)).max() < 1e-9
    off = 1e-4 * np.random.default_rng(0).normal(size=(2, 6))
    found = settled(np.array(last.state) + off, 600, a=last.conditions.a, t0=1.0, **RING)
    shifted = simulate(last.state, a=last.conditions.a, periods=0.5, t0=1.0, **RING).final
    mirrored = -np.array(shifted)  # the other arm, at the same phase of the forcing
    gaps = [np.abs(np.subtract(found, one)).max() for one in (last.state, mirrored)]
    assert min(gaps) < 1e-7


@pytest.mark.slow
def test_a_single_site_doubles_from_arm_to_arm_with_the_digits_of_the_closed_forms():
    """k = 0.8: 0.691778556508 (PF), 0.925512006293 and 0.979973549455 (PD)."""
    start = breather(1, a=0.6, gamma=0.0, k=0.8, t0=1.0)
    fork = cb.trace(start, "a", within={"a": (0.6, 0.7)}, towards="up").first("PF")
    assert fork["a"] == pytest.approx(0.691778556508, abs=1e-9)
    (arm,) = cb.switch(fork, within={"a": (0.6, 0.93)})
    first = arm.first("PD")
    assert first["a"] == pytest.approx(0.925512006293, abs=1e-9)
    (twice,) = cb.switch(first, within={"a": (0.9, 0.98)})
    second = twice.first("PD")
    assert second["a"] == pytest.approx(0.979973549455, abs=1e-8)
    assert (second.solution.periods, second.solution.symmetric) == (2, False)


def test_torus_is_born_with_the_angle_of_its_normal_form():
    on = {"a": 0.1, "k": 0.8, "damping": 0.02}
    start = breather(6, gamma=0.09, **on)
    branch = cb.trace(start, "gamma", within={"gamma": (0.09, 0.13)}, towards="up")
    point = branch.first("NS")
    # of minus the half map, twice a period of the forcing, and turns are up to sign
    turns = 2.0 * point.detail["angle"] / (2.0 * math.pi) % 1.0
    run = simulate(point.solution.state, gamma=point["gamma"], periods=5, **on)
    mu = point.solution.multipliers
    (pair,) = mu[(np.abs(np.abs(mu) - 1.0) < 1e-7) & (mu.imag > 0.0)]
    wanted = float(np.angle(pair)) / (2.0 * math.pi)
    assert min(turns, 1.0 - turns) == pytest.approx(min(wanted, 1.0 - wanted), abs=1e-9)
    assert np.abs(np.subtract(run.final, point.solution.state)).max() < 1e-7
    assert point.detail["criticality"] in ("supercritical", "subcritical")
    if point.detail["criticality"] == "supercritical":
        beyond = {**on, "gamma": point["gamma"] + 2e-4}
        off = np.array(point.solution.state) + 1e-3
        seen = simulate(settled(off, 6000, **beyond), periods=2000, **beyond)
        assert rotation(*seen.strobe).number == pytest.approx(min(wanted, 1.0 - wanted), abs=2e-3)


@pytest.mark.slow
def test_smooth_walls_have_arms_and_doublings_too():
    # away from the walls the state is a smooth function of a: 13 points, 81 at t0 = 0
    on = {"gamma": 0.0, "k": 0.7, "m": 12, "damping": 0.01, "t0": 1.0}
    start = breather(1, a=0.7, **on)
    fork = cb.trace(start, "a", within={"a": (0.6, 0.8)}, towards="up").first("PF")
    (arm,) = cb.switch(fork, within={"a": (0.6, 1.01)})
    double = arm.first("PD")
    assert (double.solution.periods, double.solution.symmetric) == (1, False)
    assert 0.9 < double["a"] < 1.1
    last = arm[-1].solution
    after = settled(last.state, 1, **{**on, "a": last.conditions.a})
    assert np.abs(np.subtract(after, last.state)).max() < 1e-8


def test_with_one_wall_there_is_no_half_and_folds_are_those_of_the_shot_orbit():
    on = {"gamma": 0.03, "k": 0.7, "spring": 2.3, "damping": 0.1, "walls": {1: (None, 0.6)}}
    on |= {"lattice": cb.OpenChain(3)}
    shot = cb.shooting({"t1": 2.6}, sequence=[(1, 1)], a=0.77, **on)
    state = orbit_at(shot).state(t=0.3)
    start = periodic(state, a=0.77, t0=0.3, **on)
    assert "PF" not in {event.kind for event in start.problem.events}
    down = cb.trace(start, "a", towards="down", within={"a": (0.5, 0.77)}).first("LP")
    wanted = cb.trace(shot, "a", towards="down", within={"a": (0.5, 0.77)}).first("LP")
    assert down["a"] == pytest.approx(wanted["a"], abs=1e-9)


# --- two multipliers within one step: told apart, or said -----------------------------------------


def line(diagonal, flip="PF", kinds=("LP", "BP", "PF", "PD", "NS", "MX"), damping=0.1):
    """A fixed point at 0 of a map whose multipliers are functions of mu, with events of motions."""
    on = {"a": 0.5, "gamma": 0.0, "k": 0.8, "damping": damping}
    own = periodic(breather(1, **on).state, symmetric=flip == "PF", **on).problem.events
    size = len(diagonal(0.0))
    return cb.FixedPoint(
        lambda x, p: np.asarray(diagonal(p["mu"])) * x + 0.0,
        {f"x{i}": 0.0 for i in range(size)},
        {"mu": 0.0, "damping": damping},
        events=[event for event in own if event.kind in kinds],
    )


@pytest.mark.parametrize("flip", ["PF", "PD"])
@pytest.mark.parametrize("steps", [None, cb.Steps(largest=0.03)])
def test_two_multipliers_that_pass_minus_one_within_a_step_are_two_events(flip, steps):
    branch = cb.trace(
        line(lambda mu: [-0.9 - mu, -0.899 - mu, 0.3], flip, (flip, "MX")),
        "mu",
        within={"mu": (-1, 1)},
        steps=steps,
    )
    found = [point["mu"] for point in branch.special if point.kind == flip]
    assert found == pytest.approx([0.1, 0.101], abs=1e-9)
    assert not branch.doubtful


def test_what_no_event_explains_is_said():
    """A real multiplier passes +1, and only doublings are looked for."""
    branch = cb.trace(
        line(lambda mu: [0.9 + mu, 0.1], kinds=("PF", "NS", "MX")), "mu", within={"mu": (-0.5, 0.5)}
    )
    assert [p.kind for p in branch.special] == ["EP", "EP"]
    (doubt,) = branch.doubtful
    assert doubt["mu"] == pytest.approx(0.1, abs=1e-3)
    assert "changes from 0 to 1" in doubt.detail["reason"]


def test_without_damping_no_count_is_held_against_a_branch():
    bare = line(lambda mu: [0.9 + mu, 0.1], kinds=("MX",), damping=0.0)
    assert not bare.events
    damped = line(lambda mu: [0.9 + mu, 0.1], kinds=("MX",)).at(damping=0.0)
    assert not cb.trace(damped, "mu", within={"mu": (-0.5, 0.5)}).doubtful


# --- columns of branches --------------------------------------------------------------------------


@pytest.mark.parametrize("symmetric", [True, False])
def test_columns_of_a_smooth_orbit_are_about_its_whole_period(symmetric: bool) -> None:
    state = cb.symmetric(0.1, 0.08, 0.8).state(4)
    start = periodic(state, a=0.1, gamma=0.08, m=6, k=0.8, damping=0.01, symmetric=symmetric)
    branch = cb.trace(start, "a", within={"a": (0.098, 0.102)}, events=())
    assert len(branch) >= 3
    for point in branch:
        moduli = np.abs(point.solution.multipliers)
        assert moduli.size == 8
        assert point["largest"] == pytest.approx(moduli.max(), rel=1e-9)
        assert np.prod(moduli) < np.exp(-8 * np.pi * 0.01) * 1.0001  # damping of all sites
        assert point["unstable"] == np.sum(moduli > 1.0 + 1e-6)


def test_a_branch_of_motions_goes_down_to_no_coupling() -> None:
    """Derivatives are asked for on both sides of it."""
    on = {"a": 0.5, "gamma": 0.02, "k": 0.8, "damping": 0.02, "t0": 1.0}
    start = periodic(cb.symmetric(0.5, 0.02, 0.8).state(4, t=1.0), symmetric=True, **on)
    branch = cb.trace(start, "gamma", towards="down", within={"gamma": (0.0, 0.03)})
    assert (branch[-1].label, branch[-1]["gamma"]) == ("EP2", 0.0)
