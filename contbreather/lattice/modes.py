"""What the linear lattice answers between impacts: its band, and means over its modes.

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
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from contbreather.checks import MOST, number, real
from contbreather.errors import BadInput
from contbreather.lattice.finite import Waves, waves
from contbreather.lattice.green import TERMS, flight
from contbreather.lattice.zeta import binomial, zeta

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


def check_gamma(gamma: float, spring: float = 0.0) -> float:
    """Return ``gamma`` as a float, or say why no breather can live at this coupling.

    Raises
    ------
    BadInput
        If the band ``[spring, spring + 4 gamma]`` of w^2 reaches the forcing frequency 1.
    """
    found = real(gamma)
    if found >= 0.0 and spring + 4.0 * found < 1.0:
        return found
    if not spring:
        raise BadInput(
            f"gamma = {gamma!r}: the coupling must be a number with 0 <= gamma < 1/4, so that the "
            "band [0, 2 sqrt(gamma)] stays below the forcing frequency 1; choose gamma in that "
            "range."
        )
    raise BadInput(
        f"gamma = {gamma!r}, spring = {spring!r}: the band [spring, spring + 4 gamma] of w^2 must "
        "stay below 1, the harmonic of the drive that the infinite chain would radiate; choose "
        "0 <= gamma < (1 - spring)/4, or take a ring."
    )


class _Raw(NamedTuple):
    """A function of ``w^2``: its value at 0, its poles as ``weight w^2/(P - w^2)``, and the
    coefficients of w^2, w^4, ... of all the rest."""

    constant: float
    poles: tuple[tuple[float, float], ...]  # (weight, P)
    tail: FloatArray


@lru_cache(maxsize=1)
def _functions() -> dict[str, _Raw]:
    j = np.arange(1, TERMS + 1)
    odd = 4.0**-j * zeta(2 * j, 1.5)  # sum over 3, 5, 7... of s^-2j
    odd2 = 0.25 * 4.0**-j * zeta(2 * j + 2, 1.5)  # the same of s^-(2j+2)
    even = 4.0**-j * zeta(2 * j, 2.0)  # sum over 4, 6, 8... of s^-2j
    even2 = 0.25 * 4.0**-j * zeta(2 * j + 2, 2.0)
    f = 4.0 / math.pi
    return {
        "chi": _Raw(math.pi / 2, ((f, 1.0),), f * odd2),
        "eta": _Raw(0.0, ((f, 1.0),), f * odd),
        "sigma": _Raw(1 / math.pi, ((f / 2, 1.0), (-f / 2, 4.0)), f / 2 * (odd - even)),
        "psi": _Raw(2 / math.pi, ((-f, 4.0),), -f * even),
        "tau": _Raw(-math.pi / 6, ((-f / 4, 4.0),), -f * even2),  # without its pole at w = 0
    }


class _Series(NamedTuple):
    """A mean as ``constant + sum of weight * excess(scale x) + polynomial(x)``, x = 4 gamma."""

    constant: float
    poles: tuple[tuple[float, float], ...]  # (weight, scale)
    powers: tuple[float, ...]  # coefficients of x^1, x^2, ...
    slopes: tuple[float, ...]  # those of the derivative: 1*c1, 2*c2, ...


@lru_cache(maxsize=256)
def _means(sites: int | None, spring: float = 0.0) -> dict[str, _Series]:
    """Expansions of the means; ``sites=None`` is the infinite chain."""
    return {name: _series(raw, sites, spring) for name, raw in _functions().items()}


def _series(raw: _Raw, sites: int | None, spring: float) -> _Series:
    tail = np.concatenate([[raw.constant], raw.tail]) @ _shift(spring)
    powers = tail[1:] * q_moments(sites, 0)[1:]
    slopes = powers * np.arange(1, TERMS + 1)
    held = [(weight * P / (P - spring), 1.0 / (P - spring)) for weight, P in raw.poles]
    constant = float(tail[0]) + sum(weight * spring / (P - spring) for weight, P in raw.poles)
    # reversed once here, so that Horner runs straight through the tuple
    return _Series(
        constant, tuple(held), tuple(powers[::-1].tolist()), tuple(slopes[::-1].tolist())
    )


@lru_cache(maxsize=256)
def _shift(spring: float) -> FloatArray:
    """``(spring + x)^j`` in powers of x: row j, shape (TERMS + 1, TERMS + 1)."""
    j = np.arange(TERMS + 1)
    apart = np.maximum(j[:, None] - j, 0)
    rows = binomial(j[:, None], j) * spring**apart
    return np.asarray(np.tril(rows))


@lru_cache(maxsize=1024)
def q_moments(sites: int | None, n: int) -> FloatArray:
    """``<q^j cos(n theta)>`` for j = 0..TERMS with ``q = sin^2(theta/2)``; read-only.

    ``(2 - 2 cos theta)^j`` has the Fourier coefficients ``(-1)^n binomial(2j, j + n)``; on a
    ring the ones N apart fall together.
    """
    values = np.empty(TERMS + 1)
    for j in range(TERMS + 1):
        if sites is None:
            orders = range(n, n + 1) if abs(n) <= j else range(0)
        else:
            orders = range(-j + (n + j) % sites, j + 1, sites)
        total = sum((-1) ** (m % 2) * math.comb(2 * j, j + m) for m in orders)
        values[j] = total / 4**j  # whole numbers up to the last division
    values.setflags(write=False)
    return values


class Lattice(Protocol):
    """The seam: a lattice answers for its modes and knows nothing of impacts.

    Means are over the modes w(theta) = 2 sqrt(gamma) |sin(theta/2)| of a chain driven at site 0.
    Every method refuses a gamma outside [0, 1/4) with `BadInput`.
    """

    def __hash__(self) -> int: ...
    def chi(self, gamma: float) -> float: ...
    def eta(self, gamma: float) -> float: ...
    def sigma(self, gamma: float) -> float: ...
    def psi(self, gamma: float) -> float: ...
    def dchi(self, gamma: float) -> float: ...
    def deta(self, gamma: float) -> float: ...
    def dsigma(self, gamma: float) -> float: ...
    def dpsi(self, gamma: float) -> float: ...
    def resolvent(self, gamma: float, s: ArrayLike) -> ComplexArray: ...
    def nodes(self, gamma: float, reach: int = 0) -> tuple[FloatArray, FloatArray, FloatArray]: ...
    @property
    def sites(self) -> int | None: ...
    @property
    def spring(self) -> float: ...
    def check(self, gamma: float) -> float: ...
    def by_spring(self, gamma: float, name: str) -> float: ...
    def expansion(self, name: str) -> list[float]: ...
    def distance(self, n: int) -> int: ...
    def first_harmonic(self, gamma: float, n: ArrayLike) -> FloatArray: ...
    def dfirst_harmonic(self, gamma: float, n: ArrayLike) -> FloatArray: ...
    def moments(self, n: int) -> FloatArray: ...
    def powers(self, gamma: float, n: int) -> FloatArray: ...
    def dpowers(self, gamma: float, n: int) -> FloatArray: ...
    def response(self, gamma: float, n: int, s: ArrayLike) -> tuple[FloatArray, ...]: ...


class _TranslationInvariant:
    """The four means, for any lattice that can give `_excess` and its slope."""

    sites: Any
    spring: float
    _expansions: dict[str, _Series]
    _limit: float  # of gamma

    if TYPE_CHECKING:

        def first_harmonic(self, gamma: float, n: ArrayLike) -> FloatArray: ...
        def moments(self, n: int) -> FloatArray: ...

    def _excess(self, z: float) -> float:
        raise NotImplementedError

    def _dexcess(self, z: float) -> float:
        raise NotImplementedError

    def check(self, gamma: float) -> float:
        """gamma as a float, or why there is no breather at this coupling."""
        return check_gamma(gamma, self.spring)

    def _mean(self, gamma: float, name: str) -> float:
        series = self._expansions[name]
        x = 4.0 * (gamma if 0.0 <= gamma < self._limit else self.check(gamma))
        total = 0.0
        for c in series.powers:
            total = total * x + c
        total = total * x + series.constant
        for weight, scale in series.poles:
            total += weight * self._excess(scale * x)
        return total

    def means(self, gamma: FloatArray, name: str) -> FloatArray:
        """`chi`, `eta`, `sigma` or `psi` of the infinite chain at many couplings inside of its
        domain."""
        series, x = self._expansions[name], 4.0 * gamma
        total = np.polyval([*series.powers, series.constant], x)
        for weight, scale in series.poles:
            total += weight * (1.0 / np.sqrt(1.0 - scale * x) - 1.0)
        return np.asarray(total)

    def _slope(self, gamma: float, name: str) -> float:
        series = self._expansions[name]
        x = 4.0 * (gamma if 0.0 <= gamma < self._limit else self.check(gamma))
        total = 0.0
        for c in series.slopes:
            total = total * x + c
        for weight, scale in series.poles:
            total += weight * scale * self._dexcess(scale * x)
        return 4.0 * total

    def expansion(self, name: str) -> list[float]:
        """A mean as numbers: constant, how many poles and powers, weight and scale of each pole,
        coefficients of the powers of 4 gamma from the highest on and those of the slope."""
        series = self._expansions[name]
        poles = [entry for pole in series.poles for entry in pole]
        counts = [series.constant, len(series.poles), len(series.powers)]
        return [*counts, *poles, *series.powers, *series.slopes]

    def powers(self, gamma: float, n: int) -> FloatArray:
        """``<w^2j cos(n theta)>`` for j = 0, 1, ..."""
        own = self.moments(n) * (4.0 * gamma) ** np.arange(TERMS + 1)
        return _shift(self.spring) @ own if self.spring else own

    def dpowers(self, gamma: float, n: int) -> FloatArray:
        """Derivative of `powers` with respect to gamma."""
        j = np.arange(TERMS + 1)
        own = self.moments(n) * 4.0 * j * (4.0 * gamma) ** np.maximum(j - 1, 0)
        return _shift(self.spring) @ own if self.spring else own

    def spring_powers(self, gamma: float, n: int) -> FloatArray:
        """Derivative of `powers` with respect to the spring."""
        own = np.arange(TERMS + 1) * np.roll(self.powers(gamma, n), 1)
        return np.asarray(own)

    def response(self, gamma: float, n: int, s: ArrayLike) -> tuple[FloatArray, ...]:
        """Site n between two impacts of site 0, per unit p: its v, v' and v''.

        ``v_n(s) = <cos(n theta) sin(w (pi/2 - s))/(w cos(pi w/2))>``, s = t - phi in [0, pi];
        eq. (9) without its series, good to rounding up to and at the impacts.

        Parameters
        ----------
        gamma : float
            Coupling in [0, 1/4).
        n : int
            Site, counted from the one that impacts.
        s : array_like
            Times since the impact, in [0, pi].

        Returns
        -------
        tuple of three ndarrays, the shape of ``s``
        """
        answer = flight(float(self.first_harmonic(gamma, n)), self.powers(gamma, n))
        y = np.asarray(s, dtype=float) - 0.5 * math.pi
        return answer.value(y), answer.slope(y), answer.curvature(y)

    def chi(self, gamma: float) -> float:
        """``<tan(pi w/2)/w>``, eq. (10): displacement of site 0 at the impact per unit p."""
        return self._mean(gamma, "chi")

    def eta(self, gamma: float) -> float:
        """``<w tan(pi w/2)>``: the restoring acceleration at the impact per unit p."""
        return self._mean(gamma, "eta")

    def sigma(self, gamma: float) -> float:
        """``<w/sin(pi w)>``: the harmonic pitchfork is at ``a = p sqrt(q^2 + 4 sigma^2)``."""
        return self._mean(gamma, "sigma")

    def psi(self, gamma: float) -> float:
        """``<w cot(pi w/2)>``: the pitchfork of any forcing is at ``b = (1+k)^2 psi/2``."""
        return self._mean(gamma, "psi")

    def dchi(self, gamma: float) -> float:
        """Derivative of `chi` with respect to gamma."""
        return self._slope(gamma, "chi")

    def deta(self, gamma: float) -> float:
        """Derivative of `eta` with respect to gamma."""
        return self._slope(gamma, "eta")

    def dsigma(self, gamma: float) -> float:
        """Derivative of `sigma` with respect to gamma."""
        return self._slope(gamma, "sigma")

    def dpsi(self, gamma: float) -> float:
        """Derivative of `psi` with respect to gamma."""
        return self._slope(gamma, "psi")

    def by_spring(self, gamma: float, name: str) -> float:
        """Derivative of `chi`, `eta`, `sigma` or `psi` with respect to the spring."""
        raw, s, x = _functions()[name], self.spring, 4.0 * self.check(gamma)
        total = float((np.arange(1, TERMS + 1) * raw.tail) @ self.powers(gamma, 0)[:-1])
        for weight, P in raw.poles:
            z = x / (P - s)
            more = 1.0 + self._excess(z) + z * self._dexcess(z)
            total += weight * P / (P - s) ** 2 * more
        return total


@dataclass(frozen=True)
class InfiniteChain(_TranslationInvariant):
    """The infinite chain with nearest-neighbour coupling, eq. (1).

    Examples
    --------
    >>> round(InfiniteChain().chi(0.12), 13)
    2.0678739703938
    """

    spring: float = 0.0  # to the ground, at every site

    def __post_init__(self) -> None:
        spring = number("spring", self.spring, 0.0, 1.0, "0 <= spring < 1")
        check_gamma(0.0, spring)
        object.__setattr__(self, "_expansions", _means(None, spring))
        object.__setattr__(self, "_limit", 0.25 * (1.0 - spring))

    @property
    def sites(self) -> None:
        """No end: there is a far field."""
        return

    def held(self, spring: float) -> InfiniteChain:
        """The same chain with springs to the ground."""
        return self if spring == self.spring else _held(spring)

    def __repr__(self) -> str:
        return f"InfiniteChain({self.spring or ''})"

    def describe(self) -> str:
        return "infinite chain"

    def tau(self, gamma: float) -> float:
        """``<cot(pi w/2)/w>``: what a mean push does; infinite where no spring holds the chain."""
        s = self.spring
        loose = 2.0 / math.pi / math.sqrt(s * (s + 4.0 * gamma)) if s else math.inf
        return loose + self._mean(gamma, "tau")

    def dtau(self, gamma: float) -> float:
        """Derivative of `tau` with respect to gamma, for a spring above 0."""
        s, edge = self.spring, self.spring + 4.0 * gamma
        return self._slope(gamma, "tau") - 4.0 / (math.pi * edge * math.sqrt(s * edge))

    def tau_by_spring(self, gamma: float) -> float:
        """Derivative of `tau` with respect to the spring, above 0."""
        s, edge = self.spring, self.spring + 4.0 * gamma
        loose = (s + edge) / (math.pi * (s * edge) ** 1.5)
        return self.by_spring(gamma, "tau") - loose

    def _excess(self, z: float) -> float:
        r = math.sqrt(1.0 - z)
        return z / (r * (1.0 + r))

    def _dexcess(self, z: float) -> float:
        rr = 1.0 - z
        return 0.5 / (rr * math.sqrt(rr))

    def distance(self, n: int) -> int:
        """How many bonds from site n to the impacting site 0."""
        return abs(int(n))

    def beside(self, n: int) -> tuple[int, ...]:
        """The sites coupled to site n."""
        return (n - 1, n + 1)

    def first_harmonic(self, gamma: float, n: ArrayLike) -> FloatArray:
        """``<cos(n theta)/(1 - w^2)>``: the answer of site n to the frequency of the forcing."""
        rest = 1.0 - self.spring
        x = 4.0 * self.check(gamma) / rest
        r = math.sqrt(1.0 - x)
        xi = -x / (1.0 + r) ** 2  # (A3): from one site to the next
        return np.asarray(xi ** np.abs(np.asarray(n)) / (r * rest))

    def dfirst_harmonic(self, gamma: float, n: ArrayLike) -> FloatArray:
        """Derivative of `first_harmonic` with respect to gamma."""
        rest = 1.0 - self.spring
        x = 4.0 * self.check(gamma) / rest
        m = np.abs(np.asarray(n))
        r = math.sqrt(1.0 - x)
        rho = x / (1.0 + r) ** 2
        ahead = np.where(m > 0, m * rho ** np.maximum(m - 1, 0), 0.0)
        slope = ahead / (r * (1.0 + r)) ** 2 + rho**m / (2.0 * r**3)
        return np.asarray(4.0 * (-1.0) ** m * slope / rest**2)

    def first_by_spring(self, gamma: float, n: ArrayLike) -> FloatArray:
        """Derivative of `first_harmonic` with respect to the spring: it is homogeneous in
        gamma and ``1 - spring``, of degree -1."""
        by_gamma = gamma * self.dfirst_harmonic(gamma, n)
        return (self.first_harmonic(gamma, n) + by_gamma) / (1.0 - self.spring)

    def moments(self, n: int) -> FloatArray:
        """``<q^j cos(n theta)>`` for j = 0, 1, ..., with ``q = sin^2(theta/2)``."""
        return q_moments(None, abs(int(n)))

    def resolvent(self, gamma: float, s: ArrayLike) -> ComplexArray:
        """``<1/(w^2 - s^2)> = -1/sqrt(s^2 (s^2 - 4 gamma))``, the branch with -1/s^2 far away.

        Parameters
        ----------
        gamma : float
            Coupling in [0, 1/4).
        s : array_like of complex
            Anywhere off the band: Im s != 0 or |s| > 2 sqrt(gamma).

        Returns
        -------
        ndarray of complex, the shape of ``s``.

        Raises
        ------
        BadInput
            Where s is real and in the band, the mean does not exist there.

        Examples
        --------
        >>> complex(InfiniteChain().resolvent(0.0, 2.0)).real
        -0.25
        """
        gamma = self.check(gamma)
        s2 = np.square(np.asarray(s, dtype=complex)) - self.spring
        if np.any((s2.imag == 0.0) & (s2.real <= 4.0 * gamma) & (s2.real >= 0.0)):
            low, high = math.sqrt(self.spring), math.sqrt(self.spring + 4.0 * gamma)
            raise BadInput(
                f"the mean <1/(w^2 - s^2)> does not exist for real s in the band "
                f"[{low:.6g}, {high:.6g}] of gamma = {gamma}; move s off the real axis."
            )
        # 1 - 4 gamma/s^2 is negative only on the band, so the principal root is the right one
        return np.asarray(-1.0 / (s2 * np.sqrt(1.0 - 4.0 * gamma / s2)))

    def nodes(self, gamma: float, reach: int = 0) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Nodes, weights and frequencies of the trapezoid rule for means over the band.

        Good to rounding for ``cos(n theta)`` with n <= reach times anything whose nearest
        singularity is w = 1; evenness in theta leaves [0, pi].

        Returns
        -------
        theta, weight, w : ndarray, shape (M,)
        """
        gamma = self.check(gamma)
        r = math.sqrt(1.0 - 4.0 * gamma / (1.0 - self.spring))
        width = 2.0 * math.atanh(min(r, 1.0 - 1e-12))  # strip of analyticity about the real axis
        half = 8 + (int(40.0 / width) + int(reach) + 1) // 2
        theta = np.linspace(0.0, math.pi, half + 1)
        weight = np.full(half + 1, 1.0 / half)
        weight[[0, -1]] *= 0.5
        return theta, weight, np.sqrt(self.spring + 4.0 * gamma * np.sin(0.5 * theta) ** 2)


