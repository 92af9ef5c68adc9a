"""Many steps in one call: compiled or not, by loops or by LAPACK, they are the same."""

from __future__ import annotations

import logging
import math
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import contbreather as cb
from contbreather.continuation import compiled_steps, step
from contbreather.continuation.compiled_steps import CompiledCurve, Loops

from ..apart import ended
from .zoo import knowing

WITHIN = {"a": (0.06, 0.9)}


@pytest.fixture
def compiled(monkeypatch: pytest.MonkeyPatch) -> Callable[[bool], None]:
    """Say whether steps are taken by machine code, which is there, or by the text."""
    machine = compiled_steps.machine_code

    def say(so: bool) -> None:
        monkeypatch.setattr(compiled_steps, "machine_code", machine if so else lambda loops: None)
        monkeypatch.setattr(compiled_steps, "_known", {})

    return say


def closure(**given: Any) -> cb.Orbit:
    return cb.symmetric(0.5, 0.08, 0.8, **given)


def branch(free: str = "a", within: Any = WITHIN, **given: Any) -> cb.Branch:
    return cb.trace(closure(**given), free, within=within, events=(), inadmissible=True)


THIRD = cb.lattice.Fourier(cos={1: -1.0, 3: 0.4}, sin={1: 0.1})
CASES = {
    "a": {},
    "gamma": {"free": "gamma", "within": {"gamma": (0.0, 0.24)}},
    "k": {"free": "k", "within": {"k": (0.1, 1.0)}},
    "third harmonic": {"forcing": THIRD},
    "coefficient": {"free": "c3", "within": {"c3": (-1.0, 1.0)}, "forcing": THIRD},
    "other coefficient": {"free": "s1", "within": {"s1": (-0.5, 0.5)}, "forcing": THIRD},
    "ring": {"lattice": cb.Ring(6)},
}


def same(one: cb.Branch, other: cb.Branch) -> bool:
    rows = zip(one.points.rows, other.points.rows, strict=True)
    return one.stop is other.stop and all(np.array_equal(*pair) for pair in rows)


def fold_curve(events: Any = None) -> cb.Branch:
    start = cb.trace(closure(), "a", events=events, within={"a": (0, 0.9)}, inadmissible=True)
    pair, within = ("gamma", "a"), {"gamma": (0.0, 0.24), "a": (0.0, 1.0)}
    return cb.boundary(start.first("LP"), pair, within=within, events=(), inadmissible=True)


def test_compiled_steps_are_those_of_the_text_to_the_last_bit(compiled: Any) -> None:
    pytest.importorskip("numba")
    if not Path(cb.__file__).with_name("_objects").is_dir():
        pytest.skip("installed without compiled steps: there is nothing to compare with")
    compiled(False)
    as_it_is = [branch(**case) for case in CASES.values()]
    folds = fold_curve([cb.fold()]), fold_curve()
    assert not compiled_steps._known
    compiled(True)
    for one, case in zip(as_it_is, CASES.values(), strict=True):
        assert same(one, branch(**case)), case
    assert same(folds[0], fold_curve([cb.fold()]))
    assert same(folds[1], fold_curve())
    assert len(compiled_steps._known) == 3
    assert all(compiled_steps._known.values())


@pytest.mark.parametrize("name", CASES)
def test_steps_by_loops_are_those_by_lapack(compiled: Any, name: str) -> None:
    compiled(False)
    case = CASES[name]
    own = branch(**case)
    problem = closure(**{key: case[key] for key in ("forcing", "lattice") if key in case}).problem
    free, within = case.get("free", "a"), case.get("within", WITHIN)
    # what can be compiled is another method
    plain = knowing(problem, derivatives=problem.derivatives)
    other = cb.trace(plain, free, within=within, events=(), inadmissible=True)
    assert len(own) == len(other)
    assert own.stop is other.stop
    for column in (*own.problem.start, *own.problem.params, "arclength"):
        assert np.allclose(own[column], other[column], rtol=0, atol=2e-11), column
    assert abs(own["residual"]).max() < 1e-14


def test_a_curve_of_folds_by_null_vectors_is_the_exact_one(compiled: Any) -> None:
    compiled(False)
    line = fold_curve([cb.fold()])
    assert len(line) > 10
    for a, gamma in zip(line["a"], line["gamma"], strict=True):
        smallest = cb.orbits.closure.smallest_amplitude(float(gamma), 0.8)
        assert a == pytest.approx(smallest, rel=1e-10)


