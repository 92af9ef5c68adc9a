"""Values as notebooks show them: a sentence, a small picture, a table. Nothing is fetched."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from html import escape
from typing import TYPE_CHECKING, Any

from contbreather.continuation.branch import Branch, Branches
from contbreather.continuation.diagram import Diagram
from contbreather.continuation.run import Run as Kept
from contbreather.errors import ContbreatherError
from contbreather.orbits.orbit import Orbit
from contbreather.orbits.zone_diagram import Zones
from contbreather.plotting.canvas import inline
from contbreather.plotting.pictures import has_picture, plot
from contbreather.plotting.zones import plot_zones

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MOST = 30  # rows
ROOM = 90  # characters in a row of a table
SMALL = 100  # sites of a lattice whose multipliers are found at once


def card(value: Any) -> str:
    """A value as HTML, with its picture as SVG inside of it.

    Parameters
    ----------
    value : Branch, several of them, Point, Orbit, Zones, Diagram, Run, SmoothRun, Sweep, Basin, a
        verdict, margins, a cycle of flows, a trajectory, or what is on disk

    Examples
    --------
    >>> import contbreather as cb
    >>> shown = card(cb.symmetric(a=0.5, gamma=0.08, k=0.8))
    >>> "<svg" in shown, "<table" in shown, "src=" in shown
    (True, True, False)
    """
    try:
        picture = inline(partial(_draw, value)) if has_picture(value) else ""
    except ContbreatherError as error:  # an interrupted diagram without a curve, say
        picture = f"<p>no picture: {escape(str(error))}</p>"
    table = value.table().further(*(_in_words(value) if isinstance(value, Orbit) else ()))
    return (
        f"<div><p>{escape(_sentence(value))}</p>"
        '<div style="display:flex;flex-wrap:wrap;gap:1em;align-items:flex-start">'
        f'<div style="background:white">{picture}</div>'
        f'<div style="overflow-x:auto;max-width:40em">{table.html(ROOM, MOST)}</div></div></div>'
    )


def _sentence(value: Any) -> str:
    match value:
        case Branch() | Diagram() | Orbit():
            return value.describe()
        case Kept():
            return str(value.path)
        case Branches():
            return f"{len(value)} branches"
        case Zones():
            return ". ".join([repr(value).strip("<>"), *value.sentences()])
        case _:
            return repr(value).strip("<>")


def _in_words(orbit: Orbit) -> Iterator[tuple[str, str]]:
    """Its forcing, its impacts and its verdicts."""
    yield "forcing", orbit.forcing.describe()
    for impact in orbit.hits:
        values = f"wall {impact.wall:+d}, t = {impact.time:.6g}, velocity {impact.before:.6g}"
        yield f"impact of site {impact.site}", values
    yield "admissible", repr(orbit.admissibility()).strip("<>").partition(" ")[2]
    if orbit.lattice.sites is None or orbit.lattice.sites <= SMALL:
        yield "stability", repr(orbit.stability()).strip("<>")


def _draw(value: Any, ax: Axes) -> object:
    return plot_zones(value, ax, legend=False) if isinstance(value, Zones) else plot(value, ax=ax)
