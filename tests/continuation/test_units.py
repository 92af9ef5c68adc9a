"""Units that must not decide: states, parameters and time in others than those of order one."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pytest

import contbreather as cb
from contbreather.continuation import Problem

EVENTS = (cb.fold(), cb.branch_point(), cb.hopf())


def in_units(
    rates: Callable[[Any, Mapping[str, float]], list[Any]],
    start: Mapping[str, float],
    params: Mapping[str, float],
    units: Mapping[str, float],
    time: float,
    **more: Any,
) -> Problem:
    """The flow ``x' = rates`` with each quantity multiplied by its unit."""
    sizes = np.array([units[name] for name in start])

    def residual(x: Any, p: Mapping[str, float]) -> Any:
        return np.array(rates(x / sizes, {n: p[n] / units[n] for n in params})) * sizes / time

    begin, at = ({n: v * units[n] for n, v in of.items()} for of in (start, params))
    return Problem(residual, begin, at, **more)


def rods(x: Any, p: Mapping[str, float]) -> list[Any]:
    """Two rods that buckle at P = 1 and at P = 3."""
    a, b = x
    return [-2 * a + b + p["P"] * np.sin(a), a - 2 * b + p["P"] * np.sin(b)]


def test_branch_points_do_not_depend_on_the_units_of_equations() -> None:
    units = {"a": 1e-7, "b": 1e8, "P": 1e11}
    problem = in_units(rods, {"a": 0.0, "b": 0.0}, {"P": 0.5}, units, 1e-9, scales=units)
    branch = cb.trace(problem, "P", within={"P": (1e10, 4e11)}, events=EVENTS)
    found = {point.label: point["P"] / 1e11 for point in branch.special}
    assert found == pytest.approx({"EP1": 0.1, "BP1": 1.0, "BP2": 3.0, "EP2": 4.0}, abs=1e-9)
    assert not branch.doubtful


def epidemic(x: Any, p: Mapping[str, float]) -> list[Any]:
    susceptible, ill = x
    new = p["R"] * susceptible * ill
    return [1 - susceptible - new, new - ill - p["c"] * ill / (1 + 20 * ill)]


def test_a_curve_of_branch_points_does_not_depend_on_the_units_of_its_parameters() -> None:
    units = {"S": 1e-7, "I": 1e9, "R": 1e11, "c": 1e-2}
    start, params = {"S": 1.0, "I": 0.0}, {"R": 1.0, "c": 2.0}
    problem = in_units(epidemic, start, params, units, 0.1, scales=units)
    R, c = units["R"], units["c"]
    branch = cb.trace(problem, "R", within={"R": (0.5 * R, 5 * R)}, events=EVENTS)
    curve = cb.boundary(branch.first("BP"), ("c", "R"), within={"c": (0.5 * c, 6 * c)})
    assert [point.label for point in curve.special] == ["EP1", "EP2"]
    assert curve["R"] / R == pytest.approx(1 + curve["c"] / c)


def electrostatic(x: Any, p: Mapping[str, float]) -> list[Any]:
    """A plate drawn by a voltage, which it gives in to at e V^2 = 4/27."""
    u, v = x
    return [v, -u - 0.5 * v + p["e"] * p["V"] ** 2 / (1 - u) ** 2]


def test_cusps_on_a_curve_of_folds_do_not_depend_on_units() -> None:
    units = {"u": 1e-7, "v": 1e10, "V": 1.0, "e": 10.0}
    problem = in_units(
        electrostatic, {"u": 0.0, "v": 0.0}, {"V": 0.1, "e": 1.0}, units, 1e3, scales=units
    )
    branch = cb.trace(problem, "V", within={"V": (0.01, 1.0)}, events=EVENTS)
    curve = cb.boundary(branch.first("LP"), ("e", "V"), within={"e": (1.0, 40.0)})
    assert curve["e"] / 10 * curve["V"] ** 2 == pytest.approx(4 / 27)
    assert [point.label for point in curve.special] == ["EP1", "EP2"]
    assert not curve.doubtful


