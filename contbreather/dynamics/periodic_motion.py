"""A periodic motion of the damped ring near a given state: Newton's method on the exact flow.

The closed form of the breather knows no damping. What attracts on a damped ring is found here,
whatever its impacts: the state that the flow over n periods (or, for symmetric motions, over half a
period with its sign changed) brings back. The derivative is that of the variational flow, so the
convergence is quadratic, and the multipliers come with the solution.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Unpack

import numpy as np
from numpy.typing import NDArray

from contbreather.checks import check_kind, number, whole
from contbreather.continuation import Point, Problem, fold
from contbreather.dynamics.impacting import Run, RunStop, Sample, advance, completed
from contbreather.dynamics.multiplier_events import (
    neimark_sacker,
    period_doubling,
    pitchfork,
    tally,
)
from contbreather.dynamics.states import HEAVIEST, On, State, check_state, conditions_of
from contbreather.dynamics.tangent import variation
from contbreather.errors import BadInput, ContbreatherError, NotConverged
from contbreather.lattice.conditions import Conditions

Array = NDArray[Any]
Flow = Callable[[Array], tuple[Array, Array]]

STEPS = 30
SOLVED = 1e-11
OUTSIDE = 1e-9  # a modulus is above 1 by more than rounding


@dataclass(frozen=True, eq=False)
class PeriodicMotion:
    """A state that returns, and what small perturbations of it become.

    Attributes
    ----------
    state : State
        At time `t0`.
    t0 : float
    periods : int
        n: the motion repeats after 2 pi n.
    symmetric : bool
        Whether u(t + pi) = -u(t) was imposed.
    conditions : Conditions
    half : ndarray or None
        For symmetric motions the multipliers of the half map; those over 2 pi are the squares.
    multipliers : ndarray, shape (2 N,)
        Over 2 pi n, largest first.
    residual : float
        Largest |state after - state before|.
    """

    state: State
    t0: float
    periods: int
    symmetric: bool
    conditions: Conditions
    half: Array | None
    multipliers: Array
    residual: float

    @property
    def largest(self) -> float:
        """Largest modulus of a multiplier over 2 pi n; below 1 the motion attracts."""
        return float(np.abs(self.multipliers[0]))

    def __repr__(self) -> str:
        c = self.conditions
        after = "half a period" if self.symmetric else f"{self.periods} x 2 pi"
        sites = "1 site" if self.state.u.size == 1 else f"{self.state.u.size} sites"
        return (
            f"<PeriodicMotion of {sites} at a = {c.a:g}, gamma = {c.gamma:g}, k = {c.k:g}, "
            f"damping = {c.damping:g}: closes after {after} to {self.residual:.1g}; "
            f"largest multiplier {self.largest:.6g}>"
        )

    @property
    def growth(self) -> float:
        """Exponential rate, per unit of time, at which perturbations grow in the end."""
        return math.log(self.largest) / (2.0 * math.pi * self.periods)

    def run(self, *, periods: int | None = None, sample: Sample | None = None) -> Run:
        """The motion itself, simulated over its period or longer."""
        length = self.periods if periods is None else periods
        return advance(self.state, self.conditions, periods=length, t0=self.t0, sample=sample)


def periodic(
    state: Any,
    *,
    periods: int = 1,
    symmetric: bool = False,
    t0: float = 0.0,
    **on: Unpack[On],
) -> PeriodicMotion:
    """The periodic motion of an impacting lattice nearest to a state.

    Parameters
    ----------
    state, t0, on
        As in `simulate`. t0 must not be the time of an impact of the motion looked for.
    periods : int
        n, for a period of 2 pi n.
    symmetric : bool
        Look for u(t + pi) = -u(t): half the work, and its own multipliers tell a pitchfork from
        a fold. With ``periods=1`` only.

    Raises
    ------
    NotConverged
        If Newton's method finds none; the residual tells how far it got.

    Examples
    --------
    >>> from contbreather.breathers import symmetric
    >>> b = symmetric(a=0.1, gamma=0.08, k=0.8)
    >>> found = periodic(b.state(20), a=0.1, gamma=0.08, k=0.8, damping=0.005, symmetric=True)
    >>> round(found.largest, 4)
    0.9979
    """
    start = check_state(state)
    conditions = conditions_of(start.u.size, **on)
    return closing(start, conditions, periods=periods, symmetric=symmetric, t0=t0)


def closing(
    start: State,
    conditions: Conditions,
    *,
    periods: int = 1,
    symmetric: bool = False,
    t0: float = 0.0,
) -> PeriodicMotion:
    """`periodic`, near a state and under conditions that have been checked."""
    count = whole("periods", periods, 1)
    if symmetric and count != 1:
        raise BadInput(f"periods = {count}: a symmetric motion has the period 2 pi of its forcing.")
    if symmetric and not conditions.walls.symmetric:
        raise BadInput(
            "the walls are not symmetric, so no motion is its own mirror image half a period "
            "later; look for the whole period, symmetric=False."
        )
    number("t0", t0, -1e300, 1e300, "a time")
    length, sign = (0.5, -1.0) if symmetric else (float(count), 1.0)
    flow = _flow(conditions, t0, length)
    x, image, matrix = returning(flow, np.concatenate(start), sign, solved=SOLVED, steps=STEPS)
    eigenvalues = np.linalg.eigvals(matrix)
    multipliers = eigenvalues**2 if symmetric else eigenvalues
    order = np.argsort(-np.abs(multipliers))
    u, v = np.split(x, 2)
    return PeriodicMotion(
        State(u, v),
        float(t0),
        count,
        symmetric,
        conditions,
        eigenvalues[order] if symmetric else None,
        multipliers[order],
        float(np.abs(sign * image - x).max()),
    )


def _flow(conditions: Conditions, t0: float, length: float) -> Flow:
    """The exact flow of the ring and its derivative."""

    def flow(state: Array) -> tuple[Array, Array]:
        run = completed(advance(State(*np.split(state, 2)), conditions, periods=length, t0=t0))
        if run.stop is not RunStop.DONE:
            raise NotConverged(run.reason)
        return np.concatenate(run.final), variation(run)

    return flow


def returning(
    flow: Flow, x: Array, sign: float = 1.0, *, solved: float, steps: int
) -> tuple[Array, Array, Array]:
    """The state near x that a flow brings back (times sign), its image, the derivative there."""
    image, matrix = flow(x)
    for _ in range(steps):
        defect = sign * image - x
        size = np.abs(defect).max()
        if size < solved:
            return x, image, matrix
        step = np.linalg.lstsq(sign * matrix - np.eye(x.size), -defect, rcond=1e-13)[0]
        x, image, matrix = _shortened(flow, x, step, sign, float(size))
    raise NotConverged(
        f"no periodic motion near this state: the residual is {size:.2g} after {steps} Newton "
        "steps; start closer, or let the damped ring settle first.",
        residual=float(size),
    )


def _shortened(
    flow: Flow, x: Array, step: Array, sign: float, size: float
) -> tuple[Array, Array, Array]:
    """The longest of the step's halves that leads closer to a solution, inside the walls."""
    for j in range(12):
        new = x + 0.5**j * step
        try:
            image, matrix = flow(new)
        except (ContbreatherError, ArithmeticError):  # outside the walls
            continue
        if np.abs(sign * image - new).max() < size:
            return new, image, matrix
    raise NotConverged(
        f"no periodic motion near this state: Newton's method stops at a residual of {size:.2g}; "
        "start closer, or let the damped ring settle first.",
        residual=size,
    )


