"""Shooting on a ring: against closed forms at 30 digits, dense matrix exponentials, brute force."""

from __future__ import annotations

import functools
import math
from dataclasses import replace

import networkx
import numpy as np
import pytest

import contbreather as cb
from contbreather.checks import brief
from contbreather.continuation.branches.switching import switch
from contbreather.lattice.conditions import Conditions
from contbreather.orbits import centre_margin
from contbreather.orbits.branch_switching import lift
from contbreather.orbits.by_impacts import ByImpacts
from contbreather.orbits.clearance import Inadmissible
from contbreather.orbits.constructors import asymmetric, shooting
from contbreather.orbits.orbit import Orbit, orbit_at
from contbreather.orbits.orbit_equations import OrbitEquations, equations_on
from contbreather.orbits.section import ImpossibleSequence, Section, check_possible
from tests.stability.by_hand import slope

from .by_hand import derivatives, in_phase, run_once
from .field import Field, FieldOf

RING = 20
AT = {"gamma": 0.04, "k": 0.8}


# --- orbits that many tests look at -------------------------------------------------------------


@functools.cache
def symmetric_branch(sites: int = RING, gamma: float = 0.04, k: float = 0.8) -> cb.Branch:
    start = shooting(cb.symmetric(0.66, gamma, k, lattice=cb.Ring(sites)))
    return cb.trace(start, "a", within={"a": (0.6, 0.9)})


@functools.cache
def arm(sites: int = RING, gamma: float = 0.04, k: float = 0.8) -> cb.Branch:
    lifted = lift(symmetric_branch(sites, gamma, k).first("PF"))
    return cb.trace(lifted.arm(-0.02), "a", towards="up", within={"a": (0.5, 1.2)})


@functools.cache
def tilted() -> Orbit:
    """The asymmetric orbit of the figures: a = 0.82, gamma = 0.04, k = 0.8, N = 20."""
    problem = shooting(
        {"t1": -3.28, "t2": 0.45}, a=0.82, sites=RING, **AT, sequence=((0, 1), (0, -1))
    )
    return orbit_at(problem)


SPRINGS = networkx.Graph([(0, 1, {"weight": 1.5}), (1, 2), (2, 3), (3, 1), (3, 4)])
ODD = cb.Lattice.from_graph(SPRINGS, masses=[1, 2, 0.5, 1, 3], drive=[1, 0, 2, -1, 0.5])
TWO = cb.Fourier({1: -1.0, 3: 0.4}, {1: 0.2})
PLAIN = Conditions(a=0.7, gamma=0.11, k=0.8)
DAMPED = Conditions(a=0.7, gamma=0.11, k=0.8, damping=0.3, spring=0.07)
HEAVY = Conditions(a=0.7, gamma=0.2, k=0.6, damping=1.1, spring=0.3025, forcing=TWO)  # critical
STIFF = Conditions(a=0.7, gamma=0.11, k=0.8, spring=0.9)  # modes next to the drive


ITINERARIES = [
    (cb.Ring(1), Section(((0, 1), (0, -1)), 2)),
    (cb.Ring(5), Section(((0, 1),), sign=-1)),
    (cb.Ring(6), Section(((0, 1), (0, -1)))),
    (cb.Ring(7), Section(((0, 1), (2, 1), (0, -1), (0, 1)))),
    (cb.Ring(5), Section(((0, 1), (3, -1)), 3, sign=-1)),
    (cb.OpenChain(4), Section(((0, 1), (0, -1)))),
    (ODD, Section(((3, 1), (1, 1), (3, -1)))),
    (cb.Grid(3, 3), Section(((4, 1),), sign=-1)),
]
NAMES = [f"{lattice.describe()}, {section.describe()}" for lattice, section in ITINERARIES]


def unknowns(equations: OrbitEquations, on: Conditions, seed: int = 1) -> np.ndarray:
    """Any times and impulses that leave the lattice where it is, with offsets and amplitudes that
    suit them; the site is wherever that brings it."""
    rng = np.random.default_rng(seed)
    m = equations.section.count
    x = rng.normal(size=equations.size)
    x[:m] = rng.uniform(0, 0.9 * equations.section.length, m)
    masses = equations.masses[:, 0]
    if equations.offsets and not on.spring:
        x[m : 2 * m] -= masses @ x[m : 2 * m] / masses.sum()
    rest = slice(2 * m, None)
    matrix = equations.jacobian(x, on.params)[rest, rest]
    x[rest] -= np.linalg.lstsq(matrix, equations.residual(x, on.params)[rest])[0]
    return x


# --- flights ------------------------------------------------------------------------------------


