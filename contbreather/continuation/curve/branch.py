"""What a walk leaves behind: points, and branches of them."""

from __future__ import annotations

import enum
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from operator import attrgetter
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from ...checks import brief, check_kind
from ...columns import Columns
from ...errors import BadInput
from ...one_thread import one_thread
from ...tables import Column, HtmlRepr, Sheet
from ..algebra.newton import Array
from .curve import Curve
from .derivative_checks import advice
from .kinds import look_of
from .point import Implied, Point, UnstableDimension
from .problem import Problem
from .settings import Settings

_ROW = attrgetter("z", "tangent", "arclength", "residual")


@dataclass(frozen=True, eq=False, repr=False)
class Points(Sequence[Point]):
    """Neighbouring points of a walk."""

    curve: Curve
    z: Array  # a row for each, of n + 1 entries
    tangent: Array
    arclength: Array
    residual: Array
    # by number those of which there is more to know: what happens there, where it came from
    made: dict[int, Point] = field(default_factory=dict)
    # what was asked for once is kept
    _points: dict[int, Point] = field(default_factory=dict, init=False)
    _columns: dict[str, NDArray[Any]] = field(default_factory=dict, init=False)

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_points": {}, "_columns": {}}

    @staticmethod
    def of(points: Iterable[Point]) -> Points:
        """Points one by one as rows."""
        if isinstance(points, Points):
            return points
        points = tuple(points)
        curve, marked = points[0].curve, dict[int, Point]()
        z, tangents, arclength, residual = zip(*map(_ROW, points), strict=True)
        tangent = np.array([np.full(z[0].size, np.nan) if row is None else row for row in tangents])

        for i, p in enumerate(points):
            more = p.kind or p.label or p.detail or p.event or p.parent or p.bracket
            if more or not p.located or p.tangent is None or p.curve is not curve:
                marked[i] = p
        numbers = np.array(arclength), np.array(residual)
        piece = Points(curve, np.array(z), tangent, *numbers, marked)
        piece._points.update(enumerate(points))
        return piece

    @staticmethod
    def joined(pieces: Iterable[Iterable[Point]]) -> Points:
        parts, marked, start = [*map(Points.of, pieces)], dict[int, Point](), 0
        for part in parts:
            same = part.curve is parts[0].curve
            for i, point in part.made.items() if same else enumerate(part):
                marked[start + i] = point
            start += len(part)
        columns = zip(*map(_ROW, parts), strict=True)
        z, tangent, arclength, residual = map(np.concatenate, columns)
        return Points(parts[0].curve, z, tangent, arclength, residual, marked)

    @property
    def special(self) -> tuple[Point, ...]:
        return tuple(self.made[i] for i in sorted(self.made) if self.made[i].kind)

    def measured(self, sense: int, shift: float) -> Points:
        """Measure arclength from elsewhere on, and for -1 walk them the other way."""
        rows = self[::sense]
        return replace(
            rows,
            tangent=sense * rows.tangent,
            arclength=shift + sense * rows.arclength,
            made={i: _measured(p, sense, shift) for i, p in rows.made.items()},
        )

    @one_thread
    def recorded(self, *names: str) -> dict[str, NDArray[Any]]:
        """Recorded columns; those of numbers are kept. What has to be asked point by point is asked
        together: what several columns look at is made once."""
        kept, columns = self._columns, dict[str, Any]()
        for name in names:
            columns[name] = kept[name].copy() if name in kept else self._at_once(name)
        slow = [name for name, column in columns.items() if column is None]
        cells = [[point[name] for name in slow] for point in self] if slow else ()
        columns.update(zip(slow, map(_column, zip(*cells, strict=True)), strict=True))
        for name in columns.keys() - kept.keys():
            if not columns[name].dtype.hasobject:
                kept[name] = columns[name].copy()
        return columns

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
        pairs = zip(_ROW(self), _ROW(other), strict=True)
        return self.made == other.made and all(np.array_equal(*p, equal_nan=True) for p in pairs)

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        return f"<Points {len(self)} along {self.curve!r}>"

    def __len__(self) -> int:
        return len(self.arclength)

    def __iter__(self) -> Iterator[Point]:
        return map(self.__getitem__, range(len(self.arclength)))

    @overload
    def __getitem__(self, key: int) -> Point: ...
    @overload
    def __getitem__(self, key: slice) -> Points: ...
    def __getitem__(self, key: int | slice) -> Point | Points:
        if isinstance(key, slice):
            every = range(len(self.arclength))
            if (chosen := every[key]) == every:
                return self
            marked = {i: self.made[k] for i, k in enumerate(chosen) if k in self.made}
            rows = self.z[key], self.tangent[key], self.arclength[key], self.residual[key]
            piece = Points(self.curve, *rows, marked)
            for name, column in self._columns.items():
                piece._columns[name] = column[key]
            return piece
        i = range(len(self.arclength))[key]
        if i in self.made:
            return self.made[i]
        if i not in self._points:
            numbers = float(self.arclength[i]), float(self.residual[i])
            self._points[i] = Point(self.curve, self.z[i], self.tangent[i], *numbers)
        return self._points[i]


