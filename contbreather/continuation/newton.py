"""Bordered Newton iteration: n equations, n + 1 unknowns, and one linear condition to choose among them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dgesv

Array = NDArray[np.float64]


class Undefined(ArithmeticError):
    """The equations have no value here: a NaN, an overflow, or beyond the rim of their domain."""


@dataclass(frozen=True, slots=True)
class Solution:
    """Where a Newton iteration ended, and whether that is a solution."""

    z: Array
    converged: bool
    iterations: int
    residual: float  # largest entry of the equations at z
    correction: float  # length of the last step, an estimate of the error before it


def solve(matrix: Array, right: Array) -> Array | None:
    """Solution of a small dense system, or None where the matrix is singular."""
    _, _, solution, info = dgesv(matrix, right)
    return solution if info == 0 else None


def newton(
    equations: Callable[[Array], Array],
    jacobian: Callable[[Array], Array],
    z: Array,
    *,
    row: Array | None = None,
    tolerance: float = 1e-9,
    most: int = 12,
) -> Solution:
    """Solve ``equations(z) = 0`` together with ``row . (z - z_start) = 0``.

    `jacobian` returns an ``(m, n)`` array, with ``m = n`` without `row` and ``m = n - 1`` with it.
    Raises `Undefined` where the equations have no value. A correction that grows ends the
    iteration unconverged: a shorter predictor step is then the cure.
    """
    size = z.size
    right = np.zeros(size)
    previous = math.inf
    bound = tolerance * (1 + math.sqrt(z.dot(z)))
    for iteration in range(1, most + 1):
        value = equations(z)
        if row is None:
            matrix, right = jacobian(z), value
        else:
            matrix = np.empty((size, size))
            matrix[:-1], matrix[-1] = jacobian(z), row
            right[:-1] = value  # the linear condition holds at every iterate, its residual stays 0
        step = solve(matrix, right)
        if step is None:  # at a branch point: the shortest correction is as good as any
            step = np.linalg.lstsq(matrix, right)[0]
        length = math.sqrt(step.dot(step))
        if not length < math.inf:
            raise Undefined("the Newton correction is not finite")
        if length > 2 * previous and length > bound:
            return Solution(z, False, iteration, _largest(value), length)
        z = z - step
        if length <= bound:
            return Solution(z, True, iteration, _largest(equations(z)), length)
        previous = length
    return Solution(z, False, most, _largest(equations(z)), previous)


def _largest(value: Array) -> float:
    return float(abs(value).max())