@lru_cache(maxsize=64)
def _held(spring: float) -> InfiniteChain:
    return InfiniteChain(spring)


@dataclass(frozen=True)
class Ring(_TranslationInvariant):
    """A ring of ``sites`` sites: the same chain closed on itself.

    One site is a single oscillator (the coupling drops out); on two sites both neighbours are
    the same one, so its stiffness matrix is ``gamma [[2, -2], [-2, 2]]``.

    Examples
    --------
    >>> abs(Ring(200).chi(0.12) - InfiniteChain().chi(0.12)) < 1e-15
    True
    """

    sites: int

    def __post_init__(self) -> None:
        whole = isinstance(self.sites, int | np.integer) and not isinstance(self.sites, bool)
        if not whole or not 1 <= self.sites <= MOST:
            raise BadInput(
                f"sites = {self.sites!r}: a ring needs a whole number of sites, at least 1."
            )
        object.__setattr__(self, "sites", int(self.sites))
        object.__setattr__(self, "_expansions", _means(self.sites))
        object.__setattr__(self, "_limit", 0.25)

    @property
    def spring(self) -> float:  # type: ignore[override]
        """Closed forms of rings are without."""
        return 0.0

    def _excess(self, z: float) -> float:
        r = math.sqrt(1.0 - z)
        odd = self.sites % 2
        if z > 0.5:  # T/r with T = tanh or coth stays exact where 1/r and the correction cancel
            t = math.tanh(self.sites * math.atanh(r))
            return (t if odd else 1.0 / t) / r - 1.0
        e = (z / (1.0 + r) ** 2) ** self.sites
        if odd:
            e = -e
        return (z / (1.0 + r) + 2.0 * e / (1.0 - e)) / r

    def _dexcess(self, z: float) -> float:
        r = math.sqrt(1.0 - z)
        n = self.sites
        if n % 2 and n * r < 1.0:  # the closed form cancels to order r^2; so few modes, sum them
            q, c, weight = _quarter_waves(n)
            return float(np.dot(weight, q / ((1.0 - z) + z * c) ** 2))
        r, rho, sign, gap = self._laps(z)
        t = (2.0 - gap) / gap
        slope = sign * 4.0 * n * rho ** (n - 1) / ((1.0 + r) * gap) ** 2
        return (t + r * slope) / (2.0 * r**3)

    # ----------------------------------------------------------------- as a finite lattice

    @property
    def masses(self) -> FloatArray:
        return np.ones(self.sites)

    @property
    def driven_modes(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The drive moves the ring as a whole."""
        root = math.sqrt(self.sites)
        return np.zeros(1), np.full((self.sites, 1), 1.0 / root), np.array([root])

    @property
    def uniform(self) -> bool:
        return True

    @property
    def highest_gamma(self) -> float:
        """At 1/4 the band of the chain reaches the forcing frequency."""
        return 0.25

    def basis(self, hit: tuple[int, ...]) -> Waves:
        """The modes that impacts at the sites `hit` can excite."""
        return waves(self.sites, hit)

    def beside(self, n: int) -> tuple[int, ...]:
        """The sites coupled to site n."""
        return tuple(sorted({(n + d) % self.sites for d in (-1, 1)} - {n}))

    def idle(self, hit: tuple[int, ...]) -> NDArray[np.int64]:
        """Sites that are not in `hit`; around one site alone, one of each pair of mirror images."""
        if len(hit) == 1:
            return np.asarray((hit[0] + np.arange(1, self.sites // 2 + 1)) % self.sites)
        return np.setdiff1d(np.arange(self.sites), hit)

    def describe(self) -> str:
        return f"ring of {self.sites}"

    # ------------------------------------------------------------------ as a chain of period N

    def distance(self, n: int) -> int:
        """How many bonds from site n to the impacting site 0, the shorter way round."""
        n = int(n) % self.sites
        return min(n, self.sites - n)

    def first_harmonic(self, gamma: float, n: ArrayLike) -> FloatArray:
        """``(1/N) sum of cos(n theta)/(1 - w^2)``: the chain's, from both sides and all laps."""
        gamma = check_gamma(gamma)
        m = np.asarray(n) % self.sites
        m = np.minimum(m, self.sites - m)
        r, rho, sign, lap = self._laps(4.0 * gamma)
        return np.asarray((-1.0) ** m * (rho**m + sign * rho ** (self.sites - m)) / (r * lap))

    def dfirst_harmonic(self, gamma: float, n: ArrayLike) -> FloatArray:
        """Derivative of `first_harmonic` with respect to gamma."""
        gamma = check_gamma(gamma)
        m = np.asarray(n) % self.sites
        m, size = np.minimum(m, self.sites - m), self.sites
        r, rho, sign, lap = self._laps(4.0 * gamma)
        if size % 2 and size * r < 1.0:  # as in `_dexcess`
            q, c, weight = _quarter_waves(size)
            wave = np.cos(2.0 * np.pi / size * (np.multiply.outer(m, np.arange(q.size)) % size))
            return np.asarray(
                4.0 * wave @ (weight * q / ((1.0 - 4.0 * gamma) + 4.0 * gamma * c) ** 2)
            )
        ahead = np.where(m > 0, m * rho ** np.maximum(m - 1, 0), 0.0)
        behind = sign * (size - m) * rho ** (size - m - 1)
        both = rho**m + sign * rho ** (size - m)
        turn = (ahead + behind) + both * sign * size * rho ** (size - 1) / lap
        slope = turn / (r * (1.0 + r)) ** 2 + both / (2.0 * r**3)
        return np.asarray(4.0 * (-1.0) ** m * slope / lap)

    def _laps(self, z: float) -> tuple[float, float, float, float]:
        """r, the factor rho of (A3) from site to site, the sign and 1 - sign * rho^N of a lap."""
        r = math.sqrt(1.0 - z)
        rho = z / (1.0 + r) ** 2
        if self.sites % 2:
            return r, rho, -1.0, 1.0 + rho**self.sites
        # near the band's edge rho -> 1: the difference must not be formed
        return r, rho, 1.0, -math.expm1(-2.0 * self.sites * math.atanh(r)) if r < 1.0 else 1.0

    def moments(self, n: int) -> FloatArray:
        """``<q^j cos(n theta)>`` for j = 0, 1, ..., with ``q = sin^2(theta/2)``."""
        return q_moments(self.sites, self.distance(n))

    def frequencies(self, gamma: float) -> FloatArray:
        """``w_j = 2 sqrt(gamma) |sin(pi j/N)|``, j = 0..N-1."""
        gamma = check_gamma(gamma)
        j = np.arange(self.sites)
        # sin(pi j/N) and sin(pi (N-j)/N) must be the same number: degenerate pairs stay so
        return 2.0 * math.sqrt(gamma) * np.sin(np.pi * np.minimum(j, self.sites - j) / self.sites)

    def resolvent(self, gamma: float, s: ArrayLike) -> ComplexArray:
        """``(1/N) sum of 1/(w_j^2 - s^2)`` in closed form; see `InfiniteChain.resolvent`.

        Real s inside the band is allowed, except the frequencies themselves.

        Raises
        ------
        BadInput
            If s is a frequency of the ring.

        Examples
        --------
        >>> complex(Ring(1).resolvent(0.2, 0.5)).real
        -4.0
        """
        gamma = check_gamma(gamma)
        s2 = np.square(np.asarray(s, dtype=complex))
        with np.errstate(divide="ignore", invalid="ignore"):
            z = 4.0 * gamma / s2
            r = np.sqrt(1.0 - z)
            e = (-z / (1.0 + r) ** 2) ** self.sites
            value = np.asarray(-(1.0 + e) / ((1.0 - e) * r * s2))
        if not np.all(np.isfinite(value)):
            raise BadInput(
                f"the mean <1/(w^2 - s^2)> has a pole at each frequency of the ring of "
                f"{self.sites} sites (0 among them); move s off them."
            )
        return value

    def nodes(self, gamma: float, reach: int = 0) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The ring's own modes, those at theta and -theta counted together; ``reach`` is free.

        Returns
        -------
        theta, weight, w : ndarray, shape (N//2 + 1,)
        """
        gamma = check_gamma(gamma)
        half = self.sites // 2
        j = np.arange(half + 1)
        weight = np.where((j == 0) | (2 * j == self.sites), 1.0, 2.0) / self.sites
        return (
            2.0 * np.pi * j / self.sites,
            weight,
            2.0 * math.sqrt(gamma) * np.sin(np.pi * j / self.sites),
        )


def lattice_of(given: object) -> Lattice:
    """The lattice that was given, the infinite chain if none was; anything else is refused."""
    if given is None:
        return InfiniteChain()
    if isinstance(given, type) or not hasattr(given, "first_harmonic"):
        raise BadInput(
            f"lattice = {given!r}: this needs InfiniteChain() or, for a ring of 20 sites, Ring(20)."
        )
    if getattr(given, "spring", 0.0):
        raise BadInput(
            f"lattice = {given!r}: springs to the ground belong to the motion, not to its lattice; "
            "give them by spring=..., on InfiniteChain()."
        )
    return cast(Lattice, given)


@lru_cache(maxsize=32)
def _quarter_waves(sites: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """sin^2 and cos^2 of theta/2 over the modes of a ring, with their weights."""
    theta, weight, _ = Ring(sites).nodes(0.0)
    rest = np.pi * (sites - 2.0 * np.arange(theta.size)) / (2 * sites)  # pi/2 - theta/2, exactly
    return np.sin(0.5 * theta) ** 2, np.sin(rest) ** 2, weight
