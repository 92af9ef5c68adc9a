"""Ends of walks: starts that are moved onto the curve, windows, and growth without end.

Where a curve runs to infinity z grows and grows, and parameters tend to limits meanwhile. No single
step tells: z has to become several times as long. What is asked of a parameter is relative to the
largest that it was, so that its unit does not matter:

- all of them stay, whatever the limit, as next to a homoclinic orbit while the period grows;
- or one vanishes while others go on, as on curves of folds along which u grows as eps^-2 and lam
  falls as exp(-1/eps). It falls as a power of z may, and does not pass zero, which is much steeper.

A window of what grows, or one of what vanishes that ends short of zero, says how far to go instead.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from copy import copy
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...errors import BadInput, NotConverged
from ..algebra.linear_algebra import LOST, least_singular, sense
from ..algebra.newton import Array, Undefined, approach, newton
from ..algebra.sparse import checked_finite, dense, is_sparse, scaled, shortest
from ..curve.branch import Points
from ..curve.curve import AHEAD, LEVEL, Curve
from ..curve.derivative_checks import check_start, reconsider
from ..curve.point import MANY, Point
from ..curve.problem import Problem
from ..curve.settings import Within, windows
from ..events.step_interpolant import closest_tangent
from ..systems.branch_points import GAP, crossing

QUIET: Any = dict.fromkeys(("over", "invalid", "divide"), "ignore")  # the branch ends, with why

SURFACE = (
    "the equations lose a rank at the start and beside it: solutions fill a surface, and no one "
    "curve leaves it. Where something is conserved, add (total - it) to one of the equations, with "
    "total a parameter; where a symmetry shifts solutions, add an equation that says where the "
    "solution is, and an unknown that multiplies its derivative along the shift"
)

ENDLESS = 3.0  # z has grown when it is so many times as long, relative to 1 + |z|
STILL = 1e-6  # what moves less meanwhile, relative to its largest, stays; what is less has vanished
SMALL = 1e-3  # if it was no more than this all the while
SHARE = 0.1  # the power of |z| from which on something grows with it


# --- windows ----------------------------------------------------------------------------------


@dataclass(frozen=True)
class Bound:
    """The window of what can change: an unknown, a parameter, the norm or the sum of an array.

    Its `ends` are those that are finite: their side, -1 or 1, value, and how far rounding may leave
    a step that should end there.
    """

    name: str
    slot: int | slice
    low: float
    high: float
    ends: list[tuple[int, float, float]]
    total: bool = False

    def value(self, z: Array) -> float:
        entries = z[self.slot]
        if self.total:
            return float(entries.sum())
        return float(entries if isinstance(self.slot, int) else np.linalg.norm(entries))

    def row(self, z: Array) -> Array:
        row, alone = np.zeros(z.size), self.total or isinstance(self.slot, int)
        # d|u| = u . du / |u|
        row[self.slot] = 1.0 if alone else z[self.slot] / (self.value(z) or 1.0)
        return row

    def with_value(self, z: Array, value: float) -> Array:
        """z with exactly this value."""
        z = z.copy()
        if isinstance(self.slot, int):
            z[self.slot] = value
        else:
            z[self.slot] *= value / self.value(z)
        return z


def bounds_of(curve: Curve, within: Within) -> list[Bound]:
    """The window and the domain of the problem, of all that can change."""
    problem = curve.problem
    wanted = {problem.normed(name) or name: window for name, window in within.items()}
    totals = wanted.keys() & problem.totals.keys()
    for name in wanted.keys() & problem.record.keys() - {*problem.names} - totals:
        raise BadInput(
            f"{name!r} is recorded, and has no window; an event ends the branch where it has a "
            f"value: events=[cb.user({name!r}, value, terminal=True)]"
        )
    problem.check_names(name for name in wanted if name not in totals)
    bounds, domains = [], windows(problem.domain_along(curve.free))
    for name in {**domains, **wanted}:
        low, high = wanted.get(name, (-math.inf, math.inf))
        domain = domains.get(name, (-math.inf, math.inf))
        low, high = max(low, domain[0]), min(high, domain[1])
        of = problem.totals[name] if name in totals else name
        value: Any = problem.start.get(of, problem.params.get(of))
        value = np.sum(value) if name in totals else value
        size = float(np.linalg.norm(value)) if np.ndim(value) else float(value)
        if not low < high:
            (low, high), (least, most) = wanted.get(name, domain), domain
            outside = f", outside {least:g} to {most:g}" if low < high else ""
            raise BadInput(f"the window of {name!r} is empty: ({low:g}, {high:g}){outside}")
        what = f"|{name}|" if np.ndim(value) else name
        if what != name and -math.inf < low < 0:
            raise BadInput(
                f"{name!r} is an array: its window is one of its norm, which is never negative; "
                f"got ({low:g}, {high:g})"
            )
        if not low <= size <= high:
            raise BadInput(f"the start has {what}={size:g}, outside ({low:g}, {high:g})")
        if of in curve.slots:
            if low == 0 and (what != name or name in totals):
                low = -math.inf  # no norm falls below 0, no sum of durations before one of them
            finite = [(side, end) for side, end in ((-1, low), (1, high)) if math.isfinite(end)]
            slot = curve.slots[of]
            size = float(np.max(curve.scales[slot]))  # what is 0 is rounded as what it is made of
            ends = [(side, end, 4 * math.ulp(end or size)) for side, end in finite]
            bounds.append(Bound(name, slot, low, high, ends, name in totals))
    return bounds


# --- starts -----------------------------------------------------------------------------------


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
        try:
            curve, residual = corrected_start(problem, free, tolerance)
            checked_finite(curve.jacobian(curve.start))
        except Undefined as error:
            raise BadInput(f"no curve leaves the start: {error}") from error
        bounds = bounds_of(curve, within)
        tangent, sign = first_tangent(curve, bounds)
        if towards != "up":
            tangent, sign = -tangent, -sign
    else:
        curve, residual, tangent = directed_start(problem, free, along)
        bounds, sign = bounds_of(curve, within), 0
    # how far the start that was given had to be moved, if that is worth telling
    # of a solution, not of the mesh that it is given on
    seen = [np.full(np.size(v), n not in problem.internals) for n, v in problem.start.items()]
    moved = curve.start - np.append(problem.x, problem.params[free])
    off = curve.length(moved * np.concatenate([*seen, [True]]))
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
    if not solution.converged and _fill_surface(curve, z, tangent):
        raise BadInput(SURFACE)
    off = curve.length(solution.z - curve.start)
    inside = all(bound.low <= bound.value(solution.z) <= bound.high for bound in domain)
    # so far, relative to 1 + |z|, the nearest solution may be
    if not solution.converged or not inside or off > 0.5 * (1 + curve.length(curve.start)):
        return None
    return Curve(Point(curve, solution.z).problem, curve.free), solution.residual


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
    with suppress(Undefined):
        reconsider(curve, ahead)
        curve.row_scales = np.maximum(curve.row_sizes(ahead), curve.row_scales)
    try:
        value = curve.equations(z) / curve.row_scales
        change = curve.jacobian(z) @ tangent / curve.row_scales
    except Undefined as error:
        raise BadInput(f"no curve leaves the start: {error}") from error
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
        whole = np.vstack([curve.balanced(matrix), along * curve.scales])
        sizes = np.linalg.svd(whole, compute_uv=False)
        singular = bool(sizes[-1] < 1e-7 * sizes[0])
    if singular:
        try:
            branch_point = crossing(curve, z)
            tangent = closest_tangent(branch_point.tangents, curve.metric * along)
            near = curve.length(branch_point.solution.z - z) < GAP * (1 + curve.length(z))
            if near and not _fill_surface(curve, z, tangent):
                return tangent, 0
        except Undefined:
            pass  # no branch point: a fold, or badly scaled equations
    tangent, sign = curve.tangent_at(z, along)
    if singular and _fill_surface(curve, z, tangent):
        raise BadInput(SURFACE)
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


def _fill_surface(curve: Curve, z: Array, tangent: Array) -> bool:
    """Tell whether solutions fill a surface: a rank is lost a little further on as at the start. A
    boundary sets out from a point of a branch, where this was asked."""
    if curve.problem.beneath is not None or not _loses_rank(curve, z):
        return False
    z = z + AHEAD * (1 + curve.length(z)) * tangent
    try:
        # by the shortest of all steps: where a rank is lost no condition makes them regular
        for _ in range(3):
            matrix, value = curve.balanced(curve.jacobian(z)), curve.equations(z) / curve.row_scales
            least = least_singular(matrix).rest if is_sparse(matrix) else partial(shortest, matrix)
            z = z - curve.scales * least(value)
    except Undefined:
        return False
    return _loses_rank(curve, z)


def _loses_rank(curve: Curve, z: Array) -> bool:
    """Tell whether a rank is lost to rounding, whatever the units of unknowns and parameter."""
    matrix = curve.balanced(curve.jacobian(z))
    largest = np.ravel(dense(abs(matrix).max(axis=0)))
    unit = scaled(matrix, np.ones(curve.size), 1 / (largest + (largest == 0)))
    # each column has an entry 1, and of a large matrix the largest singular value is but a bound
    return least_singular(unit).size <= LOST


# --- infinity ---------------------------------------------------------------------------------


@dataclass
class Tendency:
    """Course of a parameter while z grows."""

    name: str
    slot: int  # in z
    largest: float  # size it had
    reaches: bool  # its window has zero in it
    moved: float = math.nan  # value where it last moved
    since: float = math.inf  # 1 + |z| there
    small: float = math.inf  # 1 + |z| from where on it has been small; infinite where it is not

    def passes(self, value: float, slope: float, size: float) -> bool:
        """The next value, its derivative along the curve, and the length of z there; whether it
        tends to zero: ``d log|value| / d log|z|`` is negative, and not as steep as where it passes
        zero. e^-x falls as x^-33 where a curve ends."""
        self.largest = max(self.largest, abs(value))
        # what its moves are compared with: where zero is not to be reached, its own size
        if not abs(value - self.moved) <= STILL * (self.largest if self.reaches else abs(value)):
            self.moved, self.since = value, 1.0 + size
        small = abs(value) <= SMALL * self.largest
        self.small = min(self.small, 1.0 + size) if small else math.inf
        less = abs(value) <= STILL * self.largest and size > ENDLESS * self.small
        falls = 0.0 < -slope * math.copysign(size, value) < 50.0 * abs(value)
        return self.reaches and less and falls

    def moves_on(self, values: Array, sizes: Array) -> bool:
        """Take several values at once, if each is another than the one before and none is small."""
        largest = max(self.largest, float(abs(values).max()))
        unit = largest if self.reaches else abs(values)
        moves = abs(np.diff(values, prepend=self.moved)) > STILL * unit
        if not (moves & (abs(values) > SMALL * largest)).all():
            return False
        self.largest, self.small = largest, math.inf
        self.moved, self.since = float(values[-1]), 1.0 + float(sizes[-1])
        return True


class Growth:
    """Growth of z along a walk."""

    def __init__(self, curve: Curve, bounds: Sequence[Bound], start: Array) -> None:
        self.curve, self.first = curve, 1.0 + curve.length(start)
        self.bounds, self.tendencies = bounds, list[Tendency]()
        for name in curve.varied:
            slot = curve.slots[name]
            reaches = all(b.low <= 0.0 <= b.high for b in bounds if b.name == name)
            self.tendencies.append(Tendency(name, slot, abs(float(start[slot])), reaches))

    def end(self, points: Points) -> tuple[int, str] | None:
        """The first of several points beyond which nothing is to come, and what z tends to."""
        if len(points) >= MANY:
            sizes = np.sqrt(points.z**2 @ self.curve.metric)
            if all(param.moves_on(points.z[:, param.slot], sizes) for param in self.tendencies):
                return None
        for i, (z, tangent) in enumerate(zip(points.z, points.tangent, strict=True)):
            size, gone, since = self.curve.length(z), list[str](), 0.0
            for param in self.tendencies:
                value = float(z[param.slot])
                if param.passes(value, float(tangent[param.slot]), size):
                    gone.append(
                        f"{param.name} vanishes, {value:.3g} of at most {param.largest:.3g}"
                    )
                since = max(since, param.since)
            if (gone or size > ENDLESS * since) and not self._bounded(z, tangent, size):
                limits = [f"{param.name} tends to {z[param.slot]:.6g}" for param in self.tendencies]
                grows = self._growing(z) or "the solution"
                return i, f"{grows} grows without bound while {', '.join(gone or limits)}"
        return None

    def towards(self, z: Array, tangent: Array) -> str:
        """Say what grows where a walk took as many steps as allowed; empty if nothing does."""
        size, along = self.curve.length(z), z * self.curve.metric @ tangent
        outwards = along > 0.9 * size > 0.9 * ENDLESS * self.first  # by their cosine
        if not outwards or self._bounded(z, tangent, size):
            return ""
        grows = self._growing(z)
        window = grows or self.tendencies[-1].name  # of the solution a parameter tells how far
        if not grows and any(b.name == window and len(b.ends) == 2 for b in self.bounds):
            grows = window = self._growing_total(z, tangent, size)
            if not window:
                return ""
        return (
            f"{grows or 'the solution'} grows, and no window ends it; give one, "
            f"within={{{window!r}: (low, high)}}"
        )

    def _growing(self, z: Array) -> str:
        slots = self.curve.slots.items()
        parts = {n: float(np.dot(z[at] ** 2, self.curve.metric[at])) for n, at in slots}
        most = max(parts, key=lambda name: parts[name])
        return "" if most in self.curve.problem.internals else most

    def _growing_total(self, z: Array, tangent: Array, size: float) -> str:
        """The sum that grows with z, as a period does."""
        for name, of in self.curve.problem.totals.items():
            value, rate = (float(np.sum(entries[self.curve.slots[of]])) for entries in (z, tangent))
            if rate * size > SHARE * value > 0.0:
                return name
        return ""

    def _bounded(self, z: Array, tangent: Array, size: float) -> bool:
        """Tell whether a window says how far something may go that grows with z."""
        for bound in self.bounds:
            value, rate = bound.value(z), float(bound.row(z) @ tangent)
            if rate * size > SHARE * value >= 0.0 and math.isfinite(bound.high):
                return True
            if rate * size < SHARE * value <= 0.0 and math.isfinite(bound.low):
                return True
        return False
