"""The equations of a Neimark-Sacker point of the infinite chain, and where they have roots.

Letters and formulas are those of `contbreather.stability.one_impact`, one angle at a time.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from contbreather.kernels import ComplexVector, Cube, Kernel, Matrix, Vector, fixed, inlined
from contbreather.lattice.band_averages import polynomial

EXACT = 3  # aliases m = -3..3 are exact
ORDERS = 11  # of 4 gamma/s^2 <= 1/49: 49^-11 is below rounding
POWERS = 13  # of (nu/7)^2 <= 2/49 for |nu|^2 <= 2
GRID = 64  # angles of the band that are looked at first

Triple = tuple[float, float, float]  # R, B, C


class ChainWithImpacts(NamedTuple):
    """The infinite chain, with springs to the ground, and the impacts of one of its sites."""

    gamma: float
    k: float
    spring: float


@fixed
class BandWorkspace(NamedTuple):
    """Tails of R/nu, B, C, and room for what is made of them at one coupling; in polynomials the
    highest power is the first."""

    expansions: Cube  # coefficients of nu^2i, as polynomials in 4 gamma
    by_spring: Cube  # their slopes in the spring
    tails: Cube  # at this coupling, and their slopes in gamma and the spring
    values: Vector  # of the equation for the angle on the grid
    around: Matrix  # angle, equation and b of three samples


def find_tails(gamma: float, work: BandWorkspace) -> None:
    """At this coupling, and their slopes in gamma and the spring."""
    x, tails = 4.0 * gamma, work.tails
    for row in range(3):
        for i in range(POWERS):
            value, slope = polynomial(work.expansions[row, i], x)
            tails[0, row, i], tails[1, row, i] = value, 4.0 * slope
            tails[2, row, i], _ = polynomial(work.by_spring[row, i], x)


@inlined
def regular_sums(on: ChainWithImpacts, tails: Cube, nu: float) -> Triple:
    """R, B, C at an angle."""
    (R, _), (B, _), (C, _) = tails_at(tails, 0, nu * nu)
    total = nu * R, B, C + 1.0 / math.pi
    for m in range(-EXACT, EXACT + 1):
        if m != 0:
            s = nu + 2.0 * m
            A = s * s - on.spring
            total = plus(total, share(s, -1.0 / (A * math.sqrt(1.0 - 4.0 * on.gamma / A)), 1.0))
    return total


@inlined
def tails_at(tails: Cube, way: int, z: float) -> Any:
    """Evaluate R/nu, B, C or one of their slopes, with derivatives in ``z = nu^2``."""
    return polynomial(tails[way, 0], z), polynomial(tails[way, 1], z), polynomial(tails[way, 2], z)


@inlined
def regular_sum_slopes(
    on: ChainWithImpacts, tails: Cube, nu: float
) -> tuple[Triple, Triple, Triple]:
    """Their derivatives in nu, gamma and the spring."""
    z = nu * nu
    (r, r_z), (_, b_z), (_, c_z) = tails_at(tails, 0, z)
    (r_gamma, _), (b_gamma, _), (c_gamma, _) = tails_at(tails, 1, z)
    (r_spring, _), (b_spring, _), (c_spring, _) = tails_at(tails, 2, z)
    in_nu = r + 2.0 * z * r_z, 2.0 * nu * b_z, 2.0 * nu * c_z
    in_gamma, in_spring = (nu * r_gamma, b_gamma, c_gamma), (nu * r_spring, b_spring, c_spring)
    for m in range(-EXACT, EXACT + 1):
        if m != 0:
            s = nu + 2.0 * m
            A = s * s - on.spring
            edge = A - 4.0 * on.gamma
            g = -1.0 / (A * math.sqrt(edge / A))
            both = (A + edge) / (A * edge)  # g^2 = 1/(A edge)
            g_s = g * (-s * both)
            in_nu = plus(in_nu, (g + s * g_s, -g_s, s * (2.0 * g + s * g_s)))
            in_gamma = plus(in_gamma, share(s, g * (2.0 / edge), 0.0))
            in_spring = plus(in_spring, share(s, g * (0.5 * both), 0.0))
    return in_nu, in_gamma, in_spring


def share(s: Any, g: Any, rest: float) -> tuple[Any, Any, Any]:
    """Share of an alias s in pi R, pi B and pi C, with a rest of 1; or its change with g."""
    sg = s * g
    return sg, -g, rest + s * sg


def plus(total: Any, part: Any) -> tuple[Any, Any, Any]:
    """R, B, C or their slopes with one more share."""
    return total[0] + part[0] / math.pi, total[1] + part[1] / math.pi, total[2] + part[2] / math.pi


def sums_along(on: ChainWithImpacts, work: BandWorkspace, nu: Vector, out: Matrix) -> None:
    """R, B, C at angles up to 1, in rows, and the slope of R."""
    find_tails(on.gamma, work)
    for i in range(nu.size):
        R, B, C = regular_sums(on, work.tails, nu[i])
        (by_nu, _, _), _, _ = regular_sum_slopes(on, work.tails, nu[i])
        out[i, 0], out[i, 1], out[i, 2], out[i, 3] = R, B, C, by_nu


# --- the two equations and their derivatives ------------------------------------------------


VALUE, BY_NU, BY_GAMMA, BY_K, BY_B, BY_SPRING = range(6)  # in `pair_equations`


def pair_equations(
    on: ChainWithImpacts, work: BandWorkspace, b: float, nu: float, out: ComplexVector
) -> None:
    """F at an angle, and its derivatives."""
    gamma, k, spring = on
    find_tails(on.gamma, work)
    value, still = regular_sums(on, work.tails, nu), (0.0, 0.0, 0.0)
    in_nu, in_gamma, in_spring = regular_sum_slopes(on, work.tails, nu)
    low = nu * nu - spring
    high = 4.0 * gamma - low
    # v^2 = low high: 2 v v' is 2 nu (high - low) by nu, 4 low by gamma, low - high by the spring
    v = math.sqrt(low * high)
    smooth, L = smooth_and_L(nu, k, b, value)
    add_alias(out, VALUE, v, smooth, L, 0.0, smooth)
    smooth_nu, L_nu = smooth_and_L_slopes(nu, k, b, value, in_nu, 1.0, 0.0, 0.0)
    add_alias(out, BY_NU, v, smooth_nu, L_nu, nu * (high - low) / v, smooth)
    smooth_gamma, L_gamma = smooth_and_L_slopes(nu, k, b, value, in_gamma, 0.0, 0.0, 0.0)
    add_alias(out, BY_GAMMA, v, smooth_gamma, L_gamma, 2.0 * low / v, smooth)
    smooth_k, L_k = smooth_and_L_slopes(nu, k, b, value, still, 0.0, 1.0, 0.0)
    add_alias(out, BY_K, v, smooth_k, L_k, 0.0, smooth)
    smooth_b, L_b = smooth_and_L_slopes(nu, k, b, value, still, 0.0, 0.0, 1.0)
    add_alias(out, BY_B, v, smooth_b, L_b, 0.0, smooth)
    smooth_spring, L_spring = smooth_and_L_slopes(nu, k, b, value, in_spring, 0.0, 0.0, 0.0)
    add_alias(out, BY_SPRING, v, smooth_spring, L_spring, 0.5 * (low - high) / v, smooth)


def add_alias(
    out: ComplexVector, which: int, v: float, change: complex, L: complex, by_v: float,
    smooth: complex,
) -> None:  # fmt: skip
    """``F = v D`` from both parts of D, or how it changes as they and v do: v g = -i."""
    real = by_v * smooth.real + v * change.real + L.imag / math.pi
    imag = by_v * smooth.imag + v * change.imag - L.real / math.pi
    out[which] = complex(real, imag)


def smooth_and_L(nu: Any, k: Any, b: Any, value: Any) -> tuple[Any, Any]:
    """``D = smooth + (g/pi) L``: both parts, see `contbreather.stability.one_impact`; g is the
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


