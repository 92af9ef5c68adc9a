"""A site at rest on its wall: what holds it there, when that lets go, where a chatter ends."""

from __future__ import annotations

import math

from contbreather.kernels import Signs, inlined
from contbreather.simulation.arguments import Harmonics, Parameters, Workspace
from contbreather.simulation.contact import CLOSE, NEVER, column_bound, first_contact
from contbreather.simulation.taylor import driven, driven_bound, driven_jerk, near, site_at

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
    motion, velocity, _ = driven(on.motion, t)
    force, change, _ = driven(on.force, t)
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
    if sign * (rows[0, 0] + driven(force, t)[0]) <= 0.0:
        return 0.0
    last = site_at(rows, 0, h, 1.0)[0] + driven(force, t + h)[0]
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
