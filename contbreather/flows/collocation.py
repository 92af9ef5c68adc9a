"""Gauss collocation: a flow over the intervals of a mesh, and their derivatives.

On each interval the orbit is a polynomial whose slope satisfies the equations at the Gauss points,
which is one step of the Gauss method: only the states and the times where intervals begin are
unknowns of a cycle. What is between is solved for interval by interval, all of them at once.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..checks import whole
from ..continuation.algebra.newton import Array, Undefined
from ..errors import BadInput
from .flow import Flow
from .functions import Params, calling, quiet, slopes, values

_MOST_POINTS = 12
_MANY = 40  # states, of which an interval of so many points costs more than its order gains
AT_REST = 1e-6  # what moves less than this, relative to all there is, is at rest
ROUNDING = 1e-14  # corrections this small, relative to the slopes, are rounding


@dataclass(frozen=True)
class Collocation:
    """Resolution of a flow: intervals, and collocation points in each.

    States where intervals meet are exact to the order of twice the points, so that high orders
    are the cheap gain: 20 intervals of 6 points are as exact as 60 of 4.

    Parameters
    ----------
    intervals : int
        Of each flow, 2 or more. They follow the orbit along a branch: each has the same share of
        the motion and of the time.
    points : int
        Gauss points in each interval, 2 to 12.

    Examples
    --------
    >>> Collocation(intervals=40).points
    6
    """

    intervals: int = 20
    points: int = 6

    def __post_init__(self) -> None:
        whole("intervals", self.intervals, 2)
        if not 2 <= whole("points", self.points, 2) <= _MOST_POINTS:
            raise BadInput(f"points = {self.points}: 2 to {_MOST_POINTS} Gauss points an interval")

    @cached_property
    def nodes(self) -> Array:
        """Gauss points of the interval from 0 to 1."""
        return 0.5 + 0.5 * np.polynomial.legendre.leggauss(self.points)[0]

    @cached_property
    def doubled(self) -> Collocation:
        """The scheme of twice the order."""
        return _Gauss(self.intervals, 2 * self.points)

    @cached_property
    def decaying(self) -> Collocation:
        """The scheme with one point more by which what decays fast is gone after an interval."""
        return _Radau(self.intervals, self.points + 1)

    @cached_property
    def matrix(self) -> Array:
        """Integrals of the Lagrange polynomials from 0 to each node: Butcher's matrix."""
        return self.spread(self.nodes)

    @cached_property
    def weights(self) -> Array:
        return self.spread(np.ones(1))[0]

    @cached_property
    def highest(self) -> Array:
        """Row from values at the nodes to the coefficient of their highest Legendre polynomial."""
        return np.asarray(np.linalg.inv(self._legendre)[-1])

    @cached_property
    def _legendre(self) -> Array:
        return np.asarray(np.polynomial.legendre.legvander(2 * self.nodes - 1, self.points - 1))

    def spread(self, at: Array) -> Array:
        """Integrals from 0 to each of `at` of the Lagrange polynomials of the nodes."""
        # of P_j(2 s - 1) over s: half of that over 2 s - 1
        lifted = np.polynomial.legendre.legint(np.eye(self.points), lbnd=-1, scl=0.5)
        return self._lagrange(np.polynomial.legendre.legval(2 * at - 1, lifted))

    @lru_cache(maxsize=64)  # noqa: B019 - as for a property
    def looks(self, per: int) -> Array:
        """Integrate from 0 to each of so many places as far apart."""
        return self.spread(np.arange(per) / per)

    def between(self, at: Array) -> Array:
        """Lagrange polynomials of the nodes, at each of `at`."""
        return self._lagrange(np.polynomial.legendre.legvander(2 * at - 1, self.points - 1).T)

    def _lagrange(self, legendre: NDArray[Any]) -> Array:
        # Lagrange's are P V^-1 with V_cj = P_j(2 s_c - 1): powers of s would be ill conditioned
        return np.asarray(np.linalg.solve(self._legendre.T, legendre).T)


class _Gauss(Collocation):
    """Any number of points."""

    def __post_init__(self) -> None:
        pass


class _Radau(_Gauss):
    """Radau's points, the last of them at the end of the interval."""

    @cached_property
    def nodes(self) -> Array:
        # zeros of P_m - P_(m-1)
        difference = np.zeros(self.points + 1)
        difference[-2:] = -1.0, 1.0
        # all of them real, whatever their type: from numpy 2.5 on that is complex
        nodes = 0.5 + 0.5 * np.polynomial.legendre.legroots(difference).real
        nodes[-1] = 1.0
        return np.asarray(nodes)


