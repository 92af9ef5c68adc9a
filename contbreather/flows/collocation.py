"""Gauss collocation: a flow over the intervals of a mesh, and their derivatives.

On each interval the orbit is a polynomial whose slope satisfies the equations at the Gauss points,
which is one step of the Gauss method: only the states and the times where intervals begin are
unknowns of a cycle. What is between is solved for interval by interval, all of them at once.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..checks import whole
from ..continuation.newton import Array, Undefined
from ..errors import BadInput
from . import stages
from .flow import Flow, Params, slopes, values

_MOST_POINTS = 12
_ITERATIONS = 12
_SOLVED = 1e-14  # a correction still to come that is this small, of the slopes, is rounding
_NEARLY = 1e-9  # and from this size on they may stop shrinking
_STILL = 0.1  # of what moves: slopes that are smaller, as where all is at rest, count as this
_SHRINKS = 0.05  # by so much a step, or the inverse is made anew
_HALVINGS = 50
_ADAPTIONS = 4
_AT_REST = 1e-7  # how far an orbit goes at least, in its size: what does not move has a mesh, too
_WHOLE = 1.5  # the share of an orbit in motion and time together, where that of the time is 1


@dataclass(frozen=True)
class Collocation:
    """How finely a flow is resolved: intervals, and collocation points in each.

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
        """The same up to 1."""
        return self.spread(np.ones(1))[0]

    @cached_property
    def highest(self) -> Array:
        """From values at the nodes to the coefficient of their highest Legendre polynomial."""
        return np.asarray(np.linalg.inv(self._legendre)[-1])

    @cached_property
    def _legendre(self) -> Array:
        return np.asarray(np.polynomial.legendre.legvander(2 * self.nodes - 1, self.points - 1))

    def spread(self, at: Array) -> Array:
        """Integrals from 0 to each of `at` of the Lagrange polynomials of the nodes."""
        lifted = np.polynomial.legendre.legint(np.eye(self.points), lbnd=-1, scl=0.5)
        integrals = np.polynomial.legendre.legval(2 * at - 1, lifted).T
        return np.ascontiguousarray(np.linalg.solve(self._legendre.T, integrals.T).T)

    def between(self, at: Array) -> Array:
        """Lagrange polynomials of the nodes, at each of `at`."""
        values = np.polynomial.legendre.legvander(2 * at - 1, self.points - 1)
        return np.asarray(np.linalg.solve(self._legendre.T, values.T).T)


