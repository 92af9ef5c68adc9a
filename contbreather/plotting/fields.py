"""All sites at once: their displacements at one time, over time, and on a grid."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from contbreather.checks import number, row
from contbreather.continuation.point import Point
from contbreather.errors import BadInput
from contbreather.orbits.orbit import Orbit
from contbreather.plotting.canvas import BLUE, GREY, Drawn, drawing
from contbreather.plotting.orbits import chosen_sites, drawn_orbit
from contbreather.simulation.simulate import Record, SimulationRun, SmoothRun

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis

Array = NDArray[np.float64]

BESIDE = 10  # sites of the infinite chain on each side of the first that hits
MOMENTS = 200  # of a period of the forcing, in a picture over time
COLOURS = "RdBu_r"  # white where a site is at rest


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
    orbit : Orbit, or a Point of a branch of orbits
    t : float
        Time; the forcing has the period 2 pi.
    sites : sequence of int, optional
        All sites of a finite lattice, and ten on each side of the one that hits on the infinite
        chain, unless given. All sites of a `Grid` are colours, in its rows and columns.
    shape : (int, int), optional
        Rows and columns to show the sites of another lattice in.
    ax : matplotlib Axes, optional
        A new figure of the width of a journal column unless given.

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
    chosen = _all_sites(motion) if sites is None else chosen_sites(sites)
    if sites is None and shape is None:
        shape = getattr(motion.lattice, "shape", None)
    u = np.array([motion.displacement(n, number("t", t, -math.inf, math.inf, "a time"))
                  for n in chosen])  # fmt: skip
    with drawing(ax) as (drawn, axes):
        if shape is None:
            _stems(axes, chosen, u, motion)
        else:
            _tiles(axes, u, shape)
    return drawn


def plot_space_time(
    motion: Orbit | Point | Record | SimulationRun | SmoothRun,
    *,
    sites: Sequence[int] | None = None,
    ax: Axes | None = None,
) -> Drawn:
    """Displacements as colours over sites and time in periods of the forcing.

    Parameters
    ----------
    motion : Orbit, Point, simulation.SimulationRun, SmoothRun or Record
        An orbit is shown over its period; a run as its sites were recorded densely, or else once a
        period.
    sites : sequence of int, optional
        As for `plot_profile`; all that were recorded of a run. Of a `Grid` one row unless given:
        that of the site that hits, of a run that of the site that moves most, if all
        of that row was recorded.
    ax : matplotlib Axes, optional
        A new figure of the width of a journal column unless given.

    Examples
    --------
    >>> import contbreather as cb
    >>> ax = plot_space_time(cb.symmetric(a=0.5, gamma=0.08, k=0.8)).axes
    >>> ax.get_xlabel(), ax.get_ylabel()
    ('$n$', '$t/2\\\\pi$')
    """
    row, title = _row_of_grid(motion) if sites is None else (None, "")
    times, there, u = _field(motion, sites if row is None else row)
    label, there = ("$n$", there) if row is None else ("column", there - row.start)
    with drawing(ax, height=8.0) as (drawn, axes):
        limit = float(np.abs(u).max()) or 1.0
        mesh = axes.pcolormesh(there, times / math.tau, u, cmap=COLOURS, vmin=-limit, vmax=limit,
                               shading="nearest", rasterized=True)  # fmt: skip
        axes.set(xlabel=label, ylabel=r"$t/2\pi$")
        axes.set_title(title, loc="left")
        _whole_numbers(axes.xaxis)
        axes.figure.colorbar(mesh, ax=axes, label="$u_n$")
    return drawn


def _row_of_grid(motion: Any) -> tuple[range | None, str]:
    """The sites of one row of a grid, and which it is; None of what is on no grid."""
    if isinstance(motion, Record):
        return None, ""
    if isinstance(motion, SimulationRun | SmoothRun):
        recorded = range(motion.sites) if motion.record is None else motion.record.sites
        site = recorded[int(abs(motion.strobe.u[:, recorded]).max(axis=0).argmax())]
        lattice, role = motion.conditions.lattice, "moves most"
    else:
        orbit = drawn_orbit(motion)
        lattice, site, role = orbit.lattice, orbit.section.impacts[0][0], "hits"
    shape = getattr(lattice, "shape", None)
    if shape is None:
        return None, ""
    row, columns = site // shape[1], shape[1]
    sites = range(row * columns, (row + 1) * columns)
    if isinstance(motion, SimulationRun | SmoothRun) and not {*sites} <= {*recorded}:
        return None, ""  # a few sites that were recorded are no row
    return sites, f"row {row}, in which site {site} {role}"


def _field(motion: Any, sites: Sequence[int] | None) -> tuple[Array, Array, Array]:
    """Times, sites in ascending order, and displacements of shape (times, sites)."""
    if isinstance(motion, SimulationRun | SmoothRun):
        if motion.record is None:
            every = np.arange(motion.sites)
            chosen = every if sites is None else np.array(chosen_sites(sites)) % motion.sites
            return motion.times, np.sort(chosen), motion.strobe.u[:, np.sort(chosen)]
        motion = motion.record
    if isinstance(motion, Record):
        wanted = motion.sites if sites is None else chosen_sites(sites)
        if missing := [n for n in wanted if n not in motion.sites]:
            raise BadInput(
                f"sites = {sites}: site {missing[0]} was not recorded; there are {motion.sites}"
            )
        order = sorted((i for i, n in enumerate(motion.sites) if n in wanted),
                       key=lambda i: motion.sites[i])  # fmt: skip
        return motion.times, np.array(motion.sites)[order], motion.u[:, order]
    orbit = drawn_orbit(motion)
    drawn = sorted(_all_sites(orbit) if sites is None else chosen_sites(sites))
    times = np.linspace(0.0, orbit.period, MOMENTS * orbit.section.turns + 1)
    return times, np.array(drawn), np.stack([orbit.displacement(n, times) for n in drawn], axis=1)


def _all_sites(orbit: Orbit) -> list[int]:
    first = orbit.section.impacts[0][0]
    if orbit.lattice.sites is None:
        return list(range(first - BESIDE, first + BESIDE + 1))
    return list(range(orbit.lattice.sites))


def _stems(ax: Axes, sites: Sequence[int], u: Array, orbit: Orbit) -> None:
    ax.vlines(sites, 0.0, u, color=BLUE, linewidth=1.0)
    ax.plot(sites, u, "o", color=BLUE, markersize=4)
    ax.axhline(0.0, color=GREY, linewidth=0.3, zorder=0)
    ends = np.array([orbit.walls.at(n) for n in sites])
    for wall in np.unique(ends[np.isfinite(ends)]):  # of each site that has one there
        struck = [n for n, pair in zip(sites, ends, strict=True) if wall in pair]
        ax.plot(struck, np.full(len(struck), wall), "_", color=GREY, markersize=8)
    ax.set(xlabel="$n$", ylabel="$u_n$")
    _whole_numbers(ax.xaxis)


def _tiles(ax: Axes, u: Array, shape: tuple[int, int]) -> None:
    rows, columns = (int(count) for count in row("shape", shape, "(rows, columns)"))
    if rows * columns != u.size:
        raise BadInput(f"shape = {shape}: {rows * columns} places for {u.size} sites")
    limit = float(np.abs(u).max()) or 1.0
    image = ax.imshow(u.reshape(rows, columns), cmap=COLOURS, vmin=-limit, vmax=limit)
    ax.set(xlabel="column", ylabel="row")
    _whole_numbers(ax.xaxis)
    _whole_numbers(ax.yaxis)
    ax.figure.colorbar(image, ax=ax, label="$u_n$")


def _whole_numbers(axis: Axis) -> None:
    from matplotlib.ticker import MaxNLocator

    axis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))
