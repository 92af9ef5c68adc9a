"""The map QS of a symmetric breather over half its period: one impact, one flight, closed forms.

QS differs from the free propagator Q = exp(pi A) in one 2x2 block, so mu is a multiplier exactly
where ``D = det(1 + (S0 - 1) G(mu)) = 0``, ``G = <(1 - mu Q_w^-1)^-1>`` a mean over the modes. As
G11 = G22, with c = 1 + k, ``D = (1 - c G11)^2 + G12 (b - c^2 G21)``. We write mu = exp(i pi nu), so
|mu| > 1 means Im nu < 0. Sampled once per half period, a frequency s cannot be told from s + 2m: so
G is a sum of the lattice's resolvent ``g(s) = <1/(w^2 - s^2)>`` over all aliases ``s_m = nu + 2m``.
Only ``s_0 = nu`` can lie in the band; the others make up

    R = (1/pi) sum' s_m g(s_m),  B = -(1/pi) sum' g(s_m),  C = (1/pi) (1 + sum' (1 + s_m^2 g(s_m)))

(sums over m != 0), which are real for real nu. The six nearest aliases are exact; the rest,
|s_m| >= 7, is expanded in 1/s_m^2 and then in nu, where the sums over m are Hurwitz zeta functions.
The alias m = 0, ``g = <1/(w^2 - nu^2)>``, is linear in D,

    D = (d + i c R)^2 + B beta + (g/pi) L,   d = (1 - k)/2,   beta = b - c^2 C,
    L = 2 i c nu (d + i c R) - beta - c^2 nu^2 B.

On the band ``g = -i/v``, ``v = nu sqrt(4 gamma - nu^2)`` (with springs ``v^2 = (nu^2 - spring)
(spring + 4 gamma - nu^2)``), the limit from |mu| > 1. There ``F = v D`` is bounded, and F = 0 is a
Neimark-Sacker point. Eliminating beta leaves one real equation for its angle, with the letter
q = 2 d/c of (13),

    (R + nu B)^2 - q (nu/(pi v) - pi v R B) - q^2/4 = 0,   b = c^2 (C - 2 nu R - nu^2 B - pi q v R),

so at given gamma and k a pair is outside for b between its two roots, and for no other
(`contbreather.stability.band_pairs`). D is analytic outside and tends to 1: next to mu = 1 it has
the sign of ``-beta0 = c^2 psi/2 - b`` (zero: pitchfork), and D(-1) is real (zero: fold), so

    ``count = [beta0 > 0] + [D(-1) < 0] + 2 [a pair is outside]``.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from threading import get_ident
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from contbreather.lattice.band_averages import binomial, in_powers_of_x, zeta
from contbreather.lattice.chain import Chains, InfiniteChain
from contbreather.stability import band_pairs
from contbreather.stability.band_pairs import EXACT, GRID, ON_ARC, ORDERS, POWERS, SUMS, WINDOWS
from contbreather.stability.chain_map import RINGS, OrbitMap
from contbreather.stability.modal_map import EPS, ModalMap, section_map
from contbreather.stability.saltation import Saltation
from contbreather.stability.zeros import Count, as_counted, highest

Array = NDArray[Any]

ROUNDING = 1e-13  # of the terms of what vanishes at a multiplier: closer, a count is not certain
EDGE = 1e-10  # of 1/4 - gamma: nearer, the band's edge and -1 are told apart by rounding
ON_CIRCLE = 4e-13  # of |mu| - 1 of a zero that may be on the circle


def alias_sums(gamma: float, nu: Array, spring: float = 0.0) -> Array:
    """R, B, C and the slope of R at angles up to 1 (times pi), on the band and off it."""
    places, rows = np.ascontiguousarray(nu), np.empty((nu.size, 4))
    SUMS(*_on(gamma, 1.0, spring), places, rows)
    return rows.T


def _on(
    gamma: float, k: float, spring: float
) -> tuple[band_pairs.ChainWithImpacts, band_pairs.BandWorkspace]:
    return band_pairs.ChainWithImpacts(gamma, k, spring), band_workspace(spring, get_ident())


@lru_cache(maxsize=16)
def band_workspace(spring: float, thread: int) -> band_pairs.BandWorkspace:
    """Expansions that `band_pairs` need, with a thread's room to evaluate them."""
    # <w^2j> as a polynomial in 4 gamma; and its slope in the spring, j <w^(2j - 2)>
    values, slopes = _expanded(spring), _expanded(spring, slope=True)
    room = np.empty((3, 3, POWERS)), np.empty(GRID + 1), np.empty((3, 3))
    return band_pairs.BandWorkspace(values, slopes, *room)


