"""Branches of cycles whose mesh was made finer on the way: starts, files, what is left."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import contbreather as cb
from contbreather.flows import Collocation
from contbreather.flows.functions import kink

from .zoo import BAND, born, roessler, van_der_pol

pytestmark = pytest.mark.slow

FEW = Collocation(intervals=6, points=4)
TEN = Collocation(intervals=10, points=4)


@pytest.fixture(scope="module")
def ring() -> cb.Problem:
    return cb.cycle(van_der_pol, {"x": 2.0, "v": 0.0}, {"mu": 0.5}, settle=50, collocation=FEW)


@pytest.fixture(scope="module")
def refined(ring) -> cb.Branch:
    branch = cb.trace(ring, "mu", within={"mu": (0.5, 1.5)}, towards="up")
    assert branch["mesh"].shape[1] > FEW.intervals
    assert not branch.start_correction  # the same orbit on another mesh
    return branch


def test_a_branch_on_a_finer_mesh_gets_its_equations_back_from_a_file(tmp_path, ring, refined):
    cb.save(tmp_path / "ring.nc", refined)
    again = cb.load(tmp_path / "ring.nc", problem=ring)
    assert again[-1].solution.period == refined[-1].solution.period
    longer = cb.extend(again, within={"mu": (0.5, 1.6)})
    assert longer[-1]["mu"] == 1.6
    other = cb.cycle(van_der_pol, {"x": 2.0, "v": 0.0}, {"mu": 0.5}, settle=50)
    with pytest.raises(cb.BadInput, match=r"'orbit' has shape \(\d+,\) in the file, \(40,\) in"):
        cb.load(tmp_path / "ring.nc", problem=other)


def test_a_branch_that_gets_no_finer_mesh_says_where_it_is_too_coarse(tmp_path: Path, ring) -> None:
    """What goes on from a point keeps the mesh that it has there."""
    short = cb.trace(ring, "mu", within={"mu": (0.4, 0.6)}, events=())
    assert not short.doubtful
    longer = cb.extend(short, within={"mu": (0.4, 9.0)}, end="last")
    (place,) = longer.doubtful
    (first, *_) = (at for at in longer if at["trivial"] > 1e-4)
    assert (place.kind, place.located, place["mu"]) == ("MX", False, first["mu"])
    assert "the mesh is too coarse near t" in place.detail["reason"]
    fine = cb.cycle(van_der_pol, {"x": 2.0, "v": 0.0}, {"mu": place["mu"]}, settle=50)
    off = place["period"] / fine.start["period"] - 1  # where the multiplier is 1e-4 off: 8e-7
    assert place.solution.errors["period"] == pytest.approx(abs(off), rel=0.05)
    cb.save(tmp_path / "coarse.nc", longer)
    assert cb.load(tmp_path / "coarse.nc").doubtful[0].detail == place.detail


def test_an_equilibrium_and_its_cycles_in_one_file_are_given_their_equations(tmp_path: Path):
    def f(t, x, p):
        growth = p["mu"] - x[0] ** 2 - x[1] ** 2
        return [growth * x[0] - x[1], growth * x[1] + x[0]]

    rest = cb.equilibrium(f, {"x": 0.0, "y": 0.0}, {"mu": -0.5})
    line = cb.trace(rest, "mu", within={"mu": (-0.5, 0.5)})
    (cycles,) = cb.switch(line.first("HB"), steps=cb.Steps(most=8))
    cb.save(tmp_path / "both.nc", line=line, cycles=cycles)
    for problems in ((rest, cycles[0]), (cycles[0], rest)):
        run = cb.load(tmp_path / "both.nc", problem=problems)
        again = cb.trace(run["line"][0], "mu", within={"mu": (-0.5, 0.1)})
        assert again.first("HB")["mu"] == pytest.approx(0.0, abs=1e-12)
        assert run["cycles"][-1].solution.period == pytest.approx(2 * np.pi)
    said = (
        r"\['x', 'y'\], which the file has not: .*\(cycle\) was begun with, .* problem=\(one, other"
    )
    with pytest.raises(cb.BadInput, match=said):
        cb.load(tmp_path / "both.nc", problem=rest)


def test_an_arm_beyond_pd_gets_its_equations_back_from_the_cycle_that_was_given(tmp_path: Path):
    start = {"x": 0.0, "y": -4.0, "z": 0.0}
    orbit = cb.cycle(roessler, start, {"a": 0.2, "b": 0.2, "c": 2.7}, settle=200)
    point = cb.trace(orbit, "c", within={"c": (2.7, 3.0)}).first("PD")
    (arm,) = cb.switch(point, steps=cb.Steps(most=6))
    cb.save(tmp_path / "arm.nc", arm)
    again = cb.load(tmp_path / "arm.nc", problem=orbit)
    np.testing.assert_array_equal(again[4].solution.states(0.3), arm[4].solution.states(0.3))
    further = cb.extend(again, end="last", steps=cb.Steps(most=2))
    assert further[-1]["period"] == pytest.approx(2 * point["period"], rel=0.02)


def test_prey_that_all_but_dies_out_sets_the_period() -> None:
    """Bazykin's predators and prey, of which 1e-11 is left between two outbreaks: the period was
    1e-3 off, and the trivial multiplier 1 to 5e-5. In logarithms nothing is small."""

    def rates(x, y, p):
        return 1 - y / (1 + 0.3 * x) - p["eps"] * x, x / (1 + 0.3 * x) - 1

    def bazykin(t, x, p):
        return [state * rate for state, rate in zip(x, rates(*x, p), strict=True)]

    mesh = cb.Collocation(intervals=40)
    start = cb.cycle(bazykin, {"x": 1.5, "y": 2.0}, {"eps": 0.08}, settle=50, collocation=mesh)
    end = cb.trace(start, "eps", within={"eps": (0.02, 0.09)}, towards="down")[-1]
    logarithms = cb.cycle(
        lambda t, x, p: rates(*np.exp(x), p), {"x": 0.5, "y": 0.7}, {"eps": 0.02}, settle=100,
        collocation=mesh,
    )  # fmt: skip
    assert end["period"] == pytest.approx(logarithms.start["period"], rel=1e-7)


@pytest.mark.parametrize("decay", [0.0, 100.0])
def test_an_oscillator_that_turns_fast_beside_its_forcing_has_its_multipliers(decay) -> None:
    """exp((-d/2 + i w) T) in closed form: with nine radians in an interval they were as wrong as
    can be, and nothing said so, nor, later, where another state decays faster than it turns."""

    def f(t, x, p):
        gate = [decay * (np.cos(t) - x[2])] if decay else []
        return [x[1], -0.2 * x[1] - p["k"] * x[0] + np.cos(t), *gate]

    rest = {"x": 0.0, "v": 0.0} | ({"gate": 0.0} if decay else {})
    start = cb.cycle(f, rest, {"k": 900.0}, period=2 * np.pi, settle=100)
    end = cb.trace(start, "k", within={"k": (800, 1600)}, towards="up")[-1]
    exact = np.exp(2 * np.pi * (-0.1 + 1j * np.sqrt(1600 - 0.01)))
    assert abs(end.solution.multipliers - exact).min() < 1e-5


def test_many_oscillators_that_turn_slowly_do_not_turn_fast_together() -> None:
    """Where they do errors are asked for at each point, which takes far longer than the point."""

    def f(t, x, p):
        return [*x[8:], *(np.cos(t) - 25 * x[:8] - 0.1 * x[8:])]

    start = {f"x{i}": 0.0 for i in range(16)}
    mesh = cb.Collocation(intervals=6, points=12)
    slow = cb.cycle(f, start, {"p": 0.0}, period=2 * np.pi, settle=100, collocation=mesh)
    assert not cb.flows.cycle_of(slow).turns_fast


def test_errors_of_multipliers_are_those_of_the_orbit_that_is_off_as_well() -> None:
    start, params = {"x": 2.0, "y": 0.0, "z": 0.1}, {**BAND, "c": 2.3}
    few, many = (
        cb.flows.cycle_of(cb.cycle(roessler, start, params, settle=200, collocation=mesh))
        for mesh in (TEN, cb.Collocation(intervals=100))
    )
    off = abs(few.multipliers[:, None] - many.multipliers).min(axis=1)
    assert few.errors["multipliers"] == pytest.approx(off.max(), rel=0.01)


def test_errors_are_infinite_where_twice_as_many_points_pass_a_pole() -> None:
    """Of the Oregonator, at x = -q: its orbit comes to 1e-4 of that, relative to its size."""

    def f(t, x, p):
        rate = x[0] * (1 - x[0]) - p["f"] * x[1] * (x[0] - 0.002) / (x[0] + 0.002)
        return [rate / 0.01, x[0] - x[1]]

    ring = cb.cycle(f, {"x": 0.5, "z": 0.1}, {"f": 1.0}, settle=40)
    assert cb.flows.cycle_of(ring).errors == {"period": math.inf, "multipliers": math.inf}


def test_errors_tell_multipliers_that_the_mesh_of_a_slow_orbit_does_not_resolve() -> None:
    """(A, 0, -A) of three coupled nonlinear Schroedinger equations turns at A^2, modes across it at
    a frequency near 1: multipliers are 0.3 % off with 20 intervals, all others are rounding."""

    def trimer(t, z, p):
        (x, y, u, v, w, s) = z
        sizes = x * x + v * v, y * y + w * w, u * u + s * s
        turned = [-sizes[0] * v - w, -sizes[1] * w - v - s, -sizes[2] * s - w]
        return [*turned, sizes[0] * x + y, sizes[1] * y + x + u, sizes[2] * u + y]

    def energy(z, p):
        (x, y, u, v, w, s) = z
        sizes = x * x + v * v, y * y + w * w, u * u + s * s
        return sum(size**2 for size in sizes) / 4 + x * y + y * u + v * w + w * s

    A = 0.3
    t = np.linspace(0, 2 * np.pi / A**2, 81)
    rest, c, s = 0 * t, A * np.cos(A**2 * t), A * np.sin(A**2 * t)
    samples = (t, np.array([c, rest, -c, s, rest, -s]))
    few, many = (
        cb.flows.cycle_of(cb.cycle(trimer, samples, {"p": 0.0}, conserves=energy, collocation=mesh))
        for mesh in (cb.Collocation(intervals=20), cb.Collocation(intervals=200))
    )
    off = abs(few.multipliers[0] - many.multipliers[0]) / abs(many.multipliers[0])
    assert few.errors["multipliers"] == pytest.approx(off, rel=0.02)
    assert many.errors["multipliers"] < 1e-9


# --- arms ---------------------------------------------------------------------------------------


def forked(t, x, p):
    """An oscillator born at mu = 0, beside which w = 0 and from mu = .5 on w^2 = mu - .5."""
    return [x[1], (p["mu"] - x[0] ** 2) * x[1] - x[0], x[2] * (p["mu"] - 0.5 - x[2] ** 2)]


@pytest.fixture(scope="module")
def rest() -> cb.Problem:
    start = {"x": 0.0, "v": 0.0, "w": 0.0}
    return cb.equilibrium(forked, start, {"mu": -0.5}, collocation=FEW)


@pytest.fixture(scope="module")
def cycles(rest) -> cb.Branch:
    """From their Hopf point to beyond where they fork."""
    return born(rest, "mu", (-1.0, 0.4), mu=(-1.0, 0.7))


def test_an_arm_of_cycles_on_a_finer_mesh_is_itself_and_not_what_it_left(cycles) -> None:
    arms = cb.switch(cycles.first("BP"), within={"mu": (0.2, 6.7)})
    assert sorted(round(arm[-1]["max(w)"], 9) for arm in arms) == [-2.48997992, 2.48997992]
    for arm in arms:
        assert arm["mesh"].shape[1] > cycles["mesh"].shape[1]
        np.testing.assert_allclose(arm["max(w)"] ** 2, arm["mu"] - 0.5, atol=1e-10)
        np.testing.assert_allclose(arm["min(w)"], arm["max(w)"], atol=1e-10)
        assert not arm.doubtful


def test_what_goes_on_from_a_cycle_does_not_begin_at_its_hopf_point_again(cycles) -> None:
    longer = cb.extend(cycles, within={"mu": (-1.0, 6.6)}, end="last")
    assert [point.label for point in longer.special] == ["EP1", "BP1", "EP2"]
    assert longer["mesh"].shape[1] == cycles["mesh"].shape[1]
    (place,) = longer.doubtful
    assert "the mesh is too coarse near t" in place.detail["reason"]


def test_arms_of_a_symmetric_circuit_are_followed_into_where_they_need_more_intervals() -> None:
    """AUTO's demo tor: its torus and its doubling."""

    def circuit(t, u, p):
        cubic = 0.933578 * (u[1] - u[0]) ** 3
        return [
            (-(0.5 + p["nu"]) * u[0] + 0.5 * u[1] - 0.328578 * u[0] ** 3 + cubic) / 0.6,
            0.5 * u[0] + 0.1 * u[1] - u[2] - cubic,
            u[1],
        ]

    rest = cb.equilibrium(circuit, {"x": 0.0, "y": 0.0, "z": 0.0}, {"nu": -0.9}, collocation=TEN)
    cycles = born(rest, "nu", (-1.2, -0.58), nu=(-0.6, -0.3))
    steps = cb.Steps(most=22)
    arms = cb.switch(cycles.first("BP"), within={"nu": (-0.77, -0.58)}, steps=steps)
    assert len(arms) == 2
    for arm in arms:
        assert arm["mesh"].shape[1] > cycles["mesh"].shape[1]
        assert [point.kind for point in arm.special[:3]] == ["EP", "NS", "PD"]
        assert arm.first("NS")["nu"] == pytest.approx(-0.5916502, abs=1e-7)
        assert arm.first("PD")["nu"] == pytest.approx(-0.6149552, abs=1e-7)


