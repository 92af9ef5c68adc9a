"""The smooth chain, eqs. (21) and (22): walls of finite stiffness, by a general ODE solver.

``u_n'' + gamma (2 u_n - u_n-1 - u_n+1) + mu u_n' + lambda (2m+1) u_n^(2m) u_n' + (2m+1) u_n^(4m+1)
= F(t)``, with F = -a cos t: the paper prints +a cos t in (21), yet compares with (13), whose
forcing is -a cos t. For m -> infinity this is the impacting ring with the k of (22). For real m,
u^(2m) is |u|^(2m).

Which solver: measured at m = 6, 20, 50 and N = 20 (``python -m tests.benchmarks --only
simulation``) the chain is not stiff. Explicit order 8 with a compiled right-hand side is the
fastest at every accuracy; implicit methods take 20 to 60 times as long at equal error. Whatever the
solver, u^(2m) is invisible to its step control in mid flight, so its step is capped at 0.2.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from contbreather.checks import number
from contbreather.errors import BadInput, NotConverged, deferred
from contbreather.lattice.finite import stiffness_of
from contbreather.simulation.integrator import Chunk, Sample, forced_motion
from contbreather.simulation.smooth_flow import RATES, SmoothParameters, ceiling
from contbreather.simulation.states import OWN, PERIOD, SmoothConditions, State

Array = NDArray[Any]

FINE = 1e-12  # tolerance where derivatives are asked for
CAP = 0.2  # largest step of any solver
MOST = 1_000_000  # steps between two outputs


# --- solvers --------------------------------------------------------------------------------------

Rhs = Callable[[float, Array], Array]


@lru_cache(maxsize=16)
def smooth_parameters(on: SmoothConditions) -> SmoothParameters:
    """What the kernels take."""
    table = stiffness_of(on.lattice).tocoo()
    weight = table.data / np.asarray(on.lattice.masses)[table.row]
    # (site, other, value)
    entries = np.ascontiguousarray(np.array([table.row, table.col, weight], dtype=float).T)
    a, gamma, lam, m, mu, spring = (float(getattr(on, name)) for name in OWN)
    force = forced_motion(on.forcing, 1.0, 0.0)[1]
    return SmoothParameters(a, gamma, lam, m, mu, spring, force, entries, on.lattice.drive)


def right_side(on: SmoothConditions, size: int, params: int = 0) -> Rhs:
    """What a state, with variations of it, changes by; see `smooth_flow`."""
    # to copy both costs less than to look up where they are
    state, out = np.empty(size), np.empty(size)
    fill = RATES.following(state, smooth_parameters(on), params, out)

    def at(t: float, y: Array) -> Array:
        state[...] = y
        fill(t)
        return out.copy()

    return at


def jacobian(on: SmoothConditions, t: float, y: Array) -> Array:
    """The derivative of the right-hand side in y: the rates of variations that are unit vectors."""
    start = np.concatenate([y, np.eye(y.size).ravel()])
    return right_side(on, start.size)(t, start)[y.size :].reshape(y.size, -1)


class Solver(Protocol):
    """Carries y from t0 to each of the times; raises `NotConverged` where it cannot."""

    def states(self, rhs: Rhs, jac: Rhs | None, t0: float, y: Array, times: Array) -> Array: ...


@dataclass(frozen=True)
class Explicit:
    """Dormand and Prince's method of order 8 (scipy's ``dop853``): the fastest here.

    Examples
    --------
    >>> Explicit(tolerance=1e-12)
    Explicit(tolerance=1e-12)
    """

    tolerance: float = 1e-10

    def states(self, rhs: Rhs, jac: Rhs | None, t0: float, y: Array, times: Array) -> Array:
        with deferred():
            from scipy.integrate import ode

        settings: dict[str, Any] = {"rtol": self.tolerance, "atol": self.tolerance}
        # beta heeds the error of the step before, too (Hairer and Wanner II, IV.2): on the way into
        # a wall half as many steps are rejected, which saves a sixth of all calls
        settings |= {"max_step": CAP, "first_step": CAP, "nsteps": MOST, "beta": 0.04}
        solver: Any = ode(rhs).set_integrator("dop853", **settings).set_initial_value(y, t0)
        out = np.empty((len(times), len(y)))
        with warnings.catch_warnings(), deferred():
            warnings.simplefilter("ignore", UserWarning)  # its failure is an error, below
            for i, t in enumerate(times):
                out[i] = solver.integrate(t)
                if not solver.successful():
                    raise _stuck("dop853", t)
        return out


class _OfScipy:
    """A method of `solve_ivp`, with the exact Jacobian."""

    method: ClassVar[str]
    tolerance: float

    def states(self, rhs: Rhs, jac: Rhs | None, t0: float, y: Array, times: Array) -> Array:
        with deferred():
            from scipy.integrate import solve_ivp

        # scipy raises a relative tolerance below 100 eps = 2.2e-14 by itself, with a warning
        settings: dict[str, Any] = {"rtol": max(self.tolerance, 3e-14), "atol": self.tolerance}
        if jac is not None:
            settings["jac"] = jac
        solve: Any = solve_ivp  # its stubs know every method by name and shape
        with deferred():
            solution = solve(rhs, (t0, times[-1]), y, self.method, times, max_step=CAP, **settings)
        if not solution.success:
            raise _stuck(self.method, solution.t[-1] if len(solution.t) else t0)
        return np.ascontiguousarray(solution.y.T)


@dataclass(frozen=True)
class Switching(_OfScipy):
    """LSODA, which changes between Adams and BDF as it sees fit, with the exact Jacobian.

    Examples
    --------
    >>> from contbreather.simulation import simulate_smooth
    >>> rest = [0.1], [0.0]
    >>> run = simulate_smooth(rest, a=0.1, gamma=0.0, k=0.8, m=6, periods=1, solver=Switching())
    >>> round(float(run.final.u[0]), 6)  # u = 0.1 cos t
    0.1
    """

    method = "LSODA"
    tolerance: float = 1e-10


@dataclass(frozen=True)
class Implicit(_OfScipy):
    """Radau's method of order 5 with the exact Jacobian: to compare, or if walls ever get stiff.
    Used as `Switching` is."""

    method = "Radau"
    tolerance: float = 1e-8


def _stuck(method: str, t: float) -> NotConverged:
    return NotConverged(
        f"{method} cannot go on at t = {t:.6g}: its step has become too small; check the state, "
        "or take another solver (Explicit, Switching, Implicit) or tolerance"
    )


# --- as an integrator -----------------------------------------------------------------------------


def state_after(
    on: SmoothConditions,
    state: State,
    t0: float,
    span: float,
    *,
    slopes: bool = False,
    columns: Array | None = None,
) -> tuple[Array, Array | None, Array | None]:
    """Where a state gets to in some periods, as one row; with `slopes` also its derivatives in the
    state, times some columns if they are given, else also in the numbers `OWN`.

    Raises
    ------
    ArithmeticError
        Where the solver cannot go on: there are no equations there.
    """
    x, times = np.concatenate(state), np.array([t0 + PERIOD * span])
    # columns of the state's variations, then those of the parameters
    first = np.eye(x.size) if columns is None else columns
    params = len(OWN) if columns is None else 0
    varied = np.hstack([first, np.zeros((x.size, params))]) if slopes else np.empty(0)
    start = np.concatenate([x, varied.ravel()])
    rhs = right_side(on, start.size, params)
    try:
        end = Explicit(FINE).states(rhs, None, t0, start, times)[0]
    except NotConverged as error:
        raise ArithmeticError(str(error)) from error
    if not slopes:
        return end, None, None
    variations = end[x.size :].reshape(x.size, -1)
    wide = first.shape[1]
    return end[: x.size], variations[:, :wide], variations[:, wide:]


@dataclass
class SmoothIntegrator:
    """The integrator of smooth walls: a solver, period by period."""

    state: State
    conditions: SmoothConditions
    t0: float
    sample: Sample | None
    solver: Solver
    most_periods = 1

    def __post_init__(self) -> None:
        if isinstance(self.solver, type) or not hasattr(self.solver, "states"):
            raise BadInput(f"a solver, Explicit() for instance, was expected, got {self.solver!r}")
        tolerance = getattr(self.solver, "tolerance", FINE)  # a solver of a user's may have none
        number("tolerance", tolerance, 1e-16, 0.01, "that of a solver, from 1e-16 to 0.01")
        self.check(self.state, 0)

    def advance(self, periods: int, first: int, *, span: float = PERIOD) -> Chunk:
        """One period, or one of another length."""
        (u, v) = self.at(np.array([self.t0 + span]))[0]
        self.check(State(u, v), first + 1)
        dense, sample = np.empty((2, 0, 0)), self.sample
        if sample is not None and span == PERIOD:
            # integrated apart, so that looking at a run does not change it
            times = self.t0 + PERIOD / sample.per_period * np.arange(1, sample.per_period)
            states = [np.array(self.state)[None], *([self.at(times)] if times.size else [])]
            dense = np.concatenate(states)[:, :, list(sample.sites)].swapaxes(0, 1)
        self.state = State(u, v)
        return Chunk(first, u[None], v[None], *dense[:, None])

    def at(self, times: Array) -> Array:
        """The states at some times of the period to come: (times, 2, sites)."""
        y, on = np.concatenate(self.state), self.conditions
        rhs = right_side(on, y.size)
        states = self.solver.states(rhs, partial(jacobian, on), self.t0, y, times)
        return np.reshape(states, (len(times), 2, -1))

    def check(self, state: State, j: int) -> None:
        """Refuse a state far behind the walls: there the force is no longer the model's."""
        u, top = state.u, ceiling(float(self.conditions.m))
        n = int(np.abs(u).argmax())
        if np.all(np.isfinite(state)) and abs(u[n]) < top:
            return
        if j == 0:
            raise BadInput(
                f"u[{n}] = {u[n]:.6g} lies far behind the walls (for m = {self.conditions.m:g} a "
                f"velocity of 1000 gets as far as {top:.4g}): the energy would blow up."
            )
        raise NotConverged(
            f"the energy blows up in period {j}: u[{n}] = {u[n]:.6g} is far behind the walls; the "
            "forcing pumps the ring, or the solver's tolerance is too large"
        )
