"""The map QS of a symmetric breather over half its period, on the infinite chain or a ring."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from contbreather.errors import BadInput
from contbreather.lattice.chain import InfiniteChain, Ring
from contbreather.stability.arc import (
    OverReflection,
    ends_of,
    on_arc,
    over_reflection,
    over_reflects,
    window,
)
from contbreather.stability.characteristic import D, D_gradient, Gradient
from contbreather.stability.counting import (
    Count,
    check_radius,
    closest_approach,
    count_on_chain,
    unstable_count,
    unstable_multipliers,
)
from contbreather.stability.ring_multipliers import even_multipliers, half_multipliers
from contbreather.stability.saltation import check_lattice
from contbreather.stability.zeros import farthest, outermost

Array = NDArray[Any]

_ROUNDED = 1e-13  # of the entry b and 1: what is left of a difference that is zero


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
    sign: ClassVar[int] = -1

    def __post_init__(self) -> None:
        check_lattice(self.lattice)

    @property
    def period(self) -> float:
        """Of the orbit, two half maps."""
        return 2.0 * math.pi

    def on(self, lattice: Any) -> HalfMap:
        """That of the same breather as one of another lattice."""
        if lattice.sites is None:
            return self if self.lattice.sites is None else replace(self, lattice=lattice)
        if self.lattice.spring:
            raise BadInput(
                f"on = Ring({lattice.sites}): with springs the multipliers on a ring are those "
                f"of the ring's own orbit; trace breather.on(Ring({lattice.sites})) instead."
            )
        return replace(self, lattice=lattice)

    def crosses(self, mu: float) -> float:
        """D at mu = 1, without the pole that it has there where no spring holds the sites, or at
        mu = -1: a multiple of the scalar of the pitchfork, of that of the fold."""
        beta0, _, fold, _ = self._ends
        return fold if mu < 0.0 else -beta0

    @cached_property
    def _ends(self) -> tuple[float, ...]:
        return ends_of(self.gamma, self.k, self.b, self.lattice)

    def beyond(self, place: float) -> int:
        """How many real multipliers are farther out than 1 or -1, on its side: one or none."""
        return 1 * (self.crosses(place) < 0.0)

    def pairs(self, radius: float = 1.0) -> tuple[float, int]:
        """On the infinite chain by the window of b in which a pair is outside: how far b is from
        it, and how many of both ends are below b; two that are passed in one step are seen. At
        k = 1 it has an end where the pitchfork is: on a curve of pitchforks that is rounding."""
        if self.lattice.sites is not None:
            return -outermost(self.coupled, radius), 0
        ends = window(self.gamma, self.k, self.lattice.spring)
        off = ends.miss(self.b)
        if self.k == 1.0:
            off = off * (abs(off) > _ROUNDED * (1.0 + abs(self.b)))
        return off, ends.passed(self.b)

    def nearest(self) -> float:
        """Angle, over pi, of the pair that is closest to leaving: on the infinite chain at the
        nearer end of the window; NaN where there is no pair."""
        if self.lattice.sites is not None:
            return farthest(self.coupled)
        ends = window(self.gamma, self.k, self.lattice.spring)
        angle = ends.low if self.b < ends.centre else ends.high
        return angle or closest_approach(self.gamma, self.k, self.b, self.lattice.spring).nu

    def on_circle(self, angle: float, radius: float = 1.0) -> complex:
        """D at ``radius exp(i pi angle)``; on the band of the infinite chain F of `on_arc`; of real
        ones the scalar."""
        if radius == 1.0 and angle in (0.0, 1.0):
            return self.crosses(1.0 - 2.0 * angle)
        if self.lattice.sites is None and radius == 1.0:
            real, imag = on_arc(self.gamma, angle, self.k, self.b, self.lattice.spring).value
            return complex(real, imag)
        return complex(D(self.gamma, _depth(angle, radius), self.k, self.b, self.lattice))

    def gradient(self, angle: float, radius: float = 1.0) -> Gradient:
        """`on_circle` of a complex multiplier, with its derivatives in the angle and in gamma, k, b
        and the spring."""
        if self.lattice.sites is not None:
            on = self.gamma, _depth(angle, radius), self.k, self.b, self.lattice
            return D_gradient(*on)
        arc = on_arc(self.gamma, angle, self.k, self.b, self.lattice.spring)
        return Gradient(*(np.array(complex(*parts)) for parts in arc))

    def unstable(self, threshold: float) -> int:
        """How many multipliers are outside: isolated ones on the infinite chain, of a ring those
        beyond a threshold over the period."""
        if self.lattice.sites is None:
            return count_on_chain(self.gamma, self.k, self.b, self.lattice)
        check_radius(math.sqrt(threshold), self.lattice.sites)
        return int(np.count_nonzero(np.abs(self.over_period) > threshold))

    def count(self) -> Count:
        """Multipliers outside the unit circle of the infinite chain."""
        return unstable_count(self.gamma, self.k, self.b, self.lattice)

    def unstable_multipliers(self) -> Array:
        """The same, one by one."""
        return unstable_multipliers(self.gamma, self.k, self.b, self.lattice)

    @property
    def over_period(self) -> Array:
        """On a ring: the squares of the multipliers of the modes that the impact sees."""
        return self.coupled**2  # the monodromy matrix is (QS)^2, eq. (20)

    @cached_property
    def coupled(self) -> Array:
        """On a ring: those of QS of the modes that the impact sees."""
        ring = Ring(self.lattice.sites)
        return even_multipliers(ring, self.gamma, self.k, self.b)

    def multipliers(self) -> Array:
        """On a ring: those of QS, all of them."""
        return half_multipliers(Ring(self.lattice.sites), self.gamma, self.k, self.b)

    @property
    def idle(self) -> float:
        """Largest modulus of the multipliers of all other modes of a ring, 0 if there are none."""
        # odd modes: exp(+-i pi w) exactly, on the circle; rings of 1 and 2 sites have none
        return float((self.lattice.sites or 0) > 2)

    def over_reflection(self) -> OverReflection:
        """How much waves of the infinite chain come back amplified."""
        return over_reflection(self.gamma, self.k, self.b, self.lattice.spring)

    def over_reflects(self) -> bool:
        """Whether they do."""
        return over_reflects(self.gamma, self.k, self.b, self.lattice.spring)


def _depth(angle: float, radius: float) -> complex:
    """nu with ``exp(i pi nu) = radius exp(i pi angle)``."""
    return angle - 1j * math.log(radius) / math.pi