def test_cycles_from_a_hopf_point_get_more_intervals_whatever_the_units_of_their_states() -> None:
    """Morris-Lecar in mV and ms: beside HB equations are as close to singular as where curves
    cross."""

    def neuron(t, u, p):
        V, w = u
        opens = (1 + np.tanh((V + 1.2) / 18)) / 2
        rest, pace = (1 + np.tanh((V - 12) / 17.4)) / 2, 0.067 * np.cosh((V - 12) / 34.8)
        ions = 2 * (V + 60) + 4 * opens * (V - 120) + 8 * w * (V + 84)
        return [(p["I"] - ions) / 20, pace * (rest - w)]

    few = Collocation(intervals=8, points=4)
    rest = cb.equilibrium(neuron, {"V": 8.3, "w": 0.4}, {"I": 97.5}, collocation=few)
    cycles = born(rest, "I", (97, 98), I=(97, 120))
    assert cycles["mesh"].shape[1] > 8
    assert not cycles.doubtful
    assert cycles.first("LP")["I"] == pytest.approx(115.94872149, abs=1e-6)


def test_a_diagram_has_arms_on_finer_meshes_and_what_they_left_once(rest) -> None:
    tree = cb.diagram(rest, "mu", within={"mu": (-0.5, 1.8)})
    cycles = [branch for branch in tree if branch[-1].kind == "EP" and "mesh" in branch[-1].values]
    assert not tree.failed
    ends = sorted(round(branch[-1]["max(w)"], 6) for branch in cycles)
    assert ends == [-1.140175, 0.0, 1.140175]
    assert {branch[-1]["mu"] for branch in cycles} == {1.8}


