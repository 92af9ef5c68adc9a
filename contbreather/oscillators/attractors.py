"""Attractors of single driven oscillators, and what a code makes of them without coupling."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from operator import itemgetter
from typing import Any

import numpy as np

from ..checks import real
from ..continuation.algebra.newton import Array
from ..errors import BadInput, NoSolution
from ..flows.collocation import Collocation, TrajectorySegment, fitted
from .anticontinuum import SingleOscillator, coded
from .oscillator_lattice import SHARE, Oscillators
from .potentials import Params

_LEVELS, _PHASES = (0.0, 0.4, 0.8, 1.1), 6  # starts, relative to where it resonates
_ESCAPED = 10.0  # relative to the same
_MOST = 400  # periods after which it has settled, or never will

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

        far = _ESCAPED * self.sizes

        def rates(t: float, y: Array) -> Array:
            field = self.chain(t, y.reshape(2 * self.chain.sites, -1), self.params)
            inside = abs(y.reshape(x.shape)[0]) < far
            return np.ravel(np.where(inside, field.reshape(x.shape), 0.0))

        how: dict[str, Any] = {"method": "DOP853", "t_eval": times, "rtol": tolerance}
        how["atol"] = tolerance * (abs(x).max() or 1.0)
        ends: Array = solve_ivp(rates, (0.0, times[-1]), x.ravel(), **how).y
        return ends.reshape(*x.shape, -1)

    @cached_property
    def sizes(self) -> Array:
        """The largest amplitude at which each site by itself has the frequency of the drive; where
        there is none, that of a free mass."""
        chain, omega, known = self.chain, self.params["omega"], dict[Any, float]()
        drive = abs(chain.drive(np.linspace(0, self.period, 64), self.params)).max()
        every = [SingleOscillator(chain, n, self.params) for n in range(chain.sites)]
        for alone in every:
            if alone.kind not in known:
                both = alone.amplitudes(omega, 1.0) + alone.amplitudes(omega, -1.0)
                known[alone.kind] = max(both, default=drive / alone.mass / omega**2)
        return np.array([[known[alone.kind]] for alone in every])

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
    chain: Oscillators, code: Any, p: Params, scheme: Collocation
) -> TrajectorySegment:
    """The orbit that a code stands for, without coupling; sites without a code are low."""
    if chain.drive is None or chain.damping is None or not chain.damping(0.0, p) > 0:
        raise BadInput(
            "a driven lattice needs drive= and a damping above 0: without both nothing attracts; "
            "leave them both out of a conservative one"
        )
    given, alone = coded(chain, code), UncoupledSites(chain, {**p, SHARE: 0.0})
    found = enumerate(alone.attractors())
    states = [_chosen(site, given.get(site, "low"), of) for site, of in found]
    return fitted(scheme, 0.0, alone.period, alone.motion(np.transpose(states)))
