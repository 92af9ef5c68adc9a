"""Orbits of random uneven chains beside an integrator of their own.

    python -m tests.campaigns.uneven 200 SEED

Springs, dampings, restitution, masses and walls differ from site to site, by ten per cent in every
second chain, by anything in the others. Each orbit has to return to its state after a period of a
motion made of matrix exponentials, with as many impacts as it says, and its multipliers are those
of the same flights and of saltations written down from the two vector fields. So many orbits are
checked; draws without one that keeps off the walls are told, too.
"""

from __future__ import annotations

import collections
import itertools
import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.optimize import brentq

import contbreather as cb
from contbreather.errors import ContbreatherError
from contbreather.orbits.constructors import orbit_at, shooting
from tests.stability.by_hand import apart

Array = NDArray[Any]
PERIOD = 2 * np.pi
FINE = 512  # steps of a period in which impacts are looked for
RETURNS, ALIKE = 1e-10, 1e-6  # of states; of multipliers, relative above 1


class OwnChain:
    """``m (u'' + c u' + s u) + gamma L u = -m d a cos t`` and ``u' -> -k u'``, all by sites."""

    def __init__(
        self, L: Any, a: float, gamma: float, k: Any, c: Any, s: Any, m: Any, walls: Any, d: Any = 1
    ):
        n = self.n = len(L)
        pull = gamma * np.asarray(L) / np.reshape(m, (-1, 1)) + np.diag(s)
        self.A = np.block([[np.zeros((n, n)), np.eye(n)], [-pull, -np.diag(c)]])
        self.force = np.concatenate([np.zeros(n), -a * d * np.ones(n)])
        self.k, (self.low, self.high) = k, np.transpose(walls)
        self.forced = np.linalg.solve(1j * np.eye(2 * n) - self.A, self.force)
        self.step = expm(PERIOD / FINE * self.A)

    def field(self, t: float, y: Array) -> Array:
        return self.A @ y + self.force * np.cos(t)

    def particular(self, t: float) -> Array:
        return (self.forced * np.exp(1j * t)).real

    def flown(self, t: float, y: Array, h: float) -> Array:
        return self.particular(t + h) + expm(h * self.A) @ (y - self.particular(t))

    def after(
        self, t: float, y: Array, span: float = PERIOD
    ) -> tuple[Array, Array, list[tuple[int, int]]]:
        """The state some time later, the derivative of that in the state, and the impacts, each by
        its site and its wall."""
        end, n, M = t + span, self.n, np.eye(2 * self.n)
        hits: list[tuple[int, int]] = []
        while end - t > 1e-13:
            h = min(PERIOD / FINE, end - t)
            E = self.step if h == PERIOD / FINE else expm(h * self.A)
            late = self.particular(t + h) + E @ (y - self.particular(t))
            behind = [i for i in range(n) if self._beyond(late, i) > 0.0]
            # or a site that turns within the step, between two places inside of its walls
            turning = np.flatnonzero(y[n:] * late[n:] < 0.0) if not behind else []
            near = [int(i) for i in turning if self._beyond(late, i) > -h]
            deepest = {i: self._turn(t, y, h, i) for i in near}
            behind += [i for i, x in deepest.items() if self._beyond(self.flown(t, y, x), i) > 0.0]
            if not behind:
                t, y, M = t + h, late, E @ M
                continue
            h, site = min((self._when(t, y, deepest.get(i, h), int(i)), int(i)) for i in behind)
            y, M, t = self.flown(t, y, h), expm(h * self.A) @ M, t + h
            R = np.eye(2 * n)
            R[n + site, n + site] = -self.k[site]
            before, back = self.field(t, y), R @ y
            M = (
                R + np.outer(self.field(t, back) - R @ before, np.eye(2 * n)[site]) / y[n + site]
            ) @ M
            hits.append((site, 1 if y[n + site] > 0.0 else -1))
            y = back
            # inside its walls, whatever rounding says, and so is another that hits at this time
            y[:n] = np.clip(y[:n], self.low + 4e-16, self.high - 4e-16)
        return y, M, hits

    def _beyond(self, y: Array, site: int) -> float:
        return float(max(y[site] - self.high[site], self.low[site] - y[site]))

    def _turn(self, t: float, y: Array, h: float, site: int) -> float:
        """When a site turns round within a step."""
        return float(brentq(lambda x: self.flown(t, y, x)[self.n + site], 0.0, h, xtol=1e-15))

    def _when(self, t: float, y: Array, h: float, site: int) -> float:
        """When a site meets the wall that it is behind after a time h."""
        late = self.flown(t, y, h)[site]
        wall = self.high[site] if late > self.high[site] else self.low[site]
        when = brentq(lambda x: self.flown(t, y, x)[site] - wall, 0.0, h, xtol=1e-15, rtol=1e-14)
        return float(when)