@inlined
def at_angle(on: ChainWithImpacts, tails: Cube, alpha: float) -> Triple:
    """(v/nu) times the equation for the angle of a Neimark-Sacker point: negative at both ends of
    the band, where alpha is 0 and pi/2, ``nu^2 = spring + 4 gamma sin(alpha)^2``. The b that brings
    D to zero there, if the equation holds; and nu."""
    gamma, k, spring = on
    c, q = 1.0 + k, (1.0 - k) / (1.0 + k)
    sine, cosine = math.sin(alpha), math.cos(alpha)
    edge = 2.0 * math.sqrt(gamma)
    nu, v, root = edge * sine, 4.0 * gamma * sine * cosine, edge * cosine
    if spring > 0.0:
        nu = math.sqrt(spring + nu * nu)
        root = v / nu
    R, B, C = regular_sums(on, tails, nu)
    square = (R + nu * B) * (R + nu * B) - 0.25 * q * q
    value = root * square - q * (1.0 / math.pi - math.pi * v * root * R * B)
    return value, c * c * (C - nu * (2.0 * R + nu * B) - math.pi * q * v * R), nu


def equation(on: ChainWithImpacts, tails: Cube, alpha: float) -> float:
    value, _, _ = at_angle(on, tails, alpha)
    return value


def pair_windows(
    gammas: Vector, springs: Vector, k: float, expansions: Cube, work: BandWorkspace,
    windows: Matrix, roots: Matrix,
) -> None:  # fmt: skip
    """`pair_window` of many chains, in rows; the roots of the last."""
    for i in range(gammas.size):
        first = 3 * i if expansions.shape[0] > 3 else 0
        own = BandWorkspace(
            expansions[first : first + 3], work.by_spring, work.tails, work.values, work.around
        )
        pair_window(ChainWithImpacts(gammas[i], k, springs[i]), own, windows[i], roots)


