"""Response of the linear lattice between impacts: its band, and means over its modes.

Every mean we need is a function of ``w^2`` with simple poles at whole numbers, for example
``tan(pi w/2)/w = (4/pi) sum over odd s of 1/(s^2 - w^2)``. The pole next to the band is kept
exact (it alone diverges as gamma -> 1/4), the others are expanded in powers of ``w^2``: their
sums are zeta functions, and the terms fall like ``9^-j``. So a mean costs one square root and
one short polynomial, is at machine precision for every gamma in [0, 1/4), and needs no limit
at w -> 0. A lattice enters only through the mean of ``z q/(1 - z q)``, ``q = sin^2(theta/2)``,
and the moments of ``q``.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from contbreather.checks import brief, real
from contbreather.errors import BadInput
from contbreather.kernels import Vector, inlined
from contbreather.parameters import NUMBERS

FloatArray = NDArray[np.float64]

TERMS = 18  # powers of w^2 that expansions keep: 9^-18 < 1e-17, the rest is below rounding
FIRST = 12  # terms that are added up as they are
# B_2k/(2k)! of the formula of Euler and Maclaurin for all others: 12^-20 is far below rounding
REST = (
    1 / 12,
    -1 / 720,
    1 / 30240,
    -1 / 1209600,
    1 / 47900160,
    -691 / 1307674368000,
    1 / 74724249600,
    -3617 / 10670622842880000,
)


def check_gamma(gamma: float, spring: float = 0.0) -> float:
    """Return ``gamma`` as a float, or say why no breather can live at this coupling.

    Raises
    ------
    BadInput
        If the band ``[spring, spring + 4 gamma]`` of w^2 reaches the forcing frequency 1.
    """
    coupling, stiffness = real(gamma), real(spring)
    if coupling >= 0.0 and stiffness >= 0.0 and 4.0 * coupling < 1.0 - stiffness:
        return coupling
    if not stiffness:
        raise BadInput(f"gamma = {brief(gamma)}: {NUMBERS['gamma'].wanted}")
    raise BadInput(
        f"gamma = {gamma!r}, spring = {spring!r}: the band [spring, spring + 4 gamma] of w^2 must "
        "stay below 1, the harmonic of the drive that the infinite chain would radiate; choose "
        "0 <= gamma < (1 - spring)/4, or take a ring."
    )


class _Raw(NamedTuple):
    """A function of ``w^2``: its poles as ``weight w^2/(P - w^2)``, and the coefficients of 1, w^2,
    w^4, ... of all the rest."""

    poles: dict[float, float]  # weight by P
    powers: FloatArray


@lru_cache(maxsize=1)
def _functions() -> dict[str, _Raw]:
    j = np.arange(1, TERMS + 1)
    odd = 4.0**-j * zeta(2 * j, 1.5)  # sum over 3, 5, 7... of s^-2j
    odd2 = 0.25 * 4.0**-j * zeta(2 * j + 2, 1.5)  # the same of s^-(2j+2)
    even = 4.0**-j * zeta(2 * j, 2.0)  # sum over 4, 6, 8... of s^-2j
    even2 = 0.25 * 4.0**-j * zeta(2 * j + 2, 2.0)
    f = 4.0 / math.pi
    return {
        "chi": _Raw({1.0: f}, np.append(math.pi / 2, f * odd2)),
        "eta": _Raw({1.0: f}, np.append(0.0, f * odd)),
        "sigma": _Raw({1.0: f / 2, 4.0: -f / 2}, np.append(1 / math.pi, f / 2 * (odd - even))),
        "psi": _Raw({4.0: -f}, np.append(2 / math.pi, -f * even)),
        # without its pole at w = 0
        "tau": _Raw({4.0: -f / 4}, np.append(-math.pi / 6, -f * even2)),
    }


class BandAverage(NamedTuple):
    """A mean as ``sum of weight * excess(x/width) + polynomial(x)``, x = 4 gamma: a quotient of
    floats is below 1 wherever x is below the width that it has up to its pole."""

    weights: Vector  # of the poles
    widths: Vector
    powers: Vector  # coefficients of the polynomial, the highest first
    sites: int  # of the ring, 0 for the infinite chain


@inlined
def polynomial(coefficients: Any, x: Any) -> tuple[Any, Any]:
    """By its coefficients, that of the highest power first, and its derivative."""
    value = slope = 0.0
    for c in coefficients:
        slope = slope * x + value
        value = value * x + c
    return value, slope


@inlined
def average(series: BandAverage, x: float) -> float:
    """Evaluate a mean."""
    total = 0.0
    for c in series.powers:
        total = total * x + c
    for i in range(len(series.weights)):
        # the pole next to the band, exact
        total += series.weights[i] * excess(x / series.widths[i], series.sites)
    return total


@inlined
def average_slope(series: BandAverage, x: float) -> float:
    """Evaluate the derivative of a mean in gamma."""
    _, total = polynomial(series.powers, x)
    for i in range(len(series.weights)):
        width = series.widths[i]
        total += series.weights[i] / width * excess_slope(x / width, series.sites)
    return 4.0 * total


def excess(z: float, sites: int) -> float:
    """Mean of ``z q/(1 - z q)`` over the modes of a ring or, of 0 sites, of the infinite chain."""
    r = math.sqrt(1.0 - z)
    if sites == 0:
        return z / (r * (1.0 + r))  # 1/r - 1 without cancellation
    odd = sites % 2
    if z > 0.5:  # T/r with T = tanh or coth stays exact where 1/r and the correction cancel
        t = math.tanh(sites * math.atanh(r))
        return (t if odd else 1.0 / t) / r - 1.0
    lap = math.pow(z / ((1.0 + r) * (1.0 + r)), float(sites))
    if odd:
        lap = -lap
    return (z / (1.0 + r) + 2.0 * lap / (1.0 - lap)) / r


def excess_slope(z: float, sites: int) -> float:
    """Derivative of `excess`."""
    rr = 1.0 - z
    r = math.sqrt(rr)
    if sites == 0:
        return 0.5 / (rr * r)
    if sites % 2 and sites * r < 1.0:  # cancels to order r^2 below; so few modes, sum them
        total = 0.0
        for j in range(sites // 2 + 1):
            q, c = quarter_wave(j, sites)
            total += (2.0 if j else 1.0) / sites * q / ((rr + z * c) * (rr + z * c))
        return total
    rho, sign, gap = laps(z, r, sites)
    t = (2.0 - gap) / gap  # (1 + e)/(1 - e), e = sign rho^N: 1/r becomes t/r on a ring
    room = (1.0 + r) * gap
    slope = sign * 4.0 * sites * math.pow(rho, sites - 1.0) / (room * room)
    return (t + r * slope) / (2.0 * rr * r)


def quarter_wave(j: int, sites: int) -> tuple[float, float]:
    """``sin^2 theta/2`` and ``cos^2 theta/2`` of mode j of a ring, neither as a difference."""
    turn = 0.5 * math.pi / sites
    s, c = math.sin(2 * j * turn), math.sin((sites - 2 * j) * turn)
    return s * s, c * c


def laps(z: float, r: float, sites: int) -> tuple[float, float, float]:
    """Factor rho of (A3) from site to site, the sign of a lap, and 1 - sign * rho^N."""
    rho = z / ((1.0 + r) * (1.0 + r))  # |xi| of (A3)
    if sites % 2:
        return rho, -1.0, 1.0 + math.pow(rho, float(sites))
    # near the band's edge rho -> 1: the difference must not be formed
    return rho, 1.0, -math.expm1(-2.0 * sites * math.atanh(r)) if r < 1.0 else 1.0


@lru_cache(maxsize=256)
def band_averages(sites: int | None, spring: float = 0.0) -> dict[str, BandAverage]:
    """Expansions of the means; ``sites=None`` is the infinite chain."""
    return {name: _series(name, sites, spring) for name in _functions()}


def _series(name: str, sites: int | None, spring: float) -> BandAverage:
    of = held_mean(name, sites)
    parts = np.empty(of.poles.size), np.empty(of.poles.size), np.empty(of.powers.size)
    hold(of, BandAverage(*parts, 0), spring)
    # lists of numbers: Python takes one from them sooner than from an array
    rows: Any = *(part.tolist() for part in parts), sites or 0
    return BandAverage(*rows)


class HeldMean(NamedTuple):
    """A mean as a function of the springs that hold the lattice."""

    weights: Vector  # of the poles without springs
    poles: Vector
    powers: Vector  # of w^2, that of the lowest first
    shifted: Vector  # the same of w^2 - spring
    moments: Vector  # <q^j> of the band


def held_mean(name: str, sites: int | None = None) -> HeldMean:
    poles, powers = _functions()[name]
    weights, places = np.array([*poles.values()]), np.array([*poles])
    return HeldMean(weights, places, powers, powers.copy(), q_moments(sites, 0))


@inlined
def hold(of: HeldMean, mean: BandAverage, s: float) -> None:
    """Put springs under the lattice: ``w^2 = s + x``."""
    last = of.powers.size - 1
    for n in range(last + 1):
        of.shifted[n] = of.powers[n]
    for n in range(last):  # a polynomial around s, by Horner's scheme
        for j in range(last - 1, n - 1, -1):
            of.shifted[j] += s * of.shifted[j + 1]
    for n in range(last + 1):
        mean.powers[last - n] = of.shifted[n] * of.moments[n]
    # w^2/(P - w^2) = s/(P - s) + P/(P - s) z/(1 - z), z = x/(P - s)
    for i in range(of.poles.size):
        P, weight = of.poles[i], of.weights[i]
        mean.weights[i], mean.widths[i] = weight * P / (P - s), P - s
        mean.powers[last] += weight * s / (P - s)


@inlined
def slope_in_spring(of: HeldMean, s: float, x: float, sites: int) -> float:
    """Evaluate the derivative of a mean in the spring that it is held by."""
    total = 0.0
    for n in range(of.powers.size - 1, 0, -1):
        total = total * x + n * of.shifted[n] * of.moments[n - 1]
    for i in range(of.poles.size):
        room = of.poles[i] - s
        z = x / room
        grown = 1.0 + excess(z, sites) + z * excess_slope(z, sites)
        total += of.weights[i] * of.poles[i] / (room * room) * grown
    return total


def means_of_chains(gamma: FloatArray, spring: Any) -> dict[str, FloatArray]:
    """Means of infinite chains of many couplings, and perhaps as many springs."""
    x, s = 4.0 * gamma[:, None], np.reshape(spring, (-1, 1))
    functions, poles = _functions(), np.array([1.0, 4.0])
    powers = q_moments(None, 0) * x ** np.arange(TERMS + 1)
    if np.any(spring):  # <w^2j>, w^2 = s + x q
        powers = (in_powers_of_x(spring) @ powers[..., None])[..., 0]
    weights = [[raw.poles.get(P, 0.0) for raw in functions.values()] for P in poles.tolist()]
    z = x / (poles - s)
    r = np.sqrt(1.0 - z)
    # see `hold`, and `excess`
    near = (s + poles * z / (r * (1.0 + r))) / (poles - s)
    means = powers @ np.transpose([raw.powers for raw in functions.values()]) + near @ weights
    return dict(zip(functions, means.T, strict=True))


_POWERS = range(TERMS + 1)
_BINOMIALS = np.array([[math.comb(j, n) for n in _POWERS] for j in _POWERS], float)
_APART = np.maximum(np.subtract.outer(_POWERS, _POWERS), 0)


def in_powers_of_x(spring: Any, size: int = TERMS + 1) -> FloatArray:
    """``(spring + x)^j`` in powers of x: row j, shape (..., size, size)."""
    powers = np.asarray(spring, dtype=float)[..., None] ** np.arange(size)
    return np.asarray(_BINOMIALS[:size, :size] * powers[..., _APART[:size, :size]])


@lru_cache(maxsize=64)
def moments_of(lattice: Any, sites: tuple[int, ...]) -> FloatArray:
    """Its moments of several sites, in rows; those farther off than there are moments have none."""
    apart = lattice.distance(np.array(sites, dtype=int))
    rows = np.zeros((apart.size, TERMS + 1))
    for i in np.flatnonzero(apart <= TERMS).tolist():
        rows[i] = lattice.moments(sites[i])
    return rows


@lru_cache(maxsize=1024)
def q_moments(sites: int | None, n: int) -> FloatArray:
    """``<q^j cos(n theta)>`` for j = 0..TERMS with ``q = sin^2(theta/2)``; read-only.

    ``(2 - 2 cos theta)^j`` has the Fourier coefficients ``(-1)^n binomial(2j, j + n)``; on a
    ring the ones N apart fall together.
    """
    values, apart = np.empty(TERMS + 1), sites or 2**60
    for j in range(TERMS + 1):
        orders = range(-j + (n + j) % apart, j + 1, apart)
        total = sum((-1) ** (m % 2) * math.comb(2 * j, j + m) for m in orders)
        values[j] = total / 4**j  # whole numbers up to the last division
    values.setflags(write=False)
    return values


class UniformLattice:
    """The seam: a lattice answers for its modes and knows nothing of impacts.

    Means are over the modes w(theta) = 2 sqrt(gamma) |sin(theta/2)| of a chain driven at site 0.
    Every method refuses a gamma outside [0, 1/4) with `BadInput`.
    """

    sites: Any
    spring: float
    _expansions: dict[str, BandAverage]

    if TYPE_CHECKING:

        def __hash__(self) -> int: ...
        def distance(self, n: Any) -> Any: ...
        def nodes(self, gamma: float) -> tuple[FloatArray, ...]: ...

    def mean(self, gamma: float, name: str) -> float:
        """`chi`, `eta`, `sigma` or `psi` at one coupling."""
        x = 4.0 * check_gamma(gamma, self.spring)
        return average(self._expansions[name], x)

    def slope(self, gamma: float, name: str) -> float:
        """Derivative of `mean` with respect to gamma."""
        x = 4.0 * check_gamma(gamma, self.spring)
        return average_slope(self._expansions[name], x)

    def expansion(self, name: str, gamma: float | None = None) -> BandAverage:
        """A mean as kernels take it; the same at every coupling where one is given."""
        if gamma is not None:
            none = np.empty(0)
            return BandAverage(none, none, np.array([self.mean(gamma, name)]), 0)
        weights, widths, powers, sites = self._expansions[name]
        return BandAverage(np.array(weights), np.array(widths), np.array(powers), sites)

    def moments(self, n: int | tuple[int, ...]) -> FloatArray:
        """``<q^j cos(n theta)>``, j = 0, 1, ..., with ``q = sin^2(theta/2)``; of several sites in
        rows."""
        if isinstance(n, tuple):
            return moments_of(self, n)
        return q_moments(self.sites, self.distance(int(n)))

    def powers(self, gamma: float, n: int | tuple[int, ...], by: str = "") -> FloatArray:
        """``<w^2j cos(n theta)>`` for j = 0, 1, ..., of several sites in rows; or the derivative in
        gamma or the spring."""
        j, x = np.arange(TERMS + 1), 4.0 * gamma
        powers = self.moments(n) * (4.0 * j * x ** np.maximum(j - 1, 0) if by == "gamma" else x**j)
        if self.spring:
            powers = powers @ in_powers_of_x(self.spring).T
        # d/ds of (s + x)^j = j (s + x)^(j - 1)
        return np.asarray(j * np.roll(powers, 1, axis=-1)) if by == "spring" else powers

    def first_harmonic(self, gamma: float, n: ArrayLike, by: str = "") -> FloatArray:
        """``<cos(n theta)/(1 - w^2)>``: the answer of site n to the frequency of the forcing, on a
        ring from both sides and after all laps; or the derivative in gamma or the spring."""
        if by == "spring":  # it is homogeneous in gamma and 1 - spring, of degree -1
            by_gamma = gamma * self.first_harmonic(gamma, n, "gamma")
            return (self.first_harmonic(gamma, n) + by_gamma) / (1.0 - self.spring)
        m, size, rest = self.distance(np.asarray(n)), self.sites, 1.0 - self.spring
        z = 4.0 * check_gamma(gamma, self.spring) / rest
        r = math.sqrt(1.0 - z)
        rho, sign, lap = laps(z, r, size) if size else (z / (1.0 + r) ** 2, 0.0, 1.0)
        profile = rho**m
        if size:
            profile = profile + sign * rho ** (size - m)
        if not by:
            return np.asarray((-1.0) ** m * profile / (r * lap * rest))
        turn = m * rho ** abs(m - 1)  # 0 for m = 0
        if size:
            turn += sign * (size - m) * rho ** (size - m - 1)
            turn += profile * sign * size * rho ** (size - 1) / lap
        slope = turn / (r * (1.0 + r)) ** 2 + profile / (2.0 * r**3)
        return np.asarray(4.0 * (-1.0) ** m * slope / (lap * rest**2))

    def chi(self, gamma: float) -> float:
        """``<tan(pi w/2)/w>``, eq. (10): displacement of site 0 at the impact per unit p."""
        return self.mean(gamma, "chi")

    def eta(self, gamma: float) -> float:
        """``<w tan(pi w/2)>``: the restoring acceleration at the impact per unit p."""
        return self.mean(gamma, "eta")

    def sigma(self, gamma: float) -> float:
        """``<w/sin(pi w)>``: the harmonic pitchfork is at ``a = p sqrt(q^2 + 4 sigma^2)``."""
        return self.mean(gamma, "sigma")

    def psi(self, gamma: float) -> float:
        """``<w cot(pi w/2)>``: the pitchfork of any forcing is at ``b = (1+k)^2 psi/2``."""
        return self.mean(gamma, "psi")

    def by_spring(self, gamma: float, name: str) -> float:
        """Derivative of `mean` with respect to the spring."""
        x, s = 4.0 * check_gamma(gamma, self.spring), self.spring  # w^2 in [s, s + x]
        of = held_mean(name, self.sites)
        np.matmul(of.powers, in_powers_of_x(s), out=of.shifted)
        return slope_in_spring(of, s, x, self.sites or 0)


# --- sums over the odd, the even, all the later numbers to a power: Hurwitz's zeta function -------

# Every expansion here ends in such sums. `scipy.special` has them, too, but takes longer to be
# imported than a breather takes to be found, stability included.


def zeta(s: ArrayLike, first: float = 1.0) -> Any:
    """``sum over n >= 0 of (first + n)^-s`` for s > 1 and ``first >= 1/2``, to rounding."""
    s = np.asarray(s, dtype=float)
    end = first + FIRST
    total = end**-s * (0.5 + end / (s - 1.0))
    factor = s * end ** (-s - 1.0)
    for k, weight in enumerate(REST):
        total += weight * factor
        factor = factor * (s + 2 * k + 1) * (s + 2 * k + 2) / end**2
    for n in range(FIRST - 1, -1, -1):  # the smallest first
        total += (first + n) ** -s
    return total[()]


def binomial(n: ArrayLike, m: ArrayLike) -> NDArray[np.float64]:
    """``n!/(m! (n - m)!)`` of whole numbers; 0 where n is negative."""
    whole = np.vectorize(lambda n, m: math.comb(n, m) if n >= 0 else 0, otypes=[float])
    return np.asarray(whole(n, m))


def bernoulli(p: int, over: float = 1.0) -> NDArray[np.float64]:
    """The sum over j >= 1 of cos(js)/j^p, p even, or sin(js)/j^p, p odd, is a polynomial of
    Bernoulli's: its coefficients by powers of ``y = pi - s``, over a number."""
    odd, coefficients = p % 2, np.zeros(p + 1)
    for power in range(odd, p + 1, 2):
        r = p - power  # sum over j of (-1)^(j-1)/j^r
        alternating = 0.5 if r == 0 else (1.0 - 2.0 ** (1 - r)) * zeta(r)
        sign = (-1) ** ((power + odd) // 2)
        coefficients[power] = -sign * alternating / (over * math.factorial(power))
    return coefficients
