"""Parameters as functions of others, and the chain rule for what depends on them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial, wraps
from operator import itemgetter
from typing import Any, Self

import numpy as np

from ...checks import number
from ...errors import BadInput
from ..algebra.derivatives import Scheme, choose
from ..algebra.newton import OUT_OF_DOMAIN, Array, Undefined
from ..algebra.sparse import Matrix, beside, dense, first_columns
from .curve import Curve, Params


@dataclass(frozen=True, eq=False)
class Ties:
    """Parameters of a problem, each as a function of those of another."""

    base: Any  # a Problem, which is built on this
    functions: Mapping[str, Callable[[Params], Any]]
    domain: Mapping[str, tuple[float, float]]  # of those that are tied
    schemes: dict[tuple[str, ...], Scheme] = field(default_factory=dict)  # of their derivatives
    curves: dict[tuple[str, ...], Curve] = field(default_factory=dict)  # of the base

    @classmethod
    def checked(
        cls, base: Any, functions: Mapping[str, Any], values: Mapping[str, float]
    ) -> tuple[Self, dict[str, float]]:
        """The ties of a problem, and the parameters that there are now."""
        if not isinstance(functions, Mapping) or not all(map(callable, functions.values())):
            raise BadInput(f"functions of parameters by name were expected, got {functions!r}")
        if unknown := [name for name in functions if name not in base.params]:
            raise BadInput(f"{unknown[0]!r} is no parameter to tie; it has {list(base.params)}")
        every = {**base.params, **values}
        params = {n: value for n, value in every.items() if n not in functions or n in values}
        domain = {n: edges for n, edges in base.domain.items() if n in functions}
        ties = cls(base, {n: functions.get(n, itemgetter(n)) for n in base.params}, domain)
        try:
            inner = ties(params)
        except (KeyError, *OUT_OF_DOMAIN) as error:
            raise BadInput(f"the functions have no value at {params}: {error!r}") from error
        for name, value in inner.items():
            number(name, value, -math.inf, math.inf, "a number from its function")
        return ties, params

    def __call__(self, params: Params) -> dict[str, Any]:
        return {name: function(params) for name, function in self.functions.items()}

    def of(self, function: Callable[..., Any]) -> Callable[[Array, Params], Any]:
        """A function of unknowns and parameters of the problem as one of the new parameters."""
        return partial(self._through, function)

    def _through(self, function: Callable[..., Any], x: Array, params: Params) -> Any:
        return function(x, self(params))

    def slopes(self, params: Params, free: tuple[str, ...]) -> dict[str, Array]:
        """Derivatives in free parameters, of those that change with any."""
        if not free:
            return {}

        def tied(z: Array) -> Array:
            return np.array([*self({**params, **dict(zip(free, z, strict=True))}).values()])

        place = np.array([params[name] for name in free])
        if free not in self.schemes:
            self.schemes[free] = choose(tied, place, np.ones(place.size))
        rows = self.schemes[free](tied, place)
        return {name: row for name, row in zip(self.functions, rows, strict=True) if row.any()}

    def within(self, params: Params) -> dict[str, Any]:
        """The parameters of the base; `Undefined` outside of its domain."""
        inner = self(params)
        for name, (low, high) in self.domain.items():
            value = inner[name]
            # an end that was calculated is met to rounding
            if not (low <= value <= high or min(abs(value - low), abs(value - high)) < 1e-12):
                raise Undefined(f"{name} = {value:.6g} leaves its domain, {low:g} to {high:g}")
        return inner

    def untied(
        self, start: Mapping[str, Any], x: Array, params: Params, free: tuple[str, ...]
    ) -> tuple[Curve, Array, Array]:
        """The curve of the base in all its parameters that change with free ones, the point on it,
        and the derivatives of these parameters.

        `Undefined` outside of the domain of the base; not so where its equations are evaluated, for
        differences look beyond the edges of a domain.
        """
        inner, rows = self.within(params), self.slopes(params, free)
        names, still = (*rows,), inner.keys() - rows.keys()
        curve = self.curves.get(names)
        if curve is None or any(curve.fixed[name] != inner[name] for name in still):
            curve = self.curves[names] = Curve(self.base.at(**start, **inner), names)
        z = np.append(x, [inner[name] for name in names])
        return curve, z, np.reshape([*rows.values()], (len(rows), len(free)))

    def derivatives(
        self, start: Mapping[str, Any], x: Array, params: Params, free: tuple[str, ...]
    ) -> Matrix:
        """Derivatives of the base in the parameters that change, times those of the functions."""
        curve, z, chain = self.untied(start, x, params, free)
        matrix = curve.jacobian(z)
        return beside(first_columns(matrix, x.size), dense(matrix[:, x.size :]) @ chain)


def chained(slopes: Callable[..., Array]) -> Callable[..., Array]:
    """Let derivatives by names of parameters, ``(of, curve, z, extra)``, suit tied problems."""

    @wraps(slopes)
    def along(of: Any, curve: Curve, z: Array, extra: Array) -> Array:
        ties: Ties | None = getattr(curve.problem, "ties", None)
        if ties is None:
            return slopes(of, curve, z, extra)
        at = z[: curve.size], curve.params(z), curve.free
        base, place, chain = ties.untied(curve.problem.start, *at)
        rows, n, m = along(of, base, place, extra), curve.size, place.size
        return np.hstack([rows[:, :n], rows[:, n:m] @ chain, rows[:, m:]])

    return along
