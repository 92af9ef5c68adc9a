"""A periodic orbit of a finite lattice as it was shot: its motion, impacts and stability."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from contbreather.breathers.clearance import Admissibility, Watch, clearance
from contbreather.breathers.flight_map import Section, free_multipliers
from contbreather.breathers.itinerary import Itinerary
from contbreather.breathers.watched import Modes
from contbreather.errors import BadInput
from contbreather.flows.modes import turn
from contbreather.lattice import Forcing, InfiniteChain, Lattice, Ring
from contbreather.lattice.conditions import Conditions, Walls
from contbreather.lattice.finite import Finite, finite
from contbreather.stability.verdict import THRESHOLD, Verdict, verdict

if TYPE_CHECKING:
    from contbreather.continuation import Problem

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
EPS = float(np.finfo(float).eps)
SAME = 1e-9  # momenta that differ by less, relative to the largest, are equal


class Hit(NamedTuple):
    """One impact of an orbit: velocities of the site just before and just after it."""

    site: int
    wall: int
    time: float
    before: float
    after: float
    acceleration: float


class Resonance(NamedTuple):
    """The mode that is closest to closing after a section without any impact."""

    mode: int  # of those that impacts see, by frequency, from 1
    frequency: float
    gap: float  # |exp(i w T) - sign|: 0 in resonance


@dataclass(frozen=True, eq=False, repr=False)
class RingOrbit:
    """What a point of a shooting branch is physically.

    Attributes
    ----------
    section : Section
        Its flight from impact to impact; one half period if the orbit is symmetric.
    conditions : Conditions
    lattice : Ring, Lattice
    itinerary : Itinerary
    times, impulses : ndarray
        Of the impacts of a section: when, and by how much a velocity changes.
    c : float
        By how much the lattice as a whole sits off centre, its mean over sites and time.
    """

    section: Section

    # ----------------------------------------------------------------------- what it is

    @property
    def conditions(self) -> Conditions:
        return self.section.conditions

    @property
    def a(self) -> float:
        return self.conditions.a

    @property
    def gamma(self) -> float:
        return self.conditions.gamma

    @property
    def k(self) -> float:
        return self.conditions.k

    @property
    def damping(self) -> float:
        return self.conditions.damping

    @property
    def spring(self) -> float:
        return self.conditions.spring

    @property
    def walls(self) -> Walls:
        return self.conditions.walls

    @property
    def forcing(self) -> Forcing:
        return self.conditions.forcing

    @property
    def itinerary(self) -> Itinerary:
        return self.section.itinerary

    @property
    def lattice(self) -> Finite:
        return self.itinerary.lattice

    @property
    def period(self) -> float:
        return self.itinerary.period

    @property
    def symmetric(self) -> bool:
        """Whether ``u(t + period/2) = -u(t)`` was made use of."""
        return self.itinerary.symmetric

    @property
    def times(self) -> FloatArray:
        return self.section.t

    @property
    def sequence(self) -> tuple[tuple[int, int], ...]:
        """(site, wall) of each impact of a section, in order."""
        return self.itinerary.impacts

    @cached_property
    def impulses(self) -> FloatArray:
        found = {one.which: -(1.0 + self.k) * one.velocity for one in self.section.impacts}
        return np.array([found[j] for j in range(len(found))])

    @property
    def p(self) -> float:
        """Half the momentum of each impact, where all are the same."""
        sizes = 0.5 * abs(self.impulses)
        if np.ptp(sizes) > SAME * sizes.max():
            raise BadInput(f"the impacts have different momenta: half of them are {sizes}.")
        return float(sizes[0])

    @property
    def phi(self) -> float:
        """Time of the impact of a symmetric orbit of one site, on the wall at +1."""
        if not (self.symmetric and self.itinerary.count == 1):
            raise BadInput("phi belongs to symmetric orbits with one impact in half a period.")
        late = 0.0 if self.sequence[0][1] > 0 else self.itinerary.length
        return math.remainder(float(self.times[0]) + late, self.period)

    @cached_property
    def c(self) -> float:
        if self.symmetric:
            return 0.0
        basis, legs = self.section.basis, self.section.legs
        share = basis.at(np.arange(self.lattice.sites)).mean(axis=0)
        # by Gauss's rule: to rounding for as many nodes, and modes may drift, turn or decay
        nodes, weights = np.polynomial.legendre.leggauss(
            12 + int(math.sqrt(float(self.section.z.max())) * self.itinerary.length)
        )
        shift = 0.0
        for leg in legs:
            fly = turn(self.section.z, 0.5 * leg.flight * (1.0 + nodes)[:, None], self.damping)
            path = fly.cosine * leg.q + fly.reach * leg.r
            shift += 0.5 * leg.flight * float(weights @ (path @ share))
        return shift / self.itinerary.length

    @cached_property
    def hits(self) -> tuple[Hit, ...]:
        """All impacts of a period in order of time."""
        T, found = self.itinerary.length, []
        for half in range(2 if self.symmetric else 1):
            side = 1 - 2 * half
            for one in self.section.impacts:
                before = side * one.velocity
                found.append(
                    Hit(
                        one.site,
                        side * one.wall,
                        one.time + half * T,
                        before,
                        -self.k * before,
                        # just after the impact: a damped site is braked the other way
                        side * one.acceleration + self.damping * (1.0 + self.k) * before,
                    )
                )
        return tuple(found)

    @property
    def residual(self) -> float:
        """Largest error of the shooting equations."""
        return float(abs(self.section.residual()).max())

    @cached_property
    def condition(self) -> float:
        """Condition number of the Newton matrix. It grows where a multiplier comes close to +1
        (to -1, on half a symmetric orbit)."""
        return float(np.linalg.cond(self.section.jacobian()))

    @property
    def resonance(self) -> Resonance | None:
        """The mode that is nearest to closing on its own; None if there is but a mean.

        In resonance the itinerary alone no longer tells how strongly that mode moves: on an
        eigenfrequency n w = j the orbit is found nevertheless, its condition number says how well.
        """
        z = np.sort(self.section.z[self.section.z > 0.0])
        if z.size == 0:
            return None
        one, _ = free_multipliers(z, self.damping, self.itinerary.length)
        gap = abs(one - self.itinerary.sign)
        j = int(gap.argmin())
        return Resonance(j + 1, math.sqrt(float(z[j])), float(gap[j]))

    # ----------------------------------------------------------------------- motion

    def displacement(self, n: ArrayLike, t: ArrayLike) -> Any:
        """Where site n is at time t; n and t are broadcast against each other.

        Parameters
        ----------
        n : int or array_like of int
            Site.
        t : float or array_like
            Any times.

        Returns
        -------
        float or ndarray
        """
        return self._profile(n, t, 0)

    def velocity(self, n: ArrayLike, t: ArrayLike) -> Any:
        """How fast site n is at time t; at an impact, the value just after it."""
        return self._profile(n, t, 1)

    def acceleration(self, n: ArrayLike, t: ArrayLike) -> Any:
        """Acceleration of site n at time t; it does not jump."""
        return self._profile(n, t, 2)

    def state(self, sites: int | None = None, t: float = 0.0) -> tuple[FloatArray, FloatArray]:
        """Displacements and velocities of all sites at time t, just after it at an impact.

        Parameters
        ----------
        sites : int, optional
            The size of this orbit's ring; no other is possible.
        t : float

        Returns
        -------
        u, v : ndarray, shape (sites,)

        Raises
        ------
        BadInput
            For a ring of another size: `shooting` takes the orbit there.
        """
        if sites is not None and sites != self.lattice.sites:
            raise BadInput(
                f"this orbit lives on the {self.lattice.describe()}, not on {sites} sites: shoot "
                f"it there first, shooting(orbit, sites={sites})."
            )
        free = self.modes(np.array(float(t)))
        forced = (self.a * self.section.forced.everywhere(float(t), order) for order in (0, 1))
        u, v = (self.section.basis.to_sites(own) + f for own, f in zip(free, forced, strict=True))
        return u, v

    def at(self, n: int, t: float) -> tuple[float, float, float]:
        """Displacement, velocity and acceleration of one site at one time."""
        q, r = self.modes(np.array(t))
        e, a = self.section.basis.at(n), self.a
        u, v, w = self.section.forced.at(n, t)
        bend = float(e.dot(self.section.pulled(q, r)))
        return float(e.dot(q)) + a * u, float(e.dot(r)) + a * v, bend + a * w

    def motion(self, times: FloatArray) -> FloatArray:
        """Displacements of all sites at many times, shape (times, sites)."""
        free = self.section.basis.to_sites(self.modes(times)[0])
        return free + self.a * self.section.forced.everywhere(times, 0)

    def modes(self, times: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Free part of displacements and velocities of the modes, shape (..., K)."""
        times = np.asarray(times, dtype=float)
        if not np.all(np.isfinite(times)):
            raise BadInput("a time is not finite; give real times.")
        starts, q, r = self._flights
        T, first = self.itinerary.length, starts[0]
        sections = np.floor((times - first) / T)
        since = times - first - sections * T
        # an impact time + T in floating point is not quite an impact; it is meant to be one
        slack = 4.0 * EPS * (T + np.abs(times) + abs(first))
        late = T - since <= slack
        sections, since = np.where(late, sections + 1.0, sections), np.where(late, 0.0, since)
        flight = np.searchsorted(starts - first, since + slack, side="right") - 1
        ahead = np.maximum(since - (starts - first)[flight], 0.0)[..., None]
        flown = turn(self.section.z, ahead, self.damping)
        sign = np.where(sections % 2.0 == 0.0, 1.0, self.itinerary.sign)[..., None]
        now, fast = q[flight], r[flight]
        return (
            sign * (flown.cosine * now + flown.reach * fast),
            sign * (flown.swing * fast - flown.pull * now),
        )

    @cached_property
    def _flights(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Start, displacements and velocities of the modes of each flight of a section."""
        legs = self.section.legs[1:]
        rows = (np.array([getattr(leg, name) for leg in legs]) for name in ("since", "q", "r"))
        return tuple(rows)  # type: ignore[return-value]

    def _profile(self, n: ArrayLike, t: ArrayLike, order: int) -> Any:
        times, sites = np.asarray(t, dtype=float), np.asarray(n)
        if sites.dtype.kind not in "iu":
            raise BadInput(f"n = {n!r}: sites are whole numbers.")
        q, r = self.modes(times)
        own = (q, r, self.section.pulled(q, r))[order]
        free = np.einsum("...k,...k->...", self.section.basis.at(sites), own)
        forced = self.section.forced.everywhere(times, order)
        if forced.shape[-1] > 1:
            at, n = np.broadcast_arrays(np.arange(times.size).reshape(times.shape), sites)
            forced = forced.reshape(times.size, -1)[at, n]
        else:
            forced = forced[..., 0]
        total = free + self.a * forced
        return float(total) if np.ndim(total) == 0 else total

    # ----------------------------------------------------------------------- what it is asked

    def on(self, lattice: Lattice | Finite) -> Any:
        """The orbit with the same impacts and parameters on another lattice, found by Newton's
        method from this one: a `RingOrbit` of a finite lattice, an `Orbit` of the infinite chain.

        Raises
        ------
        NotConverged
            If there is none close by.
        BadInput
            If an impacting site is not on that lattice, or springs and damping are not.
        """
        if lattice == self.lattice:
            return self
        if isinstance(lattice, InfiniteChain):
            return self._on_the_chain(lattice)
        from contbreather.breathers.shooting import shooting, shot_orbit

        return shot_orbit(shooting(self, lattice=finite(lattice), inadmissible=True))

    def _on_ring(self, sites: int) -> Any:
        if not isinstance(self.lattice, Ring):
            raise BadInput(
                f"sites = {sites}: the size of a ring, but this orbit lives on the "
                f"{self.lattice.describe()}; ask without it, or take the orbit there, "
                f"orbit.on(Ring({sites}))."
            )
        return self.on(Ring(sites))

    def _on_the_chain(self, lattice: Lattice) -> Any:
        from contbreather.breathers.impacts import Impact
        from contbreather.breathers.orbits import Orbit, orbit_at

        if self.damping or self.spring:
            raise BadInput(
                f"damping = {self.damping}, spring = {self.spring}: orbits of the infinite chain "
                "have neither yet; take a long ring, Ring(200) for instance."
            )
        p = 0.5 * (1.0 + self.k)
        impacts = tuple(
            Impact(hit.site, hit.wall, hit.time, -2.0 * p * hit.before) for hit in self.hits
        )
        offsets = (self.c,) * len(self.itinerary.hit)
        guess = Orbit(
            self.a,
            self.gamma,
            self.k,
            impacts,
            offsets,
            self.itinerary.turns,
            self.forcing,
            lattice,
        )
        solved, _ = guess.problem.solve(tolerance=1e-11)
        return orbit_at(solved)

    def multipliers(self, sites: int | None = None, *, half: bool = False) -> ComplexArray:
        """All 2N multipliers over the period, from flows and saltation matrices.

        Parameters
        ----------
        sites : int, optional
            Those of the orbit on a ring of so many sites; of its own lattice unless given.
        half : bool
            Of a symmetric orbit those over half its period: +1 at a pitchfork, -1 at a fold.

        Returns
        -------
        ndarray of complex, shape (2 N,)
            First those of the modes that impacts see; the others are exactly ``exp(+-i w T)``.

        Raises
        ------
        BadInput
            With `half`, if the orbit is not symmetric.
        """
        if sites is not None and self.lattice != Ring(sites):
            found: ComplexArray = self._on_ring(sites).multipliers(half=half)
            return found
        if half and not self.symmetric:
            raise BadInput("this orbit was not shot on half its period: it has no half map.")
        found = np.concatenate([self.coupled, self._unseen()])
        return found if half or not self.symmetric else found * found

    @property
    def coupled(self) -> ComplexArray:
        """Multipliers over a section of the modes that impacts see."""
        return self.section.multipliers

    @cached_property
    def over_period(self) -> ComplexArray:
        """The same over the period."""
        return self.coupled**2 if self.symmetric else self.coupled

    @property
    def idle(self) -> float:
        """Largest modulus over a section of all other modes, 0 if there are none."""
        unseen = abs(self._unseen())
        return float(unseen.max(initial=0.0)) if self.damping else float(unseen.size > 0)

    def _unseen(self) -> ComplexArray:
        z = self.gamma * self.section.basis.unseen + self.spring
        return np.concatenate(free_multipliers(z, self.damping, self.itinerary.length))

    def stability(self, sites: int | None = None, threshold: float = THRESHOLD) -> Verdict:
        """Is it stable on its lattice? Multipliers over the whole period against a threshold.

        Parameters
        ----------
        sites : int, optional
            Ask about a ring of so many sites; about its own lattice unless given.
        threshold : float
            At least 1. A ring always has multipliers on the unit circle and others, of waves that
            run around it, within O(1/N) of it; the paper takes 1.005.

        Returns
        -------
        Verdict
        """
        own = self if sites is None or self.lattice == Ring(sites) else self._on_ring(sites)
        return verdict(own, threshold)

    def admissibility(self) -> Admissibility:
        """Whether all sites keep off their walls between impacts, and by how much."""
        return clearance(self.watch)

    @property
    def watch(self) -> Watch:
        """What that is measured on."""
        return Modes(self)

    @property
    def problem(self) -> Problem:
        """The orbit as a start for `trace`."""
        from contbreather.breathers.shooting import problem_of

        return problem_of(self)

    def __repr__(self) -> str:
        times = ", ".join(f"{t:.8g}" for t in self.times)
        margins = self.admissibility()
        mark = "" if margins.ok or abs(margins.margin) < 1e-9 else f"; {margins.reason}"
        return (
            f"<RingOrbit {self.itinerary.describe()}; "
            + ", ".join(f"{name} = {value:.10g}" for name, value in self.conditions.params.items())
            + f"; t = ({times}); residual {self.residual:.1e}{mark}>"
        )