def test_events_are_found_on_steps_taken_in_one_call(compiled: Any) -> None:
    compiled(False)
    problem = closure().problem
    own = cb.trace(problem, "a", within={"a": (0.05, 0.95)})
    other = cb.trace(knowing(problem, interpret=problem.interpret), "a", within={"a": (0.05, 0.95)})
    assert [point.label for point in own.special] == [point.label for point in other.special]
    for one, two in zip(own.special, other.special, strict=True):
        assert one["a"] == pytest.approx(two["a"], abs=1e-11)


def test_a_point_of_a_stretch_is_made_when_it_is_asked_for_and_stays_the_same(
    compiled: Any,
) -> None:
    compiled(False)
    line = branch()
    assert line[7] is line[7]
    assert line[-1] is line.points[len(line) - 1]
    assert line[7].z.flags.writeable is False
    assert np.array_equal([point["p"] for point in line], line["p"])
    assert np.array_equal([point.arclength for point in line], line["arclength"])
    back = line.reversed()
    assert np.array_equal(back["a"], line["a"][::-1])
    assert np.array_equal(back[3].tangent, -line[-4].tangent)
    assert pickle.loads(pickle.dumps(line)).points[7]["a"] == line[7]["a"]


SHORT = """
import sys
import contbreather as cb
plain = cb.Problem(lambda x, p: [x[0] - p["m"]], {"x": 0.0}, {"m": 0.0})
cb.trace(plain, "m", within={"m": (0, 1)})
assert not {"numba", "llvmlite"} & set(sys.modules)
sys.modules["numba"] = sys.modules["llvmlite"] = None  # as where they are not installed
branch = cb.trace(cb.symmetric(0.5, 0.04, 0.8), "a", within={"a": (0.4, 0.6)})
mine = cb.Problem(lambda x, p: [x[0] - p["m"]], {"x": 0.0}, {"m": 0.0}, compiled=True)
print(len(branch) > 5, cb.trace(mine, "m", within={"m": (0, 1)})[-1]["x"])
"""


def test_equations_of_a_user_need_no_compiler_and_without_one_all_works_too() -> None:
    done = ended("-c", SHORT)
    assert done.stdout == "True 1.0\n", done.stderr


# --- functions that a user gave -----------------------------------------------------------------


def cusp(x: Any, p: Any) -> Any:
    return [p["h"] + p["mu"] * x[0] - x[0] ** 3]


def cusp_problem(**given: Any) -> cb.Problem:
    return cb.Problem(cusp, {"x": 1.0}, {"mu": 1.0, "h": 0.0}, **given)


def test_a_decorated_function_is_one_that_can_be_compiled() -> None:
    numba = pytest.importorskip("numba")
    problem = cb.Problem(numba.njit(cusp), {"x": 1.0}, {"mu": 1.0, "h": 0.0})
    assert problem.compiled
    assert problem.residual is cusp
    assert not cusp_problem().compiled


def test_compiled_functions_of_a_user_give_the_points_of_plain_ones() -> None:
    lines = []
    for compiled in (False, True):
        problem = cusp_problem(compiled=compiled)
        branch = cb.trace(problem, "h", within={"x": (-2.0, 2.0)}, events=[cb.fold()])
        within = {"mu": (-1.0, 2.0)}
        lines.append((branch, cb.boundary(branch.first("LP"), ("mu", "h"), within=within)))
    for plain, own in zip(*lines, strict=True):
        assert len(plain) == len(own)
        assert [point.label for point in plain.special] == [point.label for point in own.special]
        assert np.allclose(plain["x"], own["x"], rtol=0, atol=1e-9)
        assert abs(own["residual"]).max() < 1e-12
    folds = lines[1][1]
    assert np.allclose(4 * folds["mu"] ** 3, 27 * folds["h"] ** 2, rtol=0, atol=1e-13)
    assert any(
        known and function.__name__ == "evaluate"
        for function, known in compiled_steps._known.items()
    )


def odd(x: Any, p: Any) -> Any:
    """One of three equations, so that one function is compiled."""
    if p["which"] == 0.0:
        return [x[0] - np.log(p["mu"])]
    if p["which"] == 1.0:
        return [p["mu"] - np.sin(400 * x[0]) / 400]
    return [p["mu"] - 2 + np.exp(-x[0])]


