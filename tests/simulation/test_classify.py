"""Rotation numbers and verdicts on motions whose nature is known otherwise."""

from __future__ import annotations

import math

import numpy as np
import pytest

import contbreather as cb
import contbreather.simulation as sim
from contbreather.orbits import symmetric
from tests.simulation.zoo import breather

GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0


# --- rotation numbers -----------------------------------------------------------------------------


def curve(turns):
    """A wobbly closed curve in many dimensions, its parameter unevenly distributed."""
    angle = 2 * math.pi * turns + 0.3 * np.sin(2 * math.pi * turns)
    harmonics = np.stack([np.cos(angle), np.sin(angle), np.cos(2 * angle), np.sin(3 * angle)], 1)
    mix = np.random.default_rng(0).normal(size=(4, 6)) * np.array([1.0, 1.0, 0.2, 0.1])[:, None]
    return harmonics @ mix + 0.7


@pytest.mark.parametrize("number", [GOLDEN, 0.391599979, 0.0123, 1 / 3 + 0.01])
def test_rotation_number_of_a_curve_is_found_to_eight_digits(number):
    x = curve(number * np.arange(4000))
    found = sim.rotation(x[:, :3], x[:, 3:])
    assert found.number == pytest.approx(min(number % 1, 1 - number % 1), abs=1e-9)
    assert found.error < 1e-8
    assert found.hole > 0.05


# --- verdicts -------------------------------------------------------------------------------------


PAPER = [
    (0.82, 0.04, 0.005, 3000, sim.Kind.PERIODIC),  # Fig. 7, asymmetric
    (0.1, 0.104, 0.005, 2000, sim.Kind.SYNCHRONISED),  # Fig. 6 (a): nobody hits any more
    (0.2, 0.104, 0.005, 6000, sim.Kind.SYNCHRONISED),  # Fig. 6 (b): all hit together
    (0.7, 0.104, 0.005, 1500, sim.Kind.DELOCALISED),  # Fig. 6 (c)
    (0.15, 0.104, 0.005, 2000, sim.Kind.SYNCHRONISED),  # Fig. 8
]


@pytest.mark.parametrize(
    ("a", "gamma", "damping", "settle", "kind"),
    [
        *(pytest.param(*one, marks=pytest.mark.slow) for one in PAPER),
        (0.1, 0.082, 0.005, 6000, sim.Kind.PERIODIC),  # a slow spiral into a fixed point
        (0.1, 0.084, 0.005, 500, sim.Kind.UNDECIDED),  # not settled
    ],
)
def test_verdict_on_runs_of_known_ends(a, gamma, damping, settle, kind):
    state = symmetric(a, gamma, 0.8).state(20)
    conditions = {"a": a, "gamma": gamma, "k": 0.8, "damping": damping}
    found = sim.classify(state, **conditions, settle=settle, periods=300 if settle == 500 else 1000)
    assert found.kind is kind, str(found)
    assert found.kind.value in str(found)
    assert found.reason
    if gamma == 0.082:
        assert found.evidence["multiplier"] == pytest.approx(0.999141, abs=1e-6)


@pytest.mark.slow
def test_slowly_shrinking_direction_is_not_counted_as_a_frequency():
    """gamma = 0.0845 of the theory notes: exponents 0 and -1.2e-4, hard to tell apart."""
    conditions = {"a": 0.1, "gamma": 0.0845, "k": 0.8, "damping": 0.005}
    state = symmetric(0.1, 0.082, 0.8).state(20)
    found = sim.classify(state, **conditions, settle=20000, periods=3000)
    assert found.kind is sim.Kind.QUASI_PERIODIC
    assert found.evidence["rotation"] == pytest.approx(0.4590294719, abs=1e-9)
    assert found.evidence["frequencies"] <= 1
    assert "exponents are zero" not in found.reason
    assert found.evidence["impacting"] == 1


TORUS = {"a": 0.2, "gamma": 0.1087, "k": 0.8, "damping": 0.03}


@pytest.fixture(scope="module")
def torus():
    state = symmetric(0.2, 0.1087, 0.8).state(20)
    return sim.classify(state, **TORUS, settle=5000, periods=3000)


def test_second_torus_bifurcation_gives_a_breather_with_two_frequencies(torus):
    """Two Lyapunov exponents vanish: frequencies beside the forcing's."""
    assert torus.kind is sim.Kind.QUASI_PERIODIC
    assert torus.evidence["frequencies"] == 2
    assert torus.reason.endswith("2 exponents are zero: a torus of 2 frequencies beside 1")


