"""A periodic orbit of flows as a value, and as a problem to trace."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
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
from .conservation import indices_of, refuse_drift
from .equations import FlowEquations
from .flow import refuse_false_period
from .functions import Function, Params, values
from .integrate import bottom
from .multipliers import closing_matrix, of_cycle

# of an orbit without a trivial multiplier, the highest term of its polynomials: about as far off
UNRESOLVED = 5e-3
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
        Of small perturbations over the period, the largest first; the trivial one of an
        autonomous orbit is among them. One is infinite where an impact loses its velocity (VI),
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
        The largest and the smallest value of each state, as long as `period` is.

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
        times = self.times
        inside = times[0] + np.mod(np.atleast_1d(t) - times[0], self.period)
        number = np.clip(np.searchsorted(times, inside, side="right") - 1, 0, len(self.flights) - 1)
        if len({flight.dimension for flight in self.flights}) > 1:
            raise BadInput("the flows have different states: look at them one by one in `flights`")
        states = np.empty((self.flights[0].dimension, inside.size))
        for i, flight in enumerate(self.flights):
            mine = number == i
            states[:, mine] = flight.at((inside[mine] - times[i]) / flight.duration)
        return states[:, 0] if t.ndim == 0 else states

    @cached_property
    def max(self) -> dict[str, float]:
        return {name: self.extreme(name, 1.0) for name in self.equations.states}

    @cached_property
    def min(self) -> dict[str, float]:
        return {name: self.extreme(name, -1.0) for name in self.equations.states}

    def extreme(self, name: str, sign: float) -> float:
        """The largest value of one state, with -1 the smallest."""
        i = [*self.equations.states].index(name)
        return sign * max(_top(f, i, sign) for f in self.flights if i < f.dimension)

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

    @cached_property
    def indices(self) -> NDArray[np.complex128]:
        if self.equations.conservation is None:
            raise BadInput("multipliers come in pairs where something is conserved: conserves=")
        return indices_of(self.others)

    @property
    def unstable(self) -> int:
        if self.equations.conservation:
            outside = (self.indices.imag != 0) | (abs(self.indices.real) > 1 + 1e-10)
            return int(outside.sum())
        return int((abs(self.others) > 1 + 1e-9).sum())  # closer than that is on the circle

    @property
    def coarse(self) -> str:
        """Reason why the mesh does not resolve the orbit; empty if it does."""
        off = abs(self.trivial - 1)
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
        rows += [(f"multiplier {i}", mu) for i, mu in enumerate(self.multipliers.tolist(), 1)]
        return Sheet.of(rows)

    def __repr__(self) -> str:
        return f"<Cycle of period {self.period:.10g}, {self.unstable} unstable>"


def _top(flight: TrajectorySegment, i: int, sign: float) -> float:
    """The largest value of a state on a flight, beside the largest of many: at the other end of a
    closed one, too."""
    s, states = flight.sampled(8)  # into each interval
    last, j = s.size - 1, int((sign * states[i]).argmax())
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
        return point.solution.others, 0.0  # small ones are as exact as large ones

    @property
    def perturbed(self) -> NDArray[np.intp]:
        return np.delete(
            np.arange(self.residual.layout.size), np.concatenate(self.residual.layout.knots)
        )

    def finer(self, point: Point, along: Any) -> tuple[Problem, Any] | None:
        """Twice as many intervals, up to as many as are still made finer."""
        if len(self.start["mesh"]) > 400:  # of all flows together: enough
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
            reason: str = point.solution.coarse
        except Undefined as error:  # it has come to rest
            reason = str(error)
        return reason

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
        return {"PD": _doubled, "GR": _beyond}.get(kind)


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
        walls = tuple(partial(back, wall) for wall in flow.walls)
        reset = flow.reset and partial(back, flow.reset)
        after = [replace(flow, f=partial(back, flow.f), reset=reset, walls=walls)]
    return replace(
        equations, flows=(*flows, *after), start=(*flights, *again), turns=turns,
        sizes=equations.sizes * 2,
    )  # fmt: skip


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


def _lasts(i: int, short: float, curve: Curve, z: Array) -> Array:
    return z[curve.problem.residual.layout.lengths[[i]]] - short


def _height(wall: Function, i: int, part: float, curve: Curve, z: Array) -> Array:
    """Evaluate a wall at a part of a flow."""
    p = curve.params(z)
    t, state = curve.problem.residual.place(i, part, z[: curve.size], p)
    return values(wall, t, state[:, None], p)[:, 0]


def _beyond(point: Point) -> SwitchingProblem:
    """Make the cycle of the flows that follow at GR: one contact more where a condition is touched,
    one less where it has shrunk to nothing.

    The parameter moves by the square of how long a contact lasts, so that one which counts as none
    is there to begin with.
    """
    equations, orbit, p = equations_of(point), point.solution, point.params
    more, flow = "touch" in point.detail, point.detail.get("flow", -1)
    begins = flow if more else (flow - 1) % len(orbit.flights)  # the flow that touches
    order = [*range(begins, len(orbit.flights)), *range(begins)]
    flows, flights = ([of[i] for i in order] for of in (equations.flows, orbit.flights))
    first, contact, last = (flows * 2)[:3]
    back = (first.f, first.until) == (last.f, last.until)
    if flow < 0 or first.reset or contact.reset or not back:
        raise Undefined(
            "which flows follow there is known where a flow touches the condition that ends it, "
            "without a reset, and the flow after it leads back to it"
        )
    start, short, lasts = flights[0].start, SHORTEST * orbit.period, orbit.durations[order]
    if more:
        touch = start + point.detail["touch"] * lasts[0]
        cuts, own = [start, touch - short / 2, touch + short / 2, flights[0].last], 1
        parts = [first, contact, first]
        margins = (
            partial(_height, first.until, flow, point.detail["touch"]),
            partial(_lasts, 1, short),
        )
    else:
        cuts, own = [start, start + min(lasts[:3].sum(), orbit.period)], 3
        parts = [last if flows[2:] else replace(last, until=None, walls=(*last.walls, last.until))]
        middle = (lasts[0] + lasts[1] / 2) / (cuts[1] - cuts[0])
        margins = partial(_lasts, flow, short), partial(_height, first.until, 0, middle)
    scheme, parts = flights[0].scheme, [*parts, *flows[own:]]
    pieces = [fitted(scheme, a, b - a, orbit.states) for a, b in pairwise(cuts)] + [
        replace(flight, start=start + (flight.start - start) % orbit.period)
        for flight in flights[own:]
    ]
    equations = replace(
        equations, start=tuple(pieces), sizes=sizes_of(pieces),
        flows=tuple(part.struck(f.last, p) for part, f in zip(parts, pieces, strict=True)),
    )  # fmt: skip
    problem: Problem = problem_of(equations, p, point.curve.problem.events, "cycle")
    curve = Curve(problem, point.curve.free)
    along = np.zeros(curve.start.size)
    along[equations.layout.lengths[1] if more else -1] = 1.0
    solution = newton(curve, curve.start, along)
    if not solution.converged:
        raise Undefined(
            f"no orbit of the flows that follow there: residual {solution.residual:.2g}"
        )
    (free,), (here, there) = curve.free, margins
    return _Beyond(
        Point(curve, solution.z).problem, free, point=point, here=here, there=there, along=along
    )


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
    for name in equations.states:
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
