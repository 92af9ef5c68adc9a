"""Sites that rest on a wall while others swing under damping, against an independent integrator."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import contbreather as cb
from contbreather.dynamics import Sample, simulate, variation
from contbreather.dynamics.resting import _add_shifted

PI = math.pi


@pytest.mark.parametrize("damping", [0.0, 0.05, 0.7])
@pytest.mark.parametrize("k", [0.0, 0.3])
@pytest.mark.parametrize("wall", [1, -1])
def test_a_resting_site_is_a_fixed_end_of_the_others_under_any_damping(wall, k, damping) -> None:
    gamma, a, t0 = 0.1, 2.0, (0.75 if wall > 0 else 1.75) * PI
    u, v = wall * np.array([1.0, -0.2, 0.1]), wall * np.array([0.0, -2.0, -1.9])
    shared = {"a": a, "gamma": gamma, "k": k, "damping": damping}
    run = simulate((u, v), periods=0.05, t0=t0, **shared)
    assert (run.final.u[0], run.final.v[0]) == (wall, 0.0)
    assert not run.impacts.size

    def slope(t, x):
        force = -a * np.cos(t)
        left = force - gamma * (2 * x[0] - wall - x[1]) - damping * x[2]
        right = force - gamma * (2 * x[1] - wall - x[0]) - damping * x[3]
        return [x[2], x[3], left, right]

    start = [*u[1:], *v[1:]]
    swing = solve_ivp(slope, (t0, t0 + 0.1 * PI), start, rtol=1e-12, atol=1e-14).y[:, -1]
    assert run.final.u[1:] == pytest.approx(swing[:2], abs=1e-11)
    assert run.final.v[1:] == pytest.approx(swing[2:], abs=1e-11)


@pytest.mark.parametrize("damping", [0.0, 0.3])
def test_small_changes_beside_a_resting_site_are_those_of_the_fixed_end(damping: float) -> None:
    gamma, a, t0 = 0.1, 2.0, 0.75 * PI
    u, v = np.array([1.0, -0.2, 0.1]), np.array([0.0, -2.0, -1.9])
    shared = {"a": a, "gamma": gamma, "k": 0.3, "damping": damping}
    matrix = variation(simulate((u, v), periods=0.05, t0=t0, **shared))
    stiff = gamma * np.array([[2.0, -1.0], [-1.0, 2.0]])
    block = np.block([[np.zeros((2, 2)), np.eye(2)], [-stiff, -damping * np.eye(2)]])
    swing = solve_ivp(
        lambda t, x: (block @ x.reshape(4, 4)).ravel(), (0.0, 0.1 * PI), np.eye(4).ravel(),
        rtol=1e-12, atol=1e-14,
    ).y[:, -1].reshape(4, 4)  # fmt: skip
    free = [1, 2, 4, 5]
    assert matrix[np.ix_(free, free)] == pytest.approx(swing, abs=1e-10)
    assert matrix[[0, 3]] == pytest.approx(np.zeros((2, 6)), abs=1e-14)
    assert matrix[:, [0, 3]] == pytest.approx(np.zeros((6, 2)), abs=1e-14)


@pytest.mark.parametrize("damping", [0.0, 0.1])
@pytest.mark.parametrize("sites", [1, 2, 5])
def test_samples_are_the_run_at_their_own_times(sites: int, damping: float) -> None:
    """Each sample is the end of a run as long as until then: impacts before it included."""
    shared = {"a": 0.5, "gamma": 0.08 if sites > 1 else 0.0, "k": 0.8, "damping": damping}
    state = cb.symmetric(0.5, shared["gamma"], 0.8).state(sites, 0.5)
    count = 8
    run = simulate(state, periods=2, t0=0.5, sample=Sample(tuple(range(sites)), count), **shared)
    assert run.record is not None
    for j in range(2 * count):
        there = simulate(state, periods=j / count, t0=0.5, **shared)
        assert run.record.u[j] == pytest.approx(there.final.u, abs=1e-10)
        assert run.record.v[j] == pytest.approx(there.final.v, abs=1e-10)
        assert run.record.times[j] == pytest.approx(there.end, abs=1e-12)


@pytest.mark.parametrize("shift", [0.0, 0.3, -0.8])
def test_a_column_of_powers_is_added_about_a_later_time(shift: float) -> None:
    rows, out = np.random.default_rng(1).normal(size=(7, 3)), np.ones((7, 2))
    known = rows.copy()
    _add_shifted(rows, 1, shift, 0.7, out)
    x = np.linspace(-1.0, 1.0, 9)
    moved = np.polynomial.Polynomial(rows[:, 1])(x + shift)
    found = np.polynomial.Polynomial(out[:, 0] - 1.0)(x)
    np.testing.assert_allclose(found, 0.7 * moved, atol=1e-13)
    assert (rows == known).all()
    assert (out[:, 1] == 1.0).all()
