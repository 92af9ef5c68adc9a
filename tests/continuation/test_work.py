"""What is looked at how often: nothing twice, and nothing that no answer needs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import contbreather as cb

from .zoo import Counted

Array = NDArray[np.float64]
WITHIN = {"m": (-1.0, 1.0)}


def counted(calls: Counter[str], *, jacobian: bool = False) -> cb.Problem:
    """A gently bent curve on which nothing happens."""

    def field(x: Array, p: Mapping[str, float]) -> Any:
        calls["residual"] += 1
        return [x[0] - p["m"], x[1] ** 3 - x[1] + 0.3 * p["m"] - 0.1 * x[0] ** 2]

    def slope(x: Array, p: Mapping[str, float]) -> Any:
        calls["jacobian"] += 1
        return [[1.0, 0.0], [-0.2 * x[0], 3 * x[1] ** 2 - 1.0]]

    more = {"jacobian": slope} if jacobian else {}
    return cb.Problem(field, {"x": 0.0, "y": 1.0}, {"m": 0.0}, **more)


def watched(calls: Counter[str], event: cb.Event) -> cb.Event:
    def test(point: cb.continuation.Point) -> Any:
        calls[event.kind] += 1
        return event.test(point)

    return replace(event, test=test)


@pytest.mark.parametrize(
    ("level", "towards", "each", "more", "found"),
    [
        (5.0, "both", 1, 9, []),  # far from zero all along; more at both ends of each side
        (0.31, "both", 2, 5, [0.31]),
        (0.0, "up", 2, 6, None),  # a start on an event: a look beside it
    ],
)
def test_a_test_is_asked_so_many_times_a_step(level, towards, each, more, found) -> None:
    calls: Counter[str] = Counter()
    events = [watched(calls, cb.user("m", level))]
    branch = cb.trace(counted(calls), "m", within=WITHIN, events=events, towards=towards)
    assert calls["UZ"] <= each * (len(branch) - 1) + more
    places = [point["m"] for point in branch.special if point.kind == "UZ"]
    if found is None:
        assert [point.kind for point in branch.special] in (["UZ", "EP"], ["EP", "EP"])
    else:
        assert places == pytest.approx(found, abs=1e-12)


def test_residuals_and_derivatives_of_a_walk_are_a_few_for_each_point() -> None:
    calls: Counter[str] = Counter()
    branch = cb.trace(counted(calls), "m", within=WITHIN, events=())
    plain = calls["residual"] / len(branch)
    assert plain <= 18.5
    given: Counter[str] = Counter()
    again = cb.trace(counted(given, jacobian=True), "m", within=WITHIN, events=())
    assert abs(len(again) - len(branch)) <= 2
    assert given["jacobian"] / len(again) <= 4.2
    assert given["residual"] / len(again) <= 10.5
    with_events: Counter[str] = Counter()
    events = (cb.fold(), cb.branch_point(), cb.hopf())
    cb.trace(counted(with_events), "m", within=WITHIN, events=events)
    assert with_events["residual"] / len(branch) <= plain + 9.5


def test_a_window_that_no_step_reaches_costs_nothing() -> None:
    asked = []
    for within in (None, {"mu": (-9.0, 9.0)}):
        calls: Counter[str] = Counter()

        def circle(x: Array, p: Mapping[str, float], calls: Counter[str] = calls) -> Any:
            calls["residual"] += 1
            return x[0] ** 2 + p["mu"] ** 2 - 1.0

        # at both folds the parameter turns round
        cb.trace(cb.Problem(circle, {"x": 1.0}, {"mu": 0.0}), "mu", within=within, events=())
        asked.append(calls["residual"])
    assert asked[0] == asked[1]


def test_a_gentle_curve_takes_few_steps() -> None:
    calls: Counter[str] = Counter()
    for largest in (0.05, 0.2):
        branch = cb.trace(
            counted(calls), "m", within=WITHIN, events=(), steps=cb.Steps(largest=largest)
        )
        assert np.max(np.diff(branch["arclength"])) <= largest * (1 + 1e-4)
        assert len(branch) <= 3.0 / largest + 14
    assert len(cb.trace(counted(calls), "m", within=WITHIN, events=())) <= 45


# --- what a boundary may cost ---------------------------------------------------------------------


def only_real(residual: Any) -> Any:
    """The same equations, which take no complex numbers."""

    def field(u: Array, p: Mapping[str, float]) -> Array:
        if any(map(np.iscomplexobj, (u, *p.values()))):
            raise TypeError("real numbers only")
        return residual(u, p)

    return field


def lorenz(u: Array, p: Mapping[str, float]) -> Array:
    x, y, z = u
    return np.array([p["s"] * (y - x), x * (p["r"] - z) - y, x * y - 8 / 3 * z])


def henon(u: Array, p: Mapping[str, float]) -> Array:
    return np.array([u[1], p["a"] - p["b"] * u[0] - u[1] ** 2])


def along_hopf(residual: Counted, *events: cb.Event) -> cb.Branch:
    x = np.sqrt(8 / 3 * 19)
    mine = cb.Problem(residual, {"x": x, "y": x, "z": 19.0}, {"s": 10.0, "r": 20.0}, events=events)
    point = cb.trace(mine, "r", within={"r": (20, 30)}).first("HB")
    residual.calls = 0
    return cb.boundary(point, ("s", "r"), within={"s": (8, 12), "r": (1, 100)})


@pytest.mark.slow
@pytest.mark.parametrize(("analytic", "most"), [(True, 600), (False, 2400)])
def test_a_point_of_a_hopf_curve_of_lorenz_costs_no_more_than_so_many_calls(analytic, most):
    """4103 real calls a point once, 3120 of them for the test of GH."""
    residual = Counted(lorenz if analytic else only_real(lorenz))
    curve = along_hopf(residual, cb.fold(), cb.branch_point(), cb.hopf())
    assert residual.calls < most * len(curve)
    s, r = curve["s"], curve["r"]
    assert abs(r - s * (s + 3 + 8 / 3) / (s - 1 - 8 / 3)).max() < 1e-8


@pytest.mark.slow
@pytest.mark.parametrize(("analytic", "most"), [(True, 400), (False, 1600)])
def test_a_point_of_a_doubling_of_a_map_costs_no_more_than_so_many_calls(analytic: bool, most: int):
    """2576 real calls a point once."""
    residual = Counted(henon if analytic else only_real(henon))
    mine = cb.FixedPoint(residual, {"x": 0.6, "y": 0.6}, {"a": 1.0, "b": 0.5})
    point = cb.trace(mine, "a", within={"a": (1, 3)}).first("PD")
    residual.calls = 0
    curve = cb.boundary(point, ("b", "a"), within={"b": (0.3, 0.7)})
    assert residual.calls < most * len(curve)
    assert abs(curve["a"] - 0.75 * (1 + curve["b"]) ** 2).max() < 1e-10


def test_the_frequency_does_not_set_the_pace_along_a_hopf_curve() -> None:
    """omega^2 changes by 11 here, all else by 4: 133 points once."""
    curve = along_hopf(Counted(lorenz), cb.hopf())
    assert np.ptp(curve["omega2"]) > 10
    assert len(curve) < 60


@pytest.mark.slow
def test_a_boundary_without_a_window_has_an_end() -> None:
    """``4 mu^3 = 27 h^2`` goes on for ever: 4001 points once."""
    mine = cb.Problem(
        lambda x, p: p["h"] + p["mu"] * x - x**3,
        {"x": 1.0},
        {"mu": 1.0, "h": 0.0},
        events=[cb.fold()],
    )
    point = cb.trace(mine, "h", within={"x": (-2, 2)}).first("LP")
    line = cb.boundary(point, ("mu", "h"), towards="up")
    assert len(line) - len(line.special) <= 500
    assert line.stop is cb.continuation.Stop.MOST
    assert "raise Steps.most" in repr(line)
    more = cb.boundary(point, ("mu", "h"), towards="up", steps=cb.Steps(most=520), events=())
    assert len(more) > 510


def test_what_is_known_of_a_place_is_known_of_all_points_there() -> None:
    calls: Counter[str] = Counter()
    point = cb.trace(counted(calls, jacobian=True), "m", within=WITHIN, events=())[5]
    calls.clear()
    slopes = point.jacobian(), replace(point, z=point.z.copy()).jacobian()
    assert np.array_equal(*slopes)
    assert calls["jacobian"] <= 1


@pytest.mark.parametrize(("floor", "most"), [(0.3, 18), (1e-2, 25)])
def test_a_kink_that_stays_clear_of_zero_is_left_early(floor: float, most: int) -> None:
    looks = list[float]()

    def kink(point: cb.continuation.Point) -> float:
        looks.append(point["m"])
        return floor + 10.0 * abs(point["m"] - 0.6151)

    line = cb.Problem(lambda x, p: np.array([x[0] - p["m"]]), {"x": 0.0}, {"m": 0.0})
    steps, event = cb.Steps(first=2.0, largest=2.0), cb.Event("KK", kink)
    found = cb.trace(line, "m", within={"m": (0.0, 1.0)}, towards="up", events=event, steps=steps)
    assert not found.doubtful
    assert len(looks) <= most  # 36 to find out where it is least to six digits


def test_a_determinant_whose_sign_jumps_is_no_branch_point_that_is_looked_for() -> None:
    calls: Counter[str] = Counter()

    def field(x: Array, p: Mapping[str, float]) -> Any:
        calls["residual"] += 1
        side = np.where(np.real(p["m"]) < 0.3, 1.0, -1.0)
        return [side * (x[0] - 0.1 * p["m"] ** 2), x[1] - p["m"] * x[0]]

    jumps = cb.Problem(field, {"x": 0.0, "y": 0.0}, {"m": 0.0})
    branch = cb.trace(jumps, "m", within=WITHIN, towards="up", events=[cb.branch_point()])
    assert [point.kind for point in branch.doubtful] == ["BP"]
    assert calls["residual"] < 5000  # 11,000 by an iteration for each step that is halved


def test_predictions_are_off_by_the_fourth_power_of_a_step() -> None:
    """By the last three tangents; two would leave the third. The most that is met of the equations
    is what a prediction leaves."""

    def left_at(size: float) -> float:
        met: list[float] = []

        def helix(x: Array, p: Mapping[str, float]) -> Any:
            left = [x[0] - np.cos(p["m"]), x[1] - np.sin(p["m"])]
            met.append(max(map(abs, left)))
            return left

        problem = cb.Problem(
            helix, {"x": 1.0, "y": 0.0}, {"m": 0.0}, jacobian=lambda x, p: [[1.0, 0.0], [0.0, 1.0]]
        )
        steps = cb.Steps(first=size, largest=size, most=12)
        cb.trace(problem, "m", events=(), steps=steps, towards="up")
        return max(met[len(met) // 2 :])

    assert left_at(0.04) / left_at(0.02) == pytest.approx(16, rel=0.02)


@pytest.mark.parametrize("unit", [1.0, 1e-3])
def test_a_step_of_many_unknowns_takes_one_derivative_and_is_as_exact(unit: float) -> None:
    """That at the point before serves; also of what is small beside a parameter."""
    calls: Counter[str] = Counter()
    pulls = np.linspace(0.0, 0.2, 16)

    def field(x: Array, p: Mapping[str, float]) -> Any:
        calls["residual"] += 1
        y = x / unit
        return p["T"] * 1e-4 * np.exp(-y) - y + pulls * np.roll(y, 1)

    def slope(x: Array, p: Mapping[str, float]) -> Any:
        calls["jacobian"] += 1
        own = -p["T"] * 1e-4 * np.exp(-x / unit) - 1.0
        return (np.diag(own) + pulls[:, None] * np.roll(np.eye(16), 1, axis=0)) / unit

    problem = cb.Problem(field, {"u": np.full(16, 0.6 * unit)}, {"T": 1e4}, jacobian=slope)
    branch = cb.trace(problem, "T", within={"T": (1e3, 4e4)}, events=())
    assert calls["jacobian"] <= 1.1 * len(branch)
    assert calls["residual"] <= 12 * len(branch)
    off = [abs(field(x, {"T": T})).max() for x, T in zip(branch["u"], branch["T"], strict=True)]
    assert max(off) < 1e-8
