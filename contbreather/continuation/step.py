"""One step along a curve H(z) = 0: predict, correct, find the tangent, check, adapt the size.

With J = H_z, weights W of the arclength and the unit tangent t where a step sets out, Newton's
corrections dz stay in the plane across t, and the tangent t' at its end points the same way:

    [  J(z) ]      [ H(z) ]        [  J(z) ]      [ 0 ]
    [ t^T W ] dz = [  0   ],       [ t^T W ] t' = [ 1 ].

The sign of the determinant of this matrix changes at simple branch points and nowhere else.

This is the only text of the rules. `steps` and `corrected` are compiled, for problems of a dozen
unknowns whose equations are machine code, too. All others go by `newton` and `check_step` with
numpy, LAPACK and SuperLU in place of the functions under "arithmetic" (see `newton` and `stepper`).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from ..kernels import Counts, Kernel, Matrix, Vector, call, fixed, inlined

# How far the tangent may turn within a step, the turn that step sizes aim at, and how far the curve
# may be off the cubic through both ends, as a fraction of the step. Together they leave no room for
# a feature of the curve to hide inside a step.
TURN = 0.45
AIM = 0.15
CUBIC_ERROR = 0.003
TINY = 1e-4  # relative to the longest step so far
ITERATIONS = 8  # of Newton's method in a step
EASY = 4  # so many of them ask for another step of this size
ROUNDED = 4 * 2.0**-52  # sums of terms that round once each were never seen to be off by more
LARGE = 10.0  # size of z beyond which its entries are looked at one by one
REUSED = 1e-5  # of a correction this short, relative to 1 + |z|, the square is rounding
SHRUNK = 1e-2  # and no curvature is in the way where it is this much shorter than the one before
LARGEST_STEP, RELATIVE = 0.1, 0.01  # unless the rules say how long a step may be
WIDEST = 13  # entries of z: beyond a dozen unknowns LAPACK is faster than loops

# How an attempt ended: it is taken; the caller has to look; or (negative) a shorter one may do.
ACCEPTED, LOOK = 0, 1
FAILED, LEFT, TURNS, OFF_CUBIC = -1, -2, -3, -4
ARCLENGTH, SIZE, SIGN, LONGEST = range(4)  # of the state of a walk


@fixed
class CompiledEquations(NamedTuple):
    """Equations in machine code, and room for what is made of them."""

    evaluate: int  # ``(z, data, out) -> int``: fills in H, row by row; not 0 where there is none
    derive: int  # J, in the same way
    data: Vector
    metric: Vector  # the diagonal of W
    value: Vector  # behind their answers functions may use 3 d^2 numbers as they like
    flat: Vector
    matrix: Matrix  # the beginning of `flat`
    right: Vector


@fixed
class Rules(NamedTuple):
    """What stays the same on a walk."""

    tolerance: float
    smallest: float
    largest: float  # NaN: as long as the size of z has it
    growth: float
    slots: Counts  # what has a bound
    low: Vector
    high: Vector
    across: Vector  # the plane of the start: ``across . (z - start) = 0``
    start: Vector


@fixed
class CompiledPoint(NamedTuple):
    """Where a step sets out: z, unit tangent, dt/ds; and room for what it leads to."""

    z: Vector
    tangent: Vector
    curvature: Vector
    end: Vector
    end_tangent: Vector
    work: Vector


class Corrected(NamedTuple):
    """Where Newton's iteration ended."""

    status: int
    z: Any
    iterations: int
    residual: float
    moved: float  # length of the last correction
    regular: bool  # whether the last matrix was


class StepCheck(NamedTuple):
    """What a solution says of the step to it, besides its tangent."""

    status: int
    sign: int  # sign of the determinant
    length: float
    turn: float
    tangent: Any


# --- many steps in one call -----------------------------------------------------------------------


