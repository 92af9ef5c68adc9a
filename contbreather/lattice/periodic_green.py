"""Periodic Green's function: how the lattice answers unit impulses that recur once a period.

Over T = 2 pi n, mode w answers ``g_w(s) = cos(w (T/2 - s))/(2 w sin(w T/2))``, s in [0, T]. Its
limit ``1/(w^2 T)`` is a static push: it belongs to the offsets of the orbit, which balance the
mean impulses, and is taken out here, mode by mode,

    ``h_d(s) = <cos(d theta) [g_w(s) - 1/(w^2 T)]>``,   d the distance between the two sites.

Time in units of n turns every n into n = 1 with ``n^2 gamma`` in place of gamma. There, with
``y = pi - s``, partial fractions give
``h = -(1/pi) sum over j of <cos(d theta)/(j^2 - w^2)> cos js``. Expanded in ``w^2``, the
sums over j are Bernoulli polynomials: one even polynomial in y holds the moments of the band up to
order 18, and what is beyond lives in the harmonics 1 and 2 alone (of the third there is 9^-19). So
the limits w -> 0 and gamma -> 0 are exact, impacts included.

Where ``2 sqrt(gamma) >= 1/n`` a harmonic j/n of the orbit lies in the band. The infinite chain
radiates it: no localised orbit of that period exists. A ring has modes of its own, which are then
summed one by one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from contbreather.errors import BadInput
from contbreather.lattice.band_averages import UniformLattice, check_gamma
from contbreather.lattice.chain import Ring
from contbreather.lattice.free_flight import TERMS, Responses, cosine_and_sine, polynomial
from contbreather.lattice.zeta import bernoulli

FloatArray = NDArray[np.float64]
Four = tuple[Any, Any, Any, Any]

POWERS = 16  # even powers of y: pi^32/32! < 1e-19
LOW = 0.5  # modes of a resonant ring below this, in units of 1/n, go by the polynomial
APART = 1e-9  # a mode this close to a harmonic is in resonance with it


class ModeSums(NamedTuple):
    """Modes summed one by one: ``alpha cos(W y) + beta y sin(W y)``, and a constant for all."""

    W: FloatArray
    alpha: FloatArray
    beta: FloatArray
    constant: float


@dataclass(frozen=True, eq=False, repr=False)
class Wave:
    """One site's answer to unit impulses once a period, or that answer's slope in gamma.

    In units of n: ``sum of powers[i] y^2i + first cos y + second cos 2y``, ``y = pi - s``. Values
    for floats and for arrays alike; floats never touch numpy.
    """

    periods: int
    powers: tuple[float, ...]
    first: float
    second: float
    modes: ModeSums | None = None

    def at(self, s: Any) -> Four:
        """Value and first three derivatives at any time s since an impulse; at the impulse
        itself those just after it."""
        n = self.periods
        value, slope, curvature, jerk = self.about(math.pi - (s / n) % (2.0 * math.pi))
        return n * value, -slope, curvature / n, -jerk / (n * n)  # y = pi - s/n

    def about(self, y: Any) -> Four:
        """The same for n = 1 as a function of ``y = pi - s`` in [-pi, pi], derivatives in y."""
        z, (c, s) = y * y, cosine_and_sine(y)
        P, dP, bend, jerk = polynomial(self.powers, z)
        # derivatives of P(y^2) in y; bend is P''/2 and jerk P'''/6
        a, b, c2, s2 = self.first, self.second, c * c - s * s, 2.0 * c * s
        four = (
            P + a * c + b * c2,
            2.0 * y * dP - a * s - 2.0 * b * s2,
            2.0 * dP + 8.0 * z * bend - a * c - 4.0 * b * c2,
            24.0 * y * bend + 48.0 * z * y * jerk + a * s + 8.0 * b * s2,
        )
        if self.modes is None:
            return four
        modes = _mode_by_mode(self.modes, y)
        return tuple(smooth + mode for smooth, mode in zip(four, modes, strict=True))

    def slope_ratio(self, y: float) -> tuple[float, float]:
        """``slope/y`` and its derivative in y for n = 1, smooth through mid period y = 0."""
        _, dP, bend, _ = polynomial(self.powers, y * y)
        (s1, d1), (s2, d2) = sinc(y), sinc(2.0 * y)
        value = 2.0 * dP - self.first * s1 - 4.0 * self.second * s2
        return value, 8.0 * y * bend - self.first * d1 - 8.0 * self.second * d2


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


def _mode_by_mode(modes: ModeSums, y: Any) -> Four:
    W, alpha, beta, constant = modes
    angle = np.multiply.outer(y, W)
    c, s = np.cos(angle), np.sin(angle)
    y = np.asarray(y)
    W2 = W * W
    return (
        c @ alpha + y * (s @ beta) + constant,
        s @ (beta - alpha * W) + y * (c @ (beta * W)),
        c @ (2.0 * beta * W - alpha * W2) - y * (s @ (beta * W2)),
        s @ (alpha * W2 * W - 3.0 * beta * W2) - y * (c @ (beta * W2 * W)),
    )


# --- from a lattice -------------------------------------------------------------------------


@lru_cache(maxsize=4096)
def periodic_green(lattice: UniformLattice, gamma: float, distance: int, periods: int = 1) -> Wave:
    """The periodic Green's function between two sites, without its static part.

    Parameters
    ----------
    lattice : InfiniteChain or Ring
    gamma : float
        Coupling in [0, 1/4).
    distance : int
        Bonds between the site that is pushed and the one that is watched.
    periods : int
        n, for impulses that recur after 2 pi n.

    Raises
    ------
    BadInput
        In resonance: on the infinite chain where a harmonic 1/n lies in the band,
        ``gamma >= 1/(4 n^2)``; on a ring where one of its modes is a harmonic.

    Examples
    --------
    An impulse changes the velocity of its own site by 1, and of no other:

    >>> from contbreather.lattice.chain import InfiniteChain
    >>> after = [periodic_green(InfiniteChain(), 0.12, d).at(0.0)[1] for d in (0, 1)]
    >>> [abs(round(2 * slope, 12)) for slope in after]
    [1.0, 0.0]
    """
    return _wave(lattice, gamma, distance, periods, slope=False)


@lru_cache(maxsize=4096)
def wave_slope(lattice: UniformLattice, gamma: float, distance: int, periods: int = 1) -> Wave:
    """Derivative of `periodic_green` in gamma: again a `Wave`; parameters and errors as there.

    Examples
    --------
    >>> from contbreather.lattice.chain import InfiniteChain
    >>> chain, h = InfiniteChain(), 1e-5
    >>> low, high = (periodic_green(chain, 0.12 + x, 2).at(1.0)[0] for x in (-h, h))
    >>> round((high - low) / (2 * h) - wave_slope(chain, 0.12, 2).at(1.0)[0], 6) + 0.0
    0.0
    """
    return _wave(lattice, gamma, distance, periods, slope=True)


def _wave(
    lattice: UniformLattice, gamma: float, distance: int, periods: int, *, slope: bool
) -> Wave:
    rows = wave_table(lattice, gamma, (distance,), periods, slope=slope)
    if rows is None:
        return _resonant(lattice, gamma, distance, periods)[slope]
    return _wave_of(periods, rows[0] / periods)


def _wave_of(periods: int, row: FloatArray) -> Wave:
    *powers, first, second = row.tolist()
    return Wave(periods, tuple(powers), first, second)


def check_coupling(lattice: UniformLattice, gamma: float, periods: int) -> float:
    """``n^2 gamma``, or why no orbit of n periods lives at this coupling."""
    gamma = check_gamma(gamma)
    if isinstance(periods, bool) or not isinstance(periods, int) or periods < 1:
        raise BadInput(f"periods = {periods!r}: a whole number of forcing periods, 1 or more.")
    scaled = periods * periods * gamma
    if scaled >= 0.25 and lattice.sites is None:
        raise BadInput(
            f"an orbit of {periods} forcing periods has the harmonic 1/{periods}, which lies in "
            f"the band [0, {2 * math.sqrt(gamma):.6g}] of gamma = {gamma:.6g}: the infinite chain "
            f"radiates it away. Stay below gamma = 1/{4 * periods**2}, or take a ring."
        )
    return scaled


_ORDERS = np.arange(TERMS + 1)
_QUARTERS = 0.25 ** (_ORDERS + 1.0)


def _rows(moments: FloatArray, first: Any, second: Any) -> FloatArray:
    """Rows of coefficients of `Wave` from ``<w^2l cos>`` and the whole harmonics
    ``<cos/(j^2 - w^2)>``, j = 1, 2."""
    rows = np.empty((len(moments), POWERS + 2))
    np.matmul(moments, _bernoulli().T, out=rows[:, :POWERS])
    # less what the polynomial already holds of both harmonics; -(1/pi) cos s = (1/pi) cos y, and
    # -(1/pi) cos 2s = -(1/pi) cos 2y
    rows[:, POWERS] = (first - moments.sum(axis=1)) / math.pi
    rows[:, POWERS + 1] = (second - moments @ _QUARTERS) / -math.pi
    return rows


@lru_cache(maxsize=1)
def _bernoulli() -> FloatArray:
    """``-1/pi`` times the coefficients of y^2i in ``sum over j of (-1)^j cos(jy)/j^(2l+2)``."""
    table = np.zeros((POWERS, TERMS + 1))
    for order in range(TERMS + 1):
        even = bernoulli(2 * order + 2, -math.pi)[: 2 * POWERS : 2]
        table[: even.size, order] = even
    return table


# --- a ring with modes beyond its first harmonic --------------------------------------------


@lru_cache(maxsize=256)
def _resonant(
    lattice: UniformLattice, gamma: float, distance: int, periods: int
) -> tuple[Wave, Wave]:
    """`periodic_green` and `wave_slope` of a ring whose band reaches over a harmonic."""
    theta, weight, w = lattice.nodes(gamma)
    W, amplitude = periods * w, weight * np.cos(distance * theta)  # in units of n
    off = np.abs(W - np.round(W))
    # W = 0, a mean, is no harmonic: its static push is balanced by the offsets
    clash = np.flatnonzero((off < APART) & (W > 0.5))
    if clash.size:
        raise BadInput(
            f"on {lattice} at gamma = {gamma:.9g} the mode of frequency {w[clash[0]]:.9g} is in "
            f"resonance with an orbit of {periods} forcing periods: change gamma or the ring."
        )
    low = LOW > W
    x, a = W[low] ** 2, amplitude[low]
    powers = x[:, None] ** _ORDERS
    moments, slopes = a @ powers, (a @ (powers * _ORDERS)) / gamma
    whole = [a @ (1.0 / (j * j - x)) for j in (1, 2)]
    bent = [a @ (x / (j * j - x) ** 2) / gamma for j in (1, 2)]
    rows = _rows(np.stack([moments, slopes]), *np.array([whole, bent]).T)
    value, slope = _high_modes(W[~low], amplitude[~low], gamma)
    return (
        replace(_wave_of(periods, rows[0]), modes=value),
        replace(_wave_of(periods, rows[1]), modes=slope),
    )


def _high_modes(W: FloatArray, a: FloatArray, gamma: float) -> tuple[ModeSums, ModeSums]:
    sine, cosine = np.sin(math.pi * W), np.cos(math.pi * W)  # of the whole period
    alpha = a / (2.0 * W * sine)  # g_w = cos(W y)/(2 W sin(W pi))
    # the static part 1/(w^2 T) is taken out, with T = 2 pi in units of n
    value = ModeSums(W, alpha, np.zeros_like(W), -float(np.sum(a / (2.0 * math.pi * W * W))))
    speed = W / (2.0 * gamma)  # dW/dgamma
    # d(log alpha)/dW = -1/W - pi cot(pi W), and d(cos W y)/dW = -y sin(W y) is the part beta
    alpha_slope = -alpha * (1.0 / W + math.pi * cosine / sine) * speed
    constant = float(np.sum(a / (math.pi * W**3) * speed))
    return value, ModeSums(W, alpha_slope, -alpha * speed, constant)


def is_resonant(lattice: UniformLattice, gamma: float, periods: int) -> bool:
    """Whether a harmonic of an orbit of n periods lies inside the band (rings only)."""
    return isinstance(lattice, Ring) and 4.0 * periods * periods * gamma >= 1.0


# --- many sites at once -------------------------------------------------------------------------


@lru_cache(maxsize=64)
def wave_table(
    lattice: UniformLattice,
    gamma: float,
    distances: tuple[int, ...],
    periods: int = 1,
    *,
    slope: bool = False,
) -> FloatArray | None:
    """Coefficients of `periodic_green`, or `wave_slope`, for several distances: rows to multiply
    `wave_basis` with.

    None on a ring whose modes are summed one by one.
    """
    scaled = check_coupling(lattice, gamma, periods)
    if scaled >= 0.25:
        return None
    if slope:  # of a function of n^2 gamma
        harmonic, powers, n2, quarter = lattice.dfirst_harmonic, lattice.dpowers, periods**2, 0.0625
    else:
        harmonic, powers, n2, quarter = lattice.first_harmonic, lattice.powers, 1, 0.25
    n = np.array(distances)
    # <cos/(4 - w^2)> is a quarter of <cos/(1 - w^2)> at a quarter of the coupling
    first, second = n2 * harmonic(scaled, n), n2 * quarter * harmonic(0.25 * scaled, n)
    return periods * _rows(n2 * powers(scaled, distances), first, second)


def wave_basis(s: FloatArray, periods: int = 1) -> FloatArray:
    """What every site's answer at the times s is made of, shape (POWERS + 2, times)."""
    y = math.pi - (s / periods) % (2.0 * math.pi)
    basis = np.empty((POWERS + 2, y.size))
    basis[0], basis[1:POWERS] = 1.0, y * y
    np.multiply.accumulate(basis[:POWERS], axis=0, out=basis[:POWERS])
    basis[POWERS] = np.cos(y)
    basis[POWERS + 1] = 2.0 * basis[POWERS] ** 2 - 1.0
    return basis


