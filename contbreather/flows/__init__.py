"""Periodic orbits of anybody's system, smooth, forced or hybrid, as cycles of flows."""

from __future__ import annotations

from .filippov import Filippov
from .flow import Flow
from .integrate import Crossing, Piece, Trajectory, integrate

__all__ = ["Crossing", "Filippov", "Flow", "Piece", "Trajectory", "integrate"]
