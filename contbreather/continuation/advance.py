"""One step along a curve: the next point that is certainly on it, with nothing hidden between."""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from .branch import Stop
from .branch_points import crossing
from .curve import Curve
from .newton import Array, Solution, Undefined, correction
from .point import Point
from .segment import LEVEL, Segment, tangent_at
from .starts import Bound, rounding
from .steps import Steps
from .stride import ITERATIONS, STRAY, TURN, next_size
from .strider import WIDEST

LOG = logging.getLogger(__name__)

_OUTSIDE = 0.02  # how far beyond its ends, relative to a step, a branch point still belongs to it
_LANDINGS = 6  # how often a step is landed on a curved bound; its error is squared each time
EXACT = 1e-14  # a landing this close, relative to 1 + |z|, is exact
_ALONG = 1e-14  # how far, relative to that, rounding may leave a bound that a curve goes along
_GAP = 1e-6  # steps shorter than this, relative to 1 + |z|, cannot tell two curves apart


class Failed(Exception):
    """No further step can be made; carries the reason."""

    def __init__(self, stop: Stop, reason: str = "") -> None:
        super().__init__(reason)
        self.stop = stop
        self.reason = reason


@dataclass(frozen=True)
class Step:
    """One accepted step: its end, the size to try next, and whether the walk ends here."""

    point: Point
    next_size: float
    side: int = 0  # sign of the bordered determinant at its end, 0 where unknown
    crossing: Point | None = None  # the branch point where that sign changed
    stop: Stop | None = None
    plain: bool = False  # whether it is one of several that were taken at once


