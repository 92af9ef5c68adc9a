"""Periodic orbits of the flow, on rigid and smooth walls alike: fixed points of a Poincare map.

The map is the flow over 2 pi, or over half of it with the sign changed where walls of both sides
mirror each other: then a symmetric motion is a fixed point, any other of period 2 pi a cycle of
two. So what bifurcates from a motion is what bifurcates from cycles of maps: folds, branch points,
the doubling of a symmetric motion (PF) and of any other (PD), tori (NS), with their curves, normal
forms and arms.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property, lru_cache
from operator import attrgetter
from typing import Any, Unpack

import numpy as np
from numpy.typing import NDArray

from contbreather.checks import flag, whole
from contbreather.continuation.bifurcations import maps
from contbreather.continuation.bifurcations.maps import multiplier_matrix
from contbreather.continuation.curve.point import Event, Point, UnstableDimension
from contbreather.continuation.curve.problem import Problem
from contbreather.errors import BadInput, NotConverged
from contbreather.lattice.conditions import Conditions
from contbreather.lattice.forcing import check_symmetric, even_harmonics
from contbreather.one_thread import one_thread
from contbreather.parameters import NUMBERS, SMOOTH
from contbreather.simulation.integrator import RunStop, Sample
from contbreather.simulation.simulate import SimulationRun, completed, let_go
from contbreather.simulation.smooth import state_after
from contbreather.simulation.states import (
    OWN,
    PERIOD,
    ModelParameters,
    SmoothConditions,
    State,
    orbit_given,
    start_of,
    within_period,
)
from contbreather.simulation.variation import variation
from contbreather.storage.serialise import serialised
from contbreather.tables import Cell, HtmlRepr, Sheet, yes_or_no

Array = NDArray[Any]
Params = Mapping[str, float]

DOMAIN = {name: (entry.low, entry.high) for name, entry in {**NUMBERS, **SMOOTH}.items()} | {
    "m": (1.0, 2000.0),
}


# --- the map ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class PoincareMap:
    """The flow from t0 over a period, or over half of it with the sign changed."""

    on: Conditions | SmoothConditions
    t0: float
    half: bool

    @property
    def sign(self) -> float:
        return -1.0 if self.half else 1.0

    def image(self, x: Array, params: Params) -> Array:
        return self.sign * _flight(*self._asked(x, params))[0]

    def derivative(self, x: Array, params: Params) -> Array:
        return self.sign * _slopes(*self._asked(x, params))[0]

    def sensitivity(self, x: Array, params: Params, name: str) -> Array:
        """The derivative in a parameter, on smooth walls."""
        columns = _slopes(*self._asked(x, params))[1]
        assert columns is not None
        return self.sign * np.asarray(columns[:, OWN.index(name)])

    def _asked(self, x: Array, params: Params) -> Asked:
        span = 0.5 if self.half else 1.0  # periods of the forcing
        return self.on.at(params), x.tobytes(), within_period(self.t0), span


Asked = tuple[Conditions | SmoothConditions, bytes, float, float]


# kept, for residual, derivative, columns and events ask for the same few
@lru_cache(maxsize=8)
def _flight(
    on: Conditions | SmoothConditions, x: bytes, t0: float, span: float
) -> tuple[Array, SimulationRun | None]:
    """State after a span of time, and on rigid walls its run."""
    state = State(*np.frombuffer(x).reshape(2, -1))
    if isinstance(on, SmoothConditions):
        return state_after(on, state, t0, span)[0], None
    run = completed(let_go(state, on, periods=span, t0=t0, progress=False))
    if run.stop is not RunStop.DONE:
        raise ArithmeticError(run.reason)
    return np.concatenate(run.final), run


@lru_cache(maxsize=8)
def _slopes(
    on: Conditions | SmoothConditions, x: bytes, t0: float, span: float
) -> tuple[Any, Array | None]:
    """Its derivatives in the state, and on smooth walls in the parameters."""
    if isinstance(on, SmoothConditions):
        # integrated apart: the steps of both differ, and equations must not change with who asks
        state = State(*np.frombuffer(x).reshape(2, -1))
        return state_after(on, state, t0, span, slopes=True)[1:]
    run = _flight(on, x, t0, span)[1]
    assert run is not None
    return variation(run), None


# --- the motion ---------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class PeriodicMotion(HtmlRepr):
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
    conditions : Conditions or SmoothConditions
    matrix : ndarray, shape (2 N, 2 N)
        What becomes of perturbations over 2 pi n; over half of it, sign changed, if symmetric.
    residual : float
        Largest |state after - state before|.
    """

    state: State
    t0: float
    periods: int
    symmetric: bool
    conditions: Conditions | SmoothConditions
    matrix: Array
    residual: float

    @property
    def half(self) -> Array | None:
        """Multipliers, of symmetric motions those of the half map: +1 at PF, -1 at a fold."""
        # the sign of u(t + pi) = -u(t) is in the matrix, and not in the half flow
        return -_by_size(self.matrix) if self.symmetric else None

    @cached_property
    def multipliers(self) -> Array:
        """Over 2 pi n, largest first."""
        return _by_size(self.matrix) ** (2 if self.symmetric else 1)

    @property
    def largest(self) -> float:
        """Largest modulus of a multiplier over 2 pi n; below 1 the motion attracts."""
        return float(np.abs(self.multipliers[0]))

    @property
    def unstable(self) -> int:
        """Multipliers outside the unit circle by more than rounding."""
        # on smooth walls by more than the error of the integration
        slack = 1e-7 if isinstance(self.conditions, SmoothConditions) else 1e-9
        return int((np.abs(self.multipliers) > 1.0 + slack).sum())

    @property
    def growth(self) -> float:
        """Exponential rate, per unit of time, at which perturbations grow in the end."""
        return math.log(self.largest) / (PERIOD * self.periods)

    @property
    def problem(self) -> Problem:
        """The motion as a start for `trace`."""
        on = self.conditions
        halves = 1 if self.symmetric else 2 * self.periods
        return problem_of_cycle(on, self.t0, self.state, halves if _mirrored(on) else self.periods)

    def table(self) -> Sheet:
        """Its residual, the growth of perturbations, and what it moves under."""
        rows: list[tuple[str, Cell]] = [
            ("repeats after periods", self.periods),
            ("symmetric", yes_or_no(self.symmetric)),
            ("closes to", self.residual),
            ("largest |multiplier|", self.largest),
            ("multipliers outside", self.unstable),
        ]
        return Sheet.of([*rows, *self.conditions.params.items()])

    def run(self, *, periods: float | None = None, sample: Sample | None = None) -> Any:
        """The motion itself, simulated over its period or longer."""
        length = self.periods if periods is None else periods
        return let_go(self.state, self.conditions, periods=length, t0=self.t0, sample=sample)

    def __repr__(self) -> str:
        numbers = ", ".join(f"{name} = {x:g}" for name, x in self.conditions.params.items() if x)
        after = "half a period" if self.symmetric else f"{self.periods} x 2 pi"
        return (
            f"<PeriodicMotion on the {self.conditions.lattice.describe()} at {numbers}: closes "
            f"after {after} to {self.residual:.1g}; largest multiplier {self.largest:.6g}>"
        )


