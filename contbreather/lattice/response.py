"""Responses of sites to impacts that recur, from a table of coefficients, as kernels take them."""

from __future__ import annotations

import math
from typing import NamedTuple

from contbreather.kernels import Cube, Kernel, Matrix, Table, Vector, fixed, inlined


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
def response(responses: Responses, row: int, since: float) -> tuple[float, float, float, float]:
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
            h, dh, d2h, d3h = response(responses, responses.which[i, j], times[i] - times[j])
            if i == j:
                dh = d3h = 0.0
            out[0, i, j], out[1, i, j], out[2, i, j], out[3, i, j] = h, dh, d2h, d3h
            out[0, j, i], out[1, j, i], out[2, j, i], out[3, j, i] = h, -dh, d2h, -d3h


MEETINGS = Kernel(meetings)
