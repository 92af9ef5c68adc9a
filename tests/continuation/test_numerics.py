"""The parts under the walk, each where its answer is known: differences, Newton, coefficients."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import contbreather as cb
from contbreather.continuation import Problem, Stop, trace
from contbreather.continuation.algebra import derivatives
from contbreather.continuation.algebra.newton import Dense, Undefined, approach, newton
from contbreather.continuation.bifurcations.maps import FixedPoint
from contbreather.continuation.curve.curve import Curve
from contbreather.errors import NotConverged

from .zoo import CIRCLE, counted, scalar

Array = NDArray[np.float64]
Params = Mapping[str, float]


# --- differences at the edge of a domain ----------------------------------------------------------


def rimmed(low: float, high: float):
    """A smooth function that has no value beyond its rims."""

    def function(z: Array) -> Array:
        if z[0] < low or z[0] > high:
            raise Undefined("beyond the edge")
        return np.array([math.sin(z[0]) + z[1] ** 2, math.exp(z[0]) * z[1]])

    return function


def exact(z: Array) -> Array:
    x, y = z
    return np.array([[math.cos(x), 2 * y], [y * math.exp(x), math.exp(x)]])


@pytest.mark.parametrize("x", [-1.0, -0.999999, 0.0, 0.5, 1.999999, 2.0])
def test_differences_reach_to_both_rims_by_steps_to_one_side(x: float) -> None:
    z = np.array([x, 0.7])
    found = derivatives.differences(rimmed(-1.0, 2.0), z, one_sided=True)
    assert found == pytest.approx(exact(z), abs=3e-7)


@pytest.mark.parametrize("x", [-1.0, 2.0])
def test_without_leave_there_is_no_derivative_at_a_rim(x: float) -> None:
    with pytest.raises(Undefined):
        derivatives.differences(rimmed(-1.0, 2.0), np.array([x, 0.7]))


@pytest.mark.parametrize("off", [1e-3, 1e-4, 1e-6])
def test_next_to_a_rim_shorter_steps_are_central_all_the_same(off: float) -> None:
    z = np.array([2.0 - off, 0.7])
    assert derivatives.differences(rimmed(-1.0, 2.0), z) == pytest.approx(exact(z), abs=1e-7)


def test_a_point_between_two_rims_too_close_together_has_no_derivative() -> None:
    with pytest.raises(Undefined):
        derivatives.differences(rimmed(0.0, 1e-9), np.array([5e-10, 0.7]), one_sided=True)


def test_steps_of_differences_follow_the_scales() -> None:
    """A function of x/1000 whose unknown starts at zero: its step is relative to its scale."""
    seen: list[float] = []

    def function(z: Array) -> Array:
        seen.append(abs(z[0]))
        return np.array([math.sin(z[0] / 1000.0)])

    found = derivatives.differences(function, np.zeros(1), scales=np.array([1000.0]))
    assert found[0, 0] == pytest.approx(1e-3, rel=1e-11)
    assert 0.1 < max(seen) < 10.0
    seen.clear()
    derivatives.differences(function, np.zeros(1), scales=np.array([1000.0]), finer=64.0)
    assert max(seen) < 0.1


# --- Newton ---------------------------------------------------------------------------------------


def test_a_determinant_keeps_its_sign_whatever_rows_are_exchanged() -> None:
    rng = np.random.default_rng(0)
    for size in (1, 2, 3, 6):
        for _ in range(20):
            matrix, right = rng.normal(size=(size, size)), rng.normal(size=size)
            factors = Dense(matrix[:-1], matrix[-1])
            found = factors.solve(right[:-1], right[-1])
            assert found == pytest.approx(np.linalg.solve(matrix, right))
            assert factors.sign() == np.sign(np.linalg.det(matrix))
    singular = Dense(np.zeros((2, 2)), None)
    assert (singular.solve(np.ones(2)), singular.sign()) == (None, 0)
    assert Dense(np.ones((2, 2))).solve(np.ones(2)) is None


def curve_of(function, slope) -> Curve:
    """One equation for one unknown."""
    problem = Problem(
        lambda x, p: function(x), {"x": 1.0}, {}, jacobian=lambda x, p: np.diag(slope(x))
    )
    return Curve(problem, ())


ROOT = curve_of(lambda x: x**2 - 2.0, lambda x: 2.0 * x)
ARCTAN = curve_of(np.arctan, lambda x: 1 / (1 + x**2))


def test_newton_says_how_far_it_came() -> None:
    found = newton(ROOT, np.array([1.0]))
    assert found.converged
    assert found.z == pytest.approx([math.sqrt(2.0)], abs=1e-14)
    assert found.residual < 1e-14
    assert 3 <= found.iterations <= 7
    assert found.correction < 1e-9 * 3
    short = newton(ROOT, np.array([1.0]), most=2)
    assert (short.converged, short.iterations) == (False, 2)
    assert short.residual == pytest.approx(abs(float(short.z[0]) ** 2 - 2.0))
    assert short.correction == pytest.approx(1.5 - 17.0 / 12.0)
    rough = newton(ROOT, np.array([1.0]), tolerance=1e-2)
    assert rough.converged
    assert rough.iterations < found.iterations


def test_newton_gives_up_where_corrections_grow() -> None:
    found = newton(ARCTAN, np.array([3.0]))
    assert not found.converged
    assert found.iterations < 12


def test_newton_with_a_row_stays_on_its_plane() -> None:
    """A circle, from beside it, along a line through the origin."""
    curve, start = Curve(CIRCLE.problem, ("mu",)), np.array([0.9, 0.6])
    for row in (np.array([0.0, 1.0]), np.array([1.0, 0.0]), np.array([0.6, -0.9])):
        found = newton(curve, start, row)
        assert found.converged
        assert found.z @ found.z == pytest.approx(1.0, abs=1e-14)
        assert row @ (found.z - start) == pytest.approx(0.0, abs=1e-12)


def test_a_correction_that_is_not_finite_is_no_step() -> None:
    with pytest.raises(Undefined, match="the Newton correction is not finite"):
        newton(curve_of(lambda x: x + 1.0, lambda x: 0 * x + 1e-320), np.array([1.0]))


def test_an_approach_comes_near_from_anywhere_or_says_that_it_does_not() -> None:
    far = approach(ARCTAN, np.array([30.0]))
    assert far is not None
    assert abs(far[0]) < 0.1
    assert approach(curve_of(lambda x: x**2 + 1.0, lambda x: 2 * x), np.array([3.0])) is None
    there = np.array([2.0])
    assert approach(curve_of(lambda x: x - 2.0, np.ones_like), there) is there
    flat = approach(curve_of(np.ones_like, np.zeros_like), there)
    assert flat is None
    # more unknowns than equations: the shortest way
    circle = approach(Curve(CIRCLE.problem, ("mu",)), np.array([3.0, 4.0]))
    assert circle is not None
    assert circle / np.linalg.norm(circle) == pytest.approx([0.6, 0.8], abs=1e-9)


# --- derivatives of boundaries --------------------------------------------------------------------


def test_the_derivative_in_the_unknowns_is_the_first_part_of_the_whole() -> None:
    mine = cb.Problem(
        lambda x, p: p["h"] + p["mu"] * x - x**3, {"x": -0.8}, {"h": 0.288, "mu": 1.0}
    )
    events = [cb.fold()]
    fold = cb.trace(mine, "h", within={"x": (-0.9, 0.9)}, events=events).first("LP")
    line = cb.boundary(fold, ("mu", "h"), within={"mu": (0.5, 1.5)})
    for point in (fold, line[1]):
        curve = point.curve
        whole = curve.jacobian(point.z)
        assert curve.in_unknowns(point.z) == pytest.approx(whole[:, : curve.size], abs=1e-9)
        assert whole.shape == (curve.size, curve.size + 1)


# --- coefficients in other units ------------------------------------------------------------------

UNITS = [1e-3, 1e3]


@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize("scaled", [False, True])
def test_the_coefficient_of_a_doubling_belongs_to_the_unit_of_its_unknown(unit, scaled) -> None:
    """Of the logistic map ``f''^2/4 + f'''/6 = 9``, over the square of the unit."""
    mine = cb.FixedPoint(
        lambda x, p: p["r"] * x * (1.0 - x / unit), {"x": 0.6 * unit}, {"r": 2.5},
        **({"scales": {"x": unit}} if scaled else {}),
    )  # fmt: skip
    point = cb.trace(mine, "r", within={"r": (2.4, 3.2)}).first("PD")
    assert point["r"] == pytest.approx(3.0, abs=1e-10)
    assert point.detail["criticality"] == "supercritical"
    assert point.detail["c"] * (1.0 if scaled else unit**2) == pytest.approx(9.0, rel=1e-6)


def hopf(unit: float, sign: float, **more: Any) -> cb.Problem:
    """Turning at rate 2, growing with m; the cycle has the radius unit sqrt(-sign m)."""

    def field(u: Array, p: Params) -> list[Any]:
        x, y = u
        grow = p["m"] + sign * (x * x + y * y) / unit**2
        return [grow * x - 2.0 * y, 2.0 * x + grow * y]

    return cb.Problem(field, {"x": 0.0, "y": 0.0}, {"m": -0.31}, **more)


@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_the_first_lyapunov_coefficient_belongs_to_the_unit_of_its_unknowns(unit, sign) -> None:
    point = cb.trace(hopf(unit, sign), "m", within={"m": (-0.5, 0.5)}, events=[cb.hopf()]).first(
        "HB"
    )
    reference = cb.trace(hopf(1.0, -1.0), "m", within={"m": (-0.5, 0.5)}, events=[cb.hopf()]).first(
        "HB"
    )
    assert point.detail["omega"] == pytest.approx(2.0, rel=1e-9)
    assert point.detail["l1"] * unit**2 == pytest.approx(-sign * reference.detail["l1"], rel=1e-6)
    assert point.detail["criticality"] == ("supercritical" if sign < 0 else "subcritical")


@pytest.mark.parametrize("unit", UNITS)
def test_the_coefficient_of_a_cusp_belongs_to_the_unit_of_its_unknown(unit: float) -> None:
    mine = cb.Problem(
        lambda x, p: p["h"] * unit + p["mu"] * x - x**3 / unit**2,
        {"x": -0.8 * unit},
        {"h": 0.288, "mu": 1.0},
        scales={"x": unit},
    )
    within = {"x": (-0.9 * unit, 0.9 * unit)}
    fold = cb.trace(mine, "h", within=within, events=[cb.fold()]).first("LP")
    point = cb.boundary(fold, ("mu", "h"), within={"mu": (-0.5, 1.5)}).first("CP")
    assert (point["mu"], point["h"], point["x"] / unit) == pytest.approx((0, 0, 0), abs=1e-7)


@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize("angle", [0.7, 2.9])
def test_angle_and_coefficient_of_a_neimark_sacker_point(unit: float, angle: float) -> None:
    """``z -> e^(i angle) z (1 + m - |z|^2/unit^2)``: d = -2 over the square of the unit."""
    c, s = math.cos(angle), math.sin(angle)

    def image(u: Array, p: Params) -> list[Any]:
        x, y = u
        grow = 1.0 + p["m"] - (x * x + y * y) / unit**2
        return [grow * (c * x - s * y), grow * (s * x + c * y)]

    mine = cb.FixedPoint(image, {"x": 0.0, "y": 0.0}, {"m": -0.31})
    point = cb.trace(mine, "m", within={"m": (-0.4, 0.4)}).first("NS")
    assert point.detail["angle"] == pytest.approx(angle, abs=1e-9)
    assert point.detail["criticality"] == "supercritical"
    d = complex(point.detail["d"]) * unit**2
    assert d.real == pytest.approx(-2.0, rel=1e-6)  # in units of the eigenvector of length 1
    assert d.imag == pytest.approx(0.0, abs=1e-6)


# --- meetings, all of them ------------------------------------------------------------------------


def blocks(one: str, other: str) -> cb.Problem:
    """A map of two blocks apart: one bifurcates at m = 0, the other at k = 0."""

    def block(kind: str, u: Array, m: Any) -> list[Any]:
        if kind == "LP":
            return [u[0] + m - u[0] ** 2]
        if kind == "PD":
            return [-(1.0 + m) * u[0] + u[0] ** 3]
        if kind == "BP":
            return [(1.0 + m) * u[0] - u[0] ** 2]
        c, s = math.cos(1.1), math.sin(1.1)
        grow = 1.0 + m - u[0] ** 2 - u[1] ** 2
        return [grow * (c * u[0] - s * u[1]), grow * (s * u[0] + c * u[1])]

    size = 2 if one == "NS" else 1

    def image(u: Array, p: Params) -> list[Any]:
        return [*block(one, u[:size], p["m"]), *block(other, u[size:], p["k"])]

    value = {"LP": [0.5], "PD": [0.0], "BP": [0.0], "NS": [0.0, 0.0]}
    at = {"LP": 0.25, "PD": -0.3, "BP": -0.3, "NS": -0.3}
    start = {f"x{i}": x for i, x in enumerate([*value[one], *value[other]])}
    return cb.FixedPoint(image, start, {"m": at[one], "k": at[other]})


NAMES = {
    ("LP", "PD"): "LPPD", ("LP", "NS"): "LPNS", ("PD", "LP"): "LPPD", ("PD", "NS"): "PDNS",
    ("NS", "LP"): "LPNS", ("NS", "PD"): "PDNS", ("PD", "BP"): "PD-BP", ("NS", "BP"): "NS-BP",
    ("BP", "PD"): "BP-PD", ("BP", "NS"): "BP-NS",
}  # fmt: skip


@pytest.mark.parametrize(("one", "other"), NAMES)
def test_what_meets_what_on_boundaries_of_maps_has_one_name(one: str, other: str) -> None:
    mine = blocks(one, other)
    within = {"m": (-0.5, 0.5), **({"x0": (-0.6, 0.6)} if one == "LP" else {})}
    point = cb.trace(mine, "m", within=within).first(one)
    assert point["m"] == pytest.approx(0.0, abs=1e-9)
    line = cb.boundary(point, ("k", "m"), within={"k": (-0.5, 0.5), "m": (-0.5, 0.5)})
    assert line.problem.label == f"{one} boundary"
    name = NAMES[one, other]
    found = [p for p in line.special if p.kind not in ("EP",)]
    assert [p.kind for p in found] == [name]
    assert (found[0]["k"], found[0]["m"]) == pytest.approx((0.0, 0.0), abs=1e-7)
    # and from there the other boundary
    if name in ("LPPD", "LPNS", "PDNS"):
        back = cb.boundary(
            found[0], ("m", "k"), within={"m": (-0.4, 0.4), "k": (-0.4, 0.4)}, events=()
        )
        assert back.problem.label == f"{other} boundary"


# --- what counts as a solution --------------------------------------------------------------------


def test_equations_without_slope_that_do_not_vanish_end_a_branch_where_they_begin() -> None:
    def residual(u, p):
        if np.real(p["mu"]) > 1.5:
            return np.full(2, 1e6)
        return np.array([u[0] - p["mu"], u[1] - u[0] ** 2])

    problem, counter = counted(Problem(residual, {"x": 1.0, "y": 1.0}, {"mu": 1.0}))
    branch = trace(problem, "mu", within={"mu": (0.0, 3.0)})
    assert branch[-1]["mu"] == pytest.approx(1.5, abs=1e-6)
    assert branch.stop is Stop.NO_CONVERGENCE
    assert branch.reason == "residual 1e+06"
    assert abs(branch["residual"]).max() < 1e-15
    assert counter.calls < 3000


@pytest.mark.parametrize("mu", [9e-7, 1e-9])
def test_just_beyond_a_fold_there_is_no_solution(mu: float) -> None:
    problem = scalar(lambda x, p: x**2 + p["mu"], 0.0, {"mu": mu})
    with pytest.raises(NotConverged, match=f"is not a solution: residual {mu:g}"):
        problem.solve()


@pytest.mark.parametrize("x", [0.0, 1e-9, 0.3, 1.0])
def test_small_equations_are_not_solved_for_being_small(x: float) -> None:
    with pytest.raises(NotConverged, match="is not a solution"):
        scalar(lambda x, p: 1e-7 * (1 + x**2), x, {"mu": 0.0}).solve()


@pytest.mark.parametrize("size", [1e-12, 1.0, 1e12])
def test_equations_are_solved_whatever_their_size(size: float) -> None:
    _, found = scalar(lambda x, p: size * (x**2 - 2), 1.0, {"mu": 0.0}).solve()
    assert found.z[0] == pytest.approx(2**0.5, rel=1e-15)


@pytest.mark.parametrize("other", [1.0, 1e6, 1e10])
def test_an_unknown_is_solved_for_to_the_last_digits_whatever_the_size_of_another(other) -> None:
    problem = Problem(
        lambda u, p: np.array([u[0] ** 2 - 2 + 0 * p["mu"], u[1] / other - 1]),
        {"x": 1.6, "y": other},
        {"mu": 0.0},
    )
    _, found = problem.solve()
    assert found.z[0] == pytest.approx(2**0.5, rel=1e-14)


def test_equations_and_maps_may_write_to_one_array_and_return_it_each_time() -> None:
    def same(function):
        room = np.empty(2)

        def written(u, p):
            room[:] = function(u, p)
            return room

        return written

    def curve(u, p):
        return np.array([np.exp(u[0]) - p["mu"], u[1] - u[0] ** 2])

    def henon(u, p):
        return np.array([1 - p["a"] * u[0] ** 2 + u[1], 0.3 * u[0]])

    one, other = (
        trace(Problem(f, {"x": 0.0, "y": 0.0}, {"mu": 1.0}), "mu", within={"mu": (0.5, 3.0)})
        for f in (same(curve), curve)
    )
    assert one.began is one.stop is Stop.BOUND
    assert np.allclose(one["x"], np.log(one["mu"]), rtol=0, atol=1e-13)
    assert len(one) < 1.2 * len(other)
    start, within = {"x": 0.97, "y": -0.13}, {"a": (0.5, 1.2)}
    one, other = (
        trace(FixedPoint(f, start, {"a": 1.0}, period=2), "a", within=within, events=())
        for f in (same(henon), henon)
    )
    assert one.began is one.stop is Stop.BOUND
    assert abs(one["x"][-1] - other["x"][-1]) < 1e-13
    assert not np.allclose(*one[-1].solution.points)
