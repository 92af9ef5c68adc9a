"""Mean propagators between two impacts of a periodic orbit, for perturbations that grow by mu.

A kick at one impact that recurs every period, mu times as large, moves the state at another by

    ``X(s) = <cos(d theta) [[G', G], [G'', G']](s)>``,   s the time between, d the distance,

G the Green's function with ``G(s + 2 pi) = mu G(s)``; time is in units of n forcing periods, as in
`contbreather.lattice.periodic`. With mu = exp(2 pi i kappa) it is a sum over the aliases
``kappa_j = kappa + j``, ``G = (1/2 pi) sum of exp(i kappa_j s)/(w^2 - kappa_j^2)``, whose mean over
the band is the lattice's resolvent. ``exp(i kappa s)`` is a change of basis and is left out.
Aliases up to |j| = 5 are exact; of the rest, expanded in w/kappa_j and then in kappa, remain the
sums ``S_p(s) = sum over |j| > 5 of exp(ijs)/j^p``, known from Bernoulli polynomials.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from contbreather.lattice import InfiniteChain, Ring
from contbreather.lattice.zeta import binomial, zeta

Array = NDArray[Any]

NEAR = 5  # aliases |j| <= 5 are exact
ORDERS = 11  # of w^2/kappa_j^2 <= 1/30: below rounding
POWERS = 22  # of kappa/(6 - w) <= 1/5: 4e-16
FAR = 64  # |j| up to which high powers of 1/j are summed: 64^-9 < 1e-16
CLOSED = 9  # lower powers come from Bernoulli polynomials
DEEP = 0.5  # beyond this |Im kappa|, 40 modes are the infinite chain
MODES = 40
_ALIASES = np.arange(-NEAR, NEAR + 1)
_HIGHEST = 2 * ORDERS + POWERS


class Entries(NamedTuple):
    """``[[turn, reach], [pull, turn]]`` for pairs of impacts, shape (pairs, K)."""

    turn: Array  # G': displacement from displacement, velocity from velocity
    reach: Array  # G: displacement from velocity
    pull: Array  # G'': velocity from displacement


def root(gamma: float, kappa: Array) -> Array:
    """``sqrt(kappa^2 - 4 gamma)``, like kappa far off, for Im kappa <= 0; on the band its limit
    from below. As a product of two roots it is exact next to either edge, and zero at them."""
    edge = 2.0 * math.sqrt(gamma)
    above = kappa.real + 1j * np.abs(kappa.imag)  # the conjugate, on the upper side of the cut
    return np.asarray((np.sqrt(above - edge) * np.sqrt(above + edge)).conj())


def inverse(gamma: float, kappa: Array) -> Array:
    """``1/<1/(w^2 - kappa^2)>`` for Im kappa <= 0: zero at kappa = 0 and at the band's edges."""
    return np.asarray(-kappa * root(gamma, kappa))


def passed_on(gamma: float, kappa: Array) -> Array:
    """By what a site moves less than its neighbour on the side that is shaken; of modulus 1, a
    wave that runs off, on the band."""
    share = kappa + root(gamma, kappa)
    return np.asarray(-4.0 * gamma / (share * share))


def resolvent(gamma: float, kappa: Array, distance: int) -> Array:
    """``<cos(d theta)/(w^2 - kappa^2)>`` for Im kappa <= 0; on the band the limit from below. It
    has poles at kappa = 0 and at the band's edges."""
    return np.asarray(passed_on(gamma, kappa) ** distance / inverse(gamma, kappa))


def held(gamma: float, kappa: Array, sites: Array) -> Array:
    """How sites n, m answer each other on the chain whose site 0 does not move, (K, n, m).

    The answer g r^|n - m| of the free chain less its image g r^(n + m), r as in `passed_on`. As
    ``g (1/r - r) = 1/gamma``, that is a short sum of powers of r: bounded at the ends of the band,
    where the square roots of g are infinite.
    """
    nearer, farther = np.minimum.outer(sites, sites), np.maximum.outer(sites, sites)
    r = passed_on(gamma, kappa)[:, None, None]
    total = np.zeros((kappa.size, *nearer.shape), dtype=complex)
    for i in range(int(nearer.max())):
        total += np.where(i < nearer, r ** np.maximum(farther - nearer + 2 * i, 0), 0.0)
    share = kappa + root(gamma, kappa)
    return np.asarray(-4.0 * total / (share * share)[:, None, None])


