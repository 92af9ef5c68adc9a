"""Many steps in one call, for small problems that bring their equations as kernels.

The same steps as those of `stepper`, which says why they are what they are: predict, Newton, check,
adapt; its names are those used here. Whatever is not plain walking ends a piece: a bound, a branch
point, a turn next to a bound, the way back to the start, a step that fails. `stepper` takes that
step.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from types import FunctionType
from typing import Any, NamedTuple

import numpy as np

from ...kernels import Counts, Kernel, Matrix, Vector, fixed, inlined

# How far the tangent may turn within a step, the turn that step sizes aim at, and how far the curve
# may be off the cubic through both ends, as a fraction of the step. Together they leave no room for
# a feature of the curve to hide inside a step.
TURN, AIM, CUBIC_ERROR = 0.45, 0.15, 0.003
TINY = 1e-4  # relative to the longest step so far
ITERATIONS = 8  # of Newton's method in a step
EASY = 4  # so many of them ask for another step of this size
LARGE = 10.0  # size of z beyond which its entries are looked at one by one

# what `walker` puts in their places, of one problem
Data: Any = None
residual: Any = None
jacobian: Any = None

ACCEPTED, SHORTER, LOOK = 0, 1, 2  # a step is taken; a shorter one may do; the caller has to look
ARCLENGTH, SIZE, SIGN, LONGEST, LENGTH = range(5)  # of the state of a walk


@fixed
class Rules(NamedTuple):
    """Rules and bounds of a walk, the same for all of its steps."""

    tolerance: float
    smallest: float
    largest: float  # NaN: as long as the size of z has it
    growth: float
    slots: Counts  # what has a bound
    low: Vector
    high: Vector
    metric: Vector
    across: Vector  # the plane of the start: ``across . (z - start) = 0``
    start: Vector


@fixed
class Room(NamedTuple):
    """z, unit tangent and what the curve bends by in s^2 and s^3 where a step sets out, what it
    leads to, and room to solve."""

    z: Vector
    tangent: Vector
    second: Vector
    third: Vector
    end: Vector
    end_tangent: Vector
    between: Vector
    right: Vector
    value: Vector
    flat: Vector  # J, row by row, and the row below
    matrix: Matrix  # the same


def walk(data: Data, rules: Rules, room: Room, state: Vector, out: Matrix, count: Counts) -> None:
    """Take steps until one fails or has to be looked at; a row of `out` for each: z, tangent,
    arclength and residual."""
    d, count[0] = room.z.size, 0
    while count[0] < out.shape[0]:
        wanted = state[SIZE]
        size = max(0.1, 0.01 * norm(rules, room.z))
        size = min(wanted, rules.largest if rules.largest > 0.0 else size)
        status, off = SHORTER, 0.0
        while status == SHORTER and size >= rules.smallest:
            status, off = try_step(data, rules, room, state, size)
            size = 0.5 * size
        if status != ACCEPTED:
            return
        row = count[0]
        for i in range(d):
            out[row, i], out[row, d + i] = room.z[i], room.tangent[i]
        out[row, 2 * d], out[row, 2 * d + 1] = state[ARCLENGTH], off
        count[0] = row + 1


def solve_place(data: Data, rules: Rules, room: Room, answer: Vector) -> None:
    """Solve for the place in the plane across `room.tangent` where `room.end` is a guess, and for
    the tangent there; whether that came off, and the residual."""
    status, _, off = newton_steps(data, rules, room)
    accepted = status == ACCEPTED and tangent_at_end(data, rules, room) != 0
    answer[0], answer[1] = 1.0 if accepted else 0.0, off


@inlined
def try_step(data: Any, rules: Rules, room: Room, state: Vector, size: float) -> tuple[int, float]:
    """Take a step of this size if it comes off; how that ended, and its residual."""
    z, t, end = room.z, room.tangent, room.end
    for i in range(z.size):
        end[i] = z[i] + size * (t[i] + size * (room.second[i] + size * room.third[i]))
    if outside(rules, end):
        return LOOK, 0.0
    status, iterations, off = newton_steps(data, rules, room)
    if status != ACCEPTED:
        return status, 0.0
    if outside(rules, end):
        return LOOK, 0.0
    length = distance(rules, end, z)
    if not 0.0 < length <= 2.0 * size:
        return SHORTER, 0.0
    sign = tangent_at_end(data, rules, room)
    if sign == 0:
        return LOOK, 0.0
    turn = angle(rules, t, room.end_tangent)
    for i in range(z.size):
        room.between[i] = (end[i] - z[i]) / length
    if turn > TURN or angle(rules, t, room.between) > TURN:
        return SHORTER, 0.0
    if not off_cubic(data, rules, room, length) <= CUBIC_ERROR * length:
        return SHORTER, 0.0
    tiny = length < TINY * state[LONGEST]
    if tiny or sign * state[SIGN] < 0 or leaves_or_returns(rules, room, length):
        return LOOK, 0.0
    effort = 1.0 if iterations == EASY else (0.7 if iterations > EASY else math.inf)
    state[SIZE] = size * max(min(AIM / max(turn, 1e-12), effort, rules.growth), 0.5)
    before, state[SIGN] = state[ARCLENGTH], sign
    state[ARCLENGTH] = before + length
    length = state[ARCLENGTH] - before  # as points of a branch have it, rounded
    state[LONGEST] = max(state[LONGEST], length)
    last, state[LENGTH] = state[LENGTH], length
    for i in range(z.size):
        curvature, change = (room.end_tangent[i] - t[i]) / length, 0.0
        if last > 0.0:
            past = 2.0 * room.second[i] - 3.0 * last * room.third[i]
            change = (curvature - past) / (last + length)
        room.second[i], room.third[i] = (curvature + length * change) / 2.0, change / 3.0
        z[i], t[i] = end[i], room.end_tangent[i]
    return ACCEPTED, off


@inlined
def newton_steps(data: Any, rules: Rules, room: Room) -> tuple[int, int, float]:
    """Newton's iteration from the predicted end on, across the tangent; how it ended, after how
    many iterations, and the residual."""
    z, value, step = room.end, room.value, room.right
    bound, previous = rules.tolerance * (1.0 + norm(rules, z)), math.inf
    for iteration in range(1, ITERATIONS + 1):
        if residual(z, data, value) != 0:
            return SHORTER, iteration, 0.0
        if solve(data, rules, room, z, 0.0) == 0:
            return LOOK, iteration, 0.0
        moved = norm(rules, step)
        slow, short = 2.0 * moved > previous, moved <= bound
        for i in range(z.size):
            z[i] -= step[i]
            least = rules.tolerance * (abs(z[i]) + 1.0 / math.sqrt(rules.metric[i]))
            short = short and (bound < LARGE * rules.tolerance or abs(step[i]) <= least)
        if not moved < math.inf or (slow and not short):
            return LOOK, iteration, 0.0  # what is left may be rounding
        if short:
            exists, most = residual(z, data, value) == 0, 0.0
            for entry in value:
                most = max(most, abs(entry))
            return ACCEPTED if exists and most < math.inf else SHORTER, iteration, most
        previous = moved
    return SHORTER, ITERATIONS, 0.0


@inlined
def tangent_at_end(data: Any, rules: Rules, room: Room) -> int:
    """The unit tangent at the end; the sign of the bordered determinant, 0 where there is none."""
    for i in range(room.value.size):
        room.value[i] = 0.0
    sign = solve(data, rules, room, room.end, 1.0)
    size = norm(rules, room.right)
    for i in range(room.z.size):
        room.end_tangent[i] = room.right[i] / size
    return sign if 0.0 < size < math.inf else 0


@inlined
def off_cubic(data: Any, rules: Rules, room: Room, length: float) -> float:
    """Measure how far the curve is from the cubic through both ends, a third of the way along."""
    between = room.between
    for i in range(between.size):
        bow = (4.0 * room.tangent[i] - 2.0 * room.end_tangent[i]) * length
        between[i] = (20.0 * room.z[i] + 7.0 * room.end[i] + bow) / 27.0
    if residual(between, data, room.value) != 0:
        return math.inf
    return norm(rules, room.right) if solve(data, rules, room, between, 0.0) != 0 else 0.0


@inlined
def outside(rules: Rules, z: Any) -> bool:
    for i in range(rules.slots.size):
        if not rules.low[i] <= z[rules.slots[i]] <= rules.high[i]:
            return True
    return False


@inlined
def leaves_or_returns(rules: Rules, room: Room, length: float) -> bool:
    """Tell whether what has a bound may have turned round beyond it, or the step passes the start:
    either may be wrong to the safe side."""
    for i in range(rules.slots.size):
        slot = rules.slots[i]
        start, reach = room.z[slot], length / math.sqrt(rules.metric[slot])
        out_of_reach = rules.low[i] < start - reach and start + reach < rules.high[i]
        if room.tangent[slot] * room.end_tangent[slot] < 0.0 and not out_of_reach:
            return True
    before = after = along = 0.0
    for i in range(room.z.size):
        before += rules.across[i] * (room.z[i] - rules.start[i])
        after += rules.across[i] * (room.end[i] - rules.start[i])
        along += rules.across[i] * room.end_tangent[i]
    return before < 0.0 and after >= 0.0 and along >= 0.5


# --- arithmetic -----------------------------------------------------------------------------------


@inlined
def solve(data: Any, rules: Rules, room: Room, z: Any, last: float) -> int:
    """Solve with J(z) and, below it, t^T W for `room.value` and a last entry, into `room.right`;
    the sign of the determinant, or 0."""
    if jacobian(z, data, room.flat) != 0:
        return 0
    n = room.value.size
    for i in range(n):
        room.right[i] = room.value[i]
    room.right[n] = last
    for j in range(n + 1):
        room.matrix[n, j] = room.tangent[j] * rules.metric[j]
    return eliminate(room.matrix, room.right)


def eliminate(A: Matrix, b: Vector) -> int:
    """Gaussian elimination in place; the sign of the determinant, 0 where that vanishes."""
    d, sign = b.size, 1
    for k in range(d):
        best = k
        for i in range(k + 1, d):
            if abs(A[i, k]) > abs(A[best, k]):
                best = i
        pivot = A[best, k]
        if not abs(pivot) > 0.0:  # 0, or a NaN
            return 0
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


def norm(rules: Any, z: Any) -> float:
    total = 0.0
    for i in range(z.size):
        total += z[i] * z[i] * rules.metric[i]
    return math.sqrt(total)


def distance(rules: Any, z: Any, other: Any) -> float:
    total = 0.0
    for i in range(z.size):
        gap = z[i] - other[i]
        total += gap * gap * rules.metric[i]
    return math.sqrt(total)


def angle(rules: Any, t: Any, other: Any) -> float:
    return 2.0 * math.asin(min(1.0, 0.5 * distance(rules, t, other)))


# --- for one problem ------------------------------------------------------------------------------


class Walker(NamedTuple):
    """`walk` and `solve_place` for the equations of one kind of problem."""

    walk: Kernel
    solve_place: Kernel


def walker(residual: Callable[..., int], jacobian: Callable[..., int], data: type) -> Walker:
    """Make the kernels for equations ``residual(z, data, out) -> int``, not 0 where they have none,
    and their derivative row by row, with `data` the NamedTuple of all else that they ask for."""
    scope = dict(globals(), __name__=residual.__module__, Data=data)
    for name, function in globals().items():
        if isinstance(function, FunctionType) and function.__module__ == __name__:
            copy = scope[name] = FunctionType(function.__code__, scope, name)
            copy.__annotations__ = function.__annotations__
    scope.update(residual=inlined(residual), jacobian=inlined(jacobian))
    return Walker(Kernel(scope["walk"]), Kernel(scope["solve_place"]))


def at_a_place(tolerance: float, metric: Vector) -> Rules:
    """Rules for `solve_place`, which takes no step."""
    none = np.empty(0)
    slots = np.empty(0, dtype=np.int64)
    return Rules(tolerance, 0.0, math.nan, 1.0, slots, none, none, metric, metric, metric)


class Pieces:
    """Calls the kernels for one curve; `state` is as above, where the last piece ended."""

    def __init__(self, kernels: Walker, data: Any, rules: Rules) -> None:
        self.kernels, self.data, self.rules, self.state = kernels, data, rules, np.zeros(5)
        d = rules.metric.size
        flat = np.zeros(d * d)
        buffers: list[Any] = [*np.zeros((8, d)), np.zeros(d - 1), flat, flat.reshape(d, d)]
        self.room = Room(*buffers)

    def steps(self, start: Any, state: Any, most: int) -> Any:
        """Take as many steps as come off, at most so many, from z, tangent and bends, and a state:
        their z, tangents, arclengths and residuals."""
        for buffer, entries in zip((*self.room[:4], self.state), (*start, state), strict=True):
            buffer[:] = entries
        d, count = self.rules.metric.size, np.zeros(1, dtype=np.int64)
        out = np.empty((most, 2 * d + 2))
        self.kernels.walk(self.data, self.rules, self.room, self.state, out, count)
        rows = out[: count[0]].copy()
        return rows[:, :d], rows[:, d : 2 * d], rows[:, -2], rows[:, -1]

    def corrected(self, guess: Any, across: Any) -> tuple[Any, Any, float] | None:
        """The place of the curve in the plane across a vector, the tangent there, on the side of
        that, and the residual; None where Newton's iteration is more than a plain one."""
        self.room.end[:], self.room.tangent[:] = guess, across
        self.kernels.solve_place(self.data, self.rules, self.room, self.state)
        if not self.state[0]:
            return None
        return self.room.end.copy(), self.room.end_tangent.copy(), float(self.state[1])