def _column(cells: Sequence[Any]) -> NDArray[Any]:
    """One value for each point: an array of objects where they are arrays of several shapes."""
    try:
        return np.array(cells)
    except ValueError:
        return np.fromiter(cells, dtype=object, count=len(cells))


class Stop(enum.Enum):
    """Reason why a branch ended; the value is the sentence a user reads."""

    BOUND = "reached the edge of the window"
    EVENT = "ended at a terminal event"
    CLOSED = "closed: the curve came back to its start"
    INFINITY = "runs to infinity while its parameters tend to limits"
    MOST = "took as many steps as allowed; raise Steps.most to go on"
    NO_CONVERGENCE = "Newton's iteration failed down to the smallest step"
    DOMAIN = "reached the edge of the domain of the equations"
    RIM = DOMAIN  # in older files
    INTERRUPTED = "interrupted; the points up to here are kept"
    START = "where the walk set out"
    CUT = "a piece of a longer branch was taken"

    @property
    def failed(self) -> bool:
        """Say whether the numerics gave up, rather than the curve being at its end."""
        return self in (Stop.NO_CONVERGENCE, Stop.DOMAIN)


@dataclass(frozen=True, eq=False)
class Branch(Columns, HtmlRepr):
    """Points along a curve, in order, with the special ones among them.

    ``branch["a"]`` is a column (an unknown, a parameter, a recorded number, or ``"arclength"``; of
    an array u also its Euclidean norm, ``"norm(u)"``), ``"a" in branch`` whether there is one,
    ``branch[17]`` a `Point`, ``branch[2:5]`` the branch of these points, ``branch.special`` the
    labelled points, ``branch.first("PF")`` one of them. ``stop`` says why it ended where it does,
    ``began`` why where it starts (None where the walk set out); ``reason`` and ``began_reason`` add
    what the equations said. ``doubtful`` keeps candidates that failed their verification.
    ``image_of`` tells of an arm of which earlier one, and of a branch of a diagram of which earlier
    branch, it is the image under a symmetry.
    ``settings`` is how it was asked for, ``origin`` the point that it was born from.
    """

    points: Points  # or any sequence of them
    stop: Stop
    began: Stop | None = None
    reason: str = ""
    began_reason: str = ""
    doubtful: tuple[Point, ...] = ()
    image_of: int | None = None
    settings: Settings | None = field(default=None, kw_only=True)
    origin: Point | None = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", Points.of(self.points))

    def __len__(self) -> int:
        return len(self.points)

    def __iter__(self) -> Iterator[Point]:
        return iter(self.points)

    def __contains__(self, key: object) -> bool:
        if isinstance(key, str):  # no point is one
            return key in self.names or self.problem.normed(key) is not None
        return key in self.points

    @property
    def curve(self) -> Curve:
        return self.points[0].curve

    @property
    def problem(self) -> Problem:
        return self.curve.problem

    @property
    def free(self) -> str:
        """The parameter the walk was in."""
        return self.curve.free[0]

    @property
    def start_correction(self) -> float:
        """Distance of the start that was given from the curve; 0 if that is not worth telling."""
        more = self.points.made.values()
        return next((p.detail["moved"] for p in more if "moved" in p.detail), 0.0)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all columns: parameters, what is measured, the unknowns."""
        params = {*self.problem.params, *self.curve.varied}
        parameters = [name for name in self.problem.names if name in params]
        unknowns = [name for name in self.problem.names if name not in params]
        return (*parameters, *self.problem.record, "arclength", "residual", *unknowns)

    def _ipython_key_completions_(self) -> list[str]:
        return [*self.names]

    @property
    def special(self) -> tuple[Point, ...]:
        """The labelled points, in order along the branch."""
        return self.points.special

    @overload
    def __getitem__(self, key: slice) -> Branch: ...
    @overload
    def __getitem__(self, key: str | int) -> Any: ...
    def __getitem__(self, key: str | int | slice) -> Any:
        if isinstance(key, str):
            return self._column(key)
        if isinstance(key, slice):
            return self._piece(key)
        try:
            return self.points[key]
        except TypeError:
            raise BadInput(
                f"branch[{brief(key)}]: the name of a column or the number of a point was expected"
            ) from None
        except IndexError:
            raise IndexError(f"branch[{brief(key)}]: it has {len(self)} points") from None

    def _piece(self, key: slice) -> Branch:
        chosen = range(len(self))[key]
        if not chosen or chosen.step < 0:
            raise BadInput(
                f"branch[{key.start}:{key.stop}:{key.step}] of {len(self)} points: a piece has at "
                "least one point, and goes forwards; branch.reversed() goes backwards"
            )
        first, last = chosen[0], chosen[-1]
        low, high = self.points[first].arclength, self.points[last].arclength
        doubtful = tuple(p for p in self.doubtful if low <= p.arclength <= high)
        piece = replace(self, points=self.points[key], doubtful=doubtful)
        if first:
            piece = replace(piece, began=Stop.CUT, began_reason="")
        whole = last == len(self) - 1 and not (first and self.stop is Stop.CLOSED)
        return piece if whole else replace(piece, stop=Stop.CUT, reason="")

    def _column(self, name: str) -> Array:
        if name in ("arclength", "residual"):
            column: Array = getattr(self.points, name)
            return column.copy()
        slots, problem = self.curve.slots, self.problem
        if name in slots:
            return self.points.z[:, slots[name]].copy()
        if name in problem.params:
            return np.full(len(self.points), float(problem.params[name]))
        if name in problem.record:
            return self.points.recorded(name)[name]
        array = problem.normed(name)
        if array is not None:
            return np.asarray(np.linalg.norm(self[array], axis=1))
        has = f"{[name for name in self.names if name not in problem.internals]}"
        if any(name in (point.kind, point.label) for point in self.special):
            has += f"; the point is branch.first({name!r})"
        raise BadInput(f"no column {name!r}; this branch has {has}")

    def columns(self) -> dict[str, NDArray[Any]]:
        """Columns by name, the labels of the special points first. At special points there is no
        count where rounding decides it."""
        columns: dict[str, NDArray[Any]] = {"label": np.array([p.label for p in self.points])}
        record, names = self.problem.record, self.problem.names
        recorded = self.points.recorded(*(name for name in record if name not in names))
        for name in self.names:
            columns[name] = recorded[name] if name in recorded else np.asarray(self[name])
        verge = np.array([bool(p.kind) and p.on_verge for p in self.points])
        for name in record:
            # a count is a column of whole numbers, or of floats where some of it is blank
            counted = isinstance(record[name], UnstableDimension)
            if (counted or columns[name].dtype.kind in "iu") and verge.any():
                columns[name] = np.where(verge, math.nan, columns[name])
        return columns

    def attributes(self) -> dict[str, Any]:
        """Sentence that describes it, as title."""
        return {"title": self.describe()}

    def tabulated(self) -> dict[str, NDArray[Any]]:
        """Without the unknowns of a discretisation, and vectors of what defines a boundary."""
        internals = self.problem.internals
        return {name: of for name, of in self.columns().items() if name not in internals}

    def first(self, kind: str) -> Point:
        """The first special point of a kind (``"PF"``) or with a label (``"PF2"``)."""
        for point in self.special:
            if kind in (point.kind, point.label):
                return point
        there = f"no {kind!r} on this branch; it has {[p.label for p in self.special]}"
        asked = self.settings.events if self.settings else None
        looked = self.problem.events if asked is None else asked
        wanted = str(kind).rstrip("0123456789")
        constructor = look_of(wanted).constructor
        # breathers, maps and cycles come with their events, a problem of one's own without
        own = type(self.problem) is Problem or not self.problem.events
        if constructor and own and all(event.kind != wanted for event in looked):
            there += f"; it is looked for with events=[{constructor}]"
        raise BadInput(there)

    def join(self, other: Branch) -> Branch:
        """This branch followed by another that starts where this one ends, relabelled."""
        check_kind(other, Branch, "a Branch")
        if not np.allclose(self.points[-1].z, other.points[0].z, rtol=0, atol=1e-8):
            raise BadInput("branches join where one ends and the other starts; these do not meet")
        before, shift = self.points, self.points[-1].arclength - other.points[0].arclength
        after = other.points.measured(1, shift)
        seam = before.arclength[-1]
        # within this relative arclength they meet
        reach = 1e-10 * (after.arclength[-1] - before.arclength[0])
        head = before[: np.count_nonzero(before.arclength < seam - reach)]
        tail = after[np.count_nonzero(after.arclength <= seam + reach) :]
        at_seam = [*before[len(head) :], *after[: len(after) - len(tail)]]
        # what happens there once: an event is known by its object, and a point where nothing
        # happens is left out beside one where something does
        special = {
            id(point.event) if point.event else point.kind: point
            for point in at_seam
            if point.kind not in ("", "EP", "MX")
        }
        if special:
            at_seam = list(special.values())
        elif len(head) and len(tail):
            at_seam = [replace(before[-1], kind="", label="")]  # no end any more
        else:
            at_seam = at_seam[-1 if len(head) else 0 :][:1]
        return replace(
            self,
            points=labelled(Points.joined([head, at_seam, tail])),
            stop=other.stop,
            reason=other.reason,
            doubtful=self.doubtful + tuple(_measured(p, 1, shift) for p in other.doubtful),
        )

    def reversed(self) -> Branch:
        """Walk the same points the other way."""
        end = self.points[-1].arclength
        points = labelled(self.points.measured(-1, end))
        doubtful = tuple(_measured(point, -1, end) for point in reversed(self.doubtful))
        turned = replace(self, points=points, doubtful=doubtful)
        if self.stop is Stop.CLOSED:
            return turned
        return replace(
            turned,
            stop=self.began or Stop.START,
            began=None if self.stop is Stop.START else self.stop,
            reason=self.began_reason,
            began_reason=self.reason,
        )

    def table(self) -> Sheet:
        """A line for each special point, the free parameters first; a count of unstable directions
        is left blank where one of them is on the verge."""
        start, points, free = self.points[0], self.special, self.curve.varied
        unknowns = [n for n in self.curve.slots if n not in {*free, *self.problem.internals}]
        record = self.problem.record.items()
        names = (*free, *unknowns, *(n for n, column in record if not isinstance(column, Implied)))
        columns = [Column("label", [p.title if p.located else f"{p.title}?" for p in points])]
        columns += [
            Column(name, [point.table_value(name) for point in points])
            for name in names
            if np.ndim(start[name]) == 0
        ]
        columns += [
            Column("arclength", [p.arclength for p in points], digits=6, spare=True),
            Column("residual", [f"{p.residual:.1e}" for p in points], spare=True, right=True),
        ]
        return Sheet(columns, self.describe() + self._doubts)

    @property
    def _doubts(self) -> str:
        return f"; {len(self.doubtful)} doubtful" if self.doubtful else ""

    def describe(self) -> str:
        """One sentence: what was walked, how far, and why it ended."""
        free, params = self.curve.varied, self.problem.params.items()
        head = f"{self.problem.label or 'branch'} in "
        head += f"({', '.join(free)})" if len(free) > 1 else self.free
        if fixed := ", ".join(f"{n} = {v:.10g}" for n, v in params if n not in free):
            head += f" at {fixed}" if len(free) > 1 else f" ({fixed})"
        last = self.points[-1].label if self.stop is Stop.EVENT else ""
        said = self.reason and f": {self.reason}"
        end = f"ended at {last}" if last else f"{self.stop.value}{said}"
        if self.began in (Stop.NO_CONVERGENCE, Stop.DOMAIN, Stop.INFINITY, Stop.MOST):
            said = self.began_reason and f": {self.began_reason}"
            end += f"; the other way: {self.began.value}{said}"
        elif self.began is Stop.BOUND and self.began_reason:  # no edge that was asked for
            end += f"; the other way: {self.began_reason}"
        moved = f"the start was moved by {d:.2g}" if (d := self.start_correction) else ""
        more = filter(None, (moved, advice(self.curve)))
        return "; ".join([f"{head}: {len(self)} points", end, *more])

    def __rich__(self) -> Sheet:
        return self.table()

    def __repr__(self) -> str:
        special = [point.label for point in self.special]
        return f"<Branch {self.describe()}; special {special}{self._doubts}>"


def labelled(points: Iterable[Point]) -> Points:
    """Number the special points of each kind in their order: PF1, PF2, ..."""
    points = Points.of(points)
    count: dict[str, int] = {}
    marked = dict(points.made)
    for i in sorted(marked):
        kind = marked[i].kind
        if kind:
            count[kind] = count.get(kind, 0) + 1
            dot = "." if kind[-1].isdigit() else ""  # the second R1 is R1.2, not R12
            marked[i] = replace(marked[i], label=f"{kind}{dot}{count[kind]}")
    return replace(points, made=marked)


def with_ends(branch: Branch) -> Branch:
    """Label both ends: EP, or MX where the numerics gave up."""
    points, made = branch.points, dict(branch.points.made)
    for i, stops in ((0, {branch.began}), (len(points) - 1, {branch.stop})):
        if len(points) == 1:  # both ends in one
            stops = {branch.began, branch.stop}
        if not points[i].kind:
            kind = "MX" if any(stop is not None and stop.failed for stop in stops) else "EP"
            made[i] = replace(points[i], kind=kind)
    return replace(branch, points=labelled(replace(points, made=made)))


def _measured(point: Point, sense: int, shift: float) -> Point:
    low, high = (point.bracket or (0.0, 0.0))[::sense]
    bracket = point.bracket and (shift + sense * low, shift + sense * high)
    tangent = None if point.tangent is None else sense * point.tangent
    arclength = shift + sense * point.arclength
    return replace(point, tangent=tangent, arclength=arclength, bracket=bracket)
