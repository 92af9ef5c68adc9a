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
from functools import partial
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from ..continuation.algebra.newton import Array
from ..continuation.curve.point import Event, Examined, Point
from ..continuation.systems.branch_points import bordered_matrix
from ..continuation.systems.defining_systems import (
    Singular,
    signed_smallest,
)
from ..flows.collocation import TrajectorySegment
from ..flows.conservation import Conservation, Unfolded, quantities_of
from ..flows.conservative_events import conservative_events, examine_place, followed
from ..flows.cycle_events import BRANCH_POINT, FLAT, events_of_cycle, examine_swing, swing
from ..flows.equations import FlowEquations
from ..flows.flow import Flow
from ..flows.functions import Params
from ..flows.sparse_equations import SparseFlowEquations, sparse_where_large
from .oscillator_lattice import Oscillators


def resting(t: Any, x: NDArray[Any], p: Params) -> NDArray[Any]:
    """Reset that puts the velocities where all ends, which vanish there, in the rows of positions,
    and those where it begins in their own."""
    v = x[len(x) // 2 :]
    return np.concatenate([v, 0.0 * v])


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
        return np.repeat([0.0, 1.0], self.chain.sites)

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

    def holding(self, name: str) -> HalfOrbit:
        until = None if name == "omega" else partial(_energy_above, self.chain)
        flow = Flow(self.chain, until=until, reset=resting)
        return replace(self, flows=(flow,), period=None if until else half_period)


@dataclass(frozen=True, eq=False)
class SparseHalfOrbit(HalfOrbit, SparseFlowEquations):
    """Half of an orbit of many sites, of which nothing is eliminated."""

    @property
    def closing(self) -> tuple[Any, Any]:
        u, v = np.split(np.arange(2 * self.chain.sites), 2)
        return u, v


def whole_orbit(
    half: HalfOrbit, flights: tuple[TrajectorySegment, ...], p: Params
) -> FlowEquations:
    """Equations of a conservative orbit that need not be time-reversible, at a given frequency or
    energy."""
    energies, states = quantities_of(half.chain.energy), flights[0].states.T
    flow = Flow(Unfolded.near(half.chain, {"lambda": energies["energy"]}, states))
    kept = Conservation(energies, half.held, np.empty((0, len(states))), "omega")
    whole = FlowEquations((flow,), flights, None, 1, half.states, half.sizes, kept)
    return sparse_where_large(whole, p)


# --- events -------------------------------------------------------------------------------------


def _turned_around(point: Point) -> float:
    """Measure how near the map from v to u is to another null vector than the orbit's own."""
    orbit = point.base_point.solution
    (_, B), (start, end) = orbit.half_map[0], orbit.forces
    return signed_smallest(np.block([[B, end[:, None]], [start, np.zeros(1)]]))


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
    said = {"said": "orbits branch off that are not their own images under a reversal of time"}
    found = partial(examine_place, 1.0, said)
    pf = Event("PF", _turned_around, examine=found, locus=partial(followed, _turned_around))
    born = Event("HB", partial(swing, FLAT), examine=_born, ends="branch")
    return lp, turn, branch_point, pf, pd, kc, born
