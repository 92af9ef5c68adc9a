"""Many branches at once, over the cores: `trace_many`."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from concurrent.futures import Executor
from functools import partial

from ...errors import BadInput
from ...workers import Failed, each
from ..curve.branch import Branch
from ..curve.point import Event
from ..curve.problem import Problem, problem_in
from ..curve.settings import Steps, Within, all_of
from .trace import Startable, trace


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
        trace,
        free=free,
        within=within,
        towards=towards,
        events=all_of(events),
        steps=steps,
        inadmissible=inadmissible,
        progress=False,
    )
    problems = [problem_in(start) for start in starts]
    return each(walk, problems, executor=executor, progress=progress, unit="branches")
