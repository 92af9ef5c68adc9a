"""Bordered Newton iteration: n equations, n + 1 unknowns, one linear condition to choose."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ContbreatherError
from . import sparse
from .sparse import Matrix

Array = NDArray[np.float64]

# What equations raise where they have no value: `BadInput` and ``math.sqrt(-1.0)`` among them, both
# ValueError. Anything else is a bug and must surface.
OUT_OF_DOMAIN = (ValueError, ArithmeticError)

# Sums of terms that round once each, by eps/2: what is left of them was never seen to be more.
_ROUNDED = 4 * np.finfo(float).eps
_SHORTEST = 1e-6  # damping at which an approach gives up
_LASTING = 1e-5  # of a step this short, relative to 1 + |z|, the square is rounding
_SHRUNK = 1e-2  # and no curvature is in the way where it is this much shorter than the one before
_NEAR = 1e-3  # length of a step, relative to 1 + |z|, at which it has arrived
_THERE = 1e-10  # and one at which rounding may decide whether the next is shorter
_LARGE = 10.0  # size of z beyond which its entries are looked at one by one
_ROUNDING = 1e-12  # residual, relative to the terms of its row, of a solution where Newton is blind


class Undefined(ContbreatherError, ArithmeticError):
    """The equations have no value here: a NaN, an overflow, or beyond the rim of their domain."""


@dataclass(frozen=True, slots=True)
class Solution:
    """Where a Newton iteration ended, and whether that is a solution."""

    z: Array
    converged: bool
    iterations: int
    residual: float  # largest entry of the equations at z
    correction: float  # length of the last step, an estimate of the error before it


@cache
def _gesv() -> Any:
    from scipy.linalg.lapack import dgesv  # dear to import: looking at a breather needs none

    return dgesv


def solve(matrix: Array, right: Array) -> Array | None:
    """Solution of a small dense system, or None where the matrix is singular."""
    _, _, solution, info = _gesv()(matrix, right)
    return solution if info == 0 else None


def solve_oriented(matrix: Array, right: Array) -> tuple[Array | None, int]:
    """As `solve`, with the sign of the determinant, 0 where the matrix is singular."""
    factors, pivots, solution, info = _gesv()(matrix, right)
    if info != 0:
        return None, 0
    sign = 1
    for i, (pivot, row) in enumerate(zip(factors.diagonal().tolist(), pivots, strict=True)):
        if (pivot < 0) != (row != i):
            sign = -sign
    return solution, sign


def newton(
    equations: Callable[[Array], Array],
    jacobian: Callable[[Array], Matrix],
    z: Array,
    *,
    row: Array | None = None,
    metric: Array | None = None,
    tolerance: float = 1e-9,
    most: int = 12,
) -> Solution:
    """Solve ``equations(z) = 0`` together with ``row . (z - z_start) = 0``.

    `jacobian` returns an ``(m, n)`` array, with ``m = n`` without `row` and ``m = n - 1`` with it;
    `metric` holds the weights of a squared length, 1 if None.
    Raises `Undefined` where the equations have no value. A correction that grows ends the
    iteration unconverged, unless all that is left of the equations is rounding: of stiff ones,
    or beside a branch point, that may be more than `tolerance`. Where the matrix is singular
    a correction may be short far from any solution: there the residual has to be rounding.
    The factors of a large derivative serve the last steps, too, which it no longer changes.
    """
    previous, factors, lasting = math.inf, None, False
    size = 1 + length(z, metric)
    bound = tolerance * size
    for iteration in range(1, most + 1):
        value = equations(z)
        if factors is None or not lasting:
            matrix = jacobian(z)
            factors = sparse.Factors(matrix) if sparse.is_sparse(matrix) else None
        step, singular = correction(factors or matrix, value, row)
        moved = length(step, metric)
        if not moved < math.inf:
            raise Undefined("the Newton correction is not finite")
        if 2 * moved > previous and moved > bound:
            solved = bool((abs(value) <= rounding(matrix, z)).all())
            if solved or moved > 2 * previous:
                return Solution(z, solved, iteration, _largest(value), moved)
        z = z - step
        if moved <= bound and (
            bound < _LARGE * tolerance or 2 * moved > previous or _each(step, z, metric, tolerance)
        ):
            value = equations(z)
            solved = not singular or _is_rounding(value, matrix, z, metric)
            return Solution(z, solved, iteration, _largest(value), moved)
        lasting = moved <= min(_LASTING * size, _SHRUNK * previous)
        previous = moved
    return Solution(z, False, most, _largest(equations(z)), previous)


def correction(
    matrix: Array | sparse.Factors, value: Array, row: Array | None
) -> tuple[Array, bool]:
    """The step, and whether the matrix is singular, as at a branch point: there the shortest
    correction is as good as any."""
    if isinstance(matrix, sparse.Factors):
        return sparse.correction(matrix, value, row)
    # the linear condition holds at every iterate, its residual stays 0
    whole, right = (matrix, value) if row is None else bordered(matrix, row, value, 0.0)
    step = solve(whole, right)
    return (_shortest(whole, right), True) if step is None else (step, False)


def bordered(matrix: Array, row: Array, right: Array | float, last: float) -> tuple[Array, Array]:
    """A dense derivative with a row below, and the right side of its system."""
    whole, both = np.empty((row.size, row.size)), np.empty(row.size)
    whole[:-1], whole[-1] = matrix, row
    both[:-1], both[-1] = right, last
    return whole, both


def approach(
    equations: Callable[[Array], Array],
    jacobian: Callable[[Array], Matrix],
    z: Array,
    metric: Array | None = None,
    most: int = 50,
) -> Array | None:
    """From anywhere to where full steps of Newton's iteration are short, or None.

    A step is cut until the next one from there, for the same derivative, would be shorter
    (P. Deuflhard, Newton Methods for Nonlinear Problems, section 3.3): that sees through any
    mixing of the equations. With more unknowns than equations the shortest of all steps is taken.
    """
    weights = np.ones(z.size) if metric is None else metric**-0.5
    damping = 1.0
    value = equations(z)
    for _ in range(most):
        least = _least(sparse.scaled(jacobian(z), np.ones(value.size), weights))
        step = least(value)
        size = length(step, None)
        if size == 0:  # a solution, or the derivative is singular and tells nothing
            return None if value.any() else z
        if size <= _THERE * (1 + length(z, metric)):
            return z
        while damping > _SHORTEST:
            try:
                there = z - damping * step * weights
                value = equations(there)
                ahead = length(least(value), None)
            except Undefined:
                ahead = math.inf
            if ahead <= (1 - damping / 4) * size:
                break
            damping /= 2
        else:
            return None
        z = there
        if damping == 1 and ahead <= _NEAR * (1 + length(z, metric)):
            return z
        damping = min(1.0, 2 * damping)
    return None


def _least(matrix: Matrix) -> Callable[[Array], Array]:
    """What gives the step of least length to a solution of linear equations."""
    if sparse.is_sparse(matrix):
        return sparse.Factors(matrix).least
    square = matrix.shape[0] == matrix.shape[1]

    def least(right: Array) -> Array:
        step = solve(matrix, right) if square else None
        return _shortest(matrix, right) if step is None else step

    return least


def rounding(matrix: Matrix, z: Array) -> Array:
    """What is left of equations at a solution, for their derivative there."""
    return np.asarray(_ROUNDED * (abs(matrix) @ abs(z)))


def length(z: Array, metric: Array | None) -> float:
    return math.sqrt(z.dot(z) if metric is None else z.dot(z * metric))


def _each(step: Array, z: Array, metric: Array | None, tolerance: float) -> bool:
    """Whether a step is short for each entry: beside an entry of size 1e6 those of size 1 count."""
    sizes = abs(z) + (1.0 if metric is None else metric**-0.5)
    return bool((abs(step) <= tolerance * sizes).all())


def _shortest(matrix: Array, right: Array) -> Array:
    if not math.isfinite(matrix.sum()):
        raise Undefined("the derivatives are not finite")
    return np.asarray(np.linalg.lstsq(matrix, right)[0])


def _is_rounding(value: Array, matrix: Matrix, z: Array, metric: Array | None) -> bool:
    """Whether all that is left of the equations is rounding of the terms of each row."""
    sizes = abs(z) + (1.0 if metric is None else metric**-0.5)
    terms = abs(matrix) @ sizes
    terms[terms == 0] = 1.0
    return bool((abs(value) <= _ROUNDING * terms).all())


def _largest(value: Array) -> float:
    return float(abs(value).max())
