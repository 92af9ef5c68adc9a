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
from .collocation import Flight, Slopes, derivatives, flown
from .flow import Flow, Params, slopes, values
from .multipliers import multipliers, without_direction

_DENSE = 400  # unknowns up to which a dense derivative is the faster one
_CLOSE = 0.1  # of its size: from a solution this near the next one is begun
_NO_PACE = 1e-13  # of a condition, relative to how fast it may be along its flow: it is rounding
_AT_REST = 1e-6  # a flow that moves less, relative to the others, is measured by them
_ROUNDS = 24  # an orbit is looked at for going around up to so many times
_REPEATS = 1e-3  # of its size: as near as this to itself a round later it is the same again
_LOOKS = 4  # into each interval for that
_RECENT = 4  # solutions that are kept, and derivatives, to begin the next from the nearest


Places = NDArray[np.intp]


class Linear(NamedTuple):
    """A flow linearised.

    Columns of `ends` and `shares` are the state where the interval begins, the time at which it
    begins, its length and the parameters; those of `reset` and `condition` the state, the time and
    the parameters.
    """

    ends: Array  # (intervals, n, n + 2 + parameters)
    shares: Array  # (intervals, n + 2 + parameters): of the density of the mesh
    longer: Array  # (intervals,): minus the same in the logarithm of the path
    waited: Array  # (intervals,): and in the length relative to the duration
    reset: Array
    condition: Array | None


class _Pattern(NamedTuple):
    """Where values belong among the entries of a matrix, `cells` for those that belong nowhere; of
    a sparse one the row of each, and where columns end."""

    places: Places
    cells: int
    rows: Places
    ends: Places


