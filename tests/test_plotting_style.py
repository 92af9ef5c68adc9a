"""The looks of all pictures: type, widths and layers of a journal column, and sizes of sheets."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import contbreather as cb
import contbreather.plotting as plots
from contbreather.errors import BadInput
from contbreather.orbits.zone_diagram import Zones
from contbreather.paper import figure4
from contbreather.paper.time_series import Panel, SampledCurve, TimeSeries
from contbreather.plotting.canvas import CYCLE, style, symbol
from contbreather.simulation import Axis, Basin, Sample, sweep, there_and_back

HERE = {"a": 0.2, "gamma": 0.04, "k": 0.8}


# --- the style ------------------------------------------------------------------------------------


# What red-blind, green-blind and other eyes see of linear red, green and blue (Machado, Oliveira,
# Fernandes, IEEE TVCG 15 (2009) 1291, severity 1).
EYES = {
    "red-blind": [
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
    "green-blind": [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ],
    "others": np.eye(3),
}


@pytest.mark.parametrize("eye", EYES)
def test_colours_of_lines_are_apart_for_every_eye(eye: str) -> None:
    srgb = np.array([mpl.colors.to_rgb(colour) for colour in CYCLE])
    linear = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
    seen = np.clip(linear @ np.array(EYES[eye]).T, 0, 1) ** (1 / 2.4)
    gaps = np.linalg.norm(seen[:, None] - seen[None], axis=2)[np.triu_indices(len(CYCLE), 1)]
    assert gaps.min() > 0.19  # what Okabe and Ito reach


def test_the_style_of_the_caller_comes_back() -> None:
    before = mpl.rcParams["axes.linewidth"]
    with style():
        assert mpl.rcParams["axes.linewidth"] != before
    assert mpl.rcParams["axes.linewidth"] == before


def test_names_are_written_as_in_the_paper() -> None:
    written = {
        "gamma": r"$\gamma$", "phi": r"$\varphi$", "a": "$a$", "k": "$k$", "p": "$p$",
        "t1": "$t_{1}$", "mu": r"$\mu$", "c": "$c$", "x": "$x$", "Omega2": r"$\Omega_{2}$",
        "x12": "$x_{12}$", "period": "period", "max(x)": "max(x)", "2": "2", "": "",
    }  # fmt: skip
    assert {name: symbol(name) for name in written} == written


# --- sheets ---------------------------------------------------------------------------------------


def centimetres(figure: Figure) -> tuple[float, float]:
    width, height = (round(2.54 * float(inches), 9) for inches in figure.get_size_inches())
    return width, height


def test_a_sheet_is_a_column_wide_and_as_high_as_its_panels() -> None:
    for rows, columns in ((1, 1), (2, 1), (1, 2), (3, 2)):
        figure, axes = plots.new_figure(rows, columns)
        assert centimetres(figure) == (8.5, 6.5 * rows)
        assert len(axes) == rows * columns
        places = [one.get_subplotspec() for one in axes]
        assert [(p.rowspan.start, p.colspan.start) for p in places] == [
            (i, j) for i in range(rows) for j in range(columns)
        ]
    assert centimetres(plots.new_figure(width=12.0, height=3.0)[0]) == (12.0, 3.0)


def test_axes_that_have_no_figure_any_more_are_not_saved(tmp_path: Path) -> None:
    _, (axes,) = plots.new_figure()
    axes.remove()
    with pytest.raises(BadInput, match="these axes have no figure any more; draw them anew"):
        plots.save_figure(axes, tmp_path / "gone.png")


# --- all pictures ---------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def run() -> cb.simulation.SimulationRun:
    state = cb.symmetric(**HERE).state(6)
    return cb.simulate(state, **HERE, periods=30, sample=Sample((0, 1, 3), 64))


@pytest.fixture(scope="module")
def pictures(diagram: Zones, run: cb.simulation.SimulationRun) -> dict[str, Axes]:
    branch = cb.trace(cb.symmetric(**HERE), "a", within={"a": (0.05, 0.9)})
    arms = cb.switch(branch.first("PF"), within={"a": (0.05, 0.9)})
    state = cb.symmetric(**HERE).state(6)
    loop = sweep(state, "a", there_and_back([0.2, 0.19, 0.18]), periods=4, **HERE, damping=0.01)
    outcome = np.array([[-1, 0, 1], [2, 3, 4]], np.int8)
    plane = Axis("u", 0, [-0.5, 0.0, 0.5]), Axis("v", 0, [0.0, 1.0])
    basin = Basin(*plane, outcome, np.zeros((2, 3)), True)
    t = np.linspace(0.0, 2.0, 9)
    looks = enumerate(("line", "dashed", "circles", "trace"))
    curves = tuple(SampledCurve(look, n, t, np.cos(t) + 2.2 * n, look) for n, look in looks)
    panels = Panel("against", curves[:3]), Panel("traces", curves[3:], lost=1.0)
    series = TimeSeries(6, panels, "").draw().axes
    made = {
        "orbit": plots.plot_orbit(cb.symmetric(**HERE)).axes,
        "sites": plots.plot_orbit(cb.symmetric(**HERE), sites=range(14)).axes,
        "moduli": replace(figure4(), sites=40).draw().axes[2],
        "against": series[0],
        "traces": series[1],
        "branch": plots.plot(branch).axes,
        "diagram": plots.plot_diagram((branch, *arms)).axes,
        "zones": plots.plot_zones(diagram).axes,
        "multipliers": plots.plot_multipliers(cb.symmetric(0.8, 0.045, 0.8), sites=40).axes,
        "motion": plots.plot_motion(run.record, periods=(0, 20)).axes,
        "section": plots.plot_section(run).axes,
        "localisation": plots.plot_localisation(run).axes,
        "sweep": plots.plot_sweep(loop).axes,
        "basin": plots.plot_basin(basin).axes,
    }
    for figure in {ax.figure for ax in made.values()}:
        figure.draw_without_rendering()
    return made


NAMES = (
    "branch", "diagram", "zones", "multipliers", "motion", "section", "localisation", "sweep",
    "basin", "orbit", "sites", "moduli", "against", "traces",
)  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
def test_everything_that_is_drawn_is_inside_the_axes_and_the_axes_inside_the_sheet(pictures, name):
    ax = pictures[name]
    figure = ax.figure
    whole = figure.bbox
    box = ax.get_tightbbox()
    assert box.x0 >= whole.x0 - 1
    assert box.y0 >= whole.y0 - 1
    assert box.x1 <= whole.x1 + 1
    assert box.y1 <= whole.y1 + 1
    assert centimetres(figure)[0] == 8.5
    for line in ax.get_lines():
        if line.get_transform() != ax.transData or name == "moduli":  # inside the circle: left out
            continue
        x, y = (np.asarray(part, dtype=float) for part in line.get_data())
        seen = np.isfinite(x) & np.isfinite(y)
        place = ax.transAxes.inverted().transform(ax.transData.transform(np.c_[x[seen], y[seen]]))
        assert place.min(initial=0.0) >= -1e-6
        assert place.max(initial=1.0) <= 1.0 + 1e-6


@pytest.mark.parametrize("legend", [True, False])
def test_in_axes_of_the_caller_zones_are_explained_inside_unless_refused(diagram, legend) -> None:
    figure, (ax,) = plots.new_figure()
    found = plots.plot_zones(diagram, ax, legend=legend).axes
    assert found is ax
    assert (ax.get_legend() is not None) == legend
    assert figure.legends == []
    with pytest.raises(BadInput, match="these axes have a zone diagram, whose regions another"):
        plots.plot_zones(diagram, ax)
    if legend:
        words = [text.get_text() for text in ax.get_legend().get_texts()]
        kinds = [kind for kind in ("LP", "GR", "PF", "NS") if diagram.curves[kind]]
        assert all(any(kind in word for word in words) or kind == "NS" for kind in kinds)
        assert len(words) == len(kinds)


@pytest.mark.slow
def test_two_panels_of_the_caller_take_one_diagram_each(diagram) -> None:
    _, axes = plots.new_figure(2)
    found = plots.plot_zones([diagram, diagram], axes)
    assert [one.axes for one in found] == list(axes)
    assert [ax.get_title(loc="left") for ax in axes] == ["(a) $k$ = 0.8", "(b) $k$ = 0.8"]
    assert axes[0].get_legend() is not None
    assert axes[1].get_legend() is None
    with pytest.raises(BadInput, match="2 zone diagrams need as many axes, got 1"):
        plots.plot_zones([diagram, diagram], axes[:1])
    with pytest.raises(BadInput, match="plot_zones needs at least one zone diagram, and a curve"):
        plots.plot_zones([])


def test_zones_are_drawn_into_axes_in_rows_and_not_two_into_one(diagram) -> None:
    figure, axes = plots.new_figure(2)
    found = plots.plot_zones([diagram, diagram], np.reshape(axes, (2, 1)), legend=False)
    assert [one.axes for one in found] == axes
    with pytest.raises(BadInput, match="2 zone diagrams need as many axes, got 1"):
        plots.plot_zones([diagram, diagram], 2 * [figure.add_subplot()])
    with pytest.raises(BadInput, match="matplotlib Axes to draw in were expected, got a Figure"):
        plots.plot_zones(diagram, figure)


def test_a_run_is_looked_at_by_the_numbers_of_its_sites(run) -> None:
    for site in (0.5, "0", None, (0,)):
        with pytest.raises(BadInput, match=r"site = .*: the number of a site was expected"):
            plots.plot_section(run, site=site)
    with pytest.raises(BadInput, match=r"skip = 31: the run has 30 periods to leave out"):
        plots.plot_section(run, skip=31)
    assert len(plots.plot_section(run, skip=30).axes.get_lines()[0].get_xdata()) == 1
    ax = plots.plot_section(run, site=-1, skip=10).axes
    (line,) = ax.get_lines()
    assert line.get_xdata() == pytest.approx(run.strobe.u[10:, 5])
    assert line.get_ydata() == pytest.approx(run.strobe.v[10:, 5])
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("$u_{-1}$", r"$\dot u_{-1}$")


def test_labels_of_multipliers_have_as_many_decimals_as_asked(diagram) -> None:
    b = cb.symmetric(0.8, 0.045, 0.8)
    for digits in (0, 2, 5):
        words = [
            w.get_text() for w in plots.plot_multipliers(b, sites=40, digits=digits).axes.texts
        ]
        real = [w for w in words if w and "i" not in w]
        assert real
        assert all(len(w.partition(".")[2]) == digits for w in real)
    with pytest.raises(BadInput, match=r"^digits = -1"):
        plots.plot_multipliers(b, sites=40, digits=-1)
    with pytest.raises(BadInput, match="an orbit or a cycle was expected, got a float"):
        plots.plot_multipliers(0.5)  # type: ignore[arg-type]


@pytest.mark.slow
def test_letters_of_regions_fit_into_them_and_there_is_none_where_none_does(diagram) -> None:
    ax = plots.plot_zones(diagram).axes
    ax.figure.draw_without_rendering()
    for region in diagram.regions:
        words = [w for w in ax.texts if w.get_position() == (region.x, region.y) and w.get_text()]
        assert [word.get_text() for word in words] == [region.verdict] * bool(region.verdict)
        for word in words:
            corners = ax.transData.inverted().transform(word.get_window_extent().corners())
            assert mpl.path.Path(region.outline).contains_points(corners).all()
    thin = replace(diagram)
    vars(thin)["regions"] = tuple(replace(region, room=0.0) for region in diagram.regions)
    assert not {"S", "US"} & {word.get_text() for word in plots.plot_zones(thin).axes.texts}


def test_a_point_of_anybody_s_problem_is_drawn_with_its_tangent_or_as_a_profile() -> None:
    line = cb.Problem(lambda x, p: x - 3.0 * p["mu"], {"x": 3.0}, {"mu": 1.0})
    _, (ax, below) = plots.new_figure(2)
    cb.plot(point := cb.trace(line, "mu", within={"mu": (0.5, 2.0)}, events=())[1], ax=ax)
    dot, tangent = ax.get_lines()
    assert (dot.get_xdata()[0], dot.get_ydata()[0]) == (point["mu"], point["x"])
    (x0, y0), (x1, y1) = tangent.get_xy1(), tangent.get_xy2()
    assert (x0 + x1, y0 + y1) == pytest.approx((2 * point["mu"], 2 * point["x"]))
    assert (y1 - y0) / (x1 - x0) == pytest.approx(3.0)
    assert (ax.get_xlabel(), ax.get_ylabel()) == (r"$\mu$", "$x$")
    many = cb.Problem(lambda u, p: u - p["mu"] * np.arange(4.0), {"u": np.zeros(4)}, {"mu": 0.0})
    cb.plot(cb.trace(many, "mu", within={"mu": (0.0, 1.0)}, events=())[-1], ax=below)
    assert below.get_lines()[0].get_ydata() == pytest.approx(np.arange(4.0))
    assert (below.get_xlabel(), below.get_ylabel()) == ("entry", "$u$")
