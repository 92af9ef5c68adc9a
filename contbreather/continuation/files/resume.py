"""What is made of a branch: one that goes on where it ended, in memory or from a file of last
month; a finer one; one with more columns."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from contextlib import suppress
from copy import copy
from dataclasses import replace
from itertools import pairwise
from typing import Any, Literal

from ...checks import check_kind, number, one_of, whole
from ...errors import BadInput, add_partial_result
from ...one_thread import one_thread
from ..algebra.newton import Undefined
from ..curve.branch import Branch, Points, Stop, labelled
from ..curve.point import Event, Point
from ..curve.settings import Settings, Steps, Within
from ..events.step_interpolant import StepInterpolant
from ..systems.defining_systems import event_of
from ..walk.checkpoint import Checkpoint, Inner, Save, checkpoint
from ..walk.trace import walk_from
from .branch_from_dict import no_equations

_OVER: dict[Stop | None, str] = {
    Stop.CLOSED: "it is closed: there is nothing beyond",
    Stop.EVENT: "there is nothing to follow beyond the event that ended it",
}


@one_thread
def extend(
    branch: Branch,
    *,
    end: Literal["both", "last", "first"] = "both",
    within: Within | None = None,
    events: Event | Iterable[Event] | None = None,
    steps: Steps | None = None,
    progress: bool | None = None,
    save: Save = None,
) -> Branch:
    """Follow a branch, or boundary, further at its ends.

    Parameters
    ----------
    branch : Branch
        With its equations, `load` says how.
    end : {'both', 'last', 'first'}
        Which end: of both, those beyond which there is something.
    within, events, steps : optional
        As for `trace`; those that the branch was asked for with unless given. A branch that
        ended at the edge of its window needs a wider one.
    progress, save
        As for `trace`.

    Returns
    -------
    Branch
        The old points and the new ones, special points numbered anew; where these come back to
        the other end it is closed.

    Raises
    ------
    BadInput
        If no end can go on, with the reason of each.
    Interrupted
        On Ctrl-C; its ``partial`` is the longer branch as far as it got.

    Examples
    --------
    >>> import contbreather as cb
    >>> short = cb.trace(cb.symmetric(0.7, 0.04, 0.8), "a", within={"a": (0.65, 0.75)})
    >>> longer = cb.extend(short, within={"a": (0.65, 0.8)})
    >>> [point.label for point in longer.special], round(longer.first("PF")["a"], 9)
    (['EP1', 'PF1', 'EP2'], 0.777632426)
    """
    check_kind(branch, Branch, "a Branch")
    one_of("end", end, ("both", "last", "first"))
    if branch.problem.residual is no_equations:
        no_equations()
    if event_of(branch.problem) and events is not None:
        raise BadInput("a boundary goes on with the events it was asked for; leave events out")
    old = branch.settings or Settings()
    settings = Settings.of(
        old.within if within is None else within,
        old.events if events is None else events,
        steps,
        old.inadmissible,
        old.steps,
    )
    done, over = [branch], dict[str, str]()
    with checkpoint(save, "branch", lambda: done[-1]) as file, add_partial_result(done.append):
        for side in ("last", "first") if end == "both" else (end,):
            why = _over(branch, side, settings)
            if why:
                over[side] = why
            elif done[-1].stop is not Stop.CLOSED:
                done.append(_further(done[-1], side, settings, progress, file))
        if len(done) == 1:
            reasons = "; ".join(f"at its {side} point {why}" for side, why in over.items())
            raise BadInput(f"the {branch.problem.label or 'branch'} goes no further: {reasons}")
        if file:
            file.finish(done[-1])
    return done[-1]


def _over(branch: Branch, side: str, settings: Settings) -> str:
    """Say why a branch cannot go on at one end; empty if it can."""
    last = side == "last"
    stop, reason = (branch.stop, branch.reason) if last else (branch.began, branch.began_reason)
    stop, at = Stop.CLOSED if branch.stop is Stop.CLOSED else stop, -1 if last else 0
    if stop in _OVER:
        return _OVER[stop]
    edges = list[str]()
    for name, window in settings.within.items():
        value = float(branch[name][at])
        if any(abs(value - edge) <= 1e-9 * (1.0 + abs(value)) for edge in window):
            walked = branch.settings.within.get(name, window) if branch.settings else window
            was, now = (f"({low:g}, {high:g})" for low, high in (walked, window))
            more = "" if walked == window else f", and {now} was asked for"
            edges.append(f"{name} in {was}, at {name} = {value:g}{more}")
    if stop is Stop.BOUND and (reason or edges):
        return reason or f"it is at the edge of its window, {'; '.join(edges)}: give a wider one"
    return "no direction is known" if branch[at].tangent is None else ""


def _further(
    branch: Branch, side: str, settings: Settings, progress: bool | None, file: Checkpoint | None
) -> Branch:
    line = branch if side == "last" else branch.reversed()
    asked = None if event_of(branch.problem) else settings.events

    def whole(piece: Branch) -> Branch:
        longer = replace(line.join(piece), settings=settings)
        return longer if side == "last" else longer.reversed()

    # the other end may follow: a piece of what is kept
    inner = file and Inner(file, lambda longer: longer)
    longer = walk_from(
        line[-1].problem, branch.free, replace(settings, events=asked), "both",
        line[-1].direction, progress, inner, whole=whole, continues=line,
    )  # fmt: skip
    if longer.stop is not Stop.CLOSED:
        return longer
    made = dict(longer.points.made)
    if (first := line[0]).kind == "EP" and first.parent is None:  # no end any more
        del made[0 if side == "last" else len(longer) - 1]
    points = labelled(replace(longer.points, made=made))
    return replace(longer, points=points, reason="", began=None, began_reason="")


# --- finer, and with more columns ---------------------------------------------------------------


def with_columns(branch: Branch, **columns: Callable[[Point], Any]) -> Branch:
    """Record more columns along a branch, to draw or to save them.

    Parameters
    ----------
    branch : Branch
    **columns : callable
        ``name=function``, with ``function(point)`` the number that is wanted.

    Examples
    --------
    >>> import contbreather as cb
    >>> branch = cb.trace(cb.symmetric(0.5, 0.04, 0.8), "a", within={"a": (0.5, 0.6)})
    >>> more = with_columns(branch, height=lambda point: point.displacement(1, 0.0))
    >>> round(float(more["height"][0]), 9)
    0.552886482
    """
    check_kind(branch, Branch, "a Branch")
    problem, curve = branch.problem, copy(branch.curve)
    curve.problem = replace(problem, record={**problem.record, **columns})

    def remapped(point: Point) -> Point:
        return replace(point, curve=curve)

    made = {i: remapped(point) for i, point in branch.points.made.items()}
    points = replace(branch.points, curve=curve, made=made)
    return replace(branch, points=points, doubtful=tuple(map(remapped, branch.doubtful)))


@one_thread
def refined(branch: Branch, fewest: int, *, tolerance: float = 1e-11) -> Branch:
    """Fill a branch in, evenly along it, to at least `fewest` points, as far as Newton's iteration
    finds them; what it had stays.

    Parameters
    ----------
    branch : Branch
    fewest : int
    tolerance : float
        Of Newton's iteration at the new points.

    Examples
    --------
    >>> import numpy as np, contbreather as cb
    >>> circle = cb.Problem(lambda x, p: np.array([x[0]**2 + p["mu"]**2 - 1]),
    ...                     start={"x": 1.0}, params={"mu": 0.0})
    >>> fine = refined(cb.trace(circle, "mu"), 300)
    >>> len(fine) >= 300, bool(abs(fine["residual"]).max() < 1e-14)
    (True, True)
    """
    check_kind(branch, Branch, "a Branch")
    if len(branch) >= whole("fewest", fewest, 1):
        return branch
    tolerance = number("tolerance", tolerance, 0.0, 1.0, "a relative size")
    spacing = (branch[-1].arclength - branch[0].arclength) / fewest
    points = [branch[0]]
    for first, last in pairwise(branch):
        pieces = math.ceil((last.arclength - first.arclength) / spacing)
        segment = StepInterpolant(first, last, tolerance)
        for i in range(1, pieces):
            with suppress(Undefined):  # left out rather than interpolated
                points.append(segment.at(i / pieces))
        points.append(last)
    return replace(branch, points=Points.of(points))
