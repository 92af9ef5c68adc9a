"""Values as notebooks show them: a sentence, a small picture, a table. Nothing is fetched."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from contbreather.continuation.branch import Branch, Branches
from contbreather.continuation.diagram import Diagram
from contbreather.continuation.point import Point
from contbreather.continuation.run import Run as Kept
from contbreather.errors import ContbreatherError
from contbreather.flows.integrate import Trajectory
from contbreather.flows.orbit import Cycle
from contbreather.orbits.orbit import Orbit
from contbreather.orbits.zone_diagram import Zones
from contbreather.plotting.branches import plot
from contbreather.plotting.canvas import inline, symbol
from contbreather.plotting.diagrams import plot_diagram
from contbreather.plotting.orbits import plot_orbit, solution_of
from contbreather.plotting.runs import plot_basin, plot_localisation, plot_motion, plot_sweep
from contbreather.plotting.zones import plot_zones
from contbreather.simulation.basin import Basin
from contbreather.simulation.classify import Verdict as Judged
from contbreather.simulation.simulate import Run
from contbreather.simulation.smooth import SmoothRun
from contbreather.simulation.sweep import Sweep

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
    draw = _drawn(value)
    try:
        picture = "" if draw is None else inline(draw)
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


def _drawn(value: Any) -> Callable[[Axes], object] | None:
    """The picture of a value; of what is on disk that of the first result."""
    match value:
        case Kept():
            return _drawn(next(iter(value.values()), None))
        case Judged():
            return _drawn(value.run)
        case Branches():
            return lambda ax: plot(*value, ax=ax)
        case Zones():
            return lambda ax: plot_zones(value, ax, legend=False)
        case Point():
            draw: Any = plot_orbit if isinstance(solution_of(value), Orbit | Cycle) else _place
        case Run() | SmoothRun():
            draw = plot_localisation if value.record is None else plot_motion
        case _:
            draw = next((_PLOTS[kind] for kind in _PLOTS if isinstance(value, kind)), None)
    return None if draw is None else lambda ax: draw(value, ax=ax)


_PLOTS: dict[type, Any] = {
    Branch: plot,
    Orbit: plot_orbit,
    Cycle: plot_orbit,
    Trajectory: plot_motion,
    Diagram: plot_diagram,
    Sweep: plot_sweep,
    Basin: plot_basin,
}


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
