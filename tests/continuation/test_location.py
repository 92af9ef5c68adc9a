"""What is seen and located on one step: several events, jumps, poles, NaN, both ends."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import contbreather as cb
from contbreather.continuation import (
    Branch,
    DefiningSystem,
    Event,
    Point,
    Problem,
    Steps,
    Stop,
    branch_point,
    fold,
    hopf,
    trace,
    user,
)
from contbreather.continuation.algebra.sparse import Undefined
from contbreather.continuation.events.event_location import _at_crossing
from contbreather.continuation.events.step_interpolant import StepInterpolant, StepSamples
from contbreather.errors import BadInput

from . import zoo

LONG = Steps(first=0.5, largest=3.0)  # the whole line in a few steps
UNIT = {"mu": (-1.0, 1.0)}


def on_line(*events: Event, start: float = 0.0, within=None, **given) -> Branch:
    """A branch along ``x = 2 mu``, where nothing but the tests can go wrong."""
    problem = zoo.LINE.problem.at(x=2 * start, mu=start)
    return trace(problem, "mu", within=within or UNIT, events=events, **given)


def places(branch: Branch) -> list[float]:
    return [point["mu"] for point in zoo.events_of(branch)]


# --- zeros ------------------------------------------------------------------------------------


@pytest.mark.slow
@settings(max_examples=25, derandomize=True)
@given(st.lists(st.floats(-0.99, 0.99), min_size=1, max_size=6, unique=True), st.floats(0.01, 3.0))
def test_all_events_in_one_step_are_found_in_order(values: list[float], largest: float) -> None:
    steps = Steps(first=largest, largest=largest)
    branch = on_line(*(user("mu", value) for value in values), steps=steps)
    assert places(branch) == pytest.approx(sorted(values), abs=1e-11)
    assert [point.label for point in zoo.events_of(branch)] == [
        f"UZ{i}" for i in range(1, len(values) + 1)
    ]
    assert branch.doubtful == ()


def test_two_events_at_the_same_place_are_both_kept() -> None:
    branch = on_line(user("mu", 0.3), user("x", 0.6), steps=LONG)
    assert places(branch) == pytest.approx([0.3, 0.3], abs=1e-15)
    at_folds = zoo.trace_case(zoo.CUSP, events=[fold(), user("x", 3**-0.5), user("x", -(3**-0.5))])
    assert sorted(point.kind for point in zoo.events_of(at_folds)) == ["LP", "LP", "UZ", "UZ"]


def pair(gap: float) -> Callable[[Point], float]:
    return lambda point: (point["mu"] - 0.31) ** 2 - gap**2


# not where the test jumps
ASTRAY = DefiningSystem({}, lambda curve, z, extra: np.array([z[-1] - 0.31]))
BELOW = DefiningSystem(
    {}, lambda curve, z, extra: z[-1:] - 0.3 - 3e-10, domain={"mu": (0.5, math.inf)}
)
FOUND: dict[str, tuple[Event, dict[str, Any], list[float], float]] = {
    **{
        f"two zeros within a step, {gap} apart": (
            Event("DZ", pair(gap)), {"steps": LONG}, [0.31 - gap, 0.31 + gap], 1e-9
        )
        for gap in (1e-2, 1e-4, 1e-6)
    },
    "a zero and a pair of zeros within a step": (
        Event("TZ", lambda q: (q["mu"] - 0.5) * ((q["mu"] - 0.5) ** 2 - 0.05**2)),
        {"start": 0.2, "within": {"mu": (0.2, 0.8)}, "steps": LONG}, [0.45, 0.5, 0.55], 1e-12,
    ),
    "a triple zero is one": (Event("TZ", lambda q: (q["mu"] - 0.3) ** 3), {}, [0.3], 1e-4),
    "no value at the start": (
        Event("RT", lambda q: math.sqrt(q["mu"]) - 0.5), {"start": 0.1}, [0.25], 1e-14
    ),
    "a truth value": (Event("IN", lambda q: q["mu"] > 0.3), {}, [0.3], 1e-13),
    "that of numpy": (Event("IN", lambda q: np.bool_(q["mu"] > 0.3)), {}, [0.3], 1e-13),
    "an integer of numpy": (Event("IN", lambda q: np.int64(q["mu"] > 0.3)), {}, [0.3], 1e-13),
    "any two integers": (Event("IN", lambda q: 2 if q["mu"] > 0.3 else 5), {}, [0.3], 1e-13),
    "a locus that leads astray": (
        Event("IN", lambda q: int(q["mu"] > 0.3), locus=lambda point: ASTRAY), {}, [0.3], 1e-13
    ),
    "a locus that leads beside it, outside of its domain": (
        Event("EX", lambda q: q["mu"] - 0.3, locus=lambda point: BELOW), {}, [0.3], 1e-13
    ),
    "one of a test with a zero, on the same step": (
        Event("EX", lambda q: q["mu"] - 0.3, locus=lambda point: ASTRAY), {"steps": LONG}, [0.3],
        1e-13,
    ),
}  # fmt: skip


@pytest.mark.parametrize(("event", "how", "wanted", "close"), FOUND.values(), ids=FOUND)
def test_zeros_and_jumps_are_found_where_they_are(event, how, wanted, close) -> None:
    branch = on_line(event, **how)
    assert branch[0]["mu"] == how.get("within", UNIT)["mu"][0]
    assert places(branch) == pytest.approx(wanted, abs=close)


def test_a_zero_is_located_to_the_last_digits_without_a_locus() -> None:
    event = Event("EX", lambda point: math.exp(3 * point["mu"]) - 2)
    (point,) = zoo.events_of(on_line(event, steps=LONG))
    assert point["mu"] == pytest.approx(math.log(2) / 3, abs=2e-15)
    low, high = point.bracket
    assert low <= point.arclength <= high
    assert high - low < 1e-12


def test_a_step_that_ends_exactly_on_a_zero_counts_it_once() -> None:
    steps = Steps(first=0.25 * math.sqrt(5), largest=0.25 * math.sqrt(5))
    for value in (-0.5, -0.25, 0.25, 0.5):
        assert places(on_line(user("mu", value), steps=steps)) == [value]


# --- no zeros ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "test",
    [
        lambda q: 1 / (q["mu"] - 0.3),
        lambda q: math.tan(2 * q["mu"]) if q["mu"] > 0.1 else 1.0,
        lambda q: math.copysign(1.0, q["mu"] - 0.3),
        lambda q: 1e3 * (q["mu"] - 0.3) + math.copysign(1.0, q["mu"] - 0.3),
    ],
)
def test_a_pole_or_a_step_of_a_float_test_is_no_event_but_is_told(test) -> None:
    branch = on_line(Event("PO", test), start=-0.9)
    assert zoo.events_of(branch) == []
    assert branch.doubtful
    for point in branch.doubtful:
        assert not point.located
        assert "PO" in point.detail["reason"]
        assert "not located" in repr(point)


@pytest.mark.parametrize("start", [0.0, 1.0])
def test_a_zero_next_to_where_a_test_has_no_value_is_found(start: float) -> None:
    ends = Event("NA", lambda q: math.nan if q["mu"] > 0.97 or q["mu"] < -0.97 else q["mu"] - 0.9)
    assert places(on_line(ends, start=start, steps=LONG)) == pytest.approx([0.9])


@pytest.mark.parametrize("start", [0.0, 1.0])
def test_a_zero_beside_the_event_at_which_a_test_loses_its_value_is_found(start: float) -> None:
    """Halvings of the step, which look for the edge of its values, come to neither side of it."""
    lost = Event("NA", lambda q: q["mu"] - 0.746 if q["mu"] < 0.75 - 1e-9 else math.nan)
    branch = on_line(lost, user("mu", 0.75), start=start, steps=LONG)
    assert places(branch) == pytest.approx([0.746, 0.75])


@pytest.mark.parametrize("end", [0.55, 1.0])
def test_a_jump_that_means_nothing_hides_no_zero_beside_it(end: float) -> None:
    def jumps(q: Point) -> float:
        return (q["mu"] - 0.3) * (q["mu"] - 0.7) * math.copysign(1.0, q["mu"] - 0.5)

    branch = on_line(Event("PO", jumps, may_jump=True), within={"mu": (-1.0, end)}, steps=LONG)
    assert places(branch) == pytest.approx([value for value in (0.3, 0.7) if value < end])
    assert not branch.doubtful


def blank(wrap: Callable[[float], float]) -> Callable[[Point], float]:
    return lambda q: math.nan if abs(q["mu"] - 0.3) < 0.1 else wrap(q["mu"] - 0.3)


def isolated(sign: int) -> Problem:
    """x = 0 is the curve; (x^2 + (mu - 0.3)^2 + 1e-6) vanishes nowhere."""
    return zoo.scalar(
        lambda x, p: sign * x * (x**2 + (p["mu"] - 0.3) ** 2 + 1e-6), 0.0, {"mu": -0.9}
    )


CUBIC = zoo.scalar(lambda x, p: p["mu"] - x**3, -1.0, {"mu": -1.0})
NONE: dict[str, Callable[[], Branch]] = {
    "zero all along": lambda: zoo.trace_case(zoo.CUSP, events=[user("mu", 1.0)]),
    "a double pole": lambda: on_line(Event("PO", lambda q: 1 / (q["mu"] - 0.3) ** 2), start=-0.9),
    "a double zero that is missed": lambda: on_line(
        Event("AB", lambda q: (q["mu"] - 0.3) ** 2 + 1e-6), steps=LONG
    ),
    "no value where the sign changes": lambda: on_line(Event("NA", blank(float))),
    "no value where it jumps": lambda: on_line(Event("NA", blank(lambda off: int(off > 0)))),
    "no value at all": lambda: on_line(Event("NN", lambda point: math.nan)),
    "a cubic point is no fold": lambda: trace(CUBIC, "mu", within=UNIT, events=zoo.ALL),
    "a point beside the curve": lambda: trace(isolated(1), "mu", within=UNIT, events=zoo.STATIC),
    "the same, upside down": lambda: trace(isolated(-1), "mu", within=UNIT, events=zoo.STATIC),
}


@pytest.mark.parametrize("traced", NONE.values(), ids=NONE)
def test_nothing_is_found_where_nothing_is(traced: Callable[[], Branch]) -> None:
    assert zoo.events_of(traced()) == []


def test_where_an_arm_turns_at_a_pitchfork_there_is_a_branch_point_and_no_fold() -> None:
    branch = zoo.trace_case(zoo.ARMS, events=zoo.STATIC)
    assert [point.kind for point in zoo.events_of(branch)] == ["BP"]
    assert branch.doubtful == ()  # the branch point explains why it turns
    alone = zoo.trace_case(zoo.ARMS, events=[fold()])
    assert zoo.events_of(alone) == []
    assert [point.kind for point in alone.doubtful] == ["LP"]


@pytest.mark.slow
def test_a_step_that_would_end_on_a_branch_point_is_shortened() -> None:
    """The first three steps back from a doubled orbit end where it sets out from: MX and a false LP
    were there, 1e-6 short of it."""
    feeds = np.array([[1.23, 0.54], [0.31, 1.08]])
    rest = dict(zip("xy", np.linalg.solve(feeds, [1.0, 1.0]).tolist(), strict=True))
    ricker = cb.FixedPoint(lambda u, p: u * np.exp(p["r"] - feeds @ u), rest, {"r": 1.0})
    within = {"r": (0.2, 3.5)}
    (doubled,) = cb.switch(trace(ricker, "r", within=within).first("PD"), within=within)
    back = trace(doubled[3].problem, "r", within=within)
    assert [point.kind for point in back.special] == ["BP", "PD", "PD", "EP"]
    assert back.doubtful == ()


@pytest.mark.slow
def test_a_step_that_ends_on_a_branch_point_leaves_nothing_in_doubt() -> None:
    """From a point of an arm the same steps lead back to where it set out from."""
    within = {"r": (0.5, 20)}
    origin = zoo.LORENZ.problem.at(x=0.0, y=0.0, z=0.0, r=0.6)
    arms = cb.switch(trace(origin, "r", within=within, events=zoo.ALL).first("BP"), within=within)
    for point in arms[0][1:6]:
        branch = trace(point.problem, "r", within=within, events=zoo.ALL)
        assert [(p.kind, p["r"]) for p in zoo.events_of(branch)] == [("BP", pytest.approx(1.0))]
        assert branch.doubtful == ()


@pytest.mark.parametrize("largest", [0.01, 0.02, 0.05, 0.1, 0.5])
def test_a_branch_point_is_found_wherever_steps_end_beside_it(largest: float) -> None:
    """Ten steps of 0.01 end 1e-17 short of it, 23 short of the end of the window, where there is an
    event as well; one of 0.5 has all of it."""
    mine = zoo.scalar(lambda x, p: x * (p["mu"] - x**2), 0.0, {"mu": -0.1})
    ends = {"mu": (-0.1, 0.13)}
    events = [branch_point(), user("mu", -0.1), user("mu", 0.13)]
    steps = Steps(first=largest, largest=largest)
    branch = trace(mine, "mu", within=ends, events=events, steps=steps)
    found = [(point.label, point["mu"]) for point in branch.special]
    assert [label for label, _ in found] == ["UZ1", "BP1", "UZ2"]
    assert [mu for _, mu in found] == pytest.approx([-0.1, 0.0, 0.13], abs=1e-15)


@pytest.mark.parametrize("start", [0.6, 0.9, 1.0, 1.2])
def test_where_real_roots_become_complex_there_is_a_branch_point(start: float) -> None:
    """Two real roots of z^3 - p z + 1 meet at p = 3/4^(1/3), where both eigenvalues of the
    derivative in (Re z, Im z) pass zero: of four starts two had the place among `doubtful`."""

    def roots(x, p):
        z = x[0] + 1j * x[1]
        value = z**3 - p["p"] * z + 1
        return np.array([value.real, value.imag])

    real = cb.Problem(roots, {"x": start, "y": 0.0}, {"p": start**2 + 1 / start})
    branch = trace(real, "p", within={"p": (-3, 4)}, events=zoo.STATIC)
    assert [(p.kind, p["p"]) for p in zoo.events_of(branch)] == [
        ("BP", pytest.approx(3 / 4 ** (1 / 3), abs=1e-12))
    ]
    assert branch.doubtful == ()


def test_branch_point_knows_both_tangents() -> None:
    # x = mu and x = -2 mu cross at the origin
    cross = zoo.scalar(lambda x, p: (x - p["mu"]) * (x + 2 * p["mu"]) * (3 + x), 0.5, {"mu": 0.5})
    point = trace(cross, "mu", within=UNIT, events=zoo.STATIC).first("BP")
    slopes = sorted(tangent[0] / tangent[1] for tangent in point.detail["tangents"])
    assert slopes == pytest.approx([-2.0, 1.0], abs=1e-9)
    assert point.tangent[0] / point.tangent[1] == pytest.approx(1.0, abs=1e-9)


def test_a_branch_point_outside_a_bracket_is_not_the_zero_inside() -> None:
    """Where the test of the second of two fails, Newton's iteration led to the first once more."""
    mine = zoo.scalar(lambda x, p: x * (p["mu"] * (1 - p["mu"]) - x**2), 0.0, {"mu": -0.5})
    branch = trace(mine, "mu", within={"mu": (-0.5, 1.5)}, events=[])
    whole = StepInterpolant(branch[0], branch[-1], 1e-9)
    samples = StepSamples(whole, branch_point(), {0.0: 1.0, 1.0: 1.0})
    low, high, point = _at_crossing(samples, 0.3, 0.1, 0.5, 1.0)
    assert low < 0.25 < high
    assert point["mu"] == pytest.approx(0.0, abs=1e-12)
    with pytest.raises(Undefined, match="the next branch point is outside"):
        _at_crossing(samples, 0.3, 0.5, 0.9, 1.0)


