"""Words and small numbers of the simulated figures, and searches that end nowhere."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from contbreather.paper import figure4
from contbreather.paper.lifetimes import delocalised
from contbreather.simulation import State, simulate_smooth

PERIOD = 2.0 * math.pi


FOUND = {
    "lost": 30.0, "growth": 1.01234, "multiplier": 1.01236, "softest": math.nan,
    "rigid_lost": math.nan, "rigid_growth": 1.02, "rigid_multiplier": 1.03,
    "enough_damping": 0.0123, "long_multiplier": 0.99,
}  # fmt: skip


def test_energy_all_over_the_ring_at_the_end_is_no_breather() -> None:
    still = simulate_smooth(([0.0] * 8, [0.0] * 8), a=0.0, gamma=0.0, k=0.8, m=6, periods=1)
    for count, lost in ((1, False), (3, False), (4, True), (8, True)):
        v = np.zeros((2, 8))
        v[0] = 1.0  # only the end counts
        v[1, :count] = 1.0
        assert delocalised(replace(still, strobe=State(0.0 * v, v))) is lost


# --- thresholds -----------------------------------------------------------------------------------


def test_isolated_multipliers_within_the_axis_are_crosses() -> None:
    figure = replace(figure4(), threshold=2.0)
    for ax, breather in zip(figure.draw().axes[2:], figure.breathers, strict=True):
        crosses = [line for line in ax.get_lines() if line.get_marker() == "x"]
        alone = breather.stability().multipliers
        alone = alone[alone.imag >= 0.0]
        drawn = sorted((float(c.get_xdata()[0]), float(c.get_ydata()[0])) for c in crosses)
        wanted = sorted((float(np.angle(z)) / math.pi, 1e3 * (abs(z) ** 2 - 1.0)) for z in alone)
        assert np.array(drawn).reshape(-1, 2) == pytest.approx(np.array(wanted).reshape(-1, 2))
        assert all(c.get_color() == "black" and c.get_markersize() == 4 for c in crosses)
    assert "arrow" not in figure.caption
    assert "arrow in (b)" in figure4().caption or "arrow in (a)" in figure4().caption
