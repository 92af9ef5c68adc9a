"""What the compiled loops go by, made from the conditions of a run."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from contbreather.lattice import Ring
from contbreather.lattice.conditions import Conditions
from contbreather.lattice.finite import Finite, drive_of, stiffness_of
from contbreather.simulation.flow import STEP, terms
from contbreather.simulation.room import Bonds, Drive, Law
from contbreather.simulation.states import wall_rows

Array = NDArray[Any]


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
