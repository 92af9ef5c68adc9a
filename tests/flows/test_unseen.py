"""What a branch comes to and its start does not show: contacts, lost symmetries, flights that
vanish, units of any size."""

from __future__ import annotations

from functools import cache, partial
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import contbreather as cb
from contbreather.flows.functions import slopes

TAU = 2 * np.pi


def contact(t: Any, x: Any, p: Any) -> Any:
    """A force of Hertz's kind beyond 1, which complex steps lose."""
    deep = np.where(x[0] > 1, 20 * abs(x[0] - 1) ** 1.5, 0.0)
    return [x[1], -0.1 * x[1] - x[0] - deep + p["F"] * np.cos(0.7 * t)]


def test_slopes_are_right_where_a_force_begins_that_was_not_seen_at_first() -> None:
    x, t = np.linspace([-1.0, 0.0], [0.9, 1.0], 50, axis=1), np.linspace(0, 5, 50)
    slopes(contact, t, x, {"F": 1.0})
    deep = slopes(contact, t, x + 1, {"F": 1.0})[1][1, 0]
    np.testing.assert_allclose(deep, -1 - 30 * np.sqrt(np.maximum(x[0], 0.0)), rtol=1e-6, atol=1e-6)


def test_slopes_beside_the_end_of_a_flow_are_those_of_its_own_side() -> None:
    """Hertz's force where contact has just begun, and a ramp just before its clock strikes, whose
    differences reach over to the other side."""
    x, t = np.linspace([1 + 1e-5, 0.0], [1.02, 1.0], 50, axis=1), np.linspace(0.03, 0.0999, 50)
    force = slopes(lambda t, x, p: abs(x[0] - 1) ** 1.5, t, x, {})[1][0]
    np.testing.assert_allclose(force[0], 1.5 * np.sqrt(x[0] - 1), rtol=1e-3)

    def ramp(t: Any, x: Any, p: Any) -> Any:
        return p["m"] * (t % 0.1) - x[0]

    slopes(ramp, 0.05, x[:, :1], {"m": 3.0}, ("m",))
    late = slopes(ramp, 0.0999, x[:, :1], {"m": 3.0}, ("m",))[1][0, :, 0]
    np.testing.assert_allclose(late, [-1, 0, 3, 0.0999], atol=1e-9)


def test_rounding_of_the_terms_of_a_small_force_is_no_kink_and_a_small_kink_is_one() -> None:
    """Far from a breather a force is as small as the rounding of what it is the difference of."""

    def forces(other: Any) -> Any:
        return lambda t, x, p: np.stack([(1 - np.exp(-x[0])) * np.exp(-x[0]), other(x[1])])

    for far in (3e-13, 2e-12, 5e-11):
        x = np.array([[1.0, 0.8, 0.3], [far, 2 * far, 0.0]])
        slope = slopes(forces(lambda u: (1 - np.exp(-u)) * np.exp(-u)), 0.0, x, {})[1]
        assert slope[0, 0] == pytest.approx(np.exp(-x[0]) * (2 * np.exp(-x[0]) - 1), rel=4e-16)
        assert slope[1, 1] == pytest.approx(1.0, rel=1e-9)
    x = np.array([[1.0, 0.8, 0.3], [-2e-4, 1e-4, 3e-4]])
    slope = slopes(forces(np.abs), 0.0, x, {})[1]
    assert slope[1, 1] == pytest.approx(np.sign(x[1]), rel=1e-6)


@pytest.mark.slow
def test_contact_on_the_way_is_what_it_is_from_the_start() -> None:
    def doublings(F: float) -> list[float]:
        problem = cb.cycle(
            lambda t, x, p: contact(t, x, p), {"x": 0.0, "v": 0.0}, {"F": F}, period=TAU / 0.7,
            settle=90,
        )  # fmt: skip
        branch = cb.trace(problem, "F", within={"F": (0.5, 0.6)})
        # where a Gauss point comes into contact multipliers jump: a place may be told in doubt
        places = (*branch.special, *branch.doubtful)
        return sorted(at["F"] for at in places if at.kind == "PD")

    upwards = doublings(0.5)
    assert len(upwards) == 2
    # meshes differ, and no polynomial is like |x - 1|^1.5
    assert upwards == pytest.approx(doublings(0.6), abs=1e-3)


