"""How walks begin, step, and end."""

from __future__ import annotations

import itertools
import math
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from contbreather.continuation import (
    Branch,
    Event,
    Problem,
    Steps,
    Stop,
    branch_point,
    fold,
    iterate,
    trace,
    user,
)
from contbreather.errors import BadInput, Interrupted, NotConverged

from . import zoo
from .zoo import TIP

WIDE = {"mu": (-2.0, 2.0)}


def ending(equation, x=1.0, mu=1.0, within=WIDE, towards="down", **given):
    """A branch in mu that runs into trouble, and how many residuals that took."""
    problem, counter = zoo.counted(zoo.scalar(equation, x, {"mu": mu}))
    return trace(problem, "mu", within=within, towards=towards, **given), counter.calls


# --- starts -----------------------------------------------------------------------------------


def test_a_start_that_is_no_solution_is_refused_with_its_residual() -> None:
    none = zoo.scalar(lambda x, p: x**2 + p["mu"], 1.0, {"mu": 1.0})
    with pytest.raises(NotConverged, match=r"x=1, mu=1 is not a solution: residual 2") as refused:
        trace(none, "mu")
    assert refused.value.residual == 2.0


@pytest.mark.parametrize("h", [0.384900179, 0.384900180])
def test_a_fold_typed_with_nine_digits_is_a_start_on_either_side_of_it(h: float) -> None:
    branch = zoo.trace_case(replace(zoo.CUSP, problem=zoo.CUSP.problem.at(x=-0.577350269, h=h)))
    assert [point.kind for point in zoo.events_of(branch)] == ["LP", "LP"]
    assert branch[0]["x"] in (-2.0, 2.0)


@pytest.mark.parametrize("shift", [0.0, 1e-17, -1e-16])
@pytest.mark.parametrize(
    "case", [zoo.PITCHFORK, zoo.TRANSCRITICAL, zoo.LORENZ], ids=lambda case: case.name
)
def test_from_a_branch_point_the_curve_along_the_parameter_is_followed(case, shift):
    r = 1.0 if case is zoo.LORENZ else 0.0
    start = dict.fromkeys(case.problem.start, shift)
    problem = case.problem.at(**start, **{case.free: r})
    branch = trace(problem, case.free, events=zoo.STATIC, within={case.free: (r - 0.9, r + 1.0)})
    assert [point.kind for point in branch.special] == ["EP", "BP", "EP"]
    assert abs(branch.first("BP")[case.free] - r) < 1e-12
    if case is not zoo.TRANSCRITICAL:
        assert abs(branch["x"]).max() < 1e-15


def test_every_walk_from_a_fold_goes_the_other_way_when_told() -> None:
    for x, mu in ((0.0, 1.0), (0.0, -1.0), (1.0, 0.0)):
        problem = zoo.CIRCLE.problem.at(x=x, mu=mu)
        up, down = (
            list(itertools.islice(iterate(problem, "mu", towards=s), 3)) for s in ("up", "down")
        )
        assert np.allclose(up[0].tangent, -down[0].tangent, atol=1e-12)
        assert up[2]["x"] * down[2]["x"] < 0 or up[2]["mu"] * down[2]["mu"] < 0


# --- ends: the window -------------------------------------------------------------------------


@pytest.mark.slow
@settings(max_examples=8, derandomize=True)
@given(st.floats(-1.9, -1.0), st.floats(1.0, 1.9), st.floats(0.02, 2.0))
def test_a_branch_ends_exactly_at_its_bounds(low: float, high: float, largest: float) -> None:
    steps = Steps(first=0.01, largest=largest)
    branch = trace(zoo.CUSP.problem, "h", within={"x": (low, high)}, steps=steps, events=())
    assert branch.stop is branch.began is Stop.BOUND
    assert branch["x"][0] == low
    assert branch["x"][-1] == high
    assert ((low <= branch["x"]) & (branch["x"] <= high)).all()
    assert abs(branch["residual"]).max() < 1e-14


def test_two_bounds_at_one_corner_end_the_branch_there() -> None:
    branch = trace(zoo.LINE.problem, "mu", within={"x": (-1.0, 1.0), "mu": (-0.5, 0.5)})
    assert branch.stop is branch.began is Stop.BOUND
    assert branch[-1]["x"] == pytest.approx(1.0, abs=1e-15)
    assert branch[-1]["mu"] == pytest.approx(0.5, abs=1e-15)


