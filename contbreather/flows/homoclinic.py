"""HOM: the period grows without bound, for the cycle comes to rest at an equilibrium.

A cycle of a long period T is as good as the homoclinic orbit. The parameter is off by about
``exp(-a T)`` with a the smaller one, in size, of the leading eigenvalues +-a and -+b, one to each
side, while the orbit slows down by ``d = exp(-a b T / (a + b))``: so by ``d^(1 + a / b)``. Beyond
rounding and the mesh decide where it folds. So it is found where a branch ends, and followed in two
parameters at the period it has there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..continuation.curve import Curve
from ..continuation.newton import Array
from ..continuation.point import DefiningSystem, Event, Examined, Point
from .equations import Equations
from .flow import slopes, values
from .orbit import Cycle, equations_of

_OFF = 1e-8  # how far off the parameter is, but for a factor, where an orbit has come to rest
_SLOW = 1e-3  # of its largest speed: an equilibrium is looked for
_UNKNOWN = 0.5  # a / b where there is none, as before a saddle-node
_CLOSE = 1e-2  # of its size: an equilibrium this close is what it rests at
_LOOKS, _MOSTLY = 400, 0.5  # or it is there for most of its time: one is about to appear
_ITERATIONS, _SOLVED = 30, 1e-12


def _slowest(orbit: Cycle) -> tuple[float, Array]:
    """The smallest speed relative to the largest, and the state where that is."""
    flow, flight = orbit.equations.flows[0], orbit.flights[0]
    moved = values(flow.f, flight.begins, flight.states, orbit.params)
    speeds = np.linalg.norm(moved / orbit.equations.sizes[0][:, None], axis=0)
    j = int(speeds.argmin())
    return float(speeds[j] / speeds.max()), flight.states[:, j]


def _pace(point: Point) -> float:
    orbit: Cycle = point.base_point.solution
    pace, slow = _slowest(orbit)
    ratio, near = _UNKNOWN, _saddle(orbit, slow) if pace < _SLOW else None
    if near is not None:
        sizes = abs(near.leading.real)
        ratio = sizes.min() / sizes.max()
    # ln of d^(1 + a/b) over _OFF, with the least speed for d
    return (1 + ratio) * math.log(max(pace, 1e-300)) - math.log(_OFF)


def _examine(point: Point) -> Examined:
    """Which equilibrium that is: a relaxation oscillation is slow without one."""
    orbit: Cycle = point.base_point.solution
    if orbit.coarse:
        return orbit.coarse
    _, slow = _slowest(orbit)
    near = _saddle(orbit, slow)
    if near is not None:
        return near.description(orbit)
    sizes = orbit.equations.sizes[0]
    states = orbit.flights[0].at(np.linspace(0.0, 1.0, _LOOKS))
    there = np.linalg.norm((states - slow[:, None]) / sizes[:, None], axis=0) < _CLOSE
    if there.mean() < _MOSTLY:
        return "it is slow without an equilibrium"
    what = f"an equilibrium is about to appear on it, at {_named(orbit, slow)}"
    return {"equilibrium": slow, "said": f"the period grows without bound: {what}"}


@dataclass(frozen=True, eq=False)
class _Saddle:
    """A saddle, and its eigenvalues next to the imaginary axis on either side."""

    state: Array
    leading: NDArray[np.complex128]

    def description(self, orbit: Cycle) -> dict[str, Any]:
        # Re lambda_s + Re lambda_u: its sign decides which cycles come from the orbit
        quantity = float(self.leading.sum().real)
        kind = "saddle-focus" if self.leading.imag.any() else "saddle"
        shown = " and ".join(
            f"{v.real:.6g}" + (f" +- {abs(v.imag):.6g}i" if v.imag else "") for v in self.leading
        )
        return {
            "equilibrium": self.state,
            "saddle_quantity": quantity,
            "said": "the period grows without bound, to an orbit homoclinic to the "
            f"{kind} {_named(orbit, self.state)}; leading eigenvalues {shown}, saddle quantity "
            f"{quantity:.6g}",
        }


def _named(orbit: Cycle, state: Array) -> str:
    return ", ".join(f"{n} = {v:.6g}" for n, v in zip(orbit.equations.states, state, strict=False))


def _saddle(orbit: Cycle, x: Array) -> _Saddle | None:
    """The saddle close to a state, by Newton's iteration from there; None if there is none."""
    flow, sizes, start = orbit.equations.flows[0], orbit.equations.sizes[0], x
    for _ in range(_ITERATIONS):
        velocity, derivative = slopes(flow.f, 0.0, x[:, None], orbit.params)
        matrix = derivative[:, : x.size, 0]
        try:
            step = np.linalg.solve(matrix, velocity[:, 0])
        except np.linalg.LinAlgError:
            return None
        x = x - step
        if not np.linalg.norm((x - start) / sizes) < _CLOSE:
            return None
        if (abs(step) <= _SOLVED * (sizes + abs(x))).all():
            break
    eigenvalues = np.linalg.eigvals(matrix)
    inwards, outwards = eigenvalues[eigenvalues.real < 0], eigenvalues[eigenvalues.real > 0]
    if not (inwards.size and outwards.size):
        return None
    leading = np.array([inwards[inwards.real.argmax()], outwards[outwards.real.argmin()]])
    return _Saddle(np.where(abs(x) > _SOLVED * sizes, x, 0.0), leading)


def _long(point: Point) -> DefiningSystem:
    """Cycles of the period that the one has that is as good as homoclinic."""
    equations, period = equations_of(point.base_point), point.base_point.solution.period
    held = _Held(equations, period)
    nothing = dict.fromkeys(("LP", "BP", "PD", "NS"), ())  # multipliers are 0 or without bound
    return DefiningSystem({}, held.condition, held.derivative, meets=nothing)


@dataclass(frozen=True, eq=False)
class _Held:
    """The period stays what it was."""

    equations: Equations
    period: float

    def condition(self, curve: Curve, z: Array, extra: Array) -> Array:
        return np.array([z[self.equations.layout.lengths].sum() - self.period])

    def derivative(self, curve: Curve, z: Array, extra: Array) -> Array:
        row = np.zeros((1, z.size))
        row[0, self.equations.layout.lengths] = 1.0
        return row


HOMOCLINIC = Event("HOM", _pace, locus=_long, examine=_examine, ends="branch")
