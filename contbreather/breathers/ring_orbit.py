"""A periodic orbit of a ring as it was shot: where every site is, how stable it is, its impacts."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from contbreather.breathers.flight_map import Section, turn
from contbreather.breathers.itinerary import Itinerary
from contbreather.errors import BadInput
from contbreather.lattice import Forcing, Ring

if TYPE_CHECKING:
    from contbreather.breathers.admissibility import Admissibility
    from contbreather.continuation import Problem

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
EPS = float(np.finfo(float).eps)


class Hit(NamedTuple):
    """One impact of an orbit: velocities of the site just before and just after it."""

    site: int
    wall: int
    time: float
    before: float
    after: float
    acceleration: float


class Resonance(NamedTuple):
    """The mode of the ring that is closest to closing after a section without any impact."""

    order: int  # wave number 2 pi order/N
    frequency: float
    gap: float  # |exp(i w T) - sign|: 0 in resonance


@dataclass(frozen=True, repr=False)
class OrbitVerdict:
    """Stability of an orbit on its ring: multipliers over the whole period beyond a threshold."""

    sites: int
    period: float
    threshold: float
    largest: float
    unstable: int

    @property
    def stable(self) -> bool:
        return self.unstable == 0

    def describe(self) -> str:
        """The verdict as a sentence."""
        word = "stable" if self.stable else f"unstable, {self.unstable} multipliers"
        sign = "<=" if self.stable else ">"
        return (
            f"ring of {self.sites}: {word}; largest |multiplier| over {self.period / math.pi:.0f} "
            f"pi {self.largest:.9g} {sign} threshold {self.threshold:g}"
        )

    def __repr__(self) -> str:
        return f"<{self.describe()}>"


@dataclass(frozen=True, eq=False, repr=False)
class RingOrbit:
    """What a point of a shooting branch is physically.

    Attributes
    ----------
    section : Section
        Its flight from impact to impact; one half period if the orbit is symmetric.
    a, gamma, k : float
    forcing : Forcing
    lattice : Ring
    itinerary : Itinerary
    t, p : tuple of float
        Times of the impacts of a section, and half their momenta, ``(1 + k)/2`` times the
        velocity towards the wall.
    c : float
        By how much the ring as a whole sits off centre, its mean over sites and time.
    """

    section: Section

    # ----------------------------------------------------------------------- what it is

    @property
    def a(self) -> float:
        return self.section.a

    @property
    def gamma(self) -> float:
        return self.section.gamma

    @property
    def k(self) -> float:
        return self.section.k

    @property
    def forcing(self) -> Forcing:
        return self.section.forcing

    @property
    def itinerary(self) -> Itinerary:
        return self.section.itinerary

    @property
    def lattice(self) -> Ring:
        return self.itinerary.ring

    @property
    def period(self) -> float:
        return self.itinerary.period

    @property
    def symmetric(self) -> bool:
        """Whether ``u(t + period/2) = -u(t)`` was made use of."""
        return self.itinerary.symmetric

    @property
    def t(self) -> tuple[float, ...]:
        return tuple(self.section.t.tolist())

    @cached_property
    def p(self) -> tuple[float, ...]:
        half = 0.5 * (1.0 + self.k)
        found = {one.which: half * one.velocity * one.wall for one in self.section.impacts}
        return tuple(found[j] for j in range(len(found)))

    @cached_property
    def c(self) -> float:
        if self.symmetric:
            return 0.0
        shift = 0.0
        for leg in self.section.legs:  # the mean of the ring drifts freely between impacts
            shift += leg.flight * (float(leg.q[0]) + 0.5 * leg.flight * float(leg.r[0]))
        return shift / self.itinerary.length / math.sqrt(self.lattice.sites)

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
                        side * one.acceleration,
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
        """The mode that is nearest to closing on its own; None if the ring has but its mean.

        In resonance the itinerary alone no longer tells how strongly that mode moves: on an
        eigenfrequency n w = j the orbit is found nevertheless, its condition number says how well.
        """
        order, sine = self.section.basis.order, self.section.basis.sine
        own = np.flatnonzero((order > 0) & ~sine)
        if own.size == 0:
            return None
        gap = abs(np.exp(1j * self.section.free()[own]) - self.itinerary.sign)
        j = int(own[gap.argmin()])
        return Resonance(int(order[j]), math.sqrt(float(self.section.z[j])), float(gap.min()))

    # ----------------------------------------------------------------------- motion

    def displacement(self, n: ArrayLike, t: ArrayLike) -> Any:
        """Where site n is at time t; n and t are broadcast against each other.

        Parameters
        ----------
        n : int or array_like of int
            Site, modulo the size of the ring.
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
                f"this orbit lives on a ring of {self.lattice.sites}, not of {sites}: shoot it "
                f"there first, shooting(orbit, sites={sites})."
            )
        q, r = self.modes(np.array(float(t)))
        driven = self.a * self.forcing.f(float(t)), self.a * self.forcing.df(float(t))
        basis = self.section.basis
        return basis.to_sites(q) + driven[0], basis.to_sites(r) + driven[1]

    def at(self, n: int, t: float) -> tuple[float, float, float]:
        """Displacement, velocity and acceleration of one site at one time."""
        q, r = self.modes(np.array(t))
        e, a, f = self.section.basis.at(n), self.a, self.forcing
        pull = float(e.dot(self.section.z * q))
        return float(e.dot(q)) + a * f.f(t), float(e.dot(r)) + a * f.df(t), a * f.d2f(t) - pull

    def motion(self, times: FloatArray) -> FloatArray:
        """Displacements of all sites at many times, shape (times, sites)."""
        driven = self.a * self.forcing.f(times)
        return self.section.basis.to_sites(self.modes(times)[0]) + driven[:, None]

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
        flown = turn(self.section.z, np.maximum(since - (starts - first)[flight], 0.0)[..., None])
        sign = np.where(sections % 2.0 == 0.0, 1.0, self.itinerary.sign)[..., None]
        now, fast = q[flight], r[flight]
        return (
            sign * (flown.cosine * now + flown.reach * fast),
            sign * (flown.cosine * fast - flown.pull * now),
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
        shape, f = self.section.basis.at(sites), self.forcing
        own = (q, r, -self.section.z * q)[order]
        free = np.einsum("...k,...k->...", shape, own)
        total = free + self.a * (f.f, f.df, f.d2f)[order](times)
        return float(total) if np.ndim(total) == 0 else total

    # ----------------------------------------------------------------------- what it is asked

    def multipliers(self, *, half: bool = False) -> ComplexArray:
        """All 2N multipliers over the period, from flows and saltation matrices.

        Parameters
        ----------
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
        if half and not self.symmetric:
            raise BadInput("this orbit was not shot on half its period: it has no half map.")
        found = np.concatenate([self.coupled, self._unseen()])
        return found if half or not self.symmetric else found * found

    @cached_property
    def coupled(self) -> ComplexArray:
        """Multipliers over a section of the modes that impacts see."""
        return np.linalg.eigvals(self.section.monodromy).astype(complex)

    def _unseen(self) -> ComplexArray:
        sites = self.lattice.sites
        if self.section.q.size == sites:
            return np.empty(0, dtype=complex)
        j = np.arange(1, (sites + 1) // 2)
        angle = self.lattice.frequencies(self.gamma)[j] * self.itinerary.length
        return np.concatenate([np.exp(1j * angle), np.exp(-1j * angle)])

    def stability(self, threshold: float = 1.005) -> OrbitVerdict:
        """Is it stable on its ring? Multipliers over the whole period against a threshold.

        Parameters
        ----------
        threshold : float
            At least 1. A ring always has multipliers on the unit circle and others, of waves that
            run around it, within O(1/N) of it; the paper takes 1.005.

        Returns
        -------
        OrbitVerdict
        """
        if not 1.0 <= threshold < math.inf:
            raise BadInput(
                f"threshold = {threshold}: moduli on the unit circle are neutral, so a finite "
                "threshold of at least 1 is wanted (the paper takes 1.005)."
            )
        size = np.abs(self.multipliers())
        return OrbitVerdict(
            self.lattice.sites,
            self.period,
            float(threshold),
            float(size.max()),
            int(np.count_nonzero(size > threshold)),
        )

    def admissibility(self) -> Admissibility:
        """Whether all sites keep off their walls between impacts, and by how much."""
        from contbreather.breathers.clearance import clearance

        return clearance(self)

    @property
    def problem(self) -> Problem:
        """The orbit as a start for `trace`."""
        from contbreather.breathers.shooting import problem_of

        return problem_of(self)

    def __repr__(self) -> str:
        times = ", ".join(f"{t:.8g}" for t in self.t)
        margins = self.admissibility()
        mark = "" if margins.ok or abs(margins.margin) < 1e-9 else f"; {margins.reason}"
        return (
            f"<RingOrbit {self.itinerary.describe()}; a = {self.a:.10g}, gamma = {self.gamma:.10g},"
            f" k = {self.k:.10g}; t = ({times}); residual {self.residual:.1e}{mark}>"
        )
