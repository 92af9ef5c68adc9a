"""A site at rest on its wall: what holds it there, when that lets go, where a chatter ends."""

from __future__ import annotations

import math

from contbreather.kernels import Matrix, Signs, Vector, inlined
from contbreather.simulation.contact import CLOSE, NEVER, column_bound, first_contact
from contbreather.simulation.flow import driven, driven_bound, driven_jerk, near, site_at
from contbreather.simulation.room import Drive, Law, Work

GENTLE = 1e-6  # below this rebound velocity the rest of a chatter takes a moment and is summed up
SLOWLY = 0.3  # how far ahead, and how much of its push, a chatter is summed up
FLOOR = 1e-9  # below this one a site that is pushed outwards is at rest, chatter or not


@inlined
def outward(law: Law, work: Work, n: int, sign: float, t: float) -> tuple[float, float]:
    """Push of site n into its wall while at rest there, and how fast that changes."""
    bonds, v, w = law.bonds, work.v, work.w
    motion, velocity, _ = driven(law.motion, t)
    force, change, _ = driven(law.force, t)
    own, extra, ground = bonds.pulls[0, n], bonds.pulls[1, n], bonds.pulls[2, n]
    drive = 1.0 + extra
    push = drive * force - ground * motion - (own * v[n] - near(bonds, v, n))
    # at rest the unforced part moves against the forced one
    rate = drive * change - ground * velocity + (own * velocity + near(bonds, w, n))
    return sign * push, sign * rate


def pushing(law: Law, work: Work, n: int) -> Drive:
    """What drives site n at rest: its part of F and the pull on the common motion."""
    drive, ground = 1.0 + law.bonds.pulls[1, n], law.bonds.pulls[2, n]
    c, s = work.push[0], work.push[1]
    for i in range(c.size):
        c[i] = drive * law.force.c[i] - ground * law.motion.c[i]
        s[i] = drive * law.force.s[i] - ground * law.motion.s[i]
    return Drive(law.force.m, c, s)


def release(law: Law, work: Work, n: int, t: float, h: float) -> float:
    """When the wall ceases to hold site n: the push on it passes zero. ``t`` is that of s = 0."""
    lift, bonds, force = work.lift, law.bonds, pushing(law, work, n)
    sign, origin = float(work.held[n]), work.origin[n]
    for j in range(lift.shape[0]):
        lift[j, 0] = -bonds.pulls[0, n] * work.rows[j, n]
    for i in range(bonds.start[n], bonds.start[n + 1]):
        other = bonds.other[i]
        shift = (origin - work.origin[other]) / h
        _add_shifted(work.rows, other, shift, bonds.weight[i], lift, work.shifted)
    if sign * (lift[0, 0] + driven(force, t + origin)[0]) <= 0.0:
        return origin
    room = h - origin
    last = site_at(lift, 0, h, room / h)[0] + driven(force, t + h)[0]
    local = first_contact(lift, 0, h, force, t + origin, -sign, 0.0, 0.0, room, -sign * last)
    return local if local < 0.0 else origin + local


def _add_shifted(
    rows: Matrix, n: int, shift: float, factor: float, out: Matrix, column: Vector
) -> None:
    """Add a column, re-expanded about a later time if its origin is an earlier one."""
    top = rows.shape[0] - 1
    if shift == 0.0:
        for j in range(top + 1):
            out[j, 0] += factor * rows[j, n]
        return
    for j in range(top + 1):
        column[j] = rows[j, n]
    for i in range(top):  # Horner's scheme, over and over: Taylor's shift
        for j in range(top - 1, i - 1, -1):
            column[j] += shift * column[j + 1]
    for j in range(top + 1):
        out[j, 0] += factor * column[j]


def lead(law: Law, work: Work, n: int, t: float, h: float) -> float:
    """How long a site just released certainly moves away: velocity and acceleration are zero."""
    sign = float(work.fresh[n])
    jerk = sign * (6.0 * work.rows[3, n] / (h * h * h) + driven_jerk(law.motion, t))
    snap = column_bound(work.rows, n, 1.0, 4) / (h * h * (h * h)) + driven_bound(law.motion, 4)
    return min(h, -jerk / snap) if jerk < -1e-9 else min(h, 1e-3)


@inlined
def comes_to_rest(law: Law, work: Work, n: int, sign: float, t: float, after: float) -> float:
    """How long ever smaller rebounds go on, where they end on the wall soon; else `NEVER`.

    With the push A into the wall, rebounds k, k^2, ... times the velocity ``after`` take the time
    ``T = 2 after/(A (1 - k))`` together. Below `GENTLE` they stay closer to the wall than 1e-12/A.
    For k close to 1 a rebound loses less than rounding puts back, `CLOSE` in its height, at
    velocities above that: what follows from there is summed as well. If the push changes at the
    rate R, slow against a rebound, a rebound's velocity v falls at A (1 - k)/2, and v^3/A
    would be kept without losses, so that T becomes ``(A/R) ((1 + 5/3 R T/A)^(3/5) - 1)``.
    """
    push, rate = outward(law, work, n, sign, t)
    if push <= 0.0:
        return NEVER
    if law.k >= 1.0:
        return 0.0 if after <= FLOOR else NEVER
    loss = 1.0 - law.k
    if after > max(GENTLE, 2.0 * math.sqrt(2.0 * CLOSE * push / loss)):
        return NEVER
    remaining = 2.0 * after / (push * loss)
    change = remaining * rate / push
    if abs(change) > SLOWLY or remaining > SLOWLY:
        return 0.0 if after <= FLOOR else NEVER
    if abs(change) < 1e-6:
        return remaining
    return remaining / change * ((1.0 + 5.0 / 3.0 * change) ** 0.6 - 1.0)


@inlined
def resting(held: Signs) -> bool:
    """Whether any site rests on a wall."""
    count = 0
    for n in range(held.size):
        count += held[n] != 0
    return count > 0
