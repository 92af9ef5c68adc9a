"""The bordered determinant F of an orbit with one impacting site, as text that can be compiled.

The same as `orbit` on the infinite chain, on the unit circle itself, where its aliases are real but
for those in the band. Complex numbers are pairs.
"""

from __future__ import annotations

import math
from typing import Any

from contbreather.kernels import Kernel

NEAR, ORDERS, POWERS, FAR, CLOSED = 5, 11, 22, 64, 9  # as in `propagators`
HIGHEST = 2 * ORDERS + POWERS
# table: for (turn, reach, pull), each order and power, a number and which sum it belongs to; the
# Bernoulli polynomials; powers of 1/j beyond `NEAR`; moments of the chain
NUMBERS = 0
WHICH = NUMBERS + 3 * ORDERS * POWERS
BERNOULLI = WHICH + 3 * ORDERS * POWERS
HIGH = BERNOULLI + CLOSED * (CLOSED + 1)
MOMENTS = HIGH + (FAR - NEAR) * (HIGHEST - CLOSED)

# data: coupling and times in units of n forcing periods; restitution, size of the terms of F, how
# many impacts, whether more than F at mu = -1 is wanted; then time and b of each impact
GAMMA, K, TERMS, IMPACTS, WHOLE, FIRST = range(6)
# found: F at mu = -1 as a bounded scalar; its turning along the circle, how small it gets and
# where; its real part at both ends, whether it was resolved, how close a zero is
MINUS, TURNING, LEAST, WHERE, START, END, RESOLVED, APPROACH = range(8)

GRID, TURN, DEPTH, MOST = 24, 0.6, 40, 2**12  # as in `orbit` and `zeros`
CERTAIN, FLAT, ON_CIRCLE, FARTHEST = 1e-12, 1e-14, 1e-14, 0.25  # as in `orbit`
SHARP = 1e-13
HALF = 3.1  # F turns as far in one step past a multiplier on the circle only: it is not outside
TWO_PI = 2.0 * math.pi
WIDEST = 19  # rows of the determinant: of eight impacts
# scratch: sums of one pair, a matrix, one value; the tails of all pairs, six each; four columns of
# samples twice
SUMS = 0
MATRIX = SUMS + 2 * HIGHEST
VALUE = MATRIX + 2 * WIDEST * WIDEST
TAILS = VALUE + 2
SAMPLES = TAILS + 6 * POWERS * 64
SIZE = SAMPLES + 8 * (MOST + 1)


def orbit(data: Any, table: Any, work: Any, found: Any) -> int:
    """All that is wanted of F; 1 where there are too many impacts."""
    m = int(data[IMPACTS])
    if 2 * m + 3 > WIDEST or m * m > 64:
        return 1
    for i in range(m):
        for j in range(i + 1):
            apart = data[FIRST + 2 * i] - data[FIRST + 2 * j]
            sums(table, work, apart)
            tails(data, table, work, TAILS + 6 * POWERS * (i * m + j))
    bordered(data, work, 0.5)
    size = abs(1.0 - 16.0 * data[GAMMA]) / 16.0  # of the product of the two corners in the band
    third = 1.5 * math.sqrt(2.25 - 4.0 * data[GAMMA])
    found[MINUS] = work[VALUE] / third / (1.0 + size)
    if data[WHOLE] > 0.0:
        around(data, work, found)
    return 0


# --- what does not depend on kappa ----------------------------------------------------------


def sums(table: Any, work: Any, s: float) -> None:
    """``sum over |j| > NEAR of exp(ijs)/j^p`` but for i, p = 1 and on."""
    y = math.pi - (s - TWO_PI * math.floor(s / TWO_PI))
    for p in range(HIGHEST):
        work[SUMS + p] = 0.0
    for p in range(CLOSED):
        total = 0.0
        for i in range(CLOSED, -1, -1):
            total = total * y + table[BERNOULLI + p * (CLOSED + 1) + i]
        work[SUMS + p] = total if p > 0 or s != 0.0 else 0.0  # the mean of its jump
    for j in range(1, FAR + 1):
        cosine, sine = math.cos(j * s), math.sin(j * s)
        if j <= NEAR:
            power = 1.0
            for p in range(CLOSED):
                power /= j
                work[SUMS + p] -= power * (cosine if p % 2 else sine)
        else:
            at = HIGH + (j - NEAR - 1) * (HIGHEST - CLOSED)
            for p in range(CLOSED, HIGHEST):
                work[SUMS + p] += table[at + p - CLOSED] * (cosine if p % 2 else sine)


