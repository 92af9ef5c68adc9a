"""Angles that turn over, conditions that are blind for a time, subharmonics that runs settle on,
states and parameters in other units."""

from __future__ import annotations

import math
import traceback
from functools import partial
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, minimize_scalar

import contbreather as cb
from contbreather.errors import BadInput, NotConverged
from contbreather.flows import cycle_of

from .test_cycle import variational
from .zoo import FOLD_OF_BALL, TABLE, born, strike, walk

TURN = 2 * math.pi


def pendulum(t: Any, x: Any, p: Any) -> Any:
    return [x[1], p["torque"] + p["a"] * np.cos(p["w"] * t) - p["d"] * x[1] - np.sin(x[0])]


def rotation(torque: float, d: float, **more: Any) -> Any:
    params = {"torque": torque, "a": 0.0, "w": 1.0, "d": d}
    start = {"theta": 0.0, "v": 2.0}
    return cb.cycle(pendulum, start, params, wraps={"theta": TURN}, **more)


def test_a_rotation_closes_up_to_a_turn_and_has_the_multiplier_of_its_damping() -> None:
    orbit = rotation(1.2, 0.3, settle=60)
    at = cb.trace(orbit, "torque", steps=cb.Steps(most=1))[0]
    period = at["period"]
    start = at.solution.flights[0].states[0]
    run = solve_ivp(partial(pendulum, p=at.params), (0.0, period), start, rtol=1e-12, atol=1e-12)
    assert run.y[:, -1] - start == pytest.approx([TURN, 0.0], abs=1e-9)
    (mu,) = at.solution.others  # Liouville: beside 1 the other is exp(-d T)
    assert mu == pytest.approx(math.exp(-0.3 * period), abs=1e-8)


@pytest.mark.slow
def test_rotations_end_at_the_homoclinic_orbit_that_melnikov_finds() -> None:
    """For weak damping at a torque of 4 d/pi."""
    d = 0.02
    branch = cb.trace(
        rotation(0.03, d, settle=300), "torque", towards="down", within={"torque": (0.01, 0.05)}
    )
    assert branch[-1].kind == "HOM"
    assert branch[-1]["torque"] == pytest.approx(4 * d / math.pi, rel=1e-4)
    assert "homoclinic to the saddle theta = " in branch.reason  # the same one, a turn later


@pytest.mark.slow
@pytest.mark.parametrize(("a", "periods", "turns"), [(1.35, 1, 1), (1.45, 2, 2)])
def test_a_driven_pendulum_goes_over_the_top_so_often(a: float, periods: int, turns: int) -> None:
    """As Baker & Gollub (Chaotic Dynamics) draw it, at w = 2/3 and a damping of 1/2."""
    params = {"torque": 0.0, "a": a, "w": 2 / 3, "d": 0.5}
    orbit = cb.cycle(
        pendulum, {"theta": 0.0, "v": 3.0}, params,
        period=lambda p: TURN / p["w"], wraps={"theta": TURN}, settle=300,
    )  # fmt: skip
    at = cb.trace(orbit, "a", within={"a": (a - 0.01, a + 0.01)})[0]
    assert at["period"] * params["w"] / TURN == pytest.approx(periods)
    start = at.solution.flights[0].states[0]
    field = partial(pendulum, p=at.params)
    run = solve_ivp(field, (0.0, at["period"]), start, method="DOP853", rtol=1e-12, atol=1e-12)
    assert abs(run.y[:, -1] - start) == pytest.approx([turns * TURN, 0.0], abs=1e-8)


