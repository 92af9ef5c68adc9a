"""Gauss collocation: a flow over the intervals of a mesh, and their derivatives.

On each interval the orbit is a polynomial whose slope satisfies the equations at the Gauss points,
which is one step of the Gauss method: only the states and the times where intervals begin are
unknowns of a cycle. What is between is solved for interval by interval, all of them at once.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..checks import whole
from ..continuation.newton import Array, Undefined
from ..errors import BadInput
from .flow import Flow, Params, slopes, values

Guess = tuple[Array, Array | None]  # slopes inside, and perhaps an inverse that finds them

_MOST_POINTS, _MANY = 12, 1000  # of so many intervals a mesh that is made finer takes all of them
ROUNDING = 1e-14  # corrections this small, relative to the slopes, are rounding
_NEARLY = 1e-9  # and from this size on they may stop shrinking
_STILL = 0.1  # of what moves: slopes that are smaller, as where all is at rest, count as this
_SHRINKS = 0.05  # by so much a step, or the inverse is made anew
_LONGEST = 18.4  # ln of a path in its sizes, which is at least the inverse
_AT_REST = 0.1  # how far an orbit goes at least, in its size: what sets out from rest keeps a mesh
_WHOLE = 1.5  # the share of an orbit in motion and time together, where that of the time is 1


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
    def matrix(self) -> Array:
        """Integrals of the Lagrange polynomials from 0 to each node: Butcher's matrix."""
        return self.spread(self.nodes)

    @cached_property
    def weights(self) -> Array:
        """Integrals of the Lagrange polynomials from 0 to 1."""
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


