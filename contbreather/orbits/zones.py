"""Zones of existence and stability in two parameters, as in Fig. 2, found without a seed.

Branches in one parameter are traced at a comb of values of the other; each event on them that lies
on no curve known so far is traced as a boundary, to the ends of the region where breathers exist.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, TypedDict, Unpack, overload

import numpy as np
from numpy.typing import NDArray

from contbreather.checks import flag
from contbreather.columns import Columns, stacked
from contbreather.continuation import Branch, Event, Point, Steps, boundary, refined, trace
from contbreather.continuation.checkpoint import Checkpoint, Inner, Save, checkpoint
from contbreather.continuation.point import CodimensionTwo
from contbreather.continuation.starts import windows
from contbreather.display import Shown
from contbreather.errors import BadInput, NoSolution, keeping, taking
from contbreather.lattice import Forcing, Lattice, forcing_of, lattice_of
from contbreather.orbits.clearance import least_margin
from contbreather.orbits.closed_form import events_on, symmetric_problem
from contbreather.orbits.closure import folds
from contbreather.orbits.constructors import symmetric_roots
from contbreather.orbits.orbit import Orbit
from contbreather.orbits.regions import PROBES, Box, Region, regions
from contbreather.parameters import parameter, window_of
from contbreather.progress import Counter, line_of
from contbreather.stability.verdict import THRESHOLD
from contbreather.storage.serialise import serialised
from contbreather.tables import Column, Sheet

Array = NDArray[np.float64]
Place = Point | Mapping[str, float]

KINDS = ("LP", "GR", "PF", "NS")
ORDER = ("PF", "NS", "LP", "GR")  # of the two names of a meeting
# the comb of values on which branches are traced
COMBS = {
    "gamma": (0.0, 0.02, 0.04, 0.06, 0.08, 0.1, 0.12, 0.14, 0.16, 0.18, 0.2, 0.22, 0.235, 0.245),
    "k": (0.02, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.97, 0.99, 0.997, 0.999),
    "a": (0.01, 0.03, 0.06, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.97),
}
PAIRS = {"k": ("gamma", "a"), "gamma": ("k", "a"), "a": ("k", "gamma")}
FEWEST = 80  # points on a curve
FAMILIES = ("upper", "lower")  # breathers before and behind a fold
JOINT = "NS-NS"  # between two pieces of the envelope that is the paper's rule on a ring
STEPS = Steps(first=0.005, largest=0.05, tolerance=1e-11)
SAME = 1e-3  # an event this close to a traced curve lies on it
PASSED = 3e-3  # a breather this close to a traced branch is one of it; chords of a branch are long
NEXT = (0.999, 1.001)  # next to a fold, as parts of its amplitude
PHASE = 0.1  # weight of phi in these distances: of breathers alike in p it differs a lot
VANISHED = 1e-9  # the impact has lost its velocity: no event of an impacting breather
BESIDE = 3e-3  # how far from a meeting a curve is looked for that the comb missed


@dataclass(frozen=True, eq=False)
class Zones(Columns, Shown):
    """The curves that bound existence and stability of the symmetric breather in one plane.

    Attributes
    ----------
    fixed : tuple of (str, float)
        The third parameter and its value.
    pair : tuple of str
        The two parameters of the plane, abscissa first.
    curves : dict
        ``{"LP": (branch, ...), "GR": ..., "PF": ..., "NS": ...}``; each branch is a boundary.
    threshold : float
        Modulus over 2 pi of the paper's rule, which the NS curves of a ring follow.
    past_folds : bool
        Whether the lower breathers, those behind a fold, are in the diagram besides the upper ones.
    interrupted : bool
        Whether it was cut short: curves may be missing, and the last one may end early.
    ceiling : float or None
        With lower breathers: the amplitude at which their impacts vanish, a max|f| = 1, p -> 0.
    """

    fixed: tuple[str, float]
    pair: tuple[str, str]
    curves: Mapping[str, tuple[Branch, ...]]
    threshold: float = THRESHOLD
    past_folds: bool = False
    interrupted: bool = False
    ceiling: float | None = None

    def __iter__(self) -> Iterator[tuple[str, Branch]]:
        for kind in KINDS:
            for branch in self.curves[kind]:
                yield kind, branch

    def __getitem__(self, kind: str) -> tuple[Branch, ...]:
        if not isinstance(kind, str) or kind not in self.curves:
            raise BadInput(f"no curves {kind!r}; there are {list(self.curves)}")
        return self.curves[kind]

    def columns(self) -> dict[str, Any]:
        """Those of all curves, by their kind and the number of the piece."""
        curves = ((kind, i, b) for kind in KINDS for i, b in enumerate(self.curves[kind], start=1))
        return stacked(({"curve": kind, "piece": i}, b.columns()) for kind, i, b in curves)

    @property
    def special(self) -> tuple[Point, ...]:
        """Where curves meet, each once: PF-GR, NS-LP, NS-GR, LP-GR, GR-GR.

        The pieces of the paper's rule on a ring are one curve.
        """
        found: list[Point] = []
        for kind in reversed(KINDS):
            for point in (p for branch in self.curves[kind] for p in branch.special):
                if not _is_meeting(point) or point.kind == JOINT:
                    continue
                if not any(self._same(point, one) for one in found):
                    found.append(point)
        return tuple(found)

    def table(self) -> Sheet:
        """Where curves meet: the two kinds, stability first, and the breather there."""
        places = [point.solution for point in self.special]
        columns = [Column("k", [b.k for b in places]), Column("meeting", self.meetings())]
        names = ("gamma", "a", "p", "phi")
        columns += [Column(name, [getattr(b, name) for b in places]) for name in names]
        return Sheet(columns, "Where the curves meet")

    def meetings(self) -> list[str]:
        """The two kinds of curves of each special point, stability first."""
        return ["-".join(sorted(p.kind.split("-"), key=ORDER.index)) for p in self.special]

    def _same(self, one: Point, other: Point) -> bool:
        """Whether two meetings are one, seen from either curve."""
        kinds = [set(point.kind.split("-")) for point in (one, other)]
        return kinds[0] == kinds[1] and all(abs(one[n] - other[n]) < 1e-6 for n in self.pair)

    @cached_property
    def regions(self) -> tuple[Region, ...]:
        """The pieces into which the curves cut the plane, as polygons with their verdicts."""
        return self.regions_of(self.box()) if any(self.curves.values()) else ()

    def regions_of(self, box: Box) -> tuple[Region, ...]:
        """Those of a part of the plane, ``((0, 0.25), (0, 1))``: abscissa first."""
        lines = [np.column_stack([branch[name] for name in self.pair]) for _, branch in self]
        if lines and self.ceiling is not None:
            lines.append(np.array([(x, self.ceiling) for x in box[0]]))
        lower = None if self.past_folds else self.lower
        return regions(lines, box, self.unstable, lower) if lines else ()

    def box(self, within: Mapping[str, tuple[float, float]] | None = None) -> Box:
        """What the curves span in both parameters, and on to a window where breathers go on."""
        columns = [[branch[name] for _, branch in self] for name in self.pair]
        spans = [(min(map(np.min, own)), max(map(np.max, own))) for own in columns]
        if self.ceiling is not None:
            spans[1] = spans[1][0], max(spans[1][1], self.ceiling)
        for i, name in enumerate(self.pair if within is not None else ()):
            across = np.linspace(*spans[1 - i], PROBES + 2)[1:-1].tolist()
            ends = list(spans[i])
            reach = windows(within).get(name, window_of(name))
            for end in (0, 1):
                # beyond the outermost curve nothing changes: any breather there speaks for all
                beyond = 0.5 * (ends[end] + reach[end])
                if not math.isfinite(beyond) or beyond == ends[end]:
                    continue
                places = [(beyond, other)[:: 1 - 2 * i] for other in across]
                if any(self.unstable(*place) is not None for place in places):
                    ends[end] = reach[end]
            spans[i] = (ends[0], ends[1])
        return spans[0], spans[1]

    def unstable(self, x: float, y: float) -> int | None:
        """Unstable multipliers of the breather at a place of the plane, of the chain and by the
        threshold of these zones: of several breathers the fewest, None where there is none of the
        families that the diagram is of."""
        counts = [
            breather.map.unstable(self.threshold)
            for breather in self.breathers(x, y)
            if breather.representation.family in self.families
        ]
        return min(counts, default=None)

    def lower(self, x: float, y: float) -> float | None:
        """The largest p of the lower breathers at a place of the plane, None where there is none;
        they may be there without the upper one."""
        found = [b.p for b in self.breathers(x, y) if b.representation.family == "lower"]
        return max(found, default=None)

    def breathers(self, x: float, y: float) -> tuple[Orbit, ...]:
        """All admissible breathers at a place of the plane, of both families, by falling p."""
        like = self._any.solution
        values = {self.fixed[0]: self.fixed[1], self.pair[0]: x, self.pair[1]: y}
        return _admissible(values, like.forcing, like.lattice)

    def told(self) -> Iterator[str]:
        """A sentence on each region without upper breathers in which there are lower ones."""
        for one in self.regions:
            if any(one.lower):
                place = f"({', '.join(self.pair)}) = ({one.x:.4g}, {one.y:.4g})"
                yield f"Around {place} {one.describe()}"

    @property
    def families(self) -> tuple[str, ...]:
        """Which breathers it is a diagram of: the upper ones, or with `past_folds` both."""
        return FAMILIES if self.past_folds else FAMILIES[:1]

    @property
    def _any(self) -> Point:
        """Any point of any curve."""
        for _, branch in self:
            return branch[0]
        raise BadInput("this zone diagram has no curve")

    def __repr__(self) -> str:
        counts = ", ".join(f"{kind}: {len(self.curves[kind])}" for kind in KINDS)
        cut = "; interrupted, curves may be missing" if self.interrupted else ""
        of = f"{' and '.join(self.families)} breathers in {self.pair}"
        return f"<Zones of {of} at {self.fixed[0]} = {self.fixed[1]:g}; {counts}{cut}>"


def _admissible(at: Mapping[str, float], forcing: Forcing, lattice: Any) -> tuple[Orbit, ...]:
    """All roots of (11) that keep off the walls."""
    values: dict[str, Any] = {**at, "forcing": forcing, "lattice": lattice}
    try:
        found = symmetric_roots(**values)
    except NoSolution:
        return ()
    return tuple(breather for breather in found if least_margin(breather.motion) > 0.0)


class Drawn(TypedDict, total=False):
    """The keywords of `zones` besides the parameter that is fixed."""

    forcing: Forcing | str | None
    lattice: Lattice | None
    within: Mapping[str, tuple[float, float]] | None
    progress: bool | Counter | None
    threshold: float
    past_folds: bool
    save: Save


@overload
def zones(
    *,
    k: float | None = None,
    gamma: float | None = None,
    a: float | None = None,
    **drawn: Unpack[Drawn],
) -> Zones: ...


@overload
def zones(
    *,
    k: Sequence[float] | None = None,
    gamma: Sequence[float] | None = None,
    a: Sequence[float] | None = None,
    **drawn: Unpack[Drawn],
) -> tuple[Zones, ...]: ...


def zones(
    *,
    k: float | Sequence[float] | None = None,
    gamma: float | Sequence[float] | None = None,
    a: float | Sequence[float] | None = None,
    forcing: Forcing | str | None = None,
    lattice: Lattice | None = None,
    within: Mapping[str, tuple[float, float]] | None = None,
    progress: bool | Counter | None = None,
    threshold: float = THRESHOLD,
    past_folds: bool = False,
    save: Save = None,
) -> Zones | tuple[Zones, ...]:
    """All curves of the zone diagram with one of k, gamma, a fixed; nobody supplies a seed.

    Parameters
    ----------
    k, gamma, a : float or sequence of float
        Exactly one: the plane is that of the other two, ``(gamma, a)`` for the paper's Fig. 2.
        Several values give as many diagrams.
    forcing : Forcing or str, optional
        `Harmonic` unless given.
    lattice : Lattice, optional
        The infinite chain unless given. On a `Ring` the NS curves follow the paper's rule: they are
        the pieces of one envelope, each of the wave that is first to pass the threshold.
    within : dict, optional
        Windows of the two parameters, narrower than the defaults.
    progress : bool, optional
        As for `trace`.
    threshold : float
        Modulus over 2 pi of the paper's rule; for rings.
    past_folds : bool, optional
        Whether the diagram is of the lower breathers, too: those behind a fold, of one harmonic the
        ones with the smaller p. Unless asked for it is of the upper ones, whatever the forcing: the
        lower ones are unstable throughout, and the fold ends the zone. But they may exist where no
        upper one does, at most up to a max|f| = 1 where their impacts vanish, p -> 0.
    save : str or Path, optional
        As for `trace`.

    Returns
    -------
    Zones
        LP (lower limit of existence), GR (upper limit, or site 0 grazing for small k), PF and NS
        (limits of stability), each to the end of the region where breathers exist. For several
        values, ``k=[0.8, 0.4]``, a tuple of them in the same order.

    Raises
    ------
    BadInput
        If not exactly one parameter is fixed, or the window contains no breather.
    Interrupted
        On Ctrl-C; its ``partial`` is the diagram as far as it got, with ``interrupted`` set; for
        several values a tuple of those there are.

    Examples
    --------
    >>> diagram = zones(k=0.8, within={"gamma": (0.0, 0.1)})
    >>> {kind: len(diagram.curves[kind]) for kind in ("LP", "GR", "PF", "NS")}
    {'LP': 1, 'GR': 1, 'PF': 1, 'NS': 1}
    """
    every: dict[str, Any] = {"k": k, "gamma": gamma, "a": a}
    given = {name: v for name, v in every.items() if v is not None}
    if len(given) != 1:
        raise BadInput(
            f"zones need exactly one of k, gamma and a fixed, got {given or 'none'}; "
            "zones(k=0.8) draws the plane (gamma, a)"
        )
    ((name, value),) = given.items()
    if np.iterable(value) and not isinstance(value, str):
        shared = {"forcing": forcing, "lattice": lattice, "within": within, "progress": progress}
        return _several(name, value, save, **shared, threshold=threshold, past_folds=past_folds)
    value = parameter(name, value)
    if name == "k" and value in (0.0, 1.0):
        raise BadInput(
            f"k = {value:g}: zones need 0 < k < 1. At k = 1 the folds are at a = 0 and every "
            "multiplier on the arc is neutral; at k = 0 site 0 leaves its wall without velocity. "
            "Take k close to it, and symmetric() for single breathers at the edge"
        )
    drive, chain = forcing_of(forcing), lattice_of(lattice)
    search = _Search(
        name, value, drive, chain, windows(within), threshold, flag("past_folds", past_folds)
    )
    line = line_of(progress, lambda own: Counter(own, search.pair[0]))
    with checkpoint(save, "zones") as search.kept, line as shown, keeping(search.so_far):
        search.run(shown)
        search.kept.finish(search.zones())
    return search.zones()


def _several(name: str, values: Any, save: Save, **shared: Any) -> tuple[Zones, ...]:
    """A diagram for each of several values."""
    if not len(values):
        raise BadInput(f"zones need a value of {name}, or several; got none")
    done: list[Zones] = []
    with (
        checkpoint(save, "zones") as kept,
        keeping(lambda: tuple(done) or None),
        taking(done.append),
    ):
        for value in values:
            inner = Inner(kept, lambda piece: (*done, piece))
            done.append(zones(**{name: value}, **shared, save=inner))
        kept.finish(tuple(done))
    return tuple(done)


@dataclass
class _Search:
    """One zone diagram in the making."""

    name: str
    value: float
    forcing: Forcing
    lattice: Lattice
    given: Mapping[str, tuple[float, float]]
    threshold: float
    past_folds: bool
    kept: Checkpoint = field(default_factory=Checkpoint)

    def __post_init__(self) -> None:
        self.pair = PAIRS[self.name]
        for other in self.given:
            if other not in self.pair:
                raise BadInput(f"no window for {other!r}: the plane is that of {self.pair}")
        self.within = {n: _narrowed(n, self.given.get(n)) for n in self.pair}
        self.events = events_on(self.lattice, self.threshold)
        if not self.past_folds:
            self.events = tuple(map(up_to_the_fold, self.events))
        self.curves: dict[str, list[Branch]] = {kind: [] for kind in KINDS}

    def zones(self, *, interrupted: bool = False) -> Zones:
        """The curves there are."""
        curves = {kind: tuple(branches) for kind, branches in self.curves.items()}
        fixed, ceiling = (self.name, self.value), None
        if self.past_folds and self.within.get("a", (0.0, 0.0))[1] > 1.0 / self.forcing.peak():
            ceiling = 1.0 / self.forcing.peak()
        return Zones(
            fixed, self.pair, curves, self.threshold, self.past_folds, interrupted, ceiling
        )

    def so_far(self) -> Zones | None:
        return self.zones(interrupted=True) if any(self.curves.values()) else None

    def run(self, shown: Counter) -> None:
        found = [self._scan(x, shown) for x in _comb(self.pair[0], self.within)]
        if not any(found):
            raise BadInput(
                f"no breather at {self.name} = {self.value:g} for {self._searched()}; "
                "widen the window, or choose another value"
            )
        # a curve too narrow for the comb still shows where it meets others: look beside these, and
        # between them, where one that leads from meeting to meeting has to pass
        met = [point[self.pair[0]] for point in self._unexplained()]
        beside = [x + step for x in met for step in (-BESIDE, BESIDE)]
        between = [0.5 * (x + other) for x, other in pairwise(sorted(met))]
        low, high = self.within[self.pair[0]]
        for x in (*beside, *between):
            if low <= x <= high:
                self._scan(x, shown)

    def _searched(self) -> str:
        """The windows as words."""
        return " and ".join(
            f"{name} > 0" if high == math.inf else f"{name} between {low:g} and {high:g}"
            for name, (low, high) in self.within.items()
        )

    def _scan(self, x: float, shown: Counter) -> bool:
        """Trace branches at one value of the first parameter, and every new event on them."""
        found = False
        for branch in self._branches(x):
            found = True
            shown.advance(branch[-1])
            for point in branch.special:
                if point.kind in KINDS and point.located:
                    self._follow(point)
                    self.kept.look(True, self.so_far)
        return found

    def _unexplained(self) -> list[Point]:
        """Meetings with a curve that was not traced."""
        branches = [branch for kind in KINDS for branch in self.curves[kind]]
        return [p for b in branches for p in b.special if _is_meeting(p) and not self._known(p)]

    def _known(self, point: Point, but: Branch | None = None) -> bool:
        # p and phi tell breathers apart; near k = 1 time reversal makes pairs alike in p
        names = (*self.pair, "p", "phi")
        curves = (b for b in self.curves[_followed(point)] if b is not but)
        return any(_on_curve(b, point, names, SAME) for b in curves)

    def _branches(self, x: float) -> Iterator[Branch]:
        """Branches of admissible breathers in the second parameter, at one value of the first."""
        free = self.pair[1]
        traced: list[Branch] = []
        for y in (*_comb(free, self.within), *self._next_to_folds(x)):
            for breather in self._breathers(x, y):
                here = {free: y, "p": breather.p, "phi": breather.phi}
                if any(_on_curve(b, here, (free, "p", "phi"), PASSED) for b in traced):
                    continue
                branch = trace(
                    symmetric_problem(breather, self.threshold),
                    free,
                    within={free: self.within[free]},
                    events=self.events,
                    steps=Steps(first=0.02, largest=0.1),
                    progress=False,
                )
                traced.append(branch)
                yield branch

    def _next_to_folds(self, x: float) -> list[float]:
        """Amplitudes on both sides of each fold, for sheets that pass between those of the comb."""
        if self.pair[1] != "a":
            return []
        at = {self.name: self.value, self.pair[0]: x}
        found = folds(at["gamma"], at["k"], self.forcing, self.lattice)
        low, high = self.within["a"]
        beside = [factor * a for a in found for factor in NEXT]
        return [a for a in beside if low <= a <= high]

    def _breathers(self, x: float, y: float) -> list[Orbit]:
        """Those that are admissible; where folds end the diagram the ones before the fold."""
        values = {self.name: self.value, self.pair[0]: x, self.pair[1]: y}
        found = _admissible(values, self.forcing, self.lattice)
        return [b for b in found if self.past_folds or b.representation.family == "upper"]

    def _follow(self, point: Point) -> None:
        """Trace an event as a boundary unless it lies on one already, and what takes over where it
        ends: another crest that grazes, another wave of a ring, a fold."""
        waiting: list[tuple[Point, Branch | None]] = [(point, None)]
        while waiting:
            point, since = waiting.pop()
            if point["p"] < VANISHED or self._known(point, but=since):
                continue
            curves = self.curves[_followed(point)]
            with taking(curves.append):
                branch = boundary(
                    point, self.pair, within=self.within, events=self.events, steps=STEPS,
                    progress=False,
                )  # fmt: skip
            curves.append(branch)  # before it is refined: an interruption keeps it
            pieced = any(end.kind == JOINT for end in branch.special)
            curves[-1] = branch = refined(branch, FEWEST // 8 if pieced else FEWEST)
            waiting += [(end, branch) for end in branch.special if _leads_on(end)]


def _is_meeting(point: Point) -> bool:
    return isinstance(point.event, CodimensionTwo)


def _leads_on(point: Point) -> bool:
    """Whether what a curve meets is followed from there: not what crosses a fold, for that would go
    on behind it; beside the fold it is found on a branch."""
    return _is_meeting(point) and (point.kind in ("GR-GR", JOINT) or _followed(point) == "LP")


def _followed(point: Point) -> str:
    """The kind of the curve that leads on from a special point."""
    event = point.event
    if event is None:
        return point.kind
    return event.base.kind if isinstance(event, CodimensionTwo) else event.kind


def up_to_the_fold(event: Event) -> Event:
    """A fold ends the zone: what lies behind it is the other breather."""
    return replace(event, ends="branch") if event.kind == "LP" else event


def _narrowed(name: str, window: tuple[float, float] | None) -> tuple[float, float]:
    low, high = reach = window_of(name)
    if window is None:
        return low, high
    low, high = max(low, window[0]), min(high, window[1])
    if not low < high:
        raise BadInput(f"the window {window} of {name!r} leaves nothing of {reach}")
    return low, high


def _comb(name: str, within: Mapping[str, tuple[float, float]]) -> Iterable[float]:
    """Values inside the window and at its ends, at least nine."""
    low, high = within[name]
    low, high = max(low, COMBS[name][0]), min(high, COMBS[name][-1])
    inside = [value for value in COMBS[name] if low < value < high]
    if low > high:  # a window beyond the comb
        low, high = within[name]
    comb = [low, *inside, high] if len(inside) >= 7 else np.linspace(low, high, 9).tolist()
    return [value for value in comb if value > 0 or name != "a"]  # no forcing, no breather


def _on_curve(branch: Branch, place: Place, names: tuple[str, ...], near: float) -> bool:
    """Whether a traced curve passes a place: these values by name."""
    nodes = np.stack([branch[name] for name in names], axis=-1)
    gap = np.array([place[name] for name in names]) - nodes
    if "phi" in names:
        turn, phase = 2.0 * math.pi, names.index("phi")
        gap[:, phase] -= turn * np.rint(gap[:, phase] / turn)
        gap[:, phase] *= PHASE
        nodes[:, phase] *= PHASE
    if len(nodes) > 1:
        gap, chord = gap[:-1], np.diff(nodes, axis=0)
        along = np.sum(gap * chord, axis=-1) / np.sum(chord * chord, axis=-1)
        gap -= np.clip(along, 0, 1)[:, None] * chord
    return bool(np.linalg.norm(gap, axis=-1).min() < near)


# --- in files -----------------------------------------------------------------------------------


PLAIN = ("fixed", "pair", "threshold", "past_folds", "interrupted", "ceiling")


def _to_dict(zones: Zones) -> dict[str, Any]:
    branches = {
        f"{kind}{i}": branch
        for kind, branches in zones.curves.items()
        for i, branch in enumerate(branches, start=1)
    }
    counts = {kind: len(branches) for kind, branches in zones.curves.items()}
    return {name: getattr(zones, name) for name in PLAIN} | {"curves": counts, "groups": branches}


@serialised("zones", Zones, _to_dict)
def _from_dict(
    *,
    fixed: Sequence[Any],
    pair: Sequence[str],
    curves: Mapping[str, int],
    groups: Mapping[str, Branch] | None = None,
    **plain: Any,  # older files have no ceiling
) -> Zones:
    by_kind = {
        kind: tuple((groups or {})[f"{kind}{i}"] for i in range(1, 1 + count))
        for kind, count in curves.items()
    }
    return Zones(tuple(fixed), tuple(pair), by_kind, **plain)  # type: ignore[arg-type]
