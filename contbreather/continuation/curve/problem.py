"""What a user brings: equations F(x, p) = 0 with names for every unknown and every parameter."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import KW_ONLY, dataclass, field, replace
from functools import cached_property, partial
from operator import attrgetter
from typing import Any, ClassVar

import numpy as np

from ...checks import check_kind, kind_of, number, numbers, real
from ...errors import BadInput, NotConverged
from ...one_thread import one_thread
from ..algebra.newton import Array, Solution, Undefined, approach, newton, rounding
from ..algebra.sparse import Matrix, Pattern
from .curve import Curve, Params, Residual
from .ties import Ties


class Structure:
    """Structure of equations: what may be known of them besides their values, said by classes that
    are derived from `Problem`. The engine asks for all of this, and gets by with what stands here.
    """

    # ``(point) -> object``: what a point is to its user, as ``point.solution`` has it
    interpret: ClassVar[Callable[[Any], Any] | None] = None
    # ``(x, params, name) -> (n,) array``: the derivative in one parameter. Used, and checked,
    # together with `jacobian` only
    sensitivity: ClassVar[Callable[[Array, Params, str], Array] | None] = None
    # ``(x, params, names) -> (n, n + len(names)) array``: in place of `jacobian` and `sensitivity`
    derivatives: ClassVar[Callable[..., Matrix] | None] = None
    # ``(places, names) -> None``: solve at several ``(x, params)`` at once, whose derivatives are
    # asked for next
    prepare: ClassVar[Callable[..., None] | None] = None
    # ``(x, params) -> None``: forget what was tried beyond this place, from which a step failed
    retreat: ClassVar[Callable[..., None] | None] = None
    # whether tests of the class hold its derivatives to differences: they are not compared here
    tested: ClassVar[bool] = False
    # ``(names, params) -> (Walker, data) or None``: with these parameters free, the kernels of
    # `walk_kernel.walker` and what they ask for
    walker: ClassVar[Callable[..., Any] | None] = None
    # ``(x, params) -> array``: of equations that are dear, the residual as exact as the first
    # iteration of a step needs it
    roughly: ClassVar[Callable[[Array, Params], Array] | None] = None
    # whether columns of a branch are made of solutions that the walk has come by anyway
    keeps_solutions: ClassVar[bool] = False
    # ``(matrix, mu) -> (n, n) array``: of equations that say how a perturbation comes back after a
    # turn, the derivative whose null vectors are those that have grown by mu; affine in mu
    closing: ClassVar[Callable[[Matrix, complex], Matrix] | None] = None
    # ``(point) -> (values, error)``, or with a relative error besides: of maps and cycles the
    # multipliers but for a trivial one, and what rounding may leave in each
    multipliers: ClassVar[Any] = None
    # and which unknowns a perturbation moves: not those of a mesh, which may stay where it is
    perturbed: ClassVar[Any] = None
    # ``(point, ahead) -> problem or None``: the same in the same unknowns, set up anew at a point,
    # where its own start says too little of the next one, or that is None
    renewed: ClassVar[Callable[[Any, Any], Any] | None] = None
    # ``(x, params, names) -> (curve, z)``: the curve of the shorter problem that this one extends
    # by a defining system, as on a boundary, and the point on it
    beneath: ClassVar[Callable[..., tuple[Any, Array]] | None] = None

    # columns that show a solution, and those that tell it from its mirror image: of these, before
    # any unknown, a picture takes the first that all its branches have
    shown: ClassVar[Any] = ()
    parting: ClassVar[tuple[str, ...]] = ()

    @property
    def internals(self) -> frozenset[str]:
        """Unknowns that say nothing by themselves, as the collocation of a cycle, its mesh and null
        vectors: tables are without them, and no sentence suggests them."""
        return frozenset()

    @property
    def serialised(self) -> Mapping[str, Any] | None:
        """Serialised form, of which files make the equations again: their ``kind``, entered by
        `contbreather.storage.serialise.serialised`, and the values that its reader takes by name,
        besides ``start`` and ``params``. None where that cannot be said."""
        return None

    def images(self, x: Array, params: Params) -> tuple[Array, ...]:
        """Solutions that a symmetry of the equations makes of one, its mirror image or the
        other phases of a cycle."""
        return ()

    @property
    def totals(self) -> Mapping[str, str]:
        """Recorded names that are the sum of an array of unknowns, which may have a window."""
        return {}

    def phases(self, x: Array, params: Params) -> tuple[Array, ...]:
        """Other unknowns of the same solution, roughly, as of a cycle from a later iterate, or
        period of its forcing, on: a curve is closed there, too."""
        return ()

    def modulo(self, x: Array, params: Params) -> Mapping[str, Any]:
        """Periods of unknowns that are angles, by which they may move at x, of an array for each
        entry, 0 for those that are none: curves close, and solutions are the same, modulo that."""
        return {}

    def simpler(self, point: Any) -> Any:
        """Smaller problem that has a solution too, as its start: of a fixed point among the cycles
        of period 2 that of fixed points."""
        return None

    def invariants(self, point: Any) -> Array | None:
        """Numbers that a solution has however it is written, as the period and the extremes of a
        cycle, whose mesh and first flow are a choice; None where unknowns alone are compared."""
        return None

    def lift(self, kind: str) -> Callable[[Any], Any] | None:
        """Maker of the `SwitchingProblem` of a point of this kind, which has the curves that leave
        it: `switch` follows them. None where there are none."""
        return None

    def finer(self, point: Any, along: Any, crosses: bool) -> tuple[Any, Any] | None:
        """Refine the problem at a point that is `unresolved`: from its present start, where another
        curve may cross, in more unknowns, and a direction in these. Its branch is walked anew."""
        return None

    def unresolved(self, point: Any, on: str = "") -> str:
        """Say what these unknowns do not resolve of a solution, `on` the boundary of a kind: empty
        if they do. The first such point of a walk that gets no finer problem is among the doubtful
        ones of its branch."""
        return ""

    def ends_near(self, point: Any) -> str:
        """Say what is near where a walk ends as no step can be made; empty if nothing is known."""
        return ""

    def said_at_end(self, point: Any) -> str:
        """Say what happens at an event that ends a walk; empty if its kind tells all."""
        return ""

    def sized(self, sizes: Mapping[str, int]) -> Any:
        """Refine the problem from its present start as `finer` does, to unknowns of these sizes as
        far as that leads there: a file has points of a branch that was walked anew."""
        return self

    @property
    def rounds(self) -> int | None:
        """How many times it goes around what it is an orbit of, if it is one; `over` sets that."""
        return None

    def over(self, rounds: int) -> Any:
        """Write the same orbit as one that goes around so often, as of a file beyond PD."""
        return self

    @property
    def freed_in_turn(self) -> tuple[str, ...]:
        """Parameters that may be free in place of one of these, as the energy of a family of orbits
        in place of its period: sentences name them, too."""
        return ()

    @property
    def of_arms(self) -> tuple[str, ...]:
        """Unknowns that curves which leave its points have and it has not: in a diagram they may
        have a window."""
        return ()

    def with_parameters(self, names: tuple[str, ...]) -> Any:
        """Add parameters that the problem lacks, from its present start, as far as it can have
        them: `trace` and `boundary` ask for what is to be free."""
        return self


@dataclass(frozen=True, eq=False, repr=False)
class Problem(Structure):
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
    jacobian : callable or pattern, optional
        ``jacobian(x, params) -> (n, n) array``, the derivative in `x`, dense or from scipy.sparse.
        Or which of its entries may differ from zero, as an array, dense or from scipy.sparse: large
        problems are then differentiated with as few residuals as that allows, and solved as with a
        sparse Jacobian. Checked once against differences. Without it, complex steps are
        used where they hold, differences elsewhere.
    events : tuple of Event, optional
        What a walk looks for by default.
    record : dict, optional
        Name and function of a `Point` for each derived number to keep along a branch.
    domain : dict, optional
        ``{name: (low, high)}``, bounds of unknowns (of the norm of an array) or parameters beyond
        which there are no solutions.
    scales : dict, optional
        Typical size of an unknown (of an array one, or one for each entry) or parameter where that
        is far from 1: arclength, tolerance and differences are measured in it.
    label : str, optional
        Shown in tables.

    Notes
    -----
    What else there may be to know of equations is said by methods of a class derived from this
    one, listed in `contbreather.continuation.curve.problem.Structure`: what a point is to its user,
    as ``point.solution`` has it, is ``interpret(point)``, and angles repeat by
    ``modulo(x, params)``, for instance.

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

    # Any stands for what is built on problems: events, points, seeds
    residual: Residual
    start: Mapping[str, Any]
    params: Params
    _: KW_ONLY
    jacobian: Callable[[Array, Params], Matrix] | Any = None
    events: tuple[Any, ...] = ()
    record: Mapping[str, Callable[[Any], float]] = field(default_factory=dict)
    domain: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    scales: Mapping[str, Any] = field(default_factory=dict)
    label: str = ""

    def __post_init__(self) -> None:
        for what in ("residual", "jacobian"):
            plain = getattr(getattr(self, what), "py_func", None)  # of what numba.njit decorated:
            if plain is not None:  # parameters are a dict here
                object.__setattr__(self, what, plain)
        for what in ("start", "params", "scales", "domain", "record"):
            if not isinstance(values := getattr(self, what), Mapping):
                raise BadInput(f"{what} must be a dict of names and values, got {values!r}")
        form = self.serialised
        known = isinstance(form, Mapping) and isinstance(form.get("kind"), str)
        if form is not None and not known:  # refused here, not when a file is loaded
            raise BadInput(
                f"serialised = {form!r}: a dict with a 'kind' and the values that its reader takes "
                "was expected."
            )
        if not callable(self.residual):
            raise BadInput(f"residual must be a function, got {self.residual!r}")
        if not self.start:
            raise BadInput("a problem needs at least one unknown: start is empty")
        if clash := set(self.start) & set(self.params):
            raise BadInput(
                f"{sorted(clash)} are named both as unknowns and as parameters: give the "
                "parameters, those of a forcing formula for instance, other names"
            )
        for name, value in (*self.start.items(), *self.params.items()):
            if not (array := numbers(name, value)).size:
                raise BadInput(f"{name!r} is empty; at least one number was expected")
            if array.ndim > (name in self.start):
                raise BadInput(f"{name!r} has shape {array.shape}; a number was expected")
        taken = sorted({"arclength", "residual"} & {*self.start, *self.params, *self.record})
        if taken:
            raise BadInput(f"rename {taken} in the problem: every branch has columns of that name")
        if hidden := sorted({*self.record} & {*self.params}):
            raise BadInput(
                f"{hidden} are columns of this problem: give the parameters, those of a forcing "
                "formula for instance, or what is recorded, other names"
            )
        for name, function in self.record.items():
            if not callable(function):
                raise BadInput(f"record[{name!r}] must be a function of a point, got {function!r}")
        self.check_names((*self.scales, *self.domain))
        for name, size in self.scales.items():
            if not all(0 < real(part) < math.inf for part in np.ravel(size)):
                raise BadInput(f"the scale of {name!r} must be finite and positive, got {size}")
            entries = np.size({**self.params, **self.start}[name])
            if not np.size(size) or entries % np.size(size):
                has = f"{np.size(size)} for {entries} entries"
                raise BadInput(f"of {name!r} one scale was expected, or one for each: got {has}")
        check_kind(self.label, str, "a label as text")
        listed = isinstance(self.events, tuple | list)
        if not (listed and all(hasattr(event, "kind") for event in self.events)):
            raise BadInput(f"events must be a list of them, got {self.events!r}")
        given = self.jacobian
        if not (given is None or callable(given) or isinstance(given, Pattern)):
            object.__setattr__(self, "jacobian", self._pattern(given))

    def _pattern(self, entries: Any) -> Pattern:
        """The pattern that was given, with what is made of it: it stays with the problem."""
        n = self.x.size
        if not (hasattr(entries, "shape") or isinstance(entries, list | tuple)):
            raise BadInput(
                f"jacobian must be a function, or a pattern of its entries; got {entries!r}"
            )
        shape = getattr(entries, "shape", None) or numbers("jacobian", entries).shape
        if shape != (n, n):
            raise BadInput(f"the sparsity pattern has shape {shape}; {(n, n)} was expected")
        return Pattern(entries)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the unknowns, then of the parameters."""
        return (*self.start, *self.params)

    @property
    def listed(self) -> list[str]:
        return [name for name in self.names if name not in self.internals]

    @cached_property
    def slots(self) -> dict[str, int | slice]:
        """Place of each unknown in `x`."""
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
        return np.hstack([*self.start.values()], dtype=float, casting="unsafe")

    def at(self, /, **values: Any) -> Problem:
        """Move the start, or the parameters, to other values."""
        self.check_names(values)
        for name in self.start.keys() & values.keys():
            if np.ndim(values[name]) != np.ndim(self.start[name]):
                wanted = "an array" if np.ndim(self.start[name]) else "a number"
                raise BadInput(
                    f"{name} = {values[name]!r}: {wanted} was expected, as it was before"
                )
        start = {name: values.get(name, value) for name, value in self.start.items()}
        params = {name: values.get(name, value) for name, value in self.params.items()}
        return replace(self, start=start, params=params)

    def having(self, *names: str) -> Problem:
        """The problem with these parameters among its own, as far as it can have them."""
        known = {*self.start, *self.params}
        absent = tuple(name for name in names if isinstance(name, str) and name not in known)
        return self.with_parameters(absent) if absent else self

    def tied(self, functions: Mapping[str, Callable[[Any], float]], **values: float) -> TiedProblem:
        """Make parameters functions of others: the same equations in other parameters.

        Parameters
        ----------
        functions : dict
            ``{name: function}`` of parameters of this problem; ``function(params)`` is its value at
            those of the new one. Derivatives follow by the chain rule.
        **values
            Parameters of the new problem besides those of this one that are not tied. A name that
            is tied may be among them: it means the new one then, in functions, too.

        Returns
        -------
        TiedProblem
            With the events and columns of this one, and what is no parameter any more as a column.

        Examples
        --------
        A circle whose radius is given by its area:

        >>> import math, numpy as np
        >>> circle = Problem(lambda x, p: np.array([x[0]**2 + p["mu"]**2 - p["r"]**2]),
        ...                  start={"x": 1.0}, params={"mu": 0.0, "r": 1.0})
        >>> by_area = circle.tied({"r": lambda p: (p["area"] / math.pi) ** 0.5}, area=4 * math.pi)
        >>> round(by_area.solve()[0].start["x"], 12), list(by_area.params)
        (2.0, ['mu', 'area'])
        """
        ties, params = Ties.checked(self, functions, values)
        gone = {n: partial(_of_point, f) for n, f in functions.items() if n not in params}
        return TiedProblem(
            ties.of(self.residual), self.start, params, events=self.events, label=self.label,
            record={**self.record, **gone}, ties=ties,
            domain={n: edges for n, edges in self.domain.items() if n not in functions},
            scales={n: size for n, size in self.scales.items() if n not in functions},
        )  # fmt: skip

    def domain_along(self, free: tuple[str, ...]) -> Mapping[str, tuple[float, float]]:
        """The domain of curves along which these parameters change."""
        return self.domain

    def check_names(self, names: Iterable[str]) -> None:
        for name in names:
            if name not in self.start and name not in self.params:
                raise BadInput(f"no {name!r} in this problem; it has {self.listed}")

    def normed(self, name: str) -> str | None:
        """The array unknown whose Euclidean norm a name stands for: u for ``norm(u)``."""
        inner = name[len("norm(") : -1]
        array = np.ndim(self.start.get(inner, 0.0)) > 0
        return inner if array and name == f"norm({inner})" else None

    @one_thread
    def solve(self, *, tolerance: float = 1e-9) -> tuple[Problem, Solution]:
        """The problem with its start moved onto a solution at the same parameters.

        Raises
        ------
        NotConverged
            If Newton's iteration from the start finds no solution; says both residuals, and
            carries that of the start, the number of iterations and the problem where they ended.
        """
        tolerance = number("tolerance", tolerance, 0.0, 1.0, "a relative size")
        curve = Curve(self, ())
        value = curve.equations(self.x)
        before = float(abs(value).max())
        try:
            approached = approach(curve, self.x)
            z = self.x if approached is None else approached
            curve.metric = np.ones(z.size)  # as exact whatever the scales, by which steps go
            solution = newton(curve, z, tolerance=tolerance, most=30)
        except Undefined as error:
            raise NotConverged(
                f"the start {self.start_text()} is not a solution (residual {before:.3g}) and "
                f"Newton's iteration from it leaves the domain: {error}",
                residual=before,
            ) from error
        # at a fold or a branch point Newton's iteration wanders off from the best there is
        if (
            not solution.converged
            and (abs(value) <= rounding(curve.jacobian(self.x), self.x)).all()
        ):
            return self, Solution(self.x, True, 0, before)
        # where the derivative is nearly singular corrections may be short far from a solution
        small = 1e-6 * (1 + float(abs(solution.z).max())) * curve.row_sizes(solution.z)
        if not solution.converged or (abs(curve.equations(solution.z)) > small).any():
            advice = (
                "start closer to a solution or at other parameters",
                curve.unlike_scales(self.x),
            )
            raise NotConverged(
                f"the start {self.start_text()} is not a solution: residual {before:.3g}, and "
                f"{solution.residual:.3g} after {solution.iterations} Newton iterations; "
                f"{'; '.join(filter(None, advice))}",
                residual=before,
                iterations=solution.iterations,
                last=self._started(solution.z) if np.isfinite(solution.z).all() else None,
            )
        return self._started(solution.z), solution

    def _started(self, x: Array) -> Problem:
        return self.at(
            **{n: float(x[i]) if isinstance(i, int) else x[i] for n, i in self.slots.items()}
        )

    def __repr__(self) -> str:
        kinds = [*dict.fromkeys(event.kind for event in self.events)]  # LP may have two tests
        events = f"; events {kinds}" if kinds else ""
        counted = "1 equation" if self.x.size == 1 else f"{self.x.size} equations"
        return f"<Problem {self.label or f'of {counted}'}: {self.start_text()}{events}>"

    @property
    def kinds(self) -> str:
        """Name its label and the kinds of its events, in a sentence that refuses another."""
        kinds = ", ".join(event.kind for event in self.events) or "no events"
        return f"{self.label}, {kinds}" if self.label else kinds

    def start_text(self) -> str:
        every = {**self.start, **self.params}
        shown = {name: every[name] for name in self.listed if np.ndim(every[name]) == 0}
        return ", ".join(f"{name}={float(value):.6g}" for name, value in shown.items())


