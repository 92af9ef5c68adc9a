"""A zone diagram: the curves that bound existence and stability in one plane of parameters, and the
pieces into which they cut it, as polygons."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from contbreather.checks import brief, numbers
from contbreather.columns import Columns, stacked
from contbreather.continuation.branches.switching import NothingToSwitch, switch
from contbreather.continuation.curve.branch import Branch, Stop
from contbreather.continuation.curve.point import CodimensionTwo, Point
from contbreather.continuation.curve.settings import windows
from contbreather.continuation.walk.trace import trace
from contbreather.errors import BadInput, ContbreatherError, NoSolution
from contbreather.lattice.conditions import check_drive
from contbreather.lattice.finite import highest_k
from contbreather.lattice.response import Resonance
from contbreather.orbits.by_impacts import ByImpacts
from contbreather.orbits.clearance import least_margin
from contbreather.orbits.closed_form import symmetric_roots
from contbreather.orbits.orbit import Orbit
from contbreather.parameters import NEEDED, POWERS, window_of
from contbreather.stability.verdict import THRESHOLD
from contbreather.storage.serialise import serialised
from contbreather.tables import Column, HtmlRepr, Sheet

Array = NDArray[np.float64]
Box = tuple[tuple[float, float], tuple[float, float]]  # of the pair, abscissa first
Count = Callable[[float, float], int | None]
Lower = Callable[[float, float], float | None]
Beyond = Callable[[float, float], str]

KINDS = ("LP", "GR", "PF", "NS")
ORDER = ("PF", "NS", "LP", "GR")  # of the two names of a meeting
PLACE = ("k", "curve", "gamma", "a")  # the first columns
FAMILIES = ("upper", "lower")  # breathers before and behind a fold
NO_CURVE = "no curve passes the window: breathers exist all over it, all stable or all unstable"
JOINT = "NS-NS"  # between two pieces of the envelope that is the paper's rule on a ring


def unit_of(name: str, lattice: Any, omega: float) -> float:
    """Unit of windows and combs: the highest k of a lattice, of others that of the frequency."""
    return highest_k(lattice) if name == "k" else float(omega ** POWERS.get(name, 0))


def narrowed(
    pair: tuple[str, ...], given: Mapping[str, Any], lattice: Any, held: Mapping[str, float]
) -> dict[str, tuple[float, float]]:
    """Windows of a plane: those given, or all, as far as there are breathers."""
    found = dict[str, tuple[float, float]]()
    for name in pair:
        omega = held.get("omega", 1.0)
        if "omega" in pair and name in given:  # at the largest omega
            omega = given.get("omega", window_of("omega"))[1]
        unit = unit_of(name, lattice, omega)
        reach = low, high = unit * window_of(name)[0], unit * window_of(name)[1]
        window = given.get(name, reach)
        found[name] = max(low, window[0]), min(high, window[1])
        if not found[name][0] < found[name][1]:
            why = f"leaves nothing of {reach}" if window[0] < window[1] else "is empty"
            raise BadInput(f"the window {window} of {name!r} {why}")
    return found


@dataclass(frozen=True, eq=False)
class Zones(Columns, HtmlRepr):
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
    beyond : bool
        Whether regions say which orbits are there beyond GR.
    """

    fixed: tuple[str, float]
    pair: tuple[str, str]
    curves: Mapping[str, tuple[Branch, ...]]
    threshold: float = THRESHOLD
    past_folds: bool = False
    interrupted: bool = False
    ceiling: float | None = None
    held: Mapping[str, float] = field(default_factory=dict)  # omega, or in planes of it a second
    beyond: bool = False

    def __iter__(self) -> Iterator[tuple[str, Branch]]:
        for kind in KINDS:
            for branch in self.curves[kind]:
                yield kind, branch

    def __getitem__(self, kind: str) -> tuple[Branch, ...]:
        if not isinstance(kind, str) or kind not in self.curves:
            raise BadInput(f"no curves {kind!r}; there are {list(self.curves)}")
        return self.curves[kind]

    def _ipython_key_completions_(self) -> list[str]:
        return [*self.curves]

    def columns(self) -> dict[str, Any]:
        """Columns of all curves, by their kind and the number of the piece; first where they
        are."""
        curves = ((kind, i, b) for kind in KINDS for i, b in enumerate(self.curves[kind], start=1))
        table = stacked(
            ({"curve": kind, "piece": i}, {**b.columns(), "phi": phases_on(b)})
            for kind, i, b in curves
        )
        return {name: table[name] for name in (*PLACE, *table) if name in table}

    @property
    def special(self) -> tuple[Point, ...]:
        """Points where curves meet, each once: PF-GR, NS-LP, NS-GR, LP-GR, GR-GR.

        The pieces of the paper's rule on a ring are one curve.
        """
        points: list[Point] = []
        for kind in reversed(KINDS):
            for point in (p for branch in self.curves[kind] for p in branch.special):
                if not isinstance(point.event, CodimensionTwo) or point.kind == JOINT:
                    continue
                if not any(self._same(point, other) for other in points):
                    points.append(point)
        return tuple(points)

    def table(self) -> Sheet:
        """Points where curves meet: the two kinds, stability first, and the breather there."""
        places = [point.solution for point in self.special]
        columns = [Column("k", [b.k for b in places]), Column("meeting", self.meetings())]
        names = (*["omega"] * ("omega" in self.pair), "gamma", "a", "p", "phi")
        columns += [Column(name, [getattr(b, name) for b in places]) for name in names]
        return Sheet(columns, "Where the curves meet")

    def meetings(self) -> list[str]:
        """The two kinds of curves of each special point, stability first."""
        return ["-".join(sorted(p.kind.split("-"), key=ORDER.index)) for p in self.special]

    def _same(self, point: Point, other: Point) -> bool:
        kinds = [set(meeting.kind.split("-")) for meeting in (point, other)]
        return kinds[0] == kinds[1] and all(abs(point[n] - other[n]) < 1e-6 for n in self.pair)

    @cached_property
    def regions(self) -> tuple[Region, ...]:
        """The pieces into which the curves cut the plane, as polygons with their verdicts; of
        slivers, less than a thousandth of what they span, nothing is said."""
        return self.regions_of(self.box()) if any(self.curves.values()) else ()

    def regions_of(self, box: Box) -> tuple[Region, ...]:
        """Regions of a part of the plane, ``((0, 0.25), (0, 1))``: abscissa first."""
        lines = [np.column_stack([branch[name] for name in self.pair]) for _, branch in self]
        if lines and self.ceiling is not None:
            # a max|f| = 1, where impacts vanish: no branch of breathers runs along p = 0
            lines.append(np.array([(x, self.ceiling) for x in box[0]]))
        lower = None if self.past_folds else self.lower
        # one that was cut short at its first point spans nothing
        cut = lines and all(low < high for low, high in box)
        beyond = self.beyond_grazing if self.beyond else None
        return regions(lines, box, self.unstable, lower, beyond) if cut else ()

    def box(self, within: Mapping[str, tuple[float, float]] | None = None) -> Box:
        """Range of the curves in both parameters, and on to the ends of the window of the search,
        or of another one, where breathers go on."""
        if not any(self.curves.values()):
            raise BadInput(
                "these zones have no curves, so there is nothing to draw; widen the window"
            )
        columns = [[branch[name] for _, branch in self] for name in self.pair]
        spans = [(min(map(np.min, values)), max(map(np.max, values))) for values in columns]
        if self.ceiling is not None:
            # a is the ordinate of each plane that it is in
            spans[1] = spans[1][0], max(spans[1][1], self.ceiling)
        reaches = narrowed(self.pair, self._searched if within is None else windows(within),
                           self.model["lattice"], self.held)  # fmt: skip
        for i, name in enumerate(self.pair):
            across = np.linspace(*spans[1 - i], PROBES + 2)[1:-1].tolist()
            ends = list(spans[i])
            reach = reaches[name]
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

    @property
    def _searched(self) -> Mapping[str, tuple[float, float]]:
        settings = next(branch.settings for _, branch in self)
        return {} if settings is None else settings.within

    def unstable(self, x: float, y: float) -> int | None:
        """Unstable multipliers of the breather at a place of the plane, of the chain and by the
        threshold of these zones: of several breathers the fewest, None where there is none of the
        families that the diagram is of."""
        counts = [
            breather.map.unstable(self.threshold)
            for breather in self.breathers(x, y)
            if breather.representation.family in self.families
        ]
        return min(counts, default=None)  # stable where any breather is

    def lower(self, x: float, y: float) -> float | None:
        """The largest p of the lower breathers at a place of the plane, None where there is none;
        they may be there without the upper one."""
        momenta = [b.p for b in self.breathers(x, y) if b.representation.family == "lower"]
        return max(momenta, default=None)

    def breathers(self, x: float, y: float) -> tuple[Orbit, ...]:
        """Admissible breathers at a place of the plane, of both families, by falling p."""
        return admissible_roots(self._at(x, y), **self.model)

    def _at(self, x: float, y: float) -> dict[str, float]:
        return {**self.held, self.fixed[0]: self.fixed[1], self.pair[0]: x, self.pair[1]: y}

    def beyond_grazing(self, x: float, y: float) -> str:
        """Which orbit is at a place of the plane in place of a breather that grazes at a smaller
        amplitude, and whether it is stable, as ``"3 sites impact: unstable"``: `switch` leads
        there. Empty where no breather grazes below."""
        breathers = (b for b in _roots(self._at(x, y), **self.model) if not _keeps_off(b))
        own = (b for b in breathers if b.representation.family in self.families)
        return next((beyond_grazing(b, self.threshold) for b in own), "")

    def sentences(self) -> Iterator[str]:
        """Sentences on regions with lower breathers alone, or with others beyond GR."""
        if self.beyond and not self.curves["GR"]:
            yield "No curve of GR is there, beyond which other orbits could be"
        for region in self.regions:
            if any(region.lower) or any(region.beyond):
                place = f"({', '.join(self.pair)}) = ({region.x:.4g}, {region.y:.4g})"
                yield f"Around {place} {region.describe()}"

    @cached_property
    def model(self) -> dict[str, Any]:
        """Lattice, forcing and losses of its breathers, as `symmetric` takes it: forcing and
        lattice; where they are evaluated by exact modes site, damping, spring and walls, too."""
        branch = next((branch for _, branch in self), None)
        if branch is None:
            raise BadInput("this zone diagram has no curve")
        orbit: Orbit = branch[0].solution
        on = orbit.conditions
        model: dict[str, Any] = {"forcing": on.forcing, "lattice": on.lattice}
        if isinstance(orbit.representation, ByImpacts):
            (site, _), *_ = orbit.section.impacts
            model |= {"site": site, "damping": on.damping, "spring": on.spring, "walls": on.walls}
        return model

    @property
    def families(self) -> tuple[str, ...]:
        """Which breathers it is a diagram of: the upper ones, or with `past_folds` both."""
        return FAMILIES if self.past_folds else FAMILIES[:1]

    def __repr__(self) -> str:
        counts = ", ".join(f"{kind}: {len(self.curves[kind])}" for kind in KINDS)
        cut = "; interrupted, curves may be missing" if self.interrupted else ""
        of = f"{' and '.join(self.families)} breathers in {self.pair}"
        at = ", ".join(f"{name} = {x:g}" for name, x in (self.fixed, *self.held.items()))
        return f"<Zones of {of} at {at}; {counts}{cut}>"


