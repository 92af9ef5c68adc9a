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
from .newton import OUT_OF_DOMAIN, Solution, Undefined, approach, length, newton, rounding

if TYPE_CHECKING:
    from .adjoin import Adjoined
    from .branch import Point
    from .events import Event
    from .seed import Seed

Array = NDArray[np.float64]

_VANISHED = 1e-9  # relative size of a row of the derivative that says nothing of its equation
_ASIDE = 1e-3  # and how far off, relative to 1 + |z|, it does
Params = Mapping[str, float]
Residual = Callable[[Array, Params], Array]


@dataclass(frozen=True, eq=False, repr=False)
class Problem:
    """Equations ``F(x, p) = 0`` with named unknowns and parameters: the one contract of the engine.

    Parameters
    ----------
    residual : callable
        ``residual(x, params) -> array`` with as many entries as `x`; one equation may be a number.
        `x` is a one-dimensional array in the order of `start`, `params` a dict of floats. Where the
        equations have no value it raises a `ValueError` or `ArithmeticError` or returns a NaN: the
        branch ends there.
    start : dict
        Name and start value of each unknown; a value may be a one-dimensional array.
    params : dict
        Name and value of each parameter. Which one is free is an argument of the walk.
    jacobian : callable, optional
        ``jacobian(x, params) -> (n, n) array``, the derivative in `x`. Checked once against
        differences. Without it, complex steps are used where they hold, differences elsewhere.
    sensitivity : callable, optional
        ``sensitivity(x, params, name) -> (n,) array``, the derivative in one parameter. Used, and
        checked, together with `jacobian` only.
    events : tuple of Event, optional
        What a walk looks for unless told otherwise.
    record : dict, optional
        Name and function of a `Point` for each derived number to keep along a branch.
    domain : dict, optional
        ``{name: (low, high)}``, bounds of unknowns (of the norm of an array) or parameters beyond
        which nothing is meant.
    scales : dict, optional
        Typical size of an unknown or parameter where that is far from 1: arclength, tolerance
        and differences are measured in it.
    interpret : callable, optional
        Turns a `Point` into what it is to its user; ``point.solution`` calls it.
    images : callable, optional
        ``images(x, params) -> tuple of arrays``: the solutions that a symmetry of the equations
        makes of one, its mirror image or the other phases of a cycle. Diagrams recognise them.
    simpler : callable, optional
        ``simpler(point) -> Problem or None``: where a solution is one of a smaller problem too, a
        fixed point among the cycles of period 2, that problem with the solution as its start.
    lifts : dict, optional
        ``{kind: lift}``: where other curves leave an event of that kind, ``lift(point)`` returns a
        tuple of `Seed`. `switch` follows them.
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
    scales: Mapping[str, float] = field(default_factory=dict, kw_only=True)
    interpret: Callable[[Point], Any] | None = field(default=None, kw_only=True)
    images: Callable[[Array, Params], tuple[Array, ...]] | None = field(default=None, kw_only=True)
    simpler: Callable[[Point], Problem | None] | None = field(default=None, kw_only=True)
    lifts: Mapping[str, Callable[[Point], tuple[Seed, ...]]] = field(
        default_factory=dict, kw_only=True
    )
    label: str = field(default="", kw_only=True)
    adjoined: Adjoined | None = field(default=None, kw_only=True, repr=False)

    def __post_init__(self) -> None:
        for what in ("start", "params", "scales", "domain", "record", "lifts"):
            given = getattr(self, what)
            if not isinstance(given, Mapping):
                raise BadInput(f"{what} must be a dict of names and values, got {given!r}")
        for what in ("residual", "jacobian", "sensitivity"):
            function = getattr(self, what)
            if not (callable(function) or (function is None and what != "residual")):
                raise BadInput(f"{what} must be a function, got {function!r}")
        if not self.start:
            raise BadInput("a problem needs at least one unknown: start is empty")
        clash = set(self.start) & set(self.params)
        if clash:
            raise BadInput(f"{sorted(clash)} are named both as unknowns and as parameters")
        for name, value in (*self.start.items(), *self.params.items()):
            array = _real(name, value)
            if not array.size:
                raise BadInput(f"{name!r} is empty; at least one number was wanted")
            if array.ndim > (name in self.start):
                raise BadInput(f"{name!r} has shape {array.shape}; a number was wanted")
            if not np.isfinite(array).all():
                raise BadInput(f"{name!r} must be finite, got {value}")
        taken = sorted({"arclength", "residual"} & {*self.start, *self.params, *self.record})
        if taken:
            raise BadInput(f"rename {taken} in the problem: every branch has columns of that name")
        self.check_names((*self.scales, *self.domain))
        for name, size in self.scales.items():
            if not 0 < _real(name, size) < math.inf:
                raise BadInput(f"the scale of {name!r} must be finite and positive, got {size}")

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

    def at(self, **values: Any) -> Problem:
        """The same problem with other start values or parameters."""
        self.check_names(values)
        start = {name: values.get(name, value) for name, value in self.start.items()}
        params = {name: values.get(name, value) for name, value in self.params.items()}
        moved = replace(self, start=start, params=params)
        return (
            moved if self.adjoined is None else self.adjoined.moved(moved, self.adjoined.base.free)
        )

    def check_names(self, names: Iterable[str]) -> None:
        """Raise `BadInput` at the first name that this problem does not have."""
        for name in names:
            if name not in self.start and name not in self.params:
                raise BadInput(f"no {name!r} in this problem; it has {list(self.names)}")

    def evaluate(self, x: Array, params: Params) -> Array:
        """The residual, or `Undefined` where it has none."""
        try:  # np.array copies: the same array may come back each time, written anew
            value = np.array(self.residual(x, params), ndmin=1)
        except OUT_OF_DOMAIN as error:
            raise Undefined(str(error)) from error
        try:  # the sum is finite unless an entry is not (or all but overflows, which is as bad)
            total = value.sum()
            finite = isinstance(total, complex) or math.isfinite(total)
        except TypeError as error:
            raise BadInput(f"the residual is {value!r}; an array of numbers was wanted") from error
        if value.shape != x.shape:
            raise BadInput(
                f"the residual has shape {value.shape} for {x.size} unknowns; "
                f"as many equations as unknowns, {x.shape}, were wanted"
            )
        if isinstance(total, complex):  # what Python makes of (-1.0) ** 0.5
            raise Undefined("the equations are not real")
        if not finite:
            raise Undefined("the equations are not finite")
        return value

    def solve(self, *, tolerance: float = 1e-9) -> tuple[Problem, Solution]:
        """The problem with its start moved onto a solution at the same parameters.

        Raises
        ------
        NotConverged
            If Newton's iteration from the start finds no solution; says both residuals, and
            carries that of the start, the number of iterations and the problem where they ended.
        """
        curve = Curve(self, ())
        before = float(abs(curve.equations(self.x)).max())
        try:
            near = approach(curve.equations, curve.jacobian, self.x, curve.metric)
            z = self.x if near is None else near
            found = newton(curve.equations, curve.jacobian, z, tolerance=tolerance, most=30)
        except Undefined as error:
            raise NotConverged(
                f"the start {self.shown()} is no solution (residual {before:.3g}) and Newton's "
                f"iteration from it leaves the domain: {error}",
                residual=before,
            ) from error
        small = 1e-6 * (1 + float(abs(found.z).max())) * curve.row_sizes(found.z)
        if not found.converged or (abs(curve.equations(found.z)) > small).any():
            raise NotConverged(
                f"the start {self.shown()} is no solution: residual {before:.3g}, and "
                f"{found.residual:.3g} after {found.iterations} Newton iterations; "
                "start closer to a solution or at other parameters",
                residual=before,
                iterations=found.iterations,
                last=self._started(found.z) if np.isfinite(found.z).all() else None,
            )
        return self._started(found.z), found

    def _started(self, x: Array) -> Problem:
        """The same problem with its start at x."""
        start = {
            name: (float(x[at]) if isinstance(at, int) else x[at])
            for name, at in self.slots.items()
        }
        return replace(self, start=start)

    def __repr__(self) -> str:
        events = f"; events {[event.kind for event in self.events]}" if self.events else ""
        return f"<Problem {self.label or f'of {self.x.size} equations'}: {self.shown()}{events}>"

    def shown(self) -> str:
        """The start and the parameters, as far as they are numbers."""
        values = {**self.start, **self.params}
        return ", ".join(
            f"{name}={float(value):.6g}" for name, value in values.items() if np.ndim(value) == 0
        )


def _real(name: str, value: Any) -> Array:
    try:
        found = np.asarray(value)
        if found.dtype.kind in "iufO":  # objects may be Fractions, or numbers of mpmath
            return found.astype(float)
    except (TypeError, ValueError, OverflowError):
        pass
    raise BadInput(
        f"{name!r} must be a number or a one-dimensional array of numbers, got {value!r}"
    )


def problem_in(given: object) -> Problem:
    """A problem, or that of what has one."""
    problem = given if isinstance(given, Problem) else getattr(given, "problem", None)
    if not isinstance(problem, Problem):
        raise BadInput(
            "a Problem was wanted, or what has one: a breather, an orbit, a point; got a "
            f"{type(given).__name__}"
        )
    return problem


def _check_shape(what: str, given: Any, shape: tuple[int, ...]) -> None:
    if hasattr(given, "toarray"):
        raise BadInput(
            f"the {what} is sparse, a {type(given).__name__}; a dense array of shape {shape} was "
            "wanted: return its toarray()"
        )
    try:
        found = np.asarray(given, dtype=float).shape
    except (TypeError, ValueError) as error:
        raise BadInput(f"the {what} is {given!r}; an array of numbers was wanted") from error
    if found != shape:
        raise BadInput(f"the {what} has shape {found}; {shape} was wanted")


class Curve:
    """A problem with named parameters set free: H(z) with ``z = (x, free parameters)``.

    Attributes
    ----------
    varied : tuple of str
        The parameters that change along it: the free ones, and on a boundary the one that its
        locus determines, an unknown there.
    slots : dict
        Where each unknown and each free parameter lies in z.
    scales : ndarray
        Typical size of each entry of z.
    metric : ndarray or None
        Weights of the squared arclength, None where all are 1. An array unknown counts as its
        mean square, so that a refined mesh keeps its steps.
    rows : ndarray
        Size of the derivative of each equation along the latest piece of curve: what is small
        against it counts as zero.
    """

    def __init__(self, problem: Problem, free: tuple[str, ...]) -> None:
        for name in free:
            if not isinstance(name, str) or name not in problem.params:
                raise BadInput(
                    f"{name!r} is no parameter of this problem; it has {list(problem.params)}"
                )
        if problem.adjoined is not None:
            problem = problem.adjoined.freed(problem, free)
        self.problem = problem
        self.free = free
        self.varied = free if problem.adjoined is None else (*free, list(problem.start)[-1])
        self.size = problem.x.size
        self.fixed = {name: float(value) for name, value in problem.params.items()}
        self.start = np.concatenate([problem.x, [self.fixed[name] for name in free]])
        self.slots = {**problem.slots, **{name: self.size + i for i, name in enumerate(free)}}
        names = (*problem.start, *free)
        counts = [np.size(problem.start.get(name, 0.0)) for name in names]
        self.scales = np.repeat([float(problem.scales.get(name, 1.0)) for name in names], counts)
        weights = 1 / (np.repeat(counts, counts) * self.scales**2)
        self.metric = None if (weights == 1).all() else weights
        self._scheme: derivatives.Scheme | None = None
        self._recent: list[tuple[Array, Array]] = []
        self._spectra: list[tuple[Array, NDArray[np.complex128]]] = []

    def dual(self, tangent: Array) -> Array:
        """The row whose product with z is the inner product of the arclength."""
        return tangent if self.metric is None else tangent * self.metric

    def length(self, z: Array) -> float:
        return length(z, self.metric)

    def normalised(self, z: Array) -> Array:
        return z / length(z, self.metric)

    @cached_property
    def rows(self) -> Array:
        sizes = self.row_sizes(self.start)
        if sizes.size > 1 and sizes.min() > _VANISHED * sizes.max():
            return sizes
        # where curves cross a whole row, or the only one, may vanish: its size is seen aside
        z = self.start + _ASIDE * (1 + self.length(self.start)) * self.scales
        try:
            return np.maximum(sizes, self.row_sizes(z))
        except Undefined:
            return sizes

    def row_sizes(self, z: Array) -> Array:
        sizes = abs(self.jacobian(z) * self.scales).max(axis=1)
        sizes[sizes == 0] = 1.0
        return sizes

    def balanced(self, matrix: Array) -> Array:
        """A derivative (its first columns, in the order of z) in units of `scales` and `rows`."""
        return matrix * self.scales[: matrix.shape[1]] / self.rows[:, None]

    def rounding(self, z: Array) -> Array:
        """What rounding leaves of each equation at z."""
        return rounding(self.jacobian(z), z)

    def params(self, z: Array) -> dict[str, float]:
        """All parameters at z, the free ones taken from it."""
        values = self.fixed.copy()
        for i, name in enumerate(self.free):
            values[name] = float(z[self.size + i])
        return values

    def equations(self, z: Array) -> Array:
        return self.problem.evaluate(self.unknowns(z), self.params(z))

    def unknowns(self, z: Array) -> Array:
        """The first entries of z, a copy: equations that write to it do not move the point."""
        return z[: self.size].copy()

    def jacobian(self, z: Array) -> Array:
        """Derivative of `equations`, shape ``(n, n + len(free))``; not to be written to."""
        for known, matrix in self._recent:
            if known is z:
                return matrix
        try:
            matrix = self._jacobian(z)
        except OUT_OF_DOMAIN as error:
            raise Undefined(str(error)) from error
        self._recent = [(z, matrix), *self._recent[:2]]
        return matrix

    def spectrum(self, z: Array) -> NDArray[np.complex128]:
        """Eigenvalues of the derivative in the unknowns; not to be written to."""
        for known, values in self._spectra:
            if known is z:
                return values
        values = np.linalg.eigvals(self.jacobian(z)[:, : self.size]).astype(complex)
        self._spectra = [(z, values), *self._spectra[:2]]
        return values

    def _jacobian(self, z: Array) -> Array:
        problem, n = self.problem, self.size
        if problem.adjoined is not None:
            return problem.adjoined.whole(z[:n], self.params(z))[:, : z.size]
        matrix = np.empty((n, z.size))
        by_hand = 0
        if problem.jacobian is not None:
            params = self.params(z)
            matrix[:, :n] = problem.jacobian(self.unknowns(z), params)
            by_hand = n
            if problem.sensitivity is not None:
                for i, name in enumerate(self.free):
                    matrix[:, n + i] = problem.sensitivity(self.unknowns(z), params, name)
                by_hand = z.size
        if by_hand < z.size:
            matrix[:, by_hand:] = self._by_trying(z, range(by_hand, z.size))
        return matrix

    def in_unknowns(self, z: Array) -> Array:
        """The derivative in the unknowns alone, where none in parameters are wanted."""
        try:
            if self.problem.adjoined is not None:
                return self.jacobian(z)[:, : self.size]
            if self.problem.jacobian is None:
                return self._by_trying(z, range(self.size))
            return np.array(self.problem.jacobian(self.unknowns(z), self.params(z)))
        except OUT_OF_DOMAIN as error:
            raise Undefined(str(error)) from error

    def _by_trying(self, z: Array, columns: range) -> Array:
        """Columns of the derivative by the scheme that suits the residual, chosen anew where
        complex numbers are refused after all."""
        if self._scheme is derivatives.complex_steps:
            try:
                return self._scheme(self._raw, z, columns)
            except OUT_OF_DOMAIN:
                raise
            except Exception:  # noqa: BLE001 - as where the scheme is chosen
                self._scheme = None
        if self._scheme is None:
            self._scheme = derivatives.choose(self._raw, z, self.scales)
        return self._scheme(self._raw, z, columns)

    def _raw(self, z: Array) -> Array:
        """The residual without checks, at a possibly complex z."""
        values: dict[str, Any] = dict(self.fixed)
        values.update(zip(self.free, z[self.size :], strict=True))
        value = np.array(self.problem.residual(self.unknowns(z), values), ndmin=1)
        if value.dtype.kind == "c" and z.dtype.kind != "c":
            raise Undefined("the equations are not real")
        return value

    def check(self) -> None:
        """Refuse wrong shapes and wrong derivatives before anything is built on them."""
        try:
            value = self.equations(self.start)
        except Undefined as error:
            raise BadInput(
                f"the equations have no value at the start {self.problem.shown()}: {error}"
            ) from error
        if value.dtype == bool:
            raise BadInput(f"the residual is {value!r}; an array of numbers was wanted")
        self._check_shapes()
        wrong = self.misfit(self.start)
        if wrong:
            raise BadInput(wrong)

    def _check_shapes(self) -> None:
        problem, z, n = self.problem, self.start, self.size
        if problem.jacobian is not None:
            given = problem.jacobian(self.unknowns(z), self.params(z))
            _check_shape("Jacobian", given, (n, n))
        if problem.sensitivity is not None:
            for name in self.free:
                given = problem.sensitivity(self.unknowns(z), self.params(z), name)
                _check_shape("sensitivity", given, (n,))

    def misfit(self, z: Array) -> str:
        """What is wrong with derivatives that were given, seen at z: empty if nothing is."""
        problem = self.problem
        what = "the Jacobian that was given does not fit the residual"
        if problem.adjoined is not None:
            wrong = problem.adjoined.base.misfit(
                problem.adjoined.split(z[: self.size], self.params(z))[0]
            )
            if wrong or problem.adjoined.locus.derivative is None:
                return wrong
            what = "the derivative of the locus does not fit its conditions"
        elif problem.jacobian is None and problem.sensitivity is None:
            return ""
        given = self.jacobian(z)
        # one direction through all entries tells whether any is wrong
        direction = np.maximum(self.scales, abs(z)) * np.cos(np.arange(z.size))
        wanted, doubt, _ = derivatives.estimate(
            lambda t: self._raw(z + t[0] * direction), np.zeros(1), np.ones(1)
        )
        if derivatives.misfit((given @ direction)[:, None], wanted, doubt) is None:
            return ""
        wanted, doubt, _ = derivatives.estimate(self._raw, z, self.scales)
        entry = derivatives.misfit(given, wanted, doubt)
        if entry is None:
            return ""
        return (
            f"{what}: its entry {entry} is {given[entry]:.8g}, differences give {wanted[entry]:.8g}"
        )

    def reconsider(self, *places: Array) -> str:
        """Choose anew how derivatives are taken, now for these places; what is wrong with given
        ones there."""
        self._scheme, self._recent, self._spectra = None, [], []
        for z in places:
            try:
                self.jacobian(z)
                wrong = self.misfit(z)
            except Undefined:
                continue
            if wrong:
                return wrong
        return ""
