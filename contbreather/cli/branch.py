"""`contbreather branch`: breathers along one parameter, with what happens to them on the way."""

from __future__ import annotations

from typing import Annotated, Literal

from cyclopts import Parameter

from contbreather.cli.options import (
    PARAMETERS,
    Csv,
    Json,
    Output,
    Sites,
    Threshold,
    Where,
    Window,
    events_by,
    first_in,
    interval,
    known,
)
from contbreather.cli.output import check_places, ends, leave
from contbreather.errors import BadInput, NotConverged


def branch(
    where: Where = Where(),  # noqa: B008  # frozen
    *,
    free: Annotated[
        str | None, Parameter(help="Parameter to vary: a, gamma, k, or a letter.")
    ] = None,
    window: Window = None,
    towards: Annotated[
        Literal["both", "up", "down"], Parameter(help="Direction in which it changes at first.")
    ] = "both",
    sites: Sites = None,
    threshold: Threshold = None,
    csv: Csv = None,
    output: Output = None,
    json: Json = False,
) -> None:
    """A branch of breathers in one parameter, with its special points.

    It starts at the value of the free parameter, if one is given, else at a breather that is
    found in the window.
    """
    from contbreather.continuation import Stop, trace

    check_places(csv, output)
    if free is None:
        raise BadInput("--free is missing: which parameter is to vary, a, gamma or k?")
    forcing = where.drive((free,))
    known(free, forcing)
    fixed = where.need(*(name for name in PARAMETERS if name != free))
    span = interval(free, window)
    start = first_in(free, _around(free, where.given.get(free), span), fixed, forcing)
    found = trace(
        start, free, within={free: span}, towards=towards, events=events_by(sites, threshold)
    )
    leave(found, {"free": free, "forcing": forcing.describe()}, csv, output, json)
    if Stop.NO_CONVERGENCE in (found.began, found.stop):
        raise NotConverged(f"the branch broke off: {'; '.join(ends(found))}")


def _around(free: str, start: float | None, span: tuple[float, float]) -> tuple[float, float]:
    """Where to look for a start: at the value that was given, else in the whole window."""
    if start is None:
        return span
    if not span[0] <= start <= span[1]:
        raise BadInput(f"{free} = {start:g} is outside of the window {span[0]:g} to {span[1]:g}")
    return start, start
