"""Bordered Newton iteration: n equations, n + 1 unknowns, one linear condition to choose."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from .sparse import Dense, Factors, Matrix, is_large, is_sparse, scaled, shortest
from .sparse import Undefined as Undefined
from .walk_kernel import LARGE

Array = NDArray[np.float64]

# What equations raise where they have no value: `BadInput` and ``math.sqrt(-1.0)`` among them, both
# ValueError. Anything else is a bug and must surface.
OUT_OF_DOMAIN = (ValueError, ArithmeticError)

FEW = 13  # entries of z: beyond a dozen unknowns factors are worth keeping
_REUSED = 1e-5  # of a correction this short, relative to 1 + |z|, the square is rounding
_SHRINKS = 0.3  # at least by as much corrections shrink with factors from near by
_EXACT = 1e-3  # of the tolerance: what may be left then, where Newton's would leave a square


@dataclass(frozen=True, slots=True)
class Solution:
    """End of a Newton iteration, and whether that is a solution."""

    z: Array
    converged: bool
    iterations: int
    residual: float  # largest entry of the equations at z


class Equations(Protocol):
    """Equations to solve, as a `Curve` has them."""

    metric: Array

    @property
    def row_scales(self) -> Array: ...
    def equations(self, z: Array) -> Array: ...
    def jacobian(self, z: Array) -> Matrix: ...
    def length(self, z: Array) -> float: ...


def newton(
    curve: Equations, z: Array, row: Array | None = None, *, tolerance: float = 1e-9, most: int = 12
) -> Solution:
    """Solve ``H(z) = 0`` together with ``row . (z - z_start) = 0``.

    Without `row` there are as many equations as unknowns, and one fewer with it. It ends with a
    correction of at most ``tolerance (1 + |z|)``, and then is far more exact, being quadratic; for
    a large z each entry has to be as exact. A correction that grows ends it, too, but by rounding:
    a solution still where all that is left of the equations is rounding, as of stiff ones, or
    beside a branch point.
    Raises `Undefined` where the equations have no value.
    """
    size = 1.0 + curve.length(z)
    previous = left = math.inf
    bound, reuse = tolerance * size, False
    for iteration in range(1, most + 1):
        value = curve.equations(z)
        if not reuse:
            matrix = curve.jacobian(z)
            factors = Factors(matrix) if is_large(matrix) else Dense(matrix, row)
        step, singular = factors.correction(value, row)
        moved = curve.length(step)
        if not moved < math.inf:
            raise Undefined("the Newton correction is not finite")
        # |dz_k| / |dz_k-1| estimates the contraction (P. Deuflhard, Newton Methods for Nonlinear
        # Problems, section 2.1): from 1/2 on the iteration is not in its quadratic phase
        slow = 2.0 * moved > previous
        # beside a large entry a correction of the others is short wherever they are
        short = together = moved <= bound
        if short and bound >= LARGE * tolerance:
            short = _each_is_short(curve, z - step, step, tolerance)
        if slow and not short:
            solved = bool((abs(value) <= rounding(matrix, z)).all())
            solved = solved or (together and _blindly_solved(curve, matrix, z, value))
            residual = float(abs(value).max())
            # where rounding decides how long corrections are one may have been short by chance:
            # the next one grows by less than the residual falls
            chance = moved <= _REUSED * size and moved * residual < previous * left
            if solved or (moved > 2.0 * previous and not chance):
                return Solution(z, solved, iteration, residual)
        z = z - step
        if short:
            value, solved = curve.equations(z), True
            if singular:  # the shortest correction may be short far from any solution
                solved = _blindly_solved(curve, matrix, z, value)
            return Solution(z, solved, iteration, float(abs(value).max()))
        # J may stay: off by O(|dz|), it changes the next correction, O(|dz|^2), by O(|dz|^3)
        # and no curvature is in the way where it is so much shorter than the one before
        reuse = z.size > FEW and moved <= min(_REUSED * size, 1e-2 * previous)
        previous, left = moved, float(abs(value).max())
    return Solution(z, False, most, float(abs(curve.equations(z)).max()))


def chord(
    curve: Equations,
    roughly: Callable[[Array], Array] | None,
    factors: Dense | Factors,
    z: Array,
    row: Array,
    tolerance: float,
    ahead: float,
) -> Solution | None:
    """Solve as `newton` does by the factors of a derivative near by, as long as corrections are
    short beside the step, so long, and shrink fast; None where they do not. It counts as one
    iteration.

    What corrections have told of the derivative is made use of by Broyden's updates (C. T. Kelley,
    Iterative Methods for Linear and Nonlinear Equations, section 7.3). Equations that are dear are
    known `roughly`, too: at first they need be no more exact than the next correction, and the
    last one, which is too short to matter, is not made.
    """
    size = 1.0 + curve.length(z)
    value, most = (roughly or curve.equations)(z), _SHRINKS * ahead
    steps: list[Array] = []
    while True:
        step, singular = factors.correction(value, row)
        for i, past in enumerate(steps):
            dual = past * curve.metric
            along = dual.dot(step) / dual.dot(past)
            if along == 1.0:  # as long as that one still, where rounding is all there is
                return None
            # B_i+1^-1 = (1 + s_i+1 s_i^T / |s_i|^2) B_i^-1, and of the last one s is not known yet
            step = step / (1 - along) if i == len(steps) - 1 else step + along * steps[i + 1]
        moved = curve.length(step)
        solved = (steps or not moved) and moved <= _EXACT * tolerance * size and not singular
        if solved and not roughly:
            # it leaves the share of itself by which it is shorter than the one before
            solved = moved > most or moved * moved <= _EXACT**2 * tolerance * size * most
        if solved and (size < LARGE or _each_is_short(curve, z, step, tolerance)):
            if not roughly:
                z = z - step
                value = curve.equations(z)
            return Solution(z, True, 1, float(abs(value).max()))
        if singular or not moved <= most:
            return None
        steps.append(step)
        z, most = z - step, _SHRINKS * moved
        value = curve.equations(z)


def _blindly_solved(curve: Equations, matrix: Matrix, z: Array, value: Array) -> bool:
    """Tell whether what is left is small beside the terms of its row: a solution, where Newton's
    iteration is blind."""
    terms = abs(matrix) @ (abs(z) + curve.metric**-0.5)
    terms[terms == 0] = 1.0  # one that no entry of z moves is compared with 1
    return bool((abs(value) <= 1e-12 * terms).all())


def _each_is_short(curve: Equations, z: Array, step: Array, tolerance: float) -> bool:
    """Tell whether a correction is short in each entry, relative to that and to its scale."""
    return bool((abs(step) <= tolerance * (abs(z) + curve.metric**-0.5)).all())


def approach(curve: Equations, z: Array) -> Array | None:
    """Go from anywhere to where full steps of Newton's iteration are short; None if that fails.

    A step is cut until the next one from there, for the same derivative, would be shorter
    (P. Deuflhard, Newton Methods for Nonlinear Problems, section 3.3): that sees through any
    mixing of the equations. With more unknowns than equations the shortest of all steps is taken.
    """
    # dz = W^-1/2 y: the least dz in arclength is the shortest y with J W^-1/2 y = H
    weights = curve.metric**-0.5
    damping = 1.0
    value = curve.equations(z)
    for _ in range(50):
        matrix = scaled(curve.jacobian(z), np.ones(value.size), weights)
        least: Callable[[Array], Array]
        if is_sparse(matrix) or value.size == z.size:
            least = (Factors if is_sparse(matrix) else Dense)(matrix).least
        else:
            least = partial(shortest, matrix, rows=curve.row_scales)
        step = least(value)
        size = math.sqrt(step.dot(step))
        if size == 0:  # a solution, or the derivative is singular and tells nothing
            return None if value.any() else z
        # of one this short rounding may decide whether the next is shorter
        if size <= 1e-10 * (1 + curve.length(z)):
            return z
        while damping > 1e-6:
            try:
                trial = z - damping * step * weights
                value = curve.equations(trial)
                simplified = least(value)
                ahead = math.sqrt(simplified.dot(simplified))
            except Undefined:
                ahead = math.inf
            # restricted natural monotonicity: |J(z)^-1 H(trial)| <= (1 - lambda / 4) |J(z)^-1 H(z)|
            if ahead <= (1 - damping / 4) * size:
                break
            damping /= 2
        else:
            return None
        z = trial
        # a full step this short has arrived
        if damping == 1 and ahead <= 1e-3 * (1 + curve.length(z)):
            return z
        # tried twice as long next time: only full steps converge quadratically
        damping = min(1.0, 2 * damping)
    return None


def rounding(matrix: Matrix, z: Array) -> Array:
    """Bound what rounding leaves of equations at a solution, by their derivative there."""
    # sums of terms that round once each were never seen to be off by more
    return np.asarray(4 * math.ulp(1.0) * (abs(matrix) @ abs(z)))
