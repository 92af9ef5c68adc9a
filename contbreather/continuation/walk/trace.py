"""The one loop that walks curves, and the doors to it."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial
from operator import attrgetter
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from ...checks import one_of
from ...errors import BadInput
from ...one_thread import one_thread
from ...progress import Counter
from ...workers import Failed, each
from ..algebra.newton import Array, Undefined
from ..curve.branch import Branch, Points, Stop, labelled, with_ends
from ..curve.curve import PASSED
from ..curve.derivative_checks import advice
from ..curve.point import CodimensionTwo, Event, Point
from ..curve.problem import Problem, problem_in
from ..curve.settings import Settings, Steps, Within, active_events, all_of, having
from ..events.event_detection import Ends, find, quiet_steps, unexplained
from ..events.step_interpolant import StepInterpolant
from ..systems.defining_systems import event_of, stays_regular
from .checkpoint import Checkpoint, Save, checkpoint
from .ends import QUIET, Growth, StartOnCurve, starts_on_curve
from .stepper import EXACT, BranchPiece, StepFailed, Stepper

LOG = logging.getLogger(__name__)
Finer = tuple[Problem, Any]  # a problem in more unknowns, and a direction to set out in or None


class Startable(Protocol):
    """Anything that knows the problem it solves: an `Orbit`, a `Point`."""

    @property
    def problem(self) -> Problem: ...


@dataclass(frozen=True)
class End:
    """Reason why a walk ended, and what failed its verification on the way."""

    stop: Stop
    reason: str = ""
    doubtful: tuple[Point, ...] = ()


@one_thread
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
        says ``branch.start_correction``.
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
    settings = Settings.of(within, events, steps, inadmissible)
    return walk_from(start, free, settings, towards, along, progress, save)


def walk_from(
    start: Problem | Startable,
    free: str,
    settings: Settings,
    towards: str = "both",
    along: ArrayLike | None = None,
    progress: bool | Counter | None = None,
    save: Save = None,
    *,
    name: str = "branch",
    whole: Callable[[Branch], Branch] | None = None,
    continues: Branch | None = None,
    crosses: bool = True,
) -> Branch:
    """Walk with these settings; from the end of a branch in its unknowns, and back to its start.
    What is returned, and kept under a name in a file, is made of the walk by `whole`, if given;
    a direction is that of one of two curves if another `crosses`."""
    if isinstance(start, Branch):
        raise BadInput(
            "trace starts at one point, got a whole branch: give branch[0], or branch.first('PF')"
        )
    one_of("towards", towards, ("both", "up", "down"))
    origin = start if isinstance(start, Point) else None
    if origin and free in origin.base_point.curve.free[:1]:
        start = origin.base_point
    walks: list[ContinuationIterator] = []

    def so_far() -> Branch | None:
        branch = _joined(walks, settings=settings, origin=origin)
        return branch if branch is None or whole is None else whole(branch)

    with checkpoint(save, name, so_far) as kept, Counter(progress) as shown:
        finer: Finer | None = having(problem_in(start), free), along
        while finer is not None:
            coarse, along = finer
            refined = partial(coarse.finer, along=along, crosses=crosses)
            look = refined if continues is None else lambda point: None
            walks[:] = _set_out(coarse, free, settings, towards, along, continues)
            shown.remark = advice(walks[0].curve)
            for walk in walks:
                finer = walk.follow(shown, kept, so_far, look)
                if finer is not None or walk.end.stop is Stop.CLOSED:
                    break
        result = so_far()
        assert result is not None
        if kept:
            kept.finish(result)
    return result


def _joined(walks: Sequence[ContinuationIterator], **about: Any) -> Branch | None:
    """Join what has been walked to one branch with its ends labelled; None of nothing."""
    sides = [walk.branch() for walk in walks if walk.walked]
    if not sides:
        return None
    branch = sides[0]
    if len(sides) == 2:
        branch = branch.reversed().join(sides[1])
    elif len(walks) == 2 and branch.stop not in (Stop.INTERRUPTED, Stop.CLOSED):
        # the other side was to set out from its start
        branch = replace(branch.reversed(), stop=Stop.INTERRUPTED)
    return replace(branch if branch.stop is Stop.CLOSED else with_ends(branch), **about)


def trace_many(
    starts: Iterable[Problem | Startable],
    free: str,
    *,
    within: Within | None = None,
    towards: str = "both",
    events: Event | Iterable[Event] | None = None,
    steps: Steps | None = None,
    inadmissible: bool = False,
    executor: Executor | int | None = None,
    progress: bool | None = None,
) -> Iterator[Branch | Failed]:
    """Follow the curves through many starts, over the cores of the machine.

    Parameters
    ----------
    starts : iterable of Problem, Orbit or Point
        Over any grid of parameters, of one problem or of several.
    free, within, towards, events, steps, inadmissible
        As of `trace`, for all of them.
    executor : concurrent.futures.Executor or int, optional
        Who computes: an executor, that of a cluster as well, or a number of processes, 1 for this
        one. All cores unless given, where there is more than a second of work.
    progress : bool, optional
        Show how many branches are done; by default at a terminal or in a notebook only.

    Yields
    ------
    Branch or Failed
        In the order of the starts, as they come, each as `trace` alone finds it. A start that
        `trace` refuses, or whose worker died twice, is a `Failed` with its ``reason``.

    Raises
    ------
    BadInput
        If a start is none, or cannot be sent to another process (an open file among what it needs).
    Interrupted
        On Ctrl-C; its ``partial`` is a tuple of the branches up to there.

    Examples
    --------
    >>> import contbreather as cb
    >>> starts = [cb.symmetric(0.5, gamma, 0.8) for gamma in (0.04, 0.03)]
    >>> branches = list(trace_many(starts, "a", within={"a": (0.5, 0.9)}, executor=1))
    >>> [round(branch.first("PF")["a"], 9) for branch in branches]
    [0.777632426, 0.753654232]
    """
    none = isinstance(starts, Problem | str) or not isinstance(starts, Iterable)
    if none or getattr(starts, "shape", None) == ():  # an array without dimensions is Iterable
        raise BadInput(f"trace_many takes several starts, a list of them; got {starts!r}")
    walk = partial(
        trace, free=free, within=within, towards=towards, events=all_of(events), steps=steps,
        inadmissible=inadmissible, progress=False,
    )  # fmt: skip
    problems = [problem_in(start) for start in starts]
    return each(walk, problems, executor=executor, progress=progress, unit="branches")


def iterate(
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
    >>> [round(point["mu"], 3) for point in itertools.islice(iterate(line, "mu"), 2)]
    [0.0, 0.007]
    """
    one_of("towards", towards, ("up", "down"))
    settings = Settings.of(within, events, steps, inadmissible)
    with one_thread:  # not while the caller has its turn
        walks = _set_out(having(problem_in(start), free), free, settings, towards, along)
    return walks[0].run()


