"""`contbreather branch`: breathers along one parameter, with what happens to them on the way."""

from __future__ import annotations

from typing import Annotated, Literal

from cyclopts import Parameter

from contbreather.cli.interrupts import kept
from contbreather.cli.options import (
    PARAMETERS,
    Csv,
    Json,
    Output,
    RingSites,
    Root,
    Threshold,
    Where,
    Window,
    around,
    first_in,
    interval,
    known,
    lattice_by,
    lattice_entry,
)
from contbreather.cli.output import check_ends, check_places, leave
from contbreather.errors import BadInput


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
    from contbreather.breathers.problem import problem_of
    from contbreather.continuation import trace

    check_places(csv, output)
    if free is None:
        raise BadInput("--free is missing: which parameter is to vary, a, gamma or k?")
    forcing = where.drive((free,))
    known(free, forcing)
    fixed = where.need(*(name for name in PARAMETERS if name != free))
    span = interval(free, window)
    near = around(free, where.given.get(free), span)
    lattice, modulus = lattice_by(sites, threshold)
    start = first_in(free, near, fixed, forcing, root=root, lattice=lattice)
    found, cut = kept(
        lambda: trace(problem_of(start, modulus), free, within={free: span}, towards=towards)
    )
    about = {"free": free, "forcing": forcing.describe(), **lattice_entry(lattice, modulus)}
    leave(found, about, csv, output, json, cut=cut)
    check_ends(found, "branch")
