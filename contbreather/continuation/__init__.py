"""Floor 1: curves H(z) = 0 and everything that walks them. Knows nothing of breathers."""

from __future__ import annotations

from typing import TYPE_CHECKING

from contbreather.fronts import front

if TYPE_CHECKING:
    from .boundary import boundary as boundary
    from .branch import Branch as Branch
    from .branch import Stop as Stop
    from .equilibria import branch_point as branch_point
    from .equilibria import cusp as cusp
    from .equilibria import fold as fold
    from .equilibria import hopf as hopf
    from .point import DefiningSystem as DefiningSystem
    from .point import Event as Event
    from .point import Point as Point
    from .point import user as user
    from .problem import Problem as Problem
    from .result_files import Run as Run
    from .result_files import load as load
    from .result_files import save as save
    from .resume import extend as extend
    from .resume import refined as refined
    from .resume import with_columns as with_columns
    from .settings import Steps as Steps
    from .switching import SwitchingProblem as SwitchingProblem
    from .trace import iterate as iterate
    from .trace import trace as trace

__all__ = front(__name__)
