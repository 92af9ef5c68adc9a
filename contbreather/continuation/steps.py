"""How long a walk may step, how far it may go, and how exactly it solves."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from numbers import Integral

from ..checks import real, shown
from ..errors import BadInput

_LARGEST, _RELATIVE = 0.1, 0.01  # of `longest`
_ROUNDING = 1e-13  # corrections shorter than this, relative to 1 + |z|, may be rounding


@dataclass(frozen=True)
class Steps:
    """Sizes that govern one walk along a curve.

    Parameters
    ----------
    first : float
        Arclength of the first step, if `largest` allows it.
    smallest : float
        A step that would have to be shorter ends the branch, with the reason.
    largest : float, optional
        No step is longer. By default 0.1, or a hundredth of the size of z where that is more:
        where unknowns are counted in hundreds, so are their changes.
    most : int
        Number of steps after which the branch ends, in each direction.
    tolerance : float
        A Newton iteration has converged when its last correction is at most
        ``tolerance * (1 + |z|)``; being quadratic it is then far more exact than that. At least
        1e-13: shorter corrections are rounding.
    growth : float
        A step is at most this many times its predecessor.

    Examples
    --------
    >>> Steps(largest=0.01).growth
    1.5
    """

    first: float = 0.01
    smallest: float = 1e-9
    largest: float | None = None
    most: int = 2000
    tolerance: float = 1e-9
    growth: float = 1.5

    def __post_init__(self) -> None:
        for entry in fields(self):
            value = getattr(self, entry.name)
            if value is None and entry.default is None:
                continue
            size = real(value)
            if math.isnan(size) and not isinstance(value, float):
                raise BadInput(f"{entry.name} must be a number, got {shown(value)}")
            if entry.name != "most" and not 0 < size < math.inf:
                raise BadInput(f"{entry.name} must be finite and positive, got {shown(value)}")
        if not self.smallest <= min(self.first, self.longest(0.0)):
            raise BadInput(
                f"no step may be shorter than smallest = {self.smallest:g}, "
                f"got first = {self.first:g} and largest = {self.longest(0.0):g}"
            )
        if self.growth <= 1:
            raise BadInput(f"growth must exceed 1, got {self.growth:g}")
        if self.tolerance < _ROUNDING:
            raise BadInput(
                f"a tolerance below {_ROUNDING:g} is lost in rounding, got {self.tolerance:g}"
            )
        if not issubclass(type(self.most), Integral) or self.most < 1:
            raise BadInput(f"most must be a whole number, at least 1 step, got {self.most}")

    def longest(self, length: float) -> float:
        """How long a step may be where z has this length."""
        return max(_LARGEST, _RELATIVE * length) if self.largest is None else self.largest


def steps_of(steps: object, usual: Steps | None = None) -> Steps:
    """Steps as they were given, the usual ones if none were; anything else is refused."""
    if steps is None:
        return usual or Steps()
    if not isinstance(steps, Steps):
        raise BadInput(f"steps must be given as Steps(largest=...), got {shown(steps)}")
    return steps
