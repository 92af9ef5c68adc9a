"""Slow sweeps against the continued branch; measures of localisation; basins."""

from __future__ import annotations

import math
from concurrent.futures import BrokenExecutor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context

import numpy as np
import pytest

import contbreather.simulation as sim
from contbreather.continuation import trace
from contbreather.errors import NotConverged
from contbreather.lattice import Fourier
from contbreather.orbits import symmetric
from tests.simulation.zoo import breather

DAMPED = {"gamma": 0.05, "k": 0.8, "damping": 0.02}


@pytest.fixture(scope="module")
def orbit():
    state = symmetric(0.2, 0.05, 0.8).state(20)
    return sim.periodic(state, a=0.2, **DAMPED, symmetric=True)


# --- sweeps ---------------------------------------------------------------------------------------


@pytest.mark.slow
def test_breather_is_lost_at_the_fold_of_its_branch_the_later_the_faster(orbit):
    branch = trace(orbit, "a", towards="down", within={"a": (0.05, 0.3)})
    fold = branch.first("LP")["a"]
    values = np.arange(0.09, 0.08, -0.0005)
    delays = []
    for periods in (10, 50, 400):
        down = sim.sweep(orbit.state, "a", values, periods=periods, a=0.2, **DAMPED)
        delays.append(fold - down.lost())
    assert all(delay > 0.0 for delay in delays)
    assert delays[0] > delays[1] >= delays[2]
    assert delays[2] < 0.001


def test_sweep_follows_the_branch_until_then(orbit):
    branch = trace(orbit, "a", towards="down", within={"a": (0.1, 0.3)})
    point = branch[-1]
    down = sim.sweep(orbit.state, "a", [0.15, 0.12, 0.1], periods=400, a=0.2, **DAMPED)
    assert point["a"] == pytest.approx(0.1)
    assert np.allclose(down.u[-1], point["u"], rtol=0, atol=1e-6)
    hit = point.solution.run().impacts[-1]
    assert down.p[-1] == pytest.approx(0.5 * (abs(hit["before"]) + abs(hit["after"])), abs=1e-6)
    assert down.change[-1] < 1e-6


