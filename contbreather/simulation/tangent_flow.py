"""Kernel of the variational flow of an impacting lattice: flights and saltations."""

from __future__ import annotations

import math

from contbreather.kernels import Counts, Kernel, Matrix, Signs, Vector
from contbreather.simulation.arguments import Parameters
from contbreather.simulation.sticking import any_at_rest
from contbreather.simulation.taylor import expand, expand_any, state_at


def fly(
    du: Matrix, dv: Matrix, at_rest: Signs, span: float, on: Parameters, zeros: Vector,
    nowhere: Vector, rows: Matrix,
) -> None:  # fmt: skip
    """All perturbations over a time without events."""
    anyone, left = any_at_rest(at_rest), span
    while left > 0.0:
        h = min(on.step, left)  # nothing is driven: the harmonics of the forcing do not count
        for i in range(du.shape[0]):
            if anyone or not on.ring:
                expand_any(du[i], dv[i], h, on.mu, on.bonds, at_rest, nowhere, zeros, rows)
            else:
                expand(du[i], dv[i], h, on.gamma, on.mu, rows)
            state_at(rows, h, 1.0, du[i], dv[i])
        left -= h


def kick(du: Matrix, dv: Matrix, at_rest: Signs, n: int, entry: float, on: Parameters) -> None:
    """One event: the block of (19), the beginning of a rest (NaN), or its end (infinite)."""
    if math.isinf(entry):
        at_rest[n] = 0
        return
    if math.isnan(entry):
        at_rest[n] = 1
    for i in range(du.shape[0]):
        u, v = du[i, n], dv[i, n]
        if at_rest[n] != 0:  # wherever it came from, the site is at its wall
            du[i, n] = dv[i, n] = 0.0
        else:
            du[i, n] = -on.k * u
            dv[i, n] = -on.k * v + entry * u


def tangent_flow(
    du: Matrix, dv: Matrix, at_rest: Signs, span: float, on: Parameters, since: Vector,
    site: Counts, entry: Vector, zeros: Vector, nowhere: Vector, rows: Matrix,
) -> None:  # fmt: skip
    """Perturbations ``du, dv`` (m, N) over a time ``span`` with these events, in place.

    Nothing drives them and a site at rest has none: ``zeros`` and ``nowhere`` are zeros; ``rows``
    is room for a step.
    """
    s = 0.0
    for i in range(since.size):
        fly(du, dv, at_rest, since[i] - s, on, zeros, nowhere, rows)
        s = since[i]
        kick(du, dv, at_rest, site[i], entry[i], on)
    fly(du, dv, at_rest, span - s, on, zeros, nowhere, rows)


TANGENT_FLOW = Kernel(tangent_flow)
