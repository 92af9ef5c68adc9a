"""Runs, sections, slow sweeps and attraction: what simulation leaves, as pictures.

Long runs are drawn by what they reach in each of their periods: a picture has fewer dots than they
have swings, and what is left of these, if some are skipped, is not there in the run.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from contbreather.checks import check_kind, is_whole, one_of, row, whole
from contbreather.continuation.curve.point import Point
from contbreather.errors import BadInput
from contbreather.flows.integrate import Trajectory
from contbreather.orbits.orbit import Orbit
from contbreather.oscillators.breather_problem import Breather
from contbreather.oscillators.oscillator_lattice import Oscillators
from contbreather.plotting import canvas, orbits
from contbreather.plotting.canvas import BLUE, CYCLE, GREY, ORANGE, SKY, VERMILLION, Drawn
from contbreather.simulation.basin import Basin, Outcome
from contbreather.simulation.integrator import Sample
from contbreather.simulation.measures import localised
from contbreather.simulation.simulate import (
    Record,
    SimulationRun,
    SmoothRun,
    States,
    completed,
    let_go,
)
from contbreather.simulation.states import PERIOD, State
from contbreather.simulation.sweep import Sweep

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[Any]

SAMPLES = 40  # in a period, of a run of oscillators
ANGLE = r"$\omega t/2\pi$"
LONG = 20.0  # periods; of more, lines would fill the axes
ROWS = 300  # as many as a column of a journal shows one beside the other
NO_PERIOD = "nothing was recorded: only whole periods are, and this run has none; make it longer"
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

    Of oscillators more than 20 periods, or more than 7 sites, are drawn as `plot_space_time` does,
    with the energy below. Of other runs more than 20 periods are drawn by their envelopes, the
    largest and the smallest displacement in each period, from 300 periods on in several together,
    and the axis says of how many samples. Of a run with impacts these are part of the lines: its
    sites reach their walls however coarsely they were sampled.

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
    ax : matplotlib Axes; a new figure for a journal column unless given

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
        if x is None and y is None and within is None and _is_large(record):
            return _draw_large(ax, record)
        return orbits.draw_states(ax, record, x, y, within)
    if x is not None or y is not None:
        raise BadInput("x and y are states of a trajectory of flows; sites are chosen by Sample")
    kinds, wanted = (Record, States), "a run with densely recorded sites, or its record,"
    remedy = "cb.integrate(orbit, periods=2) runs a cycle or a breather, cb.simulate(state) a chain"
    check_kind(record, kinds, wanted, remedy)
    run: Any = record
    record = getattr(run, "record", run)
    if record is None:
        raise BadInput(
            "this run has its states once in a period only; simulate with "
            "sample=cb.simulation.Sample(sites=(0, 1)) to record some sites densely"
        )
    assert isinstance(record, Record)
    if not record.times.size:
        raise BadInput(NO_PERIOD)
    first, last = _window(record.times / PERIOD, periods)
    shown = (first <= record.times / PERIOD) & (record.times / PERIOD <= last)
    edges, extremes = _stretches(record.times[shown])
    with canvas.drawing(ax) as (drawn, axes):
        for i, n in enumerate(record.sites):
            t, u = with_impacts(record.times, record.u[:, i], run, n)
            inside = (first <= t / PERIOD) & (t / PERIOD <= last)
            t, u = t[inside], u[inside]
            look: dict[str, Any] = {"color": CYCLE[i % len(CYCLE)], "label": f"$u_{{{n}}}$"}
            if last - first > LONG:
                low, high = (np.append(end, end[-1]) for end in _envelope(t, u, edges))
                band = {"step": "post", "alpha": 0.5, "linewidth": 0.5, **look}
                axes.fill_between(edges / PERIOD, low, high, **band)
            else:
                dashes = canvas.DASHES[i % len(canvas.DASHES)]
                axes.plot(t / PERIOD, u, dashes, linewidth=1.0, **look)
        words = f"$u_n$, range {extremes}" if last - first > LONG else "$u_n$"
        axes.set(xlabel=orbits.PERIODS, ylabel=words)
        axes.margins(x=0.0)
        canvas.legend_above(axes, fontsize=canvas.legend_size(axes))
    return drawn


def _is_large(run: Trajectory) -> bool:
    """Tell a run of oscillators of which lines of all states would fill the axes."""
    chain, phase = run.flows[0].f, run.params.get("omega", 1.0) * np.ptp(run.t)
    return isinstance(chain, Oscillators) and bool(
        chain.sites > len(CYCLE) or phase > LONG * PERIOD
    )


def _draw_large(ax: Axes | None, run: Trajectory) -> Drawn:
    """Draw the displacements of all sites in space and time, and below them the energy of all and
    that of the site which has most of it in the end."""
    record = _record_of(run)
    energies = _chain_of(run).site_energies(np.hstack([record.u, record.v]).T, run.params)
    most = int(energies[:, -1].argmax())
    with canvas.drawing(ax, height=11.0) as (drawn, axes):
        above, below = orbits.panels_of(axes, 2, sharex=False, height_ratios=(3, 1))
        plot_space_time(run, ax=above)
        if below is not above:
            for name, E in (("all sites", energies.sum(axis=0)), (f"site {most}", energies[most])):
                drawn += below.plot(record.times / PERIOD, E, linewidth=0.8, label=name)
            low, high = min(0.0, energies.min()), energies.sum(axis=0).max()
            below.set(xlabel=ANGLE, ylabel="energy", ylim=(low, high + 0.1 * (high - low)))
            below.margins(x=0.0)
            canvas.legend_above(below)
    return drawn


def _chain_of(run: Trajectory) -> Oscillators:
    chain: Any = run.flows[0].f
    check_kind(chain, Oscillators, "a run of a lattice of oscillators")
    return chain


def _record_of(run: Trajectory) -> Record:
    """Record all sites of a run of oscillators, over the phase of what moves at omega."""
    omega, sites = run.params.get("omega", 1.0), _chain_of(run).sites
    count = math.ceil(SAMPLES * omega * np.ptp(run.t) / PERIOD)
    times = np.linspace(run.t[0], run.t[-1], count + 1)
    u, v = run(times).reshape(2, sites, -1).transpose(0, 2, 1)
    return Record(omega * times, tuple(range(sites)), u, v)


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


def plot_space_time(
    motion: Orbit | Point | Record | SimulationRun | SmoothRun | Trajectory,
    *,
    sites: Sequence[int] | None = None,
    ax: Axes | None = None,
) -> Drawn:
    """Displacements as colours over sites and time in periods of the forcing.

    Parameters
    ----------
    motion : Orbit, Point, SimulationRun, SmoothRun or Record; of oscillators a breather or a run
        An orbit is shown over its period; a run as its sites were recorded densely, of more than
        20 periods by the largest size of each site in a period, or in several. Of a run without a
        record the last 20 periods are shown, simulated again from its state before them; under
        noise, its states once a period, which the scale says.
    sites : sequence of int, optional
        As for `plot_profile`; all that were recorded of a run. Of a `Grid` one row unless given:
        that of the site that hits, of a run that of the site that moves most, if all
        of that row was recorded.
    ax : matplotlib Axes; a new figure for a journal column unless given

    Examples
    --------
    >>> import contbreather as cb
    >>> ax = plot_space_time(cb.symmetric(a=0.5, gamma=0.08, k=0.8)).axes
    >>> ax.get_xlabel(), ax.get_ylabel()
    ('$n$', '$t/2\\\\pi$')
    """
    row, title = _row_of_grid(motion) if sites is None else (None, "")
    shown, periods = _with_record(motion)
    title = ", ".join(filter(None, (title, periods)))
    times, there, u = _field(shown, sites if row is None else row)
    if not times.size:
        raise BadInput(NO_PERIOD)
    words, signed = "$u_n$", True
    if isinstance(shown, Record | States):
        once = isinstance(shown, States) and shown.record is None
        long = float(times[-1] - times[0]) / math.tau
        if once:
            words += rf" once a period, at $t = {times[0] % math.tau:.4g}$ mod $2\pi$"
        if long > (ROWS if once else LONG):
            times, u, words = _largest(times, there, u, shown)
            signed = False
    label, there = ("$n$", there) if row is None else ("column", there - row.start)
    gaps = np.ptp(there) >= len(there)  # then side by side: no colour is of a site that is left out
    places = np.arange(len(there)) if gaps else there
    with canvas.drawing(ax, height=8.0) as (drawn, axes):
        look = {**orbits.colours_of(u, signed), "shading": "nearest", "rasterized": True}
        mesh = axes.pcolormesh(places, times / math.tau, u, **look)
        of_oscillators = isinstance(orbits.solution_of(motion), Trajectory | Breather)
        axes.set(xlabel=label, ylabel=ANGLE if of_oscillators else orbits.PERIODS)
        axes.set_title(title, loc="left")
        orbits.whole_numbers(axes.xaxis)
        if gaps:
            named = slice(None, None, -(-len(there) // 8))
            axes.set_xticks(places[named], there[named])
        axes.figure.colorbar(mesh, ax=axes, label=words)
    return drawn


def _with_record(motion: Any) -> tuple[Any, str]:
    """The end of a run without a record, simulated again with all sites recorded, and which of its
    periods these are; anything else as it is.

    At the strobe every site of a breather has one sign.
    """
    if isinstance(motion, Trajectory):
        return _record_of(motion), ""
    strobed = isinstance(motion, States) and motion.record is None and motion.periods > 0
    if not strobed or getattr(motion, "noise", False):  # noise would be another one
        return motion, ""
    again = end_of(motion, int(LONG), Sample(range(motion.sites)))
    cut = again.periods < motion.periods
    return again, f"the last {again.periods} of {motion.periods} periods" if cut else ""


def end_of(run: States, periods: int, sample: Sample) -> Any:
    """Simulate the last periods of a run, or one, again, with some sites recorded densely."""
    first = max(0, run.periods - periods)
    state = State(run.strobe.u[first], run.strobe.v[first])
    how: dict[str, Any] = {"t0": float(run.times[first]), "sample": sample, "progress": False}
    return completed(let_go(state, run.conditions, periods=max(1, run.periods - first), **how))


def _row_of_grid(motion: Any) -> tuple[range | None, str]:
    """Sites of one row of a grid, and which it is; None off a grid."""
    if isinstance(motion, Record):
        return None, ""
    if isinstance(motion, States):
        recorded = range(motion.sites) if motion.record is None else motion.record.sites
        site = recorded[int(abs(motion.strobe.u[:, recorded]).max(axis=0).argmax())]
        lattice, role = motion.conditions.lattice, "moves most"
    elif isinstance(motion, Trajectory):
        chain = _chain_of(motion)
        site = int(abs(motion.x[: chain.sites]).max(axis=1).argmax())
        lattice, role = chain.lattice, "moves most"
    else:
        orbit = orbits.drawn_orbit(motion)
        hits = isinstance(orbit, Orbit)
        site = orbit.section.impacts[0][0] if hits else int(orbit.swings.argmax())
        lattice, role = orbit.lattice, "hits" if hits else "moves most"
    shape = getattr(lattice, "shape", None)
    if shape is None:
        return None, ""
    row = site // shape[1]
    sites = range(row * shape[1], (row + 1) * shape[1])
    if isinstance(motion, States) and not {*sites} <= {*recorded}:
        return None, ""  # a few sites that were recorded are no row
    return sites, f"row {row}, in which site {site} {role}"


def _field(motion: Any, sites: Sequence[int] | None) -> tuple[Array, Array, Array]:
    """Times, sites in ascending order, and displacements of shape (times, sites)."""
    chosen = None if sites is None else orbits.chosen_sites(sites)
    if isinstance(motion, States):
        chosen = None if chosen is None else [n % motion.sites for n in chosen]
        every = Record(motion.times, tuple(range(motion.sites)), *motion.strobe)
        motion = every if motion.record is None else motion.record
    if isinstance(motion, Record):
        wanted = motion.sites if chosen is None else chosen
        if missing := [n for n in wanted if n not in motion.sites]:
            raise BadInput(
                f"sites = {sites}: site {missing[0]} was not recorded; there are {motion.sites}"
            )
        there = np.sort([n for n in motion.sites if n in wanted])
        return motion.times, there, motion.u[:, [motion.sites.index(n) for n in there]]
    orbit = orbits.drawn_orbit(motion)
    drawn = sorted(orbits.all_sites(orbit) if chosen is None else chosen)
    turns = orbit.section.turns if isinstance(orbit, Orbit) else 1
    times = np.linspace(0.0, orbit.period, orbits.MOMENTS * turns + 1)
    u = np.stack([orbit.displacement(n, times) for n in drawn], axis=1)
    return times * (math.tau * turns / orbit.period), np.array(drawn), u


def with_impacts(t: Array, u: Array, run: Any, site: int) -> tuple[Array, Array]:
    """Samples of a site, and its impacts between them, where it is at a wall."""
    if not isinstance(run, SimulationRun):
        return t, u
    impacts = run.at_site(site)
    impacts = impacts[(impacts["time"] >= t[0]) & (impacts["time"] <= t[-1])]
    walls = [run.conditions.walls.position(site, int(wall)) for wall in impacts["wall"]]
    order = np.argsort(np.concatenate([t, impacts["time"]]), kind="stable")
    return np.concatenate([t, impacts["time"]])[order], np.concatenate([u, walls])[order]


def _envelope(t: Array, u: Array, edges: Array) -> tuple[Array, Array]:
    begins = np.searchsorted(t, edges[:-1] - 1e-9 * PERIOD)  # but for rounding
    return np.minimum.reduceat(u, begins), np.maximum.reduceat(u, begins)


def _stretches(t: Array) -> tuple[Array, str]:
    """Begins of periods, or of several together where they are many, and the end; that in words."""
    length = float(t[-1] - t[0]) / PERIOD
    many = max(1, math.ceil(length / ROWS - 1e-9))
    edges = np.append(t[0] + PERIOD * np.arange(0.0, length - 1e-9, many), t[-1])
    count = round(many * (len(t) - 1) / length) if length else len(t)
    periods = "a period" if many == 1 else f"{many} periods"
    return edges, f"in {periods} ({count} sample{'s' if count > 1 else ''})"


def _largest(t: Array, sites: Array, u: Array, run: Any) -> tuple[Array, Array, str]:
    """Times, the largest size of each site about each of them, and that in words."""
    edges, words = _stretches(t)
    columns = [
        np.max(np.abs(_envelope(*with_impacts(t, u[:, i], run, int(n)), edges)), axis=0)
        for i, n in enumerate(sites)
    ]
    return 0.5 * (edges[:-1] + edges[1:]), np.stack(columns, axis=1), f"largest $|u_n|$ {words}"


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
    ax : matplotlib Axes; a new figure for a journal column unless given
    """
    check_kind(run, States, "a run")
    whole("skip", skip, 0)
    if not is_whole(site):
        raise BadInput(f"site = {site!r}: the number of a site was expected")
    if skip > run.periods:
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
    ax : matplotlib Axes; a new figure for a journal column unless given
    """
    check_kind(run, States, "a run")
    seen = localised(*run.strobe, run.times, run.conditions)
    with canvas.drawing(ax) as (drawn, axes):
        axes.plot(run.times / PERIOD, seen.participation, "-", color=BLUE, linewidth=0.8)
        axes.set_ylim(0.0, max(4.0, 1.05 * float(np.nanmax(seen.participation))))
        axes.margins(x=0.0)
        axes.set(xlabel=orbits.PERIODS, ylabel="participation ratio")
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
    looks = {True: ("sweep up", BLUE, "^"), False: ("sweep down", VERMILLION, "v")}
    with canvas.drawing(ax) as (drawn, axes):
        canvas.name_axes(axes, canvas.symbol(sweep.name), COLUMNS[y])
        for start, end in pairwise([0, *turns.tolist(), len(x) - 1]):
            name, colour, mark = looks[bool(x[end] >= x[start])]
            look = {"color": colour, "markersize": 2.6, "linestyle": "none"}
            named = name in axes.get_legend_handles_labels()[1]
            piece = slice(start, end + 1)
            axes.plot(x[piece], column[piece], mark, label=None if named else name, **look)
        pixel, told = canvas.lay_out(axes), axes.get_legend_handles_labels()
        canvas.fitting_legend(drawn, pixel, *told, frameon=False)
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
        names = {"u": "u_{{{}}}", "v": r"\dot u_{{{}}}"}
        x, y = (f"${names[along.name].format(along.site)}$" for along in (basin.x, basin.y))
        axes.set(xlabel=x, ylabel=y)
        patches = [
            Patch(facecolor=colour, edgecolor=GREY, linewidth=0.4, label=outcome.words)
            for outcome, colour in OUTCOMES.items() if np.any(basin.outcome == outcome)
        ]  # fmt: skip
        axes.legend(
            handles=patches, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2, frameon=False,
            handlelength=1.0, handletextpad=0.4, columnspacing=1.0,
            fontsize=canvas.legend_size(axes),
        )  # fmt: skip
    return drawn