@dataclass(frozen=True, eq=False)
class TrajectorySegment:
    """One flow over its duration: states where its intervals begin, and the slopes inside."""

    scheme: Collocation
    knots: Array  # (intervals + 1,), where they meet, from 0 to 1 in units of the duration
    start: float
    duration: float
    states: Array  # (n, intervals)
    slopes: Array  # (n, intervals, points), in units of the length of each interval
    rounds: int = 1  # how many times around the orbit is that it was doubled from

    @cached_property
    def begins(self) -> Array:
        """The times at which its intervals begin."""
        return np.asarray(self.start + self.duration * self.knots[:-1])

    @cached_property
    def steps(self) -> Array:
        """The lengths of its intervals in units of the duration."""
        return np.asarray(self.knots[1:] - self.knots[:-1])

    @cached_property
    def lengths(self) -> Array:
        """Durations of its intervals."""
        return np.asarray(self.duration * self.steps)

    @cached_property
    def inner(self) -> Array:
        """The times of all Gauss points."""
        return (self.begins[:, None] + self.lengths[:, None] * self.scheme.nodes).ravel()

    @cached_property
    def ends(self) -> Array:
        """States where they end, shape (n, intervals): ``x_1 = x_0 + sum b_c k_c``."""
        return np.asarray(self.states + self.slopes @ self.scheme.weights)

    @property
    def end(self) -> Array:
        return self.ends[:, -1]

    @property
    def last(self) -> float:
        """The time at which it ends."""
        return self.start + self.duration

    def at(self, s: Array) -> Array:
        """States at times from 0 to 1, shape (n, len(s))."""
        j, place = self.places(s)
        moved = np.einsum("nsc,sc->ns", self.slopes[:, j], self.scheme.spread(place))
        return np.asarray(self.states[:, j] + moved)

    def rates(self, s: Array) -> Array:
        """Their derivatives in a time from 0 to 1."""
        j, place = self.places(s)
        rates = np.einsum("nsc,sc->ns", self.slopes[:, j], self.scheme.between(place))
        return np.asarray(rates / self.steps[j])  # slopes are those in one interval

    def places(self, s: Array) -> tuple[NDArray[np.intp], Array]:
        """The intervals in which times from 0 to 1 lie, and where in these."""
        j = np.clip(np.searchsorted(self.knots, s, side="right") - 1, 0, self.knots.size - 2)
        return j, (s - self.knots[j]) / self.steps[j]

    def on(self, knots: Array, scheme: Collocation | None = None) -> TrajectorySegment:
        """Interpolate on another mesh: a start for it."""
        steps, scheme = np.diff(knots), scheme or self.scheme
        inner = knots[:-1, None] + steps[:, None] * scheme.nodes
        rates = self.rates(inner.ravel()).reshape(len(self.states), *inner.shape)
        states, slopes = self.at(knots[:-1]), rates * steps[:, None]
        return replace(self, scheme=scheme, knots=knots, states=states, slopes=slopes)

    def halved(self) -> TrajectorySegment:
        """Interpolate on twice as many intervals; where these are many, of the highest order: the
        tail after a jump is in one of them, however many they are."""
        between = 0.5 * (self.knots[1:] + self.knots[:-1])
        knots = np.insert(self.knots, range(1, self.knots.size), between)
        many = 2 * self.scheme.intervals
        points = _MOST_POINTS if many > _MANY else self.scheme.points
        return self.on(knots, Collocation(many, points))

    def sampled(self, per: int) -> tuple[Array, Array]:
        """Times from 0 to 1, `per` in each interval, and the states there."""
        inside = self.knots[:-1, None] + self.steps[:, None] * (np.arange(per) / per)
        states = self.states[..., None] + self.slopes @ self.scheme.looks(per).T
        flat = states.reshape(len(self.states), -1)
        return np.append(inside, 1.0), np.hstack([flat, self.end[:, None]])

    def shares(self, sizes: Array, length: float) -> Array:
        """The share of each interval in the motion, with a path of this length, and in the time.

        Meshes make all shares equal, 1 here; so they are close where much happens and nowhere too
        wide. The unit of the path is that for which the shares of the time add up to two thirds.
        """
        return self._paces(sizes, length)[-1] @ self._unit

    def share_slopes(self, sizes: Array, length: float) -> tuple[Array, Array, Array]:
        """The shares, their slopes in the slopes inside, of shape (n, intervals, points), and minus
        those in the logarithm of the path."""
        moved, path, pace = self._paces(sizes, length)
        slope = moved * (self._unit / pace) / (sizes * length)[:, None, None]
        return pace @ self._unit, slope, (path / pace) @ self._unit

    def _paces(self, sizes: Array, length: float) -> tuple[Array, Array, Array]:
        """Measure its motion at Gauss points, the squares of that, and the density of the mesh."""
        moved, square = self.slopes / (sizes * length)[:, None, None], (self.steps**2)[:, None]
        path = np.einsum("njc,njc->jc", moved, moved) + square * (self._least / length) ** 2
        return moved, path, np.sqrt(square + path)

    @property
    def _least(self) -> float:
        return _AT_REST * self.rounds  # so that a doubled orbit has the same mesh twice

    @property
    def _unit(self) -> Array:
        # Gauss's rule on each interval; where sum(pace @ weights) = _WHOLE the mean share is 1
        return self.scheme.weights * ((self.knots.size - 1) / _WHOLE)

    def path(self, sizes: Array) -> float:
        """The unit of the path for which all shares add up to their number."""
        from scipy.optimize import brentq

        def over(length: float) -> float:
            return float(self.shares(sizes, math.exp(length)).mean()) - 1

        return math.exp(brentq(over, -_LONGEST, _LONGEST, xtol=1e-14))

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
        """The largest share of the highest coefficient in the motion, or in the least that is no
        rounding, and where."""
        left = abs(self.slopes @ self.scheme.highest) / max(abs(self.states).max(), least)
        j = int(left.max(axis=0).argmax())
        return float(left.max()), float(self.knots[j])


