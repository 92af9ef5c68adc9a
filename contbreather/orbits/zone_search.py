"""Search for the curves of a zone diagram, without a seed.

All admissible breathers at a comb of values of one parameter are looked through, in closed form or
along branches in the other; each event among them that lies on no curve known so far is traced as a
boundary, to the ends of the region where breathers exist.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from contbreather.continuation.boundary import boundary
from contbreather.continuation.branch import Branch, Points
from contbreather.continuation.checkpoint import Checkpoint
from contbreather.continuation.curve import Curve
from contbreather.continuation.newton import OUT_OF_DOMAIN
from contbreather.continuation.point import CodimensionTwo, Event, Point
from contbreather.continuation.problem import Problem
from contbreather.continuation.resume import refined
from contbreather.continuation.settings import Steps
from contbreather.continuation.trace import trace
from contbreather.errors import BadInput, NoSolution, add_partial_result
from contbreather.orbits.closed_form import symmetric_roots
from contbreather.orbits.closure import folds
from contbreather.orbits.orbit import Orbit
from contbreather.orbits.orbit_events import neimark_sacker
from contbreather.orbits.zone_diagram import JOINT, KINDS, Zones, admissible_roots
from contbreather.parameters import window_of
from contbreather.progress import Counter

Array = NDArray[np.float64]
Place = Point | Mapping[str, float]
Marked = NDArray[np.bool_]  # which of the steps between neighbours
Known = Callable[[str, Place], bool]  # whether a known curve of a kind passes a place

# the comb of values on which branches are traced
COMBS = {
    "gamma": (0.0, 0.02, 0.04, 0.06, 0.08, 0.1, 0.12, 0.14, 0.16, 0.18, 0.2, 0.22, 0.235, 0.245),
    "k": (0.02, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.97, 0.99, 0.997, 0.999),
    "a": (0.01, 0.03, 0.06, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.97),
}
PAIRS = {"k": ("gamma", "a"), "gamma": ("k", "a"), "a": ("k", "gamma")}
FEWEST = 80  # points on a curve
STEPS = Steps(first=0.005, largest=0.05, tolerance=1e-11)
SAME = 1e-3  # an event this close to a traced curve lies on it
PASSED = 3e-3  # a breather this close to a traced branch is one of it; chords of a branch are long
NEXT = (0.999, 1.001)  # next to a fold, as parts of its amplitude
PHASE = 0.1  # weight of phi in these distances: of breathers alike in p it differs a lot
VANISHED = 1e-9  # the impact has lost its velocity: no event of an impacting breather
BEYOND = 1.02  # how far, relative to where the far field grazes, amplitudes are looked at
BESIDE = (-3e-3, -3e-4, 3e-4, 3e-3)  # of a meeting a curve is looked for that the comb missed


@dataclass
class ZoneSearch:
    """One zone diagram in the making."""

    name: str
    value: float
    model: Mapping[str, Any]  # what breathers live on, as `symmetric` takes it
    given: Mapping[str, tuple[float, float]]
    threshold: float
    past_folds: bool
    kept: Checkpoint | None = None

    def __post_init__(self) -> None:
        self.pair = PAIRS[self.name]
        for other in self.given:
            if other not in self.pair:
                raise BadInput(f"no window for {other!r}: the plane is that of {self.pair}")
        self.within = {n: _narrowed(n, self.given.get(n)) for n in self.pair}
        self.events: tuple[Event, ...] | None = None  # until there is a breather that has them
        self.curves: dict[str, list[Branch]] = {kind: [] for kind in KINDS}

    def zones(self, *, interrupted: bool = False) -> Zones:
        """The curves there are."""
        curves = {kind: tuple(branches) for kind, branches in self.curves.items()}
        reach = 1.0 / self.model["forcing"].peak()
        beyond = self.past_folds and self.within.get("a", (0.0, 0.0))[1] > reach
        return Zones(
            (self.name, self.value), self.pair, curves, self.threshold, self.past_folds,
            interrupted, reach if beyond else None,
        )  # fmt: skip

    def so_far(self) -> Zones | None:
        return self.zones(interrupted=True) if any(self.curves.values()) else None

    def run(self, shown: Counter) -> None:
        scans = [self._scan(x, shown) for x in _comb(self.pair[0], self.within)]
        if not any(scans):
            searched = " and ".join(
                f"{name} > 0" if high == math.inf else f"{name} between {low:g} and {high:g}"
                for name, (low, high) in self.within.items()
            )
            raise BadInput(
                f"no breather at {self.name} = {self.value:g} for {searched}; "
                "widen the window, or choose another value"
            )
        # a curve too narrow for the comb still shows where it meets others: look beside these, and
        # between them, where one that leads from meeting to meeting has to pass
        ends = [p for branches in self.curves.values() for b in branches for p in b.special]
        meetings = [p for p in ends if isinstance(p.event, CodimensionTwo)]
        met = [p[self.pair[0]] for p in meetings if not self._passes(_followed(p), p)]
        beside = [x + step for x in met for step in BESIDE]
        between = [0.5 * (x + other) for x, other in pairwise(sorted(met))]
        low, high = self.within[self.pair[0]]
        for x in (*beside, *between):
            if low <= x <= high:
                self._scan(x, shown)

    def _scan(self, x: float, shown: Counter) -> bool:
        """Follow every new event of the admissible breathers at one value of the first parameter:
        by closed forms of all of them, or along branches."""
        free, at = self.pair[1], {self.name: self.value, self.pair[0]: x}
        starts = [*_comb(free, self.within), *self._next_to_folds(at)]
        passed: list[Branch | Mapping[str, Array]] = []
        closed = self._rows(at)
        if closed is not None:
            least = self.within[free][0]
            pieces = [piece for row in closed for piece in row.pieces(least, self._passes)]
            pieces.sort(key=partial(_first_of, starts))
            for piece in pieces:
                if piece.new is not None:
                    passed.append(dict(zip(("p", "phi", "a"), piece.z.T, strict=True)))
                    self._follow_all(piece.new, shown)
            walked = [piece for piece in pieces if piece.new is None]
            starts = [y for y in starts if any(p.low <= y <= p.high for p in walked)]
        for branch in self._branches(at, starts, passed, shown):
            passed.append(branch)
            self._follow_all(branch.special, shown)
        return bool(passed)

    def _follow_all(self, points: Iterable[Point], shown: Counter) -> None:
        for point in points:
            if point.kind in KINDS and point.located and self._begins(point):
                self._follow(point, shown)
                if self.kept:
                    self.kept.look(True, self.so_far)

    def _rows(self, at: Mapping[str, float]) -> list[Row] | None:
        """All upper breathers at these two parameters, where they have closed forms."""
        closed = self.pair[1] == "a" and self.model["lattice"].sites is None
        if not closed or self.past_folds:
            return None
        # beyond there the far field is behind its walls
        largest = min(self.within["a"][1], BEYOND / self.model["forcing"].peak())
        try:
            breather, *_ = symmetric_roots(largest, at["gamma"], at["k"], **self.model)
        except NoSolution:
            return []
        problem = self._problem(breather)
        return rows(problem, self.events or (), self.within["a"][0], largest)

    def _passes(self, kind: str, place: Place, but: Branch | None = None) -> bool:
        """Whether a curve of this kind does."""
        curves = (b for b in self.curves[kind] if b is not but)
        return any(_on_curve(b, place, self.pair, SAME) for b in curves)

    def _begins(self, point: Point) -> bool:
        """Whether its boundary begins there. At gamma = 0 a pitchfork has no null vector of its own
        where idle sites are held by their neighbours alone: the curve comes from a scan beside."""
        if point.kind != "PF" or point.event is None or point.event.locus is None:
            return True
        least, _ = point.event.locus(point.base_point).domain.get("gamma", (0.0, math.inf))
        # where gamma is fixed at 0 there is nothing beside: `boundary` refuses it
        return bool(point["gamma"] >= least) or self.name == "gamma"

    def _problem(self, breather: Orbit) -> Problem:
        """Its equations; all have the same events."""
        problem = breather.representation.problem(self.threshold).having(*self.pair)
        if self.events is None:
            self.events = problem.events
            if self.model.get("damping"):  # without losses nearly all pairs follow the first
                pairs = neimark_sacker(threshold=self.threshold, every=True).of(problem)
                self.events = tuple(pairs if e.kind == "NS" else e for e in self.events)
            if not self.past_folds:
                self.events = tuple(map(up_to_the_fold, self.events))
        return problem

    def _branches(
        self,
        at: Mapping[str, float],
        starts: Sequence[float],
        passed: Sequence[Any],
        shown: Counter,
    ) -> Iterator[Branch]:
        """Branches of admissible breathers in the second parameter, at one value of the first, from
        where it has one of several values, but for those that were passed."""
        free = self.pair[1]
        for y in starts:
            for breather in admissible_roots({**at, free: y}, **self.model):
                if not self.past_folds and breather.representation.family != "upper":
                    continue  # beyond the fold that ends the diagram
                problem, phi = self._problem(breather), breather.phi
                place = {free: y, "p": breather.p, "phi": phi, "t1": phi}
                if any(_on_curve(b, place, (free,), PASSED) for b in passed):
                    continue
                yield trace(
                    problem,
                    free,
                    within={free: self.within[free]},
                    events=self.events,
                    steps=Steps(first=0.02, largest=0.1),
                    progress=shown,
                )

    def _next_to_folds(self, at: Mapping[str, float]) -> list[float]:
        """Amplitudes on both sides of each fold, for sheets that pass between those of the comb."""
        if self.pair[1] != "a" or "damping" in self.model:
            return []
        amplitudes = folds(at["gamma"], at["k"], **self.model)
        low, high = self.within["a"]
        beside = [factor * a for a in amplitudes for factor in NEXT]
        return [a for a in beside if low <= a <= high]

    def _follow(self, point: Point, shown: Counter) -> None:
        """Trace an event as a boundary unless it lies on one already, and what takes over where it
        ends: another maximum that grazes, another wave of a ring, a fold."""
        waiting: list[tuple[Point, Branch | None]] = [(point, None)]
        while waiting:
            point, since = waiting.pop()
            kind = _followed(point)
            if point["p"] < VANISHED or self._passes(kind, point, but=since):
                continue
            with add_partial_result(self.curves[kind].append):
                branch = boundary(
                    point, self.pair, within=self.within, events=self.events, steps=STEPS,
                    progress=shown,
                )  # fmt: skip
            if len(branch) == 1:  # no step leaves it: what it is on is found from another branch
                continue
            self.curves[kind].append(branch)  # before it is refined: an interruption keeps it
            pieced = any(end.kind == JOINT for end in branch.special)
            self.curves[kind][-1] = branch = refined(branch, FEWEST // 8 if pieced else FEWEST)
            # what crosses a fold would go on behind it: beside the fold it is found on a branch
            waiting += [
                (end, branch)
                for end in branch.special
                if isinstance(end.event, CodimensionTwo)
                and (end.kind in ("GR-GR", JOINT) or _followed(end) == "LP")
            ]


def _first_of(starts: Sequence[float], piece: RowPiece) -> tuple[int, float]:
    """Rank of a piece: the first start whose walk comes to it, then the largest p."""
    reached = (i for i, y in enumerate(starts) if piece.low <= y <= piece.high)
    first = next(reached, len(starts) - 1)
    return first, -float(piece.z[abs(piece.z[:, 2] - starts[first]).argmin(), 0])


def _followed(point: Point) -> str:
    """The kind of the curve that leads on from a special point."""
    event = point.event
    if event is None:
        return point.kind
    return event.base.kind if isinstance(event, CodimensionTwo) else event.kind


def up_to_the_fold(event: Event) -> Event:
    """A fold ends the zone: what lies behind it is the other breather."""
    return replace(event, ends="branch") if event.kind == "LP" else event


def _narrowed(name: str, window: tuple[float, float] | None) -> tuple[float, float]:
    low, high = reach = window_of(name)
    if window is None:
        return low, high
    low, high = max(low, window[0]), min(high, window[1])
    if not low < high:
        raise BadInput(f"the window {window} of {name!r} leaves nothing of {reach}")
    return low, high


def _comb(name: str, within: Mapping[str, tuple[float, float]]) -> Iterable[float]:
    """Values inside the window and at its ends, at least nine."""
    low, high = within[name]
    low, high = max(low, COMBS[name][0]), min(high, COMBS[name][-1])
    inside = [value for value in COMBS[name] if low < value < high]
    if low > high:  # a window beyond the comb
        low, high = within[name]
    comb = [low, *inside, high] if len(inside) >= 7 else np.linspace(low, high, 9).tolist()
    return [value for value in comb if value > 0 or name != "a"]  # no forcing, no breather


def _on_curve(
    curve: Branch | Mapping[str, Array], place: Place, pair: Sequence[str], near: float
) -> bool:
    """Whether a traced curve passes a place."""
    # p and phi tell breathers apart; near k = 1 time reversal makes pairs alike in p. By modes p
    # takes long to say, and follows from the time
    closed = "phi" in (curve.names if isinstance(curve, Branch) else curve)
    names = (*pair, "p", "phi") if closed else (*pair, "t1")
    nodes = np.stack([curve[name] for name in names], axis=-1)
    gap = np.array([place[name] for name in names]) - nodes
    gap[:, -1] -= 2.0 * math.pi * np.rint(gap[:, -1] / (2.0 * math.pi))
    gap[:, -1] *= PHASE
    nodes[:, -1] *= PHASE
    if len(nodes) > 1:
        gap, chord = gap[:-1], np.diff(nodes, axis=0)
        along = np.sum(gap * chord, axis=-1) / np.sum(chord * chord, axis=-1)
        gap -= np.clip(along, 0, 1)[:, None] * chord
    return bool(np.linalg.norm(gap, axis=-1).min() < near)


# --- rows of a zone diagram -----------------------------------------------------------------------

# Given phi, (11) is linear in 1/a and p/a: nobody has to walk along a row of the diagram to see
# what happens on it, and whether that is on curves that are known.

POINTS = 48  # of a row, evenly along it
FIRST = 1e-6  # of its phases, the first step of the grid on which its length is measured
CLOSER = 17  # places at which a step is looked at closely
ROUNDS = 5  # of that, after which a zero is sharp to rounding
AHEAD = 1e-6  # of phi, which is next to an event
ROUNDED = 1e-12  # phases that differ by less are one


class Zero(NamedTuple):
    """Place where a test changes sign."""

    event: Event
    z: Array
    known: bool


class RowPiece(NamedTuple):
    """Admissible breathers that follow each other on a row."""

    low: float  # its amplitudes, and those of the events that end it, are between these
    high: float
    z: Array  # p, phi, a of breathers and events, in order
    new: Sequence[Point] | None  # events that are not known, by rising a; None: it has to be walked


@dataclass(frozen=True, eq=False)
class Row:
    """Breathers from the largest amplitude, or a fold, to the next fold, and one beyond a fold.

    Attributes
    ----------
    curve : Curve
        With free amplitude.
    events : sequence of Event
    z : ndarray
        p, phi, a of each.
    tests : ndarray
        A row for each event.
    counts : sequence
        Beside them, None of events without one.
    """

    curve: Curve
    events: Sequence[Event]
    z: Array
    tests: Array
    counts: Sequence[Any]

    @classmethod
    def of(cls, curve: Curve, events: Sequence[Event], phi: Array) -> Row | None:
        """The breathers with these phases; None unless all tests say many at once."""
        z, none = _at(curve, phi), np.zeros(phi.size)
        points = Points(curve, z, np.zeros_like(z), none, none)
        asked = [answer for event in events if (answer := event.at_once(points))]
        tests = np.array([test for test, _ in asked])
        if len(asked) < len(events) or not np.isfinite(tests).all():
            return None
        return cls(curve, events, z, tests, [count for _, count in asked])

    def pieces(self, least: float, known: Known) -> Iterator[RowPiece]:
        """All admissible breathers of at least an amplitude, the smallest first."""
        domain = [event.ends_domain for event in self.events]
        inside = (self.tests[domain] > 0.0).all(axis=0) & (self.z[:, 2] >= least)
        changes = np.flatnonzero(np.diff(inside, prepend=False, append=False))
        for first, end in changes.reshape(-1, 2)[::-1].tolist():
            # what ends a piece is in the steps to its neighbours
            steps = slice(max(first - 1, 0), min(end, inside.size - 1))
            resolved = self._is_resolved(steps)
            found = self._zeros(steps, known) if resolved else ()
            zeros = [zero for zero in found if zero.z[2] >= least]
            z = np.vstack([self.z[first:end], *(zero.z for zero in zeros)])
            z = z[np.argsort(z[:, 1])]
            a = self.z[steps.start : steps.stop + 1, 2]
            new = self._new(zeros, self.z[(first + end) // 2, 1]) if resolved else None
            # the zero of a fold is the breather at the fold, but for rounding
            yield RowPiece(a.min(), a.max(), z[np.diff(z[:, 1], prepend=-np.inf) > ROUNDED], new)

    def _is_resolved(self, steps: slice) -> bool:
        """Whether no event can be on these steps but those that change a sign."""
        for event, test, count in zip(self.events, self.tests, self.counts, strict=True):
            if _may_touch_zero(test)[steps].any():
                return False
            # at a zero a count changes by one; where it says more the test is looked at closely
            passed = _changes(test) if count is None else np.rint(abs(np.diff(count)))
            jumps = _changes(test) != passed
            for step in np.flatnonzero(jumps[steps]) + steps.start:
                _, closer = self._closely(event, self.z[step : step + 2, 1])
                if (_changes(closer) | _may_touch_zero(closer)).any():
                    return False
        return True

    def _zeros(self, steps: slice, known: Known) -> Iterator[Zero]:
        for i, step in zip(*np.nonzero(_changes(self.tests)[:, steps]), strict=True):
            event, ends = self.events[i], slice(steps.start + step, steps.start + step + 2)
            phi, test = self.z[ends, 1], self.tests[i, ends]
            for rounds in range(ROUNDS + 1):
                # where the line through two values of the test vanishes
                middle = phi[:1] + test[0] / (test[0] - test[1]) * np.diff(phi)
                (z,) = _at(self.curve, middle)
                is_known = known(event.kind, Point(self.curve, z))
                if is_known or rounds == ROUNDS:
                    break
                phi, test = self._closely(event, phi)
                change = int(_changes(test).argmax())
                phi, test = phi[change : change + 2], test[change : change + 2]
            yield Zero(event, z, is_known)

    def _closely(self, event: Event, ends: Array) -> tuple[Array, Array]:
        """Phases between two, and a test there."""
        phi = np.linspace(ends[0], ends[1], CLOSER)
        row = Row.of(self.curve, (event,), phi)
        assert row is not None  # as all tests say many on the whole row
        return phi, row.tests[0]

    def _new(self, zeros: Sequence[Zero], inside: float) -> list[Point] | None:
        """What is not known of the events on a piece, up to what ends it on both sides of a phase
        inside; None where one is not what its kind says."""
        ends = [zero.z[1] for zero in zeros if zero.event.ends]
        low = max((phi for phi in ends if phi < inside), default=-math.inf)
        high = min((phi for phi in ends if phi >= inside), default=math.inf)
        new, number = [], defaultdict[str, int](int)
        for event, z, known in sorted(zeros, key=lambda zero: zero.z[2]):
            number[event.kind] += 1
            room = 0.0 if event.ends else AHEAD  # at a fold a curve would go on behind it
            if not known and low + room <= z[1] <= high - room:
                point = _special(self.curve, event, z)
                if point is None:
                    return None
                new.append(replace(point, label=f"{point.kind}{number[event.kind]}"))
        return new


def _special(curve: Curve, event: Event, z: Array) -> Point | None:
    """An event as a point of a walk to larger amplitudes, once it has been verified."""
    try:
        # a rises against phi
        tangent, _ = curve.tangent_at(z, (_at(curve, z[1:2] - AHEAD) - z)[0])
        point = Point(curve, z, tangent, kind=event.kind, event=event)
        detail: Mapping[str, Any] = event.locus(point).extra if event.locus else {}
        point = replace(point, residual=float(abs(curve.equations(z)).max()), detail=detail)
        verdict = event.examine(point) if event.examine else {}
    except OUT_OF_DOMAIN:
        return None
    if isinstance(verdict, str):
        return None if verdict else point
    kind = verdict.get("kind", event.kind)
    return replace(point, kind=kind, detail={**detail, **verdict})


def _at(curve: Curve, phi: Array) -> Array:
    return np.asarray(curve.problem.closure.at_phases(phi, curve.fixed))


def _changes(test: Array) -> Marked:
    return np.asarray(np.diff(test > 0.0))


def _may_touch_zero(test: Array) -> Marked:
    """Steps within which a test may come to zero and back: on both sides a line through two values
    leads there."""
    falls = np.append(True, test[1:] * (2.0 * test[1:] - test[:-1]) < 0.0)
    rises = np.append(test[:-1] * (2.0 * test[:-1] - test[1:]) < 0.0, True)
    return ~_changes(test) & falls[:-1] & rises[1:]


def rows(problem: Any, events: Sequence[Event], least: float, largest: float) -> list[Row] | None:
    """One for each fold, between two amplitudes; None unless all tests say many at once."""
    curve, closed = Curve(problem, ("a",)), []
    for low, high in problem.closure.upper_phases(curve.fixed, largest):
        # where a is large it changes fast with phi
        z = _at(curve, low + (high - low) * np.append(0.0, np.geomspace(FIRST, 1.0, 400)))
        z = z[z[:, 0] > 0.0]
        z = z[: np.count_nonzero(z[:, 2] >= least) + 1]  # a falls along it
        if len(z) < 2:
            continue
        length = np.append(0.0, np.linalg.norm(np.diff(z, axis=0), axis=1).cumsum())
        phi = np.interp(np.linspace(0.0, length[-1], POINTS), length, z[:, 1])
        before, after = 2.0 * phi[[0, -1]] - phi[[1, -2]]  # a step beyond both ends
        beyond = _at(curve, np.array([before, after]))[:, 2]
        if 0.0 < beyond[0] < z[0, 2]:  # the first is a fold, too; beyond a pole a is negative
            phi = np.append(before, phi)
        row = Row.of(curve, events, np.append(phi, after) if beyond[1] > 0.0 else phi)
        if row is None:
            return None
        closed.append(row)
    return closed
