"""A periodic orbit of flows as a value, and as a problem to trace."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, partial, reduce
from operator import attrgetter
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from ..continuation.algebra.linear_algebra import solved
from ..continuation.algebra.newton import Array, Undefined, newton
from ..continuation.algebra.sparse import Matrix
from ..continuation.branches.switching import SwitchingProblem
from ..continuation.curve.curve import Curve
from ..continuation.curve.point import Event, Point, UnstableDimension
from ..continuation.curve.problem import Problem
from ..continuation.systems.branch_points import crossing
from ..continuation.systems.spectrum import OUTSIDE, counted
from ..errors import BadInput
from ..one_thread import one_thread
from ..tables import HtmlRepr, Sheet
from .collocation import ROUNDING, TrajectorySegment, states_along
from .conservation import drift, indices_of, refuse_drift
from .cycle_beyond import beyond_contact, in_other_order
from .equations import FlowEquations, equations_of
from .flow import refuse_false_period
from .functions import Params, kink, place, quiet
from .integrate import bottom
from .multipliers import around, closing_matrix, of_cycle, paces
from .rounds import begun_later, once, twice
from .sparse_equations import FEW

UNSTABLE = UnstableDimension(attrgetter("solution.unstable"))
# of an orbit without a trivial multiplier, the highest term of its polynomials: about as far off
UNRESOLVED = 5e-3
RESOLVED = 1e-4  # so far off 1 the trivial multiplier may be of a resolved orbit
_HOLDS = 0.1  # the cosine in which the first orbit measures a phase: next to 0 it slides
CRITICAL = frozenset(("LP", "BP", "PD", "NS"))  # kinds of a multiplier on the unit circle
ONE = 0.1  # closer to it a multiplier may be 1: at a fold by 1e-5 where a parameter turns by 1e-13


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
        among them. One is infinite where an impact loses its velocity (VI), where all others are
        NaN; all are where none is infinite, as where the reset forgets all.
    trivial : float
        That one, 1 but for what the mesh does not resolve; NaN for forced orbits. Where something
        is conserved there are several, and this is the one that is farthest off 1.
    indices : ndarray
        Stability indices (mu + 1/mu)/2 of all other pairs of multipliers where something is
        conserved: the pair is on the unit circle where that is real and from -1 to 1.
    unstable : int
        How many multipliers are outside of the unit circle; NaN where these are.
    times : ndarray
        When its flows begin, and when the last one ends.
    errors : dict
        By how much the "period" is off, relative, and the "multipliers", those above 1 relative:
        against twice as many points in each interval, to first order in the orbit, at these
        parameters; infinite where these have none, as at a fold, or twice as many points no start.
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
    def own_flights(self) -> tuple[TrajectorySegment, ...]:
        """Flights of its equations, which may be those of half of it."""
        return self.flights

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
        states = states_along(self.flights, inside)
        return states[:, 0] if t.ndim == 0 else states

    @property
    def begin_of_orbit(self) -> tuple[Any, dict[str, float], Params, float, float, float]:
        """Its flows, the state at its start, parameters, the period, when it starts, and how exact
        a step is: what `contbreather.integrate` goes on from."""
        first = self.flights[0]
        state = dict(zip(self.equations.states, first.states[0].tolist(), strict=False))
        return self.equations.flows, state, self.params, self.period, first.start, 1e-12

    @cached_property
    def paces(self) -> dict[int, tuple[float, float]]:
        """Evaluate how fast conditions fall where they end flows, and relative to the most."""
        return paces(self.equations, self.x, self.params)

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
        return sign * max(top(f, part, sign) for f in self.flights if i < f.dimension)

    @cached_property
    @one_thread
    def _spectrum(self) -> tuple[NDArray[np.complex128], Array]:
        return of_cycle(self.equations, self.x, self.params)

    @property
    def others(self) -> NDArray[np.complex128]:
        """Multipliers but the trivial one."""
        return self._spectrum[0]

    @property
    def velocities(self) -> list[Array]:
        """The field where the intervals of each flight begin."""
        return self.equations.velocities(self.x, self.params)

    @property
    def mirror(self) -> Any:
        """The reset that leads from half of a symmetric orbit to its other half; None of others."""
        return self.equations.flows[0].reset if self.equations.smooth else None

    @property
    def off_one(self) -> float:
        """Distance from 1 of the nearest multiplier but the trivial one."""
        return float(abs(self.others - 1).min(initial=math.inf))

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
        return bool(self.equations.givens)

    @cached_property
    def _factors(self) -> Array:
        """Map small perturbations of a smooth flow over each interval."""
        (factors,), _ = around(self.equations, self.x, self.params)
        return factors

    @cached_property
    def monodromy(self) -> Array:
        """Matrix that takes small perturbations of a smooth flow once around."""
        return reduce(np.matmul, self._factors[::-1])

    @cached_property
    def index_form(self) -> tuple[Array, Array | None]:
        """A matrix whose eigenvalues are the stability indices, each one twice, and the form that
        has the Krein signature of a pair, where it is known: where the field is a constant matrix J
        times the gradient of what is conserved, ``x . inv(J) M x``."""
        kept, states = self.equations.conservation, self.flights[0].states.T
        assert kept is not None
        J, M = kept.poisson(self.equations.flows[0].f, states, self.params), self.monodromy
        form = None if J is None else np.linalg.inv(J) @ M
        back = reduce(np.matmul, np.linalg.inv(self._factors))  # that of M may be lost to rounding
        return (M + back) / 2, None if form is None else (form + form.T) / 2

    @cached_property
    def indices(self) -> NDArray[np.complex128]:
        if not self.paired:
            raise BadInput("multipliers come in pairs where something is conserved: conserves=")
        return indices_of(self.others)

    @property
    def passing(self) -> tuple[NDArray[np.complex128], Array, Array | None, int]:
        """Indices of all that may collide, with their matrix and form: where an orbit is made of
        images of a part, those of one; and how many parts it has."""
        return self.indices, *self.index_form, 1

    @property
    def quadruplets(self) -> int:
        """Count the pairs of pairs of multipliers that have left the unit circle together."""
        return int((self.indices.imag > 0).sum())

    @property
    def inverse_hyperbolic(self) -> int:
        """Count the pairs of multipliers that are real and negative, off the unit circle."""
        return int(((self.indices.imag == 0) & (self.indices.real < -1)).sum())

    @property
    def unstable(self) -> float:
        if np.isnan(self.others).any():
            return math.nan
        if self.paired:
            outside = (self.indices.imag != 0) | (abs(self.indices.real) > 1 + 1e-10)
            return int(outside.sum())
        return int((abs(self.others) > OUTSIDE).sum())

    @cached_property
    def roughest(self) -> tuple[float, float]:
        """Measure the largest share of the highest term of its polynomials, and when."""
        # orbits of less than 1e-8 of the size at the start are rounding
        pairs = zip(self.flights, self.equations.sizes, strict=True)
        return max([flight.unresolved(1e-8 * size.max()) for flight, size in pairs])

    @property
    def turns_fast(self) -> bool:
        """Tell whether perturbations turn by more radians in an interval than it has points: the
        growth of the Gauss method follows about as many, and a slow orbit has long intervals."""
        if self.equations.sparse:
            return False
        most = self.flights[0].scheme.points ** 2
        try:
            pieces = self.equations.linearised(self.x, self.params).linear
        except Undefined:  # beside an orbit that all but leaves the domain
            return False
        for piece in pieces:
            rates = piece.slopes.rates
            large = rates[np.einsum("jab,jab->j", rates, rates) > most]  # no eigenvalue is larger
            # each by itself: many that turn slowly do not turn fast together
            if large.size and (np.linalg.eigvals(large) ** 2).real.min() < -most:
                return True
        return False

    @cached_property
    def doubled(self) -> FlowEquations:
        """Put twice as many points into each interval of its equations."""
        if self.equations.sparse:
            raise BadInput("errors are estimated for up to 40 states: compare with more intervals")
        finer = tuple(flight.on(flight.knots, flight.scheme.doubled) for flight in self.own_flights)
        return replace(self.equations, start=finer)

    @cached_property
    @one_thread
    def errors(self) -> dict[str, float]:
        errors = dict.fromkeys(("period", "multipliers"), math.inf)
        with suppress(Undefined):  # at a fold no parameter has an orbit of its own
            left = self.doubled(self.x, self.params)
            off = solved(self.equations.derivatives(self.x, self.params), left, "")
            lengths = self.equations.layout.lengths
            errors["period"] = float(abs(off[lengths].sum() / self.x[lengths].sum()))
            errors["multipliers"] = self.multipliers_off(self.x - off)
        return errors

    @quiet
    def multipliers_off(self, x: Array) -> float:
        """Compare multipliers with those of an orbit beside, of twice as many points."""
        finer = replace(self, equations=self.doubled, x=x)
        apart = abs(self.multipliers[:, None] - finer.multipliers).min(axis=1, initial=math.inf)
        return float((apart / np.maximum(abs(self.multipliers), 1.0)).max(initial=0.0))

    def coarse(self, on: str = "") -> str:
        """Reason why the mesh does not resolve the orbit, or the multiplier of a kind on whose
        curve it is; empty if it does."""
        why = ""
        if self.equations.condensed:  # of a large flow multipliers are not asked for here
            off = abs(self.trivial - 1)
            if off > RESOLVED:
                why = f"the trivial multiplier is {off:.1g} off 1, "
            # of a double one the square is the error
            elif on in CRITICAL and (beside := self._beside_circle()) ** 2 > RESOLVED:
                why = f"of {on} no multiplier is there, the nearest is {beside:.1g} off, "
            elif off <= RESOLVED:
                return ""
        return self.too_coarse(why) if why or self.roughest[0] > UNRESOLVED else ""

    def too_coarse(self, why: str) -> str:
        """Say where the mesh is."""
        if not self.resolvable:
            return f"{why}by rounding: no mesh resolves it"
        return why + (
            self.kink
            or f"the mesh is too coarse near t = {self.roughest[1]:.4g}: "
            "collocation=Collocation(intervals=...)"
        )

    @cached_property
    def kink(self) -> str:
        """Say where the field is not smooth along the orbit, as no mesh is; empty if it is."""
        if self.equations.sparse:
            return ""
        with suppress(Undefined):  # beside an orbit that all but leaves the domain
            for flow, flight in zip(self.equations.flows, self.flights, strict=True):
                times = flight.start + flight.duration * flight.sampled(4)[0]
                motion = partial(states_along, [flight])
                if found := kink(flow.f, motion, times, self.params):
                    t, x = found
                    advice = (
                        "give what holds on either side as a Flow with `until`, or with `at` where "
                        "a clock decides"
                    )
                    if flow.until and not times[1] < t < times[-2]:  # so it is given: a power law
                        advice = "where a flow begins or ends; collocation=Collocation(intervals=)"
                    return f"the field is not smooth {place(t, x)}: {advice}"
        return ""

    @property
    def resolvable(self) -> bool:
        """Tell whether errors are those of the mesh, and no rounding."""
        return self.roughest[0] ** 2 > ROUNDING or self.turns_fast

    def _beside_circle(self) -> float:
        return float(abs(abs(self.others) - 1).min(initial=math.inf))

    @property
    def _count(self) -> str:
        # of what is conserved most are on the circle, and pairs are counted by their indices
        return f"{self.unstable} unstable" if self.paired else counted(self.others)

    def _sizes(self) -> dict[str, float]:
        ends = {"min": self.min, "max": self.max}
        return {f"{what}({n})": value for what in ends for n, value in ends[what].items()}

    def table(self) -> Sheet:
        rows: list[tuple[str, Any]] = [("period", self.period)]
        rows += [(name, float(value)) for name, value in {**self.params, **self._sizes()}.items()]
        leading = self.multipliers[:12].tolist()  # of a large flow there are many
        rows += [(f"multiplier {i}", mu) for i, mu in enumerate(leading, 1)]
        return Sheet.of(rows)

    def __repr__(self) -> str:
        return f"<Cycle of period {self.period:.10g}, {self._count}>"


def top(flight: TrajectorySegment, part: slice, sign: float) -> float:
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


def _trivial(point: Point) -> float:
    return abs(float(point.solution.trivial) - 1)


def _extreme(name: str, sign: float, point: Point) -> float:
    return float(point.solution.extreme(name, sign))


@dataclass(frozen=True, eq=False, repr=False)
class CycleProblem(Problem):
    residual: FlowEquations
    tested = True
    retreat = property(attrgetter("residual.retreat"))
    derivatives = property(attrgetter("residual.derivatives"))

    @property
    def internals(self) -> frozenset[str]:
        return frozenset(("orbit", "mesh", "held"))

    @property
    def shown(self) -> tuple[str, ...]:
        """States: their envelopes are columns."""
        return tuple(self.residual.parts)

    def __getattr__(self, name: str) -> Any:
        if hasattr(type(self), name):  # what failed inside of it says why
            return object.__getattribute__(self, name)
        orbit = "problem.solution of a breather, flows.cycle_of(problem) of a cycle"
        raise AttributeError(f"a problem has no {name!r}; its orbit may: {orbit}")

    def interpret(self, point: Point) -> Cycle:  # type: ignore[override]
        orbit = self.orbit(np.array(point.x), point.params)
        if self.keeps_solutions:
            _ = orbit.flights  # which are kept with it
            self.residual.orbits[orbit.x.tobytes(), tuple(orbit.params.items())] = orbit
        return orbit

    def orbit(self, x: Array, params: Params) -> Cycle:
        return Cycle(self.residual, x, params)

    @cached_property
    def keeps_solutions(self) -> bool:  # type: ignore[override]
        """Of few states slopes inside take as little room as the unknowns of a branch."""
        return self.residual.start[0].dimension < FEW

    @property
    def begin_of_orbit(self) -> Any:
        return cycle_of(self).begin_of_orbit

    def tied(self, functions: Mapping[str, Any], **values: float) -> Any:
        raise BadInput(
            f"{', '.join(map(str, functions))}: the equations of a cycle are made of its flow; "
            "write the functions into f(t, x, p) of the flow itself, and make the cycle of that"
        )

    @property
    def totals(self) -> Mapping[str, str]:
        """The period, where an unknown is how long each of several flows lasts."""
        return {"period": "durations"} if "durations" in self.start else {}

    def phases(self, x: Array, params: Params) -> tuple[Array, ...]:
        return begun_later(self.residual, x, params)

    def modulo(self, x: Array, params: Params) -> Mapping[str, Any]:
        """The first impact is at a time of the forcing; and states that the reset takes back by a
        constant, as those of a rotation, are angles."""
        equations = self.residual
        back = equations.taken_back(x, params)
        angles: dict[str, Any] = {} if back is None else {"orbit": back}
        return angles | ({"phase": equations.forcing_period(params)} if equations.phased else {})

    @cached_property
    def roughly(self) -> Callable[[Array, Params], Array]:  # type: ignore[override]
        return partial(self.residual, error=1e-8)  # as predictions are; the next is exact

    def prepare(self, places: Any, names: tuple[str, ...]) -> None:
        if not self.residual.sparse:  # of which nothing is solved for
            self.residual.prepare(places, names)

    def closing(self, matrix: Matrix, mu: complex) -> Matrix:  # type: ignore[override]
        return closing_matrix(self.residual, matrix, mu)

    def multipliers(self, point: Point) -> tuple[NDArray[np.complex128], float, float]:
        orbit: Cycle = point.solution
        mu = orbit.others
        # those that are not known are next to 0: of these four at once change no sign of a test
        if self.residual.sparse:
            count = self.residual.start[0].dimension - 1
            mu = np.append(mu, np.zeros((count - mu.size) % 4))
        # small ones are as exact as large ones: what the mesh leaves is in the trivial one. In two
        # parameters resonances are zeros of a test that has no system of its own
        left = abs(orbit.trivial - 1) if len(point.curve.free) == 1 else 0.0
        return mu, 0.0, left if left < RESOLVED else 0.0

    @property
    def perturbed(self) -> NDArray[np.intp]:
        return np.delete(
            np.arange(self.residual.layout.size), np.concatenate(self.residual.layout.knots)
        )

    def invariants(self, point: Point) -> Array | None:
        orbit, free = point.solution, [float(point[name]) for name in point.curve.free]
        extremes = (*orbit.max.values(), *orbit.min.values())
        # at GR of a rigid wall the orbit with an impact more has as many flows
        impacts = sum(flow.until is not None for flow in orbit.equations.flows)
        return np.array([len(orbit.flights), impacts, *free, orbit.period, *extremes])

    def simpler(self, point: Point) -> Problem | None:
        """The orbit a single time around, where it goes around several times."""
        orbit: Cycle = point.solution
        single = once(orbit.equations, orbit.flights, point.params)
        if single.turns == orbit.equations.turns:
            return None
        return self.of_flows(single, point.params)

    def finer(self, point: Point, along: Any, crosses: bool) -> tuple[Problem, Any] | None:
        """Twice as many intervals, up to as many as are still made finer."""
        # of all flows together: enough; and of a mesh whose errors are rounding
        fine = len(self.start["mesh"]) > 400 or not point.solution.resolvable
        if fine or self._drift(point):
            return None
        if along is None:
            return self.halved(), None
        with suppress(Undefined):
            return self._arm(along, crosses, point.curve.free)
        return None

    def _arm(self, along: Array, crosses: bool, free: tuple[str, ...]) -> tuple[Problem, Array]:
        """Solve for the start of an arm, and its direction, on a mesh of twice the intervals."""
        finer = Curve(self.halved(), free)
        z, guess = finer.start, np.zeros(finer.start.size)
        here, there = self.residual.layout, finer.problem.residual.layout
        for few, many in zip(here.nodes, there.nodes, strict=True):
            guess[many] = np.repeat(along[few], 2, axis=0)
        guess[there.lengths[0] :] = along[here.lengths[0] :]  # durations, phase and parameter
        row = finer.metric * guess
        ways: Sequence[Array] = ()
        if crosses:
            with suppress(Undefined):  # one curve may pass where a direction was given
                branch_point = crossing(finer, z)
                z, ways = branch_point.solution.z, branch_point.tangents
        if not ways:
            z = newton(finer, z, row).z
            ways = finer.tangent_at(z, guess)[:1]
        tangent = max(ways, key=lambda way: abs(way @ row))
        return Point(finer, z).problem, math.copysign(1.0, tangent @ row) * tangent

    def renewed(self, point: Point, ahead: Point | None) -> Problem | None:  # type: ignore[override]
        """Measure the phase by an orbit where the first has hardly anything in common with the
        next."""
        equations = self.residual
        if not (equations.autonomous and equations.endless):
            return None
        # asked at each step: the parameters of a point look further, for those that are freed
        if ahead and equations.hold(ahead.x, ahead.curve.params(ahead.z)) > _HOLDS:
            return None
        return replace(point.problem, residual=replace(equations, start=point.solution.flights))

    def halved(self) -> CycleProblem:
        """Halve the intervals of its start, with a phase that is measured as it was."""
        here = self.residual.flights(self.x, self.params)
        finer = replace(self.residual, start=tuple(f.halved() for f in self.residual.start))
        start = finer.unknowns([f.halved() for f in here], self.params)
        return replace(self, residual=finer, start=start)

    def ends_near(self, point: Point) -> str:
        return str(point.solution.kink)

    def unresolved(self, point: Point, on: str = "") -> str:
        orbit = point.solution
        try:
            coarse = self._drift(point) or orbit.coarse(on)
            return coarse or ("" if on else self._off(orbit, point))
        except Undefined as error:  # it has come to rest
            return str(error)

    def coarse(self) -> str:
        """Say why the mesh does not resolve the orbit at its start; empty if it does."""
        point = Point(curve := Curve(self, ()), curve.start)
        return point.solution.coarse() or self._off(point.solution, point)

    def _off(self, orbit: Cycle, point: Point) -> str:
        """Say what is off and leaves no trace in the trivial multiplier: others, of perturbations
        that turn fast beside the orbit; and the period, which is set by what is small beside it and
        grows, as prey that all but dies out."""
        # of a forced orbit none is known to be 1: what a kink leaves in others shows nowhere else
        kinked = point.kind and self.residual.period and orbit.kink
        if kinked and point.kind in CRITICAL and (why := orbit.coarse(point.kind)):
            return why
        if (orbit.turns_fast or kinked) and (worst := orbit.multipliers_off(orbit.x)) > RESOLVED:
            return orbit.too_coarse(f"multipliers are {worst:.1g} off, ")
        # where curves cross a correction may lead along the other one
        if orbit.roughest[0] <= UNRESOLVED or not self.residual.autonomous or point.kind == "BP":
            return ""
        curve = Curve(point.problem, point.curve.free[:1])
        z, length = curve.start, self.residual.layout.lengths
        if not isinstance(matrix := curve.jacobian(z), np.ndarray):
            return ""  # so many intervals are enough
        way = np.eye(len(curve.free), z.size, length[0])
        if curve.free:
            way[0] = curve.tangent_at(z, way[0])[0]
        left = orbit.doubled(z[: curve.size], point.params)
        off = solved(np.vstack([matrix, curve.metric * way]), np.append(left, 0 * way[:, 0]), "")
        late = off[length].sum() / z[length].sum()
        if curve.free:  # the distance of branches: where this one is steep that of the parameter
            size = max(abs(z[-1]), abs(point.curve.start[len(z) - 1])) or 1.0
            along, across = way[0, length].sum() / z[length].sum(), way[0, -1] / size
            late = (late * across - off[-1] / size * along) / math.hypot(along, across)
        why = f"the period is {abs(late):.1g} of itself off, "
        return orbit.too_coarse(why) if abs(late) > RESOLVED else ""

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

    @property
    def rounds(self) -> int:
        return sum(flight.rounds for flight in self.residual.start)  # of each flow

    def over(self, rounds: int) -> CycleProblem:
        problem = self
        while 2 * problem.rounds <= rounds:
            both = twice(problem.residual, problem.x, problem.params)
            problem = problem.of_flows(both, problem.params)
        return problem

    def having(self, *names: str) -> Problem:
        """Free parameters, if the forcing keeps the period while these change, and what is
        conserved stays so; of a family the period or the energy, in place of the other one."""
        equations, kept = self.residual, self.residual.conservation
        states = [flight.states.T for flight in equations.start]
        refuse_false_period(equations.flows, states, equations.period, self.params, names)
        if kept is not None:
            refuse_drift(kept.quantities, equations.flows[0].f, states[0], self.params, names)
        asked = [name for name in equations.givens if name in names][:1]
        if asked and asked != [equations.held]:
            return self.holding(*asked)
        return self if equations.givens else super().having(*names)

    @property
    def freed_in_turn(self) -> tuple[str, ...]:
        return tuple(name for name in self.residual.givens if name != self.residual.held)

    def holding(self, name: str) -> CycleProblem:
        """Give the period of an orbit in place of its energy, or the other way around."""
        held = self.residual.held
        value = self.start[name] if name in self.start else getattr(cycle_of(self), name)
        params = {n: value for n, value in self.params.items() if n != held} | {name: float(value)}
        problem = self.of(self.residual.holding(name), params, self.events, self.label, self.scales)
        # the same unknowns in the same order, under other names
        return replace(problem, start=dict(zip(problem.start, self.start.values(), strict=True)))

    def lift(self, kind: str) -> Callable[[Point], SwitchingProblem] | None:
        met = dict.fromkeys(("GR", "VI", "SL", "CC"), beyond_contact)
        return {"PD": _doubled, **met}.get(kind)

    def exchanged(self, orbit: Cycle, shrunk: Array) -> Any:
        """Flows and an orbit of them with impacts that come at once in the other order, where that
        is known: those that these flows, which last no time, lie between."""
        return in_other_order(orbit, shrunk)

    def of_flows(self, equations: FlowEquations, params: Params, label: str = "") -> CycleProblem:
        """The cycle at which other equations begin, with the same events."""
        if (kept := equations.conservation) and kept.timed:  # perhaps twice around
            params = {**params, kept.held: kept.given({kept.held: equations.start[0].duration})}
        return self.of(equations, params, self.events, label or self.label, self.scales)

    @classmethod
    def of(
        cls, equations: FlowEquations, params: Params, events: Sequence[Event], label: str,
        sizes: Mapping[str, float] | None = None,
    ) -> Self:  # fmt: skip
        """The problem of a cycle that starts at the orbit which its equations began with; `sizes`
        are those of parameters that are known."""
        start = equations.unknowns(equations.start, params)
        orbit = start["orbit"] / np.resize(equations.units, start["orbit"].size)
        size = (float(np.sqrt(np.mean(np.square(orbit)))) or 1.0) * equations.units
        whole = sum(flight.duration for flight in equations.start)
        times = [name for name in ("durations", "period", "held") if name in start][:1]
        scales = {"orbit": size} | {name: whole for name in (*times, "phase") if name in start}
        # or steps would be all about what has large numbers, as the frequency of what is fast
        scales |= {name: abs(value) for name, value in params.items() if abs(value) > 1e3}
        kept = equations.conservation
        known = {*params, *(kept.quantities if kept else ())}
        scales |= {name: size for name, size in (sizes or {}).items() if name in known}
        if kept:  # an energy that is given is an unknown as well, and lambda pushes along its slope
            scales.setdefault("held", scales.get(kept.held, 1.0))
            lambdas = zip(kept.quantities, kept.lambdas, strict=True)
            square = float(np.mean(np.square(size)))
            scales |= {name: square / scales[of] if of in scales else 1.0 for of, name in lambdas}
        return cls(
            equations, start, dict(params), events=tuple(events), scales=scales, label=label,
            record=cls.recorded(equations, {*params, *start}),
        )  # fmt: skip

    @staticmethod
    def recorded(equations: FlowEquations, known: Iterable[str]) -> dict[str, Any]:
        """List the columns of orbits, beside parameters and unknowns."""
        record: dict[str, Any] = {"unstable": UNSTABLE}
        if len(equations.flows) > 1:
            record = {"period": attrgetter("solution.period"), **record}
        if equations.autonomous:
            record["trivial"] = _trivial
        for name in equations.parts:
            record[f"max({name})"] = partial(_extreme, name, 1.0)
            record[f"min({name})"] = partial(_extreme, name, -1.0)
        return record


def _doubled(point: Point) -> SwitchingProblem:
    """Make the cycle of twice the period. Both its phases set out in opposite directions: one arm.

    Its mesh follows a perturbation that changes sign from one round to the next, that of the
    multipliers does not.
    """
    problem = point.curve.problem
    both = twice(equations_of(point), np.array(point.x), point.params)
    return at_crossing(problem.of_flows(both, point.params), point, both=False)


def at_crossing(arm: Problem, point: Point, both: bool) -> SwitchingProblem:
    """Start where curves cross, which is off the point by as much as the mesh does not resolve."""
    (free,) = point.curve.free
    curve = Curve(arm, (free,))
    with suppress(Undefined):
        arm = Point(curve, crossing(curve, curve.start).solution.z).problem
    return SwitchingProblem(arm, free, both=both)
