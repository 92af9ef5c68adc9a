"""A branch from a nested dict: with its equations, where the dict or the caller has them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...checks import brief
from ...errors import BadInput
from ...storage.netcdf import check_lengths
from ...storage.serialise import can_read, check_types, from_dict
from ..algebra.newton import Undefined
from ..bifurcations.equilibria import branch_point, fold, has_multipliers, hopf
from ..branches.boundary import boundary_problem
from ..curve.branch import Branch, Points, Stop, labelled
from ..curve.curve import Curve
from ..curve.point import Event, Point, UnstableDimension
from ..curve.problem import Problem
from ..curve.settings import Settings, Steps, active_events
from ..systems.defining_systems import ExtendedProblem

Array = NDArray[Any]
Content = Mapping[str, Any]
_FITS = 1e-6  # so much a point may leave of the equations

BRANCH = {  # what `branch_to_dict` writes besides columns and groups
    "label": str, "stop": str, "reason": str, "began": str | None, "began_reason": str,
    "unknowns": list[str], "parameters": list[str], "recorded": list[str], "free": list[str],
    "boundary": dict[str, Any] | None, "image_of": int | None,
    "kinds": list[str], "detail": dict[str, dict[str, Any]],
    "parent": bool, "point_label": str, "period": int | None,
    "equations": dict[str, Any] | None, "base": tuple[list[str], list[str]],
    "shown": list[str], "internals": list[str], "settings": dict[str, Any] | None,
}  # fmt: skip
SETTINGS = {
    "within": dict[str, tuple[float, float]], "events": list[dict[str, Any]] | None,
    "steps": dict[str, Any], "inadmissible": bool,
}  # fmt: skip


def result_from_dict(content: Content, problems: Sequence[Problem] = ()) -> Any:
    """Load a result from its dict; `problems` have the equations of its branches."""
    if content["kind"] == "branch":
        return branch_from_dict(content, problems)
    groups = content.get("groups", {}).items()
    inside = {name: result_from_dict(part, problems) for name, part in groups}
    return from_dict({**content, "groups": inside} if inside else content)


def branch_from_dict(content: Content, problems: Sequence[Problem] = ()) -> Branch:
    """Load a branch from its dict, with the equations of a problem, of a boundary the original one,
    in place of its own; if none fits, say what is wrong with the first."""
    origin, groups = None, content.get("groups", {})
    if "origin" in groups:  # it may be on a curve of other equations
        born = _Stored(groups["origin"])
        candidates = [problem for problem in problems if set(problem.names) <= set(born.here)]
        curve, _, events = born.fitted(candidates, None)
        origin = replace(born.points(curve, events)[0], label=groups["origin"]["point_label"])
    stored = _Stored(content)
    curve, settings, events = stored.fitted(problems, origin)
    points = stored.points(curve, events)
    if content["parent"]:
        points.made[0] = replace(points[0], parent=origin)
    doubtful, began = groups.get("doubtful"), content["began"]
    return Branch(
        labelled(points),
        Stop[content["stop"]],
        Stop[began] if began else None,
        content["reason"],
        content["began_reason"],
        () if doubtful is None else tuple(_Stored(doubtful).points(curve, events)),
        content["image_of"],
        settings=settings,
        origin=origin,
    )


class _Stored:
    """The points of a dict, to be put on a curve."""

    def __init__(self, content: Content) -> None:
        self.content, self.columns = content, content["columns"]
        check_types(content, BRANCH)
        check_types(content["settings"] or {}, SETTINGS)
        names = (*content["unknowns"], *content["free"])
        fixed = {*content["parameters"]} - {*names}  # these are single numbers
        every = (name for name in self.columns if name not in fixed)
        check_lengths(self.columns, ["arclength", *every], "points")
        rows = [self.columns[name].reshape(self.columns["arclength"].size, -1) for name in names]
        self.z = np.concatenate(rows, axis=1)
        # kinds and points that there are not, which nothing asks for before it is shown
        known = {*content["unknowns"], *content["parameters"]}
        codes, places = self.columns["point_kind"].tolist(), [*map(str, range(len(self.z)))]
        wrong = {
            "free": [name for name in content["free"] or [None] if name not in known],
            "point_kind": [code for code in codes if code not in range(len(content["kinds"]))],
            "detail": [i for i in content["detail"] if i not in places],
        }
        for name, values in wrong.items():
            if values:
                raise BadInput(
                    f"its contents are not as `save` writes them: {name} with {brief(values)}"
                )
        # unknowns and parameters at the first point
        self.here = {name: _python(self.columns[name][0]) for name in content["unknowns"]}
        self.here |= {name: float(self.columns[name].flat[0]) for name in content["parameters"]}

    def fitted(
        self, problems: Sequence[Problem], origin: Point | None
    ) -> tuple[Curve, Settings | None, tuple[Event, ...]]:
        """Attach the first problem that fits, if any is given; or that does so set up anew."""
        wrong: list[BadInput] = []
        for anew, problem in product((False, True), problems or (None,)):
            try:
                return self.attached(problem, origin, anew)
            except BadInput as error:
                wrong.append(error)
        raise wrong[0]

    def attached(
        self, problem: Problem | None, origin: Point | None, anew: bool
    ) -> tuple[Curve, Settings | None, tuple[Event, ...]]:
        """The curve of these points, how it was walked, and what can happen on it."""
        content, first = self.content, self.here
        if problem is None and can_read(content["equations"]):
            start, params = ({name: first[name] for name in names} for names in content["base"])
            problem = from_dict(content["equations"], start=start, params=params)
        if problem is None:
            names = content["unknowns"], content["parameters"]
            start, params = ({name: first[name] for name in some} for some in names)
            words = {"label": content["label"], "shown": content.get("shown", ())}
            internals = frozenset(content.get("internals", ()))
            curve = self._curve(_Bare(no_equations, start, params, internals=internals, **words))
            if content["boundary"]:
                curve.varied = (content["free"][0], content["unknowns"][-1])
            return curve, self._settings(()), ()
        if content["period"] is not None:  # another iterate of the map, or beyond PD
            problem = problem.over(content["period"])
        if turned := [name for name in problem.freed_in_turn if name in content["base"][1]]:
            problem = problem.having(*turned)  # as where it was traced
        absent = [name for name in problem.names if name not in first]
        if absent:
            raise BadInput(
                f"the problem has {absent}, which the file has not: it has {list(first)}; give the "
                f"one that this branch ({content['label']}) was begun with, and where the file has "
                "branches of several problems all of these: problem=(one, other)"
            )
        problem = problem.sized({name: np.size(first[name]) for name in problem.start})
        for name, value in problem.start.items():
            if np.shape(value) != np.shape(first[name]):
                raise BadInput(
                    f"{name!r} has shape {np.shape(first[name])} in the file, {np.shape(value)} in "
                    "the problem; give the one that the branch was begun with"
                )
        problem = problem.at(**{name: first[name] for name in problem.names})
        of_flow = () if has_multipliers(problem) else (hopf(),)
        candidates = (*problem.events, fold(), branch_point(), *of_flow)
        settings = self._settings(candidates)
        used = settings or Settings()
        if content["boundary"]:
            longer, events = self._boundary(problem, used, candidates, origin, anew)
        else:
            longer, events = active_events(problem, used.events, inadmissible=used.inadmissible)
        curve = self._curve(longer)
        curve.asked = used.events
        if list(longer.start) != content["unknowns"] or set(longer.names) != set(first):
            raise BadInput(f"the file has {list(first)}, the problem has {list(longer.names)}")
        if not content["boundary"]:
            _check_fit(curve, anew)
        return curve, settings, (*events, *candidates)

    def _boundary(
        self,
        problem: Problem,
        settings: Settings,
        candidates: tuple[Event, ...],
        origin: Point | None,
        anew: bool,
    ) -> tuple[Problem, tuple[Event, ...]]:
        """Make the problem of a boundary: with the conditions that it had, those of its origin."""
        free, released = self.content["free"][0], self.content["unknowns"][-1]
        curve = Curve(problem, (released, free))
        _check_fit(curve, anew)
        events = _events_from_dict(self.content["boundary"], candidates)
        if not events:
            kind = self.content["boundary"]["kind"]
            raise BadInput(f"this is a boundary of {kind}, which the problem has no event for")
        born = {} if origin is None else origin.values
        sizes = {n: np.size(value) for n, value in {**problem.start, **problem.params}.items()}
        # a mesh may have been refined since
        if sizes.items() <= {n: np.size(value) for n, value in born.items()}.items():
            curve = Curve(problem.at(**{n: born[n] for n in problem.names}), curve.free)
        for event in (event.of(problem) for event in events):
            base_point = Point(curve, curve.start)
            if origin is not None:
                base_point = replace(base_point, kind=origin.base_point.kind, event=event)
            if _off(curve, curve.start) > _FITS:
                base_point = base_point.renewed() or base_point
            how = (base_point, event, (free, released))
            make = partial(boundary_problem, *how, inadmissible=settings.inadmissible)
            longer = make(settings.events)
            if list(longer.start) == self.content["unknowns"]:  # of several LP of a family this one
                break
        return longer, (*longer.events, *make(candidates).events)

    def _curve(self, problem: Problem) -> Curve:
        """The curve of a problem, with the columns that were recorded."""
        z, record = self.z, dict(problem.record)
        if isinstance(problem, ExtendedProblem):
            size = problem.residual.n
            z = np.hstack([z[:, :size], z[:, -2:]])
        for name in self.content["recorded"]:
            function = problem.record.get(name, no_equations)
            column = _Recorded(function, z, self.columns[name])
            counts = isinstance(function, UnstableDimension)
            record[name] = UnstableDimension(column, column.rows) if counts else column
        return Curve(replace(problem, record=record), tuple(self.content["free"]))

    def _settings(self, candidates: Sequence[Event]) -> Settings | None:
        content = self.content["settings"]
        if content is None:
            return None
        events = content["events"]
        if events is not None:
            every = (_events_from_dict(event, candidates)[:1] for event in events)
            events = tuple(event for found in every for event in found)
        within = {name: (low, high) for name, (low, high) in content["within"].items()}
        return Settings(within, events, Steps(**content["steps"]), content["inadmissible"])

    def points(self, curve: Curve, events: Sequence[Event]) -> Points:
        content, columns = self.content, self.columns
        tangent, codes, brackets = (columns[f"point_{n}"] for n in ("tangent", "kind", "bracket"))
        points = Points(curve, self.z, tangent, columns["arclength"], columns["residual"])
        located, bare = columns["point_located"] != 0, np.isnan(tangent).any(axis=1)
        more = (codes != 0) | bare | ~located
        more[[*map(int, content["detail"])]] = True
        for i in np.flatnonzero(more).tolist():
            detail = content["detail"].get(str(i))
            point = replace(
                points[i],
                tangent=None if bare[i] else points[i].tangent,
                kind=content["kinds"][codes[i]],
                bracket=None if np.isnan(brackets[i][0]) else tuple(brackets[i].tolist()),
                located=bool(located[i]),
                detail=_detail_from_dict(detail) if detail else {},
            )
            points.made[i] = replace(point, event=_event_at(point, events))
        if points[0].renewed():
            _as_walked(points)
        return replace(points)


def _as_walked(points: Points) -> None:
    """Put points on the curves of a walk that set its problem up anew on the way."""
    left = [i for i, point in enumerate(points) if not _solves(point)]
    for way in (1, -1):
        for i in left[::way]:
            before, known = i - way, range(len(points))
            if before in left or before not in known:
                continue
            for begun in filter(None, (points[before], points[before].renewed())):
                if _solves(there := replace(points[i], curve=begun.curve)):
                    points.made[i] = there
                    left.remove(i)
                    break
    for i in left:  # of a piece that has no point of its start
        points.made[i] = points[i].renewed() or points[i]


def _solves(point: Point) -> bool:
    return _off(point.curve, point.z) <= _FITS and point.renewed(point) is None


def _detail_from_dict(content: Any) -> Any:
    if isinstance(content, list):
        return [_detail_from_dict(inner) for inner in content]
    if not isinstance(content, Mapping):
        return content
    ((kind, value),) = content.items()
    if kind == "dict":
        return {name: _detail_from_dict(inner) for name, inner in value.items()}
    if kind == "complex":
        return complex(*value)
    return np.array(value) if kind == "array" else np.array(value[0]) + 1j * np.array(value[1])


def _off(curve: Curve, z: Array) -> float:
    """Measure what a place leaves of the equations, relative to the rows of their derivative."""
    return float((abs(curve.equations(z)) / curve.row_scales).max())


def _check_fit(curve: Curve, anew: bool) -> None:
    try:
        if anew and (renewed := Point(curve, curve.start).renewed()):
            curve = renewed.curve
        off = _off(curve, curve.start)
    except Undefined as error:
        raise BadInput(f"the points of the file lie outside this problem: {error}") from error
    if off > _FITS:
        raise BadInput(
            f"the points of the file do not solve this problem: residual {off:.2g}; give the one "
            "that the branch was begun with, at the start that it had"
        )


def no_equations(*_: Any) -> Any:
    """The equations of a branch that was loaded without them."""
    raise BadInput(
        "this branch was loaded without its equations; load(path, problem=...) attaches them"
    )


@dataclass(frozen=True, eq=False, repr=False)
class _Bare(Problem):
    """The names and numbers of a branch alone."""

    shown: Sequence[str] = field(default=(), kw_only=True)  # type: ignore[misc]
    internals: frozenset[str] = field(default=frozenset(), kw_only=True)
    interpret = staticmethod(no_equations)


def _events_from_dict(content: Content, candidates: Iterable[Event]) -> list[Event]:
    """An event that was written down: made again, or the candidates of its kind."""
    if "ends" not in content:
        return [from_dict(content)] if can_read(content) else []
    alike = (event for event in candidates if event.kind == content["kind"])
    return [replace(event, ends=content["ends"]) for event in alike]


def _event_at(point: Point, events: Sequence[Event]) -> Event | None:
    """The event of a special point: of its kind, with the test closest to zero."""
    alike = {id(event): event for event in events if event.kind == point.kind}
    if not alike and point.kind not in ("", "EP", "MX"):
        alike = {id(event): event for event in events if event.examine is not None}
    if len(alike) > 1:
        off = {key: abs(event.value_or_nan(point)) for key, event in alike.items()}
        return alike[min(off, key=lambda key: off[key] if off[key] >= 0.0 else math.inf)]
    return next(iter(alike.values()), None)


@dataclass(frozen=True, eq=False)
class _Recorded:
    """A recorded column as it was stored; at other points the function that it was."""

    function: Callable[[Point], Any]
    z: Array  # of the original problem, on boundaries too
    values: Array

    def __call__(self, point: Point) -> Any:
        i = self._numbers.get(point.z.tobytes())
        return self.function(point) if i is None else _python(self.values[i])

    def rows(self, points: Points) -> Array | None:
        return self.values if np.array_equal(points.z, self.z) else None

    @cached_property
    def _numbers(self) -> dict[bytes, int]:
        return {row.tobytes(): i for i, row in enumerate(self.z)}


def _python(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value
