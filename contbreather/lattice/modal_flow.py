"""Exact flights of a finite lattice: every mode turns and decays, and answers the drive.

A mode obeys ``y'' + damping y' + z y = drive``, ``z = gamma lam + spring``. Its free motion over a
time t is ``y = C y0 + S y0'``, C and S being the solutions that start with (1, 0) and (0, 1):

    ``S = e^(-damping t/2) t s(x)``, ``C = e^(-damping t/2) c(x) + damping S/2``,
    ``x = (z - damping^2/4) t^2``, ``c(x) = cos sqrt(x)``, ``s(x) = sin(sqrt x)/sqrt(x)``,

entire functions of x, so that drifting (z = 0) and overdamped modes need no case of their own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from contbreather.errors import BadInput
from contbreather.kernels import Cube, Kernel, Vector
from contbreather.lattice.finite import Finite, mode_solutions
from contbreather.lattice.forcing import Forcing, Harmonics

FloatArray = NDArray[np.float64]
Array = NDArray[Any]

MOST = 5_000  # modes, two rows each: 10^8 numbers
# a driven mode this close to a harmonic answers it beyond all bounds
RESONANT = 1e-12


def check_modes(lattice: Finite, modes: int) -> None:
    """Refuse more of them than a matrix of their perturbations is written down for."""
    if modes > MOST:
        raise BadInput(
            f"{lattice.describe()}: its impacts move {modes} modes, and how an orbit changes is "
            f"told by a matrix, of up to {MOST}; take fewer sites: with damping waves do not come "
            "back."
        )


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


def propagator(z: FloatArray, time: Any, damping: float = 0.0) -> ModalPropagator:
    """The flight over a time (or times, shape ``(..., 1)``) of modes with stiffness z.

    Examples
    --------
    >>> quarter = propagator(np.array([0.0, 1.0]), 0.5 * math.pi)
    >>> quarter(np.ones(2), np.zeros(2))[0].round(12) + 0.0
    array([1., 0.])
    """
    times = np.asarray(time, dtype=float)
    out = np.empty((3, times.size, z.size))
    PROPAGATORS(z, float(damping), times.ravel(), out)
    cosine, reach, swing = out.reshape(3, *times.shape[:-1], z.size)
    return ModalPropagator(cosine, reach, z * reach, swing)


def propagators(z: Vector, damping: float, times: Vector, out: Cube) -> None:
    """C, S and S' of each mode after each time."""
    for i in range(times.size):
        for j in range(z.size):
            C, S, dS = mode_solutions(z[j], damping, times[i])
            out[0, i, j], out[1, i, j], out[2, i, j] = C, S, dS


PROPAGATORS = Kernel(propagators)


def free_multipliers(z: FloatArray, damping: float, time: float) -> tuple[Array, Array]:
    """Both multipliers of each mode over a flight without impacts, ``exp(+-i w t)`` undamped."""
    w = np.sqrt(z - 0.25 * damping * damping + 0j)
    return np.exp((1j * w - 0.5 * damping) * time), np.exp((-1j * w - 0.5 * damping) * time)


# --- the answer to the drive --------------------------------------------------------------------


class DrivenSpectrum(NamedTuple):
    """Complex amplitudes: one column a harmonic m, one row a site (one row where all are alike).

    ``f_n(t) = Re sum of c_nm exp(i m t)``.
    """

    m: FloatArray
    table: Array

    def along(self, sites: Sequence[int], times: FloatArray) -> FloatArray:
        """Value and three derivatives of each site at its time, shape (4, times)."""
        rows = self.table[np.array(sites) if len(self.table) > 1 else np.zeros(times.size, int)]
        wave, turn = rows * np.exp(1j * np.multiply.outer(times, self.m)), 1j * self.m
        return np.array([(wave * turn**order).real.sum(axis=-1) for order in range(4)])

    def everywhere(self, t: Any, order: int) -> FloatArray:
        """The order-th derivative for all rows, shape ``(*t.shape, rows)``."""
        wave = np.exp(1j * np.multiply.outer(np.asarray(t, dtype=float), self.m))
        return np.asarray((wave @ (self.table * (1j * self.m) ** order).T).real)


