"""Words beside points: where they stand, what they keep off, and when a line ties them."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from contbreather.plotting.canvas import Labels, place_words

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


def stands(ax: Axes, x: float, y: float, **more) -> np.ndarray:
    """Where a word stands, its middle relative to its point."""
    labels = more.pop("labels", None) or Labels(ax)
    left, low, right, high = box(ax, labels.place(x, y, "word", **more))
    return np.array([(left + right) / 2 - x, (low + high) / 2 - y])


def test_a_word_stands_to_the_upper_right_close_by(ax: Axes) -> None:
    word = Labels(ax).place(150, 100, "word")
    left, low, *_ = box(ax, word)
    assert 0.0 < left - 150 < 6.0
    assert 0.0 < low - 100 < 6.0
    assert word.get_text() == "word"
    assert word.xy == (150, 100)
    assert len(ax.texts) == 1  # no line leads to it


@pytest.mark.parametrize(
    ("x", "y", "way"),
    [(298, 100, (-1, 0)), (150, 198, (0, -1)), (298, 198, (-1, -1)), (2, 2, (1, 1))],
)
def test_a_word_stays_inside_the_axes(ax: Axes, x: float, y: float, way) -> None:
    word = Labels(ax).place(x, y, "a longer word")
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
    word = Labels(ax).place(x, y, "word")
    assert (word is not None) == seen
    assert len([one for one in ax.texts if one.get_text()]) == seen


def test_a_word_keeps_off_a_curve(ax: Axes) -> None:
    plain = stands(ax, 150, 100)
    labels = Labels(ax)
    labels.avoid([150, 250], [100, 100 + 100 * plain[1] / plain[0]])  # right through that place
    away = stands(ax, 150, 100, labels=labels)
    assert np.hypot(*(away - plain)) > 5.0


def test_points_and_gaps_of_a_curve_are_kept_off_too(ax: Axes) -> None:
    plain = stands(ax, 150, 100)
    where = 150 + plain[0], 100 + plain[1]
    for x, y in (
        (where[0], where[1]),
        ([where[0], where[0]], [where[1], where[1]]),
        ([np.nan, where[0], np.nan], [1.0, where[1], np.inf]),
    ):
        labels = Labels(ax)
        labels.avoid(x, y)
        assert np.hypot(*(stands(ax, 150, 100, labels=labels) - plain)) > 3.0
    labels = Labels(ax)
    labels.avoid([np.nan], [0.0])
    assert labels.curves == []
    assert stands(ax, 150, 100, labels=labels) == pytest.approx(plain)


def test_a_word_keeps_off_other_words_and_the_legend(ax: Axes) -> None:
    labels = Labels(ax)
    boxes = [box(ax, labels.place(150, 100, f"word {i}")) for i in range(8)]
    for i, one in enumerate(boxes):
        for other in boxes[:i]:
            apart = (one[:2] >= other[2:]).any() or (other[:2] >= one[2:]).any()
            assert apart
    ax.plot([0, 1], [0, 0], label="a legend of some length")
    legend = ax.legend(loc="upper right")
    labels = Labels(ax)
    labels.keep_off([None, legend])
    left, low, *_ = box(ax, legend)
    word = box(ax, labels.place(left, low, "word"))
    assert (word[:2] >= box(ax, legend)[2:]).any() or (box(ax, legend)[:2] >= word[2:]).any()


def test_a_word_far_from_its_point_is_tied_to_it_in_its_colour(ax: Axes) -> None:
    labels = Labels(ax)
    for i in range(20):
        labels.place(150, 100, f"word {i}", color="tab:red")
    words = [one for one in ax.texts if one.get_text()]
    lines = [one for one in ax.texts if not one.get_text()]
    assert len(words) == 20
    assert 0 < len(lines) < 20
    boxes = [box(ax, word) for word in words]
    for line in lines:
        assert line.xy == (150, 100)
        assert line.arrow_patch is not None
        assert line.arrowprops["color"] == "tab:red"
        assert line.arrowprops["arrowstyle"] == "-"
        # it ends at the nearest place of a word
        end = np.add(line.xyann, (150, 100))
        gaps = [np.maximum(np.maximum(b[:2] - end, end - b[2:]), 0.0) for b in boxes]
        assert min(np.hypot(*gap) for gap in gaps) < 2.5


def test_a_word_does_not_stand_beside_another_announced_point(ax: Axes) -> None:
    plain = stands(ax, 150, 100)
    labels = Labels(ax)
    other = 150 + plain[0], 100 + plain[1]
    labels.announce(*other)
    away = box(ax, labels.place(150, 100, "word"))
    assert (away[:2] > other).any() or (away[2:] < other).any()
    labels = Labels(ax)
    labels.announce([150, 150], [100, 100])  # the point itself, from two curves, is no other one
    assert stands(ax, 150, 100, labels=labels) == pytest.approx(plain)


def test_words_of_finished_axes_keep_off_what_is_drawn(ax: Axes) -> None:
    plain = stands(ax, 150, 100)
    for one in list(ax.texts):
        one.remove()
    ax.plot([150, 250], [100, 100 + 100 * plain[1] / plain[0]])
    ax.text(150 - plain[0], 100 + plain[1], "XXXXXX", ha="center", va="center")
    place_words(ax, iter([(150, 100, "one"), (150, 100, "two"), (400, 100, "out")]), color="red")
    found = [one for one in ax.texts if one.get_color() == "red" and one.get_text()]
    assert [one.get_text() for one in found] == ["one", "two"]
    boxes = [box(ax, one) for one in ax.texts if one.get_text()]
    for i, one in enumerate(boxes):
        for other in boxes[:i]:
            assert (one[:2] >= other[2:]).any() or (other[:2] >= one[2:]).any()
    for one in found:
        left, low, right, high = box(ax, one)
        x = np.linspace(150, 250, 500)
        y = 100 + (x - 150) * plain[1] / plain[0]
        assert not ((x > left) & (x < right) & (y > low) & (y < high)).any()
