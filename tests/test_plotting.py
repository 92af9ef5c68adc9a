"""Figures say what was computed, can be read, and are written whole or not at all."""

from __future__ import annotations

import itertools
import math
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import contbreather as cb
import contbreather.plotting as plots
from contbreather.continuation import Branch
from contbreather.continuation.curve.kinds import MEETING, look_of
from contbreather.errors import BadInput
from contbreather.orbits.constructors import shooting
from contbreather.orbits.zone_diagram import Zones, regions
from contbreather.orbits.zones import zones
from contbreather.plotting.canvas import BLUE, PAGE, VERMILLION
from contbreather.plotting.multipliers import band


def curves(ax) -> list:
    return [line for line in ax.get_lines() if line.get_linestyle() != "None"]


def words(ax) -> list:
    return [text for text in ax.texts if text.get_text()]


def boxes(ax) -> list:
    ax.figure.draw_without_rendering()
    found = [text.get_window_extent() for text in words(ax)]
    legend = ax.get_legend()
    return [*found, legend.get_window_extent()] if legend else found


def overlaps(ax) -> int:
    return sum(one.overlaps(other) for one, other in itertools.combinations(boxes(ax), 2))


# --- branches -----------------------------------------------------------------------------------


def test_line_is_solid_exactly_where_the_infinite_chain_is_stable(in_a: Branch) -> None:
    ax = plots.plot(in_a).axes
    for line in curves(ax):
        dashed = line.get_linestyle() == "--"
        for p in np.asarray(line.get_ydata())[3:-3:5]:
            # on this branch p tells the breather: a by (13) from p
            chi, q = cb.InfiniteChain().chi(0.04), 0.2 / 1.8
            a = np.hypot(1 - p * chi, p * q)
            roots = (cb.symmetric(a, 0.04, 0.8), *cb.orbits.symmetric_roots(a, 0.04, 0.8))
            breather = min(roots, key=lambda b: abs(b.p - p))
            if abs(breather.p - p) < 1e-6:
                assert (breather.stability().unstable > 0) == dashed


def test_piece_between_two_special_points_is_drawn_by_what_lies_inside() -> None:
    """Without any other point on the branch: the count at the ends is of multipliers on the
    circle, on one side of it or on the other."""
    ring = shooting(cb.symmetric(0.5, 0.04, 0.8), sites=20)
    branch = cb.trace(ring, "a", within={"a": (0.25, 0.9)})
    bare = replace(branch, points=branch.special)
    assert [point.label for point in bare] == ["EP1", "NS1", "NS2", "PF1", "EP2"]
    drawn = {line.get_xdata()[0]: line.get_linestyle() for line in curves(plots.plot(bare).axes)}
    assert list(drawn.values()) == ["-", "--", "-", "--"]
    for point, after in itertools.pairwise(bare):
        middle = cb.symmetric(0.5 * (point["a"] + after["a"]), 0.04, 0.8)
        verdict = middle.stability(20, threshold=1.005)
        assert drawn[point["a"]] == ("--" if verdict.unstable else "-")


def test_boundary_is_solid_and_drawn_in_its_two_parameters(diagram: Zones) -> None:
    ax = plots.plot(diagram.curves["NS"][0]).axes
    assert {line.get_linestyle() for line in curves(ax)} == {"-"}
    assert (ax.get_xlabel(), ax.get_ylabel()) == (r"$\gamma$", "$a$")


def test_boundaries_are_told_apart_by_a_legend_of_their_kinds(diagram: Zones) -> None:
    """A meeting that was found along both is named once; a kind has one colour."""
    found = [branch for kind in ("PF", "GR", "NS") for branch in diagram.curves[kind]]
    ax = plots.plot(*found, found[0]).axes
    legend = ax.get_legend()
    named = zip(legend.get_texts(), legend.get_lines(), strict=True)
    colour = {text.get_text(): line.get_color() for text, line in named}
    assert len({*colour.values()}) == 3
    for branch in found:
        x, y = branch["gamma"][1], branch["a"][1]
        (line,) = {
            line.get_color() for line in curves(ax)
            if np.hypot(line.get_xdata() - x, line.get_ydata() - y).min() < 1e-12
        }  # fmt: skip
        assert line == colour[branch.problem.label]
    meetings = [{*text.get_text().rstrip("12").split("-")} for text in words(ax)]
    assert meetings.count({"PF", "GR"}) == 1


