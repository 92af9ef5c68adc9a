"""The events asked for on a curve, the walls of its problem, and the columns of both."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from functools import partial

from ..checks import flag
from .point import Event, EventWithRule, Point
from .problem import Problem
from .starts import all_of

MARGIN = "margin"  # the column that tells, where walls are lifted, how far off they are
_LIFTED = ", walls lifted"


def active_events(
    problem: Problem, events: Event | Iterable[Event] | None, *, inadmissible: bool = False
) -> tuple[Problem, tuple[Event, ...]]:
    """The problem with its columns, and all events to look for on its curve.

    Events that are asked for come on top of the walls of the problem, its events beyond which
    solutions mean nothing; only `inadmissible` lifts these.
    """
    listed = all_of(events)
    wanted = None if listed is None else tuple(event.of(problem) for event in listed)
    if flag("inadmissible", inadmissible):
        problem = _lifted(problem)
    if wanted is None:
        return _recording(problem, problem.events), problem.events
    kinds = {event.kind for event in wanted}
    walls = tuple(e for e in problem.events if e.ends_domain and e.kind not in kinds)
    for event in wanted:
        if isinstance(event, EventWithRule):
            problem = _with_rule(problem, event)
    return _recording(problem, wanted), (*wanted, *walls)


def walls_are_lifted(problem: Problem) -> bool:
    """Whether points of this problem may lie beyond its walls."""
    return MARGIN in problem.record


def having(problem: Problem, *names: str) -> Problem:
    """The problem with these parameters among its own, as far as it can have them."""
    wider = problem.having(*names)
    # a boundary is made anew with what its base problem has, walls or none
    base = problem.beneath is None
    return _lifted(wider) if base and walls_are_lifted(problem) else wider


def titled(title: str, problem: Problem) -> str:
    """A title for what is made of a problem: with what its columns are about, and whether its walls
    are lifted."""
    _, bracket, remark = problem.label.partition(" (")
    return title + (bracket + remark or _LIFTED * walls_are_lifted(problem))


def _lifted(problem: Problem) -> Problem:
    walls = [event for event in problem.events if event.ends_domain]
    if not walls:
        return problem
    return replace(
        problem,
        events=tuple(event for event in problem.events if not event.ends_domain),
        record={**problem.record, MARGIN: partial(_margin, tuple(walls))},
        label=problem.label + _LIFTED,
    )


def _margin(walls: tuple[Event, ...], point: Point) -> float:
    return min(float(wall.value(point)) for wall in walls)


def _recording(problem: Problem, events: Iterable[Event]) -> Problem:
    """The problem with the columns that go with its events, as far as it has none of the name."""
    taken = {*problem.names, *problem.record}
    brought = {name: of for event in events for name, of in event.columns(problem).items()}
    new = {name: column for name, column in brought.items() if name not in taken}
    return replace(problem, record={**problem.record, **new}) if new else problem


def _with_rule(problem: Problem, event: EventWithRule) -> Problem:
    """The problem with the columns that an event brings, and what they are about in its label."""
    plain = problem.label.removesuffix(_LIFTED)
    end = problem.label[len(plain) :]
    about = f" ({event.about})" if event.about else ""
    label = plain.partition(" (")[0] + about + end
    return replace(problem, record={**problem.record, **event.record}, label=label)
