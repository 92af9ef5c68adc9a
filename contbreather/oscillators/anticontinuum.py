"""The limit without coupling: single oscillators, from which breathers are continued.

There each site oscillates by itself, or rests. Where no harmonic of the orbit is a frequency of
small oscillations its equations are regular, and it goes on to some coupling (R. S. MacKay and
S. Aubry, Nonlinearity 7, 1623, 1994). Of driven ones a code chooses attractors.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from operator import itemgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..checks import brief, real
from ..continuation.algebra.derivatives import IMAGINARY
from ..continuation.algebra.newton import Array
from ..errors import BadInput, NoSolution
from ..flows.collocation import Collocation, TrajectorySegment, fitted
from ..flows.flow import Flow
from ..flows.functions import Params
from .oscillator_lattice import SHARE, Oscillators

_AMPLITUDES = np.geomspace(1e-3, 1e2, 600)  # among these a single oscillator is looked for
_NODES = 0.5 * math.pi * (np.arange(128) + 0.5) / 64  # of Gauss and Chebyshev, angles from 0 to pi
_LEVELS, _PHASES = (0.0, 0.4, 0.8, 1.1), 6  # starts, relative to where it resonates
_ESCAPED = 10.0  # relative to the same
_MOST = 400  # periods after which it has settled, or never will

# flows, if it is not smooth, an orbit of them, and the share of the coupling at which it is one
Uncoupled = tuple[tuple[Flow, ...], tuple[TrajectorySegment, ...], float]


class SingleOscillator:
    """One site without coupling, by its potential over its mass."""

    def __init__(self, chain: Oscillators, site: int, p: Params) -> None:
        self.site, self.params, self.mass = site, {**p, SHARE: 0.0}, chain.masses[site]
        # potentials, with the sign and the weight with which they act
        self.terms = [(chain.V, 1, chain.onsite[site])]
        for (ends, _), weights in chain.parts(self.params):  # the bonds that hold it even so
            column = ends[:, [site]].toarray().ravel()
            self.terms += [(chain.W, sign, weights[column == sign].sum()) for sign in (1, -1)]

    def __call__(self, u: Any) -> NDArray[Any]:
        p, total = self.params, 0.0 * u
        for potential, sign, weight in self.terms:
            if weight:
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
        return [brentq(off, _AMPLITUDES[i], _AMPLITUDES[i + 1], xtol=1e-14) for i in at]

    def amplitude(self, code: float, omega: float) -> float:
        """The amplitude that a code stands for: of 1 and -1 the smallest one, on that side; of
        others that which is nearest."""
        sign = math.copysign(1.0, code)
        if found := self.amplitudes(omega, sign):
            wanted = 0.0 if abs(code) == 1.0 else abs(code)
            return sign * min(found, key=lambda a: abs(a - wanted))
        small = self.half_periods(_AMPLITUDES[:1], sign)[0]
        if not math.isfinite(small):
            raise NoSolution(
                f"site {self.site}: it does not oscillate about u = 0, which has to be a minimum "
                "of its potential"
            )
        raise NoSolution(
            f"site {self.site}: alone it has no oscillation of the frequency {omega:.6g}; its "
            f"small ones have {math.pi / small:.6g}, and a potential that hardens larger ones, "
            "one that softens smaller ones."
        )


def coded(chain: Oscillators, code: Any) -> dict[int, Any]:
    """The sites of a code and what they do, as it was given: a dict, or a list of sites."""
    try:
        given = dict(code) if isinstance(code, Mapping) else dict.fromkeys(code, 1)
    except TypeError:
        given = {}
    known = all(isinstance(n, int | np.integer) and 0 <= n < chain.sites for n in given)
    if not given or not known:
        shape = getattr(chain.lattice, "shape", None)
        grid = f" Site (i, j) of this grid has the number {shape[1]} i + j." if shape else ""
        raise BadInput(
            f"code = {brief(code)}: a dict of sites, from 0 to {chain.sites - 1}, and 1, -1 or an "
            f"amplitude for each was expected, {{5: 1}} for instance.{grid}"
        )
    return {int(n): value for n, value in given.items()}


def half_without_coupling(
    chain: Oscillators, code: dict[int, Any], p: Params, scheme: Collocation
) -> Uncoupled:
    """Half of the orbit that a code stands for, without coupling."""
    x = np.zeros(2 * chain.sites)
    for site, value in code.items():
        if not (math.isfinite(real(value)) and real(value)):
            raise BadInput(f"site {site}: {value!r} was given; 1, -1 or an amplitude is expected.")
        x[site] = SingleOscillator(chain, site, p).amplitude(real(value), p["omega"])
    half = math.pi / p["omega"]
    flight = fitted(scheme, 0.0, half, chain.run((0.0, half), x, {**p, SHARE: 0.0}).sol)
    return (), (flight,), 0.0


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


# --- driven ones ---------------------------------------------------------------------------------

Attractor = tuple[float, Array]  # how far it swings, and its state at t = 0


def forcing_period(t: Any, x: Any, p: Params) -> Any:
    return 2 * math.pi / p["omega"]


def refuse_other_period(chain: Oscillators, p: Params) -> None:
    """Refuse a drive that is not the same after 2 pi/omega, which is the period of a breather."""
    if chain.drive is None:
        return
    period, omega = forcing_period(0.0, None, p), p["omega"]
    t = period * np.linspace(0.05, 1.0, 16)
    now, later = chain.drive(t, p), chain.drive(t + period, p)
    if abs(later - now).max() > 1e-6 * abs(now).max():
        raise BadInput(
            f"drive = {chain.drive} does not have the period of the breather, 2*pi/omega = "
            f"{period:.6g} at omega = {omega:.6g}: write its time as omega*t, 'a*cos(omega*t)' for "
            "'a*cos(t)'"
        )


@dataclass(frozen=True, eq=False)
class UncoupledSites:
    """All sites of a driven lattice, each by itself, as there is no coupling in the parameters:
    states have the shape (2, N, m), of m motions of each."""

    chain: Oscillators
    params: Params

    @property
    def period(self) -> float:
        return float(forcing_period(0.0, None, self.params))

    def run(self, x: Array, times: Any, tolerance: float) -> Array:
        """States at times, the last axis; what comes too far has escaped, and stays there."""
        from scipy.integrate import solve_ivp

        far, size = _ESCAPED * self.sizes, abs(x).max() or 1.0

        def rates(t: float, y: Array) -> Array:
            field = self.chain(t, y.reshape(2 * self.chain.sites, -1), self.params)
            inside = abs(y.reshape(x.shape)[0]) < far
            return np.ravel(np.where(inside, field.reshape(x.shape), 0.0))

        how: Any = {"t_eval": times, "rtol": tolerance, "atol": tolerance * size}
        ends: Array = solve_ivp(rates, (0.0, times[-1]), x.ravel(), "DOP853", **how).y
        return ends.reshape(*x.shape, -1)

    @cached_property
    def sizes(self) -> Array:
        """The largest amplitude at which each site by itself has the frequency of the drive; where
        there is none, that of a free mass."""
        chain, omega, sizes = self.chain, self.params["omega"], dict[Any, float]()
        drive = abs(chain.drive(np.linspace(0, self.period, 64), self.params)).max()
        every = [SingleOscillator(chain, n, self.params) for n in range(chain.sites)]
        kinds = [(one.mass, *one.terms) for one in every]
        for kind, one in dict(zip(kinds, every, strict=True)).items():
            amplitudes = one.amplitudes(omega, 1.0) + one.amplitudes(omega, -1.0)
            sizes[kind] = max(amplitudes, default=drive / one.mass / omega**2)
        return np.array([[sizes[kind]] for kind in kinds])

    def attractors(self) -> list[list[Attractor]]:
        """Those of each site that are found from phases and sizes up to beyond where it resonates,
        those that swing least first."""
        r, s = np.meshgrid(_LEVELS, 2 * math.pi * np.arange(_PHASES) / _PHASES)
        ways = np.array([(r * np.cos(s)).ravel(), -self.params["omega"] * (r * np.sin(s)).ravel()])
        chain, far = self.chain, _ESCAPED * self.sizes
        loss = chain.lattice.dampings / chain.masses * float(chain.damping(0.0, self.params))
        periods = math.ceil(min(_MOST, 12.0 / loss.min() / self.period))
        end = self.run(self.sizes * ways[:, None], [periods * self.period], 1e-6)[..., 0]
        inside = abs(end[0]) < far
        closed, largest = self.closed(np.where(inside, end, 0.0))
        inside &= abs(closed[0]) < far  # what has escaped stays, but is no motion
        times = np.linspace(0, self.period, 200)
        swings = 0.5 * np.ptp(self.run(closed, times, 1e-6)[0], axis=2)
        found: list[list[Attractor]] = [[] for _ in range(chain.sites)]
        for n, k in np.argwhere(inside & (largest < 1 + 1e-6)):
            state = closed[:, n, k]
            if all(abs(state - other).max() > 1e-6 * self.sizes[n] for _, other in found[n]):
                found[n].append((float(swings[n, k]), state))
        return [sorted(of, key=itemgetter(0)) for of in found]

    def closed(self, x: Array) -> tuple[Array, Array]:
        """Newton's iteration for states that come back, and the modulus of the largest multiplier
        of each; NaN where none does."""
        # beside rest in that of what the drive makes of it
        drive = abs(self.chain(0.0, np.zeros((x[:, :, 0].size, 1)), self.params)[-len(x[0]) :])
        sizes = np.where(x.any(axis=0), abs(x).max(axis=0), np.where(drive, drive, 1.0))
        lost, off = np.zeros(sizes.shape, dtype=bool), np.full(sizes.shape, math.inf)
        for _ in range(8):
            if (lost | (off < 1e-9 * sizes)).all():
                break
            step, (u, v) = 1e-5 * sizes, x
            beside = np.array([np.hstack([u, u + step, u]), np.hstack([v, v, v + step])])
            end, by_u, by_v = np.split(self.run(beside, [self.period], 1e-12)[..., 0], 3, axis=2)
            M = np.stack([by_u - end, by_v - end], axis=1) / step  # (2, 2, N, m)
            M, gap = M.transpose(2, 3, 0, 1), (x - end).transpose(1, 2, 0)
            # of a site that nothing holds the place is free: the shortest correction
            move = (np.linalg.pinv(M - np.eye(2), rcond=1e-6) @ gap[..., None])[..., 0]
            off = abs(move).max(axis=2)
            lost |= ~(off < 1e3 * sizes)
            x = np.where(lost, x, x + move.transpose(2, 0, 1))
        largest = abs(np.linalg.eigvals(M)).max(axis=2)
        return x, np.where(lost | ~(off < 1e-9 * sizes), np.nan, largest)

    def beside_rest(self) -> Callable[[Array], Array]:
        """The motion of all sites beside rest, whether it attracts or not."""
        n, (x, largest) = self.chain.sites, self.closed(np.zeros((2, self.chain.sites, 1)))
        if (none := np.isnan(largest[:, 0])).any():
            raise NoSolution(f"site {none.argmax()}: alone it has no periodic motion about rest")
        times = self.period * np.arange(64) / 64
        mean = self.motion(x)(times)[:n].mean(axis=1)
        held = self.chain.gradient(np.ones(n), self.params) != 0
        x[0, :, 0] -= np.where(held, 0.0, mean)  # where nothing holds it: about rest
        return self.motion(x)

    def motion(self, x: Array) -> Callable[[Array], Array]:
        motion: Any = self.chain.run((0.0, self.period), x.ravel(), self.params).sol
        return motion


def _chosen(site: int, code: Any, found: list[Attractor]) -> Array:
    """The attractor that a code stands for; a number: that which swings about so far."""
    if not found:
        raise NoSolution(f"site {site}: alone it has no attractor of the period of the drive.")
    if code == "high" and len(found) == 1:
        raise NoSolution(
            f"site {site}: alone it has one attractor only, with the amplitude "
            f"{found[0][0]:.6g}; 'high' needs two."
        )
    if code in ("low", "high"):
        return found[0 if code == "low" else -1][1]
    if not real(code) > 0:
        raise BadInput(
            f"site {site}: {code!r} was given; 'low', 'high' or an amplitude is expected. All "
            "sites follow one drive: what moves half a period later has -1 in the row drive= of "
            "its Lattice."
        )
    return min(found, key=lambda orbit: abs(orbit[0] - real(code)))[1]


def driven_without_coupling(
    chain: Oscillators, code: dict[int, Any], p: Params, scheme: Collocation
) -> Uncoupled:
    """The orbit that a code stands for, without coupling; sites without a code are low."""
    if chain.drive is None or chain.damping is None or not chain.damping(0.0, p) > 0:
        raise BadInput(
            "a driven lattice needs drive= and a damping above 0: without both nothing attracts; "
            "leave them both out of a conservative one"
        )
    alone = UncoupledSites(chain, {**p, SHARE: 0.0})
    found = enumerate(alone.attractors())
    states = [_chosen(site, code.get(site, "low"), of) for site, of in found]
    flight = fitted(scheme, 0.0, alone.period, alone.motion(np.transpose(states)))
    return (), (flight,), 0.0
