"""The characteristic function D(mu): its zeros are the multipliers the impact makes.

The half map QS differs from the free propagator Q = exp(pi A) in one 2x2 block, so mu is a
multiplier exactly where ``D = det(1 + (S0 - 1) G(mu)) = 0``, ``G = <(1 - mu Q_w^-1)^-1>`` a mean
over the modes. As G11 = G22, with c = 1 + k, ``D = (1 - c G11)^2 + G12 (b - c^2 G21)``.
We write mu = exp(i pi nu), so |mu| > 1 means Im nu < 0. Sampled once per half period, a frequency s
cannot be told from s + 2m: so G is a sum of the lattice's resolvent ``g(s) = <1/(w^2 - s^2)>`` over
all aliases ``s_m = nu + 2m``. Only ``s_0 = nu`` can lie in the band; the others make up

    R = (1/pi) sum' s_m g(s_m),  B = -(1/pi) sum' g(s_m),  C = (1/pi) (1 + sum' (1 + s_m^2 g(s_m)))

(sums over m != 0), which are analytic for |Re nu| <= 1 and real for real nu. The six nearest
aliases are exact; the rest, |s_m| >= 7, is expanded in 1/s_m^2 and then in nu, where the sums over
m are Hurwitz zeta functions: a polynomial in nu^2 with coefficients depending on gamma. The alias
m = 0, ``g = <1/(w^2 - nu^2)>``, is linear in D,

    D = (d + i c R)^2 + B (b - c^2 C) + (g/pi) L,   d = (1 - k)/2,
    L = 2 i c nu (d + i c R) - (b - c^2 C) - c^2 nu^2 B,

its square cancels: no accuracy is lost next to the band edges. On the band of the infinite chain
D is the limit from |mu| > 1; its continuation through the band has the sign of g reversed.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from contbreather.checks import brief
from contbreather.errors import BadInput
from contbreather.lattice.band_averages import check_gamma
from contbreather.lattice.chain import InfiniteChain, Ring
from contbreather.lattice.zeta import binomial, zeta
from contbreather.stability.band_pairs import (
    EXACT,
    ORDERS,
    POWERS,
    plus,
    resolvent_changes,
    share,
    share_along,
    smooth_and_L,
    smooth_and_L_slopes,
)
from contbreather.stability.saltation import check_finite, check_lattice

Array = NDArray[Any]  # real on the real axis, complex off it

NEAR = 1.0  # |Im nu| up to which aliases are summed; beyond, 24 modes are the infinite chain
MODES = 24  # the trapezoid rule's error is exp(-1.76 * 24) where |Im nu| >= 1
_SHIFTS = 2.0 * np.array([m for m in range(-EXACT, EXACT + 1) if m != 0])


class Regular(NamedTuple):
    """R, B, C, shaped like nu."""

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


def resolvent(
    gamma: float, s: Array, sites: int | None = None, spring: float = 0.0, r: Array | None = None
) -> Array:
    """``g(s) = <1/(w^2 - s^2)>`` of the chain (``sites=None``) or a ring, off the band; on it with
    the root ``r = sqrt(1 - 4 gamma/A)`` of one side, ``A = s^2 - spring``."""
    A = s * s - spring
    r = np.sqrt(1.0 - 4.0 * gamma / A) if r is None else r
    lap = _lap(gamma, A, r, sites)
    return np.asarray(-(1.0 + lap) / ((1.0 - lap) * A * r))


def _lap(gamma: float, A: Array, r: Array, sites: int | None) -> Any:
    """What is left of a wave once around the ring: x^N with x + 1/x = 2 - s^2/gamma."""
    # z/(1 + r)^2 is (1 - r)/(1 + r), without the difference
    return 0.0 if sites is None else np.asarray((-4.0 * gamma / (A * (1.0 + r) ** 2)) ** sites)


class Resolvent(NamedTuple):
    """g at some frequencies, and its derivatives in s and gamma."""

    g: Array
    g_s: Array
    g_gamma: Array


def resolvent_slopes(
    gamma: float, s: Array, sites: int | None = None, spring: float = 0.0, r: Array | None = None
) -> Resolvent:
    """`resolvent` with derivatives."""
    A = s * s - spring
    if sites == 1:  # a single oscillator knows no coupling
        return Resolvent(-1.0 / A, 2.0 * s / (A * A), np.zeros_like(s))
    edge = A - 4.0 * gamma
    r = np.sqrt(1.0 - 4.0 * gamma / A) if r is None else r
    lap = _lap(gamma, A, r, sites)
    g = np.asarray(-(1.0 + lap) / ((1.0 - lap) * A * r))
    # the logarithm of a lap falls as that of s^2 rises, by N/r
    by_s, by_gamma, _ = resolvent_changes(s, A, edge)
    if sites is not None and gamma > 0.0:
        turn = 2.0 * sites * lap / ((1.0 - lap * lap) * r)
        by_s, by_gamma = by_s - 2.0 * turn / s, by_gamma + turn / gamma
    return Resolvent(g, g * by_s, g * by_gamma)


def _powers(x: Array) -> Array:
    """1, x, x^2 ... as rows, x flattened."""
    rows = np.empty((POWERS, x.size), dtype=x.dtype)
    rows[0] = 1.0
    rows[1:] = x.ravel()
    return np.multiply.accumulate(rows, axis=0, out=rows)


def regular(gamma: float, nu: Array, sites: int | None = None, spring: float = 0.0) -> Regular:
    """R, B, C at ``|Re nu| <= 1, |Im nu| <= 1`` (real arithmetic for real nu)."""
    s = nu + _SHIFTS.reshape(-1, *(1,) * nu.ndim)
    tails = tail_coefficients(gamma, sites, spring)[0] @ _powers(nu * nu)
    return _summed(nu, s, resolvent(gamma, s, sites, spring), tails.reshape(3, *nu.shape))


def _summed(nu: Array, s: Array, g: Array, tails: Array) -> Regular:
    """R, B, C by the nearest aliases s and the tails of R/nu, B, C."""
    r, b, c = tails
    return Regular(*plus((nu * r, b, c + 1.0 / math.pi), _sums(share(s, g, 1.0))))


def _sums(shares: tuple[Array, ...]) -> list[Array]:
    return [part.sum(0) for part in shares]


def regular_slopes(
    gamma: float, nu: Array, sites: int | None = None, spring: float = 0.0
) -> tuple[Regular, Regular, Regular]:
    """`regular` with its derivatives with respect to nu and to gamma."""
    s = nu + _SHIFTS.reshape(-1, *(1,) * nu.ndim)
    g, g_s, g_gamma = resolvent_slopes(gamma, s, sites, spring)
    coefficients, in_gamma = tail_coefficients(gamma, sites, spring)
    powers = _powers(nu * nu)
    both = (np.concatenate([coefficients, in_gamma]) @ powers).reshape(2, 3, *nu.shape)
    tails, (r_g, b_g, c_g) = both
    in_x = (coefficients[:, 1:] * np.arange(1, POWERS)) @ powers[:-1]
    r_x, b_x, c_x = 2.0 * nu * in_x.reshape(3, *nu.shape)
    in_nu = plus((tails[0] + nu * r_x, b_x, c_x), _sums(share_along(s, g, g_s)))
    by_gamma = plus((nu * r_g, b_g, c_g), _sums(share(s, g_gamma, 0.0)))
    return _summed(nu, s, g, tails), Regular(*in_nu), Regular(*by_gamma)


@lru_cache(maxsize=64)
def slope_at_zero(gamma: float) -> float:
    """``R/nu + B`` of the infinite chain in the limit nu -> 0."""
    # of each alias s: g + s g_s of R, -g of B
    near = (_SHIFTS * resolvent_slopes(gamma, _SHIFTS).g_s).sum() / math.pi
    return float(near + tail_coefficients(gamma, None)[0][:2, 0].sum())


# --- D --------------------------------------------------------------------------------------------


class RingModes(NamedTuple):
    """Frequencies w (those at theta and -theta together), their weights, cos and sin of pi w."""

    w: Array
    weight: Array
    cosine: Array
    sine_over_w: Array
    w_sine: Array


def checked_chain(gamma: float, lattice: object) -> tuple[float, int | None, float]:
    """The coupling, None or the sites of a ring, and what holds every site to the ground."""
    lattice = check_lattice(lattice)
    return check_gamma(gamma, lattice.spring), lattice.sites, lattice.spring


def modes(gamma: float, sites: int, spring: float = 0.0) -> RingModes:
    """The even modes of a ring: all of them that the impacting site sees."""
    _, weight, w = Ring(sites).nodes(gamma)
    w = np.sqrt(w * w + spring) if spring else w
    sine = np.sin(np.pi * w)
    # np.sinc(w) = sin(pi w)/(pi w) has its limit at w = 0
    return RingModes(w, weight, np.cos(np.pi * w), np.pi * np.sinc(w), w * sine)


def mode_sums(mu: Array, modes: RingModes) -> tuple[Array, Array, Array, Array, Array, Array]:
    """G11, G12, G21 and their derivatives in mu, as plain sums: any mu that is no mode's own."""
    z = np.asarray(mu)[..., None]
    large = np.abs(z) > 1.0
    t = np.where(large, 1.0 / np.where(large, z, 1.0), z)  # |t| <= 1
    # (1 - mu Q_w^-1)^-1 = (1 - mu Q_w)/(1 - 2 mu cos(pi w) + mu^2), beyond 1 by 1/mu: no overflow
    q = 1.0 / (1.0 - 2.0 * t * modes.cosine + t * t)
    scale = np.where(large, t * t, 1.0) * q  # = 1/(1 - 2 mu cos + mu^2)
    slope = 2.0 * (modes.cosine - z) * scale  # d ln scale/d mu
    first = scale * (1.0 - z * modes.cosine)
    other = -z * scale
    first_mu = first * slope - modes.cosine * scale
    other_mu = -scale * (1.0 + z * slope)
    s, t21 = modes.sine_over_w * modes.weight, -modes.w_sine * modes.weight
    return (
        first @ modes.weight,
        other @ s,
        other @ t21,
        first_mu @ modes.weight,
        other_mu @ s,
        other_mu @ t21,
    )


