"""What impacts do to each other by the periodic Green's function, as text that can be compiled."""

from __future__ import annotations

import math
from typing import Any

from contbreather.kernels import Kernel

EVEN, WIDTH = 16, 18  # even powers of y in a row of `wave_table`; after them cos y and cos 2y
# data: how many impacts, periods n of the forcing; then the times, and for each pair its row
IMPACTS, N, FIRST = range(3)
TWO_PI = 2.0 * math.pi


def meetings(data: Any, table: Any, out: Any) -> int:
    """``h_ij`` and its first three derivatives at ``t_i - t_j``, four tables one after the other.

    On the diagonal the first derivative is left out: its jump is in the reset law.
    """
    m = int(data[IMPACTS])
    for i in range(m):
        for j in range(i + 1):
            row = WIDTH * int(data[FIRST + m + m * i + j])
            answer(data, table, out, row, data[FIRST + i] - data[FIRST + j], m * i + j)
            for order in range(4):
                here = order * m * m
                if i == j:
                    if order % 2:
                        out[here + m * i + i] = 0.0
                else:  # h is even
                    sign = -1.0 if order % 2 else 1.0
                    out[here + m * j + i] = sign * out[here + m * i + j]
    return 0


def answer(data: Any, table: Any, out: Any, row: int, since: float, at: int) -> None:
    """Value and first three derivatives at a time since an impulse, those just after it."""
    n, size = data[N], int(data[IMPACTS]) * int(data[IMPACTS])
    s = since / n
    y = math.pi - (s - TWO_PI * math.floor(s / TWO_PI))
    z = y * y
    value = slope = bend = jerk = 0.0  # a polynomial in z; derivatives over 1, 2 and 6
    for i in range(EVEN - 1, -1, -1):
        jerk = jerk * z + bend
        bend = bend * z + slope
        slope = slope * z + value
        value = value * z + table[row + i]
    a, b, c, s = table[row + EVEN], table[row + EVEN + 1], math.cos(y), math.sin(y)
    c2, s2 = c * c - s * s, 2.0 * c * s
    out[at] = value + a * c + b * c2
    out[size + at] = (a * s + 2.0 * b * s2 - 2.0 * y * slope) / n
    out[2 * size + at] = (2.0 * slope + 8.0 * z * bend - a * c - 4.0 * b * c2) / (n * n)
    third = 24.0 * y * bend + 48.0 * z * y * jerk + a * s + 8.0 * b * s2
    out[3 * size + at] = -third / (n * n * n)


MEETINGS = Kernel(meetings, "ppp")
