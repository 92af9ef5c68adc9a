"""The first time at which a site reaches its wall, with none skipped; and a site at rest on it.

A displacement ``phi(s)`` is known as a formula, and so is a bound J on its third derivative over
the step. From any time on, ``phi(s) <= phi + phi' x + (phi'' + J x_max) x^2/2`` for x <= x_max; up
to the first root of that parabola no wall is reached. Walking from root to root never steps over a
contact, however shallow; it converges quadratically to a crossing and geometrically to a grazing.
"""

from __future__ import annotations

import math

from contbreather.kernels import Matrix, Signs, inlined
from contbreather.simulation.taylor import (
    Harmonics,
    Parameters,
    Workspace,
    drive_sum,
    driven_bound,
    driven_jerk,
    near,
    site_at,
)

CLOSE = 2e-15  # a gap of rounding
STILL = 1e-12  # a velocity of rounding
PUSHED = 1e-9  # an acceleration that is more than rounding
WALKS = 4000  # steps of one search; the usual number is below ten
NUDGE = 1e-11  # moves the search off a point where the gap is rounding; changes it by 1e-22
NOTHING = 1e-100  # its square is no longer a number to reckon with
NEVER = -1.0
LOST = -2.0


def parabola_root(gap: float, slope: float, bend: float) -> float:
    """First x > 0 with ``slope x + bend x^2/2 = gap``, gap > 0; infinity if there is none."""
    if bend <= NOTHING:  # a straight line, or a crest that may stay below
        if slope <= NOTHING:
            return math.inf
        inside = slope * slope + 2.0 * bend * gap
        # not (root - slope)/bend, which cancels
        return 2.0 * gap / (slope + math.sqrt(inside)) if inside >= 0.0 else math.inf
    root = math.sqrt(slope * slope + 2.0 * bend * gap)
    if slope > 0.0:
        return 2.0 * gap / (slope + root)
    return (root - slope) / bend


def safe_advance(gap: float, slope: float, bend: float, jerk: float, longest: float) -> float:
    """How far one may go, at most ``longest``, without reaching the wall."""
    # of x with a root behind it all before x is safe, with one before it all before the root: the
    # best x is where both meet
    best, x = NUDGE, longest
    for _ in range(60):
        root = parabola_root(gap, slope, bend + jerk * x)
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
    rows: Matrix, n: int, h: float, drive: Harmonics, t: float, sign: float, level: float,
    start: float, limit: float, last: float,
) -> float:  # fmt: skip
    """First s in [start, limit] at which ``sign phi(s)``, in the end ``last``, is up to ``level``.

    ``phi`` is column n of ``rows`` plus ``drive``, t the time at s = 0. Touching from inside with
    a velocity of rounding counts as contact only if the acceleration pushes on; the gap is not
    asked for more than `CLOSE`, or a site lying at its wall would be walked along for ever.

    Returns
    -------
    float
        s, `NEVER`, or `LOST` if the walk did not come to an end.
    """
    jerk = column_bound(rows, n, limit / h, 3) / (h * h * h) + driven_bound(drive, 3)
    s, close = start, CLOSE * max(1.0, abs(level))
    for _ in range(WALKS):
        value, slope, bend = site_at(rows, n, h, s / h)
        forced, forced_slope, forced_bend = drive_sum(drive, t + s)
        gap = level - sign * (value + forced)
        slope = sign * (slope + forced_slope)
        bend = sign * (bend + forced_bend)
        if gap <= close:
            if slope > STILL:  # one step of Newton's method, where it is not mere rounding
                return max(start, s + (gap / slope if slope > 1e-3 else 0.0))
            if slope > -STILL and bend > PUSHED:
                return s
        if s >= limit:
            return NEVER
        # a gap of rounding, of either sign, is taken for one that can be walked off
        s = min(limit, s + safe_advance(max(gap, close), slope, bend, jerk, limit - s))
        if s >= limit and level - last > 2.0 * close:
            return NEVER
    return LOST


def column_bound(rows: Matrix, n: int, x: float, order: int) -> float:
    """h^order times a bound on that derivative of a column, for all times up to x h."""
    total = 0.0
    for j in range(rows.shape[0] - 1, order - 1, -1):
        weight = abs(rows[j, n])
        for i in range(order):
            weight *= j - i
        total = total * x + weight
    return total


# --- at rest on a wall: what holds a site, when that lets go, where a chatter ends ----------------

GENTLE = 1e-6  # below this rebound velocity the rest of a chatter takes a moment and is summed up
SLOWLY = 0.3  # how far ahead, and how much of its push, a chatter is summed up
FLOOR = 1e-9  # below this one a site that is pushed outwards is at rest, chatter or not


