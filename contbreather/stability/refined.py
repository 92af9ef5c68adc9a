"""Samples of a curve around zero, so close that its turning can be told."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

TURN = 0.6  # largest step between neighbouring samples, relative to their modulus
DEPTH = 40  # halvings of one interval
MOST = 2**12  # samples of one piece: one that asks for more has a zero on it, or is rounding


def refined(
    x: Array,
    place: Callable[[Array], Array],
    value: Callable[[Array], Array],
    floor: float,
    most: int = MOST,
) -> tuple[Array, Array, bool]:
    """Samples put closer wherever the function moves by much of its modulus, unless that is nothing
    but rounding, below the floor: about a zero on the circle itself. With several sites F has more
    rounding than its terms tell, so that the samples are bounded as well; were they enough?"""
    F = value(place(x))
    for _ in range(DEPTH):
        size = np.abs(F)
        steep = np.abs(F[1:] - F[:-1]) > TURN * np.minimum(size[1:], size[:-1])
        steep &= np.maximum(size[1:], size[:-1]) > floor
        wide = steep.copy()
        wide[1:] |= steep[:-1]
        wide[:-1] |= steep[1:]
        i = np.flatnonzero(wide & (x[1:] - x[:-1] > 1e-13))
        if i.size == 0:
            break
        if x.size + i.size > most:
            return x, F, False
        between = 0.5 * (x[i] + x[i + 1])
        x, F = np.insert(x, i + 1, between), np.insert(F, i + 1, value(place(between)))
    return x, F, True
