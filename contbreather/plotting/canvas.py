"""What every figure here has in common: size and type for a journal column, names, files, and words
beside points, each where it covers neither a curve nor another word."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from functools import cache, partial
from io import StringIO
from pathlib import Path
from string import digits
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from contbreather.checks import kind_of, number, one_of, whole
from contbreather.continuation.curve.kinds import look_of
from contbreather.errors import BadInput
from contbreather.files import writable, write_whole
from contbreather.progress import in_notebook

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.transforms import Bbox

Array = NDArray[np.float64]

FIGURES = (".png", ".pdf", ".svg")
COLUMN = 8.5  # cm, one column of a journal
PAGE = 17.5  # both columns
INCH = 2.54  # cm

# Okabe and Ito's colours: told apart by colour-blind readers, and in grey by their brightness
BLACK, ORANGE, SKY, GREEN = "#000000", "#E69F00", "#56B4E9", "#009E73"
BLUE, VERMILLION, PURPLE, GREY = "#0072B2", "#D55E00", "#CC79A7", "#777777"
CYCLE = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY, BLACK)
DASHES = ("-", "--", "-.")  # once around all colours the next lines are dashed

_ITALIC = (  # words that are letters
    "alpha", "beta", "gamma", "delta", "epsilon", "zeta", "eta", "theta", "kappa", "lambda", "mu",
    "nu", "xi", "rho", "sigma", "tau", "phi", "chi", "psi", "omega", "Gamma", "Delta", "Theta",
    "Lambda", "Xi", "Sigma", "Phi", "Psi", "Omega",
)  # fmt: skip
_VARIANTS = {"epsilon": "varepsilon", "phi": "varphi"}


def style() -> AbstractContextManager[None]:
    """Type, lines and colours of the figures here, for a journal column, within a ``with`` block.

    ``matplotlib.style.use("contbreather.plotting.journal")`` sets the same for good.

    Examples
    --------
    >>> import matplotlib
    >>> with style():
    ...     matplotlib.rcParams["font.size"]
    8.0
    """
    import matplotlib

    if in_notebook() and "matplotlib.pyplot" not in sys.modules:
        import matplotlib.pyplot

        # first loaded within the block it would forget, with the settings, to show figures
        matplotlib.pyplot.switch_backend(matplotlib.get_backend())
    return matplotlib.rc_context(_journal())


@cache
def _journal() -> Any:
    from matplotlib import rc_params_from_file

    file = Path(__file__).with_name("journal.mplstyle")
    return rc_params_from_file(file, use_default_template=False)


def new_figure(
    rows: int = 1,
    columns: int = 1,
    *,
    width: float = COLUMN,
    height: float | None = None,
    projection: str | None = None,
) -> tuple[Figure, list[Axes]]:
    """An empty figure for a journal column and its axes, row by row.

    Parameters
    ----------
    rows, columns : int
    width, height : float
        In cm; the height fits the panels unless given.
    projection : str, optional
        ``"3d"`` for axes in space.

    Returns
    -------
    figure, list of axes
        Owned by pyplot, and so shown, in notebooks and where the caller has imported pyplot.

    Examples
    --------
    >>> figure, (axes,) = new_figure()
    >>> [round(2.54 * float(inches), 3) for inches in figure.get_size_inches()]
    [8.5, 6.5]
    """
    rows, columns = whole("rows", rows, 1), whole("columns", columns, 1)
    one_of("projection", projection or "rectilinear", ("rectilinear", "3d"))
    sizes = {"width": width, "height": 6.5 * rows if height is None else height}
    wide, high = (number(name, size, 0.1, 1e4, "a size in cm") for name, size in sizes.items())
    size = (wide / INCH, high / INCH)
    from .ticks import SpacedLocator

    pyplot = sys.modules.get("matplotlib.pyplot")
    with style():
        make = _figure if pyplot is None else pyplot.figure
        figure = make(figsize=size, layout="constrained")
        kind = {"projection": projection}
        axes = figure.subplots(rows, columns, squeeze=False, subplot_kw=kind)
        if projection != "3d":
            for panel in axes.flat:
                panel.xaxis.set_major_locator(SpacedLocator())
    return figure, list(axes.ravel())


def _figure(**look: Any) -> Figure:
    """Figure that pyplot does not know."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    return FigureCanvasAgg(Figure(**look)).figure


