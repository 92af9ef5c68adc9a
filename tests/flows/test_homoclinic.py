"""Cycles that come to rest at an equilibrium, and meshes that are made finer on the way there."""

from __future__ import annotations

import cmath
import math
import re
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import contbreather as cb
from contbreather.continuation.curve.point import NOTHING
from contbreather.flows import Collocation
from contbreather.flows.homoclinic import HOMOCLINIC

from .zoo import BAND, CASES, born, lorenz, roessler

# The rimless wheel of the zoo: its speed after a step just does to get over the top.
STALLS = brentq(
    lambda g: 2 * math.sin(0.3) * math.sin(g) / math.tan(0.6) ** 2 - 1 + math.cos(0.3 - g),
    0.01,
    0.2,
)
LONG = cb.Steps(largest=1e5)  # where the period grows by thousands


def leaf(t, x, p):
    """The curve u^2 (1 - u) = v^2 is an orbit homoclinic to the origin where mu = 0, whatever a and
    b are; eigenvalues a +- b (B. Sandstede; Yu. A. Kuznetsov, example 6.1, at a = -1, b = 2)."""
    u, v = x[0], x[1]
    a, b, mu = p["a"], p["b"], p["mu"]
    return [
        a * u + b * v - a * u**2 + mu * u * (2 - 3 * u),
        b * u + a * v - 1.5 * b * u**2 - 1.5 * a * u * v - 2 * mu * v,
    ]


@pytest.fixture(scope="module")
def planar() -> cb.Branch:
    params = {"a": -1.0, "b": 2.0, "mu": 0.1}
    return born(cb.equilibrium(leaf, {"u": 0.654, "v": 0.112}, params), "mu", (-1.0, 1.0))


UNIT = 1e-13


@pytest.fixture(scope="module")
def butterfly() -> cb.Branch:
    """Cycles of the Lorenz equations, in units in which they are small, on a mesh that is too
    coarse for the long ones."""

    def small(t, x, p):
        return UNIT * np.array(lorenz(t, x / UNIT, p))

    params, few = {"r": 28.0, "s": 10.0, "b": 8 / 3}, Collocation(intervals=8, points=4)
    start = {"x": 8.0 * UNIT, "y": 8.0 * UNIT, "z": 27.0 * UNIT}
    return born(cb.equilibrium(small, start, params, collocation=few), "r", (1.0, 30.0))


def test_a_period_that_grows_without_bound_ends_a_branch_at_its_homoclinic_orbit(planar) -> None:
    end = planar.first("HOM")
    assert planar[-1] is end
    assert end["mu"] == pytest.approx(0, abs=1e-7)
    assert end["equilibrium"] == pytest.approx([0, 0], abs=1e-12)
    assert end["saddle_quantity"] == pytest.approx(-2, abs=1e-10)
    for words in ("without bound", "saddle u = 0, v = 0", "-3 and 1", "saddle quantity -2"):
        assert words in planar.reason


def test_a_homoclinic_orbit_is_followed_in_two_parameters(planar) -> None:
    """At mu = 0 for all a, but for the exponential of minus a + b times the period, which stays."""
    end, window = planar.first("HOM"), {"a": (-1.1, -0.5)}
    line = cb.boundary(end, ("a", "mu"), within=window)
    assert [at.kind for at in line.special] == ["EP", "EP"]
    assert line["period"] == pytest.approx(end["period"], rel=1e-12)
    assert line["mu"] == pytest.approx(0, abs=2e-8)


@pytest.mark.slow
def test_a_homoclinic_curve_ends_before_its_period_is_short_near_a_bogdanov_takens_point() -> None:
    """The curve b1 = -6/25 b2^2 + O(b2^(5/2)) of its normal form; times grow as |b2|^(-1/2)."""

    def takens(t, x, p):
        return [x[1], p["b1"] + p["b2"] * x[0] + x[0] ** 2 - x[0] * x[1]]

    start, params = {"x": -0.6, "y": 0.0}, {"b1": -0.1, "b2": -0.5}
    end = born(cb.equilibrium(takens, start, params), "b1", (-1.0, 0.1)).first("HOM")
    line = cb.boundary(end, ("b2", "b1"), within={"b2": (-0.6, -0.001)})
    assert [at.kind for at in line.special] == ["EP", "HOM"]
    assert line[-1]["b1"] / line[-1]["b2"] ** 2 == pytest.approx(-6 / 25, abs=1e-2)
    assert "this period is too short here, trace a longer one" in line.reason


