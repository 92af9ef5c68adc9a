"""The figures of the paper: their numbers, and on which axes, in which colours and words."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from matplotlib.axes import Axes

from contbreather.orbits.zones import zones
from contbreather.paper import FIGURES, figure2, figure3, figure4
from contbreather.paper.figures234 import TRANSITIONS, Figure2

MADE = {3: figure3(), 4: figure4()}
both_of_them = pytest.mark.parametrize("number", MADE)


@cache
def axes_of(number: int) -> list[Axes]:
    """Of a figure that is drawn once, for all that look at it."""
    return MADE[number].draw().axes


# --- Fig. 2 ---------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def second() -> Figure2:
    return figure2((0.8,), points=2)


@pytest.fixture(scope="module")
def both(second: Figure2) -> Figure2:
    below = zones(k=0.4, within={"gamma": (0.0, 0.04)})
    lines = (*second.lines, *(replace(line, k=0.4, a=0.5 * line.a) for line in second.lines))
    return Figure2((*second.zones, below), lines)


@pytest.fixture(scope="module")
def panels(both: Figure2) -> list[Axes]:
    return both.draw().axes


def test_arrows_of_figure_2_lead_from_one_panel_of_figures_3_and_4_to_the_other(panels) -> None:
    upper, lower = panels
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


def rows_of(figure: object, **wanted: object) -> list[dict]:
    return [r for r in figure.rows() if all(r[n] == v for n, v in wanted.items())]


def test_figures_are_numbered_as_the_captions_of_the_paper() -> None:
    assert list(FIGURES) == [2, 3, 4, 5, 6, 7, 8]


@pytest.mark.slow
def test_figure_2_draws_the_rule_dotted_beside_the_exact_line(second: Figure2) -> None:
    ax = second.draw().axes[0]
    lines = {line.get_label(): line for line in ax.get_lines()}
    exact = lines["Neimark\N{EN DASH}Sacker (NS)"]
    rule = lines["NS by the paper's rule, N = 400"]
    assert exact.get_linestyle() == "-"
    assert rule.get_linestyle() not in ("-", "None")
    assert rule.get_color() == exact.get_color()


def test_figure_2_letters_both_sides_and_names_both_transitions(second: Figure2) -> None:
    figure = second.draw()
    words = [text.get_text() for text in figure.axes[0].texts]
    assert {"S", "US", "Fig. 3", "Fig. 4", "PF–GR", "NS–GR", "NS–LP"} <= set(words)
    assert words.count("US") == 2


def test_figure_2_starts_its_arrows_at_the_parameters_of_figures_3_and_4() -> None:
    for (_, start, end, a), figure in zip(TRANSITIONS, MADE.values(), strict=True):
        assert [(b.gamma, b.a, b.k) for b in figure.breathers] == [(start, a, 0.8), (end, a, 0.8)]


def test_rows_of_figure_2_tell_the_rule_from_the_exact_lines(second: Figure2) -> None:
    rows = list(second.rows())
    assert {row["curve"] for row in rows} == {"NS-rule", "PF-rule"}
    assert all(row["sites"] == 400 and row["threshold"] == 1.005 for row in rows)
    assert all(row["k"] == 0.8 for row in rows)
    for line in second.lines:
        mine = [row for row in rows if row["curve"] == f"{line.kind}-rule"]
        assert [(row["gamma"], row["a"], row["nu"]) for row in mine] == list(
            zip(line.gamma.tolist(), line.a.tolist(), line.angle.tolist(), strict=True)
        )
    assert "exact for the infinite chain" in second.caption
    assert "400 sites" in second.caption


# --- Figs. 3 and 4 --------------------------------------------------------------------------------


@pytest.mark.slow
@both_of_them
def test_panels_before_and_after_are_told_apart_by_gamma_and_verdict(number) -> None:
    axes = axes_of(number)
    before, after = MADE[number].breathers
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


@both_of_them
def test_words_keep_off_the_circle(number) -> None:
    for ax in axes_of(number)[:2]:
        ax.figure.draw_without_rendering()
        lines = [one.get_xydata() for one in ax.get_lines() if one.get_zorder() > 0]
        drawn = ax.transData.transform(np.concatenate(lines))
        boxes = [word.get_window_extent() for word in ax.texts if word.get_text()]
        assert boxes
        assert not any(box.count_contains(drawn) for box in boxes)


@pytest.mark.parametrize(
    ("number", "unstable", "top"), [(3, 2, -0.2447945960 + 1.0231123432j), (4, 1, 1.0627500064)]
)
def test_panels_lie_on_both_sides_of_the_bifurcation(number, unstable: int, top: complex) -> None:
    """With the leading multipliers of the notes."""
    before, after = MADE[number].breathers
    assert (before.stability().unstable, after.stability().unstable) == (0, unstable)
    assert (before.stability(sites=400).stable, after.stability(sites=400).stable) == (True, False)
    rows = rows_of(MADE[number], panel="b")[:unstable]
    (mu,) = [complex(r["half_re"], r["half_im"]) for r in rows if r["half_im"] >= 0]
    assert mu == pytest.approx(top, abs=1e-10)


@both_of_them
def test_rows_are_all_multipliers_and_their_squares(number) -> None:
    for panel, breather in zip("ab", MADE[number].breathers, strict=True):
        rows = rows_of(MADE[number], panel=panel)
        half = np.array([complex(r["half_re"], r["half_im"]) for r in rows])
        full = np.array([complex(r["full_re"], r["full_im"]) for r in rows])
        assert len(rows) == 800
        numbers = {(row["a"], row["gamma"], row["k"]) for row in rows}
        assert numbers == {(breather.a, breather.gamma, breather.k)}
        assert [row["modulus"] for row in rows] == pytest.approx(np.abs(full).tolist(), rel=1e-14)
        assert np.all(np.diff(np.abs(half)) <= 0)
        np.testing.assert_allclose(full, half**2, atol=1e-14)
        want = np.sort_complex(breather.multipliers(sites=400))
        np.testing.assert_allclose(np.sort_complex(full), want, atol=1e-12)


@pytest.mark.slow
@both_of_them
def test_caption_describes_the_arrows_that_are_there(number) -> None:
    made, panels = MADE[number], axes_of(number)[2:]
    arrows = [any(getattr(word, "arrow_patch", None) for word in ax.texts) for ax in panels]
    assert arrows == [False, True]
    assert "arrow in (b):" in made.caption
    alone = replace(made, breathers=(made.breathers[0],) * 2)
    assert "arrow" not in alone.caption
    assert alone.caption.endswith("Dashed: the paper's threshold 1.005.")
