"""Periodic orbits of anybody's system, smooth, forced or hybrid, as cycles of flows."""

from __future__ import annotations

from typing import TYPE_CHECKING

from contbreather.fronts import front

if TYPE_CHECKING:
    from .collocation import Collocation as Collocation
    from .constructors import cycle as cycle
    from .equilibria import equilibrium as equilibrium
    from .filippov import Filippov as Filippov
    from .flow import Flow as Flow
    from .integrate import GuardCrossing as GuardCrossing
    from .integrate import Piece as Piece
    from .integrate import Trajectory as Trajectory
    from .integrate import integrate as integrate
    from .orbit import Cycle as Cycle
    from .orbit import cycle_of as cycle_of

__all__ = front(__name__)
