"""Cycles of flows: closed forms, published values, and an independent integration."""

from __future__ import annotations

import math
import pickle
from collections import Counter
from functools import partial

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.special import mathieu_a, mathieu_b

import contbreather as cb
from contbreather.flows import Collocation, Cycle, cycle_of

from .zoo import BAND, CASES, FHN, TABLE, born, fitzhugh_nagumo, roessler, told, van_der_pol

TAU = 2 * math.pi
BEGIN = {"x": 2.0, "y": 0.0, "z": 0.1}


def force(p):
    return TAU / p["w"]


def langford(t, x, p):
    """On r' = (lam - b) r + r z, z' = lam z - r^2 - z^2, and a turn: cycles r^2 = z (lam - z)."""
    lam, b, turn = p["lam"], 3.0, p.get("turn", 10.0)
    return [
        (lam - b) * x[0] - x[1] * turn + x[0] * x[2],
        turn * x[0] + (lam - b) * x[1] + x[1] * x[2],
        lam * x[2] - (x[0] ** 2 + x[1] ** 2 + x[2] ** 2),
    ]


def variational(f, orbit: Cycle) -> np.ndarray:
    """Multipliers by DOP853 and differences of the vector field: another road."""
    n = len(orbit.multipliers)

    def both(t, y):
        x, m = y[:n], y[n:].reshape(n, n)
        jacobian = np.empty((n, n))
        for j in range(n):
            shifted = x.astype(complex)
            shifted[j] += 1e-30j
            jacobian[:, j] = np.imag(f(t, shifted, orbit.params)) / 1e-30
        return np.concatenate([f(t, x, orbit.params), (jacobian @ m).ravel()])

    start = np.concatenate([orbit.states(orbit.times[0]), np.eye(n).ravel()])
    span = (orbit.times[0], orbit.times[-1])
    end = solve_ivp(both, span, start, method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
    values = np.linalg.eigvals(end[n:].reshape(n, n))
    return values[np.argsort(-abs(values))]


# --- smooth, autonomous -------------------------------------------------------------------------


@pytest.fixture(scope="module")
def relaxation() -> Cycle:
    """Van der Pol's at mu = 1."""
    return cycle_of(cb.cycle(van_der_pol, {"x": 2.0, "v": 0.0}, {"mu": 1.0}, settle=60))


def test_multipliers_are_those_of_an_independent_integration(relaxation: Cycle) -> None:
    band = cycle_of(cb.cycle(roessler, BEGIN, {**BAND, "c": 2.5}, settle=150))
    for f, orbit in ((roessler, band), (van_der_pol, relaxation)):
        wanted = variational(f, orbit)
        assert orbit.multipliers == pytest.approx(wanted, abs=1e-7 * abs(wanted[0]))


@pytest.mark.slow
def test_a_strongly_stable_multiplier_keeps_its_digits() -> None:
    """Liouville: the product of all multipliers is the exponential of the mean divergence."""
    branch = cb.trace(
        cb.cycle(roessler, BEGIN, {**BAND, "c": 3.0},
                 settle=150, collocation=Collocation(intervals=40)),
        "c", within={"c": (3, 5)}, towards="up", events=(),
    )  # fmt: skip
    orbit = branch[-1].solution
    t = np.linspace(*orbit.times, 20001)
    divergence = orbit.params["a"] + orbit.states(t)[0] - orbit.params["c"]
    total = np.trapezoid(divergence, t)
    product = math.log(abs(orbit.others[0])) + math.log(abs(orbit.others[1]))
    assert product == pytest.approx(total, abs=1e-4)
    assert abs(orbit.others[1]) < 1e-12


def test_what_dies_out_leaves_the_multiplier_of_what_does_not_its_digits() -> None:
    """Pulses of vaccination where nobody is infected: a case would grow by up to 1e20 a year, and
    susceptibles come back to their number by (1 - v) exp(-m)."""
    infected = cb.Flow(
        lambda t, x, p: [0.2 * (1 - x[0]) - 60 * x[0] * x[1], (60 * x[0] - 10.2) * x[1]],
        at=0, reset=lambda t, x, p: [(1 - p["v"]) * x[0], x[1]],
    )  # fmt: skip
    none = cb.cycle(infected, {"S": 0.3, "I": 0.0}, {"v": 0.05}, period=1.0, settle=100)
    pulses = cb.trace(none, "v", within={"v": (0.01, 0.3)}, towards="both")
    assert not pulses.doubtful
    assert set(pulses["unstable"]) == {1}
    for at in pulses:
        known = (1 - at["v"]) * np.exp(-0.2)
        assert at.solution.others[1] == pytest.approx(known, rel=1e-9)


def test_a_pair_that_turns_and_stretches_one_way_far_more_than_the_other_stays_a_pair() -> None:
    """Kicks (u, v) -> (5e4 v, -u) once a period, beside what has decayed by then: +-i sqrt(5e4)."""
    kicked = cb.Flow(
        lambda t, x, p: [0 * x[0], 0 * x[1], p["F"] - 30 * x[2]],
        at=0, reset=lambda t, x, p: [5e4 * x[1], -x[0], x[2]],
    )  # fmt: skip
    rest = cb.cycle(kicked, {"u": 0.0, "v": 0.0, "w": 1 / 30}, {"F": 1.0}, period=1.0)
    mu = cycle_of(rest).multipliers
    assert mu[:2].imag * [1, -1] == pytest.approx(math.sqrt(5e4) * np.ones(2), rel=1e-9)
    assert abs(mu[:2].real).max() < 1e-9


def test_a_start_far_off_the_orbit_is_followed_until_it_is_there() -> None:
    """Where it began it never comes back to: what comes after the first wait is looked at."""

    def f(t, x, p):
        square = x[0] ** 2 + x[1] ** 2
        return [x[0] * (1 - square) - x[1], x[0] + x[1] * (1 - square), -0.05 * x[2]]

    orbit = cycle_of(cb.cycle(f, {"x": 0.1, "y": 0.0, "z": 5.0}, {}))
    assert orbit.period == pytest.approx(TAU, abs=1e-9)
    assert orbit.times[0] == 0


@pytest.mark.parametrize(("size", "pace"), [(1e-7, 1.0), (1e7, 1.0), (1.0, 1e-8)])
def test_units_of_state_and_time_do_not_decide_what_is_a_cycle(size: float, pace: float) -> None:
    def f(t, x, p):
        return [pace * x[1], pace * ((1 - (x[0] / size) ** 2) * x[1] - x[0])]

    orbit = cycle_of(cb.cycle(f, {"x": 2 * size, "v": 0.0}, {}, settle=50 / pace))
    assert orbit.period * pace == pytest.approx(6.663286859, abs=1e-8)
    assert orbit.max["x"] / size == pytest.approx(2.008619861, abs=1e-6)


@pytest.mark.slow
def test_units_do_not_decide_what_is_a_fold() -> None:
    """Duffing's oscillator."""
    x, v, pace = 1e-3, 1e3, 1e6

    def f(t, u, p):
        force = -0.2 * u[1] / v - u[0] / x - (u[0] / x) ** 3 + 0.5 * np.cos(p["w"] * t)
        return [x * pace * u[1] / v, v * pace * force]

    rest, at = {"x": 0.0, "v": 0.0}, {"w": pace}
    problem = cb.cycle(f, rest, at, period=force, settle=100 / pace)
    branch = cb.trace(problem, "w", within={"w": (pace, 2.4 * pace)})
    assert [point.kind for point in branch.special] == ["EP", "LP", "LP", "EP"]
    assert branch.special[1]["w"] / pace == pytest.approx(1.65767045, abs=1e-8)
    assert branch.special[2]["w"] / pace == pytest.approx(1.42305610, abs=1e-8)
    assert not branch.doubtful
    for fold in branch.special[1:3]:
        assert abs(variational(f, fold.solution) - 1).min() < 1e-6


@pytest.mark.parametrize("size", [1e-7, 1.0, 1e7])
def test_a_decay_to_rest_is_no_cycle_in_any_units(size: float) -> None:
    def f(t, x, p):
        return [x[1], -((1 - (x[0] / size) ** 2) * x[1]) - x[0]]

    with pytest.raises(cb.NotConverged, match=r"there is an equilibrium at \[0.0, 0.0\],"):
        cb.cycle(f, {"x": 0.5 * size, "v": 0.0}, {}, settle=100)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("f", "params", "settle", "period"),
    [
        (van_der_pol, {"mu": 5.0}, 0.0, 11.61223067),
        (lambda t, x, p: [(x[0] - x[0] ** 3 / 3 - x[1]) / p["eps"], x[0]], {"eps": 1e-3}, 5.0,
         1.68007149),
    ],
    ids=["5", "Lienard, 1000"],
)  # fmt: skip
def test_a_relaxation_is_closed_on_as_many_intervals_as_it_needs(f, params, settle, period) -> None:
    """Periods of van der Pol's oscillator by Radau's method at a tolerance of 1e-12."""
    stiff = cb.cycle(f, {"x": 2.0, "v": 0.0}, params, settle=settle)
    assert not cycle_of(stiff).coarse()
    assert stiff.start["period"] == pytest.approx(period, rel=1e-7)


