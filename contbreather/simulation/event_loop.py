"""Period after period of an impacting lattice: flights, impacts, rest on a wall, release.

Within a period the state is that of the unforced motion ``v = u - a g(t)``; between periods it is
(u, u') alone, and whatever else is known (who rests on its wall) is read off it again. So a run
may be cut after any period and taken up later, bit for bit. Small perturbations take the same
flights, with a saltation at each impact.
"""

from __future__ import annotations

import math

import numpy as np

from contbreather.kernels import Counts, Kernel, Matrix, Signs, Vector, inlined
from contbreather.lattice.forcing import series_motion
from contbreather.simulation.taylor import (
    LOST,
    NEVER,
    DenseOutput,
    EventLog,
    Parameters,
    Workspace,
    any_at_rest,
    column_bound,
    comes_to_rest,
    driven_bound,
    driven_terms,
    ends,
    expand_any,
    expand_state,
    first_contact,
    moving_away,
    push_into_wall,
    release,
    site_at,
    state_at,
)

DONE, FULL, CHATTER, ASTRAY, WILD, ASKS = 0, 1, 2, 3, 4, 5
HIT, BEGINS_REST, ENDS_REST = 0, 1, 2
MOST = 150_000  # impacts of one site in one period: some seconds


@inlined
def find_contact(
    on: Parameters, work: Workspace, n: int, t: float, h: float, first: float, last: float
) -> bool:
    """Find when site n next meets a wall, or is let go, before the step ends; False if astray.

    Its series begins at t and reaches over h, to the end of the step. Within a time d a function is
    at most ``d^2/8 max|u''|`` beyond its chord: many sites are dismissed by their ``first`` and
    ``last`` displacement, most others by one more in the middle.
    """
    if work.at_rest[n] != 0:
        work.when[n] = release(on, work, n, t, h)
        return bool(work.when[n] != LOST)
    work.when[n] = NEVER
    curvature = column_bound(work.rows, n, 2) / (h * h) + driven_bound(on.motion, 2)
    slack = curvature * h * h / 8.0
    if max(abs(first), abs(last)) + slack < on.walls[2, n]:
        work.released[n] = 0
        return True
    middle = site_at(work.rows, n, h, 0.5)[0] + series_motion(on.motion, t + 0.5 * h)[0]
    start = moving_away(on, work, n, t, h) if work.released[n] != 0 else 0.0
    work.released[n] = 0
    for sign in (1.0, -1.0):
        level = on.walls[1, n] if sign > 0.0 else -on.walls[0, n]
        if max(sign * first, max(sign * middle, sign * last)) + 0.25 * slack < level:
            continue  # half the length, a quarter of the slack
        s = first_contact(work.rows, n, h, on.motion, t, sign, level, start, sign * last)
        if s == LOST:
            return False
        if s >= 0.0 and (work.when[n] < 0.0 or work.origin[n] + s < work.when[n]):
            work.when[n] = work.origin[n] + s
            work.side[n] = np.int8(sign)
    return True


@inlined
def record_event(
    log: EventLog, period: int, t: float, n: int, kind: int, wall: int, before: float, after: float,
    push: float,
) -> bool:  # fmt: skip
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


@inlined
def apply_events(
    on: Parameters, work: Workspace, log: EventLog, period: int, t: float
) -> tuple[int, int]:
    """Apply every contact and release that is due, at a state that ``v`` and ``w`` hold; a status,
    and the site it is about: one chatters, the log is full, k is asked for."""
    motion, velocity, _, _ = series_motion(on.motion, t)
    for i in range(work.many[1]):
        n = work.due[i]
        if work.when[n] < 0.0:  # it has been, before another one asked for k
            continue
        if work.at_rest[n] != 0:  # the wall lets go; nothing jumps
            wall = int(work.at_rest[n])
            work.released[n] = work.at_rest[n]
            work.at_rest[n] = 0
            if not record_event(log, period, t, n, ENDS_REST, wall, 0.0, 0.0, 0.0):
                return FULL, 0
            work.when[n] = NEVER
            continue
        wall = int(work.side[n])
        before = work.w[n] + velocity
        k = on.walls[3, n]
        if on.by_speed:
            if work.answer[0] != abs(before):
                work.answer[0] = abs(before)
                return ASKS, 0
            k *= work.answer[1]
        work.when[n] = NEVER
        after = -k * before + 0.0  # (2); no minus zero
        # the push at rest has the wall's sign; u'' as it is just before has the drag besides
        drag = (on.mu + on.bonds.pulls[3, n]) * before
        push = wall * push_into_wall(on, work, n, float(wall), t)[0] - drag
        # onto the wall exactly: what rounding leaves would grow into a gap over many impacts
        work.v[n] = on.walls[int(wall > 0), n] - motion
        work.w[n] = after - velocity
        work.hits[n] += 1
        if not record_event(log, period, t, n, HIT, wall, before, after, push):
            return FULL, 0
        if work.hits[n] > MOST:
            return CHATTER, n
        rest = comes_to_rest(on, work, n, float(wall), t, abs(after), k)
        if rest >= 0.0:
            work.at_rest[n] = np.int8(wall)
            work.w[n] = -velocity
            if not record_event(log, period, t, n, BEGINS_REST, wall, after, 0.0, rest):
                return FULL, 0
    return DONE, 0


