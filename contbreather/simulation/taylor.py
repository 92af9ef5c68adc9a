"""A damped lattice between impacts, to rounding, with all its sites as polynomials of time.

``v = u - a g(t)`` takes out one forced motion for all sites (``g'' + mu g' = F/a``), and leaves
``v'' + mu v' + K v = (d - 1) F - K 1 a g``, where K holds couplings and springs per unit mass and d
is the pattern of the drive: on a ring without springs nothing is left on the right. Over a step h
the Taylor series in s/h is summed to the last bit: the terms of a mode fall like ``(w h)^j/j!``,
whatever the number of sites. That is the exact propagator of the modes (18) written site by site,
where it is sparse: N operations instead of N^2 or N log N, and at once a formula for every time
inside the step, which is what the search for impacts needs: the first time at which a site reaches
its wall, with none skipped. A displacement ``phi(s)`` is known, and so is a bound J on its third
derivative over the step. From any time on, ``phi(s) <= phi + phi' x + (phi'' + J x_max) x^2/2`` for
x <= x_max; up to the first root of that parabola no wall is reached. Walking from root to root
never steps over a contact, however shallow; it converges quadratically to a crossing and
geometrically to a grazing.

Rows are coefficients: ``rows[j, n]`` belongs to site n and ``(s/h)^j``. What the kernels of rigid
walls take, parameters, event log, dense output and workspace, stands first.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from contbreather.kernels import Counts, Cube, Matrix, Signs, Vector, inlined
from contbreather.lattice.forcing import series_motion


class Couplings(NamedTuple):
    """Pulls at each site, per unit mass: K and the drive by sites, K by its rows (CSR)."""

    start: Counts  # entries of site n are those from start[n] to start[n + 1]
    other: Counts
    weight: Vector  # -K[n, other]
    # by sites, in rows: K[n, n]; d - 1, by how much more a site is driven than the common motion
    # says; K 1, what pulls at the common motion
    pulls: Matrix


class Parameters(NamedTuple):
    """Constants of a run: the lattice, its damping, its walls, its forcing."""

    ring: bool  # without springs: K is gamma (2, -1, -1), and nothing drives v
    gamma: float
    bonds: Couplings
    # by sites, in rows: the low and the high wall, infinite where there is none; the smaller
    # distance of both from 0; k, or the share of it where the speed decides
    walls: Matrix
    mu: float
    by_speed: bool  # whether k is asked for at every impact
    step: float  # over which the series converge to rounding in ``size`` terms
    rest_step: float  # with a site at rest, which moves in v with all harmonics of the forcing
    size: int  # terms of the series in time
    mean: float  # of F(t), which no g follows: v does
    motion: Matrix  # m, A, B of a g(t) in rows, as of `series_motion`; g'' + mu g' = F/a - its mean
    force: Matrix  # of F(t)


class EventLog(NamedTuple):
    """Events in the order of time; ``used`` of them are filled."""

    used: Counts
    period: Counts
    phase: Vector
    site: Counts
    kind: Signs
    wall: Signs
    before: Vector
    after: Vector
    push: Vector  # acceleration just before an impact; how long after its last one a rest begins


class DenseOutput(NamedTuple):
    """Sites recorded densely: at the times ``grid`` after the start of each period."""

    sites: Counts
    grid: Vector
    u: Cube  # (periods, times, sites)
    v: Cube


class Workspace(NamedTuple):
    """Arrays of one step; ``rows`` of site n are powers of (s - origin[n])/(h - origin[n]), s the
    step's time."""

    v: Vector  # v = u - a g(t) and w = v', at the start of the step or at an event
    w: Vector
    rows: Matrix  # (powers, sites)
    origin: Vector
    last_v: Vector  # at the end of the step
    last_w: Vector
    reach: Vector  # no |v| is larger during the rest of the step
    patch: Matrix  # rows of the sites around an event
    near: Matrix  # their v, w, last_v, last_w and reach, in rows
    push_rows: Matrix  # of the push of a wall on a site at rest, without what drives it
    column: Vector  # powers of the forced motion
    drive: Matrix  # what drives a site at rest
    when: Vector  # a site's next event in the step
    side: Signs  # the wall that it then meets
    at_rest: Signs  # the wall on which a site rests, or 0
    released: Signs  # the wall that has just let go of a site, or 0
    hits: Counts  # in this period
    answer: Vector  # the speed before an impact, and k there
    pause: Vector  # of a period that waits for k: end of the step, `NEVER` else; and sample
    begun: Counts  # events before the period
    candidates: Counts  # the sites that may have an event in this step
    listed: Signs  # whether a site is among them
    due: Counts  # those that take part in the next one
    many: Counts  # how many candidates, how many that are due


