"""Events of breathers. Of conservative ones those of pairs of multipliers, as of cycles where
something is conserved: at +1 LP, where the energy of the family turns (or at a given energy its
parameter), BP, and PF, where orbits that are not time-reversible branch off; at -1 PD; KC.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from scipy import sparse

from ..continuation.algebra.linear_algebra import least_singular
from ..continuation.algebra.newton import Array
from ..continuation.algebra.sparse import Matrix, canonical
from ..continuation.bifurcations.multiplier_events import vanishing
from ..continuation.curve.curve import Curve
from ..continuation.curve.point import Always, DefiningSystem, Event, Examined, Point
from ..continuation.systems.branch_points import bordered_matrix
from ..continuation.systems.defining_systems import (
    Singular,
    along_by_difference,
    rank_locus,
    signed_smallest,
)
from ..flows.conservative_events import conservative_events, examine_place, meeting
from ..flows.cycle_events import BRANCH_POINT, FLAT, events_of_cycle, examine_swing, swing
from ..flows.equations import FlowEquations
from .half_orbit import HalfOrbit


def _closed(rest: str, curve: Curve, z: Array) -> Matrix:
    """The equations of other perturbations than those of the orbit, see `HalfOrbit.closed_by`."""
    half: HalfOrbit = curve.problem.residual
    return half.closed_by(rest, z[: curve.size], curve.params(z), curve.free)


def _weak(rest: str, curve: Curve, z: Array) -> tuple[float, Array, Array]:
    """The least singular value of these, and its vectors."""

    def make(z: Array) -> tuple[float, Array, Array]:
        weak = least_singular(_closed(rest, curve, z)[:, : curve.size])
        return weak.sign * weak.size, weak.sign * weak.left, weak.right

    found: tuple[float, Array, Array] = curve.cached(f"closed by {rest}", z, make)
    return found


def _locus(rest: str) -> DefiningSystem:
    """Where these equations lose rank."""
    return rank_locus(partial(_weak, rest), partial(_closed, rest))


def _turned_around(point: Point) -> float:
    """Measure how near the map from v to u is to another null vector than the orbit's own."""
    half = point.base_point.solution.half_map
    return signed_smallest(np.block([[half.B, half.end[:, None]], [half.start, np.zeros(1)]]))


def _at_minus_one(point: Point) -> DefiningSystem:
    """Perturbations that change their sign are at rest at one end of the half or at the other."""
    curve, z = point.base_point.curve, point.base_point.z
    return _locus(min(("vu", "uv"), key=lambda rest: abs(_weak(rest, curve, z)[0])))


def _bordered(curve: Curve, z: Array, extra: Array) -> tuple[float, Array, Array]:
    """A number that vanishes where a pair of multipliers is at an angle, and the vectors of its
    derivative, as `multiplier_events.bordered` has them."""

    def make(place: Array) -> tuple[float, Array, Array]:
        rows, rest = curve.problem.residual.pairs(math.cos(place[-1]))
        ends = _closed("", curve, z)[:, : curve.size]
        return vanishing(canonical(rows @ sparse.block_diag([ends, ends]) + rest))

    found: tuple[float, Array, Array] = curve.cached("pair", np.append(z, extra), make)
    return found


def _slope_of_bordered(curve: Curve, z: Array, extra: Array) -> Array:
    pairs, (_, right, left) = curve.problem.residual.pairs, _bordered(curve, z, extra)
    parts, ends = np.split(right, 2), partial(_closed, "")
    ways = zip(np.split(pairs(math.cos(extra[0]))[0].T @ left, 2), parts, strict=True)
    in_z: Any = sum(along_by_difference(curve, z, one, other, ends) for one, other in ways)
    moved = np.concatenate([ends(curve, z)[:, : curve.size] @ part for part in parts])
    in_index = left @ ((pairs(1.0)[0] - pairs(0.0)[0]) @ moved)
    return -np.append(in_z, -math.sin(extra[0]) * in_index)


def _crosses(point: Point) -> float:
    """The test of BP; NaN where its sign is rounding. Next to the band a breather may move along a
    ring all but freely: anywhere there is a solution, to the error of Newton's iteration."""
    assert BRANCH_POINT.test is not None
    off = abs(point.base_point.solution.indices - 1).min(initial=math.inf)
    # an index less off 1 is that of a motion which nothing holds back
    return math.nan if off < 1e-8 else BRANCH_POINT.test(point)


def _born(point: Point) -> Examined:
    """The end of a family at rest, and the mode of which it is there."""
    if reason := examine_swing(FLAT, point):
        return reason
    orbit = point.base_point.solution
    modes = orbit.chain.frequencies(orbit.params)
    nearest = int(abs(modes - orbit.omega).argmin())
    edges = {0: "the lower edge of the band", modes.size - 1: "the upper edge of the band"}
    mode = f"the mode of frequency {modes[nearest]:.9g}, {edges.get(nearest, 'in the band')}"
    return {"said": f"it shrinks to rest: the family is born there from {mode}"}


def events_of_breather(equations: FlowEquations) -> tuple[Event, ...]:
    """List the events of a breather of these equations."""
    if not isinstance(equations, HalfOrbit):
        return events_of_cycle(equations)
    crossing = replace(BRANCH_POINT, test=Singular(bordered_matrix, _crosses))
    lp, turn, branch_point, pd, kc = conservative_events(crossing)
    turn = replace(turn, locus=Always(_locus("vv")))
    said = {"said": "orbits branch off that are not their own images under a reversal of time"}
    found = partial(examine_place, 1.0, said)
    pf = Event("PF", _turned_around, examine=found, locus=Always(_locus("uu")))
    kc = replace(kc, locus=partial(meeting, _bordered, _slope_of_bordered))
    born = Event("HB", partial(swing, FLAT), examine=_born, ends="branch")
    return lp, turn, branch_point, pf, replace(pd, locus=_at_minus_one), kc, born