def inline(draw: Callable[[Axes], object]) -> str:
    """Draw into axes of a new figure, and write that as one ``<svg>`` element."""
    with style():
        figure = _figure(figsize=(COLUMN / INCH, 6.0 / INCH), layout="constrained")
        draw(figure.subplots())
        file = StringIO()
        figure.savefig(file, format="svg", metadata={"Date": None, "Creator": None})
    text = file.getvalue()
    return text[text.index("<svg") :]  # not the prologue of a file of its own


class Drawn(list["Artist"]):
    """The artists that a plot has added to its axes, in matplotlib's order: lines, words, ...

    Attributes
    ----------
    axes : matplotlib Axes
        Where they are.

    Examples
    --------
    >>> import contbreather as cb
    >>> drawn = cb.plot(cb.trace(cb.symmetric(0.5, 0.04, 0.8), "a", within={"a": (0.5, 0.6)}))
    >>> drawn[0].set_linewidth(3.0)
    >>> drawn.axes.set_ylabel("half the momentum").get_text()
    'half the momentum'
    """

    def __init__(self, axes: Any) -> None:
        if isinstance(axes, type) or not hasattr(axes, "get_lines"):
            raise BadInput(f"matplotlib Axes to draw in were expected, got {kind_of(axes)}")
        self.axes, self._before = axes, set(axes.get_children())
        legend = axes.get_legend()  # what is drawn over another picture goes on from it
        words = [text.get_text() for text in legend.get_texts()] if legend else []
        self.told = [*zip(legend.legend_handles, words, strict=True)] if legend else []

    @property
    def figure(self) -> Figure:
        figure: Figure = self.axes.get_figure(root=True)
        return figure

    def show(self) -> None:
        """Open a window with the figure, as ``pyplot.show`` does, which has to be told of what was
        drawn before pyplot was there."""
        from matplotlib import pyplot

        pyplot.figure(self.figure)
        pyplot.show()

    def finish(self) -> None:
        """Take in what has come into the axes."""
        self[:] = [artist for artist in self.axes.get_children() if artist not in self._before]

    def __repr__(self) -> str:
        return f"<Drawn: {len(self)} artists>"


@contextmanager
def drawing(
    ax: Axes | None, height: float | None = None, projection: str | None = None
) -> Iterator[tuple[Drawn, Any]]:
    """Draw into the axes given, in the caller's own style, or into new ones in that of a journal
    column."""
    with style() if ax is None else nullcontext():
        if ax is None:
            ax = new_figure(height=height, projection=projection)[1][0]
        drawn = Drawn(ax)
        yield drawn, ax
        drawn.finish()


def legend_size(axes: Axes) -> float:
    return 0.875 * float(axes.xaxis.label.get_fontsize())


def type_size(axes: Axes, name: str) -> float:
    """Size by one of matplotlib's names, "small" for instance, beside the words of the axes: these
    may be of another style than the one in force."""
    from matplotlib.font_manager import font_scalings

    return font_scalings[name] * float(axes.xaxis.label.get_fontsize())


def legend_above(axes: Any, **more: Any) -> None:
    """Draw a legend over the right end of the axes, in as few rows as fit; of very many lines the
    first."""
    look = {"frameon": False, "handlelength": 2.2, **more}
    handles, names = axes.get_legend_handles_labels()
    for columns in range(len(names), 0, -1):
        most = 4 * columns  # rows above that are as high as the axes
        legend = axes.legend(handles[:most], names[:most], ncols=columns, loc="lower right",
                             bbox_to_anchor=(1.0, 0.97), **look)  # fmt: skip
        if legend.get_window_extent().width <= axes.bbox.width:
            break


def fitting_legend(
    drawn: Drawn, pixel: float, handles: Iterable[Any], names: Iterable[str], **more: Any
) -> float:
    """Draw a legend, behind what another one said, inside of laid out axes where it is small and
    covers no curve, else above them in as many columns as fit, or where no layout makes room there
    inside all the same: the part of the height of the figure that it takes."""
    ax, every = drawn.axes, [*drawn.told, *zip(handles, names, strict=True)]
    entries = {(name, str(getattr(one, "get_color", str)())): one for one, name in every}
    if not entries:
        return 0.0
    handles, names = [*entries.values()], [name for name, _ in entries]
    look = {"handlelength": 2.2, "fontsize": legend_size(ax), **more}
    legend = partial(ax.legend, handles, names, **look)
    inside = legend(loc="best")
    if len(names) < len(CYCLE) and not ink_of(ax, pixel)(inside.get_window_extent()):
        return 0.0
    over = (ax.get_tightbbox().y1 - ax.bbox.y0) / ax.bbox.height  # above the title, too
    whole, spec = ax.figure.bbox, ax.get_subplotspec()
    room = whole.width * (len(spec.colspan) / spec.get_gridspec().ncols if spec else 1.0)
    if fixed := ax.figure.get_layout_engine() is None:  # nothing makes room for it
        room = ax.bbox.width
    for columns in (3, 2, 1):
        above = legend(loc="lower center", bbox_to_anchor=(0.5, over), ncols=columns)
        size = above.get_window_extent()
        if size.width < room:
            break
    others = [other.bbox for other in ax.figure.axes if other is not ax]
    if fixed and (size.y1 > whole.y1 or size.count_overlaps(others)):
        inside = legend(loc="best", ncols=columns)
        inside.set_frame_on(True)  # words are read off the curves that it covers
        size = inside.get_window_extent()
    return float(size.height / whole.height)


