"""What depends on the time has the period that was given, or is refused."""

from __future__ import annotations

import numpy as np
import pytest

import contbreather as cb
from contbreather.errors import BadInput, NotConverged

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


def test_a_period_that_the_forcing_does_not_have_is_refused() -> None:
    with pytest.raises(BadInput, match="f is not periodic in t with the period 5"):
        forced(1.0, 5.0)


def test_twice_the_period_of_the_forcing_is_one() -> None:
    assert forced(1.0, 2 * TAU).start["period"] == pytest.approx(2 * TAU)


def test_half_the_period_is_one_of_half_a_symmetric_orbit() -> None:
    half = cb.Flow(duffing, reset=lambda t, x, p: [-x[0], -x[1]])
    orbit = cb.cycle(half, REST, {"w": 1.0, "F": 0.5}, period=lambda p: np.pi / p["w"], settle=60)
    whole = forced(1.0, TAU)
    end = cb.trace(orbit, "F", within={"F": (0.49, 0.5)}, towards="down")[0]
    start = cb.trace(whole, "F", within={"F": (0.49, 0.5)}, towards="down")[0]
    assert end.solution.max["x"] == pytest.approx(start.solution.max["x"], abs=1e-8)


def bouncing(period, **functions):
    """A ball on a table that moves up and down as A sin t."""
    table = {
        "until": lambda t, x, p: x[0] - p["A"] * np.sin(t),
        "reset": lambda t, x, p: [x[0], -p["e"] * x[1] + (1 + p["e"]) * p["A"] * np.cos(t)],
    }
    fall = cb.Flow(lambda t, x, p: [x[1], -1.0], **(table | functions))
    start, params = {"y": 0.46, "v": 3.1}, {"A": 0.6, "e": 0.8}
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


def test_a_hybrid_system_that_depends_on_the_time_needs_a_period() -> None:
    with pytest.raises(BadInput, match="until depends on t: say period="):
        bouncing(None)


def test_half_the_period_is_none_of_an_impact_that_is_no_mirror() -> None:
    """Although the field is antisymmetric."""
    flow = cb.Flow(
        lambda t, x, p: [x[1], np.cos(1.5 * t) - x[0] - 0.1 * x[1]],
        until=lambda t, x, p: 1 - x[0],
        reset=lambda t, x, p: [x[0], -0.7 * x[1]],
    )
    with pytest.raises(BadInput, match="f is not periodic in t"):
        cb.cycle(flow, {"x": 0.9, "v": -1.0}, {}, period=TAU / 3, settle=40)


def test_a_smooth_system_that_depends_on_the_time_needs_a_period() -> None:
    with pytest.raises(BadInput, match="f depends on t: say period="):
        forced(1.0, None)


def test_a_system_that_depends_on_the_time_has_no_equilibria() -> None:
    with pytest.raises(BadInput, match=r"f depends on t: .*cb\.cycle\(\.\.\., period=\)"):
        cb.equilibrium(duffing, REST, {"w": 1.0, "F": 0.5})


def test_a_parametric_forcing_of_the_origin_has_no_equilibria() -> None:
    with pytest.raises(BadInput, match="f depends on t"):
        cb.equilibrium(lambda t, x, p: [x[1], -x[0] * np.cos(t)], REST, {})


def test_a_forcing_that_is_switched_off_leaves_equilibria_until_it_is_free() -> None:
    rest = cb.equilibrium(duffing, REST, {"w": 1.0, "F": 0.0})
    assert cb.trace(rest, "w", within={"w": (1, 2)})[-1]["w"] == 2
    with pytest.raises(BadInput, match="f depends on t"):
        cb.trace(rest, "F", within={"F": (0, 1)})


def test_a_condition_that_is_true_or_false_is_refused() -> None:
    flow = cb.Flow(duffing, until=lambda t, x, p: x[0] < 1)
    with pytest.raises(
        BadInput, match=r"until is True at t = 0.*; a number was expected, positive"
    ):
        cb.cycle(flow, REST, {"w": 1.0, "F": 0.5}, period=TAU, settle=5)


def test_a_condition_that_is_never_met_is_given_up() -> None:
    flow = cb.Flow(lambda t, x, p: [1e5 * np.sin(t)], until=lambda t, x, p: 1e6 - x[0])
    with pytest.raises(NotConverged, match=r"was not met within \d{3,4}(\.\d+)? from t = 0"):
        cb.cycle(flow, {"x": 0.0}, {}, period=TAU)


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
