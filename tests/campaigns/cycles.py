"""Random cycles beside an independent integrator, and random starts.

    python -m tests.campaigns.cycles [--orbits 100] [--starts 200] [--seed 0]

Multipliers of random orbits, smooth, forced and with impacts, are those of scipy's `solve_ivp`: of
the variational equations, or of differences of its stroboscopic map where there are impacts. And
whatever state a random system is started in, `cycle` answers with an orbit that comes back under
that integrator, or with a sentence.
"""

from __future__ import annotations

import argparse
import collections
import sys
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

import contbreather as cb
from contbreather.errors import ContbreatherError
from contbreather.flows import Collocation, Cycle, cycle_of
from tests.flows.test_cycle import variational
from tests.stability.by_hand import apart

Array = NDArray[Any]
EXACT = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-14}
AGREED = 1e-7  # of multipliers, relative above 1
RETURNS = 1e-7  # how far off an orbit may be after its period, times its largest multiplier
STENCIL = ((-2, 1 / 12), (-1, -2 / 3), (1, 2 / 3), (2, -1 / 12))
# beside slow impacts the map bends sharply, and where it stretches rounding is stretched, too: of
# these steps the two neighbours that agree best are taken
ASIDE = 1e-4 * 0.25 ** np.arange(5)


@dataclass(frozen=True)
class System:
    """A random system: its flow, an impact against a wall if there is one, and its forcing."""

    f: Callable[..., Any]
    n: int
    period: float | None
    wall: Callable[..., Any] | None = None
    reset: Callable[..., Any] | None = None

    @property
    def flow(self) -> cb.Flow:
        return cb.Flow(self.f, until=self.wall, reset=self.reset)

    def run(self, x: Array, t0: float, t1: float) -> Array:
        """From one time to another, through all impacts."""
        while t1 - t0 > 1e-13:
            hits = None
            if self.wall is not None:
                hits = lambda t, x: self.wall(t, x, {})  # noqa: E731
                hits.terminal, hits.direction = True, -1
            found = solve_ivp(
                lambda t, x: np.array(self.f(t, x, {})), (t0, t1), x, events=hits, **EXACT
            )
            t0, x = found.t[-1], found.y[:, -1]
            if found.status == 1:
                x = np.array(self.reset(t0, x, {}))
        return x


def autonomous(rng: np.random.Generator) -> System:
    """A limit cycle in random coordinates, with others that are damped and driven by it."""
    n = int(rng.integers(2, 6))
    turn, shear, bend = rng.uniform(0.5, 3), rng.uniform(-0.5, 0.5), rng.uniform(-0.3, 0.3)
    matrix = np.eye(n) + 0.3 * rng.normal(size=(n, n))
    back, rates = np.linalg.inv(matrix), rng.uniform(0.2, 2, n - 2)
    pull = rng.normal(size=(n - 2, 2))

    def f(t: Any, x: Any, p: Any) -> Any:
        y = np.tensordot(back, x, 1)
        u, v, square = y[0], y[1], y[0] ** 2 + y[1] ** 2
        spin = turn + shear * square + bend * u
        plane = [u * (1 - square) - spin * v, v * (1 - square) + spin * u]
        rest = [
            -rate * y[i + 2] + a * u * v + b * u + 0.2 * np.sin(y[i + 2])
            for i, (rate, (a, b)) in enumerate(zip(rates, pull, strict=True))
        ]
        return np.tensordot(matrix, np.array([*plane, *rest]), 1)

    return System(f, n, None)


def forced(rng: np.random.Generator) -> System:
    """Coupled oscillators with a cubic spring, driven."""
    m = int(rng.integers(1, 3))
    stiff = np.diag(rng.uniform(0.5, 3, m)) + 0.3
    damping, cubic = rng.uniform(0.1, 0.5), rng.uniform(0, 1)
    push, w = rng.uniform(0.1, 1, m), rng.uniform(0.6, 2)

    def f(t: Any, x: Any, p: Any) -> Any:
        drive = [a * np.cos(w * t) for a in push]
        springs = [sum(stiff[i, j] * x[j] for j in range(m)) for i in range(m)]
        return [*x[m:], *(drive[i] - springs[i] - cubic * x[i] ** 3 - damping * x[m + i]
                          for i in range(m))]  # fmt: skip

    return System(f, 2 * m, 2 * np.pi / w)


