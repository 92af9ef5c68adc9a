"""Multipliers of a finite lattice next to a circle: what events of real ones and of pairs test."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]


def beyond(mu: Array, place: float) -> int:
    """How many real multipliers are farther out than a place on the real axis, on its side."""
    real = mu[mu.imag == 0.0].real
    return int(np.count_nonzero(real > place if place > 0.0 else real < place))


def pair_gap(mu: Array, radius: float = 1.0) -> tuple[float, int]:
    """By how much the pair next to a circle misses it, and how many pairs are outside.

    The gap has the sign of the product of all: it changes where one pair passes the circle. Two
    real multipliers whose product is ``radius^2`` count as well, so that nothing changes where a
    pair turns real; such a neutral saddle has to be told apart afterwards. NaN if there are none.

    Examples
    --------
    >>> gap, outside = pair_gap(np.array([1.0 + 0.5j, 1.0 - 0.5j, 0.25 + 0.0j]))
    >>> round(gap, 12), outside
    (-0.25, 1)
    """
    real = mu[mu.imag == 0.0].real
    first, second = np.triu_indices(real.size, 1)
    pairs = mu[mu.imag > 0.0]
    gaps = radius**2 - np.concatenate([np.abs(pairs) ** 2, real[first] * real[second]])
    if not gaps.size:
        return math.nan, 0
    outside = int(np.count_nonzero(gaps < 0.0))
    return (-1.0 if outside % 2 else 1.0) * float(np.abs(gaps).min()), outside


def outermost(mu: Array, radius: float = 1.0) -> float:
    """By how much the first pair has left a circle, negative where none has; NaN if there is none.

    For rings, where one pair after the other follows the first and tells nothing new.
    """
    pairs = np.abs(mu[mu.imag > 0.0])
    return float(pairs.max()) / radius - 1.0 if pairs.size else math.nan