def test_an_arm_of_doubled_cycles_on_a_coarse_mesh_leaves_the_branch() -> None:
    """A mesh of ten intervals follows the doubled orbit: its branch point is 6e-7 off PD."""
    start, mesh = {"x": 2.0, "y": 0.0, "z": 0.1}, Collocation(intervals=10, points=5)
    ring = cb.cycle(roessler, start, {**BAND, "c": 2.7}, settle=200, collocation=mesh)
    branch = cb.trace(ring, "c", within={"c": (2.0, 3.2)}, towards="up")
    (double,) = cb.switch(branch.first("PD"), within={"c": (2.0, 3.2)})
    end, orbit = double[-1], double[-1].solution
    phases = end.curve.problem.phases(end.x, end.params)  # where its curve may close
    assert {x.size for x in phases} == {end.x.size}
    assert orbit.period == pytest.approx(11.531, abs=1e-3)
    assert abs(orbit.states(orbit.period / 2) - orbit.states(0.0)).max() > 0.1
    assert [point.kind for point in double.special] == ["EP", "EP"]


def peroxidase_oxidase(t: float, x: Any, p: Any) -> list[Any]:
    """C. G. Steinmetz and R. Larter, J. Chem. Phys. 94, 1388 (1991)."""
    A, B, X, Y = x
    first, third = 0.1631021 * A * B * X, 0.046875 * A * B * Y
    return [
        -first - third + p["k7"] - 0.1175 * A,
        -first - third + p["k8"],
        first - 2500.0 * X**2 + 2.0 * third - 20.0 * X + 0.001,
        -third + 2500.0 * X**2 - 1.104 * Y,
    ]


