"""What a walk leaves behind: points, and branches of them."""

from __future__ import annotations

import enum
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import BadInput
from .problem import Curve, Problem
from .tabular import Column, Sheet

if TYPE_CHECKING:
    from rich.console import Console, ConsoleOptions, RenderResult
    from rich.table import Table

    from .events import Event

Array = NDArray[np.float64]

_SEAM = 1e-10  # relative arclength within which two branches meet


class Stop(enum.Enum):
    """Why a branch ended; the value is the sentence a user reads."""

    BOUND = "reached the edge of the window"
    EVENT = "ended at a terminal event"
    CLOSED = "closed: the curve came back to its start"
    MOST = "took as many steps as allowed; raise Steps.most to go on"
    NO_CONVERGENCE = "Newton's iteration failed down to the smallest step"
    RIM = "reached the rim of the domain of the equations"
    INTERRUPTED = "interrupted; the points up to here are kept"
    START = "where the walk set out"
    ONGOING = "still under way"

    @property
    def failed(self) -> bool:
        """Whether the numerics gave up, rather than the curve being at its end."""
        return self in (Stop.NO_CONVERGENCE, Stop.RIM)


@dataclass(frozen=True, slots=True, eq=False)
class Point:
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

    def __post_init__(self) -> None:
        self.z.flags.writeable = False
        if self.tangent is not None:
            self.tangent.flags.writeable = False

    def __getitem__(self, name: str) -> Any:
        """An unknown, a parameter, what was found here, a recorded number, in this order.

        What was found here is there by its full name too: ``point["a of BT"]`` is a coefficient
        of the normal form where ``point["a"]`` is a parameter of the problem.
        """
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
            return problem.record[name](self.ground)
        own = name.removesuffix(f" of {self.kind}")
        if own != name and own in self.detail:
            return self.detail[own]
        raise BadInput(f"no {name!r} at this point; it has {[*problem.names, *problem.record]}")

    @property
    def x(self) -> Array:
        """The unknowns as one array."""
        return self.z[: self.curve.size]

    @property
    def direction(self) -> Array:
        """The tangent, at a point of a walk."""
        if self.tangent is None:
            raise BadInput(f"{self!r} has no tangent: it is no point of a walk")
        return self.tangent

    @property
    def on_verge(self) -> bool:
        """Whether rounding decides a count of unstable directions here."""
        left = self.parent or self  # an arm sets out at the point that it left
        if left.event is None:  # without its equations: only ends are known to be clear
            return left.kind not in ("", "EP", "MX")
        return left.event.bifurcates

    @property
    def params(self) -> dict[str, float]:
        """All parameters here."""
        return self.curve.params(self.z)

    @property
    def values(self) -> dict[str, Any]:
        """All unknowns and parameters by name."""
        return {name: self[name] for name in self.curve.problem.names}

    @property
    def problem(self) -> Problem:
        """The problem with its start and parameters moved here."""
        return self.curve.problem.at(**self.values)

    @property
    def ground(self) -> Point:
        """On a boundary: this point as one of the original problem, without tangent."""
        together = self.curve.problem.adjoined
        if together is None:
            return self
        z, _ = together.split(self.x, self.params)
        return replace(self, curve=together.base, z=z, tangent=None)

    @property
    def solution(self) -> Any:
        """What this point is to the user of its problem, an `Orbit` for instance."""
        interpret = self.ground.curve.problem.interpret
        if interpret is None:
            raise BadInput("this problem says no more of a point than its values")
        return interpret(self.ground)

    def __getattr__(self, name: str) -> Any:
        """What the solution answers the point answers too: ``point.state(sites=20)`` of an orbit.

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
        """The label, and of several levels the one that was met."""
        return f"{self.label} ({self.detail['level']})" if "level" in self.detail else self.label

    def __repr__(self) -> str:
        shown = {name: value for name, value in self.values.items() if np.ndim(value) == 0}
        values = ", ".join(f"{name}={value:.10g}" for name, value in shown.items())
        if self.located:
            return f"Point({self.title + ': ' if self.label else ''}{values})"
        reason = f": {self.detail['reason']}" if "reason" in self.detail else ""
        return f"Point({self.label or self.kind}?: {values}; not located{reason})"


@dataclass(frozen=True, eq=False)
class Branch:
    """Points along a curve, in order, with the special ones among them.

    ``branch["a"]`` is a column (an unknown, a parameter, a recorded number, or ``"arclength"``),
    ``branch[17]`` a `Point`, ``branch.special`` the labelled points, ``branch.first("PF")`` one of
    them. ``stop`` says why it ended where it does, ``began`` why where it starts (None where the
    walk set out); ``reason`` and ``began_reason`` add what the equations said. ``doubtful``
    keeps candidates that failed their verification. ``image_of`` tells of an arm of which earlier
    one it is the image under a symmetry.
    """

    points: tuple[Point, ...]
    stop: Stop
    began: Stop | None = None
    reason: str = ""
    began_reason: str = ""
    doubtful: tuple[Point, ...] = ()
    image_of: int | None = None

    def __len__(self) -> int:
        return len(self.points)

    def __iter__(self) -> Iterator[Point]:
        return iter(self.points)

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
    def moved(self) -> float:
        """How far the start that was given was from the curve; 0 if that is not worth telling."""
        return next((p.detail["moved"] for p in self.points if "moved" in p.detail), 0.0)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all columns."""
        return (*self.problem.names, *self.problem.record, "arclength", "residual")

    @property
    def special(self) -> tuple[Point, ...]:
        """The labelled points, in order along the branch."""
        return tuple(point for point in self.points if point.kind)

    def __getitem__(self, key: str | int) -> Any:
        if isinstance(key, str):
            return self._column(key)
        try:
            return self.points[key]
        except TypeError:
            raise BadInput(
                f"branch[{key!r}]: the name of a column or the number of a point was wanted"
            ) from None

    def _column(self, name: str) -> Array:
        if name in ("arclength", "residual"):
            return np.array([getattr(point, name) for point in self.points])
        slots, problem = self.curve.slots, self.problem
        if name in slots:
            return np.stack([point.z for point in self.points])[:, slots[name]]
        if name in problem.params:
            return np.full(len(self.points), float(problem.params[name]))
        if name in problem.record:
            return np.array([point[name] for point in self.points])
        raise BadInput(f"no column {name!r}; this branch has {list(self.names)}")

    def first(self, kind: str) -> Point:
        """The first special point of a kind (``"PF"``) or with a label (``"PF2"``)."""
        for point in self.special:
            if kind in (point.kind, point.label):
                return point
        raise BadInput(f"no {kind!r} on this branch; it has {[p.label for p in self.special]}")

    def join(self, other: Branch) -> Branch:
        """This branch followed by another that starts where this one ends, relabelled."""
        if not np.allclose(self.points[-1].z, other.points[0].z, rtol=0, atol=1e-8):
            raise BadInput("branches join where one ends and the other starts; these do not meet")
        shift = self.points[-1].arclength - other.points[0].arclength
        moved = [_shifted(point, shift) for point in other.points]
        points = _joined(list(self.points), moved)
        return replace(
            self,
            points=labelled(tuple(points)),
            stop=other.stop,
            reason=other.reason,
            doubtful=self.doubtful + tuple(_shifted(p, shift) for p in other.doubtful),
        )

    def reversed(self) -> Branch:
        """The same points walked the other way."""
        end = self.points[-1].arclength
        turned = tuple(_turned(point, end) for point in reversed(self.points))
        return replace(
            self,
            points=labelled(turned),
            stop=self.began or Stop.START,
            began=None if self.stop is Stop.START else self.stop,
            reason=self.began_reason,
            began_reason=self.reason,
            doubtful=tuple(_turned(point, end) for point in reversed(self.doubtful)),
        )

    def table(self, width: int | None = None) -> Table:
        """A rich table with a line for each special point, the free parameters first.

        A count of unstable directions is left blank where one of them is on the verge.

        Parameters
        ----------
        width : int, optional
            Columns of text to fit into, by fewer digits and without arclength and residual if
            need be. Printed on a rich console, the branch itself takes its width.
        """
        start = self.points[0]
        free = self.curve.varied
        own = [name for name in self.curve.slots if name not in free]
        names = (*free, *own, *self.problem.record)
        points = self.special
        columns = [Column("label", [p.title if p.located else f"{p.title}?" for p in points])]
        columns += [
            Column(name, [self.shown(point, name) for point in points])
            for name in names
            if np.ndim(start[name]) == 0
        ]
        columns += [
            Column("arclength", [p.arclength for p in points], digits=6, spare=True),
            Column("residual", [f"{p.residual:.1e}" for p in points], spare=True, right=True),
        ]
        return Sheet(columns, self.describe()).table(width)

    def shown(self, point: Point, name: str) -> complex | None:
        """A number of one of its points, but no count where rounding decides it."""
        value: complex = point[name]
        if name not in self.problem.record or not isinstance(value, int | np.integer):
            return None if value != value else value
        return None if point.on_verge else value

    def describe(self) -> str:
        """One sentence: what was walked, how far, and why it ended."""
        free = self.curve.varied
        fixed = ", ".join(
            f"{n} = {v:.10g}" for n, v in self.problem.params.items() if n not in free
        )
        title = self.problem.label or "branch"
        if len(free) > 1:
            head = f"{title} in ({', '.join(free)})" + (f" at {fixed}" if fixed else "")
        else:
            head = f"{title} in {self.free}" + (f" ({fixed})" if fixed else "")
        end = f"{self.stop.value}{': ' + self.reason if self.reason else ''}"
        moved = f"; the start was moved by {self.moved:.2g}" if self.moved else ""
        return f"{head}: {len(self)} points; {end}{moved}"

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        yield self.table(width=options.max_width)

    def __repr__(self) -> str:
        return f"<Branch {self.describe()}; special {[point.label for point in self.special]}>"