# --- jumps ------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("steps", [Steps(), LONG])
def test_every_jump_of_a_count_is_found(steps: Steps) -> None:
    count = Event("IN", lambda point: math.floor(20 * point["mu"] + 0.5))
    branch = on_line(count, steps=steps)
    assert len(zoo.events_of(branch)) == 40
    assert np.allclose(places(branch), np.arange(-0.975, 1.0, 0.05), rtol=0, atol=1e-12)
    for point in zoo.events_of(branch):
        low, high = point.bracket
        assert low <= point.arclength <= high
        assert high - low < 1e-12


def test_a_count_that_changes_where_no_event_is_is_doubtful() -> None:
    count = Event("N", None, count=lambda point: int(point["mu"] > 0.3))
    (point,) = on_line(count).doubtful
    assert point["mu"] == pytest.approx(0.3, abs=1e-4)
    assert point.detail["reason"] == "a count changes from 0 to 1, and no event here explains it"
    assert on_line(count, user("mu", 0.3)).doubtful == ()


def test_a_jump_with_a_locus_is_as_sharp_as_the_locus() -> None:
    calls = 0

    def beyond(point) -> int:
        nonlocal calls
        calls += 1
        return int(math.exp(point["mu"]) > 1.5)

    def conditions(curve, z, extra):
        return np.array([math.exp(z[-1]) - 1.5])

    event = Event("IN", beyond, locus=lambda point: DefiningSystem({}, conditions))
    (point,) = zoo.events_of(on_line(event, steps=LONG))
    assert point["mu"] == pytest.approx(math.log(1.5), abs=1e-15)
    assert calls < 40


