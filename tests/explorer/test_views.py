"""The figures of the page: what each shows of what it is given, in which looks, and how far."""

from __future__ import annotations

import re
import unicodedata
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from bokeh.core.enums import MarkerType
from bokeh.models import HoverTool

import contbreather as cb
from contbreather.continuation.curve.kinds import LOOKS, look_of
from contbreather.explorer import views
from contbreather.explorer.state import Chosen, PageState, verdicts
from contbreather.explorer.style import DARK, LIGHT
from contbreather.orbits.zone_diagram import Region
from contbreather.plotting import plot
from contbreather.plotting.zones import LINES, SHADES

B = cb.symmetric(a=0.5, gamma=0.08, k=0.8)
KINDS = ("LP", "GR", "PF", "NS")
same = np.testing.assert_array_equal


@pytest.fixture(scope="module")
def branch() -> Any:
    return cb.trace(cb.symmetric(0.5, 0.04, 0.8), "a", within={"a": (0.1, 0.9)})


def rows(source: Any, *names: str) -> list[Any]:
    return list(zip(*(source.data[name] for name in names), strict=True))


def around(axis: Any, low: float, high: float) -> None:
    """An axis shows all from low to high and a little more, also after a reset."""
    room = 0.08 * (high - low)
    ends = axis.start, axis.end, axis.reset_start, axis.reset_end
    assert ends == pytest.approx((low - room, high + room) * 2)


def test_the_diagram_is_drawn_where_it_is_and_a_region_has_its_holes(diagram: Any) -> None:
    ring = np.array([[0.1, 0.2], [0.2, 0.2], [0.2, 0.3], [0.1, 0.2]])
    extra = (
        Region(ring, (0.5 * ring + 0.1,), 0.15, 0.22, 0.1, (2, 2)),
        Region(ring, (), 0.1, 0.2, 0.1, (None, None)),  # no breathers: white, without a letter
    )
    view, drawn = views.ZonesView(LIGHT), replace(diagram)
    vars(drawn)["regions"] = (*diagram.regions, *extra)
    view.show(drawn)
    shaded = [one for one in (*diagram.regions, extra[0]) if one.verdict]
    letters = [(one.x, one.y, one.verdict) for one in shaded]
    assert rows(view.letters, "x", "y", "text") == letters
    shown = rows(view.regions, "xs", "ys", "colour")
    for one, (((*xs,),), ((*ys,),), colour) in zip(shaded, shown, strict=True):
        assert colour == SHADES[one.verdict]
        for wanted, x, y in zip((one.outline, *one.holes), xs, ys, strict=True):
            same(np.column_stack([x, y]), wanted)
    for kind in KINDS:
        for own, (x, y) in zip(diagram[kind], rows(view.curves[kind], "xs", "ys"), strict=True):
            same([x, y], [own["gamma"], own["a"]])
    wanted = {(p["gamma"], p["a"]): {*p.kind.split("-")} for p in diagram.special}
    met = rows(view.meetings, "x", "y", "text")
    assert {(x, y): {*name.split("\N{EN DASH}")} for x, y, name in met} == wanted
    ends = [max(line[name].max() for _, line in drawn) for name in ("gamma", "a")]
    around(view.figure.x_range, 0.0, ends[0])
    around(view.figure.y_range, 0.0, 1.08 * ends[1])
    words = {one.label.value: one.renderers[0] for one in view.figure.legend[0].items}
    assert list(words) == [LINES[kind]["label"] for kind in KINDS]  # as in print
    for kind, line in zip(KINDS, words.values(), strict=True):
        assert line.data_source is view.curves[kind]
        assert line.glyph.line_color == LINES[kind]["color"]
    dashes = [line.glyph.line_dash for line in words.values()]
    assert dashes == ["solid", "dashed", "dashdot", "solid"]
    view.show(replace(diagram, curves={**diagram.curves, "PF": ()}))
    assert [one.visible for one in view.figure.legend[0].items] == [True, True, False, True]


