"""The isolated multipliers themselves: the zeros of D outside the unit circle.

Newton's method with the analytic derivative, from many starts at once, on the sheet of D that
continues the outside through the band; what it finds must agree with the winding number.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contbreather.errors import NotConverged
from contbreather.lattice.modes import InfiniteChain, check_gamma
from contbreather.stability.characteristic import NEAR, D_slope, continued_slope
from contbreather.stability.winding import check_kb, resolved_arc, unstable_count

Array = NDArray[Any]

STEPS = 40  # Newton steps allowed; 12 where a few good starts are tried first
ROUGH = 1e-9  # Newton's last step in nu for a root to count as found
ON_CIRCLE = 1e-13  # |Im nu| of a zero that may be on the circle
APART = 1e-7  # roots closer than this in nu are one
DEPTHS = (0.01, 0.05, 0.15, 0.4, 1.0)  # -Im nu of the starts: |mu| from 1.03 to 23


def _starts(gamma: float, k: float, b: float, more: int) -> Array:
    arc, F, _ = resolved_arc(gamma, k, b)
    real = np.log(np.array([1.001, 1.03, 1.1, 1.3, 2.0, 4.0, 16.0, 4.0 + 4.0 * abs(b)])) / math.pi
    across = np.linspace(0.0, 1.0, 6 * more)[:, None]
    depth = np.array(DEPTHS)
    starts = [-1j * real, 1.0 - 1j * real, (across - 1j * depth).ravel()]
    if gamma > 0.0:
        edge = 2.0 * math.sqrt(gamma)
        # Newton's first step off the arc, in alpha, from wherever a zero looks nearest
        speed = np.gradient(F, arc.alpha)
        likely = np.argsort(np.abs(F / speed))[: 6 * max(more, 1)]
        alpha = arc.alpha[likely] - (F / speed)[likely]
        near_arc = edge * np.sin(alpha.real + 1j * np.clip(alpha.imag, -1.0, 0.3))
        starts += [near_arc, edge * (1.0 + 0.1j * depth), (edge * (across - 0.1j * depth)).ravel()]
    return np.concatenate(starts)


def _fold_in(nu: Array) -> Array:
    """The mirror image with 0 <= Re nu <= 1: D at -conj(nu) and 2 - conj(nu) is conj(D)."""
    return np.abs((nu.real + 1.0) % 2.0 - 1.0) + 1j * nu.imag


def _slopes(gamma: float, k: float, b: float, nu: Array) -> tuple[Array, Array]:
    with np.errstate(all="ignore"):
        if np.all(np.abs(nu.imag) <= NEAR):
            return continued_slope(gamma, nu, k, b)
        value, slope = np.empty_like(nu), np.empty_like(nu)
        far = nu.imag < -NEAR
        value[far], slope[far] = D_slope(gamma, nu[far], k, b)
        value[~far], slope[~far] = continued_slope(gamma, nu[~far], k, b)
    return value, slope


def _step(gamma: float, k: float, b: float, nu: Array) -> Array:
    """Newton's step for D (1 - 1/mu) sqrt(1 - 2 cos(2 pi sqrt(gamma))/mu + 1/mu^2).

    These factors have no zeros outside, and take away the pole and the square roots of D.
    """
    value, slope = _slopes(gamma, k, b, nu)
    zeta = np.exp(-1j * math.pi * nu)
    cosine = math.cos(2.0 * math.pi * math.sqrt(gamma))
    with np.errstate(all="ignore"):
        roots = zeta * (cosine - zeta) / (1.0 - 2.0 * cosine * zeta + zeta * zeta)
        factors = 1j * math.pi * (zeta / (1.0 - zeta) + roots)  # log-derivative of the two
        return value / (slope + value * factors)


def _newton(gamma: float, k: float, b: float, nu: Array, steps: int = STEPS) -> Array:
    """Zeros with 0 <= Re nu <= 1 reached from the starts ``nu``, with repetitions."""
    found: list[Array] = []
    for _ in range(steps):
        step = _step(gamma, k, b, nu)
        size = np.abs(step)
        done = size < ROUGH
        found.append(_fold_in(nu[done] - step[done]))
        going = ~done & np.isfinite(step)
        nu, step, size = nu[going], step[going], size[going]
        # steps of at most a quarter keep a start in its own neighbourhood
        nu = _fold_in(nu - step * np.minimum(1.0, 0.25 / size))
        nu = nu[nu.imag < 0.5]  # far inside there is nothing to look for
        if nu.size == 0:
            break
    return np.concatenate(found)


def _distinct(nu: Array) -> Array:
    kept: list[complex] = []
    for x in nu[np.argsort(nu.imag)]:
        if all(abs(x - y) > APART for y in kept):
            kept.append(complex(x))
    return np.array(kept, dtype=complex)


def _on_axis(nu: Array) -> Array:
    """Real multipliers put exactly on the real axis."""
    for axis in (0.0, 1.0):
        nu = np.where(np.abs(nu.real - axis) < ROUGH, axis + 1j * nu.imag, nu)
    return nu


def _polish(gamma: float, k: float, b: float, nu: Array) -> Array:
    """Two more Newton steps; what does not hold is dropped."""
    for _ in range(2):
        step = _step(gamma, k, b, nu)
        nu = (nu - step)[np.abs(step) < ROUGH]
    return _on_axis(nu)


def _outside(gamma: float, k: float, b: float, more: int) -> Array:
    """Multipliers outside the circle or on it, the largest first, conjugates together."""
    nu = _distinct(_newton(gamma, k, b, _starts(gamma, k, b, more), STEPS if more else 12))
    nu = _polish(gamma, k, b, _on_axis(nu))
    nu = nu[nu.imag < ON_CIRCLE]
    nu = nu[np.argsort(nu.imag)]
    twice = np.where((nu.real == 0.0) | (nu.real == 1.0), 1, 2)  # a real one stands alone
    mu = np.repeat(np.exp(1j * math.pi * nu), twice)
    second = np.cumsum(twice)[twice == 2] - 1
    mu[second] = mu[second].conj()
    real = np.repeat(twice == 1, twice)
    mu[real] = mu[real].real
    return mu


def unstable_multipliers(
    gamma: float, k: float, b: float, lattice: object = InfiniteChain()  # noqa: B008
) -> Array:
    """Multipliers of QS outside the unit circle, largest first; conjugates next to each other.

    Parameters
    ----------
    gamma, k, b : float
        Coupling, restitution, off-diagonal entry of the saltation matrix (19).
    lattice : InfiniteChain

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
    array([1.15575192+0.j])
    """
    gamma = check_gamma(gamma)
    k, b = check_kb(k, b)
    wanted = unstable_count(gamma, k, b, lattice)
    mu = np.empty(0, dtype=complex)
    for more in (0, 1, 3, 9):
        if wanted.count:
            mu = _outside(gamma, k, b, more)
        # those on the circle to within rounding are outside only if the winding number says so
        if mu.size >= wanted.count and np.all(np.abs(mu[wanted.count :]) < 1.0 + 4.0 * ON_CIRCLE):
            return mu[: wanted.count]
    if not wanted.certain:  # one of them sits on the circle to within rounding
        return mu
    raise NotConverged(
        f"gamma = {gamma}, k = {k}, b = {b}: the winding number says {wanted.count} multipliers "
        f"outside the unit circle, Newton's method found {mu.size}: {mu}.",
        residual=wanted.distance,
    )
