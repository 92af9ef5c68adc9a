"""Coefficients in any units, meetings of maps, and what counts as a solution."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import contbreather as cb
from contbreather.continuation import Problem, Stop, trace
from contbreather.continuation.bifurcations.maps import FixedPoint
from contbreather.errors import NotConverged

from .zoo import counted, scalar

Array = NDArray[np.float64]
Params = Mapping[str, float]


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