def test_hopf_points_are_found_without_scales_where_one_state_is_a_million_of_the_other() -> None:
    def brusselator(x: Any, p: Mapping[str, float]) -> list[Any]:
        a, b = x
        return [1 - (p["B"] + 1) * a + a * a * b, p["B"] * a - a * a * b]

    plain = dict.fromkeys("abB", 1.0)
    units = {"a": 1e3, "b": 1e-3, "B": 100.0}
    first, other = (
        cb.trace(
            in_units(brusselator, {"a": 1.0, "b": 1.0}, {"B": 1.0}, of, time),
            "B", within={"B": (0.5 * of["B"], 4 * of["B"])}, events=EVENTS,
        )
        for of, time in ((plain, 1.0), (units, 1e4))
    )  # fmt: skip
    hopf, same = first.first("HB"), other.first("HB")
    assert same["B"] / 100 == pytest.approx(hopf["B"])
    assert same.detail["omega"] * 1e4 == pytest.approx(hopf.detail["omega"])
    assert same.detail["criticality"] == hopf.detail["criticality"]
    assert not other.doubtful


def test_what_may_be_due_to_sizes_names_them() -> None:
    units = {"x": 1e-4, "r": 10.0, "h": 0.1}
    leaping = in_units(
        lambda x, p: [p["h"] + p["r"] * x[0] - x[0] ** 3],
        {"x": -1.5}, {"r": 1.0, "h": -1.875}, units, 1e-4,
    )  # fmt: skip
    branch = cb.trace(leaping, "h", within={"h": (-0.3, 0.3)}, events=EVENTS)
    assert branch.doubtful
    for point in branch.doubtful:
        assert "give the problem scales={'x': " in point.detail["reason"]
    line = Problem(lambda x, p: np.array([x[0] - p["E"]]), {"x": 0.0}, {"E": 0.0})
    branch = cb.trace(line.at(E=2e5, x=2e5), "E", towards="up", steps=cb.Steps(most=3))
    assert "give the problem scales={'x': 200000.0, 'E': 200000.0}" in branch.reason
    none = Problem(lambda x, p: np.array([x[0] ** 2 + 1e12]), {"x": 1e6}, {"E": 0.0})
    with pytest.raises(cb.NotConverged, match=r"scales=\{'x': 1000000.0\}"):
        none.solve()
    small = cb.FixedPoint(
        lambda x, p: 1e-6 * (p["h"] - (1 + p["m"]) * np.sin(x / 1e-6)),
        {"x": 5e-8}, {"m": -0.31, "h": 0.1},
    )  # fmt: skip
    doubled = cb.trace(small, "m", within={"m": (-0.4, 0.4)}).first("PD")
    with pytest.raises(cb.BadInput, match=r"of the locus does not fit .* scales=\{'x': 5e-08\}"):
        cb.boundary(doubled, ("m", "h"))


def test_a_derivative_that_is_none_beside_the_start_gives_no_size_of_its_row() -> None:
    """In units of 1 a short way off the start is a million times the state, beyond all values."""
    units = {"x": 1e-6, "mu": 1.0}
    problem = in_units(
        lambda x, p: [p["mu"] - np.where(abs(x[0]) < 100.0, x[0], np.nan) ** 2],
        {"x": 1.0}, {"mu": 1.0}, units, 1.0,
    )  # fmt: skip
    branch = cb.trace(problem, "mu", within={"mu": (-1.0, 4.0)}, events=EVENTS)
    assert np.isfinite(branch[0].curve.row_scales).all()


