"""The linear lattice between impacts, what drives it, and the law of an impact."""

from __future__ import annotations

from typing import TYPE_CHECKING

from contbreather.fronts import front

if TYPE_CHECKING:
    from .band_averages import UniformLattice as UniformLattice
    from .band_averages import check_gamma as check_gamma
    from .chain import InfiniteChain as InfiniteChain
    from .chain import Ring as Ring
    from .chain import lattice_of as lattice_of
    from .forcing import Forcing as Forcing
    from .forcing import Fourier as Fourier
    from .forcing import Harmonic as Harmonic
    from .forcing import Samples as Samples
    from .formula import Symbolic as Symbolic
    from .formula import forcing_of as forcing_of
    from .parse import lattice_by as lattice_by

__all__ = front(__name__)