def test_a_legend_without_room_inside_the_axes_stands_above_them() -> None:
    """Also where it covers a point that no line passes through."""
    line = cb.Problem(lambda x, p: x - p["c"] * p["mu"], {"x": 0.0}, {"mu": 0.0, "c": 1.0})
    several = [
        cb.trace(line.at(c=c), "mu", within={"mu": (-1, 1)}, events=())
        for c in (-5.0, -1.0, -0.2, 0.2, 1.0, 5.0)
    ]
    for branches, inside in ((several, False), (several[3:], True)):
        ax = plots.plot(*branches).axes
        ax.figure.draw_without_rendering()
        box = ax.get_legend().get_window_extent()
        assert (box.y0 < ax.bbox.y1) == inside
        for curve in ax.get_lines():
            path = curve.get_transform().transform_path(curve.get_path())
            assert not path.intersects_bbox(box, filled=False)
            assert not box.count_contains(path.vertices)


def test_curve_goes_through_every_point_and_bends_between_them(in_a: Branch) -> None:
    x, y = (
        np.concatenate([getattr(line, f"get_{c}data")() for line in curves(plots.plot(in_a).axes)])
        for c in "xy"
    )
    for point in in_a:
        assert np.hypot(x - point["a"], y - point["p"]).min() < 1e-12
    chi, q = cb.InfiniteChain().chi(0.04), 0.2 / 1.8
    assert np.abs(x - np.hypot(1 - y * chi, y * q)).max() < 1e-3


def test_every_special_point_has_its_marker_and_its_label(in_a: Branch) -> None:
    ax = plots.plot(in_a).axes
    points = [line for line in ax.get_lines() if line.get_linestyle() == "None"]
    shown = {line.get_marker(): (line.get_xdata()[0], line.get_ydata()[0]) for line in points}
    for point in in_a.special:
        assert shown[look_of(point.kind).marker] == pytest.approx((point["a"], point["p"]))
    assert {text.get_text() for text in words(ax)} == {p.label for p in in_a.special}


def test_ends_of_several_branches_are_dots_without_names(in_a: Branch) -> None:
    other = cb.trace(cb.symmetric(0.5, 0.08, 0.8), "a", within={"a": (0.3, 0.6)})
    ax = plots.plot(in_a, other).axes
    assert not any(text.get_text().startswith("EP") for text in words(ax))
    dots = [line for line in ax.get_lines() if line.get_marker() == look_of("EP").marker]
    assert len(dots) == sum(point.kind == "EP" for b in (in_a, other) for point in b.special)


@pytest.mark.slow
def test_points_of_several_branches_in_a_corner_are_named_once_by_their_kind() -> None:
    """The doublings of a cascade, each the first of its branch, crowd at its end: PD1 all of them,
    and not one point that is there five times."""
    logistic = cb.FixedPoint(lambda x, p: p["r"] * x * (1 - x), {"x": 0.6}, {"r": 2.5})
    ax = cb.plotting.plot_diagram(cb.diagram(logistic, "r", within={"r": (0.5, 3.6)}, depth=4)).axes
    words = [text for text in ax.texts if text.get_text().startswith("PD")]
    assert sorted(text.get_text() for text in words) == ["PD", "PD1"]
    places = [ax.transData.transform(word.xy) for word in words]
    apart = [np.hypot(*(a - b)) for a, b in itertools.combinations(places, 2)]
    assert len(words) == 2  # at 3, and from 3.45 on
    assert min(apart) > 10 * ax.get_figure().dpi / 72


def test_a_fold_that_two_branches_number_otherwise_is_named_once() -> None:
    """The same curve, walked from either end: what is the first of one is the second of the other,
    and each finds it to its own rounding."""
    cubic = cb.Problem(lambda x, p: p["mu"] + x - x**3 / 3, {"x": -2.1}, {"mu": -1.0})
    ways = [
        cb.trace(start, "mu", towards=way, within={"mu": (-1, 1)}, events=[cb.fold()])
        for start, way in ((cubic, "up"), (cubic.at(x=2.1, mu=1.0), "down"))
    ]
    assert [round(way.first("LP")["mu"], 6) for way in ways] == [0.666667, -0.666667]
    assert [text.get_text() for text in words(plots.plot(*ways).axes)] == ["LP1", "LP2"]


@pytest.mark.parametrize("value", [1.0, -3.0, 0.0, 1e5])
def test_what_is_constant_up_to_rounding_is_drawn_as_constant(value: float) -> None:
    line = cb.Problem(lambda x, p: np.array([x[0] - p["mu"]]), {"x": 0.0}, {"mu": 0.0})
    branch = cb.trace(line, "mu", within={"mu": (-1, 1)})
    noise = 3e-16 * max(abs(value), 1.0)
    shown = cb.continuation.with_columns(
        branch, level=lambda point: value + noise * np.sin(99 * point["mu"])
    )
    ax = plots.plot(shown, y="level").axes
    ax.figure.draw_without_rendering()
    low, high = ax.get_ylim()
    assert low < value < high
    assert high - low > 0.1 * max(abs(value), 1.0)
    assert ax.yaxis.get_offset_text().get_text() == ""


