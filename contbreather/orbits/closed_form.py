"""Symmetric breathers in closed form: one site that hits its walls in turn, as a representation,
its problem to trace, and all solutions of (11) at given parameters."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

from contbreather.continuation.compiled_steps import Loops
from contbreather.continuation.point import DefiningSystem, Point
from contbreather.continuation.problem import Problem
from contbreather.errors import BadInput
from contbreather.lattice.band_averages import Lattice
from contbreather.lattice.chain import InfiniteChain, Ring
from contbreather.lattice.conditions import Conditions, Walls, restitution_ratio, spring_response
from contbreather.lattice.forcing import Forcing
from contbreather.orbits import closed_slopes
from contbreather.orbits.closure import Closure, roots, sprung
from contbreather.orbits.grazing import ALIKE, GrazingSite
from contbreather.orbits.green_function import asymmetric_problem
from contbreather.orbits.one_site import symmetric_orbits
from contbreather.orbits.orbit import Orbit, orbit_at, orbit_of
from contbreather.orbits.orbit_events import events_of, saddle_node
from contbreather.orbits.orbit_problem import OrbitProblem, on_ring, orbit_problem, unstable_by
from contbreather.orbits.representation import Impacts, Offsets, Representation, representation
from contbreather.orbits.section import Section
from contbreather.orbits.site_motion import SiteMotion
from contbreather.orbits.symmetric_breather import HALF, SymmetricBreather
from contbreather.parameters import NEEDED, NUMBERS, parameter
from contbreather.stability.verdict import THRESHOLD, check_threshold
from contbreather.storage.serialise import serialised

# An impact of p = 0 is none: there b has a pole, so the branch ends a hair before. With harmonic
# forcing that is at a = 1, where the far field grazes.
DOMAIN = {name: NUMBERS[name].domain for name in NEEDED} | {"p": (1e-14, math.inf)}


@representation(1)
@dataclass(frozen=True)
class ClosedForm(SymmetricBreather):
    """One site of the infinite chain or of a ring that hits its walls in turn."""

    @staticmethod
    def suits(on: Conditions, section: Section) -> bool:
        # the means with a spring are those of the infinite chain; a ring goes by its modes
        where: Any = InfiniteChain if on.spring else InfiniteChain | Ring
        plain = not on.damping and on.walls == Walls()
        return plain and section == HALF and isinstance(on.lattice, where)

    @classmethod
    def through(
        cls, on: Conditions, section: Section, times: Any, impulses: Any, offsets: Offsets
    ) -> ClosedForm:
        # (4): the impact on the wall +1 takes away the momentum 2p
        p, phi = -0.5 * float(impulses[0]), float(times[0])
        drive = spring_response(on.forcing, on.spring) if on.spring else on.forcing
        return cls(on.a, on.gamma, on.k, p, phi, drive, on.lattice)

    @classmethod
    def of(
        cls, forcing: Forcing, lattice: Lattice, x: Any, params: Mapping[str, float]
    ) -> ClosedForm:
        """With these roots p and phi."""
        p, phi = map(float, x)
        if forcing.params:
            forcing = forcing.at(**{name: params[name] for name in forcing.params})
        return cls(params["a"], params["gamma"], params["k"], p, phi, forcing, lattice)

    def weakly(self) -> SiteMotion:
        # without coupling all idle sites move alike: a little of it tells which one climbs highest
        motion: SiteMotion = replace(self, gamma=ALIKE).motion
        return motion

    def locus(self, of: Any, point: Point, nu: float | None = None, **more: Any) -> DefiningSystem:
        return closed_slopes.locus(of, point, nu, **more)

    def grazing_site(self, site: int) -> GrazingSite:
        return closed_slopes.local_maximum(self, site)

    def speed_slope(self, j: int) -> None:
        """(11) has no root with p = 0."""

    def lifted(self) -> Problem:
        """That of asymmetric breathers, in which a pitchfork is a regular point."""
        return asymmetric_problem(Orbit(self).unfolded())

    def rewritten(self, section: Section, impacts: Impacts, offsets: Offsets) -> Representation:
        times, impulses = [hit.time for hit in impacts], [hit.impulse for hit in impacts]
        return orbit_of(self.conditions, section, times, impulses, offsets).representation

    def problem(self, threshold: float) -> Problem:
        return symmetric_problem(Orbit(self), threshold)

    def guess(self) -> Problem:
        return symmetric_problem(Orbit(self))

    def on(self, lattice: Any) -> Orbit | None:
        """The root of (11) nearest to this one."""
        if not isinstance(lattice, InfiniteChain | Ring):
            return None
        on = self.conditions
        if on.spring and lattice.sites is not None:
            breathers = symmetric_orbits(0, replace(on, lattice=lattice))
        else:
            drive = spring_response(on.forcing, on.spring) if on.spring else on.forcing
            breathers = closed_forms(on.a, on.gamma, on.k, drive, lattice)
        return min(
            breathers,
            # phases count modulo the period
            key=lambda b: math.hypot(b.p - self.p, math.remainder(b.phi - self.phi, 2.0 * math.pi)),
        )


def closed_forms(
    a: float, gamma: float, k: float, drive: Forcing, chain: Lattice
) -> tuple[Orbit, ...]:
    """All solutions of (11) with p > 0, by descending p."""
    gamma, a = sprung(chain, drive).check(gamma), parameter("a", a)
    restitution_ratio(k)
    pairs = roots(a, gamma, float(k), drive, chain)
    if not all(math.isfinite(p) for p, _ in pairs):
        # the far field follows a f
        reach = 1.0 / drive.peak()
        raise BadInput(
            f"a = {a!r}: too large, p is beyond what a number can hold; on the infinite chain no "
            f"breather is admissible beyond a = {reach:.6g}, where the far field reaches the walls."
        )
    return tuple(Orbit(ClosedForm(a, gamma, float(k), p, phi, drive, chain)) for p, phi in pairs)


def symmetric_problem(breather: Orbit, threshold: float = THRESHOLD) -> Problem:
    """The closure (11) with the breather as its start, and all its events.

    Columns: p, phi; a, gamma, k and the parameters of the forcing; ``unstable``, the number of
    multipliers of QS outside the circle, on a ring those over 2 pi beyond the threshold; computed
    when asked for.
    """
    motion = breather.representation
    forcing, lattice = motion.forcing, breather.lattice
    if isinstance(lattice, Ring):
        check_threshold(threshold)  # there NS is by the paper's rule
    closure = Closure(forcing, lattice)
    return orbit_problem(
        "symmetric breather",
        partial(ClosedForm.of, forcing, lattice),
        breather,
        threshold,
        SymmetricProblem,
        residual=closure.residual,
        start={"p": motion.p, "phi": motion.phi},
        params={"a": breather.a, "gamma": breather.gamma, "k": breather.k, **forcing.params},
        jacobian=closure.jacobian,
        sensitivity=closure.sensitivity,
        events=(saddle_node(), *events_of(HALF, lattice, threshold)),
        record={"unstable": unstable_by(threshold)},
        domain=_domain(breather),
        label=f"symmetric breather{on_ring(lattice, threshold)}",
        closure=closure,
    )


@dataclass(frozen=True, eq=False, repr=False)
class SymmetricProblem(OrbitProblem):
    """The closure (11) as a problem."""

    closure: Closure = field(kw_only=True)

    @property
    def serialised(self) -> Mapping[str, Any]:
        form = {"forcing": self.closure.forcing, "lattice": self.closure.lattice}
        return {"kind": self.kind, **form, "threshold": self.threshold}

    def loops(self, free: tuple[str, ...], params: Mapping[str, float]) -> Loops | None:
        return self.closure.loops(free, params)

    def images(self, x: Any, params: Mapping[str, float]) -> tuple[Any, ...]:
        """None: half a symmetric orbit is its own."""
        return ()

    def simpler(self, point: Point) -> None:
        """No orbit has fewer impacts."""

    def with_parameters(self, names: tuple[str, ...]) -> Problem:
        """On the infinite chain with the spring, as one of 0; on a ring by its modes."""
        orbit = orbit_at(self)
        if orbit.lattice.sites is not None or "spring" not in names:
            return super().with_parameters(names)
        # a spring of 0 changes no response, but it is one of its parameters
        soft = Orbit(replace(orbit.representation, forcing=spring_response(orbit.forcing, 0.0)))
        return symmetric_problem(soft, self.threshold).having(*names)


@serialised("symmetric breather")
def _from_dict(
    *,
    forcing: Forcing,
    lattice: Lattice,
    threshold: float,
    start: Mapping[str, Any],
    params: Mapping[str, float],
) -> Problem:
    motion = ClosedForm.of(forcing, lattice, (start["p"], start["phi"]), params)
    return symmetric_problem(Orbit(motion), threshold)


def _domain(breather: Orbit) -> dict[str, tuple[float, float]]:
    """With springs as far as the band stays below the drive, along either parameter by itself."""
    if "spring" not in breather.representation.forcing.params:
        return DOMAIN
    gamma = NUMBERS["gamma"]
    stiffest = 1.0 - gamma.margin - 4.0 * breather.gamma
    return {
        **DOMAIN,
        # the band [sqrt(spring), sqrt(spring + 4 gamma)] ends below the drive at 1
        "gamma": (0.0, gamma.domain[1] - 0.25 * breather.spring),
        "spring": (0.0, stiffest),  # spring + 4 gamma < 1
    }
