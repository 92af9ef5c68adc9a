"""Cycles of a map as solutions: ``G(x) - x = 0`` with G the map or its iterate, the same orbit as
one of another period, its multipliers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..errors import BadInput
from .curve import Params
from .point import Point
from .problem import Problem
from .sparse import is_sparse

Array = NDArray[np.float64]
Map = Callable[[Array, Params], Array]

_SAME = 1e-7  # relative distance at which a cycle has closed


def generic(period: int) -> str:
    return "fixed point" if period == 1 else f"cycle of period {period}"


@dataclass(frozen=True, eq=False)
class Iterate:
    """``G(x) - x`` with G the iterate of a map."""

    map: Map
    period: int
    derivative: Callable[[Array, Params], Array] | None = None

    def __call__(self, x: Array, params: Params) -> Array:
        return self.after(x, params, self.period) - x

    def after(self, x: Array, params: Params, times: int) -> Array:
        for _ in range(times):
            x = self.image(x, params)
        return x

    def image(self, x: Array, params: Params) -> Array:
        """One iterate; a map may write to what it is given, and return one array each time."""
        found = np.array(self.map(x.copy(), params))
        if found.shape != x.shape or not np.issubdtype(found.dtype, np.number):
            raise BadInput(f"the map makes {found!r} of {x!r}; {x.size} numbers were expected")
        return found

    def phases(self, x: Array, params: Params) -> tuple[Array, ...]:
        """The other points of the cycle, each a start of the same one."""
        points = []
        for _ in range(self.period - 1):
            x = self.image(x, params)
            points.append(x)
        return tuple(points)

    def jacobian(self, x: Array, params: Params) -> Array:
        """By the chain rule from the derivative of the map."""
        assert self.derivative is not None
        product = np.eye(x.size)
        for _ in range(self.period):
            own = self.derivative(x.copy(), params)
            if is_sparse(own):
                raise BadInput("the Jacobian of a map is sparse; give its toarray() instead")
            if np.shape(own) != product.shape:
                raise BadInput(
                    f"the Jacobian of the map has shape {np.shape(own)}; {product.shape} was "
                    "expected"
                )
            product = np.asarray(own) @ product
            x = self.image(x, params)
        return product - np.eye(x.size)


@dataclass(frozen=True)
class Cycle:
    """A fixed point or cycle: its points, and its multipliers over one period."""

    points: Array  # (period, n)
    matrix: Array  # derivative of the iterate
    params: Mapping[str, float]

    @cached_property
    def multipliers(self) -> NDArray[np.complex128]:
        """Eigenvalues of the iterate, the largest first."""
        values = np.linalg.eigvals(self.matrix).astype(complex)
        return values[np.argsort(-abs(values), kind="stable")]

    @property
    def period(self) -> int:
        return len(self.points)

    @property
    def unstable(self) -> int:
        """Multipliers outside the unit circle."""
        return int((abs(self.multipliers) > 1).sum())


def cycle(point: Point) -> Cycle:
    iterate: Iterate = point.curve.problem.residual
    points = np.array([point.x, *iterate.phases(point.x, point.params)])
    return Cycle(points, multiplier_matrix(point), point.params)


def multiplier_matrix(point: Point) -> Array:
    n = point.curve.size
    return np.asarray(point.jacobian()[:, :n] + np.eye(n))


def with_period(problem: Problem, period: int) -> Problem:
    """The same orbit as one of another period."""
    iterate: Iterate = problem.residual  # type: ignore[assignment]
    other = replace(iterate, period=period)
    unnamed = problem.label == generic(iterate.period)
    return replace(
        problem,
        residual=other,
        jacobian=None if problem.jacobian is None else other.jacobian,
        label=generic(period) if unnamed else problem.label,
    )


def shorter(point: Point) -> Problem | None:
    """The cycle as one of the smallest period it has, if that is not the one it is written in."""
    iterate: Iterate = point.curve.problem.residual
    size = 1 + float(np.linalg.norm(point.x))
    x = point.x
    for period in range(1, iterate.period):
        x = iterate.after(x, point.params, 1)
        if iterate.period % period == 0 and np.linalg.norm(x - point.x) <= _SAME * size:
            return with_period(point.problem, period)
    return None


def units(point: Point) -> Array:
    """Derivative of the iterate between unknowns in their scales, which keeps the multipliers."""
    scales = point.curve.scales[: point.curve.size]
    return multiplier_matrix(point) * scales / scales[:, None]