def problem_in(owner: object) -> Problem:
    """A problem, or that of what has one."""
    problem = owner if isinstance(owner, Problem) else getattr(owner, "problem", None)
    if not isinstance(problem, Problem):
        raise BadInput(
            "a Problem was expected, or what has one: a breather, an orbit, a point; got "
            f"{kind_of(owner)}"
        )
    return problem


@dataclass(frozen=True, eq=False, repr=False)
class TiedProblem(Problem):
    """A problem whose parameters are functions of others, from `Problem.tied`."""

    ties: Ties = field(kw_only=True)
    base: ClassVar[Any] = property(attrgetter("ties.base"), doc="In its own parameters.")
    shown = property(attrgetter("base.shown"))
    parting = property(attrgetter("base.parting"))
    totals = property(attrgetter("base.totals"))

    def derivatives(self, x: Array, params: Params, free: tuple[str, ...]) -> Matrix:
        return self.ties.derivatives(self.start, x, params, free)

    @property
    def tested(self) -> bool:  # type: ignore[override]
        # what the base has no derivatives for is by differences anyhow
        return self.base.tested or self.base.jacobian is None

    @property
    def interpret(self) -> Callable[[Any], Any] | None:  # type: ignore[override]
        asked: Any = self.base.interpret

        def interpreted(point: Any) -> Any:
            curve, z, _ = self.ties.untied(self.start, point.x, point.params, point.curve.free)
            return asked(replace(point, curve=curve, z=z, tangent=None))

        return asked and interpreted

    def images(self, x: Array, params: Params) -> tuple[Array, ...]:
        return self.base.images(x, self.ties(params))

    def phases(self, x: Array, params: Params) -> tuple[Array, ...]:
        return self.base.phases(x, self.ties(params))

    def modulo(self, x: Array, params: Params) -> Mapping[str, Any]:
        return self.base.modulo(x, self.ties(params))


def _of_point(function: Callable[[Params], Any], point: Any) -> float:
    return float(function(point.params))
