"""Lattice sums over the aliased frequencies nu + 2m, m != 0: the smooth part of G.

Sampled once per half period, a frequency s cannot be told from s + 2m. So the mean G of the half
map's resolvent is a sum of the lattice's resolvent ``g(s) = <1/(w^2 - s^2)>`` over all aliases
``s_m = nu + 2m``. Only ``s_0 = nu`` can lie in the band; the others make up

    R = (1/pi) sum' s_m g(s_m),  B = -(1/pi) sum' g(s_m),  C = (1/pi) (1 + sum' (1 + s_m^2 g(s_m)))

(sums over m != 0), which are analytic for |Re nu| <= 1 and real for real nu. The six nearest
aliases are exact; the rest, |s_m| >= 7, is expanded in 1/s_m^2 and then in nu, where the sums
over m are Hurwitz zeta functions: a polynomial in nu^2 with coefficients depending on gamma.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from contbreather.lattice import InfiniteChain, Ring
from contbreather.lattice.zeta import binomial, zeta
from contbreather.stability.band_pairs import EXACT, ORDERS, POWERS

Array = NDArray[Any]  # real on the real axis, complex off it

_SHIFTS = 2.0 * np.array([m for m in range(-EXACT, EXACT + 1) if m != 0])


class Regular(NamedTuple):
    """R, B, C of the module's docstring, shaped like nu."""

    R: Array
    B: Array
    C: Array


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


@lru_cache(maxsize=256)
def tail_coefficients(gamma: float, sites: int | None, spring: float = 0.0) -> tuple[Array, Array]:
    """Coefficients in nu^2 of the tails of (R/nu, B, C), ``[3, POWERS]``, and their derivatives
    with respect to gamma."""
    lattice = InfiniteChain().with_spring(spring) if sites is None else Ring(sites)
    powers, by_gamma = (
        tables() @ of(gamma, 0)[:ORDERS] for of in (lattice.powers, lattice.dpowers)
    )
    return powers, by_gamma


class Alias(NamedTuple):
    """``h = -s^2 g(s)`` at some frequencies, and its derivatives with respect to s and gamma."""

    h: Array
    h_s: Array
    h_gamma: Array


def sprung(gamma: float, s: Array, spring: float) -> Alias:
    """`alias_slopes` of the chain with springs, ``h = s^2/sqrt(A (A - 4 gamma))``,
    ``A = s^2 - spring``; off the band, or with A a little below it."""
    s2 = s * s
    A = s2 - spring
    edge = A - 4.0 * gamma
    h = s2 / (A * np.sqrt(1.0 - 4.0 * gamma / A))
    return Alias(np.asarray(h), h * (2.0 / s - s * (A + edge) / (A * edge)), 2.0 * h / edge)


def alias(gamma: float, s: Array, sites: int | None = None, spring: float = 0.0) -> Array:
    """``h = -s^2 g(s)``, g the resolvent of the chain (``sites=None``) or ring, off the band."""
    if spring:
        return sprung(gamma, s, spring).h
    z = 4.0 * gamma / (s * s)
    r = np.sqrt(1.0 - z)
    if sites is None:
        return np.asarray(1.0 / r)
    # images around the ring: x^N with x + 1/x = 2 - s^2/gamma; z/(1 + r)^2 is (1 - r)/(1 + r)
    e = (-z / (1.0 + r) ** 2) ** sites
    return np.asarray((1.0 + e) / ((1.0 - e) * r))


def alias_slopes(gamma: float, s: Array, sites: int | None = None, r: Array | None = None) -> Alias:
    """`alias` with derivatives; ``r`` overrides the root ``sqrt(1 - 4 gamma/s^2)`` (on the arc)."""
    s2 = s * s
    z = 4.0 * gamma / s2
    if r is None:
        r = np.sqrt(1.0 - z)
    h = 1.0 / r
    rr = 1.0 - z
    h_s, h_gamma = -h * z / (s * rr), 2.0 * h / (s2 * rr)  # of (1 - z)^(-1/2)
    if sites is None:
        return Alias(np.asarray(h), np.asarray(h_s), np.asarray(h_gamma))
    if sites == 1:  # a single oscillator knows no coupling: g = -1/s^2
        return Alias(np.ones_like(s), np.zeros_like(s), np.zeros_like(s))
    e = (-z / (1.0 + r) ** 2) ** sites
    kappa = (1.0 + e) / (1.0 - e)
    slope = 2.0 * sites * e / ((1.0 - e) ** 2 * r)  # d kappa / d ln(e^(r/sites))
    slope_gamma = slope / gamma if gamma > 0.0 else np.zeros_like(slope)
    return Alias(
        np.asarray(h * kappa),
        np.asarray(h_s * kappa - 2.0 * h * slope / s),
        np.asarray(h_gamma * kappa + h * slope_gamma),
    )