@pytest.mark.slow
def test_an_impact_oscillator_is_the_same_with_its_phase_as_an_angle() -> None:
    def field(t: Any, x: Any, p: Any) -> Any:
        return [x[1], 0.5 * np.cos(x[2]) - x[0] - 0.1 * x[1], p["w"] + 0 * x[0]]

    def rebound(t: Any, x: Any, p: Any) -> Any:
        return [x[0], -0.8 * x[1], x[2]]

    hit = cb.Flow(field, until=lambda t, x, p: 1 - x[0], reset=rebound)
    start = {"x": 0.0, "v": 0.0, "angle": 0.0}
    orbit = cb.cycle([hit], start, {"w": 1.0}, wraps={"angle": TURN}, settle=200)
    branch = cb.trace(orbit, "w", within={"w": (0.9, 1.0)}, towards="down")
    doubling = branch.first("PD")
    # areas shrink by exp(-0.1 T) in flight, and by e squared at an impact
    assert doubling["period"] == pytest.approx(TURN / doubling["w"], rel=1e-10)
    product = 0.8**2 * np.exp(-0.1 * doubling["period"])
    assert np.prod(doubling.solution.others) == pytest.approx(product, rel=1e-8)


@pytest.mark.parametrize(
    ("wraps", "words"),
    [
        ({"phi": TURN}, "wraps: 'phi' is none of the states theta, v"),
        ({"theta": 3.0}, "f is not the same a turn of 3 later in state 0"),
        ({"theta": 0.0}, "the turn of theta = 0.0"),
        ("theta", "wraps"),
    ],
)
def test_what_is_no_angle_is_refused(wraps: Any, words: str) -> None:
    params = {"torque": 1.2, "a": 0.0, "w": 1.0, "d": 0.3}
    with pytest.raises(BadInput, match=words):
        cb.cycle(pendulum, {"theta": 0.0, "v": 2.0}, params, wraps=wraps)


@pytest.mark.slow
def test_a_cycle_takes_as_many_periods_as_the_run_that_settles() -> None:
    def duffing(t: Any, x: Any, p: Any) -> Any:
        return [x[1], p["a"] * np.cos(1.2 * t) - 0.3 * x[1] + x[0] - x[0] ** 3]

    period = TURN / 1.2
    orbit = cb.cycle(duffing, {"x": 1.0, "v": 0.0}, {"a": 0.35}, period=period, settle=400)
    at = cb.trace(orbit, "a", within={"a": (0.349, 0.351)})[0]
    assert at["period"] == pytest.approx(5 * period)
    assert at["unstable"] == 0


# --- the simplest walker, whose foot scuffs the ground where both legs are in line ---------------


def heel(t: Any, x: Any, p: Any) -> Any:
    return 2 * x[0] - x[1]


@pytest.fixture(scope="module")
def walker() -> Any:
    start = {"leg": 0.2003109, "swing": 0.4006218, "u": -0.1998325, "w": -0.0158230}
    flow = cb.Flow(walk, until=heel, reset=strike, ignore=lambda p: p["blind"])
    return cb.cycle([flow], start, {"g": 0.009, "blind": 3.0})


def test_a_walker_is_one_flow_that_ignores_the_scuffing(walker: Any) -> None:
    """Its doubling is where that of the two flows of the zoo is."""
    branch = cb.trace(walker, "g", within={"g": (0.004, 0.018)})
    assert branch.first("PD")["g"] == pytest.approx(0.015088437941, abs=1e-11)


def test_a_walker_that_has_settled_is_blind_from_the_beginning_of_a_step_on(walker: Any) -> None:
    """In the middle of a step it had been blind anew, beyond the next heel strike."""
    start = {"leg": 0.2003109, "swing": 0.4006218, "u": -0.1998325, "w": -0.0158230}
    again = cb.cycle(walker.residual.flows, start, walker.params, settle=22.0)
    assert again.start["period"] == pytest.approx(walker.start["period"], abs=1e-9)