class ZoneDiagrams(tuple[Zones, ...], HtmlRepr):
    """Zone diagrams of several values of the fixed parameter: a tuple that notebooks show."""

    __slots__ = ()

    def table(self) -> Sheet:
        """Points where curves meet in each, one diagram after the other."""
        first, *others = (diagram.table() for diagram in self)
        return first.further(*(row for sheet in others for row in sheet.rows))


def admissible_roots(at: Mapping[str, float], **model: Any) -> tuple[Orbit, ...]:
    """Roots of (11) that keep off the walls; none in resonance."""
    return tuple(filter(_keeps_off, _roots(at, **model)))


def _keeps_off(breather: Orbit) -> bool:
    return bool(least_margin(breather.motion) > 0.0)


def _roots(at: Mapping[str, float], **model: Any) -> tuple[Orbit, ...]:
    """Roots of (11), admissible or not."""
    try:  # below the fold (14) no impulse solves (11), nor with the drive in the band
        check_drive(at.get("omega", 1.0), at["gamma"], model.get("spring"), model["lattice"])
        return tuple(symmetric_roots(**{**at, **model}))
    except (NoSolution, Resonance):
        return ()


def phases_on(curve: Branch) -> Array:
    """phi of the breathers on a curve: by exact modes it is the time of the first impact."""
    return curve["phi" if "phi" in curve.names else "t1"]