def test_small_changes_are_not_taken_for_rounding() -> None:
    line = cb.Problem(lambda x, p: np.array([x[0] - 1 - 1e-6 * p["mu"]]), {"x": 1.0}, {"mu": 0.0})
    ax = plots.plot(cb.trace(line, "mu", within={"mu": (-1, 1)})).axes
    ax.figure.draw_without_rendering()
    low, high = ax.get_ylim()
    assert high - low < 3e-6
    assert ax.yaxis.get_offset_text().get_text() == ""


def test_doubtful_location_is_labelled_with_a_question_mark(in_a: Branch) -> None:
    doubtful = tuple(replace(p, located=False) if p.kind == "PF" else p for p in in_a)
    shown = {text.get_text() for text in words(plots.plot(replace(in_a, points=doubtful)).axes)}
    assert "PF1?" in shown


def test_branches_have_different_colours_in_one_call_and_in_several(in_a: Branch) -> None:
    other, third = (
        cb.trace(cb.symmetric(0.5, gamma, 0.8), "a", within={"a": (0.3, 0.6)})
        for gamma in (0.08, 0.06)
    )
    ax = plots.plot(in_a, other).axes
    assert len({line.get_color() for line in curves(ax)}) == 2
    plots.plot(third, ax=ax)
    assert len({line.get_color() for line in curves(ax)}) == 3


@pytest.mark.slow
@pytest.mark.parametrize("count", [8, 20])
def test_more_values_than_colours_of_the_cycle_have_one_each_and_a_legend(count: int) -> None:
    several = [
        cb.trace(cb.Problem(lambda x, p: p["mu"] * p["c"] - x, {"x": c}, {"mu": 1.0, "c": c}), "mu",
                 within={"mu": (0.9, 1.1)}, events=[cb.hopf()])
        for c in reversed(range(1, count + 1))
    ]  # fmt: skip
    ax = plots.plot(*several).axes
    colours = {line.get_color(): line for line in curves(ax)}
    assert len(colours) == count
    legend = ax.get_legend()
    *named, (left, line) = zip(legend.get_texts(), legend.get_lines(), strict=True)
    assert (left.get_text(), line.get_linestyle()) == (f"and {count - 7} more", "None")
    shown = {
        float(text.get_text().removeprefix("$c$ = ")): line.get_color() for text, line in named
    }
    assert list(shown) == sorted(shown)
    assert {1.0, float(count)} <= {*shown}
    assert len(shown) == 7
    for c, colour in shown.items():
        x, y = colours[colour].get_data()
        assert np.allclose(y, c * np.asarray(x))
    ax.figure.draw_without_rendering()
    assert legend.get_window_extent().y0 >= ax.bbox.y1


@pytest.mark.slow
@pytest.mark.parametrize("names", [("c", "d", "e"), ("c", "d", "e", "stiffness")])
def test_values_for_whose_words_there_is_no_room_leave_the_axes_large(names: tuple[str, ...]):
    # as of an ensemble of uneven chains, which differ in all their means
    several = [
        cb.trace(cb.Problem(lambda x, p: p["mu"] * p["c"] - x, {"x": c}, {"mu": 1.0, **params}),
                 "mu", within={"mu": (0.9, 1.1)}, events=[cb.hopf()])
        for c, params in ((c, dict.fromkeys(names, c)) for c in np.sqrt(range(2, 12)))
    ]  # fmt: skip
    ax = plots.plot(*several).axes
    ax.figure.draw_without_rendering()
    assert ax.bbox.height > 0.5 * ax.figure.bbox.height
    assert (legend := ax.get_legend()) is None or (
        ax.figure.bbox.width > legend.get_window_extent().width
    )


@pytest.mark.slow
def test_a_legend_of_zones_in_axes_of_ones_own_is_off_their_curves_and_title(diagram: Zones):
    """In a column of a journal it lay on all of them."""
    from matplotlib.figure import Figure

    ax = Figure(figsize=(3.4, 2.6), layout="constrained").subplots()
    plots.plot(diagram, ax=ax)
    ax.figure.draw_without_rendering()
    box = ax.get_legend().get_window_extent()
    (title,) = ax.findobj(lambda one: getattr(one, "get_text", str)() == ax.get_title("left"))
    assert not box.overlaps(title.get_window_extent())
    for curve in ax.get_lines():
        path = curve.get_transform().transform_path(curve.get_path())
        assert not path.intersects_bbox(box, filled=False)


