"""The systems of the zoo: every special point where it is known to be, and no other."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

import contbreather as cb

from .zoo import CASES, CURVES, EQUILIBRIA, Case, Curve, Impacting

ENDS = {"EP", "MX"}
RESTS = [case for case in CASES.values() if any(kind == "HB" for kind, _ in case.special)]
TURN = 4 * math.pi / 3
CYCLES = [case for case in CASES.values() if case.name not in EQUILIBRIA]


def named(case: Case) -> str:
    return case.name


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
def test_special_points_are_where_they_are_known_to_be_and_no_others(case: Case) -> None:
    branch = case.branch
    found = sorted((at.kind, at[case.free]) for at in branch.special if at.kind not in ENDS)
    known = sorted(case.special)
    assert [kind for kind, _ in found] == [kind for kind, _ in known]
    np.testing.assert_allclose(
        [value for _, value in found], [value for _, value in known], rtol=0, atol=case.tolerance
    )
    assert len(branch) > 4
    for at in branch if case.along else ():
        for value, wanted in case.along(at):
            np.testing.assert_allclose(value, wanted, rtol=case.tolerance, atol=case.tolerance)


@pytest.mark.parametrize("case", CYCLES, ids=named)
def test_a_cycle_comes_back_under_another_integrator(case: Case) -> None:
    orbit = cb.flows.cycle_of(case.problem())
    flows, begin, p = orbit.equations.flows, float(orbit.times[0]), orbit.params
    events = len(flows) if flows[0].until else None
    far = None if events else orbit.period
    run = cb.integrate(flows, orbit.states(begin), p, events=events, time=far, t0=begin)
    final = run.final if events or not flows[0].reset else flows[0].reset(0, run.final, p)
    growth = max(1.0, *abs(orbit.multipliers))
    np.testing.assert_allclose(run.pieces[-1].t[-1] - begin, orbit.period, atol=1e-9 * growth)
    np.testing.assert_allclose(final, orbit.states(begin), atol=1e-9 * growth)


@pytest.mark.slow
@pytest.mark.parametrize("case", RESTS, ids=named)
def test_small_cycles_leave_every_hopf_point_with_its_period(case: Case) -> None:
    """The period is that of the linear motion but for the square of the amplitude."""
    for hopf in (at for at in case.branch.special if at.kind == "HB"):
        (cycles,) = cb.switch(hopf, steps=cb.Steps(most=6))
        near, far = cycles[1], cycles[3]
        squares = [(at["max(" + name + ")"] - at["min(" + name + ")"]) ** 2
                   for name in list(hopf.problem.start)[:1] for at in (near, far)]  # fmt: skip
        slope = (far["period"] - near["period"]) / (squares[1] - squares[0])
        limit = near["period"] - slope * squares[0]
        assert limit == pytest.approx(2 * math.pi / hopf["omega"], rel=1e-3)


@pytest.mark.parametrize("curve", CURVES, ids=lambda curve: f"{curve.case}, {curve.kind}")
def test_curves_in_two_parameters_are_those_in_closed_form(curve: Curve) -> None:
    start = CASES[curve.case].branch.first(curve.kind)
    steps = cb.Steps(most=curve.most)
    line = cb.boundary(start, curve.names, within=curve.window, steps=steps)
    assert len(line) > 5
    assert not line.doubtful  # at VI a multiplier is infinite: no PD, no NS is looked for
    for at in line:
        found, known = curve.known(at)
        assert found == pytest.approx(known, abs=1e-8)


@pytest.mark.slow
def test_a_curve_of_vanishing_impacts_meets_folds_where_these_begin() -> None:
    """Where the fold of an impact oscillator, in closed form, has no velocity left."""
    line = cb.boundary(
        CASES["impact oscillator, fold"].branch.first("VI"), ("F", "w"), within={"w": (0.6, 2.8)},
        towards="both",
    )  # fmt: skip
    upright = lambda w: float(Impacting(w).response[1][0])  # noqa: E731
    known = [brentq(upright, *of) for of in ((0.6, 0.7), (0.99, 1.02), (1.9, 2.1))]
    assert [at.kind for at in line.special] == ["EP", *["VI-LP"] * 3, "EP"]
    assert [at["w"] for at in line.special[1:-1]] == pytest.approx(known, abs=1e-9)
    assert not line.doubtful
    folds = cb.boundary(line.special[3], ("F", "w"), within={"w": (1.6, 2.8)}, towards="both")
    assert {folds[0].kind, folds[-1].kind} == {"EP", "LP-VI"}
    assert folds["F"] == pytest.approx([Impacting(w).fold for w in folds["w"]], abs=1e-9)


@pytest.mark.slow
def test_where_all_is_forgotten_no_multiplier_is_infinite_though_the_threshold_is_only_reached():
    """A neuron that is set back to one state: its multipliers are 0, and it has no folds."""
    fires = cb.Flow(
        lambda t, x, p: [p["I"] - 0.1 * x[0] - x[1], x[0] - 0.1 * x[1], (x[0] - x[2]) / 3],
        until=lambda t, x, p: 1 - x[0] + 0.2 * x[2], reset=lambda t, x, p: [-0.5, p["b"], 0.1],
    )  # fmt: skip
    start = {"v": -0.5, "w": 0.0, "z": 0.1}
    neuron = cb.cycle(fires, start, {"I": 2.0, "b": 0.0})
    branch = cb.trace(neuron, "I", within={"I": (0.5, 3)}, towards="down")
    assert [at.kind for at in branch.special] == ["EP", "VI"]
    assert not branch["unstable"][:-1].any()
    line = cb.boundary(branch[-1], ("I", "b"), within={"b": (-0.01, 0.01)}, towards="both")
    assert [at.kind for at in line.special] == ["EP", "EP"]
    assert np.isnan([branch["unstable"][-1], *line["unstable"]]).all()  # as multipliers are at VI


@pytest.mark.slow
@pytest.mark.parametrize("half", [False, True])
def test_a_relay_that_only_just_switches_has_no_bifurcation_there(half: bool) -> None:
    """From -h at rest an oscillator overshoots 1 by r (1 + h), r its decay over half a turn: up to
    h = (1 + r)/(1 - r). Its square of a speed vanishes there, which the other sign has, too."""

    def relay(side: float, **more: Any) -> cb.Flow:
        until = lambda t, x, p: p["h"] - side * x[0]  # noqa: E731
        return cb.Flow(lambda t, x, p: [x[1], side - x[0] - 0.5 * x[1]], until, **more)

    mirrored = [relay(1, reset=lambda t, x, p: [-x[0], -x[1]])]
    flows = mirrored if half else [relay(1), relay(-1)]
    orbit = cb.cycle(flows, {"x": 0.0, "v": 0.5}, {"h": 0.5}, settle=100)
    branch = cb.trace(orbit, "h", within={"h": (0.1, 3)})
    assert [at.kind for at in branch.special] == ["EP", "VI"]
    assert not branch.doubtful
    r = math.exp(-math.pi / math.sqrt(15))
    assert branch[-1]["h"] == pytest.approx((1 + r) / (1 - r), abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["VI", "GR"])
def test_a_curve_of_walls_asks_for_few_flights(kind: str) -> None:
    """Their derivatives come from those of the flights: none of a flight for each unknown."""
    asked = 0

    def counted(t: Any, x: Any, p: Any) -> Any:
        nonlocal asked
        asked += 1
        return [x[1], p["F"] * np.cos(1.5 * t) - x[0] - 0.2 * x[1]]

    def wall(t: Any, x: Any, p: Any) -> Any:
        return p["g"] - x[0]

    back = cb.Flow(counted, until=wall, reset=lambda t, x, p: [x[0], -p["e"] * x[1]])
    flow, start = (back, {"F": 3.0}) if kind == "VI" else (cb.Flow(counted, walls=(wall,)), {})
    params = {"F": 0.5, "g": 1.0, "e": 0.5, **start}
    problem = cb.cycle(flow, {"x": 0.0, "v": 0.0}, params, period=TURN, settle=100)
    limit = cb.trace(problem, "F", within={"F": (0.3, 4)}, events=()).first(kind)
    happened = "only just reaches its end" if kind == "VI" else "touches walls[0]"
    assert limit.detail["said"].startswith(f"flow 0 {happened} at t = ")
    before = asked
    line = cb.boundary(limit, ("g", "F"), steps=cb.Steps(most=10), events=())
    assert asked - before < 50 * len(line)  # each derivative looks twice
    np.testing.assert_allclose(line["F"] / line["g"], limit["F"], rtol=1e-8)  # all lengths scale


def test_the_doubled_orbit_of_the_moebius_strip_is_the_closed_form() -> None:
    """In the axes that turn along, q = (sqrt mu, 0): twice around, with its own multipliers."""
    for name in ("moebius", "forced doubling"):
        flip = CASES[name].branch.first("PD")
        (arm,) = cb.switch(flip, within={"mu": (-0.1, 0.5)}, events=())
        for at in arm[1:]:
            assert at["period"] == pytest.approx(4 * math.pi, abs=1e-8)
            wanted = [math.exp(-8 * math.pi * at["mu"]), math.exp(-4 * math.pi * (1 + at["mu"]))]
            found = np.sort(at.solution.others.real)[::-1]
            np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-8)


@pytest.mark.parametrize("name", ["shaken pendulum", "pest control"])
def test_branches_leave_what_is_at_rest(name: str) -> None:
    """The pendulum begins to swing; pests come, and as the equations go less than none."""
    (start,) = (at for at in CASES[name].branch.special if at.kind != "EP")
    arms = cb.switch(start, within={CASES[name].free: CASES[name].window})
    assert len(arms) == 1 + (start.kind == "BP")
    for arm in arms:
        assert arm.stop.name == "BOUND"
        assert not arm.doubtful


def test_a_pitchfork_of_cycles_has_both_arms() -> None:
    fork = CASES["pitchfork of cycles"].branch.first("BP")
    arms = cb.switch(fork, within={"mu": (-0.5, 0.5)}, events=())
    ends = sorted(arm[-1]["max(z)"] for arm in arms)
    np.testing.assert_allclose(ends, [-math.sqrt(0.5), math.sqrt(0.5)], atol=1e-8)
