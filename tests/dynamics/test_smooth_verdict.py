"""Verdicts on smooth rings: on motions of known kind, and on runs."""

from __future__ import annotations

import numpy as np
import pytest

import contbreather as cb
from contbreather.dynamics import (
    Explicit,
    simulate_smooth,
)
from contbreather.dynamics.verdicts import Kind, judge
from contbreather.paper.fates import smooth_breather

GOLDEN = 0.3819660113


@pytest.mark.slow
def test_motion_between_elastic_walls_is_a_torus_with_the_rotation_number_of_its_spectrum():
    """A single site without losses, weakly driven: its section is a closed curve."""
    shared = {"a": 0.1, "gamma": 0.0, "k": 1.0, "m": 2}
    run = simulate_smooth(([0.05], [2.0]), periods=1000, **shared)
    found = judge(run)
    assert found.kind is Kind.QUASI_PERIODIC, found.reason
    assert found.evidence["exponent"] < 2e-3
    x = run.strobe.u[:, 0] - run.strobe.u[:, 0].mean()
    fine = np.linspace(0.3, 0.5, 4001)
    waves = np.exp(-2j * np.pi * np.outer(fine, np.arange(len(x))))
    peak = fine[np.abs(waves @ (x * np.hanning(len(x)))).argmax()]
    assert found.evidence["rotation"] == pytest.approx(peak, abs=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize(("a", "periods"), [(1.0, 2), (1.05, 4)])
def test_doubled_motion_is_locked_with_the_multiplier_of_its_own_period_map(a, periods):
    shared = {"a": a, "gamma": 0.0, "k": 0.7, "m": 30}
    settled = simulate_smooth(([-0.31], [-0.16]), periods=400, **shared).final
    run = simulate_smooth(settled, periods=100, **shared)
    found = judge(run)
    assert found.kind is Kind.LOCKED, found.reason
    assert found.evidence["periods"] == periods
    first = np.array(run.final).ravel()
    exactly = {**shared, "periods": periods, "solver": Explicit(1e-13)}
    columns = []
    for push in 1e-5 * np.eye(2):  # the period map by central differences
        ends = [simulate_smooth((first + s * push)[:, None], **exactly).final for s in (1, -1)]
        columns.append(np.subtract(*ends).ravel() / 2e-5)
    largest = np.abs(np.linalg.eigvals(np.array(columns))).max()
    assert found.evidence["multiplier"] == pytest.approx(largest, abs=1e-4)


@pytest.mark.slow
def test_bands_of_chaos_between_smooth_walls_are_no_torus():
    shared = {"a": 1.0565, "gamma": 0.0, "k": 0.7, "m": 30}
    settled = simulate_smooth(([-0.31], [-0.16]), periods=400, **shared).final
    found = judge(simulate_smooth(settled, periods=300, **shared))
    assert found.kind in (Kind.CHAOTIC, Kind.UNDECIDED), found.reason


def test_smooth_ring_that_is_delocalised_is_no_breather():
    shared = {"a": 0.7, "gamma": 0.104, "k": 0.8, "damping": 0.005, "m": 6}
    settled = simulate_smooth(cb.symmetric(0.7, 0.104, 0.8).state(20), periods=60, **shared)
    found = judge(simulate_smooth(settled.final, periods=60, **shared))
    assert found.kind in (Kind.SYNCHRONISED, Kind.DELOCALISED)


def test_smooth_motion_next_to_one_that_repels_is_not_called_periodic():
    b = cb.symmetric(0.2, 0.104, 0.8)
    shared = {"a": 0.2, "gamma": 0.104, "k": 0.8, "damping": 0.005, "m": 6}
    orbit = smooth_breather(b, 6, 0.005, 20)
    found = judge(simulate_smooth(orbit.state, periods=50, **shared))
    assert found.kind is Kind.UNDECIDED
    assert "it repels" in found.reason