@dataclass(frozen=True, eq=False)
class Slopes:
    """Derivatives of a flight: of the state where each interval ends, and of the slopes inside.

    The last axis is one entry for each state where the interval begins, the time at which it
    begins, its length, and each parameter asked for. `inverse` is that of the matrix of the linear
    equations for the slopes inside, of each interval.
    """

    ends: Array  # (intervals, n, n + 2 + parameters)
    inside: Array  # (intervals, points n, n + 2 + parameters)
    inverse: Array  # (intervals, points n, points n)

    def beside(
        self, flight: TrajectorySegment, other: TrajectorySegment, moved: Sequence[float]
    ) -> Array:
        """To first order the slopes inside of another flight than one near by, for parameters that
        moved."""
        n = len(flight.states)
        change = np.empty((flight.steps.size, self.inside.shape[-1], 1))
        change[:, :n, 0] = (other.states - flight.states).T
        change[:, n, 0] = other.begins - flight.begins
        change[:, n + 1, 0] = other.lengths - flight.lengths
        change[:, n + 2 :, 0] = moved
        return flight.slopes + _by_states(self.inside @ change, flight)


@np.errstate(all="ignore")  # what grows without bound is seen where it is solved for
def flown(
    flow: Flow,
    flight: TrajectorySegment,
    p: Params,
    unit: float,
    near: Guess | None = None,
    error: float = ROUNDING,
) -> TrajectorySegment:
    """The flight from these states on, solved for the slopes inside.

    To an error relative to what moves, at least `unit`. From a guess of these, `near`, perhaps with
    an inverse of one near by; or from slopes as they are where each interval begins.

    Raises `Undefined` where it does not converge or the vector field has no value.
    """
    if near:
        with suppress(Undefined):
            return replace(flight, slopes=_newton(flow, flight, p, near, unit, error))
    k = values(flow.f, flight.begins, flight.states, p) * flight.lengths
    k = np.repeat(k[..., None], flight.scheme.points, axis=2)
    return replace(flight, slopes=_newton(flow, flight, p, (k, None), unit, error))


def _newton(
    flow: Flow, flight: TrajectorySegment, p: Params, near: Guess, unit: float, error: float
) -> Array:
    """Newton's iteration for the slopes inside of all intervals; an inverse serves as long as it
    makes corrections shrink."""
    (k, inverse), before, lengths, good = near, np.inf, flight.lengths[:, None], False
    moves = max(abs(k).max(), _STILL * max(unit, abs(flight.states).max()))
    for _ in range(12):
        fresh = inverse is None
        good = good or fresh
        if inverse is None:
            f, df = slopes(flow.f, flight.inner, _reached(flight, k), p)
            inner = df[:, : len(k)].reshape(len(k), *k.shape) * lengths
            inverse = _inverted(_matrix(flight.scheme, inner.transpose(2, 3, 0, 1)))
        else:
            f = values(flow.f, flight.inner, _reached(flight, k), p)
        off = (k - f.reshape(k.shape) * lengths).transpose(1, 2, 0)
        # k_c - h f(x_0 + sum a_cd k_d) is off: with an inverse from elsewhere convergence is linear
        step = inverse @ off.reshape(len(off), -1, 1)
        k = k - _by_states(step, flight)
        size = float(abs(step).max() / moves)
        # a correction shrinks by as much as the one before
        ahead = size if before == np.inf else size * size / before
        if min(size, ahead) <= error or (good and before <= _NEARLY and size >= 0.5 * before):
            return k
        # one from elsewhere is good once it has made a correction shrink
        good = good or size <= _SHRINKS * before < np.inf
        if not (fresh or size <= _SHRINKS * before):
            inverse = None
        before = size
    worst = int(abs(step).max(axis=(1, 2)).argmax())
    raise Undefined(
        f"the interval of the mesh from t = {flight.begins[worst]:.6g} on is too long for its "
        "flow: more intervals are needed, or the period grows without bound"
    )


