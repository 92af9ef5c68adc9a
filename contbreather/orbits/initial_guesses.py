"""From whatever is known of an orbit to a first guess at its impacts: times and a state.

A seed is an orbit, a simulated state, or impact times alone. A state is followed exactly until its
impacts are known; where only times are given, the state is the one that suits them best, which is a
linear problem (`ExactModes.from_times`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contbreather.checks import state_rows
from contbreather.errors import BadInput
from contbreather.lattice.chain import Ring
from contbreather.lattice.conditions import Conditions
from contbreather.lattice.finite import Basis, Finite
from contbreather.lattice.modal_flow import ModalPropagator, driven_modes, propagator
from contbreather.orbits.exact_modes import ExactModes
from contbreather.orbits.orbit import Orbit
from contbreather.orbits.section import (
    Impact,
    ImpossibleSequence,
    Section,
    Sequenced,
    checked_impacts,
)

FloatArray = NDArray[np.float64]

GRID = 96  # times in a half period at which contacts are looked for
MOST = 200  # impacts in one section
TOGETHER = 8  # digits to which the times of impacts are compared
OUTSIDE = 1e-6  # a seed may be beyond a wall by this much
MEETS = 1e-9  # a site on its wall and faster than this on its way out meets it


class GuessedMotion:
    """A lattice in motion, all its sites: flown until something touches a wall, then reset."""

    def __init__(self, on: Conditions, state: Any, time: float) -> None:
        u, v = state_rows(state)
        lattice: Finite = on.lattice
        self.walls = np.array([on.walls.at(n) for n in range(u.size)]).T
        beyond = np.maximum(u - self.walls[1], self.walls[0] - u)
        n = int(beyond.argmax())
        if beyond[n] > OUTSIDE:
            low, high = on.walls.at(n)
            raise BadInput(
                f"u[{n}] = {u[n]:.9g} of the seed is outside the walls at {low:g} and {high:g}."
            )
        self.on, self.time = on, float(time)
        self.basis: Basis = lattice.basis(tuple(range(u.size)))
        self.forced = driven_modes(lattice, on.forcing, on.gamma, on.spring, on.damping)
        self.q = self.basis.from_sites(u - on.a * self.forced.everywhere(self.time, 0))
        self.r = self.basis.from_sites(v - on.a * self.forced.everywhere(self.time, 1))
        # w^2 of each mode
        self.z = on.gamma * self.basis.lam + on.spring

    def turned(self, ahead: Any) -> ModalPropagator:
        """The free flight over some time."""
        return propagator(self.z, ahead, self.on.damping)

    def gap(self, site: int, wall: int, ahead: float) -> float:
        """Distance of a site from a wall some time ahead."""
        q = self.turned(ahead)(self.q, self.r)[0]
        forced = self.on.a * self.forced.at(site, self.time + ahead)[0]
        place = self.on.walls.position(site, wall)
        return wall * (place - float(self.basis.at(site).dot(q)) - forced)

    def next(self, limit: float) -> Impact | None:
        """Fly to the first contact of any site within a time ahead."""
        # from the eighth harmonic on a forcing needs a finer grid
        step = math.pi / GRID / max(1, self.on.forcing.highest // 4)
        ahead = np.append(np.arange(0.0, limit, step), limit)
        flown = self.turned(ahead[:, None])
        u = self.basis.to_sites(flown.cosine * self.q + flown.reach * self.r)
        u += self.on.a * self.forced.everywhere(self.time + ahead, 0)
        low, high = self.walls
        beyond = (u > high) | (u < low)
        # a site that has just been reset, or starts on its wall, leaves it
        inside = np.logical_or.accumulate(~beyond, axis=0)
        # others may be past it by a rounding, where several meet their walls at once
        inside[0] |= self._meets(u[0])
        hit = np.argwhere(beyond[1:] & inside[:-1])
        if not hit.size:
            return None
        i = int(hit[0, 0])
        contacts = []
        for site in hit[hit[:, 0] == i, 1].tolist():
            wall = 1 if u[i + 1, site] > high[site] else -1
            contacts.append((self._touch(site, wall, ahead[i], ahead[i + 1]), site, wall))
        moment, site, wall = min(contacts)
        self.q, self.r = self.turned(moment)(self.q, self.r)
        self.time += moment
        return Impact(site, wall, self.time, math.nan)

    def _meets(self, u: FloatArray) -> NDArray[np.bool_]:
        """Whether sites on their walls or past them are on their way out."""
        v = self.basis.to_sites(self.r) + self.on.a * self.forced.everywhere(self.time, 1)
        return ((u > self.walls[1]) & (v > MEETS)) | ((u < self.walls[0]) & (v < -MEETS))

    def _touch(self, site: int, wall: int, before: float, after: float) -> float:
        if self.gap(site, wall, before) <= 0.0:
            return before
        from scipy.optimize import brentq  # dear to import

        return float(brentq(lambda s: self.gap(site, wall, s), before, after, xtol=1e-15))

    def reset(self, site: int) -> None:
        """Let a site bounce off the wall it is on."""
        e = self.basis.at(site)
        # (2): u' -> -k u', an impulse of -(1 + k) m u', of which e is each mode's share
        velocity = float(e.dot(self.r)) + self.on.a * self.forced.at(site, self.time)[1]
        self.r = self.r - (1.0 + self.on.k) * velocity * self.on.lattice.masses[site] * e

    def free(self) -> tuple[FloatArray, FloatArray]:
        """Displacements and velocities of all sites without the forced motion."""
        return self.basis.to_sites(self.q), self.basis.to_sites(self.r)


def from_state(
    on: Conditions,
    state: Any,
    time: float,
    sequence: Sequence[Any] | None,
    *,
    turns: int = 1,
    sign: int = 1,
) -> ExactModes:
    """A state of the lattice, followed over one section: its impacts in order, and the state before
    the first of them."""
    motion = GuessedMotion(on, state, time)
    T = math.pi * turns * (1.0 if sign < 0 else 2.0)
    impacts: list[Impact] = []
    states: list[tuple[FloatArray, FloatArray]] = []
    while len(impacts) < MOST:
        contact = motion.next(time + T - motion.time)
        if contact is None:
            break
        if not any(_again(contact, earlier, T) for earlier in impacts):
            impacts.append(contact)
            states.append(motion.free())
        motion.reset(contact.site)
    words = " ".join(f"({hit.site}, {hit.wall:+d}) at t = {hit.time:.6g}" for hit in impacts[:12])
    if not impacts or len(impacts) == MOST:
        raise BadInput(
            f"the seed meets {'no wall' if not impacts else 'walls too often'} within a section of "
            f"length {T:.6g} from t = {time:.6g}: {words or 'it flies free'}; give another seed, "
            "or its impact times by hand."
        )
    impacts.sort(key=lambda hit: (round(hit.time, TOGETHER), hit.site))
    # three sections hold every start there is: it goes on as it was, or turned over
    m, walls = len(impacts), tuple((hit.site, hit.wall) for hit in impacts)
    course = Section(walls, turns, sign).course(impacts, 3)
    first = _start(course, sequence, on.lattice, words)
    chosen = course[first : first + m]
    section = Section(tuple((c.site, c.wall) for c in chosen), turns, sign)
    basis = on.lattice.basis(section.hit)
    # each section repeats the one before with its sign
    q, r = (sign ** (first // m) * basis.from_sites(row) for row in states[first % m])
    times = np.array([hit.time for hit in chosen])
    # the first impact within half a period of 0
    times -= section.period * math.floor((times[0] + 0.5 * section.period) / section.period)
    return ExactModes(section, times, q, r, on)


def _again(contact: Impact, earlier: Impact, length: float) -> bool:
    """Whether a section that begins at an impact ends at it, too."""
    apart = contact.time - earlier.time - length
    return contact.site == earlier.site and abs(apart) < 10.0**-TOGETHER


def _beginning(course: Sequence[Impact], wanted: Sequenced) -> int | None:
    """Which of the impacts of three sections comes first in a sequence of one."""
    m, impacts = len(course) // 3, [(impact.site, impact.wall) for impact in course]
    return next((i for i in range(2 * m) if tuple(impacts[i : i + m]) == wanted), None)


def _start(
    course: Sequence[Impact], sequence: Sequence[Any] | None, lattice: Finite, words: str
) -> int:
    if sequence is None:  # the first on the wall at +1, by choice
        return next((i for i, impact in enumerate(course) if impact.wall > 0), 0)
    wanted = Section(checked_impacts(sequence)).placed(lattice).impacts
    if (first := _beginning(course, wanted)) is not None:
        return first
    m = len(course) // 3
    raise ImpossibleSequence(
        f"the seed does not hit its walls in the order {wanted}: followed over one section it "
        f"meets {words}; give that sequence, another seed, or the impact times by hand.",
        sequence=wanted,
        met=tuple((impact.site, impact.wall) for impact in course[:m]),
    )


def from_times(on: Conditions, section: Section, times: Mapping[str, float]) -> ExactModes:
    """From impact times alone, ``{"t1": ..., "t2": ...}``."""
    names = [f"t{j + 1}" for j in range(section.count)]
    unknown, missing = sorted(set(times) - set(names)), sorted(set(names) - set(times))
    if unknown or missing:
        raise BadInput(
            f"a seed by hand has one time for each impact, {names}: "
            f"missing {missing}, not known {unknown}."
        )
    try:
        t = np.array([float(times[name]) for name in names])
    except (TypeError, ValueError):
        t = np.array([math.nan])
    if not np.isfinite(t).all():
        raise BadInput(f"impact times {dict(times)}: finite numbers were expected.")
    return ExactModes.from_times(on, section, t)


def from_orbit(
    orbit: Orbit, on: Conditions, sequence: Sequence[Any] | None, sign: int | None
) -> ExactModes:
    """An orbit, however it was found, under conditions of a finite lattice; opened up, or shot as
    half of a symmetric one, if asked for.

    Exact modes are taken as they are. Of other orbits the impacts are known, and on a ring the
    state between them is that of the ring's own orbit.
    """
    if sign == -1 and not orbit.symmetric:
        raise BadInput("this orbit was not shot as a symmetric one; start from a breather.")
    if sign == 1:
        orbit = orbit.unfolded()
    if sequence is not None and not isinstance(orbit.representation, ExactModes):
        return _otherwise(orbit, on, sequence)
    if sequence is not None:
        wanted = Section(checked_impacts(sequence)).placed(orbit.lattice).impacts
        if wanted != orbit.section.impacts:
            raise BadInput(
                f"this orbit has the impacts {orbit.section.impacts}, not {wanted}; give a state "
                "or times for another sequence."
            )
    if isinstance(orbit.representation, ExactModes):
        if orbit.lattice == on.lattice:
            return replace(orbit.representation, conditions=on)
        if isinstance(on.lattice, Ring) and isinstance(orbit.lattice, Ring) and orbit.section.local:
            return replace(orbit.representation.resized(on.lattice), conditions=on)
    return ExactModes.from_times(on, orbit.section.on(on.lattice), orbit.times)


def _otherwise(orbit: Orbit, on: Conditions, sequence: Sequence[Any]) -> ExactModes:
    """Begin a seed with another impact; or put the same times at other sites."""
    section = replace(orbit.section, impacts=checked_impacts(sequence)).placed(on.lattice)
    m = orbit.section.count
    if section.count != m:
        raise BadInput(
            f"the seed has {m} impacts in a section, the sequence {section.impacts} "
            f"{section.count}: give impact times by hand."
        )
    former = orbit.section.placed(on.lattice)
    impacts = [
        Impact(*hit, *impact[2:]) for hit, impact in zip(former.impacts, orbit.impacts, strict=True)
    ]
    course = former.course(impacts, 3)
    first = _beginning(course, section.impacts) or 0
    return ExactModes.from_times(on, section, [impact.time for impact in course[first : first + m]])