everywhere = pytest.mark.parametrize(("lattice", "section"), ITINERARIES, ids=NAMES)
under_all = pytest.mark.parametrize(
    "on",
    [PLAIN, replace(PLAIN, forcing=TWO), DAMPED, HEAVY, STIFF],
    ids=["plain", "two harmonics", "damped", "critically damped", "stiff"],
)


@everywhere
@under_all
def test_motion_is_what_matrix_exponentials_and_impulses_give(lattice, section, on) -> None:
    on = replace(on, lattice=lattice)
    equations = equations_on(on, section)
    x = unknowns(equations, on)
    orbit = Orbit(ByImpacts.of(on, section, x, on.params))
    brute, sites = Field(lattice, on), np.arange(lattice.sites)
    start = float(orbit.times.min()) - 0.1
    now, t = np.concatenate([orbit.motion.states(sites, start)[i] for i in (0, 1)]), start
    beyond, resets = np.empty((2, section.count))
    for j in np.argsort(orbit.times):
        site, wall = section.impacts[j]
        now, t = brute.flown(t, now, orbit.times[j] - t), float(orbit.times[j])
        speed = now[lattice.sites + site] + 0.5 * orbit.impulses[j]
        beyond[j] = now[site] - wall
        resets[j] = speed + 0.5 * (1 - on.k) / (1 + on.k) * orbit.impulses[j]
        now[lattice.sites + site] += orbit.impulses[j]
        there = orbit.motion.states(sites, t)
        assert now == pytest.approx(np.concatenate(there[:2]), abs=1e-10)
    end = start + section.length
    closed = brute.flown(t, now, end - t)
    first = np.concatenate([orbit.motion.states(sites, start)[i] for i in (0, 1)])
    assert closed == pytest.approx(section.sign * first, abs=1e-10)
    left = equations.residual(x, on.params)
    assert left[: 2 * section.count] == pytest.approx(np.append(beyond, resets), abs=1e-10)
    for site in {0, lattice.sites - 1}:
        for when in (0.4, -1.3, 40.0):
            one, row = orbit.motion.at(site, when), orbit.motion.states([site], when)
            assert one == pytest.approx(row[:, 0].tolist(), abs=1e-11)


@everywhere
@under_all
def test_jacobian_and_sensitivities_are_the_derivatives(lattice, section, on) -> None:
    on = replace(on, lattice=lattice)
    equations = equations_on(on, section)
    for name, found, wanted in derivatives(equations, unknowns(equations, on), on.params, 4e-5):
        assert np.abs(found - wanted).max() < 2e-8 * (1.0 + np.abs(wanted).max()), name


@pytest.mark.parametrize("gamma", [1e-8, 1e-4, 0.04])
def test_slope_in_gamma_of_the_slowest_modes_has_no_cancellation(gamma: float) -> None:
    on = replace(PLAIN, gamma=gamma, lattice=cb.OpenChain(60))
    equations = equations_on(on, ITINERARIES[5][1])
    x, step = unknowns(equations, on), 0.25 * min(0.5 * gamma, 1e-5)
    near = slope(lambda h: equations.residual(x, {**on.params, "gamma": gamma + h}), step)
    found = equations.along(x, on.params, {"gamma": 1.0})
    assert found == pytest.approx(near, rel=1e-5, abs=1e-5)


# --- against the closed form --------------------------------------------------------------------


def test_a_ring_pushed_off_centre_is_brought_back_by_its_impacts() -> None:
    orbit = tilted()
    assert orbit.representation.condition < 1e4
    pushed = orbit.problem.at(c=orbit.c + 0.5)
    assert orbit_at(pushed.solve()[0]).c == pytest.approx(orbit.c, abs=1e-12)


def test_condition_stays_bounded_with_the_size_of_the_ring() -> None:
    found = [
        orbit_at(
            shooting(cb.symmetric(0.6, 0.04, 0.8), sites=n, symmetric=False)
        ).representation.condition
        for n in (20, 100, 400)
    ]
    assert max(found) < 100.0


def test_a_mode_in_resonance_with_the_period_is_no_hindrance() -> None:
    """At gamma = 1/16 the top mode of the ring turns twice in 8 pi: once in 4 pi."""
    breather = cb.symmetric(0.6, 1 / 16, 0.8)
    state = breather.state(RING, 0.3)
    start = shooting(state, a=0.6, gamma=1 / 16, k=0.8, t=0.3, period=4 * math.pi)
    orbit = orbit_at(start)
    assert orbit.residual < 1e-13
    assert 10 < orbit.representation.condition < 1e6
    branch = cb.trace(start, "gamma", within={"gamma": (0.05, 0.075)}, events=[])
    assert [branch["gamma"][0], branch["gamma"][-1]] == [0.05, 0.075]
    for point in branch:
        known = cb.symmetric(0.6, point["gamma"], 0.8, lattice=cb.Ring(RING))
        assert point["p"] == pytest.approx(known.p, abs=1e-10)