@inlined
def begin_step(on: Parameters, work: Workspace, t: float, h: float, anyone: bool) -> bool:
    """Expand all sites about the start of a step and find contacts; False if one went astray."""
    if anyone or not on.ring:
        driven_terms(on.motion, t, h, work.column)
        args = (on.mu, on.mean, on.bonds, work.at_rest, on.walls, work.column, work.rows)
        expand_any(work.v, work.w, h, *args)
    else:
        expand_state(work.v, work.w, h, on.gamma, on.mu, work.rows)
    ends(work.rows, h, work.last_v, work.last_w, work.reach)
    swing = driven_bound(on.motion, 0)
    count, candidates, reach, free = 0, work.candidates, work.reach, on.walls[2]
    for n in range(reach.size):
        # |u| <= |v| + |a g|, certain to stay between the walls: in a breather nearly all are
        far = reach[n] + swing < free[n]
        work.origin[n] = 0.0
        work.listed[n] = not far
        candidates[count] = n  # without a branch: it is overwritten unless it counts
        count += not far
    work.many[0] = count
    now, then = series_motion(on.motion, t)[0], series_motion(on.motion, t + h)[0]
    for i in range(count):
        n = candidates[i]
        if not find_contact(on, work, n, t, h, work.v[n] + now, work.last_v[n] + then):
            return False
    return True


@inlined
def next_event(work: Workspace) -> float:
    """The earliest event of the step, or NEVER; the sites that take part in it are due."""
    best = NEVER
    for i in range(work.many[0]):
        when = work.when[work.candidates[i]]
        if when >= 0.0 and (best < 0.0 or when < best):
            best = when
    work.many[1] = 0
    for i in range(work.many[0]):
        n = work.candidates[i]
        # impacts closer than 1e-12 happen at the same time
        if 0.0 <= work.when[n] <= best + 1e-12:
            work.due[work.many[1]] = n
            work.many[1] += 1
    return best


@inlined
def states_around(work: Workspace, first: int, last: int, s: float, h: float) -> None:
    """The states of a row of sites at the step's time s, into ``v`` and ``w``."""
    for i in range(first, last):
        n = i % work.v.size
        left = h - work.origin[n]
        work.v[n], work.w[n], _ = site_at(work.rows, n, left, (s - work.origin[n]) / left)


