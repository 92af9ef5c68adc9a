"""Responses of finite lattices whose springs or dampings differ, by sites in place of modes.

They are sums over the modes of a medium in its own time, see `contbreather.lattice.uneven`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from contbreather.lattice.finite import PACE, Basis, NormalModes
from contbreather.lattice.modal_flow import DrivenSpectrum, forces_of
from contbreather.lattice.modal_waves import RADIUS
from contbreather.lattice.periodic_green import Responses
from contbreather.lattice.response import (
    HELD,
    RESONANT,
    ModalResponse,
    Response,
    Sites,
    as_table,
    harmonics,
)
from contbreather.lattice.uneven import Medium, SiteModes, medium_of, modes_of

FloatArray = NDArray[np.float64]
Array = NDArray[Any]
EPS, PRECISION = float(np.finfo(float).eps), np.finfo(float).precision

# A velocity in a medium's own time is less by the pace, and so are parameters: powers of it in
# answers to impulses, and in their slopes.
_UNITS = {"": -1, "damping": -2, "gamma": -3, "spring": -3}


_POWERS = np.arange(-1.0, 2.0)[:, None, None]  # of the pace, in each derivative of h(e t)/e


class SiteWaves(NamedTuple):
    """Sums of ``Re left_jn right_jp exp(l_j t)``, site n after an impulse at p, and a constant."""

    rates: Array
    left: Array
    right: Array
    level: FloatArray


@dataclass(frozen=True, eq=False)
class UnevenResponse(ModalResponse):
    """Response of a finite lattice whose springs or dampings differ, of sites in place of modes."""

    at_impacts = Response.at_impacts

    @cached_property
    def own(self) -> tuple[Medium, float]:
        """The medium in its own time, and how many of its units of time are one of the drive's: the
        same one, but for rounding, at every frequency of the drive."""
        pace = math.sqrt(self.gamma + self.spring) or 1.0
        held = self.gamma / pace**2, self.spring / pace**2, self.damping / pace
        own = (float(f"{value:.{PRECISION}g}") for value in held)
        return medium_of(self.lattice, *own), pace

    def interactions(self, times: FloatArray, by: str = "") -> FloatArray:
        return _site_place(self, times.tobytes(), by if by != PACE else "")[by == PACE]

    def slopes_at_impacts(
        self, times: FloatArray, rates: Mapping[str, float]
    ) -> tuple[FloatArray, FloatArray]:
        state = 2.0 * self.gamma, 2.0 * self.spring, self.damping
        ways = [(rates.get(name, 0.0), value) for name, value in zip(HELD, state, strict=True)]
        square = sum(value * value for value in state)
        pace = sum(rate * value for rate, value in ways) / (square or 1.0)
        # but for rounding along the pace: no modes of other media are asked for
        along = all(abs(rate - pace * value) <= 4.0 * EPS * abs(rate) for rate, value in ways)
        if along and rates.keys().isdisjoint(self.drive.params):
            rates = {PACE: pace}
        return Response.slopes_at_impacts(self, times, rates)

    def _spectrum(self, by: str) -> DrivenSpectrum:
        return _site_spectra(self, by if by != PACE else "")[by == PACE]

    @cached_property
    def basis(self) -> Basis:
        size = self.lattice.sites
        return NormalModes(np.zeros(size), np.empty(0), np.eye(size))

    def table(self, sites: Sites, by: str = "") -> Responses:
        return _site_table(self, sites, by)

    def modes(self, times: FloatArray, impulses: FloatArray, at: FloatArray) -> FloatArray:
        """Displacement, velocity and acceleration of all sites, see `ModalResponse.modes`."""
        waves, hits = _site_waves(self, ""), list(self.hits)
        laps, past = self.since(at[:, None] - times)
        J = np.where(laps % 2 != 0, float(self.sign), 1.0) * impulses
        turned = np.exp(np.multiply.outer(past, waves.rates))
        moved = (turned * J[..., None] * waves.right.T[hits]).sum(axis=1)
        orders = [((moved * waves.rates**order) @ waves.left).real for order in range(3)]
        return np.array([orders[0] + J @ waves.level[:, hits].T, *orders[1:]])


@lru_cache(maxsize=64)
def _site_spectra(of: UnevenResponse, by: str) -> list[DrivenSpectrum]:
    """Answers to the drive, or to what a parameter changes, and their slopes along the pace."""
    own, pace = by in of.drive.params, of.own[1]
    m, F = forces_of(of.drive, by if own else "")
    modes = _modes(of, "" if own else by)
    unit = pace ** (_UNITS["" if own else by] - 1)
    return [DrivenSpectrum(m, A) for A in unit * F * modes.driven(m / pace)]


@lru_cache(maxsize=64)
def _site_table(of: UnevenResponse, sites: Sites, by: str) -> Responses:
    waves, each, hit = _site_waves(of, by), list(sites), list(of.hit)
    level = waves.level[each][:, hit].ravel()
    grown = (waves.left.T[each][:, None] * waves.right.T[hit]).reshape(level.size, -1)
    return as_table(of, sites, level, waves.rates, grown)


@lru_cache(maxsize=16)
def _site_place(of: UnevenResponse, times: bytes, by: str) -> tuple[FloatArray, FloatArray]:
    """Answers at impacts, or what a parameter changes, and their slopes along the pace, of
    ``h(e t)/e`` at e = 1."""
    at, modes, hits, pace = np.frombuffer(times), _modes(of, by), list(of.hits), of.own[1]
    laps, age = of.since(at[:, None] - at)
    recurring, longer = modes.recurring(pace * of.length, of.sign)
    moved = recurring[:, None, None] * np.exp(np.multiply.outer(modes.rates, pace * age))
    moved *= modes.values[:, hits, None] * modes.kicks[:, None, hits]
    units = pace ** (_UNITS[by] + np.arange(4.0)[:, None, None]) * np.where(laps % 2, of.sign, 1.0)
    rows = np.stack([modes.orders, modes.orders * longer]) @ moved.reshape(longer.size, -1)
    h, grown = units * rows.real.reshape(2, 4, *age.shape)
    if of.sign > 0:
        level = pace ** (_UNITS[by] - 1) / of.length * modes.level[hits][:, hits]
        h[0], grown[0] = h[0] + level, grown[0] - level
    grown[:3] += _POWERS * h[:3] + age * h[1:]
    return of.at_itself(h, by), of.at_itself(grown, PACE)


@lru_cache(maxsize=64)
def _site_waves(of: UnevenResponse, by: str) -> SiteWaves:
    modes, pace = _modes(of, by), of.own[1]
    length, unit = pace * of.length, pace ** _UNITS[by]
    left = unit * modes.values * modes.recurring(length, of.sign)[0][:, None]
    level = unit * modes.level / length if of.sign > 0 else np.zeros((of.lattice.sites,) * 2)
    return SiteWaves(pace * modes.rates, left, modes.kicks, level)


@lru_cache(maxsize=64)
def _modes(of: UnevenResponse, by: str) -> SiteModes:
    medium, pace = of.own
    first, step = harmonics(of.turns, of.sign)
    room, nearest = medium.room(first / pace, step / pace, by)
    if not room * pace * pace > RESONANT:
        raise of.resonance(nearest * pace)
    return modes_of(medium, 2.0 ** math.floor(math.log2(RADIUS * room)), by)
