"""VI, an impact that loses its velocity, GR, a wall that is touched in between, and SL, where an
orbit of a Filippov system begins to slide, or to cross where it slid."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..continuation.curve import Curve
from ..continuation.derivatives import RELATIVE, directional
from ..continuation.newton import Array, Undefined
from ..continuation.point import DefiningSystem, Event, Examined, Point
from .collocation import TrajectorySegment
from .cycle_problem import Cycle, equations_of
from .equations import FlowEquations
from .filippov import Filippov, slid_along
from .flow import Clock, Function, Params, slopes, values
from .multipliers import paces, relative_paces

_LOOKS = 8  # into each interval for a wall that is touched
_ON_IT = 1e-9  # of a condition, relative to its size: a flow that begins this close begins on it
_AS_MUCH = 10.0  # or off by so many times what the flow before it is off where it ends
_FLAT = 1e-12  # a minimum that is less deep, relative to the largest value, is rounding
_SHRUNK = 2e-6  # of an orbit: a flow as short counts as none; what is off is the square of that
_SLOW = 1e-2  # of how fast a condition may change: it is all but touched
_BRACKET = 60  # halvings that locate the lowest place of a wall


def _slowest(point: Point) -> float:
    """How fast the condition falls that falls slowest where it ends its flow."""
    orbit: Cycle = point.base_point.solution
    return float(paces(orbit.equations, orbit.x, orbit.params).min())


def _slowest_end(orbit: Cycle) -> tuple[int, Function]:
    """The flow whose condition falls that slowly where it ends, and the condition."""
    ended = [(i, flow.until) for i, flow in enumerate(orbit.equations.flows) if flow.until]
    return ended[int(paces(orbit.equations, orbit.x, orbit.params).argmin())]


def _slowest_locus(point: Point) -> DefiningSystem:
    orbit: Cycle = point.base_point.solution
    i, until = _slowest_end(orbit)
    return _Reached(orbit.equations, i, until, 1.0, slice(1, 2)).system()  # it does not change


def _examine_slowest(point: Point) -> Examined:
    orbit: Cycle = point.base_point.solution
    i, _ = _slowest_end(orbit)
    return {"said": f"flow {i} only just reaches its end at t = {orbit.flights[i].last:.6g}"}


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
        """Both at a time and a state, and their derivatives in state, time and parameters."""

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
    """Where an orbit comes closest to touching a wall of its flows, at the ends of these, too, or
    what ends one before it does; None without walls."""
    touches: list[Touch] = []
    flows = orbit.equations.flows
    for i, (flow, flight) in enumerate(zip(flows, orbit.flights, strict=True)):
        # without a reset it begins where another ended: the walls of sliding are zero there at SL
        walled = flow.until is None or flows[i - 1].reset is not None
        s, states = flight.sampled(_LOOKS)
        for name, wall in flow.guards.items():
            if isinstance(wall, Clock):
                continue
            v = values(wall, flight.start + flight.duration * s, states, orbit.params)[0]
            ends = name == "until"
            begins = _apart(orbit, i, wall, abs(v).max()) if ends else walled
            places = [s[v.argmax()]]  # where no place is low this one is far from it
            for j in _lows(v, s, begins, ends):
                beside = s[max(j - 1, 0)], s[min(j + 1, s.size - 1)]
                places.append(_bottom(wall, flight, orbit.params, s[j], beside, ends))
            at = np.array(places)
            t = flight.start + flight.duration * at
            off = values(wall, t, flight.at(at), orbit.params)[0]
            low = int(off.argmin())
            touches.append(Touch(float(off[low]), i, float(at[low]), float(t[low]), name))
    return min(touches, key=lambda touch: touch.clearance, default=None)


def _apart(orbit: Cycle, i: int, until: Function, size: float) -> bool:
    """Whether a flow begins off its own condition, not on it as after an impact: so off is what is
    no error of where the flow before it ends. Where sliding begins SL is looked for."""
    flows, before, p = orbit.equations.flows, orbit.flights[i - 1], orbit.params
    if slid_along(flows[i]):
        return False
    reset, ended, state = flows[i - 1].reset, flows[i - 1].until, before.end[:, None]
    after = state if reset is None else values(reset, before.last, state, p)
    off = abs(values(until, before.last, after, p)[0, 0])
    error = abs(values(ended, before.last, state, p)[0, 0]) if ended else 0.0
    return bool(off > _ON_IT * size + _AS_MUCH * error)


def _lows(v: Array, s: Array, begins: bool, ends: bool) -> list[int]:
    """Where a wall has minima, those at the two ends of its flow among them.

    What ends the flow is zero there, so that is divided out: where it is touched before, v = 0 and
    v' = 0 as ever, but a minimum of v / (1 - s) comes into being while it is positive, and none
    does where the end itself grazes, at VI.
    """
    if ends:
        v = v[:-1] / (1 - s[:-1])
    beside = np.concatenate([[math.inf], v, [math.inf]])
    depth = np.maximum(beside[:-2], beside[2:]) - v
    low = (v <= beside[:-2]) & (v < beside[2:]) & (depth > _FLAT * abs(v).max())
    low[0] &= begins
    low[-1] &= not ends
    return [int(j) for j in np.flatnonzero(low)]


def _bottom(
    wall: Function,
    flight: TrajectorySegment,
    p: Params,
    s: float,
    beside: tuple[float, float],
    ends: bool,
) -> float:
    """Where the wall stops falling, by halving and the secant; `s` where it does not."""
    from scipy.optimize import brentq

    def rate(s: float) -> float:
        at, n = np.array([s]), len(flight.states)
        value, slope = slopes(wall, flight.start + flight.duration * at, flight.at(at), p)
        # by the part of the duration: dx/ds is what `rates` gives, dt/ds is the duration
        rate = slope[0, :n, 0] @ flight.rates(at)[:, 0] + slope[0, n, 0] * flight.duration
        # where the wall ends the flow that of v / (1 - s), but for a factor
        return float(value[0, 0] + (1 - s) * rate if ends else rate)

    low, high = beside
    if not (rate(low) < 0 < rate(high)):
        return s
    return float(brentq(rate, low, high, xtol=1e-15, maxiter=_BRACKET))


def _clearance(point: Point) -> float:
    touch = lowest(point.base_point.solution)
    return math.nan if touch is None else touch.clearance


def _clearance_locus(point: Point) -> DefiningSystem:
    touch, equations = lowest(point.base_point.solution), equations_of(point.base_point)
    if touch is None:
        raise Undefined("no wall comes close between the ends of a flow")
    flow = equations.flows[touch.flow]
    wall = flow.guards[touch.guard]
    if touch.place in (0.0, 1.0) and (flow.until or flow.reset):  # it goes on elsewhere
        return _Reached(equations, touch.flow, wall, touch.place, slice(1)).system()
    return _Reached(equations, touch.flow, wall, None, slice(2)).system(touch=touch.place)


def _examine_clearance(point: Point) -> Examined:
    orbit: Cycle = point.base_point.solution
    touch = lowest(orbit)
    if touch is None:
        return ""
    return {"said": f"flow {touch.flow} touches {touch.guard} at t = {touch.time:.6g}"}


# --- where a surface is reached ------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Arrivals:
    """Where an orbit comes to the surface of a Filippov system: the field of the other side points
    away from the surface where the orbit crosses it, and at it where it slides."""

    system: Filippov

    def __call__(self, point: Point) -> float:
        return min((margin for margin, _, _ in self._arrivals(point)), default=math.nan)

    def locus(self, point: Point) -> DefiningSystem:
        _, i, field = min(self._arrivals(point), key=lambda arrival: arrival[0])
        return _Reached(equations_of(point.base_point), i, field, 1.0, slice(1)).system()

    def examine(self, point: Point) -> Examined:
        orbit: Cycle = point.base_point.solution
        _, i, _ = min(self._arrivals(point), key=lambda arrival: arrival[0])
        return {"said": f"flow {i} ends at the edge of sliding at t = {orbit.flights[i].last:.6g}"}

    def _arrivals(self, point: Point) -> list[tuple[float, int, Function]]:
        orbit: Cycle = point.base_point.solution
        numbers = [self.system.flows.index(flow) for flow in orbit.equations.flows]
        fields = [self.system.to_minus.until, self.system.to_plus.until]
        arrivals = []
        for i, flight in enumerate(orbit.flights):
            if numbers[i] >= len(fields):
                continue  # it leaves the surface there
            field, follows = fields[numbers[i]], numbers[(i + 1) % len(numbers)]
            assert field is not None
            points_at_it = values(field, flight.last, flight.end[:, None], orbit.params)[0, 0]
            slides = follows >= len(fields)
            arrivals.append((float(points_at_it if slides else -points_at_it), i, field))
        return arrivals


def sliding(system: Filippov) -> Event:
    """SL, of the cycles of a Filippov system."""
    arrivals = _Arrivals(system)
    return Event("SL", arrivals, locus=arrivals.locus, examine=arrivals.examine, ends="domain")


# --- where a flow shrinks to nothing --------------------------------------------------------------


def _shortest(point: Point) -> tuple[float, int]:
    """The share of the orbit, beyond what counts as none, of its shortest flow among those that
    begin where a condition without a reset is all but touched, and which: where two flows meet at a
    tangency one comes into being, as short as the root of how far the parameter is beyond."""
    orbit: Cycle = point.base_point.solution
    flows, whole = orbit.equations.flows, orbit.period
    slow = relative_paces(orbit.equations, orbit.x, orbit.params)
    before = [(i - 1) % len(flows) for i in range(len(flows))]
    shares = [
        (flight.duration / whole - _SHRUNK, i)
        for i, (j, flight) in enumerate(zip(before, orbit.flights, strict=True))
        if flows[j].until and not flows[j].reset and slow[j] < _SLOW
    ]
    return min(shares, default=(math.nan, 0))


def _least_share(point: Point) -> float:
    return _shortest(point)[0]


def _shortest_locus(point: Point) -> DefiningSystem:
    i, lengths = _shortest(point)[1], equations_of(point.base_point).layout.lengths

    def conditions(curve: Curve, z: Array, extra: Array) -> Array:
        return z[lengths[i], None] - _SHRUNK * z[lengths].sum()

    def derivative(curve: Curve, z: Array, extra: Array) -> Array:
        row = np.zeros((1, z.size))
        row[0, lengths] = -_SHRUNK
        row[0, lengths[i]] += 1.0
        return row

    return DefiningSystem({}, conditions, derivative)


def _examine_shortest(point: Point) -> Examined:
    return {"said": f"flow {_shortest(point)[1]} shrinks to nothing, it begins at a tangency"}


def shrinking(kind: str) -> Event:
    """GR, or SL of a Filippov system, of cycles whose flows follow each other without a reset."""
    return Event(
        kind, _least_share, locus=_shortest_locus, examine=_examine_shortest, ends="domain"
    )


IMPACT = Event("VI", _slowest, locus=_slowest_locus, examine=_examine_slowest, ends="domain")
GRAZING = Event("GR", _clearance, locus=_clearance_locus, examine=_examine_clearance, ends="domain")
