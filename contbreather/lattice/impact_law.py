"""The law of an impact: the velocity after it by that before, eq. (2), and its derivative."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from contbreather.checks import number

Array = NDArray[Any]
Restitution = Callable[[float], float]  # of a speed


@dataclass(frozen=True)
class ImpactLaw:
    """``u' -> -k u'``, with a number k, or one that depends on the speed before the impact.

    Attributes
    ----------
    k : float
    by_speed : callable, optional
        ``by_speed(speed)`` in place of k, from 0 to 1, as smooth as slopes are to be exact.
    """

    k: float
    by_speed: Restitution | None = None

    def at(self, speed: float) -> float:
        """The restitution coefficient at a speed."""
        if self.by_speed is None:
            return self.k
        name = f"restitution({speed:.6g})"
        return number(name, self.by_speed(speed), 0.0, 1.0, "a number from 0 to 1")

    def after(self, v: float) -> float:
        return -self.at(abs(v)) * v

    def slope(self, v: float) -> float:
        if self.by_speed is None:
            return -self.k
        h = 1e-4 * abs(v)  # differences of order 4 over so much are right to 1e-12
        near, far = (self.after(v + step) - self.after(v - step) for step in (h, 2.0 * h))
        return (8.0 * near - far) / (12.0 * h) if h else -self.at(0.0)

    def along(self, velocities: ArrayLike, shares: ArrayLike = 1.0) -> tuple[Array, Array]:
        """Ratios of the velocities after and before many impacts, at sites with these shares of k
        or of what is in its place, and slopes."""
        v, share = np.asarray(velocities, dtype=float), np.asarray(shares, dtype=float)
        if self.by_speed is None:
            ratios = np.full(v.shape, -self.k) * share
            return ratios, ratios.copy()
        ratios = np.array([-self.at(abs(x)) for x in v.tolist()], float)
        slopes = np.array([self.slope(x) for x in v.tolist()], float)
        return ratios * share, slopes * share