@dataclass(frozen=True)
class Driven:
    """The forced motion of every site at unit amplitude, and its slopes."""

    lattice: Finite
    forcing: Forcing
    gamma: float
    spring: float
    damping: float

    @cached_property
    def alike(self) -> bool:
        """Whether every site follows ``f``, with ``f'' = F``: nothing holds or brakes it."""
        return self.lattice.uniform and self.spring == 0.0 and self.damping == 0.0

    def along(self, sites: Sequence[int], times: FloatArray) -> FloatArray:
        """Displacement and three derivatives of each site at its time, shape (4, times)."""
        if self.alike:
            f = self.forcing
            return np.array([f.f(times), f.df(times), f.d2f(times), f.d3f(times)])
        return self._spectrum.along(sites, times)

    def harmonics(self, site: int) -> Harmonics:
        """The motion of one site as a series (m, A, B), ``A cos mt + B sin mt``."""
        if self.alike:
            return self.forcing.harmonics
        m, table = self._spectrum
        row = table[0 if len(table) == 1 else site]
        return tuple((int(o), c.real, -c.imag) for o, c in zip(m, row.tolist(), strict=True))

    def everywhere(self, t: Any, order: int) -> FloatArray:
        """The order-th derivative for all sites, shape ``(*t.shape, N)``, or 1 for N where all
        move alike."""
        if self.alike:
            f = self.forcing
            return np.asarray((f.f, f.df, f.d2f)[order](np.asarray(t, dtype=float)))[..., None]
        return self._spectrum.everywhere(t, order)

    def slope(self, name: str, sites: Sequence[int], times: FloatArray) -> FloatArray:
        """Derivatives of displacement, velocity and acceleration in gamma, spring, damping or a
        parameter of the forcing, shape (3, times); 0 in all others."""
        drive = name in self.forcing.params
        if drive and self.alike:
            f = self.forcing.f_param
            return np.array([[f(name, t, order) for t in times.tolist()] for order in range(3)])
        # in gamma: where all sites move alike no bond between them is stretched
        if drive or name in ("spring", "damping") or (name == "gamma" and not self.lattice.uniform):
            return self._slope(name).along(sites, times)[:3]
        return np.zeros((3, times.size))

    def _slope(self, name: str) -> DrivenSpectrum:
        if name in self.forcing.params:
            m, F = _force(self.forcing.slope_harmonics(name))
            return DrivenSpectrum(m, self._filtered(m, F))
        m, F = _force(self.forcing.harmonics)
        lam = self._modes[0][:, None]
        rises: dict[str, Any] = {"gamma": lam, "spring": 1.0, "damping": 1j * m}
        rise = rises[name]
        # d(F/gap) = -F/gap^2 d(gap), gap = z - m^2 + i m damping
        return DrivenSpectrum(m, self._filtered(m, F, -rise / self._gap(m, F)))

    @cached_property
    def _spectrum(self) -> DrivenSpectrum:
        m, F = _force(self.forcing.harmonics)
        return DrivenSpectrum(m, self._filtered(m, F))

    def _filtered(self, m: FloatArray, F: Array, factor: Any = 1.0) -> Array:
        _, shapes, share = self._modes
        return np.asarray(shapes @ (share[:, None] * F * factor / self._gap(m, F)))

    @cached_property
    def _modes(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """lam, shapes at all sites and share of the drive of each mode that is driven."""
        if self.lattice.uniform:
            return np.zeros(1), np.ones((1, 1)), np.ones(1)
        lam, shapes, share = self.lattice.driven_modes
        return lam, shapes, share

    def _gap(self, m: FloatArray, F: Array) -> Array:
        """``z - m^2 + i m damping`` of each mode and harmonic."""
        z = self.gamma * self._modes[0] + self.spring
        gap = z[:, None] - m * m + 1j * m * self.damping
        # so close to a harmonic a driven mode answers it beyond all bounds
        low = (abs(gap) <= 1e-12 * m * m) & (F != 0.0)
        if low.any():
            raise BadInput(
                f"the drive is in resonance: at gamma = {self.gamma:.9g}, spring = "
                f"{self.spring:.9g} a mode of the {self.lattice.describe()} has the frequency "
                f"{m[np.argwhere(low)[0, 1]]:g} of one of its harmonics, and without damping "
                "grows without bound; change gamma, spring or damping."
            )
        return gap


@lru_cache(maxsize=64)
def driven_modes(
    lattice: Finite, forcing: Forcing, gamma: float, spring: float, damping: float
) -> Driven:
    """`Driven`, kept: a flight asks for the same one many times."""
    if lattice.uniform:
        gamma = 0.0  # it takes no part: one spectrum serves a whole branch in gamma
    return Driven(lattice, forcing, gamma, spring, damping)


def _force(response: Harmonics) -> tuple[FloatArray, Array]:
    """Orders and complex amplitudes of F, from the series of f with f'' = F."""
    m = np.array([order for order, _, _ in response], dtype=float)
    return m, -m * m * np.array([complex(A, -B) for _, A, B in response])
