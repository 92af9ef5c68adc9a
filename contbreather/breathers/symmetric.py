"""The symmetric breather: site 0 hits its walls in turn, at t = phi and t = phi + pi.

Eqs. (3) to (13), for any antisymmetric forcing and any lattice that answers `Lattice`. Between
impacts everything is in closed form in time (see `contbreather.lattice.green`); no Fourier series
of (9) or (12) is summed anywhere.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from contbreather.breathers.clearance import Admissibility, Watch, clearance
from contbreather.breathers.closure import (
    EPS,
    Closure,
    roots,
    smallest_amplitude,
)
from contbreather.breathers.watched import ClosedForm
from contbreather.checks import numbers, real
from contbreather.errors import BadInput
from contbreather.lattice import (
    Forcing,
    Harmonic,
    InfiniteChain,
    Lattice,
    Ring,
    check_gamma,
    finite,
    forcing_of,
    lattice_of,
)
from contbreather.lattice.conditions import Conditions, Walls, check_amplitude, restitution_ratio
from contbreather.lattice.green import Flight, flight
from contbreather.stability.verdict import THRESHOLD

if TYPE_CHECKING:
    from contbreather.breathers.ring_orbit import RingOrbit
    from contbreather.continuation import Problem
    from contbreather.stability import Verdict

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

__all__ = ["Breather", "Closure", "smallest_amplitude", "symmetric", "symmetric_roots"]


@lru_cache(maxsize=4096)
def flight_of(lattice: Lattice, gamma: float, distance: int) -> Flight:
    """One site between impacts, per unit p; kept, because profiles ask for it again and again."""
    return flight(float(lattice.first_harmonic(gamma, distance)), lattice.powers(gamma, distance))


@lru_cache(maxsize=1024)
def flight_slope_of(lattice: Lattice, gamma: float, distance: int) -> Flight:
    """Derivative of `flight_of` with respect to gamma, at the same time since the impact."""
    slope = float(lattice.dfirst_harmonic(gamma, distance))
    return flight(slope, lattice.dpowers(gamma, distance))


@dataclass(frozen=True)
class Breather:
    """What a point of a branch is physically. Built by `symmetric`, or from a point's values.

    Attributes
    ----------
    a, gamma, k : float
        Amplitude of the forcing, coupling, restitution coefficient.
    p, phi : float
        Half the momentum of an impact, and its phase lag: the roots of (11).
    forcing : Forcing
    lattice : Lattice
    """

    a: float
    gamma: float
    k: float
    p: float
    phi: float
    forcing: Forcing = field(default_factory=Harmonic)
    lattice: Lattice = field(default_factory=InfiniteChain)

    def __post_init__(self) -> None:
        check_gamma(self.gamma)
        restitution_ratio(self.k)
        check_amplitude(self.a)
        if not (math.isfinite(real(self.phi)) and 0.0 < real(self.p) < math.inf):
            raise BadInput(
                f"p = {self.p!r}, phi = {self.phi!r}: a breather needs a finite phase and an "
                "impact with p > 0; use symmetric(a, gamma, k) to find them."
            )

    # ------------------------------------------------------------------ what follows from (11)

    @property
    def q(self) -> float:
        """``(1 - k)/(1 + k)``."""
        return restitution_ratio(self.k)

    @property
    def chi(self) -> float:
        """Eq. (10)."""
        return self.lattice.chi(self.gamma)

    @property
    def period(self) -> float:
        return 2.0 * math.pi

    @property
    def w_minus(self) -> float:
        """Velocity of site 0 just before it hits the wall at +1: ``2 p/(1 + k)``."""
        return 2.0 * self.p / (1.0 + self.k)

    @property
    def acceleration(self) -> float:
        """Acceleration of site 0 just before (and after) that impact: ``a f''(phi) - p eta``."""
        return float(self.a * self.forcing.d2f(self.phi) - self.p * self.lattice.eta(self.gamma))

    @property
    def b(self) -> float:
        """Off-diagonal entry of the saltation matrix (19): ``(1 + k) acceleration/w_minus``."""
        return 0.5 * (1.0 + self.k) ** 2 * self.acceleration / self.p

    @property
    def residual(self) -> float:
        """Largest error of (11); rounding, unless the breather was put together by hand."""
        here = {"a": self.a, "gamma": self.gamma, "k": self.k}
        closure = Closure(self.forcing, self.lattice)
        return float(np.max(np.abs(closure.residual(np.array([self.p, self.phi]), here))))

    # ------------------------------------------------------------------------------- profile

    def displacement(self, n: ArrayLike, t: ArrayLike) -> Any:
        """Where site ``n`` is at time ``t``, eq. (12) in closed form.

        Parameters
        ----------
        n : int or array_like of int
            Site, 0 being the one that impacts; on a ring modulo its number of sites.
        t : float or array_like
            Any real times; n and t are broadcast against each other.

        Returns
        -------
        float or ndarray

        Examples
        --------
        >>> b = symmetric(0.5, 0.12, 0.4)
        >>> round(b.displacement(0, b.phi), 14)
        1.0
        """
        return self._profile(n, t, velocity=False)

    def velocity(self, n: ArrayLike, t: ArrayLike) -> Any:
        """How fast site ``n`` is at time ``t``; at an impact, the value just after it.

        Parameters and shapes as in `displacement`. A time within rounding of an impact counts as
        the impact.

        Examples
        --------
        >>> b = symmetric(0.5, 0.12, 0.4)
        >>> round(b.velocity(0, b.phi) / b.w_minus, 14)
        -0.4
        """
        return self._profile(n, t, velocity=True)

    def state(self, sites: int, t: float = 0.0) -> tuple[FloatArray, FloatArray]:
        """Displacements and velocities of all sites of a ring at time ``t``.

        A ring closes (11) with its own chi, so a breather of the infinite chain does not solve a
        ring. If this breather does not live on ``Ring(sites)`` already, the ring's own breather
        at the same a, gamma, k and forcing is taken (of several roots the one nearest in (p, phi)):
        a state that a simulation of the ring repeats exactly.

        Returns
        -------
        u, v : ndarray, shape (sites,)
            Site 0 first; at an impact the velocities just after it.

        Raises
        ------
        NoSolution
            If the ring has no breather there.
        """
        own = self.on(Ring(sites))
        n = np.arange(int(sites))
        return own.displacement(n, t), own.velocity(n, t)

    def on(self, lattice: Lattice) -> Breather:
        """This breather on another lattice: same a, gamma, k, forcing, the nearest root of (11)."""
        if lattice == self.lattice:
            return self
        found = symmetric_roots(self.a, self.gamma, self.k, forcing=self.forcing, lattice=lattice)
        return min(
            found,
            key=lambda b: math.hypot(b.p - self.p, math.remainder(b.phi - self.phi, 2.0 * math.pi)),
        )

    def flight(self, n: int) -> Flight:
        """Site n between two impacts per unit p, as a function of ``t - phi - pi/2``."""
        return flight_of(self.lattice, self.gamma, self.lattice.distance(n))

    def _profile(self, n: ArrayLike, t: ArrayLike, *, velocity: bool) -> Any:
        times = numbers("t", t)
        sites, times = np.broadcast_arrays(_whole(n), times)
        y, sign = self._phase(times)
        own = np.empty(times.shape)
        # one closed form for each distance from the impacting site
        near = np.abs(sites)
        for m in np.unique(near):
            at = near == m
            answer = self.flight(int(m))
            own[at] = answer.slope(y[at]) if velocity else answer.value(y[at])
        driven = self.forcing.df(times) if velocity else self.forcing.f(times)
        total = self.a * driven + self.p * sign * own
        return float(total) if total.ndim == 0 else total

    def _phase(self, t: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Time from the middle of the flight, in [-pi/2, pi/2), and the sign of that flight."""
        since = t - self.phi
        flights = np.floor(since / math.pi)
        s = since - flights * math.pi
        # phi + pi in floating point is not quite an impact; it is meant to be one
        late = math.pi - s <= 4.0 * EPS * (math.pi + np.abs(t) + abs(self.phi))
        flights = np.where(late, flights + 1.0, flights)
        s = np.where(late, 0.0, np.maximum(s, 0.0))
        return s - 0.5 * math.pi, np.where(flights % 2.0 == 0.0, 1.0, -1.0)

    # -------------------------------------------------------------------- what it is asked about

    def admissibility(self) -> Admissibility:
        """Whether every site keeps off the walls it must not touch: (15), (B3), the far field."""
        return clearance(self.watch)

    @property
    def watch(self) -> Watch:
        """What that is measured on."""
        return ClosedForm(self)

    def stability(self, sites: int | None = None, threshold: float | None = None) -> Verdict:
        """Is it stable? The verdict names the chain it is about.

        Parameters
        ----------
        sites : int, optional
            Ask about a ring of that many sites, by the paper's rule: a multiplier over 2 pi beyond
            `threshold`. Unless given, the question is about the breather's own lattice; on the
            infinite chain the answer is the number of isolated multipliers of QS outside the unit
            circle, without a threshold.
        threshold : float, optional
            Above 1, the paper's 1.005 unless given; for rings only.

        Returns
        -------
        Verdict

        Examples
        --------
        >>> b = symmetric(a=0.2, gamma=0.11, k=0.8)
        >>> b.stability().unstable, b.stability(sites=400).stable
        (2, False)
        """
        from contbreather.stability import stability

        own = self if sites is None else self.on(Ring(sites))
        if threshold is None:
            threshold = THRESHOLD
        elif not isinstance(own.lattice, Ring):
            raise BadInput(
                f"threshold = {threshold}: the infinite chain has none, its verdict is exact; "
                "ask for stability(sites=N, threshold=...)."
            )
        return stability(own.gamma, own.k, own.b, own.lattice, threshold=threshold)

    def multipliers(self, sites: int | None = None, *, half: bool = False) -> ComplexArray:
        """All 2N Floquet multipliers on a ring, of (QS)^2 (20), or of the half map QS.

        Parameters
        ----------
        sites : int, optional
            N; needed unless the breather lives on a `Ring` already. The orbit is the ring's own.
        half : bool
            Those of QS: +1 at a pitchfork, -1 at a fold, where the squares are both +1.

        Returns
        -------
        ndarray of complex, shape (2 N,)

        Examples
        --------
        >>> b = symmetric(a=0.8, gamma=0.045, k=0.8)
        >>> round(float(abs(b.multipliers(sites=400)).max()), 6)
        1.129438
        """
        from contbreather.stability import half_multipliers

        own = self if sites is None else self.on(Ring(sites))
        if not isinstance(own.lattice, Ring):
            raise BadInput(
                "the infinite chain has a continuous spectrum; ask for multipliers(sites=N) on a "
                "ring of N, or for stability().multipliers, the isolated ones outside the circle."
            )
        found = half_multipliers(own.lattice, own.gamma, own.k, own.b)
        return found if half else found * found

    @property
    def problem(self) -> Problem:
        """The breather as a start for `trace`: the closure (11) with all its events."""
        from contbreather.breathers.problem import problem_of

        return problem_of(self)


