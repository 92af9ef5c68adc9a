"""Exact flights of a finite lattice: every mode turns and decays, and answers the drive.

A mode obeys ``y'' + damping y' + z y = drive``, ``z = gamma lam + spring``. Its free motion over a
time t is ``y = C y0 + S y0'``, C and S being the solutions that start with (1, 0) and (0, 1):

    ``S = e^(-damping t/2) t s(x)``, ``C = e^(-damping t/2) c(x) + damping S/2``,
    ``x = (z - damping^2/4) t^2``, ``c(x) = cos sqrt(x)``, ``s(x) = sin(sqrt x)/sqrt(x)``,

entire functions of x, so that drifting (z = 0) and overdamped modes need no case of their own.
"""

from __future__ import annotations

import math
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
SMALL = 0.25  # |x| below which differences of c and s go by their series
# (s - c)/x by powers of x
_SERIES = [1.0 / 3.0, -1.0 / 30.0, 1.0 / 840.0, -1.0 / 45360.0, 1.0 / 3991680.0, -1.0 / 518918400.0]


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


def propagator_slope(
    z: FloatArray, time: float, at: ModalPropagator, damping: float = 0.0
) -> ModalPropagator:
    """Derivative of `propagator` in z, exact for w -> 0 as well."""
    # c'(x) = -s(x)/2 and dx/dz = t^2; with damping C has damping S/2 besides
    c_slope, s_slope = -0.5 * time * at.reach, _reach_slope(z, time, at, damping)
    lag = 0.5 * damping * s_slope
    return ModalPropagator(c_slope + lag, s_slope, at.reach + z * s_slope, c_slope - lag)


def propagator_slope_in_damping(
    z: FloatArray, time: float, at: ModalPropagator, damping: float
) -> ModalPropagator:
    """Derivative of `propagator` in the damping."""
    half = 0.5 * damping
    core = at.cosine - half * at.reach  # e^(-damping t/2) c(x)
    c_slope = -0.5 * time * core + 0.5 * half * time * at.reach
    s_slope = -0.5 * time * at.reach - half * _reach_slope(z, time, at, damping)
    lag = 0.5 * at.reach + half * s_slope
    return ModalPropagator(c_slope + lag, s_slope, z * s_slope, c_slope - lag)


def _reach_slope(z: FloatArray, time: float, at: ModalPropagator, damping: float) -> FloatArray:
    """dS/dz = ``e^(-damping t/2) t^3 (c - s)/(2 x)``."""
    y = z - 0.25 * damping * damping
    x = y * time * time
    series = np.polyval(_SERIES[::-1], np.clip(x, -SMALL, SMALL))
    near = abs(x) <= SMALL
    core = at.cosine - 0.5 * damping * at.reach
    far = (time * core - at.reach) / (2.0 * np.where(near, 1.0, y))
    decay = math.exp(-0.5 * damping * time)
    return np.where(near, -0.5 * decay * time**3 * series, far)


def free_multipliers(z: FloatArray, damping: float, time: float) -> tuple[Array, Array]:
    """Both multipliers of each mode over a flight without impacts, ``exp(+-i w t)`` undamped."""
    w = np.sqrt(z - 0.25 * damping * damping + 0j)
    return np.exp((1j * w - 0.5 * damping) * time), np.exp((-1j * w - 0.5 * damping) * time)


# --- the answer to the drive --------------------------------------------------------------------


class Spectrum(NamedTuple):
    """Complex amplitudes: one column a harmonic m, one row a site (one row where all are alike).

    ``f_n(t) = Re sum of c_nm exp(i m t)``.
    """

    m: FloatArray
    table: Array

    def at(self, site: int, t: float) -> tuple[float, float, float]:
        """Value and first two derivatives of one site."""
        m = self.m
        wave = self.table[0 if len(self.table) == 1 else site] * np.exp(1j * m * t)
        bent = m * m * wave.real
        return float(wave.real.sum()), -float((m * wave.imag).sum()), -float(bent.sum())

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

    def at(self, site: int, t: float) -> tuple[float, float, float]:
        """Displacement, velocity and acceleration of one site."""
        if self.alike:
            return self.forcing.motion(t)
        return self._spectrum.at(site, t)

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

    def slope(self, name: str, site: int, t: float) -> tuple[float, float]:
        """Derivatives of displacement and velocity in gamma, spring, damping or a parameter of
        the forcing; 0 in all others."""
        drive = name in self.forcing.params
        if drive and self.alike:
            return self.forcing.f_param(name, t, 0), self.forcing.f_param(name, t, 1)
        # in gamma: where all sites move alike no bond between them is stretched
        if drive or name in ("spring", "damping") or (name == "gamma" and not self.lattice.uniform):
            return self._slope(name).at(site, t)[:2]
        return 0.0, 0.0

    def _slope(self, name: str) -> Spectrum:
        if name in self.forcing.params:
            m, F = _force(self.forcing.slope_harmonics(name))
            return Spectrum(m, self._filtered(m, F))
        m, F = _force(self.forcing.harmonics)
        lam = self._modes[0][:, None]
        rises: dict[str, Any] = {"gamma": lam, "spring": 1.0, "damping": 1j * m}
        rise = rises[name]
        # d(F/gap) = -F/gap^2 d(gap), gap = z - m^2 + i m damping
        return Spectrum(m, self._filtered(m, F, -rise / self._gap(m, F)))

    @cached_property
    def _spectrum(self) -> Spectrum:
        m, F = _force(self.forcing.harmonics)
        return Spectrum(m, self._filtered(m, F))

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
