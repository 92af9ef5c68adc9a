"""Beyond grazing: at GR the orbit with the impacts more, at VI the one with the impacts less.

At GR a site touches a wall with no velocity. In the impulse J of that contact the equations of the
longer section are smooth, and J = 0 solves them there, so that one curve of orbits with the impact
passes the place; those with J > 0, away from the wall, are orbits. The other way round an impact
whose impulse has become 0 is left out.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contbreather.continuation.algebra.derivatives import directional
from contbreather.continuation.branches.switching import Seed, SwitchingProblem
from contbreather.continuation.curve.curve import Curve
from contbreather.continuation.curve.point import Point
from contbreather.errors import BadInput
from contbreather.orbits.clearance import LIMIT, closest
from contbreather.orbits.orbit import Orbit, orbit_of
from contbreather.orbits.section import AT_ONCE, VANISHED, Impact
from contbreather.orbits.symmetries import simpler_than
from contbreather.stability.chain_map import RINGS

FloatArray = NDArray[np.float64]

_SIMULATED = {
    "fold": "both orbits end here, and a simulation of what is beyond goes elsewhere: to this "
    "branch farther on, if it comes back to there, or to a motion in which more hits its walls",
    "persists": "the orbit goes on beyond so, unstable as long as the impulse is small: a "
    "simulation leaves it",
}


@dataclass(frozen=True)
class GrazingSwitch(SwitchingProblem):
    """An orbit at GR or VI as a problem of other impacts."""

    point: Point = field(kw_only=True)  # on the branch that ends there
    contacts: tuple[Impact, ...] = field(kw_only=True)  # impacts on one of both branches only

    def seeds(self) -> tuple[Seed, ...]:
        """The start of the branch, and what becomes of the orbit: it "persists" as one with other
        impacts, beyond in the parameter, or both live on one side, a nonsmooth "fold"; the limit of
        |mu| J; and a sentence, "says", of that."""
        curve, here, (tangent, _) = Curve(self.problem, (self.free,)), self.point, self.tangents
        ahead, inside = self._grown(curve, curve.start, tangent), here.direction
        sites, opposed = sorted({c.site for c in self.contacts}), min(ahead) * max(ahead) <= 0.0
        tangent = math.copysign(1.0, ahead[0]) * tangent
        chatters = ""
        if here.solution.section.repeats and len(sites) == 1 and here.kind == "GR":
            chatters = (
                f"site {sites[0]} chatters: it comes back to its wall more and more often, which "
                "no list of impacts has; `simulate` goes on, with the site at rest on its wall for "
                "a while each time"
            )
        if opposed:
            raise BadInput(
                chatters
                or f"sites {sites} touch their walls at once, and impulses of some of them "
                "would have to pull where those of others push: no orbit has all these impacts"
            )
        longer = (
            (here.curve, here.z, inside) if here.kind == "VI" else (curve, curve.start, tangent)
        )
        inside = self._grown(here.curve, here.z, inside)[0] * inside[-1]
        what = "fold" if inside * tangent[-1] > 0.0 else "persists"
        detail: dict[str, Any] = {"beyond": what, "|mu| J": multiplier_at_grazing(*longer)}
        detail["says"] = f"{self._hit()}; {_SIMULATED[what]}"
        return (Seed(self.problem, curve.start, tangent, detail=detail, ends_at_once=chatters),)

    def _hit(self) -> str:
        """Say which impacts are on one of both branches only."""
        orbits = self.point.solution, Point(Curve(self.problem, ()), self.problem.x).solution
        section = max((orbit.section for orbit in orbits), key=lambda section: section.count)
        sites, (site, wall, _, _) = sorted({c.site for c in self.contacts}), self.contacts[0]
        in_a_row = section.impacts.count((site, wall))
        words = f"site {site} hits a wall"
        if len(sites) > 1:
            words = f"sites {', '.join(map(str, sites))} hit a wall"
        elif in_a_row > 1:
            times = "twice" if in_a_row == 2 else f"{in_a_row} times"
            words = f"site {site} hits its wall {times} in a row"
        return words + " no more" * (self.point.kind == "VI")

    def _grown(self, curve: Curve, z: FloatArray, way: FloatArray) -> FloatArray:
        """By how much impulses, or else distances from walls, grow along a curve."""
        sites, walls, times, _ = (np.array(row) for row in zip(*self.contacts, strict=True))
        orbit: Orbit = Point(curve, z).solution
        hits = np.array([impact[:3] for impact in orbit.impacts])
        late = abs(hits[:, 2] - times[:, None]) < AT_ONCE
        own = late & (hits[:, 0] == sites[:, None]) & (hits[:, 1] == walls[:, None])
        if own.any():
            slots = [curve.slots[f"J{j + 1}"] for j in own.argmax(axis=1)]
            return np.asarray(-walls * way[slots])

        def reached(z: FloatArray) -> FloatArray:
            displacement: FloatArray = Point(curve, z).solution.displacement(sites, times)
            return displacement

        # a difference whose sign says on which side sites are inside
        return -walls * directional(reached, z, 1e-6 * way)


def past_grazing(point: Point) -> GrazingSwitch:
    """Switch from GR to the orbit with impacts where sites touch their walls, from VI to the one
    without those that vanish.

    Examples
    --------
    >>> import contbreather as cb
    >>> ring = cb.symmetric(0.9, 0.05, 0.8, damping=0.02, lattice=cb.Ring(9))
    >>> end = cb.trace(ring, "a", towards="up").first("GR")
    >>> start = cb.switch(end, within={"a": (0.85, 1)})[0][0]
    >>> start.solution.section.describe(), start["beyond"]
    ('period 2 pi, impacts 0+ 1+ 8+, half of a symmetric orbit', 'fold')
    """
    orbit: Orbit = point.solution
    contacts, there = _vanished(orbit) if point.kind == "VI" else _touching(orbit)
    free, threshold = point.curve.free[-1], point.curve.problem.threshold
    problem = there.problem_beyond(threshold).having(free)
    return GrazingSwitch(problem, free, point=point, contacts=contacts)


def multiplier_at_grazing(curve: Curve, z: FloatArray, way: FloatArray) -> float:
    """Limit of |mu| J as J -> 0, along a curve that sets out where impacts have no impulse yet.

    Entries b of the saltations (19) of new impacts grow as 1/J. Where these come at p times of a
    section its map is a polynomial of degree p in 1/J, and the largest |mu| J^p tends to that of
    the leading coefficient, a p-th difference. J is the largest of their impulses; the p-th root
    counts mu from one of the times to the next, the same for half a period and the whole.
    """
    orbit: Orbit = Point(curve, z).solution
    on, T = orbit.representation.conditions, orbit.section.length
    new = abs(orbit.incoming) < VANISHED
    rates = np.array([way[curve.slots[f"J{j + 1}"]] for j in np.flatnonzero(new)])
    with np.errstate(divide="ignore"):
        entries = np.where(new, 0.0, orbit.entries)
    grow = np.zeros(new.size)  # b J, from b = (1 + k) u''/u' and J = -(1 + k) u'
    grow[new] = ((1.0 + orbit.at_impacts("k")) ** 2 * orbit.accelerations)[new] / rates
    grow *= abs(rates).max()
    times = np.sort((orbit.times[new] - orbit.times[0]) % T)
    p = int(np.count_nonzero(np.diff(times, append=times[0] + T) > AT_ONCE))
    maps = [orbit.representation.map_at(on, orbit.times, entries + j * grow) for j in range(p + 1)]
    if on.lattice.sites is None:  # no wave comes round within a section
        maps = [map.on_ring(RINGS[0] * orbit.section.turns) for map in maps]

    def leading(x: FloatArray) -> FloatArray:
        columns = np.stack([map.applied(x) for map in maps])
        return np.asarray(np.diff(columns, n=p, axis=0)[0] / math.factorial(p))

    # it leads to no more directions than there are impacts at once: nobody needs a matrix
    at_sites = np.stack([blow.shape for blow in maps[0].blows], axis=1)
    q, _ = np.linalg.qr(leading(np.kron(np.eye(2), at_sites)))
    return float(abs(np.linalg.eigvals(q.T @ leading(q))).max() ** (1.0 / p))


def _touching(orbit: Orbit) -> tuple[tuple[Impact, ...], Orbit]:
    """Contacts of a section with walls, and the orbit with impacts of impulse 0 there."""
    motion, section, first = orbit.motion, orbit.section, orbit.times.min()
    if motion.endless and abs(motion.far) < LIMIT:
        raise BadInput(
            "the far field touches the walls: all sites hit them from here on, as simulations of "
            "rings show"
        )
    worst = closest(motion)
    left, right, size = section.hit[0], section.hit[-1], orbit.lattice.sites
    reach = max(abs(worst.site - left), abs(worst.site - right))
    sites = np.arange(left - reach, right + reach + 1) if size is None else np.arange(size)
    # with its images under the symmetries of the forcing
    times = worst.time + math.pi * np.arange(round(section.length / math.pi))
    times = first + (times - first) % section.length
    u = motion.states(sites[:, None], times)[0]
    contacts = []
    for wall in (-1, 1):
        places = np.array([orbit.walls.position(int(site), wall) for site in sites])
        for i, j in np.argwhere(abs(u - places[:, None]) < LIMIT).tolist():
            site, t = int(sites[i]), float(times[j])
            own = [math.remainder(h.time - t, orbit.period) for h in orbit.hits if h.site == site]
            if not any(abs(late) < AT_ONCE for late in own):
                contacts.append(Impact(site, wall, t, 0.0))
    if not contacts and orbit.k == 0.0:
        raise BadInput(
            f"after its impact with k = 0 site {worst.site} is pushed into the wall: beyond it "
            "sticks there for a while, which is no orbit of impacts; `simulate` goes on"
        )
    if not contacts:
        raise BadInput(f"no site touches a wall but in its impacts: {orbit.admissibility().reason}")
    return tuple(contacts), orbit_with(orbit, (*orbit.impacts, *contacts))


def _vanished(orbit: Orbit) -> tuple[tuple[Impact, ...], Orbit]:
    """Impacts that have lost their velocity, and the orbit without them."""
    gone = abs(orbit.incoming) < VANISHED
    lost = tuple(impact for impact, is_gone in zip(orbit.impacts, gone, strict=True) if is_gone)
    left = [impact for impact in orbit.impacts if impact not in lost]
    if not lost:
        raise BadInput(
            "two impacts of a site at one wall have become one, none has vanished by itself: both "
            "do where they meet, and the curve goes no further; `simulate` goes on"
        )
    if not left:
        raise BadInput(
            "all impacts vanish: what is left is the lattice that follows its forcing alone, and "
            "just comes to its walls"
        )
    there = orbit_with(orbit, left)
    return lost, simpler_than(there) or there


def orbit_with(orbit: Orbit, impacts: Iterable[Impact]) -> Orbit:
    """The orbit with these impacts in order of time, as a guess."""
    listed = sorted(impacts, key=lambda impact: (impact.time, impact.site))
    section = replace(orbit.section, impacts=tuple(impact[:2] for impact in listed))
    _, _, times, impulses = zip(*listed, strict=True)
    if section.symmetric:
        return orbit_of(orbit.conditions, section, times, impulses)
    # offsets are those of sites that are held: a mean of the drive has moved those that were not,
    # and without one there is a single 0 for all
    motion, hit = orbit.motion, section.hit
    lifted = motion.on.a * np.take(motion.response.still()[0], hit, mode="clip")
    return orbit_of(orbit.conditions, section, times, impulses, motion.offset(hit) + lifted)
