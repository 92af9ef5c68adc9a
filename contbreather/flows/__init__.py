"""Periodic orbits of anybody's system, smooth, forced or hybrid, as cycles of flows."""

from __future__ import annotations

from .collocation import Collocation
from .constructors import cycle
from .equilibria import equilibrium
from .filippov import Filippov
from .flow import Flow
from .integrate import Crossing, Piece, Trajectory, integrate
from .orbit import Cycle, cycle_of

__all__ = [
    "Collocation",
    "Crossing",
    "Cycle",
    "Filippov",
    "Flow",
    "Piece",
    "Trajectory",
    "cycle",
    "cycle_of",
    "equilibrium",
    "integrate",
]