def test_too_short_a_look_at_a_torus_is_undecided_and_says_what_it_saw(torus):
    found = sim.classify(torus.run.final, **TORUS, settle=0, periods=100)
    assert found.kind is sim.Kind.UNDECIDED, str(found)
    assert found.reason.startswith(f"rotation number {found.evidence['rotation']:.10f} (")
    assert "largest exponent" in found.reason


REPELLING = [
    # a, gamma, k, damping, sites, settle, periods: returns at once, after 3, leaving for long
    (0.1, 0.08, 0.8, 0.0, 20, 100, 100),
    (0.5, 0.05, 1.0, 0.0, 20, 60, 100),
    (0.2, 0.11, 0.8, 0.005, 20, 0, 100),
    (0.1, 0.08, 0.8, 0.0, 20, 600, 600),
]


@pytest.mark.parametrize(("a", "gamma", "k", "damping", "sites", "settle", "periods"), REPELLING)
def test_run_next_to_a_motion_that_repels_is_undecided(
    a, gamma, k, damping, sites, settle, periods
):
    """Neither what returns until rounding has grown is periodic, nor its own exponent chaos."""
    conditions = {"a": a, "gamma": gamma, "k": k, "damping": damping}
    t0 = 0.5 * math.pi if k == 1.0 else 0.0  # with k = 1 it hits at t = 0
    own = breather(sites, t0=t0, **conditions)
    assert own.largest > 1.01
    found = sim.classify(own.state, settle=settle, periods=periods, t0=t0, **conditions)
    assert found.kind is sim.Kind.UNDECIDED, str(found)
    assert found.evidence["multiplier"] == pytest.approx(own.largest, rel=1e-6)
    assert "it repels" in found.reason


@pytest.mark.slow
def test_small_torus_around_a_motion_that_repels_is_a_torus():
    """Just beyond its Neimark-Sacker bifurcation a motion repels, but what is next to it stays."""
    conditions = {"a": 0.15, "gamma": 0.0995, "k": 0.8, "damping": 0.02}
    own = breather(20, **conditions)
    assert own.largest > 1.0 + 1e-7
    found = sim.classify(
        (0.99 * own.state.u, own.state.v), settle=10000, periods=2000, **conditions
    )
    assert np.abs(found.run.strobe.u - own.state.u).max() < 0.1
    assert found.kind is sim.Kind.QUASI_PERIODIC, str(found)
    assert abs(found.evidence["exponent"]) < 1e-5


# Exponents of the same motions by the distance of two trajectories, kept at 1e-8, over 3000 periods
BANDS = [(1.0409, 0.0086), (1.04115, 0.0104)]


@pytest.mark.slow
def test_bands_of_chaos_visited_in_turn_are_chaotic():
    """Two rows of bands: a rotation number of 1/2 to ten digits, and repelling orbits within."""
    a, exponent = BANDS[0]
    found = sim.classify(([-0.31], [-0.16]), a=a, gamma=0.0, k=0.7)
    assert found.kind is sim.Kind.CHAOTIC, str(found)
    assert found.evidence["rotation"] == pytest.approx(0.5, abs=1e-6)
    assert found.evidence["exponent"] == pytest.approx(exponent, abs=2e-3)
    later = sim.simulate(found.run.final, a=a, gamma=0.0, k=0.7, periods=4000).strobe.u[:, 0]
    assert min(np.abs(later[n:] - later[:-n])[-500:].max() for n in range(1, 65)) > 1e-4


def test_bands_of_chaos_seen_for_a_shorter_time_are_never_called_a_torus_or_locked():
    for a, _ in BANDS:
        found = sim.classify(([-0.31], [-0.16]), a=a, gamma=0.0, k=0.7, settle=500, periods=400)
        assert found.kind in (sim.Kind.CHAOTIC, sim.Kind.UNDECIDED), str(found)


