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

from contbreather.kernels import Kernel, Matrix, Signs, Vector, inlined
from contbreather.lattice.periodic_green import response_since
from contbreather.orbits.section import SHORT
from contbreather.orbits.site_motion import (
    HIGH,
    IMAGE,
    IMPULSE,
    LOW,
    OFFSET,
    SITE,
    TIME,
    WALL,
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

# rows of the workspace: places and quotients on a grid, displacements of two sites and of the
# forced motion; then, from FOUND on, what is found of each flight and site
PLACE, RATIO, PATH, TOUCHING, FORCED, FOUND = range(6)
MARGIN, WHEN, LENGTH, NEXT = range(4)  # columns of what is found


# --- on a grid ------------------------------------------------------------------------------------

# The grid of a section: STEEP times at its start, then equal steps from one before it to its end.


@inlined
def since_start(motion: Motion, p: int, points: int) -> float:
    """The time from the start of the section to place p of so many points."""
    if p < STEEP:
        return float(0.5 ** (6.0 - 0.5 * p) / points * motion.length)
    return float(motion.length / points * (p - STEEP - 1))


@inlined
def has_one_answer(motion: Motion) -> bool:
    """Whether sites that follow the forcing alike answer one impact a section, at its start: on the
    grid they do alike for all amplitudes, momenta and phases."""
    return bool(motion.responses.which.shape[1] == 1 and motion.forced.cosines.shape[0] == 1)


def sample_forced(motion: Motion, points: int, work: Matrix) -> None:
    """The forced motion of all sites."""
    forced = motion.forced
    for p in range(STEEP + points + 2):
        t, f = motion.start + since_start(motion, p, points), 0.0
        for i in range(forced.orders.size):
            angle = forced.orders[i] * t
            f += forced.cosines[0, i] * math.cos(angle) + forced.sines[0, i] * math.sin(angle)
        work[FORCED, p] = motion.a * f


def sample_path(
    motion: Motion, site: int, points: int, row: int, work: Matrix, answers: Matrix
) -> None:
    """The path of a site; only of one that answers one impact at the STEEP times, too."""
    if site >= motion.busy and motion.profiles.size > 0:
        for p in range(STEEP, STEEP + points + 2):
            step = p - STEEP - 1
            flip = motion.sign if (step // points) % 2 != 0 else 1.0
            work[row, p] = flip * motion.profiles[site - motion.busy, step % points]
        return
    if has_one_answer(motion):
        if math.isnan(answers[site, 0]):
            of = motion.responses.which[site, 0]
            for p in range(STEEP + points + 2):
                since = since_start(motion, p, points)
                answers[site, p] = response_since(motion.responses, of, since)[0]
        offset, J = motion.places[site, OFFSET], motion.impacts[IMPULSE, 0]
        for p in range(STEEP + points + 2):
            work[row, p] = offset + work[FORCED, p] + J * answers[site, p]
        return
    for p in range(STEEP, STEEP + points + 2):
        t = motion.start + since_start(motion, p, points)
        work[row, p] = site_state(motion, site, t)[0]


def largest_displacement(motion: Motion, site: int) -> float:
    """No less than the largest displacement of a site."""
    total = abs(motion.places[site, OFFSET]) + motion.a * motion.forced.peak
    for j in range(motion.responses.which.shape[1]):
        largest = motion.responses.largest[motion.responses.which[site, j]]
        total += abs(motion.impacts[IMPULSE, j]) * largest
    return float(total)


# --- the least of a quotient ----------------------------------------------------------------------


class Quotient(NamedTuple):
    """Margin of one site, in the time since its origin."""

    site: int
    origin: float
    low: float  # the walls; one at infinity does not count
    high: float
    length: float = 0.0  # of a flight; 0: d = 1
    contact: float = NONE  # a double zero to be divided out
    turn: float = 0.0  # its frequency if it recurs


@inlined
def margin_terms(
    q: Quotient, k: float, s: float, u: float, v: float, w: float
) -> tuple[float, float, float, float, float, float]:
    """n and d, each with two derivatives, from the motion of the site."""
    if q.low == -math.inf:
        n, n1, n2 = q.high - u, -v, -w
    elif q.high == math.inf:
        n, n1, n2 = u - q.low, v, w
    else:
        tilt = q.high + q.low - 2.0 * u
        n, n1, n2 = (q.high - u) * (u - q.low), tilt * v, tilt * w - 2.0 * v * v
    d, d1, d2 = 1.0, 0.0, 0.0
    if q.length > 0.0:
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
    if q.length == 0.0 and q.contact < 0.0:
        u = state(motion, q.site, q.origin + s)[0]
        if q.high - u < u - q.low:  # the nearer wall
            q = Quotient(q.site, q.origin, -math.inf, q.high, 0.0, NONE, 0.0)
        else:
            q = Quotient(q.site, q.origin, q.low, math.inf, 0.0, NONE, 0.0)
    best, where, bisected = math.inf, s, 0
    for _ in range(60):
        if bisected == 9:  # it falls up to an end, which has a value of its own
            break
        u, v, w = site_state(motion, q.site, q.origin + s)
        n, n1, n2, d, d1, d2 = margin_terms(q, motion.k, s, u, v, w)
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


def least_quotient(
    motion: Motion, q: Quotient, size: int, low: float, high: float, work: Matrix
) -> tuple[float, float]:
    """The least of a quotient that is known on a grid between two ends, and where: each minimum on
    the grid that may be it is polished between its neighbours. The grid misses less than a tenth.
    """
    lowest, most = math.inf, 0.0
    for p in range(size):
        lowest, most = min(lowest, work[RATIO, p]), max(most, abs(work[RATIO, p]))
    enough = lowest + 0.1 * max(abs(lowest), 0.1 * most)
    best, where = math.inf, 0.0
    circle = q.length == 0.0 and q.contact < 0.0  # both ends of the grid come twice
    for p in range(1 if circle else 0, size - 1 if circle else size):
        value = work[RATIO, p]
        if value > enough or (p > 0 and value > work[RATIO, p - 1]):
            continue
        if p + 1 < size and value > work[RATIO, p + 1]:
            continue
        before = work[PLACE, p - 1] if p > 0 else low
        after = work[PLACE, p + 1] if p + 1 < size else high
        value, place = polished(motion, q, work[PLACE, p], before, after)
        if value < best - TIE:
            best, where = value, place
    return best, where


# --- between the impacts of a site ----------------------------------------------------------------


def next_impact(motion: Motion, i: int) -> tuple[float, int]:
    """The time up to the next impact of the same site, and which that is."""
    period = motion.length * (2.0 if motion.sign < 0.0 else 1.0)
    length, then = period, i
    for j in range(motion.impacts.shape[1]):
        since = motion.impacts[TIME, j] - motion.impacts[TIME, i]
        since -= period * math.floor(since / period)
        if j != i and motion.impacts[SITE, j] == motion.impacts[SITE, i] and since < length:
            length, then = since, j
    return length, then


def speed_of(motion: Motion, i: int) -> float:
    """Into the wall, just before an impact."""
    return float(-motion.impacts[WALL, i] * motion.impacts[IMPULSE, i] / (1.0 + motion.k))


def flight_margin(
    motion: Motion, i: int, length: float, then: int, contact: float, work: Matrix, answers: Matrix
) -> tuple[float, float]:
    """The margin of a site from impact i to its next one, and when in that flight; without its
    scale where a contact in it is divided out."""
    k, site, start = motion.k, int(motion.impacts[SITE, i]), motion.impacts[TIME, i]
    low, high = motion.places[site, LOW], motion.places[site, HIGH]
    best, where = math.inf, 0.0
    if length <= 0.0:  # two impacts at once
        return length, length
    if length > SHORT or contact >= 0.0:
        q = Quotient(site, start, low, high, length, contact, 0.0)
        size, points = 0, points_of(motion.fine, length)
        known = has_one_answer(motion)  # then the section is the flight
        if known:
            sample_path(motion, site, points, PATH, work, answers)
        for p in range(STEEP + points - 1):
            part = 0.5 ** (6.0 - 0.5 * p) / points if p < STEEP else (p - STEEP + 1) / points
            s = part * length
            if contact >= 0.0 and abs(s - contact) <= CONTACT:
                continue
            if known:
                u = work[PATH, p if p < STEEP else p + 2]
            else:
                u = site_state(motion, site, start + s)[0]
            n, _, _, d, _, _ = margin_terms(q, k, s, u, 0.0, 0.0)
            work[PLACE, size], work[RATIO, size] = s, n / d
            size += 1
        first, last = 0.1 * work[PLACE, 0], length * (1.0 - 1e-3 / points)
        best, where = least_quotient(motion, q, size, first, last, work)
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


def idle(
    motion: Motion, site: int, low: float, high: float, points: int, work: Matrix
) -> tuple[float, float]:
    """The least distance of a site from walls, and when; its path is in the workspace."""
    step = motion.length / points
    for p in range(points + 2):
        u = work[PATH, STEEP + p]
        work[PLACE, p], work[RATIO, p] = step * (p - 1), min(high - u, u - low)
    q = Quotient(site, motion.start, low, high, 0.0, NONE, 0.0)
    best, where = least_quotient(motion, q, points + 2, -step, motion.length, work)
    if motion.sign < 0.0 and state(motion, site, motion.start + where)[0] < 0.0:
        where += motion.length  # at the wall +1
    return best, where


def besides_contact(
    motion: Motion, site: int, contact: float, points: int, work: Matrix, row: int,
    answers: Matrix,
) -> None:  # fmt: skip
    """Where one maximum of a site, whose path is in the workspace, touches a wall: the least of all
    others there, the contact divided out, and of those at the other wall."""
    sections = 2 if motion.sign < 0.0 else 1
    period, step = sections * motion.length, motion.length / points
    low, high = motion.places[site, LOW], motion.places[site, HIGH]
    u = state(motion, site, motion.start + contact)[0]
    upper = high - u < u - low
    own_low, own_high = (-math.inf, high) if upper else (low, math.inf)
    q = Quotient(site, motion.start, own_low, own_high, 0.0, contact, 2.0 * math.pi / period)
    size = 0
    for p in range(sections * points):
        s = step * p
        if abs(math.sin(0.5 * q.turn * (s - contact))) > CONTACT:
            flip = motion.sign if p >= points else 1.0
            u = flip * work[TOUCHING, STEEP + 1 + p % points]
            n, _, _, d, _, _ = margin_terms(q, motion.k, s, u, 0.0, 0.0)
            work[PLACE, size], work[RATIO, size] = s, n / d
            size += 1
    first, last = work[PLACE, 0] - step, work[PLACE, size - 1] + step
    work[row, MARGIN], work[row, WHEN] = least_quotient(motion, q, size, first, last, work)
    other_low, other_high = (low, math.inf) if upper else (-math.inf, high)
    if sections == 1 and (other_low > -math.inf or other_high < math.inf):
        sample_path(motion, site, points, PATH, work, answers)
        margin, when = idle(motion, site, other_low, other_high, points, work)
        work[row + 1, MARGIN], work[row + 1, WHEN] = margin, when


def is_image(points: int, work: Matrix) -> bool:
    """Whether the two sites whose paths are in the workspace move alike."""
    apart = 0.0
    for p in range(STEEP + 1, STEEP + points + 1):
        apart = max(apart, abs(work[PATH, p] - work[TOUCHING, p]))
    return apart <= IMAGE


def margins(
    motion: Motion, near: Signs, ceiling: float, touching: int, time: float, work: Matrix,
    answers: Matrix,
) -> None:  # fmt: skip
    """The margin, and when, of each flight and of each site without impacts that is near or may
    have the least of the others; besides the contact of one site, if any, which may be its own.

    Parameters
    ----------
    near : array
        1 for sites without impacts whose margin is wanted whatever it is; or empty.
    ceiling : float
        Others are wanted only below it and below those of all flights; infinite: of all.
    touching : int
        The site that touches its wall at `time`; -1: none.
    work : array
        At its end rows for flights, for sites without impacts and, of one that touches, for its
        other crests at its wall and at the other one; infinite where nothing was computed.
    answers : array
        Of each site to one impact, on the grid; NaN unless it has been asked.
    """
    first, points = FOUND + motion.flights, points_of(motion.fine, motion.length)
    period = motion.length * (2.0 if motion.sign < 0.0 else 1.0)
    for row in range(FOUND, work.shape[0]):
        work[row, MARGIN] = math.inf
    if has_one_answer(motion):
        sample_forced(motion, points, work)
    below = ceiling
    for i in range(motion.flights):
        length, then = next_impact(motion, i)
        contact = NONE
        if touching == motion.impacts[SITE, i]:
            contact = time - motion.impacts[TIME, i]
            contact -= period * math.floor(contact / period)
            if motion.sign < 0.0 and contact > length:
                contact -= motion.length
            contact = contact if 0.0 < contact < length else NONE
        row = FOUND + i
        margin, when = flight_margin(motion, i, length, then, contact, work, answers)
        work[row, MARGIN], work[row, WHEN] = margin, when
        work[row, LENGTH], work[row, NEXT] = length, then
        if ceiling < math.inf:
            below = min(below, work[row, MARGIN])
    if touching >= motion.busy:
        contact = (time - motion.start) - period * math.floor((time - motion.start) / period)
        sample_path(motion, touching, points, TOUCHING, work, answers)
        besides_contact(motion, touching, contact, points, work, work.shape[0] - 2, answers)
    for site in range(motion.busy, motion.places.shape[0]):
        low, high = motion.places[site, LOW], motion.places[site, HIGH]
        wanted = near.size > 0 and near[site - motion.busy] != 0
        if not wanted and min(high, -low) - largest_displacement(motion, site) > below + ROUNDING:
            continue  # it cannot be closer
        if site == touching:
            continue
        sample_path(motion, site, points, PATH, work, answers)
        if touching >= motion.busy and is_image(points, work):
            continue
        margin, when = idle(motion, site, low, high, points, work)
        row = first + site - motion.busy
        work[row, MARGIN], work[row, WHEN] = margin, when
        if not wanted:
            below = min(below, margin)


def margins_along(
    motion: Motion, a: Vector, times: Matrix, impulses: Matrix, near: Signs, touching: int,
    time: float, work: Matrix, answers: Matrix, lowest: Vector,
) -> None:  # fmt: skip
    """The least margin of each of several motions that differ in their amplitudes and impacts
    alone, below the ceiling that was found before; the work is that of the last."""
    for i in range(a.size):
        for j in range(times.shape[1]):
            motion.impacts[TIME, j] = times[i, j]
            motion.impacts[IMPULSE, j] = impulses[i, j]
        varied = Motion(
            a[i], motion.k, times[i, 0], motion.length, motion.sign, motion.fine, motion.forced,
            motion.responses, motion.profiles, motion.impacts, motion.flights, motion.busy,
            motion.places,
        )  # fmt: skip
        margins(varied, near, lowest[i], touching, time, work, answers)
        for row in range(FOUND, work.shape[0]):
            lowest[i] = min(lowest[i], work[row, MARGIN])


MARGINS = Kernel(margins_along)
