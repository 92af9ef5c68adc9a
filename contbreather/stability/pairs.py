"""Multipliers of a finite lattice next to a circle: what events of real ones and of pairs test."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

REAL = 1e-8  # a multiplier with a smaller imaginary part counts as real


def beyond(mu: Array, place: float) -> int:
    """How many real multipliers are farther out than a place on the real axis, on its side."""
    real = mu[mu.imag == 0.0].real
    return int(np.count_nonzero(real > place if place > 0.0 else real < place))


def outermost(mu: Array, radius: float = 1.0) -> float:
    """By how much the first pair has left a circle, negative where none has; NaN if there is none.

    For rings, where one pair after the other follows the first and tells nothing new.
    """
    pairs = np.abs(mu[mu.imag > 0.0])
    return float(pairs.max()) / radius - 1.0 if pairs.size else math.nan


def upper(mu: Array) -> Array:
    """Complex ones in the upper half plane; those of modes without impacts never leave."""
    return np.asarray(mu[mu.imag > REAL])


def farthest(mu: Array) -> float:
    """Angle, over pi, of the complex pair with the largest modulus; NaN if there is none."""
    pairs = upper(mu)
    return float(np.angle(pairs[abs(pairs).argmax()])) / math.pi if pairs.size else math.nan
