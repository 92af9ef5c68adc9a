"""The smooth chain, eqs. (21) and (22): walls of finite stiffness, by a general ODE solver.

``u_n'' + gamma (2 u_n - u_n-1 - u_n+1) + mu u_n' + lambda (2m+1) u_n^(2m) u_n' + (2m+1) u_n^(4m+1)
= F(t)``, with F = -a cos t: the paper prints +a cos t in (21), yet compares with (13), whose
forcing is -a cos t. For m -> infinity this is the impacting ring with the k of (22). For real m,
u^(2m) is |u|^(2m).

Measured at m = 6, 20, 50 and N = 20 (``python -m tests.benchmarks --only simulation``) the chain is
not stiff: Dormand and Prince's method of order 8 with a compiled right-hand side is the fastest at
every accuracy; implicit methods take 20 to 60 times as long at equal error. u^(2m) is invisible to
its step control in mid flight, so its step is capped at 0.2.

A state y is (u, u'), and behind it a matrix with as many rows, row by row, whose columns are
variations; the last ``params`` of them, none or six, those in the first of `SmoothParameters`.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from contbreather.errors import BadInput, NotConverged, deferred
from contbreather.kernels import Kernel, Matrix, Vector
from contbreather.lattice.finite import stiffness_of
from contbreather.lattice.forcing import series_motion
from contbreather.simulation.integrator import Chunk, Sample, forced_motion
from contbreather.simulation.states import OWN, PERIOD, SmoothConditions, State

Array = NDArray[Any]

TOLERANCE = 1e-10  # of a run, unless one is given


class SmoothParameters(NamedTuple):
    """Parameters of the smooth chain; the first six are those of the variations, in order."""

    a: float
    gamma: float
    lam: float
    m: float
    mu: float
    spring: float
    force: Matrix  # F/a, m, A, B of each harmonic in rows
    entries: Matrix  # of the stiffness matrix over the masses: site, other, value
    drive: Vector  # by how much of F each site is driven


def ceiling(m: float) -> float:
    """The displacement at which the wall has stopped a velocity of 1000."""
    # u^(4m+2)/2 is what the wall stores
    return 1000.0 ** (1.0 / (2.0 * m + 1.0))


def accelerations(t: float, y: Vector, on: SmoothParameters, out: Vector) -> None:
    """(u', u'') of (21), for y that begins with (u, u')."""
    size, push = on.drive.size, on.a * series_motion(on.force, t)[0]
    # far behind the wall, where it stores a million times the usual energy, a trial step costs a
    # rejection and no overflow; accepted states are checked by the caller
    top = ceiling(on.m)
    for n in range(size):
        u, v = y[n], y[size + n]
        inside = min(max(u, -top), top)
        q = abs(inside) ** (2.0 * on.m)
        wall = (2.0 * on.m + 1.0) * q * (on.lam * v + q * inside)
        out[n] = v
        out[size + n] = on.drive[n] * push - on.spring * u - on.mu * v - wall
    for i in range(on.entries.shape[0]):
        site, other = int(on.entries[i, 0]), int(on.entries[i, 1])
        out[size + site] -= on.gamma * on.entries[i, 2] * y[other]


def wall_slopes(u: float, v: float, lam: float, m: float, top: float) -> tuple[float, float, float]:
    """Derivatives of the wall's force in u, in u' over lambda, and in m."""
    inside = min(max(u, -top), top)
    size = abs(inside)
    q, weight = size ** (2.0 * m), 2.0 * m + 1.0
    dq = 2.0 * m * q / inside if size > 0.0 else 0.0
    log = 2.0 * math.log(size) if size > 0.0 else 0.0  # d q/dm = q log u^2
    # of lambda q u' and q^2 u = |u|^(4m) u
    in_u = weight * (lam * v * dq + (4.0 * m + 1.0) * q * q)
    in_m = 2.0 * q * (lam * v + q * inside)
    in_m += weight * q * log * (lam * v + 2.0 * q * inside)
    return in_u, weight * q, in_m


def rates(t: float, y: Vector, on: SmoothParameters, params: int, out: Vector) -> None:
    """Rates of change of the motion and its variations."""
    accelerations(t, y, on, out)
    size = on.drive.size
    columns = y.size // (2 * size) - 1
    if columns == 0:
        return
    push, top = series_motion(on.force, t)[0], ceiling(on.m)
    begin, half = 2 * size, size * columns  # of the matrix, and of its lower half behind that
    for n in range(size):
        u, v = y[n], y[size + n]
        in_u, density, in_m = wall_slopes(u, v, on.lam, on.m, top)
        stiff, drag = on.spring + in_u, on.mu + on.lam * density
        at = begin + n * columns
        low = at + half
        # rows as arrays of their own: whose indices are seen to be in order, so that several
        # columns are computed at once
        du, dv, dw = y[at : at + columns], y[low : low + columns], out[low : low + columns]
        velocity = out[at : at + columns]
        for i in range(columns):
            velocity[i] = dv[i]
            dw[i] = -stiff * du[i] - drag * dv[i]
        if params > 0:
            in_params = dw[columns - params :]
            in_params[0] += on.drive[n] * push
            in_params[2] -= density * v
            in_params[3] -= in_m
            in_params[4] -= v
            in_params[5] -= u
    for i in range(on.entries.shape[0]):
        site, other, weight = int(on.entries[i, 0]), int(on.entries[i, 1]), on.entries[i, 2]
        at, low = begin + other * columns, begin + half + site * columns
        du, dw, pull = y[at : at + columns], out[low : low + columns], on.gamma * weight
        for j in range(columns):
            dw[j] -= pull * du[j]
        if params > 0:
            dw[columns - params + 1] -= weight * y[other]


RATES = Kernel(rates)


# --- the solver -----------------------------------------------------------------------------------


@lru_cache(maxsize=16)
def smooth_parameters(on: SmoothConditions) -> SmoothParameters:
    """Conditions as the kernels take them."""
    table = stiffness_of(on.lattice).tocoo()
    weight = table.data / np.asarray(on.lattice.masses)[table.row]
    # (site, other, value)
    entries = np.ascontiguousarray(np.array([table.row, table.col, weight], dtype=float).T)
    a, gamma, lam, m, mu, spring = (float(getattr(on, name)) for name in OWN)
    force = forced_motion(on.forcing, 1.0, 0.0)[1]
    return SmoothParameters(a, gamma, lam, m, mu, spring, force, entries, on.lattice.drive)


def right_side(on: SmoothConditions, size: int, params: int = 0) -> Callable[[float, Array], Array]:
    """Rates of change of a state, with variations of it; see `rates`."""
    # to copy both costs less than to look up where they are
    state, out = np.empty(size), np.empty(size)
    fill = RATES.following(state, smooth_parameters(on), params, out)

    def at(t: float, y: Array) -> Array:
        state[...] = y
        fill(t)
        return out.copy()

    return at


def integrated(
    on: SmoothConditions, t0: float, y: Array, times: Array, tolerance: float, params: int = 0
) -> Array:
    """A state, with variations of it, carried to each of the times."""
    with deferred():
        from scipy.integrate import ode

    rhs = right_side(on, y.size, params)
    settings: dict[str, Any] = {"rtol": tolerance, "atol": tolerance}
    # beta heeds the error of the step before, too (Hairer and Wanner II, IV.2): on the way into
    # a wall half as many steps are rejected, which saves a sixth of all calls
    # steps of at most 0.2, a thirtieth of the period, from the first one on
    settings |= {"max_step": 0.2, "first_step": 0.2, "nsteps": 10**6, "beta": 0.04}
    solver: Any = ode(rhs).set_integrator("dop853", **settings).set_initial_value(y, t0)
    out = np.empty((len(times), y.size))
    with warnings.catch_warnings(), deferred():
        warnings.simplefilter("ignore", UserWarning)  # its failure is an error, below
        for i, t in enumerate(times):
            out[i] = solver.integrate(t)
            if not solver.successful():
                raise NotConverged(
                    f"dop853 cannot go on at t = {t:.6g}: its step has become too small; check the "
                    "state, or take another tolerance"
                )
    return out


def state_after(
    on: SmoothConditions,
    state: State,
    t0: float,
    span: float,
    *,
    slopes: bool = False,
    columns: Array | None = None,
) -> tuple[Array, Array | None, Array | None]:
    """A state some periods later, as one row; with `slopes` also its derivatives in the state,
    times some columns if they are given, else also in the numbers `OWN`. Where the solver cannot
    go on there are no equations: an ArithmeticError."""
    x, times = np.concatenate(state), np.array([t0 + PERIOD * span])
    # columns of the state's variations, then those of the parameters
    first = np.eye(x.size) if columns is None else columns
    params = len(OWN) if columns is None else 0
    varied = np.hstack([first, np.zeros((x.size, params))]) if slopes else np.empty(0)
    start = np.concatenate([x, varied.ravel()])
    try:
        # finer than a run: Newton's method goes by these derivatives
        end = integrated(on, t0, start, times, 1e-12, params)[0]
    except NotConverged as error:
        raise ArithmeticError(str(error)) from error
    if not slopes:
        return end, None, None
    variations = end[x.size :].reshape(x.size, -1)
    wide = first.shape[1]
    return end[: x.size], variations[:, :wide], variations[:, wide:]


@dataclass
class SmoothIntegrator:
    """The integrator of smooth walls, period by period."""

    state: State
    conditions: SmoothConditions
    t0: float
    sample: Sample | None
    tolerance: float
    most_periods = 1

    def __post_init__(self) -> None:
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
        y = np.concatenate(self.state)
        states = integrated(self.conditions, self.t0, y, times, self.tolerance)
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
            "forcing pumps the ring, or the tolerance is too large"
        )
