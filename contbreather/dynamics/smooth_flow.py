"""Compiled right-hand sides of the smooth chain (21): the motion, its Jacobian, its variations.

``q = |u|^(2m)`` is computed once for a site: the wall's force is ``(2m+1) q (lambda u' + q u)``. In
here |u| is kept below ``top``, where the wall stores a million times the usual energy: a trial step
far behind the wall then costs a rejection and no overflow; accepted states are checked by the
caller.
"""

from __future__ import annotations

import math

import numpy as np

from contbreather.dynamics.compiled import compiled
from contbreather.dynamics.flow import Array


@compiled
def ceiling(m: float) -> float:
    """The displacement at which the wall has stopped a velocity of 1000."""
    return 1000.0 ** (1.0 / (2.0 * m + 1.0))


@compiled
def force(t: float, orders: Array, c: Array, s: Array) -> float:
    total = 0.0
    for i in range(orders.size):
        total += c[i] * math.cos(orders[i] * t) + s[i] * math.sin(orders[i] * t)
    return total


@compiled
def motion(
    t: float,
    y: Array,
    a: float,
    gamma: float,
    lam: float,
    m: float,
    mu: float,
    orders: Array,
    c: Array,
    s: Array,
) -> Array:
    """(u', u'') of the ring for y = (u, u')."""
    size = y.size // 2
    out = np.empty(y.size)
    drive, top = a * force(t, orders, c, s), ceiling(m)
    for n in range(size):
        u, v = y[n], y[size + n]
        left, right = y[(n - 1) % size], y[(n + 1) % size]
        inside = min(max(u, -top), top)
        q = abs(inside) ** (2.0 * m)
        wall = (2.0 * m + 1.0) * q * (lam * v + q * inside)
        out[n] = v
        out[size + n] = drive - gamma * (2.0 * u - left - right) - mu * v - wall
    return out


@compiled
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


@compiled
def jacobian(
    t: float,
    y: Array,
    a: float,
    gamma: float,
    lam: float,
    m: float,
    mu: float,
    orders: Array,
    c: Array,
    s: Array,
) -> Array:
    """Derivative of `motion` with respect to y."""
    size = y.size // 2
    out, top = np.zeros((y.size, y.size)), ceiling(m)
    for n in range(size):
        in_u, density, _ = slopes(y[n], y[size + n], lam, m, top)
        out[n, size + n] = 1.0
        out[size + n, n] -= 2.0 * gamma + in_u
        out[size + n, (n - 1) % size] += gamma
        out[size + n, (n + 1) % size] += gamma
        out[size + n, size + n] = -mu - lam * density
    return out


@compiled
def varied(
    t: float,
    y: Array,
    a: float,
    gamma: float,
    lam: float,
    m: float,
    mu: float,
    orders: Array,
    c: Array,
    s: Array,
    size: int,
    params: int,
) -> Array:
    """The motion with its variations: y is (u, u'), then columns of the same shape.

    The last ``params`` columns are derivatives in a, gamma, lambda, m, mu, in this order.
    """
    out = np.empty(y.size)
    wide = 2 * size
    columns = y.size // wide - 1
    out[:wide] = motion(t, y[:wide], a, gamma, lam, m, mu, orders, c, s)
    drive, top = force(t, orders, c, s), ceiling(m)
    for n in range(size):
        left, right = (n - 1) % size, (n + 1) % size
        u, v = y[n], y[size + n]
        in_u, density, in_m = slopes(u, v, lam, m, top)
        stiff, drag = 2.0 * gamma + in_u, mu + lam * density
        for i in range(columns):
            at = wide * (i + 1)
            du, dv = y[at + n], y[at + size + n]
            out[at + n] = dv
            pull = gamma * (y[at + left] + y[at + right])
            out[at + size + n] = pull - stiff * du - drag * dv
        if params > 0:
            at = wide * (columns - params + 1) + size + n
            bend = 2.0 * u - y[left] - y[right]
            for i in range(params):
                if i == 0:
                    out[at] += drive
                elif i == 1:
                    out[at + wide] -= bend
                elif i == 2:
                    out[at + 2 * wide] -= density * v
                elif i == 3:
                    out[at + 3 * wide] -= in_m
                else:
                    out[at + 4 * wide] -= v
    return out
