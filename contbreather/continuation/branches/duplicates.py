"""Duplicate branches: whether a solution is on one that is known, itself, by a symmetry, or as one
of a smaller problem."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from ...errors import NotConverged
from ..algebra.newton import OUT_OF_DOMAIN, Array
from ..curve.branch import Branch, Stop
from ..curve.curve import Curve
from ..curve.point import Point
from ..events.step_interpolant import StepInterpolant
from ..systems.branch_points import GAP

_OFF = 0.1  # how far off the chord of a step its curve may be, relative to the step


def lies_on(point: Point, branch: Branch, reach: float = math.inf) -> bool:
    """Tell whether a solution lies on a branch between its ends; False where it cannot be decided.

    `reach` is the distance from a place where curves meet to the point on one of them: what is less
    close than a thousandth of it is on another one.
    """
    z = placed(point, branch.curve)
    if z is None or len(branch) < 2:
        return z is not None and _same(branch.curve, branch[0].z, z, reach)
    return any(_on_segment(z, reach, *branch.points[i : i + 2]) for i in _near(z, branch))


def placed(point: Point, curve: Curve) -> Array | None:
    """The z of a solution among the unknowns and free parameters of a curve, if it fits in."""
    problem, target = point.curve.problem, curve.problem
    if problem.slots != target.slots or set(problem.params) != set(target.params):
        return None
    params = point.params
    for name, value in curve.fixed.items():
        scale = float(target.scales.get(name, 1.0))
        if name not in curve.free and abs(params[name] - value) > GAP * max(abs(value), scale):
            return None
    return np.append(point.x, [params[name] for name in curve.free])


def _same(curve: Curve, z: Array, other: Array, reach: float = math.inf) -> bool:
    z = curve.turned(z, other)
    # and, relative to the way from the place that both come from, this
    return curve.length(z - other) <= min(GAP * (1 + curve.length(z)), 1e-3 * reach)


def _near(z: Array, branch: Branch) -> list[int]:
    """The steps of a branch that pass z at a small distance."""
    curve, places = branch.curve, branch.points.z
    weights = np.sqrt(curve.metric)
    chords = np.diff(places, axis=0) * weights
    lengths = np.maximum((chords**2).sum(axis=1), 1e-300)
    to = (curve.turned(z, places[:-1]) - places[:-1]) * weights
    # the nearest place of each chord; curves bulge from it by a fraction _OFF of its length at most
    u = np.clip((to * chords).sum(axis=1) / lengths, 0.0, 1.0)
    gaps = np.sqrt(((to - u[:, None] * chords) ** 2).sum(axis=1))
    close = gaps <= _OFF * np.sqrt(lengths) + GAP * (1 + curve.length(z))
    return np.flatnonzero(close).tolist()


def _on_segment(z: Array, reach: float, first: Point, last: Point) -> bool:
    """Tell whether z is the point of the curve between two neighbours, found anew beside it."""
    curve = first.curve
    z = curve.turned(z, first.z)
    if _same(curve, first.z, z, reach) or _same(curve, last.z, z, reach):
        return True
    segment, chord = StepInterpolant(first, last, 1e-9), curve.metric * (last.z - first.z)
    if segment.length < GAP * (1 + curve.length(z)):
        return False
    u = float(chord @ (z - first.z) / (chord @ (last.z - first.z)))
    if not 0.0 < u < 1.0:
        return False
    guess, _ = segment.guess(u)
    # beside a branch point Newton's iteration finds its solution to rounding over the distance from
    # there, or ends on the other curve
    if _same(curve, guess, z, reach):
        return True
    try:
        return _same(curve, segment.at(u).z, z, reach)
    except OUT_OF_DOMAIN:
        return bool(curve.length(guess - z) < 1e-3 * min(segment.length, reach))


@dataclass(frozen=True)
class Duplicate:
    """Branch that has a solution, as an image or in a smaller problem perhaps."""

    branch: int
    image: bool = False
    simpler: bool = False


def duplicate_of(
    point: Point, branches: Iterable[Branch], reach: float = math.inf
) -> Duplicate | None:
    """The first of `branches` on which a solution lies, itself or one of its images."""
    branches = list(branches)

    def number(there: Point) -> int | None:
        return next((i for i, each in enumerate(branches) if lies_on(there, each, reach)), None)

    if (i := number(point)) is not None:
        return Duplicate(i)
    small = simplest(point, reach)
    if small is not point:
        duplicate = duplicate_of(small, branches, reach)
        return duplicate and replace(duplicate, simpler=True)
    numbers = (i for image in images(point) if (i := number(image)) is not None)
    return next((Duplicate(i, image=True) for i in numbers), None)


def ending_at(start: Point, branches: Iterable[Branch]) -> Duplicate | None:
    """The branch that ends where another sets out, of the same solution: from its other end."""
    numbers = start.curve.problem.invariants(start)
    if numbers is None:
        return None
    for i, branch in enumerate(branches):
        for end, stop in ((branch[0], branch.began), (branch[-1], branch.stop)):
            ended = end.event and stop is Stop.EVENT
            known = end.curve.problem.invariants(end) if ended else None
            alike = known is not None and known.size == numbers.size
            if alike and (abs(known - numbers) <= GAP * (1.0 + abs(numbers))).all():
                return Duplicate(i)
    return None


def images(point: Point) -> Iterator[Point]:
    for x in point.curve.problem.images(point.x.copy(), point.params):
        z = point.z.copy()
        z[: point.curve.size] = x
        yield replace(point, z=z)


def simplest(point: Point, reach: float = math.inf) -> Point:
    """The solution in the smallest problem that has it; `reach` as for `lies_on`."""
    small = point.curve.problem.simpler(point)
    if small is None:
        return point
    if not math.isinf(reach):  # its start has to be a solution, and not only close to one
        try:
            solved, _ = small.solve()
        except NotConverged:
            return point
        if not _same(Curve(small, ()), small.x, solved.x, reach):
            return point
    curve = Curve(small, point.curve.free)
    return simplest(Point(curve, curve.start, residual=point.residual), reach)


def same_place(point: Point, other: Point) -> bool:
    """Tell whether two points are the same solution, of the same or of a smaller problem."""
    point, other = simplest(point), simplest(other)
    z = placed(point, other.curve)
    return z is not None and _same(other.curve, other.z, z)