@one_thread
def _by_size(matrix: Array) -> Array:
    values = np.linalg.eigvals(matrix)
    return np.asarray(values[np.argsort(-np.abs(values), kind="stable")])


@one_thread
def periodic(
    state: Any,
    *,
    periods: int | None = None,
    symmetric: bool = False,
    m: float | None = None,
    t0: float = 0.0,
    **on: Unpack[ModelParameters],
) -> PeriodicMotion:
    """The periodic motion of a lattice nearest to a state.

    Parameters
    ----------
    state, t0, on
        As in `simulate`. t0 must not be the time of an impact of the motion looked for.
    periods : int, optional
        n, for a period of 2 pi n: 1 unless given, or that of an orbit.
    symmetric : bool
        Look for u(t + pi) = -u(t): half the work, and its own multipliers tell a pitchfork from
        a fold. With ``periods=1`` only.
    m : float, optional
        On smooth walls (21) of this hardness instead of rigid ones.

    Returns
    -------
    PeriodicMotion
        A start for `trace` in a, gamma, k (lam and m on smooth walls), damping, spring or a
        parameter of the forcing. Unknowns are the arrays ``u`` and ``v`` at its t0; columns
        ``largest`` and ``unstable`` are computed from the multipliers over the period. Where an
        impact comes to t0 they jump and the branch ends without an event (MX); it goes on with
        another t0. Where a site comes to touch a wall without an impact it ends so, too, up to
        1e-3 before.

    Raises
    ------
    NotConverged
        If Newton's method finds none; the residual tells how far it got.

    Examples
    --------
    >>> from contbreather.orbits import symmetric
    >>> from contbreather.continuation import trace
    >>> b = symmetric(a=0.1, gamma=0.05, k=0.8)
    >>> found = periodic(b.state(6), a=0.1, gamma=0.05, k=0.8, damping=0.02, symmetric=True)
    >>> round(found.largest, 4)
    0.9481
    >>> branch = trace(found, "a", towards="down", within={"a": (0.05, 0.2)})
    >>> round(branch.first("LP")["a"], 4)  # without damping 0.0644
    0.0863
    """
    start, conditions = start_of(state, m, t0, **on)
    if periods is None:
        orbit = orbit_given(state)
        periods = 1 if orbit is None else orbit.section.turns
    return closing(start, conditions, periods=periods, symmetric=symmetric, t0=t0)


