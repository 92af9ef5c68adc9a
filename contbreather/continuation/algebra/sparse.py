"""Large problems: derivatives with few entries in each row, as `scipy.sparse` keeps them.

All that is asked of such a derivative are solutions of linear systems, and one factorisation
answers them all: with one condition or another below, transposed, with the sign of its determinant.
So does that of an array with many rows, whose singular values would take 40 times as long.
scipy.sparse is imported where a problem turns out to be sparse, not before.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cache, cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import ContbreatherError

Array = NDArray[np.float64]
Matrix = Any  # an array, or a scipy.sparse.csc_array

_PIVOT = 0.1  # an entry of the diagonal this large, relative to its column, is taken as a pivot
TURNS = 4  # steps of inverse iteration next to a null vector


class Undefined(ContbreatherError, ArithmeticError):
    """The equations have no value here: a NaN, an overflow, or beyond the edge of their domain."""


# --- dense matrices ---------------------------------------------------------------------------


@cache
def _lapack() -> Any:
    from scipy.linalg import lapack  # dear to import: looking at a breather needs none

    return lapack


class Dense:
    """A dense derivative with a row below, unless that is None, factorised."""

    def __init__(self, matrix: Array, row: Array | None = None) -> None:
        self.row, self.whole = row, matrix
        if row is not None:
            self.whole = np.empty((row.size, row.size))
            self.whole[:-1], self.whole[-1] = matrix, row
        self._factors, self._pivots, info = _lapack().dgetrf(self.whole)
        self.exact = info == 0

    def solve(self, right: Array, last: float = 0.0) -> Array | None:
        """The solution, `last` being the right side of the row; None where it is singular."""
        if not self.exact:
            return None
        if self.row is not None:
            above, right = right, np.empty(self.row.size)
            right[:-1], right[-1] = above, last
        return np.asarray(_lapack().dgetrs(self._factors, self._pivots, right)[0])

    def correction(self, right: Array, row: Array | None = None) -> tuple[Array, bool]:
        """The solution whose product with the row is 0, and whether there is none: then it is the
        shortest of what comes closest."""
        if (step := self.solve(right)) is not None:
            return step, False
        return shortest(self.whole, right if self.row is None else np.append(right, 0.0)), True

    def least(self, right: Array) -> Array:
        return self.correction(right)[0]

    @property
    def vanishes(self) -> bool:
        """Tell whether a pivot has lost all its digits, and those of its rounding, by cancelling:
        what is solved with it knows one null vector where there are two."""
        sizes = abs(self._factors.diagonal())
        return bool(sizes.min() < np.finfo(float).eps ** 2 * sizes.max())

    @property
    def weight(self) -> float:
        """The logarithm of the size of the determinant, of rows of length 1."""
        if not self.exact:
            return -math.inf
        squares = np.add.reduce(self.whole * self.whole, axis=1)
        return float(np.add.reduce(np.log(abs(self._factors.diagonal())) - np.log(squares) / 2))

    def tangent(self, row: Array) -> tuple[Array | None, int]:
        """The null vector whose product with the row is 1, and the sign of the determinant."""
        return self.solve(np.zeros(row.size - 1), 1.0), self.sign()

    def transposed(self, right: Array) -> Array:
        return np.asarray(_lapack().dgetrs(self._factors, self._pivots, right, trans=1)[0])

    def sign(self) -> int:
        """Sign of the determinant; 0 where the matrix is singular."""
        if not self.exact:
            return 0
        # P A = L U, L with ones on its diagonal: det A = det U / det P
        turned = self._pivots != np.arange(self._pivots.size)
        return -1 if np.logical_xor.reduce(turned ^ (self._factors.diagonal() < 0)) else 1


def shortest(matrix: Array, right: Array, rows: Array | None = None) -> Array:
    """The shortest vector that comes closest to a solution, in units of rows: what is rounding
    beside the largest of them is taken for zero."""
    if rows is not None:
        matrix, right = matrix / rows[:, None], right / rows
    return np.asarray(np.linalg.lstsq(checked_finite(matrix), right)[0])


def checked_finite(matrix: Matrix) -> Matrix:
    """A derivative, dense or sparse, refused where an entry is none."""
    if not math.isfinite(matrix.sum()):
        raise Undefined("the derivatives are not finite")
    return matrix


# --- large ones -------------------------------------------------------------------------------


def is_sparse(matrix: object) -> bool:
    """Tell whether a matrix, or what was given for one, comes from scipy.sparse."""
    return hasattr(matrix, "tocsc")


def dense(matrix: Matrix) -> Array:
    """Make an array of a matrix, dense or sparse."""
    array: Array = matrix.toarray() if is_sparse(matrix) else matrix
    return array


def is_large(matrix: Matrix) -> bool:
    """Tell a matrix that is only solved with: a sparse one, or one of many rows."""
    return hasattr(matrix, "tocsc") or len(matrix) >= 120  # from there on that takes less time


def canonical(entries: Any) -> Matrix:
    """A sparse matrix of any format as columns of floats without duplicates: a copy."""
    from scipy.sparse import csc_array

    matrix = csc_array(entries, dtype=float, copy=True)
    matrix.sum_duplicates()
    return matrix


def beside(matrix: Matrix, columns: Matrix) -> Matrix:
    """A matrix, dense or sparse, with a few columns to its right."""
    if not is_sparse(matrix):
        return np.hstack([matrix, columns])
    from scipy.sparse import csc_array

    columns = dense(columns)
    n, width = columns.shape
    rows = np.tile(np.arange(n, dtype=matrix.indices.dtype), width)
    ends = matrix.indptr[-1] + n * np.arange(1, width + 1, dtype=matrix.indptr.dtype)
    data = np.concatenate([matrix.data, columns.ravel(order="F")])
    parts = (data, np.concatenate([matrix.indices, rows]), np.concatenate([matrix.indptr, ends]))
    return csc_array(parts, shape=(n, matrix.shape[1] + width))


def above(matrix: Matrix, rows: Any) -> Matrix:
    """A matrix with a few rows below, both dense or sparse."""
    if not is_sparse(matrix):
        return np.vstack([matrix, rows])
    from scipy.sparse import csc_array, vstack

    return vstack([matrix, csc_array(rows)], format="csc")


def first_columns(matrix: Matrix, n: int) -> Matrix:
    """The first n columns of a matrix, dense or sparse; what they hold is not to be written to."""
    if not is_sparse(matrix):
        return matrix[:, :n]
    from scipy.sparse import csc_array

    end = matrix.indptr[n]
    parts = (matrix.data[:end], matrix.indices[:end], matrix.indptr[: n + 1])
    return eliminated_as(csc_array(parts, shape=(matrix.shape[0], n)), matrix)


def entry_columns(matrix: Matrix) -> NDArray[np.intp]:
    return np.repeat(np.arange(matrix.shape[1]), np.diff(matrix.indptr))


def scaled(matrix: Matrix, rows: Array, columns: Array | None = None) -> Matrix:
    """A matrix, dense or sparse, with each row, and each column, multiplied by a number."""
    if not is_sparse(matrix):
        return (matrix if columns is None else matrix * columns) * rows[:, None]
    data = matrix.data * rows[matrix.indices]
    return _with(matrix, data if columns is None else data * columns[entry_columns(matrix)])


def row_sizes(matrix: Matrix, scales: Array) -> Array:
    """Largest entry of each row, each column in its scale; of a dense or a sparse matrix."""
    if not is_sparse(matrix):
        return np.asarray(abs(matrix * scales[: matrix.shape[-1]]).max(axis=-1))
    sizes = np.zeros(matrix.shape[0])
    entries = abs(matrix.data) * scales[entry_columns(matrix)]
    np.maximum.at(sizes, matrix.indices, entries)
    return sizes


def _with(matrix: Matrix, data: Array) -> Matrix:
    from scipy.sparse import csc_array

    parts = data, matrix.indices, matrix.indptr
    return eliminated_as(csc_array(parts, shape=matrix.shape), matrix)


def eliminated_as(matrix: Matrix, of: Matrix, more: Sequence[int] = ()) -> Matrix:
    """Have a matrix factorised in the order that suits another one, and some unknowns more after
    these, if that has an order."""
    if (order := getattr(of, "elimination", None)) is not None:
        matrix.elimination = np.append(order, more).astype(np.intp)
    return matrix


class Factors:
    """A large matrix of n rows and n + k columns, factorised so as to solve all it is asked for.

    What is factorised are n of its columns, which leaves them as sparse as they are. The others
    give the null vectors, and with these follow the solutions for any k rows below: no system is
    solved through another that is closer to being singular. Which unknowns are set apart is chosen
    by the null vectors themselves: the last ones, unless others move much more, as beside a fold.
    `null`, of shape (n + k, k), is an identity matrix in the unknowns that are set apart.
    """

    null: Array
    exact: bool

    def __init__(self, matrix: Matrix) -> None:
        self.matrix = checked_finite(matrix)
        # A = (L, R), L square, with conditions C below: x = (L^-1 b, 0) solves A x = b, the null
        # vectors are N = (-L^-1 R, 1), x + N (C N)^-1 (c - C x) meets C x = c, and
        # det [A; C] = det L det(C N)
        n, width = matrix.shape
        sizes = row_sizes(matrix, np.ones(width))
        # equations of one size, so that pivots are chosen by entries and not by units
        self._rows = 1 / np.where(sizes > 0, sizes, 1.0)
        self._factorise(np.arange(width))
        for _ in range(width - n):
            moves = abs(self.null)
            if self.exact and not moves.max() > 1e3:
                break
            # an unknown that moves so much with one of the last is set apart in its place; one at a
            # time, for beside what a singular L moves all else in null vectors is rounding
            most, last = np.unravel_index(moves.argmax(), moves.shape)
            apart = np.sort(np.append(np.delete(self._apart, last), most))
            self._factorise(np.concatenate([np.setdiff1d(np.arange(width), apart), apart]))

    def _factorise(self, order: NDArray[Any]) -> None:
        """Take the first n columns of an order; `exact` says whether that is possible, or only
        beside them, as they are singular."""
        n, width = self.matrix.shape
        self._order, self._inside, self._apart = order, order[:n], order[n:]
        self._in_order = bool((order[:n] == np.arange(n)).all())
        core = first_columns(self.matrix, n) if self._in_order else self.matrix[:, self._inside]
        core = scaled(core, self._rows)
        kind: Any = _Sparse if is_sparse(core) else Dense
        self._lu = kind(core)
        self.exact = self._lu.exact and not self._lu.vanishes
        if not self.exact:  # a pivot that is zero
            self._lu = kind(_shifted(core))
        self.null = np.zeros((width, width - n))
        for i, column in enumerate(order[n:]):
            self.null[column, i] = 1.0
            self.null[self._inside, i] = -self._inner(_column(self.matrix, column))

    def _inner(self, right: Array) -> Array:
        inner: Array = self._lu.solve(right * self._rows)
        return inner

    def solve(self, right: Array, rows: Array | None = None, *, refined: bool = True) -> Array:
        """The solution of the equations and of as many conditions as unknowns are left: `right`
        first for the matrix, then for `rows`. Without rows some solution."""
        n = self.matrix.shape[0]
        x = self._particular(right[:n])
        if refined and is_sparse(self.matrix):
            # refined once: the pivots of sparse factors need not be the largest, see _PIVOT
            x += self._particular(right[:n] - self.matrix @ x)
        if rows is None or not len(rows):
            return x
        return np.asarray(x + self.null @ _small(rows @ self.null, right[n:] - rows @ x))

    def _particular(self, right: Array) -> Array:
        x = np.zeros(self.matrix.shape[1])
        x[self._inside] = self._inner(right)
        return np.asarray(x - self.null @ x[self._apart])

    def transposed(self, right: Array, rows: Array | None = None) -> Array:
        """As `solve`, for the transpose of the matrix with `rows` below. Without rows, the right
        side must be orthogonal to the null vectors."""
        weights = np.empty(0)
        if rows is not None and len(rows):
            # A^T y + C^T w = b, and A N = 0: (C N)^T w = N^T b
            weights = _small((rows @ self.null).T, self.null.T @ right)
            right = right - weights @ rows
        right = right.copy()
        right[self._apart] -= self.null.T @ right  # orthogonal to the last digit
        return np.append(self._lu.transposed(right[self._inside]) * self._rows, weights)

    def correction(self, right: Array, row: Array | None) -> tuple[Array, bool]:
        """As that of `Dense`; where there is none, one that nearly solves it and is short."""
        below = None if row is None else row[None, :]
        if self.exact:
            return self.solve(right if row is None else np.append(right, 0.0), below), False
        n, width = self.matrix.shape
        # | A    a |  regular for almost any a and b where A has lost one rank: a is not in its
        # | b^T  0 |  range, and b with the row tells its null vectors apart
        # | row  0 |
        wider = Factors(beside(self.matrix, any_vector(n)[:, None]))
        rows = np.zeros((width + 1 - n, width + 1))
        rows[0, :width] = any_vector(width)
        if row is not None:
            rows[1, :width] = row
        padded = np.concatenate([right, np.zeros(len(rows))])
        return wider.solve(padded, rows)[:width], True

    weight = math.nan  # a product of pivots that nobody looks at

    def tangent(self, row: Array) -> tuple[Array | None, int]:
        # J has one null vector N: det [J; row] has the sign of det L . (row N)
        side, null = self.sign(row[None, :]), self.null[:, 0]
        return math.copysign(1.0, row @ null) * null if side else None, side

    def least(self, right: Array, *, refined: bool = True) -> Array:
        """The shortest of all solutions."""
        # less its part in the null space
        x = self.solve(right, refined=refined)
        return np.asarray(x - self.basis @ (self.basis.T @ x))

    @cached_property
    def basis(self) -> Array:  # orthonormal null vectors
        return np.asarray(np.linalg.qr(self.null)[0])

    @cached_property
    def _own_sign(self) -> int:
        turned = not self._in_order and _odd(self._order)
        return -self._lu.sign() if turned else self._lu.sign()

    def sign(self, rows: Array | None = None) -> int:
        """Sign of the determinant of the matrix with `rows` below; 0 where it is singular."""
        if not self.exact:
            return 0
        if rows is None or not len(rows):
            return self._own_sign
        small = rows @ self.null
        determinant = small[0, 0] if small.size == 1 else np.linalg.det(small)
        return self._own_sign * int(np.sign(determinant))


class _Sparse:
    """The factors of a square sparse matrix, as `Dense` of an array."""

    vanishes = False  # to look at its pivots takes a copy of the factors

    def __init__(self, matrix: Matrix) -> None:
        self.exact = True
        try:
            self._lu = factorised(matrix)
        except RuntimeError:
            self.exact = False

    def solve(self, right: Array) -> Array:
        return np.asarray(self._lu.solve(right))

    def transposed(self, right: Array) -> Array:
        return np.asarray(self._lu.solve(right, "T"))

    def sign(self) -> int:
        lu, turns = self._lu, 0
        # P_r A P_c = L U with ones on the diagonal of L
        if (lu.perm_r != lu.perm_c).any():
            turns = _odd(lu.perm_r) + _odd(lu.perm_c)
        return -1 if (np.count_nonzero(lu.U.diagonal() < 0) + turns) % 2 else 1


def factorised(matrix: Matrix) -> Any:
    """The factors of a square sparse matrix, `scipy.sparse.linalg.SuperLU`, in an order that those
    who made it know to suit it, or else in one that is found.

    A narrow band is taken as it is. Elsewhere, where the diagonal leads in every column and no
    row or column is long, pivots are taken from it, in the order that suits a symmetric pattern:
    two thirds of the time for a square. A few rows that are long come last.

    Raises `RuntimeError` where a pivot is exactly zero.
    """
    from scipy.sparse.linalg import splu

    counts = np.bincount(matrix.indices, minlength=matrix.shape[0])
    long = np.flatnonzero(counts > max(64, math.sqrt(counts.size)))
    if (elimination := getattr(matrix, "elimination", None)) is not None:
        return _InOrder(matrix, long, elimination, elimination)
    if 0 < long.size < 0.02 * counts.size:
        key = matrix.indptr.tobytes(), matrix.indices.tobytes(), matrix.indices.dtype.str
        columns = _order_without(long.tobytes(), *key)
        return _InOrder(matrix, long, columns, np.arange(columns.size))
    order: Any = "COLAMD"
    # else the largest of its column: small ones would grow along an orbit as perturbations of it
    least = 1.0
    counts, most = np.diff(matrix.indptr), max(16, 10 * math.sqrt(matrix.shape[0]))
    if abs(matrix.indices - entry_columns(matrix)).max(initial=0) <= 8:
        order = "NATURAL"
    elif counts.all() and max(counts.max(), np.bincount(matrix.indices).max()) <= most:
        largest = np.maximum.reduceat(abs(matrix.data), matrix.indptr[:-1])
        if (abs(matrix.diagonal()) >= _PIVOT * largest).all():
            order, least = "MMD_AT_PLUS_A", _PIVOT
    return splu(matrix, permc_spec=order, diag_pivot_thresh=least)


class _InOrder:
    """The factors of a sparse matrix with columns and rows in an order. A few rows that are long,
    as of conditions on all unknowns, are scaled down, so that pivots are taken from them where
    there are no others."""

    def __init__(
        self, matrix: Matrix, long: NDArray[np.intp],
        columns: NDArray[np.intp], rows: NDArray[np.intp],
    ) -> None:  # fmt: skip
        from scipy.sparse.linalg import splu

        self._columns, self._rows, self._sizes = columns, rows, np.ones(matrix.shape[0])
        self._sizes[long] = 1e-6
        ordered = scaled(matrix, self._sizes)[:, columns][rows]
        self._lu: Any = splu(ordered, permc_spec="NATURAL")
        # P_r A[rows, columns] P_c = L U
        self.perm_r = self._lu.perm_r[np.argsort(rows)]
        self.perm_c = columns[self._lu.perm_c]

    def solve(self, right: NDArray[Any], trans: str = "N") -> NDArray[Any]:
        sizes = self._sizes.reshape(-1, *[1] * (right.ndim - 1))
        x = np.empty_like(right)
        if trans == "N":
            x[self._columns] = self._lu.solve((sizes * right)[self._rows])
            return np.asarray(x)
        x[self._rows] = self._lu.solve(right[self._columns], trans)
        return np.asarray(sizes * x)

    @property
    def U(self) -> Any:
        return self._lu.U


def cut_in_two(
    graph: Any, part: NDArray[np.intp]
) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
    """Split some nodes of a graph into two parts without an edge between them, and those between:
    the nodes half way from one that is farthest from another."""
    from scipy.sparse.csgraph import shortest_path

    inner, end = graph[part][:, part], 0
    for _ in range(2):
        far = shortest_path(inner, unweighted=True, indices=end)
        if not np.isfinite(far).all():
            far = np.where(np.isfinite(far), -1.0, 1.0)
            break
        end = int(far.argmax())
    middle = 0.0 if far.min() < 0 else np.median(far) // 1
    return part[far < middle], part[far > middle], part[far == middle]


@lru_cache(maxsize=8)
def _order_without(long: bytes, indptr: bytes, indices: bytes, kind: str) -> NDArray[np.intp]:
    """Order the columns of a pattern that a few rows are left out of."""
    from scipy.sparse import csc_array
    from scipy.sparse.linalg import spilu

    ends, rows = np.frombuffer(indptr, kind), np.frombuffer(indices, kind)
    n = ends.size - 1
    columns, short = np.repeat(np.arange(n), np.diff(ends)), np.ones(n, dtype=bool)
    short[np.frombuffer(long, np.intp)] = False
    kept, diagonal = short[rows], np.arange(n)
    # only the order is asked for: what is eliminated is dropped
    entries = np.append(np.ones(np.count_nonzero(kept)), np.full(n, 2.0 * n))
    places = np.append(rows[kept], diagonal), np.append(columns[kept], diagonal)
    pattern = csc_array((entries, places), (n, n))
    factors = spilu(pattern, drop_tol=1.0, fill_factor=1, permc_spec="COLAMD")
    return np.argsort(factors.perm_c)


def _column(matrix: Matrix, number: int) -> Array:
    if not is_sparse(matrix):
        return np.asarray(matrix[:, number])
    column, entries = np.zeros(matrix.shape[0]), slice(*matrix.indptr[number : number + 2])
    column[matrix.indices[entries]] = matrix.data[entries]
    return column


def _small(matrix: Array, right: Array) -> Array:
    return np.asarray(right / matrix[0] if right.size == 1 else np.linalg.solve(matrix, right))


def _shifted(matrix: Matrix) -> Matrix:
    """A matrix moved off a singular one by as much as rounding might."""
    return plus_diagonal(matrix, 1e-14 * (1.5 + np.cos(np.arange(matrix.shape[0]))))


def _odd(permutation: NDArray[np.intp]) -> bool:
    """Tell whether a permutation changes the sign of a determinant."""
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import connected_components

    n = permutation.size
    # a permutation of n with c cycles is a product of n - c interchanges
    links: Any = csr_array((np.ones(n), permutation, np.arange(n + 1)), shape=(n, n))
    cycles, _ = connected_components(links, directed=False)
    return bool((n - cycles) % 2)


@cache
def any_vector(n: int) -> Array:
    """A unit vector that no symmetry of the equations knows; not to be written to."""
    vector = np.cos(1.0 + np.arange(n) ** 1.5)
    vector /= math.sqrt(float(vector @ vector))
    vector.flags.writeable = False
    return vector


def plus_diagonal(matrix: Matrix, values: Any) -> Matrix:
    """A square matrix, dense or sparse, with a number, or a row of them, added to its diagonal."""
    if not is_sparse(matrix):
        return matrix + values * np.eye(len(matrix))
    from scipy.sparse import diags_array

    return (matrix + diags_array(np.full(matrix.shape[0], values))).tocsc()


def null_vectors(matrix: Matrix) -> tuple[NDArray[Any], NDArray[Any]]:
    """Unit null vectors (q, p) of a matrix of many rows, most entries 0, that has one: ``M q = 0``,
    ``conj(p) M = 0``."""
    from scipy.sparse import csc_array

    matrix = csc_array(matrix)
    try:
        lu = factorised(matrix)
    except RuntimeError:
        lu = factorised(_shifted(matrix))
    p = any_vector(matrix.shape[0]).astype(matrix.dtype)
    for _ in range(TURNS):
        # inverse iteration by M* M: M alone has lost q after two solves where conj(p) q = 0, as of
        # a double eigenvalue with one eigenvector
        q = lu.solve(p)
        q = q / np.linalg.norm(q)
        p = lu.solve(q, "H")
        p = p / np.linalg.norm(p)
    return q, p


# --- derivatives where their pattern is known ---------------------------------------------------


class Pattern:
    """Which unknowns each equation contains, and the fewest steps that show all derivatives.

    Unknowns that share no equation share a step (A. R. Curtis, M. J. D. Powell and J. K. Reid,
    J. Inst. Maths Applics 13, 117, 1974).
    """

    def __init__(self, pattern: Any) -> None:
        matrix = canonical(pattern)
        self.matrix = matrix = _with(matrix, np.ones(matrix.nnz))  # what was given stays as it is
        self.columns = entry_columns(matrix)

    @cached_property
    def colours(self) -> NDArray[np.intp]:
        """A number for each unknown, different for any two that share an equation."""
        shared = (self.matrix.T @ self.matrix).tocsr()
        colours = np.full(self.matrix.shape[1], -1)
        for j in range(colours.size):
            # greedily: the first colour that no neighbour has
            taken = {*colours[shared.indices[shared.indptr[j] : shared.indptr[j + 1]]].tolist()}
            colours[j] = next(c for c in range(len(taken) + 1) if c not in taken)
        return colours

    def derivative(self, slope: Callable[[Array], Array], steps: Array) -> Matrix:
        """The derivative, by ``slope(direction)`` for each colour; unknowns move by their steps."""
        data = np.empty(self.columns.size)
        colours = self.colours[self.columns]
        for colour in range(self.colours.max() + 1):
            changes = slope(np.where(self.colours == colour, steps, 0.0))
            entries = colours == colour
            data[entries] = changes[self.matrix.indices[entries]] / steps[self.columns[entries]]
        return _with(self.matrix, data)
