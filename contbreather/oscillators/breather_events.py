"""Events of breathers. Of conservative ones those of pairs of multipliers, as of cycles where
something is conserved: at +1 LP, where the energy of the family turns (or at a given energy its
parameter), BP, and PF, where orbits that are not time-reversible branch off; at -1 PD; KC.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial, reduce

import numpy as np

from ..continuation.algebra.newton import Array
from ..continuation.bifurcations.equilibria import fold
from ..continuation.curve.curve import Curve
from ..continuation.curve.point import Always, DefiningSystem, Event, Point
from ..continuation.systems.defining_systems import rank_locus, signed_smallest
from ..flows.conservative_events import conservative_events, examine_place
from ..flows.cycle_events import BRANCH_POINT, events_of_cycle
from ..flows.equations import FlowEquations
from .breather_problem import Breather
from .half_orbit import HalfOrbit


def _of(curve: Curve) -> HalfOrbit:
    half: HalfOrbit = curve.problem.residual
    return half


def _matrix(starts: str, ends: str, curve: Curve, z: Array) -> Array:
    x, p = z[: curve.size], curve.params(z)
    return _of(curve).closed_by(curve.jacobian(z), x, p, curve.free, starts, ends)


def _closed(starts: str, ends: str, curve: Curve, z: Array) -> tuple[float, Array, Array]:
    """The least singular value of the equations closed for other perturbations, and its vectors."""

    def make(z: Array) -> tuple[float, Array, Array]:
        square = _matrix(starts, ends, curve, z)[:, : curve.size]
        if starts == ends == "u":  # the orbit's own velocity is one more null vector
            rows, column, values = _of(curve).border(z[: curve.size], curve.params(z))
            square[rows, column] = values
        left, sizes, right = np.linalg.svd(square)
        sign = np.linalg.det(left) * np.linalg.det(right)
        return float(sign * sizes[-1]), sign * left[:, -1], right[-1]

    weak: tuple[float, Array, Array] = curve.cached(f"closed by {starts} {ends}", z, make)
    return weak


def _locus(starts: str, ends: str) -> DefiningSystem:
    """Where these equations lose rank."""
    matrix = partial(_matrix, starts, ends)
    return rank_locus(partial(_closed, starts, ends), matrix)


def _turned_around(point: Point) -> float:
    """Measure how near perturbations that are at rest in their positions at both ends are to a
    solution, but for the orbit's own: 0 where the map from v to u has another null vector."""
    orbit: Breather = point.base_point.solution
    half = _of(point.base_point.curve)
    factors = half.factors(orbit.x, orbit.params)
    n, sites = factors.shape[0] // 2, half.chain.sites
    block = reduce(np.matmul, factors[:n][::-1])[:sites, sites:]
    (flight, *_) = orbit.flights
    starts, ends = (half.chain(0.0, flight.states[i], orbit.params)[sites:] for i in (0, n))
    bordered = np.block([[block, ends[:, None]], [starts, np.zeros(1)]])
    return signed_smallest(bordered)


def _energy_over_period(point: Point) -> float:
    """Differentiate the energy in the period along the family at given parameters."""
    base = point.base_point
    half, layout = _of(base.curve), _of(base.curve).layout
    if half.held == "energy":
        return math.nan
    longer = np.zeros(layout.size)
    longer[layout.lengths[0]] = 1.0
    matrix = base.curve.in_unknowns(base.z)
    if hasattr(matrix, "toarray"):
        from scipy.sparse.linalg import splu

        change = splu(matrix.tocsc()).solve(longer)
    else:
        change = np.linalg.solve(matrix, longer)
    first = layout.nodes[0][0]
    return float(half.gradients(base.x[first][:, None], base.params)[0] @ change[first])


def _at_minus_one(point: Point) -> DefiningSystem:
    """The perturbations that change their sign are at rest where it begins, or where its half
    ends: those that do here."""
    base = point.base_point
    pairs = (("v", "u"), ("u", "v"))
    starts, ends = min(
        pairs, key=lambda pair: abs(_closed(pair[0], pair[1], base.curve, base.z)[0])
    )
    return _locus(starts, ends)


def events_of_breather(equations: FlowEquations) -> tuple[Event, ...]:
    """List the events of a breather of these equations."""
    if not isinstance(equations, HalfOrbit):
        return events_of_cycle(equations)
    _, turn, branch_point, pd, kc = conservative_events(BRANCH_POINT)
    turn = replace(turn, test=_energy_over_period, locus=Always(_locus("v", "v")))
    pf = Event(
        "PF", _turned_around, examine=partial(examine_place, 1.0, _UNLIKE),
        locus=Always(_locus("u", "u")),
    )  # fmt: skip
    return fold(), turn, branch_point, pf, replace(pd, locus=_at_minus_one), replace(kc, locus=None)


_UNLIKE = {"said": "orbits branch off that are not their own images under a reversal of time"}
