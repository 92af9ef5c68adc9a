"""What branches and points say of themselves, case by case: every table here is the whole of it."""

from __future__ import annotations

import re
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
from contbreather.continuation.point import Meeting
from contbreather.continuation.trace import _with_ends
from contbreather.errors import BadInput

from .zoo import CUSP, LINE, PITCHFORK, trace_case


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


# --- walks --------------------------------------------------------------------------------------


def test_each_step_has_a_line_in_the_log_and_each_event_one(caplog) -> None:
    caplog.set_level("DEBUG", "contbreather")
    bent = Problem(lambda x, p: p["mu"] - 40 * x**2, {"x": 1.0}, {"mu": 40.0})
    branch = trace(bent, "mu", within={"x": (-1, 2)}, towards="down", events=[fold()])
    said = [record.getMessage() for record in caplog.records]
    taken = [one for one in said if re.fullmatch(
        r"step of \S+ to mu = \S+: [1-8] Newton iterations, residual \S+", one)]  # fmt: skip
    refused = [
        one for one in said if re.fullmatch(r"step of \S+ refused: the curve turns too .*", one)
    ]
    assert len(taken) == len(branch) - 2  # but for the start and the fold
    assert len(refused) > 1
    assert [one for one in said if one.startswith("found")] == [
        f"found LP: {replace(branch.first('LP'), label='')!r}"
    ]


@pytest.mark.parametrize(("stops", "kinds"), [
    (("BOUND", "BOUND"), "EP EP"), (("RIM", "BOUND"), "MX EP"), (("BOUND", "RIM"), "EP MX"),
    ((None, "NO_CONVERGENCE"), "EP MX"), (("NO_CONVERGENCE", "CUT"), "MX EP"),
])  # fmt: skip
def test_an_end_where_the_numerics_gave_up_is_another_than_that_of_a_curve(stops, kinds) -> None:
    line = trace(LINE.problem, "mu", within={"mu": (-1, 1)}, events=())
    bare = [replace(point, kind="", label="") for point in line]
    began, stop = (name and Stop[name] for name in stops)
    both = _with_ends(Branch(bare, stop, began))
    assert [both[i].kind for i in (0, -1)] == kinds.split()
    alone = _with_ends(Branch(bare[:1], stop, began))
    assert alone[0].kind == ("MX" if "MX" in kinds else "EP")
    kept = _with_ends(Branch([replace(one, kind="LP") for one in bare], stop, began))
    assert {point.kind for point in kept} == {"LP"}


def test_names_that_are_nobody_s_are_not_asked_of_the_solution() -> None:
    asked = []
    told = replace(LINE.problem, interpret=lambda point: asked.append(point) or "text")
    point = trace(told, "mu", within={"mu": (-1, 1)}, events=())[3]
    with pytest.raises(AttributeError, match="'_own' of this point has no value"):
        point._own  # noqa: B018
    assert not asked
    assert point.upper() == "TEXT"
    assert len(asked) == 1
