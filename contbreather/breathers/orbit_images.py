"""One orbit, many descriptions: its mirror image, other impacts first, a smaller problem.

The forcing changes sign after pi, so ``u(t) -> -u(t + pi)`` makes an orbit of an orbit. If that
hits the same walls in the same order, begun with another impact, it solves the same equations.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from contbreather.breathers.impacts import Impact
from contbreather.breathers.orbits import Orbit
from contbreather.breathers.symmetric import Breather

SAME = 1e-7  # times, impulses and offsets that differ by less are equal


def mirrored(orbit: Orbit) -> Orbit:
    """The mirror image ``u(t) -> -u(t + pi)``: with antisymmetric forcing it is an orbit as well.

    Of two impacts the one on the wall +1 comes first again.

    Examples
    --------
    >>> from contbreather.breathers.arms import asymmetric
    >>> one = asymmetric(0.82, 0.04, 0.8)
    >>> abs(mirrored(one).displacement(0, 1.0) + one.displacement(0, 1.0 + math.pi)) < 1e-14
    True
    """
    turned = [Impact(i.site, -i.wall, i.time - math.pi, -i.impulse) for i in orbit.impacts]
    if orbit.two_impacts:
        first, second = turned
        turned = [second, first._replace(time=first.time + 2.0 * math.pi)]
    return replace(orbit, impacts=tuple(turned), offsets=tuple(-c for c in orbit.offsets))


def images_of(orbit: Orbit) -> Iterator[Orbit]:
    """What the shifts by pi, 2 pi, ... with their signs make of an orbit, among those that have the
    same sequence of impacts."""
    T = orbit.period
    for shift in range(1, 2 * orbit.periods):
        sign = -1 if shift % 2 else 1
        impacts = [
            Impact(i.site, sign * i.wall, i.time - shift * math.pi, sign * i.impulse)
            for i in orbit.impacts
        ]
        image = _in_line(orbit, impacts, T)
        if image is not None:
            yield replace(orbit, impacts=image, offsets=tuple(sign * c for c in orbit.offsets))


def _in_line(orbit: Orbit, impacts: list[Impact], T: float) -> tuple[Impact, ...] | None:
    """The impacts in the order of the orbit's own sequence, begun as close in time as can be."""
    found = []
    for start in range(len(impacts)):
        later = [one._replace(time=one.time + T) for one in impacts[:start]]
        order = [*impacts[start:], *later]
        if tuple((one.site, one.wall) for one in order) == orbit.sequence:
            turns = round((order[0].time - orbit.impacts[0].time) / T)
            found.append(tuple(one._replace(time=one.time - turns * T) for one in order))
    first = orbit.impacts[0].time
    return min(found, key=lambda order: abs(order[0].time - first), default=None)


def simpler_than(orbit: Orbit) -> Orbit | Breather | None:
    """The same motion with fewer impacts to a period, or as a symmetric breather, if it is one."""
    for parts in (2, 3, 5, 7):
        if orbit.periods % parts == 0 and (part := _part(orbit, parts)) is not None:
            return part
    if not orbit.two_impacts or orbit.impacts[0].site != 0:
        return None
    if max(abs(orbit.asymmetry), abs(orbit.c)) > SAME:
        return None
    phi = orbit.impacts[0].time + 0.5 * orbit.asymmetry
    return Breather(orbit.a, orbit.gamma, orbit.k, orbit.p, phi, orbit.forcing, orbit.lattice)


def _part(orbit: Orbit, parts: int) -> Orbit | None:
    """One of several equal parts of an orbit, if it consists of such."""
    m = len(orbit.impacts) // parts
    if m * parts != len(orbit.impacts) or orbit.sequence != orbit.sequence[:m] * parts:
        return None
    own = orbit.period / parts
    times = orbit.times.reshape(parts, m) - own * np.arange(parts)[:, None]
    impulses = orbit.impulses.reshape(parts, m)
    if max(np.ptp(times, axis=0).max(), np.ptp(impulses, axis=0).max()) > SAME:
        return None
    return replace(orbit, impacts=orbit.impacts[:m], periods=orbit.periods // parts)