@pytest.mark.slow
def test_blindness_ends_between_the_scuffing_and_the_strike(walker: Any) -> None:
    branch = cb.trace(walker, "blind", within={"blind": (0.5, 4.5)})
    touched = branch.first("GR")
    orbit = touched.solution
    run = solve_ivp(
        partial(walk, p=touched.params), (0.0, 3.0), orbit.flights[0].states[0],
        rtol=1e-11, atol=1e-12, events=lambda t, x: heel(t, x, None),
    )  # fmt: skip
    scuffs = [t for t in run.t_events[0] if t > 1e-6]
    assert touched["blind"] == pytest.approx(scuffs[0], abs=1e-8)
    assert branch[-1]["blind"] == pytest.approx(touched["period"], abs=1e-6)
    assert "does not count" in branch.reason
    # along the curve the blindness ends where the foot scuffs, too
    line = cb.boundary(touched, ("blind", "g"), within={"g": (0.008, 0.01)})
    assert not line.doubtful
    for point in line:
        flight = point.solution.flights[0]
        state = flight.at(np.array([point["blind"] / flight.duration]))
        assert abs(heel(0.0, state, None)[0]) < 1e-9


def test_an_impacting_orbit_that_repels_is_found_from_a_state_of_its_own() -> None:
    phase = -math.acos(FOLD_OF_BALL / 0.6)  # the saddle of both orbits with one bounce a period
    on = {"y": 0.6 * math.sin(phase), "v": math.pi}
    ball = cb.cycle([TABLE], on, {"A": 0.6, "e": 0.8}, period=2 * np.pi, t0=phase)
    assert ball.start["phase"] == pytest.approx(phase % (2 * np.pi), abs=1e-10)


@pytest.mark.slow
def test_several_starts_name_each_orbit_once_and_what_has_none() -> None:
    def relaxing(t: Any, x: Any, p: Any) -> Any:
        """A stable cycle of radius 1, an unstable one of 1/2 and a focus."""
        r2 = x[0] ** 2 + x[1] ** 2
        rate = -(r2 - 1) * (r2 - 0.25)
        return [rate * x[0] - x[1], rate * x[1] + x[0]]

    starts = [{"x": x, "y": 0.0} for x in (0.9, 0.2, 1.2, 0.1)]
    (cycle, rest) = cb.cycles(relaxing, starts, {"mu": 0.0}, settle=80)
    assert cycle.starts == (starts[0], starts[2])
    assert cycle.orbit.max["x"] == pytest.approx(1.0, abs=1e-9)
    assert rest.starts == (starts[1], starts[3])
    assert "there is an equilibrium at [0.0, 0.0]" in rest.said
    with pytest.raises(BadInput, match="there is no start"):
        cb.cycles(relaxing, [], {"mu": 0.0})
    with pytest.raises(BadInput, match="several starts are a list"):
        cb.cycles(relaxing, starts[0], {"mu": 0.0})


@pytest.mark.slow
def test_a_rotation_that_is_not_said_to_be_one_is_named() -> None:
    params = {"torque": 1.2, "a": 0.0, "w": 1.0, "d": 0.3}
    with pytest.raises(NotConverged, match="a state that is an angle is named with its turn"):
        cb.cycle(lambda t, x, p: pendulum(0.0 * t, x, p), {"theta": 0.0, "v": 2.0}, params)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"until": heel, "ignore": -1.0}, r"ignore = -1.0: a time, or a function of p"),
        ({"ignore": 1.0}, "ignore= is how long `until` does not count: the flow has none"),
        ({"at": 0.5, "ignore": 1.0}, "ignore= is how long `until` does not count"),
    ],
)
def test_what_cannot_be_ignored_is_refused(given: Any, words: str) -> None:
    with pytest.raises(BadInput, match=words):
        cb.Flow(walk, **given)


# --- coupled pendula, AUTO's demo pen -----------------------------------------------------------


def pendula(t: Any, x: Any, p: Any) -> Any:
    """Two of them under one torque; the spring between them knows their difference alone."""
    stretch = 0.175 * (x[1] - x[0])
    turning = p["torque"] - 0.1 * x[2:] - np.sin(x[:2])
    return np.stack([x[2], x[3], turning[0] + stretch, turning[1] - stretch])


