"""A ring flown from impact to impact: states, and their slopes, through flows and impacts.

Between impacts the free part of the motion, ``u_n - a f(t)``, turns mode by mode, exactly (18). At
an impact of site n one velocity jumps, ``u_n' -> -k u_n'``. So the state after a section is a
closed form of the state before it and of the impact times, and so is its derivative. Where times
are not set but follow from the impacts, each impact acts on small perturbations by its own
saltation matrix (19): those make the monodromy matrix.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from contbreather.breathers.itinerary import Basis, Itinerary
from contbreather.errors import BadInput
from contbreather.lattice import Forcing, check_gamma
from contbreather.stability.saltation import saltation, saltation_entry

FloatArray = NDArray[np.float64]
Array = NDArray[Any]

SMALL = 0.25  # (w t)^2 below which differences of sine and cosine go by their series
NOWHERE = -1  # in place of the index of an impact: a time that does not move
_SERIES = [1.0 / 3.0, -1.0 / 30.0, 1.0 / 840.0, -1.0 / 45360.0, 1.0 / 3991680.0, -1.0 / 518918400.0]


class Turn(NamedTuple):
    """One free flight of every mode: cosine, sine over w, w times sine."""

    cosine: FloatArray
    reach: FloatArray
    pull: FloatArray

    def __call__(self, q: Array, r: Array) -> tuple[Array, Array]:
        """Displacements and velocities of the modes after the flight; columns at once."""
        c, s, p = (row if q.ndim == 1 else row[:, None] for row in self)
        return c * q + s * r, c * r - p * q


def turn(z: FloatArray, time: Any) -> Turn:
    """The flight over a time (or times, shape ``(..., 1)``) of modes with ``w^2 = z``."""
    w = np.sqrt(z)
    angle = w * time
    sine = np.sin(angle)
    # sin(x)/x for x -> 0, without a warning at the mode that only drifts
    reach = np.divide(sine, w, out=np.broadcast_to(time, angle.shape).astype(float), where=w > 0.0)
    return Turn(np.cos(angle), reach, w * sine)


def turn_slope(z: FloatArray, time: float, at: Turn) -> Turn:
    """Derivative of `turn` in z, exact for w -> 0 as well."""
    x = z * time * time
    series = np.polyval(_SERIES[::-1], np.minimum(x, SMALL))
    safe = np.where(x > SMALL, z, 1.0)
    # (t cos wt - sin(wt)/w)/(2 z)
    reach = np.where(
        x > SMALL, (time * at.cosine - at.reach) / (2.0 * safe), -0.5 * time**3 * series
    )
    return Turn(-0.5 * time * at.reach, reach, at.reach + z * reach)


class Impact(NamedTuple):
    """One impact of a section as it was flown."""

    which: int  # in the itinerary, from 0
    site: int
    wall: int
    time: float
    velocity: float  # of the site that hits, just before
    acceleration: float


class Leg(NamedTuple):
    """One free flight, between two of the times t; the section starts and ends with ``t[0]``."""

    start: int  # index of the time it starts at
    stop: int
    since: float
    flight: float  # how long; backwards where an impact overtakes the first one
    q: FloatArray  # the modes at its start
    r: FloatArray
    q_end: FloatArray
    r_end: FloatArray


class Flown(NamedTuple):
    """A section: its legs, and the impacts at the ends of all legs but the last."""

    legs: tuple[Leg, ...]
    turns: tuple[Turn, ...]
    impacts: tuple[Impact, ...]


class Tangents(NamedTuple):
    """Derivatives along a section, each with one column for every variable."""

    walls: FloatArray  # of the wall conditions, (m, ...)
    starts: list[tuple[FloatArray, FloatArray]]  # of the modes at the start of each leg
    Y: FloatArray  # of their displacements at the end of the section, (K, ...)
    R: FloatArray  # of their velocities


@dataclass(frozen=True, eq=False)
class Section:
    """One section flown, from before its first impact to before that impact's return.

    Parameters
    ----------
    itinerary : Itinerary
    t : ndarray, shape (m,)
        Impact times.
    q, r : ndarray, shape (K,)
        Free part ``u - a f`` of displacements and velocities at ``t[0]``, before any impact of the
        section, in the modes of ``itinerary.basis``.
    a, gamma, k : float
    forcing : Forcing
    """

    itinerary: Itinerary
    t: FloatArray
    q: FloatArray
    r: FloatArray
    a: float
    gamma: float
    k: float
    forcing: Forcing

    def __post_init__(self) -> None:
        check_gamma(self.gamma)
        if not 0.0 <= self.k <= 1.0:
            raise BadInput(f"k = {self.k!r}: the restitution coefficient must be in [0, 1].")
        if not np.ptp(self.t) < self.itinerary.length:
            early, late = int(self.t.argmin()) + 1, int(self.t.argmax()) + 1
            raise BadInput(
                f"impact times {self.t.tolist()}: t{late} is a section of length "
                f"{self.itinerary.length:.6g} or more after t{early}, so it has been overtaken by "
                f"the next one of those; list the impacts from t{late} on."
            )

    @property
    def basis(self) -> Basis:
        return self.itinerary.basis

    @cached_property
    def z(self) -> FloatArray:
        """Squared frequencies of the modes."""
        return 4.0 * self.gamma * self.basis.q

    @cached_property
    def shapes(self) -> FloatArray:
        """The modes at the sites of the impacts, by index, shape (m, K)."""
        return _shapes(self.itinerary)

    @cached_property
    def _flown(self) -> Flown:
        start = float(self.t[0])
        # in order of time: impacts of different sites may overtake each other
        lags = sorted((float(time) - start, j) for j, time in enumerate(self.t))
        legs, turns, impacts = [], [], []
        at, now, q, r = 0, 0.0, self.q, self.r
        for lag, j in [*lags, (self.itinerary.length, 0)]:
            fly = turn(self.z, lag - now)
            q_end, r_end = fly(q, r)
            legs.append(Leg(at, j, start + now, lag - now, q, r, q_end, r_end))
            turns.append(fly)
            if len(legs) > len(lags):
                break
            impacts.append(self._impact(j, start + lag, q_end, r_end))
            loss = (1.0 + self.k) * impacts[-1].velocity
            at, now, q, r = j, lag, q_end, r_end - loss * self.shapes[j]
        return Flown(tuple(legs), tuple(turns), tuple(impacts))

    def _impact(self, j: int, time: float, q: FloatArray, r: FloatArray) -> Impact:
        site, wall = self.itinerary.impacts[j]
        e = self.shapes[j]
        velocity = float(e.dot(r)) + self.a * self.forcing.df(time)
        acceleration = self.a * self.forcing.d2f(time) - float((self.z * e).dot(q))
        return Impact(j, site, wall, time, velocity, acceleration)

    @property
    def legs(self) -> tuple[Leg, ...]:
        """The free flights, one more than there are impacts."""
        return self._flown.legs

    @property
    def impacts(self) -> tuple[Impact, ...]:
        """The impacts in order of time."""
        return self._flown.impacts

    # ---------------------------------------------------------------- equations and their slopes

    def residual(self) -> FloatArray:
        """Every impact is on its wall, and the section closes: m + 2K numbers."""
        m, K = self.t.size, self.q.size
        sign, last = self.itinerary.sign, self.legs[-1]
        value = np.empty(m + 2 * K)
        for leg, one in zip(self.legs, self.impacts, strict=False):
            own = float(self.shapes[one.which].dot(leg.q_end))
            value[one.which] = own + self.a * self.forcing.f(one.time) - one.wall
        value[m : m + K] = last.q_end - sign * self.q
        value[m + K :] = last.r_end - sign * self.r
        return value

    def tangents(self, names: Sequence[str] = (), *, state: bool = True) -> Tangents:
        """Derivatives along the flight, in t, q, r (unless `state` is False), then in `names`."""
        m, K, own = self.t.size, self.q.size, np.arange(self.q.size)
        width = (m + 2 * K) * state
        walls = np.zeros((m, width + len(names)))
        Y, R = np.zeros((2, K, width + len(names)))
        if state:
            Y[own, m + own] = R[own, m + K + own] = 1.0
        starts = []
        for leg, fly, one in zip(self.legs, self._flown.turns, [*self.impacts, None], strict=True):
            starts.append((Y, R))
            Y, R = self._carried(leg, fly, Y, R, names, state)
            if one is None:
                break
            e = self.shapes[one.which]
            wall, speed = e @ Y, e @ R
            wall[width:] += [self.driven(name, one.time, 0) for name in names]
            speed[width:] += [self.driven(name, one.time, 1) for name in names]
            if state:
                wall[one.which] += self.a * self.forcing.df(one.time)
                speed[one.which] += self.a * self.forcing.d2f(one.time)
            loss = (1.0 + self.k) * speed
            loss[width:] += [one.velocity if name == "k" else 0.0 for name in names]
            walls[one.which] = wall
            R = R - np.multiply.outer(e, loss)
        return Tangents(walls, starts, Y, R)

    def _carried(
        self, leg: Leg, fly: Turn, Y: Array, R: Array, names: Sequence[str], state: bool
    ) -> tuple[Array, Array]:
        """Derivatives at the end of a leg from those at its start; its ends in time move."""
        Y, R = fly(Y, R)
        if state:
            pull = self.z * leg.q_end
            for j, side in ((leg.stop, 1.0), (leg.start, -1.0)):
                if j != NOWHERE:
                    Y[:, j] += side * leg.r_end
                    R[:, j] -= side * pull
        if "gamma" in names:
            y, v = turn_slope(self.z, leg.flight, fly)(leg.q, leg.r)
            column = Y.shape[1] - len(names) + list(names).index("gamma")
            Y[:, column] += 4.0 * self.basis.q * y
            R[:, column] += 4.0 * self.basis.q * v
        return Y, R

    def jacobian(self) -> FloatArray:
        """Derivative of `residual` in (t, q, r), shape ``(m + 2K, m + 2K)``."""
        m, K, own = self.t.size, self.q.size, np.arange(self.q.size)
        found, sign = self.tangents(), self.itinerary.sign
        matrix = np.vstack([found.walls, found.Y, found.R])
        matrix[m + own, m + own] -= sign
        matrix[m + K + own, m + K + own] -= sign
        return matrix

    def sensitivity(self, name: str) -> FloatArray:
        """Derivative of `residual` in a, gamma, k or a parameter of the forcing."""
        found = self.tangents((name,), state=False)
        return np.concatenate([found.walls[:, 0], found.Y[:, 0], found.R[:, 0]])

    def watched(self, site: int, time: float, names: Sequence[str]) -> FloatArray:
        """Displacement, velocity and acceleration of a site at a time (first column), and the
        derivatives of the first two in t, q, r and `names` (the others), shape ``(3, ...)``."""
        T, first = self.itinerary.length, self.legs[1].since
        sections = math.floor((time - first) / T)
        now, side = time - sections * T, self.itinerary.sign**sections
        i = max(j for j, leg in enumerate(self.legs) if j == 1 or (j and leg.since <= now))
        leg, (Y, R) = self.legs[i], self.tangents(names).starts[i]
        fly = turn(self.z, now - leg.since)
        q, r = fly(leg.q, leg.r)
        cut = leg._replace(stop=NOWHERE, flight=now - leg.since, q_end=q, r_end=r)
        Y, R = self._carried(cut, fly, Y, R, names, True)
        e, f = self.basis.at(site), self.forcing
        rows = np.zeros((3, 1 + Y.shape[1]))
        rows[:2, 1:] = side * (e @ Y), side * (e @ R)
        rows[:, 0] = side * e.dot(q), side * e.dot(r), -side * e.dot(self.z * q)
        rows[:, 0] += self.a * f.f(time), self.a * f.df(time), self.a * f.d2f(time)
        for order in (0, 1):
            tail = rows[order, rows.shape[1] - len(names) :]
            tail += [self.driven(name, time, order) for name in names]
        return rows

    def driven(self, name: str, time: float, order: int) -> float:
        """Derivative of ``a f^(order)`` in a or in a parameter of the forcing."""
        f = self.forcing
        if name == "a":
            return float((f.f, f.df, f.d2f)[order](time))
        return self.a * f.f_param(name, time, order) if name in f.params else 0.0

    # -------------------------------------------------------------------------- perturbations

    @cached_property
    def saltations(self) -> tuple[FloatArray, ...]:
        """The 2x2 block of (19) for each impact of `impacts`, with its own velocity and
        acceleration; the side takes no part, both change sign with it."""
        return tuple(
            saltation(self.k, saltation_entry(one.acceleration, one.velocity, self.k))
            for one in self.impacts
        )

    def perturbed(self, y: Array, v: Array) -> tuple[Array, Array]:
        """Small perturbations (columns at once) one section later: flows and saltations."""
        kicks = [*zip(self.impacts, self.saltations, strict=True), None]
        for fly, kick in zip(self._flown.turns, kicks, strict=True):
            y, v = fly(y, v)
            if kick is not None:
                e, S = self.shapes[kick[0].which], kick[1]
                u, w = e @ y, e @ v
                y = y + np.multiply.outer(e, (S[0, 0] - 1.0) * u)
                v = v + np.multiply.outer(e, S[1, 0] * u + (S[1, 1] - 1.0) * w)
        return y, v

    def applied(self, y: FloatArray) -> FloatArray:
        """`monodromy` times a perturbation (q, r), or columns of them, without the matrix."""
        half = self.q.size
        return np.concatenate(self.perturbed(y[:half], y[half:]))

    @cached_property
    def monodromy(self) -> FloatArray:
        """``Q S_m ... Q S_1`` over one section in the modes that impacts see, (2K, 2K)."""
        return self.applied(np.eye(2 * self.q.size))

    def free(self) -> FloatArray:
        """Angles ``w T`` of the modes over a section without impacts."""
        return np.sqrt(self.z) * self.itinerary.length


@lru_cache(maxsize=128)
def _shapes(itinerary: Itinerary) -> FloatArray:
    return itinerary.basis.at(np.array([n for n, _ in itinerary.impacts]))
