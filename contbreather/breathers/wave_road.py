"""Orbits of the infinite chain and of rings by the periodic Green's function: problems to trace."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contbreather.breathers.asymmetric import NAMES, AsymmetricEquations
from contbreather.breathers.images import images_of, simpler_than
from contbreather.breathers.lifts import lift
from contbreather.breathers.orbit import Orbit, checked, orbit_at, orbit_of, plain, with_parameters
from contbreather.breathers.road import Road, road
from contbreather.breathers.section import Impact, Section, check_order
from contbreather.breathers.watched import GreenWatch
from contbreather.breathers.wave_events import (
    EQUAL,
    events_on,
    orbit_fold,
    pitchfork_of_arms,
    symmetric_again,
    unstable,
)
from contbreather.breathers.waves import GreenFlight, OrbitEquations, Params
from contbreather.continuation import Event, Point, Problem, branch_point, fold
from contbreather.continuation.point import Counting
from contbreather.continuation.recipes import Recipe
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
        cls, on: Conditions, section: Section, times: Any, impulses: Any, offsets: Sequence[float]
    ) -> Waves:
        if not section.count == len(times) == len(impulses):
            raise BadInput(
                f"{section.count} impacts, {len(times)} times, {len(impulses)} impulses: one time "
                "and one impulse for each impact is expected."
            )
        check_order(section, times)
        named = zip(section.impacts, times, impulses, strict=True)
        impacts = tuple(Impact(*impact, float(t), float(J)) for impact, t, J in named)
        offsets = tuple(float(c) for c in offsets) or (0.0,) * len(section.hit)
        return cls(on, section, impacts, offsets)

    def problem(self, threshold: float) -> Problem:
        orbit = Orbit(self)
        if self.section.two_impacts and abs(orbit.asymmetry) > EQUAL:
            return asymmetric_problem(orbit, threshold)
        return impact_problem(orbit, threshold)

    def guess(self) -> Problem:
        return impact_problem(Orbit(self))

    def events(self, threshold: float) -> tuple[Event, ...]:
        return self.problem(threshold).events

    @property
    def watch(self) -> GreenWatch:
        return GreenWatch(Orbit(self))

    def lifted(self) -> Problem:
        return Orbit(self).doubled().problem

    def rewritten(
        self,
        section: Section,
        impacts: Sequence[Impact],
        offsets: Sequence[float],
        start: int = 0,
        sign: int = 1,
    ) -> Road | None:
        if not section.symmetric:
            return replace(self, section=section, impacts=tuple(impacts), offsets=tuple(offsets))
        if section.count > 1 or section.impacts[0] != (0, 1):
            return None
        (one,) = impacts
        return orbit_of(self.conditions, section, [one.time], [one.impulse]).road

    def on(self, lattice: Any) -> Orbit | None:
        """By Newton's method, from the same impacts and offsets."""
        conditions = replace(self.conditions, lattice=lattice)
        if not self.suits(conditions, self.section):
            return None
        moved = self if lattice.sites is None else self._around(lattice.sites)
        solved, found = Orbit(replace(moved, conditions=conditions)).problem.solve(tolerance=1e-11)
        orbit = orbit_at(solved)
        checked(orbit, found.iterations)
        return orbit

    def _around(self, ring: int) -> Waves:
        """With its sites counted around a ring."""
        section = self.section.around(ring)
        # offsets belong to the sites from left to right
        order = sorted(range(len(self.offsets)), key=lambda i: self.section.hit[i] % ring)
        impacts = tuple(one._replace(site=one.site % ring) for one in self.impacts)
        return replace(
            self, section=section, impacts=impacts, offsets=tuple(self.offsets[i] for i in order)
        )


# --- any impacts ----------------------------------------------------------------------------------


def impact_problem(orbit: Orbit, threshold: float = THRESHOLD) -> Problem:
    """The equations of an orbit with any impacts, with the orbit as their start.

    Columns: t1..tm, J1..Jm and c (c1, c2, ... where several sites take impacts); a, gamma, k and
    the parameters of the forcing; ``unstable``, the number of multipliers outside; for two impacts
    ``p`` and ``asymmetry``. Every branch point of the equations is BP: on a branch of symmetric
    breathers that is their pitchfork.
    """
    motion = orbit.flight
    equations: OrbitEquations = motion.equations
    record: dict[str, Any] = {"unstable": Counting(partial(_unstable, threshold))}
    if orbit.section.two_impacts:
        record["p"], record["asymmetry"] = (
            attrgetter("solution.p"),
            attrgetter("solution.asymmetry"),
        )
    return Problem(
        equations.residual,
        dict(zip(equations.names, motion.x.tolist(), strict=True)),
        _params(orbit),
        jacobian=equations.jacobian,
        sensitivity=equations.sensitivity,
        events=(fold(), branch_point(), *events_on(orbit.lattice, threshold)),
        record=record,
        domain=domain_of(equations),
        interpret=partial(_interpreted, equations, orbit.conditions),
        images=partial(_images, equations, orbit.conditions),
        simpler=_simpler,
        lifts={"PD": lift},
        wider=partial(with_parameters, threshold),
        label="orbit with impacts",
        recipe=_recipe("orbit with impacts", orbit, threshold),
    )


