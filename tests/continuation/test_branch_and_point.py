"""What branches and points say of themselves, case by case: every table here is the whole of it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from contbreather.continuation import (
    Branch,
    Event,
    Point,
    Problem,
    Steps,
    Stop,
    branch_point,
    fold,
    many,
    trace,
    user,
)
from contbreather.continuation.branch import labelled
from contbreather.continuation.point import Level, Meeting
from contbreather.errors import BadInput

from .zoo import ARMS, CUSP, LINE, PITCHFORK, trace_case

STOPS = {
    "BOUND": ("reached the edge of the window", False),
    "EVENT": ("ended at a terminal event", False),
    "CLOSED": ("closed: the curve came back to its start", False),
    "MOST": ("took as many steps as allowed; raise Steps.most to go on", False),
    "NO_CONVERGENCE": ("Newton's iteration failed down to the smallest step", True),
    "RIM": ("reached the rim of the domain of the equations", True),
    "INTERRUPTED": ("interrupted; the points up to here are kept", False),
    "START": ("where the walk set out", False),
    "CUT": ("a piece of a longer branch was taken", False),
}


def test_every_reason_to_stop_has_its_sentence() -> None:
    assert {one.name: (one.value, one.failed) for one in Stop} == STOPS


@pytest.fixture(scope="module")
def branch() -> Branch:
    found = trace_case(ARMS, events=[fold(), branch_point()])
    assert found.doubtful
    return replace(found, reason="this end", began_reason="that end", began=Stop.RIM)


def test_a_piece_keeps_the_ends_that_are_its_own_and_what_lies_on_it(branch: Branch) -> None:
    n, where = len(branch), branch.doubtful[0].arclength
    at = int(np.searchsorted(branch["arclength"], where))
    for low, high in (
        (0, n),
        (1, n),
        (0, n - 1),
        (2, n - 3),
        (at - 1, at + 1),
        (at + 1, n),
        (3, 4),
    ):
        piece = branch[low:high]
        assert piece["arclength"].tolist() == branch["arclength"][low:high].tolist()
        first, last = low == 0, high == n
        assert (piece.began, piece.began_reason) == (
            (Stop.RIM, "that end") if first else (Stop.CUT, "")
        )
        assert (piece.stop, piece.reason) == ((branch.stop, "this end") if last else (Stop.CUT, ""))
        inside = branch[low].arclength <= where <= branch[high - 1].arclength
        assert piece.doubtful == (branch.doubtful if inside else ())
    assert len(branch[::2]) == (n + 1) // 2
    assert branch[: n : n - 1].stop is branch.stop
    for empty in (slice(3, 3), slice(5, 2), slice(None, None, -1)):
        with pytest.raises(BadInput, match="at least one point, and goes forwards"):
            branch[empty]


def test_brackets_turn_and_move_with_their_points(branch: Branch) -> None:
    length = branch[-1].arclength
    turned = branch.reversed()
    for own, other in zip(branch.special, turned.special[::-1], strict=True):
        if own.bracket:
            low, high = own.bracket
            assert other.bracket == (length - high, length - low)
            assert np.array_equal(other.tangent, -own.tangent)
    assert (turned.stop, turned.began) == (Stop.RIM, branch.stop)
    assert (turned.reason, turned.began_reason) == ("that end", "this end")
    longer = trace(LINE.problem, "mu", within={"mu": (-1, 1)}, events=[user("x", 0.25)])
    half = longer[: len(longer) // 2 + 1], longer[len(longer) // 2 :]
    whole = half[0].join(half[1])
    assert np.allclose(whole["arclength"], longer["arclength"])
    for point in whole.special:
        if point.bracket:
            assert point.bracket[0] <= point.arclength <= point.bracket[1]


@pytest.mark.parametrize(("gap", "meets"), [(0.0, True), (0.9e-8, True), (1.2e-8, False)])
def test_branches_join_where_they_meet_to_eight_digits(gap: float, meets: bool) -> None:
    one = trace(LINE.problem, "mu", within={"mu": (-1, 0)}, towards="both")
    start = one[-1].z
    other = trace(
        LINE.problem.at(x=start[0], mu=start[-1]), "mu", within={"mu": (-1, 1)}, towards="up"
    )
    aside = replace(other, points=[replace(p, z=p.z + gap) for p in other])
    if meets:
        assert len(one.join(aside)) == len(one) + len(other) - 1
        return
    with pytest.raises(BadInput, match="these do not meet"):
        one.join(aside)


def test_the_second_of_a_kind_that_ends_in_a_digit_has_a_dot() -> None:
    line = trace(LINE.problem, "mu", within={"mu": (-1, 1)}, events=())
    kinds = ["R1", "PF", "", "R1", "PF", "UZ", "BP-PD"]
    points = labelled([replace(p, kind=kind) for p, kind in zip(line, kinds, strict=False)])
    assert [p.label for p in points] == ["R1.1", "PF1", "", "R1.2", "PF2", "UZ1", "BP-PD1"]


def test_how_far_a_start_was_moved_is_told_from_a_thousandth_on() -> None:
    for off in (0.9e-3, 1.2e-3):
        start = Problem(lambda x, p: x - p["mu"], {"x": off}, {"mu": 0.0}, scales={"x": 1.0})
        moved = trace(start, "mu", within={"mu": (-1, 1)}, events=()).moved
        assert moved == pytest.approx(off if off > 1e-3 else 0.0, rel=0.3)


def test_no_count_stands_where_rounding_decides_it() -> None:
    record = {"count": lambda p: int(p["x"] < 0), "size": lambda p: float(p["x"])}
    with_counts = replace(CUSP.problem, record=record)
    events = [fold(), user("x", 0.25)]
    found = trace(with_counts, "h", within={"x": (-2, 2)}, events=events).columns()
    blank = np.isnan(found["count"])
    assert [*found["label"][blank]] == ["LP1", "LP2"]
    assert not np.isnan(found["size"]).any()
    assert [*found] == ["label", "x", "mu", "h", "count", "size", "arclength", "residual"]
    only = trace(with_counts, "h", within={"x": (-2, 2)}, events=events[1:]).columns()
    assert only["count"].dtype.kind == "i"


# --- points -------------------------------------------------------------------------------------


def test_a_point_is_plain_unless_anything_more_is_known_of_it() -> None:
    point = next(p for p in trace(LINE.problem, "mu", within={"mu": (-1, 1)}, events=()) if p.plain)
    event = fold()
    for more in (
        {"kind": "LP"}, {"label": "LP1"}, {"detail": {"x": 1}}, {"event": event},
        {"parent": point}, {"bracket": (0.0, 1.0)}, {"located": False}, {"tangent": None},
    ):  # fmt: skip
        assert not replace(point, **more).plain, more


def test_rounding_decides_counts_where_something_bifurcates() -> None:
    point = Point(trace_case(LINE).curve, np.zeros(2))
    wall, level = Event("GR", float, ends="domain"), user("x", 0.5)
    tally = Event("N", None, count=lambda point: 0)
    terminal = replace(fold(), ends="branch")
    met = [Meeting("M", float, base=base) for base in (fold(), level)]
    for event, verge in (
        (fold(), True), (terminal, True), (wall, False), (level, False), (tally, False),
        (met[0], True), (met[1], False),
    ):  # fmt: skip
        assert event.bifurcates is verge
        here = replace(point, event=event, kind=event.kind)
        assert here.on_verge is verge
        assert replace(point, parent=here, kind="EP").on_verge is verge
        assert event.walls is (event is wall)
    for kind, verge in (("", False), ("EP", False), ("MX", False), ("LP", True)):
        assert replace(point, kind=kind).on_verge is verge  # loaded without equations
    assert [one.crosses for one in (fold(), branch_point(), level)] == [False, True, False]
    assert [repr(one) for one in (fold(), terminal, wall)] == [
        "<Event LP>",
        "<Event LP, terminal>",
        "<Event GR, terminal>",
    ]


def test_names_at_a_point_are_looked_up_in_order() -> None:
    record = {"x": lambda p: -1.0, "mu": lambda p: -2.0, "h": lambda p: -3.0, "c": lambda p: 4.0}
    problem = replace(LINE.problem, record={"c": record["c"], "d": lambda p: 5.0})
    point = replace(
        trace(problem, "mu", within={"mu": (-1, 1)}, events=())[3],
        kind="BT",
        detail={"x": 9.0, "mu": 9.0, "c": 7.0},
    )
    assert (point["x"], point["mu"]) == (point.z[0], point.z[1])
    assert (point["c"], point["d"]) == (7.0, 5.0)
    assert [point[f"{name} of BT"] for name in ("x", "mu", "c")] == [9.0, 9.0, 7.0]
    for wrong in ("d of BT", "x of LP", "e"):
        with pytest.raises(BadInput, match=f"no '{wrong}' at this point; it has"):
            point[wrong]


def test_the_norm_of_an_array_is_known_at_a_point() -> None:
    pair = Problem(lambda u, p: u - p["mu"], {"u": [3.0, 4.0]}, {"mu": 1.0})
    point = Point(
        trace(pair.at(u=[1.0, 1.0]), "mu", within={"mu": (0, 2)}).curve, np.array([3.0, 4.0, 1.0])
    )
    assert point["norm(u)"] == 5.0
    assert point["u"].tolist() == [3.0, 4.0]


def test_a_point_in_doubt_says_why() -> None:
    point = Point(trace_case(LINE).curve, np.array([2.0, 1.0]), kind="LP", located=False)
    shown = ", ".join(f"{name}={point[name]:.10g}" for name in point.values)
    assert repr(point) == f"Point(LP?: {shown}; not located)"
    why = replace(point, label="LP1", detail={"reason": "so"})
    assert repr(why) == f"Point(LP1?: {shown}; not located: so)"


def test_levels_say_what_they_are_and_where_their_curve_is() -> None:
    level = Level("mu", 1 / 3)
    assert str(level) == "mu = 0.333333333333"
    point = Point(trace_case(LINE).curve, np.array([2.0, 1.0]))
    assert level(point) == 1.0 - 1 / 3
    assert level.conditions(point.curve, point.z, np.empty(0)).tolist() == [1.0 - 1 / 3]
    for value in (-1e300, 1e300):
        assert user("mu", value).test.value == value
        with pytest.raises(BadInput):
            user("mu", value * 1.1)
    event = user("x", 0.5, terminal=True)
    assert event.ends == "branch"
    assert (event.recipe.kind, dict(event.recipe.of)) == (
        "UZ",
        {"name": "x", "value": 0.5, "terminal": True},
    )


# --- many ---------------------------------------------------------------------------------------


def test_many_branches_are_asked_for_as_one_is(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[Any] = []

    def each(walk: Any, problems: Any, **given: Any) -> Any:
        seen.extend([walk.func, walk.keywords, problems, given])
        return iter(())

    monkeypatch.setattr(many, "each", each)
    level, starts = user("x", 0.5), [LINE.problem, PITCHFORK.problem]
    own = {
        "within": {"mu": (0, 1)},
        "towards": "up",
        "steps": Steps(largest=0.5),
        "inadmissible": True,
    }
    many.trace_many(starts, "mu", events=level, executor=3, progress=True, **own)
    walked = {**own, "free": "mu", "events": (level,), "progress": False}
    shown = {"executor": 3, "progress": True, "unit": "branches"}
    assert seen == [trace, walked, starts, shown]
    for wrong in (LINE.problem, "line", 3):
        with pytest.raises(BadInput, match="takes several starts, a list of them"):
            many.trace_many(wrong, "mu")