def tails(data: Any, table: Any, work: Any, at: int) -> None:
    """Taylor coefficients in kappa of what far aliases add to turn, reach and pull of a pair: real
    and imaginary parts, power by power."""
    for c in range(3):
        for a in range(POWERS):
            real = imag = 0.0
            scale = 1.0
            for order in range(ORDERS):
                place = (c * ORDERS + order) * POWERS + a
                which = int(table[WHICH + place])
                if which >= 0:
                    own = 2.0 * table[NUMBERS + place] * table[MOMENTS + order] * scale
                    # over j and -j: twice the cosine where p is even, or 2i times the sine
                    if which % 2:
                        real += own * work[SUMS + which]
                    else:
                        imag += own * work[SUMS + which]
                scale *= 4.0 * data[GAMMA]
            if c == 0:
                real, imag = -imag, real
            work[at + 2 * (c * POWERS + a)] = real
            work[at + 2 * (c * POWERS + a) + 1] = imag


# --- F ------------------------------------------------------------------------------------------


def bordered(data: Any, work: Any, kappa: float) -> None:
    """F at ``mu = exp(2 pi i kappa)``, into ``work[VALUE]`` and after it."""
    m, loss = int(data[IMPACTS]), -(1.0 + data[K])
    rows = 2 * m + 3
    for i in range(2 * rows * rows):
        work[MATRIX + i] = 0.0
    for i in range(m):
        for j in range(i + 1):
            pair(data, work, kappa, i, j, rows, loss)
    for i in range(2 * m):
        work[MATRIX + 2 * (i * rows + i)] += 1.0
    for row in range(3):
        border(data, work, kappa + row - 1.0, row - 1, 2 * m + row, rows, loss)
    determinant(work, rows)
    work[VALUE], work[VALUE + 1] = -work[VALUE], -work[VALUE + 1]


def pair(data: Any, work: Any, kappa: float, i: int, j: int, rows: int, loss: float) -> None:
    """What impact j does to impact i and, for it is all but the same, i to j."""
    m, gamma = int(data[IMPACTS]), data[GAMMA]
    s = data[FIRST + 2 * i] - data[FIRST + 2 * j]
    at = TAILS + 6 * POWERS * (i * m + j)
    tr = ti = rr = ri = pr = pi = 0.0
    for a in range(POWERS - 1, -1, -1):
        tr = tr * kappa + work[at + 2 * a]
        ti = ti * kappa + work[at + 2 * a + 1]
        rr = rr * kappa + work[at + 2 * (POWERS + a)]
        ri = ri * kappa + work[at + 2 * (POWERS + a) + 1]
        pr = pr * kappa + work[at + 2 * (2 * POWERS + a)]
        pi = pi * kappa + work[at + 2 * (2 * POWERS + a) + 1]
    for alias in range(-NEAR, NEAR + 1):
        cosine, sine = math.cos(alias * s), math.sin(alias * s)
        if -1 <= alias <= 1:  # the border brings these
            pr -= cosine
            pi -= sine
        else:
            k = kappa + alias
            square = k * k
            g = -1.0 / (square * math.sqrt(1.0 - 4.0 * gamma / square))
            tr -= k * g * sine
            ti += k * g * cosine
            rr += g * cosine
            ri += g * sine
            pr -= (square * g + 1.0) * cosine
            pi -= (square * g + 1.0) * sine
    own = 0.5 * TWO_PI if s == 0.0 else 0.0  # not its own kick: what earlier periods left
    put(data, work, i, j, rows, loss, tr - own, ti, rr, ri, pr, pi)
    if i != j:
        put(data, work, j, i, rows, loss, -tr - own, ti, rr, -ri, pr, -pi)


def put(
    data: Any, work: Any, i: int, j: int, rows: int, loss: float, tr: float, ti: float, rr: float,
    ri: float, pr: float, pi: float,
) -> None:  # fmt: skip
    """Less the propagators of a pair times the jump of its second impact, into the matrix."""
    b = data[FIRST + 2 * j + 1]
    at, below = MATRIX + 2 * (2 * i * rows + 2 * j), MATRIX + 2 * ((2 * i + 1) * rows + 2 * j)
    work[at] = -(loss * tr + b * rr) / TWO_PI
    work[at + 1] = -(loss * ti + b * ri) / TWO_PI
    work[at + 2] = -loss * rr / TWO_PI
    work[at + 3] = -loss * ri / TWO_PI
    work[below] = -(loss * pr + b * tr) / TWO_PI
    work[below + 1] = -(loss * pi + b * ti) / TWO_PI
    work[below + 2] = -loss * tr / TWO_PI
    work[below + 3] = -loss * ti / TWO_PI


