"""Does a solution of (11) keep off the walls where it must not touch them?

Three things can go wrong: a neighbour reaches a wall (15), site 0 meets a wall between its impacts
(B3), the far field, which follows the forcing alone, reaches it. Each has a margin: a float
that is positive inside, zero at the limit and continuous in all parameters.

Beyond a dozen sites the answer of the lattice is one harmonic, ``c_n cos(t - phi)``, whose
amplitude shrinks and changes sign from site to site. The largest displacement is a convex function
of that amplitude, so the first two such sites and the far field bound all the others.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from contbreather.breathers.symmetric import Breather
from contbreather.errors import BadInput
from contbreather.lattice import Lattice
from contbreather.lattice.green import POWERS, TERMS, response_weights

FloatArray = NDArray[np.float64]
HALF_PI = 0.5 * math.pi
NEAR = 13  # (0.03)^12 < 1e-18: the third harmonic has died out two sites earlier
Terms = tuple[float, float, float]  # a value and its first two derivatives
Place = tuple[int | None, float]  # a site, None for the far field, and a time

LIMIT = 1e-9  # a margin this small is said to be at the limit; whether it is ok its sign decides
CLOSE = 1e-4  # crests this close to the highest, by a parabola on the grid, are all polished
FAINT = 1e-17  # an answer to the impacts this small moves a site by less than rounding
BESIDE = 1e-4  # times this close to a crest, or to half of it, are of that crest
TELLING = 1e-12  # where margins vanish together, the least size of what still sets them apart


@dataclass(frozen=True)
class Admissibility:
    """What keeps a solution from being a breather, or by how much it is one.

    Attributes
    ----------
    ok : bool
        All margins are positive.
    max_neighbour : float
        Largest |u_1| over a period, eq. (15); 0 if there is no neighbour.
    margin : float
        The least of the margins below.
    reason : str
        A sentence: what is closest to its limit, or beyond it.
    site, time : int or None, float
        Where and when that is; None stands for the far field.
    neighbours : float
        ``1 - max |u_n|`` over all n != 0; 1 if there are none.
    centre : float
        `centre_margin`, site 0 between its impacts.
    far : float
        ``1 - a max |f|`` on a lattice without end, else 1.
    places : dict
        Of a symmetric breather: site and time of each of the three margins, by name.
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
    places: Mapping[str, Place] = field(default_factory=dict)

    def __bool__(self) -> bool:
        return self.ok

    def __repr__(self) -> str:
        verdict = "ok" if self.ok else "not ok"
        return f"<Admissibility {verdict}, margin {self.margin:.6g}: {self.reason.rstrip('.')}>"


class _Grid(NamedTuple):
    """Times of one flight, with the powers of y that `Flight` needs there."""

    s: FloatArray
    sine: FloatArray  # sin y
    powers: FloatArray  # y^(2i+1), shape (POWERS, M)


@lru_cache(maxsize=16)
def _grid(size: int) -> _Grid:
    s = math.pi * np.arange(size) / size
    y = s - HALF_PI
    return _Grid(s, np.sin(y), y ** (2.0 * np.arange(POWERS)[:, None] + 1.0))


@lru_cache(maxsize=64)
def _distances(lattice: Lattice) -> tuple[NDArray[np.int64], FloatArray]:
    """Distances of the sites to look at, and what makes flights of powers of 4 gamma."""
    found = sorted({lattice.distance(n) for n in range(1, NEAR + 1)} - {0})
    moments = np.array([lattice.moments(n) for n in found]).reshape(len(found), 1, TERMS + 1)
    return np.array(found, dtype=np.int64), response_weights() * moments


def _grid_size(breather: Breather) -> int:
    # sixteen points to the half period of the highest harmonic: no crest hides between them
    return max(64, 16 * breather.forcing.highest)


def _profiles(breather: Breather) -> tuple[NDArray[np.int64], FloatArray, _Grid]:
    """u_n over one flight for the sites that matter, shape (sites, M)."""
    grid = _grid(_grid_size(breather))
    sites, weights = _distances(breather.lattice)
    x = 4.0 * breather.gamma
    first = 4.0 / math.pi * breather.lattice.first_harmonic(breather.gamma, sites)
    # sites that the impacts do not reach move as the first of them does
    felt = 1 + int(np.count_nonzero(breather.p * np.abs(first) > FAINT))
    sites, weights, first = sites[:felt], weights[:felt], first[:felt]
    powers = weights @ (x ** np.arange(TERMS + 1))
    driven = breather.a * breather.forcing.f(breather.phi + grid.s)
    return sites, driven + breather.p * (powers @ grid.powers - first[:, None] * grid.sine), grid


