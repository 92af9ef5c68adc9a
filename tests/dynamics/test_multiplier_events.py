"""Two multipliers within one step, of motions on damped rings: told apart, or said."""

from __future__ import annotations

import numpy as np
import pytest

import contbreather as cb
from contbreather.dynamics.multiplier_events import (
    neimark_sacker,
    period_doubling,
    pitchfork,
    tally,
)

PARAMS = {"mu": 0.0, "damping": 0.1}


def problem(diagonal, *events):
    """A line of solutions, the multipliers of which are functions of mu."""

    def matrix(point):
        return np.diag(diagonal(point["mu"]))

    made = tuple(make(matrix) for make in events)
    return cb.Problem(lambda x, p: x - 1.0, {"x": 1.0}, PARAMS, events=made)


def count(matrix):
    return tally(matrix, 1e-9)


@pytest.mark.parametrize("steps", [None, cb.Steps(largest=0.03)])
def test_two_multipliers_that_pass_minus_one_within_a_step_are_two_doublings(steps):
    def diagonal(mu):
        return [-0.9 - mu, -0.899 - mu, 0.3]

    branch = cb.trace(
        problem(diagonal, period_doubling, count), "mu", within={"mu": (-1, 1)}, steps=steps
    )
    assert [p["mu"] for p in branch.special if p.kind == "PD"] == pytest.approx(
        [0.1, 0.101], abs=1e-9
    )
    assert not branch.doubtful


def test_two_that_pass_one_are_two_pitchforks():
    branch = cb.trace(
        problem(lambda mu: [0.9 + mu, 0.8995 + mu], pitchfork, count), "mu", within={"mu": (-1, 1)}
    )
    assert [p["mu"] for p in branch.special if p.kind == "PF"] == pytest.approx(
        [0.1, 0.1005], abs=1e-9
    )


def test_what_no_event_explains_is_said():
    """A real multiplier passes +1, and only doublings are looked for."""
    branch = cb.trace(
        problem(lambda mu: [0.9 + mu, 0.1], period_doubling, neimark_sacker, count),
        "mu",
        within={"mu": (-0.5, 0.5)},
    )
    assert [p.kind for p in branch.special] == ["EP", "EP"]
    (doubt,) = branch.doubtful
    assert doubt["mu"] == pytest.approx(0.1, abs=1e-3)
    assert "changes from 0 to 1" in doubt.detail["reason"]


def test_without_damping_no_count_is_held_against_a_branch():
    bare = problem(lambda mu: [0.9 + mu, 0.1], count)
    branch = cb.trace(bare.at(damping=0.0), "mu", within={"mu": (-0.5, 0.5)})
    assert not branch.doubtful


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
