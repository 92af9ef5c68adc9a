"""Parameters as functions of others: `Problem.tied`, and the chain rule for its derivatives."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial, wraps
from operator import itemgetter
from typing import Any

import numpy as np

from ...checks import number
from ...errors import BadInput
from ..algebra.derivatives import Scheme, choose
from ..algebra.newton import OUT_OF_DOMAIN, Array, Undefined
from ..algebra.sparse import Matrix, beside, first_columns, is_sparse
from .curve import Curve, Params
from .problem import Problem


@dataclass(frozen=True, eq=False)
class Ties:
    """Parameters of a problem, each as a function of others."""

    functions: Mapping[str, Callable[[Params], Any]]
    schemes: dict[tuple[str, ...], Scheme] = field(default_factory=dict)  # of their derivatives
    curves: dict[tuple[str, ...], Curve] = field(default_factory=dict)  # of the problem itself

    def __call__(self, params: Params) -> dict[str, Any]:
        return {name: function(params) for name, function in self.functions.items()}

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

    def of(self, function: Callable[..., Any]) -> Callable[[Array, Params], Any]:
        """A function of unknowns and parameters of the problem as one of the new parameters."""
        return partial(_through, self, function)


def _through(ties: Ties, function: Callable[..., Any], x: Array, params: Params) -> Any:
    return function(x, ties(params))


def _of_point(function: Callable[[Params], Any], point: Any) -> float:
    return float(function(point.params))


@dataclass(frozen=True, eq=False, repr=False)
class TiedProblem(Problem):
    """A problem whose parameters are functions of others, from `Problem.tied`: its derivatives are
    those of the base in all its parameters that change, times those of the functions."""

    base: Problem = field(kw_only=True)
    ties: Ties = field(kw_only=True)

    @classmethod
    def tie(
        cls, base: Problem, functions: Mapping[str, Any], values: Mapping[str, float], **more: Any
    ) -> Any:
        """Tie a problem; `more` are fields of a derived class."""
        if not isinstance(functions, Mapping) or not all(map(callable, functions.values())):
            raise BadInput(f"functions of parameters by name were expected, got {functions!r}")
        if unknown := [name for name in functions if name not in base.params]:
            raise BadInput(f"{unknown[0]!r} is no parameter to tie; it has {list(base.params)}")
        every = {**base.params, **values}
        params = {n: value for n, value in every.items() if n not in functions or n in values}
        ties = Ties({n: functions.get(n, itemgetter(n)) for n in base.params})
        try:
            inner = ties(params)
        except (KeyError, *OUT_OF_DOMAIN) as error:
            raise BadInput(f"the functions have no value at {params}: {error!r}") from error
        for name, value in inner.items():
            number(name, value, -math.inf, math.inf, "a number from its function")
        gone = {n: partial(_of_point, f) for n, f in functions.items() if n not in params}
        domain = {n: ends for n, ends in base.domain.items() if n not in functions}
        scales = {n: size for n, size in base.scales.items() if n not in functions}
        return cls(
            ties.of(base.residual), base.start, params, events=base.events, label=base.label,
            record={**base.record, **gone}, domain=domain, scales=scales, base=base, ties=ties,
            **more,
        )  # fmt: skip

    def untied(self, x: Array, params: Params, free: tuple[str, ...]) -> tuple[Curve, Array, Array]:
        """The curve of the base in all its parameters that change with free ones, the point on it,
        and the derivatives of these parameters.

        `Undefined` outside of the domain of the base; not so where its equations are evaluated, for
        differences look beyond the edges of a domain.
        """
        inner, base, curves = self.ties(params), self.base, self.ties.curves
        for name in base.domain.keys() - self.domain.keys():
            value, (low, high) = inner[name], base.domain[name]
            # an end that was calculated is met to rounding
            if not (low <= value <= high or min(abs(value - low), abs(value - high)) < 1e-12):
                raise Undefined(f"{name} = {value:.6g} leaves its domain, {low:g} to {high:g}")
        rows = self.ties.slopes(params, free)
        names, still = (*rows,), inner.keys() - rows.keys()
        curve = curves.get(names)
        if curve is None or any(curve.fixed[name] != inner[name] for name in still):
            curve = curves[names] = Curve(base.at(**self.start, **inner), names)
        z = np.append(x, [inner[name] for name in names])
        return curve, z, np.reshape([*rows.values()], (len(rows), len(free)))

    def derivatives(self, x: Array, params: Params, free: tuple[str, ...]) -> Matrix:
        curve, z, chain = self.untied(x, params, free)
        matrix = curve.jacobian(z)
        columns = matrix[:, x.size :]
        slopes = (columns.toarray() if is_sparse(columns) else columns) @ chain
        return beside(first_columns(matrix, x.size), slopes)

    @property
    def tested(self) -> bool:  # type: ignore[override]
        # what the base has no derivatives for is by differences anyhow
        return self.base.tested or self.base.jacobian is None

    @property
    def interpret(self) -> Callable[[Any], Any] | None:  # type: ignore[override]
        asked: Any = self.base.interpret

        def interpreted(point: Any) -> Any:
            curve, z, _ = self.untied(point.x, point.params, point.curve.free)
            return asked(replace(point, curve=curve, z=z, tangent=None))

        return asked and interpreted

    def images(self, x: Array, params: Params) -> tuple[Array, ...]:
        return self.base.images(x, self.ties(params))

    def modulo(self, x: Array, params: Params) -> Mapping[str, Any]:
        return self.base.modulo(x, self.ties(params))


def chained(slopes: Callable[..., Array]) -> Callable[..., Array]:
    """Let derivatives by names of parameters, ``(of, curve, z, extra)``, suit tied problems."""

    @wraps(slopes)
    def along(of: Any, curve: Curve, z: Array, extra: Array) -> Array:
        if not isinstance(curve.problem, TiedProblem):
            return slopes(of, curve, z, extra)
        base, place, chain = curve.problem.untied(z[: curve.size], curve.params(z), curve.free)
        rows, n, m = slopes(of, base, place, extra), curve.size, place.size
        return np.hstack([rows[:, :n], rows[:, n:m] @ chain, rows[:, m:]])

    return along
