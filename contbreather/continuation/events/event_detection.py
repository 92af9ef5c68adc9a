"""Which events are on one step of a walk: where their tests change, and in what order.

Branch points come first. Next to them the corrector may end on the other curve, so all other events
are looked for on the pieces of curve between them.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from operator import attrgetter, itemgetter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..algebra.newton import Undefined
from ..curve.branch import Points
from ..curve.point import Event, Point
from ..systems.branch_points import GAP, bordered_matrices, bordered_matrix
from ..systems.defining_systems import regular_between
from .event_location import (
    BESIDE,
    at_end,
    double_zeros,
    first_jump,
    locate,
    not_simple,
    separated,
    special,
)
from .step_interpolant import ASIDE, StepInterpolant, StepSamples, count_at, more_than_one

# A test whose last three values lie on a parabola that stays above these fractions of its largest
# value is not looked at within the step: neither a dip nor a kink could make anything of it.
_CALM, _FLAT = 0.6, 0.35
_AT_END = 1e-12  # a walk that ends this close to an event, relative to 1 + |z|, ends at it


class Ends(NamedTuple):
    """Start or end of the walk on a step: an event at the very start or end, where rounding decides
    the sign of its test, counts as well; on a closed curve only once."""

    first: bool = False
    last: bool = False
    closed: bool = False


def find(
    segment: StepInterpolant, events: Sequence[Event], before: Any, after: Any, quiet: Any,
    crossing: Point | None, ends: Ends,
) -> tuple[list[Point], list[Point], Any]:  # fmt: skip
    """Find the events on one step of a walk, those that are verified and those that are not, and
    its last tests, 0 where an event was found there.

    `before` and `after` are the tests at its ends, `crossing` a branch point known to lie on it;
    `quiet` says of each test whether it has no candidate by its values (`quiet_steps`).
    """
    curve = segment.curve
    curve.passes(segment.last.z)
    tests, counts = list[StepSamples](), list[StepSamples]()
    crossings, others = list[StepSamples](), list[StepSamples]()
    for event, start, end, still in zip(events, before, after, quiet, strict=True):
        samples = StepSamples(segment, event, {0.0: start, 1.0: end})
        # those with a matrix say more of what is between than their values do
        samples.clear = bool(still) and not samples.foresee()
        tests.append(samples)
        # what has no test is looked at last, and at few places
        (counts if event.test is None else crossings if event.crosses else others).append(samples)
        if not samples.clear and event.test is not None:
            samples.glance(0.5)
    points = list(_events_on(crossings, ends))
    cuts = [p for p in points if "tangents" in p.detail] or ([crossing] if crossing else [])
    if cuts and others:
        points += _between(segment, cuts, others, ends)
    else:
        points += _events_on(others, ends)
    for samples in counts:
        if not samples.clear or points:
            points += _explained(samples, others, points)
    points = _in_order([point for point in points if point.kind], events)
    last = segment.last.arclength * (1 - 1e-15)
    at_end = {id(p.event) for p in points if p.located and p.arclength >= last}
    for i, samples in enumerate(tests):
        after[i] = 0 if id(events[i]) in at_end and not samples.jumps else samples.values[1.0]
    if curve.problem.beneath is not None:
        points = list(_one_a_place(points))
    return [point for point in points if point.located], _unverified(points), after


def _in_order(points: Sequence[Point], events: Sequence[Event]) -> list[Point]:
    """Along the curve; at one place, but for rounding, in the order of the events."""
    order = {id(event): i for i, event in enumerate(events)}
    numbered, place, before = list[tuple[int, int, Point]](), 0, -math.inf
    for point in sorted(points, key=attrgetter("arclength")):
        place += point.arclength - before > _AT_END * (1 + point.curve.length(point.z))
        before = point.arclength
        # a branch point that the walk found by itself has no event among them
        numbered.append((place, order.get(id(point.event), -1), point))
    return [point for *_, point in sorted(numbered, key=itemgetter(0, 1))]


def quiet_steps(
    events: Sequence[Event], places: Sequence[float], tests: Any, counts: Any, first: Point,
    points: Points,
) -> NDArray[np.bool_]:  # fmt: skip
    """Which tests are so far from zero, by the parabola through their last three values, and change
    so little that nothing is to be looked for within a step; in rows, on each step but the first
    between these places. `tests` has a row for each event, and `counts`, NaN where they are not
    known: these are asked at `first`, the second place, and the points that follow."""
    values, steps = tests.astype(float), np.diff(places)
    start, end = values[:, 1:-1], values[:, 2:]
    blank, several = np.isnan(start) & np.isnan(end), steps.size > 2  # no value to change from
    quiet: NDArray[np.bool_] = blank | _is_flat(steps[:-1] / steps[1:], values[:, :-2], start, end)
    for i, event in enumerate(events):
        if event.test is None:
            quiet[i] = start[i] == end[i]
        elif int in map(type, tests[i]):
            quiet[i] = blank[i]
        elif event.count is not None and quiet[i].any():
            known = not np.isnan(counts[i, 0])
            row = counts[i] if known else [count_at(event, point) for point in points]
            quiet[i] &= ~more_than_one([count_at(event, first), *row])
        if several and event.matrix:
            # matrices say more of what is between two points than values do
            matrices = bordered_matrices(points) if event.matrix is bordered_matrix else None
            if matrices is None:
                return np.zeros_like(quiet)
            quiet[i] &= regular_between(bordered_matrix(first), matrices)
    return quiet


def _is_flat(pace: Any, earlier: Any, start: Any, end: Any) -> Any:
    """Tell whether the parabola through three values stays away from zero."""
    # start + b u + curvature u^2 through (-pace, earlier), (0, start) and (1, end): its value at
    # 1/2 is (start + end) / 2 - curvature / 4
    curvature = (end - start - (start - earlier) / pace) / (1 + pace)
    middle = (0.5 * (start + end) - 0.25 * curvature) / start  # all of them in units of the first
    last = end / start
    inside = (last > _FLAT * np.maximum(middle, 1.0)) & (last < 1 / _FLAT) & (_FLAT * middle < 1)
    return inside & (middle > _CALM * np.maximum(last, 1.0)) & (earlier / start > 0)


def _one_a_place(points: Sequence[Point]) -> Iterator[Point]:
    """On a boundary: one label for all that is seen at one place, where several tests vanish at
    once. An event that ends the curve goes before one where others cross it, and that before the
    rest. Where nothing is verified, as for the values a user asks for, each keeps its own."""
    left = list(points)
    while left:
        point, length = left[0], left[0].curve.length
        together = left[:1]
        if point.event and point.event.examine:
            reach = GAP * (1 + length(point.z))
            verified = (p for p in left[1:] if p.event and p.event.examine)
            together += [p for p in verified if length(p.z - point.z) <= reach]
        left = [p for p in left if p not in together]
        best = max(
            together,
            key=lambda p: (p.located, bool(p.event and p.event.ends), "tangents" in p.detail),
        )
        also = {p.kind: None for p in together if p.located and p.kind != best.kind}
        yield replace(best, detail={**best.detail, "also": ", ".join(also)}) if also else best


def unexplained(doubtful: Sequence[Point], crossings: Sequence[Point]) -> list[Point]:
    """Leave out what is in doubt at a branch point that was located: some tests vanish wherever
    curves cross, of others rounding decides."""
    reaches = [GAP * (1 + p.curve.length(p.z)) for p in doubtful]
    return [
        point
        for point, reach in zip(doubtful, reaches, strict=True)
        if all(point.curve.length(each.z - point.z) > reach for each in crossings)
    ]


def _unverified(points: Sequence[Point]) -> list[Point]:
    """Candidates that failed, each place once for each event: what was seen there twice is two of
    them."""
    kept: list[Point] = []
    latest: dict[int, int] = {}  # for each event the place of its last candidate in the list
    for point in points:
        if point.located:
            continue
        reach = GAP * (1 + point.curve.length(point.z))
        i = latest.get(id(point.event))
        if i is not None and point.arclength - kept[i].arclength <= reach:
            kept[i] = replace(kept[i], detail={**kept[i].detail, "reason": not_simple(point.kind)})
        else:
            latest[id(point.event)] = len(kept)
            kept.append(point)
    return kept


def _events_on(tests: Sequence[StepSamples], ends: Ends) -> Iterator[Point]:
    active = [samples for samples in tests if not samples.clear]
    for samples in active:
        yield from _at_ends(samples, ends)
        samples.foresee()
        yield from separated(samples)
        yield from _dipped(samples)
        yield from _closer(samples)
    # what ends the curve comes first: other tests may have a pole there, and no value beyond; the
    # step is looked through again at the events found so far
    ending = [samples for samples in active if samples.event.ends]
    for turn in range(20):
        fresh = [*itertools.chain.from_iterable(map(locate, active if turn else ending))]
        yield from fresh
        if not fresh:
            if turn:
                break
            continue
        for samples in tests:  # behind a zero that is no event others may be
            if any(point.event is samples.event and not point.kind for point in fresh):
                yield from separated(samples)
        active = list(tests)  # what happens at an event is news of the clear ones as well
        for point, samples in itertools.product(fresh, tests):
            segment = samples.segment
            u = (point.arclength - segment.first.arclength) / segment.length
            if 0 < u < 1 and samples.event is not point.event:
                samples.learn(u, samples.event.value_or_nan(point))
                start, end = samples.values[0.0], samples.values[1.0]
                # at both sides of a pole, and of where it may have lost its value
                if (point.event and point.event.ends) or math.isnan(start) != math.isnan(end):
                    samples.known(u - BESIDE * u)
                    samples.known(u + BESIDE * (1 - u))
        for samples in tests:
            yield from _dipped(samples)


def _dipped(samples: StepSamples) -> Iterator[Point]:
    if 0.5 not in samples.values or samples.jumps or samples.changes():
        return
    yield from double_zeros(samples)
    if samples.event.matrix:
        for _, middle in samples.changes()[:-1]:
            samples.beside(middle)


def _closer(samples: StepSamples) -> Iterator[Point]:
    """Two zeros close together, on a shorter piece of curve, where its cubic is closer to it."""
    segment = samples.segment
    for left, right in samples.close:
        if any(low < right and left < high for low, high in samples.done):
            continue
        if segment.length < GAP * (1 + segment.curve.length(segment.first.z)):
            samples.done.append((0.0, 1.0))
            point = segment.provisional(0.5 * (left + right))
            at_ends = min(abs(samples.values[u]) for u in (0.0, 1.0))
            if abs(samples.event.value_or_nan(point)) >= at_ends:
                return  # what was seen is where the curve starts or ends
            yield special(samples, point, left, right, not_simple(samples.event.kind))
            return
        try:
            piece = StepInterpolant(segment.at(left), segment.at(right), segment.tolerance)
        except Undefined:
            continue
        part = StepSamples(piece, samples.event, {})
        for u in (0.0, 0.5, 1.0):
            part.glance(u)
        samples.values[left], samples.values[right] = part.values[0.0], part.values[1.0]
        samples.sure |= {left, right}
        samples.done.append((left, right))
        for point in _events_on([part], Ends()):
            samples.zeros.append((point.arclength - segment.first.arclength) / segment.length)
            yield point


def _between(
    segment: StepInterpolant, cuts: Sequence[Point], tests: Sequence[StepSamples], ends: Ends
) -> Iterator[Point]:
    """Events on the pieces between branch points; a piece as short as rounding has none."""
    places = [segment.first, *sorted(cuts, key=attrgetter("arclength")), segment.last]
    values = [samples.values[0.0] for samples in tests]
    for start, end in itertools.pairwise(places):
        if end.arclength - start.arclength < ASIDE * segment.length:
            # where curves cross the sign of a test that vanishes is rounding
            values = [v if v or isinstance(v, int) else math.nan for v in values]
            continue
        piece = StepInterpolant(start, end, segment.tolerance)
        reach = GAP * (1 + piece.curve.length(end.z))
        # whether a place beside a zero is out of its reach, so that the sign there is no rounding
        clear = reach < BESIDE * piece.length
        at_first, at_last, parts = start is segment.first, end is segment.last, list[StepSamples]()
        for samples, value in zip(tests, values, strict=True):
            parts.append(part := StepSamples(piece, samples.event, {0.0: value}))
            part.glance(0.5)
            part.glance(1.0)
            seen = part.values
            if not at_first:  # nor does any other test say there where this one changes
                part.done.append((0.0, reach / piece.length))
            if clear and math.isnan(value):
                part.known(BESIDE)
            # within the reach of the place it changes by more than it is: it vanishes there
            near = piece.provisional(max(0.0, 1 - reach / piece.length))
            change = abs(samples.event.value_or_nan(near) - seen[1.0])
            if not (at_last or part.jumps) and abs(seen[1.0]) <= change:
                # its sign is rounding: what is seen here must not be seen to either side as well
                seen[1.0] = math.nan
                if clear:
                    part.known(1.0 - BESIDE)
                yield special(part, replace(end, located=True, detail={}), 1.0, 1.0)
        piece_ends = Ends(ends.first and at_first, ends.last and at_last, ends.closed and at_last)
        yield from _events_on(parts, piece_ends)
        values = [part.values[1.0] for part in parts]


def _at_ends(samples: StepSamples, ends: Ends) -> Iterator[Point]:
    """Events at the very start or end of the walk, within rounding."""
    segment = samples.segment
    if not (ends.first or ends.last or ends.closed) or samples.jumps:
        return
    start, end = samples.values[0.0], samples.values[1.0]
    # the distance at which the test would vanish, the same whatever the length of the step
    change = abs(end - start) / segment.length * (1 + segment.curve.length(segment.last.z))
    if ends.first and abs(start) < _AT_END * change:
        samples.values[0.0] = 0.0
        yield at_end(samples, 0.0)
    elif (ends.last or ends.closed) and abs(end) < _AT_END * change:
        samples.values[1.0] = math.copysign(math.ulp(0.0), start)  # no change left to be found
        if ends.last:
            yield at_end(samples, 1.0)


# --- what no event explains -------------------------------------------------------------------


def _explained(
    count: StepSamples, others: Sequence[StepSamples], points: Sequence[Point]
) -> list[Point]:
    """Events next to where a count changes without one, or that place, as doubtful."""
    segment, more = count.segment, list[Point]()
    if jumps := _jumps(count, points):
        for other, u in itertools.product(others, itertools.chain(*jumps)):
            other.learn(u, other.event.value_or_nan(segment.provisional(u)))
        more = [point for other in others for point in locate(other)]
        jumps = _jumps(count, [*points, *more])
    for low, high in jumps:
        before, after = count.known(low), count.known(high)
        reason = f"a count changes from {before} to {after}, and no event here explains it"
        more.append(special(count, segment.provisional(0.5 * (low + high)), low, high, reason))
    return more


def _jumps(count: StepSamples, points: Sequence[Point]) -> list[tuple[float, float]]:
    """Find where a count changes between the events of a step, a little off them."""
    first, length, jumps = count.segment.first.arclength, count.segment.length, []
    cuts = sorted((point.arclength - first) / length for point in points)
    for i, (low, high) in enumerate(itertools.pairwise([0.0, *cuts, 1.0])):
        room = BESIDE * (high - low)
        low, high = low + (room if i else 0.0), high - (room if i < len(cuts) else 0.0)
        if high - low > ASIDE:
            before, after = count.known(low), count.known(high)
            if before != after and not math.isnan(before) and not math.isnan(after):
                jumps.append(first_jump(count, low, high, 1e-4))
    return jumps
