"""Forced response and propagator: how the lattice moves while nothing hits a wall.

The answer of site n to the impacts of site 0, over half a period, is
``<cos(n theta) sin(w (pi/2 - s))/(w cos(pi w/2))>``. The harmonic that drives the band's edge,
cos s, is kept exact; everything else is a power series in ``w^2`` whose coefficients are
polynomials of the time from mid flight, ``y = s - pi/2``:

    ``v_n = (4/pi) [ -g sin y + sum over j of <w^(2j) cos(n theta)> P_j(y) ]``,
    ``P_j(y) = sum over i of (-1)^i y^(2i+1)/(2i+1)! W_ij``,
    ``W_ij = 1 - beta(2(j-i)+1)`` for i <= j, else 1 (beta: Dirichlet's, from sec(pi w/2)).

``P_j`` falls like ``9^-j``, so one odd polynomial of degree 25 in y holds all of it, to rounding,
for displacement, velocity and acceleration alike, impacts included.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contbreather.lattice.zeta import zeta

FloatArray = NDArray[np.float64]

TERMS = 18  # powers of w^2: 9^-18 < 1e-17, the rest is below rounding
POWERS = 13  # odd powers of y: (pi/2)^27/27! < 1e-22


@lru_cache(maxsize=1)
def response_weights() -> FloatArray:
    """``(4/pi) (-1)^i W_ij/(2i+1)!``, shape (POWERS, TERMS + 1)."""
    order = 2.0 * np.arange(1, TERMS + 1) + 1.0
    # 1 - beta(s) = 3^-s - 5^-s + 7^-s ...: without the cancellation of the difference
    gap = np.concatenate(
        [[1.0 - 0.25 * math.pi], 4.0**-order * (zeta(order, 0.75) - zeta(order, 1.25))]
    )
    w = np.ones((POWERS, TERMS + 1))
    for i in range(POWERS):
        w[i, i:] = gap[: max(0, TERMS + 1 - i)]
        w[i] *= (-1.0) ** i * 4.0 / (math.pi * math.factorial(2 * i + 1))
    return w


@dataclass(frozen=True, slots=True)
class FreeFlight:
    """One site between two impacts of site 0, per unit p, as a function of ``y = s - pi/2``.

    ``first`` is the amplitude of -sin y, ``powers`` the coefficients of y, y^3, ... Values
    for floats and for arrays alike; floats never touch numpy.
    """

    first: Any  # a float, or one for each of many sites with the same powers
    powers: tuple[float, ...]

    def value(self, y: Any) -> Any:
        """Displacement."""
        z, total = y * y, 0.0
        for c in self.powers[::-1]:
            total = total * z + c
        return total * y - self.first * _sin(y)

    def slope(self, y: Any) -> Any:
        """Velocity; at y = -pi/2 the one just after the impact, at pi/2 just before the next."""
        z, total = y * y, 0.0
        for i in range(len(self.powers) - 1, -1, -1):
            total = total * z + (2 * i + 1) * self.powers[i]
        return total - self.first * _cos(y)

    def curvature(self, y: Any) -> Any:
        """Acceleration."""
        z, total = y * y, 0.0
        for i in range(len(self.powers) - 1, 0, -1):
            total = total * z + (2 * i + 1) * (2 * i) * self.powers[i]
        return total * y + self.first * _sin(y)

    def at(self, y: float) -> tuple[float, float, float]:
        """All three, in one pass."""
        z, c, s = y * y, self.first * math.cos(y), self.first * math.sin(y)
        total = slope = bend = 0.0  # of a polynomial in z, with half its second derivative
        for power in self.powers[::-1]:
            bend = bend * z + slope
            slope = slope * z + total
            total = total * z + power
        return total * y - s, total + 2.0 * z * slope - c, (6.0 * slope + 8.0 * z * bend) * y + s


def _sin(y: Any) -> Any:
    return math.sin(y) if isinstance(y, float) else np.sin(y)


def _cos(y: Any) -> Any:
    return math.cos(y) if isinstance(y, float) else np.cos(y)


def free_flight(first_harmonic: float, powers: FloatArray) -> FreeFlight:
    """The `FreeFlight` of a site from what its lattice says of it, or its slope in any parameter
    from the slopes of both.

    Parameters
    ----------
    first_harmonic : float
        ``<cos(n theta)/(1 - w^2)>``.
    powers : ndarray, shape (TERMS + 1,)
        ``<w^2j cos(n theta)>``.

    Examples
    --------
    >>> from contbreather.lattice.chain import InfiniteChain
    >>> chain = InfiniteChain()
    >>> answer = free_flight(float(chain.first_harmonic(0.12, 0)), chain.powers(0.12, 0))
    >>> round(answer.value(-math.pi / 2) - chain.chi(0.12), 14)
    0.0
    >>> slope = free_flight(float(chain.dfirst_harmonic(0.12, 0)), chain.dpowers(0.12, 0))
    >>> round(slope.value(-math.pi / 2) - chain.dchi(0.12), 13)
    0.0
    """
    return FreeFlight(4.0 / math.pi * first_harmonic, tuple((response_weights() @ powers).tolist()))
