"""What the compiled loops go by and work with: couplings by rows, walls by sites, forced motion,
and room for the events and for one step."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from contbreather.dynamics.flow import STEP, Bonds, Drive, terms
from contbreather.dynamics.states import wall_rows
from contbreather.lattice import Ring
from contbreather.lattice.conditions import Conditions
from contbreather.lattice.finite import Finite, drive_of, stiffness_of

Array = NDArray[Any]


class Law(NamedTuple):
    """What does not change during a run: the lattice, its damping, its walls, its forcing."""

    ring: bool  # without springs: nothing but neighbours pulls, by gamma, so a stencil will do
    gamma: float
    bonds: Bonds
    # by sites, in rows: the low and the high wall, infinite where there is none; the smaller
    # distance of both from 0
    walls: Array
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

    used: NDArray[np.int64]
    period: NDArray[np.int64]
    phase: Array
    site: NDArray[np.int64]
    kind: NDArray[np.int8]
    wall: NDArray[np.int8]
    before: Array
    after: Array
    push: Array  # acceleration just before an impact; how long after its last one a rest begins


class Watch(NamedTuple):
    """Sites recorded densely: at the times ``grid`` after the start of each period."""

    sites: NDArray[np.int64]
    grid: Array
    u: Array  # (periods, times, sites)
    v: Array


class Work(NamedTuple):
    """Room for one step. ``rows`` of site n are powers of (s - origin[n])/h, s the step's time."""

    v: Array  # at the start of the step, or at the present event
    w: Array
    rows: Array
    origin: Array
    last_v: Array  # at the end of the step, where no event intervenes
    last_w: Array
    reach: Array  # no |v| is larger during the step
    patch: Array
    lift: Array
    column: Array
    when: Array
    side: NDArray[np.int8]
    held: NDArray[np.int8]
    place: Array  # of the wall that holds a site
    fresh: NDArray[np.int8]
    changed: NDArray[np.int8]
    hits: NDArray[np.int64]
    busy: NDArray[np.int64]  # the sites that may have an event in this step, ``many`` of them
    many: NDArray[np.int64]
    listed: NDArray[np.int8]


@lru_cache(maxsize=64)
def law_of(conditions: Conditions) -> Law:
    """What does not change during a run under these conditions."""
    c = conditions
    lattice, k, mu = c.lattice, float(c.k), float(c.damping)
    motion, force = motions(c)
    bonds, norm = _bonds(lattice, float(c.gamma), float(c.spring))
    low, high = wall_rows(c.walls, lattice.sites)
    rate, top = max(math.sqrt(norm), mu, 0.25), float(motion.m.max())
    if bonds.pulls[1:].any():  # the series are those of the forcing as well
        rate = max(rate, top)
    step = min(STEP, 3.0 / rate)
    # a site that rests on its wall moves, in v, with the forcing: its harmonics must converge too
    rest_step = step * rate / max(rate, top)
    ring = isinstance(lattice, Ring) and c.spring == 0.0
    sides = np.array([low, high, np.minimum(high, -low)])
    length = terms(step * rate)
    where = (ring, float(c.gamma), bonds, sides)
    return Law(*where, mu, k, step, rest_step, length, 0, motion, force)


def motions(conditions: Conditions) -> tuple[Drive, Drive]:
    """a g(t) with ``g'' + mu g' = F/a``, the forced motion without couplings; and F(t)."""
    table = np.array(conditions.forcing.harmonics, dtype=float).reshape(-1, 3)
    m, c, s = (np.ascontiguousarray(column) for column in table.T)
    c, s = conditions.a * c, conditions.a * s  # of f, f'' = F
    turned = (c - 1j * s) / (1.0 - 1j * conditions.damping / m)
    own = np.ascontiguousarray(turned.real), np.ascontiguousarray(-turned.imag)
    return Drive(m, *own), Drive(m, -(m**2) * c, -(m**2) * s)


def _bonds(lattice: Finite, gamma: float, spring: float) -> tuple[Bonds, float]:
    """Couplings and springs per unit mass, and the largest sum over a row of their sizes."""
    unit = stiffness_of(lattice)
    table = sparse.csr_array(gamma * unit / np.asarray(lattice.masses)[:, None])
    own: Array = table.diagonal() + spring
    ground: Array = table.sum(axis=1) + spring
    # what rounding leaves of a sum that is zero would drive the lattice
    size = abs(table).sum(axis=1) + spring
    ground[abs(ground) <= 1e-14 * size] = 0.0
    beside = sparse.csr_array(-(table - sparse.diags_array(table.diagonal())))
    beside.eliminate_zeros()
    start, other = (x.astype(np.int64) for x in (beside.indptr, beside.indices))
    pulls = np.array([own, drive_of(lattice) - 1.0, ground])
    return Bonds(start, other, np.asarray(beside.data, dtype=np.float64), pulls), float(size.max())
