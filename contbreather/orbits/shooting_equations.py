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
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from contbreather.lattice.conditions import Conditions
from contbreather.lattice.finite import Basis, Finite
from contbreather.lattice.modal_flow import (
    Driven,
    ModalPropagator,
    check_modes,
    driven_modes,
    free_multipliers,
    propagator,
    propagator_slope,
    propagator_slope_in_damping,
)
from contbreather.orbits.section import Impact, Section, in_turn, told_apart, told_apart_slopes
from contbreather.orbits.site_motion import MODES, FreeModes, in_flight
from contbreather.stability.modal_map import ModalMap, ModalSaltation
from contbreather.stability.saltation import saltation, saltation_entry

FloatArray = NDArray[np.float64]
Array = NDArray[Any]

NOWHERE = -1  # in place of the index of an impact: a time that does not move


class Arrival(NamedTuple):
    """One impact of a section as it was flown."""

    which: int  # in the section, from 0
    site: int
    wall: int
    time: float
    velocity: float  # of the site that hits, just before
    acceleration: float


class ShootingInterval(NamedTuple):
    """One free flight, between two of the times t; the section starts and ends with ``t[0]``."""

    start: int  # index of the time it starts at
    stop: int
    since: float
    flight: float  # how long; backwards where an impact overtakes the first one
    propagator: ModalPropagator
    q: FloatArray  # the modes at its start
    r: FloatArray
    q_end: FloatArray
    r_end: FloatArray
    arrival: Arrival | None  # at its end; none at that of the section


class ResonantModes(NamedTuple):
    """The mode that is closest to closing after a section without any impact."""

    mode: int  # of those that impacts see, by frequency, from 1
    frequency: float
    gap: float  # |exp(i w T) - sign|: 0 in resonance


class Tangents(NamedTuple):
    """Derivatives along a section, each with one column for every variable."""

    walls: FloatArray  # of the wall conditions, (m, ...)
    speeds: FloatArray  # of the velocities before the impacts
    starts: list[tuple[FloatArray, FloatArray]]  # of the modes at the start of each leg
    Y: FloatArray  # of their displacements at the end of the section, (K, ...)
    R: FloatArray  # of their velocities


