"""The linear lattice between impacts, what drives it, and the law of an impact."""

from __future__ import annotations

from contbreather.fronts import front

__all__ = front(__name__)