@pytest.mark.slow
def test_coupled_pendula_go_over_the_top_in_phase_and_out_of_phase() -> None:
    """Each alone does not turn back: all at once do. In phase PD is where AUTO-07p has it; so are,
    of the rotations out of phase, both folds and BP, and there is no other: one whose half period
    slid along the orbit had five. They end at one saddle, which they pass two times, in two flows.
    """
    start = {"a": 0.0, "b": 0.0, "u": 4.0, "v": 4.0}
    in_phase = cb.cycle(pendula, start, {"torque": 0.4}, wraps={"a": TURN, "b": TURN}, settle=100)
    within = {"torque": (0.158, 0.45)}
    flip = cb.trace(in_phase, "torque", towards="down", within=within).first("PD")
    assert (flip["torque"], flip["period"]) == pytest.approx((0.179163, 3.70528), rel=1e-5)
    (arm,) = cb.switch(flip, within=within)
    found = [point for point in arm.special if point.kind != "EP"]
    assert [point.kind for point in found] == ["LP", "BP", "BP", "LP", "HOM"]
    assert "homoclinic to the saddle a = 2.967" in arm.reason
    assert "which it passes 2 times" in arm.reason
    known = [(0.331445, 9.72615), (0.175511, 13.4389)]
    for point, (torque, period) in zip(found[1:3], known, strict=True):
        assert (point["torque"], point["period"]) == pytest.approx((torque, period), rel=1e-5)
    for point in found[:3]:  # the trivial multiplier 1 is a double one at each of them
        off = variational(pendula, point.solution) - 1
        assert np.sort(abs(off))[1] < 1e-4


@pytest.mark.slow
def test_all_angles_of_an_array_are_wrapped_by_its_name() -> None:
    """Two coupled pendula that turn over together have the period of one."""

    def f(t: Any, x: Any, p: Any) -> Any:
        pull = 0.2 * np.sin(x[1] - x[0])
        return [x[2], x[3], 1.2 - 0.3 * x[2] - np.sin(x[0]) + pull,
                1.2 - 0.3 * x[3] - np.sin(x[1]) - pull]  # fmt: skip

    start = {"theta": [0.0, 0.5], "v": [2.0, 2.0]}
    both = cb.cycle(f, start, {}, wraps={"theta": TURN}, settle=150)
    alone = rotation(1.2, 0.3, settle=60)
    assert both.start["period"] == pytest.approx(alone.start["period"], rel=1e-9)


# --- units ----------------------------------------------------------------------------------------


def in_units(field: Any, states: list[float], parameter: float) -> Any:
    """A flow whose states and parameter p are so many times as large."""
    units = np.array(states)

    def f(t: Any, x: Any, p: Any) -> Any:
        plain = [part / unit for part, unit in zip(x, states, strict=True)]
        return [
            rate * unit for rate, unit in zip(field(*plain, p["p"] / parameter), units, strict=True)
        ]

    return f


def roessler(x: Any, y: Any, z: Any, c: Any) -> Any:
    return [-y - z, x + 0.2 * y, 0.2 + z * (x - c)]


@pytest.mark.slow
def test_scales_make_a_branch_of_cycles_the_same_in_any_units() -> None:
    """Steps, PD and where what doubles there begins."""
    found = []
    for a, b, c, p in [(1.0, 1.0, 1.0, 1.0), (1e6, 1.0, 1e-6, 1e-9)]:
        start, window = {"x": 5.0 * a, "y": 5.0 * b, "z": 0.0}, {"p": (2.5 * p, 3.0 * p)}
        orbit = cb.cycle(in_units(roessler, [a, b, c], p), start, {"p": 2.6 * p}, settle=200,
                         scales={"x": a, "y": b, "z": c, "p": p})  # fmt: skip
        branch = cb.trace(orbit, "p", within=window)
        (double,) = cb.switch(branch.first("PD"), within=window, steps=cb.Steps(most=3))
        found.append([len(branch), branch.first("PD")["p"] / p, double[0]["period"]])
    assert found[1] == pytest.approx(found[0], rel=1e-8)


