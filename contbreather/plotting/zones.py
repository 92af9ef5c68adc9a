"""Zone diagrams as in the paper's Fig. 2: curves of existence and stability, S and US regions."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from string import ascii_lowercase
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from contbreather.breathers import symmetric_roots
from contbreather.breathers.symmetric_events import unstable
from contbreather.breathers.zones import KINDS, WINDOWS, Zones
from contbreather.checks import check_kind
from contbreather.continuation.starts import windows
from contbreather.errors import BadInput, NoSolution
from contbreather.plotting.canvas import (
    BLACK,
    BLUE,
    COLUMN,
    MEETING,
    PAGE,
    VERMILLION,
    new_figure,
    style,
    symbol,
)
from contbreather.plotting.labels import place_words

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]
Window = Mapping[str, tuple[float, float]]
Box = tuple[tuple[float, float], tuple[float, float]]  # of the pair, abscissa first

LINES: dict[str, dict[str, Any]] = {
    "LP": {"color": BLACK, "linestyle": "-", "label": "fold (LP)"},
    "GR": {"color": BLACK, "linestyle": (0, (5, 1.5)), "label": "grazing (GR)"},
    "PF": {"color": VERMILLION, "linestyle": (0, (6, 1.2, 1.2, 1.2)), "label": "pitchfork (PF)"},
    "NS": {"color": BLUE, "linestyle": "-", "label": "Neimark\N{EN DASH}Sacker (NS)"},
}
ORDER = ("PF", "NS", "LP", "GR")  # of the two names of a meeting
SHADES = {"S": "#D9EAF5", "US": "#FBE6D5"}
RASTER = 420  # pixels along each side of the map of regions; a pixel is thinner than a line
SMALL = 1e-3  # of the map: regions below that get no letter
# Sizes of letters, and how many pixels of the map the rim of the region must be away for each.
LETTERS = (("large", 20.0), ("small", 13.0), ("xx-small", 8.0))
CROWDED, HEADROOM = 0.05, 0.08  # of the height: what a meeting below the top needs, and gets
PROBES = 5  # points of a region that must agree


@dataclass(frozen=True)
class Region:
    """A piece of the plane between curves: what a breather is there, and where to say so."""

    verdict: str  # "S", "US", or "" where there is none
    x: float
    y: float
    depth: float  # distance from there to the rim, in pixels of the map
    number: int


def plot_zones(
    zones: Zones | Sequence[Zones],
    ax: Axes | Sequence[Axes] | None = None,
    *,
    legend: bool = True,
    within: Window | None = None,
) -> Any:
    """Draw zone diagrams: limits of existence and stability, regions, codim-2 points.

    A region is lettered S or US by the number of unstable multipliers at several points inside of
    it, of the chain that the zones were computed for; nothing is assumed about sides of curves.
    Where a forcing allows several breathers, S means that at least one of them is stable.

    Parameters
    ----------
    zones : Zones, or a sequence of them
        One panel each.
    ax : matplotlib Axes, or as many as zones; optional
        A new figure of the width of a journal column unless given, of two columns for more than
        two panels.
    legend : bool
        Explain the curves in the first panel.
    within : dict, optional
        The windows that the zones were computed in, ``{"a": (0.95, 0.99)}``: where breathers go on
        beyond the ends of all curves the axes do so too, as far as that. Without it they end
        where the curves end.

    Returns
    -------
    matplotlib Axes, or a list of them for a sequence

    Raises
    ------
    BadInput
        If there are not as many axes as zones, or no curves.

    Examples
    --------
    >>> from contbreather.breathers.zones import zones
    >>> ax = plot_zones(zones(k=0.8, within={"gamma": (0, 0.06)}))
    >>> sorted(text.get_text() for text in ax.texts if text.get_text() in ("S", "US"))
    ['S', 'US']
    """
    several = [zones] if isinstance(zones, Zones) or not np.iterable(zones) else list(zones)
    for one in several:
        check_kind(one, Zones, "a zone diagram")
    if not several or not all(any(one.curves.values()) for one in several):
        raise BadInput("plot_zones needs at least one zone diagram, and a curve in each")
    given: list[Any] = list(ax) if isinstance(ax, Sequence | np.ndarray) else [ax]
    if ax is not None and len(given) != len(several):
        raise BadInput(f"{len(several)} zone diagrams need as many axes, got {len(given)}")
    with style() if ax is None else nullcontext():
        figure, panels = _sheet(len(several)) if ax is None else (None, given)
        draw_panels(several, panels, within)
        if legend:
            explain(panels, figure)
        for one, panel in zip(several, panels, strict=True):
            place_words(panel, names_of_meetings(one), fontsize="small")
    return panels[0] if isinstance(zones, Zones) else panels


def _sheet(count: int) -> tuple[Figure, list[Axes]]:
    """Panels in a column of a journal; more than two in both of them, so that they fit a page."""
    columns = 1 if count <= 2 else 2
    rows = -(-count // columns)
    width = COLUMN if columns == 1 else PAGE
    figure, panels = new_figure(rows, columns, width=width, height=1.0 + 5.8 * rows)
    for spare in panels[count:]:
        spare.remove()
    return figure, panels[:count]


def draw_panels(
    several: Sequence[Zones], panels: Sequence[Axes], within: Window | None = None
) -> None:
    """Everything but words and legend, which come last, when all else has its place."""
    for i, (one, panel) in enumerate(zip(several, panels, strict=True)):
        letter = f"({ascii_lowercase[i % 26]}) " if len(several) > 1 else ""
        _panel(one, panel, letter, box_of(one, within))


def _chain(zones: Zones) -> str:
    """Which ring the zones are about, and its threshold; nothing for the infinite chain."""
    sites = next((branch[0].solution.lattice.sites for _, branch in zones), None)
    return "" if sites is None else f", ring of {sites}, threshold {zones.threshold:g}"


def _panel(zones: Zones, ax: Axes, letter: str, box: Box) -> None:
    horizontal, vertical = zones.pair
    ax.set_xlabel(symbol(horizontal))
    ax.set_ylabel(symbol(vertical))
    title = f"{letter}{symbol(zones.fixed[0])} = {zones.fixed[1]:g}{_chain(zones)}"
    ax.set_title(title, loc="left", pad=3)
    for kind, branch in zones:
        ax.plot(branch[horizontal], branch[vertical], **LINES[kind])
    window = _window(zones, box)
    ax.set_xlim(window[:2])
    ax.set_ylim(window[2:])
    _shade(zones, ax, window, box)
    for point in zones.special:
        ax.plot(
            point[horizontal], point[vertical], MEETING, color=BLACK, markerfacecolor="white",
            markersize=5, markeredgewidth=0.8, zorder=4, clip_on=False,
        )  # fmt: skip


def _window(zones: Zones, box: Box) -> tuple[float, float, float, float]:
    """Limits of the axes: a little more than what is shaded, from zero where that comes near it."""
    limits: list[float] = []
    for name, (low, high) in zip(zones.pair, box, strict=True):
        start = 0.0 if low < 0.2 * high else low - 0.04 * (high - low)
        top = {"gamma": 0.25, "k": 1.0}.get(name, float("inf"))
        limits += [start, min(high + 0.04 * (high - low), top)]
    low, high = box[1]
    if any(point[zones.pair[1]] > high - CROWDED * (high - low) for point in zones.special):
        limits[3] += HEADROOM * (high - low)  # for the names of the meetings
    return limits[0], limits[1], limits[2], limits[3]


def box_of(zones: Zones, within: Window | None = None) -> Box:
    """What the curves span in both parameters, and on to the window where breathers go on."""
    spans = [extent(zones, name) for name in zones.pair]
    for i, name in enumerate(zones.pair):
        if within is None:
            continue
        across = np.linspace(*spans[1 - i], PROBES + 2)[1:-1].tolist()
        ends = list(spans[i])
        reach = {**WINDOWS, **windows(within)}[name]
        for end in (0, 1):
            # beyond the outermost curve nothing changes any more: any breather there speaks for all
            beyond = 0.5 * (ends[end] + reach[end])
            if not math.isfinite(beyond) or beyond == ends[end]:
                continue
            places = [(beyond, other)[:: 1 - 2 * i] for other in across]
            if any(_verdict(zones, *place) for place in places):
                ends[end] = reach[end]
        spans[i] = (ends[0], ends[1])
    return spans[0], spans[1]


def extent(zones: Zones, name: str) -> tuple[float, float]:
    """Smallest and largest value of one of the pair on all curves."""
    columns = [branch[name] for _, branch in zones]
    return min(float(c.min()) for c in columns), max(float(c.max()) for c in columns)


# --- regions ------------------------------------------------------------------------------------


def regions(zones: Zones, box: Box | None = None) -> tuple[list[Region], NDArray[np.int64]]:
    """The pieces into which the curves cut the plane, and a map of their numbers (rows upwards)."""
    from scipy import ndimage

    (x0, x1), (y0, y1) = box_of(zones) if box is None else box
    walls = np.zeros((RASTER, RASTER), dtype=bool)
    for _, branch in zones:
        _draw(
            walls,
            (branch[zones.pair[0]] - x0) / (x1 - x0 or 1.0),
            (branch[zones.pair[1]] - y0) / (y1 - y0 or 1.0),
        )
    numbers, count = ndimage.label(~walls)
    found = []
    for number in range(1, count + 1):
        inside = numbers == number
        if inside.sum() < SMALL * inside.size:
            continue
        depth = ndimage.distance_transform_edt(np.pad(inside, 1))[1:-1, 1:-1]
        places = _probes(depth)
        xs = x0 + (x1 - x0) * (places[:, 1] + 0.5) / RASTER
        ys = y0 + (y1 - y0) * (places[:, 0] + 0.5) / RASTER
        verdict = _agreed(zones, xs, ys)
        row, column = places[0]
        found.append(Region(verdict, float(xs[0]), float(ys[0]), float(depth[row, column]), number))
    return found, np.asarray(numbers, dtype=np.int64)


def _draw(walls: NDArray[np.bool_], x: Array, y: Array) -> None:
    """Mark the pixels of a polyline, without gaps."""
    at = np.column_stack([x, y]) * (RASTER - 1)
    steps = np.ceil(2.0 * np.abs(np.diff(at, axis=0)).max(axis=1)).astype(int) + 1
    for start, end, n in zip(at[:-1], at[1:], steps, strict=True):
        line = np.rint(start + np.linspace(0.0, 1.0, n + 1)[:, None] * (end - start)).astype(int)
        walls[line[:, 1], line[:, 0]] = True


def _probes(depth: Array) -> NDArray[np.int64]:
    """The deepest pixel of a region, then others far from it and from each other."""
    inside = np.argwhere(depth > min(3.0, 0.5 * float(depth.max())))
    places = [np.array(np.unravel_index(int(depth.argmax()), depth.shape))]
    far = np.full(len(inside), np.inf)
    for _ in range(PROBES - 1):
        far = np.minimum(far, np.sum((inside - places[-1]) ** 2, axis=1))
        places.append(inside[int(far.argmax())])
    return np.array(places)


def _agreed(zones: Zones, xs: Array, ys: Array) -> str:
    verdicts = {_verdict(zones, x, y) for x, y in zip(xs.tolist(), ys.tolist(), strict=True)}
    return verdicts.pop() if len(verdicts) == 1 else ""


def _verdict(zones: Zones, x: float, y: float) -> str:
    """S where a stable breather exists, US where only unstable ones do."""
    like = next(branch for _, branch in zones)[0].solution
    values: dict[str, Any] = {zones.fixed[0]: zones.fixed[1], zones.pair[0]: x, zones.pair[1]: y}
    try:
        found = symmetric_roots(**values, forcing=like.forcing, lattice=like.lattice)
    except NoSolution:
        return ""
    if not zones.past_folds:
        found = found[:1]  # of the breather behind the fold no limit is drawn
    counts = [
        unstable(breather.flight, breather.lattice, zones.threshold)
        for breather in found
        if breather.admissibility().ok
    ]
    return "" if not counts else "US" if min(counts) else "S"


def _shade(zones: Zones, ax: Axes, window: tuple[float, float, float, float], box: Box) -> None:
    from matplotlib.colors import to_rgba
    from scipy import ndimage

    found, numbers = regions(zones, box)
    # pixels under a curve go with the region next to them, so that no white seam shows
    nearest = ndimage.distance_transform_edt(
        numbers == 0, return_distances=False, return_indices=True
    )
    numbers = numbers[tuple(nearest)]
    image = np.zeros((*numbers.shape, 4))
    for region in found:
        if region.verdict:
            image[numbers == region.number] = to_rgba(SHADES[region.verdict])
            _letter(ax, region)
    (x0, x1), (y0, y1) = box
    ax.imshow(
        image, extent=(x0, x1, y0, y1), origin="lower", aspect="auto", interpolation="nearest",
        zorder=0,
    )  # fmt: skip
    ax.set_xlim(window[:2])
    ax.set_ylim(window[2:])


def _letter(ax: Axes, region: Region) -> None:
    """As large as fits into the region; none where none fits."""
    for size, room in LETTERS:
        if region.depth > room:
            ax.text(
                region.x, region.y, region.verdict, ha="center", va="center",
                fontsize=size, fontweight="bold", zorder=2,
            )  # fmt: skip
            return


# --- words --------------------------------------------------------------------------------------


def explain(panels: Sequence[Axes], figure: Figure | None = None) -> None:
    """Name the lines: below the panels of an own figure, else inside the first panel."""
    drawn: dict[str, Any] = {}
    for panel in panels:
        drawn |= dict(zip(*reversed(panel.get_legend_handles_labels()), strict=True))
    known = [LINES[kind]["label"] for kind in KINDS if LINES[kind]["label"] in drawn]
    labels = [*known, *(label for label in drawn if label not in known)]
    handles = [drawn[label] for label in labels]
    if figure is not None:
        figure.legend(
            handles, labels, loc="outside lower center", ncols=2, frameon=False, handlelength=2.8
        )
    else:
        panels[0].legend(handles, labels, loc="best", handlelength=2.6, framealpha=0.9)


def names_of_meetings(zones: Zones) -> list[tuple[float, float, str]]:
    """Codim-2 points as words: where, and the two kinds that meet, stability first."""
    return [
        (
            float(point[zones.pair[0]]),
            float(point[zones.pair[1]]),
            "\N{EN DASH}".join(sorted(point.kind.split("-"), key=ORDER.index)),
        )
        for point in zones.special
    ]