def steps(
    eq: CompiledEquations,
    rules: Rules,
    point: CompiledPoint,
    state: Vector,
    out: Matrix,
    count: Counts,
) -> None:
    """Take steps until one fails or has to be looked at; a row of `out` for each: z, tangent,
    arclength and residual."""
    d, count[0] = point.z.size, 0
    while count[0] < out.shape[0]:
        wanted = state[SIZE]
        size = min(wanted, longest(rules.largest, norm(eq, point.z)))
        status, residual = FAILED, 0.0
        while status < 0 and size >= rules.smallest:
            state[SIZE] = size
            status, residual = try_step(eq, rules, point, state)
            # the predictor's error, O(s^3), falls to an eighth
            size = 0.5 * size
        if status != ACCEPTED:
            # the caller tries the same step, and knows why it fails
            state[SIZE] = wanted if status < 0 else state[SIZE]
            return
        row = count[0]
        for i in range(d):
            out[row, i], out[row, d + i] = point.z[i], point.tangent[i]
        out[row, 2 * d], out[row, 2 * d + 1] = state[ARCLENGTH], residual
        count[0] = row + 1


@inlined
def try_step(
    eq: CompiledEquations, rules: Rules, point: CompiledPoint, state: Vector
) -> tuple[int, float]:
    """One step of the size in the state, which is taken if it comes off; and its residual."""
    size = state[SIZE]
    guess = predicted(point, size, point.end)
    if outside(rules, guess):
        return LOOK, 0.0
    # pseudo-arclength: with the tangent as its last row the matrix is regular at folds, too
    # (H. B. Keller, in Applications of Bifurcation Theory, ed. P. H. Rabinowitz, 1977, p. 359)
    solution = newton_kernel(eq, point.tangent, guess, rules.tolerance, ITERATIONS)
    if solution.status != ACCEPTED:
        return solution.status, 0.0
    if outside(rules, solution.z):
        return LOOK, 0.0
    check = check_step(eq, point, size, solution.z)
    if check.status != ACCEPTED:
        return check.status, 0.0
    branches = check.sign == 0 or check.sign * state[SIGN] < 0
    tiny = check.length < TINY * state[LONGEST]
    if branches or tiny or leaves(rules, point) or returns(rules, point, solution.z):
        return LOOK, 0.0
    state[SIZE] = size * next_size(solution.iterations, check.turn, rules.growth)
    state[SIGN] = check.sign
    accept(point, state, check.length)
    return ACCEPTED, solution.residual


def corrected(
    eq: CompiledEquations,
    tolerance: float,
    across: Vector,
    slope: Vector,
    point: CompiledPoint,
    answer: Vector,
) -> None:
    """The point of the curve in the plane across a vector, and its tangent on the side of `slope`,
    from `point.end` on into `point.end_tangent`; status, iterations and residual are the answer."""
    solution = newton_kernel(eq, across, point.end, tolerance, ITERATIONS)
    answer[0], answer[1], answer[2] = solution.status, solution.iterations, solution.residual
    if solution.status == ACCEPTED and tangent_at(eq, slope, solution.z, point)[1] == 0:
        answer[0] = LOOK


# --- the rules --------------------------------------------------------------------------------