def test_the_title_says_what_is_shown_and_what_is_on_its_way(diagram: Any) -> None:
    view, coming = views.ZonesView(LIGHT), "; k = 0.8 is being computed"
    for plane, fixed, words in (
        (None, 0.8, f"no diagram yet{coming}"),
        (diagram, 0.8, "infinite chain, k = 0.8; another lattice is being computed"),
        (diagram, 0.7, "infinite chain, k = 0.8; k = 0.7 is being computed"),
        (diagram, 0.8, "infinite chain, k = 0.8"),
    ):
        awaited = "k" if "computed" in words else ""
        view.title(PageState(plane=plane, fixed=("k", fixed), awaited=awaited))
        lines = view.figure.title.text.split("\n")
        assert (" ".join(lines).strip(), len(lines)) == (words, 2)


def test_a_title_has_the_width_of_its_figure_and_is_not_broken_within_a_value() -> None:
    """On a phone those of a breather and of a simulation were cut off at the right."""
    words = "open chain with free ends, 5 sites, damping = 0.02, k = 0.8"
    view = views.MotionView(LIGHT)
    views._say(view.figure, words)
    assert view.figure.title.text.split("\n")[1] == "k = 0.8"
    for width, longest in ((240, 32), (1000, 133), (0, 1)):  # 0 where it is hidden
        view.figure.trigger("inner_width", 400, width)
        lines = view.figure.title.text.strip().split("\n")
        assert max(map(len, lines)) <= longest
        assert " ".join(lines) == words or not width


def test_a_branch_is_drawn_as_in_print_with_a_word_at_each_special_point(branch: Any) -> None:
    doubtful = tuple(replace(p, located=False) if p.kind == "PF" else p for p in branch)
    view = views.BranchView(DARK)
    both = {"one": replace(branch, points=doubtful), "two": branch}
    view.show(both, "a", "phi")
    printed = [line for line in plot(branch, x="a", y="phi").axes.get_lines()
               if line.get_linestyle() != "None"]  # fmt: skip
    dashes = {"-": "solid", "--": "dashed", ":": "dotted", "-.": "dashdot"}
    wanted = [(line, colour) for colour in DARK.cycle[:2] for line in printed]
    drawn = rows(view.lines, "xs", "ys", "colour", "dash")
    for (xs, ys, *its), (line, colour) in zip(drawn, wanted, strict=True):
        same([xs, ys], line.get_data())
        assert its == [colour, dashes[line.get_linestyle()]]
    points = []
    for one, colour, mark in zip(both, DARK.cycle, ("?", ""), strict=False):
        for p in branch.special:
            there = one == "two"  # the same words stand there already
            text = "" if p.kind == "EP" or there else p.label + mark * (p.kind == "PF")
            values = ", ".join(f"{name} = {value:.8g}" for name, value in p.values.items())
            what = f"{p.label} of {one}: {values}"
            points.append((float(p["a"]), float(p["phi"]), text, colour, what))
    assert rows(view.special, "x", "y", "text", "colour", "what") == points
    assert [tool.tooltips for tool in view.figure.select(HoverTool)] == [[("", "@what")]]
    axes = view.figure.xaxis.axis_label, view.figure.yaxis.axis_label
    shared = "in a, infinite chain, gamma = 0.04, k = 0.8"
    assert (view.figure.title.text.strip(), *axes) == (shared, "a", "φ")
    for axis, get in ((view.figure.x_range, "get_xdata"), (view.figure.y_range, "get_ydata")):
        data = np.concatenate([getattr(line, get)() for line in printed])
        around(axis, data.min(), data.max())
    for point, x, y, place in (
        (branch[5], "arclength", "residual", ([branch[5].arclength], [branch[5].residual])),
        (branch[5], "p2", "a", ([np.nan], [branch[5]["a"]])),  # a column that it does not have
        (None, "a", "phi", ([], [])),
    ):
        view.choose(Chosen("x", B, point), x, y)
        np.testing.assert_equal((view.here.data["x"], view.here.data["y"]), place)
    cusp = replace(branch[5], kind="CP", label="CP1")
    view.show({"one": replace(branch, points=(branch[0], cusp, branch[-1]))}, "a", "p")
    assert view.special.data["mark"][1] == views.MARKS[look_of("CP").marker]
    assert {*views.MARKS} == {
        *(look_of(kind).marker for kind in (*LOOKS, "LP-GR", "of somebody"))
    }  # those of print
    assert {*views.MARKS.values()} <= {*MarkerType}
    for name in ("gamma", "phi", "mu", "nu"):
        assert unicodedata.name(views.letter(name)) == f"GREEK SMALL LETTER {name.upper()}"
        assert views.letter(name.title()) == views.letter(name).upper()


