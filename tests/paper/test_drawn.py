"""What the figures of the paper draw: which numbers, on which axes, in which colours and words."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.colors import to_hex, to_rgb

from contbreather.orbits.zones import zones
from contbreather.paper import figure2, figure3, figure4
from contbreather.paper.figure2 import TRANSITIONS, Figure2
from contbreather.paper.time_series import Curve, Panel, TimeSeries

T = np.linspace(0.0, 2.0, 9)


def reddish(colour) -> bool:
    red, _, blue = to_rgb(colour)
    return red > blue


# --- Fig. 2 ---------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def second() -> Figure2:
    one = figure2((0.8,), points=6)
    below = zones(k=0.4, within={"gamma": (0.0, 0.04)})
    lines = (*one.lines, *(replace(line, k=0.4, a=0.5 * line.a) for line in one.lines))
    return Figure2((*one.zones, below), lines)


@pytest.mark.slow
def test_panels_of_figure_2_are_below_each_other_each_as_high_as_a_diagram(second) -> None:
    figure = second.draw()
    assert (2.54 * figure.get_size_inches()).tolist() == pytest.approx([8.5, 13.2])
    titles = [ax.get_title(loc="left") for ax in figure.axes]
    assert titles == ["(a) $k$ = 0.8", "(b) $k$ = 0.4"]
    first, below = (ax.get_position() for ax in figure.axes)
    assert first.y0 > below.y1


def test_arrows_of_figure_2_lead_from_one_panel_of_figures_3_and_4_to_the_other(second) -> None:
    upper, lower = second.draw().axes
    for name, start, end, a in TRANSITIONS:
        (line,) = [one for one in upper.get_lines() if one.get_xdata().tolist() == [start, end]]
        assert line.get_ydata().tolist() == [a, a]
        heads = {
            one.get_marker(): one.get_xdata()[0]
            for one in upper.get_lines()
            if len(one.get_xdata()) == 1 and one.get_ydata()[0] == a
        }
        assert heads["."] == start
        assert heads["<" if end < start else ">"] == end
        (word,) = [text for text in upper.texts if text.get_text() == name]
        assert word.xy == (max(start, end), a)
    assert not {"Fig. 3", "Fig. 4"} & {text.get_text() for text in lower.texts}


def test_the_rule_of_each_k_is_drawn_in_its_own_panel(second) -> None:
    for ax, line in zip(second.draw().axes, second.lines[::2], strict=True):
        rule = next(one for one in ax.get_lines() if "rule" in one.get_label())
        np.testing.assert_array_equal(rule.get_data(), (line.gamma, line.a))


# --- Figs. 3 and 4 --------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("made", [figure3, figure4])
def test_moduli_are_drawn_over_the_angle_in_thousandths(made) -> None:
    figure = made()
    for ax, breather in zip(figure.draw().axes[2:], figure.breathers, strict=True):
        mu = np.asarray(breather.multipliers(sites=400, half=True))
        mu = mu[mu.imag >= 0]
        dots = [line for line in ax.get_lines() if line.get_marker() == "o"]
        drawn = np.concatenate([np.stack(line.get_data(), 1) for line in dots])
        want = np.stack([np.angle(mu) / math.pi, 1e3 * (np.abs(mu) ** 2 - 1)], 1)
        np.testing.assert_allclose(np.sort(drawn, axis=0), np.sort(want, axis=0), atol=1e-12)
        for line in dots:
            assert all((y > 5.0) == reddish(line.get_color()) for y in line.get_ydata())
        assert ax.get_xlabel() == r"angle of $\mu$ over $\pi$"
        (rule,) = [line for line in ax.get_lines() if line.get_linestyle() == "--"]
        assert list(rule.get_ydata()) == pytest.approx([5.0, 5.0])
        band = ax.patches[0]
        assert band.get_x() == 0.0
        assert band.get_width() == pytest.approx(2 * breather.gamma**0.5)
        low, high = ax.get_ylim()
        assert (low, high) == pytest.approx((-4.8, 12.0))


@pytest.mark.parametrize("made", [figure3, figure4])
def test_panels_before_and_after_are_told_apart_by_gamma_and_verdict(made) -> None:
    figure = made()
    axes = figure.draw().axes
    before, after = figure.breathers
    titles = [ax.get_title(loc="left") for ax in axes]
    assert titles == [
        rf"(a) $\gamma$ = {before.gamma:g}",
        rf"(b) $\gamma$ = {after.gamma:g}",
        "infinite chain: stable",
        "infinite chain: unstable",
    ]
    assert axes[2].get_ylabel() == r"$10^3\,(|\mu^2| - 1)$"
    assert axes[0].get_xlabel() == r"Re $\mu^2$"
    assert [axes[1].get_ylabel(), axes[3].get_ylabel()] == ["", ""]


def test_an_arrow_stands_at_the_angle_of_the_multiplier_that_it_stands_for() -> None:
    figure = figure3()
    mu = next(m for m in figure.breathers[1].stability().multipliers if m.imag > 0)
    ax = figure.draw().axes[3]
    number, arrow = ax.texts
    assert arrow.xy[0] == number.xy[0] == pytest.approx(np.angle(mu) / math.pi)
    assert arrow.xy[1] > arrow.xyann[1]  # upwards, beyond the axis
    assert number.get_horizontalalignment() == "right"  # to the left of an arrow on the right


# --- Figs. 5 to 8 ---------------------------------------------------------------------------------


def series(*panels: Panel) -> TimeSeries:
    return TimeSeries(5, panels, "What is drawn.", ("What was found.",), {})


LINES = (
    Curve("exact", 0, T, np.cos(T)),
    Curve("asymmetric", 0, T, np.sin(T), "dashed"),
    Curve("ring", 0, T, np.cos(T) + 0.1, "circles"),
)


def test_exact_lines_are_red_the_other_breather_dashed_and_the_ring_open_circles() -> None:
    ax = series(Panel("one", LINES)).draw().axes[0]
    exact, other, ring = ax.get_lines()
    assert (exact.get_linestyle(), other.get_linestyle(), ring.get_linestyle()) == (
        "-",
        "--",
        "None",
    )
    assert reddish(exact.get_color())
    assert not reddish(other.get_color())
    markers = [line.get_marker() for line in (exact, other, ring)]
    assert (*markers, ring.get_markerfacecolor()) == ("None", "None", "o", "none")
    for line, curve in zip(ax.get_lines(), LINES, strict=True):
        np.testing.assert_array_equal(line.get_data(), (curve.t, curve.u))
    legend = ax.get_legend()
    words = [text.get_text() for text in legend.get_texts()]
    colours = [to_hex(handle.get_color()) for handle in legend.legend_handles]
    assert dict(zip(words, colours, strict=True)) == {
        curve.name: to_hex(line.get_color())
        for curve, line in zip(LINES, ax.get_lines(), strict=True)
    }
    assert (ax.get_xlabel(), ax.get_ylabel()) == (r"$t/2\pi$", "$u$")
    assert ax.get_title(loc="left") == "(a) one"


def test_panels_of_one_time_axis_share_it_and_others_keep_theirs() -> None:
    later = Curve("exact", 1, T + 1.0, np.sin(T))
    panels = (Panel("", LINES), Panel("", LINES[:1]), Panel("", (later,)))
    figure = series(*panels).draw()
    assert [ax.get_xlabel() for ax in figure.axes] == ["", r"$t/2\pi$", r"$t/2\pi$"]
    assert [ax.get_title(loc="left") for ax in figure.axes] == ["(a)", "(b)", "(c)"]
    assert 2.54 * figure.get_size_inches()[1] == pytest.approx(2.9 + 3.9 + 3.9)
    assert [ax.get_legend() is not None for ax in figure.axes] == [True, False, False]


def test_traces_of_sites_stand_above_each_other_under_their_numbers() -> None:
    curves = tuple(Curve(f"u_{n}", n, T, np.cos(T) + 2.2 * n, "trace") for n in (-1, 0, 2))
    ax = series(Panel("runs", curves, (r"$t/2\pi$", "site $n$"), 1.25)).draw().axes[0]
    assert ax.get_yticks().tolist() == pytest.approx([-2.2, 0.0, 4.4])
    assert [label.get_text() for label in ax.get_yticklabels()] == ["$-1$", "$0$", "$2$"]
    mark = ax.get_lines()[-1]
    assert (list(mark.get_xdata()), mark.get_linestyle()) == ([1.25, 1.25], "--")
    assert ax.get_ylabel() == "site $n$"
    assert len({line.get_color() for line in ax.get_lines()[:3]}) == 3
    kept = series(Panel("runs", curves)).draw().axes[0]
    assert len(kept.get_lines()) == 3


def test_a_section_is_dots_and_has_no_legend() -> None:
    points = Curve("section", 0, T, np.cos(T), "points")
    ax = series(Panel("", (points,), ("$u_0$", r"$\dot u_0$"))).draw().axes[0]
    (line,) = ax.get_lines()
    assert (line.get_marker(), line.get_linestyle()) == (".", "None")
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("$u_0$", r"$\dot u_0$")
    assert ax.get_legend() is None


def test_rows_of_a_figure_name_panel_curve_and_site() -> None:
    other = Curve("exact", 10, T, np.sin(T))
    rows = list(series(Panel("", LINES[:1]), Panel("", (other,))).rows())
    assert len(rows) == 2 * T.size
    assert rows[3] == {"panel": "a", "curve": "exact", "site": 0, "t": T[3], "u": math.cos(T[3])}
    assert rows[-1] == {"panel": "b", "curve": "exact", "site": 10, "t": 2.0, "u": math.sin(2.0)}
    assert series(Panel("", LINES)).caption == "What is drawn. What was found."
