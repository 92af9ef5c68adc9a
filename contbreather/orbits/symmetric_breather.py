"""The closed form of the symmetric breather: site 0 hits its walls in turn, at phi and phi + pi.

Eqs. (3) to (13), for any antisymmetric forcing, on the infinite chain and on rings. Between
impacts everything is in closed form in time (see `contbreather.lattice.periodic_green`): no
Fourier series of (9) or (12) is summed anywhere.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from contbreather.checks import real
from contbreather.errors import BadInput
from contbreather.lattice.band_averages import UniformLattice
from contbreather.lattice.chain import InfiniteChain
from contbreather.lattice.conditions import Conditions, SpringResponse, restitution_ratio
from contbreather.lattice.forcing import Forcing, Harmonic
from contbreather.orbits.closure import (
    ClosureTerms,
    closure_equations,
    fold_scalar,
    saltation_of,
    sprung,
    terms_at,
)
from contbreather.orbits.section import Impact, Section
from contbreather.orbits.site_motion import ChainMotion
from contbreather.parameters import parameter

if TYPE_CHECKING:
    from contbreather.stability.half_period import HalfMap

FloatArray = NDArray[np.float64]

HALF = Section(((0, 1),), sign=-1)


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

    @property
    def motion(self) -> ChainMotion:
        """Eq. (12) in closed form."""
        return ChainMotion(self, self.forcing, self.lattice)

    # ----------------------------------------------------------------------------- stability

    @cached_property
    def map(self) -> HalfMap:
        from contbreather.stability.half_period import HalfMap

        return HalfMap(self.gamma, self.k, self.b, self.lattice)