def well(s: float):
    """Cycles of x'' + s (x^3 - x) = (mu - H) x' are the curves H = mu of its energy H, up to where
    these meet saddles: the origin at mu = 0 for s = 1, x = +-1 at 1/4 for s = -1."""

    def f(t, x, p):
        H = x[1] ** 2 / 2 + s * (x[0] ** 4 / 4 - x[0] ** 2 / 2)
        return [x[1], s * (x[0] - x[0] ** 3) + x[1] * (p["mu"] - H)]

    return f


def pausing(t, x, p):
    """The angle turns by a - cos, once in 2 pi / sqrt(a^2 - 1)."""
    growth, turn = 0.02 * (1 - x[0] ** 2 - x[1] ** 2), p["a"] - x[0]
    return [growth * x[0] - turn * x[1], growth * x[1] + turn * x[0]]


def may_leonard(t, x, p):
    """Without eps the corners attract in turn, for a + b > 2."""
    return [x[i] * (1 - x[i] - 0.7 * x[i - 2] - 1.6 * x[i - 1]) + p["eps"] for i in range(3)]


HALF = cb.Flow(well(-1.0), reset=lambda t, x, p: [-x[0], -x[1]])
NEURON = cb.Flow(
    lambda t, x, p: [p["I"] - x[0]], until=lambda t, x, p: 1 - x[0], reset=lambda t, x, p: [0.0]
)
# It is set back to 2, a source at I = -4.
QUADRATIC = cb.Flow(
    lambda t, x, p: [x[0] ** 2 + p["I"]], until=lambda t, x, p: 10 - x[0], reset=lambda t, x, p: [2]
)
# Two lags behind a relay, whose output comes to -1 and 1 at most.
RELAY = [
    cb.Flow(lambda t, x, p: [-1 - x[0], x[0] - x[1]], until=lambda t, x, p: x[1] + p["h"]),
    cb.Flow(lambda t, x, p: [1 - x[0], x[0] - x[1]], until=lambda t, x, p: p["h"] - x[1]),
]
# Its spike is 1e8 times as fast as anything near the saddle, T = ln((1 - e^-20) / (1 - e^-mu)).
SPIKE = cb.Flow(
    lambda t, x, p: [np.exp(x[0]) - 1, -0.5 * x[1]],
    until=lambda t, x, p: 20 - x[0],
    reset=lambda t, x, p: [p["mu"], 1.0],
)
# Izhikevich's: it comes to the saddle along a direction so slow that it is still a millivolt off
# when the current has come to its limit, to 3e-13 by bisection with scipy's DOP853.
REGULAR, INTRINSIC = (
    cb.Flow(
        lambda t, x, p: [
            0.04 * x[0] ** 2 + 5 * x[0] + 140 - x[1] + p["I"],
            0.02 * (0.2 * x[0] - x[1]),
        ],
        until=lambda t, x, p: 30 - x[0],
        reset=lambda t, x, p, c=c, d=d: [c, x[1] + d],
    )
    for c, d in ((-65.0, 8), (-55.0, 4))
)
# Up on a spiral around (0, 1) from where that is tangent to y = 0, at x = a, back along it: sliding
# is at rest where (1 + a x) + (x - a) / p = 0.
LANDS = cb.Filippov(
    lambda t, x, p: [p["a"] * x[0] - x[1] + 1, x[0] + p["a"] * (x[1] - 1)],
    lambda t, x, p: [-1.25, 1.0],
    lambda t, x, p: x[1],
)


def landed(a: float) -> float:
    """By how far beyond that place a turn of the spiral ends."""

    def spiral(t: float) -> complex:
        return (a - 1j) * cmath.exp((a + 1j) * t)

    end = brentq(lambda t: spiral(t).imag + 1, 4.0, 6.2)
    return float(spiral(end).real - (1.25 * a - 1) / (a + 1.25))