@pytest.mark.slow
def test_what_is_stiff_is_simulated_by_an_implicit_method() -> None:
    """An explicit one takes 30,000 steps a period."""
    lagging = cb.cycle(lambda t, x, p: [-1e5 * (x[0] - np.cos(t))], {"x": 1.0}, {}, period=TAU)
    assert cycle_of(lagging).max["x"] == pytest.approx(1 / math.hypot(1, 1e-5), abs=1e-9)


def test_a_field_that_has_no_value_on_the_way_is_refused_with_a_sentence() -> None:
    def f(t, x, p):
        if x[0] > 3:
            raise ValueError("too far")
        return [x[1], x[0]]

    with pytest.raises(cb.NotConverged, match=r"no periodic orbit was found .* too far, at t = "):
        cb.cycle(f, {"x": 2.0, "v": 0.0}, {}, settle=20)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("c", "settle", "period"),
    [(2.7, 100, 5.761896857), (2.9, 300, 11.53508612)], ids=["before", "beyond"],
)  # fmt: skip
def test_around_a_doubling_the_orbit_is_closed_where_it_closes(c, settle, period) -> None:
    """Just before it returns are close by turns: that after two periods is ten times closer."""
    orbit = cycle_of(cb.cycle(roessler, BEGIN, {**BAND, "c": c}, settle=settle))
    assert orbit.period == pytest.approx(period, abs=1e-8 if settle == 100 else 1e-7)


def test_samples_of_two_periods_are_one_orbit_of_either(relaxation: Cycle) -> None:
    t = np.linspace(0, 2 * relaxation.period, 200)
    orbit = cycle_of(cb.cycle(van_der_pol, (t, relaxation.states(t)), {"mu": 1.0}))
    assert orbit.period == pytest.approx(relaxation.period, abs=1e-9)


@pytest.mark.slow
def test_a_canard_explosion_has_the_fold_of_its_mirror_image() -> None:
    """FitzHugh and Nagumo's cycles fold where their mean divergence vanishes: current and period by
    Taylor series of 45 digits. It changes by 1e-13 while the period grows by a third.

    With v for -v and w for 1.75 - w the current is 1.75 - I."""
    rest = cb.equilibrium(fitzhugh_nagumo, {"v": -1.2, "w": -0.62}, {**FHN, "I": 0.0},
                          collocation=Collocation(intervals=40))  # fmt: skip
    cycles = born(rest, "I", (-0.5, 1.0), I=(0, 2))
    first, second = (point for point in cycles.special if point.kind == "LP")
    for point, current in ((first, first["I"]), (second, 1.75 - second["I"])):
        assert current == pytest.approx(0.324178522503710167, abs=1e-14)
        assert point["period"] == pytest.approx(68.52650320988599, rel=1e-5)
    assert not cycles.doubtful


@pytest.mark.slow
def test_a_canard_explosion_without_folds_has_none() -> None:
    """Its cycles are stable throughout; its parameter is constant but for rounding on the way."""

    def f(t, x, p):
        return [(x[1] - x[0] ** 3 / 3 + x[0]) / 0.02, p["a"] - x[0]]

    few = Collocation(intervals=12)
    rest = cb.equilibrium(f, {"x": 1.2, "y": -0.6}, {"a": 1.2}, collocation=few)
    cycles = born(rest, "a", (0.9, 1.3), a=(0.9, 1.1), period=(0.1, 3.5))
    assert cycles[-1]["period"] == 3.5
    assert max(cycles["unstable"]) == 0
    assert [point.kind for point in cycles.special] == ["EP", "EP"]


def test_a_point_takes_one_derivative_and_few_flights() -> None:
    """That of the point before serves for the corrections, of which slopes inside of intervals are
    as exact as the next one needs. Each derivative takes two calls with complex numbers, for states
    and times, and for the parameter."""
    asked = [0, 0]

    def counted(t, x, p):
        asked[any(map(np.iscomplexobj, (x, *p.values())))] += 1
        return van_der_pol(t, x, p)

    ring = cb.cycle(counted, {"x": 2.0, "v": 0.0}, {"mu": 1.0}, settle=50)
    for top, steps in ((3.0, cb.Steps()), (2.0, cb.Steps(largest=0.05))):
        asked[:] = 0, 0
        window = {"mu": (1.0, top)}
        branch = cb.trace(ring, "mu", within=window, towards="up", steps=steps, events=())
        assert sum(asked) < 29 * len(branch)  # how to differentiate it is among that
    assert asked[1] < 3 * len(branch)


def test_a_curve_of_period_doublings_stays_one() -> None:
    point = CASES["roessler"].branch.first("PD")
    line = cb.boundary(point, ("c", "a"), within={"c": (2.6, 3.1)}, events=())
    assert len(line) > 5
    for place in (line[0], line[-1]):
        assert abs(place.base_point.solution.multipliers + 1).min() < 1e-7


@pytest.mark.slow
def test_resonances_on_langford_s_curve_of_tori_are_where_its_turn_says() -> None:
    """The curve is lam = 2, its angle sqrt(2) 2 pi / turn: Rk at turn = k sqrt(2), and again at
    k/(k - 1) sqrt(2), beyond a double -1 with two eigenvectors, through which it goes."""
    start = {"x": 0.9, "y": 0.0, "z": 1.3}
    params, few = {"lam": 1.75, "turn": 6.0}, Collocation(intervals=8)
    ring = cb.cycle(langford, start, params, settle=60, collocation=few)
    point = cb.trace(ring, "lam", within={"lam": (1.6, 2.2)}, towards="up").first("NS")
    line = cb.boundary(point, ("turn", "lam"), within={"turn": (1.8, 6.0), "lam": (1, 3)})
    assert line["lam"] == pytest.approx(2.0, abs=1e-9)
    found = sorted((at.kind, at["turn"] / math.sqrt(2)) for at in line.special if at.kind != "EP")
    places = [("R3", 3 / 2), ("R3", 3), ("R4", 4 / 3), ("R4", 4)]  # no CH: Re d is rounding
    assert found == [(kind, pytest.approx(place, abs=1e-8)) for kind, place in places]
    (double,) = line.doubtful
    assert double["turn"] == pytest.approx(2 * math.sqrt(2), abs=1e-8)
    assert double.detail["reason"] == "two multipliers are -1, with two eigenvectors"


def forced(t, x, p):
    """A van der Pol oscillator."""
    return [x[1], 0.3 * (1 - x[0] ** 2) * x[1] - x[0] + p["A"] * np.cos(p["w"] * t)]


def driven(t, x, p):
    """The same, by a circle that turns."""
    growth = 1 - x[2] ** 2 - x[3] ** 2
    push = 0.3 * (1 - x[0] ** 2) * x[1] - x[0] + p["A"] * x[2]
    return [x[1], push, growth * x[2] - p["w"] * x[3], growth * x[3] + p["w"] * x[2]]


@pytest.mark.slow
def test_a_curve_of_tori_ends_where_two_hopf_points_meet() -> None:
    """On r^2 = m1 a pair turns by sqrt(2) and grows at the rate m2 - 0.7 r^2: tori set out on
    m2 = 0.7 m1, down to the equilibrium. The same orbits half a turn later would lead back."""

    def two_pairs(t, X, p):
        (x, y, u, v), turn = X, math.sqrt(2)
        g, h = p["m1"] - x * x - y * y, p["m2"] - 0.7 * (x * x + y * y)
        g = g - u * u - v * v
        return [g * x - y, g * y + x, h * u - turn * v, h * v + turn * u]

    start = {"x": 0.7, "y": 0.0, "u": 0.0, "v": 0.0}
    first = cb.cycle(two_pairs, start, {"m1": 0.5, "m2": -0.3}, settle=40)
    torus = cb.trace(first, "m2", within={"m2": (-0.3, 2.0)}).first("NS")
    line = cb.boundary(torus, ("m1", "m2"), within={"m1": (-1, 1), "m2": (-1, 2)})
    assert [point.kind for point in line.special] == ["NS-HB", "EP"]
    assert abs(line["m2"] - 0.7 * line["m1"]).max() < 1e-10


@pytest.mark.slow
def test_where_a_curve_of_tori_ends_at_1_nothing_else_is_in_doubt() -> None:
    """At R1 the equations are those of a fold, too. Without forcing the curve ends at the same
    place, and the trivial multiplier and that of the fold are a pair at 1 all along the folds."""
    start, params, window = {"x": 0.8, "v": 2.0}, {"w": 1.085, "A": 0.5}, {"w": (1.05, 1.085)}
    lines = []
    for f, more, how, intervals in (
        (forced, {}, {"period": force}, 8),
        (driven, {"c": 1.0, "s": 0.0}, {}, 10),
    ):
        few = Collocation(intervals=intervals)
        cycle = cb.cycle(f, start | more, params, settle=60, collocation=few, **how)
        point = cb.trace(cycle, "A", within={"A": (0.33, 0.5)}, towards="down").first("NS")
        lines.append(cb.boundary(point, ("w", "A"), within=window, towards="down"))
        assert [place.kind for place in lines[-1].special] == ["EP", "R1"]
        assert lines[-1][-1]["angle"] == pytest.approx(0, abs=1e-9)
    resonance, end = (line[-1] for line in lines)
    assert abs(resonance.solution.multipliers - 1) == pytest.approx(0, abs=1e-4)
    lines.append(cb.boundary(end, ("w", "A"), within=window))
    for found in (end, lines[-1].first("R1")):
        for name in params:
            assert found[name] == pytest.approx(resonance[name], abs=1e-8)
    assert not [place for line in lines for place in line.doubtful]


