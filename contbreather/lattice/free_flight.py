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
    w = np.ones((POWERS, TERMS + 1))  # rows: powers of y; columns: of w^2
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

    def at(self, y: Any) -> tuple[Any, Any, Any]:
        """Displacement, velocity and acceleration; at y = -pi/2 the velocity just after the impact,
        at pi/2 just before the next."""
        z, (c, s) = y * y, cosine_and_sine(y)
        P, dP, bend, _ = polynomial(self.powers, z)
        c, s = self.first * c, self.first * s
        return P * y - s, P + 2.0 * z * dP - c, (6.0 * dP + 8.0 * z * bend) * y + s


def polynomial(powers: tuple[float, ...], z: Any) -> tuple[Any, Any, Any, Any]:
    """A polynomial and its first three derivatives, the second over 2, the third over 6; its
    coefficients by rising powers."""
    P = dP = bend = jerk = 0.0
    for c in reversed(powers):
        jerk = jerk * z + bend
        bend = bend * z + dP
        dP = dP * z + P
        P = P * z + c
    return P, dP, bend, jerk


def cosine_and_sine(y: Any) -> tuple[Any, Any]:
    return (math.cos(y), math.sin(y)) if isinstance(y, float) else (np.cos(y), np.sin(y))


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
    >>> round(answer.at(-math.pi / 2)[0] - chain.chi(0.12), 14)
    0.0
    >>> slope = free_flight(float(chain.dfirst_harmonic(0.12, 0)), chain.dpowers(0.12, 0))
    >>> round(slope.at(-math.pi / 2)[0] - chain.dchi(0.12), 13)
    0.0
    """
    return FreeFlight(4.0 / math.pi * first_harmonic, tuple((response_weights() @ powers).tolist()))
