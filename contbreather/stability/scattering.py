"""Waves of the band that a breather sends back larger than they came: what long rings feel of it.

A small wave of the angle nu meets the impacting site, which multiplies its even part by
``S = (D continued from inside the circle)/(D from outside)``. With the letters of
`contbreather.stability.one_impact`

    |S|^2 - 1 = -(8 c d nu/(pi v)) W/|D|^2,   W = (R/nu + B)(c^2 nu R + beta) + d^2,

so more comes back than went in exactly where W < 0: a test without roots or logarithms, and no
ring of any size is unstable where W >= 0 on the whole band. k = 1 (d = 0) gives |S| = 1. A
Neimark-Sacker point is a pole of S. A packet of waves runs round a ring of N sites with the group
velocity ``v_g = v/(2 nu)`` and meets the site every ``N/v_g``, so that
``N (|mu| - 1) -> pi v_g ln|S|`` on long rings.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from contbreather.stability.band_pairs import GRID, smooth_and_L
from contbreather.stability.one_impact import HalfMap, alias_sums
from contbreather.stability.zeros import highest
from contbreather.tables import Column, HtmlRepr, Sheet

Array = NDArray[Any]


@dataclass(frozen=True)
class OverReflection(HtmlRepr):
    """Amplification by the breather of waves of the band of the infinite chain.

    ``gain = max ln|S|`` at the angle ``nu`` (times pi), both 0 if nothing is amplified;
    ``growth = max pi v_g ln|S|`` at ``growth_nu``: on long rings the band's multipliers of QS reach
    ``|mu| = 1 + growth/N``.
    """

    over_reflecting: bool
    gain: float = 0.0
    nu: float = 0.0
    growth: float = 0.0
    growth_nu: float = 0.0

    def table(self) -> Sheet:
        """The gain and the growth, and at which angles they are reached."""
        return Sheet(
            [
                Column("", ["gain", "growth"]),
                Column("largest", [self.gain, self.growth]),
                Column("at nu", [self.nu, self.growth_nu]),
            ],
            title="Waves come back amplified" if self.over_reflecting else "No wave is amplified",
        )


class Waves(NamedTuple):
    """Waves of the infinite chain that meet a symmetric breather, at angles of the band."""

    nu: Array
    W: Array  # negative where more comes back than went in; down to alpha = 0, the limit there
    gain: Array  # ln|S|, exact also where |S| is near 1
    growth: Array  # pi v_g ln|S|


def waves(map: HalfMap, alpha: Array) -> Waves:
    """Evaluate what comes back at ``nu^2 = spring + 4 gamma sin(alpha)^2``, ``alpha = theta/2``."""
    gamma, k, b, spring = map.gamma, map.k, map.b, map.lattice.spring
    sine, cosine = np.sin(alpha), np.cos(alpha)
    nu = 2.0 * math.sqrt(gamma) * sine
    if spring:
        nu = np.sqrt(spring + nu * nu)
    # v^2 = (nu^2 - spring)(spring + 4 gamma - nu^2), without a difference
    v = 4.0 * gamma * sine * cosine
    R, B, C, by_nu = alias_sums(gamma, nu, spring)
    c, d = 1.0 + k, 0.5 * (1.0 - k)
    with np.errstate(divide="ignore", invalid="ignore"):
        steep = np.where(nu > 0.0, R / nu, by_nu)
        speed = 0.5 * v / nu if spring else math.sqrt(gamma) * cosine
    W = (steep + B) * (c * c * nu * R + b - c * c * C) + d * d
    smooth, L = smooth_and_L(nu, k, b, (R, B, C))
    # at a Neimark-Sacker point S has a pole; its size is then that of rounding
    F = np.maximum(np.abs(v * smooth - 1j / math.pi * L), 1e-15 * (1.0 + abs(b)))
    excess = -4.0 * (1.0 - k * k) / math.pi * v * nu * W
    gain = 0.5 * np.log1p(np.maximum(excess / F**2, -1.0))
    return Waves(nu, W, gain, math.pi * speed * gain)


def over_reflects(map: HalfMap) -> bool:
    """Test whether some wave comes back larger than it went in: W < 0 on the band."""
    if map.gamma == 0.0 or map.k == 1.0:  # no waves; nothing lost and nothing won
        return False
    lowest = waves(map, np.linspace(0.0, 0.5 * math.pi, GRID + 1)).W.min()
    return bool(lowest < -1e-13 * (1.0 + abs(map.b)))  # more than rounding of its terms


def over_reflection(map: HalfMap) -> OverReflection:
    """The largest amplification of a wave by the breather, and the growth of long rings it causes.

    If not ``over_reflecting``, no ring of any size is unstable through its band.
    """
    if not over_reflects(map):
        return OverReflection(False)
    (gain, at), (growth, where) = _largest(map, "gain"), _largest(map, "growth")
    if gain <= 0.0:  # amplified, but by less than rounding shows
        return OverReflection(True)
    first, second = waves(map, np.array([at, where])).nu.tolist()
    return OverReflection(True, gain, first, growth, second)


def _largest(map: HalfMap, name: str) -> tuple[float, float]:
    """The largest value of a column of `Waves`, and where: between the samples next to its highest
    peaks, of which there is one beside each Neimark-Sacker point."""

    def f(alpha: Array) -> Array:
        return np.asarray(getattr(waves(map, alpha), name))

    gamma, spring, ends = map.gamma, map.lattice.spring, map.window
    x = np.linspace(0.0, 0.5 * math.pi, GRID + 1)
    sines = np.array([max(nu * nu - spring, 0.0) / (4.0 * gamma) for nu in (ends.low, ends.high)])
    x = np.unique(np.append(x, np.arcsin(np.sqrt(np.minimum(sines, 1.0)))))
    values = f(x)
    padded = np.concatenate([[-math.inf], values, [-math.inf]])
    peaks = np.flatnonzero((values >= padded[:-2]) & (values > padded[2:]) & (values > 0.0))
    best = (0.0, 0.0)
    for i in peaks[np.argsort(-values[peaks])[:3]].tolist():  # looked at closely
        low, high = x[max(i - 1, 0)], x[min(i + 1, x.size - 1)]
        place, height = highest(f, low, high)
        best = max(best, (float(values[i]), float(x[i])), (height, place))
    return best
