"""Any periodic orbit with impacts as a value: its profile, margins, stability, multipliers.

What it solves is in `contbreather.breathers.impacts`; symmetric, asymmetric, multi-site and
period-n breathers, on rings and on the infinite chain, are all `Orbit`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from contbreather.breathers.clearance import Admissibility, Watch, clearance
from contbreather.breathers.closure import EPS
from contbreather.breathers.impacts import Impact, OrbitEquations, equations_of
from contbreather.breathers.watched import Waves
from contbreather.continuation import Point
from contbreather.continuation.problem import Curve
from contbreather.errors import BadInput
from contbreather.lattice import Forcing, Harmonic, InfiniteChain, Lattice, Ring
from contbreather.lattice.conditions import check_amplitude, restitution_ratio
from contbreather.lattice.periodic import Wave, check_coupling, wave
from contbreather.stability.verdict import THRESHOLD

if TYPE_CHECKING:
    from contbreather.breathers.symmetric import Breather
    from contbreather.continuation import Problem
    from contbreather.stability.orbit import OrbitMap
    from contbreather.stability.verdict import Verdict

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

EQUAL = 1e-9  # flights that differ by less are equal


@dataclass(frozen=True)
class Orbit:
    """A periodic orbit with impacts: what a point of its branch is physically.

    Parameters
    ----------
    a, gamma, k : float
        Amplitude of the forcing, coupling, restitution coefficient.
    impacts : sequence of (site, wall, time, impulse)
        Those of one period; times count modulo the period.
    offsets : sequence of float
        Static displacement of each impacting site, from left to right; 0 unless given.
    periods : int
        n of the period 2 pi n.
    forcing : Forcing
    lattice : InfiniteChain or Ring

    Raises
    ------
    BadInput
        For a sequence of impacts that cannot be, impulses that push a site into its wall, or
        parameters out of range.

    Examples
    --------
    >>> from contbreather.breathers.symmetric import symmetric
    >>> same = orbit_of(symmetric(0.5, 0.12, 0.4))
    >>> abs(same.displacement(1, 0.3) - symmetric(0.5, 0.12, 0.4).displacement(1, 0.3)) < 1e-14
    True
    """

    a: float
    gamma: float
    k: float
    impacts: tuple[Impact, ...]
    offsets: tuple[float, ...] = ()
    periods: int = 1
    forcing: Forcing = field(default_factory=Harmonic)
    lattice: Lattice = field(default_factory=InfiniteChain)

    def __post_init__(self) -> None:
        impacts = tuple(Impact(*impact) for impact in self.impacts)
        object.__setattr__(self, "impacts", impacts)
        check_amplitude(self.a)
        restitution_ratio(self.k)
        check_coupling(self.lattice, self.gamma, self.periods)
        equations = self.equations
        offsets = tuple(float(c) for c in self.offsets) or (0.0,) * len(equations.sites)
        object.__setattr__(self, "offsets", offsets)
        if len(offsets) != len(equations.sites):
            raise BadInput(
                f"{len(offsets)} offsets for {len(equations.sites)} impacting sites "
                f"{list(equations.sites)}: one for each is wanted."
            )
        if not all(math.isfinite(x) for one in impacts for x in one[2:]) or not all(
            map(math.isfinite, offsets)
        ):
            raise BadInput(f"impacts {impacts}, offsets {offsets}: finite numbers are wanted.")
        for i, impact in enumerate(impacts):
            if impact.wall * impact.impulse >= 0.0:
                raise BadInput(
                    f"impact {i + 1} has the impulse {impact.impulse:.6g} at the wall "
                    f"{impact.wall:+d}: a wall pushes away from itself, so the sign must be "
                    f"{-impact.wall:+d}."
                )

    # ------------------------------------------------------------------- what it consists of

    @cached_property
    def equations(self) -> OrbitEquations:
        """The equations it solves, as functions of all unknowns and parameters."""
        return equations_of(self.sequence, self.periods, self.forcing, self.lattice)

    @property
    def sequence(self) -> tuple[tuple[int, int], ...]:
        """(site, wall) of each impact, in order."""
        return tuple((impact.site, impact.wall) for impact in self.impacts)

    @property
    def params(self) -> dict[str, float]:
        """a, gamma, k and the parameters of the forcing."""
        return {"a": self.a, "gamma": self.gamma, "k": self.k, **self.forcing.params}

    @property
    def times(self) -> FloatArray:
        return np.array([impact.time for impact in self.impacts])

    @property
    def impulses(self) -> FloatArray:
        return np.array([impact.impulse for impact in self.impacts])

    @property
    def x(self) -> FloatArray:
        """All unknowns of `equations`."""
        return np.concatenate([self.times, self.impulses, self.offsets])

    @property
    def period(self) -> float:
        return 2.0 * math.pi * self.periods

    @property
    def residual(self) -> float:
        """Largest error of the equations."""
        return float(np.abs(self.equations.residual(self.x, self.params)).max())

    @property
    def two_impacts(self) -> bool:
        """Whether one site hits the wall +1 and then the wall -1, once each in 2 pi."""
        walls = [impact.wall for impact in self.impacts]
        return self.periods == 1 and walls == [1, -1] and len(self.equations.sites) == 1

    @property
    def p(self) -> float:
        """Half the momentum of each impact of a breather with two impacts, as in (3)."""
        self._need_two("p")
        return 0.5 * abs(self.impacts[0].impulse)

    @property
    def c(self) -> float:
        """Offset of the whole chain, where one site alone takes impacts."""
        if len(self.offsets) > 1:
            raise BadInput(f"this orbit has an offset for each of {len(self.offsets)} sites.")
        return self.offsets[0]

    @property
    def asymmetry(self) -> float:
        """``t2 - t1 - pi`` of a breather with two impacts: 0 where both flights are equal."""
        self._need_two("asymmetry")
        return (self.impacts[1].time - self.impacts[0].time) % self.period - math.pi

    def _need_two(self, name: str) -> None:
        if not self.two_impacts:
            raise BadInput(f"{name} belongs to orbits with two impacts, on +1 and then on -1.")

    @property
    def incoming(self) -> FloatArray:
        """Velocity of the impacting site just before each impact, ``-J/(1 + k)``."""
        return -self.impulses / (1.0 + self.k)

    @property
    def accelerations(self) -> FloatArray:
        """Acceleration of the impacting site at each impact, the same before and after."""
        h = self.equations.meetings(self.gamma, self.times)
        return np.asarray(self.a * self.forcing.d2f(self.times) + h[2] @ self.impulses)

    @cached_property
    def entries(self) -> FloatArray:
        """The entries b of the saltation matrices (19), one for each impact."""
        b: FloatArray = (1.0 + self.k) * self.accelerations / self.incoming
        b.setflags(write=False)
        return b

    # --------------------------------------------------------------------------------- profile

    def displacement(self, n: ArrayLike, t: ArrayLike) -> Any:
        """Where site ``n`` is at time ``t``.

        Parameters
        ----------
        n : int or array_like of int
        t : float or array_like
            Any real times; n and t are broadcast against each other.

        Returns
        -------
        float or ndarray
        """
        return self._profile(n, t, 0)

    def velocity(self, n: ArrayLike, t: ArrayLike) -> Any:
        """How fast site ``n`` is at time ``t``; at an impact, the value just after it."""
        return self._profile(n, t, 1)

    def acceleration(self, n: ArrayLike, t: ArrayLike) -> Any:
        """Second derivative of `displacement`."""
        return self._profile(n, t, 2)

    def state(self, sites: int, t: float = 0.0) -> tuple[FloatArray, FloatArray]:
        """Displacements and velocities of all sites of a ring at time ``t``.

        Of the ring's own orbit (see `on`): a state that a simulation of the ring repeats exactly.

        Returns
        -------
        u, v : ndarray, shape (sites,)
            Site 0 first; at an impact the velocities just after it.
        """
        own = self.on(Ring(sites))
        n = np.arange(int(sites))
        return own.displacement(n, t), own.velocity(n, t)

    def offset(self, n: ArrayLike) -> FloatArray:
        """Static displacement of sites: straight lines between the impacting ones, level beyond.

        At gamma = 0 nothing holds the others to them: they stay where they are, at 0.
        """
        sites = np.asarray(n, dtype=float)
        places, values = list(self.equations.sites), list(self.offsets)
        ring = self.lattice.sites
        if self.gamma == 0.0:
            return np.asarray(np.where(np.isin(sites, places), np.interp(sites, places, values), 0))
        if ring is None or len(places) == 1:
            return np.asarray(np.interp(sites, places, values))
        return np.asarray(np.interp(sites % ring, places, values, period=ring))

    def _profile(self, n: ArrayLike, t: ArrayLike, order: int) -> Any:
        sites, times = np.broadcast_arrays(_whole(n), np.asarray(t, dtype=float))
        if not np.all(np.isfinite(times)):
            raise BadInput("a time is not finite; give real times.")
        f = self.forcing
        total = np.empty(times.shape)
        total[...] = self.a * (f.f, f.df, f.d2f)[order](times)
        if order == 0:
            total += self.offset(sites)
        for impact in self.impacts:
            since = self._since(times, impact.time)
            for m in np.unique(np.abs(sites - impact.site)):
                at = np.abs(sites - impact.site) == m
                answer = self._wave(int(m)).at(since[at])[order]
                total[at] += impact.impulse * answer
        return float(total) if total.ndim == 0 else total

    def _wave(self, bonds: int) -> Wave:
        return wave(self.lattice, self.gamma, self.lattice.distance(bonds), self.periods)

    def _since(self, t: FloatArray, impact: float) -> FloatArray:
        """Time since the last occurrence of an impact; within rounding of one it counts as one."""
        T = self.period
        s = (t - impact) % T
        return np.where(T - s <= 4.0 * EPS * (T + np.abs(t) + abs(impact)), 0.0, s)

    # ------------------------------------------------------------------ what it is asked about

    def on(self, lattice: Lattice) -> Orbit:
        """The orbit of another lattice with the same impacts and parameters, found by Newton's
        method from this one.

        Raises
        ------
        NotConverged
            If there is none close by.
        BadInput
            If an impacting site is not on that lattice.
        """
        if lattice == self.lattice:
            return self
        moved = self if lattice.sites is None else self._wrapped(lattice.sites)
        solved, _ = replace(moved, lattice=lattice).problem.solve(tolerance=1e-11)
        return orbit_at(solved)

    def _wrapped(self, ring: int) -> Orbit:
        """With its sites counted around a ring."""
        home = {site: site % ring for site in self.equations.sites}
        if len(set(home.values())) < len(home):
            raise BadInput(
                f"the impacting sites {list(home)} fall together on a ring of {ring} sites: take "
                "a larger one."
            )
        # offsets belong to the sites from left to right
        order = sorted(range(len(home)), key=lambda i: home[self.equations.sites[i]])
        impacts = tuple(impact._replace(site=home[impact.site]) for impact in self.impacts)
        return replace(self, impacts=impacts, offsets=tuple(self.offsets[i] for i in order))

    def admissibility(self) -> Admissibility:
        """Whether all sites keep off the walls except at the impacts named."""
        return clearance(self.watch)

    @property
    def watch(self) -> Watch:
        """What that is measured on."""
        return Waves(self)

    @cached_property
    def map(self) -> OrbitMap:
        """The map of small perturbations over one period."""
        from contbreather.stability.monodromy import Kick
        from contbreather.stability.orbit import OrbitMap

        first, T, b = self.impacts[0].time, self.period, self.entries.tolist()
        kicks = [
            Kick(impact.site, first + (impact.time - first) % T, entry)
            for impact, entry in zip(self.impacts, b, strict=True)
        ]
        kicks.sort(key=lambda kick: kick.time)
        return OrbitMap(self.gamma, self.k, tuple(kicks), self.periods, self.lattice)

    def stability(self, sites: int | None = None, threshold: float = THRESHOLD) -> Verdict:
        """Is it stable? The verdict names the chain it is about.

        Parameters
        ----------
        sites : int, optional
            Ask about a ring of that many sites: a multiplier over the period beyond `threshold`.
            Unless given, the question is about the orbit's own lattice; on the infinite chain
            the answer is the number of isolated multipliers outside the unit circle.
        threshold : float
            Above 1; for rings only.
        """
        from contbreather.stability.verdict import verdict

        own = self if sites is None else self.on(Ring(sites))
        return verdict(own.map, threshold)

    def multipliers(self, sites: int | None = None) -> ComplexArray:
        """All 2N Floquet multipliers over the period on a ring; their product is ``k^(2m)``.

        Parameters
        ----------
        sites : int, optional
            N; needed unless the orbit lives on a `Ring` already. The orbit is the ring's own.
        """
        own = self if sites is None else self.on(Ring(sites))
        return own.map.multipliers()

    @property
    def problem(self) -> Problem:
        """The orbit as a start for `trace`, with all its events."""
        from contbreather.breathers.asymmetric import asymmetric_problem
        from contbreather.breathers.orbit_problem import impact_problem

        if self.two_impacts and abs(self.asymmetry) > EQUAL:
            return asymmetric_problem(self)
        return impact_problem(self)


def orbit_of(breather: Breather) -> Orbit:
    """A symmetric breather as an orbit with two impacts."""
    b = breather
    impacts = (Impact(0, 1, b.phi, -2.0 * b.p), Impact(0, -1, b.phi + math.pi, 2.0 * b.p))
    return Orbit(b.a, b.gamma, b.k, impacts, forcing=b.forcing, lattice=b.lattice)


def orbit_at(problem: Problem) -> Orbit:
    """The orbit at the start of a problem of orbits."""
    orbit: Orbit = Point(Curve(problem, ()), problem.x).solution
    return orbit


def _whole(n: ArrayLike) -> NDArray[np.int64]:
    sites = np.asarray(n)
    if sites.dtype.kind not in "iu":
        raise BadInput(f"n = {n!r}: sites are whole numbers.")
    return sites.astype(np.int64)
