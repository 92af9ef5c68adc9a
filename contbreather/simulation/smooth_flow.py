"""Kernels of the smooth chain (21): its motion with its variations, and their integration.

``q = |u|^(2m)`` is computed once for a site: the wall's force is ``(2m+1) q (lambda u' + q u)``.

A state y is (u, u'), and behind it a matrix with as many rows, row by row, whose columns are
variations; the last ``params`` of them, none or six, those in the first of `SmoothParameters`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from contbreather.kernels import Kernel, Matrix, Vector

CAP = 0.2  # largest step of any solver
MOST = 1_000_000  # steps between two outputs


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
    for i in range(on.entries.shape[0]):
        site, other = int(on.entries[i, 0]), int(on.entries[i, 1])
        out[size + site] -= on.gamma * on.entries[i, 2] * y[other]


def slopes(u: float, v: float, lam: float, m: float, top: float) -> tuple[float, float, float]:
    """Derivatives of the wall's force in u, in u' over lambda, and in m."""
    inside = min(max(u, -top), top)
    size = abs(inside)
    q = size ** (2.0 * m)
    dq = 2.0 * m * q / inside if size > 0.0 else 0.0
    weight = 2.0 * m + 1.0
    in_u = weight * (lam * v * dq + (4.0 * m + 1.0) * q * q)
    in_m = 0.0
    if size > 1e-3:  # below, q is far smaller than rounding for every m >= 6
        log = 2.0 * math.log(size)  # d q/dm = q log u^2
        in_m = 2.0 * q * (lam * v + q * inside)
        in_m += weight * q * log * (lam * v + 2.0 * q * inside)
    return in_u, weight * q, in_m


def rates(t: float, y: Vector, on: SmoothParameters, params: int, out: Vector) -> None:
    """What the motion and its variations change by."""
    motion(t, y, on, out)
    size = on.drive.size
    columns = y.size // (2 * size) - 1
    if columns == 0:
        return
    push, top = force(t, on.series), ceiling(on.m)
    begin, half = 2 * size, size * columns  # of the matrix, and of its lower half behind that
    for n in range(size):
        u, v = y[n], y[size + n]
        in_u, density, in_m = slopes(u, v, on.lam, on.m, top)
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
            own = dw[columns - params :]
            own[0] += on.drive[n] * push
            own[2] -= density * v
            own[3] -= in_m
            own[4] -= v
            own[5] -= u
    for i in range(on.entries.shape[0]):
        site, other, weight = int(on.entries[i, 0]), int(on.entries[i, 1]), on.entries[i, 2]
        at, low = begin + other * columns, begin + half + site * columns
        du, dw, pull = y[at : at + columns], out[low : low + columns], on.gamma * weight
        for j in range(columns):
            dw[j] -= pull * du[j]
        if params > 0:
            dw[columns - params + 1] -= weight * y[other]


# --- integration ----------------------------------------------------------------------------------


class Tableau(NamedTuple):
    """Of an explicit Runge-Kutta method of order 8: weights of the stages before each stage, the
    last of which is the end of the step, its time, and weights of the errors of order 5 and 3."""

    a: Matrix
    c: Vector
    fifth: Vector
    third: Vector


def weighted(weights: Vector, stages: Matrix, count: int, out: Vector) -> None:
    """The sum of the first stages by their weights."""
    for n in range(out.size):
        out[n] = 0.0
    for j in range(count):
        weight = weights[j]
        if weight != 0.0:
            for n in range(out.size):
                out[n] += weight * stages[j, n]


def step_to(
    t: float, y: Vector, step: float, on: SmoothParameters, params: int, by: Tableau,
    tolerance: float, stages: Matrix, room: Matrix,
) -> float:  # fmt: skip
    """The end of a step, in the first row of ``room``, and its error in units of the tolerance."""
    trial, fifth, third = room[0], room[1], room[2]
    last = by.c.size - 1
    for i in range(1, last + 1):
        weighted(by.a[i], stages, i, trial)
        for n in range(y.size):
            trial[n] = y[n] + step * trial[n]
        rates(t + by.c[i] * step, trial, on, params, stages[i])
    weighted(by.fifth, stages, last, fifth)
    weighted(by.third, stages, last, third)
    large = small = 0.0
    for n in range(y.size):
        scale = tolerance * (1.0 + max(abs(y[n]), abs(trial[n])))
        e5, e3 = fifth[n] / scale, third[n] / scale
        large += e5 * e5
        small += e3 * e3
    # Hairer, Norsett, Wanner, Solving ODEs I, II.10: of order 8, where neither of both is
    return 0.0 if large == 0.0 else abs(step) * large / math.sqrt((large + 0.01 * small) * y.size)


def carry(
    y: Vector, reached: Vector, end: float, on: SmoothParameters, params: int, by: Tableau,
    tolerance: float, stages: Matrix, room: Matrix,
) -> None:  # fmt: skip
    """Take y to the time ``end``, in place.

    ``reached`` is the time of y and the step to go on with; short of ``end`` where steps become
    too small.
    """
    t, h, last = reached[0], reached[1], by.c.size - 1
    rates(t, y, on, params, stages[0])
    most = 6.0  # by which a step may grow; not at all after one that was too long
    for _ in range(MOST):
        whole = t + 1.01 * h < end
        step = h if whole else end - t
        off = step_to(t, y, step, on, params, by, tolerance, stages, room)
        factor = 0.3  # also where the error is no number
        if off == 0.0:
            factor = most
        elif off > 0.0:
            factor = max(0.3, min(most, 0.9 * off**-0.125))
        if off < 1.0:
            t = t + step if whole else end
            for n in range(y.size):
                y[n], stages[0, n] = room[0, n], stages[last, n]
            # a step cut short says little about the next one
            h = min(CAP, step * factor if whole else max(h, step * factor))
            most = 6.0
            if not whole:
                break
        else:
            h, most = step * factor, 1.0
            if h <= 1e-15 * max(abs(t), abs(end)):
                break
    reached[0], reached[1] = t, h


RATES, CARRY = Kernel(rates), Kernel(carry, long=True)
