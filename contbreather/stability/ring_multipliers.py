"""All 2N multipliers of the half map QS on a ring, without an eigenproblem.

The ring's mirror symmetry splits QS. Odd modes never see the impact: ``exp(+-i pi w)``. The even
sector is diagonal plus rank two, its multipliers are the zeros of D
(`contbreather.stability.characteristic`) with the ring's own resolvent. In terms of theta,
``nu = 2 sqrt(gamma) sin(theta/2)``, the in-band alias is
``g = -cot(N theta/2)/(2 gamma sin theta)``, so D = 0 reads

    exp(i N theta) = S = (V + i L)/(V - i L),   V = 2 pi gamma sin(theta) (smooth part of D):

a wave of wave number theta, scattered once at the impacting site (S as in
`contbreather.stability.arc`), closes on itself around the ring. Nearly all roots lie next
to real theta and are found there together by Newton's method, each in O(1) whatever N. The few
that are left are the roots of the polynomial that remains when all others are divided out. In the
end D must be *the* product over all zeros and poles; if it is not, the even sector is solved dense.
"""

from __future__ import annotations

import cmath
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contbreather.errors import BadInput, NotConverged
from contbreather.lattice.band_averages import check_gamma
from contbreather.lattice.chain import Ring
from contbreather.stability.arc import resolved_arc
from contbreather.stability.band_pairs import smooth_and_L, smooth_and_L_slopes
from contbreather.stability.characteristic import (
    MODES,
    RingModes,
    determinant,
    modes,
    near_slope,
    regular_slopes,
)
from contbreather.stability.saltation import check_kb, saltation
from contbreather.stability.zeros import newton_from_all

Array = NDArray[Any]

DENSE = 5000  # sites, of a matrix of 10^8 numbers
LONGEST = 100_000  # sites; a ring of 20 000 takes 3 s
STEPS = 14  # Newton steps for a wave; 4 or 5 are usual
SPARE = 6  # coefficients beyond the remainder's degree, which must vanish
RADIUS = 2.0  # circle on which polynomials are compared: outside the band, near all else
TINY = 1e-300
VECTOR = 1e-9  # largest residual of an eigenvector
SETTLED = 1e-11  # a step of Newton's method after which the next one is rounding
SOUND = 1e-9  # largest defect of the product over zeros and poles; a wrong zero makes 1/N or more


def dense_half_map(sites: int, gamma: float, k: float, b: float) -> Array:
    """QS as a matrix, (18)-(20) without the square; the reference for everything else here.

    Q = exp(pi A) is written down from the ring's modes, with the limit at w = 0.

    Returns
    -------
    ndarray, shape (2 N, 2 N)
        Acting on (u_0 .. u_N-1, u'_0 .. u'_N-1), site 0 impacts.

    Examples
    --------
    >>> round(float(np.linalg.det(dense_half_map(5, 0.1, 0.8, 0.3))), 12)  # k^2
    0.64
    """
    ring, (k, b) = Ring(sites), check_kb(k, b)
    if ring.sites > DENSE:
        raise BadInput(
            f"{sites} sites: QS is written down for rings of up to {DENSE}; half_multipliers and "
            "apply_half_map need no matrix."
        )
    w = ring.frequencies(check_gamma(gamma))
    rows = np.stack([np.cos(np.pi * w), np.pi * np.sinc(w), -w * np.sin(np.pi * w)])
    first = np.fft.ifft(rows, axis=1).real  # circulants: the entry of sites n apart
    apart = (np.arange(sites)[:, None] - np.arange(sites)) % sites
    cosine, sine_over_w, w_sine = first[:, apart]
    half = np.block([[cosine, sine_over_w], [w_sine, cosine]])
    impact = [0, sites]
    half[:, impact] = half[:, impact] @ saltation(k, b)
    return half


# --- waves: the roots next to real theta ---------------------------------------------------


