"""The smooth chain (21), (22) against energy, formulas written out again, and the hard walls."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from contbreather.continuation import Steps, trace
from contbreather.errors import NotConverged
from contbreather.lattice import Fourier
from contbreather.orbits import symmetric
from contbreather.orbits.closure import smallest_amplitude
from contbreather.simulation import Sample, periodic, simulate_smooth, variation
from contbreather.simulation.states import damping_of
from tests.simulation.zoo import breather

FIGURE5 = {"a": 0.1, "gamma": 0.08, "k": 0.8, "damping": 0.005}


def test_lambda_of_the_paper_from_its_restitution():
    assert damping_of(0.8) == pytest.approx(0.141700600391, abs=1e-12)
    assert math.exp(
        -math.pi * damping_of(0.4) / (2 * math.sqrt(1 - damping_of(0.4) ** 2 / 4))
    ) == pytest.approx(0.4, abs=1e-15)
    for k in (0.0, 0.1, 0.8, 1.0):
        run = simulate_smooth(([0.0], [0.0]), a=0.0, gamma=0.0, k=k, m=6, periods=0)
        assert run.conditions.k == pytest.approx(k, abs=1e-15)


@pytest.mark.parametrize(("m", "tolerance"), [(6, 1e-3), (20, 1e-6), (60, 1e-9)])
def test_single_wall_gives_back_the_velocity_times_k(m, tolerance):
    """One site thrown at its wall: (22), the deeper in the middle the flight ends the better."""
    run = simulate_smooth(([0.0], [1.0]), a=0.0, gamma=0.0, k=0.8, m=m, periods=0.3)
    assert run.final.v[0] == pytest.approx(-0.8, abs=tolerance)


DRIVES = {
    None: lambda t: -math.cos(t),
    Fourier(cos={0: 0.05, 1: -1.0, 2: 0.2}, sin={4: 0.1}): lambda t: (
        0.05 - math.cos(t) + 0.2 * math.cos(2 * t) + 0.1 * math.sin(4 * t)
    ),
}


@pytest.mark.parametrize("forcing", DRIVES)
@pytest.mark.parametrize("m", [6.0, 7.3])
def test_motion_is_equation_21_with_the_sign_of_13(m, forcing):
    rng = np.random.default_rng(0)
    start = np.concatenate([rng.uniform(-0.9, 0.9, 5), rng.normal(size=5)])
    on = {"a": 0.3, "gamma": 0.2, "lam": 0.14, "damping": 0.02, "spring": 0.4, "forcing": forcing}

    def slope(t, y):
        u, v = np.split(y, 2)
        coupling = 0.2 * (2 * u - np.roll(u, 1) - np.roll(u, -1))
        wall = 0.14 * (2 * m + 1) * np.abs(u) ** (2 * m) * v
        wall += (2 * m + 1) * np.abs(u) ** (4 * m) * u
        force = 0.3 * DRIVES[forcing](t)
        return np.concatenate([v, force - coupling - 0.4 * u - 0.02 * v - wall])

    span = (0.7, 0.7 + 2 * math.pi)
    wanted = solve_ivp(slope, span, start, "DOP853", rtol=1e-12, atol=1e-13, max_step=0.1)
    run = simulate_smooth(np.split(start, 2), **on, m=m, periods=1, t0=0.7, tolerance=1e-12)
    assert np.allclose(np.concatenate(run.final), wanted.y[:, -1], rtol=0, atol=1e-9)


@pytest.mark.parametrize(("sites", "m"), [(1, 6.0), (2, 7.5), (5, 20.0)])
def test_variation_is_the_derivative_of_the_run_wherever_it_begins(sites, m):
    rng = np.random.default_rng(1)
    x = np.concatenate([rng.uniform(-1.05, 1.05, sites), rng.normal(size=sites)])
    on = {"a": 0.3, "gamma": 0.2, "lam": 0.14, "m": m, "damping": 0.02, "spring": 0.4, "t0": 0.7}

    def end(x):
        run = simulate_smooth(np.split(x, 2), **on, periods=0.4, tolerance=1e-13)
        return np.concatenate(run.final)

    steps = 1e-5 * np.eye(2 * sites)
    wanted = np.array([(end(x + step) - end(x - step)) / 2e-5 for step in steps]).T
    matrix = variation(simulate_smooth(np.split(x, 2), **on, periods=0.4))
    assert np.allclose(matrix, wanted, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("m", [6, 50])
def test_a_finer_tolerance_is_a_finer_solution(m):
    state = symmetric(0.5, 0.08, 0.8).state(6)
    conditions = {"a": 0.5, "gamma": 0.08, "k": 0.8, "m": m, "periods": 1}
    sample = Sample(sites=(0, 1), per_period=7)
    fine = simulate_smooth(state, **conditions, tolerance=1e-13, sample=sample)
    off = []
    for tolerance in (1e-4, 1e-8):
        other = simulate_smooth(state, **conditions, tolerance=tolerance, sample=sample)
        pairs = (fine.final, other.final), (fine.record.u, other.record.u)
        off.append(max(np.abs(np.subtract(*pair)).max() for pair in pairs))
    assert off[1] < 2e-6
    assert off[1] < 0.1 * off[0]


def test_samples_do_not_change_the_run():
    state = symmetric(0.5, 0.08, 0.8).state(6)
    conditions = {"a": 0.5, "gamma": 0.08, "k": 0.8, "m": 6, "periods": 2.25, "t0": 1.0}
    plain = simulate_smooth(state, **conditions)
    dense = simulate_smooth(state, **conditions, sample=Sample((0, 3), 40))
    assert np.array_equal(plain.final.u, dense.final.u)
    assert dense.record.times[0] == 1.0
    assert np.array_equal(dense.record.u[40], dense.strobe.u[1, [0, 3]])
    assert plain.end == pytest.approx(1.0 + 4.5 * math.pi)


# --- periodic motions -----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def figure5():
    start = breather(20, m=6, **FIGURE5)
    return start.problem


def test_derivatives_of_the_shooting_problem_are_those_of_its_residual(figure5):
    x, params = figure5.x, dict(figure5.params)
    rng = np.random.default_rng(0)
    direction = rng.normal(size=x.size)

    def along(h):
        return figure5.residual(x + h * direction, params)

    wanted = (along(1e-5) - along(-1e-5)) / 2e-5
    assert np.allclose(figure5.jacobian(x, params) @ direction, wanted, rtol=1e-5, atol=1e-5)
    for name in ("a", "gamma", "lam", "m", "damping", "spring"):
        h = 1e-4 if name == "m" else 1e-5
        plus = figure5.residual(x, {**params, name: params[name] + h})
        minus = figure5.residual(x, {**params, name: params[name] - h})
        given = figure5.sensitivity(x, params, name)
        assert np.allclose(given, (plus - minus) / (2 * h), rtol=1e-4, atol=1e-6), name


def test_variation_of_a_smooth_run_gives_the_multipliers(figure5):
    state = figure5.start["u"], figure5.start["v"]
    run = simulate_smooth(state, m=6, **FIGURE5, periods=1)
    matrix, vector = variation(run), np.random.default_rng(1).normal(size=(40, 1))
    assert np.allclose(variation(run, vector), matrix @ vector, atol=1e-8)
    assert np.abs(np.linalg.eigvals(matrix)).max() == pytest.approx(0.993700, abs=1e-6)


def test_smooth_branch_in_m_leads_to_the_impacting_ring():
    """Distance to the damped impacting breather falls like 1/m; multipliers agree in the limit."""
    state = symmetric(0.1, 0.08, 0.8).state(20)
    hard = periodic(state, **FIGURE5, symmetric=True)
    start = periodic(state, m=20, **FIGURE5, symmetric=True)
    steps = Steps(largest=4.0, first=1.0)
    branch = trace(start, "m", within={"m": (6, 400)}, steps=steps, towards="up")
    gap = np.abs(branch["u"][:, 0] - hard.state.u[0]) * branch["m"]
    assert branch["m"][-1] == pytest.approx(400)
    assert gap[-1] == pytest.approx(0.2778, abs=2e-4)
    assert gap[-1] == pytest.approx(gap[-4], rel=1e-3)
    assert branch[-1]["largest"] == pytest.approx(hard.largest, abs=1e-4)


@pytest.mark.slow
def test_smooth_breather_is_lost_where_a_pair_leaves_the_circle():
    """a = 0.1, m = 6: at gamma = 0.0927; Fig. 6 (a) at 0.104 is beyond, Fig. 5 at 0.08 is not."""
    before, beyond = (breather(20, m=6, **{**FIGURE5, "gamma": g}) for g in (0.09, 0.104))
    branch = trace(before, "gamma", within={"gamma": (0.09, 0.093)}, towards="up")
    found = branch.first("NS")
    assert found["gamma"] == pytest.approx(0.0927473, abs=1e-6)
    assert found["largest"] == pytest.approx(1.0, abs=1e-7)
    assert breather(20, m=6, **FIGURE5).largest < 1.0
    assert beyond.largest == pytest.approx(1.0110, abs=1e-4)  # growth of Fig. 6 (a)


@pytest.mark.slow
def test_smooth_branch_in_a_has_a_fold_near_that_of_the_exact_one():
    """Down from a = 0.1: the fold of m = 6 at 0.0726, of rigid walls, undamped, at 0.0601."""
    start = breather(20, m=6, **FIGURE5)
    branch = trace(start, "a", within={"a": (0.05, 0.1)}, towards="down")
    assert branch.first("LP")["a"] == pytest.approx(0.0726, abs=1e-4)
    exact = smallest_amplitude(0.08, 0.8)
    assert 0.0 < branch.first("LP")["a"] - exact < 0.02


def test_energy_that_blows_up_is_an_error():
    with pytest.raises(NotConverged, match="the energy blows up in period 1"):
        simulate_smooth(([0.0], [0.0]), a=1e8, gamma=0.0, k=0.8, m=2, periods=50)


def test_a_smooth_motion_that_blows_up_is_no_equation_to_the_engine() -> None:
    on = {"a": 0.2, "gamma": 0.04, "k": 0.8, "m": 6, "damping": 0.1}
    state = simulate_smooth(symmetric(0.2, 0.04, 0.8).state(4), **on, periods=100).final
    problem = periodic(state, **on).problem
    backwards = {**problem.params, "damping": -1e4}  # amplifies by exp(1e4) in a unit of time
    with pytest.raises(ArithmeticError, match="dop853 cannot go on at t = "):
        problem.residual(np.concatenate(state), backwards)