# --- the series -----------------------------------------------------------------------------------

STEP = 0.5 * math.pi  # longest step; with more, the bounds on a displacement lose their grip


def powers_needed(reach: float) -> int:
    """Number of powers of s/h that are needed where the fastest rate times h is ``reach``."""
    j, size = 0, 1.0
    while size > 1e-18 or j < 4:  # of the first term: below rounding
        j += 1
        size *= reach / j
    return j + 1


def driven_terms(drive: Matrix, t: float, h: float, column: Vector) -> None:
    """Taylor coefficients of harmonics around t in powers of s/h, to be held in ``column``."""
    for j in range(column.size):
        column[j] = 0.0
    for i in range(drive.shape[0]):
        m, A, B = drive[i, 0], drive[i, 1], drive[i, 2]
        cosine, sine = math.cos(m * t), math.sin(m * t)
        wave, turned = A * cosine + B * sine, B * cosine - A * sine
        for j in range(column.size):
            column[j] += wave
            # the next derivative over (j + 1)!, times h^(j + 1): each turns the wave by pi/2
            wave, turned = turned * (m * h / (j + 1)), -wave * (m * h / (j + 1))


def driven_bound(drive: Matrix, order: int) -> float:
    """No derivative of that order is ever larger."""
    total = 0.0
    for i in range(drive.shape[0]):
        size = abs(drive[i, 1]) + abs(drive[i, 2])
        for _ in range(order):
            size *= drive[i, 0]
        total += size
    return total


@inlined
def expand_state(v: Vector, w: Vector, h: float, gamma: float, mu: float, rows: Matrix) -> None:
    """Fill ``rows`` from displacements v and velocities w of a ring."""
    size, top = v.size, rows.shape[0] - 1
    for n in range(size):
        rows[0, n] = v[n]
        rows[1, n] = h * w[n]
    last, right = size - 1, 1 % size  # with one site or two the neighbours coincide
    # j (j - 1) v_j = -h^2 (K v)_(j-2) - mu h (j - 1) v_(j-1): (1) power by power
    for j in range(2, top + 1):
        pull, drag = -gamma * h * h / (j * (j - 1)), -mu * h / j
        before, now, new = rows[j - 2], rows[j - 1], rows[j]
        # both ends written out: no remainder of an index in the loop between them
        new[0] = pull * (2.0 * before[0] - (before[last] + before[right])) + drag * now[0]
        left = before[last - 1] + before[0]
        new[last] = pull * (2.0 * before[last] - left) + drag * now[last]
        if mu == 0.0:  # one array less to be read
            for n in range(1, last):
                new[n] = pull * (2.0 * before[n] - (before[n - 1] + before[n + 1]))
        else:
            for n in range(1, last):
                pulled = pull * (2.0 * before[n] - (before[n - 1] + before[n + 1]))
                new[n] = pulled + drag * now[n]


@inlined
def ends(rows: Matrix, h: float, last_v: Vector, last_w: Vector, reach: Vector) -> None:
    """The state at s = h, and in ``reach`` what no |v| exceeds until then.

    Four powers at a time: that is one pass through memory for four, and no chain of additions.
    """
    size, count = last_v.size, rows.shape[0]
    for n in range(size):
        last_v[n] = last_w[n] = reach[n] = 0.0
    for j in range(0, count - 3, 4):
        first, second, third, fourth = rows[j], rows[j + 1], rows[j + 2], rows[j + 3]
        for n in range(size):
            p, q, r, s = first[n], second[n], third[n], fourth[n]
            last_v[n] += (p + q) + (r + s)
            last_w[n] += (j * p + (j + 1) * q) + ((j + 2) * r + (j + 3) * s)
            reach[n] += (abs(p) + abs(q)) + (abs(r) + abs(s))
    for j in range(count - count % 4, count):
        for n in range(size):
            last_v[n] += rows[j, n]
            last_w[n] += j * rows[j, n]
            reach[n] += abs(rows[j, n])
    for n in range(size):
        last_w[n] /= h


