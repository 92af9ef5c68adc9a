"""Simulation beside a general ODE solver, at equal or better accuracy; cost against length."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from .measure import ONE_THREAD, Row, best_of, span

STATE = {"a": 0.5, "gamma": 0.08, "k": 0.8}


def rows(long: bool = False) -> list[Row]:
    """All rows; `long` adds N = 400 with one event for each wall, as a user would write it."""
    return [*_impacting(long), *_cost_of_length(), *_smooth()]


# --- the impacting ring ---------------------------------------------------------------------------


def with_events(state: Any, periods: float, tolerance: float, *, each_wall: bool) -> np.ndarray:
    """scipy's DOP853 with events: one for the nearest wall of all (quick), or one for each."""
    from scipy.integrate import solve_ivp

    a, gamma, k = STATE.values()
    sites = len(state[0])
    out = np.empty(2 * sites)

    def slope(t: float, x: np.ndarray) -> np.ndarray:
        u = x[:sites]
        out[:sites] = x[sites:]
        force = out[sites:]
        np.multiply(u, -2.0 * gamma, out=force)
        force[1:] += gamma * u[:-1]
        force[:-1] += gamma * u[1:]
        force[0] += gamma * u[-1]
        force[-1] += gamma * u[0]
        force -= a * math.cos(t)
        return out.copy()

    def nearest(t: float, x: np.ndarray) -> float:
        return float(1.0 - np.abs(x[:sites]).max())

    def wall(n: int, sign: float) -> Callable[..., float]:
        return lambda t, x: float(1.0 - sign * x[n])

    events: list[Any] = [nearest]
    if each_wall:
        events = [wall(n, sign) for n in range(sites) for sign in (1.0, -1.0)]
    for event in events:
        event.terminal, event.direction = True, -1.0
    t, x, end = 0.0, np.concatenate(state), 2.0 * math.pi * periods
    while t < end:
        flown = solve_ivp(
            slope, (t, end), x, "DOP853", rtol=tolerance, atol=tolerance, events=events
        )
        t, x = flown.t[-1], flown.y[:, -1].copy()
        if t < end:
            hit = np.abs(np.abs(x[:sites]) - 1.0) < 1e-8
            out_going = hit & (x[:sites] * x[sites:] > 0.0)
            x[sites:][out_going] *= -k
    return x


def _impacting(long: bool) -> list[Row]:
    from contbreather.breathers import symmetric
    from contbreather.dynamics import simulate

    found = []
    cases = [(20, False, 50.0), (20, True, 50.0), (400, False, 200.0)]
    for sites, each_wall, wanted in cases + ([(400, True, 200.0)] if long else []):
        state = symmetric(**STATE).state(sites)
        simulate(state, **STATE, periods=1)  # compiled, or read from the cache
        periods = 1
        theirs = with_events(state, 1, 1e-11, each_wall=each_wall)
        slow = best_of(
            lambda s=state, e=each_wall: with_events(s, 1, 1e-11, each_wall=e),
            1 if sites > 20 and each_wall else 3,
        )
        ours = simulate(state, **STATE, periods=200)
        fast = best_of(lambda s=state: simulate(s, **STATE, periods=200)) / 200
        one = simulate(state, **STATE, periods=periods)
        exact = np.concatenate(state)
        errors = [np.abs(x - exact).max() for x in (np.concatenate(one.final), theirs)]
        name = "one event a wall" if each_wall else "one event for all walls"
        found.append(
            Row(
                f"a period of the impacting ring, N = {sites}",
                span(fast),
                f"solve_ivp DOP853, {name}: {span(slow)}",
                slow / fast,
                f">= {wanted:g}",
                slow / fast >= wanted,
                f"return error {errors[0]:.0e} beside {errors[1]:.0e}; "
                f"{len(ours.impacts)} impacts in 200 periods",
            )
        )
    return found