def morris_lecar(v: Any, w: Any, current: Any) -> Any:
    opens, stays = (1 + np.tanh((v + 1.2) / 18)) / 2, (1 + np.tanh((v - 2) / 30)) / 2
    flows = 4.4 * opens * (v - 120) + 8 * w * (v + 84) + 2 * (v + 60)
    return [(current - flows) / 20, 0.04 * np.cosh((v - 2) / 60) * (stays - w)]


@pytest.mark.slow
def test_scales_of_an_equilibrium_are_those_of_its_cycles_too() -> None:
    """A fold of cycles was a branch point where one state is a million times another."""
    scales = {"v": 1e6, "w": 1e-3, "p": 1e-6}
    f, start = in_units(morris_lecar, [1e6, 1e-3], 1e-6), {"v": -2e7, "w": 1.4e-4}
    rest = cb.equilibrium(f, start, {"p": 1.1e-4}, scales=scales)
    window = {"p": (8.5e-5, 1.2e-4)}
    hopf = cb.trace(rest, "p", within=window).first("HB")
    assert hopf["p"] * 1e6 == pytest.approx(93.8576184, abs=1e-7)
    (cycles,) = cb.switch(hopf, within=window)
    assert cycles.first("LP")["p"] * 1e6 == pytest.approx(88.2932505, abs=1e-6)


@pytest.mark.slow
def test_scales_tell_how_small_a_cycle_is_that_shrinks_to_its_hopf_point() -> None:
    def f(t, x, p):  # r^2 = m (1 - m) around (1, 0), one state in thousands
        a, b = x[0] - 1, x[1] / 1e3
        g = p["m"] * (1 - p["m"]) - a * a - b * b
        return [g * a - b, 1e3 * (g * b + a)]

    rest = cb.equilibrium(f, {"u": 1.0, "v": 0.0}, {"m": -0.5}, scales={"v": 1e3})
    hopf = cb.trace(rest, "m", within={"m": (-0.5, 0.5)}).first("HB")
    (cycles,) = cb.switch(hopf, within={"m": (-0.5, 1.5)})
    assert [point.kind for point in cycles.special] == ["EP", "HB"]
    assert not cycles.doubtful
    assert abs(cycles[-1]["m"] - 1) < 1e-8


def test_scales_tell_multipliers_of_states_that_are_far_apart() -> None:
    """Of r^2 = m, the circle of radius r: 1 and exp(-4 pi m)."""

    def f(t, x, p):
        a, b = x[0], x[1] / 1e9
        g = p["m"] - a * a - b * b
        return [g * a - b, 1e9 * (g * b + a)]

    circle = cb.cycle(f, {"u": 1.0, "v": 0.0}, {"m": 1.0}, settle=10, scales={"v": 1e9})
    branch = cb.trace(circle, "m", within={"m": (1e-3, 1)})
    orbits = [point.solution for point in branch]
    assert max(abs(orbit.trivial - 1) for orbit in orbits) < 1e-9
    off = [orbit.others[0] - np.exp(-4 * np.pi * orbit.params["m"]) for orbit in orbits]
    assert max(map(abs, off)) < 1e-9


@pytest.mark.slow
def test_scales_that_are_none_are_refused() -> None:
    with pytest.raises(BadInput, match="no state or parameter is called so; there are"):
        rotation(1.2, 0.3, scales={"u": 1.0})
    with pytest.raises(BadInput, match="a size"):
        rotation(1.2, 0.3, scales={"v": 0.0})