def test_the_legend_says_which_curve_a_colour_is_and_what_dashes_mean(branch: Any) -> None:
    """The same as in print; of many curves it has the first."""
    view, stable = views.BranchView(LIGHT), branch[5:8]
    legend = view.figure.legend[0]
    assert legend in view.figure.below
    (entry,) = legend.items
    assert (entry.label.field, entry.renderers[0].data_source) == ("word", view.key)
    for curves, wanted in (
        ({"one": branch, "two": stable}, [
            ("one", LIGHT.cycle[0], "solid"), ("two", LIGHT.cycle[1], "solid"),
            ("stable", LIGHT.text, "solid"), ("unstable", LIGHT.text, "dashed"),
        ]),
        ({"two": stable}, [("two", LIGHT.cycle[0], "solid")]),
        ({str(i): stable for i in range(12)},
         [(str(i), LIGHT.cycle[i % 7], "solid") for i in range(8)]),
        ({}, []),
    ):  # fmt: skip
        view.show(curves, "a", "p")
        assert rows(view.key, "word", "colour", "dash") == wanted
        assert np.isnan(np.array(view.key.data["xs"])).all()  # nothing is drawn besides the legend


def test_words_at_an_edge_are_on_the_other_side_of_their_marks(branch: Any) -> None:
    view, fork = views.BranchView(LIGHT), branch.first("PF")
    view.show({"one": branch}, "a", "p")
    assert ("PF1", "left", 7, -5) in rows(view.special, "text", "side", "right", "down")
    view.show({"one": replace(branch, points=(branch[1], branch[2], fork))}, "a", "p")
    assert rows(view.special, "text", "side", "right", "down")[-1] == ("PF1", "right", -7, 16)


@pytest.mark.parametrize(("kind", "said"), [("VI", "less than six"), ("GR", r"up to 1\.\d+ times")])
def test_no_wave_is_said_to_come_back_1_times_as_large(kind: str, said: str) -> None:
    branch = cb.trace(cb.symmetric(a=0.5, gamma=0.1, k=0.8), "a", within={"a": (0.01, 2.0)})
    orbit = branch.first(kind).solution
    sentence = dict(verdicts(orbit, 40))["over-reflection"]
    assert re.search(said, sentence)
    assert (np.exp(orbit.stability().over_reflection.gain) - 1 < 5e-6) == (kind == "VI")