def test_whole_periods_reach_the_limit_without_coupling() -> None:
    start = shooting(tilted(), sites=8, damping=0.01)
    branch = cb.trace(start, "gamma", within={"gamma": (0.0, 0.05)}, towards="down", events=[])
    single = orbit_at(shooting(branch[-1].solution, sites=1))
    assert branch[-1]["gamma"] == 0.0
    assert single.times == pytest.approx(branch[-1].solution.times, abs=1e-10)


# --- the cascade of a single oscillator ---------------------------------------------------------


@pytest.mark.slow
def test_cascade_has_multiplier_minus_one_of_an_independent_map() -> None:
    """At PD of the asymmetric orbit, and of the orbits of period 2, 4 and 8 after it."""
    branch = arm(1, 0.0)
    for turns in (1, 2, 4, 8):
        if turns > 1:
            steps = cb.Steps(first=1e-3, largest=0.2 / turns**2)
            branch = cb.switch(branch.first("PD"), within={"a": (0.9, 0.992)}, steps=steps)[0]
        orbit = branch.first("PD").solution
        assert orbit.section.turns == turns
        # the slope of the multiplier in a is of order 10 and more
        assert abs(FieldOf(orbit).multipliers() + 1).min() < 1e-8


# --- boundaries ---------------------------------------------------------------------------------


@pytest.mark.parametrize("gamma", [1e-4, 0.02])
def test_grazing_of_the_impacting_site_itself_is_followed_between_its_impacts(gamma: float) -> None:
    ring = cb.Ring(3)
    start = shooting(cb.symmetric(0.7, gamma, 0.02, lattice=ring))
    point = cb.trace(start, "a", towards="up", within={"a": (0.5, 1.2)}).first("GR")
    line = cb.boundary(point, ("k", "a"), within={"k": (0.015, 0.03)})
    assert not line.stop.failed
    assert [line["k"].min(), line["k"].max()] == [0.015, 0.03]
    for at in line:
        known = cb.symmetric(at["a"], gamma, at["k"], lattice=ring)
        assert centre_margin(known) == pytest.approx(0, abs=1e-10)
        assert float(at.solution.displacement(0, at["t"])) == pytest.approx(1, abs=1e-10)
        assert float(at.solution.velocity(0, at["t"])) == pytest.approx(0, abs=1e-8)


# --- admissibility ------------------------------------------------------------------------------


def test_inadmissible_orbit_is_returned_by_name_only_and_marked() -> None:
    beyond = cb.symmetric(0.97, 0.04, 0.8, root=1)
    said = r"no breather.*site 1 reaches \|u\| = 1\.04.* inadmissible=True"
    with pytest.raises(cb.NoSolution, match=said) as refused:
        shooting(beyond, sites=RING)
    error = refused.value
    assert isinstance(error, Inadmissible)
    assert abs(error.orbit.displacement(error.site, error.time)) > 1.04
    assert error.orbit.residual < 1e-12
    orbit = orbit_at(shooting(beyond, sites=RING, inadmissible=True))
    assert "no breather: site 1" in repr(orbit)
    assert "no breather" not in repr(arm()[-1].solution)  # at the limit, not beyond it


# --- seeds --------------------------------------------------------------------------------------


def test_simulated_state_is_followed_to_its_impacts() -> None:
    orbit = tilted()
    for t in (-0.7, 0.3, 2.0):
        state = orbit.state(t=t)
        found = orbit_at(shooting(state, a=0.82, t=t, **AT))
        assert found.section.impacts == ((0, 1), (0, -1))
        assert found.p == pytest.approx(orbit.p, abs=1e-11)
        turned = orbit_at(shooting(state, a=0.82, t=t, sequence=((0, -1), (0, 1)), **AT))
        assert turned.section.impacts == ((0, -1), (0, 1))
        assert turned.displacement(2, 1.0) == pytest.approx(orbit.displacement(2, 1.0), abs=1e-11)


def test_state_of_a_symmetric_orbit_can_be_shot_over_half_or_three_periods() -> None:
    state = cb.symmetric(0.6, 0.04, 0.8).state(RING, 0.3)
    half = orbit_at(shooting(state, a=0.6, t=0.3, symmetric=True, **AT))
    assert half.section.count == 1
    long = orbit_at(shooting(state, a=0.6, t=0.3, symmetric=True, period=6 * math.pi, **AT))
    assert long.section.count == 3
    assert long.displacement(1, 0.2) == pytest.approx(half.displacement(1, 0.2), abs=1e-11)


