"""Pictures of anybody's equations: stability of equilibria, cycles by envelope and by their states.

Born at mu = 0: the cycle x = sqrt(mu) cos t, y = sqrt(mu) sin t, with the multiplier exp(-4 pi mu).
"""

from __future__ import annotations

import math

import numpy as np
import pytest

import contbreather as cb
import contbreather.plotting as plots
from contbreather.plotting.pictures import card

MOST = 0.5


def field(t, x, p):
    square = x[0] ** 2 + x[1] ** 2
    return [p["mu"] * x[0] - x[1] - x[0] * square, x[0] + p["mu"] * x[1] - x[1] * square]


def lines(ax) -> list:
    """Those that are curves, with more than the two points of a mark."""
    return [line for line in ax.get_lines() if len(line.get_xdata()) > 2]


def ends(line) -> tuple[float, float]:
    return float(min(line.get_xdata())), float(max(line.get_xdata()))


@pytest.fixture(scope="module")
def rest():
    few = cb.flows.Collocation(intervals=8, points=5)
    start = cb.equilibrium(field, {"x": 0.0, "y": 0.0}, {"mu": -0.5}, collocation=few)
    return cb.trace(start, "mu", within={"mu": (-1, 1)})


@pytest.fixture(scope="module")
def cycles(rest):
    return cb.switch(rest.first("HB"), within={"mu": (-1, MOST)})[0][:-1]  # without its end


FALL = cb.Flow(
    lambda t, x, p: [x[1], -1.0],
    until=lambda t, x, p: x[0] - p["A"] * np.sin(t),
    reset=lambda t, x, p: [x[0], -p["e"] * x[1] + (1 + p["e"]) * p["A"] * np.cos(t)],
)
TABLE = {"A": 0.6, "e": 0.8}


@pytest.fixture(scope="module")
def ball():
    start = {"y": 0.46, "v": 3.1}
    made = cb.cycle([FALL], start=start, params=TABLE, period=2 * np.pi, t0=0.9, settle=10)
    return cb.flows.cycle_of(made)


def dashed_from_zero(ax) -> bool:
    """Whether a line is solid up to mu = 0 and dashed from there on."""
    style = {line.get_linestyle(): ends(line) for line in lines(ax)}
    return style == {"-": pytest.approx((-1, 0), abs=1e-9), "--": pytest.approx((0, 1), abs=1e-9)}


def test_equilibria_are_dashed_beyond_their_hopf_point(rest) -> None:
    assert dashed_from_zero(plots.plot(rest).axes)


@pytest.mark.slow
def test_equations_of_a_flow_count_unstable_eigenvalues_and_are_dashed_by_them(tmp_path) -> None:
    """The column is in tables and files, and what is drawn goes by it, also out of a file."""
    mine = cb.Problem(lambda x, p: np.array(field(0.0, x, p)), {"x": 0.0, "y": 0.0}, {"mu": -0.5})
    branch = cb.trace(mine, "mu", within={"mu": (-1, 1)}, events=[cb.hopf()])
    regular = np.array([not point.kind for point in branch])
    np.testing.assert_array_equal(branch["unstable"][regular], 2 * (branch["mu"] > 0)[regular])
    counts = branch.to_dataframe()["unstable"]
    assert np.isnan(counts[branch.to_dataframe()["label"] == "HB1"]).all()
    cb.save(tmp_path / "run.nc", branch)
    for again in (branch, *(cb.load(tmp_path / "run.nc", problem=p) for p in (None, mine))):
        assert dashed_from_zero(plots.plot(again).axes)
        np.testing.assert_array_equal(again["unstable"][regular], branch["unstable"][regular])


@pytest.mark.parametrize("given", ["function", "pattern"])
def test_large_equations_have_no_column(given) -> None:
    """Of sparse ones some eigenvalues are known only; with up to 250 unknowns, all of them."""
    eye_array = pytest.importorskip("scipy.sparse").eye_array

    def traced(n: int) -> cb.Branch:
        jacobian = eye_array(n) if given == "pattern" else lambda x, p: np.eye(n)
        start = {"u": np.zeros(n)}
        mine = cb.Problem(lambda x, p: x - p["mu"], start, {"mu": 0.0}, jacobian=jacobian)
        return cb.trace(mine, "mu", within={"mu": (0, 0.1)}, events=[cb.hopf()])

    assert "unstable" not in traced(251).names
    assert traced(250)["unstable"][1] == 250


def test_a_column_and_a_parameter_of_ones_own_keep_their_name() -> None:
    def column(point: cb.continuation.Point) -> float:
        return 7.0

    named = {"start": {"x": 0.0, "y": 0.0}, "params": {"mu": -0.5}, "record": {"unstable": column}}
    taken = {"start": {"unstable": 0.0, "y": 0.0}, "params": {"mu": -0.5}}
    for given, value in ((named, 7.0), (taken, 0.0)):
        mine = cb.Problem(lambda x, p: np.array(field(0.0, x, p)), **given)
        branch = cb.trace(mine, "mu", within={"mu": (-1, 1)}, events=[cb.hopf()])
        assert {*branch["unstable"]} == {value}
    plain = cb.trace(mine.at(mu=-1.0), "mu", within={"mu": (-1, 1)}, events=[cb.fold()])
    assert plain.names.count("unstable") == 1


