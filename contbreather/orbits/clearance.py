"""Does every site keep off its walls except at the impacts that an orbit names?

Three things can go wrong: a site that never hits a wall reaches one (15), a site that does touches
one between its impacts (B3), the far field gets there. Each has a margin (see `margins`): a float
that is positive inside, zero at the limit and continuous in all unknowns and parameters.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from contbreather.checks import flag, kind_of, whole
from contbreather.errors import BadInput, NoSolution
from contbreather.orbits.margins import (
    FOUND,
    LENGTH,
    MARGIN,
    MARGINS,
    NEXT,
    STEEP,
    TIE,
    WHEN,
    Along,
)
from contbreather.orbits.site_motion import SITE, USUAL, Motion, SiteMotion, points_of
from contbreather.tables import Column, HtmlRepr, Sheet

FloatArray = NDArray[np.float64]
SiteTime = tuple[int | None, float]  # a site, None for the far field, and a time

LIMIT = 1e-9  # a margin this small is said to be at the limit; whether it is ok its sign decides


@dataclass(frozen=True, repr=False)
class Admissibility(HtmlRepr):
    """Verdict on a solution: what keeps it from being an orbit, or by how much it is one.

    Attributes
    ----------
    ok : bool
        All margins are positive.
    max_neighbour : float
        Largest displacement of a site coupled to one that impacts, eq. (15), where it comes
        closest to a wall; 0 if there is none.
    margin : float
        The least of the margins below, of sites and a far field that are there.
    reason : str
        A sentence: what is closest to its limit, or beyond it.
    site, time : int or None, float
        Where and when that is; None stands for the far field.
    neighbours : float
        The sites that never impact: distance from the nearer wall; 1 if there are none.
    centre : float
        The sites that do, between their impacts, (B3).
    far : float
        The far field on a lattice without end: ``1 - max |c + a f|``, else 1.
    places : dict
        Site and time of each of the three margins, by name.
    """

    ok: bool
    max_neighbour: float
    margin: float
    reason: str
    site: int | None
    time: float
    neighbours: float
    centre: float
    far: float
    places: Mapping[str, SiteTime]

    def __bool__(self) -> bool:
        return self.ok

    def table(self) -> Sheet:
        """The verdict; how far sites keep from their walls, and where they are closest."""
        title = f"{'admissible' if self.ok else 'not admissible'}: {self.reason}"
        names, margins = list(self.places), [float(getattr(self, name)) for name in self.places]
        sites = ["far field" if site is None else str(site) for site, _ in self.places.values()]
        times = [time for _, time in self.places.values()]
        headings: dict[str, Any] = {"margin": names, "distance": margins, "site": sites, "t": times}
        return Sheet([Column(heading, cells) for heading, cells in headings.items()], title)

    def __repr__(self) -> str:
        verdict = "ok" if self.ok else "not ok"
        return f"<Admissibility {verdict}, margin {self.margin:.6g}: {self.reason.rstrip('.')}>"


class Inadmissible(NoSolution):
    """A solution of the equations is no orbit: `orbit` is that solution, and `site` (None: the far
    field) is at or behind a wall at `time` without an impact."""

    def __init__(self, message: str, *, orbit: Any = None) -> None:
        super().__init__(message)
        self.orbit, self.site, self.time = orbit, None, math.nan
        if orbit is not None:
            margins = orbit.admissibility()
            self.site, self.time = margins.site, margins.time


def check_admissible(orbit: Any, inadmissible: bool, what: str = "") -> None:
    """`Inadmissible` where a site is behind a wall between impacts, unless that is asked for."""
    if not flag("inadmissible", inadmissible) and orbit.admissibility().margin < -LIMIT:
        raise Inadmissible(
            f"{what}{orbit.admissibility().reason} What solves the equations is returned with "
            "inadmissible=True.",
            orbit=orbit,
        )


class Clearance(NamedTuple):
    """The smallest of the margins of one site: by how much, where, when, and in which flight."""

    margin: float
    site: Any  # None stands for the far field
    time: float
    flight: int = -1  # since which impact of the section; -1: never hits


class Measured(NamedTuple):
    """Margins of the flights, of sites without impacts, and of one that touches."""

    rows: FloatArray
    sites: Sequence[int]
    least: FloatArray  # of all that were looked at, and the ceiling


def measured_margins(
    orbit: SiteMotion,
    idle: Sequence[int],
    near: Collection[int] = (),
    *,
    only_closest: bool = False,
    touching: int | None = None,
    time: float = math.nan,
    along: Callable[[Motion], tuple[Along, FloatArray]] | None = None,
) -> Measured:
    """Margins that `margins` is asked for; with `only_closest` what is farther off than others,
    or than the far field, is not looked at closely. `along` says of many orbits in what they differ
    from this one, and the margins of their far fields; the rows are those of the last."""
    motion, sites = orbit.with_idle(idle, near, touching)
    wanted = np.array([site in near for site in sites] if near else [], dtype=np.int8)
    # one for each flight and each site, two for the other crests of a site that touches
    rows = FOUND + motion.flights + len(sites) + 2
    # the longest grid is that of a flight as long as the period, with its steep start and both ends
    work = np.empty((rows, points_of(motion.fine, orbit.period) + STEEP + 2))
    which = -1 if touching is None else (*orbit.hit, *sites).index(touching)
    many, far = (single(motion), orbit.far) if along is None else along(motion)
    lowest = np.full(many.a.size, math.inf)
    if only_closest:  # finite, and beyond all others, where there is no far field
        lowest[:] = far if orbit.endless else 1e300
    MARGINS(motion, many, wanted, which, time, work, lowest)
    return Measured(work[FOUND:, : NEXT + 1], sites, lowest)


def single(motion: Motion) -> Along:
    """Take apart what many motions may differ in, for one."""
    of, drive, (times, impulses) = motion.responses, motion.forced, motion.impacts[:SITE]
    parts = np.array([motion.a]), times[None], impulses[None], of.table[None], of.largest[None]
    return Along(*parts, drive.cosines[None], drive.sines[None], np.array([drive.peak]))


def clearance(orbit: SiteMotion) -> Admissibility:
    """Say whether, and by how much, an orbit keeps off all walls except at its impacts."""
    measured = measured_margins(orbit, orbit.idle, orbit.beside)
    far = Clearance(orbit.far, None, orbit.far_time())
    centre, idle = smallest_margins(of_flights(orbit, measured)), of_idle(orbit, measured)
    nobody = Clearance(1.0, orbit.hit[0] + 1, orbit.start)
    neighbours = smallest_margins(idle) if idle else nobody
    places = {"neighbours": neighbours, "centre": centre, "far": far}
    # those that there are; an impact that vanishes before what comes with it
    existing = [centre, *([neighbours] if idle else []), *([far] if orbit.endless else [])]
    # the worst is the first of those that tie but for rounding, the margin the least of them
    worst, margin = smallest_margins(existing), min(place.margin for place in existing)
    heights = [_height(orbit, near) for near in idle if near.site in orbit.beside]
    return Admissibility(
        ok=margin > 0.0,
        max_neighbour=max(heights, default=0.0),
        margin=margin,
        reason=_reason(orbit, worst),
        site=worst.site,
        time=worst.time,
        places={name: (least.site, least.time) for name, least in places.items()},
        **{name: least.margin for name, least in places.items()},
    )


def of_flights(orbit: SiteMotion, measured: Measured) -> list[Clearance]:
    """Clearances of each flight of a site from one impact to its next."""
    impacts, gaps = orbit.impacts, []
    for i in range(orbit.section.count):
        row = measured.rows[i].tolist()
        # an impact is named by its own time, not by one that is it but for rounding
        time = impacts[int(row[NEXT]) if row[WHEN] == row[LENGTH] else i].time
        if 0.0 < row[WHEN] < row[LENGTH]:
            time = _in_period(orbit, time + row[WHEN])
        gaps.append(Clearance(row[MARGIN], impacts[i].site, time, i))
    for i, j in orbit.section.repeats:
        early, late = impacts[i], impacts[j]
        if late.time <= early.time:  # their order is lost
            gaps.append(Clearance(late.time - early.time, late.site, late.time, i))
    return gaps


def of_idle(orbit: SiteMotion, measured: Measured) -> list[Clearance]:
    """Clearances of the sites that never hit a wall, of those that were looked at."""
    # the last two are of a site that touches its wall, for `other_contacts`
    rows = measured.rows[orbit.section.count : -2, : WHEN + 1].tolist()
    named = zip(measured.sites, rows, strict=True)
    return [
        Clearance(margin, site, _in_period(orbit, orbit.start + when % orbit.period))
        for site, (margin, when) in named
        if margin < math.inf
    ]


def _in_period(orbit: SiteMotion, time: float) -> float:
    """Time after the first impact, less a period where it is beyond its end."""
    return time - orbit.period if time >= orbit.period else time


def smallest_margins(of: Sequence[Clearance]) -> Clearance:
    """The first of those that have the least margin but for rounding."""
    lowest = min(gap.margin for gap in of)
    return next(gap for gap in of if gap.margin <= lowest + TIE)


def least_margin(orbit: SiteMotion) -> float:
    """The least of all margins, without a word on whose it is."""
    measured = measured_margins(orbit, orbit.idle, only_closest=True)
    # impacts of one site at one wall may come in the wrong order, which no flight tells
    lost = [gap.margin for gap in of_flights(orbit, measured)] if orbit.section.repeats else []
    return min([*measured.least.tolist(), *lost])


def closest(orbit: SiteMotion) -> Clearance:
    """Find the site closest to a wall, or farthest beyond it, the far field aside."""
    measured = measured_margins(orbit, orbit.idle)
    return smallest_margins([*of_flights(orbit, measured), *of_idle(orbit, measured)])


def neighbour_peak(orbit: Any, n: int = 1) -> tuple[float, float]:
    """When and how high a site that must not impact climbs: ``(t, max over t of |u_n|)``.

    The time is within a period of the first impact, and below the period; of a symmetric orbit the
    one of the two at which u_n is positive, so that grazing is ``u_n(t) = 1, u_n'(t) = 0``; both
    hold to rounding.

    Raises
    ------
    BadInput
        If n is an impacting site.

    Examples
    --------
    >>> from contbreather.orbits.constructors import symmetric
    >>> b = symmetric(0.5, 0.12, 0.4)
    >>> t, height = neighbour_peak(b)
    >>> round(height, 12), abs(b.velocity(1, t)) < 1e-14
    (0.667948289045, True)
    """
    motion, site = _motion_of(orbit), whole("n", n, -(10**9))
    if n == 1 and not motion.idle:
        return motion.start, 0.0
    motion.at(site, motion.start)  # says why where there is no such site
    distance = getattr(orbit.lattice, "distance", abs)
    if any(distance(n - hit) == 0 for hit in motion.hit):
        raise BadInput(f"n = {n}: that is the impacting site; ask about one that must not impact.")
    (peak,) = of_idle(motion, measured_margins(motion, [site], [site]))
    return peak.time, _height(motion, peak)


def _motion_of(orbit: Any) -> SiteMotion:
    if not hasattr(orbit, "motion") or isinstance(orbit, type):
        raise BadInput(f"an orbit was expected, got {kind_of(orbit)}")
    motion: SiteMotion = orbit.motion
    return motion


def highest_neighbour(orbit: Any) -> tuple[int, float, float]:
    """Which site that must not impact climbs highest: ``(n, t, |u_n|)``; height 0 if there is none.

    On the upper branch of (13) it is the nearest one wherever that matters (the paper's
    Appendix B); on the lower branch, and for other forcings, it is often the second.

    Examples
    --------
    >>> from contbreather.orbits.constructors import symmetric_roots
    >>> [highest_neighbour(b)[0] for b in symmetric_roots(0.9, 0.12, 0.8)]
    [1, 2]
    """
    motion, verdict = _motion_of(orbit), orbit.admissibility()
    peak = Clearance(verdict.neighbours, *verdict.places["neighbours"])
    return peak.site, peak.time, _height(motion, peak) if motion.idle else 0.0


def centre_margin(orbit: Any) -> float:
    """Least margin of the impacting sites between their impacts, (B3)."""
    _motion_of(orbit)
    margin: float = orbit.admissibility().centre
    return margin


def _height(orbit: SiteMotion, least: Clearance) -> float:
    """Displacement of a site where it comes closest to a wall."""
    if orbit.walls(least.site) == USUAL:
        return 1.0 - least.margin
    return abs(float(orbit.at(least.site, least.time)[0]))


def _reason(orbit: SiteMotion, worst: Clearance) -> str:
    reach = _reach(orbit, worst)
    if abs(worst.margin) < LIMIT:
        return f"at the limit: {reach}."
    if worst.margin > 0.0:
        return f"every site keeps off its walls; closest to the limit: {reach}."
    # far away c + a f is all there is; (B3) is of sites between their impacts, (15) of the others
    number = "(B3)" if worst.flight >= 0 else "(15)"
    rule = "|a f| <= 1" if worst.site is None else f"condition {number}"
    return f"no breather: {reach}; {rule} is broken."


def _reach(orbit: SiteMotion, worst: Clearance) -> str:
    margin, site, time, flight = worst
    if site is None:
        return f"the far field follows the forcing and reaches |u| = {1.0 - margin:.6g}"
    if flight < 0:
        usual = orbit.walls(site) == USUAL
        reached = f"|u| = {1.0 - margin:.6g}" if usual else f"u = {orbit.at(site, time)[0]:.6g}"
        return f"site {site} reaches {reached} at t = {time:.6g}"
    # J = -(1 + k) u'(t-) by (2): the velocity is -J/(1 + k) before an impact, and k of that after;
    # where k = 0 leaves none the acceleration decides which way the site goes
    at_start = time == orbit.impacts[flight].time
    hits = [hit for hit in orbit.impacts if (hit.time, hit.site) == (time, site)]
    if not hits:
        u = orbit.at(site, time)[0]
        return f"site {site} between its impacts is at u = {u:.6g} at t = {time:.6g}"
    k = float(orbit.on.at_sites("k", site))
    if k == 0.0 and at_start:
        way = "inwards" if margin > 0.0 else "into the wall, so it sticks"
        return f"after its impact with k = 0 site {site} is pushed {way}"
    speed = -hits[0].wall * hits[0].impulse / (1.0 + k) * (k if at_start else 1.0)
    if abs(margin) < LIMIT:
        return f"the impact of site {site} itself vanishes, at velocity {speed + 0.0:.2g}"
    return f"the impact of site {site} itself, at velocity {speed:.6g}"