def turning(t, u, p):
    """A Bogdanov-Takens point of x^2 + y^2 and z, turned about the axis of z, with its coordinates
    bent: the cycles are z = 0, q^2 = -b1 with q = x^2 + y^2 - 1."""
    y = u[1]
    x = u[0] - 0.3 * y**2
    z = u[2] - 0.2 * x * y
    q = x**2 + y**2 - 1
    w = 2.9 + 0.4 * z + 0.2 * q + 0.5 * x
    dx, dy = z * x - w * y, z * y + w * x
    dz = p["b1"] + p["b2"] * z + q**2 + q * z
    return [dx + 0.6 * y * dy, dy, dz + 0.2 * (dx * y + x * dy)]


@pytest.mark.slow
def test_a_pair_at_1_that_a_coarse_mesh_splits_is_double() -> None:
    few = Collocation(intervals=6, points=5)
    start, params = {"x": np.sqrt(0.8), "y": 0.0, "z": 0.0}, {"b1": -0.04, "b2": 0.15}
    cycle = cb.cycle(turning, start, params, settle=20, collocation=few)
    point = cb.trace(cycle, "b2", within={"b2": (0.1, 0.3)}).first("NS")
    assert point["b2"] == pytest.approx(0.2, abs=1e-7)  # b2 = -q
    window = {"b1": (-0.05, 0.02), "b2": (-0.1, 0.3)}
    tori = cb.boundary(point, ("b1", "b2"), within=window)
    assert [place.kind for place in tori.special if place.kind != "R4"] == ["EP", "R1"]
    assert abs(tori["b2"] - np.sqrt(np.maximum(-tori["b1"], 0))).max() < 1e-3
    fold = cb.trace(cycle, "b1", within={"b1": (-0.05, 0.02)}).first("LP")
    folds = cb.boundary(fold, ("b2", "b1"), within=window)
    for line in (tori, folds):
        resonance = line.first("R1")
        assert [resonance["b1"], resonance["b2"]] == pytest.approx([0, 0], abs=1e-6)
        assert not line.doubtful


# --- hybrid ----------------------------------------------------------------------------------


@pytest.mark.parametrize(("A", "bounces"), [(1.065, 1), (1.07, 1), (1.072, 2)])
def test_a_ball_bounces_twice_in_its_period_beyond_the_doubling_alone(A, bounces) -> None:
    settled = cb.cycle(
        [TABLE], start={"y": 1.1, "v": 3.1}, params={"A": A, "e": 0.8}, period=TAU, t0=0.9,
        settle=40,
    )  # fmt: skip
    orbit = cycle_of(settled)
    assert len(orbit.flights) == bounces
    assert orbit.period == pytest.approx(bounces * TAU, abs=1e-9)


@pytest.mark.slow
def test_doubled_bounces_set_out_at_the_doubling() -> None:
    ball = CASES["bouncing ball"].problem()
    events = (*ball.events, cb.Event("ZZ", lambda point: point["A"] - 1.08))
    branch = cb.trace(ball, "A", within={"A": (0.6, 1.5)}, towards="up", events=events)
    (arm,) = cb.switch(branch.first("PD"), within={"A": (0.6, 1.5)})
    assert arm.first("ZZ")["A"] == pytest.approx(1.08, abs=1e-9)  # what the branch looked for
    assert arm[-1].solution.equations.turns == 2
    assert len(arm[-1].solution.flights) == 2
    run = cb.integrate(
        [TABLE], arm[3].solution.states(arm[3].solution.times[0]), arm[3].params,
        events=2, t0=arm[3].solution.times[0],
    )  # fmt: skip
    assert run.events[-1].time == pytest.approx(arm[3].solution.times[-1], abs=1e-8)


def test_half_of_a_symmetric_orbit_is_closed_by_a_mirror(relaxation: Cycle) -> None:
    mirror = cb.Flow(van_der_pol, reset=lambda t, x, p: [-x[0], -x[1]])
    half = cycle_of(cb.cycle(mirror, {"x": 2.0, "v": 0.0}, {"mu": 1.0}, settle=60))
    assert 2 * half.period == pytest.approx(relaxation.period, rel=1e-9)
    assert half.others[0].real ** 2 == pytest.approx(relaxation.others[0].real, rel=1e-6)


@pytest.mark.parametrize("lag", [0.0, math.atan2(0.14, 0.51)])
def test_a_wall_that_is_touched_ends_the_branch_where_a_period_begins_too(lag: float) -> None:
    """The response of the linear oscillator grows with its forcing until it touches x = 2, with
    the second phase at t = 0."""
    free = cb.Flow(
        lambda t, x, p: [x[1], -0.2 * x[1] - x[0] + p["F"] * np.cos(0.7 * t + lag)],
        walls=(lambda t, x, p: 2 - x[0],),
    )
    forced = cb.cycle(free, {"x": 0.0, "v": 0.0}, {"F": 0.5}, period=TAU / 0.7, settle=200)
    branch = cb.trace(forced, "F", within={"F": (0.1, 5)}, towards="up")
    assert branch[-1].kind == "GR"
    assert branch[-1]["F"] == pytest.approx(2 * math.hypot(1 - 0.49, 0.14), abs=1e-9)


@pytest.mark.slow
def test_the_curve_of_a_touch_goes_round_with_the_forcing() -> None:
    """The phase of the linear response passes that at which a period begins at w = 0.93."""
    free = cb.Flow(
        lambda t, x, p: [x[1], -0.2 * x[1] - x[0] + p["F"] * np.cos(p["w"] * t + 1.0)],
        walls=(lambda t, x, p: 1 - x[0],),
    )
    start, params = {"x": 0.0, "v": 0.0}, {"F": 0.5, "w": 1.5}
    forced = cb.cycle(free, start, params, period=lambda p: TAU / p["w"], settle=200)
    touch = cb.trace(forced, "F", within={"F": (0.1, 3)}).first("GR")
    line = cb.boundary(touch, ("w", "F"), within={"w": (0.85, 1.6)}, events=())
    assert line["touch"].min() < 0.0 < line["touch"].max()
    assert line["F"] == pytest.approx(np.hypot(1 - line["w"] ** 2, 0.2 * line["w"]), abs=1e-9)


@pytest.mark.slow
def test_the_curve_of_a_touch_ends_where_its_flow_does() -> None:
    """x = t up to 1, and the wall (x - c)^2 + h: no touch is beyond 0 < c < 1."""
    ramp = cb.Flow(
        lambda t, x, p: [1.0 + 0 * x[0]], until=lambda t, x, p: 1 - x[0],
        reset=lambda t, x, p: [0 * x[0]], walls=(lambda t, x, p: (x[0] - p["c"]) ** 2 + p["h"],),
    )  # fmt: skip
    saw = cb.cycle(ramp, {"x": 0.0}, {"c": 0.4, "h": 1.0}, settle=5)
    touch = cb.trace(saw, "h", within={"h": (-1, 2)}).first("GR")
    line = cb.boundary(touch, ("c", "h"), within={"c": (-1, 2)}, events=())
    assert [line[0]["c"], line[-1]["c"]] == pytest.approx([0.0, 1.0], abs=1e-9)
    assert line.reason == "the domain of touch ends at 1"


@pytest.mark.slow
def test_the_curve_of_a_touch_ends_where_another_crest_touches() -> None:
    """Of cos 2t + b cos t the crests at 0 and pi are 1 + b and 1 - b."""
    rest = cb.Flow(
        lambda t, x, p: [1 - x[0]],
        walls=(lambda t, x, p: p["h"] - np.cos(2 * t) - p["b"] * np.cos(t),),
    )
    still = cb.cycle(rest, {"x": 0.5}, {"h": 2.0, "b": 0.3}, period=TAU, settle=30)
    touch = cb.trace(still, "h", within={"h": (0, 3)}).first("GR")
    window = {"b": (-1, 1), "h": (0, 3)}
    line = cb.boundary(touch, ("b", "h"), within=window)
    met = line.first("GR-GR")
    assert [met["b"], met["h"], line["b"].min()] == pytest.approx([0.0, 1.0, 0.0], abs=1e-9)
    other = cb.boundary(met, ("b", "h"), within=window)
    assert other["h"] == pytest.approx(1 - other["b"], abs=1e-9)
    assert sorted([other[0]["b"], other[-1]["b"]]) == pytest.approx([-1.0, 0.0], abs=1e-9)