@dataclass(frozen=True, eq=False)
class TrajectorySegment:
    """One flow over its duration: states where its intervals begin, and the slopes inside."""

    scheme: Collocation
    knots: Array  # (intervals + 1,), where they meet, from 0 to 1 in units of the duration
    start: float
    duration: float
    states: Array  # (intervals, n)
    slopes: Array  # (intervals, points, n), in units of the length of each interval
    rounds: int = 1  # how many times around the orbit is that it was doubled from

    @property
    def dimension(self) -> int:
        return self.states.shape[1]

    marks: Array = field(init=False)  # where its intervals begin, in units of the duration
    steps: Array = field(init=False)  # their lengths in these
    lengths: Array = field(init=False)
    begins: Array = field(init=False)  # times
    inner: Array = field(init=False)  # times of all Gauss points
    velocities: Any = field(default=None, init=False)  # of its flow there, once known

    def __post_init__(self) -> None:
        marks, steps = self.knots[:-1], self.knots[1:] - self.knots[:-1]
        begins, lengths = self.start + self.duration * marks, self.duration * steps
        inner = (begins[:, None] + lengths[:, None] * self.scheme.nodes).ravel()
        vars(self).update(marks=marks, steps=steps, lengths=lengths, begins=begins, inner=inner)

    @cached_property
    def ends(self) -> Array:
        """States where its intervals end: ``x_1 = x_0 + sum b_c k_c``."""
        return np.asarray(self.states + self.scheme.weights @ self.slopes)

    @property
    def end(self) -> Array:
        return self.ends[-1]

    @property
    def last(self) -> float:
        return self.start + self.duration

    def with_slopes(self, slopes: Array, velocities: Array | None) -> TrajectorySegment:
        """The flight from the same states with other slopes inside, and what is known of its mesh;
        `replace` would find that out again."""
        other, ends = object.__new__(TrajectorySegment), self.states + self.scheme.weights @ slopes
        vars(other).update(vars(self), slopes=slopes, velocities=velocities, ends=ends)
        return other

    def at(self, s: Array) -> Array:
        """States at times from 0 to 1, shape (n, len(s))."""
        j, place = self.places(s)
        moved = np.einsum("scn,sc->ns", self.slopes[j], self.scheme.spread(place))
        return np.asarray(self.states[j].T + moved)

    def rates(self, s: Array) -> Array:
        """Their derivatives in a time from 0 to 1."""
        j, place = self.places(s)
        rates = np.einsum("scn,sc->ns", self.slopes[j], self.scheme.between(place))
        return np.asarray(rates / self.steps[j])  # slopes are those in one interval

    def places(self, s: Array) -> tuple[NDArray[np.intp], Array]:
        """Find the intervals in which times from 0 to 1 lie, and where in these."""
        j = np.clip(np.searchsorted(self.knots, s, side="right") - 1, 0, self.knots.size - 2)
        return j, (s - self.knots[j]) / self.steps[j]

    def on(self, knots: Array, scheme: Collocation | None = None) -> TrajectorySegment:
        """Interpolate on another mesh: a start for it."""
        steps, scheme = np.diff(knots), scheme or self.scheme
        inner = knots[:-1, None] + steps[:, None] * scheme.nodes
        rates = self.rates(inner.ravel()).T.reshape(*inner.shape, -1)
        states, slopes = self.at(knots[:-1]).T, rates * steps[:, None, None]
        return replace(self, scheme=scheme, knots=knots, states=states, slopes=slopes)

    def for_perturbations(self, decay: Array) -> TrajectorySegment:
        """Interpolate at the points by which small perturbations decay, where they do so by this
        (of `Slopes`) in each interval: itself, or Radau's.

        The growth of the Gauss method is next to e^z for z about as small as its points are many,
        and tends to +-1: where in every interval volumes shrink by more it would let live on what
        decays fast.
        """
        fast = np.minimum.reduce(decay) > self.scheme.points
        return self.on(self.knots, self.scheme.decaying) if fast else self

    def halved(self) -> TrajectorySegment:
        """Interpolate on twice as many intervals, of few states of the highest order: the tail
        after a jump is in one of them, however many they are."""
        between = 0.5 * (self.knots[1:] + self.knots[:-1])
        knots = np.insert(self.knots, range(1, self.knots.size), between)
        points = _MOST_POINTS if self.dimension < _MANY else self.scheme.points
        return self.on(knots, Collocation(2 * self.scheme.intervals, points))

    def resting(self, state: Array) -> TrajectorySegment:
        """Return one of the same mesh that stays in a state, as one that lasts no time does."""
        states, slopes = state + 0.0 * self.states, 0.0 * self.slopes
        return replace(self, states=states, slopes=slopes)

    def sampled(self, per: int) -> tuple[Array, Array]:
        """Times from 0 to 1, `per` in each interval, and the states there, shape (n, times)."""
        inside = self.knots[:-1, None] + self.steps[:, None] * (np.arange(per) / per)
        states = self.states[:, None] + self.scheme.looks(per) @ self.slopes
        states = states.reshape(-1, states.shape[-1])
        return np.concatenate([inside.ravel(), [1.0]]), np.concatenate([states, self.end[None]]).T

    # --- the mesh ---------------------------------------------------------------------------------

    def shares(self, sizes: Array, length: float) -> Array:
        """Measure the share of each interval in the motion, in units of a path, and in the time.

        Meshes make all shares equal, 1 here; so they are close where much happens and nowhere too
        wide. The unit of the path is that for which the shares of the time add up to two thirds.
        """
        _, path, still = self._squares(sizes * length, length)
        # Gauss's rule on each interval; where their sum is 1.5, an orbit's share in motion and time
        # together where that in time is 1, the mean share is 1
        paces = np.asarray(np.sqrt(path + still) @ self.scheme.weights)
        return paces * (paces.size / 1.5)

    def share_slopes(self, sizes: Array, length: Array) -> tuple[Array, Array, Array]:
        """Differentiate the shares in the slopes inside, of shape (intervals, points, n), in the
        steps, and in minus the logarithm of the path: one for all, or a column of them."""
        moved, path, still = self._squares(units := sizes * length[..., None], length)
        weights = self.scheme.weights * ((self.knots.size - 1) / 1.5) / np.sqrt(path + still)
        inside = moved * weights[..., None] / units
        steps = still[:, 0] * weights.sum(axis=1) / self.steps
        return inside, steps, np.vecdot(path + (still - (self.steps**2)[:, None]), weights)

    def _squares(self, units: Array, length: Any) -> tuple[Array, Array, Array]:
        """Evaluate the motion at Gauss points, and the squares of what makes a mesh dense: of that,
        and of the least that counts as motion together with the time."""
        moved = self.slopes / units
        # a tenth of its size: what sets out from rest keeps a mesh, doubled it has that twice
        least = 1.0 + (0.1 * self.rounds / length) ** 2
        return moved, np.vecdot(moved, moved), (self.steps**2)[:, None] * least

    def path(self, sizes: Array) -> float:
        """Solve for the unit of the path for which all shares add up to their number."""
        from scipy.optimize import brentq

        def over(length: float) -> float:
            return float(self.shares(sizes, math.exp(length)).mean()) - 1

        longest = 18.4  # its logarithm, in the sizes; at least it is the inverse
        return math.exp(brentq(over, -longest, longest, xtol=1e-14))

    def adapted(self, sizes: Array) -> TrajectorySegment:
        """Interpolate on a mesh with equal shares, as far as interpolation tells."""
        even, flight = np.linspace(0.0, 1.0, self.knots.size), self
        for _ in range(4):
            share = np.append(0.0, np.cumsum(flight.shares(sizes, flight.path(sizes))))
            knots = np.interp(even, share / share[-1], flight.knots)
            knots[0], knots[-1] = 0.0, 1.0
            flight = self.on(knots)
        return flight

    def unresolved(self, least: float = 1e-300) -> tuple[float, float]:
        """Find the largest share of the highest coefficient in the motion, or in the least that is
        no rounding, and when."""
        left = np.maximum.reduce(abs(self.scheme.highest @ self.slopes), axis=1)
        size, j = np.maximum.reduce(abs(self.states), axis=None), int(left.argmax())
        return float(left[j] / max(size, least)), float(self.begins[j])


