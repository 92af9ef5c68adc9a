"""Does every site keep off its walls except at the impacts that an orbit names?

Three things can go wrong: a site that never hits a wall reaches one (15), a site that does touches
one between its impacts (B3), the far field gets there. Each has a margin: a float that is positive
inside, zero at the limit and continuous in all unknowns and parameters.

Between the impacts of a site ``1 - u^2`` vanishes at both ends. What counts is its ratio to
``(s + k) s (L - s)``, s the time since the one impact, L - s to the next, times that denominator at
mid flight: it is regular at both, for k = 0 too, where a site leaves its wall quadratically and
the margin turns into its inward acceleration; and it vanishes when an incoming velocity does.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from contbreather.breathers import clearance_loops
from contbreather.breathers.clearance_loops import SHORT, scale_of
from contbreather.checks import kind_of, whole
from contbreather.errors import BadInput

FloatArray = NDArray[np.float64]
Terms = tuple[float, float, float]  # a value and its first two derivatives
Place = tuple[int | None, float]  # a site, None for the far field, and a time
Wall = tuple[float, float]

FINE = 64  # points to half a period of the forcing, sixteen to that of its highest harmonic
LIMIT = 1e-9  # a margin this small is said to be at the limit; whether it is ok its sign decides
CLOSE = 1e-4  # crests this close to the highest, by a parabola on the grid, are all polished
USUAL = (-1.0, 1.0)


class Between(NamedTuple):
    """A site between two of its impacts: speeds are those into the wall, just before."""

    site: int
    start: float
    end: float  # the time that the second impact is known by, but for whole periods
    length: float
    speed: float
    next_speed: float
    push: float  # inward acceleration after the first impact


class Watch(Protocol):
    """What the clearance of an orbit is measured on; those of all roads derive from it."""

    k: float
    highest: int  # harmonic of the forcing
    start: float  # time of the first impact of a section
    length: float  # of the section, in time
    sign: int  # -1 where the motion is reversed after a section, 1 where it repeats

    @property
    def flights(self) -> tuple[Between, ...]:
        """Of a section."""

    @property
    def idle(self) -> NDArray[np.int64]:
        """Sites that never hit a wall, all that may come closest to one."""

    @property
    def beside(self) -> Collection[int]:
        """Sites coupled to one that hits a wall."""

    def walls(self, site: int) -> Wall:
        return USUAL

    def far(self) -> tuple[float, float]:
        """Time and margin of the far field, 1 where there is none."""
        return self.start, 1.0

    def at(self, site: int, t: float) -> Terms:
        """Displacement, velocity and acceleration of a site."""

    def path(self, site: int, t: FloatArray) -> FloatArray:
        """Displacement of a site."""

    def profiles(self, sites: NDArray[np.int64], size: int) -> FloatArray:
        """Displacements of sites at so many equal steps of the section, shape (sites, size)."""

    def packed(self) -> Any:
        """The motion as numbers for `clearance_loops`, None where it has no such form."""
        return None

    def felt(self, site: int) -> float:
        """How strongly a site feels the impacts, in powers of the coupling; 1 where a lattice knows
        no distances."""
        return 1.0


@dataclass(frozen=True)
class Admissibility:
    """What keeps a solution from being an orbit of the lattice, or by how much it is one.

    Attributes
    ----------
    ok : bool
        All margins are positive.
    max_neighbour : float
        Largest displacement of a site coupled to one that impacts, eq. (15), where it comes
        closest to a wall; 0 if there is none.
    margin : float
        The least of the margins below.
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
    places: Mapping[str, Place]

    def __bool__(self) -> bool:
        return self.ok

    def __repr__(self) -> str:
        verdict = "ok" if self.ok else "not ok"
        return f"<Admissibility {verdict}, margin {self.margin:.6g}: {self.reason.rstrip('.')}>"


class Gap(NamedTuple):
    """The smallest of the margins of one site: by how much, where, when, and on which flight."""

    margin: float
    site: Any  # None stands for the far field
    time: float
    flight: int = -1  # of `Watch.flights`; -1: never hits


