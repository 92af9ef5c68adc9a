"""Multipliers of a finite lattice next to a circle: what events of real ones and of pairs test."""

from __future__ import annotations

import math
from collections.abc import Callable
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


def passing(mu: Array, radius: float = 1.0) -> tuple[float, int]:
    """How far off a circle the nearest pair is, with a sign that changes wherever one passes it,
    positive where none is outside, NaN if there is none; and how many are outside."""
    off = np.abs(mu[mu.imag > 0.0]) / radius - 1.0
    outside = int(np.count_nonzero(off > 0.0))
    return (-1.0) ** outside * float(abs(off).min()) if off.size else math.nan, outside


def upper(mu: Array) -> Array:
    """Complex ones in the upper half plane; those of modes without impacts never leave."""
    return np.asarray(mu[mu.imag > REAL])


def farthest(mu: Array) -> float:
    """Angle, over pi, of the complex pair with the largest modulus; NaN if there is none."""
    return _angle(mu, abs)


def nearest(mu: Array, radius: float) -> float:
    """The same of the pair that is nearest to a circle."""
    return _angle(mu, lambda pairs: -abs(abs(pairs) - radius))


def _angle(mu: Array, by: Callable[[Array], Array]) -> float:
    pairs = upper(mu)
    return float(np.angle(pairs[by(pairs).argmax()])) / math.pi if pairs.size else math.nan