# --- both ends --------------------------------------------------------------------------------


def test_events_at_start_and_end_are_not_lost() -> None:
    branch = on_line(user("mu", 0.0), user("mu", -1.0), user("mu", 1.0), user("x", 0.0))
    assert places(branch) == [-1.0, 0.0, 0.0, 1.0]
    assert [point.kind for point in branch.special] == ["UZ"] * 4  # no EP where an event is


@pytest.mark.parametrize("off", [1e-6, 1e-9, 1e-12, 1e-14])
def test_events_next_to_start_and_end_are_found_once(off: float) -> None:
    for value in (off, -off, 1 - off, -1 + off):
        assert places(on_line(user("mu", value))) == pytest.approx([value], abs=1e-12)


def test_eigenvalues_of_a_conservative_flow_add_up_to_nothing_which_is_no_event() -> None:
    def flow(u: zoo.Array, p: Mapping[str, float]) -> zoo.Array:
        x, v, y, w = u
        return np.array([v, p["h"] - x - x**3 + 0.3 * y, w, -2 * y - y**2 + 0.3 * x])

    start = {"x": 0.1, "v": 0.0, "y": 0.0, "w": 0.0}
    branch = trace(Problem(flow, start, {"h": 0.1}), "h", within={"h": (-3, 3)}, events=[hopf()])
    assert [point.kind for point in branch.special] == ["EP", "EP"]
    assert branch.doubtful == ()