def test_tori_of_the_peroxidase_reaction_end_on_the_folds_at_r1() -> None:
    """There the pair, the fold's multiplier and the trivial one are all 1: beyond it the curve ran
    on along the folds."""
    start = {"A": 6.23, "B": 6.22, "X": 0.00835, "Y": 0.0785}
    params, mesh = {"k7": 1.73, "k8": 0.9}, Collocation(intervals=14)
    cycle = cb.cycle(peroxidase_oxidase, start, params, settle=30, collocation=mesh)
    torus = cb.trace(cycle, "k8", within={"k8": (0.9, 0.907)}, towards="up").first("NS")
    line = cb.boundary(
        torus, ("k7", "k8"), within={"k7": (1.0, 2.0)}, towards="up", steps=cb.Steps(first=0.1)
    )
    assert [point.kind for point in line.special] == ["EP", "CH", "R1"]
    assert (line.stop.name, line.doubtful) == ("EVENT", ())
    end = line.special[-1]
    assert (end["k7"], end["k8"]) == pytest.approx((1.857675, 0.930422), abs=2e-6)


def test_what_has_doubled_ends_where_that_is_taken_back_next_to_a_point_of_its_own() -> None:
    """A pendulum whose length swings rests up to one PD and from another on. The last step to that
    may end so near that both rounds are alike."""

    def swings(t: Any, x: Any, p: Any) -> Any:
        push = -(0.1 + 0.3 * x[0] ** 2) * x[1] - x[0] ** 3
        return [x[1], push - (1 + 0.5 * np.cos(p["w"] * t)) * x[0]]

    rest = cb.cycle(swings, {"x": 0.0, "v": 0.0}, {"w": 2.5}, period=lambda p: 2 * np.pi / p["w"])
    first, second = cb.trace(rest, "w", within={"w": (1.5, 3)}).special[1:-1]
    (arm,) = cb.switch(first, within={"w": (1.5, 4)})
    assert arm[-1]["w"] == pytest.approx(second["w"], abs=1e-9)
    assert "its own image" in arm.reason


def test_what_has_doubled_ends_where_that_is_taken_back() -> None:
    """Of Duffing's cascade the branch of four periods reaches from one PD of that of two to the
    other; beyond it has the same orbits two periods later, and all labels a second time."""
    duffing = cb.cycle(
        lambda t, x, p: [x[1], -0.5 * x[1] + x[0] - x[0] ** 3 + p["A"] * np.cos(p["w"] * t)],
        {"x": 1.1, "v": 0.0}, {"A": 0.2, "w": 1.2}, period=lambda p: 2 * np.pi / p["w"], settle=200,
    )  # fmt: skip
    window = {"A": (0.1, 0.6)}
    (two,) = cb.switch(cb.trace(duffing, "A", within=window).first("PD"), within=window)
    (four,) = cb.switch(two.first("PD"), within=window)
    first, second, _ = (point["A"] for point in two.special if point.kind == "PD")
    assert (four[0]["A"], four[-1]["A"]) == pytest.approx((first, second), abs=1e-7)
    assert "its own image" in four.reason
    places = [round(point["A"], 6) for point in four.special]
    assert len(set(places)) == len(places)


