"""Cycles of the flows that follow beyond GR, VI and SL: with a contact more, or one less."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np

from ..continuation.algebra.derivatives import directional
from ..continuation.algebra.newton import Array, Undefined, newton
from ..continuation.branches.switching import Seed, SwitchingProblem
from ..continuation.curve.curve import Curve
from ..continuation.curve.point import Point
from .collocation import TrajectorySegment, fitted, sizes_of, states_along
from .equations import FlowEquations, equations_of
from .flow import Clock, Flow, Wall, contact_of, flow_between, plain, slid_along, system_of
from .functions import values
from .integrate import bottom
from .multipliers import paces
from .rotation import turned_back, unturned
from .rounds import once

SHORTEST = 2e-6  # of an orbit: a flow as short counts as none; what is off is the square of that
# one that leaves a surface after sliding is off it by the cube, a fourth root above rounding
LEAVES = float(np.finfo(float).eps) ** 0.25

_UNKNOWN = "which flows follow there is not known; "

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
    """Differentiate a margin along a way, from the slopes inside that the place itself has."""
    margin(curve, z)
    return float(directional(partial(margin, curve), z, SHORTEST * way)[0]) / SHORTEST


def _contacts(i: int, least: float | None, curve: Curve, z: Array) -> Array:
    """Measure a contact beyond none: its share of the orbit, whose period changes along an arm, or
    the velocity of an impact."""
    equations, x = curve.problem.residual, z[: curve.size]
    if least is None:
        return np.array([paces(equations, x, curve.params(z))[i][0]])
    lengths = z[equations.layout.lengths]
    return lengths[[i]] - least * lengths.sum()


def _height(wall: Any, i: int, part: float, curve: Curve, z: Array, sign: float = 1.0) -> Array:
    """Evaluate a wall at a part of a flow."""
    p = curve.params(z)
    t, state = curve.problem.residual.place(i, part, z[: curve.size], p)
    return sign * values(wall, t, state[:, None], p)[:, 0]


def _lowest(wall: Any, part: float, near: float, curve: Curve, z: Array) -> Array:
    """Evaluate a wall where the first flow comes closest to it near a part of it: what nothing
    drives has its phase as Newton's iteration left it."""
    p = curve.params(z)
    flight = curve.problem.residual.flights(z[: curve.size], p)[0]

    def height(s: Array) -> Array:
        return values(wall, flight.start + s * flight.duration, flight.at(s % 1.0), p)[0]

    lowest, value = bottom(height, part - near, part + near)
    while near / 2 < abs(lowest - part) < 0.25:  # at an end of what is looked at
        near *= 2
        lowest, value = bottom(height, part - near, part + near)
    return np.array([value])


def beyond_contact(point: Point) -> SwitchingProblem:
    """Make the cycle of the flows that follow at GR, VI, SL and CC: one contact more where a wall
    is touched, one less where it has shrunk to nothing or an impact has lost its velocity.

    The parameter moves by the square of how long a contact lasts, so that one which counts as none
    is there to begin with; it moves in proportion to the velocity of an impact, which may be 0.
    """
    equations, orbit, p, detail = equations_of(point), point.solution, point.params, point.detail
    more, flow, count = "touch" in detail, detail["flow"], len(orbit.flights)
    before, met, after = map(plain, (equations.flows * 3)[count + flow - 1 : count + flow + 2])
    guard = detail.get("guard", "sliding" if flow_between(before, after) == met else "")
    if point.kind == "SL" and guard == "sliding":
        return _at_edge(point)
    if "guard" in detail and not more:
        return _at_collision(point, guard)
    begins = flow if more or point.kind == "VI" else flow - 1  # the flow that meets the wall
    order = [(begins + i) % count for i in range(count)]
    flows, flights = ([of[i] for i in order] for of in (equations.flows, orbit.flights))
    start = flights[0].start
    flights = [replace(f, start=start + (f.start - start) % orbit.period) for f in flights]
    flows, flights, turns = unturned(flows, flights)
    hit, walls = _hit(point, flows, flights[0])
    slides = slid_along(flows[0])
    least = (LEAVES if slides else SHORTEST) if hit[1:] else None
    short = (least or 0.0) * orbit.period
    # where it is touched: sliding lasts up to there; after sliding the surface is left as
    # t^2 (3 s - 2 t), with the field out of it up to t = s
    part = 1 / 3 if slides else 1 if any(map(slid_along, hit)) else 1 / 2
    if more:
        touch = start + detail["touch"] * flights[0].duration
        parts, pieces = _added(hit, walls, flows, flights, touch - part * short, short, turns)
    else:
        touch = flights[0].last + (part * flights[1].duration if short else 0.0)
        # the flows before and after, which may be one, are joined
        joined, *rest = flows[len(hit) :] or [replace(flows[0], until=None, reset=None)]
        passed, parts = flights[: len(hit) + 1], [joined.walled([hit]), *rest]
        pieces = [*_refitted(passed, [start, passed[-1].last]), *flights[len(passed) :]]
    made = _made_of(equations, turns, p, parts, pieces)
    made = made if more else once(made, made.start, p)
    part = detail["touch"] if more else (touch - start) / made.start[0].duration % 1
    lasts = partial(_contacts, len(hit) - 1 if more else flow, least)
    wall, near = hit[0].until, short / made.start[0].duration
    height = partial(_height, wall, flow, part) if more else partial(_lowest, wall, part, near)
    row, weight = (made.layout.lengths[1] if more and short else -1), 1.0
    if more and not short:  # the rebound, along its way: in a plane the parameter turns there
        row, weight = made.layout.nodes[1 % len(parts)][0], pieces[1 % len(parts)].slopes[0, 0]
    return _switching(point, made, row, (height, lasts), more, weight)


