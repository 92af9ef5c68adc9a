"""The figures of the page: what each shows of what it is given, in which looks, and how far."""

from __future__ import annotations

import unicodedata
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from bokeh.core.enums import MarkerType
from bokeh.models import GlyphRenderer, HoverTool
from matplotlib.colors import rgb_to_hsv, to_rgb

import contbreather as cb
from contbreather.breathers.regions import Region
from contbreather.explorer import seen
from contbreather.explorer.ink import DARK, LIGHT
from contbreather.explorer.sketch import Sketch, sketch_of
from contbreather.explorer.state import Chosen, Named, State
from contbreather.explorer.views import (
    MARKS,
    BranchView,
    MotionView,
    MultipliersView,
    ProfileView,
    ZonesView,
    symbol,
)
from contbreather.plotting import canvas, plot
from contbreather.plotting.zones import LINES, SHADES

B = cb.symmetric(a=0.5, gamma=0.08, k=0.8)
KINDS = ("LP", "GR", "PF", "NS")


@pytest.fixture(scope="module")
def plane() -> Any:
    return cb.zones(k=0.8)


@pytest.fixture(scope="module")
def branch() -> Any:
    return cb.trace(cb.symmetric(0.5, 0.04, 0.8), "a", within={"a": (0.1, 0.9)})


def glyphs(fig: Any) -> list[GlyphRenderer]:
    return [one for one in fig.renderers if isinstance(one, GlyphRenderer)]


def light(colour: str) -> float:
    """How bright it looks, from 0 to 1."""
    return float(np.dot(to_rgb(colour), (0.3, 0.6, 0.1)))


def around(axis: Any, low: float, high: float) -> None:
    """An axis shows all from low to high and a little more, also after a reset."""
    for start, end in ((axis.start, axis.end), (axis.reset_start, axis.reset_end)):
        room = low - start, end - high
        assert room == pytest.approx((0.08 * (high - low),) * 2)


# --- looks ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("ink", [LIGHT, DARK])
def test_all_is_drawn_in_the_inks_of_its_paper_in_sizes_that_are_seen(ink: Any) -> None:
    views = [ZonesView(ink), BranchView(ink), ProfileView(ink), MotionView(ink, "t"),
             MultipliersView(ink)]  # fmt: skip
    for view in views:
        fig = view.figure
        for one in glyphs(fig):
            known = one.glyph.properties_with_values()
            for name, given in known.items():
                value = getattr(given, "value", given)
                if name.endswith("color") and isinstance(value, str) and value.startswith("#"):
                    assert value in {*vars(ink).values()} - {ink.cycle} | {*ink.cycle}, name
                if name.endswith("line_width") and not isinstance(value, dict):
                    assert 1 <= value <= 11
                if name == "size" and isinstance(value, int | float):
                    assert 5 <= value <= 15
                if name == "text_font_size":
                    assert value in ("12px", "16px")
                if name in ("x_offset", "y_offset"):  # to the upper right of its point
                    assert 0 <= abs(value) <= 8
                    assert (value > 0) == (name == "x_offset") or value == 0
        for axis in (*fig.xaxis, *fig.yaxis):
            assert {axis.axis_label_text_color, axis.major_label_text_color} == {ink.text}
            lines = axis.axis_line_color, axis.major_tick_line_color, axis.minor_tick_line_color
            assert {*lines} == {fig.outline_line_color} == {ink.faint}
            assert axis.axis_label_text_font_size == "14px"
            assert 0 <= axis.axis_label_standoff <= 4
        assert {line.grid_line_color for line in fig.grid} == {ink.grid}
        assert (fig.title.text_color, fig.title.text_font_size) == (ink.text, "13px")
        assert fig.background_fill_color is fig.border_fill_color is fig.toolbar.logo is None
        assert fig.toolbar.autohide
        tools = "pan", "wheel_zoom", "box_zoom", "reset", "save"
        assert {f"{tool.replace('_', '')}tool" for tool in tools} <= {
            type(tool).__name__.lower() for tool in fig.tools
        }
        assert 200 <= fig.height <= 500
        for legend in fig.legend:
            assert (legend.label_text_color, legend.background_fill_color) == (ink.text, ink.paper)
            assert (legend.border_line_color, legend.label_text_font_size) == (None, "11px")
            assert 0.5 < legend.background_fill_alpha < 1.0
            assert legend.padding == 4
            assert 0 <= legend.spacing <= 12
            assert 20 <= legend.glyph_width <= 40
    assert [len(view.figure.legend) for view in views] == [1, 0, 0, 1, 0]
    assert views[0].figure.legend[0].location == "top_right"
    assert views[3].figure.legend[0].orientation == "horizontal"
    assert views[3].figure.above == [views[3].figure.legend[0]]