def test_what_has_doubled_ends_there_where_each_round_is_a_flow_of_its_own() -> None:
    """Rounds of angles, and of halves with a mirror, are flows at times of their own: the branch
    ends at the other PD of what has doubled all the same."""
    field = lambda t, x, p: [x[1], p["a"] * np.cos(0.7 * t) - 0.3 * x[1] - np.sin(x[0]) + 0.3]  # noqa: E731
    turning = cb.cycle(
        field, {"angle": 0.0, "v": 1.0}, {"a": 1.0}, period=2 * np.pi / 0.7, settle=100,
        wraps={"angle": 2 * np.pi},
    )  # fmt: skip
    mirrored = cb.Flow(
        lambda t, x, p: [x[1], p["a"] * np.cos(1.2 * t) - 0.45 * x[1] - x[0] - x[0] ** 3],
        reset=lambda t, x, p: [-x[0], -x[1]],
    )
    half = cb.cycle(
        mirrored, {"x": 0.0, "v": 1.0}, {"a": 4.0}, period=lambda p: np.pi / 1.2, settle=100
    )
    for single, near in ((turning, (0.9, 1.3)), (half, (3.0, 17.0))):
        branch = cb.trace(single, "a", within={"a": near})
        doubled = cb.switch(branch.first("PD"), within={"a": (0.2, 40.0)})[0]
        first, second = (point["a"] for point in branch.special if point.kind == "PD")
        assert (doubled[0]["a"], doubled[-1]["a"]) == pytest.approx((first, second), rel=1e-7)
        assert "its own image" in doubled.reason


# --- bursts of Hindmarsh and Rose -----------------------------------------------------------------


def bursting(current: float, settle: float) -> cb.Problem:
    def neuron(t: Any, x: Any, p: Any) -> Any:
        slow = 0.01 * (4 * (x[0] + 1.6) - x[2])
        return [x[1] - x[0] ** 3 + 3 * x[0] ** 2 - x[2] + p["I"], 1 - 5 * x[0] ** 2 - x[1], slow]

    start = {"x": -1.0, "y": -5.0, "z": 2.0}
    return cb.cycle(neuron, start, {"I": current}, settle=settle)


def test_a_mesh_that_leads_to_no_orbit_is_fitted_to_the_motion_again() -> None:
    """Halved it is that of the motion as 20 intervals have it."""
    assert cb.flows.cycle_of(bursting(1.6, 300)).period == pytest.approx(105.7297933, abs=1e-6)


def test_a_finer_mesh_begins_at_the_start_however_far_the_branch_has_come() -> None:
    up = {"towards": "up", "within": {"I": (1.4, 1.85)}, "events": ()}
    branch = cb.trace(bursting(1.4, 600), "I", **up)
    assert (branch[0]["I"], branch[-1]["I"]) == (1.4, 1.85)
    assert branch["mesh"].shape[1] == 80


def test_a_step_that_failed_leaves_no_other_roots_to_begin_from() -> None:
    """Beyond the pole of x / (K + x) the equations inside of an interval have roots that are no
    motion. A step that was too long ended on them, and so did all that were tried after it."""

    def enzyme(t: Any, x: Any, p: Any) -> Any:
        return [p["a"] * (1 + np.cos(t)) - x[0] / (0.005 + x[0])]

    orbit = cb.cycle(
        enzyme, {"x": 0.1}, {"a": 0.9}, period=2 * math.pi, settle=60,
        collocation=cb.Collocation(15, 12),
    )  # fmt: skip
    branch = cb.trace(orbit, "a", towards="down", within={"a": (0.7, 0.99)})
    assert branch.stop.name == "BOUND"
    states = branch[-1].solution.states
    run = solve_ivp(
        partial(enzyme, p={"a": 0.7}), (0.0, 3.0), states(0.0), "Radau", rtol=1e-11, atol=1e-14
    )
    assert run.y[:, -1] == pytest.approx(states(3.0), rel=1e-8)


def test_solutions_outlive_derivatives_that_are_chosen_anew(ring) -> None:
    """As where a step fails: solved for again, an orbit may come out at other roots."""
    point = cb.trace(ring, "mu", steps=cb.Steps(most=1))[0]
    solution = point.solution
    point.curve.forget()
    assert point.solution is solution


def test_a_curve_without_its_own_multiplier_asks_for_a_finer_mesh() -> None:
    """Folds next to a homoclinic orbit were 2e-3 off, with a false cusp, where the trivial
    multiplier was within 1e-4 of 1 and none was there for the fold: it is asked for as well."""
    params = {"a": 0.2, "b": 0.2, "c": 2.5}
    ring = cb.cycle(roessler, {"x": 1.0, "y": 1.0, "z": 0.0}, params, settle=300)
    cycles = cb.trace(ring, "c", within={"c": (2.5, 3.0)}, towards="up")
    line = cb.boundary(cycles.first("PD"), ("c", "a"), towards="up", steps=cb.Steps(most=1))
    problem, other = line[0].curve.problem, cycles[0]
    assert not problem.unresolved(line[0])
    moved = line[0].z.copy()
    moved[: other.x.size], moved[-1] = other.x, other["c"]
    aside = replace(line[0], z=moved)
    assert not other.problem.unresolved(other)
    assert "of PD no multiplier is there" in problem.unresolved(aside)
    assert problem.finer(aside, None, False) is not None


