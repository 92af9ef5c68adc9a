"""What pictures draw, looked at as a reader does: colours, legends, words and units, and data."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import networkx
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_hex, to_rgb

import contbreather as cb
import contbreather.plotting as plots
import contbreather.simulation as sim
from contbreather.continuation import Branch
from contbreather.orbits.zone_diagram import Zones
from contbreather.orbits.zones import zones
from contbreather.plotting.canvas import DASHES
from contbreather.plotting.runs import OUTCOMES

SET = {"a": 0.2, "gamma": 0.04, "k": 0.8, "damping": 0.01}
TURN = 2 * math.pi
REDDISH, BLUISH = "reddish", "bluish"


def hue(colour) -> str:
    red, _, blue = to_rgb(colour)
    return REDDISH if red > blue else BLUISH if blue > red else "grey"


def painted(ax) -> Callable[[float, float], tuple[float, float, float]]:
    """The colour that a reader sees at a place of the axes."""
    canvas = FigureCanvasAgg(ax.figure)
    canvas.draw()
    image = np.asarray(canvas.buffer_rgba())

    def pixel(x: float, y: float) -> tuple[float, float, float]:
        column, row = ax.transData.transform((x, y))
        return tuple(image[image.shape[0] - 1 - int(row), int(column), :3] / 255)

    return pixel


def legend_of(ax) -> dict[str, tuple[str, object]]:
    """Colour and dashes that the legend gives to each of its words."""
    legend = ax.get_legend() or ax.figure.legends[0]
    return {
        text.get_text(): (to_hex(handle.get_color()), handle._unscaled_dash_pattern)
        for text, handle in zip(legend.get_texts(), legend.legend_handles, strict=True)
    }


@pytest.mark.parametrize("draw", ["zones", "branch", "orbit"])
def test_nothing_is_drawn_beyond_limits_that_were_set_later(draw, diagram, in_a):
    """No letter of a region, marker or impact stands outside of the axes."""
    ax = plots.plot({"zones": diagram, "branch": in_a, "orbit": in_a[0]}[draw]).axes
    (left, right), (low, high) = ax.get_xlim(), ax.get_ylim()
    ax.set(xlim=(left + 0.4 * (right - left), right - 0.4 * (right - left)))
    ax.set(ylim=(low + 0.4 * (high - low), high - 0.4 * (high - low)))
    for legend in (ax.get_legend(), *ax.figure.legends):
        if legend is not None:
            legend.remove()

    def outside() -> np.ndarray:
        canvas = FigureCanvasAgg(ax.figure)
        canvas.draw()
        image = np.array(canvas.buffer_rgba())
        x0, y0, x1, y1 = ax.bbox.padded(8.0).extents.astype(int)
        image[image.shape[0] - y1 : image.shape[0] - y0, x0:x1] = 0
        return image

    seen = outside()
    for artist in (*ax.get_lines(), *ax.texts):
        artist.remove()
    assert np.array_equal(seen, outside())


@pytest.mark.slow
def test_words_and_legends_are_seen_in_a_dark_style(in_a: Branch, diagram: Zones) -> None:
    from matplotlib import pyplot

    with pyplot.style.context("dark_background"):
        figure, (ax, panel, below) = pyplot.subplots(3)
        plots.plot(in_a, ax=ax)
        plots.plot_zones(diagram, panel)
        plots.plot_multipliers(cb.symmetric(0.8, 0.045, 0.8), ax=below)
    pyplot.close(figure)
    for axes in (ax, panel, below):
        ground = np.array(to_rgb(axes.get_facecolor()))
        written = [text for text in axes.texts if text.get_text()]
        if legend := axes.get_legend():
            written += [*legend.get_texts(), *legend.get_lines()]
        assert written
        for artist in written:
            assert np.abs(to_rgb(artist.get_color()) - ground).max() > 0.4, artist


# --- zones --------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def panel(diagram: Zones):
    ax = plots.plot_zones(diagram).axes
    ax.figure.canvas.draw()
    return ax


def test_stable_is_blue_unstable_red_and_no_breather_white(panel) -> None:
    pixel = painted(panel)
    for gamma, a, seen in (
        (0.1, 0.5, BLUISH),  # stable
        (0.02, 0.4, BLUISH),
        (0.02, 0.9, REDDISH),  # above the pitchfork
        (0.2, 0.3, REDDISH),  # beyond the Neimark-Sacker line
        (0.1, 0.92, "grey"),  # behind grazing there is no breather,
        (0.1, 0.03, "grey"),  # nor below the fold
    ):
        colour = pixel(gamma, a)
        assert hue(colour) == seen, (gamma, a)
        assert (min(colour) == 1.0) == (seen == "grey")


def test_legend_of_zones_gives_each_name_the_looks_of_its_curve(panel, diagram: Zones) -> None:
    assert (panel.get_xlabel(), panel.get_ylabel()) == (r"$\gamma$", "$a$")
    assert panel.get_title(loc="left") == "$k$ = 0.8"
    names = {"LP": "fold", "GR": "grazing", "PF": "pitchfork", "NS": "Neimark–Sacker"}
    shown = legend_of(panel)
    assert list(shown) == [f"{names[kind]} ({kind})" for kind in ("LP", "GR", "PF", "NS")]
    assert len(set(shown.values())) == 4
    for kind, branch in diagram:
        (line,) = [
            line for line in panel.get_lines() if np.array_equal(line.get_xdata(), branch["gamma"])
        ]
        np.testing.assert_array_equal(line.get_ydata(), branch["a"])
        looks = to_hex(line.get_color()), line._unscaled_dash_pattern
        assert looks == shown[f"{names[kind]} ({kind})"]
        # limits of existence are black, those of stability have colours
        assert (hue(line.get_color()) == "grey") == (kind in ("LP", "GR"))


@pytest.mark.parametrize(
    ("on", "title"),
    [
        ({"forcing": cb.Symbolic("-cos(t) + c3*cos(3*t)", c3=0.1)}, "$k$ = 0.8, $c_{3}$ = 0.1"),
        ({"forcing": "-sin(t)"}, "$k$ = 0.8, F = a (-sin(t))"),
    ],
)
def test_a_title_names_the_forcing_where_it_is_not_the_paper_s(on: dict[str, Any], title: str):
    ax = plots.plot_zones(zones(k=0.8, within={"gamma": (0.04, 0.042)}, **on)).axes
    assert ax.get_title(loc="left") == title


# --- branches -----------------------------------------------------------------------------------


def test_special_points_have_the_colour_of_their_branch_and_ends_are_small_and_grey(in_a) -> None:
    ax = plots.plot(in_a).axes
    line = next(line for line in ax.get_lines() if line.get_linestyle() != "None")
    dots = {line.get_marker(): line for line in ax.get_lines() if line.get_linestyle() == "None"}
    assert dots["^"].get_color() == dots["s"].get_color() == line.get_color()
    assert hue(dots["."].get_color()) == "grey"
    assert dots["."].get_zorder() > line.get_zorder()


# --- multipliers --------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def unstable_pair():
    """One complex pair outside the circle, drawn for the half map."""
    return cb.symmetric(0.2, 0.11, 0.8)


def dots_of(ax) -> list[tuple[complex, str]]:
    return [
        (complex(x, y), to_hex(line.get_color()))
        for line in ax.get_lines()
        if line.get_marker() == "o"
        for x, y in zip(line.get_xdata(), line.get_ydata(), strict=True)
    ]


def test_a_branch_of_one_point_is_seen(in_a: Branch) -> None:
    one = in_a[3:4]
    assert not one.special
    place = one["a"][0], one["p"][0]
    assert hue(painted(plots.plot(one).axes)(*place)) == BLUISH


@pytest.mark.parametrize(
    ("half", "labels"), [(True, ["0.6158", "1.0628"]), (False, ["0.3792", "1.1294"])]
)
def test_multipliers_off_the_band_have_their_values_as_words_of_their_colour(half, labels) -> None:
    ax = plots.plot_multipliers(cb.symmetric(0.8, 0.045, 0.8), half=half).axes
    words = sorted((text.get_text(), hue(text.get_color())) for text in ax.texts if text.get_text())
    assert words == list(zip(labels, ("grey", REDDISH), strict=True))


def test_a_motion_that_returns_has_the_dots_of_its_orbit() -> None:
    on = {"a": 0.5, "gamma": 0.04, "k": 0.8, "damping": 0.05}
    orbit = cb.symmetric(**on, lattice=cb.Ring(4))
    motion = cb.simulation.periodic(orbit.state(), symmetric=True, **on)
    sides = [np.sort_complex([mu for mu, _ in dots_of(plots.plot_multipliers(one).axes)])
             for one in (orbit, motion)]  # fmt: skip
    np.testing.assert_allclose(*map(abs, sides), atol=1e-9)
    assert len(sides[1]) == 8


def test_a_pair_is_written_once_with_its_signs(unstable_pair) -> None:
    ax = plots.plot_multipliers(unstable_pair, half=True, sites=400, digits=3).axes
    mu = unstable_pair.multipliers(sites=400, half=True)
    top = mu[np.abs(mu).argmax()]
    wanted = f"{top.real:.3f} ± {abs(top.imag):.3f}i".replace("-", "−")
    assert wanted in {text.get_text() for text in ax.texts}
    negative = cb.symmetric(0.0572, 0.1, 0.8)  # next to its fold: near -1
    words = {text.get_text() for text in plots.plot_multipliers(negative, half=True).axes.texts}
    assert any(word.startswith("−0.") for word in words), words


def test_the_band_of_the_period_map_turns_twice_as_far() -> None:
    breather = cb.symmetric(0.5, 0.02, 0.8)
    for half, turns in ((True, 1), (False, 2)):
        ax = plots.plot_multipliers(breather, half=half, sites=40).axes
        arcs = [line for line in ax.get_lines() if line.get_linewidth() > 3]
        ends = sorted(np.angle(a.get_xdata()[-1] + 1j * a.get_ydata()[-1]) / np.pi for a in arcs)
        assert ends == pytest.approx([-2 * turns * 0.02**0.5, 2 * turns * 0.02**0.5])
        assert ax.get_aspect() == 1.0


# --- runs ---------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def state():
    return cb.symmetric(a=0.2, gamma=0.04, k=0.8).state(10)


@pytest.fixture(scope="module")
def run(state):
    return cb.simulate(state, periods=12, sample=sim.Sample((0, 1, -1), 20), t0=TURN, **SET)


def test_motion_has_time_in_periods_and_a_colour_for_each_name(run) -> None:
    ax = plots.plot_motion(run.record).axes
    assert (ax.get_xlabel(), ax.get_ylabel()) == (r"$t/2\pi$", "$u_n$")
    shown = {name: colour for name, (colour, _) in legend_of(ax).items()}
    for i, site in enumerate((0, 1, 9)):
        (line,) = [
            one for one in ax.get_lines() if to_hex(one.get_color()) == shown[f"$u_{{{site}}}$"]
        ]
        np.testing.assert_allclose(line.get_xdata(), run.record.times / TURN, rtol=1e-14)
        np.testing.assert_array_equal(line.get_ydata(), run.record.u[:, i])
        assert line.get_linestyle() == DASHES[i]  # told apart in grey, too
    assert ax.get_xlim() == pytest.approx((1.0, 12.95))  # no margin beyond the first and last
    hits = plots.plot_motion(run).axes.get_lines()[0]  # what hits is seen to hit
    assert {*np.round(hits.get_ydata()[abs(hits.get_ydata()) > 1 - 1e-12])} == {-1.0, 1.0}
    inside = run.at_site(0)["time"] <= run.record.times[-1]
    assert hits.get_xdata().size == len(run.record.times) + np.sum(inside)
    with pytest.raises(cb.BadInput, match=r"cb\.simulation\.Sample\("):
        plots.plot_motion(run.since(1))


@pytest.mark.slow
def test_a_window_of_a_motion_is_what_was_asked_for_and_recorded(run) -> None:
    ax = plots.plot_motion(run, periods=(3.0, 5.0)).axes
    assert ax.get_xlim() == pytest.approx((3.0, 5.0))
    with pytest.raises(cb.BadInput, match=r"periods = \(40, 50\): a pair .* recorded, 1 to 12.95"):
        plots.plot_motion(run, periods=(40, 50))


def test_section_of_a_fixed_point_does_not_zoom_into_rounding(state) -> None:
    run = cb.simulate(state, periods=5, a=0.2, gamma=0.04, k=0.8)
    assert np.ptp(plots.plot_section(run).axes.get_xlim()) == pytest.approx(2e-3)


@pytest.mark.parametrize("walls", ["rigid", "smooth"])
def test_localisation_is_the_ratio_over_periods(run, state, walls) -> None:
    one = run if walls == "rigid" else sim.simulate_smooth(state, m=6, periods=8, t0=TURN, **SET)
    ax = plots.plot_localisation(one).axes
    assert (ax.get_xlabel(), ax.get_ylabel()) == (r"$t/2\pi$", "participation ratio")
    (line,) = ax.get_lines()
    own = sim.localisation(*one.strobe, one.times, a=0.2, gamma=0.04, damping=0.01)
    np.testing.assert_allclose(line.get_ydata(), own.participation, rtol=1e-12)
    np.testing.assert_allclose(line.get_xdata(), 1 + np.arange(one.periods + 1), rtol=1e-12)
    assert 1.0 <= own.participation[0] < 1.5
    assert ax.get_ylim()[0] == 0.0
    assert ax.get_ylim()[1] >= max(4.0, own.participation.max())


@pytest.fixture(scope="module")
def loop(state) -> sim.Sweep:
    return sim.sweep(state, "a", sim.there_and_back([0.2, 0.1, 0.05]), periods=20, **SET)


def test_sweep_names_its_ways_by_what_the_parameter_did(loop: sim.Sweep) -> None:
    """Upwards the parameter grows, drawn with triangles that point up."""
    ax = plots.plot_sweep(loop).axes
    down, up = ax.get_lines()
    assert (down.get_xdata().tolist(), up.get_xdata().tolist()) == (
        [0.2, 0.1, 0.05],
        [0.05, 0.1, 0.2],
    )
    assert down.get_color() != up.get_color()
    for line in (down, up):
        up = line.get_xdata()[-1] > line.get_xdata()[0]
        assert line.get_label() == ("sweep up" if up else "sweep down")
        assert line.get_marker() == ("^" if up else "v")
    assert set(legend_of(ax)) == {"sweep up", "sweep down"}
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("$a$", "$p$")


@pytest.mark.parametrize(
    ("column", "word"),
    [
        ("p", "$p$"),
        ("amplitude", "speed of the centre"),
        ("participation", "participation ratio"),
        ("tilt", "asymmetry"),
        ("centre", "site with most energy"),
        ("others", "impacts elsewhere, a period"),
    ],
)
def test_every_column_of_a_sweep_is_drawn_under_its_own_name(loop, column, word) -> None:
    ax = plots.plot_sweep(loop, y=column).axes
    assert ax.get_ylabel() == word
    drawn = np.concatenate([line.get_ydata() for line in ax.get_lines()])
    own = np.asarray(getattr(loop, column), dtype=float)
    np.testing.assert_array_equal(drawn, [*own[:3], *own[2:]])


def test_each_fate_has_the_colour_that_the_legend_says() -> None:
    outcomes = np.array([[4, 1, 0], [2, 3, -1]], np.int8)
    u, v = sim.Axis("u", 1, [-0.5, 0.0, 0.5]), sim.Axis("v", 0, [-1.0, 1.0])
    ax = plots.plot_basin(sim.Basin(u, v, outcomes, np.zeros((2, 3)), False)).axes
    ax.set_axis_off()  # ticks stand in the cells at the edge
    ax.figure.canvas.draw()
    legend = ax.get_legend()
    shown = {
        text.get_text(): patch.get_facecolor()[:3]
        for text, patch in zip(legend.get_texts(), legend.get_patches(), strict=True)
    }
    named = {
        sim.Outcome.RETURNED: "back at the breather",
        sim.Outcome.OTHER: "a breather, another or not back yet",
        sim.Outcome.SPREAD: "impacts, no breather",
        sim.Outcome.QUIET: "no impacts",
        sim.Outcome.OUTSIDE: "behind a wall",
        sim.Outcome.PENDING: "not computed",
    }
    assert set(shown) == set(named.values())
    assert list(shown) == [outcome.words for outcome in OUTCOMES]
    assert len({*map(to_hex, shown.values())}) == len(sim.Outcome)
    pixel = painted(ax)
    for row, speed in enumerate(v.values):
        for column, place in enumerate(u.values):
            want = shown[named[sim.Outcome(outcomes[row, column])]]
            assert pixel(place, speed) == pytest.approx(want, abs=0.005)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("$u_{1}$", r"$\dot u_{0}$")


# --- canvas -------------------------------------------------------------------------------------


def test_a_figure_has_300_dots_to_the_inch(tmp_path: Path) -> None:
    from matplotlib.image import imread

    height, width, _ = imread(plots.save_figure(plots.new_figure(2)[0], tmp_path / "x.png")).shape
    assert (width, height) == pytest.approx((8.5 / 2.54 * 300, 13 / 2.54 * 300), abs=1)


def test_a_picture_made_in_the_caller_s_axes_has_the_caller_s_type() -> None:
    import matplotlib

    with matplotlib.rc_context({"axes.labelsize": 17.0}):
        from matplotlib.figure import Figure

        ax = Figure().subplots()
    branch = cb.trace(cb.symmetric(0.5, 0.04, 0.8), "a", within={"a": (0.45, 0.55)})
    assert plots.plot(branch, ax=ax).axes.xaxis.label.get_fontsize() == 17.0
    assert plots.plot(branch).axes.xaxis.label.get_fontsize() == 8.0


# --- all sites, all multipliers -----------------------------------------------------------------


def test_a_profile_has_the_displacement_of_each_site_in_its_place() -> None:
    breather = cb.symmetric(0.5, 0.08, 0.8)
    (line,) = [one for one in plots.plot_profile(breather, t=1.0).axes.get_lines()
               if one.get_marker() == "o"]  # fmt: skip
    n, u = line.get_data()
    assert list(n) == list(range(-10, 11))
    np.testing.assert_allclose(u, [breather.displacement(int(i), 1.0) for i in n], atol=1e-14)


def test_sites_of_a_grid_are_tiles_in_its_rows() -> None:
    on_grid = cb.symmetric(0.5, 0.05, 0.8, lattice=cb.Grid(3, 5), site=7)
    (tiles,) = plots.plot_profile(on_grid).axes.images
    assert tiles.get_array().shape == (3, 5)
    assert tiles.get_clim() == (-np.abs(tiles.get_array()).max(), np.abs(tiles.get_array()).max())
    np.testing.assert_allclose(np.ravel(tiles.get_array()), on_grid.state(t=0.0)[0], atol=1e-12)
    assert plots.plot_profile(on_grid, shape=(5, 3)).axes.images[0].get_array().shape == (5, 3)
    assert not plots.plot_profile(on_grid, sites=range(15)).axes.images
    with pytest.raises(cb.BadInput, match="16 places for 15 sites"):
        plots.plot_profile(on_grid, shape=(4, 4))
    for shape in ((15,), 15):
        with pytest.raises(cb.BadInput, match=r"a pair \(rows, columns\) was expected"):
            plots.plot_profile(on_grid, shape=shape)
    with pytest.raises(cb.BadInput, match="shape = -3: a whole number, at least 1"):
        plots.plot_profile(on_grid, shape=(-3, -5))


@pytest.mark.parametrize("draw", [plots.plot, plots.plot_motion, plots.plot_space_time])
def test_of_half_a_period_nothing_is_recorded_and_a_sentence_says_so(draw) -> None:
    breather = cb.symmetric(0.5, 0.08, 0.8, lattice=cb.Ring(5))
    run = cb.simulate(breather, periods=0.5, sample=sim.Sample((0,), 8))
    with pytest.raises(cb.BadInput, match="nothing was recorded: only whole periods are"):
        draw(run)


def test_a_run_over_space_and_time_has_its_sites_in_order(run) -> None:
    (mesh,) = plots.plot_space_time(run).axes.collections
    want = run.record.u[:, [0, 1, 2]]
    assert run.record.sites == (0, 1, 9)
    np.testing.assert_array_equal(np.reshape(mesh.get_array(), want.shape), want)
    assert mesh.get_clim() == (-np.abs(want).max(), np.abs(want).max())


def test_sites_apart_stand_side_by_side_over_time_each_as_wide() -> None:
    """None in between, which were not recorded, has a colour."""
    ax = plots.plot_space_time(cb.symmetric(0.5, 0.08, 0.8), sites=(0, 1, 9)).axes
    assert [text.get_text() for text in ax.get_xticklabels()] == ["0", "1", "9"]
    assert np.diff(ax.get_xticks()).tolist() == [1, 1]
    assert ax.get_xlim() == (-0.5, 2.5)


def test_a_grid_over_space_and_time_is_the_row_of_the_site_that_hits() -> None:
    lattice = cb.Lattice.from_graph(networkx.grid_2d_graph(3, 4), name="mine")
    on_grid = cb.symmetric(0.5, 0.05, 0.8, lattice=lattice, site=5, damping=0.02)
    run = cb.simulate(on_grid.state(), periods=2, **SET, lattice=lattice)
    for motion, what in ((on_grid, "hits"), (run, "moves most")):
        ax = plots.plot_space_time(motion).axes
        assert ax.get_title(loc="left") == f"row 1, in which site 5 {what}"
        values = np.reshape(ax.collections[0].get_array(), (-1, 4))
        np.testing.assert_allclose(values[0], on_grid.state()[0][4:8], atol=1e-12)
    ax = plots.plot_space_time(on_grid, sites=(1, 5, 9)).axes
    assert (ax.get_title(loc="left"), ax.get_xlabel()) == ("", "$n$")


def test_a_grid_recorded_at_some_sites_is_drawn_at_these() -> None:
    on_grid = cb.symmetric(0.5, 0.05, 0.8, lattice=cb.Grid(3, 4), site=5)
    conditions = {**SET, "lattice": cb.Grid(3, 4)}
    run = cb.simulate(on_grid.state(), periods=2, **conditions, sample=sim.Sample(sites=(5, 0, 11)))
    ax = plots.plot_space_time(run).axes
    assert (ax.get_title(loc="left"), ax.get_xlabel()) == ("", "$n$")
    assert np.reshape(ax.collections[0].get_array(), (len(run.record.times), 3)).any(axis=0).all()
    whole = cb.simulate(on_grid.state(), periods=2, **conditions, sample=sim.Sample((4, 5, 6, 7)))
    assert "row 1" in plots.plot_space_time(whole).axes.get_title(loc="left")
    with pytest.raises(cb.BadInput, match=r"site 1 was not recorded; there are \(5, 0, 11\)"):
        plots.plot_space_time(run, sites=(0, 1))


def test_multipliers_up_to_a_vanishing_impact_do_not_hide_those_at_the_circle() -> None:
    """Where it vanishes there are none; just before they are large."""
    lower = cb.orbits.symmetric_roots(0.9, 0.04, 0.8)[-1]
    branch = cb.trace(lower, "a", within={"a": (0.9, 1.2)}, towards="up")
    assert branch[-1].kind == "VI"
    assert plots.plot_spectrum(branch, sites=8).axes.get_yscale() == "symlog"


def test_an_orbit_over_space_and_time_is_its_period() -> None:
    breather = cb.symmetric(0.5, 0.08, 0.8)
    ax = plots.plot_space_time(breather, sites=(1, 0)).axes
    values = np.reshape(ax.collections[0].get_array(), (-1, 2))
    np.testing.assert_allclose(values[0], [breather.displacement(n, 0.0) for n in (0, 1)])
    np.testing.assert_allclose(values[0], values[-1], atol=1e-9)


def test_a_spectrum_crosses_where_the_branch_bifurcates() -> None:
    """+1 of half the map at the pitchfork; the eigenvalue 0 at a fold."""
    branch = cb.trace(cb.symmetric(0.7, 0.045, 0.8), "a", within={"a": (0.7, 0.82)})
    fork = branch.first("PF")["a"]
    a, mu = _dots(plots.plot_spectrum(branch, half=True, sites=40).axes)
    assert mu[a < fork - 1e-9].max() < 1 + 0.05
    assert mu[a > fork + 1e-3].max() > 1.02
    line = cb.Problem(lambda x, p: np.array([p["mu"] - x[0] ** 2]), {"x": 1.0}, {"mu": 1.0})
    bent = cb.trace(line, "mu", within={"x": (-1, 1)})
    _, real = _dots(plots.plot_spectrum(bent, x="x").axes)
    np.testing.assert_allclose(np.sort(real), np.sort(-2 * bent["x"]), atol=1e-9)


def test_of_a_map_multipliers_are_drawn_which_cross_the_circle_where_it_doubles() -> None:
    """That of the logistic map is 2 - r; its equations F - x have one less, -2 at the doubling."""
    logistic = cb.FixedPoint(lambda x, p: p["r"] * x * (1 - x), {"x": 0.6}, {"r": 2.5})
    branch = cb.trace(logistic, "r", within={"r": (2.5, 3.5)})
    ax = plots.plot_spectrum(branch).axes
    r, mu = _dots(ax)
    assert ax.get_ylabel() == r"$|\mu|$"
    np.testing.assert_allclose(mu, abs(2 - r), atol=1e-9)
    ax = plots.plot_multipliers(branch[-1]).axes
    assert [word.get_text() for word in ax.texts if word.get_text()] == ["\N{MINUS SIGN}1.5000"]


def _dots(ax) -> tuple:
    lines = [line for line in ax.get_lines() if line.get_marker() == "."]
    return tuple(np.concatenate([line.get_data()[i] for line in lines]) for i in (0, 1))


def test_unstable_branches_in_one_place_are_seen_to_be_dashed() -> None:
    """The dashes of one would fill the gaps of the other, as a solid line."""
    line = cb.Problem(lambda x, p: x, {"x": 0.0}, {"mu": 0.0}, record={"unstable": lambda p: 1})
    along = [
        cb.trace(line.at(mu=low), "mu", towards="up", within={"mu": (0, 1)})
        for low in np.linspace(0.0, 0.05, 4)
    ]
    seen = painted(plots.plot(*along, colours=["black"] * len(along)).axes)
    gaps = [min(seen(mu, 0.0)) > 0.5 for mu in np.linspace(0.2, 0.9, 500)]
    assert 0.1 < np.mean(gaps) < 0.5


def test_sites_of_oscillators_that_are_mirror_images_are_one_line_with_both_names() -> None:
    chain = cb.Oscillators(V="u**2/2 + u**4/4", W="c*r**2/2", lattice=cb.Ring(7))
    breather = cb.breather(chain, {3: 1}, omega=1.5, params={"c": 0.05}).solution
    rows = plots.plot_orbit(breather, sites=(1, 2, 3, 4, 5)).figure.axes
    both = ["$u_{1}$, $u_{5}$", "$u_{2}$, $u_{4}$", "$u_{3}$"]
    assert [line.get_label() for row in rows for line in row.get_lines()] == both
    assert [row.get_ylabel() for row in rows] == both


def test_a_breather_in_a_gap_is_drawn_between_the_bands_of_light_and_heavy_sites() -> None:
    chain = cb.Oscillators(V="u**2/2 + u**4/4", W="c*r**2/2", lattice=cb.Ring(8), onsite=[1, 4] * 4)
    start = cb.breather(chain, {0: 1}, omega=1.7, params={"c": 0.05})
    branch = cb.trace(start, "omega", within={"omega": (1.68, 1.72)})
    axes = plots.plot_energy(branch).axes
    lines = [line[0, 0] for of in axes.collections for line in of.get_segments()]
    lower, upper = np.split(chain.frequencies({"c": 0.05}), 2)
    assert {*lower, *upper} <= {*lines}
    assert not any(lower.max() < line < upper.min() for line in lines)
    left, right = axes.get_xlim()
    assert left < lower.max() < 1.68
    assert 1.72 < upper.min() < right
