"""Where nothing is looked for, what is one place and what is two, and how diagrams say it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from contbreather.continuation import Event, Point, Steps, Stop, fold, maps, trace, user
from contbreather.continuation.diagram import Birth, Diagram, Failure, Meeting, Place
from contbreather.continuation.location import _at_one_place, _one_a_place, calm

from .zoo import BRUSSELATOR, CUSP, LINE, trace_case


def test_a_test_is_calm_where_its_parabola_stays_far_from_zero() -> None:
    """By numpy's parabola through the last three values: middle and ends of the step."""
    ends = tuple(trace(LINE.problem, "mu", within={"mu": (-1, 1)}, events=())[2:4])
    event, rng, seen = Event("X", float), np.random.default_rng(3), set()
    for _ in range(600):
        pace = rng.uniform(0.3, 2.0)
        values = rng.choice([-1.0, 1.0]) * (1.0 + rng.normal(scale=0.5, size=3))
        curve = np.polynomial.Polynomial.fit([-pace, 0.0, 1.0], values, 2)
        middle = curve(0.5) * np.sign(values[1])
        low, high = sorted(abs(values[1:]))
        wanted = bool(
            (values > 0).all() | (values < 0).all()
            and middle > 0.6 * high and low > 0.35 * max(high, middle)
        )  # fmt: skip
        assert calm([event], pace, *values[:, None], ends) == ({0} if wanted else set())
        seen.add(wanted)
    assert seen == {True, False}
    tally = Event("N", None, count=lambda point: 0)
    counted = [Event("X", float, count=lambda p, by=by: by * (p is ends[1])) for by in (0, 1, 2)]
    nan = math.nan
    for one, start, end, quiet in (
        (tally, 3, 3, True), (tally, 3, 4, False), (event, 3, 3, False), (event, nan, nan, True),
        (event, nan, 1.0, False), (event, 1.0, 0.0, False), (event, 0.0, 1.0, False),
        (counted[0], 1.0, 1.0, True), (counted[1], 1.0, 1.0, True), (counted[2], 1.0, 1.0, False),
        (counted[2], nan, nan, False), (counted[1], nan, nan, True),
    ):  # fmt: skip
        assert calm([one], 1.0, [start], [start], [end], ends) == ({0} if quiet else set())


def at(where: float, event: Event, **given: object) -> Point:
    own = {"kind": event.kind, "event": event, "arclength": where, "located": False, **given}
    return Point(trace_case(LINE).curve, np.array([0.0, 0.0]) + where, **own)


def test_what_is_in_doubt_twice_at_one_place_is_two_of_them() -> None:
    one, other = fold(), replace(fold(), kind="HB")
    kept = _at_one_place(
        [at(0.0, one), at(0.9e-6, one), at(0.95e-6, other), at(2.5e-6, one), at(2.6e-6, other)]
    )
    assert [(p.kind, p.arclength) for p in kept] == [
        ("LP", 0.0), ("HB", 0.95e-6), ("LP", 2.5e-6), ("HB", 2.6e-6)
    ]  # fmt: skip
    reasons = [p.detail.get("reason", "") for p in kept]
    assert reasons == ["two LP at once, or too close to be separated: not simple", "", "", ""]


def test_on_a_boundary_the_strongest_of_one_place_stands_for_all() -> None:
    plain = Event("A", float, examine=lambda point: "")
    cross, last = replace(plain, kind="B"), replace(plain, kind="C", ends="branch")
    level = user("x", 0.0)
    points = [
        at(0.0, plain, located=True), at(0.5e-6, cross, located=True, detail={"tangents": ()}),
        at(0.6e-6, level, located=True), at(0.7e-6, last, located=True), at(0.65e-6, last),
        at(3e-6, plain, located=True), at(3.1e-6, cross),
    ]  # fmt: skip
    kept = list(_one_a_place(points))
    assert [(p.kind, p.arclength, p.detail.get("also")) for p in kept] == [
        ("C", 0.7e-6, "A, B"), ("UZ", 0.6e-6, None), ("A", 3e-6, None)
    ]  # fmt: skip


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6, 1e-9])
def test_events_are_located_as_well_whatever_the_walk_tolerates(tolerance: float) -> None:
    steps = Steps(tolerance=tolerance)
    line = trace(
        CUSP.problem, "h", within={"x": (-2, 2)}, steps=steps, events=[fold(), user("x", 0.2)]
    )
    exact = 2 / math.sqrt(27)
    assert [p["h"] for p in line.special[1:-1]] == pytest.approx([exact, -0.192, -exact], abs=1e-13)
    point = trace_case(BRUSSELATOR, steps=steps).first("HB")
    assert point["B"] == pytest.approx(2.0, abs=1e-13)