EDGES = "heteroclinic cycle between the saddles x = {}, v = 0 .leading eigenvalues -1.41421 and 1.4"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("flows", "start", "params", "how", "end", "words"),
    [
        (well(1.0), {"x": 1.7, "v": 0.0}, {"mu": 0.3}, {}, 0.0,
         "homoclinic to the saddle x = 0, v = 0, which it passes 2 times; .* quantity"),
        (well(-1.0), {"x": 0.5, "v": 0.2}, {"mu": 0.1}, {}, 0.25, EDGES.format("(-1|1)")),
        (HALF, {"x": 0.5, "v": 0.2}, {"mu": 0.1}, {}, 0.25, EDGES.format("(-1|1)")),
        (may_leonard, {"x": 0.9, "y": 0.05, "z": 0.1}, {"eps": 1e-3}, {"steps": LONG}, 0.0,
         "a heteroclinic cycle between the saddles .* and .* and "),
        (CASES["pendulum clock"], {}, {"J": 0.5}, {}, 1.0, "cycle .* x = 3.14159, v = 0"),
        (CASES["rimless wheel"], {}, {"g": 0.15}, {}, STALLS, "homoclinic to the saddle a = 0, w"),
        (LANDS, {"x": -0.1, "y": 0.0}, {"a": 0.02}, {}, brentq(landed, 0.02, 0.1),
         r"to the pseudo-saddle x = -0.73848\d, y = 0; leading eigenvalues -inf and 0.725"),
        (SPIKE, {"x": 0.5, "y": 1.0}, {"mu": 0.5}, {}, 0.0, "homoclinic to the saddle x = 0, y"),
        (REGULAR, {"v": -65.0, "u": -5.0}, {"I": 6.0}, {}, 3.774375,
         "homoclinic to the saddle v = -57.625, u = -11.525; leading eigenvalues -0.01 and 0.38"),
        (INTRINSIC, {"v": -65.0, "u": -13.0}, {"I": 4.5}, {}, 3.774375,
         "homoclinic to the saddle v = -57.625, u = -11.525; leading eigenvalues -0.01 and 0.38"),
        (NEURON, {"v": 0.0}, {"I": 1.5}, {}, 1.0, "a flow ends at the equilibrium v = 1"),
        (QUADRATIC, {"v": 3.0}, {"I": 1.0}, {}, -4.0, "a flow begins at the equilibrium v = 2"),
        (RELAY, {"x": 1.0, "y": 1.0}, {"h": 0.1}, {}, 1.0, "ends at the equilibrium x = (-1|1), y"),
    ],
    ids=["figure of eight", "heteroclinic", "half of it", "May-Leonard", "pendulum clock",
         "rimless wheel", "sliding", "spike", "regular", "intrinsic", "neuron",
         "reset to a source", "relay"],
)  # fmt: skip
def test_the_end_says_at_what_a_cycle_comes_to_rest(flows, start, params, how, end, words) -> None:
    problem = flows.problem() if start == {} else cb.cycle(flows, start, params, settle=60)
    ((free, value),) = params.items()
    branch = cb.trace(problem, free, towards="up" if end > value else "down", **how)
    assert [at.kind for at in branch.special if at.kind != "LP"] == ["EP", "HOM"]
    assert branch[-1][free] == pytest.approx(end, abs=2e-5)
    assert re.search(words, branch.reason)
    assert not branch.doubtful
    if "ends at the equilibrium" in words:
        assert not branch["unstable"].any()  # at a sink, up to the end


def test_lorenz_s_homoclinic_orbit_is_where_it_is_known_to_be(butterfly) -> None:
    end = butterfly.first("HOM")
    assert end["r"] == pytest.approx(13.926557, abs=2e-5)
    assert not end["equilibrium"].any()
    # the eigenvalues of the origin
    outwards = (-11 + math.sqrt(121 + 40 * (end["r"] - 1))) / 2
    assert end["saddle_quantity"] == pytest.approx(outwards - 8 / 3, abs=1e-9)


def test_a_mesh_that_is_too_coarse_is_made_finer_and_no_false_event_is_seen(butterfly) -> None:
    assert [at.kind for at in butterfly.special] == ["EP", "HOM"]
    assert not butterfly.doubtful
    assert butterfly["trivial"].max() < 1e-4
    assert butterfly["mesh"].shape[1] > 8
    assert set(butterfly["unstable"][1:]) == {1}


