"""Arguments of the kernels of rigid walls: parameters, event log, dense output, and workspace."""

from __future__ import annotations

from typing import NamedTuple

from contbreather.kernels import Counts, Cube, Matrix, Signs, Vector


class Harmonics(NamedTuple):
    """A trigonometric sum ``sum of c cos(m t) + s sin(m t)``: the forced motion, or the force."""

    m: Vector
    c: Vector
    s: Vector


class Couplings(NamedTuple):
    """What pulls at each site, per unit mass: K and the drive by sites, K by its rows (CSR)."""

    start: Counts  # entries of site n are those from start[n] to start[n + 1]
    other: Counts
    weight: Vector  # -K[n, other]
    # by sites, in rows: K[n, n]; d - 1, by how much more a site is driven than the common motion
    # says; K 1, what pulls at the common motion
    pulls: Matrix


class Parameters(NamedTuple):
    """What does not change during a run: the lattice, its damping, its walls, its forcing."""

    ring: bool  # without springs: K is gamma (2, -1, -1), and nothing drives v
    gamma: float
    bonds: Couplings
    # by sites, in rows: the low and the high wall, infinite where there is none; the smaller
    # distance of both from 0
    walls: Matrix
    mu: float
    k: float
    step: float  # over which the series converge to rounding in ``size`` terms
    rest_step: float  # with a site at rest, which moves in v with all harmonics of the forcing
    size: int  # terms of the series in time
    most: int  # impacts of one site in one period
    motion: Harmonics  # a g(t), g'' + mu g' = F/a
    force: Harmonics  # F(t)


class EventLog(NamedTuple):
    """Events in the order of time; ``used`` of them are filled."""

    used: Counts
    period: Counts
    phase: Vector
    site: Counts
    kind: Signs
    wall: Signs
    before: Vector
    after: Vector
    push: Vector  # acceleration just before an impact; how long after its last one a rest begins


class DenseOutput(NamedTuple):
    """Sites recorded densely: at the times ``grid`` after the start of each period."""

    sites: Counts
    grid: Vector
    u: Cube  # (periods, times, sites)
    v: Cube


class Workspace(NamedTuple):
    """Of one step. ``rows`` of site n are powers of (s - origin[n])/h, s the step's time."""

    v: Vector  # v = u - a g(t) and w = v', at the start of the step, or at the present event
    w: Vector
    rows: Matrix  # (powers, sites)
    origin: Vector
    last_v: Vector  # at the end of the step, where no event intervenes
    last_w: Vector
    reach: Vector  # no |v| is larger during the step
    patch: Matrix  # rows of the sites around an impact
    push_rows: Matrix  # of the push of a wall on a site at rest, without what drives it
    column: Vector  # powers of the forced motion
    drive: Matrix  # what drives a site at rest, its cosines and sines
    when: Vector  # a site's next event in the step
    side: Signs  # the wall that it then meets
    at_rest: Signs  # the wall on which a site rests, or 0
    place: Vector  # of that wall
    released: Signs  # the wall that has just let go of a site, or 0
    changed: Signs  # whether a site has an event now
    hits: Counts  # in this period
    candidates: Counts  # the sites that may have an event in this step, ``many`` of them
    many: Counts
    listed: Signs  # whether a site is among them