def _switching(
    point: Point, made: FlowEquations, row: Any, margins: tuple[Margin, Margin], more: bool,
    weight: Any = 1.0,
) -> SwitchingProblem:  # fmt: skip
    """Solve for the cycle beyond with unknowns, weighted, or the parameter, as they are there; its
    margins are those of orbits with a contact less, and with one `more`."""
    curve = Curve(point.curve.problem.of_flows(made, point.params, "cycle"), point.curve.free)
    along = np.zeros(curve.start.size)
    along[row] = weight
    solution = newton(curve, curve.start, along)
    if not solution.converged:
        raise Undefined(
            f"no orbit of the flows that follow there: residual {solution.residual:.2g}"
        )
    start, (free,) = Point(curve, solution.z).problem, curve.free
    here, there = margins if more else margins[::-1]
    return _Beyond(start, free, point=point, here=here, there=there, along=along)


def _at_edge(point: Point) -> SwitchingProblem:
    """Make the cycle with the flow that comes to be at the edge of sliding, or without it; with all
    of them where an orbit is symmetric.

    Along the surface it may last no time at all; off it, it lasts as long as what counts as none.
    """
    equations, orbit, i, p = equations_of(point), point.solution, point.detail["flow"], point.params
    flows, flights, turns = unturned(equations.flows, orbit.flights)
    more, short = "guard" in point.detail, SHORTEST * orbit.period
    arrives, follows = (i if more else i - 1), [*flows[1:], flows[0]]
    system, comes = system_of(flows[arrives]), flow_between(flows[i], follows[i]) or flows[i]
    assert system
    least, sign = (0.0, -1.0) if slid_along(comes) else (SHORTEST, 1.0)
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
            if abs(edge) < 1e-6 * orbit.paces[j][0]:
                parts.append(new)
                last = flight.last + least * orbit.period
                pieces += _refitted([flight], [flight.last, last])
    made = _made_of(equations, turns, p, parts, pieces)
    lasts = partial(_contacts, place if more else i, least)
    facing = partial(_height, system.facing(flows[arrives]), i if more else place, 1.0, sign=sign)
    row = made.layout.lengths[place] if more and least else -1
    return _switching(point, made, row, (facing, lasts), more)


