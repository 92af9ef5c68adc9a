"""`contbreather diagram`: all branches that hang together with one of breathers."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import contbreather as cb
from contbreather.cli.interrupts import kept
from contbreather.cli.options import BranchWindow, ModelOptions, SavedOutput, Whole
from contbreather.cli.output import branch_entry, branch_table, point_entry
from contbreather.errors import NotConverged


def diagram(
    where: ModelOptions = ModelOptions(),
    along: BranchWindow = BranchWindow(),
    *,
    depth: Whole = 2,
    most: Whole = 100,
    into: SavedOutput = SavedOutput(),
) -> None:
    """Follow the breathers, switch wherever other branches leave, follow these, and so on.

    No branch is in the diagram twice. Ctrl-C ends the work and keeps what there is.

    Parameters
    ----------
    depth
        How often to switch on the way from the first branch to another.
    most
        Number of branches after which no others are followed.
    """
    into.check(where.read)
    start = along.start(where)
    options: dict[str, Any] = {"within": start.within, "depth": depth, "most": most}
    tree, cut = kept(cb.diagram, start.shot, start.free, **options, save=into.save)
    into.leave(
        lambda: {**start.entry(), **content(tree)},
        _lines(tree, depth),
        lambda: branch_table(tree.branches, "branch"),
        lambda: cb.plotting.plot_diagram(tree),
        cut=cut or tree.interrupted,
    )
    ended = [(i, stop) for i, branch in enumerate(tree) for stop in (branch.began, branch.stop)]
    broken = [i for i, stop in ended if stop is not None and stop.failed]
    if broken or tree.failed:
        lost = [f"branch {i} broke off" for i in broken] + [str(failure) for failure in tree.failed]
        raise NotConverged(f"the diagram is not complete: {'; '.join(lost)}")


def _lines(tree: Any, depth: int) -> Iterator[object]:
    yield tree
    yield from (f"{line}." for line in _loose_ends(tree, depth))


def _loose_ends(tree: Any, depth: int) -> Iterator[str]:
    """What the tree does not show: arms that lead to a known branch, points left alone."""
    yield from map(str, tree.meetings)
    begun = {birth.place.name for birth in tree.births if birth.place is not None}
    begun |= {meeting.place.name for meeting in tree.meetings}
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


def _named(places: list[Any]) -> str:
    return ", ".join(place.name for place in places)


def content(tree: Any) -> dict[str, Any]:
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
    }