@dataclass(frozen=True)
class Propagators:
    """All that does not depend on kappa, for pairs of impacts at one distance.

    ``times`` are s between the pairs, ``tails`` the Taylor coefficients in kappa of what the
    aliases beyond `NEAR` add to (turn, reach, pull).
    """

    gamma: float
    distance: int
    times: Array  # (pairs,)
    phases: Array  # (pairs, 2 NEAR + 1): exp(ijs)
    tails: Array  # (3, pairs, POWERS)

    def near(self, kappa: Array, without: Sequence[int] = ()) -> Entries:
        """Entries for |kappa| <= 1, Im kappa <= 0, shape (pairs, K).

        ``without`` names aliases whose parts ``g (1, i kappa)^T (i kappa, 1)`` are left out, with
        all that is infinite at an end of the band: the caller brings them back by a border.
        """
        s = kappa + _ALIASES[:, None]
        own = 1.0 if self.distance == 0 else 0.0
        g, kept = np.zeros_like(s), ~np.isin(_ALIASES, without)
        g[kept] = resolvent(self.gamma, s[kept], self.distance)
        is_g = 1j * s * g
        powers = np.empty((POWERS, kappa.size), dtype=complex)
        powers[0], powers[1:] = 1.0, kappa
        tail = self.tails @ np.multiply.accumulate(powers, axis=0, out=powers)
        turn = (self.phases @ is_g + tail[0]) / (2.0 * math.pi)
        reach = (self.phases @ g + tail[1]) / (2.0 * math.pi)
        pull = (self.phases @ (1j * s * is_g - own) + tail[2]) / (2.0 * math.pi)
        # an impact meets what earlier periods left, not its own kick: G'(0-) = G'(0) - 1/2
        turn[self.times == 0.0] -= 0.5 * own
        return Entries(turn, reach, pull)

    def deep(self, kappa: Array) -> Entries:
        """Entries for |Im kappa| >= `DEEP` by modes, with ``exp(i kappa s)`` left out again."""
        theta, weight, w = Ring(MODES + 2 * self.distance).nodes(self.gamma)
        amplitude = weight * np.cos(self.distance * theta)
        late = np.where(self.times <= 0.0, 1.0, 0.0)
        mu = np.exp(2j * math.pi * kappa)
        now = (self.times + 2.0 * math.pi * late)[:, None, None]
        before = now - 2.0 * math.pi
        slope = 1.0 - 2.0 * np.cos(2.0 * math.pi * w) / mu[:, None] + mu[:, None] ** -2
        share = amplitude / slope
        back = np.exp(-1j * kappa * now[:, 0])  # mu^-1 exp(-i kappa s) for the late ones

        def mean(now_part: Array, before_part: Array) -> Array:
            return np.sum((now_part - before_part / mu[:, None]) * share, axis=-1) * back

        def reach(s: Array) -> Array:
            return s * np.sinc(w * s / math.pi)

        return Entries(
            mean(np.cos(w * now), np.cos(w * before)),
            mean(reach(now), reach(before)),
            mean(-w * np.sin(w * now), -w * np.sin(w * before)),
        )


def propagators(gamma: float, distance: int, times: Array) -> Propagators:
    """`Propagators` for pairs of impacts the times apart, at one distance."""
    moments = InfiniteChain().moments(distance)[:ORDERS] * (4.0 * gamma) ** np.arange(ORDERS)
    which, number = _expansions()
    weights = np.zeros((3, _HIGHEST, POWERS), dtype=complex)
    weights[np.arange(3)[:, None, None], which, np.arange(POWERS)] = number * moments[:, None]
    tails = _sums(times) @ weights
    tails[0] *= 1j
    phases = np.exp(1j * np.multiply.outer(times, _ALIASES))
    return Propagators(gamma, distance, times, phases, tails)


