"""Steps along a curve: the next points that are certainly on it, with nothing hidden between.

What is said here of one step holds for all. `walk_kernel` has the same in machine code, many at
once, for problems that bring their equations so; what is more than a plain step is taken here.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from ..algebra.linear_algebra import least_singular
from ..algebra.newton import FEW, OUT_OF_DOMAIN, Array, Solution, Undefined
from ..algebra.sparse import Dense, Factors, checked_finite
from ..algebra.walk_kernel import AIM, CUBIC_ERROR, EASY, ITERATIONS, TINY, TURN, Pieces, Rules
from ..curve.branch import Points, Stop
from ..curve.curve import LEVEL, Curve
from ..curve.derivative_checks import reconsider
from ..curve.point import MANY, Event, Point
from ..curve.settings import Steps
from ..events.step_interpolant import StepInterpolant, closest_tangent
from ..systems.branch_points import GAP, crossing
from .ends import Bound, StartOnCurve

LOG = logging.getLogger(__name__)

EXACT = 1e-14  # relative to 1 + |z|: so close to a bound a place is on it
_PATIENCE = 200  # so many tiny steps in a row lead nowhere
_KINK = "the curve has a kink, where its tangent jumps: set out anew from a solution beyond it"
_FIRST, _MOST = 8, 256  # steps at once: at first, and at most


class StepFailed(Exception):
    """No further step can be made; carries the reason."""

    def __init__(self, reason: str = "", stop: Stop = Stop.NO_CONVERGENCE) -> None:
        super().__init__(reason)
        self.stop, self.reason = stop, reason


Step = tuple[Point, Point | None, Stop | None]  # its end, and as of a piece


@dataclass(frozen=True)
class BranchPiece:
    """Accepted steps, one or more."""

    points: Points  # their ends
    crossing: Point | None = None  # branch point on the last: the determinant changes sign
    stop: Stop | None = None  # why the walk ends with the last
    tests: Any = None  # a row for each event, of numbers as they are, int or float
    counts: Any = None  # beside these, NaN where they are not known

    def tested(self, events: Sequence[Event]) -> BranchPiece:
        # of few each is made once, not once for each event
        many = len(self.points)
        points = self.points if many >= MANY else [*self.points]
        tests = np.empty((len(events), many), dtype=object)
        counts = np.empty(tests.shape, dtype=complex)
        for i, event in enumerate(events):
            tests[i], counts[i] = event.values(points)
        return BranchPiece(self.points, self.crossing, self.stop, tests, counts)

    def beyond(self, n: int) -> BranchPiece | None:
        """Cut off so many steps; None where that is all."""
        if n == len(self.points):
            return None
        rest = self.points[n:], self.crossing, self.stop, self.tests[:, n:], self.counts[:, n:]
        return BranchPiece(*rest)


class Stepper:
    """Steps from one point of a curve to the next, with all that may befall them."""

    def __init__(self, way: StartOnCurve, steps: Steps, home: Point) -> None:
        self.bounds, self.steps, self.curve = way.bounds, steps, way.point.curve
        # loops come back to the start of the branch, across its tangent
        self.home, self.outwards = home, self.curve.normalised(home.direction)
        self.across = self.curve.metric * self.outwards
        self.angles = bool(self.curve.problem.modulo(home.x, self.curve.params(home.z)))
        self.outset = home is way.point
        # whether that is a branch point
        self.crossed = way.sign == 0 if self.outset else home.parent is not None
        # of the bordered determinant, 0 where unknown; to try next
        self.sign, self.size = way.sign, steps.first
        self.weight = math.nan  # the logarithm of its size
        # how long the last step was, and what the curve bends by in s^2 and s^3 from its end on
        self.length, self.bend = 0.0, np.zeros((2, way.point.z.size))
        self.longest, self.tiny = 0.0, 0
        self.pieces, self.together, self.few = self._pieces(), _FIRST, 1

    def next(self, point: Point, count: int) -> BranchPiece:
        """Take the next steps: many at once; or one, or of small problems a few."""
        if self.pieces and (points := self._many(self.pieces, point, self.steps.most - count)):
            return BranchPiece(points)
        point, crossing, stop = self._one(point, count)
        ends, most = [point], min(self.few, self.steps.most - count)
        while len(ends) < most and not (crossing or stop):
            try:
                point, crossing, stop = self._one(point, count + len(ends))
            except StepFailed:  # it will again, the first of its piece
                break
            ends.append(point)
        if not self.pieces and point.z.size <= FEW:
            self.few = min(2 * self.few, _FIRST)
        return BranchPiece(Points.of(ends), crossing, stop)

    def _one(self, point: Point, count: int) -> Step:
        """The next step, which may close a loop."""
        try:
            last, crossing, stop = self._advance(point)
        except StepFailed as failed:
            if failed.stop is not Stop.NO_CONVERGENCE:
                raise
            # the scheme for derivatives was chosen, or those given were checked, at the start only
            wrong = reconsider(self.curve, point.z + self.size * point.direction, point.z)
            if wrong:
                raise StepFailed(wrong) from failed
            try:
                last, crossing, stop = self._advance(point)
            except StepFailed as again:
                if again.stop is Stop.NO_CONVERGENCE and self._has_kink(point):
                    raise StepFailed(_KINK) from again
                raise
        length = last.arclength - point.arclength
        # what only takes tiny steps would not get anywhere, at great expense
        self.longest = max(self.longest, length)
        self.tiny = self.tiny + 1 if length < TINY * self.longest else 0
        if self.tiny > _PATIENCE:
            raise StepFailed(f"{_PATIENCE} steps in a row had to be tiny")
        if (count > 2 or not self.outset) and (start := self._passed(point, last)):
            length = point.arclength + self.curve.length(start.z - point.z)
            return replace(start, arclength=length), crossing, Stop.CLOSED
        return last, crossing, stop

    # --- many at once ---

    def _pieces(self) -> Pieces | None:
        """Find who takes many steps at once; None where there is no machine code, or each is to
        have a line of its own among the messages."""
        known, curve, steps, size = self.curve.kernels(), self.curve, self.steps, len(self.bounds)
        if known is None or LOG.isEnabledFor(logging.DEBUG):
            return None
        low, high, slots = np.empty(size), np.empty(size), np.empty(size, dtype=np.int64)
        for i, bound in enumerate(self.bounds):
            if not isinstance(bound.slot, int):
                return None
            low[i], high[i], slots[i] = bound.low, bound.high, bound.slot
            for side, end, off in bound.ends:
                # short of a bound: it is landed on, unless the curve begins there
                if abs(bound.value(curve.start) - end) > off:
                    (low if side < 0 else high)[i] = end - side * off
        sizes = steps.tolerance, steps.smallest, steps.largest or math.nan, steps.growth
        plane = curve.metric, self.across, self.home.z
        return Pieces(*known, Rules(*sizes, slots, low, high, *plane))

    def _many(self, pieces: Pieces, point: Point, most: int) -> Points | None:
        """Take as many steps as come off at once; None where the first is more than a plain one."""
        state = point.arclength, self.size, self.sign, self.longest, self.length
        start = point.z, point.direction, *self.bend
        rows = pieces.steps(start, state, min(self.together, most))
        if not len(rows[0]):
            return None
        _, self.size, sign, self.longest, self.length = pieces.state.tolist()
        self.sign, self.tiny = int(sign), 0
        self.bend = np.array([pieces.room.second, pieces.room.third])
        self.together = min(2 * self.together, _MOST)
        return Points(self.curve, *rows)

    # --- one by one ---

    @cached_property
    def _phases(self) -> list[tuple[Point, Array, Array]]:
        """The start with other unknowns; how the curve leaves it there, and the plane across it."""
        curve, home, homes = self.curve, self.home, list[tuple[Point, Array, Array]]()
        # in the parameter; next to a fold across the curve
        same = np.eye(1, home.z.size, home.z.size - 1)[0]

        def phases(z: Array) -> list[Array]:
            known = curve.problem.phases(z[: curve.size], curve.params(z))
            return [np.append(x, z[curve.size :]) for x in known]

        here, sides = list[Array](), list[list[Array]]()
        step = self.steps.first * self.outwards
        with suppress(*OUT_OF_DOMAIN):
            here, sides = phases(home.z), [phases(home.z + step), phases(home.z - step)]
        for z in here if all(sides) else ():
            with suppress(StepFailed, *OUT_OF_DOMAIN):
                # the same one is the nearest: rounding may tell one more, or another order
                gaps = ([y - curve.turned(z, y) for y in side] for side in sides)
                later, sooner = (min(gap, key=curve.length) for gap in gaps)
                # from both sides: phases bend away from a secant in proportion to the step
                tangent = along = curve.normalised(later - sooner)
                if not self.crossed:  # there Newton's iteration is singular
                    steep = abs(self.outwards[-1]) > self.steps.first
                    seen, z = z, self.correct(z, same if steep else curve.metric * along).z
                    # across the curve it may slide along it, to another
                    if not steep and curve.length(z - seen) > self.steps.first:
                        continue
                    tangent = curve.tangent_at(z, along)[0]
                homes.append((replace(home, z=z, tangent=tangent), tangent, curve.metric * tangent))
        return homes

    def _passed(self, point: Point, last: Point) -> Point | None:
        """The start, if the step passes it in the direction in which the curve left it; its angles
        as they are there."""
        homes, length = [(self.home, self.outwards, self.across)], last.arclength - point.arclength
        # with other unknowns it has the same parameter
        if abs(self.home.z[-1] - last.z[-1]) * math.sqrt(self.curve.metric[-1]) <= 2 * length:
            homes += self._phases
        for home, outwards, row in homes:
            start = self.curve.turned(home.z, last.z) if self.angles else home.z
            before, after = row.dot(point.z - start), row.dot(last.z - start)
            # across t0 at the start: from behind it to beyond, within 60 degrees of t0
            if not before < 0 <= after or row.dot(last.direction) < 0.5:
                continue
            segment = StepInterpolant(point, last, self.steps.tolerance)
            guess, slope = segment.guess(before / (before - after))
            gap = guess - start
            if self.curve.length(gap) > 0.1 * segment.length:
                continue
            if self.crossed:  # there Newton's iteration is singular, and curves differ in direction
                off = self.curve.length(gap) / segment.length
                closes = max(off, _angle(self.curve, slope, outwards)) <= 0.03
            else:
                # across the start only: along the curve Newton's linear condition keeps the place
                guess = start + gap - row.dot(gap) * outwards
                z = self.correct(guess, row).z
                # back at the start to this relative distance
                closes = self.curve.length(z - start) <= 1e-7 * (1 + self.curve.length(z))
            if closes:
                return Point(self.curve, start, home.tangent, 0.0, home.residual)
        return None

    def _advance(self, point: Point) -> Step:
        failed: StepFailed | None = None
        far = self.curve.length(point.z)
        longest = self.steps.largest or max(0.1, 0.01 * far)
        size = max(min(self.size, longest), self.steps.smallest)
        while size >= self.steps.smallest:
            try:
                if failed and (retreat := point.base_point.curve.problem.retreat):
                    retreat(point.base_point.x, point.base_point.params)
                return self._attempt(point, size, far)
            except Undefined as error:
                failed = StepFailed(str(error), Stop.DOMAIN)
            except StepFailed as reason:
                if reason.stop is Stop.BOUND:
                    raise
                failed = reason
            LOG.debug("step of %.3g refused: %s", size, failed)
            size /= 2
        raise failed or StepFailed()

    def _has_kink(self, point: Point) -> bool:
        """Tell whether the tangent jumps here, but hardly turns before, or along a curve beyond."""
        curve, place, tangents = self.curve, point.z, [point.direction]
        # where differences do not reach over it, 2e-6 or more off, and close to a step elsewhere
        size = (1 + curve.length(place)) * math.cbrt(self.steps.smallest * self.steps.first**2)
        try:
            for share in (-2, -1, 1, 2):
                place = point.z + share * size * point.direction
                tangents.append(curve.tangent_at(place, tangents[-1])[0])
            row = curve.metric * tangents[-1]
            off, singular = curve.factors(place, row).correction(curve.equations(place), row)
        except Undefined:
            return False
        before, jump, after = (_angle(curve, *pair) for pair in pairwise(tangents[1:]))
        beyond = not singular and curve.length(off) < 2 * size
        return beyond and jump > max(CUBIC_ERROR, 10 * before, 10 * after)

    def _attempt(self, point: Point, size: float, far: float) -> Step:
        curve, (second, third), sign, way = self.curve, self.bend, self.sign, point.direction
        # predict: z + s t + s^2 c_2 + s^3 c_3
        predicted = point.z + size * (way + size * (second + size * third))
        short = self.steps.smallest / size  # what would be left to a bound is no step
        guess, landing = self._within(point.z, predicted, LEVEL * size, short)
        row = curve.metric * way
        # correct
        if landing is None:
            solution = self.correct(guess, row, point.z)
            z, landing = self._within(point.z, solution.z, EXACT * (1 + far), short)
        tangent: Array | None = None
        if landing is not None:
            z, solution, tangent = self._land(point, predicted, *landing)
        # examine: one smooth piece of curve, without a branch point that is not known
        length = curve.length(z - point.z)
        # the corrector moves across the step: this far it has left for another piece of curve
        if not 0.0 < length <= 2.0 * size:
            raise StepFailed("the corrector left the neighbourhood of the step")
        factors, side = curve.factors(z if tangent is None else point.z, row), 0
        if tangent is None:
            tangent, side = curve.tangent_at(z, way, factors)
        turn = _angle(curve, way, tangent)
        self._examine(point, z, tangent, length, turn, factors)
        # where the determinant vanishes, linearly, next to the end: its tangent is of neither curve
        near, ahead = GAP * (1 + far), math.exp(min(factors.weight - self.weight, 0.0))
        if landing is None and ahead * length < near < length:
            raise StepFailed("it ends on a branch point")
        arclength = point.arclength + length
        last = Point(curve, z, tangent, arclength, solution.residual)
        branch_point = None
        if side * sign < 0:
            segment = StepInterpolant(point, last, self.steps.tolerance)
            branch_point = self._crossing_on(segment, sign)
            # without any the step ended on another curve, unless it is too short to tell
            if branch_point is None and size > near:
                raise StepFailed("another curve is too close")
        if self._leaves(point, last, length):
            raise StepFailed("the curve touches the edge of the window")
        LOG.debug(
            "step of %.3g to %s = %.10g: %d Newton iterations, residual %.1e",
            length, curve.free[0], last.z[-1], solution.iterations, solution.residual,
        )  # fmt: skip
        # adapt: the turn is |t'| s to first order, so that s AIM / turn meets the aim; less than a
        # half would trust that too far (E. L. Allgower and K. Georg, Introduction to Numerical
        # Continuation Methods, section 6.1, bound the factor alike)
        count = solution.iterations
        effort = 1.0 if count == EASY else (0.7 if count > EASY else math.inf)
        self.size = size * max(min(AIM / max(turn, 1e-12), effort, self.steps.growth), 0.5)
        self.sign, self.weight = side or sign, factors.weight
        # the next prediction: the integral of the parabola through the last three tangents. Theirs
        # and not that of ends, from which what is left of corrections would grow fivefold a step
        before, self.length = self.length, arclength - point.arclength
        curvature, change = (tangent - way) / self.length, 0 * way
        if before:
            change = (curvature - 2 * second + 3 * before * third) / (before + self.length)
        self.bend = np.array([(curvature + self.length * change) / 2, change / 3])
        return last, branch_point, None if landing is None else Stop.BOUND

    def correct(self, predicted: Array, row: Array, near: Array | None = None) -> Solution:
        tolerance = self.steps.tolerance
        solution = self.curve.solved_near(near, predicted, row, tolerance, most=ITERATIONS)
        if not solution.converged:
            raise StepFailed(f"residual {solution.residual:.2g}")
        return solution

    def _within(
        self, before: Array, after: Array, along: float, short: float
    ) -> tuple[Array, tuple[Bound, float] | None]:
        """The end of a step without what rounding may have put beyond a bound, and the first bound
        that it crosses, or would if it were longer by the share `short`, with its value there; one
        that begins on a bound goes along it, or touches it there, unless it ends farther than
        `along` behind it."""
        first, nearest = None, math.inf
        for bound in self.bounds:
            start, end = bound.value(before), bound.value(after)
            for side, value, off in bound.ends:
                on_it, beyond = abs(start - value) <= off, side * (end - value)
                # a step that ends just short of it ends on it, unless it goes along it
                if beyond <= (along if on_it else -max(off, short * side * (end - start))):
                    after = bound.with_value(after, value) if beyond > 0 else after
                    continue
                if on_it:
                    raise StepFailed(stop=Stop.BOUND)
                fraction = (value - start) / (end - start)
                if fraction < nearest:
                    first, nearest = (bound, value), fraction
        return after, first

    def _land(
        self, point: Point, predicted: Array, bound: Bound, value: float
    ) -> tuple[Array, Solution, Array | None]:
        """The place on a bound where a step across it ends, the solution next to it, and its
        tangent where curves cross there."""
        start, end = bound.value(point.z), bound.value(predicted)
        # on the chord of the predictor, where all is linear but norms
        fraction = (value - start) / (end - start) if end != start else 1.0
        guess = bound.with_value(point.z + min(fraction, 1.0) * (predicted - point.z), value)
        crosses, tangent = self._crossing_at(point, guess, bound, value), None
        if crosses:
            z, solution, tangent = crosses
        # a norm is not linear: once more from the point it led to, where its error is squared
        for _ in () if crosses else range(6):
            solution = self.correct(guess, bound.row(guess))
            # Newton's linear condition holds to rounding; make it exact
            z = bound.with_value(solution.z, value)
            if self.curve.length(z - solution.z) <= EXACT * (1 + self.curve.length(z)):
                break
            guess = z
        others = (other for other in self.bounds if other is not bound)
        if any(not other.low <= other.value(z) <= other.high for other in others):
            raise StepFailed("two bounds within one step")
        return z, solution, tangent

    def _crossing_at(
        self, point: Point, guess: Array, bound: Bound, value: float
    ) -> tuple[Array, Solution, Array] | None:
        """The place on a bound where curves cross, or do so within rounding: Newton's iteration on
        it is singular there, and ends off both by the root of what it leaves of the equations."""
        curve = self.curve
        try:
            before, near = (
                least_singular(checked_finite(curve.balanced(curve.jacobian(z)))).size
                for z in (point.z, guess)
            )
            if near > 0.5 * before:
                return None
            found = crossing(curve, guess)
        except Undefined:
            return None
        place = found.solution.z
        way = closest_tangent(found.tangents, curve.metric * (place - point.z))
        off, slope = value - bound.value(place), float(bound.row(place) @ way)
        z = bound.with_value(place + (off / slope if slope else 0.0) * way, value)
        if not curve.length(z - place) <= GAP * (1 + curve.length(z)):
            return None
        return z, found.solution, way

    def _crossing_on(self, segment: StepInterpolant, before: int) -> Point | None:
        """Locate a change of sign of the determinant: by halving, then by a system of its own."""
        low, high = 0.0, 1.0
        # from 1/64 of the step on the system of a branch point is solved
        for _ in range(6):
            middle = 0.5 * (low + high)
            _, sign = self.curve.tangent_at(*segment.guess(middle))
            low, high = (middle, high) if sign == before else (low, middle)
        # next to a branch point a rank is all but lost; where it is not the sign has jumped, and an
        # iteration for a branch point would lead nowhere, at great expense
        guess, _ = segment.guess(0.5 * (low + high))
        places = guess, segment.first.z, segment.last.z
        near, *ends = (
            least_singular(self.curve.balanced(self.curve.jacobian(z))).size for z in places
        )
        if near > 0.5 * max(ends):
            return None
        try:
            branch_point = crossing(self.curve, guess)
            place, point = segment.corrected(branch_point.solution, branch_point.tangents)
        except Undefined:
            return None
        return point if -0.02 < place < 1.02 else None  # just beyond its ends still belongs to it

    def _leaves(self, point: Point, last: Point, length: float) -> bool:
        """Tell whether the curve leaves the window between both ends and comes back."""
        for bound in self.bounds:
            first, then = bound.row(point.z) @ point.direction, bound.row(last.z) @ last.direction
            if not first * then < 0:
                continue
            start, size = bound.value(point.z), float(np.max(self.curve.metric[bound.slot])) ** -0.5
            if bound.low < start - size * length and start + size * length < bound.high:
                continue  # out of reach
            # from the first value the cubic rises by d0 u + (3 rise - 2 d0 - d1) u^2
            # + (d0 + d1 - 2 rise) u^3, with extrema where the derivative of that is zero
            d0, d1, rise = length * first, length * then, bound.value(last.z) - start
            extrema = np.roots([3 * (d0 + d1 - 2 * rise), 2 * (3 * rise - 2 * d0 - d1), d0]).real
            u = float(extrema[np.argmin(abs(extrema - 0.5))])
            value = bound.value(StepInterpolant(point, last, self.steps.tolerance).at(u).z)
            # the extremum is solved for to this tolerance: so far beyond a bound it is on it
            slack = self.steps.tolerance * float(np.max(self.curve.scales[bound.slot]))
            if not bound.low - slack <= value <= bound.high + slack:
                return True
        return False

    # --- examine ---

    def _examine(
        self, point: Point, z: Array, tangent: Array, length: float, turn: float,
        factors: Dense | Factors,
    ) -> None:  # fmt: skip
        """Refuse a step that is no smooth piece of curve, short against its features."""
        curve, way = self.curve, point.direction
        # the chord as well: between tangents that are parallel a curve may turn and turn back
        if turn > TURN or _angle(curve, way, (z - point.z) / length) > TURN:
            raise StepFailed("the curve turns too sharply")
        # the distance from the Hermite cubic through both ends, a third of the way along (halfway,
        # tangents that are wrong alike would cancel): at u = 1/3 h00, h01, h10, h11 =
        # (20, 7, 4, -2) / 27
        bow = (4 * way - 2 * tangent) * length
        between = (20 * point.z + 7 * z + bow) / 27
        row = curve.metric * way
        # H = J dz + O(dz^2): one correction is the distance to first order. Of large problems by
        # the factors at the end: no more than the size of the answer is asked for
        value = curve.equations(between, curve.problem.roughly)
        factors = factors if z.size > FEW else curve.factors(between, row)
        change, singular = factors.correction(value, row)
        # beside a branch point the residual says nothing, nor where it is rounding
        off = curve.length(change)
        if not singular and off > CUBIC_ERROR * length and off > EXACT * (1 + curve.length(z)):
            raise StepFailed("the curve is not smooth at the smallest step")


def _angle(curve: Curve, t: Array, other: Array) -> float:
    """Between unit vectors, from their difference: exact for small angles too."""
    # |t - t'| = 2 sin(angle / 2): 1 - t . t' would have lost half of the digits
    return 2.0 * math.asin(min(1.0, 0.5 * curve.length(t - other)))