def test_a_curve_in_two_parameters_gets_a_finer_mesh_for_few_calls_of_the_field(tmp_path) -> None:
    """Folds of Morris and Lecar's neuron on the way to a canard explosion: with 16 intervals the
    period was 9e-4 off, as a point in doubt said, and each point took 240 calls."""
    calls = []

    def neuron(t, u, p):
        calls.append(t)
        V, w = u
        opens, rest = (1 + np.tanh((V + 1.2) / 18)) / 2, (1 + np.tanh((V - 2) / 30)) / 2
        ions = 2 * (V + 60) + 4 * opens * (V - 120) + 8 * w * (V + 84)
        return [(p["I"] - ions) / 20, p["phi"] * np.cosh((V - 2) / 60) * (rest - w)]

    start, params, few = {"V": -30.0, "w": 0.1}, {"I": 100.0, "phi": 0.04}, Collocation(16)
    ring = cb.cycle(neuron, start, params, settle=2000, collocation=few)
    fold = cb.trace(ring, "I", within={"I": (90, 101)}, towards="down").first("LP")
    calls.clear()
    line = cb.boundary(fold, ("phi", "I"), within={"phi": (0.0125, 0.04)}, towards="down")
    assert len(calls) < 130 * len(line)
    assert line["mesh"].shape[1] == 32
    assert not line.doubtful
    assert (line[-1]["phi"], line[-1]["period"]) == (0.0125, pytest.approx(321.63425, rel=1e-5))
    cb.save(tmp_path / "folds.nc", line)
    again = cb.load(tmp_path / "folds.nc", problem=ring)
    assert again[-1].solution.period == line[-1].solution.period
    # the rank that a canard all but loses is no surface of solutions
    back = cb.boundary(line[-1], ("phi", "I"), towards="up", steps=cb.Steps(most=2))
    assert len(back) == 3


def test_a_bubble_between_two_doublings_is_in_a_diagram_once() -> None:
    """Both PD are on the branch of single orbits, and the arm of each ends at the other one."""

    def roessler(t, x, p):
        out = 3.4 - p["q"] ** 2
        return [-x[1] - (1 + 0.3 * p["q"]) * x[2], x[0] + 0.2 * x[1], 0.2 + x[2] * (x[0] - out)]

    start = cb.cycle(roessler, {"x": 3.0, "y": 0.0, "z": 0.1}, {"q": 1.0}, settle=200)
    tree = cb.diagram(start, "q", within={"q": (-1.1, 1.1)}, depth=1)
    single, bubble = tree
    assert [at.kind for at in single.special] == ["EP", "PD", "PD", "EP"]
    assert [(at.place.point.label, at.branch) for at in tree.meetings] == [("PD2", 1)]
    assert bubble[-1]["q"] == pytest.approx(single.first("PD2")["q"], rel=1e-9)


def test_a_diagram_takes_windows_of_the_cycles_that_it_comes_to() -> None:
    """Circles of radius sqrt(m), whose period is 2 pi / (1 + m); the equilibrium has none."""

    def circles(t, x, p):
        r2 = x[0] ** 2 + x[1] ** 2
        grow, turn = p["m"] - r2, 1 + r2
        return [grow * x[0] - turn * x[1], grow * x[1] + turn * x[0]]

    rest = cb.equilibrium(circles, {"x": 0.0, "y": 0.0}, {"m": -0.5})
    _, cycles = cb.diagram(rest, "m", within={"m": (-1, 1), "period": (5, 7)})
    assert cycles[-1]["m"] == pytest.approx(2 * math.pi / 5 - 1, rel=1e-9)
    with pytest.raises(cb.BadInput, match="no 'perod' in this problem"):
        cb.diagram(rest, "m", within={"m": (-1, 1), "perod": (5, 7)})


def bilinear(t: Any, x: Any, p: Any) -> Any:
    return x[1], np.cos(p["w"] * t) - 0.1 * x[1] - np.where(x[0] > 0, 5.0, 1.0) * x[0]


def test_events_of_a_forced_orbit_that_a_kink_displaces_are_in_doubt_and_say_where_it_is() -> None:
    """Its mesh has no multiplier that is known to be 1: a PD had a label 0.0018 off."""

    def spring(k: float) -> Any:
        return lambda t, x, p: (x[1], np.cos(p["w"] * t) - 0.1 * x[1] - k * x[0])

    above = cb.Flow(spring(5.0), until=lambda t, x, p: x[0])
    pieces = above, cb.Flow(spring(1.0), until=lambda t, x, p: -x[0])
    starts = (
        cb.cycle(
            flows, {"x": 0.1, "v": 0.5}, {"w": 1.0}, period=lambda p: 2 * np.pi / p["w"], settle=300
        )
        for flows in (pieces, bilinear)
    )
    exact, one = (
        cb.trace(at, "w", within={"w": (0.9, 1.0)}, events=cb.period_doubling()) for at in starts
    )
    assert exact.first("PD")["w"] == pytest.approx(0.929005, abs=1e-6)
    assert [at.kind for at in one.special] == ["EP", "EP"]
    (place,) = one.doubtful
    assert abs(place["w"] - exact.first("PD")["w"]) > 1e-3
    assert "the field is not smooth at t = " in place.detail["reason"]
    assert "as a Flow with `until`" in place.detail["reason"]