def _orbit(equations: OrbitEquations, on: Conditions, x: FloatArray, values: Params) -> Orbit:
    times, impulses, offsets = equations.split(x)
    named = zip(equations.sequence, times.tolist(), impulses.tolist(), strict=True)
    impacts = tuple(Impact(*impact, t, J) for impact, t, J in named)
    return Orbit(Waves(on.at(values), equations.section, impacts, tuple(offsets.tolist())))


def _interpreted(equations: OrbitEquations, on: Conditions, point: Point) -> Orbit:
    return _orbit(equations, on, point.x, point.params)


def _images(
    equations: OrbitEquations, on: Conditions, x: FloatArray, values: Params
) -> tuple[FloatArray, ...]:
    return tuple(image.flight.x for image in images_of(_orbit(equations, on, x, values)))


def _unstable(threshold: float, point: Point) -> float:
    return unstable(point.solution, threshold)


def _recipe(kind: str, orbit: Orbit, threshold: float) -> Recipe:
    on = {"conditions": orbit.conditions, "section": orbit.section}
    return Recipe(kind, {**on, "threshold": threshold}, plain)


def _params(orbit: Orbit) -> dict[str, float]:
    """a, gamma, k and the parameters of the forcing."""
    held = ("damping", "spring")
    return {name: v for name, v in orbit.conditions.params.items() if name not in held}


def domain_of(equations: OrbitEquations) -> dict[str, tuple[float, float]]:
    """Where the parameters mean something, and each impulse pushes away from its wall."""
    edge = 0.25 if equations.lattice.sites is not None else 0.25 / equations.turns**2
    domain = {"gamma": (0.0, edge), "k": (0.0, 1.0), "a": (0.0, math.inf)}
    for i, (_, wall) in enumerate(equations.sequence):
        domain[f"J{i + 1}"] = (-math.inf, -LEAST) if wall > 0 else (LEAST, math.inf)
    return domain


def _simpler(point: Point) -> Problem | None:
    orbit: Orbit = point.solution
    small = simpler_than(orbit)
    if small is not None:
        return small.problem
    if orbit.section.two_impacts and abs(orbit.asymmetry) > EQUAL:
        return orbit.problem
    return None


# --- two impacts of one site ----------------------------------------------------------------------


def asymmetric_problem(orbit: Orbit, threshold: float = THRESHOLD) -> Problem:
    """The four equations with an orbit of two impacts as their start, and all its events.

    Columns: p, t1, t2, c; a, gamma, k and the parameters of the forcing; ``asymmetry`` is
    t2 - t1 - pi, ``unstable`` the number of multipliers outside.
    """
    site, first = orbit.impacts[0].site, orbit.impacts[0].time
    times = first, first + math.pi + orbit.asymmetry  # times count modulo the period
    start = dict(zip(NAMES, (orbit.p, *times, orbit.c), strict=True))
    equations = AsymmetricEquations(orbit.forcing, orbit.lattice)
    return Problem(
        equations.residual,
        start,
        _params(orbit),
        jacobian=equations.jacobian,
        sensitivity=equations.sensitivity,
        events=(pitchfork_of_arms(), orbit_fold(), *events_on(orbit.lattice, threshold)),
        record={
            "asymmetry": _asymmetry,
            "unstable": Counting(partial(_unstable, threshold)),
        },
        domain={
            "gamma": (0.0, 0.25),
            "k": (0.0, 1.0),
            "a": (0.0, math.inf),
            "p": (LEAST, math.inf),
        },
        interpret=partial(_arm, orbit.conditions, orbit.section, site),
        images=_mirror_image,
        simpler=_symmetric_again,
        lifts={"PF": symmetric_again, "PD": lift},
        wider=partial(with_parameters, threshold),
        label="asymmetric breather",
        recipe=_recipe("asymmetric breather", orbit, threshold),
    )


def _arm(on: Conditions, section: Section, site: int, point: Point) -> Orbit:
    p, t1, t2, c = point.x.tolist()
    impacts = (Impact(site, 1, t1, -2.0 * p), Impact(site, -1, t2, 2.0 * p))
    return Orbit(Waves(on.at(point.params), section, impacts, (c,)))


def _asymmetry(point: Point) -> float:
    return float(point["t2"] - point["t1"] - math.pi)


def _mirror_image(x: FloatArray, params: Mapping[str, float]) -> tuple[FloatArray, ...]:
    p, t1, t2, c = x
    return (np.array((p, t2 - math.pi, t1 + math.pi, -c)),)


def _symmetric_again(point: Point) -> Problem | None:
    small = simpler_than(point.solution)
    return None if small is None else small.problem
