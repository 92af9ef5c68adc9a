"""Starts of walks: moved onto the curve, with the tangent along which to set out."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...errors import BadInput, NotConverged
from ..algebra.linear_algebra import least_singular, sense
from ..algebra.newton import Array, Undefined, approach, newton
from ..algebra.sparse import is_sparse, scaled
from ..curve.curve import AHEAD, LEVEL, Curve
from ..curve.derivative_checks import check_start, reconsider
from ..curve.point import Point
from ..curve.problem import Problem
from ..curve.settings import Within
from ..events.step_interpolant import closest_tangent
from ..systems.branch_points import GAP, crossing
from .window import Bound, bounds_of

QUIET: Any = dict.fromkeys(("over", "invalid", "divide"), "ignore")  # the branch ends, with why


@dataclass(frozen=True)
class StartOnCurve:
    """Start of a walk on its curve, and the way it sets out."""

    point: Point  # with the tangent along which to set out
    sign: int  # of the bordered determinant; 0 at a branch point, and where it is not known
    bounds: list[Bound]
    directed: bool  # the direction was given


@np.errstate(**QUIET)
def starts_on_curve(
    problem: Problem,
    free: str,
    within: Within,
    towards: str,
    along: ArrayLike | None,
    tolerance: float,
) -> list[StartOnCurve]:
    """A start moved onto its curve, in the direction that was asked for; for 'both' downwards, and
    then upwards."""
    if along is None:
        curve, residual = corrected_start(problem, free, tolerance)
        bounds = bounds_of(curve, within)
        tangent, sign = first_tangent(curve, bounds)
        if towards != "up":
            tangent, sign = -tangent, -sign
    else:
        curve, residual, tangent = directed_start(problem, free, along)
        bounds, sign = bounds_of(curve, within), 0
    # how far the start that was given had to be moved, if that is worth telling
    off = curve.length(curve.start - np.append(problem.x, problem.params[free]))
    detail = {"moved": off} if off > 1e-3 * (1 + curve.length(curve.start)) else {}
    point = Point(curve, curve.start, tangent, 0.0, residual, detail=detail)
    first = StartOnCurve(point, sign, bounds, along is not None)
    if towards != "both" or first.directed:
        return [first]
    back = replace(point, curve=copy(curve), tangent=-tangent)  # on a curve that learns by itself
    return [first, replace(first, point=back, sign=-sign)]


def corrected_start(problem: Problem, free: str, tolerance: float) -> tuple[Curve, float]:
    """The curve with its start on it, and the residual there.

    A start that is a solution to rounding is taken as it is: at a fold or a branch point, where
    Newton's iteration at a fixed parameter is singular, it could only get worse. Where none is
    found at the same parameter, the nearest one with another value of it is.
    """
    curve = Curve(problem, (free,))
    domain = bounds_of(curve, {})  # outside of it there is nothing to solve
    value = check_start(curve)
    if (  # a solution already, to rounding of its rows
        abs(value) <= 1e-14 * curve.row_scales * (1 + abs(curve.start / curve.scales).max())
    ).all():
        return curve, float(abs(value).max())
    try:
        problem, solution = problem.solve(tolerance=tolerance)
    except NotConverged:
        nearest = _nearest(curve, domain, tolerance)
        if nearest is None:
            raise
        return nearest
    return Curve(problem, (free,)), solution.residual


def _nearest(curve: Curve, domain: Sequence[Bound], tolerance: float) -> tuple[Curve, float] | None:
    """The curve started at a solution near by, by the least correction in unknowns and parameter:
    just beyond a fold there is none at the same parameter."""
    try:
        z = approach(curve, curve.start)
        if z is None:
            return None
        # across the tangent: at a fixed parameter the iteration is singular at a fold
        tangent, _ = curve.tangent_at(z, np.eye(1, z.size, z.size - 1)[0])
        solution = newton(curve, z, curve.metric * tangent, tolerance=tolerance)
    except Undefined:
        return None
    moved = Point(curve, solution.z, tangent, 0.0, solution.residual)
    off = curve.length(solution.z - curve.start)
    inside = all(bound.low <= bound.value(solution.z) <= bound.high for bound in domain)
    # so far, relative to 1 + |z|, the nearest solution may be
    if not solution.converged or not inside or off > 0.5 * (1 + curve.length(curve.start)):
        return None
    return Curve(moved.problem, curve.free), solution.residual


def directed_start(problem: Problem, free: str, along: ArrayLike) -> tuple[Curve, float, Array]:
    """The curve, the residual at its start, and the tangent there, both as they were given."""
    curve = Curve(problem, (free,))
    check_start(curve)
    try:
        tangent = np.asarray(along, dtype=float)
    except (TypeError, ValueError, OverflowError) as error:
        raise BadInput(f"a direction of numbers was expected, got {along!r}") from error
    if tangent.shape != curve.start.shape or not 0 < curve.length(tangent) < math.inf:
        raise BadInput(f"a direction of shape {curve.start.shape} was expected, got {along!r}")
    tangent, z = curve.normalised(tangent), curve.start
    # where curves cross the derivatives may vanish: how to take them, and their size, is seen a
    # little further on
    ahead = z + AHEAD * (1 + curve.length(z)) * tangent
    with contextlib.suppress(Undefined):
        reconsider(curve, ahead)
        curve.row_scales = np.maximum(curve.row_sizes(ahead), curve.row_scales)
    try:
        value, change = (
            curve.equations(z) / curve.row_scales,
            curve.jacobian(z) @ tangent / curve.row_scales,
        )
    except Undefined as error:
        raise BadInput(f"the equations have no derivatives at the start: {error}") from error
    off, skew = abs(value).max(), abs(change).max()
    if off > GAP * (1 + curve.length(z)) or skew > 1e-3:
        raise BadInput(
            f"no curve leaves the start in this direction: the residual there is {off:.2g}, "
            f"and {skew:.2g} is its change along the direction"
        )
    return curve, float(abs(value * curve.row_scales).max()), tangent


def first_tangent(curve: Curve, bounds: Sequence[Bound]) -> tuple[Array, int]:
    """The tangent at the start, upwards in the free parameter, and the sign of the determinant.

    At a branch point it is that of the curve closest to the direction of the parameter. At a fold,
    where that does not change at first, the curve leads away from the bound that it starts at, and
    else to where the leading unknown grows: neither is left to the sign of what rounding leaves.
    """
    z, matrix = curve.start, curve.jacobian(curve.start)
    along = np.eye(1, z.size, z.size - 1)[0]
    if is_sparse(matrix):  # fine meshes have small singular values everywhere
        weak = least_singular(scaled(matrix, 1 / curve.row_scales, curve.scales))
        singular = weak.size < 1e-4 * weak.second
    else:
        # with the row of the parameter below: singular at folds as well as where curves cross
        sizes = np.linalg.svd(np.vstack([matrix, along]) * curve.scales, compute_uv=False)
        singular = bool(sizes[-1] < 1e-7 * sizes[0])
    if singular:
        try:
            branch_point = crossing(curve, z)
            if curve.length(branch_point.solution.z - z) < GAP * (1 + curve.length(z)):
                return closest_tangent(branch_point.tangents, curve.metric * along), 0
        except Undefined:
            pass  # no branch point: a fold, or badly scaled equations
    tangent, sign = curve.tangent_at(z, along)
    # a parameter that changes by less, of the length of the curve: nearly a fold
    if abs(tangent[-1]) > 1e-3:
        return tangent, sign
    if abs(tangent[-1]) <= LEVEL:
        # away from the first bound that the curve starts at and does not go along
        slopes = [
            side * float(bound.row(z) @ tangent)
            for bound in bounds
            for side, end, off in bound.ends
            if abs(bound.value(z) - end) <= off
        ]
        slope = next((slope for slope in slopes if abs(slope) > LEVEL), -float(sense(tangent)))
        tangent = -math.copysign(1.0, slope) * tangent
    # across the parameter that determinant is the less certain the less it changes
    return curve.tangent_at(z, tangent)
