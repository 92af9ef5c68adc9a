"""Motion of the sites of a periodic orbit, whatever represents it, as kernels take it.

    ``u_n(t) = c_n + a f_n(t) + sum over impacts j of J_j h_nj(t - t_j)
               + sum over modes i of e_ni y_i(t)``:

a forced motion, the responses to impacts that recur (closed form and Green's function of chain and
ring), the free flights of the modes (any finite lattice). What an orbit does not have is empty.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from contbreather.kernels import Matrix, Vector, fixed, inlined
from contbreather.lattice.free_flight import Responses, response_since

OFFSET, LOW, HIGH = range(3)  # columns of places
TIME, IMPULSE, SITE, WALL = range(4)  # rows of impacts
LATE = 1e-12  # an impact this little later has been


@fixed
class Forced(NamedTuple):
    """The motion at unit amplitude: ``sum over m of A cos mt + B sin mt``."""

    orders: Vector  # m
    cosines: Matrix  # A of each site, in one row where all move alike
    sines: Matrix  # B
    peak: float  # largest of all values


@fixed
class FreeModes(NamedTuple):
    """Free flights of the modes ``y'' + damping y' + z y = 0``, one after each impact."""

    starts: Vector
    q: Matrix  # displacements and velocities at the start of each flight
    r: Matrix
    z: Vector
    damping: float
    shapes: Matrix  # e, a row for each site
    profiles: Matrix  # displacements at equal steps of the section, of each site without impacts


class Motion(NamedTuple):
    """Of sites that impact, and behind them of sites that do not."""

    a: float
    k: float
    start: float  # of a section
    length: float
    sign: float  # with which the motion goes on after it
    fine: int  # points of a grid to half a period of the forcing
    forced: Forced
    responses: Responses
    modes: FreeModes
    impacts: Matrix  # of a period: times, impulses, sites, walls
    flights: int  # impacts of a section
    busy: int  # sites that impact
    places: Matrix  # of each site c, its low and its high wall


@inlined
def site_state(motion: Motion, site: int, t: float) -> tuple[float, float, float]:
    """Displacement, velocity and acceleration; at an impact just after it."""
    forced, responses = motion.forced, motion.responses
    row = site if forced.cosines.shape[0] > 1 else 0
    f = df = d2f = 0.0
    for i in range(forced.orders.size):
        m = forced.orders[i]
        c, s = math.cos(m * t), math.sin(m * t)
        value = forced.cosines[row, i] * c + forced.sines[row, i] * s
        f += value
        df += m * (forced.sines[row, i] * c - forced.cosines[row, i] * s)
        d2f -= m * m * value
    u, v, w = motion.places[site, OFFSET] + motion.a * f, motion.a * df, motion.a * d2f
    for j in range(responses.which.shape[1]):
        J = motion.impacts[IMPULSE, j]
        h, dh, d2h, _ = response_since(
            responses, responses.which[site, j], t - motion.impacts[TIME, j]
        )
        u, v, w = u + J * h, v + J * dh, w + J * d2h
    if motion.modes.z.size > 0:
        y, dy, d2y = free(motion, site, t)
        u, v, w = u + y, v + dy, w + d2y
    return u, v, w


def state(motion: Motion, site: int, t: float) -> tuple[float, float, float]:
    """The same, for whoever asks once: `site_state` is written out in loops."""
    return site_state(motion, site, t)


def free(motion: Motion, site: int, t: float) -> tuple[float, float, float]:
    """The share of the modes in displacement, velocity and acceleration of a site."""
    modes = motion.modes
    first = t - modes.starts[0]
    past = math.floor((first + LATE) / motion.length)
    since, i = t - past * motion.length, modes.starts.size - 1
    while i > 0 and modes.starts[i] > since + LATE:
        i -= 1
    flip = motion.sign if past % 2 != 0 else 1.0
    u = v = w = 0.0
    for j in range(modes.z.size):
        z, e = modes.z[j], flip * modes.shapes[site, j]
        C, S, dS = mode_solutions(z, modes.damping, since - modes.starts[i])
        y, dy = C * modes.q[i, j] + S * modes.r[i, j], dS * modes.r[i, j] - z * S * modes.q[i, j]
        u, v, w = u + e * y, v + e * dy, w - e * (z * y + modes.damping * dy)
    return u, v, w


def mode_solutions(z: float, damping: float, t: float) -> tuple[float, float, float]:
    """C, S and S' of a mode, the solutions that start with (1, 0) and (0, 1); S is finite at z = 0,
    and overdamped modes neither overflow nor cancel."""
    x, lost = (z - 0.25 * damping * damping) * t * t, 0.5 * damping * t
    root, decay = math.sqrt(abs(x)), math.exp(-lost)
    if x >= 0.0:
        c, s = decay * math.cos(root), decay * math.sin(root)
    else:
        grown, fallen = math.exp(root - lost), math.exp(-root - lost)
        c = 0.5 * (grown + fallen)
        s = decay * math.sinh(root) if root < 1.0 else 0.5 * (grown - fallen)
    S = t * (s / root if root > 0.0 else decay)
    return c + 0.5 * damping * S, S, c - 0.5 * damping * S


def points_of(fine: int, length: float) -> int:
    """Of a grid over a time."""
    return math.ceil(fine * max(1.0, length / math.pi) - 1e-9)


@inlined
def on_grid(motion: Motion, site: int, p: int, points: int) -> float:
    """Displacement of a site without impacts after p of so many equal steps of the section."""
    if motion.modes.z.size > 0:
        flip = motion.sign if (p // points) % 2 != 0 else 1.0
        return float(flip * motion.modes.profiles[site - motion.busy, p % points])
    return site_state(motion, site, motion.start + motion.length / points * p)[0]


def largest_displacement(motion: Motion, site: int) -> float:
    """No less than the largest displacement of a site."""
    if motion.modes.z.size > 0:
        return math.inf
    total = abs(motion.places[site, OFFSET]) + motion.a * motion.forced.peak
    for j in range(motion.responses.which.shape[1]):
        largest = motion.responses.largest[motion.responses.which[site, j]]
        total += abs(motion.impacts[IMPULSE, j]) * largest
    return float(total)
