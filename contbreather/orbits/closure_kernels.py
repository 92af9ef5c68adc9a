"""Equations (11) of the symmetric breather and those of its events, as text that can be compiled.

z holds p, phi, any unknowns of an event (the angle of a pair, the time of a contact) and the freed
parameters; `data` all others, from `FREED` on. Each function fills in `out` and returns 0, or 1
outside of the domain.
"""

from __future__ import annotations

import math
from typing import Any

from contbreather.continuation import null_vectors
from contbreather.kernels import bound, listed
from contbreather.orbits.closure import (
    ClosureTerms,
    closure_derivative,
    closure_equations,
    fold_derivative,
    fold_scalar,
    pitchfork_derivative,
    pitchfork_scalar,
    saltation_derivative,
    saltation_of,
)
from contbreather.stability import band_pairs

# How many parameters are freed; for each of them where its value belongs and the factor for it;
FREED, PLACES = 0, 1
# then a, gamma, k; of the lattice chi, sigma, eta at this gamma, each with its slope;
A, GAMMA, K, CHI, SIGMA, ETA = 5, 6, 7, 8, 10, 12
# f and its first three derivatives at phi; how many harmonics it has, and where the means begin;
F, HARMONICS, MEANS = 14, 18, 19
# how many unknowns of an event there are between phi and the freed parameters;
UNKNOWNS = 20
# from here on m, cosine and sine of each harmonic; then `expansion` of chi, of sigma and of eta.
FIRST = 21

# What a Neimark-Sacker point of the infinite chain and a grazing site need besides is from here on.
MORE = 556
# for a pair: coupling, k, q, b, angle, spring for `band_pairs`, its answer, its scratch, its table
ARC = MORE
ANSWER = ARC + 6
SCRATCH = ANSWER + 12
TABLE = SCRATCH + band_pairs.WAVE
# for a contact: the wall and how far away the site is; amplitudes of its flight and their slopes in
# gamma; moments of the chain at that distance, and the weights of these in the amplitudes
WALL, DISTANCE = MORE, MORE + 1
POWERS, TERMS = 13, 19
OWN, SLOPE = MORE + 2, MORE + 2 + 1 + POWERS
MOMENTS = SLOPE + 1 + POWERS
WEIGHTS = MOMENTS + TERMS
MOTION = WEIGHTS + POWERS * TERMS  # displacement, velocity, acceleration; then those in gamma


def unpack(z: Any, data: Any) -> int:
    """Put the freed parameters in their places; 1 if one of them is outside of the domain."""
    for i in range(int(data[FREED])):
        place, value = int(data[PLACES + 2 * i]), z[2 + int(data[UNKNOWNS]) + i]
        data[place] = data[PLACES + 2 * i + 1] * value
        if place == GAMMA:
            if not 0.0 <= value < 0.25:
                return 1
            expansion = int(data[MEANS])
            for to in (CHI, SIGMA, ETA):
                expansion = mean(data, expansion, to)
    return 0 if 0.0 <= data[K] <= 1.0 else 1


def mean(data: Any, at: int, to: int) -> int:
    """A mean over the modes of the infinite chain and its slope in gamma; where the next begins."""
    # the square of the upper edge of the band, in which the mean is a sum of poles and powers
    x = 4.0 * data[GAMMA]
    poles, powers = int(data[at + 1]), int(data[at + 2])
    first = at + 3 + 2 * poles
    total = slope = 0.0
    for i in range(powers):
        # by the rule of Horner, the highest power first
        total = total * x + data[first + i]
        slope = slope * x + data[first + powers + i]
    total = total * x + data[at]
    for i in range(poles):
        weight, width = data[at + 3 + 2 * i], data[at + 4 + 2 * i]
        z = x / width
        # weight (1/r - 1), written without the cancellation at small coupling
        r = math.sqrt(1.0 - z)
        total += weight * (z / (r * (1.0 + r)))
        slope += weight / width * (0.5 / ((1.0 - z) * r))
    data[to] = total
    data[to + 1] = 4.0 * slope  # dx/dgamma
    return first + 2 * powers


def drive(data: Any, t: float) -> None:
    """f and its first three derivatives."""
    for order in range(4):
        data[F + order] = 0.0
    for i in range(int(data[HARMONICS])):
        m = data[FIRST + 3 * i]
        c, s = math.cos(m * t), math.sin(m * t)
        even = data[FIRST + 3 * i + 1] * c + data[FIRST + 3 * i + 2] * s
        odd = data[FIRST + 3 * i + 2] * c - data[FIRST + 3 * i + 1] * s
        data[F] += even
        data[F + 1] += odd * m
        data[F + 2] -= even * m * m
        data[F + 3] -= odd * m * m * m


def driven(data: Any, i: int, t: float, order: int) -> float:
    """Derivative of ``a f^(order)(t)`` in freed parameter i."""
    place = int(data[PLACES + 2 * i])
    if place == A:
        slope: float = data[F + order]
        return slope
    if place < FIRST:
        return 0.0
    m = data[place - (place - FIRST) % 3]
    # a derivative of cos mt turns it ahead by pi/2 and brings a factor m; sin mt lags by pi/2
    angle = m * t + 0.5 * math.pi * (order - ((place - FIRST) % 3 - 1))
    return data[A] * data[PLACES + 2 * i + 1] * math.cos(angle) * m**order


def terms(z: Any, data: Any, mean: int) -> ClosureTerms:
    """What the equations are made of, with one of the means."""
    a = data[A]
    return ClosureTerms(z[0], data[K], data[mean], a * data[F], a * data[F + 1], a * data[F + 2])


