"""What every figure here has in common: size and type for a journal column, names, files."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from contbreather.errors import BadInput
from contbreather.files import writable, write_whole

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FIGURES = (".png", ".pdf", ".svg")
COLUMN = 8.5  # cm, one column of a journal
PAGE = 17.5  # both columns
CM = 1.0 / 2.54

# Okabe and Ito's colours: told apart by colour-blind readers, and in grey by their brightness
BLACK, ORANGE, SKY, GREEN = "#000000", "#E69F00", "#56B4E9", "#009E73"
BLUE, VERMILLION, PURPLE, GREY = "#0072B2", "#D55E00", "#CC79A7", "#777777"
CYCLE = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY, BLACK)

# One marker for each kind of special point; kinds that are not listed get the last one.
MARKERS = {
    "LP": "s", "BP": "D", "PF": "^", "NS": "o", "PD": "v", "GR": "X", "HB": "*", "UZ": "P",
    "EP": ".", "MX": "x", "CP": "h", "VI": "<",
}  # fmt: skip
MEETING = "p"
SIZE = 4.5
SIZES = {"*": 9.0, "X": 5.0, "x": 5.0, "P": 5.0}  # of markers with little inside

_TEXT = 8.0
_STYLE: dict[str, Any] = {
    "font.size": _TEXT,
    "axes.labelsize": _TEXT,
    "axes.titlesize": _TEXT,
    "xtick.labelsize": _TEXT - 1,
    "ytick.labelsize": _TEXT - 1,
    "legend.fontsize": _TEXT - 1,
    "axes.linewidth": 0.6,
    "lines.linewidth": 1.2,
    "xtick.direction": "in",
    "ytick.direction": "in",
    "xtick.top": True,
    "ytick.right": True,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.major.size": 2.5,
    "ytick.major.size": 2.5,
    "pdf.fonttype": 42,  # text stays text
    "svg.fonttype": "none",
    "svg.hashsalt": "contbreather",  # the same figure, the same file
}

_SYMBOLS = {
    "gamma": r"$\gamma$", "phi": r"$\varphi$", "nu": r"$\nu$", "a": "$a$", "k": "$k$", "p": "$p$",
    "t": "$t$", "c": "$c$", "t1": "$t_1$", "t2": "$t_2$", "d": "$d$", "mu": r"$\mu$",
}  # fmt: skip


def style() -> AbstractContextManager[None]:
    """Type and line widths for a journal column, while figures are made or saved."""
    import matplotlib

    return matplotlib.rc_context(_STYLE)  # type: ignore[arg-type]  # keys by name, as a dict


def new_figure(
    rows: int = 1, columns: int = 1, *, width: float = COLUMN, height: float | None = None
) -> tuple[Figure, list[Axes]]:
    """An empty figure for a journal column and its axes, row by row.

    Parameters
    ----------
    rows, columns : int
    width, height : float
        In cm; the height fits the panels unless given.

    Returns
    -------
    figure, list of axes
        Owned by pyplot, and so shown by notebooks, only if the caller has imported pyplot.

    Examples
    --------
    >>> figure, (axes,) = new_figure()
    >>> [round(2.54 * float(inches), 3) for inches in figure.get_size_inches()]
    [8.5, 6.5]
    """
    height = 6.5 * rows if height is None else height
    size = (width * CM, height * CM)
    pyplot = sys.modules.get("matplotlib.pyplot")
    with style():
        if pyplot is not None:
            figure = pyplot.figure(figsize=size, layout="constrained")
        else:
            from matplotlib.backends.backend_agg import FigureCanvasAgg
            from matplotlib.figure import Figure

            figure = Figure(figsize=size, layout="constrained")
            FigureCanvasAgg(figure)
        axes = figure.subplots(rows, columns, squeeze=False)
    return figure, list(axes.ravel())


@contextmanager
def axes_or_new(ax: Axes | None, height: float | None = None) -> Iterator[Axes]:
    """The axes given, in the caller's own style, or new ones in that of a journal column."""
    if ax is not None:
        yield ax
        return
    with style():
        yield new_figure(height=height)[1][0]


def save_figure(figure: Figure | Axes | Sequence[Axes], path: str | Path) -> Path:
    """Write a figure, by any of its axes too, as PNG, PDF or SVG, whole or not at all.

    Raises
    ------
    BadInput
        For another suffix, a directory, or a place that cannot be written.
    """
    target = figure_path(path)
    kind = target.suffix.lower().removeprefix(".")
    # no date inside: the same figure gives the same file
    metadata = {"pdf": {"CreationDate": None}, "svg": {"Date": None}}.get(kind)
    one = figure[0] if isinstance(figure, Sequence) else figure
    whole = one.get_figure(root=True)  # a figure is its own
    if whole is None:
        raise BadInput("these axes have no figure any more; draw them anew")
    with style():
        return write_whole(
            target, lambda file: whole.savefig(file, format=kind, dpi=300, metadata=metadata)
        )


def figure_path(path: str | Path) -> Path:
    """The path of a figure: its suffix says the format."""
    target = writable(path)
    if target.suffix.lower() not in FIGURES:
        raise BadInput(
            f"cannot write the figure {target}: its suffix must be one of {', '.join(FIGURES)}"
        )
    return target


def symbol(name: str) -> str:
    """A name as it is written on an axis."""
    return _SYMBOLS.get(name, name)


def marker(kind: str) -> str:
    """The marker of a kind of special point; meetings of two kinds share one."""
    return MEETING if "-" in kind else MARKERS.get(kind, "d")


def size(kind: str) -> float:
    """How large the marker of a kind is drawn: all fill about the same area."""
    return SIZES.get(marker(kind), SIZE)
