"""The linear lattice between impacts, and what drives it. Knows nothing of impacts."""

from __future__ import annotations

from contbreather.lattice.band_averages import Lattice, check_gamma
from contbreather.lattice.chain import InfiniteChain, Ring, lattice_of
from contbreather.lattice.conditions import Conditions  # noqa: F401 - enters all dicts of these
from contbreather.lattice.forcing import Forcing, Fourier, Harmonic, Samples
from contbreather.lattice.formula import Symbolic, forcing_of
from contbreather.lattice.parse import lattice_by

__all__ = [
    "Forcing",
    "Fourier",
    "Harmonic",
    "InfiniteChain",
    "Lattice",
    "Ring",
    "Samples",
    "Symbolic",
    "check_gamma",
    "forcing_of",
    "lattice_by",
    "lattice_of",
]
