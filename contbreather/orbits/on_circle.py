"""A multiplier on a circle: the defining system of PF, PD and NS, and how it changes along a curve.

The map of an orbit says where it has a multiplier (`contbreather.stability.modal_map.Map`). How
that changes along its unknowns is known in closed form to one representation
(`contbreather.orbits.closed_problem`); the others fly a perturbation beside the orbit.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contbreather.continuation.curve import Curve
from contbreather.continuation.derivatives import RELATIVE, differences, directional
from contbreather.continuation.point import DefiningSystem, Point

Array = NDArray[np.float64]
Conditions = Callable[[Curve, Array, Array], Array]
Slopes = Callable[[Conditions, Curve, Array, Array], Array]

STEP = 1e-4  # of unknowns of the order of one, and of parameters
STATE_STEP = 1e-3  # of velocities and accelerations at impacts, relative
SLOW = 0.1  # velocity before an impact below which a saltation changes within such a step
AT_ONCE = 1e-6  # impacts less apart than this are at once: mirror images of each other


@dataclass(frozen=True)
class OnCircle:
    """``radius exp(i pi nu)`` is a multiplier over the section.

    Parameters
    ----------
    radius : float
    nu : float, optional
        0 or 1, for a real multiplier; else one more unknown.
    lattice : InfiniteChain or Ring, optional
        Whose multipliers; those of the orbit's own lattice unless given.
    """

    radius: float = 1.0
    nu: float | None = None
    lattice: Any = None

    def locus(self, slopes: Slopes, nu: float | None = None, **more: Any) -> DefiningSystem:
        """With ``slopes(conditions, curve, z, extra)``, the derivative along a curve."""
        extra = {} if nu is None else {"nu": nu}
        return DefiningSystem(extra, self.conditions, partial(self._derivative, slopes), **more)

    def _derivative(self, slopes: Slopes, curve: Curve, z: Array, extra: Array) -> Array:
        return slopes(self.beside(curve, z, extra), curve, z, extra)

    def map(self, orbit: Any) -> Any:
        return orbit.map if self.lattice is None else orbit.map.on(self.lattice)

    def conditions(self, curve: Curve, z: Array, extra: Array) -> Array:
        map = self.map(Point(curve, z).solution)
        return self.real_parts(map.on_circle(self.angle(extra), self.radius))

    def beside(self, curve: Curve, z: Array, extra: Array) -> Conditions:
        """The same next to a place, cheaper and exact to first order where they vanish."""
        value = self.map(Point(curve, z).solution).beside(self.angle(extra), self.radius)
        return lambda curve, z, extra: self.real_parts(
            value(self.map(Point(curve, z).solution), self.angle(extra))
        )

    def angle(self, extra: Array) -> float:
        return float(extra[0]) if self.nu is None else self.nu

    def real_parts(self, value: complex) -> Array:
        return np.array([value.real, value.imag] if self.nu is None else [value.real])


def by_differences(
    conditions: Conditions,
    curve: Curve,
    z: Array,
    extra: Array,
    columns: Sequence[int] | None = None,
    step: float = STEP,
) -> Array:
    """To one side where a parameter is at the end of its domain: curves set out from gamma = 0. The
    first unknowns are the times of impacts, which stay in their order: where sites that are
    coupled change it there is a kink."""

    def near(variables: Array) -> Array:
        return conditions(curve, variables[: z.size], variables[z.size :])

    variables, scales = np.append(z, extra), np.append(curve.scales, np.ones(extra.size))
    orbit = Point(curve, z).solution
    finer = np.full(variables.size, RELATIVE / step)  # what `differences` divides its own step by
    finer[: orbit.times.size] = RELATIVE / min(step, _in_order(orbit))
    return differences(near, variables, columns, scales=scales, finer=finer, one_sided=True)


def _in_order(orbit: Any) -> float:
    """A relative step of times that keeps impacts in their order, but for those at once."""
    times = np.sort(orbit.times)
    # two steps, which is as far as five points go, are then half the shortest gap at most
    gaps = np.diff(times, append=times[0] + orbit.section.length)
    return float(gaps[gaps > AT_ONCE].min() / (4.0 * max(1.0, abs(times).max())))


def off_the_edge(conditions: Conditions, curve: Curve, z: Array, extra: Array) -> Array:
    """By steps of gamma and the angle that keep off the edge of the infinite chain's band, where F
    has a root."""
    map = Point(curve, z).solution.map
    steepness = 4.0 * map.periods**2 / map.edge  # of the edge, as nu, in gamma
    room = 0.02 * abs(2.0 * map.edge - float(extra[0])) / (1.0 + steepness)
    return by_differences(conditions, curve, z, extra, step=min(STEP, max(room, 1e-8)))


def by_impacts(conditions: Conditions, curve: Curve, z: Array, extra: Array) -> Array:
    """By differences, of exact modes: one perturbation flown once is cheap, and smooth.

    Of the state the map knows velocities and accelerations at the impacts, and these are linear in
    it: one direction for each of them tells what all modes do.
    """
    flight = Point(curve, z).solution.representation
    m, size = flight.t.size, 2 * flight.q.size

    def near(z: Array) -> Array:
        return conditions(curve, z, extra)

    others = [*range(m), *range(m + size, z.size + extra.size)]
    slow = min(abs(impact.velocity) for impact in flight.arrivals)
    step = RELATIVE * min(1.0, slow / SLOW)
    columns = by_differences(conditions, curve, z, extra, others, step)
    rows = np.zeros((len(columns), z.size + extra.size))
    rows[:, others] = columns
    # what the map knows is y = S x, so dF/dx = (dF/dy) S; along a column of pinv(S) one entry of y
    # changes alone
    values = [(abs(impact.velocity), abs(impact.acceleration)) for impact in flight.arrivals]
    sizes = [max(pair[: 1 + i]) for pair in values for i in range(2)]
    for shown, moved, large in zip(
        flight.impact_slopes, np.linalg.pinv(flight.impact_slopes).T, sizes, strict=True
    ):
        along = np.zeros(z.size)
        along[m : m + size] = STATE_STEP * large * moved
        rows[:, m : m + size] += np.multiply.outer(
            directional(near, z, along), shown / (STATE_STEP * large)
        )
    return rows