def test_where_frequencies_of_a_conservative_flow_meet_is_no_hopf_point() -> None:
    """A saddle in a rotating frame is stable while it turns fast: 4 g^2 = (sqrt(b) + sqrt(c))^2."""

    def flow(u: zoo.Array, p: Mapping[str, float]) -> zoo.Array:
        x, v, y, w = u
        return np.array([v, 2 * p["g"] * w + x, w, -2 * p["g"] * v + 1.2 * y])

    mine = Problem(flow, dict.fromkeys("xvyw", 0.0), {"g": 3.0})
    branch = trace(mine, "g", within={"g": (0.2, 3.0)}, events=[hopf()])
    assert [point.kind for point in branch.special] == ["EP", "EP"]
    (point,) = branch.doubtful
    assert point["g"] == pytest.approx((1 + math.sqrt(1.2)) / 2, abs=1e-4)
    assert not point.located


@pytest.mark.parametrize("stiff", [1.0, 1e5, 1e8])
@pytest.mark.parametrize("start", [-0.31, 0.0])
def test_a_hopf_point_beside_fast_variables_is_found(stiff: float, start: float) -> None:
    def flow(u: zoo.Array, p: Mapping[str, float]) -> zoo.Array:
        x, y, z = u
        return np.array([p["mu"] * x - y + z * x, x + p["mu"] * y, stiff * (x * x - z)])

    mine = Problem(flow, {"x": 0.0, "y": 0.0, "z": 0.0}, {"mu": start})
    branch = trace(mine, "mu", within={"mu": (-1, 1)}, events=[hopf()])
    assert branch.first("HB")["mu"] == pytest.approx(0, abs=1e-12)
    assert branch.doubtful == ()


