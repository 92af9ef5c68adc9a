"""The figures of the paper, one function each, with what is exact beside what its rule says."""

from __future__ import annotations

from typing import Any

from contbreather.paper.figures234 import Figure2, MultiplierFigure, figure2, figure3, figure4
from contbreather.paper.time_series import TimeSeries, figure5, figure6, figure7, figure8

FIGURES: dict[int, Any] = dict(
    enumerate((figure2, figure3, figure4, figure5, figure6, figure7, figure8), 2)
)
__all__ = [
    "FIGURES", "Figure2", "MultiplierFigure", "TimeSeries", "figure2", "figure3",
    "figure4", "figure5", "figure6", "figure7", "figure8",
]  # fmt: skip
