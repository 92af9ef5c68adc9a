"""Tests and counts that jump thousands of times within a step: the walk goes on, and says so."""

from __future__ import annotations

import numpy as np
import pytest

import contbreather as cb


@pytest.mark.slow
@pytest.mark.parametrize("times", [1e4, 1e6])
def test_an_event_that_jumps_ten_thousand_times_within_a_step_does_not_hang(times):
    calls = [0]

    def jumps(point):
        calls[0] += 1
        return int(np.floor(times * point["mu"]))

    line = cb.Problem(lambda x, p: x - 1.0, {"x": 1.0}, {"mu": 0.0})
    branch = cb.trace(line, "mu", within={"mu": (0, 1)}, events=[cb.Event("UZ", jumps)])
    assert calls[0] < 3e4 * 5
    assert any("more than" in point.detail["reason"] for point in branch.doubtful)


def test_a_count_that_changes_ten_thousand_times_within_a_step_does_not_hang():
    calls = [0]

    def many(point):
        calls[0] += 1
        return int(np.floor(1e4 * point["mu"]))

    line = cb.Problem(lambda x, p: x - 1.0, {"x": 1.0}, {"mu": 0.0})
    event = cb.Event("UZ", lambda point: 2.0 + point["mu"], count=many)
    branch = cb.trace(line, "mu", within={"mu": (0, 1)}, events=[event])
    assert calls[0] < 2e4
    assert any("too often" in point.detail["reason"] for point in branch.doubtful)