@inlined
def newton_kernel(eq: Any, row: Any, z: Any, tolerance: float, most: int) -> Corrected:
    """Newton's iteration from z on, with ``row . z`` kept.

    It ends with a correction of at most ``tolerance (1 + |z|)``, and then is far more exact, being
    quadratic; for a large z each entry has to be as exact. A correction that grows ends it, too: a
    solution still where all that is left of the equations is rounding, as of stiff ones, or beside
    a branch point. The factors of a large matrix serve the last steps, which no longer change it.
    """
    size = 1.0 + norm(eq, z)
    bound = tolerance * size
    previous, reuse, regular = math.inf, False, True
    for iteration in range(1, most + 1):
        value, exists = residual(eq, z)
        if not exists:
            return Corrected(FAILED, z, iteration, 0.0, previous, regular)
        step, regular = correction(eq, row, z, value, reuse)
        moved = norm(eq, step)
        if not moved < math.inf:
            return Corrected(LOOK, z, iteration, 0.0, moved, regular)
        # |dz_k| / |dz_k-1| estimates the contraction (P. Deuflhard, Newton Methods for Nonlinear
        # Problems, section 2.1): from 1/2 on the iteration is not in its quadratic phase
        if 2.0 * moved > previous and moved > bound:
            solved = is_rounding(eq, value, z)
            if solved or moved > 2.0 * previous:
                status = ACCEPTED if solved else FAILED
                return Corrected(status, z, iteration, largest(eq, value), moved, True)
        z = minus(z, step)
        if moved <= bound and (
            bound < LARGE * tolerance or 2.0 * moved > previous or is_short(eq, step, z, tolerance)
        ):
            value, exists = residual(eq, z)
            status = ACCEPTED if exists else FAILED
            return Corrected(status, z, iteration, largest(eq, value), moved, regular)
        # J may stay: off by O(|dz|), it changes the next correction, O(|dz|^2), by O(|dz|^3)
        reuse = z.size > WIDEST and moved <= min(REUSED * size, SHRUNK * previous)
        previous = moved
    value, exists = residual(eq, z)
    return Corrected(FAILED, z, most, largest(eq, value), previous, regular)


@inlined
def check_step(eq: Any, point: Any, size: float, z: Any) -> StepCheck:
    """Whether the way to a solution is one smooth piece of curve, short against its features."""
    length = distance(eq, z, point.z)
    # the corrector moves across the step: this far it has left for another piece of curve
    if not 0.0 < length <= 2.0 * size:
        return StepCheck(LEFT, 0, length, 0.0, point.tangent)
    end_tangent, sign = tangent_at(eq, point.tangent, z, point)
    turn = angle(eq, point.tangent, end_tangent)
    # the chord as well: between tangents that are parallel a curve may turn and turn back
    if turn > TURN or angle_to_chord(eq, point, z, length) > TURN:
        return StepCheck(TURNS, sign, length, turn, end_tangent)
    # One residual a third of the way along tells how far the curve is off the cubic: halfway,
    # tangents that are wrong alike would cancel.
    if off_curve(eq, point, z, end_tangent, length) > CUBIC_ERROR * length:
        return StepCheck(OFF_CUBIC, sign, length, turn, end_tangent)
    return StepCheck(ACCEPTED, sign, length, turn, end_tangent)


def next_size(iterations: int, turn: float, growth: float) -> float:
    """The size of the next step, relative to that of one that came off: the turn of the tangent is
    proportional to it, and more iterations than usual ask for less."""
    # the turn is |t'| s to first order, so that s AIM / turn meets the aim; less than a half would
    # trust that too far (E. L. Allgower and K. Georg, Introduction to Numerical Continuation
    # Methods, section 6.1, bound the factor alike)
    effort = 1.0 if iterations == EASY else (0.7 if iterations > EASY else math.inf)
    return max(min(AIM / max(turn, 1e-12), effort, growth), 0.5)


def longest(largest: float, size: float) -> float:
    """How long a step may be: as was asked for or, for a NaN, as the size of z has it."""
    return largest if largest > 0.0 else max(LARGEST_STEP, RELATIVE * size)


@inlined
def accept(point: CompiledPoint, state: Vector, length: float) -> None:
    """Take the step: place, tangent and how that turns are those at its end."""
    before = state[ARCLENGTH]
    state[ARCLENGTH] = before + length
    length = state[ARCLENGTH] - before  # as points of a branch have it, rounded
    state[LONGEST] = max(state[LONGEST], length)
    for i in range(point.z.size):
        # a backward difference, off by O(s): s^2/2 of it leaves the predictor an error of O(s^3)
        point.curvature[i] = (point.end_tangent[i] - point.tangent[i]) / length
        point.z[i], point.tangent[i] = point.end[i], point.end_tangent[i]


# --- where the caller has to look: these may be wrong to the safe side ----------------------------


@inlined
def outside(rules: Rules, z: Any) -> bool:
    """Whether z is beyond a bound."""
    for i in range(rules.slots.size):
        value = z[rules.slots[i]]
        if value < rules.low[i] or value > rules.high[i]:
            return True
    return False


