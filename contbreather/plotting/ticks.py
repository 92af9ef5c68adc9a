"""Ticks whose numbers keep apart."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.ticker import AutoLocator


class SpacedLocator(AutoLocator):
    """Every other tick of an abscissa where the numbers would run into each other: matplotlib takes
    them to have three letters at most."""

    def __call__(self) -> Any:
        axis: Any = self.axis
        ticks = np.asarray(super().__call__())
        if len(ticks) < 3:
            return ticks
        step, (low, high) = ticks[1] - ticks[0], axis.get_view_interval()
        room = step / abs(high - low) * axis.axes.bbox.width  # pixels
        letters = max(map(len, axis.get_major_formatter().format_ticks(ticks)))
        letter = 0.6 * axis.label.get_fontsize() * axis.axes.get_figure(root=True).dpi / 72.0
        return ticks[np.rint(ticks / step) % 2 == 0] if letter * letters > room else ticks
