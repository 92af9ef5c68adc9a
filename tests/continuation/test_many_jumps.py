"""Tests and counts that jump thousands of times within a step: the walk goes on, and says so."""

from __future__ import annotations

import numpy as np
import pytest

import contbreather as cb


@pytest.mark.parametrize(
    ("times", "counted", "most", "said"),
    [
        (1e6, False, 1e4, "more than"),
        (1e4, True, 1e3, "too often"),
    ],
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
