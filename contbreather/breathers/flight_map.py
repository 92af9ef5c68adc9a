"""A lattice flown from impact to impact: states, and their slopes, through flows and impacts.

Between impacts the free part of the motion, ``u_n - a f_n(t)``, turns mode by mode, exactly (18).
At an impact of site n one velocity jumps, ``u_n' -> -k u_n'``. So the state after a section is a
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

from contbreather.breathers.itinerary import Itinerary
from contbreather.errors import BadInput
from contbreather.flows.modes import Driven, Turn, driven, turn, turn_slope, turn_slope_in_damping
from contbreather.lattice.conditions import Conditions
from contbreather.lattice.finite import Basis
from contbreather.stability.saltation import saltation, saltation_entry

FloatArray = NDArray[np.float64]
Array = NDArray[Any]

NOWHERE = -1  # in place of the index of an impact: a time that does not move


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
    conditions : Conditions
    """

    itinerary: Itinerary
    t: FloatArray
    q: FloatArray
    r: FloatArray
    conditions: Conditions

    def __post_init__(self) -> None:
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
        return self.conditions.gamma * self.basis.lam + self.conditions.spring

    @cached_property
    def forced(self) -> Driven:
        """The forced motion of all sites, at unit amplitude."""
        on = self.conditions
        return driven(self.itinerary.lattice, on.forcing, on.gamma, on.spring, on.damping)

    @cached_property
    def shapes(self) -> FloatArray:
        """The modes at the sites of the impacts, by index, shape (m, K)."""
        return _shapes(self.itinerary)

    @cached_property
    def kicks(self) -> FloatArray:
        """What a unit change of velocity at the sites of the impacts does to the modes, (m, K)."""
        masses = self.itinerary.lattice.masses
        return self.shapes * masses[[n for n, _ in self.itinerary.impacts], None]

    @cached_property
    def _flown(self) -> Flown:
        start = float(self.t[0])
        # in order of time: impacts of different sites may overtake each other
        lags = sorted((float(time) - start, j) for j, time in enumerate(self.t))
        legs, turns, impacts = [], [], []
        at, now, q, r = 0, 0.0, self.q, self.r
        for lag, j in [*lags, (self.itinerary.length, 0)]:
            fly = turn(self.z, lag - now, self.conditions.damping)
            q_end, r_end = fly(q, r)
            legs.append(Leg(at, j, start + now, lag - now, q, r, q_end, r_end))
            turns.append(fly)
            if len(legs) > len(lags):
                break
            impacts.append(self._impact(j, start + lag, q_end, r_end))
            loss = (1.0 + self.conditions.k) * impacts[-1].velocity
            at, now, q, r = j, lag, q_end, r_end - loss * self.kicks[j]
        return Flown(tuple(legs), tuple(turns), tuple(impacts))

    def _impact(self, j: int, time: float, q: FloatArray, r: FloatArray) -> Impact:
        site, wall = self.itinerary.impacts[j]
        e, a = self.shapes[j], self.conditions.a
        _, speed, bend = self.forced.at(site, time)
        return Impact(
            j,
            site,
            wall,
            time,
            float(e.dot(r)) + a * speed,
            float(e.dot(self.pulled(q, r))) + a * bend,
        )

    def pulled(self, q: FloatArray, r: FloatArray) -> FloatArray:
        """Acceleration of free modes."""
        damping = self.conditions.damping
        return -self.z * q - damping * r if damping else -self.z * q

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
            forced = self.conditions.a * self.forced.at(one.site, one.time)[0]
            wall = self.conditions.walls.position(one.site, one.wall)
            value[one.which] = own + forced - wall
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
            for i, name in enumerate(names, start=width):
                moved = self.driven(name, one.site, one.time)
                wall[i] += moved[0]
                speed[i] += moved[1]
            if state:
                _, tilt, bend = self.forced.at(one.site, one.time)
                wall[one.which] += self.conditions.a * tilt
                speed[one.which] += self.conditions.a * bend
            loss = (1.0 + self.conditions.k) * speed
            loss[width:] += [one.velocity if name == "k" else 0.0 for name in names]
            walls[one.which] = wall
            R = R - np.multiply.outer(self.kicks[one.which], loss)
        return Tangents(walls, starts, Y, R)

    def _carried(
        self, leg: Leg, fly: Turn, Y: Array, R: Array, names: Sequence[str], state: bool
    ) -> tuple[Array, Array]:
        """Derivatives at the end of a leg from those at its start; its ends in time move."""
        Y, R = fly(Y, R)
        if state:
            pull = self.pulled(leg.q_end, leg.r_end)
            for j, side in ((leg.stop, 1.0), (leg.start, -1.0)):
                if j != NOWHERE:
                    Y[:, j] += side * leg.r_end
                    R[:, j] += side * pull
        damping = self.conditions.damping
        for column, name in enumerate(names, start=Y.shape[1] - len(names)):
            if name == "damping":
                slope = turn_slope_in_damping(self.z, leg.flight, fly, damping)
            elif name in ("gamma", "spring"):
                slope = turn_slope(self.z, leg.flight, fly, damping)
            else:
                continue
            rise = self.basis.lam if name == "gamma" else 1.0
            y, v = slope(leg.q, leg.r)
            Y[:, column] += rise * y
            R[:, column] += rise * v
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
        """Derivative of `residual` in any one parameter."""
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
        fly = turn(self.z, now - leg.since, self.conditions.damping)
        q, r = fly(leg.q, leg.r)
        cut = leg._replace(stop=NOWHERE, flight=now - leg.since, q_end=q, r_end=r)
        Y, R = self._carried(cut, fly, Y, R, names, True)
        e = self.basis.at(site)
        rows = np.zeros((3, 1 + Y.shape[1]))
        rows[:2, 1:] = side * (e @ Y), side * (e @ R)
        rows[:, 0] = side * e.dot(q), side * e.dot(r), side * e.dot(self.pulled(q, r))
        rows[:, 0] += np.multiply(self.conditions.a, self.forced.at(site, time))
        for column, name in enumerate(names, start=rows.shape[1] - len(names)):
            rows[:2, column] += self.driven(name, site, time)
        return rows

    def driven(self, name: str, site: int, time: float) -> tuple[float, float]:
        """Derivatives of the forced displacement and velocity of a site in one parameter."""
        if name == "a":
            return self.forced.at(site, time)[:2]
        u, v = self.forced.slope(name, site, time)
        return self.conditions.a * u, self.conditions.a * v

    # -------------------------------------------------------------------------- perturbations

    @cached_property
    def saltations(self) -> tuple[FloatArray, ...]:
        """The 2x2 block of (19) for each impact of `impacts`, with its own velocity and
        acceleration; the side takes no part, both change sign with it."""
        k, damping = self.conditions.k, self.conditions.damping
        # braked less after the impact than before, a site turns round faster by damping (1 + k) v
        return tuple(
            saltation(k, saltation_entry(one.acceleration, one.velocity, k) + (1.0 + k) * damping)
            for one in self.impacts
        )

    def perturbed(self, y: Array, v: Array) -> tuple[Array, Array]:
        """Small perturbations (columns at once) one section later: flows and saltations."""
        kicks = [*zip(self.impacts, self.saltations, strict=True), None]
        for fly, kick in zip(self._flown.turns, kicks, strict=True):
            y, v = fly(y, v)
            if kick is not None:
                e, kicked, S = self.shapes[kick[0].which], self.kicks[kick[0].which], kick[1]
                u, w = e @ y, e @ v
                y = y + np.multiply.outer(kicked, (S[0, 0] - 1.0) * u)
                v = v + np.multiply.outer(kicked, S[1, 0] * u + (S[1, 1] - 1.0) * w)
        return y, v

    def applied(self, y: FloatArray) -> FloatArray:
        """`monodromy` times a perturbation (q, r), or columns of them, without the matrix."""
        half = self.q.size
        return np.concatenate(self.perturbed(y[:half], y[half:]))

    @cached_property
    def monodromy(self) -> FloatArray:
        """``Q S_m ... Q S_1`` over one section in the modes that impacts see, (2K, 2K)."""
        return self.applied(np.eye(2 * self.q.size))

    @cached_property
    def multipliers(self) -> NDArray[np.complex128]:
        """Eigenvalues of `monodromy`; kept, because events and columns ask for them in turn."""
        return np.linalg.eigvals(self.monodromy).astype(complex)

    def free(self, mu: float) -> FloatArray:
        """``det(flight - mu)`` of each mode over a section without impacts."""
        one, other = free_multipliers(self.z, self.conditions.damping, self.itinerary.length)
        return np.asarray(((one - mu) * (other - mu)).real)


def free_multipliers(
    z: FloatArray, damping: float, time: float
) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Both multipliers of each mode over a flight without impacts, ``exp(+-i w t)`` undamped."""
    w = np.sqrt(z - 0.25 * damping * damping + 0j)
    return np.exp((1j * w - 0.5 * damping) * time), np.exp((-1j * w - 0.5 * damping) * time)


@lru_cache(maxsize=128)
def _shapes(itinerary: Itinerary) -> FloatArray:
    return itinerary.basis.at(np.array([n for n, _ in itinerary.impacts]))