def _at_collision(point: Point, guard: str) -> SwitchingProblem:
    """Make the cycle with the second flow of a wall that is touched as a flow ends, which comes to
    be there; or without one that ends as it begins, where a clock that ends it says what follows;
    or with impacts that come at once in the other order.
    """
    equations, orbit, i, p = equations_of(point), point.solution, point.detail["flow"], point.params
    flows, flights, turns = unturned(equations.flows, orbit.flights)
    parts, pieces = list(flows), list(flights)
    shrunk = np.flatnonzero([flight.duration < 0.5 * SHORTEST * orbit.period for flight in flights])
    pairs = i in shrunk and not {*shrunk} & {*(shrunk - 1) % len(flights)}
    if pairs and (other := point.curve.problem.exchanged(orbit, shrunk)):
        made, lasts = _made_of(equations, turns, p, *other), partial(_contacts, i, 0.0)
        return _switching(point, made, made.layout.lengths[i], (lasts, lasts), more=True)
    if more := guard.startswith("walls"):
        hit = dict(zip(reversed(flows[i].guards), reversed(flows[i].walls), strict=False))[guard]
    else:
        hit = flows[i - 1], flows[i]
    if callable(hit) or not hit[1:]:
        reason = "give those up to the wall and behind it, walls=([up, behind],)"
        if not callable(hit):
            reason = "its reset moves the state as another flow ends: orbits do not go over"
        raise Undefined(f"{_UNKNOWN}{reason}")
    met = hit[1].struck(flights[i].last, p)
    if more:
        known = all(_ends(of, flights[i], 1.0, p) for of in (hit[0].until, met.until))
    else:
        clocked = isinstance(met.until, Clock) and hit[0].reset is None
        known = clocked and flights[i].duration < SHORTEST * orbit.period
    if not known or "at once" in point.detail:
        raise Undefined(f"{_UNKNOWN}where flows begin and end at once they do in another order")
    if more:
        parts[i : i + 1] = hit[0].walled(flows[i].walls), met
        pieces.insert(i + 1, *_refitted([flights[i]], [flights[i].last, flights[i].last]))
    else:
        parts[i - 1] = replace(flows[i - 1], until=met.until, reset=met.reset).walled([hit])
        del parts[i], pieces[i]
    made = _made_of(equations, turns, p, parts, pieces)
    ended = i if more else (i - 1) % len(flows) - (i == 0)
    margins = partial(_height, hit[0].until, ended, 1.0), partial(_contacts, i + more, 0.0)
    row = made.layout.lengths[i + 1] if more else -1
    return _switching(point, made, row, margins, more)


def in_other_order(orbit: Any, shrunk: Array) -> tuple[list[Flow], list[TrajectorySegment]] | None:
    """Exchange the impacts that these flows, which last no time, lie between, if each is known as a
    wall of the flow that the other one ends and the state after both is the same either way."""
    flows, flights, _ = unturned(orbit.equations.flows, orbit.flights)
    for i in shrunk:
        first, second, arrives = flows[i - 1], flows[i], flights[i - 1]
        t, x, a, b = arrives.last, arrives.end[:, None], first.reset, second.reset
        if not (a and b and first.meets(second) and second.meets(first)):
            return None
        alone, before = (values(reset, t, x, orbit.params) for reset in (b, a))
        both = values(a, t, alone, orbit.params), values(b, t, before, orbit.params)
        if abs(both[1] - both[0]).max() > 1e-6 * abs(x).max():
            return None
        flows[i - 1], flows[i] = first.exchanged(second), second.exchanged(first)
        flights[i] = flights[i].resting(alone[:, 0])
    return flows, flights


def _made_of(
    equations: FlowEquations, turns: Array, p: Any, flows: Sequence[Flow],
    flights: Sequence[TrajectorySegment],
) -> FlowEquations:  # fmt: skip
    """Make the cycle of other flows, with whole turns taken back; meshes measure the motion as it
    is, not as it was where the branch began."""
    parts = [flow.struck(flight.last, p) for flow, flight in zip(flows, flights, strict=True)]
    parts[-1] = turned_back(parts[-1], turns)
    sizes = sizes_of(flights, equations.units)
    start = tuple(flight.adapted(size) for flight, size in zip(flights, sizes, strict=True))
    return replace(equations, flows=tuple(parts), start=start, sizes=sizes)


