"""What is measured of states and runs, each against numbers known beforehand."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import contbreather as cb
import contbreather.simulation as sim
from contbreather.errors import NotConverged
from contbreather.simulation.states import PERIOD

STILL = {"a": 0.0, "gamma": 0.0}


# --- localisation ---------------------------------------------------------------------------------


def around(sites: int, ratio: float, centre: int = 0) -> np.ndarray:
    """Velocities that fall from site to site by one factor, both ways around a ring."""
    n = np.arange(sites)
    return np.roll(ratio ** np.minimum(n, sites - n), centre)


@pytest.mark.parametrize("sites", [4, 5, 6, 7, 12])
@pytest.mark.parametrize("ratio", [0.5, 1.0, 2.0e-3])
def test_decay_is_the_factor_from_site_to_site(sites: int, ratio: float) -> None:
    v = around(sites, ratio)
    assert sim.localisation(0 * v, v, **STILL).decay() == pytest.approx(ratio, rel=1e-9)


def test_a_site_alone_has_all_of_the_energy() -> None:
    v = np.array([[0.3], [0.5]])
    seen = sim.localisation(0 * v, v, a=0.0, gamma=0.1, lattice=cb.Lattice([[0.0]]))
    assert (seen.participation.tolist(), seen.centre.tolist()) == ([1.0, 1.0], [0, 0])
    assert seen.energy == pytest.approx(0.5 * v**2)
    assert np.isnan(seen.decay()).all()


def test_decay_of_several_states_counts_from_the_centre_of_each() -> None:
    v = np.array([around(9, 0.3, centre) for centre in (0, 4, 7)])
    seen = sim.localisation(0 * v, v, **STILL)
    assert seen.centre.tolist() == [0, 4, 7]
    assert seen.decay() == pytest.approx(0.3, rel=1e-9)


def test_localisation_takes_what_a_run_was_simulated_under() -> None:
    run = cb.simulate(cb.symmetric(0.2, 0.04, 0.8, lattice=cb.Ring(6)), periods=3)
    seen = sim.localisation(*run.strobe, run.times, **vars(run.conditions))
    assert seen.energy == pytest.approx(sim.localisation(*run.strobe, a=0.2, gamma=0.04).energy)


def test_where_decay_cannot_be_told() -> None:
    for sites in (1, 2, 3):
        assert math.isnan(sim.localisation(np.zeros(sites), np.ones(sites), **STILL).decay())
    alone = np.eye(8)[0]
    assert sim.localisation(0 * alone, alone, **STILL).decay() == 0.0


def test_half_of_each_bond_belongs_to_each_of_its_sites() -> None:
    u = np.array([0.0, 0.5, 0.0, 0.0, 0.0])
    energy = sim.localisation(u, 0 * u, a=0.0, gamma=0.2).energy
    assert energy == pytest.approx(0.25 * 0.2 * 0.25 * np.array([1.0, 2.0, 1.0, 0.0, 0.0]))
    assert sim.localisation([0.5], [0.3], a=0.0, gamma=0.2).energy == pytest.approx([0.5 * 0.3**2])


def test_a_ring_without_energy_takes_part_as_a_whole() -> None:
    seen = sim.localisation(np.zeros((3, 5)), np.zeros((3, 5)), a=0.0, gamma=0.1)
    assert seen.participation.tolist() == [5.0, 5.0, 5.0]


# --- rotation numbers -----------------------------------------------------------------------------


def test_number_error_and_drift_say_what_their_names_say() -> None:
    """A curve that turns at 0.2 and then at 0.21 a period, and grows by a tenth meanwhile."""
    rate = np.repeat([0.2, 0.21], 1000)
    size = np.repeat([1.0, 1.1], 1000)
    t = 2.0 * math.pi * np.cumsum(rate)
    found = sim.rotation(size * np.cos(t), size * np.sin(t))
    assert found.number == pytest.approx(0.205, abs=1e-4)
    assert found.error == pytest.approx(0.01, abs=1e-4)
    assert found.drift == pytest.approx(1.1**2 - 1.0, abs=1e-2)
    assert found.hole == pytest.approx(1.0 / 1.1, abs=0.05)


@pytest.mark.parametrize("rounding", [0.0, 1e-17, 1e-16])
def test_a_section_that_stands_still_does_not_turn(rounding: float) -> None:
    noise = rounding * np.random.default_rng(0).standard_normal((2, 50, 2))
    found = sim.rotation(0.3 + noise[0], noise[1])
    assert (found.number, found.error, found.hole, found.drift) == (0.0, 0.0, 0.0, 0.0)


# --- verdicts -------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_run_that_ends_early_is_undecided_with_its_reason() -> None:
    fast, state = {"a": 0.5, "gamma": 0.0, "k": 1.0}, ([0.1], [1e5])  # from wall to wall in 2/v
    for settle in (0, 1):
        found = sim.classify(state, settle=settle, periods=100, **fast)
        assert found.kind is sim.Kind.UNDECIDED
        assert found.reason.startswith("site 0 has more than")
        assert found.evidence == {}
        assert str(found) == f"{sim.Kind.UNDECIDED.value}; {found.reason}"
    with pytest.raises(NotConverged, match="site 0 has more than"):
        sim.lyapunov(state, periods=10, **fast)
    with pytest.raises(NotConverged, match="site 0 has more than"):
        sim.periodic(state, **fast)


# --- sweeps ---------------------------------------------------------------------------------------


def test_a_sweep_is_lost_where_the_first_of_its_conditions_fails() -> None:
    start = cb.symmetric(0.2, 0.04, 0.8).state(6)
    whole = sim.sweep(start, "a", [0.2, 0.19, 0.18, 0.17], periods=6, a=0.2, gamma=0.04, k=0.8)
    assert math.isnan(whole.lost())
    third = np.arange(4) == 2
    assert replace(whole, impacts=np.where(third, 1.6, 2.0)).lost() == 0.18
    assert replace(whole, impacts=np.where(third, 2.4, 2.0)).lost() == 0.18
    assert math.isnan(replace(whole, impacts=np.where(third, 2.2, 2.0)).lost())
    assert replace(whole, others=np.where(third, 0.1, 0.0)).lost() == 0.18
    assert replace(whole, centre=np.where(third, 3, 0)).lost() == 0.18
    assert whole.lost(1) == 0.2
    assert math.isnan(whole.lost(6))  # site 6 of six is site 0
    elsewhere = replace(whole, centre=np.where(third, 3, 1))  # that at which it began
    assert elsewhere.lost() == 0.18
    both = replace(elsewhere, others=0 * third + 2.0)  # either of two sites may have more
    assert math.isnan(both.lost())
    assert replace(both, others=np.where(third, 0.0, 2.0)).lost() == 0.18
    smooth = replace(whole, impacts=np.full(4, np.nan))
    assert math.isnan(smooth.lost())
    assert replace(smooth, participation=np.where(third, 3.0, 1.5)).lost() == 0.18


def test_columns_of_a_sweep_are_those_of_the_breather_it_follows() -> None:
    b = cb.symmetric(0.2, 0.04, 0.8, lattice=cb.Ring(6))
    seen = sim.sweep(
        b.state(6), "a", [0.2, 0.2], periods=6, a=9.0, gamma=0.04, k=0.8, progress=False
    )
    assert seen.name == "a"
    assert repr(seen) == "<Sweep in a from 0.2 to 0.2: 2 values; went through all its periods>"
    back = replace(seen, value=np.array([0.2, 0.05, 0.2]))
    assert "in a from 0.2 by way of 0.05 to 0.2: 3 values" in repr(back)
    assert seen.p == pytest.approx([b.p, b.p], abs=1e-9)
    assert seen.tilt == pytest.approx([0.0, 0.0], abs=1e-9)
    assert (seen.impacts.tolist(), seen.others.tolist()) == ([2.0, 2.0], [0.0, 0.0])
    assert (seen.change < 1e-9).all()
    own = sim.localisation(*b.state(6), a=0.2, gamma=0.04)
    assert seen.amplitude == pytest.approx(math.sqrt(2.0 * own.energy[0]), abs=1e-9)
    assert seen.participation == pytest.approx(float(own.participation), abs=1e-9)
    heavy = cb.Lattice(12.0 * np.eye(3) - 4.0, [4.0] * 3)  # that of a ring of 3, four times
    at = {"gamma": 0.04, "k": 0.8, "periods": 4, "progress": False}
    rings = [
        sim.sweep(
            cb.symmetric(0.2, 0.04, 0.8, lattice=cb.Ring(3)).state(), "a", [0.2], **at, **more
        )
        for more in ({}, {"lattice": heavy})
    ]
    assert rings[1].amplitude == pytest.approx(rings[0].amplitude)
    final = seen.final
    final.u[0] = 7.0
    assert seen.u[-1, 0] != 7.0


def test_tilt_is_the_flight_to_the_lower_wall_beyond_half_a_period() -> None:
    pitchfork = cb.trace(cb.symmetric(0.7, 0.02, 0.8), "a", within={"a": (0.5, 1.2)}).first("PF")
    arm = cb.switch(pitchfork)[0]
    far = min(arm, key=lambda point: abs(point["a"] - pitchfork["a"] - 0.02))
    orbit, beyond = far.solution, far["t2"] - far["t1"] - math.pi
    shared = {"a": float(far["a"]), "gamma": 0.02, "k": 0.8}
    seen = sim.sweep(orbit.state(8, 0.0), "damping", [0.0], periods=4, damping=0.0, **shared)
    assert abs(beyond) > 0.05
    assert seen.tilt[0] == pytest.approx(math.remainder(beyond, 2.0 * math.pi), abs=1e-6)


@pytest.mark.slow
def test_a_sweep_ends_with_a_run_that_ends() -> None:
    strong = 1e12  # elastic rebounds under it take 4e-6
    seen = sim.sweep(([0.1], [0.0]), "a", [1.5, strong, 0.1], periods=2, gamma=0.0, k=1.0)
    assert seen.stop is sim.RunStop.CHATTER
    assert seen.value.tolist() == [1.5]
    with pytest.raises(NotConverged, match=r"at a = 1e\+12: site 0 has more than 150000 impacts"):
        sim.sweep(([0.1], [0.0]), "a", [strong, 1.5], periods=2, gamma=0.0, k=1.0)


# --- basins ---------------------------------------------------------------------------------------


def test_starts_of_a_basin_are_where_its_axes_say() -> None:
    """Columns are values of x, rows of y; site -1 is the last one."""
    shared = {"a": 0.0, "gamma": 0.0, "k": 0.8, "periods": 2}
    found = sim.attraction(
        ([0.5, 0.0, 0.0], [0.0, 0.0, 0.0]), sim.Axis("u", -1, [0.0, 0.25, 1.5, -1.0]),
        sim.Axis("u", 1, [0.0, 0.125, -1.5]), executor=1, tolerance=0.2, **shared,
    )  # fmt: skip
    far = np.maximum.outer([0.0, 0.125], [0.0, 0.25, 1.0])  # nothing moves: distances as put
    inside = found.distance[:2][:, [0, 1, 3]]
    assert inside == pytest.approx(far)
    assert np.isnan(found.distance[:, 2]).all()
    assert np.isnan(found.distance[2]).all()
    assert (found.outcome[:2, 0] == sim.Outcome.RETURNED).all()
    assert (found.outcome[:2, 1] == sim.Outcome.QUIET).all()
    assert (found.outcome[2] == sim.Outcome.OUTSIDE).all()
    assert found.share == pytest.approx(2 / 6)
    assert repr(found) == (
        "<Basin of 4 x 3 starts over u_-1 and u_1: 2 back at the breather; 4 no impacts; "
        "6 behind a wall>"
    )
    assert repr(replace(found, complete=False)).endswith("behind a wall; cut short>")


def test_no_start_inside_the_walls_has_no_share() -> None:
    found = sim.attraction(
        ([0.0], [0.0]), sim.Axis("u", 0, [2.0, -2.0]), sim.Axis("v", 0, [0.0]),
        a=0.0, gamma=0.0, k=0.8, periods=2, executor=1,
    )  # fmt: skip
    assert found.share == 0.0


def test_another_breather_at_the_site_is_another_motion() -> None:
    """The single oscillator beyond its pitchfork has two: each is the other one's OTHER."""
    shared = {"a": 0.8, "gamma": 0.0, "k": 0.8}
    settled = sim.simulate(cb.symmetric(**shared).state(1), periods=400, **shared)
    own = sim.periodic(settled.final, **shared)
    u, v = (float(x[0]) for x in own.state)
    found = sim.attraction(
        own.state, sim.Axis("u", 0, [u]), sim.Axis("v", 0, [v, -v - 0.3]),
        periods=300, executor=1, **shared,
    )  # fmt: skip
    assert found.outcome[0, 0] == sim.Outcome.RETURNED
    assert set(found.outcome[:, 0].tolist()) <= {sim.Outcome.RETURNED, sim.Outcome.OTHER}


