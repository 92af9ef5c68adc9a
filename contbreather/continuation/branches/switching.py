"""From a point where curves meet, onto the other curves.

Where they set out is what the problem knows (`Problem.lift`), or two tangents tell; following them
is the same walk as ever, along a direction that is given.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, partial
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from ...checks import kind_of
from ...errors import BadInput, NotConverged, add_partial_result
from ...one_thread import one_thread
from ...progress import Counter
from ...tables import Column, HtmlRepr, Sheet
from ..algebra.linear_algebra import LOST, least_singular
from ..algebra.newton import OUT_OF_DOMAIN, Array, Undefined, newton
from ..curve.branch import Branch, Stop, labelled
from ..curve.curve import Curve
from ..curve.kinds import look_of
from ..curve.point import Event, Point
from ..curve.problem import Problem
from ..curve.settings import Settings, Steps, Within, walls_are_lifted
from ..systems.branch_points import GAP
from ..walk.checkpoint import Checkpoint, Inner, Save, checkpoint
from ..walk.trace import walk_from
from .duplicates import images, lies_on

_SINGULAR = 1e-6  # least singular value of balanced equations where curves cross


class Seed(NamedTuple):
    """The start of one arm: its problem, the point z in it, the direction in which it leaves, that
    of the branch it leaves from, which it must not follow, what else its first point knows, and a
    sentence for where events end it within its first step: there is no arm then."""

    problem: Problem
    z: Array
    tangent: Array
    parent: Array | None = None
    detail: Mapping[str, Any] = MappingProxyType({})
    ends_at_once: str = ""


@dataclass(frozen=True)
class SwitchingProblem:
    """A problem in which other curves leave a point, its start and its parameters those of the
    point.

    Where its equations are regular, one curve passes the point and leaves it to both sides. Where
    they lose rank, as a symmetry of a larger problem breaks, the curve that leaves is the one along
    which the free parameter does not change at first.

    Parameters
    ----------
    problem : Problem
        That of the arms: the branch's own, or a larger one that knows both flights of an
        asymmetric breather, or a doubled cycle.
    free : str
        The parameter in which the branch was followed.
    by : sequence of str
        Of these unknowns the first that moves as far as any says which arm comes first: along that
        one it becomes smaller. All of them unless given.
    both : bool
        Whether the two sides are different curves; of a doubled cycle they are one, a period
        apart.

    Examples
    --------
    >>> import numpy as np
    >>> pitchfork = Problem(lambda x, p: np.array([x[0] * (p["mu"] - x[0] ** 2)]),
    ...                     {"x": 0.0}, {"mu": 0.0})
    >>> round(SwitchingProblem(pitchfork, "mu").arm(0.1).params["mu"], 12)
    0.01
    """

    problem: Problem
    free: str
    by: Sequence[str] = ()
    both: bool = True

    @property
    def direction(self) -> Array:
        """Unit vector of the unknowns in which the first arm leaves."""
        tangent = self.tangents[0][:-1]
        return np.asarray(tangent / np.linalg.norm(tangent))

    @cached_property
    def tangents(self) -> tuple[Array, Array | None]:
        """The tangent of the first arm, and that of the branch where it solves the problem, too."""
        curve = Curve(self.problem, (self.free,))
        weak = least_singular(curve.balanced(curve.jacobian(curve.start)))
        plane, along = weak.plane * curve.scales, weak.plane[:, -1]
        if weak.size > _SINGULAR * max(1.0, weak.largest):
            return self._oriented(plane[1], curve), None
        # c1 v1 + c2 v2 of the two null vectors with no component along the parameter; whether there
        # is one to remove they say in the scales of the unknowns, where they are unit vectors
        if not np.linalg.norm(along) > LOST:
            raise Undefined("the parameter changes along no curve at first: they fold there")
        return self._oriented(along[1] * plane[0] - along[0] * plane[1], curve), along @ plane

    def _oriented(self, tangent: Array, curve: Curve) -> Array:
        slots = [curve.slots[name] for name in self.by or self.problem.start]
        moved = np.concatenate([np.atleast_1d(tangent[slot]) for slot in slots])
        # of entries that are equal but for rounding the first
        first = moved[int((abs(moved) >= 0.999 * abs(moved).max()).argmax())]
        return np.asarray(-math.copysign(1.0, first) * tangent)

    def seeds(self) -> tuple[Seed, ...]:
        (tangent, parent), z = self.tangents, Curve(self.problem, (self.free,)).start
        sides = (1.0, -1.0) if self.both else (1.0,)
        return tuple(Seed(self.problem, z, side * tangent, parent) for side in sides)

    def arm(self, amplitude: float = 0.01, free: str | None = None) -> Problem:
        """The problem started on an arm, at a distance along `direction`; its sign chooses the arm,
        and `free` is the parameter that gives way.

        Raises
        ------
        NotConverged
            If there is not a solution at this amplitude: try another one.
        """
        curve = Curve(self.problem, (free or self.free,))
        # v . (x - x0) = amplitude, and the parameter gives way: regular on the arms of a pitchfork
        row = np.append(self.direction, 0.0)
        guess = curve.start + amplitude * row
        curve.metric = np.ones(guess.size)  # as exact as a start, whatever the scales
        residual, why = math.nan, ""
        try:
            solution = newton(curve, guess, row, tolerance=1e-11, most=20)
            if solution.converged:
                return Point(curve, solution.z).problem
            residual, why = solution.residual, f"residual {solution.residual:.3g}"
        except Undefined as error:
            why = str(error)
        raise NotConverged(
            f"no orbit at the amplitude {amplitude:g} ({self.problem.label}): {why}; try a "
            "smaller one.",
            residual=residual,
        )


def across(point: Point) -> tuple[Seed, ...]:
    """Seeds in both directions of the curve that crosses the one the point was found on."""
    if "tangents" not in point.detail:
        raise Undefined("no directions are known here: other curves set out where curves cross")
    curve, z, along = point.curve, point.z, point.direction
    row = curve.metric * along
    other = min(point.detail["tangents"], key=lambda tangent: abs(float(tangent.dot(row))))
    # the leading unknown of a tangent grows along it: first where it falls
    ways = (leaving(curve, z, side * other, along) for side in (-1, 1))
    return tuple(Seed(point.problem, z, way, along) for way in ways)


def leaving(curve: Curve, z: Array, way: Array, parent: Array) -> Array:
    """Tangent of what leaves a curve to one side: `way` but for a share of `parent`, the tangent of
    that curve.

    Equations may have a kink there, as where impacts at once come apart, in another order on either
    side. On the side of `way` they are smooth, ``way + c parent`` solves them to second order if
    ``w H_zz (way + c parent)^2 = 0``, and along the parent alone this vanishes. Without a kink
    there is no such share.
    """
    weak = least_singular(curve.balanced(curve.jacobian(z)))
    try:
        change = curve.along(z, way, ahead=True)
    except Undefined:  # at the edge of a domain: there is nothing on that side
        return way
    row = weak.left @ curve.balanced(change) / curve.scales
    turn = float(row @ parent)
    if not turn:
        raise Undefined("to second order nothing tells it from the curve it is to leave")
    return np.asarray(way - 0.5 * float(row @ way) / turn * parent)


# --- following them ----------------------------------------------------------------------------


class NothingToSwitch(BadInput):
    """No other curve leaves the point; `point` is what was given."""

    def __init__(self, message: str, point: Point) -> None:
        super().__init__(message)
        self.point = point


class ArmsCoincide(NotConverged):
    """An arm is not a new curve: `arm` is what was walked, `other` the branch or direction it
    follows, `distance` how far apart they are after the first step, relative to it."""

    def __init__(self, message: str, arm: Branch, other: Any, distance: float) -> None:
        super().__init__(message, residual=distance)
        self.arm = arm
        self.other = other
        self.distance = distance


class Branches(tuple[Branch, ...], HtmlRepr):
    """Several branches that belong together: a tuple that notebooks show."""

    __slots__ = ()

    def table(self) -> Sheet:
        """A line for each, with its special points."""
        labels = [", ".join(point.label for point in branch.special) for branch in self]
        what = [branch.describe() for branch in self]
        columns = [Column("", list(range(len(self)))), Column("branch", what)]
        return Sheet([*columns, Column("points", labels)])


@one_thread
def switch(
    point: Point,
    *,
    within: Within | None = None,
    events: Event | Iterable[Event] | None = None,
    steps: Steps | None = None,
    progress: bool | Counter | None = None,
    save: Save = None,
) -> Branches:
    """Follow all other curves that leave a point where curves meet.

    Parameters
    ----------
    point : Point
        A special point of a branch from which others leave: a BP of any problem, the PF, PD, GR, VI
        and CC of breathers, the PD, GR, VI and SL of cycles, the PD of a map.
    within, events, steps, progress, save
        As for `trace`. The arms are walked in the parameter of the branch the point is on, and look
        for what that branch did; one whose problem has other events looks for these by default.
        Where the walls of that branch are lifted, those of the arms are.

    Returns
    -------
    tuple of Branch
        One for each arm, both directions of a crossing curve apart. The first point of each is the
        point itself, in the problem of the arm, with ``arm[0].parent`` the point on the branch it
        left. A curve that comes back to the point is there once. An arm that is the image of an
        earlier one under a symmetry of its problem says so: ``arm.image_of`` is the place of that
        one in the tuple.

    Raises
    ------
    NothingToSwitch
        If no other curve leaves the point; a `BadInput`, its ``point`` is the point.
    ArmsCoincide
        If an arm turns out to be the branch it was to leave, or another arm; a `NotConverged`.
    NotConverged
        If no first step can be made along an arm.
    Interrupted
        On Ctrl-C; its ``partial`` is a tuple of the arms there are, the last perhaps cut short.

    Examples
    --------
    The arms of a pitchfork, ``x = +- sqrt(mu)``:

    >>> import contbreather as cb, numpy as np
    >>> mine = cb.Problem(lambda x, p: np.array([x[0] * (p["mu"] - x[0]**2)]),
    ...                   start={"x": 0.0}, params={"mu": -1.0})
    >>> axis = cb.trace(mine, "mu", events=[cb.branch_point()], within={"mu": (-1, 1)})
    >>> arms = switch(axis.first("BP"), within={"mu": (-1, 1)})
    >>> [(arm[0]["mu"], round(arm[-1]["x"], 12)) for arm in arms]
    [(0.0, -1.0), (0.0, 1.0)]
    """
    if not isinstance(point, Point):
        raise BadInput(
            f"switch takes a special point of a branch, branch.first('PF') for instance; got "
            f"{kind_of(point)}"
        )
    settings = Settings.of(within, events, steps, False)
    arms: list[Branch] = []
    with checkpoint(save, "arm", lambda: tuple(arms) or None) as kept:
        inner = kept and Inner(kept, lambda arm: (*arms, arm))
        for seed in seeds_at(point):
            if any(comes_back(arm, seed) for arm in arms):
                continue
            here, there = point.curve.problem, seed.problem
            same = there.residual is here.residual or there.events == here.events
            asked = point.curve.asked if settings.events is None and same else settings.events
            with add_partial_result(arms.append):
                arm = follow(point, seed, replace(settings, events=asked), progress, inner)
            _refuse_twins(arm, arms)
            moved = [*images(arm[1])] if len(arm) > 1 else []
            known = (i for i, other in enumerate(arms) if any(lies_on(at, other) for at in moved))
            arms.append(replace(arm, image_of=next(known, None)))
        if kept:
            kept.finish(tuple(arms))
    return Branches(arms)


def branches_leave(point: Point) -> bool:
    """Tell whether other branches are known to leave points of its kind."""
    event = point.event
    return event is not None and (event.crosses or point.curve.problem.lift(point.kind) is not None)


def seeds_at(point: Point) -> tuple[Seed, ...]:
    """Find where curves set out from a point, or say why none do."""
    why = ""
    if point.parent is not None:
        why = " is where this arm sets out; switch at the point of the branch it left, its `parent`"
    elif point.event is None and point.kind not in ("", "EP", "MX"):
        why = " was loaded without its equations; load(path, problem=...) attaches them"
    elif point.event is None:
        what = "where a branch ends" if point.kind else "not a special point"
        why = f" is {what}; switch at a BP, PF, PD, GR or VI of a branch"
        if point.base_point is not point:
            why += f", as of cb.trace(point.base_point, {point.curve.free[0]!r}), through it"
    elif not branches_leave(point):
        reason = look_of(point.kind).nothing_leaves
        more = f"; {reason}" if reason else ""
        why = f": no other branch is known to leave points of kind {point.kind}{more}"
    elif not point.located:
        reason = point.detail.get("reason", "no reason kept")
        why = f" was seen, not located ({reason}): where others would leave it is not known"
    if why:
        raise NothingToSwitch(f"{point!r}{why}", point)
    lift = point.curve.problem.lift(point.kind)
    try:
        if lift is None:
            return across(point)
        return lift(point).seeds()
    except OUT_OF_DOMAIN as error:
        raise NothingToSwitch(f"{point!r}: {error}", point) from error


def follow(
    point: Point,
    seed: Seed,
    settings: Settings,
    progress: bool | Counter | None = None,
    save: Checkpoint | None = None,
) -> Branch:
    """One arm from a point, which is its first; without the walls that its branch is without."""
    free, lifted = point.curve.free[0], walls_are_lifted(point.curve.problem)
    start = Point(Curve(seed.problem, (free,)), seed.z.copy()).problem
    arm = walk_from(
        start, free, replace(settings, inadmissible=lifted), "both", seed.tangent, progress, save,
        whole=partial(_with_parent, point=point, seed=seed), crosses=seed.parent is not None,
    )  # fmt: skip
    if len(arm) == 1 and arm.stop.failed:
        raise NotConverged(
            f"no step can be made along an arm of {point!r}: {arm.stop.value}; {arm.reason}",
            residual=arm[0].residual,
        )
    within_a_step = all(point.kind for point in arm)  # nothing but what was located on it
    if within_a_step and arm.stop is Stop.EVENT and seed.ends_at_once:
        why = BadInput(seed.ends_at_once)
        raise NothingToSwitch(f"{point!r}: {why}", point) from why
    _refuse_parent(arm, seed, point)
    return arm


def _with_parent(arm: Branch, point: Point, seed: Seed) -> Branch:
    """The arm with the point as its first; what else was seen there belongs to the point."""
    first = next((p.arclength for p in arm if p.arclength > 0 and not p.kind), arm[-1].arclength)
    reach = min(GAP * (1 + arm[0].curve.length(arm[0].z)), 0.5 * first)  # one place with the point
    end = arm[-1].arclength - reach if arm.stop is Stop.CLOSED else math.inf
    made = {"kind": "EP", "detail": {**seed.detail}, "parent": point}
    start = replace(arm[0], event=None, bracket=None, **made)
    rest = tuple(p for p in arm.points if p.arclength > reach)
    return replace(
        arm,
        points=labelled((start, *rest)),
        began=Stop.EVENT,
        doubtful=tuple(p for p in arm.doubtful if reach < p.arclength < end),
        origin=point,
    )


def _refuse_parent(arm: Branch, seed: Seed, point: Point) -> None:
    """Refuse an arm whose first step goes along the branch it was to leave."""
    curve = arm.curve
    if seed.parent is None or len(arm) < 2 or curve.start.shape != seed.z.shape:
        return  # a finer problem has other unknowns
    step = arm[1].z - arm[0].z
    chord, away, parent = map(curve.normalised, (step, seed.tangent, seed.parent))

    def aside(direction: Array, line: Array) -> float:  # |d - (d . W l) l|
        return curve.length(direction - float(direction @ (curve.metric * line)) * line)

    if (distance := aside(chord, parent)) < aside(chord, away):
        # both curves may bend alike, by more than they come apart: is the branch itself nearer?
        row = curve.metric * parent
        with suppress(Undefined):
            beside = newton(curve, arm[0].z + float(row @ step) * parent, row)
            apart = 2 * curve.length(beside.z - arm[1].z) / curve.length(step)
            if beside.converged and apart > aside(away, parent):
                return
        raise ArmsCoincide(
            f"an arm of {point!r} follows the branch it was to leave: their directions differ by "
            f"{distance:.2g}, {aside(away, parent):.2g} apart as they were given",
            arm, seed.parent, distance,
        )  # fmt: skip


def _refuse_twins(arm: Branch, others: Sequence[Branch]) -> None:
    """Refuse an arm that follows another of the same point."""
    for other in others:
        if len(arm) < 2 or len(other) < 2 or arm.curve.slots != other.curve.slots:
            continue
        curve = arm.curve
        reach = curve.length(arm[1].z - arm[0].z)
        distance = curve.length(arm[1].z - other[1].z) / max(reach, 1e-300)
        if distance < 1e-3:
            raise ArmsCoincide(
                f"two arms of {arm[0].parent!r} coincide: after the first step, "
                f"{reach:.2g}, they are {distance * reach:.2g} apart",
                arm, other, distance,
            )  # fmt: skip


def comes_back(arm: Branch, seed: Seed) -> bool:
    """Tell whether an arm that has been walked came back to its start along another seed."""
    start, curve = arm[0], arm.curve
    if arm.stop is not Stop.CLOSED or seed.z.shape != start.z.shape:
        return False
    way = curve.metric * curve.normalised(seed.tangent)
    return bool(np.allclose(seed.z, start.z) and start.direction @ way < -0.5)
