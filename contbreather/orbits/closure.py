"""The two equations (11) of the symmetric breather: their residual, slopes and all their roots.

Unknowns are ``(p, phi)``: half the momentum of an impact and the phase lag. With ``f`` the forced
response at unit amplitude and ``q = (1 - k)/(1 + k)``

    ``p chi(gamma) + a f(phi) - 1 = 0``   (the impact is on the wall),
    ``a f'(phi) - p q = 0``               (the reset law).

What vanishes at its fold and its pitchfork, and the entry b of its saltation, are made of the same
`ClosureTerms`: formulas and their product rules stand once, for numbers, arrays and compiled steps.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from contbreather.lattice.band_averages import UniformLattice
from contbreather.lattice.chain import lattice_of
from contbreather.lattice.conditions import SpringResponse, restitution_ratio
from contbreather.lattice.forcing import EPS, Forcing, Harmonic, TrigonometricSeries
from contbreather.lattice.formula import forcing_of

FloatArray = NDArray[np.float64]


class ClosureTerms(NamedTuple):
    """Terms of the equations of a breather; or their derivatives in some direction."""

    p: Any = 0.0
    k: Any = 0.0
    mean: Any = 0.0  # over the modes: chi, for the pitchfork sigma, for the saltation eta
    u: Any = 0.0  # a f, a f' and a f'' at phi
    v: Any = 0.0
    w: Any = 0.0


def closure_equations(t: ClosureTerms) -> tuple[Any, Any]:
    """Evaluate both equations (11)."""
    return t.p * t.mean + t.u - 1.0, t.v - t.p * ((1.0 - t.k) / (1.0 + t.k))


def closure_derivative(t: ClosureTerms, d: ClosureTerms) -> tuple[Any, Any]:
    c, q = 1.0 + t.k, (1.0 - t.k) / (1.0 + t.k)
    # dq/dk = -2/(1 + k)^2
    return d.p * t.mean + t.p * d.mean + d.u, d.v - d.p * q + 2.0 * t.p * d.k / (c * c)


def fold_scalar(t: ClosureTerms) -> Any:
    """Minus the determinant of (11): zero where the half map QS has the multiplier -1, eq. (14)."""
    return t.mean * t.w + (1.0 - t.k) / (1.0 + t.k) * t.v


def fold_derivative(t: ClosureTerms, d: ClosureTerms) -> Any:
    c, q = 1.0 + t.k, (1.0 - t.k) / (1.0 + t.k)
    return d.mean * t.w + t.mean * d.w + q * d.v - 2.0 * t.v * d.k / (c * c)


def pitchfork_scalar(t: ClosureTerms) -> Any:
    """``2p/c^2`` times ``b - c^2 psi/2``, which is D(1) without its pole; eta + psi = 2 sigma.
    Springs, with which it has none, add ``q^2/(2 tau)`` to sigma."""
    return t.w - 2.0 * t.p * t.mean


def pitchfork_derivative(t: ClosureTerms, d: ClosureTerms) -> Any:
    return d.w - 2.0 * (d.p * t.mean + t.p * d.mean)


def saltation_of(t: ClosureTerms) -> Any:
    """b of the saltation (19): ``(1 + k) u''/u'`` with ``u'' = a f'' + v''``, eq. (5), and ``u' = 2
    p/(1 + k)`` before the impact."""
    c = 1.0 + t.k
    return 0.5 * c * c * (t.w - t.p * t.mean) / t.p


def saltation_derivative(t: ClosureTerms, d: ClosureTerms) -> Any:
    c = 1.0 + t.k
    # p and the acceleration do not depend on k by themselves
    by_k = c * (t.w - t.p * t.mean) / t.p * d.k
    return by_k + 0.5 * c * c * (d.w - t.w * d.p / t.p - t.p * d.mean) / t.p


def terms_at(at: Any, mean: str) -> ClosureTerms:
    """Terms at a place or of a breather, with one of the means of its lattice."""
    drive = [at.a * value for value in at.forcing.motion(at.phi)]
    return ClosureTerms(at.p, at.k, at.lattice.mean(at.gamma, mean), *drive)


def terms_derivative(at: Any, t: ClosureTerms, name: str, mean: str) -> ClosureTerms:
    """The derivative of `terms_at`, which are t, in p, phi, or a parameter."""
    f, phi = at.forcing, at.phi
    if name in ("p", "k"):
        return ClosureTerms(**{name: 1.0})
    if name == "phi":
        return ClosureTerms(0.0, 0.0, 0.0, t.v, t.w, at.a * f.d3f(phi))
    if name == "gamma":
        return ClosureTerms(mean=at.lattice.slope(at.gamma, mean))
    if name == "a":
        return ClosureTerms(0.0, 0.0, 0.0, *f.motion(phi))
    by_spring = at.lattice.by_spring(at.gamma, mean) if name == "spring" else 0.0
    u, v, w, _ = TrigonometricSeries(f.slope_harmonics(name)).motion(phi)
    return ClosureTerms(0.0, 0.0, by_spring, at.a * u, at.a * v, at.a * w)


def sprung(lattice: Any, forcing: Forcing) -> Any:
    """The lattice, with springs to the ground where the forced response has them."""
    return lattice.with_spring(forcing.spring) if isinstance(forcing, SpringResponse) else lattice


def forcing_at(forcing: Forcing, params: Mapping[str, float]) -> Forcing:
    """The forcing with its own parameters taken from ``params`` where they are named there."""
    defaults = tuple(forcing.params.items())
    values = tuple([(name, params.get(name, value)) for name, value in defaults])
    return forcing if values == defaults else _forcing_with(forcing, values)


@lru_cache(maxsize=256)
def _forcing_with(forcing: Forcing, values: tuple[tuple[str, float], ...]) -> Forcing:
    """The forcing with these values; kept, for equations and slopes ask for the same few."""
    return forcing.at(**dict(values))


def smallest_amplitude(
    gamma: float, k: float, forcing: Forcing | None = None, lattice: UniformLattice | None = None
) -> float:
    """The fold, eq. (14), for any forcing: ``a_min = q / max of (chi f' + q f)``.

    Eliminating p from (11) leaves ``a (chi f' + q f) = q`` for phi alone.

    Examples
    --------
    >>> round(smallest_amplitude(0.1, 0.8), 12)
    0.057029037182
    """
    return min(folds(gamma, k, forcing_of(forcing), lattice_of(lattice)))


def folds(gamma: float, k: float, forcing: Forcing, lattice: UniformLattice) -> list[float]:
    """Amplitudes of all folds, where ``chi f' + q f`` has an extremum and (11) a double root."""
    chi, q = sprung(lattice, forcing).mean(gamma, "chi"), restitution_ratio(k)
    if isinstance(forcing, Harmonic):
        # (14); chi f' + q f = -chi sin + q cos has the largest value sqrt(chi^2 + q^2)
        return [q / math.hypot(chi, q)]
    return fold_amplitudes(forcing, chi, q)


def fold_amplitudes(forcing: Forcing, chi: float, q: float) -> list[float]:
    """Amplitudes at which ``a (chi f' + q f) = q`` has a double root."""
    series = reduced(forcing, chi, q)
    heights = [series.at(phi, 0) for phi in series.extrema()]
    return [q / height for height in heights if height > 0.0]


def harmonic_roots(a: float, chi: float, q: float) -> list[tuple[float, float]]:
    """(13), with its phase on the right branch and free of cancellation.

    Both roots share ``h^2 = chi^2 + q^2`` and ``r^2 = a^2 h^2 - q^2``, which vanishes at the fold.
    """
    h = math.hypot(chi, q)
    # at the fold, a h = q, rounding must not decide whether there is a root
    gap = a * h - q
    if gap < -4.0 * EPS * q:
        return []
    r = math.sqrt(max(gap, 0.0) * (a * h + q))
    # phi by (13): a sin phi = -p q, a cos phi = 1 - p chi, which is (q^2 -+ chi r)/h^2
    hh = h * h
    p = (chi + r) / hh
    solutions = [(p, math.atan2(-p * q, (q * q - chi * r) / hh))]
    p = (1.0 - a) * (1.0 + a) / (chi + r)  # = (chi - r)/h^2
    if r > 0.0 and p > 0.0:
        solutions.append((p, math.atan2(-p * q, (q * q + chi * r) / hh)))
    return solutions


def general_roots(a: float, chi: float, q: float, forcing: Forcing) -> list[tuple[float, float]]:
    """``p chi = 1 - a f``, ``p q = a f'`` with p > 0, for any f that is a series.

    Between two neighbouring extrema of ``chi f' + q f`` lies one root of what is left of them
    without p, ``a (chi f' + q f) = q``, or none.
    """
    series = reduced(forcing, chi, q)
    extrema = series.extrema()
    heights = [a * series.at(phi, 0) - q for phi in extrema]
    phases: list[float] = []
    touching = False
    for i, (phi, height) in enumerate(zip(extrema, heights, strict=True)):
        # rounding of the height, by the size of its three terms
        slack = 8.0 * EPS * (a * abs(chi * forcing.df(phi)) + a * q * abs(forcing.f(phi)) + q)
        touched, touching = touching, abs(height) <= slack
        if touching:  # a double root: rounding must not decide whether it exists
            heights[i] = 0.0
            if not touched:
                phases.append(phi)
            elif abs(series.at(phi, 1)) < abs(series.at(phases[-1], 1)):
                phases[-1] = phi  # of points on one flat top the one nearest its maximum
    for i, left in enumerate(extrema):
        right = extrema[i + 1] if i + 1 < len(extrema) else extrema[0] + 2.0 * math.pi
        if heights[i] * heights[(i + 1) % len(extrema)] < 0.0:
            phases.append(series.crossing(q / a, left, right))
    solutions = []
    for phi in phases:
        p = (1.0 - a * forcing.f(phi)) / chi
        if p > 0.0:
            solutions.append((p, math.remainder(phi, 2.0 * math.pi)))
    return solutions


def reduced(forcing: Forcing, chi: float, q: float) -> TrigonometricSeries:
    """``chi f' + q f``."""
    return TrigonometricSeries(
        tuple((m, q * c + chi * m * s, q * s - chi * m * c) for m, c, s in forcing.harmonics)
    )
