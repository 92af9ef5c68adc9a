"""HOM: the period grows without bound, for the cycle comes to rest at an equilibrium.

A cycle of a long period is as good as the homoclinic orbit: the parameter is off by about the
exponential of minus the period times the leading eigenvalue. So it is found where a branch ends,
and followed in two parameters at the period it has there.
"""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..continuation.curve import Curve
from ..continuation.newton import Array, Undefined
from ..continuation.point import Event, Examined, Locus, Point
from .equations import Equations
from .flow import Flow, Params, slopes, values
from .orbit import Cycle, equations_of

_REST = 1e-6  # of its largest speed: an orbit that is as slow as this somewhere comes to rest there
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
    slow, _ = _slowest(point.ground.solution)
    return math.log(max(slow, 1e-300) / _REST)


def _examine(point: Point) -> Examined:
    """Which equilibrium that is: a relaxation oscillation is slow without one."""
    orbit: Cycle = point.ground.solution
    if orbit.coarse:
        return orbit.coarse
    _, slow = _slowest(orbit)
    sizes = orbit.equations.sizes[0]
    with suppress(Undefined):
        rest, eigenvalues = _equilibrium(orbit.equations.flows[0], slow, orbit.params)
        if np.linalg.norm((rest - slow) / sizes) < _CLOSE:
            return _saddle(orbit, rest, eigenvalues)
    states = orbit.flights[0].at(np.linspace(0.0, 1.0, _LOOKS))
    there = np.linalg.norm((states - slow[:, None]) / sizes[:, None], axis=0) < _CLOSE
    if there.mean() < _MOSTLY:
        return "it is slow without an equilibrium"
    what = f"an equilibrium is about to appear on it, at {_named(orbit, slow)}"
    return {"equilibrium": slow, "said": f"the period grows without bound: {what}"}


def _saddle(orbit: Cycle, rest: Array, eigenvalues: Any) -> Examined:
    inwards, outwards = eigenvalues[eigenvalues.real < 0], eigenvalues[eigenvalues.real > 0]
    if not (inwards.size and outwards.size):
        return "the equilibrium that it is slow at is no saddle"
    leading = inwards[inwards.real.argmax()], outwards[outwards.real.argmin()]
    quantity = float(sum(leading).real)
    kind = "saddle-focus" if any(value.imag for value in leading) else "saddle"
    shown = " and ".join(
        f"{v.real:.6g}" + (f" +- {abs(v.imag):.6g}i" if v.imag else "") for v in leading
    )
    return {
        "equilibrium": rest,
        "saddle_quantity": quantity,
        "said": "the period grows without bound, to an orbit homoclinic to the "
        f"{kind} {_named(orbit, rest)}; leading eigenvalues {shown}, saddle quantity "
        f"{quantity:.6g}",
    }


def _named(orbit: Cycle, state: Array) -> str:
    return ", ".join(f"{n} = {v:.6g}" for n, v in zip(orbit.equations.states, state, strict=False))


def _equilibrium(flow: Flow, x: Array, p: Params) -> tuple[Array, Any]:
    """The equilibrium by Newton's iteration from a state beside it, and its eigenvalues."""
    for _ in range(_ITERATIONS):
        found, derivative = slopes(flow.f, 0.0, x[:, None], p)
        matrix = derivative[:, : x.size, 0]
        try:
            step = np.linalg.solve(matrix, found[:, 0])
        except np.linalg.LinAlgError as error:
            raise Undefined("its derivative is singular") from error
        if not np.isfinite(step).all():
            break
        x = x - step
        if abs(step).max() <= _SOLVED * (1 + abs(x).max()):
            return np.where(abs(x) > _SOLVED, x, 0.0), np.linalg.eigvals(matrix)
    raise Undefined("Newton's iteration finds none")


def _long(point: Point) -> Locus:
    """Cycles of the period that the one has that is as good as homoclinic."""
    equations, period = equations_of(point.ground), point.ground.solution.period
    held = _Held(equations, period)
    nothing = dict.fromkeys(("LP", "BP", "PD", "NS"), ())  # multipliers are 0 or without bound
    return Locus({}, held.condition, held.derivative, meets=nothing)


@dataclass(frozen=True, eq=False)
class _Held:
    """The period stays what it was."""

    equations: Equations
    period: float

    def condition(self, curve: Curve, z: Array, extra: Array) -> Array:
        return np.array([z[self.equations.lengths].sum() - self.period])

    def derivative(self, curve: Curve, z: Array, extra: Array) -> Array:
        row = np.zeros((1, z.size))
        row[0, self.equations.lengths] = 1.0
        return row


HOMOCLINIC = Event("HOM", _pace, locus=_long, examine=_examine, ends="branch")