@pytest.mark.slow
def test_the_curve_of_a_touch_does_not_go_on_as_that_of_a_vanishing_impact() -> None:
    """A driven integrate-and-fire neuron touches its threshold at its spike, I - A = 1 at the
    trough of the drive: an inflection, where I - A/(1 + w^2) = 1/(1 - 1/e) for one spike a turn."""
    fires = cb.Flow(
        lambda t, x, p: [p["I"] - x[0] + p["A"] * np.sin(TAU * t)],
        until=lambda t, x, p: 1 - x[0], reset=lambda t, x, p: [0 * x[0]],
    )  # fmt: skip
    neuron = cb.cycle([fires], {"x": 0.3}, {"I": 1.54, "A": 0.4}, period=1.0, settle=60)
    branch, window = cb.trace(neuron, "A", within={"A": (0.1, 5)}), {"A": (0, 5)}
    touch, gone = (cb.boundary(branch.first(kind), ("A", "I"), within=window, events=())
                   for kind in ("GR", "VI"))  # fmt: skip
    last, inflection = min((touch[0], touch[-1]), key=lambda point: point["A"]), gone.first("VI-GR")
    A = (1 / (1 - math.exp(-1)) - 1) * (1 + TAU**-2)
    assert [inflection["A"], inflection["I"]] == pytest.approx([A, 1 + A], abs=1e-9)
    assert [last["A"], last["I"]] == pytest.approx([A, 1 + A], abs=2e-4)


@pytest.mark.slow
def test_the_curve_of_a_touch_ends_where_that_comes_to_the_beginning_of_its_flow() -> None:
    """A mass moored by a line that only pulls: at the inflection it is on the line, x = 0, without
    velocity and acceleration. Beyond only VI solves the equations of the touch."""

    def field(taut):
        return lambda t, x, p: [x[1], 0.3 - taut * x[0] - 0.1 * x[1] + p["F"] * np.cos(p["w"] * t)]

    flows = [cb.Flow(field(1.0), until=lambda t, x, p: x[0]),
             cb.Flow(field(0.0), until=lambda t, x, p: -x[0])]  # fmt: skip
    moored = cb.cycle(flows, {"x": 1.0, "v": 0.1}, {"F": 0.5, "w": 0.9}, settle=300,
                      period=lambda p: TAU / p["w"])  # fmt: skip
    grazing = cb.trace(moored, "F", towards="down", within={"F": (0.4, 1)}).first("GR")
    line = cb.boundary(grazing, ("w", "F"), within={"w": (0.45, 1)}, towards="down", events=())
    orbit, end = line[-1].solution, line[-1]
    i = grazing["flow"]
    t, (x, v) = orbit.times[i], orbit.flights[i].states[0]
    assert [x, v, 0.3 + end["F"] * np.cos(end["w"] * t)] == pytest.approx([0, 0, 0], abs=1e-3)
    paces = [pace for point in line for _, pace in point.solution.paces.values()]
    assert min(paces) > 1e-9


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "limit"),  # y' = a - y from b on for a time of 1
    [("a", 1 / (1 - math.exp(-1))), ("b", 1.0)],
    ids=["where the flow ends", "where a reset lands"],
)
def test_a_wall_is_seen_at_the_ends_of_a_flow(name: str, limit: float) -> None:
    ramp = cb.Flow(
        lambda t, x, p: [1.0 + 0 * x[0], p["a"] - x[1]], until=lambda t, x, p: 1 - x[0],
        reset=lambda t, x, p: [0.0, p["b"]], walls=(lambda t, x, p: 1 - x[1],),
    )  # fmt: skip
    params = {"a": 0.0, "b": 0.0} | {name: 0.1}
    # it ends to settle just where the flow ends
    start = cb.cycle(ramp, {"x": 0.0, "y": 0.0}, params, settle=30)
    (at,) = cb.trace(start, name, within={name: (0.05, 4)}, towards="up").special[1:]
    assert (at.kind, at[name]) == ("GR", pytest.approx(limit, abs=1e-10))
    line = cb.boundary(at, ("a", "b"), within={"a": (-1, 2)}, steps=cb.Steps(most=3), events=())
    for place in line:
        orbit = place.base_point.solution
        assert orbit.max["y"] == pytest.approx(1.0, abs=1e-10)


@pytest.mark.parametrize(("wall", "passed"), [(4.0, True), (6.0, False)])
def test_no_orbit_that_newton_moves_through_a_wall_is_one(wall: float, passed: bool) -> None:
    """At resonance the response is 5 sin t, of which the first period reaches a half."""
    swing = cb.Flow(
        lambda t, x, p: [x[1], np.cos(t) - 0.2 * x[1] - x[0]], walls=(lambda t, x, p: wall - x[0],)
    )
    if passed:
        with pytest.raises(cb.NotConverged, match=r"passes walls\[0\] of flow 0, which is -1 at t"):
            cb.cycle(swing, {"x": 0.0, "v": 0.0}, {}, period=TAU)
    else:
        orbit = cycle_of(cb.cycle(swing, {"x": 0.0, "v": 0.0}, {}, period=TAU))
        assert orbit.max["x"] == pytest.approx(5.0, abs=1e-8)


@pytest.mark.slow
def test_a_second_wall_that_is_touched_between_impacts_is_followed_in_two_parameters() -> None:
    flow = cb.Flow(
        lambda t, x, p: [x[1], p["F"] * np.cos(1.5 * t) - x[0] - 0.1 * x[1]],
        until=lambda t, x, p: 1 - x[0],
        reset=lambda t, x, p: [x[0], -0.7 * x[1]],
        walls=(lambda t, x, p: x[0] + p["b"],),
    )
    start = {"x": 0.9, "v": -1.0}
    forced = cb.cycle(flow, start, {"F": 1.0, "b": 5.0}, period=TAU / 1.5, settle=200)
    branch = cb.trace(forced, "b", within={"b": (0.5, 6)}, towards="down")
    point = branch.first("GR")
    time = point.solution.flights[0].start + point["touch"] * point.solution.flights[0].duration
    assert branch.reason == f"flow 0 touches walls[0] at t = {time:.6g}"
    assert point["b"] == pytest.approx(-point.solution.min["x"], abs=1e-12)
    line = cb.boundary(point, ("F", "b"), within={"F": (0.9, 1.1)}, events=())
    for place in (line[0], line[-1]):
        assert place["b"] == pytest.approx(-place.base_point.solution.min["x"], abs=1e-10)


@pytest.mark.slow
def test_a_wall_that_was_just_hit_is_not_touched_however_often_it_is_written_down() -> None:
    def hit(sign: int) -> cb.Flow:
        return cb.Flow(
            lambda t, x, p: [x[1], p["a"] * np.cos(t) - x[0] - 0.1 * x[1]],
            reset=lambda t, x, p: [x[0], -0.5 * x[1]],
            until=lambda t, x, p: 1 - sign * x[0], walls=(lambda t, x, p: 1 + sign * x[0],),
        )  # fmt: skip

    flows = [hit(sign) for sign in (1, -1)]
    forced = cb.cycle(flows, {"x": -0.9, "v": 1.0}, {"a": 2.0}, period=TAU, t0=0.7)
    (touch,) = cb.trace(forced, "a", within={"a": (2, 4)}, towards="up").special[1:]
    assert touch.kind == "GR"
    orbit = touch.solution
    assert orbit.max["x"] == pytest.approx(1.0, abs=1e-9)
    assert orbit.min["x"] == pytest.approx(-1.0, abs=1e-9)
    inner = orbit.flights[1].sampled(200)[1][0]
    assert inner[20:-20].max() == pytest.approx(1.0, abs=1e-4)  # again, between two impacts


def test_a_branch_of_cycles_is_kept_in_a_file_and_goes_to_another_process(tmp_path):
    branch = cb.trace(CASES["bouncing ball"].problem(), "A", within={"A": (0.5, 0.7)})
    cb.save(tmp_path / "ball.nc", branch)
    again = cb.load(tmp_path / "ball.nc")
    assert again["phase"] == pytest.approx(branch["phase"], abs=0)
    assert again["max(v)"] == pytest.approx(branch["max(v)"], abs=0)
    assert list(again.to_dataframe()) == list(branch.to_dataframe())  # without its collocation
    orbit = pickle.loads(pickle.dumps(branch[0].solution.flights))
    assert orbit[0].duration == pytest.approx(TAU)


@pytest.mark.slow
def test_no_sentence_suggests_an_unknown_of_the_collocation() -> None:
    """A circle of radius 1 / mu: what grows is the orbit, whose window no user could tell."""

    def circle(t, x, p):
        inside = 1 - p["mu"] ** 2 * (x[0] ** 2 + x[1] ** 2)
        return [x[0] * inside - x[1], x[1] * inside + x[0]]

    ring = cb.cycle(circle, {"x": 1.0, "y": 0.0}, {"mu": 1.0}, settle=20)
    far = {"towards": "down", "events": (), "steps": cb.Steps(most=60, largest=100.0)}
    branch = cb.trace(ring, "mu", **far)
    wanted = "the solution grows, and no window ends it; give one, within={'mu': (low, high)}"
    assert branch.reason == wanted
    assert cb.trace(ring, "mu", within={"mu": (1e-9, 2)}, **far).reason == ""  # it has that window
    assert cb.trace(ring, "mu", within={"mu": (0.1, 2)}, **far).stop.name == "BOUND"
    for asked in (
        lambda: branch["nu"], lambda: branch[0]["nu"],
        lambda: cb.plotting.plot_diagram([branch], y="nu"),
        lambda: cb.trace(ring, "mu", within={"nu": (0, 1)}),
    ):  # fmt: skip
        with pytest.raises(cb.BadInput, match="period") as told:
            asked()
        assert "orbit" not in str(told.value)
    with pytest.raises(cb.BadInput, match=r"=\[cb.user\('max\(x\)', value, terminal=True\)\]"):
        cb.trace(ring, "mu", within={"max(x)": (0, 9)})
    ended = cb.trace(ring, "mu", **{**far, "events": [cb.user("max(x)", 9.0, terminal=True)]})
    assert ended[-1]["mu"] == pytest.approx(1 / 9)