def beyond_grazing(breather: Orbit, threshold: float) -> str:
    """Say which orbit is there in place of a breather that passes walls, and whether it is stable:
    the one `switch` leads to from the GR at a smaller amplitude, and from the next ones on the way.
    Empty where there is no such GR.
    """
    a, window = breather.a, {"a": (0.0, breather.a)}
    problem = breather.problem_beyond(threshold)
    # with its walls lifted, to where it is one
    down = trace(
        problem, "a", towards="down", within=window, events=(), inadmissible=True, progress=False
    )
    inside = next((point for point in down if point["margin"] > 0.0), None)
    if inside is None:
        return ""
    branch = trace(inside.solution, "a", towards="up", within=window, events=(), progress=False)
    try:
        while branch[-1].kind == "GR":
            (branch,) = switch(branch[-1], within=window, events=(), progress=False)
            orbit: Orbit = branch[-1].solution
            sites, hits = orbit.section.hit, len(orbit.hits) // orbit.section.turns
            words = f"{len(sites)} sites impact"
            if len(sites) == 1:
                words = f"site {sites[0]} impacts {hits} times a period"
            if branch.stop is Stop.BOUND and orbit.a == a:
                return f"{words}: {'un' * (orbit.map.unstable(threshold) > 0)}stable"
            if branch[-1].kind != "GR":
                return f"{words}, nearer to GR only"
    except NothingToSwitch as error:
        return str(error.__cause__)
    except ContbreatherError as error:
        return f"what begins at GR is not followed: {error}"
    return ""


