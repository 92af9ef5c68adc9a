"""Least singular values and their vectors, of dense and of sparse matrices, and along a curve."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .newton import Array, Undefined
from .sparse import (
    TURNS,
    Factors,
    Matrix,
    any_vector,
    beside,
    eliminated_as,
    factorised,
    is_large,
    is_sparse,
)

LOST = 1e-10  # a singular value so small, beside the largest, is rounding: a rank is lost


@dataclass(frozen=True, eq=False)
class LeastSingular:
    """The least singular value of a matrix A of n rows and n + k columns."""

    left: Array  # singular vectors of the least singular value, ``A right = size left``
    right: Array
    null: Array  # k orthonormal null vectors, in rows
    size: float
    largest: float  # singular value; of a sparse matrix a bound
    following: Callable[[], float]
    # ``rest(value)``: the shortest solution of ``A x = value`` where neither `left` nor `right`
    # take part
    rest: Callable[[Array], Array]
    orientation: Callable[[], float]

    @cached_property
    def sign(self) -> int:
        """Sign that makes the least singular value of a square A smooth where A is singular."""
        return round(self.orientation())

    @cached_property
    def second(self) -> float:
        """Second least singular value, infinite if there is none."""
        return self.following()

    @property
    def lost(self) -> bool:
        """Whether a rank is lost, to rounding."""
        return self.size <= LOST * self.largest

    @property
    def plane(self) -> Array:
        """`right` and the null vectors, in rows."""
        return np.vstack([self.right, self.null])


def sense(vector: NDArray[Any]) -> Any:
    """The sign, or phase, of the first entry of a vector that is not much smaller than the largest:
    divided by it rounding has no say."""
    size = abs(vector)
    # no fraction of small numbers: entries of vectors are often those of each other
    entry = vector[int((size >= 0.37 * size.max()).argmax())]
    return entry / abs(entry) if entry else 1.0


def solved(matrix: Matrix, right: NDArray[Any], why: str) -> NDArray[Any]:
    """Solve one system, dense or sparse, real or complex; `why` says what a singular one means."""
    try:
        if not is_sparse(matrix):
            return np.asarray(np.linalg.solve(matrix, right))
        dtype = np.result_type(matrix.dtype, right.dtype)
        matrix = eliminated_as(matrix.astype(dtype), matrix)
        return np.asarray(factorised(matrix).solve(right.astype(dtype)))
    except (np.linalg.LinAlgError, RuntimeError) as error:
        raise Undefined(why) from error


def least_singular(matrix: Matrix) -> LeastSingular:
    """Least singular values and vectors of a matrix with at least as many columns as rows."""
    if not is_large(matrix):
        return _dense(matrix)
    # of fewer rows it is taken as a dense one
    if matrix.shape[0] < 8:
        return _dense(matrix.toarray())
    return _sparse(Factors(matrix))


def _dense(matrix: Array) -> LeastSingular:
    left, sizes, right = np.linalg.svd(matrix)
    n = sizes.size - 1
    side = sense(right[n])
    # A = sum of size_i left_i right_i^T: all but the last term can be inverted
    return LeastSingular(
        side * left[:, -1],
        side * right[n],
        right[n + 1 :],
        float(sizes[-1]),
        float(sizes[0]),
        lambda: float(sizes[-2]) if n else math.inf,
        lambda value: right[:n].T @ (left[:, :n].T @ value / sizes[:n]),
        lambda: float(np.linalg.det(left) * np.linalg.det(right)),
    )


def by_inverses(
    factors: Any, size: int, turns: int = TURNS, **how: bool
) -> tuple[float, Array, Array]:
    """The least singular value of a square matrix with the sign of its determinant, and its vectors
    w and v: ``w* B v = value``; about, by a few turns of inverse iteration, two where it vanishes.
    """
    left = right = any_vector(size)
    value = 0.0
    # v = B^-1 w and w = B^-* v, each to length 1: 1/|B^-1 w| tends to the least singular value
    for _ in range(turns):
        right, before = factors.solve(left, **how), left
        value = 1 / math.sqrt(right @ right)
        if not value > 0.0:  # singular to the last digit, as where what rests branches
            return 0.0, left, left
        right = value * right
        left = factors.transposed(right)
        left = left / math.sqrt(left @ left)
        # the cosine of the angle between directions that are the same
        if abs(left @ before) >= 1 - 1e-15:
            break
    side = factors.sign()
    return side * value, side * left, right


def _sparse(factors: Factors) -> LeastSingular:
    from scipy.sparse.linalg import ArpackError

    matrix, (n, width) = factors.matrix, factors.matrix.shape

    # 1 / size^2 is the largest eigenvalue of (A A^T)^-1, applied by two triangular solves
    def both(vector: Array) -> Array:
        return factors.transposed(factors.least(vector, refined=False))

    try:
        left = _leading(both, n)[1]
    except ArpackError as error:
        raise Undefined("the derivative is singular to the last digit: no null vectors") from error
    # one more step from left gives right: A right = size left to rounding, not to ARPACK's 1e-9
    right = factors.least(left)
    size = float(left @ (matrix @ right))
    right /= math.copysign(math.sqrt(right @ right), size)
    size = float(left @ (matrix @ right))
    side = sense(right)
    left, right = side * left, side * right

    def rest(value: Array) -> Array:
        x = factors.least(value - (left @ value) * left)
        return np.asarray(x - (right @ x) * right)

    # |A|_2^2 <= |A|_1 |A|_inf
    largest = abs(matrix).sum(axis=0).max() * abs(matrix).sum(axis=1).max()

    @cache
    def bordered() -> Factors:
        # | A      left |  is far from singular where A nearly is; its determinant is minus the sign
        # | right^T  0  |  that is asked for, times the product of all other singular values
        return Factors(beside(matrix, left[:, None]))

    def orientation() -> float:
        return -bordered().sign(np.append(right, 0.0)[None, :])

    def following() -> float:
        # with the null vectors below its inverse is that of A on all but `left` and `right`; of the
        # inverse of A, where the least vanishes, the second largest value is rounding
        wider = bordered()
        below = np.column_stack([np.vstack([right, factors.basis.T]), np.zeros(width - n + 1)])

        def others(vector: Array) -> Array:
            x = wider.solve(np.append(vector, np.zeros(len(below))), below, refined=False)
            return wider.transposed(np.append(x[:-1], 0.0), below)[:n]

        return 1 / math.sqrt(_leading(others, n)[0])

    sizes = size, math.sqrt(largest)
    return LeastSingular(left, right, factors.basis.T, *sizes, following, rest, orientation)


def _leading(apply: Callable[[Array], Array], n: int) -> tuple[float, Array]:
    """The largest eigenvalue of a symmetric operator that is not negative, and its vector."""
    from scipy.sparse.linalg import LinearOperator, eigsh

    operator = LinearOperator((n, n), matvec=apply, dtype=float)
    values, vectors = eigsh(operator, k=1, which="LM", v0=any_vector(n), tol=1e-9)
    return float(values[0]), vectors[:, 0]


# --- bordered matrices along a curve -------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Bordered:
    """A sparse derivative with the row of a tangent below and its unknowns in their scales: what is
    singular at branch points."""

    factors: Factors
    row: Array
    scales: Array

    def solve(self, right: Array) -> Array:
        return self.factors.solve(right, self.row[None, :], refined=False) / self.scales

    def transposed(self, right: Array) -> Array:
        return self.factors.transposed(right / self.scales, self.row[None, :])

    def __matmul__(self, vector: Array) -> Array:
        moved = vector * self.scales
        return np.append(self.factors.matrix @ moved, self.row @ moved)

    def sign(self) -> int:
        return self.factors.sign(self.row[None, :])


def inverses_between(first: Bordered, *others: Bordered) -> Array:
    """Inverses of the places, from 0 at the first of several matrices to 1 at the last, where they
    are singular, as `singular_between` finds them: eigenvalues of size 1 and more."""
    from scipy.sparse.linalg import ArpackNoConvergence, LinearOperator, eigs

    middle, last, size = others[0], others[-1], first.row.size

    # M(u) = M0 + u (M1 - M0) is singular at u where M0^-1 (M0 - M1) has the eigenvalue 1 / u
    def linear(x: Array) -> Array:
        return first.solve(first @ x - last @ x)

    # with u^2 as well, of the companion matrix of three, for x and y = u x
    def quadratic(xy: Array) -> Array:
        x, y = xy[:size], xy[size:]
        Q = 2 * (first @ (x - y) - 2 * (middle @ (x - y)) + last @ (x - y))
        return np.concatenate([first.solve(first @ x - last @ x + Q), x])

    whole, matvec = (size, linear) if middle is last else (2 * size, quadratic)
    # most steps of a walk are short against all: a few steps of power iteration show an eigenvalue
    # of size 1 among small ones
    x, growth = any_vector(whole), 0.0
    for _ in range(3):
        x = matvec(x)
        growth = float(np.linalg.norm(x))
        x = x / (growth or 1.0)
    if not growth > 0.3:  # by one application: no eigenvalue is 1
        return np.empty(0)
    operator = LinearOperator((whole, whole), matvec=matvec, dtype=float)
    values, wanted = np.empty(0, dtype=complex), 2
    # all of size 1 and more are wanted: more are asked for until the least of them is smaller
    # branch points that are looked for on one step
    while wanted < min(size - 2, 60):
        try:
            values = eigs(
                operator, wanted, v0=any_vector(whole), tol=1e-4, return_eigenvectors=False
            )
        except ArpackNoConvergence as failed:
            return np.asarray(failed.eigenvalues)
        if abs(values).min() < 1:
            break
        wanted *= 3
    return np.asarray(values)
