"""Branches and points as values: columns, special points, joining, words."""

from __future__ import annotations

import copy
import dataclasses
import re
from dataclasses import replace

import numpy as np
import pytest

import contbreather as cb
from contbreather.continuation import Stop, iterate
from contbreather.errors import BadInput

from .zoo import ARMS, BRATU, BRUSSELATOR, CIRCLE, CUSP, LINE, knowing, printed, trace_case


@pytest.fixture(scope="module")
def branch() -> cb.Branch:
    problem = replace(
        CUSP.problem, record={"slope": lambda point: float(point.jacobian()[0, 0])}, label="cusp"
    )
    return trace_case(replace(CUSP, problem=problem), events=[cb.fold(), cb.user("x", 0.2)])


# --- branches ---------------------------------------------------------------------------------


def test_what_a_point_has_is_in_it(branch: cb.Branch) -> None:
    fold = branch.first("LP")
    assert all(name in fold for name in ("x", "mu", "slope", *fold.detail))
    assert "y" not in fold


def test_columns_are_parameters_records_arclength_and_unknowns(branch: cb.Branch) -> None:
    assert branch.names == ("mu", "h", "slope", "arclength", "residual", "x")
    for name in branch.names:
        assert branch[name].shape == (len(branch),)
    assert all(name in branch for name in branch.names)
    assert "y" not in branch
    assert branch[3] in branch
    assert branch[3] not in branch[:2]
    assert (branch["mu"] == 1.0).all()
    assert np.allclose(branch["slope"], 1 - 3 * branch["x"] ** 2, atol=1e-12)
    assert branch["arclength"][0] == 0.0
    with pytest.raises(
        BadInput, match=r"no column 'y'; this branch has \['mu', 'h', 'slope', 'arclength'"
    ):
        branch["y"]
    with pytest.raises(BadInput, match=r"no column 'LP1'; .*; the point is branch.first\('LP1'\)$"):
        branch["LP1"]


def test_points_are_taken_by_number_and_in_order(branch: cb.Branch) -> None:
    assert branch[17] is branch.points[17]
    assert branch[-1] is branch.points[-1]
    assert branch[2:4].points == branch.points[2:4]
    assert [point["x"] for point in branch] == branch["x"].tolist()


def test_special_points_by_kind_and_label(branch: cb.Branch) -> None:
    assert [p.label for p in branch.special] == ["EP1", "LP1", "UZ1", "LP2", "EP2"]
    assert branch.first("LP") is branch.first("LP1")
    assert branch.first("LP2")["x"] > 0
    with pytest.raises(BadInput, match=r"no 'NS' on this branch; it has \['EP1', 'LP1', 'UZ1'"):
        branch.first("NS")
    with pytest.raises(BadInput, match=r"'EP2'\]; it is looked for with events=\[cb.hopf\(\)\]"):
        branch.first("HB1")


def test_a_branch_says_what_it_is(branch: cb.Branch) -> None:
    text = repr(branch)
    assert text.startswith(f"<Branch cusp in h (mu = 1): {len(branch)} points; ")
    assert Stop.BOUND.value in text
    assert "'LP2'" in text
    table = printed(branch)
    assert "LP1" in table
    assert "0.384900179" in table
    assert table.count("\n") >= 5 + 3
    assert printed(branch.table()) == table


def shown_at(branch: cb.Branch, width: int) -> list[list[str]]:
    """The cells of the printed table."""
    rows = [line for line in printed(branch, width).splitlines() if line[:1] in "│┃"]
    return [[cell.strip() for cell in re.split("[│┃]", row)[1:-1]] for row in rows]


def test_narrow_tables_have_fewer_digits_and_columns_but_whole_numbers(branch: cb.Branch) -> None:
    """Every number is the point's own, rounded to the digits that it is shown with."""
    wide, middle, narrow = (shown_at(branch, width) for width in (200, 80, 55))
    assert wide[0] == ["label", "h", "x", "slope", "arclength", "residual"]
    assert middle[0] == narrow[0] == ["label", "h", "x", "slope"]
    assert wide[2][1] == middle[2][1] == f"{branch.first('LP1')['h']:.12g}"
    for row, point in zip(narrow[1:], branch.special, strict=True):
        for cell, name in zip(row[1:], ("h", "x", "slope"), strict=True):
            assert any(cell == f"{point[name]:.{digits}g}" for digits in range(4, 12))


