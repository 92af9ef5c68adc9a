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

import math
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from typing import Any, ClassVar, Protocol, Unpack

import numpy as np
from numpy.typing import NDArray

from contbreather.checks import number
from contbreather.errors import BadInput, NotConverged, deferred
from contbreather.lattice.conditions import Conditions
from contbreather.lattice.finite import Finite, drive_of, stiffness_of
from contbreather.lattice.forcing import Forcing, Harmonic
from contbreather.lattice.formula import forcing_of
from contbreather.parameters import parameter
from contbreather.progress import Bar
from contbreather.simulation.integrator import Chunk, Sample, check_sample, forced_motion
from contbreather.simulation.simulate import States, advance, gathered, states_of, to_content
from contbreather.simulation.smooth_flow import RATES, SmoothParameters, ceiling
from contbreather.simulation.states import (
    PERIOD,
    LatticeParameters,
    State,
    check_state,
    conditions_of,
    lattice_for,
    ranged,
    reduced,
    without_noise,
)
from contbreather.storage.serialise import serialised, to_dict

Array = NDArray[Any]

FINE = 1e-12  # tolerance where derivatives are asked for
CAP = 0.2  # largest step of any solver
OWN = ("a", "gamma", "lam", "m", "damping", "spring")  # in the order of the compiled variations
MOST = 1_000_000  # steps between two outputs


def damping_of(k: float) -> float:
    """lambda of the smooth wall with restitution k, eq. (22) solved for it.

    Examples
    --------
    >>> round(damping_of(0.8), 12)
    0.141700600391
    """
    k = parameter("k", k)
    if k == 0.0:
        return 2.0  # the limit of (22) for k -> 0, where it is a quotient of infinities
    loss = -math.log(k)
    return 2.0 * loss / math.hypot(math.pi, loss)


def restitution_of(lam: float) -> float:
    """k of the smooth wall with the damping lambda, eq. (22).

    Examples
    --------
    >>> round(restitution_of(damping_of(0.8)), 12)
    0.8
    """
    lam = parameter("lam", lam)
    if lam == 2.0:
        return 0.0
    return math.exp(-0.5 * math.pi * lam / math.sqrt(1.0 - 0.25 * lam * lam))


@dataclass(frozen=True)
class SmoothConditions:
    """What a lattice with smooth walls moves under; lam and m are those of (21)."""

    a: float
    gamma: float
    lam: float
    m: float
    damping: float = 0.0
    spring: float = 0.0
    forcing: Forcing = field(default_factory=Harmonic)
    lattice: Finite = field(kw_only=True)

    @property
    def k(self) -> float:
        """Restitution of the impacting limit, (22)."""
        return restitution_of(self.lam)

    @property
    def params(self) -> dict[str, float]:
        """All parameters by name, those of the forcing last."""
        return {**{name: getattr(self, name) for name in OWN}, **self.forcing.params}

    def to_dict(self) -> dict[str, Any]:
        """By numbers and names, for files."""
        numbers = {name: float(getattr(self, name)) for name in OWN}
        return {**numbers, "forcing": to_dict(self.forcing), "lattice": to_dict(self.lattice)}

    def at(self, params: Mapping[str, float]) -> SmoothConditions:
        """The same with other values of its parameters, or with the lam of another k."""
        values = {name: float(params.get(name, value)) for name, value in self.params.items()}
        if "k" in params:
            values["lam"] = damping_of(params["k"])
        numbers: dict[str, Any] = {name: values.pop(name) for name in OWN}
        return replace(
            self, **numbers, forcing=self.forcing.at(**values) if values else self.forcing
        )

    @property
    def parameters(self) -> SmoothParameters:
        """What the kernels take."""
        a, gamma, lam, m, mu, spring = (float(getattr(self, name)) for name in OWN)
        force = forced_motion(self.forcing, 1.0, 0.0)[1]
        return SmoothParameters(a, gamma, lam, m, mu, spring, force, *_network(self.lattice))


def smooth_conditions_of(
    sites: int,
    *,
    k: float | None = None,
    lam: float | None = None,
    forcing: Forcing | str | None = None,
    lattice: Finite | None = None,
    **numbers: float,
) -> SmoothConditions:
    """The conditions of a state of so many sites, on a ring unless a lattice is given."""
    without_noise(numbers)
    if (k is None) == (lam is None):
        raise BadInput(f"k = {k}, lam = {lam}: give one of them, (22) ties the other to it.")
    wall: Any = lam if k is None else damping_of(k)
    where, drive = lattice_for(sites, lattice), forcing_of(forcing)
    return ranged(SmoothConditions(lam=wall, forcing=drive, lattice=where, **numbers))


def rigid_or_smooth(sites: int, m: float | None = None, **on: Any) -> Conditions | SmoothConditions:
    """The conditions of rigid walls, or of smooth ones if there is a hardness m."""
    if m is None:
        return conditions_of(sites, **on)
    if on.pop("walls", None) is not None:
        raise BadInput("smooth walls are at -1 and 1: leave walls out, or m")
    return smooth_conditions_of(sites, m=m, **on)


