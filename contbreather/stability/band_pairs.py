"""The equations of a Neimark-Sacker point of the infinite chain, and where they have roots.

Letters and formulas are those of `contbreather.stability.arc`, at one angle of the band at a time.
`table` holds the tails of `characteristic`, three times `POWERS` rows of `ORDERS` numbers, and
after them the moments of the chain.
"""

from __future__ import annotations

import math
from typing import Any

from contbreather.kernels import Kernel, Vector

EXACT = 3  # aliases m = -3..3 are exact
ORDERS = 11  # of 4 gamma/s^2 <= 1/49: 49^-11 is below rounding
POWERS = 13  # of (nu/7)^2 <= 2/49 for |nu|^2 <= 2
GRID = 64  # angles of the band that are looked at first
TAILS = 3 * POWERS * ORDERS
TABLE = ANSWER = 0  # where table and answer begin
ROUNDING = 4e-16

# data: coupling, restitution, q, then b and the angle of `pair_equations`, and the spring
GAMMA, K, Q, ENTRY, NU, SPRING = range(6)
# out: where R, B, C are left, and their slopes in nu, gamma and the spring; then tails at gamma, in
# powers of nu^2, with their slopes; then a row of Pascal's triangle, and means of powers of w^2
# with their slopes; then v and nu at the latest angle
REGULAR, IN_NU, IN_GAMMA, IN_SPRING, TAIL = 0, 3, 6, 9, 12
PASCAL = TAIL + 9 * POWERS
MEANS = PASCAL + ORDERS + 1
WAVE = MEANS + 3 * ORDERS
VALUES = WAVE + 2  # of the equation for the angle on the grid
FOUND = VALUES + GRID + 1  # three samples of angle, equation and b; then bend, vertex and height
SIZE = FOUND + 12


def band_averages(data: Any, table: Any, out: Any) -> None:
    """<w^2j> over the band, ``w^2 = spring + w_0^2`` with w_0 of the chain without springs, and
    their slopes in gamma and the spring."""
    x = 4.0 * data[GAMMA]
    for i in range(ORDERS + 1):
        out[PASCAL + i] = 1.0 if i == 0 else 0.0
    for j in range(ORDERS):
        value = in_gamma = 0.0
        power = below = 1.0  # x^i, x^(i-1)
        for i in range(j + 1):
            term = out[PASCAL + i] * table[TABLE + TAILS + i]
            value += term * power
            if i > 0:
                in_gamma += term * 4.0 * i * below
            below = power
            power = power * x
        out[MEANS + j], out[MEANS + ORDERS + j] = value, in_gamma
        out[MEANS + 2 * ORDERS + j] = j * out[MEANS + j - 1] if j > 0 else 0.0
        for i in range(j + 1, 0, -1):  # binomials times powers of the spring
            out[PASCAL + i] = data[SPRING] * out[PASCAL + i] + out[PASCAL + i - 1]
        out[PASCAL] = data[SPRING] * out[PASCAL]


def tails(data: Any, table: Any, out: Any) -> None:
    """Of R/nu, B, C at this coupling, and their slopes in gamma and the spring."""
    band_averages(data, table, out)
    for row in range(3 * POWERS):
        for which in range(3):
            total = 0.0
            for j in range(ORDERS):
                total += table[TABLE + row * ORDERS + j] * out[MEANS + which * ORDERS + j]
            out[TAIL + which * 3 * POWERS + row] = total


def tail(out: Any, which: int, z: float) -> float:
    """One of the tails as a polynomial in ``z = nu^2``."""
    total = 0.0
    for i in range(POWERS - 1, -1, -1):
        total = total * z + out[TAIL + which * POWERS + i]
    return total


def tail_slope(out: Any, which: int, z: float) -> float:
    """Its derivative in z."""
    total = 0.0
    for i in range(POWERS - 1, 0, -1):
        total = total * z + i * out[TAIL + which * POWERS + i]
    return total


def regular(data: Any, out: Any, nu: float) -> None:
    """R, B, C at an angle."""
    z, x = nu * nu, 4.0 * data[GAMMA]
    R, B, C = nu * tail(out, 0, z), tail(out, 1, z), tail(out, 2, z) + 1.0 / math.pi
    for m in range(-EXACT, EXACT + 1):
        if m != 0:
            s = nu + 2.0 * m
            A = s * s - data[SPRING]
            h = s * s / A / math.sqrt(1.0 - x / A)  # -s^2 g(s)
            R -= h / s / math.pi
            B += h / (s * s) / math.pi
            C += (1.0 - h) / math.pi
    out[REGULAR], out[REGULAR + 1], out[REGULAR + 2] = R, B, C


