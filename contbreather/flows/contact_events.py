"""Events VI, an impact that loses its velocity, GR, a wall that is touched in between, and SL: an
orbit of a Filippov system begins to slide, or to cross where it slid."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from ..continuation.algebra.derivatives import RELATIVE, directional
from ..continuation.algebra.newton import Array, Undefined
from ..continuation.curve.curve import Curve
from ..continuation.curve.point import DefiningSystem, Event, Examined, Point
from .collocation import TrajectorySegment
from .cycle_problem import Cycle
from .equations import FlowEquations, Places
from .filippov import Filippov, slid_along
from .flow import Clock, Function, Params, slopes, values
from .guards import bottom
from .multipliers import paces

_SHRUNK = 2e-6  # of an orbit: a flow as short counts as none; what is off is the square of that


@dataclass(frozen=True, eq=False)
class Lasting:
    """The condition that durations, weighted, add up to a time."""

    lengths: Places
    weights: Array
    total: float

    def system(self, **more: Any) -> DefiningSystem:
        return DefiningSystem({}, self.condition, self.derivative, **more)

    def condition(self, curve: Curve, z: Array, extra: Array) -> Array:
        return np.array([self.weights @ z[self.lengths] - self.total])

    def derivative(self, curve: Curve, z: Array, extra: Array) -> Array:
        row = np.zeros((1, z.size))
        row[0, self.lengths] = self.weights
        return row


class Margin(NamedTuple):
    """Distance of an orbit from one end of its branch, the equations of the end, and a sentence."""

    value: float
    system: Callable[[], DefiningSystem]
    said: str


@dataclass(frozen=True, eq=False)
class _Nearest:
    """Test of an event: the least of some margins of an orbit."""

    margins: Callable[[Cycle], Iterable[Margin]]

    def __call__(self, point: Point) -> float:
        nearest = self._of(point)
        return nearest.value if nearest else math.nan

    def locus(self, point: Point) -> DefiningSystem:
        if (nearest := self._of(point)) is None:
            raise Undefined("no wall comes close between the ends of a flow")
        return nearest.system()

    def examine(self, point: Point) -> Examined:
        nearest = self._of(point)
        return {"said": nearest.said} if nearest else ""

    def _of(self, point: Point) -> Margin | None:
        margins = self.margins(point.base_point.solution)
        return min(margins, key=lambda margin: margin.value, default=None)


def _event(kind: str, margins: Callable[[Cycle], Iterable[Margin]]) -> Event:
    nearest = _Nearest(margins)
    return Event(kind, nearest, locus=nearest.locus, examine=nearest.examine, ends="domain")


@dataclass(frozen=True, eq=False)
class _Reached:
    """A wall, and how fast it changes along the flow, at a place of a flow: at an unknown one both
    vanish where it is touched."""

    equations: FlowEquations
    flow: int
    wall: Function
    place: float | None  # 1 the end of the flow
    rows: slice  # which of both vanish there

    def system(self, **extra: float) -> DefiningSystem:
        return DefiningSystem(extra, self.conditions, self.derivative)

    def conditions(self, curve: Curve, z: Array, extra: Array) -> Array:
        x, p, s = z[: curve.size], curve.params(z), self._place(extra)
        t, state = self.equations.place(self.flow, s, x, p)
        return self._both(t, state, p, ())[0][self.rows]

    def derivative(self, curve: Curve, z: Array, extra: Array) -> Array:
        x, p, names, s = z[: curve.size], curve.params(z), curve.free, self._place(extra)
        t, state = self.equations.place(self.flow, s, x, p)
        local = self._both(t, state, p, names)[1]
        n = state.size + 1  # of the state and the time
        total = local[:, :n] @ self.equations.place_slopes(self.flow, s, x, p, names)
        total[:, curve.size : -1] += local[:, n:]
        return total[self.rows] if self.place is None else total[self.rows, :-1]

    def _place(self, extra: Array) -> float:
        return float(extra[0]) if self.place is None else self.place

    def _both(self, t: float, x: Array, p: Params, names: tuple[str, ...]) -> tuple[Array, Array]:
        """Evaluate both at a time and a state, and their derivatives, in parameters too."""

        def gradient(z: Array) -> Array:
            return slopes(self.wall, z[-1], z[:-1, None], p, names)[1][0, :, 0]

        at, n = np.append(x, t), x.size
        f, df = (
            of[..., 0] for of in slopes(self.equations.flows[self.flow].f, t, x[:, None], p, names)
        )
        grad, way = gradient(at), np.append(f, 1.0)
        # (grad w . f)' = w'' f + grad w . f', and w'' f is how the gradient changes along f
        step = RELATIVE * (1 + np.linalg.norm(at)) / np.linalg.norm(way)
        turned = directional(gradient, at, step * way) / step
        value = values(self.wall, t, x[:, None], p)[0, 0]
        return np.array([value, grad[: n + 1] @ way]), np.stack([grad, turned + grad[:n] @ df])


@dataclass(frozen=True, eq=False)
class Touch:
    """The lowest place of a wall along its flow: how far off it is, of which flow, when (in its
    duration, and in time), which of its guards."""

    clearance: float
    flow: int
    place: float
    time: float
    guard: str


def lowest(orbit: Cycle) -> Touch | None:
    """Find the place where an orbit comes closest to touching a wall of its flows, at the ends of
    these, too, or the condition that ends one before it does; None without walls."""
    touches: list[Touch] = []
    flows = orbit.equations.flows
    for i, (flow, flight) in enumerate(zip(flows, orbit.flights, strict=True)):
        # without a reset it begins where another ended: the walls of sliding are zero there at SL
        walled = flow.until is None or flows[i - 1].reset is not None
        s, states = flight.sampled(8)  # into each interval for a wall that is touched
        for name, wall in flow.guards.items():
            if isinstance(wall, Clock):
                continue
            v = values(wall, flight.start + flight.duration * s, states, orbit.params)[0]
            ends = name == "until"
            height = partial(_height, wall, flight, orbit.params)
            begins = _apart(orbit, i, wall, abs(v).max()) if ends else walled
            places = [s[v.argmax()]]  # where no place is low this one is far from it
            for j in _lows(v, s, begins, ends):
                low, high = s[max(j - 1, 0)], s[min(j + 1, s.size - 1)]
                places.append(bottom(partial(height, divided=ends), low, high)[0])
            at = np.array(places)
            off = height(at)
            low = int(off.argmin())
            time = flight.start + flight.duration * float(at[low])
            touches.append(Touch(float(off[low]), i, float(at[low]), time, name))
    return min(touches, key=lambda touch: touch.clearance, default=None)


def _height(
    wall: Function, flight: TrajectorySegment, p: Params, s: Array, divided: bool = False
) -> Array:
    """Evaluate a wall along a flight; divided by 1 - s where it ends the flow, but there."""
    v = values(wall, flight.start + flight.duration * s, flight.at(s), p)[0]
    return np.divide(v, 1 - s, out=np.full_like(v, math.inf), where=s < 1) if divided else v


def _apart(orbit: Cycle, i: int, until: Function, size: float) -> bool:
    """Tell whether a flow begins off its own condition, not on it as after an impact: by more than
    the error of the end of the flow before. Where sliding begins SL is looked for."""
    flows, before, p = orbit.equations.flows, orbit.flights[i - 1], orbit.params
    if slid_along(flows[i]):
        return False
    reset, ended, state = flows[i - 1].reset, flows[i - 1].until, before.end[:, None]
    after = state if reset is None else values(reset, before.last, state, p)
    off = abs(values(until, before.last, after, p)[0, 0])
    error = abs(values(ended, before.last, state, p)[0, 0]) if ended else 0.0
    return bool(off > 1e-9 * size + 10 * error)  # of its size, or by more than the end before


def _lows(v: Array, s: Array, begins: bool, ends: bool) -> list[int]:
    """Find the minima of a wall, those at the two ends of its flow among them.

    What ends the flow is zero there, so that is divided out: where it is touched before, v = 0 and
    v' = 0 as ever, but a minimum of v / (1 - s) comes into being while it is positive, and none
    does where the end itself grazes, at VI.
    """
    if ends:
        v = v[:-1] / (1 - s[:-1])
    beside = np.concatenate([[math.inf], v, [math.inf]])
    depth = np.maximum(beside[:-2], beside[2:]) - v
    # less deep is rounding
    low = (v <= beside[:-2]) & (v < beside[2:]) & (depth > 1e-12 * abs(v).max())
    low[0] &= begins
    low[-1] &= not ends
    return [int(j) for j in np.flatnonzero(low)]


def _clearances(orbit: Cycle) -> list[Margin]:
    """Measure how far the orbit is off touching a wall."""
    touch, equations = lowest(orbit), orbit.equations
    if touch is None:
        return []
    flow = equations.flows[touch.flow]
    wall, reached = flow.guards[touch.guard], partial(_Reached, equations, touch.flow)
    system = partial(reached(wall, None, slice(2)).system, touch=touch.place)
    if touch.place in (0.0, 1.0) and (flow.until or flow.reset):  # it goes on elsewhere
        system = partial(reached(wall, touch.place, slice(1)).system)
    said = f"flow {touch.flow} touches {touch.guard} at t = {touch.time:.6g}"
    return [Margin(touch.clearance, system, said)]


def _rates(orbit: Cycle) -> list[Margin]:
    """Measure how fast each condition falls where it ends its flow."""
    rates = paces(orbit.equations, orbit.x, orbit.params)
    return [
        Margin(
            rates[i][0],
            _Reached(orbit.equations, i, flow.until, 1.0, slice(1, 2)).system,  # no change there
            f"flow {i} only just reaches its end at t = {flight.last:.6g}",
        )
        for i, (flow, flight) in enumerate(zip(orbit.equations.flows, orbit.flights, strict=True))
        if flow.until
    ]


# --- where a surface is reached ------------------------------------------------------------------


def _arrivals(system: Filippov, orbit: Cycle) -> list[Margin]:
    """Measure the field of the other side where an orbit comes to the surface: it points away from
    it where the orbit crosses, and at it where it slides."""
    numbers = [system.flows.index(flow) for flow in orbit.equations.flows]
    fields, arrivals = [system.to_minus.until, system.to_plus.until], []
    for i, flight in enumerate(orbit.flights):
        if numbers[i] >= len(fields):
            continue  # it leaves the surface there
        field, slides = fields[numbers[i]], numbers[(i + 1) % len(numbers)] >= len(fields)
        assert field is not None
        points_at_it = float(values(field, flight.last, flight.end[:, None], orbit.params)[0, 0])
        reached = _Reached(orbit.equations, i, field, 1.0, slice(1)).system
        said = f"flow {i} ends at the edge of sliding at t = {flight.last:.6g}"
        arrivals.append(Margin(points_at_it if slides else -points_at_it, reached, said))
    return arrivals


def sliding(system: Filippov) -> Event:
    """Make the event SL of the cycles of a Filippov system."""
    return _event("SL", partial(_arrivals, system))


# --- where a flow shrinks to nothing --------------------------------------------------------------


def _shares(orbit: Cycle) -> list[Margin]:
    """Measure the share of the orbit, beyond what counts as none, of flows that begin where a
    condition without a reset is all but touched: where two flows meet at a tangency one comes into
    being, as short as the root of how far the parameter is beyond."""
    flows, lengths = orbit.equations.flows, orbit.equations.layout.lengths
    rates = paces(orbit.equations, orbit.x, orbit.params)
    return [
        Margin(
            flight.duration / orbit.period - _SHRUNK,
            Lasting(lengths, np.eye(len(flows))[i] - _SHRUNK, 0.0).system,
            f"flow {i} shrinks to nothing, it begins at a tangency",
        )
        for i, flight in enumerate(orbit.flights)
        if flows[i - 1].until and not flows[i - 1].reset
        if rates[(i - 1) % len(flows)][1] < 1e-2  # of its largest rate: all but touched
    ]


def shrinking(kind: str) -> Event:
    """Make the event GR, or SL of a Filippov system, of flows that follow without a reset."""
    return _event(kind, _shares)


IMPACT, GRAZING = _event("VI", _rates), _event("GR", _clearances)
