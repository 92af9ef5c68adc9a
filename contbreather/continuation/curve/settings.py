"""What is asked of a walk: its windows, its events with their columns, its steps."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from numbers import Integral
from typing import Self

from ...checks import brief, flag, real
from ...errors import BadInput
from .point import Event, Point
from .problem import Problem

Within = Mapping[str, tuple[float, float]]

MARGIN = "margin"  # the column that tells, where walls are lifted, how far off they are
_LIFTED = ", walls lifted"
_ROUNDING = 1e-13  # corrections shorter than this, relative to 1 + |z|, may be rounding


@dataclass(frozen=True)
class Steps:
    """Sizes that govern one walk along a curve.

    Parameters
    ----------
    first : float
        Arclength of the first step, if `largest` allows it.
    smallest : float
        A step that would have to be shorter ends the branch, with the reason.
    largest : float, optional
        No step is longer. By default 0.1, or a hundredth of the size of z where that is more:
        where unknowns are counted in hundreds, so are their changes.
    most : int
        Number of steps after which the branch ends, in each direction.
    tolerance : float
        A Newton iteration has converged when its last correction is at most
        ``tolerance * (1 + |z|)``; being quadratic it is then far more exact than that. At least
        1e-13: shorter corrections are rounding.
    growth : float
        A step is at most this many times its predecessor.

    Examples
    --------
    >>> Steps(largest=0.01).growth
    1.5
    """

    first: float = 0.01
    smallest: float = 1e-9
    largest: float | None = None
    most: int = 2000
    tolerance: float = 1e-9
    growth: float = 1.5

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if name == "largest" and value is None:
                continue
            size = real(value)
            if math.isnan(size) and not isinstance(value, float):
                raise BadInput(f"{name} must be a number, got {brief(value)}")
            if name != "most" and not 0 < size < math.inf:
                raise BadInput(f"{name} must be finite and positive, got {brief(value)}")
        largest = self.largest or 0.1
        if not self.smallest <= min(self.first, largest):
            raise BadInput(
                f"no step may be shorter than smallest = {self.smallest:g}, "
                f"got first = {self.first:g} and largest = {largest:g}"
            )
        if self.growth <= 1:
            raise BadInput(f"growth must exceed 1, got {self.growth:g}")
        if self.tolerance < _ROUNDING:
            raise BadInput(
                f"a tolerance below {_ROUNDING:g} is lost in rounding, got {self.tolerance:g}"
            )
        if not issubclass(type(self.most), Integral) or self.most < 1:
            raise BadInput(f"most must be a whole number, at least 1 step, got {self.most}")


@dataclass(frozen=True)
class Settings:
    """Arguments of a walk, as of `trace`; of a boundary as of `boundary`."""

    within: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    events: tuple[Event, ...] | None = None
    steps: Steps = field(default_factory=Steps)
    inadmissible: bool = False

    @classmethod
    def of(
        cls, within: Within | None, events: Event | Iterable[Event] | None, steps: Steps | None,
        inadmissible: bool, usual: Steps | None = None,
    ) -> Self:  # fmt: skip
        """Check what a user asks of a walk: behind this nothing asks again."""
        lifted, window, listed = flag("inadmissible", inadmissible), windows(within), all_of(events)
        if not (steps is None or isinstance(steps, Steps)):
            raise BadInput(
                f"steps must be given as Steps(most=..., largest=...), got {brief(steps)}"
            )
        return cls(window, listed, steps or usual or Steps(), lifted)


# --- windows ----------------------------------------------------------------------------------


def windows(within: Within | None) -> dict[str, tuple[float, float]]:
    if within is None:
        return {}
    if not isinstance(within, Mapping) or not all(isinstance(name, str) for name in within):
        raise BadInput(
            f"within={within!r}: windows by name were expected, for instance {{'a': (0.0, 1.0)}}"
        )
    pairs = {}
    for name, window in within.items():
        try:
            low, high = map(real, window)
        except (TypeError, ValueError):
            low = high = math.nan
        if math.isnan(low) or math.isnan(high):
            raise BadInput(
                f"the window of {name!r} must be a pair (low, high) of numbers, got {window!r}; "
                "infinity leaves a side open"
            )
        pairs[name] = low, high
    return pairs


# --- events, walls and columns ----------------------------------------------------------------


def all_of(events: Event | Iterable[Event] | None) -> tuple[Event, ...] | None:
    if events is None:
        return None
    try:
        several = (events,) if isinstance(events, Event | str) else tuple(events)
    except TypeError as error:
        raise BadInput(f"an Event was expected, fold() for instance, got {events!r}") from error
    for event in several:
        if not isinstance(event, Event):
            raise BadInput(f"an Event was expected, fold() for instance, got {event!r}")
    return several


def active_events(
    problem: Problem, events: tuple[Event, ...] | None, *, inadmissible: bool = False
) -> tuple[Problem, tuple[Event, ...]]:
    """The problem with its columns, and all events to look for on its curve.

    Events that are asked for come on top of the walls of the problem, its events beyond which
    solutions mean nothing; only `inadmissible` lifts these.
    """
    # one that is given twice, as beside those of the problem, is looked for once
    asked = tuple({id(e): e for e in (event.of(problem) for event in events or ())}.values())
    problem = _lifted(problem) if inadmissible else problem
    for event in asked:
        if event.record:
            # what its columns are about stands in the label
            plain = problem.label.removesuffix(_LIFTED)
            about = f" ({event.about})" if event.about else ""
            label = plain.partition(" (")[0] + about + problem.label[len(plain) :]
            problem = replace(problem, record={**problem.record, **event.record}, label=label)
    wanted = active = problem.events
    if events is not None:
        kinds = [event.kind for event in asked]
        walls = (e for e in problem.events if e.ends == "domain" and e.kind not in kinds)
        wanted, active = asked, (*asked, *walls)
    columns, taken = {**problem.record}, {*problem.names, *problem.record}
    for event in wanted:
        for name, column in event.columns(problem).items():
            if name not in taken:
                columns[name] = column
    if len(columns) > len(problem.record):
        problem = replace(problem, record=columns)
    return problem, active


def walls_are_lifted(problem: Problem) -> bool:
    """Tell whether points of this problem may lie beyond its walls."""
    return MARGIN in problem.record


def having(problem: Problem, *names: str) -> Problem:
    """The problem with these parameters among its own, as far as it can have them."""
    wider = problem.having(*names)
    # a boundary is made anew with what its base problem has, walls or none
    if wider is problem or problem.beneath is not None or not walls_are_lifted(problem):
        return wider
    return _lifted(wider)


def titled(title: str, problem: Problem) -> str:
    """A title with what the columns of a problem are about, and lifted walls."""
    _, bracket, remark = problem.label.partition(" (")
    return title + (bracket + remark or _LIFTED * walls_are_lifted(problem))


def _lifted(problem: Problem) -> Problem:
    walls = [event for event in problem.events if event.ends == "domain"]
    if not walls:
        return problem
    return replace(
        problem,
        events=tuple(event for event in problem.events if event.ends != "domain"),
        record={**problem.record, MARGIN: partial(_margin, tuple(walls))},
        label=problem.label + _LIFTED,
    )


def _margin(walls: tuple[Event, ...], point: Point) -> float:
    return min(float(wall.value(point)) for wall in walls)
