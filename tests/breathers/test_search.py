"""Breathers and special points that are found without a start."""

from __future__ import annotations

import numpy as np
import pytest

import contbreather as cb
from contbreather.breathers import find_event, find_symmetric

WHERE = {"gamma": (0.0, 0.24), "a": (0.86, 0.95)}


def test_search_goes_on_where_there_is_no_breather() -> None:
    # at the coupling in the middle of the window, where it looks first, there is none
    with pytest.raises(cb.NoSolution, match=r"no breather with gamma = 0\.12"):
        find_symmetric("a", WHERE["a"], gamma=0.12, k=0.8)
    point = find_event("GR", ("gamma", "a"), within=WHERE, k=0.8)
    assert point.solution.admissibility().margin == pytest.approx(0.0, abs=1e-12)
    assert WHERE["a"][0] < point["a"] < WHERE["a"][1]


def test_what_is_found_of_a_kind_that_is_not_there_is_named() -> None:
    # the pitchforks of k = 0.8 end at a = 0.8687, on the grazing curve
    with pytest.raises(cb.NoSolution, match=r"no PF found for gamma between 0 and 0\.24"):
        find_event("PF", ("gamma", "a"), within=WHERE, k=0.8)


def test_nothing_is_printed_while_searching(capsys: pytest.CaptureFixture[str]) -> None:
    find_event("LP", ("gamma", "a"), gamma=0.04, k=0.8)
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize("free", ["a", "gamma"])
def test_breather_that_is_found_is_admissible_and_inside_of_the_window(free: str) -> None:
    window = {"a": (0.3, 0.4), "gamma": (0.05, 0.06)}
    other = next(name for name in window if name != free)
    found = find_symmetric(free, window[free], k=0.8, **{other: float(np.mean(window[other]))})
    assert found.admissibility().ok
    assert window[free][0] <= getattr(found, free) <= window[free][1]
