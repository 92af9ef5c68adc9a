"""Coefficients of normal forms: known ones, in coordinates in which they are not seen."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import mpmath
import numpy as np
import pytest

import contbreather as cb
from contbreather.continuation import Point, Problem, hopf, trace
from contbreather.continuation.algebra.newton import Undefined
from contbreather.continuation.bifurcations.maps import FixedPoint
from contbreather.continuation.curve.curve import Curve
from contbreather.continuation.systems import normal_forms as forms

from .lines import henon
from .zoo import Array, brusselator, logistic, rotated, takens

Field = Callable[[Array, Mapping[str, float]], Any]

# --- in other coordinates ---------------------------------------------------------------------


def disguised(simple: Field, T: Array, bends: Array, *, flow: bool) -> Field:
    """A flow or a map of y in coordinates ``u = T s(y)``, bent by s and mixed by T."""
    (a, b, c), back = bends, np.linalg.inv(T)

    def s(y: Array) -> Array:
        return np.array([y[0], y[1] + a * y[0] ** 2, y[2] + b * y[0] ** 2 + c * y[0] * y[1]])

    def mixed(u: Array, p: Mapping[str, float]) -> Array:
        x, y, z = back @ u
        y = y - a * x * x
        at = np.array([x, y, z - b * x * x - c * x * y])
        image = np.array(simple(at, p))
        # of what is quadratic a difference is the derivative
        return T @ (0.5 * (s(at + image) - s(at - image)) if flow else s(image))

    return mixed


def bent(u: Array, p: Mapping[str, float]) -> list[Any]:
    """``w (m + BEND |w|^2)`` for ``w = x + i y``, and a third one that decays and pulls at it."""
    x, y, z = u
    r = x * x + y * y
    grow, turn = p["m"] + BEND.real * r + z, BEND.imag * r
    return [grow * x - turn * y, turn * x + grow * y, -0.7 * z]


def swirl(u: Array, p: Mapping[str, float]) -> Array:
    """With ``w^2 + 0.3 i |w|^2`` besides: ``BEND.real - 0.3/ANGLE`` is left of its real part."""
    x, y, z = u
    both = [x * x - y * y - ANGLE * y, 2 * x * y + 0.3 * (x * x + y * y) + ANGLE * x, 0 * z]
    return np.add(bent(u, p), both)


def flip(u: Array, p: Mapping[str, float]) -> list[Any]:
    x, y, z = u
    return [-(1 + p["m"]) * x + BEND.real * x**3 + x * z, 0.4 * y, -0.3 * z]


BEND, ANGLE = -0.8 + 0.5j, 1.3
FORMS: dict[str, tuple[Field, complex]] = {
    "HB": (swirl, (BEND.real - 0.3 / ANGLE) / ANGLE),
    "NS": (lambda u, p: [*rotated((u + bent(u, p))[:2], ANGLE), 0.3 * u[2]], BEND),
    "PD": (flip, BEND.real),
}


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("kind", FORMS)
def test_coefficients_do_not_depend_on_the_coordinates(kind: str, seed: int) -> None:
    """But for the length of the eigenvector, which is 1 in any."""
    rng = np.random.default_rng(seed)
    T = np.eye(3) + 0.4 * rng.normal(size=(3, 3))
    simple, wanted = FORMS[kind]
    mixed, start = disguised(simple, T, rng.normal(size=3), flow=kind == "HB"), {"u": np.zeros(3)}
    if kind == "HB":
        mine = Problem(mixed, start, {"m": -0.31}, events=[hopf()])
    else:
        mine = FixedPoint(mixed, start, {"m": -0.31})
    point = trace(mine, "m", within={"m": (-0.4, 0.3)}).first(kind)
    assert point["m"] == pytest.approx(0.0, abs=1e-11)
    eigenvector = T @ ([1, 0, 0] if kind == "PD" else [0.5, -0.5j, 0])
    name = {"HB": "l1", "NS": "d", "PD": "c"}[kind]
    found = point.detail[name] * np.linalg.norm(eigenvector) ** 2
    assert found == pytest.approx(wanted, rel=1e-7)
    assert point.detail["criticality"] == ("subcritical" if kind == "PD" else "supercritical")


@pytest.mark.parametrize("period", [1, 2, 4])
def test_coefficient_of_the_logistic_cascade_whatever_the_period(period: int) -> None:
    """For one unknown c is ``G''^2 / 4 + G''' / 6``, with G iterated as an exact polynomial."""
    start = {1: (0.66, 2.9), 2: (0.84, 3.4), 4: (0.88, 3.52)}[period]
    mine = logistic(*start, period=period)
    point = trace(mine, "r", within={"r": (2.8, 3.6)}).first("PD")
    mpmath.mp.dps = 30

    def iterate(x: Any, r: Any) -> Any:
        for _ in range(period):
            x = r * x * (1 - x)
        return x

    def system(x: Any, r: Any) -> list[Any]:
        return [iterate(x, r) - x, mpmath.diff(lambda y: iterate(y, r), x) + 1]

    x, r = mpmath.findroot(system, (point["x"], point["r"]))
    second, third = (mpmath.diff(lambda y: iterate(y, r), x, order) for order in (2, 3))
    assert point["r"] == pytest.approx(float(r), abs=1e-12)
    assert point.detail["c"] == pytest.approx(float(second**2 / 4 + third / 6), rel=1e-7)


# --- folds ------------------------------------------------------------------------------------


def test_coefficients_of_takens_bogdanov_survive_a_change_of_coordinates() -> None:
    """``x' = y, y' = 2 x^2 - 3 x y`` in other coordinates and with another direction coupled."""
    rng = np.random.default_rng(3)
    T = rng.normal(size=(3, 3))
    back = np.linalg.inv(T)

    def residual(u: Array, p: Mapping[str, float]) -> Array:
        x, y, z = back @ u
        return T @ np.array([y, p["h"] + 2 * x * x - 3 * x * y, -z + p["k"] * x * y])

    curve = Curve(Problem(residual, {"u": np.zeros(3)}, {"h": 0.0, "k": 0.7}), ("h",))
    a, b = forms.takens_bogdanov(Point(curve, np.zeros(4)))
    # |q0| = 1 fixes the length unit along the null vector T e1
    length = float(np.linalg.norm(T[:, 0]))
    assert abs(a.value) == pytest.approx(2 / length, rel=1e-9)
    assert b.value == pytest.approx(-3 / length, rel=1e-9)


def test_cubic_coefficient_at_a_cusp_includes_the_slaved_direction() -> None:
    """``x' = x y - x^3, y' = -y + 2 x^2``: on the centre manifold y = 2 x^2, so c = 2 - 1."""
    mine = Problem(
        lambda u, p: np.array([u[0] * u[1] - u[0] ** 3 + p["h"], -u[1] + 2 * u[0] ** 2]),
        {"x": 0.0, "y": 0.0},
        {"h": 0.0},
    )
    quadratic, cubic_one = forms.cubic_at_cusp(Point(Curve(mine, ("h",)), np.zeros(3)))
    assert abs(quadratic.value) < 1e-12
    assert cubic_one.value == pytest.approx(1.0, rel=1e-10)


# --- what has no coefficient, and rounding ----------------------------------------------------


def test_conservative_systems_have_no_sign() -> None:
    point = trace(henon(1.0, 0.7, 0.5), "beta", within={"beta": (0.5, 1.5)}).first("NS")
    assert point.detail["criticality"] == "degenerate"
    assert abs(point.detail["d"].real) < 1e-11


def test_a_double_eigenvalue_has_no_simple_normal_form() -> None:
    curve = Curve(takens().at(x=0.0, b1=0.0, b2=0.0), ("b1",))
    with pytest.raises(Undefined, match="double eigenvalue"):
        forms.cubic_at_cusp(Point(curve, np.zeros(3)))


@pytest.mark.parametrize("angle", [0.0, math.pi, 2 * math.pi / 3, math.pi / 2])
def test_strong_resonances_have_another_normal_form(angle: float) -> None:
    mine = FixedPoint(lambda u, p: rotated(p["s"] * u, angle), {"u": np.zeros(2)}, {"s": 1.0})
    with pytest.raises(Undefined, match="strong resonance"):
        forms.rotation_coefficient(Point(Curve(mine, ("s",)), np.array([0.0, 0.0, 1.0])), angle)


def test_scales_measure_the_eigenvector() -> None:
    """The same system in other units, with scales that say so: the same coefficient."""

    def residual(u: Array, p: Mapping[str, float]) -> Array:
        own = brusselator().residual([1e3 * u[0], 1e-4 * u[1]], p)
        return np.array([1e-3 * own[0], 1e4 * own[1]])

    mine = Problem(residual, {"x": 1e-3, "y": 1e4}, {"A": 1.0, "B": 1.0},
                   scales={"x": 1e-3, "y": 1e4})  # fmt: skip
    point = trace(mine, "B", within={"B": (0.5, 3)}, events=[hopf()]).first("HB")
    assert point.detail["l1"] == pytest.approx(-0.5, rel=1e-7)


def test_the_cost_is_a_few_jacobians_whatever_the_size() -> None:
    calls = 0

    def jacobian(x: Array, p: Mapping[str, float]) -> Array:
        nonlocal calls
        calls += 1
        matrix = np.diag(-np.ones(x.size) * np.arange(1, x.size + 1))
        matrix[:2, :2] = [[p["m"] - 3 * x[0] ** 2, -1], [1, p["m"]]]
        return matrix

    def residual(x: Array, p: Mapping[str, float]) -> Array:
        head = [p["m"] * x[0] - x[1] - x[0] ** 3, x[0] + p["m"] * x[1]]
        return np.concatenate([head, -np.arange(3, x.size + 1) * x[2:]])

    mine = Problem(residual, {"x": np.zeros(30)}, {"m": 0.0}, jacobian=jacobian)
    curve = Curve(mine, ("m",))
    curve.jacobian(curve.start)
    calls = 0
    l1 = forms.lyapunov_coefficient(Point(curve, curve.start), 1.0)
    assert l1.value == pytest.approx(-0.75, rel=1e-9)  # -3/8 a^3 of the cubic, |q|^2 = 1
    assert calls <= 65


def test_a_coefficient_asks_for_no_derivative_in_a_parameter() -> None:
    calls = 0

    def image(x: Array, p: Mapping[str, float]) -> Array:
        nonlocal calls
        calls += 1
        return p["r"] * x * (1 - x)

    def slopes(x: Array, p: Mapping[str, float]) -> Array:
        return p["r"] * (1 - 2 * x[:, None])

    mine = FixedPoint(image, {"x": 0.6}, {"r": 2.5}, jacobian=slopes)
    point = trace(mine, "r", within={"r": (2.5, 3.5)}).first("PD")
    calls = 0
    assert point.detail["c"] == pytest.approx(9.0, rel=1e-9)
    assert calls == 0


# --- how close is close ---------------------------------------------------------------------------


def turning(angle: float) -> Point:
    """A Neimark-Sacker point at this angle, with terms of second and third order."""

    def image(u: np.ndarray, p: dict[str, float]) -> np.ndarray:
        bent = [0.3 * u[0] ** 2 - u[0] ** 3, 0.0]
        return (1 + p["m"]) * (np.array(rotated(u, angle)) + bent)

    mine = FixedPoint(image, {"x": 0.0, "y": 0.0}, {"m": -0.1})
    return trace(mine, "m", within={"m": (-0.2, 0.2)}).first("NS")


def test_next_to_a_strong_resonance_there_is_a_coefficient_and_on_it_none() -> None:
    resonant = 2 * math.pi / 3
    assert "d" in turning(resonant - 2e-5).detail
    on_it = turning(resonant - 1e-8).detail
    assert "strong resonance" in on_it["criticality"]
    assert "d" not in on_it
    assert on_it["angle"] == pytest.approx(resonant, abs=1e-7)


@pytest.mark.parametrize("start", [0.0, 0.5])
def test_no_coefficient_where_branches_cross_as_a_period_doubles(start: float) -> None:
    """Kopel's duopoly with equal firms has 1 and -1 at once at mu = 1, located to rounding."""

    def duopoly(u: Array, p: Mapping[str, float]) -> Array:
        return p["mu"] * u[::-1] * (1 - u[::-1])

    firms = FixedPoint(duopoly, {"x": start, "y": start}, {"mu": 2.0})
    point = trace(firms, "mu", within={"mu": (0.8, 2.5)}).first("PD")
    assert point["mu"] == pytest.approx(1.0, abs=1e-14)
    assert "resonance" in point["criticality"]


@pytest.mark.parametrize(("second", "double"), [(1e-4, False), (1e-8, True)])
def test_an_eigenvalue_is_double_only_next_to_another_with_the_same_vector(second, double) -> None:
    """By a map with the multipliers -1 and -1 + second, ``-x + y + x^3`` in its first place."""

    def residual(x, p):
        return np.array([-2 * x[0] + x[1] + x[0] ** 3 + p["mu"], (second - 2) * x[1]])

    map_ = cb.Problem(residual, {"x": np.zeros(2)}, {"mu": 0.0})
    point = cb.trace(map_, "mu", within={"mu": (0.0, 0.1)}, events=())[0]
    if double:
        with pytest.raises(Undefined, match="a double eigenvalue with one eigenvector"):
            forms.flip(point)
    else:
        assert forms.flip(point).value == pytest.approx(1.0, rel=1e-6)


def test_coefficients_of_functions_that_are_no_polynomials_have_eight_digits() -> None:
    """Ricker's map ``x exp(r (1 - x))`` doubles at r = 2, where f'' = 0 and f''' = 4.
    Of differences of third order numpy's exp leaves 2e-9 where it has no vector instructions."""
    mine = FixedPoint(lambda x, p: x * np.exp(p["r"] * (1 - x)), {"x": 1.0}, {"r": 1.5})
    point = trace(mine, "r", within={"r": (1.2, 2.3)}).first("PD")
    assert point["r"] == pytest.approx(2.0, abs=1e-12)
    assert point.detail["c"] == pytest.approx(4 / 6, rel=1e-8)
    fast = FixedPoint(lambda x, p: -(1 + p["m"]) * np.sin(20 * x) / 20, {"x": 0.0}, {"m": -0.2})
    there = trace(fast, "m", within={"m": (-0.3, 0.2)}).first("PD")
    assert there.detail["c"] == pytest.approx(400 / 6, rel=1e-7)


@pytest.mark.parametrize("unit", [1e-3, 1e3])
@pytest.mark.parametrize("angle", [0.7, 2.9])
def test_angle_and_coefficient_of_a_neimark_sacker_point(unit: float, angle: float) -> None:
    """``z -> e^(i angle) z (1 + m - |z|^2/unit^2)``: d = -2 over the square of the unit."""

    def image(u: Array, p: Mapping[str, float]) -> list[Any]:
        grow = 1.0 + p["m"] - (u @ u) / unit**2
        return [grow * part for part in rotated(u, angle)]

    mine = cb.FixedPoint(image, {"x": 0.0, "y": 0.0}, {"m": -0.31})
    point = cb.trace(mine, "m", within={"m": (-0.4, 0.4)}).first("NS")
    assert point.detail["angle"] == pytest.approx(angle, abs=1e-9)
    assert point.detail["criticality"] == "supercritical"
    d = complex(point.detail["d"]) * unit**2
    assert d.real == pytest.approx(-2.0, rel=1e-6)  # in units of the eigenvector of length 1
    assert d.imag == pytest.approx(0.0, abs=1e-6)