def regular_slopes(data: Any, out: Any, nu: float) -> None:
    """Their derivatives in nu, gamma and the spring."""
    z, x = nu * nu, 4.0 * data[GAMMA]
    out[IN_NU] = tail(out, 0, z) + 2.0 * z * tail_slope(out, 0, z)
    out[IN_NU + 1] = 2.0 * nu * tail_slope(out, 1, z)
    out[IN_NU + 2] = 2.0 * nu * tail_slope(out, 2, z)
    for place, first in ((IN_GAMMA, 3), (IN_SPRING, 6)):
        out[place] = nu * tail(out, first, z)
        out[place + 1] = tail(out, first + 1, z)
        out[place + 2] = tail(out, first + 2, z)
    for m in range(-EXACT, EXACT + 1):
        if m != 0:
            s = nu + 2.0 * m
            s2, spring = s * s, data[SPRING]
            A = s2 - spring
            edge = A - x
            h = s2 / A / math.sqrt(1.0 - x / A)
            # d ln h/ds = 2/s - s (A + edge)/(A edge), which would cancel for large s
            h_s = -h * (A * x + spring * (A + edge)) / (s * A * edge)
            out[IN_NU] -= (h_s - h / s) / s / math.pi
            out[IN_NU + 1] += (h_s - 2.0 * h / s) / s2 / math.pi
            out[IN_NU + 2] -= h_s / math.pi
            # h = s^2/sqrt(A edge): by gamma edge falls by 4, by the spring A and edge by 1
            by_gamma = 2.0 * h / edge
            by_spring = 0.5 * h * (A + edge) / (A * edge)
            for place, slope in ((IN_GAMMA, by_gamma), (IN_SPRING, by_spring)):
                out[place] -= slope / s / math.pi
                out[place + 1] += slope / s2 / math.pi
                out[place + 2] -= slope / math.pi


# --- the two equations and their derivatives ------------------------------------------------


def pair_equations(data: Vector, table: Vector, out: Vector, answer: Vector) -> int:
    """F at an angle, and its derivatives in nu, gamma, k, b and the spring: six pairs."""
    gamma, nu = data[GAMMA], data[NU]
    tails(data, table, out)
    regular(data, out, nu)
    regular_slopes(data, out, nu)
    low = nu * nu - data[SPRING]
    high = 4.0 * gamma - low
    # v^2 = low high: 2 v v' is 2 nu (high - low) by nu, 4 low by gamma, low - high by the spring
    v = math.sqrt(low * high)
    pair(data, out, answer, v)
    slope(data, out, answer, 1, v, 1.0, nu * (high - low) / v, IN_NU, 0.0, 0.0)
    slope(data, out, answer, 2, v, 0.0, 2.0 * low / v, IN_GAMMA, 0.0, 0.0)
    slope(data, out, answer, 3, v, 0.0, 0.0, -1, 1.0, 0.0)
    slope(data, out, answer, 4, v, 0.0, 0.0, -1, 0.0, 1.0)
    slope(data, out, answer, 5, v, 0.0, 0.5 * (low - high) / v, IN_SPRING, 0.0, 0.0)
    return 0


def pair(data: Any, out: Any, answer: Any, v: float) -> None:
    """Real and imaginary part of F."""
    value = out[REGULAR], out[REGULAR + 1], out[REGULAR + 2]
    smooth, L = smooth_and_L(data[NU], data[K], data[ENTRY], value)
    # F = v D with v g = -i
    answer[ANSWER] = v * smooth.real + L.imag / math.pi
    answer[ANSWER + 1] = v * smooth.imag - L.real / math.pi


