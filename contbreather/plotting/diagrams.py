"""Arms and whole diagrams: every branch against one number that all of them have."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from contbreather.checks import check_kind
from contbreather.continuation.branch import Branch, refined, with_columns
from contbreather.continuation.diagram import Diagram
from contbreather.continuation.point import Point
from contbreather.errors import BadInput
from contbreather.plotting.branches import ordinates, plot_branches
from contbreather.plotting.canvas import Drawn

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SMOOTH = 60  # points of a drawn branch


def plot_diagram(
    tree: Diagram | Branch | Sequence[Branch],
    *,
    x: str | None = None,
    y: str | Callable[[Point], float] | None = None,
    ax: Axes | None = None,
) -> Drawn:
    """Draw all branches of a diagram as `plot` does branches, also where their problems differ.

    Parameters
    ----------
    tree : Diagram, Branch, or sequence of Branch
    x : str, optional
        The free parameter unless given.
    y : str or callable, optional
        A column, or ``y(point)``, the number to draw. By default the first unknown that all
        branches have; of breathers and orbits the time of the first impact. Branches without
        the column are left out.
    ax : matplotlib Axes, optional
        A new figure of the width of a journal column unless given.

    Returns
    -------
    Drawn
        The artists, with their ``axes`` and ``figure``.

    Raises
    ------
    BadInput
        If there is nothing to draw.

    Examples
    --------
    >>> import contbreather as cb, numpy as np
    >>> mine = cb.Problem(lambda x, p: np.array([x[0] * (p["mu"] - x[0]**2)]),
    ...                   start={"x": 0.0}, params={"mu": -1.0})
    >>> tree = cb.diagram(mine, "mu", within={"mu": (-1, 1)}, events=[cb.branch_point()])
    >>> ax = plot_diagram(tree).axes
    >>> ax.get_xlabel(), ax.get_ylabel(), len(ax.get_lines()) >= 3
    ('$\\mu$', 'x', True)
    """
    alone = isinstance(tree, Branch) or not np.iterable(tree)
    branches: list[Any] = [tree] if alone else list(tree)
    for branch in branches:
        check_kind(branch, Branch, "a diagram, or a sequence of branches,")
    if not branches:
        raise BadInput("there is no branch to draw")
    y = _common(branches) if y is None else y
    if not callable(y):
        check_kind(y, str, "the name of a column, or a function of a point,")
    if callable(y):
        name = getattr(y, "__name__", "y")
        branches = [with_columns(branch, **{name: y}) for branch in branches]
        y = name
    drawable = [branch for branch in branches if {*ordinates(branch, y)} <= {*branch.names}]
    shown = [refined(branch, SMOOTH) for branch in drawable]
    if not shown:
        there = sorted({name for branch in branches for name in branch.tabulated()} - {"label"})
        raise BadInput(f"no branch has a column {y!r}; there are {there}")
    return plot_branches(*shown, x=x, y=y, ax=ax)


def _common(branches: Sequence[Branch]) -> str | Callable[[Point], float]:
    """What to draw where nothing was said."""
    problems = [branch.problem for branch in branches]
    unknowns = [[n for n in problem.start if n not in problem.internals] for problem in problems]
    if all("phi" in names or "t1" in names for names in unknowns):
        return t1
    common = [name for name in unknowns[0] if all(name in names for names in unknowns)]
    return (common or unknowns[0])[0]


def t1(point: Point) -> float:
    """When site 0 hits the wall +1: breathers and orbits all have it, arms differ in it."""
    return float(point["t1" if "t1" in point.curve.problem.start else "phi"])