DRAWN = {
    ZonesView: "MultiPolygons xs ys fill=colour line=colour"
    + "; MultiLine xs ys" * 4
    + "; Text x y text; Scatter x y; Text x y text; MultiLine xs ys; Scatter x y; Scatter x y",
    BranchView: "MultiLine xs ys line=colour; " * 3
    + "Scatter x y fill=colour line=colour marker=mark; Text x y text; Scatter x y; Scatter x y",
    ProfileView: "Segment x0 y x1 y; Segment n low n high; Scatter n u",
    MotionView: "MultiLine xs ys; MultiLine xs ys line=colour; "
    "Scatter x y fill=colour hatch=colour line=colour",
    MultipliersView: "MultiLine xs ys; Line x y; "
    "Scatter x y fill=colour hatch=colour line=colour size=size",
}


@pytest.mark.parametrize("kind", DRAWN)
def test_every_column_is_drawn_as_what_it_is(kind: Any) -> None:
    """Nothing is drawn yet, but all columns are there that will be."""
    view = kind(LIGHT, "t") if kind is MotionView else kind(LIGHT)
    found = []
    for one in glyphs(view.figure):
        fields = {
            name: value.field
            for name, value in one.glyph.properties_with_values().items()
            if hasattr(value, "field") and not name.endswith(("alpha", "width"))
        }
        assert {*fields.values()} <= {*one.data_source.data}
        places = [fields.pop(n) for n in ("x0", "y0", "x1", "y1", "xs", "ys", "x", "y", "text")
                  if n in fields]  # fmt: skip
        rest = [f"{n.removesuffix('_color')}={v}" for n, v in sorted(fields.items())]
        found.append(" ".join([type(one.glyph).__name__, *places, *rest]))
    assert "; ".join(found) == DRAWN[kind]


def test_inks_are_those_of_the_figures_on_white_and_are_seen_on_both_papers() -> None:
    names = "BLUE", "VERMILLION", "GREEN", "PURPLE", "ORANGE", "SKY", "BLACK"
    assert LIGHT.cycle == tuple(getattr(canvas, name) for name in names)
    assert {"S": LIGHT.stable, "US": LIGHT.unstable} == SHADES
    for ink in (LIGHT, DARK):
        paper = light(ink.paper)
        assert min(abs(light(one) - paper) for one in (ink.text, ink.line)) > 0.7
        assert min(abs(light(one) - paper) for one in (*ink.cycle, ink.faint)) > 0.25
        for quiet in (ink.grid, ink.stable, ink.unstable, ink.band):
            assert 0.05 < abs(light(quiet) - paper) < 0.25
        assert (ink.blue, ink.vermillion, ink.line) == (*ink.cycle[:2], ink.cycle[-1])
        cool = ink.text, ink.grid, ink.faint, ink.paper, ink.stable, ink.band, ink.line
        assert all(list(to_rgb(one)) == sorted(to_rgb(one)) for one in cool)
        assert list(to_rgb(ink.unstable)) == sorted(to_rgb(ink.unstable), reverse=True)
    for one, other in zip(LIGHT.cycle[:-1], DARK.cycle[:-1], strict=True):
        assert light(one) < light(other)  # but the same hue
        assert np.ptp([rgb_to_hsv(to_rgb(colour))[0] for colour in (one, other)]) < 0.02