def derivatives(flow: Flow, flight: TrajectorySegment, p: Params, names: tuple[str, ...]) -> Slopes:
    """Exact derivatives of a flight, of all intervals at once."""
    n, scheme, count = len(flight.states), flight.scheme, flight.steps.size
    f, df = slopes(flow.f, flight.inner, _reached(flight, flight.slopes), p, names)
    shape = count, scheme.points, n
    # of h f at each Gauss point, in the state, the time, the length of the interval, parameters
    right = np.empty((*shape, n + 2 + len(names)))
    whole = (df.reshape(n, -1, count, scheme.points) * flight.lengths[:, None]).transpose(
        2, 3, 0, 1
    )
    right[..., : n + 1], right[..., n + 2 :] = whole[..., : n + 1], whole[..., n + 1 :]
    # d(h f)/dh at the time t_0 + c h of a node: f + h f_t c
    right[..., n + 1] = f.reshape(n, *shape[:2]).transpose(1, 2, 0)
    right[..., n + 1] += whole[..., n] * scheme.nodes[:, None]
    inverse = _inverted(_matrix(scheme, right[..., :n]))
    # (1 - h A f_x) dk = d(h f), what holds along any change of start, time, length, parameter
    inside = inverse @ right.reshape(count, scheme.points * n, -1)
    ends = (scheme.weights @ inside.reshape(count, scheme.points, -1)).reshape(count, n, -1)
    ends[:, :, :n] += np.eye(n)
    return Slopes(ends, inside, inverse)


def fitted(
    scheme: Collocation,
    start: float,
    duration: float,
    motion: Callable[[Array], Array],
    knots: Array | None = None,
) -> TrajectorySegment:
    """A flight through states known at all times, ``motion(t) -> (n, len(t))``, on a uniform mesh
    unless one is given.

    The slopes are those of the polynomial through the beginning and the Gauss points.
    """
    knots = np.linspace(0.0, 1.0, scheme.intervals + 1) if knots is None else knots
    inner = knots[:-1, None] + np.diff(knots)[:, None] * scheme.nodes
    states = motion(start + duration * knots[:-1])
    rises = motion(start + duration * inner.ravel()).reshape(len(states), *inner.shape)
    rises = rises - states[..., None]
    slopes = np.asarray(np.linalg.solve(scheme.matrix, rises[..., None])[..., 0])  # A k = x - x_0
    return TrajectorySegment(scheme, knots, start, duration, states, slopes)


def _reached(flight: TrajectorySegment, k: Array) -> Array:
    """The states at all Gauss points for these slopes there."""
    return (flight.states[..., None] + k @ flight.scheme.matrix.T).reshape(len(k), -1)


def _by_states(rows: Array, flight: TrajectorySegment) -> Array:
    """Reshape one column for each interval, point by point, to the shape of slopes."""
    return rows.reshape(flight.lengths.size, flight.scheme.points, -1).transpose(2, 0, 1)


def _matrix(scheme: Collocation, inner: Array) -> Array:
    """The matrix of the linear equations for the slopes of each interval, from ``h df/dx`` at its
    Gauss points, shape (intervals, points, n, n)."""
    size = scheme.points * inner.shape[-1]
    # entry (c i, d j) is delta - a_cd h df_i/dx_j at node c
    matrix = inner[:, :, :, None] * -scheme.matrix[:, None, :, None]
    matrix = matrix.reshape(len(inner), size, size)
    np.einsum("jii->ji", matrix)[...] += 1.0  # the diagonals, a view
    return np.asarray(matrix)


def _inverted(matrix: Array) -> Array:
    """A step is one product with it, and serves flights near by as well."""
    if not np.isfinite(matrix.sum()):
        raise Undefined("the vector field is not finite")
    try:
        return np.asarray(np.linalg.inv(matrix))
    except np.linalg.LinAlgError as error:
        raise Undefined("an interval of the mesh is too long for its flow") from error
