"""Plain steps along a curve of a few unknowns, many in one go, up to where somebody has to look.

This text is compiled where the equations of a problem can be (see `kernels`) and runs as it is
elsewhere: floats, loops, and lists for pointers. It steps by the rules of `Stepper`, which
takes over where a step crosses the edge of the window, another branch or the start of the walk,
and where none comes off. So there is one engine, and its plain step has two forms.
"""

from __future__ import annotations

import math
from typing import Any

from ..kernels import call, listed

# The shape of one step: how far the tangent may turn, and how far the curve may stray from the
# cubic through both ends, as a fraction of the step. Together they leave no room for a feature of
# the curve to hide inside a step.
TURN = 0.45
AIM = 0.15
STRAY = 0.003
TINY = 1e-4  # what counts as a tiny step, relative to the longest so far
ITERATIONS = 8  # of Newton's method in a step
EASY = 4  # so many of them ask for another step of this size
ROUNDED = 4 * 2.0**-52  # sums of terms that round once each: what is left of them is no more
LARGE = 10.0  # size of z beyond which its entries are looked at one by one
LARGEST_STEP, RELATIVE = 0.1, 0.01  # unless the rules say how long a step may be

CAME, FAILED, LOOK = 0, -1, -2  # an attempt: it came off, is to be halved, is for the walker

KINDS = "ffpii" + 14 * "p"  # of the arguments of `stride`, for `kernels`
SETTLING = "ffpi" + 10 * "p"  # and of `settle`
TOLERANCE, SMALLEST, LARGEST, GROWTH, BOUNDS, FIRST = range(6)  # of its rules
ARCLENGTH, SIZE, SIDE, LONGEST, RESIDUAL = range(5)  # of its state


def stride(
    evaluate: Any, derive: Any, data: Any, d: int, most: int, rules: Any, metric: Any, origin: Any,
    state: Any, z: Any, tangent: Any, bend: Any, there: Any, ahead: Any, between: Any, value: Any,
    matrix: Any, right: Any, out: Any,
) -> int:  # fmt: skip
    """Take up to `most` plain steps; returns how many came off.

    Parameters
    ----------
    evaluate, derive : ``(z, data, out) -> int``
        The d - 1 equations, and their derivatives row by row; not 0 where there are none.
    rules, metric
        From `TOLERANCE` on, at `BOUNDS` how many, from `FIRST` on slot, low and high of each; the
        weights of a squared length.
    origin
        The row across the start of a walk and, after it, the z of it.
    state, z, tangent, bend
        Where the steps set out and, afterwards, where they ended; state from `ARCLENGTH` on.
    there, ahead, between, value, matrix, right
        Scratch: d numbers each of the first three, 3 d squared of the others.
    out
        For each step z, the tangent, arclength and residual.
    """
    width = 2 * d + 2
    for count in range(most):
        wanted = state[SIZE]
        size = min(wanted, longest(rules, metric, z, d))
        status = FAILED
        while status == FAILED and size >= rules[SMALLEST]:
            state[SIZE] = size
            status = attempt(evaluate, derive, data, d, rules, metric, origin, state, z, tangent,
                             bend, there, ahead, between, value, matrix, right)  # fmt: skip
            size = 0.5 * size
        if status == FAILED:
            state[SIZE] = wanted
        if status != CAME:
            return count
        for i in range(d):
            out[count * width + i] = z[i]
            out[count * width + d + i] = tangent[i]
        out[count * width + 2 * d] = state[ARCLENGTH]
        out[count * width + 2 * d + 1] = state[RESIDUAL]
    return most


def attempt(
    evaluate: Any, derive: Any, data: Any, d: int, rules: Any, metric: Any, origin: Any, state: Any,
    z: Any, tangent: Any, bend: Any, there: Any, ahead: Any, between: Any, value: Any, matrix: Any,
    right: Any,
) -> int:  # fmt: skip
    """One step of the size in the state, which is taken if it came off."""
    size = state[SIZE]
    for i in range(d):
        there[i] = z[i] + size * tangent[i] + 0.5 * size * size * bend[i]
    if outside(rules, there):
        return LOOK
    iterations = newton(
        evaluate, derive, data, d, rules, metric, state, tangent, there, value, matrix, right
    )
    if iterations < 0:
        return iterations
    length = apart(there, z, metric, d)
    if outside(rules, there):
        return LOOK
    if not 0.0 < length <= 2.0 * size:
        return FAILED
    side = look_along(derive, data, d, metric, tangent, there, ahead, matrix, right)
    if side == 0 or side * state[SIDE] < 0:
        return LOOK
    turn = angle(tangent, ahead, metric, d)
    for i in range(d):
        between[i] = (there[i] - z[i]) / length
    if turn > TURN or angle(tangent, between, metric, d) > TURN:
        return FAILED
    for i in range(d):
        bow = (4.0 * tangent[i] - 2.0 * ahead[i]) * length
        between[i] = (20.0 * z[i] + 7.0 * there[i] + bow) / 27.0
    off = astray(evaluate, derive, data, d, metric, tangent, between, matrix, right)
    if off > STRAY * length:
        return FAILED
    if length < TINY * state[LONGEST] or peeks(rules, tangent, ahead):
        return LOOK
    if returns(origin, z, there, ahead, d):
        return LOOK
    state[SIZE] = size * next_size(iterations, turn, rules[GROWTH])
    state[SIDE] = side
    go(state, length, z, tangent, bend, there, ahead, d)
    return CAME