@inlined
def expand_near(on: Parameters, work: Workspace, n: int, s: float, h: float) -> None:
    """Expand anew, about the step's time s, the sites of a ring that an event of site n changes.

    By v'' = -K v, the j-th power at one site depends on others up to a distance of j/2 only; beyond
    that of the last power kept the change is below rounding for the rest of the step. So a window
    of twice that reach, taken for a ring, has the right powers in its middle:

        j = 0, 1   . . . . n . . . .     read
        j = 2, 3   . . . n n n . . .
        j = 4, 5   . . n n n n n . .     changed
    """
    patch, near, size = work.patch, work.near, work.v.size
    wide = near.shape[1]
    for i in range(wide):
        m = (n - wide // 2 + i) % size
        near[0, i], near[1, i] = work.v[m], work.w[m]
    expand_state(near[0], near[1], h - s, on.gamma, on.mu, patch)
    ends(patch, h - s, near[2], near[3], near[4])
    for i in range(wide // 4, wide - wide // 4):
        m = (n - wide // 2 + i) % size
        for j in range(patch.shape[0]):
            work.rows[j, m] = patch[j, i]
        work.last_v[m], work.last_w[m], work.reach[m] = near[2, i], near[3, i], near[4, i]
        work.origin[m] = s


@inlined
def contacts_near(on: Parameters, work: Workspace, t: float, s: float, h: float) -> bool:
    """Find the contacts of all sites that an event at the step's time s has changed; False if one
    went astray."""
    swing, reach = driven_bound(on.motion, 0), work.near.shape[1] // 4
    now, then = series_motion(on.motion, t + s)[0], series_motion(on.motion, t + h)[0]
    for i in range(work.many[1]):
        for j in range(work.due[i] - reach, work.due[i] + reach + 1):
            n = j % work.v.size
            work.when[n] = NEVER
            if work.reach[n] + swing < on.walls[2, n]:
                continue
            if work.listed[n] == 0:
                work.listed[n] = 1
                work.candidates[work.many[0]] = n
                work.many[0] += 1
            first, last = work.rows[0, n] + now, work.last_v[n] + then
            if not find_contact(on, work, n, t + s, h - s, first, last):
                return False
    return True


@inlined
def one_period(
    on: Parameters,
    work: Workspace,
    log: EventLog,
    dense: DenseOutput,
    row: int,
    period: int,
    t0: float,
    span: float,
) -> tuple[int, int]:
    """Advance from t0 over the time ``span``; a status, and the site it is about."""
    s, sample, size, wide = 0.0, int(work.pause[1]), work.v.size, work.near.shape[1]
    if work.pause[0] >= 0.0:  # the events of that step go on, with an answer
        s = work.pause[0]
        status, site = apply_events(on, work, log, period, t0 + s)
        if status != DONE:
            return status, site
    while s < span:
        anyone, partly, goes_on = any_at_rest(work.at_rest), False, True
        t, h = t0 + s, min(on.rest_step if anyone else on.step, span - s)
        end = s
        if not begin_step(on, work, t, h, anyone):
            return ASTRAY, 0
        while goes_on:
            dt = next_event(work)
            # the last step ends at the span itself, not beside it by rounding
            end = s + dt if dt >= 0.0 else (span if h >= span - s else s + h)
            sample = record_dense(on, work, dense, row, sample, t0, s, h, end)
            # events of few sites change few series: the others go on through the step
            few = on.ring and work.many[1] * wide < size
            goes_on = few and 0.0 <= dt < h and not (anyone or on.by_speed)
            arrive(work, dt, h, partly, goes_on)
            if dt >= 0.0:
                status, site = apply_events(on, work, log, period, t0 + end)
                if status != DONE:
                    work.pause[0], work.pause[1] = end, sample  # to go on from there
                    return status, site
            if goes_on:
                for i in range(work.many[1]):
                    expand_near(on, work, work.due[i], dt, h)
                partly, goes_on = True, not any_at_rest(work.at_rest)
                if not goes_on:
                    states_around(work, 0, size, dt, h)
                elif not contacts_near(on, work, t, dt, h):
                    return ASTRAY, 0
        s = end
    return DONE, 0


@inlined
def arrive(work: Workspace, dt: float, h: float, partly: bool, near: bool) -> None:
    """Bring ``v`` and ``w`` to the step's time dt, or to its end; with ``near`` those of sites
    around events alone. Some series may have been expanded anew: ``partly``."""
    size, wide = work.v.size, work.near.shape[1]
    if near:
        for i in range(work.many[1]):
            states_around(work, work.due[i] - wide // 2, work.due[i] + wide // 2 + 1, dt, h)
    elif dt < 0.0:
        for n in range(size):
            work.v[n], work.w[n] = work.last_v[n], work.last_w[n]
    elif partly:
        states_around(work, 0, size, dt, h)
    else:
        state_at(work.rows, h, dt / h, work.v, work.w)


@inlined
def record_dense(
    on: Parameters, work: Workspace, dense: DenseOutput, row: int, sample: int, t0: float,
    s: float, h: float, end: float,
) -> int:  # fmt: skip
    """Record the sampled sites at all times of the grid before ``end``; the next one's index.

    Step times count from s, times of the grid from t0.
    """
    while sample < dense.grid.size and dense.grid[sample] < end:
        time = dense.grid[sample]
        motion, velocity, _, _ = series_motion(on.motion, t0 + time)
        for i in range(dense.sites.size):
            n = dense.sites[i]
            left = h - work.origin[n]
            v, w, _ = site_at(work.rows, n, left, (time - s - work.origin[n]) / left)
            dense.u[row, sample, i] = v + motion
            dense.v[row, sample, i] = w + velocity
        sample += 1
    return sample


@inlined
def begin_period(on: Parameters, work: Workspace, u: Vector, v: Vector, t0: float) -> None:
    """Take out the forced motion; a site at rest on a wall that pushes it stays there."""
    motion, velocity, _, _ = series_motion(on.motion, t0)
    for n in range(u.size):
        work.hits[n] = 0
        work.v[n] = u[n] - motion
        work.w[n] = v[n] - velocity
        work.at_rest[n] = 0
        work.released[n] = 0
    for n in range(u.size):
        # bit for bit at the wall: so the loop left whoever rests on one
        wall = int(u[n] == on.walls[1, n]) - int(u[n] == on.walls[0, n])
        if wall != 0 and v[n] == 0.0 and push_into_wall(on, work, n, float(wall), t0)[0] > 0.0:
            work.at_rest[n] = np.int8(wall)


@inlined
def end_period(on: Parameters, work: Workspace, u: Vector, v: Vector, t0: float) -> bool:
    """Put the forced motion back; False where a number is no longer one."""
    motion, velocity, _, _ = series_motion(on.motion, t0)
    sound = True
    for n in range(u.size):
        if work.at_rest[n] != 0:
            u[n] = on.walls[int(work.at_rest[n] > 0), n]
            v[n] = 0.0
            continue
        u[n] = work.v[n] + motion
        v[n] = work.w[n] + velocity
        # a NaN is not between; 1 is far beyond what rounding does, 1e9 beyond any velocity
        between = on.walls[0, n] - 1.0 < u[n] < on.walls[1, n] + 1.0
        sound = sound and abs(v[n]) < 1e9 and between
    return sound


def event_loop(
    u: Vector, v: Vector, t0: float, span: float, first: int, on: Parameters, work: Workspace,
    log: EventLog, dense: DenseOutput, strobe_u: Matrix, strobe_v: Matrix, ended: Counts,
) -> None:  # fmt: skip
    """Advance (u, v) in place by as many periods as ``strobe_u`` has rows.

    ``ended`` gets how many were completed, with u and v the state after them, also if a chatter
    ended the next one; the status; the site that it is about.
    """
    ended[0], ended[1], ended[2] = strobe_u.shape[0], DONE, 0
    for j in range(strobe_u.shape[0]):
        if work.pause[0] < 0.0:
            work.begun[0] = log.used[0]
            begin_period(on, work, u, v, t0)
        status, site = one_period(on, work, log, dense, j, first + j, t0, span)
        if status != ASKS:
            work.pause[0], work.pause[1] = NEVER, 0.0
        if status == DONE and not end_period(on, work, u, v, t0 + span):
            status, site = WILD, 0
        if status != DONE:
            if status != ASKS:
                log.used[0] = work.begun[0]
            ended[0], ended[1], ended[2] = j, status, site
            return
        for n in range(u.size):
            strobe_u[j, n] = u[n]
            strobe_v[j, n] = v[n]


EVENT_LOOP = Kernel(event_loop, long=True)


# --- small perturbations along a run --------------------------------------------------------------


def fly(
    du: Matrix, dv: Matrix, at_rest: Signs, span: float, on: Parameters, zeros: Vector,
    nowhere: Matrix, rows: Matrix,
) -> None:  # fmt: skip
    """Carry perturbations over a time without events."""
    anyone, left = any_at_rest(at_rest), span
    while left > 0.0:
        h = min(on.step, left)  # nothing is driven: the harmonics of the forcing do not count
        for i in range(du.shape[0]):
            if anyone or not on.ring:
                expand_any(du[i], dv[i], h, on.mu, 0.0, on.bonds, at_rest, nowhere, zeros, rows)
            else:
                expand_state(du[i], dv[i], h, on.gamma, on.mu, rows)
            state_at(rows, h, 1.0, du[i], dv[i])
        left -= h


def kick(
    du: Matrix, dv: Matrix, at_rest: Signs, n: int, entry: float, ratio: float, slope: float
) -> None:
    """One event: the block of (19), the beginning of a rest (NaN), or its end (infinite)."""
    if math.isinf(entry):
        at_rest[n] = 0
        return
    if math.isnan(entry):
        at_rest[n] = 1
    for i in range(du.shape[0]):
        u, v = du[i, n], dv[i, n]
        if at_rest[n] != 0:  # wherever it came from, the site is at its wall
            du[i, n] = dv[i, n] = 0.0
        else:
            du[i, n] = ratio * u
            dv[i, n] = slope * v + entry * u


def tangent_flow(
    du: Matrix, dv: Matrix, at_rest: Signs, span: float, on: Parameters, since: Vector,
    site: Counts, entry: Vector, ratio: Vector, slope: Vector, zeros: Vector, nowhere: Matrix,
    rows: Matrix,
) -> None:  # fmt: skip
    """Perturbations ``du, dv`` (m, N) over a time ``span`` with these events, in place.

    Nothing drives them and a site at rest has none: ``zeros`` and ``nowhere`` are zeros; ``rows``
    is room for a step.
    """
    s = 0.0
    for i in range(since.size):
        fly(du, dv, at_rest, since[i] - s, on, zeros, nowhere, rows)
        s = since[i]
        kick(du, dv, at_rest, site[i], entry[i], ratio[i], slope[i])
    fly(du, dv, at_rest, span - s, on, zeros, nowhere, rows)


TANGENT_FLOW = Kernel(tangent_flow)
