"""When a breather is lost, told by its impacts alone: on tables made by hand."""

from __future__ import annotations

import numpy as np
import pytest

from contbreather.dynamics.stretches import IMPACT
from contbreather.paper.fates import unlike_a_breather


def table(*rows: tuple[int, int, int]) -> np.ndarray:
    """Impacts as (period, site, wall)."""
    found = np.zeros(len(rows), IMPACT)
    for one, (period, site, wall) in zip(found, rows, strict=True):
        one["period"], one["site"], one["wall"] = period, site, wall
    return found


KEPT = [(i, 0, wall) for i in range(4) for wall in (1, -1)]


@pytest.mark.parametrize("first_wall", [1, -1])
def test_a_site_that_alternates_between_its_walls_is_a_breather(first_wall: int) -> None:
    """Whichever wall comes first: before the first impact there was none."""
    impacts = table(*((i, 0, first_wall * wall) for i, _, wall in KEPT))
    assert unlike_a_breather(impacts, 4).tolist() == [False] * 4


def test_an_impact_may_slip_over_the_end_of_a_period() -> None:
    impacts = table((0, 0, 1), (0, 0, -1), (0, 0, 1), (1, 0, -1), (2, 0, 1), (2, 0, -1))
    assert unlike_a_breather(impacts, 3).tolist() == [False] * 3


def test_a_wall_that_is_missed_ends_it_in_that_period() -> None:
    impacts = table((0, 0, 1), (0, 0, -1), (1, 0, 1), (2, 0, 1), (2, 0, -1))
    assert unlike_a_breather(impacts, 3).tolist() == [False, False, True]


def test_a_period_without_an_impact_ends_it() -> None:
    impacts = table((0, 0, 1), (0, 0, -1), (2, 0, 1), (2, 0, -1))
    assert unlike_a_breather(impacts, 4).tolist() == [False, True, False, True]


def test_an_impact_of_another_site_ends_it() -> None:
    impacts = table(*KEPT[:4], (1, 3, 1), *KEPT[4:])
    assert unlike_a_breather(impacts, 4).tolist() == [False, True, False, False]


def test_a_stretch_of_a_recording_knows_the_wall_before_it() -> None:
    impacts = table((7, 0, 1), (7, 0, -1))
    assert unlike_a_breather(impacts, 1, first=7, wall=-1).tolist() == [False]
    assert unlike_a_breather(impacts, 1, first=7, wall=1).tolist() == [True]