def clearance(orbit: Watch) -> Admissibility:
    """Whether, and by how much, an orbit keeps off all walls except at its impacts.

    Examples
    --------
    >>> from contbreather.breathers.symmetric import symmetric
    >>> verdict = symmetric(0.5, 0.12, 0.4).admissibility()
    >>> verdict.ok, round(verdict.max_neighbour, 12)
    (True, 0.667948289045)
    """
    when, margin = orbit.far()
    far, centre = Gap(margin, None, when), min(gaps_of_flights(orbit))
    idle = gaps_of_idle(orbit)
    places = {"neighbours": min(idle, default=_nobody(orbit)), "centre": centre, "far": far}
    worst = min(places.values(), key=lambda gap: gap.margin)
    beside = orbit.beside
    heights = [_height(orbit, gap) for gap in idle if gap.site in beside]
    return Admissibility(
        ok=worst.margin > 0.0,
        max_neighbour=max(heights, default=0.0),
        margin=worst.margin,
        reason=_reason(orbit, worst),
        site=worst.site,
        time=worst.time,
        places={name: (gap.site, gap.time) for name, gap in places.items()},
        **{name: gap.margin for name, gap in places.items()},
    )


def neighbour_peak(orbit: Any, n: int = 1) -> tuple[float, float]:
    """When and how high a site that must not impact climbs: ``(t, max over t of |u_n|)``.

    The time is within a period of the first impact; of a symmetric orbit the one of the two at
    which u_n is positive, so that grazing is ``u_n(t) = 1, u_n'(t) = 0``; both hold to rounding.

    Raises
    ------
    BadInput
        If n is an impacting site.

    Examples
    --------
    >>> from contbreather.breathers.symmetric import symmetric
    >>> b = symmetric(0.5, 0.12, 0.4)
    >>> t, height = neighbour_peak(b)
    >>> round(height, 12), abs(b.velocity(1, t)) < 1e-14
    (0.667948289045, True)
    """
    watch, sites = _watched(orbit), np.array([whole("n", n, -(10**9))])
    if n == 1 and not watch.idle.size:
        return watch.start, 0.0
    if any(orbit.lattice.distance(n - own.site) == 0 for own in watch.flights):
        raise BadInput(f"n = {n}: that is the impacting site; ask about one that must not impact.")
    u = watch.profiles(sites, points_of(watch, watch.length))
    (gap,) = gaps_of(watch, sites, u, sites.tolist())
    return gap.time, _height(watch, gap)


def _watched(orbit: Any) -> Watch:
    if not hasattr(orbit, "watch") or isinstance(orbit, type):
        raise BadInput(f"an orbit was expected, got {kind_of(orbit)}")
    watch: Watch = orbit.watch
    return watch


def highest_neighbour(orbit: Any) -> tuple[int, float, float]:
    """Which site that must not impact climbs highest: ``(n, t, |u_n|)``; height 0 if there is none.

    On the upper branch of (13) it is the nearest one wherever that matters (the paper's
    Appendix B); on the lower branch, and for other forcings, it is often the second.

    Examples
    --------
    >>> from contbreather.breathers.symmetric import symmetric_roots
    >>> [highest_neighbour(b)[0] for b in symmetric_roots(0.9, 0.12, 0.8)]
    [1, 2]
    """
    watch = _watched(orbit)
    idle = gaps_of_idle(watch)
    found = min(idle, default=_nobody(watch))
    assert found.site is not None
    return found.site, found.time, _height(watch, found) if idle else 0.0


def centre_margin(orbit: Any) -> float:
    """How far the impacting sites keep off their walls between their impacts, (B3)."""
    return min(gaps_of_flights(_watched(orbit))).margin


_MARGIN = clearance_loops.MARGIN


def least_margin(orbit: Watch) -> float:
    """The least of all margins, without a word on whose it is.

    Examples
    --------
    >>> from contbreather.breathers.symmetric import symmetric
    >>> b = symmetric(0.5, 0.12, 0.4)
    >>> abs(least_margin(b.watch) - b.admissibility().margin) < 1e-14
    True
    """
    code = _MARGIN.code()
    packed = None if code is None else orbit.packed()
    if code is None or packed is None:
        return min(orbit.far()[1], closest(orbit).margin)
    return called(code, packed, packed.data)


