"""Periodic orbits of anybody's system, smooth, forced or hybrid, as cycles of flows."""

from __future__ import annotations

from contbreather.fronts import front

__all__ = front(__name__)
