"""Periodic motions of the smooth chain (21) as a problem of the engine: shooting over a period.

Unknown is the state at t0; the equations say that it comes back, after half a period with its sign
changed or after a whole one. Derivatives, those in a, gamma, lam, m and damping included, are
integrated together with the motion, so folds are passed and located like on any other branch. With
m as a real parameter the branch leads towards the impacting ring.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Unpack

import numpy as np
from numpy.typing import NDArray

from contbreather.continuation import Event, Point, Problem, fold
from contbreather.dynamics.multiplier_events import (
    neimark_sacker,
    period_doubling,
    pitchfork,
    tally,
)
from contbreather.dynamics.smooth import (
    OWN,
    Explicit,
    OnSmooth,
    SmoothConditions,
    smooth_conditions_of,
)
from contbreather.dynamics.states import HEAVIEST, PERIOD, State, check_state, reduced
from contbreather.errors import NotConverged

Array = NDArray[Any]

DOMAIN = {
    "lam": (0.0, 2.0),
    "m": (1.0, 2000.0),
    "a": (0.0, math.inf),
    "damping": (0.0, HEAVIEST),
    "spring": (0.0, HEAVIEST**2),
}
KEPT = 4  # linearised flows in memory: residual, Jacobian and events ask for the same ones
OUTSIDE = 1e-7  # a modulus is above 1 by more than the integration's error


@dataclass
class Shooting:
    """The flow over ``span`` from t0 and its derivatives, as functions of state and parameters."""

    conditions: SmoothConditions
    t0: float
    span: float
    sign: float
    tolerance: float
    known: OrderedDict[bytes, tuple[Array, Array, Array]] = field(default_factory=OrderedDict)

    def image(self, x: Array, params: Mapping[str, float]) -> Array:
        """Where the state x gets to."""
        from contbreather.dynamics.smooth_flow import motion

        return self._solve(motion, self.conditions.at(params).arguments, np.asarray(x))

    def linearised(self, x: Array, params: Mapping[str, float]) -> tuple[Array, Array, Array]:
        """The image, its derivative in the state (2N, 2N), and in the parameters (2N, 6)."""
        from contbreather.dynamics.smooth_flow import varied

        key = np.concatenate([x, [params[name] for name in OWN]]).tobytes()
        if key in self.known:
            self.known.move_to_end(key)
            return self.known[key]
        wide = x.size
        start = np.concatenate([x, np.eye(wide).ravel(), np.zeros(len(OWN) * wide)])
        arguments = (*self.conditions.at(params).arguments, wide // 2, len(OWN))
        end = self._solve(varied, arguments, start).reshape(-1, wide)
        self.known[key] = end[0], end[1 : wide + 1].T, end[wide + 1 :].T
        if len(self.known) > KEPT:
            self.known.popitem(last=False)
        return self.known[key]

    def residual(self, x: Array, params: Mapping[str, float]) -> Array:
        return self.sign * self.image(x, params) - x

    def jacobian(self, x: Array, params: Mapping[str, float]) -> Array:
        return np.asarray(self.sign * self.linearised(x, params)[1] - np.eye(x.size))

    def sensitivity(self, x: Array, params: Mapping[str, float], name: str) -> Array:
        return np.asarray(self.sign * self.linearised(x, params)[2][:, OWN.index(name)])

    def multipliers(self, point: Point) -> Array:
        """Of the flow over half a period (symmetric motions) or a whole one, largest first."""
        mu = np.linalg.eigvals(self.linearised(point.x, point.params)[1])
        return np.asarray(mu[np.argsort(-np.abs(mu))])

    def _solve(self, rhs: Any, arguments: tuple[Any, ...], y: Array) -> Array:
        solver = Explicit(self.tolerance)
        try:
            return solver.states(rhs, None, arguments, self.t0, y, np.array([self.t0 + self.span]))[
                0
            ]
        except NotConverged as error:  # to the engine: no equation here
            raise ArithmeticError(str(error)) from error


@dataclass(frozen=True, eq=False)
class SmoothOrbit:
    """What a point of a smooth branch is: a state that comes back, and its multipliers.

    `half` are the multipliers of the half map of a symmetric motion (+1: pitchfork), None for
    others; `multipliers` those over 2 pi, largest first.
    """

    state: State
    t0: float
    conditions: SmoothConditions
    half: Array | None
    multipliers: Array

    @property
    def largest(self) -> float:
        """Largest modulus over 2 pi."""
        return float(np.abs(self.multipliers[0]))


def smooth_orbit(
    state: Any,
    *,
    m: float,
    symmetric: bool = True,
    t0: float = 0.0,
    tolerance: float = 1e-12,
    **on: Unpack[OnSmooth],
) -> Problem:
    """The periodic motion of the smooth chain near a state, as a start for `trace`.

    Parameters
    ----------
    state : pair of array_like, shape (N,)
        Near the motion at t0: that of the impacting breather, or of a simulation.
    m, on
        As in `simulate_smooth`; a, gamma, lam, m (a real number), damping and spring can be traced.
    symmetric : bool
        u(t + pi) = -u(t), over half a period; False: any motion of period 2 pi.
    t0 : float
        Any time at which no site is in its wall.
    tolerance : float
        Of the integration.

    Returns
    -------
    Problem
        Unknowns ``u`` and ``v`` (arrays of length N); columns ``largest`` (modulus of a multiplier
        over 2 pi) and ``unstable`` (how many are outside the circle); events LP, PF (PD if not
        symmetric) and NS. A point's ``solution`` is a `SmoothOrbit`.

    Examples
    --------
    >>> from contbreather.breathers import symmetric
    >>> b = symmetric(a=0.1, gamma=0.08, k=0.8)
    >>> start = smooth_orbit(b.state(6), a=0.1, gamma=0.08, m=6, k=0.8, damping=0.005)
    >>> found, _ = start.solve()
    >>> round(float(found.start["u"][0]), 4)
    -0.4297
    """
    u, v = check_state(state)
    conditions = smooth_conditions_of(u.size, m=m, **on)
    span, sign = (0.5 * PERIOD, -1.0) if symmetric else (PERIOD, 1.0)
    shooting = Shooting(conditions, reduced(t0), span, sign, tolerance)
    squared = 2 if symmetric else 1

    def largest(point: Point) -> float:
        return float(np.abs(shooting.multipliers(point)[0]) ** squared)

    def unstable(point: Point) -> int:
        return int(np.sum(np.abs(shooting.multipliers(point)) > 1.0 + OUTSIDE))

    def interpret(point: Point) -> SmoothOrbit:
        mu = shooting.multipliers(point)
        own = State(*np.split(point.x.copy(), 2))
        half = mu if symmetric else None
        return SmoothOrbit(own, float(t0), conditions.at(point.params), half, mu**squared)

    return Problem(
        shooting.residual,
        {"u": u, "v": v},
        {name: getattr(conditions, name) for name in OWN},
        jacobian=shooting.jacobian,
        sensitivity=shooting.sensitivity,
        events=(fold(), *_events(shooting, symmetric)),
        record={"largest": largest, "unstable": unstable},
        domain={**DOMAIN, "gamma": (0.0, conditions.lattice.highest_gamma)},
        scales={"m": 10.0},
        interpret=interpret,
        label="smooth breather" if symmetric else "smooth orbit",
    )


def _events(shooting: Shooting, symmetric: bool) -> tuple[Event, ...]:
    def matrix(point: Point) -> Array:
        return shooting.linearised(point.x, point.params)[1]

    own = (pitchfork if symmetric else period_doubling)(matrix)
    return own, neimark_sacker(matrix), tally(matrix, OUTSIDE)