def closing(
    start: State,
    on: Conditions | SmoothConditions,
    *,
    periods: int = 1,
    symmetric: bool = False,
    t0: float = 0.0,
) -> PeriodicMotion:
    """`periodic`, near a state and under conditions that have been checked."""
    count = whole("periods", periods, 1)
    if flag("symmetric", symmetric) and count != 1:
        raise BadInput(f"periods = {count}: a symmetric motion has the period 2 pi of its forcing.")
    if symmetric:
        check_symmetric(on.forcing)
    if symmetric and not _mirrored(on):
        raise BadInput(
            "the walls are not symmetric, so no motion is its own mirror image half a period "
            "later; look for the whole period, symmetric=False."
        )
    step = PoincareMap(on, t0, symmetric)
    names, slopes = {"u": start.u, "v": start.v}, step.derivative
    problem = maps.FixedPoint(step.image, names, on.params, period=count, jacobian=slopes)
    try:
        problem = problem.solve()[0]
    except ArithmeticError as error:  # the run from the state given does not come to its end
        raise NotConverged(str(error)) from error
    except NotConverged as error:
        raise NotConverged(
            "no periodic motion near this state: Newton's method finds none from a residual of "
            f"{error.residual:.2g}; start closer, or let the damped lattice settle first.",
            residual=error.residual,
        ) from error
    x, defect = problem.x, problem.residual
    assert problem.jacobian is not None
    # of G(x) - x the derivative is that of the map less 1
    matrix = np.asarray(problem.jacobian(x, on.params)) + np.eye(x.size)
    residual = float(np.abs(defect(x, on.params)).max())
    return PeriodicMotion(State(*np.split(x, 2)), float(t0), count, symmetric, on, matrix, residual)


def _mirrored(on: Conditions | SmoothConditions) -> bool:
    """Say if a motion and its mirror image obey the same laws."""
    return not even_harmonics(on.forcing) if isinstance(on, SmoothConditions) else on.symmetric


# --- as a problem of the engine -------------------------------------------------------------------


