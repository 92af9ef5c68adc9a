"""The closed form of the symmetric breather: site 0 hits its walls in turn, at phi and phi + pi.

Eqs. (3) to (13), for any antisymmetric forcing, on the infinite chain and on rings. Between
impacts everything is in closed form in time (see `contbreather.lattice.free_flight`): no
Fourier series of (9) or (12) is summed anywhere.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from contbreather.checks import real
from contbreather.errors import BadInput
from contbreather.lattice.band_averages import UniformLattice
from contbreather.lattice.chain import InfiniteChain
from contbreather.lattice.conditions import Conditions, SpringResponse, restitution_ratio
from contbreather.lattice.forcing import Forcing, Harmonic
from contbreather.lattice.free_flight import TERMS, FreeFlight, free_flight
from contbreather.orbits.closure import (
    EPS,
    ClosureTerms,
    closure_equations,
    fold_scalar,
    saltation_of,
    sprung,
    terms_at,
)
from contbreather.orbits.section import Impact, Section
from contbreather.orbits.site_motion import ClosedFormMotion, Terms
from contbreather.parameters import parameter

if TYPE_CHECKING:
    from contbreather.stability.half_period import HalfMap

FloatArray = NDArray[np.float64]

HALF = Section(((0, 1),), sign=-1)


@lru_cache(maxsize=4096)
def flight_of(lattice: UniformLattice, gamma: float, distance: int) -> FreeFlight:
    """One site between impacts, per unit p; kept, because profiles ask for it again and again."""
    return free_flight(
        float(lattice.first_harmonic(gamma, distance)), lattice.powers(gamma, distance)
    )


@lru_cache(maxsize=1024)
def flight_slope_of(lattice: Any, gamma: float, distance: int, name: str = "gamma") -> FreeFlight:
    """Derivative of `flight_of` in gamma or the spring, at the same time since the impact."""
    if name == "spring":
        first, powers = lattice.first_by_spring, lattice.spring_powers
    else:
        first, powers = lattice.dfirst_harmonic, lattice.dpowers
    return free_flight(float(first(gamma, distance)), powers(gamma, distance))


@dataclass(frozen=True)
class SymmetricBreather:
    """The motion of a symmetric breather, from the roots (p, phi) of (11).

    Attributes
    ----------
    a, gamma, k : float
        Amplitude of the forcing, coupling, restitution coefficient.
    p, phi : float
        Half the momentum of an impact, and its phase lag.
    forcing : Forcing
        Where springs hold the sites to the ground, `SpringResponse`, the response to a forcing.
    lattice : InfiniteChain or Ring
    """

    a: float
    gamma: float
    k: float
    p: float
    phi: float
    forcing: Forcing = field(default_factory=Harmonic)
    lattice: UniformLattice = field(default_factory=InfiniteChain)

    section: ClassVar[Section] = HALF
    offsets: ClassVar[tuple[float, ...]] = (0.0,)
    c: ClassVar[float] = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "lattice", sprung(self.lattice, self.forcing))
        self.lattice.check(self.gamma)
        restitution_ratio(self.k)  # refuses what is not in [0, 1]
        parameter("a", self.a)
        if not (math.isfinite(real(self.phi)) and 0.0 < real(self.p) < math.inf):
            raise BadInput(
                f"p = {self.p!r}, phi = {self.phi!r}: a breather needs a finite phase and an "
                "impact with p > 0; use symmetric(a, gamma, k) to find them."
            )

    # ------------------------------------------------------------------------ as any motion

    @property
    def conditions(self) -> Conditions:
        on, f = (self.a, self.gamma, self.k), self.forcing
        if isinstance(f, SpringResponse):
            return Conditions(*on, spring=f.spring, forcing=f.of, lattice=InfiniteChain())
        return Conditions(*on, forcing=f, lattice=self.lattice)

    @property
    def impacts(self) -> tuple[Impact, ...]:
        return (Impact(0, 1, self.phi, -2.0 * self.p),)  # the other one is its mirror image

    @property
    def error(self) -> float:
        return float(np.max(np.abs(closure_equations(terms_at(self, "chi")))))

    # ------------------------------------------------------------------ what follows from (11)

    @property
    def q(self) -> float:
        """``(1 - k)/(1 + k)``."""
        return restitution_ratio(self.k)

    @property
    def chi(self) -> float:
        return self.lattice.chi(self.gamma)

    @property
    def family(self) -> str:
        """``"upper"`` before a fold, ``"lower"`` behind it: the sign of the determinant of (11),
        which changes at folds and nowhere else. With one harmonic that of the larger p is upper.

        Behind a fold an odd number of multipliers of QS is below -1: no lower breather is stable.
        """
        return "upper" if self.determinant >= 0.0 else "lower"

    @property
    def determinant(self) -> float:
        """That of (11) in p and phi, with the sign changed: zero at the fold, eq. (14)."""
        return float(fold_scalar(terms_at(self, "chi")))

    @property
    def accelerations(self) -> FloatArray:
        t = terms_at(self, "eta")
        return np.array([t.w - t.p * t.mean])  # u'' = a f'' + v'', eq. (5)

    @property
    def b(self) -> float:
        """Off-diagonal entry of the saltation matrix (19)."""
        w, eta = self.a * self.forcing.d2f(self.phi), self.lattice.eta(self.gamma)
        return float(saltation_of(ClosureTerms(self.p, self.k, eta, w=w)))

    # ------------------------------------------------------------------------------- profile

    def flight(self, n: int) -> FreeFlight:
        """Site n between two impacts per unit p, as a function of ``t - phi - pi/2``."""
        return flight_of(self.lattice, self.gamma, self.lattice.distance(int(n)))

    def profile(self, n: NDArray[np.int64], t: FloatArray, order: int) -> FloatArray:
        """Eq. (12) in closed form, and its derivatives."""
        n, t = np.broadcast_arrays(n, t)
        y, sign = self._phases(t)
        # beyond as many bonds as there are powers of w^2 nothing but the first harmonic is left
        first = 4.0 / math.pi * self.lattice.first_harmonic(self.gamma, n)
        response = np.asarray(FreeFlight(first, ()).at(y)[order])
        away = self.lattice.distance(n)
        for m in np.unique(away[away <= TERMS]):
            at = away == m
            response[at] = self.flight(int(m)).at(y[at])[order]
        f = self.forcing
        # u = a f + p v, eqs. (5) and (12)
        return np.asarray(self.a * (f.f, f.df, f.d2f)[order](t) + self.p * sign * response)

    def at(self, site: int, t: float) -> Terms:
        """Displacement, velocity and acceleration of a site at one time."""
        (y, sign), (f, df, d2f) = self.phase(t), self.forcing.motion(t)
        (u, v, w), a, p = self.flight(site).at(y), self.a, sign * self.p
        return a * f + p * u, a * df + p * v, a * d2f + p * w

    def state(self, t: float) -> tuple[FloatArray, FloatArray]:
        """Displacements and velocities of all sites of a ring at one time."""
        sites, time = np.arange(self.lattice.sites or 0), np.array(t)
        return self.profile(sites, time, 0), self.profile(sites, time, 1)

    def phase(self, t: float) -> tuple[float, float]:
        """Time from the middle of the flight, in [-pi/2, pi/2), and the sign of that flight."""
        flights = math.floor((t - self.phi) / math.pi)  # v(t + pi) = -v(t), eq. (3)
        sign = -1.0 if flights % 2 else 1.0
        return t - self.phi - (flights + 0.5) * math.pi, sign

    def _phases(self, t: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The same of many times; one within rounding of an impact is in the flight after it."""
        since = t - self.phi
        flights = np.floor(since / math.pi)
        s = since - flights * math.pi  # time since the last impact, in [0, pi)
        # phi + pi in floating point is not quite an impact; it is meant to be one
        late = math.pi - s <= 4.0 * EPS * (math.pi + np.abs(t) + abs(self.phi))
        flights = np.where(late, flights + 1.0, flights)
        s = np.where(late, 0.0, np.maximum(s, 0.0))
        return s - 0.5 * math.pi, np.where(flights % 2.0 == 0.0, 1.0, -1.0)

    @property
    def motion(self) -> ClosedFormMotion:
        """What its clearance from the walls is measured on."""
        return ClosedFormMotion(self, self.forcing, self.lattice)

    # ----------------------------------------------------------------------------- stability

    @cached_property
    def map(self) -> HalfMap:
        from contbreather.stability.half_period import HalfMap

        return HalfMap(self.gamma, self.k, self.b, self.lattice)