# --- as a problem of the engine ------------------------------------------------------------------

DOMAIN = {
    "k": (0.0, 1.0),
    "a": (0.0, math.inf),
    "damping": (0.0, HEAVIEST),
    "spring": (0.0, HEAVIEST**2),
}


def damped_orbit(start: PeriodicMotion) -> Problem:
    """A periodic motion of the damped ring as a start for `trace`: in a, gamma, k, damping, spring
    or a parameter of the forcing.

    Unknowns are the arrays ``u`` and ``v`` at its t0. Where an impact comes to t0 they jump and the
    branch ends without an event (MX); it goes on with another t0. Columns ``largest`` and
    ``unstable`` as computed from its multipliers over the period; events LP, PF (PD if not
    symmetric) and NS. A point's ``solution`` is a `PeriodicMotion`.

    Examples
    --------
    >>> from contbreather.breathers import symmetric
    >>> from contbreather.continuation import trace
    >>> b = symmetric(a=0.1, gamma=0.05, k=0.8)
    >>> orbit = periodic(b.state(6), a=0.1, gamma=0.05, k=0.8, damping=0.02, symmetric=True)
    >>> branch = trace(damped_orbit(orbit), "a", towards="down", within={"a": (0.05, 0.2)})
    >>> round(branch.first("LP")["a"], 4)  # without damping 0.0644
    0.0863
    """
    check_kind(start, PeriodicMotion, "what periodic() gives")
    names = tuple(start.conditions.params)
    length = 0.5 if start.symmetric else float(start.periods)
    sign = -1.0 if start.symmetric else 1.0

    def run_of(x: Array, params: Mapping[str, float]) -> Run:
        state = State(*np.split(np.asarray(x), 2))
        on = start.conditions.at(params)
        found = completed(advance(state, on, periods=length, t0=start.t0))
        if found.stop is not RunStop.DONE:
            raise ArithmeticError(found.reason)
        return found

    def residual(x: Array, params: Mapping[str, float]) -> Array:
        return np.asarray(sign * np.concatenate(run_of(x, params).final) - x)

    def jacobian(x: Array, params: Mapping[str, float]) -> Array:
        return np.asarray(sign * variation(run_of(x, params)) - np.eye(x.size))

    @lru_cache(maxsize=4)  # the columns and every event ask for the same one
    def flown(values: bytes, params: tuple[float, ...]) -> Array:
        return variation(run_of(np.frombuffer(values), dict(zip(names, params, strict=True))))

    def matrix(point: Point) -> Array:
        return flown(point.x.tobytes(), tuple(point.params[name] for name in names))

    def multipliers(point: Point) -> Array:
        moduli = np.abs(np.linalg.eigvals(matrix(point)))
        return np.asarray(moduli ** (2 if start.symmetric else 1))

    def interpret(point: Point) -> PeriodicMotion:
        state, on = State(*np.split(point.x, 2)), start.conditions.at(point.params)
        return closing(state, on, periods=start.periods, symmetric=start.symmetric, t0=start.t0)

    return Problem(
        residual,
        {"u": start.state.u, "v": start.state.v},
        start.conditions.params,
        jacobian=jacobian,
        events=(
            fold(),
            (pitchfork if start.symmetric else period_doubling)(matrix),
            neimark_sacker(matrix),
            tally(matrix, OUTSIDE),
        ),
        record={
            "largest": lambda point: float(multipliers(point).max()),
            "unstable": lambda point: int(np.sum(multipliers(point) > 1.0 + OUTSIDE)),
        },
        domain={**DOMAIN, "gamma": (0.0, start.conditions.lattice.highest_gamma)},
        interpret=interpret,
        label="damped breather",
    )