def _expanded(spring: Any, slope: bool = False) -> Array:
    """Tails of R/nu, B, C by powers of nu^2 and 4 gamma, the highest first, chain by chain."""
    moments = InfiniteChain().moments(0)[:ORDERS] * in_powers_of_x(spring, ORDERS)
    if slope:
        moments = np.arange(ORDERS)[:, None] * np.roll(moments, 1, axis=-2)
    rows = (tables() @ moments[..., None, :, :])[..., ::-1, ::-1]
    return np.ascontiguousarray(rows).reshape(-1, POWERS, ORDERS)


@lru_cache(maxsize=1)
def tables() -> NDArray[np.float64]:
    """``[3, POWERS, ORDERS]``: the tails of R/nu, B, C as coefficients of nu^2k <w^2j>."""
    j = np.arange(ORDERS)
    k = np.arange(POWERS)[:, None]
    first = EXACT + 1.0

    def tail(power: Array, order: Array) -> Array:
        # sum over |m| > EXACT of s_m^-power: the coefficient of nu^order
        n = power + order
        return 2.0 / math.pi * binomial(n - 1, order) * 2.0**-n * zeta(np.maximum(n, 2), first)

    b = tail(2 * j + 2, 2 * k)
    r = tail(2 * j + 1, 2 * k + 1)
    c = np.zeros_like(b)
    c[:, 1:] = -tail(2 * j[1:], 2 * k)  # the term j = 0 is the 1 that is added to s^2 g
    return np.stack([r, b, c])


# --- Neimark-Sacker points ------------------------------------------------------------------------


class Gradient(NamedTuple):
    """F at an angle of the band, and its partial derivatives."""

    value: complex
    d_nu: complex
    d_gamma: complex
    d_k: complex
    d_b: complex
    d_spring: complex


class NeimarkSacker(NamedTuple):
    """One Neimark-Sacker point at given gamma and k: its angle/pi and the b it needs."""

    nu: float
    b: float


def ns_points(gamma: float, k: float, spring: float = 0.0) -> tuple[NeimarkSacker, ...]:
    """Neimark-Sacker points of the infinite chain at this coupling and restitution.

    They are roots in one variable, the angle, each with an explicit b: no seed is needed. Sorted
    by angle; none, or two (at k = 1 none: the band is neutral there).

    Examples
    --------
    >>> [round(point.nu, 4) for point in ns_points(0.0969710, 0.8)]
    [0.4875, 0.5581]
    """
    if gamma == 0.0 or k == 1.0:
        return ()
    return tuple(sorted(NeimarkSacker(*root) for root in _windows(gamma, k, spring)[1]))


def _windows(gamma: Any, k: float, spring: Any) -> tuple[Array, list[list[float]]]:
    """Call `pair_windows`, for one chain or arrays of many."""
    chains = np.empty((2, np.size(gamma)))
    chains[0], chains[1] = gamma, spring
    windows, roots = np.empty((np.size(gamma), 4)), np.full((2, 2), math.nan)
    several = np.ndim(spring) > 0  # they bring expansions of their own
    work = band_workspace(0.0 if several else float(spring), get_ident())
    expansions = _expanded(spring) if several else work.expansions
    WINDOWS(*chains, k, expansions, work, windows, roots)
    return windows, [row for row in roots.tolist() if not math.isnan(row[0])]


class Window(NamedTuple):
    """The values of b between which a pair is outside: ``(centre - b)^2 < square``; of one chain or
    arrays of many.

    Where no b brings a pair out, ``square`` is negative, and grows to zero smoothly up to where
    one does. ``low`` and ``high`` are the angles/pi at both ends, or that where they will part.
    """

    centre: Any
    square: Any
    low: Any = 0.0
    high: Any = 0.0

    def miss(self, b: Any) -> Any:
        """Negative where a pair is outside, zero at the Neimark-Sacker points, smooth and bounded:
        b runs to infinity where an impact vanishes."""
        return ((b - self.centre) ** 2 - self.square) / (1.0 + b * b)

    def passed(self, b: Any) -> Any:
        """Count the ends below b; without a window the number leads from none to both, as smoothly
        as the distance from one allows."""
        off = b - self.centre
        half, open_ = np.sqrt(np.abs(self.square)), np.greater_equal(self.square, 0.0)
        within = (off > -half) + 1 * (off > half)
        return np.where(open_, within, 1.0 + off / np.hypot(off, half + open_))[()]


