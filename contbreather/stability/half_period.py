"""The map QS of a symmetric breather over half its period, on the infinite chain or a ring."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from numpy.typing import NDArray

from contbreather.lattice import InfiniteChain, Ring
from contbreather.stability.arc import on_arc, window
from contbreather.stability.characteristic import D, checked
from contbreather.stability.half_map import even_multipliers, half_multipliers
from contbreather.stability.isolated import unstable_multipliers
from contbreather.stability.scattering import OverReflection, over_reflection, over_reflects
from contbreather.stability.winding import Count, ends_of, unstable_count

Array = NDArray[Any]


@dataclass(frozen=True)
class HalfMap:
    """Small perturbations over half a period: one impact and one flight.

    Attributes
    ----------
    gamma, k, b : float
        Coupling, restitution, off-diagonal entry of the saltation matrix (19).
    lattice : InfiniteChain or Ring
    """

    gamma: float
    k: float
    b: float
    lattice: Any = InfiniteChain()

    def __post_init__(self) -> None:
        checked(0.0, self.lattice)

    @property
    def period(self) -> float:
        """Of the orbit, two half maps."""
        return 2.0 * math.pi

    def crosses(self, mu: float) -> float:
        """D at mu = 1, without the pole that it has there where no spring holds the sites, or at
        mu = -1: a multiple of the scalar of the pitchfork, of that of the fold."""
        beta0, _, fold, _ = ends_of(self.gamma, self.k, self.b, self.lattice)
        return fold if mu < 0.0 else -beta0

    def beyond(self, place: float) -> int:
        """How many real multipliers are farther out than 1 or -1, on its side: one or none."""
        return int(self.crosses(place) < 0.0)

    def pairs(self) -> tuple[float, int]:
        """On the infinite chain, by the window of b in which a pair is outside."""
        own = window(self.gamma, self.k, self.lattice.spring)
        return own.miss(self.b), own.passed(self.b)

    def on_circle(self, angle: float, radius: float = 1.0) -> complex:
        """D at ``radius exp(i pi angle)``; on the band of the infinite chain F of `on_arc`."""
        if self.lattice.sites is None and radius == 1.0:
            real, imag = on_arc(self.gamma, angle, self.k, self.b, self.lattice.spring).value
            return complex(real, imag)
        nu = angle - 1j * math.log(radius) / math.pi
        return complex(D(self.gamma, nu, self.k, self.b, self.lattice))

    def count(self) -> Count:
        """Multipliers outside the unit circle of the infinite chain."""
        return unstable_count(self.gamma, self.k, self.b, self.lattice)

    def unstable_multipliers(self) -> Array:
        """The same, one by one."""
        return unstable_multipliers(self.gamma, self.k, self.b, self.lattice)

    @property
    def over_period(self) -> Array:
        """On a ring: the squares of the multipliers of the modes that the impact sees."""
        return self.half**2

    @cached_property
    def half(self) -> Array:
        """On a ring: those of QS of the modes that the impact sees."""
        ring = Ring(self.lattice.sites)
        return even_multipliers(ring, self.gamma, self.k, self.b)

    def multipliers(self) -> Array:
        """On a ring: those of QS, all of them."""
        return half_multipliers(Ring(self.lattice.sites), self.gamma, self.k, self.b)

    @property
    def idle(self) -> float:
        """Largest modulus of the multipliers of all other modes of a ring, 0 if there are none."""
        return float((self.lattice.sites or 0) > 2)

    def over_reflection(self) -> OverReflection:
        """How much waves of the infinite chain come back amplified."""
        return over_reflection(self.gamma, self.k, self.b, self.lattice.spring)

    def over_reflects(self) -> bool:
        """Whether they do."""
        return over_reflects(self.gamma, self.k, self.b, self.lattice.spring)
