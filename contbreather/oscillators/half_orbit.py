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
from functools import cached_property, partial, reduce
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from ..continuation.algebra.newton import Array
from ..continuation.algebra.sparse import Matrix
from ..flows.collocation import TrajectorySegment
from ..flows.conservation import Conservation, Unfolded, quantities_of
from ..flows.equations import FlowEquations
from ..flows.flow import Flow
from ..flows.functions import Params, slopes
from ..flows.sparse_equations import FEW, SparseFlowEquations
from .oscillator_lattice import Oscillators


def at_rest(rest: str, t: Any, x: NDArray[Any], p: Params) -> NDArray[Any]:
    """Put the part that vanishes where all ends in the rows of that which does not at its start."""
    u, v = np.split(x, 2)
    end = u if rest[1] == "u" else v
    return np.concatenate([end, 0.0 * end] if rest[0] == "v" else [0.0 * end, end])


def half_period(t: Any, x: Any, p: Params) -> Any:
    return math.pi / p.get("omega", 1.0)  # where it is none the energy is given


class HalfBlocks(NamedTuple):
    """The four blocks of the half, and the accelerations of the orbit at both of its ends, times
    the masses."""

    A: Array
    B: Array
    C: Array
    D: Array
    forces: tuple[Array, Array]

    @property
    def indices(self) -> Array:
        """``1 + 2 B^T C`` without the pair that is trivial: that of the orbit's own velocity, which
        ends as such, so that forces at the start are at right angles to all of ``B^T``."""
        across = np.linalg.qr(self.forces[0][:, None], mode="complete")[0][:, 1:]
        return np.eye(len(self.A) - 1) + 2 * across.T @ self.B.T @ (self.C @ across)

    @property
    def trivial(self) -> float:
        """By how much the orbit's own velocity grows, 1 but for what the mesh does not resolve."""
        start, end = self.forces
        return float(end @ (self.D @ start) / (end @ end))


