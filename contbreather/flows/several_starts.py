"""Cycles from several starts: which orbits there are, each once, and what other starts do."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..checks import brief
from ..continuation.curve.problem import Problem
from ..errors import BadInput, NotConverged, partial_result
from ..tables import HtmlRepr, Sheet
from .cycle_constructors import cycle
from .cycle_problem import Cycle, cycle_of

_EQUAL = 1e-6  # periods and extents, relative: two orbits that differ less are one, shifted in time


@dataclass(frozen=True)
class FoundCycle(HtmlRepr):
    """One of the orbits that starts lead to, or what is there in its place.

    Attributes
    ----------
    starts : tuple
        Those that lead there.
    problem : Problem or None
        To be traced; None where no orbit was found.
    said : str
        Why none was; empty for an orbit.
    """

    starts: tuple[Any, ...]
    problem: Problem | None
    said: str = ""

    @property
    def orbit(self) -> Cycle | None:
        return None if self.problem is None else cycle_of(self.problem)

    def table(self) -> Sheet:
        """The starts, and the orbit with its stability or what was said."""
        rows: list[tuple[str, Any]] = [("starts", brief(self.starts)), ("none", self.said or None)]
        if (orbit := self.orbit) is not None:
            rows += [("period", orbit.period), ("unstable", orbit.unstable)]
            rows += [(f"max({name})", value) for name, value in orbit.max.items()]
        return Sheet.of(rows)


def cycles(
    flows: Any, starts: Iterable[Any], params: Mapping[str, float], **how: Any
) -> tuple[FoundCycle, ...]:
    """Say which periodic orbits several starts lead to, each once, and what the others do.

    Parameters
    ----------
    flows, params
        As for `cycle`.
    starts : iterable
        Of what `cycle` takes as a start.
    **how
        What else `cycle` takes, `settle` above all.

    Returns
    -------
    tuple of FoundCycle
        Orbits in the order in which they were found, then what starts without one say.

    Raises
    ------
    BadInput
        Where `cycle` refuses functions or names, or there is no start.

    Examples
    --------
    >>> well = lambda t, x, p: [x[1], p["a"] * np.cos(t) - 0.2 * x[1] + x[0] - x[0] ** 3]
    >>> starts = [{"x": x, "v": 0.0} for x in (-1.0, -0.8, 1.0)]
    >>> found = cycles(well, starts, {"a": 0.1}, period=2 * np.pi, settle=100)
    >>> [(len(each.starts), round(each.orbit.max["x"], 4)) for each in found]
    [(2, -0.8996), (1, 1.0994)]
    """
    if isinstance(starts, Mapping):
        raise BadInput("several starts are a list, [{'x': 1.0}, {'x': 2.0}]; one is for cb.cycle")
    found: list[FoundCycle] = []
    none: list[FoundCycle] = []
    with partial_result(lambda: (*found, *none)):
        for start in starts:
            try:
                problem = cycle(flows, start, params, **how)
            except NotConverged as error:
                _add(none, start, None, str(error))
            else:
                _add(found, start, problem, "")
    if not found and not none:
        raise BadInput("there is no start: a list of what cycle takes was expected")
    return (*found, *none)


def _add(found: list[FoundCycle], start: Any, problem: Problem | None, said: str) -> None:
    """Add a start to the orbit that it leads to, or that one."""
    for i, other in enumerate(found):
        if other.said == said and (problem is None or _alike(other.orbit, cycle_of(problem))):
            found[i] = FoundCycle((*other.starts, start), other.problem, said)
            return
    found.append(FoundCycle((start,), problem, said))


def _alike(one: Any, other: Cycle) -> bool:
    """Compare what does not depend on where an orbit begins."""
    a, b = (np.array([c.period, *c.max.values(), *c.min.values()]) for c in (one, other))
    return bool(abs(a - b).max() <= _EQUAL * abs(a).max())