# --- diagrams -----------------------------------------------------------------------------------


def test_a_diagram_says_what_there_is_and_what_was_left_undone() -> None:
    line = trace(LINE.problem, "mu", within={"mu": (-1, 1)}, events=())
    one, other = (Place(0, point) for point in line.special)
    row = (one, other)
    base = Diagram((line,), (Birth(0),), (row,))
    both = replace(
        base, branches=(line, line), births=(Birth(0), Birth(1, one, 0)), places=(row, (one,))
    )
    lost, met = Failure(one, "why"), Meeting(other, 1)
    for tree, words in (
        (base, "1 branch, 2 special points"),
        (replace(base, places=((one,),)), "1 branch, 1 special point"),
        (both, "2 branches, 2 special points"),
        (replace(base, left=(one,)), "1 branch, 2 special points; 1 point not switched at"),
        (replace(base, left=row), "1 branch, 2 special points; 2 points not switched at"),
        (replace(base, failed=(lost,)), "1 branch, 2 special points; 1 arm not followed"),
        (replace(base, failed=(lost, lost), interrupted=True), "1 branch, 2 special points; "
         f"2 arms not followed; {Stop.INTERRUPTED.value}"),
    ):  # fmt: skip
        assert (tree.describe(), repr(tree)) == (words, f"<Diagram {words}>")
    assert (str(lost), str(met)) == ("branch 0: EP1: why", "branch 0: EP2 leads to branch 1")
    graph = replace(both, meetings=(met,)).graph
    assert graph.nodes[1] == {"kind": "branch", "branch": line, "depth": 1}
    assert graph.nodes["branch 0: EP1"] == {"kind": "EP", "point": one.point}
    edges = {(*edge[:2], edge[2]) for edge in graph.edges(data="relation")}
    assert edges == {
        (0, "branch 0: EP1", "on"), (0, "branch 0: EP2", "on"), (1, "branch 0: EP1", "on"),
        ("branch 0: EP1", 1, "born"), (0, 1, "image"), ("branch 0: EP2", 1, "known"),
    }  # fmt: skip
    columns = both.columns()
    assert columns["branch"].tolist() == [0] * len(line) + [1] * len(line)


# --- maps ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("multipliers", "wanted", "good"),
    [
        ([1, -1, 0.3], "+1 -1", True), ([1 + 0.9e-4, -1, 0.3], "+1 -1", True),
        ([1 + 1.1e-4, -1, 0.3], "+1 -1", False), ([1, -1 + 0.9e-4, 0.3], "+1 -1", True),
        ([1, -1 + 1.1e-4, 0.3], "+1 -1", False), ([1, 1, -1], "+1 -1", False),
        ([1, 1j, -1j], "+1 pair", True), ([-1, 1j, -1j], "-1 pair", True),
        ([-1, 1j, -1j], "+1 pair", False), ([0.5, 1j, -1j], "pair", True),
        ([0.5, np.exp(1.1e-3j), np.exp(-1.1e-3j)], "pair", True),
        ([0.5, np.exp(0.9e-3j), np.exp(-0.9e-3j)], "pair", False),
        ([0.5, -np.exp(1.1e-3j), -np.exp(-1.1e-3j)], "pair", True),
        ([0.5, -np.exp(0.9e-3j), -np.exp(-0.9e-3j)], "pair", False),
    ],
)  # fmt: skip
def test_the_multipliers_on_the_circle_say_what_meets(
    monkeypatch, multipliers, wanted, good
) -> None:
    monkeypatch.setattr(maps, "units", lambda point: np.diag(multipliers))
    point = trace_case(LINE)[0]
    for crosses in (False, True):
        monkeypatch.setattr(maps, "branches_cross", lambda point, crosses=crosses: crosses)
        found = maps._on_circle(wanted, False, point)
        assert (found == "") is good
        assert good or f"where {wanted.replace(' ', ' and ')} are expected" in found
        as_fold = maps._on_circle(wanted, True, point)
        assert as_fold == ("a branch point, not a fold" if crosses else found)
