"""A periodic orbit of flows as a value, and as a problem to trace."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property, partial, reduce
from itertools import pairwise
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..continuation.algebra.derivatives import directional
from ..continuation.algebra.newton import Array, Undefined, newton
from ..continuation.algebra.sparse import Matrix
from ..continuation.branches.switching import Seed, SwitchingProblem
from ..continuation.curve.curve import Curve
from ..continuation.curve.point import Event, Point, UnstableDimension
from ..continuation.curve.problem import Problem
from ..continuation.systems.branch_points import crossing
from ..errors import BadInput
from ..one_thread import one_thread
from ..tables import HtmlRepr, Sheet
from .collocation import TrajectorySegment, fitted, sizes_of
from .conservation import drift, indices_of, refuse_drift
from .equations import FlowEquations
from .flow import Flow, Wall, flow_between, refuse_false_period, slid_along, system_of
from .functions import Function, Params, values
from .integrate import bottom
from .jacobian import at_other_time
from .multipliers import around, closing_matrix, of_cycle, paces
from .sparse_equations import SparseFlowEquations

# of an orbit without a trivial multiplier, the highest term of its polynomials: about as far off
UNRESOLVED = 5e-3
RETURNS = 24  # so many flows back is looked for a return
_REPEATS = 1e-3  # of its size: as near as this to itself a round later it is the same again
_LOOKS = 4  # into each interval for that
SHORTEST = 2e-6  # of an orbit: a flow as short counts as none; what is off is the square of that


@dataclass(frozen=True, eq=False)
class Cycle(HtmlRepr):
    """A periodic orbit: where it is at any time, its period and its multipliers.

    What ``point.solution`` is on the branches of `contbreather.cycle`.

    Attributes
    ----------
    period : float
        The sum of the durations of its flows. Of a symmetric orbit that is written as half of
        itself with a mirror as `reset`, that half.
    multipliers : ndarray
        Of small perturbations over the period, the largest first, of many states (more than 250,
        given with a sparse `jacobian`) the leading ones; the trivial one of an autonomous orbit is
        among them. One is infinite where an impact loses its velocity (VI),
        where all others are NaN.
    trivial : float
        That one, 1 but for what the mesh does not resolve; NaN for forced orbits. Where something
        is conserved there are several, and this is the one that is farthest off 1.
    indices : ndarray
        Stability indices (mu + 1/mu)/2 of all other pairs of multipliers where something is
        conserved: the pair is on the unit circle where that is real and from -1 to 1.
    unstable : int
        How many multipliers are outside of the unit circle.
    times : ndarray
        When its flows begin, and when the last one ends.
    max, min : dict
        The largest and the smallest value of each state, or of all of an array of them, as long
        as `period` is.

    Examples
    --------
    >>> import contbreather as cb
    >>> ring = cb.cycle(lambda t, x, p: [x[0] - x[1] - x[0] * (x[0]**2 + x[1]**2),
    ...                                  x[0] + x[1] - x[1] * (x[0]**2 + x[1]**2)],
    ...                 start={"x": 1.0, "y": 0.1}, params={"mu": 1.0}, settle=20)
    >>> orbit = cb.flows.cycle_of(ring)
    >>> round(orbit.period / (2 * np.pi), 10), round(float(orbit.multipliers[1].real) * 1e6, 3)
    (1.0, 3.487)
    """

    equations: FlowEquations
    x: Array
    params: Mapping[str, float]

    @cached_property
    def flights(self) -> tuple[TrajectorySegment, ...]:
        return self.equations.flights(self.x, self.params)

    @property
    def durations(self) -> Array:
        return np.array([flight.duration for flight in self.flights])

    @property
    def period(self) -> float:
        return float(self.durations.sum())

    @property
    def times(self) -> Array:
        return self.flights[0].start + np.append(0.0, np.cumsum(self.durations))

    def states(self, t: Any) -> Array:
        """The states at a time or at times, shape (n,) or (n, len(t)); just after a reset at the
        time of one. Times are taken modulo the period."""
        t = np.asarray(t, dtype=float)
        start = self.flights[0].start
        inside = start + np.mod(np.atleast_1d(t) - start, self.period)
        if len({flight.dimension for flight in self.flights}) > 1:
            raise BadInput("the flows have different states: look at them one by one in `flights`")
        states = _states(self.flights, inside)
        return states[:, 0] if t.ndim == 0 else states

    @property
    def begin_of_orbit(self) -> tuple[Any, dict[str, float], Params, float, float, float]:
        """Its flows, the state at its start, parameters, the period, when it starts, and how exact
        a step is: what `contbreather.integrate` goes on from."""
        first = self.flights[0]
        state = dict(zip(self.equations.states, first.states[0].tolist(), strict=False))
        return self.equations.flows, state, self.params, self.period, first.start, 1e-12

    @cached_property
    def max(self) -> dict[str, float]:
        return {name: self.extreme(name, 1.0) for name in self.equations.parts}

    @cached_property
    def min(self) -> dict[str, float]:
        return {name: self.extreme(name, -1.0) for name in self.equations.parts}

    def extreme(self, name: str, sign: float) -> float:
        """The largest value of a state, or of all of an array; with -1 the smallest."""
        equations = self.equations
        wanted = equations.parts.get(name, (name,))
        i = equations.states.index(wanted[0])
        part = slice(i, i + len(wanted))
        return sign * max(_top(f, part, sign) for f in self.flights if i < f.dimension)

    @cached_property
    @one_thread
    def _spectrum(self) -> tuple[NDArray[np.complex128], Array]:
        return of_cycle(self.equations, self.x, self.params)

    @property
    def others(self) -> NDArray[np.complex128]:
        """Multipliers but the trivial one."""
        return self._spectrum[0]

    @property
    def trivial(self) -> float:
        ones = self._spectrum[1]
        return float(ones[abs(ones - 1).argmax()]) if ones.size else math.nan

    @property
    def multipliers(self) -> NDArray[np.complex128]:
        mu: NDArray[np.complex128] = np.concatenate(self._spectrum)
        return mu[np.argsort(-abs(mu), kind="stable")]

    @property
    def paired(self) -> bool:
        """Tell whether multipliers come in pairs, as where something is conserved."""
        return self.equations.conservation is not None

    @cached_property
    def symplectic(self) -> tuple[Array, Array | None]:
        """The derivative of the turn where it begins, and the symplectic form, where it is known:
        where the field is a constant matrix J times the gradient of what is conserved."""
        (factors,), _ = around(self.equations, self.x, self.params)
        kept, states = self.equations.conservation, self.flights[0].states.T
        assert kept is not None
        J = kept.poisson(self.equations.flows[0].f, states, self.params)
        return reduce(np.matmul, factors[::-1]), None if J is None else np.asarray(np.linalg.inv(J))

    @cached_property
    def indices(self) -> NDArray[np.complex128]:
        if not self.paired:
            raise BadInput("multipliers come in pairs where something is conserved: conserves=")
        return indices_of(self.others)

    @property
    def unstable(self) -> int:
        if self.paired:
            outside = (self.indices.imag != 0) | (abs(self.indices.real) > 1 + 1e-10)
            return int(outside.sum())
        return int((abs(self.others) > 1 + 1e-9).sum())  # closer than that is on the circle

    @property
    def coarse(self) -> str:
        """Reason why the mesh does not resolve the orbit; empty if it does."""
        # of a large flow multipliers are not asked for here
        off = abs(self.trivial - 1) if self.equations.condensed else math.nan
        if off <= 1e-4:  # so far off 1 it may be of a resolved orbit
            return ""
        pairs = zip(self.flights, self.equations.sizes, strict=True)
        # orbits of less than 1e-8 of the size at the start are rounding
        left = [flight.unresolved(1e-8 * size.max()) for flight, size in pairs]
        i = max(range(len(left)), key=lambda i: left[i][0])
        if math.isnan(off) and left[i][0] <= UNRESOLVED:
            return ""
        where = self.times[i] + left[i][1] * self.flights[i].duration
        why = "" if math.isnan(off) else f"the trivial multiplier is {off:.1g} off 1, "
        return (
            f"{why}the mesh is too coarse near t = {where:.4g}: "
            "collocation=Collocation(intervals=...)"
        )

    def table(self) -> Sheet:
        rows: list[tuple[str, Any]] = [("period", self.period)]
        rows += [(name, float(value)) for name, value in self.params.items()]
        rows += [
            (f"{what}({n})", v) for what in ("min", "max") for n, v in getattr(self, what).items()
        ]
        leading = self.multipliers[:12].tolist()  # of a large flow there are many
        rows += [(f"multiplier {i}", mu) for i, mu in enumerate(leading, 1)]
        return Sheet.of(rows)

    def __repr__(self) -> str:
        return f"<Cycle of period {self.period:.10g}, {self.unstable} unstable>"


def _states(flights: Sequence[TrajectorySegment], t: Array) -> Array:
    """Evaluate flights that follow each other, where they do, as the later one."""
    begins, states = [f.start for f in flights], np.empty((flights[0].dimension, t.size))
    number = np.maximum(np.searchsorted(begins, t, side="right") - 1, 0)
    for i, flight in enumerate(flights):
        mine = number == i
        states[:, mine] = flight.at((t[mine] - flight.start) / flight.duration)
    return states


def _top(flight: TrajectorySegment, part: slice, sign: float) -> float:
    """The largest value of some states on a flight, beside the largest of many: at the other end
    of a closed one, too."""
    s, states = flight.sampled(8)  # into each interval
    i, j = divmod(int((sign * states[part]).argmax()), s.size)
    i, last = i + part.start, s.size - 1
    return max(
        -bottom(lambda s: -sign * flight.at(s)[i], s[max(k - 1, 0)], s[min(k + 1, last)])[1]
        for k in ({j, last} if j == 0 else {j})
    )


def cycle_of(problem: Problem) -> Cycle:
    """The orbit at which a problem of a cycle starts."""
    curve = Curve(problem, ())
    cycle: Cycle = Point(curve, curve.start).solution
    return cycle


def equations_of(point: Point) -> FlowEquations:
    equations: FlowEquations = point.curve.problem.residual
    return equations


def _trivial(point: Point) -> float:
    return abs(float(point.solution.trivial) - 1)


def _extreme(name: str, sign: float, point: Point) -> float:
    value: float = point.solution.extreme(name, sign)
    return value


@dataclass(frozen=True, eq=False, repr=False)
class CycleProblem(Problem):
    residual: FlowEquations
    tested = True

    @property
    def internals(self) -> frozenset[str]:
        return frozenset(("orbit", "mesh", "held"))

    def interpret(self, point: Point) -> Cycle:  # type: ignore[override]
        return Cycle(self.residual, np.array(point.x), point.params)

    @property
    def begin_of_orbit(self) -> Any:
        return cycle_of(self).begin_of_orbit

    def tied(self, functions: Mapping[str, Any], **values: float) -> Any:
        raise BadInput(
            f"{', '.join(map(str, functions))}: the equations of a cycle are made of its flow; "
            "write the functions into f(t, x, p) of the flow itself, and make the cycle of that"
        )

    def modulo(self, x: Array, params: Params) -> Mapping[str, Any]:
        """The first impact is at a time of the forcing; and states that the reset takes back by a
        constant, as those of a rotation, are angles."""
        equations = self.residual
        if equations.phased:
            return {"phase": equations.forcing_period(params)}
        back = equations.taken_back(x, params)
        return {} if back is None else {"orbit": back}

    def roughly(self, x: Array, params: Params) -> Array:  # type: ignore[override]
        return self.residual(x, params, 1e-7)  # the next step is more exact

    def derivatives(self, x: Array, params: Params, names: tuple[str, ...]) -> Matrix:
        return self.residual.derivatives(x, params, names)

    def closing(self, matrix: Matrix, mu: complex) -> Matrix:  # type: ignore[override]
        return closing_matrix(self.residual, matrix, mu)

    def multipliers(self, point: Point) -> tuple[NDArray[np.complex128], float]:
        mu, count = point.solution.others, self.residual.start[0].dimension - 1
        # those that are not known are next to 0: of these four at once change no sign of a test
        unknown = (count - mu.size) % 4 if isinstance(self.residual, SparseFlowEquations) else 0
        return np.append(mu, np.zeros(unknown)), 0.0  # small ones are as exact as large ones

    @property
    def perturbed(self) -> NDArray[np.intp]:
        return np.delete(
            np.arange(self.residual.layout.size), np.concatenate(self.residual.layout.knots)
        )

    def invariants(self, point: Point) -> Array | None:
        orbit, free = point.solution, [float(point[name]) for name in point.curve.free]
        extremes = (*orbit.max.values(), *orbit.min.values())
        return np.array([len(orbit.flights), *free, orbit.period, *extremes])

    def simpler(self, point: Point) -> Problem | None:
        """The orbit a single time around, where it goes around several times."""
        orbit: Cycle = point.solution
        single = once(orbit.equations, orbit.flights, point.params)
        if single.turns == orbit.equations.turns:
            return None
        return problem_of(single, point.params, self.events, self.label)

    def finer(self, point: Point, along: Any) -> tuple[Problem, Any] | None:
        """Twice as many intervals, up to as many as are still made finer."""
        if len(self.start["mesh"]) > 400 or self._drift(point):  # of all flows together: enough
            return None
        if along is None:
            return self.halved(), None
        with suppress(Undefined):
            return self._arm(along, point.curve.free)
        return None

    def _arm(self, along: Array, free: tuple[str, ...]) -> tuple[Problem, Array]:
        """Solve for the start of an arm, and its direction, on a mesh of twice the intervals."""
        finer = Curve(self.halved(self.residual.start), free)  # tangents keep their phase
        z, guess = finer.start, np.zeros(finer.start.size)
        here, there = self.residual.layout, finer.problem.residual.layout
        for few, many in zip(here.nodes, there.nodes, strict=True):
            guess[many] = np.repeat(along[few], 2, axis=0)
        guess[there.lengths[0] :] = along[here.lengths[0] :]  # durations, phase and parameter
        row = finer.metric * guess
        if SwitchingProblem(self, free[0]).tangents[1] is None:  # one curve passes it, as at HB
            z = newton(finer, z, row).z
            tangent = finer.tangent_at(z, guess)[0]
        else:
            branch_point = crossing(finer, z)
            z = branch_point.solution.z
            tangent = max(branch_point.tangents, key=lambda way: abs(way @ row))
        return Point(finer, z).problem, math.copysign(1.0, tangent @ row) * tangent

    def halved(self, flights: Sequence[TrajectorySegment] = ()) -> CycleProblem:
        """Halve the intervals of its start, with a phase that is measured by that start, or by the
        flights that are given."""
        here = self.residual.flights(self.x, self.params)
        finer = replace(self.residual, start=tuple(f.halved() for f in flights or here))
        start = finer.unknowns([f.halved() for f in here], self.params)
        return replace(self, residual=finer, start=start)

    def unresolved(self, point: Point) -> str:
        try:
            return self._drift(point) or str(point.solution.coarse)
        except Undefined as error:  # it has come to rest
            return str(error)

    def _drift(self, point: Point) -> str:
        """Say that an orbit has come to where lambda is no rounding, as nothing is conserved there:
        equations and unfolding have solutions which are none of the flow."""
        kept = self.residual.conservation
        if kept is None:
            return ""
        flow, states = self.residual.flows[0], point.solution.flights[0].states.T
        plain = point.params | dict.fromkeys(kept.lambdas, 0.0)
        return drift(kept.quantities, flow.f, states, plain)

    def sized(self, sizes: Mapping[str, int]) -> CycleProblem:
        problem = self
        while len(problem.start["mesh"]) < sizes["mesh"]:
            problem = problem.halved()
        return problem

    def having(self, *names: str) -> Problem:
        """Free parameters, if the forcing keeps the period while these change, and what is
        conserved stays so; of a family the period or the energy, in place of the other one."""
        equations, kept = self.residual, self.residual.conservation
        states = [flight.states.T for flight in equations.start]
        refuse_false_period(equations.flows, states, equations.period, self.params, names)
        if kept is None:
            return super().having(*names)
        refuse_drift(kept.quantities, equations.flows[0].f, states[0], self.params, names)
        asked = [name for name in ("period", *kept.quantities) if name in names]
        return self.holding(asked[0]) if asked and asked[0] != kept.held else self

    def holding(self, name: str) -> CycleProblem:
        """Give the period of an orbit in place of its energy, or the other way around."""
        equations = self.residual
        assert equations.conservation is not None
        kept = replace(equations.conservation, held=name)
        params = {n: value for n, value in self.params.items() if n != equations.conservation.held}
        problem = problem_of(
            replace(equations, conservation=kept), params | {name: float(self.start[name])},
            self.events, self.label,
        )  # fmt: skip
        # the same unknowns in the same order, under other names
        start = dict(zip(problem.start, self.start.values(), strict=True))
        return replace(problem, start=start)

    def lift(self, kind: str) -> Callable[[Point], SwitchingProblem] | None:
        beyond = dict.fromkeys(("GR", "VI", "SL"), _beyond)
        return {"PD": _doubled, **beyond}.get(kind)


def _doubled(point: Point) -> SwitchingProblem:
    """Make the cycle of twice the period. Both its phases set out in opposite directions: one arm.

    Its mesh follows a perturbation that changes sign from one round to the next, that of the
    multipliers does not: curves cross off PD by as much as the mesh does not resolve.
    """
    problem, (free,) = point.curve.problem, point.curve.free
    twice, params = _twice(equations_of(point), np.array(point.x), point.params), point.params
    if twice.conservation and "period" in params:
        params = {**params, "period": 2 * params["period"]}
    arm: Problem = problem_of(twice, params, problem.events, problem.label)
    curve = Curve(arm, (free,))
    with suppress(Undefined):
        arm = Point(curve, crossing(curve, curve.start).solution.z).problem
    return SwitchingProblem(arm, free, both=False)


def _twice(equations: FlowEquations, x: Array, p: Params) -> FlowEquations:
    """Run through the same orbit twice, as one of twice the period."""
    flights, flows, turns = equations.flights(x, p), equations.flows, 2 * equations.turns
    if equations.smooth and flows[0].reset is None:
        (flight,) = flights
        knots = np.concatenate([0.5 * flight.knots[:-1], 0.5 + 0.5 * flight.knots])
        # slopes are per interval: twice the duration and half the steps leave them as they are
        states, slopes = np.vstack([flight.states] * 2), np.vstack([flight.slopes] * 2)
        whole = replace(
            flight, knots=knots, duration=2 * flight.duration, states=states, slopes=slopes,
            rounds=2 * flight.rounds,
        )  # fmt: skip
        return replace(equations, start=(whole,), turns=turns)
    period = sum(flight.duration for flight in flights)
    again = [replace(flight, start=flight.start + period) for flight in flights]
    after = [flow.struck(f.last, p) for flow, f in zip(flows, again, strict=True)]
    if equations.smooth and equations.period:
        # after half of a symmetric orbit the forcing is the mirror image of what it was: the
        # mirror that ends the half takes it back to its beginning
        back = partial(_earlier, equations.period, equations.turns)
        (flow,) = flows
        walls = tuple(partial(back, wall) for wall in flow.guards.values())
        reset = flow.reset and partial(back, flow.reset)
        after = [replace(flow, f=at_other_time(back, flow.f), reset=reset, walls=walls)]
    return replace(
        equations, flows=(*flows, *after), start=(*flights, *again), turns=turns,
        sizes=equations.sizes * 2,
    )  # fmt: skip


def once(
    equations: FlowEquations, flights: Sequence[TrajectorySegment], p: Params
) -> FlowEquations:
    """Begin at this orbit, a single time around where it goes around several times."""
    repeats = (m for m in range(RETURNS, 1, -1) if _repeats(equations, m, flights, p))
    rounds = next(repeats, 1)
    if not equations.smooth:
        flights = flights[: len(flights) // rounds]
    elif rounds > 1:
        knots, (whole,) = np.linspace(0.0, 1.0, flights[0].knots.size), flights
        part = whole.on(knots / rounds)
        flights = [replace(part, knots=knots, duration=whole.duration / rounds)]
    return replace(
        equations, flows=equations.flows[: len(flights)], start=tuple(flights),
        turns=equations.turns // rounds, sizes=sizes_of(flights),
    )  # fmt: skip


def _repeats(
    equations: FlowEquations, rounds: int, flights: Sequence[TrajectorySegment], p: Params
) -> bool:
    """Compare the orbit at all times and a part of its period later."""
    flows, (part, rest) = equations.flows, divmod(len(flights), rounds)
    if equations.turns % rounds and not equations.autonomous:
        return False
    if equations.smooth:
        (flight,), reset = flights, flows[0].reset
        s = np.linspace(0.0, 1 - 1 / rounds, _LOOKS * flight.knots.size)
        later = flight.at(s + 1 / rounds)
        if reset is not None:
            later = values(reset, flight.start + flight.duration * s, later, p)
        return bool(abs(later - flight.at(s)).max() <= _REPEATS * equations.sizes[0].max())
    pairs = zip(flows, flows[part:], flights, flights[part:], equations.sizes, strict=False)
    return not rest and all(
        (flow.f, flow.reset) == (successor.f, successor.reset)
        and now.dimension == then.dimension
        and abs(then.at((looks := now.sampled(_LOOKS))[0]) - looks[1]).max()
        <= _REPEATS * size.max()
        for flow, successor, now, then, size in pairs
    )


def _earlier(period: Function, turns: int, function: Function, t: Any, x: Any, p: Params) -> Any:
    """Evaluate a function of (t, x, p) so many periods before."""
    return function(t - turns * period(t, x, p), x, p)


# --- beyond grazing ----------------------------------------------------------------------------

Margin = Callable[[Curve, Array], Array]  # zero at GR, positive where orbits have these flows


@dataclass(frozen=True)
class _Beyond(SwitchingProblem):
    """A cycle at GR as one of other flows, and margins of both branches, here and there."""

    point: Point = field(kw_only=True)
    here: Margin = field(kw_only=True)
    there: Margin = field(kw_only=True)
    along: Array = field(kw_only=True)

    def seeds(self) -> tuple[Seed, ...]:
        """Start where orbits of the other flows are: the orbit "persists" as one of these, or both
        kinds are on one side, a nonsmooth "fold"."""
        curve, point = Curve(self.problem, (self.free,)), self.point
        # one curve passes it, though while a flow is that short its end hardly has an equation
        z, tangent = curve.start, curve.tangent_at(curve.start, self.along)[0]
        growth = _growth(self.there, curve, z, tangent)
        z = z - self.there(curve, z) / growth * tangent  # to GR as this branch has it
        z = newton(curve, z, curve.metric * tangent).z
        tangent *= math.copysign(1.0, growth)
        inside = _growth(self.here, point.curve, point.z, point.direction) * point.direction[-1]
        what = "fold" if inside * tangent[-1] > 0.0 else "persists"
        return (Seed(self.problem, z, tangent, detail={"beyond": what}),)


def _growth(margin: Margin, curve: Curve, z: Array, way: Array) -> float:
    """Differentiate a margin along a way."""
    return float(directional(partial(margin, curve), z, SHORTEST * way)[0]) / SHORTEST


def _contacts(i: int, short: float | None, curve: Curve, z: Array) -> Array:
    """Measure a contact beyond none: its duration, or the velocity of an impact."""
    equations, x = curve.problem.residual, z[: curve.size]
    if short is None:
        return np.array([paces(equations, x, curve.params(z))[i][0]])
    return z[equations.layout.lengths[[i]]] - short


def _height(wall: Any, i: int, part: float, curve: Curve, z: Array, sign: float = 1.0) -> Array:
    """Evaluate a wall at a part of a flow."""
    p = curve.params(z)
    t, state = curve.problem.residual.place(i, part, z[: curve.size], p)
    return sign * values(wall, t, state[:, None], p)[:, 0]


def _beyond(point: Point) -> SwitchingProblem:
    """Make the cycle of the flows that follow at GR and VI: one contact more where a wall is
    touched, one less where it has shrunk to nothing or an impact has lost its velocity.

    The parameter moves by the square of how long a contact lasts, so that one which counts as none
    is there to begin with; it moves in proportion to the velocity of an impact, which may be 0.
    """
    equations, orbit, p, detail = equations_of(point), point.solution, point.params, point.detail
    more, flow, count = "touch" in detail, detail["flow"], len(orbit.flights)
    before, met, after = (equations.flows * 3)[count + flow - 1 : count + flow + 2]
    guard = detail.get("guard", "sliding" if flow_between(before, after) == met else "")
    if point.kind == "SL" and guard == "sliding":
        return _at_edge(point)
    begins = flow if more or point.kind == "VI" else flow - 1  # the flow that meets the wall
    order = [(begins + i) % count for i in range(count)]
    flows, flights = ([of[i] for i in order] for of in (equations.flows, orbit.flights))
    start = flights[0].start
    flights = [replace(f, start=start + (f.start - start) % orbit.period) for f in flights]
    hit, walls = _hit(point, flows, flights[0])
    short = SHORTEST * orbit.period if hit[1:] else 0.0
    if more:
        touch = start + detail["touch"] * flights[0].duration
        parts, pieces = _added(hit, walls, flows, flights, touch, short)
    else:
        touch = flights[0].last + (flights[1].duration / 2 if short else 0.0)
        parts, pieces = _removed(hit, flows, flights)
    parts = [part.struck(f.last, p) for part, f in zip(parts, pieces, strict=True)]
    made = replace(equations, flows=tuple(parts), start=tuple(pieces), sizes=sizes_of(pieces))
    made = made if more else once(made, pieces, p)
    height = partial(_height, hit[0].until, flow if more else 0)
    part = detail["touch"] if more else (touch - start) / made.start[0].duration % 1
    contacts = partial(_contacts, len(hit) - 1 if more else flow, short or None)
    margins = partial(height, part), contacts
    row = made.layout.lengths[1] if more and short else -1
    return _switching(point, made, row, margins if more else margins[::-1])


def _switching(
    point: Point, made: FlowEquations, row: int, margins: Sequence[Margin]
) -> SwitchingProblem:
    """Solve for the cycle beyond with one of its unknowns, or the parameter, as it is there."""
    problem: Problem = problem_of(made, point.params, point.curve.problem.events, "cycle")
    curve = Curve(problem, point.curve.free)
    along = np.eye(curve.start.size)[row]
    solution = newton(curve, curve.start, along)
    if not solution.converged:
        raise Undefined(
            f"no orbit of the flows that follow there: residual {solution.residual:.2g}"
        )
    start, (free,), (here, there) = Point(curve, solution.z).problem, curve.free, margins
    return _Beyond(start, free, point=point, here=here, there=there, along=along)


def _at_edge(point: Point) -> SwitchingProblem:
    """Make the cycle with the flow that comes to be at the edge of sliding, or without it; with all
    of them where an orbit is symmetric.

    Along the surface it may last no time at all; off it, it lasts as long as what counts as none.
    """
    equations, orbit, i, p = (
        equations_of(point), point.solution, point.detail["flow"], point.params
    )  # fmt: skip
    more, flows, flights = "guard" in point.detail, equations.flows, orbit.flights
    short, rates = SHORTEST * orbit.period, paces(equations, orbit.x, p)
    arrives, follows = (i if more else i - 1), [*flows[1:], flows[0]]
    system, comes = system_of(flows[arrives]), flow_between(flows[i], follows[i]) or flows[i]
    assert system
    least, sign = (0.0, -1.0) if slid_along(comes) else (short, 1.0)
    parts: list[Flow] = []
    pieces: list[TrajectorySegment] = []
    for j, (flow, flight, after) in enumerate(zip(flows, flights, follows, strict=True)):
        if j == i:
            place = len(parts) + 1 if more else len(parts) - 1  # of what comes, or else arrives
        if not more and flight.duration < 2 * short and flow_between(flows[j - 1], after) == flow:
            continue
        parts.append(flow)
        pieces.append(flight)
        if more and (new := flow_between(flow, after)):
            edge = values(system.facing(flow), flight.last, flight.end[:, None], p)[0, 0]
            if abs(edge) < 1e-6 * rates[j][0]:
                parts.append(new)
                pieces += _refitted([flight], [flight.last, flight.last + least])
    made = replace(equations, flows=tuple(parts), start=tuple(pieces), sizes=sizes_of(pieces))
    lasts = partial(_contacts, place if more else i, least)
    margins = (
        partial(_height, system.facing(flows[arrives]), i if more else place, 1.0, sign=sign),
        lasts,
    )
    row = made.layout.lengths[place] if more and least else -1
    return _switching(point, made, row, margins if more else margins[::-1])


def _hit(
    point: Point, flows: Sequence[Flow], flight: TrajectorySegment
) -> tuple[tuple[Flow, ...], list[Wall]]:
    """Return the flows of a contact, the first of which ends at the wall, and all walls there.

    Raises `Undefined` where an orbit beyond is not made of them.
    """
    first, detail = flows[0], point.detail
    contact, system, slides = (*flows, first)[1], system_of(first), slid_along(first)
    if system and not slides:
        contact = system.flows[system.flows.index(first) + 2]  # along the surface and back
    own = (first,) if first.reset else (first, contact)
    walls = [*([own] if first.until else []), *first.walls]
    hit = dict(zip(first.guards, walls, strict=True))[detail.get("guard", "until")]
    part, reason = detail.get("touch", 1.0), ""
    joins = hit is own and not (system and "touch" in detail)
    following = (list(flows) * 3)[len(hit)] if joins else first
    if "guard" in detail and "touch" not in detail:
        reason = "it is touched where a flow begins or ends: there these follow in another order"
    elif slides and "touch" in detail:
        reason = "it leaves the surface for so short a time at first that nothing tells how long"
    elif "at once" in detail:
        reason = (
            f"walls are touched at once, {detail['at once']}: orbits that hit one of them alone "
            "begin there, and those that hit all; move a wall a little to follow one contact"
        )
    elif callable(hit):
        reason = "give the wall as the flow that ends there, walls=(cb.Flow(f, until=, reset=),)"
    elif first.until is None and first.reset:
        reason = "of half of a symmetric orbit no flow ends at a wall: follow the whole of it"
    elif hit[0].f != following.f or (point.kind == "VI" and hit[1:]):
        reason = "a flow with the same f has to lead on, after a reset or one flow in between"
    elif not _stays(hit, flight.start + part * flight.duration, flight.at(np.array([part])), point):
        reason = "a reset moves the state even where nothing is hit: orbits do not go over"
    if reason:
        raise Undefined(f"which flows follow there is not known; {reason}")
    return hit, walls


def _stays(hit: Sequence[Flow], t: float, x: Array, point: Point) -> bool:
    """Tell whether the resets of a contact that only just takes place leave the state."""
    after = x
    for reset in filter(None, (flow.reset for flow in hit)):
        after = values(reset, t, after, point.params)
    return after.shape == x.shape and bool(abs(after - x).max() <= 1e-6 * abs(x).max())


def _added(
    hit: Sequence[Flow], walls: Sequence[Wall], flows: Sequence[Flow],
    flights: Sequence[TrajectorySegment], touch: float, short: float,
) -> tuple[list[Flow], list[TrajectorySegment]]:  # fmt: skip
    """Cut the first flow in two at a contact."""
    (whole, *rest), parts = flights, [hit[0].walled(walls), *hit[1:]]
    joints = [touch - short / 2, touch + short / 2] if short else [touch]
    if flows[0].until is None:  # what comes after the contact goes on into what is before it
        before = replace(whole, start=whole.start - whole.duration)
        return parts, _refitted([before, whole], [joints[-1] - whole.duration, *joints])
    return [*parts, *flows], [*_refitted([whole], [whole.start, *joints, whole.last]), *rest]


def _removed(
    hit: tuple[Flow, ...], flows: Sequence[Flow], flights: Sequence[TrajectorySegment]
) -> tuple[list[Flow], list[TrajectorySegment]]:
    """Join the flows before and after a contact, which may be one."""
    first, *rest = flows[len(hit) :] or [replace(flows[0], until=None, reset=None)]
    passed = flights[: len(hit) + 1]
    joined = _refitted(passed, [passed[0].start, passed[-1].last])
    return [first.walled([hit]), *rest], [*joined, *flights[len(hit) + 1 :]]


def _refitted(
    flights: Sequence[TrajectorySegment], cuts: Sequence[float]
) -> list[TrajectorySegment]:
    """Fit flights that follow each other anew, between these times."""
    scheme, states, size = flights[0].scheme, partial(_states, flights), sizes_of(flights)[0]
    return [fitted(scheme, a, b - a, states).adapted(size) for a, b in pairwise(cuts)]


def problem_of(
    equations: FlowEquations, params: Params, events: Sequence[Event], label: str
) -> CycleProblem:
    """The problem of a cycle that starts at the orbit which its equations began with."""
    start = equations.unknowns(equations.start, params)
    size = float(np.sqrt(np.mean(np.square(start["orbit"])))) or 1.0
    times = next(name for name in ("durations", "period", "held") if name in start)
    record: dict[str, Any] = (
        {"period": attrgetter("solution.period")} if times == "durations" else {}
    )
    record["unstable"] = UnstableDimension(attrgetter("solution.unstable"))
    if equations.autonomous:
        record["trivial"] = _trivial
    for name in equations.parts:
        record[f"max({name})"] = partial(_extreme, name, 1.0)
        record[f"min({name})"] = partial(_extreme, name, -1.0)
    whole = sum(flight.duration for flight in equations.start)
    scales = {"orbit": size} | {name: whole for name in (times, "phase") if name in start}
    # or steps would be all about what has large numbers, as the frequency of what is fast
    scales |= {name: abs(value) for name, value in params.items() if abs(value) > 1e3}
    return CycleProblem(
        equations, start, dict(params), events=tuple(events), record=record, scales=scales,
        label=label,
    )  # fmt: skip
