"""Values as notebooks show them: a sentence, a small picture, a table. Nothing is fetched."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
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
from contbreather.dynamics import Basin, Fate, Run, SmoothRun, Sweep
from contbreather.errors import ContbreatherError
from contbreather.plotting.branches import plot
from contbreather.plotting.canvas import inline, symbol
from contbreather.plotting.diagrams import plot_diagram
from contbreather.plotting.orbits import plot_orbit
from contbreather.plotting.runs import plot_basin, plot_localisation, plot_motion, plot_sweep
from contbreather.plotting.zones import plot_zones

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from rich.table import Table

MOST = 30  # rows
DIGITS = 8
SMALL = 100  # sites of a lattice whose multipliers are found at once
ROOM = 90  # characters in a row of a table

Draw = Callable[["Axes"], object]


@dataclass(frozen=True)
class Card:
    """What is shown: a sentence, the picture, and rows under a heading (or without one)."""

    sentence: str
    draw: Draw | None
    rows: Sequence[Sequence[str]]
    heading: Sequence[str] = ()


def card(value: object) -> str:
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
        f'<div style="overflow-x:auto;max-width:40em">{_table(made)}</div></div></div>'
    )


def _table(made: Card) -> str:
    head = "".join(f"<th>{escape(cell)}</th>" for cell in made.heading)
    rows = [f"<tr>{''.join(_cells(row))}</tr>" for row in made.rows[:MOST]]
    left = len(made.rows) - MOST
    more = f"<p>and {left} more</p>" if left > 0 else ""
    return f"<table>{f'<tr>{head}</tr>' if head else ''}{''.join(rows)}</table>{more}"


def _cells(row: Iterable[str]) -> Iterable[str]:
    name, *others = row
    yield f'<th style="text-align:left">{escape(name)}</th>'
    yield from (f'<td style="text-align:left">{escape(cell)}</td>' for cell in others)


# --- what is said of each -------------------------------------------------------------------------


@singledispatch
def _card(value: object) -> Card:
    raise TypeError(f"nothing is known of how to show {type(value).__name__}")


@_card.register
def _branch(branch: Branch) -> Card:
    heading, rows = _read(branch.table(width=ROOM))
    return Card(branch.describe(), lambda ax: plot(branch, ax=ax), rows, heading)


@_card.register
def _point(point: Point) -> Card:
    names = [*point.curve.problem.names, *point.curve.problem.record]
    rows = [[name, _number(point[name])] for name in names if np.ndim(point[name]) == 0]
    rows += [["arclength", _number(point.arclength)], ["residual", f"{point.residual:.1e}"]]
    rows += [[name, _number(value)] for name, value in point.detail.items() if np.isscalar(value)]
    if point.ground.curve.problem.interpret is not None and isinstance(point.solution, Orbit):
        return Card(repr(point), lambda ax: plot_orbit(point, ax=ax), rows)
    return Card(repr(point), lambda ax: _place(point, ax), rows)


@_card.register
def _orbit(orbit: Orbit) -> Card:
    on = orbit.conditions
    rows = [[name, _number(getattr(on, name))] for name in ("a", "gamma", "k", "damping", "spring")]
    rows.append(["forcing", on.forcing.describe()])
    rows += [
        [f"impact of site {one.site}", f"wall {one.wall:+d}, t = {one.time:.6g}, "
         f"velocity {one.before:.6g}"] for one in orbit.hits
    ]  # fmt: skip
    rows.append(["admissible", repr(orbit.admissibility()).strip("<>").partition(" ")[2]])
    if orbit.lattice.sites is None or orbit.lattice.sites <= SMALL:
        rows.append(["stability", repr(orbit.stability()).strip("<>")])
    return Card(orbit.describe(), lambda ax: plot_orbit(orbit, ax=ax), rows)


@_card.register
def _zones(zones: Zones) -> Card:
    names = (*zones.pair, "p")
    rows = [[point.kind, *(_number(point[name]) for name in names)] for point in zones.special]
    sentence = ". ".join([repr(zones).strip("<>"), *zones.told()])
    return Card(sentence, lambda ax: plot_zones(zones, ax, legend=False), rows, ["", *names])


@_card.register
def _diagram(tree: Diagram) -> Card:
    rows = []
    for i, (branch, birth) in enumerate(zip(tree.branches, tree.births, strict=True)):
        source = "" if birth.place is None else birth.place.name
        labels = " ".join(point.label for point in branch.special)
        rows.append([str(i), source, str(len(branch)), labels, branch.stop.value])
    heading = ["branch", "born at", "points", "special", "end"]
    return Card(tree.describe(), lambda ax: plot_diagram(tree, ax=ax), rows, heading)


@_card.register(Run)
@_card.register(SmoothRun)
def _run(run: Run | SmoothRun) -> Card:
    shown = getattr(run.conditions, "shown", run.conditions)
    rows = [["sites", str(run.sites)], ["periods", str(run.periods)]]
    if isinstance(run, Run):
        rows.append(["impacts", str(len(run.impacts))])
    rows += [["until t =", _number(run.end)], ["then |u| <=", _number(abs(run.final.u).max())]]
    rows += [[name, _number(getattr(shown, name))] for name in ("a", "gamma", "k", "damping")
             if hasattr(shown, name)]  # fmt: skip
    draw = plot_localisation if run.record is None else plot_motion
    return Card(repr(run).strip("<>"), lambda ax: draw(run, ax=ax), rows)


@_card.register
def _sweep(sweep: Sweep) -> Card:
    names = ("value", "p", "amplitude", "participation", "tilt", "change")
    rows = [[_number(x, 5) for x in row]
            for row in zip(*(getattr(sweep, name) for name in names), strict=True)]  # fmt: skip
    heading = [sweep.name, *names[1:]]
    return Card(repr(sweep).strip("<>"), lambda ax: plot_sweep(sweep, ax=ax), rows, heading)


@_card.register
def _basin(basin: Basin) -> Card:
    counts = [(fate, int(np.sum(basin.fate == fate))) for fate in Fate]
    rows = [[fate.words, str(count)] for fate, count in counts if count]
    rows.append(["share that returned", f"{basin.share:.4g}"])
    return Card(repr(basin).strip("<>"), lambda ax: plot_basin(basin, ax=ax), rows)


@_card.register
def _kept(run: Kept) -> Card:
    """Each result in a line, and the first one as a picture."""
    rows = [[name, repr(value).strip("<>")] for name, value in run.items()]
    first = next(iter(run.values()), None)
    known = _card.dispatch(type(first)) is not _card.dispatch(object)
    return Card(str(run.path), _card(first).draw if known else None, rows)


# --- how ------------------------------------------------------------------------------------------


def _read(table: Table) -> tuple[list[str], list[list[str]]]:
    """Heading and rows of a table that was made for a terminal."""
    columns = [list(map(str, column.cells)) for column in table.columns]
    heading = [str(column.header) for column in table.columns]
    return heading, [list(row) for row in zip(*columns, strict=True)]


def _number(value: Any, digits: int = DIGITS) -> str:
    return value if isinstance(value, str) else f"{value:.{digits}g}"


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