@pytest.mark.parametrize(
    ("which", "mu", "within"),
    [
        (0.0, 1.0, {"mu": (1e-6, 1.0)}),
        (1.0, 0.0, {"x": (-0.01, 0.01)}),
        (2.0, 1.0, {"mu": (0.5, 3.0)}),  # to infinity
    ],
    ids=["logarithm", "ripple", "settling"],
)
def test_compiled_functions_go_where_plain_ones_go_though_differences_do_not_hold(
    which: float, mu: float, within: Any
) -> None:
    params = {"mu": mu, "which": which}
    plain, own = (
        cb.trace(
            cb.Problem(odd, {"x": 0.0}, params, compiled=compiled),
            "mu",
            within=within,
            events=[cb.fold()],
        )
        for compiled in (False, True)
    )
    assert (own.stop, own.began, len(own)) == (plain.stop, plain.began, len(plain))
    assert [point.label for point in own.special] == [point.label for point in plain.special]
    assert np.allclose(own["x"], plain["x"], rtol=0, atol=1e-9)
    assert np.allclose(own["mu"], plain["mu"], rtol=0, atol=1e-9)


def test_a_function_that_numba_refuses_is_taken_as_it_is_and_that_is_said_once(
    caplog: pytest.LogCaptureFixture,
) -> None:
    def field(x: Any, p: Any) -> Any:
        return [x[0] - {**p}["mu"]]

    caplog.set_level(logging.INFO, "contbreather")
    problem = cb.Problem(field, {"x": 0.0}, {"mu": 0.0}, compiled=True)
    for _ in range(2):
        branch = cb.trace(problem, "mu", within={"mu": (0.0, 1.0)}, events=())
        assert branch[-1]["x"] == 1.0
    said = [one.getMessage() for one in caplog.records if "without compiled" in one.getMessage()]
    assert len(said) == 1


def test_a_function_that_means_something_else_when_it_is_compiled_is_refused(monkeypatch) -> None:
    monkeypatch.setattr(compiled_steps.compiler, "compiled_address", lambda function, kinds: 0)
    # leaves zeros
    monkeypatch.setattr(compiled_steps, "callable_at", lambda address, kinds: lambda *addresses: 0)
    loops = compiled_steps.Loops(len, len, ())
    with pytest.raises(
        cb.BadInput, match=r"compiled, the residual .* \[0.0\]; as it is .* \[1.0\]"
    ):
        compiled_steps._check(loops, np.zeros(2), np.ones(1), np.ones((1, 2)))


# --- single steps ---------------------------------------------------------------------------------


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


def point(z: Any, tangent: Any, end_tangent: Any) -> step.CompiledPoint:
    entries = z, tangent, np.zeros(3), z, end_tangent, z
    return step.CompiledPoint(*(np.array(row, dtype=float) for row in entries))


def test_a_place_on_a_bound_is_inside_and_what_turns_round_may_have_left() -> None:
    for z, outside in (
        ([9.0, -1.0, 0.0], False), ([9.0, 2.0, 0.5], False), ([9.0, -1.1, 0.2], True),
        ([9.0, 2.1, 0.2], True), ([9.0, 0.0, -0.1], True), ([9.0, 0.0, 0.6], True),
    ):  # fmt: skip
        assert step.outside(RULES, np.array(z)) is outside
    up = [1.0, 1.0, 1.0]
    for end_tangent, leaves in (([-1.0, 1.0, 1.0], False), ([1.0, -1.0, 1.0], True),
                          ([1.0, 1.0, -1.0], True), ([1.0, 0.0, 0.0], False)):  # fmt: skip
        assert step.leaves(RULES, point(up, up, end_tangent)) == leaves


def test_the_plane_of_the_start_is_passed_from_behind_in_its_own_direction() -> None:
    for before, after, along, passed in (
        (4.9, 5.1, 1.0, True), (4.9, 5.0, 1.0, True), (5.0, 5.1, 1.0, False),
        (5.1, 4.9, 1.0, False), (4.8, 4.9, 1.0, False), (4.9, 5.1, 0.5, True),
        (4.9, 5.1, 0.4, False), (4.9, 5.1, -1.0, False),
    ):  # fmt: skip
        begun = point([before, 1.0, 0.0], [1.0, 0.0, 0.0], [along, 0.0, 0.0])
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

    put = compiled_steps._put(residual, (2, 1, 1), lambda value, i, k: value[i], record)
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
