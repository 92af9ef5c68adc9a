"""Floor 1: curves H(z) = 0 and everything that walks them. Knows nothing of breathers."""

from __future__ import annotations

from contbreather.fronts import front

__all__ = front(__name__)
