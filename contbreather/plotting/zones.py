"""Zone diagrams as in the paper's Fig. 2: curves of existence and stability, S and US regions;
many of them in space, and the surfaces that their curves make."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import nullcontext
from itertools import chain, pairwise
from string import ascii_lowercase
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from contbreather.checks import check_kind, flag, one_of
from contbreather.continuation.curve.branch import Branch
from contbreather.continuation.curve.kinds import MEETING, look_of
from contbreather.errors import BadInput
from contbreather.lattice.forcing import Harmonic
from contbreather.lattice.parse import as_typed
from contbreather.orbits.atlas import check_atlas, words
from contbreather.orbits.zone_diagram import KINDS, Box, Region, Zones
from contbreather.parameters import NUMBERS
from contbreather.plotting import canvas
from contbreather.plotting.canvas import BLACK, COLUMN, PAGE, Drawn

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from xarray import Dataset

Array = NDArray[np.float64]
Window = Mapping[str, tuple[float, float]]
Lines = Mapping[str, Mapping[float, Sequence[Array]]]  # of a kind, at each value: (n, 3) arrays

_DASHES: dict[str, Any] = {
    "solid": "-",
    "dashed": (0, (5, 1.5)),
    "dashdot": (0, (6, 1.2, 1.2, 1.2)),
}
LINES: dict[str, dict[str, Any]] = {
    kind: {
        "color": getattr(canvas, look_of(kind).colour.upper()),
        "linestyle": _DASHES[look_of(kind).line],
        "label": f"{look_of(kind).name} ({kind})",
    }
    for kind in KINDS
}
CEILING: dict[str, Any] = {"color": BLACK, "linestyle": ":", "label": r"no impact left, $p \to 0$"}
SHADES = {"S": "#D9EAF5", "US": "#FBE6D5"}
# Sizes of letters, and how far away the edge of the region must be for each.
LETTERS = (("large", 0.048), ("small", 0.031), ("xx-small", 0.019))


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
    Where a forcing allows several breathers, S means that at least one of them is stable. White
    regions have no breather of the families that the diagram is of: lower ones may be there if it
    is of the upper ones (`Region.describe` says so).

    Parameters
    ----------
    zones : Zones, or a sequence of them
        One panel each.
    ax : matplotlib Axes, or as many as zones, in rows or not; optional
        A new figure of the width of a journal column unless given, of two columns for more than
        two panels.
    legend : bool
        Explain the curves in the first panel.
    within : dict, optional
        Windows, ``{"a": (0.95, 0.99)}``, up to which axes go on where breathers do, beyond the ends
        of all curves; those that the zones were computed in unless given.

    Returns
    -------
    Drawn, or a list of them for a sequence
        The artists, with their ``axes`` and ``figure``.

    Raises
    ------
    BadInput
        If there are not as many axes as zones, or no curves.

    Examples
    --------
    >>> from contbreather.orbits.zones import zones
    >>> ax = plot_zones(zones(k=0.8, within={"gamma": (0, 0.06)})).axes
    >>> sorted(text.get_text() for text in ax.texts if text.get_text() in ("S", "US"))
    ['S', 'US']
    """
    alone = isinstance(zones, Zones | Branch) or not np.iterable(zones)
    several: list[Any] = [zones] if alone else list(zones)
    for diagram in several:
        check_kind(diagram, Zones, "a zone diagram", "plot draws branches")
    if not several or not all(any(diagram.curves.values()) for diagram in several):
        raise BadInput("plot_zones needs at least one zone diagram, and a curve in each")
    given: Any = list(ax) if np.iterable(ax) else [] if ax is None else ax
    axes = list(dict.fromkeys(Drawn(panel).axes for panel in np.ravel(given)))
    if ax is not None and len(axes) != len(several):
        raise BadInput(f"{len(several)} zone diagrams need as many axes, got {len(axes)}")
    kinds = {look["label"] for look in LINES.values()}
    if any(line.get_label() in kinds for panel in axes for line in panel.get_lines()):
        raise BadInput(
            "these axes have a zone diagram, whose regions another one would cover: draw it into "
            "axes of its own, or curves of several, plot(*diagram.curves['NS'], ...)"
        )
    with canvas.style() if ax is None else nullcontext():
        figure, panels = _sheet(len(several)) if ax is None else (None, axes)
        drawn = [Drawn(panel) for panel in panels]
        draw_panels(several, panels, within)
        if flag("legend", legend):
            explain(panels, figure)
        pixel = canvas.lay_out(panels[0])
        for diagram, panel in zip(several, panels, strict=True):
            names = ((*name, {"color": BLACK}) for name in names_of_meetings(diagram))
            canvas.place_words(panel, pixel, names)
    for panel_drawn in drawn:
        panel_drawn.finish()
    return drawn[0] if isinstance(zones, Zones) else drawn