def admissibility(breather: Breather) -> Admissibility:
    """Whether, and by how much, a solution of (11) keeps off all walls it must not touch.

    Parameters
    ----------
    breather : Breather
        Any solution of (11), on any lattice, with any forcing.

    Returns
    -------
    Admissibility
        Truthy when admissible. With k = 0 site 0 leaves its wall with velocity 0: then its
        acceleration must point inwards, or it sticks, and the centre's margin says so.

    Examples
    --------
    >>> from contbreather.breathers.symmetric import symmetric
    >>> verdict = admissibility(symmetric(0.5, 0.12, 0.4))
    >>> verdict.ok, round(verdict.max_neighbour, 12)
    (True, 0.667948289045)
    """
    peaks = _neighbour_peaks(breather)
    nothing = (1, (breather.phi, 0.0))
    site, (time, highest) = max(peaks.items(), key=lambda item: item[1][1], default=nothing)
    centre_time, centre = _centre(breather)
    endless = breather.lattice.sites is None
    far = 1.0 - breather.a * breather.forcing.peak() if endless else 1.0
    places: dict[str, Place] = {
        "neighbours": (site, time),
        "centre": (0, centre_time),
        "far": (None, breather.phi),
    }
    margins = {"neighbours": 1.0 - highest, "centre": centre, "far": far}
    least = min(margins, key=margins.__getitem__)
    margin, (where, when) = margins[least], places[least]
    return Admissibility(
        ok=margin > 0.0,
        max_neighbour=peaks[1][1] if peaks else 0.0,
        margin=margin,
        reason=_reason(breather, margin, where, when),
        site=where,
        time=when,
        places=places,
        **margins,
    )


def _reason(breather: Breather, margin: float, site: int | None, time: float) -> str:
    if site is None:
        reach = f"the far field follows the forcing and reaches |u| = {1.0 - margin:.6g}"
    elif site > 0:
        reach = f"site {site} reaches |u| = {1.0 - margin:.6g} at t = {time:.6g}"
    elif breather.k == 0.0 and time == breather.phi:
        way = "inwards" if margin > 0.0 else "into the wall, so it sticks"
        reach = f"after its impact with k = 0 site 0 is pushed {way}"
    elif time in (breather.phi, breather.phi + math.pi):
        speed = breather.w_minus * (breather.k if time == breather.phi else 1.0)
        reach = f"the impact of site 0 itself, at velocity {speed:.6g}"
        if abs(margin) < LIMIT:
            reach = f"the impact of site 0 itself vanishes, at velocity {speed:.2g}"
    else:
        there = breather.displacement(0, time)
        reach = f"site 0 between its impacts is at u = {there:.6g} at t = {time:.6g}"
    if abs(margin) < LIMIT:
        return f"at the limit: {reach}."
    if margin > 0.0:
        return f"every site keeps off its walls; closest to the limit: {reach}."
    rule = {None: "|a f| <= 1", 0: "(B3)"}.get(site, "(15)")
    return f"no breather: {reach}; {rule} is broken."


# ------------------------------------------------------------------------------- any site


def phase(breather: Breather, t: float) -> tuple[float, float]:
    """Time from the middle of the flight, and its sign."""
    flights = math.floor((t - breather.phi) / math.pi)
    sign = -1.0 if flights % 2 else 1.0
    return t - breather.phi - (flights + 0.5) * math.pi, sign


def motion(breather: Breather, site: int, t: float) -> tuple[float, float, float]:
    """Displacement, velocity, acceleration of a site, once differentiable in everything: no special
    case at an impact."""
    a, f = breather.a, breather.forcing
    y, sign = phase(breather, t)
    flight, p = breather.flight(site), sign * breather.p
    return (
        float(a * f.f(t) + p * flight.value(y)),
        float(a * f.df(t) + p * flight.slope(y)),
        float(a * f.d2f(t) + p * flight.curvature(y)),
    )


# ------------------------------------------------------------------------------- neighbours