def test_lost_breather_does_not_come_back_on_the_way_up(orbit):
    """Hysteresis: below the fold the ring comes to rest, and stays so where the breather lives."""
    loop = sim.there_and_back(np.arange(0.12, 0.06, -0.004))
    run = sim.sweep(orbit.state, "a", loop, periods=100, a=0.2, **DAMPED)
    down, up = run.p[: len(loop) // 2 + 1], run.p[len(loop) // 2 :][::-1]
    assert loop[0] == loop[-1]
    assert down[0] > 0.5
    assert np.all(up == 0.0)
    assert run.lost() < 0.0863


def test_a_breather_with_one_wall_is_lost_where_its_impacts_end():
    on = {"gamma": 0.05, "k": 0.9, "damping": 0.03, "spring": 0.3, "walls": (None, 1.0)}
    start = np.zeros(8), np.zeros(8)
    start[0][0], start[1][0] = 0.9, 1.0
    state = sim.simulate(start, a=0.4, **on, periods=200).final
    down = sim.sweep(state, "a", [0.4, 0.3, 0.2, 0.05, 0.01], **on, periods=100)
    quiet = down.impacts == 0.0
    assert np.all(down.impacts[~quiet] == 1.0)
    assert not quiet[:3].any()
    assert down.lost() == down.value[quiet][0]


def test_upward_sweep_loses_the_breather_where_the_neighbour_grazes():
    """gamma = 0.04: past the pitchfork on its asymmetric arm, until a = 0.877387 (no damping)."""
    conditions = {"gamma": 0.04, "k": 0.8, "damping": 0.01}
    start = breather(10, a=0.7, **conditions)
    up = sim.sweep(start.state, "a", np.arange(0.7, 0.9, 0.005), periods=400, a=0.7, **conditions)
    assert up.lost() == pytest.approx(0.8774, abs=0.006)
    tilted = np.abs(up.tilt) > 0.01
    assert up.value[tilted][0] == pytest.approx(0.7776, abs=0.01)
    assert np.all(np.abs(up.tilt[up.value < 0.77]) < 1e-6)


@pytest.mark.slow
def test_sweep_in_gamma_meets_the_torus_where_the_branch_has_it():
    """A pair of multipliers leaves the circle at gamma = 0.08320; beyond the states do not repeat,
    and further on the torus is lost."""
    conditions = {"a": 0.1, "k": 0.8, "damping": 0.005}
    start = breather(20, gamma=0.08, **conditions)
    branch = trace(start, "gamma", within={"gamma": (0.07, 0.1)}, towards="up")
    border = branch.first("NS")["gamma"]
    values = np.arange(0.082, 0.088, 0.0005)
    up = sim.sweep(start.state, "gamma", values, periods=2000, gamma=0.08, **conditions)
    unsteady = up.value[up.change > 1e-3]
    assert border < unsteady[0] < border + 0.001
    assert 0.084 < up.lost() < 0.088


def test_other_parameters_can_be_swept_forcing_included(orbit):
    for name, value in (("gamma", 0.06), ("k", 0.75), ("damping", 0.03)):
        seen = sim.sweep(orbit.state, name, [value], periods=20, a=0.2, **DAMPED)
        run = sim.simulate(orbit.state, periods=20, **{**DAMPED, "a": 0.2, name: value})
        assert np.array_equal(seen.final.u, run.final.u)
    forcing = Fourier(cos={1: -1.0, 3: 0.0})
    seen = sim.sweep(orbit.state, "c3", [0.1], periods=20, a=0.2, **DAMPED, forcing=forcing)
    run = sim.simulate(orbit.state, periods=20, a=0.2, **DAMPED, forcing=forcing.at(c3=0.1))
    assert np.array_equal(seen.final.u, run.final.u)


def test_smooth_ring_is_swept_in_its_own_parameters():
    state = symmetric(0.3, 0.05, 0.8).state(6)
    for name, value in (("m", 20.0), ("lam", 0.2), ("a", 0.29)):
        seen = sim.sweep(state, name, [value], periods=3, a=0.3, **DAMPED, m=10)
        assert math.isnan(seen.impacts[0])
        assert math.isnan(seen.lost())


def test_the_swept_parameter_may_be_left_out(orbit):
    given = sim.sweep(orbit.state, "a", [0.2, 0.19], periods=5, a=0.7, **DAMPED)
    left_out = sim.sweep(orbit.state, "a", [0.2, 0.19], periods=5, **DAMPED)
    assert np.array_equal(given.p, left_out.p)


# --- localisation ---------------------------------------------------------------------------------


def test_participation_counts_the_sites_that_take_part():
    for count in (1, 3, 8):
        v = np.zeros(8)
        v[:count] = 1.0
        assert sim.localisation(np.zeros(8), v, a=0.0, gamma=0.0).participation == pytest.approx(
            count
        )


def test_forced_motion_counts_for_nothing():
    """Damped and with several harmonics: the response of the zero mode, from a simulation."""
    forcing = Fourier(cos={1: -1.0, 3: 0.5}, sin={1: 0.3})
    conditions = {"a": 0.3, "gamma": 0.1, "damping": 0.2, "forcing": forcing}
    run = sim.simulate((np.zeros(4), np.zeros(4)), k=0.8, periods=60.3, **conditions)
    energy = sim.localisation(*run.final, run.end, **conditions).energy
    assert not run.impacts.size
    assert energy.max() < 1e-20


@pytest.mark.parametrize("gamma", [0.02, 0.1, 0.2])
def test_decay_is_that_of_the_first_harmonic(gamma):
    """(A3): from site to site by ``4 gamma/(1 + sqrt(1 - 4 gamma))^2``, harmonics faster."""
    state = symmetric(0.4, gamma, 0.8).state(40)
    run = sim.simulate(
        state, a=0.4, gamma=gamma, k=0.8, periods=1, sample=sim.Sample(range(40), 64)
    )
    seen = sim.localisation(run.record.u, run.record.v, run.record.times, a=0.4, gamma=gamma)
    assert seen.decay() == pytest.approx(4 * gamma / (1 + math.sqrt(1 - 4 * gamma)) ** 2, rel=0.12)
    assert np.all(seen.centre == 0)


# --- basins ---------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def basin():
    conditions = {"a": 0.12, "gamma": 0.08, "k": 0.8, "damping": 0.02}
    start = breather(10, **conditions)
    u0, v0 = start.state.u[0], start.state.v[0]
    x = sim.Axis("u", 0, [-1.2, u0, u0 + 0.02, 0.9])
    y = sim.Axis("v", 0, [v0, v0 + 0.02, 0.05])
    return start, x, y, {**conditions, "periods": 400}


def test_starts_near_an_attractor_return_and_others_do_not(basin):
    start, x, y, conditions = basin
    found = sim.attraction(start.state, x, y, **conditions, executor=1)
    assert found.complete
    assert np.all(found.outcome[:, 0] == sim.Outcome.OUTSIDE)
    assert np.all(found.outcome[:2, 1:3] == sim.Outcome.RETURNED)
    assert found.outcome[2, 3] == sim.Outcome.QUIET
    assert found.distance[0, 1] < 1e-9
    assert 0.0 < found.share < 1.0


def test_starts_whose_impacts_are_all_over_the_ring_have_spread():
    conditions = {"a": 0.7, "gamma": 0.104, "k": 0.8, "damping": 0.005}
    start, kicks = symmetric(0.5, 0.08, 0.8).state(12), [-1.5, 1.5]
    axes = sim.Axis("v", 3, kicks), sim.Axis("v", 6, kicks)
    found = sim.attraction(start, *axes, periods=60, executor=1, **conditions)
    assert found.complete
    assert np.all(found.outcome == sim.Outcome.SPREAD)


@pytest.mark.slow
def test_picture_does_not_depend_on_who_computes_it(basin):
    start, x, y, conditions = basin
    alone = sim.attraction(start.state, x, y, **conditions, executor=1)
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        shared = sim.attraction(start.state, x, y, **conditions, executor=pool)
    assert np.array_equal(alone.outcome, shared.outcome)
    assert np.array_equal(alone.distance, shared.distance, equal_nan=True)


class Dying(ThreadPoolExecutor):
    """Its workers are killed after some rows."""

    def __init__(self, rows):
        super().__init__(1)
        self.rows = rows

    def submit(self, call, *args):
        self.rows -= 1
        return super().submit(call, *args) if self.rows >= 0 else self.broken()

    def broken(self):
        lost = Future()
        lost.set_exception(BrokenExecutor("a worker was terminated abruptly"))
        return lost


def test_rows_done_before_the_workers_died_are_kept(basin):
    start, x, y, conditions = basin
    with Dying(1) as pool:
        found = sim.attraction(start.state, x, y, **conditions, executor=pool)
    assert not found.complete
    assert np.all(found.outcome[0] != sim.Outcome.PENDING)
    assert np.all(found.outcome[1:] == sim.Outcome.PENDING)


def test_workers_that_never_answer_are_an_error_that_says_so(basin):
    start, x, y, conditions = basin
    with Dying(0) as pool, pytest.raises(NotConverged, match="workers of the executor ended"):
        sim.attraction(start.state, x, y, **conditions, executor=pool)