@pytest.mark.slow
def test_a_tongue_of_the_third_order_is_walked_round_once() -> None:
    """Its three phases are one orbit: two folds, and no point twice."""

    def forced(t, x, p):
        return [x[1], (1 - x[0] ** 2) * x[1] - x[0] + 1.5 * np.cos(p["w"] * t)]

    start, period = {"x": 1.5, "v": 0.0}, lambda p: 2 * np.pi / p["w"]
    locked = cb.cycle(forced, start, {"w": 2.86}, period=period, settle=600)
    branch = cb.trace(locked, "w", within={"w": (2, 4)})
    assert branch.stop.name == "CLOSED"
    assert [point.kind for point in branch.special] == ["LP", "LP"]
    first, last = branch[0].solution, branch[-1].solution
    assert first.period == pytest.approx(last.period, rel=1e-11)
    assert last.states(0.0) == pytest.approx(first.states(first.period / 3), abs=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize(("current", "periods", "turns"), [(1.9, 1, 2), (1.7, 2, 3)])
def test_a_step_of_a_junction_is_walked_round_once(current, periods, turns) -> None:
    """Its phase is the same a turn later, and after each period of the drive (Shapiro steps)."""

    def junction(t, x, p):
        return [x[1], 2 * (p["I"] - x[1] - np.sin(x[0]) + 2 * np.cos(t))]

    start, wraps = {"delta": 0.0, "v": 1.0}, {"delta": TURN}
    step = cb.cycle(junction, start, {"I": current}, period=TURN, wraps=wraps, settle=600)
    branch = cb.trace(step, "I", within={"I": (1, 3)})
    first = branch[0].solution
    gained = first.flights[0].end - first.flights[0].states[0]
    assert (first.period, gained[0]) == pytest.approx((TURN * periods, TURN * turns), rel=1e-9)
    assert branch.stop.name == "CLOSED"
    assert [point.kind for point in branch.special] == ["LP", "LP"]


@pytest.mark.slow
def test_a_rotation_of_two_periods_ends_where_one_of_a_single_one_doubles() -> None:
    def swings(t, x, p):
        return [x[1], p["I"] - 0.6 * x[1] - np.sin(x[0]) + 1.2 * np.cos(t)]

    def rotates(torque):
        start, how = {"theta": 0.0, "v": 0.5}, {"period": TURN, "wraps": {"theta": TURN}}
        found = cb.cycle(swings, start, {"I": torque}, settle=400, **how)
        return cb.trace(found, "I", within={"I": (0.1, 1.5)}, towards="both")

    single, double = rotates(1.1), rotates(0.9)
    assert [point.kind for point in double.special] == ["BP", "PD", "PD", "BP"]
    doubles = sorted(point["I"] for point in single.special if point.kind == "PD")
    assert [double[0]["I"], double[-1]["I"]] == pytest.approx(doubles, abs=1e-8)


@pytest.mark.slow
def test_a_neuron_that_fires_twice_a_period_has_each_fold_once() -> None:
    """x' = I - x + 0.95 cos 2 pi t, from 0 to 1: the folds are the extreme currents at which the
    second spike after one at t comes at t + 1."""

    def after(t: float, current: float) -> float:
        """x = I + 0.95 Re exp(2 pi i t)/(1 + 2 pi i) less what decays from there to 0."""

        def driven(s: float) -> float:
            return current + 0.95 * (np.exp(2j * np.pi * s) / (1 + 2j * np.pi)).real

        return brentq(lambda s: driven(s) - driven(t) * np.exp(t - s) - 1, t, t + 2, xtol=1e-14)

    def locked(t: float) -> float:
        return brentq(lambda i: after(after(t, i), i) - t - 1, 2.2, 2.9, xtol=1e-14)

    t = np.arange(16) / 16
    currents = [locked(of) for of in t]

    def extreme(sign: float, near: float) -> float:
        around = near - 1 / 16, near + 1 / 16
        found = minimize_scalar(lambda of: sign * locked(of), bounds=around, method="bounded")
        return sign * found.fun

    folds = [extreme(1, t[np.argmin(currents)]), extreme(-1, t[np.argmax(currents)])]
    spike = cb.Flow(
        lambda t, x, p: [p["I"] - x[0] + 0.95 * np.cos(2 * np.pi * t)],
        until=lambda t, x, p: 1 - x[0],
        reset=lambda t, x, p: [0 * x[0]],
    )
    neuron = cb.cycle([spike], {"x": 0.0}, {"I": 2.54}, period=1.0, settle=300)
    branch = cb.trace(neuron, "I", within={"I": (1, 4)})
    assert branch.stop.name == "CLOSED"
    assert [point.kind for point in branch.special] == ["LP", "LP"]
    assert sorted(point["I"] for point in branch.special) == pytest.approx(folds, abs=1e-8)


@pytest.mark.slow
def test_a_block_that_topples_is_no_cycle() -> None:
    """x'' = x - 1 + 3 cos 5 t falls over from x' = 1; from 0.2 it rocks."""

    def right(t, x, p):
        return [x[1], x[0] - 1 + 3 * np.cos(5 * t)]

    def left(t, x, p):
        return [x[1], x[0] + 1 + 3 * np.cos(5 * t)]

    def strikes(t, x, p):
        return [0 * x[0], 0.9 * x[1]]

    sides = [
        cb.Flow(right, lambda t, x, p: x[0], strikes),
        cb.Flow(left, lambda t, x, p: -x[0], strikes),
    ]
    with pytest.raises(NotConverged, match="runs away"):
        cb.cycle(sides, {"x": 0.0, "v": 1.0}, {}, period=TURN / 5, settle=60)
    rocks = cb.cycle(sides, {"x": 0.0, "v": 0.2}, {}, period=TURN / 5, settle=60)
    assert 0 < max(cycle_of(rocks).max["x"], -cycle_of(rocks).min["x"]) < 1


@pytest.mark.slow
def test_the_period_of_several_flows_has_a_window() -> None:
    """x' = I - x up to 1, for log(I/(I - 1)), and x' = -2 - x back to 0, for log(3/2)."""
    rises = cb.Flow(lambda t, x, p: [p["I"] - x[0]], until=lambda t, x, p: 1 - x[0])
    falls = cb.Flow(lambda t, x, p: [-2 - x[0]], until=lambda t, x, p: x[0])
    cycle = cb.cycle([rises, falls], {"x": 0.0}, {"I": 2.0}, settle=20)
    branch = cb.trace(cycle, "I", within={"I": (1, 3), "period": (0.5, 2)}, towards="both")
    assert [point.kind for point in branch.special] == ["EP", "EP"]
    assert [branch[0]["period"], branch[-1]["I"]] == pytest.approx([2, 3], abs=1e-12)
    assert branch[0]["I"] == pytest.approx(1 / (1 - 1.5 * math.exp(-2)), abs=1e-10)
    with pytest.raises(BadInput, match=r"period=1\.09861, outside"):
        cb.trace(cycle, "I", within={"period": (0, 1)})


def test_what_leaves_a_threshold_slowly_does_not_run_away() -> None:
    """Of a population with an Allee effect in seasons, from 2 % above the orbit that repels."""

    def grows(t, x, p):
        least = 0.3 + 0.05 * np.cos(TURN * t)
        return [0.1 * x[0] * (x[0] / least - 1) * (1 - x[0])]

    def moved(n):
        return solve_ivp(grows, (0, 1), [n], args=({},), rtol=1e-11, atol=1e-13).y[0, -1] - n

    found = cb.cycle(grows, {"n": 0.302}, {}, period=1.0, settle=1)
    assert cycle_of(found).states(0.0)[0] == pytest.approx(brentq(moved, 0.2, 0.4), abs=1e-8)


@pytest.mark.slow
def test_an_orbit_that_is_not_found_is_refused_once() -> None:
    """A relay beside its tongue: however often the mesh was made finer on the way."""

    def relay(side: float) -> cb.Flow:
        return cb.Flow(
            lambda t, x, p: [side - x[0] + 0.3 * np.sin(p["w"] * t)],
            until=lambda t, x, p: 0.5 - side * x[0],
        )

    with pytest.raises(NotConverged, match="goes to zero") as refused:
        cb.cycle(
            [relay(1), relay(-1)], {"x": 0.0}, {"w": 1.4},
            period=lambda p: TURN / p["w"], settle=300,
        )  # fmt: skip
    said = "".join(traceback.format_exception(refused.value))
    assert said.count("NotConverged: the start") == 1


def test_half_a_period_of_samples_is_refused_as_that_not_as_an_equilibrium() -> None:
    """The origin alone is one, and Newton's iteration comes to any state at no time at all."""

    def vdp(t, x, p):
        return [x[1], p["mu"] * (1 - x[0] ** 2) * x[1] - x[0]]

    run = solve_ivp(vdp, (0, 60), [2.0, 0.0], args=({"mu": 1.0},), rtol=1e-9, dense_output=True)
    for begin, part in ((40.0, 3.0), (43.0, 3.0), (41.5, 4.0)):
        t = np.linspace(begin, begin + part, 200)
        with pytest.raises(NotConverged, match="no periodic orbit was found") as refused:
            cb.cycle(vdp, (t, run.sol(t)), {"mu": 1.0})
        assert "equilibrium" not in str(refused.value)
        assert "family" not in str(refused.value)


@pytest.mark.slow
def test_the_first_cycle_beside_a_hopf_point_is_small_however_far_states_are_from_zero() -> None:
    """As temperatures in kelvin. R = r^2 has u = 20 R^2 - 2 R: a fold at R = 0.05, u = -0.05."""

    def warm(t, x, p):
        a, b = x - 50.0
        r = a * a + b * b
        grows = p["u"] + 2 * r - 20 * r * r
        return [grows * a - b, a + grows * b]

    cycles = born(cb.equilibrium(warm, {"a": 50.0, "b": 50.0}, {"u": -0.1}), "u", (-0.1, 0.1))
    assert cycles.first("LP")["u"] == pytest.approx(-0.05, rel=1e-8)
    assert abs(cycles[0]["u"]) < 3e-3

    def pressure(t, x, p):  # in pascal: a swing of some 0.1 beside 1e5
        a, b = x - 1e5
        grows = p["u"] - a * a - b * b
        return [grows * a - b, a + grows * b]

    cycles = born(cb.equilibrium(pressure, {"a": 1e5, "b": 1e5}, {"u": -0.1}), "u", (-0.1, 0.1))
    assert 0 < cycles[0]["u"] < 0.05


def test_equilibria_of_an_angle_close_a_turn_later() -> None:
    """A driven pendulum rests where sin th = P: one circle, with a fold at either end."""
    pendulum = lambda t, x, p: [x[1], p["P"] - 2 * x[1] - p["g"] * np.sin(x[0])]  # noqa: E731
    start, params = {"th": 0.5, "w": 0.0}, {"P": 0.5, "g": 1.0}
    rest = cb.equilibrium(pendulum, start, params, wraps={"th": 2 * np.pi})
    branch = cb.trace(rest, "P", within={"P": (-2.0, 2.0)})
    assert branch.stop is cb.continuation.Stop.CLOSED
    np.testing.assert_allclose([point["P"] for point in branch.special], [-1.0, 1.0], rtol=1e-12)
    assert abs(np.ptp(branch["th"]) - 2 * np.pi) < 1e-9
    with pytest.raises(BadInput, match="wraps: f is not the same a turn"):
        cb.equilibrium(pendulum, start, params, wraps={"th": 3.0})