def neighbour_peak(breather: Breather, n: int = 1) -> tuple[float, float]:
    """When and how high a site that must not impact climbs: ``(t, max over t of |u_n|)``.

    The time is in [phi, phi + 2 pi) and the one of the two at which u_n is positive, so grazing is
    ``u_n(t) = 1, u_n'(t) = 0``; both are met to machine precision.

    Parameters
    ----------
    breather : Breather
    n : int, default 1
        Any site but the impacting one. On a lattice without neighbours: ``(phi, 0)`` for n = 1.

    Raises
    ------
    BadInput
        If n is the impacting site.

    Examples
    --------
    >>> from contbreather.breathers.symmetric import symmetric
    >>> b = symmetric(0.5, 0.12, 0.4)
    >>> t, height = neighbour_peak(b)
    >>> round(height, 12), abs(b.velocity(1, t)) < 1e-14
    (0.667948289045, True)
    """
    distance = breather.lattice.distance(n)
    if distance == 0:
        if breather.lattice.sites == 1 and n == 1:
            return breather.phi, 0.0
        raise BadInput(f"n = {n}: that is the impacting site; ask about one that must not impact.")
    grid = _grid(_grid_size(breather))
    profile = _profile(breather, n, grid)
    return _polish_row(breather, n, profile, _estimates(profile[None, :])[0], grid)


def _profile(breather: Breather, n: int, grid: _Grid) -> FloatArray:
    own = breather.flight(n).value(grid.s - HALF_PI)
    return np.asarray(breather.a * breather.forcing.f(breather.phi + grid.s) + breather.p * own)


def highest_neighbour(breather: Breather) -> tuple[int, float, float]:
    """Which site that must not impact climbs highest: ``(n, t, |u_n|)``; ``(1, phi, 0)`` if none.

    On the upper branch of (13) it is the nearest one wherever that matters (the paper's
    Appendix B); on the lower branch, and for other forcings, it is often the second.

    Examples
    --------
    >>> from contbreather.breathers.symmetric import symmetric_roots
    >>> [highest_neighbour(b)[0] for b in symmetric_roots(0.9, 0.12, 0.8)]
    [1, 2]
    """
    peaks = _neighbour_peaks(breather)
    if not peaks:
        return 1, breather.phi, 0.0
    n = max(peaks, key=lambda site: peaks[site][1])
    return n, *peaks[n]


def _neighbour_peaks(
    breather: Breather, apart_from: int | None = None
) -> dict[int, tuple[float, float]]:
    """Highest points, polished, of the nearest site and of every other that could top all; without
    one site, if it is named, those of all nearer sites and of the highest farther ones."""
    sites, profiles, grid = _profiles(breather)
    near = sites <= 1
    if apart_from is not None:
        others = sites != apart_from
        sites, profiles = sites[others], profiles[others]
        near = sites < apart_from
    if not sites.size:
        return {}
    estimates = _estimates(profiles)
    tops = estimates.max(axis=1)
    compared = tops if apart_from is None else tops[~near]
    # the parabola errs by a fraction of the crest, however low that is
    enough = (1.0 - CLOSE) * float(compared.max(initial=0.0))
    return {
        int(sites[i]): _polish_row(breather, int(sites[i]), profiles[i], estimates[i], grid)
        for i in range(sites.size)
        if near[i] or tops[i] >= enough
    }


def _estimates(profiles: FloatArray) -> FloatArray:
    """Heights of the crests of |u| by a parabola through three points of the grid; 0 elsewhere."""
    u = np.abs(profiles)  # of period pi, by antisymmetry
    before, after = np.roll(u, 1, axis=1), np.roll(u, -1, axis=1)
    crest = (u >= before) & (u >= after)
    bend = np.where(crest, 2.0 * u - before - after, 1.0)
    lift = np.divide((after - before) ** 2, 8.0 * bend, out=np.zeros_like(u), where=bend > 0.0)
    return np.where(crest, u + lift, 0.0)


def _polish_row(
    breather: Breather, n: int, profile: FloatArray, estimate: FloatArray, grid: _Grid
) -> tuple[float, float]:
    step = math.pi / grid.s.size
    top = float(estimate.max())
    best = (breather.phi, -1.0)
    for i in np.flatnonzero(estimate >= (1.0 - CLOSE) * top):
        t, height = _polish(breather, n, float(grid.s[i]), step)
        if profile[i] < 0.0:
            t += math.pi
        if height > best[1]:
            best = (breather.phi + t % (2.0 * math.pi), height)
    return best


