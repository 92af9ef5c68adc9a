"""Half of a time-reversible orbit: from rest to rest; and the events of such orbits.

Where x(t) is a motion of x' = f(x), so is R x(-t), with R what turns velocities around. An orbit
that is at rest as a whole twice a period is its own image: half of it, with

    v(0) = 0,  v(T/2) = 0,

is all of it. These are as many equations as there are states, and isolated in a family once its
frequency or its energy is given, without an unfolding and without a phase; without coupling, too,
where each site has a phase of its own.

Small perturbations of the whole are those of the half, M = R M_half^-1 R M_half. In positions and
momenta the half is a symplectic matrix of four blocks, those of the whole have the stability
indices that are the eigenvalues of one of them,

    M_half = | A  B |,   M = | 1 + 2 B^T C    2 D^T B   |
             | C  D |        |   2 A^T C    1 + 2 C^T B |.

Events are those of pairs of multipliers, as of cycles where something is conserved: at +1 LP, where
the energy of the family turns (or at a given energy its parameter), BP, and PF, where orbits that
are not time-reversible branch off; at -1 PD; KC.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray
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
from ..flows.collocation import TrajectorySegment
from ..flows.conservation import Conservation, Unfolded, quantities_of
from ..flows.conservative_events import conservative_events, examine_place, meeting
from ..flows.cycle_events import BRANCH_POINT, FLAT, events_of_cycle, examine_swing, swing
from ..flows.equations import FlowEquations, Places
from ..flows.flow import Flow
from ..flows.functions import Params
from ..flows.sparse_equations import SparseFlowEquations, sparse_where_large
from .oscillator_lattice import Oscillators


@dataclass(frozen=True)
class Resting:
    """Reset that puts what vanishes where all ends in the rows of what does not at its start: of
    "vv" velocities vanish at both ends."""

    parts: str

    def __call__(self, t: Any, x: NDArray[Any], p: Params) -> NDArray[Any]:
        after, (to, of) = np.zeros_like(x), self.closing(len(x))
        after[to] = x[of]
        return after

    def closing(self, count: int) -> tuple[Places, Places]:
        """Into which entries of so many which ones go."""
        halves, (start, end) = np.arange(count).reshape(2, -1), map("uv".index, self.parts)
        return halves[1 - start], halves[end]


def half_period(t: Any, x: Any, p: Params) -> Any:
    return math.pi / p.get("omega", 1.0)  # where it is none the energy is given


def _energy_above(chain: Oscillators, t: Any, x: Any, p: Params) -> Any:
    return chain.energy(x, p) - p.get("energy", 0.0)  # of perturbations it may be any


@dataclass(frozen=True, eq=False)
class HalfOrbit(FlowEquations):
    """Half of an orbit of a lattice of oscillators, discretised, at a given frequency or energy."""

    @property
    def chain(self) -> Oscillators:
        return cast("Oscillators", self.flows[0].f)

    @property
    def standing(self) -> Array:
        parts = getattr(self.flows[0].reset, "parts", " ")  # which vanish where it begins and ends
        return np.repeat([float(part == parts[0]) for part in "uv"], self.chain.sites)

    length, givens = "held", ("omega", "energy")

    @property
    def held(self) -> str:
        return "omega" if self.period else "energy"

    def longer(self, x: Array, p: Params) -> tuple[int, Array] | None:
        if self.held == "energy":
            return None
        change, u = np.zeros(self.layout.size), self.layout.nodes[0][0][: self.chain.sites]
        change[u] = self.chain.gradient(x[u], p)
        return int(self.layout.lengths[0]), change

    @lru_cache(maxsize=64)  # noqa: B019 - as for a property
    def holding(self, name: str, rest: str = "vv") -> HalfOrbit:
        until = None if name == "omega" else partial(_energy_above, self.chain)
        flow = Flow(self.chain, until=until, reset=Resting(rest) if rest else None)
        return replace(self, flows=(flow,), period=None if until else half_period)

    def pairs(self, index: float) -> tuple[Any, Any]:
        """Matrices L, affine in the index, and E of what is singular where a pair of multipliers
        has a stability index, ``L (1 x O) + E`` with O that of ``_closed("")``.

        Of two perturbations, one from rest and one without displacement, positions end opposite,
        ``A u + B w = 0``, and velocities with ``(1 + I) C u = (1 - I) D w``.
        """
        shape, first = (self.layout.size,) * 2, self.layout.nodes[0][0]
        kept = np.delete(np.arange(self.layout.size), first)
        rest, ends, speeds = (_entries(shape, to, to) for to in (kept, *np.split(first, 2)))
        lower = [-(1 + index) * speeds, rest + (1 - index) * speeds]
        return sparse.block_array([[rest + ends, ends], lower]), sparse.block_diag([speeds, ends])


@dataclass(frozen=True, eq=False)
class SparseHalfOrbit(HalfOrbit, SparseFlowEquations):
    """Half of an orbit of many sites, of which nothing is eliminated."""


def _entries(shape: tuple[int, int], rows: Array, columns: Array, values: Any = 1.0) -> Any:
    cells: Any = np.broadcast_to(values, rows.shape), (rows, columns)
    return sparse.csc_array(cells, shape)


def whole_orbit(
    half: HalfOrbit, flights: tuple[TrajectorySegment, ...], p: Params
) -> FlowEquations:
    """Equations of a conservative orbit that need not be time-reversible, at a given frequency or
    energy."""
    energies, across = quantities_of(half.chain.energy), np.empty((0, flights[0].dimension))
    flow = Flow(Unfolded(half.chain, {"lambda": energies["energy"]}))
    kept = Conservation(energies, half.held, across, "omega")
    whole = FlowEquations((flow,), flights, None, 1, half.states, half.sizes, kept)
    return sparse_where_large(whole, p)


# --- events -------------------------------------------------------------------------------------


def _closed(rest: str, curve: Curve, z: Array) -> Matrix:
    """Differentiate in unknowns and free parameters the equations of perturbations of which these
    parts vanish at both of their ends: "uu" and, at a given energy, "vv" have the multiplier 1,
    "uv" and "vu" -1. For "" none does, the first rows are ``-x(T/2)``."""
    half, x, p = curve.problem.residual, z[: curve.size], curve.params(z)
    closed = half.holding("energy" if rest == "vv" else "omega", rest)
    matrix: Any = closed.derivatives(x, p, curve.free)
    if rest == "uu":  # the orbit's own velocity is one of them: across that alone
        first, n = half.layout.nodes[0][0], half.chain.sites
        v, last = first[n:], np.full(n, half.layout.lengths[0])
        begin, end = (half.chain(0.0, at, p)[n:] for at in (x[first], half.flights(x, p)[0].end))
        speeds = _entries(matrix.shape, last, v, begin), _entries(matrix.shape, v, last, end)
        matrix = matrix + speeds[0] + speeds[1]
    return matrix


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
    orbit = point.base_point.solution
    (_, B), (start, end) = orbit.half_map[0], orbit.forces
    return signed_smallest(np.block([[B, end[:, None]], [start, np.zeros(1)]]))


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
