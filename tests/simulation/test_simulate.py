"""The impacting ring against the exact breather, a general ODE solver, and laws of mechanics."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from contbreather import switch, trace
from contbreather.errors import BadInput, NotConverged
from contbreather.lattice import Ring
from contbreather.lattice.finite import OpenChain
from contbreather.orbits import symmetric
from contbreather.simulation import (
    Axis,
    RunStop,
    Sample,
    attraction,
    periodic,
    simulate,
    simulate_smooth,
)

PI = math.pi


# --- the exact breather ---------------------------------------------------------------------------


def test_an_orbit_brings_its_state_and_its_parameters_but_for_those_that_are_given():
    own = {"forcing": "cos(t)+0.1*cos(3*t)", "lattice": OpenChain(7), "damping": 0.03}
    orbit = symmetric(0.6, 0.04, 0.8, site=3, walls=(-1.2, 1.2), **own)
    on = {"a": 0.6, "gamma": 0.04, "k": 0.8, "walls": (-1.2, 1.2), **own}
    for t0, other in ((0.0, {}), (1.7, {}), (0.3, {"k": 0.7, "damping": 0.0})):
        run = simulate(orbit, periods=2.5, t0=t0, **other)
        alike = simulate(orbit.state(t=t0), periods=2.5, t0=t0, **{**on, **other})
        assert run.conditions == alike.conditions
        np.testing.assert_array_equal(run.final.u, alike.final.u)
    point = trace(orbit, "a", within={"a": (0.6, 0.61)}, events=())[-1]
    after, wanted = (simulate(start, periods=1.5).final.v for start in (point, point.solution))
    np.testing.assert_array_equal(after, wanted)
    with pytest.raises(BadInput, match=r"^t0 = nan: a time"):
        simulate(orbit, periods=1, t0=math.nan)


def test_an_orbit_is_let_go_between_smooth_walls():
    orbit, how = symmetric(0.5, 0.04, 0.8, lattice=Ring(8)), {"m": 20, "periods": 1}
    own = {"a": 0.5, "gamma": 0.04}
    for other in ({"k": 0.8}, {"lam": 0.1}):
        alike = simulate_smooth(orbit.state(), **own, **other, **how)
        np.testing.assert_array_equal(simulate_smooth(orbit, **other, **how).final.u, alike.final.u)
    with pytest.raises(BadInput, match="smooth walls are at -1 and 1"):
        simulate_smooth(symmetric(0.5, 0.04, 0.8, lattice=Ring(8), walls=(-2, 2)), **how)


def test_an_orbit_brings_its_site_and_its_period():
    orbit = symmetric(0.4, 0.03, 0.6, lattice=OpenChain(5), damping=0.03, site=2)
    plane = Axis("u", 2, [-0.5, 0.5]), Axis("v", 2, [-1.0, 1.0])
    found = attraction(orbit, *plane, periods=60)
    own = {"a": 0.4, "gamma": 0.03, "k": 0.6, "lattice": OpenChain(5), "damping": 0.03}
    wanted = attraction(orbit.state(), *plane, periods=60, site=2, **own)
    np.testing.assert_array_equal(found.outcome, wanted.outcome)
    with pytest.raises(BadInput, match=r"^a beside an orbit: .* it is no motion"):
        attraction(orbit, *plane, a=0.45)
    single = symmetric(0.6, 0.0, 0.8, lattice=Ring(1))
    fork = trace(single, "a", within={"a": (0.6, 0.99)}).first("PF")
    (doubled,) = switch(
        switch(fork, within={"a": (0.6, 1.0)})[0].first("PD"), within={"a": (0.6, 0.96)}
    )
    motion = periodic(doubled[-1])
    assert (motion.periods, motion.largest < 0.5) == (2, True)
    with pytest.raises(BadInput, match="periods = 301: the orbit repeats after 2, so a multiple"):
        attraction(doubled[-1], Axis("u", 0, [0.0]), Axis("v", 0, [0.0]), periods=301)


@pytest.mark.parametrize(
    ("sites", "a", "gamma", "k", "periods"),
    [
        (10, 0.7, 0.1, 0.2, 1000),
        (400, 0.7, 0.06, 0.2, 1000),
        (20, 0.9, 0.06, 0.4, 10_000),
    ],
)
def test_stable_breather_stays_exact_over_thousands_of_periods(sites, a, gamma, k, periods):
    own = symmetric(a, gamma, k, lattice=Ring(sites))
    assert np.abs(own.multipliers()).max() < 1.0 + 1e-9
    run = simulate(own.state(sites), a=a, gamma=gamma, k=k, periods=periods)
    assert run.periods == periods
    assert np.abs(run.final.u - run.strobe.u[0]).max() < 1e-11
    assert np.abs(run.strobe.u - run.strobe.u[0]).max() < 1e-10
    assert np.abs(run.strobe.v - run.strobe.v[0]).max() < 1e-10
    assert np.ptp(run.at_site(0, 1)["phase"]) < 1e-10


# --- any motion at all ----------------------------------------------------------------------------


def energy(gamma, u, v):
    return 0.5 * np.sum(v**2, axis=-1) + 0.5 * gamma * np.sum((u - np.roll(u, 1, -1)) ** 2, axis=-1)


def test_elastic_walls_without_forcing_keep_the_energy():
    rng = np.random.default_rng(0)
    u, v = rng.uniform(-0.9, 0.9, 12), rng.normal(size=12)
    run = simulate((u, v), a=0.0, gamma=0.2, k=1.0, periods=200)
    assert len(run.impacts) > 1000
    assert np.ptp(energy(0.2, *run.strobe)) < 1e-11


def test_ring_in_unison_is_one_oscillator():
    one = simulate(([0.3], [1.1]), a=0.7, gamma=0.2, k=0.7, periods=5)
    many = simulate((np.full(30, 0.3), np.full(30, 1.1)), a=0.7, gamma=0.2, k=0.7, periods=5)
    assert len(many.impacts) == 30 * len(one.impacts)
    assert np.allclose(many.final.u, one.final.u[0], rtol=0, atol=1e-12)


def test_mirror_images_hit_at_the_same_time_and_stay_mirror_images():
    rng = np.random.default_rng(3)
    half_u, half_v = rng.uniform(-0.9, 0.9, 5), rng.normal(size=5)
    u = np.concatenate([half_u, half_u[3:0:-1]])  # u[n] = u[-n] on a ring of 8
    v = np.concatenate([half_v, half_v[3:0:-1]])
    run = simulate((u, v), a=0.5, gamma=0.2, k=0.9, periods=200)
    assert len(run.impacts) > 500
    assert np.array_equal(run.final.u[1:], run.final.u[:0:-1])
    assert np.array_equal(run.final.v[1:], run.final.v[:0:-1])


# --- no impact is missed --------------------------------------------------------------------------


def launch(excess):
    """One site under F = -a cos t that rises to 1 + excess at t = pi/4, and stays below elsewhere.

    u = c + d t + a cos t with u'(pi/4) = 0: the crest is at -pi/4 + pi... of curvature -a cos t,
    so t = pi/4 is a maximum.
    """
    a = 0.4
    top = 0.25 * PI
    d = a * math.sin(top)
    c = 1.0 + excess - d * top - a * math.cos(top)
    return a, ([c + a], [d]), top


@pytest.mark.parametrize("excess", [1e-3, 1e-6, 1e-9, 1e-12, 1e-14])
def test_shallow_impact_is_found(excess):
    a, state, top = launch(excess)
    run = simulate(state, a=a, gamma=0.1, k=0.5, periods=0.2)
    depth = math.sqrt(2 * excess / (a * math.cos(top)))  # time before the crest, to leading order
    first = run.impacts[0]
    assert first["time"] == pytest.approx(top - depth, abs=depth**2 + 1e-8)
    assert first["before"] == pytest.approx(a * math.cos(top) * depth, rel=0.2, abs=1e-8)


@pytest.mark.parametrize("excess", [-1e-13, -1e-9, -1e-3])
def test_near_miss_is_no_impact(excess):
    a, state, _ = launch(excess)
    assert not simulate(state, a=a, gamma=0.1, k=0.5, periods=0.2).impacts.size


@settings(max_examples=40)
@given(
    seed=st.integers(0, 10**6),
    sites=st.integers(1, 9) | st.integers(60, 90),
    # what smaller forces move in a period is below the velocity that counts as rest, 1e-12
    a=st.just(0.0) | st.floats(1e-9, 2.0),
    gamma=st.floats(0.0, 0.2499),
    k=st.floats(0.0, 1.0),
    damping=st.sampled_from([0.0, 0.05, 1.0]),
)
def test_no_site_is_ever_beyond_a_wall(seed, sites, a, gamma, k, damping):
    rng = np.random.default_rng(seed)
    state = rng.uniform(-1.0, 1.0, sites), rng.normal(size=sites)
    on_wall = rng.uniform(size=sites) < 0.2
    state[0][on_wall] = np.sign(state[0][on_wall])
    sample = Sample(sites=range(sites), per_period=300)
    periods = 4 if sites < 10 else 1
    run = simulate(state, a=a, gamma=gamma, k=k, damping=damping, periods=periods, sample=sample)
    assert run.stop is RunStop.DONE or k > 0.95
    assert np.all(np.abs(run.record.u) <= 1.0 + 1e-13)
    assert np.all(np.isfinite(run.record.v))
    assert np.all(np.diff(run.impacts["time"]) > -1e-11)
    assert np.allclose(run.impacts["after"], -k * run.impacts["before"], rtol=0, atol=1e-14)


@pytest.mark.parametrize("wall", [-1.0, 1.0])
def test_site_on_its_wall_that_moves_out_is_hit_at_once(wall):
    """Its gap is zero to within rounding, of either sign, depending on the forced motion then."""
    for t0 in (*np.linspace(0.0, 7.0, 200).tolist(), 1e6):
        run = simulate(([wall], [0.7 * wall]), a=1.3, gamma=0.0, k=0.5, periods=0.01, t0=t0)
        assert run.impacts["wall"][0] == wall
        assert run.impacts["time"][0] == pytest.approx(t0, abs=1e-14)
        assert run.impacts["after"][0] == pytest.approx(-0.35 * wall, abs=1e-14)


def test_impact_at_the_seam_of_two_steps_is_found_once():
    """Steps are a quarter of a period; the impact is moved across their seam by rounding errors."""
    own = symmetric(0.5, 0.08, 0.8, lattice=Ring(6))
    for shift in np.linspace(-3e-15, 3e-15, 121):
        t0 = own.phi + 1.5 * PI + shift
        run = simulate(own.state(6, t0), a=0.5, gamma=0.08, k=0.8, t0=t0, periods=0.45)
        assert run.impacts["wall"].tolist() == [1]


@pytest.mark.parametrize("beyond", [-1e-9, 1e-9])
def test_neighbour_touches_its_wall_from_the_upper_limit_on(beyond):
    """gamma = 0.1, k = 0.8: its maximum is 1 at a = 0.806417833236, eq. (15)."""
    a = 0.806417833236 + beyond
    upper = symmetric(a, 0.1, 0.8, root=1)
    run = simulate(upper.state(40), a=a, gamma=0.1, k=0.8, periods=1)
    hit = set(run.impacts["site"].tolist())
    assert hit == ({0, 1, 39} if beyond > 0 else {0})


# --- rest on a wall -------------------------------------------------------------------------------


def test_chatter_ends_at_rest_and_the_wall_lets_go_where_the_force_turns():
    """A single site pressed against its wall by the forcing leaves it when -a cos t turns."""
    run = simulate(([0.2], [0.3]), a=1.5, gamma=0.1, k=0.1, periods=30)
    begins, ends = run.rests[run.rests["begins"]], run.rests[~run.rests["begins"]]
    assert len(begins) >= 10
    assert np.all(ends["time"][: len(begins)] > begins["time"])
    turning = np.where(ends["wall"] > 0, 1.5 * PI, 0.5 * PI)
    assert np.allclose(ends["phase"], turning, rtol=0, atol=1e-12)


def test_plastic_impact_rests_at_once_when_pushed_and_flies_off_when_not():
    pushed = simulate(([0.9], [0.5]), a=1.0, gamma=0.0, k=0.0, periods=0.2, t0=0.75 * PI)
    assert len(pushed.impacts) == 1
    assert pushed.rests["begins"].tolist() == [True]
    assert pushed.final.u[0] == 1.0
    pulled = simulate(([0.9], [1.0]), a=1.0, gamma=0.0, k=0.0, periods=0.1, t0=0.0)
    assert len(pulled.impacts) == 1
    assert not pulled.rests.size
    assert pulled.final.u[0] < 1.0


@pytest.mark.slow
def test_endless_chatter_ends_with_a_reason():
    """Elastic rebounds under a steady push never come to rest; the run says so and stops."""
    run = simulate(([1.0], [-1e-6]), a=1.0, gamma=0.1, k=1.0, periods=3, t0=0.75 * PI)
    assert run.stop is RunStop.CHATTER
    assert (
        "site 0 has more than 150000 impacts in period 0, chattering on the wall +1" in run.reason
    )
    assert run.periods == 0


@pytest.mark.slow
def test_fast_elastic_impacts_are_followed_and_too_many_are_not_called_a_chatter():
    """From wall to wall in 2/v: pi v impacts in a period."""
    fast = simulate(([0.1], [4e4]), a=0.5, gamma=0.0, k=1.0, periods=1)
    assert (fast.stop, len(fast.impacts)) == (RunStop.DONE, round(PI * 4e4))
    for periods in (0.5, 1.5):  # in its first chunk, where it began
        run = simulate(([0.1], [1e5]), a=0.5, gamma=0.0, k=1.0, periods=periods, t0=0.3)
        assert run.stop is RunStop.CHATTER
        assert "from wall to wall at a speed of 1e+05" in run.reason
        assert "chatter" not in run.reason + run.stop.value
        assert (run.periods, run.end, run.final.u[0], run.final.v[0]) == (0, 0.3, 0.1, 1e5)
        assert repr(run) == f"<Run of 1 sites over 0 periods: 0 impacts; {run.reason}>"


def test_a_motion_that_blows_up_is_an_error():
    free = {"gamma": 0.0, "k": 0.8, "walls": (None, None)}
    with pytest.raises(
        NotConverged, match=r"the motion blows up in period 0 \(a = 10{10}\.0, k = 0\.8"
    ):
        simulate(([0.0], [0.0]), a=1e10, periods=0.25, **free)


def test_where_the_ring_does_not_go_on_a_branch_of_its_motions_ends():
    problem = periodic(symmetric(0.2, 0.0, 0.8, lattice=Ring(1))).problem
    assert np.abs(problem.residual(problem.x, problem.params)).max() < 1e-9
    with pytest.raises(ArithmeticError, match="has more than 150000 impacts in period 0"):
        problem.residual(np.array([0.1, 1e5]), {**problem.params, "k": 1.0})


@pytest.mark.parametrize("k", [0.99, 0.999, 0.9995])
def test_chatter_that_loses_less_than_rounding_comes_to_rest_all_the_same(k):
    """Rebounds of constant push: 1 + k + ... of the first one's time until the rest."""
    v, t0 = 3e-5, 0.999 * PI  # the push, -cos t, is at its height
    run = simulate(([1.0], [-v]), a=0.8, gamma=0.0, k=k, periods=0.2, t0=t0)
    begins = run.rests[run.rests["begins"]]
    assert run.stop is RunStop.DONE
    assert begins["time"][0] - t0 == pytest.approx(2.0 * v / (0.8 * (1.0 - k)), rel=0.02)
    assert (run.final.u[0], run.final.v[0]) == (1.0, 0.0)