def _hit(
    point: Point, flows: Sequence[Flow], flight: TrajectorySegment
) -> tuple[tuple[Flow, ...], list[Wall]]:
    """Return the flows of a contact, the first of which ends at the wall, and all walls there.

    Raises `Undefined` where an orbit beyond is not made of them.
    """
    first, detail = flows[0], point.detail
    own, system, slides = contact_of(first, (*flows, first)[1]), system_of(first), slid_along(first)
    walls = [*([own] if first.until else []), *first.walls]
    guard = detail.get("guard", "until")
    hit = dict(zip(first.guards, walls, strict=True))[guard]
    if slides and "touch" in detail:  # along the surface to where a field leaves it, and off it
        i = [flow.until for flow in slides.flows].index(first.guards[guard])
        hit = slides.flows[i], slides.flows[i - 2]
    part, reason = detail.get("touch", 1.0), ""
    joins = hit is own and not (system and "touch" in detail)
    following = (list(flows) * 3)[len(hit)] if joins else first
    if "at once" in detail:
        reason = (
            f"walls are touched at once, {detail['at once']}: orbits that hit one of them alone "
            "begin there, and those that hit all; move a wall a little to follow one contact"
        )
    elif callable(hit):
        reason = "give the wall as the flow that ends there, walls=(cb.Flow(f, until=, reset=),)"
    elif first.until is None and first.reset:
        reason = "of half of a symmetric orbit no flow ends at a wall: follow the whole of it"
    elif not _alike(hit[0].f, following.f, flight, point.params) or (
        point.kind == "VI" and hit[1:]
    ):
        reason = "a flow with the same f has to lead on, after a reset or one flow in between"
    elif not _stays(hit, flight, part, point):
        reason = (
            "a reset moves the state even where nothing is hit, or the flow that follows goes on: "
            "orbits do not go over"
        )
    if reason:
        raise Undefined(f"{_UNKNOWN}{reason}")
    return hit, walls


def _alike(f: Any, g: Any, flight: TrajectorySegment, p: Any) -> bool:
    """Tell whether two fields are one along a flight, though each may be written anew."""
    s, states = flight.sampled(2)
    times = flight.start + flight.duration * s
    one, other = (values(field, times, states, p) for field in (f, g))
    return np.array_equal(one, other)


def _stays(hit: Sequence[Flow], flight: TrajectorySegment, part: float, point: Point) -> bool:
    """Tell whether the resets of a contact that only just takes place leave the state, and the flow
    behind the wall ends: a heater that has come on at one level goes off at another."""
    after = x = flight.at(np.array([part]))
    touched = flight.start + flight.duration * part
    for ending in (flow.until for flow in hit[1:] if flow.until and not system_of(flow)):
        if not _ends(ending, flight, part, point.params):
            return False
    for reset in filter(None, (flow.reset for flow in hit)):
        after = values(reset, touched, after, point.params)
    # of the motion: at a wall at 0 the state itself has none, nor has what rests until it is hit
    (size,) = sizes_of([flight], equations_of(point).units)
    return after.shape == x.shape and bool((abs(after - x)[:, 0] <= 1e-6 * size).all())


def _ends(until: Any, flight: TrajectorySegment, part: float, p: Any) -> bool:
    """Tell whether a condition is zero at a part of a flight, relative to what it is along it."""
    s, states = flight.sampled(2)
    places = (part, flight.at(np.array([part]))), (s, states)
    left, along = (values(until, flight.start + flight.duration * at, x, p) for at, x in places)
    return bool(abs(left).max() <= 1e-6 * abs(along).max())


def _added(
    hit: Sequence[Flow], walls: Sequence[Wall], flows: Sequence[Flow],
    flights: Sequence[TrajectorySegment], begins: float, short: float, turns: Array,
) -> tuple[list[Flow], list[TrajectorySegment]]:  # fmt: skip
    """Cut the first flow in two at a contact."""
    (whole, *rest), parts = flights, [hit[0].walled(walls), *hit[1:]]
    joints = [begins, begins + short] if short else [begins]
    if flows[0].until is None:  # what comes after the contact goes on into what is before it
        earlier = whole.start - whole.duration
        before = replace(whole, start=earlier, states=whole.states - turns)
        return parts, _refitted([before, whole], [joints[-1] - whole.duration, *joints])
    return [*parts, *flows], [*_refitted([whole], [whole.start, *joints, whole.last]), *rest]


def _refitted(
    flights: Sequence[TrajectorySegment], cuts: Sequence[float]
) -> list[TrajectorySegment]:
    """Fit flights that follow each other anew, between these times."""
    scheme, states, size = flights[0].scheme, partial(states_along, flights), sizes_of(flights)[0]
    return [fitted(scheme, a, b - a, states).adapted(size) for a, b in pairwise(cuts)]
