"""What the compiled loops go by and work with: couplings by rows, walls by sites, forced motion,
and room for the events and for one step."""

from __future__ import annotations

from typing import NamedTuple

from contbreather.kernels import Counts, Cube, Matrix, Signs, Vector


class Drive(NamedTuple):
    """A trigonometric sum ``sum of c cos(m t) + s sin(m t)``: the forced motion, or the force."""

    m: Vector
    c: Vector
    s: Vector


class Bonds(NamedTuple):
    """What pulls at each site, per unit mass: K and the drive by sites, K by its rows (CSR)."""

    start: Counts  # entries of site n are those from start[n] to start[n + 1]
    other: Counts
    weight: Vector  # -K[n, other]
    # by sites, in rows: K[n, n]; d - 1, by how much more a site is driven than the common motion
    # says; K 1, what pulls at the common motion
    pulls: Matrix


class Law(NamedTuple):
    """What does not change during a run: the lattice, its damping, its walls, its forcing."""

    ring: bool  # without springs: nothing but neighbours pulls, by gamma, so a stencil will do
    gamma: float
    bonds: Bonds
    # by sites, in rows: the low and the high wall, infinite where there is none; the smaller
    # distance of both from 0
    walls: Matrix
    mu: float
    k: float
    step: float
    rest_step: float  # with a site at rest, which moves with all harmonics of the forcing
    size: int  # terms of the series in time
    most: int  # impacts of one site in one period
    motion: Drive  # a g(t), g'' + mu g' = F/a
    force: Drive  # F(t)


class Log(NamedTuple):
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


class Watch(NamedTuple):
    """Sites recorded densely: at the times ``grid`` after the start of each period."""

    sites: Counts
    grid: Vector
    u: Cube  # (periods, times, sites)
    v: Cube


class Work(NamedTuple):
    """Room for one step. ``rows`` of site n are powers of (s - origin[n])/h, s the step's time."""

    v: Vector  # at the start of the step, or at the present event
    w: Vector
    rows: Matrix
    origin: Vector
    last_v: Vector  # at the end of the step, where no event intervenes
    last_w: Vector
    reach: Vector  # no |v| is larger during the step
    patch: Matrix
    lift: Matrix
    column: Vector
    shifted: Vector
    push: Matrix  # of the drive of a site at rest, its cosines and sines
    when: Vector
    side: Signs
    held: Signs
    place: Vector  # of the wall that holds a site
    fresh: Signs
    changed: Signs
    hits: Counts
    busy: Counts  # the sites that may have an event in this step, ``many`` of them
    many: Counts
    listed: Signs