@pytest.mark.slow
def test_a_fold_of_a_contact_of_hertz_s_kind_in_pieces_asks_for_intervals_and_has_its_label() -> (
    None
):
    """A tip that taps a sample; the pieces were asked for that were given. Shot by scipy."""

    def tip(force: Any) -> Any:
        return lambda t, x, p: [x[1], 0.2 * np.cos(p["w"] * t) - 0.1 * x[1] - x[0] + force(x[0])]

    deep = tip(lambda u: 40 * np.maximum(-0.95 - u, 0) ** 1.5 - 0.2)
    flows = [
        cb.Flow(deep, until=lambda t, x, p: -0.95 - x[0]),
        cb.Flow(tip(lambda u: -0.0005 / (1 + u) ** 2), until=lambda t, x, p: 0.95 + x[0]),
    ]
    at: dict[str, Any] = {"start": {"x": -0.95, "v": -1.5}, "params": {"w": 1.28}, "t0": 8.3}
    at |= {"period": lambda p: 2 * np.pi / p["w"], "settle": 60}
    few, many = (cb.cycle(flows, **at, collocation=cb.Collocation(n)) for n in (20, 160))
    (place,) = cb.trace(few, "w", within={"w": (1.28, 1.3)}).doubtful
    assert place.detail["reason"].endswith("collocation=Collocation(intervals=)")
    fold = cb.trace(many, "w", within={"w": (1.28, 1.3)}).first("LP")
    assert fold["w"] == pytest.approx(1.286242905, abs=1e-8)


def test_a_fold_that_a_kink_in_time_displaces_is_in_doubt() -> None:
    """Duffing's oscillator under a triangle wave: its label was 1.2e-4 off."""

    def under(side: Any) -> Any:
        def f(t: Any, x: Any, p: Any) -> Any:
            angle = np.real(p["w"] * t)
            drive = 2 / np.pi * np.arctan2(np.sin(angle), side(np.cos(angle)))
            return x[1], -0.2 * x[1] - x[0] - x[0] ** 3 + 0.5 * drive

        return f

    rises, falls = cb.Flow(under(np.positive), at=0.25), cb.Flow(under(np.negative), at=0.75)
    rest, at = {"x": 0.0, "v": 0.0}, {"w": 1.0}
    starts = (
        cb.cycle(flows, rest, at, period=lambda p: 2 * np.pi / p["w"], settle=100)
        for flows in ([rises, falls], under(abs))
    )
    exact, one = (cb.trace(start, "w", within={"w": (1.0, 2.4)}) for start in starts)
    fold, _ = (point["w"] for point in exact.special if point.kind == "LP")
    assert not exact.doubtful
    assert [point.kind for point in one.special] == ["EP", "LP", "EP"]
    (place,) = one.doubtful
    assert place["w"] != pytest.approx(fold, abs=5e-5)
    assert "no multiplier is there" in place.detail["reason"]
    assert "with `at` where a clock decides" in place.detail["reason"]


@pytest.mark.parametrize("width", [1e-1, 1e-2, 1e-3, 1e-4, 0.0])
def test_a_kink_is_what_no_halving_of_the_time_resolves(width: float) -> None:
    def motion(t: Any) -> Any:
        return np.array([np.cos(t), -np.sin(t)])

    def field(t: Any, x: Any, p: Any) -> Any:
        return x[1], np.hypot(x[0] - 0.3, width)

    found = kink(field, motion, np.linspace(0.0, 2 * np.pi, 81), {})
    assert (found is None) == (width > 1e-3)
    if found is not None:
        assert found[1][0] == pytest.approx(0.3, abs=1e-3)


def test_rounding_along_a_tiny_orbit_is_no_kink() -> None:
    def motion(t: Any) -> Any:
        return np.array([20 + 1e-7 * np.cos(t), 3 + 3e-9 * np.sin(t)])

    def field(t: Any, x: Any, p: Any) -> Any:
        return x[1] ** 3 - 27, 8000 - x[0] ** 3

    assert kink(field, motion, np.linspace(0.0, 2 * np.pi, 81), {}) is None


