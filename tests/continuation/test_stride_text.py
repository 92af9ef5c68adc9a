"""The loops of `stride`, each against numpy or the walker: what they decide, not where it leads."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import contbreather as cb
from contbreather.continuation import given_loops, stride, strider
from contbreather.continuation.trace import Failed, Walker

RNG = np.random.default_rng(17)


@pytest.mark.parametrize("d", [1, 2, 3, 4, 5])
def test_elimination_solves_and_knows_the_sign_of_the_determinant(d: int) -> None:
    for _ in range(20):
        matrix, right = RNG.normal(size=(d, d)), RNG.normal(size=d)
        x = right.tolist()
        assert stride.solve(matrix.ravel().tolist(), x, d) == np.sign(np.linalg.det(matrix))
        assert np.allclose(x, np.linalg.solve(matrix, right), rtol=1e-9)
    matrix[-1] = matrix[0] if d > 1 else 0.0
    singular = (matrix * 0.0 + np.outer(np.arange(d), np.arange(d))).ravel().tolist()
    assert stride.solve(singular, [0.0] * d, d) == 0


@pytest.mark.parametrize(
    ("iterations", "turn", "growth", "factor"),
    [
        (3, 0.0, 1.5, 1.5), (3, 0.12, 1.5, 1.25), (3, 0.6, 1.5, 0.5), (3, 0.2, 1.5, 0.75),
        (4, 0.0, 1.5, 1.0), (5, 0.0, 1.5, 0.7), (5, 0.2, 1.5, 0.7), (5, 0.25, 1.5, 0.6),
        (1, 0.01, 12.0, 12.0), (1, 0.01, 20.0, 15.0),
    ],
)  # fmt: skip
def test_the_next_size_follows_turn_and_effort(iterations, turn, growth, factor) -> None:
    assert stride.next_size(iterations, turn, growth) == pytest.approx(factor)


def test_a_place_on_a_bound_is_inside_and_a_turn_is_one_of_what_has_a_bound() -> None:
    rules = [0.0] * stride.FIRST
    rules[stride.BOUNDS] = 2
    rules += [1, -1.0, 2.0, 2, 0.0, 0.5]
    for z, outside in (
        ([9.0, -1.0, 0.0], False), ([9.0, 2.0, 0.5], False), ([9.0, -1.1, 0.2], True),
        ([9.0, 2.1, 0.2], True), ([9.0, 0.0, -0.1], True), ([9.0, 0.0, 0.6], True),
    ):  # fmt: skip
        assert stride.outside(rules, z) is outside
    up = [1.0, 1.0, 1.0]
    for ahead, peeks in (([-1.0, 1.0, 1.0], False), ([1.0, -1.0, 1.0], True),
                         ([1.0, 1.0, -1.0], True), ([1.0, 0.0, 0.0], False)):  # fmt: skip
        assert stride.peeks(rules, up, ahead) is peeks


def test_the_plane_of_the_start_is_passed_from_behind_in_its_own_direction() -> None:
    origin = [1.0, 0.0, 5.0, 5.0]  # the row, and where the walk set out
    for before, after, along, passed in (
        (4.9, 5.1, 1.0, True), (4.9, 5.0, 1.0, True), (5.0, 5.1, 1.0, False),
        (5.1, 4.9, 1.0, False), (4.8, 4.9, 1.0, False), (4.9, 5.1, 0.5, True),
        (4.9, 5.1, 0.4, False), (4.9, 5.1, -1.0, False),
    ):  # fmt: skip
        found = stride.returns(origin, [before, 1.0], [after, 7.0], [along, 0.0], 2)
        assert found is passed, (before, after, along)


# --- one attempt is that of the walker ----------------------------------------------------------


def parabola(strength: float) -> tuple[Any, Any]:
    """``m = strength x^2``, which has no value beyond x = +-9 and no derivative beyond m = 99."""

    def evaluate(z: Any, data: Any, out: Any) -> int:
        out[0] = z[1] - strength * z[0] ** 2 if z[0] > -9 else math.nan
        return int(z[0] > 9)

    def derive(z: Any, data: Any, out: Any) -> int:
        out[0], out[1] = -2 * strength * z[0], 1.0
        return int(abs(z[1]) > 99)

    return evaluate, derive


def tried(strength: float, size: float, scale: float) -> tuple[Any, Any]:
    """What both forms of the plain step make of one size: how it ended, where, what comes next."""
    x = -0.5 / (strength or 1.0)
    start, params = {"x": x}, {"m": strength * x**2}
    problem = cb.Problem(
        lambda x, p: [p["m"] - strength * x[0] ** 2], start, params, scales={"x": scale}
    )
    walker = Walker(problem, "m", None, "down", (), cb.Steps(largest=99.0, tolerance=1e-4))
    own, curve = walker.origin, walker.curve
    wanted: Any = stride.FAILED, *own.z, size, walker.side, 0.0, 0.0, 0.0
    try:
        step = walker.stepper._attempt(own, np.zeros(2), size, walker.side)
        last, length = step.point, step.point.arclength
        bend = (last.direction - own.direction) / length
        wanted = stride.CAME, *last.z, step.next_size, step.side, length, *bend
    except Failed:
        last = own
    metric = np.ones(2) if curve.metric is None else curve.metric
    state = [5.0, size, float(walker.side), 0.0, 0.0]
    moving = [own.z.tolist(), own.direction.tolist(), [0.0, 0.0]]
    scratch = [[0.0] * n for n in (2, 2, 2, 12, 12, 12)]
    origin = [*curve.dual(own.direction).tolist(), *own.z.tolist()]
    rules = [1e-4, 1e-9, 99.0, 1.5, 0.0]
    status = stride.attempt(
        *parabola(strength), [], 2, rules, metric.tolist(), origin, state, *moving, *scratch
    )
    if status == stride.CAME:
        assert state[stride.RESIDUAL] == pytest.approx(last.residual, rel=1e-6, abs=1e-16)
        assert np.allclose(moving[1], last.direction)
        assert state[stride.ARCLENGTH] == pytest.approx(5.0 + last.arclength, rel=1e-6)
    sizes = state[stride.SIZE], state[stride.SIDE], state[stride.LONGEST]
    return wanted, (status, *moving[0], *sizes, *moving[2])


@pytest.mark.parametrize("scale", [1.0, 0.2])
@pytest.mark.parametrize("strength", [0.0, 1.0, 3.0, 40.0])
def test_an_attempt_comes_off_where_that_of_the_walker_does(strength, scale) -> None:
    came = set()
    for size in np.geomspace(1e-3, 3.0 if not strength else 30.0, 50) / (strength or 1.0):
        wanted, found = tried(strength, float(size), scale)
        assert found == pytest.approx(wanted, rel=1e-6, abs=1e-9), size
        came.add(found[0])
    assert came == ({stride.CAME} if strength == 0.0 else {stride.CAME, stride.FAILED})


def test_without_equations_a_step_fails_and_without_derivatives_somebody_looks() -> None:
    loops, scratch = parabola(0.0), [[0.0] * 12 for _ in range(3)]
    rules, metric, along = [1e-9, 1e-9, 9.0, 1.5, 0.0], [1.0, 1.0], [1.0, 0.0]
    for z, status, side, off in (
        ([1.0, 2.0], 2, -1, 2.0),
        ([10.0, 2.0], stride.FAILED, -1, math.inf),
        ([-10.0, 2.0], stride.FAILED, -1, math.inf),
        ([1.0, 100.0], stride.LOOK, 0, 0.0),
    ):
        state, value, matrix, right = [0.0] * 5, *scratch
        given = rules, metric, state, along, [*z], value, matrix, right
        assert stride.newton(*loops, [], 2, *given) == status
        ahead = [0.0, 0.0]
        found = stride.look_along(loops[1], [], 2, metric, along, z, ahead, matrix, right)
        assert (found, ahead[0]) == (side, abs(side))
        assert stride.astray(*loops, [], 2, metric, along, z, matrix, right) == off
        settled = stride.settle(
            *loops, [], 2, rules, metric, state, along, along, [*z], ahead, value, matrix, right
        )
        assert settled == status
    for values, n, nowhere in (([1.0, math.nan], 2, True), ([1.0, math.nan], 1, False),
                               ([math.inf, 1.0], 2, True), ([1.0, 2.0], 2, False)):  # fmt: skip

        def evaluate(z: Any, data: Any, out: Any, values: Any = values) -> int:
            out[:] = values
            return 0

        assert stride.undefined(evaluate, [], [], [0.0, 0.0], n) is nowhere


def test_a_single_point_is_solved_for_as_closely_as_is_asked_for() -> None:
    settler = strider.Settler(strider.Loops(*parabola(1.0), ()), np.ones(2))
    guess, across, along = np.array([1.5, 1.0]), np.array([0.0, 1.0]), np.array([1.0, 2.0]) / 5**0.5
    counts = []
    for tolerance, side in ((0.5, 1), (1e-3, -1), (1e-12, 1)):
        z, tangent, residual, count = settler.settled(guess, across, side * along, tolerance) or 0
        assert z == pytest.approx([1.0, 1.0], abs=tolerance)
        assert residual == pytest.approx(abs(z[1] - z[0] ** 2))
        assert tangent == pytest.approx(side * along, abs=tolerance)
        counts.append(count)
    assert counts == [1, 4, 6]  # corrections: 0.42, 0.08, 3e-3, 5e-6, 1e-11
    assert settler.settled(np.array([9.5, 1.0]), across, along, 1e-9) is None


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

    put = given_loops._put(residual, 2, lambda value, i: value[i], record)
    column = given_loops._column(put, 3, 2, (1,))
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