@lru_cache(maxsize=64)
def window(gamma: float, k: float, spring: float = 0.0) -> Window:
    """Window of b in which a pair is outside, at this coupling and restitution.

    At k = 1 there are neutral multipliers between the band and -1. The pair that comes out of the
    band's edge for k < 1 is one of them, and leaves the circle only where two have met: beyond the
    largest b of any; and with springs, which open a gap between the band and +1, short of the least
    b of any there.

    Examples
    --------
    >>> low, high = sorted(point.b for point in ns_points(0.1, 0.8))
    >>> abs(window(0.1, 0.8).miss(low)) < 1e-12 and window(0.1, 0.8).miss(0.5 * (low + high)) < 0
    True
    """
    if gamma == 0.0:
        return Window(0.0, -1.0)
    if k == 1.0:
        (low, nu), (high, other) = (_neutral(gamma, spring, side) for side in (1, -1))
        if low >= high:
            return Window(high, -1.0, other, other)
        return Window(0.5 * (low + high), 0.25 * (low - high) ** 2, nu, other)
    return Window(*_windows(gamma, k, spring)[0][0].tolist())


def _neutral(gamma: float, spring: float, side: int) -> tuple[float, float]:
    """For k = 1 the largest b for which D, real there, has a zero between the band and mu = -1, on
    the side 1; on the side -1 the least for one between it and mu = 1. And its angle."""
    if side < 0 and spring == 0.0:  # the band starts there
        return float(4.0 * alias_sums(gamma, np.zeros(1))[2, 0]), 0.0
    edge = math.sqrt(spring + 4.0 * gamma) if side > 0 else math.sqrt(spring)

    def angle(t: Any) -> Any:
        # the root at the edge is smooth in t
        return edge + (1.0 - edge) * t * t if side > 0 else edge * (1.0 - t * t)

    def needed(t: Array) -> Array:
        nu = angle(t)
        if side > 0:
            # -pi/g = pi sqrt((nu^2 - spring)(nu - edge)(nu + edge))
            inverse = math.pi * np.sqrt((nu * nu - spring) * (1.0 - edge) * (nu + edge)) * t
        else:
            below = edge * (edge + nu)  # spring - nu^2 = t^2 edge (edge + nu)
            inverse = -math.pi * np.sqrt(below * (below * t * t + 4.0 * gamma)) * t
        R, B, C, _ = alias_sums(gamma, nu, spring)
        # c = 2, d = 0: D = 0 where beta (1 - pi B/g) = 4 (-pi R^2/g - nu (2 R + nu B)), and
        # b = beta + 4 C
        share = (inverse * R * R - nu * (2.0 * R + nu * B)) / (1.0 + inverse * B)
        return np.asarray(side * (4.0 * (C + share)))

    t, b = highest(needed, 0.0, 1.0)
    return side * b, angle(t)


# --- the map --------------------------------------------------------------------------------------


class RealScalars:
    """Scalars of the multipliers 1 and -1, of a chain and of a ring alike."""

    @cached_property
    def _ends(self: Any) -> tuple[Any, ...]:
        """beta0, which has the sign of -D(1), and D(-1), each with the size of its terms."""
        psi, eta, chi = (self.lattice.mean(self.gamma, name) for name in ("psi", "eta", "chi"))
        half_c2, d = 0.5 * (1.0 + self.k) ** 2, 0.5 * (1.0 - self.k)
        pitchfork, fold = half_c2 * psi, half_c2 * eta
        if np.any(self.lattice.spring):  # it closes the pole that D has at mu = 1
            pitchfork += 2.0 * d * d / self.lattice.tau(self.gamma)
        # D(-1) = d^2 + chi (b + c^2 eta/2)/2: there G12 = chi/2
        return (
            self.b - pitchfork,
            abs(self.b) + abs(pitchfork),
            d * d + 0.5 * chi * (self.b + fold),
            d * d + 0.5 * chi * (abs(self.b) + fold),
        )

    def crosses(self, mu: float) -> Any:
        """D at mu = -1, and at mu = 1 without its pole: scalars of fold and pitchfork."""
        beta0, _, fold, _ = self._ends
        return fold if mu < 0.0 else -beta0

    def beyond(self, place: float) -> Any:
        """Count the real multipliers farther out than 1 or -1, on its side: one or none."""
        return 1 * (self.crosses(place) < 0.0)

    def on_circle(self: Any, angle: float, radius: float = 1.0) -> Any:
        """The value of `gradient` at ``radius exp(i pi angle)``; of 1 and -1 the scalar."""
        if radius == 1.0 and angle in (0.0, 1.0):
            return self.crosses(1.0 - 2.0 * angle)
        return self.gradient(angle, radius).value


