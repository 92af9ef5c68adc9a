"""Compiled right-hand sides of the smooth chain (21): the motion, its Jacobian, its variations.

``q = |u|^(2m)`` is computed once for a site: the wall's force is ``(2m+1) q (lambda u' + q u)``. In
here |u| is kept below ``top``, where the wall stores a million times the usual energy: a trial step
far behind the wall then costs a rejection and no overflow; accepted states are checked by the
caller. ``entries`` are (site, other, value) of the stiffness matrix over the masses.
"""

from __future__ import annotations

import math

from contbreather.kernels import Kernel, Matrix, Vector


def ceiling(m: float) -> float:
    """The displacement at which the wall has stopped a velocity of 1000."""
    return 1000.0 ** (1.0 / (2.0 * m + 1.0))


def force(t: float, series: Matrix) -> float:
    total = 0.0
    for i in range(series.shape[1]):
        angle = series[0, i] * t
        total += series[1, i] * math.cos(angle) + series[2, i] * math.sin(angle)
    return total


def bend(entries: Matrix, y: Vector, first: int, out: Vector, to: int, factor: float) -> None:
    """Add a multiple of the couplings' pull at y, from ``first`` on, to ``out`` from ``to`` on."""
    for i in range(entries.shape[0]):
        pull = factor * entries[i, 2] * y[first + int(entries[i, 1])]
        out[to + int(entries[i, 0])] -= pull


def moved(
    t: float, y: Vector, size: int, a: float, gamma: float, lam: float, m: float, mu: float,
    spring: float, series: Matrix, entries: Matrix, drive: Vector, out: Vector,
) -> None:  # fmt: skip
    push, top = a * force(t, series), ceiling(m)
    for n in range(size):
        u, v = y[n], y[size + n]
        inside = min(max(u, -top), top)
        q = abs(inside) ** (2.0 * m)
        wall = (2.0 * m + 1.0) * q * (lam * v + q * inside)
        out[n] = v
        out[size + n] = drive[n] * push - spring * u - mu * v - wall
    bend(entries, y, 0, out, size, gamma)


def motion(
    t: float, y: Vector, a: float, gamma: float, lam: float, m: float, mu: float, spring: float,
    series: Matrix, entries: Matrix, drive: Vector, out: Vector,
) -> None:  # fmt: skip
    """(u', u'') of the lattice for y = (u, u')."""
    moved(t, y, drive.size, a, gamma, lam, m, mu, spring, series, entries, drive, out)


def slopes(u: float, v: float, lam: float, m: float, top: float) -> tuple[float, float, float]:
    """Derivatives of the wall's force in u, in u' and in m, and (last) what lambda multiplies."""
    inside = min(max(u, -top), top)
    size = abs(inside)
    q = size ** (2.0 * m)
    # d q/du = 2m q/u, finite at u = 0
    dq = 2.0 * m * size ** (2.0 * m - 1.0) * (1.0 if inside >= 0.0 else -1.0)
    weight = 2.0 * m + 1.0
    in_u = weight * (lam * v * dq + (4.0 * m + 1.0) * q * q)
    in_m = 0.0
    if size > 1e-3:  # below, q is far smaller than rounding for every m >= 6
        log = 2.0 * math.log(size)
        in_m = 2.0 * q * (lam * v + q * inside)
        in_m += weight * q * log * (lam * v + 2.0 * q * inside)
    return in_u, weight * q, in_m


def jacobian(
    t: float, y: Vector, a: float, gamma: float, lam: float, m: float, mu: float, spring: float,
    series: Matrix, entries: Matrix, drive: Vector, out: Matrix,
) -> None:  # fmt: skip
    """Derivative of `motion` with respect to y."""
    size, top = drive.size, ceiling(m)
    for i in range(2 * size):
        for j in range(2 * size):
            out[i, j] = 0.0
    for n in range(size):
        in_u, density, _ = slopes(y[n], y[size + n], lam, m, top)
        out[n, size + n] = 1.0
        out[size + n, n] -= spring + in_u
        out[size + n, size + n] = -mu - lam * density
    for i in range(entries.shape[0]):
        out[size + int(entries[i, 0]), int(entries[i, 1])] -= gamma * entries[i, 2]


def varied(
    t: float, y: Vector, a: float, gamma: float, lam: float, m: float, mu: float, spring: float,
    series: Matrix, entries: Matrix, drive: Vector, params: int, out: Vector,
) -> None:  # fmt: skip
    """The motion with its variations: y is (u, u'), then columns of the same shape.

    The last ``params`` columns are derivatives in a, gamma, lambda, m, mu, spring, in this order.
    """
    size = drive.size
    wide = 2 * size
    columns = y.size // wide - 1
    moved(t, y, size, a, gamma, lam, m, mu, spring, series, entries, drive, out)
    push, top = force(t, series), ceiling(m)
    behind = wide * (columns - params + 1) + size  # accelerations of the first of those columns
    for n in range(size):
        u, v = y[n], y[size + n]
        in_u, density, in_m = slopes(u, v, lam, m, top)
        stiff, drag = spring + in_u, mu + lam * density
        for i in range(columns):
            at = wide * (i + 1)
            out[at + n] = y[at + size + n]
            out[at + size + n] = -stiff * y[at + n] - drag * y[at + size + n]
        if params > 0:
            out[behind + n] += drive[n] * push
            out[behind + 2 * wide + n] -= density * v
            out[behind + 3 * wide + n] -= in_m
            out[behind + 4 * wide + n] -= v
            out[behind + 5 * wide + n] -= u
    for i in range(columns):
        at = wide * (i + 1)
        bend(entries, y, at, out, at + size, gamma)
    if params > 0:
        bend(entries, y, 0, out, behind + wide, 1.0)


MOTION, JACOBIAN, VARIED = Kernel(motion), Kernel(jacobian), Kernel(varied)
