"""A point of a curve, an event that may happen there, and where it does, as equations.

Three types in one file, for each speaks of the others.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import KW_ONLY, dataclass, field, fields, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ...checks import check_kind, flag, number
from ...errors import BadInput
from ...storage.serialise import serialised
from ...tables import HtmlRepr, Sheet
from ..algebra.newton import OUT_OF_DOMAIN, Array
from .curve import Curve
from .kinds import Look, look_of
from .problem import Problem


@dataclass(frozen=True, slots=True, eq=False)
class Point(HtmlRepr):
    """A solution on a curve: values by name, and what is special about it.

    Parameters
    ----------
    curve : Curve
        The problem and its free parameters.
    z : ndarray, shape (n + 1,)
        Unknowns, then the free parameter.
    tangent : ndarray, shape (n + 1,), optional
        Unit tangent in the direction of the walk, at points of one.
    arclength : float
        Distance from the start of the walk.
    residual : float
        Largest entry of the equations here; at a located event that of its locus too.
    kind, label : str
        ``"PF"`` and ``"PF1"`` at a special point, empty elsewhere.
    event : Event, optional
        What was found here; `boundary` continues it.
    bracket : tuple of float, optional
        Arclengths between which the event was seen.
    located : bool
        Whether location converged and verification agreed; False keeps the point but says so.
    parent : Point, optional
        Where an arm sets out: the point on the branch that it left.
    detail : dict
        What the location found besides: a null vector, an angle, a time, a reason.
    """

    curve: Curve
    z: Array
    tangent: Array | None = None
    arclength: float = 0.0
    residual: float = math.nan
    kind: str = ""
    label: str = ""
    event: Event | None = None
    bracket: tuple[float, float] | None = None
    located: bool = True
    parent: Point | None = None
    detail: Mapping[str, Any] = field(default_factory=dict)
    _base: Point | None = field(default=None, init=False, repr=False)

    def __post_init__(self) -> None:
        self.z.flags.writeable = False
        if self.tangent is not None:
            self.tangent.flags.writeable = False

    def __reduce__(self) -> tuple[Any, ...]:
        # anew, for arrays come out of a pickle as ones that can be written to
        return Point, tuple(getattr(self, entry.name) for entry in fields(self) if entry.init)

    def __getitem__(self, name: str) -> Any:
        """An unknown, a parameter, what was found here, a recorded number, in this order.

        What was found here is there by its full name too: ``point["a of BT"]`` is a coefficient
        of the normal form where ``point["a"]`` is a parameter of the problem.
        """
        if type(name) is not str:
            check_kind(name, str, "the name of a column")
        slots = self.curve.slots
        if name in slots:
            value = self.z[slots[name]]
            return float(value) if value.ndim == 0 else value
        problem = self.curve.problem
        if name in problem.params:
            return float(problem.params[name])
        if name in self.detail:
            return self.detail[name]
        if name in problem.record:
            return problem.record[name](self.base_point)
        if array := problem.normed(name):
            return float(np.linalg.norm(self[array]))
        bare = name.removesuffix(f" of {self.kind}")
        if bare != name and bare in self.detail:
            return self.detail[bare]
        raise BadInput(f"no {name!r} at this point; it has {[*problem.listed, *problem.record]}")

    def __contains__(self, name: object) -> bool:
        try:
            self[name]  # type: ignore[index]
        except BadInput:
            return False
        return True

    def _ipython_key_completions_(self) -> list[str]:
        return [*self.curve.problem.listed, *self.curve.problem.record, *self.detail]

    def table(self) -> Sheet:
        """Its numbers, and what was found here."""
        names = [*self.curve.problem.listed, *self.curve.problem.record]
        shown = [(name, self.table_value(name)) for name in names]
        numbers: list[Any] = [(name, value) for name, value in shown if np.ndim(value) == 0]
        numbers += [("arclength", self.arclength), ("residual", f"{self.residual:.1e}")]
        return Sheet.of(numbers + [(n, v) for n, v in self.named_detail.items() if np.isscalar(v)])

    @property
    def named_detail(self) -> dict[str, Any]:
        """Details, under names that no unknown, parameter or column has."""
        taken = {*self.curve.problem.names, *self.curve.problem.record}
        return {n + f" of {self.kind}" * (n in taken): value for n, value in self.detail.items()}

    def table_value(self, name: str) -> Any:
        """A value as tables have it: None for no number, and for a count that is rounding."""
        value = self[name]
        whole = isinstance(value, int | np.integer) and name in self.curve.problem.record
        if np.ndim(value) == 0 and (value != value or (whole and self.on_verge)):
            return None
        return value

    @property
    def x(self) -> Array:
        """The unknowns as one array."""
        return self.z[: self.curve.size]

    @property
    def direction(self) -> Array:
        """The tangent, at a point of a walk."""
        if self.tangent is None:
            raise BadInput(f"{self!r} has no tangent: it is not on a walk")
        return self.tangent

    @property
    def on_verge(self) -> bool:
        """Say whether rounding decides a count of unstable directions here."""
        left = self.parent or self  # an arm sets out at the point that it left
        if left.event is None:  # without its equations: only ends are known to be clear
            return left.kind not in ("", "EP", "MX")
        return left.event.bifurcates

    @property
    def params(self) -> dict[str, float]:
        """Parameters by name, on a boundary also that which is among its unknowns."""
        params, curve = self.curve.params(self.z), self.curve
        if curve.problem.beneath is None:
            return params
        return {**params, curve.varied[-1]: self[curve.varied[-1]]}

    @property
    def values(self) -> dict[str, Any]:
        """Unknowns and parameters by name."""
        return {name: self[name] for name in self.curve.problem.names}

    @property
    def problem(self) -> Problem:
        """The problem with its start and parameters moved here."""
        return self.curve.problem.at(**self.values)

    @property
    def base_point(self) -> Point:
        """On a boundary: this point as one of the original problem, without tangent."""
        beneath = self.curve.problem.beneath
        if beneath is None:
            return self
        if self._base is None:  # once: all events ask for it in turn
            curve, z = beneath(self.x, self.curve.params(self.z), self.curve.free)
            object.__setattr__(self, "_base", replace(self, curve=curve, z=z, tangent=None))
        assert self._base is not None
        return self._base

    def renewed(self, ahead: Point | None = None) -> Point | None:
        """Put this point on the curve of a problem that is set up anew here, for the next one if
        that is given; None where it goes on as it is."""
        renew = self.curve.problem.renewed
        if renew is None or (problem := renew(self, ahead)) is None:
            return None
        curve = Curve(problem, self.curve.free)
        curve.asked = self.curve.asked
        point = replace(self, curve=curve, z=curve.start)
        if self.tangent is None:
            return point
        return replace(point, tangent=curve.tangent_at(point.z, self.tangent)[0])

    @property
    def solution(self) -> Any:
        """Meaning of this point to the user of its problem, an `Orbit` for instance."""
        base = self.base_point
        problem, interpret = base.curve.problem, base.curve.problem.interpret
        if interpret is None:
            said = f"point[{base.curve.problem.names[0]!r}] for instance"
            raise BadInput(f"this problem says no more of a point than its values, {said}")
        make, keep = lambda z: interpret(base), problem.keeps_solutions
        return base.curve.cached("solution", base.z, make, keep=keep)

    def __getattr__(self, name: str) -> Any:
        """Answer what the solution answers, too: ``point.state(sites=20)`` of an orbit.

        Called for names that a point does not have itself.
        """
        if name.startswith("_") or hasattr(type(self), name):
            raise AttributeError(f"{name!r} of this point has no value")
        try:
            solution = self.solution
        except BadInput as error:
            raise AttributeError(f"a point has no {name!r}, and {error}") from error
        try:
            return getattr(solution, name)
        except AttributeError as error:
            what = type(solution).__name__
            raise AttributeError(f"neither a point nor its {what} has {name!r}") from error

    def jacobian(self) -> Array:
        """Derivative of the equations, shape ``(n, n + 1)``: unknowns, then the free parameter."""
        return self.curve.jacobian(self.z).copy()

    @property
    def title(self) -> str:
        """The label, and of several levels the one it is on."""
        return f"{self.label} ({self.detail['level']})" if "level" in self.detail else self.label

    def __repr__(self) -> str:
        shown = {name: self[name] for name in self.curve.problem.listed if np.ndim(self[name]) == 0}
        values = ", ".join(f"{name}={value:.10g}" for name, value in shown.items())
        if self.located:
            return f"Point({self.title + ': ' if self.label else ''}{values})"
        reason = f": {self.detail['reason']}" if "reason" in self.detail else ""
        return f"Point({self.label or self.kind}?: {values}; not located{reason})"


@dataclass(frozen=True)
class DefiningSystem:
    """Equations for where an event happens: `boundary` adds them to the problem's own.

    Parameters
    ----------
    extra : dict
        Name and start value of each unknown that the conditions bring, in all m numbers.
    conditions : callable
        ``conditions(curve, z, extra) -> (m + 1,) array``; `curve` is the problem with its one or
        two freed parameters, ``z`` its unknowns and these parameters, ``extra`` an (m,) array.
    derivative : callable, optional
        ``(curve, z, extra) -> (m + 1, len(z) + m) array``; differences are taken without it.
    events : tuple of Event
        What can happen on the boundary itself, a cusp on a fold curve for instance.
    domain : dict, optional
        ``{name: (low, high)}``, bounds of its own unknowns, and of parameters where they are freed:
        where the conditions can be followed, as far as that is narrower than for the problem.
    meets : dict, optional
        ``{kind: events}`` to look for on the boundary in place of the meeting with an event of that
        kind, where that has names of its own: on a fold curve BT and ZH are those with HB.
    unfolding : callable, optional
        ``unfolding(curve, z, extra) -> (value, slope)``, shapes (n,) and (n, m): what is added to
        the problem's own equations, and its derivative in ``extra``. Needed where these alone are
        singular along the curve, as they are at branch points; it vanishes where the event happens.
    walker : callable, optional
        ``walker(problem, names, params) -> (Walker, data) or None``: the kernels for the problem's
        equations with these conditions (`walk_kernel.walker`), in z the unknowns of the problem,
        the extra ones, and the parameters of these names.
    """

    extra: Mapping[str, Any]
    conditions: Callable[[Curve, Array, Array], Array]
    derivative: Callable[[Curve, Array, Array], Array] | None = None
    events: tuple[Event, ...] = ()
    domain: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    meets: Mapping[str, tuple[Event, ...]] = field(default_factory=dict)
    unfolding: Callable[[Curve, Array, Array], tuple[Array, Array]] | None = None
    walker: Callable[..., Any] | None = None


MANY = 8  # points from which on arrays take less time than a loop

Value = float | int


class Detail(Mapping[str, Any]):
    """What is known of a special point; what is dear to know is found when it is asked for, by
    these names, of which there need not be all."""

    def __init__(
        self, known: Mapping[str, Any], names: Sequence[str] = (), make: Callable[[], Any] = dict
    ) -> None:
        self.known, self.names, self.make = known, names, make

    @cached_property
    def whole(self) -> dict[str, Any]:
        return {**self.make(), **self.known}

    def __getitem__(self, name: str) -> Any:
        return (self.whole if name in self.names else self.known)[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.whole)

    def __len__(self) -> int:
        return len(self.whole)

    def __repr__(self) -> str:
        return repr(self.whole)


Examined = str | Mapping[str, Any]
NOTHING: Examined = {"kind": ""}  # what is found where nothing happens
Many = tuple[Any, Any]  # arrays with a test and the count beside it, None without one


@dataclass(frozen=True, repr=False)
class Event:
    """A test function along a curve, and what its zero means.

    Parameters
    ----------
    kind : str
        The field's label: LP, BP, PF, NS, PD, GR, HB, UZ.
    test : callable or None
        ``test(point)`` returns a float with a zero at the event, or an int (or bool) that jumps
        there. It may return NaN where it has no meaning: nothing is looked for there. A `Singular`
        looks ahead as well. None where there is a `count` alone, of what all other events change:
        where it changes without one, the place is kept among the doubtful.
    count : callable, optional
        ``count(point)``, a number that changes by one where the test has a simple zero, of
        unstable eigenvalues for instance, or an array of which one does. Two zeros within a step,
        which leave no change of sign, are seen by changes of more than one in all. The imaginary
        part of a complex one counts zeros of the test that are no events.
    many : callable, optional
        ``many(points)``, arrays with the test and the count (None without one) at all points of a
        `Points`; or None where it cannot say these at once. It serves the speed of `values` alone,
        which loops over the points otherwise.
    locus : callable, optional
        ``locus(point) -> DefiningSystem`` at a point close to the event, its curve with both
        parameters free where a boundary sets out. Needed to trace the event in two parameters, and
        to locate one whose test jumps beyond what bisection gives.
    examine : callable, optional
        ``examine(point)`` returns a str, the reason why a located point is not what the kind says,
        empty if it is; or a dict of what else to know of it, coefficients of its normal form for
        instance. That is kept in ``point.detail``, but for "kind", a better name; an empty one says
        that nothing happens there.
    ends : {'', 'branch', 'domain'}
        Whether the branch ends at the event, and whether solutions mean something on the positive
        side of the test only: then a start beyond is refused.
    may_jump : bool or callable
        Whether nothing happens where the test changes its sign in a jump, or ``may_jump(point)``,
        which says so of one place; else that is doubtful.
    turns : bool
        Whether the test is the pace of the free parameter: nothing happens where that stays.
    form : dict, optional
        Its serialised form, as of a `Problem`, where its kind alone does not tell enough.
    record : dict
        Columns in place of those of the problem, by a rule of its own for who counts as unstable.
    about : str
        What these columns are about, shown with the label of the problem.

    Examples
    --------
    >>> Event("UZ", lambda point: point["x"] - 0.5).ends
    ''
    """

    kind: str
    test: Callable[[Point], float | int] | None
    _: KW_ONLY
    count: Callable[[Point], complex | Array] | None = None
    many: Callable[[Any], Many | None] | None = None
    locus: Callable[[Point], DefiningSystem] | None = None
    examine: Callable[[Point], Examined] | None = None
    ends: Literal["", "branch", "domain"] = ""
    may_jump: bool | Callable[[Point], bool] = False
    turns: bool = False
    form: Mapping[str, Any] | None = field(default=None, hash=False)
    record: Mapping[str, Callable[[Point], float]] = field(default_factory=dict, hash=False)
    about: str = ""

    def __post_init__(self) -> None:
        if self.ends not in ("", "branch", "domain"):
            raise BadInput(f"ends={self.ends!r}: '', 'branch' or 'domain' was expected")
        if not (isinstance(self.kind, str) and self.kind) or self.kind == "EP":
            raise BadInput(
                f"the kind of an event is {self.kind!r}: a label was expected, 'UZ' for instance, "
                "and not EP, which ends have"
            )
        functions = (self.test, self.count, self.many, self.locus, self.examine)
        if any(not (function is None or callable(function)) for function in functions):
            raise BadInput(f"event {self.kind}: its test and all else must be functions of a point")
        if self.test is None and self.count is None:
            raise BadInput(f"an event of kind {self.kind} needs a test, or at least a count")

    @property
    def serialised(self) -> Mapping[str, Any] | None:
        """Serialised form, None where files know the event by its kind."""
        return self.form

    @property
    def look(self) -> Look:
        """Name, marker and colour of its kind, and what can start from it."""
        return look_of(self.kind)

    @property
    def crosses(self) -> bool:
        """Say whether curves cross there: the equations are singular, and solved for otherwise."""
        return hasattr(self.locus, "solve")

    @property
    def bifurcates(self) -> bool:
        """Say whether rounding decides counts of unstable directions there."""
        return not (self.ends == "domain" or self.test is None or isinstance(self.test, Level))

    def columns(self, problem: Problem) -> Mapping[str, Callable[[Point], float]]:
        """Columns of a branch on which it is looked for, unless the problem has such names."""
        return {}

    def of(self, problem: Problem) -> Event:
        """The event as it is for one problem: itself, unless only its kind is known so far."""
        return self

    @property
    def matrix(self) -> Callable[[Point], Any] | None:
        """The matrix that is singular at the event, of a `Singular` test."""
        return getattr(self.test, "matrix", None)

    def value(self, point: Point) -> Value:
        """The test, or the count where there is none: an int where the event counts, a float where
        it has zeros."""
        look = self.test or self.count
        assert look is not None
        return self._number(look(point))

    def _number(self, value: Any) -> Value:
        if isinstance(value, int | np.integer | np.bool_):
            return int(value)
        try:
            alone = isinstance(value, float) or np.ndim(value) == 0
            return float(value if alone else "")  # older versions of numpy take arrays of one, too
        except (TypeError, ValueError) as error:
            raise BadInput(
                f"the test of {self.kind} gave {value!r}; one real number was expected, or NaN "
                "where it has no value"
            ) from error

    def value_or_nan(self, point: Point) -> Value:
        look = self.test or self.count
        assert look is not None
        try:
            value = look(point)
        except OUT_OF_DOMAIN:
            return math.nan
        return value if type(value) is float else self._number(value)

    def values(self, points: Sequence[Point]) -> tuple[list[Value], Any]:
        """Values at several points of a walk, and counts where they come with them, else NaN."""
        answer = None
        if self.many and len(points) >= MANY:
            with suppress(*OUT_OF_DOMAIN):
                answer = self.many(points)
        if not answer:
            return [*map(self.value_or_nan, points)], math.nan
        tests, counts = answer
        shapes = [np.shape(tests)] + ([] if counts is None else [np.shape(counts)])
        wanted = [(len(points),)] * (2 if self.count else 1)
        if shapes != wanted:
            raise BadInput(
                f"many of {self.kind} gave arrays of shapes {shapes}; {wanted} were expected, a "
                f"test {'and a count ' if self.count else ''}for each point"
            )
        return tests.tolist(), math.nan if counts is None else counts

    def __repr__(self) -> str:
        return f"<Event {self.kind}{', terminal' if self.ends else ''}>"


@dataclass(frozen=True)
class UnstableDimension:
    """A recorded count of what is unstable: not asked for where it bifurcates all along."""

    of: Callable[[Point], float]  # the number at one point
    # ``rows(points)``: an int array with the numbers of all points of a branch, -1 where one has to
    # be asked for by itself; or None, if all have
    rows: Callable[[Any], NDArray[np.int64] | None] | None = None

    def __call__(self, point: Point) -> float:
        return self.of(point)


@dataclass(frozen=True)
class Implied:
    """A recorded column that a symmetry settles: left out of tables of special points."""

    of: Callable[[Point], float]  # the number at one point

    def __call__(self, point: Point) -> float:
        return self.of(point)


@dataclass(frozen=True, repr=False)
class CodimensionTwo(Event):
    """An event on a boundary; `base` is that of the base problem that happens there too,
    so that a meeting can be the start of either curve."""

    base: Event = field(kw_only=True)

    @property
    def bifurcates(self) -> bool:
        return self.base.bifurcates


@dataclass(frozen=True)
class Level:
    """A test by a named value that passes a level."""

    name: str
    value: float

    def __call__(self, point: Point) -> float:
        above: float = point[self.name] - self.value
        return above

    def locus(self, point: Point) -> DefiningSystem:
        return DefiningSystem({}, self.conditions)

    def conditions(self, curve: Curve, z: Array, extra: Array) -> Array:
        return np.array([self(Point(curve, z.copy()))])

    def __str__(self) -> str:
        return f"{self.name} = {self.value:.12g}"


def user(name: str, value: float, *, terminal: bool = False) -> Event:
    """UZ: a named value (an unknown, a parameter, a recorded number) passes `value`.

    Traced in two parameters it is a contour line of that value. A located point says which of
    several levels it is on: ``point.detail["level"]`` is ``"mu = 0.3"``, and so do tables.

    Examples
    --------
    >>> user("mu", 0.3)
    <Event UZ>
    """

    if not isinstance(name, str):
        raise BadInput(f"user({name!r}, ...): the name of an unknown or a parameter was expected")
    value = number("value", value, -1e300, 1e300, "one level")
    level = Level(name, value)
    ends = flag("terminal", terminal)
    form = {"kind": "UZ", "name": name, "value": value, "terminal": ends}
    return Event("UZ", level, locus=level.locus, ends="branch" if ends else "", form=form)


serialised("UZ")(user)
