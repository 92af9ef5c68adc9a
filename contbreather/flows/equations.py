"""The equations of a cycle of flows: what begins where the flow before it ended, and closes.

Unknowns are the states in which the intervals of all flows begin, how long each flow takes, and,
where every flow of a forced cycle ends by a condition of its own, the time at which the first
begins. There is one more equation for each flow: the condition that ends it; without one the
period, or the integral condition that fixes the phase of an autonomous orbit.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..continuation.newton import Array, Undefined
from ..continuation.sparse import Matrix
from ..errors import BadInput
from .collocation import Flight, derivatives, flown
from .flow import Flow, Params, slopes, values
from .multipliers import multipliers, without_direction

_DENSE = 150  # unknowns up to which a dense derivative is the faster one
_CLOSE = 0.1  # of its size: from a solution this near the next one is begun
_RECENT = 4  # solutions that are kept, to begin the next from the nearest


Places = NDArray[np.intp]


class Linear(NamedTuple):
    """A flow linearised.

    Columns of `ends` and `shares` are the state where the interval begins, the time at which it
    begins, its length and the parameters; those of `reset` and `condition` the state, the time and
    the parameters.
    """

    ends: Array  # (intervals, n, n + 2 + parameters)
    shares: Array  # (intervals, n + 2 + parameters): of the density of the mesh
    moved: Array  # (intervals,): minus the same in the logarithm of the path
    waited: Array  # (intervals,): and in the length relative to the duration
    reset: Array
    condition: Array | None


@dataclass(frozen=True, eq=False)
class Equations:
    """A cycle of flows, discretised.

    Parameters
    ----------
    flows : tuple of Flow
    start : tuple of Flight
        The orbit at which all began: its meshes, and the first guess of what is between.
    period : callable or None
        ``period(t, x, p)``, of which only `p` is used; None if the cycle is autonomous.
    turns : int
        Over how many of these periods it closes.
    states : tuple of str
        Names of the states, for those who look at orbits.
    sizes : tuple of ndarray
        The units in which meshes measure the motion of each flow, as from `sizes_of`.
    """

    flows: tuple[Flow, ...]
    start: tuple[Flight, ...]
    period: Callable[..., Any] | None
    turns: int
    states: tuple[str, ...]
    sizes: tuple[Array, ...]
    _recent: list[Any] = field(default_factory=list, init=False)
    _linear: list[Any] = field(default_factory=list, init=False)

    def __getstate__(self) -> dict[str, Any]:
        """Without what was solved lately."""
        return {**self.__dict__, "_recent": [], "_linear": []}

    # --- the unknowns -----------------------------------------------------------------------------

    @cached_property
    def phased(self) -> bool:
        """Whether the time at which the first flow begins is unknown."""
        return self.period is not None and all(flow.until for flow in self.flows)

    @property
    def autonomous(self) -> bool:
        return self.period is None

    @property
    def smooth(self) -> bool:
        """Whether one flow that no condition ends is all of it."""
        return len(self.flows) == 1 and self.flows[0].until is None

    @cached_property
    def nodes(self) -> tuple[Places, ...]:
        """Where the states of each flow lie among the unknowns, shape (intervals, n)."""
        shapes = [flight.states.T.shape for flight in self.start]
        return tuple(
            np.arange(end - k * n, end).reshape(k, n)
            for (k, n), end in zip(shapes, np.cumsum([k * n for k, n in shapes]), strict=True)
        )

    @cached_property
    def orbit(self) -> int:
        """How many unknowns are states."""
        return sum(node.size for node in self.nodes)

    @cached_property
    def knots(self) -> tuple[Places, ...]:
        """Where the mesh of each flow lies, its inner knots and the logarithm of its path, shape
        (intervals,)."""
        counts = [len(node) for node in self.nodes]
        ends = self.orbit + np.cumsum(counts)
        return tuple(np.arange(end - m, end) for m, end in zip(counts, ends, strict=True))

    @cached_property
    def lengths(self) -> Places:
        """Where the durations lie."""
        first = self.knots[-1][-1] + 1
        return np.arange(first, first + len(self.flows))

    @cached_property
    def size(self) -> int:
        return int(self.lengths[-1]) + 1 + self.phased

    def unknowns(self, flights: Sequence[Flight]) -> dict[str, Any]:
        """The unknowns by name, as a problem starts."""
        durations = np.array([flight.duration for flight in flights])
        found: dict[str, Any] = {
            "orbit": np.concatenate([f.states.T.ravel() for f in flights]),
            "mesh": np.concatenate(
                [
                    np.append(flight.knots[1:-1], math.log(flight.path(sizes)))
                    for flight, sizes in zip(flights, self.sizes, strict=True)
                ]
            ),
        }
        found |= {"durations": durations} if len(flights) > 1 else {"period": float(durations[0])}
        return found | ({"phase": flights[0].start} if self.phased else {})

    # --- the equations ----------------------------------------------------------------------------

    def flights(self, x: Array, p: Params) -> tuple[Flight, ...]:
        """All flows, from the states and times among the unknowns."""
        key = x.tobytes(), tuple(p.items())
        for known, _, found in self._recent:
            if known == key:
                return tuple(found)
        known = [*((z, found) for _, z, found in self._recent), (self._first, self.start)]
        z, near = min(known, key=lambda one: float(abs(one[0] - x).max()))
        close = abs(z - x).max() <= _CLOSE * abs(x).max()
        made: list[Flight] = []
        t = float(x[-1]) if self.phased else self.start[0].start
        for i, flow in enumerate(self.flows):
            plain = self._flight(i, x, t)
            made.append(flown(flow, plain, p, near[i].slopes if close else None))
            t += plain.duration
        self._recent[:] = [(key, x.copy(), made), *self._recent[: _RECENT - 1]]
        return tuple(made)

    @cached_property
    def _first(self) -> Array:
        return np.concatenate([np.ravel(one) for one in self.unknowns(self.start).values()])

    def _flight(self, i: int, x: Array, t: float) -> Flight:
        """A flow with its states and times, nothing inside yet."""
        knots = np.concatenate([[0.0], x[self.knots[i][:-1]], [1.0]])
        duration = float(x[self.lengths[i]])
        if not duration > 0:
            raise Undefined("a flow ends where it began: its duration goes to zero")
        if not (np.diff(knots) > 0).all():
            raise Undefined("intervals of the mesh overtake each other")
        return Flight(self.start[i].scheme, knots, t, duration, x[self.nodes[i]].T, np.empty(0))

    def __call__(self, x: Array, p: Params) -> Array:
        flights = self.flights(x, p)
        arrived = [self._after(i, flight, p) for i, flight in enumerate(flights)]
        rows = [
            (flight.states - np.column_stack([before, flight.ends[:, :-1]])).T.ravel()
            for flight, before in zip(flights, [arrived[-1], *arrived[:-1]], strict=True)
        ]
        rows += [
            flight.shares(self.sizes[i], math.exp(x[self.knots[i][-1]]))[0] - 1.0
            for i, flight in enumerate(flights)
        ]
        rows.append(np.array([self._condition(i, x, f, p) for i, f in enumerate(flights)]))
        if self.phased:
            rows.append(np.array([self._over(x, p)]))
        return np.concatenate(rows)

    def _after(self, i: int, flight: Flight, p: Params) -> Array:
        """The state in which the next flow begins."""
        reset = self.flows[i].reset
        if reset is None:
            return flight.end
        after = np.asarray(values(reset, flight.last, flight.end[:, None], p)[:, 0])
        wanted = self.nodes[(i + 1) % len(self.flows)].shape[1]
        if after.shape != (wanted,):
            raise BadInput(
                f"reset of flow {i} gives {after.size} states; the flow that follows has {wanted}"
            )
        return after

    def _condition(self, i: int, x: Array, flight: Flight, p: Params) -> float:
        until = self.flows[i].until
        if until is not None:
            return float(values(until, flight.last, flight.end[:, None], p)[0, 0])
        if self.autonomous:
            return float(self._phase[i] @ (x[self.nodes[i]] - self.start[i].states.T).ravel())
        return self._over(x, p)

    def _over(self, x: Array, p: Params) -> float:
        """By how much the durations exceed the period."""
        assert self.period is not None
        whole = float(values(self.period, 0.0, np.zeros((1, 1)), p)[0, 0])
        return float(x[self.lengths].sum() - self.turns * whole)

    @cached_property
    def _phase(self) -> tuple[Array, ...]:
        """The integral over the velocity of the first orbit, by the trapezoidal rule of its mesh:
        what keeps an orbit from sliding along itself."""
        rows = []
        for flight in self.start:
            steps = np.diff(flight.knots)
            weights = 0.5 * (steps + np.roll(steps, 1))
            row = (flight.rates(flight.knots[:-1]) * weights).T.ravel()
            rows.append(row / (np.linalg.norm(row) or 1.0))
        return tuple(rows)

    # --- derivatives ------------------------------------------------------------------------------

    def linear(self, x: Array, p: Params, names: tuple[str, ...] = ()) -> tuple[Linear, ...]:
        """All derivatives of flows, resets and conditions."""
        key = x.tobytes(), tuple(p.items())
        for known, those, found in self._linear:
            if known == key and (those == names or not names):
                return tuple(found)
        made = [
            self._linearised(i, flight, math.exp(x[self.knots[i][-1]]), p, names)
            for i, flight in enumerate(self.flights(x, p))
        ]
        self._linear[:] = [(key, names, made), *self._linear[: _RECENT - 1]]
        return tuple(made)

    def _linearised(
        self, i: int, flight: Flight, path: float, p: Params, names: tuple[str, ...]
    ) -> Linear:
        flow, n = self.flows[i], len(flight.states)
        own = derivatives(flow, flight, p, names)
        share, slope = flight.shares(self.sizes[i], path)
        shares = np.einsum("nkc,kcnd->kd", slope, own.inside)
        moved = (slope * flight.slopes).sum(axis=(0, 2))  # what is left of a share is of the time
        state, reset = flight.end[:, None], np.eye(n, n + 1 + len(names))
        if flow.reset is not None:
            reset = slopes(flow.reset, flight.last, state, p, names)[1][..., 0]
        condition = None
        if flow.until is not None:
            condition = slopes(flow.until, flight.last, state, p, names)[1][..., 0]
        return Linear(
            own.ends, shares, moved, (share - moved) / np.diff(flight.knots), reset, condition
        )

    def derivatives(self, x: Array, p: Params, names: tuple[str, ...]) -> Matrix:
        """The derivative of all equations in unknowns and named parameters; dense if small."""
        shape = self.size, self.size + len(names)
        entries = list(self._entries(x, p, names))
        if self.size <= _DENSE:
            matrix = np.zeros(shape)
            for rows, columns, value in entries:
                matrix[rows, columns] += value
            return matrix
        from scipy.sparse import coo_array

        spread = [np.broadcast_arrays(*entry) for entry in entries]
        rows, columns, data = (np.concatenate([e[k].ravel() for e in spread]) for k in range(3))
        return coo_array((data, (rows, columns)), shape=shape).tocsc()

    def _entries(self, x: Array, p: Params, names: tuple[str, ...]) -> Iterator[tuple[Any, ...]]:
        """Rows, columns and values of all blocks."""
        linear, flights = self.linear(x, p, names), self.flights(x, p)
        own = np.arange(self.orbit)
        yield own, own, 1.0
        for i, (node, one) in enumerate(zip(self.nodes, linear, strict=True)):
            n = node.shape[1]
            columns, chain = self._chain(i, flights[i], n, len(names))
            ends, shares = one.ends @ chain, (one.shares[:, None] @ chain)[:, 0]
            shares[:, n] -= one.waited
            shares[:, n + 1] += one.waited
            yield from _kept(node[1:][..., None], columns[:-1, None], -ends[:-1])
            last = _carried(one.reset, one.ends[-1], n) @ chain[-1]
            first = self.nodes[(i + 1) % len(self.flows)][0]
            yield from _kept(first[:, None], columns[-1:], -last)
            yield from _kept(self.knots[i][:, None], columns, shares)
            yield self.knots[i], self.knots[i][-1], -one.moved
            row = self.lengths[i]
            if one.condition is not None:
                value = _carried(one.condition, one.ends[-1], n) @ chain[-1]
                yield from _kept(row, columns[-1:], value)
            elif self.autonomous:
                yield row, node.ravel(), self._phase[i]
            else:
                yield from self._period_row(row, p, names)
        if self.phased:
            yield from self._period_row(self.size - 1, p, names)

    def _chain(self, i: int, flight: Flight, n: int, named: int) -> tuple[Places, Array]:
        """Of each interval the unknowns it depends on, and how its state, its beginning, its length
        and the parameters depend on them. -1 stands for a knot that is fixed."""
        count, steps = len(flight.knots) - 1, np.diff(flight.knots)
        begins = [*self.lengths[:i], *([self.size - 1] if self.phased else [])]
        own = [self.lengths[i], *begins, *range(self.size, self.size + named)]
        inner = np.concatenate([[-1], self.knots[i][:-1], [-1]])
        columns = np.hstack(
            [self.nodes[i], inner[:-1, None], inner[1:, None], np.tile(own, (count, 1))]
        )
        chain = np.zeros((count, n + 2 + named, columns.shape[1]))
        chain[:, np.arange(n), np.arange(n)] = 1.0
        chain[:, n, n], chain[:, n + 1, n] = flight.duration, -flight.duration
        chain[:, n + 1, n + 1] = flight.duration
        chain[:, n, n + 2], chain[:, n + 1, n + 2] = flight.knots[:-1], steps
        chain[:, n, n + 3 : n + 3 + len(begins)] = 1.0
        if named:
            chain[:, np.arange(n + 2, n + 2 + named), np.arange(-named, 0)] = 1.0
        return columns, chain

    def _period_row(self, row: int, p: Params, names: tuple[str, ...]) -> Iterator[tuple[Any, ...]]:
        assert self.period is not None
        yield row, self.lengths, 1.0
        if names:
            own = slopes(self.period, 0.0, np.zeros((1, 1)), p, names)[1][0, 2:, 0]
            yield row, self.size + np.arange(len(names)), -self.turns * own

    # --- small perturbations ----------------------------------------------------------------------

    def factors(self, x: Array, p: Params) -> tuple[list[Array], list[Array]]:
        """The derivatives of all pieces of the orbit in the state alone, with the saltation where
        a flow ends, and the velocities where they begin."""
        flights, linear = self.flights(x, p), self.linear(x, p)
        factors, velocities = [], []
        for i, (flow, flight, one) in enumerate(zip(self.flows, flights, linear, strict=True)):
            velocities += list(values(flow.f, flight.begins, flight.states, p).T)
            factors += list(one.ends[:, :, : len(flight.states)])
            factors[-1] = self._saltation(i, flights, one, p) @ factors[-1]
        return factors, velocities

    def _saltation(self, i: int, flights: Sequence[Flight], one: Linear, p: Params) -> Array:
        """What the end of a flow does to small perturbations: the reset, and how much longer the
        one flow lasts and the next one shorter."""
        flight, n = flights[i], len(flights[i].states)
        reset = one.reset[:, :n]
        if one.condition is None:
            return reset
        j = (i + 1) % len(self.flows)
        before = values(self.flows[i].f, flight.last, flight.end[:, None], p)[:, 0]
        after = values(self.flows[j].f, flights[j].start, flights[j].states[:, :1], p)[:, 0]
        gate, pace = one.condition[0, :n], one.condition[0, n]
        jump = after - reset @ before - one.reset[:, n]
        return np.asarray(reset + np.outer(jump, gate) / (gate @ before + pace))

    def multipliers(self, x: Array, p: Params) -> tuple[NDArray[np.complex128], float]:
        """Those that are not trivial, and the trivial one: NaN where there is none."""
        factors, velocities = self.factors(x, p)
        if not self.autonomous:
            return multipliers(factors), np.nan
        rest, trivial = without_direction(factors, velocities)
        return multipliers(rest), trivial

    def closing(self, matrix: Matrix, mu: complex) -> Matrix:
        """The square derivative whose null vectors are perturbations that have grown by mu after
        the cycle."""
        square = matrix[:, : self.size].astype(type(mu))
        sparse = not isinstance(square, np.ndarray)
        square = square.tolil() if sparse else square.copy()
        for row in self.nodes[0][0]:  # the first state is mu times as far off as where all ends
            square[row, row] += mu - 1
        if self.autonomous:  # perturbations need no phase; their period is that of the cycle
            for i, flow in enumerate(self.flows):
                if flow.until is None:
                    square[self.lengths[i]] = 0.0
                    square[self.lengths[i], self.lengths[i]] = 1.0
        if self.phased:
            square[-1, -1] = 1 - mu
        return square.tocsc() if sparse else square

    def paces(self, x: Array, p: Params) -> Array:
        """How fast each condition falls where it ends its flow; zero where it grazes."""
        found = []
        for flow, flight, one in zip(
            self.flows, self.flights(x, p), self.linear(x, p), strict=True
        ):
            if one.condition is not None:
                n = len(flight.states)
                f = values(flow.f, flight.last, flight.end[:, None], p)[:, 0]
                found.append(-float(one.condition[0, :n] @ f + one.condition[0, n]))
        return np.array(found)

    # --- other cycles -----------------------------------------------------------------------------

    def doubled(self, x: Array, p: Params) -> Equations:
        """Twice the same orbit, as one of twice the period."""
        flights = self.flights(x, p)
        if self.smooth and self.flows[0].reset is None:
            (own,) = flights
            knots = np.concatenate([0.5 * own.knots[:-1], 0.5 + 0.5 * own.knots])
            twice = Flight(
                own.scheme, knots, own.start, 2 * own.duration,
                np.hstack([own.states] * 2), np.hstack([own.slopes] * 2),
            )  # fmt: skip
            return Equations(
                self.flows, (twice,), self.period, 2 * self.turns, self.states, self.sizes
            )
        whole = sum(flight.duration for flight in flights)
        again = (replace(f, start=f.start + whole) for f in flights)
        return Equations(
            self.flows * 2, (*flights, *again), self.period, 2 * self.turns, self.states,
            self.sizes * 2,
        )  # fmt: skip


def _carried(outer: Array, inner: Array, n: int) -> Array:
    """A function of (state, time, parameters) where an interval ends, as one of (state, time,
    duration, parameters) where it begins: the time is the sum of both."""
    found = outer[:, :n] @ inner
    found[:, n] += outer[:, n]
    found[:, n + 1 :] += outer[:, n:]
    return np.asarray(found)


def sizes_of(flights: Sequence[Flight]) -> tuple[Array, ...]:
    """How much each state of each flow moves, or how large it is."""
    found = []
    for flight in flights:
        states = flight.sampled(2)[1]
        size = np.maximum(np.ptp(states, axis=1), 0.1 * abs(states).max(axis=1))
        found.append(np.maximum(size, 1e-3 * size.max()) if size.any() else size + 1.0)
    return tuple(found)


def _kept(rows: Any, columns: Any, value: Array) -> Iterator[tuple[Any, ...]]:
    """A block without the columns of knots that are fixed."""
    rows, columns, value = np.broadcast_arrays(rows, columns, value)
    kept = columns >= 0
    yield rows[kept], columns[kept], value[kept]
