"""Figures 2 to 4: the numbers they show and how they show them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import contbreather as cb
from contbreather.paper import FIGURES, chain_lengths, figure2, figure3, figure4
from contbreather.paper.figure2 import Figure2


@pytest.fixture(scope="module")
def second() -> Figure2:
    return figure2((0.8,), points=12)


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
    np.testing.assert_array_equal(rule.get_xdata(), second.lines[0].gamma)


def test_figure_2_letters_both_sides_and_names_both_transitions(second: Figure2) -> None:
    figure = second.draw()
    words = [text.get_text() for text in figure.axes[0].texts]
    assert {"S", "US", "Fig. 3", "Fig. 4", "PF–GR", "NS–GR", "NS–LP"} <= set(words)
    assert words.count("US") == 2


def test_figure_2_starts_its_arrows_at_the_parameters_of_figures_3_and_4() -> None:
    from contbreather.paper.figure2 import TRANSITIONS

    for (_, start, end, a), figure in zip(TRANSITIONS, (figure3(), figure4()), strict=True):
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


def test_chain_lengths_at_the_spot_of_the_notes() -> None:
    found = chain_lengths(0.2, 0.8, (200, 400, 800))
    assert [found[n] for n in ("200", "400", "800")] == pytest.approx(
        [0.0824090, 0.0915527, 0.0968769], abs=1e-7
    )
    assert found["exact"] == pytest.approx(0.0969710, abs=1e-7)
    assert found["rule, N to infinity"] == pytest.approx(0.0976133, abs=1e-7)


@pytest.mark.parametrize(
    ("figure", "unstable", "top"),
    [(figure3(), 2, -0.2447945960 + 1.0231123432j), (figure4(), 1, 1.0627500064)],
)
def test_panels_lie_on_both_sides_of_the_bifurcation(figure, unstable: int, top: complex) -> None:
    """With the leading multipliers of the notes."""
    before, after = figure.breathers
    assert (before.stability().unstable, after.stability().unstable) == (0, unstable)
    assert (before.stability(sites=400).stable, after.stability(sites=400).stable) == (True, False)
    rows = rows_of(figure, panel="b")[:unstable]
    (mu,) = [complex(r["half_re"], r["half_im"]) for r in rows if r["half_im"] >= 0]
    assert mu == pytest.approx(top, abs=1e-10)


@pytest.mark.parametrize("figure", [figure3(), figure4()])
def test_rows_are_all_multipliers_and_their_squares(figure) -> None:
    for panel, breather in zip("ab", figure.breathers, strict=True):
        rows = rows_of(figure, panel=panel)
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
@pytest.mark.parametrize("figure", [figure3(), figure4()])
def test_isolated_multiplier_beyond_the_axis_is_pointed_at_with_its_value(figure) -> None:
    figure_axes = figure.draw().axes
    after = figure.breathers[1]
    top = np.abs(after.stability().multipliers[0]) ** 2 - 1
    words = [text.get_text() for text in figure_axes[3].texts]
    assert f"{1e3 * top:.1f}" in words
    assert not any(text.get_text() for text in figure_axes[2].texts)  # nothing comes out in (a)


@pytest.mark.slow
@pytest.mark.parametrize("figure", [figure3, figure4])
def test_caption_describes_the_arrows_that_are_there(figure) -> None:
    made = figure()
    panels = made.draw().axes[2:]
    arrows = [any(getattr(word, "arrow_patch", None) for word in ax.texts) for ax in panels]
    assert arrows == [False, True]
    assert "arrow in (b):" in made.caption
    alone = replace(made, breathers=(made.breathers[0],) * 2)
    assert "arrow" not in alone.caption
    assert alone.caption.endswith("Dashed: the paper's threshold 1.005.")


def test_tick_labels_of_neighbouring_panels_stand_apart() -> None:
    figure = figure3().draw()
    figure.draw_without_rendering()
    left, right = figure.axes[2:]
    gap = right.get_xticklabels()[0].get_window_extent().x0
    gap -= left.get_xticklabels()[-1].get_window_extent().x1
    assert gap > figure.dpi / 72 * 7  # the height of a letter


def test_verdicts_of_a_figure_name_both_chains() -> None:
    for sentence in figure3().verdicts():
        assert "ring of 400:" in sentence
        assert "infinite chain" in sentence


def test_public_front_is_enough_to_reproduce_the_spot() -> None:
    mu = cb.symmetric(0.8, 0.045, 0.8).multipliers(sites=400, half=True)
    assert np.abs(mu).max() == pytest.approx(1.0627500064, abs=1e-10)
