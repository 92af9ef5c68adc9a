"""Coefficients of normal forms against another road: the homological equation, order by order.

The other road substitutes ``x = x0 + q w + q* w* + h20 w^2 + h11 w w* + ...`` into the equations,
expanded exactly by sympy, and compares powers of w at 30 digits. It knows neither the formulas with
inverse matrices nor differences.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import mpmath
import numpy as np
import pytest
import sympy

import contbreather as cb
from contbreather.continuation import Point, Problem, hopf, trace
from contbreather.continuation.algebra.newton import Undefined
from contbreather.continuation.bifurcations.maps import FixedPoint
from contbreather.continuation.curve.curve import Curve
from contbreather.continuation.systems import normal_forms as forms

from .lines import henon
from .zoo import BRUSSELATOR, LORENZ, Array, logistic, rotated, takens, trace_case

# --- the other road ---------------------------------------------------------------------------

W, V = sympy.symbols("w v")  # w and w*


def exactly(value: Any) -> Any:
    """A number of mpmath, or a vector of them, for sympy with all its digits."""
    if isinstance(value, mpmath.matrix):
        return [exactly(one) for one in value]
    if not isinstance(value, mpmath.mpf | mpmath.mpc):
        return sympy.sympify(value)
    real, imaginary = (mpmath.nstr(part, 30) for part in (value.real, value.imag))
    return sympy.Float(real, 30) + sympy.I * sympy.Float(imaginary, 30)


def numbers(values: Any) -> Any:
    """A vector, or a matrix, of sympy's numbers for mpmath."""
    found = sympy.Matrix(values).applyfunc(lambda one: sympy.N(one, 30))
    return mpmath.matrix(
        [[mpmath.mpc(*map(str, one.as_real_imag())) for one in row] for row in found.tolist()]
    )


def cubic(
    equations: Callable[[Sequence[Any]], Sequence[Any]],
    x0: Sequence[Any],
    value: Any,
    rate: Callable[[int, int], Any],
    below: Sequence[tuple[int, int]] = ((2, 0), (1, 1), (0, 2)),
    third: tuple[int, int] = (2, 1),
) -> Any:
    """The coefficient of ``w^2 w*``, or another `third` one, in the normal form of an eigenvalue;
    `rate` says what w^j w*^k is multiplied with by the linear dynamics."""
    mpmath.mp.dps = 30
    n, origin = len(x0), [exactly(one) for one in x0]
    names = sympy.symbols(f"y0:{n}")
    linear = sympy.Matrix(equations(names)).jacobian(names)
    A, one = numbers(linear.subs(dict(zip(names, origin, strict=True)))), mpmath.eye(n)
    q = unit_null(A - value * one)
    series = [x + part * W for x, part in zip(origin, exactly(q), strict=True)]
    if third[1]:
        series = [x + part * V for x, part in zip(series, exactly(q.H.T), strict=True)]

    def of_order(j: int, k: int) -> Any:
        expanded = (sympy.Poly(sympy.expand(one), W, V) for one in equations(series))
        return numbers([poly.coeff_monomial(W**j * V**k) for poly in expanded])

    for j, k in below:
        h = mpmath.lu_solve(rate(j, k) * one - A, of_order(j, k))
        series = [x + part * W**j * V**k for x, part in zip(series, exactly(h), strict=True)]
    # (rate - A) h + c q = right, and h across q: n + 1 equations
    border = mpmath.zeros(n + 1)
    border[:n, :n], border[:n, n], border[n, :n] = rate(*third) * one - A, q, q.H
    return mpmath.lu_solve(border, mpmath.matrix([*of_order(*third), 0]))[n]


def unit_null(matrix: Any) -> Any:
    """Its largest entry is real: the null vector of a real matrix is."""
    _, sizes, right = mpmath.svd_c(matrix)
    n = matrix.rows
    assert sizes[n - 1] < 1e-10
    q = right[n - 1, :].H
    largest = max(q, key=abs)
    return q * (abs(largest) / largest)


def lyapunov_by_series(equations: Any, x0: Sequence[float], omega: Any) -> float:
    value = mpmath.mpc(0, omega)
    return float(mpmath.re(cubic(equations, x0, value, lambda j, k: (j - k) * value)) / omega)