# --- pieces of the plane --------------------------------------------------------------------------

# In units of the box, each of whose sides counts as 1:
NEAR = 3e-3  # the end of a curve that comes so close to another one lies on it
PROBES = 5  # places where it is asked
CANDIDATES = 40  # of them along each side


@dataclass(frozen=True, eq=False)
class Region:
    """A piece of the plane between curves, and how stable breathers are there.

    Attributes
    ----------
    outline : ndarray, shape (m, 2)
        Corners of the polygon in the units of the parameters, the first one again at the end:
        ``ax.fill(*region.outline.T)`` draws it.
    holes : tuple of ndarray
        Outlines of what is cut out of it.
    x, y : float
        The place inside that is farthest from the edge.
    room : float
        Its distance from the edge, where each side of the whole diagram counts as 1.
    counts : tuple of (int or None)
        At that place, and at others spread over the region, the number of unstable multipliers of
        a breather; the smallest where there are several breathers, None where there is none of the
        family that the diagram is of.
    lower : tuple of (float or None)
        Of a diagram of upper breathers, at the same places: p of a lower one that is admissible
        where no upper one is.
    beyond : tuple of str
        Where it was asked for, at the same places: which orbit is there in place of a breather that
        grazes, and whether it is stable; empty elsewhere.
    """

    outline: Array
    holes: tuple[Array, ...]
    x: float
    y: float
    room: float
    counts: tuple[int | None, ...]
    lower: tuple[float | None, ...] = ()
    beyond: tuple[str, ...] = ()

    @property
    def verdict(self) -> str:
        """``"S"`` or ``"US"``, empty where the diagram has no breathers or the counts disagree."""
        words = {"" if count is None else "US" if count else "S" for count in self.counts}
        return words.pop() if len(words) == 1 else ""

    def describe(self) -> str:
        """Label of a region: which breathers there are, and whether they are stable."""
        if self.verdict:
            return f"{'stable' if self.verdict == 'S' else 'unstable'} breathers"
        if any(count is not None for count in self.counts):
            return "no verdict, the places that were asked disagree"
        there, none = [p for p in self.lower if p is not None], "no breather"
        if there:
            share = f" at {len(there)} of {len(self.lower)} places" if None in self.lower else ""
            none = f"no upper breather; a lower one, p = {there[0]:.6g}, is admissible{share}"
        elif self.lower:
            none = f"no upper breather, nor a lower one at any of {len(self.lower)} places"
        return "; ".join([none, *map("beyond GR {}".format, self.instead())])

    def instead(self) -> list[str]:
        """Sentences of `beyond`, each with the share of places it is about."""
        found, size = Counter(filter(None, self.beyond)), len(self.beyond)
        return [
            words + f" at {count} of {size} places" * (count < size)
            for words, count in found.most_common()
        ]

    def __repr__(self) -> str:
        words = f"{self.verdict or 'no verdict'} around ({self.x:.6g}, {self.y:.6g})"
        reason = "" if self.verdict else f": {self.describe()}"
        return f"<Region {words}, {len(self.outline) - 1} corners{reason}>"


def regions(
    lines: Iterable[Array],
    box: Box,
    count: Count,
    lower: Lower | None = None,
    beyond: Beyond | None = None,
) -> tuple[Region, ...]:
    """Pieces of a box that polylines, arrays of shape (n, 2), cut out of it.

    Where nothing is counted `lower` and `beyond` are asked, if given, what else there is.
    """
    corners = numbers("box", box)
    if corners.shape != (2, 2):
        raise BadInput(f"box = {brief(box)}: ((x0, x1), (y0, y1)) was expected.")
    low, high = corners.T
    size = np.where(high > low, high - low, 1.0)
    return tuple(
        _region(piece, low, size, count, lower, beyond)
        for piece in _pieces([(line - low) / size for line in lines])
    )


