"""`contbreather branch`: breathers along one parameter, with what happens to them on the way."""

from __future__ import annotations

from typing import Annotated, Literal

from cyclopts import Parameter

from contbreather.cli.interrupts import kept
from contbreather.cli.options import (
    Csv,
    Json,
    Output,
    RingSites,
    Root,
    Threshold,
    Where,
    Window,
    beginning,
)
from contbreather.cli.output import check_ends, check_places, leave


def branch(
    where: Where = Where(),
    *,
    free: Annotated[
        str | None, Parameter(help="Parameter to vary: a, gamma, k, or a letter.")
    ] = None,
    window: Window = None,
    towards: Annotated[
        Literal["both", "up", "down"], Parameter(help="Direction in which it changes at first.")
    ] = "both",
    root: Root = 1,
    sites: RingSites = None,
    threshold: Threshold = None,
    csv: Csv = None,
    output: Output = None,
    json: Json = False,
) -> None:
    """A branch of breathers in one parameter, with its special points.

    It starts at the value of the free parameter, if one is given, else at a breather that is
    found in the window.
    """
    from contbreather.breathers.search import problem_with
    from contbreather.continuation import trace

    check_places(csv, output)
    start = beginning(free, where, window, sites, threshold, root)
    problem = problem_with(start.breather, start.free, threshold=start.on.threshold)
    within = {start.free: start.window}
    found, cut = kept(lambda: trace(problem, start.free, within=within, towards=towards))
    leave(found, {"free": start.free, **start.on.entry()}, csv, output, json, cut=cut)
    check_ends(found, "branch")
