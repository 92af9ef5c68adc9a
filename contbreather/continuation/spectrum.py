"""Eigenvalues of large derivatives: a few of them, next to the imaginary axis.

Disks are laid along the axis, the first around zero, and the eigenvalues in each of them found by
shift and invert; up to some hundred unknowns it takes no longer to find all. How far up pairs can
be at all is known beforehand, by the skew part of the matrix (I. Bendixson, Acta Math. 25, 359,
1902): of a symmetric one there are none. Beyond the last disk nothing is known, and
`NearestEigenvalues.reach` says so.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .curve import Curve
from .newton import Undefined
from .point import DefiningSystem
from .sparse import Factors, Matrix, any_vector, factorised, plus_diagonal, scaled

Array = NDArray[np.float64]
Values = NDArray[np.complex128]

FEW = 250  # rows up to which all eigenvalues at once take less time
_IN_A_DISK = 12  # eigenvalues that are looked for around one place of the axis
_DISKS = 4
_SPLIT = 4.0  # a real double eigenvalue may split into a pair this many times the rounding apart
_DOUBLE = 10.0  # and where it is next to a place that was solved for
_TOGETHER = 6  # vectors that are iterated for the two of a pair
_TURNS = 40  # steps of iteration; close to a Hopf point two are enough
_EXACT = 1e-12  # relative change of trace and determinant that ends it


@dataclass(frozen=True, eq=False)
class NearestEigenvalues:
    """What is known of the eigenvalues next to the imaginary axis.

    Attributes
    ----------
    values : ndarray of complex
        Those found, both of each pair.
    reach : float
        Frequency up to which all pairs next to the axis are among them; infinite where it is known
        that there are no others.
    rounding : float
        Imaginary parts up to here may be those of real eigenvalues that are double.
    """

    values: Values
    reach: float
    rounding: float

    @property
    def pairs(self) -> Values:
        """The upper ones of the complex pairs."""
        return self.values[self.values.imag > self.rounding]


def near_axis(curve: Curve, z: Array) -> NearestEigenvalues:
    """The eigenvalues of a sparse derivative in the unknowns next to the imaginary axis."""
    nearest: NearestEigenvalues = curve.cached("near axis", z, lambda z: _near(flow(curve, z)))
    return nearest


def flow(curve: Curve, z: Array) -> Matrix:
    """The derivative between unknowns in their scales, which keeps the eigenvalues."""
    scales = curve.scales[: curve.size]
    return scaled(curve.jacobian(z)[:, : curve.size], 1 / scales, scales)


def _near(matrix: Matrix) -> NearestEigenvalues:
    norm = float(abs(matrix).sum(axis=0).max())
    # |Im lambda| <= |A - A^T|_2 / 2, and that no more than its 1-norm, being skew
    highest = float(abs(matrix - matrix.T).sum(axis=0).max()) / 2
    # a perturbation e moves a double eigenvalue by its root
    rounding = _SPLIT * math.sqrt(np.finfo(float).eps * norm)
    values, reach = np.empty(0, dtype=complex), 0.0
    for _ in range(_DISKS):
        if reach >= highest - rounding:
            return NearestEigenvalues(values, math.inf, rounding)
        if matrix.shape[0] <= FEW:
            values = np.linalg.eigvals(matrix.toarray()).astype(complex)
            return NearestEigenvalues(values, math.inf, rounding)
        inside, radius = _disk(matrix, reach)
        apart = abs(inside[:, None] - values).min(axis=1, initial=math.inf)
        fresh = inside[apart > rounding]
        values = np.concatenate([values, fresh, fresh[fresh.imag > rounding].conj()])
        reach += radius
    return NearestEigenvalues(values, reach, rounding)


def _disk(matrix: Matrix, height: float) -> tuple[Any, float]:
    """The eigenvalues around a place of the upper half of the axis, and how far they reach."""
    from scipy.sparse.linalg import ArpackError, LinearOperator, eigs

    n = matrix.shape[0]
    moved = matrix if height == 0 else plus_diagonal(matrix, -1j * height)
    try:
        lu = factorised(moved)
    except RuntimeError:  # an eigenvalue is there to the last digit
        lu = factorised(plus_diagonal(moved, _EXACT * abs(matrix).max()))
    operator = LinearOperator((n, n), matvec=lu.solve, dtype=moved.dtype)
    wanted = min(_IN_A_DISK, n - 2)
    try:
        inverse = eigs(operator, wanted, v0=any_vector(n), tol=1e-10, return_eigenvectors=False)
    except ArpackError as error:
        raise Undefined(f"no eigenvalues were found next to {height:.3g}i: {error}") from error
    values = 1 / inverse + 1j * height  # those of (A - i height)^-1, the largest first
    radius = float(abs(values - 1j * height).max())
    return values[values.imag >= 0], radius


# --- the pair that crosses the axis --------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class InvariantPlane:
    """The plane that belongs to two eigenvalues: vectors that span it, those of the transposed
    matrix with ``left.T right = 1``, and the matrix within it."""

    right: Array
    left: Array
    within: Array


def plane_at(matrix: Matrix, square: float) -> InvariantPlane:
    """The plane of the two eigenvalues whose squares are closest to ``-square``.

    By subspace iteration with the inverse of ``A^2 + square``, through a system of twice the size
    whose entries are those of A: it is smooth where the pair meets at zero.
    """
    from scipy.sparse import block_array, eye_array

    n, identity = matrix.shape[0], eye_array(matrix.shape[0], format="csc")
    # A v = u, A u + square v: its solutions are those of (A^2 + square) v
    factors = Factors(block_array([[matrix, -identity], [square * identity, matrix]], format="csc"))
    right = _iterated(
        lambda x: factors.solve(np.append(0 * x, x), refined=False)[:n], matrix, square
    )
    left = _iterated(lambda x: factors.transposed(np.append(x, 0 * x))[n:], matrix.T, square)
    left = np.asarray(np.linalg.solve(left.T @ right, left.T).T)  # now left^T right = 1
    return InvariantPlane(right, left, left.T @ (matrix @ right))


def _iterated(apply: Callable[[Array], Array], matrix: Matrix, square: float) -> Array:
    """Orthonormal vectors of the plane, out of a few more that grow together with them."""
    n = matrix.shape[0]
    vectors = [np.roll(any_vector(n), k * n // _TOGETHER) for k in range(min(_TOGETHER, n))]
    noise = 4 * np.finfo(float).eps * float(abs(matrix).sum(axis=0).max())
    # trace and determinant do not depend on the basis of the plane, as its vectors do
    before = np.full(2, math.inf)
    for _ in range(_TURNS):
        x = np.asarray(np.linalg.qr(np.stack([apply(v) for v in vectors], axis=1))[0])
        # Rayleigh-Ritz: A within the space of all vectors, and of that the plane wanted
        block, turned = _nearest_two(x.T @ (matrix @ x), square)
        now, size = np.array([np.trace(block), np.linalg.det(block)]), float(np.linalg.norm(block))
        if (abs(now - before) <= (_EXACT * size + noise) * np.array([1.0, size])).all():
            return x @ turned
        before, vectors = now, [*x.T]
    raise Undefined("no pair of eigenvalues stands out next to the imaginary axis")


def _nearest_two(small: Array, square: float) -> tuple[Array, Array]:
    """A small matrix within the plane of the two eigenvalues whose squares are closest to
    ``-square``, and orthonormal vectors of that plane."""
    from scipy.linalg import schur

    off = np.sort(abs(np.linalg.eigvals(small) ** 2 + square))
    bound = math.inf if off.size < 3 else 0.5 * float(off[1] + off[2])
    form, vectors, count = schur(
        small, sort=lambda re, im: abs(complex(re, im) ** 2 + square) <= bound
    )
    if count != 2:
        raise Undefined("three eigenvalues are equally close to the imaginary axis")
    return form[:2, :2], vectors[:, :2]


def square_of_pair(curve: Curve, z: Array) -> float:
    """The squared frequency of the pair nearest the imaginary axis, or of a double zero."""
    around = near_axis(curve, z)
    if around.pairs.size:
        nearest = around.pairs[abs(around.pairs.real).argmin()]
        return float(abs(nearest) ** 2)
    least = around.values[np.argsort(abs(around.values))[:2]]
    if least.size < 2 or abs(least).max() > _DOUBLE * around.rounding:
        raise Undefined("no complex pair of eigenvalues is there: a neutral saddle")
    return float((least[0] * least[1]).real)


def conditions_in_plane(square: float) -> DefiningSystem:
    """Trace and determinant of the derivative within the plane of a pair are 0 and omega2: two
    equations and one unknown, smooth where the pair meets at zero."""
    return DefiningSystem({"omega2": square}, _conditions, _slopes)


def _plane(curve: Curve, z: Array, square: float) -> InvariantPlane:
    planes: dict[float, InvariantPlane] = curve.cached("planes", z, lambda z: {})
    if square not in planes:
        planes[square] = plane_at(flow(curve, z), square)
    return planes[square]


def _conditions(curve: Curve, z: Array, extra: Array) -> Array:
    square = float(extra[0])
    within = _plane(curve, z, square).within
    return np.array([np.trace(within), np.linalg.det(within) - square])


def _slopes(curve: Curve, z: Array, extra: Array) -> Array:
    plane, scales = _plane(curve, z, float(extra[0])), curve.scales[: curve.size]
    # left.T A' right, with the derivative of the Jacobian along each vector of the plane
    changes = [curve.along(z, vector * scales) for vector in plane.right.T]
    left = (plane.left / scales[:, None]).T
    (d11, d12), (d21, d22) = zip(*(left @ change for change in changes), strict=True)
    (a, b), (c, d) = plane.within
    # trace' = d11 + d22, det' = d d11 - c d12 - b d21 + a d22 of the matrix ((a, b), (c, d))
    rows = np.stack([d11 + d22, d * d11 + a * d22 - b * d21 - c * d12])
    return np.hstack([rows, [[0.0], [-1.0]]])