def determinant(mu: Array, modes: RingModes, k: float, b: float) -> tuple[Array, Array]:
    """D and dD/dmu by `mode_sums`: exact on a ring, and for |mu| far from 1 on the chain."""
    g11, g12, g21, g11_mu, g12_mu, g21_mu = mode_sums(mu, modes)
    c = 1.0 + k
    a, f = 1.0 - c * g11, b - c * c * g21  # D = a^2 + G12 f
    value = a * a + g12 * f
    return value, -2.0 * c * a * g11_mu + g12_mu * f - c * c * g12 * g21_mu


def _within(gamma: float, nu: Array, spring: float) -> Array:
    """Where Re nu is in the band."""
    square = nu.real**2 - spring
    low = square >= 0.0 if spring == 0.0 else square > 0.0
    return low & (square < 4.0 * gamma)


def _root(
    gamma: float, nu: Array, sites: int | None, spring: float = 0.0, continued: bool = False
) -> Array:
    """``sqrt(1 - 4 gamma/(nu^2 - spring))`` for `resolvent`; inside the band the limit from below.

    ``continued``: also above the band, Im nu > 0, what comes through it from below.
    """
    z = 4.0 * gamma / (nu * nu - spring)
    r = np.sqrt(1.0 - z)
    if sites is None:
        # on the band the limit of g is -i/v, sqrt(1 - z) imaginary
        within = _within(gamma, nu, spring)
        limit = -1j * np.copysign(np.sqrt(np.abs(z - 1.0)), nu.real)
        r = np.where(within & (nu.imag == 0.0), limit, r)
        if continued:
            r = np.where(within & (nu.imag > 0.0), -r, r)
    return np.asarray(r)