def test_a_start_on_a_bound_goes_inwards_only() -> None:
    branch = trace(zoo.LINE.problem, "mu", within={"mu": (0.0, 1.0)})
    assert branch[0]["mu"] == 0.0
    assert branch[-1]["mu"] == 1.0
    assert [point.label for point in branch.special] == ["EP1", "EP2"]
    alone = trace(zoo.LINE.problem, "mu", within={"mu": (0.0, 1.0)}, towards="down")
    assert len(alone) == 1
    assert alone.stop is Stop.BOUND


@pytest.mark.parametrize("depth", [1e-1, 1e-3, 1e-5, 1e-7])
def test_a_window_that_a_curve_leaves_only_for_a_moment_still_ends_it(depth: float) -> None:
    within = {"h": (-9.0, 2 * TIP**3 - depth), "x": (-2.0, 2.0)}
    branch = trace(zoo.CUSP.problem, "h", within=within, events=[fold()])
    assert branch.stop is Stop.BOUND
    assert branch[-1]["h"] == within["h"][1]
    assert branch[-1]["x"] < -TIP
    assert not zoo.events_of(branch)


def test_an_event_exactly_at_a_bound_is_found() -> None:
    at_fold = trace(zoo.CUSP.problem, "h", within={"x": (-2.0, -TIP)}, events=zoo.ALL)
    assert [point.label for point in at_fold.special] == ["EP1", "LP1"]
    at_hopf = trace(zoo.BRUSSELATOR.problem, "B", within={"B": (0.5, 2.0)}, events=zoo.ALL)
    assert [point.label for point in at_hopf.special] == ["EP1", "HB1"]
    assert at_hopf[-1]["B"] == 2.0
    at_branch_point = trace(zoo.PITCHFORK.problem, "mu", within={"mu": (-1.0, 0.0)}, events=zoo.ALL)
    assert [point.label for point in at_branch_point.special] == ["EP1", "BP1"]


def test_a_bent_branch_ends_on_the_edge_of_its_window_where_another_crosses_it() -> None:
    def eaten(x, p):  # predators that die out at d = 5/4, where x = 1, y = 0
        meal = 5 * x[0] / (1 + 3 * x[0])
        return np.array([x[0] * (1 - x[0]) - meal * x[1], x[1] * (meal - p["d"])])

    prey = Problem(eaten, {"x": 0.8, "y": 0.1}, {"d": 1.1}, events=[branch_point()])
    branch = trace(prey, "d", within={"d": (0.5, 1.25)})
    assert [branch[-1][name] for name in "dxy"] == pytest.approx([1.25, 1.0, 0.0], abs=1e-9)
    growth = trace(zoo.logistic(), "r", within={"r": (1.0, 2.9)})
    assert (growth[0]["r"], growth.began) == (1.0, Stop.BOUND)
    assert growth["x"] == pytest.approx(1 - 1 / growth["r"], abs=1e-9)
    for each in (branch, growth):
        assert sorted(point.label for point in each.special) == ["BP1", "EP1"]
        assert not each.doubtful


def test_the_domain_of_a_problem_is_a_window_too() -> None:
    problem = replace(zoo.LINE.problem, domain={"x": (-1.0, math.inf)})
    branch = trace(problem, "mu", within={"mu": (-3.0, 3.0), "x": (-2.0, 2.0)})
    assert (branch[0]["x"], branch[-1]["x"]) == (-1.0, 2.0)
    assert branch.began is branch.stop is Stop.BOUND
    assert (branch.began_reason, branch.reason) == ("the domain of x ends at -1", "")
    pieces = [branch[:3], branch[1:]]  # the first of which begins as the whole does
    assert [piece.began_reason for piece in pieces] == [branch.began_reason, ""]


@pytest.mark.parametrize("last", [0.5, 0.99])
def test_the_reason_names_the_domain_that_ended_a_branch_even_just_beyond_an_event(last) -> None:
    problem = replace(zoo.LINE.problem, domain={"x": (-1.0, 1.0)})
    steps, events = Steps(first=0.4, largest=0.4), [user("x", last)]
    branch = trace(problem, "mu", within={"mu": (-3, 3)}, events=events, steps=steps, towards="up")
    assert branch.first("UZ")["x"] == pytest.approx(last)
    assert branch.reason == "the domain of x ends at 1"


