"""Orbits of the infinite chain and of rings by the periodic Green's function: problems to trace."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contbreather.breathers.asymmetric import NAMES, AsymmetricEquations
from contbreather.breathers.grazing import merging
from contbreather.breathers.lifts import from_arms, lift
from contbreather.breathers.orbit import Orbit, orbit_of
from contbreather.breathers.problem import on_ring, orbit_problem, read_by, unstable_by
from contbreather.breathers.road import Impacts, Offsets, Road, road
from contbreather.breathers.section import Impact, Section, check_order
from contbreather.breathers.watched import GreenWatch
from contbreather.breathers.wave_events import (
    EQUAL,
    events_on,
    orbit_fold,
    pitchfork_of_arms,
    symmetric_again,
)
from contbreather.breathers.waves import GreenFlight, OrbitEquations, Params
from contbreather.continuation import Point, Problem, branch_point, fold
from contbreather.errors import BadInput
from contbreather.lattice import InfiniteChain, Ring
from contbreather.lattice.conditions import Conditions, Walls
from contbreather.stability.verdict import THRESHOLD

FloatArray = NDArray[np.float64]

LEAST = 1e-12  # an impulse smaller than this is none
ACROSS = Section(((0, 1), (0, -1)))


@road(2)
@dataclass(frozen=True)
class Waves(GreenFlight):
    """Any impacts, by the waves they send along chain or ring."""

    @staticmethod
    def suits(on: Conditions, section: Section) -> bool:
        plain = not (on.damping or on.spring) and on.walls == Walls()
        return plain and section.sign > 0 and isinstance(on.lattice, InfiniteChain | Ring)

    @classmethod
    def through(
        cls, on: Conditions, section: Section, times: Any, impulses: Any, offsets: Offsets
    ) -> Waves:
        if not section.count == len(times) == len(impulses):
            raise BadInput(
                f"{section.count} impacts, {len(times)} times, {len(impulses)} impulses: one time "
                "and one impulse for each impact is expected."
            )
        check_order(section, times)
        offsets = offsets or (0.0,) * len(section.hit)
        return cls.of(on, section, [*times, *impulses, *offsets], on.params)

    @classmethod
    def of(cls, on: Conditions, section: Section, x: Any, params: Params) -> Waves:
        """With these times, impulses and offsets."""
        m, values = section.count, np.asarray(x, dtype=float).tolist()
        named = zip(section.impacts, values[:m], values[m : 2 * m], strict=True)
        impacts = tuple(Impact(*impact, t, J) for impact, t, J in named)
        return cls(on.at(params), section, impacts, tuple(values[2 * m :]))

    @classmethod
    def arm(cls, on: Conditions, section: Section, x: Any, params: Params) -> Waves:
        """With ``p, t1, t2, c`` of two impacts."""
        p, t1, t2, c = x
        return cls.of(on, section, (t1, t2, -2.0 * p, 2.0 * p, c), params)

    def problem(self, threshold: float) -> Problem:
        orbit = Orbit(self)
        if self.section.two_impacts and abs(orbit.asymmetry) > EQUAL:
            return asymmetric_problem(orbit, threshold)
        return impact_problem(orbit, threshold)

    def guess(self) -> Problem:
        return impact_problem(Orbit(self))

    @property
    def watch(self) -> GreenWatch:
        return GreenWatch(Orbit(self))

    def lifted(self) -> Problem:
        return Orbit(self).doubled().problem

    def rewritten(self, section: Section, impacts: Impacts, offsets: Offsets) -> Road | None:
        if not section.symmetric:
            return replace(self, section=section, impacts=tuple(impacts), offsets=tuple(offsets))
        if section.count > 1 or section.impacts[0] != (0, 1):
            return None
        (one,) = impacts
        return orbit_of(self.conditions, section, [one.time], [one.impulse]).road

    def on(self, lattice: Any) -> None:
        """Its impacts are as good a guess as any."""


# --- any impacts ----------------------------------------------------------------------------------


@read_by("orbit with impacts", Waves.of)
def impact_problem(orbit: Orbit, threshold: float = THRESHOLD) -> Problem:
    """The equations of an orbit with any impacts, with the orbit as their start.

    Columns: t1..tm, J1..Jm and c (c1, c2, ... where several sites take impacts); a, gamma, k and
    the parameters of the forcing; ``unstable``, the number of multipliers outside; for two impacts
    ``p``, and ``asymmetry`` where half a symmetric orbit may do. Every branch point of the
    equations is BP, on a branch of symmetric breathers their pitchfork, too; from an arm it is PF.
    """
    motion = orbit.flight
    equations: OrbitEquations = motion.equations
    record: dict[str, Any] = {"unstable": unstable_by(threshold)}
    own = {"p": orbit.section.two_impacts, "asymmetry": orbit.section.mirrored}
    record |= {name: attrgetter(f"solution.{name}") for name, there in own.items() if there}
    return orbit_problem(
        "orbit with impacts",
        partial(Waves.of, orbit.conditions, orbit.section),
        orbit,
        threshold,
        residual=equations.residual,
        start=dict(zip(equations.names, motion.x.tolist(), strict=True)),
        params=_params(orbit),
        jacobian=equations.jacobian,
        sensitivity=equations.sensitivity,
        events=(
            fold(),
            from_arms(branch_point()),
            *events_on(orbit.lattice, threshold),
            *merging(orbit.section),
        ),
        record=record,
        domain=domain_of(equations),
        label="orbit with impacts",
    )


def _params(orbit: Orbit) -> dict[str, float]:
    """a, gamma, k and the parameters of the forcing."""
    held = ("damping", "spring")
    return {name: v for name, v in orbit.conditions.params.items() if name not in held}


def domain_of(equations: OrbitEquations) -> dict[str, tuple[float, float]]:
    """Where the parameters mean something, and each impulse pushes away from its wall."""
    edge = 0.25 if equations.lattice.sites is not None else 0.25 / equations.section.turns**2
    domain = {"gamma": (0.0, edge), "k": (0.0, 1.0), "a": (0.0, math.inf)}
    for i, (_, wall) in enumerate(equations.section.impacts):
        domain[f"J{i + 1}"] = (-math.inf, -LEAST) if wall > 0 else (LEAST, math.inf)
    return domain


# --- two impacts of one site ----------------------------------------------------------------------


@read_by("asymmetric breather", Waves.arm)
def asymmetric_problem(orbit: Orbit, threshold: float = THRESHOLD) -> Problem:
    """The four equations with an orbit of two impacts as their start, and all its events.

    Columns: p, t1, t2, c; a, gamma, k and the parameters of the forcing; ``asymmetry`` is
    t2 - t1 - pi, ``unstable`` the number of multipliers outside.
    """
    first = orbit.impacts[0].time
    times = first, first + math.pi + orbit.asymmetry  # times count modulo the period
    equations = AsymmetricEquations(orbit.forcing, orbit.lattice)
    return orbit_problem(
        "asymmetric breather",
        partial(Waves.arm, orbit.conditions, orbit.section),
        orbit,
        threshold,
        residual=equations.residual,
        start=dict(zip(NAMES, (orbit.p, *times, orbit.c), strict=True)),
        params=_params(orbit),
        jacobian=equations.jacobian,
        sensitivity=equations.sensitivity,
        events=(pitchfork_of_arms(), orbit_fold(), *events_on(orbit.lattice, threshold)),
        record={"asymmetry": _asymmetry, "unstable": unstable_by(threshold)},
        domain={
            "gamma": (0.0, 0.25),
            "k": (0.0, 1.0),
            "a": (0.0, math.inf),
            "p": (LEAST, math.inf),
        },
        images=_mirror_image,
        lifts={"PF": symmetric_again, "PD": lift},
        label=f"asymmetric breather{on_ring(orbit.lattice, threshold)}",
    )


def _asymmetry(point: Point) -> float:
    return float(point["t2"] - point["t1"] - math.pi)


def _mirror_image(x: FloatArray, params: Mapping[str, float]) -> tuple[FloatArray, ...]:
    p, t1, t2, c = x
    return (np.array((p, t2 - math.pi, t1 + math.pi, -c)),)