def called(code: Callable[..., int], packed: Any, data: FloatArray) -> float:
    """What a function of `clearance_loops` finds."""
    out = np.empty(packed.own + packed.points)
    at = out.ctypes.data
    code(data.ctypes.data, packed.table.ctypes.data, at + 8 * packed.own, at)
    return float(out[0])


def closest(orbit: Watch) -> Gap:
    """What is closest to a wall, or beyond it, the far field aside."""
    return min([*gaps_of_flights(orbit), *gaps_of_idle(orbit)])


def _reason(orbit: Watch, worst: Gap) -> str:
    reach = _reach(orbit, worst)
    if abs(worst.margin) < LIMIT:
        return f"at the limit: {reach}."
    if worst.margin > 0.0:
        return f"every site keeps off its walls; closest to the limit: {reach}."
    rule = "|a f| <= 1" if worst.site is None else "(B3)" if worst.flight >= 0 else "(15)"
    return f"no breather: {reach}; {rule} is broken."


def _reach(orbit: Watch, worst: Gap) -> str:
    margin, site, time, flight = worst
    if site is None:
        return f"the far field follows the forcing and reaches |u| = {1.0 - margin:.6g}"
    if flight >= 0:
        return _reach_between(orbit, worst, site)
    if orbit.walls(site) == USUAL:
        return f"site {site} reaches |u| = {1.0 - margin:.6g} at t = {time:.6g}"
    return f"site {site} reaches u = {orbit.at(site, time)[0]:.6g} at t = {time:.6g}"


def _reach_between(orbit: Watch, worst: Gap, site: int) -> str:
    margin, _, time, flight = worst
    own = orbit.flights[flight]
    if time not in (own.start, own.end):
        u = orbit.at(site, time)[0]
        return f"site {site} between its impacts is at u = {u:.6g} at t = {time:.6g}"
    if orbit.k == 0.0 and time == own.start:
        way = "inwards" if margin > 0.0 else "into the wall, so it sticks"
        return f"after its impact with k = 0 site {site} is pushed {way}"
    speed = own.speed * orbit.k if time == own.start else own.next_speed
    if abs(margin) < LIMIT:
        return f"the impact of site {site} itself vanishes, at velocity {speed:.2g}"
    return f"the impact of site {site} itself, at velocity {speed:.6g}"


# --- between the impacts of a site ----------------------------------------------------------


class Room(NamedTuple):
    """Product of the distances of a site from its walls, ``1 - u^2`` between -1 and 1; a wall that
    is not there does not count."""

    low: float
    high: float

    @property
    def width(self) -> float:
        """Size of the slope at a wall."""
        width = self.high - self.low
        return width if math.isfinite(width) else 1.0

    def of(self, u: Any) -> Any:
        if self.low == -math.inf:
            return self.high - u
        return u - self.low if self.high == math.inf else (self.high - u) * (u - self.low)

    def terms(self, u: float, v: float, w: float) -> Terms:
        """Value and derivatives in time from those of u."""
        low, high = self
        if low == -math.inf:
            return high - u, -v, -w
        if high == math.inf:
            return u - low, v, w
        tilt = high + low - 2.0 * u
        return (high - u) * (u - low), tilt * v, tilt * w - 2.0 * v * v


def _nobody(orbit: Watch) -> Gap:
    """The margin of idle sites where there are none."""
    return Gap(1.0, orbit.flights[0].site + 1, orbit.start)


def _height(orbit: Watch, gap: Gap) -> float:
    """How far a site is displaced where it comes closest to a wall."""
    assert gap.site is not None
    if orbit.walls(gap.site) == USUAL:
        return 1.0 - gap.margin
    return abs(float(orbit.at(gap.site, gap.time)[0]))