# --- zones ----------------------------------------------------------------------------------------


def test_the_diagram_is_drawn_where_it_is_and_a_region_has_its_holes(plane: Any) -> None:
    ring = np.array([[0.1, 0.2], [0.2, 0.2], [0.2, 0.3], [0.1, 0.2]])
    hole = 0.5 * ring + 0.1
    extra = (
        Region(ring, (hole,), 0.15, 0.22, 0.1, (2, 2)),
        Region(ring, (), 0.1, 0.2, 0.1, (None, None)),  # no breathers: white, without a letter
    )
    drawn = replace(sketch_of(plane), regions=(*plane.regions, *extra))
    view = ZonesView(LIGHT)
    view.show(drawn)
    shaded = [one for one in drawn.regions if one.verdict]
    assert len(shaded) == 4
    assert list(zip(*(view.letters.data[n] for n in ("x", "y", "text")), strict=True)) == [
        (one.x, one.y, one.verdict) for one in shaded
    ]
    assert view.regions.data["colour"] == [SHADES[one.verdict] for one in shaded]
    for one, xs, ys in zip(shaded, view.regions.data["xs"], view.regions.data["ys"], strict=True):
        ((*found_x,), (*found_y,)) = xs[0], ys[0]
        for wanted, x, y in zip((one.outline, *one.holes), found_x, found_y, strict=True):
            np.testing.assert_array_equal(np.column_stack([x, y]), wanted)
    for kind in KINDS:
        data = view.curves[kind].data
        for own, x, y in zip(plane[kind], data["xs"], data["ys"], strict=True):
            np.testing.assert_array_equal(x, own["gamma"])
            np.testing.assert_array_equal(y, own["a"])
    met = zip(*(view.meetings.data[n] for n in ("x", "y", "text")), strict=True)
    wanted = {(p["gamma"], p["a"]): {*p.kind.split("-")} for p in plane.special}
    assert {(x, y): {*name.split("\N{EN DASH}")} for x, y, name in met} == wanted
    every = np.vstack([line for lines in drawn.curves.values() for line in lines])
    around(view.figure.x_range, 0.0, every[:, 0].max())
    around(view.figure.y_range, 0.0, 1.08 * every[:, 1].max())


def test_curves_have_the_names_and_colours_of_the_printed_figure() -> None:
    view = ZonesView(LIGHT)
    words = {one.label.value: one.renderers[0] for one in view.figure.legend[0].items}
    assert list(words) == [LINES[kind]["label"] for kind in KINDS]
    for kind, line in zip(KINDS, words.values(), strict=True):
        assert line.data_source is view.curves[kind]
        assert line.glyph.line_color == LINES[kind]["color"]
    dashes = [line.glyph.line_dash for line in words.values()]
    assert dashes == ["solid", "dashed", "dashdot", "solid"]


@pytest.mark.parametrize(
    ("sketch", "words"),
    [
        (None, "no diagram yet; k = 0.8 is being computed"),
        ((0.7, True), "k = 0.7; k = 0.8 is being computed"),
        ((0.7, False), "k = 0.7; k = 0.8 is being computed"),
        ((0.8, False), "k = 0.8, between its neighbours; the exact one is being computed"),
        ((0.8, True), "k = 0.8"),
    ],
)
def test_the_title_says_what_is_shown_and_what_is_on_its_way(sketch: Any, words: str) -> None:
    view = ZonesView(LIGHT)
    view.title(State(k=0.8, sketch=sketch and Sketch(*sketch, {}, (), ())))
    assert view.figure.title.text == words


