"""Pictures of simulations show the numbers they were given, in words that say what they are."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import matplotlib
import numpy as np
import pytest
from matplotlib.colors import to_hex, to_rgba

import contbreather as cb
from contbreather.dynamics import (
    Axis,
    Basin,
    Fate,
    Sample,
    attraction,
    simulate_smooth,
    sweep,
    there_and_back,
)
from contbreather.plotting import (
    plot_basin,
    plot_localisation,
    plot_motion,
    plot_section,
    plot_sweep,
    save_figure,
)
from contbreather.plotting.runs import FATES

matplotlib.use("Agg")

SET = {"a": 0.2, "gamma": 0.04, "k": 0.8, "damping": 0.01}


@pytest.fixture(scope="module")
def state():
    return cb.symmetric(a=0.2, gamma=0.04, k=0.8).state(10)


@pytest.fixture(scope="module")
def run(state):
    return cb.simulate(state, periods=30, sample=Sample((0, -1), 20), **SET)


def test_motion_is_drawn_over_periods_site_by_site(run):
    lines = plot_motion(run.record).axes.get_lines()
    assert [line.get_label() for line in lines] == ["$u_{0}$", "$u_{9}$"]
    for i, line in enumerate(lines):
        np.testing.assert_array_equal(line.get_ydata(), run.record.u[:, i])
        assert line.get_xdata()[20] == pytest.approx(1.0)


def test_section_leaves_out_the_transient_and_takes_sites_round_the_ring(run):
    (line,) = plot_section(run, site=-1, skip=10).axes.get_lines()
    np.testing.assert_array_equal(line.get_xdata(), run.strobe.u[10:, 9])
    np.testing.assert_array_equal(line.get_ydata(), run.strobe.v[10:, 9])


def test_section_of_a_fixed_point_does_not_zoom_into_rounding(state):
    run = cb.simulate(state, periods=5, a=0.2, gamma=0.04, k=0.8)
    assert np.ptp(plot_section(run).axes.get_xlim()) == pytest.approx(2e-3)


def test_section_of_a_motion_shows_all_of_it(run):
    axes = plot_section(run, site=1).axes
    (line,) = axes.get_lines()
    assert np.ptp(line.get_xdata()) > 1e-3 < np.ptp(line.get_ydata())
    for data, (low, high) in (
        (line.get_xdata(), axes.get_xlim()),
        (line.get_ydata(), axes.get_ylim()),
    ):
        assert low < data.min()
        assert data.max() < high


def test_more_transient_than_run_is_refused(run):
    with pytest.raises(cb.BadInput, match="the run has 30 periods to leave out"):
        plot_section(run, skip=31)


def test_localisation_of_rigid_and_smooth_runs_is_the_participation_ratio(run, state):
    for one in (run, simulate_smooth(state, m=6, periods=10, **SET)):
        (line,) = plot_localisation(one).axes.get_lines()
        assert len(line.get_xdata()) == one.periods + 1
        assert 1.0 <= line.get_ydata()[0] < 1.5


def test_sweep_has_one_colour_for_each_way_and_every_value_once(state):
    loop = sweep(state, "a", there_and_back([0.2, 0.1, 0.05]), periods=20, **SET)
    ax = plot_sweep(loop, y="participation").axes
    down, up = ax.get_lines()
    assert down.get_xdata().tolist() == [0.2, 0.1, 0.05]
    assert up.get_xdata().tolist() == [0.05, 0.1, 0.2]
    assert down.get_color() != up.get_color()
    np.testing.assert_array_equal(down.get_ydata(), loop.participation[:3])
    assert ax.get_ylabel() == "participation ratio"


def test_sweep_of_one_value_is_a_point(state):
    (line,) = plot_sweep(sweep(state, "a", [0.2], periods=5, **SET)).axes.get_lines()
    assert line.get_xdata().tolist() == [0.2]


def test_unknown_column_of_a_sweep_is_refused(state):
    loop = sweep(state, "a", [0.2], periods=5, **SET)
    with pytest.raises(cb.BadInput, match=r"y must be 'p', 'amplitude', .*, got 'height'"):
        plot_sweep(loop, y="height")


def test_each_fate_has_its_own_colour_and_the_legend_names_those_that_are_there():
    fates = np.array([[4, 1, 0], [2, 3, -1]], np.int8)
    u, v = Axis("u", 0, [-0.5, 0.0, 0.5]), Axis("v", 2, [-1.0, 1.0])
    ax = plot_basin(Basin(u, v, fates, np.zeros((2, 3)), False)).axes
    (mesh,) = ax.collections
    mesh.update_scalarmappable()
    drawn = [to_hex(colour) for colour in mesh.get_facecolor().reshape(-1, 4)]
    wanted = [to_hex(to_rgba(FATES[Fate(fate)])) for fate in fates.ravel()]
    assert drawn == wanted
    assert len(set(drawn)) == len(Fate)
    names = [text.get_text() for text in ax.get_legend().get_texts()]
    assert names == [fate.words for fate in FATES]
    assert ax.get_ylabel() == r"$\dot u_{2}$"


def test_basin_of_a_simulation_is_saved(state, tmp_path):
    u, v = Axis("u", 0, [-0.5, 0.5]), Axis("v", 0, [-1.0, 0.0, 1.0])
    with ThreadPoolExecutor(1) as one:
        basin = attraction(state, u, v, periods=20, executor=one, **SET)
    names = [t.get_text() for t in plot_basin(basin).axes.get_legend().get_texts()]
    assert len(names) == len(np.unique(basin.fate))
    assert save_figure(plot_basin(basin), tmp_path / "basin.svg").stat().st_size > 1000
