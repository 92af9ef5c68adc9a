"""The map QS of a symmetric breather over half its period, on the infinite chain or a ring."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contbreather.lattice.modes import InfiniteChain, Lattice, Ring
from contbreather.stability.characteristic import sites_of
from contbreather.stability.half_map import even_multipliers
from contbreather.stability.isolated import unstable_multipliers
from contbreather.stability.scattering import OverReflection, over_reflection, over_reflects
from contbreather.stability.winding import Count, unstable_count

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
    lattice: Lattice = InfiniteChain()

    def __post_init__(self) -> None:
        sites_of(self.lattice)

    @property
    def period(self) -> float:
        """Of the orbit, two half maps."""
        return 2.0 * math.pi

    def count(self) -> Count:
        """Multipliers outside the unit circle of the infinite chain."""
        return unstable_count(self.gamma, self.k, self.b, self.lattice)

    def unstable_multipliers(self) -> Array:
        """The same, one by one."""
        return unstable_multipliers(self.gamma, self.k, self.b, self.lattice)

    @cached_property
    def over_period(self) -> Array:
        """On a ring: the squares of the multipliers of the modes that the impact sees."""
        ring = Ring(self.lattice.sites)  # type: ignore[arg-type]
        return np.asarray(even_multipliers(ring, self.gamma, self.k, self.b) ** 2)

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
