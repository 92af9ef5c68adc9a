"""Attractors of a single driven oscillator, and what a code makes of them without coupling."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from ..checks import real
from ..continuation.algebra.newton import Array
from ..errors import BadInput, NoSolution
from ..flows.collocation import Collocation, TrajectorySegment, fitted
from .anticontinuum import SingleOscillator, coded, together
from .oscillator_lattice import Oscillators
from .potentials import Params

_LEVELS, _PHASES = (0.0, 0.4, 0.8, 1.1), 6  # starts, relative to where it resonates
_MOST = 400  # periods after which it has settled, or never will


class Attractor(NamedTuple):
    """A periodic motion of the period of the drive: its state at t = 0, and how far it swings."""

    state: Array
    amplitude: float
    repels: bool = False


def forcing_period(t: Any, x: Any, p: Params) -> Any:
    return 2 * math.pi / p["omega"]


class DrivenOscillator:
    """One site of a driven lattice without coupling."""

    def __init__(self, chain: Oscillators, site: int, p: Params) -> None:
        self.single, self.params = SingleOscillator(chain, site, p), p
        mass, lattice = chain.masses[site], chain.lattice
        assert lattice is not None
        self.chain, self.period = chain, 2 * math.pi / p["omega"]
        damping = 0.0 if chain.damping is None else float(chain.damping(0.0, p))
        self.loss = float(lattice.dampings[site] / mass) * damping
        self.force = float(lattice.drive[site] / mass)

    def field(self, t: float, y: Array) -> Array:
        """Positions and velocities of many, one after the other."""
        u, v = y[: len(y) // 2], y[len(y) // 2 :]
        drive = self.force * self.chain.drive(t, self.params)
        return np.concatenate([v, drive - self.loss * v - self.single.pull(u)])

    def run(self, y: Array, periods: int, tolerance: float, **how: Any) -> Any:
        from scipy.integrate import solve_ivp

        return solve_ivp(
            self.field, (0.0, periods * self.period), y, method="DOP853", rtol=tolerance,
            atol=tolerance * (abs(y).max() or 1.0), **how,
        )  # fmt: skip

    def starts(self) -> Array:
        """States to begin from, up to beyond where its free oscillation has the frequency of the
        drive: phases and sizes."""
        omega = self.params["omega"]
        sizes = [self.single.amplitudes(omega, sign) for sign in (1.0, -1.0)]
        drive = abs(self.force * self.chain.drive(np.linspace(0, self.period, 64), self.params))
        largest = max((a for found in sizes for a in found), default=drive.max() / omega**2)
        r, s = np.meshgrid(_LEVELS, 2 * math.pi * np.arange(_PHASES) / _PHASES)
        return largest * np.concatenate([(r * np.cos(s)).ravel(), (-omega * r * np.sin(s)).ravel()])

    def attractors(self) -> list[Attractor]:
        """All that are found from these states, those that swing least first."""
        periods = min(_MOST, math.ceil(12.0 / self.loss / self.period))
        with np.errstate(all="ignore"):
            end = self.run(self.starts(), periods, 1e-6).y[:, -1].reshape(2, -1).T
        found: list[Attractor] = []
        for state in end[np.isfinite(end).all(axis=1)]:
            near = 0.02 * abs(state).max()  # as close as it has settled
            if all(abs(orbit.state - state).max() > near for orbit in found):
                orbit = self._closed(state)
                if orbit and not orbit.repels:
                    found.append(orbit)
        return sorted(found, key=lambda orbit: orbit.amplitude)

    def _closed(self, state: Array) -> Attractor | None:
        """Newton's iteration for a state that comes back; None where it does not."""
        # beside rest in that of what the drive makes of it
        size = abs(state).max() or abs(self.force) * abs(self.chain.drive(0.0, self.params)) or 1.0
        for _ in range(8):
            step = 1e-5 * size
            y = np.concatenate([state[0] + [0.0, step, 0.0], state[1] + [0.0, 0.0, step]])
            ends = self.run(y, 1, 1e-12).y[:, -1].reshape(2, 3)
            M = (ends[:, 1:] - ends[:, :1]) / step
            # of a site that nothing holds the place is free: the shortest correction
            move = np.linalg.lstsq(M - np.eye(2), state - ends[:, 0], rcond=1e-6)[0]
            state = state + move
            if abs(move).max() < 1e-9 * size:
                break
            if not abs(move).max() < 1e3 * size:
                return None
        else:
            return None
        repels = bool(abs(np.linalg.eigvals(M)).max() > 1 + 1e-6)
        swing = self.motion(state)(np.linspace(0, self.period, 200))[0]
        return Attractor(state, float(np.ptp(swing) / 2), repels)

    def motion(self, state: Array) -> Callable[[Array], Array]:
        motion: Callable[[Array], Array] = self.run(state, 1, 1e-12, dense_output=True).sol
        return motion

    def periodic(self) -> Callable[[Array], Array]:
        """The motion beside rest, whether it attracts or not."""
        orbit = self._closed(np.array([0.0, 0.0]))
        if orbit is None:
            raise NoSolution(f"site {self.single.site}: alone it has no periodic motion about rest")
        swing = self.motion(orbit.state)(self.period * np.arange(64) / 64)[0]
        if not self.single.pull(np.append(swing, 1.0)).any():  # nothing says where: about rest
            return self.motion(orbit.state - [swing.mean(), 0.0])
        return self.motion(orbit.state)

    def chosen(self, code: Any, found: list[Attractor]) -> Attractor:
        """The attractor that a code stands for: "low" swings least, "high" most, and a number that
        which swings about so far."""
        site = self.single.site
        if not found:
            raise NoSolution(f"site {site}: alone it has no attractor of the period of the drive.")
        if code == "low":
            return found[0]
        if code == "high":
            if len(found) == 1:
                raise NoSolution(
                    f"site {site}: alone it has one attractor only, with the amplitude "
                    f"{found[0].amplitude:.6g}; 'high' needs two."
                )
            return found[-1]
        if not real(code) > 0:
            raise BadInput(
                f"site {site}: {code!r} was given; of a driven lattice 'low', 'high' or an "
                "amplitude is expected."
            )
        return min(found, key=lambda orbit: abs(orbit.amplitude - real(code)))


def driven_without_coupling(
    chain: Oscillators, code: Any, p: Params, scheme: Collocation
) -> TrajectorySegment:
    """The orbit that a code stands for, without coupling; sites without a code are low."""
    if chain.drive is None or chain.damping is None or not real(float(chain.damping(0.0, p))) > 0:
        raise BadInput(
            "a driven lattice needs drive= and a damping above 0: without both nothing attracts; "
            "leave them both out of a conservative one"
        )
    given = coded(chain, code)
    motions: dict[int, Callable[[Array], Array]] = {}
    kinds: dict[Any, list[Attractor]] = {}
    for site in range(chain.sites):
        driven = DrivenOscillator(chain, site, p)
        alike = (
            driven.loss,
            driven.force,
            chain.onsite[site],
            chain.masses[site],
            *driven.single.bonds,
        )
        if alike not in kinds:
            kinds[alike] = driven.attractors()
        motions[site] = driven.motion(driven.chosen(given.get(site, "low"), kinds[alike]).state)
    return fitted(scheme, 0.0, 2 * math.pi / p["omega"], partial(together, chain.sites, motions))
