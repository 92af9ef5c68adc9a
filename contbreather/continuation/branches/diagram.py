"""Diagrams that grow by themselves: follow, switch wherever branches meet, and follow again."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence, Sized
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import chain
from typing import TYPE_CHECKING, Any

import numpy as np

from ...checks import flag, whole
from ...columns import Columns, stacked
from ...errors import BadInput, ContbreatherError, NotConverged, add_partial_result
from ...one_thread import one_thread
from ...progress import Counter
from ...storage.serialise import serialised
from ...tables import Column, HtmlRepr, Sheet
from ..curve.branch import Branch, Stop
from ..curve.point import Event, Point
from ..curve.problem import Problem, problem_in
from ..curve.settings import Settings, Steps, Within
from ..walk.checkpoint import Checkpoint, Inner, Save, checkpoint
from ..walk.trace import Startable, walk_from
from .duplicates import duplicate_of, ending_at, same_place, simplest
from .switching import Seed, branches_leave, follow, seeds_at

if TYPE_CHECKING:
    from networkx import MultiDiGraph
    from rich.tree import Tree


@dataclass(frozen=True)
class Place:
    """A special point and the branch it was found on first."""

    branch: int
    point: Point

    @property
    def name(self) -> str:
        return f"branch {self.branch}: {self.point.label}"


@dataclass(frozen=True)
class Bifurcation:
    """Origin of a branch: at which depth, from where, and of which branch it is the image."""

    depth: int
    place: Place | None = None
    image_of: int | None = None


@dataclass(frozen=True)
class Connection:
    """An arm that was not followed: it leads to a branch that is known."""

    place: Place
    branch: int

    def __str__(self) -> str:
        return f"{self.place.name} leads to branch {self.branch}"


@dataclass(frozen=True)
class Failure:
    """An arm that could not be followed, or a place where none sets out, and why."""

    place: Place
    reason: str

    def __str__(self) -> str:
        return f"{self.place.name}: {self.reason}"


@dataclass(frozen=True, eq=False)
class Diagram(Columns, HtmlRepr):
    """Branches, and what was born where.

    Attributes
    ----------
    branches : tuple of Branch
        In the order in which they were followed, the start first.
    births : tuple of Bifurcation
        How each of them came about.
    places : tuple of tuple of Place
        For each branch its special points, in order; a point where branches cross is the same
        `Place` on all of them.
    meetings : tuple of Connection
        Arms that lead to branches known already, and were not followed again.
    failed : tuple of Failure
        Arms that could not be followed.
    left : tuple of Place
        Points that were not switched at: beyond the depth, after as many branches as allowed, or
        after an interruption. Of the last of these some arms may have been followed.
    interrupted : bool
        Whether it was interrupted; what there was by then is kept.
    ends : tuple of Failure
        Where branches end and no other orbit sets out, with what there is instead.
    """

    branches: tuple[Branch, ...]
    births: tuple[Bifurcation, ...]
    places: tuple[tuple[Place, ...], ...]
    meetings: tuple[Connection, ...] = ()
    failed: tuple[Failure, ...] = ()
    left: tuple[Place, ...] = ()
    interrupted: bool = False
    ends: tuple[Failure, ...] = ()

    def __len__(self) -> int:
        return len(self.branches)

    def __iter__(self) -> Iterator[Branch]:
        return iter(self.branches)

    def __getitem__(self, index: int) -> Branch:
        try:
            return self.branches[index]
        except TypeError:
            raise BadInput(
                f"diagram[{index!r}]: the number of a branch was expected, diagram[0]."
                f"first({index!r}) for instance; diagram.special has the points of all branches"
            ) from None

    def columns(self) -> dict[str, Any]:
        """Columns of all branches, which ``branch`` numbers."""
        return stacked(({"branch": i}, branch.columns()) for i, branch in enumerate(self))

    @property
    def special(self) -> tuple[Point, ...]:
        """The special points of all branches; one where branches cross is there once."""
        return tuple(place.point for place in self._distinct().values())

    def first(self, kind: str) -> Point:
        """The first special point of a kind (``"PF"``) on the first branch that has one, or with a
        label (``"PF2"``), which each branch counts for itself."""
        found = next((point for point in self.special if kind in (point.kind, point.label)), None)
        if found is None:
            kinds = sorted({point.kind for point in self.special})
            raise BadInput(f"no {kind!r} on these branches; they have {kinds}")
        return found

    def _distinct(self) -> dict[str, Place]:
        return {place.name: place for row in self.places for place in row}

    @property
    def graph(self) -> MultiDiGraph:
        """Branches and special points as a networkx graph.

        Nodes are branches (their number, with ``branch`` and ``depth``) and special points
        (``"branch 0: PF1"``, with ``point``); ``kind`` is ``"branch"`` or that of the point. Edges
        have a ``relation``: ``"on"`` from a branch to the points on it, ``"born"`` from a point to
        the branches that set out there, ``"known"`` from a point to a branch that was there
        before, ``"image"`` from a branch to its image under a symmetry.
        """
        from networkx import MultiDiGraph

        graph = MultiDiGraph()
        for i, (branch, birth) in enumerate(zip(self.branches, self.births, strict=True)):
            graph.add_node(i, kind="branch", branch=branch, depth=birth.depth)
        for name, place in self._distinct().items():
            graph.add_node(name, kind=place.point.kind, point=place.point)
        for i, row in enumerate(self.places):
            for place in row:
                graph.add_edge(i, place.name, relation="on")
        for i, birth in enumerate(self.births):
            if birth.place is not None:
                graph.add_edge(birth.place.name, i, relation="born")
            if birth.image_of is not None:
                graph.add_edge(birth.image_of, i, relation="image")
        for meeting in self.meetings:
            graph.add_edge(meeting.place.name, meeting.branch, relation="known")
        return graph

    def describe(self) -> str:
        """One sentence: how much there is, and what was left undone."""
        branches, points = _count(self, "branch", "es"), _count(self._distinct(), "special point")
        left = f"{_count(self.left, 'point')} not switched at" if self.left else ""
        failed = f"{_count(self.failed, 'arm')} not followed" if self.failed else ""
        ends = f"{_count(self.ends, 'end')} with no orbit beyond" if self.ends else ""
        end = Stop.INTERRUPTED.value if self.interrupted else ""
        return "; ".join(filter(None, [f"{branches}, {points}", left, failed, ends, end]))

    def __repr__(self) -> str:
        return f"<Diagram {self.describe()}>"

    def table(self) -> Sheet:
        """A line for each branch; in a terminal it is a tree."""
        columns = [
            Column("branch", [str(i) for i in range(len(self))]),
            Column("born at", [birth.place.name if birth.place else "" for birth in self.births]),
            Column("points", [len(branch) for branch in self]),
            Column("special", [" ".join(p.label for p in branch.special) for branch in self]),
            Column("end", [branch.stop.value for branch in self]),
        ]
        return Sheet(columns, self.describe())

    def __rich__(self) -> Tree:
        """Branches as a tree: under each its special points, under each of these what was born."""
        from rich.tree import Tree

        tree = Tree(self.describe())
        for i, birth in enumerate(self.births):
            if birth.place is None:
                self._grow(tree, i)
        return tree

    def _grow(self, tree: Tree, index: int) -> None:
        branch, image = self.branches[index], self.births[index].image_of
        note = "" if image is None else f" (image of branch {image})"
        node = tree.add(f"branch {index}{note}: {branch.describe()}")
        for place in {place.name: place for place in self.places[index]}.values():
            if place.branch != index:
                node.add(f"meets {place.name}")
                continue
            point = place.point
            names = *point.curve.free, *point.curve.problem.start
            values = [(name, point[name]) for name in names]
            numbers = [f"{name} = {value:.8g}" for name, value in values if np.ndim(value) == 0]
            more = ", ..." * (len(numbers) > 5)
            leaf = node.add(f"{point.label}: {', '.join(numbers[:5])}{more}")
            for i, birth in enumerate(self.births):
                if birth.place is not None and birth.place.name == place.name:
                    self._grow(leaf, i)


def _count(things: Sized, name: str, plural: str = "s") -> str:
    return f"{len(things)} {name}{plural * (len(things) != 1)}"


# --- growing ----------------------------------------------------------------------------------


@one_thread
def diagram(
    start: Problem | Startable,
    free: str,
    *,
    within: Within,
    depth: int = 2,
    events: Event | Iterable[Event] | None = None,
    steps: Steps | None = None,
    most: int = 100,
    beyond: bool = False,
    progress: bool | None = None,
    save: Save = None,
) -> Diagram:
    """Follow the branch through a start, switch wherever others leave it, follow these, and so on.

    Parameters
    ----------
    start : Problem, Orbit or Point
        Where to begin.
    free : str
        The parameter all branches are followed in.
    within : dict
        ``{name: (low, high)}`` as for `trace`; a name that the problem of an arm does not have
        does not count there, nor the "period" and "orbit" of cycles along equilibria.
    depth : int, optional
        How often to switch on the way from the start to a branch: 0 is the branch of the start
        alone.
    events, steps : optional
        As for `trace`. Arms that solve another problem than the start look for its own events.
    most : int, optional
        Number of branches after which no others are followed.
    beyond : bool, optional
        Whether to switch where branches end, too, and other orbits set out: at GR those with an
        impact more, at VI those with one less, at CC those in another order, at SL those that
        slide, or do not. Where none does, ``ends`` says what there is.
    progress, save : optional
        As for `trace`.

    Returns
    -------
    Diagram
        No branch is in it twice: arms that lead to a known branch are recognised before they are
        followed. The image of a known branch under a symmetry is followed, but not switched on.

    Raises
    ------
    BadInput, NotConverged
        As `trace`, for the start. What fails later on is kept in ``failed``.
    Interrupted
        On Ctrl-C; its ``partial`` is the diagram as far as it got, with ``interrupted`` set, or
        None.

    Examples
    --------
    >>> import contbreather as cb, numpy as np
    >>> mine = cb.Problem(lambda x, p: np.array([x[0] * (p["mu"] - x[0]**2)]),
    ...                   start={"x": 0.0}, params={"mu": -1.0})
    >>> tree = diagram(mine, "mu", within={"mu": (-1, 1)}, events=[cb.branch_point()])
    >>> tree
    <Diagram 3 branches, 5 special points>
    >>> sorted(tree.graph.successors("branch 0: BP1"))
    [1, 2]
    """
    depth, most = whole("depth", depth, 0), whole("most", most, 1)
    settings = Settings.of(within, events, steps, False)
    growth = _Growth(free, depth, settings, most, flag("beyond", beyond))
    with checkpoint(save, "diagram", growth.so_far) as kept, Counter(progress) as growth.shown:
        growth.kept = kept
        growth.run(start)
        if kept:
            kept.finish(growth.diagram())
    return growth.diagram()


@dataclass
class _Growth:
    free: str
    depth: int
    settings: Settings
    most: int
    beyond: bool
    shown: Counter = field(init=False)
    kept: Checkpoint | None = field(init=False)
    tree: Diagram = Diagram((), (), ())  # its branches with all that is known of them
    queue: deque[Place] = field(default_factory=deque)

    def run(self, start: Problem | Startable) -> None:
        """Grow until nothing is left to switch at, or it is enough."""
        problem, within = problem_in(start), self.settings.within.items()
        if self.depth and self.settings.events is None and not problem.events:
            raise BadInput(
                "a diagram switches where there is an event, and this problem looks for none: "
                "events=[cb.branch_point()]"
            )
        there = {name: window for name, window in within if name not in problem.of_arms}
        settings = replace(self.settings, within=there)
        self._grow(Bifurcation(0), partial(walk_from, start, self.free), settings)
        while self.queue and len(self.tree) < self.most:
            self._switch_at(self.queue[0])
            self.queue.popleft()

    def so_far(self) -> Diagram | None:
        return self.diagram(interrupted=True) if len(self.tree) else None

    def diagram(self, *, interrupted: bool = False) -> Diagram:
        left = (*self.tree.left, *self.queue)
        return replace(self.tree, left=left, interrupted=interrupted)

    def _note(self, **more: object) -> None:
        """Put one more entry at the end of rows of the diagram, all of them at once."""
        rows = {name: (*getattr(self.tree, name), entry) for name, entry in more.items()}
        self.tree = replace(self.tree, **rows)  # type: ignore[arg-type]

    def _switch_at(self, place: Place) -> None:
        self.shown.title = f"branch {len(self.tree)}, {len(self.queue)} points to switch at: "
        try:
            seeds = seeds_at(place.point)
        except ContbreatherError as error:
            end = place.point.event is not None and place.point.event.ends
            if end and isinstance(error.__cause__, BadInput):  # the sentence of who would go on
                self._note(ends=Failure(place, str(error.__cause__)))
            else:
                self._note(failed=Failure(place, str(error)))
            return
        for seed in seeds:
            if len(self.tree) >= self.most:
                self._note(left=place)
                return
            try:
                self._follow(place, seed)
            except ContbreatherError as error:
                self._note(failed=Failure(place, str(error)))

    def _follow(self, place: Place, seed: Seed) -> None:
        """Follow one arm, unless its first step is on a branch that is known."""
        problem, point = seed.problem, place.point
        settings, steps = self._settings(problem), self.settings.steps
        if problem.residual is point.curve.problem.residual:
            # those that were given, for the problem they were given for
            settings = replace(settings, events=self.settings.events)

        def glance(most: int) -> Branch:
            short = replace(settings, events=(), steps=replace(steps, most=most))
            return follow(point, seed, short, progress=False)

        first = glance(1)
        if len(first) < 2 and first.stop is Stop.BOUND:
            return  # at the edge of the window, beyond which it lies
        if first.curve.length(first[-1].z - first[0].z) < 0.1 * steps.first:
            # so close to a branch point rounding decides on which of two curves a solution lies
            first = glance(12)
        reach = first.curve.length(first[-1].z - first[0].z)
        duplicate = duplicate_of(first[-1], self.tree, reach) or ending_at(first[0], self.tree)
        if duplicate is not None and (duplicate.simpler or not duplicate.image):
            larger = problem.residual is not point.curve.problem.residual
            if larger and duplicate.branch == place.branch:  # else a curve that crosses itself
                raise NotConverged(
                    "an arm cannot be distinguished from the branch it was to leave; shorter first "
                    "steps, or switch by hand"
                )
            meeting = Connection(place, duplicate.branch)
            if meeting not in self.tree.meetings:
                self._note(meetings=meeting)
            return
        image_of = None if duplicate is None else duplicate.branch
        birth = Bifurcation(self.tree.births[place.branch].depth + 1, place, image_of)
        small, walk = simplest(first[-1], reach), partial(follow, point, seed)
        if small is not first[-1]:  # a branch of a smaller problem, which the place lies on
            walk = partial(walk_from, small.problem, self.free)
            settings = self._settings(small.problem)
        self._grow(birth, walk, settings)

    def _grow(self, birth: Bifurcation, walk: Callable[..., Branch], settings: Settings) -> None:
        """Follow one more branch; where it is interrupted, keep what there is of it."""

        def whole(piece: Branch) -> Diagram | None:
            growth = replace(self, queue=self.queue.copy())
            growth._add(piece, birth)
            return growth.so_far()

        with add_partial_result(lambda piece: self._add(piece, birth)):
            save = self.kept and Inner(self.kept, whole)
            branch = walk(settings, progress=self.shown, save=save)
        self._add(branch, birth)

    def _settings(self, problem: Problem) -> Settings:
        """Settings for another problem: the windows that it has, and its own events."""
        within = self.settings.within.items()
        names = {*problem.names, *problem.totals}
        there = {name: window for name, window in within if name in names or problem.normed(name)}
        return replace(self.settings, within=there, events=None)

    def _add(self, branch: Branch, birth: Bifurcation) -> None:
        places, fresh = list[Place](), list[Place]()
        for point in branch.special:
            if point.parent is not None:
                continue  # where an arm set out is the place it was born at
            place = Place(len(self.tree), point)
            ends = point.event is not None and point.event.ends
            if branches_leave(point) and (self.beyond or not ends):
                # the branch may cross another one there, or itself
                own = (other for other in places if other.point.kind == point.kind)
                known = (
                    other
                    for other in chain(*self.tree.places, own)
                    if branches_leave(other.point) and same_place(point, other.point)
                )
                if (earlier := next(known, None)) is None:
                    fresh.append(place)
                place = earlier or place
            places.append(place)
        branch = replace(branch, image_of=birth.image_of)
        self._note(branches=branch, births=birth, places=tuple(places))
        # all that leaves an image is the image of what leaves the original
        for place in fresh if birth.image_of is None else ():
            if birth.depth < self.depth:
                self.queue.append(place)
            else:
                self._note(left=place)


# --- in files -----------------------------------------------------------------------------------

At = tuple[int, int]  # a branch, and the number of a point on it


def _to_dict(tree: Diagram) -> dict[str, Any]:
    """Branches as groups, places by the branch they were found on first and their number there."""

    def at(place: Place) -> At:
        numbers = (i for i, point in enumerate(tree[place.branch]) if point is place.point)
        return place.branch, next(numbers)

    return {
        "births": [(b.depth, b.place and at(b.place), b.image_of) for b in tree.births],
        "places": [[at(place) for place in row] for row in tree.places],
        "meetings": [(at(meeting.place), meeting.branch) for meeting in tree.meetings],
        "failed": [(at(failure.place), failure.reason) for failure in tree.failed],
        "left": [at(place) for place in tree.left],
        "ends": [(at(end.place), end.reason) for end in tree.ends],
        "interrupted": tree.interrupted,
        "groups": {f"branch{i}": branch for i, branch in enumerate(tree)},
    }


@serialised("diagram", Diagram, _to_dict)
def _from_dict(
    *,
    groups: dict[str, Branch],
    births: list[tuple[int, At | None, int | None]],
    places: list[list[At]],
    meetings: list[tuple[At, int]],
    failed: list[tuple[At, str]],
    left: list[At],
    interrupted: bool,
    ends: Sequence[tuple[At, str]] = (),  # older files have none
) -> Diagram:
    branches = [groups[f"branch{i}"] for i in range(len(groups))]
    known = dict[tuple[int, int], Place]()
    numbers = [*(image for *_, image in births), *(arm for _, arm in meetings)]
    if len(births) != len(branches) or {*numbers} - {None, *range(len(branches))}:
        raise BadInput(f"births {births} or meetings {meetings} are not those of its branches")

    def at(where: At) -> Place:
        branch, number = where
        if branch not in range(len(branches)) or number not in range(len(branches[branch])):
            raise BadInput(f"there is no point {number} on a branch {branch} of its branches")
        return known.setdefault((branch, number), Place(branch, branches[branch][number]))

    origins = [Bifurcation(depth, place and at(place), image) for depth, place, image in births]
    for i, birth in enumerate(origins):  # the point that an arm left is that of the branch
        if birth.place is not None and branches[i][0].parent is not None:
            points, parent = branches[i].points, birth.place.point
            made = {**points.made, 0: replace(points[0], parent=parent)}
            branches[i] = replace(branches[i], points=replace(points, made=made), origin=parent)
    return Diagram(
        tuple(branches),
        tuple(origins),
        tuple(tuple(at(where) for where in row) for row in places),
        tuple(Connection(at(where), branch) for where, branch in meetings),
        tuple(Failure(at(where), reason) for where, reason in failed),
        tuple(at(where) for where in left),
        interrupted,
        tuple(Failure(at(where), reason) for where, reason in ends),
    )
