"""What a user brings: equations F(x, p) = 0 with names for every unknown and every parameter."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import BadInput, NotConverged
from . import derivatives
from .newton import Solution, Undefined, newton

if TYPE_CHECKING:
    from .adjoin import Adjoined
    from .branch import Point
    from .events import Event

Array = NDArray[np.float64]
Params = Mapping[str, float]
Residual = Callable[[Array, Params], Array]

# What equations raise where they have no value; anything else is a bug and must surface.
OUT_OF_DOMAIN = (BadInput, ArithmeticError, np.linalg.LinAlgError)


@dataclass(frozen=True, eq=False)
class Problem:
    """Equations ``F(x, p) = 0`` with named unknowns and parameters: the one contract of the engine.

    Parameters
    ----------
    residual : callable
        ``residual(x, params) -> array`` with as many entries as `x`. `x` is a one-dimensional
        array in the order of `start`, `params` a dict of floats. Where the equations have no
        value it raises `BadInput`, an `ArithmeticError` or returns a NaN: the branch ends there.
    start : dict
        Name and start value of each unknown; a value may be a one-dimensional array.
    params : dict
        Name and value of each parameter. Which one is free is an argument of the walk.
    jacobian : callable, optional
        ``jacobian(x, params) -> (n, n) array``, the derivative in `x`. Checked once against
        differences. Without it, complex steps are used where they hold, differences elsewhere.
    sensitivity : callable, optional
        ``sensitivity(x, params, name) -> (n,) array``, the derivative in one parameter.
    events : tuple of Event, optional
        What a walk looks for unless told otherwise.
    record : dict, optional
        Name and function of a `Point` for each derived number to keep along a branch.
    domain : dict, optional
        ``{name: (low, high)}``, bounds of unknowns or parameters beyond which nothing is meant.
    interpret : callable, optional
        Turns a `Point` into what it is to its user; ``point.solution`` calls it.
    label : str, optional
        Shown in tables.
    adjoined : Adjoined, optional
        Set by `boundary`: the shorter problem and the locus this one consists of.

    Raises
    ------
    BadInput
        Where names clash, a value is not finite, or shapes do not fit.

    Examples
    --------
    >>> import numpy as np
    >>> circle = Problem(lambda x, p: np.array([x[0]**2 + p["mu"]**2 - 1]),
    ...                  start={"x": 1.0}, params={"mu": 0.0})
    >>> circle.names
    ('x', 'mu')
    """

    residual: Residual
    start: Mapping[str, Any]
    params: Params
    jacobian: Callable[[Array, Params], Array] | None = field(default=None, kw_only=True)
    sensitivity: Callable[[Array, Params, str], Array] | None = field(default=None, kw_only=True)
    events: tuple[Event, ...] = field(default=(), kw_only=True)
    record: Mapping[str, Callable[[Point], float]] = field(default_factory=dict, kw_only=True)
    domain: Mapping[str, tuple[float, float]] = field(default_factory=dict, kw_only=True)
    interpret: Callable[[Point], Any] | None = field(default=None, kw_only=True)
    label: str = field(default="", kw_only=True)
    adjoined: Adjoined | None = field(default=None, kw_only=True, repr=False)

    def __post_init__(self) -> None:
        if not self.start:
            raise BadInput("a problem needs at least one unknown: start is empty")
        clash = set(self.start) & set(self.params)
        if clash:
            raise BadInput(f"{sorted(clash)} are named both as unknowns and as parameters")
        for name, value in (*self.start.items(), *self.params.items()):
            array = np.asarray(value, dtype=float)
            if array.ndim > (name in self.start):
                raise BadInput(f"{name!r} has shape {array.shape}; a number was wanted")
            if not np.isfinite(array).all():
                raise BadInput(f"{name!r} must be finite, got {value}")

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the unknowns, then of the parameters."""
        return (*self.start, *self.params)

    @cached_property
    def slots(self) -> dict[str, int | slice]:
        """Where each unknown lies in `x`."""
        slots: dict[str, int | slice] = {}
        at = 0
        for name, value in self.start.items():
            size = np.size(value)
            slots[name] = at if np.ndim(value) == 0 else slice(at, at + size)
            at += size
        return slots

    @cached_property
    def x(self) -> Array:
        """The start values as one array."""
        values = [np.atleast_1d(np.asarray(value, dtype=float)) for value in self.start.values()]
        return np.concatenate(values)

    @cached_property
    def metric(self) -> Array | None:
        """Weights of the squared arclength: an array unknown counts as its mean square, so that
        a refined mesh keeps its steps. None where all weights are 1."""
        weights = [np.full(np.size(v), 1 / np.size(v)) for v in self.start.values()]
        joined = np.concatenate(weights)
        return None if (joined == 1).all() else joined

    def at(self, **values: Any) -> Problem:
        """The same problem with other start values or parameters."""
        self.check_names(values)
        start = {name: values.get(name, value) for name, value in self.start.items()}
        params = {name: values.get(name, value) for name, value in self.params.items()}
        return replace(self, start=start, params=params)

    def check_names(self, names: Iterable[str]) -> None:
        """Raise `BadInput` at the first name that this problem does not have."""
        for name in names:
            if name not in self.start and name not in self.params:
                raise BadInput(f"no {name!r} in this problem; it has {list(self.names)}")

    def evaluate(self, x: Array, params: Params) -> Array:
        """The residual, or `Undefined` where it has none."""
        try:
            value = np.asarray(self.residual(x, params))
        except OUT_OF_DOMAIN as error:
            raise Undefined(str(error)) from error
        # the sum is finite unless an entry is not (or all but overflows, which is as bad)
        if not math.isfinite(value.sum()):
            raise Undefined("the equations are not finite")
        return value

    def solve(self, *, tolerance: float = 1e-9) -> tuple[Problem, Solution]:
        """The problem with its start moved onto a solution at the same parameters.

        Raises
        ------
        NotConverged
            If Newton's iteration from the start finds no solution; says both residuals.
        """
        curve = Curve(self, ())
        before = float(abs(curve.equations(self.x)).max())
        try:
            found = newton(curve.equations, curve.jacobian, self.x, tolerance=tolerance, most=30)
        except Undefined as error:
            raise NotConverged(
                f"the start {self._shown()} is no solution (residual {before:.3g}) and Newton's "
                f"iteration from it leaves the domain: {error}",
                residual=before,
            ) from error
        scale = 1 + float(abs(found.z).max())
        if not found.converged or found.residual > 1e-6 * scale:
            raise NotConverged(
                f"the start {self._shown()} is no solution: residual {before:.3g}, and "
                f"{found.residual:.3g} after {found.iterations} Newton iterations; "
                "start closer to a solution or at other parameters",
                residual=before,
            )
        start = {
            name: (float(found.z[at]) if isinstance(at, int) else found.z[at])
            for name, at in self.slots.items()
        }
        return replace(self, start=start), found

    def _shown(self) -> str:
        values = {**self.start, **self.params}
        return ", ".join(
            f"{name}={float(value):.6g}" for name, value in values.items() if np.ndim(value) == 0
        )


