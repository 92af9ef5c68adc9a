"""Several zeros of one test within a step, which may leave no change of sign."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

from .newton import OUT_OF_DOMAIN
from .point import Point
from .trail import Trail, count_at, counts_apart, measure

Place = tuple[float, float, Point]  # bracket and point

_APART = 1e-4  # two zeros of one test closer than this, relative to the step, may be one
_ONE = 1e-6  # zeros closer than this, relative to the step, are taken for one by their count
_LOOKS = 400  # places looked at between several zeros of one step
_LOW = 0.1  # a test this small within a step, relative to its ends, may vanish there
_TOUCH = 1e-5  # and one this small does
_STEEPER = 4.0  # how much steeper than beside it a test may be where it is least


def separated(trail: Trail) -> Iterator[Place]:
    """Look between several zeros, where their count changes by more than one, so that each leaves
    its change of sign. Those that are at one place are doubtful."""
    event = trail.event
    if event.count is None:
        return
    place = trail.place
    if not counts_apart(event, trail.segment.first, trail.segment.last):
        return
    counts = {u: count_at(event, place(u)) for u in (0.0, 1.0)}
    size = _TOUCH * max(abs(trail.values[u]) for u in counts)
    pieces, looks = [(0.0, 1.0)], 0
    while pieces:
        left, right = pieces.pop()
        if abs(counts[left] - counts[right]) < 2:
            continue
        looks += 1
        if looks > _LOOKS:
            reason = f"the count of {event.kind} changes too often within one step to tell all"
            yield _doubtful(trail, left, right, place(0.5 * (left + right)), reason)
            return
        middle = 0.5 * (left + right)
        try:
            point = place(middle)
            value, counts[middle] = measure(event, point), event.count(point)
        except OUT_OF_DOMAIN:  # nothing can be seen there
            continue
        if right - left > _ONE:
            trail.values[middle] = value
            trail.sure.add(middle)
            pieces += [(left, middle), (middle, right)]
        elif abs(value) < size and not trail.sign_changes(left, right):
            reason = f"two {event.kind} at once, or too close to be separated: not simple"
            yield _doubtful(trail, left, right, point, reason)


def _doubtful(trail: Trail, left: float, right: float, point: Point, reason: str) -> Place:
    trail.zeros.append(0.5 * (left + right))
    return left, right, replace(point, detail={"reason": reason})


def probe(trail: Trail) -> bool:
    """Whether a test that keeps its sign dips through zero and back within the step, as smooth
    tests do."""
    places = [0.0, 0.5, 1.0]
    for _ in range(4):
        values = [trail.deflated(u) for u in places]
        if not all(math.isfinite(value) and value != 0 for value in values):
            return False
        vertex, depth = _parabola(places, values)
        nearest = min(values, key=abs)
        if not places[0] < vertex < places[2] or depth / nearest > 0.3:
            return False
        if min(abs(vertex - u) for u in places) < 1e-6:
            return False
        if any(abs(vertex - zero) < _APART for zero in trail.zeros):
            return False
        trail.glance(vertex)
        if trail.changes():
            return True
        around = sorted([*places, vertex])
        lowest = min(range(1, 3), key=lambda i: abs(trail.deflated(around[i])))
        places = around[lowest - 1 : lowest + 2]
    return False


def _parabola(u: list[float], f: list[float]) -> tuple[float, float]:
    """Place and value of the vertex of the parabola through three points."""
    slope = (f[1] - f[0]) / (u[1] - u[0])
    bend = ((f[2] - f[1]) / (u[2] - u[1]) - slope) / (u[2] - u[0])
    if bend == 0:
        return math.inf, math.inf
    vertex = 0.5 * (u[0] + u[1] - slope / bend)
    return vertex, f[0] + (vertex - u[0]) * (slope + bend * (vertex - u[1]))


def bottom(trail: Trail) -> Iterator[Place]:
    """Look where the size of a test may have a kink at zero, as the least of several does: on the
    line through the middle of the step and one end of it, and from there downhill."""
    size = {u: abs(trail.deflated(u)) for u in (0.0, 0.5, 1.0)}
    if not all(0 < value < math.inf for value in size.values()):
        return
    highest, middle = max(size.values()), size[0.5]
    for end in (0.0, 1.0):
        if 2 * middle < size[end]:
            u = 0.5 + (0.5 - end) * middle / (size[end] - middle)
            if min(abs(u - known) for known in size) > _ONE:
                near = measure(trail.event, trail.segment.provisional(u))
                size[u] = abs(trail.deflated(u, near))
    places = sorted(size)
    at = min(range(len(places)), key=lambda i: size[places[i]])
    if not 0 < at < len(places) - 1 or size[places[at]] > _LOW * highest or trail.changes():
        return
    around = (places[at - 1], places[at + 1])
    left, right = _downhill(trail, around, [size[u] for u in around], _TOUCH * highest)
    u = 0.5 * (left + right)
    if _ONE < u < 1 - _ONE and not trail.changes():  # at an end it only approaches zero
        point = trail.segment.provisional(u)
        if abs(trail.deflated(u, measure(trail.event, point))) < _TOUCH * highest:
            reason = f"the test of {trail.event.kind} touches zero: none, or two at once"
            yield _doubtful(trail, left, right, point, reason)


def _downhill(
    trail: Trail, bracket: tuple[float, float], sizes: list[float], enough: float
) -> tuple[float, float]:
    """Bracket of the least size of a test by golden section, unless its sign changes; no closer
    than shows that it stays above `enough`, even if it fell several times as fast inside."""
    golden = 0.5 * (math.sqrt(5) - 1)
    (left, right), (first, last) = bracket, sizes

    def size(u: float) -> float:
        return abs(trail.deflated(u, trail.glance(u)))

    one, other = right - golden * (right - left), left + golden * (right - left)
    low, high = size(one), size(other)
    while right - left > _ONE and not trail.changes():
        steepest = max(abs(first - low) / (one - left), abs(last - high) / (right - other))
        if min(low, high) - _STEEPER * steepest * (right - left) > enough:
            break
        if low < high:
            right, last, other, high = other, high, one, low
            one = right - golden * (right - left)
            low = size(one)
        else:
            left, first, one, low = one, low, other, high
            other = left + golden * (right - left)
            high = size(other)
    return left, right
