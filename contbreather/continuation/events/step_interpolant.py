"""The curve between two neighbouring points of a walk, and one test sampled along it."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..algebra.newton import OUT_OF_DOMAIN, Array, Solution, Undefined, rounding
from ..curve.curve import LEVEL, Curve
from ..curve.point import Event, Point, Value
from ..systems.defining_systems import least_in_unknowns, singular_between

ASIDE = 1e-7  # how far beside an event its test is looked at, relative to the step
_CLOSE = 0.2  # two zeros within this fraction of a step are looked for on a shorter piece
LOW = 0.1  # a test this small within a step, relative to its largest, is looked at more closely


class StepInterpolant:
    """The curve between two neighbouring points of a walk: u = 0 at the first, 1 at the last."""

    def __init__(self, first: Point, last: Point, tolerance: float) -> None:
        self.curve: Curve = first.curve
        self.first, self.last = first, last
        self.length = last.arclength - first.arclength
        self.tolerance = tolerance
        self._known: dict[float, Point] = {0.0: first, 1.0: last}

    @cached_property
    def _cubic(self) -> tuple[Array, Array, Array]:
        """The linear functional that is u on chord and cubic, and dz/du at both ends."""
        chord, first, last = self.last.z - self.first.z, self.first.direction, self.last.direction
        dual = self.curve.metric * chord
        row = np.asarray(dual / dual.dot(chord))
        # dz/du with row . dz/du = 1: on the cubic row . (z - z0) then has the values 0 and 1 and
        # the slope 1 at both ends, and is u all along
        return row, first / row.dot(first), last / row.dot(last)

    def guess(self, u: float) -> tuple[Array, Array]:
        """Position and unit tangent on the cubic through both ends."""
        z0, z1 = self.first.z, self.last.z
        _, d0, d1 = self._cubic
        v = 1 - u
        # the Hermite basis v^2 (1 + 2u), u v^2, u^2 (1 + 2v), -u^2 v with v = 1 - u
        z = v * v * (1 + 2 * u) * z0 + u * v * v * d0 + u * u * (1 + 2 * v) * z1 - u * u * v * d1
        slope = 6 * u * v * (z1 - z0) + v * (1 - 3 * u) * d0 + u * (3 * u - 2) * d1
        return z, self.curve.normalised(slope)

    def provisional(self, u: float) -> Point:
        """The point on the cubic, not corrected: close enough to see the sign of a test."""
        return self._known[u] if u in self._known else self._point(u, *self.guess(u), math.nan)

    def at(self, u: float) -> Point:
        """The point of the curve at u, solved for across the chord."""
        if u in self._known:
            return self._known[u]
        guess, slope = self.guess(u)
        row = self._cubic[0]
        solved = self.curve.corrected(guess, row, self.tolerance)
        if solved is None:
            near = self.first.z if u < 0.5 else self.last.z
            solution = self.curve.solved_near(near, guess, row, self.tolerance)
            if not solution.converged:
                raise Undefined("Newton's iteration failed between two points of the curve")
            tangent, _ = self.curve.tangent_at(solution.z, slope)
            solved = solution.z, tangent, solution.residual
        self._check_near(guess, solved[0])
        self._known[u] = self._point(u, *solved)
        return self._known[u]

    def corrected(self, solution: Solution, tangents: Sequence[Array]) -> tuple[float, Point]:
        """A polished solution and its u; `tangents` are known where curves cross."""
        z, curve = solution.z, self.curve
        u = float(self._cubic[0].dot(z - self.first.z))
        guess, slope = self.guess(min(max(u, 0.0), 1.0))
        self._check_near(guess, z)
        if tangents:
            tangent = closest_tangent(tangents, curve.metric * slope)
        else:
            tangent, _ = curve.tangent_at(z, slope)
        return u, self._point(u, z, tangent, solution.residual)

    def moves(self, point: Point) -> bool:
        """Tell whether the free parameter is elsewhere at an end, by more than rounding of its
        value, of a unit vector or of the equations: along a line of solutions, or where an orbit
        all but rests, it seems to turn back anywhere."""
        curve, z, size = self.curve, point.z, self.length * self.curve.scales[-1]
        matrix, weak = curve.jacobian(z), least_in_unknowns(curve, z).left / curve.row_scales
        # weak . H = push dp, to first order: the unknowns do not change it
        push = abs(float((weak @ matrix)[-1])) or math.inf
        least = 4 * math.ulp(1.0) * (abs(z[-1]) + size)
        least += float(np.linalg.norm(weak * rounding(matrix, z))) / push

        def off(end: Point) -> float:
            return abs(end.z[-1] - z[-1]) - abs(float(weak @ curve.equations(end.z))) / push

        return any(off(end) > least for end in (self.first, self.last))

    @cached_property
    def still(self) -> bool:
        """Tell whether the free parameter is the same at both ends and in the middle."""
        with suppress(*OUT_OF_DOMAIN):
            return not self.moves(self.at(0.5))
        return False

    def off(self, u: float, z: Array) -> float:
        """Measure how far the cubic is off the point of the curve at u, relative to the step."""
        guess, _ = self.guess(min(max(u, 0.0), 1.0))
        return self.curve.length(z - guess) / self.length

    def _check_near(self, guess: Array, z: Array) -> None:
        # so far off the cubic, relative to the step, a point between may lie
        if self.curve.length(z - guess) > 0.1 * self.length:
            raise Undefined("the location ended on another curve")

    def _point(self, u: float, z: Array, tangent: Array, residual: float) -> Point:
        return Point(self.curve, z, tangent, self.first.arclength + u * self.length, residual)


def between(first: Point, last: Point) -> Point | None:
    """The point halfway between two neighbours of a branch, solved for; None for none."""
    # neighbours closer than this have nothing between them
    if last.arclength - first.arclength <= 1e-8 * (1 + first.curve.length(first.z)):
        return None
    try:
        return StepInterpolant(first, last, 1e-9).at(0.5)
    except OUT_OF_DOMAIN:
        return None


def closest_tangent(tangents: Sequence[Array], row: Array) -> Array:
    """The tangent that makes the smallest angle with a direction, turned to its side: the first one
    of those that are as close, and as it is if it is at a right angle."""
    along = [float(tangent.dot(row)) for tangent in tangents]
    most = max(map(abs, along))
    i = next(i for i, part in enumerate(along) if abs(part) >= most - LEVEL)
    return -tangents[i] if along[i] < -LEVEL else tangents[i]


# --- a test along it -----------------------------------------------------------------------------


def count_at(event: Event, point: Point) -> Any:
    """The number beside a test, asked once at each end of a step."""
    ask: Any = event.count
    return point.curve.cached(f"count {id(event)}", point.z, lambda _: ask(point))


def more_than_one(counts: Sequence[Any]) -> NDArray[np.bool_]:
    """Between which of these a count changes by more than one, or several together do."""
    changes = np.diff(counts, axis=0)
    if changes.ndim > 1:
        return np.asarray(abs(changes).sum(axis=1) > 1)
    return np.asarray((abs(changes) > 1) & (changes.real != 0))


@dataclass
class StepSamples:
    """The values of one test along one step, by u from 0 to 1."""

    segment: StepInterpolant
    event: Event
    values: dict[float, Value]  # those in `sure` were seen on the curve, others on its cubic
    done: list[tuple[float, float]] = field(default_factory=list)  # brackets dealt with, and
    zeros: list[float] = field(default_factory=list)  # the events in them
    sure: set[float] = field(default_factory=lambda: {0.0, 1.0})
    # pieces on which two zeros may be close together
    close: list[tuple[float, float]] = field(default_factory=list)
    clear: bool = False  # nothing was to be looked for when the step was made

    # --- values -------------------------------------------------------------------------------

    def place(self, u: float) -> Point:
        """Place to look for the event at: beside branch points on the cubic."""
        return self.segment.provisional(u) if self.event.crosses else self.segment.at(u)

    def look(self, u: float) -> Value:
        value = self.event.value_or_nan(self.place(u))
        if math.isnan(value):
            raise Undefined("the test has no value between two points of the curve")
        return value

    def known(self, u: float) -> Value:
        """Look at the test on the curve, once; NaN where it has no value."""
        if u not in self.sure:
            self.values[u] = math.nan
            with suppress(Undefined):
                self.values[u] = self.look(u)
            self.sure.add(u)
        return self.values[u]

    def glance(self, u: float) -> Value:
        """The test on the cubic, close enough to see its sign."""
        self.values[u] = self.event.value_or_nan(self.segment.provisional(u))
        return self.values[u]

    def learn(self, u: float, value: Value) -> None:
        """Take in one more value, unless u is so close to an event that rounding decides it."""
        if u not in self.values and not any(low <= u <= high for low, high in self.done):
            self.values[u] = value

    def deflated(self, u: float, value: Value | None = None) -> float:
        """The value at u with the zeros found so far divided out."""
        # f(u) / prod(u - u_i) is as smooth as f, and what zeros it has are others
        product = 1.0
        for zero in self.zeros:
            product *= u - zero or math.nan
        return float(self.values[u] if value is None else value) / product

    # --- where it changes ---------------------------------------------------------------------

    @property
    def jumps(self) -> bool:
        """Tell whether the test counts: its values are int, but for NaN where it has none."""
        for value in self.values.values():  # any() takes longer, and all ask for this
            if isinstance(value, float) and value == value:
                return False
        return True

    def changes(self) -> list[tuple[float, float]]:
        """Neighbouring places between which the test changes sign, or jumps; not within brackets
        that were dealt with, in which a place where it was looked at before may lie."""
        found, jumps, values = list[tuple[float, float]](), self.jumps, self.values
        for left, right in itertools.pairwise(sorted(u for u in values if values[u] == values[u])):
            changed = values[left] != values[right] if jumps else self.changes_sign(left, right)
            if changed and not any(low <= left and right <= high for low, high in self.done):
                found.append((left, right))
        return found

    def changes_sign(self, left: float, right: float) -> bool:
        a, b = self.values[left], self.values[right]
        return a != 0 and (b == 0 or (a < 0) != (b < 0))

    def remember_event(self, u: float, left: float, right: float) -> None:
        """Remember an event at u: the test keeps its sign up to it, and the other one after it."""
        # between these the sign is rounding
        low, high = max(u - ASIDE, left), min(u + ASIDE, right)
        if low > high:  # off the bracket, which was seen on the cubic
            low, high = min(u - ASIDE, left), max(u + ASIDE, right)
        self.values[low], self.values[high] = self.values[left], self.values[right]
        self.sure |= {low, high}
        self.done.append((low, high))
        self.zeros.append(u)

    def settle_jump(self, low: float, high: float) -> None:
        """Remember a jump in a bracket: there may be others to either side."""
        for u in {low, high} - self.sure:
            self.values[u] = self.look(u)
        self.sure |= {low, high}
        self.done.append((low, high))

    # --- two zeros that leave no change -------------------------------------------------------

    def beside(self, u: float) -> None:
        """Remember where two zeros may be to either side, close together."""
        half = _CLOSE / 2
        self.close.append((max(u - half, 0.0), min(u + half, 1.0)))

    def foresee(self) -> bool:
        """Look between the places where a test should have its zeros, so that each leaves its
        change of sign; beside an event at the start, where the sign is not known; and towards an
        end without a value, as where an impact vanishes. Whether there are any."""
        matrix, segment, look, places = self.event.matrix, self.segment, list[float](), np.empty(0)
        if matrix and segment.last.tangent is not None:
            sizes = [*map(abs, self.values.values())]
            small = min(sizes) < LOW * max(sizes)
            middle = (segment.provisional(0.5),) if small else ()
            places = singular_between(*map(matrix, (segment.first, *middle, segment.last)))
            for low, high in itertools.pairwise(places.tolist()):
                look.append((low + high) / 2)
                if high - low < _CLOSE:
                    self.beside(look[-1])
        if self.values[0.0] == 0 and not self.jumps:
            size = 1 + segment.curve.length(segment.first.z)
            look.append(ASIDE + 1e-12 * size / segment.length)
        for u in look:
            self.glance(u)
        known, blank = (1.0, 0.0) if math.isnan(self.values[0.0]) else (0.0, 1.0)
        if math.isnan(self.values[blank]) and not math.isnan(self.values[known]):
            # halvings of the way to where the test has no value
            for _ in range(6):
                u = 0.5 * (known + blank)
                known, blank = (known, u) if math.isnan(self.glance(u)) else (u, blank)
        return bool(places.size or look)
