"""Sums over the odd, the even, all the later numbers to a power: Hurwitz's zeta function.

Every expansion here ends in such sums. `scipy.special` has them, too, but takes longer to be
imported than a breather takes to be found, stability included.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

TERMS = 18  # powers of w^2 that expansions keep: 9^-18 < 1e-17, the rest is below rounding
FIRST = 12  # terms that are added up as they are
# B_2k/(2k)! of the formula of Euler and Maclaurin for all others: 12^-20 is far below rounding
REST = (
    1 / 12,
    -1 / 720,
    1 / 30240,
    -1 / 1209600,
    1 / 47900160,
    -691 / 1307674368000,
    1 / 74724249600,
    -3617 / 10670622842880000,
)


def zeta(s: ArrayLike, first: float = 1.0) -> Any:
    """``sum over n >= 0 of (first + n)^-s`` for s > 1 and ``first >= 1/2``, to rounding."""
    s = np.asarray(s, dtype=float)
    end = first + FIRST
    total = end**-s * (0.5 + end / (s - 1.0))
    factor = s * end ** (-s - 1.0)
    for k, weight in enumerate(REST):
        total += weight * factor
        factor = factor * (s + 2 * k + 1) * (s + 2 * k + 2) / end**2
    for n in range(FIRST - 1, -1, -1):  # the smallest first
        total += (first + n) ** -s
    return total[()]


def binomial(n: ArrayLike, m: ArrayLike) -> NDArray[np.float64]:
    """``n!/(m! (n - m)!)`` of whole numbers; 0 where n is negative."""
    whole = np.vectorize(lambda n, m: math.comb(n, m) if n >= 0 else 0, otypes=[float])
    return np.asarray(whole(n, m))


def bernoulli(p: int, over: float = 1.0) -> NDArray[np.float64]:
    """The sum over j >= 1 of cos(js)/j^p, p even, or sin(js)/j^p, p odd, is a polynomial of
    Bernoulli's: its coefficients by powers of ``y = pi - s``, over a number."""
    odd, coefficients = p % 2, np.zeros(p + 1)
    for power in range(odd, p + 1, 2):
        r = p - power  # sum over j of (-1)^(j-1)/j^r
        alternating = 0.5 if r == 0 else (1.0 - 2.0 ** (1 - r)) * zeta(r)
        sign = (-1) ** ((power + odd) // 2)
        coefficients[power] = -sign * alternating / (over * math.factorial(power))
    return coefficients