def test_the_motion_shows_each_site_between_its_walls() -> None:
    view = views.MotionView(LIGHT)
    run = cb.simulate(B.state(12), a=0.5, gamma=0.08, k=0.8, periods=2, t0=2 * np.pi,
                      sample=cb.simulation.Sample((0, 3), 32))  # fmt: skip
    view.show(B, (1, 0), "stable")
    assert view.figure.title.text.strip() == "stable"
    assert rows(view.lines, "site", "colour") == [("site 1", "#0072B2"), ("site 0", "#D55E00")]
    hits = rows(view.hits, "x", "y", "colour")
    assert {(wall, colour) for _, wall, colour in hits} == {(-1.0, "#D55E00"), (1.0, "#D55E00")}
    for time, wall, _ in hits:
        assert B.displacement(0, 2 * np.pi * time) == pytest.approx(wall, abs=1e-12)
    for start, end, sites in ((0.0, 1.0, (1, 0)), (1.0, run.record.times[-1] / 2 / np.pi, (0, 3))):
        for n, (x, y) in zip(sites, rows(view.lines, "xs", "ys"), strict=True):
            np.testing.assert_allclose(y, B.displacement(n, 2 * np.pi * x), atol=2e-2)
        around(view.figure.x_range, start, end)
        around(view.figure.y_range, -1.0, 1.0)
        ends = [view.figure.x_range.start, view.figure.x_range.end]
        assert rows(view.walls, "xs", "ys") == [(ends, [wall, wall]) for wall in (-1.0, 1.0)]
        view.run("run1", run, "periodic")
    assert view.figure.title.text.strip() == "run1: 2 periods, 4 impacts; periodic"
    for sites, there in (((0, 3, 40), (0, 3)), ((-1,), (-1,)), ((40,), (0,))):
        view.show(B.on(cb.Ring(10)), sites, "")
        assert view.lines.data["site"] == [f"site {n}" for n in there]


def test_sites_are_told_apart_in_grey_and_mirror_images_are_one_line() -> None:
    view = views.MotionView(LIGHT)
    view.show(B, (0, 1, -1, 2), "")
    want = [("site 0", "solid"), ("site 1, -1", "dashed"), ("site 2", "dashdot")]
    assert rows(view.lines, "site", "dash") == want
    np.testing.assert_allclose(B.displacement(-1, 0.5), B.displacement(1, 0.5), rtol=1e-12)


def test_a_simulated_site_is_seen_at_its_walls_however_coarsely_it_was_sampled() -> None:
    """Impacts are part of the line: the peak is at the wall, and not .95 between two walls at 1."""
    view = views.MotionView(LIGHT)
    walls = cb.symmetric(0.5, 0.05, 0.8, lattice=cb.Ring(9), walls=(-0.9, 0.9), damping=0.02)
    for orbit in (B.on(cb.Ring(12)), walls):
        for periods in (3, 300):  # all of the line, and its extremes where it is long
            sample = cb.simulation.Sample((0, -1), 8)
            given = {**vars(orbit.conditions), "periods": periods, "sample": sample}
            run = cb.simulate(orbit.state(), **given)
            view.run("run1", run, "periodic")
            (x, y), (_, beside) = rows(view.lines, "xs", "ys")
            assert (min(y), max(y)) == orbit.walls.at(0)
            assert np.all(np.diff(x) >= 0)
            hits = run.at_site(0)[:4]
            there = np.interp(hits["time"] / 2 / np.pi, x, y)
            np.testing.assert_allclose(there, [orbit.walls.at(0)[int(h > 0)] for h in hits["wall"]])
            seen = run.at_site(-1)
            assert len(seen) or max(beside) < orbit.walls.at(1)[1]


def test_the_profile_shows_the_site_that_impacts_at_its_wall_and_small_lattices_whole() -> None:
    view = views.ProfileView(LIGHT)
    view.show(B)
    data = view.sites.data
    centre = list(data["n"]).index(0)
    assert data["u"][centre] == pytest.approx(1.0, abs=1e-14)
    assert data["high"][centre] == pytest.approx(1.0, abs=1e-12)
    assert data["high"][centre + 1] == pytest.approx(B.admissibility().max_neighbour, abs=1e-4)
    same(view.walls.data["y"], np.tile([-1.0, 1.0], data["n"].size))
    ends = cb.symmetric(a=0.6, gamma=0.05, k=0.8, lattice=cb.OpenChain(9), site=0, damping=0.01)
    for orbit, size in ((ends, 9), (B.on(cb.Ring(20)), 20)):
        view.show(orbit)
        assert list(view.sites.data["n"]) == list(range(size))


