"""The linear lattice between impacts, what drives it, and the law of an impact."""

from __future__ import annotations

from contbreather.fronts import front

__all__ = front(
    __name__,
    {
        "band_averages": "UniformLattice check_gamma",
        "chain": "InfiniteChain Ring lattice_of",
        "forcing": "Forcing Fourier Harmonic Samples",
        "formula": "Symbolic forcing_of",
        "parse": "lattice_by",
    },
)
