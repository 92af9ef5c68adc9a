"""Where two curves of solutions cross: a branch point, and the tangents of both curves there."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from . import derivatives
from .newton import Solution, Undefined, solve
from .problem import Curve

Array = NDArray[np.float64]

# Curves that come closer than this, relative to 1 + |z|, are taken to cross. The residual between
# them is its square, 1e-12: as much as differences and long sums leave where curves do cross. Of
# stiff equations more may be left, all that rounds in their terms.
GAP = 1e-6
_ANGLE = 1e-8  # square of half the angle below which curves touch rather than cross


@dataclass(frozen=True)
class Crossing:
    """A simple branch point and the unit tangents of both curves there."""

    solution: Solution
    tangents: tuple[Array, Array]
    double: bool = False  # whether the derivative loses another rank as close by as curves may be


def crossing(curve: Curve, z: Array, *, most: int = 12) -> Crossing:
    """The branch point near z, by Newton's iteration on ``H + beta w = 0, w^T H_z = 0, |w| = 1``.

    That system is regular where two curves cross at an angle; along one of them Newton's
    iteration for H alone is singular there and good to 1e-8 only. With N the two null vectors
    of H_z, a step is ``N c + y``: y answers H but for its part along w, and c makes ``w^T H_z``
    vanish on N, which takes second derivatives in two directions only. ``beta = w . H`` then
    tells whether the curves do cross or only come close.

    Raises `Undefined` if they do not.
    """
    previous = math.inf
    for iteration in range(1, most + 1):
        value, matrix = curve.equations(z) / curve.rows, _finite(curve.balanced(curve.jacobian(z)))
        left, sizes, right = np.linalg.svd(matrix)
        w, null = left[:, -1], right[-2:]
        n = sizes.size - 1
        rest = -right[:n].T @ (left[:, :n].T @ value / sizes[:n])
        turned = [curve.balanced(along(curve, z, vector * curve.scales)) for vector in null]
        second = _finite(np.stack([w @ change for change in turned]))
        form = second @ null.T  # w^T H_zz on the null space
        c = solve(form, -null @ (w @ matrix) - second @ rest)
        if c is None:
            break
        step = (null.T @ c + rest) * curve.scales
        correction = curve.length(step)
        z = z + step
        size = 1 + curve.length(z)
        stalled = previous / 2 < correction <= GAP * size  # what is left is rounding
        if correction <= 1e-9 * size or stalled:
            found = Solution(z, True, iteration, 0.0, correction)
            resolved = _resolved(curve, found, w, null * curve.scales, form)
            double = (sizes[:n] < GAP * size * abs(form).max()).any()
            return replace(resolved, double=bool(double))
        previous = correction
    raise Undefined("no branch point was found nearby")


def _finite(matrix: Array) -> Array:
    if not math.isfinite(matrix.sum()):
        raise Undefined("the derivatives are not finite")
    return matrix


def _resolved(curve: Curve, found: Solution, w: Array, null: Array, form: Array) -> Crossing:
    """The tangents ``c . N`` with ``c^T form c = 0``, once the curves are seen to cross."""
    z, value = found.z, curve.equations(found.z)
    (low, high), axes = np.linalg.eigh((form + form.T) / 2)
    if not min(-low, high) > _ANGLE * max(-low, high):
        raise Undefined("an isolated point or a touch: no two curves cross at an angle")
    left = max(0.0, abs(w.dot(value / curve.rows)) - abs(w) @ (curve.rounding(z) / curve.rows))
    gap = math.sqrt(left / min(-low, high))
    if gap > GAP * (1 + curve.length(z)):
        raise Undefined(f"the curves pass each other at a distance of {gap:.2g}")
    c = axes @ np.array([[math.sqrt(high)] * 2, [math.sqrt(-low), -math.sqrt(-low)]])
    one, other = c.T @ null
    solution = replace(found, residual=float(abs(value).max()))
    return Crossing(solution, (curve.normalised(one), curve.normalised(other)))


def along(curve: Curve, z: Array, vector: Array) -> Array:
    """Derivative of the Jacobian along a vector in the space of z, or of the unknowns only."""
    direction = np.zeros(z.size)
    direction[: vector.size] = vector
    return derivatives.along(curve.jacobian, z, direction, curve.scales)
