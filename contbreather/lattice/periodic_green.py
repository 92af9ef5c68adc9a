"""Responses of chain and ring to impacts that recur, as kernels take them, and their tables.

The answer of site n to the impacts of site 0 that recur after half a period with the other sign,
per unit p, is ``<cos(n theta) sin(w (pi/2 - s))/(w cos(pi w/2))>``. The harmonic that drives the
band's edge, cos s, is kept exact; everything else is a power series in ``w^2`` whose coefficients
are polynomials of the time from mid flight, ``y = s - pi/2``:

    ``v_n = (4/pi) [ -g sin y + sum over j of <w^(2j) cos(n theta)> P_j(y) ]``,
    ``P_j(y) = sum over i of (-1)^i y^(2i+1)/(2i+1)! W_ij``,
    ``W_ij = 1 - beta(2(j-i)+1)`` for i <= j, else 1 (beta: Dirichlet's, from sec(pi w/2)).

``P_j`` falls like ``9^-j``, so one odd polynomial of degree 25 in y holds all of it, to rounding,
for displacement, velocity and acceleration alike, impacts included.

Unit impulses that recur once a period are answered by the periodic Green's function. Over T = 2 pi
n, mode w answers ``g_w(s) = cos(w (T/2 - s))/(2 w sin(w T/2))``, s in [0, T]. Its limit
``1/(w^2 T)`` is a static push: it belongs to the offsets of the orbit, which balance the mean
impulses, and is taken out here, mode by mode,

    ``h_d(s) = <cos(d theta) [g_w(s) - 1/(w^2 T)]>``,   d the distance between the two sites.

Time in units of n turns every n into n = 1 with ``n^2 gamma`` in place of gamma. There, with
``y = pi - s``, partial fractions give
``h = -(1/pi) sum over j of <cos(d theta)/(j^2 - w^2)> cos js``. Expanded in ``w^2``, the
sums over j are Bernoulli polynomials: one even polynomial in y holds the moments of the band up to
order 18, and what is beyond lives in the harmonics 1 and 2 alone (of the third there is 9^-19). So
the limits w -> 0 and gamma -> 0 are exact, impacts included.

Where ``2 sqrt(gamma) >= 1/n`` a harmonic j/n of the orbit lies in the band. The infinite chain
radiates it: no localised orbit of that period exists. A ring has modes of its own, see
`contbreather.lattice.response`.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from contbreather.errors import BadInput
from contbreather.kernels import Counts, Cube, Kernel, Matrix, Table, Vector, fixed, inlined
from contbreather.lattice.band_averages import (
    TERMS,
    UniformLattice,
    bernoulli,
    check_gamma,
    in_powers_of_x,
    moments_of,
    zeta,
)
from contbreather.lattice.chain import InfiniteChain

FloatArray = NDArray[np.float64]

POWERS = 13  # odd powers of y: (pi/2)^27/27! < 1e-22
LATE = 1e-12  # an impact this little later has been,
SLACK = (
    1e-15  # and one that the roundings of a time, of the impact and of what is between them hide
)
EVEN_POWERS = 16  # of y: pi^32/32! < 1e-19


@fixed
class Responses(NamedTuple):
    """Functions of the time y from the middle between two impacts, in units of n, and of the time
    s since the first of them:

        ``P(y^2) + A cos y + B cos 2y + sum over i of Re C_i exp(l_i s)``

    after 2 pi n, or, of an orbit whose impacts recur with the other sign after half a period,
    ``y P(y^2) + A sin y`` and waves.
    """

    which: Table  # row of the table for each site and impact
    table: Matrix  # coefficients of P, that of the highest power first, then A and B
    rates: Matrix  # l, real and imaginary part
    real: Matrix  # of C, a row for each of the table
    imaginary: Matrix
    largest: Vector  # no less than all values of each row
    turns: float  # n
    half: bool  # impacts recur after half a period

    def at(self, since: ArrayLike, rows: ArrayLike = 0) -> FloatArray:
        """Value and first three derivatives at any times since an impact, at the impact itself
        those just after it, for rows of the table; shape ``(4, ...)``."""
        shape = np.broadcast(since, rows).shape
        times, which = np.empty(shape), np.empty(shape, dtype=np.int64)
        times[...], which[...] = since, rows
        out = np.empty((4, times.size))
        RESPONSES(self, times.ravel(), which.ravel(), out)
        return out.reshape(4, *shape)


@inlined
def section_length(on: Any) -> float:
    """Time after which impacts recur, of whatever has its ``turns`` and tells whether it is
    ``half`` a period."""
    return (1.0 if on.half else 2.0) * math.pi * on.turns


@inlined
def sections_since(on: Any, since: float) -> int:
    """Count how often an impact has recurred; just after it, it has."""
    return math.floor((since + LATE * on.turns + SLACK * abs(since)) / section_length(on))


@inlined
def sections_between(on: Any, since: float) -> int:
    """Count them between impacts of one section, whose answers to each other go on as they are
    where the last one comes after the first of the next."""
    past = sections_since(on, since)
    return min(max(past, -1), 0) if abs(since) < 1.5 * section_length(on) else past


@inlined
def response_since(
    responses: Responses, row: int, since: float
) -> tuple[float, float, float, float]:
    """Value and three derivatives at a time since an impact, those just after it."""
    return response_in(responses, row, since, sections_since(responses, since))


@inlined
def response_in(
    responses: Responses, row: int, since: float, past: int
) -> tuple[float, float, float, float]:
    """Responses as they go on from the section after so many others."""
    table, n = responses.table, responses.turns
    width = math.pi if responses.half else 2.0 * math.pi
    s = since / n
    y = s - width * past - 0.5 * width
    z, powers = y * y, table.shape[1] - 2
    P = dP = curvature = jerk = 0.0  # a polynomial in z; derivatives over 1, 2 and 6
    for i in range(powers):
        jerk = jerk * z + curvature
        curvature = curvature * z + dP
        dP = dP * z + P
        P = P * z + table[row, i]
    A, B, c, s = table[row, powers], table[row, powers + 1], math.cos(y), math.sin(y)
    if responses.half:
        h, dh = y * P + A * s, P + 2.0 * z * dP + A * c
        d2h = y * (6.0 * dP + 8.0 * z * curvature) - A * s
        d3h = 6.0 * dP + 48.0 * z * (curvature + z * jerk) - A * c
    else:
        c2, s2 = 2.0 * c * c - 1.0, 2.0 * c * s
        h, dh = P + A * c + B * c2, 2.0 * y * dP - A * s - 2.0 * B * s2
        d2h = 2.0 * dP + 8.0 * z * curvature - A * c - 4.0 * B * c2
        d3h = 24.0 * y * curvature + 48.0 * z * y * jerk + A * s + 8.0 * B * s2
    dh, d2h, d3h = dh / n, d2h / (n * n), d3h / (n * n * n)
    s = since - n * width * past
    for i in range(responses.rates.shape[0]):
        a, b = responses.rates[i, 0], responses.rates[i, 1]
        grown = math.exp(a * s) if a != 0.0 else 1.0
        c, d = grown * math.cos(b * s), grown * math.sin(b * s)
        C, D = responses.real[row, i], responses.imaginary[row, i]
        u, v = C * c - D * d, C * d + D * c
        h += u
        u, v = a * u - b * v, a * v + b * u
        dh += u
        u, v = a * u - b * v, a * v + b * u
        d2h += u
        d3h += a * u - b * v
    if responses.half and past % 2 != 0:
        return -h, -dh, -d2h, -d3h
    return h, dh, d2h, d3h


def responses_at(responses: Responses, since: Vector, rows: Counts, out: Matrix) -> None:
    """Responses of each row at its time, in columns."""
    for i in range(since.size):
        h, dh, d2h, d3h = response_since(responses, rows[i], since[i])
        out[0, i], out[1, i], out[2, i], out[3, i] = h, dh, d2h, d3h


def interactions(responses: Responses, times: Vector, out: Cube) -> None:
    """Responses of impacts of one section to each other: ``h_ij`` and three derivatives at
    ``t_i - t_j``, see `sections_between`."""
    for i in range(times.size):
        for j in range(times.size):
            row, since = responses.which[i, j], times[i] - times[j]
            past = sections_between(responses, since)
            h, dh, d2h, d3h = response_in(responses, row, since, past)
            out[0, i, j], out[1, i, j], out[2, i, j], out[3, i, j] = h, dh, d2h, d3h


RESPONSES, INTERACTIONS = Kernel(responses_at), Kernel(interactions)


# --- their tables ---------------------------------------------------------------------------------


@lru_cache(maxsize=64)
def periodic_green(
    lattice: UniformLattice,
    gamma: float,
    sites: tuple[int, ...],
    hits: tuple[int, ...] = (0,),
    periods: int = 1,
    by: str = "",
) -> Responses:
    """The periodic Green's function of sites to impulses at others that recur after 2 pi n, without
    its static part; or its derivative in the coupling. `BadInput` where a harmonic 1/n lies in the
    band of the infinite chain, ``gamma >= 1/(4 n^2)``.
    """
    apart = [[lattice.distance(site - hit) for hit in hits] for site in sites]
    distances, places = np.unique(apart, return_inverse=True)
    which = places.reshape(len(sites), len(hits))
    scaled = check_coupling(lattice, gamma, periods)
    # <cos/(4 - w^2)> is a quarter of <cos/(1 - w^2)> at a quarter of the coupling; a slope is that
    # of a function of n^2 gamma
    n2, quarter = (periods**2, 0.0625) if by else (1, 0.25)
    first, second = (lattice.first_harmonic(x, distances, by) for x in (scaled, 0.25 * scaled))
    moments = n2 * lattice.powers(scaled, tuple(distances.tolist()), by)
    table = periods * _rows(moments, n2 * first, n2 * quarter * second)
    return _without_modes(which, table, periods, half=False)


@lru_cache(maxsize=64)
def half_period_green(
    lattice: UniformLattice, gamma: float, sites: tuple[int, ...], by: str = ""
) -> Responses:
    """The answer of sites to impulses at site 0 that recur after half a period with the other sign,
    or its derivative in gamma or the spring.
    """
    table = np.zeros((len(sites), POWERS + 2))
    np.matmul(lattice.powers(gamma, sites, by), weights_per_impulse(), out=table[:, :POWERS])
    table[:, POWERS] = 2.0 / math.pi * lattice.first_harmonic(gamma, np.array(sites), by)  # sin y
    return _without_modes(np.arange(len(sites))[:, None], table, 1, half=True)


def half_period_tables(
    gamma: FloatArray, spring: Any, distances: tuple[int, ...]
) -> tuple[FloatArray, FloatArray]:
    """Tables of `half_period_green` of infinite chains of many couplings, and perhaps as many
    springs that grow with them, (n, sites, POWERS + 2), and `largest`, no less than of any."""
    x, rest, m = 4.0 * gamma[:, None], 1.0 - np.reshape(spring, (-1, 1)), np.array(distances)
    powers = np.vander(4.0 * gamma, TERMS + 1, increasing=True)
    table = np.zeros((gamma.size, m.size, POWERS + 2))
    if np.any(spring):
        moments = moments_of(InfiniteChain(), distances) * powers[:, None]
        weights = in_powers_of_x(spring).swapaxes(-1, -2) @ weights_per_impulse()
        table[..., :POWERS] = moments @ weights
    else:
        table[..., :POWERS] = (powers @ _weighted_moments(distances)).reshape(-1, m.size, POWERS)
    r = np.sqrt(1.0 - x / rest)
    rho = x / (rest * (1.0 + r) ** 2)
    table[..., POWERS] = 2.0 / math.pi * (-rho) ** m / (r * rest)
    # coupling and spring make each power of w^2 larger, and all have shares of one sign: the widest
    # band has the largest responses
    most = _largest(table[(gamma + np.asarray(spring)).argmax()], half=True)
    return table, np.tile(most, (gamma.size, 1))


@lru_cache(maxsize=16)
def _weighted_moments(distances: tuple[int, ...]) -> FloatArray:
    """Shares of each power of 4 gamma in a table, (TERMS + 1, sites POWERS)."""
    moments = moments_of(InfiniteChain(), distances)
    return np.einsum("mj,jp->jmp", moments, weights_per_impulse()).reshape(TERMS + 1, -1)


@lru_cache(maxsize=1)
def weights_per_impulse() -> FloatArray:
    """``-(2/pi) (-1)^i W_ij/(2i+1)!`` by j and i, the highest power first: of a unit impulse, which
    is -2p."""
    order = 2.0 * np.arange(1, TERMS + 1) + 1.0
    # 1 - beta(s) = 3^-s - 5^-s + 7^-s ...: without the cancellation of the difference
    later = 4.0**-order * (zeta(order, 0.75) - zeta(order, 1.25))
    gap = np.append(1.0 - 0.25 * math.pi, later)
    w = np.ones((POWERS, TERMS + 1))  # rows: powers of y; columns: of w^2
    for i in range(POWERS):
        w[i, i:] = gap[: max(0, TERMS + 1 - i)]
        w[i] *= (-1.0) ** i * -2.0 / (math.pi * math.factorial(2 * i + 1))
    return w[::-1].T


def _without_modes(which: Any, table: FloatArray, periods: int, *, half: bool) -> Responses:
    none, rates = np.empty((len(table), 0)), np.empty((0, 2))
    largest = _largest(table, half=half)
    return Responses(which, table, rates, none, none, largest, float(periods), half)


def _largest(table: FloatArray, *, half: bool) -> FloatArray:
    # harmonics beyond the second are too small for a maximum to hide between the places of a basis
    return np.asarray(1.01 * abs(table @ _basis(table.shape[-1], half)).max(axis=-1))


@lru_cache(maxsize=2)
def _basis(size: int, half: bool) -> FloatArray:
    """Share of each coefficient of a table in a response over half the time between impacts."""
    which, none, rates = np.empty((0, 0), dtype=int), np.empty((size, 0)), np.empty((0, 2))
    each = Responses(which, np.eye(size), rates, none, none, none[0], 1.0, half)
    times = np.linspace(0.0, 0.5 * math.pi if half else math.pi, 65)
    return each.at(times, np.arange(size)[:, None])[0]


def check_coupling(lattice: UniformLattice, gamma: float, periods: int) -> float:
    """``n^2 gamma``, or why no orbit of n periods lives at this coupling."""
    gamma = check_gamma(gamma)
    scaled = periods * periods * gamma
    if scaled >= 0.25 and lattice.sites is None:
        raise BadInput(
            f"an orbit of {periods} forcing periods has the harmonic 1/{periods}, which lies in "
            f"the band [0, {2 * math.sqrt(gamma):.6g}] of gamma = {gamma:.6g}: the infinite chain "
            f"radiates it away. Stay below gamma = 1/{4 * periods**2}, or take a ring."
        )
    return scaled


def _rows(moments: FloatArray, first: FloatArray, second: FloatArray) -> FloatArray:
    """Rows of coefficients from ``<w^2l cos>`` and the whole harmonics ``<cos/(j^2 - w^2)>``,
    j = 1, 2."""
    rows = np.empty((len(moments), EVEN_POWERS + 2))
    np.matmul(moments, _bernoulli().T, out=rows[:, :EVEN_POWERS])
    # less what the polynomial already holds of both harmonics; -(1/pi) cos s = (1/pi) cos y, and
    # -(1/pi) cos 2s = -(1/pi) cos 2y
    rows[:, EVEN_POWERS] = (first - moments.sum(axis=1)) / math.pi
    quarters = 0.25 ** np.arange(1.0, TERMS + 2.0)
    rows[:, EVEN_POWERS + 1] = (second - moments @ quarters) / -math.pi
    return rows


@lru_cache(maxsize=1)
def _bernoulli() -> FloatArray:
    """``-1/pi`` times the coefficients of y^2i in ``sum over j of (-1)^j cos(jy)/j^(2l+2)``, the
    highest power first."""
    table = np.zeros((EVEN_POWERS, TERMS + 1))
    for order in range(TERMS + 1):
        even = bernoulli(2 * order + 2, -math.pi)[: 2 * EVEN_POWERS : 2]
        table[: even.size, order] = even
    return table[::-1]


# --- through mid period -------------------------------------------------------------------------


def slope_ratio(responses: Responses, y: float) -> tuple[float, float]:
    """``slope/y`` of the first row and its derivative in the time y from mid period, smooth through
    y = 0, for n = 1."""
    *powers, first, second = responses.table[0].tolist()
    P = dP = curvature = 0.0  # and its derivatives in y^2, over 1 and 2
    for c in powers:
        curvature = curvature * y * y + dP
        dP = dP * y * y + P
        P = P * y * y + c
    (s1, d1), (s2, d2) = sinc(y), sinc(2.0 * y)
    value = 2.0 * dP - first * s1 - 4.0 * second * s2
    return value, 8.0 * y * curvature - first * d1 - 8.0 * second * d2


def sinc(y: float) -> tuple[float, float]:
    """``sin(y)/y`` and its derivative."""
    if abs(y) < 0.2:
        z = y * y
        value = 1.0 - z / 6.0 * (
            1.0 - z / 20.0 * (1.0 - z / 42.0 * (1.0 - z / 72.0 * (1.0 - z / 110.0)))
        )
        slope = -y / 3.0 * (1.0 - z / 10.0 * (1.0 - z / 28.0 * (1.0 - z / 54.0 * (1.0 - z / 88.0))))
        return value, slope
    value = math.sin(y) / y
    return value, (math.cos(y) - value) / y
