"""Half of a time-reversible orbit: from rest to rest.

Where x(t) is a motion of x' = f(x), so is R x(-t), with R what turns velocities around. An orbit
that is at rest as a whole twice a period is its own image: half of it, with

    v(0) = 0,  v(T/2) = 0,

is all of it. These are as many equations as there are states, and isolated in a family once its
frequency or its energy is given, without an unfolding and without a phase; without coupling, too,
where each site has a phase of its own. Small perturbations of the whole are those of the half,

    M = R M_half^-1 R M_half.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from ..continuation.algebra.newton import Array, Undefined
from ..continuation.algebra.sparse import Matrix
from ..flows.collocation import TrajectorySegment
from ..flows.conservation import Conservation, Unfolded, quantities_of
from ..flows.equations import FlowEquations
from ..flows.flow import Flow
from ..flows.functions import Params, slopes
from ..flows.multipliers import of_family
from ..flows.sparse_equations import SparseFlowEquations
from .oscillator_lattice import Oscillators

MANY_STATES = 100  # from which on what is eliminated costs more than what is sparse


def at_rest(t: Any, x: NDArray[Any], p: Params) -> NDArray[Any]:
    """The velocities, in the place of the positions: those that vanish where the half ends."""
    v = x[len(x) // 2 :]
    return np.concatenate([v, 0.0 * v])


def half_period(t: Any, x: Any, p: Params) -> Any:
    return math.pi / p["omega"]


@dataclass(frozen=True, eq=False)
class EnergyShell:
    """The condition that an orbit has a given energy."""

    chain: Oscillators

    def __call__(self, t: Any, x: Any, p: Params) -> Any:
        return self.chain.energy(x, p) - p["energy"]


@dataclass(frozen=True, eq=False)
class HalfOrbit(FlowEquations):
    """Half of an orbit of a lattice of oscillators, discretised: the flow ends with half of the
    period, or where its duration is an unknown, with its energy."""

    @classmethod
    def of(cls, chain: Oscillators, held: str, **more: Any) -> HalfOrbit:
        until, period = (None, half_period) if held == "omega" else (EnergyShell(chain), None)
        flow = Flow(chain, until=until, reset=at_rest)
        large = held == "omega" and 2 * chain.sites >= MANY_STATES
        kind = SparseHalfOrbit if large else cls
        return kind(flows=(flow,), period=period, turns=1, **more)

    @property
    def chain(self) -> Oscillators:
        return cast("Oscillators", self.flows[0].f)

    @property
    def held(self) -> str:
        """What is given of an orbit."""
        return "energy" if self.period is None else "omega"

    @property
    def standing(self) -> Array:
        return np.repeat(
            [0.0, 1.0], self.chain.sites
        )  # v_0 = 0 in rows of v, v_end = 0 in those of u

    def holding(self, name: str) -> HalfOrbit:
        """The equations where this is given."""
        more = {what: getattr(self, what) for what in ("start", "states", "sizes")}
        return HalfOrbit.of(self.chain, name, **more)

    def unknowns(
        self, flights: Sequence[TrajectorySegment], p: Params | None = None
    ) -> dict[str, Any]:
        start = super().unknowns(flights, p)
        return {"half" if name == "period" else name: value for name, value in start.items()}

    def gradients(self, states: Array, p: Params) -> Array:
        """Differentiate the energy at states (n, m): an array (m, n)."""
        n, chain = self.chain.sites, self.chain
        return np.concatenate([chain.gradient(states[:n], p), chain.masses[:, None] * states[n:]]).T

    def spectrum(self, x: Array, p: Params) -> tuple[NDArray[np.complex128], NDArray[np.float64]]:
        """Compute the multipliers that are not trivial, and the trivial ones."""
        (flight,), (way,), turned = self.flights(x, p), self.velocities(x, p), self.reversor
        ends = np.vstack([flight.states[1:], flight.end])
        field = np.asarray(self.chain(0.0, ends.T, p)).T
        # the way back begins where intervals end, turned around: f(R x) = -R f(x)
        ways = np.vstack([way, -turned * field[::-1]])
        gradients = self.gradients(flight.states.T, p), turned * self.gradients(ends.T, p)[::-1]
        return of_family(self.factors(x, p), ways, [np.vstack(gradients)])

    def factors(self, x: Array, p: Params) -> Array:
        """Map small perturbations over each interval, of the half and of the way back."""
        (piece,) = self.linearised(x, p).linear
        there = piece.slopes.ends[:, :, : self.start[0].dimension]
        back = self.reversor[:, None] * np.linalg.inv(there)[::-1] * self.reversor
        return np.concatenate([there, back])

    @property
    def reversor(self) -> Array:
        return np.repeat([1.0, -1.0], self.chain.sites)

    # --- where a multiplier is 1 or -1 ----------------------------------------------------------

    def closed_by(
        self, matrix: Matrix, x: Array, p: Params, names: tuple[str, ...], starts: str, ends: str
    ) -> NDArray[np.float64]:
        """Close the derivative, in unknowns and named parameters, for perturbations with other
        parts, "u" or "v", at rest at both ends: (v, v) are as the orbit, of a given energy;
        (u, u) are turned around, and have the multiplier 1, too; (v, u) and (u, v) have -1."""
        if isinstance(self, SparseFlowEquations):
            raise Undefined("of so many sites places are located, and not followed as curves")
        layout, n, sites = self.layout, self.start[0].dimension, self.chain.sites
        square = np.array(matrix.toarray() if hasattr(matrix, "toarray") else matrix)
        (piece,), first = self.linearised(x, p, names).linear, layout.nodes[0][0]
        of = {"u": slice(0, sites), "v": slice(sites, n)}
        columns = layout.columns(0, len(names))[-1]
        known = columns >= 0
        square[first] = 0.0
        rows, last = first[of[starts]], layout.lengths[0]
        square[rows, rows] = 1.0
        left = first[of["u" if starts == "v" else "v"]]
        square[np.ix_(left, columns[known])] -= piece.arrival[of[ends]][:, known]
        square[last] = 0.0
        if starts == ends == "v":
            energy = slopes(self._energy, 0.0, x[first][:, None], p, names)[1][0, :, 0]
            square[last, first], square[last, layout.size :] = energy[:n], energy[n + 1 :]
        elif starts == ends:  # along the orbit itself it is moved: across that alone
            square[last, first[sites:]] = self.chain(0.0, x[first], p)[sites:]
        else:
            square[last, last] = 1.0
        return square

    def border(self, x: Array, p: Params) -> tuple[Array, int, Array]:
        """Rows, the column and values that make (u, u) regular: what ends along the orbit."""
        first, end = self.layout.nodes[0][0], self.flights(x, p)[0].end
        sites = self.chain.sites
        return first[sites:], self.layout.lengths[0], self.chain(0.0, end, p)[sites:]

    def _energy(self, t: Any, x: Any, p: Params) -> Any:
        return self.chain.energy(x, p)


@dataclass(frozen=True, eq=False)
class SparseHalfOrbit(HalfOrbit, SparseFlowEquations):
    """Half of an orbit of many sites at a given frequency, of which nothing is eliminated."""

    @property
    def closing(self) -> tuple[Any, Any]:
        sites = np.arange(self.chain.sites)
        return sites, sites + sites.size  # `at_rest`


@dataclass(frozen=True, eq=False)
class WholeOrbit(FlowEquations):
    """An orbit of a lattice that need not be time-reversible, at a given frequency or energy: one
    of a family in which the energy is conserved."""

    @classmethod
    def of(cls, half: HalfOrbit, whole: tuple[TrajectorySegment, ...]) -> WholeOrbit:
        chain, energies = half.chain, quantities_of(half.chain.energy)
        (states,) = (flight.states.T for flight in whole)
        flow = Flow(Unfolded.near(chain, {"lambda": energies["energy"]}, states))
        held = "period" if half.held == "omega" else "energy"
        kept = Conservation(energies, held, np.empty((0, len(states))))
        kind = SparseWholeOrbit if isinstance(half, SparseHalfOrbit) else cls
        return kind((flow,), whole, None, 1, half.states, half.sizes, kept)

    @property
    def held(self) -> str:
        assert self.conservation is not None
        return "omega" if self.conservation.held == "period" else "energy"

    def holding(self, name: str) -> WholeOrbit:
        assert self.conservation is not None
        held = "period" if name == "omega" else name
        return replace(self, conservation=replace(self.conservation, held=held))

    def _given(self, kept: Conservation, x: Array, p: Params) -> Array:
        return super()._given(
            kept, x, {**p, "period": 2 * half_period(0.0, x, {"omega": 1.0, **p})}
        )

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


def unfolded_half(flight: TrajectorySegment, reversor: Array) -> TrajectorySegment:
    """Go on with the way back: the whole orbit of a half."""
    knots = np.concatenate([0.5 * flight.knots, 1 - 0.5 * flight.knots[-2::-1]])
    ends = np.vstack([flight.states[1:], flight.end])
    return replace(
        flight,
        knots=knots,
        duration=2 * flight.duration,
        states=np.vstack([flight.states, reversor * ends[::-1]]),
        slopes=np.concatenate([flight.slopes, -reversor * flight.slopes[::-1, ::-1]]),
    )
