"""More points on a branch that is known already: solved for, not interpolated."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

from ..checks import check_kind, number, whole
from .branch import Branch
from .interpolant import StepInterpolant
from .newton import OUT_OF_DOMAIN, Undefined
from .point import Point

_CLOSE = 1e-8  # neighbours closer than this, relative to 1 + |z|, have nothing between them


def refined(branch: Branch, fewest: int, *, tolerance: float = 1e-11) -> Branch:
    """The same branch with at least `fewest` points, evenly along it, as far as Newton's iteration
    finds them; what it had stays.

    Parameters
    ----------
    branch : Branch
    fewest : int
    tolerance : float
        Of Newton's iteration at the new points.

    Examples
    --------
    >>> import numpy as np, contbreather as cb
    >>> circle = cb.Problem(lambda x, p: np.array([x[0]**2 + p["mu"]**2 - 1]),
    ...                     start={"x": 1.0}, params={"mu": 0.0})
    >>> fine = refined(cb.trace(circle, "mu"), 300)
    >>> len(fine) >= 300, bool(abs(fine["residual"]).max() < 1e-14)
    (True, True)
    """
    check_kind(branch, Branch, "a Branch")
    if len(branch) >= whole("fewest", fewest, 1):
        return branch
    tolerance = number("tolerance", tolerance, 0.0, 1.0, "a relative size")
    spacing = (branch[-1].arclength - branch[0].arclength) / fewest
    points = [point for pair in pairwise(branch) for point in _filled(*pair, spacing, tolerance)]
    return replace(branch, points=(*points, branch[-1]))


def between(first: Point, last: Point, *, tolerance: float = 1e-9) -> Point | None:
    """The point halfway between two neighbours of a branch, solved for; None where they are one
    but for rounding, or none is found: on a branch without its equations, for instance.
    """
    if last.arclength - first.arclength <= _CLOSE * (1 + first.curve.length(first.z)):
        return None
    try:
        return StepInterpolant(first, last, tolerance).at(0.5)
    except OUT_OF_DOMAIN:
        return None


def _filled(first: Point, last: Point, spacing: float, tolerance: float) -> Iterator[Point]:
    """The first of two neighbours and as many between them as the spacing asks for."""
    yield first
    pieces = math.ceil((last.arclength - first.arclength) / spacing)
    segment = StepInterpolant(first, last, tolerance)
    for i in range(1, pieces):
        try:
            point = segment.at(i / pieces)
        except Undefined:
            continue  # left out rather than interpolated
        yield point