def test_only_curves_and_breathers_of_this_plane_are_drawn_on_it(branch: Any, plane: Any) -> None:
    view, line = ZonesView(LIGHT), plane["NS"][0]
    curves = [Named("branch1", branch), Named("line2", line)]
    view.boundaries(curves, 0.8)
    np.testing.assert_array_equal(view.traced.data["xs"], [line["gamma"]])
    np.testing.assert_array_equal(view.traced.data["ys"], [line["a"]])
    view.boundaries(curves, 0.7)
    assert view.traced.data == {"xs": [], "ys": []}
    ring = {"lattice": cb.Ring(12)}
    for orbit, k, there in (
        (B, 0.8, True), (B, 0.8 + 5e-10, True), (B, 0.8 + 2e-9, False), (None, 0.8, False),
        (cb.symmetric(0.5, 0.08, 0.8, **ring), 0.8, True),
        (cb.symmetric(0.5, 0.08, 0.8, **ring, damping=0.01), 0.8, False),
        (cb.symmetric(0.5, 0.08, 0.8, spring=0.1), 0.8, False),
    ):  # fmt: skip
        view.choose(None if orbit is None else Chosen("b", orbit), k)
        assert view.here.data == ({"x": [0.08], "y": [0.5]} if there else {"x": [], "y": []})


# --- branches -------------------------------------------------------------------------------------


def test_a_branch_is_drawn_as_in_print_with_a_word_at_each_special_point(branch: Any) -> None:
    doubtful = tuple(replace(p, located=False) if p.kind == "PF" else p for p in branch)
    one = Named("branch1", replace(branch, points=doubtful))
    view = BranchView(DARK)
    view.show([one, Named("branch2", branch)], "a", "phi")
    printed = [line for line in plot(branch, x="a", y="phi").axes.get_lines()
               if line.get_linestyle() != "None"]  # fmt: skip
    for style, source in view.lines.items():
        rows = list(zip(*(source.data[n] for n in ("xs", "ys", "colour")), strict=True))
        own = [line for line in printed if line.get_linestyle() == style]
        assert len(rows) == 2 * len(own)
        assert [row[2] for row in rows] == [c for c in DARK.cycle[:2] for _ in own]
        for (xs, ys, _), line in zip(rows, own * 2, strict=True):
            np.testing.assert_array_equal(xs, line.get_xdata())
            np.testing.assert_array_equal(ys, line.get_ydata())
    looks = {style: next(one.glyph.line_dash for one in glyphs(view.figure)
                         if one.data_source is source)
             for style, source in view.lines.items()}  # fmt: skip
    assert looks == {"-": "solid", "--": "dashed", ":": "dotted"}
    data, count = view.special.data, len(branch.special)
    assert data["text"] == [
        "" if p.kind == "EP" else p.label + mark * (p.kind == "PF")
        for mark in ("?", "") for p in branch.special
    ]  # fmt: skip
    assert data["x"] == [float(p["a"]) for p in branch.special] * 2
    assert data["y"] == [float(p["phi"]) for p in branch.special] * 2
    assert data["colour"] == [c for c in DARK.cycle[:2] for _ in range(count)]
    for point, what in zip(branch.special, data["what"], strict=False):
        values = ", ".join(f"{name} = {value:.8g}" for name, value in point.values.items())
        assert what == f"{point.label} of branch1: {values}"
    assert [tool.tooltips for tool in view.figure.select(HoverTool)] == [[("", "@what")]]
    assert view.figure.title.text == "branch1, branch2"
    assert (view.figure.xaxis.axis_label, view.figure.yaxis.axis_label) == ("a", "φ")
    around(view.figure.x_range, branch["a"].min(), branch["a"].max())
    heights = np.concatenate([line.get_ydata() for line in printed])
    around(view.figure.y_range, heights.min(), heights.max())
    for point in (*branch.special, branch[5]):
        view.choose(Chosen("x", None, point), "arclength", "residual")
        assert view.here.data == {"x": [point.arclength], "y": [point.residual]}
    view.choose(Chosen("x", B), "a", "phi")
    assert view.here.data == {"x": [], "y": []}
    view.choose(Chosen("x", None, branch[5]), "a", "t2")  # a column that it does not have
    assert np.isnan(view.here.data["y"]).all()
    view.show([], "a", "phi")
    assert view.figure.title.text == "no branch yet"


