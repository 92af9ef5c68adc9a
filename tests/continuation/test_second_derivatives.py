"""Second derivatives: curves of folds and Hopf points, and branches that cross, whatever the sizes
of the unknowns and however short the lengths within which the equations bend."""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest

import contbreather as cb
from contbreather.errors import BadInput


def bump(shift: float = 0.0, idle: bool = False) -> cb.Problem:
    """``mu = u exp(-c u)`` with U = u + shift: folds at u = 1/c, mu = 1/(e c)."""

    def residual(x, p):
        u = x[0] - shift
        own = p["mu"] - u * np.exp(-p["c"] * u)
        return np.array([own, x[1] - 100] if idle else [own])

    start = {"U": shift + 0.2, "idle": 100.0} if idle else {"U": shift + 0.2}
    return cb.Problem(residual, start, {"mu": 0.2 * math.exp(-0.2), "c": 1.0})


@pytest.mark.parametrize("problem", [bump(1000.0), bump(-1000.0), bump(idle=True)])
def test_a_curve_of_folds_where_other_entries_are_large(problem: cb.Problem) -> None:
    fold = cb.trace(problem, "mu", within={"mu": (0, 1)}, events=[cb.fold()]).first("LP")
    line = cb.boundary(fold, ("c", "mu"), within={"c": (0.5, 4)})
    assert line["c"].min() == 0.5
    assert line["c"].max() == 4
    np.testing.assert_allclose(line["mu"] * line["c"], math.exp(-1), rtol=0, atol=3e-13)


def iterates(x: mpmath.mpf, r: mpmath.mpf, h: mpmath.mpf) -> tuple[mpmath.mpf, mpmath.mpf]:
    """Five iterates of the logistic map with a constant, and their derivative."""
    slope = mpmath.mpf(1)
    for _ in range(5):
        slope *= r * (1 - 2 * x)
        x = r * x * (1 - x) + h
    return x, slope


@pytest.mark.slow
def test_the_folds_of_five_iterates_of_the_logistic_map_are_followed() -> None:
    cycle = cb.FixedPoint(
        lambda x, p: p["r"] * x * (1 - x) + p["h"], {"x": 0.5}, {"r": 3.738914, "h": 0.0}, period=5
    )
    fold = cb.trace(cycle, "r", within={"r": (3.7, 3.76)}).first("LP")
    line = cb.boundary(fold, ("h", "r"), within={"h": (-0.05, 0.05)})
    assert [line["h"].min(), line["h"].max()] == [-0.05, 0.05]
    for point in line.points[::4]:
        h = mpmath.mpf(point["h"])

        def conditions(x, r, h=h):
            after, slope = iterates(x, r, h)
            return after - x, slope - 1

        _, r = mpmath.findroot(conditions, (point["x"], point["r"]))
        assert abs(point["r"] - float(r)) < 1e-12


@pytest.mark.slow
@pytest.mark.parametrize("shift", [0.0, 1000.0])
def test_a_curve_of_hopf_points_in_shifted_unknowns(shift: float) -> None:
    """A Brusselator whose nonlinear term is ``exp``: x' = A - (B + 1) x + E y, y' = B x - E y, with
    E = exp(x - A); where the trace B + 1 = A B vanishes otherwise, B = (2 - 1) / (A - 1)."""

    def residual(u, p):
        x, y = u[0] - shift, u[1]
        rate = np.exp(x - p["A"])
        return np.array([p["A"] - (p["B"] + 1) * x + rate * y, p["B"] * x - rate * y])

    start = {"x": shift + 3.0, "y": 0.9}
    problem = cb.Problem(residual, start, {"A": 3.0, "B": 0.3})
    found = cb.trace(problem, "B", within={"B": (0.3, 3)}, events=[cb.hopf()]).first("HB")
    line = cb.boundary(found, ("A", "B"), within={"A": (2.5, 4)})
    # x = A, y = A B: the trace is -(B + 1) + A B - 1
    np.testing.assert_allclose(line["B"], 2 / (line["A"] - 1), rtol=1e-12)


def test_curves_cross_beside_an_idle_unknown_of_another_size() -> None:
    problem = cb.Problem(
        lambda x, p: np.array([x[0] * (p["mu"] - x[0] * np.exp(-50 * x[0])), x[1] - 100]),
        {"x": 0.0, "idle": 100.0},
        {"mu": -0.1},
    )
    branch = cb.trace(problem, "mu", within={"mu": (-0.1, 0.1)}, events=[cb.branch_point()])
    assert abs(branch.first("BP")["mu"]) < 1e-14
    arms = cb.switch(branch.first("BP"), within={"mu": (-0.1, 0.1), "x": (-0.02, 1)})
    for arm in arms:
        np.testing.assert_allclose(arm["mu"], arm["x"] * np.exp(-50 * arm["x"]), atol=1e-13)


def test_what_was_not_given_is_not_blamed() -> None:
    """A kinked equation has no second derivatives at its fold; no Jacobian was given."""

    def residual(x, p):
        return np.array([p["mu"] - x[0] ** 2 - p["c"] * np.round(1e4 * x[0]) * 1e-9])

    problem = cb.Problem(residual, {"x": 1.0}, {"mu": 1.0, "c": 1.0})
    branch = cb.trace(problem, "mu", within={"x": (-1, 1)}, events=[cb.fold()])
    with pytest.raises(BadInput, match=r"^the derivative of the locus does not fit its conditions"):
        cb.boundary(branch.first("LP"), ("c", "mu"), within={"c": (0.5, 2)})