def _cost_of_length() -> list[Row]:
    """Time for one impact on rings of very different length, in a breather and in a crowd."""
    from contbreather.breathers import symmetric
    from contbreather.dynamics import simulate

    table: list[Row] = []
    for title, excite in (("one breather", False), ("every site hitting", True)):
        costs = {}
        for sites in (100, 200, 400, 800):
            state = symmetric(**STATE).state(sites)
            if excite:
                rng = np.random.default_rng(0)
                state = rng.uniform(-0.9, 0.9, sites), rng.normal(size=sites)
            periods = 100 if not excite else 4
            run = simulate(state, **STATE, periods=periods)
            seconds = best_of(lambda s=state, p=periods: simulate(s, **STATE, periods=p))
            costs[sites] = seconds / len(run.impacts)
        growth = costs[800] / costs[100]
        allowed = 8.0 * math.log(800) / math.log(100)
        table.append(
            Row(
                f"cost of an impact, {title}",
                ", ".join(f"N = {n}: {span(c)}" for n, c in costs.items()),
                "N log N from N = 100 to 800",
                growth / allowed,
                "<= 1",
                growth <= allowed,
                f"grows {growth:.2f} times, N log N {allowed:.2f} times",
            )
        )
    return table


# --- the smooth ring ------------------------------------------------------------------------------


def _smooth() -> list[Row]:
    """The solvers at three hardnesses, each beside Radau with a numerical Jacobian."""
    from contbreather.breathers import symmetric
    from contbreather.dynamics import Explicit, Implicit, SmoothConditions, Switching
    from contbreather.dynamics.smooth import damping_of
    from contbreather.dynamics.smooth_flow import motion

    y = np.concatenate(symmetric(0.1, 0.08, 0.8).state(20))
    times = np.array([4.0 * math.pi])
    table = []
    for m in (6, 20, 50):
        conditions = SmoothConditions(0.1, 0.08, damping_of(0.8), m, 0.005)
        exact = _states(Explicit(1e-13), conditions, y, times)
        slow, error = _radau(motion, conditions, y, times, exact)
        for solver in (Explicit(3e-9), Explicit(1e-10), Switching(1e-10), Implicit(1e-8)):
            own = _states(solver, conditions, y, times)
            fast = best_of(lambda s=solver, c=conditions: _states(s, c, y, times))
            ours = float(np.abs(own - exact).max())
            is_choice = isinstance(solver, Explicit)
            table.append(
                Row(
                    f"2 periods of the smooth ring, m = {m}, {solver}",
                    span(fast),
                    f"solve_ivp Radau, numerical Jacobian: {span(slow)}",
                    slow / fast,
                    ">= 10 at equal error" if is_choice else "",
                    (slow / fast >= 10.0 and ours <= 3.0 * error) if is_choice else None,
                    f"error {ours:.0e} beside {error:.0e}",
                )
            )
    return table


def _states(solver: Any, conditions: Any, y: np.ndarray, times: np.ndarray) -> np.ndarray:
    from contbreather.dynamics.smooth_flow import jacobian, motion

    return solver.states(motion, jacobian, conditions.arguments, 0.0, y, times)[-1]


def _radau(
    rhs: Any, conditions: Any, y: np.ndarray, times: np.ndarray, exact: np.ndarray
) -> tuple[float, float]:
    """Time and error of scipy's Radau with the same compiled right-hand side."""
    from scipy.integrate import solve_ivp

    start = time.perf_counter()
    found = solve_ivp(
        lambda t, x: rhs(t, x, *conditions.arguments),
        (0.0, times[-1]), y, "Radau", rtol=1e-8, atol=1e-8, max_step=0.2,
    )  # fmt: skip
    seconds = time.perf_counter() - start
    return seconds, float(np.abs(found.y[:, -1] - exact).max())


if __name__ == "__main__":
    import os

    os.environ.update(ONE_THREAD)
    from .__main__ import show

    show(rows("--long" in sys.argv))