# --- ends: trouble ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("equation", "x", "stop", "reason", "there"),
    [
        (lambda x, p: x - np.sqrt(p["mu"]), 1.0, Stop.DOMAIN, "not finite", 0.0),
        (lambda x, p: x - math.sqrt(p["mu"]), 1.0, Stop.DOMAIN, "math domain|nonnegative", 0.0),
        (lambda x, p: x - p["mu"] ** 0.5, 1.0, Stop.DOMAIN, "not real", 0.0),
        (lambda x, p: x - p["mu"] * np.log(p["mu"]), 0.0, Stop.DOMAIN, "not finite", 0.0),
        (lambda x, p: x - 1 if p["mu"] > 0.5 else math.nan, 1.0, Stop.DOMAIN, "not finite", 0.5),
        (lambda x, p: x - 1 if p["mu"] > 0.5 else 1 / 0, 1.0, Stop.DOMAIN, "division by zero", 0.5),
        (lambda x, p: x - np.sign(p["mu"]), 1.0, Stop.NO_CONVERGENCE, "", 0.0),
        (lambda x, p: x - abs(p["mu"]), 1.0, Stop.NO_CONVERGENCE, "", 0.0),
        (lambda x, p: x**3 - p["mu"] ** 2, 1.0, Stop.NO_CONVERGENCE, "", 0.0),
    ],
)
def test_trouble_ends_a_branch_with_a_reason_and_bounded_work(equation, x, stop, reason, there):
    branch, calls = ending(equation, x)
    assert branch.stop is stop
    assert re.search(reason, branch.reason)
    assert branch.special[-1].kind == "MX"
    assert branch[-1]["mu"] == pytest.approx(there, abs=1e-3)
    assert calls < 15000
    assert len(branch) < 250


def test_the_rim_is_reached_not_only_approached() -> None:
    exact, _ = ending(lambda x, p: x - np.sqrt(p["mu"]))  # by complex steps
    assert 0 <= exact[-1]["mu"] < 1e-12
    close, _ = ending(lambda x, p: x - math.sqrt(p["mu"]))  # differences need room to either side
    assert 0 <= close[-1]["mu"] < 1e-6


@pytest.mark.parametrize(
    "root",
    [
        lambda x, p: x - np.sqrt(1 - p["mu"]),
        lambda x, p: x - np.arccos(p["mu"]),
        lambda x, p: x**2 - np.sqrt(1 - p["mu"] ** 2),
    ],
)
def test_no_branch_goes_on_behind_a_root_at_the_edge_of_its_domain(root):
    """At mu = 1 itself a complex step found it as steep as rounding: x went down to -0.24."""
    branch = trace(zoo.scalar(root, 1.0, {"mu": 0.0}), "mu", towards="up")
    assert (branch.stop, branch.reason) == (Stop.DOMAIN, "the derivatives are not finite")
    assert branch["x"].min() >= 0
    assert branch[-1]["x"] < 1e-4
    with pytest.raises(BadInput, match="no curve leaves the start: the derivatives"):
        trace(zoo.scalar(root, 0.0, {"mu": 1.0}), "mu")


def test_a_root_whose_unknown_is_at_the_edge_has_no_derivative_at_the_start() -> None:
    with pytest.raises(BadInput, match="no curve leaves the start: the derivatives"):
        trace(zoo.scalar(lambda x, p: np.sqrt(x) - p["mu"], 0.0, {"mu": 0.0}), "mu")


def test_a_steep_slope_is_no_edge() -> None:
    steep = zoo.scalar(lambda x, p: x - 1e15 * (p["mu"] - 1), 0.0, {"mu": 1.0})
    branch = trace(steep, "mu", within={"x": (-3, 3)})
    assert (branch["x"].min(), branch["x"].max()) == (-3, 3)

    # as coverage of a surface with rates in 1/s, down to no pressure: its last digits move nothing
    rates = zoo.scalar(lambda x, p: 1e13 * (p["mu"] * (1 - x) - x) + 1 - x, 0.5, {"mu": 1.0})
    branch = trace(rates, "mu", within={"mu": (0, 2)})
    assert (branch["mu"].min(), branch["mu"].max()) == (0, 2)


def test_a_pole_is_followed_until_the_steps_are_used_up() -> None:
    branch, calls = ending(lambda x, p: x * p["mu"] - 1, steps=Steps(most=300))
    assert branch.stop is Stop.MOST
    assert len(branch) == 301
    assert branch[-1]["x"] > 25
    assert abs(branch["x"] * branch["mu"] - 1).max() < 1e-13
    assert calls < 15 * len(branch)


