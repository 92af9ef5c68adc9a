"""The characteristic function D(mu): its zeros are the multipliers the impact makes.

The half map QS differs from the free propagator Q = exp(pi A) in one 2x2 block, so mu is a
multiplier exactly where ``D = det(1 + (S0 - 1) G(mu)) = 0``, ``G = <(1 - mu Q_w^-1)^-1>`` a mean
over the modes. As G11 = G22, with c = 1 + k, ``D = (1 - c G11)^2 + G12 (b - c^2 G21)``.
We write mu = exp(i pi nu), so |mu| > 1 means Im nu < 0, and G as a sum over aliases nu + 2m
(`contbreather.stability.lattice_sums`). The alias m = 0, ``g = <1/(w^2 - nu^2)>``, is linear in D,

    D = (d + i c R)^2 + B (b - c^2 C) + (g/pi) L,   d = (1 - k)/2,
    L = 2 i c nu (d + i c R) - (b - c^2 C) - c^2 nu^2 B,

its square cancels: no accuracy is lost next to the band edges. On the band of the infinite chain
D is the limit from |mu| > 1; its continuation through the band has the sign of g reversed.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from contbreather.checks import shown
from contbreather.errors import BadInput
from contbreather.lattice import InfiniteChain, Ring, check_gamma
from contbreather.stability.lattice_sums import Regular, alias_slopes, regular, regular_slopes
from contbreather.stability.saltation import check_finite

Array = NDArray[Any]

NEAR = 1.0  # |Im nu| up to which aliases are summed; beyond, 24 modes are the infinite chain
MODES = 24  # the trapezoid rule's error is exp(-1.76 * 24) where |Im nu| >= 1


class RingModes(NamedTuple):
    """Frequencies w (those at theta and -theta together), their weights, cos and sin of pi w."""

    w: Array
    weight: Array
    cosine: Array
    sine_over_w: Array
    w_sine: Array


def checked(gamma: float, lattice: object) -> tuple[float, int | None, float]:
    """The coupling, None or the sites of a ring, and what holds every site to the ground."""
    if not isinstance(lattice, (InfiniteChain, Ring)):
        raise BadInput(
            f"lattice = {lattice!r}: stability is known for InfiniteChain() and Ring(sites)."
        )
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


class _Alias0(NamedTuple):
    g: Array
    g_nu: Array
    g_gamma: Array


def _within(gamma: float, nu: Array, spring: float) -> Array:
    """Where Re nu is in the band."""
    square = nu.real**2 - spring
    low = square >= 0.0 if spring == 0.0 else square > 0.0
    return low & (square < 4.0 * gamma)


def in_band(gamma: float, nu: Array, spring: float = 0.0) -> Array:
    return (nu.imag == 0.0) & _within(gamma, nu, spring)


def _alias0(
    gamma: float, nu: Array, sites: int | None, spring: float = 0.0, continued: bool = False
) -> _Alias0:
    """``g(nu) = <1/(w^2 - nu^2)>`` and slopes; inside the band the limit from Im nu < 0.

    ``continued``: also above the band, Im nu > 0, what comes through it from below.
    """
    # g = -1/((nu^2 - spring) sqrt(1 - z)); on the band its limit is -i/v, sqrt(1 - z) imaginary
    z = 4.0 * gamma / (nu * nu - spring)
    r = np.sqrt(1.0 - z)
    if sites is None:
        band = in_band(gamma, nu, spring)
        r = np.where(band, -1j * np.copysign(np.sqrt(np.abs(z - 1.0)), nu.real), r)
        if continued:
            r = np.where((nu.imag > 0.0) & _within(gamma, nu, spring), -r, r)
    if spring:  # g = -1/(A r), A = nu^2 - spring
        A = nu * nu - spring
        g, rise = -1.0 / (A * r), (2.0 * A - 4.0 * gamma) / (A * (A - 4.0 * gamma))
        return _Alias0(g, -g * nu * rise, 2.0 * g / (A - 4.0 * gamma))
    h, h_nu, h_gamma = alias_slopes(gamma, nu, sites, r)
    s2 = nu * nu
    return _Alias0(-h / s2, (2.0 * h / nu - h_nu) / s2, -h_gamma / s2)


def _strip(nu: ArrayLike) -> Array:
    """nu as complex array with Re nu in (-1, 1]: D has period 2."""
    try:
        values = np.array(nu, dtype=complex)
    except (TypeError, ValueError, OverflowError):
        values = np.array(math.nan)
    if not np.isfinite(values).all():
        raise BadInput(f"nu = {shown(nu)}: finite numbers were expected.")
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
    gamma, sites, spring = checked(gamma, lattice)
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
        g = _alias0(gamma, s, sites, spring).g
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
        return (smooth + _alias0(gamma, s, sites, spring).g * L / math.pi,)

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


class Split(NamedTuple):
    """``D = smooth + (g/pi) L``: both parts and their slopes in nu; g is the in-band alias."""

    smooth: Array
    L: Array
    smooth_nu: Array
    L_nu: Array


def smooth_and_L(nu: Array, k: float, b: float, value: Regular) -> tuple[Array, Array]:
    """The two parts of D, see the module's docstring."""
    R, B, C = value
    c, d = 1.0 + k, 0.5 * (1.0 - k)
    c2 = c * c
    beta, a = b - c2 * C, d + 1j * c * R
    return a * a + B * beta, 2j * c * nu * a - beta - c2 * nu * nu * B