def problem_of_cycle(
    on: Conditions | SmoothConditions, t0: float, state: State, period: int
) -> Problem:
    """A fixed point, or a cycle of that period, of the map of half a period where there is one."""
    back = PoincareMap(on, t0, _mirrored(on))
    problem = maps.FixedPoint(
        back.image,
        {"u": state.u, "v": state.v},
        on.params,
        period=period,
        jacobian=back.derivative,
        domain={name: DOMAIN[name] for name in on.params if name in DOMAIN}
        | {"gamma": (0.0, on.lattice.highest_gamma)},
        scales={"m": 10.0} if "m" in on.params else {},
    )
    return _dressed(problem, back)


def _dressed(problem: Problem, back: PoincareMap) -> Problem:
    """Cycles of a map with the events, columns, arms and sentences of motions."""
    motion = MotionProblem(
        **{entry.name: getattr(problem, entry.name) for entry in fields(Problem)}, back=back
    )
    return replace(
        motion,
        events=_events(back.on, motion.breaks),
        record={
            "largest": attrgetter("solution.largest"),
            "unstable": UnstableDimension(attrgetter("solution.unstable")),
        },
        label=f"{'symmetric ' if motion.symmetric else ''}motion of period {2 * motion.periods} pi",
    )


@dataclass(frozen=True, eq=False, repr=False)
class MotionProblem(maps.MapCycleProblem):
    """Cycles of the map of a motion that comes back."""

    back: PoincareMap = field(kw_only=True)

    @property
    def symmetric(self) -> bool:
        return self.back.half and self.period % 2 == 1

    @property
    def periods(self) -> int:
        """Periods of the forcing in one of the motion."""
        return self.period // (2 if self.back.half and not self.symmetric else 1)

    @property
    def breaks(self) -> str:
        return "PF" if self.symmetric else "PD"

    @property
    def serialised(self) -> Mapping[str, Any]:
        return {
            "kind": "returning motion",
            "conditions": self.back.on,
            "t0": self.back.t0,
            "period": self.period,
        }

    def interpret(self, point: Point) -> PeriodicMotion:  # type: ignore[override]
        back, params = self.back, point.params
        state, on = State(*np.split(point.x.copy(), 2)), back.on.at(params)
        gap = float(np.abs(self.residual(point.x, params)).max())
        matrix = multiplier_matrix(point)
        return PeriodicMotion(state, back.t0, self.periods, self.symmetric, on, matrix, gap)

    @property
    def sensitivity(self) -> Callable[[Array, Params, str], Array] | None:  # type: ignore[override]
        on = self.back.on
        exact = isinstance(on, SmoothConditions) and not on.forcing.params

        def along(x: Array, params: Params, name: str) -> Array:
            back, total = self.back, np.zeros(x.size)
            # x_(n+1) = P(x_n, p): dx_(n+1)/dp = P_x dx_n/dp + P_p
            for place in self.residual.phases(x, params):
                slope = back.sensitivity(place, params, name)
                total = back.derivative(place, params) @ total + slope
            return total

        return along if exact else None

    def over(self, rounds: int) -> Problem:
        return _dressed(super().over(rounds), self.back)


def _events(on: Conditions | SmoothConditions, flip: str) -> tuple[Event, ...]:
    """Events of maps. Without losses the pairs of a lattice lie on the circle, or as close to it as
    they are long, and which is outside is no event."""
    fold, crossing, doubling, torus = maps.EVENTS
    events = (fold, crossing, replace(doubling, kind=flip))
    return (*events, torus, Event("MX", None, count=_outside)) if on.damping > 0.0 else events


def _outside(point: Point) -> float | int:
    """Multipliers outside, which every other event changes: a change without one is said."""
    return math.nan if point.params["damping"] == 0.0 else point.solution.unstable


@serialised("returning motion")
def _read(
    *,
    conditions: Conditions | Mapping[str, Any],
    t0: float,
    period: int,
    start: Mapping[str, Any],
    params: Mapping[str, float],
) -> Problem:
    on: Any = SmoothConditions(**conditions) if isinstance(conditions, Mapping) else conditions
    return problem_of_cycle(on.at(params), t0, State(start["u"], start["v"]), period)
