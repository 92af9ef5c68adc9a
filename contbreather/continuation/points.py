"""The points of a branch: rows of arrays, each made into a `Point` when it is asked for."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from operator import attrgetter
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from .curve import Curve
from .newton import Array
from .point import Point, UnstableDimension

_ROW = attrgetter("z", "tangent", "arclength", "residual")


@dataclass(frozen=True, eq=False, repr=False)
class Points(Sequence[Point]):
    """Neighbouring points of a walk.

    Attributes
    ----------
    curve : Curve
    z, tangent : ndarray, shape (len(self), n + 1)
    arclength, residual : ndarray, shape (len(self),)
    made : dict
        By number those of which there is more to know: what happens there, where it came from.
    """

    curve: Curve
    z: Array
    tangent: Array
    arclength: Array
    residual: Array
    made: dict[int, Point] = field(default_factory=dict)
    # what was asked for once is kept
    _points: dict[int, Point] = field(default_factory=dict, init=False)
    _columns: dict[str, NDArray[Any]] = field(default_factory=dict, init=False)

    rows = property(_ROW)

    def __getstate__(self) -> dict[str, Any]:
        """Without what was kept."""
        return {**self.__dict__, "_points": {}, "_columns": {}}

    @staticmethod
    def of(points: Iterable[Point]) -> Points:
        """Points one by one as rows."""
        if isinstance(points, Points):
            return points
        points = tuple(points)
        curve, none = points[0].curve, np.full(points[0].z.size, np.nan)
        z, tangents, arclength, residual = zip(*map(_ROW, points), strict=True)
        tangent = np.stack([none if row is None else row for row in tangents])
        marked = {i: p for i, p in enumerate(points) if p.curve is not curve or not p.ordinary}
        numbers = np.array(arclength), np.array(residual)
        return Points(curve, np.stack(z), tangent, *numbers, marked)

    @staticmethod
    def joined(pieces: Iterable[Iterable[Point]]) -> Points:
        """Several pieces as one."""
        parts, marked, start = list[Points](), dict[int, Point](), 0
        for kind, group in itertools.groupby(pieces, type):
            if kind is list:  # points that came one by one are rows together
                parts.append(Points.of(itertools.chain.from_iterable(group)))
            else:
                parts += map(Points.of, group)
        for part in parts:
            for i, point in part.made.items():
                marked[start + i] = point
            start += len(part)
        columns = zip(*map(_ROW, parts), strict=True)
        z, tangent, arclength, residual = map(np.concatenate, columns)
        return Points(parts[0].curve, z, tangent, arclength, residual, marked)

    @property
    def special(self) -> tuple[Point, ...]:
        """Those of a kind, in order."""
        return tuple(self.made[i] for i in sorted(self.made) if self.made[i].kind)

    def recorded(self, *names: str) -> dict[str, NDArray[Any]]:
        """Recorded columns; those of numbers are kept."""
        kept = self._columns
        made = self._recorded(*(name for name in names if name not in kept))
        kept.update((name, column) for name, column in made.items() if not column.dtype.hasobject)
        return {name: kept[name].copy() if name in kept else made[name] for name in names}

    def _recorded(self, *names: str) -> dict[str, NDArray[Any]]:
        """The same, asked point by point: what several of them look at is made once."""
        columns = {name: self._at_once(name) for name in names}
        slow = [name for name, column in columns.items() if column is None]
        cells = [[point[name] for name in slow] for point in self] if slow else ()
        values = dict(zip(slow, map(_column, zip(*cells, strict=True)), strict=True))
        return {
            name: values[name] if column is None else column for name, column in columns.items()
        }

    def _at_once(self, name: str) -> NDArray[Any] | None:
        """A column that can say many numbers at once, the rest asked for; None of others."""
        problem = self.curve.problem
        column = problem.record[name]
        if not (isinstance(column, UnstableDimension) and column.rows and problem.beneath is None):
            return None
        along = column.rows(self)
        if along is None:
            return None
        rest = np.union1d(np.flatnonzero(along < 0), np.array([*self.made], dtype=np.intp))
        if rest.size:
            answers = np.array([self[i][name] for i in rest.tolist()])
            along = along.astype(np.result_type(along, answers))
            along[rest] = answers
        return along

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Points):
            return NotImplemented
        same = (
            np.array_equal(*pair, equal_nan=True)
            for pair in zip(_ROW(self), _ROW(other), strict=True)
        )
        return self.made == other.made and all(same)

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        return f"<Points {len(self)} along {self.curve!r}>"

    def __len__(self) -> int:
        return len(self.arclength)

    @overload
    def __getitem__(self, key: int) -> Point: ...
    @overload
    def __getitem__(self, key: slice) -> Points: ...
    def __getitem__(self, key: int | slice) -> Point | Points:
        if isinstance(key, slice):
            chosen = range(len(self))[key]
            marked = {i: self.made[k] for i, k in enumerate(chosen) if k in self.made}
            z, tangent, arclength, residual = (row[key] for row in _ROW(self))
            piece = Points(self.curve, z, tangent, arclength, residual, marked)
            piece._columns.update((name, column[key]) for name, column in self._columns.items())
            return piece
        i = range(len(self))[key]
        if i in self.made:
            return self.made[i]
        if i not in self._points:
            numbers = float(self.arclength[i]), float(self.residual[i])
            self._points[i] = Point(self.curve, self.z[i], self.tangent[i], *numbers)
        return self._points[i]

    def put(self, i: int, point: Point) -> Points:
        """The same with another point in one place."""
        return replace(self, made={**self.made, i: point})

    def each(self, change: Callable[[Point], Point], **rows: Any) -> Points:
        """The same with all of which there is more to know changed, and other rows."""
        return replace(self, made={i: change(p) for i, p in self.made.items()}, **rows)


def _column(cells: Sequence[Any]) -> NDArray[Any]:
    """One value for each point: an array of objects where they are arrays of several shapes."""
    try:
        return np.array(cells)
    except ValueError:
        return np.fromiter(cells, dtype=object, count=len(cells))
