"""Orbits of finite lattices by exact modes: the equations of shooting as problems to trace."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contbreather.continuation.curve import Curve
from contbreather.continuation.equilibria import fold
from contbreather.continuation.point import Point
from contbreather.continuation.problem import Problem
from contbreather.lattice.conditions import Conditions
from contbreather.orbits.grazing import GrazingSite
from contbreather.orbits.orbit import Orbit
from contbreather.orbits.orbit_events import branching, events_of
from contbreather.orbits.orbit_problem import OrbitProblem, orbit_problem, unstable_by
from contbreather.orbits.section import WEAK, Section
from contbreather.parameters import NUMBERS
from contbreather.stability.verdict import THRESHOLD

FloatArray = NDArray[np.float64]
Params = Mapping[str, float]


def modal_problem(orbit: Orbit, threshold: float = THRESHOLD) -> Problem:
    """The shooting equations with an orbit as their start, and all its events.

    Columns: ``t1, t2, ...`` and the arrays ``q, r`` of unknowns; a, gamma, k, damping, spring and
    the parameters of the forcing; half the momenta, ``p1, p2, ...``, and ``p``, the first, where
    one site has one impact or two; the offset ``c``; where half a symmetric orbit may do, its
    ``asymmetry``; ``unstable``, the number of multipliers beyond the threshold over the whole
    period, and the condition number ``condition``: computed when asked for.
    """
    flight = orbit.representation
    section, on = orbit.section, orbit.conditions
    shooting = flight.equations
    times = {f"t{j + 1}": float(time) for j, time in enumerate(flight.t)}
    # below it idle sites rest anywhere, and the equations are singular
    least = WEAK if _loose(section, on) else 0.0
    bounds = {name: (number.low, number.high) for name, number in NUMBERS.items()}
    return orbit_problem(
        "shooting",
        shooting.flight,
        orbit,
        threshold,
        _Shooting,
        residual=shooting.residual,
        start={**times, "q": flight.q, "r": flight.r},
        params=on.params,
        events=(fold(), branching(), *events_of(section, on.lattice, threshold)),
        record=_columns(section, threshold),
        domain={**bounds, "gamma": (least, on.lattice.highest_gamma)},
        label=f"shooting, {on.lattice.describe()}, {section.describe()}",
        equations=shooting,
    )


@dataclass(frozen=True, eq=False, repr=False)
class _Shooting(OrbitProblem):
    equations: Any = field(kw_only=True)

    def derivatives(self, x: FloatArray, params: Params, names: tuple[str, ...]) -> FloatArray:
        return self.equations.derivatives(x, params, names)


def _loose(section: Section, on: Conditions) -> bool:
    """Whether idle sites may rest anywhere without coupling; an orbit that comes back with the
    opposite sign has them rest at 0."""
    return on.spring < WEAK and on.lattice.sites > 1 and not section.symmetric


def _columns(section: Section, threshold: float) -> dict[str, Any]:
    """What is recorded besides the unknowns."""
    count = section.count
    same = count == 1 or (count == 2 and section.local and not section.symmetric)
    names = {"p": 0} if same else {}
    if count > 1:
        names |= {f"p{j + 1}": j for j in range(count)}
    columns: dict[str, Any] = {name: partial(_momentum, j) for name, j in names.items()}
    if not section.symmetric:
        columns["c"] = attrgetter("solution.c")
    if section.mirrored:
        columns["asymmetry"] = attrgetter("solution.asymmetry")
    columns["unstable"] = unstable_by(threshold)
    return {**columns, "condition": attrgetter("solution.representation.condition")}


def _momentum(j: int, point: Point) -> float:
    # (4): an impact transfers 2p
    return 0.5 * abs(float(point.solution.impulses[j]))


def grazing_site(site: int) -> GrazingSite:
    return GrazingSite(site, partial(_slopes_at, site))


def _slopes_at(site: int, curve: Curve, orbit: Orbit, t: float) -> FloatArray:
    slopes: FloatArray = orbit.representation.slopes_at(site, t, curve.free)
    return slopes


def speed_slope(j: int, curve: Curve, z: FloatArray, extra: FloatArray) -> FloatArray:
    flight = Point(curve, z).solution.representation
    return flight.tangents(curve.free).speeds[j : j + 1]
