"""Coefficients of normal forms: which way a bifurcation goes, for flows and for maps.

Each is a contraction of the derivatives A, B, C of the equations (first, second, third order) with
the critical eigenvectors, on the centre manifold: Yu. A. Kuznetsov, Elements of Applied Bifurcation
Theory, chapters 5, 8 and 9. B and C are needed along critical directions only, where they are
differences of the Jacobian; so a coefficient costs some fifty Jacobians, whatever the size.

With ``q`` the right and ``p`` the left eigenvector throughout, ``|q| = 1`` and ``<p, q> = 1``, with
``<p, q> = conj(p) . q``. Lengths are measured in the units of the problem's `scales`, those
of cycles of flows as they are.

A map may be given by more equations than it has unknowns, as the return map of a cycle is by all
that happens on the way around. Then A and the eigenvectors are those of all these equations, and
``1 - mu``, which stands on the diagonal of a map's, in the few rows where the cycle is closed:
the matrix T below, the identity otherwise. In place of q and <p, q> it is T q, of length 1, and
<p, T q> = 1; all else is the same, for what is on the way follows from where it began.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..algebra.derivatives import extrapolated
from ..algebra.linear_algebra import LOST, least_singular, sense, solved
from ..algebra.newton import OUT_OF_DOMAIN, Array, Undefined
from ..algebra.sparse import (
    Matrix,
    above,
    beside,
    checked_finite,
    first_columns,
    is_large,
    is_sparse,
    null_vectors,
    plus_diagonal,
    scaled,
)
from ..curve.curve import Curve
from ..curve.point import Detail, Point
from .spectrum import in_sizes_at

Complex = NDArray[np.complex128]

AGREED = 1e-10  # relative error at which no shorter step is tried
ROUGHLY = 1e-7  # and all along a curve where each derivative is dear
_ROUNDING = 1e-11  # a coefficient this small against its terms is rounding
_DEFECTIVE = 1e-6  # <p, q> of unit vectors below which an eigenvalue counts as double


Jet = tuple[Matrix, Matrix]  # derivatives of the Jacobian along v: B(v, .) and C(v, v, .)


@dataclass(frozen=True)
class Coefficient:
    """A coefficient and the size of the terms it adds up, to tell a zero by; `rounding` is what is
    left of them where it vanishes, and `least` what is none where all of them do."""

    value: complex
    size: float
    rounding: float = _ROUNDING
    least: float = 0.0

    @property
    def degenerate(self) -> bool:
        """Tell whether its real part has no sign to speak of."""
        return abs(self.value.real) <= max(1e-6 * self.size, self.least)

    @property
    def signed(self) -> float:
        """Its real part as a test function: 0 where that is rounding."""
        least = max(self.rounding * self.size, self.least)
        return 0.0 if abs(self.value.real) <= least else float(self.value.real)


def closed(curve: Curve, matrix: Matrix, mu: complex) -> Matrix:
    """The square derivative whose null vectors are perturbations that have grown by mu when they
    come back: ``A - mu`` of a map, with A = F_x + 1, between unknowns in their scales."""
    if curve.problem.closing is not None:
        return curve.problem.closing(matrix, mu)
    scales = curve.scales[: curve.size]
    return scaled(plus_diagonal(first_columns(matrix, curve.size), 1 - mu), 1 / scales, scales)


class Forms:
    """The derivatives of the equations at a point in their unknowns, in units of their scales."""

    def __init__(self, point: Point, agreed: float = AGREED) -> None:
        base, self.agreed = point.base_point, agreed
        self.curve, self.z = base.curve, base.z
        problem = self.curve.problem
        self.closing = problem.closing
        every = np.arange(self.curve.size)
        self.moved = every if problem.perturbed is None else problem.perturbed
        self.n = self.moved.size
        scales = self.scales = self.curve.scales[self.moved]
        if self.closing is None and not is_large(self.curve.in_unknowns(self.z)):
            self.scales = in_sizes_at(self.curve, self.z)[1][self.moved]
        self.x = self.z[self.moved] / self.scales
        self.A = self._matrix(self.z)
        if self.closing is None:
            self.T, self.units = plus_diagonal(0 * self.A, 1.0), self.scales / scales
        else:  # the scale of a cycle is that of one orbit, by which no length should be told
            self.T, self.units = self.closed(1.0) - self.closed(2.0), self.scales
        self.reach = max(1.0, float(abs(self.x).max()))
        # a cubic term of order one: a vector of length 1 is small in each entry of a fine mesh, and
        # has that length in scales, whatever the units
        moves = max(1.0, float(abs(self.z[self.moved] / scales).max()))
        self.cubic = moves**-2 / (self.n if is_sparse(self.A) else 1)

    def _matrix(self, z: Array) -> Matrix:
        """The Jacobian between unknowns in their scales: similar to the one in plain units."""
        return self._scaled(self.curve.in_unknowns(z))

    def _scaled(self, matrix: Matrix) -> Matrix:
        if self.n < self.curve.size:
            matrix = matrix[self.moved][:, self.moved]
        return scaled(matrix, 1 / self.scales, self.scales)

    def closed(self, mu: complex) -> Matrix:
        """The matrix that takes to zero a perturbation that comes back grown by mu."""
        if self.closing is None:
            return plus_diagonal(self.A, 1 - mu)
        return self._scaled(closed(self.curve, self.curve.in_unknowns(self.z), mu))

    def eigenvectors(self, matrix: Matrix) -> tuple[Any, Any]:
        """Null vectors (q, p) of a matrix that has one: ``M q = 0``, ``conj(p) M = 0``."""
        of_cycle = self.closing is not None and is_large(matrix)  # most entries are 0
        if of_cycle or is_sparse(matrix):
            q, p = null_vectors(matrix)
        else:
            left, _, right = np.linalg.svd(matrix)
            q, p = right[-1].conj(), left[:, -1]
        began = self.T @ q
        # on the way around a cycle they may be far larger than where it begins
        small = _DEFECTIVE if self.closing is None else _DEFECTIVE**2
        if abs(np.vdot(p, began)) < small * float(np.linalg.norm(began)):
            raise Undefined("a double eigenvalue with one eigenvector: no normal form of this kind")
        size = sense(q) * np.linalg.norm(self.units * began)
        return q / size, p / np.conj(np.vdot(p, began) / size)

    def jet(self, v: Array) -> Jet:
        """Derivatives along v, by the steps at which they depend least on these."""
        if not v.any():
            return 0 * self.A, 0 * self.A
        # relative to the entries that v moves: an idle one of size 100 says nothing of the step
        reach = 1 / max(float(np.linalg.norm(v / np.maximum(1.0, abs(self.x)))), 1e-300)
        direction = np.zeros(self.z.size)
        direction[self.moved] = v * self.scales
        # three steps answer to 1e-10, two shorter ones roughly
        exact = self.agreed < ROUGHLY
        first, count = (0.12 * reach, 3) if exact else (0.02 * reach, 2)

        def around(h: float) -> list[Array]:
            return [self.z + h * direction, self.z - h * direction]

        def differences(h: float) -> list[Matrix]:
            there, behind = map(self._matrix, around(h))
            jet = (there - behind) / (2 * h), (there - 2 * self.A + behind) / h**2
            return [*map(checked_finite, jet)]

        with suppress(Undefined):
            self.curve.prepare([z for i in range(count) for z in around(first / 2**i)])
        agreed = 1e-7 if exact else 1e-4
        B, C = extrapolated(differences, partial(self._apart, reach), first, agreed)
        return B, C

    def _apart(self, reach: float, jet: Sequence[Matrix], other: Sequence[Matrix]) -> float:
        """Relative difference of two jets: of C to B, of B to both neighbours."""
        (B, C), (B2, C2) = jet, other
        a, b, c, db, dc = (float(abs(matrix).max()) for matrix in (self.A, B, C, B - B2, C - C2))
        b, c = b * reach, c * reach**2
        b, c = b + 1e-3 * (a + c), c + b + 1e-3 * a
        return max(db * reach / max(b, 1e-300), dc * reach**2 / max(c, 1e-300))


solve = partial(solved, why="a second resonance: no normal form of this kind")


def _sum(*terms: float) -> Coefficient:
    return Coefficient(sum(terms), sum(abs(term) for term in terms))


def criticality(
    name: str, make: Callable[[], Coefficient], *, stable_if_negative: bool, **known: float
) -> Detail:
    """A coefficient by its name, and what its sign says; or why it is not known. Dear to know, and
    most events are only passed through: it is found when it is asked for."""
    found = partial(_criticality, name, make, stable_if_negative)
    return Detail(known, (name, "criticality"), found)


def _criticality(
    name: str, make: Callable[[], Coefficient], stable_if_negative: bool
) -> dict[str, Any]:
    try:
        coefficient = make()
    except OUT_OF_DOMAIN as error:
        return {"criticality": f"unknown: {error}"}
    stable = (coefficient.value.real < 0) == stable_if_negative
    kind = "degenerate" if coefficient.degenerate else "supercritical" if stable else "subcritical"
    value = coefficient.value
    plain = complex(value) if isinstance(value, complex) else float(value)
    return {name: plain, "criticality": kind}


# --- flows ------------------------------------------------------------------------------------


def lyapunov_coefficient(point: Point, omega: float, agreed: float = AGREED) -> Coefficient:
    """First Lyapunov coefficient l1 of the flow ``x' = F`` where F_x has eigenvalues ``+-i omega``.

    Negative: a stable limit cycle appears on the centre manifold (supercritical).
    """
    # those of F_x + 1, as of a map
    values = (1.0 + 1j * omega, 1.0 + 2j * omega, 1.0)
    coefficient = _of_pair(Forms(point, agreed), values, 2 * omega)
    return replace(coefficient, value=coefficient.value.real)


def _of_pair(forms: Forms, values: Sequence[complex], unit: complex) -> Coefficient:
    """The cubic coefficient of a pair of eigenvalues, from these values of its amplitude, of the
    square of that, which turns twice as fast, and of its size, which does not turn."""
    critical, double, steady = map(forms.closed, values)
    q, p = forms.eigenvectors(critical)
    (B_real, C_real), (B_imag, C_imag) = forms.jet(q.real), forms.jet(q.imag)
    # B(q, .), the conjugate of B(conj(q), .), and C(q, q, conj(q))
    B, C = B_real + 1j * B_imag, (C_real + C_imag) @ q
    # on the centre manifold x = z q + cc + h20 z^2 / 2 + h11 |z|^2 + ...
    h11 = solve(-steady, B @ q.conj())
    h20 = solve(-double, B @ q)
    # <p, C(q, q, cq) + 2 B(q, h11) + B(cq, h20)> / unit, with cq for conj(q): 2 omega for l1 of a
    # flow, 2 mu for d of a map
    terms = (C, 2 * B @ h11, B.conj() @ h20)
    parts = [complex(np.vdot(p, term)) / unit for term in terms]
    size, least = sum(abs(part) for part in parts), _ROUNDING * forms.cubic
    return Coefficient(sum(parts), size, least=least)


def cubic_at_cusp(point: Point) -> tuple[Coefficient, Coefficient]:
    """Quadratic and cubic coefficient on the centre manifold of a zero eigenvalue.

    At a cusp the first vanishes and the second does not. They are compared, b a^2 and c a^3, with
    each other and with what the parameters do, ``p F_p`` and ``p F_xp q a``, at the amplitude a at
    which the state moves by its own size, and parameters by theirs or their scales: whatever the
    units of equations and unknowns, and however fine the mesh.
    """
    forms = Forms(point)
    q, p = forms.eigenvectors(forms.A)
    (B, C), began = forms.jet(q), forms.T @ q
    bent = B @ q
    # x' = <p, B(q, q)> x^2 / 2 + (<p, C(q, q, q)> + 3 <p, B(q, h)>) x^3 / 6
    quadratic = 0.5 * float(p @ bent)
    # | A     T q |  A h = <p, B> T q - B with <p, T h> = 0
    # | p T    0  |
    bordered = above(beside(forms.A, began[:, None]), np.append(p @ forms.T, 0.0)[None, :])
    h = solve(bordered, np.append(2 * quadratic * began - bent, 0.0))[:-1]
    size = 0.5 * float(abs(p) @ abs(B) @ abs(q))
    cubic = _sum(float(p @ C @ q) / 6, float(p @ B @ h) / 2)
    amplitude = forms.reach / float(abs(q).max())
    left, n, along = np.zeros(forms.curve.size), forms.curve.size, np.zeros(forms.curve.size)
    left[forms.moved], along[forms.moved] = p / forms.scales, amplitude * q * forms.scales
    changes = forms.curve.jacobian(forms.z)[:, n:], forms.curve.along(forms.z, along)[:, n:]
    by_parameters = sum(abs(left @ change) for change in changes)
    pushed = float(by_parameters @ np.maximum(forms.curve.scales[n:], abs(forms.z[n:])))
    measure = cubic.size * amplitude**3 + size * amplitude**2 + pushed
    sizes = measure / amplitude**2, measure / amplitude**3
    return Coefficient(quadratic, sizes[0]), replace(cubic, size=sizes[1])


def takens_bogdanov(point: Point) -> tuple[Coefficient, Coefficient]:
    """The coefficients a > 0 and b of ``x' = y, y' = a x^2 + b x y`` at a double zero.

    Raises `Undefined` where the zero eigenvalue is not double with one eigenvector.
    """
    forms = Forms(point)
    weak = least_singular(forms.A)
    q0, p1 = weak.right, weak.left
    if is_sparse(forms.A):  # fine meshes have small singular values everywhere
        alone = weak.second > LOST * weak.largest
    else:  # each row in its own size: beside fast ones what is slow is small
        sizes = np.maximum(abs(forms.A).max(axis=1, keepdims=True), 1e-300)
        rows = np.linalg.svd(forms.A / sizes, compute_uv=False)
        alone = forms.n > 1 and rows[-2] > _DEFECTIVE * rows[0]
    if not alone or abs(p1 @ q0) > math.sqrt(_DEFECTIVE):
        raise Undefined("no double zero eigenvalue with one eigenvector")
    # chains: A q0 = 0, A q1 = q0; A^T p1 = 0, A^T p0 = p1 (Kuznetsov, section 8.4)
    turned = forms.A.T.tocsc() if is_sparse(forms.A) else forms.A.T
    q1, p0 = weak.rest(q0), least_singular(turned).rest(p1)
    overlap = p1 @ q1
    p0, p1 = p0 / overlap, p1 / overlap
    p0 = p0 - (p0 @ q1) * p1  # then <p0, q1> = 0, and <p0, q0> = <p1, q1> = 1 by the chains
    B, _ = forms.jet(q0)
    a = 0.5 * float(p1 @ B @ q0)
    b = _sum(float(p0 @ B @ q0), float(p1 @ B @ q1))
    # where all terms vanish, by symmetry, they are small against one of order one, in a unit of
    # time in which q1 is as long as q0: a is a rate squared, b a rate
    rate = 1.0 / float(np.linalg.norm(q1))
    size = float(abs(p1) @ abs(B) @ abs(q0)) + rate * float(np.linalg.norm(p1)) / forms.reach
    # of a null vector of length 1 in scales, as elsewhere, whose sign is free
    length = math.copysign(float(np.linalg.norm(forms.units * q0)), a)
    size, b_size = size / abs(length), max(size / rate, b.size) / abs(length)
    return Coefficient(a / length, size), Coefficient(b.value / length, b_size)


# --- maps: F(x) = G(x) - x with the multipliers of F_x + 1, or the equations of a cycle ----------


def flip(point: Point, agreed: float = AGREED) -> Coefficient:
    """Coefficient c of ``u -> -u + c u^3`` at a multiplier -1; positive: a stable doubled cycle
    appears (supercritical).

    Raises `Undefined` where another multiplier of a map is 1, as where branches cross.
    """
    forms = Forms(point, agreed)
    of_map = forms.closing is None and not is_sparse(forms.A)
    if of_map and min(abs(np.linalg.eigvals(forms.A))) < _DEFECTIVE:
        raise Undefined("a second resonance: no normal form of this kind")
    q, p = forms.eigenvectors(forms.closed(-1.0))
    B, C = forms.jet(q)
    # on the centre manifold x = u q + u^2 h / 2 with -F_x h = B(q, q), as (-1)^2 = 1, and
    # c = <p, C(q, q, q) + 3 B(q, h)> / 6
    h = solve(-forms.closed(1.0), B @ q)
    coefficient = _sum(float(p @ C @ q) / 6, float(p @ B @ h) / 2)
    return replace(coefficient, rounding=agreed, least=agreed * forms.cubic)


def rotation_coefficient(point: Point, angle: float, agreed: float = AGREED) -> Coefficient:
    """Coefficient d of ``w -> exp(i angle) w (1 + d |w|^2)`` at a pair on the unit circle.

    Its real part negative: a stable closed curve appears (supercritical).

    Raises `Undefined` at the strong resonances 1:1 to 1:4, where the normal form is another: at 1:4
    the cube of the conjugate of w decides as well.
    """
    mu, forms = np.exp(1j * angle), Forms(point, agreed)
    if min(abs(mu**k - 1) for k in (1, 2, 3, 4)) < _DEFECTIVE:
        raise Undefined("a strong resonance: the normal form is another")
    coefficient = _of_pair(forms, (mu, mu**2, 1.0), 2 * mu)
    return replace(coefficient, rounding=agreed)
