"""What depends on the time has the period that was given, or is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import contbreather as cb
from contbreather.errors import BadInput, NotConverged

from .zoo import STICK_SLIP, TABLE, van_der_pol

TAU = 2 * np.pi
REST = {"x": 0.0, "v": 0.0}


def duffing(t, x, p):
    return [x[1], -0.2 * x[1] - x[0] - x[0] ** 3 + p["F"] * np.cos(p["w"] * t)]


def forced(w, period, **more):
    return cb.cycle(duffing, REST, {"w": w, "F": 0.5}, period=period, settle=30, **more)


def test_a_number_as_period_is_refused_where_the_forcing_follows_a_parameter() -> None:
    problem = forced(1.0, TAU)
    with pytest.raises(BadInput, match="changes with w"):
        cb.trace(problem, "w", within={"w": (1, 1.2)})
    branch = cb.trace(problem, "F", within={"F": (0.45, 0.5)}, towards="down")
    assert branch[-1]["F"] == 0.45  # it need not follow what does not move


def test_twice_the_period_of_the_forcing_is_one() -> None:
    assert forced(1.0, 2 * TAU).start["period"] == pytest.approx(2 * TAU)


def bouncing(period, **functions):
    start, params = {"y": 0.46, "v": 3.1}, {"A": 0.6, "e": 0.8}
    fall = replace(TABLE, **functions)
    return cb.cycle(fall, start, params, period=period, t0=0.9, settle=6 * TAU)


@pytest.mark.parametrize(
    ("name", "period", "functions"),
    [
        ("until", TAU / 2, {}),
        ("reset", TAU / 2, {"until": lambda t, x, p: x[0]}),
        (r"walls\[0\]", TAU, {"walls": lambda t, x, p: 100 + np.cos(t / 2)}),
    ],
)
def test_each_function_of_the_time_has_the_period(name, period, functions) -> None:
    with pytest.raises(BadInput, match=f"{name} is not periodic in t with the period {period:g}"):
        bouncing(period, **functions)


def test_a_forcing_that_is_switched_off_leaves_equilibria_until_it_is_free() -> None:
    rest = cb.equilibrium(duffing, REST, {"w": 1.0, "F": 0.0})
    assert cb.trace(rest, "w", within={"w": (1, 2)})[-1]["w"] == 2
    with pytest.raises(BadInput, match="f depends on t"):
        cb.trace(rest, "F", within={"F": (0, 1)})


def test_an_integration_that_meets_no_surface_ends_with_its_time() -> None:
    """A constant is like a polynomial but for the rounding of 0.1."""
    calls = []

    def surface(t, x, p):
        calls.append(t)
        return 0.1

    def oscillator(t, x, p):
        return [x[1], -x[0]]

    run = cb.integrate(cb.Filippov(oscillator, oscillator, surface), [1.0, 0.0], {}, time=20)
    assert (run.t[-1], len(run.events)) == (20, 0)
    assert len(calls) < 10 * run.t.size


def test_a_field_without_a_slope_that_depends_on_the_time_is_refused() -> None:
    with pytest.raises(BadInput, match="f depends on t"):
        cb.equilibrium(lambda t, x, p: [np.sign(np.cos(t)) - x[0]], {"x": 1.0}, {})
    steady = cb.equilibrium(lambda t, x, p: [1 - abs(x[0])], {"x": 1.0}, {})
    assert steady.start["x"] == 1


def without_mirror() -> cb.Problem:
    """An impact that is none, although the field is antisymmetric."""
    flow = cb.Flow(
        lambda t, x, p: [x[1], np.cos(1.5 * t) - x[0] - 0.1 * x[1]],
        until=lambda t, x, p: 1 - x[0],
        reset=lambda t, x, p: [x[0], -0.7 * x[1]],
    )
    return cb.cycle(flow, {"x": 0.9, "v": -1.0}, {}, period=TAU / 3, settle=40)


def guessed(period) -> cb.Problem:
    """Of what does not depend on the time."""
    return cb.cycle(van_der_pol, {"x": 2.0, "y": 0.0}, {"mu": 1.0}, period=period)


@pytest.mark.parametrize(
    ("flow", "params"),
    [
        (duffing, {"w": 1.0, "F": 0.0}),
        (lambda t, x, p: [x[1], -0.2 * x[1] - x[0] + 1 + 1e-9 * (t % TAU < 1e-3)], {}),
        (lambda t, x, p: [x[1], -0.2 * x[1] - x[0] + (np.cos(t) if p["F"] else 0.0)], {"F": 0.0}),
        (cb.Flow(lambda t, x, p: [x[1], -0.2 * x[1] - x[0]],
                 reset=lambda t, x, p: [x[0], x[1] + 0.1]), {}),
        # 2 pi is just short of a period
        (lambda t, x, p: [x[1], -0.2 * x[1] - x[0] + np.sign(np.sin(t))], {}),
    ],
    ids=["no amplitude", "a short pulse", "switched off", "kicked", "a square wave"],
)  # fmt: skip
def test_a_forcing_that_is_hardly_seen_or_jumps_may_have_a_period(flow, params) -> None:
    problem = cb.cycle(flow, REST, params, period=TAU, settle=20)
    assert problem.start["period"] == pytest.approx(TAU)


def true_or_false() -> cb.Problem:
    flow = cb.Flow(duffing, until=lambda t, x, p: x[0] < 1)
    return cb.cycle(flow, REST, {"w": 1.0, "F": 0.5}, period=TAU, settle=5)


def never_met(**more) -> cb.Problem:
    flow = cb.Flow(lambda t, x, p: [x[1], -x[0]], until=lambda t, x, p: 2 - x[0])
    return cb.cycle(flow, REST | {"v": 1.0}, {}, **more)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: forced(1.0, 5.0), "f is not periodic in t with the period 5"),
        (lambda: bouncing(None), "until depends on t: say period="),
        (lambda: forced(1.0, None), "f depends on t: say period="),
        (without_mirror, "f is not periodic in t"),
        (lambda: cb.equilibrium(duffing, REST, {"w": 1.0, "F": 0.5}),
         r"f depends on t: .*cb\.cycle\(\.\.\., period=\)"),
        # of the origin, whose velocity is zero at all times
        (lambda: cb.equilibrium(lambda t, x, p: [x[1], -x[0] * np.cos(t)], REST, {}),
         "f depends on t"),
        (lambda: guessed(6.66328686), "a multiplier is 1.* nothing depends on the time"),
        (lambda: cb.cycle(lambda t, x, p: [x[1] + 0 * t, (1 - x[0] ** 2) * x[1] - x[0]],
                          {"x": 2.0, "v": 0.0}, {}, period=6.66),
         "nothing depends on the time its period is unknown"),
        (lambda: cb.cycle(STICK_SLIP, {"x": 0.0, "v": 0.5}, {"F": 1.0, "V": 1.0, "d": 0.1},
                          period=6.44, settle=60), "nothing depends on the time"),
        # before the simulation ends in a chatter, or leaves its domain
        (lambda: cb.cycle(TABLE, {"y": 0.46, "v": 3.1}, {"A": 0.3, "e": 0.3}, period=3.0, t0=0.9,
                          settle=40), "until is not periodic in t with the period 3"),
        (lambda: cb.cycle(lambda t, x, p: [np.sqrt(1.5 - x[0]) + np.cos(t)], {"x": 0.0}, {},
                          period=5.0, settle=9), "f is not periodic in t with the period 5"),
        (true_or_false, r"until is True at t = 0.*; a number was expected, positive"),
        (never_met, "one of a family"),
        (lambda: never_met(period=TAU), "one of a family"),
    ],
)  # fmt: skip
def test_what_depends_on_the_time_as_it_must_not_is_refused(make, sentence) -> None:
    with pytest.raises((BadInput, NotConverged), match=sentence):
        make()


def test_of_flows_with_a_clock_it_is_not_said_to_leave_their_period_out() -> None:
    flows = [cb.Flow(lambda t, x, p: [x[1], -x[0]], at=at) for at in (0.5, 0.0)]
    with pytest.raises(NotConverged, match="as a multiplier is 1") as refusal:
        cb.cycle(flows, {"u": 1.0, "v": 0.0}, {}, period=2 * np.pi)
    assert "leave period= out" not in str(refusal.value)