def _powers(x: Array) -> Array:
    """1, x, x^2 ... as rows, x flattened."""
    rows = np.empty((POWERS, x.size), dtype=x.dtype)
    rows[0] = 1.0
    rows[1:] = x.ravel()
    return np.multiply.accumulate(rows, axis=0, out=rows)


def regular(gamma: float, nu: Array, sites: int | None = None, spring: float = 0.0) -> Regular:
    """R, B, C at ``|Re nu| <= 1, |Im nu| <= 1`` (real arithmetic for real nu)."""
    s = nu + _SHIFTS.reshape(-1, *(1,) * nu.ndim)
    h = alias(gamma, s, sites, spring)  # s g = -h/s, g = -h/s^2, 1 + s^2 g = 1 - h
    hs = h / s
    tails = tail_coefficients(gamma, sites, spring)[0] @ _powers(nu * nu)
    r, b, c = tails.reshape(3, *nu.shape)
    return Regular(
        nu * r - hs.sum(0) / math.pi,
        b + (hs / s).sum(0) / math.pi,
        c + (1.0 + (1.0 - h).sum(0)) / math.pi,
    )


def regular_slopes(
    gamma: float, nu: Array, sites: int | None = None, spring: float = 0.0
) -> tuple[Regular, Regular, Regular]:
    """`regular` with its derivatives with respect to nu and to gamma."""
    s = nu + _SHIFTS.reshape(-1, *(1,) * nu.ndim)
    resolvent = sprung(gamma, s, spring) if spring else alias_slopes(gamma, s, sites)
    h, h_s, h_gamma = resolvent
    coefficients, in_gamma = tail_coefficients(gamma, sites, spring)
    powers = _powers(nu * nu)
    r, b, c, r_g, b_g, c_g = (np.concatenate([coefficients, in_gamma]) @ powers).reshape(
        6, *nu.shape
    )
    in_x = (coefficients[:, 1:] * np.arange(1, POWERS)) @ powers[:-1]
    r_x, b_x, c_x = 2.0 * nu * in_x.reshape(3, *nu.shape)
    value = Regular(
        nu * r - (h / s).sum(0) / math.pi,
        b + (h / (s * s)).sum(0) / math.pi,
        c + (1.0 + (1.0 - h).sum(0)) / math.pi,
    )
    in_nu = Regular(
        r + nu * r_x - ((h_s - h / s) / s).sum(0) / math.pi,
        b_x + ((h_s - 2.0 * h / s) / (s * s)).sum(0) / math.pi,
        c_x - h_s.sum(0) / math.pi,
    )
    by_gamma = Regular(
        nu * r_g - (h_gamma / s).sum(0) / math.pi,
        b_g + (h_gamma / (s * s)).sum(0) / math.pi,
        c_g - h_gamma.sum(0) / math.pi,
    )
    return value, in_nu, by_gamma


def slope_at_zero(gamma: float) -> float:
    """``R/nu + B`` of the infinite chain in the limit nu -> 0."""
    coefficients = tail_coefficients(gamma, None)[0]
    total = 0.0
    for m in range(1, EXACT + 1):
        h = 1.0 / math.sqrt(1.0 - gamma / (m * m))
        # s = +-2 m: h/s^2 of B, h/s^2 - h_s/s of R, where s h_s = h - h^3
        total += h * (1.0 + h * h) / (2 * m * m)
    return total / math.pi + float(coefficients[0, 0] + coefficients[1, 0])