@pytest.mark.slow
def test_legends_in_axes_of_ones_own_are_whole_and_off_other_panels() -> None:
    from matplotlib.figure import Figure

    several = [
        cb.trace(cb.Problem(lambda x, p: p["mu"] * p["c"] - x, {"x": c}, {"mu": 1.0, "c": c}), "mu",
                 within={"mu": (0.9, 1.1)}, events=[cb.hopf()])
        for c in range(1, 10)
    ]  # fmt: skip
    for rows, layout in ((1, None), (2, None), (1, "constrained")):
        figure = Figure(layout=layout)
        panels = figure.subplots(rows, 2).ravel()
        for ax in panels:
            plots.plot(*several, ax=ax)
        figure.draw_without_rendering()
        boxes = [ax.get_legend().get_window_extent() for ax in panels]
        corners = np.concatenate([box.corners() for box in boxes])
        assert figure.bbox.count_contains(corners) == len(corners)
        for box, ax in zip(boxes, panels, strict=True):
            others = [other.bbox for other in panels if other is not ax]
            assert not box.count_overlaps(
                [*others, *(other for other in boxes if other is not box)]
            )


@pytest.mark.slow
def test_beyond_some_names_a_legend_of_kinds_takes_their_place() -> None:
    """Six branches have thirty special points: no name of one is read among the others."""
    wave = cb.Problem(lambda x, p: p["mu"] - p["c"] * np.sin(x), {"x": 0.0}, {"mu": 0.0, "c": 1.0})
    several = [
        cb.trace(wave.at(c=c), "mu", within={"x": (-4, 4)}, events=[cb.fold(), cb.user("x", 1.0)])
        for c in np.linspace(1.0, 3.0, 6)
    ]
    ax = plots.plot(*several).axes
    assert not words(ax)
    shown = {text.get_text() for text in ax.get_legend().get_texts()}
    assert {p.kind for b in several for p in b.special} - {"EP"} <= shown
    figure = ax.get_figure()
    figure.draw_without_rendering()
    assert ax.bbox.height > 0.4 * figure.bbox.height
    assert len(words(plots.plot(*several, labels=True).axes)) > 14


def test_kinds_and_colours_are_those_that_were_asked_for(in_a: Branch) -> None:
    ax = plots.plot(in_a, kinds=("PF",), colours=["teal"]).axes
    assert [text.get_text() for text in words(ax)] == ["PF1"]
    assert {line.get_color() for line in curves(ax)} == {"teal"}
    with pytest.raises(cb.BadInput, match="a colour for each of 1"):
        plots.plot(in_a, colours=["teal", "red"])
    for wrong in ("PF", [["PF"]], 3):  # a list within a list was a TypeError
        with pytest.raises(cb.BadInput, match=r"kinds = .*: several were expected, as in kinds="):
            plots.plot(in_a, kinds=wrong)
    # also where they can be read once only
    once = plots.plot(in_a, in_a[:], kinds=iter(["PF"])).axes
    assert [line.get_marker() for line in once.get_lines()].count("^") == 2


def test_mirror_images_have_one_colour(in_a: Branch) -> None:
    arms = cb.switch(in_a.first("PF"))
    ax = plots.plot(in_a, *arms, y="p").axes
    assert len({line.get_color() for line in curves(ax)}) == 2


@pytest.mark.parametrize(
    ("draw", "sentence"),
    [
        (lambda b, z: plots.plot(b, x="b"), "no column 'b'; this branch has"),
        (lambda b, z: plots.plot(), "one branch; those of trace_many come once, a list keeps"),
        (
            lambda b, z: plots.plot(cb.trace_many([b[0]], "a")),
            r"got a generator \(it gives its values once, list\(\.\.\.\) keeps them\)",
        ),
        (lambda b, z: plots.plot(b, z), "only branches are drawn together, or zones; a Zones was"),
        (lambda b, z: plots.plot(b, "a", lambda p: p["p"]), "a function of a point .* y=function"),
        (lambda b, z: plots.plot(z, y="p"), "y says nothing of the picture of a Zones"),
        (lambda b, z: plots.plot(b, "a", x="p"), "the columns a: x and y were expected, each once"),
        (
            lambda b, z: plots.plot(b[0].curve),
            "a branch, zones or an orbit, say, was expected, got a Curve",
        ),
        (lambda b, z: plots.plot_zones(b), "a zone diagram was expected, got a Branch; plot draws"),
        (lambda b, z: plots.plot_diagram([b], y="q"), "no branch has a column 'q'; there are"),
        (lambda b, z: plots.plot_diagram([b], y=3), "a function of a point, was expected, got"),
        (lambda b, z: plots.plot_diagram([]), "no branch to draw"),
        *(
            (
                lambda b, z, no=no: plots.plot_diagram(b, y=lambda p: no),
                "no real numbers to draw in",
            )
            for no in ("x", 1j, None)
        ),
        (lambda b, z: plots.plot_space_time(b[0].solution, sites=()), "at least one site was"),
        (
            lambda b, z: plots.save_figure("x.png", plots.plot(b)),
            r"first, save_figure\(figure, 'x.png'\)",
        ),
    ],
)
def test_what_is_drawn_otherwise_is_refused_with_the_way(draw, sentence, in_a, diagram):
    with pytest.raises(BadInput, match=sentence):
        draw(in_a, diagram)