def test_a_breather_on_its_way_back_is_not_told_to_be_another() -> None:
    shared = {"a": 0.3, "gamma": 0.05, "k": 0.8, "damping": 0.02}
    own = sim.periodic(cb.symmetric(a=0.3, gamma=0.05, k=0.8).state(6), symmetric=True, **shared)
    axes = sim.Axis("u", 3, [0.5]), sim.Axis("v", 0, [own.state.v[0]])
    early, late = (
        sim.attraction(own.state, *axes, periods=n, executor=1, **shared) for n in (40, 300)
    )
    assert "1 a breather, another or not back yet" in repr(early)
    assert "1 back at the breather" in repr(late)


# --- runs -----------------------------------------------------------------------------------------


def test_impacts_of_one_site_are_counted_around_the_ring() -> None:
    run = sim.simulate(cb.symmetric(0.5, 0.08, 0.8).state(5), a=0.5, gamma=0.08, k=0.8, periods=3)
    assert len(run.at_site(0)) == len(run.at_site(5)) == len(run.at_site(-5)) == 6
    assert len(run.at_site(0, 1)) == len(run.at_site(0, -1)) == 3
    assert (run.at_site(0, -1)["wall"] == -1).all()
    assert len(run.at_site(1)) == 0
    assert repr(run) == "<Run of 5 sites over 3 periods: 6 impacts; went through all its periods>"