@dataclass(frozen=True)
class HalfMap(RealScalars):
    """Small perturbations of a symmetric breather of the infinite chain over half a period.

    Attributes
    ----------
    gamma, k, b : float
        Coupling, restitution, off-diagonal entry of the saltation matrix (19); gamma and b may be
        arrays.
    lattice : InfiniteChain or Chains

    Examples
    --------
    >>> HalfMap(0.1144, 0.8, 0.236).count().count, HalfMap(0.1144, 0.8, 0.235).count().count
    (0, 2)
    """

    gamma: Any
    k: float
    b: Any
    lattice: InfiniteChain | Chains = InfiniteChain()
    sign: ClassVar[int] = -1
    period: ClassVar[float] = 2.0 * math.pi  # of the orbit, two half maps

    @cached_property
    def window(self) -> Window:
        """Between which values of b a pair is outside."""
        if np.ndim(self.gamma) == 0:
            return window(self.gamma, self.k, self.lattice.spring)
        if self.k < 1.0 and np.all(self.gamma):
            return Window(*_windows(self.gamma, self.k, self.lattice.spring)[0].T)
        chains = np.broadcast(self.gamma, self.lattice.spring)
        return Window(*np.array([window(one, self.k, held) for one, held in chains]).T)

    def pairs(self, radius: float = 1.0) -> tuple[float, int]:
        """Distance of b from the window in which a pair is outside, and the number of its ends
        below b; two that are passed in one step are seen. At k = 1 it has an end where the
        pitchfork is: on a curve of pitchforks that is rounding."""
        off = self.window.miss(self.b)
        if self.k == 1.0:
            off = off * (abs(off) > ROUNDING * (1.0 + abs(self.b)))
        return off, self.window.passed(self.b)

    def nearest(self) -> float:
        """Angle, over pi, of the pair closest to leaving, at the nearer end of the window."""
        return self.window.low if self.b < self.window.centre else self.window.high

    def gradient(self, angle: float, radius: float = 1.0) -> Gradient:
        """``F = v D`` at an angle inside the band (times pi), with its derivatives."""
        out = np.empty(6, complex)
        ON_ARC(*_on(self.gamma, self.k, self.lattice.spring), self.b, angle, out)
        return Gradient(*out.tolist())

    def unstable(self, threshold: float) -> Any:
        """Count the multipliers outside the unit circle by more than rounding."""
        beta0, beta0_size, fold, fold_size = self._ends
        above, below = beta0 > ROUNDING * beta0_size, fold < -ROUNDING * fold_size
        return 1 * above + 1 * below + 2 * self._pair_is_outside

    @property
    def _pair_is_outside(self) -> Any:
        return self.window.miss(self.b) < -ROUNDING

    def count(self) -> Count:
        """Count them, and say how sure that is."""
        beta0, beta0_size, fold, fold_size = self._ends
        miss, room = self.window.miss(self.b), 0.25 * (1.0 - self.lattice.spring) - self.gamma
        off = (
            (abs(beta0) / beta0_size, 0.0),
            (abs(miss), self.nearest()),
            (abs(fold) / fold_size, 1.0),
        )
        distance, nu = min(off)
        certain = bool(distance > ROUNDING + 1e-16 / room and room > EDGE)
        pairs = int(self._pair_is_outside)
        return Count(int(self.unstable(1.0)), certain, float(distance), nu, pairs)

    def unstable_multipliers(self) -> Array:
        """The multipliers outside the unit circle, largest first, held to the count."""
        spring = self.lattice.spring
        whole = OrbitMap(self.gamma, self.k, (Saltation(0, 0.0, self.b),), 0.5, spring)
        if self.gamma == 0.0:
            return whole.unstable_multipliers()
        # next to the band's edge at -1 zeros are found so far outside that are none
        slack = 1e-7 if 0.25 * (1.0 - spring) - self.gamma < 1e-6 else ON_CIRCLE
        at = f"gamma = {self.gamma}, k = {self.k}, b = {self.b}: "

        def look(sites: int) -> Array:
            # on the circle to within rounding are multipliers that the count says are outside,
            # and at k = 1 neutral ones: the last to be looked for
            return whole.zeros(sites, ON_CIRCLE if sites > RINGS[1] else -ON_CIRCLE)

        return as_counted(self.count(), look, RINGS, slack, at)


