"""Verdicts: each names the chain it is about, and the threshold where there is one.

The infinite chain has a sharp answer, the number of isolated multipliers of QS outside the unit
circle. A ring has none: waves that come back amplified put its band at ``|mu| - 1 = O(1/N)``, so
the paper's rule compares the largest multiplier with a threshold. Its "eigenvalues of the monodromy
matrix ... crossed a threshold of 1.005" are those of (QS)^2, eq. (20): read so, the
Neimark-Sacker line at a = 0.2, k = 0.8 is at gamma = 0.0824, 0.0916, 0.0969 for N = 200, 400, 800.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contbreather.checks import real
from contbreather.errors import BadInput
from contbreather.lattice.modes import InfiniteChain, Ring
from contbreather.stability.characteristic import sites_of
from contbreather.stability.half_map import even_multipliers
from contbreather.stability.isolated import unstable_multipliers
from contbreather.stability.scattering import OverReflection, over_reflection, over_reflects
from contbreather.stability.winding import RIM, unstable_count

Array = NDArray[Any]

THRESHOLD = 1.005  # the paper's, for multipliers over the full period 2 pi


@dataclass(frozen=True, repr=False)
class ChainVerdict:
    """Stability in the infinite chain.

    ``unstable`` counts the multipliers of QS strictly outside the unit circle, a pair as two. Where
    not ``certain``, one of them sits on the circle to within rounding, at ``exp(i pi nu)``, or
    gamma is within rounding of 1/4.
    """

    gamma: float
    k: float
    b: float
    unstable: int
    certain: bool
    nu: float

    @property
    def stable(self) -> bool:
        return self.unstable == 0

    @cached_property
    def over_reflecting(self) -> bool:
        """Whether waves come back amplified: if so, long enough rings are weakly unstable."""
        return over_reflects(self.gamma, self.k, self.b)

    @cached_property
    def over_reflection(self) -> OverReflection:
        """By how much, and at which angle."""
        return over_reflection(self.gamma, self.k, self.b)

    @cached_property
    def multipliers(self) -> Array:
        """The isolated multipliers of QS outside the unit circle themselves."""
        return unstable_multipliers(self.gamma, self.k, self.b)

    def describe(self) -> str:
        """The verdict as a sentence."""
        if self.unstable == 0:
            text = "infinite chain: stable, no multiplier of QS outside the unit circle"
        else:
            plural = "" if self.unstable == 1 else "s"
            text = f"infinite chain: unstable, {self.unstable} multiplier{plural} of QS outside "
            text += "the unit circle"
        if not self.certain and 0.25 - self.gamma <= RIM:
            text += "; uncertain, the band's edge is within rounding of mu = -1"
        elif not self.certain:
            text += f"; one on it to within rounding, at the angle {self.nu:.6g} pi"
        if self.over_reflecting:
            text += "; reflects waves amplified, so long rings are weakly unstable"
        return text

    def __repr__(self) -> str:
        return f"<{self.describe()}>"


@dataclass(frozen=True, repr=False)
class RingVerdict:
    """Stability on a ring by the paper's rule: multipliers over 2 pi beyond a threshold.

    ``largest`` is the largest modulus of all 2 N multipliers of (QS)^2, ``unstable`` how many
    exceed ``threshold``.
    """

    gamma: float
    k: float
    b: float
    sites: int
    threshold: float
    largest: float
    unstable: int

    @property
    def stable(self) -> bool:
        return self.unstable == 0

    @cached_property
    def multipliers(self) -> Array:
        """The multipliers over 2 pi beyond the threshold, largest first."""
        full = even_multipliers(Ring(self.sites), self.gamma, self.k, self.b) ** 2
        full = full[np.abs(full) > self.threshold]
        return full[np.argsort(-np.abs(full), kind="stable")]

    def describe(self) -> str:
        """The verdict as a sentence."""
        plural = "" if self.unstable == 1 else "s"
        word = "stable" if self.stable else f"unstable, {self.unstable} multiplier{plural}"
        sign = "<=" if self.stable else ">"
        return (
            f"ring of {self.sites} sites: {word}; largest |multiplier| over 2 pi "
            f"{self.largest:.9g} {sign} threshold {self.threshold:g}"
        )

    def __repr__(self) -> str:
        return f"<{self.describe()}>"


def stability(
    gamma: float,
    k: float,
    b: float,
    lattice: object = InfiniteChain(),
    *,
    sites: int | None = None,
    threshold: float = THRESHOLD,
) -> ChainVerdict | RingVerdict:
    """Is a breather with this saltation stable, in the infinite chain or on a ring?

    Parameters
    ----------
    gamma, k, b : float
        Coupling, restitution, off-diagonal entry of the saltation matrix (19).
    lattice : InfiniteChain or Ring
    sites : int, optional
        Short for ``lattice=Ring(sites)``.
    threshold : float
        On a ring: unstable if a multiplier over 2 pi exceeds it in modulus.

    Returns
    -------
    ChainVerdict or RingVerdict

    Raises
    ------
    BadInput
        For parameters out of range, or a threshold not above 1.

    Examples
    --------
    >>> stability(0.11, 0.8, -0.28657)
    <infinite chain: unstable, 2 multipliers of QS outside the unit circle; reflects waves \
amplified, so long rings are weakly unstable>
    >>> stability(0.05, 0.8, 0.2, sites=400)
    <ring of 400 sites: stable; largest |multiplier| over 2 pi 1.00035565 <= threshold 1.005>
    """
    if sites is not None:
        lattice = Ring(sites)
    size = sites_of(lattice)
    if size is None:
        count = unstable_count(gamma, k, b)
        return ChainVerdict(float(gamma), float(k), float(b), count.count, count.certain, count.nu)
    if not 1.0 < real(threshold) < math.inf:
        raise BadInput(
            f"threshold = {threshold!r}: a ring always has multipliers on the unit circle, so a "
            "threshold must be above 1 (the paper takes 1.005)."
        )
    ring = Ring(size)
    full = np.abs(even_multipliers(ring, gamma, k, b)) ** 2
    top = float(full.max()) if size < 3 else max(1.0, float(full.max()))
    return RingVerdict(
        float(gamma),
        float(k),
        float(b),
        size,
        float(threshold),
        top,
        int(np.sum(full > threshold)),
    )