def test_a_width_that_is_too_small_folds_numbers_and_hides_none(branch: cb.Branch) -> None:
    rows = shown_at(branch, 22)
    assert not any("\N{HORIZONTAL ELLIPSIS}" in cell for row in rows for cell in row)
    joined = "".join(row[1] for row in rows[1:] if row)
    assert f"{abs(branch.first('LP2')['h']):.4g}" in joined


def test_a_count_is_blank_where_rounding_decides_it() -> None:
    """At a fold a multiplier is on the circle: the table has no number, the column keeps it."""
    record = {"count": lambda point: int(point["x"] ** 2 < 1 / 3)}
    counted = replace(CUSP.problem, record=record)
    branch = cb.trace(
        counted, "h", within={"x": (-1.5, 1.5)}, events=[cb.fold(), cb.user("x", 0.1)]
    )
    column = [row[3] for row in shown_at(branch, 200)]
    assert column == ["count", "0", "\N{EN DASH}", "1", "\N{EN DASH}", "0"]
    assert set(branch["count"]) == {0, 1}


def test_a_column_has_no_count_where_rounding_decides_it() -> None:
    record = {"count": lambda p: int(p["x"] < 0), "size": lambda p: float(p["x"])}
    counted, level = replace(CUSP.problem, record=record), cb.user("x", 0.25)
    for events, blank in ([cb.fold(), level], ["LP1", "LP2"]), ([level], []):
        found = cb.trace(counted, "h", within={"x": (-2, 2)}, events=events).columns()
        assert [*found] == ["label", "mu", "h", "count", "size", "arclength", "residual", "x"]
        assert [*found["label"][np.isnan(found["count"])]] == blank
        assert not np.isnan(found["size"]).any()
        assert found["count"].dtype.kind == ("f" if blank else "i")


def test_a_branch_says_which_parameters_stay_what_they_are() -> None:
    fixed = cb.Problem(
        lambda x, p: x - p["m"] * p["k"] - p["h"], {"x": 0.25}, {"h": 0.25, "m": 0, "k": 2}
    )
    said = cb.trace(fixed, "m", within={"m": (0, 1)}, events=()).describe()
    assert said.startswith("branch in m (h = 0.25, k = 2): ")


def test_many_branches_are_asked_for_as_one_is() -> None:
    wall = cb.Event("GR", lambda point: 0.3 - point["mu"], ends="domain")
    starts = [replace(LINE.problem, events=(wall,)).at(x=2 * mu, mu=mu) for mu in (0.1, 0.2)]
    own = {"within": {"mu": (0, 1)}, "towards": "up", "steps": cb.Steps(largest=0.05)}
    own |= {"events": cb.user("mu", 0.25), "inadmissible": True}
    for start, branch in zip(starts, cb.trace_many(starts, "mu", executor=1, **own), strict=True):
        alone = cb.trace(start, "mu", **own)
        assert repr(branch) == repr(alone)
        assert np.array_equal(branch["mu"], alone["mu"])
    for wrong in (LINE.problem, "line", 3, np.array(1.0)):
        with pytest.raises(BadInput, match="takes several starts, a list of them"):
            cb.trace_many(wrong, "mu")


def test_both_ends_are_said_where_a_curve_may_go_on() -> None:
    whole = trace_case(LINE)
    for stop in (Stop.DOMAIN, Stop.NO_CONVERGENCE, Stop.MOST, Stop.INFINITY):
        one = replace(whole, stop=stop, began=stop, began_reason="f at t = 0 raised")
        assert f"; the other way: {stop.value}: f at t = 0 raised" in one.describe()
    response = cb.trace(cb.symmetric(0.5, 0.04, 0.8), "gamma", within={"gamma": (-1, 0.1)})
    assert "; the other way: the domain of gamma ends at 0;" in repr(response)
    assert "the other way" not in response[3:].describe()


def test_columns_are_asked_for_once_unless_they_raise() -> None:
    asked = []

    def height(point):
        asked.append(point)
        if len(asked) == 3:
            raise RuntimeError
        return float(point["x"])

    problem = replace(LINE.problem, record={"height": height})
    branch = cb.trace(problem, "mu", within={"mu": (0, 1)}, events=())
    with pytest.raises(RuntimeError):
        branch["height"]
    column, count = branch["height"], len(asked)
    expected = column.copy()
    column[:] = 7.0
    assert len(asked) == count == len(branch) + 3
    assert (branch["height"] == expected).all()
    assert (branch.columns()["height"] == expected).all()
    assert (branch[1:]["height"] == expected[1:]).all()
    assert len(asked) == count
    assert not branch.points.__getstate__()["_columns"]


