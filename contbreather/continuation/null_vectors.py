"""``F_x v = 0, |v| = 1`` beside the equations F, as text that can be compiled.

`evaluate`, `derive` and `N` are those of the shorter problem, bound by `kernels`. z holds
its unknowns, v, and two parameters; the shorter problem is asked in the first entries of z, which
are put back afterwards. Behind its answer, `out` is scratch.
"""

from __future__ import annotations

import math
from typing import Any

N = 1
STEP = 2.0**-10  # of the five-point formula, relative to what v moves


def evaluate(z: Any, data: Any, out: Any) -> int:
    raise NotImplementedError


def derive(z: Any, data: Any, out: Any) -> int:
    raise NotImplementedError


def conditions(z: Any, data: Any, out: Any) -> int:
    """The equations, ``F_x v`` and ``|v|^2 - 1``."""
    kept = 2 * (2 * N + 2) * (2 * N + 2)
    shorten(z, out, kept)
    status = derive(z, data, out)
    size = -1.0
    for i in range(N):
        v = out[kept + N + i]
        size += v * v
        turned = 0.0
        for k in range(N):
            turned += out[i * (N + 2) + k] * out[kept + N + k]
        out[kept + 2 * N + 2 + i] = turned
    status += evaluate(z, data, out)
    for i in range(N):
        out[N + i] = out[kept + 2 * N + 2 + i]
    out[2 * N] = size
    lengthen(z, out, kept)
    return status


def null_slopes(z: Any, data: Any, out: Any) -> int:
    """Their derivatives, row by row. Second derivatives are symmetric: those of ``F_x v`` are the
    derivative of F_z along v."""
    width, w = 2 * N + 2, N + 2
    bent, kept = width * width, 2 * width * width
    shorten(z, out, kept)
    # columns: x, v, both parameters
    # |    F_x       0       F_p    |
    # | (F_x v)_x   F_x   (F_x v)_p |
    # |     0      2 v^T      0     |
    status = slopes_along(z, data, out, bent, kept)
    status += derive(z, data, out)
    for i in range(N * w):
        out[bent + N * w + i] = out[i]
    for i in range((2 * N + 1) * width):
        out[i] = 0.0
    for i in range(N):
        for k in range(w):
            slope, column = out[bent + N * w + i * w + k], k if k < N else N + k
            out[i * width + column] = slope
            out[(N + i) * width + column] = out[bent + i * w + k]
        for k in range(N):
            out[(N + i) * width + N + k] = out[bent + N * w + i * w + k]
        out[2 * N * width + N + i] = 2.0 * out[kept + N + i]
    lengthen(z, out, kept)
    return status


def slopes_along(z: Any, data: Any, out: Any, bent: int, kept: int) -> int:
    """Derivative of F_z along v by the five-point formula, from `bent` on."""
    size = 0.0
    for i in range(N):
        change = out[kept + N + i] / max(1.0, abs(out[kept + i]))
        size += change * change
    # relative to what v moves: an idle entry of size 100 says nothing of the step
    h = STEP / max(math.sqrt(size), 1e-300)
    for i in range(N * (N + 2)):
        out[bent + i] = 0.0
    status = 0
    for step in (-2, -1, 1, 2):
        # f' = (f(-2h) - 8 f(-h) + 8 f(h) - f(2h)) / 12h, off by h^4 / 30 of the fifth derivative
        weight = (8.0 if abs(step) == 1 else -0.5) * step / (12.0 * h)
        for i in range(N):
            z[i] = out[kept + i] + step * h * out[kept + N + i]
        status += derive(z, data, out)
        for i in range(N * (N + 2)):
            out[bent + i] += weight * out[i]
    for i in range(N):
        z[i] = out[kept + i]
    return status


def shorten(z: Any, out: Any, kept: int) -> None:
    """Keep z, and make its first entries those of the shorter problem."""
    for i in range(2 * N + 2):
        out[kept + i] = z[i]
    z[N] = out[kept + 2 * N]
    z[N + 1] = out[kept + 2 * N + 1]


def lengthen(z: Any, out: Any, kept: int) -> None:
    for i in range(2 * N + 2):
        z[i] = out[kept + i]