@pytest.mark.slow
def test_no_fold_is_seen_where_the_period_grows_without_one() -> None:
    """To a saddle-focus of negative saddle quantity it grows monotonously (Shilnikov). Beyond 37
    the parameter is as close to its limit as this mesh is exact: there it would fold."""

    def feedback(t, x, p):
        return [x[1], x[2], -x[2] - p["beta"] * x[1] - x[0] + x[0] ** 2]

    start = {"x": 0.9, "y": 0.0, "z": 0.0}
    mesh = Collocation(intervals=30, points=4)
    ring = cb.cycle(feedback, start, {"beta": 0.53}, settle=150, collocation=mesh)
    branch = cb.trace(ring, "beta", within={"beta": (0.5, 0.54)}, towards="down")
    end = branch.first("HOM")
    assert [at.kind for at in branch.special] == ["EP", "HOM"]
    assert not branch.doubtful
    assert (np.diff(branch["period"]) > 0).all()
    # the equilibrium x = 1: y^3 + y^2 + beta y - 1 = 0
    roots = np.roots([1, 1, end["beta"], -1])
    assert end["saddle_quantity"] == pytest.approx(roots[roots.imag >= 0].real.sum(), abs=1e-9)
    assert "saddle-focus x = 1, y = 0, z = 0" in branch.reason


@pytest.mark.slow
def test_a_branch_that_swings_around_a_homoclinic_orbit_goes_on_through_its_folds() -> None:
    """From one to the next they are closer by exp(-pi a/w), of a pair -a +- i w. The orbit itself
    is where the unstable manifold of x = 1, by an integration of its own, comes back on neither
    side of the stable one; the first of these folds is 1e-4 off that, and its end 1e-6."""

    def feedback(t, x, p):
        return [x[1], x[2], -0.3 * x[2] - p["beta"] * x[1] - x[0] + x[0] ** 2]

    rest = cb.equilibrium(feedback, {"x": 0.0, "y": 0.0, "z": 0.0}, {"beta": 3.5})
    hopf = cb.trace(rest, "beta", within={"beta": (3, 4)}).first("HB")
    (branch,) = cb.switch(hopf, within={"beta": (0.1, 4)})
    end = branch.first("HOM")
    assert end["beta"] == pytest.approx(0.74572653, abs=1e-6)
    folds = [at["beta"] for at in branch.special if at.kind == "LP"]
    roots = np.roots([1, 0.3, end["beta"], -1])
    ratio = -math.exp(-math.pi * abs(roots[0].real / roots[0].imag))
    steps = np.diff(folds[2:7])
    assert steps[1:] / steps[:-1] == pytest.approx(ratio, rel=0.1)


def test_a_finer_mesh_begins_where_the_coarse_one_did(butterfly) -> None:
    assert butterfly[0].parent["r"] == pytest.approx(24.736842, abs=1e-6)
    assert butterfly[0]["r"] == pytest.approx(24.736842, abs=1e-2)


@pytest.mark.slow
def test_an_arm_gets_a_finer_mesh_where_the_doubling_is_on_that() -> None:
    """Roessler's band: the doubling of the doubled cycle is at 3.8373581."""
    few, params = Collocation(intervals=14, points=3), {**BAND, "c": 2.8}
    ring = cb.cycle(roessler, {"x": 2.0, "y": 0.0, "z": 0.1}, params, settle=200, collocation=few)
    single = cb.trace(ring, "c", within={"c": (2.8, 2.9)}, towards="up")
    (double,) = cb.switch(single.first("PD"), within={"c": (2.8, 6.5)})
    assert double["mesh"].shape[1] > 2 * single["mesh"].shape[1]
    assert double["trivial"].max() < 1e-4
    assert double[0]["period"] == pytest.approx(2 * single.first("PD")["period"], rel=1e-5)
    assert double.first("PD")["c"] == pytest.approx(3.8373581, abs=2e-5)


