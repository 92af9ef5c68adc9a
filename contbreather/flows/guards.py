"""Where a guard falls through zero, or dips below it, within a step of an integrator."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from ..continuation.newton import Array, Undefined
from ..errors import BadInput
from .flow import Function, Params, place, values

_NODES = 9  # of the polynomial that a guard must be like within a step, or the step is halved
# Chebyshev's points of degree 16; every other one is one of degree 8, and the polynomial through
# those is compared with the guard at the rest
_PLACES = 0.5 - 0.5 * np.cos(np.pi * np.arange(2 * _NODES - 1) / (2 * _NODES - 2))
_POWERS = partial(np.polynomial.chebyshev.chebvander, deg=_NODES - 1)
_BETWEEN = _POWERS(2 * _PLACES[1::2] - 1) @ np.linalg.inv(_POWERS(2 * _PLACES[::2] - 1))
_ALIKE = 1e-3  # relative to its size there
_HALVINGS = 8
_SHIFTED = 1.0 + 1e-6  # a state times this is another one
_LATE = 10  # places within a step, from its 500th part on, where a guard that is smooth changes
_EDGE = 1e-12  # a guard this small, relative to what it is made of, is zero
_PATIENT = 10_000  # steps to a zero that may be a multiple one
_SHALLOW = 0.3  # of the fall to it, a minimum that may dip below zero between two nodes

Guard = Callable[[Array], Array]  # over times


class GuardOnPiece:
    """A guard along one piece: positive, and zero where the piece ends."""

    def __init__(
        self, name: str, function: Function, field: Function, params: Params, *, rough: bool
    ) -> None:
        self.name, self.function, self.field, self.params = name, function, field, params
        self.rough = rough  # a start may lie a little behind it, if it is on its way inside
        self.armed = False  # it was seen to be positive

    def fall(self, step: Callable[[Any], Array], a: float, b: float) -> float:
        """The first time in a step at which the guard falls through zero, infinite without one."""

        def guard(t: Array) -> Array:
            value = values(self.function, t, step(t), self.params)[0]
            if np.isnan(value).any():
                at = float(t[np.isnan(value)][0])
                raise Undefined(f"{self.name} is NaN {place(at, step(at))}")
            return value

        if not self.armed:
            a = self._arm(guard, a, b, self._size(step, a, b))
        return _first_fall(guard, a, b) if self.armed else math.inf

    def _size(self, step: Callable[[Any], Array], a: float, b: float) -> float:
        """That of the states which the guard knows, or how fast it changes."""
        x = step(b)
        moved = np.where(x, x * _SHIFTED, _SHIFTED - 1.0)
        beside = np.where(np.eye(x.size, dtype=bool), moved, x[:, None])
        states = np.column_stack([x, beside])
        try:
            level, pace = (values(f, b, states, self.params) for f in (self.function, self.field))
        except Undefined:  # a little further it has no value
            involved = np.ones(x.size, dtype=bool)
        else:
            involved = level[0, 1:] != level[0, 0]
            involved = involved | (pace[involved, 1:] != pace[involved, :1]).any(axis=0)
        return float(abs(np.append(step(a)[involved], x[involved])).max(initial=0.0))

    def _arm(self, guard: Guard, a: float, b: float, size: float) -> float:
        """The time from which the guard is clearly positive: it may begin at zero, by a reset."""
        t = np.append(a, a + (b - a) * 2.0 ** np.arange(-40, 1))  # where flights are short, too
        g = guard(t)
        # late, rounding of the time moves what changes within the step
        late = np.finfo(float).eps * abs(a) / (b - a) * np.ptp(g)
        edge = _EDGE * (size + abs(g).max()) + late
        clear = np.flatnonzero(abs(g) > edge)
        inside = np.flatnonzero(g > edge)
        if self.rough and inside.size and (np.diff(g[: inside[0] + 1]) >= 0).all():
            clear = inside
        if clear.size and g[clear[0]] < 0:
            look = "look at the start or the reset"
            if np.count_nonzero(np.diff(g[-_LATE:])) < _LATE // 2:
                look = "it changes in jumps alone: in place of sign(x[0]) or floor(x[0]) give x[0]"
            raise BadInput(
                f"the state at t = {a:g} lies behind {self.name}, or falls through it at once: "
                f"{self.name} = {g[0]:.3g} there, {g[clear[0]]:.3g} after {t[clear[0]] - a:.1g}. "
                f"It must be positive inside the flow; {look}"
            )
        self.armed = bool(clear.size)
        return float(t[clear[0]]) if clear.size else b


def _first_fall(guard: Guard, a: float, b: float, halvings: int = _HALVINGS) -> float:
    """On as many points as it takes for the guard to be like a polynomial between them."""
    t = a + (b - a) * _PLACES
    g = guard(t)
    alike = _ALIKE * (g.max() - g.min()) + _EDGE * abs(g).max()  # constant but for rounding: is one
    if halvings and b > a and not (abs(_BETWEEN @ g[::2] - g[1::2]) <= alike).all():
        middle = 0.5 * (a + b)
        first = _first_fall(guard, a, middle, halvings - 1)
        return first if math.isfinite(first) else _first_fall(guard, middle, b, halvings - 1)
    least = np.append(True, g[:-1] > g[1:]) & np.append(g[:-1] <= g[1:], True)
    fallen = np.append(False, (g[1:] <= 0) & (g[:-1] > 0))
    for i in np.flatnonzero(least | fallen).tolist():
        left, right = max(i - 1, 0), min(i + 1, t.size - 1)
        if fallen[i]:
            return root(guard, t[left], t[i])
        # A minimum may lie beside the first or the last node; and of two nodes as far from one the
        # first is lower, or as low: rounding decides. So two nodes on each side tell its depth.
        around = g[max(i - 2, 0) : i + 3]
        if 0 < g[i] < _SHALLOW * (around.max() - g[i]):
            dip = _minimum(guard, t[left], t[right])
            if guard(np.array([dip]))[0] <= 0:
                return root(guard, t[left], dip)
    return math.inf


def root(guard: Guard, a: float, b: float) -> float:
    from scipy.optimize import brentq

    spacing = np.spacing(max(abs(a), abs(b)))  # no time lies in between
    start, end = guard(np.array([a, b]))

    def fallen(s: float) -> float:
        value = float(guard(np.array([a + s]))[0])
        # one that stays zero has fallen where it came to it
        return value if value > 0.0 or end < 0.0 else -float(start)

    # at a double or triple zero it is hardly sooner there than by halving, a few hundred times
    return float(a + brentq(fallen, 0.0, b - a, xtol=spacing, maxiter=_PATIENT))


def _minimum(guard: Guard, a: float, b: float) -> float:
    """Where it is least, on grids around the least value of the one before: to 6e-8 of the way,
    as close as rounding can tell."""
    for _ in range(8):
        t = np.linspace(a, b, 17)
        i = int(np.argmin(guard(t)))
        a, b = t[max(i - 1, 0)], t[min(i + 1, 16)]
    return float(t[i])
