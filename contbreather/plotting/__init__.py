"""Figures as the field draws them; matplotlib is imported when the first one is drawn.

Reads public types only: a figure can be drawn of anything that was computed, by anybody.
"""

from __future__ import annotations

from contbreather.fronts import front

__all__ = front(__name__)