def states_along(flights: Sequence[TrajectorySegment], t: Array) -> Array:
    """Evaluate flights that follow each other, where they do, as the later one."""
    begins, states = [f.start for f in flights], np.empty((flights[0].dimension, t.size))
    number = np.maximum(np.searchsorted(begins, t, side="right") - 1, 0)
    for i, flight in enumerate(flights):
        mine = number == i
        states[:, mine] = flight.at((t[mine] - flight.start) / flight.duration)
    return states


def sizes_of(
    flights: Sequence[TrajectorySegment], units: Any = 1.0, share: float = 0.1
) -> tuple[Array, ...]:
    """Measure the motion of each state of each flow, or a share of its size; which are small, in
    `units`.

    It is one for all flows of as many states: an orbit that is the same, or its mirror image, in
    one flow as in another has such meshes, too, wherever its branch began.
    """
    sizes: dict[int, Array] = {}
    for flight in flights:
        low, high = (x := flight.sampled(2)[1]).min(axis=1) / units, x.max(axis=1) / units
        # what hardly moves is measured by its value: its motion may be rounding
        moves = np.maximum(high - low, share * np.maximum(high, -low))
        sizes[low.size] = np.maximum(sizes.get(low.size, 0.0), moves)
    most = {n: float(size.max()) for n, size in sizes.items()}
    largest = max(most.values()) or 1.0
    for n, size in sizes.items():
        # and what is zero, as beside a branch that leaves a subspace, by what moves most
        moved = np.where(size < AT_REST * most[n], most[n], np.maximum(size, 1e-3 * most[n]))
        sizes[n] = moved if most[n] >= AT_REST * largest else np.full(n, largest)
    return tuple(sizes[flight.states.shape[1]] * units for flight in flights)


