"""What is known of a test along a step, the sheets that tables are made of, and sizes of steps."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import contbreather as cb
from contbreather.continuation.step_interpolant import ASIDE, StepSamples

EVENT = cb.user("mu", 0.0)


def samples(values: dict[float, Any], **more: Any) -> StepSamples:
    return StepSamples(None, EVENT, values, **more)


# --- the trail of a test --------------------------------------------------------------------------


def test_a_zero_lies_where_the_sign_changes_or_on_the_right_end_of_a_piece() -> None:
    signs = samples({0.0: 1.0, 0.25: -1.0, 0.5: -2.0, 0.75: 0.0, 1.0: 3.0})
    assert signs.changes() == [(0.0, 0.25), (0.5, 0.75)]
    assert signs.changes_sign(0.25, 0.0)
    assert not signs.changes_sign(0.75, 1.0)  # that zero belongs to the piece before
    assert samples({0.0: 1.0, 0.5: math.nan, 1.0: -1.0}).changes() == [(0.0, 1.0)]


def test_what_counts_changes_by_jumps_and_all_of_it_must_count() -> None:
    assert samples({0.0: 0, 0.5: 2, 1.0: 2}).changes() == [(0.0, 0.5)]
    assert samples({0.0: 0, 0.5: math.nan, 1.0: 1}).jumps
    assert not samples({0.0: 0, 0.5: 1.0}).jumps
    assert samples({0.0: 2.0, 1.0: 1.0}).changes() == []


def test_brackets_that_were_dealt_with_are_left_alone() -> None:
    known = {0.0: 1.0, 0.25: -1.0, 0.75: -1.0, 1.0: 1.0}
    assert samples(known, done=[(0.0, 0.25)]).changes() == [(0.75, 1.0)]
    assert samples(known, done=[(0.0, 0.3)]).changes() == [(0.75, 1.0)]
    assert samples(known, done=[(0.0, 0.2)]).changes() == [(0.0, 0.25), (0.75, 1.0)]
    assert samples(known, done=[(0.1, 0.25)]).changes() == [(0.0, 0.25), (0.75, 1.0)]


def test_an_event_is_remembered_with_the_sign_on_either_side() -> None:
    own = samples({0.0: 1.0, 1.0: -2.0})
    own.remember_event(0.4, 0.0, 1.0)
    assert own.values == {0.0: 1.0, 0.4 - ASIDE: 1.0, 0.4 + ASIDE: -2.0, 1.0: -2.0}
    assert own.done == [(0.4 - ASIDE, 0.4 + ASIDE)]
    assert own.zeros == [0.4]
    assert own.changes() == []
    assert {0.0, 1.0, 0.4 - ASIDE, 0.4 + ASIDE} == own.sure
    edge = samples({0.0: 1.0, 1.0: -2.0})
    edge.remember_event(0.0, 0.0, 1.0)
    assert edge.done == [(0.0, ASIDE)]


def test_a_jump_is_looked_at_on_either_side_unless_that_is_known() -> None:
    own = samples({0.0: 0, 1.0: 1})
    looked: list[float] = []

    def look(u: float) -> int:
        looked.append(u)
        return int(u > 0.5)

    own.look = look
    own.settle_jump(0.0, 0.6)
    assert looked == [0.6]
    assert own.values[0.6] == 1
    assert own.done == [(0.0, 0.6)]


def test_zeros_that_were_found_are_divided_out() -> None:
    own = samples({0.0: 6.0, 1.0: 2.0}, zeros=[0.25, 0.5])
    assert own.deflated(1.0) == pytest.approx(2.0 / (0.75 * 0.5))
    assert own.deflated(0.0) == pytest.approx(6.0 / (0.25 * 0.5))
    assert own.deflated(0.75, 3.0) == pytest.approx(3.0 / (0.5 * 0.25))
    assert math.isnan(own.deflated(0.5, 0.0))
    assert samples({0.5: 3.0}).deflated(0.5) == 3.0


def test_pieces_with_two_zeros_are_looked_at_once() -> None:
    own = samples({0.0: 1.0, 1.0: 1.0})
    own.beside(0.5, 0.02, 0.99)
    wanted = np.array([(0.4, 0.6), (0.0, 0.12), (0.89, 1.0)])
    assert np.array(own.close) == pytest.approx(wanted)
    own.done = [(0.55, 0.7)]
    assert np.array(list(own.brackets())) == pytest.approx(wanted[1:])


def test_a_value_is_learnt_once_and_not_within_a_bracket() -> None:
    own = samples({0.0: 1.0}, done=[(0.4, 0.6)])
    own.learn(0.5, 7.0)
    own.learn(0.0, 7.0)
    own.learn(0.7, 7.0)
    assert own.values == {0.0: 1.0, 0.7: 7.0}


def test_a_test_counts_measures_or_has_no_value() -> None:
    def given(value: Any) -> Any:
        return cb.Event("X", lambda point: value).value_or_nan(None)

    assert [type(given(one)) for one in (3, np.int64(3), True, np.bool_(True))] == [int] * 4
    assert [type(given(one)) for one in (3.0, np.float64(3.0), np.array(2.0))] == [float] * 3

    def outside(point: Any) -> float:
        raise ValueError("no value")

    assert math.isnan(cb.Event("X", outside).value_or_nan(None))


# --- sizes of steps -------------------------------------------------------------------------------


def test_steps_at_the_rims_of_what_can_be_made() -> None:
    assert cb.Steps(tolerance=1e-13, most=1, growth=1.0001, smallest=0.01).first == 0.01


@pytest.mark.parametrize(
    ("size", "largest", "expected"), [(0.0, None, 0.1), (500.0, None, 5.0), (500.0, 0.3, 0.3)]
)
def test_steps_are_as_long_as_they_may_or_as_the_size_of_the_solution_has_it(
    size: float, largest: float | None, expected: float
) -> None:
    line = cb.Problem(lambda x, p: x - size, {"x": size}, {"mu": 0.0})
    steps = cb.Steps(largest=largest, most=30)
    branch = cb.trace(line, "mu", within={"x": (-1.0, 501.0)}, towards="up", steps=steps)
    assert np.diff(branch["arclength"]).max() == pytest.approx(expected, rel=0.05)