@dataclass(frozen=True)
class Stepper:
    """What stays the same from step to step. `side` is the sign of the bordered determinant."""

    curve: Curve
    bounds: Sequence[Bound]
    steps: Steps

    def advance(self, point: Point, bend: Array, size: float, side: int) -> Step:
        """The next point, with as many halvings of the step as it takes."""
        try:
            return self._halving(point, bend, size, side)
        except Failed as failed:
            if failed.stop is not Stop.NO_CONVERGENCE:
                raise
            # the scheme for derivatives was chosen, or those given were checked, at the start only
            wrong = self.curve.reconsider(point.z + size * point.direction, point.z)
            if wrong:
                raise Failed(failed.stop, wrong) from failed
            return self._halving(point, bend, size, side)

    def _halving(self, point: Point, bend: Array, size: float, side: int) -> Step:
        failed = Failed(Stop.NO_CONVERGENCE)
        size = min(size, self.steps.longest(self.curve.length(point.z)))
        while size >= self.steps.smallest:
            try:
                return self._attempt(point, bend, size, side)
            except Undefined as error:
                failed = Failed(Stop.RIM, str(error))
            except Failed as reason:
                if reason.stop is Stop.BOUND:
                    raise
                failed = reason
            LOG.debug("step of %.3g refused: %s", size, failed)
            size /= 2
        raise failed

    def _attempt(self, point: Point, bend: Array, size: float, side: int) -> Step:
        curve = self.curve
        predicted = point.z + size * point.direction + (0.5 * size * size) * bend
        landing = self._crossed(point.z, predicted, LEVEL * size)
        if landing is None:
            found = self.correct(self._within(predicted), curve.dual(point.direction))
            landing = self._crossed(point.z, found.z, _ALONG * (1 + curve.length(point.z)))
            found = replace(found, z=self._within(found.z)) if landing is None else found
        if landing is not None:
            found = self._land(point, predicted, *landing)
        last, side, crossing = self._accepted(point, found, size, side)
        turn = angle(curve, point.direction, last.direction)
        factor = next_size(found.iterations, turn, self.steps.growth)
        stop = None if landing is None else Stop.BOUND
        return Step(last, size * factor, side, crossing, stop)

    def _settled(self, guess: Array, row: Array, slope: Array) -> Solution:
        """The same where a row keeps its value, by loops where there are any."""
        curve = self.curve
        across = row if curve.metric is None else row / curve.metric
        known = curve.settler and curve.settler.settled(guess, across, slope, self.steps.tolerance)
        if not known:
            return self.correct(guess, row)
        z, _, residual, iterations = known
        return Solution(z, True, iterations, residual, 0.0)

    def correct(self, predicted: Array, row: Array) -> Solution:
        how = {"tolerance": self.steps.tolerance, "most": ITERATIONS}
        found = self.curve.newton(predicted, row, **how)
        if not found.converged:
            raise Failed(Stop.NO_CONVERGENCE, f"residual {found.residual:.2g}")
        return found

    def _within(self, z: Array) -> Array:
        """z, which crosses no bound, without what rounding may have put beyond one."""
        for bound in self.bounds:
            z = bound.within(z)
        return z

    def _crossed(self, before: Array, after: Array, along: float) -> tuple[Bound, float] | None:
        """The first bound that a step crosses, and its value there; one that begins on a bound goes
        along it, or touches it there, unless it ends farther than `along` behind it."""
        first, nearest = None, math.inf
        for bound in self.bounds:
            start, end = bound.value(before), bound.value(after)
            for value, beyond in ((bound.low, bound.low - end), (bound.high, end - bound.high)):
                on_it = abs(start - value) <= rounding(value)
                # a step that ends short of it by rounding ends on it, unless it goes along it
                if beyond <= (along if on_it else -rounding(value)):
                    continue
                if on_it:
                    raise Failed(Stop.BOUND)
                fraction = (value - start) / (end - start)
                if fraction < nearest:
                    first, nearest = (bound, value), fraction
        return first

    def _land(self, point: Point, predicted: Array, bound: Bound, value: float) -> Solution:
        """The solution exactly on a bound, instead of a step across it."""
        start, end = bound.value(point.z), bound.value(predicted)
        fraction = (value - start) / (end - start) if end != start else 1.0
        guess = bound.moved(point.z + min(fraction, 1.0) * (predicted - point.z), value)
        for _ in range(_LANDINGS):  # a norm is not linear: once more from the point it led to
            found = self._settled(guess, bound.row(guess), point.direction)
            # Newton's linear condition holds to rounding; make it exact
            z = bound.moved(found.z, value)
            if self.curve.length(z - found.z) <= EXACT * (1 + self.curve.length(z)):
                break
            guess = z
        others = (other for other in self.bounds if other is not bound)
        if any(not other.low <= other.value(z) <= other.high for other in others):
            raise Failed(Stop.NO_CONVERGENCE, "two bounds within one step")
        return replace(found, z=z)

    def _accepted(
        self, point: Point, found: Solution, size: float, before: int
    ) -> tuple[Point, int, Point | None]:
        """The new point if the step is one smooth piece of curve, short against its features."""
        curve = self.curve
        chord = found.z - point.z
        length = curve.length(chord)
        if not 0 < length <= 2 * size:
            raise Failed(Stop.NO_CONVERGENCE, "the corrector left the neighbourhood of the step")
        tangent, side = tangent_at(curve, found.z, point.direction)
        last = Point(curve, found.z, tangent, point.arclength + length, found.residual)
        if (
            angle(curve, point.direction, tangent) > TURN
            or angle(curve, point.direction, chord / length) > TURN
        ):
            raise Failed(Stop.NO_CONVERGENCE, "the curve turns too sharply")
        if self._strays(point, last, length):
            raise Failed(Stop.NO_CONVERGENCE, "the curve is not smooth at the smallest step")
        crossing = None
        if side * before < 0:
            crossing = self._crossing_on(Segment(point, last, self.steps.tolerance), before)
            if crossing is None and size > _GAP * (1 + curve.length(last.z)):
                raise Failed(Stop.NO_CONVERGENCE, "another curve is too close")
        if self._peeks(point, last, length):
            raise Failed(Stop.NO_CONVERGENCE, "the curve touches the edge of the window")
        LOG.debug(
            "step of %.3g to %s = %.10g: %d Newton iterations, residual %.1e",
            length, curve.free[0], last.z[-1], found.iterations, found.residual,
        )  # fmt: skip
        return last, side, crossing

    def _strays(self, point: Point, last: Point, length: float) -> bool:
        """Whether the curve is off the cubic through both ends, a third of the way along it: one
        residual tells. (Halfway, tangents that are wrong alike would cancel.)"""
        between = 20 * point.z + 7 * last.z + (4 * point.direction - 2 * last.direction) * length
        between /= 27
        curve, row = self.curve, self.curve.dual(point.direction)
        value = curve.equations(between)
        # of large problems the factors at hand: no more than the size of the answer is asked for
        factors = curve.factors(last.z if between.size > WIDEST else between, row)
        off, singular = correction(factors, value, row)
        if singular:
            return False  # a branch point: the residual says nothing there
        return self.curve.length(off) > STRAY * length

    def _crossing_on(self, segment: Segment, before: int) -> Point | None:
        """The branch point at which the determinant changed sign between both ends. If there is
        none, the step ended on another curve."""
        low, high = 0.0, 1.0
        for _ in range(6):
            middle = 0.5 * (low + high)
            _, side = tangent_at(self.curve, *segment.guess(middle))
            low, high = (middle, high) if side == before else (low, middle)
        try:
            found = crossing(self.curve, segment.guess(0.5 * (low + high))[0])
            place, point = segment.settled(found.solution, found.tangents)
        except Undefined:
            return None
        return point if -_OUTSIDE < place < 1 + _OUTSIDE else None

    def _peeks(self, point: Point, last: Point, length: float) -> bool:
        """Whether the curve leaves the window between both ends and comes back."""
        for bound in self.bounds:
            rise = bound.value(last.z) - bound.value(point.z)
            slopes = [bound.slope(end.z, end.direction) for end in (point, last)]
            if not slopes[0] * slopes[1] < 0:
                continue
            d0, d1 = length * slopes[0], length * slopes[1]
            extrema = np.roots([3 * (d0 + d1 - 2 * rise), 2 * (3 * rise - 2 * d0 - d1), d0]).real
            u = float(extrema[np.argmin(abs(extrema - 0.5))])
            value = bound.value(Segment(point, last, self.steps.tolerance).at(u).z)
            slack = self.steps.tolerance * float(np.max(self.curve.scales[bound.slot]))
            if not bound.low - slack <= value <= bound.high + slack:
                return True
        return False


def angle(curve: Curve, one: Array, other: Array) -> float:
    """Angle between unit vectors, from their difference: exact for small angles too."""
    gap = one - other
    return 2 * math.asin(min(1.0, 0.5 * math.sqrt(gap.dot(curve.dual(gap)))))