@pytest.mark.slow
def test_plot_draws_anything_that_was_computed(in_a: Branch, diagram: Zones) -> None:
    """As the function for it does: the same words and as many lines."""
    for value, draw in (
        (diagram, plots.plot_zones),
        (in_a[0].solution, plots.plot_orbit),
        (in_a[0], plots.plot_orbit),
        ([in_a, in_a], lambda pair: plots.plot(*pair, "a", "p")),
        (in_a, lambda branch: plots.plot_diagram(branch, y="p")),
    ):
        one, other = plots.plot(value).axes, draw(value).axes
        assert curves(one)
        assert len(curves(one)) == len(curves(other))
        assert [text.get_text() for text in one.texts] == [text.get_text() for text in other.texts]
    left, right = plots.plot([diagram, diagram])
    assert left.figure is right.figure
    assert left.axes is not right.axes


def test_a_figure_of_any_number_that_points_have(in_a: Branch) -> None:
    def height(point: cb.continuation.Point) -> float:
        return float(point.displacement(1, 0.0))

    assert plots.plot(in_a, y=height).axes.get_ylabel() == "height"
    assert plots.plot(in_a, y=lambda point: height(point)).axes.get_ylabel() == "y(point)"
    ax = plots.plot_diagram([in_a], y=height).axes
    assert ax.get_ylabel() == "height"
    x, y = ax.get_lines()[0].get_data()
    here = in_a[int(np.argmin(abs(in_a["a"] - x[0])))]
    assert y[0] == pytest.approx(height(here), abs=1e-9)


def test_a_site_that_is_given_twice_is_named_once(in_a: Branch) -> None:
    ax = plots.plot_orbit(in_a[0], sites=(1, 1, 2)).axes
    assert [word.get_text() for word in ax.get_legend().get_texts()] == ["$u_{1}$", "$u_{2}$"]


# --- zones --------------------------------------------------------------------------------------


def test_regions_are_polygons_that_fill_the_box_and_follow_the_curves(diagram: Zones) -> None:
    """Each place is in one of them, on the side of the exact fold that its verdict says."""
    from matplotlib.path import Path

    shapes = [(Path(region.outline), region) for region in diagram.regions]
    (x0, x1), (y0, y1) = diagram.box()
    area = 0.0
    for path, region in shapes:
        assert path.contains_point((region.x, region.y))
        assert np.array_equal(region.outline[0], region.outline[-1])
        x, y = region.outline[:-1].T
        area += 0.5 * abs(np.dot(x, np.roll(y, 1)) - np.dot(y, np.roll(x, 1)))
    assert area == pytest.approx((x1 - x0) * (y1 - y0), rel=2e-3)  # but for slivers
    for gamma in np.linspace(0.01, 0.24, 24):
        fold = cb.orbits.smallest_amplitude(gamma, 0.8)
        for a, exists in ((fold + 1e-3, True), (fold - 1e-3, False)):
            there = [region for path, region in shapes if path.contains_point((gamma, a))]
            assert len(there) <= 1
            assert all(bool(region.verdict) == exists for region in there)


def test_a_curve_that_ends_just_short_of_another_cuts_the_plane() -> None:
    """A chord passes by the end of a curve on it; farther off an end is an end."""
    x = np.linspace(0.0, 1.0, 21)
    arc = np.column_stack([x, 0.5 + 0.2 * np.sin(np.pi * x)])
    cut = [regions([arc, np.array([[0.512, 0.0], [0.512, 0.7 - gap]])], ((0, 1), (0, 1)),
                   lambda *_: 0) for gap in (0.0, 1e-3, 1e-2)]  # fmt: skip
    assert [len(pieces) for pieces in cut] == [3, 3, 2]


def test_a_region_is_lettered_by_its_count_and_may_be_a_hole_of_another() -> None:
    """Not by the side of a curve; a region whose points disagree has no letter."""
    angle = np.linspace(0.0, 2 * np.pi, 61)
    ring = 0.5 + 0.3 * np.column_stack([np.cos(angle), np.sin(angle)])
    flips = itertools.cycle([0, 1])
    for count, verdicts in (
        (lambda x, y: int(np.hypot(x - 0.5, y - 0.5) < 0.299), ["US", "S"]),
        (lambda x, y: 0, ["S", "S"]),
        (lambda x, y: next(flips), ["", ""]),
    ):
        found = regions([ring], ((0, 1), (0, 1)), count)
        inner, outer = sorted(found, key=lambda region: len(region.holes))
        assert [inner.verdict, outer.verdict] == verdicts
        assert len(outer.holes) == 1


