"""A damped lattice between impacts, to rounding, with all its sites as polynomials of time.

``v = u - a g(t)`` takes out one forced motion for all sites (``g'' + mu g' = F/a``), and leaves
``v'' + mu v' + K v = (d - 1) F - K 1 a g``, where K holds couplings and springs per unit mass and d
is the pattern of the drive: on a ring without springs nothing is left on the right. Over a step h
the Taylor series in s/h is summed to the last bit: the terms of a mode fall like ``(w h)^j/j!``,
whatever the number of sites. That is the exact propagator of the modes (18) written site by site,
where it is sparse: N operations instead of N^2 or N log N, and at once a formula for every time
inside the step, which is what the search for impacts needs.

Rows are coefficients: ``rows[j, n]`` belongs to site n and ``(s/h)^j``. What the kernels of rigid
walls take, parameters, event log, dense output and workspace, stands first.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from contbreather.kernels import Counts, Cube, Matrix, Signs, Vector, inlined


class Harmonics(NamedTuple):
    """A trigonometric sum ``sum of c cos(m t) + s sin(m t)``: the forced motion, or the force."""

    m: Vector
    c: Vector
    s: Vector


class Couplings(NamedTuple):
    """What pulls at each site, per unit mass: K and the drive by sites, K by its rows (CSR)."""

    start: Counts  # entries of site n are those from start[n] to start[n + 1]
    other: Counts
    weight: Vector  # -K[n, other]
    # by sites, in rows: K[n, n]; d - 1, by how much more a site is driven than the common motion
    # says; K 1, what pulls at the common motion
    pulls: Matrix


class Parameters(NamedTuple):
    """What does not change during a run: the lattice, its damping, its walls, its forcing."""

    ring: bool  # without springs: K is gamma (2, -1, -1), and nothing drives v
    gamma: float
    bonds: Couplings
    # by sites, in rows: the low and the high wall, infinite where there is none; the smaller
    # distance of both from 0
    walls: Matrix
    mu: float
    k: float
    step: float  # over which the series converge to rounding in ``size`` terms
    rest_step: float  # with a site at rest, which moves in v with all harmonics of the forcing
    size: int  # terms of the series in time
    most: int  # impacts of one site in one period
    motion: Harmonics  # a g(t), g'' + mu g' = F/a
    force: Harmonics  # F(t)


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
    """Of one step. ``rows`` of site n are powers of (s - origin[n])/h, s the step's time."""

    v: Vector  # v = u - a g(t) and w = v', at the start of the step, or at the present event
    w: Vector
    rows: Matrix  # (powers, sites)
    origin: Vector
    last_v: Vector  # at the end of the step, where no event intervenes
    last_w: Vector
    reach: Vector  # no |v| is larger during the step
    patch: Matrix  # rows of the sites around an impact
    push_rows: Matrix  # of the push of a wall on a site at rest, without what drives it
    column: Vector  # powers of the forced motion
    drive: Matrix  # what drives a site at rest, its cosines and sines
    when: Vector  # a site's next event in the step
    side: Signs  # the wall that it then meets
    at_rest: Signs  # the wall on which a site rests, or 0
    place: Vector  # of that wall
    released: Signs  # the wall that has just let go of a site, or 0
    changed: Signs  # whether a site has an event now
    hits: Counts  # in this period
    candidates: Counts  # the sites that may have an event in this step, ``many`` of them
    many: Counts
    listed: Signs  # whether a site is among them


# --- the series -----------------------------------------------------------------------------------

STEP = 0.5 * math.pi  # longest step; with more, the bounds of `contact` lose their grip
LAST = 1e-18  # size of the first term left out, relative to the first one


def powers_needed(reach: float) -> int:
    """How many powers of s/h are needed where the fastest rate times h is ``reach``."""
    j, size = 0, 1.0
    while size > LAST or j < 4:
        j += 1
        size *= reach / j
    return j + 1


@inlined
def drive_sum(drive: Harmonics, t: float) -> tuple[float, float, float]:
    """The sum at time t, and its first and second derivative."""
    value = slope = bend = 0.0
    for i in range(drive.m.size):
        m = drive.m[i]
        cosine, sine = math.cos(m * t), math.sin(m * t)
        wave = drive.c[i] * cosine + drive.s[i] * sine
        value += wave
        slope += m * (drive.s[i] * cosine - drive.c[i] * sine)
        bend -= m * m * wave
    return value, slope, bend


def driven_jerk(drive: Harmonics, t: float) -> float:
    """The third derivative of the sum at time t."""
    total = 0.0
    for i in range(drive.m.size):
        m = drive.m[i]
        total += m * m * m * (drive.c[i] * math.sin(m * t) - drive.s[i] * math.cos(m * t))
    return total


def driven_terms(drive: Harmonics, t: float, h: float, column: Vector) -> None:
    """Taylor coefficients of the sum around t in powers of s/h, to be held in ``column``."""
    for j in range(column.size):
        column[j] = 0.0
    for i in range(drive.m.size):
        m = drive.m[i]
        cosine, sine = math.cos(m * t), math.sin(m * t)
        wave = drive.c[i] * cosine + drive.s[i] * sine
        turned = drive.s[i] * cosine - drive.c[i] * sine
        for j in range(column.size):
            column[j] += wave
            # the next derivative over (j + 1)!, times h^(j + 1): each turns the wave by pi/2
            wave, turned = turned * (m * h / (j + 1)), -wave * (m * h / (j + 1))


def driven_bound(drive: Harmonics, order: int) -> float:
    """No derivative of that order is ever larger."""
    total = 0.0
    for i in range(drive.m.size):
        size = abs(drive.c[i]) + abs(drive.s[i])
        for _ in range(order):
            size *= drive.m[i]
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
    """Pull on site n of the sites beside it."""
    total = 0.0
    for i in range(bonds.start[n], bonds.start[n + 1]):
        total += bonds.weight[i] * x[bonds.other[i]]
    return total


def expand_any(
    v: Vector, w: Vector, h: float, mu: float, bonds: Couplings, at_rest: Signs, place: Vector,
    column: Vector, rows: Matrix,
) -> None:  # fmt: skip
    """The same on any lattice, with some sites resting on their walls: at ``place - a g(t)``.

    ``column`` holds the Taylor coefficients of a g; with zeros in it and in ``place`` nothing is
    driven and the sites held do not move at all, which is what perturbations do.
    """
    stiff, extra, ground = bonds.pulls[0], bonds.pulls[1], bonds.pulls[2]
    for n in range(v.size):
        # u stays at its wall, so that v = u - a g has the powers of -a g
        rows[0, n] = place[n] - column[0] if at_rest[n] != 0 else v[n]
        rows[1, n] = -column[1] if at_rest[n] != 0 else h * w[n]
    for j in range(2, rows.shape[0]):
        pull, drag = -h * h / (j * (j - 1)), -mu * h / j
        before, now, new = rows[j - 2], rows[j - 1], rows[j]
        # F = a (g'' + mu g') and a g, as much as one power of each adds to v
        push, still = column[j] - drag * column[j - 1], pull * column[j - 2]
        for n in range(v.size):
            if at_rest[n] != 0:
                new[n] = -column[j]
                continue
            pulled = pull * (stiff[n] * before[n] - near(bonds, before, n)) + drag * now[n]
            new[n] = pulled + (extra[n] * push + ground[n] * still)


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
