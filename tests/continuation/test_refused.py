"""Files, walks and coefficients that cannot be had, each with the sentence that says why."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.sparse import csr_array

import contbreather as cb
from contbreather.continuation import Event
from contbreather.errors import BadInput, NotConverged

from .zoo import LINE, PITCHFORK, knowing, rotated

Array = NDArray[np.float64]
Params = Mapping[str, float]


# --- files ----------------------------------------------------------------------------------------


def turning(u: Array, p: Params) -> list[Any]:
    grow = 1.0 + p["m"] - u[0] ** 2 - u[1] ** 2 + 0.1 * p["k"]
    return [grow * part for part in rotated(u, 1.1)]


START = {"x": 0.0, "y": 0.0}
PARAMS = {"m": -0.31, "k": 0.2}


def test_a_curve_of_a_kind_that_the_problem_does_not_have_is_refused(tmp_path: Path) -> None:
    mine = cb.FixedPoint(turning, START, PARAMS)
    point = cb.trace(mine, "m", within={"m": (-0.4, 0.4)}).first("NS")
    line = cb.boundary(point, ("k", "m"), within={"k": (0.0, 0.4)})
    path = tmp_path / "ns.nc"
    cb.save(path, line)
    again = cb.load(path, problem=mine)
    assert np.array_equal(again["k"], line["k"])
    plain = cb.Problem(lambda u, p: np.subtract(turning(u, p), u), START, PARAMS)
    with pytest.raises(BadInput, match="this is a boundary of NS, which the problem has no event"):
        cb.load(path, problem=plain)


def test_a_file_with_more_unknowns_than_the_problem_is_refused(tmp_path: Path) -> None:
    two = cb.Problem(
        lambda u, p: np.array([u[0] - p["m"], u[1] - 2.0]), {"x": 0.0, "y": 2.0}, {"m": 0.0}
    )
    path = tmp_path / "two.nc"
    cb.save(path, cb.trace(two, "m", within={"m": (-1, 1)}, events=()))
    one = cb.Problem(lambda u, p: u - p["m"], {"x": 0.0}, {"m": 0.0})
    with pytest.raises(BadInput, match=r"the file has \['x', 'y', 'm'\], the problem has"):
        cb.load(path, problem=one)


# --- coefficients ---------------------------------------------------------------------------------


def to_the_right(u: Array, p: Params) -> Array:
    """A map that doubles, or a flow that turns, without values to the left."""
    if np.real(u[0]) < 0:
        raise ValueError("only to the right")
    if u.size == 1:
        return -(1.0 + p["m"]) * u + u**2
    x, y = u
    grow = p["m"] - (x * x + y * y)
    return np.array([grow * x - 2.0 * y, 2.0 * x + grow * y])


@pytest.mark.parametrize(
    ("mine", "kind", "name", "known"),
    [
        (cb.FixedPoint(to_the_right, {"x": 0.0}, {"m": -0.31}), "PD", "c", {}),
        (
            cb.Problem(to_the_right, START, {"m": -0.31}, events=[cb.hopf()]),
            "HB",
            "l1",
            {"omega": 2},
        ),
    ],
)
def test_without_values_to_both_sides_there_is_no_coefficient(mine, kind, name, known) -> None:
    point = cb.trace(mine, "m", within={"m": (-0.4, 0.3)}).first(kind)
    assert point["m"] == pytest.approx(0.0, abs=1e-9)
    assert point.detail["criticality"].startswith("unknown: ")
    assert name not in point.detail
    for what, value in known.items():
        assert point.detail[what] == pytest.approx(value, abs=1e-9)


# --- what was given -------------------------------------------------------------------------------


def line(**given: Any) -> cb.Branch:
    return cb.trace(LINE.problem, given.pop("free", "mu"), **given)


def solved(residual: Any, *, n: int = 2, sensitivity: Any = None, **given: Any) -> cb.Branch:
    """A walk from x = 0, or from a row of numbers, with the parameter mu."""
    start = {"x": 0.0} if n == 1 else {"x": np.zeros(n)}
    problem = cb.Problem(residual, start, {"mu": 0.0}, **given)
    if sensitivity is not None:
        problem = knowing(problem, sensitivity=sensitivity)
    return cb.trace(problem, "mu")


def problem(start: Any, params: Any, **given: Any) -> cb.Problem:
    return cb.Problem(lambda x, p: x - p["mu"], start, params, **given)


def measured(value: Any, since: float) -> cb.Branch:
    """A test that gives no number from some mu on."""
    event = Event("UZ", lambda point: 1.0 if point["mu"] < since else value)
    return line(within={"mu": (-1.0, 1.0)}, events=[event])


def only_here(x: Array, p: Params) -> Array:
    if x[0] != 0:
        raise ValueError("nothing beside it")
    return np.array([0.0])


RIGHT, FOUR = np.eye(2), problem({"u": np.ones(4)}, {"mu": 1.0})
BAD: tuple[Any, ...] = ("a", 1j, [[1], [1, 2]], {})  # no numbers
NO_PAIR = r"the window of 'mu' must be a pair \(low, high\) of numbers, got "
NO_NUMBER = r"= .*: finite real numbers were expected"
Row = tuple[Callable[..., Any], Sequence[Any], dict[str, Any], str]
GIVEN: list[Row] = [
    # problems
    (problem, ({"x": math.nan}, {"mu": 0.0}), {}, "x = nan: finite real numbers were expected"),
    (problem, ({"x": 0.0}, {"mu": math.inf}), {}, "mu = inf: finite real numbers"),
    (problem, ({"x": np.zeros((2, 2))}, {}), {}, r"'x' has shape \(2, 2\)"),
    (problem, ({"x": np.zeros(0)}, {}), {}, "'x' is empty; at least one number was expected"),
    (problem, ({"x": 0.0}, {"mu": [0.0]}), {}, r"'mu' has shape \(1,\); a number"),
    (problem, ({"x": 0.0}, {}), {"domain": {"y": (0, 1)}}, "no 'y' in this problem"),
    *((problem, ({"x": value}, {}), {}, f"x {NO_NUMBER}") for value in BAD),
    *((problem, ({"x": 0.0}, {"mu": value}), {}, f"mu {NO_NUMBER}") for value in BAD),
    *(
        (problem, (start, params), more, rf"rename \['{name}'\] in the problem")
        for name in ("arclength", "residual")
        for start, params, more in (
            ({name: 1.0}, {}, {}), ({"x": 1.0}, {name: 1.0}, {}),
            ({"x": 1.0}, {}, {"record": {name: lambda point: 0.0}}),
        )
    ),
    (LINE.problem.at, (), {"nu": 1.0}, r"no 'nu' in this problem; it has \['x', 'mu'\]"),
    (LINE.problem.at, (), {"x": [1.0, 2.0]}, r"x = \[1\.0, 2\.0\]: a number was expected"),
    (problem({"u": np.ones(3)}, {}).at, (), {"u": 1.0}, r"u = 1\.0: an array was expected, as it"),
    # equations and their derivatives
    (solved, (lambda u, p: np.zeros(3),), {}, r"the residual has shape \(3,\) for 2 unknowns"),
    (solved, (lambda u, p: 0.0,), {}, r"has shape \(1,\) for 2 unknowns; as many equations as unk"),
    (solved, (lambda u, p: np.zeros((2, 1)),), {}, r"has shape \(2, 1\) for 2 unknowns"),
    *(
        (solved, (lambda x, p, value=value: value,), {"n": 1},
         r"the residual is array.*an array of numbers was expected")
        for value in (None, "a", np.array([object()]), True)
    ),
    (solved, (lambda x, p: x - p["mu"] if p["mu"].real < 0.5 else None,), {"n": 1},
     "the residual is array"),
    *(
        (solved, (lambda x, p, equation=equation: equation(x[0], p["mu"]),), {"n": 1},
         r"no value at the start x=0, mu=0: .+")
        for equation in (
            lambda x, mu: 1 / mu, lambda x, mu: math.log(mu), lambda x, mu: x * math.nan,
        )
    ),
    (solved, (lambda x, p: csr_array([[x[0] - p["mu"]]]),), {"n": 1}, "an array of numbers was"),
    (solved, (lambda x, p: x - p["mu"] if p["mu"] < 0.5 else np.append(x, 0.0),),
     {"n": 1, "jacobian": lambda x, p: np.eye(1)}, r"has shape \(2,\) for 1 unknowns"),
    *(
        (solved, (lambda u, p: u,), {"jacobian": lambda u, p, given=given: given},
         r"the Jacobian (is|has)")
        for given in (None, "matrix", [[1.0, 2.0], [3.0]], np.ones(3), 1j * np.eye(2))
    ),
    (solved, (lambda u, p: u,), {"jacobian": lambda u, p: np.eye(3)},
     r"Jacobian has shape \(3, 3\); \(2, 2\) was expected"),
    (solved, (lambda u, p: u,),
     {"jacobian": lambda u, p: RIGHT, "sensitivity": lambda u, p, name: np.zeros((2, 1))},
     r"sensitivity has shape \(2, 1\); \(2,\) was expected"),
    # starts and directions
    *(
        (cb.trace, (start, "mu"), {}, f"a Problem was expected, or what has one: .* got {kind}")
        for start, kind in ((None, "None"), (3, "an int"), ("PF", "a str"), (3.0, "a float"))
    ),
    *(
        (cb.switch, (point,), {}, f"switch takes a special point .* got {kind}")
        for point, kind in ((None, "None"), ("PF", "a str"), (3.0, "a float"))
    ),
    *(
        (line, (), {"free": free}, r"is not a parameter of this problem; it has \['mu'\]")
        for free in (["mu"], ("mu",), None, 3, "nu", "x")
    ),
    *(
        (cb.trace, (PITCHFORK.problem, "mu"), {"along": along}, "a direction of")
        for along in ("ab", [1j, 1.0], [1.0], [0.0, 0.0], [1.0, math.inf])
    ),
    (cb.trace, (cb.Problem(only_here, {"x": 0.0}, {"mu": 0.0}), "mu"), {"along": [1.0, 0.0]},
     "no curve leaves the start: nothing beside it"),
    *(
        (line, (), {"towards": towards}, "towards must be 'both', 'up' or 'down', got")
        for towards in ("left", "", None, 1)
    ),
    *(
        (cb.diagram, (PITCHFORK.problem, "mu"), {"within": {}, **bound}, "a whole number, at least")
        for bound in (
            {"depth": -1}, {"most": 0}, {"depth": "2"}, {"depth": 1.5}, {"most": None},
            {"depth": True},
        )
    ),
    *(
        (cb.diagram, (PITCHFORK.problem, "mu"), {"within": {}, name: 3}, words)
        for name, words in (
            ("within", "windows by name"), ("events", "an Event was"), ("steps", "given as Steps")
        )
    ),
    # a walk by hand, at once and not at its first point
    (cb.continuation.iterate, (LINE.problem, "mu"), {"towards": "both"},
     "towards must be 'up' or 'down', got 'both'"),
    (cb.continuation.iterate, (LINE.problem, "mu"), {"within": {"nu": (0, 1)}}, "no 'nu'"),
    # windows
    *(
        (line, (), {"within": {"mu": window}}, NO_PAIR)
        for window in ((None, 1), ("a", "b"), (0, 1, 2), 3, None, (math.nan, 1))
    ),
    (line, (), {"within": {0: (0, 1)}}, "windows by name were expected"),
    (line, (), {"within": {"nu": (0, 1)}}, r"no 'nu' in this problem; it has \['x', 'mu'\]"),
    (line, (), {"within": {"mu": (1, 0)}}, r"the window of 'mu' is empty: \(1, 0\)"),
    (line, (), {"within": {"mu": (0, 0)}}, r"the window of 'mu' is empty"),
    (line, (), {"within": {"mu": (1, 2)}}, r"the start has mu=0, outside \(1, 2\)"),
    *(
        (cb.trace, (FOUR, "mu"), {"within": {"u": window}}, words)
        for window, words in (
            ((-1, 30), "its window is one of its norm, which is never negative"),
            ((20, 30), r"the start has \|u\|=2, outside \(20, 30\)"),
            ((9, 8), "the window of 'u' is empty"), (5, "must be a pair"),
        )
    ),
    # events
    (line, (), {"events": 3}, "an Event was expected, fold\\(\\) for instance, got 3"),
    (line, (), {"events": "PF"}, r"an Event was expected, fold\(\) for instance, got 'PF'"),
    (line, (), {"events": [cb.fold]},  # not called
     r"an Event was expected, fold\(\) for instance, got <function fold"),
    (line, (), {"events": [cb.user("nu", 0.3)]}, r"no 'nu' at this point; it has \['x', 'mu'\]"),
    (cb.trace, (FOUR, "mu"), {"events": [cb.user("u", 0.3)]},
     r"the test of UZ gave array.*; one real number was expected"),
    *(
        (measured, (value, since), {}, r"the test of UZ gave .*; one real number was expected")
        for value in (None, 1j, np.array([1.0]), [1.0, 2.0], "a")
        for since in (-9.0, 0.5)
    ),
    # steps
    (line, (), {"steps": 0.1}, r"steps must be given as Steps\(most=..., largest=...\), got 0.1"),
    *(
        (cb.Steps, (), {name: value}, f"^{name} must be {words}, got {value!r}$")
        for name, value, words in (
            ("first", 0.0, "finite and positive"), ("first", "a", "a number"),
            ("largest", -1.5, "finite and positive"), ("largest", math.nan, "finite and positive"),
            ("smallest", math.inf, "finite and positive"), ("smallest", None, "a number"),
            ("tolerance", math.nan, "finite and positive"),
            ("tolerance", -1.0, "finite and positive"),
            ("growth", None, "a number"), ("most", True, "a number"),
            *(("most", count, "a whole number, at least 1 step") for count in (0, 10.5, math.nan)),
        )
    ),
    (cb.Steps, (), {"smallest": 0.02}, r"shorter than smallest = 0\.02, got first = 0\.01"),
    (cb.Steps, (), {"smallest": 0.2, "first": 1.0}, r"and largest = 0\.1"),
    (cb.Steps, (), {"growth": 1.0}, "growth must exceed 1, got 1"),
    (cb.Steps, (), {"growth": 0.5}, "growth must exceed 1, got 0.5"),
    (cb.Steps, (), {"tolerance": 0.9e-13}, "below 1e-13 is lost in rounding, got 9e-14"),
]  # fmt: skip


@pytest.mark.parametrize(("call", "given", "named", "sentence"), GIVEN)
def test_what_makes_no_sense_is_refused(call, given, named, sentence):
    with pytest.raises(BadInput, match=sentence):
        call(*given, **named)


def test_a_point_that_is_not_there_is_an_index_error_with_the_length_of_the_branch() -> None:
    branch = line(within={"mu": (0.0, 0.01)})
    for index in (len(branch), -len(branch) - 1, 10**9, 10**5000):
        with pytest.raises(IndexError, match=rf"^branch\[.*\]: it has {len(branch)} points$"):
            branch[index]


# --- walks ----------------------------------------------------------------------------------------


def test_equations_that_give_complex_numbers_are_refused() -> None:
    with pytest.raises((BadInput, NotConverged), match="real"):
        cb.trace(cb.Problem(lambda x, p: x - p["m"] + 0.1j, {"x": 0.0}, {"m": 0.0}), "m", events=())


@pytest.mark.parametrize("where", ["residual", "later", "jacobian", "sensitivity", "map"])
def test_a_misspelt_parameter_is_a_sentence_with_the_parameters_there_are(where: str) -> None:
    def parabola(x: np.ndarray, p: dict[str, float]) -> np.ndarray:
        name = "mu2" if where == "residual" or (where == "later" and x[0] > 1.1) else "mu"
        return np.array([x[0] ** 2 - p[name]])

    more = {
        "jacobian": {"jacobian": lambda x, p: np.array([[2 * x[0] * p["mu2"]]])},
        "sensitivity": {"jacobian": lambda x, p: np.array([[2 * x[0]]])},
    }.get(where, {})
    start, params = {"x": 1.0}, {"mu": 1.0, "h": 2.0}
    if where == "map":
        problem = cb.FixedPoint(lambda x, p: x + p["mu2"] - x**2, start, params)
    else:
        problem = cb.Problem(parabola, start, params, **more)
    if where == "sensitivity":
        problem = knowing(problem, sensitivity=lambda x, p, name: np.array([-p["mu2"]]))
    words = r"ask for a parameter 'mu2'; this problem has \['mu', 'h'\]"
    with pytest.raises(BadInput, match=words):
        cb.trace(problem, "mu", within={"mu": (0.5, 2.0)})


@pytest.mark.parametrize("made", [cb.Problem, cb.FixedPoint])
@pytest.mark.parametrize("function", [lambda x: x, lambda t, x, p: x, lambda x, *, mu: x - mu])
def test_a_function_of_other_arguments_is_told_which_it_gets(made: Any, function: Any) -> None:
    with pytest.raises(BadInput, match="is called with x and the dict of parameters, as lambda x"):
        cb.trace(made(function, {"x": 1.0}, {"mu": 1.0}), "mu")


def test_an_error_of_type_in_the_equations_is_their_own() -> None:
    with pytest.raises(TypeError, match="unsupported operand"):
        cb.trace(cb.Problem(lambda x, mu: mu - x**2, {"x": 1.0}, {"mu": 1.0}), "mu")


@pytest.mark.parametrize(
    ("residual", "more"),
    [
        (lambda x, p: x * {}["mu"], {}),
        (lambda x, p: x - p["mu"] if p["mu"] < 1.5 else x - {}["mu"], {}),
        (lambda x, p: x - p["mu"], {"jacobian": lambda x, p: {}["mu"]}),
    ],
)
def test_a_table_of_the_users_own_without_an_entry_is_an_error_of_its_own(residual, more) -> None:
    problem = cb.Problem(residual, {"x": 1.0}, {"mu": 1.0}, **more)
    with pytest.raises(KeyError, match="mu"):
        cb.trace(problem, "mu", within={"mu": (0.5, 2.0)})


def test_equations_in_single_precision_are_refused() -> None:
    def circle(x, p):
        return np.array([x[0] ** 2 + p["mu"] ** 2 - 1], dtype=np.float32)

    with pytest.raises(BadInput, match="single precision, float32"):
        cb.trace(cb.Problem(circle, {"x": 1.0}, {"mu": 0.0}), "mu")
    with pytest.raises(BadInput, match="what f returns has single precision"):
        cb.equilibrium(lambda t, x, p: np.float32(p["mu"] - x), {"x": 1.0}, {"mu": 1.0})
    with pytest.raises(BadInput, match="what the map makes has single precision"):
        cb.trace(cb.FixedPoint(lambda x, p: np.float32(p["mu"] * x), {"x": 0.0}, {"mu": 0.5}), "mu")


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("number", [complex, Fraction])
def test_equations_of_numbers_that_are_no_floats_are_refused(number) -> None:
    with pytest.raises(BadInput, match=r"f returns array\(.*real numbers were expected, at t = 0"):
        cb.cycle(lambda t, x, p: [number(x[1]), number(-x[0])], {"x": 1.0, "v": 0.0}, {"mu": 1.0})
    with pytest.raises(BadInput, match=r"an array of numbers was expected|are not real"):
        cb.trace(cb.Problem(lambda x, p: [number(x[0])], {"x": 0.0}, {"mu": 1.0}), "mu")