def test_arrays_and_complex_records_do_not_spoil_the_table() -> None:
    problem = replace(
        BRUSSELATOR.problem,
        record={
            "values": lambda point: np.linalg.eigvals(point.jacobian()[:, :2]),
            "one": lambda point: complex(point["X"], 1.0),
        },
    )
    branch = cb.trace(problem, "B", within={"B": (0.1, 3.0)}, events=[cb.hopf()])
    assert branch["values"].shape == (len(branch), 2)
    assert branch["one"].dtype == complex
    assert "values" not in printed(branch)
    assert "1+1j" in printed(branch)
    assert "null" not in printed(trace_case(BRATU))


def test_frozen_in_frozen_out(branch: cb.Branch) -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        branch.stop = Stop.MOST
    with pytest.raises(dataclasses.FrozenInstanceError):
        branch[3].kind = "LP"
    for array in (branch[3].z, branch[3].x, branch[3].tangent):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 7.0
    branch["x"][0] = 7.0  # a column is a copy
    assert branch["x"][0] == -2.0
    matrix = branch[3].jacobian()
    matrix[0, 0] = 7.0
    assert branch[3].jacobian()[0, 0] != 7.0


# --- joining and turning ----------------------------------------------------------------------


def test_turning_a_branch_twice_gives_it_back(branch: cb.Branch) -> None:
    turned = branch.reversed()
    assert np.array_equal(turned["x"], branch["x"][::-1])
    assert [p.label for p in turned.special] == ["EP1", "LP1", "UZ1", "LP2", "EP2"]
    assert turned.first("LP1")["x"] == branch.first("LP2")["x"]
    assert np.array_equal(turned[3].tangent, -branch[len(branch) - 4].tangent)
    for point in turned.special[1:-1]:
        assert point.bracket[0] <= point.arclength <= point.bracket[1]
    again = turned.reversed()
    assert np.allclose(again["arclength"], branch["arclength"], rtol=0, atol=1e-12)
    assert (again.stop, again.began) == (branch.stop, branch.began)


def test_a_one_way_branch_turned_ends_where_it_set_out() -> None:
    up = trace_case(CUSP, towards="up")
    assert up.began is None
    turned = up.reversed()
    assert turned.stop is Stop.START
    assert turned.began is up.stop
    assert turned.reversed().began is None


def test_a_closed_branch_is_closed_either_way_but_no_piece_of_it_is() -> None:
    loop = cb.trace(CIRCLE.problem, "mu")
    turned = loop.reversed()
    assert loop.stop is turned.stop is turned[:].stop is Stop.CLOSED
    with pytest.raises(BadInput, match="closed: there is nothing beyond"):
        cb.extend(turned)
    assert [loop[5:].stop, loop[:5].stop, loop[5:].began] == [Stop.CUT] * 3


def test_joining_shifts_arclength_and_counts_labels_on() -> None:
    first = cb.trace(CUSP.problem, "h", within={"x": (-2.0, 0.0)}, events=[cb.fold()])
    second = cb.trace(first[-1], "h", within={"x": (-0.1, 2.0)}, events=[cb.fold()], towards="down")
    whole = first.join(second)
    assert len(whole) == len(first) + len(second) - 1
    assert [p.label for p in whole.special] == ["EP1", "LP1", "LP2", "EP2"]
    assert (np.diff(whole["arclength"]) > 0).all()
    assert whole.stop is second.stop
    assert whole.began is first.began
    with pytest.raises(BadInput, match="these do not meet"):
        first.join(first)


def test_an_event_at_the_seam_is_there_once_and_no_end_stays_inside() -> None:
    middle = cb.user("x", -0.9)
    for events in ([middle], [middle, cb.fold(), cb.user("h", CUSP.problem.params["h"])], []):
        whole = cb.trace(CUSP.problem, "h", within={"x": (-2, 2)}, events=events)
        assert sum(point.event is middle for point in whole) == (middle in events)
        assert [p.kind for p in whole.special].count("EP") == 2
        assert whole.special[0].kind == whole.special[-1].kind == "EP"


def test_candidates_that_failed_come_along() -> None:
    branch = trace_case(ARMS, events=[cb.fold()])
    assert branch.doubtful
    assert len(branch.reversed().doubtful) == len(branch.doubtful)
    (doubtful,) = branch.reversed().doubtful
    assert doubtful["mu"] == pytest.approx(0.0, abs=1e-9)


# --- points -----------------------------------------------------------------------------------


