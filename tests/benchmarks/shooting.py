"""One shooting point with its multipliers against the usual route: `solve_ivp` and differences.
And a branch of asymmetric breathers on the infinite chain, with its stability.

Both sides start from the same guess, solve for the same asymmetric orbit of a ring of N sites and
give all 2N multipliers. The baseline integrates the ring with scipy's DOP853 and an event for each
wall, resets, and takes the Jacobian of the period map by forward differences: Newton's method as
one would write it without knowing that the flow is linear.
"""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from .measure import Row, best_of, faster, walked, within
from .paper_route import furthest

Array = NDArray[np.float64]

GAMMA, K = 0.04, 0.8
GUESS, WANTED = 0.815, 0.82  # the orbit at the one amplitude is the guess at the other
TIGHT = {"method": "DOP853", "rtol": 1e-10, "atol": 1e-12}


class Baseline:
    """Period map of a ring whose site 0 bounces between its walls, and Newton's method on it."""

    def __init__(self, sites: int, a: float) -> None:
        self.sites, self.a = sites, a
        self.runs = 0

        def right_hand_side(t: float, x: Array) -> Array:
            u = x[:sites]
            pull = GAMMA * (np.roll(u, 1) + np.roll(u, -1) - 2.0 * u)
            return np.concatenate([x[sites:], pull - a * math.cos(t)])

        def wall(side: float) -> Any:
            def event(t: float, x: Array) -> float:
                return float(side * x[0] - 1.0)

            event.terminal, event.direction = True, 1.0  # type: ignore[attr-defined]
            return event

        self.right_hand_side, self.walls = right_hand_side, (wall(1.0), wall(-1.0))

    def period(self, x: Array, start: float) -> Array:
        """The state one period later."""
        t, end = start, start + 2.0 * math.pi
        self.runs += 1
        while t < end:
            run = solve_ivp(self.right_hand_side, (t, end), x, events=self.walls, **TIGHT)
            t, x = float(run.t[-1]), run.y[:, -1].copy()
            if run.status == 1:
                x[self.sites] *= -K
                x[0] = math.copysign(1.0 - 1e-13, x[0])
        return x

    def solve(self, x: Array, start: float) -> tuple[Array, NDArray[np.complex128]]:
        """The orbit through a guess, and its multipliers."""
        for _ in range(6):
            gap = self.period(x, start) - x
            h = 1e-6
            monodromy = np.stack(
                [(self.period(x + h * e, start) - x - gap) / h for e in np.eye(x.size)], axis=1
            )
            if np.abs(gap).max() < 1e-7:  # the differences are good to no more
                break
            x = x - np.linalg.solve(monodromy - np.eye(x.size), gap)
        return x, np.linalg.eigvals(monodromy)


def guess(sites: int) -> Any:
    """A point of the asymmetric branch beside the one that is expected."""
    import contbreather as cb
    from contbreather.orbits.constructors import shooting

    times = {"t1": -3.28, "t2": 0.45}
    walls = ((0, 1), (0, -1))
    far = shooting(times, a=WANTED, gamma=GAMMA, k=K, sites=sites, sequence=walls)
    branch = cb.trace(far, "a", within={"a": (GUESS, 0.83)}, towards="down", events=())
    return branch[-1].solution


def rows() -> list[Row]:
    compiled()
    return [shooting_row(100), branch_row(100, 5.0), branch_row(400, 60.0), arm_row()]


def compiled() -> None:
    """All that can be compiled is, and loaded."""
    from contbreather import compiler, kernels

    assert all(one.code for one in kernels.KERNELS), compiler.status()


def branch_row(sites: int, aim: float) -> Row:
    """A branch of symmetric breathers of a ring by shooting, with all events; aim in ms a point."""
    import contbreather as cb
    from contbreather.orbits.orbit_equations import _place

    start = cb.shooting(cb.symmetric(a=0.7, gamma=GAMMA, k=K), sites=sites)

    def walk() -> Any:
        _place.cache_clear()
        return cb.trace(start, "a", within={"a": (0.5, 0.95)})

    return walked(f"shooting branch with events, N = {sites}", walk, 1e-3 * aim)


def arm_row(points: int = 200) -> Row:
    """A branch of asymmetric breathers on the infinite chain, with events and stability."""
    import contbreather as cb
    from contbreather.continuation.branches.switching import follow, seeds_at
    from contbreather.continuation.curve.settings import Settings

    start = cb.symmetric(a=0.7, gamma=GAMMA, k=K)
    fork = cb.trace(start, "a", within={"a": (0.7, 0.9)}).first("PF")
    seed = seeds_at(fork)[0]
    whole = follow(fork, seed, Settings())
    step = whole[-1].arclength / points  # short, for that many of them

    def walk() -> tuple[Any, Any]:
        arm = follow(fork, seed, Settings(steps=cb.Steps(first=step, largest=step)))
        return arm, arm["unstable"]

    seconds = best_of(walk)
    arm, unstable = walk()
    assert len(arm) >= points
    what = f"asymmetric branch, infinite chain, {len(arm)} points, events and stability"
    counts = f"unstable multipliers {int(unstable.min())} to {int(unstable.max())}"
    note = f"ends with {arm[-1].label} at a = {arm[-1]['a']:.9f}, {counts}"
    return within(what, seconds, 2.0, note)


def shooting_row(sites: int) -> Row:
    from contbreather.orbits.constructors import shooting
    from contbreather.orbits.orbit import orbit_at
    from contbreather.orbits.orbit_equations import _place

    seed = guess(sites)

    def ours() -> Any:
        _place.cache_clear()
        orbit = orbit_at(shooting(seed, a=WANTED))
        return orbit, orbit.multipliers()

    seconds = best_of(ours)
    orbit, multipliers = ours()
    start = 0.5 * (seed.times[1] + seed.times[0])
    baseline = Baseline(sites, WANTED)
    began = time.perf_counter()
    state, found = baseline.solve(np.concatenate(seed.state(t=start)), start)
    usual = time.perf_counter() - began
    off = float(np.abs(state - np.concatenate(orbit.state(t=start))).max())
    apart = max(furthest(multipliers, found), furthest(found, multipliers))
    what = f"shooting: one point with all {2 * sites} multipliers, N = {sites}"
    beside = f"solve_ivp, events and differences, {baseline.runs} periods"
    note = f"states agree to {off:.0e}, multipliers to {apart:.0e}"
    return faster(what, seconds, beside, usual, 20.0, note)
