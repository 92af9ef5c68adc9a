"""What happens to cycles along a branch: LP, BP, PD, NS, and HB where they shrink to a point."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from functools import partial

import numpy as np

from ..continuation import normal_forms
from ..continuation.branch_points import bordered_matrix, crossing_event
from ..continuation.defining_systems import Singular, signed_smallest
from ..continuation.equilibria import fold
from ..continuation.linear_algebra import by_inverses
from ..continuation.multiplier_events import least_beside, linked, meetings, unresolved
from ..continuation.newton import OUT_OF_DOMAIN
from ..continuation.point import Event, Examined, Point
from ..continuation.sparse import Dense
from .equations import Equations
from .homoclinic import HOMOCLINIC
from .orbit import Cycle, equations_of
from .walls import GRAZING, IMPACT, shrinking

_AT_REST = 1e-5  # an orbit that swings by this, relative to its size, ends at an equilibrium


# --- where a cycle shrinks to an equilibrium ---------------------------------------------------


def _swing(point: Point) -> float:
    """How far the orbit swings the way it did at first, relative to its size, less what counts as
    an equilibrium: beyond one the curve goes on as the same cycles half a turn later."""
    equations = equations_of(point.base_point)
    first, states = equations.start[0].states, point.base_point.x[equations.layout.nodes[0]].T
    way = first - first.mean(axis=1, keepdims=True)
    swing = (states - states.mean(axis=1, keepdims=True)) * way
    size = np.linalg.norm(way) * np.linalg.norm(first)
    return float(swing.sum() / size) - _AT_REST


def _examine_swing(point: Point) -> Examined:
    orbit: Cycle = point.base_point.solution
    states = orbit.flights[0].states
    extent, size = float(np.ptp(states, axis=1).max()), float(abs(states).max())
    first = orbit.equations.start[0].states
    if extent < 100 * _AT_REST * max(size, float(np.linalg.norm(first))):
        return ""
    return f"it swings by {extent:.2g}: no equilibrium"


# --- the events -----------------------------------------------------------------------------


def _branches(point: Point) -> float:
    """About the least singular value with the row of the tangent below, by one factorisation."""
    matrix = bordered_matrix(point)
    if not isinstance(matrix, np.ndarray):
        return signed_smallest(matrix)
    factors = Dense(matrix)
    return by_inverses(factors, len(matrix))[0] if factors.exact else 0.0


def _examine_crossing(point: Point) -> Examined:
    assert _CROSSING.examine is not None
    return unresolved(point) or _CROSSING.examine(point)


def _examine_fold(point: Point) -> Examined:
    assert _PLAIN.examine is not None
    if reason := unresolved(point) or _PLAIN.examine(point):
        return reason
    with suppress(*OUT_OF_DOMAIN):  # u -> u + b u^2, and the direction of u is free
        return {"b": abs(normal_forms.cubic_at_cusp(point)[0].value)}
    return ""


_PLAIN = fold()
_LINKED = linked(replace(_PLAIN, examine=_examine_fold), partial(least_beside, "", -1.0))
_CROSSING = crossing_event(meetings("BP", _LINKED))
_BRANCH_POINT = replace(
    _CROSSING,
    test=Singular(bordered_matrix, _branches),
    count=None,
    examine=_examine_crossing,
)
_SHRUNK = Event("HB", _swing, examine=_examine_swing, ends="branch")


def events_of(equations: Equations, tangency: str = "GR") -> tuple[Event, ...]:
    """What can happen to a cycle of these flows; one comes into being at a tangency, GR or SL."""
    events = [_LINKED["LP"], _BRANCH_POINT, _LINKED["PD"], _LINKED["NS"]]
    if equations.autonomous and equations.smooth and equations.flows[0].reset is None:
        events.append(_SHRUNK)
    if equations.autonomous:
        events.append(HOMOCLINIC)
    if any(flow.until for flow in equations.flows):
        events.append(IMPACT)
    if any(flow.until or flow.walls for flow in equations.flows):
        events.append(GRAZING)
    if any(flow.until and not flow.reset for flow in equations.flows):
        events.append(shrinking(tangency))
    return tuple(events)
