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
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from contbreather.kernels import Cube, Kernel, Matrix, Table, Vector, fixed, inlined
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


@dataclass(frozen=True, eq=False, repr=False, slots=True)
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


# --- responses to impacts that recur, from a table of coefficients, as kernels take them ----------


@fixed
class Responses(NamedTuple):
    """Functions of the time y from the middle between two impacts, in units of n:

        ``P(y^2) + A cos y + B cos 2y + sum over i of C_i cos(W_i y) + D_i y sin(W_i y)``

    after 2 pi n, or, of an orbit whose impacts recur with the other sign after half a period,
    ``y P(y^2) + A sin y``.
    """

    which: Table  # row of the table for each site and impact
    table: Matrix  # coefficients of P, that of the highest power first, then A and B
    waves: Vector  # W
    even: Matrix  # C, a row for each of the table
    odd: Matrix  # D
    largest: Vector  # no less than all values of each row
    turns: float  # n
    half: bool  # impacts recur after half a period


@inlined
def response_since(
    responses: Responses, row: int, since: float
) -> tuple[float, float, float, float]:
    """Value and three derivatives at a time since an impact, those just after it."""
    table, n = responses.table, responses.turns
    width = math.pi if responses.half else 2.0 * math.pi
    s = since / n
    past = math.floor(s / width)
    y = s - width * past - 0.5 * width
    z, powers = y * y, table.shape[1] - 2
    P = dP = bend = jerk = 0.0  # a polynomial in z; derivatives over 1, 2 and 6
    for i in range(powers):
        jerk = jerk * z + bend
        bend = bend * z + dP
        dP = dP * z + P
        P = P * z + table[row, i]
    A, B, c, s = table[row, powers], table[row, powers + 1], math.cos(y), math.sin(y)
    if responses.half:
        flip = -1.0 if past % 2 != 0 else 1.0
        h, dh, d2h = (
            y * P + A * s,
            P + 2.0 * z * dP + A * c,
            y * (6.0 * dP + 8.0 * z * bend) - A * s,
        )
        d3h = 6.0 * dP + 48.0 * z * (bend + z * jerk) - A * c
        return flip * h, flip * dh, flip * d2h, flip * d3h
    c2, s2 = 2.0 * c * c - 1.0, 2.0 * c * s
    h, dh = P + A * c + B * c2, 2.0 * y * dP - A * s - 2.0 * B * s2
    d2h = 2.0 * dP + 8.0 * z * bend - A * c - 4.0 * B * c2
    d3h = 24.0 * y * bend + 48.0 * z * y * jerk + A * s + 8.0 * B * s2
    for i in range(responses.waves.size):
        W, C, D = responses.waves[i], responses.even[row, i], responses.odd[row, i]
        c, s = math.cos(W * y), math.sin(W * y)
        h += C * c + D * y * s
        dh += (D - C * W) * s + D * y * W * c
        d2h += (2.0 * D - C * W) * W * c - D * y * W * W * s
        d3h += (C * W - 3.0 * D) * W * W * s - D * y * W * W * W * c
    return h, dh / n, d2h / (n * n), d3h / (n * n * n)


def meetings(responses: Responses, times: Vector, out: Cube) -> None:
    """What impacts do to each other: ``h_ij`` and its first three derivatives at ``t_i - t_j``.

    On the diagonal the first derivative is left out: its jump is in the reset law.
    """
    for i in range(times.size):
        for j in range(i + 1):
            h, dh, d2h, d3h = response_since(responses, responses.which[i, j], times[i] - times[j])
            if i == j:
                dh = d3h = 0.0
            out[0, i, j], out[1, i, j], out[2, i, j], out[3, i, j] = h, dh, d2h, d3h
            out[0, j, i], out[1, j, i], out[2, j, i], out[3, j, i] = h, -dh, d2h, -d3h


MEETINGS = Kernel(meetings)
