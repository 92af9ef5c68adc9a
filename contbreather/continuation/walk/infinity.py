"""Infinity: where a curve grows without end.

Where a curve runs to infinity z grows and grows, and parameters tend to limits meanwhile. No single
step tells: z has to become several times as long. What is asked of a parameter is relative to the
largest that it was, so that its unit does not matter:

- all of them stay, whatever the limit, as next to a homoclinic orbit while the period grows;
- or one vanishes while others go on, as on curves of folds along which u grows as eps^-2 and lam
  falls as exp(-1/eps). It falls as a power of z may, and does not pass zero, which is much steeper.

A window of what grows, or one of what vanishes that ends short of zero, says how far to go instead.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..algebra.newton import Array
from ..curve.branch import Points
from ..curve.curve import Curve
from ..curve.point import MANY
from .window import Bound

ENDLESS = 3.0  # z has grown when it is so many times as long, relative to 1 + |z|
STILL = 1e-6  # what moves less meanwhile, relative to its largest, stays; what is less has vanished
SMALL = 1e-3  # if it was no more than this all the while
POWER = 50.0  # power of |z| with which nothing vanishes: e^-x falls as x^-33 where a curve ends
SHARE = 0.1  # the power of |z| from which on something grows with it
STRAIGHT = 0.9  # cosine between z and the tangent where a curve leads away from the origin


@dataclass
class Tendency:
    """Course of a parameter while z grows."""

    name: str
    slot: int  # in z
    largest: float  # size it had
    reaches: bool  # its window has zero in it
    moved: float = math.nan  # value where it last moved
    since: float = math.inf  # 1 + |z| there
    small: float = math.inf  # 1 + |z| from where on it has been small; infinite where it is not

    def passes(self, value: float, slope: float, size: float) -> bool:
        """The next value, its derivative along the curve, and the length of z there; whether it
        tends to zero: with ``d log|value| / d log|z|`` between -POWER and 0."""
        self.largest = max(self.largest, abs(value))
        # what its moves are compared with: where zero is not to be reached, its own size
        if not abs(value - self.moved) <= STILL * (self.largest if self.reaches else abs(value)):
            self.moved, self.since = value, 1.0 + size
        small = abs(value) <= SMALL * self.largest
        self.small = min(self.small, 1.0 + size) if small else math.inf
        less = abs(value) <= STILL * self.largest and size > ENDLESS * self.small
        falls = 0.0 < -slope * math.copysign(size, value) < POWER * abs(value)
        return self.reaches and less and falls

    def moves_on(self, values: Array, sizes: Array) -> bool:
        """Take several values at once, if each is another than the one before and none is small."""
        largest = max(self.largest, float(abs(values).max()))
        unit = largest if self.reaches else abs(values)
        moves = abs(np.diff(values, prepend=self.moved)) > STILL * unit
        if not (moves & (abs(values) > SMALL * largest)).all():
            return False
        self.largest, self.small = largest, math.inf
        self.moved, self.since = float(values[-1]), 1.0 + float(sizes[-1])
        return True


class Growth:
    """Growth of z along a walk."""

    def __init__(self, curve: Curve, bounds: Sequence[Bound], start: Array) -> None:
        self.curve, self.first = curve, 1.0 + curve.length(start)
        self.bounds, self.tendencies = bounds, list[Tendency]()
        for name in curve.varied:
            slot = curve.slots[name]
            reaches = all(b.low <= 0.0 <= b.high for b in bounds if b.name == name)
            self.tendencies.append(Tendency(name, slot, abs(float(start[slot])), reaches))

    def end(self, points: Points) -> tuple[int, str] | None:
        """The first of several points beyond which nothing is to come, and what z tends to."""
        if len(points) >= MANY:
            sizes = np.sqrt(points.z**2 @ self.curve.metric)
            if all(param.moves_on(points.z[:, param.slot], sizes) for param in self.tendencies):
                return None
        for i, at in enumerate(zip(points.z, points.tangent, strict=True)):
            if limit := self._tends_to(*at):
                return i, limit
        return None

    def _tends_to(self, z: Array, tangent: Array) -> str:
        """Name the limits where nothing is to come beyond; empty where something is."""
        size, gone, since = self.curve.length(z), [], 0.0
        for param in self.tendencies:
            value = float(z[param.slot])
            if param.passes(value, float(tangent[param.slot]), size):
                gone.append(f"{param.name} vanishes, {value:.3g} of at most {param.largest:.3g}")
            since = max(since, param.since)
        if not (gone or size > ENDLESS * since) or self._bounded(z, tangent, size):
            return ""
        limits = [f"{param.name} tends to {z[param.slot]:.6g}" for param in self.tendencies]
        grows = self._growing(z) or "the solution"
        return f"{grows} grows without bound while {', '.join(gone or limits)}"

    def towards(self, z: Array, tangent: Array) -> str:
        """Say what grows where a walk took as many steps as allowed; empty if nothing does."""
        size, along = self.curve.length(z), z * self.curve.metric @ tangent
        outwards = along > STRAIGHT * size > STRAIGHT * ENDLESS * self.first
        if not outwards or self._bounded(z, tangent, size):
            return ""
        grows = self._growing(z)
        window = grows or self.tendencies[-1].name  # of the solution a parameter tells how far
        return (
            f"{grows or 'the solution'} grows, and no window ends it; give one, "
            f"within={{{window!r}: (low, high)}}"
        )

    def _growing(self, z: Array) -> str:
        slots = self.curve.slots.items()
        parts = {n: float(np.dot(z[at] ** 2, self.curve.metric[at])) for n, at in slots}
        most = max(parts, key=lambda name: parts[name])
        return "" if most in self.curve.problem.internals else most

    def _bounded(self, z: Array, tangent: Array, size: float) -> bool:
        """Tell whether a window says how far something may go that grows with z."""
        for bound in self.bounds:
            value, rate = bound.value(z), float(bound.row(z) @ tangent)
            if rate * size > SHARE * value >= 0.0 and math.isfinite(bound.high):
                return True
            if rate * size < SHARE * value <= 0.0 and math.isfinite(bound.low):
                return True
        return False