def slope(
    data: Any, out: Any, answer: Any, which: int, v: float, by_nu: float, by_v: float, place: int,
    by_k: float, by_b: float,
) -> None:  # fmt: skip
    """Their derivative in one direction."""
    nu, k, b = data[NU], data[K], data[ENTRY]
    value, change = (out[REGULAR], out[REGULAR + 1], out[REGULAR + 2]), (0.0, 0.0, 0.0)
    if place >= 0:
        change = out[place], out[place + 1], out[place + 2]
    smooth, _ = smooth_and_L(nu, k, b, value)
    by_smooth, by_L = smooth_and_L_slopes(nu, k, b, value, change, by_nu, by_k, by_b)
    at = ANSWER + 2 * which
    answer[at] = by_v * smooth.real + v * by_smooth.real + by_L.imag / math.pi
    answer[at + 1] = by_v * smooth.imag + v * by_smooth.imag - by_L.real / math.pi


def smooth_and_L(nu: Any, k: Any, b: Any, value: Any) -> tuple[Any, Any]:
    """``D = smooth + (g/pi) L``: both parts, see `contbreather.stability.characteristic`; g is the
    in-band alias. Of numbers and of arrays, on the band and off it."""
    R, B, C = value
    c, beta = 1.0 + k, b - (1.0 + k) * (1.0 + k) * C
    a = 0.5 * (1.0 - k) + 1j * c * R
    return a * a + B * beta, 2j * c * nu * a - beta - c * c * nu * nu * B


def smooth_and_L_slopes(
    nu: Any, k: Any, b: Any, value: Any, slope: Any, by_nu: float, by_k: float, by_b: float
) -> tuple[Any, Any]:
    """Their derivatives in one direction, by the product rule."""
    R, B, C = value
    by_R, by_B, by_C = slope
    c, beta = 1.0 + k, b - (1.0 + k) * (1.0 + k) * C
    a, by_a = 0.5 * (1.0 - k) + 1j * c * R, 1j * (by_k * R + c * by_R) - 0.5 * by_k
    by_beta = by_b - c * (2.0 * by_k * C + c * by_C)
    turned = by_k * nu * a + c * (by_nu * a + nu * by_a)
    band = 2.0 * (by_k * nu + c * by_nu) * B + c * nu * by_B
    return 2.0 * a * by_a + by_B * beta + B * by_beta, 2j * turned - by_beta - c * nu * band


# --- between which values of b a pair is outside --------------------------------------------


def equation(data: Any, out: Any, alpha: float) -> float:
    """(v/nu) times the equation for the angle of a Neimark-Sacker point: negative at both ends of
    the band, where alpha is 0 and pi/2, ``nu^2 = spring + 4 gamma sin(alpha)^2``."""
    gamma, q = data[GAMMA], data[Q]
    sine, cosine = math.sin(alpha), math.cos(alpha)
    edge = 2.0 * math.sqrt(gamma)
    nu, v, root = edge * sine, 4.0 * gamma * sine * cosine, edge * cosine
    if data[SPRING] > 0.0:
        nu = math.sqrt(data[SPRING] + nu * nu)
        root = v / nu
    regular(data, out, nu)
    R, B = out[REGULAR], out[REGULAR + 1]
    out[WAVE], out[WAVE + 1] = nu, v
    square = (R + nu * B) * (R + nu * B) - 0.25 * q * q
    return root * square - q * (1.0 / math.pi - math.pi * v * root * R * B)


def needed(data: Any, out: Any) -> float:
    """The b that brings D to zero at the angle that was looked at last."""
    nu, v, c = out[WAVE], out[WAVE + 1], 1.0 + data[K]
    R, B, C = out[REGULAR], out[REGULAR + 1], out[REGULAR + 2]
    return float(c * c * (C - nu * (2.0 * R + nu * B) - math.pi * data[Q] * v * R))