def rotation_by_series(equations: Any, x0: Sequence[float], angle: Any) -> complex:
    mu = mpmath.expj(angle)
    return complex(cubic(equations, x0, mu, lambda j, k: mu**j * mpmath.conj(mu) ** k) / mu)


def flip_by_series(equations: Any, x0: Sequence[float]) -> float:
    """``u -> -u + c u^3``: by the same powers, with ``w* = 0``."""
    c = cubic(equations, x0, -1, lambda j, k: (-1) ** j, below=[(2, 0)], third=(3, 0))
    return float(c.real)


# --- systems ----------------------------------------------------------------------------------


def brusselator(u: Sequence[Any], A: Any = 1, B: Any = 2) -> list[Any]:
    x, y = u
    return [A - (B + 1) * x + x * x * y, B * x - x * x * y]


def lorenz(u: Sequence[Any], r: Any) -> list[Any]:
    x, y, z = u
    return [10 * (y - x), x * (r - z) - y, x * y - sympy.Rational(8, 3) * z]


def test_first_lyapunov_coefficient_of_the_brusselator() -> None:
    point = trace_case(BRUSSELATOR).first("HB")
    wanted = lyapunov_by_series(brusselator, [1, 2], 1)
    assert point.detail["l1"] == pytest.approx(wanted, rel=1e-9)
    assert point.detail["criticality"] == "supercritical"
    assert point.detail["omega"] == pytest.approx(1.0, abs=1e-12)


def test_first_lyapunov_coefficient_of_lorenz_says_subcritical_in_three_dimensions() -> None:
    point = trace_case(LORENZ).first("HB")
    mpmath.mp.dps = 30
    r = mpmath.mpf(470) / 19
    z = r - 1
    x = -mpmath.sqrt(8 * z / 3)
    # trace, minors and determinant: omega^2 is the sum of the principal minors
    omega = mpmath.sqrt(mpmath.mpf(8) / 3 * (r + 10))
    wanted = lyapunov_by_series(lambda u: lorenz(u, sympy.Rational(470, 19)), [x, x, z], omega)
    assert point.detail["l1"] == pytest.approx(wanted, rel=1e-8)
    assert point.detail["omega"] == pytest.approx(float(omega), abs=1e-10)
    assert point.detail["criticality"] == "subcritical"


def coupled(u: Sequence[Any], a: Any) -> list[Any]:
    """A map in three dimensions without any symmetry, sympy's functions left out."""
    x, y, z = u
    return [
        a * x - y + z * x / 2 - x**3,
        x + a * y / 3 + y * z - x * x * y,
        z / 5 + x * x - x * y / 3 + y**3 / 7,
    ]


def test_coefficient_of_neimark_sacker_in_three_dimensions() -> None:
    mine = FixedPoint(
        lambda u, p: np.array(coupled(u, 0.6)) * p["s"], {"x": 0.0, "y": 0.0, "z": 0.0}, {"s": 0.8}
    )
    point = trace(mine, "s", within={"s": (0.5, 1.5)}).first("NS")
    s = mpmath.mpf(1) / mpmath.sqrt(mpmath.mpf("0.6") ** 2 / 3 + 1)
    assert point["s"] == pytest.approx(float(s), abs=1e-12)
    angle = mpmath.acos(s * mpmath.mpf("0.6") * 2 / 3)
    scale = sympy.Float(str(s), 30)
    wanted = rotation_by_series(
        lambda u: [scale * one for one in coupled(u, sympy.Rational(3, 5))], [0, 0, 0], angle
    )
    assert point.detail["d"] == pytest.approx(wanted, rel=1e-8)


@pytest.mark.parametrize("beta", [0.5, -0.3, 0.9])
def test_coefficient_of_period_doubling_in_the_henon_map(beta: float) -> None:
    point = trace(henon(0.5, beta, 0.2), "alpha", within={"y": (0.0, 2.0)}).first("PD")
    exact = sympy.Rational(str(beta))
    y, alpha = (1 + exact) / 2, 3 * (1 + exact) ** 2 / 4
    wanted = flip_by_series(lambda u: [u[1], alpha - exact * u[0] - u[1] ** 2], [y, y])
    assert point.detail["c"] == pytest.approx(wanted, rel=1e-9)


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
        own = brusselator([1e3 * u[0], 1e-4 * u[1]], p["A"], p["B"])
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
