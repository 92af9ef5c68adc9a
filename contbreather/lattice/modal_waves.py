"""Answers of modes to recurring impulses, as sums of waves.

What they are says `contbreather.lattice.response`. A mode ``z`` away from everything answers with
``Re A exp(l s)`` of both its roots l, with D their difference:

    ``A = +-1/(D (1 - e exp(l T)))``.

A mode that drifts, is critically damped or has an amplitude among the unknowns is the mean of such
waves over a circle around z, and so is the slope in z of any: the slope in the damping is the
velocity of that.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Array = NDArray[Any]

CLOSE = 0.05  # of the distance to the next harmonic, z from 0 or from critical damping
RADIUS = 0.1  # of that distance: 16 places on the circle are exact to 0.1^16
PLACES = np.exp(1j * math.pi * (np.arange(8) + 0.5) / 8.0)  # with their conjugates all 16


class ModeWaves(NamedTuple):
    """Sums of ``Re A exp(l s)``, mode after mode, and a constant for every mode."""

    rates: Array
    sizes: Array
    modes: NDArray[np.int64]  # whose each is
    level: FloatArray


def mode_waves(
    z: FloatArray, swings: FloatArray, apart: FloatArray, damping: float, length: float, sign: int,
    *, slopes: bool,
) -> ModeWaves:  # fmt: skip
    """Waves of modes with the harmonics `swings` taken out, 0 of most, and so far apart from all
    others; or their slopes in z."""
    critical, near = 0.25 * damping * damping, CLOSE * apart
    slow = slopes | (abs(z - critical) < near) | (swings > 0.0) | ((sign > 0) & (abs(z) < near))
    plain, circled = np.flatnonzero(~slow), np.flatnonzero(slow)
    step = RADIUS * apart[circled, None] * PLACES
    around, mean = z[circled, None] + step, 0.125 / (step if slopes else np.ones_like(step))
    modes = np.append(plain, np.repeat(circled, PLACES.size))
    place, shares = np.append(z[plain], around), np.append(np.ones(plain.size), mean)
    root = np.sqrt(place - critical)
    rates = np.stack([1j * root, -1j * root]) - 0.5 * damping
    sizes = shares / np.stack([2j * root, -2j * root]) * all_laps(rates * length, sign)
    # of a mode that swings both waves are one, and its conjugate
    both = (np.arange(place.size) < plain.size) & (place.real > critical)
    sizes[0, both] *= 2.0
    kept = np.stack([both | True, ~both])
    level = np.zeros(z.size)
    if sign > 0:
        level -= np.bincount(modes, (shares / place).real / length, z.size)
    moved = swings[circled] > 0.0
    w = swings[circled[moved]]
    turned = np.stack([1j * w, -1j * w])
    gaps = around[moved] - (w * w - turned * damping)[..., None]
    taken = -(mean[moved] / (length * gaps)).sum(axis=-1)  # out of these, their harmonic
    whose = np.concatenate([np.stack([modes, modes])[kept], circled[moved], circled[moved]])
    order = np.argsort(whose, kind="stable")
    waves = np.append(rates[kept], turned), np.append(sizes[kept], taken)
    return ModeWaves(waves[0][order], waves[1][order], whose[order], level)


def all_laps(turn: Array, sign: int) -> Array:
    """Sum of an impulse and all before it, by the exponent of a wave over a section."""
    return 1.0 / (1.0 + np.exp(turn) if sign < 0 else -np.expm1(turn))


def harmonics(turns: int, sign: int) -> tuple[float, float]:
    """The lowest harmonic of an orbit besides 0, and the distance between two."""
    return (1.0 / turns,) * 2 if sign > 0 else (1.0 / turns, 2.0 / turns)


def harmonic_gap(
    z: FloatArray, swings: FloatArray, damping: float, turns: int, sign: int
) -> FloatArray:
    """Distance of z from the harmonics of the orbit; that of 0 is taken out, and so is a swing."""
    first, step = harmonics(turns, sign)
    near = np.maximum(0.0, np.floor((np.sqrt(abs(z)) - first) / step + 0.5))
    w = first + step * (near[:, None] + np.array([-1.0, 0.0, 1.0]))
    taken = (swings[:, None] > 0.0) & (abs(w - swings[:, None]) < 0.25 * step)
    off = np.hypot(z[:, None] - w * w, damping * w)
    return np.asarray(np.where((w < 0.5 * first) | taken, math.inf, off).min(axis=1))
