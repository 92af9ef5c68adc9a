"""Events located: from a bracket in the samples of a test to a point that has been verified.

A float test has a zero in its bracket, an int one a jump. With a defining system Newton's method
finds either, all equations at once, and the test says whether it is the one in the bracket; without
one brentq and bisection do. Double zeros, which leave no bracket, are looked for by the counts of
unstable directions, and downhill, by golden section.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from ..algebra.newton import OUT_OF_DOMAIN, Undefined, newton
from ..curve.curve import Curve
from ..curve.point import NOTHING, Detail, Examined, Level, Point
from ..systems.branch_points import GAP, Crossings, crossing
from ..systems.defining_systems import extended
from .step_interpolant import ASIDE, LOW, StepInterpolant, StepSamples, count_at, more_than_one

Located = tuple[float, float, Point]  # bracket and point

_MOST = 50  # events of one kind that are looked for on one step
_ONE = 1e-6  # zeros closer than this, relative to the step, are taken for one by their count
_TOUCH = 1e-5  # a test this small, relative to its largest, touches zero
BESIDE = 1e-2  # how far off an event, relative to the piece looked at, its sides are looked at


def special(samples: StepSamples, point: Point, low: float, high: float, reason: str = "") -> Point:
    event, start, length = samples.event, samples.segment.first.arclength, samples.segment.length
    around = (start + low * length, start + high * length)
    point = replace(point, kind=event.kind, event=event, bracket=around)
    if event.turns and not samples.segment.moves(point):
        return replace(point, kind="")  # nothing happens there
    doubt = point.detail.get("reason", "")
    verdict: Examined = reason or doubt
    if event.examine is not None and not reason:
        try:
            verdict = event.examine(point)
        except Undefined as error:
            verdict = str(error)
        if doubt and verdict is not NOTHING:
            verdict = doubt
    if isinstance(verdict, str) and verdict:
        return replace(point, located=False, detail={**point.detail, "reason": verdict})
    level = {"level": str(event.test)} if isinstance(event.test, Level) else {}
    if isinstance(verdict, Detail):
        known = {**point.detail, **verdict.known, **level}
        detail = Detail(known, verdict.names, verdict.make)
        return replace(point, detail=detail)
    found = {**point.detail, **(verdict or {}), **level}
    return replace(point, kind=found.pop("kind", point.kind), detail=found)


def not_simple(kind: str) -> str:
    return f"two {kind} at once, or too close to be separated: not simple"


def locate(samples: StepSamples) -> Iterator[Point]:
    """The events behind all changes of one test that were not dealt with yet."""
    if samples.event.turns and samples.changes() and samples.segment.still:
        samples.done.append((0.0, 1.0))  # where the parameter seems to turn back rounding decides
    # values seen on the cubic give way to those on the curve, wherever a change depends on them
    while unsure := {*itertools.chain(*samples.changes())} - samples.sure:
        for u in unsure:
            samples.known(u)
    for left, right in samples.changes():
        try:
            yield from _in_bracket(samples, left, right)
        except Undefined as error:
            middle = 0.5 * (left + right)
            samples.remember_event(middle, left, right)
            if nearer := [*_on_halves(samples, left, right)]:
                yield from nearer
                continue
            reason = f"{samples.event.kind} seen but not located: {error}"
            yield special(samples, samples.segment.provisional(middle), left, right, reason)


def _on_halves(samples: StepSamples, left: float, right: float) -> Iterator[Point]:
    """The events in a bracket by the cubics of its halves, 16 times as close: where curves cross
    places are those of a cubic, and what is solved for from there may be on another curve."""
    segment, event = samples.segment, samples.event
    length = (right - left) * segment.length
    if not event.crosses or length < GAP * (1 + segment.curve.length(segment.first.z)):
        return
    try:
        ends = [*map(segment.at, (left, 0.5 * (left + right), right))]
    except Undefined:  # where curves cross Newton's iteration has nowhere to go
        return
    for first, last in itertools.pairwise(ends):
        piece = StepInterpolant(first, last, segment.tolerance)
        values = {0.0: event.value_or_nan(first), 1.0: event.value_or_nan(last)}
        yield from locate(StepSamples(piece, event, values))


def _in_bracket(samples: StepSamples, left: float, right: float) -> Iterator[Point]:
    jumps = samples.jumps
    places: Iterable[Located | None] = (
        _jumps(samples, left, right) if jumps else [_zero(samples, left, right)]
    )
    for number, (low, high, point) in enumerate(filter(None, places)):
        if number == _MOST:
            samples.done.append((left, right))
            kind = samples.event.kind
            reason = f"more than {_MOST} changes of {kind} within one step: no event"
            yield special(samples, point, low, right, reason)
            return
        if samples.jumps:
            samples.settle_jump(low, high)
        else:
            samples.remember_event(0.5 * (low + high), left, right)
        yield special(samples, point, low, high)
    if not jumps:  # one that may jump has changes left beside its jump
        for low, high in samples.changes():
            # one that is as it was has its zero, to rounding, outside
            if left <= low and high <= right and (low, high) != (left, right):
                yield from _in_bracket(samples, low, high)


def at_end(samples: StepSamples, u: float) -> Point:
    """The event at an end of the step, where the point is known exactly already."""
    solved = samples.segment.at(u)
    low, high, sharp = _solved(samples, u, u, u) or (u, u, solved)
    return special(samples, replace(solved, detail=sharp.detail), low, high)


# --- zeros and jumps --------------------------------------------------------------------------


def _zero(samples: StepSamples, left: float, right: float) -> Located | None:
    """The zero of a float test in a bracket; None where what was seen on the cubic is not there."""
    a, b = float(samples.values[left]), float(samples.values[right])
    if b == 0:
        return right, right, _isolated(samples, right, left, right)
    # where the line through both values vanishes: next to a simple zero of a short step
    secant, size = left + (right - left) * a / (a - b), abs(a) + abs(b)
    if place := _solved(samples, secant, left, right):
        return place
    # once: where rounding decides, an end may say otherwise the second time
    ends = {u: float(samples.look(u)) for u in (left, right)}
    if ends[left] * ends[right] > 0:
        samples.done.append((left, right))
        return None
    from scipy.optimize import brentq  # dear to import, and hardly ever needed

    def value_at(u: float) -> Any:
        return ends[u] if u in ends else samples.look(u)

    try:
        u = brentq(value_at, left, right, xtol=1e-15, rtol=1e-14, disp=False)
    except Undefined:
        return _at_crossing(samples, secant, left, right, size)
    if place := _solved(samples, u, left, right):
        return place
    point, kind = samples.segment.at(u), samples.event.kind
    left_over = abs(samples.event.value_or_nan(point))
    # rounding of a test may be more than that where its values are small all around: as far off on
    # either side, for next to an end of the bracket they are as small as rounding
    off = BESIDE * (right - left)
    beside = (samples.look(v) for v in (max(u - off, left), min(u + off, right)))
    if left_over <= 1e-6 * size or left_over <= 0.1 * min(map(abs, beside)):
        return u - 1e-14, u + 1e-14, _isolated(samples, u, left, right)  # to the last digit of u
    if _may_jump(samples, point):
        samples.settle_jump(max(u - ASIDE, left), min(u + ASIDE, right))
        return None
    reason = f"the test of {kind} changes sign without a zero: it jumps or has a pole"
    return u, u, replace(point, detail={"reason": reason}, located=False)


def _isolated(samples: StepSamples, u: float, left: float, right: float) -> Point:
    """The point at a zero, doubtful if the test is exactly zero beside it as well."""
    segment, event = samples.segment, samples.event
    point = segment.at(u)
    if event.value_or_nan(point) != 0:
        return point
    aside = ASIDE + 1e-12 * (1 + segment.curve.length(point.z)) / segment.length

    def beside(aside: float) -> list[float]:
        return [
            event.value_or_nan(segment.at(v)) for v in (u - aside, u + aside) if left < v < right
        ]

    if all(value != 0 for value in beside(aside)):
        return point
    # a test that goes through is zero where its error is larger, too
    wider = beside(max(1e3 * aside, BESIDE * (right - left)))
    if len(wider) == 2 and wider[0] * wider[1] < 0:
        return point
    reason = f"the test of {event.kind} is zero along a piece of the curve, which is not a place"
    return replace(point, detail={"reason": reason})


def _may_jump(samples: StepSamples, point: Point) -> bool:
    may = samples.event.may_jump
    return may(point) if callable(may) else may


def _at_crossing(
    samples: StepSamples, u: float, left: float, right: float, size: float
) -> Located | None:
    """A zero where another curve crosses as well: the branch point is solved for."""
    segment = samples.segment
    try:
        branch_point = crossing(segment.curve, segment.provisional(u).z)
    except Undefined as error:
        raise Undefined(f"its test has no value in between, and {error}") from error
    place, point = segment.corrected(branch_point.solution, branch_point.tangents)
    if not left - ASIDE <= place <= right + ASIDE:  # that of another zero, told twice
        raise Undefined("its test has no value in between, and the next branch point is outside")
    if abs(samples.event.value_or_nan(point)) > 1e-6 * size:
        if _may_jump(samples, point):
            samples.settle_jump(max(place - ASIDE, left), min(place + ASIDE, right))
            return None
        raise Undefined("a branch point is in the way")
    return place - ASIDE, place + ASIDE, point


def _jumps(
    samples: StepSamples, left: float, right: float, attempt: float = 0.3
) -> Iterator[Located]:
    """Each jump of an integer test in a bracket: by its defining system, tried when the bracket has
    shrunk to `attempt` and at every eighth of it, else by bisection."""
    middle = 0.5 * (left + right)
    if right - left < attempt:
        attempt = (right - left) / 8
        if place := _solved(samples, middle, left, right):
            yield place
            return
    # so narrow a bracket, relative to the step, ends the bisection
    if right - left < 1e-13:
        yield left, right, samples.segment.at(middle)
        return
    samples.values[middle] = samples.look(middle)
    samples.sure.add(middle)
    for low, high in ((left, middle), (middle, right)):
        if samples.values[low] != samples.values[high]:
            yield from _jumps(samples, low, high, attempt)


def first_jump(samples: StepSamples, low: float, high: float, width: float) -> tuple[float, float]:
    """Find the first change of a count in a bracket as closely as `width`."""
    before = samples.known(low)
    while high - low > width:
        middle = 0.5 * (low + high)
        value = samples.known(middle)
        if math.isnan(value):
            break
        low, high = (middle, high) if value == before else (low, middle)
    return low, high


def _solved(samples: StepSamples, u: float, left: float, right: float) -> Located | None:
    """Newton's method on the problem and the defining system of the event together, if it ends
    inside the bracket at a place where the test does change."""
    segment, event = samples.segment, samples.event
    if event.locus is None:
        return None
    detail = dict[str, Any]()
    try:
        guess = samples.place(u)
        if isinstance(event.locus, Crossings):
            solution, detail = event.locus.solve(guess)
        else:  # H(x, p) = 0 and g(x, p, y) = 0 for x, the extra unknowns y and p at once
            locus, n = event.locus(guess), guess.curve.size
            domain = {name: edges for name, edges in locus.domain.items() if name in guess.params}
            if any(not low <= guess.params[name] <= high for name, (low, high) in domain.items()):
                return None  # its conditions may hold all along the curve there
            # unknowns of the problem may have the same names
            own = {f"{name} of {event.kind}": value for name, value in locus.extra.items()}
            both = Curve(extended(guess.curve, replace(locus, extra=own)), ())
            start = np.hstack([guess.x, *own.values(), guess.z[-1:]])
            # so close, unless the walk asks for a closer one
            solution = newton(both, start, tolerance=min(segment.tolerance, 1e-9))
            x, solution = solution.z, replace(solution, z=np.delete(solution.z, slice(n, -1)))
            x.flags.writeable = False
            for name, at in zip(locus.extra, map(both.slots.__getitem__, own), strict=True):
                detail[name] = float(x[at]) if isinstance(at, int) else x[at]
        if not solution.converged:
            return None
        place, point = segment.corrected(solution, detail.get("tangents", ()))
        # beside branch points bracket and u are those of the cubic, and off by as much as that is
        off = segment.off(place, point.z) if event.crosses else 0.0
        if not left - ASIDE <= place <= right + ASIDE and abs(place - u) > off:
            return None
        low, high = place - ASIDE, place + ASIDE
        if not (event.crosses or _vanishes(samples, point, left, right)):
            before, after = (event.value_or_nan(segment.at(v)) for v in (low, high))
            if before == after if isinstance(before, int) else not before * after <= 0:
                return None
    except OUT_OF_DOMAIN:
        return None  # the system has no value here: location goes on without it
    return low, high, replace(point, detail=detail)


def _vanishes(samples: StepSamples, point: Point, left: float, right: float) -> bool:
    """Tell whether a test that changes sign in a bracket does so at a point of it: no larger there
    than what it changes by, at the pace of the bracket, over `ASIDE`."""
    if samples.jumps or not (left < right and samples.changes_sign(left, right)):
        return False
    pace = (samples.values[right] - samples.values[left]) / (right - left)
    return abs(samples.event.value_or_nan(point)) <= ASIDE * abs(pace)


# --- double zeros -----------------------------------------------------------------------------


def separated(samples: StepSamples) -> Iterator[Point]:
    """Look between several zeros, where their count changes by more than one, so that each leaves
    its change of sign; beside those that are known, too. Those at one place are doubtful."""
    event, segment = samples.event, samples.segment
    if event.count is None:
        return
    counts = {0.0: count_at(event, segment.first), 1.0: count_at(event, segment.last)}
    size, ends = _TOUCH * max(abs(samples.values[u]) for u in counts), [0.0]
    for zero in sorted(zero for zero in samples.zeros if 0.0 < zero < 1.0):
        ends += [zero - BESIDE * (zero - ends[-1]), zero + BESIDE * (1.0 - zero)]
        for u in ends[-2:]:
            if math.isnan(samples.known(u)):  # nothing can be seen there
                return
            counts[u] = event.count(samples.place(u))
    ends.append(1.0)
    pieces, looks = [(u, v) for u, v in zip(ends[::2], ends[1::2], strict=True) if u < v], 0
    while pieces:
        left, right = pieces.pop()
        if not more_than_one([counts[left], counts[right]]).any():
            continue
        looks += 1
        middle = 0.5 * (left + right)
        # places looked at between several zeros of one step
        if looks > 400:
            reason = f"the count of {event.kind} changes too often within one step to tell all"
            samples.zeros.append(middle)
            yield special(samples, samples.place(middle), left, right, reason)
            return
        try:
            point = samples.place(middle)
            value, counts[middle] = event.value_or_nan(point), event.count(point)
        except OUT_OF_DOMAIN:  # nothing can be seen there
            continue
        if right - left > _ONE:
            samples.values[middle] = value
            samples.sure.add(middle)
            pieces += [(left, middle), (middle, right)]
        elif abs(value) < size and not samples.changes_sign(left, right):
            yield from _in_doubt(samples, point, left, right, not_simple(event.kind))


def double_zeros(samples: StepSamples) -> Iterator[Point]:
    """Look for two zeros, which leave no change of sign, downhill from the lowest place seen: the
    middle of the step; the vertex of the parabola through its values, as smooth tests dip through
    zero and back; where the line through the middle and an end vanishes, as the least of several
    has a kink at zero."""

    if (0.0, 1.0) in samples.done:
        return

    # on the curve: its cubic may be off by more than the dip
    def seen(u: float) -> float:  # not kept
        with suppress(Undefined):
            return abs(samples.deflated(u, samples.event.value_or_nan(samples.place(u))))
        return math.inf

    def looked(u: float) -> float:
        return abs(samples.deflated(u, samples.known(u)))

    f0, f1, f2 = values = [*map(samples.deflated, (0.0, 0.5, 1.0))]
    size = dict(zip((0.0, 0.5, 1.0), map(abs, values), strict=True))
    if not (min(size.values()) > 0 and sum(size.values()) < math.inf):  # nor NaN
        return
    highest, middle, bend = max(size.values()), size[0.5], f0 - 2 * f1 + f2
    guesses = list[float]()
    for end in (0.0, 1.0):
        if 2 * middle < size[end]:
            guesses.append(0.5 + (0.5 - end) * middle / (size[end] - middle))
    # of a vertex well above zero, in units of the least value so far, there is none to come
    if bend and (f1 - (f2 - f0) / (8 * bend) * (f2 - f0)) / min(values, key=abs) <= 0.7:
        guesses.append(0.5 - (f2 - f0) / (4 * bend))
    for u in guesses:
        if 0.0 < u < 1.0 and min(abs(u - v) for v in size) > _ONE:
            size[u] = seen(u)
    lowest = min(size, key=size.__getitem__)
    if size[lowest] > LOW * highest:
        return
    # the vertex may be beyond an end of the step from which the test falls; and the middle was seen
    # on the cubic
    u = abs(lowest - BESIDE) if lowest in (0.0, 1.0) else 0.5
    size[u] = looked(u)
    places = sorted(size)
    at = places.index(min(places, key=size.__getitem__))
    if not 0 < at < len(places) - 1 or samples.changes():
        return
    # golden section, unless the sign changes; g^2 = 1 - g: one inner place stays when it shrinks
    golden, left, right = 0.5 * (math.sqrt(5) - 1), places[at - 1], places[at + 1]
    inner, outer = right - golden * (right - left), left + golden * (right - left)
    while True:
        four = left, inner, outer, right
        first, low, high, last = (size[u] if u in size else looked(u) for u in four)
        if right - left <= _ONE or samples.changes():
            break
        steepest = max(abs(first - low) / (inner - left), abs(last - high) / (right - outer))
        # no closer than shows that it stays above zero, even if it fell four times as fast inside
        if min(low, high) - 4.0 * steepest * (right - left) > _TOUCH * highest:
            break
        if low < high:
            right, outer = outer, inner
            inner = right - golden * (right - left)
        else:
            left, inner = inner, outer
            outer = left + golden * (right - left)
    u = 0.5 * (left + right)
    if samples.changes() or not _ONE < u < 1 - _ONE:  # at an end it only approaches zero
        return
    # beside a zero that was divided out rounding decides how large it is
    zeros = samples.zeros
    trusted = (value for v, value in size.items() if all(abs(v - z) > ASIDE for z in zeros))
    # where the test jumps it is small on one side alone
    if (
        looked(u) < _TOUCH * max(trusted, default=0.0)
        and max(looked(left), looked(right)) < LOW * highest
    ):
        reason = f"the test of {samples.event.kind} touches zero: none, or two at once"
        yield from _in_doubt(samples, samples.segment.provisional(u), left, right, reason)


def _in_doubt(
    samples: StepSamples, point: Point, left: float, right: float, reason: str
) -> Iterator[Point]:
    """A place that cannot be located, unless nothing happens there."""
    samples.zeros.append(0.5 * (left + right))
    if special(samples, point, left, right).kind:  # it is empty where nothing happens
        yield special(samples, point, left, right, reason)