@dataclass(frozen=True, eq=False)
class Flight:
    """One flow over its duration: states where its intervals begin, and the slopes inside.

    Attributes
    ----------
    scheme : Collocation
    knots : ndarray, shape (intervals + 1,)
        Where intervals meet, from 0 to 1 in units of the duration.
    start, duration : float
    states : ndarray, shape (n, intervals)
    slopes : ndarray, shape (n, intervals, points)
        At the Gauss points, in units of the length of each interval.
    """

    scheme: Collocation
    knots: Array
    start: float
    duration: float
    states: Array
    slopes: Array

    @cached_property
    def steps(self) -> Array:
        """The lengths of its intervals in units of the duration."""
        return np.diff(self.knots)

    @cached_property
    def begins(self) -> Array:
        """The times at which its intervals begin."""
        return np.asarray(self.start + self.duration * self.knots[:-1])

    @cached_property
    def lengths(self) -> Array:
        """How long they last."""
        return np.asarray(self.duration * self.steps)

    @cached_property
    def times(self) -> Array:
        """The times of all Gauss points."""
        return np.asarray(self.begins[:, None] + self.lengths[:, None] * self.scheme.nodes).ravel()

    @cached_property
    def ends(self) -> Array:
        """States where they end, shape (n, intervals)."""
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
        return np.asarray(rates / self.steps[j])

    def places(self, s: Array) -> tuple[NDArray[np.intp], Array]:
        """The intervals in which times from 0 to 1 lie, and where in these."""
        j = np.clip(np.searchsorted(self.knots, s, side="right") - 1, 0, self.knots.size - 2)
        return j, (s - self.knots[j]) / self.steps[j]

    def on(self, knots: Array) -> Flight:
        """The same flight on another mesh, by interpolation: a start for it."""
        steps = np.diff(knots)
        inner = knots[:-1, None] + steps[:, None] * self.scheme.nodes
        rates = self.rates(inner.ravel()).reshape(len(self.states), *inner.shape)
        states, slopes = self.at(knots[:-1]), rates * steps[:, None]
        return Flight(self.scheme, knots, self.start, self.duration, states, slopes)

    def halved(self) -> Flight:
        """The same flight on twice as many intervals."""
        between = 0.5 * (self.knots[1:] + self.knots[:-1])
        knots = np.insert(self.knots, range(1, self.knots.size), between)
        scheme = replace(self.scheme, intervals=2 * self.scheme.intervals)
        return replace(self.on(knots), scheme=scheme)

    def sampled(self, per: int) -> tuple[Array, Array]:
        """Times from 0 to 1, `per` in each interval, and the states there."""
        places = np.arange(per) / per
        inside = self.knots[:-1, None] + self.steps[:, None] * places
        states = self.states[..., None] + self.slopes @ self.scheme.spread(places).T
        flat = states.reshape(len(self.states), -1)
        return np.append(inside, 1.0), np.hstack([flat, self.end[:, None]])

    def shares(self, sizes: Array, length: float) -> tuple[Array, Array, Array]:
        """The share of each interval in the motion, with a path of this length, and in the time.

        The slope in the slopes inside, of shape (n, intervals, points), and minus that in the
        logarithm of the path come with it. Meshes make all shares equal, 1 here; so they are close
        where much happens and nowhere too wide. The unit of the path is that for which the shares
        of the time add up to two thirds.
        """
        steps, moved = self.steps[:, None], self.slopes / sizes[:, None, None] / length
        path = (steps * _AT_REST / length) ** 2 + (moved**2).sum(axis=0)
        pace = np.sqrt(steps**2 + path)
        unit = self.scheme.weights * (self.knots.size - 1) / _WHOLE
        slope = unit * moved / sizes[:, None, None] / length / pace
        return pace @ unit, slope, (path / pace) @ unit

    def path(self, sizes: Array) -> float:
        """The unit of the path for which all shares add up to their number, or a little more."""
        low, high = 1e-8, 1e8
        for _ in range(_HALVINGS):
            length = math.sqrt(low * high)
            long = self.shares(sizes, length)[0].mean() > 1.0
            low, high = (length, high) if long else (low, length)
        return high

    def adapted(self, sizes: Array) -> Flight:
        """The same flight on a mesh with equal shares, as far as interpolation tells."""
        even, flight = np.linspace(0.0, 1.0, self.knots.size), self
        for _ in range(_ADAPTIONS):
            share = np.append(0.0, np.cumsum(flight.shares(sizes, flight.path(sizes))[0]))
            knots = np.interp(even, share / share[-1], flight.knots)
            knots[0], knots[-1] = 0.0, 1.0
            flight = self.on(knots)
        return flight

    def unresolved(self) -> tuple[float, float]:
        """The largest share of the highest coefficient in the motion, and where."""
        left = abs(self.slopes @ self.scheme.highest) / (abs(self.states).max() or 1.0)
        j = int(left.max(axis=0).argmax())
        return float(left.max()), float(self.knots[j])


# Of the matrices of the stage equations, and their pivots, one for each interval.
Factors = tuple[Array, NDArray[np.int64]]


@dataclass(frozen=True, eq=False)
class Slopes:
    """Derivatives of a flight: of the state where each interval ends, and of the slopes inside.

    The last axis is one entry for each state where the interval begins, the time at which it
    begins, its length, and each parameter asked for.
    """

    ends: Array  # (intervals, n, n + 2 + parameters)
    inside: Array  # (intervals, points, n, n + 2 + parameters)
    factors: Factors

    def beside(self, own: Flight, other: Flight, moved: Sequence[float]) -> Array:
        """To first order the slopes inside of another flight than their own, for parameters that
        moved."""
        ways = [other.begins - own.begins, other.lengths - own.lengths]
        ways += [np.full(own.lengths.size, by) for by in moved]
        change = np.vstack([other.states - own.states, *ways]).T
        return own.slopes + (self.inside @ change[:, None, :, None])[..., 0].transpose(2, 0, 1)


@np.errstate(all="ignore")  # what grows without bound is seen where it is solved for
def flown(
    flow: Flow,
    flight: Flight,
    p: Params,
    unit: float,
    near: tuple[Array, Factors | None] | None = None,
) -> Flight:
    """The flight from these states on, solved for the slopes inside.

    To rounding, `unit` being how much moves. From a guess of these, `near`, perhaps with factors
    of near by; from what a Runge-Kutta method gives, or where the flow is stiff from slopes as
    they are where each interval begins.

    Raises `Undefined` where it does not converge or the vector field has no value.
    """
    for way in (near, _predicted, _constant) if near else (_predicted, _constant):
        try:
            guess, factors = (way(flow, flight, p), None) if callable(way) else way
            return replace(flight, slopes=_newton(flow, flight, p, guess, factors, unit))
        except Undefined as error:
            failed = error
    raise failed