@pytest.mark.parametrize("k", [0.3, 0.6, 0.9])
def test_rest_begins_where_the_series_of_rebounds_ends(k):
    """The last two impacts listed are a flight apart; all later flights are k times the one before.

    And so they are by the push on the site and the last velocity listed.
    """
    for v in (1e-2, 3e-3, 2e-4):
        run = simulate(([1.0], [-v]), a=1.5, gamma=0.0, k=k, periods=0.1, t0=0.999 * PI)
        rest = run.rests[run.rests["begins"]][0]
        last = run.impacts[run.impacts["time"] <= rest["time"]][-2:]
        flight = float(np.diff(last["time"])[0])
        left = float(rest["time"] - last["time"][-1])
        assert left == pytest.approx(flight * k / (1.0 - k), rel=2e-3)
        push = -1.5 * math.cos(last["phase"][-1]) * rest["wall"]
        assert left == pytest.approx(2.0 * abs(last["after"][-1]) / (push * (1.0 - k)), rel=1e-4)


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


@pytest.mark.parametrize("damping", [0.0, 0.1])
@pytest.mark.parametrize("sites", [1, 2, 5])
def test_samples_are_the_run_at_their_own_times(sites: int, damping: float) -> None:
    """Each sample is the end of a run as long as until then: impacts before it included."""
    shared = {"a": 0.5, "gamma": 0.08 if sites > 1 else 0.0, "k": 0.8, "damping": damping}
    state = symmetric(0.5, shared["gamma"], 0.8).state(sites, 0.5)
    count = 8
    run = simulate(state, periods=2, t0=0.5, sample=Sample(tuple(range(sites)), count), **shared)
    assert run.record is not None
    for j in range(2 * count):
        there = simulate(state, periods=j / count, t0=0.5, **shared)
        assert run.record.u[j] == pytest.approx(there.final.u, abs=1e-10)
        assert run.record.v[j] == pytest.approx(there.final.v, abs=1e-10)
        assert run.record.times[j] == pytest.approx(there.end, abs=1e-12)


def test_run_taken_up_from_its_final_state_is_the_same_run_bit_for_bit():
    """With chatter and rests; `record` does so with those of a breather."""
    rng = np.random.default_rng(2)
    state = rng.uniform(-0.9, 0.9, 9), rng.normal(size=9)
    conditions = {"a": 1.5, "gamma": 0.12, "k": 0.1, "damping": 0.01, "t0": 0.4}
    whole = simulate(state, periods=40, **conditions)
    first = simulate(state, periods=17, **conditions)
    second = simulate(first.final, periods=23, **conditions)
    assert np.array_equal(whole.final.u, second.final.u)
    assert np.array_equal(whole.final.v, second.final.v)
    both = np.concatenate([first.impacts["before"], second.impacts["before"]])
    assert np.array_equal(whole.impacts["before"], both)