def _pieces(lines: Sequence[Array]) -> Iterator[Any]:
    import shapely

    frame = shapely.box(0, 0, 1, 1).exterior
    paths = [frame, *(shapely.LineString(line) for line in lines if len(line) > 1)]
    # places no farther apart are one
    joined = shapely.union_all([*paths, *_bridges(paths)], grid_size=1e-10)
    for piece in shapely.polygonize(shapely.get_parts(joined)).geoms:
        if piece.area > 1e-3:  # area of a sliver between two curves, which nothing is said of
            yield piece


def _bridges(paths: Sequence[Any]) -> Iterator[Any]:
    """Bridge from the ends of each line to the one it ends on: a chord passes that by."""
    import shapely

    for path in paths[1:]:
        others = shapely.union_all([other for other in paths if other is not path])
        for end in (shapely.Point(path.coords[0]), shapely.Point(path.coords[-1])):
            bridge = shapely.shortest_line(end, others)
            if 0 < bridge.length < NEAR:
                yield bridge


def _region(
    piece: Any, low: Array, size: Array, count: Count, lower: Lower | None, beyond: Beyond | None
) -> Region:
    import shapely

    # the place farthest from the edge, as well as it needs to be known
    radius = shapely.maximum_inscribed_circle(piece, tolerance=2e-3)
    places = low + size * _spread(piece, np.array(radius.coords[0]), radius.length)
    counts = tuple(count(x, y) for x, y in places.tolist())
    at = [*zip(*places.T.tolist(), counts, strict=True)]
    momenta = tuple(lower(x, y) if n is None else None for x, y, n in at) if lower else ()
    others = tuple(beyond(x, y) if n is None else "" for x, y, n in at) if beyond else ()
    outline, *holes = (
        low + size * np.array(ring.coords) for ring in (piece.exterior, *piece.interiors)
    )
    x, y = places[0].tolist()
    return Region(outline, tuple(holes), x, y, float(radius.length), counts, momenta, others)


def _spread(piece: Any, centre: Array, room: float) -> Array:
    """Places inside of a piece: the centre, then others far from it and from each other."""
    import shapely

    x0, y0, x1, y1 = piece.bounds
    grid = np.meshgrid(np.linspace(x0, x1, CANDIDATES), np.linspace(y0, y1, CANDIDATES))
    nodes = np.column_stack([coordinate.ravel() for coordinate in grid])
    nodes = nodes[shapely.contains_xy(piece, nodes)]
    off = shapely.distance(shapely.points(nodes), piece.boundary)
    # not at the edge, where counts are of multipliers on the circle
    nodes = np.vstack([centre, nodes[off > min(7e-3, 0.5 * room)]])
    places, far = [centre], np.full(len(nodes), np.inf)
    for _ in range(PROBES - 1):  # each as far as can be from all before it
        far = np.minimum(far, np.sum((nodes - places[-1]) ** 2, axis=1))
        places.append(nodes[int(far.argmax())])
    return np.array(places)


# --- in files -----------------------------------------------------------------------------------


PLAIN = (
    "fixed", "pair", "threshold", "past_folds", "interrupted", "ceiling", "held", "beyond",
)  # fmt: skip


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
    fixed: tuple[Literal["a", "gamma", "k"], float],
    pair: tuple[str, str],
    curves: dict[str, int],
    threshold: float,
    past_folds: bool,
    interrupted: bool,
    groups: dict[str, Branch] | None = None,
    ceiling: float | None,
    held: dict[str, float],
    beyond: bool,
) -> Zones:
    plane = {fixed[0], *pair, *held} - ({"omega"} if held else set())
    if plane != {*NEEDED} or {*curves} != {*KINDS}:
        raise BadInput(f"there are no zones in {pair} at {fixed[0]}, with curves of {[*curves]}")
    by_kind = {
        kind: tuple((groups or {})[f"{kind}{i}"] for i in range(1, 1 + count))
        for kind, count in curves.items()
    }
    name, value = fixed
    return Zones(
        (name, value), (pair[0], pair[1]), by_kind, threshold, past_folds, interrupted, ceiling,
        held, beyond,
    )  # fmt: skip