@pytest.mark.slow
def test_the_period_where_an_equilibrium_appears_on_a_cycle_is_the_closed_form() -> None:
    fine = Collocation(intervals=80)
    ring = cb.cycle(pausing, {"x": -1.0, "y": 0.0}, {"a": 1.005}, collocation=fine)
    branch = cb.trace(ring, "a", within={"a": (0.5, 1.5)}, towards="down", steps=LONG)
    assert [at.kind for at in branch.special] == ["EP", "HOM"]
    assert "an equilibrium is about to appear on it, at x = 1, y = " in branch.reason
    assert not branch.doubtful
    end = branch.first("HOM")
    assert 0 < end["a"] - 1 < 1e-5
    assert end["period"] == pytest.approx(2 * math.pi / math.sqrt(end["a"] ** 2 - 1), rel=1e-6)


@pytest.mark.slow
def test_slow_motion_without_an_equilibrium_is_no_end() -> None:
    """Around a circle, in the end on one side of it 200,000 times slower than on the other."""

    def dragging(t, x, p):
        growth = 1 - x[0] ** 2 - x[1] ** 2
        pace = np.exp(-p["k"] * (1 + x[0]) / 2)
        return [pace * (growth * x[0] - x[1]), pace * (growth * x[1] + x[0])]

    fine = Collocation(intervals=40)
    ring = cb.cycle(dragging, {"x": -1.0, "y": 0.0}, {"k": 5.0}, collocation=fine)
    branch = cb.trace(ring, "k", within={"k": (5.0, 12.5)}, towards="up", steps=LONG)
    assert [at.kind for at in branch.special] == ["EP", "EP"]
    assert branch[-1]["k"] == 12.5
    assert not branch.doubtful


@pytest.mark.slow
def test_a_period_that_falls_to_zero_comes_to_no_equilibrium() -> None:
    """A neuron that each spike excites further: at d = -0.1 this outweighs the leak, and it fires
    ever faster, far from where it is at rest."""
    neuron = cb.Flow(
        lambda t, x, p: [2 - x[0] - x[1], -x[1] / 10],
        until=lambda t, x, p: 1 - x[0],
        reset=lambda t, x, p: [0 * x[0], x[1] + p["d"]],
    )
    fires = cb.cycle(neuron, {"V": 0.0, "a": -10.0}, {"d": -0.09}, settle=20)
    branch = cb.trace(fires, "d", within={"d": (-0.2, 0.0)}, towards="down", steps=LONG)
    assert [at.kind for at in branch.special] == ["EP", "EP"]
    assert branch[-1]["d"] == pytest.approx(-0.1, rel=1e-6)
    assert not branch.doubtful


@pytest.mark.slow
def test_folds_end_at_a_homoclinic_orbit_in_two_parameters() -> None:
    """Where the saddle at the origin is all but neutral: there both ways around meet its loop."""

    def damped(t, x, p):
        return [x[1], x[0] - x[0] ** 2 + 0.3 * (p["a"] + p["b"] * x[0] + x[0] ** 3) * x[1]]

    start, mesh = {"x": 1.0, "y": 0.0}, Collocation(10, 5)
    rest = cb.equilibrium(damped, start, {"a": 0.0, "b": -0.9}, collocation=mesh)
    (cycles,) = cb.switch(cb.trace(rest, "a", towards="down", within={"a": (-1, 1)}).first("HB"))
    folds = cb.boundary(cycles.first("LP"), ("a", "b"), within={"a": (-1, 1)}, towards="up")
    assert folds[-1].kind == "LP-HOM"

    p = {name: folds[-1][name] for name in ("a", "b")}

    def reach(way):  # of the way out, and backwards in time of the way in
        slope = 0.15 * p["a"] + way * math.sqrt(1 + (0.15 * p["a"]) ** 2)
        ahead, start = lambda t, x: way * np.array(damped(t, x, p)), [1e-8, 1e-8 * slope]
        run = solve_ivp(ahead, (0, 30), start, events=lambda t, x: x[1], rtol=1e-10, atol=1e-14)
        return run.y_events[0][0, 0]

    assert reach(1) == pytest.approx(reach(-1), abs=1e-7)


