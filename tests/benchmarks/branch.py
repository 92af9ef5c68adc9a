"""A branch of closure points, without events, against solving the same points one by one."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import root

from .measure import Row, best_of, micro, span, walked
from .peers.closure import GAMMA, POINTS, K, branch_length, chi

Array = NDArray[np.float64]
Closure = Callable[[Array, float], Any]


def walker() -> Callable[[], Any]:
    """About 2000 points from a = 1 through the fold and back to a = 1, as every peer is given."""
    import contbreather as cb

    step = branch_length(GAMMA, K) / POINTS
    start = cb.symmetric(a=0.9999999, gamma=GAMMA, k=K).problem
    steps = cb.Steps(first=step, largest=step, most=2 * POINTS)
    how: dict[str, Any] = {"within": {"a": (0.0, 1.0)}, "events": (), "inadmissible": True}
    return partial(cb.trace, start, "a", steps=steps, **how)


def by_hand() -> Closure:
    """(11) typed out for this one forcing and gamma, chi known: the least that Python can do."""
    slope, q = chi(GAMMA), (1 - K) / (1 + K)

    def closure(x: Array, a: float) -> list[float]:
        p, phi = x.tolist()
        return [p * slope + a * math.cos(phi) - 1, -a * math.sin(phi) - p * q]

    return closure


def of_the_problem(start: Any) -> Closure:
    """The residual that the walk solves: any forcing, lattice and gamma."""
    residual = start.problem.residual
    params = dict(start.problem.params)
    return lambda x, a: residual(x, {**params, "a": a})


def one_by_one(closure: Closure, a: Array, x: Array) -> Array:
    """Solve at each `a` by `scipy.optimize.root`, from the point before."""
    before = np.vstack([x[:1], x[:-1]])
    return np.array([root(closure, x0, args=(a0,)).x for a0, x0 in zip(a, before, strict=True)])


def all_events() -> Row:
    import contbreather as cb

    start, within = cb.symmetric(0.5, 0.04, 0.8).problem, {"a": (0.07, 0.9)}
    walk = partial(cb.trace, start, "a", within=within, steps=cb.Steps(largest=0.01))
    return walked("the same with all events", walk, 120e-6)


def in_omega() -> list[Row]:
    """A point of a branch in the frequency beside one of a branch in the amplitude, from the same
    orbit with all events, by steps as they are unless asked: measured in turn, of about as many
    points each."""
    import contbreather as cb

    ring: dict[str, Any] = {"lattice": cb.Ring(9)}
    uneven: dict[str, Any] = {"lattice": cb.OpenChain(9), "site": 4, "damping": 0.02}
    uneven["spring"] = [0.05 + 0.005 * (-1) ** n * n for n in range(9)]
    table = []
    for what, start, low, high in (
        ("infinite chain", cb.symmetric(0.5, 0.08, 0.8), 0.15, 1.72),
        ("with springs", cb.symmetric(0.5, 0.04, 0.8, spring=0.05), 0.15, 1.72),
        ("ring of 9", cb.symmetric(0.6, 0.05, 0.8, **ring), 0.25, 1.6),
        ("damped ring of 9", cb.symmetric(0.6, 0.05, 0.8, **ring, damping=0.02), 0.25, 1.6),
        ("open chain of 9, springs of each", cb.symmetric(0.6, 0.05, 0.8, **uneven), 0.25, 1.6),
    ):
        windows = {"a": (low, 0.8), "omega": (0.9, high)}
        walks = [partial(cb.trace, start, free, within={free: w}) for free, w in windows.items()]
        sizes = [len(walk()) for walk in walks]
        times = [[best_of(walk, 1, time.process_time) for walk in walks] for _ in range(21)]
        a, omega = np.min(times, axis=0) / sizes
        aside = f"{span(a)} a point of {sizes[0]} in a"
        what = f"branch in omega, {what}, a point of {sizes[1]}"
        table.append(Row(what, span(omega), aside, omega / a, "<= 1.2 of a", omega <= 1.2 * a))
    return table


def rows() -> list[Row]:
    import contbreather as cb

    walk = walker()
    branch = walk()
    a, x = np.asarray(branch["a"]), np.column_stack([branch["p"], branch["phi"]])
    ours = best_of(walk, repeat=7) / a.size
    what = f"branch of {a.size} closure points, events off, a point"
    table = [all_events(), *in_omega()]
    for name, closure in (
        ("the same equations", of_the_problem(cb.symmetric(a=0.5, gamma=GAMMA, k=K))),
        ("the equations typed out for this one case", by_hand()),
    ):
        theirs = best_of(partial(one_by_one, closure, a, x)) / a.size
        apart = np.abs(one_by_one(closure, a, x) - x).max(axis=1)
        beside = f"scipy.optimize.root in a loop, the same points, {name}: {micro(theirs)}"
        note = f"the loop misses {np.count_nonzero(apart > 1e-6)} points (at the fold)"
        table.append(Row(what, micro(ours), beside, theirs / ours, "< 100 µs", ours < 100e-6, note))
    return table
