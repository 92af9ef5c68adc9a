"""Exact flights of a finite lattice: every mode turns and decays, and answers the drive.

A mode obeys ``y'' + damping y' + z y = drive``, ``z = gamma lam + spring``. Its free motion over a
time t is ``y = C y0 + S y0'``, C and S being the solutions that start with (1, 0) and (0, 1):

    ``S = e^(-damping t/2) t s(x)``, ``C = e^(-damping t/2) c(x) + damping S/2``,
    ``x = (z - damping^2/4) t^2``, ``c(x) = cos sqrt(x)``, ``s(x) = sin(sqrt x)/sqrt(x)``,

entire functions of x, so that drifting (z = 0) and overdamped modes need no case of their own.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from contbreather.errors import BadInput
from contbreather.kernels import Kernel, Matrix, Vector, inlined
from contbreather.lattice.finite import Finite
from contbreather.lattice.forcing import Forcing, Harmonics

FloatArray = NDArray[np.float64]
Array = NDArray[Any]


class ModalPropagator(NamedTuple):
    """One free flight of every mode, as a matrix ``[[cosine, reach], [-pull, swing]]``."""

    cosine: FloatArray  # C
    reach: FloatArray  # S
    pull: FloatArray  # z S = -C'
    swing: FloatArray  # C - damping S = S'

    def __call__(self, q: Array, r: Array) -> tuple[Array, Array]:
        """Displacements and velocities of the modes after the flight; columns at once."""
        c, s, p, d = self if q.ndim == 1 else (row[:, None] for row in self)
        return c * q + s * r, d * r - p * q


def propagator(z: FloatArray, time: float, damping: float = 0.0) -> ModalPropagator:
    """The flight over a time of modes with stiffness z."""
    out = np.empty((3, z.size))
    PROPAGATORS(z, damping, time, out)
    cosine, reach, swing = out
    return ModalPropagator(cosine, reach, z * reach, swing)


@inlined
def mode_solutions(z: float, damping: float, t: float) -> tuple[float, float, float]:
    """C, S and S' of a mode: S is finite at z = 0, and overdamped modes neither overflow nor
    cancel."""
    x, lost = (z - 0.25 * damping * damping) * t * t, 0.5 * damping * t
    root, decay = math.sqrt(abs(x)), math.exp(-lost)
    if x >= 0.0:
        c, s = decay * math.cos(root), decay * math.sin(root)
    else:
        grown, fallen = math.exp(root - lost), math.exp(-root - lost)
        c = 0.5 * (grown + fallen)
        s = decay * math.sinh(root) if root < 1.0 else 0.5 * (grown - fallen)
    S = t * (s / root if root > 0.0 else decay)
    return c + 0.5 * damping * S, S, c - 0.5 * damping * S


def propagators(z: Vector, damping: float, time: float, out: Matrix) -> None:
    """C, S and S' of each mode after a time, in rows."""
    for i in range(z.size):
        out[0, i], out[1, i], out[2, i] = mode_solutions(z[i], damping, time)


PROPAGATORS = Kernel(propagators)


def free_multipliers(z: FloatArray, damping: float, time: float) -> tuple[Array, Array]:
    """The two multipliers of each mode over a flight without impacts, ``exp(+-i w t)`` undamped."""
    w = np.sqrt(z - 0.25 * damping * damping + 0j)
    return np.exp((1j * w - 0.5 * damping) * time), np.exp((-1j * w - 0.5 * damping) * time)


# --- the answer to the drive --------------------------------------------------------------------


_ORDERS = np.arange(4)[:, None, None]


class DrivenSpectrum(NamedTuple):
    """Complex amplitudes: one column a harmonic m, one row a site (one row where all are alike).

    ``f_n(t) = Re sum of c_nm exp(i m t)``.
    """

    m: FloatArray
    table: Array

    def along(self, sites: Sequence[int], times: FloatArray) -> FloatArray:
        """Value and three derivatives of each site at its time, shape (4, times)."""
        rows = self.table[np.array(sites)] if len(self.table) > 1 else self.table
        turn = 1j * self.m
        wave = rows * np.exp(np.multiply.outer(times, turn))
        return np.asarray((wave * turn**_ORDERS).real.sum(axis=-1))

    def everywhere(self, t: Any, order: int) -> FloatArray:
        """The order-th derivative for all rows, shape ``(*t.shape, rows)``."""
        wave = np.exp(1j * np.multiply.outer(np.asarray(t, dtype=float), self.m))
        return np.asarray((wave @ (self.table * (1j * self.m) ** order).T).real)

    def harmonics(self, site: int) -> Harmonics:
        """The motion of one site as a series (m, A, B), ``A cos mt + B sin mt``."""
        row = self.table[0 if len(self.table) == 1 else site]
        return tuple((int(o), c.real, -c.imag) for o, c in zip(self.m, row.tolist(), strict=True))


@lru_cache(maxsize=64)
def driven_spectrum(
    lattice: Finite,
    forcing: Forcing,
    gamma: float,
    spring: float,
    damping: float,
    by: str = "",
) -> DrivenSpectrum:
    """The forced motion of every site of an even lattice at unit amplitude, without that by a mean,
    or its derivative in a parameter of the forcing, in gamma, spring or damping."""
    own = by if by in forcing.params else ""
    m, shapes, lam, pushes, limits = driven_modes(lattice, forcing, own)
    gap = (gamma * lam + spring) - m * m + 1j * m * damping
    low = abs(gap) <= limits
    if low.any():
        raise BadInput(
            f"the drive is in resonance: at gamma = {gamma:.9g}, spring = {spring:.9g} a mode of "
            f"the {lattice.describe()} has the frequency {m[np.argwhere(low)[0, 1]]:g} of one of "
            "its harmonics, and without damping grows without bound; change gamma, spring or "
            "damping."
        )
    answer = pushes / gap
    if by and not own:  # d(F/gap) = -F/gap^2 d(gap)
        rises: dict[str, Any] = {"gamma": lam, "spring": 1.0, "damping": 1j * m}
        answer = -answer * rises.get(by, 0.0) / gap
    return DrivenSpectrum(m, np.asarray(shapes @ answer))


@lru_cache(maxsize=64)
def driven_modes(
    lattice: Finite, forcing: Forcing, by: str = ""
) -> tuple[FloatArray, FloatArray, FloatArray, Array, FloatArray]:
    """Harmonics of a drive, or of its derivative, shapes of the modes that it moves, their lam, how
    each harmonic pushes each, and how near to it a mode answers it beyond all bounds."""
    lam, shapes, share = lattice.driven_modes
    m, F = forces_of(forcing, by)
    limits = np.where(F != 0.0, 1e-12 * m * m, -1.0)
    return m, shapes, lam[:, None], share[:, None] * F, limits


@lru_cache(maxsize=256)
def forces_of(forcing: Forcing, by: str) -> tuple[FloatArray, Array]:
    """Orders and amplitudes of a drive, or of its derivative in one of its parameters."""
    series = forcing.slope_harmonics(by) if by else forcing.harmonics
    waves = [row for row in series if row[0]]  # what a mean does depends on who is held
    m, A, B = np.array(waves, dtype=float).reshape(-1, 3).T
    return m, -m * m * (A - 1j * B)  # f'' = F
