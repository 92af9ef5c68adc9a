"""Words beside points: where they stand, and what they keep off."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from contbreather.plotting.canvas import lay_out, place_words

POINT = 100.0 / 72.0  # pixels, at the resolution of the figure below


@pytest.fixture
def ax() -> Axes:
    """Axes whose data are typographic points from their lower left corner: 300 x 200."""
    figure = Figure(figsize=(350 / 72, 250 / 72), dpi=100)
    axes = figure.add_axes((25 / 350, 25 / 250, 300 / 350, 200 / 250))
    axes.set_xlim(0, 300)
    axes.set_ylim(0, 200)
    return axes


def box(ax: Axes, word) -> np.ndarray:
    """Left, lower, right and upper end of a word, in points."""
    corners = np.asarray(word.get_window_extent().get_points())
    return ax.transData.inverted().transform(corners).ravel()


def placed(ax: Axes, *words: tuple) -> list:
    """Write words, (x, y) or (x, y, text, style): what was written."""
    before = len(ax.texts)
    place_words(ax, lay_out(ax), [(*word, *("word", {})[len(word) - 2 :]) for word in words])
    return ax.texts[before:]


def stands(ax: Axes, x: float, y: float, *others: tuple) -> np.ndarray:
    """Where a word stands, its middle relative to its point."""
    left, low, right, high = box(ax, placed(ax, (x, y), *others)[0])
    return np.array([(left + right) / 2 - x, (low + high) / 2 - y])


def test_a_word_stands_to_the_upper_right_close_by(ax: Axes) -> None:
    (word,) = placed(ax, (150, 100))
    left, low, *_ = box(ax, word)
    assert 0.0 < left - 150 < 6.0
    assert 0.0 < low - 100 < 6.0
    assert word.get_text() == "word"
    assert word.xy == (150, 100)
    assert len(ax.texts) == 1


@pytest.mark.parametrize(
    ("x", "y", "way"),
    [(298, 100, (-1, 0)), (150, 198, (0, -1)), (298, 198, (-1, -1)), (2, 2, (1, 1))],
)
def test_a_word_stays_inside_the_axes(ax: Axes, x: float, y: float, way) -> None:
    (word,) = placed(ax, (x, y, "a longer word", {}))
    left, low, right, high = box(ax, word)
    assert left >= 2.9
    assert low >= 2.9
    assert right <= 297.1
    assert high <= 197.1
    middle = np.array([(left + right) / 2 - x, (low + high) / 2 - y])
    for offset, side in zip(middle, way, strict=True):
        assert offset * side > 0 or side == 0


@pytest.mark.parametrize(
    ("x", "y", "seen"),
    [
        (-3, 100, False), (303, 100, False), (150, -3, False), (150, 203, False),
        (-3, -3, False), (303, 203, False),
        (-1, 100, True), (301, 100, True), (150, -1, True), (150, 201, True),
    ],
)  # fmt: skip
def test_a_point_outside_of_the_axes_gets_no_word(ax: Axes, x, y, seen: bool) -> None:
    assert len(placed(ax, (x, y))) == seen


def test_a_word_keeps_off_a_curve(ax: Axes) -> None:
    plain = stands(ax, 150, 100)
    for one in list(ax.texts):
        one.remove()
    ax.plot([150, 250], [100, 100 + 100 * plain[1] / plain[0]])  # right through that place
    assert np.hypot(*(stands(ax, 150, 100) - plain)) > 5.0


def test_a_word_that_finds_room_far_off_alone_is_led_to_its_point(ax: Axes) -> None:
    turn = np.linspace(0.0, 2.0 * np.pi, 200)
    ax.plot(150 + 12 * np.cos(turn), 100 + 12 * np.sin(turn), linewidth=20)
    word, leader = placed(ax, (150, 100))
    assert (leader.get_text(), leader.xy) == ("", (150, 100))
    left, low, right, high = box(ax, word)
    nearest = np.clip((150, 100), (left, low), (right, high))
    assert np.hypot(*(nearest - (150, 100))) > 20.0  # off the thick line, not its middle alone
    assert np.add(leader.xy, leader.get_position()) == pytest.approx(nearest, abs=2.0)


def test_eight_words_of_one_place_and_a_legend_keep_off_each_other(ax: Axes) -> None:
    boxes = [box(ax, word) for word in placed(ax, *(8 * [(150, 100)]))]
    for i, one in enumerate(boxes):
        for other in boxes[:i]:
            apart = (one[:2] >= other[2:]).any() or (other[:2] >= one[2:]).any()
            assert apart
    ax.plot([0, 1], [0, 0], label="a legend of some length")
    left, low, *_ = there = box(ax, ax.legend(loc="upper right"))
    word = box(ax, placed(ax, (left, low))[0])
    assert (word[:2] >= there[2:]).any() or (there[:2] >= word[2:]).any()


def test_a_word_does_not_stand_beside_another_point_that_has_one(ax: Axes) -> None:
    plain = stands(ax, 150, 100)
    for one in list(ax.texts):
        one.remove()
    other = 150 + plain[0], 100 + plain[1]
    left, low, right, high = box(ax, placed(ax, (150, 100), other)[0])
    assert left > other[0] or low > other[1] or right < other[0] or high < other[1]
    for one in list(ax.texts):
        one.remove()
    # the point itself, from two curves, is no other one
    assert stands(ax, 150, 100, (150, 100)) == pytest.approx(plain)