def stuck(t, x, p):
    return [p["v"]]


def slipping(t, x, p):
    return [x[1], p["c"] - x[0]]


STUCK = cb.Flow(stuck, until=lambda t, x, p: 1 - x[0], reset=lambda t, x, p: [x[0], p["v"]])
SLIPPING = cb.Flow(slipping, until=lambda t, x, p: p["v"] - x[1], reset=lambda t, x, p: [x[0]])


@pytest.mark.parametrize(
    ("flows", "start"), [([STUCK, SLIPPING], {"x": 0.2}), ([SLIPPING, STUCK], {"x": 1.0, "y": 0.5})]
)
def test_a_flow_of_one_state_may_end_on_its_section_wherever_the_cycle_begins(flows, start) -> None:
    """A mass on a belt that is let go at 1 slips on a circle around c: it is there again, at
    2 c - 1, after all but the angle on the other side of x = 1; no perturbation is left."""
    branch = cb.trace(cb.cycle(flows, start, {"v": 0.5, "c": 0.6}), "v", within={"v": (0.4, 0.6)})
    assert {point.kind for point in branch.special} == {"EP"}
    assert not branch.doubtful
    for point in branch:
        orbit, v = point.solution, point["v"]
        slips = TAU - 2 * math.atan(0.4 / v)
        assert orbit.period == pytest.approx(0.8 / v + slips, rel=1e-10)
        assert orbit.multipliers[0] == pytest.approx(1.0, abs=1e-10)
        assert abs(orbit.multipliers[1:]).max(initial=0.0) < 1e-12


@pytest.mark.slow
def test_an_orbit_that_passes_from_one_state_to_one_state_is_followed_from_each_of_its_flows():
    """Thrown up at 1 it comes back after 2, leaks from e to g, and is filled up to 1."""
    thrown = cb.Flow(
        lambda t, x, p: [x[1], -1.0],
        until=lambda t, x, p: x[0],
        reset=lambda t, x, p: [-p["e"] * x[1]],
    )
    leaks = cb.Flow(
        lambda t, x, p: [-x[0]], until=lambda t, x, p: x[0] - p["g"], reset=lambda t, x, p: [x[0]]
    )
    filled = cb.Flow(
        lambda t, x, p: [1 + 0 * x[0]],
        until=lambda t, x, p: 1 - x[0],
        reset=lambda t, x, p: [0 * x[0], x[0]],
    )
    flows, starts = [thrown, leaks, filled], [{"h": 0.0, "v": 1.0}, {"x": 0.8}, {"x": 0.3}]
    for i, start in enumerate(starts):
        orbit = cb.cycle([*flows[i:], *flows[:i]], start, {"e": 0.8, "g": 0.3})
        branch = cb.trace(orbit, "g", within={"g": (0.2, 0.4)})
        wanted = [2 + math.log(0.8 / g) + 1 - g for g in branch["g"]]
        np.testing.assert_allclose(branch["period"], wanted, rtol=1e-10)
        assert not branch["unstable"].any()


# --- refusals --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "f", "start", "params", "how"),
    [
        ("equilibrium", van_der_pol, {"x": 0.1, "v": 0.0}, {"mu": -1.0}, {"settle": 200}),
        ("returns shape", lambda t, x, p: [x[0]], {"x": 1.0, "y": 0.0}, {}, {}),
        ("returns shape", lambda t, x, p: np.zeros((2, 2)), {"x": 1.0, "y": 0.0}, {}, {}),
        (r"TypeError: .*; it gets the time, all states in one array \(2,\) and a dict p, at t = 0",
         lambda t, x: [x[1], -x[0]], {"x": 1.0, "y": 0.0}, {}, {}),
        ("f raises TypeError", lambda x, t, p: [x[1], -x[0]], {"x": 1.0, "y": 0.0}, {}, {}),
        ("IndexError: .*; it gets the time", lambda t, x, p: -x["u"], {"u": np.ones(9)}, {}, {}),
        ("asks for the parameter", van_der_pol, {"x": 1.0, "y": 0.0}, {}, {"settle": 1}),
        ("rename", van_der_pol, {"orbit": 1.0, "y": 0.0}, {"mu": 1.0}, {}),
        ("twice", van_der_pol, {"mu": 1.0, "y": 0.0}, {"mu": 1.0}, {}),
        ("does not return", lambda t, x, p: [x[1], -x[0], 1.0], {"x": 1.0, "y": 1.0, "z": 0.0}, {},
         {"settle": 20}),
        ("mu = array", van_der_pol, {"x": 1.0, "v": 0.0}, {"mu": np.array([1.0])}, {}),
        ("period asks for the parameter 'w'", van_der_pol, {"x": 1.0, "v": 0.0}, {"mu": 1.0},
         {"period": lambda p: TAU / p["w"]}),
        ("has no states", van_der_pol, {}, {"mu": 1.0}, {}),
        ("fixed = 'energy' is of what is conserved", van_der_pol, {"x": 1.0, "v": 0.0}, {"mu": 1.0},
         {"fixed": "energy"}),
        ("positive time", van_der_pol, {"x": 1.0, "v": 0.0}, {"mu": 1.0}, {"period": -1.0}),
        ("u has shape .2, 3.: a number or", van_der_pol, {"u": np.eye(2, 3)}, {"mu": 1.0}, {}),
        ("a second multiplier is 1: .* where energy is conserved",
         lambda t, x, p: [x[1], -x[0] - x[0] ** 3], {"x": 1.0, "v": 0.0}, {}, {}),
        ("a second multiplier is 1", lambda t, x, p: [x[1], -x[0]], {"x": 1.0, "v": 0.0}, {}, {}),
        (r"a pseudo-equilibrium at \[0.0\], .* along the surface comes to rest",
         cb.Filippov(lambda t, x, p: [-1.0], lambda t, x, p: [1.0], lambda t, x, p: x[0]),
         {"x": 1.0}, {}, {"settle": 5}),
        ("reset of flow 0 gives 1 states; the flow that follows has 2",
         cb.Flow(lambda t, x, p: [x[1], np.cos(t) - x[0] - x[1]], reset=lambda t, x, p: [x[0]]),
         {"x": 0.0, "v": 0.0}, {}, {"period": TAU, "settle": 5}),
    ],
)  # fmt: skip
def test_what_is_no_cycle_is_refused_with_a_sentence(words, f, start, params, how) -> None:
    with pytest.raises((cb.BadInput, cb.NotConverged), match=words):
        cb.cycle(f, start, params, **how)


def test_a_multiplier_beyond_all_numbers_is_infinite_and_nobody_is_told_more(capfd) -> None:
    """x' = a x + cos t, whose multiplier is exp(2 pi a)."""
    t = np.linspace(0, 2 * np.pi, 1001)
    start = cb.cycle(
        lambda t, x, p: [p["a"] * x[0] + np.cos(t), p["a"] * x[1] + np.sin(t)],
        (t, np.vstack([-np.cos(t), -np.sin(t)]) / 150), {"a": 150.0}, period=2 * np.pi,
        collocation=Collocation(intervals=300),
    )  # fmt: skip
    point = cb.trace(start, "a", steps=cb.Steps(most=1))[0]
    assert np.isinf(abs(point.solution.multipliers)).all()
    assert capfd.readouterr() == ("", "")


# --- curves that close modulo the period of the forcing -----------------------------------------


def fires(periods: int, **params: float) -> cb.Problem:
    """v' = I - v + a cos(2 pi t) + b sin(2 pi t) up to 1, and from 0 again: a neuron that fires
    once in so many periods."""

    def f(t, x, p):
        return [p["I"] - x[0] + p["a"] * np.cos(TAU * t) + p["b"] * np.sin(TAU * t)]

    flow = cb.Flow(f, until=lambda t, x, p: 1 - x[0], reset=lambda t, x, p: [0 * x[0]])
    rate = 1 / (1 - math.exp(-periods))
    params = {"I": rate + 0.01, "a": 0.0, "b": 0.0} | params
    return cb.cycle([flow], {"v": 0.0}, params, period=1.0, settle=15)


