"""BP, where two curves cross: the system that locates it, the tangents of both, and its event.

Curves of branch points are followed where a symmetry or an invariant subspace keeps them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...errors import NotConverged
from ..algebra.linear_algebra import Bordered, LeastSingular, by_inverses, least_singular, sense
from ..algebra.newton import FEW, Array, Solution, Undefined, rounding
from ..algebra.sparse import (
    Dense,
    Factors,
    Matrix,
    above,
    beside,
    checked_finite,
    is_large,
    is_sparse,
)
from ..curve.branch import Points
from ..curve.curve import Curve
from ..curve.point import DefiningSystem, Event, Many, Point
from .defining_systems import Singular, factors_at, signed_smallest, signed_smallest_of

# Places closer than this, relative to 1 + |z|, are one, and curves that come as close are taken to
# cross. The residual between these is its square, 1e-12: as much as differences and long sums leave
# where curves do cross. Of stiff equations more may be left, all that rounds in their terms.
GAP = 1e-6
CROSSED = "branches cross here, held together by a symmetry or an invariant subspace"
RANK = 1e-7  # balanced singular value of a matrix that loses rank; at a located point about 1e-12


@dataclass(frozen=True)
class Crossing:
    """A simple branch point and the unit tangents of both curves there."""

    solution: Solution
    tangents: tuple[Array, Array]
    double: bool  # whether the derivative loses another rank as close by as curves may be


def crossing(curve: Curve, z: Array) -> Crossing:
    """The branch point near z, by Newton's iteration on ``H + beta w = 0, w^T H_z = 0, |w| = 1``.

    That system is regular where two curves cross at an angle; along one of them Newton's
    iteration for H alone is singular there and good to 1e-8 only. With N the two null vectors
    of H_z, a step is ``N c + y``: y answers H but for its part along w, and c makes ``w^T H_z``
    vanish on N, which takes second derivatives in two directions only. ``beta = w . H`` then
    tells whether the curves do cross or only come close.

    Raises `Undefined` if they do not.
    """
    # a system of G. Moore, Numer. Funct. Anal. Optimiz. 2, 441 (1980), for z, w and beta
    previous = math.inf
    for iteration in range(1, 13):
        value = curve.equations(z) / curve.row_scales
        matrix = checked_finite(curve.balanced(curve.jacobian(z)))
        weak = least_singular(matrix)
        w, null, rest = weak.left, weak.plane, -weak.rest(value)
        second = _second_derivatives(curve, z, weak)
        form = second @ null.T  # w^T H_zz on the null space
        # to first order w^T H_z at z + N c + y vanishes on N:  form c = -N w^T H_z - (w^T H_zz y) N
        c = Dense(form).solve(-null @ (w @ matrix) - second @ rest)
        if c is None:
            break
        step = (null.T @ c + rest) * curve.scales
        correction = curve.length(step)
        z = z + step
        size = 1 + curve.length(z)
        stalled = previous / 2 < correction <= GAP * size  # what is left is rounding
        if correction <= 1e-9 * size or stalled:
            value = curve.equations(z)
            tangents = _tangents(curve, z, value, w, null * curve.scales, form)
            solution = Solution(z, True, iteration, float(abs(value).max()))
            return Crossing(solution, tangents, weak.second < GAP * size * float(abs(form).max()))
        previous = correction
    raise Undefined("no branch point was found nearby")


def _second_derivatives(curve: Curve, z: Array, weak: LeastSingular) -> Array:
    """``w^T H_zz`` along each null vector."""
    turned = [curve.balanced(curve.along(z, vector * curve.scales)) for vector in weak.plane]
    return np.asarray(checked_finite(np.stack([weak.left @ change for change in turned])))


def _tangents(
    curve: Curve, z: Array, value: Array, w: Array, null: Array, form: Array
) -> tuple[Array, Array]:
    """The tangents ``c . N`` with ``c^T form c = 0``, once the curves are seen to cross."""
    # two lines are where an indefinite form vanishes: low < 0 < high on its axes, with the square
    # of half the angle between the lines as their ratio
    (low, high), axes = np.linalg.eigh((form + form.T) / 2)
    if not min(-low, high) > 1e-8 * max(-low, high):
        raise Undefined("an isolated point or a touch: no two curves cross at an angle")
    w = w / curve.row_scales
    left = max(0.0, abs(w.dot(value)) - abs(w) @ rounding(curve.jacobian(z), z))
    # the hyperbola c^T form c / 2 + beta = 0 stays about this far off its centre
    gap = math.sqrt(left / min(-low, high))
    if gap > GAP * (1 + curve.length(z)):
        raise Undefined(f"the curves pass each other at a distance of {gap:.2g}")
    # low c1^2 + high c2^2 = 0 on the axes: (c1, c2) = (sqrt(high), +- sqrt(-low))
    c = axes @ np.array([[math.sqrt(high)] * 2, [math.sqrt(-low), -math.sqrt(-low)]])
    first, second = (curve.normalised(way) / sense(way) for way in c.T @ null)
    return (first, second) if sense(first - second) > 0 else (second, first)


# --- the event --------------------------------------------------------------------------------


def crossing_event(meets: Mapping[str, tuple[Event, ...]]) -> Event:
    """BP, with the names of what else happens on its curves."""
    return Event(
        "BP", Singular(bordered_matrix), many=_tests, count=_unstable, locus=Crossings(meets),
        examine=_examine,
    )  # fmt: skip


def _unstable(point: Point) -> int:
    """Number of eigenvalues with positive real part, not known of large problems."""
    if is_sparse(point.curve.jacobian(point.z)):
        return 0
    return int(np.count_nonzero(point.curve.spectrum(point.z).real > 0))


def branch_point_test(point: Point) -> float:
    """Least singular value with the row of the tangent below; of more than a few unknowns about,
    by one factorisation."""
    factors = factors_at(bordered_matrix, point)
    if not isinstance(factors, Dense):
        return signed_smallest(factors)
    if point.z.size <= FEW:
        return signed_smallest(factors.whole)
    return by_inverses(factors, point.z.size, 2)[0] if factors.exact else 0.0


def bordered_matrix(point: Point) -> Matrix:
    """The derivative, in `row_units`, and the row of the tangent, in the scales of the unknowns."""
    curve, row = point.curve, point.curve.metric * point.direction
    matrix = curve.jacobian(point.z)
    if is_large(matrix):
        factors = curve.factors(point.z, row)
        assert isinstance(factors, Factors)
        return Bordered(factors, row, curve.scales)
    whole = np.empty((point.z.size, point.z.size))
    whole[:-1], whole[-1] = matrix / curve.row_units[:, None], row
    whole *= curve.scales
    return whole


def bordered_matrices(points: Points) -> Array | None:
    """Bordered matrices at several points of a small problem."""
    curve = points.curve
    matrices = curve.jacobians(points.z)
    if matrices is None:
        return None
    rows = (curve.metric * points.tangent * curve.scales)[:, None, :]
    return np.asarray(np.concatenate([curve.in_units(matrices), rows], axis=1))


def _tests(points: Points) -> Many | None:
    matrices, values = bordered_matrices(points), points.curve.spectra(points.z)
    if matrices is None or values is None:
        return None
    return signed_smallest_of(matrices), np.count_nonzero(values.real > 0, axis=1)


def _examine(point: Point) -> str:
    return "" if "tangents" in point.detail else "no two curves were found to cross here"


@dataclass(frozen=True)
class Crossings:
    """The locus of an event where curves cross.

    Along one of them the equations are singular there: it is located by `solve`, and its locus is
    one in two parameters only.
    """

    meets: Mapping[str, tuple[Event, ...]] = field(default_factory=dict)

    def __call__(self, point: Point) -> DefiningSystem:
        """``H + split b = 0`` and rank n - 1 of ``A = (H_x, H_p d)``, where the direction d of the
        two parameters leaves the curve of branch points.

        H alone is singular at every branch point, so it is unfolded by `split`: by how much
        branches that do not quite cross miss each other. Curves of branch points need three
        parameters in general. With two there are some where a symmetry or an invariant subspace
        holds the branches together, and then `split` stays 0.
        """
        rank = _LostRank(*_held_together(point))
        return DefiningSystem(
            {"split": 0.0}, rank.conditions, rank.derivative, unfolding=rank.unfolding,
            events=(Event("BP", _refuse_to_part, ends="branch"),),
            # all along a curve of branch points the derivative in the unknowns is singular
            meets={"LP": (), **self.meets},
        )  # fmt: skip

    @staticmethod
    def solve(point: Point) -> tuple[Solution, dict[str, Any]]:
        branch_point = crossing(point.curve, point.z)
        detail: dict[str, Any] = {"tangents": [*branch_point.tangents]}
        if branch_point.double:
            detail["reason"] = "the derivative loses more than one rank: not a simple branch point"
        return branch_point.solution, detail


def branches_cross(base: Point) -> bool:
    """Tell whether the derivative in unknowns and both parameters loses one rank."""
    matrix = base.curve.balanced(base.curve.jacobian(base.z))
    weak = least_singular(matrix)
    return weak.size < _lost(matrix, weak) < weak.second


def _lost(matrix: Matrix, weak: LeastSingular) -> float:
    """Below which a singular value is zero; of fine meshes even the others are small."""
    return RANK * (min(1.0, weak.second) if is_sparse(matrix) else 1.0)


def crossed(base: Point) -> dict[str, str]:
    """Note that branches cross, where they do: any other normal form is degenerate there."""
    return {"degenerate": CROSSED} if branches_cross(base) else {}


@dataclass(frozen=True)
class _LostRank:
    b: Array
    null: Array
    direction: Array

    def _vectors(self, curve: Curve, z: Array) -> tuple[Array, Array, Array]:
        """Two orthonormal vectors v to the right and one w to the left, in the units of the curve,
        and ``w^T A v``: where that vanishes they are null vectors."""

        def make(z: Array) -> tuple[Array, Array, Array]:
            # | A       b |  A is n x (n + 1), of rank n - 1: with the borders b, next to its left
            # | null^T  0 |  null vector, and the two right ones below it is regular
            A, n = _columns(curve.in_units(curve.jacobian(z)), self.direction), curve.size
            below, unit = np.hstack([self.null, np.zeros((2, 1))]), np.eye(n + 2)[:, -2:]
            wider, rows = beside(A, self.b[:, None]), [below] if is_sparse(A) else []
            factors: Any = Factors(wider) if rows else Dense(above(wider, below))
            if not (sign := factors.sign(*rows)):
                raise Undefined("more than one rank is lost at a branch point")
            v = np.stack([factors.solve(right, *rows)[:-1] for right in unit.T], axis=1)
            w = factors.transposed(unit[:, 1], *rows)[:n]
            # far from where the borders are from they may be at right angles to the null vectors:
            # there the inverse has a pole, which directions do not, and w with this sign
            left, _, right = np.linalg.svd(v, full_matrices=False)
            v, w = left @ right, w * (sign / np.linalg.norm(w * curve.row_scales / curve.row_units))
            return v, w, w @ A @ v

        return curve.cached(f"lost rank {id(self)}", z, make)

    def unfolding(self, curve: Curve, z: Array, extra: Array) -> tuple[Array, Array]:
        b = self._vectors(curve, z)[1] / curve.row_units * curve.row_scales**2
        return extra[0] * b, b[:, None]

    def conditions(self, curve: Curve, z: Array, extra: Array) -> Array:
        return self._vectors(curve, z)[2]

    def derivative(self, curve: Curve, z: Array, extra: Array) -> Array:
        v, w, _ = self._vectors(curve, z)
        # w^T A'(u) v for all u at once: second derivatives are symmetric
        ways = [curve.scales * np.append(u[:-1], u[-1] * self.direction) for u in v.T]
        rows = [w / curve.row_units @ curve.along(z, way) for way in ways]
        return np.hstack([rows, np.zeros((2, 1))])


def _columns(rows: Matrix, direction: Array) -> Matrix:
    """Columns of the unknowns, and of the parameters along a direction."""
    n = rows.shape[0]
    if rows.shape[1] != n + 2:
        raise Undefined("a branch point is followed in two parameters")
    return beside(rows[:, :n], (rows[:, n:] @ direction)[:, None])


def _held_together(point: Point) -> tuple[Array, Array, Array]:
    """A border of A, its right null vectors, and the direction d across the curve of branch points:
    to first order nothing changes along the null vector of ``w^T H_zz`` in the null space of H_z.
    """
    curve, z = point.curve, point.z
    first, second = curve.free
    matrix = curve.balanced(curve.jacobian(z))
    weak = least_singular(matrix)
    refusal = (
        f"the branches cross at these values of {first} and {second} only, and come apart beside "
        "them; a curve of such branch points needs a third parameter"
    )
    if weak.size > _lost(matrix, weak):
        raise Undefined(refusal)
    null = weak.plane
    form = _second_derivatives(curve, z, weak) @ null.T
    values, axes = np.linalg.eigh((form + form.T) / 2)
    # w^T H_zz tau = 0 along the tangent tau of a curve of branch points: the form is singular
    least = int(abs(values).argmin())
    if abs(values[least]) > 1e-5 * abs(values).max():
        raise Undefined(refusal)
    tangent = (axes[:, least] @ null)[-2:]
    if not np.linalg.norm(tangent) > RANK:
        raise Undefined(f"the branch point does not move with {first} and {second}")
    # at a right angle, in their scales, to how the parameters change along the curve
    direction = np.array([-tangent[1], tangent[0]]) / np.linalg.norm(tangent)
    across = least_singular(_columns(curve.in_units(point.jacobian()), direction))
    # each row in its own size: what is left of the conditions is then rounding, as of equations
    return weak.left * (curve.row_scales / curve.row_units), across.plane, direction


def _refuse_to_part(point: Point) -> float:
    """No test: branches cross all along the curve, or nowhere else but at its start."""
    base, split = point.base_point, abs(point["split"])
    # branches a distance d apart solve the equations up to d^2 between them: what differences leave
    # after Newton's iteration, and what `crossing` takes for a crossing
    if split <= 1e-10 * (1 + base.curve.length(base.z)) ** 2:
        return math.nan
    walls = (event for event in base.curve.problem.events if event.ends == "domain")
    if any(wall.value_or_nan(base) < 0 for wall in walls):
        return math.nan  # behind one nothing holds them together: the curve ends at it
    values = ", ".join(f"{name} = {point[name]:.6g}" for name in base.curve.free)
    raise NotConverged(
        f"no curve of branch points: at {values} the branches have come apart (they miss each "
        f"other by {split:.2g} in the equations); it needs a third parameter",
        residual=split,
    )