@pytest.mark.slow
def test_a_double_zero_beside_fast_variables_is_found_on_both_of_its_curves() -> None:
    def flow(u: zoo.Array, p: Mapping[str, float]) -> zoo.Array:
        x, y, z = u
        return np.array([y, p["b1"] + p["b2"] * y + z * z - x * y, 1e7 * (x - z)])

    start, params = {"x": -1.1, "y": 0.0, "z": -1.1}, {"b1": -1.21, "b2": -1.0}
    mine = Problem(flow, start, params, events=[fold(), hopf()])
    branch = trace(mine, "b1", within={"x": (-2, 1)})
    for kind in ("LP", "HB"):
        curve = cb.boundary(branch.first(kind), ("b1", "b2"), within={"b2": (-1.5, 0.5)})
        there = curve.first("BT")
        assert (there["b1"], there["b2"]) == pytest.approx((0.0, 0.0), abs=1e-9)
        assert curve.doubtful == ()


# --- what an event does to its branch ---------------------------------------------------------


def test_a_terminal_event_ends_the_branch_at_its_point() -> None:
    branch = on_line(user("mu", 0.3, terminal=True), user("mu", 0.31), user("mu", 0.29))
    assert branch.stop is Stop.EVENT
    assert branch.began is Stop.BOUND
    assert branch[-1].kind == "UZ"
    assert places(branch) == pytest.approx([0.29, 0.3], abs=1e-15)


