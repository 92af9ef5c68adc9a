"""A branch from its group of variables: with its equations, where file or caller have them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import BadInput
from .boundary import boundary_problem
from .branch import Branch, Settings, Stop, labelled
from .curve import Curve
from .cycles import Iterate, with_period
from .equilibria import branch_point, fold, hopf
from .groups import DOUBTFUL, ORIGIN, about_in, from_json
from .newton import Undefined
from .point import Counting, Event, Point
from .points import Points
from .problem import Problem
from .recipes import remade
from .scope import scope
from .steps import Steps
from .trail import measure

if TYPE_CHECKING:
    from xarray import Dataset, DataTree

Array = NDArray[Any]
About = Mapping[str, Any]

_FITS = 1e-6  # relative residual at which points of a file solve the equations they are given


def restored(group: DataTree, given: Problem | None = None) -> Branch:
    """The branch of a group.

    Parameters
    ----------
    group : DataTree
    given : Problem, optional
        Its equations (of a boundary those of the original problem), in place of what is written.

    Raises
    ------
    BadInput
        If the equations have other names, or the points do not solve them.
    """
    about, data = about_in(group), group.to_dataset()
    origin = _origin(group, given)
    curve, settings, events = _attached(about, data, given, origin)
    points = _points(about, data, curve, events)
    if about["parent"]:
        points = points.put(0, replace(points[0], parent=origin))
    began = about["began"]
    return Branch(
        labelled(points),
        Stop[about["stop"]],
        Stop[began] if began else None,
        about["reason"],
        about["began_reason"],
        _beside(group, curve, events),
        about["image_of"],
        settings=settings,
        origin=origin,
    )


def _beside(group: DataTree, curve: Curve, events: Sequence[Event]) -> tuple[Point, ...]:
    """What failed its verification, on the same curve."""
    child = group.children.get(DOUBTFUL)
    if child is None:
        return ()
    data = child.to_dataset(inherit=False).rename_dims({DOUBTFUL: "point"})
    about = about_in(child)
    return tuple(_points(about, data, curve, events))


def _origin(group: DataTree, given: Problem | None) -> Point | None:
    """The point it was born from, which may be on a curve of other equations."""
    child = group.children.get(ORIGIN)
    if child is None:
        return None
    data, about = child.to_dataset(inherit=False), about_in(child)
    own = [str(name) for name in data.sizes if str(name).startswith(f"{ORIGIN}_")]
    data = data.rename_dims({name: name.removeprefix(f"{ORIGIN}_") for name in own})
    fits = given is not None and set(given.names) <= {*about["unknowns"], *about["parameters"]}
    curve, _, events = _attached(about, data, given if fits else None, None)
    (point,) = _points(about, data, curve, events)
    return replace(point, label=about["point_label"])


# --- equations ----------------------------------------------------------------------------------


def _attached(
    about: About, data: Dataset, given: Problem | None, origin: Point | None
) -> tuple[Curve, Settings | None, tuple[Event, ...]]:
    """The curve of these points, how it was walked, and what can happen on it."""
    here = {name: _plain(_values(data, name)[0]) for name in about["unknowns"]}
    here |= {name: float(_values(data, name).flat[0]) for name in about["parameters"]}
    problem = given
    if problem is None:
        start, params = ({name: here[name] for name in names} for names in about["base"])
        problem = remade(about["equations"], start, params)
    if problem is None:
        return _bare(about, data, here), _settings(about, ()), ()
    if about["period"] is not None and isinstance(problem.residual, Iterate):
        problem = with_period(
            problem, about["period"]
        )  # of the map that was given, another iterate
    absent = [name for name in problem.names if name not in here]
    if absent:
        raise BadInput(f"the problem has {absent}, which the file has not: it has {list(here)}")
    problem = problem.at(**{name: here[name] for name in problem.names})
    known = (*problem.events, fold(), branch_point(), hopf())
    settings = _settings(about, known)
    if about["boundary"] is None:
        asked, inadmissible = _asked(settings)
        own, events = scope(problem, asked, inadmissible=inadmissible)
        curve = Curve(_remembering(own, about, data), tuple(about["free"]))
        _check_names(curve, about, here)
        _check_fit(curve)
        return curve, settings, (*events, *known)
    longer, events = _of_boundary(about, problem, settings, known, origin)
    curve = Curve(_remembering(longer, about, data), tuple(about["free"]))
    _check_names(curve, about, here)
    return curve, settings, (*events, *known)


def _check_names(curve: Curve, about: About, here: dict[str, Any]) -> None:
    problem = curve.problem
    if list(problem.start) != about["unknowns"] or set(problem.names) != set(here):
        raise BadInput(f"the file has {list(here)}, the problem has {list(problem.names)}")


def _asked(settings: Settings | None) -> tuple[tuple[Event, ...] | None, bool]:
    return (None, False) if settings is None else (settings.events, settings.inadmissible)


def _of_boundary(
    about: About,
    problem: Problem,
    settings: Settings | None,
    known: Sequence[Event],
    origin: Point | None,
) -> tuple[Problem, tuple[Event, ...]]:
    """The problem of a boundary: with the conditions that it had, which are those of its origin."""
    free, released = about["free"][0], about["unknowns"][-1]
    curve = Curve(problem, (released, free))
    _check_fit(curve)
    event = _event(about["boundary"], known)
    if event is None:
        kind = about["boundary"]["kind"]
        raise BadInput(f"this is a boundary of {kind}, which the problem has no event for")
    born = {} if origin is None else origin.values
    if set(problem.names) <= set(born):
        curve = Curve(problem.at(**{name: born[name] for name in problem.names}), curve.free)
    here = Point(curve, curve.start)
    events, inadmissible = _asked(settings)
    longer, more = (
        boundary_problem(here, event.of(problem), (free, released), some, inadmissible=inadmissible)
        for some in (events, known)
    )
    return longer, (*longer.events, *more.events)


def _check_fit(curve: Curve) -> None:
    """Refuse equations that the first point does not solve."""
    try:
        off = float((abs(curve.equations(curve.start)) / curve.rows).max())
    except Undefined as error:
        raise BadInput(f"the points of the file lie outside this problem: {error}") from error
    if off > _FITS:
        raise BadInput(f"the points of the file do not solve this problem: residual {off:.2g}")


def missing(*_: Any) -> Any:
    """The equations of a branch that was loaded without them."""
    raise BadInput(
        "this branch was loaded without its equations; load(path, problem=...) attaches them"
    )


def _bare(about: About, data: Dataset, here: Mapping[str, Any]) -> Curve:
    """A curve that has its names and numbers, but no equations."""
    problem = Problem(
        missing,
        {name: here[name] for name in about["unknowns"]},
        {name: here[name] for name in about["parameters"]},
        interpret=missing,
        label=about["label"],
    )
    curve = Curve(_remembering(problem, about, data), tuple(about["free"]))
    if about["boundary"]:
        curve.varied = (about["free"][0], about["unknowns"][-1])
    return curve


def _settings(about: About, known: Sequence[Event]) -> Settings | None:
    """How the walk was asked for; of its events those that can be made again."""
    said = about["settings"]
    if said is None:
        return None
    asked = None
    if said["events"] is not None:
        found = (_event(one, known) for one in said["events"])
        asked = tuple(event for event in found if event is not None)
    within = {name: (low, high) for name, (low, high) in said["within"].items()}
    return Settings(within, asked, Steps(**said["steps"]), said["inadmissible"])


def _event(said: Mapping[str, Any], known: Iterable[Event]) -> Event | None:
    """An event that was written down: made again, or the one of its kind that is known."""
    if "ends" not in said:
        made: Event | None = remade(said)
        return made
    alike = next((event for event in known if event.kind == said["kind"]), None)
    return alike and replace(alike, ends=said["ends"])


def _happened(point: Point, events: Sequence[Event]) -> Event | None:
    """The event of a special point: of its kind and, if there are several, the one whose test is
    closest to zero."""
    alike = {id(event): event for event in events if event.kind == point.kind}
    if len(alike) > 1:
        return min(alike.values(), key=lambda event: abs(measure(event, point)))
    return next(iter(alike.values()), None)


# --- points -------------------------------------------------------------------------------------


def _points(about: About, data: Dataset, curve: Curve, events: Sequence[Event]) -> Points:
    z, tangent = _rows(about, data), np.array(data["point_tangent"].values)
    codes, brackets = data["point_kind"].values, data["point_bracket"].values
    arclength, residual = (np.array(data[name].values) for name in ("arclength", "residual"))
    points = Points(curve, z, tangent, arclength, residual)
    astray, bare = {*about["located"]}, np.isnan(tangent).any(axis=1)
    more = {*np.flatnonzero((codes != 0) | bare).tolist(), *map(int, about["detail"]), *astray}
    for i in sorted(more):
        said = about["detail"].get(str(i))
        point = replace(
            points[i],
            tangent=None if bare[i] else points[i].tangent,
            kind=about["kinds"][codes[i]],
            bracket=None if np.isnan(brackets[i][0]) else tuple(brackets[i].tolist()),
            located=i not in astray,
            detail=from_json(said) if said else {},
        )
        points.made[i] = replace(point, event=_happened(point, events))
    return replace(points)


def _rows(about: About, data: Dataset) -> Array:
    """All z."""
    count = data.sizes["point"]
    columns = [_values(data, name) for name in (*about["unknowns"], *about["free"])]
    return np.concatenate([column.reshape(count, -1) for column in columns], axis=1)


@dataclass(frozen=True, eq=False)
class Recorded:
    """A recorded column as it is in a file; at other points the function that it was."""

    function: Callable[[Point], Any]
    z: Array  # of the original problem, on boundaries too
    values: Array

    def __call__(self, point: Point) -> Any:
        i = self._known.get(point.z.tobytes())
        return self.function(point) if i is None else _plain(self.values[i])

    def rows(self, points: Points) -> Array | None:
        return self.values if np.array_equal(points.z, self.z) else None

    @cached_property
    def _known(self) -> dict[bytes, int]:
        return {row.tobytes(): i for i, row in enumerate(self.z)}


def _remembering(problem: Problem, about: About, data: Dataset) -> Problem:
    """The problem with the columns that the file has."""
    z = _rows(about, data)
    if problem.beneath is not None:
        size = problem.residual.n  # type: ignore[attr-defined]
        z = np.hstack([z[:, :size], z[:, -2:]])
    record: dict[str, Callable[[Point], Any]] = {}
    for name in about["recorded"]:
        own = problem.record.get(name, missing)
        record[name] = known = Recorded(own, z, _values(data, name))
        if isinstance(own, Counting):
            record[name] = Counting(known, known.rows)
    return replace(problem, record={**problem.record, **record})


def _values(data: Dataset, name: str) -> Array:
    """The numbers of a variable, complex ones put together again."""
    values = np.asarray(data[name].values)
    if data[name].dims[-1:] == ("complex",):
        return np.asarray(values[..., 0] + 1j * values[..., 1])
    return values.astype(bool) if data[name].attrs.get("flag_meanings") == "false true" else values


def _plain(value: Any) -> Any:
    """A number as Python's own, an array as it is."""
    return value.item() if isinstance(value, np.generic) else value
