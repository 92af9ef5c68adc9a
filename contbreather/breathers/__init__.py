"""Periodic orbits with impacts: closed forms, their roots, and whether they keep off the walls."""

from __future__ import annotations

from contbreather.breathers.admissibility import (
    Admissibility,
    admissibility,
    centre_margin,
    highest_neighbour,
    neighbour_peak,
)
from contbreather.breathers.closure import Closure, smallest_amplitude
from contbreather.breathers.symmetric import Breather, symmetric, symmetric_roots

__all__ = [
    "Admissibility",
    "Breather",
    "Closure",
    "admissibility",
    "centre_margin",
    "highest_neighbour",
    "neighbour_peak",
    "smallest_amplitude",
    "symmetric",
    "symmetric_roots",
]