def save_figure(figure: Figure | Artist | Sequence[Any], path: str | Path) -> Path:
    """Write a figure, by anything that is drawn in it too, as PNG, PDF or SVG, whole or not at all.

    Raises
    ------
    BadInput
        For what has no figure, another suffix, a directory, or a place that cannot be written.
    """
    if isinstance(figure, str | Path) and not isinstance(path, str | Path):
        raise BadInput(
            f"the figure comes first, save_figure(figure, {str(figure)!r}), then its file"
        )
    target = figure_path(path)
    kind = target.suffix.lower().removeprefix(".")
    # no date inside: the same figure gives the same file
    metadata = {"pdf": {"CreationDate": None}, "svg": {"Date": None}}.get(kind)
    artist: Any = figure
    while isinstance(artist, list | tuple) and artist:
        artist = artist.axes if isinstance(artist, Drawn) else artist[0]
    if not hasattr(artist, "get_figure"):
        raise BadInput(f"a figure or something drawn in one is expected, got {kind_of(figure)}")
    whole = artist.get_figure(root=True)  # a figure is its own
    if whole is None:
        raise BadInput("these axes have no figure any more; draw them anew")
    with style():
        return write_whole(
            target, lambda file: whole.savefig(file, format=kind, dpi=300, metadata=metadata)
        )


def figure_path(path: str | Path) -> Path:
    target = writable(path)
    if target.suffix.lower() not in FIGURES:
        raise BadInput(
            f"cannot write the figure {target}: its suffix must be one of {', '.join(FIGURES)}"
        )
    return target


def symbol(name: str) -> str:
    """Write a name as on an axis: letters, Greek ones too, in italics, with their numbers as
    indices; words upright."""
    letter = name.rstrip(digits)
    index = f"_{{{name[len(letter) :]}}}" if letter != name else ""
    if letter in _ITALIC:
        return rf"$\{_VARIANTS.get(letter, letter)}{index}$"
    return f"${name[0]}{index}$" if len(letter) == 1 and letter.isalpha() else name


def name_axes(ax: Axes, x: str, y: str) -> None:
    """Label axes; those with something of another quantity in them are refused."""
    for axis, name in ((ax.xaxis, x), (ax.yaxis, y)):
        there = axis.label.get_text()
        if there not in ("", name) and ax.has_data():
            raise BadInput(
                f"these axes show {there} where {name} was to be drawn: draw it into axes of their "
                "own, choose the same columns x and y, or set another label when all is drawn"
            )
    ax.set(xlabel=x, ylabel=y)


def text_colour(ax: Axes) -> str:
    from matplotlib.colors import to_hex

    return to_hex(ax.xaxis.label.get_color())


def to_the_rim(artists: Iterable[Artist]) -> None:
    """Show artists whole where they stand on the edge of their axes, and not where they lie beyond
    it, as after other limits were set."""
    from matplotlib.transforms import Bbox, TransformedBbox

    wider = Bbox.unit().padded(0.015)  # half of a marker
    for artist in artists:
        assert artist.axes is not None
        artist.set_clip_box(TransformedBbox(wider, artist.axes.transAxes))


def kinds_of(kinds: object) -> list[str]:
    """Hand over the words for the kinds that were asked for, or refuse what is none."""
    if isinstance(kinds, Iterable) and not isinstance(kinds, str):
        given = [*kinds]
        if all(isinstance(kind, str) for kind in given):
            return given
    raise BadInput(f"kinds = {kinds!r}: several were expected, as in kinds=('PF', 'NS')")


def marker_of(kind: str) -> dict[str, Any]:
    """Marker of a kind, and its size in points: those with little inside are larger."""
    marker = look_of(kind).marker
    size = {"*": 9.0}.get(marker, 5.0 if marker in ".XxP" else 4.5)
    return {"marker": marker, "markersize": size, "linestyle": "none"}