def test_kinds_have_marks_of_their_own_and_the_letters_of_print(branch: Any) -> None:
    assert len({*MARKS.values()}) == len(MARKS) - 1  # GR and MX, where a walk ends
    cusp = replace(branch.special[1], kind="CP", label="CP1")
    view = BranchView(LIGHT)
    view.show([Named("one", replace(branch, points=(branch[0], cusp, branch[-1])))], "a", "p")
    _, other, _ = view.special.data["mark"]
    assert other not in MARKS.values()
    assert {other, *MARKS.values()} <= {*MarkerType}
    assert {symbol(n) for n in ("gamma", "phi", "mu", "nu", "a", "t1")} == {*"γφμνa", "t1"}
    for name in ("gamma", "phi", "mu", "nu"):
        assert unicodedata.name(symbol(name)) == f"GREEK SMALL LETTER {name.upper()}"


def test_the_nearest_point_is_that_of_the_screen_and_special_points_draw_more(branch: Any) -> None:
    view, curves = BranchView(LIGHT), [Named("one", branch)]
    assert view.nearest([], "a", "p", (0.5, 0.5)) is None
    rng = np.random.default_rng(3)
    for width, height in ((0.01, 4.0), (1.0, 1.0), (2.0, 0.02)):
        view.figure.x_range.update(start=1.0, end=1.0 + width)
        view.figure.y_range.update(start=0.5, end=0.5 + height)
        for x, y in rng.uniform((0.1, 0.3), (0.9, 1.2), size=(20, 2)):
            far = [
                np.hypot((p["a"] - x) / width, (p["p"] - y) / height) * (0.5 if p.kind else 1.0)
                for p in branch
            ]
            assert view.nearest(curves, "a", "p", (x, y)) == ("one", int(np.argmin(far)))
    place = float(branch[5]["a"]), float(branch[5]["p"])
    assert view.nearest([Named("two", branch[3:9])], "a", "p", place) == ("two", 2)


# --- one orbit ------------------------------------------------------------------------------------


def test_the_profile_shows_each_site_between_its_walls() -> None:
    walls = {0: (-0.9, 1.0), 3: (None, 2.0)}
    n = np.arange(4)
    low, high = np.array([-0.9, -0.3, -0.2, -0.1]), np.array([1.0, 0.3, 0.2, 0.1])
    own = np.array([walls.get(i, (np.nan, np.nan)) for i in n], dtype=float)
    view = ProfileView(LIGHT)
    view.show(seen.Profile(n, 1.23456, 0.5 * high, low, high, own))
    assert view.walls.data["x0"].tolist() == [-0.5, -0.5, 0.5, 0.5, 1.5, 1.5, 2.5, 2.5]
    assert view.walls.data["x1"].tolist() == [0.5, 0.5, 1.5, 1.5, 2.5, 2.5, 3.5, 3.5]
    np.testing.assert_array_equal(view.walls.data["y"], own.ravel())
    for name, wanted in {"n": n, "u": 0.5 * high, "low": low, "high": high}.items():
        np.testing.assert_array_equal(view.sites.data[name], wanted)
    assert view.figure.title.text == "profile at the impact, t = 1.235, and over the period"
    around(view.figure.x_range, -0.5, 3.5)
    around(view.figure.y_range, -0.9, 2.0)


