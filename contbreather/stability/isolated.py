"""The isolated multipliers themselves: the zeros of D outside the unit circle.

Newton's method with the analytic derivative, from many starts at once, on the sheet of D that
continues the outside through the band; what it finds must agree with the winding number.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from contbreather.errors import BadInput, NotConverged
from contbreather.lattice import InfiniteChain, Ring, check_gamma
from contbreather.stability.arc import angle, curve, sample
from contbreather.stability.characteristic import NEAR, D_slope, checked, near_slope
from contbreather.stability.counting import check_radius, resolved_arc, unstable_count
from contbreather.stability.ring_multipliers import even_multipliers
from contbreather.stability.saltation import check_kb
from contbreather.stability.zeros import distinct, multipliers_of, newton, on_axis

Array = NDArray[Any]

STEPS = 40  # Newton steps allowed; 12 where a few good starts are tried first
ROUGH = 1e-9  # Newton's last step in nu for a root to count as found
ON_CIRCLE = 1e-13  # |Im nu| of a zero that may be on the circle
RISKY = 1e-6  # of 1/4 - gamma: nearer, Newton's method finds zeros next to -1 that are none
NEXT_TO_EDGE = 1e-7  # how far outside they are
APART = 1e-7  # roots closer than this in nu are one
DEPTHS = (0.01, 0.05, 0.15, 0.4, 1.0)  # -Im nu of the starts: |mu| from 1.03 to 23


def _starts(gamma: float, k: float, b: float, spring: float, more: int) -> Array:
    arc, F, _ = resolved_arc(gamma, k, b, spring)
    real = np.log(np.array([1.001, 1.03, 1.1, 1.3, 2.0, 4.0, 16.0, 4.0 + 4.0 * abs(b)])) / math.pi
    across = np.linspace(0.0, 1.0, 6 * more)[:, None]
    depth = np.array(DEPTHS)
    starts = [-1j * real, 1.0 - 1j * real, (across - 1j * depth).ravel()]
    if gamma > 0.0:
        # Newton's first step off the arc, in alpha, from wherever a zero looks nearest
        with np.errstate(divide="ignore", invalid="ignore"):  # F is flat as gamma goes to 0
            step = np.nan_to_num(F / np.gradient(F, arc.alpha), nan=math.inf)
        likely = np.argsort(np.abs(step))[: 6 * max(more, 1)]
        alpha = arc.alpha[likely] - np.where(np.isfinite(step[likely]), step[likely], 0.0)
        near_arc = angle(gamma, alpha.real + 1j * np.clip(alpha.imag, -1.0, 0.3), spring)
        edge, floor = math.sqrt(spring + 4.0 * gamma), math.sqrt(spring)
        along = floor + (edge - floor) * across
        starts += [near_arc, edge * (1.0 + 0.1j * depth), (along - 0.1j * edge * depth).ravel()]
    return np.concatenate(starts)


def _fold_in(nu: Array) -> Array:
    """The mirror image with 0 <= Re nu <= 1: D at -conj(nu) and 2 - conj(nu) is conj(D). Far inside
    there is nothing to look for."""
    nu = nu[nu.imag < 0.5]
    return np.abs((nu.real + 1.0) % 2.0 - 1.0) + 1j * nu.imag


def _slopes(gamma: float, k: float, b: float, spring: float, nu: Array) -> tuple[Array, Array]:
    with np.errstate(all="ignore"):
        value, slope = near_slope(gamma, nu, k, b, None, spring, continued=True)
        far = nu.imag < -NEAR
        if np.any(far):
            value[far], slope[far] = D_slope(
                gamma, nu[far], k, b, InfiniteChain().with_spring(spring)
            )
    return value, slope


def _step(gamma: float, k: float, b: float, spring: float, nu: Array) -> Array:
    """Newton's step for D times ``sqrt(1 - 2 cos(pi w)/mu + 1/mu^2)`` at both edges w of the band.

    These factors have no zeros outside, and take away the square roots of D (without springs its
    pole at mu = 1).
    """
    value, slope = _slopes(gamma, k, b, spring, nu)
    zeta = np.exp(-1j * math.pi * nu)
    with np.errstate(all="ignore"):  # at the ends of the band themselves no step leads on
        factors = _log_slope(zeta, math.sqrt(spring + 4.0 * gamma))
        factors += _log_slope(zeta, math.sqrt(spring))
        return np.asarray(value / (slope + value * 1j * math.pi * factors))


def _log_slope(zeta: Array, w: float) -> Array:
    """Of one of those factors, by nu, over i pi."""
    cosine = math.cos(math.pi * w)
    if w == 0.0:
        return np.asarray(zeta / (1.0 - zeta))
    return np.asarray(zeta * (cosine - zeta) / (1.0 - 2.0 * cosine * zeta + zeta * zeta))


def _newton(
    gamma: float, k: float, b: float, spring: float, nu: Array, steps: int = STEPS
) -> Array:
    """Zeros with 0 <= Re nu <= 1 reached from the starts ``nu``, with repetitions."""
    return newton(lambda nu: _step(gamma, k, b, spring, nu), nu, steps, ROUGH, 0.25, _fold_in)


def _outside(gamma: float, k: float, b: float, spring: float, more: int) -> Array:
    """Multipliers outside the circle or on it, the largest first, conjugates together."""
    starts = _starts(gamma, k, b, spring, more)
    nu = _newton(gamma, k, b, spring, starts, STEPS if more else 12)
    nu = on_axis(distinct(nu[np.argsort(nu.imag)], APART))
    for _ in range(2):  # two more steps; what does not hold is dropped
        step = _step(gamma, k, b, spring, nu)
        nu = (nu - step)[np.abs(step) < ROUGH]
    return multipliers_of(nu[nu.imag < ON_CIRCLE])


def _chain_multipliers(gamma: float, k: float, b: float, chain: InfiniteChain) -> Array:
    wanted, spring = unstable_count(gamma, k, b, chain), chain.spring
    mu = np.empty(0, dtype=complex)
    for more in (0, 1, 3, 9):
        if wanted.count:
            mu = _outside(gamma, k, b, spring, more)
        # those on the circle to within rounding are outside only if the winding number says so;
        # next to gamma = 1/4 the band's edge comes so close to -1 that D is rounding there
        slack = NEXT_TO_EDGE if 0.25 * (1.0 - spring) - gamma < RISKY else 4.0 * ON_CIRCLE
        if mu.size >= wanted.count and np.all(np.abs(mu[wanted.count :]) < 1.0 + slack):
            return mu[: wanted.count]
    if not wanted.certain:  # one of them sits on the circle to within rounding
        return mu
    raise NotConverged(
        f"gamma = {gamma}, k = {k}, b = {b}: the winding number says {wanted.count} multipliers "
        f"outside the unit circle, Newton's method found {mu.size}: {mu}.",
        residual=wanted.distance,
    )


def unstable_multipliers(
    gamma: float, k: float, b: float, lattice: object = InfiniteChain(), *, radius: float = 1.0
) -> Array:
    """Multipliers of QS outside a circle, largest first; conjugates next to each other. Parameters
    and errors of bad input as of `unstable_count`.

    Returns
    -------
    ndarray of complex
        As many as `unstable_count` says, each to about 1e-14.

    Raises
    ------
    NotConverged
        If fewer or more zeros are found than the winding number asks for.

    Examples
    --------
    >>> unstable_multipliers(0.0, 0.8, 1.1)
    array([1.39793319+0.j])
    """
    gamma, sites, _ = checked(gamma, lattice)
    k, b = check_kb(k, b)
    check_radius(radius, sites)
    if sites is None:
        mu = _chain_multipliers(gamma, k, b, cast(InfiniteChain, lattice))
    else:
        mu = even_multipliers(Ring(sites), gamma, k, b)
        mu = mu[np.lexsort((-mu.imag, -np.round(np.abs(mu), 12)))]
    return mu[np.abs(mu) > radius] if radius > 1.0 else mu


class Approach(NamedTuple):
    """Where D comes closest to zero on the band: the angle/pi, and |F| there."""

    nu: float
    distance: float


def closest_approach(gamma: float, k: float, b: float, spring: float = 0.0) -> Approach:
    """Angle in the band at which a multiplier is nearest to coming out: the start for a NS point.

    A zero of D close by, outside or just inside (continued through the band), gives its angle;
    if Newton's method finds none, the angle where ``F = nu sqrt(4 gamma - nu^2) D`` is smallest.

    Raises
    ------
    BadInput
        At gamma = 0, where there is no band.

    Examples
    --------
    >>> from contbreather.stability.arc import neimark_sacker
    >>> angle, b = neimark_sacker(0.15, 0.7)[1]
    >>> bool(abs(closest_approach(0.15, 0.7, b).nu - angle) < 1e-12)
    True
    """
    gamma = check_gamma(gamma, spring)
    k, b = check_kb(k, b)
    if gamma == 0.0:
        raise BadInput("gamma = 0: without coupling there is no band to leave; take gamma > 0.")
    arc, F, _ = resolved_arc(gamma, k, b, spring)
    speed = np.gradient(F, arc.alpha)
    inner = slice(1, -1)  # F is small at the edges because v is
    best = 1 + int(np.argmin(np.abs(F[inner] / speed[inner])))
    alpha = arc.alpha[best] - F[best] / speed[best]
    floor, edge = math.sqrt(spring), math.sqrt(spring + 4.0 * gamma)
    start = angle(gamma, alpha.real + 1j * min(max(alpha.imag, -0.5), 0.5), spring)
    zeros = _newton(gamma, k, b, spring, np.array([start]), 12)
    zeros = zeros[(zeros.real > floor) & (zeros.real < edge) & (np.abs(zeros.imag) < edge)]
    nu = float(zeros[0].real) if zeros.size else float(arc.nu[best])
    share = (nu * nu - spring) / (4.0 * gamma)
    place = sample(gamma, np.array([math.asin(math.sqrt(min(max(share, 0.0), 1.0)))]), spring)
    return Approach(nu, float(np.abs(curve(place, k, b)[0][0])))
