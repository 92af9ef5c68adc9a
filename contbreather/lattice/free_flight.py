"""Responses of chain and ring to impacts that recur, as kernels take them.

The answer of site n to the impacts of site 0 that recur after half a period with the other sign,
per unit p, is ``<cos(n theta) sin(w (pi/2 - s))/(w cos(pi w/2))>``. The harmonic that drives the
band's edge, cos s, is kept exact; everything else is a power series in ``w^2`` whose coefficients
are polynomials of the time from mid flight, ``y = s - pi/2``:

    ``v_n = (4/pi) [ -g sin y + sum over j of <w^(2j) cos(n theta)> P_j(y) ]``,
    ``P_j(y) = sum over i of (-1)^i y^(2i+1)/(2i+1)! W_ij``,
    ``W_ij = 1 - beta(2(j-i)+1)`` for i <= j, else 1 (beta: Dirichlet's, from sec(pi w/2)).

``P_j`` falls like ``9^-j``, so one odd polynomial of degree 25 in y holds all of it, to rounding,
for displacement, velocity and acceleration alike, impacts included. Those that recur after a period
are in `contbreather.lattice.periodic_green`, which makes the tables of both.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from contbreather.kernels import Counts, Cube, Kernel, Matrix, Table, Vector, fixed, inlined
from contbreather.lattice.zeta import zeta

FloatArray = NDArray[np.float64]

TERMS = 18  # powers of w^2: 9^-18 < 1e-17, the rest is below rounding
POWERS = 13  # odd powers of y: (pi/2)^27/27! < 1e-22
LATE = 1e-12  # an impact this little later has been,
SLACK = (
    1e-15  # and one that the roundings of a time, of the impact and of what is between them hide
)


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

    def at(self, since: ArrayLike, rows: ArrayLike = 0) -> FloatArray:
        """Value and first three derivatives at any times since an impact, at the impact itself
        those just after it, for rows of the table; shape ``(4, ...)``."""
        shape = np.broadcast(since, rows).shape
        times, which = np.empty(shape), np.empty(shape, dtype=np.int64)
        times[...], which[...] = since, rows
        out = np.empty((4, times.size))
        RESPONSES(self, times.ravel(), which.ravel(), out)
        return out.reshape(4, *shape)


@inlined
def response_since(
    responses: Responses, row: int, since: float
) -> tuple[float, float, float, float]:
    """Value and three derivatives at a time since an impact, those just after it."""
    table, n = responses.table, responses.turns
    width = math.pi if responses.half else 2.0 * math.pi
    s = since / n
    past = math.floor((s + LATE + SLACK * abs(s)) / width)
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


def responses_at(responses: Responses, since: Vector, rows: Counts, out: Matrix) -> None:
    """Of each row at its time, in columns."""
    for i in range(since.size):
        h, dh, d2h, d3h = response_since(responses, rows[i], since[i])
        out[0, i], out[1, i], out[2, i], out[3, i] = h, dh, d2h, d3h


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


RESPONSES, MEETINGS = Kernel(responses_at), Kernel(meetings)