class Slopes(NamedTuple):
    """Derivatives of a flight: of the state where each interval ends, and of the slopes inside.

    The last axis is one entry for each state where the interval begins, the time at which it
    begins, its length, and each parameter asked for.
    """

    ends: Array  # (intervals, n, n + 2 + parameters)
    inside: Array  # (intervals, points n, n + 2 + parameters)
    field: Array  # (intervals, points, n): h f, which slopes inside are where they are solved for
    decay: Array  # (intervals,): by e to so much it shrinks volumes
    rates: Array  # (intervals, n, n): of perturbations, mean values times the length
    inverse: Any = None  # (intervals, points n, points n), of the equations for these

    def beside(
        self, flight: TrajectorySegment, p: Params, other: TrajectorySegment, q: Params,
        names: tuple[str, ...],
    ) -> Array:  # fmt: skip
        """Estimate the slopes inside of another flight, at parameters q, than one near by, at p, to
        first order; or of several that are as one."""
        (count, n), shape = flight.states.shape, flight.slopes.shape
        change = np.empty((len(other.states) // count, count, self.inside.shape[-1], 1))
        change[..., :n, 0] = other.states.reshape(-1, count, n) - flight.states
        change[..., n, 0] = other.begins.reshape(-1, count) - flight.begins
        change[..., n + 1, 0] = other.lengths.reshape(-1, count) - flight.lengths
        for j, name in enumerate(names, n + 2):
            change[..., j, :] = q[name] - p[name]
        moved = (self.inside @ change).reshape(-1, *shape)
        return np.asarray((flight.slopes + moved).reshape(-1, *shape[1:]))


def as_one_flight(flights: Sequence[TrajectorySegment]) -> TrajectorySegment:
    """Flights of one flow as one: each interval is solved for by itself."""
    whole, many = object.__new__(TrajectorySegment), len(flights[0].states)
    parts = ("states", "slopes", "marks", "steps", "begins", "lengths", "inner")
    of = {name: np.concatenate([getattr(flight, name) for flight in flights]) for name in parts}
    durations = np.repeat([flight.duration for flight in flights], many)[:, None, None]
    vars(whole).update(vars(flights[0]), **of, duration=durations)
    return whole


def flown(
    flow: Flow,
    flight: TrajectorySegment,
    p: Params,
    unit: float,
    near: tuple[Array, Array | None, float] | None = None,
    error: float = ROUNDING,
) -> TrajectorySegment:
    """Solve for the slopes inside of a flight from its states on.

    To an error relative to what moves, at least `unit`. From what `FlowEquations` says of places
    `near`, without any from slopes as they are where each interval begins; or from its own, those
    where all began. Raises `Undefined` where it does not converge.
    """
    if not near:
        f = values(flow.f, flight.begins, flight.states.T, p).T * flight.lengths[:, None]
        near = np.repeat(f[:, None], flight.scheme.points, axis=1), None, 0.0
    try:  # asked most of all, it makes no context
        return flight.with_slopes(*_newton(flow, flight, p, *near, unit, error))
    except Undefined:
        return flight.with_slopes(*_newton(flow, flight, p, flight.slopes, None, 0.0, unit, error))


@quiet
def _newton(
    flow: Flow, flight: TrajectorySegment, p: Params, k: Array, inverse: Array | None,
    second: float, unit: float, error: float,
) -> tuple[Array, Array | None]:  # fmt: skip
    """Newton's iteration for the slopes inside of all intervals; an inverse serves as long as it
    makes corrections shrink. Next to these the velocities where intervals begin, if they came."""
    before, lengths, good = np.inf, flight.lengths[:, None, None], False
    # where all is at rest slopes count as a tenth of what moves
    moves = max(np.maximum.reduce(abs(k), axis=None), 0.1 * unit)
    t, count, first_order = flight.inner, k[..., 0].size, inverse is not None
    if error <= ROUNDING:  # what is exact is asked for its velocities, too
        t = np.concatenate([t, flight.begins])
    for _ in range(12):
        if fresh := inverse is None:
            linear = derivatives(flow, flight, k, p)
            h_f, inverse, good, velocities = linear.field, linear.inverse, True, None
        else:
            x = reached(flight, k)
            x = x if t.size == count else np.concatenate([x, flight.states.T], axis=1)
            f = calling(flow.f, t, x, p)(t, x, p).T
            h_f, velocities = f[:count].reshape(k.shape) * lengths, f[count:]
        # k_c - h f(x_0 + sum a_cd k_d) is off: with an inverse from elsewhere convergence is linear
        step = (inverse @ (k - h_f).reshape(-1, *inverse.shape[:2], 1)).reshape(k.shape)
        k = k - step
        size = float(np.maximum.reduce(abs(step), axis=None) / moves)
        # a correction shrinks by as much as the one before; to first order a guess was off by the
        # square of a distance, in proportion to which the inverse is off
        first = math.sqrt(size + second / moves) if first_order else 1.0
        rate = size / before if before < np.inf else first
        # and nearly at its size it may stop shrinking
        done = min(size, size * rate) <= error
        if not done and good and size >= 0.5 * before:
            done = before <= (_rounding(linear, flight, moves) if fresh else 1e-9)
        if done:
            return k, velocities if t.size > count else None
        # one from elsewhere is good once it has made a correction shrink, to a twentieth at least
        shrunk = size <= 0.05 * before
        good = good or (shrunk and before < np.inf)
        if not (fresh or shrunk):
            inverse = None
        before = size
    worst = int(abs(step).max(axis=(1, 2)).argmax())
    raise Undefined(
        f"the interval of the mesh from t = {flight.begins[worst]:.6g} on is too long for its "
        "flow: more intervals are needed, or the period grows without bound"
    )


def _rounding(linear: Slopes, flight: TrajectorySegment, moves: float) -> float:
    """Size of corrections, relative to what moves, that may be rounding of states alone: an
    interval magnifies it as perturbations grow."""
    of_rates = abs(linear.rates) @ abs(flight.states)[..., None]
    magnified = abs(linear.inverse) @ np.tile(of_rates, (1, flight.scheme.points, 1))
    return max(1e-9, float(ROUNDING * magnified.max() / moves))


def derivatives(
    flow: Flow, flight: TrajectorySegment, k: Array, p: Params, names: tuple[str, ...] = (),
    once: bool = False,
) -> Slopes:  # fmt: skip
    """Exact derivatives of a flight with these slopes inside, of all intervals at once; `once`
    leaves out the inverse, which takes longer than to solve for them."""
    (count, points, n), scheme, lengths = k.shape, flight.scheme, flight.lengths[:, None, None]
    f, df = slopes(flow.f, flight.inner, reached(flight, k), p, names)
    f = f.T.reshape(k.shape)
    whole = np.ascontiguousarray(df.transpose(2, 0, 1)).reshape(*k.shape, -1) * lengths[..., None]
    # d(h f)/dh at the time t_0 + c h of a node: f + h f_t c
    longer = f + whole[..., n] * scheme.nodes[:, None]
    # of h f at each Gauss point, in the state, the time, the length of the interval, parameters
    right = np.concatenate([whole[..., : n + 1], longer[..., None], whole[..., n + 1 :]], axis=-1)
    jacobian, right = right[..., :n], right.reshape(count, points * n, -1)
    # (1 - h A f_x) dk = d(h f), what holds along any change of start, time, length, parameter
    inverse = None if once else _inverse(scheme, jacobian)
    inside = _solved(_equations(scheme, jacobian), right) if inverse is None else inverse @ right
    rates = np.einsum("jcab,c->jab", jacobian, scheme.weights)
    decay = -rates.trace(0, 1, 2)
    ends, width = scheme.weights @ inside.reshape(count, points, -1), right.shape[-1]
    ends[:, : n * (width + 1) : width + 1] += 1.0  # of the state in itself
    return Slopes(ends.reshape(count, n, width), inside, f * lengths, decay, rates, inverse)


def _inverse(scheme: Collocation, jacobian: Array) -> Array:
    """Invert the equations for the slopes inside, of all intervals, from h f_x at Gauss points.

    Where the states are positions and then their velocities, u' = v, half of them are eliminated:

        |    1     -h A    |         S = 1 - h A f_v - h^2 A^2 f_u
        | -h A f_u  1 - h A f_v |
    """
    (count, points, n, _), m, A = jacobian.shape, jacobian.shape[2] // 2, scheme.matrix
    long = jacobian[:, :, :1, m : m + 1] if n > 1 else jacobian  # h, if so
    if n % 2 or not (jacobian[:, :, :m] == long * np.eye(m, n, m)).all():
        return _solved(_equations(scheme, jacobian))
    h, of_u, of_v = long[..., None], jacobian[:, :, m:, :m], jacobian[:, :, m:, m:]
    schur = of_u[:, :, :, None] * (-h * (A @ A)[:, None, :, None])
    if of_v.any():
        schur -= of_v[:, :, :, None] * A[:, None, :, None]
    inner = _solved(schur).reshape(count, points, m, points, m)
    inverse = np.empty((count, points, n, points, n))
    inverse[:, :, m:, :, m:] = inner
    # S^-1 h A f_u
    turned = inner.transpose(0, 3, 1, 2, 4).reshape(count, points, points * m, m) @ of_u
    turned = np.tensordot(turned, A, axes=(1, 0)).reshape(count, points, m, m, points)
    inverse[:, :, m:, :, :m] = turned.transpose(0, 1, 2, 4, 3)
    lower = inverse[:, :, m:].reshape(count, points, -1)
    upper = inverse[:, :, :m]
    upper[...] = (A @ lower).reshape(upper.shape) * h
    np.einsum("jcici->jci", upper[..., :m])[...] += 1.0  # a view
    return inverse.reshape(count, points * n, points * n)


def _equations(scheme: Collocation, jacobian: Array) -> Array:
    """Those for the slopes inside, less 1."""
    # entry (c i, d j) of the equations for dk is delta - a_cd h df_i/dx_j at node c
    return jacobian[:, :, :, None] * -scheme.matrix[:, None, :, None]


def _solved(matrix: Array, right: Array | None = None) -> Array:
    """Invert 1 + matrix, of shape (intervals, points, n, points, n), or solve with it."""
    size = matrix.shape[1] * matrix.shape[2]
    matrix = np.ascontiguousarray(matrix).reshape(-1, size * size)
    matrix[:, :: size + 1] += 1.0
    if not np.isfinite(matrix.sum()):
        raise Undefined("the vector field is not finite")
    try:
        matrix = matrix.reshape(-1, size, size)
        return np.asarray(
            np.linalg.solve(matrix, right) if right is not None else np.linalg.inv(matrix)
        )
    except np.linalg.LinAlgError as error:
        raise Undefined("an interval of the mesh is too long for its flow") from error


def fitted(
    scheme: Collocation,
    start: float,
    duration: float,
    motion: Callable[[Array], Array],
    knots: Array | None = None,
) -> TrajectorySegment:
    """Fit a flight through states known at all times, ``motion(t) -> (n, len(t))``, on a uniform
    mesh unless one is given.

    The slopes are those of the polynomial through the beginning and the Gauss points.
    """
    knots = np.linspace(0.0, 1.0, scheme.intervals + 1) if knots is None else knots
    inner = knots[:-1, None] + np.diff(knots)[:, None] * scheme.nodes
    states = motion(start + duration * knots[:-1]).T
    reached = motion(start + duration * inner.ravel()).T.reshape(*inner.shape, -1)
    slopes = np.asarray(np.linalg.solve(scheme.matrix, reached - states[:, None]))  # A k = x - x_0
    return TrajectorySegment(scheme, knots, start, duration, states, slopes)


def reached(flight: TrajectorySegment, k: Array) -> Array:
    """The states at all Gauss points for these slopes there, shape (n, intervals points)."""
    inside = flight.states[:, None] + flight.scheme.matrix @ k
    return np.asarray(inside.reshape(-1, k.shape[-1]).T)
