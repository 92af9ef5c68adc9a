"""Orbits of finite lattices by exact modes: the equations of shooting from impact to impact.

Unknown are the times of all impacts of a section and the state of the lattice just before the
first one. The equations: each impact finds its site on its wall, and the section closes. The state
includes the mean of a ring, which nothing pins between impacts: where the ring comes to sit is part
of the answer, and no mode needs a treatment of its own.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contbreather.breathers.images import images_of, simpler_than
from contbreather.breathers.lifts import lift
from contbreather.breathers.modal_events import events_of
from contbreather.breathers.modal_flight import ModalFlight
from contbreather.breathers.orbit import Orbit, plain
from contbreather.breathers.road import road
from contbreather.breathers.section import WEAK, Impact, Section, check_order, check_possible
from contbreather.breathers.watched import ModalWatch
from contbreather.continuation import Event, Point, Problem
from contbreather.continuation.point import Counting
from contbreather.continuation.recipes import Recipe
from contbreather.lattice import Ring
from contbreather.lattice.conditions import Conditions
from contbreather.stability.verdict import THRESHOLD, beyond

FloatArray = NDArray[np.float64]
Params = Mapping[str, float]


@road(3)
@dataclass(frozen=True, eq=False)
class Modes(ModalFlight):
    """Any impacts on any finite lattice, with losses, springs, masses and walls of its own."""

    @staticmethod
    def suits(on: Conditions, section: Section) -> bool:
        return on.lattice.sites is not None

    @classmethod
    def through(
        cls, on: Conditions, section: Section, times: Any, impulses: Any, offsets: Sequence[float]
    ) -> Modes:
        check_possible(section, on)
        return cls.from_times(on, section, times)

    @classmethod
    def from_times(cls, on: Conditions, section: Section, times: Any) -> Modes:
        """With the state that comes closest to all equations, which are linear in it."""
        check_order(section, times)
        still = np.zeros(on.lattice.basis(section.hit).lam.size)
        rest = cls(section, np.array(times, dtype=float), still, still, on)
        matrix = rest.jacobian()[:, section.count :]
        state: FloatArray = np.linalg.lstsq(matrix, -rest.residual())[0].astype(float)
        return replace(rest, q=state[: still.size], r=state[still.size :])

    def rewritten(
        self,
        section: Section,
        impacts: Sequence[Impact],
        offsets: Sequence[float],
        start: int = 0,
        sign: int = 1,
    ) -> Modes | None:
        if not section.local and (start, sign) != (0, 1):
            return None  # sites that overtake each other come in no order of time
        leg = self.legs[start]  # ends just before that impact
        q, r = (leg.q_end, leg.r_end) if start else (self.q, self.r)
        times = np.array([one.time for one in impacts])
        return replace(self, section=section, t=times, q=sign * q, r=sign * r)

    def lifted(self) -> Problem:
        orbit = Orbit(self)
        longer = orbit.unfolded() if self.section.symmetric else orbit.doubled()
        check_possible(longer.section, self.conditions)
        return longer.problem

    def problem(self, threshold: float) -> Problem:
        return modal_problem(Orbit(self), threshold)

    def guess(self) -> Problem:
        return modal_problem(Orbit(self))

    def events(self, threshold: float) -> tuple[Event, ...]:
        return events_of(self.section, threshold)

    @property
    def watch(self) -> ModalWatch:
        return ModalWatch(Orbit(self))

    def on(self, lattice: Any) -> Orbit | None:
        """From ring to ring the sites around the one that impacts keep their motion, new ones move
        like the farthest."""
        rings = isinstance(lattice, Ring) and isinstance(self.lattice, Ring)
        if not (rings and self.section.local):
            return None
        return Orbit(self.resized(lattice)).solved()

    def resized(self, ring: Ring) -> Modes:
        section, apart = self.section.around(ring.sites), np.arange(ring.sites)
        apart = np.minimum(apart, ring.sites - apart)
        rows: list[FloatArray] = []
        for modes in (self.q, self.r):
            own = np.roll(self.basis.to_sites(modes), -self.section.hit[0])
            rows.append(np.roll(own[np.minimum(apart, self.lattice.sites // 2)], section.hit[0]))
        q, r = (ring.basis(section.hit).from_sites(row) for row in rows)
        on = replace(self.conditions, lattice=ring)
        return Modes(section, self.t, q, r, on)


@dataclass(frozen=True, eq=False)
class ShootingEquations:
    """The equations of one section, as functions of all that can change.

    ``x = (t1 .. tm, q, r)``; `params` names those of the `Conditions`.
    """

    section: Section
    conditions: Conditions

    def flight(self, x: FloatArray, params: Params) -> Modes:
        """The section flown from these unknowns; kept, because residual, derivatives and events
        ask for the same few in turn."""
        return _flown(self, np.asarray(x, dtype=float).tobytes(), tuple(params.items()))

    def residual(self, x: FloatArray, params: Params) -> FloatArray:
        return _left(self, np.asarray(x, dtype=float).tobytes(), tuple(params.items()))

    def derivatives(self, x: FloatArray, params: Params, names: tuple[str, ...]) -> FloatArray:
        return _derived(self, np.asarray(x, dtype=float).tobytes(), tuple(params.items()), names)

    def orbit(self, point: Point) -> Orbit:
        return Orbit(self.flight(point.x, point.params))

    def images(self, x: FloatArray, params: Params) -> tuple[FloatArray, ...]:
        """Other solutions that are the same orbit, or its mirror image."""
        found = images_of(Orbit(self.flight(x, params)))
        return tuple(image.flight.x for image in found)


@lru_cache(maxsize=64)
def _flown(of: ShootingEquations, unknowns: bytes, params: tuple[tuple[str, float], ...]) -> Modes:
    x, m = np.frombuffer(unknowns), of.section.count
    K, on = (x.size - m) // 2, of.conditions.at(dict(params))
    return Modes(of.section, x[:m], x[m : m + K], x[m + K :], on)


# Steps, tests and locations ask for those of one place on curves of their own.


@lru_cache(maxsize=64)
def _left(of: ShootingEquations, unknowns: bytes, params: tuple[tuple[str, float], ...]) -> Any:
    found = _flown(of, unknowns, params).residual()
    found.flags.writeable = False
    return found


@lru_cache(maxsize=8)  # they are large
def _derived(
    of: ShootingEquations,
    unknowns: bytes,
    params: tuple[tuple[str, float], ...],
    names: tuple[str, ...],
) -> FloatArray:
    found = _flown(of, unknowns, params).jacobian(names)
    found.flags.writeable = False
    return found


def modal_problem(orbit: Orbit, threshold: float = THRESHOLD) -> Problem:
    """The shooting equations with an orbit as their start, and all its events.

    Columns: ``t1, t2, ...`` and the arrays ``q, r`` of unknowns; a, gamma, k, damping, spring and
    the parameters of the forcing; ``p``, half the momentum (``p1, p2, ...`` unless all are the
    same), the offset ``c``, for two impacts ``asymmetry``, t2 - t1 less half a period;
    ``unstable``, the number of multipliers beyond the threshold over the whole period, and the
    condition number ``condition``: computed when asked for.
    """
    flight = orbit.flight
    section, on = orbit.section, orbit.conditions
    shooting = ShootingEquations(section, on)
    times = {f"t{j + 1}": float(time) for j, time in enumerate(flight.t)}
    least = WEAK if _loose(section, on) else 0.0
    return Problem(
        shooting.residual,
        {**times, "q": flight.q, "r": flight.r},
        on.params,
        derivatives=shooting.derivatives,
        events=events_of(section, threshold),
        record=_columns(section, threshold),
        domain={
            "gamma": (least, on.lattice.highest_gamma),
            "k": (0.0, 1.0),
            "a": (0.0, math.inf),
            "damping": (0.0, math.inf),
            "spring": (0.0, math.inf),
        },
        interpret=shooting.orbit,
        images=shooting.images,
        simpler=_simpler,
        lifts={"PF": lift, "PD": lift},
        label=f"shooting, {on.lattice.describe()}, {section.describe()}",
        recipe=Recipe(
            "shooting", {"conditions": on, "section": section, "threshold": threshold}, plain
        ),
    )


def _loose(section: Section, on: Conditions) -> bool:
    """Whether idle sites may rest anywhere without coupling; an orbit that comes back with the
    opposite sign has them rest at 0."""
    return on.spring < WEAK and on.lattice.sites > 1 and not section.symmetric


def _simpler(point: Point) -> Problem | None:
    """The problem of half the period, where the orbit repeats itself after half of it."""
    found = simpler_than(point.solution)
    return None if found is None else found.problem


def _columns(section: Section, threshold: float) -> dict[str, Any]:
    """What is recorded besides the unknowns."""
    count = section.count
    same = count == 1 or (count == 2 and section.local and not section.symmetric)
    names = {"p": 0} if same else {f"p{j + 1}": j for j in range(count)}
    columns: dict[str, Any] = {name: partial(_momentum, j) for name, j in names.items()}
    if not section.symmetric:
        columns["c"] = attrgetter("solution.c")
    if same and count == 2:
        columns["asymmetry"] = partial(_asymmetry, section.period)
    columns["unstable"] = Counting(partial(_unstable, threshold))
    return {**columns, "condition": attrgetter("solution.flight.condition")}


def _momentum(j: int, point: Point) -> float:
    return 0.5 * abs(float(point.solution.impulses[j]))


def _asymmetry(period: float, point: Point) -> float:
    return float(point["t2"] - point["t1"] - 0.5 * period)


def _unstable(threshold: float, point: Point) -> float:
    return beyond(point.solution.map, threshold)
