"""The one loop that walks curves, and the doors to it."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from contextlib import suppress
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from ..checks import one_of
from ..errors import BadInput, keeping
from ..progress import Counter, line_of
from .advance import EXACT, Failed, Step, Stepper, angle
from .branch import Branch, Settings, Stop, labelled
from .checkpoint import Save, checkpoint
from .curve import Curve
from .defining_systems import Singular
from .event_detection import Ends, Found, calm, find
from .newton import Array, Undefined
from .point import Event, Point
from .points import Points
from .problem import Problem, problem_in
from .samples import Value, counted, measure
from .scope import having, scope
from .segment import Segment
from .starts import (
    Bound,
    Within,
    all_of,
    bounds_of,
    first_tangent,
    given,
    rounding,
    settled,
    windows,
)
from .steps import Steps, steps_of
from .stride import TINY
from .strider import WIDEST, Strider

LOG = logging.getLogger(__name__)
Piece = Sequence[Point]

_FINE = 1e-7  # relative distance at which a curve has come back to its start
_PASS = 0.03  # at a branch point: distance, relative to the step, and angle at which it has
_MOVED = 1e-3  # how far, relative to 1 + |z|, a start may be moved without a word
_SAME_SLOPE = 1e-5  # relative: between what a compiled derivative has for a tangent and what is one
_TOGETHER = 32  # plain steps that are looked at before the next ones are shown
_PATIENCE = 200  # so many tiny steps in a row lead nowhere


class Startable(Protocol):
    """Anything that knows the problem it solves: an `Orbit`, a `Point`."""

    @property
    def problem(self) -> Problem: ...


@dataclass(frozen=True)
class End:
    """Why a walk ended, and what failed its verification on the way."""

    stop: Stop
    reason: str = ""
    doubtful: tuple[Point, ...] = ()


def trace(
    start: Problem | Startable,
    free: str,
    *,
    within: Within | None = None,
    towards: str = "both",
    events: Event | Iterable[Event] | None = None,
    steps: Steps | None = None,
    progress: bool | Counter | None = None,
    along: ArrayLike | None = None,
    inadmissible: bool = False,
    save: Save = None,
) -> Branch:
    """Follow the curve of solutions through a start, with one parameter free.

    Parameters
    ----------
    start : Problem, Orbit or Point
        Where to begin. From a point of a boundary in ``("gamma", "a")``, "a" leads to a branch of
        the original problem, another parameter to the same boundary there. A start that is not a
        solution is moved onto one at the same parameters; where none is found, onto the nearest
        with another value of the free one; or it is refused with its residual. How far it was moved
        says ``branch.moved``.
    free : str
        Name of the free parameter. Folds in it are passed without notice.
    within : dict, optional
        ``{name: (low, high)}`` for any unknown or parameter: the branch ends exactly there. The
        window of an array is one of its Euclidean norm, ``{"norm(u)": (0, 10)}``.
    towards : {'both', 'up', 'down'}
        Direction in which `free` changes at first.
    events : Event or iterable of Event, optional
        What to look for; the problem's own events by default, ``()`` for none. Its walls (the
        grazing of a breather) stay in any case.
    steps : Steps, optional
        Step sizes and tolerance.
    progress : bool, optional
        Show progress on standard error; by default on long walks at a terminal only.
    along : array_like, shape (n + 1,), optional
        Direction to set out in, unknowns and then the free parameter, in place of `towards`. The
        start is then taken as it is: several curves may leave it.
    inadmissible : bool
        Lift the walls: go on where solutions mean nothing any more. The branch then says so, and
        its column ``margin`` is negative beyond them.
    save : str or Path, optional
        A file to keep the branch in while it grows, every few seconds and at special points, whole
        at any moment; `load` reads it.

    Returns
    -------
    Branch
        Points in order of the walk, for ``towards='both'`` from the lower end to the upper.

    Raises
    ------
    BadInput
        For unknown names, empty windows, a start outside its window.
    NotConverged
        If the start is not a solution and none is near.
    Interrupted
        On Ctrl-C; its ``partial`` is the branch up to there, or None.

    Examples
    --------
    >>> import numpy as np
    >>> circle = Problem(lambda x, p: np.array([x[0]**2 + p["mu"]**2 - 1]),
    ...                  start={"x": 1.0}, params={"mu": 0.0})
    >>> trace(circle, "mu").stop.name
    'CLOSED'
    """
    one_of("towards", towards, ("both", "up", "down"))
    events = all_of(events)  # both walks need them
    origin = start if isinstance(start, Point) else None
    steps = steps_of(steps)
    settings = Settings(windows(within), events, steps, inadmissible)
    if isinstance(start, Point) and free in start.ground.curve.free[:1]:
        start = start.ground
    # once: what both find at the start is one event
    start = having(problem_in(start), free)
    sides = ("down", "up") if towards == "both" and along is None else (towards,)
    legs: list[Leg] = []

    def so_far() -> Branch | None:
        found = _so_far(legs)
        return found and replace(found, settings=settings, origin=origin)

    line = line_of(progress, lambda own: Counter(own, free))
    with checkpoint(save, "branch") as kept, line as shown, keeping(so_far):
        problem, wanted = scope(start, events, inadmissible=inadmissible)
        first = Walker(problem, free, within, sides[0], wanted, steps, along)
        for walker in [first, first.turned()] if len(sides) == 2 else [first]:
            legs.append(Leg(walker))
            legs[-1].go(shown, lambda special: kept.look(special, so_far))
            if walker.end.stop is Stop.CLOSED:
                break
        whole = replace(_whole(legs), settings=settings, origin=origin)
        kept.finish(whole)
    return whole


@dataclass
class Leg:
    """One side of a branch, as far as it has been walked."""

    walker: Walker
    pieces: list[Piece] = field(default_factory=list)

    def go(self, shown: Counter, keep: Callable[[bool], None]) -> None:
        """Walk to its end."""
        for piece in self.walker.pieces():
            self.pieces.append(piece)
            shown.advance(piece[-1], len(piece))
            keep(isinstance(piece, list) and any(point.kind for point in piece))

    def branch(self) -> Branch:
        points, end = labelled(Points.joined(self.pieces)), self.walker.end
        return Branch(points, end.stop, reason=end.reason, doubtful=end.doubtful)


def _whole(legs: Sequence[Leg]) -> Branch:
    """Both sides as one branch, with its ends labelled."""
    first, *second = (leg.branch() for leg in legs)
    if first.stop is Stop.CLOSED:
        return first
    return _with_ends(first.reversed().join(second[0]) if second else first)


def _so_far(legs: Sequence[Leg]) -> Branch | None:
    """What an interrupted walk leaves: nothing, one side, or more."""
    walked = [leg for leg in legs if leg.pieces]
    if len(walked) == 1 and walked[0].walker.end.stop is not Stop.INTERRUPTED:
        finished = walked[0].branch().reversed()  # the other side was to set out from its start
        return _with_ends(replace(finished, stop=Stop.INTERRUPTED))
    return _whole(walked) if walked else None


def _with_ends(branch: Branch) -> Branch:
    """Label both ends: EP, or MX where the numerics gave up."""
    points = Points.of(branch.points)
    for i, stops in ((0, {branch.began}), (len(points) - 1, {branch.stop})):
        if len(points) == 1:  # both ends in one
            stops = {branch.began, branch.stop}
        if not points[i].kind:
            kind = "MX" if any(stop is not None and stop.failed for stop in stops) else "EP"
            points = points.put(i, replace(points[i], kind=kind))
    return replace(branch, points=labelled(points))


def walk(
    start: Problem | Startable,
    free: str,
    *,
    within: Within | None = None,
    towards: str = "up",
    events: Event | Iterable[Event] | None = None,
    steps: Steps | None = None,
    along: ArrayLike | None = None,
    inadmissible: bool = False,
) -> Generator[Point, None, End]:
    """Walk a curve in one direction, yielding each point as it is found: `trace` by hand.

    Arguments as for `trace`; ``towards`` is ``'up'`` or ``'down'``. Special points come in their
    places, with a kind. The generator returns an `End`.

    Examples
    --------
    >>> import numpy as np, itertools
    >>> line = Problem(lambda x, p: np.array([x[0] - p["mu"]]), {"x": 0.0}, {"mu": 0.0})
    >>> [round(point["mu"], 3) for point in itertools.islice(walk(line, "mu"), 2)]
    [0.0, 0.007]
    """
    problem, wanted = scope(having(problem_in(start), free), events, inadmissible=inadmissible)
    walker = Walker(problem, free, within, towards, wanted, steps_of(steps), along)
    return walker.run()


class Walker:
    """One walk in one direction: what stays the same on it, and its loop `run`."""

    def __init__(
        self,
        problem: Problem,
        free: str,
        within: Within | None,
        towards: str,
        events: Sequence[Event],
        steps: Steps,
        along: ArrayLike | None = None,
    ) -> None:
        if along is None:
            one_of("towards", towards, ("up", "down"))
        self.steps = steps
        self.directed = along is not None
        self.events = events
        with _quiet():
            if along is None:
                self.curve, residual = settled(problem, free, steps.tolerance)
                tangent, self.side = first_tangent(self.curve, bounds_of(self.curve, within))
                if towards == "down":
                    tangent, self.side = -tangent, -self.side
            else:
                self.curve, residual, tangent = given(problem, free, along)
                self.side = 0
            self.crossed = self.side == 0  # whether the start is a branch point
            self.bounds = bounds_of(self.curve, within)
            self.stepper = Stepper(self.curve, self.bounds, steps)
            self.origin = Point(
                self.curve, self.curve.start, tangent, 0.0, residual, detail=self._moved(problem)
            )
            self.tests = self._first_tests()
        self.point, self.count = self.origin, 0  # where it is, after how many steps
        self.size, self.bend = steps.first, np.zeros_like(self.origin.z)  # for the next one
        self.end = End(Stop.INTERRUPTED)
        self.longest, self.tiny = 0.0, 0
        self.earlier: tuple[float, Sequence[Value]] | None = None  # where the last step set out
        self.ahead: Sequence[Point] = ()  # plain steps that were taken,
        self.at = 0  # and how many of them were looked at
        self.latest: tuple[Point, tuple[Value, ...]] | None = None  # tests that were asked last

    def turned(self) -> Walker:
        """The walk from the same start in the other direction, while neither has begun."""
        other = copy(self)
        other.curve, other.side = copy(self.curve), -self.side
        other.stepper = replace(self.stepper, curve=other.curve)
        other.origin = replace(self.origin, curve=other.curve, tangent=-self.origin.direction)
        other.point = other.origin
        with _quiet():
            other.tests = other._first_tests()
        return other

    def run(self) -> Generator[Point, None, End]:
        """Step, look for events, yield: until the curve, the window or the numerics end."""
        for piece in self.pieces():
            yield from piece
        return self.end

    def pieces(self) -> Iterator[Piece]:
        """The same, several points at a time."""
        doubtful: list[Point] = []
        end = Failed(Stop.MOST)
        while self.count < self.steps.most:
            if not self.waits:
                self.ahead, self.at = self._stride(), 0
            calm = self._calm()
            if calm:
                yield calm
                continue
            try:
                with _quiet():
                    step = self._next()
                    found = self._events_on(step)
                    line, stop = self._line_up(step, found)
            except Failed as failed:
                end = failed
                break
            last = line[-1].arclength if stop is Stop.EVENT else math.inf
            doubtful += [point for point in found.doubtful if point.arclength <= last]
            yield line
            if stop is not None:
                self.end = End(stop, self._rim(line[-1], stop), tuple(doubtful))
                return
            self._go(step, found)
        reason = end.reason or self._rim(self.point, end.stop)
        if self.point is self.origin:
            if self.directed and end.stop is Stop.NO_CONVERGENCE:
                reason = f"no curve leaves the start in this direction: {reason}"
            yield [self.point]
        self.end = End(end.stop, reason, tuple(doubtful))

    def _go(self, step: Step, found: Found) -> None:
        if not step.plain:
            turned = step.point.direction - self.point.direction
            self.bend = turned / (step.point.arclength - self.point.arclength)
            self.size, self.side = step.next_size, step.side or self.side
        self.point, self.tests, self.count = step.point, found.after, self.count + 1

    @property
    def waits(self) -> bool:
        """Whether plain steps that were taken were not looked at yet."""
        return self.at < len(self.ahead)

    def _calm(self) -> Sequence[Point]:
        """The next plain steps, as far as no test has anything to look for on them."""
        start = self.at
        if self.count and not self.events:
            self.at = len(self.ahead)
        # matrices say more of what is between two points than values do
        elif not any(isinstance(one.test, Singular) for one in self.events):
            # where there is no value, the reason is seen when the step is looked through
            with _quiet(), suppress(Undefined):
                while self.waits and self.at - start < _TOGETHER and self._is_calm():
                    self.at += 1
        if self.at == start:
            return ()
        self.point, self.count = self.ahead[self.at - 1], self.count + self.at - start
        return self.ahead[start : self.at]

    def _is_calm(self) -> bool:
        """Whether no test has anything to look for on the next plain step; it is taken then."""
        if self.earlier is None:
            return False
        point, last = self.ahead[self.at - 1] if self.at else self.point, self.ahead[self.at]
        after = self._tests_at(last)
        pace = (point.arclength - self.earlier[0]) / (last.arclength - point.arclength)
        values = self.earlier[1], self.tests, after
        if len(calm(self.events, pace, *values, (point, last))) < len(self.events):
            return False
        self.curve.passes(last.z)
        self.earlier, self.tests = (point.arclength, self.tests), after
        return True

    def _tests_at(self, point: Point) -> tuple[Value, ...]:
        """All tests at a point, asked once."""
        if self.latest is None or self.latest[0] is not point:
            self.latest = point, tuple([measure(event, point) for event in self.events])
        return self.latest[1]

    def _next(self) -> Step:
        """The next step: one of those that were taken ahead, or one with all that may befall it."""
        if self.waits:
            self.at += 1
            return Step(self.ahead[self.at - 1], 0.0, plain=True)
        point = self.point
        step = self.stepper.advance(point, self.bend, self.size, self.side)
        self._refuse_to_crawl(step.point.arclength - point.arclength)
        if self.count > 2 and self._returns(step.point):
            length = point.arclength + self.curve.length(self.origin.z - point.z)
            end = replace(self.origin, arclength=length)
            step = replace(step, point=end, stop=Stop.CLOSED)
        return step

    def _stride(self) -> Sequence[Point]:
        """Plain steps, as many as come off."""
        point, strider, most = self.point, self.strider, self.steps.most - self.count
        if strider is None or LOG.isEnabledFor(logging.DEBUG):  # each step has a line of its own
            return ()
        state = (point.arclength, self.size, float(self.side), self.longest)
        stretch = strider.go((point.z, point.direction, self.bend), state, most)
        if len(stretch[0]) and strider.loops.at_once and self._strayed(stretch[0], stretch[1]):
            self.strider = None
            return ()
        _, self.size, side, longest, _ = strider.state.tolist()
        self.bend = strider.bend.copy()
        if len(stretch[0]):
            self.side, self.longest, self.tiny = int(side), longest, 0
        return Points(self.curve, *stretch)

    def _strayed(self, zs: Array, tangents: Array) -> bool:
        """Whether the derivative of compiled functions, differences with the steps that suited the
        start, is another than the curve's at the end of a stretch."""
        try:
            with _quiet():
                slopes = self.curve.jacobian(zs[-1])
        except Undefined:
            return True
        off = abs(slopes @ tangents[-1])
        return not bool((off <= _SAME_SLOPE * (abs(slopes) @ abs(tangents[-1]))).all())

    @cached_property
    def strider(self) -> Strider | None:
        """Who takes the plain steps, where the equations can be compiled."""
        curve, steps = self.curve, self.steps
        bounds = [(b.slot, *self._inner(b)) for b in self.bounds if isinstance(b.slot, int)]
        if curve.start.size > WIDEST or len(bounds) < len(self.bounds):
            return None
        loops = curve.loops()
        largest = steps.largest or math.nan  # then the size of z says how long a step may be
        rules = steps.tolerance, steps.smallest, largest, steps.growth
        metric = np.ones(curve.start.size) if curve.metric is None else curve.metric
        origin = curve.dual(self.origin.direction), curve.start
        return None if loops is None else Strider(loops, rules, bounds, metric, origin)

    def _inner(self, bound: Bound) -> tuple[float, float]:
        """Where plain steps end short of a bound: it is landed on, unless the walk begins there."""
        start, ends = bound.value(self.curve.start), (bound.low, bound.high)
        off = [rounding(end) if abs(start - end) > rounding(end) else 0.0 for end in ends]
        return ends[0] + off[0], ends[1] - off[1]

    def _rim(self, point: Point, stop: Stop) -> str:
        """Where a branch ended at a bound that is not of the window but of the domain."""
        for bound in self.bounds if stop is Stop.BOUND else ():
            value = bound.value(point.z)
            for edge in self.curve.problem.domain.get(bound.name, ()):
                if math.isclose(value, edge, rel_tol=EXACT):
                    return f"the domain of {bound.name} ends at {value:g}"
        return ""

    def _refuse_to_crawl(self, length: float) -> None:
        """End a walk that only takes tiny steps: it would not get anywhere, at great expense."""
        self.longest = max(self.longest, length)
        self.tiny = self.tiny + 1 if length < TINY * self.longest else 0
        if self.tiny > _PATIENCE:
            raise Failed(Stop.NO_CONVERGENCE, f"{_PATIENCE} steps in a row had to be tiny")

    # --- events and ends ---

    def _moved(self, given: Problem) -> dict[str, float]:
        """How far the start that was given had to be moved, if that is worth telling."""
        curve = self.curve
        off = curve.length(curve.start - Curve(given, curve.free).start)
        return {"moved": off} if off > _MOVED * (1 + curve.length(curve.start)) else {}

    def _first_tests(self) -> tuple[Value, ...]:
        # a test that fails here, as for a wrong name, is a mistake
        values = tuple(counted(event, event.value(self.origin)) for event in self.events)
        for event, value in zip(self.events, values, strict=True):
            if event.ends_domain and value < -1e-9:
                raise BadInput(
                    f"the start lies beyond {event.kind}: its test is {value:.3g}, and only "
                    "positive values are admissible; start elsewhere, or lift this rule by "
                    f"inadmissible=True, with no {event.kind} among events"
                )
        return values

    def _events_on(self, step: Step) -> Found:
        if not self.events:
            return Found((), (), ())
        segment = Segment(self.point, step.point, self.steps.tolerance)
        ends = Ends(self.count == 0, step.stop is Stop.BOUND, step.stop is Stop.CLOSED)
        try:
            earlier, self.earlier = self.earlier, (self.point.arclength, self.tests)
            crossing = step.crossing
            both = self.tests, self._tests_at(step.point)
            return find(segment, self.events, *both, crossing=crossing, ends=ends, earlier=earlier)
        except Undefined as error:
            raise Failed(Stop.RIM, f"while locating an event: {error}") from error

    def _line_up(self, step: Step, found: Found) -> tuple[list[Point], Stop | None]:
        """What to yield for this step, in order, and whether the walk ends with it."""
        point = self.point
        near = 1e-8 * (step.point.arclength - point.arclength)
        starts, line = list[Point](), list[Point]()
        if self.count == 0:  # later, what the step before ended short of is found
            starts = [p for p in found.points if p.arclength <= point.arclength + near]
            line = [*starts] or [point]
        ended = {id(special.event) for special in starts}
        if any(id(event) in ended for event in self._broken(found)):
            return line, Stop.EVENT  # it leads out of the meaningful region at once
        for special in found.points[len(starts) :]:
            LOG.info("found %s: %r", special.kind, special)
            line.append(special)
            if special.event is not None and special.event.ends:
                return line, Stop.EVENT
        if self._broken(found):
            raise Failed(Stop.NO_CONVERGENCE, "the end of the meaningful region was not located")
        if not (line and abs(line[-1].arclength - step.point.arclength) <= near):
            line.append(step.point)
        return line, step.stop

    def _broken(self, found: Found) -> list[Event]:
        """The events on whose negative side the step ends, where only the positive one is meant."""
        after = zip(self.events, found.after, strict=False)
        return [event for event, value in after if event.ends_domain and value < 0]

    def _returns(self, last: Point) -> bool:
        """Whether the step passes the start of the walk, in the direction it set out."""
        point, row = self.point, self.curve.dual(self.origin.direction)
        before, after = row.dot(point.z - self.origin.z), row.dot(last.z - self.origin.z)
        if not before < 0 <= after or row.dot(last.direction) < 0.5:
            return False
        segment = Segment(point, last, self.steps.tolerance)
        guess, slope = segment.guess(before / (before - after))
        gap = guess - self.origin.z
        if self.curve.length(gap) > 0.1 * segment.length:
            return False
        if self.crossed:  # there Newton's iteration is singular, and curves differ in direction
            off = self.curve.length(gap) / segment.length
            return off <= _PASS and angle(self.curve, slope, self.origin.direction) <= _PASS
        # across the start only: along the curve Newton's linear condition keeps the place
        near = self.stepper.correct(self.origin.z + gap - row.dot(gap) * self.origin.direction, row)
        gap = near.z - self.origin.z
        return self.curve.length(gap) <= _FINE * (1 + self.curve.length(near.z))


def _quiet() -> np.errstate:
    """Where equations overflow or divide by zero the branch ends, with its reason."""
    return np.errstate(over="ignore", invalid="ignore", divide="ignore")
