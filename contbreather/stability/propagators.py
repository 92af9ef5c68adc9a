"""Mean propagators between two impacts of a periodic orbit, for perturbations that grow by mu.

A kick at one impact that recurs every period, mu times as large, moves the state at another by

    ``X(s) = <cos(d theta) [[G', G], [G'', G']](s)>``,   s the time between, d the distance,

G the Green's function with ``G(s + 2 pi) = mu G(s)``; time is in units of n forcing periods, as in
`contbreather.lattice.periodic_green`. With mu = exp(2 pi i kappa) it is a sum over the aliases
``kappa_j = kappa + j``, ``G = (1/2 pi) sum of exp(i kappa_j s)/(w^2 - kappa_j^2)``, whose mean over
the band is the lattice's resolvent. ``exp(i kappa s)`` is a change of basis and is left out.
Aliases up to |j| = 5 are exact; of the rest, expanded in w/kappa_j and then in kappa, remain the
sums ``S_p(s) = sum over |j| > 5 of exp(ijs)/j^p``, known from Bernoulli polynomials.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from contbreather.lattice import InfiniteChain, Ring
from contbreather.lattice.zeta import binomial, zeta
from contbreather.stability.bordered import CLOSED, FAR, HIGHEST, NEAR, ORDERS, POWERS, Series

Array = NDArray[Any]

DEEP = 0.5  # beyond this |Im kappa|, 40 modes are the infinite chain
MODES = 40


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


def deep(gamma: float, distance: int, times: Array, kappa: Array) -> Entries:
    """For pairs of impacts the times apart, at one distance, for |Im kappa| >= `DEEP`, by modes."""
    theta, weight, w = Ring(MODES + 2 * distance).nodes(gamma)
    amplitude = weight * np.cos(distance * theta)
    late = np.where(times <= 0.0, 1.0, 0.0)
    mu = np.exp(2j * math.pi * kappa)
    now = (times + 2.0 * math.pi * late)[:, None, None]
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
    """``j^-p`` for NEAR < j <= FAR, p = CLOSED + 1 .. HIGHEST."""
    j = np.arange(NEAR + 1.0, FAR + 1.0)[:, None]
    return j ** -np.arange(CLOSED + 1.0, HIGHEST + 1.0)


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


@lru_cache(maxsize=1)
def series() -> Series:
    """All of it."""
    which, number = _expansions()
    return Series(number, which.astype(float), _bernoulli(), _far_powers())


@lru_cache(maxsize=64)
def moments(gamma: float, farthest: int) -> Array:
    """``<w^2l cos(d theta)>`` of the chain for distances d up to the farthest, (d, ORDERS)."""
    rows = [InfiniteChain().moments(d)[:ORDERS] for d in range(farthest + 1)]
    return np.ascontiguousarray(rows * (4.0 * gamma) ** np.arange(ORDERS))
