"""Symmetric breathers in closed form: one site that hits its walls in turn, as a representation,
and all solutions of (11) at given parameters.

Eqs. (3) to (13), for any antisymmetric forcing, on the infinite chain and on rings. Between
impacts everything is in closed form in time (see `contbreather.lattice.periodic_green`): no
Fourier series of (9) or (12) is summed anywhere.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from contbreather.checks import real
from contbreather.errors import BadInput, NoSolution
from contbreather.lattice.band_averages import UniformLattice, check_gamma
from contbreather.lattice.chain import InfiniteChain, Ring, lattice_of
from contbreather.lattice.conditions import (
    Conditions,
    SpringResponse,
    Walls,
    in_time_of_drive,
    restitution_ratio,
    spring_response,
)
from contbreather.lattice.finite import Finite, Lattice, per_site
from contbreather.lattice.forcing import Drive, Forcing, Harmonic, check_symmetric
from contbreather.lattice.formula import forcing_of
from contbreather.lattice.response import UniformResponse
from contbreather.orbits.clearance import LIMIT
from contbreather.orbits.closure import (
    closure_equations,
    fold_scalar,
    forcing_at,
    general_roots,
    harmonic_roots,
    saltation_of,
    smallest_amplitude,
    sprung,
    terms_at,
)
from contbreather.orbits.orbit import Orbit
from contbreather.orbits.section import Impact, Section
from contbreather.parameters import parameter
from contbreather.storage.serialise import serialised

if TYPE_CHECKING:
    from contbreather.continuation.curve.point import DefiningSystem, Point
    from contbreather.continuation.curve.problem import Problem
    from contbreather.orbits.grazing import GrazingSite
    from contbreather.stability.one_impact import HalfMap, RingHalfMap

FloatArray = NDArray[np.float64]

HALF = Section(((0, 1),), sign=-1)


@dataclass(frozen=True)
class ClosedForm:
    """The motion of a symmetric breather, from the roots (p, phi) of (11): one site of the infinite
    chain or of a ring that hits its walls in turn, at phi and phi + pi.
    """

    a: float
    gamma: float
    k: float
    p: float
    phi: float
    # where springs hold the sites to the ground a `SpringResponse`
    forcing: Forcing = field(default_factory=Harmonic)
    lattice: UniformLattice = field(default_factory=InfiniteChain)

    section: ClassVar[Section] = HALF
    offsets: ClassVar[tuple[float, ...]] = (0.0,)
    c: ClassVar[float] = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "lattice", sprung(self.lattice, self.forcing))
        check_gamma(self.gamma, self.lattice.spring)
        parameter("k", self.k)
        parameter("a", self.a)
        if not (math.isfinite(real(self.phi)) and 0.0 < real(self.p) < math.inf):
            raise BadInput(
                f"p = {self.p!r}, phi = {self.phi!r}: a breather needs a finite phase and an "
                "impact with p > 0; use symmetric(a, gamma, k) to find them."
            )

    @staticmethod
    def suits(on: Conditions, section: Section) -> bool:
        # the means with a spring are those of the infinite chain; a ring goes by its modes
        where: Any = InfiniteChain if on.spring else InfiniteChain | Ring
        plain = not on.damping and on.walls == Walls()
        return plain and section == HALF and isinstance(on.lattice, where) and on.symmetric

    @classmethod
    def through(
        cls, on: Conditions, section: Section, times: Any, impulses: Any, offsets: Sequence[float]
    ) -> ClosedForm:
        # (4): the impact on the wall +1 takes away the momentum 2p
        p, phi = -0.5 * float(impulses[0]), float(times[0])
        drive = spring_response(on.forcing, on.spring) if on.spring else on.forcing
        return cls(on.a, on.gamma, on.k, p, phi, drive, on.lattice)

    @classmethod
    def of(
        cls, forcing: Forcing, lattice: UniformLattice, x: Any, params: Mapping[str, float]
    ) -> ClosedForm:
        """Make the closed form of the roots p and phi."""
        p, phi = map(float, x)
        drive = forcing_at(forcing, params)
        return cls(params["a"], params["gamma"], params["k"], p, phi, drive, lattice)

    # ------------------------------------------------------------------------ as any motion

    @cached_property
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
        return self.lattice.mean(self.gamma, "chi")

    @property
    def family(self) -> str:
        """``"upper"`` before a fold, ``"lower"`` behind it: the sign of the determinant of (11),
        which changes at folds and nowhere else. With one harmonic that of the larger p is upper.

        Behind a fold an odd number of multipliers of QS is below -1: no lower breather is stable.
        """
        return "upper" if fold_scalar(terms_at(self, "chi")) >= 0.0 else "lower"

    @property
    def accelerations(self) -> FloatArray:
        t = terms_at(self, "eta")
        return np.array([t.w - t.p * t.mean])  # u'' = a f'' + v'', eq. (5)

    @property
    def b(self) -> float:
        """Off-diagonal entry of the saltation matrix (19)."""
        return float(saltation_of(terms_at(self, "eta")))

    @property
    def response(self) -> UniformResponse:
        """Eq. (12) in closed form."""
        return UniformResponse(self.lattice, self.forcing, self.gamma, 0.0, 0.0, (0,), 1, -1)

    @cached_property
    def map(self) -> HalfMap | RingHalfMap:
        from contbreather.stability.one_impact import half_map

        return half_map(self.gamma, self.k, self.b, self.lattice)

    # ------------------------------------------------------------ what continues it, and is like it

    def locus(self, of: Any, point: Point, nu: float | None = None, **more: Any) -> DefiningSystem:
        from contbreather.orbits.closed_problem import defining_system

        return defining_system(of, point, nu, **more)

    def grazing_site(self, site: int) -> GrazingSite:
        from contbreather.orbits.closed_problem import contact_walker
        from contbreather.orbits.grazing import GrazingSite

        return GrazingSite(site, walker=partial(contact_walker, self.lattice.distance(site)))

    def speed_slope(self, j: int) -> None:
        """(11) has no root with p = 0."""

    def lifted(self) -> Problem:
        """The problem of asymmetric breathers, in which a pitchfork is a regular point."""
        from contbreather.orbits.asymmetric_breather import asymmetric_problem

        return asymmetric_problem(Orbit(self).unfolded())

    def problem(self, threshold: float) -> Problem:
        from contbreather.orbits.closed_problem import symmetric_problem

        return symmetric_problem(Orbit(self), threshold)

    def guess(self, threshold: float) -> Problem:
        return self.problem(threshold)

    def on(self, lattice: Any) -> Orbit | None:
        """The root of (11) nearest to this one."""
        if not isinstance(lattice, InfiniteChain | Ring):
            return None
        on = self.conditions
        more: dict[str, Any] = {"forcing": on.forcing, "lattice": lattice, "spring": on.spring}
        return min(
            symmetric_roots(on.a, on.gamma, on.k, **more),
            # phases count modulo the period
            key=lambda b: math.hypot(b.p - self.p, math.remainder(b.phi - self.phi, 2.0 * math.pi)),
        )


def closed_forms(
    a: float, gamma: float, k: float, drive: Forcing, chain: UniformLattice
) -> tuple[Orbit, ...]:
    """Solutions of (11) with p > 0, by descending p, phi in [-pi, pi]. A double root, at the fold,
    is listed once; `NoSolution` below it names the smallest a."""
    lattice = sprung(chain, drive)
    gamma = check_gamma(gamma, lattice.spring)
    a, k = parameter("a", a), parameter("k", k)
    chi, q = lattice.mean(gamma, "chi"), restitution_ratio(k)
    simple = isinstance(drive, Harmonic)
    pairs = harmonic_roots(a, chi, q) if simple else general_roots(a, chi, q, drive)
    # above the fold there is always one: on the way of a f from its minimum up to 1 the reduced
    # equation changes sign while f rises, and there p q = a f' > 0
    if not pairs:
        raise NoSolution(
            f"no breather at a = {a!r} (gamma = {gamma}, k = {k}, {drive.describe()}): it is below "
            f"the fold, eq. (14); the smallest a is {smallest_amplitude(gamma, k, drive, chain)!r}."
        )
    if not all(math.isfinite(p) for p, _ in pairs):
        # the far field follows a f
        reach = 1.0 / drive.peak()
        raise BadInput(
            f"a = {a!r}: too large, p is beyond what a number can hold; on the infinite chain no "
            f"breather is admissible beyond a = {reach:.6g}, where the far field reaches the walls."
        )
    descending = sorted(pairs, reverse=True)
    return tuple(Orbit(ClosedForm(a, gamma, k, p, phi, drive, chain)) for p, phi in descending)


@serialised("symmetric breather")
def _from_dict(
    *,
    forcing: Forcing,
    lattice: UniformLattice,
    threshold: float,
    start: Mapping[str, Any],
    params: Mapping[str, float],
) -> Problem:
    motion = ClosedForm.of(forcing, lattice, (start["p"], start["phi"]), params)
    return motion.problem(threshold)


def symmetric(
    a: float,
    gamma: float,
    k: float,
    *,
    forcing: Drive | None = None,
    lattice: UniformLattice | Finite | None = None,
    site: int = 0,
    damping: float = 0.0,
    spring: float | None = None,
    walls: Any = None,
    omega: float = 1.0,
    root: int | None = None,
) -> Orbit:
    """The symmetric breather of one impacting site, (11) to (13).

    Of several solutions the admissible one with the largest p. For `Harmonic` forcing that is the
    upper sign of (13), the only one that can be stable, wherever it keeps off the walls.

    Parameters
    ----------
    a : float
        Amplitude of the forcing, at least the fold (14).
    gamma : float
        Coupling in [0, 1/4).
    k : float
        Restitution coefficient in [0, 1].
    forcing : Forcing, str or function of t, optional
        `Harmonic` unless given.
    lattice : InfiniteChain, Ring or Lattice, optional
        `InfiniteChain` unless given.
    site : int
        The one that impacts.
    damping, spring : float, optional
        ``u'' + damping u' + spring u + ...``. On the infinite chain springs alone, with
        ``spring + 4 gamma < 1``.
    walls : (low, high), one of each site, or dict of site and (low, high), optional
        -1 and 1 unless given, ``low = -high``, for which a number stands; on finite lattices.
    omega : float
        Frequency of the drive, ``F = a f(omega t)``. Times of the orbit are phases omega t, its
        velocities and p are in d omega; gamma goes up to omega^2/4.
    root : int, optional
        Which solution of (11), by falling p from 1, admissible or not.

    Returns
    -------
    Orbit
        A solution of (11). Where none keeps off the walls between its impacts (to 1e-9, at the
        limit) it is that with the largest p, and its `admissibility` says what is in the way.

    Raises
    ------
    BadInput
        gamma, k or a outside its range, or no solution of that number.
    NoSolution
        a below the fold; the sentence names the smallest a.

    Examples
    --------
    >>> b = symmetric(a=0.5, gamma=0.12, k=0.4)
    >>> round(b.p, 12), round(b.phi, 12)
    (0.680056001966, -2.519293143359)
    """
    more: dict[str, Any] = {"site": site, "damping": damping, "spring": spring, "walls": walls}
    more["omega"] = omega
    return rooted(symmetric_roots(a, gamma, k, forcing=forcing, lattice=lattice, **more), root)


def rooted(roots: tuple[Orbit, ...], root: int | None) -> Orbit:
    """The root of that number, by falling p from 1; or the first admissible one, or the first."""
    if root is None:
        candidates = roots if len(roots) > 1 else ()
        # on GR rounding must not decide which of two breathers it is
        return next((b for b in candidates if b.admissibility().margin > -LIMIT), roots[0])
    if not (isinstance(root, int | np.integer) and 1 <= root <= len(roots)):
        listing = ", ".join(f"{i}: p = {b.p:.9g}" for i, b in enumerate(roots, start=1))
        raise BadInput(f"root {root}: the solutions of (11) are {listing}; choose one of them")
    return roots[root - 1]


def symmetric_roots(
    a: float,
    gamma: float,
    k: float,
    *,
    forcing: Drive | None = None,
    lattice: UniformLattice | Finite | None = None,
    site: int = 0,
    damping: float = 0.0,
    spring: float | None = None,
    walls: Any = None,
    omega: float = 1.0,
) -> tuple[Orbit, ...]:
    """Every solution of (11) with p > 0, by descending p; parameters and errors of `symmetric`.

    Examples
    --------
    >>> from contbreather.lattice import Fourier
    >>> two = Fourier.from_response(cos={1: 1.0, 3: 0.3})
    >>> len(symmetric_roots(0.3, 0.12, 0.7, forcing=two))
    4
    """
    held = {"k": k, "damping": damping, "spring": 0.0 if spring is None else spring}
    lattice, held = per_site(lattice, held)
    k, damping, stiff = held["k"], held["damping"], parameter("spring", held["spring"])
    drive = forcing_of(forcing)
    check_symmetric(drive)
    at = Walls.given(walls)
    more = any(real(value) != 0.0 for value in (site, damping)) or at != Walls()
    # the closed form is that of site 0 between -1 and 1: all else goes by the modes
    by_modes = isinstance(lattice, Lattice) or (isinstance(lattice, Ring) and (more or stiff))
    place: Any = lattice if by_modes else lattice_of(lattice)
    if more and not by_modes:
        parameter("damping", damping)
        raise BadInput(
            f"site = {site!r}, damping = {damping!r}, walls = {walls!r}: on the infinite chain "
            "site 0 impacts, between walls at -1 and 1, without damping; take a ring or another "
            "finite lattice."
        )
    frequency = parameter("omega", omega)
    on = Conditions(a, gamma, k, damping, stiff, drive, at, place, omega=frequency)
    with in_time_of_drive(on.checked() if by_modes else on) as scaled:
        if by_modes:
            from contbreather.orbits.by_impacts import symmetric_orbits

            orbits = symmetric_orbits(site, scaled)
        else:
            if stiff:
                drive = spring_response(drive, InfiniteChain(scaled.spring).spring)
            orbits = closed_forms(scaled.a, scaled.gamma, scaled.k, drive, place)
    return tuple(replace(orbit, omega=on.omega, given=on.params) for orbit in orbits)