@pytest.mark.slow
def test_cycles_that_pass_close_by_saddles_while_the_parameter_moves_are_at_no_end() -> None:
    """Bazykin's predators and prey: both axes stay what they are, so no orbit is homoclinic. The
    period is that of the logarithms of both, by scipy's LSODA at 1e-11."""

    def bazykin(t, x, p):
        eaten = x[0] * x[1] / (1 + 0.3 * x[0])
        return [x[0] - eaten - 0.01 * x[0] ** 2, eaten - x[1] - p["d"] * x[1] ** 2]

    start, params = {"x": 6.0, "y": 2.5}, {"d": 0.2}
    ring = cb.cycle(bazykin, start, params, settle=100, collocation=Collocation(intervals=40))
    branch = cb.trace(ring, "d", within={"d": (0.06, 0.2)}, towards="down")
    assert [at.kind for at in branch.special] == ["EP", "EP"]
    assert branch[-1]["period"] == pytest.approx(25.97635725, rel=1e-6)


def adaptive_neuron(settle: float, **params: float) -> cb.Problem:
    """With exponential spikes, each of which is a flow."""

    def field(t, x, p):
        leak = -30 * (x[0] + 70.6) + 60 * np.exp((x[0] + 50.4) / 2)
        return [(leak - x[1] + p["I"]) / 281, (p["a"] * (x[0] + 70.6) - x[1]) / 144]

    spike = cb.Flow(
        field, until=lambda t, x, p: -30 - x[0], reset=lambda t, x, p: [p["Vr"], x[1] + 80.5]
    )
    params = {"I": 800.0, "a": 4.0, "Vr": -70.6, **params}
    return cb.cycle([spike], {"V": -70.6, "w": 0.0}, params, settle=settle)


@pytest.mark.slow
def test_curves_set_out_from_a_homoclinic_orbit_one_after_the_other() -> None:
    """At I = 627.0023051022 by bisection with scipy's DOP853 at 1e-12; on the way around all is
    contracted by 1e-18. The first curve ends far away."""
    branch = cb.trace(adaptive_neuron(1000), "I", within={"I": (600, 900)}, towards="down")
    end = branch.first("HOM")
    assert end["I"] == pytest.approx(627.0023051022, abs=1e-6)
    assert not branch.doubtful
    for free, window in {"Vr": (-75, -50), "a": (3.8, 4.2)}.items():
        line = cb.boundary(end, (free, "I"), within={free: window})
        assert [at.kind for at in line.special] == ["EP", "EP"]


@pytest.mark.slow
def test_a_cycle_along_what_repels_is_followed_though_its_multiplier_is_1e23() -> None:
    """Two of its four spikes wait so long for the canard of the second; the doubling of the cycle
    of two is at -47.5271439053 by the derivative of the map of w, scipy's DOP853 at 1e-12."""
    single = cb.trace(adaptive_neuron(1000, Vr=-60.0), "Vr", within={"Vr": (-60, -48)})
    (pair,) = cb.switch(single.first("PD"), within={"Vr": (-60, -47)})
    doubling = pair.first("PD")
    assert doubling["Vr"] == pytest.approx(-47.5271439053, abs=1e-7)
    (arm,) = cb.switch(doubling, within={"Vr": (-60, -46.4)}, events=())
    assert arm[-1]["Vr"] == -46.4
    assert abs(arm[-1].solution.others[0]) > 1e23


@pytest.mark.slow
def test_a_small_cycle_far_from_the_origin_rests_nowhere() -> None:
    """It turns evenly. A curve of branch points that shrinks to rest ended as if its period grew,
    where the tangent along the branch is rounding."""

    def cell(t, x, p):
        a, b = x - 100.0
        r = a * a + b * b
        u, w = p["u"] - r, 1.0 - r
        return [u * a - w * b, w * a + u * b]

    rest = cb.equilibrium(cell, {"a": 100.0, "b": 100.0}, {"u": -0.01})
    cycles = born(rest, "u", (-0.01, 0.5))
    assert HOMOCLINIC.examine(cycles[0]) is NOTHING


