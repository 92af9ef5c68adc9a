"""Means over the modes of a ring in mpmath's precision, and a site between two impacts."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import mpmath as mp
import numpy as np

from contbreather.lattice.free_flight import free_flight

MEANS = {
    "chi": lambda w: mp.tan(mp.pi * w / 2) / w if w else mp.pi / 2,
    "eta": lambda w: w * mp.tan(mp.pi * w / 2),
    "sigma": lambda w: w / mp.sin(mp.pi * w) if w else 1 / mp.pi,
    "psi": lambda w: w * mp.cot(mp.pi * w / 2) if w else 2 / mp.pi,
}


def ring_mean(of: Callable[[Any], Any], gamma: Any, sites: int, n: int = 0) -> Any:
    """``<of(w) cos(n theta)>``; of a ring long enough that of the infinite chain."""
    root = 2 * mp.sqrt(mp.mpf(gamma))
    return (
        mp.fsum(
            of(root * mp.sin(mp.pi * j / sites)) * mp.cos(2 * mp.pi * n * j / sites)
            for j in range(sites)
        )
        / sites
    )


def response(lattice: Any, gamma: float, n: int, s: Any) -> tuple[Any, ...]:
    """v, v' and v'' of site n between two impacts of site 0, per unit p, s after the first."""
    flight = free_flight(float(lattice.first_harmonic(gamma, n)), lattice.powers(gamma, n))
    return flight.at(np.asarray(s, dtype=float) - 0.5 * np.pi)