def _sheet(count: int) -> tuple[Figure, list[Axes]]:
    """Panels in a column of a journal; more than two in both of them, so that they fit a page."""
    columns = 1 if count <= 2 else 2
    rows = -(-count // columns)
    width = COLUMN if columns == 1 else PAGE
    figure, panels = canvas.new_figure(rows, columns, width=width, height=1.0 + 5.8 * rows)
    for spare in panels[count:]:
        spare.remove()
    return figure, panels[:count]


def draw_panels(
    several: Sequence[Zones], panels: Sequence[Axes], within: Window | None = None
) -> None:
    """Draw everything but words and legend, which come last, when all else has its place."""
    for i, (diagram, panel) in enumerate(zip(several, panels, strict=True)):
        letter = f"({ascii_lowercase[i % 26]}) " if len(several) > 1 else ""
        _panel(diagram, panel, letter, within)


def _chain(zones: Zones) -> str:
    """Model of the zones, where it is not the infinite chain under the paper's forcing."""
    model = zones.model
    words = []
    if model["lattice"].sites is not None:
        held = [(name, model.get(name)) for name in ("site", "damping", "spring")]
        also = [f"{name} {value:g}" for name, value in held if value]
        walls = as_typed(model["walls"]) if "walls" in model else ""
        also += [f"walls {walls}"] if walls else []
        words = [model["lattice"].describe(), *also, f"threshold {zones.threshold:g}"]
    forcing = model["forcing"]
    if not isinstance(forcing, Harmonic):
        values = [f"{canvas.symbol(name)} = {value:g}" for name, value in forcing.params.items()]
        words += values or [forcing.describe()]
    return "".join(f", {word}" for word in words)


def _panel(zones: Zones, ax: Axes, letter: str, within: Window | None) -> None:
    horizontal, vertical = zones.pair
    # white where there is no breather, also in a dark style
    ax.set(xlabel=canvas.symbol(horizontal), ylabel=canvas.symbol(vertical), facecolor="white")
    at = [f"{canvas.symbol(name)} = {x:g}" for name, x in (zones.fixed, *zones.held.items())]
    title = f"{letter}{', '.join(at)}{_chain(zones)}"
    words = ax.set_title(title, loc="left", pad=3)
    pixels = 0.5 * float(words.get_fontsize()) * ax.figure.dpi / 72  # half as wide as high
    words.set_text(fill(title, int(ax.get_window_extent().width / pixels)))
    for kind, branch in zones:
        ax.plot(branch[horizontal], branch[vertical], **LINES[kind])
    box = zones.box(within)
    if zones.ceiling is not None:
        ax.plot(box[0], 2 * [zones.ceiling], **CEILING)
    _shade(ax, zones.regions if within is None else zones.regions_of(box))
    window = _window(zones, box)
    ax.set(xlim=window[:2], ylim=window[2:])
    for point in zones.special:
        canvas.to_the_rim(ax.plot(
            point[horizontal], point[vertical], MEETING.marker, color=BLACK, zorder=4,
            markerfacecolor="white", markersize=5, markeredgewidth=0.8,
        ))  # fmt: skip


def _window(zones: Zones, box: Box) -> tuple[float, float, float, float]:
    """Limits of the axes: a little more than what is shaded, from zero where that comes near it."""
    limits: list[float] = []
    for name, (low, high) in zip(zones.pair, box, strict=True):
        start = 0.0 if low < 0.2 * high else low - 0.04 * (high - low)
        top = NUMBERS[name].high if name in NUMBERS else float("inf")
        # of another frequency they go on beyond that end
        limits += [start, max(high, min(high + 0.04 * (high - low), top))]
    low, high = box[1]
    if any(point[zones.pair[1]] > high - 0.05 * (high - low) for point in zones.special):
        limits[3] += 0.08 * (high - low)  # for the names of the meetings
    return limits[0], limits[1], limits[2], limits[3]


def _shade(ax: Axes, regions: Sequence[Region]) -> None:
    """Colour regions and letter them, as large as fits; not where none fits."""
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    look: dict[str, Any] = {"ha": "center", "va": "center", "zorder": 2, "clip_on": True}
    for region in regions:
        word, size = region.verdict, next((size for size, r in LETTERS if region.room > r), None)
        if word:
            rings = [Path(ring, closed=True) for ring in (region.outline, *region.holes)]
            shape = Path.make_compound_path(*rings)
            ax.add_patch(PathPatch(shape, color=SHADES[word], linewidth=0, zorder=0))
        elif len({*region.beyond}) == 1 and size == LETTERS[0][0]:  # what is in a white region
            word, size = region.beyond[0].replace(": ", ":\n"), "x-small"
        if word and size:
            look |= {"fontweight": "bold" if region.verdict else "normal", "color": BLACK}
            ax.text(region.x, region.y, word, fontsize=canvas.type_size(ax, size), **look)


# --- words --------------------------------------------------------------------------------------


def explain(panels: Sequence[Axes], figure: Figure | None = None) -> None:
    """Name the lines: below the panels of an own figure, else inside the first panel or above."""
    drawn: dict[str, Any] = {}
    for panel in panels:
        drawn |= dict(zip(*reversed(panel.get_legend_handles_labels()), strict=True))
    named = [LINES[kind]["label"] for kind in KINDS]
    labels = [label for label in dict.fromkeys([*named, *drawn]) if label in drawn]
    handles = [drawn[label] for label in labels]
    if figure is not None:
        figure.legend(
            handles, labels, loc="outside lower center", ncols=2, frameon=False, handlelength=2.8
        )
    else:
        pixel, white = canvas.lay_out(panels[0]), {"facecolor": "white", "labelcolor": BLACK}
        canvas.fitting_legend(Drawn(panels[0]), pixel, handles, labels, handlelength=2.6, **white)


def names_of_meetings(zones: Zones) -> list[tuple[float, float, str]]:
    """Places and names of codim-2 points, the kinds that meet, stability first."""
    x, y = zones.pair
    return [
        (float(point[x]), float(point[y]), name.replace("-", "\N{EN DASH}"))
        for point, name in zip(zones.special, zones.meetings(), strict=True)
    ]


# --- atlases --------------------------------------------------------------------------------------


def plot_atlas(
    atlas: Dataset,
    ax: Any = None,
    *,
    over: str | None = None,
    at: Mapping[str, float] | None = None,
    kinds: Iterable[str] = KINDS,
) -> Drawn:
    """Draw the limits of existence and stability over a third parameter, as surfaces.

    Between neighbouring values a surface is drawn where both have equally many curves of a kind;
    the curves themselves are drawn everywhere, and the legend says which kinds are curves alone,
    everywhere or between some of the values: values closer together may join them.

    Parameters
    ----------
    atlas : xarray.Dataset
        Of `contbreather.orbits.atlas`.
    ax : matplotlib Axes3D, optional
        A new figure unless given.
    over : str, optional
        The third parameter; unless given the one that has several values.
    at : dict, optional
        Values of the others that have several, ``{"k": 0.8}``.
    kinds : iterable of str
        Of LP, GR, PF and NS.

    Raises
    ------
    BadInput
        If it is not clear which parameter is meant, or nothing is there.

    Examples
    --------
    >>> from contbreather.orbits.atlas import atlas
    >>> found = atlas(k=[0.7, 0.8], within={"gamma": (0.0, 0.02)}, executor=1)
    >>> axes = plot_atlas(found).axes
    >>> axes.get_ylabel(), [text.get_text() for text in axes.get_legend().get_texts()]
    ('$k$', ['fold (LP)', 'grazing (GR)', 'pitchfork (PF)'])
    """
    check_atlas(atlas)
    plane = atlas.attrs["plane"].split()
    over = _over(atlas, over, at or {})
    kinds = canvas.kinds_of(kinds)
    lines = _lines(atlas, (plane[0], over, plane[1]), at or {}, kinds)
    if not any(lines.values()):
        raise BadInput(f"this atlas has no curves of {', '.join(kinds)} at {dict(at or {})}")
    with canvas.drawing(ax, COLUMN, projection="3d") as (drawn, panel):
        values = sorted({value for curves in lines.values() for value in curves})
        for kind, curves in lines.items():
            _draw(panel, kind, curves, values)
        for name, axis, pad in zip((plane[0], over, plane[1]), "xyz", (4.0, 4.0, 0.0), strict=True):
            getattr(panel, f"set_{axis}label")(canvas.symbol(name), labelpad=pad)
            panel.locator_params(axis=axis, nbins=5)
        panel.set_box_aspect(None, zoom=0.82)  # the layout does not know of the labels
        small = canvas.legend_size(panel)
        panel.legend(loc="lower center", bbox_to_anchor=(0.5, 0.93), ncols=2, fontsize=small)
    return drawn


def _over(atlas: Dataset, over: str | None, at: Mapping[str, float]) -> str:
    """Name the third parameter; of others that have several values one is to be given."""
    fixed: list[str] = atlas.attrs["fixed"].split()
    names = [*fixed, *atlas.attrs.get("over", "").split()]
    several = [name for name in names if name not in at and len(np.unique(atlas[name])) > 1]
    if over is None and len(several) > 1:
        raise BadInput(
            f"{' and '.join(several)} have several values: say over which it is drawn, "
            f"over={several[0]!r}, and at which value of the other, at={{{several[1]!r}: ...}}"
        )
    over = over or (several or fixed)[0]
    if over not in atlas.variables:
        raise BadInput(
            f"over = {over!r}: this atlas has no values of it, but of {', '.join(fixed)}."
        )
    if others := [name for name in several if name != over]:
        have = "has" if len(others) == 1 else "have"
        raise BadInput(
            f"{' and '.join(others)} {have} several values: say at which it is drawn over {over}, "
            f"at={{{', '.join(f'{name!r}: ...' for name in others)}}}"
        )
    return over


def _lines(
    atlas: Dataset, names: Sequence[str], at: Mapping[str, float], kinds: Sequence[str]
) -> Lines:
    for name, value in at.items():
        if name not in atlas or not np.isclose(atlas[name], value).any():
            there = np.unique(atlas[name]).tolist() if name in atlas else list(atlas)
            raise BadInput(f"at {name} = {value!r}: the atlas has {there}")
    rows = np.all([np.isclose(atlas[name], value) for name, value in at.items()], axis=0)
    for kind in kinds:
        one_of("a kind", kind, atlas.kind.attrs["flag_meanings"].split())
    space = np.stack([atlas[name].to_numpy() for name in names], axis=-1)
    curve, drawn = atlas.curve.to_numpy(), np.array(words(atlas, "kind"))
    lines: dict[str, dict[float, list[Array]]] = {kind: {} for kind in kinds}
    for kind in kinds:
        for number in np.unique(curve[(drawn == kind) & rows]):
            points = space[curve == number]
            lines[kind].setdefault(float(points[0, 1]), []).append(points)
    return lines


def _draw(
    ax: Any, kind: str, lines: Mapping[float, Sequence[Array]], values: Sequence[float]
) -> None:
    strips = [_strips(lines.get(low, ()), lines.get(high, ())) for low, high in pairwise(values)]
    bare = sum(not strip for strip in strips)
    missing = f", {'partly ' * (bare < len(strips))}curves alone" if bare else ""
    style = {**LINES[kind], "label": f"{LINES[kind]['label']}{missing}"}
    for value in lines:
        for points in lines[value]:
            ax.plot(*points.T, linewidth=0.8, **style)
            style.pop("label", None)  # once
    for curve, partner in chain.from_iterable(strips):
        look = {"color": style["color"], "alpha": 0.25, "linewidth": 0, "shade": False}
        ax.plot_surface(*np.stack([curve, partner]).transpose(2, 0, 1), **look)


def _strips(here: Sequence[Array], there: Sequence[Array]) -> list[tuple[Array, Array]]:
    """Pair curves at two neighbouring values, if there are equally many."""
    if len(here) != len(there):
        return []
    left, pairs = [_even(points) for points in there], []
    for curve in map(_even, here):
        # each of the other ones, walked both ways: how far it is off, at one value apart
        ways = [(i, way) for i, other in enumerate(left) for way in (other, other[::-1])]
        gaps = [float(np.abs((curve - way)[:, [0, 2]]).sum()) for _, way in ways]
        nearest, partner = ways[int(np.argmin(gaps))]
        del left[nearest]
        pairs.append((curve, partner))
    return pairs


def _even(points: Array) -> Array:
    extent = np.ptp(points, axis=0)
    return canvas.evenly(points, 60, np.where(extent > 0, extent, 1.0))