def _polish(breather: Breather, n: int, s: float, step: float) -> tuple[float, float]:
    """Extremum of u_n within a grid step of ``s``: Newton, kept in by bisection."""
    flight, a, p, phi = breather.flight(n), breather.a, breather.p, breather.phi
    forcing = breather.forcing

    def flown(s: float) -> tuple[float, float]:
        # a grid step may reach over the impact, into the next flight with the other sign
        over = math.floor(s / math.pi)
        return s - over * math.pi - HALF_PI, (-p if over % 2 else p)

    def slope(s: float) -> float:
        y, sign = flown(s)
        return float(a * forcing.df(phi + s) + sign * flight.slope(y))

    low, high = s - step, s + step
    rising = slope(low)
    for _ in range(60):
        y, sign = flown(s)
        tilt = float(a * forcing.df(phi + s) + sign * flight.slope(y))
        bend = float(a * forcing.d2f(phi + s) + sign * flight.curvature(y))
        if tilt == 0.0:
            break
        low, high = (s, high) if (tilt > 0.0) == (rising > 0.0) else (low, s)
        last, s = s, s - tilt / bend if bend else low
        if not low <= s <= high:
            s = 0.5 * (low + high)
        if abs(s - last) <= 4e-16 * (1.0 + abs(s)):
            break
    y, sign = flown(s)
    return s, abs(float(a * forcing.f(phi + s) + sign * flight.value(y)))


# ----------------------------------------------------------------------------------- centre


def centre_margin(breather: Breather) -> float:
    """How far site 0 keeps off its walls between its impacts, (B3), regular at both of them.

    The least of ``(1 - u_0^2)/((s + k) s (pi - s))`` over the flight, times its value of the
    denominator at mid flight. The impacts at s = 0 and s = pi are divided out; s + k does it for
    k = 0 too, where u_0 leaves its wall quadratically (and the margin turns into the inward
    acceleration: 0 where it would stick). So it is continuous for all k in [0, 1].
    """
    return _centre(breather)[1]


def _centre(breather: Breather) -> tuple[float, float]:
    """Time and value of the centre's margin."""
    b, pi = breather, math.pi
    s = _centre_grid(_grid_size(b))
    own = b.flight(0).value(s - HALF_PI)
    ratio = (1.0 - (b.a * b.forcing.f(b.phi + s) + b.p * own) ** 2) / ((s + b.k) * s * (pi - s))
    # the two ends, by de l'Hospital
    left = 2.0 * b.w_minus / pi if b.k > 0.0 else -b.acceleration / pi
    right = 2.0 * b.w_minus / (pi * (pi + b.k))
    ends = (0.1 * float(s[0]), pi - 1e-3 * (pi - float(s[-1])))
    inner = _least(lambda s: _centre_terms(b, s), s, ratio, ends)
    worst, when = min(inner, (left, 0.0), (right, pi))
    return b.phi + when, worst * 0.25 * pi * pi * (HALF_PI + b.k)


def _centre_terms(breather: Breather, s: float) -> tuple[Terms, Terms]:
    b, k, y, t = breather, breather.k, s - HALF_PI, breather.phi + s
    flight, rest = b.flight(0), math.pi - s
    u = b.a * b.forcing.f(t) + b.p * flight.value(y)
    v = b.a * b.forcing.df(t) + b.p * flight.slope(y)
    w = b.a * b.forcing.d2f(t) + b.p * flight.curvature(y)
    d = (s + k) * s * rest, (2.0 * s + k) * rest - (s + k) * s, 2.0 * rest - 2.0 * (2.0 * s + k)
    return (1.0 - u * u, -2.0 * u * v, -2.0 * (v * v + u * w)), d


def _dips(ratio: FloatArray) -> NDArray[np.int64]:
    """Local minima on the grid that may be the lowest; the grid misses less than a tenth."""
    lowest = float(ratio.min())
    low = ratio <= lowest + 0.1 * max(abs(lowest), 0.1 * float(ratio[-1]))
    low[1:] &= ratio[1:] <= ratio[:-1]
    low[:-1] &= ratio[:-1] <= ratio[1:]
    return np.flatnonzero(low)


