"""Names that may be given, what a point answers to them, and labels that no step size changes."""

from __future__ import annotations

import numpy as np
import pytest

import contbreather as cb
from contbreather.continuation import maps
from contbreather.continuation.point import CodimensionTwo
from contbreather.errors import BadInput


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


def takens(u, p):
    """The normal form of a double zero, with parameters named as its coefficients are."""
    x, y = u
    return np.array([y, p["a"] + p["b"] * y + x * x + 2 * x * y])


def test_a_coefficient_is_told_from_a_parameter_of_its_name() -> None:
    problem = cb.Problem(takens, {"x": 1.0, "y": 0.0}, {"a": -1.0, "b": 0.3})
    events = [cb.fold(), cb.hopf()]
    fold = cb.trace(problem, "a", within={"x": (-1, 2), "a": (-2, 1)}, events=events).first("LP")
    line = cb.boundary(fold, ("b", "a"), within={"b": (-1, 1)}, events=events)
    point = line.first("BT")
    assert (point["a"], point["b"]) == pytest.approx((0.0, 0.0), abs=1e-9)
    assert (point["a of BT"], point["b of BT"]) == pytest.approx((1.0, 2.0), abs=1e-7)
    assert point.detail["a"] == point["a of BT"]
    with pytest.raises(BadInput, match="no 'c of BT' at this point"):
        point["c of BT"]


def crossings(gap: float, kind: str) -> tuple[cb.Problem, dict[str, tuple[float, float]]]:
    """Two branch points, `gap` apart: on an axis, mixed, and on an arm where one equation all but
    touches zero."""

    def residual(u, p):
        one = u[0] * (p["mu"] - 0.3 - u[0] ** 2)
        if kind == "arm":
            return np.array([one, u[1] * (u[0] - 0.4) * (u[0] - 0.4 - gap) - u[1] ** 3])
        other = u[1] * (p["mu"] - 0.3 - gap - u[1] ** 2)
        return np.array([one + 0.4 * other, other - 0.7 * one])

    if kind == "arm":
        return cb.Problem(residual, {"u": np.sqrt(0.7), "v": 0.0}, {"mu": 1.0}), {"u": (0.01, 1.1)}
    return cb.Problem(residual, {"u": 0.0, "v": 0.0}, {"mu": 0.0}), {"mu": (-0.2, 1.3)}


@pytest.mark.parametrize("gap", [1e-2, 2e-4, 1e-5])
@pytest.mark.parametrize("kind", ["axis", "arm"])
def test_two_close_branch_points_are_there_with_any_steps(kind: str, gap: float) -> None:
    """Steps that end exactly at the first of them are among these, and some of length 0.3."""
    problem, within = crossings(gap, kind)
    name = "u" if kind == "arm" else "mu"
    first = 0.4 if kind == "arm" else 0.3
    for largest in (0.05, 0.1, 0.37):
        for size in (0.001, 0.01, 0.1):
            steps = cb.Steps(first=size, largest=largest)
            events = [cb.fold(), cb.branch_point()]
            branch = cb.trace(problem, "mu", within=within, events=events, steps=steps)
            assert [point.label for point in branch.special] == ["EP1", "BP1", "BP2", "EP2"]
            places = [branch.first(label)[name] for label in ("BP1", "BP2")]
            np.testing.assert_allclose(places, [first, first + gap], rtol=0, atol=1e-9)
            assert not branch.doubtful


def test_two_branch_points_that_cannot_be_told_apart_are_doubtful() -> None:
    problem, within = crossings(1e-9, "axis")
    for largest in (0.05, 0.1, 0.37):
        steps = cb.Steps(largest=largest)
        branch = cb.trace(problem, "mu", within=within, events=[cb.branch_point()], steps=steps)
        assert [point.kind for point in branch.special] == ["EP", "EP"]
        assert {point.kind for point in branch.doubtful} == {"BP"}


MULTIPLIERS = {"BP": "+1", "LP": "+1", "PD": "-1", "NS": "pair"}


@pytest.mark.parametrize("on", maps.MEETINGS)
def test_two_kinds_of_maps_that_meet_have_one_name_whichever_is_followed(on: str) -> None:
    """Both kinds, the one with the larger multiplier first; and what is looked for are theirs."""
    order = list(MULTIPLIERS)
    assert set(maps.MEETINGS[on]) == {"LP", "PD", "NS"} - {on, "LP" if on == "BP" else ""}
    for met, events in maps.MEETINGS[on].items():
        first, second = sorted((on, met), key=order.index)
        meeting = events[-1]
        assert meeting.kind == f"{first}{'-' if first == 'BP' else ''}{second}"
        wanted, *_ = meeting.examine.args  # type: ignore[union-attr]
        assert wanted == f"{MULTIPLIERS[first]} {MULTIPLIERS[second]}"
        assert isinstance(meeting, CodimensionTwo)
        assert meeting.base.kind == met
