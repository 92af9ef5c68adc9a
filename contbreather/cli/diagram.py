"""`contbreather diagram`: all branches that hang together with one of breathers."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from contbreather.cli.interrupts import end, kept
from contbreather.cli.options import Csv, Json, Output, RingSites, Where, Window, shot, whole_number
from contbreather.cli.output import (
    branch_entry,
    branch_rows,
    check_places,
    columns_of,
    point_entry,
    say,
    to_csv,
    to_figure,
    to_json,
)
from contbreather.errors import NotConverged

if TYPE_CHECKING:
    from contbreather.continuation.diagram import Diagram, Place


def diagram(
    where: Where = Where(),
    *,
    free: Annotated[
        str | None, Parameter(help="Parameter to vary: a, gamma, k, or a letter.")
    ] = None,
    window: Window = None,
    depth: Annotated[
        int,
        Parameter(
            help="How often to switch on the way from the first branch to another.",
            converter=whole_number,
        ),
    ] = 2,
    most: Annotated[
        int,
        Parameter(
            help="Number of branches after which no others are followed.",
            converter=whole_number,
        ),
    ] = 100,
    sites: RingSites = None,
    csv: Csv = None,
    output: Output = None,
    json: Json = False,
) -> None:
    """Follow the breathers, switch wherever other branches leave, follow these, and so on.

    No branch is in the diagram twice. Ctrl-C ends the work and keeps what there is.
    """
    from contbreather.continuation.diagram import diagram

    check_places(csv, output)
    problem, start = shot(free, where, window, sites)
    name, within = start.free, {start.free: start.window}
    tree, cut = kept(lambda: diagram(problem, name, within=within, depth=depth, most=most))
    made = []
    if csv is not None:
        made.append(to_csv(csv, _rows(tree), _columns(tree), cut=cut))
    if output is not None:
        from contbreather.plotting import plot_diagram

        made.append(to_figure(output, lambda: plot_diagram(tree), cut=cut))
    if json:
        about = {"free": free, **start.on.entry()}
        to_json({**about, **_content(tree), "written": [str(path) for path in made]})
    else:
        ends = _loose_ends(tree, depth)
        say(tree, *(f"{line}." for line in ends), *(f"Wrote {path}." for path in made))
    end(cut)
    ended = [(i, stop) for i, one in enumerate(tree) for stop in (one.began, one.stop)]
    broken = [i for i, stop in ended if stop is not None and stop.failed]
    if broken or tree.failed:
        lost = [f"branch {i} broke off" for i in broken] + [str(failure) for failure in tree.failed]
        raise NotConverged(f"the diagram is not complete: {'; '.join(lost)}")


def _loose_ends(tree: Diagram, depth: int) -> Iterator[str]:
    """What the tree does not show: arms that lead to a known branch, points left alone."""
    yield from map(str, tree.met)
    begun = {birth.place.name for birth in tree.births if birth.place is not None}
    begun |= {meeting.place.name for meeting in tree.met}
    half = [place for place in tree.left if place.name in begun]
    deep = [place for place in tree.left if tree.births[place.branch].depth >= depth]
    rest = [place for place in tree.left if place not in half and place not in deep]
    more = "" if tree.interrupted else "; raise --most"
    if half:
        yield f"Not all arms followed of: {_named(half)}{more}"
    if rest:
        yield f"Not switched at: {_named(rest)}{more}"
    if deep:
        yield f"Not switched at: {_named(deep)}; raise --depth"


def _named(places: list[Place]) -> str:
    return ", ".join(place.name for place in places)


def _content(tree: Diagram) -> dict[str, Any]:
    """Branches, and the graph as nodes and edges that name them."""
    places = {place.name: place for row in tree.places for place in row}
    edges = [
        {"from": start, "to": end, "relation": relation}
        for start, end, relation in tree.graph.edges(data="relation")
    ]
    return {
        "branches": [
            {"label": branch.problem.label, "depth": birth.depth, **branch_entry(branch)}
            for branch, birth in zip(tree.branches, tree.births, strict=True)
        ],
        "points": {name: point_entry(place.point) for name, place in places.items()},
        "edges": edges,
        "left": [place.name for place in tree.left],
        "failed": [str(failure) for failure in tree.failed],
        "interrupted": tree.interrupted,
    }


def _columns(tree: Diagram) -> list[str]:
    """All columns of all branches, each once."""
    names = dict.fromkeys(name for branch in tree for name in columns_of(branch))
    return ["branch", *names, "label"]


def _rows(tree: Diagram) -> Iterator[dict[str, Any]]:
    for i, branch in enumerate(tree):
        yield from ({"branch": i, **row} for row in branch_rows(branch))
