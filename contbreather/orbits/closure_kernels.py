"""Equations (11) of the symmetric breather and those of its events, as text that can be compiled.

z holds p, phi, any unknown of an event (the angle of a pair, the time of a contact) and the freed
parameters; what else there is to know is in `ClosureData`, into which these are put. Each function
fills in `out` and returns 0, or 1 outside of the domain.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from contbreather.continuation.algebra.walk_kernel import walker
from contbreather.kernels import ComplexVector, Counts, Matrix, Vector, inlined
from contbreather.lattice.band_averages import (
    BandAverage,
    HeldMean,
    average,
    average_slope,
    held_mean,
    hold,
    polynomial,
    slope_in_spring,
)
from contbreather.lattice.conditions import SpringResponse
from contbreather.lattice.forcing import Fourier, harmonic, series_motion
from contbreather.lattice.periodic_green import POWERS, Responses, response_since
from contbreather.orbits.closure import (
    ClosureTerms,
    closure_derivative,
    closure_equations,
    fold_derivative,
    fold_scalar,
    pitchfork_derivative,
    pitchfork_scalar,
    saltation_derivative,
    saltation_of,
)
from contbreather.stability.band_pairs import (
    BY_B,
    BY_GAMMA,
    BY_K,
    BY_NU,
    VALUE,
    BandWorkspace,
    ChainWithImpacts,
    pair_equations,
)

# places of parameters; then A and B of each harmonic of f
A, GAMMA, SPRING, K, OMEGA, COEFFICIENTS = range(6)

Four = tuple[float, float, float, float]  # f and its first three derivatives


class ClosureData(NamedTuple):
    """A symmetric breather on a chain, with some parameters free."""

    freed: Counts  # places of the parameters that z ends with,
    factors: Vector  # and what each of them is multiplied by there
    given: Vector  # a, gamma and spring, in the unit of time of omega
    params: Vector  # a, gamma and spring in the time of the drive, k, omega
    free: Matrix  # m, A and B of each harmonic of f without springs, in rows
    harmonics: Matrix  # and with them
    chi: BandAverage  # of the lattice, at the coupling if that is not free
    sigma: BandAverage
    eta: BandAverage
    held: HeldMean  # chi on the infinite chain with springs; nothing without them
    extra: int  # unknowns of an event between phi and the freed parameters


class ScalarData(NamedTuple):
    """A symmetric breather, and a quantity that vanishes at its fold or its pitchfork."""

    closure: ClosureData
    mean: BandAverage  # chi or sigma; where it has a spring, the same that (11) is asked with
    fold: bool


class PairData(NamedTuple):
    """A breather of the infinite chain, and two multipliers on the circle."""

    closure: ClosureData
    work: BandWorkspace
    F: ComplexVector  # with its derivatives, as `pair_equations` have them


class ContactData(NamedTuple):
    """A breather of the infinite chain, and a site on a wall."""

    closure: ClosureData
    wall: float
    distance: int  # from the impacting site
    expansions: Matrix  # coefficients of a response, as polynomials in 4 gamma
    responses: Responses  # to impacts, with a row for the slope in gamma


@inlined
def unpack(z: Any, on: ClosureData) -> int:
    """Put the freed parameters in their places; 1 if one of them is outside of the domain."""
    for i in range(on.freed.size):
        place, value = on.freed[i], on.factors[i] * z[2 + on.extra + i]
        if place < K:  # in another unit of time
            on.given[place] = value
        elif place < COEFFICIENTS:
            on.params[place] = value
        else:
            on.free[(place - COEFFICIENTS) // 2, 1 + (place - COEFFICIENTS) % 2] = value
    square = on.params[OMEGA] * on.params[OMEGA]
    for place in range(K):
        on.params[place] = on.given[place] / square
    gamma, s = on.params[GAMMA], on.params[SPRING]
    for i in range(on.free.shape[0]):
        m = on.free[i, 0]
        scale = m * m / (m * m - s)  # -F_m/m^2 becomes F_m/(s - m^2)
        on.harmonics[i, 1], on.harmonics[i, 2] = scale * on.free[i, 1], scale * on.free[i, 2]
    if not (s >= 0.0 and 0.0 <= 4.0 * gamma < 1.0 - s and 0.0 <= on.params[K] <= 1.0):
        return 1
    if on.held.poles.size > 0:
        hold(on.held, on.chi, s)
    return 0


@inlined
def moved(on: ClosureData, i: int) -> tuple[float, float, float]:
    """Derivatives of a, gamma and spring, in the time of the drive, in freed parameter i."""
    place, omega = on.freed[i], on.params[OMEGA]
    if place == OMEGA:
        by = -2.0 / omega
        return by * on.params[A], by * on.params[GAMMA], by * on.params[SPRING]
    by = 1.0 / (omega * omega)
    return by if place == A else 0.0, by if place == GAMMA else 0.0, by if place == SPRING else 0.0


@inlined
def forcing_slope(on: ClosureData, i: int, t: float, f: Four) -> Four:
    """Derivative of a f and its derivatives in freed parameter i."""
    place = on.freed[i]
    if place < COEFFICIENTS:
        by, _, pull = moved(on, i)
        slope = by * f[0], by * f[1], by * f[2], by * f[3]
        if pull != 0.0:
            s, size = on.params[SPRING], pull * on.params[A]
            for row in range(on.harmonics.shape[0]):
                m = on.harmonics[row, 0]
                more = size / (m * m - s)
                u, v, w, x = harmonic(
                    m, more * on.harmonics[row, 1], more * on.harmonics[row, 2], t
                )
                slope = slope[0] + u, slope[1] + v, slope[2] + w, slope[3] + x
        return slope
    size, cosine = on.params[A] * on.factors[i], (place - COEFFICIENTS) % 2 == 0
    m = on.harmonics[(place - COEFFICIENTS) // 2, 0]
    size *= m * m / (m * m - on.params[SPRING])
    return harmonic(m, size if cosine else 0.0, 0.0 if cosine else size, t)


@inlined
def terms(z: Any, on: ClosureData, mean: BandAverage, f: Four) -> ClosureTerms:
    """Terms of the equations, with one of the means."""
    a, gamma, k = on.params[A], on.params[GAMMA], on.params[K]
    return ClosureTerms(z[0], k, average(mean, 4.0 * gamma), a * f[0], a * f[1], a * f[2])


@inlined
def terms_slope(z: Any, on: ClosureData, mean: BandAverage, f: Four, column: int) -> ClosureTerms:
    i, a, by_mean, u, v, w = column - 2 - on.extra, on.params[A], 0.0, 0.0, 0.0, 0.0
    place = on.freed[i] if i >= 0 else -1
    if column == 1:
        u, v, w = a * f[1], a * f[2], a * f[3]
    elif place >= 0:
        _, by_gamma, pull = moved(on, i)
        if by_gamma != 0.0:
            by_mean = by_gamma * average_slope(mean, 4.0 * on.params[GAMMA])
        if pull != 0.0:
            x = 4.0 * on.params[GAMMA]
            by_mean += pull * slope_in_spring(on.held, on.params[SPRING], x, 0)
        u, v, w, _ = forcing_slope(on, i, z[1], f)
    p, k = 1.0 if column == 0 else 0.0, 1.0 if place == K else 0.0
    return ClosureTerms(p, k, by_mean, u, v, w)


# --- the equations ------------------------------------------------------------------------------


def closure_system(z: Any, on: ClosureData, out: Any) -> int:
    """Evaluate both equations (11)."""
    if unpack(z, on) != 0:
        return 1
    out[0], out[1] = closure_equations(terms(z, on, on.chi, series_motion(on.harmonics, z[1])))
    return 0


def closure_slopes(z: Any, on: ClosureData, out: Any) -> int:
    if unpack(z, on) != 0:
        return 1
    f, width = series_motion(on.harmonics, z[1]), 2 + on.extra + on.freed.size
    t = terms(z, on, on.chi, f)
    for i in range(width):
        out[i], out[width + i] = closure_derivative(t, terms_slope(z, on, on.chi, f, i))
    return 0


def scalar_system(z: Any, on: ScalarData, out: Any) -> int:
    """(11), and the determinant of its derivatives, eq. (14), or ``a f'' - 2 p sigma``."""
    closure = on.closure
    if closure_system(z, closure, out) != 0:
        return 1
    t = terms(z, closure, on.mean, series_motion(closure.harmonics, z[1]))
    out[2] = fold_scalar(t) if on.fold else pitchfork_scalar(t)
    return 0


def scalar_slopes(z: Any, on: ScalarData, out: Any) -> int:
    closure = on.closure
    if closure_slopes(z, closure, out) != 0:
        return 1
    f, width = series_motion(closure.harmonics, z[1]), 2 + closure.freed.size
    t = terms(z, closure, on.mean, f)
    for i in range(width):
        d = terms_slope(z, closure, on.mean, f, i)
        out[2 * width + i] = fold_derivative(t, d) if on.fold else pitchfork_derivative(t, d)
    return 0


# --- a pair on the circle -----------------------------------------------------------------------


def pair_system(z: Any, on: PairData, out: Any) -> int:
    """(11) and both parts of F, eqs. of `arc`."""
    if closure_system(z, on.closure, out) != 0:
        return 1
    t = terms(z, on.closure, on.closure.eta, series_motion(on.closure.harmonics, z[1]))
    if find_F(z, on, saltation_of(t)) != 0:
        return 1
    out[2], out[3] = on.F[VALUE].real, on.F[VALUE].imag
    return 0


@inlined
def find_F(z: Any, on: PairData, b: float) -> int:
    """F at this b and angle; 1 off the band."""
    gamma, k, nu = on.closure.params[GAMMA], on.closure.params[K], z[2]
    if not 0.0 < nu * nu < 4.0 * gamma:
        return 1
    pair_equations(ChainWithImpacts(gamma, k, 0.0), on.work, b, nu, on.F)
    return 0


def pair_slopes(z: Any, on: PairData, out: Any) -> int:
    if closure_slopes(z, on.closure, out) != 0:
        return 1
    f = series_motion(on.closure.harmonics, z[1])
    t = terms(z, on.closure, on.closure.eta, f)
    if find_F(z, on, saltation_of(t)) != 0:
        return 1
    for i in range(5):
        by_b = saltation_derivative(t, terms_slope(z, on.closure, on.closure.eta, f, i))
        place = on.closure.freed[i - 3] if i > 2 else -1
        # F itself changes with the angle, the coupling and k
        own = BY_NU if i == 2 else BY_K if place == K else BY_GAMMA
        by = 1.0 if i == 2 or place == K else moved(on.closure, i - 3)[1] if i > 2 else 0.0
        out[10 + i] = on.F[BY_B].real * by_b + by * on.F[own].real
        out[15 + i] = on.F[BY_B].imag * by_b + by * on.F[own].imag
    return 0


# --- a site that touches a wall -------------------------------------------------------------


@inlined
def find_responses(on: ContactData) -> None:
    """Responses of the site to impacts, and slopes in gamma: coefficients of `periodic_green`."""
    x, n, table = 4.0 * on.closure.params[GAMMA], on.distance, on.responses.table
    for i in range(POWERS):
        value, slope = polynomial(on.expansions[i], x)
        table[0, i], table[1, i] = value, 4.0 * slope
    r = math.sqrt(1.0 - x)
    rho = x / ((1.0 + r) * (1.0 + r))
    below = power = 1.0  # rho^(n - 1), rho^n
    for _ in range(n):
        below = power
        power = power * rho
    sign = -2.0 / math.pi if n % 2 else 2.0 / math.pi
    ahead = n * below / (r * (1.0 + r) * r * (1.0 + r)) if n > 0 else 0.0
    table[0, POWERS] = sign * power / r
    table[1, POWERS] = sign * 4.0 * (ahead + power / (2.0 * r * r * r))


def contact(z: Any, on: ContactData, out: Any) -> int:
    """(11), and that a site is on a wall at a time, without velocity."""
    if closure_system(z, on.closure, out) != 0:
        return 1
    find_responses(on)
    a, J, t = on.closure.params[A], -2.0 * z[0], z[2]
    f, df, _, _ = series_motion(on.closure.harmonics, t)
    h, dh, _, _ = response_since(on.responses, 0, t - z[1])
    out[2], out[3] = a * f + J * h - on.wall, a * df + J * dh
    return 0


def contact_slopes(z: Any, on: ContactData, out: Any) -> int:
    if closure_slopes(z, on.closure, out) != 0:
        return 1
    find_responses(on)
    a, J, t = on.closure.params[A], -2.0 * z[0], z[2]
    f, h = series_motion(on.closure.harmonics, t), response_since(on.responses, 0, t - z[1])
    by_gamma = response_since(on.responses, 1, t - z[1])
    for row in range(2):
        at = 10 + 5 * row
        out[at], out[at + 1] = -2.0 * h[row], -J * h[row + 1]
        out[at + 2] = a * f[row + 1] + J * h[row + 1]
        for i in range(2):
            through_gamma = J * by_gamma[row] * moved(on.closure, i)[1]
            out[at + 3 + i] = through_gamma + forcing_slope(on.closure, i, t, f)[row]
    return 0


CLOSURE = walker(closure_system, closure_slopes, ClosureData)
SCALAR = walker(scalar_system, scalar_slopes, ScalarData)
PAIR = walker(pair_system, pair_slopes, PairData)
CONTACT = walker(contact, contact_slopes, ContactData)


def closure_data(
    lattice: Any, forcing: Any, free: tuple[str, ...], params: Mapping[str, float], extra: int = 0
) -> ClosureData | None:
    """Data of a breather with these parameters free; None of others than `places` has."""
    names = "a", "gamma", "spring", "k", "omega"
    places = {name: (place, 1.0) for place, name in enumerate(names)}
    held = isinstance(forcing, SpringResponse)
    if not held:
        del places["spring"]
    drive = forcing.of if held else forcing
    # where coefficients are, and the factor of each
    if isinstance(drive, Fourier):
        places |= {
            f"{letter}{m}": (COEFFICIENTS + 2 * i + side, -1.0 / m**2)
            for i, (m, _, _) in enumerate(drive.harmonics)
            for side, letter in enumerate("cs")
        }
    if any(name not in places for name in free):
        return None
    given = {name: params.get(name, 0.0) for name in names} | {"omega": params.get("omega", 1.0)}
    fixed = None
    if not (held or {"gamma", "omega"} & {*free}):
        fixed = given["gamma"] / given["omega"] ** 2
    freed, factors = zip(*(places[name] for name in free), strict=True)
    waves = np.array(drive.harmonics, dtype=float)
    return ClosureData(
        np.array(freed),
        np.array(factors),
        np.array([given[name] for name in names[:K]]),
        np.array([given[name] for name in names]),
        waves,
        waves.copy(),
        lattice.expansion("chi", fixed),
        lattice.expansion("sigma", fixed),
        lattice.expansion("eta", fixed),
        held_mean("chi") if held else HeldMean(*np.empty((5, 0))),
        extra,
    )