@pytest.mark.slow
@pytest.mark.parametrize(("periods", "b"), [(1, 0.5), (2, 0.1)])
def test_a_curve_closes_where_its_phase_has_fallen_by_a_period(periods: int, b: float) -> None:
    """It fires at phi where (I + Im b exp(2 pi i phi) / (1 + 2 pi i)) (1 - exp(-T)) = 1."""
    branch = cb.trace(fires(periods, b=b), "I", within={"I": (1, 2)})
    assert branch.stop.name == "CLOSED"
    assert abs(branch["phase"][-1] - branch["phase"][0]) == pytest.approx(1, abs=1e-12)
    rate, swing = 1 / (1 - math.exp(-periods)), b / math.hypot(1, TAU)
    found = [(point.kind, round(point["I"], 9)) for point in branch.special]
    assert sorted(found) == [("LP", round(rate - swing, 9)), ("LP", round(rate + swing, 9))]


@pytest.mark.slow
def test_a_curve_of_folds_closes_where_its_phase_has_fallen_by_a_period() -> None:
    """The swing is I - 1/(1 - 1/e) all along: a circle in a and b."""
    neuron = fires(1, b=0.2)
    fold = cb.trace(neuron, "I", within={"I": (1, 2)}).first("LP")
    line = cb.boundary(fold, ("a", "b"), within={"a": (-1, 1)})
    assert line.stop.name == "CLOSED"
    assert np.hypot(line["a"], line["b"]) == pytest.approx(0.2, abs=1e-9)
    assert abs(line["phase"][-1] - line["phase"][0]) == pytest.approx(1, abs=1e-12)


@pytest.mark.slow
def test_a_curve_in_pieces_closes_modulo_the_period_and_goes_no_further() -> None:
    part = cb.trace(fires(1, b=0.5), "I", towards="up", steps=cb.Steps(most=12))
    assert part.stop.name == "MOST"
    whole = cb.extend(part, steps=cb.Steps(most=500))
    assert whole.stop.name == "CLOSED"
    assert [point.kind for point in whole.special] == ["LP", "LP"]
    assert abs(whole["phase"][-1] - whole["phase"][0]) == pytest.approx(1, abs=1e-12)


@pytest.mark.slow
def test_a_curve_of_rotations_closes_where_its_angle_has_turned_once_more() -> None:
    """The pendulum between its passages through the bottom, and between strokes of the forcing."""

    def f(t, x, p):
        return [x[1], p["T"] - x[1] - np.sin(x[0]) + 0.5 * np.cos(2 * t)]

    def back(t, x, p):
        return [x[0] - TAU, x[1]]

    branches = []
    for flow in (
        [cb.Flow(f, until=lambda t, x, p: TAU - x[0], reset=back)],
        cb.Flow(f, reset=back),
    ):
        start, params = {"x": 0.0, "v": 1.0}, {"T": 2.0}
        turns = cb.cycle(flow, start, params, period=math.pi, settle=60)
        branches.append(cb.trace(turns, "T", within={"T": (0.5, 4)}))
    folds = [sorted((at.kind, round(at["T"], 8)) for at in each.special) for each in branches]
    assert folds[0] == folds[1]
    assert [kind for kind, _ in folds[0]] == ["LP", "LP"]
    assert [each.stop.name for each in branches] == ["CLOSED", "CLOSED"]


@pytest.mark.slow
def test_folds_of_orbits_that_are_large_and_out_of_step_are_not_at_a_generalised_hopf_point():
    """Folds at nu = -1/4 whatever mu, of radius 1/sqrt(2), along which what follows the circle
    turns over: there nothing of the way of the first orbit is left."""

    def led(t, x, p):
        u, v, a, b = x
        square, turn = u**2 + v**2, 10 * np.cos(p["mu"])
        inside = p["nu"] + square - square**2
        return [u * inside - v, v * inside + u, 5 * (turn * u - a), 5 * (turn * v - b)]

    start = {"u": 1.0, "v": 0.0, "a": 10.0, "b": 0.0}
    orbit = cb.cycle(led, start, {"mu": 0.1, "nu": 0.1}, settle=40)
    branch = cb.trace(orbit, "nu", within={"nu": (-0.3, 0.2)}, towards="down")
    assert [at.kind for at in branch.special] == ["EP", "LP", "HB"]
    curve = cb.boundary(branch.first("LP"), ("mu", "nu"), within={"mu": (0.0, 1.7)})
    assert "GH" not in [at.kind for at in curve.special]
    assert curve["mu"].max() > math.pi / 2
    assert curve["nu"] == pytest.approx(-0.25, abs=1e-12)


@pytest.mark.slow
def test_folds_end_at_a_generalised_hopf_point_where_small_orbits_turn_at_their_own_pace() -> None:
    """At m = b = 0, by radius and angle: m = -b^2/4 on the folds."""

    def twisted(t, x, p):
        u, v = x
        square = u**2 + v**2
        grows, turns = p["m"] + p["b"] * square - square**2, 1 + 1000 * square
        return [grows * u - turns * v, grows * v + turns * u]

    rest = cb.equilibrium(twisted, {"u": 0.0, "v": 0.0}, {"m": 0.1, "b": 1.0})
    hopf = cb.trace(rest, "m", within={"m": (-1, 1)}).first("HB")
    (cycles,) = cb.switch(hopf, within={"m": (-1, 0.2)})
    line = cb.boundary(cycles.first("LP"), ("b", "m"), within={"b": (-0.5, 1.5)})
    assert [point.kind for point in line.special] == ["GH", "EP"]
    assert not line.doubtful


@pytest.mark.slow
def test_folds_beside_an_equilibrium_far_from_the_origin_do_not_end_while_they_are_large() -> None:
    """At m = b = 0; at m = -8e-3 it was, as orbits of size 0.3 are small beside 100."""

    def far(t, x, p):
        u, v = x[0] - 100, x[1]
        square = u**2 + v**2
        grows = p["m"] + p["b"] * square - square**2
        return [grows * u - v, grows * v + u]

    rest = cb.equilibrium(far, {"u": 100.0, "v": 0.0}, {"m": -0.5, "b": 1.0})
    hopf = cb.trace(rest, "m", within={"m": (-1, 1)}).first("HB")
    (cycles,) = cb.switch(hopf, within={"m": (-1, 0.2)})
    line = cb.boundary(cycles.first("LP"), ("m", "b"), within={"b": (-0.5, 1.5), "m": (-2, 2)})
    assert abs(line["m"]).min() < 1e-6


