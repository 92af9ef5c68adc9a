"""Words and small numbers of the simulated figures, and searches that end nowhere."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import contbreather as cb
from contbreather.errors import NotConverged
from contbreather.paper import figure4, threshold, time_series
from contbreather.paper.lifetimes import delocalised
from contbreather.paper.time_series import Curve, Panel
from contbreather.simulation import Sample, State, simulate_smooth

PERIOD = 2.0 * math.pi


def test_a_life_is_told_in_periods() -> None:
    assert time_series._gone(math.nan) == "kept"
    assert time_series._gone(0.0) == "lost at once"
    assert time_series._gone(1.0) == "lost after 1 periods"
    assert time_series._gone(541.0) == "lost after 541 periods"


FOUND = {
    "lost": 30.0, "growth": 1.01234, "multiplier": 1.01236, "softest": math.nan,
    "rigid_lost": math.nan, "rigid_growth": 1.02, "rigid_multiplier": 1.03,
    "enough_damping": 0.0123, "long_multiplier": 0.99,
}  # fmt: skip


def test_a_fate_is_told_with_all_its_numbers() -> None:
    assert time_series._told(FOUND, 6) == (
        "lost after 30 periods (growth 1.0123, multiplier 1.0124); rigid walls: kept (growth "
        "1.0200, multiplier 1.0300), an attractor from damping 0.0123 on; on a ring of 120 the "
        "multiplier is 0.9900."
    )
    none = {**FOUND, "multiplier": math.nan, "softest": 7.891}
    assert "(there is no breather at m = 6, it ends in a fold at m = 7.89)" in time_series._told(
        none, 6
    )


def test_the_pitchfork_in_closed_form_is_that_of_the_branch() -> None:
    for gamma in (0.02, 0.04):
        b = cb.symmetric(0.7, gamma, 0.8)
        branch = cb.trace(b, "a", within={"a": (0.6, 1.0)})
        assert time_series._pitchfork(b) == pytest.approx(branch.first("PF")["a"], abs=1e-9)


def sampled(displacement, sites=(0, 1, 10), periods: int = 1, count: int = 400):
    """A run whose record is what a function says."""
    t = PERIOD / count * np.arange(periods * count)
    u = np.column_stack([displacement(n, t) for n in sites])
    return SimpleNamespace(record=SimpleNamespace(times=t, u=u, sites=sites))


def test_the_best_shift_is_the_one_that_was_made() -> None:
    exact = cb.symmetric(0.1, 0.08, 0.8)
    for shift in (-13 * PERIOD / 400, 0.0, 11 * PERIOD / 400):  # on the grid of the samples
        run = sampled(lambda n, t, shift=shift: exact.displacement(n, t + shift))
        left, found = time_series._after_a_shift(exact, run)
        assert found == pytest.approx(shift, abs=1e-5)
        assert left < 1e-4


def test_traces_are_of_the_central_sites_above_each_other_until_it_is_lost() -> None:
    run = sampled(lambda n, t: 0.1 * n + 0.0 * t, sites=(-2, -1, 0, 1, 2), count=8)
    for lost in (math.nan, 0.5):
        panel = time_series._traces(run, "title", lost)
        assert panel.title == "title"
        assert [curve.site for curve in panel.curves] == [-2, -1, 0, 1, 2]
        for curve in panel.curves:
            assert curve.u == pytest.approx(2.3 * curve.site)
            assert curve.t == pytest.approx(np.arange(8) / 8)
            assert (curve.name, curve.style) == (f"u_{curve.site}", "trace")
        assert panel.lost is None if math.isnan(lost) else panel.lost == 0.5
        assert panel.labels == (r"$t/2\pi$", "site $n$")


def test_the_exact_orbit_beside_a_simulated_one_is_the_image_it_has_come_to() -> None:
    orbit = SimpleNamespace(c=0.03, displacement=lambda n, t: np.sin(t) + n)
    t = np.linspace(0.0, 2.0, 9)
    panel = Panel("u_2", (Curve("circles", 2, t, 0.0 * t), Curve("line", 2, t, 0.0 * t)))
    same = time_series._with_arm(panel, orbit, 0.02)
    other = time_series._with_arm(panel, orbit, -0.02)
    assert [curve.name for curve in same.curves] == ["circles", "asymmetric", "line"]
    assert same.curves[1].u == pytest.approx(np.sin(PERIOD * t) + 2)
    assert other.curves[1].u == pytest.approx(-(np.sin(PERIOD * t + math.pi) + 2))
    assert (same.curves[1].style, same.curves[1].site) == ("dashed", 2)


def test_energy_all_over_the_ring_at_the_end_is_no_breather() -> None:
    still = simulate_smooth(([0.0] * 8, [0.0] * 8), a=0.0, gamma=0.0, k=0.8, m=6, periods=1)
    for count, lost in ((1, False), (3, False), (4, True), (8, True)):
        v = np.zeros((2, 8))
        v[0] = 1.0  # only the end counts
        v[1, :count] = 1.0
        assert delocalised(replace(still, strobe=State(0.0 * v, v))) is lost


# --- thresholds -----------------------------------------------------------------------------------


def test_back_from_a_guess_steps_double_until_no_pair_is_beyond() -> None:
    looked: list[float] = []

    def pairs(gamma: float) -> np.ndarray:
        looked.append(gamma)
        return np.array([2j]) if gamma > 0.018 else np.array([0.5j])

    found = threshold._before(lambda gamma: gamma, 0.02, pairs, 1.005)
    steps = -np.diff(looked)
    assert steps == pytest.approx(1e-4 * 2.0 ** np.arange(len(steps)))
    assert found == looked[-1] <= 0.018 < looked[-2]
    assert threshold._before(lambda gamma: gamma, 0.01, pairs, 1.005) == 0.01
    none = threshold._before(lambda gamma: gamma, 0.3, lambda gamma: np.empty(0), 1.005)
    assert none == 0.3


def test_pairs_beyond_at_every_coupling_are_refused() -> None:
    with pytest.raises(NotConverged, match=r"pairs beyond the modulus 1\.005 at every coupling"):
        threshold._before(lambda gamma: gamma, 0.02, lambda gamma: np.array([2j]), 1.005)


def test_a_coupling_on_a_line_is_guessed_from_the_nearest_known_ones() -> None:
    made = lambda gamma: threshold.Crossing(gamma, 0.1)  # noqa: E731
    known = {0.1: made(0.05), 0.2: made(0.07), 0.9: made(0.2)}
    assert threshold._extrapolated(known, 0.3) == pytest.approx(0.09)
    assert threshold._extrapolated(known, 0.15) == pytest.approx(0.06)
    assert threshold._extrapolated({0.1: made(0.05)}, 0.7) == 0.05
    assert threshold._extrapolated({0.1: made(0.05), 0.2: made(0.15)}, 0.9) == 0.24
    assert threshold._extrapolated({0.1: made(0.05), 0.2: made(0.03)}, 0.9) == threshold.FIRST


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


def test_the_chain_of_a_sample_goes_round_the_ring() -> None:
    run = simulate_smooth(([0.1] * 5, [0.0] * 5), a=0.0, gamma=0.0, k=0.8, m=6, periods=1,
                          sample=Sample((-2, -1, 0), 4))  # fmt: skip
    assert run.record is not None
    assert run.record.sites == (3, 4, 0)
    assert run.record.u.shape == (4, 3)
