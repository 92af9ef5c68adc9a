"""The picture of anything that was computed, and what notebooks show of it: a sentence, a small
picture, a table. Nothing is fetched."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from html import escape
from inspect import isfunction, signature
from typing import TYPE_CHECKING, Any

import numpy as np

from contbreather.checks import kind_of
from contbreather.continuation.branches.diagram import Diagram
from contbreather.continuation.curve.branch import Branch
from contbreather.continuation.curve.point import Point
from contbreather.continuation.files.result_files import Run as Kept
from contbreather.errors import BadInput, ContbreatherError
from contbreather.flows.cycle_problem import Cycle
from contbreather.flows.integrate import Trajectory
from contbreather.orbits.multibreathers import Multibreather
from contbreather.orbits.orbit import Orbit
from contbreather.orbits.zone_diagram import ZoneDiagrams, Zones
from contbreather.oscillators.breather_constructors import CodedBreather
from contbreather.oscillators.breather_problem import BreatherProblem
from contbreather.plotting.branches import plot_branches, plot_diagram
from contbreather.plotting.canvas import Drawn, drawing, inline, symbol
from contbreather.plotting.orbits import plot_orbit, plot_profile, solution_of
from contbreather.plotting.runs import plot_basin, plot_localisation, plot_motion, plot_sweep
from contbreather.plotting.zones import plot_zones
from contbreather.simulation.basin import Basin
from contbreather.simulation.classify import Classification
from contbreather.simulation.simulate import States
from contbreather.simulation.sweep import Sweep

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LISTS = (list, tuple)


def plot(
    *values: Any,
    x: str | None = None,
    y: str | Callable[[Point], float] | None = None,
    ax: Axes | None = None,
    labels: bool | None = None,
    kinds: Iterable[str] | None = None,
    colours: Sequence[str] | None = None,
) -> Any:
    """Draw what was computed: branches, a diagram, zones, an orbit, a run.

    Branches are drawn as the field does: solid stable, dashed unstable, labelled special points.
    Of cycles a state is drawn by its envelope, its largest and its smallest value. Equilibria are
    dashed where an eigenvalue has a positive real part; anybody's equations are taken for those of
    a flow, ``x' = F``, where Hopf points are among the events looked for. Where stability was not
    computed, without these or of more than 250 unknowns, lines are grey and dash-dotted (in their
    colours where these stand for something), and a legend says so. Where walls were lifted
    (``inadmissible=True``) the part behind them is dotted. Where branches
    differ in a parameter that is fixed along each, colours go by it, and a legend says so where it
    has room; of boundaries colours go by their kinds, too, and without arms by their labels, as of
    breathers on other lattices.

    Parameters
    ----------
    *values : Branch, or any one value
        Branches of one problem or several, as long as all have the columns that are drawn; on
        boundaries lines are solid. Or one diagram, zones (or several in a list), orbit, cycle,
        point, entry of a catalogue, run, sweep or basin: of these `contbreather.plotting` has
        functions with more to choose.
    x, y : str, y also callable, optional
        Columns; y of branches may be a function of a point, the number to draw. By default the
        free parameter of the first branch, and the first unknown (on a boundary the other
        parameter; of cycles the first state; of breathers p, half the momentum of an impact, but
        with arms among them the asymmetry or t1, whichever tells them apart and lays no branch
        that turns back upon itself). An array unknown is drawn by its entry of largest size, with
        its sign; ``"norm(u)"`` is its norm. ``plot(branch, "a", "p")`` says the same.
    ax : matplotlib Axes, optional
        A new figure of the width of a journal column unless given. Axes that show other columns
        are refused.
    labels : bool, optional
        Whether special points are named beside them. Unless given they are as long as there are not
        more than eight; otherwise a legend says what the markers stand for.
    kinds : iterable of str, optional
        The kinds of special points to mark, ``("PF", "NS")``; all unless given.
    colours : sequence of str, optional
        One of matplotlib's colours for each branch.

    Returns
    -------
    Drawn
        The artists, with their ``axes`` and ``figure``; of several zones a list of them.
        ``plot(...).figure.savefig("branch.pdf")`` writes it.

    Raises
    ------
    BadInput
        Without branches, for an unknown column, kinds that are no words, another number of
        colours than of branches, or an option that says nothing of the picture.

    Examples
    --------
    >>> import contbreather as cb
    >>> import numpy as np
    >>> line = cb.Problem(lambda x, p: np.array([x[0] ** 2 - p["mu"]]), {"x": 1.0}, {"mu": 1.0})
    >>> ax = plot(cb.trace(line, "mu", within={"x": (-1, 1)}, events=[cb.fold()])).axes
    >>> sorted(word.get_text() for word in ax.texts if word.get_text())
    ['EP1', 'EP2', 'LP1']
    """
    names = [value for value in values if isinstance(value, str)]
    if len(names) > 2 or any((x, y)[: len(names)]):
        raise BadInput(f"the columns {', '.join(names)}: x and y were expected, each once")
    options: dict[str, Any] = {"ax": ax, "labels": labels, "kinds": kinds, "colours": colours}
    options |= dict(zip("xy", [*names, *(x, y)[len(names) :]], strict=True))
    wanted: dict[str, Any] = {name: value for name, value in options.items() if value is not None}
    # several may be given together as well, as `switch` returns them
    single = [one for value in values for one in (value if isinstance(value, LISTS) else [value])]
    drawn = [one for one in single if not isinstance(one, str)]
    if all(isinstance(one, Branch) for one in drawn):
        return plot_branches(*drawn, **wanted)
    if len(drawn) > 1:
        if all(isinstance(one, Zones) for one in drawn):
            return plot_zones(drawn, **wanted)  # beside each other
        if any(isfunction(one) for one in drawn):
            raise BadInput("a function of a point says what is drawn by its name, y=function")
        other = next(kind_of(one) for one in drawn if not isinstance(one, Branch))
        raise BadInput(
            f"only branches are drawn together, or zones; {other} was among them: leave it out, or "
            "draw it by itself"
        )
    value, draw = _drawn(drawn[0])
    if draw is None:
        raise BadInput(f"a branch, zones or an orbit, say, was expected, got {kind_of(value)}")
    if unknown := [*wanted.keys() - signature(draw).parameters.keys()]:
        raise BadInput(f"{unknown[0]} says nothing of the picture of {kind_of(value)}")
    return draw(value, **wanted)


def _drawn(value: Any) -> tuple[Any, Any]:
    """Choose what is drawn of a value, and what draws it: of what is on disk the first result."""
    match value:
        case Kept():
            return _drawn(next(iter(value.values()), None))
        case Classification():
            return _drawn(value.run)
        case CodedBreather(breather=None) | Multibreather(orbit=None):
            raise BadInput(f"there is nothing to draw of {kind_of(value)}: {value.ended}")
        case CodedBreather(breather=found) | Multibreather(orbit=found):
            return _drawn(found)
        case Point():
            return value, plot_orbit if isinstance(solution_of(value), Orbit | Cycle) else _place
        case States():
            return value, plot_localisation if value.record is None else plot_motion
        case _:
            return value, next((_PLOTS[kind] for kind in _PLOTS if isinstance(value, kind)), None)


_PLOTS: dict[type, Any] = {
    Branch: plot_branches,
    Orbit: plot_orbit,
    Cycle: plot_orbit,
    BreatherProblem: plot_profile,
    Trajectory: plot_motion,
    Diagram: plot_diagram,
    Zones: plot_zones,
    Sweep: plot_sweep,
    Basin: plot_basin,
}


def _place(point: Point, *, ax: Axes | None = None) -> Drawn:
    """Draw a point of anybody's problem: an array unknown as a profile, numbers as a place."""
    start = point.curve.problem.start
    name = next(iter(start))
    with drawing(ax) as (drawn, axes):
        if np.ndim(start[name]):
            axes.plot(point[name], ".-", markersize=3, linewidth=0.8)
            axes.set_xlabel("entry")
        else:
            free = point.curve.free[0]
            axes.plot(point[free], point[name], "o")
            axes.set_xlabel(symbol(free))
            if point.tangent is not None:
                place = np.array([point[free], point[name]])
                way = point.tangent[[point.curve.slots[n] for n in (free, name)]]
                # as far to either side, so that the point is in the middle
                axes.axline(place - way, place + way, linewidth=0.8)
        axes.set_ylabel(symbol(name))
    return drawn


