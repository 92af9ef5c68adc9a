"""VI, an impact that loses its velocity, and GR, a wall that is touched in between."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial

import numpy as np

from ..continuation.curve import Curve
from ..continuation.newton import Array, Undefined
from ..continuation.point import Event, Locus, Point
from .collocation import Flight
from .equations import Equations
from .flow import Function, Params, slopes, values
from .orbit import Cycle, equations_of

_LOOKS = 8  # into each interval for a wall that is touched
_BRACKET = 60  # halvings that locate the lowest place of a wall


def _slowest(point: Point) -> float:
    """How fast the condition falls that falls slowest where it ends its flow."""
    orbit: Cycle = point.ground.solution
    paces = orbit.equations.paces(orbit.x, orbit.params)
    return float(paces.min()) if paces.size else math.nan


def _slowest_locus(point: Point) -> Locus:
    orbit: Cycle = point.ground.solution
    number = int(orbit.equations.paces(orbit.x, orbit.params).argmin())
    return Locus({}, partial(_pace, orbit.equations, number))


def _pace(equations: Equations, number: int, curve: Curve, z: Array, extra: Array) -> Array:
    return equations.paces(z[: curve.size], curve.params(z))[[number]]


@dataclass(frozen=True, eq=False)
class Touch:
    """The lowest place of a wall between the ends of its flow: how far off it is, of which flow,
    when (in its duration), which wall."""

    clearance: float
    flow: int
    place: float
    wall: Function


def lowest(orbit: Cycle) -> Touch | None:
    """Where an orbit comes closest to touching a wall between the ends of its flows."""
    found: list[Touch] = []
    for i, (flow, flight) in enumerate(zip(orbit.equations.flows, orbit.flights, strict=True)):
        walls = (*flow.walls, *([flow.until] if flow.until else []))
        if not walls:
            continue
        s, states = flight.sampled(_LOOKS)
        for wall in walls:
            v = values(wall, flight.start + flight.duration * s, states, orbit.params)[0]
            for j in np.flatnonzero((v[1:-1] <= v[:-2]) & (v[1:-1] < v[2:])) + 1:
                place = _bottom(wall, flight, orbit.params, s[j - 1], s[j + 1])
                found.append(Touch(_wall(wall, flight, orbit.params, place)[0], i, place, wall))
    return min(found, key=lambda touch: touch.clearance, default=None)


def _wall(wall: Function, flight: Flight, p: Params, s: float) -> tuple[float, float]:
    """The value of a wall at a time of a flight, and how fast it changes in its duration."""
    at = np.array([s])
    value, slope = slopes(wall, flight.start + flight.duration * at, flight.at(at), p, ())
    n = len(flight.states)
    rate = slope[0, :n, 0] @ flight.rates(at)[:, 0] + slope[0, n, 0] * flight.duration
    return float(value[0, 0]), float(rate)


def _bottom(wall: Function, flight: Flight, p: Params, low: float, high: float) -> float:
    """Where the wall stops falling, by halving and the secant."""
    from scipy.optimize import brentq

    def rate(s: float) -> float:
        return _wall(wall, flight, p, s)[1]

    if not (rate(low) < 0 < rate(high)):
        return 0.5 * (low + high)
    return float(brentq(rate, low, high, xtol=1e-15, maxiter=_BRACKET))


def _clearance(point: Point) -> float:
    touch = lowest(point.ground.solution)
    return math.nan if touch is None else touch.clearance


def _clearance_locus(point: Point) -> Locus:
    touch, equations = lowest(point.ground.solution), equations_of(point.ground)
    if touch is None:
        raise Undefined("no wall comes close between the ends of a flow")
    return Locus({"touch": touch.place}, partial(_touched, equations, touch))


def _touched(equations: Equations, touch: Touch, curve: Curve, z: Array, extra: Array) -> Array:
    """The wall and how fast it changes, both zero where it is touched."""
    p = curve.params(z)
    flight = equations.flights(z[: curve.size], p)[touch.flow]
    return np.array(_wall(touch.wall, flight, p, float(extra[0])))


IMPACT = Event("VI", _slowest, locus=_slowest_locus, ends="domain")
GRAZING = Event("GR", _clearance, locus=_clearance_locus, ends="domain")