@inlined
def near(bonds: Couplings, x: Vector, n: int) -> float:
    total = 0.0
    for i in range(bonds.start[n], bonds.start[n + 1]):
        total += bonds.weight[i] * x[bonds.other[i]]
    return total


def expand_any(
    v: Vector, w: Vector, h: float, mu: float, mean: float, bonds: Couplings, at_rest: Signs,
    walls: Matrix, column: Vector, rows: Matrix,
) -> None:  # fmt: skip
    """Fill ``rows`` on any lattice, some sites resting on their walls: there v is the wall's
    place less a g(t).

    ``column`` holds the Taylor coefficients of a g; with zeros in it and in ``walls``, and no
    ``mean``, nothing is driven and the sites held do not move at all: so do perturbations.
    """
    stiff, extra, ground, slow = bonds.pulls[0], bonds.pulls[1], bonds.pulls[2], bonds.pulls[3]
    for n in range(v.size):
        # u stays at its wall, so that v = u - a g has the powers of -a g
        rows[0, n] = walls[int(at_rest[n] > 0), n] - column[0] if at_rest[n] != 0 else v[n]
        rows[1, n] = -column[1] if at_rest[n] != 0 else h * w[n]
    for j in range(2, rows.shape[0]):
        pull, drag = -h * h / (j * (j - 1)), -mu * h / j
        before, now, new = rows[j - 2], rows[j - 1], rows[j]
        # F = a (g'' + mu g') and a g, as much as one power of each adds to v
        lift = 0.5 * h * h * mean if j == 2 else 0.0  # which v feels whole, not its excess alone
        push, still = column[j] - drag * column[j - 1] + lift, pull * column[j - 2]
        for n in range(v.size):
            if at_rest[n] != 0:
                new[n] = -column[j]
                continue
            pulled = pull * (stiff[n] * before[n] - near(bonds, before, n)) + drag * now[n]
            braked = slow[n] * (now[n] + column[j - 1]) * (-h / j)
            new[n] = pulled + (extra[n] * push + ground[n] * still + braked + lift)


def state_at(rows: Matrix, h: float, x: float, v: Vector, w: Vector) -> None:
    """Displacements and velocities of all sites at s = x h."""
    top = rows.shape[0] - 1
    size = v.size
    for n in range(size):
        v[n] = rows[top, n]
        w[n] = top * rows[top, n]
    for j in range(top - 1, 0, -1):
        for n in range(size):
            v[n] = v[n] * x + rows[j, n]
            w[n] = w[n] * x + j * rows[j, n]
    for n in range(size):
        v[n] = v[n] * x + rows[0, n]
        w[n] = w[n] / h


@inlined
def site_at(rows: Matrix, n: int, h: float, x: float) -> tuple[float, float, float]:
    """Displacement, velocity and acceleration of one site at s = x h."""
    v = w = b = 0.0
    # Horner's scheme for a polynomial and its two derivatives, each fed by the one before
    for j in range(rows.shape[0] - 1, -1, -1):
        b = b * x + 2.0 * w
        w = w * x + v
        v = v * x + rows[j, n]
    return v, w / h, b / (h * h)


# --- the first contact ----------------------------------------------------------------------------

CLOSE = 2e-15  # a gap of rounding
STILL = 1e-12  # a velocity of rounding
NUDGE = 1e-11  # moves the search off a point where the gap is rounding; changes it by 1e-22
NOTHING = 1e-100  # its square is no longer a number to reckon with
NEVER = -1.0  # in place of a time: there is none
LOST = -2.0  # the search for it did not end


