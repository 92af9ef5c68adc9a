"""Windows of a walk: bounds of all that can change, and of the domain of the problem."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...errors import BadInput
from ..algebra.newton import Array
from ..curve.curve import Curve
from ..curve.settings import Within, windows


@dataclass(frozen=True)
class Bound:
    """The window of what can change: an unknown, a parameter, the norm of an array.

    Its `ends` are those that are finite: their side, -1 or 1, value, and how far rounding may leave
    a step that should end there.
    """

    name: str
    slot: int | slice
    low: float
    high: float
    ends: list[tuple[int, float, float]]

    def value(self, z: Array) -> float:
        entries = z[self.slot]
        return float(entries if isinstance(self.slot, int) else np.linalg.norm(entries))

    def row(self, z: Array) -> Array:
        row, alone = np.zeros(z.size), isinstance(self.slot, int)
        # d|u| = u . du / |u|
        row[self.slot] = 1.0 if alone else z[self.slot] / (self.value(z) or 1.0)
        return row

    def with_value(self, z: Array, value: float) -> Array:
        """z with exactly this value."""
        z = z.copy()
        if isinstance(self.slot, int):
            z[self.slot] = value
        else:
            z[self.slot] *= value / self.value(z)
        return z


def bounds_of(curve: Curve, within: Within) -> list[Bound]:
    """The window and the domain of the problem, of all that can change."""
    problem = curve.problem
    wanted = {problem.normed(name) or name: window for name, window in within.items()}
    for name in wanted.keys() & problem.record.keys() - {*problem.names}:
        raise BadInput(
            f"{name!r} is recorded, and has no window; an event ends the branch where it has a "
            f"value: events=[cb.user({name!r}, value, terminal=True)]"
        )
    problem.check_names(wanted)
    bounds, domains = [], windows(problem.domain)
    for name in {**domains, **wanted}:
        low, high = wanted.get(name, (-math.inf, math.inf))
        domain = domains.get(name, (-math.inf, math.inf))
        low, high = max(low, domain[0]), min(high, domain[1])
        value: Any = problem.start.get(name, problem.params.get(name))
        size = float(np.linalg.norm(value)) if np.ndim(value) else float(value)
        if not low < high:
            raise BadInput(f"the window of {name!r} is empty: ({low:g}, {high:g})")
        what = f"|{name}|" if np.ndim(value) else name
        if what != name and -math.inf < low < 0:
            raise BadInput(
                f"{name!r} is an array: its window is one of its norm, which is never negative; "
                f"got ({low:g}, {high:g})"
            )
        if not low <= size <= high:
            raise BadInput(f"the start has {what}={size:g}, outside ({low:g}, {high:g})")
        if name in curve.slots:
            finite = [(side, end) for side, end in ((-1, low), (1, high)) if math.isfinite(end)]
            ends = [(side, end, 4 * math.ulp(end or 1e-16)) for side, end in finite]
            bounds.append(Bound(name, curve.slots[name], low, high, ends))
    return bounds
