"""Constructors of cycles: from a simulation, or samples of an orbit."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial, reduce
from typing import Any, NamedTuple

import numpy as np

from ..checks import brief, check_kind, number, numbers, one_of
from ..continuation.algebra.linear_algebra import least_singular
from ..continuation.algebra.newton import Array, Undefined
from ..continuation.curve.curve import Curve
from ..continuation.curve.point import Event
from ..continuation.curve.problem import Problem
from ..errors import BadInput, NotConverged
from ..one_thread import one_thread
from .collocation import Collocation, TrajectorySegment, fitted, flown, sizes_of
from .conservation import Conservation, Quantities, Unfolded, quantities_of, refuse_drift
from .cycle_beyond import SHORTEST
from .cycle_events import arrivals, events_of_cycle, shares, touches
from .cycle_problem import UNRESOLVED, Cycle, CycleProblem, cycle_of
from .equations import FlowEquations
from .flow import Clock, Filippov, Flow, period_at, refuse_false_period, value_over
from .functions import Function, Params, values
from .initial_motion import Motion, refuse_rest, sampled_orbit, simulated_orbit
from .integrate import flows_of
from .multipliers import around
from .rotation import Angles, moves
from .rounds import once
from .sparse_equations import has_many_states, sparse_where_large

_SOLVED = 1e-10  # to this the equations are solved, and a multiplier that has to be 1 is
_ALMOST = 1e-6  # the same where Newton's iteration went astray beside a family
_MOST_INTERVALS = 2000  # a mesh that has more is not made finer
_FINER = 32  # so many intervals for each say where those of a mesh are to be


@one_thread
def cycle(
    flows: Flow | Function | Sequence[Flow] | Filippov,
    start: Mapping[str, Any] | tuple[Any, Any],
    params: Mapping[str, float],
    *,
    period: float | Callable[[Any], float] | None = None,
    conserves: Any = None,
    fixed: str = "period",
    jacobian: Any = None,
    wraps: Mapping[str, float] | None = None,
    t0: float = 0.0,
    settle: float = 0.0,
    collocation: Collocation | None = None,
    events: Iterable[Event] | None = None,
    scales: Mapping[str, float] | None = None,
    label: str = "",
) -> Problem:
    """A periodic orbit of a smooth, forced or hybrid system as a problem to trace.

    Simulated from a state until it has settled, then closed by Newton's iteration: the orbit need
    not be stable if the start is close to it and `settle` is short.

    Parameters
    ----------
    flows : callable, Flow, sequence of Flow or Filippov
        ``f(t, x, p) -> dx/dt``, or flows that follow each other. One without `until` is a limit
        cycle or, with `period`, a forced response; with a mirror as `reset` the half of a
        symmetric one.
    start : dict or tuple of arrays
        Name and value of each state, or of a row of them: of an array u they are u0, u1, ..., one
        after the other in `x`; or samples ``(t, x)``, shapes (m,) and (n, m), of one period
        of a smooth orbit.
    params : dict
        Name and value of each parameter.
    period : float or callable, optional
        Of the forcing, a number or ``period(p)``. The orbit may take several of them, as the
        simulation tells. Without it nothing may depend on the time, and the period is unknown.
        With `conserves` that of the orbit.
    conserves : callable, or several in a dict, optional
        ``H(x, p)``, what is constant along every orbit of one smooth flow. Orbits then come in
        families, and the "period" and the "energy" (or the name of the first of several) of one are
        parameters: trace in either of them.
    fixed : {"period", "energy"}
        Which of both is given, where the free parameter is another one.
    jacobian : callable or pattern, optional
        The derivative of f in x where `flows` is a function, as `Flow` takes it.
    wraps : dict, optional
        A state that is an angle, or an array of them, and its turn, ``{"theta": 2 * np.pi}``: the
        orbit closes up to as many turns as the simulation makes.
    t0 : float
        The time of the start.
    settle : float
        How long to simulate before a periodic orbit is expected.
    collocation : Collocation, optional
        Intervals and points, ``Collocation(intervals=20, points=6)`` by default; twice as many
        intervals, and again, where they cannot resolve the simulation.
    events : iterable of Event, optional
        What a walk looks for by default: LP, BP, PD and NS (KC, a Krein collision, where something
        is conserved), of limit cycles HB and HOM (they shrink to an equilibrium, or come to rest at
        one), and where flows have conditions or walls VI (an impact loses its velocity) and GR (a
        wall is touched in between, or one of several flows shrinks to nothing at a tangency); of a
        Filippov system SL (an orbit begins to slide, or to cross where it slid).
    scales : dict, optional
        Typical size of a parameter where that is far from 1, and of a state where that is far from
        those of other states.
    label : str, optional
        Shown in tables.

    Returns
    -------
    Problem
        ``point.solution`` is a `Cycle`. Columns are ``period``, ``unstable`` (multipliers outside
        of the unit circle), ``max(x)`` and ``min(x)`` of each state, ``trivial`` (how far that
        multiplier is off 1) of autonomous ones, ``lambda`` (rounding) and what is conserved. A
        motion that settles clear of the conditions of its flows has these as its walls.

    Raises
    ------
    BadInput
        Where functions do not fit the states, names clash, or there is a period of no forcing.
    NotConverged
        Where no periodic orbit is found: the simulation runs to an equilibrium, does not return,
        or Newton's iteration fails.

    Examples
    --------
    >>> import contbreather as cb
    >>> oscillator = cb.cycle(lambda t, x, p: [x[1], p["mu"] * (1 - x[0]**2) * x[1] - x[0]],
    ...                       start={"x": 2.0, "v": 0.0}, params={"mu": 1.0}, settle=50)
    >>> round(oscillator.start["period"], 9)
    6.663286859
    """
    scheme = collocation or Collocation()
    check_kind(scheme, Collocation, "collocation=Collocation(intervals=, points=)")
    conserved, period, wanted = _held(conserves, fixed, period)
    forcing = None if period is None else partial(value_over, period)
    system: Any = flows_of(with_jacobian(flows, jacobian), period)
    if isinstance(start, tuple):
        begun = _sampled(system, start, params, conserved, wraps)
    else:
        begun = _simulated(system, start, params, conserved, wraps, forcing, (t0, settle))
    (path, pieces, params), turns = begun[:3], 1
    units = _units(scales or {}, begun, conserved)
    if forcing is not None:
        whole = sum(b - a for _, a, b in pieces)
        turns = max(1, round(whole / period_at(forcing, params)))
    if path[0].until is None:  # each period as exact as a single one
        motion, *ends = pieces[0]
        moved = np.diff(motion(np.array(ends)))[:, 0]
        path = (begun.angles.taken_from(path[0], moved),)
        scheme = replace(scheme, intervals=turns * scheme.intervals)

    def fit(scheme: Collocation) -> tuple[TrajectorySegment, ...]:
        return tuple(
            replace(flight, start=flight.start - begun.shift)
            for flight in _resolved(scheme, path, params, pieces, units)
        )

    flights = fit(scheme)
    path = tuple(
        flow.struck(flight.last, params) for flow, flight in zip(path, flights, strict=True)
    )
    refuse_false_period(path, [flight.states.T for flight in flights], forcing, params)
    sizes = sizes_of(flights, units)
    equations = FlowEquations(path, flights, forcing, turns, begun.parts, sizes, units=units)
    if conserved:
        equations, params = _conserving(equations, conserved, params)
    equations = sparse_where_large(equations, params)
    wished = tuple(events_of_cycle(equations) if events is None else events)
    problem_at = partial(
        CycleProblem.of, params=params, events=wished, label=label or "cycle", sizes=scales
    )
    closed = _closed(equations, problem_at, params, begun.size, fit)
    if wanted is not None:
        try:
            closed = closed.having("period").at(period=wanted).solve(tolerance=1e-12)[0]
        except NotConverged as error:
            raise NotConverged(
                f"from the orbit of period {cycle_of(closed).period:.6g} there none of period "
                f'{wanted:.6g} was found: start closer, or leave period= out and trace in "period"',
                residual=error.residual,
            ) from error
    return closed.having(fixed) if conserved else closed


def _units(scales: Mapping[str, float], begun: _Begun, conserved: Quantities) -> Any:
    """Read the sizes of the states, of which those of all flows are the same."""
    check_kind(scales, Mapping, "scales as a dict of sizes")
    parts = begun.parts
    named = [*parts, *begun.params, *conserved]
    if unknown := [name for name in scales if name not in named]:
        raise BadInput(f"scales={unknown}: no state or parameter is called so; there are {named}")
    sizes = [number(f"scales[{name!r}]", scales.get(name, 1.0), 1e-300, 1e300, "a size")
             for name in parts]  # fmt: skip
    units = np.repeat(sizes, [len(names) for names in parts.values()])
    if (units == 1.0).all():
        return 1.0
    if any(len(motion(np.array([a]))) != units.size for motion, a, _ in begun.pieces):
        raise BadInput("scales of states are those of all flows: these have not as many each")
    return units


def _held(conserves: Any, fixed: str, period: Any) -> tuple[Quantities, Any, float | None]:
    """Read what is conserved, the period of a forcing, and that of an orbit of a family."""
    positive = partial(number, "period", period, 1e-300, 1e300)
    if conserves is None:
        if fixed != "period":
            raise BadInput(f"fixed = {brief(fixed)} is of what is conserved: say so by conserves=")
        if period is not None and not callable(period):
            positive("a positive time, or a function of p")
        return {}, period, None
    conserved = quantities_of(conserves)
    one_of("fixed", fixed, ("period", next(iter(conserved))))
    return conserved, None, None if period is None else positive("a positive time")


class _Begun(NamedTuple):
    """Flows, and a motion along them that all but closes."""

    flows: tuple[Flow, ...]
    pieces: list[Motion]
    params: dict[str, float]
    parts: dict[str, tuple[str, ...]]  # of `FlowEquations`
    angles: Angles
    size: float = 0.0  # of the state from which it was simulated
    shift: float = 0.0  # by how much later than the orbit, in whole periods of a forcing


def _endless(path: Any) -> Flow | None:
    """The flow that nothing ends, which has none beside it."""
    # a system that decides by its state which flow comes next has none
    listed = path if isinstance(path, tuple) else ()
    endless = [i for i, flow in enumerate(listed) if flow.until is None]
    if len(listed) > 1 and endless:
        raise BadInput(f"flow {endless[0]} of {len(listed)} has no `until`: nothing ends it")
    return listed[0] if endless else None


def _sampled(
    path: Any, samples: tuple[Any, Any], params: Mapping[str, float], conserved: Quantities,
    wraps: Mapping[str, float] | None,
) -> _Begun:  # fmt: skip
    alone, pieces, names = sampled_orbit(_endless(path), samples, params)
    state = dict.fromkeys(names, 0.0)
    angles = Angles.of(wraps, state_names(state))
    _, params = named_state(state, params, *conserved)
    return _Begun((alone,), pieces, params, state_names(state), angles)


def _simulated(
    path: Any, start: Mapping[str, Any], params: Mapping[str, float], conserved: Quantities,
    wraps: Mapping[str, float] | None, forcing: Any, times: tuple[float, float],
) -> _Begun:  # fmt: skip
    """Simulate from a state at a time, and for how long it is to settle."""
    alone, (t0, settle) = _endless(path), times
    (state, params), parts = named_state(start, params, *conserved), state_names(start)
    angles = Angles.of(wraps, parts)
    length = None if forcing is None else period_at(forcing, params)
    # what does not fit, and a false period, before a simulation goes astray
    slides = isinstance(path, Filippov)
    check, begun = (path.begin, path.flows[:2]) if slides else (path[0].check, path[:1])
    check(t0, state, params)
    refuse_false_period(begun, [state[:, None]] * len(begun), forcing, params)
    angles = angles.checked(path, t0, state, params)
    # without an end also where conditions are not met any more
    flows, pieces = simulated_orbit(path, alone, params, (t0, state), length, settle, angles)
    # in the first period, or at no time at all
    shift = pieces[0][1]
    shift = shift if length is None else math.floor(shift / length + 1e-9) * length
    return _Begun(flows, pieces, params, parts, angles, float(abs(state).max()), shift)


def _conserving(
    equations: FlowEquations, conserved: Quantities, params: dict[str, float]
) -> tuple[FlowEquations, dict[str, float]]:
    """Unfold a family, of which the orbit with the energy of the start is looked for."""
    (flow, *_), (flight, *_) = equations.flows, equations.start
    states, (first, *_), count = flight.states.T, conserved, len(conserved)
    if flow.until or moves(flow) or 2 * count > len(states):
        raise BadInput(
            "conserves= is of one smooth flow without a condition or a reset, of two states or "
            f"more for each quantity: {count} for {len(states)} states"
        )
    refuse_drift(conserved, flow.f, states, params)
    energy = float(values(conserved[first], 0.0, states[:, :1], params)[0, 0])
    # along the flow, and along symmetries, orbits are shifted to others: M v = v
    x = np.concatenate([np.ravel(value) for value in equations.unknowns([flight]).values()])
    (factors,), (ways,) = around(equations, x, params)
    whole, along = reduce(np.matmul, factors[::-1]), ways[:1] / np.linalg.norm(ways[0])
    null = np.linalg.svd(whole - np.eye(len(whole)))[2][-count:]
    across = np.linalg.svd(null - null @ along.T @ along)[2][: count - 1]
    kept = Conservation(conserved, first, across)
    named = dict(zip(kept.lambdas, conserved.values(), strict=True))
    normals = [way[0] / np.linalg.norm(way) for way in kept.gradients(states[:, :1], params)]
    if np.linalg.cond(normals) > 1 / _ALMOST:  # at one place of an orbit, as all along it
        raise BadInput(
            f"{' and '.join(conserved)} have gradients along the orbit that depend on each other: "
            "a symmetry only shifts it along itself; give one of them"
        )
    flows = (replace(flow, f=Unfolded.near(flow.f, named, states)),)
    return replace(equations, flows=flows, conservation=kept), {**params, first: energy}


def with_jacobian(flows: Any, jacobian: Any) -> Any:
    """Give a function the derivative that came beside it."""
    if jacobian is None:
        return flows
    if not callable(flows) or isinstance(flows, Flow | Filippov):
        raise BadInput("jacobian= is of one function f: give each flow its own, Flow(f, jacobian=)")
    return Flow(flows, jacobian=jacobian)


def named_state(
    start: Mapping[str, Any], params: Mapping[str, float], *conserved: str
) -> tuple[Array, dict[str, float]]:
    """Make numbers of a state and parameters, and refuse names that clash."""
    states = "a dict with the name and value of each state, {'x': 1.0} for instance,"
    check_kind(start, Mapping, f"{states} or for a cycle samples (t, x),")
    check_kind(params, Mapping, "a dict of parameters")
    names = [*start, *params]
    own = {"orbit", "mesh", "period", "durations", "phase", *conserved}
    if conserved:
        own |= {"held", "lambda", *(f"lambda{i + 1}" for i in range(len(conserved)))}
    taken = sorted(own & {*names})
    if taken:
        raise BadInput(f"rename {taken}: every cycle has columns of these names")
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise BadInput(f"{twice} are named twice, among states and parameters")
    if not start:
        raise BadInput("the start has no states: name and value of each were expected")
    state = [np.atleast_1d(numbers(name, value)) for name, value in start.items()]
    if wrong := [name for name, part in zip(start, state, strict=True) if part.ndim != 1]:
        raise BadInput(
            f"{wrong[0]} has shape {np.shape(start[wrong[0]])}: a number or a row of numbers was "
            "expected, f sees all states as one row"
        )
    by_name = {
        name: number(name, value, -math.inf, math.inf, "a value") for name, value in params.items()
    }
    return np.concatenate(state), by_name


def state_names(start: Mapping[str, Any]) -> dict[str, tuple[str, ...]]:
    """Name the states of each part of a start: u0, u1, ... those of an array u."""
    return {
        name: tuple(f"{name}{i}" for i in range(np.size(value))) if np.ndim(value) else (name,)
        for name, value in start.items()
    }


# --- from a motion to the orbit -------------------------------------------------------------------


ProblemAt = Callable[[FlowEquations], CycleProblem]
Fit = Callable[[Collocation], tuple[TrajectorySegment, ...]]


def _resolved(
    scheme: Collocation, flows: Sequence[Flow], params: Params, pieces: Sequence[Motion], units: Any
) -> list[TrajectorySegment]:
    """Fit motions on meshes that follow them, of as many intervals as their equations need."""

    def through(scheme: Collocation, meshes: Iterable[Array | None]) -> list[TrajectorySegment]:
        return [
            fitted(scheme, a, b - a, motion, knots)
            for (motion, a, b), knots in zip(pieces, meshes, strict=True)
        ]

    even = [None] * len(pieces)
    flights = [*_adapted(through(scheme, even), units)]
    if has_many_states(flows[0], flights[0], params):
        return flights
    for _ in range(5):  # of the intervals of a mesh that does not resolve a simulation
        try:
            for flow, flight, size in zip(flows, flights, sizes_of(flights, units), strict=True):
                unit = max(float(size.max()), float(abs(flight.states).max()))
                flown(flow, flight, params, unit, (flight.slopes, None, 0.0))
            return flights
        except Undefined as error:
            failed = error
        scheme = replace(scheme, intervals=2 * scheme.intervals)
        # what is short is seen on meshes that are many times finer
        fine = replace(scheme, intervals=_FINER * scheme.intervals)
        seen = _adapted(through(fine, even), units)
        seen = _adapted(through(fine, [flight.knots for flight in seen]), units)
        flights = through(scheme, [flight.knots[::_FINER] for flight in seen])
    raise NotConverged(
        f"no periodic orbit was found from there: a mesh of {scheme.intervals} intervals of "
        f"{scheme.points} points does not resolve the simulation: {failed}"
    ) from failed


def _adapted(flights: Sequence[TrajectorySegment], units: Any) -> tuple[TrajectorySegment, ...]:
    pairs = zip(flights, sizes_of(flights, units), strict=True)
    return tuple(flight.adapted(size) for flight, size in pairs)


def _closed(
    equations: FlowEquations, problem_at: ProblemAt, params: Params, size: float, fit: Fit
) -> Problem:
    """Solve for the orbit of a problem, then once more on a mesh that follows it."""
    size = max(size, *(float(abs(flight.states).max()) for flight in equations.start))
    for fit_again in (fit, None):
        equations, solved = _solved(equations, problem_at, fit_again)
        flights = equations.flights(solved.x, params)
        if _lasts_no_time(cycle_of(solved)):
            raise NotConverged(
                "no periodic orbit was found from there: Newton's iteration shrinks its period to "
                "nothing; let it settle longer (settle=), or give samples of a whole period"
            )
        if equations.autonomous:  # what is forced may rest, as where a parameter swings
            extents = [np.ptp(flight.sampled(2)[1], axis=1).max() for flight in flights]
            refuse_rest(np.array(extents), flights[0].states[0], size)
        elif all(abs(flight.states).max() <= np.finfo(float).eps * size for flight in flights):
            # what is left of the start is no size to measure the orbit by
            flights = tuple(replace(f, states=0 * f.states, slopes=0 * f.slopes) for f in flights)
        # next to PD returns are close by turns, and that after two periods may be the closest
        equations = once(equations, flights, params)
        equations = replace(equations, start=_adapted(equations.start, equations.units))
    closed: Any = problem_at(equations)
    try:
        closed = closed.solve(tolerance=1e-12)[0]
    except NotConverged:  # below what rounding leaves where a field jumps
        closed = closed.solve(tolerance=_SOLVED)[0]
    with suppress(NotConverged, Undefined):
        while closed.coarse() and closed.start["mesh"].size <= _MOST_INTERVALS:
            closed = closed.halved().solve(tolerance=1e-12)[0]
    orbit = cycle_of(closed)
    single = once(orbit.equations, orbit.flights, params)
    if single.turns != orbit.equations.turns:  # only a mesh that resolves it tells
        closed = problem_at(replace(single, start=_adapted(single.start, single.units)))
        closed = closed.solve(tolerance=1e-12)[0]
    _refuse_passed(cycle_of(closed))
    # of a family rounding may lead Newton's iteration to a member far from the start
    _refuse_family(closed, _SOLVED)
    return closed


def _solved(
    equations: FlowEquations, problem_at: ProblemAt, fit: Fit | None
) -> tuple[FlowEquations, Problem]:
    """Solve for the orbit on as many intervals as it needs: halved, or, where those that the motion
    was fitted on lead to none, fitted to it again on more."""
    begun = equations
    while True:
        try:
            return equations, problem_at(equations).solve(tolerance=_SOLVED)[0]
        except (NotConverged, Undefined) as error:
            count = sum(flight.knots.size - 1 for flight in equations.start)
            coarse = _is_coarse(equations)
            lost = isinstance(error.__cause__ or error, Undefined) and count <= _MOST_INTERVALS
            if not coarse and fit and (lost or _is_coarse(begun)):
                first = begun.start[0]
                more = replace(first.scheme, intervals=2 * (first.knots.size - 1))
                begun = equations = replace(begun, start=fit(more))
                continue
            if not coarse or count > _MOST_INTERVALS:
                finer = f"{count} intervals do not resolve it; " if coarse else ""
                for problem in filter(None, (getattr(error, "last", None), problem_at(equations))):
                    _refuse_family(problem, _ALMOST, error)
                raise NotConverged(
                    f"no periodic orbit was found from there: {error}; {finer}let it "
                    f"settle longer (settle=){_unforced(equations)}",
                    residual=getattr(error, "residual", math.nan),
                ) from error
        halved = [flight.halved() for flight in equations.start]
        equations = replace(equations, start=_adapted(halved, equations.units))


def _is_coarse(equations: FlowEquations) -> bool:
    return any(flight.unresolved()[0] > UNRESOLVED for flight in equations.start)


def _lasts_no_time(orbit: Cycle) -> bool:
    """Test whether every state returns, for it has no time to leave."""
    return orbit.period <= SHORTEST * sum(flight.duration for flight in orbit.equations.start)


def _refuse_family(problem: Problem, near: float, error: Exception | None = None) -> None:
    """Refuse an orbit with others beside it: with a second multiplier that is so near 1."""
    with suppress(Undefined):
        orbit, curve = cycle_of(problem), Curve(problem, ())
        left = curve.equations(problem.x)
        if _lasts_no_time(orbit) or (error is None and not orbit.equations.condensed):
            return  # or too large to be asked
        solved = float(abs(left).max()) <= _ALMOST * np.max(problem.scales["orbit"])
        others = orbit.indices if orbit.paired else orbit.others
        family = solved
        # what is conserved and linear is so off the orbit, too: there is no orbit to find alone
        if not solved and error and orbit.equations.condensed:
            family = least_singular(curve.balanced(curve.jacobian(problem.x))).lost
        if family and abs(others - 1).min(initial=math.inf) <= near:
            second = "a second multiplier" if orbit.equations.autonomous else "a multiplier"
            why = (
                "it is one of a family, as where energy is conserved, or more (conserves=), or "
                "a sum of states, held by (total - it) added to the rate of one of them"
            )
            if orbit.equations.conservation:
                why = (
                    "more is conserved (conserves=), or you mean another orbit: start nearer to it"
                )
            raise NotConverged(
                f"the orbit of period {orbit.period:.6g} there cannot be continued, as {second} is "
                f"1: {why}; or it is at a bifurcation (take other parameters)"
                f"{_unforced(orbit.equations)}",
                residual=float(abs(left).max()),
            ) from error


def _unforced(equations: FlowEquations) -> str:
    where = "; where nothing depends on the time its period is unknown: leave period= out"
    clocked = any(isinstance(flow.until, Clock) for flow in equations.flows)
    return "" if equations.autonomous or clocked else where


def _refuse_passed(orbit: Cycle) -> None:
    """Refuse an orbit that Newton's iteration moved through a wall, of which it knows nothing, or
    beyond where its flows follow each other: what has yet to settle may go by another order."""
    passed = [(touch.clearance, f"passes {touch.guard} of flow {touch.flow}, which is "
               f"{touch.clearance:.3g} at t = {touch.time:.4g}")
              for touch in touches(orbit)]  # fmt: skip
    for margin in (*arrivals(orbit), *shares(orbit)):
        passed.append((margin.value, f"is beyond where {margin.said}"))
    value, said = min(passed, default=(0.0, ""))
    if value < -1e-9:  # less is passed, as where a walk begins
        raise NotConverged(
            f"no periodic orbit was found from there: the closest {said}; let it settle longer "
            "(settle=), or start closer to the orbit",
            residual=-value,
        )
