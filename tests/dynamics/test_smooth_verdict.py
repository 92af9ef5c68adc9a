"""Verdicts on smooth rings: on motions of known kind, and on runs."""

from __future__ import annotations

import numpy as np
import pytest

import contbreather as cb
from contbreather.dynamics import RunStop, SmoothConditions, SmoothRun, State, simulate_smooth
from contbreather.dynamics.conditions import PERIOD
from contbreather.dynamics.quasiperiodic import Kind
from contbreather.dynamics.smooth_verdict import judge_smooth
from contbreather.paper.fates import smooth_breather

GOLDEN = 0.3819660113


def run_of(u, v, sites=6):
    """A run whose site 0 has these states once in a period, all others at rest."""
    strobe = np.zeros((2, len(u), sites))
    strobe[0, :, 0], strobe[1, :, 0] = u, v
    final, times = State(*strobe[:, -1]), PERIOD * np.arange(len(u))
    conditions = SmoothConditions(1e-3, 0.05, 0.1417, 6, 0.01)
    whole = State(*strobe)
    return SmoothRun(times, whole, final, times[-1], None, conditions, RunStop.DONE)


def test_closed_curve_is_a_torus_with_its_rotation_number():
    t = 2.0 * np.pi * GOLDEN * np.arange(1500)
    found = judge_smooth(run_of(0.3 * np.cos(t) + 0.05 * np.cos(2 * t), 0.4 * np.sin(t) - 1.0))
    assert found.kind is Kind.QUASI_PERIODIC
    assert found.evidence["rotation"] == pytest.approx(GOLDEN, abs=1e-9)


@pytest.mark.parametrize("periods", [2, 3, 7])
def test_motion_that_returns_after_several_periods_is_locked(periods):
    t = 2.0 * np.pi * np.arange(200) / periods
    found = judge_smooth(run_of(0.3 * np.cos(t), 0.4 * np.sin(t) - 1.0))
    assert found.kind is Kind.LOCKED
    assert found.evidence["periods"] == periods


def test_spiral_is_undecided():
    j = np.arange(600)
    t, size = 2.0 * np.pi * GOLDEN * j, np.exp(-2e-3 * j)
    found = judge_smooth(run_of(0.3 * size * np.cos(t), 0.4 * size * np.sin(t) - 1.0))
    assert found.kind is Kind.UNDECIDED
    assert "size changes" in found.reason


def test_noise_is_undecided_for_nothing_here_tells_it_from_chaos():
    u, v = np.random.default_rng(0).normal(size=(2, 300))
    assert judge_smooth(run_of(0.2 * u, 0.2 * v - 1.0)).kind is Kind.UNDECIDED


def test_smooth_ring_that_is_delocalised_is_no_breather():
    shared = {"a": 0.7, "gamma": 0.104, "k": 0.8, "damping": 0.005, "m": 6}
    settled = simulate_smooth(cb.symmetric(0.7, 0.104, 0.8).state(20), periods=60, **shared)
    found = judge_smooth(simulate_smooth(settled.final, periods=60, **shared))
    assert found.kind in (Kind.SYNCHRONISED, Kind.DELOCALISED)


def test_smooth_motion_next_to_one_that_repels_is_not_called_periodic():
    b = cb.symmetric(0.2, 0.104, 0.8)
    shared = {"a": 0.2, "gamma": 0.104, "k": 0.8, "damping": 0.005, "m": 6}
    orbit = smooth_breather(b, 6, 0.005, 20)
    found = judge_smooth(simulate_smooth(orbit.state, periods=50, **shared))
    assert found.kind is Kind.UNDECIDED
    assert "it repels" in found.reason