def _strip(nu: ArrayLike) -> Array:
    """nu as complex array with Re nu in (-1, 1]: D has period 2."""
    try:
        values = np.array(nu, dtype=complex)
    except (TypeError, ValueError, OverflowError):
        values = np.array(math.nan)
    if not np.isfinite(values).all():
        raise BadInput(f"nu = {brief(nu)}: finite numbers were expected.")
    outside = (values.real > 1.0) | (values.real <= -1.0)
    if np.any(outside):
        values = np.where(outside, values - 2.0 * np.ceil((values.real - 1.0) / 2.0), values)
    return values


def _by_depth(
    gamma: float,
    nu: ArrayLike,
    lattice: object,
    rows: int,
    near: Callable[..., tuple[Array, ...]],
    far: Callable[[Array, RingModes], tuple[Array, ...]],
) -> Array:
    """What ``near(gamma, nu, sites, spring)`` makes of it by aliases, and ``far(mu, modes)`` beyond
    `NEAR`: a row for each number they answer, shaped like nu."""
    gamma, sites, spring = checked_chain(gamma, lattice)
    values = _strip(nu)
    flat = values.ravel()
    deep = np.abs(flat.imag) > NEAR
    entries = np.empty((rows, flat.size), dtype=complex)
    if not np.all(deep):
        with np.errstate(divide="ignore", invalid="ignore"):
            entries[:, ~deep] = near(gamma, flat[~deep], sites, spring)
    if np.any(deep):
        few = modes(gamma, MODES if sites is None else min(sites, MODES), spring)
        entries[:, deep] = far(np.exp(1j * np.pi * flat[deep]), few)
    return _finite(entries.reshape(rows, *values.shape), gamma, lattice)