def border(data: Any, work: Any, k: float, alias: int, last: int, rows: int, loss: float) -> None:
    """The column, the row and the corner that belong to an alias that may lie in the band."""
    for i in range(int(data[IMPACTS])):
        t, b = data[FIRST + 2 * i], data[FIRST + 2 * i + 1]
        c, s = math.cos(alias * t), math.sin(alias * t)
        at = MATRIX + 2 * (2 * i * rows + last)
        work[at], work[at + 1] = c, s
        at += 2 * rows
        work[at], work[at + 1] = -k * s, k * c
        at = MATRIX + 2 * (last * rows + 2 * i)  # (ik, 1) times the conjugate, times the jump
        work[at] = (loss * k * s + b * c) / TWO_PI
        work[at + 1] = (loss * k * c - b * s) / TWO_PI
        work[at + 2] = loss * c / TWO_PI
        work[at + 3] = -loss * s / TWO_PI
    at = MATRIX + 2 * (last * rows + last)
    edge = 2.0 * math.sqrt(data[GAMMA])
    off = (k - edge) * (k + edge)  # exact next to either edge
    if off > 0.0:
        work[at] = -abs(k) * math.sqrt(off)
    else:  # the limit from outside the circle
        work[at + 1] = k * math.sqrt(-off)


def determinant(work: Any, rows: int) -> None:
    """By elimination with the largest pivot of each column."""
    re, im = 1.0, 0.0
    for c in range(rows):
        best, pivot = -1.0, c
        for r in range(c, rows):
            at = MATRIX + 2 * (r * rows + c)
            size = work[at] * work[at] + work[at + 1] * work[at + 1]
            if size > best:
                best, pivot = size, r
        if pivot != c:
            re, im = -re, -im
            for j in range(2 * c, 2 * rows):
                one, other = MATRIX + 2 * c * rows + j, MATRIX + 2 * pivot * rows + j
                work[one], work[other] = work[other], work[one]
        at = MATRIX + 2 * (c * rows + c)
        a, b = work[at], work[at + 1]
        re, im = re * a - im * b, re * b + im * a
        if not best > 0.0:
            break
        for r in range(c + 1, rows):
            under = MATRIX + 2 * (r * rows + c)
            x, y = work[under], work[under + 1]
            fr, fi = (x * a + y * b) / best, (y * a - x * b) / best
            for j in range(c + 1, rows):
                one, other = MATRIX + 2 * (r * rows + j), MATRIX + 2 * (c * rows + j)
                work[one] -= fr * work[other] - fi * work[other + 1]
                work[one + 1] -= fr * work[other + 1] + fi * work[other]
    work[VALUE], work[VALUE + 1] = re, im


# --- along the circle -----------------------------------------------------------------------


def around(data: Any, work: Any, found: Any) -> None:
    """Samples of F on half the circle, piece by piece, and what they tell."""
    edge = 2.0 * math.sqrt(data[GAMMA])
    one, other = min(edge, 1.0 - edge), max(edge, 1.0 - edge)
    found[TURNING], found[LEAST], found[RESOLVED], found[APPROACH] = 0.0, math.inf, 1.0, FARTHEST
    low = 0.0
    for which in range(3):
        high = one if which == 0 else other if which == 1 else 0.5
        high = min(high, 0.5)
        if high > low:
            piece(data, work, found, low, high)
            low = high


def piece(data: Any, work: Any, found: Any, low: float, high: float) -> None:
    """One piece between edges of the band: x, kappa, real and imaginary part in four columns."""
    here, there, count = SAMPLES, SAMPLES + 4 * (MOST + 1), GRID + 1
    for i in range(count):
        sample(data, work, here + 4 * i, i / GRID, low, high)
    for _ in range(DEPTH):
        more = marked(data, work, here, count)
        if more == 0:
            break
        if count + more > MOST:
            found[RESOLVED] = 0.0
            break
        to = there
        for i in range(count):
            for c in range(4):
                work[to + c] = work[here + 4 * i + c]
            to += 4
            if i + 1 < count and wide(data, work, here, count, i):
                x = 0.5 * (work[here + 4 * i] + work[here + 4 * i + 4])
                sample(data, work, to, x, low, high)
                to += 4
        here, there, count = there, here, count + more
    told(data, work, found, here, count, low, high)


