"""The impacts of a periodic orbit, and what follows from them alone: momenta, velocities, entries
of the saltation.

How its sites move between them is asked of an `Orbit`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cached_property
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from contbreather.errors import BadInput
from contbreather.lattice.conditions import Conditions, Walls
from contbreather.lattice.forcing import Forcing
from contbreather.orbits.section import Impact, Section
from contbreather.orbits.site_motion import SiteMotion

FloatArray = NDArray[np.float64]

VANISHED = 1e-8  # an impact at a smaller velocity is none
SAME = 1e-7  # times and impulses that differ by less are equal, equations off by less right


class Hit(NamedTuple):
    """An impact: velocities of the site before and after it, and its acceleration just after."""

    site: int
    wall: int
    time: float
    before: float
    after: float
    acceleration: float


def _of(path: str) -> Any:
    return property(attrgetter(path))


class ImpactSequence:
    """Impacts with the conditions they happen under, read off a representation."""

    representation: Any

    conditions: Conditions = _of("representation.conditions")
    section: Section = _of("representation.section")
    impacts: tuple[Impact, ...] = _of("representation.impacts")
    offsets: tuple[float, ...] = _of("representation.offsets")
    accelerations: FloatArray = _of("representation.accelerations")  # before each impact
    residual: float = _of("representation.error")  # rounding, unless it was put together by hand
    map: Any = _of("representation.map")  # of small perturbations over a section
    c: float = _of("representation.c")  # by how much the lattice as a whole sits off centre
    a: float = _of("conditions.a")
    gamma: float = _of("conditions.gamma")
    k: float = _of("conditions.k")
    damping: float = _of("conditions.damping")
    spring: float = _of("conditions.spring")
    forcing: Forcing = _of("conditions.forcing")
    walls: Walls = _of("conditions.walls")
    lattice: Any = _of("conditions.lattice")
    period: float = _of("section.period")
    symmetric: bool = _of("section.symmetric")  # whether ``u(t + period/2) = -u(t)`` is used

    @property
    def motion(self) -> SiteMotion:
        """Motion of its sites between the impacts."""
        return SiteMotion(self.representation)

    # ---------------------------------------------------------------------------- its impacts

    @cached_property
    def times(self) -> FloatArray:
        return np.array([impact.time for impact in self.impacts])

    @cached_property
    def impulses(self) -> FloatArray:
        """By how much the velocity of the site changes at each of them."""
        return np.array([impact.impulse for impact in self.impacts])

    @property
    def sides(self) -> NDArray[np.int64]:
        """Walls that are hit, +1 or -1."""
        return np.array([wall for _, wall in self.section.impacts])

    @property
    def vanishing(self) -> int | None:
        """Number of an impact that has lost its velocity: there the saltation (19) has a pole."""
        speeds = np.abs(self.incoming)
        return int(speeds.argmin()) if speeds.size and speeds.min() < VANISHED else None

    @property
    def incoming(self) -> FloatArray:
        """Velocity of the site just before each impact, ``-J/(1 + k)``."""
        # u' -> -k u'
        return np.asarray(-self.impulses / (1.0 + self.at_impacts("k")))

    def at_impacts(self, name: str) -> Any:
        """Values of k or damping at the site of each impact."""
        on: Conditions = self.representation.conditions
        return on.at_sites(name, [site for site, _ in self.section.impacts])

    @cached_property
    def entries(self) -> FloatArray:
        """The entries b of the saltation matrices (19), one for each impact of a section."""
        b: FloatArray = self.gains / self.speeds
        b.setflags(write=False)
        return b

    @property
    def speeds(self) -> FloatArray:
        """Speed towards its wall just before each impact, negative where it comes from behind."""
        return self.sides * self.incoming

    @property
    def gains(self) -> FloatArray:
        """Entries b times these speeds, which stay finite where an impact vanishes: how much faster
        a site leaves its wall per unit of time that it comes sooner."""
        # b = (1 + k) u''/u' of (19), with losses; braked less after the impact than before, a site
        # turns round faster by damping (1 + k) v
        braked = self.accelerations + self.at_impacts("damping") * self.incoming
        return np.asarray((1.0 + self.at_impacts("k")) * self.sides * braked)

    @cached_property
    def hits(self) -> tuple[Hit, ...]:
        """Impacts of a period in order of time."""
        on, w = self.representation.conditions, self.accelerations
        w = np.concatenate([w, -w]) if self.section.symmetric else w  # u(t + T/2) = -u(t)
        hits = []
        for (site, wall, time, J), acceleration in zip(
            self.section.course(self.impacts), w.tolist(), strict=True
        ):
            k, damping = (float(on.at_sites(name, site)) for name in ("k", "damping"))
            before = -J / (1.0 + k)
            # just after the impact a damped site is braked the other way
            after = acceleration + damping * (1.0 + k) * before
            hits.append(Hit(site, wall, time, before, -k * before, after))
        return tuple(sorted(hits, key=lambda hit: hit.time))

    @property
    def p(self) -> float:
        """Half the momentum of each impact, where all are the same."""
        sizes = 0.5 * np.abs(self.impulses)  # |J| = 2p, eq. (4)
        # momenta that differ by less are equal
        if np.ptp(sizes) > 1e-9 * sizes.max():
            raise BadInput(f"the impacts have different momenta: half of them are {sizes}.")
        return float(sizes[0])

    @property
    def phi(self) -> float:
        """Time of the impact on the wall +1 of a symmetric orbit of one site."""
        self._need_one("phi")
        # (3): the wall +1 at phi, the wall -1 half a period later
        late = 0.0 if self.impacts[0].wall > 0 else self.section.length
        return math.remainder(self.impacts[0].time + late, self.period)

    @property
    def chi(self) -> float:
        """Mean place of a site per unit p by its impacts, eq. (10): ``p chi = wall - a f(phi)``."""
        self._need_one("chi")
        return float(self.representation.chi)

    @property
    def b(self) -> float:
        """The entry of the saltation matrix (19), the same at every impact."""
        self._need_one("b")
        return float(self.entries[0])

    @property
    def asymmetry(self) -> float:
        """``t2 - t1 - pi`` of an orbit with two impacts: 0 where both flights are equal. Of more
        that of the impact and its mirror image, half the impacts later, that are farthest off."""
        if not self.section.mirrored:
            raise self._lacks("asymmetry", "orbits whose second half hits the opposite walls")
        first, second = self.times.reshape(2, -1)
        # equal flights: the mirror image of an impact comes half a period after it
        late = (second - first) % self.section.period - 0.5 * self.section.period
        return float(late[abs(late).argmax()])

    def _need_one(self, name: str) -> None:
        if not self.symmetric or self.section.count > 1:
            raise self._lacks(name, "symmetric orbits with one impact in half a period")

    def _lacks(self, name: str, which: str) -> BadInput:
        return BadInput(f"{name} belongs to {which}; this one has the {self.describe()}.")

    # ------------------------------------------------------------------------------- its parts

    @property
    def repeats(self) -> bool:
        """True where the second half of a section is the first again, or its mirror image."""
        halves = (part for part in self.parts() if 2 * part.count == self.section.count)
        return any(map(self.first_of, halves))

    def parts(self) -> Iterator[Section]:
        """Sections of which the orbit may consist, going by its walls."""
        impacts, turns = self.section.impacts, self.section.turns
        if self.symmetric:
            return
        for number in (2, 3, 5, 7):
            m = len(impacts) // number
            if m and turns % number == 0 and impacts == impacts[:m] * number:
                yield Section(impacts[:m], turns // number)
        if self.section.mirrored and self.conditions.symmetric:
            yield Section(impacts[: len(impacts) // 2], turns, -1)

    def first_of(self, section: Section) -> tuple[Impact, ...]:
        """The impacts of one of several equal parts, their mean; empty if these are not equal."""
        m = section.count
        part = np.arange(self.section.count // m)[:, None]
        times = self.times.reshape(-1, m) - section.length * part
        impulses = self.impulses.reshape(-1, m) * float(section.sign) ** part
        if max(np.ptp(times, axis=0).max(), np.ptp(impulses, axis=0).max()) > SAME:
            return ()
        means = zip(section.impacts, times.mean(axis=0), impulses.mean(axis=0), strict=True)
        return tuple(Impact(*impact, float(t), float(J)) for impact, t, J in means)

    def describe(self) -> str:
        return f"{self.section.describe()} on the {self.lattice.describe()}"