def split(nu: Array, k: float, b: float, value: Regular, slope: Regular) -> Split:
    """`smooth_and_L` with slopes."""
    R, B, C = value
    R_nu, B_nu, C_nu = slope
    c, d = 1.0 + k, 0.5 * (1.0 - k)
    c2 = c * c
    beta, a, a_nu = b - c2 * C, d + 1j * c * R, 1j * c * R_nu
    return Split(
        *smooth_and_L(nu, k, b, value),
        2.0 * a * a_nu + B_nu * beta - c2 * B * C_nu,
        2j * c * (a + nu * a_nu) + c2 * (C_nu - 2.0 * nu * B - nu * nu * B_nu),
    )


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
    g, g_nu, _ = _alias0(gamma, nu, sites, spring, continued)
    value, slope, _ = regular_slopes(gamma, nu, sites, spring)
    part = split(nu, k, b, value, slope)
    return (
        part.smooth + g * part.L / math.pi,
        part.smooth_nu + (g_nu * part.L + g * part.L_nu) / math.pi,
    )


class Gradient(NamedTuple):
    """D and its partial derivatives, each shaped like nu."""

    value: Array
    d_nu: Array
    d_gamma: Array
    d_k: Array
    d_b: Array


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
    gamma, sites, spring = checked(gamma, lattice)
    x = _strip(nu)
    if np.any(np.abs(x.imag) > NEAR):
        raise BadInput(f"nu = {nu!r}: derivatives are known for |Im nu| <= {NEAR:g} only.")
    with np.errstate(divide="ignore", invalid="ignore"):
        g, g_nu, g_gamma = (part / math.pi for part in _alias0(gamma, x, sites, spring))
        (R, B, C), in_nu, in_gamma = regular_slopes(gamma, x, sites, spring)
        c, cc, a = 1.0 + k, (1.0 + k) ** 2, 0.5 * (1.0 - k) + 1j * (1.0 + k) * R
        # D = a^2 + B beta + (g/pi) (wave - beta), g with its 1/pi
        beta, wave = b - cc * C, 2j * c * x * a - cc * x * x * B
        by_b = B - g  # D is linear in beta

        def along(slope: Regular, dg: Array, dx: float) -> Array:
            da = 1j * c * slope.R
            dwave = 2j * c * (dx * a + x * da) - cc * x * (2.0 * dx * B + x * slope.B)
            direct = 2.0 * a * da + beta * (slope.B - dg) + dg * wave + g * dwave
            return np.asarray(direct - cc * by_b * slope.C)

        dwave_k = 2j * x * (a + c * (1j * R - 0.5)) - 2.0 * c * x * x * B
        in_k = 2.0 * a * (1j * R - 0.5) + g * dwave_k - 2.0 * c * by_b * C
        value = _finite(a * a + B * beta + g * (wave - beta), gamma, lattice)
        return Gradient(value, along(in_nu, g_nu, 1.0), along(in_gamma, g_gamma, 0.0), in_k, by_b)