# --- words beside points --------------------------------------------------------------------------


def lay_out(ax: Axes) -> float:
    """Let the layout come to rest, so that positions in pixels are final; pixels in a typographic
    point."""
    figure: Any = ax.get_figure(root=True)
    figure.draw_without_rendering()
    return float(figure.dpi) / 72.0


def place_words(
    ax: Axes, pixel: float, words: Iterable[tuple[float, float, str, dict[str, Any]]]
) -> None:
    """Write words beside points of finished axes, which are laid out, each in its style: close by,
    to the upper right before elsewhere, where they cover least of other words and the legend, are
    nearest to their own point, and cover least of curves, a line that leads to a point farther off
    among them. Points outside of the axes get none."""
    from matplotlib.transforms import Bbox

    ink = ink_of(ax, pixel)
    inner, outer = ax.bbox.padded(-3.0 * pixel), ax.bbox.padded(2.0 * pixel)  # off ticks, at rim
    taken = [word.get_window_extent() for word in (*ax.texts, ax.get_legend()) if word]
    angles = np.pi * (0.25 + np.arange(16) / 8.0)
    sides = np.column_stack([np.cos(angles), np.sin(angles)])
    placed = list(words)
    every = ax.transData.transform(np.reshape([word[:2] for word in placed], (-1, 2)))
    for own, (point, (x, y, text, style)) in enumerate(zip(every, placed, strict=True)):
        if not outer.contains(*point):
            continue
        look = {"fontsize": "small", **style, "ha": "center", "va": "center"}
        look["fontsize"] = type_size(ax, look["fontsize"])
        word = ax.annotate(text, (x, y), (0, 0), textcoords="offset points", **look)
        half = 0.5 * np.asarray(word.get_window_extent().size)
        beside = half * np.clip(1.5 * sides, -1.0, 1.0)
        ways = np.concatenate([gap * pixel * sides + beside for gap in range(3, 33, 3)])
        low, high = point + ways - half - pixel, point + ways + half + pixel
        boxes = [Bbox(ends) for ends in np.stack([low, high], axis=1)]
        off = [np.linalg.norm(np.clip(one, low, high) - one, axis=1) for one in every]
        nearer = np.sum(off <= off[own], axis=0)
        crowded = [
            (box.count_overlaps(taken) + (inner.count_contains(box.corners()) < 4), count)
            for box, count in zip(boxes, nearer, strict=True)
        ]
        least = min(crowded)
        free = [i for i, crowd in enumerate(crowded) if crowd == least]
        best = min(free, key=lambda i: ink(boxes[i]) + pixel * off[own][i])
        word.set_position(tuple(ways[best] / pixel))
        taken.append(boxes[best])
        corner = np.clip(point, low[best], high[best]) - point
        if np.hypot(*corner) > 12.0 * pixel:  # too far to be read without a line that leads there
            leads = {"arrowstyle": "-", "linewidth": 0.4, "color": GREY, "shrinkA": 0, "shrinkB": 2}
            there = tuple(corner / pixel)
            ax.annotate("", (x, y), there, textcoords="offset points", arrowprops=leads)


def ink_of(ax: Axes, pixel: float) -> Callable[[Bbox], float]:
    """Function of a box: the area of the lines and markers of finished axes that it covers."""
    rows = [np.empty((0, 4))]  # of pieces of lines: place, half of the width, area
    for line in ax.get_lines():
        nodes = line.get_transform().transform(line.get_xydata())
        nodes = nodes[np.isfinite(nodes).all(axis=1)]
        drawn = line.get_linestyle() != "None" and len(nodes) > 1
        points = evenly(nodes, 500) if drawn else nodes
        width = pixel * (line.get_linewidth() if drawn else line.get_markersize())
        length = float(np.linalg.norm(points[1] - points[0])) if drawn else width
        sizes = np.full((len(points), 2), [0.5 * width, width * length])
        rows.append(np.hstack([points, sizes]))
    place, half, area = np.split(np.concatenate(rows), [2, 3], axis=1)

    def ink(box: Bbox) -> float:
        covered = (box.min < place + half) & (place - half < box.max)
        return float(area[covered.all(axis=1)].sum())

    return ink


def evenly(nodes: Array, count: int, scale: Array | float = 1.0) -> Array:
    """Points at equal distances along a polyline, its coordinates in units of `scale`."""
    steps = np.linalg.norm(np.diff(nodes / scale, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    at = np.linspace(0.0, along[-1], count)
    return np.column_stack([np.interp(at, along, column) for column in nodes.T])