def test_meetings_are_marked_once(diagram: Zones) -> None:
    ax = plots.plot_zones(diagram).axes
    marked = [line for line in ax.get_lines() if line.get_marker() == MEETING.marker]
    assert len(marked) == 3
    for line in marked:
        near = [
            np.hypot(line.get_xdata()[0] - p["gamma"], line.get_ydata()[0] - p["a"])
            for p in diagram.special
        ]
        assert sorted(near)[0] < 1e-6 < sorted(near)[1]  # seen from both curves, drawn once


def test_panels_are_lettered_and_explained_below_not_inside(diagram: Zones) -> None:
    panels = [one.axes for one in plots.plot_zones([diagram, diagram])]
    assert [ax.get_title(loc="left")[:3] for ax in panels] == ["(a)", "(b)"]
    assert all(ax.get_legend() is None for ax in panels)
    (legend,) = panels[0].figure.legends
    panels[0].figure.draw_without_rendering()
    assert legend.get_window_extent().y1 < panels[1].bbox.y0


@pytest.mark.parametrize(("count", "rows", "width"), [(2, 2, 8.5), (3, 2, PAGE)])
def test_zone_diagrams_fit_a_page(diagram: Zones, count: int, rows: int, width: float) -> None:
    panels = [one.axes for one in plots.plot_zones([diagram] * count)]
    assert len(panels) == len(panels[0].figure.axes) == count
    tops = {round(ax.get_position().y1, 2) for ax in panels}
    size_in_cm = 2.54 * panels[0].figure.get_size_inches()
    assert len(tops) == rows
    assert size_in_cm[0] == pytest.approx(width)
    assert size_in_cm[1] < 25.0


@pytest.mark.parametrize("gamma", [None, 0.0, 0.1])
def test_names_of_meetings_keep_off_axes_points_and_each_other(gamma, diagram: Zones) -> None:
    """At gamma = 0.1 one is in the corner; at gamma = 0 two are at the top, side by side."""
    ax = plots.plot_zones(diagram if gamma is None else zones(gamma=gamma)).axes
    assert overlaps(ax) == 0
    frame, pixel = ax.bbox, ax.figure.dpi / 72
    for text in words(ax):
        box = text.get_window_extent()
        assert box.x0 > frame.x0 + 2 * pixel
        assert box.x1 < frame.x1 - 2 * pixel
        assert box.y1 < frame.y1


@pytest.mark.slow
def test_axes_go_as_far_as_breathers_in_the_window() -> None:
    """Between a = 0.95 and 0.99 breathers exist down to gamma = 0, left of every curve."""
    window = {"a": (0.95, 0.99)}
    narrow = zones(k=0.8, within=window)
    (x0, x1), (y0, y1) = narrow.box(window)
    assert cb.symmetric(0.97, 0.003, 0.8).admissibility().ok
    assert x0 == 0.0
    assert x1 == pytest.approx(max(b["gamma"].max() for _, b in narrow))  # none beyond GR
    assert (y0, y1) == pytest.approx((0.95, 0.99))
    ax = plots.plot_zones(narrow, within=window).axes
    assert ax.get_xlim()[0] == 0.0
    assert "US" in {text.get_text() for text in words(ax)}
    # and no farther than was looked
    window = {"gamma": (0.02, 0.03), "a": (0.6, 0.99)}
    assert zones(k=0.8, within=window).box(window)[0] == pytest.approx((0.02, 0.03))
    # at another frequency of the drive the band is below it up to gamma = omega^2/4
    assert plots.plot_zones(zones(k=0.8, omega=1.3)).axes.get_xlim()[1] > 0.42


# --- multipliers --------------------------------------------------------------------------------


def test_no_word_stands_nearer_to_another_multiplier() -> None:
    orbit = cb.multibreather([0, 1], a=0.5, gamma=0.005, k=0.8, lattice=cb.Ring(10))
    ax = plots.plot_multipliers(orbit, half=True).axes
    lines = [line.get_xydata() for line in ax.get_lines() if line.get_marker() == "o"]
    dots = ax.transData.transform(np.concatenate(lines))
    for text in words(ax):
        box = text.get_window_extent()
        gaps = np.hypot(*np.maximum(np.maximum(box.min - dots, dots - box.max), 0.0).T)
        assert dots[gaps.argmin()] == pytest.approx(ax.transData.transform(text.xy))
    assert len(words(ax)) > 1


