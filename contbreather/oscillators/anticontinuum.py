"""The limit without coupling: single oscillators, from which breathers are continued.

There each site oscillates by itself, or rests. Where no harmonic of the orbit is a frequency of
small oscillations its equations are regular, and it goes on to some coupling (R. S. MacKay and
S. Aubry, Nonlinearity 7, 1623, 1994).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..checks import brief, real
from ..continuation.algebra.derivatives import IMAGINARY
from ..continuation.algebra.newton import Array
from ..errors import BadInput, NoSolution
from ..flows.collocation import Collocation, TrajectorySegment, fitted
from .oscillator_lattice import SHARE, Oscillators
from .potentials import Params

_AMPLITUDES = np.geomspace(1e-3, 1e2, 600)  # among these a single oscillator is looked for
_NODES = 0.5 * math.pi * (np.arange(128) + 0.5) / 64  # of Gauss and Chebyshev, angles from 0 to pi


class SingleOscillator:
    """One site without coupling: its potential, by its slope and value, over its mass."""

    def __init__(self, chain: Oscillators, site: int, p: Params) -> None:
        self.site, self.params = site, {**p, SHARE: 0.0}
        self.mass, held = chain.masses[site], {1: 0.0, -1: 0.0}
        # the bonds that hold it even without coupling, by their sign
        for (ends, _), weights in chain.parts(self.params):
            column = ends[:, [site]].toarray().ravel()
            held = {sign: held[sign] + weights[column == sign].sum() for sign in held}
        self.kind = self.mass, chain.onsite[site], *held.values()
        self._terms = [(chain.V, 1, chain.onsite[site])]
        self._terms += [(chain.W, sign, weight) for sign, weight in held.items() if weight]

    def __call__(self, u: Any) -> NDArray[Any]:
        """The potential, over the mass, at positions of this site."""
        p, total = self.params, 0.0 * u
        for potential, sign, weight in self._terms:
            total = total + weight * (potential(sign * u, p) - potential(0.0, p))
        return np.asarray(total / self.mass)

    def pull(self, u: Any) -> NDArray[Any]:
        """Its slope."""
        return np.asarray(self(u + 1j * IMAGINARY).imag / IMAGINARY)

    @np.errstate(all="ignore")
    def half_periods(self, a: Array, sign: float) -> Array:
        """Integrate from amplitudes on one side to the turning points on the other side of rest:
        with ``u = m + h cos s`` what is smooth, ``ds / sqrt(2 (V(a) - V(u)) / (h sin s)^2)``. NaN
        where there are none or forces do not lead back."""
        inward, grid = sign * self.pull(sign * a) > 0, -sign * np.geomspace(1e-4, 1e3, 4000)
        level = np.where(np.minimum.accumulate(inward), self(sign * a), np.nan)
        back = np.append(-sign * self.pull(grid) > 0, False)
        grid = np.append(0.0, grid[: int(back.argmin())])
        b = np.interp(level, self(grid), grid, right=np.nan)
        for _ in range(4):  # Newton's steps, from a third of a percent off
            b = b - (self(b) - level) / self.pull(b)
        middle, half = 0.5 * (sign * a + b), 0.5 * abs(sign * a - b)
        u = middle[:, None] + half[:, None] * np.cos(_NODES)
        squares = 2 * (level[:, None] - self(u)) / (half[:, None] * np.sin(_NODES)) ** 2
        return np.asarray((1 / np.sqrt(squares)).mean(axis=1) * math.pi)

    def amplitudes(self, omega: float, sign: float) -> list[float]:
        """All amplitudes on one side at which it has a frequency, the smallest first."""
        from scipy.optimize import brentq

        def off(a: float) -> float:
            return float(self.half_periods(np.array([a]), sign)[0] - math.pi / omega)

        over = self.half_periods(_AMPLITUDES, sign) - math.pi / omega
        with np.errstate(invalid="ignore"):
            at = np.flatnonzero(over[:-1] * over[1:] <= 0)
        pairs = _AMPLITUDES[at].tolist(), _AMPLITUDES[at + 1].tolist()
        return [brentq(off, low, high, xtol=1e-14) for low, high in zip(*pairs, strict=True)]

    def amplitude(self, code: float, omega: float) -> float:
        """The amplitude that a code stands for: of 1 and -1 the smallest one, on that side; of
        others that which is nearest."""
        sign = math.copysign(1.0, code)
        found = self.amplitudes(omega, sign)
        if not found:
            small = self.half_periods(_AMPLITUDES[:1], sign)[0]
            if not math.isfinite(small):
                raise NoSolution(
                    f"site {self.site}: it does not oscillate about u = 0, which has to be a "
                    "minimum of its potential"
                )
            raise NoSolution(
                f"site {self.site}: alone it has no oscillation of the frequency {omega:.6g}; its "
                f"small ones have {math.pi / small:.6g}, and a potential that hardens larger ones, "
                "one that softens smaller ones."
            )
        wanted = 0.0 if abs(code) == 1.0 else abs(code)
        return sign * min(found, key=lambda a: abs(a - wanted))


def coded(chain: Oscillators, code: Any) -> dict[int, Any]:
    """The sites of a code and what they do, as it was given: a dict, or a list of sites."""
    try:
        given = dict(code) if isinstance(code, Mapping) else dict.fromkeys(code, 1)
    except TypeError:
        given = {}
    known = all(isinstance(n, int | np.integer) and 0 <= n < chain.sites for n in given)
    if not given or not known:
        raise BadInput(
            f"code = {brief(code)}: a dict of sites, from 0 to {chain.sites - 1}, and 1, -1 or an "
            "amplitude for each was expected, {5: 1} for instance."
        )
    return {int(n): value for n, value in given.items()}


def half_without_coupling(
    chain: Oscillators, code: Any, p: Params, scheme: Collocation
) -> TrajectorySegment:
    """Half of the orbit that a code stands for, without coupling."""
    x = np.zeros(2 * chain.sites)
    for site, value in coded(chain, code).items():
        if not (math.isfinite(real(value)) and real(value)):
            raise BadInput(f"site {site}: {value!r} was given; 1, -1 or an amplitude is expected.")
        x[site] = SingleOscillator(chain, site, p).amplitude(real(value), p["omega"])
    half = math.pi / p["omega"]
    return fitted(scheme, 0.0, half, chain.run((0.0, half), x, {**p, SHARE: 0.0}).sol)


def resonance(chain: Oscillators, omega: float, p: Params) -> str:
    """Say which harmonic of a frequency is nearest to the band of small oscillations, or in it."""
    band = chain.frequencies(p)
    if np.isnan(band).any():
        return "at rest it is unstable there"
    low, high = float(band[0]), float(band[-1])
    m = np.arange(1, int(high / omega) + 2)
    off = np.maximum(np.maximum(low - m * omega, m * omega - high), 0.0)
    j = int(off.argmin())
    where = "lies in" if off[j] == 0 else f"is {off[j]:.3g} off"
    name = "the frequency itself" if m[j] == 1 else f"harmonic {m[j]}"
    return (
        f"{name}, {m[j] * omega:.6g}, {where} the band of small oscillations, {low:.6g} to "
        f"{high:.6g}"
    )