def test_a_function_serves_any_number_of_states() -> None:
    def decay(t: Any, x: Any, p: Any) -> Any:
        return -x + p["c"]

    for start in ({"x": 1.0}, {"x": 1.0, "y": 1.0}):
        rest = cb.equilibrium(decay, start, {"c": 1.0})
        branch = cb.trace(rest, "c", within={"c": (0, 2)})
        np.testing.assert_allclose(branch["x"], branch["c"], atol=1e-12)


@pytest.mark.slow
def test_half_of_a_forced_orbit_doubles_where_the_whole_loses_its_symmetry() -> None:
    def duffing(t: Any, x: Any, p: Any) -> Any:
        return [x[1], -0.1 * x[1] - x[0] ** 3 + p["F"] * np.cos(t)]

    mirror = cb.Flow(duffing, reset=lambda t, x, p: [-x[0], -x[1]])
    kinds = []
    for flow, period, kind in ((mirror, np.pi, "PD"), (duffing, TAU, "BP")):
        orbit = cb.cycle(flow, {"x": 1.0, "v": 0.0}, {"F": 2.2}, period=period, settle=60)
        branch = cb.trace(orbit, "F", within={"F": (2.0, 2.5)}, towards="up")
        lost, folds = branch.first(kind), (cb.fold(),)
        arm = cb.switch(lost, within={"F": (2.0, 3.6)}, events=folds)[0]
        kinds.append([lost["F"], *(at["F"] for at in arm.special if at.kind == "LP")])
    assert len(kinds[0]) == 3
    assert kinds[0] == pytest.approx(kinds[1], rel=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("unit", [1e-6, 1e3])
def test_a_fold_is_where_it_is_whatever_the_unit_of_time(unit: float) -> None:
    fall = cb.Flow(
        lambda t, x, p: [x[1], -1 / unit**2],
        until=lambda t, x, p: x[0] - p["A"] * np.sin(t / unit),
        reset=lambda t, x, p: [x[0], -0.8 * x[1] + 1.8 * p["A"] / unit * np.cos(t / unit)],
    )
    ball = cb.cycle(
        fall, {"y": 0.5, "v": 3.1 / unit}, {"A": 0.6}, period=TAU * unit, t0=0.9 * unit,
        settle=40 * unit,
    )  # fmt: skip
    branch = cb.trace(ball, "A", within={"A": (0.3, 1.5)}, towards="down")
    # pi (1 - e) / (1 + e)
    assert branch.first("LP")["A"] == pytest.approx(np.pi / 9, rel=1e-9)
    assert branch[-1]["A"] == 1.5


@pytest.mark.slow
@pytest.mark.parametrize("half", [False, True])
def test_a_relay_without_hysteresis_leaves_no_room_behind_its_switch(half: bool) -> None:
    def field(push: int) -> Any:
        return lambda t, x, p: [x[1], x[2], -x[0] - p["c"] * x[1] - 3 * x[2] - push]

    flows = [cb.Flow(field(1), until=lambda t, x, p: x[0] + p["h"]),
             cb.Flow(field(-1), until=lambda t, x, p: p["h"] - x[0])]  # fmt: skip
    if half:
        flows = [cb.Flow(field(1), flows[0].until, reset=lambda t, x, p: [-x[0], -x[1], -x[2]])]
    orbit = cb.cycle(flows, {"x": 1.0, "y": 0.0, "z": 0.0}, {"h": 0.1, "c": 2.0}, settle=50)
    branch = cb.trace(orbit, "h", within={"h": (-0.05, 0.2)}, towards="down")
    assert [at.kind for at in branch.special] == ["EP", "GR"]
    assert not branch.doubtful
    assert branch[-1]["h"] == pytest.approx(0.0, abs=1e-10)
    line = cb.boundary(branch.first("GR"), ("c", "h"), within={"c": (1, 3), "h": (-1, 1)})
    assert [at.kind for at in line.special] == ["EP", "EP"]
    np.testing.assert_allclose(line["h"], 0.0, atol=1e-10)


@pytest.mark.slow
def test_half_of_a_rattle_begins_on_the_other_wall_and_touches_it_as_the_whole_does() -> None:
    """Behind its mirror that wall is the condition that ended it, which no formula shows."""

    def tooth(t: Any, x: Any, p: Any) -> Any:
        return [x[1], -0.1 * x[1] + p["F"] * np.cos(t)]

    def flank(side: int) -> cb.Flow:
        return cb.Flow(
            tooth, until=lambda t, x, p: 1 - side * x[0],
            reset=lambda t, x, p: [x[0], -0.7 * x[1]], walls=(lambda t, x, p: 1 + side * x[0],),
        )  # fmt: skip

    half = cb.Flow(
        lambda t, x, p: [*tooth(x[2], x, p), 1.0], until=lambda t, x, p: 1 - x[0],
        reset=lambda t, x, p: [-x[0], 0.7 * x[1], x[2] - np.pi], walls=(lambda t, x, p: 1 + x[0],),
    )  # fmt: skip
    start, within = {"x": -1.0, "v": 0.739}, {"F": (0.45, 6)}
    whole = cb.cycle([flank(1), flank(-1)], start, {"F": 0.5}, period=TAU, t0=3.685, settle=60)
    halved = cb.cycle(half, {**start, "theta": 3.685}, {"F": 0.5}, settle=60)
    wholes = cb.trace(whole, "F", within=within, towards="up")
    halves = cb.trace(halved, "F", within=within, towards="up")
    assert [at.kind for at in wholes.special] == ["EP", "BP", "GR"]
    assert [at.kind for at in halves.special] == ["EP", "PD", "GR"]
    assert halves[-1]["F"] == pytest.approx(wholes[-1]["F"], rel=1e-9)


@pytest.mark.slow
def test_a_period_that_comes_to_zero_has_a_window_from_zero_on() -> None:
    flows = [cb.Flow(lambda t, x, p: [1.0], until=lambda t, x, p: p["h"] - x[0]),
             cb.Flow(lambda t, x, p: [-1.0], until=lambda t, x, p: p["h"] + x[0])]  # fmt: skip
    to_and_fro = cb.cycle(flows, {"x": 0.0}, {"h": 0.5}, settle=10)  # its period is 4 h
    branch = cb.trace(to_and_fro, "h", within={"h": (-1, 1), "period": (0, 3)}, towards="down")
    assert [at.kind for at in branch.special] == ["EP", "GR"]
    assert branch[-1]["h"] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.slow
def test_a_ball_whose_flight_is_cut_at_its_top_grazes_where_that_is_on_the_table() -> None:
    rises = cb.Flow(lambda t, x, p: [x[1], -1.0], until=lambda t, x, p: x[1])
    falls = cb.Flow(
        lambda t, x, p: [x[1], -1.0], until=lambda t, x, p: x[0] - p["A"] * np.sin(t),
        reset=lambda t, x, p: [x[0], -p["e"] * x[1] + (1 + p["e"]) * p["A"] * np.cos(t)],
    )  # fmt: skip
    ball = cb.cycle([rises, falls], {"y": 0.46, "v": 3.1}, {"A": 0.6, "e": 0.8}, period=TAU,
                    t0=0.9, settle=40)  # fmt: skip
    grazing = cb.trace(ball, "A", within={"A": (0.2, 3)}).first("GR")
    down, top = grazing["flow"], grazing.solution.times[grazing["flow"]]
    assert grazing.solution.equations.flows[down].reset
    assert grazing["said"] == f"flow {down} touches until at t = {top:.6g}"
    line = cb.boundary(grazing, ("e", "A"), within={"e": (0.1, 1)})
    assert [at.kind for at in line.special] == ["EP", "EP"]
    # it rises by pi^2/2 from A sin(phi) to -A sin(phi), and A cos(phi) = pi (1 - e)/(1 + e)
    e = np.asarray(line["e"])
    np.testing.assert_allclose(line["A"], np.hypot(np.pi * (1 - e) / (1 + e), np.pi**2 / 4))


@pytest.mark.slow
def test_a_cycle_begins_to_slide_where_it_touches_the_threshold() -> None:
    def field(harvest: float) -> Any:
        def f(t: Any, x: Any, p: Any) -> Any:
            eaten = 0.3556 * x[0] / (0.33 + x[0])
            return [x[0] * (1 - x[0]) - eaten * x[1], (eaten - p["d"] - harvest) * x[1]]

        return f

    system = cb.Filippov(field(0.2067), field(0.0), lambda t, x, p: x[1] - p["h"])
    params, start = {"h": 2.43, "d": 0.0444}, {"u": 0.3, "v": 0.4}
    mesh = cb.flows.Collocation(intervals=40)
    orbit = cb.cycle(system, start, params, settle=200, collocation=mesh)
    sliding = cb.trace(orbit, "h", within={"h": (2.4, 3.0)}, towards="up")
    assert (sliding.special[-1].kind, sliding.doubtful) == ("SL", ())
    # of the harvest that never begins: v is largest where v' = 0
    free = solve_ivp(
        lambda t, x: field(0.0)(t, x, params), (0, 1500), [0.3, 0.4], rtol=1e-12, atol=1e-13,
        method="DOP853", events=lambda t, x: field(0.0)(t, x, params)[1],
    )  # fmt: skip
    largest = max(free.y_events[0][-4:, 1])
    assert sliding.special[-1]["h"] == pytest.approx(largest, abs=1e-8)


# --- meshes keep the symmetry of an orbit -------------------------------------------------------

PUSH = 26.0


def pushed(sign: float, t, x, p):
    return [x[1], sign * PUSH - 0.2 * x[1] - x[0] - x[0] ** 3]


BANG = [cb.Flow(partial(pushed, 1.0), at=0.5), cb.Flow(partial(pushed, -1.0), at=0.0)]


def driven(p):
    return TAU / p["om"]


@cache
def pushed_about(om: float, x: float = 0.0, v: float = 0.0) -> cb.Problem:
    return cb.cycle(BANG, {"x": x, "v": v}, {"om": om}, period=driven, settle=120)


@pytest.mark.slow
def test_an_asymmetric_orbit_comes_back_to_the_symmetric_one_where_half_of_that_doubles() -> None:
    """A mirror image after half a period, x(t + T/2) = -x(t): a half that ends in a mirror, whose
    multiplier is -1 where the whole loses its symmetry."""
    mirrored = cb.Flow(partial(pushed, 1.0), reset=lambda t, x, p: [-x[0], -x[1]])
    half = cb.cycle(
        mirrored, {"x": 0.0, "v": 0.0}, {"om": 0.75}, period=lambda p: np.pi / p["om"], settle=120
    )
    lost = cb.trace(half, "om", within={"om": (0.7, 1.2)})
    wanted = [point["om"] for point in lost.special if point.kind == "PD"][-2]
    whole = pushed_about(1.03, 2.0, 5.0)
    branch = cb.trace(whole, "om", towards="down", steps=cb.Steps(most=28))
    assert abs(branch[0]["max(x)"] + branch[0]["min(x)"]) > 1
    found = branch.first("BP")
    assert found["om"] == pytest.approx(wanted, abs=1e-8)
    assert found["max(x)"] == pytest.approx(-found["min(x)"], abs=1e-7)


@pytest.mark.slow
def test_an_orbit_of_two_periods_comes_back_to_that_of_one_where_that_doubles() -> None:
    twice = pushed_about(0.7)
    assert twice.start["durations"].size == 4
    window, steps = {"om": (0.695, 0.72)}, cb.Steps(most=25)
    back = cb.trace(twice, "om", within=window, towards="up", steps=steps)
    assert [point.kind for point in back.special if point.kind != "EP"] == ["BP"]
    symmetric = cb.trace(pushed_about(0.75), "om", within={"om": (0.71, 0.76)})
    arm = cb.switch(symmetric.first("BP"), within={"om": (0.703, 0.73)})[0]
    assert arm.first("PD")["om"] == pytest.approx(back.first("BP")["om"], abs=1e-8)


@pytest.mark.slow
def test_an_orbit_of_two_periods_comes_back_to_an_asymmetric_one_where_that_doubles() -> None:
    once = pushed_about(1.03, 2.0, 5.0)
    asymmetric = cb.trace(once, "om", within={"om": (0.95, 1.04)}, towards="down")
    twice = pushed_about(0.985, 2.0, 5.0)
    assert twice.start["durations"].size == 2 * once.start["durations"].size
    back = cb.trace(twice, "om", within={"om": (0.95, 1.0)}, towards="up")
    assert [point.kind for point in back.special if point.kind != "EP"] == ["LP", "BP"]
    assert back.first("BP")["om"] == pytest.approx(asymmetric.first("PD")["om"], abs=1e-8)


# --- tutorials of other programs ----------------------------------------------------------------


@pytest.mark.slow
def test_folds_of_an_enzyme_s_cycles_are_where_auto_has_them() -> None:
    """Its demo plp: the cycles of the second Hopf point fold, and the folds are followed."""

    def field(t, x, p):
        s, a = x
        taken = p["rho"] * s * a / (1 + s + 0.1 * s**2)
        return [p["s0"] - s - taken, 0.2 * (500 - a) - taken]

    rest = cb.equilibrium(field, {"s": 18.95, "a": 44.73}, {"s0": 110.0, "rho": 6.0})
    born = cb.trace(rest, "rho", within={"rho": (4.6, 6.1)}, towards="down").first("HB")
    assert born["rho"] == pytest.approx(4.65046, abs=5e-6)
    (cycles,) = cb.switch(born, within={"rho": (4.6, 5.1)})
    fold = cycles.first("LP")
    assert (fold["rho"], fold["period"]) == pytest.approx((5.00784, 5.67658), abs=1e-5)
    line = cb.boundary(fold, ("rho", "s0"), within={"s0": (109.5, 111), "rho": (4, 6)})
    end = max(line, key=lambda point: point["s0"])
    assert (end["rho"], end["period"]) == pytest.approx((4.72213, 6.08717), abs=1e-5)


@pytest.mark.slow
def test_a_state_that_follows_another_at_once_has_a_multiplier_of_nothing() -> None:
    """That of the van der Pol oscillator beside it is the integral of the divergence."""

    def field(t: Any, x: Any, p: Any) -> Any:
        return [x[1], (1 - x[0] ** 2) * x[1] - x[0], 1e6 * (x[0] - x[2])]

    start = {"x": 2.0, "v": 0.0, "seen": 2.0}
    orbit = cb.flows.cycle_of(cb.cycle(field, start, {}, settle=10))
    t = np.linspace(0.0, orbit.period, 2001)
    grown = np.exp(np.trapezoid(1 - orbit.states(t)[0] ** 2, t))
    np.testing.assert_allclose(orbit.multipliers, [1.0, grown, 0.0], atol=1e-6)
    assert orbit.multipliers[1] == pytest.approx(grown, rel=1e-4)


@pytest.mark.slow
def test_the_pole_of_a_multiplier_at_a_vanishing_impact_is_no_bifurcation() -> None:
    """PD was in doubt there, at a quarter of such ends."""

    def f(t: Any, x: Any, p: Any) -> Any:
        push = 0.217 + 1.3118 * np.cos(0.7957 * t)
        return [x[1], -p["d"] * x[1] - x[0] - 0.192 * x[0] ** 3 + push]

    def bounce(t: Any, x: Any, p: Any) -> Any:
        return [x[0], -0.5052 * x[1]]

    hit, start = cb.Flow(f, lambda t, x, p: 0.9628 - x[0], bounce), {"x": 0.1, "v": 0.3}
    orbit = cb.cycle([hit], start, {"d": 0.2404}, period=TAU / 0.7957, settle=100)
    for largest in (None, 0.05, 0.02):
        steps = cb.Steps(largest=largest)
        branch = cb.trace(orbit, "d", within={"d": (0.005, 0.6)}, steps=steps)
        assert [point.kind for point in branch.special] == ["EP", "LP", "VI"]
        assert not branch.doubtful
