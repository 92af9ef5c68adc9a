"""Perturbations carried along a run against matrices, differences and the exact multipliers."""

from __future__ import annotations

import math

import numpy as np
import pytest

from contbreather.errors import BadInput
from contbreather.lattice import Ring
from contbreather.orbits import symmetric
from contbreather.simulation import lyapunov, periodic, simulate, variation
from tests.simulation.zoo import breather


def test_variation_is_the_derivative_of_the_run():
    """Damped, four sites, other sites' impacts, chatter and rests on the way; without rests it is
    that of an integrator in test_lattices."""
    rng = np.random.default_rng(1)
    x = np.concatenate([rng.uniform(-0.8, 0.8, 4), rng.normal(size=4)])
    conditions = {"a": 1.5, "gamma": 0.2, "k": 0.1, "damping": 0.3, "periods": 0.7}

    def image(x):
        return simulate(np.split(x, 2), **conditions)

    run, h = image(x), 1e-6
    assert len(run.rests) > 0
    assert len(run.impacts) >= 5
    steps = h * np.eye(8)
    ends = [[np.concatenate(image(x + s * e).final) for s in (1, -1)] for e in steps]
    differences = np.array([(plus - minus) / (2 * h) for plus, minus in ends]).T
    assert np.abs(variation(run) - differences).max() < 1e-7


def test_variation_of_chosen_vectors_is_the_matrix_times_them():
    run = simulate(symmetric(0.5, 0.08, 0.8).state(6), a=0.5, gamma=0.08, k=0.8, periods=2)
    vectors = np.random.default_rng(0).normal(size=(12, 3))
    assert np.allclose(variation(run, vectors), variation(run) @ vectors, rtol=0, atol=1e-12)
    with pytest.raises(BadInput, match=r"columns of length 12; an array of shape \(6, 3\)"):
        variation(run, vectors[:6])


@pytest.mark.slow
def test_exponents_of_a_damped_attractor_are_its_multipliers():
    conditions = {"a": 0.3, "gamma": 0.08, "k": 0.8, "damping": 0.05}
    orbit = breather(6, **conditions)
    wanted = np.log(np.abs(orbit.multipliers)) / (2 * math.pi)
    found = lyapunov(orbit.state, **conditions, periods=4000, settle=100, count=12)
    assert np.allclose(found.exponents, np.sort(wanted)[::-1], rtol=0, atol=2e-4)
    # the sum is exact: damping on every site, and k^2 at each of two impacts in a period
    total = -0.05 * 6 + 2 * math.log(0.8**2) / (2 * math.pi)
    assert found.exponents.sum() == pytest.approx(total, abs=1e-10)


def test_chaos_has_a_positive_exponent_and_the_same_from_any_perturbation():
    state = ([0.1], [0.3])
    conditions = {"a": 2.0, "gamma": 0.0, "k": 0.95, "periods": 1500, "settle": 100}
    one = lyapunov(state, **conditions, count=1, seed=1)
    two = lyapunov(state, **conditions, count=1, seed=2)
    assert one.exponents[0] > 0.2
    assert one.exponents[0] == pytest.approx(two.exponents[0], abs=1e-6)


# --- periodic motions -----------------------------------------------------------------------------


def test_without_damping_the_periodic_motion_is_the_exact_breather():
    own = symmetric(0.5, 0.08, 0.8, lattice=Ring(10))
    u, v = own.state(10)
    found = periodic((u + 1e-3, v), a=0.5, gamma=0.08, k=0.8, symmetric=True)
    assert np.abs(found.state.u - u).max() < 1e-11
    mine = np.sort_complex(np.round(found.half, 9))
    exact = np.sort_complex(np.round(own.multipliers(half=True), 9))
    assert np.allclose(mine, exact, rtol=0, atol=1e-8)


@pytest.mark.parametrize("periods", [50, 2000])  # of which the first weights are below 1e-308
def test_direction_that_walls_without_restitution_annihilate_has_an_exact_exponent(periods):
    found = lyapunov(([0.1], [0.3]), a=2.0, gamma=0.0, k=0.0, periods=periods, settle=10, count=2)
    assert found.exponents[1] == -np.inf
    assert found.error[1] == 0.0