def _finite(value: Array, gamma: float, lattice: object) -> Array:
    if np.all(np.isfinite(value)):
        return value
    raise BadInput(
        f"D has a pole at mu = 1 (nu = 0) and at the band's edges, on a ring at each mode "
        f"(gamma = {gamma}, {lattice}): ask beside it."
    )


def G(gamma: float, nu: ArrayLike, lattice: object = InfiniteChain()) -> Array:
    """Mean resolvent ``G = <(1 - mu Q_w^-1)^-1>`` of the half period, mu = exp(i pi nu).

    Parameters
    ----------
    gamma : float
        Coupling in [0, 1/4).
    nu : array_like of complex
        |mu| > 1 where Im nu < 0. Real nu inside the infinite chain's band: the limit from there.
    lattice : InfiniteChain or Ring

    Returns
    -------
    ndarray of complex, shape ``(*nu.shape, 2, 2)``; absolute error about 1e-15 times its size.

    Raises
    ------
    BadInput
        At a pole: mu = 1, a band edge, a mode of the ring.

    Examples
    --------
    >>> chi = 2 * float(G(0.12, 1.0)[0, 1].real)  # G12 at mu = -1, eq. (10)
    >>> round(chi, 12)
    2.067873970394
    """

    def near(gamma: float, s: Array, sites: int | None, spring: float) -> tuple[Array, ...]:
        g = resolvent(gamma, s, sites, spring, _root(gamma, s, sites, spring))
        R, B, C = regular(gamma, s, sites, spring)
        g11 = 0.5 - 1j * (R + s * g / math.pi)
        return g11, B - g / math.pi, C + s * s * g / math.pi

    g11, g12, g21 = _by_depth(gamma, nu, lattice, 3, near, lambda mu, few: mode_sums(mu, few)[:3])
    return np.moveaxis(np.array([[g11, g12], [g21, g11]]), (0, 1), (-2, -1))


def D(gamma: float, nu: ArrayLike, k: float, b: float, lattice: object = InfiniteChain()) -> Array:
    """Characteristic function: zero where mu = exp(i pi nu) is a multiplier of QS.

    Only multipliers of even modes: the odd ones are ``exp(+-i pi w)`` exactly. D -> 1 as
    |mu| -> infinity. Parameters and errors as for `G`; k and b are those of `saltation`.

    Examples
    --------
    >>> abs(D(0.0, 1j, 0.8, 1.0) - D(0.0, 1j, 0.8, 1.0, Ring(1))) < 1e-15
    np.True_
    """
    check_finite(k, b)

    def near(gamma: float, s: Array, sites: int | None, spring: float) -> tuple[Array]:
        smooth, L = smooth_and_L(s, k, b, regular(gamma, s, sites, spring))
        g = resolvent(gamma, s, sites, spring, _root(gamma, s, sites, spring))
        return (smooth + g * L / math.pi,)

    return _by_depth(gamma, nu, lattice, 1, near, lambda mu, few: determinant(mu, few, k, b)[:1])[0]