@dataclass(frozen=True, eq=False)
class HalfOrbit(FlowEquations):
    """Half of an orbit of a lattice of oscillators, discretised, at a given frequency or energy."""

    held: str = "omega"  # what is given of it
    rest: str = "vv"  # which parts vanish at its beginning and its end; none where it is open

    @classmethod
    def of(cls, chain: Oscillators, **more: Any) -> HalfOrbit:
        kind = SparseHalfOrbit if 2 * chain.sites >= FEW else cls
        flow = Flow(chain, reset=partial(at_rest, "vv"))
        return kind(flows=(flow,), period=half_period, turns=1, **more)

    @property
    def chain(self) -> Oscillators:
        return cast("Oscillators", self.flows[0].f)

    @property
    def standing(self) -> Array:  # of the parts where it begins those that vanish
        return np.repeat([float(self.rest[:1] == part) for part in "uv"], self.chain.sites)

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
        if self.held == "omega":
            return matrix
        first, last = self.layout.nodes[0][0], self.layout.lengths[0]
        slope = slopes(self._energy, 0.0, x[first][:, None], p, names)[1][0, :, 0]
        slope[first.size + 1 :] -= [name == "energy" for name in names]
        columns = np.append(first, self.layout.size + np.arange(len(names)))
        edited: Any = matrix.copy() if isinstance(matrix, np.ndarray) else sparse.lil_array(matrix)
        edited[last] = 0.0
        edited[last, columns] = np.delete(slope, first.size)
        return edited if isinstance(matrix, np.ndarray) else edited.tocsc()

    def _energy(self, t: Any, x: Any, p: Params) -> Any:
        return self.chain.energy(x, p)

    def half_map(self, x: Array, p: Params) -> HalfBlocks:
        """Map small perturbations over the half."""
        (flight,), (piece,), chain = self.flights(x, p), self.linearised(x, p).linear, self.chain
        factors = piece.slopes.ends[:, :, : flight.dimension]
        m = np.append(np.ones(chain.sites), chain.masses)  # to momenta
        whole = m[:, None] * reduce(np.matmul, factors[::-1]) / m
        (A, B), (C, D) = (np.hsplit(rows, 2) for rows in np.vsplit(whole, 2))
        start, end = (
            chain.gradient(state[: chain.sites], p) for state in (x[: m.size], flight.end)
        )
        return HalfBlocks(A, B, C, D, (start, end))

    # --- where a multiplier is 1 or -1, and where two meet --------------------------------------

    @cached_property
    def closed(self) -> dict[str, HalfOrbit]:
        """The same for other perturbations, by the parts that vanish at both of their ends: "uu"
        and, at a given energy, "vv" have the multiplier 1, "uv" and "vu" -1; "" is open."""
        made = {}
        for rest in ("uu", "uv", "vu", "vv", ""):
            flow = Flow(self.chain, reset=partial(at_rest, rest) if rest else None)
            held = "energy" if rest == "vv" else "omega"
            made[rest] = replace(self, flows=(flow,), rest=rest, held=held)
        return made

    def closed_by(self, rest: str, x: Array, p: Params, names: tuple[str, ...]) -> Matrix:
        """Differentiate these in unknowns and named parameters."""
        matrix = self.closed[rest].derivatives(x, {**p, "energy": 0.0}, names)
        if rest != "uu":
            return matrix
        # the orbit's own velocity is one of them: across that alone
        first, last, n = self.layout.nodes[0][0], self.layout.lengths[0], self.chain.sites
        start, end = (
            self.chain(0.0, state, p)[n:] for state in (x[first], self.flights(x, p)[0].end)
        )
        rows = np.append(np.full(n, last), first[n:])
        columns = np.append(first[n:], np.full(n, last))
        border = sparse.csr_array((np.append(start, end), (rows, columns)), matrix.shape)
        return matrix + (border if sparse.issparse(matrix) else border.toarray())

    def pairs(self, index: float) -> tuple[Any, Any, Any]:
        """What is singular where a pair of multipliers has a stability index, ``L (1 x O) + E``
        with O the derivative of `open`: L, its derivative in the index, and E.

        Of two perturbations, one from rest and one without displacement, positions end opposite,
        ``A u + B w = 0``, and velocities with ``(1 + I) C u = (1 - I) D w``.
        """
        size, first = self.layout.size, self.layout.nodes[0][0]
        u, v = np.split(first, 2)
        kept, ends = _rows(size, np.delete(np.arange(size), first)), _rows(size, u)
        speeds, none = _rows(size, v), sparse.csr_array((size, size))
        rows = sparse.block_array(
            [[kept + ends, ends], [-(1 + index) * speeds, kept + (1 - index) * speeds]]
        )
        return (
            rows, sparse.block_array([[none, none], [-speeds, -speeds]]),
            sparse.block_diag([speeds, ends]),
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class SparseHalfOrbit(HalfOrbit, SparseFlowEquations):
    """Half of an orbit of many sites, of which nothing is eliminated."""

    @property
    def closing(self) -> tuple[Any, Any]:
        if not self.rest:
            return super().closing
        parts = dict(zip("uv", np.split(np.arange(2 * self.chain.sites), 2), strict=True))
        return parts["u" if self.rest[0] == "v" else "v"], parts[self.rest[1]]


def _rows(size: int, to: Array, of: Array | None = None) -> Any:
    """Select rows of a matrix, and put them elsewhere."""
    return sparse.csr_array((np.ones(len(to)), (to, to if of is None else of)), (size, size))


@dataclass(frozen=True, eq=False)
class WholeOrbit(FlowEquations):
    """An orbit of a lattice that need not be time-reversible, at a given frequency or energy: one
    of a family in which the energy is conserved."""

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
    """The same of many sites."""


def unfolded_half(flight: TrajectorySegment) -> TrajectorySegment:
    """Go on with the way back: the whole orbit of a half."""
    reversor = np.repeat([1.0, -1.0], flight.dimension // 2)
    knots = np.concatenate([0.5 * flight.knots, 1 - 0.5 * flight.knots[-2::-1]])
    ends = np.vstack([flight.states[1:], flight.end])
    return replace(
        flight,
        knots=knots,
        duration=2 * flight.duration,
        states=np.vstack([flight.states, reversor * ends[::-1]]),
        slopes=np.concatenate([flight.slopes, -reversor * flight.slopes[::-1, ::-1]]),
    )
