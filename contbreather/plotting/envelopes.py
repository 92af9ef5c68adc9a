"""Long runs by what they reach in each of their periods: a picture has fewer dots than they have
swings, and what is left of these, if some are skipped, is not there in the run."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contbreather.simulation.simulate import SimulationRun
from contbreather.simulation.states import PERIOD

Array = NDArray[Any]

LONG = 20.0  # periods; of more, lines would fill the axes
ROWS = 300  # as many as a column of a journal shows one beside the other


def with_impacts(t: Array, u: Array, run: Any, site: int) -> tuple[Array, Array]:
    """Samples of a site, and its impacts between them, where it is at a wall."""
    if not isinstance(run, SimulationRun):
        return t, u
    impacts = run.at_site(site)
    impacts = impacts[(impacts["time"] >= t[0]) & (impacts["time"] <= t[-1])]
    walls = [run.conditions.walls.position(site, int(wall)) for wall in impacts["wall"]]
    order = np.argsort(np.concatenate([t, impacts["time"]]), kind="stable")
    return np.concatenate([t, impacts["time"]])[order], np.concatenate([u, walls])[order]


def envelope(t: Array, u: Array, edges: Array) -> tuple[Array, Array]:
    begins = np.searchsorted(t, edges[:-1] - 1e-9 * PERIOD)  # but for rounding
    return np.minimum.reduceat(u, begins), np.maximum.reduceat(u, begins)


def edges_of(t: Array, rows: int | None = None) -> tuple[Array, int]:
    """Begins of periods, or of too many for so many rows several together, and the end; and how
    many."""
    length = float(t[-1] - t[0]) / PERIOD
    many = 1 if rows is None else max(1, math.ceil(length / rows - 1e-9))
    begins = t[0] + PERIOD * np.arange(0.0, length - 1e-9, many)
    return np.append(begins, t[-1]), many


def largest(t: Array, sites: Array, u: Array, run: Any) -> tuple[Array, Array, str]:
    """Times, the largest size of each site about each of them, and that in words."""
    edges, many = edges_of(t, ROWS)
    columns = [
        np.max(np.abs(envelope(*with_impacts(t, u[:, i], run, int(n)), edges)), axis=0)
        for i, n in enumerate(sites)
    ]
    periods = "a period" if many == 1 else f"{many} periods"
    words = f"largest $|u_n|$ in {periods} ({samples(t, many)})"
    return 0.5 * (edges[:-1] + edges[1:]), np.stack(columns, axis=1), words


def samples(t: Array, periods: int = 1) -> str:
    count = round(periods * PERIOD * (len(t) - 1) / float(t[-1] - t[0]))
    return f"{count} sample{'s' if count > 1 else ''}"