def parabola_root(gap: float, slope: float, curvature: float) -> float:
    """First x > 0 with ``slope x + curvature x^2/2 = gap``, gap > 0; infinity if there is none."""
    if curvature <= NOTHING:  # a straight line, or a maximum that may stay below
        if slope <= NOTHING:
            return math.inf
        inside = slope * slope + 2.0 * curvature * gap
        # not (root - slope)/curvature, which cancels
        return 2.0 * gap / (slope + math.sqrt(inside)) if inside >= 0.0 else math.inf
    root = math.sqrt(slope * slope + 2.0 * curvature * gap)
    if slope > 0.0:
        return 2.0 * gap / (slope + root)
    return (root - slope) / curvature


def safe_advance(gap: float, slope: float, curvature: float, jerk: float, longest: float) -> float:
    """Distance that one may go, at most ``longest``, without reaching the wall."""
    # of x with a root behind it all before x is safe, with one before it all before the root: the
    # best x is where both meet
    best, x = NUDGE, longest
    for _ in range(60):
        root = parabola_root(gap, slope, curvature + jerk * x)
        if root >= x:
            return max(best, x)
        best = max(best, root)
        if x <= 2.0 * root:
            break
        x = max(2.0 * root, 0.25 * x)
        if x < NUDGE:
            break
    return best


def first_contact(
    rows: Matrix, n: int, h: float, drive: Matrix, t: float, sign: float, level: float,
    start: float, last: float,
) -> float:  # fmt: skip
    """First s in [start, h] at which ``sign phi(s)``, in the end ``last``, is up to ``level``.

    ``phi`` is column n of ``rows`` plus ``drive``, t the time at s = 0. Touching from inside with
    a velocity of rounding counts as contact only if the acceleration pushes on; the gap is not
    asked for more than `CLOSE`, or a site lying at its wall would be walked along for ever. Gives
    s, `NEVER`, or `LOST` if the walk did not come to an end.
    """
    jerk = column_bound(rows, n, 3) / (h * h * h) + driven_bound(drive, 3)
    s, close = start, CLOSE * max(1.0, abs(level))
    for _ in range(4000):  # steps; the usual number is below ten
        value, slope, curvature = site_at(rows, n, h, s / h)
        forced, forced_slope, forced_curvature, _ = series_motion(drive, t + s)
        gap = level - sign * (value + forced)
        slope = sign * (slope + forced_slope)
        curvature = sign * (curvature + forced_curvature)
        if gap <= close:
            if slope > STILL:  # one step of Newton's method, where it is not mere rounding
                return max(start, s + (gap / slope if slope > 1e-3 else 0.0))
            if slope > -STILL and curvature > 1e-9:  # an acceleration that is more than rounding
                return s
        if s >= h:
            return NEVER
        # a gap of rounding, of either sign, is taken for one that can be walked off
        s = min(h, s + safe_advance(max(gap, close), slope, curvature, jerk, h - s))
        if s >= h and level - last > 2.0 * close:
            return NEVER
    return LOST


def column_bound(rows: Matrix, n: int, order: int) -> float:
    """h^order times a bound on that derivative of a column during the whole step."""
    total = 0.0
    for j in range(rows.shape[0] - 1, order - 1, -1):
        weight = abs(rows[j, n])
        for i in range(order):
            weight *= j - i
        total += weight
    return total


# --- at rest on a wall: what holds a site, when that lets go, where a chatter ends ----------------

FLOOR = 1e-9  # rebound velocity; below it a site that is pushed outwards is at rest in any case


@inlined
def push_into_wall(
    on: Parameters, work: Workspace, n: int, sign: float, t: float
) -> tuple[float, float]:
    """Push of site n into its wall while at rest there, and how fast that changes.

    ``d F - K 1 a g - (K v)_n``, which is u'' of (1) without the drag.
    """
    bonds, v, w = on.bonds, work.v, work.w
    motion, velocity, _, _ = series_motion(on.motion, t)
    force, change, _, _ = series_motion(on.force, t)
    stiff, extra, ground = bonds.pulls[0, n], bonds.pulls[1, n], bonds.pulls[2, n]
    drive = 1.0 + extra
    push = drive * force - ground * motion - (stiff * v[n] - near(bonds, v, n))
    # at rest, u' = 0: the unforced part moves against the forced one
    rate = drive * change - ground * velocity + (stiff * velocity + near(bonds, w, n))
    return sign * push, sign * rate


