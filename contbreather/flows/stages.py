"""The stage equations of the Gauss method, on all intervals of a flow, in machine code.

With slopes k at the Gauss points and Butcher's matrix A, on an interval of length h,

    k_a = h f(t + c_a h, x + sum_b A_ab k_b),    (1 - h f_x A) dk = -(k - h f),

where the factors of the matrix in front serve flights near by as well.
"""

from __future__ import annotations

import math

from ..kernels import Cube, Kernel, Matrix, Table, Vector


def factorise(
    df: Cube, lengths: Vector, matrix: Matrix, factors: Cube, pivots: Table, answer: Vector
) -> None:
    """The triangular factors of all intervals, column by column, with partial pivoting; the answer
    is finite if the derivatives `df` in the state are, and 0 where a matrix is singular."""
    n, points = df.shape[0], matrix.shape[0]
    size, total, regular = n * points, 0.0, 1.0
    for j in range(lengths.size):
        for b in range(points):
            for q in range(n):
                for a in range(points):
                    for i in range(n):
                        slope = lengths[j] * df[i, q, j * points + a]
                        factors[j, b * n + q, a * n + i] = -slope * matrix[a, b]
                        total += slope
                factors[j, b * n + q, b * n + q] += 1.0
        for k in range(size):
            best = k
            for i in range(k + 1, size):
                if abs(factors[j, k, i]) > abs(factors[j, k, best]):
                    best = i
            pivots[j, k] = best
            if best != k:
                for q in range(k, size):  # multipliers stay where they were made
                    held = factors[j, q, k]
                    factors[j, q, k] = factors[j, q, best]
                    factors[j, q, best] = held
            pivot = factors[j, k, k]
            if pivot == 0.0:
                regular = 0.0
            for i in range(k + 1, size):
                factors[j, k, i] /= pivot
            for q in range(k + 1, size):
                held = factors[j, q, k]
                for i in range(k + 1, size):
                    factors[j, q, i] -= held * factors[j, k, i]
    answer[0] = regular if math.isfinite(total) else total


def substitute(factors: Cube, pivots: Table, j: int, right: Cube) -> None:
    """Solve with the factors of one interval for the rows of its `right`, in place."""
    for q in range(right.shape[1]):
        for k in range(right.shape[2]):
            best = pivots[j, k]
            held = right[j, q, best]
            right[j, q, best] = right[j, q, k]
            right[j, q, k] = held
            for i in range(k + 1, right.shape[2]):
                right[j, q, i] -= held * factors[j, k, i]
        for k in range(right.shape[2] - 1, -1, -1):
            right[j, q, k] /= factors[j, k, k]
            held = right[j, q, k]
            for i in range(k):
                right[j, q, i] -= held * factors[j, k, i]


def correct(
    least: float,
    factors: Cube,
    pivots: Table,
    lengths: Vector,
    f: Cube,
    step: Cube,
    k: Cube,
    answer: Vector,
) -> None:
    """A step of Newton's iteration for the slopes `k`; the answer is the largest correction in
    units of the largest slope, or of `least`, and not finite where any is not."""
    n, points, total, moved = k.shape[0], k.shape[2], 0.0, 0.0
    for j in range(lengths.size):
        for a in range(points):
            for i in range(n):
                step[j, 0, a * n + i] = k[i, j, a] - lengths[j] * f[i, j, a]
        substitute(factors, pivots, j, step)
        for i in range(n):
            for a in range(points):
                change = step[j, 0, a * n + i]
                k[i, j, a] -= change
                total += change
                moved = max(moved, abs(change))
                least = max(least, abs(k[i, j, a]))
    answer[0] = moved / least if math.isfinite(total) else math.nan


def sensitivities(
    factors: Cube,
    pivots: Table,
    lengths: Vector,
    nodes: Vector,
    weights: Vector,
    f: Cube,
    df: Cube,
    inside: Cube,
    ends: Cube,
) -> None:
    """The derivatives of all slopes inside, and of the states where intervals end, in the state and
    the time where they begin, their length, and parameters."""
    n, points, many = df.shape[0], nodes.size, inside.shape[1]
    for j in range(lengths.size):
        for a in range(points):
            for i in range(n):
                for q in range(n + 1):
                    inside[j, q, a * n + i] = lengths[j] * df[i, q, j * points + a]
                inside[j, n + 1, a * n + i] = f[i, j, a] + nodes[a] * inside[j, n, a * n + i]
                for q in range(n + 2, many):
                    inside[j, q, a * n + i] = lengths[j] * df[i, q - 1, j * points + a]
        substitute(factors, pivots, j, inside)
        for i in range(n):
            for q in range(many):
                ends[j, i, q] = 1.0 if i == q else 0.0
                for a in range(points):
                    ends[j, i, q] += weights[a] * inside[j, q, a * n + i]


FACTORISE, CORRECT, SENSITIVITIES = Kernel(factorise), Kernel(correct), Kernel(sensitivities)