def test_the_motion_has_a_colour_for_each_site_and_a_dot_of_it_at_each_impact() -> None:
    shown = seen.motion(B, (1, 0))
    view = MotionView(LIGHT, "t/2π")
    view.show(shown)
    data = view.lines.data
    assert data["site"] == ["site 1", "site 0"]
    assert data["colour"] == list(LIGHT.cycle[:2])
    for n, x, y in zip((1, 0), data["xs"], data["ys"], strict=True):
        np.testing.assert_allclose(y, B.displacement(n, 2 * np.pi * x), atol=1e-13)
    assert view.hits.data["x"] == [time for _, time, _ in shown.hits]
    assert view.hits.data["y"] == [wall for _, _, wall in shown.hits]
    assert view.hits.data["colour"] == [LIGHT.cycle[1]] * 2
    around(view.figure.x_range, 0.0, 1.0)
    around(view.figure.y_range, -1.0, 1.0)
    assert view.walls.data["ys"] == [[-1.0, -1.0], [1.0, 1.0]]
    ends = [view.figure.x_range.start, view.figure.x_range.end]
    assert view.walls.data["xs"] == [ends, ends]
    run = cb.simulate(B.state(12), a=0.5, gamma=0.08, k=0.8, periods=2, t0=2 * np.pi,
                      sample=cb.dynamics.Sample((0, 3), 32))  # fmt: skip
    view.run("run1", run)
    assert view.figure.title.text == "run1: 2 periods, 4 impacts; went through all its periods"
    around(view.figure.x_range, 1.0, run.record.times[-1] / (2 * np.pi))
    for i, y in enumerate(view.lines.data["ys"]):
        np.testing.assert_array_equal(y, run.record.u[:, i])
    assert view.walls.data["ys"] == [[-1.0, -1.0], [1.0, 1.0]]


@pytest.mark.parametrize("largest", [1.0, 1.1, 2.0, 4.0, 4.5])
def test_multipliers_are_drawn_on_a_square_those_outside_red(largest: float) -> None:
    mu = np.array([1j, -1j, largest, 1.0 / largest])
    alone = np.array([False, False, True, True])
    view = MultipliersView(LIGHT)
    view.show(seen.Multipliers(mu, alone, 0.25, "over a period"))
    x, y = (np.asarray(view.dots.data[n]) for n in "xy")
    np.testing.assert_array_equal(x + 1j * y, mu)
    red = [colour == LIGHT.vermillion for colour in view.dots.data["colour"]]
    assert red == [False, False, largest > 1.0, False]
    assert {*view.dots.data["colour"]} <= {LIGHT.blue, LIGHT.vermillion}
    sizes = np.asarray(view.dots.data["size"])
    assert 2.0 <= sizes[0] == sizes[1] < sizes[2] == sizes[3] <= 10.0
    arcs = zip(view.band.data["xs"], view.band.data["ys"], strict=True)
    for (xs, ys), sign in zip(arcs, (1.0, -1.0), strict=True):
        angles = np.angle(xs + 1j * ys)
        assert (angles[0], angles[-1]) == pytest.approx((0.0, sign * np.pi / 4))
        np.testing.assert_allclose(np.hypot(xs, ys), 1.0)
    title = view.figure.title.text
    assert title == "over a period" + ("; one at |μ| = 4.5" if largest > 4.0 else "")
    reach = {1.0: 1.265, 1.1: 1.265, 2.0: 2.2, 4.0: 4.4, 4.5: 4.4}[largest]
    for axis in (view.figure.x_range, view.figure.y_range):
        ends = axis.start, axis.end, axis.reset_start, axis.reset_end
        assert ends == pytest.approx((-reach, reach) * 2)
    fig = view.figure
    frame = (
        fig.width - fig.min_border_left - fig.min_border_right,
        fig.height - fig.min_border_top - fig.min_border_bottom,
    )
    assert frame == (240, 240)
    assert (fig.sizing_mode, fig.align) == ("fixed", "center")
    view.show(seen.Multipliers(mu, alone, None, "damped"))
    assert view.band.data == {"xs": [], "ys": []}
    view.nothing("too large")
    assert title != view.figure.title.text == "too large"
    assert not any(map(len, view.dots.data.values()))