def sample(data: Any, work: Any, at: int, x: float, low: float, high: float) -> None:
    """F at a place of a piece; a square root at either end is smooth in x."""
    kappa = 0.5 * (low + high) - 0.5 * (high - low) * math.cos(math.pi * x)
    bordered(data, work, kappa)
    work[at], work[at + 1] = x, kappa
    work[at + 2], work[at + 3] = work[VALUE], work[VALUE + 1]


def marked(data: Any, work: Any, here: int, count: int) -> int:
    """How many intervals are to be halved."""
    total = 0
    for i in range(count - 1):
        total += 1 if wide(data, work, here, count, i) else 0
    return total


def wide(data: Any, work: Any, here: int, count: int, i: int) -> bool:
    """Whether F moves by much of its modulus, or does so next to an interval."""
    if work[here + 4 * i + 4] - work[here + 4 * i] <= SHARP:
        return False
    found = False
    for j in range(max(i - 1, 0), min(i + 2, count - 1)):
        found = found or steep(data, work, here + 4 * j)
    return found


def steep(data: Any, work: Any, at: int) -> bool:
    """Whether F moves by much of its modulus over an interval, rounding aside."""
    a, b, c, d = work[at + 2], work[at + 3], work[at + 6], work[at + 7]
    one, other = math.sqrt(a * a + b * b), math.sqrt(c * c + d * d)
    moved = math.sqrt((c - a) * (c - a) + (d - b) * (d - b))
    return moved > TURN * min(one, other) and max(one, other) > FLAT * data[TERMS]


def told(data: Any, work: Any, found: Any, here: int, count: int, low: float, high: float) -> None:
    """What the samples of one piece tell."""
    least, terms = CERTAIN * data[TERMS], data[TERMS]
    for i in range(count - 1):
        approach(work, found, here + 4 * i)
    # D has the sign of -F next to mu = 1 and of F at -1; a real multiplier on the circle to within
    # rounding is not outside
    if low == 0.0:
        settled(work, here, 4, count, least, -1.0)
        found[START] = work[here + 2]
    if high == 0.5:
        settled(work, here + 4 * (count - 1), -4, count, least, 1.0)
        found[END] = work[here + 4 * count - 2]
    for i in range(count):
        at = here + 4 * i
        a, b = work[at + 2], work[at + 3]
        size = math.sqrt(a * a + b * b) / terms
        if size < found[LEAST]:
            found[LEAST], found[WHERE] = size, work[at + 1]
        if i + 1 < count:
            c, d = work[at + 6], work[at + 7]
            turn = math.atan2(d * a - c * b, c * a + d * b)
            found[TURNING] += -turn if turn < -HALF else turn


def settled(work: Any, at: int, step: int, count: int, least: float, inside: float) -> None:
    for i in range(count):
        re = at + i * step + 2
        size = math.sqrt(work[re] * work[re] + work[re + 1] * work[re + 1])
        if size > least:
            return
        work[re], work[re + 1] = inside * max(size, 1e-300), 0.0


def approach(work: Any, found: Any, at: int) -> None:
    """How far a zero is off the circle, by a straight line between two samples."""
    step = work[at + 5] - work[at + 1]
    a, b = work[at + 2], work[at + 3]
    rise, lift = work[at + 6] - a, work[at + 7] - b
    square = rise * rise + lift * lift
    if step <= 1e-14 * work[at + 5] or square == 0.0:
        return
    t = min(max(-(a * rise + b * lift) / square, 0.0), 1.0)
    re, im = a + t * rise, b + t * lift
    kappa = work[at + 1] + t * step
    off = math.sqrt((re * re + im * im) / square) * step
    if off <= ON_CIRCLE:
        found[RESOLVED] = 0.0
    if 0.0 < kappa < 0.5:
        off *= 1.0 / kappa + 1.0 / (0.5 - kappa)
        found[APPROACH] = min(found[APPROACH], off)


ORBIT = Kernel(orbit, "pppp")