def D_slope(
    gamma: float, nu: ArrayLike, k: float, b: float, lattice: object = InfiniteChain()
) -> tuple[Array, Array]:
    """D and its analytic derivative dD/dnu; see `D`."""
    check_finite(k, b)

    def near(gamma: float, s: Array, sites: int | None, spring: float) -> tuple[Array, Array]:
        return near_slope(gamma, s, k, b, sites, spring)

    def far(mu: Array, few: RingModes) -> tuple[Array, Array]:
        value, slope = determinant(mu, few, k, b)
        return value, 1j * np.pi * mu * slope

    value, slope = _by_depth(gamma, nu, lattice, 2, near, far)
    return value, slope


def near_slope(
    gamma: float,
    nu: Array,
    k: float,
    b: float,
    sites: int | None,
    spring: float = 0.0,
    continued: bool = False,
) -> tuple[Array, Array]:
    """D and dD/dnu by aliases, for |Im nu| <= 1; neither finite nor checked at the poles.

    ``continued`` from the outside through the band of the infinite chain it has zeros just inside:
    resonances, multipliers-to-be.
    """
    r = _root(gamma, nu, sites, spring, continued)
    g, g_nu, _ = resolvent_slopes(gamma, nu, sites, spring, r)
    value, slope, _ = regular_slopes(gamma, nu, sites, spring)
    smooth, L = smooth_and_L(nu, k, b, value)
    smooth_nu, L_nu = smooth_and_L_slopes(nu, k, b, value, slope, 1.0, 0.0, 0.0)
    return smooth + g * L / math.pi, smooth_nu + (g_nu * L + g * L_nu) / math.pi


class Gradient(NamedTuple):
    """D, or F of `arc`, and its partial derivatives, each of one shape."""

    value: Array
    d_nu: Array
    d_gamma: Array
    d_k: Array
    d_b: Array
    d_spring: Any = 0.0


def D_gradient(
    gamma: float, nu: ArrayLike, k: float, b: float, lattice: object = InfiniteChain()
) -> Gradient:
    """D with its derivatives in nu and in every parameter, all analytic.

    What Newton's method needs to follow a multiplier, for instance one of a ring on the circle of
    the paper's threshold. Parameters and errors as for `D`, but only for ``|Im nu| <= 1``.

    Examples
    --------
    >>> F = D_gradient(0.1, 0.4 - 0.1j, 0.8, 0.3, Ring(40))
    >>> change = D(0.1, 0.4 - 0.1j, 0.8, 0.3 + 1e-6, Ring(40)) - F.value
    >>> bool(abs(change / 1e-6 - F.d_b) < 1e-6)
    True
    """
    check_finite(k, b)
    gamma, sites, spring = checked_chain(gamma, lattice)
    x = _strip(nu)
    if np.any(np.abs(x.imag) > NEAR):
        raise BadInput(f"nu = {nu!r}: derivatives are known for |Im nu| <= {NEAR:g} only.")
    with np.errstate(divide="ignore", invalid="ignore"):
        alias = resolvent_slopes(gamma, x, sites, spring, _root(gamma, x, sites, spring))
        g, g_nu, g_gamma = (part / math.pi for part in alias)
        value, in_nu, in_gamma = regular_slopes(gamma, x, sites, spring)
        smooth, L = smooth_and_L(x, k, b, value)
        at, still = (x, k, b, value), (0.0, 0.0, 0.0)
        smooth_nu, L_nu = smooth_and_L_slopes(*at, in_nu, 1.0, 0.0, 0.0)
        smooth_gamma, L_gamma = smooth_and_L_slopes(*at, in_gamma, 0.0, 0.0, 0.0)
        smooth_k, L_k = smooth_and_L_slopes(*at, still, 0.0, 1.0, 0.0)
        return Gradient(
            _finite(smooth + g * L, gamma, lattice),
            smooth_nu + g_nu * L + g * L_nu,
            smooth_gamma + g_gamma * L + g * L_gamma,
            smooth_k + g * L_k,
            value.B - g,
        )
