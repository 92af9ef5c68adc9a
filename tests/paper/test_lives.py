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
BOTH = {i: [(i, 0, 1), (i, 0, -1)] for i in range(8)}


@pytest.mark.parametrize(
    ("rows", "more", "ends"),
    [
        (KEPT, {}, []),
        ([(i, n, -wall) for i, n, wall in KEPT], {}, []),  # whichever wall comes first
        # one slips over the end of a period
        ([*BOTH[0], (0, 0, 1), (1, 0, -1), *BOTH[2], *BOTH[3]], {}, []),
        ([*BOTH[0], (1, 0, 1), *BOTH[2], *BOTH[3]], {}, [2]),  # a wall that is missed
        ([*BOTH[0], *BOTH[2]], {}, [1, 3]),  # periods without an impact
        ([*KEPT[:4], (1, 3, 1), *KEPT[4:]], {}, [1]),  # an impact of another site
        # a stretch of a recording knows the wall before it
        ([row for i in range(4, 8) for row in BOTH[i]], {"first": 4, "wall": -1}, []),
        ([row for i in range(4, 8) for row in BOTH[i]], {"first": 4, "wall": 1}, [0]),
    ],
)
def test_a_breather_alternates_between_its_walls_alone(rows, more, ends) -> None:
    found = unlike_a_breather(table(*rows), 4, **more)
    assert np.flatnonzero(found).tolist() == ends