@lru_cache(maxsize=64)
def responses(
    lattice: UniformLattice,
    gamma: float,
    sites: tuple[int, ...],
    hits: tuple[int, ...],
    periods: int = 1,
    *,
    slope: bool = False,
) -> Responses:
    """`periodic_green` of sites to impacts at others, or `wave_slope`, as kernels take them."""
    apart = [[lattice.distance(site - hit) for hit in hits] for site in sites]
    distances, places = np.unique(apart, return_inverse=True)
    which = places.reshape(len(sites), len(hits))
    table = wave_table(lattice, gamma, tuple(distances.tolist()), periods, slope=slope)
    if table is not None:
        no_waves, largest = np.empty((len(table), 0)), bounds(table, _basis())
        modes = no_waves[0], no_waves, no_waves
        return Responses(which, falling(table), *modes, largest, float(periods), False)
    answers = [_resonant(lattice, gamma, d, periods)[slope] for d in distances.tolist()]
    rows = [[*answer.powers, answer.first, answer.second] for answer in answers]
    table = periods * np.array(rows, dtype=float)
    W, even, odd, constant = zip(*(answer.modes for answer in answers if answer.modes), strict=True)
    table[:, 0] += periods * np.array(constant)
    modes = W[0], periods * np.array(even), periods * np.array(odd)
    largest = np.full(len(table), math.inf)
    return Responses(which, falling(table), *modes, largest, float(periods), False)


def falling(table: FloatArray) -> FloatArray:
    """With the coefficient of the highest power first."""
    other = table.copy()
    other[:, :-2] = table[:, -3::-1]
    return other


def bounds(table: FloatArray, basis: FloatArray) -> FloatArray:
    """No less than the largest value of each response: harmonics beyond the second are too small
    for a maximum to hide between the places of a basis."""
    return np.asarray(1.01 * abs(table @ basis).max(axis=1))


@lru_cache(maxsize=1)
def _basis() -> FloatArray:
    return wave_basis(np.linspace(0.0, math.pi, 65))
