"""How close is close: on either side of the tolerances of normal forms and of files."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import contbreather as cb
from contbreather.continuation import Point, Problem, load, save, trace
from contbreather.continuation import normal_forms as forms
from contbreather.continuation.maps import FixedPoint
from contbreather.continuation.newton import Undefined
from contbreather.errors import BadInput


def turning(angle: float) -> Point:
    """A Neimark-Sacker point at this angle, with terms of second and third order."""
    c, s = math.cos(angle), math.sin(angle)

    def image(u: np.ndarray, p: dict[str, float]) -> np.ndarray:
        x, y = u
        return (1 + p["m"]) * np.array([c * x - s * y + 0.3 * x * x - x**3, s * x + c * y])

    mine = FixedPoint(image, {"x": 0.0, "y": 0.0}, {"m": -0.1})
    return trace(mine, "m", within={"m": (-0.2, 0.2)}).first("NS")


def test_next_to_a_strong_resonance_there_is_a_coefficient_and_on_it_none() -> None:
    resonant = 2 * math.pi / 3
    assert "d" in turning(resonant - 2e-5).detail
    assert "strong resonance" in turning(resonant - 1e-8).detail["criticality"]


@pytest.mark.parametrize(
    ("value", "word"),
    [(1e-4, "subcritical"), (-1e-4, "supercritical"), (1e-8, "degenerate"), (0.0, "degenerate")],
)
def test_a_coefficient_has_a_sign_down_to_a_millionth_of_its_terms(value, word) -> None:
    coefficient = forms.Coefficient(3.0 * value, 3.0)
    found = forms.criticality("c", lambda: coefficient, stable_if_negative=True)
    assert found["criticality"] == word


def test_a_coefficient_is_rounding_only_where_its_terms_cancel_to_eleven_digits() -> None:
    assert forms.Coefficient(-2e-9, 2.0).signed == -2e-9
    assert forms.Coefficient(-2e-12, 2.0).signed == 0.0


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


def line(off: float) -> Problem:
    return Problem(lambda x, p: np.array([x[0] - p["mu"] - off]), {"x": 0.0}, {"mu": 0.0})


def test_points_of_a_file_solve_their_equations_to_six_digits(tmp_path: Path) -> None:
    path = tmp_path / "line.nc"
    save(path, trace(line(0.0), "mu", within={"mu": (-1, 1)}))
    assert isinstance(load(path, problem=line(1e-8)), cb.Branch)
    with pytest.raises(BadInput, match=r"do not solve this problem: residual 0\.0001"):
        load(path, problem=line(1e-4))
