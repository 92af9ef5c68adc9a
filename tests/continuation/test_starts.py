"""What a walk is given: windows, directions, steps, events, residuals; and ends at their rims."""

from __future__ import annotations

import math

import numpy as np
import pytest

from contbreather.continuation import Event, Problem, Steps, Stop, trace, user
from contbreather.errors import BadInput

from .zoo import CUSP, LINE, PITCHFORK, events_of, trace_case


@pytest.mark.parametrize("largest", [0.1, 1e-2, 1e-3])
def test_an_event_at_the_rim_of_the_domain_is_met_at_any_step(largest: float) -> None:
    gone = Event("GR", lambda point: 0.3 * point["x"], terminal=True, positive=True)
    problem = Problem(LINE.problem.residual, {"x": 0.4}, {"mu": 0.2}, domain={"x": (1e-14, 9.0)})
    branch = trace(
        problem, "mu", towards="down", events=[gone], steps=Steps(first=largest, largest=largest)
    )
    assert branch[-1].label == "GR1"
    assert branch.stop is Stop.EVENT
    assert branch[-1]["x"] == 1e-14


def test_the_end_of_the_domain_is_told_from_that_of_the_window() -> None:
    problem = Problem(LINE.problem.residual, {"x": 0.0}, {"mu": 0.0}, domain={"x": (-1.0, 9.0)})
    branch = trace(problem, "mu", within={"mu": (-3.0, 3.0), "x": (-2.0, 2.0)}, events=())
    assert branch.began is branch.stop is Stop.BOUND
    assert branch.began_reason == "the domain of x ends at -1"
    assert branch.reason == ""


# --- what is refused --------------------------------------------------------------------------


@pytest.mark.parametrize("window", [(None, 1), ("a", "b"), (0, 1, 2), 3, None])
def test_a_window_that_is_no_pair_of_numbers_is_refused(window) -> None:
    with pytest.raises(BadInput, match=r"the window of 'mu' must be a pair \(low, high\) of num"):
        trace(LINE.problem, "mu", within={"mu": window})


@pytest.mark.parametrize("free", [["mu"], ("mu",), None, 3])
def test_the_free_parameter_is_named(free) -> None:
    with pytest.raises(BadInput, match=r"is no parameter of this problem; it has \['mu'\]"):
        trace(LINE.problem, free)


def test_a_single_event_may_be_given_alone() -> None:
    branch = trace(LINE.problem, "mu", within={"mu": (-1.0, 1.0)}, events=user("mu", 0.3))
    assert branch.first("UZ")["mu"] == pytest.approx(0.3)
    with pytest.raises(BadInput, match="events must be a list of them, got 3"):
        trace(LINE.problem, "mu", events=3)


def test_steps_are_given_as_steps() -> None:
    with pytest.raises(BadInput, match=r"steps must be given as Steps\(largest=...\), got 0.1"):
        trace(LINE.problem, "mu", steps=0.1)


@pytest.mark.parametrize("start", [None, 3, "a"])
def test_a_start_that_has_no_problem_is_refused(start) -> None:
    with pytest.raises(BadInput, match=f"got a {type(start).__name__}"):
        trace(start, "mu")


@pytest.mark.parametrize("value", ["a", 1j, [[1], [1, 2]], {}])
def test_unknowns_and_parameters_are_numbers(value) -> None:
    for start, params in (({"x": value}, {"mu": 0.0}), ({"x": 0.0}, {"mu": value})):
        with pytest.raises(BadInput, match="must be a number or a one-dimensional array"):
            Problem(lambda x, p: x, start, params)


def test_a_problem_has_unknowns_by_name() -> None:
    with pytest.raises(BadInput, match="'x' is empty; at least one number was wanted"):
        Problem(lambda x, p: x, {"x": np.zeros(0)}, {"mu": 0.0})
    with pytest.raises(BadInput, match=r"start must be a dict of names and values, got \[1.0\]"):
        Problem(lambda x, p: x, [1.0], {"mu": 0.0})


