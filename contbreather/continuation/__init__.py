"""Floor 1: curves H(z) = 0 and everything that walks them. Knows nothing of breathers."""

from __future__ import annotations

from .boundary import boundary
from .branch import Branch, Stop, refined, with_columns
from .equilibria import branch_point, cusp, fold, hopf
from .point import DefiningSystem, Event, Point, user
from .problem import Problem
from .resume import extend
from .run import Run, load, save
from .settings import Steps
from .switching import SwitchingProblem
from .trace import iterate, trace

__all__ = [
    "Branch",
    "Event",
    "SwitchingProblem",
    "DefiningSystem",
    "Point",
    "Problem",
    "Run",
    "Steps",
    "Stop",
    "boundary",
    "branch_point",
    "cusp",
    "extend",
    "fold",
    "hopf",
    "load",
    "refined",
    "save",
    "trace",
    "user",
    "iterate",
    "with_columns",
]
