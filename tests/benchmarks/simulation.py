"""Simulation beside a general ODE solver, at equal or better accuracy; cost against length."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from .measure import Row, best_of, faster, span

STATE = {"a": 0.5, "gamma": 0.08, "k": 0.8}
FINE = 1e-13  # of the baseline; ours has no tolerance, its error is rounding
SHALLOW = 1e-4  # depth of contacts that nobody should miss
CAP = 0.05  # the longest step with which the baseline finds them


def processor_time(run: Callable[[], Any], repeat: int = 3) -> float:
    """Of one thread; see `best_of`."""
    return best_of(run, repeat, time.process_time)


def rows() -> list[Row]:
    return [*_impacting(), _shallow(), *_cost_of_length(), *_smooth()]


# --- the impacting ring ---------------------------------------------------------------------------


def with_events(
    state: Any, periods: float, *, each_wall: bool, cap: float = math.inf
) -> np.ndarray:
    """scipy's DOP853 with events: one function for each wall, or one for the nearest of all."""
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
            slope, (t, end), x, "DOP853", rtol=FINE, atol=FINE, max_step=cap, events=events
        )
        t, x = flown.t[-1], flown.y[:, -1].copy()
        if t < end:
            hit = np.abs(np.abs(x[:sites]) - 1.0) < 1e-8
            out_going = hit & (x[:sites] * x[sites:] > 0.0)
            x[sites:][out_going] *= -k
    return x


def _impacting() -> list[Row]:
    """Beside events as scipy documents them (the aim), and as one who knows scipy writes them."""
    from contbreather.orbits import symmetric
    from contbreather.simulation import simulate

    baselines: list[tuple[str, dict[str, Any]]] = [
        ("one event function a wall", {"each_wall": True}),
        ("one event function for all walls at once", {"each_wall": False}),
        (f"the same, steps of at most {CAP}", {"each_wall": False, "cap": CAP}),
    ]
    found = []
    for sites, wanted in ((20, 50.0), (400, 200.0)):
        state = symmetric(**STATE).state(sites)
        exact = np.concatenate(state)
        one = np.concatenate(simulate(state, **STATE, periods=1).final)
        count = len(simulate(state, **STATE, periods=200).impacts)
        fast = processor_time(lambda s=state: simulate(s, **STATE, periods=200), 10) / 200
        for name, how in baselines:
            theirs = with_events(state, 1, **how)
            slow = processor_time(lambda s=state, h=how: with_events(s, 1, **h), 5)
            errors = [np.abs(x - exact).max() for x in (one, theirs)]
            note = f"return error {errors[0]:.0e} beside {errors[1]:.0e}; "
            row = faster(
                f"a period of the impacting ring, N = {sites}", fast,
                f"solve_ivp DOP853, rtol = {FINE:g}, {name}", slow, wanted,
                f"{note}{count} impacts in 200 periods",
            )  # fmt: skip
            found.append(row if how["each_wall"] else replace(row, aim="", met=None))
    return found


