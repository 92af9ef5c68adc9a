"""Orbits of the infinite chain and of rings by the periodic Green's function, a representation."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property, partial
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contbreather.continuation.boundary import codim_two
from contbreather.continuation.curve import Curve
from contbreather.continuation.equilibria import branch_point, fold
from contbreather.continuation.point import DefiningSystem, Point
from contbreather.continuation.problem import Problem
from contbreather.errors import BadInput
from contbreather.lattice.chain import InfiniteChain, Ring
from contbreather.lattice.conditions import Conditions, Walls, restitution_ratio
from contbreather.lattice.periodic_green import check_coupling
from contbreather.orbits.asymmetric_breather import (
    EQUAL,
    LEAST,
    asymmetric_problem,
    pitchfork_of_arms,
)
from contbreather.orbits.grazing import GrazingSite
from contbreather.orbits.green_equations import OrbitEquations, Params, green_equations_of
from contbreather.orbits.orbit import Orbit, orbit_of
from contbreather.orbits.orbit_events import events_without_losses, from_arms
from contbreather.orbits.orbit_problem import (
    STEP,
    Equations,
    OnCircle,
    OrbitProblemByEquations,
    by_differences,
    momentum,
    read_by,
    unstable_by,
)
from contbreather.orbits.representation import Impacts, Offsets, Representation
from contbreather.orbits.section import Impact, Section, check_order
from contbreather.orbits.site_motion import ChainMotion, Terms
from contbreather.parameters import NEEDED, NUMBERS, parameter
from contbreather.stability.chain_map import OrbitMap
from contbreather.stability.modal_map import ModalMap, ring_map
from contbreather.stability.saltation import Saltation
from contbreather.stability.verdict import THRESHOLD

FloatArray = NDArray[np.float64]

ACROSS = Section(((0, 1), (0, -1)))


@dataclass(frozen=True)
class GreensFunction:
    """Any impacts, by the periodic Green's function: what solves `OrbitEquations`.

    Attributes
    ----------
    conditions : Conditions
        Of the infinite chain or a ring, without damping and springs.
    section : Section
    impacts : tuple of Impact
        Those of one period; times count modulo the period.
    offsets : tuple of float
        Static displacement of each impacting site, from left to right.

    Raises
    ------
    BadInput
        For impulses that push a site into its wall, or parameters out of range.
    """

    conditions: Conditions
    section: Section
    impacts: tuple[Impact, ...]
    offsets: tuple[float, ...]

    def __post_init__(self) -> None:
        on = self.conditions
        parameter("a", on.a)
        restitution_ratio(on.k)
        check_coupling(on.lattice, on.gamma, self.section.turns)
        sites = self.equations.section.hit  # or a sentence why there are no equations
        if len(self.offsets) != len(sites):
            raise BadInput(
                f"{len(self.offsets)} offsets for {len(sites)} impacting sites {list(sites)}: one "
                "for each is expected."
            )
        if not np.isfinite(self.x).all():
            raise BadInput(
                f"impacts {self.impacts}, offsets {self.offsets}: finite numbers are expected."
            )
        for i, impact in enumerate(self.impacts):
            if impact.wall * impact.impulse >= 0.0:
                raise BadInput(
                    f"impact {i + 1} has the impulse {impact.impulse:.6g} at the wall "
                    f"{impact.wall:+d}: a wall pushes away from itself, so the sign must be "
                    f"{-impact.wall:+d}."
                )

    @cached_property
    def equations(self) -> OrbitEquations:
        """The equations it solves, as functions of all unknowns and parameters."""
        return green_equations_of(self.section, self.conditions.forcing, self.conditions.lattice)

    @cached_property
    def x(self) -> FloatArray:
        """All unknowns of `equations`."""
        times, impulses = zip(*((hit.time, hit.impulse) for hit in self.impacts), strict=True)
        return np.array([*times, *impulses, *self.offsets], dtype=float)

    @property
    def error(self) -> float:
        return float(np.abs(self.equations.residual(self.x, self.conditions.params)).max())

    @property
    def c(self) -> float:
        if len(self.offsets) > 1:
            raise BadInput(f"this orbit has an offset for each of {len(self.offsets)} sites.")
        return self.offsets[0]

    @property
    def accelerations(self) -> FloatArray:
        times, impulses, _ = self.equations.split(self.x)
        on = self.conditions
        h = self.equations.interactions(on.gamma, times)
        return np.asarray(on.a * on.forcing.d2f(times) + h[2] @ impulses)

    @cached_property
    def map(self) -> OrbitMap | ModalMap:
        """The map of small perturbations over one period, of a ring by its modes."""
        on, first, T = self.conditions, self.impacts[0].time, self.section.period
        # all within one period from the first one on
        kicks = [
            Saltation(impact.site, first + (impact.time - first) % T, entry)
            for impact, entry in zip(self.impacts, Orbit(self).entries.tolist(), strict=True)
        ]
        kicks.sort(key=lambda kick: kick.time)
        if on.lattice.sites is not None:
            return ring_map(on.lattice, on.gamma, on.k, tuple(kicks), T)
        return OrbitMap(on.gamma, on.k, tuple(kicks), self.section.turns)

    # --------------------------------------------------------------------- as a representation

    @staticmethod
    def suits(on: Conditions, section: Section) -> bool:
        plain = not (on.damping or on.spring) and on.walls == Walls()
        return plain and section.sign > 0 and isinstance(on.lattice, InfiniteChain | Ring)

    @classmethod
    def through(
        cls, on: Conditions, section: Section, times: Any, impulses: Any, offsets: Offsets
    ) -> GreensFunction:
        if not section.count == len(times) == len(impulses):
            raise BadInput(
                f"{section.count} impacts, {len(times)} times, {len(impulses)} impulses: one time "
                "and one impulse for each impact is expected."
            )
        check_order(section, times)
        offsets = offsets or (0.0,) * len(section.hit)
        return cls.of(on, section, [*times, *impulses, *offsets], on.params)

    @classmethod
    def of(cls, on: Conditions, section: Section, x: Any, params: Params) -> GreensFunction:
        """Make the orbit of these times, impulses and offsets."""
        m, values = section.count, np.asarray(x, dtype=float).tolist()
        named = zip(section.impacts, values[:m], values[m : 2 * m], strict=True)
        impacts = tuple(Impact(*impact, t, J) for impact, t, J in named)
        return cls(on.at(params), section, impacts, tuple(values[2 * m :]))

    @classmethod
    def arm(cls, on: Conditions, section: Section, x: Any, params: Params) -> GreensFunction:
        """Make the orbit of ``p, t1, t2, c`` of two impacts."""
        p, t1, t2, c = x
        # (4): -2p on the wall +1, 2p on the wall -1
        return cls.of(on, section, (t1, t2, -2.0 * p, 2.0 * p, c), params)

    def problem(self, threshold: float) -> Problem:
        orbit = Orbit(self)
        if self.section.two_impacts and abs(orbit.asymmetry) > EQUAL:
            return asymmetric_problem(orbit, threshold)
        return impact_problem(orbit, threshold)

    def guess(self) -> Problem:
        return impact_problem(Orbit(self), THRESHOLD)

    @property
    def motion(self) -> ChainMotion:
        return ChainMotion(self)

    def locus(
        self, of: OnCircle, point: Point, nu: float | None = None, **more: Any
    ) -> DefiningSystem:
        endless = self.conditions.lattice.sites is None
        return of.locus(by_differences if nu is None or not endless else _off_the_edge, nu, **more)

    def grazing_site(self, site: int) -> GrazingSite:
        return _grazing_site(Orbit(self), site)

    def speed_slope(self, j: int) -> None:
        """An impulse of 0 pushes away from no wall."""

    def lifted(self) -> Problem:
        return Orbit(self).doubled().problem

    def rewritten(
        self, section: Section, impacts: Impacts, offsets: Offsets
    ) -> Representation | None:
        if not section.symmetric:
            return replace(self, section=section, impacts=tuple(impacts), offsets=tuple(offsets))
        # of half sections the closed form has this one alone, site 0 on the wall +1
        if section.count > 1 or section.impacts[0] != (0, 1):
            return None
        (impact,) = impacts
        return orbit_of(self.conditions, section, [impact.time], [impact.impulse]).representation

    def on(self, lattice: Any) -> None:
        """Its impacts are as good a guess as any."""


read_by("asymmetric breather", GreensFunction.arm)(asymmetric_problem)


@read_by("orbit with impacts", GreensFunction.of)
def impact_problem(orbit: Orbit, threshold: float = THRESHOLD) -> Problem:
    """The equations of an orbit with any impacts, with the orbit as their start.

    Columns: t1..tm, J1..Jm and c (c1, c2, ... where several sites take impacts); a, gamma, k and
    the parameters of the forcing; ``unstable``, the number of multipliers outside; ``p``, half the
    momentum of the first impact, and ``asymmetry`` where half a symmetric orbit may do. Every
    branch point of the equations is BP, on a branch of symmetric breathers their pitchfork, too;
    from an arm it is PF.
    """
    motion, on = orbit.representation, orbit.conditions
    equations: OrbitEquations = motion.equations
    record: dict[str, Any] = {"unstable": unstable_by(threshold), "p": partial(momentum, 0)}
    if orbit.section.mirrored:
        record["asymmetry"] = attrgetter("solution.asymmetry")
    return OrbitProblemByEquations.of(
        "orbit with impacts",
        partial(type(motion).of, on, orbit.section),
        orbit,
        threshold,
        residual=equations.residual,
        start=dict(zip(equations.names, motion.x.tolist(), strict=True)),
        params={"a": on.a, "gamma": on.gamma, "k": on.k, **on.forcing.params},
        jacobian=equations.jacobian,
        equations=equations,
        events=(
            fold(),
            from_arms(branch_point()),
            *events_without_losses(orbit.section, on.lattice, threshold),
        ),
        record=record,
        domain=_domain(equations),
        label="orbit with impacts",
    )


def _domain(equations: OrbitEquations) -> dict[str, tuple[float, float]]:
    """Domain: parameters mean something, and each impulse pushes away from its wall."""
    # the harmonic 1/n above the band, 2 sqrt(gamma) < 1/n: a chain without end would radiate it
    domain = {name: NUMBERS[name].domain for name in NEEDED}
    if equations.lattice.sites is None:
        domain["gamma"] = (0.0, domain["gamma"][1] / equations.section.turns**2)
    for i, (_, wall) in enumerate(equations.section.impacts):
        domain[f"J{i + 1}"] = (-math.inf, -LEAST) if wall > 0 else (LEAST, math.inf)
    return domain


def _off_the_edge(
    conditions: Equations, curve: Curve, z: FloatArray, extra: FloatArray
) -> FloatArray:
    """By steps of gamma and the angle that keep off the edge of the infinite chain's band, where F
    has a root."""
    map = Point(curve, z).solution.map
    steepness = 4.0 * map.periods**2 / map.edge  # of the edge, as nu, in gamma
    room = 0.02 * abs(2.0 * map.edge - float(extra[0])) / (1.0 + steepness)
    return by_differences(conditions, curve, z, extra, step=min(STEP, max(room, 1e-8)))


# --- a site that grazes -------------------------------------------------------------------------


def _grazing_site(orbit: Orbit, site: int) -> GrazingSite:
    """A site with its share of the offsets as it is where the curve sets out.

    The grazing of an arm ends at its pitchfork, on the side of the arm. There that of the other arm
    begins: the margin of the mirrored maximum vanishes together with the asymmetry, and their ratio
    does not. So that this end is known by one name, margins are those per asymmetry.
    """
    share = _offset_share(orbit, site)
    followed = GrazingSite(
        site, partial(_motion_slopes, site, share), partial(_motion, site, share)
    )
    asymmetry = orbit.asymmetry if orbit.section.two_impacts else 0.0
    if abs(asymmetry) <= EQUAL:
        return replace(followed, meets={"PF": ()})
    side = math.copysign(1.0, asymmetry)
    pitchfork = codim_two("GR", pitchfork_of_arms())
    end = replace(pitchfork, test=partial(_towards, side), ends="domain")
    scale = partial(_while_asymmetric, side)
    return replace(followed, further=(end,), scale=scale, meets={"PF": ()})


def _motion(site: int, share: FloatArray, orbit: Orbit, t: float) -> Terms:
    motion = orbit.representation.motion
    u, v, w = motion.at(site, t)
    return u + float(share @ orbit.offsets - motion.offset(site)), v, w


def _offset_share(orbit: Orbit, site: int) -> FloatArray:
    """Weights of the offsets in the static displacement of a site.

    On a boundary that runs into gamma = 0 a site keeps to what holds for gamma > 0.
    """
    size = len(orbit.offsets)
    if orbit.gamma == 0.0 and site not in orbit.section.hit:
        return np.zeros(size)
    flight = orbit.representation
    # the static displacement is linear in the offsets: what each of size 1 does
    rows = np.eye(size).tolist()
    unit = [replace(flight, offsets=tuple(row)).motion.offset(site) for row in rows]
    return np.array(unit, dtype=float)


def _motion_slopes(
    site: int, share: FloatArray, curve: Curve, orbit: Orbit, t: float
) -> FloatArray:
    """Slopes of displacement and velocity, in the time at last."""
    slopes = orbit.representation.motion.slopes(site, t, curve.free)
    # of two impacts J = -2p and 2p
    slopes["p"] = 2.0 * sum(np.sign(J) * slopes[f"J{i}"] for i, J in enumerate(orbit.impulses, 1))
    names = ["c"] if orbit.section.local else [f"c{i + 1}" for i in range(share.size)]
    slopes |= {name: np.array([weight, 0.0]) for name, weight in zip(names, share, strict=True)}
    return np.array([slopes[name] for name in (*curve.problem.start, *curve.free, "t")]).T


def _towards(side: float, point: Point) -> float:
    return side * point.solution.asymmetry


def _while_asymmetric(side: float, point: Point) -> float:
    asymmetry = _towards(side, point)
    # closer to the pitchfork a margin per asymmetry is rounding over rounding
    return asymmetry if asymmetry > EQUAL else math.nan