@inlined
def leaves(rules: Rules, point: CompiledPoint) -> bool:
    """Whether the curve may leave the window within the step and come back: what has a bound turned
    round."""
    for i in range(rules.slots.size):
        # dz_i/ds has a zero in between, where z_i is largest or smallest
        if point.tangent[rules.slots[i]] * point.end_tangent[rules.slots[i]] < 0.0:
            return True
    return False


@inlined
def returns(rules: Rules, point: CompiledPoint, z: Any) -> bool:
    """Whether the step passes the plane of the start in the direction of the walk."""
    before = after = along = 0.0
    for i in range(point.z.size):
        before += rules.across[i] * (point.z[i] - rules.start[i])
        after += rules.across[i] * (z[i] - rules.start[i])
        along += rules.across[i] * point.end_tangent[i]
    # the last is the cosine between both tangents: the plane may be passed elsewhere, aslant
    return before < 0.0 and after >= 0.0 and along >= 0.5


# --- arithmetic: equations --------------------------------------------------------------------


@inlined
def residual(eq: CompiledEquations, z: Any) -> tuple[Any, bool]:
    """H(z), and whether there is such a value."""
    if call(eq.evaluate, z, eq.data, eq.value) != 0:
        return eq.value, False
    total = 0.0
    for i in range(z.size - 1):
        total += eq.value[i]
    return eq.value, math.isfinite(total)


@inlined
def correction(
    eq: CompiledEquations, row: Any, z: Any, value: Any, reuse: bool
) -> tuple[Any, bool]:
    """dz of the bordered system, infinite where the matrix is singular; and whether it is not."""
    d = z.size
    for i in range(d - 1):
        eq.right[i] = value[i]
    eq.right[d - 1] = 0.0  # the linear condition holds at every iterate
    regular = bordered(eq, row, z) != 0
    if not regular:
        eq.right[0] = math.inf
    return eq.right, regular


@inlined
def tangent_at(eq: CompiledEquations, along: Any, z: Any, point: CompiledPoint) -> tuple[Any, int]:
    """The unit tangent at z on the side of `along`, and the sign of the determinant; `along`
    itself where that is 0."""
    d, out = z.size, point.end_tangent
    for i in range(d):
        eq.right[i] = 0.0
    eq.right[d - 1] = 1.0
    sign = bordered(eq, along, z)
    size = norm(eq, eq.right)
    if sign == 0 or not 0.0 < size < math.inf:
        for i in range(d):
            out[i] = along[i]
        return out, 0
    for i in range(d):
        # the row asks for t^T W t' = 1: t' is longer than 1 where the curve has turned
        out[i] = eq.right[i] / size
    return out, sign


@inlined
def angle_to_chord(eq: CompiledEquations, point: CompiledPoint, z: Any, length: float) -> float:
    """Between the tangent and the way to z."""
    for i in range(z.size):
        point.work[i] = (z[i] - point.z[i]) / length
    return angle(eq, point.tangent, point.work)


@inlined
def off_curve(
    eq: CompiledEquations, point: CompiledPoint, z: Any, end_tangent: Any, length: float
) -> float:
    """How far the curve is from the Hermite cubic through both ends, a third of the way along, by
    one correction; 0 beside a branch point, where the residual says nothing."""
    for i in range(z.size):
        # Hermite at u = 1/3: h00, h01, h10, h11 = (20, 7, 4, -2) / 27
        bow = (4.0 * point.tangent[i] - 2.0 * end_tangent[i]) * length
        point.work[i] = (20.0 * point.z[i] + 7.0 * z[i] + bow) / 27.0
    value, exists = residual(eq, point.work)
    if not exists:
        return math.inf
    # H = J dz + O(dz^2): one correction is the distance to first order
    step, regular = correction(eq, point.tangent, point.work, value, False)
    return norm(eq, step) if regular else 0.0