@pytest.mark.parametrize("walls", ["rigid", "smooth"])
@pytest.mark.parametrize("periods", [0, 0.25, 1, 1.5])
def test_a_fraction_of_a_period_is_at_the_end_of_a_run_and_not_in_its_section(walls, periods):
    shared = {"a": 0.3, "gamma": 0.05, "k": 0.8, "t0": 0.7, "sample": sim.Sample((0, -1), 4)}
    u0 = np.array([0.2, -0.1, 0.0])
    state = u0, np.zeros(3)
    make = sim.simulate if walls == "rigid" else sim.simulate_smooth
    run = make(state, periods=periods, **shared, **({} if walls == "rigid" else {"m": 6}))
    assert (run.sites, run.periods) == (3, int(periods))
    assert (" over 1 period" if periods == 1 else f" over {periods} periods") in repr(run)
    assert "1 periods" not in repr(run)
    assert run.end == pytest.approx(0.7 + PERIOD * periods, abs=1e-12)
    assert run.times == pytest.approx(0.7 + PERIOD * np.arange(int(periods) + 1), abs=1e-12)
    assert run.strobe.u.shape == (int(periods) + 1, 3)
    assert isinstance(run.record, sim.Record)
    assert run.record.sites == (0, 2)
    assert run.record.times == pytest.approx(0.7 + PERIOD / 4 * np.arange(4 * int(periods)))
    if periods >= 1:
        assert run.record.u[0] == pytest.approx(u0[[0, 2]])
        assert run.record.u[4:].shape == (0, 2)
    assert (np.array_equal(run.final.u, run.strobe.u[-1])) == float(periods).is_integer()
    # the same run in two pieces
    if periods == 1.5:
        del shared["sample"]
        more = {} if walls == "rigid" else {"m": 6}
        first = make(state, periods=1, **shared, **more)
        rest = make(first.final, periods=0.5, **{**shared, "t0": first.end}, **more)
        assert rest.final.u == pytest.approx(run.final.u, abs=1e-8)