def test_beyond_a_positive_event_nothing_is_returned() -> None:
    wall = Event("GR", lambda point: 0.3 - point["mu"], ends="domain")
    branch = on_line(wall, steps=LONG)
    assert branch.stop is Stop.EVENT
    assert branch[-1]["mu"] == pytest.approx(0.3, abs=1e-15)
    with pytest.raises(BadInput, match=r"the start lies beyond GR: its test is -0.2"):
        on_line(wall, start=0.5)
    with pytest.raises(BadInput, match="inadmissible=True, with no GR among events"):
        on_line(wall, start=0.5, inadmissible=True)
    assert on_line(start=0.5, inadmissible=True).stop is Stop.BOUND


def test_a_curve_that_would_set_out_beyond_its_own_end_is_refused_as_that() -> None:
    """It advised `inadmissible=True`, which does not lift that end."""
    end = Event("ODD-X", lambda point: -1.0, ends="domain")
    own = DefiningSystem({}, lambda curve, z, extra: z[:1] - 0.3, events=(end,))
    odd = Event("ODD", lambda point: point["x"] - 0.3, locus=lambda point: own)
    point = zoo.trace_case(zoo.CUSP, events=[odd]).first("ODD")
    with pytest.raises(BadInput, match=r"no curve of ODD sets out here: .* beyond ODD-X") as told:
        cb.boundary(point, ("mu", "h"))
    assert "inadmissible" not in str(told.value)


def test_a_start_on_a_positive_event_goes_the_allowed_way() -> None:
    wall = Event("GR", lambda point: 0.25 - point["mu"], ends="domain")
    branch = on_line(wall, start=0.25)
    assert branch.stop is Stop.EVENT
    assert branch[-1].label == "GR1"
    assert branch[0]["mu"] == -1.0
    alone = on_line(wall, start=0.25, towards="up")
    assert len(alone) == 1
    assert alone.stop is Stop.EVENT


def test_an_event_that_is_given_twice_is_looked_for_once() -> None:
    """Beside those of the problem: each place had two labels."""
    cusp = replace(zoo.CUSP.problem, events=(fold(),))
    branch = trace(cusp, "h", within={"x": (-2, 2)}, events=[*cusp.events, fold()])
    assert [point.label for point in zoo.events_of(branch)] == ["LP1", "LP2"]


def test_events_may_come_from_the_problem_or_a_generator() -> None:
    own = replace(zoo.LINE.problem, events=(user("mu", 0.2), user("mu", -0.2)))
    assert places(trace(own, "mu", within=UNIT)) == pytest.approx([-0.2, 0.2])
    assert places(trace(own, "mu", within=UNIT, events=())) == []
    given = (user("mu", value) for value in (0.1, -0.1))
    assert places(trace(own, "mu", within=UNIT, events=given)) == pytest.approx([-0.1, 0.1])


def test_a_double_zero_eigenvalue_is_told_from_a_neutral_saddle() -> None:
    """Fold and Hopf point in one, at b1 = 0."""
    start = zoo.takens().at(x=-0.5, b1=-0.25, b2=0.0)
    branch = trace(start, "b1", within={"x": (-1.0, 1.0)}, events=zoo.ALL)
    assert branch.first("LP")["b1"] == pytest.approx(0.0, abs=1e-12)
    for point in (*branch.special, *branch.doubtful):
        assert "neutral" not in point.detail.get("reason", "")


# --- jumps by the thousand ------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(
    ("times", "counted", "most", "said"),
    [(1e6, False, 1e4, "more than"), (1e4, True, 1e3, "too often")],
)
def test_what_jumps_ten_thousand_times_within_a_step_does_not_hang(times, counted, most, said):
    calls = [0]

    def jumps(point):
        calls[0] += 1
        return int(np.floor(times * point["mu"]))

    event = cb.Event("UZ", jumps)
    if counted:
        event = cb.Event("UZ", lambda point: 2.0 + point["mu"], count=jumps)
    line = cb.Problem(lambda x, p: x - 1.0, {"x": 1.0}, {"mu": 0.0})
    steps = cb.Steps(first=0.05, most=2)
    branch = cb.trace(line, "mu", within={"mu": (0, 1)}, events=[event], steps=steps)
    assert calls[0] < most
    assert any(said in point.detail["reason"] for point in branch.doubtful)
