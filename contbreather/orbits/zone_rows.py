"""Rows of a zone diagram in closed form: all breathers at one coupling, and the events on them.

Given phi, (11) is linear in 1/a and p/a. So nobody has to walk along a row to see whether all that
happens on it is on curves that are known already.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contbreather.continuation import Event
from contbreather.continuation.curve import Curve
from contbreather.continuation.points import Points
from contbreather.continuation.samples import measure_many

Array = NDArray[np.float64]
Known = Callable[[Event, Array], bool]  # whether an event at p, phi, a is on a curve that is known

POINTS = 64  # of a row, evenly along it
FIRST = 1e-6  # of its phases, the first step of the grid on which its length is measured
ROUNDS = 6  # of false position and bisection, until it is seen which curve an event is on


@dataclass(frozen=True, eq=False)
class Row:
    """Breathers from the largest amplitude to a fold, and one beyond it.

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
        z, none = curve.problem.closure.at_phases(phi, curve.fixed), np.zeros(phi.size)
        points = Points(curve, z, np.zeros_like(z), none, none)
        asked = [answer for event in events if (answer := measure_many(event, points))]
        tests = np.array([test for test, _ in asked])
        if len(asked) < len(events) or not np.isfinite(tests).all():
            return None
        return cls(curve, events, z, tests, [count for _, count in asked])

    def known(self, least: float, known: Known) -> tuple[list[Array], Array]:
        """Pieces of admissible breathers of at least an amplitude all of whose events are known, as
        p, phi, a of breathers and events in order; and steps on which others may be."""
        ends = [event.ends_domain for event in self.events]
        inside = (self.tests[ends] > 0.0).all(axis=0) & (self.z[:, 2] >= least)
        pieces, unknown = [], inside[:-1] | inside[1:]
        changes = np.flatnonzero(np.diff(inside, prepend=False, append=False))
        for first, end in changes.reshape(-1, 2).tolist():
            # what ends a piece is in the steps to its neighbours
            steps = slice(max(first - 1, 0), min(end, unknown.size))
            places = self._places(steps, known) if self._is_resolved(steps) else None
            if places is not None:
                unknown[first : end - 1] = False
                z = np.vstack([self.z[first:end], *places])
                pieces.append(z[np.argsort(z[:, 1])])
        return pieces, unknown

    def _is_resolved(self, steps: slice) -> bool:
        """Whether no event can be on these steps but those that change a sign."""
        for i, (test, count) in enumerate(zip(self.tests, self.counts, strict=True)):
            if _dips(test)[steps].any():
                return False
            # at a zero a count changes by one; where it says more the test is looked at closely
            jumps = [] if count is None else np.flatnonzero(abs(np.diff(count)) != _changes(test))
            for step in (j for j in jumps if steps.start <= j < steps.stop):
                closer = Row.of(self.curve, self.events, np.linspace(*self.z[step : step + 2, 1], 17))
                if closer is None or (_changes(closer.tests[i]) | _dips(closer.tests[i])).any():
                    return False
        return True

    def _places(self, steps: slice, known: Known) -> list[Array] | None:
        """Where tests change sign, if each does so on a curve that is known; else None."""
        which, step = np.nonzero(_changes(self.tests)[:, steps])
        step += steps.start
        low, high = self.z[step, 1], self.z[step + 1, 1]
        before, after = self.tests[which, step], self.tests[which, step + 1]
        places: list[Array] = []
        for number in range(ROUNDS):
            if not which.size:
                return places
            part = np.clip(before / (before - after), 0.02, 0.98) if number % 2 == 0 else 0.5
            middle = low + part * (high - low)
            row = Row.of(self.curve, self.events, middle)
            if row is None:
                return None
            on = np.array([known(self.events[i], z) for i, z in zip(which, row.z, strict=True)])
            places += list(row.z[on])
            test = row.tests[which, np.arange(which.size)]
            same = (test > 0.0) == (before > 0.0)
            low, before = np.where(same, [middle, test], [low, before])
            high, after = np.where(same, [high, after], [middle, test])
            left = which, low, high, before, after
            which, low, high, before, after = (entries[~on] for entries in left)
        return None


def _changes(test: Array) -> Array:
    return np.diff(test > 0.0)


def _dips(test: Array) -> Array:
    """Steps within which a test may come to zero and back: on both sides a line through two values
    leads there."""
    falls = np.append(True, test[1:] * (2.0 * test[1:] - test[:-1]) < 0.0)
    rises = np.append(test[:-1] * (2.0 * test[:-1] - test[1:]) < 0.0, True)
    return ~_changes(test) & falls[:-1] & rises[1:]


def rows(problem: Any, events: Sequence[Event], largest: float) -> list[Row] | None:
    """One for each fold, of amplitudes up to the largest; None where they have no closed form."""
    curve, closed = Curve(problem, ("a",)), []
    for low, high in problem.closure.upper_phases(curve.fixed, largest):
        # where a is large it changes fast with phi
        phi = low + (high - low) * np.append(0.0, np.geomspace(FIRST, 1.0, 400))
        z = problem.closure.at_phases(phi, curve.fixed)
        z = z[z[:, 0] > 0.0]
        if len(z) < 2:
            continue
        length = np.append(0.0, np.linalg.norm(np.diff(z, axis=0), axis=1).cumsum())
        phi = np.interp(np.linspace(0.0, length[-1], POINTS), length, z[:, 1])
        closed.append(Row.of(curve, events, np.append(phi, 2.0 * phi[-1] - phi[-2])))
    return None if None in closed else closed
