"""The rules of a step, each by itself: what they decide, not where it leads."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import contbreather as cb
from contbreather.continuation import compiled_steps, step
from contbreather.continuation.compiled_steps import CompiledCurve, Loops

RNG = np.random.default_rng(17)


@pytest.mark.parametrize("d", [1, 2, 3, 4, 5])
def test_elimination_solves_and_knows_the_sign_of_the_determinant(d: int) -> None:
    for _ in range(20):
        matrix, right = RNG.normal(size=(d, d)), RNG.normal(size=d)
        x = right.copy()
        assert step.eliminate(matrix.copy(), x) == np.sign(np.linalg.det(matrix))
        assert np.allclose(x, np.linalg.solve(matrix, right), rtol=1e-9)
    matrix[-1] = matrix[0] if d > 1 else 0.0
    singular = matrix * 0.0 + np.outer(np.arange(d), np.arange(d))
    assert step.eliminate(singular, np.zeros(d)) == 0


@pytest.mark.parametrize(
    ("iterations", "turn", "growth", "factor"),
    [
        (3, 0.0, 1.5, 1.5), (3, 0.12, 1.5, 1.25), (3, 0.6, 1.5, 0.5), (3, 0.2, 1.5, 0.75),
        (4, 0.0, 1.5, 1.0), (5, 0.0, 1.5, 0.7), (5, 0.2, 1.5, 0.7), (5, 0.25, 1.5, 0.6),
        (1, 0.01, 12.0, 12.0), (1, 0.01, 20.0, 15.0),
    ],
)  # fmt: skip
def test_the_next_size_follows_turn_and_effort(iterations, turn, growth, factor) -> None:
    assert step.next_size(iterations, turn, growth) == pytest.approx(factor)


RULES = step.Rules(
    1e-9, 1e-9, 0.1, 1.5, np.array([1, 2]), np.array([-1.0, 0.0]), np.array([2.0, 0.5]),
    across=np.array([1.0, 0.0, 0.0]), start=np.array([5.0, 5.0, 0.0]),
)  # fmt: skip


def here(z: Any, tangent: Any, ahead: Any) -> step.Here:
    arrays = (np.array(one, dtype=float) for one in (z, tangent, np.zeros(3), z, ahead, z))
    return step.Here(*arrays)


def test_a_place_on_a_bound_is_inside_and_what_turns_round_may_have_left() -> None:
    for z, outside in (
        ([9.0, -1.0, 0.0], False), ([9.0, 2.0, 0.5], False), ([9.0, -1.1, 0.2], True),
        ([9.0, 2.1, 0.2], True), ([9.0, 0.0, -0.1], True), ([9.0, 0.0, 0.6], True),
    ):  # fmt: skip
        assert step.outside(RULES, np.array(z)) is outside
    up = [1.0, 1.0, 1.0]
    for ahead, leaves in (([-1.0, 1.0, 1.0], False), ([1.0, -1.0, 1.0], True),
                          ([1.0, 1.0, -1.0], True), ([1.0, 0.0, 0.0], False)):  # fmt: skip
        assert step.leaves(RULES, here(up, up, ahead)) == leaves


def test_the_plane_of_the_start_is_passed_from_behind_in_its_own_direction() -> None:
    for before, after, along, passed in (
        (4.9, 5.1, 1.0, True), (4.9, 5.0, 1.0, True), (5.0, 5.1, 1.0, False),
        (5.1, 4.9, 1.0, False), (4.8, 4.9, 1.0, False), (4.9, 5.1, 0.5, True),
        (4.9, 5.1, 0.4, False), (4.9, 5.1, -1.0, False),
    ):  # fmt: skip
        begun = here([before, 1.0, 0.0], [1.0, 0.0, 0.0], [along, 0.0, 0.0])
        found = step.returns(RULES, begun, np.array([after, 7.0, 0.0]))
        assert found == passed, (before, after, along)


# --- single points ------------------------------------------------------------------------------


def parabola(strength: float) -> tuple[Any, Any]:
    """``m = strength x^2``, which has no value beyond x = +-9 and no derivative beyond m = 99."""

    def evaluate(z: Any, data: Any, out: Any) -> int:
        out[0] = z[1] - strength * z[0] ** 2 if z[0] > -9 else math.nan
        return int(z[0] > 9)

    def derive(z: Any, data: Any, out: Any) -> int:
        out[0], out[1] = -2 * strength * z[0], 1.0
        return int(abs(z[1]) > 99)

    return evaluate, derive


def test_a_single_point_is_solved_for_as_closely_as_is_asked_for() -> None:
    corrector = CompiledCurve(Loops(*parabola(1.0), ()), np.ones(2))
    guess, across, along = np.array([1.5, 1.0]), np.array([0.0, 1.0]), np.array([1.0, 2.0]) / 5**0.5
    counts = []
    for tolerance, side in ((0.5, 1), (1e-3, -1), (1e-12, 1)):
        z, tangent, residual, count = (
            corrector.corrected(guess, across, side * along, tolerance) or 0
        )
        assert z == pytest.approx([1.0, 1.0], abs=tolerance)
        assert residual == pytest.approx(abs(z[1] - z[0] ** 2))
        assert tangent == pytest.approx(side * along, abs=tolerance)
        counts.append(count)
    assert counts == [1, 4, 6]  # corrections: 0.42, 0.08, 3e-3, 5e-6, 1e-11
    assert corrector.corrected(np.array([9.5, 1.0]), across, along, 1e-9) is None


def test_events_that_are_looked_for_change_no_point() -> None:
    plain, seen = (
        cb.trace(cb.symmetric(0.5, 0.08, 0.8), "a", within={"a": (0.06, 0.9)}, events=events,
                 inadmissible=True)
        for events in ((), [cb.user("p", 99.0)])
    )  # fmt: skip
    assert np.array_equal(plain["arclength"], seen["arclength"])
    assert np.array_equal(plain["a"], seen["a"])


# --- functions of a user, before they are compiled ----------------------------------------------


def test_columns_of_a_user_s_functions_are_their_derivatives() -> None:
    """By five points: exact for quartics; and x and parameters are as they were."""
    params, x, steps = [9.0, 2.0, 3.0], np.array([0.5, -1.0]), [0.01, 0.02, 0.05]
    names = ("unused", "m", "c")

    def residual(x: Any, p: Any) -> Any:
        return [x[0] ** 4 * p["m"] + x[1] ** 3, p["m"] ** 2 * x[1] - x[0]]

    def record(data: Any) -> Any:
        if data[1] > 100:
            raise ValueError("beyond")
        return dict(zip(names, data[:3], strict=True))

    put = compiled_steps._put(residual, 2, lambda value, i: value[i], record)
    column = compiled_steps._column(put, 3, 2, (1,))
    data = [*params, *steps]
    wanted = np.array([[4 * 0.5**3 * 2.0, 3.0, 0.5**4], [-1.0, 4.0, 2 * 2.0 * -1.0]])
    for c in range(3):
        own = np.empty(2)
        assert column(c, x, data, own) == 0
        assert np.allclose(own, wanted[:, c], rtol=0, atol=1e-12)
    assert (x.tolist(), data) == ([0.5, -1.0], [*params, *steps])
    out = np.empty(2)
    assert put(x, data, out) == 0
    assert out.tolist() == residual(x, {"m": 2.0})
    assert put(x, [9.0, 101.0, 0.0], out) == 1
    assert column(2, x, [9.0, 100.0, 0.0, *steps], np.empty(2)) == 2  # of its four places
