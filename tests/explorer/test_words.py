"""Words in a figure of the explorer do not cover each other."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

pytest.importorskip("panel")

from contbreather.explorer.views import LETTER, LINE, spread


def test_words_in_a_crowd_do_not_cover_each_other_and_none_stands_twice() -> None:
    rng = np.random.default_rng(3)
    x, y = rng.uniform(0.0, 120.0, 40), rng.uniform(0.0, 120.0, 40)
    x[20], y[20] = x[3] + 2.0, y[3]
    words = [f"PF{i % 20}" for i in range(40)]  # number 20 is number 0 again, at another place
    words[20] = words[3]
    found = spread(x, y, words)
    shown = [i for i, word in enumerate(found["text"]) if word]
    left, base = x + found["dx"], y + found["dy"]
    for i, j in itertools.combinations(shown, 2):
        apart = abs(base[i] - base[j]) >= LINE
        first, second = sorted((i, j), key=lambda k: left[k])
        assert apart or left[first] + LETTER * len(words[first]) <= left[second]
    assert len(shown) > 12
    assert not found["text"][20]
    assert all(np.hypot(found["dx"][i], found["dy"][i]) < 7 + 5 * LETTER for i in shown)


def test_a_word_alone_stands_to_the_upper_right() -> None:
    assert spread(np.array([5.0]), np.array([5.0]), ["LP1"]) == {
        "text": ["LP1"], "dx": [7.0], "dy": [-5.0],
    }  # fmt: skip


def test_a_word_stays_inside_the_figure() -> None:
    place = spread(np.array([95.0]), np.array([50.0]), ["LP1"], 100.0)
    assert place["text"] == ["LP1"]
    assert place["dx"][0] < 0.0
