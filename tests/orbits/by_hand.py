"""Orbits put together from their impacts; how well a ring repeats one; breathers whose neighbour
just touches a wall; derivatives by differences."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np
from scipy.optimize import brentq

from contbreather.lattice import InfiniteChain, Ring, forcing_of
from contbreather.lattice.conditions import Conditions
from contbreather.orbits import neighbour_peak, symmetric
from contbreather.orbits.orbit import Orbit, orbit_of
from contbreather.orbits.section import Section
from contbreather.simulation import simulate


def orbit_from(
    impacts: Iterable[tuple[int, int, float, float]],
    offsets: Any = (),
    turns: int = 1,
    *,
    a: float = 0.5,
    gamma: float = 0.08,
    k: float = 0.8,
    forcing: Any = None,
    lattice: Any = None,
) -> Orbit:
    """From (site, wall, time, impulse) of every impact."""
    rows = [tuple(impact) for impact in impacts]
    section = Section(tuple((site, wall) for site, wall, _, _ in rows), turns)
    drive = forcing_of(forcing)
    on = Conditions(a, gamma, k, forcing=drive, lattice=lattice or InfiniteChain())
    return orbit_of(on, section, [row[2] for row in rows], [row[3] for row in rows], offsets)


def touching(
    site: int, gamma: float, k: float, low: float, high: float = 3.0, **more: Any
) -> tuple[Orbit, float]:
    """The symmetric breather with an amplitude between two at which a site reaches its wall, and
    when it does."""

    def above(a: float) -> float:
        return neighbour_peak(symmetric(a, gamma, k, root=1, **more), site)[1] - 1.0

    b = symmetric(brentq(above, low, high, xtol=1e-14), gamma, k, root=1, **more)
    return b, neighbour_peak(b, site)[0]


def repeats(orbit: Orbit, sites: int, t0: float = 0.3) -> tuple[float, float]:
    """How far a period of exact simulation takes a ring from its start, and half of one."""
    own = orbit.on(Ring(sites))
    u, v = own.state(sites, t0)
    on, turns = own.conditions, own.section.turns
    shared = {"a": on.a, "gamma": on.gamma, "k": on.k, "forcing": on.forcing}
    run = simulate((u, v), **shared, periods=turns, t0=t0)
    assert len(run.impacts) == len(own.impacts)
    end = max(np.abs(run.final.u - u).max(), np.abs(run.final.v - v).max())
    return end, np.abs(run.strobe.u[turns // 2] - u).max()


def derivatives(
    equations: Any, x: np.ndarray, params: Mapping[str, float], h: float
) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
    """Each column of the Jacobian (named "") and each sensitivity, and what differences make of
    the residual in its place."""

    def slope(unit: np.ndarray, shift: Mapping[str, float]) -> np.ndarray:
        def at(e: float) -> np.ndarray:
            moved = {name: value + e * shift.get(name, 0.0) for name, value in params.items()}
            return equations.residual(x + e * unit, moved)

        return (8 * (at(h) - at(-h)) - (at(2 * h) - at(-2 * h))) / (12 * h)

    for column, unit in zip(equations.jacobian(x, params).T, np.eye(x.size), strict=True):
        yield "", column, slope(unit, {})
    for name in params:
        yield name, equations.sensitivity(x, params, name), slope(np.zeros(x.size), {name: 1.0})