def pair_window(data: Vector, table: Vector, out: Vector, answer: Vector) -> int:
    """Centre and square of the `Window`, and the angles at its ends, 0 where it has none; how many
    roots there are, the b of each and their angles."""
    tails(data, table, out)
    step, top = 0.5 * math.pi / GRID, 0
    for i in range(1, GRID):
        out[VALUES + i] = equation(data, out, i * step)
    out[VALUES] = out[VALUES + GRID] = -data[Q] / math.pi
    for i in range(GRID + 1):
        if out[VALUES + i] > out[VALUES + top]:
            top = i
    roots = 0
    if out[VALUES + top] > 0.0:
        for i in range(GRID):
            roots += bracketed(data, out, answer, roots, i * step, i * step + step,
                               out[VALUES + i], out[VALUES + i + 1])  # fmt: skip
    else:
        refine_maximum(data, out, top)
        middle = out[FOUND + 3]
        if out[FOUND + 4] > 0.0:  # a pair of roots between two nodes
            i = int(middle / step)
            roots += bracketed(data, out, answer, roots, i * step, middle,
                               out[VALUES + i], out[FOUND + 4])  # fmt: skip
            roots += bracketed(data, out, answer, roots, middle, i * step + step,
                               out[FOUND + 4], out[VALUES + i + 1])  # fmt: skip
    answer[4] = roots
    for i in range(4):
        answer[5 + i] = answer[i]
    if roots == 2:
        first, second = answer[0], answer[1]
        answer[0], answer[1] = 0.5 * (first + second), 0.25 * (first - second) * (first - second)
        if first > second:
            answer[2], answer[3] = answer[3], answer[2]
    else:
        answer[2] = answer[3] = 0.0
        refine_maximum(data, out, top)
        unopened(out, answer)
    return 0


def bracketed(
    data: Any, out: Any, answer: Any, count: int, low: float, high: float, first: float, last: float
) -> int:
    """The b of the one root between two angles, of which at most two are kept; how many there
    are: secants, kept inside."""
    if (first > 0.0) == (last > 0.0):
        return 0
    rising = last > first
    old, new, before, after = low, high, first, last
    for _ in range(80):
        if after == 0.0:
            break
        slope = (after - before) / (new - old if new != old else 1.0)
        step = new - after / slope if slope != 0.0 else math.inf
        old, before = new, after
        new = step if low <= step <= high else 0.5 * (low + high)
        if abs(new - old) <= ROUNDING:
            break
        after = equation(data, out, new)
        if (after < 0.0) == rising:
            low = new
        else:
            high = new
    equation(data, out, new)
    if count < 2:
        answer[count], answer[2 + count] = needed(data, out), out[WAVE]
    return 1


def refine_maximum(data: Any, out: Any, top: int) -> None:
    """Three samples around the one maximum of the equation, closer and closer to it."""
    step = 0.5 * math.pi / GRID
    i = min(max(top, 1), GRID - 1)
    around(data, out, i * step, step)
    for place in (-1, 0, 1):
        out[FOUND + 3 * place + 4] = out[VALUES + i + place]
    parabola(out)
    while step > 1e-4 and abs(out[FOUND + 11]) < out[FOUND + 9]:
        middle = out[FOUND + 3] + step * out[FOUND + 10]
        step *= 0.05
        around(data, out, min(max(middle, step), 0.5 * math.pi - step), step)
        parabola(out)


def around(data: Any, out: Any, middle: float, step: float) -> None:
    for place in (-1, 0, 1):
        alpha = middle + place * step
        at = FOUND + 3 * (place + 1)
        out[at] = alpha
        out[at + 1] = equation(data, out, alpha)
        out[at + 2] = needed(data, out)


def parabola(out: Any) -> None:
    y0, y1, y2 = out[FOUND + 1], out[FOUND + 4], out[FOUND + 7]
    bend, tilt = 2.0 * y1 - y0 - y2, y2 - y0
    # y1 + tilt x/2 - bend x^2/2 through all three, in units of the step; y1 + tilt vertex/4 on top
    vertex = min(max(0.5 * tilt / bend, -1.0), 1.0) if bend > 0.0 else 0.0
    out[FOUND + 9], out[FOUND + 10] = bend, vertex
    out[FOUND + 11] = y1 + 0.25 * tilt * vertex


def unopened(out: Any, answer: Any) -> None:
    """Where no b brings a pair out: how far it is from that."""
    b0, b1, b2 = out[FOUND + 2], out[FOUND + 5], out[FOUND + 8]
    bend, x, height = out[FOUND + 9], out[FOUND + 10], out[FOUND + 11]
    rise = 0.5 * (b2 - b0)
    # the parabola has its roots sqrt(2 height/bend) from its vertex: b is rise times as far off
    square = 2.0 * height * rise * rise / bend if bend > 0.0 else -1.0
    answer[0] = b1 + x * rise + 0.5 * x * x * (b0 - 2.0 * b1 + b2)
    answer[1] = min(square, 0.0)


ON_ARC, WINDOW = Kernel(pair_equations), Kernel(pair_window)