def release(on: Parameters, work: Workspace, n: int, t: float, h: float) -> float:
    """When the wall ceases to hold site n in the step from t on: the push on it passes zero."""
    rows, bonds, force = work.push_rows, on.bonds, work.drive
    sign, drive, ground = float(work.at_rest[n]), 1.0 + bonds.pulls[1, n], bonds.pulls[2, n]
    for i in range(force.shape[0]):  # its part of F and the pull on the common motion
        force[i, 0] = on.force[i, 0]
        force[i, 1] = drive * on.force[i, 1] - ground * on.motion[i, 1]
        force[i, 2] = drive * on.force[i, 2] - ground * on.motion[i, 2]
    for j in range(rows.shape[0]):  # -(K v)_n, power by power
        rows[j, 0] = -bonds.pulls[0, n] * work.rows[j, n]
        for i in range(bonds.start[n], bonds.start[n + 1]):
            rows[j, 0] += bonds.weight[i] * work.rows[j, bonds.other[i]]
    if sign * (rows[0, 0] + series_motion(force, t)[0]) <= 0.0:
        return 0.0
    last = site_at(rows, 0, h, 1.0)[0] + series_motion(force, t + h)[0]
    # minus the push comes up to the level 0 as a displacement does to its wall
    return first_contact(rows, 0, h, force, t, -sign, 0.0, 0.0, -sign * last)


def moving_away(on: Parameters, work: Workspace, n: int, t: float, h: float) -> float:
    """Time for which a site just released is certain to move away: u' = u'' = 0 there."""
    sign = float(work.released[n])
    jerk = sign * (6.0 * work.rows[3, n] / (h * h * h) + series_motion(on.motion, t)[3])
    snap = column_bound(work.rows, n, 4) / (h * h * (h * h)) + driven_bound(on.motion, 4)
    # until then jerk + snap s < 0, and so are acceleration, velocity and displacement
    return min(h, -jerk / snap) if jerk < -1e-9 else min(h, 1e-3)


@inlined
def comes_to_rest(
    on: Parameters, work: Workspace, n: int, sign: float, t: float, after: float, k: float
) -> float:
    """Time that ever smaller rebounds take, where they end on the wall soon; else `NEVER`.

    With the push A into the wall, rebounds k, k^2, ... times the velocity ``after`` take the time
    ``T = 2 after/(A (1 - k))`` together. Below 1e-6 they stay closer to the wall than 1e-12/A.
    For k close to 1 a rebound loses less than rounding puts back, `CLOSE` in its height, at
    velocities above that: what follows from there is summed as well. If the push changes at the
    rate R, slow against a rebound, a rebound's velocity v falls at A (1 - k)/2, and v^3/A
    would be kept without losses, so that T becomes ``(A/R) ((1 + 5/3 R T/A)^(3/5) - 1)``.
    """
    push, rate = push_into_wall(on, work, n, sign, t)
    if push <= 0.0:
        return NEVER
    if k >= 1.0:
        return 0.0 if after <= FLOOR else NEVER
    loss = 1.0 - k
    # a rebound rises to v^2/2A and loses (1 - k) of v: below the root that is less than `CLOSE`
    if after > max(1e-6, 2.0 * math.sqrt(2.0 * CLOSE * push / loss)):
        return NEVER
    remaining = 2.0 * after / (push * loss)
    change = remaining * rate / push
    # summed up over a fraction of the forcing's time only, in which the push hardly changes
    if abs(change) > 0.3 or remaining > 0.3:
        return 0.0 if after <= FLOOR else NEVER
    if abs(change) < 1e-6:  # where the power below is 1 to rounding
        return remaining
    return remaining / change * ((1.0 + 5.0 / 3.0 * change) ** 0.6 - 1.0)


@inlined
def any_at_rest(at_rest: Signs) -> bool:
    count = 0
    for n in range(at_rest.size):  # to the end: without a branch it is a vector's sum
        count += at_rest[n] != 0
    return count > 0