@pytest.mark.slow
def test_a_walk_that_gets_nowhere_ends() -> None:
    kink, _ = ending(lambda x, p: x - abs(p["mu"]), steps=Steps(most=9999))
    assert kink.reason.startswith("the curve has a kink, where its tangent jumps")
    rough = "the curve is not smooth at the smallest step"
    for power, wanted in ((2, "200 steps in a row had to be tiny"), (0, rough)):
        branch, calls = ending(
            lambda x, p, power=power: x - p["mu"] ** power * np.sin(1 / p["mu"]),
            math.sin(1.0), steps=Steps(most=9999),
        )  # fmt: skip
        assert (branch.stop, branch.reason) == (Stop.NO_CONVERGENCE, wanted)
        assert calls < 20 * len(branch)


@pytest.mark.slow
def test_a_curve_that_ends_at_a_kink_says_so_and_keeps_its_derivatives() -> None:
    """Complex steps have the mean of both slopes of `abs` at its kink, as differences do."""

    def kinked(x, p):
        return p["mu"] - x - p["k"] * abs(x - 1)

    for k in (0.44, 1.5):
        for x in (-1.9, -0.5, 0.3, 1.0, 1.7, 2.4):
            start = zoo.scalar(kinked, x, {"mu": x + k * abs(x - 1), "k": k})
            branch = trace(start, "mu", within={"mu": (-9, 9), "x": (-4, 4)})
            reason = branch.reason or branch.began_reason
            assert reason.startswith("the curve has a kink, where its tangent jumps")
            far = [point for point in branch if abs(point["x"] - 1) > 1e-5]
            slopes = [point.jacobian()[0, 0] for point in far]
            wanted = [-1 - k * np.sign(point["x"] - 1) for point in far]
            assert slopes == pytest.approx(wanted, abs=1e-5)


def test_overflow_ends_a_branch_without_a_warning() -> None:
    start = zoo.scalar(lambda x, p: np.exp(x) - np.exp(p["mu"]), 0.0, {"mu": 0.0})
    branch = trace(start, "mu", towards="up", steps=Steps(largest=1e3), events=zoo.ALL)
    assert branch.stop in (Stop.DOMAIN, Stop.NO_CONVERGENCE)
    assert branch[-1]["mu"] > 300
    assert zoo.events_of(branch) == []


def test_walking_by_hand_leaks_no_warnings_either_and_leaves_numpy_as_it_was() -> None:
    problem = zoo.scalar(lambda x, p: x - np.sqrt(p["mu"]), 1.0, {"mu": 1.0})
    before = np.geterr()
    for _ in iterate(problem, "mu", towards="down"):
        assert np.geterr() == before


def test_equations_that_hold_twice_end_or_walk_but_never_hang() -> None:
    problem, counter = zoo.counted(zoo.scalar(lambda x, p: (x - p["mu"]) ** 2, 0.0, {"mu": 0.0}))
    branch = trace(problem, "mu", within=WIDE, events=zoo.ALL)
    assert zoo.events_of(branch) == []
    assert counter.calls < 6000


# --- interruption -----------------------------------------------------------------------------


def sine(x, p):
    return np.array([x[0] - np.sin(p["mu"])])


def traced(residual) -> Branch:
    problem = Problem(residual, {"x": 0.0}, {"mu": 0.0})
    return trace(problem, "mu", within={"mu": (-5, 5)}, events=[user("mu", 0.02), fold()])


@pytest.mark.parametrize("after", [60, 150, 400, 700])
def test_an_interruption_hands_over_a_piece_of_the_whole_branch(after: int) -> None:
    with pytest.raises(Interrupted, match="interrupted; the points up to here are kept") as stop:
        traced(zoo.Counted(sine, interrupted=after))
    branch = stop.value.partial
    assert branch.stop is Stop.INTERRUPTED
    assert len(branch) > 1
    assert abs(branch["x"] - np.sin(branch["mu"])).max() < 1e-14
    assert branch[-1].label in ("EP1", "EP2")
    assert (np.diff(branch["arclength"]) > 0).all()
    assert {*branch["mu"].round(9)} <= {*traced(sine)["mu"].round(9)}