def terms_slope(z: Any, data: Any, mean: int, column: int) -> ClosureTerms:
    """Their derivatives in one entry of z."""
    p = k = by_mean = u = v = w = 0.0
    i = column - 2 - int(data[UNKNOWNS])
    if column == 0:
        p = 1.0
    elif column == 1:
        a = data[A]
        u, v, w = a * data[F + 1], a * data[F + 2], a * data[F + 3]
    elif i >= 0 and int(data[PLACES + 2 * i]) == GAMMA:
        by_mean = data[mean + 1]
    elif i >= 0 and int(data[PLACES + 2 * i]) == K:
        k = 1.0
    elif i >= 0:
        u, v, w = driven(data, i, z[1], 0), driven(data, i, z[1], 1), driven(data, i, z[1], 2)
    return ClosureTerms(p, k, by_mean, u, v, w)


# --- the equations ------------------------------------------------------------------------------


def closure(z: Any, data: Any, out: Any) -> int:
    """Both equations (11)."""
    if unpack(z, data) != 0:
        return 1
    drive(data, z[1])
    out[0], out[1] = closure_equations(terms(z, data, CHI))
    return 0


def closure_slopes(z: Any, data: Any, out: Any) -> int:
    """Their derivatives, row by row."""
    if unpack(z, data) != 0:
        return 1
    drive(data, z[1])
    t, width = terms(z, data, CHI), 2 + int(data[UNKNOWNS]) + int(data[FREED])
    for i in range(width):
        out[i], out[width + i] = closure_derivative(t, terms_slope(z, data, CHI, i))
    return 0


def fold(z: Any, data: Any, out: Any) -> int:
    """(11) and the determinant of its derivatives, eq. (14)."""
    if closure(z, data, out) != 0:
        return 1
    out[2] = fold_scalar(terms(z, data, CHI))
    return 0


def fold_slopes(z: Any, data: Any, out: Any) -> int:
    """Their derivatives, row by row."""
    if closure_slopes(z, data, out) != 0:
        return 1
    t, width = terms(z, data, CHI), 2 + int(data[FREED])
    for i in range(width):
        out[2 * width + i] = fold_derivative(t, terms_slope(z, data, CHI, i))
    return 0


def pitchfork(z: Any, data: Any, out: Any) -> int:
    """(11) and ``a f'' - 2 p sigma``."""
    if closure(z, data, out) != 0:
        return 1
    out[2] = pitchfork_scalar(terms(z, data, SIGMA))
    return 0


def pitchfork_slopes(z: Any, data: Any, out: Any) -> int:
    """Their derivatives, row by row."""
    if closure_slopes(z, data, out) != 0:
        return 1
    t, width = terms(z, data, SIGMA), 2 + int(data[FREED])
    for i in range(width):
        out[2 * width + i] = pitchfork_derivative(t, terms_slope(z, data, SIGMA, i))
    return 0


# --- a pair on the circle -----------------------------------------------------------------------


# where `band_pairs` find what they ask for
on_arc = bound(
    band_pairs.pair_equations,
    **{name: ARC + getattr(band_pairs, name) for name in ("GAMMA", "K", "ENTRY", "NU", "SPRING")},
    **{
        name: SCRATCH + getattr(band_pairs, name)
        for name in ("REGULAR", "IN_NU", "IN_GAMMA", "IN_SPRING", "TAIL", "PASCAL", "MEANS")
    },
    ANSWER=ANSWER,
    TABLE=TABLE,
)


def pair(z: Any, data: Any, out: Any) -> int:
    """(11) and both parts of F, eqs. of `arc`."""
    if closure(z, data, out) != 0 or looked(z, data) != 0:
        return 1
    out[2], out[3] = data[ANSWER], data[ANSWER + 1]
    return 0


def looked(z: Any, data: Any) -> int:
    """F at this b and angle; 1 off the band."""
    nu = z[2]
    data[ARC], data[ARC + 1], data[ARC + 4] = data[GAMMA], data[K], nu
    data[ARC + 3] = saltation_of(terms(z, data, ETA))
    if not 0.0 < nu * nu < 4.0 * data[GAMMA]:
        return 1
    return on_arc(data, data, data, data)


def pair_slopes(z: Any, data: Any, out: Any) -> int:
    """Their derivatives, row by row."""
    if closure_slopes(z, data, out) != 0 or looked(z, data) != 0:
        return 1
    t = terms(z, data, ETA)
    for i in range(5):
        by_b = saltation_derivative(t, terms_slope(z, data, ETA, i))
        place = int(data[PLACES + 2 * (i - 3)]) if i > 2 else 0
        # F itself changes with the angle, the coupling and k
        own = ANSWER + (2 if i == 2 else 4 if place == GAMMA else 6 if place == K else 0)
        for row in range(2):
            direct = data[own + row] if own > ANSWER else 0.0
            out[10 + 5 * row + i] = data[ANSWER + 8 + row] * by_b + direct
    return 0


# --- a site that touches a wall -------------------------------------------------------------


def free_flight(data: Any) -> None:
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
    free_flight(data)
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


listed("ppp", closure, closure_slopes, fold, fold_slopes, pitchfork, pitchfork_slopes)
listed("ppp", pair, pair_slopes, contact, contact_slopes)
# the engine's own fold, which knows no closed form
_NULL = {"evaluate": closure, "derive": closure_slopes, "N": 2}
listed("ppp", bound(null_vectors.conditions, **_NULL), bound(null_vectors.null_slopes, **_NULL))
