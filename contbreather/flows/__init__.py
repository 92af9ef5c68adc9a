"""Periodic orbits of anybody's system, smooth, forced or hybrid, as cycles of flows."""

from __future__ import annotations

from typing import TYPE_CHECKING

from contbreather.fronts import front

if TYPE_CHECKING:
    from .collocation import Collocation as Collocation
    from .cycle_constructors import cycle as cycle
    from .cycle_problem import Cycle as Cycle
    from .cycle_problem import cycle_of as cycle_of
    from .filippov import Filippov as Filippov
    from .flow import Flow as Flow
    from .flow_equilibria import equilibrium as equilibrium
    from .integrate import GuardCrossing as GuardCrossing
    from .integrate import Piece as Piece
    from .integrate import Trajectory as Trajectory
    from .integrate import integrate as integrate

__all__ = front(__name__)
