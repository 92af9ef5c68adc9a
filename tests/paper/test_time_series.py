"""Figures 5 to 8: the numbers their captions are made of, and that they can be drawn."""

from __future__ import annotations

import json
import math
import re
from functools import cache

import numpy as np
import pytest

from contbreather.cli import DONE, main
from contbreather.errors import BadInput
from contbreather.paper import FIGURES, time_series


@pytest.fixture(scope="module")
def figures():
    return cache(lambda n: getattr(time_series, f"figure{n}")())


@pytest.mark.slow
def test_figure_5_is_an_attractor_and_its_differences_are_as_measured(figures):
    numbers = figures(5).numbers
    assert numbers["difference_0"] == pytest.approx(0.098, abs=5e-4)
    assert numbers["difference_1"] == pytest.approx(0.0104, abs=1e-4)
    assert numbers["difference_10"] == pytest.approx(0.0005, abs=5e-5)
    assert numbers["rigid_multiplier"] == pytest.approx(0.9979, abs=5e-5)
    assert numbers["undamped_multiplier"] == pytest.approx(1.014, abs=5e-4)
    assert "an attractor" in figures(5).caption
    assert numbers["away"] < 0.1  # from the start of the paper, u_0' = 3


def test_figure_for_programs_carries_the_numbers_of_its_verdict(figures, monkeypatch, capsys):
    monkeypatch.setitem(FIGURES, 5, lambda: figures(5))
    assert main(["figure", "5", "--json"]) == DONE
    content = json.loads(capsys.readouterr().out)
    assert content["numbers"] == figures(5).numbers
    assert {row["curve"] for row in content["rows"]} == {"exact", "ring, $m = 6$"}


@pytest.mark.slow
def test_figure_6_shows_three_transients(figures):
    """Lives depend on how exact the start is: orders of magnitude; multipliers do not."""
    numbers = figures(6).numbers
    assert 400 < numbers["lost_0.1"] < 700
    assert 80 < numbers["lost_0.2"] < 140
    for a, life, multiplier in ((0.1, 196, 1.0325), (0.2, 69, 1.1038), (0.7, 114, 1.0393)):
        assert 0.5 * life < numbers[f"rigid_lost_{a}"] < 2.0 * life
        assert numbers[f"rigid_multiplier_{a}"] == pytest.approx(multiplier, abs=5e-5)
    assert 1.0 < numbers["multiplier_0.1"] < numbers["rigid_multiplier_0.1"]
    assert math.isnan(numbers["multiplier_0.7"])
    told = r"multiplier 1\.0\d{3}"
    gone = r"there is no breather at m = 6"
    for letter, a, why in (("a", 0.1, told), ("c", 0.7, gone)):
        words = rf"\({letter}\) a = {a}: lost (at once|after \d+ periods) \({why}\); rigid walls"
        assert re.search(words, figures(6).caption)
    for panel, a in zip(figures(6).panels, (0.1, 0.2, 0.7), strict=True):
        assert [curve.site for curve in panel.curves] == [-2, -1, 0, 1, 2]
        assert panel.lost == numbers[f"lost_{a}"]


@pytest.mark.slow
def test_figure_7_is_asymmetric_and_needs_hard_walls(figures):
    numbers = figures(7).numbers
    assert abs(numbers["mean_0"]) == pytest.approx(0.028, abs=5e-4)
    assert numbers["phase_1"] == pytest.approx(0.455388, abs=1e-6)
    assert numbers["phase_2"] == pytest.approx(3.01105, abs=1e-5)
    assert numbers["rigid_multiplier"] < 1.0 < numbers["symmetric_multiplier"]
    assert numbers["delocalised"] == 0.0
    soft = time_series.figure7(m=6)
    assert soft.numbers["delocalised"] == 1.0
    assert "delocalised" in soft.caption


@pytest.mark.slow
def test_figure_7_shows_the_ring_on_the_asymmetric_breather_of_its_own_side(figures):
    """At the times of the exact line, and off centre to the same side as the circles."""
    numbers = figures(7).numbers
    assert numbers["exact_c"] == pytest.approx(0.0373542, abs=1e-7)
    for panel in figures(7).panels:
        exact, arm, ring = panel.curves
        assert [curve.style for curve in panel.curves] == ["line", "dashed", "circles"]
        assert np.array_equal(arm.t, exact.t)
        centre, lopsided, own = (curve.u[:-1].mean() for curve in (exact, arm, ring))
        assert abs(centre) < 1e-5
        assert lopsided * own > 0.0
        assert np.corrcoef(exact.u, arm.u)[0, 1] > 0.9  # in phase


@pytest.mark.slow
def test_figure_8_is_a_transient_beside_a_genuine_torus(figures):
    numbers = figures(8).numbers
    assert 50 < numbers["lost"] < 250
    assert numbers["rigid_multiplier"] > 1.07
    assert numbers["rotation"] == pytest.approx(0.39159998, abs=1e-8)
    assert numbers["rotation_error"] < 1e-8
    assert abs(numbers["exponent"]) < 1e-9
    assert (numbers["frequencies"], numbers["impacting"]) == (1, 1)
    assert 2.0 < numbers["participation"] < 3.0


@pytest.mark.parametrize("number", [5, pytest.param(6, marks=pytest.mark.slow), 7, 8])
def test_figure_is_drawn_with_all_its_panels_and_rows(figures, number, tmp_path):
    from contbreather.plotting.canvas import save_figure

    figure = figures(number)
    assert figure.number == number
    drawn = figure.draw()
    assert len(drawn.axes) == len(figure.panels) == (4 if number == 8 else 3)
    rows = list(figure.rows())
    assert set(rows[0]) == {"panel", "curve", "site", "t", "u"}
    assert {row["panel"] for row in rows} == set("abcd"[: len(figure.panels)])
    assert all(math.isfinite(row["u"]) for row in rows)
    if number == 6:  # a sentence for each panel
        assert re.findall(r"\((\w)\) a = (0\.\d): lost", figure.caption) == [
            ("a", "0.1"), ("b", "0.2"), ("c", "0.7"),
        ]  # fmt: skip
    assert save_figure(drawn, tmp_path / "figure.png").stat().st_size > 10_000


def test_m_of_the_paper_is_a_natural_number():
    for figure in (5, 6, 7, 8):
        with pytest.raises(BadInput, match=r"m = 6\.5: a whole number, at least 1"):
            getattr(time_series, f"figure{figure}")(m=6.5)