def settle(
    evaluate: Any, derive: Any, data: Any, d: int, rules: Any, metric: Any, state: Any, across: Any,
    slope: Any, there: Any, ahead: Any, value: Any, matrix: Any, right: Any,
) -> int:  # fmt: skip
    """The point of the curve in the plane across a vector, from `there` on, and its tangent on the
    side of `slope`; what failed, or the number of iterations."""
    iterations = newton(
        evaluate, derive, data, d, rules, metric, state, across, there, value, matrix, right
    )
    if iterations < 0:
        return iterations
    side = look_along(derive, data, d, metric, slope, there, ahead, matrix, right)
    return iterations if side != 0 else LOOK


def next_size(iterations: int, turn: float, growth: float) -> float:
    """The size of the next step, relative to that of one that came off."""
    effort = 1.0 if iterations == EASY else (0.7 if iterations > EASY else math.inf)
    return max(min(AIM / max(turn, 1e-12), effort, growth), 0.5)


def go(
    state: Any, length: float, z: Any, tangent: Any, bend: Any, there: Any, ahead: Any, d: int
) -> None:
    """Take the step: the place, the tangent, and how the curve bends are those at its end."""
    before = state[ARCLENGTH]
    state[ARCLENGTH] = before + length
    state[LONGEST] = max(state[LONGEST], state[ARCLENGTH] - before)
    for i in range(d):
        bend[i] = (ahead[i] - tangent[i]) / (state[ARCLENGTH] - before)
        z[i] = there[i]
        tangent[i] = ahead[i]


def longest(rules: Any, metric: Any, z: Any, d: int) -> float:
    """How long a step may be: by the rules, or as the size of z has it."""
    if rules[LARGEST] > 0.0:
        largest: float = rules[LARGEST]
        return largest
    return max(LARGEST_STEP, RELATIVE * norm(z, metric, d))


# --- Newton's method, the tangent, closeness ----------------------------------------------------


def newton(
    evaluate: Any, derive: Any, data: Any, d: int, rules: Any, metric: Any, state: Any,
    tangent: Any, there: Any, value: Any, matrix: Any, right: Any,
) -> int:  # fmt: skip
    """As `newton.newton`, across the tangent, from `there` on; its iterations, or what failed."""
    tolerance = rules[TOLERANCE]
    bound = tolerance * (1.0 + norm(there, metric, d))
    previous = math.inf
    for iteration in range(1, ITERATIONS + 1):
        if undefined(evaluate, data, there, value, d - 1):
            return FAILED
        for i in range(d - 1):
            right[i] = value[i]
        right[d - 1] = 0.0
        side = bordered(derive, data, d, metric, tangent, there, matrix, right)
        correction = norm(right, metric, d)
        if side == 0 or not correction < math.inf:
            return LOOK
        if 2.0 * correction > previous and correction > bound:
            if call(derive, there, data, matrix) != 0:
                return FAILED
            if is_rounding(value, matrix, there, d):
                state[RESIDUAL] = largest_of(value, d - 1)
                return iteration
            if correction > 2.0 * previous:
                return FAILED
        for i in range(d):
            there[i] -= right[i]
        if correction <= bound and (
            bound < LARGE * tolerance
            or 2.0 * correction > previous
            or is_short(right, there, metric, tolerance, d)
        ):
            if undefined(evaluate, data, there, value, d - 1):
                return FAILED
            state[RESIDUAL] = largest_of(value, d - 1)
            return iteration
        previous = correction
    return FAILED


def undefined(evaluate: Any, data: Any, z: Any, value: Any, n: int) -> bool:
    """Fill in the equations; whether they have no value."""
    if call(evaluate, z, data, value) != 0:
        return True
    total = 0.0
    for i in range(n):
        total += value[i]
    return not math.isfinite(total)


def bordered(
    derive: Any, data: Any, d: int, metric: Any, row: Any, z: Any, matrix: Any, right: Any
) -> int:
    """Solve with the derivative at z and a row below it; the sign of the determinant, or 0."""
    if call(derive, z, data, matrix) != 0:
        return 0
    for i in range(d):
        matrix[(d - 1) * d + i] = row[i] * metric[i]
    return solve(matrix, right, d)


