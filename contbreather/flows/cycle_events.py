"""Events of cycles along a branch: LP, BP, PD, NS, and HB where they shrink to a point.

A curve of folds ends there, too, at GH.
"""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import replace
from functools import partial

import numpy as np

from ..continuation.algebra.linear_algebra import by_inverses
from ..continuation.algebra.newton import OUT_OF_DOMAIN, Array
from ..continuation.algebra.sparse import Dense
from ..continuation.bifurcations.equilibria import fold
from ..continuation.bifurcations.multiplier_events import linked, unresolved
from ..continuation.curve.point import DefiningSystem, Event, Examined, Point
from ..continuation.systems import normal_forms
from ..continuation.systems.branch_points import bordered_matrix, crossing_event
from ..continuation.systems.defining_systems import Singular, signed_smallest
from .contact_events import GRAZING, IMPACT, shrinking
from .cycle_problem import Cycle, equations_of
from .equations import FlowEquations
from .homoclinic import HOMOCLINIC

_AT_REST = 1e-5  # an orbit that swings by this, relative to its size, ends at an equilibrium
_FLAT = 3e-3  # and on a curve of folds, where the fourth power of it is to be told from rounding


# --- where a cycle shrinks to an equilibrium ---------------------------------------------------


def _shrinks(equations: FlowEquations) -> bool:
    """Tell whether such a cycle may shrink to an equilibrium."""
    return equations.autonomous and equations.smooth and equations.flows[0].reset is None


def _amplitude(equations: FlowEquations, x: Array) -> float:
    """Measure the swing of the orbit the way it did at first, relative to its size: beyond an
    equilibrium the curve goes on as the same cycles half a turn later."""
    first, states = equations.start[0].states, x[equations.layout.nodes[0]]
    way = first - first.mean(axis=0)
    swing = (states - states.mean(axis=0)) * way
    return float(swing.sum() / (np.linalg.norm(way) * np.linalg.norm(first)))


def _swing(least: float, point: Point) -> float:
    """Measure the swing, less that of an equilibrium."""
    return _amplitude(equations_of(point.base_point), point.base_point.x) - least


def _examine_swing(least: float, point: Point) -> Examined:
    orbit: Cycle = point.base_point.solution
    states = orbit.flights[0].states
    extent, size = float(np.ptp(states, axis=0).max()), float(abs(states).max())
    first = orbit.equations.start[0].states
    if extent < 100 * least * max(size, float(np.linalg.norm(first))):
        return ""
    return f"it swings by {extent:.2g}: no equilibrium"


def _examine_generalised(point: Point) -> Examined:
    """The end of a curve of folds, and where that is: the parameters are off by c A^2, so by half
    of A dp/dA."""
    if reason := _examine_swing(_FLAT, point):
        return reason
    equations, (z, tangent) = equations_of(point.base_point), (point.z, point.direction)
    left = _amplitude(equations, z) / _amplitude(equations, tangent)
    names, slots = point.base_point.curve.free, point.curve.slots
    places = (float(z[slots[name]] - 0.5 * left * tangent[slots[name]]) for name in names)
    where = ", ".join(f"{name} = {at:.8g}" for name, at in zip(names, places, strict=True))
    return {"said": f"the folds end at a generalised Hopf point, {where}"}


_SHRUNK = Event(
    "HB", partial(_swing, _AT_REST), examine=partial(_examine_swing, _AT_REST), ends="branch"
)
_GENERALISED = Event("GH", partial(_swing, _FLAT), examine=_examine_generalised, ends="branch")


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
    # where a branch is steep, as at a canard, rounding turns its parameter back, too
    off = abs(point.base_point.solution.others - 1).min(initial=math.inf)
    if not off < 0.1:  # 1e-5 where the parameter turns by 1e-13
        return f"no multiplier is 1: the nearest is {off:.2g} off"
    with suppress(*OUT_OF_DOMAIN):  # u -> u + b u^2, and the direction of u is free
        b = normal_forms.cubic_at_cusp(point)[0]
        return {} if b.degenerate else {"b": abs(b.value)}  # of a canard it is rounding
    return ""


def _fold_locus(point: Point) -> DefiningSystem:
    assert _PLAIN.locus is not None
    locus, ends = _PLAIN.locus(point), _shrinks(equations_of(point))
    return replace(locus, events=(*locus.events, _GENERALISED)) if ends else locus


_PLAIN = fold()
_FOLD = replace(_PLAIN, locus=_fold_locus, examine=_examine_fold)
_CIRCLE = linked(_FOLD)
_CROSSING = crossing_event(_CIRCLE.meetings("BP"))
_BRANCH_POINT = replace(
    _CROSSING, test=Singular(bordered_matrix, _branches), count=None, examine=_examine_crossing
)


def events_of_cycle(equations: FlowEquations, tangency: str = "GR") -> tuple[Event, ...]:
    """List the events of a cycle of these flows; one comes into being at a tangency, GR or SL."""
    lp, pd, ns = (_CIRCLE.events[kind] for kind in ("LP", "PD", "NS"))
    events = [lp, _BRANCH_POINT, pd, ns]
    if _shrinks(equations):
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