def _whole(n: ArrayLike) -> NDArray[np.int64]:
    sites = np.asarray(n)
    if sites.dtype.kind not in "iu":
        raise BadInput(f"n = {n!r}: sites are whole numbers, 0 being the one that impacts.")
    return sites.astype(np.int64)


@overload
def symmetric(
    a: float,
    gamma: float,
    k: float,
    *,
    forcing: Forcing | str | None = None,
    lattice: Lattice | None = None,
) -> Breather: ...
@overload
def symmetric(
    a: float,
    gamma: float,
    k: float,
    *,
    forcing: Forcing | str | None = None,
    lattice: finite.Finite,
    site: int = 0,
    damping: float = 0.0,
    spring: float = 0.0,
    walls: Any = None,
) -> RingOrbit: ...
def symmetric(
    a: float,
    gamma: float,
    k: float,
    *,
    forcing: Forcing | str | None = None,
    lattice: Lattice | finite.Finite | None = None,
    site: int = 0,
    damping: float = 0.0,
    spring: float = 0.0,
    walls: Any = None,
) -> Breather | RingOrbit:
    """The symmetric breather of one impacting site, eqs. (11) to (13).

    Of several solutions the one with the largest p: for `Harmonic` forcing the upper sign of
    (13), the only one that can be stable.

    Parameters
    ----------
    a : float
        Amplitude of the forcing, at least the fold (14).
    gamma : float
        Coupling in [0, 1/4).
    k : float
        Restitution coefficient in [0, 1].
    forcing : Forcing or str, optional
        `Harmonic` unless given.
    lattice : InfiniteChain, Ring or Lattice, optional
        `InfiniteChain` unless given.
    site : int
        The one that impacts.
    damping, spring : float
        ``u'' + damping u' + spring u + ...``; on finite lattices.
    walls : (low, high) or dict of site and (low, high), optional
        -1 and 1 unless given, ``low = -high``; on finite lattices.

    Returns
    -------
    Breather, or the orbit of a finite lattice
        A solution of (11). Whether it keeps off the walls between its impacts is a question of
        its own: `admissibility`.

    Raises
    ------
    BadInput
        gamma, k or a outside its range.
    NoSolution
        a below the fold; the sentence names the smallest a.

    Examples
    --------
    >>> b = symmetric(a=0.5, gamma=0.12, k=0.4)
    >>> round(b.p, 12), round(b.phi, 12)
    (0.680056001966, -2.519293143359)
    """
    more: dict[str, Any] = {"site": site, "damping": damping, "spring": spring, "walls": walls}
    found: tuple[Any, ...] = symmetric_roots(a, gamma, k, forcing=forcing, lattice=lattice, **more)
    own: Breather | RingOrbit = found[0]
    return own


