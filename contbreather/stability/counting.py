"""How many multipliers of QS lie strictly outside the circle: a winding number, no N, no threshold.

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
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from contbreather.checks import real
from contbreather.errors import BadInput, NotConverged
from contbreather.lattice import InfiniteChain, check_gamma
from contbreather.stability.arc import Arc, angle, curve, grid, sample, window
from contbreather.stability.characteristic import D, checked
from contbreather.stability.saltation import check_kb
from contbreather.stability.zeros import refined, steep

Array = NDArray[Any]

DEPTH = 48  # halvings of one grid interval: down to 1e-16 in alpha
ROUNDING = 1e-13  # of F's own terms: closer than that to zero, a count is not certain
RIM = 1e-10  # of 1/4 - gamma: nearer, the band's edge and -1 are told apart by rounding
NOISE = 1e-15  # of F's own terms: what their rounding amounts to
NEAR = 1e-5  # of its terms: what many counts at once leave to one by one
MOST = 2**20  # samples on a circle, when a ring's count asks for more there is no telling


@dataclass(frozen=True)
class Count:
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


def resolved_arc(
    gamma: float, k: float, b: float, spring: float = 0.0, *, inside: bool = False
) -> tuple[Arc, Array, Array]:
    """Samples on the band so close that F = v D turns by less than a radian between them.

    Also v times D continued from the inside; with ``inside`` that, too, is resolved.
    """
    arc = grid(gamma, spring)
    out, into = curve(arc, k, b)
    if gamma == 0.0:
        return arc, out, into
    noise = NOISE * (abs(b) + 1.0)
    for _ in range(DEPTH):
        wide = steep(out, noise) | steep(into, noise) if inside else steep(out, noise)
        i = np.flatnonzero(wide)
        i = i[arc.alpha[i + 1] - arc.alpha[i] > 1e-15]
        if i.size == 0:
            break
        middle = sample(gamma, 0.5 * (arc.alpha[i] + arc.alpha[i + 1]), spring)
        new = curve(middle, k, b)
        out, into = np.insert(out, i + 1, new[0]), np.insert(into, i + 1, new[1])
        arc = Arc(*(np.insert(old, i + 1, x) for old, x in zip(arc, middle, strict=True)))
    return arc, out, into


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


def ends(k: Any, b: Any, psi: Any, eta: Any, chi: Any, held: float = 0.0) -> tuple[Any, ...]:
    """beta0, which has the sign of -D(1), and D(-1), each with the size of its terms."""
    # D(-1) = d^2 + chi (b + c^2 eta/2)/2: there G12 = chi/2
    half_c2, d = 0.5 * (1.0 + k) ** 2, 0.5 * (1.0 - k)
    pitchfork, fold = half_c2 * psi + held, half_c2 * eta
    return (
        b - pitchfork,
        abs(b) + abs(pitchfork),
        d * d + 0.5 * chi * (b + fold),
        d * d + 0.5 * chi * (abs(b) + fold),
    )


def ends_of(gamma: float, k: float, b: float, lattice: Any) -> tuple[float, ...]:
    """`ends` by the means of a lattice; a spring closes the pole that D has at mu = 1."""
    held = 0.5 * (1.0 - k) ** 2 / lattice.tau(gamma) if lattice.spring else 0.0
    return ends(k, b, lattice.psi(gamma), lattice.eta(gamma), lattice.chi(gamma), held)


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
    certain = min(distances[nearest], abs(miss)) > ROUNDING + 1e-16 / room and room > RIM
    if k < 1.0 and gamma > 0.0:
        certain &= pairs == _crossings(F, NOISE * (abs(b) + 1.0))
    return Count(_total(beta0, fold, pairs), certain, distances[nearest], where, pairs)


def _total(beta0: float, fold: float, pairs: int) -> int:
    return int(beta0 > 0.0) + int(fold < 0.0) + 2 * pairs


def outside(gamma: float, k: float, b: float, chain: InfiniteChain) -> int:
    """The count of `unstable_count` on the infinite chain, by the second way alone."""
    gamma = check_gamma(gamma, chain.spring)
    k, b = check_kb(k, b)
    beta0, _, fold, _ = _cleared(gamma, k, b, chain)
    return _total(beta0, fold, int(window(gamma, k, chain.spring).miss(b) < -ROUNDING))


def many_outside(gamma: Array, k: Array, b: Array) -> NDArray[np.int64]:
    """`outside` of many maps of the chain without springs at once; -1 where that is too close to
    call, or not for such numbers."""
    counts = np.full(b.size, -1)
    inside = (gamma > 0.0) & (gamma < 0.25) & (k >= 0.0) & (k < 1.0) & (abs(b) < 1.0 / NOISE)
    if inside.any():
        counts[inside] = _outside(gamma[inside], k[inside], b[inside])
    return counts


def _outside(gamma: Array, k: Array, b: Array) -> Array:
    places, which = np.unique(np.stack([gamma, k]), axis=1, return_inverse=True)
    windows = np.array([window(*place)[:2] for place in places.T.tolist()])
    centre, square = windows[which.ravel()].T
    psi, eta, chi = (InfiniteChain().means(gamma, name) for name in ("psi", "eta", "chi"))
    beta0, beta0_size, fold, fold_size = ends(k, b, psi, eta, chi)
    # each as a sum of terms, whose size is known
    signs = beta0, -fold, square - (b - centre) ** 2
    sizes = beta0_size, fold_size, 1.0 + b * b
    certain = np.all([abs(x) > NEAR * size for x, size in zip(signs, sizes, strict=True)], axis=0)
    above, below, pairs = (x > 0.0 for x in signs)
    return np.where(certain, above + 1 * below + 2 * pairs, -1)


def _circle_count(gamma: float, k: float, b: float, lattice: Any, radius: float) -> Count:
    """Turning of D along a circle outside all its poles."""
    depth, spring = -math.log(radius) / math.pi, lattice.spring
    band = angle(gamma, np.linspace(0.0, 0.5 * math.pi, 2 * (lattice.sites or 1) + 33), spring)
    below = np.linspace(0.0, band[0], 33)[:-1] if spring else band[:0]
    x = np.concatenate([below, band, np.linspace(band[-1], 1.0, 33)[1:]])
    x, values, enough = refined(
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
    gamma, sites, _ = checked(gamma, lattice)
    k, b = check_kb(k, b)
    check_radius(radius, sites)
    if radius == 1.0:
        return _chain_count(gamma, k, b, cast(InfiniteChain, lattice))
    return _circle_count(gamma, k, b, lattice, float(radius))
