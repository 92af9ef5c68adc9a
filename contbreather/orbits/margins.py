"""Margins: how far sites keep from their walls, each the least of a quotient n(s)/d(s) in time.

For a site without impacts n is the distance from the nearer wall and d is 1. Between two impacts of
a site n is the product of the distances from both walls, ``1 - u^2`` as a rule, and

    ``d = (s + k) s (L - s)``,

s the time since the one impact, L - s to the next: regular at both, for k = 0 too, where a site
leaves its wall quadratically and the margin turns into its inward acceleration; and zero when an
incoming velocity is. Where a site is known to touch a wall, a double zero of n, that contact is
divided out: what is left vanishes where another one comes to the wall.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from contbreather.kernels import Cube, Kernel, Matrix, Signs, Vector, inlined
from contbreather.lattice.periodic_green import Responses
from contbreather.orbits.section import SHORT
from contbreather.orbits.site_motion import (
    BACK,
    HIGH,
    IMAGE,
    IMPULSE,
    LOW,
    OFFSET,
    SITE,
    TIME,
    WALL,
    Forced,
    Motion,
    points_of,
    site_state,
    state,
)

ROUNDING = 1e-15  # of a margin
TIE = 1e-13  # of margins that differ by less, mirror images mostly, the first is named
FLAT = 1e-8  # times this close to a minimum are it
CONTACT = 1e-4  # times this close to a contact, or phases to half of it, belong to it
STEEP = 12  # points that lie closer together at the start of a flight: for small k it is flat there
NONE = -1.0  # no contact

# rows of the workspace: places and quotients on a grid; then what is found of each flight and site
PLACE, RATIO, FOUND = range(3)
MARGIN, WHEN, LENGTH, NEXT = range(4)  # columns of what is found


# --- the least of a quotient ----------------------------------------------------------------------


class Quotient(NamedTuple):
    """Margin of one site, in the time since its origin."""

    site: int
    origin: float
    low: float  # the walls; one at infinity does not count
    high: float
    length: float  # of a flight, or of all the time that is looked at
    flight: bool  # from one impact to the next; else d = 1
    contact: float = NONE  # a double zero to be divided out
    turn: float = 0.0  # its frequency if it recurs


@inlined
def margin_terms(
    q: Quotient, k: float, s: float, u: float, v: float, w: float
) -> tuple[float, float, float, float, float, float]:
    """n and d, each with two derivatives, from the motion of the site."""
    if q.flight and q.high - q.low < math.inf:
        tilt = q.high + q.low - 2.0 * u
        n, n1, n2 = (q.high - u) * (u - q.low), tilt * v, tilt * w - 2.0 * v * v
    elif q.high - u < u - q.low:
        n, n1, n2 = q.high - u, -v, -w
    else:
        n, n1, n2 = u - q.low, v, w
    d, d1, d2 = 1.0, 0.0, 0.0
    if q.flight:
        rest = q.length - s
        d, d1 = (s + k) * s * rest, (2.0 * s + k) * rest - (s + k) * s
        d2 = 2.0 * rest - 2.0 * (2.0 * s + k)
    if q.contact < 0.0:
        return n, n1, n2, d, d1, d2
    e = s - q.contact
    if q.turn > 0.0:
        c, near = math.cos(q.turn * e), abs(math.sin(0.5 * q.turn * e)) <= CONTACT
        z, z1, z2 = 1.0 - c, q.turn * math.sin(q.turn * e), q.turn * q.turn * c
    else:
        z, z1, z2, near = e * e, 2.0 * e, 2.0, abs(e) <= CONTACT
    if near:  # 0/0 but for rounding: by de l'Hospital
        return n2, 0.0, 0.0, d * z2, 0.0, 0.0
    return n, n1, n2, d * z, d1 * z + d * z1, d2 * z + 2.0 * d1 * z1 + d * z2


def polished(motion: Motion, q: Quotient, s: float, low: float, high: float) -> tuple[float, float]:
    """The minimum of a quotient next to s, and where: Newton's method on the numerator of its
    derivative, bisection where that leaves the bracket."""
    best, where, bisected = math.inf, s, 0
    for _ in range(60):
        if bisected == 9:  # it falls up to an end, which has a value of its own
            break
        u, v, w = site_state(motion, q.site, q.origin + s)
        n, n1, n2, d, d1, d2 = margin_terms(q, motion.places[q.site, BACK], s, u, v, w)
        if n / d <= best + ROUNDING / abs(d):  # the later, the more exact is s
            best, where = min(best, n / d), s
        tilt, curvature = n1 * d - n * d1, n2 * d - n * d2
        if tilt > 0.0:
            high = s
        else:
            low = s
        # what is left changes 1e-16 of the value
        if curvature > 0.0 and abs(tilt) <= FLAT * curvature:
            return best, s - tilt / curvature if where == s else where
        last = s
        s = s - tilt / curvature if curvature > 0.0 else low
        if not low < s < high:
            bisected, s = bisected + 1, 0.5 * (low + high)
        if abs(s - last) <= FLAT:
            break
    return best, where


def least_quotient(motion: Motion, q: Quotient, points: int, work: Matrix) -> tuple[float, float]:
    """The least of a quotient, and where: each minimum on a grid that may be it is polished between
    its neighbours. The grid, finer at the start of a flight, misses less than a tenth; without one
    it goes round a circle, and both its ends come twice."""
    lowest, most, ends = math.inf, 0.0, 0 if q.flight else 1
    size = STEEP + points - 1 if q.flight else points + 2
    for p in range(size):
        part = (p - STEEP + 1.0) / points if q.flight else (p - 1.0) / points
        if q.flight and p < STEEP:
            part = 0.5 ** (6.0 - 0.5 * p) / points
        s = part * q.length
        u, v, w = site_state(motion, q.site, q.origin + s)
        n, _, _, d, _, _ = margin_terms(q, motion.places[q.site, BACK], s, u, v, w)
        work[PLACE, p], work[RATIO, p] = s, n / d
        lowest, most = min(lowest, n / d), max(most, abs(n / d))
    enough = lowest + 0.1 * max(abs(lowest), 0.1 * most)
    best, where = math.inf, 0.0
    for p in range(ends, size - ends):
        before, after = 0.1 * work[PLACE, 0], q.length * (1.0 - 1e-3 / points)
        value = work[RATIO, p]
        if value > enough:
            continue
        if p > 0:
            before = work[PLACE, p - 1]
            if value > work[RATIO, p - 1]:
                continue
        if p + 1 < size:
            after = work[PLACE, p + 1]
            if value > work[RATIO, p + 1]:
                continue
        value, place = polished(motion, q, work[PLACE, p], before, after)
        if value < best - TIE:
            best, where = value, place
    return best, where


# --- between the impacts of a site ----------------------------------------------------------------


def next_impact(motion: Motion, i: int) -> tuple[float, int]:
    """The time up to the next impact of the same site, and which that is."""
    length, then = period_of(motion), i
    for j in range(motion.impacts.shape[1]):
        since = elapsed(motion, motion.impacts[TIME, i], motion.impacts[TIME, j])
        if j != i and motion.impacts[SITE, j] == motion.impacts[SITE, i] and since < length:
            length, then = since, j
    return length, then


def period_of(motion: Motion) -> float:
    return motion.length * (2.0 if motion.sign < 0.0 else 1.0)


def elapsed(motion: Motion, since: float, t: float) -> float:
    """The time from one moment to another, less than a period."""
    return t - since - period_of(motion) * math.floor((t - since) / period_of(motion))


def speed_of(motion: Motion, i: int) -> float:
    """Into the wall, just before an impact."""
    k = motion.places[int(motion.impacts[SITE, i]), BACK]
    return float(-motion.impacts[WALL, i] * motion.impacts[IMPULSE, i] / (1.0 + k))


def flight_margin(
    motion: Motion, i: int, length: float, then: int, contact: float, work: Matrix
) -> tuple[float, float]:
    """The margin of a site from impact i to its next, unscaled beside a contact; and when."""
    site, start = int(motion.impacts[SITE, i]), motion.impacts[TIME, i]
    low, high, k = motion.places[site, LOW], motion.places[site, HIGH], motion.places[site, BACK]
    best, where = math.inf, 0.0
    if length <= 0.0:  # two impacts at once
        return length, length
    if length > SHORT or contact >= 0.0:
        q = Quotient(site, start, low, high, length, True, contact, 0.0)
        best, where = least_quotient(motion, q, points_of(motion.fine, length), work)
    if contact >= 0.0:
        return best, where
    # the quotient at both impacts, by de l'Hospital
    width = high - low if high - low < math.inf else 1.0
    left, right = speed_of(motion, i) / length, speed_of(motion, then) / (length * (length + k))
    if k == 0.0:
        left = -0.5 * motion.impacts[WALL, i] * state(motion, site, start)[2] / length
    if width * left < best + TIE:
        best, where = width * left, 0.0
    if width * right < best - TIE:
        best, where = width * right, length
    # times d at mid flight, of a short one so large that its zero is simple
    L = max(length, SHORT)
    return best * 0.25 * L * L * (0.5 * L + k), where


# --- of a site without impacts --------------------------------------------------------------------


def idle_margin(
    motion: Motion, site: int, low: float, high: float, work: Matrix
) -> tuple[float, float]:
    """The least distance of a site from walls, and when."""
    q = Quotient(site, motion.start, low, high, motion.length, False, NONE, 0.0)
    best, where = least_quotient(motion, q, points_of(motion.fine, motion.length), work)
    if motion.sign < 0.0 and state(motion, site, motion.start + where)[0] < 0.0:
        where += motion.length  # at the wall +1
    return best, where


def besides_contact(motion: Motion, site: int, contact: float, work: Matrix, row: int) -> None:
    """Margins of a site beside its contact: the least at that wall, and the least at the other."""
    period, low, high = period_of(motion), motion.places[site, LOW], motion.places[site, HIGH]
    u = state(motion, site, motion.start + contact)[0]
    upper = high - u < u - low
    own_low, own_high = (-math.inf, high) if upper else (low, math.inf)
    turn = 2.0 * math.pi / period
    q = Quotient(site, motion.start, own_low, own_high, period, False, contact, turn)
    points = points_of(motion.fine, motion.length) * (2 if motion.sign < 0.0 else 1)
    work[row, MARGIN], work[row, WHEN] = least_quotient(motion, q, points, work)
    low, high = (low, math.inf) if upper else (-math.inf, high)
    if motion.sign > 0.0 and (low > -math.inf or high < math.inf):
        work[row + 1, MARGIN], work[row + 1, WHEN] = idle_margin(motion, site, low, high, work)


def is_image(motion: Motion, site: int, other: int) -> bool:
    for wall in (LOW, HIGH):
        if motion.places[site, wall] != motion.places[other, wall]:
            return False
    points = points_of(motion.fine, motion.length)
    for p in range(points):
        t = motion.start + motion.length / points * p
        if abs(state(motion, site, t)[0] - state(motion, other, t)[0]) > IMAGE:
            return False
    return True


def largest_displacement(motion: Motion, site: int) -> float:
    """No less than the largest displacement of a site."""
    total = abs(motion.places[site, OFFSET]) + motion.a * motion.forced.peak
    for j in range(motion.responses.which.shape[1]):
        largest = motion.responses.largest[motion.responses.which[site, j]]
        total += abs(motion.impacts[IMPULSE, j]) * largest
    return float(total)


# --- all of them ----------------------------------------------------------------------------------


def margins(
    motion: Motion, near: Signs, ceiling: float, touching: int, time: float, work: Matrix
) -> None:
    """The margin, and when, of each flight and of each site without impacts that is near or may
    have the least of the others; besides the contact of one site, if any, which may be its own.

    Those that are not `near` (one number for each site, or none) are wanted only below the ceiling
    and all flights; an infinite one: of all. Site `touching`, unless it is -1, touches its wall at
    `time`. At the end of the work are rows for flights, for sites without impacts and, of one that
    touches, for its other crests at its wall and at the other one; infinite where nothing was
    computed.
    """
    first, below = FOUND + motion.flights, ceiling
    for row in range(FOUND, work.shape[0]):
        work[row, MARGIN] = math.inf
    for i in range(motion.flights):
        length, then = next_impact(motion, i)
        contact = NONE
        if touching == motion.impacts[SITE, i]:
            contact = elapsed(motion, motion.impacts[TIME, i], time)
            if motion.sign < 0.0 and contact > length:
                contact -= motion.length
            contact = contact if 0.0 < contact < length else NONE
        margin, when = flight_margin(motion, i, length, then, contact, work)
        row = FOUND + i
        work[row, MARGIN], work[row, WHEN], work[row, LENGTH], work[row, NEXT] = (
            margin, when, length, then,
        )  # fmt: skip
        if ceiling < math.inf:
            below = min(below, margin)
    if touching >= motion.busy:
        contact = elapsed(motion, motion.start, time)
        besides_contact(motion, touching, contact, work, work.shape[0] - 2)
    for site in range(motion.busy, motion.places.shape[0]):
        low, high = motion.places[site, LOW], motion.places[site, HIGH]
        wanted = near.size > 0 and near[site - motion.busy] != 0
        if not wanted and min(high, -low) - largest_displacement(motion, site) > below + ROUNDING:
            continue  # it cannot be closer
        if site == touching or (touching >= motion.busy and is_image(motion, site, touching)):
            continue
        margin, when = idle_margin(motion, site, low, high, work)
        row = first + site - motion.busy
        work[row, MARGIN], work[row, WHEN] = margin, when
        if not wanted:
            below = min(below, margin)


class Along(NamedTuple):
    """Gather what differs in several motions; where they have it in common, once."""

    a: Vector
    times: Matrix
    impulses: Matrix
    tables: Cube  # of their responses
    largest: Matrix
    cosines: Cube  # of their forced motion
    sines: Cube
    peaks: Vector


def margins_along(
    motion: Motion, along: Along, near: Signs, touching: int, time: float, work: Matrix,
    lowest: Vector,
) -> None:  # fmt: skip
    """The least margin of each of several motions, below the ceiling that was found before."""
    of, forced = motion.responses, motion.forced
    for i in range(along.a.size):
        for j in range(along.times.shape[1]):
            motion.impacts[TIME, j] = along.times[i, j]
            motion.impacts[IMPULSE, j] = along.impulses[i, j]
        t, f = min(i, along.tables.shape[0] - 1), min(i, along.cosines.shape[0] - 1)
        drive = Forced(forced.orders, along.cosines[f], along.sines[f], along.peaks[f])
        answers = Responses(
            of.which, along.tables[t], of.rates, of.real, of.imaginary, along.largest[t], of.turns,
            of.half,
        )  # fmt: skip
        varied = Motion(
            along.a[i], along.times[i, 0], motion.length, motion.sign, motion.fine, drive, answers,
            motion.impacts, motion.flights, motion.busy, motion.places,
        )  # fmt: skip
        margins(varied, near, lowest[i], touching, time, work)
        for row in range(FOUND, work.shape[0]):
            lowest[i] = min(lowest[i], work[row, MARGIN])


MARGINS = Kernel(margins_along)
