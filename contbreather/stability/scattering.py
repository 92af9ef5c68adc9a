"""Waves scattered by the breather: S on the band, and whether more comes back than went in.

A small wave of angle nu (mu = exp(i pi nu), 0 < nu < 2 sqrt(gamma)) meets the impacting site, which
multiplies its even part by ``S = (D continued from inside the circle)/(D from outside)``. With the
letters of `contbreather.stability.arc`,

    |S|^2 - 1 = -(8 c d nu/(pi v)) W/|D|^2,
    W = (R/nu + B)(c^2 nu R + beta) + d^2,   beta = b - c^2 C,

so more comes back than went in exactly where W < 0: a test without roots or logarithms, and no
ring of any size is unstable where W >= 0 on the whole band. k = 1 (d = 0) gives |S| = 1. A
Neimark-Sacker point is a pole of S. A packet of waves runs round a ring of N sites with
the group velocity ``v_g = sqrt(4 gamma - nu^2)/2`` and meets the site every ``N/v_g``, so that
``N (|mu| - 1) -> pi v_g ln|S|`` on long rings.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from contbreather.lattice import InfiniteChain, check_gamma
from contbreather.stability.arc import Arc, angle, curve, grid, on_band, sample
from contbreather.stability.counting import resolved_arc
from contbreather.stability.lattice_sums import slope_at_zero
from contbreather.stability.saltation import check_kb

Array = NDArray[Any]

ZOOMS = 4  # each narrows the bracket of a maximum four times
ROUNDING = 1e-13  # of ln|S|


@dataclass(frozen=True)
class OverReflection:
    """How much the breather amplifies waves of the band of the infinite chain.

    ``gain = max ln|S|`` at the angle ``nu`` (times pi), both 0 if nothing is amplified;
    ``growth = max pi v_g ln|S|`` at ``growth_nu``: on long rings the band's multipliers of QS reach
    ``|mu| = 1 + growth/N``.
    """

    over_reflecting: bool
    gain: float
    nu: float
    growth: float
    growth_nu: float


def _margin(arc: Arc, k: float, b: float) -> Array:
    """nu W: negative where more comes back than went in."""
    _, nu, _, R, B, C = arc
    c, d = 1.0 + k, 0.5 * (1.0 - k)
    return np.asarray((R + nu * B) * (c * c * nu * R + b - c * c * C) + nu * d * d)


def _log_gain(arc: Arc, k: float, b: float) -> Array:
    """ln|S| on the arc, exact also where |S| is near 1."""
    # at a Neimark-Sacker point S has a pole; its size is then that of rounding
    out = np.maximum(np.abs(curve(arc, k, b)[0]), 1e-15 * (1.0 + abs(b))) ** 2
    c, d = 1.0 + k, 0.5 * (1.0 - k)
    excess = -8.0 * c * d / math.pi * arc.v * _margin(arc, k, b)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(excess == 0.0, 0.0, excess / out)
    return np.asarray(0.5 * np.log1p(np.maximum(ratio, -1.0)))  # ln|S| = ln(1 + (|S|^2 - 1))/2


def scattering(gamma: float, nu: ArrayLike, k: float, b: float, spring: float = 0.0) -> Array:
    """S at the angles nu (times pi) of the band, 0 < nu < 2 sqrt(gamma): complex, an array for many
    angles. Parameters and errors as of `on_arc`.

    Examples
    --------
    >>> bool(abs(abs(scattering(0.1, 0.3, 1.0, 0.2)) - 1) < 1e-14)  # nothing is lost at k = 1
    True
    """
    gamma = check_gamma(gamma, spring)
    k, b = check_kb(k, b)
    low = on_band(gamma, nu, spring)[1]
    alpha = np.arcsin(np.sqrt(low / (4.0 * gamma)))
    out, into = curve(sample(gamma, alpha, spring), k, b)
    return np.asarray(into / out)


def over_reflects(gamma: float, k: float, b: float, spring: float = 0.0) -> bool:
    """Whether waves of some angle come back larger than they went in: W < 0 somewhere on the band.

    Examples
    --------
    >>> over_reflects(0.08, 0.8, 0.468), over_reflects(0.08, 1.0, 0.468)
    (True, False)
    """
    gamma = check_gamma(gamma, spring)
    k, b = check_kb(k, b)
    if gamma == 0.0 or k == 1.0:  # no waves; nothing lost and nothing won
        return False
    arc = grid(gamma, spring)
    lowest = float(np.min(_margin(arc, k, b)[1:] / arc.nu[1:]))
    if spring == 0.0:  # the limit nu -> 0, the minimum as a rule
        beta0 = b - 0.5 * (1.0 + k) ** 2 * InfiniteChain().psi(gamma)
        lowest = min(lowest, slope_at_zero(gamma) * beta0 + 0.25 * (1.0 - k) ** 2)
    return lowest < -ROUNDING * (1.0 + abs(b))


def _speed(gamma: float, arc: Arc, spring: float) -> Array:
    """The group velocity ``v/(2 nu)``."""
    return np.asarray(0.5 * arc.v / arc.nu if spring else math.sqrt(gamma) * np.cos(arc.alpha))


def _zoom(
    gamma: float, k: float, b: float, spring: float, left: Array, right: Array, growth: Array
) -> Array:
    """Maxima of ln|S| (or pi v_g ln|S| where ``growth``) in brackets: rows (value, alpha)."""
    ninths = np.linspace(0.0, 1.0, 9)
    rows = np.arange(left.size)
    for _ in range(ZOOMS):
        alpha = left[:, None] + (right - left)[:, None] * ninths
        arc = sample(gamma, alpha.ravel(), spring)
        values = _log_gain(arc, k, b).reshape(alpha.shape)
        weight = math.pi * _speed(gamma, arc, spring).reshape(alpha.shape)
        values = np.where(growth[:, None], weight * values, values)
        i = np.clip(values.argmax(axis=1), 1, 7)
        left, right = alpha[rows, i - 1], alpha[rows, i + 1]
    low, top, high = values[rows, i - 1], values[rows, i], values[rows, i + 1]
    # the vertex of the parabola through the last three samples
    bend = low - 2.0 * top + high
    with np.errstate(divide="ignore", invalid="ignore"):
        shift = np.where(bend < 0.0, 0.5 * (low - high) / bend, 0.0)
    shift = np.clip(shift, -1.0, 1.0)
    vertex = top - 0.25 * (low - high) * shift
    return np.stack([vertex, alpha[rows, i] + shift * (right - alpha[rows, i])])


def _brackets(values: Array) -> Array:
    """Nodes that are maxima, the best and those not far below it."""
    padded = np.concatenate([[-np.inf], values, [-np.inf]])
    peak = np.flatnonzero((values >= padded[:-2]) & (values > padded[2:]) & (values > 0.0))
    order = np.argsort(values[peak])[::-1][:3]
    return np.clip(peak[order], 1, values.size - 2)


def over_reflection(gamma: float, k: float, b: float, spring: float = 0.0) -> OverReflection:
    """The largest amplification of a wave by the breather, and the growth of long rings it causes.

    If not ``over_reflecting``, no ring of any size is unstable through its band. Parameters and
    errors as of `unstable_count`.

    Examples
    --------
    >>> worst = over_reflection(0.08, 0.8, 0.46823798739267164)  # a = 0.5
    >>> round(worst.gain, 4), round(worst.nu, 4), round(worst.growth, 4)
    (1.257, 0.3685, 0.8488)
    """
    if not over_reflects(gamma, k, b, spring):
        return OverReflection(False, 0.0, 0.0, 0.0, 0.0)
    arc, _, _ = resolved_arc(gamma, k, b, spring)
    gain = _log_gain(arc, k, b)
    gain_at = _brackets(gain)
    growth_at = _brackets(_speed(gamma, arc, spring) * gain)
    if gain_at.size == 0:  # amplified, but by less than rounding shows
        return OverReflection(True, 0.0, 0.0, 0.0, 0.0)
    i = np.concatenate([gain_at, growth_at])
    kind = np.repeat([False, True], [gain_at.size, growth_at.size])
    value, alpha = _zoom(gamma, k, b, spring, arc.alpha[i - 1], arc.alpha[i + 1], kind)
    nu = angle(gamma, alpha, spring)
    best = int(value[~kind].argmax())
    most = gain_at.size + int(value[kind].argmax())
    return OverReflection(
        True, float(value[best]), float(nu[best]), float(value[most]), float(nu[most])
    )
