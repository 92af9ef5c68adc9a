"""Period after period of the impacting ring: flights, impacts, rest on a wall, release.

Within a period the state is that of the unforced motion ``v = u - a g(t)``; between periods it is
(u, u') alone, and whatever else is known (who rests on its wall) is read off it again. So a run
may be cut after any period and taken up later, bit for bit.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from contbreather.dynamics.compiled import compiled
from contbreather.dynamics.contact import (
    LOST,
    NEVER,
    first_contact,
    fourth_bound,
    reaches,
)
from contbreather.dynamics.flow import (
    Array,
    Drive,
    driven,
    driven_bound,
    driven_jerk,
    driven_terms,
    expand,
    expand_held,
    site_at,
    state_at,
)

TOGETHER = 1e-12  # impacts closer than this happen at the same time
GENTLE = 1e-6  # below this rebound velocity the rest of a chatter takes a moment and is summed up
FLOOR = 1e-9  # below this one a site that is pushed outwards is at rest, chatter or not
FAST = 1e9  # a velocity beyond all reason

DONE, FULL, CHATTER, ASTRAY, WILD = 0, 1, 2, 3, 4
HIT, REST, LEAVE = 0, 1, 2


class Law(NamedTuple):
    """What does not change during a run: the chain, its damping, its walls, its forcing."""

    gamma: float
    mu: float
    k: float
    step: float
    size: int  # terms of the series in time
    most: int  # impacts of one site in one period
    motion: Drive  # a g(t), g'' + mu g' = F/a
    force: Drive  # a F(t)/a


class Log(NamedTuple):
    """Events in the order of time; ``used`` of them are filled."""

    used: NDArray[np.int64]
    period: NDArray[np.int64]
    phase: Array
    site: NDArray[np.int64]
    kind: NDArray[np.int8]
    wall: NDArray[np.int8]
    before: Array
    after: Array
    push: Array  # acceleration just before an impact


class Watch(NamedTuple):
    """Sites recorded densely: at the times ``grid`` after the start of each period."""

    sites: NDArray[np.int64]
    grid: Array
    u: Array  # (periods, times, sites)
    v: Array


class Work(NamedTuple):
    """Room for one step."""

    v: Array
    w: Array
    rows: Array
    lift: Array
    column: Array
    middle: Array
    end: Array
    slack: Array
    when: Array
    side: NDArray[np.int8]
    held: NDArray[np.int8]
    fresh: NDArray[np.int8]
    hits: NDArray[np.int64]


@compiled
def outward(law: Law, work: Work, n: int, sign: float, t: float) -> tuple[float, float]:
    """Push of site n into its wall while at rest there, and how fast that changes."""
    v, w, size = work.v, work.w, work.v.size
    left, right = (n - 1) % size, (n + 1) % size
    own = -driven(law.motion, t)[1]  # at rest the unforced part moves against the forced one
    force, change, _ = driven(law.force, t)
    push = force - law.gamma * (2.0 * v[n] - v[left] - v[right])
    rate = change - law.gamma * (2.0 * own - w[left] - w[right])
    return sign * push, sign * rate


@compiled
def release(law: Law, work: Work, n: int, t: float, h: float, limit: float) -> float:
    """When the wall ceases to hold site n: the push on it passes zero."""
    rows, lift, size = work.rows, work.lift, work.v.size
    left, right, sign = (n - 1) % size, (n + 1) % size, float(work.held[n])
    for j in range(rows.shape[0]):
        lift[j, 0] = -law.gamma * (2.0 * rows[j, n] - rows[j, left] - rows[j, right])
    if sign * (lift[0, 0] + driven(law.force, t)[0]) <= 0.0:
        return 0.0
    return first_contact(lift, 0, h, law.force, t, -sign, 0.0, 0.0, limit)


@compiled
def lead(law: Law, work: Work, n: int, t: float, h: float) -> float:
    """How long a site just released certainly moves away: velocity and acceleration are zero."""
    sign = float(work.fresh[n])
    jerk = sign * (6.0 * work.rows[3, n] / h**3 + driven_jerk(law.motion, t))
    snap = fourth_bound(work.rows, n) / h**4 + driven_bound(law.motion, 4)
    return min(h, -jerk / snap) if jerk < -1e-9 else min(h, 1e-3)


@compiled
def first_event(law: Law, work: Work, t: float, h: float) -> float:
    """Time to the first contact or release within the step, or h; all of them in ``when``."""
    rows, when = work.rows, work.when
    reaches(rows, work.middle, work.end, work.slack)
    at_start = driven(law.motion, t)[0]
    at_middle = driven(law.motion, t + 0.5 * h)[0]
    at_end = driven(law.motion, t + h)[0]
    best, forced = h, driven_bound(law.motion, 2) * h * h / 32.0
    for n in range(when.size):
        when[n] = NEVER
        if work.held[n] != 0:
            s = release(law, work, n, t, h, min(h, best + TOGETHER))
            if s == LOST:
                return LOST
            when[n] = s
            if s >= 0.0:
                best = min(best, s)
            continue
        start = lead(law, work, n, t, h) if work.fresh[n] != 0 else 0.0
        for sign in (1.0, -1.0):
            top = max(sign * (rows[0, n] + at_start), sign * (work.middle[n] + at_middle))
            top = max(top, sign * (work.end[n] + at_end))
            if top + work.slack[n] + forced < 1.0:
                continue
            limit = min(h, best + TOGETHER)
            s = first_contact(rows, n, h, law.motion, t, sign, 1.0, start, limit)
            if s == LOST:
                return LOST
            if s >= 0.0 and (when[n] < 0.0 or s < when[n]):
                when[n] = s
                work.side[n] = np.int8(sign)
                best = min(best, s)
    for n in range(when.size):
        work.fresh[n] = 0
    return best


@compiled
def note(
    log: Log,
    period: int,
    t: float,
    n: int,
    kind: int,
    wall: int,
    before: float,
    after: float,
    push: float,
) -> bool:
    """Write one event down, unless the log is full."""
    i = log.used[0]
    if i >= log.phase.size:
        return False
    log.period[i] = period
    log.phase[i] = t
    log.site[i] = n
    log.kind[i] = np.int8(kind)
    log.wall[i] = np.int8(wall)
    log.before[i] = before
    log.after[i] = after
    log.push[i] = push
    log.used[0] = i + 1
    return True


@compiled
def comes_to_rest(law: Law, work: Work, n: int, sign: float, t: float, after: float) -> bool:
    """Whether ever smaller rebounds end on the wall at once, for all purposes.

    With the push A into the wall, rebounds k, k^2, ... times the velocity ``after`` take the time
    ``2 after/(A (1 - k))`` together; below `GENTLE` they stay closer to the wall than 1e-12/A.
    """
    if after > GENTLE:
        return False
    push, rate = outward(law, work, n, sign, t)
    if push <= 0.0:
        return False
    if after <= FLOOR:
        return True
    if law.k >= 1.0:
        return False
    remaining = 2.0 * after / (push * (1.0 - law.k))
    return remaining * abs(rate) < 0.01 * push


@compiled
def settle(law: Law, work: Work, log: Log, period: int, t: float, dt: float) -> int:
    """Apply every contact and release of this time; the site number + 1 where one chatters."""
    motion, velocity, _ = driven(law.motion, t)
    for n in range(work.v.size):
        if work.when[n] < 0.0 or work.when[n] > dt + TOGETHER:
            continue
        if work.held[n] != 0:
            wall = int(work.held[n])
            work.fresh[n] = work.held[n]
            work.held[n] = 0
            if not note(log, period, t, n, LEAVE, wall, 0.0, 0.0, 0.0):
                return -1
            continue
        wall = int(work.side[n])
        before = work.w[n] + velocity
        after = -law.k * before + 0.0  # no minus zero
        # the push at rest has the wall's sign; u'' as it is just before has the drag besides
        push = wall * outward(law, work, n, float(wall), t)[0] - law.mu * before
        work.v[n] = wall - motion
        work.w[n] = after - velocity
        work.hits[n] += 1
        if not note(log, period, t, n, HIT, wall, before, after, push):
            return -1
        if work.hits[n] > law.most:
            return n + 1
        if comes_to_rest(law, work, n, float(wall), t, abs(after)):
            work.held[n] = np.int8(wall)
            work.w[n] = -velocity
            if not note(log, period, t, n, REST, wall, after, 0.0, 0.0):
                return -1
    return 0


@compiled
def resting(work: Work) -> bool:
    """Whether any site rests on a wall."""
    count = 0
    for n in range(work.held.size):
        count += abs(work.held[n])
    return count > 0


@compiled
def one_period(
    law: Law, work: Work, log: Log, watch: Watch, row: int, period: int, t0: float, span: float
) -> tuple[int, int]:
    """From t0 over the time ``span``; a status, and the site it is about."""
    s, sample = 0.0, 0
    for n in range(work.hits.size):
        work.hits[n] = 0
    while s < span:
        t = t0 + s
        h = min(law.step, span - s)
        if resting(work):
            driven_terms(law.motion, t, h, work.column)
            args = (law.gamma, law.mu, work.held, 1.0, work.column, work.rows)
            expand_held(work.v, work.w, h, *args)
        else:
            expand(work.v, work.w, h, law.gamma, law.mu, work.rows)
        dt = first_event(law, work, t, h)
        if dt == LOST:
            return ASTRAY, 0
        last = h >= span - s and dt >= h
        end = span if last else s + dt
        while sample < watch.grid.size and watch.grid[sample] < end:
            observe(law, work, watch, row, sample, t0, s, h)
            sample += 1
        state_at(work.rows, h, dt / h, work.v, work.w)
        s = end
        status = settle(law, work, log, period, t0 + s, dt)
        if status != 0:
            return (FULL, 0) if status < 0 else (CHATTER, status - 1)
    return DONE, 0


@compiled
def observe(
    law: Law, work: Work, watch: Watch, row: int, sample: int, t0: float, s: float, h: float
) -> None:
    """Write down the watched sites at one time of the grid."""
    time = watch.grid[sample]
    motion, velocity, _ = driven(law.motion, t0 + time)
    for i in range(watch.sites.size):
        v, w, _ = site_at(work.rows, watch.sites[i], h, (time - s) / h)
        watch.u[row, sample, i] = v + motion
        watch.v[row, sample, i] = w + velocity


@compiled
def enter(law: Law, work: Work, u: Array, v: Array, t0: float) -> None:
    """Take out the forced motion; a site at rest on a wall that pushes it stays there."""
    motion, velocity, _ = driven(law.motion, t0)
    for n in range(u.size):
        work.v[n] = u[n] - motion
        work.w[n] = v[n] - velocity
        work.held[n] = 0
        work.fresh[n] = 0
    for n in range(u.size):
        if abs(u[n]) == 1.0 and v[n] == 0.0 and outward(law, work, n, u[n], t0)[0] > 0.0:
            work.held[n] = np.int8(u[n])


@compiled
def leave(law: Law, work: Work, u: Array, v: Array, t0: float) -> bool:
    """Put the forced motion back; False where a number is no longer one."""
    motion, velocity, _ = driven(law.motion, t0)
    sound = True
    for n in range(u.size):
        if work.held[n] != 0:
            u[n] = float(work.held[n])
            v[n] = 0.0
            continue
        u[n] = work.v[n] + motion
        v[n] = work.w[n] + velocity
        sound = sound and abs(v[n]) < FAST and abs(u[n]) < 2.0
    return sound


@compiled
def cruise(
    u: Array,
    v: Array,
    t0: float,
    span: float,
    first: int,
    law: Law,
    work: Work,
    log: Log,
    watch: Watch,
    strobe_u: Array,
    strobe_v: Array,
) -> tuple[int, int, int]:
    """Advance (u, v) in place by as many periods as ``strobe_u`` has rows.

    Returns
    -------
    done : int
        Periods completed; u and v are the state after them, also if a chatter ended the next one.
    status, site : int
    """
    for j in range(strobe_u.shape[0]):
        used = log.used[0]
        enter(law, work, u, v, t0)
        status, site = one_period(law, work, log, watch, j, first + j, t0, span)
        if status != DONE:
            log.used[0] = used
            return j, status, site
        if not leave(law, work, u, v, t0 + span):
            log.used[0] = used
            return j, WILD, 0
        for n in range(u.size):
            strobe_u[j, n] = u[n]
            strobe_v[j, n] = v[n]
    return strobe_u.shape[0], DONE, 0