@overload
def symmetric_roots(
    a: float,
    gamma: float,
    k: float,
    *,
    forcing: Forcing | str | None = None,
    lattice: Lattice | None = None,
) -> tuple[Breather, ...]: ...
@overload
def symmetric_roots(
    a: float,
    gamma: float,
    k: float,
    *,
    forcing: Forcing | str | None = None,
    lattice: finite.Finite,
    site: int = 0,
    damping: float = 0.0,
    spring: float = 0.0,
    walls: Any = None,
) -> tuple[RingOrbit, ...]: ...
def symmetric_roots(
    a: float,
    gamma: float,
    k: float,
    *,
    forcing: Forcing | str | None = None,
    lattice: Lattice | finite.Finite | None = None,
    site: int = 0,
    damping: float = 0.0,
    spring: float = 0.0,
    walls: Any = None,
) -> tuple[Breather, ...] | tuple[RingOrbit, ...]:
    """All solutions of (11) with p > 0, by descending p; parameters and errors of `symmetric`.

    Examples
    --------
    >>> from contbreather.lattice import Fourier
    >>> two = Fourier.from_response(cos={1: 1.0, 3: 0.3})
    >>> len(symmetric_roots(0.3, 0.12, 0.7, forcing=two))
    4
    """
    drive = forcing_of(forcing)
    more = bool(site or damping or spring or walls is not None)
    if isinstance(lattice, finite.Lattice) or (more and isinstance(lattice, Ring)):
        from contbreather.breathers.one_site import symmetric_orbits

        on = Conditions(a, gamma, k, damping, spring, drive, Walls.given(walls)).checked()
        return symmetric_orbits(lattice, site, on)
    chain = lattice_of(lattice)
    if more:
        raise BadInput(
            f"site = {site!r}, damping = {damping!r}, spring = {spring!r}, walls = {walls!r}: on "
            "the infinite chain site 0 impacts, between walls at -1 and 1, without damping or "
            "springs; take Ring(N) or another finite lattice."
        )
    gamma, a = check_gamma(gamma), check_amplitude(a)
    restitution_ratio(k)
    found = roots(a, gamma, float(k), drive, chain)
    if not all(math.isfinite(p) for p, _ in found):
        reach = 1.0 / drive.peak()
        raise BadInput(
            f"a = {a!r}: too large, p is beyond what a number can hold; on the infinite chain no "
            f"breather is admissible beyond a = {reach:.6g}, where the far field reaches the walls."
        )
    return tuple(Breather(a, gamma, float(k), p, phi, drive, chain) for p, phi in found)
