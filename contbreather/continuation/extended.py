"""A problem and the conditions of one event as one longer problem: its curves are boundaries."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..errors import BadInput
from . import derivatives
from .curve import Curve, Params
from .point import Event, Locus
from .problem import Problem
from .sparse import Matrix, above, beside
from .strider import Loops

Array = NDArray[np.float64]


class Extended:
    """Residual and derivatives of a problem and the conditions of a locus together.

    The unknowns are those of the problem, the extra ones of the locus, then a parameter that is
    `released`: the conditions determine it. `base` is the curve of the problem with this parameter
    free, and perhaps another one that is to be free in the longer problem.
    """

    def __init__(self, base: Curve, locus: Locus, event: Event | None = None) -> None:
        self.locus = locus
        self.event = event
        self.problem = base.problem
        self.released, *others = base.free
        self.free = tuple(others)
        self.n = base.size
        self.extra = sum(np.size(value) for value in locus.extra.values())
        self._curves = {self.free: base}

    def beneath(self, x: Array, params: Params, free: tuple[str, ...]) -> tuple[Curve, Array]:
        """The curve of the shorter problem, and the point on it."""
        z = np.concatenate([x[: self.n], x[-1:], [params[name] for name in free]])
        curve = self._curves.get(free)
        # made anew where a parameter that is not free has another value
        fixed = (name for name in params if name not in free)
        if curve is None or any(curve.fixed[name] != params[name] for name in fixed):
            values = {name: x[slot] for name, slot in self.problem.slots.items()}
            here = self.problem.at(**values, **params, **{self.released: float(x[-1])})
            curve = self._curves[free] = Curve(here, (self.released, *free))
        return curve, curve.recalled(z)

    def __call__(self, x: Array, params: Params) -> Array:
        curve, z = self.beneath(x, params, self.free)
        extra = x[self.n : -1]
        own = curve.equations(z)
        if self.locus.unfolding is not None:
            own = own + self.locus.unfolding(extra)[0]
        conditions = np.asarray(self.locus.conditions(curve, z, extra))
        if conditions.shape != (self.extra + 1,):
            raise BadInput(
                f"a locus with {self.extra} extra unknowns needs {self.extra + 1} conditions, "
                f"it gave {conditions.shape}"
            )
        return np.concatenate([own, conditions])

    def loops(self, names: tuple[str, ...], params: Params) -> Loops | None:
        """As those of a `Problem`."""
        longer = self.locus.loops
        found = longer and Curve(self.problem, (self.released, *names)).loops(params)
        return longer(found, self.n) if longer and found else None

    def derivatives(self, x: Array, params: Params, free: tuple[str, ...]) -> Matrix:
        """Columns in the order: unknowns, extra, released, free."""
        (curve, z), extra = self.beneath(x, params, free), x[self.n : -1]
        n, unfolding = self.n, self.locus.unfolding
        own, rows = curve.jacobian(z), self._of_conditions(curve, z, extra)
        middle = np.zeros((n, self.extra)) if unfolding is None else unfolding(extra)[1]
        below = np.hstack([rows[:, :n], rows[:, z.size :], rows[:, n : z.size]])
        return above(beside(beside(own[:, :n], middle), own[:, n:]), below)

    def _of_conditions(self, curve: Curve, z: Array, extra: Array) -> Array:
        if self.locus.derivative is not None:
            return np.asarray(self.locus.derivative(curve, z, extra))
        # apart: conditions that ask for derivatives of the problem at one z get those they had
        own = derivatives.differences(
            lambda y: self.locus.conditions(curve, y, extra), z, scales=curve.scales, one_sided=True
        )
        if not extra.size:
            return own
        others = derivatives.differences(
            lambda y: self.locus.conditions(curve, z, y),
            extra,
            scales=np.ones(extra.size),
            one_sided=True,
        )
        return np.hstack([own, others])


@dataclass(frozen=True, eq=False, repr=False)
class ExtendedProblem(Problem):
    """As a problem: `residual` knows its derivatives."""

    residual: Extended

    def derivatives(self, x: Array, params: Params, free: tuple[str, ...]) -> Matrix:
        return self.residual.derivatives(x, params, free)

    def loops(self, free: tuple[str, ...], params: Params) -> Loops | None:
        return self.residual.loops(free, params)

    def beneath(self, x: Array, params: Params, free: tuple[str, ...]) -> tuple[Curve, Array]:
        return self.residual.beneath(x, params, free)


def extended(
    base: Curve,
    locus: Locus,
    event: Event | None = None,
    make: Callable[..., ExtendedProblem] = ExtendedProblem,
) -> ExtendedProblem:
    """The problem of a curve with the conditions of `locus` added, and the first of its free
    parameters made unknown; `event` is what the locus is of, where that is a boundary."""
    problem, released = base.problem, base.free[0]
    clash = set(locus.extra) & set(problem.names)
    if clash:
        raise BadInput(f"rename {sorted(clash)} in the problem: the locus needs these names")
    # an angle or a squared frequency is measured by its size: it is not what the steps are about
    scalars = {name: abs(float(v)) for name, v in locus.extra.items() if np.ndim(v) == 0}
    sizes = {name: size for name, size in scalars.items() if size > 1.0}
    return make(
        Extended(base, locus, event),
        {**problem.start, **locus.extra, released: problem.params[released]},
        {name: value for name, value in problem.params.items() if name != released},
        domain={
            **problem.domain,
            **{n: d for n, d in locus.domain.items() if n in base.free or n in locus.extra},
        },
        scales={**sizes, **problem.scales},
    )


def event_of(problem: Problem) -> Event | None:
    """The event whose boundary a problem is of, if it is one."""
    return problem.residual.event if isinstance(problem, ExtendedProblem) else None


def lifted(locus: Locus, together: Extended, suffix: str) -> Locus:
    """The locus of an event of the shorter problem as one on the longer, its unknowns renamed."""
    above = _Above(locus, together)
    names = {f"{name}{suffix}": value for name, value in locus.extra.items()}
    return replace(
        locus,
        extra=names,
        conditions=above.conditions,
        derivative=above.derivative if locus.derivative else None,
        events=(),
        loops=None,
    )


@dataclass(frozen=True)
class _Above:
    """Conditions of the shorter problem, asked of a curve of the longer."""

    locus: Locus
    together: Extended

    def conditions(self, curve: Curve, z: Array, extra: Array) -> Array:
        base, own = self.together.beneath(z[: curve.size], curve.params(z), curve.free)
        return np.asarray(self.locus.conditions(base, own, extra))

    def derivative(self, curve: Curve, z: Array, extra: Array) -> Array:
        assert self.locus.derivative is not None
        base, own = self.together.beneath(z[: curve.size], curve.params(z), curve.free)
        rows = np.asarray(self.locus.derivative(base, own, extra))
        n, m = self.together.n, self.together.extra
        return np.hstack([rows[:, :n], np.zeros((len(rows), m)), rows[:, n:]])
