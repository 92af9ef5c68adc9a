"""Equations (11) of the symmetric breather as text that can be compiled, for pieces of many steps.

z holds p, phi and the freed parameters; what else there is to know is in `ClosureData`, into which
these are put. Each function fills in `out` and returns 0, or 1 outside of the domain.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from contbreather.continuation.walk_kernel import walker
from contbreather.kernels import Counts, Matrix, Vector, inlined
from contbreather.lattice.band_averages import (
    BandAverage,
    average,
    average_slope,
    excess,
    excess_slope,
)
from contbreather.lattice.forcing import harmonic, series_motion
from contbreather.orbits.closure import ClosureTerms, closure_derivative, closure_equations

A, GAMMA, K, COEFFICIENTS = range(4)  # places of parameters; then A and B of each harmonic of f

Four = tuple[float, float, float, float]  # f and its first three derivatives


class ClosureData(NamedTuple):
    """A symmetric breather on a chain, with some parameters free."""

    freed: Counts  # places of the parameters that z ends with,
    factors: Vector  # and what each of them is multiplied by there
    params: Vector  # a, gamma, k
    harmonics: Matrix  # m, A and B of each, in rows
    chi: BandAverage  # of the lattice, at the coupling if that is not free


@inlined
def unpack(z: Any, on: ClosureData) -> int:
    """Put the freed parameters in their places; 1 if one of them is outside of the domain."""
    for i in range(on.freed.size):
        place, value = on.freed[i], on.factors[i] * z[2 + i]
        if place < COEFFICIENTS:
            on.params[place] = value
        else:
            on.harmonics[(place - COEFFICIENTS) // 2, 1 + (place - COEFFICIENTS) % 2] = value
    return 0 if 0.0 <= on.params[GAMMA] < 0.25 and 0.0 <= on.params[K] <= 1.0 else 1


@inlined
def forcing_slope(on: ClosureData, i: int, t: float, f: Four) -> Four:
    """Derivative of a f and its derivatives in freed parameter i."""
    place = on.freed[i]
    if place == A:
        return f
    if place < COEFFICIENTS:
        return 0.0, 0.0, 0.0, 0.0
    size, cosine = on.params[A] * on.factors[i], (place - COEFFICIENTS) % 2 == 0
    m = on.harmonics[(place - COEFFICIENTS) // 2, 0]
    return harmonic(m, size if cosine else 0.0, 0.0 if cosine else size, t)


@inlined
def terms(z: Any, on: ClosureData, mean: BandAverage, f: Four) -> ClosureTerms:
    """What the equations are made of, with one of the means."""
    a, gamma, k = on.params[A], on.params[GAMMA], on.params[K]
    return ClosureTerms(z[0], k, average(mean, 4.0 * gamma, excess), a * f[0], a * f[1], a * f[2])


@inlined
def terms_slope(z: Any, on: ClosureData, mean: BandAverage, f: Four, column: int) -> ClosureTerms:
    """Their derivatives in one entry of z."""
    i, a, by_mean, u, v, w = column - 2, on.params[A], 0.0, 0.0, 0.0, 0.0
    place = on.freed[i] if i >= 0 else -1
    if column == 1:
        u, v, w = a * f[1], a * f[2], a * f[3]
    elif place == GAMMA:
        by_mean = average_slope(mean, 4.0 * on.params[GAMMA], excess_slope)
    elif place >= 0:
        u, v, w, _ = forcing_slope(on, i, z[1], f)
    p, k = 1.0 if column == 0 else 0.0, 1.0 if place == K else 0.0
    return ClosureTerms(p, k, by_mean, u, v, w)


# --- the equations ------------------------------------------------------------------------------


def closure_system(z: Any, on: ClosureData, out: Any) -> int:
    """Both equations (11)."""
    if unpack(z, on) != 0:
        return 1
    out[0], out[1] = closure_equations(terms(z, on, on.chi, series_motion(on.harmonics, z[1])))
    return 0


def closure_slopes(z: Any, on: ClosureData, out: Any) -> int:
    """Their derivatives, row by row."""
    if unpack(z, on) != 0:
        return 1
    f, width = series_motion(on.harmonics, z[1]), 2 + on.freed.size
    t = terms(z, on, on.chi, f)
    for i in range(width):
        out[i], out[width + i] = closure_derivative(t, terms_slope(z, on, on.chi, f, i))
    return 0


WALK = walker(closure_system, closure_slopes, ClosureData)


def closure_data(
    lattice: Any, forcing: Any, free: tuple[str, ...], params: Mapping[str, float]
) -> ClosureData | None:
    """With these parameters free; None for others than a, gamma (of the chain), k and coefficients
    of a Fourier series."""
    places = {name: (place, 1.0) for place, name in enumerate(("a", "gamma", "k"))}
    if lattice.sites is not None:
        del places["gamma"]
    # where coefficients are, and the factor of each
    places |= {
        f"{letter}{m}": (COEFFICIENTS + 2 * i + side, -1.0 / m**2)
        for i, (m, _, _) in enumerate(forcing.harmonics)
        for side, letter in enumerate("cs")
        if f"{letter}{m}" in forcing.params
    }
    if any(name not in places for name in free):
        return None
    freed, factors = zip(*(places[name] for name in free), strict=True)
    return ClosureData(
        np.array(freed),
        np.array(factors),
        np.array([params.get(name, 0.0) for name in ("a", "gamma", "k")]),
        np.array(forcing.harmonics, dtype=float),
        lattice.expansion("chi", None if "gamma" in free else params["gamma"]),
    )
