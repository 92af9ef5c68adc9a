"""Pictures say what they show: one ordinate for all breathers, forks that are seen, the sign of a
profile, stability that was not computed, and runs longer than their picture has dots."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

import contbreather as cb
from contbreather.orbits.constructors import asymmetric
from contbreather.plotting import (
    new_figure,
    plot,
    plot_diagram,
    plot_motion,
    plot_space_time,
    plot_sweep,
    style,
)
from contbreather.simulation import Sample, simulate_smooth, sweep, there_and_back

from .test_plotting import curves

SET: dict[str, Any] = {"a": 0.2, "gamma": 0.04, "k": 0.8, "damping": 0.01}
RING = cb.Ring(8)


def legend(ax: Any) -> list[str]:
    return [text.get_text() for text in ax.get_legend().get_texts()] if ax.get_legend() else []


# --- breathers ------------------------------------------------------------------------------------

BREATHERS = {
    "chain": lambda: cb.symmetric(0.5, 0.04, 0.8),
    "arm": lambda: asymmetric(0.8, 0.04, 0.8),
    "ring": lambda: cb.symmetric(0.5, 0.04, 0.8, lattice=RING),
    "damped ring": lambda: cb.symmetric(0.5, 0.04, 0.8, lattice=RING, damping=0.01),
    "open chain": lambda: cb.symmetric(0.5, 0.04, 0.8, lattice=cb.OpenChain(7), site=3),
    "grid": lambda: cb.symmetric(0.5, 0.03, 0.8, lattice=cb.Grid(3, 3), site=4),
    "shot": lambda: cb.shooting(cb.symmetric(0.7, 0.04, 0.8), sites=8, symmetric=False),
    "two sites": lambda: cb.multibreather([0, 3], a=0.6, gamma=0.02, k=0.8, lattice=RING),
    "doubled": lambda: cb.symmetric(0.5, 0.04, 0.8).unfolded().doubled(),
}


@pytest.mark.parametrize("name", BREATHERS)
def test_every_branch_of_breathers_is_drawn_by_its_momentum(name: str) -> None:
    start = BREATHERS[name]()
    a = start.a if hasattr(start, "a") else start.params["a"]
    branch = cb.trace(start, "a", within={"a": (a - 0.01, a + 0.01)})
    ax = plot(branch).axes
    assert ax.get_ylabel() == "$p$"
    ends = [line.get_ydata()[i] for line in curves(ax) for i in (0, -1)]
    # (4): an impact transfers 2p
    want = [0.5 * abs(branch[i].solution.impulses[0]) for i in (0, -1)]
    assert [min(ends), max(ends)] == pytest.approx(sorted(want), abs=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize(
    "start",
    [cb.symmetric(0.7, 0.04, 0.8), cb.symmetric(0.7, 0.04, 0.8, lattice=RING, damping=0.01)],
    ids=["chain", "damped ring"],
)
def test_both_arms_of_a_pitchfork_are_seen_beside_their_branch(start: Any) -> None:
    """One above and one below the branch, which they meet where it bifurcates."""
    within = {"a": (0.7, 0.85)}
    branch = cb.trace(start, "a", within=within)
    fork = branch.first("PF")
    arms = cb.switch(fork, within=within)
    for ax in (plot(branch, *arms).axes, plot_diagram([branch, *arms]).axes):
        assert ax.get_ylabel() == "asymmetry"
        tops = [line.get_ydata()[np.abs(line.get_ydata()).argmax()] for line in curves(ax)]
        assert min(tops) == pytest.approx(-max(tops), rel=1e-6)
        assert max(tops) > 0.1
        for line in curves(ax):
            bent = np.abs(line.get_ydata()) > 0.1
            assert np.all(np.asarray(line.get_xdata())[bent] > fork["a"])
    # for the size of impacts, which mirror images share, one has to ask
    assert plot(branch, *arms, y="p").axes.get_ylabel() == "$p$"


def test_arms_that_asymmetry_does_not_part_are_drawn_by_a_time() -> None:
    """Beyond its doubling an orbit has no mirror image to compare it with."""
    arm = asymmetric(0.9, 0.005, 0.95)
    branch = cb.trace(arm, "a", within={"a": (0.9, 0.99)})
    (doubled, *_) = cb.switch(branch.first("PD"), within={"a": (0.9, 0.99)})
    ax = plot(branch, doubled).axes
    assert ax.get_ylabel() == "$t_{1}$"
    assert "asymmetry" not in doubled.names


def test_a_branch_that_turns_back_is_not_drawn_upon_itself() -> None:
    """Beside its arms: dashes of its lower half upon those beyond the pitchfork look solid."""
    branch = cb.trace(cb.symmetric(0.5, 0.04, 0.8), "a", within={"a": (0.05, 0.95)})
    ax = plot(branch, *cb.switch(branch.first("PF"))).axes
    lower, upper = [line.get_ydata() for line in curves(ax) if line.get_linestyle() == "--"]
    assert lower.min() > upper.max() + 1.0


def test_with_what_is_beyond_grazing_momenta_are_drawn() -> None:
    within = {"a": (0.9, 0.95)}
    ring = cb.symmetric(0.9, 0.05, 0.8, damping=0.02, lattice=cb.Ring(9))
    tree = cb.diagram(ring, "a", within=within, beyond=True)
    assert len({len(branch.problem.section.impacts) for branch in tree}) > 1
    assert plot(tree).axes.get_ylabel() == "$p$"


def test_a_problem_says_which_of_its_columns_is_drawn() -> None:
    class Sized(cb.Problem):
        shown = ("size",)

    record = {"size": lambda point: 3.0 * point["mu"]}
    mine = Sized(lambda x, p: x - p["mu"], {"x": 0.0}, {"mu": 0.0}, record=record)
    branch = cb.trace(mine, "mu", within={"mu": (0, 1)}, events=())
    ax = plot(branch).axes
    assert ax.get_ylabel() == "size"
    assert curves(ax)[0].get_ydata()[-1] == pytest.approx(3.0)
    plain = cb.Problem(mine.residual, mine.start, mine.params)
    assert plot(branch, cb.trace(plain, "mu", within={"mu": (0, 1)})).axes.get_ylabel() == "$x$"


# --- into axes that show something already --------------------------------------------------------


@pytest.fixture(scope="module")
def loop() -> Any:
    state = cb.symmetric(a=0.2, gamma=0.04, k=0.8).state(10)
    return sweep(state, "a", there_and_back([0.2, 0.15, 0.1]), periods=20, **SET)


@pytest.fixture(scope="module")
def branch() -> cb.Branch:
    return cb.trace(cb.symmetric(0.5, 0.04, 0.8), "a", within={"a": (0.1, 0.6)})


def test_axes_of_another_quantity_are_not_relabelled(loop: Any, branch: cb.Branch) -> None:
    ax = plot(branch, y="t1").axes
    before = len(ax.get_lines())
    for draw in (
        lambda: plot_sweep(loop, ax=ax),
        lambda: plot_sweep(loop, y="tilt", ax=ax),
        lambda: plot(branch, y="p", ax=ax),
        lambda: plot(branch, x="phi", y="t1", ax=ax),
        lambda: plot_diagram(branch, ax=ax),
    ):
        with pytest.raises(cb.BadInput, match=r"these axes show \$(t_\{1\}|a)\$ .* axes of their"):
            draw()
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("$a$", "$t_{1}$")
    assert len(ax.get_lines()) == before


def test_a_sweep_is_drawn_over_its_branch(loop: Any, branch: cb.Branch) -> None:
    ax = plot(branch).axes
    assert plot_sweep(loop, ax=ax).axes is ax
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("$a$", "$p$")
    fork = plot(branch, y="asymmetry").axes
    plot_sweep(loop, y="tilt", ax=fork)  # which is t2 - t1 - pi, too
    assert fork.get_ylabel() == "asymmetry"
    turning = cb.trace(cb.symmetric(0.2, 0.04, 0.8), "a", within={"a": (0.05, 0.2)})
    panel = plot_sweep(loop, ax=plot(turning).axes).axes
    words = [text.get_text() for text in panel.get_legend().get_texts()]
    assert words == ["stable", "unstable", "sweep down", "sweep up"]


def test_a_legend_goes_on_from_what_the_axes_said_before() -> None:
    values = (0.02, 0.03, 0.04, 0.06)
    few = [
        cb.trace(cb.symmetric(0.2, g, 0.8), "a", within={"a": (0.18, 0.2)}, events=())
        for g in values
    ]
    axes = plot(few[0]).axes
    for branch in (*few[1:], few[0]):  # one by one, the first of them once more
        plot(branch, ax=axes)
    legend = axes.get_legend()
    said = [
        (text.get_text(), line.get_color())
        for text, line in zip(legend.get_texts(), legend.legend_handles, strict=True)
    ]
    shades = [line.get_color() for line in axes.get_lines() if len(line.get_xdata()) > 1]
    assert said == [(f"$\\gamma$ = {g}", c) for g, c in zip(values, shades, strict=False)]
    assert shades[4] == shades[0]


# --- arrays ---------------------------------------------------------------------------------------


def chafee_infante(n: int) -> cb.Problem:
    """``u'' + mu (u - u^3) = 0`` between two zeros, at n places."""
    h = math.pi / (n + 1)
    second = (np.eye(n, k=1) + np.eye(n, k=-1) - 2.0 * np.eye(n)) / h**2

    def residual(x: np.ndarray, p: Any) -> np.ndarray:
        return second @ x + p["mu"] * (x - x**3)

    def jacobian(x: np.ndarray, p: Any) -> np.ndarray:
        return second + np.diag(p["mu"] * (1.0 - 3.0 * x**2))

    return cb.Problem(residual, {"u": np.zeros(n)}, {"mu": 0.5}, jacobian=jacobian)


EVENTS = [cb.branch_point(), cb.hopf()]


@pytest.mark.slow
@pytest.mark.parametrize("mode", [1, 2])
def test_both_arms_of_a_pitchfork_of_profiles_are_seen(mode: int) -> None:
    """Mirror images have one norm; that of two waves has two extrema of one size."""
    within = {"mu": (mode**2 - 0.5, mode**2 + 0.5)}
    rest = cb.trace(chafee_infante(41).at(mu=within["mu"][0]), "mu", within=within, events=EVENTS)
    arms = cb.switch(rest.first("BP"), within=within, events=EVENTS)
    assert len(arms) == 2
    ax = plot(rest, *arms).axes
    assert ax.get_ylabel() == "$u$ (entry of largest size)"
    x, y = np.hstack([line.get_data() for line in curves(ax)])
    for arm in arms:
        for mu, top in zip(arm["mu"], np.abs(arm["u"]).max(axis=1), strict=True):
            for sign in (-1.0, 1.0):
                assert np.hypot(x - mu, y - sign * top).min() < 1e-5
    low, high = ax.dataLim.intervaly
    assert low == pytest.approx(-high, rel=1e-5)
    assert high > 0.3
    assert plot(rest, *arms, y="norm(u)").axes.get_ylabel() == "norm(u)"
    assert plot_diagram([rest, *arms], y="norm(u)").axes.get_ylabel() == "norm(u)"


def test_a_line_is_broken_where_the_largest_entry_changes_its_sign_in_a_jump() -> None:
    """From (1, -.9) to (1, -1.1): no line connects the two."""
    mine = cb.Problem(
        lambda x, p: np.array([x[0] - 1.0, x[1] + p["mu"]]), {"u": [1.0, -0.9]}, {"mu": 0.9}
    )
    branch = cb.trace(mine, "mu", within={"mu": (0.9, 1.1)}, events=[cb.fold()])
    (line,) = curves(plot(branch).axes)
    y = np.asarray(line.get_ydata())
    assert np.isnan(y).sum() == 1
    assert {*np.sign(y[np.isfinite(y)])} == {1.0, -1.0}
    pairs = np.abs(np.diff(y))
    assert np.nanmax(pairs) < 0.2
    through = cb.trace(
        cb.Problem(lambda x, p: x - p["mu"], {"u": [-1.0, -1.0]}, {"mu": -1.0}),
        "mu", within={"mu": (-1, 1)}, events=[cb.fold()],
    )  # fmt: skip
    (line,) = curves(plot(through).axes)
    assert np.isfinite(line.get_ydata()).all()


# --- stability ------------------------------------------------------------------------------------


@pytest.mark.slow
def test_where_stability_was_not_computed_a_line_is_grey_and_the_legend_says_so() -> None:
    from matplotlib.colors import to_rgb

    large = cb.trace(chafee_infante(251), "mu", within={"mu": (0.5, 0.6)}, events=EVENTS)
    small = cb.trace(chafee_infante(21), "mu", within={"mu": (0.5, 0.6)}, events=EVENTS)
    bare = cb.trace(chafee_infante(21), "mu", within={"mu": (0.5, 0.6)}, events=[cb.fold()])
    for unknown in (large, bare):
        ax = plot(unknown).axes
        (line,) = curves(ax)
        red, green, blue = to_rgb(line.get_color())
        assert red == green == blue
        assert line.get_linestyle() != "-"
        assert legend(ax) == ["stability not computed"]
    ax = plot(large, small).axes
    assert legend(ax) == ["stable", "stability not computed"]
    assert sorted(line.get_linestyle() for line in curves(ax)) == ["-", "-."]
    assert legend(plot(small).axes) == []


def test_a_count_that_means_nothing_all_along_is_not_computed() -> None:
    mine = cb.Problem(
        lambda x, p: x - p["mu"], {"x": 0.0}, {"mu": 0.0}, record={"unstable": lambda p: math.nan}
    )
    ax = plot(cb.trace(mine, "mu", within={"mu": (0, 1)}, events=())).axes
    assert legend(ax) == ["stability not computed"]


def test_a_line_too_short_to_be_seen_has_no_entry_in_the_legend() -> None:
    """Nothing is said of stability next to VI, 4e-7 of the branch away."""
    branch = cb.trace(cb.symmetric(0.5, 0.01, 0.4), "a", within={"a": (0.05, 1)})
    assert np.isnan(branch["unstable"][:2]).all()
    assert legend(plot(branch).axes) == ["stable", "unstable"]


def test_where_words_have_no_room_values_say_what_colours_stand_for() -> None:
    on = {0.04: {"k": 0.8, "lattice": cb.Ring(8)}, 0.08: {"k": 0.4}}
    branches = [
        cb.trace(cb.symmetric(0.5, gamma, **how), "a", within={"a": (0.05, 1)})
        for gamma, how in on.items()
    ]
    words = legend(plot(*branches).axes)
    assert words[:2] == [r"$\gamma$ = 0.04, $k$ = 0.8", r"$\gamma$ = 0.08, $k$ = 0.4"]


# --- long runs ------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def state() -> Any:
    return cb.symmetric(a=0.5, gamma=0.05, k=0.8).state(6)


LONG: dict[str, Any] = {"a": 0.5, "gamma": 0.05, "k": 0.8, "damping": 0.01}


def test_a_long_run_over_space_and_time_is_the_largest_displacement_in_a_period(state) -> None:
    run = cb.simulate(state, periods=60, sample=Sample(range(6), per_period=16), **LONG)
    ax = plot_space_time(run).axes
    (mesh,) = ax.collections
    rows = np.reshape(mesh.get_array(), (60, 6))
    np.testing.assert_allclose(rows[:, 0], 1.0, atol=1e-12)  # it hits its walls in each of them
    each = np.abs(run.record.u[: 60 * 16]).reshape(60, 16, 6).max(axis=1)
    np.testing.assert_allclose(rows[:, 1:], each[:, 1:], atol=0.02)
    assert ax.figure.axes[1].get_ylabel() == "largest $|u_n|$ in a period (16 samples)"
    assert mesh.get_clim()[0] == 0.0
    assert ax.get_ylim() == pytest.approx((0, 60), abs=1 / 16)


@pytest.mark.slow
def test_of_more_periods_than_a_picture_has_rows_several_are_one(state) -> None:
    sample = Sample(range(6), per_period=8)
    run = simulate_smooth(state, periods=310, m=6, sample=sample, **LONG)
    ax = plot_space_time(run).axes
    (mesh,) = ax.collections
    rows = np.reshape(mesh.get_array(), (-1, 6))
    assert 100 <= len(rows) <= 400
    periods = round(310 / len(rows))
    assert (
        ax.figure.axes[1].get_ylabel()
        == f"largest $|u_n|$ in {periods} periods ({8 * periods} samples)"
    )
    first = np.abs(run.record.u[: 8 * periods]).max(axis=0)
    np.testing.assert_allclose(rows[0], first, atol=1e-12)


@pytest.mark.parametrize(("periods", "smooth"), [(8, {}), (300, {}), (25, {"m": 6})])
def test_a_run_known_once_a_period_is_shown_by_its_last_periods_with_both_signs(
    state, periods: int, smooth: dict[str, Any]
) -> None:
    """Seen at one phase of its motion every site would have one sign."""
    run = (simulate_smooth if smooth else cb.simulate)(
        state, periods=periods, t0=1.5, **LONG, **smooth
    )
    ax = plot_space_time(run).axes
    shown = min(periods, 20)
    ends = (run.times[-1 - shown] / 2 / np.pi, run.times[-1] / 2 / np.pi)
    assert ax.get_ylim() == pytest.approx(ends, abs=1 / 32)
    u = np.reshape(ax.collections[0].get_array(), (-1, 6))
    assert u.min(axis=0).max() < -0.3 < 0.3 < u.max(axis=0).min()
    each = len(u) // shown
    np.testing.assert_allclose(u[::each], run.strobe.u[-1 - shown : -1], atol=1e-9)
    assert ax.get_title(loc="left") == (f"the last 20 of {periods} periods" if periods > 20 else "")
    assert ax.figure.axes[1].get_ylabel() == "$u_n$"
    some = plot_space_time(run, sites=(-1, 0)).axes.collections[0].get_array()
    np.testing.assert_array_equal(np.reshape(some, (-1, 2)), u[:, [0, 5]])


@pytest.mark.slow
def test_a_run_under_noise_is_known_once_a_period_and_says_so(state) -> None:
    """Nobody can simulate it again from its states."""
    for t0, phase in ((0.0, "0"), (4 * math.pi + 1.5, "1.5")):
        run = cb.simulate(state, periods=30, t0=t0, noise=1e-3, **LONG)
        ax = plot_space_time(run).axes
        words = ax.figure.axes[1].get_ylabel()
        assert words == rf"$u_n$ once a period, at $t = {phase}$ mod $2\pi$"
        np.testing.assert_array_equal(
            np.reshape(ax.collections[0].get_array(), run.strobe.u.shape), run.strobe.u
        )


def test_a_long_motion_is_drawn_between_its_extremes_and_says_of_how_many_samples(state) -> None:
    run = cb.simulate(state, periods=40, sample=Sample((0, 1), per_period=64), **LONG)
    ax = plot_motion(run).axes
    assert ax.get_ylabel() == "$u_n$, range in a period (64 samples)"
    hit, beside = (band.get_paths()[0].vertices[:, 1] for band in ax.collections)
    assert (hit.min(), hit.max()) == pytest.approx((-1.0, 1.0), abs=1e-12)  # at the walls
    u = run.record.u[:, 1]
    assert (beside.min(), beside.max()) == pytest.approx((u.min(), u.max()), abs=1e-12)
    few = cb.simulate(state, periods=40, sample=Sample((0, 1), per_period=2), **LONG)
    assert plot_motion(few).axes.get_ylabel() == "$u_n$, range in a period (2 samples)"
    many = plot_motion(cb.simulate(state, periods=601, sample=Sample((0, 1), per_period=2), **LONG))
    assert many.axes.get_ylabel() == "$u_n$, range in 3 periods (6 samples)"
    assert len(many.axes.collections[0].get_paths()[0].vertices) < 1000
    short = cb.simulate(state, periods=4, sample=Sample((0, 1)), **LONG)
    assert plot_motion(short).axes.get_ylabel() == "$u_n$"


@pytest.mark.parametrize("ends", [(-0.7395, -0.5595), (0.0001, 0.0009), (1000.2, 1009.0)])
def test_numbers_of_an_abscissa_keep_apart(ends: tuple[float, float]) -> None:
    with style():
        figure, (ax,) = new_figure()
        ax.plot(ends, ends)
        figure.canvas.draw()
        boxes = [label.get_window_extent() for label in ax.get_xticklabels()]
    assert all(left.x1 < right.x0 for left, right in pairwise(boxes))
    assert len(boxes) >= 5
