"""Events as curves in two parameters: the same walk on a longer problem."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from ...checks import check_kind
from ...errors import BadInput
from ...one_thread import one_thread
from ...progress import Counter
from ...storage.serialise import from_dict, to_dict
from ..algebra.newton import Undefined
from ..curve.branch import Branch
from ..curve.curve import Curve
from ..curve.derivative_checks import wrong_entry
from ..curve.point import (
    CodimensionTwo,
    DefiningSystem,
    Event,
    Examined,
    Implied,
    Point,
    UnstableDimension,
)
from ..curve.problem import Problem
from ..curve.settings import (
    Settings,
    Steps,
    Within,
    active_events,
    having,
    titled,
    walls_are_lifted,
)
from ..systems.branch_points import Crossings, branch_point_test, branches_cross
from ..systems.defining_systems import Extended, ExtendedProblem, event_of, extended
from ..walk.checkpoint import Save
from ..walk.trace import walk_from


@one_thread
def boundary(
    point: Point,
    pair: tuple[str, str],
    *,
    within: Within | None = None,
    towards: str = "both",
    events: Iterable[Event] | None = None,
    steps: Steps | None = None,
    progress: bool | Counter | None = None,
    inadmissible: bool = False,
    save: Save = None,
) -> Branch:
    """Follow a special point as a curve in two parameters.

    Parameters
    ----------
    point : Point
        A special point of a branch (``branch.first("PF")``), or any point of another boundary. From
        where two kinds meet, the boundary of the other one is followed. Branch points (BP) are
        followed where a symmetry or an invariant subspace holds the branches together for other
        values of the parameters too, and refused where they come apart.
    pair : tuple of two str
        The two free parameters; `towards` refers to the first.
    within, towards, steps, progress, inadmissible, save
        As for `trace`, but for at most 500 steps in each direction unless `steps` allow more: a
        point of a boundary costs many times one of a branch, and without a window it has no end.
    events : iterable of Event, optional
        Events of the original problem to look for on the curve; all its own by default, apart
        from the kind that is traced. Those that were given to `trace` alone are not known here:
        give them again. They are labelled with both kinds, ``"PF-GR"``. With ``()`` cusps and the
        like are not looked for either.

    Returns
    -------
    Branch
        With the unknowns of the problem, those of the locus (a null vector, an angle, a time) and
        both parameters as columns. Counts, as ``unstable``, are NaN where the boundary is what
        changes them.

    Raises
    ------
    BadInput
        If the point is not special, its event cannot be traced, or `pair` is not two parameters.
    NotConverged
        Where branch points turn out to be no curve.

    Examples
    --------
    The folds of ``h + mu x - x^3 = 0`` lie on the cusp curve ``4 mu^3 = 27 h^2``:

    >>> import contbreather as cb, numpy as np
    >>> cusp = cb.Problem(lambda x, p: np.array([p["h"] + p["mu"] * x[0] - x[0] ** 3]),
    ...                   start={"x": 1.0}, params={"mu": 1.0, "h": 0.0})
    >>> fold = cb.trace(cusp, "h", within={"x": (-2, 2)}, events=[cb.fold()]).first("LP")
    >>> line = boundary(fold, ("mu", "h"), within={"mu": (-1, 2)})
    >>> bool(np.allclose(4 * line["mu"] ** 3, 27 * line["h"] ** 2))
    True
    """
    check_kind(point, Point, "a special point of a branch, branch.first('PF') for instance,")
    named_pair(pair)
    base_point, event = _having(point.base_point, _traceable(point), pair)
    settings = Settings.of(within, events, steps, inadmissible, Steps(most=500))
    longer = boundary_problem(base_point, event, pair, settings.events, inadmissible=inadmissible)
    return walk_from(
        longer, pair[0], replace(settings, events=None, inadmissible=False), towards, None,
        progress, save, name="boundary", whole=partial(replace, settings=settings, origin=point),
    )  # fmt: skip


def named_pair(pair: Any) -> tuple[str, str]:
    listed = isinstance(pair, tuple | list) and all(isinstance(name, str) for name in pair)
    if not listed or len(pair) != 2 or pair[0] == pair[1]:
        raise BadInput(
            f'a boundary needs two different parameters, ("a", "gamma") for instance, got {pair!r}'
        )
    return pair[0], pair[1]


@dataclass(frozen=True, eq=False, repr=False)
class BoundaryProblem(ExtendedProblem):
    """A problem with the defining system of one of its events, and what else was asked for."""

    asked: tuple[Event, ...] | None = field(kw_only=True)
    inadmissible: bool = field(kw_only=True)

    def with_parameters(self, names: tuple[str, ...]) -> Problem:
        """Free another parameter of the base problem in place of the first."""
        (free,), event = names, self.residual.event
        assert event is not None
        pair = free, self.residual.released
        base_point, event = _having(self._begin, event, pair)
        return self._anew(base_point, event, free) if free in base_point.problem.params else self

    def finer(self, point: Point, along: Any, crosses: bool) -> tuple[Problem, Any] | None:
        """Refine the base problem where this one starts, unless it sets out in a direction."""
        begin, event = self._begin, self.residual.event
        finer = along is None and begin.problem.finer(point.base_point, None, crosses)
        if not finer or event is None:
            return None
        curve = Curve(finer[0], begin.curve.free)
        return self._anew(Point(curve, curve.start), event, point.curve.free[0]), None

    def renewed(self, point: Point, ahead: Point | None) -> Problem | None:  # type: ignore[override]
        """Set the base problem up anew, with null vectors of its own."""
        begin = point.base_point.renewed(ahead and ahead.base_point)
        event = self.residual.event
        if begin is None or event is None:
            return None
        return self._anew(begin, event, point.curve.free[0])

    @property
    def _begin(self) -> Point:
        curve = Curve(self, ())
        return Point(curve, curve.start).base_point

    def _anew(self, base_point: Point, event: Event, free: str) -> Problem:
        pair, lifted = (free, self.residual.released), self.inadmissible
        return boundary_problem(base_point, event, pair, self.asked, inadmissible=lifted)


def boundary_problem(
    base_point: Point,
    event: Event,
    pair: tuple[str, str],
    events: tuple[Event, ...] | None = None,
    *,
    inadmissible: bool = False,
) -> Problem:
    """The problem whose curve in ``pair[0]`` is the boundary through a point, `pair[1]` being one
    of its unknowns."""
    base, active = active_events(base_point.problem, events, inadmissible=inadmissible)
    for name in pair:
        if name not in base.params:
            has = [*base.params, *base.freed_in_turn]
            raise BadInput(f"{name!r} is not a parameter here; it has {has}")
    if event.locus is None:
        raise BadInput(f"{event.kind} has no locus to trace in two parameters")
    curve, kind, found = Curve(base, (pair[1], pair[0])), event.kind, base_point.event
    if found and found.kind == kind:  # it may turn out to be another: PF for BP
        kind = base_point.kind or kind
    try:
        locus = event.locus(replace(base_point, curve=curve, z=curve.start, tangent=None))
    except Undefined as error:
        raise BadInput(f"{kind} cannot be traced from here: {error}") from error
    for name, (low, high) in locus.domain.items():
        value = base.params.get(name, low)
        end = min(max(value, low), high)
        if not math.isclose(value, end, rel_tol=1e-9):  # the end of another boundary is there
            raise BadInput(
                f"{name} = {value:g}: there {event.kind} cannot be traced, but up to {name} = "
                f"{end:g}; take a point there"
            )
    record = base.record
    if event.bifurcates:  # a multiplier passes all along: rounding would decide their counts
        record = {
            name: column if isinstance(column, Implied) else partial(_uncounted, column)
            for name, column in record.items()
        }
    met = [*locus.events]
    if events is not None and not events:  # only what the curve cannot be followed beyond
        met = [own for own in met if own.ends]
    if walls_are_lifted(base) and event.ends == "domain":  # what ends it is another wall
        met = [e for e in met if not (isinstance(e, CodimensionTwo) and e.base.ends == "domain")]
    for other in active:
        if other.kind != event.kind and other.test is not None:
            beside = locus.meets.get(other.kind, (codim_two(kind, other),))
            met += [e for e in beside if e not in met]
    make = partial(
        BoundaryProblem, events=tuple(met), record=record, label=titled(f"{kind} boundary", base),
        asked=events, inadmissible=inadmissible,
    )  # fmt: skip
    longer = extended(curve, locus, event, make)
    # those of this package are held to differences by its tests
    if base.derivatives is None and locus.derivative is not None:
        longer_curve = Curve(longer, (pair[0],))
        with contextlib.suppress(Undefined):
            if wrong := wrong_entry(longer_curve, longer_curve.start):
                why = f"the derivative of the locus does not fit its conditions: {wrong}"
                raise BadInput("; ".join(filter(None, (why, curve.unlike_scales(curve.start)))))
    return longer


def _uncounted(column: Callable[[Point], Any], point: Point) -> Any:
    value = math.nan if isinstance(column, UnstableDimension) else column(point)
    return math.nan if isinstance(value, int | np.integer) else value


def _traceable(point: Point) -> Event:
    """The event to trace from a point: what happened there, that of the base problem where two
    meet, and otherwise the one whose boundary the point lies on."""
    event = point.event
    if isinstance(event, CodimensionTwo):
        event = event.base
    if event is None or event.locus is None:
        event = event_of(point.curve.problem) or event
    if event is not None:
        return event
    why = (
        "is no bifurcation: nothing to trace as a boundary; give one of the other labelled points "
        "of the branch, branch.first('LP') for instance"
    )
    if point.kind not in ("", "EP", "MX"):
        why = "was loaded without its equations; load(path, problem=...) attaches them"
    raise BadInput(f"{point!r} {why}")


def _having(base_point: Point, event: Event, pair: tuple[str, str]) -> tuple[Point, Event]:
    """The point, and its event, in equations that have both parameters."""
    base = base_point.problem
    problem = having(base, *pair)
    if problem.residual is base_point.curve.problem.residual:
        return base_point, event
    here, there = ([e for e in of.events if e.kind == event.kind] for of in (base, problem))
    pairs = zip(here, there, strict=False)  # of several of its kind it is that in its place
    same = next((new for old, new in pairs if old is event), next(iter(there), event))
    event = (from_dict(to_dict(event.serialised)) if event.serialised else same).of(problem)
    problem, _ = active_events(problem, (event,))
    free = [name for name in base_point.curve.free if name in problem.params]
    curve = Curve(problem, tuple(free) or pair[1:])
    return replace(base_point, curve=curve, z=curve.start, tangent=None), event


def codim_two(kind: str, event: Event) -> CodimensionTwo:
    """An event of the original problem on the boundary of another, PF-GR: by the conditions of both
    at once; where branches cross, as a branch point of the longer problem."""
    name = f"{kind}-{event.kind}"
    if event.crosses:  # to look ahead costs as much as a step
        return CodimensionTwo(
            name, branch_point_test, locus=Crossings(), examine=_examine_crossing, base=event
        )
    beneath = _Beneath(kind, event)
    locus, examine = event.locus and beneath.locus, event.examine and beneath.examine
    return CodimensionTwo(
        name, beneath.test, locus=locus, examine=examine, ends=event.ends,
        may_jump=event.may_jump, base=event,
    )  # fmt: skip


@dataclass(frozen=True)
class _Beneath:
    """An event of the original problem, asked at points of the boundary of another kind."""

    kind: str
    event: Event

    def test(self, point: Point) -> float | int:
        return self.event.value(point.base_point)

    def locus(self, point: Point) -> DefiningSystem:
        together = point.curve.problem.residual
        assert self.event.locus is not None
        assert isinstance(together, Extended)
        return together.lifted(self.event.locus(point.base_point), f" of {self.event.kind}")

    def examine(self, point: Point) -> Examined:
        assert self.event.examine is not None
        suffix = f" of {self.event.kind}"
        detail = {name.removesuffix(suffix): value for name, value in point.detail.items()}
        verdict = self.event.examine(replace(point.base_point, detail=detail))
        if isinstance(verdict, str):
            return verdict
        # its normal form is that of a branch, what is said of it is not
        words = {name: value for name, value in verdict.items() if isinstance(value, str)}
        kind = words.get("kind")  # "" where nothing happens
        return {**words, "kind": f"{self.kind}-{kind}"} if kind else words


def _examine_crossing(point: Point) -> str:
    reason = "the boundary is singular here, as where two cross, but the branches it is on do not"
    return "" if branches_cross(point.base_point) else reason
