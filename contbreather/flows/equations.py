"""The equations of a cycle of flows: what begins where the flow before it ended, and closes.

Unknowns are the states in which the intervals of all flows begin, how long each flow takes, and,
where every flow of a forced cycle ends by a condition of its own, the time at which the first
begins. There is one more equation for each flow: the condition that ends it; without one the
period, or the integral condition that fixes the phase of an autonomous orbit.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain
from operator import attrgetter
from typing import Any, NamedTuple
from weakref import WeakValueDictionary

import numpy as np
from numpy.typing import NDArray

from ..continuation.algebra.derivatives import IMAGINARY
from ..continuation.algebra.newton import Array, Undefined
from ..continuation.algebra.sparse import Matrix
from ..continuation.curve.point import Point
from ..errors import BadInput
from .collocation import ROUNDING, Slopes, TrajectorySegment, as_one_flight, derivatives, flown
from .conservation import Conservation
from .flow import Flow, TurnedBack
from .functions import Params, callings, slopes, values

Places = NDArray[np.intp]


class Layout:
    """The order of unknowns and equations: states, meshes, durations, and the phase.

    `nodes` are the places of the states of each flow, shape (intervals, n), the first `orbit` of
    all `size` unknowns; `knots` those of its inner knots and the logarithm of its path, shape
    (intervals,); `lengths` those of all durations; of what is conserved `levels` those of its
    values, and `lambdas` those of its unfolding, which stand where parameters begin.
    """

    def __init__(self, equations: FlowEquations) -> None:
        counts = [flight.states.shape for flight in equations.start]
        states, meshes = [k * n for k, n in counts], [k for k, _ in counts]
        self.orbit, flows = sum(states), len(counts)
        kept = equations.conservation
        conserved = len(kept.quantities) if kept else 0
        sizes = [*states, *meshes, flows, int(equations.phased), conserved, conserved]
        self.size = sum(sizes)
        parts = np.split(np.arange(self.size), np.cumsum(sizes)[:-1])
        pairs = zip(parts, counts, strict=False)
        self.nodes: list[Places] = [part.reshape(count) for part, count in pairs]
        self.knots, self.lengths = parts[flows : 2 * flows], parts[2 * flows]
        self.phase = parts[-3].tolist()  # no unknown, or one
        self.levels, self.lambdas = parts[-2:]
        self.last = self.nodes[0][0]  # equations in which the length counts by the last velocity
        self.ended = [flow.until is not None for flow in equations.flows]
        self.autonomous = equations.autonomous
        self.moving = slice(int(self.lengths[-1]) + 1)  # what solutions near by are told by
        self._cells: dict[int, Places] = {}

    def matrix(self, values: Array, named: int) -> Matrix:
        """Assemble the derivative in unknowns and so many parameters from the values of all blocks,
        of which several may meet in one entry; those of fixed knots are in a column beyond."""
        width = self.size + named + 1
        if named not in self._cells:
            spread = [np.broadcast_arrays(*place) for place in self._places(named)]
            rows, columns = (np.concatenate([at[k].ravel() for at in spread]) for k in range(2))
            self._cells[named] = rows * width + columns % width
        cells = self._cells[named]
        if self.size <= 400:  # unknowns: up to there a dense derivative is the faster one
            entries = np.bincount(cells, values, self.size * width)
            return entries.reshape(self.size, width)[:, :-1]
        from scipy.sparse import csc_array

        return csc_array((values, np.divmod(cells, width)), (self.size, width))[:, :-1]

    def _places(self, named: int) -> Iterator[tuple[Any, Any]]:
        """Rows and columns of the blocks of `FlowEquations`."""
        diagonal, parameters = np.arange(self.orbit), self.parameters(named)
        whole = np.append(self.lengths, parameters)
        yield diagonal, diagonal
        for i, node in enumerate(self.nodes):
            columns = self.columns(i, named)
            yield node[1:, :, None], columns[:-1, None]
            yield self.nodes[(i + 1) % len(self.nodes)][0][:, None], columns[-1:]
            yield self.knots[i][:, None], columns
            yield self.knots[i], self.knots[i][-1]
            if self.ended[i]:
                yield self.lengths[i], columns[-1]
            else:
                row = diagonal if self.autonomous and i == 0 else whole
                yield self.lengths[i], row
        for phase in self.phase:
            yield phase, whole
        if self.lambdas.size:
            rows = np.concatenate([self.levels, self.lambdas])
            start = self.nodes[0][0], self.lengths, self.levels, parameters
            yield rows[:, None], np.concatenate(start)

    def parameters(self, named: int) -> Places:
        """List lambdas and parameters."""
        return np.arange(self.size - self.lambdas.size, self.size + named)

    def columns(self, i: int, named: int) -> Places:
        """List the unknowns that each interval depends on, -1 for a knot that is fixed: its state,
        the knots at both ends, the duration, what the beginning of the flow is the sum of, and the
        parameters."""
        begins, parameters = [*self.lengths[:i], *self.phase], self.parameters(named)
        inner = np.concatenate([[-1], self.knots[i][:-1], [-1]])
        shared = np.tile([self.lengths[i], *begins, *parameters], (len(inner) - 1, 1))
        return np.hstack([self.nodes[i], inner[:-1, None], inner[1:, None], shared])


class Linear(NamedTuple):
    """A flow linearised. Columns of `reset` and `condition` are the state, the time and the
    parameters; of all others the unknowns of `Layout.columns`."""

    slopes: Slopes
    ends: Array  # (intervals, n, columns): of the state where each interval ends
    after: Array  # (n, columns): of that where the flow behind it begins
    shares: Array  # (intervals, columns): of the density of the mesh
    longer: Array  # (intervals,): minus the same in the logarithm of the path
    reset: Array | None = None
    condition: Array | None = None
    ending: Array | None = None  # (1, columns): of the condition


@dataclass(eq=False)
class SolvedPlace:
    """A place that was solved for, perhaps with derivatives in unknowns and named parameters: from
    there flights near by begin to be solved for."""

    x: Array
    params: Params
    flights: tuple[TrajectorySegment, ...]
    error: float = ROUNDING  # of the slopes inside, relative
    names: tuple[str, ...] = ()
    linear: tuple[Linear, ...] = ()


@dataclass(frozen=True, eq=False)
class FlowEquations:
    """A cycle of flows, discretised."""

    flows: tuple[Flow, ...]
    start: tuple[TrajectorySegment, ...]  # the orbit at which all began: meshes and first guesses
    period: Callable[..., Any] | None  # (t, x, p), of which p is used; None if it is autonomous
    turns: int  # over how many of these periods it closes
    parts: Mapping[str, tuple[str, ...]]  # what has columns, states or arrays of these, by name
    sizes: tuple[Array, ...]  # in which meshes measure the motion, as from `sizes_of`
    conservation: Conservation | None = None
    units: Any = 1.0  # of the states
    _latest: dict[Any, SolvedPlace] = field(default_factory=dict, init=False)
    orbits: Any = field(default_factory=WeakValueDictionary, init=False)  # that somebody has

    def __getstate__(self) -> dict[str, Any]:
        # but for what was solved, and no weak reference goes through a pickle
        return {**self.__dict__, "_latest": {}, "orbits": None}

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        self.__dict__.update(state, orbits=WeakValueDictionary())

    # --- the unknowns -----------------------------------------------------------------------------

    length = "period"  # its name, of one flow
    condensed = True  # whether all multipliers are had, or the leading ones only
    sparse = False  # whether the states inside of intervals are unknowns, too

    @cached_property
    def phased(self) -> bool:
        """Tell whether the time at which the first flow begins is unknown."""
        return self.period is not None and all(flow.until for flow in self.flows)

    @cached_property
    def _lambdas(self) -> tuple[str, ...]:
        return self.conservation.lambdas if self.conservation else ()

    @cached_property
    def autonomous(self) -> bool:
        return self.period is None

    @property
    def states(self) -> tuple[str, ...]:
        return tuple(chain.from_iterable(self.parts.values()))

    @property
    def smooth(self) -> bool:
        """Tell whether one flow that no condition ends is all of it."""
        return len(self.flows) == 1 and self.flows[0].until is None

    @cached_property
    def endless(self) -> bool:
        """Tell whether no condition ends a flow, which would set the phase."""
        return not any(flow.until for flow in self.flows)

    @cached_property
    def shrinks(self) -> bool:
        """Tell whether such a cycle may shrink to an equilibrium."""
        turns = isinstance(self.flows[0].reset, TurnedBack)
        return self.autonomous and self.smooth and not turns

    @property
    def standing(self) -> Any:
        """Tell which entries of the first state stand in the equations that close, 1 or 0: all of
        them where it is to be that in which all ends."""
        return 1.0

    @cached_property
    def layout(self) -> Layout:
        return Layout(self)

    def unknowns(
        self, flights: Sequence[TrajectorySegment], p: Params | None = None
    ) -> dict[str, Any]:
        durations = np.array([flight.duration for flight in flights])
        start: dict[str, Any] = {
            "orbit": np.concatenate([f.states.ravel() for f in flights]),
            "mesh": np.concatenate(
                [
                    np.append(flight.knots[1:-1], math.log(flight.path(sizes)))
                    for flight, sizes in zip(flights, self.sizes, strict=True)
                ]
            ),
        }
        start |= {"durations": durations} if len(flights) > 1 else {self.length: durations[0]}
        start |= {"phase": flights[0].start} if self.phased else {}
        return start if self.conservation is None else self._kept(self.conservation, start, p)

    def _kept(self, kept: Conservation, start: dict[str, Any], p: Params | None) -> dict[str, Any]:
        """Add what is conserved, of an orbit at parameters, to the unknowns."""
        state = start["orbit"][: self.start[0].dimension, None]
        levels = [0.0 if p is None else float(values(H, 0.0, state, p)[0, 0])
                  for H in kept.quantities.values()]  # fmt: skip
        added = [*levels, *[0.0] * len(levels)]
        start |= dict(zip((*kept.quantities, *kept.lambdas), added, strict=True))
        # what is a parameter has another name as an unknown
        held = "period" if kept.timed else kept.held
        return {"held" if name == held else name: value for name, value in start.items()}

    # --- what is given of an orbit of a family ----------------------------------------------------

    @property
    def givens(self) -> tuple[str, ...]:
        """List what may be: parameters of which one is held; none where orbits are isolated."""
        kept = self.conservation
        return (kept.time, *kept.quantities) if kept else ()

    @property
    def held(self) -> str:
        return self.conservation.held if self.conservation else ""

    def longer(self, x: Array, p: Params) -> tuple[int, Array] | None:
        """The equation of the period, and how the first quantity changes with unknowns, where the
        period is held."""
        if (kept := self.conservation) is None or not kept.timed:
            return None
        return int(self.layout.lambdas[0]), np.eye(1, self.layout.size, self.layout.levels[0])[0]

    def holding(self, name: str) -> FlowEquations:
        assert self.conservation is not None
        return replace(self, conservation=replace(self.conservation, held=name))

    # --- the equations ----------------------------------------------------------------------------

    def flights(self, x: Array, p: Params) -> tuple[TrajectorySegment, ...]:
        """Solve for all flows, from the states and times among the unknowns."""
        return self._solved(x, p).flights

    def _solved(self, x: Array, p: Params, error: float = ROUNDING) -> SolvedPlace:
        """Solve for all flows, once for one of the latest places."""
        p = p if self.conservation is None else self._unfolded(x, p)
        key = x.tobytes(), tuple(p.items())
        place = self._latest.get(key)
        if place is None or place.error > error:
            moving, flights = self._begun(x, p)
            if known := self.orbits.get(key):  # from far off slopes inside have other roots
                flights, error = known.own_flights, ROUNDING
            else:
                near = self._near(moving)
                for i, flow in enumerate(self.flows):
                    guess = self._guess(i, flights[i], p, moving, *near) if near else None
                    flights[i] = flown(flow, flights[i], p, self._units[i], guess, error)
            place = SolvedPlace(moving, dict(p), tuple(flights), error)
        self._latest.pop(key, None)
        while len(self._latest) >= 16:  # are kept, to begin from the nearest
            del self._latest[next(iter(self._latest))]
        self._latest[key] = place
        return place

    def retreat(self, x: Array, p: Params) -> None:
        """Begin from this place alone: slopes inside may have other roots, as beyond a pole."""
        callings.cache_clear()  # decided, perhaps, at states that overflow
        self._solved(x, p)
        for other in [*self._latest][:-1]:
            del self._latest[other]

    def _begun(self, x: Array, p: Params) -> tuple[Array, list[TrajectorySegment]]:
        """Tell a place by its unknowns, and its flights without slopes inside."""
        flights, t = list[TrajectorySegment](), float(x[-1] if self.phased else self.start[0].start)
        for i, flow in enumerate(self.flows):
            flights.append(plain := self._flight(i, x, t))
            if flow.ignore and max(plain.duration, 0.0) < flow.ignored(p):
                raise Undefined(f"flow {i} ends while its condition does not count (ignore=)")
            t += plain.duration
        return x[self.layout.moving].copy(), flights

    def prepare(self, places: Sequence[tuple[Array, Params]], names: tuple[str, ...]) -> None:
        """Solve and linearise at several places as for one with the intervals of all, where these
        have the same parameters and are next to one that is linearised."""
        p, wanted = self._unfolded(*places[0]), (*self._lambdas, *names)
        near = self._near(places[0][0][self.layout.moving])[:2]
        if len(near) < 2 or any(self._unfolded(*place) != p for place in places):
            return
        begun = [self._begun(x, p) for x, _ in places]
        solved = [SolvedPlace(moving, dict(p), (), names=wanted) for moving, _ in begun]
        for i, flow in enumerate(self.flows):
            whole = as_one_flight(flights := [of[i] for _, of in begun])
            guess = self._guess(i, whole, p, begun[0][0], *near)
            whole = flown(flow, whole, p, self._units[i], guess)
            many = derivatives(flow, whole, whole.slopes, p, wanted, once=True)
            slopes = whole.slopes.reshape(len(places), -1, *whole.slopes.shape[1:])
            for place, flight, k in zip(solved, flights, slopes, strict=True):
                place.flights += (flight.with_slopes(k, None),)
            for place, piece in self._linearised(i, whole, many, solved):
                place.linear += (piece,)
        for (x, _), place in zip(places, solved, strict=True):
            self._latest[x.tobytes(), tuple(p.items())] = place

    @cached_property
    def _units(self) -> list[float]:
        sizes = zip(self.sizes, self.start, strict=True)
        return [max(float(size.max()), float(abs(f.states).max())) for size, f in sizes]

    def _unfolded(self, x: Array, p: Params) -> Params:
        """Add lambdas, which are unknowns here, and parameters to the flow."""
        if self.conservation is None:
            return p
        unfolded = x[self.layout.lambdas].tolist()
        return {**p, **dict(zip(self.conservation.lambdas, unfolded, strict=True))}

    def _near(self, x: Array) -> list[SolvedPlace]:
        """The place next to which slopes are estimated, of those near; the nearest that is
        linearised, which is the same unless one is at half its distance; and one beyond that."""
        places = [*self._latest.values()] or [self._begin]
        apart = np.array([*map(attrgetter("x"), places)]) - x
        off, most = np.vecdot(apart, apart), 0.01 * x.dot(x)  # squares: a tenth of its size
        near: list[SolvedPlace] = []
        for j in off.argsort().tolist():
            if off[j] > most or len(near) == 3:
                break
            # of places that were prepared no inverse is known
            linear = places[j].linear and places[j].linear[0].slopes.inverse is not None
            if not near:
                near, least = [places[j]], off[j]
            if len(near) == 1 and linear:
                near, least = [places[j] if off[j] < 4 * least else near[0], places[j]], off[j]
            elif linear and off[j] > 2 * least:
                near.append(places[j])
        return near

    def _guess(
        self, i: int, flight: TrajectorySegment, p: Params, x: Array,
        nearest: SolvedPlace, place: SolvedPlace | None = None, second: SolvedPlace | None = None,
    ) -> tuple[Array, Array | None, float]:  # fmt: skip
        """Estimate the slopes inside of a flow, and the inverse that finds them; and the size of
        what is of second order in this: by so much an estimate to first order is off at the place
        before, if that is on the same way."""
        if place is None:
            return nearest.flights[i].slopes, None, 0.0
        slopes, names = place.linear[i].slopes, place.names
        k = slopes.beside(nearest.flights[i], nearest.params, flight, p, names)
        if nearest is not place or second is None:
            return k, slopes.inverse, 0.0
        way, ahead, before = second.x - place.x, x - place.x, second.flights[i]
        share = way.dot(ahead) / way.dot(way)
        if share * way.dot(ahead) < 0.9 * ahead.dot(ahead):  # that is the square of a cosine
            return k, slopes.inverse, 0.0
        first_order = slopes.beside(place.flights[i], place.params, before, second.params, names)
        off = share**2 * (before.slopes - first_order)
        return k + off, slopes.inverse, float(np.maximum.reduce(abs(off), axis=None))

    @cached_property
    def _begin(self) -> SolvedPlace:
        x = [np.ravel(value) for value in self.unknowns(self.start).values()]
        return SolvedPlace(np.concatenate(x)[self.layout.moving], {}, self.start)

    def _flight(self, i: int, x: Array, t: float) -> TrajectorySegment:
        layout, start = self.layout, self.start[i]
        knots = np.zeros(len(start.knots))
        knots[1:-1], knots[-1] = x[layout.knots[i][:-1]], 1.0
        duration = float(x[layout.lengths[i]])
        # a flow that ends as it begins has none: a little beyond that place it goes backwards
        if not (duration > 0.0 or duration > -1e-6 * sum(f.duration for f in self.start)):
            raise Undefined("a flow ends where it began: its duration goes to zero")
        states, rounds = x[layout.nodes[i]], start.rounds
        flight = TrajectorySegment(start.scheme, knots, t, duration, states, start.slopes, rounds)
        if not np.minimum.reduce(flight.steps) > 0:
            raise Undefined("intervals of the mesh overtake each other")
        return flight

    def __call__(self, x: Array, p: Params, error: float = ROUNDING) -> Array:
        flights, layout = self._solved(x, p, error).flights, self.layout
        left = np.empty(layout.size)
        for i, flight in enumerate(flights):
            # x_0 less where the flow before arrives, x_j less where interval j - 1 ends
            nodes, knots, states = layout.nodes[i], layout.knots[i], flight.states
            begin = states[0] if i else self._own[: states.shape[1]] * states[0]
            smooth = self.flows[i - 1].reset is None
            arrived = flights[i - 1].ends[-1] if smooth else self._after(i - 1, flights[i - 1], p)
            left[nodes[0]] = begin - arrived
            left[nodes[1:]] = states[1:] - flight.ends[:-1]
            # m equal shares for the m - 1 inner knots and the unit of the path
            left[knots] = flight.shares(self.sizes[i], math.exp(x[knots[-1]])) - 1.0
            left[layout.lengths[i]] = self._condition(i, x, flight, p)
        if self.phased:
            left[layout.phase] = self._over(None, x, p)
        if self.conservation:
            rows = np.concatenate([layout.levels, layout.lambdas])
            left[rows] = self._given(self.conservation, x, p)
        return left

    def _given(self, kept: Conservation, x: Array, p: Params) -> Array:
        """Values of what is conserved less these, what is held less that, and how far the orbit is
        off its first one along symmetries."""
        layout, begin = self.layout, x[self.layout.nodes[0][0]]
        levels = [values(H, 0.0, begin[:, None], p)[0, 0] for H in kept.quantities.values()]
        held = x[(layout.lengths if kept.timed else layout.levels)[0]] - kept.given(p)
        off = kept.across @ (begin - self.start[0].states[0])
        return np.concatenate([levels - x[layout.levels], [held], off])

    def _given_slopes(
        self, kept: Conservation, x: Array, p: Params, names: tuple[str, ...]
    ) -> Array:
        """Differentiate these in the first state, the duration, levels, lambdas and parameters."""
        begin = x[self.layout.nodes[0][0]]
        n, k = begin.size, len(kept.quantities)
        rows = np.zeros((2 * k, n + 1 + 2 * k + len(names)))
        for row, H in zip(rows, kept.quantities.values(), strict=False):
            slope = slopes(H, 0.0, begin[:, None], p, names)[1][0, :, 0]
            row[:n], row[n + 1 + 2 * k :] = slope[:n], slope[n + 1 :]
        rows[:k, n + 1 : n + 1 + k] = -np.eye(k)
        rows[k, n + (not kept.timed)] = 1.0
        if kept.held in names:
            slope = kept.given({kept.held: p[kept.held] + 1j * IMAGINARY}).imag / IMAGINARY
            rows[k, n + 1 + 2 * k + names.index(kept.held)] = -slope
        rows[k + 1 :, :n] = kept.across
        return rows

    def _after(self, i: int, flight: TrajectorySegment, p: Params) -> Array:
        reset = self.flows[i].reset
        assert reset is not None
        after = np.asarray(values(reset, flight.last, flight.end[:, None], p)[:, 0])
        i %= len(self.flows)
        n = self.layout.nodes[(i + 1) % len(self.flows)].shape[1]
        if after.shape != (n,):
            raise BadInput(
                f"reset of flow {i} gives {after.size} states; the flow that follows has {n}"
            )
        return after

    def _condition(self, i: int, x: Array, flight: TrajectorySegment, p: Params) -> float:
        until = self.flows[i].until
        if until is not None:
            return float(values(until, flight.last, flight.end[:, None], p)[0, 0])
        if not self.autonomous:
            return self._over(i, x, p)
        if i:  # only doubling makes several: each round takes as long as the first
            return float(x[self.layout.lengths[i]] - x[self.layout.lengths[0]])
        return self.out_of_phase(x)

    def _over(self, i: int | None, x: Array, p: Params) -> float:
        """Measure by how much durations exceed their periods."""
        taken = self._taken(i)
        whole = self.turns * taken.mean() * self.forcing_period(p)
        return float(taken @ x[self.layout.lengths] - whole)

    def _taken(self, i: int | None) -> Array:
        """Tell which durations take the period: all together; of flows that nothing else ends,
        which only doubling makes several, each its share."""
        return np.ones(len(self.flows)) if i is None else np.eye(len(self.flows))[i]

    def forcing_period(self, p: Params) -> float:
        """Evaluate the period of the forcing, of which a cycle may take several."""
        assert self.period is not None
        return float(values(self.period, 0.0, np.zeros((1, 1)), p)[0, 0])

    def taken_back(self, x: Array, p: Params) -> Array | None:
        """Measure how far each state is moved where whole turns are taken back, or by the reset of
        a smooth flow, if all alike: a turn of an angle, and no mirror."""
        last = self.flows[-1].reset
        if isinstance(last, TurnedBack) and not (self.smooth and last.reset):
            own = [f.dimension == last.turns.size for f in self.start]
            parts = zip(own, self.layout.nodes, strict=True)
            return np.hstack([np.resize(last.single * has, node.size) for has, node in parts])
        if not self.smooth or last is None:
            return None
        states = x[self.layout.nodes[0]].T
        moved = values(last, self.start[0].start, states, p) - states
        rounded = 1e-12 * abs(states).max()  # what is moved by no more stays
        same = np.ptp(moved, axis=1).max() <= rounded
        back = np.where(abs(moved) > rounded, abs(moved), 0.0)
        return back.T.ravel() if same else None

    @cached_property
    def swing(self) -> Array:
        """The unit row, in units of the states, that measures the swing of an orbit the way it did
        at first."""
        first = self.start[0].states / self.units
        way = first - first.mean(axis=0)
        return np.asarray(way / math.sqrt((way * way).sum())).ravel()

    @cached_property
    def _phase(self) -> Array:
        """The integral of x . dx over the first orbit: what keeps one from sliding along itself.

        By central differences neither the first orbit nor a constant moves it, whatever the mesh:
        of an orbit as small as one likes it tells how that swings, and not where it lies."""
        rises, rows = [flight.ends - flight.states for flight in self.start], []
        for k, rise in enumerate(rises):
            before, reset = self.start[k - 1], self.flows[k - 1].reset
            behind = rises[k - 1][-1]
            if reset is not None:  # a mirror image, or a turn of an angle
                last = np.stack([before.states[-1], before.end], axis=1)
                behind = np.diff(values(reset, before.last, last, self._begin.params))[:, 0]
            rows.append(0.5 * (rise + np.vstack([behind, rise[:-1]])).ravel())
        row = np.concatenate(rows)
        return np.asarray(row / (np.linalg.norm(row) or 1.0))

    def hold(self, x: Array, p: Params) -> float:
        """Measure by a cosine how much the phase condition moves while the orbit slides along
        itself, with its mesh: 1 where all began."""
        flights = self._solved(x, p).flights
        if flights[0].velocities is None:
            self.velocities(x, p)
        slide = np.concatenate([(f.velocities * f.steps[:, None]).ravel() for f in flights])
        return float(self._phase @ slide / math.sqrt(slide @ slide))

    def out_of_phase(self, x: Array) -> float:
        """Integrate (x - x_start) . x_start' over an orbit: what its phase is measured by."""
        states = slice(self._phase.size)
        return float(self._phase @ (x[states] - self._begin.x[states]))

    # --- derivatives ------------------------------------------------------------------------------

    def velocities(self, x: Array, p: Params) -> list[Array]:
        """Evaluate the field of each flow where its intervals begin, shape (intervals, n)."""
        flights = self._solved(x, p).flights
        for flow, flight in zip(self.flows, flights, strict=True):
            if flight.velocities is None:
                way = values(flow.f, flight.begins, flight.states.T, p).T
                vars(flight)["velocities"] = way
        return [flight.velocities for flight in flights]

    def linearised(self, x: Array, p: Params, names: tuple[str, ...] | None = None) -> SolvedPlace:
        """Take all derivatives of flows, resets and conditions; None for any parameters, those of
        the last columns, that are known already."""
        place, wanted = self._solved(x, p), (*self._lambdas, *(names or ()))
        if not place.linear or (names is not None and wanted != place.names):
            place.names, linear = wanted, []
            for i, (flow, flight) in enumerate(zip(self.flows, place.flights, strict=True)):
                of = derivatives(flow, flight, flight.slopes, place.params, wanted)
                linear += [piece for _, piece in self._linearised(i, flight, of, [place])]
            place.linear = tuple(linear)
        return place

    def transition(self, i: int, place: SolvedPlace) -> Array:
        """Map small perturbations over each interval of a flow, shape (intervals, n, n)."""
        slopes, own = place.linear[i].slopes, place.flights[i]
        if (flight := own.for_perturbations(slopes.decay)) is not own:
            slopes = derivatives(self.flows[i], flight, flight.slopes, place.params, once=True)
        return slopes.ends[:, :, : own.dimension]

    def _linearised(
        self, i: int, whole: TrajectorySegment, derivative: Slopes, places: Sequence[SolvedPlace]
    ) -> Iterator[tuple[SolvedPlace, Linear]]:
        """Linearise a flow at several places by the derivatives of its flights as one."""
        n, many = whole.states.shape[1], len(whole.states) // len(places)
        paths = np.exp([at.x[self.layout.knots[i][-1]] for at in places]).repeat(many)[:, None]
        inside, steps, longer = whole.share_slopes(self.sizes[i], paths)
        inside = inside.reshape(len(steps), 1, -1) @ derivative.inside
        both = self._in_unknowns(i, whole, np.concatenate([derivative.ends, inside], axis=1))
        ends, shares = both[:, :n], both[:, n]
        # the step of an interval is the difference of the knots at its ends
        shares[:, n] -= steps
        shares[:, n + 1] += steps
        ended = self.flows[i].reset or self.flows[i].until
        for j, place in enumerate(places):
            of = slice(j * many, (j + 1) * many)
            parts: Any = derivative if many == len(ends) else (part[of] for part in derivative[:5])
            own = Slopes(*parts)  # of several no inverse is known
            linear = Linear(own, ends[of], ends[of.stop - 1], shares[of], longer[of])
            yield place, self._with_ending(i, place, linear) if ended else linear

    def _with_ending(self, i: int, place: SolvedPlace, linear: Linear) -> Linear:
        """Add what ends a flow, and what comes after."""
        flow, flight = self.flows[i], place.flights[i]
        n, p, names = flight.dimension, place.params, place.names
        # of state, time and parameters at its end: the time is the sum of beginning and length
        last = np.eye(n + 1 + len(names), n + 2 + len(names), 1)
        last[:n], last[n, n] = linear.slopes.ends[-1], 1.0
        arrival = self._in_unknowns(i, flight, last[None], slice(-1, None))[0]
        at = flight.last, flight.end[:, None], p, names
        if flow.reset:
            reset = slopes(flow.reset, *at)[1][:, :, 0]
            linear = linear._replace(reset=reset, after=reset @ arrival)
        if flow.until:
            condition = slopes(flow.until, *at)[1][:, :, 0]
            linear = linear._replace(condition=condition, ending=condition @ arrival)
        return linear

    def _in_unknowns(
        self, i: int, flight: TrajectorySegment, of: Array, j: slice = slice(None)
    ) -> Array:
        """Turn derivatives in the state, the beginning and the length of intervals, and parameters,
        into those in the unknowns of `Layout.columns`."""
        n, T = flight.states.shape[1], flight.duration
        begin, length = of[:, :, n, None], of[:, :, n + 1, None]
        # t_j = t_0 + T s_j and h_j = T (s_(j+1) - s_j), t_0 the phase and what lasted before
        longer = flight.marks[j, None, None] * begin + flight.steps[j, None, None] * length
        earlier = [begin] * (i + self.phased)
        knots = T * (begin - length), T * length
        parts = of[:, :, :n], *knots, longer, *earlier, of[:, :, n + 2 :]
        return np.concatenate(parts, axis=2)

    def derivatives(self, x: Array, p: Params, names: tuple[str, ...] = ()) -> Matrix:
        """Differentiate in all unknowns and named parameters: (size, size + names) and sparse, or
        dense where there are few."""
        blocks = [self._own]  # their values, where `Layout` says
        for i, piece in enumerate(self.linearised(x, p, names).linear):
            ending = self._of_length(i, p, names) if piece.ending is None else piece.ending
            blocks += [-piece.ends[:-1].ravel(), -piece.after.ravel(), piece.shares.ravel()]
            blocks += [-piece.longer, ending.ravel()]
        if self.phased:
            blocks.append(self._of_period(None, p, names))
        if self.conservation:
            blocks.append(self._given_slopes(self.conservation, x, p, names).ravel())
        return self.layout.matrix(np.concatenate(blocks), len(names))

    @cached_property
    def _own(self) -> Array:
        """Entries of each state in its own row."""
        own = np.ones(self.layout.orbit)
        own[: self.start[0].dimension] = self.standing
        return own

    def place(self, i: int, s: float, x: Array, p: Params) -> tuple[float, Array]:
        """Time and state of a flow at a part of its duration."""
        flight = self.flights(x, p)[i]
        return flight.start + s * flight.duration, flight.at(np.array([s]))[:, 0]

    def place_slopes(self, i: int, s: float, x: Array, p: Params, names: tuple[str, ...]) -> Array:
        """The derivative of that state, and of the time below, in all unknowns, named parameters
        and the part of the duration."""
        place = self.linearised(x, p, names)
        flight, n, named = place.flights[i], place.flights[i].dimension, len(names)
        (j,), (u,) = flight.places(np.array([s]))
        # in the state, the beginning and the length of the interval, and the parameters
        inner = np.eye(n + 1, n + 2 + named)
        inner[n, n + 1] = u  # the time: so much of the length later than the beginning
        inside = place.linear[i].slopes.inside[j].reshape(flight.scheme.points, n, -1)
        inner[:n] += np.tensordot(flight.scheme.spread(np.array([u]))[0], inside, 1)
        rise = np.append(flight.rates(np.array([s]))[:, 0], flight.duration)
        whole = self._in_unknowns(i, flight, inner[None], slice(j, j + 1))[0]
        whole[:, n] -= (1 - u) * rise  # where in the interval, if the knot before it moves
        whole[:, n + 1] -= u * rise
        columns = self.layout.columns(i, named)[j]
        derivative = np.zeros((n + 1, self.layout.size + named + 1))
        derivative[:, columns[columns >= 0]] = whole[:, columns >= 0]
        derivative[:, -1] = rise
        return derivative

    def _of_length(self, i: int, p: Params, names: tuple[str, ...]) -> Array:
        """Differentiate what a flow without a condition takes."""
        if not self.autonomous:
            return self._of_period(i, p, names)
        if i == 0:
            return self._phase
        first, own = np.eye(len(self.flows) + len(self.layout.parameters(len(names))))[[0, i]]
        return np.asarray(own - first)

    def _of_period(self, i: int | None, p: Params, names: tuple[str, ...]) -> Array:
        assert self.period is not None
        slope = slopes(self.period, 0.0, np.zeros((1, 1)), p, names)[1][0, 2:, 0]
        taken = self._taken(i)  # of the sum of durations - turns T(p)
        return np.append(taken, -self.turns * taken.mean() * slope)


def equations_of(point: Point) -> FlowEquations:
    equations: FlowEquations = point.curve.problem.residual
    return equations