@pytest.mark.parametrize("value", [None, "a", np.array([object()]), True])
def test_a_residual_that_is_no_array_of_numbers_is_refused(value) -> None:
    with pytest.raises(BadInput, match=r"the residual is array.*an array of numbers was wanted"):
        trace(Problem(lambda x, p: value, {"x": 0.0}, {"mu": 0.0}), "mu")


def test_a_residual_that_forgets_to_return_is_told_on_the_way() -> None:
    def residual(x, p):
        if np.real(p["mu"]) < 0.5:
            return x - p["mu"]
        return None

    with pytest.raises(BadInput, match="the residual is array"):
        trace(Problem(residual, {"x": 0.0}, {"mu": 0.0}), "mu")


@pytest.mark.parametrize("value", [None, 1j, np.array([1.0]), "a"])
def test_a_test_that_gives_no_number_is_refused(value) -> None:
    for since in (-9.0, 0.5):
        event = Event("UZ", lambda point, since=since: 1.0 if point["mu"] < since else value)
        with pytest.raises(BadInput, match=r"the test of UZ gave .*; one real number was wanted"):
            trace(LINE.problem, "mu", within={"mu": (-1.0, 1.0)}, events=[event])


@pytest.mark.parametrize(
    ("entries", "sentence"),
    [
        ({"tolerance": 1e-17}, "a tolerance below 1e-13 is lost in rounding, got 1e-17"),
        ({"first": "a"}, "must be a number"),
        ({"growth": None}, "must be a number"),
        ({"most": True}, "must be a number"),
        ({"most": 10.5}, "most must be a whole number, at least 1 step, got 10.5"),
        ({"most": math.nan}, "most must be a whole number, at least 1 step, got nan"),
        ({"most": 0}, "most must be a whole number, at least 1 step, got 0"),
    ],
)
def test_steps_that_make_no_sense_are_refused(entries, sentence: str) -> None:
    with pytest.raises(BadInput, match=sentence):
        Steps(**entries)


def test_the_smallest_tolerance_loses_nothing() -> None:
    branch = trace_case(CUSP, steps=Steps(tolerance=1e-13, most=np.int64(500)))
    assert [point.kind for point in events_of(branch)] == ["LP", "LP"]


# --- directions -------------------------------------------------------------------------------


@pytest.mark.parametrize("along", ["ab", [1j, 1.0], [1.0], [0.0, 0.0], [1.0, math.inf]])
def test_a_direction_is_a_vector_of_numbers(along) -> None:
    with pytest.raises(BadInput, match="a direction of"):
        trace(PITCHFORK.problem, "mu", along=along)


@pytest.mark.parametrize("along", [(0.6, 0.8), (0.6, -0.8), (1.0, 1.0)])
def test_at_a_pitchfork_no_curve_leaves_between_the_two_that_do(along) -> None:
    problem = PITCHFORK.problem.at(x=0.0, mu=0.0)
    branch = trace(problem, "mu", along=along, within={"mu": (-1.0, 1.0)})
    assert len(branch) == 1
    assert branch.stop is Stop.NO_CONVERGENCE
    assert branch.reason.startswith("no curve leaves the start in this direction: ")


# --- tests that are exactly zero --------------------------------------------------------------


@pytest.mark.parametrize("largest", [0.1, 0.5])
@pytest.mark.parametrize(
    "test",
    [
        lambda q: min(0.0, q["mu"] - 0.3),
        lambda q: 0.0 if abs(q["mu"] - 0.3) < 0.2 else q["mu"] - 0.3,
        lambda q: 0.0 if q["mu"] > 0.3 else -1.0,
    ],
)
def test_a_test_that_is_zero_along_a_piece_of_the_curve_has_no_place(test, largest: float) -> None:
    branch = trace(
        LINE.problem.at(x=-0.9, mu=-0.9),
        "mu",
        within={"mu": (-1.0, 1.0)},
        events=[Event("EX", test)],
        steps=Steps(first=largest, largest=largest),
    )
    assert events_of(branch) == []
    (point,) = branch.doubtful
    assert "zero along a piece of the curve" in point.detail["reason"]
