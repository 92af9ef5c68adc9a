"""GR: a site comes to touch a wall that it must not touch. One test, one locus for every orbit.

The test is the clearance from the walls, the locus ``u = wall, u' = 0`` at an unknown time for the
site that is closest. VI: an impact itself loses its velocity, or two of them become one. CC: the
last impact of a section comes at once with the first of the next one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contbreather.continuation.algebra.newton import Undefined
from contbreather.continuation.curve.branch import Points
from contbreather.continuation.curve.curve import Curve
from contbreather.continuation.curve.point import CodimensionTwo, DefiningSystem, Event, Many, Point
from contbreather.continuation.curve.ties import chained
from contbreather.continuation.systems.defining_systems import linear_condition
from contbreather.orbits.beyond_grazing import orbit_with
from contbreather.orbits.clearance import (
    Clearance,
    closest,
    least_margin,
    measured_margins,
    of_flights,
    of_idle,
    smallest_margins,
)
from contbreather.orbits.margins import CONTACT, MARGIN, WHEN
from contbreather.orbits.orbit import Orbit
from contbreather.orbits.orbit_problem import breathers_along
from contbreather.orbits.section import AT_ONCE, VANISHED
from contbreather.orbits.site_motion import IMAGE, SiteMotion

Array = NDArray[np.float64]


@dataclass(frozen=True)
class GrazingSite:
    """One site whose local maximum is followed: on a wall, without velocity, at an unknown time."""

    site: int
    share: Array | None = None
    """Its share of the offsets where neither coupling nor springs hold it, unless it has none."""
    walker: Callable[..., Any] | None = None
    """Steps in machine code, with a wall first, as `DefiningSystem` has them."""
    further: tuple[Event, ...] = ()
    """Events that end its curve besides another contact."""
    scale: Callable[[Point], float] | None = None
    """Divisor of the margins of other contacts, where they vanish at such an end."""
    meets: Mapping[str, tuple[Event, ...]] = field(default_factory=dict)

    def locus(self, wall: float, t: float, **more: Any) -> DefiningSystem:
        conditions = partial(self._conditions, wall)
        walker = self.walker and partial(self.walker, wall)
        return DefiningSystem({"t": t}, conditions, self._derivative, walker=walker, **more)

    def _conditions(self, wall: float, curve: Curve, z: Array, extra: Array) -> Array:
        motion: SiteMotion = Point(curve, z).solution.motion
        u, v, _ = motion.at(self.site, float(extra[0]))
        share, offsets = self._share(motion), motion.representation.offsets
        if share is not None and offsets:
            u += float(share @ offsets - motion.offset(self.site))
        return np.array([u - wall, v])

    @chained
    def _derivative(self, curve: Curve, z: Array, extra: Array) -> Array:
        orbit: Orbit = Point(curve, z).solution
        share = self._share(orbit.motion)
        slopes = orbit.motion.slopes(self.site, float(extra[0]), curve.free, share)
        return in_unknowns(orbit, slopes, (*curve.problem.start, *curve.free, "t"))

    def _share(self, motion: SiteMotion) -> Array | None:
        return None if motion.on.gamma or motion.on.spring else self.share


def in_unknowns(orbit: Orbit, slopes: Mapping[str, Array], names: Iterable[str]) -> Array:
    """Slopes by names, side by side; also in half the momentum, ``|J| = 2p``, and the phase."""
    signs = np.sign(orbit.impulses)
    by_p = 2.0 * sum(sign * slopes[f"J{i}"] for i, sign in enumerate(signs, 1))
    slopes = {**slopes, "p": by_p, "phi": slopes["t1"]}
    still = np.zeros_like(slopes["t1"])
    return np.column_stack([slopes.get(name, still) for name in names])


def _margin(point: Point) -> float:
    return least_margin(point.solution.motion)


def _margins(points: Points) -> Many | None:
    along = breathers_along(points)
    return None if along is None else (along.margins(), None)


def _locus(point: Point) -> DefiningSystem:
    orbit = point.solution
    if orbit.vanishing is not None:  # with it may be others, that move alike
        return shallow_impact(orbit)
    worst = closest(orbit.motion)
    return _follow(orbit, worst.site, worst.time)


def _follow(orbit: Orbit, site: int, t: float) -> DefiningSystem:
    """Defining system of a site that touches a wall at a time."""
    section, motion = orbit.section, orbit.motion
    at_site = [hit.time for hit in orbit.hits if hit.site == site]
    # a contact this close to an impact of its site is that impact
    if any(abs(math.remainder(t - at, section.period)) < 1e-9 * section.period for at in at_site):
        return shallow_impact(orbit)
    displacement = motion.at(site, t)[0]
    place = min(motion.walls(site), key=lambda wall: abs(displacement - wall))
    followed = orbit.representation.grazing_site(site)
    other = _OtherContact("GR", site, _is_mirrored(orbit, site, t), followed.scale)
    events = *followed.further, other.event(), _VANISHING
    return followed.locus(place, t, events=events, meets=followed.meets)


def _is_mirrored(orbit: Orbit, site: int, t: float) -> bool:
    """Tell whether what a site does comes again at the other wall, of an orbit that is its own
    mirror image with its whole period written out."""
    if orbit.section.symmetric or orbit.section.turns % 2 == 0:
        return False
    now, later = (orbit.motion.at(site, at)[0] for at in (t, t + 0.5 * orbit.section.period))
    return bool(abs(now + later) < IMAGE)


def _examine(point: Point) -> dict[str, Any]:
    orbit = point.solution
    j = orbit.vanishing
    if j is None:
        return {"site": closest(orbit.motion).site}
    return {"kind": "VI", "site": orbit.impacts[j].site}


# GR, and VI where an impact itself loses its velocity
GRAZING = Event("GR", _margin, many=_margins, ends="domain", locus=_locus, examine=_examine)


@dataclass(frozen=True)
class _OtherContact:
    """Clearance of all else where a site touches its wall, by the kind of point that it is on whose
    curve: a local maximum at GR, an impact at VI. There the curve ends."""

    kind: str
    site: int
    mirrored: bool
    scale: Callable[[Point], float] | None = None
    gone: tuple[int, ...] = ()
    """Impacts that vanish, the first of them that contact."""

    def event(self) -> Event:
        base, name = Event("GR", self.margin, ends="domain", locus=self.locus), f"{self.kind}-GR"
        return CodimensionTwo(name, self.test, ends="domain", base=base, examine=self.examine)

    def closest(self, point: Point) -> Clearance:
        orbit: Orbit = point.solution
        t = orbit.times[self.gone[0]] if self.gone else point["t"]
        left = [impact for j, impact in enumerate(orbit.impacts) if j not in self.gone]
        motion = orbit_with(orbit, left).motion if self.gone else orbit.motion
        return smallest_margins(other_contacts(motion, self.site, t, mirrored=self.mirrored))

    def margin(self, point: Point) -> float:
        return self.closest(point).margin

    def test(self, point: Point) -> float:
        return self.margin(point) / (1.0 if self.scale is None else self.scale(point))

    def examine(self, point: Point) -> dict[str, Any]:
        other = self.closest(point)
        return {"site": other.site, "time": other.time}

    def locus(self, point: Point) -> DefiningSystem:
        where = point.detail
        return _follow(point.solution, where["site"], where["time"])


def _least_speed(point: Point) -> float:
    return float(point.solution.speeds.min())


# Where the last impact is lost a curve of GR crosses that of VI, on which all sites only touch.
_VANISHING = Event("GR-VI", _least_speed, ends="domain")


# --- what else may touch a wall there -------------------------------------------------------------

# The local maximum that grazes is a double zero of its margin. It is divided out, so that what is
# left vanishes where a second one comes to the wall.


def other_contacts(
    orbit: SiteMotion, site: int, t: float, *, mirrored: bool = False
) -> list[Clearance]:
    """Everything that may touch a wall besides the maximum of one site at one time, which does.

    With `mirrored` the orbit is a symmetric one with its whole period written out: the maximum at
    the other wall, half a period later, is the same again. On an arm it is not, and both come
    together at the pitchfork.

    The far field is not among them: its displacement lies between those of two neighbours far out,
    so it is never highest by more than rounding.

    Without coupling, or without an impact, all sites that do not hit follow the forcing alike, and
    margins vanish together, like the difference d of the motions. What is returned is
    ``m/(|m| + d)``, between -1 and 1, of the sign of each margin m and no zero that says nothing; 1
    where rounding decides that sign.
    """
    idle, period = [*orbit.idle], orbit.period
    if site not in orbit.hit and site not in idle:
        idle.append(site)
    near = {site, *orbit.beside}
    measured = measured_margins(orbit, idle, near, touching=site, time=t)
    gaps = [*of_flights(orbit, measured), *of_idle(orbit, measured)]
    if site not in orbit.hit:
        crests = measured.rows[-2:, : WHEN + 1].tolist()  # at its own wall, and at the other one
        if crests[1][MARGIN] == math.inf:
            crests.pop()
        own = [Clearance(margin, site, orbit.start + when % period) for margin, when in crests]
        gaps = own + gaps
    if mirrored:  # half a period later it touches the other wall, between its impacts, too
        late = t + 0.5 * period
        gaps = [
            gap
            for gap in gaps
            if gap.site != site or abs(math.remainder(gap.time - late, period)) > CONTACT
        ]
    apart = orbit.differences([gap.site for gap in gaps], site)
    return [
        # motions that differ by less touch together but for rounding
        gap._replace(margin=1.0 if d < 1e-12 else gap.margin / (abs(gap.margin) + d))
        for gap, d in zip(gaps, apart.tolist(), strict=True)
    ]


# --- an impact that vanishes ----------------------------------------------------------------------


def shallow_impact(orbit: Orbit) -> DefiningSystem:
    """An impact whose incoming velocity vanishes, where the equations hold with one of velocity 0;
    `Undefined` where they do not, or with k = 0. Others that do so there are its images under a
    symmetry of the orbit, and go with it.
    """
    speeds = abs(orbit.speeds)
    j, gone = int(speeds.argmin()), np.flatnonzero(speeds <= max(VANISHED, speeds.min()))
    slope = orbit.representation.speed_slope(j)
    if slope is None:
        raise Undefined("an impact itself loses its velocity: no grazing to follow")
    if orbit.k == 0.0:
        raise Undefined("with k = 0 a site rests on its wall: no orbit of impacts continues")
    meets: dict[str, tuple[Event, ...]] = dict.fromkeys(("BP", "NS"), ())
    events: list[Event] = [Event("VI-VI", partial(_others_last, gone), ends="domain")]
    if gone.size < orbit.section.count:  # else all sites follow the forcing, up to their walls
        site, _, t, _ = orbit.impacts[gone[0]]
        mirrored = _is_mirrored(orbit, site, t)
        events.append(_OtherContact("VI", site, mirrored, gone=tuple(gone.tolist())).event())
    return DefiningSystem({}, partial(_velocity, j), slope, events=tuple(events), meets=meets)


def _velocity(j: int, curve: Curve, z: Array, extra: Array) -> Array:
    velocity: Array = Point(curve, z).solution.incoming[j : j + 1]
    return velocity


def _others_last(gone: NDArray[np.intp], point: Point) -> float:
    """Least speed of all other impacts where some have vanished."""
    return float(np.delete(point.solution.speeds, gone).min(initial=1.0))


# --- two impacts that become one ----------------------------------------------------------------


def _apart(point: Point) -> float:
    """The time between the closest impacts of one site at one wall, over the least that is told."""
    orbit = point.solution
    # impacts of a site at a wall less apart than this are one
    return min(float(orbit.times[j] - orbit.times[i]) for i, j in orbit.section.repeats) - 1e-4


# VI where two impacts of one site at one wall become one, whether walls are lifted or not: with
# them come to an end the equations, too
MERGING = Event("VI", _apart, ends="branch")


# --- an impact that is caught up by one of the next section ---------------------------------------

# Within a section impacts of different sites may overtake each other, and equations go on with a
# kink. The first impact of the next section cannot come before the last one of this: the state
# between the two, from which a section sets out, is lost. Of impacts at once the order makes no
# difference beyond rounding, and a branch ends where they have ceased to be.


def so_far_apart(wanted: float, early: str, late: str, point: Point) -> DefiningSystem:
    """The time between two impacts is that."""
    times = [point.curve.slots[name] for name in (early, late)]
    return linear_condition(times, np.array([-1.0, 1.0]), wanted)


def _ends_of(point: Point) -> tuple[int, int]:
    times = point.solution.times
    return int(times.argmin()), int(times.argmax())


def _time_left(point: Point) -> float:
    orbit: Orbit = point.solution
    return float(orbit.section.length + AT_ONCE - np.ptp(orbit.times))


def _caught(point: Point) -> DefiningSystem:
    first, last = (f"t{j + 1}" for j in _ends_of(point))
    return so_far_apart(point.solution.section.length + AT_ONCE, first, last, point)


def _which_sites(point: Point) -> dict[str, str]:
    first, last = (point.solution.section.impacts[j][0] for j in _ends_of(point))
    return {"impacts": f"sites {last} and {first} hit their walls at once, and change their order"}


# CC, corner collision: the corner of configurations in which both sites are at their walls
CATCHING = Event("CC", _time_left, ends="domain", locus=_caught, examine=_which_sites)
