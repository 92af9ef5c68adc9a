"""A branch from its group of variables: with its equations, where file or caller have them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
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
    from xarray import DataTree

Array = NDArray[Any]

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
    kept = _Kept(group)
    about, origin = kept.about, _origin(group, given)
    curve, settings, events = kept.attached(given, origin)
    points = kept.points(curve, events)
    if about["parent"]:
        points = points.put(0, replace(points[0], parent=origin))
    doubtful, began = group.children.get(DOUBTFUL), about["began"]
    return Branch(
        labelled(points),
        Stop[about["stop"]],
        Stop[began] if began else None,
        about["reason"],
        about["began_reason"],
        () if doubtful is None else tuple(_Kept(doubtful).points(curve, events)),
        about["image_of"],
        settings=settings,
        origin=origin,
    )


def _origin(group: DataTree, given: Problem | None) -> Point | None:
    """The point it was born from, which may be on a curve of other equations."""
    if ORIGIN not in group.children:
        return None
    kept = _Kept(group.children[ORIGIN])
    fits = given is not None and set(given.names) <= set(kept.here)
    curve, _, events = kept.attached(given if fits else None, None)
    (point,) = kept.points(curve, events)
    return replace(point, label=kept.about["point_label"])


class _Kept:
    """A group: what was said of it, and its columns."""

    def __init__(self, group: DataTree) -> None:
        self.about, self.data = about_in(group), group.to_dataset(inherit=False)
        names = (*self.about["unknowns"], *self.about["free"])
        rows = [self.values(name).reshape(self.data["arclength"].size, -1) for name in names]
        self.z = np.concatenate(rows, axis=1)

    def values(self, name: str) -> Array:
        """The numbers of a variable, complex ones put together again."""
        one = self.data[name]
        if one.dims and str(one.dims[-1]).endswith("complex"):
            return np.asarray(one.values[..., 0] + 1j * one.values[..., 1])
        truth = one.attrs.get("flag_meanings") == "false true"
        return np.asarray(one.values).astype(bool) if truth else np.asarray(one.values)

    @cached_property
    def here(self) -> dict[str, Any]:
        """Unknowns and parameters at the first point."""
        unknowns, parameters = self.about["unknowns"], self.about["parameters"]
        here = {name: _plain(self.values(name)[0]) for name in unknowns}
        return here | {name: float(self.values(name).flat[0]) for name in parameters}

    def attached(
        self, given: Problem | None, origin: Point | None
    ) -> tuple[Curve, Settings | None, tuple[Event, ...]]:
        """The curve of these points, how it was walked, and what can happen on it."""
        about, here, problem = self.about, self.here, given
        if problem is None:
            start, params = ({name: here[name] for name in names} for names in about["base"])
            problem = remade(about["equations"], start, params)
        if problem is None:
            return self._bare(), self._settings(()), ()
        if about["period"] is not None and isinstance(problem.residual, Iterate):
            # of the map that was given, another iterate
            problem = with_period(problem, about["period"])
        absent = [name for name in problem.names if name not in here]
        if absent:
            raise BadInput(f"the problem has {absent}, which the file has not: it has {list(here)}")
        problem = problem.at(**{name: here[name] for name in problem.names})
        known = (*problem.events, fold(), branch_point(), hopf())
        settings = self._settings(known)
        asked = settings or Settings()
        if about["boundary"]:
            own, events = self._boundary(problem, asked, known, origin)
        else:
            own, events = scope(problem, asked.events, inadmissible=asked.inadmissible)
        curve = self._curve(own)
        if list(own.start) != about["unknowns"] or set(own.names) != set(here):
            raise BadInput(f"the file has {list(here)}, the problem has {list(own.names)}")
        if not about["boundary"]:
            _check_fit(curve)
        return curve, settings, (*events, *known)

    def _boundary(
        self, problem: Problem, asked: Settings, known: Sequence[Event], origin: Point | None
    ) -> tuple[Problem, tuple[Event, ...]]:
        """The problem of a boundary: with the conditions that it had, those of its origin."""
        free, released = self.about["free"][0], self.about["unknowns"][-1]
        curve = Curve(problem, (released, free))
        _check_fit(curve)
        event = _event(self.about["boundary"], known)
        if event is None:
            kind = self.about["boundary"]["kind"]
            raise BadInput(f"this is a boundary of {kind}, which the problem has no event for")
        born = {} if origin is None else origin.values
        if set(problem.names) <= set(born):
            curve = Curve(problem.at(**{name: born[name] for name in problem.names}), curve.free)
        event = event.of(problem)
        near = Point(curve, curve.start)
        if origin is not None:
            near = replace(near, kind=origin.ground.kind, event=event)
        make = partial(
            boundary_problem,
            near,
            event,
            (free, released),
            inadmissible=asked.inadmissible,
        )
        longer = make(asked.events)
        return longer, (*longer.events, *make(known).events)

    def _bare(self) -> Curve:
        """A curve that has its names and numbers, but no equations."""
        about = self.about
        start, params = (
            {name: self.here[name] for name in about[which]} for which in ("unknowns", "parameters")
        )
        curve = self._curve(
            Problem(missing, start, params, interpret=missing, label=about["label"])
        )
        if about["boundary"]:
            curve.varied = (about["free"][0], about["unknowns"][-1])
        return curve

    def _curve(self, problem: Problem) -> Curve:
        """The curve of a problem, with the columns that the file has."""
        z, record = self.z, dict(problem.record)
        if problem.beneath is not None:
            size = problem.residual.n  # type: ignore[attr-defined]
            z = np.hstack([z[:, :size], z[:, -2:]])
        for name in self.about["recorded"]:
            own = problem.record.get(name, missing)
            known = Recorded(own, z, self.values(name))
            record[name] = Counting(known, known.rows) if isinstance(own, Counting) else known
        return Curve(replace(problem, record=record), tuple(self.about["free"]))

    def _settings(self, known: Sequence[Event]) -> Settings | None:
        """How the walk was asked for; of its events those that can be made again."""
        said = self.about["settings"]
        if said is None:
            return None
        asked = said["events"]
        if asked is not None:
            found = (_event(one, known) for one in asked)
            asked = tuple(event for event in found if event is not None)
        within = {name: (low, high) for name, (low, high) in said["within"].items()}
        return Settings(within, asked, Steps(**said["steps"]), said["inadmissible"])

    def points(self, curve: Curve, events: Sequence[Event]) -> Points:
        about, data = self.about, self.data
        tangent, codes = np.array(data["point_tangent"].values), data["point_kind"].values
        brackets = data["point_bracket"].values
        arclength, residual = (np.array(data[name].values) for name in ("arclength", "residual"))
        points = Points(curve, self.z, tangent, arclength, residual)
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


def _event(said: Mapping[str, Any], known: Iterable[Event]) -> Event | None:
    """An event that was written down: made again, or the one of its kind that is known."""
    if "ends" not in said:
        made: Event | None = remade(said)
        return made
    alike = next((event for event in known if event.kind == said["kind"]), None)
    return alike and replace(alike, ends=said["ends"])


def _happened(point: Point, events: Sequence[Event]) -> Event | None:
    """The event of a special point: of its kind and, if there are several, the one whose test is
    closest to zero; so where it has another name, as a vanishing impact among grazings."""
    alike = {id(event): event for event in events if event.kind == point.kind}
    if not alike and point.kind not in ("", "EP", "MX"):
        alike = {id(event): event for event in events if event.examine is not None}
    if len(alike) > 1:
        off = {key: abs(measure(event, point)) for key, event in alike.items()}
        return alike[min(off, key=lambda key: off[key] if off[key] >= 0.0 else math.inf)]
    return next(iter(alike.values()), None)


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


def _plain(value: Any) -> Any:
    """A number as Python's own, an array as it is."""
    return value.item() if isinstance(value, np.generic) else value
