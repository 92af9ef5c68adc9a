"""Figures in Bokeh: each is made once, empty, and shows what `show` is given."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import partial
from itertools import cycle
from textwrap import wrap
from typing import Any
from unicodedata import lookup

import numpy as np
from bokeh.models import ColumnDataSource, HoverTool, Range1d
from bokeh.plotting import figure
from numpy.typing import NDArray

from contbreather.continuation.curve.branch import Branch
from contbreather.continuation.curve.kinds import look_of
from contbreather.continuation.curve.point import Point
from contbreather.explorer.state import (
    Chosen,
    PageState,
    map_on_ring,
    model_in_words,
    plane_in_words,
    told_apart,
    watched,
)
from contbreather.explorer.style import Theme
from contbreather.lattice.chain import Ring
from contbreather.orbits.orbit import Orbit
from contbreather.orbits.zone_diagram import KINDS, Region, Zones
from contbreather.plotting import branches, canvas
from contbreather.plotting.multipliers import with_band
from contbreather.plotting.orbits import BESIDE, MOMENTS, alike, impacts_of
from contbreather.plotting.runs import with_impacts
from contbreather.plotting.zones import LINES, names_of_meetings
from contbreather.simulation.simulate import SimulationRun
from contbreather.simulation.states import PERIOD

Array = NDArray[Any]

# what Bokeh calls the markers of print
MARKS = {
    "s": "square", "D": "diamond", "^": "triangle", "o": "circle", "v": "inverted_triangle",
    "X": "x", "*": "star", "P": "plus", ".": "dot", "x": "x", "h": "hex", "p": "hex",
    "<": "y", ">": "square_pin", "d": "diamond_dot", "8": "hex_dot",
}  # fmt: skip
ACROSS, UP = 0.12, 0.07  # parts of a figure that a word takes
LETTER = 7.5  # pixels of a title that one takes
FARTHEST = 4.0  # from 0, where multipliers are still drawn
DASHES = {branches.STABLE: "solid", branches.UNSTABLE: "dashed", branches.BEYOND: "dotted",
          branches.UNKNOWN: "dashdot"}  # fmt: skip


def _drawn(fig: Any, glyph: str, *columns: str, also: Sequence[str] = (), **look: Any) -> Any:
    """Draw a glyph of no data, and return its source: columns in an order that `_fill` keeps."""
    source = ColumnDataSource({name: [] for name in dict.fromkeys((*columns, *also))})
    getattr(fig, glyph)(*columns, source=source, **look)
    return source


def _fill(source: ColumnDataSource, rows: Iterable[Any]) -> None:
    every = list(rows)
    source.data = {name: [row[i] for row in every] for i, name in enumerate(source.column_names)}


def _say(fig: Any, words: str) -> None:
    """Put words above a figure, in lines that it has room for, not broken within "k = 0.8", at
    least two: of a title that has more of them than the one before Bokeh leaves the old one behind
    it."""
    tied, letters = words.replace(" = ", "\xa0=\xa0"), int(fig.tags[0] / LETTER)
    lines = wrap(tied, letters, max_lines=3, placeholder=" \N{HORIZONTAL ELLIPSIS}") or [""]
    text = "\n".join(lines if lines[1:] else ("", *lines)).replace("\xa0", " ")
    fig.title.update(text=text, tags=[words])


def _fit(fig: Any, attr: str, old: int, new: int) -> None:
    """Break the title of a figure anew, whose axes come to be that wide, in pixels."""
    fig.tags = [max(new, LETTER)]
    _say(fig, fig.title.tags[0])


def letter(name: str) -> str:
    size = "SMALL" if name.islower() else "CAPITAL"  # which `lookup` does not tell by the name
    try:
        return lookup(f"GREEK {size} LETTER {name}")
    except KeyError:
        return name


def _sheet(
    theme: Theme, x: str, y: str, height: int | None, title: str = "", width: int = 400
) -> Any:
    fig: Any = figure(
        tags=[width], height=height, sizing_mode="stretch_width", x_axis_label=x, y_axis_label=y,
        tools="pan,wheel_zoom,box_zoom,reset,save", toolbar_location="right",
        x_range=Range1d(start=0.0, end=1.0), y_range=Range1d(start=0.0, end=1.0), min_border=4,
        background_fill_color=theme.paper, border_fill_color=theme.paper,
        outline_line_color=theme.faint,
    )  # fmt: skip
    fig.toolbar.update(logo=None, autohide=True)
    fig.title.update(text_color=theme.text, text_font_size="13px")
    fig.on_change("inner_width", partial(_fit, fig))  # as a browser draws it
    _say(fig, title)
    for axis in (*fig.xaxis, *fig.yaxis):
        axis.update(
            axis_label_text_color=theme.text, axis_label_text_font_size="14px",
            axis_label_standoff=2, major_label_text_color=theme.text, axis_line_color=theme.faint,
            major_tick_line_color=theme.faint, minor_tick_line_color=theme.faint,
        )  # fmt: skip
    fig.grid.grid_line_color = theme.grid
    return fig


def _legend(fig: Any, theme: Theme, place: str, **more: Any) -> None:
    """Put the legend beside the axes: inside it would cover curves."""
    look: dict[str, Any] = {"padding": 4, "margin": 4, "glyph_width": 26, "spacing": 10, **more}
    fig.legend[0].update(
        location="center", label_text_color=theme.text, label_text_font_size="11px",
        label_height=14, background_fill_color=theme.paper, background_fill_alpha=0.75,
        border_line_color=None, **look,
    )  # fmt: skip
    fig.add_layout(fig.legend[0], place)


def _reach(axis: Range1d, values: Iterable[float]) -> None:
    finite = np.array([value for value in values if np.isfinite(value)])
    if not finite.size:
        return
    low, high = float(finite.min()), float(finite.max())
    room = max(0.08 * (high - low), 1e-9 * max(abs(low), abs(high), 1.0))
    _bounded(axis, low - room, high + room)


def _bounded(axis: Range1d, low: float, high: float) -> None:
    axis.update(start=low, end=high, reset_start=low, reset_end=high)


def _named_marks(fig: Any, theme: Theme, *also: str, **look: Any) -> ColumnDataSource:
    """Draw marks with words beside them, and more of it under the pointer."""
    columns = ("text", "side", "right", "down", *also, "what")
    source: ColumnDataSource = _drawn(fig, "scatter", "x", "y", also=columns, size=9, **look)
    fig.add_tools(HoverTool(renderers=fig.renderers[-1:], tooltips=[("", "@what")]))
    fig.text(
        "x", "y", "text", source=source, text_color=theme.text, text_align="side",
        x_offset="right", y_offset="down", text_font_size="12px",
    )  # fmt: skip
    return source


class ZonesView:
    """Plane of two parameters: regions, their limits, where these meet, what is chosen."""

    def __init__(self, theme: Theme) -> None:
        self.figure = fig = _sheet(theme, "γ", "a", 470)
        self.shades = {"S": theme.stable, "US": theme.unstable}
        self.regions = _drawn(
            fig, "multi_polygons", "xs", "ys", also=["colour"], fill_color="colour",
            line_color="colour",
        )  # fmt: skip
        self.curves = {
            kind: _drawn(
                fig, "multi_line", "xs", "ys", color=getattr(theme, look_of(kind).colour),
                line_width=2, line_dash=look_of(kind).line, legend_label=LINES[kind]["label"],
            )
            for kind in KINDS
        }  # fmt: skip
        self.letters = _drawn(
            fig, "text", "x", "y", "text", text_color=theme.text, text_align="center",
            text_baseline="middle", text_font_style="bold", text_font_size="16px",
        )  # fmt: skip
        look = {"marker": "hex", "fill_color": theme.paper, "line_color": theme.black}
        self.meetings = _named_marks(fig, theme, **look)
        self.traced = _drawn(fig, "multi_line", "xs", "ys", color=theme.cycle[2], line_width=1.5)
        self.here = _here(fig, theme)
        _legend(fig, theme, "below", ncols=2)

    def show(self, drawn: Zones) -> None:
        shaded = [region for region in drawn.regions if region.verdict and not drawn.interrupted]
        lines = {kind: [_line(drawn, branch) for branch in drawn[kind]] for kind in self.curves}
        _fill(self.regions, (self._region(region) for region in shaded))
        for (kind, source), item in zip(
            self.curves.items(), self.figure.legend[0].items, strict=True
        ):
            _fill(source, (line.T for line in lines[kind]))
            item.visible = bool(lines[kind])
        _fill(self.letters, ((region.x, region.y, region.verdict) for region in shaded))
        x, y = drawn.pair
        self.figure.xaxis.axis_label, self.figure.yaxis.axis_label = letter(x), letter(y)
        if any(lines.values()):
            drawn_lines = (line for some in lines.values() for line in some)
            every = np.vstack([*drawn_lines, *(region.outline for region in shaded)])
            _reach(self.figure.x_range, [0.0, every[:, 0].max()])
            _reach(self.figure.y_range, [0.0, 1.08 * every[:, 1].max()])
        met = ((*at, name, name) for *at, name in names_of_meetings(drawn))
        _fill(self.meetings, _named(self.figure, met))

    def _region(self, region: Region) -> tuple[Any, Any, str]:
        rings = (region.outline, *region.holes)
        xs, ys = ([[ring[:, i] for ring in rings]] for i in (0, 1))
        return xs, ys, self.shades[region.verdict]

    def title(self, wanted: PageState) -> None:
        drawn, orbit = wanted.plane, None if wanted.chosen is None else wanted.chosen.orbit
        here = "no diagram yet" if drawn is None else plane_in_words(drawn)
        words = here if drawn is None else f"{here}, {_at(drawn.fixed)}"
        words += ", stopped: curves may be missing" * (drawn is not None and drawn.interrupted)
        if wanted.awaited:
            elsewhere = drawn is None or drawn.fixed != wanted.fixed
            words += f"; {_at(wanted.fixed) if elsewhere else 'another lattice'} is being computed"
        elif drawn is not None and orbit is not None and here != model_in_words(orbit):
            words += f"; chosen: {model_in_words(orbit)}"
        _say(self.figure, words)

    def boundaries(self, curves: Iterable[Branch], drawn: Zones) -> None:
        name, value = drawn.fixed
        traced = (
            branch
            for branch in curves
            if {*branch.curve.varied} == {*drawn.pair} and branch.problem.params.get(name) == value
        )
        _fill(self.traced, (_line(drawn, branch).T for branch in traced))

    def choose(self, chosen: Chosen | None, drawn: Zones) -> None:
        name, value = drawn.fixed
        orbit = None if chosen is None else chosen.orbit
        here = []
        if orbit is not None and abs(getattr(orbit, name) - value) <= 1e-9:
            alike = plane_in_words(drawn) == model_in_words(orbit)
            here = [[getattr(orbit, one) for one in drawn.pair]] * alike
        _fill(self.here, here)


def _line(drawn: Zones, branch: Branch) -> Array:
    return np.column_stack([branch[name] for name in drawn.pair])


def _at(fixed: tuple[str, float]) -> str:
    return f"{letter(fixed[0])} = {fixed[1]:g}"


def _here(fig: Any, theme: Theme) -> ColumnDataSource:
    """Mark what is chosen; at the level of annotations Bokeh would leave grey rims behind."""
    edge: dict[str, Any] = {"size": 15, "fill_color": None}
    source = _drawn(fig, "scatter", "x", "y", line_color=theme.paper, line_width=5, **edge)
    fig.scatter("x", "y", source=source, line_color=theme.vermillion, line_width=2.5, **edge)
    return source


def marked(branch: Branch) -> list[tuple[int, Point]]:
    """Special points with their numbers; those between are not made for that."""
    places = np.searchsorted(branch["arclength"], [p.arclength for p in branch.special])
    return list(zip(places.tolist(), branch.special, strict=True))


class BranchView:
    """Bifurcation diagram: solid where stable, special points labelled."""

    def __init__(self, theme: Theme) -> None:
        self.theme = theme
        self.figure = fig = _sheet(theme, "a", "p", 380, title="no branch yet")
        look: dict[str, Any] = {"color": "colour", "line_dash": "dash", "line_width": 2}
        columns = "multi_line", "xs", "ys"
        self.lines = _drawn(fig, *columns, also=["colour", "dash"], **look)
        # of no line: what the legend says
        self.key = _drawn(
            fig, *columns, also=["colour", "dash", "word"], legend_field="word", **look
        )
        look = {"marker": "mark", "fill_color": "colour", "line_color": "colour"}
        self.special = _named_marks(fig, theme, "colour", "mark", **look)
        self.here = _here(fig, theme)
        _legend(fig, theme, "below", ncols=3)

    def show(self, curves: Mapping[str, Branch], x: str, y: str) -> None:
        shared, _ = told_apart(curves)
        lines, marks = list[Any](), list[Any]()
        colours, styles = self.theme.colours(curves), set[str]()
        for code, branch in curves.items():
            for style, *line in branches.pieces(branch, x, y):
                lines.append((*line, colours[code], DASHES[style]))
                styles.add(style)
            marks += [_special(point, code, x, y, colours[code]) for point in branch.special]
        _fill(self.lines, lines)
        _fill(self.key, self._entries(colours, styles))
        self.figure.xaxis.axis_label, self.figure.yaxis.axis_label = letter(x), letter(y)
        _say(self.figure, shared if curves else "no branch yet")
        for axis, at in ((self.figure.x_range, 0), (self.figure.y_range, 1)):
            _reach(axis, (v for row in lines for v in row[at]))
        _fill(self.special, _named(self.figure, marks))

    def _entries(self, colours: Mapping[str, str], styles: set[str]) -> Iterator[tuple[Any, ...]]:
        """Say what colours stand for, of many curves the first, and dashes, as in print."""
        nowhere = [np.nan]
        for code in list(colours)[: branches.MANY]:
            yield nowhere, nowhere, colours[code], "solid", code
        for style, word in branches.WORDS.items():
            if style in styles and styles != {branches.STABLE}:
                yield nowhere, nowhere, self.theme.text, DASHES[style], word

    def choose(self, chosen: Chosen | None, x: str, y: str) -> None:
        point = None if chosen is None else chosen.point
        _fill(self.here, [] if point is None else [(_value(point, x), _value(point, y))])

    def nearest(self, curves: Mapping[str, Branch], x: str, y: str, at: tuple[float, float]) -> Any:
        """Curve and number of the point next to a place of the figure. Special points draw a little
        more."""
        width = self.figure.x_range.end - self.figure.x_range.start
        height = self.figure.y_range.end - self.figure.y_range.start
        candidates = []
        for code, branch in curves.items():
            across = (branches.column_of(branch, x) - at[0]) / (width or 1.0)
            up = (branches.column_of(branch, y) - at[1]) / (height or 1.0)
            far = np.hypot(across, up)
            far[[i for i, _ in marked(branch)]] *= 0.5
            candidates.append((float(far.min()), code, int(far.argmin())))
        return min(candidates)[1:] if candidates else None


def _named(fig: Any, marks: Iterable[Any]) -> list[Any]:
    """Put words, of (x, y, word, ...), above and right of their marks, at these edges on the other
    side. One that would cover another is left out: the mark has to do there, which says what it is
    under the pointer."""
    seen: list[tuple[float, float]] = []
    rows = []
    for x, y, word, *more in marks:
        across = (x - fig.x_range.start) / (fig.x_range.end - fig.x_range.start)
        up = (y - fig.y_range.start) / (fig.y_range.end - fig.y_range.start)
        right, top = across > 1.0 - ACROSS, up > 1.0 - UP
        at = across - ACROSS * right, up - UP * top
        room = all(abs(at[0] - u) > ACROSS or abs(at[1] - v) > UP for u, v in seen)
        seen += [at] if room and word else []
        side = ("right", -7) if right else ("left", 7)  # pixels
        rows.append((x, y, word if room else "", *side, 16 if top else -5, *more))
    return rows


def _value(point: Any, name: str) -> float:
    try:
        return branches.value_of(point, name)
    except ValueError:  # of a column that this curve does not have
        return float("nan")


def _special(point: Any, code: str, x: str, y: str, colour: str) -> tuple[Any, ...]:
    values = ", ".join(f"{n} = {v:.8g}" for n, v in point.values.items() if np.ndim(v) == 0)
    word = "" if point.kind == "EP" else branches.name_of(point)
    mark = MARKS[look_of(point.kind).marker]
    what = f"{point.title} of {code}: {values}"
    return _value(point, x), _value(point, y), word, colour, mark, what


class OrbitView:
    figure: Any
    empty = ""  # the title where there is none

    def nothing(self, why: str = "") -> None:
        """Show no orbit, and why."""
        for source in vars(self).values():
            if isinstance(source, ColumnDataSource):
                _fill(source, [])
        _say(self.figure, why or self.empty)


class ProfileView(OrbitView):
    """Sites at the first impact, and the stretch each of them moves in."""

    def __init__(self, theme: Theme) -> None:
        self.figure = fig = _sheet(theme, "site n", "u", 260)
        look: dict[str, Any] = {"line_color": theme.faint, "line_width": 2}
        self.walls = _drawn(fig, "segment", "x0", "y", "x1", "y", **look)
        look = {"line_color": theme.blue, "line_alpha": 0.35, "line_width": 7}
        self.sites = _drawn(fig, "segment", "n", "low", "n", "high", also=["u"], **look)
        fig.scatter("n", "u", source=self.sites, color=theme.vermillion, size=6)

    def show(self, orbit: Orbit) -> None:
        size, middle = orbit.lattice.sites, orbit.section.hit[0]
        n = np.arange(middle - BESIDE, middle + BESIDE + 1)
        if size is not None and (size <= n.size or not isinstance(orbit.lattice, Ring)):
            n = np.arange(min(size, 4 * BESIDE + 1))
        u, first = orbit.displacement(n[:, None], _moments(orbit)), float(orbit.times[0])
        walls = np.array([orbit.walls.at(i if size is None else i % size) for i in n.tolist()])
        walls = np.where(np.isfinite(walls), walls, np.nan).ravel()
        positions = np.repeat(n.astype(float), 2)
        self.walls.data = {"x0": positions - 0.5, "x1": positions + 0.5, "y": walls}
        self.sites.data = {
            "n": n.astype(float), "u": orbit.displacement(n, first),
            "low": u.min(axis=1), "high": u.max(axis=1),
        }  # fmt: skip
        _say(self.figure, f"at the impact, t = {first:.4g}, and over the period")
        _reach(self.figure.x_range, [n[0] - 0.5, n[-1] + 0.5])
        _reach(self.figure.y_range, [*walls, *u.min(axis=1), *u.max(axis=1)])


def _moments(orbit: Orbit) -> Array:
    """Times of a period, its impacts among them: there sites turn round sharply."""
    hits = [hit.time % orbit.period for hit in orbit.hits]
    return np.sort(np.concatenate([np.linspace(0.0, orbit.period, MOMENTS + 1), hits]))


class MotionView(OrbitView):
    def __init__(self, theme: Theme) -> None:
        self.theme = theme
        self.figure = fig = _sheet(theme, "t/2π", "u", 260)
        look: dict[str, Any] = {"color": theme.faint, "line_dash": "dashed", "line_width": 1.5}
        self.walls = _drawn(fig, "multi_line", "xs", "ys", **look)
        look = {"color": "colour", "line_dash": "dash", "line_width": 1.8, "legend_field": "site"}
        columns = "multi_line", "xs", "ys"
        self.lines = _drawn(fig, *columns, also=["colour", "dash", "site"], **look)
        self.hits = _drawn(fig, "scatter", "x", "y", also=["colour"], color="colour", size=8)
        _legend(fig, theme, "above", orientation="horizontal")

    def show(self, orbit: Orbit, sites: tuple[int, ...], verdict: str) -> None:
        size, there = orbit.lattice.sites, watched(orbit, sites)
        times = _moments(orbit)
        u = orbit.displacement(np.array(there)[:, None], times)
        _say(self.figure, verdict)
        colours = self._draw({n: (times, its) for n, its in zip(there, u, strict=True)})
        hits = impacts_of(orbit, there)
        _fill(self.hits, ((time, wall, colours[site]) for site, time, wall in hits))
        real = there if size is None else [n % size for n in there]
        self._bound(wall for n in real for wall in orbit.walls.at(n))

    def run(self, name: str, run: SimulationRun, outcome: str) -> None:
        record = run.record
        assert record is not None  # asked for by `jobs.simulated`
        columns = zip(record.sites, record.u.T, strict=True)
        self._draw({n: with_impacts(record.times, u, run, n) for n, u in columns})
        self._bound([wall for n in record.sites for wall in run.conditions.walls.at(n)])
        count = len(run.impacts)
        _say(self.figure, f"{name}: {run.periods} periods, {count} impacts; {outcome}")

    def _draw(self, by_site: dict[int, tuple[Array, Array]]) -> dict[int, str]:
        groups = alike({n: u for n, (_, u) in by_site.items()})
        colours = self.theme.colours(map(tuple, groups))
        dashes = cycle(DASHES[dash] for dash in canvas.DASHES)
        _fill(self.lines, (
            (*thinned(t / PERIOD, u), colour, dash, f"site {', '.join(map(str, its))}")
            for (its, colour), dash in zip(colours.items(), dashes, strict=False)
            for t, u in [by_site[its[0]]]
        ))  # fmt: skip
        _reach(self.figure.x_range, [t[i] for t in self.lines.data["xs"] for i in (0, -1)])
        return {n: colour for its, colour in colours.items() for n in its}

    def _bound(self, walls: Iterable[float]) -> None:
        finite = sorted({wall for wall in walls if np.isfinite(wall)})
        ends = [self.figure.x_range.start, self.figure.x_range.end]
        _fill(self.walls, ((ends, [wall, wall]) for wall in finite))
        u = [value for line in self.lines.data["ys"] for value in (min(line), max(line))]
        _reach(self.figure.y_range, [*finite, *u])


def thinned(times: Array, u: Array) -> tuple[Array, Array]:
    """Thin a long line to the lowest and the highest point of each stretch."""
    length = -(-times.size // 2000)  # a figure has fewer pixels
    if length == 1:
        return times, u
    blocks = u[: u.size // length * length].reshape(-1, length)
    begins = length * np.arange(len(blocks))
    ends = (0, u.size - 1)
    at = [begins + blocks.argmin(axis=1), begins + blocks.argmax(axis=1), ends]
    indices = np.unique(np.concatenate(at))
    return times[indices], u[indices]


class MultipliersView(OrbitView):
    """Multipliers: the unit circle, on it the band, and what stands alone."""

    empty = "multipliers"

    def __init__(self, theme: Theme) -> None:
        self.figure = fig = _sheet(theme, "Re μ", "Im μ", None, title=self.empty, width=250)
        self.theme = theme
        fig.update(sizing_mode="fixed", align="center", width=340, height=340)
        # what the axes and the title need, so that the frame is a square and a circle one
        fig.update(min_border_left=65, min_border_right=35, min_border_top=40, min_border_bottom=60)
        self.band = _drawn(fig, "multi_line", "xs", "ys", color=theme.band, line_width=11)
        angle = np.linspace(-np.pi, np.pi, 361)
        fig.line(np.cos(angle), np.sin(angle), color=theme.faint, line_width=1)
        look = {"color": "colour", "size": "size"}
        self.dots = _drawn(fig, "scatter", "x", "y", also=["colour", "size"], **look)

    def show(self, orbit: Orbit, ring: int) -> None:
        finite = map_on_ring(orbit, ring) if orbit.lattice.sites is None else orbit
        mu, waves, alone = with_band(finite, None, orbit.symmetric)
        out = alone & (np.abs(mu) > 1.0)
        self.dots.data = {
            "x": mu.real, "y": mu.imag,
            "colour": np.where(out, self.theme.vermillion, self.theme.blue).tolist(),
            "size": np.where(alone, 8.0, 2.5),
        }  # fmt: skip
        _fill(self.band, ((part.real, part.imag) for part in waves))
        largest = float(np.abs(mu).max(initial=0.0))
        beyond = f"; one at |μ| = {largest:.4g}" if largest > FARTHEST else ""
        about = f"over {'half a' if orbit.symmetric else 'a'} period, {finite.lattice.describe()}"
        _say(self.figure, f"{about}{beyond}")
        reach = 1.1 * min(max(1.15, largest), FARTHEST)
        for axis in (self.figure.x_range, self.figure.y_range):
            _bounded(axis, -reach, reach)
