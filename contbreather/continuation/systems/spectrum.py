"""Eigenvalues of equilibria and multipliers of orbits: those that decide about a bifurcation.

Of a small derivative all eigenvalues are known (`Eigenvalues`), of a sparse one those next to the
imaginary axis (`NearAxis`); `eigenvalues` makes either, and what asks them does not know which.

Along the axis disks are laid, the first around zero, and the eigenvalues in each of them found by
shift and invert; up to some hundred unknowns it takes no longer to find all. How far up pairs can
be at all is known beforehand, by the skew part of the matrix (I. Bendixson, Acta Math. 25, 359,
1902): of one that is symmetric, in some units, there are none. Beyond the last disk nothing is
known, and `reach` says so.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from ..algebra.linear_algebra import least_singular
from ..algebra.newton import Array, Undefined
from ..algebra.sparse import (
    Factors,
    Matrix,
    any_vector,
    dense,
    factorised,
    is_sparse,
    plus_diagonal,
    scaled,
)
from ..curve.curve import TINY, Curve
from ..curve.point import Point

Values = NDArray[np.complex128]

# Eigenvalues, and sums of two, this small against the derivative are rounding: twice what is left
# by differences where they are zero all along, as in conservative systems, area preserving maps.
ROUNDING = 2e-13
FEW = 250  # rows up to which all eigenvalues at once take less time
OUTSIDE = 1 + 1e-9  # modulus of multipliers up to which rounding has them on the unit circle
_UNEVEN = 1e-3  # of its norm: a matrix that comes to less in other units is large by its own
_CIRCLE = 1e-4  # how far off the unit circle multipliers on it may be: a root splits double ones
_EXACT = 1e-12  # relative change of trace and determinant that ends the iteration for a pair


def counted(multipliers: Values) -> str:
    """Say how many multipliers are unstable, and how many are on the unit circle to within
    rounding, as at an event."""
    sizes = abs(multipliers)
    if np.isnan(sizes).any():
        return "multipliers unknown"
    on = np.count_nonzero(abs(sizes - 1) <= OUTSIDE - 1)
    count = f"{np.count_nonzero(sizes > OUTSIDE)} unstable"
    return f"{count}, {on} on the unit circle" if on else count


# --- test functions of eigenvalues --------------------------------------------------------------


def least_with_sign(factors: Values, rounding: Array | float) -> Any:
    """The size of the smallest factor, along the last axis, with the sign of the product of all: it
    vanishes where the product does, smoothly, and cannot overflow.

    A factor that is rounding, as it is all along the branches of conservative systems, is zero.
    Several of them have no size (1e-100), and the sign that the others have: a zero of even order.
    """
    sizes = abs(factors)
    clear = sizes > rounding
    if clear.all():
        return np.copysign(sizes.min(axis=-1), (factors / sizes).prod(axis=-1).real)
    zeros = (~clear).sum(axis=-1)
    least = np.where(zeros == 0, sizes.min(axis=-1), np.where(zeros == 1, 0.0, 1e-100))
    signs = np.where(clear, factors, 1.0) / np.where(clear, sizes, 1.0)
    return np.copysign(least, signs.prod(axis=-1).real)


def pairs(values: Values) -> tuple[Values, Values]:
    """The first and the second eigenvalues of all pairs of them."""
    first, second = _each_with_later(len(values))
    return values[first], values[second]


_each_with_later = cache(partial(np.triu_indices, k=1))


def right_of_axis(rounding: Any, first: Values, second: Values) -> NDArray[np.bool_]:
    return np.asarray((first + second).real > rounding)


def pairs_beyond(values: Values, beyond: Callable[[Values, Values], NDArray[np.bool_]]) -> Any:
    """Count pairs, along the last axis, that are beyond what is critical: complex ones, and as the
    imaginary part those of two real values. Each zero of their test changes one of both by one;
    where complex ones turn real they change by an even number together, and the test by none."""
    i, j = _each_with_later(values.shape[-1])
    first, second = values[..., i], values[..., j]
    of_real = beyond(first, second) & (first.imag == 0) & (second.imag == 0)
    complex_ones = beyond(values, values.conj()) & (values.imag > 0)
    return np.count_nonzero(complex_ones, axis=-1) + 1j * np.count_nonzero(of_real, axis=-1)


@dataclass(frozen=True, eq=False)
class CriticalValues:
    """Critical values of a linearisation: eigenvalues or multipliers, as far as they are known."""

    values: Values
    rounding: float  # may be left in each of them, or in what a pair is tested by

    def without(self, *everywhere: complex) -> Self:
        """The others, next to those that a curve has everywhere."""
        values = self.values
        for value in everywhere:
            values = np.delete(values, abs(values - value).argmin()) if values.size else values
        return replace(self, values=values)

    def factors(self) -> tuple[Values, Array | float]:
        """A number for each pair that vanishes where the pair is critical, and its rounding."""
        raise NotImplementedError

    def least_of_pairs(self) -> float:
        """The smallest of these numbers with the sign of the product of all."""
        factors, rounding = self.factors()
        if not (factors.size and np.isfinite(self.values).all()):  # as at VI
            return math.nan
        return float(least_with_sign(factors, rounding))

    def least_of_pairs_at(self, place: float) -> float:
        """Compute that of the pairs that the value nearest to a place makes with the others."""
        values = self.values[abs(self.values - place).argsort()]
        if not (values.size > 1 and np.isfinite(values).all()):
            return math.nan
        factors, rounding = replace(self, values=values).factors()
        each = slice(values.size - 1)  # the first pairs are those of the first value
        return float(least_with_sign(factors[each], np.broadcast_to(rounding, factors.shape)[each]))

    def least_beside(self, place: float) -> float:
        """The distance of the nearest from a place, with the sign of the product of all."""
        if not (self.values.size and np.isfinite(self.values).all()):
            return math.nan
        return float(least_with_sign(self.values - place, 0.0))

    def nearest_pair(self) -> Values:
        """The two values that are nearest to a critical pair."""
        first, second = pairs(self.values)
        least = int(abs(self.factors()[0]).argmin())
        return np.array([first[least], second[least]])


@dataclass(frozen=True, eq=False)
class Multipliers(CriticalValues):
    """Multipliers of an orbit but a trivial one; a pair is critical where its product is 1."""

    relative: float = 0.0  # what may be left in each of them, in its size

    def factors(self) -> tuple[Values, Array | float]:
        # mu_i mu_j are the eigenvalues of the bialternate product of the matrix with itself; an
        # error e in each moves a product by e (|mu_i| + |mu_j|), beside what it rounds itself
        first, second = pairs(self.values)
        product, left = first * second, self.rounding * (abs(first) + abs(second))
        return product - 1, (1e-12 + self.relative) * (1 + abs(product)) + left

    beside = _CIRCLE

    @property
    def unstable_pairs(self) -> complex:
        """Pairs outside the circle, by more than rounding."""
        known = self.values[np.isfinite(self.values)]
        return complex(pairs_beyond(known, lambda one, two: (one * two).real > OUTSIDE**2))

    @property
    def beyond_minus_one(self) -> int:
        """Count those outside the circle on that side, also pairs that two have become there."""
        return int(np.count_nonzero((abs(self.values) > OUTSIDE) & (self.values.real < 0)))

    @property
    def critical(self) -> Values:
        return self.values[abs(abs(self.values) - 1) < _CIRCLE]


@dataclass(frozen=True, eq=False)
class Eigenvalues(CriticalValues):
    """Eigenvalues of a flow, all of them; a pair is critical where its sum is 0."""

    matrix: Matrix
    split: float = 0.0  # imaginary parts up to here may be those of real ones that are double
    # frequency up to which all pairs next to the axis are among them; infinite where it is known
    # that there are no others
    reach: float = math.inf

    @cached_property
    def beside(self) -> float:
        """Bound how far apart rounding may split a double zero: it is of the size of the matrix,
        and splits by the root of that times what couples the two, which may be slow."""
        size = coupling = float(np.linalg.norm(self.matrix, 2))
        if self.values.size > 2:
            with suppress(Undefined):
                form, _ = _ordered(self.matrix, self.values, self.nearest_pair().prod().real)
                coupling = float(np.linalg.norm(form[:2, :2], 2))
        return 1e-6 * math.sqrt(size * coupling)

    @property
    def upper(self) -> Values:
        return self.values[self.values.imag > self.split]

    @property
    def critical(self) -> Values:
        return self.values[abs(self.values.real) < self.beside]

    @property
    def unstable_pairs(self) -> complex:
        """Pairs to the right of the axis by more than rounding."""
        right = partial(right_of_axis, self.rounding)
        return complex(pairs_beyond(self.values, right))

    def factors(self) -> tuple[Values, Array | float]:
        # the eigenvalues of the bialternate product of 2 F_x and 1, singular at Hopf points
        # (W. Govaerts, Numerical Methods for Bifurcations of Dynamical Equilibria, SIAM, 2000)
        first, second = pairs(self.values)
        return first + second, self.rounding

    def square_of_pair(self) -> float:
        """The squared frequency of the pair nearest the imaginary axis, or of a double zero."""
        zeros = self.values[abs(self.values) < self.beside]
        if zeros.size == 2:
            return float(np.prod(zeros).real)
        if not self.upper.size:
            raise Undefined("no complex pair of eigenvalues is there: a neutral saddle")
        return float(abs(self.upper[abs(self.upper.real).argmin()]) ** 2)

    def plane(self, square: float) -> InvariantPlane:
        """The plane of the two eigenvalues whose squares are closest to ``-square``."""
        from scipy.linalg.lapack import dtrsyl

        form, Q = _ordered(self.matrix, self.values, square)
        right = left = Q[:, :2]
        if len(form) > 2:  # A = Q T Q^T, and T11 Y - Y T22 = T12:  (1, Y) Q^T A = T11 (1, Y) Q^T
            Y, scale, _ = dtrsyl(form[:2, :2], form[2:, 2:], form[:2, 2:], isgn=-1)
            left = left + Q[:, 2:] @ Y.T / scale
        return InvariantPlane(right, left, form[:2, :2])


@dataclass(frozen=True, eq=False)
class NearAxis(Eigenvalues):
    """Eigenvalues of a sparse matrix next to the imaginary axis, both of each pair."""

    @property
    def beside(self) -> float:
        return 10.0 * self.split  # next to a place that was solved for

    @property
    def unstable_pairs(self) -> int:
        return int(np.count_nonzero(self.upper.real > self.rounding))

    def factors(self) -> tuple[Values, Array | float]:
        # complex pairs alone: of all others, and of those further to the left, some are not known
        return (-self.upper.real).astype(complex), self.rounding

    def nearest_pair(self) -> Values:
        if self.upper.size:
            nearest = self.upper[abs(self.upper.real).argmin()]
            return np.array([nearest, nearest.conjugate()])
        return self.values[abs(self.values).argsort()[:2]]

    def least_beside(self, place: float) -> float:
        # some real ones are not known: that of the matrix is asked for itself
        weak = least_singular(self.matrix)
        return weak.sign * weak.size

    def plane(self, square: float) -> InvariantPlane:
        """By subspace iteration with the inverse of ``A^2 + square``, through a system of twice the
        size whose entries are those of A: it is smooth where the pair meets at zero."""
        from scipy.sparse import block_array, eye_array

        A, n = self.matrix, self.matrix.shape[0]
        identity = eye_array(n, format="csc")
        # A v = u, A u + square v: its solutions are those of (A^2 + square) v
        factors = Factors(block_array([[A, -identity], [square * identity, A]], format="csc"))
        right = _iterated(
            lambda x: factors.solve(np.append(0 * x, x), refined=False)[:n], A, square
        )
        left = _iterated(lambda x: factors.transposed(np.append(x, 0 * x))[n:], A.T, square)
        left = np.asarray(np.linalg.solve(left.T @ right, left.T).T)  # now left^T right = 1
        return InvariantPlane(right, left, left.T @ (A @ right))


def flow(curve: Curve, z: Array) -> Matrix:
    """The derivative between unknowns in their scales, which keeps the eigenvalues."""
    scales = curve.scales[: curve.size]
    return scaled(curve.jacobian(z)[:, : curve.size], 1 / scales, scales)


def in_sizes(curve: Curve, rows: Array, matrices: Array) -> tuple[Array, Array]:
    """Dense derivatives at several z between unknowns in their scales, or in their sizes where
    nothing but units makes them large; and the units of each."""
    scales = curve.scales[: curve.size]
    units = np.ones((len(rows), curve.size))
    for slot in curve.problem.slots.values():
        sizes = abs(rows[:, slot] / curve.scales[slot]).reshape(len(rows), -1).max(axis=1)
        powers = 2.0 ** np.round(np.log2(np.where(sizes > TINY, sizes, 1.0)))
        units[:, slot] = powers.reshape(-1, *[1] * (units[:, slot].ndim - 1))
    flows = matrices[:, :, : curve.size] / scales[:, None] * scales
    others = flows / units[:, :, None] * units[:, None, :]
    large = np.linalg.norm(others, axis=(1, 2)) < _UNEVEN * np.linalg.norm(flows, axis=(1, 2))
    flows[large], units[~large] = others[large], 1.0
    return flows, units * scales


def in_sizes_at(curve: Curve, z: Array) -> tuple[Array, Array]:
    matrices, units = in_sizes(curve, z[None], dense(curve.jacobian(z))[None])
    return matrices[0], units[0]


def all_eigenvalues(curve: Curve, z: Array) -> Eigenvalues:
    """The eigenvalues of the derivative in the unknowns."""
    matrix, _ = in_sizes_at(curve, z)
    return Eigenvalues(curve.spectrum(z), ROUNDING * float(np.linalg.norm(matrix)), matrix)


def eigenvalues(curve: Curve, z: Array) -> Eigenvalues:
    """The eigenvalues of the derivative in the unknowns, of a sparse one those next to the axis."""

    def make(z: Array) -> Eigenvalues:
        sparse = is_sparse(curve.jacobian(z))
        return _near(flow(curve, z)) if sparse else all_eigenvalues(curve, z)

    return curve.cached("eigenvalues", z, make)


def eigenvalues_at(point: Point) -> Eigenvalues:
    """Eigenvalues for the original problem, at a point of a boundary too."""
    return eigenvalues(point.base_point.curve, point.base_point.z)


# --- of a sparse matrix -------------------------------------------------------------------------


def _near(matrix: Matrix) -> NearAxis:
    norm = float(abs(matrix).sum(axis=0).max())
    # |Im lambda| <= |A - A^T|_2 / 2, and that no more than its 1-norm, being skew
    skew = [abs(of - of.T).sum(axis=0).max() for of in (matrix, _symmetrised(matrix))]
    highest = float(np.fmin(*skew)) / 2  # NaN where units overflow
    # a perturbation e moves a double eigenvalue by its root: it may split into a pair so far apart
    split = 4.0 * math.sqrt(np.finfo(float).eps * norm)
    values, reach = np.empty(0, dtype=complex), 0.0
    for _ in range(4):
        if reach >= highest - split:
            reach = math.inf
            break
        if matrix.shape[0] <= FEW:
            values, reach = np.linalg.eigvals(matrix.toarray()).astype(complex), math.inf
            break
        inside, radius = _disk(matrix, reach)
        apart = abs(inside[:, None] - values).min(axis=1, initial=math.inf)
        fresh = inside[apart > split]
        values = np.concatenate([values, fresh, fresh[fresh.imag > split].conj()])
        reach += radius
    return NearAxis(values, split**2, matrix, split, reach)


@np.errstate(over="ignore", invalid="ignore")
def _symmetrised(matrix: Matrix) -> Matrix:
    """Take unknowns in other units, in which it is symmetric if in any: a diffusion on an uneven
    mesh is, or with a flux at its ends, or around an axis."""
    from scipy.sparse.csgraph import breadth_first_order

    rows, before = breadth_first_order(matrix, 0, directed=False)
    columns = np.maximum(before, 0)[rows]  # the first has none before it but itself
    there, back = abs(matrix[rows, columns]), abs(matrix[columns, rows])
    both = (there > 0) & (back > 0)
    # a_ij u_j / u_i = a_ji u_i / u_j, along a tree through its pattern
    ratios = np.log(np.where(both, there, 1.0) / np.where(both, back, 1.0)) / 2
    logs = np.zeros(matrix.shape[0])
    for i, j, ratio in zip(rows.tolist(), columns.tolist(), ratios.tolist(), strict=True):
        logs[i] = logs[j] + ratio
    logs -= logs.mean()
    return scaled(matrix, np.exp(-logs), np.exp(logs))


def _disk(matrix: Matrix, height: float) -> tuple[Any, float]:
    """The eigenvalues around a place of the upper half of the axis, and how far they reach."""
    from scipy.sparse.linalg import ArpackError, LinearOperator, eigs

    n, shift = matrix.shape[0], 1j * height if height else 0.0
    for _ in range(3):
        moved = plus_diagonal(matrix, -shift) if shift else matrix
        try:
            lu = factorised(moved)
        except RuntimeError:  # an eigenvalue is there to the last digit
            lu = factorised(plus_diagonal(moved, _EXACT * abs(matrix).max()))
        operator = LinearOperator((n, n), matvec=lu.solve, dtype=moved.dtype)
        try:
            inverse = eigs(
                operator, min(12, n - 2), v0=any_vector(n), tol=1e-10, return_eigenvectors=False
            )
        except ArpackError as error:
            raise Undefined(f"no eigenvalues were found next to {height:.3g}i: {error}") from error
        sizes = abs(inverse)
        if sizes.max() <= 1e8 * sizes.min():
            break
        # so close to one of them the others are lost in the rounding of its inverse
        shift += 1e-4 / sizes.min()
    values = 1 / inverse + shift  # those of (A - shift)^-1, the largest first
    radius = float(abs(values - 1j * height).max())
    return values[values.imag >= 0], radius


# --- the pair that crosses the axis --------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class InvariantPlane:
    """The plane that belongs to two eigenvalues."""

    right: Array  # vectors that span it
    left: Array  # those of the transposed matrix, with ``left.T right = 1``
    within: Array  # the matrix within it


def _iterated(apply: Callable[[Array], Array], matrix: Matrix, square: float) -> Array:
    """Orthonormal vectors of the plane, out of a few more that grow together with them."""
    n = matrix.shape[0]
    starts = [np.roll(any_vector(n), k * n // 6) for k in range(min(6, n))]
    noise = 4 * np.finfo(float).eps * float(abs(matrix).sum(axis=0).max())
    # trace and determinant do not depend on the basis of the plane, as its vectors do
    before = np.full(2, math.inf)
    for _ in range(40):  # close to a Hopf point two are enough
        x = np.asarray(np.linalg.qr(np.stack([apply(v) for v in starts], axis=1))[0])
        # Rayleigh-Ritz: A within the space of all vectors, and of that the plane wanted
        small = x.T @ (matrix @ x)
        form, vectors = _ordered(small, np.linalg.eigvals(small), square)
        block, turned = form[:2, :2], vectors[:, :2]
        now, size = np.array([np.trace(block), np.linalg.det(block)]), float(np.linalg.norm(block))
        if (abs(now - before) <= (_EXACT * size + noise) * np.array([1.0, size])).all():
            return x @ turned
        before, starts = now, [*x.T]
    raise Undefined("no pair of eigenvalues stands out next to the imaginary axis")


def _ordered(matrix: Array, values: Values, square: float) -> tuple[Array, Array]:
    """Schur form and vectors, first the two whose squares are closest to ``-square``."""
    from scipy.linalg import schur

    if matrix.shape[0] < 3:
        return matrix, np.eye(2)
    off = np.sort(abs(values**2 + square))
    bound = 0.5 * float(off[1] + off[2])
    if not math.isfinite(bound):  # an iteration that goes astray: squares of Python raise in LAPACK
        raise Undefined("eigenvalues are too large to be squared")
    form, vectors, count = schur(
        matrix, sort=lambda re, im: abs(complex(re, im) ** 2 + square) <= bound
    )
    if count != 2:
        raise Undefined("three eigenvalues are equally close to the imaginary axis")
    return form, vectors


def _plane(curve: Curve, z: Array, square: float) -> InvariantPlane:
    planes: dict[float, InvariantPlane] = curve.cached("planes", z, lambda z: {})
    if square not in planes:
        planes[square] = eigenvalues(curve, z).plane(square)
    return planes[square]


def plane_conditions(curve: Curve, z: Array, extra: Array) -> Array:
    square = float(extra[0])
    within = _plane(curve, z, square).within
    return np.array([np.trace(within), np.linalg.det(within) - square])


def plane_slopes(curve: Curve, z: Array, extra: Array) -> Array:
    plane, scales = _plane(curve, z, float(extra[0])), curve.scales[: curve.size]
    if not is_sparse(curve.jacobian(z)):
        _, scales = in_sizes_at(curve, z)
    # left.T A' right, with the derivative of the Jacobian along each vector of the plane
    changes = [curve.along(z, vector * scales) for vector in plane.right.T]
    left = (plane.left / scales[:, None]).T
    (d11, d12), (d21, d22) = zip(*(left @ change for change in changes), strict=True)
    (a, b), (c, d) = plane.within
    # trace' = d11 + d22, det' = d d11 - c d12 - b d21 + a d22 of the matrix ((a, b), (c, d))
    rows = np.stack([d11 + d22, d * d11 + a * d22 - b * d21 - c * d12])
    return np.hstack([rows, [[0.0], [-1.0]]])