def test_all_multipliers_are_drawn_and_those_outside_stand_out() -> None:
    breather = cb.symmetric(0.2, 0.11, 0.8)
    ax = plots.plot_multipliers(breather, sites=100, half=True).axes
    dots = [line for line in ax.get_lines() if line.get_marker() == "o"]
    drawn = np.concatenate([line.get_xdata() + 1j * line.get_ydata() for line in dots])
    want = breather.multipliers(sites=100, half=True)
    np.testing.assert_allclose(np.sort_complex(drawn), np.sort_complex(want))
    (red,) = (line for line in dots if line.get_color() == VERMILLION)
    assert {line.get_color() for line in dots} == {BLUE, VERMILLION}
    assert np.abs(red.get_xdata() + 1j * red.get_ydata()) == pytest.approx([abs(want).max()] * 2)


def test_with_damping_the_band_is_where_the_multipliers_of_a_free_ring_are() -> None:
    """exp(-damping pi) from 0 over the period, and not on the circle."""
    ring = cb.Ring(60)
    damped = cb.symmetric(0.5, 0.08, 0.8, damping=0.05, lattice=ring)
    waves = band(damped)
    w = ring.frequencies(0.08)
    free = np.exp((-0.025 + np.sqrt(0.025**2 - w**2 + 0j)) * 2 * math.pi)
    assert abs(free[:, None] - waves[0]).min(axis=1).max() < 0.01
    assert np.median(abs(waves)) == pytest.approx(math.exp(-0.05 * math.pi))
    assert len(words(plots.plot_multipliers(damped).axes)) == 1


def test_one_multiplier_far_out_leaves_the_circle_as_large_as_it_was() -> None:
    lower = cb.orbits.symmetric_roots(0.3, 0.04, 0.8)[-1]
    largest = abs(lower.multipliers(sites=100)).max()
    ax = plots.plot_multipliers(lower, sites=100).axes
    assert largest > 20
    assert ax.get_xlim()[1] < 2.5
    assert f"{largest:.4f}" in {text.get_text() for text in words(ax)}


@pytest.mark.slow
def test_of_many_multipliers_off_the_band_the_farthest_have_names() -> None:
    """Each of six sites that hit has multipliers of its own."""
    orbit = cb.multibreather(range(0, 24, 2), a=0.5, gamma=0.03, k=0.8, lattice=cb.Ring(24))
    assert 0 < len(words(plots.plot_multipliers(orbit).axes)) <= 8


# --- files --------------------------------------------------------------------------------------


def drawn() -> object:
    made, (ax,) = plots.new_figure()
    ax.plot([0, 1], [1, 0])
    return made


