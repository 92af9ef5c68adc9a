"""`contbreather branch`: breathers along one parameter, with what happens to them on the way."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

import contbreather as cb
from contbreather.cli.interrupts import kept
from contbreather.cli.options import (
    Axes,
    BranchWindow,
    ModelOptions,
    Output,
    SavedOutput,
    StepSizes,
    Whole,
)
from contbreather.cli.output import branch_entry, branch_table, check_ends, lines_of


def branch(
    where: ModelOptions = ModelOptions(),
    along: BranchWindow = BranchWindow(),
    *,
    towards: Literal["both", "up", "down"] = "both",
    root: Whole | None = None,
    sizes: StepSizes = StepSizes(),
    axes: Axes = Axes(),
    into: SavedOutput = SavedOutput(),
) -> None:
    """A branch of breathers in one parameter, with its special points.

    It starts at the value of the free parameter, if one is given, or at a breather that is
    found in the window.

    Parameters
    ----------
    towards
        Direction in which the parameter changes at first.
    root
        Which solution of (11), in order of decreasing p, where there are several; unless given the
        first, and another only where that is no breather.
    """
    into.check(where.read)
    steps, start = sizes.steps(), along.start(where, root)
    axes.check(into.output, start.problem)
    options: dict[str, Any] = {"within": start.within, "towards": towards, "save": into.save}
    traced, cut = kept(cb.continuation.trace, start.problem, start.free, steps=steps, **options)
    leave(traced, "branch", start.entry(), into, cut, axes)


def leave(
    branch: cb.Branch,
    what: str,
    about: Mapping[str, Any],
    into: Output,
    cut: bool,
    axes: Axes = Axes(),
) -> None:
    """All that is wanted of one branch or boundary; raise if it broke off."""
    into.leave(
        lambda: {**about, **branch_entry(branch)},
        lines_of(branch),
        lambda: branch_table([branch]),
        lambda: axes.plot(branch),
        cut=cut,
    )
    check_ends(branch, what)
