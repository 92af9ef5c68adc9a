"""Columns along branches of periodic motions: moduli over the whole period of the forcing."""

from __future__ import annotations

import numpy as np
import pytest

import contbreather as cb
from contbreather.dynamics import Fate, periodic


@pytest.mark.slow
@pytest.mark.parametrize("symmetric", [True, False])
def test_columns_of_a_smooth_orbit_are_about_its_whole_period(symmetric: bool) -> None:
    state = cb.symmetric(0.1, 0.08, 0.8).state(4)
    start = periodic(state, a=0.1, gamma=0.08, m=6, k=0.8, damping=0.01, symmetric=symmetric)
    branch = cb.trace(start, "a", within={"a": (0.098, 0.102)}, events=())
    assert len(branch) >= 3
    for point in branch:
        moduli = np.abs(point.solution.multipliers)
        assert moduli.size == 8
        assert point["largest"] == pytest.approx(moduli.max(), rel=1e-9)
        assert np.prod(moduli) < np.exp(-8 * np.pi * 0.01) * 1.0001  # damping of all sites
        assert point["unstable"] == np.sum(moduli > 1.0 + 1e-6)


def test_fates_are_small_numbers_without_gaps() -> None:
    """They are kept in one byte each, and coloured by steps of one."""
    assert sorted(int(fate) for fate in Fate) == list(range(-1, 5))
    assert Fate.PENDING < Fate.OUTSIDE