@pytest.fixture
def figure() -> object:
    return drawn()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("suffix", "begins"), [("PNG", b"\x89PNG\r"), ("pdf", b"%PDF-"), ("svg", b"<?xml")]
)
def test_the_same_drawing_gives_the_same_file(suffix: str, begins: bytes, tmp_path: Path) -> None:
    one, two = (plots.save_figure(drawn(), tmp_path / f"{n}.{suffix}") for n in "12")
    content = one.read_bytes()
    assert content.startswith(begins)
    assert content == two.read_bytes()
    assert b"CreationDate" not in content  # nor does the next second make another file
    assert b"dc:date" not in content
    assert {path.name for path in tmp_path.iterdir()} == {f"1.{suffix}", f"2.{suffix}"}


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("folder", "it is a directory"),
        *(
            (name, r"suffix must be one of \.png, \.pdf, \.svg")
            for name in ("x", "x.jpeg", "x.png.gz")
        ),
    ],
)
def test_bad_place_for_a_figure_is_refused(figure, name, sentence, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder").mkdir()
    with pytest.raises(BadInput, match=sentence):
        plots.save_figure(figure, name)


@pytest.mark.parametrize("given", ["x", None, [], [[]], 3])
def test_what_has_no_figure_is_refused(given, tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="a figure or something drawn in one is expected, got"):
        plots.save_figure(given, tmp_path / "x.png")
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_drawing_and_saving_does_without_pyplot(tmp_path: Path) -> None:
    """pyplot opens windows and keeps every figure; a library has no business with it."""
    code = (
        "import sys, contbreather as cb\n"
        "from contbreather.plotting import plot, save_figure\n"
        "branch = cb.trace(cb.symmetric(0.5, 0.04, 0.8), 'a', within={'a': (0.4, 0.6)})\n"
        f"save_figure(plot(branch), {str(tmp_path / 'x.png')!r})\n"
        "assert 'matplotlib.pyplot' not in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
    assert (tmp_path / "x.png").read_bytes().startswith(b"\x89PNG")


def test_figures_belong_to_pyplot_if_the_caller_uses_it() -> None:
    from matplotlib import pyplot

    made, _ = plots.new_figure()
    assert pyplot.fignum_exists(made.number)
    pyplot.close(made)


def test_what_was_drawn_before_pyplot_was_there_is_shown(in_a: Branch, monkeypatch) -> None:
    from matplotlib import pyplot

    with monkeypatch.context() as before:
        before.delitem(sys.modules, "matplotlib.pyplot")
        drawn = plots.plot(in_a)
    assert drawn.figure.canvas.manager is None
    shown: list[object] = []
    monkeypatch.setattr(pyplot, "show", lambda: shown.append(pyplot.gcf()))
    drawn.show()
    assert shown == [drawn.figure]
    pyplot.close(drawn.figure)


# --- what plots return --------------------------------------------------------------------------


@pytest.mark.slow
def test_plots_return_the_artists_that_they_added_with_their_axes_and_figure(in_a, diagram):
    figure, (ax,) = plots.new_figure()
    (own,) = ax.plot([0.0, 1.0])
    drawn = plots.plot(in_a, ax=ax)
    assert own not in drawn
    assert {*ax.get_lines(), *ax.texts, ax.get_legend()} == {own, *drawn}
    assert (drawn.axes, drawn.figure) == (ax, figure)
    again = plots.plot(in_a, ax=ax)
    assert set(again).isdisjoint(drawn)
    assert repr(drawn) == f"<Drawn: {len(drawn)} artists>"
    _, (left, right) = plots.new_figure(2)
    one, two = plots.plot_zones([diagram, diagram], [left, right])
    assert (one.axes, two.axes) == (left, right)
    assert set(two) >= {*right.get_lines(), *right.patches}
    assert set(two).isdisjoint(one)


@pytest.mark.slow
def test_a_figure_is_saved_by_whatever_is_drawn_in_it(in_a: Branch, tmp_path: Path) -> None:
    drawn = plots.plot(in_a)
    plots.save_figure(drawn, tmp_path / "one.svg")  # which settles the layout, to rounding
    wanted = plots.save_figure(drawn.figure, tmp_path / "one.svg").read_bytes()
    for what in (drawn, [drawn], drawn[0], drawn.axes, drawn.figure.axes):
        assert plots.save_figure(what, tmp_path / "other.svg").read_bytes() == wanted


def test_branches_and_arms_of_several_couplings_are_told_apart_by_colour_and_legend(in_a: Branch):
    other = cb.trace(cb.symmetric(0.5, 0.06, 0.8), "a", within={"a": (0.4, 0.99)})
    both = (in_a, other)
    arms = [cb.switch(b.first("PF"), within={"a": (0.4, 0.99)}) for b in both]
    drawn = plots.plot(*both, *arms[0], *arms[1], x="a", y="p")
    legend = drawn.axes.get_legend()
    shown = {text.get_text(): line.get_color() for text, line in zip(
        legend.get_texts(), legend.get_lines(), strict=True)}  # fmt: skip
    assert list(shown) == [r"$\gamma$ = 0.04", r"$\gamma$ = 0.06", "stable", "unstable"]
    for branch, own, word in ((in_a, arms[0], "0.04"), (other, arms[1], "0.06")):
        colour = shown[rf"$\gamma$ = {word}"]
        for one in (branch, *own):
            end = one["a"][-1], one["p"][-1]
            assert colour in {
                line.get_color() for line in curves(drawn.axes)
                if np.allclose((line.get_xdata()[-1], line.get_ydata()[-1]), end)
            }  # fmt: skip
        pitchfork = branch.first("PF")
        (label,) = (
            text for text in words(drawn.axes)
            if text.get_text() == "PF1" and np.allclose(text.xy, (pitchfork["a"], pitchfork["p"]))
        )  # fmt: skip
        assert label.get_color() == colour


def test_branches_of_other_lattices_are_told_apart_by_colour_and_legend() -> None:
    within = {"a": (0.5, 0.55)}
    rings = [cb.symmetric(0.5, 0.04, 0.8, lattice=cb.Ring(n)) for n in (3, 5)]
    ax = plots.plot(*(cb.trace(ring, "a", within=within) for ring in rings)).axes
    words = [text.get_text().split(",")[0] for text in ax.get_legend().get_texts()]
    assert words[:2] == [f"symmetric breather (ring of {n}" for n in (3, 5)]


def test_what_is_the_same_on_all_branches_or_varies_on_one_is_not_in_the_legend(in_a: Branch):
    across = cb.trace(in_a[5], "gamma", within={"gamma": (0.03, 0.05)}, events=())
    ax = plots.plot(in_a, across, x="p", y="phi").axes
    assert len({line.get_color() for line in curves(ax)}) == 2
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["stable", "unstable"]