@lru_cache(maxsize=16)
def _network(lattice: Finite) -> tuple[Array, Array]:
    """Entries of the stiffness matrix over the masses, (site, other, value), and the drive."""
    table = stiffness_of(lattice).tocoo()
    weight = table.data / np.asarray(lattice.masses)[table.row]
    entries = np.array([table.row, table.col, weight], dtype=float)
    return np.ascontiguousarray(entries.T), drive_of(lattice)


class SmoothModelParameters(LatticeParameters, total=False):
    """The keywords of `simulate_smooth` that say what a lattice moves under."""

    k: float | None
    lam: float | None


# --- solvers --------------------------------------------------------------------------------------

Rhs = Callable[[float, Array], Array]


def right_side(on: SmoothConditions, size: int, params: int = 0) -> Rhs:
    """What a state, with variations of it, changes by; see `smooth_flow`."""
    # to copy both costs less than to look up where they are
    state, out = np.empty(size), np.empty(size)
    fill = RATES.following(state, on.parameters, params, out)

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


# --- runs -----------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class SmoothRun(States):
    """What `simulate_smooth` leaves behind; attributes as in `Run`, without a table of impacts."""

    def __repr__(self) -> str:
        return (
            f"<SmoothRun of {self.sites} sites over {self.length} periods, "
            f"m = {self.conditions.m:g}; {self.stop.value}>"
        )


@serialised("smooth run", SmoothRun, to_content)
def _smooth_run(columns: Any, conditions: Any, **ended: Any) -> SmoothRun:
    return SmoothRun(conditions=SmoothConditions(**conditions), **states_of(columns, **ended))


def simulate_smooth(
    state: Any,
    *,
    m: float,
    periods: float,
    t0: float = 0.0,
    sample: Sample | None = None,
    solver: Solver | None = None,
    progress: bool | Bar | None = None,
    **on: Unpack[SmoothModelParameters],
) -> SmoothRun:
    """Let a lattice with smooth walls (21) go from any state.

    Parameters
    ----------
    state : pair of array_like, shape (N,)
    periods, t0, sample, progress, on
        As in `simulate`, without walls: they are at -1 and 1.
    m : float
        Hardness of the walls, from 0.5 to 1e4; (21) has natural numbers, a real one is taken with
        |u|.
    k, lam : float
        Among `on`: restitution of the impacting limit, or lambda of (21), one of the two.
    solver : Solver, optional
        `Explicit` unless given; `Switching` and `Implicit` are there to compare.

    Raises
    ------
    BadInput
        Parameters outside their range, or a state far behind the walls.
    NotConverged
        If the energy blows up or the solver cannot go on.

    Examples
    --------
    >>> from contbreather.orbits import symmetric
    >>> b = symmetric(a=0.5, gamma=0.08, k=0.8)
    >>> run = simulate_smooth(b.state(20), a=0.5, gamma=0.08, k=0.8, m=20, periods=1)
    >>> bool(abs(run.final.u - run.strobe.u[0]).max() < 0.05)
    True
    """
    start = check_state(state)
    conditions = smooth_conditions_of(start.u.size, m=m, **on)
    settings: dict[str, Any] = {"sample": sample, "solver": solver, "progress": progress}
    run: SmoothRun = let_go(start, conditions, periods=periods, t0=t0, **settings)
    return run


def let_go(
    state: State,
    on: Conditions | SmoothConditions,
    *,
    periods: float,
    t0: float = 0.0,
    sample: Sample | None = None,
    progress: bool | Bar | None = None,
    solver: Solver | None = None,
) -> Any:
    """The run of a state under rigid or smooth walls that have been checked."""
    if isinstance(on, Conditions):
        return advance(state, on, periods=periods, t0=t0, sample=sample, progress=progress)
    check_sample(sample, state.u.size)
    how = Explicit() if solver is None else solver
    integrator = SmoothIntegrator(state, on, reduced(t0), sample, how)
    return SmoothRun(**gathered(integrator, periods=periods, t0=t0, progress=progress)[0])


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
        # integrated apart, so that looking at a run does not change it
        dense = self.dense() if span == PERIOD else np.empty((2, 0, 0))
        self.state = State(u, v)
        return Chunk(first, u[None], v[None], *dense[:, None])

    def dense(self) -> Array:
        """Displacements and velocities of the sampled sites in the period to come."""
        if self.sample is None:
            return np.empty((2, 0, 0))
        times = self.t0 + PERIOD / self.sample.per_period * np.arange(1, self.sample.per_period)
        states = [np.array(self.state)[None], *([self.at(times)] if times.size else [])]
        return np.concatenate(states)[:, :, list(self.sample.sites)].swapaxes(0, 1)

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
