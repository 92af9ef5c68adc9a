"""A Neimark-Sacker point of the infinite chain and a grazing site, beside equations (11), as text
that can be compiled.

z holds p, phi, the angle of the pair or the time of the contact, and two parameters. `data` is that
of `closed_loops`, and from `MORE` on what these conditions need besides.
"""

from __future__ import annotations

import math
from typing import Any

from contbreather.kernels import bound, listed
from contbreather.orbits.closed_loops import (
    GAMMA,
    PLACES,
    A,
    F,
    K,
    closure,
    closure_slopes,
    drive,
    driven,
    mean,
)
from contbreather.stability import band_pairs

MORE = 512
# for a pair: eta and its slope; coupling, k, q, b, angle, spring for `band_pairs`, its answer, its
# scratch and its table; then the expansion of eta
ETA, DETA, ARC = MORE, MORE + 1, MORE + 2
ANSWER = ARC + 6
SCRATCH = ANSWER + 12
TABLE = SCRATCH + band_pairs.WAVE
MEAN_OF_ETA = TABLE + 440
# for a contact: the wall and how far away the site is; amplitudes of its flight and their slopes in
# gamma; moments of the chain at that distance, and the weights of these in the amplitudes
WALL, DISTANCE = MORE, MORE + 1
POWERS, TERMS = 13, 19
OWN, SLOPE = MORE + 2, MORE + 2 + 1 + POWERS
MOMENTS = SLOPE + 1 + POWERS
WEIGHTS = MOMENTS + TERMS
MOTION = WEIGHTS + POWERS * TERMS  # displacement, velocity, acceleration; then those in gamma


# where `band_pairs` find what they ask for
on_arc = bound(
    band_pairs.on_arc,
    **{name: ARC + getattr(band_pairs, name) for name in ("GAMMA", "K", "ENTRY", "NU", "SPRING")},
    **{
        name: SCRATCH + getattr(band_pairs, name)
        for name in ("REGULAR", "IN_NU", "IN_GAMMA", "IN_SPRING", "TAIL", "PASCAL", "MEANS")
    },
    ANSWER=ANSWER,
    TABLE=TABLE,
)


# --- a pair on the circle -----------------------------------------------------------------------


def pair(z: Any, data: Any, out: Any) -> int:
    """(11) and both parts of F, eqs. of `arc`."""
    if closure(z, data, out) != 0 or looked(z, data) != 0:
        return 1
    out[2], out[3] = data[ANSWER], data[ANSWER + 1]
    return 0


def looked(z: Any, data: Any) -> int:
    """F at this b and angle; 1 off the band."""
    mean(data, MEAN_OF_ETA, ETA)
    c, nu = 1.0 + data[K], z[2]
    b = 0.5 * c * c * (data[A] * data[F + 2] / z[0] - data[ETA])
    data[ARC], data[ARC + 1], data[ARC + 3], data[ARC + 4] = data[GAMMA], data[K], b, nu
    if not 0.0 < nu * nu < 4.0 * data[GAMMA]:
        return 1
    return on_arc(data, data, data, data)


def pair_slopes(z: Any, data: Any, out: Any) -> int:
    """Their derivatives, row by row."""
    if closure_slopes(z, data, out) != 0 or looked(z, data) != 0:
        return 1
    p, c, a = z[0], 1.0 + data[K], data[A]
    half = 0.5 * c * c / p
    for row in range(2):
        at, by_b = 10 + 5 * row, data[ANSWER + 8 + row]
        out[at] = -by_b * half * a * data[F + 2] / p
        out[at + 1] = by_b * half * a * data[F + 3]
        out[at + 2] = data[ANSWER + 2 + row]
        for i in range(2):
            place = int(data[PLACES + 2 * i])
            slope = by_b * half * driven(data, i, z[1], 2)
            if place == GAMMA:
                slope = -by_b * 0.5 * c * c * data[DETA] + data[ANSWER + 4 + row]
            elif place == K:
                slope = by_b * 2.0 * data[ARC + 3] / c + data[ANSWER + 6 + row]
            out[at + 3 + i] = slope
    return 0


# --- a site that touches a wall -------------------------------------------------------------


def flight(data: Any) -> None:
    """Amplitudes of -sin y and of the odd powers of y, and their slopes in gamma."""
    x, n = 4.0 * data[GAMMA], int(data[DISTANCE])
    r = math.sqrt(1.0 - x)
    rho = x / ((1.0 + r) * (1.0 + r))
    below = power = 1.0  # rho^(n - 1), rho^n
    for _ in range(n):
        below = power
        power = power * rho
    sign = -4.0 / math.pi if n % 2 else 4.0 / math.pi
    ahead = n * below / (r * (1.0 + r) * r * (1.0 + r)) if n > 0 else 0.0
    data[OWN] = sign * power / r
    data[SLOPE] = sign * 4.0 * (ahead + power / (2.0 * r * r * r))
    for i in range(POWERS):
        value = slope = 0.0
        high, low = 1.0, 0.0  # x^j, and its derivative in gamma
        for j in range(TERMS):
            term = data[WEIGHTS + i * TERMS + j] * data[MOMENTS + j]
            value += term * high
            slope += term * low
            low = 4.0 * (j + 1) * high
            high = high * x
        data[OWN + 1 + i], data[SLOPE + 1 + i] = value, slope


def oscillator_state(data: Any, first: int, y: float, to: int) -> None:
    """Displacement, velocity and acceleration by some amplitudes."""
    z, c, s = y * y, data[first] * math.cos(y), data[first] * math.sin(y)
    total = slope = bend = 0.0  # of a polynomial in z, with half its second derivative
    for i in range(POWERS, 0, -1):
        bend = bend * z + slope
        slope = slope * z + total
        total = total * z + data[first + i]
    data[to] = total * y - s
    data[to + 1] = total + 2.0 * z * slope - c
    data[to + 2] = (6.0 * slope + 8.0 * z * bend) * y + s


def motion(z: Any, data: Any) -> float:
    """Of the site per unit p, its slopes in gamma, and f at that time; the sign of its half."""
    halves = math.floor((z[2] - z[1]) / math.pi)
    y = z[2] - z[1] - (halves + 0.5) * math.pi
    flight(data)
    oscillator_state(data, OWN, y, MOTION)
    oscillator_state(data, SLOPE, y, MOTION + 3)
    drive(data, z[2])
    return 1.0 - 2.0 * (halves % 2)


def contact(z: Any, data: Any, out: Any) -> int:
    """(11), and that a site is on a wall at a time, without velocity."""
    if closure(z, data, out) != 0:
        return 1
    p = motion(z, data) * z[0]
    out[2] = data[A] * data[F] + p * data[MOTION] - data[WALL]
    out[3] = data[A] * data[F + 1] + p * data[MOTION + 1]
    return 0


def contact_slopes(z: Any, data: Any, out: Any) -> int:
    """Their derivatives, row by row."""
    if closure_slopes(z, data, out) != 0:
        return 1
    sign = motion(z, data)
    p, a = sign * z[0], data[A]
    for row in range(2):
        at = 10 + 5 * row
        out[at] = sign * data[MOTION + row]
        out[at + 1] = -p * data[MOTION + row + 1]
        out[at + 2] = a * data[F + row + 1] + p * data[MOTION + row + 1]
        for i in range(2):
            slope = driven(data, i, z[2], row)
            if int(data[PLACES + 2 * i]) == GAMMA:
                slope = p * data[MOTION + 3 + row]
            out[at + 3 + i] = slope
    return 0


listed("ppp", pair, pair_slopes, contact, contact_slopes)