def test_a_branch_sets_out_both_ways_from_a_start_far_from_where_it_was_last() -> None:
    """Cells that divide (Novak and Tyson), with one fast state: from slopes far off those inside
    an interval of the start have another root. Its period is by `solve_ivp`."""

    def rates(t, x, p):
        X, Y, A, m = x
        make = (1 + 10 * A) * (1 - Y) / (1.04 - Y) - 35 * m * X * Y / (0.04 + Y)
        fourth = (m * X) ** 4
        more = 0.005 + 0.2 * fourth / (0.3**4 + fourth) - 0.1 * A
        return [0.04 - (0.04 + Y) * X, make, more, 0.005 * m * (1 - m / 10)]

    def split(t, x, p):
        return [*x[:3], p["share"] * x[3]]

    grows = cb.Flow(rates, until=lambda t, x, p: 0.2 - x[0])
    divides = cb.Flow(rates, until=lambda t, x, p: x[0] - 0.1, reset=split)
    begin, mesh = {"X": 0.0999999, "Y": 0.67, "A": 0.5, "m": 0.4}, Collocation(120, 12)
    cells = cb.cycle([grows, divides], begin, {"share": 0.5}, settle=200, collocation=mesh)
    branch = cb.trace(cells, "share", within={"share": (0.2, 0.501)})
    assert branch["share"][[0, -1]].tolist() == [0.2, 0.501]

    state, t = branch[-1].solution.states(0.0).copy(), 0.0
    for gate, way in ((0.2, 1), (0.1, -1)):
        at = partial(lambda t, x, gate: x[0] - gate, gate=gate)
        at.terminal, at.direction = True, way
        leg = partial(rates, p={})
        run = solve_ivp(leg, (t, 500), state, "LSODA", rtol=1e-11, atol=1e-13, events=at)
        state, t = run.y[:, -1], run.t[-1]
    assert t == pytest.approx(branch[-1]["period"], rel=1e-7)


@pytest.mark.parametrize(
    ("power", "least", "most"), [(1.0, 60, 60), (1.25, 60, 60), (1.5, 60, 60), (2.0, 0, 0)]
)
def test_a_field_that_sets_in_as_a_root_is_not_smooth(power: float, least: int, most: int) -> None:
    """As Hertz's force behind a gap, with the derivative a root: halving went past six in seven."""

    def motion(t: Any) -> Any:
        return np.array([np.cos(t), -np.sin(t)])

    def field(t: Any, x: Any, p: Any) -> Any:
        return x[1], np.where(x[0] > p["gap"], abs(x[0] - p["gap"]) ** power, 0.0)

    gaps, times = np.linspace(-0.8, 0.8, 60), np.linspace(0.0, 2 * np.pi, 81)
    found = [(gap, kink(field, motion, times, {"gap": gap})) for gap in gaps]
    off = [at[1][0] - gap for gap, at in found if at]
    assert least <= len(off) <= most
    np.testing.assert_allclose(off, 0.0, atol=1e-3)


def test_a_front_beside_a_long_interval_is_no_kink() -> None:
    """As of van der Pol at mu = 40: there was one, in a field of polynomials."""

    def motion(t: Any) -> Any:
        return np.array([np.tanh(t / 0.01)])

    times = np.concatenate([[-1.0], np.linspace(-0.08, 0.08, 65), [1.0]])
    assert kink(lambda t, x, p: x - x**3, motion, times, {}) is None


def test_where_a_field_has_no_values_beside_an_orbit_it_is_not_said_to_have_a_kink() -> None:
    def tank(t: Any, x: Any, p: Any) -> Any:
        if np.any(np.real(x[0]) < p["least"]):
            raise ValueError("the tank is empty")
        return 1.0 - np.sqrt(x[0]) + 0.3 * np.cos(t), x[0] - x[1]

    start = cb.cycle(
        tank, {"x": 1.0, "y": 1.0}, {"least": 0.0}, period=lambda p: 2 * np.pi, settle=100
    )
    orbit = cb.flows.cycle_of(start)
    empty = replace(orbit, params={"least": 1.001 * orbit.min["x"]})
    assert empty.kink == ""


def test_rounding_that_grows_along_intervals_at_rest_does_not_end_a_branch() -> None:
    """Before a saddle-node on a circle, from which perturbations grow, a branch ended as MX with
    intervals that were "too long for its flow". The period is 2 pi/sqrt(m^2 - 1)."""

    def rest(t: Any, x: Any, p: Any) -> Any:
        square = x[0] ** 2 + x[1] ** 2
        turn = p["m"] - x[0] / np.sqrt(square)
        return x[0] * (1 - square) - x[1] * turn, x[1] * (1 - square) + x[0] * turn, 2 * x[2] - x[1]

    w = np.sqrt(1.002**2 - 1)
    times = np.linspace(0, 2 * np.pi / w, 2001)

    def angle(t: Any) -> Any:
        return 2 * np.arctan(w / 2.002 * np.tan(w * t / 2))

    back = solve_ivp(  # on the circle it is attracting
        lambda t, z: 2 * z - np.sin(angle(t)), (times[-1] + 25, 0), [0.0], rtol=1e-10, atol=1e-12,
        max_step=0.5, dense_output=True,
    )  # fmt: skip
    around = angle(times)
    samples = np.array([np.cos(around), np.sin(around), back.sol(times)[0]])
    start = cb.cycle(rest, (times, samples), {"m": 1.002})
    slow = cb.trace(start, "m", within={"m": (1.0003, 1.003)}, events=())[0]
    assert slow["period"] == pytest.approx(2 * np.pi / np.sqrt(slow["m"] ** 2 - 1), rel=1e-9)
    assert slow["m"] == 1.0003
