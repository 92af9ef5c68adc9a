"""Floor 1: curves H(z) = 0 and everything that walks them. Knows nothing of breathers."""

from __future__ import annotations

from .boundary import boundary
from .branch import Branch, Point, Stop
from .codim2 import branch_point, cusp, fold, hopf
from .columns import with_columns
from .events import Event, Locus, user
from .problem import Problem
from .refine import refined
from .seed import Seed
from .steps import Steps
from .store import load, save
from .trace import trace, walk

__all__ = [
    "Branch",
    "Event",
    "Locus",
    "Point",
    "Problem",
    "Seed",
    "Steps",
    "Stop",
    "boundary",
    "branch_point",
    "cusp",
    "fold",
    "hopf",
    "load",
    "refined",
    "save",
    "trace",
    "user",
    "walk",
    "with_columns",
]
