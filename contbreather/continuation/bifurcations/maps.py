"""Fixed points and cycles of anybody's map: LP, BP, PD and NS, their curves and resonances.

The equations are ``G(x) - x = 0`` with G the map, or its iterate for a cycle: its multipliers are
the eigenvalues of F_x + 1.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...checks import check_call, check_double, whole
from ...errors import BadInput
from ...tables import HtmlRepr, Sheet
from ..algebra.newton import Array
from ..algebra.sparse import is_sparse
from ..branches.switching import SwitchingProblem
from ..curve.curve import Params
from ..curve.point import Event, Examined, Point, UnstableDimension
from ..curve.problem import Problem
from ..curve.settings import all_of
from ..systems import defining_systems as systems
from ..systems.branch_points import RANK, crossing_event
from ..systems.normal_forms import closed
from ..systems.spectrum import OUTSIDE, ROUNDING, counted
from .equilibria import fold
from .multiplier_events import linked

Map = Callable[[Any, Any], Any]  # as `Residual` is


def FixedPoint(
    map_: Map,
    start: Mapping[str, Any],
    params: Params,
    *,
    period: int = 1,
    jacobian: Map | None = None,
    events: Iterable[Event] | None = None,
    record: Mapping[str, Callable[[Point], float]] | None = None,
    domain: Mapping[str, tuple[float, float]] | None = None,
    scales: Mapping[str, float] | None = None,
    label: str = "",
) -> Problem:
    """Fixed points of a map, or its cycles, as a problem: ``map^period(x) - x = 0``.

    Parameters
    ----------
    map_ : callable
        ``map_(x, params) -> array``, the next x; `x` is a one-dimensional array in the order of
        `start`. An angle is left unwrapped, with what it gains in a period taken off.
    start, params : dict
        As of a `Problem`: names and values, a start close to a solution.
    period : int
        Number of iterates after which the orbit closes.
    jacobian : callable, optional
        ``jacobian(x, params) -> (n, n) array``, the derivative of the map itself, dense.
    events : iterable of Event, optional
        LP, BP, PD and NS by default.
    record, domain, scales, label
        As of a `Problem`. The column ``unstable``, the number of multipliers outside the unit
        circle, is always there.

    Returns
    -------
    Problem
        To trace, to switch, to follow as boundaries. ``point.solution`` is a `MapCycle`. A located
        PD knows the coefficient ``detail["c"]`` of ``u -> -u + c u^3``, NS its ``detail["angle"]``
        and ``detail["d"]`` of ``w -> exp(i angle) w (1 + d |w|^2)``, for eigenvectors of length 1,
        and both their ``detail["criticality"]``: supercritical where what is born is stable on the
        centre manifold. Two real multipliers with product 1, a neutral saddle, are distinguished.
        Boundaries meet, under the names of the field, CP, R1, R2, R3, R4, LPPD (fold-flip), LPNS,
        PDNS, NSNS, GPD and CH.

    Raises
    ------
    BadInput
        If `period` is not a positive integer, or as `Problem`.

    Examples
    --------
    The first period doubling of the logistic map, and the cycle that is born there:

    >>> import contbreather as cb, numpy as np
    >>> logistic = FixedPoint(lambda x, p: p["r"] * x * (1 - x), {"x": 0.6}, {"r": 2.5})
    >>> point = cb.trace(logistic, "r", within={"r": (1.5, 4)}).first("PD")
    >>> round(point["r"], 12), point.detail["criticality"]
    (3.0, 'supercritical')
    """
    period = whole("period", period, 1)
    if not callable(map_) or not (jacobian is None or callable(jacobian)):
        raise BadInput(f"a map, and its jacobian, are functions; got {map_!r} and {jacobian!r}")
    check_call("the map", map_, "x")
    if not (record is None or isinstance(record, Mapping)):
        raise BadInput(f"record must be a dict of names and functions, got {record!r}")
    iterate = Iterate(map_, period, jacobian)
    unstable = UnstableDimension(attrgetter("solution.unstable"))
    return MapCycleProblem(
        iterate, start, params, jacobian=None if jacobian is None else iterate.jacobian,
        events=EVENTS if events is None else all_of(events) or (),
        record={**(record or {}), "unstable": unstable}, domain={} if domain is None else domain,
        scales={} if scales is None else scales, label=generic(period) if label == "" else label,
    )  # fmt: skip


# --- cycles as solutions ----------------------------------------------------------------------


def generic(period: int) -> str:
    return "fixed point" if period == 1 else f"cycle of period {period}"


@dataclass(frozen=True, eq=False)
class Iterate:
    """``G(x) - x`` with G the iterate of a map."""

    map: Map
    period: int
    derivative: Map | None = None

    def __call__(self, x: Array, params: Params) -> Array:
        image = x
        for _ in range(self.period):
            image = self.image(image, params)
        return image - x

    def image(self, x: Array, params: Params) -> Array:
        """One iterate; a map may write to what it is given, and return one array each time."""
        image = np.array(self.map(x.copy(), params), ndmin=1)
        if image.shape != x.shape or not np.issubdtype(image.dtype, np.number):
            raise BadInput(f"the map makes {image!r} of {x!r}; {x.size} numbers were expected")
        check_double("what the map makes", image)
        return image

    def phases(self, x: Array, params: Params) -> tuple[Array, ...]:
        """The points of the cycle, each a start of the same one."""
        points = [x]
        for _ in range(self.period - 1):
            points.append(self.image(points[-1], params))
        return tuple(points)

    def jacobian(self, x: Array, params: Params) -> Array:
        """By the chain rule from the derivative of the map."""
        assert self.derivative is not None
        product = np.eye(x.size)  # DG^m = DG(x_m-1) ... DG(x_1) DG(x_0)
        for place in self.phases(x, params):
            slopes = self.derivative(place.copy(), params)
            if is_sparse(slopes):
                raise BadInput("the Jacobian of a map is sparse; give its toarray() instead")
            if np.shape(slopes) != product.shape:
                raise BadInput(
                    f"the Jacobian of the map has shape {np.shape(slopes)}; {product.shape} was "
                    "expected"
                )
            product = np.asarray(slopes) @ product
        return product - np.eye(x.size)


@dataclass(frozen=True, repr=False)
class MapCycle(HtmlRepr):
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
        return int((abs(self.multipliers) > OUTSIDE).sum())

    def table(self) -> Sheet:
        rows = [(f"multiplier {i}", mu) for i, mu in enumerate(self.multipliers.tolist(), start=1)]
        return Sheet.of([("period", self.period), *rows, ("unstable", self.unstable)])

    def __repr__(self) -> str:
        return f"<{generic(self.period)} of a map, {counted(self.multipliers)}>"


def multiplier_matrix(point: Point) -> Array:
    n = point.curve.size
    # F = G - x: its derivative is that of G but for 1
    return np.asarray(point.jacobian()[:, :n] + np.eye(n))


def iterate_less(mu: float, point: Point) -> Array:
    """The derivative of the iterate, between unknowns in their scales, less mu."""
    return np.asarray(closed(point.curve, point.curve.jacobian(point.z), mu))


@dataclass(frozen=True, eq=False, repr=False)
class MapCycleProblem(Problem):
    """Fixed points or cycles of a map."""

    residual: Iterate

    @property
    def breaks(self) -> str:
        """The kind of event at which cycles of twice the period leave."""
        return "PD"

    @property
    def period(self) -> int:
        return self.residual.period

    rounds = period

    def tied(self, functions: Mapping[str, Any], **values: float) -> Any:
        """Tie the parameters of the map: its cycles double as before."""
        if type(self) is not MapCycleProblem:
            raise BadInput(f"a {self.label} is no map of your own: its parameters cannot be tied")
        new, iterate = super().tied(functions, **values), self.residual
        slopes = iterate.derivative and new.ties.of(iterate.derivative)
        iterate = replace(iterate, map=new.ties.of(iterate.map), derivative=slopes)
        same = {n: getattr(new, n) for n in ("params", "record", "domain", "scales")}
        return replace(self, residual=iterate, jacobian=slopes and iterate.jacobian, **same)

    def interpret(self, point: Point) -> Any:  # type: ignore[override]
        points = np.array(self.residual.phases(point.x, point.params))
        return MapCycle(points, multiplier_matrix(point), point.params)

    def over(self, rounds: int) -> Problem:
        iterate = replace(self.residual, period=rounds)
        slopes = iterate.jacobian if callable(self.jacobian) else self.jacobian
        label = generic(rounds) if self.label == generic(self.period) else self.label
        return replace(self, residual=iterate, jacobian=slopes, label=label)

    def phases(self, x: Array, params: Params) -> tuple[Array, ...]:
        return self.residual.phases(x, params)[1:]

    images = phases

    def simpler(self, point: Point) -> Problem | None:
        """The cycle in the smallest period it has, if that is not the one it is written in."""
        near = 1e-7 * (1 + float(np.linalg.norm(point.x)))
        for period, x in enumerate(self.residual.phases(point.x, point.params)[1:], start=1):
            if self.period % period == 0 and np.linalg.norm(x - point.x) <= near:
                return point.problem.over(period)
        return None

    def lift(self, kind: str) -> Callable[[Point], SwitchingProblem] | None:
        return _doubled if kind == self.breaks else None

    def multipliers(self, point: Point) -> tuple[NDArray[np.complex128], float]:
        matrix = iterate_less(0.0, point)
        rounding = ROUNDING * float(np.linalg.norm(matrix))
        return np.linalg.eigvals(matrix).astype(complex), rounding


# --- the events on a branch -------------------------------------------------------------------


def _examine_one(plain: Event, point: Point) -> Examined:
    """Verify a multiplier 1, too: beside large ones the derivative may only look singular."""
    sizes = np.linalg.svd(iterate_less(1.0, point), compute_uv=False)
    if sizes[-1] > RANK * max(1.0, sizes[0]):
        return f"no multiplier is 1: the nearest is {sizes[-1]:.2g} off"
    assert plain.examine is not None
    return plain.examine(point)


def _doubled(point: Point) -> SwitchingProblem:
    """The cycle of twice the period. Its two phases set out in opposite directions: one arm."""
    twice = point.problem.over(2 * point.curve.problem.period)
    return SwitchingProblem(twice, point.curve.free[0], both=False)


_FOLD = replace(fold(), examine=partial(_examine_one, fold()))
_CIRCLE = linked(_FOLD, systems.Singular(partial(iterate_less, -1.0)))
_PLAIN = crossing_event(_CIRCLE.meetings("BP"))
_BRANCH_POINT = replace(_PLAIN, examine=partial(_examine_one, _PLAIN))
EVENTS = (_CIRCLE.events["LP"], _BRANCH_POINT, _CIRCLE.events["PD"], _CIRCLE.events["NS"])
