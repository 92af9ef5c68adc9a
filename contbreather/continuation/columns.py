"""Columns on a branch that its problem did not record."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import replace
from typing import Any

from .branch import Branch
from .point import Point


def with_columns(branch: Branch, **columns: Callable[[Point], Any]) -> Branch:
    """The same branch with more recorded columns, to draw or to save them.

    Parameters
    ----------
    branch : Branch
    **columns : callable
        ``name=function``, with ``function(point)`` the number that is wanted.

    Examples
    --------
    >>> import contbreather as cb
    >>> branch = cb.trace(cb.symmetric(0.5, 0.04, 0.8), "a", within={"a": (0.5, 0.6)})
    >>> more = with_columns(branch, height=lambda point: point.displacement(1, 0.0))
    >>> round(float(more["height"][0]), 9)
    0.552886482
    """
    problem, curve = branch.problem, copy(branch.curve)
    curve.problem = replace(problem, record={**problem.record, **columns})

    def moved(point: Point) -> Point:
        return replace(point, curve=curve)

    points, doubtful = map(moved, branch.points), map(moved, branch.doubtful)
    return replace(branch, points=tuple(points), doubtful=tuple(doubtful))