def test_an_interruption_before_the_first_point_has_nothing_to_hand_over() -> None:
    def residual(x, p):
        raise KeyboardInterrupt

    with pytest.raises(Interrupted, match="nothing is done yet") as stop:
        trace(Problem(residual, {"x": 0.0}, {"mu": 0.0}), "mu")
    assert stop.value.partial is None


def test_an_interrupted_walk_inside_of_another_is_not_taken_for_it() -> None:
    inner = zoo.Counted(sine, interrupted=150)

    def residual(x, p):
        return np.array([x[0] - traced(inner)["x"][-1] * p["mu"]])

    with pytest.raises(Interrupted) as stop:
        trace(Problem(residual, {"x": 0.0}, {"mu": 0.0}), "mu")
    assert stop.value.partial is None


# --- closed curves ----------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("scale", [0.3, 10.0])
@pytest.mark.parametrize("angle", [0.0, 0.3, math.pi / 2, math.pi])
def test_a_circle_closes_from_anywhere_with_each_event_once(angle: float, scale: float) -> None:
    problem = zoo.CIRCLE.problem.at(x=math.cos(angle), mu=math.sin(angle))
    events = [fold(), user("x", 0.5), user("mu", math.sin(angle)), user("x", math.cos(angle))]
    for towards in ("up", "down", "both"):
        branch = zoo.trace_case(zoo.CIRCLE, scale, start=problem, events=events, towards=towards)
        assert branch.stop is Stop.CLOSED
        assert np.array_equal(branch[0].z, branch[-1].z)
        length = branch[-1].arclength
        assert length == pytest.approx(2 * math.pi, rel=1e-2)
        kinds = [point.kind for point in zoo.events_of(branch)]
        assert kinds.count("LP") == 2
        tests = [id(point.event) for point in zoo.events_of(branch)]
        assert tests.count(id(events[1])) == 2
        for event, folded in ((events[2], math.cos(angle)), (events[3], math.sin(angle))):
            assert tests.count(id(event)) == (1 if abs(folded) < 1e-12 else 2)


@pytest.mark.slow
@pytest.mark.parametrize("pitch", [1e-1, 1e-3, 1e-5])
def test_a_spiral_is_not_taken_for_a_closed_curve(pitch: float) -> None:
    def residual(u, p):  # the angle is an unknown: neighbouring turns are far apart in it
        x, y, angle = u
        r = 1 + pitch * angle
        return np.array([x - r * np.cos(angle), y - r * np.sin(angle), p["mu"] - angle / 50])

    problem = Problem(residual, {"x": 1.0, "y": 0.0, "angle": 0.0}, {"mu": 0.0})
    branch = trace(problem, "mu", towards="up", within={"mu": (0.0, 1.0)})
    assert branch.stop is Stop.BOUND


def test_a_start_with_other_unknowns_that_slides_along_the_curve_closes_nothing() -> None:
    """Of cycles towards an infinite period the first one in another phase, on a coarse mesh, was
    corrected to another cycle."""

    class Shifted(Problem):
        def phases(self, x, params):
            return (x + np.array([0.6, 0.1]),)

    steep = Shifted(lambda x, p: (p["mu"] - 1e-3 * x[0], x[1]), {"x": 0.0, "y": 0.0}, {"mu": 0.0})
    branch = trace(steep, "mu", towards="up", within={"x": (-1, 3)})
    assert (branch.stop, branch[-1]["x"]) == (Stop.BOUND, 3.0)


def test_a_curve_that_crosses_itself_at_its_start_closes_only_when_it_is_through() -> None:
    eight = zoo.scalar(lambda x, p: x**4 - x**2 + p["mu"] ** 2, 0.0, {"mu": 0.0})
    branch = trace(eight, "mu", events=zoo.STATIC)
    assert branch.stop is Stop.CLOSED
    assert [point.kind for point in zoo.events_of(branch)] == ["BP", "LP", "LP", "BP", "LP", "LP"]


# --- steps ------------------------------------------------------------------------------------


def test_curvature_shortens_the_steps() -> None:
    def residual(u, p):
        return np.array([u[0] - np.tanh(200 * p["mu"])])

    branch = trace(
        Problem(residual, {"x": -1.0}, {"mu": -1.0}), "mu", within={"mu": (-1.0, 1.0)}, events=()
    )
    lengths = np.diff(branch["arclength"])
    bend = abs(branch["mu"][:-1]) < 0.02
    assert lengths[bend].min() < 0.02 * lengths.max()
    assert abs(branch["x"] - np.tanh(200 * branch["mu"])).max() < 1e-13
    assert len(branch) < 150