def test_what_passes_zero_where_an_event_is_in_doubt_is_not_called_small() -> None:
    problem = Problem(
        lambda x, p: np.append(x[0] - p["m"], (p["m"] - 5e-4) * x[1:] - x[1:] ** 3),
        {"x": 0.0, "of": np.zeros(2)}, {"m": 0.0},
    )  # fmt: skip
    branch = cb.trace(problem, "m", within={"m": (-1.0, 1.0)}, events=EVENTS)
    assert branch.doubtful
    assert all("scales" not in point.detail["reason"] for point in branch.doubtful)
    line = Problem(lambda x, p: np.array([x[0] - p["E"]]), {"x": 1.0}, {"E": 1.0})
    assert "scales" not in cb.trace(line, "E", steps=cb.Steps(most=300)).reason
    with pytest.raises(cb.NotConverged, match="start closer"):
        Problem(lambda x, p: np.array([x[0] ** 2 + 1]), {"x": 1e-6}, {"E": 0.0}).solve()


def test_l1_has_a_sign_whatever_the_units_of_states() -> None:
    def brusselator(x: Any, p: Mapping[str, float]) -> list[Any]:
        a, b = x
        return [1 - (p["B"] + 1) * a + a * a * b, p["B"] * a - a * a * b]

    units = {"a": 1e6, "b": 1.0, "B": 1.0}
    problem = in_units(brusselator, {"a": 1.0, "b": 1.0}, {"B": 1.0}, units, 1.0)
    hopf = cb.trace(problem, "B", within={"B": (0.5, 4.0)}, events=EVENTS).first("HB")
    # -1/2 of the vector (1, -1 + i), of length sqrt(3), as 1: of one that is 1 in a thrice that
    assert hopf["l1"] == pytest.approx(-1.5e-12, rel=1e-6)
    assert hopf["criticality"] == "supercritical"


@pytest.mark.parametrize("unit", [1e-3, 1e-6])
def test_coefficients_do_not_depend_on_small_units_of_states(unit: float) -> None:
    """Of ``-(1 + m) sin x`` c = 1/6; of ``z' = (m + i) z - (1 - exp(-|z|^2)) z`` l1 = -2 at 0."""

    def sine(x: Any, p: Mapping[str, float]) -> Any:
        return -(1 + p["m"]) * unit * np.sin(x / unit)

    mine = cb.FixedPoint(sine, {"x": 0.0}, {"m": -0.31})
    doubled = cb.trace(mine, "m", within={"m": (-0.4, 0.4)}).first("PD")
    assert doubled.detail["c"] * unit**2 == pytest.approx(1 / 6, rel=1e-8)

    def spiral(x: Any, p: Mapping[str, float]) -> Any:
        grow = p["m"] - 1 + np.exp(-(x @ x) / unit**2)
        return grow * x + np.array([-x[1], x[0]])

    rest = Problem(spiral, {"x": 0.0, "y": 0.0}, {"m": -0.31})
    hopf = cb.trace(rest, "m", within={"m": (-0.4, 0.4)}, events=EVENTS).first("HB")
    assert hopf["l1"] * unit**2 == pytest.approx(-2.0, rel=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("time", [1e-6, 1.0, 1e6])
def test_coefficients_of_bt_are_in_scales_whatever_the_units_of_states(time: float) -> None:
    def takens(x: Any, p: Mapping[str, float]) -> list[Any]:
        u, v = x - 1
        return [v, p["c"] + p["d"] * u + u**2 - u * v]

    units = {"x": 1e4, "y": 1.0, "c": 1.0, "d": 1.0}
    problem = in_units(takens, {"x": 0.2, "y": 1.0}, {"c": -0.5, "d": 0.3}, units, time)
    fold = cb.trace(problem, "c", within={"c": (-1.0, 0.5)}, events=EVENTS).first("LP")
    point = cb.boundary(fold, ("d", "c"), within={"d": (-1, 1)}, events=EVENTS).first("BT")
    assert (point["a"], point["b"]) == pytest.approx((1e-4 / time**2, -1e-4 / time), rel=1e-6)
