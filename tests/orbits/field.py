"""The equation of motion of any finite lattice, by matrix exponentials from impact to impact: it
shares nothing with the package but what it is given and the forcing as a function of time."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq

import contbreather as cb
from contbreather.lattice.conditions import Conditions

Array = np.ndarray
STEP = 2.0 * math.pi / 512  # in which impacts are looked for
TOUCH = 1e-10  # so far beyond its wall a site that turns has hit it


def dense(lattice: Any) -> Array:
    """The stiffness matrix, of rings too."""
    if not isinstance(lattice, cb.Ring):
        return np.asarray(lattice.stiffness)
    one = np.eye(lattice.sites)
    return 2.0 * one - np.roll(one, 1, 0) - np.roll(one, -1, 0)


class Field:
    """A lattice under some conditions; with a restitution of the speed before an impact in place
    of k, if there is one."""

    def __init__(
        self, lattice: Any, on: Conditions, law: Callable[[float], float] | None = None
    ) -> None:
        n = self.sites = lattice.sites
        one, each = np.ones(n), range(n)
        masses, drive = (getattr(lattice, name, one) for name in ("masses", "drive"))
        spring, damping, k = (on.at_sites(name, each) * one for name in ("spring", "damping", "k"))
        self.kept = [law or (lambda speed, k=k: k) for k in k]
        self.low, self.high = np.transpose([on.walls.at(i) for i in each])
        # each harmonic of the drive is two further states that turn: no resonance is special
        force = 2.0 * np.fft.rfft(on.forcing.d2f(np.arange(256) * math.pi / 128.0)) / 256.0
        force[0] /= 2.0
        self.orders = np.flatnonzero(abs(force) > 1e-14)
        size = 2 * n + 2 * self.orders.size
        self.matrix = np.zeros((size, size))
        u, v = slice(n), slice(n, 2 * n)
        self.matrix[u, v], self.matrix[v, v] = np.eye(n), -np.diag(damping)
        self.matrix[v, u] = -on.gamma * dense(lattice) / masses[:, None] - np.diag(spring)
        for m, j in zip(self.orders, range(2 * n, size, 2), strict=True):
            self.matrix[j + 1, j], self.matrix[j, j + 1] = m, -m
            self.matrix[v, j] = on.a * force[m].real * drive
            self.matrix[v, j + 1] = -on.a * force[m].imag * drive
        self.step = expm(STEP * self.matrix)

    def under(self, matrix: Array, t: float, x: Array) -> Array:
        """What a matrix makes of a state and of the drive at a time, without the drive."""
        waves = np.transpose([np.cos(self.orders * t), np.sin(self.orders * t)])
        return (matrix @ np.concatenate([x, waves.ravel()]))[: 2 * self.sites]

    def flown(self, t: float, x: Array, h: float) -> Array:
        """The state a time h later, if nothing is hit."""
        return self.under(expm(h * self.matrix), t, x)

    def beyond(self, x: Array, site: int) -> float:
        return float(max(x[site] - self.high[site], self.low[site] - x[site]))

    def turn(self, t: float, x: Array, h: float, site: int) -> float:
        """When a site turns round within a step."""
        return float(brentq(lambda s: self.flown(t, x, s)[self.sites + site], 0.0, h, xtol=1e-15))

    def first(self, t: float, x: Array, h: float, late: Array) -> tuple[float, int] | None:
        """When which site is the first to meet a wall within a step, if one does."""
        n, meets = self.sites, []
        deep = {i: h for i in range(n) if self.beyond(late, i) > 0.0}
        # or between two places inside of its walls
        turning = np.flatnonzero(x[n:] * late[n:] < 0.0).tolist() if not deep else []
        near = {i: self.turn(t, x, h, i) for i in turning if self.beyond(late, i) > -h}
        deep |= {i: s for i, s in near.items() if self.beyond(self.flown(t, x, s), i) > TOUCH}
        for i, s in deep.items():
            wall = self.high[i] if self.flown(t, x, s)[i] > self.high[i] else self.low[i]
            off = lambda s, i=i, wall=wall: self.flown(t, x, s)[i] - wall  # noqa: E731
            meets.append((float(brentq(off, 0.0, s, xtol=1e-15, rtol=1e-14)), i))
        return min(meets, default=None)

    def flights(self, x: Array, t: float, stop: float) -> Iterator[tuple[Any, ...]]:
        """Each step: its time, length, first and last state, the derivative of the one in the
        other, and the impact (site, time, wall, velocity before) at its end, if there is one."""
        n = self.sites
        while stop - t > 1e-13:
            h, hit = min(STEP, stop - t), None
            matrix = self.step if h == STEP else expm(h * self.matrix)
            late = self.under(matrix, t, x)
            if meets := self.first(t, x, h, late):
                h, site = meets
                matrix = expm(h * self.matrix)
                late = self.under(matrix, t, x)
                hit = (site, t + h, 1 if late[n + site] > 0.0 else -1, late[n + site])
            slope = matrix[: 2 * n, : 2 * n]
            if hit:
                reset, speed = np.eye(2 * n), late[n + site]
                reset[n + site, n + site] = -self.kept[site](abs(speed))
                rates = [self.under(self.matrix, t + h, y) for y in (late, reset @ late)]
                late = reset @ late
                kick = np.outer(rates[1] - reset @ rates[0], np.eye(2 * n)[site]) / speed
                slope = (reset + kick) @ slope
                # inside its walls, whatever rounding says, and so is another that hits now
                late[:n] = np.clip(late[:n], self.low + 4e-16, self.high - 4e-16)
            yield t, h, x, late, slope, hit
            t, x = t + h, late

    def run(self, x: Array, start: float, stop: float) -> tuple[Array, list, Array]:
        """End, impacts, and the derivative of the end in the state at the start."""
        end, hits, whole = x, [], np.eye(x.size)
        for step in self.flights(x, start, stop):
            end, slope, hit = step[3:]
            whole = slope @ whole
            hits += [hit] if hit else []
        return end, hits, whole


class FieldOf(Field):
    """That of an orbit, from just before its first impact on."""

    def __init__(self, orbit: cb.Orbit) -> None:
        super().__init__(orbit.lattice, orbit.conditions)
        self.orbit = orbit
        self.start = float(orbit.times.min()) - 0.05
        self.length = orbit.section.length
        self.state = np.concatenate(orbit.state(t=self.start))

    def comes_back(self, close: float = 1e-11) -> None:
        """Over a period it meets the orbit's impacts, no others, and is all along where that is."""
        steps = [*self.flights(self.state, self.start, self.start + self.orbit.period)]
        t, u = ([step[i] for step in steps] for i in (0, 2))
        there = self.orbit.displacement(np.arange(self.sites), np.reshape(t, (-1, 1)))
        assert np.array(u)[:, : self.sites] == pytest.approx(there, abs=close)
        assert steps[-1][3] == pytest.approx(self.state, abs=close)
        wanted = sorted((hit.site, hit.time, hit.wall, hit.before) for hit in self.orbit.hits)
        hits = sorted(hit for *_, hit in steps if hit)
        for own, other in zip(hits, wanted, strict=True):
            assert own == pytest.approx(other, abs=close)

    def multipliers(self) -> Array:
        """Of the section's map times its sign."""
        *_, whole = self.run(self.state, self.start, self.start + self.length)
        return self.orbit.section.sign * np.linalg.eigvals(whole)

    def turns(self) -> list[tuple[float, int]]:
        """How far off its nearer wall each site turns round without an impact."""
        found, stop = [], self.start + 2.0 * self.length
        for t, h, x, late, _, hit in self.flights(self.state, self.start, stop):
            for i in np.flatnonzero(x[self.sites :] * late[self.sites :] < 0.0).tolist():
                if not hit or hit[0] != i:
                    found.append((-self.beyond(self.flown(t, x, self.turn(t, x, h, i)), i), i))
        return sorted(found)
