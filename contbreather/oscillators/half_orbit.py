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
from functools import cached_property
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from ..continuation.algebra.newton import Array
from ..continuation.algebra.sparse import Matrix, canonical, is_sparse
from ..flows.collocation import TrajectorySegment
from ..flows.conservation import Conservation, Unfolded, quantities_of
from ..flows.equations import FlowEquations
from ..flows.flow import Flow
from ..flows.functions import Params, slopes
from ..flows.sparse_equations import SparseFlowEquations
from .oscillator_lattice import Oscillators


def at_rest(t: Any, x: NDArray[Any], p: Params) -> NDArray[Any]:
    """Put the velocities, which vanish where all ends, in the rows of positions at its start."""
    v = x[len(x) // 2 :]
    return np.concatenate([v, 0.0 * v])


def half_period(t: Any, x: Any, p: Params) -> Any:
    return math.pi / p.get("omega", 1.0)  # where it is none the energy is given


@dataclass(frozen=True, eq=False)
class HalfOrbit(FlowEquations):
    """Half of an orbit of a lattice of oscillators, discretised, at a given frequency or energy."""

    held: str = "omega"  # what is given of it

    @property
    def chain(self) -> Oscillators:
        return cast("Oscillators", self.flows[0].f)

    @property
    def standing(self) -> Array:  # where it begins velocities vanish
        return np.repeat([0.0, 1.0], self.chain.sites)

    def unknowns(
        self, flights: Sequence[TrajectorySegment], p: Params | None = None
    ) -> dict[str, Any]:
        start = super().unknowns(flights, p)
        return {"half" if name == "period" else name: value for name, value in start.items()}

    def holding(self, name: str) -> HalfOrbit:
        return replace(self, held=name)

    def _condition(self, i: int, x: Array, flight: TrajectorySegment, p: Params) -> float:
        if self.held == "omega":
            return super()._condition(i, x, flight, p)
        return float(self._energy(0.0, flight.states[0], p) - p["energy"])

    def derivatives(self, x: Array, p: Params, names: tuple[str, ...] = ()) -> Matrix:
        matrix = super().derivatives(x, p, names)
        return matrix if self.held == "omega" else self._at_energy(matrix, x, p, names)

    def _at_energy(self, matrix: Any, x: Array, p: Params, names: tuple[str, ...]) -> Matrix:
        """Put the equation of the energy in the place of that of the period."""
        shape, first, last = matrix.shape, self.layout.nodes[0][0], self.layout.lengths[0]
        slope = slopes(self._energy, 0.0, x[first][:, None], p, names)[1][0, :, 0]
        slope[first.size + 1 :] -= [name == "energy" for name in names]
        columns = np.append(first, self.layout.size + np.arange(len(names)))
        row = _entries(shape, np.full(columns.shape, last), columns, np.delete(slope, first.size))
        kept = np.delete(np.arange(shape[0]), last)
        return _with_rows(matrix, kept, kept, row)

    def _energy(self, t: Any, x: Any, p: Params) -> Any:
        return self.chain.energy(x, p)

    # --- where a multiplier is 1 or -1, and where two meet --------------------------------------

    @cached_property
    def open(self) -> FlowEquations:
        """The same of which nothing vanishes: its first rows are ``x(0) - x(T/2)``."""
        kind = SparseFlowEquations if isinstance(self, SparseHalfOrbit) else FlowEquations
        return kind((Flow(self.chain),), self.start, half_period, 1, self.states, self.sizes)

    def closed_by(self, rest: str, x: Array, p: Params, names: tuple[str, ...]) -> Matrix:
        """Differentiate in unknowns and named parameters the equations of perturbations of which
        these parts vanish at both of their ends: "uu" and, at a given energy, "vv" have the
        multiplier 1, "uv" and "vu" -1. For "" none does, the first rows are ``-x(T/2)``."""
        matrix: Any = self.open.derivatives(x, p, names)
        shape, first, n = matrix.shape, self.layout.nodes[0][0], self.chain.sites
        matrix = matrix - _entries(shape, first, first)
        if not rest:
            return matrix
        u, v = np.split(first, 2)
        start, end = ({"u": u, "v": v}[part] for part in rest)
        kept, own = np.delete(np.arange(shape[0]), first), _entries(shape, start, start)
        if rest == "uu":  # the orbit's own velocity is one of them: across that alone
            ends = x[first], self.flights(x, p)[0].end
            speeds = [self.chain(0.0, state, p)[n:] for state in ends]
            last = np.full(n, self.layout.lengths[0])
            own = own + _entries(shape, last, v, speeds[0]) + _entries(shape, v, last, speeds[1])
        to = np.append(kept, np.setdiff1d(first, start))
        matrix = _with_rows(matrix, to, np.append(kept, end), own)
        return self._at_energy(matrix, x, p, names) if rest == "vv" else matrix

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
        u, v = np.split(np.arange(2 * self.chain.sites), 2)
        return u, v


def _entries(shape: tuple[int, int], rows: Array, columns: Array, values: Any = 1.0) -> Any:
    cells: Any = np.broadcast_to(values, rows.shape), (rows, columns)
    return sparse.csc_array(cells, shape)


def _with_rows(matrix: Any, to: Array, of: Array, own: Any) -> Matrix:
    """Put rows of a matrix elsewhere, and add entries."""
    edited = _entries((own.shape[0],) * 2, to, of) @ matrix + own
    return canonical(edited) if is_sparse(edited) else edited


@dataclass(frozen=True, eq=False)
class WholeOrbit(FlowEquations):
    """A conservative orbit that need not be time-reversible, at a given frequency or energy."""

    @classmethod
    def of(cls, half: HalfOrbit, whole: tuple[TrajectorySegment, ...]) -> WholeOrbit:
        chain, energies = half.chain, quantities_of(half.chain.energy)
        (states,) = (flight.states.T for flight in whole)
        flow = Flow(Unfolded.near(chain, {"lambda": energies["energy"]}, states))
        kept = Conservation(energies, "energy", np.empty((0, len(states))))
        kind = SparseWholeOrbit if isinstance(half, SparseFlowEquations) else cls
        equations = kind((flow,), whole, None, 1, half.states, half.sizes, kept)
        return equations.holding(half.held)

    @property
    def held(self) -> str:
        assert self.conservation is not None
        return "omega" if self.conservation.held == "period" else "energy"

    def holding(self, name: str) -> WholeOrbit:
        assert self.conservation is not None
        held = "period" if name == "omega" else name
        return replace(self, conservation=replace(self.conservation, held=held))

    def _given(self, kept: Conservation, x: Array, p: Params) -> Array:
        return super()._given(kept, x, {**p, "period": 2 * half_period(0.0, x, p)})

    def _given_slopes(
        self, kept: Conservation, x: Array, p: Params, names: tuple[str, ...]
    ) -> Array:
        rows = super()._given_slopes(kept, x, p, names)
        if kept.held == "period" and "omega" in names:  # T - 2 pi / omega
            column = names.index("omega") - len(names)
            rows[len(kept.quantities), column] = 2 * math.pi / p["omega"] ** 2
        return rows


@dataclass(frozen=True, eq=False)
class SparseWholeOrbit(WholeOrbit, SparseFlowEquations):
    """A whole orbit of many sites."""
