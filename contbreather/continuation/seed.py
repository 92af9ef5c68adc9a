"""Where a new curve sets out: what an event knows of the curves that leave its points."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .problem import Problem

Array = NDArray[np.float64]


class Seed(NamedTuple):
    """The start of one arm, in the problem that the arm solves.

    Parameters
    ----------
    problem : Problem
        The problem of the arm: that of the branch itself, or a larger one in which the
        bifurcation point is singular (both flights of an asymmetric breather, a doubled cycle).
    z : ndarray, shape (n + 1,)
        The bifurcation point in it: its unknowns, then the free parameter of the branch.
    tangent : ndarray, shape (n + 1,)
        Direction in which the arm leaves; its length does not matter.
    parent : ndarray, shape (n + 1,), optional
        Direction of the branch it leaves from, as seen in `problem`: an arm that follows it
        instead is refused.
    """

    problem: Problem
    z: Array
    tangent: Array
    parent: Array | None = None