@pytest.mark.slow
@pytest.mark.parametrize("distance", [1e-1, 1e-2, 1e-4])
@pytest.mark.parametrize("largest", [0.1, 1.0])
def test_a_walk_does_not_jump_to_a_parallel_curve(distance: float, largest: float) -> None:
    def equation(x, p):
        off = x - np.sin(3 * p["mu"])
        return off * (off - distance) * (off + distance)

    branch = trace(
        zoo.scalar(equation, 0.0, {"mu": 0.0}),
        "mu",
        within={"mu": (-1.1, 1.1)},
        steps=Steps(first=0.1 * largest, largest=largest),
        events=zoo.STATIC,
    )
    assert branch.stop is branch.began is Stop.BOUND
    assert abs(branch["x"] - np.sin(3 * branch["mu"])).max() < 1e-13
    assert zoo.events_of(branch) == []


def test_a_walk_passes_branch_points_of_any_kind_without_events() -> None:
    for case in (zoo.PITCHFORK, zoo.ARMS, zoo.TRANSCRITICAL, zoo.crowded(1e-4), zoo.LORENZ):
        branch = zoo.trace_case(case, events=())
        assert branch.stop is case.stop
        assert len(branch) < 1000


@pytest.mark.parametrize(
    "equation",
    [
        lambda x, p: x * (x - p["mu"]) * (x + p["mu"]),  # three lines through a point
        lambda x, p: (x - p["mu"] ** 2) * (x + p["mu"] ** 2) * (1 + x**2),  # two that touch
    ],
)
def test_a_walk_passes_degenerate_crossings_and_gives_them_no_label(equation) -> None:
    problem, counter = zoo.counted(zoo.scalar(equation, 0.49, {"mu": 0.7}))
    problem = problem.at(x=0.7 if equation(0.7, {"mu": 0.7}) == 0 else 0.49)
    branch = trace(problem, "mu", within={"mu": (-1.0, 1.0)}, events=zoo.STATIC)
    assert branch.stop is branch.began is Stop.BOUND
    assert zoo.events_of(branch) == []
    assert counter.calls < 3000


# --- work -------------------------------------------------------------------------------------


def test_an_event_that_jumps_costs_no_more_than_a_bisection() -> None:
    tests = 0

    def above(point) -> bool:
        nonlocal tests
        tests += 1
        return point["mu"] > 0.3217

    branch = trace(zoo.LINE.problem, "mu", within={"mu": (-1.0, 1.0)}, events=[Event("UP", above)])
    assert branch.first("UP")["mu"] == pytest.approx(0.3217, abs=1e-13)
    assert tests < 2 * len(branch) + 60


@pytest.mark.slow
@pytest.mark.parametrize("size", [1e-7, 1e6])
def test_a_branch_that_breaks_off_says_which_scales_are_far_from_one(size: float) -> None:
    def residual(x, p):
        return np.array([p["mu"] - (x[0] / size) ** 2])

    def walked(start, **scales) -> Branch:
        problem = Problem(residual, start=start, params={"mu": 1.0}, **scales)
        return trace(problem, "mu", within={"mu": (-1, 2)}, events=[fold()])

    broken = walked({"x": size})
    assert broken.began is Stop.NO_CONVERGENCE
    advice = {"x": size}
    assert broken.began_reason.endswith(f"give the problem scales={advice}")
    assert [at.label for at in walked({"x": size}, scales=advice).special] == ["EP1", "LP1", "EP2"]


def test_a_branch_that_breaks_off_in_sizes_near_one_is_given_no_advice() -> None:
    def residual(x, p):
        return np.array([x[0] - np.sqrt(p["mu"] - 1.0)])  # not a number below mu = 1

    problem = Problem(residual, start={"x": 1.0}, params={"mu": 2.0})
    broken = trace(problem, "mu", within={"mu": (0, 3)})
    assert broken.began.failed
    assert "scales" not in broken.began_reason


def test_a_function_that_numba_decorated_is_called_as_it_was_written() -> None:
    numba = pytest.importorskip("numba")

    def line(x, p):
        return [x[0] - p["m"]]

    problem = Problem(numba.njit(line), {"x": 0.0}, {"m": 0.0})
    assert problem.residual is line