@pytest.mark.slow
def test_where_states_are_counted_from_says_nothing_about_whether_an_orbit_rests() -> None:
    """Bogdanov and Takens' homoclinic orbit came early, a canard was taken for one."""

    def knot(t, x, p):
        a, b = x - 1e4
        return [b, -1 + p["u"] * b + a * a + a * b]

    def canard(t, x, p):
        a, b = x - 10.0
        return [a - a**3 / 3 - b, 1e-3 * (a - p["u"])]

    rest = cb.equilibrium(knot, {"a": 9999.0, "b": 1e4}, {"u": 0.8})
    knots = born(rest, "u", (0.0, 3.0))
    assert knots[-1].label == "HOM1"
    assert knots[-1]["u"] == pytest.approx(0.74344427, rel=3e-6)  # as at zero
    rest = cb.equilibrium(canard, {"a": 11.2, "b": 10.624}, {"u": 1.2})
    ducks = born(rest, "u", (0.5, 1.3), u=(0.5, 1.3), period=(0, 210))
    assert ducks[-1]["period"] == 210


@pytest.mark.slow
def test_a_homoclinic_orbit_at_the_edge_of_the_domain_is_told_in_silence(capfd) -> None:
    """Of prey that herds, eaten as its square root: below zero there is none, nor a derivative.
    LAPACK wrote a line for each NaN, and the branch was lost with an error."""

    def herd(t, x, p):
        eaten = np.sqrt(x[0]) * x[1]
        return [x[0] * (1 - x[0]) - eaten, eaten / 2 - p["s"] * x[1]]

    rest = cb.equilibrium(herd, {"x": 0.4, "y": 0.4}, {"s": 0.3})
    hopf = cb.trace(rest, "s", within={"s": (0.25, 0.4)}).first("HB")
    assert hopf["s"] == pytest.approx(1 / math.sqrt(12))
    (cycles,) = cb.switch(hopf, within={"s": (0.25, 0.4)})
    assert cycles[-1].kind == "HOM"
    assert "saddle x = 1, y = 0" in cycles.reason
    assert "DLASCL" not in "".join(capfd.readouterr())


@pytest.mark.slow
def test_a_saddle_behind_a_pole_is_no_end() -> None:
    """Of the Oregonator as Tyson has it, where none is negative: the branch ended half way at a
    saddle behind the pole at x = -q, from its other Hopf point it went all the way."""
    q, eps = 0.002, 0.1

    def oregonator(t, x, p):
        return [(x[0] * (1 - x[0]) - p["f"] * x[1] * (x[0] - q) / (x[0] + q)) / eps, x[0] - x[1]]

    rest = cb.equilibrium(oregonator, {"x": 0.01, "z": 0.01}, {"f": 2.1})
    hopf = cb.trace(rest, "f", within={"f": (2, 2.6)}).first("HB")
    (cycles,) = cb.switch(hopf, within={"f": (0.5, 2.6)})
    assert {point.kind for point in cycles.special} <= {"EP", "HB", "MX"}  # next to HB is rounding
    assert cycles[-1]["f"] == pytest.approx(0.5574291087, rel=1e-9)


@pytest.mark.slow
def test_no_multiplier_that_is_unknown_counts_as_stable() -> None:
    """Of two rooms with a thermostat, next to where the heater just reaches its threshold."""

    def rooms(heats: float) -> Any:
        return lambda t, x, p: [
            heats - 0.1 * (x[0] - p["o"]) - 0.3 * (x[0] - x[1]),
            0.3 * (x[0] - x[1]) - 0.2 * (x[1] - p["o"]),
        ]

    heater = cb.Flow(rooms(10.0), until=lambda t, x, p: 21 - x[0])
    rests = cb.Flow(rooms(0.0), until=lambda t, x, p: x[0] - 19)
    orbit = cb.cycle([heater, rests], {"x": 19.0, "y": 15.0}, {"o": -20.0}, settle=100)
    branch = cb.trace(orbit, "o", within={"o": (-60, -15)}, towards="down")
    last = branch[-1]
    # 10 = (0.1 + 0.3 * 0.4) (21 - o)
    assert last["o"] == pytest.approx(21 - 10 / 0.22, abs=1e-8)
    assert np.isnan(last.solution.multipliers).all()
    assert math.isnan(last["unstable"])
    assert "multipliers unknown" in repr(last.solution)
    assert branch[0]["unstable"] == 0
