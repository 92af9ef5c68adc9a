"""The compiled loop of `contbreather.dynamics.tangent`: flights, saltations, orthonormalisation."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from contbreather.dynamics.compiled import compiled
from contbreather.dynamics.flow import Array, expand, expand_any, state_at
from contbreather.dynamics.law import Law


@compiled
def fly(
    du: Array,
    dv: Array,
    held: NDArray[np.int8],
    span: float,
    law: Law,
    still: Array,
    nowhere: Array,
    rows: Array,
) -> None:
    """All perturbations over a time without events."""
    anyone = False
    for n in range(held.size):
        anyone = anyone or held[n] != 0
    left = span
    while left > 0.0:
        h = min(law.step, left)
        for i in range(du.shape[0]):
            if anyone or not law.ring:
                expand_any(du[i], dv[i], h, law.mu, law.bonds, held, nowhere, still, rows)
            else:
                expand(du[i], dv[i], h, law.gamma, law.mu, rows)
            state_at(rows, h, 1.0, du[i], dv[i])
        left -= h


@compiled
def kick(du: Array, dv: Array, held: NDArray[np.int8], n: int, entry: float, law: Law) -> None:
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


@compiled
def orthonormalise(du: Array, dv: Array, growth: Array) -> None:
    """Gram and Schmidt, twice over, in order; logarithms of the lengths found."""
    for i in range(du.shape[0]):
        growth[i] = 0.0
        for sweep in range(2):
            for j in range(i):
                along = np.sum(du[i] * du[j]) + np.sum(dv[i] * dv[j])
                du[i] -= along * du[j]
                dv[i] -= along * dv[j]
            size = math.sqrt(np.sum(du[i] * du[i]) + np.sum(dv[i] * dv[i]))
            if sweep == 0 and size < 1e-280:  # k = 0 annihilates a direction; give it a new one
                growth[i] = -math.inf
                for n in range(du.shape[1]):
                    du[i, n] = 1.0 / (1.0 + n + i)
                    dv[i, n] = math.cos(1.0 + n * (i + 1.0))
                size = 1.0
            growth[i] += math.log(size)
            du[i] /= size
            dv[i] /= size


@compiled
def carry(
    du: Array, dv: Array, held: NDArray[np.int8], spans: Array, first: int, law: Law, since: Array,
    site: NDArray[np.int64], entry: Array, period: NDArray[np.int64], growth: Array,
) -> None:  # fmt: skip
    """Perturbations ``du, dv`` (m, N) over successive periods, in place.

    With ``growth`` of shape (periods, m) they are orthonormalised after each; (periods, 0): not.
    """
    rows, still = np.empty((law.size, du.shape[1])), np.zeros(law.size)
    nowhere, event = np.zeros(du.shape[1]), 0
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
