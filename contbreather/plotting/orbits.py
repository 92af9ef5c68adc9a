"""One orbit: chosen sites between their walls, all sites at one time, or the states of flows."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from contbreather.checks import MOST, kind_of, number, whole
from contbreather.continuation.curve.branch import Branch
from contbreather.continuation.curve.point import Point
from contbreather.continuation.curve.problem import Problem
from contbreather.errors import BadInput
from contbreather.flows.cycle_problem import Cycle, CycleProblem
from contbreather.flows.integrate import Trajectory
from contbreather.orbits.orbit import Orbit
from contbreather.oscillators.breather_problem import Breather, BreatherProblem
from contbreather.plotting import canvas
from contbreather.plotting.canvas import BLUE, CYCLE, DASHES, GREY, Drawn

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis

Array = NDArray[np.float64]

TIME = "t"
PERIODS = r"$t/2\pi$"  # the title of times
BESIDE = 10  # sites of the infinite chain on each side of the first that hits
MOMENTS = 400  # of a period, in a picture over time
FINE = 12  # lines in an interval of a mesh, or in a step of the integrator


def plot_orbit(
    orbit: Orbit | Cycle | Point,
    *,
    sites: Sequence[int] | None = None,
    x: str | None = None,
    y: str | Sequence[str] | None = None,
    ax: Axes | None = None,
) -> Drawn:
    """Displacements of an orbit over one period, its walls and its impacts; of a cycle of flows its
    states, over time or, as a phase portrait, over one of them.

    Parameters
    ----------
    orbit : Orbit, flows.Cycle, or a Point of a branch of either
    sites : sequence of int, optional
        The sites that hit, and the neighbours of the first of them, unless given; of a breather of
        oscillators those that move most. Orbits of lattices alone have sites.
    x, y : str, optional
        Of a cycle: what to draw over what. Every state over the time ``"t"`` unless given; `y` may
        be several names; those that swing by less than a tenth of what the others do have a row of
        their own, ``figure.axes[1]`` and so on. Where a condition ends a flow there is a dot.
    ax : matplotlib Axes; a new figure for a journal column unless given

    Raises
    ------
    BadInput
        For what is not an orbit, a state it has not, sites of a cycle or states of a lattice.

    Examples
    --------
    >>> import contbreather as cb
    >>> ax = plot_orbit(cb.symmetric(a=0.5, gamma=0.08, k=0.8), sites=(0, 1, 2)).axes
    >>> [line.get_label() for line in ax.get_lines()[:3]]
    ['$u_{0}$', '$u_{1}$', '$u_{2}$']
    >>> ring = cb.cycle(lambda t, x, p: [x[1], (1 - x[0]**2) * x[1] - x[0]],
    ...                 start={"u": 2.0, "v": 0.0}, params={}, settle=30)
    >>> plot_orbit(cb.flows.cycle_of(ring), x="u", y="v").axes.get_ylabel()
    '$v$'
    """
    whole = solution_of(orbit)
    if isinstance(whole, Cycle):
        if isinstance(whole, Breather) and y is None:
            most = np.argsort(-whole.swings, kind="stable")[:3]
            y = [f"u{n}" for n in (sorted(most) if sites is None else chosen_sites(sites))]
        elif sites is not None:
            raise BadInput(
                f"sites = {sites!r}: a cycle of flows has states, y={whole.equations.states[0]!r}"
            )
        return draw_states(ax, whole, x, y)
    if not isinstance(whole, Orbit):
        raise no_orbit(whole, "an orbit or a cycle")
    if x is not None or y is not None:
        raise BadInput("x and y are states of a cycle of flows; of a lattice choose sites=")
    hit = list(dict.fromkeys(site for site, _ in whole.section.impacts))
    # two beside the first that hits, as far as there are any
    beside = [n % (whole.lattice.sites or n + 1) for n in (hit[0] + 1, hit[0] + 2)]
    default = list(dict.fromkeys([*hit, *beside]))[: len(CYCLE)]
    chosen = default if sites is None else chosen_sites(sites)
    t = np.linspace(0.0, whole.period, MOMENTS * whole.section.turns + 1)
    with canvas.drawing(ax) as (drawn, axes):
        motions = {n: whole.displacement(n, t) for n in chosen}
        for i, its in enumerate(alike(motions)):
            label = ", ".join(f"$u_{{{n}}}$" for n in its)
            axes.plot(t / (2 * math.pi), motions[its[0]], DASHES[i % len(DASHES)], label=label)
        for _, time, wall in impacts_of(whole, chosen):
            canvas.to_the_rim(axes.plot(time, wall, "o", color=GREY, markersize=4, zorder=3))
        # others may stand farther off
        for wall in {wall for n in hit for wall in whole.walls.at(n) if math.isfinite(wall)}:
            axes.axhline(wall, color=GREY, linewidth=0.8, linestyle=(0, (4, 2)), zorder=1)
        axes.set(xlabel=PERIODS, ylabel="$u_n$")
        axes.margins(x=0.0)
        canvas.legend_above(axes)
    return drawn


def solution_of(value: Any) -> Any:
    """Return the solution of a point of a branch, if its problem has one, or the orbit at which the
    problem of a breather starts; all else itself."""
    if isinstance(value, BreatherProblem):
        return value.solution
    interpreted = isinstance(value, Point) and value.base_point.curve.problem.interpret is not None
    return value.solution if interpreted else value


def drawn_orbit(value: object) -> Any:
    """The orbit of a lattice: one with impacts, or a breather of oscillators."""
    orbit = solution_of(value)
    if not isinstance(orbit, Orbit | Breather):
        raise no_orbit(orbit, "an orbit of a lattice")
    return orbit


def no_orbit(value: object, wanted: str) -> BadInput:
    """Error that names what was given in place of an orbit, and what draws it."""
    kind, instead = kind_of(value), "symmetric() finds breathers, cycle() cycles of flows"
    if isinstance(value, Branch):
        instead = "take one of its points, branch[0] for instance, or plot(branch)"
    elif isinstance(value, Cycle):
        kind, instead = "a cycle of flows", "plot_orbit and plot_multipliers draw it"
    elif isinstance(value, CycleProblem):
        kind, instead = "the problem of a cycle", "flows.cycle_of(problem) is its orbit"
    elif isinstance(value, Point | Problem):
        kind = "an equilibrium, or another solution that is no orbit"
        instead = "plotting.plot_spectrum(branch) draws the eigenvalues along its branch"
    return BadInput(f"{wanted} was expected, got {kind}: {instead}")


def alike(lines: Mapping[Any, Array]) -> list[list[Any]]:
    """Group what moves alike, as mirror images do: one line is seen."""
    least = 1e-9 * max(np.nanmax(abs(u)) for u in lines.values())

    def fit(*its: Any) -> bool:
        one, other = lines[its[0]], lines[its[-1]]
        same = one.shape == other.shape  # impacts of one site may be among the times of its line
        return same and np.allclose(one, other, rtol=0.0, atol=least, equal_nan=True)

    return _grouped(lines, fit)


def _grouped(names: Iterable[Any], fit: Callable[..., bool]) -> list[list[Any]]:
    """Put each name into the first group that it fits into, or into one of its own."""
    together: list[list[Any]] = []
    for name in names:
        its = next((its for its in together if fit(*its, name)), None)
        if its is None:
            together.append(its := [])
        its.append(name)
    return together


def chosen_sites(sites: object) -> list[int]:
    given = sites if np.iterable(sites) else [sites]
    chosen = list(dict.fromkeys(whole("sites", n, -MOST) for n in given))
    if not chosen:
        raise BadInput(f"sites = {sites!r}: at least one site was expected")
    return chosen


def impacts_of(orbit: Orbit, sites: Iterable[int]) -> Iterator[tuple[int, float, float]]:
    """Impacts of these sites: the site as it was asked for, its time in units of 2 pi, and the
    wall."""
    size = orbit.lattice.sites
    asked = {n if size is None else n % size: n for n in sites}
    for hit in orbit.hits:
        if hit.site in asked:
            time = hit.time % orbit.period / math.tau
            yield asked[hit.site], time, orbit.walls.position(hit.site, hit.wall)


# --- all sites at once ----------------------------------------------------------------------------


def plot_profile(
    orbit: Orbit | Point,
    *,
    t: float = 0.0,
    sites: Sequence[int] | None = None,
    shape: tuple[int, int] | None = None,
    ax: Axes | None = None,
) -> Drawn:
    """Displacements of many sites at one time.

    Parameters
    ----------
    orbit : Orbit, or a Point of a branch of orbits; or a breather of oscillators
    t : float
        Time; the forcing has the period 2 pi.
    sites : sequence of int, optional
        All sites of a finite lattice, and ten on each side of the one that hits on the infinite
        chain, unless given. All sites of a `Grid` are colours, in its rows and columns.
    shape : (int, int), optional
        Rows and columns to show the sites of another lattice in.
    ax : matplotlib Axes; a new figure for a journal column unless given

    Raises
    ------
    BadInput
        For what is not an orbit, or a shape that has not as many places as there are sites.

    Examples
    --------
    >>> import contbreather as cb
    >>> ax = plot_profile(cb.symmetric(a=0.5, gamma=0.08, k=0.8), sites=(-1, 0, 1)).axes
    >>> ax.get_xlabel(), ax.get_ylabel()
    ('$n$', '$u_n$')
    """
    motion = drawn_orbit(orbit)
    chosen = all_sites(motion) if sites is None else chosen_sites(sites)
    if sites is None and shape is None:
        shape = getattr(motion.lattice, "shape", None)
    time = number("t", t, -math.inf, math.inf, "a time")
    u = np.array([motion.displacement(n, time) for n in chosen])
    with canvas.drawing(ax) as (drawn, axes):
        if shape is None:
            _stems(axes, chosen, u, motion)
        else:
            _tiles(axes, u, shape)
    return drawn


def all_sites(orbit: Any) -> list[int]:
    if orbit.lattice.sites is not None:
        return list(range(orbit.lattice.sites))
    first = orbit.section.impacts[0][0]
    return list(range(first - BESIDE, first + BESIDE + 1))


def _stems(ax: Axes, sites: Sequence[int], u: Array, orbit: Any) -> None:
    ax.vlines(sites, 0.0, u, color=BLUE, linewidth=1.0)
    ax.plot(sites, u, "o", color=BLUE, markersize=4)
    ax.axhline(0.0, color=GREY, linewidth=0.3, zorder=0)
    if isinstance(orbit, Breather):
        place = orbit.chain.walls and float(orbit.chain.walls(0.0, orbit.params))
        ends = np.array([(-place, place) if place else (-math.inf, math.inf)] * len(sites))
    else:
        ends = np.array([orbit.walls.at(n) for n in sites])
    for wall in np.unique(ends[np.isfinite(ends)]):  # of each site that has one there
        struck = [n for n, pair in zip(sites, ends, strict=True) if wall in pair]
        ax.plot(struck, np.full(len(struck), wall), "_", color=GREY, markersize=8)
    ax.set(xlabel="$n$", ylabel="$u_n$")
    whole_numbers(ax.xaxis)


def _tiles(ax: Axes, u: Array, shape: tuple[int, int]) -> None:
    if np.shape(shape) != (2,):
        raise BadInput(f"shape = {shape}: a pair (rows, columns) was expected")
    rows, columns = (whole("shape", count, 1) for count in shape)
    if rows * columns != u.size:
        raise BadInput(f"shape = {shape}: {rows * columns} places for {u.size} sites")
    image = ax.imshow(u.reshape(rows, columns), **colours_of(u))
    ax.set(xlabel="column", ylabel="row")
    for axis in (ax.xaxis, ax.yaxis):
        whole_numbers(axis)
    ax.figure.colorbar(image, ax=ax, label="$u_n$")


def colours_of(u: Array, signed: bool = True) -> dict[str, Any]:
    limit = float(np.abs(u).max()) or 1.0
    cmap, low = ("RdBu_r", -limit) if signed else ("Blues", 0.0)
    return {"cmap": cmap, "vmin": low, "vmax": limit}


def whole_numbers(axis: Axis) -> None:
    from matplotlib.ticker import MaxNLocator

    axis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))


# --- flows ----------------------------------------------------------------------------------------


def draw_states(
    ax: Axes | None,
    motion: Cycle | Trajectory,
    x: str | None,
    y: str | Sequence[str] | None,
    within: tuple[float, float] | None = None,
) -> Drawn:
    """Draw lines of the flows; a dot where a condition ends one, and from there a dotted line to
    where the next one begins."""
    cycle = isinstance(motion, Cycle)
    if isinstance(motion, Cycle):  # of an array of states the first one
        names = motion.equations.states
        shown = [part[0] for part in motion.equations.parts.values()]
    else:
        names, shown = motion.names, [*motion.names]
    x = TIME if x is None else x
    chosen = [y] if isinstance(y, str) else [n for n in shown if n != x] if y is None else list(y)
    for name in (x, *chosen):
        if name not in (TIME, *names):
            raise BadInput(f"no state {name!r}; there are {[*names]}, and the time, 't'")
    flows = [*(_of_cycle(motion) if cycle else _of_run(motion, within))]
    pieces = [  # columns by name, the time among them; a flow of fewer states has no others
        {n: np.full(t.size, np.nan) for n in names} | dict(zip(names, u, strict=False)) | {TIME: t}
        for t, u, _ in flows
    ]
    # the time of a cycle begins anew, its states go on
    following = [*pieces[1:], *pieces[: cycle and x != TIME]]
    columns = {name: np.concatenate([piece[name] for piece in pieces]) for name in chosen}
    together = _of_one_size(columns)
    groups = [its for names in together for its in alike({n: columns[n] for n in names})]
    words = {its[0]: ", ".join(map(canvas.symbol, its)) for its in groups}
    shown = [name for name in chosen if name in words]
    with canvas.drawing(ax, 6.5 + 3.0 * (len(together) - 1)) as (drawn, axes):  # cm
        panels = panels_of(axes, len(together))
        panel_of = {n: panel for panel, its in zip(panels, together, strict=True) for n in its}
        for i, name in enumerate(shown):
            panel = panel_of[name]
            colour, dashes = CYCLE[i % len(CYCLE)], DASHES[i % len(DASHES)]
            lines = [(piece[x], piece[name]) for piece in pieces]
            for j, line in enumerate(lines):
                panel.plot(*line, dashes, color=colour, label=None if j else words[name])
            for (*_, ended), after, line in zip(flows, following, lines, strict=False):
                if ended:
                    last = line[0][-1], line[1][-1]
                    first = after[x][0], after[name][0]
                    panel.plot(*zip(last, first, strict=True), ":", color=colour, linewidth=0.8)
                    canvas.to_the_rim(panel.plot(*last, "o", color=GREY, markersize=3, zorder=3))
        for panel in panels:
            its = [words[name] for name in shown if panel_of[name] is panel]
            panel.set_ylabel(its[0] if len(its) == 1 else "states")
            if len(its) > 1:
                canvas.legend_above(panel)
        if x == TIME:
            axes.margins(x=0.0)
        panels[-1].set_xlabel(canvas.symbol(x))
    drawn += [artist for panel in panels if panel is not axes for artist in panel.get_lines()]
    return drawn


def _of_one_size(columns: Mapping[str, Array]) -> list[list[str]]:
    """Group states that can be read on one axis: the smallest swing fills a tenth of it."""
    spans = {name: (float(np.nanmin(u)), float(np.nanmax(u))) for name, u in columns.items()}
    # of a state at rest, but for rounding, there is nothing to be read
    moving = {n for n, (low, high) in spans.items() if high - low > 1e-9 * max(-low, high)}

    def fit(*its: str) -> bool:
        lows, highs = zip(*(spans[n] for n in its), strict=True)
        reach = (max(highs) - min(lows)) / 10.0
        return all(spans[n][1] - spans[n][0] >= reach for n in its if n in moving)

    return _grouped(columns, fit)


def panels_of(axes: Axes, count: int, *, sharex: bool = True, **look: Any) -> list[Axes]:
    """Axes in rows, with one abscissa, in the place of these, if they are in a grid."""
    place = axes.get_subplotspec()
    if count == 1 or place is None:
        return count * [axes]
    grid = place.subgridspec(count, 1, **look)
    axes.set_subplotspec(grid[0])
    one = axes if sharex else None
    panels = [axes, *(axes.figure.add_subplot(grid[i], sharex=one) for i in range(1, count))]
    for panel in panels[:-1] if sharex else ():
        panel.tick_params(labelbottom=False)
    return panels


def _of_cycle(cycle: Any) -> Iterator[tuple[Array, Array, bool]]:
    for flow, flight in zip(cycle.equations.flows, cycle.flights, strict=True):
        along, states = flight.sampled(FINE)
        yield flight.start + flight.duration * along, states, flow.until is not None


def _of_run(run: Any, within: tuple[float, float] | None) -> list[tuple[Array, Array, bool]]:
    """Sample each flow between the steps of the integrator, by its own interpolant."""
    first, last = (-np.inf, np.inf) if within is None else within
    sampled = []
    for piece in run.pieces:
        steps = piece.t.size - 1
        t = np.interp(np.linspace(0, steps, FINE * steps + 1), np.arange(steps + 1), piece.t)
        t = t[(first <= t) & (t <= last)]
        if t.size:
            sampled.append((t, piece(t), bool(piece.ended and t[-1] == piece.t[-1])))
    if not sampled:
        raise BadInput(
            f"nothing lies between {first:g} and {last:g}: the trajectory goes from "
            f"t = {run.t[0]:g} to {run.t[-1]:g}"
        )
    return sampled