def pair_window(on: ChainWithImpacts, work: BandWorkspace, window: Vector, roots: Matrix) -> None:
    """Centre and square of the `Window`, and the angles at its ends, where it has none that where
    it will open; angle and b of each root, in rows."""
    find_tails(on.gamma, work)
    step, values, top, count = 0.5 * math.pi / GRID, work.values, 0, 0
    for i in range(1, GRID):
        values[i] = equation(on, work.tails, i * step)
    values[0] = values[GRID] = -(1.0 - on.k) / (1.0 + on.k) / math.pi
    for i in range(GRID + 1):
        if values[i] > values[top]:
            top = i
    if values[top] > 0.0:
        for i in range(GRID):
            count += bracketed(on, work.tails, roots, count, i * step, i * step + step,
                               values[i], values[i + 1])  # fmt: skip
    else:
        refine_maximum(on, work, top)
        middle, highest = work.around[1, 0], work.around[1, 1]
        if highest > 0.0:  # a pair of roots between two nodes
            i = int(middle / step)
            count += bracketed(on, work.tails, roots, count, i * step, middle,
                               values[i], highest)  # fmt: skip
            count += bracketed(on, work.tails, roots, count, middle, i * step + step,
                               highest, values[i + 1])  # fmt: skip
    if count == 2:
        lower = 1 if roots[0, 1] > roots[1, 1] else 0
        apart = roots[0, 1] - roots[1, 1]
        window[0], window[1] = 0.5 * (roots[0, 1] + roots[1, 1]), 0.25 * apart * apart
        window[2], window[3] = roots[lower, 0], roots[1 - lower, 0]
    else:
        # no b brings a pair out: how far it is from that
        curvature, x, height = refine_maximum(on, work, top)
        b0, b1, b2 = work.around[0, 2], work.around[1, 2], work.around[2, 2]
        rise = 0.5 * (b2 - b0)
        # the parabola has its roots sqrt(2 height/curvature) from its vertex: b is rise times as
        # far off
        square = 2.0 * height * rise * rise / curvature if curvature > 0.0 else -1.0
        window[0] = b1 + x * rise + 0.5 * x * x * (b0 - 2.0 * b1 + b2)
        window[1] = min(square, 0.0)
        step = work.around[2, 0] - work.around[1, 0]
        _, _, angle = at_angle(on, work.tails, work.around[1, 0] + x * step)
        window[2] = window[3] = angle


def bracketed(
    on: ChainWithImpacts, tails: Cube, roots: Matrix, count: int, low: float, high: float,
    first: float, last: float,
) -> int:  # fmt: skip
    """Find the root between two angles, by secants kept inside; 1, or 0 if there is none."""
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
        if abs(new - old) <= 4e-16:  # rounding of an angle
            break
        after = equation(on, tails, new)
        if (after < 0.0) == rising:
            low = new
        else:
            high = new
    if count < 2:
        _, roots[count, 1], roots[count, 0] = at_angle(on, tails, new)
    return 1


def refine_maximum(on: ChainWithImpacts, work: BandWorkspace, top: int) -> Triple:
    """Three samples closer and closer to the maximum of the equation; their `parabola`."""
    step, around = 0.5 * math.pi / GRID, work.around
    i = min(max(top, 1), GRID - 1)
    look_around(on, work, i * step, step)
    for place in range(3):
        around[place, 1] = work.values[i + place - 1]
    curvature, vertex, height = parabola(around)
    while step > 1e-4 and abs(height) < curvature:
        middle = around[1, 0] + step * vertex
        step *= 0.05
        look_around(on, work, min(max(middle, step), 0.5 * math.pi - step), step)
        curvature, vertex, height = parabola(around)
    return curvature, vertex, height


def look_around(on: ChainWithImpacts, work: BandWorkspace, middle: float, step: float) -> None:
    for place in range(3):
        alpha = middle + (place - 1) * step
        work.around[place, 0] = alpha
        work.around[place, 1], work.around[place, 2], _ = at_angle(on, work.tails, alpha)


def parabola(around: Matrix) -> Triple:
    """Its curvature, where its vertex is in units of the step, and how high."""
    y0, y1, y2 = around[0, 1], around[1, 1], around[2, 1]
    curvature, tilt = 2.0 * y1 - y0 - y2, y2 - y0
    # y1 + tilt x/2 - curvature x^2/2 through all three, in units of the step; y1 + tilt vertex/4
    # on top
    vertex = min(max(0.5 * tilt / curvature, -1.0), 1.0) if curvature > 0.0 else 0.0
    return curvature, vertex, y1 + 0.25 * tilt * vertex


ON_ARC, WINDOWS, SUMS = Kernel(pair_equations), Kernel(pair_windows), Kernel(sums_along)