def _newton(
    flow: Flow, flight: Flight, p: Params, guess: Array, factors: Factors | None, unit: float
) -> Array:
    """Newton's iteration for the slopes inside of all intervals; factors serve as long as they
    make corrections shrink."""
    before, k, lengths = np.inf, guess.copy(), flight.lengths
    still = _STILL * max(unit, abs(flight.states).max())
    f, answer = np.empty(k.shape), np.empty(1)
    step, correct = np.empty((lengths.size, 1, k[:, 0].size)), None
    for _ in range(_ITERATIONS):
        fresh = factors is None
        if factors is None:
            found, df = _inside(flow, flight, k, p, ())
            factors, correct = _factorised(flight, df), None
        else:
            found = values(flow.f, *_gauss(flight, k), p)
        f[...] = found.reshape(k.shape)
        if correct is None:
            correct = stages.CORRECT.following(*factors, lengths, f, step, k, answer)
        correct(still)
        size = answer.item()
        shrunk = min(1.0, size / before) if before < np.inf else 1.0  # as the next one would be
        if size * shrunk <= _SOLVED or (before <= _NEARLY and shrunk >= 0.5):
            return k
        if not (fresh or size <= _SHRINKS * before):
            factors = None
        before = size
    raise Undefined(
        "an interval of the mesh is too long for its flow: the period grows without bound, or more "
        "intervals are needed"
    )


def _constant(flow: Flow, flight: Flight, p: Params) -> Array:
    slopes = values(flow.f, flight.begins, flight.states, p) * flight.lengths
    return np.repeat(slopes[..., None], flight.scheme.points, axis=2)


def _predicted(flow: Flow, flight: Flight, p: Params) -> Array:
    """The slopes inside by the classical Runge-Kutta method, from node to node."""
    x, t, lengths = flight.states, flight.begins, flight.lengths
    found, f = [], flow.f
    for step in np.diff(flight.scheme.nodes, prepend=0.0):
        h = step * lengths
        one = values(f, t, x, p)
        two = values(f, t + h / 2, x + h / 2 * one, p)
        three = values(f, t + h / 2, x + h / 2 * two, p)
        four = values(f, t + h, x + h * three, p)
        x, t = x + h / 6 * (one + 2 * two + 2 * three + four), t + h
        found.append(values(f, t, x, p) * lengths)
    return np.stack(found, axis=-1)


def derivatives(flow: Flow, flight: Flight, p: Params, names: tuple[str, ...]) -> Slopes:
    """Exact derivatives of a flight, of all intervals at once."""
    (n, count, points), scheme = flight.slopes.shape, flight.scheme
    f, df = _inside(flow, flight, flight.slopes, p, names)
    factors = _factorised(flight, df)
    many = n + 2 + len(names)
    inside, ends = np.empty((count, many, points * n)), np.empty((count, n, many))
    stages.SENSITIVITIES(
        *factors, flight.lengths, scheme.nodes, scheme.weights, f.reshape(n, count, points), df,
        inside, ends,
    )  # fmt: skip
    return Slopes(ends, inside.reshape(count, many, points, n).transpose(0, 2, 3, 1), factors)


def fitted(
    scheme: Collocation,
    start: float,
    duration: float,
    motion: Callable[[Array], Array],
    knots: Array | None = None,
) -> Flight:
    """A flight through states known at all times, ``motion(t) -> (n, len(t))``, on a uniform mesh
    unless one is given.

    The slopes are those of the polynomial through the beginning and the Gauss points.
    """
    knots = np.linspace(0.0, 1.0, scheme.intervals + 1) if knots is None else knots
    inner = knots[:-1, None] + np.diff(knots)[:, None] * scheme.nodes
    states = motion(start + duration * knots[:-1])
    rises = motion(start + duration * inner.ravel()).reshape(len(states), *inner.shape)
    rises = rises - states[..., None]
    slopes = np.asarray(np.linalg.solve(scheme.matrix, rises[..., None])[..., 0])
    return Flight(scheme, knots, start, duration, states, slopes)


def _inside(
    flow: Flow, flight: Flight, k: Array, p: Params, names: tuple[str, ...]
) -> tuple[Array, Array]:
    """The vector field and its derivatives at all Gauss points."""
    return slopes(flow.f, *_gauss(flight, k), p, names)


def _gauss(flight: Flight, k: Array) -> tuple[Array, Array]:
    """Times and states of all Gauss points."""
    states = flight.states[..., None] + k @ flight.scheme.matrix.T
    return flight.times, states.reshape(len(k), -1)


def _factorised(flight: Flight, df: Array) -> Factors:
    """Of the linear equations for the slopes of each interval."""
    size = len(df) * flight.scheme.points
    factors = np.empty((flight.lengths.size, size, size))
    pivots, answer = np.empty(factors.shape[:2], np.int64), np.empty(1)
    stages.FACTORISE(df, flight.lengths, flight.scheme.matrix, factors, pivots, answer)
    if not np.isfinite(answer[0]):
        raise Undefined("the vector field is not finite")
    if not answer[0]:
        raise Undefined("an interval of the mesh is too long for its flow")
    return factors, pivots
