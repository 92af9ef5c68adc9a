"""The pieces into which curves cut a plane of two parameters, as polygons."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contbreather.checks import brief, numbers
from contbreather.errors import BadInput

Array = NDArray[np.float64]
Box = tuple[tuple[float, float], tuple[float, float]]  # of the pair, abscissa first
Count = Callable[[float, float], int | None]
Lower = Callable[[float, float], float | None]
Beyond = Callable[[float, float], str]

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
