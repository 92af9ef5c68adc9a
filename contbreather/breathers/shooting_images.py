"""One orbit, many descriptions: its mirror image, other impacts first, a smaller problem.

The forcing changes sign after pi, so ``u(t) -> -u(t + pi)`` makes an orbit of an orbit. If that has
the same itinerary, begun with another of its impacts, it solves the same equations.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from contbreather.breathers.flight_map import Section
from contbreather.breathers.itinerary import Itinerary

SAME = 1e-7  # times and states that differ by less are equal


def images_of(section: Section) -> tuple[Section, ...]:
    """What the shifts by pi, 2 pi, ... with their signs make of an orbit of one site.

    Each begins with the impact that comes closest in time to the first one of the section. Half
    a symmetric orbit is its own image, and those of several sites are left alone.
    """
    if section.itinerary.symmetric or not section.itinerary.local:
        return ()
    # by odd multiples of pi the walls change places
    stride = 1 if section.conditions.walls.symmetric else 2
    shifts = range(stride, 2 * section.itinerary.turns, stride)
    found = (shifted(section, shift) for shift in shifts)
    return tuple(image for image in found if image is not None)


def shifted(section: Section, shift: int) -> Section | None:
    """``(-1)^shift u(t + shift pi)`` with the same itinerary, if it has that."""
    itinerary, sign = section.itinerary, (-1) ** shift
    m, T, first = itinerary.count, itinerary.length, float(section.t[0])
    best: Section | None = None
    for start in range(m):
        order = np.roll(np.arange(m), -start)
        walls = tuple((itinerary.impacts[j][0], sign * itinerary.impacts[j][1]) for j in order)
        if walls != itinerary.impacts:
            continue
        times = section.t[order] + T * (np.arange(m) >= m - start) - shift * math.pi
        times = times - T * round((float(times[0]) - first) / T)
        leg = section.legs[start]  # ends just before that impact
        image = replace(section, t=times, q=sign * leg.q_end, r=sign * leg.r_end)
        if best is None or abs(times[0] - first) < abs(best.t[0] - first):
            best = image
    return best


def simpler_than(section: Section) -> Section | None:
    """Half of an orbit whose halves are mirror images or the same, as one of its own problem."""
    itinerary = section.itinerary
    m, turns = itinerary.count, itinerary.turns
    if itinerary.symmetric or not itinerary.local or m % 2:
        return None
    sign = -1 if turns % 2 else 1  # of the second half, were it the first again
    if sign < 0 and not section.conditions.walls.symmetric:
        return None
    half, rest = itinerary.impacts[: m // 2], itinerary.impacts[m // 2 :]
    if rest != tuple((n, sign * wall) for n, wall in half):
        return None
    own = (
        Itinerary(itinerary.lattice, half, turns, symmetric=True)
        if sign < 0
        else Itinerary(itinerary.lattice, half, turns // 2)
    )
    leg = section.legs[m // 2]
    gaps = (
        section.t[m // 2 :] - section.t[: m // 2] - own.length,
        leg.q_end - sign * section.q,
        leg.r_end - sign * section.r,
    )
    if max(float(abs(gap).max()) for gap in gaps) > SAME:
        return None
    return replace(section, itinerary=own, t=section.t[: m // 2])
