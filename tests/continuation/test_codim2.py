"""What happens on curves of folds and Hopf points: found where it is known to be, and named."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any

import mpmath
import numpy as np
import pytest
import sympy

from contbreather.continuation import (
    Branch,
    Point,
    Problem,
    Steps,
    Stop,
    boundary,
    branch_point,
    fold,
    hopf,
    trace,
)

from .zoo import NEUTRAL_SADDLE, Array, cusp_surface, takens

FLOW = (fold(), hopf())
WINDOW = {"b1": (-2.0, 2.0), "b2": (-2.0, 2.0)}


def kinds(branch: Branch) -> list[str]:
    return [point.kind for point in branch.special if point.kind != "EP"]


def at(point: Point, **values: float) -> None:
    for name, value in values.items():
        assert point[name] == pytest.approx(value, abs=1e-9), name


# --- normal forms -----------------------------------------------------------------------------


def both_curves(problem: Problem | None = None) -> dict[str, Branch]:
    branch = trace(problem or takens(), "b1", within={"b1": (-1, 1)}, events=FLOW)
    return {
        kind: boundary(branch.first(kind), ("b2", "b1"), within=WINDOW, events=FLOW)
        for kind in ("LP", "HB")
    }


@pytest.mark.parametrize("kind", ["LP", "HB"])
def test_takens_bogdanov_is_met_from_both_sides_under_its_own_name(kind: str) -> None:
    curve = both_curves()[kind]
    assert kinds(curve) == ["BT"]
    assert curve.doubtful == ()  # nor a ZH without a pair
    point = curve.first("BT")
    at(point, x=0, y=0, b1=0, b2=0)
    assert (point.detail["a"], point.detail["b"]) == pytest.approx((1, 1), rel=1e-9)


def test_hopf_curve_ends_at_takens_bogdanov_as_neutral_saddles_are_no_hopf_points() -> None:
    curve = both_curves()["HB"]
    assert Stop.EVENT in (curve.stop, curve.began)
    assert curve["b2"].max() < 1e-12


def test_from_takens_bogdanov_the_other_curve_is_followed() -> None:
    curves = both_curves()
    hopf_curve = boundary(curves["LP"].first("BT"), ("b2", "b1"), within=WINDOW)
    assert abs(hopf_curve["b1"]).max() < 1e-12  # HB: x = 0, b1 = 0
    assert hopf_curve["b2"].min() == -2
    fold_curve = boundary(curves["HB"].first("BT"), ("b2", "b1"), within=WINDOW)
    assert abs(4 * fold_curve["b1"] - fold_curve["b2"] ** 2).max() < 1e-12


def test_without_hopf_among_the_events_a_fold_curve_knows_no_flow() -> None:
    branch = trace(takens(), "b1", within={"b1": (-1, 1)}, events=[fold()])
    curve = boundary(branch.first("LP"), ("b2", "b1"), within=WINDOW, events=[fold()])
    assert kinds(curve) == []


def test_a_degenerate_double_zero_is_not_labelled() -> None:
    """``x' = y, y' = b1 + b2 x + x^2`` has b = 0: its double zero is no BT."""

    def residual(u: Array, p: Mapping[str, float]) -> Array:
        return np.array([u[1], p["b1"] + p["b2"] * u[0] + u[0] ** 2])

    mine = Problem(residual, {"x": 1.0, "y": 0.0}, {"b1": -2.0, "b2": 1.0})
    point = trace(mine, "b1", within={"b1": (-3, 1)}, events=FLOW).first("LP")
    curve = boundary(point, ("b2", "b1"), within={"b2": (-2, 2)}, events=FLOW)
    assert kinds(curve) == []


def test_cusp_has_its_coefficient() -> None:
    branch = trace(cusp_surface(-0.9, 1.0), "h", within={"x": (-2, 2)}, events=[fold()])
    curve = boundary(branch.first("LP"), ("mu", "h"), within={"mu": (-1, 2)}, events=[fold()])
    assert kinds(curve) == ["CP"]
    at(curve.first("CP"), x=0, mu=0, h=0)
    assert curve.first("CP").detail["c"] == pytest.approx(-1, rel=1e-9)


def test_a_quartic_fold_is_no_cusp() -> None:
    """``h + mu x + x^4``: where folds meet the cubic coefficient vanishes as well."""
    mine = Problem(
        lambda x, p: np.array([p["h"] + p["mu"] * x[0] + p["s"] * x[0] ** 2 + x[0] ** 4]),
        {"x": 1.0},
        {"mu": 1.0, "h": -2.0, "s": 0.0},
    )
    point = trace(mine, "h", within={"x": (-2, 2)}, events=[fold()]).first("LP")
    curve = boundary(point, ("mu", "h"), within={"mu": (-2, 2)}, events=[fold()])
    assert kinds(curve) == []


def bautin(u: Array, p: Mapping[str, float]) -> Array:
    """Normal form of Bautin: l1 = 2 b2, as |q| = 1 means x = sqrt(2) Re w."""
    x, y = u
    r = x * x + y * y
    return np.array(
        [
            p["b1"] * x - y + p["b2"] * x * r - x * r * r,
            x + p["b1"] * y + p["b2"] * y * r - y * r * r,
        ]
    )


def test_generalised_hopf_is_where_the_first_lyapunov_coefficient_vanishes() -> None:
    mine = Problem(bautin, {"x": 0.0, "y": 0.0}, {"b1": -0.5, "b2": -0.3})
    point = trace(mine, "b1", within={"b1": (-1, 1)}, events=FLOW).first("HB")
    assert point.detail["l1"] == pytest.approx(-0.6, rel=1e-9)
    curve = boundary(point, ("b2", "b1"), within=WINDOW, events=FLOW)
    assert kinds(curve) == ["GH"]
    at(curve.first("GH"), b1=0, b2=0)


def fold_hopf(u: Array, p: Mapping[str, float]) -> Array:
    x, y, z = u
    return np.array(
        [p["m2"] * x - y + x * z, x + p["m2"] * y + y * z, p["m1"] + z * z - x * x - y * y]
    )


@pytest.mark.parametrize("kind", ["LP", "HB"])
def test_zero_hopf_is_met_from_both_sides_under_its_own_name(kind: str) -> None:
    mine = Problem(fold_hopf, {"x": 0.0, "y": 0.0, "z": 0.5}, {"m1": -0.25, "m2": 0.2})
    window = {"m1": (-1, 1), "z": (-1, 1)}
    point = trace(mine, "m1", within=window, events=FLOW).first(kind)
    curve = boundary(point, ("m2", "m1"), within={"m2": (-1, 1)}, events=FLOW)
    assert kinds(curve) == ["ZH"]
    at(curve.first("ZH"), z=0, m1=0, m2=0)
    assert curve.first("ZH").detail["omega"] == pytest.approx(1, abs=1e-9)
    other = boundary(curve.first("ZH"), ("m2", "m1"), within={"m2": (-1, 1)}, events=FLOW)
    assert other.problem.label == f"{'HB' if kind == 'LP' else 'LP'} boundary"


def test_a_neutral_saddle_on_a_fold_curve_is_no_zero_hopf() -> None:
    """Eigenvalues 0, 1 + m and 2m - 1 on the whole fold curve: a sum vanishes at m = 0."""

    def residual(u: Array, p: Mapping[str, float]) -> Array:
        return np.array([p["h"] - u[0] ** 2, (1 + p["m"]) * u[1], (2 * p["m"] - 1) * u[2]])

    mine = Problem(residual, {"x": 0.5, "y": 0.0, "z": 0.0}, {"h": 0.25, "m": -0.3})
    point = trace(mine, "h", within={"x": (-1, 1)}, events=FLOW).first("LP")
    curve = boundary(point, ("m", "h"), within={"m": (-0.4, 0.4)}, events=FLOW)
    assert kinds(curve) == []
    assert any("neutral saddle" in p.detail["reason"] for p in curve.doubtful)


def test_double_hopf_is_where_a_second_pair_reaches_the_axis() -> None:
    def residual(u: Array, p: Mapping[str, float]) -> Array:
        a, b, c, d = u
        r = np.array([a * a + b * b] * 2 + [c * c + d * d] * 2)
        linear = [p["m"] * a - b, a + p["m"] * b, p["k"] * c - 1.7 * d, 1.7 * c + p["k"] * d]
        return np.array(linear) - u * r

    start = dict.fromkeys("abcd", 0.0)
    point = trace(
        Problem(residual, start, {"m": -0.25, "k": 0.2}), "m", within={"m": (-1, 1)}, events=FLOW
    ).first("HB")
    curve = boundary(point, ("k", "m"), within={"k": (-1, 1)}, events=FLOW)
    assert kinds(curve) == ["HH"]
    at(curve.first("HH"), m=0, k=0)


def test_a_neutral_saddle_has_no_lyapunov_coefficient() -> None:
    branch = trace(NEUTRAL_SADDLE.problem, "m", within=NEUTRAL_SADDLE.within, events=FLOW)
    assert kinds(branch) == []


# --- Bazykin's predators and prey: everything at once -----------------------------------------


def bazykin(u: Sequence[Any], alpha: Any, delta: Any) -> list[Any]:
    x, y = u
    eaten = x * y / (1 + alpha * x)
    return [x - eaten - x * x / 100, -y + eaten - delta * y * y]


@cache
def bazykin_at(kind: str, guess: tuple[float, ...]) -> tuple[float, ...]:
    """(x, y, alpha, delta) at 30 digits from what defines each kind, derived by sympy."""
    mpmath.mp.dps = 30
    x, y, alpha, delta = names = sympy.symbols("x y alpha delta")
    F = sympy.Matrix(bazykin(names[:2], alpha, delta))
    A = F.jacobian([x, y])
    conditions = {
        "BT": lambda: [A.trace(), A.det()],
        "CP": lambda: [A.det(), _along_fold(F, A, (x, y))],
        "GH": lambda: [A.trace(), _guckenheimer_holmes(F, A, (x, y))],
    }[kind]()
    system = sympy.lambdify(names, [*F, *conditions], "mpmath")
    return tuple(float(value) for value in mpmath.findroot(system, guess))


def _along_fold(F: Any, A: Any, u: tuple[Any, Any]) -> Any:
    """The determinant does not change along the null vector of the fold: a cusp."""
    null = (-A[0, 1], A[0, 0])
    return sum(sympy.diff(A.det(), name) * part for name, part in zip(u, null, strict=True))


def _guckenheimer_holmes(F: Any, A: Any, u: tuple[Any, Any]) -> Any:
    """Their (3.4.11) for the planar flow in coordinates in which its linear part is a rotation."""
    omega = sympy.sqrt(A.det())
    T = sympy.Matrix([[A[0, 1], 0], [-A[0, 0], -omega]])
    a, b = sympy.symbols("a b")
    shift = T * sympy.Matrix([a, b])
    moved = F.subs({u[0]: u[0] + shift[0], u[1]: u[1] + shift[1]}, simultaneous=True)
    f, g = T.inv() * moved

    def d(h: Any, *by: Any) -> Any:
        return sympy.diff(h, *by).subs({a: 0, b: 0})

    cubic = d(f, a, a, a) + d(f, a, b, b) + d(g, a, a, b) + d(g, b, b, b)
    square = (
        d(f, a, b) * (d(f, a, a) + d(f, b, b))
        - d(g, a, b) * (d(g, a, a) + d(g, b, b))
        - d(f, a, a) * d(g, a, a)
        + d(f, b, b) * d(g, b, b)
    )
    return cubic + square / omega


BAZYKIN = Problem(
    lambda u, p: np.array(bazykin(u, p["alpha"], p["delta"])),
    {"x": 3.0, "y": 1.843},
    {"alpha": 0.3, "delta": 0.314},
    events=(fold(), branch_point(), hopf()),
)
LONG = Steps(largest=2.0)
PREY = {"alpha": (0.01, 2.0), "delta": (0.0, 5.0), "x": (0.01, 200.0)}


@cache
def bazykin_folds() -> Branch:
    within = {"delta": (0.0, 5.0), "x": (0.01, 150.0)}
    branch = trace(BAZYKIN, "delta", within=within, steps=LONG)
    return boundary(branch.first("LP"), ("alpha", "delta"), within=PREY, steps=LONG)


def check(point: Point) -> None:
    values = (point["x"], point["y"], point["alpha"], point["delta"])
    wanted = bazykin_at(point.kind, values)
    assert np.allclose(values, wanted, rtol=1e-8, atol=0), point


def test_all_points_on_the_closed_fold_curve_of_bazykin() -> None:
    curve = bazykin_folds()
    assert curve.stop is Stop.CLOSED
    assert kinds(curve) == ["CP", "BT", "CP", "BT"]
    for point in curve.special:
        check(point)


def test_generalised_hopf_of_bazykin_on_the_curve_that_starts_at_takens_bogdanov() -> None:
    far = max((p for p in bazykin_folds().special if p.kind == "BT"), key=lambda p: p["x"])
    curve = boundary(far, ("alpha", "delta"), within=PREY, steps=LONG)
    assert kinds(curve) == ["BT", "GH"]
    check(curve.first("GH"))


def test_criticality_changes_at_generalised_hopf() -> None:
    far = max((p for p in bazykin_folds().special if p.kind == "BT"), key=lambda p: p["x"])
    curve = boundary(far, ("alpha", "delta"), within=PREY, steps=LONG)
    place = list(curve).index(curve.first("GH"))
    test = next(event.test for event in curve.problem.events if event.kind == "GH")
    assert test(curve[place - 1]) * test(curve[place + 1]) < 0


@pytest.mark.parametrize("shuffle", [lambda u: u[::-1], lambda u: -u, lambda u: 3.0 * u])
def test_names_do_not_depend_on_the_coordinates(shuffle: Callable[[Array], Array]) -> None:
    """The same flow in other coordinates; ``3 u`` slows nothing down."""
    factor = 3.0 if abs(shuffle(np.ones(2))[0]) == 3.0 else 1.0

    def residual(u: Array, p: Mapping[str, float]) -> Array:
        inner = shuffle(u) / factor**2
        return shuffle(takens().residual(inner, p))

    x = 0.5 + math.sqrt(0.3)
    start = shuffle(np.array([x, 0.0]))
    mine = Problem(residual, {"u": start}, {"b1": -0.05, "b2": -1.0})
    for curve in both_curves(mine).values():
        assert kinds(curve) == ["BT"]
        at(curve.first("BT"), b1=0, b2=0)