@pytest.mark.slow
def test_firing_shrinks_to_its_hopf_point_on_the_mesh_of_a_spike() -> None:
    """Morris and Lecar's neuron: with the phase by the trapezoidal rule it ended as MX before."""

    def neuron(t, x, p):
        v, w = x
        open_, rest = (
            (1 + np.tanh((v - at) / width)) / 2 for at, width in ((-1.2, 18), (12, 17.4))
        )
        current = p["I"] - 4 * open_ * (v - 120) - 8 * w * (v + 84) - 2 * (v + 60)
        return [current / 20, 0.0667 * np.cosh((v - 12) / 34.8) * (rest - w)]

    orbit = cb.cycle(neuron, {"v": -10.0, "w": 0.1}, {"I": 90.0})
    branch = cb.trace(orbit, "I", within={"I": (90.0, 300.0)}, towards="up")
    assert [point.kind for point in branch.special] == ["EP", "LP", "HB"]
    assert branch[-1]["I"] == pytest.approx(97.773713, abs=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("off", [0.1, 0.2])  # other steps, another rounding
def test_folds_of_a_neuron_s_cycles_in_mv_end_at_its_generalised_hopf_point(off: float) -> None:
    """Which the first Lyapunov coefficient tells, without a cycle, of Morris and Lecar's neuron. It
    was out of reach: MX, with CP in doubt beside it."""

    def neuron(t, x, p):
        v, w = x
        open_, rest = (1 + np.tanh((v + 1.2) / 18)) / 2, (1 + np.tanh((v - p["V3"]) / 17.4)) / 2
        current = p["I"] - 4 * open_ * (v - 120) - 8 * w * (v + 84) - 2 * (v + 60)
        return [current / 20, 0.0667 * np.cosh((v - p["V3"]) / 34.8) * (rest - w)]

    rest = cb.equilibrium(neuron, {"v": 8.0, "w": 0.5}, {"I": 185, "V3": 6})
    hopf = cb.trace(rest, "I", within={"I": (180, 230)}).first("HB")
    within = {"I": (180, 230), "V3": (3, 6 + off)}
    known = cb.boundary(hopf, ("I", "V3"), within=within).first("GH")
    (cycles,) = cb.switch(hopf, within={"I": (180, 230)}, steps=cb.Steps(most=60))
    line = cb.boundary(cycles.first("LP"), ("I", "V3"), within=within)
    assert [at.kind for at in line.special] == ["EP", "GH"]
    assert not line.doubtful
    assert told(line.first("GH")) == pytest.approx({n: known[n] for n in ("I", "V3")}, rel=1e-6)


@pytest.mark.slow
def test_folds_of_cycles_about_the_origin_end_at_its_generalised_hopf_point() -> None:
    """The first orbit of their branch is tiny, and no measure of how small others are."""

    def f(t, x, p):
        return [x[1], (p["m"] + p["b"] * x[0] ** 2 - x[0] ** 4) * x[1] - x[0]]

    rest = cb.equilibrium(f, {"u": 0.0, "v": 0.0}, {"m": 0.2, "b": 1.0})
    hopf = cb.trace(rest, "m", within={"m": (-1, 1)}).first("HB")
    (cycles,) = cb.switch(hopf, within={"m": (-1, 0.1)})
    line = cb.boundary(cycles.first("LP"), ("b", "m"), within={"b": (-1, 2)})
    assert [point.kind for point in line.special] == ["GH", "EP"]
    assert not line.doubtful
    assert told(line[0]) == pytest.approx({"b": 0, "m": 0}, abs=1e-8)


def test_a_branch_goes_on_where_its_first_orbit_measures_no_phase_any_more() -> None:
    """Two states follow a circle as 10 cos(mu) times it: no bifurcation at all, but beyond pi/2
    velocities are against those of the start."""

    def led(t, x, p):
        u, v, a, b = x
        inside, turn = 1 - u**2 - v**2, 10 * np.cos(p["mu"])
        return [u * inside - v, v * inside + u, 5 * (turn * u - a), 5 * (turn * v - b)]

    start, window = {"u": 1.0, "v": 0.0, "a": 10.0, "b": 0.0}, {"mu": (0.0, 3.0)}
    orbit = cb.cycle(led, start, {"mu": 0.1}, settle=20)
    branch = cb.trace(orbit, "mu", within=window, towards="up")
    assert [at.kind for at in branch.special] == ["EP", "EP"]
    assert branch["mu"] == pytest.approx(np.sort(branch["mu"]))
    assert branch[-1]["mu"] == 3.0
    assert abs(branch[-1].solution.max["a"] + 10 * np.cos(3.0) * 5 / math.sqrt(26)) < 1e-9


def _followed(t, x, p):
    """Roessler's equations, with states that follow and turn over beside c = 2.3 and 3.9."""
    (u, v, w), followers = x[:3], x[3:]
    f = [-v - w, u + 0.2 * v, 0.2 + w * (u - p["c"])]
    return [*f, *(5 * (10 * np.cos(2 * p["c"] + 0.1) * x[:3] - followers))]


def _cycle_with_followers():
    start = {"x": 1.0, "y": 1.0, "z": 0.1, "follow": np.zeros(3)}
    return cb.cycle(_followed, start, {"c": 2.5}, settle=300)


@pytest.mark.slow
def test_what_follows_changes_nothing_where_the_first_orbit_measures_no_phase_any_more() -> None:
    """A walk that is set up anew may be in phase with its start, to rounding."""
    branch = cb.trace(_cycle_with_followers(), "c", within={"c": (1.5, 4.5)})
    assert [(at.kind, round(at["c"], 6)) for at in branch.special[1:-1]] == [("PD", 2.832445)]
    assert branch["c"][[0, -1]].tolist() == [1.5, 4.5]


@pytest.mark.slow
def test_loaded_points_are_in_the_phase_that_they_were_walked_in(tmp_path) -> None:
    """Wherever the walk began: each on a curve of which it is a solution, where others set out."""
    orbit = _cycle_with_followers()
    cb.save(tmp_path / "led.nc", cb.trace(orbit, "c", within={"c": (1.5, 4.5)}, events=()))
    branch = cb.load(tmp_path / "led.nc", problem=orbit)
    assert max(abs(at.curve.equations(at.z)).max() for at in branch) < 1e-8
    assert len({id(at.curve) for at in branch}) < 10  # one for each piece of the walk
    assert cb.extend(branch, within={"c": (1.4, 4.6)})["c"][[0, -1]].tolist() == [1.4, 4.6]


@pytest.mark.slow
def test_folds_go_on_where_their_first_orbit_measures_no_phase_any_more() -> None:
    """At m = -1/4, whatever q is: r' = r (m + r^2 - r^4), and two states that follow."""

    def led(t, x, p):
        u, v, a, b = x
        growth, turn = p["m"] + u**2 + v**2 - (u**2 + v**2) ** 2, 3 * np.cos(p["q"])
        return [u * growth - v, v * growth + u, 5 * (turn * u - a), 5 * (turn * v - b)]

    start = {"u": 1.0, "v": 0.0, "a": 3.0, "b": 0.0}
    orbit = cb.cycle(led, start, {"m": -0.1, "q": 0.1}, settle=60)
    fold = cb.trace(orbit, "m", within={"m": (-1, 0.5)}).first("LP")
    line = cb.boundary(fold, ("q", "m"), within={"q": (0, 3)})
    assert [at.kind for at in line.special] == ["EP", "EP"]
    assert line["q"].max() == 3.0
    assert abs(line["m"] + 0.25).max() < 1e-12
    assert not line.doubtful


def _around(turn, half):
    """(a, b) = e^it (cos s, sin s), s' = turn(cos 2s, sin 2s, p): half a round in s turns an orbit
    by half its period, and on the way it has nothing in common with that at which it began."""

    def led(t, x, p):
        (a, c), (b, d) = x[:2], x[2:]
        off, out = c * b - a * d, 1 - (x * x).sum(0)  # 0 on all of them
        s = turn(a * a + c * c - b * b - d * d, 2 * (a * b + c * d), p)
        here = [out * a - c - s * b + off * d, out * c + a - s * d - off * b]
        return [*here, out * b - d + s * a - off * c, out * d + b + s * c + off * a]

    return cb.Flow(led, reset=lambda t, x, p: [-y for y in x]) if half else led


AROUND = {"a": [0.9, 0.0], "b": [0.3, 0.0]}


@pytest.mark.slow
@pytest.mark.parametrize("half", [False, True])
def test_a_branch_closes_where_it_comes_back_to_its_first_orbit_in_another_phase(
    tmp_path, half: bool
) -> None:
    flow, window = _around(lambda across, along, p: p["p"] - along, half), {"p": (-2, 2)}
    start = cb.cycle(flow, AROUND, {"p": 0.5}, settle=100)
    branch = cb.trace(start, "p", within=window)
    assert branch.stop is cb.continuation.Stop.CLOSED
    assert [(at.kind, round(at["p"], 9)) for at in branch.special] == [("LP", -1.0), ("LP", 1.0)]
    part = cb.trace(start, "p", within=window, steps=cb.Steps(most=50), towards="up")
    cb.save(tmp_path / "part.nc", part)
    rest = cb.extend(cb.load(tmp_path / "part.nc", problem=start), end="last", steps=cb.Steps())
    assert rest.stop is cb.continuation.Stop.CLOSED


@pytest.mark.slow
@pytest.mark.parametrize("half", [False, True])
def test_folds_close_where_they_come_back_to_their_first_orbit_in_another_phase(half: bool) -> None:
    """p cos 2s + q sin 2s = 1 has two solutions s outside of a circle."""
    flow = _around(lambda across, along, p: 1 - p["p"] * across - p["q"] * along, half)
    start = cb.cycle(flow, AROUND, {"p": 1.5, "q": 0.2}, settle=100)
    fold = cb.trace(start, "p", within={"p": (0, 2)}).first("LP")
    line = cb.boundary(fold, ("q", "p"), within={"q": (-2, 2)})
    assert line.stop is cb.continuation.Stop.CLOSED
    assert abs(np.hypot(line["p"], line["q"]) - 1).max() < 1e-12
    once = np.ptp(np.unwrap(np.arctan2(line["p"], line["q"])))
    assert once == pytest.approx(2 * np.pi, abs=1e-9)


@pytest.mark.slow
def test_arms_close_where_they_come_back_to_their_branch_point_in_another_phase() -> None:
    """Two neurons that are alike and fire together begin not to, by ever more, up to half a period
    and on to a whole one; a mirror image of itself, this has each event twice."""

    def neurons(t, x, p):
        v, w = x[:2], x[2:]
        pull = 0.02 * np.array([v[1] - v[0], v[0] - v[1]])
        return np.concatenate([v - v**3 / 3 - w + p["I"] + pull, 0.3 * (v + 0.7 - 0.8 * w)])

    start = {"v": [1.25, 1.25], "w": [0.83, 0.83]}
    window = {"I": (0.41, 0.48)}
    together = cb.cycle(neurons, start, {"I": 0.45}, settle=100)
    branch = cb.trace(together, "I", within=window)
    first = min((at for at in branch.special if at.kind == "BP"), key=lambda at: at["I"])
    (arm,) = cb.switch(first, within=window)
    assert arm.stop is cb.continuation.Stop.CLOSED
    kinds = Counter(at.kind for at in arm.special)
    assert kinds == {"EP": 1, "LP": 2, "PD": 4, "NS": 2, "BP": 1}
    assert np.ptp([at["I"] for at in arm.special if at.kind == "LP"]) < 1e-8


@pytest.mark.slow
def test_arms_close_where_their_other_phase_bends_as_they_set_out() -> None:
    """Two oscillators of van der Pol out of phase: one of both all but stops on the arm, which
    leads through those in phase and back."""

    def pair(t, x, p):
        (u, v), pull = (x[:2], x[2:]), p["k"] * np.array([x[1] - x[0], x[0] - x[1]])
        return np.concatenate([v, 0.5 * (1 - u**2) * v - u + pull])

    against = cb.cycle(pair, {"u": [2.0, -2.0], "v": [0.0, 0.0]}, {"k": 0.3}, settle=30)
    first = cb.trace(against, "k", within={"k": (-0.1, 0.3)}).first("BP")
    (arm,) = cb.switch(first, within={"k": (-0.3, 2)})
    assert arm.stop is cb.continuation.Stop.CLOSED
    folds = sorted(at["k"] for at in arm.special if at.kind == "LP")
    assert folds == pytest.approx(2 * [-0.158025] + 2 * [0.189245], abs=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize(("order", "a"), [(1, 0.3), (2, 3.0)])
def test_along_mathieu_s_tongues_without_damping_nothing_happens(order: int, a: float) -> None:
    """A pendulum on a shaken pivot, at rest: volumes are kept, so that along the whole edge of a
    tongue the other multiplier is the same; edges are the characteristic values."""

    def shaken(t, x, p):
        return [x[1], -(p["a"] - 2 * p["q"] * np.cos(2 * t)) * np.sin(x[0])]

    rest = cb.cycle(shaken, {"x": 0.0, "v": 0.0}, {"a": a, "q": 0.5}, period=np.pi)
    branch = cb.trace(rest, "a", within={"a": (a, a + 2)})
    for edge, value in zip(branch.special[1:-1], (mathieu_b, mathieu_a), strict=True):
        line = cb.boundary(edge, ("q", "a"), within={"q": (0.2, 1)})
        assert np.allclose(line["a"], value(order, line["q"]), rtol=0, atol=1e-12)
        assert [at.kind for at in line.special] == ["EP", "EP"]
        assert not line.doubtful


@pytest.mark.slow
def test_a_pair_whose_product_stays_1_where_time_can_be_reversed_is_no_torus() -> None:
    """Nose and Hoover's oscillator: (-x, y, -z) runs backwards, multipliers are 1, mu and 1/mu, on
    the circle or, between both branch points and on the arms, real."""

    def thermostat(t, x, p):
        return [x[1], -x[0] - x[1] * x[2], p["a"] * (x[1] ** 2 - 1)]

    window = {"a": (0.1, 5)}
    orbit = cb.cycle(thermostat, {"x": 0.0, "y": 1.55, "z": 0.0}, {"a": 1.0})
    branch = cb.trace(orbit, "a", within=window)
    assert [at.kind for at in branch.special] == ["EP", "BP", "BP", "EP"]
    arm, _ = cb.switch(branch.first("BP"), within=window, steps=cb.Steps(most=25))
    assert (arm["unstable"][1:] == 1).all()
    assert not branch.doubtful
    assert not arm.doubtful


@pytest.mark.parametrize("settle", [0, 60])
def test_a_swing_that_dies_out_is_rest_up_to_where_it_is_pumped(settle: float) -> None:
    """What is left of the start, 1e-50, is no size. Damped, a pendulum on a shaken pivot begins to
    swing where the multipliers of its linear equation, exp(-0.2 pi) times each other, reach -1."""

    def pumped(t, x, p):
        return [x[1], -0.2 * x[1] - (1 + p["a"] * np.cos(2 * t)) * np.sin(x[0])]

    def doubled(a):
        def linear(t, y):
            x, v = y[:2], y[2:]
            return np.append(v, -0.2 * v - (1 + a * np.cos(2 * t)) * x)

        both = solve_ivp(linear, (0, np.pi), [1, 0, 0, 1], "DOP853", rtol=1e-12, atol=1e-13)
        return both.y[0, -1] + both.y[3, -1] + 1 + math.exp(-0.2 * np.pi)

    start = {"x": 0.1, "v": 0.0}
    rest = cb.cycle(pumped, start, {"a": 0.1}, period=np.pi, settle=settle)
    branch = cb.trace(rest, "a", within={"a": (0, 1)}, towards="both")
    assert [at.kind for at in branch.special] == ["EP", "PD", "EP"]
    assert branch.first("PD")["a"] == pytest.approx(brentq(doubled, 0.3, 0.5), abs=1e-9)


@pytest.mark.slow
def test_a_parameter_that_rests_turns_back_nowhere() -> None:
    """At b = 1 every current comes back after two strokes of the clock: rounding moves b."""
    rises = cb.Flow(lambda t, x, p: [1 + 0 * x[0]], until=lambda t, x, p: 1 - x[0])
    falls = cb.Flow(lambda t, x, p: [-p["b"] + 0 * x[0]], at=0)
    strokes = cb.cycle([rises, falls], {"i": 0.7}, {"b": 0.8}, period=0.5, settle=30)
    point = cb.trace(strokes, "b", within={"b": (0.5, 3)}).first("PD")
    (twice,) = cb.switch(point, within={"b": (0.5, 3)})
    assert abs(twice["b"] - 1).max() < 1e-10
    assert not [at for at in (*twice.special, *twice.doubtful) if at.kind == "LP"]


@pytest.mark.slow
@pytest.mark.parametrize(("parts", "passed"), [(2, 1), (3, 1), (3, 2)])
def test_a_part_of_a_symmetric_orbit_shrinks_to_its_hopf_point(parts: int, passed: int) -> None:
    """Rotating waves of a ring of cells z' = (m + i - |z|^2) z, linked one way: the state a part of
    a turn later is the ring shifted by one. Two cells are half a period off each other."""

    def cells(t, x, p):
        u, w = np.split(x, 2)
        grows, back = p["m"] - u * u - w * w, partial(np.roll, shift=1, axis=0)
        link = 0.3 * (back(u) - u), 0.3 * (back(w) - w)
        return np.concatenate([grows * u - w + link[0], u + grows * w + link[1]])

    def shifted(t, x, p):
        return np.concatenate([np.roll(half, 1, 0) for half in np.split(x, 2)])

    apart = 2 * np.pi * passed / parts  # by so much each cell is ahead of the one before
    link = 0.3 * (np.exp(-1j * apart) - 1)
    rate, size = 1 + link.imag, np.sqrt(1 + link.real)
    t = np.linspace(0, apart / rate, 50)
    wave = size * np.exp(1j * (rate * t + apart * np.arange(parts)[:, None]))
    part = cb.Flow(cells, reset=shifted)
    found = cb.cycle([part], (t, np.concatenate([wave.real, wave.imag])), {"m": 1.0})
    branch = cb.trace(found, "m", within={"m": (-1, 2)})
    assert {branch.special[0].kind, branch.special[-1].kind} == {"EP", "HB"}
    assert branch.first("HB")["m"] == pytest.approx(-link.real, abs=1e-8)
    assert not branch.doubtful


@pytest.mark.slow
def test_hopf_asked_for_along_cycles_is_where_they_shrink_to_rest() -> None:
    """It was refused, "no HB of this problem (cycle, LP, BP, PD, NS, HB, HOM)"."""

    def round_rest(t, x, p):
        grows = p["m"] - x[0] ** 2 - x[1] ** 2
        return x[0] * grows - x[1], x[1] * grows + x[0]

    start = cb.cycle(round_rest, {"x": 0.7, "y": 0.0}, {"m": 0.5}, settle=50)
    branch = cb.trace(start, "m", within={"m": (-0.5, 0.7)}, events=[cb.hopf()])
    assert [at.kind for at in branch.special] == ["HB", "EP"]
    assert branch.special[0]["m"] == pytest.approx(0.0, abs=1e-9)


def test_a_cycle_says_how_many_multipliers_are_on_the_circle() -> None:
    """With r' = r (m + r^2 - r^4) cycles fold at m = -1/4: "0 unstable" was said there, where the
    table of the branch knows no count."""

    def round_rest(t, x, p):
        size = x[0] ** 2 + x[1] ** 2
        grows = p["m"] + size - size**2
        return x[0] * grows - x[1], x[1] * grows + x[0]

    start = cb.cycle(round_rest, {"x": 1.0, "y": 0.0}, {"m": -0.1}, settle=50)
    branch = cb.trace(start, "m", within={"m": (-0.3, 0.0)}, towards="down")
    assert repr(branch[0].solution).endswith(", 0 unstable>")
    assert repr(branch.first("LP").solution).endswith(", 0 unstable, 1 on the unit circle>")


def test_a_branch_of_cycles_of_a_long_period_warns_of_nothing() -> None:
    """In periods of 1e13 a phase was looked for to 1e-8, less than rounding, with a warning of
    SciPy's. The Brusselator has its Hopf point at B = 1 + A^2, with the frequency A."""

    def brusselator(t, x, p):
        reacts = x[0] ** 2 * x[1]
        return 1e-13 * (1 - (p["B"] + 1) * x[0] + reacts), 1e-13 * (p["B"] * x[0] - reacts)

    rest = cb.equilibrium(brusselator, {"x": 1.0, "y": 1.5}, {"B": 1.5})
    hopf = cb.trace(rest, "B", within={"B": (1.0, 3.0)}).first("HB")
    (cycles,) = cb.switch(hopf, within={"B": (1.0, 2.3)})
    assert cycles["period"][0] == pytest.approx(2e13 * np.pi, rel=1e-4)
