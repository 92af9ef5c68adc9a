"""Kernel of the smooth chain (21): its motion with its variations.

``q = |u|^(2m)`` is computed once for a site: the wall's force is ``(2m+1) q (lambda u' + q u)``.

A state y is (u, u'), and behind it a matrix with as many rows, row by row, whose columns are
variations; the last ``params`` of them, none or six, those in the first of `SmoothParameters`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from contbreather.kernels import Kernel, Matrix, Vector
from contbreather.simulation.taylor import Harmonics, drive_sum


class SmoothParameters(NamedTuple):
    """Parameters of the smooth chain; the first six are those of the variations, in order."""

    a: float
    gamma: float
    lam: float
    m: float
    mu: float
    spring: float
    force: Harmonics  # F/a
    entries: Matrix  # of the stiffness matrix over the masses: site, other, value
    drive: Vector  # by how much of F each site is driven


def ceiling(m: float) -> float:
    """The displacement at which the wall has stopped a velocity of 1000."""
    # u^(4m+2)/2 is what the wall stores
    return 1000.0 ** (1.0 / (2.0 * m + 1.0))


def accelerations(t: float, y: Vector, on: SmoothParameters, out: Vector) -> None:
    """(u', u'') of (21), for y that begins with (u, u')."""
    size, push = on.drive.size, on.a * drive_sum(on.force, t)[0]
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
    for i in range(on.entries.shape[0]):
        site, other = int(on.entries[i, 0]), int(on.entries[i, 1])
        out[size + site] -= on.gamma * on.entries[i, 2] * y[other]


def wall_slopes(u: float, v: float, lam: float, m: float, top: float) -> tuple[float, float, float]:
    """Derivatives of the wall's force in u, in u' over lambda, and in m."""
    inside = min(max(u, -top), top)
    size = abs(inside)
    q = size ** (2.0 * m)
    dq = 2.0 * m * q / inside if size > 0.0 else 0.0
    weight = 2.0 * m + 1.0
    # of lambda q u' and q^2 u = |u|^(4m) u
    in_u = weight * (lam * v * dq + (4.0 * m + 1.0) * q * q)
    in_m = 0.0
    if size > 1e-3:  # below, q is far smaller than rounding for every m >= 6
        log = 2.0 * math.log(size)  # d q/dm = q log u^2
        in_m = 2.0 * q * (lam * v + q * inside)
        in_m += weight * q * log * (lam * v + 2.0 * q * inside)
    return in_u, weight * q, in_m


def rates(t: float, y: Vector, on: SmoothParameters, params: int, out: Vector) -> None:
    """Rates of change of the motion and its variations."""
    accelerations(t, y, on, out)
    size = on.drive.size
    columns = y.size // (2 * size) - 1
    if columns == 0:
        return
    push, top = drive_sum(on.force, t)[0], ceiling(on.m)
    begin, half = 2 * size, size * columns  # of the matrix, and of its lower half behind that
    for n in range(size):
        u, v = y[n], y[size + n]
        in_u, density, in_m = wall_slopes(u, v, on.lam, on.m, top)
        stiff, drag = on.spring + in_u, on.mu + on.lam * density
        at = begin + n * columns
        low = at + half
        # rows as arrays of their own: whose indices are seen to be in order, so that several
        # columns are computed at once
        du, dv, dw = y[at : at + columns], y[low : low + columns], out[low : low + columns]
        velocity = out[at : at + columns]
        for i in range(columns):
            velocity[i] = dv[i]
            dw[i] = -stiff * du[i] - drag * dv[i]
        if params > 0:
            in_params = dw[columns - params :]
            in_params[0] += on.drive[n] * push
            in_params[2] -= density * v
            in_params[3] -= in_m
            in_params[4] -= v
            in_params[5] -= u
    for i in range(on.entries.shape[0]):
        site, other, weight = int(on.entries[i, 0]), int(on.entries[i, 1]), on.entries[i, 2]
        at, low = begin + other * columns, begin + half + site * columns
        du, dw, pull = y[at : at + columns], out[low : low + columns], on.gamma * weight
        for j in range(columns):
            dw[j] -= pull * du[j]
        if params > 0:
            dw[columns - params + 1] -= weight * y[other]


RATES = Kernel(rates)
