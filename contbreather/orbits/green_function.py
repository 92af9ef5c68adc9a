"""Orbits of the infinite chain and of rings by the periodic Green's function, a representation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from contbreather.errors import BadInput
from contbreather.lattice.chain import InfiniteChain, Ring
from contbreather.lattice.conditions import Conditions, Walls, restitution_ratio
from contbreather.lattice.periodic_green import Wave, check_coupling, periodic_green
from contbreather.orbits.closure import EPS
from contbreather.orbits.green_equations import EQUAL, OrbitEquations, Params, green_equations_of
from contbreather.orbits.orbit import Orbit, orbit_of, read_by
from contbreather.orbits.representation import Impacts, Offsets, Representation
from contbreather.orbits.section import Impact, Section, check_order
from contbreather.orbits.site_motion import GreenMotion, Terms
from contbreather.parameters import parameter
from contbreather.stability.chain_map import OrbitMap
from contbreather.stability.modal_map import ModalMap, ring_map
from contbreather.stability.saltation import Saltation
from contbreather.stability.verdict import THRESHOLD

if TYPE_CHECKING:
    from contbreather.continuation.point import DefiningSystem, Point
    from contbreather.continuation.problem import Problem
    from contbreather.orbits.grazing import GrazingSite
    from contbreather.orbits.on_circle import OnCircle

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
        h = self.equations.meetings(on.gamma, times)
        return np.asarray(on.a * on.forcing.d2f(times) + h[2] @ impulses)

    def offset(self, n: ArrayLike) -> FloatArray:
        """Static displacement of sites: straight lines between the impacting ones, level beyond.

        At gamma = 0 nothing holds the others to them: they stay where they are, at 0.
        """
        sites = np.asarray(n, dtype=float)
        places, values = list(self.section.hit), list(self.offsets)
        ring = self.conditions.lattice.sites
        if self.conditions.gamma == 0.0:
            return np.asarray(np.where(np.isin(sites, places), np.interp(sites, places, values), 0))
        if ring is None or len(places) == 1:
            return np.asarray(np.interp(sites, places, values))
        return np.asarray(np.interp(sites % ring, places, values, period=ring))

    def profile(self, n: NDArray[np.int64], t: FloatArray, order: int) -> FloatArray:
        n, t = np.broadcast_arrays(n, t)
        on = self.conditions
        f = on.forcing
        total = np.array(on.a * (f.f, f.df, f.d2f)[order](t), dtype=float)
        if order == 0:
            total += self.offset(n)
        for impact in self.impacts:
            since = self._since(t, impact.time)
            # one wave serves all sites at a distance
            for m in np.unique(np.abs(n - impact.site)):
                at = np.abs(n - impact.site) == m
                distance = on.lattice.distance(int(m))
                answer = periodic_green(on.lattice, on.gamma, distance, self.section.turns)
                total[at] += impact.impulse * answer.at(since[at])[order]
        return total

    def answers(
        self, site: int, t: float, make: Callable[..., Wave] = periodic_green
    ) -> FloatArray:
        """What a unit impulse of each impact does to a site: value, slope, curvature."""
        on, rows = self.conditions, []
        for impact in self.impacts:
            distance = on.lattice.distance(site - impact.site)
            answer = make(on.lattice, on.gamma, distance, self.section.turns)
            rows.append(answer.at(t - impact.time)[:3])
        return np.array(rows)

    def without_offset(self, site: int, t: float) -> FloatArray:
        """Displacement, velocity and acceleration but for the static part."""
        on, impulses = self.conditions, self.equations.split(self.x)[1]
        return on.a * np.array(on.forcing.motion(t)) + impulses @ self.answers(site, t)

    def at(self, site: int, t: float) -> Terms:
        u, v, w = self.without_offset(site, t).tolist()
        return u + float(self.offset(site)), v, w

    def _since(self, t: FloatArray, impact: float) -> FloatArray:
        """Time since the last occurrence of an impact; within rounding of one it counts as one."""
        T = self.section.period
        s = (t - impact) % T
        # one rounding each of t, of the impact, of their difference and of its remainder
        return np.where(T - s <= 4.0 * EPS * (T + np.abs(t) + abs(impact)), 0.0, s)

    def state(self, t: float) -> tuple[FloatArray, FloatArray]:
        """Displacements and velocities of all sites of a ring at one time."""
        sites, time = np.arange(self.conditions.lattice.sites), np.array(t)
        return self.profile(sites, time, 0), self.profile(sites, time, 1)

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
        """With these times, impulses and offsets."""
        m, values = section.count, np.asarray(x, dtype=float).tolist()
        named = zip(section.impacts, values[:m], values[m : 2 * m], strict=True)
        impacts = tuple(Impact(*impact, t, J) for impact, t, J in named)
        return cls(on.at(params), section, impacts, tuple(values[2 * m :]))

    @classmethod
    def arm(cls, on: Conditions, section: Section, x: Any, params: Params) -> GreensFunction:
        """With ``p, t1, t2, c`` of two impacts."""
        p, t1, t2, c = x
        # (4): -2p on the wall +1, 2p on the wall -1
        return cls.of(on, section, (t1, t2, -2.0 * p, 2.0 * p, c), params)

    def problem(self, threshold: float) -> Problem:
        orbit = Orbit(self)
        if self.section.two_impacts and abs(orbit.asymmetry) > EQUAL:
            return _of_an_arm(orbit, threshold)
        return _of_impacts(orbit, threshold)

    def guess(self) -> Problem:
        return _of_impacts(Orbit(self), THRESHOLD)

    @property
    def motion(self) -> GreenMotion:
        return GreenMotion(self)

    def weakly(self, gamma: float) -> None:
        """Where there is no coupling, the closest site is meant."""

    def locus(
        self, of: OnCircle, point: Point, nu: float | None = None, **more: Any
    ) -> DefiningSystem:
        from contbreather.orbits.on_circle import by_differences, off_the_edge

        endless = self.conditions.lattice.sites is None
        return of.locus(by_differences if nu is None or not endless else off_the_edge, nu, **more)

    def grazing_site(self, site: int) -> GrazingSite:
        from contbreather.orbits.green_problem import grazing_site

        return grazing_site(Orbit(self), site)

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


@read_by("orbit with impacts", GreensFunction.of)
def _of_impacts(orbit: Orbit, threshold: float) -> Problem:
    from contbreather.orbits.green_problem import impact_problem

    return impact_problem(orbit, threshold)


@read_by("asymmetric breather", GreensFunction.arm)
def _of_an_arm(orbit: Orbit, threshold: float) -> Problem:
    from contbreather.orbits.green_problem import asymmetric_problem

    return asymmetric_problem(orbit, threshold)
