"""Values as notebooks show them: a sentence, a small picture, a table. Nothing is fetched."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import singledispatch
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from contbreather.breathers import Orbit
from contbreather.breathers.zones import Zones
from contbreather.continuation import Branch, Point
from contbreather.continuation.diagram import Diagram
from contbreather.continuation.run import Run as Kept
from contbreather.dynamics import Basin, Run, SmoothRun, Sweep
from contbreather.errors import ContbreatherError
from contbreather.plotting.branches import plot
from contbreather.plotting.canvas import inline, symbol
from contbreather.plotting.diagrams import plot_diagram
from contbreather.plotting.orbits import plot_orbit
from contbreather.plotting.runs import plot_basin, plot_localisation, plot_motion, plot_sweep
from contbreather.plotting.zones import plot_zones
from contbreather.tables import Sheet

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MOST = 30  # rows
ROOM = 90  # characters in a row of a table
SMALL = 100  # sites of a lattice whose multipliers are found at once

Draw = Callable[["Axes"], object]


@dataclass(frozen=True)
class Card:
    """What is shown: a sentence, the picture, and the value's own table."""

    sentence: str
    draw: Draw | None
    table: Sheet


def card(value: Any) -> str:
    """A value as HTML, with its picture as SVG inside of it.

    Parameters
    ----------
    value : Branch, Point, Orbit, Zones, Diagram, Run, SmoothRun, Sweep, Basin, or what is on disk

    Examples
    --------
    >>> import contbreather as cb
    >>> shown = card(cb.symmetric(a=0.5, gamma=0.08, k=0.8))
    >>> "<svg" in shown, "<table" in shown, "src=" in shown
    (True, True, False)
    """
    made = _card(value)
    try:
        picture = "" if made.draw is None else inline(made.draw)
    except ContbreatherError as error:  # an interrupted diagram without a curve, say
        picture = f"<p>no picture: {escape(str(error))}</p>"
    return (
        f"<div><p>{escape(made.sentence)}</p>"
        '<div style="display:flex;flex-wrap:wrap;gap:1em;align-items:flex-start">'
        f'<div style="background:white">{picture}</div>'
        f'<div style="overflow-x:auto;max-width:40em">{made.table.html(ROOM, MOST)}</div>'
        "</div></div>"
    )


# --- what is said of each, and how it is drawn ----------------------------------------------------


@singledispatch
def _card(value: Any) -> Card:
    raise TypeError(f"nothing is known of how to show {type(value).__name__}")


@_card.register
def _branch(branch: Branch) -> Card:
    return Card(branch.describe(), lambda ax: plot(branch, ax=ax), branch.table())


@_card.register
def _point(point: Point) -> Card:
    orbit = point.ground.curve.problem.interpret is not None and isinstance(point.solution, Orbit)
    draw = plot_orbit if orbit else _place
    return Card(repr(point), lambda ax: draw(point, ax=ax), point.table())


@_card.register
def _orbit(orbit: Orbit) -> Card:
    rows = [("forcing", orbit.forcing.describe())]
    rows += [
        (f"impact of site {one.site}", f"wall {one.wall:+d}, t = {one.time:.6g}, "
         f"velocity {one.before:.6g}") for one in orbit.hits
    ]  # fmt: skip
    rows.append(("admissible", repr(orbit.admissibility()).strip("<>").partition(" ")[2]))
    if orbit.lattice.sites is None or orbit.lattice.sites <= SMALL:
        rows.append(("stability", repr(orbit.stability()).strip("<>")))
    table = orbit.table().further(*rows)
    return Card(orbit.describe(), lambda ax: plot_orbit(orbit, ax=ax), table)


@_card.register
def _zones(zones: Zones) -> Card:
    sentence = ". ".join([repr(zones).strip("<>"), *zones.told()])
    return Card(sentence, lambda ax: plot_zones(zones, ax, legend=False), zones.table())


@_card.register
def _diagram(tree: Diagram) -> Card:
    return Card(tree.describe(), lambda ax: plot_diagram(tree, ax=ax), tree.table())


@_card.register(Run)
@_card.register(SmoothRun)
def _run(run: Run | SmoothRun) -> Card:
    draw = plot_localisation if run.record is None else plot_motion
    return Card(repr(run).strip("<>"), lambda ax: draw(run, ax=ax), run.table())


@_card.register
def _sweep(sweep: Sweep) -> Card:
    return Card(repr(sweep).strip("<>"), lambda ax: plot_sweep(sweep, ax=ax), sweep.table())


@_card.register
def _basin(basin: Basin) -> Card:
    return Card(repr(basin).strip("<>"), lambda ax: plot_basin(basin, ax=ax), basin.table())


@_card.register
def _kept(run: Kept) -> Card:
    """The first result as a picture."""
    first = next(iter(run.values()), None)
    known = _card.dispatch(type(first)) is not _card.dispatch(object)
    return Card(str(run.path), _card(first).draw if known else None, run.table())


def _place(point: Point, ax: Axes) -> None:
    """A point of anybody's problem: an array unknown as a profile, numbers as a place."""
    start = point.curve.problem.start
    name = next(iter(start))
    if np.ndim(start[name]):
        ax.plot(point[name], ".-", markersize=3, linewidth=0.8)
        ax.set_xlabel("entry")
    else:
        free = point.curve.free[0]
        ax.plot(point[free], point[name], "o")
        ax.set_xlabel(symbol(free))
        if point.tangent is not None:
            slots = point.curve.slots
            ax.axline((point[free], point[name]), (point[free] + point.tangent[slots[free]],
                      point[name] + point.tangent[slots[name]]), linewidth=0.8)  # fmt: skip
    ax.set_ylabel(symbol(name))
