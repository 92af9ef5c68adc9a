"""Growth of small perturbations along a run: the variational flow with its saltations.

Between impacts perturbations obey the unforced lattice, whatever the orbit does. At an impact of
site n only that site's pair changes, by the block of (19), with damping

    ``du+ = -k du-,   dv+ = R' dv- + b du-,   b = (1 - R') u''/u' + (1 + k) mu``,

both just before, for a velocity u' that becomes R(u') = -k u': R' = -k where k is a number. A site
that rests on its wall has no perturbation; where the wall lets go, nothing jumps. So the tangent
flow needs of an orbit only the list of its impacts. Between smooth walls perturbations are
integrated together with the motion.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from itertools import pairwise, repeat
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from contbreather.checks import check_kind, numbers
from contbreather.errors import BadInput, NotConverged, deferred
from contbreather.lattice.conditions import Conditions
from contbreather.simulation.event_loop import TANGENT_FLOW, begin_period
from contbreather.simulation.integrator import EventDriven, in_chunks, parameters_of, workspace_of
from contbreather.simulation.simulate import SimulationRun, SmoothRun
from contbreather.simulation.smooth import state_after
from contbreather.simulation.states import PERIOD, SmoothConditions, State, within, within_period

Array = NDArray[Any]
# times in their period, sites, entries b (or codes), ratios of velocities, slopes of the impact law
Events = tuple[Array, Array, Array, Array, Array]


def variation(run: SimulationRun | SmoothRun, vectors: ArrayLike | None = None) -> Array:
    """The derivative of a run's final state with respect to its first one, times some vectors.

    Parameters
    ----------
    run : Run or SmoothRun
    vectors : array_like, shape (2 N, m), optional
        Perturbations (u_0 .. u_N-1, u'_0 .. u'_N-1) of the first state, in columns; the identity
        unless given, for the whole matrix. A rigid run must not begin or end at an impact.

    Returns
    -------
    ndarray, shape (2 N, m)

    Examples
    --------
    >>> from contbreather.orbits import symmetric
    >>> from contbreather.simulation import simulate
    >>> b = symmetric(a=0.5, gamma=0.08, k=0.8)
    >>> matrix = variation(simulate(b.state(5), a=0.5, gamma=0.08, k=0.8, periods=1))
    >>> round(float(np.linalg.det(matrix)), 10)  # k^2 for each of the two impacts
    0.4096
    """
    check_kind(run, (SimulationRun, SmoothRun), "a run")
    sites = run.sites
    columns = np.eye(2 * sites) if vectors is None else numbers("vectors", vectors)
    if columns.ndim != 2 or len(columns) != 2 * sites:
        raise BadInput(
            f"perturbations of {sites} sites are columns of length {2 * sites}; "
            f"an array of shape {columns.shape} was given."
        )
    start, t0 = State(run.strobe.u[0], run.strobe.v[0]), within_period(run.times[0])
    if isinstance(run, SmoothRun):
        span = (run.end - run.times[0]) / PERIOD
        if span == 0.0:
            return columns
        return np.asarray(
            state_after(run.conditions, start, t0, span, slopes=True, columns=columns)[1]
        )
    impacts, rests = run.impacts.copy(), run.rests.copy()
    for table in (impacts, rests):
        table["time"] -= run.times[0]
    remainder = run.end - run.times[-1]  # a fraction of a period, or rounding of times
    spans = [PERIOD] * run.periods + ([remainder] if remainder > 1e-12 else [])
    events = saltations(impacts, rests, run.conditions, t0, range(len(spans)))
    at_rest = sites_at_rest(start, run.conditions, t0)
    for span, jumps in zip(spans, events, strict=True):
        columns = carried(columns, at_rest, span, run.conditions, jumps)
    return columns


def carried(
    columns: Array, at_rest: Array, span: float, conditions: Conditions, events: Events
) -> Array:
    """Perturbations, in columns, after a time; ``at_rest`` is kept up to date."""
    on, sites = parameters_of(conditions), at_rest.size
    # a perturbation a row, its sites side by side
    du, dv = np.ascontiguousarray(columns.T.reshape(-1, 2, sites).transpose(1, 0, 2))
    room = np.zeros(on.size), np.zeros((2, sites)), np.empty((on.size, sites))
    with deferred():
        TANGENT_FLOW(du, dv, at_rest, span, on, *events, *room)
    return np.concatenate([du, dv], axis=1).T


def variations_along(
    state: State, on: Conditions | SmoothConditions, periods: int, t0: float
) -> Iterator[Callable[[Array], Array]]:
    """For each period of a motion, what becomes in it of perturbations in columns."""
    if isinstance(on, SmoothConditions):

        def turned(columns: Array) -> Array:
            nonlocal state
            x, image, _ = state_after(on, state, t0, 1.0, slopes=True, columns=columns)
            state = State(*np.split(x, 2))
            return np.asarray(image)

        yield from repeat(turned, periods)
        return
    start = within(state, on.walls)
    at_rest = sites_at_rest(start, on, t0)
    for chunk in in_chunks(EventDriven(start, on, t0), periods=periods, progress=False):
        if chunk.stop is not None:
            raise NotConverged(chunk.reason)
        which = range(chunk.first, chunk.first + chunk.periods)
        for events in saltations(chunk.impacts, chunk.rests, on, t0, which):
            yield partial(carried, at_rest=at_rest, span=PERIOD, conditions=on, events=events)


def saltations(
    impacts: NDArray[np.void],
    rests: NDArray[np.void],
    conditions: Conditions,
    t0: float,
    periods: range,
) -> Iterator[Events]:
    """Events of each of these periods, as the kernel takes them.

    ``time`` of the tables counts from the start of the run; a NaN of b marks where a rest begins,
    an infinite one where it ends.
    """
    # (19): the impact shifts by -du/u', and in a time dt velocities part by (u''+ - R' u''-) dt
    ratio, slope = conditions.laws_at(impacts["before"], impacts["site"])
    b = (1.0 - slope) * impacts["acceleration"] / impacts["before"]
    b += (1.0 - ratio) * conditions.scaled.at_sites("damping", impacts["site"])
    rests = _at_impacts(rests, impacts)
    codes = np.where(rests["begins"], np.nan, np.inf)
    names = ("time", "period", "phase", "site")
    time, period, phase, site = (np.concatenate([impacts[n], rests[n]]) for n in names)
    # the phase is exact, the time says which turn it belongs to
    since = phase - t0
    since += PERIOD * np.round((time - PERIOD * period - since) / PERIOD)
    entry = np.concatenate([b, codes])
    ratio, slope = (np.concatenate([x, np.zeros(len(rests))]) for x in (ratio, slope))
    # at equal times the impact comes before the rest it leads to
    order = np.lexsort((np.isnan(entry), since, period))
    edges = np.searchsorted(period[order], np.arange(periods.start, periods.stop + 1))
    for begin, end in pairwise(edges):
        rows = order[begin:end]
        yield since[rows], site[rows], entry[rows], ratio[rows], slope[rows]


def _at_impacts(rests: NDArray[np.void], impacts: NDArray[np.void]) -> NDArray[np.void]:
    """Rests that begin at the last impact listed: the rebounds after it take what is left away."""
    moved = rests.copy()
    for site in np.unique(rests["site"][rests["begins"]]):
        hits = impacts[impacts["site"] == site]
        rows = np.flatnonzero(rests["begins"] & (rests["site"] == site))
        last = np.searchsorted(hits["time"], rests["time"][rows], side="right") - 1
        # a site that rests from the start of the run has no impact before
        for name in ("time", "period", "phase"):
            moved[name][rows[last >= 0]] = hits[name][last[last >= 0]]
    return moved


def sites_at_rest(state: State, conditions: Conditions, t0: float) -> NDArray[np.int8]:
    """The wall on which each site rests, or 0, as the event-driven loop finds it."""
    on = parameters_of(conditions)
    work = workspace_of(state.u.size, on.size, len(on.force))
    begin_period(on, work, *state, t0)
    return np.asarray(work.at_rest)
