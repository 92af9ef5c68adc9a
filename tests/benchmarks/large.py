"""Large problems with LP, BP and HB looked for, beside one factorisation of their derivative, and
cycles of the Brusselator on a line."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tests.continuation.large import bratu, plane, second, swift_hohenberg
from tests.flows.test_large import brusselator

from .measure import Row, best_of, micro, within


@dataclass(frozen=True)
class Case:
    """A branch to walk, and how many seconds a point of it may take."""

    what: str
    problem: Any
    free: str
    most: int
    aim: float


def cases() -> list[Case]:
    length = 40 * np.pi
    return [
        Case("Bratu 1-D, n = 1000", bratu(second(1000), lam=3.0), "lam", 40, 5e-3),
        Case("Bratu 1-D, n = 10 000", bratu(second(10_000), lam=3.0), "lam", 40, 40e-3),
        Case("Bratu 2-D, 100 x 100", bratu(plane(100), lam=6.0), "lam", 30, 200e-3),
        Case("Swift-Hohenberg, n = 2000", swift_hohenberg(2000, length), "mu", 20, 30e-3),
    ]


def rows() -> list[Row]:
    every, none = None, ()  # events, and with these multipliers
    return [*map(_row, cases()), _cycles(200, 8, every, 4.0), _cycles(1000, 4, none, 30.0)]


def _row(case: Case) -> Row:
    import contbreather as cb

    events = [cb.fold(), cb.branch_point(), cb.hopf()]
    steps = cb.Steps(first=0.05, most=case.most)
    branches: list[Any] = []

    def walk() -> None:
        found = cb.trace(
            case.problem, case.free, towards="up", within={}, events=events, steps=steps
        )
        branches.append(found)

    walk()
    each = best_of(walk, 3, time.process_time) / len(branches[0])
    one = best_of(lambda: _factorised(case.problem), 5, time.process_time)
    special = ", ".join(point.title for point in branches[0].special)
    what, beside = f"{case.what}: a point, LP, BP and HB looked for", f"one sparse LU: {micro(one)}"
    return replace(within(what, each, case.aim, special), compares_with=beside, ratio=each / one)


def _cycles(cells: int, most: int, events: Any, aim: float) -> Row:
    """Cycles from their Hopf point on, 20 intervals of 4 points, switching to them included."""
    import contbreather as cb

    window: Any = {"L": (0.45, 0.6)}
    born = cb.trace(brusselator(cells), "L", within=window).first("HB")
    begun = time.process_time()
    (arm,) = cb.switch(born, within=window, events=events, steps=cb.Steps(most=most))
    each = (time.process_time() - begun) / len(arm)
    how = "without multipliers" if events == () else "with multipliers"
    what = f"cycles of the Brusselator, {2 * cells} states, {how}: a point"
    note = f"{arm[0].problem.x.size} unknowns; period {arm[-1]['period']:.9f}"
    return within(what, each, aim, note)


def _factorised(problem: Any) -> None:
    from scipy.sparse.linalg import splu

    splu(problem.jacobian(problem.x, problem.params))
