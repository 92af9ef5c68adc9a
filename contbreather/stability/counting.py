"""How many multipliers of QS lie strictly outside the circle: a winding number, no N, no threshold;
and these themselves, the zeros of D there.

D is analytic outside, D -> 1 far away; so on the infinite chain the count is the turning of D along
the unit circle, by symmetry along its upper half. There, in turn,

- next to mu = 1, D has a pole whose sign is that of ``beta0 = b - c^2 psi/2`` (zero: pitchfork);
- on the band, F = v D (`contbreather.stability.arc`) is a bounded curve from ``i beta0/pi`` to a
  point in the right half plane; it is sampled, and refined where it moves by much of its modulus;
- between the band and mu = -1, ``Im D = 2 c d R`` has one sign (R < 0 there): no turning but what
  the signs at its two ends say, and D(-1) is real (zero: fold).

Summed up: ``count = [beta0 > 0] + [D(-1) < 0] + 2 pairs``, where ``pairs`` is how often F crosses
the negative real axis upwards, less how often downwards. As F vanishes for at most two values of b,
each in closed form, there is one pair between them (`contbreather.stability.arc.window`) and none
elsewhere: a second way, and the only one at k = 1, where zeros between the band and -1, on the
circle, are neutral. A count is certain where both ways agree.

They are found by Newton's method with the analytic derivative, from many starts at once, on the
sheet of D that continues the outside through the band; that must agree with the winding number.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from contbreather.checks import real
from contbreather.errors import BadInput, NotConverged
from contbreather.lattice.band_averages import check_gamma
from contbreather.lattice.chain import InfiniteChain, Ring
from contbreather.stability.arc import (
    NOISE,
    curve,
    ends_of,
    resolved_arc,
    sample,
    values_at_ends,
    wave_frequency,
    window,
)
from contbreather.stability.characteristic import NEAR, D, D_slope, checked_chain, near_slope
from contbreather.stability.ring_multipliers import even_multipliers
from contbreather.stability.saltation import check_kb
from contbreather.stability.zeros import (
    as_counted,
    distinct,
    multipliers_of,
    newton_from_all,
    on_axis,
    refined_samples,
)
from contbreather.tables import HtmlRepr, Sheet, yes_or_no

Array = NDArray[Any]

ROUNDING = 1e-13  # of F's own terms: closer than that to zero, a count is not certain
EDGE = 1e-10  # of 1/4 - gamma: nearer, the band's edge and -1 are told apart by rounding
CLOSE = 1e-5  # of its terms: what many counts at once leave to one by one
MOST = 2**20  # samples on a circle, when a ring's count asks for more there is no telling


@dataclass(frozen=True)
class Count(HtmlRepr):
    """Multipliers strictly outside the circle: a count, and how sure it is.

    ``distance`` is the smallest modulus met, relative to the size of the terms that cancel there;
    it happens at ``mu = exp(i pi nu)``. Where it is below rounding, a multiplier sits on the
    circle: the parameters are a bifurcation, and ``certain`` is False; so it is next to
    gamma = 1/4. ``pairs`` is half the count
    without the two whose presence the signs of D on the real axis betray, one above 1 and one
    below -1: it changes where complex pairs cross the circle, and nowhere else on it.
    """

    count: int
    certain: bool
    distance: float
    nu: float
    pairs: int

    def __int__(self) -> int:
        return self.count

    def table(self) -> Sheet:
        """The count, how sure it is, and where a multiplier is closest to the circle."""
        return Sheet.of([
            ("multipliers outside", self.count), ("complex pairs of them", self.pairs),
            ("certain", yes_or_no(self.certain)), ("least modulus", self.distance),
            ("at nu", self.nu),
        ])  # fmt: skip


def check_radius(radius: float, sites: int | None) -> None:
    """Refuse a circle outside which multipliers cannot be counted."""
    if sites is not None and 4 * sites > MOST:
        raise BadInput(
            f"{sites} sites: multipliers are counted on rings of up to {MOST // 4}; for longer "
            "ones ask about the infinite chain."
        )
    if 1.0 < real(radius) < math.inf or (real(radius) == 1.0 and sites is None):
        return
    raise BadInput(
        f"radius = {radius}: multipliers are counted outside a circle of radius 1 (infinite chain "
        "only, a ring has its band on that circle) or more."
    )


def _crossings(F: Array, noise: float) -> int:
    """Crossings of the negative real axis, upwards less downwards, of a resolved curve."""
    F = F[np.abs(F) > noise]
    above = F.imag > 0.0
    i = np.flatnonzero(above[1:] != above[:-1])
    if i.size == 0:
        return 0
    start, end = F[i], F[i + 1]
    t = start.imag / (start.imag - end.imag)  # where the chord meets the real axis
    left = start.real + t * (end.real - start.real) < 0.0
    up = np.where(above[i + 1], 1, -1)
    return int(np.sum(up[left]))


def _cleared(gamma: float, k: float, b: float, chain: InfiniteChain) -> tuple[float, ...]:
    """`ends_of`, where rounding is 0: a multiplier on the circle is not outside."""
    beta0, beta0_size, fold, fold_size = ends_of(gamma, k, b, chain)
    beta0 = beta0 if abs(beta0) > ROUNDING * beta0_size else 0.0
    return beta0, beta0_size, fold if abs(fold) > ROUNDING * fold_size else 0.0, fold_size


def _chain_count(gamma: float, k: float, b: float, chain: InfiniteChain) -> Count:
    beta0, beta0_size, fold, fold_size = _cleared(gamma, k, b, chain)
    arc, F, _ = resolved_arc(gamma, k, b, chain.spring)
    size = np.abs(F[1:-1]) / (abs(b) + 1.0)  # the terms of F are of order b and 1
    i = int(size.argmin())
    distances = (abs(beta0) / beta0_size, float(size[i]), abs(fold) / fold_size)
    nearest = int(np.argmin(distances))
    where = (0.0, float(arc.nu[i + 1]), 1.0)[nearest]
    miss = window(gamma, k, chain.spring).miss(b)
    room = 0.25 * (1.0 - chain.spring) - gamma  # of the edge sqrt(spring + 4 gamma) up to nu = 1
    pairs = int(miss < -ROUNDING)
    certain = min(distances[nearest], abs(miss)) > ROUNDING + 1e-16 / room and room > EDGE
    if k < 1.0 and gamma > 0.0:
        certain &= pairs == _crossings(F, NOISE * (abs(b) + 1.0))
    return Count(_total(beta0, fold, pairs), certain, distances[nearest], where, pairs)


def _total(beta0: float, fold: float, pairs: int) -> int:
    return int(beta0 > 0.0) + int(fold < 0.0) + 2 * pairs


def count_on_chain(gamma: float, k: float, b: float, chain: InfiniteChain) -> int:
    """The count of `unstable_count` on the infinite chain, by the second way alone."""
    gamma = check_gamma(gamma, chain.spring)
    k, b = check_kb(k, b)
    beta0, _, fold, _ = _cleared(gamma, k, b, chain)
    return _total(beta0, fold, int(window(gamma, k, chain.spring).miss(b) < -ROUNDING))


def many_outside(gamma: Array, k: Array, b: Array) -> NDArray[np.int64]:
    """`count_on_chain` of many maps of the chain without springs at once; -1 where that is too
    close to call, or not for such numbers."""
    counts = np.full(b.size, -1)
    inside = (gamma > 0.0) & (gamma < 0.25) & (k >= 0.0) & (k < 1.0) & (abs(b) < 1.0 / NOISE)
    if inside.any():
        counts[inside] = _outside(gamma[inside], k[inside], b[inside])
    return counts


def _outside(gamma: Array, k: Array, b: Array) -> Array:
    places, which = np.unique(np.stack([gamma, k]), axis=1, return_inverse=True)
    windows = np.array([window(*place)[:2] for place in places.T.tolist()])
    centre, square = windows[which.ravel()].T
    psi, eta, chi = (InfiniteChain().averages(gamma, name) for name in ("psi", "eta", "chi"))
    beta0, beta0_size, fold, fold_size = values_at_ends(k, b, psi, eta, chi)
    # each as a sum of terms, whose size is known
    signs = beta0, -fold, square - (b - centre) ** 2
    sizes = beta0_size, fold_size, 1.0 + b * b
    certain = np.all([abs(x) > CLOSE * size for x, size in zip(signs, sizes, strict=True)], axis=0)
    above, below, pairs = (x > 0.0 for x in signs)
    return np.where(certain, above + 1 * below + 2 * pairs, -1)


def _circle_count(gamma: float, k: float, b: float, lattice: Any, radius: float) -> Count:
    """Turning of D along a circle outside all its poles."""
    depth, spring = -math.log(radius) / math.pi, lattice.spring
    band = wave_frequency(
        gamma, np.linspace(0.0, 0.5 * math.pi, 2 * (lattice.sites or 1) + 33), spring
    )
    below = np.linspace(0.0, band[0], 33)[:-1] if spring else band[:0]
    x = np.concatenate([below, band, np.linspace(band[-1], 1.0, 33)[1:]])
    x, values, enough = refined_samples(
        x, lambda x: x + 1j * depth, lambda nu: D(gamma, nu, k, b, lattice), 0.0, MOST
    )
    if not enough:
        raise NotConverged(
            f"D turns too fast on the circle of radius {radius} to count its zeros outside "
            f"({lattice}): take a radius farther from 1."
        )
    turning = float(np.sum(np.angle(values[1:] * values[:-1].conj())))
    size = np.abs(values) / (abs(b) + 1.0)
    i = int(size.argmin())
    # D -> 1 far out without a pole: a zero outside turns it by -2 pi, -pi on half the circle
    count = round(-turning / math.pi)
    # a real zero beyond either end where D, 1 at infinity, is negative
    pairs = (count - int(values[0].real < 0.0) - int(values[-1].real < 0.0)) // 2
    return Count(count, bool(size[i] > ROUNDING), float(size[i]), float(x[i]), pairs)


def unstable_count(
    gamma: float, k: float, b: float, lattice: object = InfiniteChain(), *, radius: float = 1.0
) -> Count:
    """Number of isolated multipliers of QS outside a circle, a complex pair counting two.

    Parameters
    ----------
    gamma, k, b : float
        Coupling, restitution, off-diagonal entry of the saltation matrix (19).
    lattice : InfiniteChain or Ring
    radius : float
        Count ``|mu| > radius``. 1 on the infinite chain: the exact question of stability, answered
        on the unit circle itself. A ring has multipliers on that circle, so it needs a radius
        above 1; the paper's rule ``|mu|^2 > 1.005`` has radius ``sqrt(1.005)``.

    Returns
    -------
    Count

    Raises
    ------
    BadInput
        For gamma outside [0, 1/4), k outside [0, 1], a radius below 1, or 1 on a ring.

    Examples
    --------
    >>> unstable_count(0.1144, 0.8, 0.236).count, unstable_count(0.1144, 0.8, 0.235).count
    (0, 2)
    """
    gamma, sites, _ = checked_chain(gamma, lattice)
    k, b = check_kb(k, b)
    check_radius(radius, sites)
    if radius == 1.0:
        return _chain_count(gamma, k, b, cast(InfiniteChain, lattice))
    return _circle_count(gamma, k, b, lattice, float(radius))


# --- the multipliers themselves -------------------------------------------------------------------

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
        near_arc = wave_frequency(gamma, alpha.real + 1j * np.clip(alpha.imag, -1.0, 0.3), spring)
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
    return newton_from_all(
        lambda nu: _step(gamma, k, b, spring, nu), nu, steps, ROUGH, 0.25, _fold_in
    )


def _zeros(gamma: float, k: float, b: float, spring: float, more: int) -> Array:
    """Multipliers outside the circle or on it, the largest first, conjugates together."""
    starts = _starts(gamma, k, b, spring, more)
    nu = _newton(gamma, k, b, spring, starts, STEPS if more else 12)
    nu = on_axis(distinct(nu[np.argsort(nu.imag)], APART))
    for _ in range(2):  # two more steps; what does not hold is dropped
        step = _step(gamma, k, b, spring, nu)
        nu = (nu - step)[np.abs(step) < ROUGH]
    return multipliers_of(nu[nu.imag < ON_CIRCLE])


def _chain_multipliers(gamma: float, k: float, b: float, chain: InfiniteChain) -> Array:
    # next to gamma = 1/4 the band's edge comes so close to -1 that D is rounding there
    risky = 0.25 * (1.0 - chain.spring) - gamma < RISKY
    return as_counted(
        unstable_count(gamma, k, b, chain),
        lambda more: _zeros(gamma, k, b, chain.spring, more),
        (0, 1, 3, 9),
        NEXT_TO_EDGE if risky else 4.0 * ON_CIRCLE,
        f"gamma = {gamma}, k = {k}, b = {b}: ",
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
    gamma, sites, _ = checked_chain(gamma, lattice)
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
    >>> from contbreather.stability.arc import ns_points
    >>> angle, b = ns_points(0.15, 0.7)[1]
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
    start = wave_frequency(gamma, alpha.real + 1j * min(max(alpha.imag, -0.5), 0.5), spring)
    zeros = _newton(gamma, k, b, spring, np.array([start]), 12)
    zeros = zeros[(zeros.real > floor) & (zeros.real < edge) & (np.abs(zeros.imag) < edge)]
    nu = float(zeros[0].real) if zeros.size else float(arc.nu[best])
    share = (nu * nu - spring) / (4.0 * gamma)
    place = sample(gamma, np.array([math.asin(math.sqrt(min(max(share, 0.0), 1.0)))]), spring)
    return Approach(nu, float(np.abs(curve(place, k, b)[0][0])))