@dataclass(eq=False)
class _Place:
    """A place that was solved for, and where they were asked for the derivatives in unknowns and
    named parameters: from there flights near by begin to be solved for."""

    x: Array
    params: Params
    flights: tuple[Flight, ...]
    names: tuple[str, ...] = ()
    slopes: tuple[Slopes, ...] = ()
    linear: tuple[Linear, ...] = ()


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
    _recent: dict[Any, _Place] = field(default_factory=dict, init=False)
    _linear: list[_Place] = field(default_factory=list, init=False)
    _patterns: dict[int, _Pattern] = field(default_factory=dict, init=False)

    def __getstate__(self) -> dict[str, Any]:
        """Without what was solved lately."""
        return {**self.__dict__, "_recent": {}, "_linear": [], "_patterns": {}}

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
        start: dict[str, Any] = {
            "orbit": np.concatenate([f.states.T.ravel() for f in flights]),
            "mesh": np.concatenate(
                [
                    np.append(flight.knots[1:-1], math.log(flight.path(sizes)))
                    for flight, sizes in zip(flights, self.sizes, strict=True)
                ]
            ),
        }
        start |= {"durations": durations} if len(flights) > 1 else {"period": float(durations[0])}
        return start | ({"phase": flights[0].start} if self.phased else {})

    # --- the equations ----------------------------------------------------------------------------

    def flights(self, x: Array, p: Params) -> tuple[Flight, ...]:
        """All flows, from the states and times among the unknowns."""
        return self._solved(x, p).flights

    def _solved(self, x: Array, p: Params) -> _Place:
        """All flows solved for, once for one of the latest places."""
        key = x.tobytes(), tuple(p.items())
        place = self._recent.get(key)
        if place is None:
            near, flights = self._nearest(x), []
            t = float(x[-1]) if self.phased else self.start[0].start
            for i, flow in enumerate(self.flows):
                plain = self._flight(i, x, t)
                guess = near and self._guess(i, plain, p, *near)
                flights.append(flown(flow, plain, p, float(self.sizes[i].max()), guess))
                t += plain.duration
            if len(self._recent) >= _RECENT:
                del self._recent[next(iter(self._recent))]
            place = self._recent[key] = _Place(x.copy(), dict(p), tuple(flights))
        return place

    def _nearest(self, x: Array) -> tuple[_Place, _Place | None] | None:
        """The nearest place that is solved for, if it is near, and of those whose derivatives are
        known."""
        places = [*self._linear, *self._recent.values(), self._begin]
        off, close = (
            abs(np.array([place.x for place in places]) - x).max(axis=1),
            _CLOSE * abs(x).max(),
        )
        near = [places[j] for j in off.argsort().tolist() if off[j] <= close]
        return (near[0], next((place for place in near if place.slopes), None)) if near else None

    def _guess(
        self, i: int, flight: Flight, p: Params, near: _Place, known: _Place | None
    ) -> tuple[Array, Array | None]:
        """What the slopes inside of a flow are to first order, and the inverse that finds them."""
        if known is None or not near.params:
            return near.flights[i].slopes, None
        moved = [p[name] - near.params[name] for name in known.names]
        return known.slopes[i].beside(near.flights[i], flight, moved), known.slopes[i].inverse

    @cached_property
    def _begin(self) -> _Place:
        x = [np.ravel(value) for value in self.unknowns(self.start).values()]
        return _Place(np.concatenate(x), {}, self.start)

    def _flight(self, i: int, x: Array, t: float) -> Flight:
        """A flow with its states and times, nothing inside yet."""
        knots = np.concatenate([[0.0], x[self.knots[i][:-1]], [1.0]])
        duration = float(x[self.lengths[i]])
        if not duration > 0:
            raise Undefined("a flow ends where it began: its duration goes to zero")
        states = x[self.nodes[i]].T
        flight = Flight(self.start[i].scheme, knots, t, duration, states, np.empty(0))
        if not flight.steps.min() > 0:
            raise Undefined("intervals of the mesh overtake each other")
        return flight

    def __call__(self, x: Array, p: Params) -> Array:
        flights = self.flights(x, p)
        arrived = [self._after(i, flight, p) for i, flight in enumerate(flights)]
        rows = []
        for flight, before in zip(flights, [arrived[-1], *arrived[:-1]], strict=True):
            # x_0 less where the flow before arrives, x_j less where interval j - 1 ends
            gaps = flight.states.T.copy()
            gaps[0] -= before
            gaps[1:] -= flight.ends.T[:-1]
            rows.append(gaps.ravel())
        rows += [
            # m equal shares for the m - 1 inner knots and the unit of the path
            flight.shares(self.sizes[i], math.exp(x[self.knots[i][-1]])) - 1.0
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
            # integral of (x - x_start) . x_start' over the orbit
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

    def linear(
        self, x: Array, p: Params, names: tuple[str, ...] | None = None
    ) -> tuple[Linear, ...]:
        """All derivatives of flows, resets and conditions; None for any parameters, those of the
        last columns, that are known already."""
        return self._known(x, p, names).linear

    def _known(self, x: Array, p: Params, names: tuple[str, ...] | None) -> _Place:
        place = self._solved(x, p)
        if not place.linear or names not in (None, place.names):
            place.names, flights = names or (), place.flights
            place.slopes = tuple(
                derivatives(flow, flight, p, place.names)
                for flow, flight in zip(self.flows, flights, strict=True)
            )
            place.linear = tuple(
                self._linearised(i, flight, slopes, math.exp(x[self.knots[i][-1]]), p, place.names)
                for i, (flight, slopes) in enumerate(zip(flights, place.slopes, strict=True))
            )
            self._linear[:] = [place, *self._linear[: _RECENT - 1]]
        return place

    def _linearised(
        self,
        i: int,
        flight: Flight,
        derivative: Slopes,
        path: float,
        p: Params,
        names: tuple[str, ...],
    ) -> Linear:
        flow, n = self.flows[i], len(flight.states)
        share = flight.shares(self.sizes[i], path)
        slope, longer = flight.share_slopes(self.sizes[i], path)
        share_of = slope.transpose(1, 2, 0).reshape(len(share), 1, -1)
        shares = (share_of @ derivative.inside)[:, 0]
        # of degree 1 in slopes and steps together: share = share_k . k + share_h h (Euler)
        timed = share - (slope * flight.slopes).sum(axis=(0, 2))  # what is left is of the time
        state, reset = flight.end[:, None], np.eye(n, n + 1 + len(names))
        if flow.reset is not None:
            reset = slopes(flow.reset, flight.last, state, p, names)[1][..., 0]
        condition = None
        if flow.until is not None:
            condition = slopes(flow.until, flight.last, state, p, names)[1][..., 0]
        return Linear(derivative.ends, shares, longer, timed / flight.steps, reset, condition)

    def derivatives(self, x: Array, p: Params, names: tuple[str, ...]) -> Matrix:
        """The derivative of all equations in unknowns and named parameters; dense if small."""
        shape = self.size, self.size + len(names)
        values = np.concatenate([np.ravel(block) for block in self._blocks(x, p, names)])
        pattern = self._pattern(len(names))
        # several entries may meet in one place; what is of fixed knots lands beyond the last
        data = np.bincount(pattern.places, values, pattern.cells + 1)[:-1]
        if self.size <= _DENSE:
            return data.reshape(shape)
        from scipy.sparse import csc_array

        return csc_array((data, pattern.rows, pattern.ends), shape=shape)

    def _blocks(self, x: Array, p: Params, names: tuple[str, ...]) -> Iterator[Any]:
        """The values of all blocks, where `_places` says."""
        linear, flights = self.linear(x, p, names), self.flights(x, p)
        yield np.ones(self.orbit)  # each state in its own row
        for i, piece in enumerate(linear):
            flight, n = flights[i], len(flights[i].states)
            rows = np.concatenate([piece.ends, piece.shares[:, None]], axis=1)
            ends, shares = np.split(self._spread(i, flight, rows), [n], axis=1)
            # the step of an interval is the difference of the knots at its ends
            shares[:, 0, n] -= piece.waited
            shares[:, 0, n + 1] += piece.waited
            yield -ends[:-1]
            kept = self.flows[i].reset is None
            yield -(ends[-1] if kept else self._carried(i, flight, piece.reset, piece.ends[-1]))
            yield shares
            yield -piece.longer
            if piece.condition is not None:
                yield self._carried(i, flight, piece.condition, piece.ends[-1])
            else:
                yield self._phase[i] if self.autonomous else self._of_period(p, names)
        if self.phased:
            yield self._of_period(p, names)

    def _places(self, named: int) -> Iterator[tuple[Any, Any]]:
        """Rows and columns of all blocks. The column of a knot that is fixed is -1."""
        diagonal, width = np.arange(self.orbit), self.size + named
        whole = np.append(self.lengths, np.arange(self.size, width))
        yield diagonal, diagonal
        for i, node in enumerate(self.nodes):
            columns = self._columns(i, named)
            yield node[1:, :, None], columns[:-1, None]
            yield self.nodes[(i + 1) % len(self.flows)][0][:, None], columns[-1:]
            yield self.knots[i][:, None], columns
            yield self.knots[i], self.knots[i][-1]
            if self.flows[i].until is not None:
                yield self.lengths[i], columns[-1]
            else:
                yield self.lengths[i], node.ravel() if self.autonomous else whole
        if self.phased:
            yield self.size - 1, whole

    def _columns(self, i: int, named: int) -> Places:
        """What each interval depends on, in the order of `_spread`."""
        before = [*self.lengths[:i], *([self.size - 1] if self.phased else [])]
        shared = [self.lengths[i], *before, *range(self.size, self.size + named)]
        inner = np.concatenate([[-1], self.knots[i][:-1], [-1]])
        return np.hstack(
            [
                self.nodes[i], inner[:-1, None], inner[1:, None],
                np.tile(shared, (len(inner) - 1, 1)),
            ]
        )  # fmt: skip

    def _pattern(self, named: int) -> _Pattern:
        """Where the values of all blocks belong: found once."""
        if named not in self._patterns:
            width = self.size + named
            spread = [np.broadcast_arrays(*place) for place in self._places(named)]
            rows, columns = (np.concatenate([at[k].ravel() for at in spread]) for k in range(2))
            if self.size <= _DENSE:
                count, ends = self.size * width, np.empty(0, int)
                places = np.where(columns < 0, count, rows * width + columns)
            else:  # by columns, each entry once; those of fixed knots beyond the last
                cells = np.where(columns < 0, self.size * width, columns * self.size + rows)
                filled, places = np.unique(cells, return_inverse=True)
                count = int(np.searchsorted(filled, self.size * width))
                rows = filled[:count] % self.size
                ends = np.searchsorted(filled[:count], self.size * np.arange(width + 1))
            self._patterns[named] = _Pattern(places, count, rows, ends)
        return self._patterns[named]

    def _spread(self, i: int, flight: Flight, slope: Array) -> Array:
        """The derivative of something of each interval in its state, its beginning, its length and
        the parameters as one in the unknowns: the state, the knots at both ends, the duration,
        what the beginning of the flow is the sum of, and the parameters."""
        n, knots = len(flight.states), flight.knots
        start, steps = (
            at.reshape(-1, *[1] * (slope.ndim - 1)) for at in (knots[:-1], flight.steps)
        )
        begins, lasts = slope[..., n : n + 1], slope[..., n + 1 : n + 2]
        return np.concatenate(
            [
                slope[..., :n],
                # t_j = t_0 + T s_j and h_j = T (s_(j+1) - s_j)
                flight.duration * (begins - lasts),
                flight.duration * lasts,
                start * begins + steps * lasts,
                *[begins] * (i + self.phased),
                slope[..., n + 2 :],
            ],
            axis=-1,
        )

    def _carried(self, i: int, flight: Flight, outer: Array, inner: Array) -> Array:
        """A function of (state, time, parameters) where a flow ends, as one of the unknowns of its
        last interval: the time is the sum of its beginning and its length."""
        n = len(flight.states)
        total = outer[..., :n] @ inner
        total[..., n] += outer[..., n]
        total[..., n + 1 :] += outer[..., n:]
        last = replace(flight, knots=flight.knots[-2:])
        return self._spread(i, last, total[None])[0]

    def place(self, i: int, s: float, x: Array, p: Params) -> tuple[float, Array]:
        """Time and state of a flow at a part of its duration."""
        flight = self.flights(x, p)[i]
        return flight.start + s * flight.duration, flight.at(np.array([s]))[:, 0]

    def place_slopes(self, i: int, s: float, x: Array, p: Params, names: tuple[str, ...]) -> Array:
        """The derivative of that state, and of the time below, in all unknowns, named parameters
        and the part of the duration."""
        flight, slopes = self.flights(x, p)[i], self._known(x, p, names).slopes[i]
        (j,), (u,) = flight.places(np.array([s]))
        n = len(flight.states)
        local = np.eye(n + 1, n + 2 + len(names))  # the time is that at which the interval begins
        local[n, n + 1] = u  # and a part of its length
        inside = slopes.inside[j].reshape(flight.scheme.points, n, -1)
        local[:n] += np.tensordot(flight.scheme.spread(np.array([u]))[0], inside, 1)
        interval = replace(flight, knots=flight.knots[j : j + 2])
        rise = np.append(flight.rates(np.array([s]))[:, 0], flight.duration)
        spread = self._spread(i, interval, local[None])[0]
        spread[:, n] -= (1 - u) * rise  # where in the interval, if the knot before it moves
        spread[:, n + 1] -= u * rise
        columns = self._columns(i, len(names))[j]
        derivative = np.zeros((n + 1, self.size + len(names) + 1))
        derivative[:, columns[columns >= 0]] = spread[:, columns >= 0]
        derivative[:, -1] = rise
        return derivative

    def _of_period(self, p: Params, names: tuple[str, ...]) -> Array:
        assert self.period is not None
        slope = slopes(self.period, 0.0, np.zeros((1, 1)), p, names)[1][0, 2:, 0]
        # of the sum of durations - turns T(p)
        return np.append(np.ones(self.lengths.size), -self.turns * slope)

    # --- small perturbations ----------------------------------------------------------------------

    def factors(self, x: Array, p: Params) -> tuple[list[Array], list[Array]]:
        """The derivatives of all pieces of the orbit in the state alone, with the saltation where
        a flow ends, and the velocities where they begin: stacks of those of one shape."""
        flights, linear = self.flights(x, p), self.linear(x, p)
        factors: list[Array] = []
        velocities: list[Array] = []
        for i, (flow, flight, piece) in enumerate(zip(self.flows, flights, linear, strict=True)):
            earlier, last = np.split(piece.ends[:, :, : len(flight.states)], [-1])
            ways = values(flow.f, flight.begins, flight.states, p).T
            last = self._saltation(i, flights, piece, abs(ways).max(axis=0), p) @ last
            alike = last.shape[1] == last.shape[2]
            factors += [np.concatenate([earlier, last])] if alike else [earlier, last]
            velocities += [ways] if alike else np.split(ways, [-1])
        return factors, velocities

    def _saltation(
        self, i: int, flights: Sequence[Flight], piece: Linear, fastest: Array, p: Params
    ) -> Array:
        """What the end of a flow does to small perturbations: the reset, and how much longer the
        one flow lasts and the next one shorter; NaN at VI, of a flow that was as fast as this."""
        flight, n = flights[i], len(flights[i].states)
        reset = piece.reset[:, :n]
        if piece.condition is None:
            return reset
        j = (i + 1) % len(self.flows)
        before = values(self.flows[i].f, flight.last, flight.end[:, None], p)[:, 0]
        after = values(self.flows[j].f, flights[j].start, flights[j].states[:, :1], p)[:, 0]
        gate, pace = piece.condition[0, :n], piece.condition[0, n]
        # S = R_x + (f_after - R_x f_before - R_t) h_x / (h_x f_before + h_t)
        jump = after - reset @ before - piece.reset[:, n]
        rate = gate @ before + pace
        if abs(rate) <= _NO_PACE * (abs(gate) @ fastest + abs(pace)):
            return np.full_like(reset, np.nan)
        return np.asarray(reset + np.outer(jump, gate) / rate)

    def multipliers(self, x: Array, p: Params) -> tuple[NDArray[np.complex128], float]:
        """Those that are not trivial, and the trivial one: NaN where there is none.

        At VI one is infinite, and what the others are is lost in the rounding of it: NaN.
        """
        factors, velocities = self.factors(x, p)
        if any(np.isnan(stack).any() for stack in factors):
            count = self.start[0].states.shape[0] - self.autonomous
            return np.append(np.inf, np.full(count - 1, np.nan)).astype(complex), np.nan
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
        paces = []
        for flow, flight, piece in zip(
            self.flows, self.flights(x, p), self.linear(x, p), strict=True
        ):
            if piece.condition is not None:
                n = len(flight.states)
                f = values(flow.f, flight.last, flight.end[:, None], p)[:, 0]
                paces.append(-float(piece.condition[0, :n] @ f + piece.condition[0, n]))
        return np.array(paces)

    # --- other cycles -----------------------------------------------------------------------------

    def doubled(self, x: Array, p: Params) -> Equations:
        """Twice the same orbit, as one of twice the period."""
        flights = self.flights(x, p)
        if self.smooth and self.flows[0].reset is None:
            (flight,) = flights
            knots = np.concatenate([0.5 * flight.knots[:-1], 0.5 + 0.5 * flight.knots])
            # slopes are per interval: twice the duration and half the steps leave them as they are
            states, slopes = np.hstack([flight.states] * 2), np.hstack([flight.slopes] * 2)
            twice = Flight(flight.scheme, knots, flight.start, 2 * flight.duration, states, slopes)
            return replace(self, start=(twice,), turns=2 * self.turns)
        whole = sum(flight.duration for flight in flights)
        again = (replace(f, start=f.start + whole) for f in flights)
        flows = (*self.flows, *(flow.later(self.turns) for flow in self.flows))
        start, sizes = (*flights, *again), self.sizes * 2
        return replace(self, flows=flows, start=start, turns=2 * self.turns, sizes=sizes)

    def once(self, x: Array, p: Params) -> Equations:
        """As begun at this orbit, a single time around where it goes around several times."""
        flights = self.flights(x, p)
        rounds = next((m for m in range(_ROUNDS, 1, -1) if self._repeats(m, flights, p)), 1)
        if not self.smooth:
            flights = flights[: len(flights) // rounds]
        elif rounds > 1:
            knots, (whole,) = np.linspace(0.0, 1.0, flights[0].knots.size), flights
            part = whole.on(knots / rounds)
            flights = (replace(part, knots=knots, duration=whole.duration / rounds),)
        return replace(
            self, flows=self.flows[: len(flights)], start=flights, turns=self.turns // rounds,
            sizes=sizes_of(flights),
        )  # fmt: skip

    def _repeats(self, rounds: int, flights: Sequence[Flight], p: Params) -> bool:
        """Whether the orbit is the same at all times and a part of its period later."""
        if self.turns % rounds and not self.autonomous:
            return False
        if self.smooth:
            (flight,), (flow,) = flights, self.flows
            s = np.linspace(0.0, 1 - 1 / rounds, _LOOKS * flight.knots.size)
            later = flight.at(s + 1 / rounds)
            if flow.reset is not None:
                later = values(flow.reset, flight.start + flight.duration * s, later, p)
            return bool(abs(later - flight.at(s)).max() <= _REPEATS * self.sizes[0].max())
        part, rest = divmod(len(flights), rounds)
        if rest:
            return False
        pieces = zip(self.flows, flights, self.sizes, strict=True)
        again = zip(self.flows[part:], flights[part:], strict=True)
        return all(
            (flow.f, flow.reset) == (successor.f, successor.reset)
            and now.states.shape == then.states.shape
            and abs(then.sampled(_LOOKS)[1] - now.sampled(_LOOKS)[1]).max() <= _REPEATS * size.max()
            for (flow, now, size), (successor, then) in zip(pieces, again, strict=False)
        )


def sizes_of(flights: Sequence[Flight]) -> tuple[Array, ...]:
    """How much each state of each flow moves, or how large it is."""
    sizes = []
    for flight in flights:
        states = flight.sampled(2)[1]
        # what hardly moves is measured by its value: its motion may be rounding
        size = np.maximum(np.ptp(states, axis=1), 0.1 * abs(states).max(axis=1))
        sizes.append(np.maximum(size, 1e-3 * size.max()))
    largest = max(size.max() for size in sizes) or 1.0
    rests = [size.max() < _AT_REST * largest for size in sizes]
    return tuple(
        np.full_like(size, largest) if at_rest else size
        for size, at_rest in zip(sizes, rests, strict=True)
    )