@inlined
def push_into_wall(
    on: Parameters, work: Workspace, n: int, sign: float, t: float
) -> tuple[float, float]:
    """Push of site n into its wall while at rest there, and how fast that changes.

    ``d F - K 1 a g - (K v)_n``, which is u'' of (1) without the drag.
    """
    bonds, v, w = on.bonds, work.v, work.w
    motion, velocity, _ = drive_sum(on.motion, t)
    force, change, _ = drive_sum(on.force, t)
    stiff, extra, ground = bonds.pulls[0, n], bonds.pulls[1, n], bonds.pulls[2, n]
    drive = 1.0 + extra
    push = drive * force - ground * motion - (stiff * v[n] - near(bonds, v, n))
    # at rest, u' = 0: the unforced part moves against the forced one
    rate = drive * change - ground * velocity + (stiff * velocity + near(bonds, w, n))
    return sign * push, sign * rate


def drive_at_rest(on: Parameters, work: Workspace, n: int) -> Harmonics:
    """What drives site n at rest: its part of F and the pull on the common motion."""
    drive, ground = 1.0 + on.bonds.pulls[1, n], on.bonds.pulls[2, n]
    c, s = work.drive[0], work.drive[1]
    for i in range(c.size):
        c[i] = drive * on.force.c[i] - ground * on.motion.c[i]
        s[i] = drive * on.force.s[i] - ground * on.motion.s[i]
    return Harmonics(on.force.m, c, s)


def release(on: Parameters, work: Workspace, n: int, t: float, h: float) -> float:
    """When the wall ceases to hold site n in the step from t on: the push on it passes zero.

    With a site at rest a step is expanded anew at each event, so that all series begin with it.
    """
    rows, bonds, force = work.push_rows, on.bonds, drive_at_rest(on, work, n)
    sign = float(work.at_rest[n])
    for j in range(rows.shape[0]):  # -(K v)_n, power by power
        rows[j, 0] = -bonds.pulls[0, n] * work.rows[j, n]
        for i in range(bonds.start[n], bonds.start[n + 1]):
            rows[j, 0] += bonds.weight[i] * work.rows[j, bonds.other[i]]
    if sign * (rows[0, 0] + drive_sum(force, t)[0]) <= 0.0:
        return 0.0
    last = site_at(rows, 0, h, 1.0)[0] + drive_sum(force, t + h)[0]
    # minus the push comes up to the level 0 as a displacement does to its wall
    return first_contact(rows, 0, h, force, t, -sign, 0.0, 0.0, h, -sign * last)


def moving_away(on: Parameters, work: Workspace, n: int, t: float, h: float) -> float:
    """How long a site just released certainly moves away: velocity and acceleration are zero."""
    sign = float(work.released[n])
    jerk = sign * (6.0 * work.rows[3, n] / (h * h * h) + driven_jerk(on.motion, t))
    snap = column_bound(work.rows, n, 1.0, 4) / (h * h * (h * h)) + driven_bound(on.motion, 4)
    # until then jerk + snap s < 0, and so are acceleration, velocity and displacement
    return min(h, -jerk / snap) if jerk < -1e-9 else min(h, 1e-3)


@inlined
def comes_to_rest(
    on: Parameters, work: Workspace, n: int, sign: float, t: float, after: float
) -> float:
    """How long ever smaller rebounds go on, where they end on the wall soon; else `NEVER`.

    With the push A into the wall, rebounds k, k^2, ... times the velocity ``after`` take the time
    ``T = 2 after/(A (1 - k))`` together. Below `GENTLE` they stay closer to the wall than 1e-12/A.
    For k close to 1 a rebound loses less than rounding puts back, `CLOSE` in its height, at
    velocities above that: what follows from there is summed as well. If the push changes at the
    rate R, slow against a rebound, a rebound's velocity v falls at A (1 - k)/2, and v^3/A
    would be kept without losses, so that T becomes ``(A/R) ((1 + 5/3 R T/A)^(3/5) - 1)``.
    """
    push, rate = push_into_wall(on, work, n, sign, t)
    if push <= 0.0:
        return NEVER
    if on.k >= 1.0:
        return 0.0 if after <= FLOOR else NEVER
    loss = 1.0 - on.k
    # a rebound rises to v^2/2A and loses (1 - k) of v: below the root that is less than `CLOSE`
    if after > max(GENTLE, 2.0 * math.sqrt(2.0 * CLOSE * push / loss)):
        return NEVER
    remaining = 2.0 * after / (push * loss)
    change = remaining * rate / push
    if abs(change) > SLOWLY or remaining > SLOWLY:
        return 0.0 if after <= FLOOR else NEVER
    if abs(change) < 1e-6:  # where the power below is 1 to rounding
        return remaining
    return remaining / change * ((1.0 + 5.0 / 3.0 * change) ** 0.6 - 1.0)


@inlined
def any_at_rest(at_rest: Signs) -> bool:
    """Whether any site rests on a wall."""
    count = 0
    for n in range(at_rest.size):  # to the end: without a branch it is a vector's sum
        count += at_rest[n] != 0
    return count > 0
