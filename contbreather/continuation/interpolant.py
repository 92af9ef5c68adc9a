"""The curve between two neighbouring points of a walk."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property

import numpy as np

from .curve import LEVEL, Curve
from .newton import OUT_OF_DOMAIN, Array, Solution, Undefined, newton
from .point import Point

_BESIDE = 0.1  # how far off the cubic a point between may lie, relative to the step
_CLOSE = 1e-8  # neighbours closer than this, relative to 1 + |z|, have nothing between them


class StepInterpolant:
    """The curve between two neighbouring points of a walk: u = 0 at the first, 1 at the last."""

    def __init__(self, first: Point, last: Point, tolerance: float) -> None:
        self.curve: Curve = first.curve
        self.first, self.last = first, last
        self.length = last.arclength - first.arclength
        self.tolerance = tolerance
        self._known: dict[float, Point] = {0.0: first, 1.0: last}

    @cached_property
    def _row(self) -> Array:
        """The linear functional of ``z - z_first`` that is u on the chord and on its cubic."""
        chord = self.last.z - self.first.z
        dual = self.curve.metric * chord
        return np.asarray(dual / dual.dot(chord))

    @cached_property
    def _slopes(self) -> tuple[Array, Array]:
        # dz/du with row . dz/du = 1: on the cubic row . (z - z0) then has the values 0 and 1 and
        # the slope 1 at both ends, and is u all along
        first, last = self.first.direction, self.last.direction
        return first / self._row.dot(first), last / self._row.dot(last)

    def guess(self, u: float) -> tuple[Array, Array]:
        """Position and unit tangent on the cubic through both ends."""
        z0, z1 = self.first.z, self.last.z
        d0, d1 = self._slopes
        v = 1 - u
        # the Hermite basis v^2 (1 + 2u), u v^2, u^2 (1 + 2v), -u^2 v with v = 1 - u
        z = v * v * (1 + 2 * u) * z0 + u * v * v * d0 + u * u * (1 + 2 * v) * z1 - u * u * v * d1
        slope = 6 * u * v * (z1 - z0) + v * (1 - 3 * u) * d0 + u * (3 * u - 2) * d1
        return z, self.curve.normalised(slope)

    def provisional(self, u: float) -> Point:
        """The point on the cubic, not corrected: close enough to see the sign of a test."""
        if u in self._known:
            return self._known[u]
        z, tangent = self.guess(u)
        return self._point(u, z, tangent, math.nan)

    def at(self, u: float) -> Point:
        """The point of the curve at u, solved for across the chord."""
        if u in self._known:
            return self._known[u]
        curve, compiled, (guess, slope) = self.curve, self.curve.compiled, self.guess(u)
        chord, how = self.last.z - self.first.z, (slope, self.tolerance)
        answer = compiled and compiled.corrected(guess, curve.normalised(chord), *how)
        if answer:
            z, tangent, residual, _ = answer
        else:
            solution = newton(curve, guess, self._row, tolerance=self.tolerance)
            if not solution.converged:
                raise Undefined("Newton's iteration failed between two points of the curve")
            z, tangent, residual = solution.z, None, solution.residual
        self._near(guess, z)
        if tangent is None:
            tangent, _ = curve.tangent_at(z, slope)
        self._known[u] = self._point(u, z, tangent, residual)
        return self._known[u]

    def corrected(self, solution: Solution, tangents: Sequence[Array]) -> tuple[float, Point]:
        """A polished solution and its u. Where curves cross, their tangents are known; elsewhere
        the tangent is solved for."""
        u = float(self._row.dot(solution.z - self.first.z))
        guess, slope = self.guess(min(max(u, 0.0), 1.0))
        self._near(guess, solution.z)
        if tangents:
            tangent = closest_tangent(tangents, self.curve.metric * slope)
        else:
            tangent, _ = self.curve.tangent_at(solution.z, slope)
        return u, self._point(u, solution.z, tangent, solution.residual)

    def _near(self, guess: Array, z: Array) -> None:
        if self.curve.length(z - guess) > _BESIDE * self.length:
            raise Undefined("the location ended on another curve")

    def _point(self, u: float, z: Array, tangent: Array, residual: float) -> Point:
        return Point(self.curve, z, tangent, self.first.arclength + u * self.length, residual)


def between(first: Point, last: Point, *, tolerance: float = 1e-9) -> Point | None:
    """The point halfway between two neighbours of a branch, solved for; None where they are one
    but for rounding, or none is found: on a branch without its equations, for instance.
    """
    if last.arclength - first.arclength <= _CLOSE * (1 + first.curve.length(first.z)):
        return None
    try:
        return StepInterpolant(first, last, tolerance).at(0.5)
    except OUT_OF_DOMAIN:
        return None


def closest_tangent(tangents: Sequence[Array], row: Array) -> Array:
    """The tangent that makes the smallest angle with a direction, turned to its side: the first one
    of those that are as close, and as it is if it is at a right angle."""
    along = [float(tangent.dot(row)) for tangent in tangents]
    most = max(map(abs, along))
    i = next(i for i, part in enumerate(along) if abs(part) >= most - LEVEL)
    return -tangents[i] if along[i] < -LEVEL else tangents[i]
