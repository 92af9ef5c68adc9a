"""The equation of motion of any finite lattice, integrated: it shares nothing with the package but
the forcing as a function of time."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import contbreather as cb
from contbreather.lattice.conditions import Conditions

Array = np.ndarray


def dense(lattice: Any) -> Array:
    """The stiffness matrix, of rings too."""
    if not isinstance(lattice, cb.Ring):
        return np.asarray(lattice.stiffness)
    one = np.eye(lattice.sites)
    return 2.0 * one - np.roll(one, 1, 0) - np.roll(one, -1, 0)


class Field:
    """A lattice under some conditions, integrated from impact to impact; with a restitution of
    the speed before an impact in place of k, if there is one."""

    def __init__(self, lattice: Any, on: Conditions, law: Any = None) -> None:
        one = np.ones(lattice.sites)
        masses, self.drive = (getattr(lattice, name, one) for name in ("masses", "drive"))
        each = range(lattice.sites)
        spring, self.damping = (on.at_sites(name, each) * one for name in ("spring", "damping"))
        self.matrix = on.gamma * dense(lattice) / masses[:, None] + np.diag(spring)
        self.on, self.sites = on, lattice.sites
        self.law = law or (lambda speed: on.k)

    def slope(self, t: float, x: Array) -> Array:
        u, v = x[: self.sites], x[self.sites :]
        force = self.on.a * self.on.forcing.d2f(t) * self.drive
        return np.concatenate([v, force - self.matrix @ u - self.damping * v])

    def run(
        self, x: Array, start: float, stop: float, at: Array | None = None
    ) -> tuple[Array, list, Array]:
        """End, impacts (site, time, wall, velocity before) and the states at some times."""
        walls = [(n, w) for n in range(self.sites) for w in (-1, 1)]
        places = {
            (n, w): self.on.walls.position(n, w)
            for n, w in walls
            if math.isfinite(self.on.walls.position(n, w))
        }
        events = []
        for (n, w), place in places.items():
            events.append(lambda t, y, n=n, w=w, place=place: w * (y[n] - place))
            events[-1].terminal, events[-1].direction = True, 1.0
        hits, t, seen = [], start, [np.empty((0, x.size))]
        while t < stop:
            flight = solve_ivp(
                self.slope, (t, stop), x, "DOP853", events=events, rtol=1e-13, atol=1e-14,
                max_step=0.2, dense_output=at is not None,
            )  # fmt: skip
            if at is not None:
                seen.append(flight.sol(at[(t <= at) & (at < flight.t[-1])]).T)
            t, x = float(flight.t[-1]), flight.y[:, -1].copy()
            for ((n, w), place), when in zip(places.items(), flight.t_events, strict=True):
                # two at once, to rounding: the second is beyond its wall before its event is seen
                beside = flight.status == 1 and abs(x[n] - place) < 1e-12 < w * x[self.sites + n]
                if (when.size or beside) and t < stop:
                    before = x[self.sites + n]
                    hits.append((n, t, w, before))
                    x[n], x[self.sites + n] = place, -self.law(abs(before)) * before
        return x, hits, np.concatenate(seen)


class FieldOf(Field):
    """That of an orbit, from just before its first impact on."""

    def __init__(self, orbit: cb.Orbit) -> None:
        super().__init__(orbit.lattice, orbit.conditions)
        self.orbit = orbit
        self.start = float(orbit.times.min()) - 0.05
        self.length, self.sign = orbit.section.length, orbit.section.sign
        self.state = np.concatenate(orbit.state(t=self.start))

    def after(self, x: Array, stop: float, at: Array | None = None) -> tuple[Array, list, Array]:
        return self.run(x, self.start, stop, at)

    def comes_back(self, close: float = 1e-11) -> None:
        """Over a period it meets the orbit's impacts, no others, and is where it began."""
        end, hits, _ = self.after(self.state, self.start + self.orbit.period)
        assert end == pytest.approx(self.state, abs=close)
        wanted = sorted((hit.site, hit.time, hit.wall, hit.before) for hit in self.orbit.hits)
        for own, other in zip(sorted(hits), wanted, strict=True):
            assert own == pytest.approx(other, abs=close)

    def multipliers(self) -> Array:
        """Of the section's map times its sign, by differences."""
        h, stop = 1e-5, self.start + self.length
        columns = [
            (self.after(self.state + h * e, stop)[0] - self.after(self.state - h * e, stop)[0])
            / (2 * h)
            for e in np.eye(self.state.size)
        ]
        return self.sign * np.linalg.eigvals(np.array(columns).T)

    def turns(self) -> list[tuple[float, int]]:
        """How far off its nearer wall each site turns round without an impact."""
        times = np.linspace(self.start, self.start + 2.0 * self.length, 8001)[:-1]
        _, _, seen = self.after(self.state, times[-1] + 1e-9, times)
        found = []
        for n in range(self.sites):
            (low, high), u = self.on.walls.at(n), seen[:, n]
            # a parabola through three points is good to 1e-9 here; at an impact there is a kink
            bend = u[2:] - 2.0 * u[1:-1] + u[:-2]
            turns = (np.diff(u)[:-1] * np.diff(u)[1:] <= 0.0) & (abs(bend) < 1e-5)
            tops = (u[1:-1] - (u[2:] - u[:-2]) ** 2 / np.where(turns, 8.0 * bend, 1.0))[turns]
            found += [(float(gap), n) for gap in np.minimum(high - tops, tops - low)]
        return sorted(found)