class Curve:
    """A problem with named parameters set free: H(z) with ``z = (x, free parameters)``."""

    def __init__(self, problem: Problem, free: tuple[str, ...]) -> None:
        for name in free:
            if name not in problem.params:
                raise BadInput(
                    f"{name!r} is no parameter of this problem; it has {list(problem.params)}"
                )
        self.problem = problem
        self.free = free
        self.size = problem.x.size
        self.fixed = {name: float(value) for name, value in problem.params.items()}
        self.start = np.concatenate([problem.x, [self.fixed[name] for name in free]])
        self.slots = {**problem.slots, **{name: self.size + i for i, name in enumerate(free)}}
        weights = problem.metric
        self.metric = None if weights is None else np.concatenate([weights, np.ones(len(free))])
        self._scheme: Callable[[Callable[[Array], Array], Array], Array] | None = None

    def dual(self, tangent: Array) -> Array:
        """The row whose product with z is the inner product of the arclength."""
        return tangent if self.metric is None else tangent * self.metric

    def normalised(self, z: Array) -> Array:
        return z / math.sqrt(z.dot(self.dual(z)))

    @cached_property
    def scale(self) -> float:
        """Size of the derivative at the start: what is small against it counts as zero."""
        return float(np.linalg.norm(self.jacobian(self.start), 2))

    def params(self, z: Array) -> dict[str, float]:
        """All parameters at z, the free ones taken from it."""
        values = self.fixed.copy()
        for i, name in enumerate(self.free):
            values[name] = float(z[self.size + i])
        return values

    def equations(self, z: Array) -> Array:
        return self.problem.evaluate(z[: self.size], self.params(z))

    def jacobian(self, z: Array) -> Array:
        """Derivative of `equations`, shape ``(n, n + len(free))``."""
        problem, n = self.problem, self.size
        x, params = z[:n], self.params(z)
        if problem.jacobian is None or (self.free and problem.sensitivity is None):
            return self._automatic(z)
        matrix = np.empty((n, z.size))
        try:
            matrix[:, :n] = problem.jacobian(x, params)
            for i, name in enumerate(self.free):
                matrix[:, n + i] = problem.sensitivity(x, params, name)  # type: ignore[misc]
        except OUT_OF_DOMAIN as error:
            raise Undefined(str(error)) from error
        return matrix

    def _automatic(self, z: Array) -> Array:
        if self._scheme is None:
            self._scheme = derivatives.choose(self._raw, z)
        problem, n = self.problem, self.size
        try:
            if problem.jacobian is None:
                return self._scheme(self._raw, z)
            matrix = np.empty((n, z.size))
            matrix[:, :n] = problem.jacobian(z[:n], self.params(z))
            matrix[:, n:] = self._scheme(lambda free: self._raw(np.append(z[:n], free)), z[n:])
        except OUT_OF_DOMAIN as error:
            raise Undefined(str(error)) from error
        return matrix

    def _raw(self, z: Array) -> Array:
        """The residual without checks, at a possibly complex z."""
        values: dict[str, Any] = dict(self.fixed)
        values.update(zip(self.free, z[self.size :], strict=True))
        return np.asarray(self.problem.residual(z[: self.size], values))

    def check(self) -> None:
        """Refuse wrong shapes and wrong derivatives before anything is built on them."""
        value = self.equations(self.start)
        if value.shape != (self.size,):
            raise BadInput(
                f"the residual has shape {value.shape} for {self.size} unknowns; "
                f"as many equations as unknowns, ({self.size},), were wanted"
            )
        if self.problem.jacobian is None and self.problem.sensitivity is None:
            return
        given = self.jacobian(self.start)
        try:
            wanted = derivatives.differences(self._raw, self.start, finer=16.0)
            if not np.isfinite(wanted).all() or derivatives.agree(given, wanted, 1e-5):
                return
            # next to a singularity differences are poor: refuse only what they can tell apart
            doubt = abs(derivatives.differences(self._raw, self.start, finer=128.0) - wanted)
        except OUT_OF_DOMAIN:
            return  # the start lies at the rim of the domain, where differences cannot look
        off = abs(given - wanted)
        row, column = np.unravel_index(np.argmax(off - 10 * doubt), wanted.shape)
        if off[row, column] <= 10 * doubt[row, column] + 1e-5 * (1 + abs(wanted).max()):
            return
        raise BadInput(
            f"the Jacobian that was given does not fit the residual: its entry ({row}, {column}) "
            f"is {given[row, column]:.8g}, differences give {wanted[row, column]:.8g}"
        )