def look_along(
    derive: Any, data: Any, d: int, metric: Any, tangent: Any, there: Any, ahead: Any, matrix: Any,
    right: Any,
) -> int:  # fmt: skip
    """The unit tangent there; the sign of the bordered determinant, or 0."""
    for i in range(d):
        right[i] = 0.0
    right[d - 1] = 1.0
    side = bordered(derive, data, d, metric, tangent, there, matrix, right)
    size = norm(right, metric, d)
    if not 0.0 < size < math.inf:
        return 0
    for i in range(d):
        ahead[i] = right[i] / size
    return side


def astray(
    evaluate: Any, derive: Any, data: Any, d: int, metric: Any, tangent: Any, between: Any,
    matrix: Any, right: Any,
) -> float:  # fmt: skip
    """How far the curve is from a place on the cubic through both ends of the step."""
    if undefined(evaluate, data, between, right, d - 1):
        return math.inf
    right[d - 1] = 0.0
    if bordered(derive, data, d, metric, tangent, between, matrix, right) == 0:
        return 0.0  # a branch point: the residual says nothing there
    return norm(right, metric, d)


# --- where the walker has to look ---------------------------------------------------------------


def outside(rules: Any, z: Any) -> bool:
    """Whether z is beyond a bound."""
    for i in range(int(rules[BOUNDS])):
        value = z[int(rules[FIRST + 3 * i])]
        if value < rules[FIRST + 3 * i + 1] or value > rules[FIRST + 3 * i + 2]:
            return True
    return False


def peeks(rules: Any, tangent: Any, ahead: Any) -> bool:
    """Whether what has a bound turned round within the step."""
    for i in range(int(rules[BOUNDS])):
        slot = int(rules[FIRST + 3 * i])
        if tangent[slot] * ahead[slot] < 0.0:
            return True
    return False


def returns(origin: Any, z: Any, there: Any, ahead: Any, d: int) -> bool:
    """Whether the step passes the plane of the start in the direction of the walk."""
    before = after = along = 0.0
    for i in range(d):
        before += origin[i] * (z[i] - origin[d + i])
        after += origin[i] * (there[i] - origin[d + i])
        along += origin[i] * ahead[i]
    return before < 0.0 and after >= 0.0 and along >= 0.5


# --- a few numbers ------------------------------------------------------------------------------


def norm(z: Any, metric: Any, d: int) -> float:
    total = 0.0
    for i in range(d):
        total += z[i] * z[i] * metric[i]
    return math.sqrt(total)


def apart(one: Any, other: Any, metric: Any, d: int) -> float:
    total = 0.0
    for i in range(d):
        gap = one[i] - other[i]
        total += gap * gap * metric[i]
    return math.sqrt(total)


def angle(one: Any, other: Any, metric: Any, d: int) -> float:
    """Between unit vectors, from their difference: exact for small angles too."""
    return 2.0 * math.asin(min(1.0, 0.5 * apart(one, other, metric, d)))


def largest_of(value: Any, n: int) -> float:
    found = 0.0
    for i in range(n):
        found = max(found, abs(value[i]))
    return found


def is_rounding(value: Any, matrix: Any, z: Any, d: int) -> bool:
    """Whether all that is left of the equations is rounding of their terms."""
    for i in range(d - 1):
        terms = 0.0
        for j in range(d):
            terms += abs(matrix[i * d + j]) * abs(z[j])
        if abs(value[i]) > ROUNDED * terms:
            return False
    return True


def is_short(step: Any, z: Any, metric: Any, tolerance: float, d: int) -> bool:
    """Whether a step is short for each entry: beside one of size 1e6 those of size 1 count."""
    for i in range(d):
        if abs(step[i]) > tolerance * (abs(z[i]) + 1.0 / math.sqrt(metric[i])):
            return False
    return True


def solve(matrix: Any, right: Any, d: int) -> int:
    """Gaussian elimination in place; the sign of the determinant, 0 where that vanishes."""
    side = 1
    for k in range(d):
        best = k
        for i in range(k + 1, d):
            if abs(matrix[i * d + k]) > abs(matrix[best * d + k]):
                best = i
        pivot = matrix[best * d + k]
        if not abs(pivot) > 0.0:
            return 0
        if (best != k) != (pivot < 0.0):
            side = -side
        if best != k:
            swap(matrix, right, best, k, d)
        for i in range(k + 1, d):
            factor = matrix[i * d + k] / pivot
            for j in range(k + 1, d):
                matrix[i * d + j] -= factor * matrix[k * d + j]
            right[i] -= factor * right[k]
    for k in range(d - 1, -1, -1):
        for j in range(k + 1, d):
            right[k] -= matrix[k * d + j] * right[j]
        right[k] /= matrix[k * d + k]
    return side


def swap(matrix: Any, right: Any, one: int, other: int, d: int) -> None:
    right[one], right[other] = right[other], right[one]
    for j in range(d):
        at, to = one * d + j, other * d + j
        matrix[at], matrix[to] = matrix[to], matrix[at]


listed(KINDS, stride)
listed(SETTLING, settle)
