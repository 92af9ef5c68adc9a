"""Finding the events on one step of a walk: seen as a change of a test, located on the curve."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .branch_points import GAP, Crossings, crossing
from .curve import Curve
from .dips import Place, bottom, probe, separated
from .extended import extended
from .loci import Singular
from .newton import OUT_OF_DOMAIN, Solution, Undefined
from .point import Event, Examined, Level, Locus, Point
from .segment import Segment
from .trail import ASIDE, Trail, Value, counts_apart, measure

_SHARP = 1e-13  # width of a bracket, relative to the step, at which bisection of a jump ends
_NARROW = 1e-14  # and half of that around a zero
_START = (0.0, 0.5, 1.0)  # where a test is looked at first
_POINT = 1e-6  # relative length of a piece of curve within which two zeros are one
_ROUNDS = 20  # how often a step is looked through again, at the events found so far
_SAME = 1e-6  # relative distance of places on a boundary that are the same
_AT_CUT = 1e-7  # a test this small where curves cross, relative to beside it, vanishes there
_MOST = 50  # events of one kind that are looked for on one step
_BESIDE = 1e-2  # how far off an event, relative to the piece beside it, a tally is looked at
_TALLIED = 1e-4  # and how closely, relative to the step, it is seen where it changes
# A test whose last three values lie on a parabola that stays above these fractions of its largest
# value is not looked at within the step: neither a dip nor a kink could make anything of it.
_CALM, _FLAT = 0.6, 0.35
_LOCATED = 1e-9  # tolerance of a location, unless the walk asks for a closer one
_AT_END = 1e-12  # a walk that ends this close to an event, relative to 1 + |z|, ends at it


@dataclass(frozen=True)
class Ends:
    """Whether a step starts or ends the walk: an event at the very start or end, where rounding
    decides the sign of its test, counts as well; on a closed curve only once."""

    first: bool = False
    last: bool = False
    closed: bool = False


@dataclass(frozen=True)
class Found:
    """The events on one step, in order, and the candidates that failed their verification."""

    points: tuple[Point, ...]
    doubtful: tuple[Point, ...]
    after: tuple[Value, ...]  # the tests at the end of the step, 0 where an event was found there


def find(
    segment: Segment,
    events: Sequence[Event],
    before: Sequence[Value],
    after: tuple[Value, ...],
    *,
    crossing: Point | None,
    ends: Ends,
    earlier: tuple[float, Sequence[Value]] | None = None,
) -> Found:
    """All events on one step of a walk.

    `before` and `after` are the tests at its ends, `earlier` arclength and tests a step before it,
    `crossing` a branch point known to lie on it.

    Branch points come first. Next to them the corrector may end on the other curve, so all other
    events are looked for on the pieces of curve between them.
    """
    curve = segment.curve
    curve.passes(segment.last.z)
    quiet = set[int]()
    if earlier is not None and crossing is None and not (ends.first or ends.closed):
        pace = (segment.first.arclength - earlier[0]) / segment.length
        values = earlier[1], before, after
        quiet = calm(events, pace, *values, (segment.first, segment.last))
    trails = [
        Trail(segment, event, {0.0: before[i], 1.0: after[i]}, calm=i in quiet)
        for i, event in enumerate(events)
    ]
    for trail in trails:
        # those with a matrix say more of what is between than their values do
        trail.calm = trail.calm and not trail.foresee()
    if all(trail.calm for trail in trails):
        return Found((), (), after)
    tallies = [trail for trail in trails if trail.event.test is None]
    crossings = [trail for trail in trails if trail.event.crosses]
    others = [t for t in trails if t.event.test is not None and not t.event.crosses]
    for trail in (*crossings, *others):  # what has no test is looked at last, and at few places
        if not trail.calm:
            trail.glance(0.5)
    located = list(_events_on(crossings, ends))
    cuts = [p for p in located if "tangents" in p.detail] or ([crossing] if crossing else [])
    if cuts and others:
        located += _between(segment, cuts, others, ends)
    else:
        located += _events_on(others, ends)
    for trail in tallies:
        located += _explained(trail, others, located)
    located = _in_order(located, events)
    end = segment.last.arclength * (1 - 1e-15)
    at_end = {id(p.event) for p in located if p.located and p.arclength >= end}
    after = tuple(0 if id(t.event) in at_end and not t.jumps else t.values[1.0] for t in trails)
    if curve.problem.beneath is not None:
        located = list(_one_a_place(located))
    good = tuple(point for point in located if point.located)
    doubtful = _at_one_place([p for p in located if not p.located and not _seen_again(p, good)])
    return Found(good, doubtful, after)


def _in_order(points: Sequence[Point], events: Sequence[Event]) -> list[Point]:
    """Along the curve; what happens at one place, as far as rounding can tell, in the order of the
    events that were asked for."""
    order = {id(event): i for i, event in enumerate(events)}
    places: list[list[Point]] = []
    for point in sorted(points, key=lambda point: point.arclength):
        since = point.arclength - places[-1][-1].arclength if places else math.inf
        if since <= _AT_END * (1 + point.curve.length(point.z)):
            places[-1].append(point)
        else:
            places.append([point])
    # a branch point that the walk found by itself has no event among them
    return [p for place in places for p in sorted(place, key=lambda p: order.get(id(p.event), -1))]


def calm(
    events: Sequence[Event],
    pace: float,
    earlier: Sequence[Value],
    before: Sequence[Value],
    after: Sequence[Value],
    ends: tuple[Point, Point],
) -> set[int]:
    """Which tests are so far from zero, by the parabola through their last three values, and change
    so little that nothing is to be looked for within the step between two points; `pace` is the
    length of the step before, relative to this one."""
    tests = enumerate(zip(events, earlier, before, after, strict=True))
    return {i for i, (event, *values) in tests if _is_calm(event, ends, pace, *values)}


def _is_calm(
    event: Event, ends: tuple[Point, Point], pace: float, earlier: Value, start: Value, end: Value
) -> bool:
    if event.test is None:
        return start == end
    if math.isnan(start) and math.isnan(end):  # what is between has nothing to change from
        return not counts_apart(event, *ends)
    if (isinstance(start, int) and isinstance(end, int)) or not start * end > 0:
        return False
    bend = (end - start - (start - earlier) / pace) / (1 + pace)
    middle = (0.5 * (start + end) - 0.25 * bend) * (1 if start > 0 else -1)
    low, high = sorted((abs(start), abs(end)))
    flat = middle > _CALM * high and low > _FLAT * max(high, middle)
    return flat and earlier * start > 0 and not counts_apart(event, *ends)


def _one_a_place(points: Sequence[Point]) -> Iterator[Point]:
    """On a boundary: one label for all that is seen at one place, where several tests vanish at
    once. An event that ends the curve goes before one where others cross it, and that before the
    rest. Where nothing is verified, as for the values a user asks for, each keeps its own."""
    left = list(points)
    while left:
        first = left.pop(0)
        here, reach = [first], _SAME * (1 + first.curve.length(first.z))
        for other in left if _is_verified(first) else ():
            if _is_verified(other) and first.curve.length(other.z - first.z) <= reach:
                here.append(other)
        left = [other for other in left if not any(other is one for one in here)]
        best = max(here, key=_rank)
        also = {p.kind: None for p in here if p.located and p.kind != best.kind}
        yield replace(best, detail={**best.detail, "also": ", ".join(also)}) if also else best


def _is_verified(point: Point) -> bool:
    return point.event is not None and point.event.examine is not None


def _rank(point: Point) -> tuple[bool, bool, bool]:
    ends = point.event is not None and bool(point.event.ends)
    return point.located, ends, "tangents" in point.detail


def _at_one_place(doubtful: Sequence[Point]) -> tuple[Point, ...]:
    """Each place once for each event: what was seen there twice is two of them."""
    kept: list[Point] = []
    latest: dict[int, int] = {}  # for each event the place of its last point in the list
    for point in doubtful:
        near = GAP * (1 + point.curve.length(point.z))
        i = latest.get(id(point.event))
        if i is not None and point.arclength - kept[i].arclength <= near:
            kept[i] = replace(kept[i], detail={**kept[i].detail, "reason": _two(point.kind)})
        else:
            latest[id(point.event)] = len(kept)
            kept.append(point)
    return tuple(kept)


def _seen_again(point: Point, located: Sequence[Point]) -> bool:
    """Whether a branch point was located where it was seen, too: at the start of a walk rounding
    decides from which side it is come upon."""
    if point.event is None or not point.event.crosses:
        return False
    near = GAP * (1 + point.curve.length(point.z))
    same = (one for one in located if one.event is point.event)
    return any(abs(one.arclength - point.arclength) <= near for one in same)


def _two(kind: str) -> str:
    return f"two {kind} at once, or too close to be separated: not simple"


def _events_on(trails: Sequence[Trail], ends: Ends) -> Iterator[Point]:
    active = [trail for trail in trails if not trail.calm]
    for trail in active:
        yield from _at_ends(trail, ends)
        trail.foresee()
        for low, high, point in separated(trail):
            yield _special(trail, point, low, high)
        yield from _dipped(trail)
        yield from _closer(trail)
    for _ in range(_ROUNDS):
        fresh = [point for trail in active for point in _search(trail)]
        yield from fresh
        if not fresh:
            break
        active = list(trails)  # what happens at an event is news of the calm ones as well
        _look_at(trails, fresh)
        for trail in trails:
            yield from _dipped(trail)


def _dipped(trail: Trail) -> Iterator[Point]:
    if 0.5 not in trail.values or trail.jumps or trail.changes():
        return
    if not probe(trail):
        for low, high, point in bottom(trail):
            yield _special(trail, point, low, high)
    if isinstance(trail.event.test, Singular):
        trail.beside(*(middle for _, middle in trail.changes()[:-1]))


def _closer(trail: Trail) -> Iterator[Point]:
    """Two zeros that are close together, on a shorter piece of curve: on a long one its cubic may
    be further off than they are apart."""
    segment = trail.segment
    for left, right in trail.brackets():
        if segment.length < _POINT * (1 + segment.curve.length(segment.first.z)):
            trail.done.append((0.0, 1.0))
            point = segment.provisional(0.5 * (left + right))
            if abs(measure(trail.event, point)) >= min(abs(trail.values[u]) for u in (0.0, 1.0)):
                return  # what was seen is where the curve starts or ends
            yield _special(trail, point, left, right, _two(trail.event.kind))
            return
        try:
            piece = Segment(segment.at(left), segment.at(right), segment.tolerance)
        except Undefined:
            continue
        part = Trail(piece, trail.event, {})
        for u in _START:
            part.glance(u)
        trail.values[left], trail.values[right] = part.values[0.0], part.values[1.0]
        trail.sure |= {left, right}
        trail.done.append((left, right))
        for point in _events_on([part], Ends()):
            trail.zeros.append((point.arclength - segment.first.arclength) / segment.length)
            yield point


def _between(
    segment: Segment, cuts: Sequence[Point], trails: Sequence[Trail], ends: Ends
) -> Iterator[Point]:
    """Events on the pieces between branch points; a piece as short as rounding has none."""
    places = [segment.first, *sorted(cuts, key=lambda point: point.arclength), segment.last]
    values = [trail.values[0.0] for trail in trails]
    for start, end in itertools.pairwise(places):
        if end.arclength - start.arclength < ASIDE * segment.length:
            continue
        piece = Segment(start, end, segment.tolerance)
        middle = piece.provisional(0.5)
        parts = [
            Trail(
                piece,
                t.event,
                {0.0: value, 0.5: measure(t.event, middle), 1.0: measure(t.event, end)},
            )
            for t, value in zip(trails, values, strict=True)
        ]
        at_first, at_last = start is segment.first, end is segment.last
        for part in parts:
            if not at_last and _vanishes(part, part.values[1.0]):
                # its sign is rounding: what is seen here must not be seen to either side as well
                part.values[1.0] = math.nan
                yield _special(part, replace(end, located=True, detail={}), 1.0, 1.0)
        own = Ends(ends.first and at_first, ends.last and at_last, ends.closed and at_last)
        yield from _events_on(parts, own)
        values = [part.values[1.0] for part in parts]


def _vanishes(trail: Trail, value: Value) -> bool:
    """Whether a test is zero where curves cross, but for rounding."""
    beside = max(abs(trail.values[0.0]), abs(trail.values[0.5]))
    return not trail.jumps and abs(value) <= _AT_CUT * beside


def _at_ends(trail: Trail, ends: Ends) -> Iterator[Point]:
    """Events at the very start or end of the walk, within rounding."""
    segment = trail.segment
    if not (ends.first or ends.last or ends.closed) or trail.jumps:
        return
    start, end = trail.values[0.0], trail.values[1.0]
    # the distance at which the test would vanish, the same whatever the length of the step
    change = abs(end - start) / segment.length * (1 + segment.curve.length(segment.last.z))
    if ends.first and abs(start) < _AT_END * change:
        trail.values[0.0] = 0.0
        yield _at_end(trail, 0.0)
    elif (ends.last or ends.closed) and abs(end) < _AT_END * change:
        trail.values[1.0] = math.copysign(math.ulp(0.0), start)  # no change left to be found
        if ends.last:
            yield _at_end(trail, 1.0)


def _at_end(trail: Trail, u: float) -> Point:
    there = trail.segment.at(u)  # where it is known exactly already
    low, high, sharp = _polish(trail, u, u, u) or (u, u, there)
    return _special(trail, replace(there, detail=sharp.detail), low, high)


def _search(trail: Trail) -> Iterator[Point]:
    """Locate each change of one test that was not dealt with yet."""
    _make_sure(trail)
    for left, right in trail.changes():
        try:
            yield from _located(trail, left, right)
        except Undefined as error:
            middle = 0.5 * (left + right)
            trail.settle(middle, left, right)
            reason = f"{trail.event.kind} seen but not located: {error}"
            yield _special(trail, trail.segment.provisional(middle), left, right, reason)


def _make_sure(trail: Trail) -> None:
    """Replace values seen on the cubic by those on the curve, wherever a change depends on them."""
    while unsure := {u for pair in trail.changes() for u in pair} - trail.sure:
        for u in unsure:
            trail.known(u)


def _located(trail: Trail, left: float, right: float) -> Iterator[Point]:
    places: Iterable[Place | None] = (
        _jump(trail, left, right) if trail.jumps else [_zero(trail, left, right)]
    )
    for number, (low, high, point) in enumerate(filter(None, places)):
        if number == _MOST:
            trail.done.append((left, right))
            reason = f"more than {_MOST} changes of {trail.event.kind} within one step: no event"
            yield _special(trail, point, low, right, reason)
            return
        if trail.jumps:
            trail.settle_jump(low, high)
        else:
            trail.settle(0.5 * (low + high), left, right)
        yield _special(trail, point, low, high)


def _look_at(trails: Sequence[Trail], fresh: Sequence[Point]) -> None:
    """What happens at one event tells about the others: evaluate every test there."""
    for point, trail in itertools.product(fresh, trails):
        segment = trail.segment
        u = (point.arclength - segment.first.arclength) / segment.length
        if 0 < u < 1 and trail.event is not point.event:
            trail.learn(u, measure(trail.event, point))


# --- what no event explains -------------------------------------------------------------------


def _explained(trail: Trail, others: Sequence[Trail], located: Sequence[Point]) -> list[Point]:
    """Events of all others next to where a tally changes without one; where there are none, that
    place, as doubtful."""
    more: list[Point] = []
    segment = trail.segment
    for attempt in range(2):
        places = _places(segment, [*located, *more])
        jumps = [jump for pair in places if (jump := _changed(trail, *pair)) is not None]
        if not jumps or attempt:
            break
        for (low, high), *_ in jumps:
            for other, u in itertools.product(others, (low, high)):
                other.learn(u, measure(other.event, segment.provisional(u)))
        more += [point for other in others for point in _search(other)]
    for (low, high), before, after in jumps:
        reason = f"a count changes from {before} to {after}, and no event here explains it"
        more.append(_special(trail, segment.provisional(0.5 * (low + high)), low, high, reason))
    return more


def _places(segment: Segment, located: Sequence[Point]) -> list[tuple[float, float]]:
    """The pieces of a step between its events, and a little off them: there a count is rounding."""
    first = segment.first.arclength
    cuts = sorted((point.arclength - first) / segment.length for point in located)
    places = [0.0, *cuts, 1.0]
    pieces = []
    for i, (low, high) in enumerate(itertools.pairwise(places)):
        room = _BESIDE * (high - low)
        low, high = low + (room if i else 0.0), high - (room if i < len(cuts) else 0.0)
        if high - low > ASIDE:
            pieces.append((low, high))
    return pieces


def _changed(
    trail: Trail, low: float, high: float
) -> tuple[tuple[float, float], Value, Value] | None:
    """Where a tally changes on a piece of the step, and from what to what."""
    before, after = trail.known(low), trail.known(high)
    if math.isnan(before) or math.isnan(after) or before == after:
        return None
    while high - low > _TALLIED:
        middle = 0.5 * (low + high)
        value = trail.known(middle)
        if math.isnan(value):
            break
        low, high = (middle, high) if value == before else (low, middle)
    return (low, high), before, trail.known(high)


# --- zeros and jumps --------------------------------------------------------------------------


def _zero(trail: Trail, left: float, right: float) -> Place | None:
    """The zero of a float test in a bracket; None where what was seen on the cubic is not there."""
    a, b = float(trail.values[left]), float(trail.values[right])
    if b == 0:
        return right, right, _isolated(trail, right, left, right)
    crude, size = left + (right - left) * a / (a - b), abs(a) + abs(b)
    polished = _polish(trail, crude, left, right)
    if polished is not None:
        return polished
    if float(trail.look(left)) * float(trail.look(right)) > 0:
        trail.done.append((left, right))
        return None
    from scipy.optimize import brentq  # dear to import, and hardly ever needed

    try:
        u = brentq(trail.look, left, right, xtol=1e-15, rtol=1e-14, disp=False)
    except Undefined:
        return _at_crossing(trail, crude, size)
    polished = _polish(trail, u, left, right)
    if polished is not None:
        return polished
    point = trail.segment.at(u)
    if abs(measure(trail.event, point)) <= 1e-6 * size:
        return u - _NARROW, u + _NARROW, _isolated(trail, u, left, right)
    reason = f"the test of {trail.event.kind} changes sign without a zero: it jumps or has a pole"
    return u, u, replace(point, detail={"reason": reason}, located=False)


def _isolated(trail: Trail, u: float, left: float, right: float) -> Point:
    """The point at a zero, doubtful if the test is exactly zero beside it as well."""
    segment, event = trail.segment, trail.event
    point = segment.at(u)
    if measure(event, point) != 0:
        return point
    aside = ASIDE + 1e-12 * (1 + segment.curve.length(point.z)) / segment.length
    beside = [v for v in (u - aside, u + aside) if left < v < right]
    if all(measure(event, segment.at(v)) != 0 for v in beside):
        return point
    reason = f"the test of {event.kind} is zero along a piece of the curve, which is not a place"
    return replace(point, detail={"reason": reason})


def _at_crossing(trail: Trail, u: float, size: float) -> Place:
    """A zero where another curve crosses as well, as grazing does at a pitchfork: the corrector
    fails beside it, so the branch point is solved for."""
    segment = trail.segment
    found = crossing(segment.curve, segment.provisional(u).z)
    place, point = segment.settled(found.solution, found.tangents)
    if abs(measure(trail.event, point)) > 1e-6 * size:
        raise Undefined("a branch point is in the way")
    return place - ASIDE, place + ASIDE, point


def _jump(trail: Trail, left: float, right: float, attempt: float = 0.3) -> Iterator[Place]:
    """Each jump of an integer test in a bracket: by its locus once that agrees, else bisection.

    The locus is tried when the bracket has shrunk to `attempt`, and then at every eighth of it.
    """
    middle = 0.5 * (left + right)
    if right - left < attempt:
        attempt = (right - left) / 8
        polished = _polish(trail, middle, left, right)
        if polished is not None:
            yield polished
            return
    if right - left < _SHARP:
        yield left, right, trail.segment.at(middle)
        return
    trail.values[middle] = trail.look(middle)
    trail.sure.add(middle)
    for low, high in ((left, middle), (middle, right)):
        if trail.values[low] != trail.values[high]:
            yield from _jump(trail, low, high, attempt)


def _polish(trail: Trail, u: float, left: float, right: float) -> Place | None:
    """Newton's iteration on problem and locus together, if it ends inside the bracket at a place
    where the test does change."""
    segment, event = trail.segment, trail.event
    if event.locus is None:
        return None
    try:
        found, detail = _solved(event.locus, trail.place(u), segment.tolerance)
        if not found.converged:
            return None
        place, point = segment.settled(found, detail.get("tangents", ()))
        if not left - ASIDE <= place <= right + ASIDE:
            return None
        low, high = place - ASIDE, place + ASIDE
        if not event.crosses and not _changes_across(segment, event, low, high):
            return None
    except OUT_OF_DOMAIN:
        return None  # the locus has no value here: location goes on without it
    return low, high, replace(point, detail=detail)


def _changes_across(segment: Segment, event: Event, low: float, high: float) -> bool:
    before, after = measure(event, segment.at(low)), measure(event, segment.at(high))
    if isinstance(before, int):
        return before != after
    return before * after <= 0


def _solved(
    locus_at: Callable[[Point], Locus], near: Point, tolerance: float
) -> tuple[Solution, Mapping[str, Any]]:
    """Solve the problem and the conditions of an event for everything at once."""
    if isinstance(locus_at, Crossings):
        return locus_at.solve(near)
    locus = locus_at(near)
    own = {f"{name} of the locus": value for name, value in locus.extra.items()}
    problem = extended(near.curve, replace(locus, extra=own))  # names that no problem has
    curve, n = Curve(problem, ()), near.curve.size
    start = np.concatenate([near.x, problem.x[n:-1], near.z[-1:]])
    found = curve.newton(start, tolerance=min(tolerance, _LOCATED))
    known = Point(curve, found.z)
    detail = {name: known[long] for name, long in zip(locus.extra, own, strict=True)}
    return replace(found, z=np.append(found.z[:n], found.z[-1])), detail


def _special(trail: Trail, point: Point, low: float, high: float, reason: str = "") -> Point:
    """The point with its kind, once it has been verified; doubtful for a reason."""
    event, start, length = trail.event, trail.segment.first.arclength, trail.segment.length
    around = (start + low * length, start + high * length)
    point = replace(point, kind=event.kind, event=event, bracket=around)
    found: Examined = reason or point.detail.get("reason", "")
    if not found and event.examine is not None:
        found = event.examine(point)
    if isinstance(found, str) and found:
        return replace(point, located=False, detail={**point.detail, "reason": found})
    known = dict(found or {})
    if isinstance(event.test, Level):
        known["level"] = str(event.test)
    kind = known.pop("kind", point.kind)
    return replace(point, kind=kind, detail={**point.detail, **known})
