"""Half of a time-reversible orbit: from rest to rest.

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
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from ..continuation.algebra.newton import Array
from ..continuation.algebra.sparse import Matrix
from ..flows.collocation import TrajectorySegment
from ..flows.conservation import Conservation, Unfolded, quantities_of
from ..flows.equations import FlowEquations
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
        end = np.split(x, 2)["uv".index(self.parts[1])]
        return np.concatenate([end, 0.0 * end] if self.parts[0] == "v" else [0.0 * end, end])


def half_period(t: Any, x: Any, p: Params) -> Any:
    return math.pi / p.get("omega", 1.0)  # where it is none the energy is given


def _energy_above(chain: Oscillators, t: Any, x: Any, p: Params) -> Any:
    return chain.energy(x, p) - p.get("energy", 0.0)  # of perturbations it may be any


@dataclass(frozen=True, eq=False)
class HalfOrbit(FlowEquations):
    """Half of an orbit of a lattice of oscillators, discretised, at a given frequency or energy."""

    rest: str = "vv"  # which part vanishes at its start, and where it ends

    @property
    def chain(self) -> Oscillators:
        return cast("Oscillators", self.flows[0].f)

    @property
    def standing(self) -> Array:
        return np.repeat([float(part == self.rest[:1]) for part in "uv"], self.chain.sites)

    def unknowns(
        self, flights: Sequence[TrajectorySegment], p: Params | None = None
    ) -> dict[str, Any]:
        start = super().unknowns(flights, p)
        return {"held" if name == "period" else name: value for name, value in start.items()}

    @property
    def givens(self) -> tuple[str, ...]:
        return "omega", "energy"

    def longer(self, x: Array, p: Params) -> tuple[int, Array] | None:
        if self.held == "energy":
            return None
        change, u = np.zeros(self.layout.size), self.layout.nodes[0][0][: self.chain.sites]
        change[u] = self.chain.gradient(x[u], p)
        return int(self.layout.lengths[0]), change

    @property
    def held(self) -> str:
        return "omega" if self.period else "energy"

    def holding(self, name: str) -> HalfOrbit:
        return self._with(self.rest, name)

    @lru_cache(maxsize=64)  # noqa: B019 - as for a property
    def _with(self, rest: str, held: str) -> HalfOrbit:
        until = None if held == "omega" else partial(_energy_above, self.chain)
        flow = Flow(self.chain, until=until, reset=Resting(rest) if rest else None)
        return replace(self, flows=(flow,), period=None if until else half_period, rest=rest)

    # --- where a multiplier is 1 or -1, and where two meet --------------------------------------

    def closed_by(self, rest: str, x: Array, p: Params, names: tuple[str, ...]) -> Matrix:
        """Differentiate in unknowns and named parameters the equations of perturbations of which
        these parts vanish at both of their ends: "uu" and, at a given energy, "vv" have the
        multiplier 1, "uv" and "vu" -1. For "" none does, the first rows are ``-x(T/2)``."""
        closed = self._with(rest, "energy" if rest == "vv" else "omega")
        matrix: Any = closed.derivatives(x, p, names)
        if rest == "uu":  # the orbit's own velocity is one of them: across that alone
            first, n, ends = self.layout.nodes[0][0], self.chain.sites, self.flights(x, p)[0].end
            v, last = first[n:], np.full(n, self.layout.lengths[0])
            start, end = (self.chain(0.0, state, p)[n:] for state in (x[first], ends))
            speeds = _entries(matrix.shape, last, v, start), _entries(matrix.shape, v, last, end)
            matrix = matrix + speeds[0] + speeds[1]
        return matrix

    def pairs(self, index: float) -> tuple[Any, Any]:
        """Matrices L, affine in the index, and E of what is singular where a pair of multipliers
        has a stability index, ``L (1 x O) + E`` with O that of ``closed_by("")``.

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

    @property
    def closing(self) -> tuple[Any, Any]:
        if not self.rest:
            return super().closing
        both = np.arange(2 * self.chain.sites).reshape(2, -1)
        start, end = ("uv".index(part) for part in self.rest)
        return both[1 - start], both[end]


def _entries(shape: tuple[int, int], rows: Array, columns: Array, values: Any = 1.0) -> Any:
    cells: Any = np.broadcast_to(values, rows.shape), (rows, columns)
    return sparse.csc_array(cells, shape)


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