def impacting(rng: np.random.Generator) -> System:
    """An oscillator that is driven against a wall."""
    spring, damping = rng.uniform(0.1, 2), rng.uniform(0.05, 0.4)
    push, w = rng.uniform(1, 3), rng.uniform(0.7, 2)
    wall, e = rng.uniform(-0.2, 0.6), rng.uniform(0.3, 0.9)

    def f(t: Any, x: Any, p: Any) -> Any:
        return [x[1], push * np.cos(w * t) - spring * x[0] - 0.1 * x[0] ** 3 - damping * x[1]]

    return System(f, 2, 2 * np.pi / w, lambda t, x, p: wall - x[0],
                  lambda t, x, p: [x[0], -e * x[1]])  # fmt: skip


KINDS = (autonomous, forced, impacting)


def started(system: System, x: Array, settle: float, mesh: Collocation) -> Cycle:
    names = [f"x{i}" for i in range(system.n)]
    problem = cb.cycle(
        system.flow, dict(zip(names, x.tolist(), strict=True)), {}, period=system.period,
        settle=settle, collocation=mesh,
    )  # fmt: skip
    return cycle_of(problem)


def beside_event(orbit: Cycle) -> tuple[float, Array]:
    """A time of the orbit away from impacts, and the state there."""
    t = float(orbit.times[0] + 0.37 * orbit.durations[0])
    return t, orbit.states(t)


def independent(system: System, orbit: Cycle) -> NDArray[np.complex128]:
    """Its multipliers by `solve_ivp`."""
    if system.wall is None:
        return variational(lambda t, x, p: np.array(system.f(t, x, p)), orbit)
    t, x = beside_event(orbit)
    found = [by_differences(system, x, t, t + orbit.period, aside) for aside in ASIDE]
    return min(pairwise(found), key=lambda pair: apart(*pair))[1]


def by_differences(system: System, x0: Array, t0: float, t1: float, aside: float) -> Array:
    """Eigenvalues of the slopes of its map."""
    columns = [
        sum(w * system.run(x0 + k * aside * unit, t0, t1) for k, w in STENCIL) / aside
        for unit in np.eye(system.n)
    ]
    return np.asarray(np.linalg.eigvals(np.stack(columns, axis=1)))


def multipliers(count: int, seed: int) -> int:
    """Random settled orbits: how many have other multipliers than the independent integrator."""
    failed = known = 0
    mesh, number = Collocation(intervals=30), 0
    while known < count:
        number += 1
        rng = np.random.default_rng([seed, number])
        system = KINDS[number % len(KINDS)](rng)
        try:
            orbit = started(system, 0.3 * rng.normal(size=system.n), 200.0, mesh)
        except ContbreatherError:  # a chatter, a chaotic or a quasi-periodic motion
            continue
        off = apart(orbit.multipliers, independent(system, orbit))
        known += 1
        if not off < AGREED:
            failed += 1
            kind = KINDS[number % len(KINDS)].__name__
            print(f"{kind} {number}: {off:.1e} off, {orbit.multipliers}, trivial {orbit.trivial}")
    print(f"multipliers of {known} orbits of {number} systems: {failed} are off by {AGREED:g}")
    return failed


def starts(count: int, seed: int) -> int:
    """Random starts with little time to settle: an orbit that comes back, or a sentence."""
    failed, outcomes = 0, collections.Counter[str]()
    for number in range(count):
        rng = np.random.default_rng([seed, number, 1])
        kind = KINDS[number % len(KINDS)]
        system = kind(rng)
        x, settle = rng.normal(size=system.n), float(rng.choice([0, 5, 50]))
        try:
            orbit = started(system, x, settle, Collocation())
            t0, x0 = beside_event(orbit)
            growth = max(1.0, *abs(orbit.multipliers))
            off = float(abs(system.run(x0, t0, t0 + orbit.period) - x0).max()) / growth
            outcome = "an orbit" if off < RETURNS else f"false by {off:.1e}"
        except ContbreatherError as error:
            outcome = "a sentence" if str(error).count(" ") > 3 else f"no sentence: {error}"
        except Exception:  # noqa: BLE001 - what this campaign looks for
            outcome = "traceback: " + traceback.format_exc(limit=-1).strip()
        outcomes[outcome.partition(":")[0].partition(" by")[0]] += 1
        if outcome not in ("an orbit", "a sentence"):
            failed += 1
            print(f"{kind.__name__} {number}: {outcome}")
    print(f"{count} starts: {dict(outcomes)}")
    return failed


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--orbits", type=int, default=100)
    parser.add_argument("--starts", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    return int(multipliers(asked.orbits, asked.seed) + starts(asked.starts, asked.seed) > 0)


if __name__ == "__main__":
    sys.exit(main())