@dataclass(frozen=True, eq=False)
class RingHalfMap(RealScalars, ModalMap):
    """Small perturbations over half a period on a ring without losses between impacts: by its
    modes, with scalars of real multipliers in closed form, and on a circle around all poles D for
    its determinant."""

    sign: int = -1

    @cached_property
    def k(self) -> float:
        return float(self.blows[0].k)

    @cached_property
    def b(self) -> float:
        return float(self.blows[0].b)

    @property
    def rounding(self) -> float:
        """Rounding of all multipliers: their matrix grows as the entry b."""
        return EPS * (1.0 + abs(self.b))

    @cached_property
    def coupled(self) -> Array:
        if self.gamma > 0.0:
            return super().coupled
        single = np.array([[1.0, math.pi], [0.0, 1.0]]) @ self.blows[0].saltation
        return np.append(np.linalg.eigvals(single).astype(complex), np.ones(2 * self.z.size - 2))

    def gradient(self, angle: float, radius: float = 1.0) -> Gradient:
        """D at ``radius exp(i pi angle)``, with its derivatives."""
        _, weight, w = self.lattice.nodes(self.gamma)
        mu, c = radius * np.exp(1j * math.pi * angle), 1.0 + self.k
        C, S = np.cos(math.pi * w), math.pi * np.sinc(w)
        P, q = w * w * S, 1.0 / (1.0 - 2.0 * mu * C + mu * mu)
        # (1 - mu Q_w^-1)^-1 = (1 - mu Q_w) q; and how C, S, P change with gamma
        in_C, in_S, in_P = -math.pi * P, math.pi * C - S, P + math.pi * w * w * C
        by_gamma = 0.5 / self.gamma if self.gamma else 0.0
        in_q, in_mu = 2.0 * mu * in_C * q, 2.0 * (C - mu) * q
        G11, G12, G21, *slopes = np.stack([
            1.0 - mu * C, -mu * S, mu * P,
            (1.0 - mu * C) * in_mu - C, -mu * S * in_mu - S, mu * P * in_mu + P,
            by_gamma * ((1.0 - mu * C) * in_q - mu * in_C), -by_gamma * mu * (S * in_q + in_S),
            by_gamma * mu * (P * in_q + in_P),
        ]) @ (weight * q)  # fmt: skip
        a, f = 1.0 - c * G11, self.b - c * c * G21
        along_mu, along_gamma = (
            -2.0 * c * a * g11 + g12 * f - c * c * G12 * g21
            for g11, g12, g21 in (slopes[:3], slopes[3:])
        )
        in_k = -2.0 * (a * G11 + c * G12 * G21)
        return Gradient(a * a + G12 * f, 1j * math.pi * mu * along_mu, along_gamma, in_k, G12, 0.0)

    def beside(self, angle: float, radius: float = 1.0) -> Callable[[Any, float], complex]:
        return lambda map, angle: map.on_circle(angle, radius)


def half_map(gamma: float, k: float, b: float, lattice: Any = InfiniteChain()) -> Any:
    """The map QS of a symmetric breather over half its period, on the infinite chain or a ring."""
    if lattice.sites is None:
        return HalfMap(gamma, k, b, lattice)
    kick, held = Saltation(0, 0.0, b), (gamma, 0.0, 0.0)
    return section_map(lattice, held, k, (kick,), math.pi, -1, RingHalfMap)
