"""Atlases: the curves of many zone diagrams in space, and the surfaces that they make."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import chain, pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from contbreather.checks import kind_of
from contbreather.errors import BadInput
from contbreather.orbits.atlas import words
from contbreather.orbits.zone_diagram import KINDS
from contbreather.plotting.canvas import COLUMN, Drawn, drawing, symbol
from contbreather.plotting.labels import evenly
from contbreather.plotting.zones import LINES

if TYPE_CHECKING:
    from xarray import Dataset

Array = NDArray[np.float64]
Lines = Mapping[str, Mapping[float, Sequence[Array]]]  # of a kind, at each value: (n, 3) arrays

NODES = 60  # along a curve, on its surface
FAINT = 0.25
ZOOM = 0.82
PADS = {"x": 4.0, "y": 4.0, "z": 0.0}  # points from the numbers to the name


def plot_atlas(
    atlas: Dataset,
    ax: Any = None,
    *,
    over: str | None = None,
    at: Mapping[str, float] | None = None,
    kinds: Sequence[str] = KINDS,
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
    kinds : sequence of str
        Of LP, GR, PF and NS.

    Returns
    -------
    Drawn
        The artists, with their ``axes`` and ``figure``.

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
    plane = _words(atlas, "plane")
    over = over or _only(atlas, at or {})
    if over not in atlas.variables:
        fixed = ", ".join(_words(atlas, "fixed"))
        raise BadInput(f"over = {over!r}: this atlas has no values of it, but of {fixed}.")
    lines = _lines(atlas, (plane[0], over, plane[1]), at or {}, kinds)
    if not any(lines.values()):
        raise BadInput(f"this atlas has no curves of {', '.join(kinds)} at {dict(at or {})}")
    with drawing(ax, COLUMN, projection="3d") as drawn:
        panel = drawn.axes
        values = sorted({value for curves in lines.values() for value in curves})
        for kind, curves in lines.items():
            _draw(panel, kind, curves, values)
        for name, axis in zip((plane[0], over, plane[1]), "xyz", strict=True):
            getattr(panel, f"set_{axis}label")(symbol(name), labelpad=PADS[axis])
            panel.locator_params(axis=axis, nbins=5)
        panel.set_box_aspect(None, zoom=ZOOM)  # the layout does not know of the labels
        panel.legend(loc="lower center", bbox_to_anchor=(0.5, 0.93), ncols=2, fontsize="small")
    return drawn


def _words(atlas: Any, name: str) -> list[str]:
    """Of an attribute."""
    try:
        words: str = getattr(atlas, "attrs", {})[name]
    except KeyError as error:
        kind = kind_of(atlas)
        raise BadInput(f"an atlas was expected, as contbreather.atlas makes; got {kind}") from error
    return words.split()


def _only(atlas: Dataset, at: Mapping[str, float]) -> str:
    """The parameter that has several values."""
    fixed = _words(atlas, "fixed")
    names = [*fixed, *(_words(atlas, "over") if "over" in atlas.attrs else ())]
    several = [name for name in names if name not in at and len(np.unique(atlas[name])) > 1]
    if len(several) > 1:
        raise BadInput(
            f"{' and '.join(several)} have several values: say over which it is drawn, "
            f"over={several[0]!r}, and at which value of the other, at={{{several[1]!r}: ...}}"
        )
    return several[0] if several else fixed[0]


def _lines(
    atlas: Dataset, names: Sequence[str], at: Mapping[str, float], kinds: Sequence[str]
) -> Lines:
    """The curves of each kind at each value of the third parameter."""
    for name, value in at.items():
        if name not in atlas or not np.isclose(atlas[name], value).any():
            raise BadInput(f"at {name} = {value!r}: the atlas has {_values(atlas, name)}")
    rows = np.all([np.isclose(atlas[name], value) for name, value in at.items()], axis=0)
    existing = _words(atlas.kind, "flag_meanings")
    for kind in kinds:
        if kind not in existing:
            raise BadInput(f"no surface {kind!r}; there are {existing}")
    space = np.stack([atlas[name].to_numpy() for name in names], axis=-1)
    curve, drawn = atlas.curve.to_numpy(), np.array(words(atlas, "kind"))
    lines: dict[str, dict[float, list[Array]]] = {kind: {} for kind in kinds}
    for kind in kinds:
        for number in np.unique(curve[(drawn == kind) & rows]):
            points = space[curve == number]
            lines[kind].setdefault(float(points[0, 1]), []).append(points)
    return lines


def _values(atlas: Dataset, name: str) -> object:
    return np.unique(atlas[name]).tolist() if name in atlas else f"{list(atlas)}"


def _draw(
    ax: Any, kind: str, lines: Mapping[float, Sequence[Array]], values: Sequence[float]
) -> None:
    """All curves of a kind, and the surfaces between them."""
    strips = [_strips(lines.get(low, ()), lines.get(high, ())) for low, high in pairwise(values)]
    bare = sum(not strip for strip in strips)
    missing = f", {'partly ' * (bare < len(strips))}curves alone" if bare else ""
    style = {**LINES[kind], "label": f"{LINES[kind]['label']}{missing}"}
    for value in lines:
        for points in lines[value]:
            ax.plot(*points.T, linewidth=0.8, **style)
            style.pop("label", None)  # once
    for curve, partner in chain.from_iterable(strips):
        ax.plot_surface(
            *np.stack([curve, partner]).transpose(2, 0, 1),
            color=style["color"],
            alpha=FAINT,
            linewidth=0,
            shade=False,
        )


def _strips(here: Sequence[Array], there: Sequence[Array]) -> list[tuple[Array, Array]]:
    """Curves at two neighbouring values side by side, if there are equally many."""
    if len(here) != len(there):
        return []
    left, pairs = [_even(points) for points in there], []
    for curve in map(_even, here):
        gaps = [min(_apart(curve, way), _apart(curve, way[::-1])) for way in left]
        partner = left.pop(int(np.argmin(gaps)))
        pairs.append((curve, min(partner, partner[::-1], key=lambda way: _apart(curve, way))))
    return pairs


def _even(points: Array) -> Array:
    """As many nodes for each curve, at equal distances in units of its extent."""
    extent = np.ptp(points, axis=0)
    return evenly(points, NODES, np.where(extent > 0, extent, 1.0))


def _apart(curve: Array, other: Array) -> float:
    return float(np.abs((curve - other)[:, [0, 2]]).sum())
