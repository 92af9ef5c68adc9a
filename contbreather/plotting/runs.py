"""Runs, sections, slow sweeps and attraction: what simulation leaves, as pictures."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from contbreather.checks import check_kind, one_of, row, whole
from contbreather.errors import BadInput
from contbreather.flows.integrate import Trajectory
from contbreather.plotting import canvas
from contbreather.plotting.canvas import BLUE, CYCLE, GREY, ORANGE, SKY, VERMILLION, Drawn
from contbreather.plotting.envelopes import LONG, edges_of, envelope, samples, with_impacts
from contbreather.plotting.orbits import draw_states
from contbreather.simulation.basin import Basin, Outcome
from contbreather.simulation.measures import localised
from contbreather.simulation.simulate import Record, SimulationRun, SmoothRun
from contbreather.simulation.states import PERIOD
from contbreather.simulation.sweep import Sweep

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[Any]

RUNS = (SimulationRun, SmoothRun)
OUTCOMES = {
    Outcome.RETURNED: BLUE,
    Outcome.OTHER: SKY,
    Outcome.SPREAD: ORANGE,
    Outcome.QUIET: "#dddddd",
    Outcome.OUTSIDE: "white",
    Outcome.PENDING: "#f5f5f5",
}
COLUMNS = {
    "p": "$p$",
    "amplitude": "speed of the centre",
    "participation": "participation ratio",
    "tilt": "asymmetry",  # t2 - t1 - pi, by the name that branches have for it
    "centre": "site with most energy",
    "others": "impacts elsewhere, a period",
}


def plot_motion(
    record: Record | SimulationRun | SmoothRun | Trajectory,
    *,
    periods: tuple[float, float] | None = None,
    x: str | None = None,
    y: str | Sequence[str] | None = None,
    ax: Axes | None = None,
) -> Drawn:
    """Displacements of the recorded sites over time in periods; of a trajectory of flows its
    states.

    More than 20 periods are drawn by their envelopes, the largest and the smallest displacement in
    each period, and the axis says of how many samples. Of a run with impacts these are part of the
    lines: its sites reach their walls however coarsely they were sampled.

    Parameters
    ----------
    record : Record, simulation.SimulationRun, SmoothRun or flows.Trajectory
        A run that was asked for ``sample=Sample(sites)``, or its ``record``; or what `integrate`
        returns.
    periods : pair of float, optional
        From which to which time, in periods of the forcing, of a trajectory in its own unit; all of
        it unless given.
    x, y : str, optional
        Of a trajectory, as for `plot_orbit`: every state over the time unless given.
    ax : matplotlib Axes, optional
        A new figure of the width of a journal column unless given.

    Raises
    ------
    BadInput
        For a run without a record, or periods in which nothing was recorded.

    Examples
    --------
    >>> import contbreather as cb
    >>> from contbreather.simulation import Sample
    >>> state = cb.symmetric(a=0.5, gamma=0.08, k=0.8).state(10)
    >>> run = cb.simulate(state, a=0.5, gamma=0.08, k=0.8, periods=2, sample=Sample((0, 1)))
    >>> len(plot_motion(run.record).axes.get_lines())
    2
    """
    if isinstance(record, Trajectory):
        within = None if periods is None else _window(record.t, periods)
        return draw_states(ax, record, x, y, within)
    if x is not None or y is not None:
        raise BadInput("x and y are states of a trajectory of flows; sites are chosen by Sample")
    if isinstance(record, RUNS):
        if record.record is None:
            raise BadInput(
                "this run has its states once in a period only; simulate with "
                "sample=cb.simulation.Sample(sites=(0, 1)) to record some sites densely"
            )
        run, record = record, record.record
    else:
        run = None
    check_kind(record, Record, "a run with densely recorded sites, or its record,")
    first, last = _window(record.times / PERIOD, periods)
    with canvas.drawing(ax) as (drawn, axes):
        for i, n in enumerate(record.sites):
            t, u = record.times, record.u[:, i]
            t, u = with_impacts(t, u, run, n)
            inside = (first <= t / PERIOD) & (t / PERIOD <= last)
            t, u = t[inside], u[inside]
            look: dict[str, Any] = {"color": CYCLE[i % len(CYCLE)], "label": f"$u_{{{n}}}$"}
            if last - first > LONG:
                edges, _ = edges_of(t)
                low, high = (np.append(end, end[-1]) for end in envelope(t, u, edges))
                band = {"step": "post", "alpha": 0.5, "linewidth": 0.5, **look}
                axes.fill_between(edges / PERIOD, low, high, **band)
            else:
                axes.plot(t / PERIOD, u, "-", linewidth=1.0, **look)
        extremes = f", range in a period ({samples(record.times)})"
        axes.set(xlabel=r"$t/2\pi$", ylabel=f"$u_n${extremes if last - first > LONG else ''}")
        axes.margins(x=0.0)
        canvas.legend_above(axes, fontsize=canvas.legend_size(axes))
    return drawn


def _window(t: Array, periods: tuple[float, float] | None) -> tuple[float, float]:
    if periods is None:
        return float(t[0]), float(t[-1])
    ends = row("periods", periods, "a pair (from, to)").tolist()
    if len(ends) != 2 or not np.any((ends[0] <= t) & (t <= ends[1])):
        raise BadInput(
            f"periods = {periods}: a pair (from, to) was expected, within what was recorded, "
            f"{t[0]:.6g} to {t[-1]:.6g}"
        )
    return ends[0], ends[1]


def plot_section(
    run: SimulationRun | SmoothRun, *, site: int = 0, skip: int = 0, ax: Axes | None = None
) -> Drawn:
    """The stroboscopic section of one site: its velocity over its displacement, once in a period.

    Parameters
    ----------
    run : simulation.SimulationRun or SmoothRun
    site : int
    skip : int
        Periods to leave out at the beginning, as a transient.
    ax : matplotlib Axes, optional
        A new figure of the width of a journal column unless given.
    """
    check_kind(run, RUNS, "a run")
    whole("skip", skip, 0)
    if not isinstance(site, int | np.integer):
        raise BadInput(f"site = {site!r}: the number of a site was expected")
    if not 0 <= skip <= run.periods:
        raise BadInput(f"skip = {skip}: the run has {run.periods} periods to leave out.")
    u, v = (states[skip:, site % run.sites] for states in run.strobe)
    with canvas.drawing(ax) as (drawn, axes):
        axes.plot(u, v, ".", color=BLUE, markersize=1.2 if len(u) > 200 else 3.0)
        axes.set(xlabel=f"$u_{{{site}}}$", ylabel=rf"$\dot u_{{{site}}}$")
        # a fixed point is a point, however deep its rounding could be zoomed into
        for values, limits in ((u, axes.set_xlim), (v, axes.set_ylim)):
            if np.ptp(values) < 1e-3:
                limits(values.mean() - 1e-3, values.mean() + 1e-3)
    return drawn


def plot_localisation(run: SimulationRun | SmoothRun, *, ax: Axes | None = None) -> Drawn:
    """The participation ratio once in a period: about 1 in a breather, N where all share.

    Parameters
    ----------
    run : simulation.SimulationRun or SmoothRun
    ax : matplotlib Axes, optional
        A new figure of the width of a journal column unless given.
    """
    check_kind(run, RUNS, "a run")
    seen = localised(*run.strobe, run.times, run.conditions)
    with canvas.drawing(ax) as (drawn, axes):
        axes.plot(run.times / PERIOD, seen.participation, "-", color=BLUE, linewidth=0.8)
        axes.set_ylim(0.0, max(4.0, 1.05 * float(np.nanmax(seen.participation))))
        axes.margins(x=0.0)
        axes.set(xlabel=r"$t/2\pi$", ylabel="participation ratio")
    return drawn


def plot_sweep(sweep: Sweep, *, y: str = "p", ax: Axes | None = None) -> Drawn:
    """Draw a column of a slow sweep over its parameter, upwards and downwards in two colours.

    Parameters
    ----------
    sweep : Sweep
    y : str
        One of its columns: ``p``, ``amplitude``, ``participation``, ``tilt``, ``others``.
    ax : matplotlib Axes, optional
        Those of the continued branch for instance, to see both together; axes that show another
        quantity are refused.

    Examples
    --------
    >>> import contbreather as cb
    >>> from contbreather.simulation import sweep, there_and_back
    >>> state = cb.symmetric(a=0.2, gamma=0.04, k=0.8).state(10)
    >>> way = there_and_back([0.2, 0.1, 0.05])
    >>> found = sweep(state, "a", way, periods=20, a=0.2, gamma=0.04, k=0.8, damping=0.01)
    >>> [line.get_label() for line in plot_sweep(found).axes.get_lines()]
    ['sweep down', 'sweep up']
    """
    check_kind(sweep, Sweep, "a sweep")
    one_of("y", y, tuple(COLUMNS))
    x, column = sweep.value, np.asarray(getattr(sweep, y), dtype=float)
    turns = 1 + np.flatnonzero(np.diff(np.sign(np.diff(x))) != 0.0)
    looks = {1.0: ("sweep up", BLUE, "^"), -1.0: ("sweep down", VERMILLION, "v")}
    named: set[float] = set()
    with canvas.drawing(ax) as (drawn, axes):
        canvas.name_axes(axes, canvas.symbol(sweep.name), COLUMNS[y])
        for start, end in pairwise([0, *turns.tolist(), len(x) - 1]):
            way = float(np.sign(x[end] - x[start])) or 1.0
            name, colour, mark = looks[way]
            piece = slice(start, end + 1)
            axes.plot(
                x[piece], column[piece], mark, color=colour, markersize=2.6, linestyle="none",
                label=None if way in named else name,
            )  # fmt: skip
            named.add(way)
        axes.legend(frameon=False, loc="best", handletextpad=0.2, fontsize=canvas.legend_size(axes))
    return drawn


def plot_basin(basin: Basin, *, ax: Axes | None = None) -> Drawn:
    """Draw the outcome of each start of a plane in colours that a legend explains.

    Examples
    --------
    >>> from concurrent.futures import ThreadPoolExecutor
    >>> import contbreather as cb
    >>> from contbreather.simulation import Axis, attraction
    >>> state = cb.symmetric(a=0.5, gamma=0.02, k=0.4).state(5)
    >>> u, v = Axis("u", 0, [-0.9, 0.9]), Axis("v", 0, [-1.0, 0.0, 1.0])
    >>> with ThreadPoolExecutor(1) as one:
    ...     seen = attraction(state, u, v, a=0.5, gamma=0.02, k=0.4, periods=20, executor=one)
    >>> ax = plot_basin(seen).axes
    >>> ax.get_xlabel(), ax.get_ylabel()
    ('$u_{0}$', '$\\\\dot u_{0}$')
    """
    check_kind(basin, Basin, "what attraction() gives")
    from matplotlib.colors import BoundaryNorm, ListedColormap
    from matplotlib.patches import Patch

    order = sorted(OUTCOMES)
    colours = ListedColormap([OUTCOMES[outcome] for outcome in order])
    norm = BoundaryNorm([order[0] - 0.5, *(outcome + 0.5 for outcome in order)], len(order))
    with canvas.drawing(ax) as (drawn, axes):
        axes.pcolormesh(
            basin.x.values, basin.y.values, basin.outcome, cmap=colours, norm=norm,
            shading="nearest", rasterized=True,
        )  # fmt: skip
        axes.set(
            xlabel=_coordinate(basin.x.name, basin.x.site),
            ylabel=_coordinate(basin.y.name, basin.y.site),
        )
        seen = [outcome for outcome in OUTCOMES if np.any(basin.outcome == outcome)]
        patches = [
            Patch(facecolor=OUTCOMES[outcome], edgecolor=GREY, linewidth=0.4, label=outcome.words)
            for outcome in seen
        ]
        axes.legend(
            handles=patches, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2, frameon=False,
            handlelength=1.0, handletextpad=0.4, columnspacing=1.0,
            fontsize=canvas.legend_size(axes),
        )  # fmt: skip
    return drawn


def _coordinate(name: str, site: int) -> str:
    return f"$u_{{{site}}}$" if name == "u" else rf"$\dot u_{{{site}}}$"
