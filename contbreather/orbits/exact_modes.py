"""Orbits of finite lattices by exact modes: the equations of shooting from impact to impact.

Unknown are the times of all impacts of a section and the state of the lattice just before the
first one. The equations: each impact finds its site on its wall, and the section closes. The state
includes the mean of a ring, which nothing pins between impacts: where the ring comes to sit is part
of the answer, and no mode needs a treatment of its own.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contbreather.continuation.curve import Curve
from contbreather.continuation.equilibria import fold
from contbreather.continuation.point import DefiningSystem, Point
from contbreather.continuation.problem import Problem
from contbreather.lattice.chain import Ring
from contbreather.lattice.conditions import Conditions
from contbreather.orbits.grazing import GrazingSite
from contbreather.orbits.on_circle import OnCircle, by_impacts
from contbreather.orbits.orbit import Orbit
from contbreather.orbits.orbit_events import branching, events_of
from contbreather.orbits.orbit_problem import OrbitProblem, orbit_problem, read_by, unstable_by
from contbreather.orbits.representation import Impacts, Offsets, representation
from contbreather.orbits.section import WEAK, Section, check_order, check_possible
from contbreather.orbits.shooting_equations import SectionFlight
from contbreather.orbits.site_motion import ModalMotion
from contbreather.parameters import NUMBERS
from contbreather.stability.verdict import THRESHOLD

FloatArray = NDArray[np.float64]
Params = Mapping[str, float]


@representation(3)
@dataclass(frozen=True, eq=False)
class ExactModes(SectionFlight):
    """Any impacts on any finite lattice, with losses, springs, masses and walls of its own."""

    @staticmethod
    def suits(on: Conditions, section: Section) -> bool:
        return on.lattice.sites is not None

    @classmethod
    def through(
        cls, on: Conditions, section: Section, times: Any, impulses: Any, offsets: Offsets
    ) -> ExactModes:
        check_possible(section, on)
        return cls.from_times(on, section, times)

    @classmethod
    def of(cls, on: Conditions, section: Section, x: FloatArray, params: Params) -> ExactModes:
        """With these unknowns."""
        m = section.count
        q, r = np.split(x[m:], 2)  # x = (t_1 .. t_m, q, r)
        return cls(section, x[:m], q, r, on.at(params))

    @classmethod
    def from_times(cls, on: Conditions, section: Section, times: Any) -> ExactModes:
        """With the state that comes closest to all equations, which are linear in it."""
        check_order(section, times)
        still = np.zeros(on.lattice.basis(section.hit).lam.size)
        rest = cls(section, np.array(times, dtype=float), still, still, on)
        matrix = rest.jacobian()[:, section.count :]  # at rest: linear in the state
        # m walls and 2K conditions that the section closes, for 2K amplitudes of K modes
        state: FloatArray = np.linalg.lstsq(matrix, -rest.residual())[0].astype(float)
        return replace(rest, q=state[: still.size], r=state[still.size :])

    def rewritten(self, section: Section, impacts: Impacts, offsets: Offsets) -> ExactModes:
        return replace(self, section=section, t=np.array([impact.time for impact in impacts]))

    def weakly(self) -> None:
        """Where there is no coupling, the closest site is meant."""

    def locus(
        self, of: OnCircle, point: Point, nu: float | None = None, **more: Any
    ) -> DefiningSystem:
        return of.locus(by_impacts, nu, **more)

    def grazing_site(self, site: int) -> GrazingSite:
        return GrazingSite(site, partial(_slopes_at, site))

    def speed_slope(self, j: int) -> Any:
        return partial(_speed_slope, j)

    def lifted(self) -> Problem:
        orbit = Orbit(self)
        longer = orbit.unfolded() if self.section.symmetric else orbit.doubled()
        # at gamma = 0 half a period holds the idle sites, by u -> -u, and a whole one does not
        check_possible(longer.section, self.conditions)
        return longer.problem

    def problem(self, threshold: float = THRESHOLD) -> Problem:
        return modal_problem(Orbit(self), threshold)

    guess = problem

    @property
    def motion(self) -> ModalMotion:
        return ModalMotion(self)

    def on(self, lattice: Any) -> Orbit | None:
        """From ring to ring the sites around the one that impacts keep their motion, new ones move
        like the farthest."""
        rings = isinstance(lattice, Ring) and isinstance(self.conditions.lattice, Ring)
        if not (rings and self.section.local):
            return None
        return Orbit(self.resized(lattice)).solved()

    def resized(self, ring: Ring) -> ExactModes:
        section, apart = self.section.around(ring.sites), np.arange(ring.sites)
        apart = np.minimum(apart, ring.sites - apart)
        # nothing on the old ring is farther off than half of it
        nearest = np.minimum(apart, self.conditions.lattice.sites // 2)
        rows: list[FloatArray] = []
        for modes in (self.q, self.r):
            profile = np.roll(self.basis.to_sites(modes), -self.section.hit[0])[nearest]
            rows.append(ring.basis(section.hit).from_sites(np.roll(profile, section.hit[0])))
        q, r = rows
        return ExactModes(section, self.t, q, r, replace(self.conditions, lattice=ring))


@dataclass(frozen=True, eq=False)
class ShootingEquations:
    """The equations of one section, as functions of all that can change.

    ``x = (t1 .. tm, q, r)``; `params` names those of the `Conditions`. Steps, tests and locations
    ask for those of one place on curves of their own.
    """

    section: Section
    conditions: Conditions

    def flight(self, x: FloatArray, params: Params) -> ExactModes:
        """The section flown from these unknowns."""
        return _flown(self, np.asarray(x, dtype=float).tobytes(), tuple(params.items()))

    def residual(self, x: FloatArray, params: Params) -> FloatArray:
        return _left(self.flight(x, params))

    def derivatives(self, x: FloatArray, params: Params, names: tuple[str, ...]) -> FloatArray:
        return _derived(self.flight(x, params), names)


@lru_cache(maxsize=64)
def _flown(
    of: ShootingEquations, unknowns: bytes, params: tuple[tuple[str, float], ...]
) -> ExactModes:
    # kept by the unknowns' bits: Newton's method, tests and events ask at the same place
    return ExactModes.of(of.conditions, of.section, np.frombuffer(unknowns), dict(params))


@lru_cache(maxsize=64)
def _left(flight: ExactModes) -> FloatArray:
    residual = flight.residual()
    # it is handed out again: nobody may write into it
    residual.flags.writeable = False
    return residual


@lru_cache(maxsize=8)  # they are large
def _derived(flight: ExactModes, names: tuple[str, ...]) -> FloatArray:
    jacobian = flight.jacobian(names)
    jacobian.flags.writeable = False
    return jacobian


@read_by("shooting", ExactModes.of)
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
    shooting = ShootingEquations(section, on)
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
    equations: ShootingEquations = field(kw_only=True)

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


def _slopes_at(site: int, curve: Curve, orbit: Orbit, t: float) -> FloatArray:
    slopes: FloatArray = orbit.representation.slopes_at(site, t, curve.free)
    return slopes


def _speed_slope(j: int, curve: Curve, z: FloatArray, extra: FloatArray) -> FloatArray:
    flight: ExactModes = Point(curve, z).solution.representation
    return flight.tangents(curve.free).speeds[j : j + 1]
