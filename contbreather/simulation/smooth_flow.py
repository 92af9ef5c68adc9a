"""Kernels of the smooth chain (21): its motion, and its variations.

``q = |u|^(2m)`` is computed once for a site: the wall's force is ``(2m+1) q (lambda u' + q u)``.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from contbreather.kernels import Kernel, Matrix, Vector


class SmoothParameters(NamedTuple):
    """What the smooth chain moves under; the first six are those of the variations, in order."""

    a: float
    gamma: float
    lam: float
    m: float
    mu: float
    spring: float
    series: Matrix  # orders, cosines and sines of F/a, in rows
    entries: Matrix  # of the stiffness matrix over the masses: site, other, value
    drive: Vector  # by how much of F each site is driven


def ceiling(m: float) -> float:
    """The displacement at which the wall has stopped a velocity of 1000."""
    # u^(4m+2)/2 is what the wall stores
    return 1000.0 ** (1.0 / (2.0 * m + 1.0))


def force(t: float, series: Matrix) -> float:
    """F/a at time t."""
    total = 0.0
    for i in range(series.shape[1]):
        angle = series[0, i] * t
        total += series[1, i] * math.cos(angle) + series[2, i] * math.sin(angle)
    return total


def add_pull(entries: Matrix, y: Vector, first: int, out: Vector, to: int, factor: float) -> None:
    """Add a multiple of the couplings' pull at y, from ``first`` on, to ``out`` from ``to`` on."""
    for i in range(entries.shape[0]):
        pull = factor * entries[i, 2] * y[first + int(entries[i, 1])]
        out[to + int(entries[i, 0])] -= pull


def motion(t: float, y: Vector, on: SmoothParameters, out: Vector) -> None:
    """(u', u'') of (21), for y that begins with (u, u')."""
    size, push = on.drive.size, on.a * force(t, on.series)
    # far behind the wall, where it stores a million times the usual energy, a trial step costs a
    # rejection and no overflow; accepted states are checked by the caller
    top = ceiling(on.m)
    for n in range(size):
        u, v = y[n], y[size + n]
        inside = min(max(u, -top), top)
        q = abs(inside) ** (2.0 * on.m)
        wall = (2.0 * on.m + 1.0) * q * (on.lam * v + q * inside)
        out[n] = v
        out[size + n] = on.drive[n] * push - on.spring * u - on.mu * v - wall
    add_pull(on.entries, y, 0, out, size, on.gamma)


def slopes(u: float, v: float, lam: float, m: float, top: float) -> tuple[float, float, float]:
    """Derivatives of the wall's force in u, in u' over lambda, and in m."""
    inside = min(max(u, -top), top)
    size = abs(inside)
    q = size ** (2.0 * m)
    # d q/du = 2m q/u, finite at u = 0
    dq = 2.0 * m * size ** (2.0 * m - 1.0) * (1.0 if inside >= 0.0 else -1.0)
    weight = 2.0 * m + 1.0
    in_u = weight * (lam * v * dq + (4.0 * m + 1.0) * q * q)
    in_m = 0.0
    if size > 1e-3:  # below, q is far smaller than rounding for every m >= 6
        log = 2.0 * math.log(size)  # d q/dm = q log u^2
        in_m = 2.0 * q * (lam * v + q * inside)
        in_m += weight * q * log * (lam * v + 2.0 * q * inside)
    return in_u, weight * q, in_m


def varied(t: float, y: Vector, on: SmoothParameters, params: int, out: Vector) -> None:
    """The motion with its variations: y is (u, u'), then columns of the same shape.

    The last ``params`` columns, none or six, are derivatives in the first of `SmoothParameters`.
    """
    size = on.drive.size
    wide = 2 * size
    columns = y.size // wide - 1
    motion(t, y, on, out)
    push, top = force(t, on.series), ceiling(on.m)
    behind = wide * (columns - params + 1) + size  # accelerations of the first of those columns
    for n in range(size):
        u, v = y[n], y[size + n]
        in_u, density, in_m = slopes(u, v, on.lam, on.m, top)
        stiff, drag = on.spring + in_u, on.mu + on.lam * density
        for i in range(columns):
            at = wide * (i + 1)
            out[at + n] = y[at + size + n]
            out[at + size + n] = -stiff * y[at + n] - drag * y[at + size + n]
        if params > 0:
            out[behind + n] += on.drive[n] * push
            out[behind + 2 * wide + n] -= density * v
            out[behind + 3 * wide + n] -= in_m
            out[behind + 4 * wide + n] -= v
            out[behind + 5 * wide + n] -= u
    for i in range(columns):
        at = wide * (i + 1)
        add_pull(on.entries, y, at, out, at + size, on.gamma)
    if params > 0:
        add_pull(on.entries, y, 0, out, behind + wide, 1.0)


MOTION, VARIED = Kernel(motion), Kernel(varied)
