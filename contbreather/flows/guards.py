"""Zeros of guards within a step of an integrator: a dense check, then brentq."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from ..continuation.algebra.newton import Array, Undefined
from ..errors import BadInput
from .flow import Function, Params, place, values

_FEWEST, _MOST = 16, 4096  # parts of a step between which a guard is looked at
_EDGE = 1e-12  # a guard this small, relative to what it is made of, is zero

Guard = Callable[[Array], Array]  # over times


@dataclass
class GuardOnPiece:
    """A guard along one piece: positive, and zero where the piece ends."""

    name: str
    function: Function
    field: Function
    params: Params
    rough: bool  # a start may lie a little behind it, if it is on its way inside
    armed: bool = False  # it was seen to be positive

    def fall(self, step: Callable[[Any], Array], a: float, b: float) -> float:
        """Return the first time in a step at which the guard falls through zero, or infinity."""

        def guard(t: Array) -> Array:
            value = values(self.function, t, step(t), self.params)[0]
            if np.isnan(value).any():
                at = float(t[np.isnan(value)][0])
                raise Undefined(f"{self.name} is NaN {place(at, step(at))}")
            return value

        if not self.armed:
            a = self._arm(guard, a, b, self._size(step(a), b, step(b)))
        return _first_fall(guard, a, b) if self.armed else math.inf

    def _size(self, before: Array, b: float, after: Array) -> float:
        """Measure the states that the guard depends on, or its change: those it is made of."""
        moved = after[:, None] + np.diag(1e-6 * np.where(after, after, 1.0))  # another state
        states = np.column_stack([after, moved])
        try:
            level, pace = (values(f, b, states, self.params) for f in (self.function, self.field))
        except Undefined:  # a little further it has no value
            return float(abs(np.append(before, after)).max())
        involved = level[0, 1:] != level[0, 0]
        involved |= (pace[involved, 1:] != pace[involved, :1]).any(axis=0)
        return float(abs(np.append(before[involved], after[involved])).max(initial=0.0))

    def _arm(self, guard: Guard, a: float, b: float, size: float) -> float:
        """Return the time from which the guard is positive: by a reset it may begin at zero."""
        t = np.append(a, a + (b - a) * 2.0 ** np.arange(-40, 1))  # where flights are short, too
        g = guard(t)
        # late, rounding of the time moves what changes within the step
        edge = _EDGE * (size + abs(g).max()) + np.finfo(float).eps * abs(a) / (b - a) * np.ptp(g)
        clear, inside = np.flatnonzero(abs(g) > edge), np.flatnonzero(g > edge)
        if self.rough and inside.size and (np.diff(g[: inside[0] + 1]) >= 0).all():
            clear = inside
        if clear.size and g[clear[0]] < 0:
            look = "look at the start or the reset"
            # from the 500th part of a step on one that is smooth changes from place to place
            if np.count_nonzero(np.diff(g[-10:])) < 5:
                look = "it changes in jumps alone: in place of sign(x[0]) or floor(x[0]) give x[0]"
            raise BadInput(
                f"the state at t = {a:g} lies behind {self.name}, or falls through it at once: "
                f"{self.name} = {g[0]:.3g} there, {g[clear[0]]:.3g} after {t[clear[0]] - a:.1g}. "
                f"It must be positive inside the flow; {look}"
            )
        self.armed = bool(clear.size)
        return float(t[clear[0]]) if clear.size else b


def _first_fall(guard: Guard, a: float, b: float) -> float:
    """Look at twice as many places until the guard is smooth between them."""
    parts, t = _FEWEST, a + (b - a) * _places(_FEWEST)
    g = guard(t)
    # a cubic through neighbours leaves fourth differences: a tenth of the range may hide dips
    while parts < _MOST and abs(np.diff(g, 4)).max() > 0.1 * np.ptp(g) + _EDGE * abs(g).max():
        parts *= 2
        t = a + (b - a) * _places(parts)
        g = guard(t)
    least = np.append(True, g[:-1] > g[1:]) & np.append(g[:-1] <= g[1:], True)
    fallen = np.append(False, (g[1:] <= 0) & (g[:-1] > 0))
    for i in np.flatnonzero(least | fallen).tolist():
        left, right = max(i - 1, 0), min(i + 1, parts)
        if fallen[i]:
            return root(guard, t[left], t[i])
        # A minimum may lie beside the first or the last place; and of two places as far from one
        # the first is lower, or as low: rounding decides. So two places to each side tell its depth
        around = g[max(i - 2, 0) : i + 3]
        if 0 < g[i] < 0.3 * (around.max() - g[i]):  # shallow beside the fall to it
            place, value = bottom(guard, t[left], t[right])
            if value <= 0:
                return root(guard, t[left], place)
    return math.inf


def bottom(function: Guard, low: float, high: float) -> tuple[float, float]:
    """Find the lowest place of a function between two, and its value there."""
    for _ in range(8):  # to 6e-8 of the way, as close as rounding can tell
        places = np.linspace(low, high, 17)
        found = function(places)
        j = int(found.argmin())
        low, high = places[max(j - 1, 0)], places[min(j + 1, 16)]
    return float(places[j]), float(found[j])


@cache
def _places(parts: int) -> Array:
    """Divide a step so that no two parts are alike: an oscillation is not taken for a constant."""
    return np.asarray(0.5 - 0.5 * np.cos(np.pi * np.arange(parts + 1) / parts))


def root(guard: Guard, a: float, b: float) -> float:
    """Locate the fall of a guard between two times to rounding."""
    from scipy.optimize import brentq

    spacing = np.spacing(max(abs(a), abs(b)))  # no time lies in between
    start, end = guard(np.array([a, b]))

    def fallen(s: float) -> float:
        value = float(guard(np.array([a + s]))[0])
        # one that stays zero has fallen where it came to it
        return value if value > 0.0 or end < 0.0 else -float(start)

    # at a double or triple zero it is hardly sooner there than by halving, a few hundred times
    return float(a + brentq(fallen, 0.0, b - a, xtol=spacing, maxiter=10_000))
