"""Words beside points: each where it covers neither a curve nor another word."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.legend import Legend
    from matplotlib.text import Annotation, Text

Array = NDArray[np.float64]

_RADII = (3.0, 6.0, 10.0, 15.0, 22.0, 30.0, 40.0, 55.0, 70.0)  # points, from the point to the word
_DIRECTIONS = 16
_RIM = 3.0  # points between a word and the axes, ticks included
_LEADER = 12.0  # words farther off than that are tied to their point by a line
_SPACING = 2.0  # points between two samples of a curve


@dataclass
class Labels:
    """The words of one pair of axes, placed one after the other; first come, first served."""

    ax: Axes
    taken: list[Array] = field(default_factory=list)  # boxes, (x0, y0, x1, y1) in pixels
    curves: list[Array] = field(default_factory=list)  # samples of curves, (n, 2) in pixels
    anchors: list[Array] = field(default_factory=list)  # points that have words of their own

    def __post_init__(self) -> None:
        self.lay_out()

    def lay_out(self) -> None:
        """Let the layout come to rest: positions in pixels are final from here on."""
        self.figure.draw_without_rendering()

    @property
    def figure(self) -> Figure:
        figure = self.ax.get_figure(root=True)
        assert figure is not None  # axes that were removed from theirs cannot be drawn in
        return figure

    @property
    def pixel(self) -> float:
        """Pixels in a typographic point."""
        return float(self.figure.dpi) / 72.0

    def avoid(self, x: ArrayLike, y: ArrayLike) -> None:
        """Keep words off a curve (or a point)."""
        data = np.column_stack([np.atleast_1d(x), np.atleast_1d(y)]).astype(float)
        nodes = self.ax.transData.transform(data[np.isfinite(data).all(axis=1)])
        if len(nodes):
            self.curves.append(_dense(nodes, _SPACING * self.pixel))

    def keep_off(self, words: Iterable[Text | Legend | None]) -> None:
        """Other texts, or a legend: their places are taken."""
        for word in words:
            if word is not None:
                self.taken.append(np.asarray(word.get_window_extent().extents))

    def announce(self, x: ArrayLike, y: ArrayLike) -> None:
        """Points that will get words: no other word shall stand nearer to them."""
        points = np.column_stack([np.atleast_1d(x), np.atleast_1d(y)]).astype(float)
        self.anchors += list(self.ax.transData.transform(points))

    def place(self, x: float, y: float, text: str, **style: Any) -> Annotation | None:
        """Write `text` near (x, y); nothing if that is outside of the axes."""
        anchor = self.ax.transData.transform((x, y))
        frame = np.asarray(self.ax.bbox.extents)
        inner = frame + _RIM * self.pixel * np.array([1.0, 1.0, -1.0, -1.0])
        slack = 2.0 * self.pixel
        if np.any(anchor < frame[:2] - slack) or np.any(anchor > frame[2:] + slack):
            return None
        word = self.ax.annotate(text, (x, y), (0, 0), textcoords="offset points", **style)
        box = word.get_window_extent()
        size = np.array([box.width, box.height])
        _, radius, shift = min(self._options(anchor, size, inner), key=lambda option: option[0])
        word.set(horizontalalignment="center", verticalalignment="center")
        word.set_position(tuple(shift / self.pixel))
        self.taken.append(_box(anchor + shift, size))
        if radius > _LEADER:
            self._tie(word, anchor, self.taken[-1])
        return word

    def _tie(self, word: Annotation, anchor: Array, box: Array) -> None:
        """A thin line from the point to the nearest place of its word."""
        end = (np.clip(anchor, box[:2], box[2:]) - anchor) / self.pixel
        self.ax.annotate(
            "", word.xy, tuple(end), textcoords="offset points",
            arrowprops={"arrowstyle": "-", "linewidth": 0.4, "alpha": 0.7, "shrinkA": 0,
                        "shrinkB": 2, "color": word.get_color()},
        )  # fmt: skip

    def _options(
        self, anchor: Array, size: Array, frame: Array
    ) -> list[tuple[float, float, Array]]:
        """Cost, radius and shift of the places around the point, up to where the radius alone
        costs more than the best of them."""
        options: list[tuple[float, float, Array]] = []
        curves = np.concatenate(self.curves) if self.curves else np.empty((0, 2))
        others = [other for other in self.anchors if not np.allclose(other, anchor)]
        for radius in _RADII:
            if any(cost < radius for cost, *_ in options):
                break
            for i in range(_DIRECTIONS):
                angle = math.pi / 4 + 2.0 * math.pi * i / _DIRECTIONS  # first: upper right
                way = np.array([math.cos(angle), math.sin(angle)])
                shift = way * radius * self.pixel + 0.5 * size * np.clip(1.5 * way, -1.0, 1.0)
                box = _box(anchor + shift, size + 2.0 * self.pixel)
                cost = radius + 0.01 * i
                cost += 1e4 * sum(
                    np.all(box[:2] < other[2:]) and np.all(other[:2] < box[2:])
                    for other in self.taken
                )
                cost += 1e4 * (np.any(box[:2] < frame[:2]) or np.any(box[2:] > frame[2:]))
                inside = np.all((curves >= box[:2]) & (curves <= box[2:]), axis=1)
                cost += 25.0 * int(inside.sum())
                cost += 200.0 * any(_gap(box, other) == 0.0 for other in others)
                cost += 60.0 * self._misleads(anchor, box, others, tied=radius > _LEADER)
                options.append((float(cost), radius, shift))
        return options

    def _misleads(self, anchor: Array, box: Array, others: list[Array], *, tied: bool) -> bool:
        """Would a reader take the word for that of another point?"""
        if not tied:
            distance = _gap(box, anchor)
            return any(_gap(box, other) < 1.5 * distance for other in others)
        line = _dense(np.stack([anchor, np.clip(anchor, box[:2], box[2:])]), self.pixel)
        close = 4.0 * self.pixel
        return any(np.linalg.norm(line - other, axis=1).min() < close for other in others)


def place_words(ax: Axes, words: Iterable[tuple[float, float, str]], **style: Any) -> None:
    """Write words beside points of finished axes: off all its lines, texts and the legend."""
    labels = Labels(ax)
    for line in ax.get_lines():
        labels.avoid(line.get_xdata(), line.get_ydata())
    labels.keep_off([*ax.texts, ax.get_legend()])
    words = list(words)
    for x, y, _ in words:
        labels.announce(x, y)
    for x, y, text in words:
        labels.place(x, y, text, **style)


def _box(centre: Array, size: Array) -> Array:
    return np.concatenate([centre - 0.5 * size, centre + 0.5 * size])


def _gap(box: Array, point: Array) -> float:
    """Distance from a point to a box."""
    return float(np.linalg.norm(np.maximum(np.maximum(box[:2] - point, point - box[2:]), 0.0)))


def _dense(nodes: Array, spacing: float) -> Array:
    """The polyline through the nodes, sampled no wider than `spacing`."""
    length = float(np.linalg.norm(np.diff(nodes, axis=0), axis=1).sum())
    return evenly(nodes, 2 + int(length / spacing)) if length > 0.0 else nodes[:1]


def evenly(nodes: Array, count: int, scale: Array | float = 1.0) -> Array:
    """So many points at equal distances along a polyline, its coordinates in units of `scale`."""
    steps = np.linalg.norm(np.diff(nodes / scale, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    at = np.linspace(0.0, along[-1], count)
    return np.column_stack([np.interp(at, along, column) for column in nodes.T])