def test_the_band_is_that_of_half_a_period_of_the_ring_or_of_the_own_lattice() -> None:
    view = views.MultipliersView(LIGHT)
    view.show(B, 100)
    edge = np.exp(2j * np.pi * 0.08**0.5)  # exp(+-i pi w), w up to 2 sqrt(gamma)
    ends = [xs[-1] + 1j * ys[-1] for xs, ys in rows(view.band, "xs", "ys")]
    assert ends == pytest.approx([edge, edge.conjugate()])
    assert sum(view.dots.data["size"] > 5.0) == 2
    view.show(cb.symmetric(a=0.6, gamma=0.05, k=0.8, lattice=cb.Ring(12), damping=0.02), 400)
    assert len(view.dots.data["x"]) == 24
    waves = [np.hypot(xs, ys) for xs, ys in rows(view.band, "xs", "ys")]
    assert np.median(waves) == pytest.approx(np.exp(-0.01 * np.pi))  # half a period


@pytest.mark.parametrize(("a", "beyond"), [(0.5, False), (0.1, False), (0.3, True)])
def test_multipliers_are_drawn_on_a_square_those_outside_red(a: float, beyond: bool) -> None:
    """Up to 4 from 0; the title says of one that is farther out."""
    orbit = cb.orbits.symmetric_roots(a, 0.08, 0.8)[0 if a == 0.5 else -1]
    view = views.MultipliersView(LIGHT)
    view.show(orbit, 100)
    mu = orbit.multipliers(sites=100, half=True)
    x, y, size = (np.asarray(view.dots.data[name]) for name in ("x", "y", "size"))
    same(x + 1j * y, mu)
    largest, off = abs(mu).max(), abs(abs(mu) - 1.0) > 0.05
    assert (largest > 4.0) == beyond
    red = np.array(view.dots.data["colour"]) == LIGHT.vermillion
    same(red, off & (abs(mu) > 1.0))
    assert size[off].min(initial=10.0) > size.min() >= 2.0
    fig, words = view.figure, f"; one at |μ| = {largest:.4g}" * beyond
    assert fig.title.text.strip().replace("\n", " ") == f"over half a period, ring of 100{words}"
    reach = 1.1 * min(max(1.15, largest), 4.0)
    for axis in (fig.x_range, fig.y_range):
        ends = axis.start, axis.end, axis.reset_start, axis.reset_end
        assert ends == pytest.approx((-reach, reach) * 2)
    frame = fig.width - fig.min_border_left - fig.min_border_right
    assert frame == fig.height - fig.min_border_top - fig.min_border_bottom == 240
    view.nothing("too large")
    assert fig.title.text.strip() == "too large"
    assert not any(map(len, view.dots.data.values()))


def test_a_word_that_would_cover_another_is_left_out_and_its_mark_stays(branch: Any) -> None:
    view, fork = views.BranchView(LIGHT), branch.first("PF")
    points = branch[0], fork, replace(fork, kind="UZ", label="UZ1"), branch[-1]
    view.show({"one": replace(branch, points=points)}, "a", "p")
    text, what = (view.special.data[name] for name in ("text", "what"))
    assert [*text[1:3]] == ["PF1", ""]
    assert what[2].startswith("UZ1 of one: ")
    # in the corner words hang below their marks, to the left of them
    line = cb.Problem(lambda x, p: x - p["mu"], {"x": 0.5}, {"mu": 0.5})
    marks = [cb.user("mu", value) for value in (0.91, 0.999)]
    view.show({"one": cb.trace(line, "mu", within={"mu": (0, 1)}, events=marks)}, "mu", "x")
    assert len(view.special.data["text"]) == 4
    assert [word for word in view.special.data["text"] if word] == ["UZ1"]