def _wave_starts(gamma: float, k: float, b: float, sites: int) -> Array:
    """theta where N theta - arg S passes a multiple of 2 pi, moved off the axis by ln|S|/N."""
    arc, out, into = resolved_arc(gamma, k, b, inside=True)
    theta = 2.0 * arc.alpha
    phase = sites * theta - np.unwrap(np.angle(into * out.conj()))
    turns = np.floor(phase / (2.0 * math.pi))
    passed = np.abs(np.diff(turns)).astype(int)
    i = np.repeat(np.arange(passed.size), passed)
    nth = np.arange(i.size) - np.repeat(np.cumsum(passed) - passed, passed)
    level = np.minimum(turns[i], turns[i + 1]) + 1.0 + nth
    t = (2.0 * math.pi * level - phase[i]) / (phase[i + 1] - phase[i])
    growth = np.log(np.maximum(np.abs(into), TINY)) - np.log(np.maximum(np.abs(out), TINY))
    growth = np.clip(growth[i] + t * (growth[i + 1] - growth[i]), -4.0, 4.0)
    return theta[i] + t * (theta[i + 1] - theta[i]) - 1j * growth / sites


def _wave_step(
    gamma: float, k: float, b: float, sites: int, theta: Array, resolvent_sites: int | None
) -> Array:
    """Newton's step for ``N theta + i log S = 0 (mod 2 pi)``."""
    edge = 2.0 * math.sqrt(gamma)
    nu, nu_theta = edge * np.sin(0.5 * theta), 0.5 * edge * np.cos(0.5 * theta)
    value, slope, _ = regular_slopes(gamma, nu, resolvent_sites)
    smooth, L = smooth_and_L(nu, k, b, value)
    smooth_nu, L_nu = smooth_and_L_slopes(nu, k, b, value, slope, 1.0, 0.0, 0.0)
    scale = 2.0 * math.pi * gamma
    sine, cosine = np.sin(theta), np.cos(theta)
    V = scale * sine * smooth
    V_theta = scale * (cosine * smooth + sine * smooth_nu * nu_theta)
    iL, iL_theta = 1j * L, 1j * L_nu * nu_theta
    plus, minus = V + iL, V - iL
    phi = sites * theta + 1j * np.log(plus / minus)
    phi -= 2.0 * math.pi * np.round(phi.real / (2.0 * math.pi))
    return phi / (sites + 1j * ((V_theta + iL_theta) / plus - (V_theta - iL_theta) / minus))


def _waves(gamma: float, k: float, b: float, sites: int) -> Array:
    """Distinct multipliers in the open upper half plane found from real theta."""
    # for one wave around the ring at |s| >= 1, beyond the band, the ring is an infinite chain?
    reach = ((1.0 - math.sqrt(1.0 - 4.0 * gamma)) / (1.0 + math.sqrt(1.0 - 4.0 * gamma))) ** sites
    resolvent_sites = None if reach < 1e-20 else sites
    root = newton_from_all(
        lambda theta: _wave_step(gamma, k, b, sites, theta, resolvent_sites),
        _wave_starts(gamma, k, b, sites), STEPS, 1e-7 / sites, math.pi / sites,
    )  # fmt: skip
    root = np.abs(root.real) + 1j * root.imag
    beyond = root.real > math.pi  # theta and 2 pi - theta are the same nu
    root[beyond] = 2.0 * math.pi - root[beyond]
    # V vanishes at theta = pi, where S = -1: for odd N a solution, but no zero of D
    root = root[np.abs(root - math.pi) * sites > 1e-5]
    root = root[np.argsort(root.real)]
    far = np.abs(np.diff(root)) * sites > 1e-5
    root = root[np.concatenate([[True], far])] if root.size else root
    mu = np.exp(2j * math.pi * math.sqrt(gamma) * np.sin(0.5 * root))
    # real ones stand alone, they are left to the remainder
    return mu[(root.real * sites > 1e-5) & (mu.imag > 1e-12 * math.sqrt(gamma))]


# --- the rest ------------------------------------------------------------------------------


