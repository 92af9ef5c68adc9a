"""`contbreather extend`: a branch that was kept, followed further."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Literal

import contbreather as cb
from contbreather.cli.branch import leave
from contbreather.cli.interrupts import kept
from contbreather.cli.options import SavedOutput, Span, Whole
from contbreather.cli.show import opened
from contbreather.errors import BadInput
from contbreather.files import identity


def extend(
    run: str | None = None,
    name: str | None = None,
    /,
    *,
    window: Span | None = None,
    end: Literal["both", "last", "first"] = "both",
    most: Whole | None = None,
    into: SavedOutput = SavedOutput(),
) -> None:
    """Follow a branch or a boundary that was kept further, and keep it where it was.

    Its equations, its events and its steps are those it was asked for with.

    Parameters
    ----------
    run
        The file, or the folder, that --save has kept.
    name
        Which of its results; needed where there are several.
    window
        Lowest and highest value of the free parameter, wider than before.
    end
        At which end to go on.
    most
        Number of steps after which it ends, at each end.
    """
    from contbreather.continuation.checkpoint import Checkpoint, Inner

    results = opened(run)
    branch, place, key = _chosen(results, name)
    in_place = into.save is None or identity(into.save) == identity(place)
    into = replace(into, save=str(place) if in_place else into.save)
    into.check({} if in_place else {"RUN": str(place)})
    settings = branch.settings or cb.continuation.branch.Settings()
    within = settings.within if window is None else {**settings.within, branch.free: window}
    steps = settings.steps if most is None else replace(settings.steps, most=most)
    others = dict(cb.Run(place)) if in_place else {}
    file = Checkpoint(into.save or place, key)
    inner = Inner(file, lambda longer: {**others, key: longer})
    longer, cut = kept(cb.extend, branch, end=end, within=within, steps=steps, save=inner)
    file.finish({**others, key: longer})
    leave(longer, "branch", {"free": branch.free}, into, cut)


def _chosen(run: cb.Run, name: str | None) -> tuple[cb.Branch, Any, str]:
    """The branch, the file it is in, and its name there."""
    branches = [key for key, result in run.items() if isinstance(result, cb.Branch)]
    if not branches:
        raise BadInput(f"{run.path} has no branch or boundary to extend, only {', '.join(run)}")
    if name is None and len(branches) > 1:
        there = ", ".join(branches)
        raise BadInput(f"which branch of {run.path}? There are {there}; give the name of one")
    name = name or branches[0]
    branch = run[name]
    if name not in branches:
        raise BadInput(f"{name!r} is not a branch or a boundary; there are {', '.join(branches)}")
    return branch, *run.place(name)
