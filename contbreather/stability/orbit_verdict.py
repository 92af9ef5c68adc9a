"""Verdicts on orbits with any number of impacts: each names its chain, and a threshold if any."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contbreather.errors import BadInput
from contbreather.stability.orbit import OrbitMap
from contbreather.stability.verdict import THRESHOLD

Array = NDArray[Any]


@dataclass(frozen=True, repr=False)
class OrbitChainVerdict:
    """Stability of an orbit in the infinite chain.

    ``unstable`` counts the multipliers over the orbit's period strictly outside the unit circle, a
    pair as two. Where not ``certain``, one of them sits on the circle to within rounding, at
    ``exp(i pi nu)``.
    """

    map: OrbitMap
    unstable: int
    certain: bool
    nu: float

    @property
    def stable(self) -> bool:
        return self.unstable == 0

    @cached_property
    def multipliers(self) -> Array:
        """The multipliers outside the unit circle themselves, the largest first."""
        return self.map.unstable_multipliers()

    def describe(self) -> str:
        """The verdict as a sentence."""
        plural = "" if self.unstable == 1 else "s"
        word = "stable, no" if self.stable else f"unstable, {self.unstable}"
        text = f"infinite chain: {word} multiplier{plural} of the orbit outside the unit circle"
        if not self.certain:
            text += f"; one on it to within rounding, at the angle {self.nu:.6g} pi"
        return text

    def __repr__(self) -> str:
        return f"<{self.describe()}>"


@dataclass(frozen=True, repr=False)
class OrbitRingVerdict:
    """Stability of an orbit on a ring: multipliers over its period beyond a threshold.

    ``largest`` is the largest modulus of all 2 N multipliers, ``unstable`` how many exceed
    ``threshold``.
    """

    map: OrbitMap
    sites: int
    threshold: float
    largest: float
    unstable: int

    @property
    def stable(self) -> bool:
        return self.unstable == 0

    @cached_property
    def multipliers(self) -> Array:
        """The multipliers beyond the threshold, largest first."""
        mu = self.map.coupled_multipliers()
        mu = mu[np.abs(mu) > self.threshold]
        return mu[np.argsort(-np.abs(mu), kind="stable")]

    def describe(self) -> str:
        """The verdict as a sentence."""
        plural = "" if self.unstable == 1 else "s"
        word = "stable" if self.stable else f"unstable, {self.unstable} multiplier{plural}"
        sign = "<=" if self.stable else ">"
        return (
            f"ring of {self.sites} sites: {word}; largest |multiplier| over the orbit's period "
            f"{self.largest:.9g} {sign} threshold {self.threshold:g}"
        )

    def __repr__(self) -> str:
        return f"<{self.describe()}>"


def orbit_stability(
    map: OrbitMap, *, threshold: float = THRESHOLD
) -> OrbitChainVerdict | OrbitRingVerdict:
    """Is an orbit stable, on the lattice its map is of?

    Parameters
    ----------
    map : OrbitMap
    threshold : float
        On a ring: unstable if a multiplier over the orbit's period exceeds it in modulus.

    Raises
    ------
    BadInput
        On a ring, a threshold not above 1.

    Examples
    --------
    >>> orbit_stability(OrbitMap(0.04, 0.8, [(0, 0.0, 0.5), (0, 3.0, 0.5)]))
    <infinite chain: stable, no multipliers of the orbit outside the unit circle>
    """
    sites = map.lattice.sites
    if sites is None:
        count = map.count()
        return OrbitChainVerdict(map, count.count, count.certain, count.nu)
    if not 1.0 < threshold < math.inf:
        raise BadInput(
            f"threshold = {threshold}: a ring always has multipliers on the unit circle, so a "
            "threshold must be above 1 (the paper takes 1.005)."
        )
    size = np.abs(map.coupled_multipliers())
    top = float(size.max()) if sites < 3 else max(1.0, float(size.max()))
    return OrbitRingVerdict(map, sites, float(threshold), top, int(np.sum(size > threshold)))