# --- in notebooks ---------------------------------------------------------------------------------


def card(value: Any) -> str:
    """Write any result as HTML, with its picture as SVG inside of it."""
    several = value if isinstance(value, ZoneDiagrams) else (value,)
    try:
        picture = "".join(map(_picture, several))
    except ContbreatherError as error:  # an interrupted diagram without a curve, say
        picture = f"<p>no picture: {escape(str(error))}</p>"
    table = value.table().further(*(_in_words(value) if isinstance(value, Orbit) else ()))
    return (
        f"<div><p>{escape(_sentence(value))}</p>"
        '<div style="display:flex;flex-wrap:wrap;gap:1em;align-items:flex-start">'
        f'<div style="background:white">{picture}</div>'
        f'<div style="overflow-x:auto;max-width:40em">{table.html(90, 30)}</div></div></div>'
    )


def _picture(value: Any) -> str:
    # a legend of zones would cover them
    draw = partial(plot_zones, legend=False) if isinstance(value, Zones) else plot
    there = isinstance(value, LISTS) or _drawn(value)[1] is not None
    return inline(lambda ax: draw(value, ax=ax)) if there else ""


def _sentence(value: Any) -> str:
    if isinstance(value, Branch | Diagram | Orbit):
        return value.describe()
    if isinstance(value, tuple):
        return f"{len(value)} {'branches' if isinstance(value[0], Branch) else 'zone diagrams'}"
    further = value.sentences() if isinstance(value, Zones) else ()
    return ". ".join([repr(value).strip("<>"), *further])


def _in_words(orbit: Orbit) -> Iterator[tuple[str, str]]:
    yield "forcing", orbit.forcing.describe()
    for impact in orbit.hits:
        values = f"wall {impact.wall:+d}, t = {impact.time:.6g}, velocity {impact.before:.6g}"
        yield f"impact of site {impact.site}", values
    yield "admissible", repr(orbit.admissibility()).strip("<>").partition(" ")[2]
    if orbit.lattice.sites is None or orbit.lattice.sites <= 100:  # multipliers found at once
        yield "stability", repr(orbit.stability()).strip("<>")
