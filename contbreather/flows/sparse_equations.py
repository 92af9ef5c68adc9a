"""The equations of a cycle of one smooth flow with many states, few of which meet in an equation.

States at all Gauss points are unknowns, too: what couples two of them are the matrix of the scheme,
along the time, and the derivative of the field, from state to state. Nothing is eliminated, so that
the derivative is as sparse as that of the field. With the matrix A and the weights b of the scheme,
of an interval of length h from x_0 with states X_c,

    sum_d (A^-1)_cd (X_d - x_0) = h f(X_c),    x_1 = x_0 + sum_cd b_c (A^-1)_cd (X_d - x_0).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, replace
from functools import cache, cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..continuation.algebra.newton import Array, Undefined
from ..continuation.algebra.sparse import Matrix, any_vector, cut_in_two, factorised, first_columns
from .collocation import ROUNDING, Slopes, TrajectorySegment, reached
from .equations import FlowEquations, Layout, Linear, Places, SolvedPlace
from .flow import Flow
from .functions import Params, slopes, values

FEW = 40  # states, from which on what is eliminated costs more than what is sparse
MANY = 250  # states up to which all multipliers are had
_ARNOLDI = 1e-10  # error of multipliers
_KNOWN = 0.5  # smaller ones do not get to the unit circle within a step
_FEWEST, _TURNS = 16, 400  # turns of Arnoldi's iteration


class SparseLayout(Layout):
    """The order of unknowns with the states at Gauss points, `inside`, after those where intervals
    begin."""

    def __init__(self, equations: FlowEquations) -> None:
        super().__init__(equations)
        shape = equations.start[0].slopes.shape
        count = math.prod(shape)
        self.inside: Places = self.orbit + np.arange(count).reshape(shape)
        self.last = self.inside[-1, -1]
        self.knots = [knots + count for knots in self.knots]
        self.lengths, self.levels, self.lambdas = (
            places + count for places in (self.lengths, self.levels, self.lambdas)
        )
        self.orbit += count
        self.size += count
        self._order: Places | None = None

    def elimination(self, rows: Any, columns: Any) -> Places:
        """Order unknowns so that eliminating them fills little in, once, given where entries are.

        By dissection: parts of the states, or of the time, that nothing joins but what lies between
        them, which comes after both; where that is less than states at one time states are split.
        """
        if self._order is None:
            from scipy.sparse import csr_array

            states = (rows < self.orbit) & (columns >= 0) & (columns < self.orbit)
            n = self.nodes[0].shape[1]  # entries of each kind begin with those of the first state
            ends = np.array([rows[states], columns[states]]) % n
            entries: Any = np.ones(2 * ends[0].size), np.hstack([ends, ends[::-1]])
            split = cache(lambda part: cut_in_two(graph, np.frombuffer(part, np.intp)))
            graph = csr_array(entries, shape=(n, n))
            times, every = range(len(self.inside)), np.arange(n)
            # one or two that meet most of the others would hide what is far apart: they come last
            few = every[np.diff(graph.indptr) <= max(16, 4 * math.sqrt(n))]
            few = few if (n - few.size) * (self.orbit // n) <= n else every
            parts = self._dissected(split, times, few, closed=True)
            first = np.concatenate([part.ravel() for part in parts])
            self._order = np.append(first, np.setdiff1d(np.arange(self.size), first))
        return self._order

    def _dissected(
        self, split: Callable[[bytes], Any], times: range, states: Places, *, closed: bool
    ) -> Iterator[Places]:
        """Of some states over intervals next to each other, without the states where the first one
        begins unless these are all around the cycle."""
        nodes, inside, count = self.nodes[0], self.inside, len(times)
        left, right, between = split(states.tobytes())
        wide = between.size * (1 + inside.shape[1]) * count
        if left.size and right.size and (count == 1 or wide <= states.size):
            for part in (left, right):
                yield from self._dissected(split, times, part, closed=closed)
            yield nodes[np.ix_(times if closed else times[1:], between)]
            yield inside[times.start : times.stop, :, between]
        elif closed:
            yield from self._dissected(split, times, states, closed=False)
            yield nodes[times.start, states]
        elif count == 1:
            yield inside[times.start][:, states]
        else:
            for part in (times[: count // 2], times[count // 2 :]):
                yield from self._dissected(split, part, states, closed=False)
            yield nodes[times[count // 2], states]


def has_many_states(flow: Flow, flight: TrajectorySegment, p: Params) -> bool:
    """Tell a flow of many states that nothing ends, given with a sparse derivative."""
    given = getattr(flow.f, "jacobian", None)
    plain = not (flow.guards or flow.reset) and flight.dimension >= FEW
    return plain and given is not None and given.is_sparse(flight.start, flight.states[0], p)


def sparse_where_large(equations: FlowEquations, p: Params) -> FlowEquations:
    """Choose these equations for a flow that is large."""
    if not has_many_states(equations.flows[0], equations.start[0], p):
        return equations
    own = {of.name: getattr(equations, of.name) for of in fields(equations) if of.init}
    return SparseFlowEquations(**own)


@dataclass(frozen=True, eq=False)
class SparseFlowEquations(FlowEquations):
    """A cycle of one flow of many states, discretised."""

    sparse = True

    @cached_property
    def layout(self) -> SparseLayout:
        return SparseLayout(self)

    def unknowns(self, flights: Any, p: Params | None = None) -> dict[str, Any]:
        start, (flight,) = super().unknowns(flights, p), flights
        inside = reached(flight, flight.slopes).T
        return {**start, "orbit": np.concatenate([start["orbit"], inside.ravel()])}

    # --- values -----------------------------------------------------------------------------------

    def _flight(self, i: int, x: Array, t: float) -> TrajectorySegment:
        flight, inside = super()._flight(i, x, t), x[self.layout.inside]
        slopes = self._inverse @ (inside - flight.states[:, None])  # A k = X - x_0
        return replace(flight, slopes=slopes)

    def _solved(self, x: Array, p: Params, error: float = ROUNDING) -> SolvedPlace:
        p = self._unfolded(x, p)
        key = x.tobytes(), tuple(p.items())
        if key not in self._latest:
            if len(self._latest) == 2:  # are kept: the orbit, and one beside it
                del self._latest[next(iter(self._latest))]
            flight = self._flight(0, x, self.start[0].start)
            self._latest[key] = SolvedPlace(x.copy(), dict(p), (flight,))
        return self._latest[key]

    def __call__(self, x: Array, p: Params, error: float = ROUNDING) -> Array:
        (flow,), (flight,), p = self.flows, self.flights(x, p), self._unfolded(x, p)
        left, h = super().__call__(x, p), flight.lengths[:, None, None]
        f = values(flow.f, flight.inner, reached(flight, flight.slopes), p)
        left[self.layout.inside] = flight.slopes - f.T.reshape(flight.slopes.shape) * h
        return left

    # --- derivatives ------------------------------------------------------------------------------

    @cached_property
    def _inverse(self) -> Array:
        return np.asarray(np.linalg.inv(self.start[0].scheme.matrix))

    @cached_property
    def _ends(self) -> Array:
        """Weights of the states inside in that where an interval ends; what is left of 1 is that of
        the state where it begins."""
        return np.asarray(self.start[0].scheme.weights @ self._inverse)

    @cached_property
    def _constant(self) -> tuple[Any, ...]:
        """Entries of the derivative that are the same everywhere: of what is interpolated."""
        (nodes,), inside, ends = self.layout.nodes, self.layout.inside, self._ends
        first, last = self.closing
        return _joined([
            (inside[:, :, None], inside[:, None], self._inverse[:, :, None]),  # A^-1 (X - x_0)
            (inside, nodes[:, None], -self._inverse.sum(axis=1)[:, None]),
            (nodes[0], nodes[0], self.standing),
            (nodes[1:], nodes[1:], 1.0),
            # an interval ends where the next one begins, and the last one where all closes
            (nodes[1:], nodes[:-1], ends.sum() - 1),
            (nodes[1:, None], inside[:-1], -ends[:, None]),
            (nodes[0][first], nodes[-1][last], ends.sum() - 1),
            (nodes[0][first], inside[-1][:, last], -ends[:, None]),
        ])  # fmt: skip

    @property
    def closing(self) -> tuple[Any, Any]:
        """Tell which of the equations that close have which entries of the last state."""
        every = np.arange(self.start[0].dimension)
        return every, every

    def derivatives(self, x: Array, p: Params, names: tuple[str, ...] = ()) -> Matrix:
        from scipy.sparse import csc_array

        rows, columns, data = _joined([self._constant, *self._blocks(x, p, names)])
        width = self.layout.size + len(names) + 1  # the last column is that of fixed knots
        cells: Any = data, (rows, columns % width)
        matrix = first_columns(csc_array(cells, (self.layout.size, width)), width - 1)
        matrix.elimination = self.layout.elimination(rows, columns)
        return matrix

    def _blocks(self, x: Array, p: Params, names: tuple[str, ...]) -> Iterator[Any]:
        """Rows, columns and values of all others; several may meet in one entry."""
        layout, (flow,), (flight,) = self.layout, self.flows, self.flights(x, p)
        inside, knots, (length,) = layout.inside, layout.knots[0], layout.lengths
        kept, full = self.conservation, self._unfolded(x, p)
        unfolded = (*(kept.lambdas if kept else ()), *names)
        parameters = layout.parameters(len(names))
        states, shape = reached(flight, flight.slopes), flight.slopes.shape
        given: Any = flow.f
        f, entries, other = given.jacobian.entries(flow.f, flight.inner, states, full, unfolded)
        h, T = flight.lengths[:, None, None], flight.duration
        f, other = f.T.reshape(shape), other.transpose(2, 0, 1).reshape(*shape, -1)
        yield self._field(entries, flight)
        # h = T (s_1 - s_0), t = T (s_0 + c (s_1 - s_0)): how h f changes with s_0, s_1 and T
        c, rate = flight.scheme.nodes[:, None], h * other[..., 0]
        left, right = np.concatenate([[-1], knots[:-1]]), np.append(knots[:-1], -1)
        yield inside, left[:, None, None], T * (f - (1 - c) * rate)
        yield inside, right[:, None, None], -T * (f + c * rate)
        since = flight.knots[:-1, None, None] + c * flight.steps[:, None, None]
        yield inside, length, -f * flight.steps[:, None, None] - since * rate
        yield inside[..., None], parameters, -h[..., None] * other[..., 1:]
        # the mesh
        moved, steps, longer = flight.share_slopes(self.sizes[0], np.exp(x[knots[-1:]])[:, None])
        moved = np.einsum("jcn,cd->jdn", moved, self._inverse)
        yield knots[:, None, None], inside, moved
        yield knots[:, None], layout.nodes[0], -moved.sum(axis=1)
        yield knots, left, -steps
        yield knots, right, steps
        yield knots, knots[-1], -longer
        if flow.until:  # of the state where all ends, and its time
            at = flight.last, flight.end[:, None], full, unfolded
            slope, weights = slopes(flow.until, *at)[1][0, :, 0], self._ends[:, None]
            n = flight.dimension
            yield length, layout.nodes[0][-1], (1 - weights.sum()) * slope[:n]
            yield length, inside[-1], weights * slope[:n]
            yield length, np.append(length, parameters), slope[n:]
        elif self.autonomous:
            yield length, layout.nodes[0].ravel(), self._phase
        else:
            yield length, np.append(length, parameters), self._of_period(0, p, names)
        if kept:
            rows = np.concatenate([layout.levels, layout.lambdas])[:, None]
            columns = np.concatenate(
                [layout.nodes[0][0], layout.lengths, layout.levels, parameters]
            )
            yield rows, columns, self._given_slopes(kept, x, p, names)

    def _field(self, entries: Any, flight: TrajectorySegment) -> tuple[Array, ...]:
        """Entries of - h f_x."""
        rows, columns, data = entries
        places = self.layout.inside.ravel()
        lengths = np.repeat(flight.lengths, flight.slopes[0].size)
        return places[rows], places[columns], -lengths[rows] * data

    # --- multipliers ------------------------------------------------------------------------------

    @property
    def condensed(self) -> bool:  # type: ignore[override]
        return self.start[0].dimension <= MANY or self.conservation is not None

    def maps(self, x: Array, p: Params) -> list[Callable[[Array], Array]]:
        """Map small perturbations over each interval: what is inside is solved for."""
        from scipy.sparse import csc_array, eye_array, kron

        place = self._solved(x, p)
        (own,), p = place.flights, place.params
        rates = self._rates(own, p)
        traces = rates.diagonal().reshape(own.slopes.shape).sum(axis=2)
        if (flight := own.for_perturbations(-traces @ own.scheme.weights)) is not own:
            rates = self._rates(flight, p)
        inverse, points = np.linalg.inv(flight.scheme.matrix), flight.scheme.points
        forced, ends = inverse.sum(axis=1), flight.scheme.weights @ inverse
        inner, size = kron(inverse, eye_array(flight.dimension)), points * flight.dimension

        def over(factors: Any, start: Array) -> Array:
            # (A^-1 - h f_x) X = A^-1 x_0
            right = np.multiply.outer(forced, start).reshape(-1, *start.shape[1:])
            states = factors.solve(right).reshape(points, *start.shape)
            return np.asarray((1 - ends.sum()) * start + np.tensordot(ends, states, 1))

        parts = (slice(first, first + size) for first in range(0, rates.shape[0], size))
        blocks = (csc_array(inner - rates[:, part][part]) for part in parts)
        return [partial(over, factorised(block)) for block in blocks]

    def _rates(self, flight: TrajectorySegment, p: Params) -> Any:
        """Differentiate h f at the states inside of a flight: a block for each on the diagonal."""
        from scipy.sparse import csc_array

        given: Any = self.flows[0].f
        states = reached(flight, flight.slopes)
        rows, columns, data = given.jacobian.entries(given, flight.inner, states, p, ())[1]
        lengths = np.repeat(flight.lengths, flight.slopes[0].size)
        return csc_array((lengths[rows] * data, (rows, columns)), shape=(lengths.size,) * 2)

    def linearised(self, x: Array, p: Params, names: tuple[str, ...] | None = None) -> SolvedPlace:
        """Map all perturbations over each interval, dense."""
        place = self._solved(x, p)
        if not place.linear:
            unit = np.eye(self.start[0].dimension)
            ends = np.array([over(unit) for over in self.maps(x, p)])
            none = np.empty(0)
            slopes = Slopes(ends, none, none, np.zeros(1), none)  # these decay as they should
            place.linear = (Linear(slopes, ends, none, none, none),)
        return place

    def leading(self, x: Array, p: Params) -> tuple[NDArray[np.complex128], Array]:
        """The multipliers of a modulus above 1/2, by Arnoldi's iteration, and the trivial one of an
        autonomous cycle."""
        n, maps = self.start[0].dimension, self.maps(x, p)
        way, trivial = np.zeros(n), np.empty(0)

        def around(start: Array) -> Array:
            for over in maps:
                start = over(start)
            return start

        if self.autonomous:
            way = self.velocities(x, p)[0][0]
            way = way / np.linalg.norm(way)
            trivial = np.array([way @ around(way)])
        # M v = v along the flow: the others are those of the complement of v
        return _largest(around, way[:, None]), trivial


def _largest(turn: Callable[[Array], Array], apart: Array) -> NDArray[np.complex128]:
    """Find the eigenvalues of a map of a modulus above `_KNOWN`, or the largest, but for those of
    an invariant subspace, shape (n, m).

    Those that are found are set apart as well: of one that is double, as by a symmetry, a single
    start finds one alone.
    """
    found, apart = _arnoldi(turn, apart, 1)
    more = found
    while more.size and abs(more[0]) > _KNOWN:
        more, apart = _arnoldi(turn, apart, 0)
        found = np.append(found, more)
    return found[np.argsort(-abs(found), kind="stable")]


def _arnoldi(
    turn: Callable[[Array], Array], apart: Array, least: int
) -> tuple[NDArray[np.complex128], Array]:
    """Find eigenvalues of a map in a complement, those above `_KNOWN` but at least so many of the
    largest, and add their space to what is apart.

    Without restarts: a turn costs much more than to make it orthogonal to those before, and of the
    many eigenvalues next to 0 none has to converge.
    """
    from scipy.linalg import schur

    n, most = len(apart), min(_TURNS, len(apart))
    basis, small = np.empty((n, most + 1)), np.zeros((most + 1, most))
    vector = any_vector(n)
    vector = vector - apart @ (apart.T @ vector)
    for k in range(1, most + 1):
        basis[:, k - 1] = vector / np.linalg.norm(vector)
        vector, known = turn(basis[:, k - 1]), basis[:, :k]
        for _ in range(2):  # once more for what rounding leaves
            vector = vector - apart @ (apart.T @ vector)
            along = known.T @ vector
            vector = vector - known @ along
            small[:k, k - 1] += along
        small[k, k - 1] = np.linalg.norm(vector)
        mu, vectors = np.linalg.eig(small[:k, :k])
        order = np.argsort(-abs(mu), kind="stable")
        off, mu = small[k, k - 1] * abs(vectors[-1, order]), mu[order]  # residuals
        wanted = max(least, int(np.count_nonzero(abs(mu) + off > _KNOWN)))
        wanted += bool(wanted and mu[wanted - 1].imag > 0)  # and its conjugate, which comes next
        if k >= min(_FEWEST, n) and (off[:wanted] <= _ARNOLDI).all():
            moduli = np.sort(abs(mu[: wanted + 1]))[::-1]
            border = float(moduli[wanted - 1 :].mean())
            space = schur(small[:k, :k], sort=partial(_beyond, border))[1][:, :wanted]
            return mu[:wanted], np.linalg.qr(np.column_stack([apart, known @ space]))[0]
    raise Undefined(
        f"too many multipliers are above {_KNOWN} to look for all of them: events=() asks for none"
    )


def _beyond(border: float, *parts: float) -> bool:
    """Tell whether an eigenvalue, given by one number or by two, is beyond a circle."""
    return abs(complex(*parts)) > border


def _joined(blocks: Any) -> tuple[Array, ...]:
    """Broadcast rows, columns and values of each block, and join them."""
    parts = [np.broadcast_arrays(*block) for block in blocks]
    return tuple(np.concatenate([part[k].ravel() for part in parts]) for k in range(3))
