"""What else may touch a wall where one crest does: other sites, and other crests of the same one.

The crest that grazes is a double zero of its margin. It is divided out, so that what is left
vanishes where a second one comes to the wall.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contbreather.breathers import clearance_loops
from contbreather.breathers.clearance import (
    Gap,
    Terms,
    Watch,
    called,
    denominator,
    flown,
    gaps_of,
    gaps_of_flights,
    gaps_of_idle,
    least_ratio,
    points_of,
    seen,
)

FloatArray = NDArray[np.float64]

ALIKE = 1e-9  # sites whose motions differ by less are images of each other
BESIDE = 1e-4  # times this close to a crest, or to half of it, are of that crest
TELLING = 1e-12  # where margins vanish together, the least size of what still sets them apart
MIRRORED = 1e-13  # the margin of a crest that symmetry makes touch the other wall at the same place

_RIVALS = clearance_loops.RIVALS


def rivals(orbit: Watch, site: int, t: float, *, mirrored: bool = False) -> list[Gap]:
    """Everything that may touch a wall besides the crest of one site at one time, which does.

    With `mirrored` the orbit is a symmetric one with its whole period written out: the crest at the
    other wall, half a period later, is the same again. On an arm it is not, and both come together
    at the pitchfork.

    The far field is not among them: its displacement lies between those of two neighbours far out,
    so it is never highest by more than rounding.

    Without coupling, or without an impact, all sites that do not hit follow the forcing alike, and
    margins vanish together, like the answer of the nearer of two sites to an impact. What is
    returned is ``m/(|m| + that)``, between -1 and 1, of the sign of each margin m and no zero that
    says nothing; 1 where rounding decides that sign.
    """
    flights = list(gaps_of_flights(orbit))
    if site in {own.site for own in orbit.flights}:
        found = [*_besides_dip(orbit, site, t, flights), *gaps_of_idle(orbit)]
    else:
        found = [*_besides_crest(orbit, site, t, mirrored), *flights, *gaps_of_others(orbit, site)]
    least = orbit.felt(site)
    return [
        gap._replace(margin=_told_apart(gap.margin, max(least, orbit.felt(gap.site))))
        for gap in found
    ]


def least_rival(orbit: Watch, site: int, t: float, *, mirrored: bool = False) -> float:
    """The least of all `rivals`, without a word on whose it is."""
    code = None if site in {own.site for own in orbit.flights} else _RIVALS.code()
    packed = None if code is None else orbit.packed()
    if code is None or packed is None or site not in packed.sites:
        return min(rivals(orbit, site, t, mirrored=mirrored)).margin
    return called(code, packed, rivals_data(orbit, packed, site, t, mirrored=mirrored))


def rivals_data(orbit: Watch, packed: Any, site: Any, t: float, *, mirrored: bool) -> FloatArray:
    """The data of `clearance_loops.rivals`."""
    felt = (orbit.felt(n) for n in packed.sites)
    return np.concatenate([packed.data, [packed.sites.index(site), t, mirrored, *felt]])


def gaps_of_others(orbit: Watch, site: int) -> list[Gap]:
    """The margins of all idle sites that feel the impacts more than this one, and of any other that
    may be less than those of its like; apart from itself and its images by symmetry."""
    sites = orbit.idle
    u = orbit.profiles(np.append(sites, site), points_of(orbit, orbit.length))
    other = (abs(u[:-1] - u[-1]).max(axis=1) > ALIKE) & (sites != site)
    sites, u, felt = sites[other], u[:-1][other], orbit.felt(site)
    more = np.array([orbit.felt(n) > felt for n in sites.tolist()], dtype=bool)
    near = gaps_of(orbit, sites[more], u[more], sites.tolist())
    return near + gaps_of(orbit, sites[~more], u[~more], orbit.beside)


def _told_apart(margin: float, size: float) -> float:
    return 1.0 if size < TELLING else margin / (abs(margin) + size)


def _besides_crest(orbit: Watch, site: int, t: float, mirrored: bool) -> list[Gap]:
    """Margins of a site whose crest at ``t`` touches a wall: that crest, a double zero, is divided
    out, so what is left tells the others, and where it is no crest."""
    (low, high), u = orbit.walls(site), orbit.at(site, t)[0]
    side, wall = (1.0, high) if high - u < u - low else (-1.0, low)
    sites = np.array([site])
    size = points_of(orbit, orbit.length)
    path = orbit.profiles(sites, size)
    found = [_undivided(orbit, site, t, side, wall, path[0])]
    if orbit.sign > 0:  # otherwise the other wall is that of the other half
        other = (low, math.inf) if side > 0.0 else (-math.inf, high)
        if any(map(math.isfinite, other)):
            more = gaps_of(orbit, sites, path, sites.tolist(), [other])
            found += [gap for gap in more if not (mirrored and abs(gap.margin) < MIRRORED)]
    return found


def _undivided(
    orbit: Watch, site: int, t: float, side: float, wall: float, path: FloatArray
) -> Gap:
    """The least of the distance from a wall over ``1 - cos`` of the time since its crest."""
    step, period = orbit.length / path.size, orbit.length
    if orbit.sign < 0:
        path, period = np.concatenate([path, -path]), 2.0 * period
    turn, crest = 2.0 * math.pi / period, (t - orbit.start) % period
    s = step * np.arange(path.size)
    away = np.abs(np.sin(0.5 * turn * (s - crest))) > BESIDE
    s, u = s[away], path[away]
    ratio = side * (wall - u) / (1.0 - np.cos(turn * (s - crest)))

    def terms(s: float) -> tuple[Terms, Terms]:
        u, v, w = orbit.at(site, orbit.start + s)
        angle = turn * (s - crest)
        c, bend = math.cos(angle), turn * turn * math.cos(angle)
        if abs(math.sin(0.5 * angle)) <= BESIDE:  # 0/0 but for rounding: by de l'Hospital
            return (-side * w, 0.0, 0.0), (bend, 0.0, 0.0)
        d = (1.0 - c, turn * math.sin(angle), bend)
        return (side * (wall - u), -side * v, -side * w), d

    least, when = least_ratio(terms, s, ratio, (float(s[0]) - step, float(s[-1]) + step))
    return Gap(least, site, orbit.start + when % period)


def _besides_dip(orbit: Watch, site: int, t: float, flights: list[Gap]) -> list[Gap]:
    """The same of a site between its impacts, and the margins of all other flights."""
    period = orbit.length * (1.0 if orbit.sign > 0 else 2.0)
    found = []
    for i, own in enumerate(orbit.flights):
        dip = (t - own.start) % period
        if orbit.sign < 0 and dip > own.length:
            dip -= orbit.length
        mine = own.site == site and 0.0 < dip < own.length
        found.append(_besides_own_dip(orbit, i, dip) if mine else flights[i])
    return found


def _besides_own_dip(orbit: Watch, flight: int, dip: float) -> Gap:
    own = orbit.flights[flight]
    room, s, ends = seen(orbit, own)
    s = s[np.abs(s - dip) > BESIDE]
    u = orbit.path(own.site, own.start + s)
    ratio = room.of(u) / (denominator(orbit.k, own.length, s) * (s - dip) ** 2)

    def terms(s: float) -> tuple[Terms, Terms]:
        n, (d, d1, d2) = flown(orbit, own, room, s)
        e = s - dip
        if abs(e) <= BESIDE:
            return (0.5 * n[2], 0.0, 0.0), (d, 0.0, 0.0)
        return n, (d * e * e, (d1 * e + 2.0 * d) * e, (d2 * e + 4.0 * d1) * e + 2.0 * d)

    least, when = least_ratio(terms, s, ratio, (0.1 * float(s[0]), ends[1]))
    return Gap(least, own.site, own.start + when, flight)