def test_symmetric_orbit_may_begin_on_either_wall() -> None:
    breather = cb.symmetric(0.6, 0.04, 0.8, lattice=cb.Ring(RING))
    for t in (breather.phi - 0.3, breather.phi + 0.3):  # before and after the impact on +1
        state = breather.state(RING, t)
        given = {"a": 0.6, "t": t, "symmetric": True, **AT}
        assert orbit_at(shooting(state, **given)).section.impacts == ((0, 1),)
        for wall in (1, -1):
            orbit = orbit_at(shooting(state, sequence=((0, wall),), **given))
            assert orbit.section.impacts == ((0, wall),)
            late = breather.phi if wall > 0 else breather.phi + math.pi
            assert math.remainder(orbit.times[0] - late, 2 * math.pi) == pytest.approx(0, abs=1e-11)
            assert orbit.displacement(1, 0.7) == pytest.approx(breather.displacement(1, 0.7))


def test_orbit_of_another_lattice_is_a_seed_by_its_impacts_or_its_motion() -> None:
    exact = tilted()
    seed = asymmetric(0.82, 0.04, 0.8, arm=-1 if exact.asymmetry < 0 else 1)
    found = orbit_at(shooting(seed, sites=RING))
    assert found.times == pytest.approx(exact.times, abs=1e-9)
    bare = orbit_at(shooting(seed.state(RING, 0.3), t=0.3, a=0.82, **AT))
    assert bare.p == pytest.approx(exact.p, abs=1e-11)


def test_point_of_a_branch_is_a_seed_and_its_problem_too() -> None:
    point = arm()[3]
    for seed in (point, point.solution, point.problem):
        again = shooting(seed)
        assert again.start["t1"] == pytest.approx(point["t1"], abs=1e-12)


@functools.cache
def together(top: float = 0.45) -> cb.Branch:
    """Neighbours that hit their walls at once."""
    start = shooting(
        {"t1": -2.8, "t2": -2.8}, a=0.4, sites=RING, sequence=((0, 1), (1, 1)), symmetric=True, **AT
    )
    return cb.trace(start, "a", within={"a": (0.05, top)})


