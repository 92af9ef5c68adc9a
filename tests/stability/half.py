"""Symmetric breathers by gamma, k and b alone: questions to their half map, and dense matrices."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from contbreather.lattice import InfiniteChain, Ring
from contbreather.stability.chain_map import OrbitMap
from contbreather.stability.one_impact import Gradient, HalfMap, half_map
from contbreather.stability.saltation import Saltation
from contbreather.stability.scattering import OverReflection, waves
from contbreather.stability.scattering import over_reflection as reflection_of
from contbreather.stability.scattering import over_reflects as reflects
from contbreather.stability.zeros import Count

CHAIN = InfiniteChain()


def unstable_count(gamma: float, k: float, b: float, lattice: Any = CHAIN) -> Count:
    return HalfMap(gamma, k, b, lattice).count()


def unstable_multipliers(gamma: float, k: float, b: float, lattice: Any = CHAIN) -> Any:
    return HalfMap(gamma, k, b, lattice).unstable_multipliers()


def by_impacts(gamma: float, k: float, b: float, spring: float = 0.0) -> OrbitMap:
    """The same half period as an orbit of one impact."""
    return OrbitMap(gamma, k, [Saltation(0, 0.0, b)], 0.5, spring)


def determinant(map: OrbitMap, kappa: Any) -> Any:
    """``D = -F g g g`` of three aliases at ``mu = exp(2 pi i kappa)``, Im kappa <= 0, where
    ``1/g^2 = (kappa^2 - floor^2) (kappa^2 - edge^2)``."""
    at = np.asarray(kappa, dtype=complex) - np.round(np.real(kappa))
    mirrored = at.real < 0.0  # D at -conj(kappa) is conj(D)
    at = np.atleast_1d(np.abs(at.real) + 1j * at.imag)
    poles = 1.0
    for s in (at - 1.0, at, at + 1.0):
        above = s.real + 1j * np.abs(s.imag)  # the conjugate, on the upper side of the cut
        low, high = (np.sqrt(above - e) * np.sqrt(above + e) for e in (map.floor, map.edge))
        poles = poles * -(low * high).conj()
    with np.errstate(divide="ignore", invalid="ignore"):
        values = (-map.F(at) / poles).reshape(np.shape(kappa))
    return np.where(mirrored, values.conj(), values)[()]


def D(gamma: float, nu: Any, k: float, b: float, lattice: Any = CHAIN) -> Any:
    """The determinant at ``mu = exp(i pi nu)``."""
    if lattice.sites is None:
        return determinant(by_impacts(gamma, k, b, lattice.spring), 0.5 * np.asarray(nu))
    ring = half_map(gamma, k, b, lattice)
    depth = lambda one: ring.gradient(one.real, math.exp(-math.pi * one.imag)).value  # noqa: E731
    return np.vectorize(depth, otypes=[complex])(np.asarray(nu, dtype=complex))[()]


def on_arc(gamma: float, nu: float, k: float, b: float, spring: float = 0.0) -> Gradient:
    """F at an angle of the band, with its derivatives."""
    return HalfMap(gamma, k, b, CHAIN.with_spring(spring)).gradient(nu)


def half_multipliers(ring: Ring, gamma: float, k: float, b: float) -> Any:
    return half_map(gamma, k, b, ring).multipliers()


def over_reflects(gamma: float, k: float, b: float, spring: float = 0.0) -> bool:
    return reflects(HalfMap(gamma, k, b, CHAIN.with_spring(spring)))


def over_reflection(gamma: float, k: float, b: float, spring: float = 0.0) -> OverReflection:
    return reflection_of(HalfMap(gamma, k, b, CHAIN.with_spring(spring)))


def amplified(gamma: float, nu: Any, k: float, b: float, spring: float = 0.0) -> Any:
    """|S| at angles of the band (times pi)."""
    map = HalfMap(gamma, k, b, CHAIN.with_spring(spring))
    square = (np.atleast_1d(nu) ** 2 - spring) / (4.0 * gamma)
    return np.exp(waves(map, np.arcsin(np.sqrt(square))).gain)
