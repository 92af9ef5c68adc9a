"""A problem together with the locus of one event: its curves are boundaries."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..errors import BadInput
from . import derivatives
from .problem import Curve, Problem

if TYPE_CHECKING:
    from .events import Event, Locus

Array = NDArray[np.float64]
Params = Mapping[str, float]


class Adjoined:
    """Residual and derivatives of a problem and the conditions of a locus together.

    `base` is the problem with one or two parameters freed. The unknowns are those of the problem,
    the extra ones of the locus, then the first freed parameter, which the conditions determine; the
    second, if any, stays a parameter.
    """

    def __init__(self, base: Curve, locus: Locus, event: Event | None = None) -> None:
        self.base = base
        self.locus = locus
        self.event = event
        self.free = base.free[1] if len(base.free) > 1 else None
        self.n = base.size
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
        if self.locus.unfolding is not None:
            own = own + self.locus.unfolding(extra)[0]
        conditions = np.asarray(self.locus.conditions(self.base, z, extra))
        if conditions.shape != (self.extra + 1,):
            raise BadInput(
                f"a locus with {self.extra} extra unknowns needs {self.extra + 1} conditions, "
                f"it gave {conditions.shape}"
            )
        return np.concatenate([own, conditions])

    def whole(self, x: Array, params: Params) -> Array:
        """All derivatives, columns in the order: unknowns, extra, released, free."""
        z, extra = self.split(x, params)
        n, m = self.n, self.extra
        whole = np.zeros((n + m + 1, z.size + m))
        own = self.base.jacobian(z)
        rows = self._conditions_derivative(z, extra)
        whole[:n, :n], whole[:n, n + m :] = own[:, :n], own[:, n:]
        whole[n:, :n], whole[n:, n + m :] = rows[:, :n], rows[:, n : z.size]
        whole[n:, n : n + m] = rows[:, z.size :]
        if self.locus.unfolding is not None:
            whole[:n, n : n + m] = self.locus.unfolding(extra)[1]
        return whole

    def moved(self, longer: Problem, free: tuple[str, ...]) -> Problem:
        """`longer`, a problem of this form, with its start and all its parameters meant."""
        values = {**longer.start, **longer.params}
        own = self.base.problem
        base = own.at(**{name: values[name] for name in own.names})
        together = Adjoined(Curve(base, free), self.locus, self.event)
        return replace(longer, residual=together.residual, adjoined=together)

    def freed(self, longer: Problem, free: tuple[str, ...]) -> Problem:
        """`longer` with another parameter for its second."""
        if not free or free == self.base.free[1:]:
            return longer
        return self.moved(longer, (self.base.free[0], *free))

    def _conditions_derivative(self, z: Array, extra: Array) -> Array:
        if self.locus.derivative is not None:
            return np.asarray(self.locus.derivative(self.base, z, extra))
        # apart: conditions that ask for derivatives of the problem at one z get those they had
        own = derivatives.differences(
            lambda y: self.locus.conditions(self.base, y, extra),
            z,
            scales=self.base.scales,
            one_sided=True,
        )
        if not extra.size:
            return own
        others = derivatives.differences(
            lambda y: self.locus.conditions(self.base, z, y),
            extra,
            scales=np.ones(extra.size),
            one_sided=True,
        )
        return np.hstack([own, others])


def lifted(locus: Locus, together: Adjoined, suffix: str) -> Locus:
    """The locus of an event of the shorter problem as one on the longer, its unknowns renamed."""
    base, n, m = together.base, together.n, together.extra

    def shortened(curve: Curve, z: Array) -> Array:
        return together.split(z[: curve.size], curve.params(z))[0]

    def conditions(curve: Curve, z: Array, extra: Array) -> Array:
        return np.asarray(locus.conditions(base, shortened(curve, z), extra))

    def derivative(curve: Curve, z: Array, extra: Array) -> Array:
        assert locus.derivative is not None
        rows = np.asarray(locus.derivative(base, shortened(curve, z), extra))
        return np.hstack([rows[:, :n], np.zeros((len(rows), m)), rows[:, n:]])

    names = {f"{name}{suffix}": value for name, value in locus.extra.items()}
    return replace(
        locus,
        extra=names,
        conditions=conditions,
        derivative=derivative if locus.derivative else None,
        events=(),
    )


def adjoined(
    problem: Problem,
    locus: Locus,
    released: str,
    free: str | None = None,
    *,
    base: Curve | None = None,
    event: Event | None = None,
) -> Problem:
    """`problem` with the conditions of `locus` added and the parameter `released` made unknown.

    `base` is its curve with these parameters free, where there is one already; `event` is what
    the locus is of, where the longer problem is one of boundaries.
    """
    if base is None:
        base = Curve(problem, (released,) if free is None else (released, free))
    together = Adjoined(base, locus, event)
    clash = set(locus.extra) & set(problem.names)
    if clash:
        raise BadInput(f"rename {sorted(clash)} in the problem: the locus needs these names")
    # an angle or a squared frequency is measured by its size: it is not what the steps are about
    scalars = {name: abs(float(v)) for name, v in locus.extra.items() if np.ndim(v) == 0}
    sizes = {name: size for name, size in scalars.items() if size > 1.0}
    return Problem(
        together.residual,
        {**problem.start, **locus.extra, released: problem.params[released]},
        {name: value for name, value in problem.params.items() if name != released},
        domain={**problem.domain, **{n: d for n, d in locus.domain.items() if n in base.free}},
        scales={**sizes, **problem.scales},
        adjoined=together,
    )
