"""Many symmetric breathers at once: what tests ask of the points of a branch in the amplitude.

One by one most of the time goes into making them. Here they are one breather with arrays for its
amplitude, momentum and phase.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contbreather.continuation.points import Points
from contbreather.orbits.clearance import least_margins
from contbreather.orbits.orbit import Orbit
from contbreather.orbits.symmetric_breather import saltation
from contbreather.stability.half_period import HalfMap

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class BreathersAlong:
    """Symmetric breathers of the infinite chain that differ in amplitude and roots alone."""

    first: Orbit
    a: Array
    p: Array
    phi: Array

    @property
    def map(self) -> HalfMap:
        """Theirs, with an array for b."""
        on = self.first.representation
        # (19): b = (1 + k)^2 [a f''(phi) - p eta]/(2p), eta of the coupling alone
        curvature, eta = on.forcing.d2f(self.phi), on.lattice.eta(on.gamma)
        return replace(self.first.map, b=saltation(self.a, on.k, self.p, curvature, eta)[1])

    def margins(self) -> Array:
        """The least margin of each."""
        # (4): a momentum of 2p is lost on the wall +1 at phi, and gained on -1 half a period later
        times = np.stack([self.phi, self.phi + np.pi], axis=1)
        impulses = np.stack([-2.0 * self.p, 2.0 * self.p], axis=1)
        return least_margins(self.first.motion, self.a, times, impulses)


def breathers_along(points: Points) -> BreathersAlong | None:
    """The breathers of points, None where they are no such breathers."""
    breathers: BreathersAlong | None = points.curve.once(
        "breathers", points.z, lambda z: _breathers(points)
    )
    return breathers


def _breathers(points: Points) -> BreathersAlong | None:
    curve: Any = points.curve
    if curve.free != ("a",) or curve.problem.beneath is not None:
        return None
    first = points[0].solution
    if not (first.symmetric and first.lattice.sites is None and isinstance(first.map, HalfMap)):
        return None
    p, phi, a = np.ascontiguousarray(points.z.T)
    # with p <= 0 the wall +1 would pull at its site
    return BreathersAlong(first, a, p, phi) if (p > 0.0).all() else None