@pytest.mark.slow
def test_arms_on_which_impacts_at_once_come_apart_leave_with_a_kink() -> None:
    """Their order is another one on either side, so the amplitude falls like |t1 - t2|: no tangent
    at the branch point tells that. All that is found flies back to itself."""
    point = together().first("BP")
    arms = switch(point, within={"a": (0.05, 0.3)}, steps=cb.Steps(first=1e-3))
    for arm, side in zip(arms, (-1, 1), strict=True):  # that along which t1 falls comes first
        away = arm[1]["t1"] - arm[1]["t2"]
        assert math.copysign(1.0, away) == side
        # by Newton's iteration with the times held a thousandth apart
        assert (arm[1]["a"] - point["a"]) / abs(away) == pytest.approx(-0.01577, rel=1e-3)
        for one in (arm[2], arm[len(arm) // 2], arm[-1]):
            orbit = one.solution
            assert orbit.admissibility().ok
            assert run_once(orbit) < 1e-11


# --- refusals -----------------------------------------------------------------------------------

BY_HAND = {"a": 0.82, "sites": RING, **AT}


def test_state_that_hits_other_walls_is_refused_with_what_it_hits() -> None:
    with pytest.raises(cb.BadInput, match=r"it meets \(0, -1\) at t = .* \(0, \+1\) at t = "):
        shooting(tilted().state(t=0.3), a=0.82, t=0.3, sequence=((0, 1), (0, -1), (3, 1)), **AT)


def test_seed_that_does_not_converge_is_refused_with_its_residual() -> None:
    seed = {"t1": -3.0, "t2": -1.0}
    with pytest.raises(cb.NotConverged, match="near the seed") as refused:
        shooting(seed, sequence=((0, 1), (0, -1)), **{**BY_HAND, "a": 0.03})
    assert refused.value.residual > 0
    assert refused.value.iterations > 1
    assert refused.value.last.section.impacts == ((0, 1), (0, -1))


def test_orbit_of_other_impacts_than_asked_for_is_carried_by_its_refusal() -> None:
    seed = {"t1": 0.6, "t2": 5.0}
    with pytest.raises(cb.NotConverged, match="out of order") as refused:
        shooting(seed, sequence=((0, 1), (0, -1)), **{**BY_HAND, "a": 0.82})
    last = refused.value.last
    assert last.times[0] > last.times[1]
    assert last.residual == refused.value.residual < 1e-12
    assert refused.value.iterations > 1


@pytest.mark.parametrize("sequence", [(), ((0, 1),), ((99, 1), (0, -1)), ((0, 2), (0, -1))])
def test_impossible_sequence_is_carried_by_its_refusal(sequence) -> None:
    ring = cb.Ring(RING)
    with pytest.raises(cb.BadInput) as refused:
        check_possible(Section(sequence).placed(ring), Conditions(0.5, 0.04, 0.8, lattice=ring))
    assert isinstance(refused.value, ImpossibleSequence)
    assert refused.value.sequence == sequence


def test_solution_with_impacts_from_outside_is_no_orbit() -> None:
    """The closed form with negative p solves the equations but comes from behind the wall."""
    problem = shooting(cb.symmetric(0.9, 0.04, 0.8), sites=1)
    with pytest.raises(cb.NotConverged, match="from outside"):
        shooting({"t1": 0.3}, a=1.3, gamma=0.0, k=0.8, sites=1, sequence=((0, 1),), symmetric=True)
    assert orbit_at(problem).impulses[0] < 0


@pytest.mark.parametrize("given", ["x", True, [1.01], 10**5000, math.nan], ids=brief)
def test_a_threshold_that_is_no_modulus_is_refused_with_what_this_lattice_takes(given) -> None:
    damped = cb.symmetric(0.6, 0.04, 0.8, lattice=cb.Ring(8), damping=0.02)
    events, wanted = [cb.neimark_sacker(threshold=given)], "a finite modulus of at least 1 is"
    with pytest.raises(cb.BadInput, match=f"threshold = .*: {wanted}"):
        cb.trace(damped, "a", events=events)
    with pytest.raises(cb.BadInput, match=f"threshold = .*: {wanted}"):
        damped.stability(threshold=given)
    for ideal in (cb.symmetric(0.6, 0.04, 0.8, lattice=cb.Ring(8)), cb.symmetric(0.6, 0.04, 0.8)):
        with pytest.raises(cb.BadInput, match=r"threshold = .*: (a lattice without|the infinite)"):
            cb.trace(ideal, "a", events=events)
        with pytest.raises(cb.BadInput, match=r"threshold = .*: (a lattice without|the infinite)"):
            ideal.stability(threshold=given)


def test_orbit_of_one_ring_goes_to_another_or_says_why_not() -> None:
    assert np.array_equal(tilted().state(sites=30), tilted().on(cb.Ring(30)).state())
    farther = orbit_at(shooting(in_phase(), sites=9))
    assert (farther.section.impacts, farther.lattice) == (in_phase().section.impacts, cb.Ring(9))
    breather, on = cb.symmetric(0.6, 0.04, 0.8), {n: cb.Ring(n) for n in (6, 12)}
    half = orbit_at(shooting(breather, sites=6))
    assert half.on(on[6]) is half or half.on(on[6]).times == pytest.approx(half.times)
    assert (half.on(on[12]).lattice, half.p) == (on[12], pytest.approx(breather.on(on[6]).p))
    wanted = cb.symmetric(0.6, 0.04, 0.8, lattice=on[12]).p
    assert half.on(on[12]).p == pytest.approx(wanted, abs=1e-9)
    with pytest.raises(cb.BadInput, match="fall together on a lattice of 3 sites"):
        in_phase().on(cb.Ring(3))
    with pytest.raises(cb.BadInput, match="not shot as a symmetric one"):
        shooting(tilted(), symmetric=True)
    with pytest.raises(cb.BadInput, match="threshold = 0"):
        in_phase().representation.problem(0.5)


@pytest.mark.parametrize("to", [0.0, 1e-12, 1e-7])
def test_a_pitchfork_is_found_between_the_last_step_and_no_coupling_at_all(to: float) -> None:
    """Without coupling all modes of a ring but one drift, and the determinant is 0/0."""
    on = {"k": 0.8, "lattice": cb.Ring(8)}
    start, other = cb.symmetric(0.6961468, 0.047, **on), cb.symmetric(0.6961468, 0.01, **on)
    branch = cb.trace(cb.shooting(start, sites=8), "gamma", within={"gamma": (to, 0.05)})
    closed = cb.trace(other, "gamma", within={"gamma": (1e-3, 0.01)}).first("PF")
    assert branch.first("PF")["gamma"] == pytest.approx(closed["gamma"], abs=1e-9)
    assert closed["gamma"] == pytest.approx(0.0023467, abs=1e-7)