def test_a_point_gives_values_by_name(branch: cb.Branch) -> None:
    point = branch[5]
    assert point.values == {"x": point["x"], "mu": 1.0, "h": point["h"]}
    assert isinstance(point["x"], float)
    assert point.params == {"mu": 1.0, "h": point["h"]}
    assert point["slope"] == pytest.approx(1 - 3 * point["x"] ** 2)
    assert np.array_equal(point.x, [point["x"]])
    with pytest.raises(BadInput, match=r"no 'y' at this point; it has \['x', 'mu', 'h', 'slope'\]"):
        point["y"]


def test_a_point_shows_label_and_values(branch: cb.Branch) -> None:
    assert repr(branch.first("UZ")) == "Point(UZ1 (x = 0.2): x=0.2, mu=1, h=-0.192)"
    assert repr(branch[5]).startswith("Point(x=")
    assert repr(trace_case(BRATU)[0]).startswith("Point(EP1: lam=")


def test_a_point_says_what_it_is_to_its_user() -> None:
    with pytest.raises(BadInput, match="says no more of a point than its values"):
        _ = trace_case(LINE)[0].solution
    problem = knowing(LINE.problem, interpret=lambda point: f"x is {point['x']:.1f}")
    assert cb.trace(problem, "mu", within={"mu": (-1, 1)})[-1].solution == "x is 2.0"


# --- by hand ----------------------------------------------------------------------------------


def test_a_walk_yields_special_points_in_their_places_and_returns_its_end() -> None:
    ends = []

    def walk():
        events = [cb.fold(), cb.user("x", 0.5)]
        ends.append((yield from iterate(CIRCLE.problem, "mu", events=events)))

    points = list(walk())
    assert [end.stop for end in ends] == [Stop.CLOSED]
    assert [point.kind for point in points if point.kind] == ["UZ", "LP", "LP", "UZ"]
    assert (np.diff([point.arclength for point in points]) > 0).all()


@pytest.mark.parametrize("asked", ["call", "environment"])
def test_progress_is_lines_in_a_log_when_asked_for(capsys, monkeypatch, asked):
    from contbreather import progress

    monkeypatch.setattr(progress, "PATIENCE", 0.0)
    monkeypatch.setattr(progress, "SELDOM", 0.0)
    if asked == "environment":
        monkeypatch.setenv("CONTBREATHER_PROGRESS", "1")
    trace_case(CUSP, progress=True if asked == "call" else None)
    captured = capsys.readouterr()
    assert captured.out == ""
    lines = captured.err.splitlines()
    assert len({*lines}) == len(lines) > 2  # each once
    assert all(re.fullmatch(r"\d+ points, h = [-0-9.e]+", line) for line in lines[1:])


def test_a_point_answers_what_its_solution_answers() -> None:
    """And says of neither's names that they are missing; copies and pickles are no different."""

    class Height:
        def __init__(self, x: float) -> None:
            self.x_squared = x * x

        def above(self, floor: float) -> float:
            return self.x_squared - floor

    told = knowing(CUSP.problem, interpret=lambda point: Height(point["x"]))
    point = trace_case(replace(CUSP, problem=told))[3]
    assert point.above(floor=1.0) == point["x"] ** 2 - 1.0
    assert copy.deepcopy(point).x_squared == point["x"] ** 2
    with pytest.raises(AttributeError, match="neither a point nor its Height has 'below'"):
        point.below()
    mute = trace_case(CUSP)[3]
    assert not hasattr(mute, "above")
    with pytest.raises(AttributeError, match="no 'above', and this problem says no more of a poi"):
        mute.above()


def test_a_level_that_was_met_is_said() -> None:
    problem = cb.Problem(
        lambda x, p: x - p["mu"],
        {"x": 0.0},
        {"mu": 0.0},
        record={"height": lambda point: 3 * point["x"]},
    )
    events = [cb.user("mu", 0.5), cb.user("mu", 0.25), cb.user("height", 0.9)]
    branch = cb.trace(problem, "mu", within={"mu": (0, 1)}, events=events)
    levels = [point for point in branch.special if point.kind == "UZ"]
    assert [point.label for point in levels] == ["UZ1", "UZ2", "UZ3"]
    assert [point["level"] for point in levels] == ["mu = 0.25", "height = 0.9", "mu = 0.5"]
    assert [point["x"] for point in levels] == pytest.approx([0.25, 0.3, 0.5], abs=1e-12)
    assert "UZ2 (height = 0.9)" in repr(branch.first("UZ2"))
    assert list(branch.table().columns[0].cells)[1:4] == [point.title for point in levels]