@pytest.mark.parametrize(("a", "q"), [(0.93, 2), (0.985, 4), (0.991, 8)])
def test_locked_motions_of_the_cascade_close_with_multipliers_inside_the_circle(a, q):
    """gamma = 0, k = 0.8: doublings at 0.92551, 0.97997 and 0.98963 after the pitchfork."""
    slowly = np.linspace(0.93, a, 30)
    start = sim.sweep(
        symmetric(0.93, 0.0, 0.8).state(1), "a", slowly, periods=60, a=a, gamma=0.0, k=0.8
    )
    found = sim.classify(start.final, a=a, gamma=0.0, k=0.8, periods=500)
    own = sim.periodic(found.run.final, periods=q, a=a, gamma=0.0, k=0.8)
    assert found.kind is sim.Kind.LOCKED
    assert own.largest < 1.0
    # from wall to wall of the two arms by turns: half a turn a period
    assert (found.evidence["p"], found.evidence["q"]) == (q / 2, q)
    assert found.evidence["multiplier"] == pytest.approx(own.largest, abs=1e-6)


# --- between smooth walls -------------------------------------------------------------------------


@pytest.mark.slow
def test_motion_between_elastic_walls_is_a_torus_with_the_rotation_number_of_its_spectrum():
    """A single site without losses, weakly driven: its section is a closed curve."""
    shared = {"a": 0.02, "gamma": 0.0, "k": 1.0, "m": 2}
    run = sim.simulate_smooth(([0.05], [1.0]), periods=500, **shared)
    found = sim.judge(run)
    assert found.kind is sim.Kind.QUASI_PERIODIC, found.reason
    assert found.evidence["exponent"] < 2e-3
    x = run.strobe.u[:, 0] - run.strobe.u[:, 0].mean()
    fine = np.linspace(0.3, 0.5, 4001)
    waves = np.exp(-2j * np.pi * np.outer(fine, np.arange(len(x))))
    peak = fine[np.abs(waves @ (x * np.hanning(len(x)))).argmax()]
    assert found.evidence["rotation"] == pytest.approx(peak, abs=1e-4)


@pytest.mark.slow
def test_doubled_motion_is_locked_with_the_multiplier_of_its_own_period_map():
    shared, periods = {"a": 1.0, "gamma": 0.0, "k": 0.7, "m": 30}, 2
    settled = sim.simulate_smooth(([-0.31], [-0.16]), periods=200, **shared).final
    run = sim.simulate_smooth(settled, periods=100, **shared)
    found = sim.judge(run)
    assert found.kind is sim.Kind.LOCKED, found.reason
    assert found.evidence["periods"] == periods
    first = np.array(run.final).ravel()
    exactly = {**shared, "periods": periods, "tolerance": 1e-13}
    columns = []
    for push in 1e-5 * np.eye(2):  # the period map by central differences
        ends = [sim.simulate_smooth((first + s * push)[:, None], **exactly).final for s in (1, -1)]
        columns.append(np.subtract(*ends).ravel() / 2e-5)
    largest = np.abs(np.linalg.eigvals(np.array(columns))).max()
    assert found.evidence["multiplier"] == pytest.approx(largest, abs=1e-4)


def test_smooth_motion_next_to_one_that_repels_is_not_called_periodic():
    shared = {"a": 0.2, "gamma": 0.104, "k": 0.8, "damping": 0.005, "m": 6}
    orbit = breather(20, a=0.2, gamma=0.104, k=0.8, m=6, damping=0.005)
    found = sim.judge(sim.simulate_smooth(orbit.state, periods=50, **shared))
    assert found.kind is sim.Kind.UNDECIDED
    assert "it repels" in found.reason


@pytest.mark.parametrize("periods", [1, 2, 3, 5])
def test_a_few_periods_are_looked_at_and_none_is_refused(periods: int) -> None:
    values = {"a": 0.5, "gamma": 0.08, "k": 0.8}
    state = cb.symmetric(**values).state(6)
    seen = sim.judge(cb.simulate(state, periods=periods, **values))
    assert seen.evidence["return"] < 1e-12
    with pytest.raises(cb.BadInput, match="about whole periods"):
        sim.judge(cb.simulate(state, periods=0.5, **values))


@pytest.mark.parametrize(("sites", "ring"), [([0, 2, 4], 8), ([0, 1, 2], 6), ([0, 2, 4, 6], 12)])
def test_breathers_of_several_sites_are_not_all_over_the_lattice(sites, ring) -> None:
    at = {"a": 0.5, "gamma": 0.03, "k": 0.8, "lattice": cb.Ring(ring), "damping": 0.05}
    orbit = cb.multibreather(sites, **at)
    found = sim.classify(orbit, settle=50, periods=100)
    assert (found.kind, found.evidence["impacting"]) == (sim.Kind.PERIODIC, len(sites))
    mu = abs(orbit.multipliers()).max()
    assert found.evidence["multiplier"] == pytest.approx(mu, abs=1e-9)
