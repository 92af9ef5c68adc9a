"""One orbit, many descriptions: its mirror image, other impacts first, a smaller problem.

Where the forcing changes sign after pi ``u(t) -> -u(t + pi)`` makes an orbit of an orbit, and so do
exchanges of sites that the lattice does not tell apart. What then hits the same walls in the same
order, begun with another impact, solves the same equations.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np

from contbreather.errors import BadInput
from contbreather.lattice.finite import ROWS, Lattice
from contbreather.orbits.orbit import Orbit, suitable
from contbreather.orbits.section import SAME, Impact, Section

ALIKE = 1e-9  # answers of sites to each other that differ by less, relative to the largest


def images_of(orbit: Orbit) -> Iterator[Orbit]:
    """Images of an orbit under shifts by pi, 2 pi, ... with their signs, and exchanges of alike
    sites, among those that have the same sequence of impacts; each begins with the impact that
    comes closest in time to the first one. A shift of half a symmetric orbit is itself."""
    # by odd multiples of pi the walls change places
    step = 1 if orbit.conditions.symmetric else 2  # in half periods of the forcing
    shifts = range(0, 1 if orbit.symmetric else 2 * orbit.section.turns, step)
    hit, walls = orbit.section.hit, orbit.walls
    others = any(site not in hit for site, _ in walls.own)  # of idle sites, which may be exchanged
    orders = [order for order in _exchanges(_answers(orbit)) if _idle_alike(orbit, order)]
    for order, shift in product(orders, shifts):
        places = {site: hit[i] for site, i in zip(hit, order, strict=True)}
        moved = [(walls.at(site), walls.at(to)) for site, to in places.items() if site != to]
        if (not moved and not shift) or (moved and (others or any(a != b for a, b in moved))):
            continue
        image = shifted(orbit, shift, places)
        if image is not None:
            yield image


def _answers(orbit: Orbit) -> Any:
    """Answers of the sites that hit to impacts of each other, up to a function of all."""
    hit, lattice = np.array(orbit.section.hit), orbit.lattice
    if lattice.sites is None:
        return abs(hit[:, None] - hit)
    basis = lattice.basis(orbit.section.hit)
    shapes = basis.at(hit)  # (1 + L)^-1 between these sites
    between = (shapes / (1.0 + basis.lam)) @ shapes.T * lattice.masses[hit]
    return between + np.diag(_own(lattice)[hit])


def _own(lattice: Any) -> Any:
    """A number for each site, of all that sets its motion apart but for the bonds."""
    # incommensurable weights: no usual mass makes up for another drive
    weights = np.sqrt([2.0, 3.0, 5.0, 7.0, 11.0])
    return np.dot(weights, [getattr(lattice, name) for name in ROWS])


def _exchanges(answers: Any, first: tuple[int, ...] = ()) -> Iterator[tuple[int, ...]]:
    """Orders in which they are the same, of those that begin so."""
    n = len(first)
    if n == len(answers):
        yield first
        return
    for i in sorted({*range(len(answers))} - {*first}):
        off = answers[i, [*first, i]] - answers[n, : n + 1]
        if abs(off).max() <= ALIKE * abs(answers).max():
            yield from _exchanges(answers, (*first, i))


def _idle_alike(orbit: Orbit, order: tuple[int, ...]) -> bool:
    """Test if the others cannot tell that order from the first: on some trees two sites answer each
    other alike that no symmetry exchanges."""
    lattice, hit = orbit.lattice, orbit.section.hit
    if not isinstance(lattice, Lattice) or order == (*range(len(order)),):
        return True  # of a chain or a ring every exchange is a symmetry
    basis = lattice.basis(hit)
    answers = (basis.shapes / (1.0 + basis.lam)) @ basis.at(hit).T
    key = _own(lattice)
    # one number for each site, of all that it is and does
    weights = np.sqrt(2.0 + np.arange(len(order)))
    before, after = np.sort([answers @ weights + key, answers[:, list(order)] @ weights + key])
    return bool(abs(before - after).max() <= ALIKE * abs(before).max())


def shifted(orbit: Orbit, shift: int, places: Mapping[int, int] | None = None) -> Orbit | None:
    """``(-1)^shift u(t + shift pi)`` with the same sequence of impacts, if it has that; on other
    sites, by number, where there are `places`.
    """
    section, sign, places = orbit.section, -1 if shift % 2 else 1, places or {}
    moved = [
        Impact(places.get(n, n), sign * wall, t - shift * math.pi, sign * J)
        for n, wall, t, J in sorted(orbit.impacts, key=lambda impact: impact.time)
    ]
    fits: list[tuple[float, int, Any, list[Impact]]] = []
    m, course = section.count, section.course(moved, 3)
    for start in range(m if section.sign > 0 else 2 * m):  # with each impact of a period first
        if impacts := _named(course[start : start + m], section):
            times = np.array([impact.time for impact in impacts])
            times -= orbit.period * round((times[0] - orbit.times[0]) / orbit.period)
            fits.append((float(abs(times - orbit.times).sum()), len(fits), times, impacts))
    if not fits:
        return None
    _, _, times, impacts = min(fits)
    impulses = [impact.impulse for impact in impacts]
    at = {places.get(n, n): sign * c for n, c in zip(section.hit, orbit.offsets, strict=False)}
    offsets = [at[n] for n in section.hit if at]
    try:
        representation = type(orbit.representation).through(
            orbit.representation.conditions, section, times, impulses, offsets
        )
    except BadInput:  # two sites at once, in an order that no section has
        return None
    same = representation.error < SAME + orbit.residual
    return replace(orbit, representation=representation) if same else None


def _named(window: Sequence[Impact], section: Section) -> list[Impact]:
    """Impacts in the order of a section, which sites may interchange; empty if it has others."""
    of_site: dict[int, deque[Impact]] = {n: deque() for n in section.hit}
    for impact in window:
        of_site[impact.site].append(impact)
    impacts = [of_site[n].popleft() for n, _ in section.impacts if of_site[n]]
    return impacts if tuple(impact[:2] for impact in impacts) == section.impacts else []


def simpler_than(orbit: Orbit) -> Orbit | None:
    """This motion with fewer impacts: a part of its period, or half of it, mirrored."""
    on = orbit.representation.conditions
    for section in orbit.parts():
        if section.symmetric and max(map(abs, orbit.offsets), default=0.0) > SAME:
            continue
        kind, impacts = next(suitable(on, section), None), orbit.first_of(section)
        if kind is None or not impacts:
            continue
        _, _, times, impulses = zip(*impacts, strict=True)
        motion = kind.through(on, section, times, impulses, orbit.offsets)
        if motion.error < SAME:
            return replace(orbit, representation=motion)
    return None
