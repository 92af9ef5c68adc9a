"""A problem together with the locus of one event: the longer problem whose curves are boundaries."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..errors import BadInput
from . import derivatives
from .newton import Undefined
from .problem import OUT_OF_DOMAIN, Curve, Problem

if TYPE_CHECKING:
    from .events import Locus

Array = NDArray[np.float64]
Params = Mapping[str, float]


class Adjoined:
    """Residual and derivatives of `problem` and the conditions of `locus`, with parameters freed.

    The unknowns are those of the problem, the extra ones of the locus, then ``released``: a
    parameter that the conditions determine. ``free``, if any, stays a parameter.
    """

    def __init__(self, problem: Problem, locus: Locus, released: str, free: str | None) -> None:
        self.base = Curve(problem, (released,) if free is None else (released, free))
        self.locus = locus
        self.free = free
        self.n = self.base.size
        self.extra = sum(np.size(value) for value in locus.extra.values())

    def split(self, x: Array, params: Params) -> tuple[Array, Array]:
        """(z of the base curve, extra unknowns) from the unknowns here."""
        base = np.append(x[: self.n], x[-1])
        if self.free is not None:
            base = np.append(base, params[self.free])
        return base, x[self.n : -1]

    def residual(self, x: Array, params: Params) -> Array:
        z, extra = self.split(x, params)
        own = self.base.equations(z)
        conditions = np.asarray(self.locus.conditions(self.base, z, extra))
        if conditions.shape != (self.extra + 1,):
            raise BadInput(
                f"a locus with {self.extra} extra unknowns needs {self.extra + 1} conditions, "
                f"it gave {conditions.shape}"
            )
        return np.concatenate([own, conditions])

    def jacobian(self, x: Array, params: Params) -> Array:
        return self._whole(x, params)[:, : x.size]

    def sensitivity(self, x: Array, params: Params, name: str) -> Array:
        if name != self.free:
            raise BadInput(f"the boundary was set up in {self.free!r}, not {name!r}")
        return self._whole(x, params)[:, x.size]

    def _whole(self, x: Array, params: Params) -> Array:
        """All derivatives, columns in the order: unknowns, extra, released, free."""
        z, extra = self.split(x, params)
        n, m = self.n, self.extra
        whole = np.zeros((n + m + 1, z.size + m))
        own = self.base.jacobian(z)
        rows = self._conditions_derivative(z, extra)
        whole[:n, :n], whole[:n, n + m :] = own[:, :n], own[:, n:]
        whole[n:, :n], whole[n:, n + m :] = rows[:, :n], rows[:, n : z.size]
        whole[n:, n : n + m] = rows[:, z.size :]
        return whole

    def _conditions_derivative(self, z: Array, extra: Array) -> Array:
        if self.locus.derivative is not None:
            return np.asarray(self.locus.derivative(self.base, z, extra))
        size = z.size
        try:
            return derivatives.differences(
                lambda y: self.locus.conditions(self.base, y[:size], y[size:]),
                np.append(z, extra),
            )
        except OUT_OF_DOMAIN as error:
            raise Undefined(str(error)) from error


def adjoined(problem: Problem, locus: Locus, released: str, free: str | None = None) -> Problem:
    """`problem` with the conditions of `locus` added and the parameter `released` made unknown."""
    together = Adjoined(problem, locus, released, free)
    clash = set(locus.extra) & set(problem.names)
    if clash:
        raise BadInput(f"rename {sorted(clash)} in the problem: the locus needs these names")
    return Problem(
        together.residual,
        {**problem.start, **locus.extra, released: problem.params[released]},
        {name: value for name, value in problem.params.items() if name != released},
        jacobian=together.jacobian,
        sensitivity=None if free is None else together.sensitivity,
        domain=problem.domain,
        adjoined=together,
    )
