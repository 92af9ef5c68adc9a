"""The figures of the paper, one function each, with what is exact beside what its rule says."""

from __future__ import annotations

from collections.abc import Callable

from contbreather.paper.figure2 import Figure2, chain_lengths, figure2
from contbreather.paper.figures34 import MultiplierFigure, figure3, figure4

FIGURES: dict[int, Callable[[], Figure2 | MultiplierFigure]] = {2: figure2, 3: figure3, 4: figure4}

__all__ = [
    "FIGURES",
    "Figure2",
    "MultiplierFigure",
    "chain_lengths",
    "figure2",
    "figure3",
    "figure4",
]
