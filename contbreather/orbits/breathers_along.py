"""Many symmetric breathers at once: what tests ask of the points of a branch in the amplitude, and
all breathers of one coupling in closed form, with the events on them.

One by one most of the time goes into making them. Here they are one breather with arrays for its
amplitude, momentum and phase. Given phi, (11) is linear in 1/a and p/a: so nobody has to walk along
a row of a zone diagram to see what happens on it, and whether that is on curves that are known.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from contbreather.continuation.curve import Curve
from contbreather.continuation.interpolant import tangent_at
from contbreather.continuation.newton import OUT_OF_DOMAIN
from contbreather.continuation.point import Event, Point
from contbreather.continuation.points import Points
from contbreather.continuation.samples import measure_many
from contbreather.orbits.clearance import least_margins
from contbreather.orbits.orbit import Orbit
from contbreather.orbits.symmetric_breather import saltation
from contbreather.stability.half_period import HalfMap

Array = NDArray[np.float64]
Steps = NDArray[np.bool_]  # which of the steps between neighbours
Known = Callable[[Event, Array], bool]  # whether an event at p, phi, a is on a curve that is known

POINTS = 48  # of a row, evenly along it
FIRST = 1e-6  # of its phases, the first step of the grid on which its length is measured
CLOSER = 17  # places at which a step is looked at closely
ROUNDS = 5  # of that, after which a zero is sharp to rounding
AHEAD = 1e-6  # of phi, which is next to an event
ROUNDED = 1e-12  # phases that differ by less are one


@dataclass(frozen=True, eq=False)
class BreathersAlong:
    """Symmetric breathers of the infinite chain that differ in amplitude and roots alone."""

    first: Orbit
    a: Array
    p: Array
    phi: Array

    @property
    def map(self) -> HalfMap:
        """Theirs, with an array for b."""
        on = self.first.representation
        # (19): b = (1 + k)^2 [a f''(phi) - p eta]/(2p), eta of the coupling alone
        curvature, eta = on.forcing.d2f(self.phi), on.lattice.eta(on.gamma)
        return replace(self.first.map, b=saltation(self.a, on.k, self.p, curvature, eta)[1])

    def margins(self) -> Array:
        """The least margin of each."""
        # (4): a momentum of 2p is lost on the wall +1 at phi, and gained on -1 half a period later
        times = np.stack([self.phi, self.phi + np.pi], axis=1)
        impulses = np.stack([-2.0 * self.p, 2.0 * self.p], axis=1)
        return least_margins(self.first.motion, self.a, times, impulses)


def breathers_along(points: Points) -> BreathersAlong | None:
    """The breathers of points, None where they are no such breathers."""
    breathers: BreathersAlong | None = points.curve.cached(
        "breathers", points.z, lambda z: _breathers(points)
    )
    return breathers


def _breathers(points: Points) -> BreathersAlong | None:
    curve: Any = points.curve
    if curve.free != ("a",) or curve.problem.beneath is not None:
        return None
    first = points[0].solution
    if not (first.symmetric and first.lattice.sites is None and isinstance(first.map, HalfMap)):
        return None
    p, phi, a = np.ascontiguousarray(points.z.T)
    # with p <= 0 the wall +1 would pull at its site
    return BreathersAlong(first, a, p, phi) if (p > 0.0).all() else None


# --- rows of a zone diagram -----------------------------------------------------------------------


class Zero(NamedTuple):
    """Where a test changes sign."""

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
        asked = [answer for event in events if (answer := measure_many(event, points))]
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
            zeros = (
                [zero for zero in self._zeros(steps, known) if zero.z[2] >= least]
                if resolved
                else []
            )
            z = np.vstack([self.z[first:end], *(zero.z for zero in zeros)])
            z = z[np.argsort(z[:, 1])]
            a = self.z[steps.start : steps.stop + 1, 2]
            new = self._new(zeros, self.z[(first + end) // 2, 1]) if resolved else None
            # the zero of a fold is the breather at the fold, but for rounding
            yield RowPiece(a.min(), a.max(), z[np.diff(z[:, 1], prepend=-np.inf) > ROUNDED], new)

    def _is_resolved(self, steps: slice) -> bool:
        """Whether no event can be on these steps but those that change a sign."""
        for event, test, count in zip(self.events, self.tests, self.counts, strict=True):
            if _dips(test)[steps].any():
                return False
            # at a zero a count changes by one; where it says more the test is looked at closely
            passed = _changes(test) if count is None else np.rint(abs(np.diff(count)))
            jumps = _changes(test) != passed
            for step in np.flatnonzero(jumps[steps]) + steps.start:
                _, closer = self._closely(event, self.z[step : step + 2, 1])
                if (_changes(closer) | _dips(closer)).any():
                    return False
        return True

    def _zeros(self, steps: slice, known: Known) -> Iterator[Zero]:
        for i, step in zip(*np.nonzero(_changes(self.tests)[:, steps]), strict=True):
            event, ends = self.events[i], slice(steps.start + step, steps.start + step + 2)
            phi, test = self.z[ends, 1], self.tests[i, ends]
            z, rounds = self._between(phi, test), 0
            while not (is_known := known(event, z)) and rounds < ROUNDS:
                phi, test = self._closely(event, phi)
                change = int(_changes(test).argmax())
                phi, test = phi[change : change + 2], test[change : change + 2]
                z, rounds = self._between(phi, test), rounds + 1
            yield Zero(event, z, is_known)

    def _closely(self, event: Event, ends: Array) -> tuple[Array, Array]:
        """Phases between two, and a test there."""
        phi = np.linspace(ends[0], ends[1], CLOSER)
        row = Row.of(self.curve, (event,), phi)
        assert row is not None  # as all tests say many on the whole row
        return phi, row.tests[0]

    def _between(self, phi: Array, test: Array) -> Array:
        """Where the line through two values of a test vanishes."""
        return _at(self.curve, phi[:1] + test[0] / (test[0] - test[1]) * np.diff(phi))[0]

    def _new(self, zeros: Sequence[Zero], inside: float) -> list[Point] | None:
        """What is not known of the events on a piece, up to what ends it on both sides of a phase
        inside; None where one is not what its kind says."""
        ends = [zero.z[1] for zero in zeros if zero.event.ends]
        low = max((phi for phi in ends if phi < inside), default=-math.inf)
        high = min((phi for phi in ends if phi >= inside), default=math.inf)
        new, number = [], Counter[str]()
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
        tangent, _ = tangent_at(curve, z, (_at(curve, z[1:2] - AHEAD) - z)[0])
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
    z: Array = curve.problem.closure.at_phases(phi, curve.fixed)
    return z


def _changes(test: Array) -> Steps:
    changes: Steps = np.diff(test > 0.0)
    return changes


def _dips(test: Array) -> Steps:
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
        if _at(curve, np.array([before]))[0, 2] < z[0, 2]:  # the first is a fold, too
            phi = np.append(before, phi)
        row = Row.of(curve, events, np.append(phi, after))
        if row is None:
            return None
        closed.append(row)
    return closed