@lru_cache(maxsize=1)
def _expansions() -> tuple[Array, Array]:
    """``[3, ORDERS, a]``: in (turn, reach, pull) the coefficient of kappa^a <w^2l cos> is this
    number times that sum S_p."""
    order, a = np.arange(ORDERS)[:, None], np.arange(POWERS)
    which, number = [], []
    # i kappa_j g, g and -kappa_j^2 g - 1 have -kappa_j^-q <w^2l> (but for i), each with its q
    for q, factor in ((2 * order + 1, -1.0), (2 * order + 2, -1.0), (2 * order, 1.0)):
        # a term without sum, q = 0, is put at the far end where none other is
        which.append(np.where(q > 0, q + a - 1, -1))
        number.append(np.where(q > 0, factor * (-1.0) ** a * binomial(q - 1 + a, a), 0.0))
    return np.stack(which), np.stack(number)


@lru_cache(maxsize=1)
def _far_powers() -> Array:
    """``j^-p`` for NEAR < j <= FAR, p = CLOSED + 1 .. _HIGHEST."""
    j = np.arange(NEAR + 1.0, FAR + 1.0)[:, None]
    return j ** -np.arange(CLOSED + 1.0, _HIGHEST + 1.0)


@lru_cache(maxsize=1)
def _bernoulli() -> Array:
    """``[p - 1, i]``: sum over j >= 1 of cos(js)/j^p (p even), sin(js)/j^p (p odd), as
    polynomials in ``y = pi - s``."""
    table = np.zeros((CLOSED, CLOSED + 1))
    for p in range(1, CLOSED + 1):
        even = p + p % 2
        for i in range(p % 2, even // 2 + 1):
            r = even - 2 * i
            alternating = 0.5 if r == 0 else (1.0 - 2.0 ** (1 - r)) * zeta(r)
            power = 2 * i - p % 2
            table[p - 1, power] = -((-1) ** i) * alternating / math.factorial(power)
    return table


def _sums(times: Array) -> Array:
    """S_p(s) for p = 1 .. _HIGHEST, shape (pairs, _HIGHEST)."""
    y = math.pi - np.asarray(times) % (2.0 * math.pi)
    closed = y[:, None] ** np.arange(CLOSED + 1) @ _bernoulli().T
    closed[np.asarray(times) == 0.0, 0] = 0.0  # the mean of its jump
    j = np.arange(1, FAR + 1)
    angle = np.multiply.outer(times, j)
    cosine, sine = np.cos(angle), np.sin(angle)
    for p in range(1, CLOSED + 1):
        waves = sine if p % 2 else cosine
        closed[:, p - 1] -= waves[:, :NEAR] @ (1.0 / j[:NEAR] ** float(p))
    sums = np.empty((y.size, _HIGHEST), dtype=complex)
    sums[:, :CLOSED] = closed
    far = slice(NEAR, FAR)
    sums[:, CLOSED:] = cosine[:, far] @ _far_powers()
    odd = np.arange(_HIGHEST) % 2 == 0  # p = 1, 3, 5 ...
    sums[:, CLOSED:][:, odd[CLOSED:]] = sine[:, far] @ _far_powers()[:, odd[CLOSED:]]
    # exp(ijs)/j^p over j and -j: twice the cosine, or 2i times the sine
    return sums * np.where(odd, 2j, 2.0)


@lru_cache(maxsize=1)
def constants() -> NDArray[np.float64]:
    """All of it that `orbit_loops` need, in their order."""
    which, number = _expansions()
    parts = (number, which, _bernoulli(), _far_powers(), InfiniteChain().moments(0)[:ORDERS])
    return np.concatenate([np.asarray(part, dtype=float).ravel() for part in parts])
