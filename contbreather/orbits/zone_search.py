"""Search for the curves of a zone diagram, without a seed.

All admissible breathers at a comb of values of one parameter are looked through, in closed form or
along branches in the other; each event among them that lies on no curve known so far is traced as a
boundary, to the ends of the region where breathers exist.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from contbreather.continuation.branches.boundary import boundary
from contbreather.continuation.curve.branch import Branch, Points
from contbreather.continuation.curve.curve import Curve
from contbreather.continuation.curve.point import CodimensionTwo, Event, Point
from contbreather.continuation.curve.problem import Problem
from contbreather.continuation.curve.settings import Steps
from contbreather.continuation.files.resume import refined
from contbreather.continuation.walk.checkpoint import Checkpoint
from contbreather.continuation.walk.trace import trace
from contbreather.errors import BadInput, NoSolution, add_partial_result
from contbreather.lattice.conditions import check_drive
from contbreather.orbits.by_impacts import symmetric_folds
from contbreather.orbits.closed_form import symmetric_roots
from contbreather.orbits.closure import folds
from contbreather.orbits.orbit import Orbit
from contbreather.orbits.orbit_events import neimark_sacker
from contbreather.orbits.section import VANISHED
from contbreather.orbits.zone_diagram import (
    JOINT,
    KINDS,
    Zones,
    admissible_roots,
    narrowed,
    unit_of,
)
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
    "omega": (0.3, 0.45, 0.6, 0.7, 0.8, 0.9, 1.0, 1.1, 1.25, 1.5, 1.75, 2.0, 2.5, 3.0),
}
PAIRS = {"k": ("gamma", "a"), "gamma": ("k", "a"), "a": ("k", "gamma")}


def second_of(fixed: Mapping[str, Any]) -> str | None:
    """The second of two parameters that are fixed in a plane of omega: gamma, or a; None of one."""
    return None if len(fixed) != 2 else "gamma" if "gamma" in fixed else "a"


FEWEST = 80  # points on a curve
STEPS = Steps(first=0.005, largest=0.05, tolerance=1e-11)
SAME = 1e-3  # an event this close to a traced curve lies on it
PHASE = 0.1  # weight of phi in these distances: of breathers alike in p it differs a lot
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
    held: Mapping[str, float] = field(default_factory=dict)  # omega, or in planes of it a second
    beyond: bool = False
    kept: Checkpoint | None = None

    def __post_init__(self) -> None:
        third = ({*PAIRS} - {self.name, *self.held}).pop()
        in_omega = bool({*self.held} - {"omega"})
        self.pair = ("omega", third) if in_omega else PAIRS[self.name]
        for other in self.given:
            if other not in self.pair:
                raise BadInput(f"no window for {other!r}: the plane is that of {self.pair}")
        self.within = narrowed(self.pair, self.given, self.model["lattice"], self.held)
        self.events: tuple[Event, ...] | None = None  # until there is a breather that has them
        self.curves: dict[str, list[Branch]] = {kind: [] for kind in KINDS}

    def _unit(self, name: str, omega: float | None = None) -> float:
        """Unit of a parameter, which windows and combs are in."""
        return unit_of(name, self.model["lattice"], omega or self.held.get("omega", 1.0))

    def zones(self, *, interrupted: bool = False) -> Zones:
        curves = {kind: tuple(branches) for kind, branches in self.curves.items()}
        reach = 1.0 / self.model["forcing"].peak()
        beyond = self.past_folds and self.within.get("a", (0.0, 0.0))[1] > reach
        return Zones(
            (self.name, self.value), self.pair, curves, self.threshold, self.past_folds,
            interrupted, reach if beyond else None, self.held, self.beyond,
        )  # fmt: skip

    def so_far(self) -> Zones | None:
        return self.zones(interrupted=True) if any(self.curves.values()) else None

    def run(self, shown: Counter) -> None:
        scans = [self._scan(x, shown) for x in self._comb(self.pair[0])]
        if not any(scans):
            known = {self.name: self.value, **self.held}
            # the band may be wider than the frequency, or its window
            least = known | {n: window[0] for n, window in self.within.items()}
            held = least["gamma"], self.model.get("spring"), self.model["lattice"]
            check_drive(self.within.get("omega", (0.0, known.get("omega", 1.0)))[1], *held)
            at = " and ".join(f"{n} = {x:g}" for n, x in known.items())
            searched = " and ".join(
                f"{name} > 0" if high == math.inf else f"{name} between {low:g} and {high:g}"
                for name, (low, high) in self.within.items()
            )
            raise BadInput(
                f"no breather at {at} for {searched}; widen the window, or choose another value"
            )
        # one that passes between two values of the comb leaves by an edge of the window
        for y in self.within[self.pair[1]]:
            if math.isfinite(y) and (y > 0.0 or self.pair[1] != "a"):  # no forcing, no breather
                self._scan(y, shown, axis=1)
        # a curve too narrow for the comb still shows where it meets others: look beside these, and
        # between them, where one that leads from meeting to meeting has to pass; across, too, for
        # at a resonance of a ring all of it is next to one x
        for axis, name in enumerate(self.pair):
            met, (low, high) = self._meetings(name), self.within[name]
            beside = [x + step for x in met for step in BESIDE]
            between = [0.5 * (x + other) for x, other in pairwise(met)]
            for x in (*beside, *between):
                if low <= x <= high:
                    self._scan(x, shown, axis)

    def _meetings(self, name: str) -> list[float]:
        """Values of a parameter where curves meet one that was not found."""
        ends = [p for branches in self.curves.values() for b in branches for p in b.special]
        meetings = [p for p in ends if isinstance(p.event, CodimensionTwo)]
        return sorted(p[name] for p in meetings if not self._passes(_followed(p), p))

    def _scan(self, x: float, shown: Counter, axis: int = 0) -> bool:
        """Follow every new event of admissible breathers at one value of a parameter, the first."""
        at, free = {**self.held, self.name: self.value, self.pair[axis]: x}, self.pair[1 - axis]
        pieces = None if axis else self._row(at)
        if pieces is None:
            branches = self._branches(at, free, shown)
        else:
            new = (p for p in pieces if not p.is_known(self.within["a"][0], self._passes))
            branches = (self._branch(piece.middle.solution, free, shown) for piece in new)
        looked_at = bool(pieces)
        for branch in branches:
            looked_at = True
            for point in branch.special:
                if point.kind in KINDS and point.located and self._begins(point):
                    self._follow(point, shown)
                    if self.kept:
                        self.kept.look(True, self.so_far)
        return looked_at

    def _row(self, at: Mapping[str, float]) -> list[RowPiece] | None:
        """Row of upper breathers at these two parameters, None where they have no closed forms."""
        closed = self.pair[1] == "a" and self.model["lattice"].sites is None
        if not closed or self.past_folds or "omega" in (*self.pair, *self.held):
            return None
        # beyond there the far field is behind its walls
        largest = min(self.within["a"][1], BEYOND / self.model["forcing"].peak())
        try:
            breather, *_ = symmetric_roots(largest, at["gamma"], at["k"], **self.model)
        except NoSolution:
            return []
        problem = self._problem(breather)
        assert self.events is not None  # those of any problem
        pieces = row_pieces(problem, self.events, self.within["a"][0], largest)
        return sorted(pieces, key=lambda piece: piece.z[-1, 2])  # a falls along each

    def _passes(self, kind: str, place: Place, but: Branch | None = None) -> bool:
        curves = (b for b in self.curves[kind] if b is not but)
        return any(_on_curve(b, place, self.pair, SAME) for b in curves)

    def _begins(self, point: Point) -> bool:
        """Test whether its boundary begins there. At gamma = 0 a pitchfork has no null vector of
        its own where idle sites are held by their neighbours alone: the curve comes from a scan
        beside."""
        if point.kind != "PF" or point.event is None or point.event.locus is None:
            return True
        least, _ = point.event.locus(point.base_point).domain.get("gamma", (0.0, math.inf))
        # where gamma is fixed at 0 there is nothing beside: `boundary` refuses it
        return bool(point["gamma"] >= least) or self.name == "gamma"

    def _problem(self, breather: Orbit) -> Problem:
        """Its equations; all have the same events."""
        problem = breather.problem_beyond(self.threshold).having(*self.pair)
        if self.events is None:
            self.events = problem.events
            if self.model.get("damping"):  # without losses nearly all pairs follow the first
                pairs = neimark_sacker(threshold=self.threshold, every=True).of(problem)
                self.events = tuple(pairs if e.kind == "NS" else e for e in self.events)
            if not self.past_folds:
                self.events = tuple(map(up_to_the_fold, self.events))
        return problem

    def _branches(self, at: Mapping[str, float], free: str, shown: Counter) -> Iterator[Branch]:
        """Branches of admissible breathers in one parameter at one value of the other."""
        passed = list[Branch]()
        for y in (*self._comb(free, at.get("omega")), *self._next_to_folds(at, free)):
            for breather in admissible_roots({**at, free: y}, **self.model):
                if not self.past_folds and breather.representation.family != "upper":
                    continue  # beyond the fold that ends the diagram
                place = {free: y, "p": breather.p, "phi": breather.phi, "t1": breather.phi}
                # a breather this close to a branch, whose chords are long, is one of it
                if not any(_on_curve(b, place, (free,), 3e-3) for b in passed):
                    passed.append(self._branch(breather, free, shown))
                    yield passed[-1]

    def _branch(self, breather: Orbit, free: str, shown: Counter) -> Branch:
        problem = self._problem(breather)
        return trace(
            problem, free, within={free: self.within[free]}, events=self.events,
            steps=Steps(first=0.02, largest=0.1), progress=shown,
        )  # fmt: skip

    def _comb(self, name: str, omega: float | None = None) -> Iterable[float]:
        """Values inside the window and at its ends, at least nine."""
        window, comb = self.within[name], np.multiply(COMBS[name], self._unit(name, omega)).tolist()
        low, high = max(window[0], comb[0]), min(window[1], comb[-1])
        inside = [value for value in comb if low < value < high]
        if low > high:  # a window beyond the comb
            low, high = window
        values = [low, *inside, high] if len(inside) >= 7 else np.linspace(low, high, 9).tolist()
        return [value for value in values if value > 0 or name != "a"]  # no forcing, no breather

    def _next_to_folds(self, at: Mapping[str, float], free: str) -> list[float]:
        """Amplitudes on both sides of each fold, for sheets that pass between those of the comb."""
        if free != "a" or "omega" in at:
            return []
        low, high = self.within["a"]
        if "damping" in self.model:
            how: dict[str, Any] = {**at, **self.model}
            try:
                breather, *_ = symmetric_roots(max(self._comb("a")), **how)
            except NoSolution:  # nor at any smaller amplitude
                return []
            amplitudes = symmetric_folds(breather)
        else:
            amplitudes = folds(at["gamma"], at["k"], **self.model)
        beside = [factor * a for a in amplitudes for factor in (0.999, 1.001)]
        return [a for a in beside if low <= a <= high]

    def _follow(self, point: Point, shown: Counter) -> None:
        """Trace an event as a boundary unless it is on one, and what takes over at its ends."""
        waiting: list[tuple[Point, Branch | None]] = [(point, None)]
        while waiting:
            point, since = waiting.pop()
            kind = _followed(point)
            # where the impact has lost its velocity there is no event of an impacting breather
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


def _followed(point: Point) -> str:
    """The kind of the curve that leads on from a special point."""
    event = point.event
    if event is None:
        return point.kind
    return event.base.kind if isinstance(event, CodimensionTwo) else event.kind


def up_to_the_fold(event: Event) -> Event:
    """A fold ends the zone: what lies behind it is the other breather."""
    return replace(event, ends="branch") if event.kind == "LP" else event


def _on_curve(curve: Branch, place: Place, pair: Sequence[str], near: float) -> bool:
    # p and phi tell breathers apart; near k = 1 time reversal makes pairs alike in p. By modes p
    # takes long to say, and follows from the time
    names = (*pair, "p", "phi") if "phi" in curve.names else (*pair, "t1")
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

# Given phi, (11) is linear in 1/a and p/a: a row of the diagram is known without a walk along it.
# Where every event on it lies on a curve that is known nobody has to walk there.


@dataclass(frozen=True, eq=False)
class RowPiece:
    """Admissible breathers that follow each other on a row, with one beyond at either end."""

    middle: Point  # on the curve with free amplitude
    z: Array  # p, phi, a of each
    values: Sequence[tuple[Event, Array, Array]]  # tests and counts, NaN of events without one

    def is_known(self, least: float, known: Known) -> bool:
        """Test whether all events on it, from an amplitude on, lie on known curves."""
        for event, test, count in self.values:
            changes = np.diff(test > 0.0)
            # at a zero a count changes by one: where it says more two are in one step
            counted = np.rint(abs(np.diff(count)))
            differs = (counted != changes) & ~np.isnan(counted)
            if (_may_touch_zero(test, changes) | differs).any():
                return False
            steps = np.flatnonzero(changes).tolist()
            if not all(self._is_on(event, test, step, least, known) for step in steps):
                return False
        return True

    def _is_on(self, event: Event, test: Array, step: int, least: float, known: Known) -> bool:
        """Test if the zero of a test in a step is on a known curve, or below the amplitudes."""

        def place(phi: float) -> Point:
            return Point(self.middle.curve, _at(self.middle.curve, np.array([phi]))[0])

        low, high = self.z[step : step + 2, 1]
        # where the line through two values of the test vanishes, and where the test does
        near = low + test[step] / (test[step] - test[step + 1]) * (high - low)
        if place(near)["a"] < least or known(event.kind, place(near)):
            return True
        # far below `SAME`, as phi weighs
        zero = brentq(lambda phi: event.value(place(phi)), low, high, xtol=1e-5)
        return known(event.kind, place(zero))


def row_pieces(
    problem: Any, events: Sequence[Event], least: float, largest: float
) -> Iterator[RowPiece]:
    """Admissible upper breathers between two amplitudes."""
    curve = Curve(problem, ("a",))
    for low, high in problem.equations.upper_phases(curve.fixed, largest):
        phi = _evenly(curve, low, high, least)
        if not phi.size:
            continue
        z = _at(curve, phi)
        points = Points(curve, z, np.zeros_like(z), *np.zeros((2, len(z))))
        answers = [event.values(points) for event in events]
        tests = np.array([test for test, _ in answers])
        counts = np.array([np.broadcast_to(count, len(z)) for _, count in answers])
        # of upper breathers the test of the fold is positive, too
        ends = [bool(event.ends) for event in events]
        inside = (tests[ends] > 0.0).all(axis=0) & (z[:, 2] >= least)
        changes = np.flatnonzero(np.diff(inside, prepend=False, append=False))
        for first, end in changes.reshape(-1, 2).tolist():
            part = slice(max(first - 1, 0), end + 1)
            values = [*zip(events, tests[:, part], counts[:, part], strict=True)]
            yield RowPiece(Point(curve, z[(first + end) // 2]), z[part], values)


def _evenly(curve: Curve, low: float, high: float, least: float) -> Array:
    """Phases evenly along a row down to an amplitude, and one beyond each fold."""
    # where a is large it changes fast with phi
    # the grid on which its length is measured
    z = _at(curve, low + (high - low) * np.append(0.0, np.geomspace(1e-6, 1.0, 400)))
    z = z[z[:, 0] > 0.0]
    z = z[: np.count_nonzero(z[:, 2] >= least) + 1]  # a falls along it
    if len(z) < 2:
        return np.empty(0)
    length = np.append(0.0, np.linalg.norm(np.diff(z, axis=0), axis=1).cumsum())
    phi = np.interp(np.linspace(0.0, length[-1], 48), length, z[:, 1])
    ends = 2.0 * phi[[0, -1]] - phi[[1, -2]]  # a step beyond both
    before, after = _at(curve, ends)[:, 2]
    # the first is a fold, too, where a falls before it; beyond a pole it is negative
    first = ends[:1] if 0.0 < before < z[0, 2] else ends[:0]
    return np.concatenate([first, phi, ends[1:] if after > 0.0 else ends[:0]])


def _at(curve: Curve, phi: Array) -> Array:
    return np.asarray(curve.problem.equations.at_phases(phi, curve.fixed))


def _may_touch_zero(test: Array, changes: Marked) -> Marked:
    """Steps within which a test may come to zero and back, or has no value."""
    falls = np.append(True, test[1:] * (2.0 * test[1:] - test[:-1]) < 0.0)
    rises = np.append(test[:-1] * (2.0 * test[:-1] - test[1:]) < 0.0, True)
    return (~changes & falls[:-1] & rises[1:]) | np.isnan(np.diff(test))