def labelled(points: tuple[Point, ...]) -> tuple[Point, ...]:
    """Number the special points of each kind in their order: PF1, PF2, ..."""
    count: dict[str, int] = {}
    numbered = []
    for point in points:
        if point.kind:
            count[point.kind] = count.get(point.kind, 0) + 1
            dot = "." if point.kind[-1].isdigit() else ""  # the second R1 is R1.2, not R12
            point = replace(point, label=f"{point.kind}{dot}{count[point.kind]}")
        numbered.append(point)
    return tuple(numbered)


def _joined(before: list[Point], after: list[Point]) -> list[Point]:
    """Both, with what happens at the seam once: an event is known by its object, and a point where
    nothing happens is left out beside one where something does."""
    seam = before[-1].arclength
    near = _SEAM * (after[-1].arclength - before[0].arclength)
    head = [point for point in before if point.arclength < seam - near]
    tail = [point for point in after if point.arclength > seam + near]
    there = [point for point in (*before, *after) if abs(point.arclength - seam) <= near]
    special = {
        id(point.event) if point.event else point.kind: point
        for point in there
        if point.kind not in ("", "EP", "MX")
    }
    if not special and head and tail:
        there = [replace(before[-1], kind="", label="")]  # no end any more
    return [*head, *(special.values() or there[-1 if head else 0 :][:1]), *tail]


def _shifted(point: Point, shift: float) -> Point:
    bracket = point.bracket and (point.bracket[0] + shift, point.bracket[1] + shift)
    return replace(point, arclength=point.arclength + shift, bracket=bracket)


def _turned(point: Point, end: float) -> Point:
    bracket = point.bracket and (end - point.bracket[1], end - point.bracket[0])
    tangent = None if point.tangent is None else -point.tangent
    return replace(point, tangent=tangent, arclength=end - point.arclength, bracket=bracket)