def test_tables_of_cycles_are_without_their_collocation(cycles, tmp_path) -> None:
    frame = cycles.to_dataframe()
    assert not [name for name in frame if name.startswith(("orbit", "mesh"))]
    assert {"mu", "period", "unstable", "max(x)"} <= {*frame}
    head = cycles.to_csv(tmp_path / "cycles.csv").read_text().split("\n", 1)[0]
    assert head.split(",") == list(frame)
    assert {"orbit", "mesh"} <= {*cycles.to_xarray()} & {*cycles.names}


def test_tables_of_boundaries_are_without_null_vectors() -> None:
    mine = cb.Problem(
        lambda x, p: np.array([p["mu"] + p["b"] ** 2 - x[0] ** 2, -x[1]]),
        {"x": 0.5, "y": 0.0}, {"mu": 0.25, "b": 0.0},
    )  # fmt: skip
    branch = cb.trace(mine, "mu", within={"x": (-1, 1)}, events=[cb.fold()])
    line = cb.boundary(branch.first("LP"), ("b", "mu"), within={"b": (0.0, 0.02)}, events=())
    assert line["null"].shape == (len(line), 2)
    assert {"mu", "b"} <= {*line.to_dataframe()}
    assert not [name for name in line.to_dataframe() if name.startswith("null")]


def test_what_is_no_orbit_is_named_and_sent_where_it_is_drawn(rest, cycles) -> None:
    spectrum = r"got an equilibrium, .*: plotting\.plot_spectrum\(branch\) draws the eigenvalues"
    for draw in (plots.plot_orbit, plots.plot_multipliers):
        for given, why in (
            (rest, r"got a Branch: take one of its points, branch\[0\] for"),
            (cycles, r"an orbit or a cycle was expected, got a Branch: take one"),
            (rest[3], spectrum),
            (rest.problem, spectrum),
            (cycles.problem, r"got the problem of a cycle: flows\.cycle_of\(problem\) is its"),
        ):
            with pytest.raises(cb.BadInput, match=why):
                draw(given)
    with pytest.raises(cb.BadInput, match="of a lattice was expected, got a cycle of flows: plot_"):
        plots.plot_profile(cycles[0])


def test_cycles_are_drawn_by_the_largest_and_the_smallest_value_of_a_state(rest, cycles) -> None:
    ax = plots.plot(rest, cycles, y="x").axes
    curves = [(np.array(line.get_xdata()), np.array(line.get_ydata())) for line in lines(ax)]
    top, bottom = (y for mu, y in curves if abs(y).max() > 0.1)
    mu = next(mu for mu, y in curves if y is top)
    np.testing.assert_allclose(top, np.sqrt(mu), atol=1e-6)
    np.testing.assert_allclose(bottom, -np.sqrt(mu), atol=1e-6)


def test_special_points_of_cycles_are_marked_on_both_sides_and_named_once(rest, cycles) -> None:
    ax = plots.plot(cycles).axes
    stars = [line for line in ax.get_lines() if line.get_marker() == "*"]
    assert len(stars) == 2
    assert sorted(word.get_text() for word in ax.texts if word.get_text()) == ["HB1"]


def test_an_orbit_of_a_flow_is_drawn_over_time_and_as_a_phase_portrait(cycles) -> None:
    ax = plots.plot_orbit(cycles[-1]).axes
    x, y = (line.get_ydata() for line in lines(ax))
    mu = cycles["mu"][-1]
    np.testing.assert_allclose(x**2 + y**2, mu, atol=1e-6)
    assert ax.get_xlabel() == "$t$"
    assert ends(lines(ax)[0]) == pytest.approx((0.0, 2 * math.pi))
    (round,) = lines(plots.plot_orbit(cycles[-1].solution, x="x", y="y").axes)
    np.testing.assert_allclose(np.hypot(*round.get_data()), math.sqrt(mu), atol=1e-6)


