"""The impact's effect on small perturbations, eq. (19): one 2x2 block, at the impacting site."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from contbreather.checks import brief, number, real
from contbreather.errors import BadInput


class Saltation(NamedTuple):
    """One impact as a perturbation feels it: where, when, and the entry b of (19), in units of a
    speed: with that at which the site comes to its wall nothing has a pole where an impact
    vanishes."""

    site: int
    time: float
    b: float
    speed: float = 1.0  # the entry times this is b


def check_finite(k: float, b: float, what: str = "b") -> None:
    """Refuse what is not a finite number; of any size, as Newton's method may leave the domain."""
    number("k", k, -math.inf, math.inf, "a restitution coefficient")
    number(what, b, -math.inf, math.inf, "a number of either sign")


def saltation(k: float, b: float) -> NDArray[np.float64]:
    """The 2x2 block ``[[-k, 0], [b, -k]]`` of (19) acting on (u_0, u_0'); all else is identity."""
    check_finite(k, b)
    return np.array([[-k, 0.0], [b, -k]])


def saltation_entry(acceleration: float, w_minus: float, k: float) -> float:
    """``b = (1 + k) u_0''/u_0'``, both just before the impact, eq. (19).

    For the symmetric breather ``w_minus = 2p/(1+k)`` and ``acceleration = f''(phi) - p eta``, so
    that ``b = (1+k)^2 [f''(phi) - p eta]/(2p)``.

    Examples
    --------
    >>> saltation_entry(-0.25, 0.5, 0.8)
    -0.9
    """
    check_finite(k, acceleration, "acceleration")
    if not 0.0 < abs(real(w_minus)) < math.inf:
        raise BadInput(f"w_minus = {brief(w_minus)}: a finite velocity other than 0 was expected.")
    # a smaller u meets the wall later: b = (u_after'' + k u_before'')/u', and without damping the
    # forces do not jump with the velocity, so that both are u_0''
    return (1.0 + k) * acceleration / w_minus