def gaps_of_flights(orbit: Watch) -> Iterator[Gap]:
    """The margin of each flight of a site from one impact to its next."""
    for i, own in enumerate(orbit.flights):
        if own.length <= 0.0:  # the order of two impacts of one site is lost
            yield Gap(own.length, own.site, own.end, i)
            continue
        room, s, ends = seen(orbit, own)
        least, when = min(_limits(orbit.k, own, room.width))
        if own.length > SHORT:
            path = orbit.path(own.site, own.start + s)
            ratio = room.of(path) / denominator(orbit.k, own.length, s)
            inner = least_ratio(partial(flown, orbit, own, room), s, ratio, ends)
            least, when = min(inner, (least, when))
        scale = scale_of(own.length, orbit.k)
        yield Gap(least * scale, own.site, _named(own, when), i)


def seen(orbit: Watch, own: Between) -> tuple[Room, FloatArray, tuple[float, float]]:
    """The room of a site, times of its flight to look at, and how far beyond them to look."""
    s = _grid(points_of(orbit, own.length)) * own.length
    ends = 0.1 * float(s[0]), own.length - 1e-3 * (own.length - float(s[-1]))
    return Room(*orbit.walls(own.site)), s, ends


def _named(own: Between, when: float) -> float:
    # an impact is named by its own time, not by one that is it but for rounding
    return own.end if when == own.length else own.start + when


def _limits(k: float, own: Between, width: float) -> tuple[tuple[float, float], ...]:
    """The ratio at both impacts, by de l'Hospital."""
    L = own.length
    left = own.speed / L if k > 0.0 else 0.5 * own.push / L
    return (width * left, 0.0), (width * own.next_speed / (L * (L + k)), L)


def denominator(k: float, length: float, s: Any) -> Any:
    return (s + k) * s * (length - s)


def flown(orbit: Watch, own: Between, room: Room, s: float) -> tuple[Terms, Terms]:
    """Numerator and denominator of the ratio."""
    k, rest = orbit.k, own.length - s
    d = (s + k) * s * rest, (2.0 * s + k) * rest - (s + k) * s, 2.0 * rest - 2.0 * (2.0 * s + k)
    return room.terms(*orbit.at(own.site, own.start + s)), d


@lru_cache(maxsize=32)
def _grid(size: int) -> FloatArray:
    """Between 0 and 1, without the ends, finer towards the start: for small k it is flat."""
    step = 1.0 / size
    return np.concatenate([step * 0.5 ** np.arange(6, 0, -0.5), step * np.arange(1, size)])


def fineness(highest: int) -> int:
    """Points to half a period of the forcing."""
    return max(FINE, 16 * highest)


def points_of(orbit: Watch, length: float) -> int:
    return math.ceil(fineness(orbit.highest) * max(1.0, length / math.pi) - 1e-9)


def least_ratio(
    terms: Callable[[float], tuple[Terms, Terms]],
    s: FloatArray,
    ratio: FloatArray,
    ends: tuple[float, float],
) -> tuple[float, float]:
    """Value and place of the least of a ratio that is known on a grid between two ends."""
    fenced = [ends[0], *s.tolist(), ends[1]]
    return min(
        _deepest(terms, fenced[i + 1], float(ratio[i]), (fenced[i], fenced[i + 2]))
        for i in _dips(ratio).tolist()
    )


def _dips(ratio: FloatArray) -> NDArray[np.int64]:
    """Local minima on the grid that may be the lowest; the grid misses less than a tenth."""
    lowest = float(ratio.min())
    low = ratio <= lowest + 0.1 * max(abs(lowest), 0.1 * abs(float(ratio[-1])))
    low[1:] &= ratio[1:] <= ratio[:-1]
    low[:-1] &= ratio[:-1] <= ratio[1:]
    return np.flatnonzero(low)