def _shallow() -> Row:
    """One site that touches its wall to a small depth, from many times before the contact."""
    from scipy.integrate import solve_ivp

    from contbreather.simulation import simulate

    a, top, many = 0.4, 0.25 * math.pi, 100

    def crest(t: float) -> tuple[float, float]:
        """Free motion under -a cos t whose highest point, at ``top``, is beyond the wall."""
        rise = a * math.sin(top)
        u = 1.0 + SHALLOW + rise * (t - top) + a * (math.cos(t) - math.cos(top))
        return u, rise - a * math.sin(t)

    def gap(t: float, x: np.ndarray) -> float:
        return float(1.0 - abs(x[0]))

    def theirs(t: float, cap: float) -> bool:
        flown = solve_ivp(
            lambda t, x: [x[1], -a * math.cos(t)],
            (t, top + 0.5), crest(t), "DOP853", rtol=FINE, atol=FINE, max_step=cap, events=gap,
        )  # fmt: skip
        return bool(flown.t_events[0].size)

    def ours(t: float) -> bool:
        u, v = crest(t)
        length = (top + 0.5 - t) / (2.0 * math.pi)
        run = simulate(([u], [v]), a=a, gamma=0.0, k=0.8, t0=t, periods=length)
        return bool(run.impacts.size)

    starts = np.linspace(top - 1.5, top - 0.5, many).tolist()
    own = sum(map(ours, starts))
    free = sum(theirs(t, math.inf) for t in starts)
    capped = sum(theirs(t, CAP) for t in starts)
    return Row(
        f"{many} contacts of depth {SHALLOW:g}: how many are found",
        str(own),
        f"solve_ivp DOP853, rtol = {FINE:g}: {free}; with steps of at most {CAP}: {capped}",
        aim="all",
        met=own == many,
    )


def _cost_of_length() -> list[Row]:
    """Time for one impact on rings of very different length, in a breather and in a crowd."""
    from contbreather.orbits import symmetric
    from contbreather.simulation import simulate

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
            seconds = processor_time(lambda s=state, p=periods: simulate(s, **STATE, periods=p))
            costs[sites] = seconds / len(run.impacts)
        growth = costs[800] / costs[100]
        allowed = 8.0 * math.log(800) / math.log(100)
        each = ", ".join(f"N = {n}: {span(c)}" for n, c in costs.items())
        table.append(Row(
            f"cost of an impact, {title}", each, "N log N from N = 100 to 800", growth / allowed,
            "<= 1", growth <= allowed, f"grows {growth:.2f} times, N log N {allowed:.2f} times",
        ))  # fmt: skip
    return table


# --- the smooth ring ------------------------------------------------------------------------------


def _smooth() -> list[Row]:
    """The solver at three hardnesses, beside Radau with a numerical Jacobian."""
    from contbreather.lattice import Ring
    from contbreather.orbits import symmetric
    from contbreather.simulation import SmoothConditions
    from contbreather.simulation.smooth import integrated
    from contbreather.simulation.states import damping_of

    y = np.concatenate(symmetric(0.1, 0.08, 0.8).state(20))
    times, ring = np.array([4.0 * math.pi]), Ring(20)
    table = []
    for m in (6, 20, 50):
        on = SmoothConditions(0.1, 0.08, damping_of(0.8), m, 0.005, lattice=ring)
        end = partial(integrated, on, 0.0, y, times)
        exact = end(1e-13)[-1]
        slow, error = _radau(on, y, times, exact)
        # the largest tolerance at which it is not worse than the baseline
        for tolerance in (1e-7, 3e-8, 1e-8, 3e-9, 1e-9, 3e-10, 1e-10, 3e-11, 1e-11):
            ours = float(np.abs(end(tolerance)[-1] - exact).max())
            if ours <= error:
                break
        assert ours <= error
        fast = processor_time(partial(end, tolerance))
        what = f"2 periods of the smooth ring, m = {m}, tolerance {tolerance:g}"
        beside, note = "solve_ivp Radau, numerical Jacobian", f"error {ours:.0e} beside {error:.0e}"
        table.append(faster(what, fast, beside, slow, 10.0, note))
    return table


def _radau(
    conditions: Any, y: np.ndarray, times: np.ndarray, exact: np.ndarray
) -> tuple[float, float]:
    """Time and error of scipy's Radau with the same compiled right-hand side."""
    from scipy.integrate import solve_ivp

    from contbreather.simulation.smooth import right_side

    def solve() -> Any:
        rhs = right_side(conditions, y.size)
        return solve_ivp(rhs, (0.0, times[-1]), y, "Radau", rtol=1e-8, atol=1e-8, max_step=0.2)

    error = float(np.abs(solve().y[:, -1] - exact).max())
    return processor_time(solve, 2), error
