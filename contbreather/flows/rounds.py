"""Orbits that go around several times: the same one twice, and one once that repeats itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from ..continuation.algebra.newton import Array
from .collocation import TrajectorySegment, fitted, sizes_of, states_along
from .equations import FlowEquations
from .flow import Clock, TurnedBack, plain
from .functions import Function, Params, values
from .jacobian import FieldWithJacobian, at_other_time
from .rotation import moves, turned_back, unturned

RETURNS = 24  # so many flows back is looked for a return
REPEATS = 1e-3  # of its size: as near as this to itself a round later it is the same again
_LOOKS = 4  # into each interval for that


def twice(equations: FlowEquations, x: Array, p: Params) -> FlowEquations:
    """Run through the same orbit twice, as one of twice the period."""
    flights, flows, turns = equations.flights(x, p), equations.flows, 2 * equations.turns
    if equations.smooth and not moves(flows[0]) and (flows[0].reset is None or equations.givens):
        (flow,), (flight,), made = unturned(flows, flights)
        knots = np.concatenate([0.5 * flight.knots[:-1], 0.5 + 0.5 * flight.knots])
        # slopes are per interval: twice the duration and half the steps leave them as they are
        states, slopes = [flight.states, flight.states + made], np.vstack([flight.slopes] * 2)
        whole = replace(
            flight, knots=knots, duration=2 * flight.duration, states=np.vstack(states),
            slopes=slopes, rounds=2 * flight.rounds,
        )  # fmt: skip
        flow = turned_back(flow, 2 * made, getattr(flows[0].reset, "whole", np.inf))
        return replace(equations, flows=(flow,), start=(whole,), turns=turns)
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


def begun_later(equations: FlowEquations, x: Array, p: Params) -> tuple[Array, ...]:
    """Return the unknowns of the same orbit from each later period of its forcing on, as far as
    a mesh that begins elsewhere knows it; of several flows, from where the same ones follow; of one
    without forcing from where it is in phase with the first orbit."""
    flows, written = equations.flows, []
    if equations.smooth and equations.autonomous:
        return _in_phase(equations, x, p)
    if equations.smooth:
        later = [] if moves(flows[0]) else range(1, equations.turns)
    else:
        later = [i for i in range(1, len(flows)) if _follow(equations, i)]
    if not later:
        return ()
    _, flights, back = unturned(flows, equations.flights(x, p))
    period = sum(flight.duration for flight in flights)
    again = [*flights]
    for flight in flights:
        states = flight.states + back
        again.append(replace(flight, start=flight.start + period, states=states))
    for i in later:
        pieces = again[i : i + len(flows)]
        if equations.smooth:
            (flight,), begins = flights, flights[0].start + i / equations.turns * period
            even = np.linspace(0.0, 1.0, flight.knots.size)
            piece = fitted(flight.scheme, begins, period, partial(states_along, again), even)
            pieces = [replace(piece.adapted(equations.sizes[0]), start=flight.start)]
        written.append(np.concatenate([*map(np.ravel, equations.unknowns(pieces).values())]))
    return tuple(written)


def _in_phase(equations: FlowEquations, x: Array, p: Params) -> tuple[Array, ...]:
    """Begin at each place from which on the orbit is in phase with the first one."""
    from scipy.optimize import newton

    reset, (flight,) = equations.flows[0].reset, equations.flights(x, p)
    nodes, knots = equations.layout.nodes[0], equations.layout.knots[0][:-1]
    count, start, period = len(nodes), flight.start, flight.duration
    even = np.linspace(0.0, 1.0, count + 1)

    def before(states: Array) -> Array:  # a round earlier
        return states if reset is None else values(reset, flight.last, states, p)

    def motion(t: Array) -> Array:
        past = np.maximum(np.ceil((start - t) / period), 0)
        states = states_along([flight], t + past * period)
        for i in range(int(past.max())):
            states[:, past > i] = before(states[:, past > i])
        return states

    def begun(t: float) -> Array:
        piece = fitted(flight.scheme, t, period, motion, even).adapted(equations.sizes[0])
        written = equations.unknowns([replace(piece, start=start)], p)
        return np.concatenate([*map(np.ravel, written.values())])

    rounds, near = [x[nodes]], REPEATS * equations.sizes[0].max()
    for _ in range(RETURNS):  # back to where a mirror has led to itself
        rounds.insert(0, before(rounds[0].T).T)
        if not moves(equations.flows[0]) or abs(rounds[0] - rounds[-1]).max() <= near:
            break
    # with each of the intervals of the rounds before, up to the present beginning
    laps, past, at = np.vstack(rounds), len(rounds) - 1, np.append(0.0, x[knots])
    steps, off = np.tile(np.diff(at, append=1.0), past + 1), np.empty(past * count + 1)
    later = x.copy()
    for k in range(off.size):
        later[nodes], later[knots] = laps[k : k + count], np.cumsum(steps[k : k + count - 1])
        off[k] = equations.out_of_phase(later)
    # in phase this rises through zero, and half a turn later it falls
    rises, written = np.diff(off), list[Array]()
    for i in np.flatnonzero((off[:-1] <= 0) & (off[1:] > 0)):
        guess = i // count - past + at[i % count] - off[i] / rises[i] * steps[i]
        # in periods: the tolerance of `newton` is absolute
        found = newton(
            lambda turn: equations.out_of_phase(begun(start + turn * period)),
            guess, x1=guess + 0.1 * steps[i], disp=False,
        )  # fmt: skip
        written.append(begun(start + found * period))
    return tuple(written)


def _follow(equations: FlowEquations, i: int) -> bool:
    """Tell whether the same flows follow each other from a later one on, with clocks that are so
    many periods ahead, but for whole turns that are taken back."""
    flows = [plain(flow) for flow in equations.flows]
    ahead = [*flows[i:], *(flow.later(equations.turns) for flow in flows[:i])]
    now, then = (
        [flow.until.number for flow in of if isinstance(flow.until, Clock)] for of in (flows, ahead)
    )
    periods = then[0] - now[0] if now else 0
    return [flow.later(-periods) for flow in ahead] == flows


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
    flows = equations.flows[: len(flights)]
    if equations.smooth:
        flows = (replace(flows[0], reset=_part(flows[0].reset, rounds)),)
    return replace(
        equations, flows=flows, start=tuple(flights),
        turns=equations.turns // rounds, sizes=sizes_of(flights, equations.units),
    )  # fmt: skip


def _repeats(
    equations: FlowEquations, rounds: int, flights: Sequence[TrajectorySegment], p: Params
) -> bool:
    """Compare the orbit at all times and a part of its period later."""
    flows, (part, rest) = equations.flows, divmod(len(flights), rounds)
    if equations.turns % rounds and not equations.autonomous:
        return False
    if equations.smooth:
        (flight,), reset = flights, _part(flows[0].reset, rounds)
        s = np.linspace(0.0, 1 - 1 / rounds, _LOOKS * flight.knots.size)
        later = flight.at(s + 1 / rounds)
        if reset is not None:
            later = values(reset, flight.start + flight.duration * s, later, p)
        return bool(abs(later - flight.at(s)).max() <= REPEATS * equations.sizes[0].max())
    pairs = zip(flows, flows[part:], flights, flights[part:], equations.sizes, strict=False)
    return not rest and all(
        [*map(_first, (flow.f, flow.reset))] == [*map(_first, (successor.f, successor.reset))]
        and now.dimension == then.dimension
        and abs(then.at((looks := now.sampled(_LOOKS))[0]) - looks[1]).max() <= REPEATS * size.max()
        for flow, successor, now, then, size in pairs
    )


def _part(reset: Any, rounds: int) -> Any:
    """The reset of an orbit of so many rounds after one, where whole turns are taken back."""
    if not isinstance(reset, TurnedBack):
        return reset
    angles = reset.single > 0.0
    turns = reset.turns[angles] / reset.single[angles] / rounds
    return (
        replace(reset, turns=reset.turns / rounds) if np.allclose(turns, turns.round()) else reset
    )


def _first(function: Any) -> Any:
    """The function that `twice` evaluates some periods before, any number of times."""
    function = function.f if isinstance(function, FieldWithJacobian) else function
    while isinstance(function, partial) and function.func is _earlier:
        function = function.args[-1]
    return function


def _earlier(period: Function, turns: int, function: Function, t: Any, x: Any, p: Params) -> Any:
    """Evaluate a function of (t, x, p) so many periods before."""
    return function(t - turns * period(t, x, p), x, p)