@lru_cache(maxsize=16)
def _centre_grid(size: int) -> FloatArray:
    """The grid without its impact, and finer towards it: for small k the flight starts flat."""
    step = math.pi / size
    return np.concatenate([step * 0.5 ** np.arange(6, 0, -0.5), step * np.arange(1, size)])


def _least(
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


# ------------------------------------------------------------------------ besides a grazing crest


class Rival(NamedTuple):
    """What else may touch a wall where one crest does: how far it keeps off, where and when."""

    margin: float
    site: int
    time: float


def rivals(breather: Breather, site: int, t: float) -> list[Rival]:
    """Everything that may touch a wall besides the crest of one site at one time, which does.

    The far field is not among them: its displacement lies between those of two neighbours far out,
    so it is never highest by more than rounding.

    Without coupling, or without an impact, all other sites follow the forcing alike, and margins
    vanish together, like ``p gamma^n``, n the distance of the nearer of the two sites. What is
    returned is ``m/(|m| + p gamma^n)``, between -1 and 1, of the sign of each margin m and no zero
    that says nothing; 1 where rounding decides that sign.
    """
    centre_time, centre = _centre(breather)
    own = _beside_own_crest(breather, site, t)
    found = [(*own, site), (centre, centre_time, 0)] if site else [(*own, 0)]
    peaks = _neighbour_peaks(breather, apart_from=site)
    found += [(1.0 - height, when, n) for n, (when, height) in peaks.items()]
    return [
        Rival(_told_apart(margin, breather.p * breather.gamma ** min(n, site)), n, when)
        for margin, when, n in found
    ]


def _told_apart(margin: float, size: float) -> float:
    return 1.0 if size < TELLING else margin / (abs(margin) + size)


def _beside_own_crest(breather: Breather, site: int, t: float) -> tuple[float, float]:
    """Least of the margin of a site whose crest at ``t`` touches a wall, and when: that crest, a
    double zero, is divided out, so what is left tells the others, and where it is no crest."""
    if site == 0:
        return _beside_own_dip(breather, t)
    b, phi = breather, breather.phi
    crest = (t - phi) % (2.0 * math.pi)
    wall = math.copysign(1.0, motion(b, site, t)[0])
    grid = _grid(_grid_size(b))
    half = _profile(b, site, grid)
    s = np.concatenate([grid.s, grid.s + math.pi])
    u = wall * np.concatenate([half, -half])
    away = np.abs(np.sin(0.5 * (s - crest))) > BESIDE
    s, u = s[away], u[away]
    ratio = (1.0 - u) / (1.0 - np.cos(s - crest))

    def terms(s: float) -> tuple[Terms, Terms]:
        u, v, w = motion(b, site, phi + s)
        c = math.cos(s - crest)
        if abs(math.sin(0.5 * (s - crest))) <= BESIDE:  # 0/0 but for rounding: by de l'Hospital
            return (-wall * w, 0.0, 0.0), (c, 0.0, 0.0)
        return (1.0 - wall * u, -wall * v, -wall * w), (1.0 - c, math.sin(s - crest), c)

    step = math.pi / grid.s.size
    least, when = _least(terms, s, ratio, (float(s[0]) - step, float(s[-1]) + step))
    return least, phi + when % (2.0 * math.pi)


def _beside_own_dip(breather: Breather, t: float) -> tuple[float, float]:
    """The same for site 0, whose margin is `centre_margin`."""
    b, pi, phi = breather, math.pi, breather.phi
    dip = (t - phi) % pi
    s = _centre_grid(_grid_size(b))
    s = s[np.abs(s - dip) > BESIDE]
    u = b.a * b.forcing.f(phi + s) + b.p * b.flight(0).value(s - HALF_PI)
    ratio = (1.0 - u * u) / ((s + b.k) * s * (pi - s) * (s - dip) ** 2)

    def terms(s: float) -> tuple[Terms, Terms]:
        n, (d, d1, d2) = _centre_terms(b, s)
        e = s - dip
        if abs(e) <= BESIDE:
            return (0.5 * n[2], 0.0, 0.0), (d, 0.0, 0.0)
        return n, (d * e * e, (d1 * e + 2.0 * d) * e, (d2 * e + 4.0 * d1) * e + 2.0 * d)

    least, when = _least(terms, s, ratio, (0.1 * float(s[0]), pi - 1e-3 * (pi - float(s[-1]))))
    return least, phi + when
