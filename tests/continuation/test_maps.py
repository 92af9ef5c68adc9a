"""Fixed points and cycles of maps whose bifurcations are known in closed form."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest

from contbreather.continuation import Branch, Steps, boundary, trace
from contbreather.continuation.bifurcations.equilibria import hopf
from contbreather.continuation.bifurcations.maps import FixedPoint
from contbreather.continuation.branches.switching import switch
from contbreather.errors import BadInput

from .lines import PLANE, XY, Params, at, kinds, of_map
from .zoo import Array, logistic


def plain(u: Array) -> Array:
    """Without an imaginary part, so that derivatives are differences."""
    return np.array([float(value.real) for value in u])


AREA_PRESERVING = {
    "henon": (lambda u, p: np.array([u[1], p["m"] - u[0] - u[1] ** 2]), 0.2, 0.2, (-0.9, 2.9)),
    "differences": (
        lambda u, p: np.array([plain(u)[1], p["m"] - plain(u)[0] - plain(u)[1] ** 2]),
        0.2,
        0.2,
        (-0.9, 2.9),
    ),
    "standard": (
        lambda u, p: np.array([u[0] + u[1] + p["m"] * np.sin(u[0]), u[1] + p["m"] * np.sin(u[0])]),
        math.pi,
        0.0,
        (0.1, 3.9),
    ),
}


@pytest.mark.parametrize("name", AREA_PRESERVING)
def test_all_multipliers_of_area_preserving_maps_have_product_one_which_is_no_event(name: str):
    map_, x, y, window = AREA_PRESERVING[name]
    branch = trace(FixedPoint(map_, {"x": x, "y": y}, {"m": 0.4}), "m", within={"m": window})
    assert (kinds(branch), branch.doubtful) == ([], ())
    assert not branch["unstable"].any()  # all of them are elliptic


# --- the logistic cascade ---------------------------------------------------------------------


@cache
def cascade(doublings: int) -> tuple[Branch, ...]:
    window = {"r": (2.0, 4.0)}
    branches = [trace(logistic(), "r", within=window)]
    for _ in range(doublings):
        (arm,) = switch(branches[-1].first("PD"), within=window)
        branches.append(arm)
    return tuple(branches)


@pytest.mark.slow
def test_logistic_cascade_to_period_sixteen_and_beyond() -> None:
    places = []
    for i, branch in enumerate(cascade(4)):
        point = branch.first("PD")
        assert len(np.unique(np.round(branch[-1].solution.points, 9))) == 2**i
        assert point.detail["criticality"] == "supercritical"
        places.append(point["r"])
    assert places[:2] == pytest.approx([3.0, 1 + math.sqrt(6)], abs=1e-12)
    gaps = np.diff(places)
    assert gaps[-2] / gaps[-1] == pytest.approx(4.669201609, abs=2e-3)  # Feigenbaum


def test_the_doubled_cycle_leaves_as_the_closed_form_says() -> None:
    branch = cascade(1)[1]
    x, r = branch["x"][1:], branch["r"][1:]
    closed = (r + 1 + np.sqrt((r - 3) * (r + 1))) / (2 * r)
    other = (r + 1 - np.sqrt((r - 3) * (r + 1))) / (2 * r)
    assert np.minimum(abs(x - closed), abs(x - other)).max() < 1e-12
    assert np.array_equal(branch[0].z, cascade(0)[0].first("PD").z)


def test_stability_passes_from_cycle_to_cycle() -> None:
    for branch in cascade(3):
        beyond = branch["r"] > branch.first("PD")["r"] + 1e-9
        assert branch["unstable"][beyond].min() == 1
        inside = (~beyond) & (branch["r"] > branch[0]["r"] + 1e-6)
        if branch is not cascade(3)[0]:
            assert (
                branch["unstable"][inside & (branch["r"] < branch.first("PD")["r"] - 1e-9)].max()
                == 0
            )


def logistic_slope(x: Array, p: Params) -> Array:
    return np.array([[p["r"] * (1 - 2 * x[0])]])


@pytest.mark.parametrize("given", [{}, {"jacobian": logistic_slope}])
def test_cycle_of_period_three_is_born_at_its_fold(given) -> None:
    branch = trace(logistic(0.16, 3.84, period=3, **given), "r", within={"r": (3.5, 3.9)})
    at(branch.first("LP"), r=1 + math.sqrt(8))
    cycle = branch[5].solution
    assert cycle.period == 3
    x, r = cycle.points[2], branch[5]["r"]
    assert np.allclose(r * x * (1 - x), cycle.points[0], atol=1e-12)


def test_a_cycle_written_with_too_long_a_period_is_known_as_the_shorter_one() -> None:
    long = logistic(period=6)
    point = trace(long, "r", within={"r": (2.2, 2.9)})[3]
    small = long.simpler(point)
    assert small.label == "fixed point"
    assert small.at(r=2.5, x=0.6).solve()[1].residual < 1e-14
    two = trace(logistic(0.799, 3.2, period=4), "r", within={"r": (3.1, 3.4)})
    assert two.problem.simpler(two[3]).label == "cycle of period 2"
    exact = logistic(0.799, 3.2, period=2)
    assert exact.simpler(trace(exact, "r", within={"r": (3.1, 3.4)})[3]) is None


# --- other maps -------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(("n", "r"), [(1, 0.8), (2, 0.5)])
def test_bouncing_ball_doubles_its_period_where_the_formula_says(n: int, r: float) -> None:
    ball = of_map(
        lambda u, p: [u[0] + u[1] - 2 * np.pi * n, p["r"] * u[1] - p["g"] * np.cos(u[0] + u[1])],
        {"phi": -math.pi / 2 - 0.6, "v": 2 * math.pi * n},
        r=r,
        g=2 * math.pi * n * (1 - r) / math.cos(math.pi / 2 - 0.6),
    )
    branch = trace(ball, "g", within={"g": (0.1, 12.0), "phi": (-4.0, 0.0)})
    g = 2 * math.sqrt((n * math.pi) ** 2 * (1 - r) ** 2 + (1 + r) ** 2)
    assert kinds(branch) == ["LP", "PD"]
    at(branch.first("PD"), g=g)
    at(branch.first("LP"), g=2 * math.pi * n * (1 - r))
    (arm,) = switch(branch.first("PD"), within={"g": (0.1, 12.0)})
    assert np.prod(branch[3].solution.multipliers) == pytest.approx(r, abs=1e-12)
    points = arm[5].solution.points
    assert abs(points[0] - points[1]).max() > 1e-3
    assert np.allclose(ball.residual.map(points[1], arm[5].params), points[0], atol=1e-10)


# --- what is told apart, and what is refused --------------------------------------------------


def test_multipliers_with_product_one_that_are_real_are_no_neimark_sacker_point() -> None:
    mine = of_map(lambda u, p: [2 * u[0] + u[1] ** 2, p["m"] * u[1] + u[0] ** 2], XY, m=0.3)
    branch = trace(mine, "m", within={"m": (0.2, 0.8)})
    assert branch[0].solution.multipliers.prod() < 1 < branch[-1].solution.multipliers.prod()
    assert (kinds(branch), branch.doubtful) == ([], ())


def test_a_map_of_one_unknown_may_return_a_number() -> None:
    number = FixedPoint(lambda u, p: p["r"] * u[0] * (1 - u[0]), {"x": 0.6}, {"r": 2.5})
    branch = trace(number, "r", within={"r": (2.5, 3.6)})
    assert branch.first("PD")["r"] == pytest.approx(3.0, abs=1e-12)


def test_a_fixed_point_has_no_hopf_point() -> None:
    """Where a pair of multipliers is 1 +- i/2 nothing happens: HB had a label there."""

    def turn(u: Array, p: Params) -> Array:
        return (1 + p["a"]) * u + np.array([-u[1], u[0]]) / 2

    fixed = FixedPoint(turn, {"x": 0.0, "y": 0.0}, {"a": -0.3})
    with pytest.raises(BadInput, match=r"no HB of this problem .*unit circle is NS"):
        trace(fixed, "a", within={"a": (-1, 0.5)}, events=[*fixed.events, hopf()])


def test_an_analytic_jacobian_that_is_wrong_is_refused() -> None:
    wrong = logistic(0.16, 3.84, period=3, jacobian=lambda x, p: logistic_slope(x, p) + 0.1)
    with pytest.raises(BadInput, match="Jacobian that was given does not fit"):
        trace(wrong, "r")


@pytest.mark.slow
def test_scales_of_a_map_are_heeded() -> None:
    """Henon with x in thousandths and y in thousands."""
    mine = FixedPoint(
        lambda u, p: np.array(
            [1e-6 * u[1], 1e3 * (p["alpha"] - p["beta"] * 1e3 * u[0] - (1e-3 * u[1]) ** 2)]
        ),
        {"x": 0.6e-3, "y": 0.6e3},
        {"alpha": 1.0, "beta": 0.5},
        scales={"x": 1e-3, "y": 1e3},
    )
    branch = trace(mine, "alpha", within={"alpha": (-3, 4), "y": (-3e3, 3e3)}, steps=Steps())
    assert sorted(kinds(branch)) == ["LP", "PD"]
    assert branch.first("PD")["alpha"] == pytest.approx(27 / 16, abs=1e-9)
    assert branch.first("PD").detail["c"] == pytest.approx(2 / 3, rel=1e-6)
    curve = boundary(branch.first("PD"), ("beta", "alpha"), within=PLANE)
    assert kinds(curve) == ["LPPD", "R2"]


def test_what_is_nearer_to_zero_is_no_second_multiplier_minus_one_beside_a_large_one() -> None:
    def saddle(x, p):
        return np.array([-p["mu"] * x[0] + x[0] ** 3, 1e8 * x[1], 0.5 * x[2]])

    rest = FixedPoint(saddle, {"x": 0.0, "y": 0.0, "z": 0.0}, {"mu": 0.5})
    branch = trace(rest, "mu", within={"mu": (0.5, 1.5)})
    assert [point.kind for point in branch.special] == ["EP", "PD", "EP"]
    assert not branch.doubtful


def test_a_curve_of_doublings_has_no_vanishing_coefficient_where_a_symmetry_doubles_it() -> None:
    """Kopel's duopoly: of x = y the coefficient is (rho mu)^2/2, here 8 where both are 2, and two
    curves of PD cross: 1 - rho -+ rho (mu - 2) is -1."""

    def duopoly(u, p):
        u = np.array(u)
        return (1 - p["rho"]) * u + p["rho"] * p["mu"] * (u * (1 - u))[::-1]

    start, params = {"x": 0.5, "y": 0.5}, {"rho": 0.5, "mu": 2.0}
    branch = trace(FixedPoint(duopoly, start, params), "mu", within={"mu": (0.5, 6)})
    assert branch.first("PD")["c"] == pytest.approx(0.5 * 2.5**2, rel=1e-9)
    curve = boundary(branch.first("PD"), ("mu", "rho"), within={"mu": (0.5, 8), "rho": (0.05, 3)})
    assert curve["rho"] == pytest.approx(2 / (curve["mu"] - 1), rel=1e-9)
    assert kinds(curve) == ["PD-BP"]


def test_a_tongue_of_a_map_is_walked_round_once() -> None:
    """Of z -> exp(2 pi i/3 + i m) z (1.3 - |z|^2) + 0.1 conj(z)^2, with three phases of a cycle."""

    def resonant(x, p):
        turn, size = 2 * np.pi / 3 + p["m"], 1.3 - x[0] ** 2 - x[1] ** 2
        c, s = size * np.cos(turn), size * np.sin(turn)
        u, v = x
        return [c * u - s * v + 0.1 * (u * u - v * v), s * u + c * v - 0.2 * u * v]

    x = np.array([0.5, 0.1])
    for _ in range(2000):
        x = np.array(resonant(x, {"m": 0.0}))
    cycle = FixedPoint(resonant, {"u": x[0], "v": x[1]}, {"m": 0.0}, period=3)
    branch = trace(cycle, "m", within={"m": (-1, 1)})
    again = trace(branch.first("LP"), "m", within={"m": (-1, 1)})
    for once in (branch, again):
        assert once.stop.name == "CLOSED"
        assert [point.kind for point in once.special] == ["LP", "LP"]
    assert branch["m"].min() == pytest.approx(-branch["m"].max(), abs=1e-9)


@pytest.mark.slow
def test_a_curve_of_folds_goes_on_beyond_a_ring_of_fixed_points() -> None:
    """Of Ikeda's map, on |z|^2 = 14 where no light comes in or is lost: a double multiplier 1, and
    CP, whose normal form is none there, within one step."""

    def ikeda(z, p):
        turn = 0.4 - 6 / (1 + z[0] ** 2 + z[1] ** 2)
        c, s = p["C"] * np.cos(turn), p["C"] * np.sin(turn)
        return [p["R"] + z[0] * c - z[1] * s, z[0] * s + z[1] * c]

    window = {"R": (-0.5, 3), "C": (0.1, 1.2)}
    fixed = FixedPoint(ikeda, {"x": 0.1, "y": 0.0}, {"R": 0.1, "C": 0.9})
    folds = boundary(trace(fixed, "R", within=window).first("LP"), ("C", "R"), within=window)
    ring = folds.first("R1")
    assert [point.kind for point in folds.special] == ["EP", "R1", "CP", "R1", "EP"]
    assert [ring["R"], ring["C"], ring["x"]] == pytest.approx([0, 1, math.sqrt(14)], abs=1e-9)


@pytest.mark.slow
def test_a_cycle_of_lozi_s_map_ends_where_it_comes_to_the_kink() -> None:
    """Its two points are at a = 1 - b on the line x = 0, up to which slopes are those of its own
    side."""

    def lozi(u, p):
        return np.array([1 - p["a"] * abs(u[0]) + u[1], p["b"] * u[0]])

    two = FixedPoint(lozi, {"x": 0.9, "y": -0.1}, {"a": 1.3, "b": 0.2}, period=2)
    branch = trace(two, "a", within={"a": (0.3, 1.9)}, towards="down")
    assert [point.label for point in branch.special] == ["EP1", "PD1", "MX1"]
    assert [point["a"] for point in branch.special] == pytest.approx([1.3, 1.2, 0.8], abs=1e-7)


def test_a_coefficient_that_is_called_as_a_parameter_says_in_the_table_whose_it_is() -> None:
    """The table of PD of c x (1 - x) had two rows `c`."""
    growth = FixedPoint(lambda x, p: p["c"] * x * (1 - x), {"x": 0.6}, {"c": 2.5})
    point = trace(growth, "c", within={"c": (2.5, 3.2)}).first("PD")
    rows = dict(point.table().rows)
    assert (rows["c"], rows["c of PD"]) == (point["c"], point["c of PD"])


def test_a_fixed_point_on_the_circle_says_so() -> None:
    """Of x -> m x (1 - y), y -> x both multipliers have modulus 1 at m = 2: "0 unstable" was said
    where the table of the branch knows no count."""
    delayed = FixedPoint(
        lambda u, p: np.array([p["m"] * u[0] * (1 - u[1]), u[0]]), {"x": 0.4, "y": 0.4}, {"m": 1.7}
    )
    branch = trace(delayed, "m", within={"m": (1.1, 2.3)})
    said = [repr(point.solution) for point in branch.special]
    assert said[0] == "<fixed point of a map, 0 unstable>"
    assert said[1] == "<fixed point of a map, 0 unstable, 2 on the unit circle>"
    assert said[2] == "<fixed point of a map, 2 unstable>"
