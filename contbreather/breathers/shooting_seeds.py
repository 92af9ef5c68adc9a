"""From whatever is known of an orbit to a first guess at its impacts: times and a state.

A seed is a breather, an orbit or a point of a branch, a simulated state, or impact times alone. Its
motion is followed exactly until its impacts are known; where only times are given, the state is the
one that suits them best, which is a linear problem.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from contbreather.breathers.flight_map import Section
from contbreather.breathers.itinerary import Itinerary
from contbreather.breathers.refusals import ImpossibleSequence
from contbreather.breathers.ring_orbit import RingOrbit
from contbreather.errors import BadInput, NotConverged
from contbreather.flows.modes import Turn, driven, turn
from contbreather.lattice import Ring
from contbreather.lattice.conditions import Conditions
from contbreather.lattice.finite import Basis, Finite

FloatArray = NDArray[np.float64]

GRID = 96  # times in a half period at which contacts are looked for
MOST = 200  # impacts in one section
TOGETHER = 8  # digits to which the times of impacts are compared
OUTSIDE = 1e-6  # a seed may be beyond a wall by this much


@dataclass(frozen=True)
class Contact:
    """One impact of a seed in free motion."""

    site: int
    wall: int
    time: float


class Motion:
    """A lattice in motion, all its sites: flown until something touches a wall, then reset."""

    def __init__(
        self,
        on: Conditions,
        lattice: Finite,
        state: tuple[Any, Any],
        time: float,
        *,
        walls: bool = True,
    ) -> None:
        u, v = _rows(state)
        self.walls = np.array([on.walls.at(n) for n in range(u.size)]).T
        beyond = np.maximum(u - self.walls[1], self.walls[0] - u)
        n = int(beyond.argmax())
        if walls and beyond[n] > OUTSIDE:
            low, high = on.walls.at(n)
            raise BadInput(
                f"u[{n}] = {u[n]:.9g} of the seed is outside the walls at {low:g} and {high:g}."
            )
        if not math.isfinite(time):
            raise BadInput(f"t = {time!r}: the time of a state must be a finite number.")
        self.on, self.time, self.lattice = on, float(time), lattice
        self.basis: Basis = lattice.basis(tuple(range(u.size)))
        self.forced = driven(lattice, on.forcing, on.gamma, on.spring, on.damping)
        self.q = self.basis.from_sites(u - on.a * self.forced.everywhere(self.time, 0))
        self.r = self.basis.from_sites(v - on.a * self.forced.everywhere(self.time, 1))
        self.z = on.gamma * self.basis.lam + on.spring

    def turned(self, ahead: Any) -> Turn:
        """The free flight over some time."""
        return turn(self.z, ahead, self.on.damping)

    def gap(self, site: int, wall: int, ahead: float) -> float:
        """Distance of a site from a wall some time ahead."""
        q = self.turned(ahead)(self.q, self.r)[0]
        forced = self.on.a * self.forced.at(site, self.time + ahead)[0]
        place = self.on.walls.position(site, wall)
        return wall * (place - float(self.basis.at(site).dot(q)) - forced)

    def next(self, limit: float) -> Contact | None:
        """Fly to the first contact of any site within a time ahead."""
        step = math.pi / GRID / max(1, self.on.forcing.highest // 4)
        ahead = np.append(np.arange(0.0, limit, step), limit)
        flown = self.turned(ahead[:, None])
        u = self.basis.to_sites(flown.cosine * self.q + flown.reach * self.r)
        u += self.on.a * self.forced.everywhere(self.time + ahead, 0)
        low, high = self.walls
        beyond = (u > high) | (u < low)
        # a site that has just been reset, or starts on its wall, leaves it
        inside = np.logical_or.accumulate(~beyond, axis=0)
        hit = np.argwhere(beyond[1:] & inside[:-1])
        if not hit.size:
            return None
        i = int(hit[0, 0])
        found = []
        for site in hit[hit[:, 0] == i, 1].tolist():
            wall = 1 if u[i + 1, site] > high[site] else -1
            found.append((self._touch(site, wall, ahead[i], ahead[i + 1]), site, wall))
        moment, site, wall = min(found)
        self.q, self.r = self.turned(moment)(self.q, self.r)
        self.time += moment
        return Contact(site, wall, self.time)

    def _touch(self, site: int, wall: int, before: float, after: float) -> float:
        if self.gap(site, wall, before) <= 0.0:
            return before
        return float(brentq(lambda s: self.gap(site, wall, s), before, after, xtol=1e-15))

    def reset(self, site: int) -> None:
        """Let a site bounce off the wall it is on."""
        e = self.basis.at(site)
        velocity = float(e.dot(self.r)) + self.on.a * self.forced.at(site, self.time)[1]
        self.r = self.r - (1.0 + self.on.k) * velocity * self.lattice.masses[site] * e

    def free(self) -> tuple[FloatArray, FloatArray]:
        """Displacements and velocities of all sites without the forced motion."""
        return self.basis.to_sites(self.q), self.basis.to_sites(self.r)


def _rows(state: tuple[Any, Any]) -> tuple[FloatArray, FloatArray]:
    """Displacements and velocities of a state, or what is wrong with them."""
    try:
        u, v = (np.array(row, dtype=float) for row in state)
    except (TypeError, ValueError) as error:
        raise BadInput(f"a state is a pair (u, v) of rows of numbers: {error}.") from error
    if u.ndim != 1 or u.shape != v.shape or not u.size:
        raise BadInput(
            f"a state is a pair (u, v) of rows of equal length; shapes {u.shape} and {v.shape} "
            "were given."
        )
    for name, row in (("u", u), ("v", v)):
        bad = np.flatnonzero(~np.isfinite(row))
        if bad.size:
            raise BadInput(f"{name}[{bad[0]}] = {row[bad[0]]} of the state is not finite.")
    return u, v


def flown(
    on: Conditions,
    lattice: Finite,
    state: tuple[Any, Any],
    time: float,
    sequence: Sequence[Any] | None,
    *,
    turns: int,
    symmetric: bool,
) -> Section:
    """A seed in motion, followed over one section: its impacts in order, and the state before the
    first of them.

    Raises
    ------
    BadInput
        If it has no impacts, or others than those of the sequence.
    """
    motion = Motion(on, lattice, state, time)
    T = math.pi * turns * (1.0 if symmetric else 2.0)
    met: list[Contact] = []
    states: list[tuple[FloatArray, FloatArray]] = []
    while len(met) < MOST:
        contact = motion.next(time + T - motion.time)
        if contact is None:
            break
        met.append(contact)
        states.append(motion.free())
        motion.reset(contact.site)
    told = " ".join(f"({one.site}, {one.wall:+d}) at t = {one.time:.6g}" for one in met[:12])
    if not met or len(met) == MOST:
        raise BadInput(
            f"the seed meets {'no wall' if not met else 'walls too often'} within a section of "
            f"length {T:.6g} from t = {time:.6g}: {told or 'it flies free'}; give another seed, or "
            "its impact times by hand."
        )
    met.sort(key=lambda one: (round(one.time, TOGETHER), one.site))
    sign, m = (-1 if symmetric else 1), len(met)
    # the motion goes on as it was, or turned over: three sections hold every start there is
    course = [
        Contact(one.site, sign**i * one.wall, one.time + i * T) for i in range(3) for one in met
    ]
    first = _start(course, sequence, lattice, symmetric, told)
    own = course[first : first + m]
    itinerary = Itinerary(lattice, tuple((c.site, c.wall) for c in own), turns, symmetric)
    side = sign ** (first // m)
    q, r = (side * itinerary.basis.from_sites(row) for row in states[first % m])
    period = itinerary.period
    times = np.array([one.time for one in own])
    times -= period * math.floor((times[0] + 0.5 * period) / period)
    return Section(itinerary, times, q, r, on)


def _start(
    course: list[Contact],
    sequence: Sequence[Any] | None,
    lattice: Finite,
    symmetric: bool,
    told: str,
) -> int:
    """Which of the impacts of three sections comes first in the itinerary."""
    m = len(course) // 3
    starts = range(2 * m if symmetric else m)
    if sequence is None:  # the first on the wall at +1, by choice
        return next((i for i in starts if course[i].wall > 0), 0)
    wanted = Itinerary(lattice, tuple(sequence), symmetric=symmetric).impacts
    for i in starts:
        if tuple((one.site, one.wall) for one in course[i : i + m]) == wanted:
            return i
    raise ImpossibleSequence(
        f"the seed does not hit its walls in the order {wanted}: followed over one section it "
        f"meets {told}; give that sequence, another seed, or the impact times by hand.",
        sequence=wanted,
        met=tuple((one.site, one.wall) for one in course[:m]),
    )


def listed_section(
    on: Conditions, itinerary: Itinerary, t: FloatArray, state: tuple[Any, Any], time: float
) -> Section:
    """From impacts that are known and a state in the flight before the first of them."""
    check_order(itinerary, t)
    # the seed may be inadmissible
    motion = Motion(on, itinerary.lattice, state, time, walls=False)
    motion.q, motion.r = motion.turned(float(t[0]) - time)(motion.q, motion.r)
    q, r = (itinerary.basis.from_sites(row) for row in motion.free())
    return Section(itinerary, t, q, r, on)


def by_hand(on: Conditions, itinerary: Itinerary, times: Mapping[str, float]) -> Section:
    """From impact times alone: the state that comes closest to all equations, which are linear
    in it.

    Raises
    ------
    BadInput
        If times are missing, or those of one site are not in the order of the itinerary.
    """
    names = [f"t{j + 1}" for j in range(itinerary.count)]
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
        raise BadInput(f"impact times {dict(times)}: finite numbers were wanted.")
    check_order(itinerary, t)
    K = itinerary.basis.lam.size
    rest = Section(itinerary, t, np.zeros(K), np.zeros(K), on)
    matrix = rest.jacobian()[:, t.size :]
    state: FloatArray = np.linalg.lstsq(matrix, -rest.residual())[0].astype(float)
    return Section(itinerary, t, state[:K], state[K:], on)


def check_order(itinerary: Itinerary, t: FloatArray) -> None:
    """`BadInput` unless the impacts of each site come in order, within one section."""
    for site in itinerary.hit:
        own = [j for j, (n, _) in enumerate(itinerary.impacts) if n == site]
        for j, later in zip(own, [*own[1:], own[0]], strict=True):
            length = t[later] - t[j] + (itinerary.length if later <= j else 0.0)
            if length <= 0.0:
                after = f"t{later + 1}" + (" + a section" if later <= j else "")
                raise BadInput(
                    f"impacts of site {site} out of order: t{j + 1} = {t[j]:.9g} does not come "
                    f"before {after} = {t[j] + length:.9g}; times of a site rise within one "
                    f"section of length {itinerary.length:.6g}."
                )


def moved(section: Section, lattice: Finite) -> Section:
    """The same impacts on another lattice, as a guess. From ring to ring the sites around the one
    that impacts keep their motion, new ones move like the farthest; elsewhere the state is the one
    that suits the impact times best."""
    itinerary, old = section.itinerary, section.itinerary.lattice
    rings = isinstance(lattice, Ring) and isinstance(old, Ring)
    if rings and not itinerary.local:
        raise BadInput(
            f"{itinerary.describe()}: an orbit of several impacting sites does not fit on a "
            f"{lattice.describe()} by itself; give a state of that ring, or impact times by hand."
        )
    home = lattice.sites if rings else math.inf
    impacts = tuple((int(site % home), wall) for site, wall in itinerary.impacts)
    new = Itinerary(lattice, impacts, itinerary.turns, itinerary.symmetric)
    if not rings:
        times = {f"t{j + 1}": float(time) for j, time in enumerate(section.t)}
        return by_hand(section.conditions, new, times)
    site, apart = itinerary.hit[0], np.arange(lattice.sites)
    apart = np.minimum(apart, lattice.sites - apart)
    rows: list[FloatArray] = []
    for modes in (section.q, section.r):
        own = np.roll(itinerary.basis.to_sites(modes), -site)
        rows.append(np.roll(own[np.minimum(apart, old.sites // 2)], site % lattice.sites))
    q, r = (new.basis.from_sites(row) for row in rows)
    return Section(new, section.t, q, r, section.conditions)


def checked(section: Section, iterations: int | None = None) -> None:
    """That a section that solves its equations is an orbit of its itinerary.

    Raises
    ------
    NotConverged
        If impacts come out of order, or a site moves away from the wall it should hit.
    """
    itinerary = section.itinerary

    def refuse(why: str) -> NotConverged:
        return NotConverged(
            f"Newton's iteration ends at impact times {section.t.round(9).tolist()}, which is no "
            f"orbit of {itinerary.describe()}: {why} Start closer to it.",
            residual=float(abs(section.residual()).max()),
            iterations=iterations,
            last=RingOrbit(section),
        )

    try:
        check_order(itinerary, section.t)
    except BadInput as error:
        raise refuse(str(error)) from error
    for one in section.impacts:
        if one.velocity * one.wall <= 0.0:
            raise refuse(
                f"at t = {one.time:.9g} site {one.site} comes to its wall from outside, with the "
                f"velocity {one.velocity * one.wall:.6g}."
            )