@dataclass(frozen=True, eq=False)
class SectionTrajectory:
    """One section flown, from before its first impact to before that impact's return.

    Parameters
    ----------
    section : Section
    t : ndarray, shape (m,)
        Impact times.
    q, r : ndarray, shape (K,)
        Free part ``u - a f`` of displacements and velocities at ``t[0]``, before any impact of the
        section, in the modes of `basis`.
    conditions : Conditions
    """

    section: Section
    t: FloatArray
    q: FloatArray
    r: FloatArray
    conditions: Conditions
    offsets: ClassVar[tuple[float, ...]] = ()  # are part of the state

    @cached_property
    def basis(self) -> Basis:
        """The modes that its impacts can excite."""
        basis: Basis = self.conditions.lattice.basis(self.section.hit)
        return basis

    @cached_property
    def z(self) -> FloatArray:
        """Squared frequencies of the modes."""
        return self.conditions.gamma * self.basis.lam + self.conditions.spring  # w^2

    @cached_property
    def forced(self) -> Driven:
        """The forced motion of all sites, at unit amplitude."""
        on = self.conditions
        return driven_modes(self.conditions.lattice, on.forcing, on.gamma, on.spring, on.damping)

    @cached_property
    def shapes(self) -> FloatArray:
        """The modes at the sites of the impacts, by index, shape (m, K)."""
        return _shapes(self.section, self.conditions.lattice)

    @cached_property
    def kicks(self) -> FloatArray:
        """Kicks of the modes by a unit change of velocity at the sites of the impacts, (m, K)."""
        masses = self.conditions.lattice.masses
        return self.shapes * masses[[n for n, _ in self.section.impacts], None]

    @cached_property
    def legs(self) -> tuple[ShootingInterval, ...]:
        """The free flights, one more than there are impacts."""
        start = float(self.t[0])
        lags = [(float(self.t[j]) - start, j) for j in in_turn(self.section, self.t)]
        legs: list[ShootingInterval] = []
        at, now, q, r = 0, 0.0, self.q, self.r
        for lag, j in [*lags, (self.section.length, 0)]:
            fly = propagator(self.z, lag - now, self.conditions.damping)
            end = fly(q, r)
            arrival = self._arrival(j, start + lag, *end) if len(legs) < len(lags) else None
            legs.append(ShootingInterval(at, j, start + now, lag - now, fly, q, r, *end, arrival))
            if arrival is not None:
                loss = (1.0 + self.conditions.k) * arrival.velocity
                at, now, q, r = j, lag, end[0], end[1] - loss * self.kicks[j]  # u' -> -k u'
        return tuple(legs)

    @cached_property
    def arrivals(self) -> tuple[Arrival, ...]:
        """The impacts in order of time."""
        return tuple(leg.arrival for leg in self.legs if leg.arrival is not None)

    def _arrival(self, j: int, time: float, q: FloatArray, r: FloatArray) -> Arrival:
        site, wall = self.section.impacts[j]
        e, a = self.shapes[j], self.conditions.a
        _, speed, acceleration = self.forced.at(site, time)
        velocity, pull = float(e.dot(r)), float(e.dot(self.pulled(q, r)))
        return Arrival(j, site, wall, time, velocity + a * speed, pull + a * acceleration)

    def pulled(self, q: FloatArray, r: FloatArray) -> FloatArray:
        """Acceleration of free modes."""
        damping = self.conditions.damping
        return -self.z * q - damping * r if damping else -self.z * q

    # -------------------------------------------------------------------------------- motion

    @cached_property
    def impacts(self) -> tuple[Impact, ...]:
        loss = -(1.0 + self.conditions.k)  # J = -(1 + k) u'
        in_order = sorted(self.arrivals)
        return tuple(Impact(x.site, x.wall, x.time, loss * x.velocity) for x in in_order)

    @property
    def accelerations(self) -> FloatArray:
        return np.array([arrival.acceleration for arrival in sorted(self.arrivals)])

    @property
    def x(self) -> FloatArray:
        """All unknowns."""
        return np.concatenate([self.t, self.q, self.r])

    @property
    def error(self) -> float:
        return float(abs(self.residual()).max())

    @cached_property
    def c(self) -> float:
        """By how much the lattice as a whole sits off centre, its mean over sites and time."""
        if self.section.symmetric:
            return 0.0
        share = self.basis.at(np.arange(self.conditions.lattice.sites)).mean(axis=0)
        # by Gauss's rule: to rounding for as many nodes, and modes may drift, turn or decay
        nodes, weights = np.polynomial.legendre.leggauss(
            12 + int(math.sqrt(float(self.z.max())) * self.section.length)
        )
        shift = 0.0
        for leg in self.legs:
            times = 0.5 * leg.flight * (1.0 + nodes)[:, None]
            fly = propagator(self.z, times, self.conditions.damping)
            path = fly.cosine * leg.q + fly.reach * leg.r
            shift += 0.5 * leg.flight * float(weights @ (path @ share))
        return shift / self.section.length

    @property
    def chi(self) -> float:
        """Of the impact of one site: where it is without its forced motion, per unit p."""
        (impact,), a = self.impacts, self.conditions.a
        place = self.conditions.walls.position(impact.site, impact.wall)
        return 2.0 * (place - a * self.forced.at(impact.site, impact.time)[0]) / abs(impact.impulse)

    def modes(self, times: FloatArray) -> FloatArray:
        """Free part of displacements and velocities of the modes at times, shape (2, times, K)."""
        out = np.empty((2, times.size, self.z.size))
        MODES(self.free_modes, self.section.length, float(self.section.sign), times, out)
        return out

    @cached_property
    def free_modes(self) -> FreeModes:
        """The flight after each impact, as kernels take them; without shapes and profiles."""
        legs, nobody = self.legs[1:], np.empty((0, 0))
        starts, q, r = (np.array([getattr(leg, x) for leg in legs]) for x in ("since", "q", "r"))
        return FreeModes(starts, q, r, self.z, float(self.conditions.damping), nobody, nobody)

    # ---------------------------------------------------------------- equations and their slopes

    def residual(self) -> FloatArray:
        """Every impact is on its wall, and the section closes: m + 2K numbers."""
        sign, last = self.section.sign, self.legs[-1]
        closing = last.q_end - sign * self.q, last.r_end - sign * self.r
        return np.concatenate([self._walls, *closing])

    def _speed_between(self, i: int, j: int, since: FloatArray) -> FloatArray | None:
        """Of a site from one impact to the next one, at times since then; None where another site
        impacts in between."""
        leg = next(leg for leg in self.legs[1:] if leg.start == i)
        if leg.stop != j:
            return None
        fly = propagator(self.z, since[:, None], self.conditions.damping)
        forced = self.forced.everywhere(leg.since + since, 1)  # of all sites alike, or of each
        at_site = forced[:, self.section.impacts[i][0] if forced.shape[-1] > 1 else 0]
        free = fly.swing * leg.r - fly.pull * leg.q
        return np.asarray(free @ self.shapes[i] + self.conditions.a * at_site)

    @cached_property
    def _walls(self) -> FloatArray:
        """How far sites are beyond their walls at their impacts."""
        value = np.empty(self.t.size)
        for leg in self.legs[:-1]:
            arrival: Any = leg.arrival
            motion = float(self.shapes[arrival.which].dot(leg.q_end))
            forced = self.conditions.a * self.forced.at(arrival.site, arrival.time)[0]
            wall = self.conditions.walls.position(arrival.site, arrival.wall)
            value[arrival.which] = motion + forced - wall
        return told_apart(self.section, self.t, value, self._speed_between)

    def tangents(self, names: Sequence[str] = ()) -> Tangents:
        """Derivatives along the flight, in t, q, r, then in `names`."""
        m, K, diagonal = self.t.size, self.q.size, np.arange(self.q.size)
        width = m + 2 * K
        walls, speeds = np.zeros((2, m, width + len(names)))
        Y, R = np.zeros((2, K, width + len(names)))
        Y[diagonal, m + diagonal] = R[diagonal, m + K + diagonal] = 1.0  # dq/dq, dr/dr
        starts = []
        for leg in self.legs:
            starts.append((Y, R))
            Y, R = self._carried(leg, Y, R, names)
            arrival = leg.arrival
            if arrival is None:
                break
            e = self.shapes[arrival.which]
            wall, speed = e @ Y, e @ R
            for i, name in enumerate(names, start=width):
                moved = self.driven(name, arrival.site, arrival.time)
                wall[i] += moved[0]
                speed[i] += moved[1]
            _, velocity, acceleration = self.forced.at(arrival.site, arrival.time)
            # the forced motion goes on with its time
            wall[arrival.which] += self.conditions.a * velocity
            speed[arrival.which] += self.conditions.a * acceleration
            loss = (1.0 + self.conditions.k) * speed
            loss[width:] += [arrival.velocity if name == "k" else 0.0 for name in names]
            walls[arrival.which], speeds[arrival.which] = wall, speed
            R = R - np.multiply.outer(self.kicks[arrival.which], loss)
        return Tangents(walls, speeds, starts, Y, R)

    def _carried(
        self, leg: ShootingInterval, Y: Array, R: Array, names: Sequence[str]
    ) -> tuple[Array, Array]:
        """Derivatives at the end of a leg from those at its start; its ends in time move."""
        if not leg.flight and leg.start == leg.stop:  # from the first impact to itself
            return Y, R
        Y, R = leg.propagator(Y, R)
        pull = self.pulled(leg.q_end, leg.r_end)
        for j, side in ((leg.stop, 1.0), (leg.start, -1.0)):
            if j != NOWHERE:
                Y[:, j] += side * leg.r_end
                R[:, j] += side * pull
        damping = self.conditions.damping
        for column, name in enumerate(names, start=Y.shape[1] - len(names)):
            if name == "damping":
                slope = propagator_slope_in_damping(self.z, leg.flight, leg.propagator, damping)
            elif name in ("gamma", "spring"):
                slope = propagator_slope(self.z, leg.flight, leg.propagator, damping)
            else:
                continue
            rise = self.basis.lam if name == "gamma" else 1.0  # dz/dgamma, dz/dspring
            y, v = slope(leg.q, leg.r)
            Y[:, column] += rise * y
            R[:, column] += rise * v
        return Y, R

    def jacobian(self, names: Sequence[str] = ()) -> FloatArray:
        """Derivative of `residual` in (t, q, r) and `names`, shape ``(m + 2K, m + 2K + ...)``."""
        m, K, diagonal = self.t.size, self.q.size, np.arange(self.q.size)
        check_modes(self.conditions.lattice, K)
        tangents, sign = self.tangents(names), self.section.sign
        walls = told_apart_slopes(self.section, self.t, self._walls, tangents.walls)
        matrix = np.vstack([walls, tangents.Y, tangents.R])
        # the section closes with its sign: q(T) = sign q(0)
        matrix[m + diagonal, m + diagonal] -= sign
        matrix[m + K + diagonal, m + K + diagonal] -= sign
        return matrix

    def slopes_at(self, site: int, time: float, names: Sequence[str]) -> FloatArray:
        """Derivatives of displacement and velocity of a site at a fixed time in t, q, r and
        `names`, shape ``(2, ...)``."""
        section = self.section
        i, ahead, sign = in_flight(self.free_modes, section.length, float(section.sign), time)
        after: int = i + 1  # the first leg ends at the first impact
        flown = self.legs[after]
        fly = propagator(self.z, ahead, self.conditions.damping)
        end = fly(flown.q, flown.r)
        leg = flown._replace(stop=NOWHERE, flight=ahead, propagator=fly, q_end=end[0], r_end=end[1])
        Y, R = self._carried(leg, *self.tangents(names).starts[after], names)
        e = self.basis.at(site)
        rows = np.array([sign * (e @ Y), sign * (e @ R)])
        for column, name in enumerate(names, start=rows.shape[1] - len(names)):
            rows[:, column] += self.driven(name, site, time)
        return rows

    def driven(self, name: str, site: int, time: float) -> tuple[float, float]:
        """Derivatives of the forced displacement and velocity of a site in one parameter."""
        if name == "a":
            return self.forced.at(site, time)[:2]
        u, v = self.forced.slope(name, site, time)
        return self.conditions.a * u, self.conditions.a * v

    # -------------------------------------------------------------------------- perturbations

    @cached_property
    def impact_slopes(self) -> FloatArray:
        """Derivatives in (q, r) of velocity and acceleration at each impact in turn, (2m, 2K).

        The flight is linear in its state at fixed times, and `map` knows no more of the state.
        """
        Y, R = np.eye(2 * self.q.size).reshape(2, self.q.size, -1)
        rows = []
        for leg, arrival in zip(self.legs, self.arrivals, strict=False):
            Y, R = leg.propagator(Y, R)
            e = self.shapes[arrival.which]
            speed = e @ R
            rows += [speed, -(e * self.z) @ Y - self.conditions.damping * speed]
            R = R - np.multiply.outer(self.kicks[arrival.which], (1.0 + self.conditions.k) * speed)
        return np.array(rows)

    @cached_property
    def map(self) -> ModalMap:
        """Map of small perturbations over a section."""
        on, saltations = self.conditions, []
        for hit in self.arrivals:
            # velocity and acceleration change sign with the side; braked less after the impact
            # than before, a site turns round faster by damping (1 + k) v
            b = saltation_entry(hit.acceleration, hit.velocity, on.k) + (1.0 + on.k) * on.damping
            shape, kick = self.shapes[hit.which], self.kicks[hit.which]
            saltations.append(ModalSaltation(shape, kick, saltation(on.k, b)))
        unseen, turns = (
            on.gamma * self.basis.unseen + on.spring,
            tuple(x.propagator for x in self.legs),
        )
        flown = self.z, unseen, turns, tuple(saltations), self.section.length, self.section.sign
        return ModalMap(on.lattice, on.gamma, on.damping, *flown)

    @cached_property
    def condition(self) -> float:
        """Condition number of the Newton matrix. It grows where a multiplier comes close to +1
        (to -1, on half a symmetric orbit)."""
        return float(np.linalg.cond(self.jacobian()))

    @property
    def resonance(self) -> ResonantModes | None:
        """The mode that is nearest to closing on its own; None if there is but a mean.

        In resonance the impacts alone no longer tell how strongly that mode moves: on an
        eigenfrequency n w = j the orbit is found nevertheless, its condition number says how well.
        """
        z = np.sort(self.z[self.z > 0.0])
        if z.size == 0:
            return None
        multipliers, _ = free_multipliers(z, self.conditions.damping, self.section.length)
        gap = abs(multipliers - self.section.sign)
        j = int(gap.argmin())
        return ResonantModes(j + 1, math.sqrt(float(z[j])), float(gap[j]))


@lru_cache(maxsize=128)
def _shapes(section: Section, lattice: Finite) -> FloatArray:
    return lattice.basis(section.hit).at(np.array([n for n, _ in section.impacts]))
