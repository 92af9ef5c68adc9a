"""The compiled loop of `simulation.tangent`: flights, saltations, orthonormalisation."""

from __future__ import annotations

import math

from contbreather.kernels import Counts, Kernel, Matrix, Signs, Vector
from contbreather.simulation.flow import expand, expand_any, state_at
from contbreather.simulation.resting import resting
from contbreather.simulation.room import Law


def fly(
    du: Matrix, dv: Matrix, held: Signs, span: float, law: Law, still: Vector, nowhere: Vector,
    rows: Matrix,
) -> None:  # fmt: skip
    """All perturbations over a time without events."""
    anyone, left = resting(held), span
    while left > 0.0:
        h = min(law.step, left)
        for i in range(du.shape[0]):
            if anyone or not law.ring:
                expand_any(du[i], dv[i], h, law.mu, law.bonds, held, nowhere, still, rows)
            else:
                expand(du[i], dv[i], h, law.gamma, law.mu, rows)
            state_at(rows, h, 1.0, du[i], dv[i])
        left -= h


def kick(du: Matrix, dv: Matrix, held: Signs, n: int, entry: float, law: Law) -> None:
    """One event: the block of (19), the beginning of a rest (NaN), or its end (infinite)."""
    if math.isinf(entry):
        held[n] = 0
        return
    if math.isnan(entry):
        held[n] = 1
    for i in range(du.shape[0]):
        u, v = du[i, n], dv[i, n]
        if held[n] != 0:
            du[i, n] = dv[i, n] = 0.0
        else:
            du[i, n] = -law.k * u
            dv[i, n] = -law.k * v + entry * u


def dot(du: Matrix, dv: Matrix, i: int, j: int) -> float:
    """The product of two perturbations."""
    first = second = 0.0
    for n in range(du.shape[1]):
        first += du[i, n] * du[j, n]
        second += dv[i, n] * dv[j, n]
    return first + second


def orthonormalise(du: Matrix, dv: Matrix, growth: Vector) -> None:
    """Gram and Schmidt, twice over, in order; logarithms of the lengths found."""
    for i in range(du.shape[0]):
        growth[i] = 0.0
        for sweep in range(2):
            for j in range(i):
                along = dot(du, dv, i, j)
                for n in range(du.shape[1]):
                    du[i, n] -= along * du[j, n]
                    dv[i, n] -= along * dv[j, n]
            size = math.sqrt(dot(du, dv, i, i))
            if sweep == 0 and size < 1e-280:  # k = 0 annihilates a direction; give it a new one
                growth[i] = -math.inf
                for n in range(du.shape[1]):
                    du[i, n] = 1.0 / (1.0 + n + i)
                    dv[i, n] = math.cos(1.0 + n * (i + 1.0))
                size = 1.0
            growth[i] += math.log(size)
            for n in range(du.shape[1]):
                du[i, n] /= size
                dv[i, n] /= size


def carry(
    du: Matrix, dv: Matrix, held: Signs, spans: Vector, first: int, law: Law, since: Vector,
    site: Counts, entry: Vector, period: Counts, growth: Matrix, still: Vector, nowhere: Vector,
    rows: Matrix,
) -> None:  # fmt: skip
    """Perturbations ``du, dv`` (m, N) over successive periods, in place.

    With ``growth`` of shape (periods, m) they are orthonormalised after each; (periods, 0): not.
    Nothing drives them and a site at rest has none: ``still`` and ``nowhere`` are zeros; ``rows``
    is room for a step.
    """
    event = 0
    for j in range(spans.size):
        s = 0.0
        while event < period.size and period[event] == first + j:
            fly(du, dv, held, since[event] - s, law, still, nowhere, rows)
            s = since[event]
            kick(du, dv, held, site[event], entry[event], law)
            event += 1
        fly(du, dv, held, spans[j] - s, law, still, nowhere, rows)
        if growth.shape[1] > 0:
            orthonormalise(du, dv, growth[j])


CARRY = Kernel(carry)