@inlined
def bordered(eq: CompiledEquations, row: Any, z: Any) -> int:
    """Solve with J(z) and, below it, row^T W for `eq.right`; the sign of the determinant, or 0."""
    if call(eq.derive, z, eq.data, eq.flat) != 0:
        return 0
    for j in range(z.size):
        eq.matrix[z.size - 1, j] = row[j] * eq.metric[j]
    return eliminate(eq.matrix, eq.right)


def eliminate(A: Matrix, b: Vector) -> int:
    """Gaussian elimination in place; the sign of the determinant, 0 where that vanishes."""
    d, sign = b.size, 1
    for k in range(d):
        best = k
        for i in range(k + 1, d):
            if abs(A[i, k]) > abs(A[best, k]):
                best = i
        pivot = A[best, k]
        # 0, or a NaN, which no comparison holds for
        if not abs(pivot) > 0.0:
            return 0
        # an interchange of rows changes the sign, and so does a negative pivot
        if (best != k) != (pivot < 0.0):
            sign = -sign
        if best != k:
            b[best], b[k] = b[k], b[best]
            for j in range(d):
                A[best, j], A[k, j] = A[k, j], A[best, j]
        for i in range(k + 1, d):
            factor = A[i, k] / pivot
            for j in range(k + 1, d):
                A[i, j] -= factor * A[k, j]
            b[i] -= factor * b[k]
    for k in range(d - 1, -1, -1):
        for j in range(k + 1, d):
            b[k] -= A[k, j] * b[j]
        b[k] /= A[k, k]
    return sign


@inlined
def is_rounding(eq: CompiledEquations, value: Any, z: Any) -> bool:
    """Whether all that is left of H is rounding of its terms: |H| <= 4 eps |J| |z|."""
    if call(eq.derive, z, eq.data, eq.flat) != 0:
        return False
    for i in range(z.size - 1):
        # a term c x^k is k c x^k in J z: |J| |z| is no smaller than the terms, constants apart
        terms = 0.0
        for j in range(z.size):
            terms += abs(eq.matrix[i, j]) * abs(z[j])
        if abs(value[i]) > ROUNDED * terms:
            return False
    return True


def largest(eq: CompiledEquations, value: Any) -> float:
    most = 0.0
    for i in range(eq.right.size - 1):
        most = max(most, abs(value[i]))
    return most


# --- arithmetic: vectors ----------------------------------------------------------------------


def norm(eq: Any, z: Any) -> float:
    total = 0.0
    for i in range(z.size):
        total += z[i] * z[i] * eq.metric[i]
    return math.sqrt(total)


def distance(eq: Any, z: Any, other: Any) -> float:
    total = 0.0
    for i in range(z.size):
        gap = z[i] - other[i]
        total += gap * gap * eq.metric[i]
    return math.sqrt(total)


def angle(eq: Any, t: Any, other: Any) -> float:
    """Between unit vectors, from their difference: exact for small angles too."""
    # |t - t'| = 2 sin(angle / 2): 1 - t . t' would have lost half of the digits
    return 2.0 * math.asin(min(1.0, 0.5 * distance(eq, t, other)))


def minus(z: Any, step: Any) -> Any:
    for i in range(z.size):
        z[i] -= step[i]
    return z


def is_short(eq: Any, step: Any, z: Any, tolerance: float) -> bool:
    """Whether a step is short for each entry: beside one of size 1e6 those of size 1 count."""
    for i in range(z.size):
        # 1 / sqrt(W_i) is the scale of an entry, times sqrt(m) in an array of m numbers
        if abs(step[i]) > tolerance * (abs(z[i]) + 1.0 / math.sqrt(eq.metric[i])):
            return False
    return True


def predicted(point: Any, size: float, out: Any) -> Any:
    """``z + s t + s^2/2 dt/ds``."""
    for i in range(out.size):
        out[i] = point.z[i] + size * point.tangent[i] + 0.5 * size * size * point.curvature[i]
    return out


STEPS, CORRECTED = Kernel(steps), Kernel(corrected)
