"""One orbit, many descriptions: its mirror image, other impacts first, a smaller problem.

The forcing changes sign after pi, so ``u(t) -> -u(t + pi)`` makes an orbit of an orbit. If that
hits the same walls in the same order, begun with another impact, it solves the same equations.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from contbreather.breathers.orbit import Orbit
from contbreather.breathers.section import Impact, Section, Sequenced

SAME = 1e-7  # descriptions whose equations are off by less are right


def images_of(orbit: Orbit) -> Iterator[Orbit]:
    """What the shifts by pi, 2 pi, ... with their signs make of an orbit, among those that have the
    same sequence of impacts; each begins with the impact that comes closest in time to the first
    one. Half a symmetric orbit is its own image."""
    if orbit.symmetric:
        return
    # by odd multiples of pi the walls change places
    stride = 1 if orbit.walls.symmetric else 2
    for shift in range(stride, 2 * orbit.section.turns, stride):
        image = shifted(orbit, shift)
        if image is not None:
            yield image


def shifted(orbit: Orbit, shift: int) -> Orbit | None:
    """``(-1)^shift u(t + shift pi)`` with the same sequence of impacts, if it has that.

    Examples
    --------
    >>> from contbreather.breathers.arms import asymmetric
    >>> one = asymmetric(0.82, 0.04, 0.8)
    >>> other = shifted(one, 1)
    >>> abs(other.displacement(0, 1.0) + one.displacement(0, 1.0 + math.pi)) < 1e-14
    True
    """
    T, sign = orbit.period, -1 if shift % 2 else 1
    moved = [
        Impact(one.site, sign * one.wall, one.time - shift * math.pi, sign * one.impulse)
        for one in orbit.impacts
    ]
    first, found = orbit.impacts[0].time, []
    for start in range(len(moved)):
        order = [*moved[start:], *(one._replace(time=one.time + T) for one in moved[:start])]
        if tuple((one.site, one.wall) for one in order) == orbit.section.impacts:
            back = T * round((order[0].time - first) / T)
            impacts = tuple(one._replace(time=one.time - back) for one in order)
            found.append((abs(impacts[0].time - first), start, impacts))
    if not found:
        return None
    _, start, impacts = min(found)
    offsets = tuple(sign * c for c in orbit.offsets)
    road = orbit.road.rewritten(orbit.section, impacts, offsets, start, sign)
    return None if road is None else Orbit(road)


def simpler_than(orbit: Orbit) -> Orbit | None:
    """The same motion with fewer impacts: a part of its period, or half of it where the other half
    is its mirror image."""
    for section in _parts(orbit):
        if section.symmetric and max(map(abs, orbit.offsets), default=0.0) > SAME:
            continue
        impacts = _first_of(orbit, section)
        road = orbit.road.rewritten(section, impacts, orbit.offsets) if impacts else None
        if road is not None and road.error < SAME:
            return Orbit(road)
    return None


def _first_of(orbit: Orbit, section: Section) -> tuple[Impact, ...]:
    """The impacts of one of several equal parts, their mean; empty if the parts are not equal."""
    m = section.count
    part = np.arange(orbit.section.count // m)[:, None]
    times = orbit.times.reshape(-1, m) - section.length * part
    impulses = orbit.impulses.reshape(-1, m) * float(section.sign) ** part
    if max(np.ptp(times, axis=0).max(), np.ptp(impulses, axis=0).max()) > SAME:
        return ()
    means = zip(section.impacts, times.mean(axis=0), impulses.mean(axis=0), strict=True)
    return tuple(Impact(*impact, float(t), float(J)) for impact, t, J in means)


def _parts(orbit: Orbit) -> Iterator[Section]:
    """Sections of which the orbit may consist, going by its walls."""
    own, turns = orbit.section.impacts, orbit.section.turns
    if orbit.symmetric:
        return
    for parts in (2, 3, 5, 7):
        m = len(own) // parts
        if m and turns % parts == 0 and own == own[:m] * parts:
            yield Section(own[:m], turns // parts)
    m = len(own) // 2
    if turns % 2 and orbit.walls.symmetric and own == own[:m] + _mirrored(own[:m]):
        yield Section(own[:m], turns, -1)


def _mirrored(sequence: Sequenced) -> Sequenced:
    return tuple((site, -wall) for site, wall in sequence)
