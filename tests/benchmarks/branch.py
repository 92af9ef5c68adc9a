"""A branch of closure points, without events, against solving the same points one by one."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import root

from .measure import Row, best_of, micro
from .peers.closure import GAMMA, POINTS, K, branch_length, chi

Array = NDArray[np.float64]


def walk() -> Any:
    """About 2000 points from a = 1 through the fold and back to a = 1, as every peer is given."""
    import contbreather as cb

    step = branch_length(GAMMA, K) / POINTS
    start = cb.symmetric(a=0.9999999, gamma=GAMMA, k=K)
    steps = cb.Steps(first=step, largest=step, most=2 * POINTS)
    return cb.trace(start, "a", within={"a": (0.0, 1.0)}, towards="both", events=(), steps=steps)


def one_by_one(a: Array, p: Array, phi: Array) -> Array:
    """(11) at each `a` by `scipy.optimize.root`, from the point before; columns p, phi."""
    slope, q = chi(GAMMA), (1 - K) / (1 + K)

    def closure(x: Array, a: float) -> list[float]:
        p, phi = x.tolist()
        return [p * slope + a * math.cos(phi) - 1, -a * math.sin(phi) - p * q]

    found = np.empty((a.size, 2))
    guess = np.array([p[0], phi[0]])
    for i, value in enumerate(a.tolist()):
        found[i] = guess = root(closure, guess, args=(value,)).x
        guess = np.array([p[i], phi[i]])
    return found


def rows() -> list[Row]:
    branch = walk()
    a, p, phi = (np.asarray(branch[name]) for name in ("a", "p", "phi"))
    found = one_by_one(a, p, phi)
    same = np.abs(found - np.column_stack([p, phi])).max(axis=1) < 1e-6
    ours = best_of(walk) / a.size
    theirs = best_of(lambda: one_by_one(a, p, phi)) / a.size
    return [
        Row(
            what=f"branch of {a.size} closure points, events off, a point",
            figure=micro(ours),
            compares_with=f"a loop of scipy.optimize.root over the same points: {micro(theirs)}",
            ratio=theirs / ours,
            aim="< 100 µs a point",
            met=ours < 100e-6,
            note=f"the loop misses {np.count_nonzero(~same)} of the points (near the fold)",
        )
    ]
