"""Which response answers for a lattice, and which modes of it an orbit may be in resonance with."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from contbreather.lattice.chain import InfiniteChain, Ring
from contbreather.lattice.forcing import Forcing, even_harmonics
from contbreather.lattice.response import (
    ModalResponse,
    Resonant,
    Sites,
    UniformResponse,
    harmonics,
)


@lru_cache(maxsize=256)
def resonant_modes(
    lattice: Any, hit: Sites, turns: int, sign: int, gamma: float, spring: float
) -> Resonant:
    """Modes of a finite lattice beyond half the lowest harmonic of an orbit, if its coupling can
    bring them to one: their amplitudes are unknowns."""
    if lattice.sites is None or not lattice.even:
        return ()
    lam, (first, step) = lattice.basis(hit).lam, harmonics(turns, sign)
    w = np.sqrt(gamma * lam + spring)
    nearest = first + step * np.maximum(0.0, np.round((w - first) / step))
    top = np.where(lam > 0.0, lattice.highest_gamma, 0.0) * lam
    within = (top > nearest * nearest) | (spring > 0.0)
    found = np.flatnonzero((w > 0.5 * first) & within)
    return tuple((int(i), float(nearest[i])) for i in found)


@lru_cache(maxsize=256)
def answers_of(
    lattice: Any,
    drive: Forcing,
    held: tuple[float, float, float],
    hits: Sites,
    turns: int,
    sign: int,
    resonant: Resonant = (),
) -> UniformResponse | ModalResponse:
    """The response of a lattice with these gamma, spring and damping: in closed form where it
    can be."""
    gamma, spring, damping = held
    more = damping or spring or resonant or 0 in even_harmonics(drive)
    chain = isinstance(lattice, InfiniteChain | Ring) and not more
    slow = 4.0 * turns * turns * gamma < 1.0  # no mode reaches the lowest harmonic
    local = sign > 0 or (turns == 1 and len({*hits}) == 1)
    kind = UniformResponse if chain and (slow or lattice.sites is None) and local else ModalResponse
    if not chain and not lattice.even:
        from contbreather.lattice.uneven_response import UnevenResponse as kind  # few need it

    return kind(lattice, drive, *held, hits, turns, sign, resonant)