def _set_out(
    start: Problem,
    free: str,
    settings: Settings,
    towards: str,
    along: ArrayLike | None,
    continues: Branch | None = None,
) -> list[ContinuationIterator]:
    """Make the walks from a start, one for each way."""
    # once: what both find at the start is one event
    problem, wanted = active_events(start, settings.events, inadmissible=settings.inadmissible)
    tolerance = settings.steps.tolerance
    ways = starts_on_curve(problem, free, settings.within, towards, along, tolerance)
    for way in ways:
        way.point.curve.asked = settings.events
    return [ContinuationIterator(way, wanted, settings.steps, continues) for way in ways]


class ContinuationIterator:
    """One curve in one direction, from its start to where it ends."""

    def __init__(
        self,
        way: StartOnCurve,
        events: Sequence[Event],
        steps: Steps,
        continues: Branch | None = None,
    ) -> None:
        self.way, self.events, self.steps = way, events, steps
        self.curve, start = way.point.curve, way.point
        home = continues[0] if continues else start
        self.stepper = Stepper(way, steps, start if home.tangent is None else home)
        self.point, self.count = start, 0  # where it is, after how many steps
        self.walked: list[Points] = []
        self.doubtful: list[Point] = []
        self.crossings: list[Point] = []
        self.unresolved: tuple[Point, ...] = ()  # the first point that its unknowns do not resolve
        self.end = End(Stop.INTERRUPTED)
        # at the latest two places: arclength, and the tests of all events as they are, int or float
        self.places, self.tests = [0.0], np.empty((len(events), 1), dtype=object)
        for i, event in enumerate(events):
            # a test that fails here, as for a wrong name, is a mistake
            with np.errstate(**QUIET):
                self.tests[i, 0] = value = event.value(start)
            if event.ends == "domain" and value < -1e-9:
                followed = event_of(self.curve.problem)
                if followed and not isinstance(event, CodimensionTwo):  # its own end, not a wall
                    raise BadInput(
                        f"no curve of {followed.kind} sets out here: it would lie beyond "
                        f"{event.kind}, where such curves end (its test is {value:.3g}), as where "
                        "several events come at once"
                    )
                words = f"its test is {value:.3g}, and only positive values are admissible"
                if margins := getattr(start, "admissibility", None):  # of orbits between walls
                    words = margins().reason.rstrip(".")
                raise BadInput(
                    f"the start lies beyond {event.kind}: {words}; start elsewhere, or lift this "
                    f"rule by inadmissible=True, with no {event.kind} among events"
                )
        self.matrices = [event.matrix for event in events if event.matrix]
        self.growth = Growth(self.curve, way.bounds, start.z)

    def follow(
        self,
        shown: Counter,
        kept: Checkpoint | None,
        so_far: Callable[[], Branch | None],
        look: Callable[[Point], Finer | None],
    ) -> Finer | None:
        """Walk to its end, or to where the problem asks for a finer one."""
        unresolved = self.curve.problem.unresolved
        for piece in self.pieces():
            self.walked.append(piece)
            shown.advance(last := piece[-1], len(piece))
            if kept:
                kept.look(bool(piece.special), so_far)
            if unresolved(last):
                if (finer := look(last)) is not None:
                    return finer
                first = next(filter(unresolved, piece))
                why = {"reason": unresolved(first)}
                found = replace(first, kind="MX", located=False, detail=why)
                self.unresolved = self.unresolved or (found,)
        return None

    def branch(self) -> Branch:
        points, end = labelled(Points.joined(self.walked)), self.end
        doubtful = sorted((*end.doubtful, *self.unresolved), key=attrgetter("arclength"))
        most = abs(points.z).max(axis=0)
        doubtful = [_with_scales(point, most) for point in doubtful]
        return Branch(points, end.stop, reason=end.reason, doubtful=tuple(doubtful))

    def run(self) -> Generator[Point, None, End]:
        """Step, look for events, yield: until the curve, the window or the numerics end."""
        for piece in self.pieces():
            yield from piece
        return self.end

    def pieces(self) -> Iterator[Points]:
        """Walk as `run` does, several points at a time."""
        stop: Stop | None = None
        reason, piece = "", None
        while stop is None and self.count < self.steps.most:
            try:
                with one_thread, np.errstate(**QUIET):
                    # predict   z + s t + s^2 c_2 + s^3 c_3
                    #           [  J(z) ]      [ H(z) ]        [  J(z) ]      [ 0 ]
                    # correct   [ t^T W ] dz = [  0   ],       [ t^T W ] t' = [ 1 ]
                    # adapt     s, so that the tangent turns by 0.15, in 4 iterations
                    if piece is None:
                        piece = self.stepper.next(self.point, self.count)
                        if renewed := self.point.renewed(piece.points[0]):
                            self._goes_on(renewed)
                            piece = self.stepper.next(self.point, self.count)
                        piece = piece.tested(self.events)
                    # test      at the end of each: a change of sign, or what may hide two of them
                    plain, quiet = self._without_candidates(piece)
                    line = passed = piece.points[: plain or 1]
                    if not plain:
                        # locate    by the defining system of the event, where it has one
                        line, stop = self._located(piece, quiet)
            except StepFailed as failed:
                stop, reason = failed.stop, failed.reason
                if stop is Stop.NO_CONVERGENCE:
                    near = self.curve.problem.ends_near(self.point)
                    advice = self.curve.unlike_scales(self.point.z)
                    reason = "; ".join(filter(None, (reason, near, advice)))
                break
            # record
            limit, taken = self.growth.end(passed) if stop is None else None, len(passed)
            self.point, self.count = (line if stop else passed)[-1], self.count + taken
            piece = piece.beyond(taken)
            if limit:
                stop, reason = Stop.INFINITY, limit[1]
                line = line[: limit[0] + 1] if line is passed else line
                self.point = line[-1]
            yield line
        stop = stop or Stop.MOST
        reason = reason or self._edge(self.point, stop)
        if self.count == 0:
            if self.way.directed and stop is Stop.NO_CONVERGENCE:
                reason = f"no curve leaves the start in this direction: {reason}"
            yield Points.of([self.point])
        self.end = End(stop, reason, tuple(self.doubtful))

    def _goes_on(self, point: Point) -> None:
        """Walk on from a point of a problem that was set up anew."""
        self.point, self.curve, before = point, point.curve, self.stepper
        sign = self.curve.tangent_at(point.z, point.direction)[1]
        way = replace(self.way, point=point, sign=sign)
        self.stepper = Stepper(way, self.steps, before.home)
        self.stepper.size, self.stepper.crossed = before.size, before.crossed
        self.places, self.tests = self.places[-1:], self.tests[:, -1:]

    # --- test ---

    def _without_candidates(self, piece: BranchPiece) -> tuple[int, Any]:
        """Count the steps on which no event has anything to look for; and say of each event whether
        that is so on the first, as far as it is known."""
        points, more = piece.points, piece.crossing or piece.stop
        if not self.events:
            return len(points) - bool(more) if self.count else 0, ()
        if len(self.places) < 2:
            return 0, [False] * len(self.events)
        places = [*self.places, *points.arclength.tolist()]
        tests = np.hstack([self.tests, piece.tests])
        quiet = quiet_steps(self.events, places, tests, piece.counts, self.point, points)
        clear: Any = quiet.all(axis=0)
        clear[-1] &= not more
        if clear.size == 1:
            regular = partial(stays_regular, first=self.point, last=points[0])
            clear[0] = clear[0] and all(map(regular, self.matrices))
        n = len(clear) if clear.all() else int(clear.argmin())
        if n:
            self.places, self.tests = places[n : n + 2], tests[:, n : n + 2]
            for z in points.z[max(n - PASSED, 0) : n]:
                self.curve.passes(z)
        return n, quiet[:, 0]

    # --- locate ---

    def _located(self, piece: BranchPiece, quiet: Any) -> tuple[Points, Stop | None]:
        """Find what happens on the first step of a piece: its points in order, and whether the walk
        ends with it."""
        point, last, begins = self.point, piece.points[0], self.count == 0
        # what befell the last step of a piece is not the first one's own
        stop, crossing = (piece.stop, piece.crossing) if len(piece.points) == 1 else (None, None)
        closed, line = stop is Stop.CLOSED, list[Point]()
        found, doubtful = self._found(piece, quiet, crossing, stop)
        reach = 1e-8 * (last.arclength - point.arclength)
        if begins:  # later, what the step before ended short of is found
            line = [p for p in found if p.arclength <= point.arclength + reach]
            found = found[len(line) :]
        left, at_once = self._left(line, found)
        line = line or [point] * begins
        if at_once or self._goes_to_end(found, last, line):
            stop = Stop.EVENT
        elif left:
            names = ", ".join(left)
            raise StepFailed(f"the end of the meaningful region ({names}) was not located")
        near = bool(line) and abs(line[-1].arclength - last.arclength) <= reach
        if stop is not Stop.EVENT and not near:
            line.append(last)
        # what is singular where an event ends the curve needs no other name: at R1 of a curve of NS
        # its equations are those of a fold, too
        end = line[-1].arclength - reach if stop is Stop.EVENT else math.inf
        self.doubtful += [p for p in doubtful if (p.bracket or (p.arclength,))[-1] < end]
        self.crossings += [p for p in line if p.event and p.event.crosses]
        if closed and self.way.directed:  # an arm that is back where it left another curve
            self.crossings.append(last)
        self.doubtful = unexplained(self.doubtful, self.crossings)
        return Points.of(line), stop

    def _found(
        self, piece: BranchPiece, quiet: Any, crossing: Any, stop: Stop | None
    ) -> tuple[list[Point], list[Point]]:
        """Look for all events on the first step of a piece; go on from their tests at its end."""
        point, last, closed = self.point, piece.points[0], stop is Stop.CLOSED
        before, after = self.tests[:, -1], piece.tests[:, 0].copy()
        found, doubtful = list[Point](), list[Point]()
        if self.events:
            segment = StepInterpolant(point, last, self.steps.tolerance)
            if crossing or closed:
                quiet = [False] * len(self.events)
            ends = Ends(self.count == 0, stop is Stop.BOUND, closed)
            try:
                found, doubtful, after = find(
                    segment, self.events, before, after, quiet, crossing, ends
                )
            except Undefined as error:
                raise StepFailed(f"while locating an event: {error}", Stop.DOMAIN) from error
        self.places = [point.arclength, last.arclength]
        self.tests = np.stack([before, after], axis=1)
        return found, doubtful

    def _left(self, at_start: list[Point], later: list[Point]) -> tuple[list[str], bool]:
        """Name the walls of the meaningful region behind which the step ends, and tell whether it
        is left at once, at the start."""
        left, at_once, begins = list[str](), False, self.count == 0
        ended, located = ({id(p.event) for p in points} for points in (at_start, later))
        for event, (then, now) in zip(self.events, self.tests, strict=True):
            if event.ends == "domain" and now < 0:  # only the positive side is meant
                left.append(event.kind)
                # what is negative at the start is rounding: more of it is refused
                there = id(event) in ended or (begins and then <= 0)
                at_once |= there and id(event) not in located
        return left, at_once

    def _goes_to_end(self, found: list[Point], last: Point, line: list[Point]) -> bool:
        """Add to a line what was found, up to what ends the curve; tell whether anything does."""
        simpler = self.curve.problem.simpler
        for special in found:
            LOG.info("found %s: %r", special.kind, special)
            event, sides = special.event, (self.point, last)
            # where what has doubled is taken back, solutions are those of a simpler problem, and
            # what is beyond has been walked; not so where both sides are simple, as all of the
            # branch is then (one side may look so, near the point)
            crosses = event and event.crosses and self.count
            if crosses and simpler(special) and not all(map(simpler, sides)):
                said = "beyond, the branch goes on as its own image under a symmetry"
                line.append(replace(special, detail={**special.detail, "said": said}))
                return True
            line.append(special)
            if event is not None and event.ends:
                return True
        return False

    # --- end ---

    def _edge(self, point: Point, stop: Stop) -> str:
        """Say more of the end of a branch: by its event, or by a bound of the domain."""
        if stop is Stop.EVENT:
            said = point.base_point.curve.problem.said_at_end
            return str(point.detail.get("said") or said(point))
        if stop is Stop.MOST:
            towards = self.growth.towards(point.z, point.direction)
            return towards or self.curve.unlike_scales(point.z)
        for bound in self.way.bounds if stop is Stop.BOUND else ():
            value = bound.value(point.z)
            for edge in self.curve.problem.domain_along(self.curve.free).get(bound.name, ()):
                if math.isclose(value, edge, rel_tol=EXACT):
                    return f"the domain of {bound.name} ends at {value:g}"
        return ""


def _with_scales(doubtful: Point, most: Array) -> Point:
    """Say which sizes may be why an event is in doubt: large there, or small all along."""
    sizes = np.minimum(most, np.maximum(abs(doubtful.z), 1.0))
    if not (advice := doubtful.curve.unlike_scales(sizes)):
        return doubtful
    said = filter(None, (doubtful.detail.get("reason", ""), advice))
    return replace(doubtful, detail={**doubtful.detail, "reason": "; ".join(said)})