def test_states_without_a_periodic_motion_nearby_say_how_far_newton_came() -> None:
    with pytest.raises(NotConverged, match="no periodic motion near this state") as caught:
        sim.periodic(([0.3], [2.0]), a=0.0, gamma=0.0, k=0.5)
    assert caught.value.residual > 0.0


def test_growth_is_the_logarithm_of_the_largest_multiplier_a_unit_of_time() -> None:
    b = cb.symmetric(0.3, 0.05, 0.8)
    shared = {"a": 0.3, "gamma": 0.05, "k": 0.8, "damping": 0.05}
    own = sim.periodic(b.state(4), periods=1, **shared)
    assert math.exp(own.growth * 2.0 * math.pi) == pytest.approx(own.largest, rel=1e-12)
    twice = sim.periodic(b.state(4), periods=2, **shared)
    assert twice.growth == pytest.approx(own.growth, rel=1e-6)
    assert twice.run().periods == 2
    assert twice.run(periods=5).periods == 5
    assert twice.run().strobe.u[-1] == pytest.approx(own.state.u, abs=1e-9)
    assert repr(twice).startswith(
        "<PeriodicMotion on the ring of 4 at a = 0.3, gamma = 0.05, k = 0.8"
    )
    assert "closes after 2 x 2 pi to" in repr(twice)
    half = sim.periodic(b.state(4), symmetric=True, **shared)
    assert "closes after half a period to" in repr(half)
    assert half.multipliers == pytest.approx(half.half**2)
    assert own.half is None
    assert half.largest == pytest.approx(own.largest, rel=1e-7)
    assert own.residual < 1e-9


# --- what runs leave behind -----------------------------------------------------------------------


ON = {"a": 0.5, "gamma": 0.08, "k": 0.8}
STATE = cb.symmetric(**ON).state(3)


def test_every_impact_is_in_the_period_of_its_time() -> None:
    """Over more of them than a log has room for at first."""
    t0 = 0.3
    run = sim.simulate(STATE, periods=500, t0=t0, damping=0.1, **ON)
    since = run.impacts["time"] - t0
    assert len(since) > 512
    assert (np.diff(since) >= 0).all()
    assert np.array_equal(run.impacts["period"], np.floor(since / (2 * np.pi)))
    phase = np.exp(1j * run.impacts["phase"]) * np.exp(-1j * run.impacts["time"])
    assert abs(phase - 1).max() < 1e-11