def _deepest(
    terms: Callable[[float], tuple[Terms, Terms]],
    s: float,
    value: float,
    within: tuple[float, float],
) -> tuple[float, float]:
    """The minimum of a ratio next to ``s``: Newton, kept in by bisection. `terms` are its numerator
    and denominator, each with its first two derivatives."""
    best, (low, high) = (value, s), within
    bisected = 0
    for _ in range(60):
        if bisected == 9:  # the ratio falls up to an end, which has a value of its own
            break
        (n, n1, n2), (d, d1, d2) = terms(s)
        best = min(best, (n / d, s))
        tilt, bend = n1 * d - n * d1, n2 * d - n * d2
        low, high = (low, s) if tilt > 0.0 else (s, high)
        last, s = s, s - tilt / bend if bend > 0.0 else low
        if not low < s < high:
            bisected, s = bisected + 1, 0.5 * (low + high)
        if abs(s - last) <= 1e-8:  # the value is flat there: this is 1e-16 of it
            break
    return best


# --- sites that never hit a wall ------------------------------------------------------------


def gaps_of_idle(orbit: Watch) -> list[Gap]:
    """The margins of the sites beside those that impact, and of every other that may be less."""
    sites = orbit.idle
    if not sites.size:
        return []
    u = orbit.profiles(sites, points_of(orbit, orbit.length))
    return gaps_of(orbit, sites, u, orbit.beside)


def gaps_of(
    orbit: Watch,
    sites: NDArray[np.int64],
    u: FloatArray,
    near: Collection[int],
    walls: list[Wall] | None = None,
) -> list[Gap]:
    """Of sites whose motion over a section is u: those near, and the least of all."""
    if not sites.size:
        return []
    walls = walls or [orbit.walls(n) for n in sites.tolist()]
    tops, step = _crests(_heights(u, walls)), orbit.length / u.shape[1]
    top = tops.max(axis=1)
    # the parabola errs by a fraction of the crest, however low that is
    enough = top.max() - CLOSE * abs(top.max())
    found = []
    for i, n in enumerate(sites.tolist()):
        if n in near or top[i] >= enough:
            crests = np.flatnonzero(tops[i] >= top[i] - CLOSE * abs(top[i])).tolist()
            own = (_crest(orbit, n, walls[i], orbit.start + j * step, step) for j in crests)
            found.append(min(own))
    return found


def _crest(orbit: Watch, n: int, walls: Wall, t: float, step: float) -> Gap:
    """The margin of site n at the extremum of its motion within a step: Newton, kept in by
    bisection. Where the other half of the motion mirrors this one it is that at the wall +1."""
    low, high = t - step, t + step
    u, v, w = orbit.at(n, t)
    top = walls[1] - u < u - walls[0]
    for _ in range(60):
        low, high = (t, high) if (v > 0.0) == top else (low, t)
        last, t = t, t - v / w if w else low
        if not low <= t <= high:
            t = 0.5 * (low + high)
        if abs(t - last) <= 1e-8:  # of second order: the next step would be rounding
            u += 0.5 * v * (t - last)
            break
        u, v, w = orbit.at(n, t)
    period = orbit.length
    if orbit.sign < 0:
        period *= 2.0
        if u < 0.0:
            u, t = -u, t + orbit.length
    return Gap(min(walls[1] - u, u - walls[0]), n, orbit.start + (t - orbit.start) % period)


def _heights(u: FloatArray, walls: list[Wall]) -> FloatArray:
    """1 less the distance from the nearer wall: ``|u|`` between -1 and 1."""
    if all(own == USUAL for own in walls):
        return np.abs(u)
    low, high = np.array(walls).T[:, :, None]
    return np.asarray(1.0 + np.maximum(u - high, low - u))


def _crests(u: FloatArray) -> FloatArray:
    """Heights of crests by a parabola through three points of the grid; nothing elsewhere."""
    closed = np.concatenate([u[:, -1:], u, u[:, :1]], axis=1)
    before, after = closed[:, :-2], closed[:, 2:]
    crest = (u >= before) & (u >= after)
    bend = np.where(crest, 2.0 * u - before - after, 1.0)
    lift = np.divide((after - before) ** 2, 8.0 * bend, out=np.zeros_like(u), where=bend > 0.0)
    return np.where(crest, u + lift, -np.inf)
