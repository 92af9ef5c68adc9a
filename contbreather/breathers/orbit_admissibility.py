"""Does an orbit keep off the walls but at the impacts it names?

The same margins as for the symmetric breather (`contbreather.breathers.admissibility`): sites that
must not impact, an impacting site between its impacts, and the far field, offset included. Each is
positive inside, zero at the limit and continuous in all unknowns and parameters.

A dozen sites beyond the last impacting one the answer of the lattice is one harmonic, whose
amplitude shrinks and alternates from site to site. The largest displacement is a convex function of
that amplitude, so the first two such sites and the far field bound all others.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contbreather.breathers.orbits import Orbit
from contbreather.lattice.periodic import is_resonant, wave, wave_basis, wave_table

FloatArray = NDArray[np.float64]

NEAR = 13  # (0.072)^13 < 1e-14: there only the first harmonic is left
LIMIT = 1e-9  # a margin this small is said to be at the limit; whether it is ok its sign decides
CLOSE = 1e-4  # crests this close to the highest, by a parabola on the grid, are all polished


@dataclass(frozen=True)
class OrbitAdmissibility:
    """What keeps an orbit from being one of the chain, or by how much it is one.

    Attributes
    ----------
    ok : bool
        All margins are positive.
    margin : float
        The least of the margins below.
    reason : str
        A sentence: what is closest to its limit, or beyond it.
    site, time : int or None, float
        Where and when that is; None stands for the far field.
    max_neighbour : float
        Largest |u_n| of the sites that must not impact; 0 if there are none.
    neighbours : float
        1 less that.
    centre : float
        The impacting sites between their impacts; see `centre_margin`.
    far : float
        ``1 - max |c + a f|`` at both ends of a lattice without end, else 1.
    """

    ok: bool
    margin: float
    reason: str
    site: int | None
    time: float
    max_neighbour: float
    neighbours: float
    centre: float
    far: float

    def __bool__(self) -> bool:
        return self.ok


def admissibility(orbit: Orbit) -> OrbitAdmissibility:
    """Whether, and by how much, an orbit keeps off all walls but at its impacts.

    Examples
    --------
    >>> from contbreather.breathers.orbits import orbit_of
    >>> from contbreather.breathers.symmetric import symmetric
    >>> verdict = admissibility(orbit_of(symmetric(0.5, 0.12, 0.4)))
    >>> verdict.ok, round(verdict.max_neighbour, 12)
    (True, 0.667948289045)
    """
    site, time, highest = highest_neighbour(orbit)
    centre_site, centre_time, centre = centre_margin(orbit)
    far_time, far = _far(orbit)
    candidates: list[tuple[float, int | None, float]] = [
        (1.0 - highest, site, time),
        (centre, centre_site, centre_time),
        (far, None, far_time),
    ]
    margin, where, when = min(candidates, key=lambda item: item[0])
    return OrbitAdmissibility(
        ok=margin > 0.0,
        margin=margin,
        reason=_reason(orbit, margin, where, when),
        site=where,
        time=when,
        max_neighbour=highest,
        neighbours=1.0 - highest,
        centre=centre,
        far=far,
    )


def _reason(orbit: Orbit, margin: float, site: int | None, time: float) -> str:
    if site is None:
        reach = f"the far field reaches |u| = {1.0 - margin:.6g} at t = {time:.6g}"
    elif site not in orbit.equations.sites:
        reach = f"site {site} reaches |u| = {1.0 - margin:.6g} at t = {time:.6g}"
    elif any(time == impact.time for impact in orbit.impacts):
        reach = f"the impact of site {site} at t = {time:.6g} itself, which hardly has a velocity"
    else:
        there = motion(orbit, site, time)[0]
        reach = f"site {site} between its impacts is at u = {there:.6g} at t = {time:.6g}"
    if abs(margin) < LIMIT:
        return f"at the limit: {reach}."
    if margin > 0.0:
        return f"every site keeps off its walls; closest to the limit: {reach}."
    return f"no orbit of the chain: {reach}; there is an impact that it does not name."


def motion(orbit: Orbit, site: int | None, t: float) -> tuple[float, float, float]:
    """Displacement, velocity and acceleration of a site (None: the far field) at one time."""
    u, v, w = moved(orbit, site, t)
    return u + (_far_offset(orbit) if site is None else float(orbit.offset(site))), v, w


def moved(orbit: Orbit, site: int | None, t: float) -> tuple[float, float, float]:
    """The same without the static offset."""
    a, f = orbit.a, orbit.forcing
    u, v, w = a * f.f(t), a * f.df(t), a * f.d2f(t)
    if site is None:
        return u, v, w
    for impact in orbit.impacts:
        distance = orbit.lattice.distance(site - impact.site)
        h = wave(orbit.lattice, orbit.gamma, distance, orbit.periods).at(t - impact.time)
        u, v, w = u + impact.impulse * h[0], v + impact.impulse * h[1], w + impact.impulse * h[2]
    return float(u), float(v), float(w)


# ------------------------------------------------------------------------------- the far field


def _far_offset(orbit: Orbit) -> float:
    """The larger of the offsets at both ends of the chain; none where there is no coupling."""
    if orbit.gamma == 0.0:
        return 0.0
    return max(orbit.offsets[0], orbit.offsets[-1], key=abs)


def _far(orbit: Orbit) -> tuple[float, float]:
    if orbit.lattice.sites is not None:
        return orbit.impacts[0].time, 1.0
    offset = _far_offset(orbit)
    return _crest(orbit, offset), 1.0 - abs(offset) - orbit.a * orbit.forcing.peak()


def _crest(orbit: Orbit, sign: float) -> float:
    """When f is largest in the direction of ``sign``."""
    t = np.linspace(0.0, 2.0 * math.pi, 64 * orbit.forcing.highest, endpoint=False)
    return float(t[int((math.copysign(1.0, sign) * orbit.forcing.f(t)).argmax())])


# ------------------------------------------------------------------------------- idle sites


def idle_sites(orbit: Orbit) -> list[int]:
    """Sites that must not impact and that may be the highest of all such sites."""
    busy, ring = orbit.equations.sites, orbit.lattice.sites
    if is_resonant(orbit.lattice, orbit.gamma, orbit.periods):
        near = set(range(ring or 0))
    elif len(busy) == 1:
        near = {busy[0] + d for d in range(1, NEAR + 1)}  # both sides are alike
    else:
        near = set(range(busy[0] - NEAR, busy[-1] + NEAR + 1))
    if ring is not None:
        near = {site % ring for site in near}
    return sorted(near - set(busy))


def profiles(orbit: Orbit, sites: list[int], t: FloatArray) -> FloatArray:
    """Displacements of several sites at several times, shape (sites, times)."""
    lattice, gamma, n = orbit.lattice, orbit.gamma, orbit.periods
    u = orbit.offset(sites)[:, None] + orbit.a * np.asarray(orbit.forcing.f(t))
    for impact in orbit.impacts:
        apart = tuple(lattice.distance(site - impact.site) for site in sites)
        table = wave_table(lattice, gamma, apart, n)
        if table is None:
            answer = np.array([wave(lattice, gamma, d, n).at(t - impact.time)[0] for d in apart])
        else:
            answer = table @ wave_basis(t - impact.time, n)
        u += impact.impulse * answer
    return np.asarray(u)


def highest_neighbour(
    orbit: Orbit, besides: tuple[int, float] | None = None
) -> tuple[int, float, float]:
    """Which idle site climbs highest, when, and how high: ``(site, t, |u|)``.

    ``besides`` names a crest, by its site and time, that is not to be counted.
    ``(site + 1, t, 0)`` where there is none.
    """
    sites = idle_sites(orbit)
    start = orbit.impacts[0].time
    if not sites:
        return orbit.impacts[0].site + 1, start, 0.0
    # sixteen points to the half period of the highest harmonic: no crest hides between them
    size = orbit.periods * max(128, 32 * orbit.forcing.highest)
    step = orbit.period / size
    t = start + step * np.arange(size, dtype=float)
    heights = _crests(np.abs(profiles(orbit, sites, t)))
    if besides is not None:
        apart = (t - besides[1] + 0.5 * orbit.period) % orbit.period - 0.5 * orbit.period
        heights[np.ix_(np.array(sites) == besides[0], np.abs(apart) < 2.5 * step)] = 0.0
    top = float(heights.max())
    best = (sites[0], start, -1.0)
    for i, j in np.argwhere(heights >= (1.0 - CLOSE) * top):
        when, height = _polished(orbit, sites[i], float(t[j]), step)
        if height > best[2]:
            best = (sites[i], when, height)
    return best


def _crests(u: FloatArray) -> FloatArray:
    """Heights of the crests of |u| by a parabola through three points of the grid; 0 elsewhere."""
    before, after = np.roll(u, 1, axis=1), np.roll(u, -1, axis=1)
    crest = (u >= before) & (u >= after)
    bend = np.where(crest, 2.0 * u - before - after, 1.0)
    lift = np.divide((after - before) ** 2, 8.0 * bend, out=np.zeros_like(u), where=bend > 0.0)
    return np.where(crest, u + lift, 0.0)


def _polished(orbit: Orbit, site: int, t: float, step: float) -> tuple[float, float]:
    """Extremum of u within a grid step of t: Newton, kept in by bisection."""
    low, high = t - step, t + step
    rising = motion(orbit, site, low)[1] > 0.0
    u = 0.0
    for _ in range(60):
        u, tilt, bend = motion(orbit, site, t)
        if tilt == 0.0:
            break
        low, high = (t, high) if (tilt > 0.0) == rising else (low, t)
        last, t = t, t - tilt / bend if bend else low
        if not low <= t <= high:
            t = 0.5 * (low + high)
        if abs(t - last) <= 1e-15 * (1.0 + abs(t)):
            break
        # at an extremum a step of 1e-8 changes nothing any more
        if abs(t - last) <= 1e-8 * step:
            u = motion(orbit, site, t)[0]
            break
    return t, abs(u)


# ----------------------------------------------------------------- between the impacts of a site


def centre_margin(orbit: Orbit) -> tuple[int, float, float]:
    """How far impacting sites keep off their walls between impacts: ``(site, t, margin)``.

    Over each flight of length L the least of ``(1 - u^2)/((s + k) s (L - s))``, times the
    denominator at mid flight: both impacts are divided out, and their velocities are what is left
    there, so that an impact that loses its velocity is a limit as well.
    """
    best = (orbit.equations.sites[0], orbit.impacts[0].time, math.inf)
    for site in orbit.equations.sites:
        first, T = orbit.impacts[0].time, orbit.period
        own = [i for i, impact in enumerate(orbit.impacts) if impact.site == site]
        own.sort(key=lambda i: (orbit.impacts[i].time - first) % T)
        for first, second in zip(own, [*own[1:], own[0]], strict=True):
            when, margin = _flight_margin(orbit, first, second)
            if margin < best[2]:
                best = (site, when, margin)
    return best


def _flight_margin(orbit: Orbit, first: int, second: int) -> tuple[float, float]:
    """Time and value of the margin between two impacts of one site."""
    start, k = orbit.impacts[first], orbit.k
    length = (orbit.impacts[second].time - start.time) % orbit.period or orbit.period
    w, w_next = abs(orbit.incoming[first]), abs(orbit.incoming[second])
    s = _times_of_flight(length, orbit.forcing.highest)
    u = profiles(orbit, [start.site], start.time + s)[0]
    ratio = (1.0 - u * u) / ((s + k) * s * (length - s))
    if k > 0.0:
        left = 2.0 * w / length
    else:  # it leaves its wall from rest: pushed inwards, or it sticks
        left = -start.wall * float(orbit.accelerations[first]) / length
    right = 2.0 * w_next / (length * (length + k))
    fenced = np.concatenate([[0.1 * s[0]], s, [length - 0.1 * (length - s[-1])]])
    inner = min(
        _deepest(orbit, first, length, (s[i], ratio[i]), (fenced[i], fenced[i + 2]))
        for i in _dips(ratio)
    )
    worst, when = min(inner, (left, 0.0), (right, length))
    norm = 0.25 * length * length * (0.5 * length + k)
    # an impact is named by its own time, not by one that is it but for rounding
    time = start.time if when == 0.0 else start.time + when
    return (orbit.impacts[second].time if when == length else time), worst * norm


def _times_of_flight(length: float, highest: int) -> FloatArray:
    """A grid without the impacts, finer towards the first: for small k the flight starts flat."""
    size = max(32, math.ceil(max(64, 16 * highest) * length / math.pi))
    step = length / size
    return np.concatenate([step * 0.5 ** np.arange(6, 0, -0.5), step * np.arange(1, size)])


def _dips(ratio: FloatArray) -> NDArray[np.int64]:
    """Local minima on the grid that may be the lowest; the grid misses less than a tenth."""
    lowest = float(ratio.min())
    low = ratio <= lowest + 0.1 * max(abs(lowest), 0.1 * abs(float(ratio[-1])))
    low[1:] &= ratio[1:] <= ratio[:-1]
    low[:-1] &= ratio[:-1] <= ratio[1:]
    return np.flatnonzero(low)


def _deepest(
    orbit: Orbit,
    first: int,
    length: float,
    near: tuple[float, float],
    within: tuple[float, float],
) -> tuple[float, float]:
    """The minimum of the ratio next to a node of the grid, and where: Newton."""
    start, k = orbit.impacts[first], orbit.k
    s, (low, high) = float(near[0]), within
    best = (float(near[1]), s)
    if not low < high:
        return best
    for _ in range(12):
        u, v, w = motion(orbit, start.site, start.time + s)
        n, n1, n2 = 1.0 - u * u, -2.0 * u * v, -2.0 * (v * v + u * w)
        d = (s + k) * s * (length - s)
        d1 = (2.0 * s + k) * (length - s) - (s + k) * s
        d2 = 2.0 * (length - s) - 2.0 * (2.0 * s + k)
        best = min(best, (n / d, s))
        tilt, bend = n1 * d - n * d1, n2 * d - n * d2
        step = tilt / bend if bend > 0.0 else 0.0
        if abs(step) <= 1e-14:
            break
        s = min(max(s - step, low), high)
    return best
