"""The bordered determinant F of an orbit with impacts.

With time in units of n forcing periods and mu = exp(2 pi i kappa), perturbations at the impacts
answer each other by the mean propagators ``X_ij = [[turn, reach], [pull, turn]]``, sums over the
aliases ``kappa_a = kappa + a`` of

    ``exp(i a s) g r^d (i kappa_a, 1, (i kappa_a)^2) / (2 pi)``,   s = t_i - t_j,  d sites apart,

g the resolvent of the chain and r what a site passes on to the next. Far aliases are expanded in
w/kappa_a and then in kappa (`expand_pairs`, once for each orbit). The parts of the three that may
lie in the band, or reach its end from outside, are matrices of rank one with square roots in g:
they border the rest,

    ``F = -det [[1 - X (S - 1), to], [of, 1/g]]``,   2 m + 3 rows for m impacts,

which is bounded along the whole circle. Columns of displacements are in units of the speeds, by
which entries of S are multiplied.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from contbreather.kernels import (
    ComplexMatrix,
    ComplexVector,
    Counts,
    Cube,
    Kernel,
    Matrix,
    Vector,
)
from contbreather.lattice.modal_waves import complex_root

NEAR = 5  # aliases |a| <= 5 are exact
ORDERS = 11  # of w^2/kappa_a^2 <= 1/30: below rounding
POWERS = 22  # of kappa/(6 - w) <= 1/5: 4e-16
FAR = 64  # |a| up to which high powers of 1/a are summed: 64^-9 < 1e-16
CLOSED = 9  # lower powers come from Bernoulli polynomials
HIGHEST = 2 * ORDERS + POWERS
BORDER = 1  # aliases |a| <= 1 border the determinant
TWO_PI = 2.0 * math.pi


class PairSeries(NamedTuple):
    """Tables that all orbits share, see `contbreather.stability.chain_map`."""

    number: Cube  # (3, ORDERS, POWERS): of turn, reach, pull the factor of kappa^p <w^2l>, and
    which: Cube  # with which of the sums over far aliases; -1 where there is none
    bernoulli: Matrix
    powers: Matrix  # of 1/a beyond `NEAR`


class Impacts(NamedTuple):
    """Impacts of one period; times and entries b, those in units of their speeds as well, in units
    of n forcing periods."""

    gamma: float
    floor: float  # lower edge of the band as a kappa, 0 where no spring holds the sites
    loss: float  # -(1 + k), on the diagonal of S - 1
    times: Vector
    entries: Vector
    speeds: Vector
    sites: Counts  # from the first that impacts on
    moments: Matrix  # by distance: <w^2l cos(d theta)> of the chain over (4 gamma)^l
    tails: ComplexMatrix  # by pairs of impacts: powers of kappa in turn, reach, pull of far aliases
    phases: ComplexMatrix  # by pairs: exp(i a s)


class CountWorkspace(NamedTuple):
    answers: ComplexMatrix  # by near alias, g r^d for each distance d
    matrix: ComplexMatrix


# --- what does not depend on kappa ----------------------------------------------------------


def expand_pairs(orbit: Impacts, series: PairSeries, sums: Vector) -> None:
    """Fill in tails and phases of all pairs of impacts."""
    m = orbit.times.size
    for i in range(m):
        for j in range(m):
            pair, s = i * m + j, orbit.times[i] - orbit.times[j]
            if i == j and i > 0:  # the same for each impact with itself
                for n in range(3 * POWERS):
                    orbit.tails[pair, n] = orbit.tails[0, n]
            else:
                far_sums(series, s, sums)
                far_powers(orbit, series, sums, pair, abs(orbit.sites[i] - orbit.sites[j]))
            for a in range(-NEAR, NEAR + 1):
                orbit.phases[pair, a + NEAR] = complex(math.cos(a * s), math.sin(a * s))


def far_sums(series: PairSeries, s: float, sums: Vector) -> None:
    """``sum over |a| > NEAR of exp(ias)/a^p`` for p = 1 and on, but for its factor 2 or 2i."""
    y = math.pi - (s - TWO_PI * math.floor(s / TWO_PI))
    for p in range(HIGHEST):
        sums[p] = 0.0
    for p in range(CLOSED):
        total = 0.0
        for i in range(CLOSED, -1, -1):
            total = total * y + series.bernoulli[p, i]
        sums[p] = total if p > 0 or s != 0.0 else 0.0  # the mean of its jump
    for a in range(1, FAR + 1):
        cosine, sine = math.cos(a * s), math.sin(a * s)
        if a <= NEAR:
            power = 1.0
            for p in range(CLOSED):
                power /= a
                sums[p] -= power * (cosine if p % 2 else sine)
        else:
            for p in range(CLOSED, HIGHEST):
                sums[p] += series.powers[a - NEAR - 1, p - CLOSED] * (cosine if p % 2 else sine)


def far_powers(orbit: Impacts, series: PairSeries, sums: Vector, pair: int, distance: int) -> None:
    """Taylor coefficients in kappa of what far aliases add to turn, reach and pull."""
    for c in range(3):
        for p in range(POWERS):
            real = imag = 0.0
            for order in range(ORDERS):
                which = int(series.which[c, order, p])
                if which >= 0:
                    term = 2.0 * series.number[c, order, p] * orbit.moments[distance, order]
                    # over a and -a: twice the cosine where the power is even, or 2i times the sine
                    if which % 2:
                        real += term * sums[which]
                    else:
                        imag += term * sums[which]
            if c == 0:  # turn has one factor i more
                real, imag = -imag, real
            orbit.tails[pair, c * POWERS + p] = complex(real, imag)


# --- F --------------------------------------------------------------------------------------------


def square_of(z: complex) -> float:
    return z.real * z.real + z.imag * z.imag


def over(z: complex) -> complex:
    return z.conjugate() * (1.0 / square_of(z))


def edge_root(edge: float, kappa: complex) -> complex:
    """``sqrt(kappa^2 - edge^2)``, like kappa far off, for Im kappa <= 0; on the band its limit from
    below. As a product of two roots it is exact next to either edge, and zero at them."""
    if edge == 0.0:
        return kappa
    depth = abs(kappa.imag)
    first = complex_root(complex(kappa.real - edge, depth))
    return (first * complex_root(complex(kappa.real + edge, depth))).conjugate()


def band_roots(orbit: Impacts, kappa: complex) -> tuple[complex, complex]:
    """Square roots of both edges of the band: ``1/g`` is minus their product."""
    upper = math.sqrt(orbit.floor * orbit.floor + 4.0 * orbit.gamma)
    return edge_root(orbit.floor, kappa), edge_root(upper, kappa)


def power(z: complex, n: int) -> complex:
    product = complex(1.0, 0.0)
    for _ in range(n):
        product = product * z
    return product


def bordered_value(orbit: Impacts, room: CountWorkspace, kappa: complex) -> complex:
    """F at ``mu = exp(2 pi i kappa)``, Im kappa <= 0; on the band the limit from |mu| > 1."""
    m = orbit.times.size
    for a in range(-NEAR, NEAR + 1):
        if abs(a) > BORDER:
            x = kappa + a
            low, high = band_roots(orbit, x)
            answer, share = over(-low * high), complex(0.0, 0.0)
            if orbit.moments.shape[0] > 1:
                share = over(low + high)
            r = -4.0 * orbit.gamma * (share * share)
            for d in range(orbit.moments.shape[0]):
                room.answers[a + NEAR, d] = answer
                answer = answer * r
    turn, reach, pull = mean_propagators(orbit, room, kappa, 0, 0)
    for i in range(m):
        kicked(orbit, room.matrix, i, i, turn, reach, pull)
    for i in range(m):
        for j in range(i):
            turn, reach, pull = mean_propagators(orbit, room, kappa, i, j)
            kicked(orbit, room.matrix, i, j, turn, reach, pull)
            if kappa.imag == 0.0:  # there the far aliases are real, and back is the conjugate
                turn, reach, pull = -turn.conjugate(), reach.conjugate(), pull.conjugate()
            else:
                turn, reach, pull = mean_propagators(orbit, room, kappa, j, i)
            kicked(orbit, room.matrix, j, i, turn, reach, pull)
    for i in range(m):
        room.matrix[2 * i, 2 * i] += orbit.speeds[i]
        room.matrix[2 * i + 1, 2 * i + 1] += 1.0
    for row in range(2 * BORDER + 1):
        border(orbit, room, kappa + (row - BORDER), row - BORDER, 2 * m + row)
    return -pivoted_determinant(room.matrix, 2 * m + 2 * BORDER + 1)


def mean_propagators(
    orbit: Impacts, room: CountWorkspace, kappa: complex, i: int, j: int
) -> tuple[complex, complex, complex]:
    """Turn, reach and pull from impact j to impact i, over 2 pi, without what the border brings."""
    pair = i * orbit.times.size + j
    distance = abs(orbit.sites[i] - orbit.sites[j])
    turn = reach = pull = complex(0.0, 0.0)
    for p in range(POWERS - 1, -1, -1):
        turn = turn * kappa + orbit.tails[pair, p]
        reach = reach * kappa + orbit.tails[pair, POWERS + p]
        pull = pull * kappa + orbit.tails[pair, 2 * POWERS + p]
    for a in range(-NEAR, NEAR + 1):
        phase = orbit.phases[pair, a + NEAR]
        if abs(a) > BORDER:
            x = kappa + a
            answer = room.answers[a + NEAR, distance] * phase
            turn += complex(-x.imag, x.real) * answer
            reach += answer
            pull -= x * x * answer
        if distance == 0:  # what a site does to itself at once
            pull -= phase
    return turn, reach, pull


def kicked(
    orbit: Impacts, matrix: ComplexMatrix, i: int, j: int, turn: complex, reach: complex,
    pull: complex,
) -> None:  # fmt: skip
    """Enter ``-X_ij (S_j - 1)``."""
    if orbit.sites[i] == orbit.sites[j] and orbit.times[i] == orbit.times[j]:
        turn = turn - math.pi  # not its own kick: what earlier periods left, G'(0) - 1/2
    loss, b, v = -orbit.loss / TWO_PI, -orbit.entries[j] / TWO_PI, orbit.speeds[j]
    matrix[2 * i, 2 * j] = v * loss * turn + b * reach
    matrix[2 * i, 2 * j + 1] = loss * reach
    matrix[2 * i + 1, 2 * j] = v * loss * pull + b * turn
    matrix[2 * i + 1, 2 * j + 1] = loss * turn


def border(orbit: Impacts, room: CountWorkspace, kappa: complex, alias: int, last: int) -> None:
    """The column, the row and the corner of an alias that may lie in the band.

    With several sites its part stays infinite at the band's ends between the first of them and
    itself only: sites answer each other as on a chain that is held at the first, ``g r^|n - m|``
    less the image ``g r^(n + m)``, plus what the motion of that one brings.
    """
    m, matrix, (low, high) = orbit.times.size, room.matrix, band_roots(orbit, kappa)
    rate, share = complex(-kappa.imag, kappa.real), complex(0.0, 0.0)
    if orbit.moments.shape[0] > 1:
        share = over(low + high)
    square = share * share  # r = -4 gamma of it: what a site passes on to the next
    for i in range(m):
        angle = alias * orbit.times[i]
        wave = complex(math.cos(angle), math.sin(angle))
        back = wave.conjugate() * (1.0 / TWO_PI)
        row = back * (rate * orbit.loss * orbit.speeds[i] + orbit.entries[i])
        reached = power(-4.0 * orbit.gamma * square, orbit.sites[i])
        matrix[2 * i, last] = wave * reached
        matrix[2 * i + 1, last] = wave * rate * reached
        matrix[last, 2 * i] = row * reached
        matrix[last, 2 * i + 1] = back * orbit.loss * reached
    for i in range(m):
        for j in range(m):
            if orbit.sites[i] > 0 and orbit.sites[j] > 0:
                answer_held(orbit, matrix, rate, square, alias, i, j)
    for i in range(2 * BORDER + 1):
        matrix[last, 2 * m + i] = 0.0
    matrix[last, last] = -low * high


def answer_held(
    orbit: Impacts, matrix: ComplexMatrix, rate: complex, square: complex, alias: int, i: int,
    j: int,
) -> None:  # fmt: skip
    """Less what impact j does to impact i by one alias, on a chain that is held. As ``g (1/r - r) =
    1/gamma``, that is a short sum of powers of r, bounded at the ends of the band."""
    nearer = min(orbit.sites[i], orbit.sites[j])
    farther = max(orbit.sites[i], orbit.sites[j])
    r, total = -4.0 * orbit.gamma * square, complex(0.0, 0.0)
    for n in range(nearer):
        total = total + power(r, farther - nearer + 2 * n)
    angle = alias * (orbit.times[i] - orbit.times[j])
    wave = complex(math.cos(angle), math.sin(angle))
    total = wave * (-4.0 / TWO_PI) * (total * square)
    first = total * (rate * orbit.loss * orbit.speeds[j] + orbit.entries[j])
    second = total * orbit.loss
    for row in range(2):
        matrix[2 * i + row, 2 * j] -= first
        matrix[2 * i + row, 2 * j + 1] -= second
        first, second = first * rate, second * rate


def pivoted_determinant(matrix: ComplexMatrix, rows: int) -> complex:
    """By elimination with the largest pivot of each column."""
    product = complex(1.0, 0.0)
    for c in range(rows):
        best, pivot = -1.0, c
        for r in range(c, rows):
            size = square_of(matrix[r, c])
            if size > best:
                best, pivot = size, r
        if pivot != c:
            product = -product
            for j in range(c, rows):
                matrix[c, j], matrix[pivot, j] = matrix[pivot, j], matrix[c, j]
        product = product * matrix[c, c]
        if not best > 0.0:
            break
        inverse = over(matrix[c, c])
        for r in range(c + 1, rows):
            factor = matrix[r, c] * inverse
            for j in range(c + 1, rows):
                matrix[r, j] -= factor * matrix[c, j]
    return product


def values_at(
    orbit: Impacts, room: CountWorkspace, kappa: ComplexVector, values: ComplexVector
) -> None:
    for i in range(kappa.size):
        values[i] = bordered_value(orbit, room, kappa[i])


EXPANDED, EVERYWHERE = Kernel(expand_pairs), Kernel(values_at)
