"""Events of a periodic motion that its own equations do not see: PF, PD and NS, by multipliers."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contbreather.continuation import Event, Point
from contbreather.stability.pairs import beyond, outermost

Array = NDArray[Any]
Matrix = Callable[[Point], Array]

ON_CIRCLE = 1e-6  # how close to 1 the modulus of a pair is at a located point


def pitchfork(matrix: Matrix) -> Event:
    """PF of a symmetric motion: the multiplier +1 of its half map, where the equations are regular.

    Over half a period a symmetric motion comes back with its sign changed, so that its own
    equations are singular at the multiplier -1, the fold.
    """
    return _real("PF", matrix, 1.0)


def period_doubling(matrix: Matrix) -> Event:
    """PD of any other motion: the multiplier -1 over its period."""
    return _real("PD", matrix, -1.0)


def _real(kind: str, matrix: Matrix, mu: float) -> Event:
    # two that pass within one step, as the even and the odd ones of a ring do, leave no change of
    # sign, but a count
    return Event(
        kind,
        lambda point: _passes(matrix(point), mu),
        count=lambda point: beyond(np.linalg.eigvals(matrix(point)), mu),
    )


def neimark_sacker(matrix: Matrix) -> Event:
    """NS: the first complex pair of multipliers leaves the unit circle.

    Without damping the pairs of a ring lie on the circle, or as close to it as they are long, and
    which is outside is no event: nothing is looked for there.
    """

    def test(point: Point) -> float:
        if point.params["damping"] == 0.0:
            return math.nan
        return outermost(np.linalg.eigvals(matrix(point)))

    def examine(point: Point) -> str:
        beyond = test(point)
        if abs(beyond) < ON_CIRCLE:
            return ""
        return f"the outermost complex pair has the modulus 1 {beyond:+.2g}: it has become real"

    return Event("NS", test, examine=examine)


def tally(matrix: Matrix, slack: float) -> Event:
    """What no label explains: the number of multipliers outside changes, on a damped ring."""

    def outside(point: Point) -> float | int:
        if point.params["damping"] == 0.0:
            return math.nan
        return int(np.count_nonzero(np.abs(np.linalg.eigvals(matrix(point))) > 1.0 + slack))

    return Event("MX", None, count=outside)


def _passes(matrix: Array, mu: float) -> float:
    """Distance of the nearest multiplier from mu, with the sign of det(M - mu).

    The sign changes only where a real multiplier passes mu, and there the distance is zero: a
    continuous test, which no number of sites makes overflow.
    """
    multipliers = np.linalg.eigvals(matrix)
    real = multipliers[multipliers.imag == 0.0].real
    sign = -1.0 if np.count_nonzero(real < mu) % 2 else 1.0
    return sign * float(np.abs(multipliers - mu).min())