def random_chain(rng: np.random.Generator, spread: float) -> dict[str, Any]:
    """Arguments of `symmetric` for a chain whose parts are off by so much."""
    n = int(rng.integers(3, 13))

    def each(mean: float, most: float = np.inf) -> list[float]:
        return np.minimum(mean * (1 + spread * rng.uniform(-1, 1, n)), most).tolist()

    lattice: Any = [cb.OpenChain(n), cb.OpenChain(n, ends="fixed"), cb.Ring(n)][rng.integers(3)]
    if rng.uniform() < 0.5 and not isinstance(lattice, cb.Ring):
        lattice = cb.Lattice(lattice.stiffness, masses=each(1.0))
    on: dict[str, Any] = {"a": rng.uniform(0.2, 0.8), "gamma": rng.uniform(0.01, 0.08)}
    on |= {"k": each(rng.uniform(0.5, 0.9), 1.0), "lattice": lattice}
    on |= {"site": int(rng.integers(n)), "damping": each(rng.uniform(0.002, 0.05))}
    if rng.uniform() < 0.7:
        on["spring"] = each(rng.uniform(0.05, 0.4))
    if rng.uniform() < 0.5:
        on["walls"] = {i: (-x, x) for i, x in enumerate(each(1.0))}
    if rng.uniform() < 0.3:
        on["damping"] = 0.0
    return on


def own(on: dict[str, Any], orbit: cb.Orbit) -> OwnChain:
    """The chain of these arguments, from what was given and not from what became of it."""
    lattice, n = on["lattice"], on["lattice"].sites
    L: Any = getattr(lattice, "stiffness", None)
    if L is None:  # of a ring
        L = 2 * np.eye(n) - np.roll(np.eye(n), 1, 0) - np.roll(np.eye(n), -1, 0)
    rows = (np.broadcast_to(on.get(name, 0.0), n) for name in ("k", "damping", "spring"))
    walls = on.get("walls") or {}
    pairs = [walls.get(i, (-1.0, 1.0)) for i in range(n)]
    return OwnChain(L, on["a"], on["gamma"], *rows, np.ones(n) * lattice.masses, pairs)


def checked(on: dict[str, Any], orbit: cb.Orbit) -> str:
    """Verdict on an orbit: right, or what is wrong with it."""
    if orbit.admissibility().margin < 0.0:
        return "behind a wall"
    t = float(orbit.times[0]) - 0.3
    u, v = orbit.state(t=t)
    start = np.concatenate([u, v])
    end, M, hits = own(on, orbit).after(t, start)
    if len(hits) != len(orbit.hits):
        return f"WRONG: {len(hits)} impacts, not {len(orbit.hits)}"
    # what grows over a period makes rounding grow
    if (off := abs(end - start).max()) > max(RETURNS, 1e-14 * np.linalg.norm(M, 2)):
        return f"WRONG: off by {off:.2g}"
    theirs = orbit.multipliers()
    if (off := apart(np.linalg.eigvals(M), theirs)) > ALIKE:
        return f"WRONG: multipliers off by {off:.2g}"
    return "right"


def answer(rng: np.random.Generator, number: int) -> str:
    """The verdict on one random chain: on its symmetric breather or, of every third, on an orbit
    over the whole period between walls that are not symmetric."""
    on = random_chain(rng, 0.1 if number % 2 else 0.8)
    try:
        orbit = cb.symmetric(**on)
        if number % 3 == 0:
            walls = {**(on.get("walls") or {})}
            low, high = walls.get(on["site"], (-1.0, 1.0))
            on = {**on, "walls": {**walls, on["site"]: (0.97 * low, high)}}
            orbit = orbit_at(shooting(orbit, symmetric=False, walls=on["walls"], inadmissible=True))
    except ContbreatherError as refused:
        return f"{type(refused).__name__}"
    return checked(on, orbit)


def main(count: int, seed: int) -> int:
    found: collections.Counter[str] = collections.Counter()
    for number in itertools.count():
        if found["right"] + found["WRONG"] >= count:
            break
        said = answer(np.random.default_rng([seed, number]), number)
        if said.startswith("WRONG"):
            print(number, said)
        found[said.partition(":")[0]] += 1
    print(dict(found))
    return found["WRONG"]


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:3])) > 0)