def _remainder(
    waves: Array, all_modes: RingModes, k: float, b: float, degree: int, count: int
) -> Array:
    """Coefficients times RADIUS^j of ``D prod(mu - pole)/prod(mu - wave)``, by its values."""
    mu = RADIUS * np.exp(2j * math.pi * np.arange(count) / count)
    half = mu[: count // 2 + 1, None]  # the others are their conjugates
    value = determinant(half[:, 0], all_modes, k, b)[0]
    below = half * half - 2.0 * half * waves.real + np.abs(waves) ** 2
    above = half * half - 2.0 * half * all_modes.cosine + 1.0
    extra = above.shape[1] - below.shape[1]
    value = value * np.prod(above[:, extra:] / below, axis=1) * np.prod(above[:, :extra], axis=1)
    values = np.concatenate([value, value[1 : (count + 1) // 2][::-1].conj()])
    return np.fft.fft(values).real / count


def _near_step(gamma: float, k: float, b: float, sites: int, w: Array, nu: Array) -> Array:
    """Newton's step for D times all ``nu^2 - w^2``: no pole is felt, not even one at a zero."""
    value, slope = near_slope(gamma, nu, k, b, sites)
    poles = np.sum(2.0 * nu[:, None] / (nu[:, None] ** 2 - w * w), axis=1)
    return value / (slope + value * poles)


def _polish(gamma: float, k: float, b: float, all_modes: RingModes, sites: int, mu: Array) -> Array:
    """Newton's method for single roots: in nu next to the circle, in mu far from it."""
    mu = mu.astype(complex)
    far = np.abs(np.log(np.maximum(np.abs(mu), 1e-300))) > 3.0
    few = modes(gamma, min(sites, MODES))
    for _ in range(4):
        if np.any(far):
            value, slope = determinant(mu[far], few, k, b)
            mu[far] -= value / slope
        nu = -1j * np.log(mu[~far]) / math.pi
        with np.errstate(all="ignore"):
            step = _near_step(gamma, k, b, sites, all_modes.w, nu)
        step = np.where(np.isfinite(step), step, 0.0)
        mu[~far] = np.exp(1j * math.pi * (nu - step))
        if not far.any() and np.abs(step).max(initial=0.0) < SETTLED:
            break
    real = np.abs(mu.imag) < 1e-14 * np.abs(mu)
    return np.where(real, mu.real, mu)


def _defect(roots: Array, all_modes: RingModes, k: float, b: float) -> float:
    """How far D is from the product over all its zeros and poles, on a circle around them."""
    mu = 1.1 * RADIUS * np.exp(1j * math.pi * (np.arange(6) + 0.3) / 6.0)[:, None]
    value = determinant(mu[:, 0], all_modes, k, b)[0]
    poles = np.exp(1j * math.pi * all_modes.w)
    pole = np.concatenate([poles, poles.conj()])
    # paired by angle the factors are near 1, and the product does not overflow
    pole, root = pole[np.argsort(np.angle(pole))], roots[np.argsort(np.angle(roots))]
    scale = np.maximum(np.abs(mu), np.abs(root))
    ratio = ((mu - pole) / scale) / ((mu - root) / scale)
    return float(np.max(np.abs(value * np.prod(ratio, axis=1) - 1.0)))


def _even_roots(gamma: float, k: float, b: float, ring: Ring) -> Array | None:
    """Zeros of D by waves and remainder, or None where they do not pass the checks."""
    sites = ring.sites
    all_modes = modes(gamma, sites)
    total = 2 * all_modes.w.size
    waves = _waves(gamma, k, b, sites)
    degree = total - 2 * waves.size
    if degree < 0 or degree > 40:
        return None
    coefficients = _remainder(waves, all_modes, k, b, degree, degree + 1 + SPARE)
    size = float(np.abs(coefficients).max())
    if np.abs(coefficients[degree + 1 :]).max() > SOUND * size:
        return None  # a wave is wrong or counted twice: what remains is no polynomial
    rest = np.roots((coefficients[: degree + 1] / RADIUS ** np.arange(degree + 1))[::-1])
    if rest.size != degree:
        return None
    rest = _polish(gamma, k, b, all_modes, sites, rest)
    roots = np.concatenate([rest, waves, waves.conj()])
    if not np.all(np.isfinite(roots)) or _defect(roots, all_modes, k, b) > SOUND:
        return None
    return roots


def _dense_even_roots(gamma: float, k: float, b: float, ring: Ring) -> Array:
    """The even sector in its modes, about N x N, by a dense eigenvalue solver."""
    from contbreather.lattice.modal_flow import propagator
    from contbreather.stability.modal_map import ModalMap, ModalSaltation

    basis = ring.basis((0,))
    z, (shape,) = gamma * basis.lam, basis.at(np.zeros(1, dtype=int))
    turns, blow = (
        (propagator(z, 0.0), propagator(z, math.pi)),
        ModalSaltation(shape, shape, saltation(k, b)),
    )
    half = ModalMap(ring, gamma, 0.0, z, gamma * basis.unseen, turns, (blow,), math.pi, -1)
    return half.coupled


def even_multipliers(ring: Ring, gamma: float, k: float, b: float) -> Array:
    """The multipliers of the even sector alone, N + 2 (N even) or N + 1; see `half_multipliers`."""
    gamma = check_gamma(gamma)
    k, b = check_kb(k, b)
    if ring.sites > LONGEST:
        raise BadInput(
            f"{ring.sites} sites: all multipliers are computed for rings of up to {LONGEST}; for "
            "longer ones ask about the infinite chain."
        )
    if gamma == 0.0 or ring.sites == 1:  # a single oscillator, and others that feel nothing
        single = np.linalg.eigvals(dense_half_map(1, 0.0, k, b)).astype(complex)
        return np.concatenate([single, np.ones(2 * (ring.sites // 2))])
    roots = _even_roots(gamma, k, b, ring)
    return _dense_even_roots(gamma, k, b, ring) if roots is None else roots


def half_multipliers(ring: Ring, gamma: float, k: float, b: float) -> Array:
    """All 2 N multipliers of the half map QS on a ring: those of the even sector, then the odd.

    To 1e-13, in time proportional to N. Parameters and errors as of `unstable_count`.

    Examples
    --------
    >>> mu = half_multipliers(Ring(400), 0.11, 0.8, -0.3385)
    >>> mu.size, round(float(np.abs(mu).max()), 2)
    (800, 1.05)
    """
    even = even_multipliers(ring, gamma, k, b)
    j = np.arange(1, (ring.sites + 1) // 2)
    odd = np.exp(2j * math.pi * math.sqrt(gamma) * np.sin(np.pi * j / ring.sites))
    return np.concatenate([even, odd, odd.conj()])


# --- eigenvectors --------------------------------------------------------------------------


def apply_half_map(ring: Ring, gamma: float, k: float, b: float, state: Array) -> Array:
    """QS times a state (u_0 .. u_N-1, u'_0 .. u'_N-1), in time N log N.

    Examples
    --------
    >>> x = np.arange(6.0)
    >>> image = dense_half_map(3, 0.1, 0.8, 0.3) @ x
    >>> bool(np.allclose(apply_half_map(Ring(3), 0.1, 0.8, 0.3, x), image))
    True
    """
    k, b = check_kb(k, b)
    w = ring.frequencies(gamma)
    u, v = np.array(state, dtype=complex).reshape(2, ring.sites)
    u[0], v[0] = saltation(k, b) @ (u[0], v[0])
    u, v = np.fft.fft(u), np.fft.fft(v)
    cosine, sine = np.cos(np.pi * w), np.sin(np.pi * w)
    after = np.stack([cosine * u + np.pi * np.sinc(w) * v, cosine * v - w * sine * u])
    return np.fft.ifft(after, axis=1).ravel()


def _even_vector(ring: Ring, gamma: float, k: float, b: float, mu: complex) -> Array | None:
    """``(Q - mu)^-1 Q E z`` with z in the null space of ``1 + (S0 - 1) G``, mode by mode."""
    m = modes(gamma, ring.sites)
    diagonal = 1.0 - mu * m.cosine
    resolvent = np.array([[diagonal, -mu * m.sine_over_w], [mu * m.w_sine, diagonal]])
    if mu == 0.0:  # k = 0: the impact forgets
        determinants = np.ones_like(m.w)
    else:  # 1 - 2 mu cos(pi w) + mu^2, exact also where mu is next to exp(i pi w)
        half = -0.5j * np.log(mu)
        plus, minus = np.sin(0.5 * np.pi * m.w + half), np.sin(0.5 * np.pi * m.w - half)
        determinants = 4.0 * mu * plus * minus
    if np.any(determinants == 0.0):
        return None  # mu is a multiplier of Q: none of the even sector's, unless by accident
    resolvent /= determinants  # (1 - mu Q_w^-1)^-1
    kick = saltation(k, b) - np.eye(2)
    z = np.linalg.svd(np.eye(2) + kick @ (resolvent @ m.weight))[2][-1].conj()
    n, j = np.arange(ring.sites), np.arange(m.w.size)
    waves = np.cos(2.0 * np.pi / ring.sites * (np.outer(n, j) % ring.sites)) * m.weight
    return np.concatenate([waves @ (row[0] * z[0] + row[1] * z[1]) for row in resolvent])


def _odd_vector(ring: Ring, gamma: float, mu: complex) -> Array | None:
    """A mode that site 0 does not take part in, if mu is the multiplier of one."""
    n = np.arange(ring.sites)
    if gamma == 0.0:
        return np.where(np.arange(2 * n.size) == 1, 1.0 + 0j, 0.0) if abs(mu - 1) < 1e-12 else None
    j = np.arange(1, (ring.sites + 1) // 2)
    w = 2.0 * math.sqrt(gamma) * np.sin(np.pi * j / ring.sites) * np.sign(mu.imag)
    gap = np.abs(np.exp(1j * np.pi * w) - mu)
    if gap.size == 0 or gap.min() > 1e-12:
        return None
    i = int(gap.argmin())
    wave = np.sin(2.0 * np.pi / ring.sites * (j[i] * n % ring.sites))
    return np.concatenate([wave, 1j * w[i] * wave])


def eigenvector(ring: Ring, gamma: float, k: float, b: float, mu: complex) -> Array:
    """Eigenvector of QS to its multiplier ``mu``, of length 1.

    Parameters
    ----------
    ring, gamma, k, b
        As of `half_multipliers`.
    mu : complex
        One of them.

    Returns
    -------
    ndarray of complex, shape (2 N,)
        (u_0 .. u_N-1, u'_0 .. u'_N-1).

    Raises
    ------
    NotConverged
        If ``|QS v - mu v|`` is not small: mu is no multiplier of this map, or a multiple one.

    Examples
    --------
    >>> ring = Ring(20)
    >>> mu = max(half_multipliers(ring, 0.045, 0.8, 0.96), key=abs)
    >>> v = eigenvector(ring, 0.045, 0.8, 0.96, mu)
    >>> bool(np.allclose(dense_half_map(20, 0.045, 0.8, 0.96) @ v, mu * v))
    True
    """
    gamma = check_gamma(gamma)
    k, b = check_kb(k, b)
    if not cmath.isfinite(mu):
        raise BadInput(f"mu = {mu}: a finite number was expected, a multiplier.")
    mu = complex(mu)
    residual = math.inf
    for vector in (_odd_vector(ring, gamma, mu), _even_vector(ring, gamma, k, b, mu)):
        if vector is None:
            continue
        v = vector / np.linalg.norm(vector)
        defect = np.linalg.norm(apply_half_map(ring, gamma, k, b, v) - mu * v)
        if defect < VECTOR * (1.0 + abs(mu) + abs(b)):
            return v
        residual = min(residual, float(defect))
    raise NotConverged(
        f"mu = {mu} gives no eigenvector: |QS v - mu v| = {residual:.1e}; take one of "
        "half_multipliers(...) that is not (nearly) equal to another.",
        residual=residual,
    )