@pytest.mark.parametrize("own", [True, False])
def test_states_of_unlike_size_have_rows_of_their_own(own: bool) -> None:
    """cos t, -sin t, 100 + cos t, 50 cos t, and one at rest; in axes beside others, too."""

    def many(t, x, p):
        return [x[1], -x[0], x[1], 50 * x[1], 1e-14 * x[0]]

    start = {"a": 1.0, "b": 0.0, "c": 101.0, "d": 50.0, "e": 0.5}
    run = cb.integrate(many, start, {}, time=2 * math.pi)
    ax = None if own else plots.new_figure(1, 2)[1][0]
    drawn = plots.plot_motion(run, ax=ax)
    rows = [row for row in drawn.figure.axes if row.get_lines()]
    labels = [[line.get_label() for line in row.get_lines()] for row in rows]
    assert labels == [["$a$", "$b$", "$e$"], ["$c$"], ["$d$"]]
    assert [row.get_ylabel() for row in rows] == ["states", "$c$", "$d$"]
    assert [row.get_xlabel() for row in rows] == ["", "", "$t$"]
    assert {line for row in rows for line in row.get_lines()} <= {*drawn}
    assert ends(rows[0].get_lines()[0]) == pytest.approx((0.0, 2 * math.pi))
    drawn.figure.draw_without_rendering()
    sides = {tuple(np.round(row.bbox.intervalx)) for row in rows}
    assert len(sides) == 1  # one above the other
    assert all(np.diff([row.bbox.y0 for row in rows]) < 0)
    for row in rows:
        low, high = row.get_ylim()
        swings = [np.ptp(line.get_ydata()) for line in row.get_lines()]
        assert all(swing > 0.1 * (high - low) for swing in swings if swing > 1e-9)
    together = plots.plot_motion(run, y=["a", "b"]).figure.axes
    assert len(together) == 1


def test_where_a_condition_ends_a_flow_there_is_a_dot_and_the_reset_is_dotted(ball) -> None:
    ax = plots.plot_orbit(ball, x="y", y="v").axes
    dot = next(line for line in ax.get_lines() if line.get_marker() == "o")
    jump = next(line for line in ax.get_lines() if line.get_linestyle() == ":")
    assert dot.get_ydata()[0] == pytest.approx(-math.pi)
    assert list(jump.get_ydata()) == pytest.approx([-math.pi, math.pi])


def test_a_trajectory_is_drawn_from_impact_to_impact() -> None:
    run = cb.integrate([FALL], {"y": 0.6, "v": 3.1}, TABLE, time=25.0, t0=0.9)
    ax = plots.plot_motion(run, y="y").axes
    dots = [line.get_xdata()[0] for line in ax.get_lines() if line.get_marker() == "o"]
    assert dots == pytest.approx([event.time for event in run.events])
    later = lines(plots.plot_motion(run, y="y", periods=(8.0, 25.0)).axes)
    first, second = (ends(line)[0] for line in later[:2])
    assert first == pytest.approx(8.0, abs=0.5)
    assert second == pytest.approx(run.events[1].time)


def test_multipliers_of_cycles_are_drawn_along_their_branch_and_in_the_plane(cycles) -> None:
    ax = plots.plot_spectrum(cycles).axes
    dots = next(line for line in ax.get_lines() if line.get_marker() == ".")
    np.testing.assert_allclose(dots.get_ydata(), np.exp(-4 * np.pi * dots.get_xdata()), atol=1e-6)
    (word,) = (w for w in plots.plot_multipliers(cycles[-1], digits=5).axes.texts if w.get_text())
    assert word.get_text() == f"{math.exp(-4 * math.pi * cycles['mu'][-1]):.5f}"


@pytest.mark.slow
@pytest.mark.filterwarnings("error")
def test_an_infinite_multiplier_is_shown_at_the_edge() -> None:
    """At VI, where the others are not known."""
    hit = cb.Flow(
        lambda t, x, p: [x[1], p["F"] * np.cos(1.5 * t) - x[0] - 0.1 * x[1]],
        until=lambda t, x, p: 1 - x[0], reset=lambda t, x, p: [x[0], -0.7 * x[1]],
    )  # fmt: skip
    start, turn = {"x": 0.9, "v": -2.0}, 2 * np.pi / 1.5
    orbit = cb.cycle(hit, start, {"F": 1.0}, period=turn, settle=80)
    ax = plots.plot_multipliers(cb.trace(orbit, "F", within={"F": (0.3, 1.35)}).first("VI")).axes
    assert [text.get_text() for text in ax.texts] == ["inf"]


def test_a_notebook_shows_cycles_and_trajectories(ball) -> None:
    run = cb.integrate([FALL], {"y": 0.6, "v": 3.1}, TABLE, events=2, t0=0.9)
    for value in (ball, run):
        assert "<svg" in card(value)


@pytest.mark.parametrize(
    ("draw", "said"),
    [
        (lambda ball: plots.plot_orbit(ball, y="w"), r"no state 'w'; there are \['y', 'v'\]"),
        (lambda ball: plots.plot_orbit(ball, sites=(0,)), "a cycle of flows has states, y='y'"),
        (lambda ball: plots.plot_multipliers(ball, half=True), "are about lattices"),
        (lambda ball: plots.plot_orbit(cb.symmetric(0.5, 0.08, 0.8), y="v"), "choose sites="),
        (lambda ball: plots.plot_motion(ball), "got a Cycle; cb.integrate"),
        (lambda _: plots.plot_motion(cb.Problem(field, {"x": 0.0}, {})), "got a Problem; cb.int"),
    ],
)
def test_what_does_not_go_together_is_refused(ball, draw, said) -> None:
    with pytest.raises(cb.BadInput, match=said):
        draw(ball)
