"""Verdicts, multipliers and ranges at their thresholds: both sides of each, by given numbers."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from contbreather.simulation import Kind, State, judge, simulate, simulate_smooth
from contbreather.simulation.integrator import IMPACT
from contbreather.simulation.periodic import PeriodicMotion
from contbreather.simulation.states import PERIOD

GOLDEN = 0.3819660113

ON = {"a": 0.2, "gamma": 0.05, "k": 0.8, "damping": 0.1}
REST = np.zeros(3), np.zeros(3)
RIGID = simulate(REST, periods=60, **ON)
SMOOTH = simulate_smooth(REST, periods=60, m=2, **ON)
RUNS = {"rigid": RIGID, "smooth": SMOOTH}


def motion(run: Any, matrix: Any, **given: Any) -> PeriodicMotion:
    own = {"t0": 0.0, "periods": 1, "symmetric": False, "residual": 1e-12, **given}
    return PeriodicMotion(State(*REST), matrix=np.diag(matrix), conditions=run.conditions, **own)


@pytest.mark.parametrize(("walls", "slack"), [("rigid", 1e-9), ("smooth", 1e-7)])
def test_a_multiplier_is_outside_by_more_than_rounding_or_integration_leaves(walls, slack) -> None:
    own = motion(RUNS[walls], [0.5, -(1 + 0.8 * slack), 1 + 1.2 * slack, -2.0, 0.0, 1.0])
    assert own.unstable == 2
    assert abs(own.multipliers).tolist() == sorted(abs(own.multipliers), reverse=True)
    assert (own.largest, own.half) == (2.0, None)
    assert own.growth == math.log(2.0) / (2 * math.pi)
    assert replace(own, periods=3).growth == math.log(2.0) / (6 * math.pi)
    half = replace(own, symmetric=True)
    assert half.half[0] == 2.0  # of -2: the sign of the half map
    assert half.multipliers[0] == half.largest == 4.0


# --- runs made by hand --------------------------------------------------------------------------


def run_of(walls: str, u: np.ndarray, v: np.ndarray, hits: Any = (), **on: float) -> Any:
    """A run with these states once in a period (of site 0 alone, or of all of six), in which these
    sites hit in every period."""
    if u.ndim == 1:
        u, v = (np.pad(x[:, None], ((0, 0), (0, 5))) for x in (u, v))
    make, rest = (simulate, {}) if walls == "rigid" else (simulate_smooth, {"m": 6})
    on = {"a": 1e-3, "gamma": 0.05, "k": 0.8, "damping": 0.01, **on}
    run = make((0.0 * u[0], 0.0 * u[0]), periods=0, **on, **rest)
    run = replace(
        run, times=PERIOD * np.arange(len(u)), strobe=State(u, v), final=State(u[-1], v[-1])
    )
    if walls == "smooth":
        return run
    table = np.zeros(len(hits) * (len(u) - 1), IMPACT)
    table["site"] = np.tile(np.array(hits, int), len(u) - 1)
    table["period"] = np.repeat(np.arange(len(u) - 1), len(hits))
    return replace(run, impacts=table)


def noise(sites: int, periods: int = 120) -> np.ndarray:
    return 0.1 * np.random.default_rng(0).normal(size=(2, periods + 1, sites))


@pytest.mark.parametrize(("sites", "most"), [(3, 2), (8, 2), (12, 3), (20, 5)])
def test_impacts_of_more_than_a_quarter_of_the_sites_are_all_over_the_ring(sites, most) -> None:
    found = judge(run_of("rigid", *noise(sites), hits=range(most + 1)))
    assert found.kind is Kind.DELOCALISED
    assert found.reason.startswith(f"{most + 1} of {sites} sites hit their walls, participation")
    assert found.evidence["impacting"] == most + 1
    assert judge(run_of("rigid", *noise(sites), hits=range(most))).kind is not Kind.DELOCALISED


def test_what_hit_in_the_first_half_only_has_come_to_rest() -> None:
    run = run_of("rigid", *noise(8), hits=range(8))
    found = judge(replace(run, impacts=run.impacts[run.impacts["period"] < 60]))
    assert found.kind is Kind.SYNCHRONISED
    assert found.reason.startswith("no impacts; every site within")


@pytest.mark.slow
@pytest.mark.parametrize("walls", ["rigid", "smooth"])
def test_sites_in_unison_are_synchronised_though_all_hit(walls: str) -> None:
    u, v = (np.repeat(x, 6, axis=1) for x in noise(1, 60))
    found = judge(run_of(walls, u, v, hits=range(6)))
    assert found.kind is Kind.SYNCHRONISED
    assert found.reason == "all 6 sites are within 0 of each other"
    apart = 1e-5 * np.arange(6)
    for off in ((u + apart, v), (u, v + apart)):
        assert judge(run_of(walls, *off, hits=range(6))).kind is Kind.DELOCALISED
    alone = judge(run_of(walls, u[:, :1], v[:, :1], hits=[0]))
    assert alone.kind is not Kind.SYNCHRONISED


def test_distance_from_the_forced_motion_is_that_of_displacements_and_velocities() -> None:
    """At rest with the forcing off, but for one site in the second half of the run."""
    for name in ("u", "v"):
        off = State(np.zeros((121, 6)), np.zeros((121, 6)))
        getattr(off, name)[100, 2], getattr(off, name)[10, 4] = -0.25, 0.5
        found = judge(run_of("rigid", *off, a=0.0))
        assert found.evidence["aside"] == 0.25
        assert found.evidence["spread"] == 0.5


@pytest.mark.slow
def test_smooth_energy_all_over_the_ring_is_delocalised() -> None:
    u, v = 1e-2 * noise(5, 59)
    v[:, :4] += 1.0
    found = judge(run_of("smooth", u, v))
    assert found.kind is Kind.DELOCALISED
    assert found.reason.startswith("participation ratio 4.0 of 5; undecided, ")
    v[:, 1:4] -= 1.0
    assert judge(run_of("smooth", u, v)).kind is not Kind.DELOCALISED


@pytest.mark.parametrize(("period", "kind"), [(1, Kind.PERIODIC), (2, Kind.UNDECIDED)])
def test_of_a_long_smooth_ring_no_multipliers_are_computed(period: int, kind: Kind) -> None:
    u, v = np.zeros((2, 60, 61))
    v[:, 0] = 1.0 + 0.1 * (np.arange(60) % period)
    found = judge(run_of("smooth", u, v))
    assert found.kind is kind
    after = "a period" if period == 1 else "2 periods"
    assert found.reason == f"returns to 0 after {after}, its multipliers were not computed"
    if period == 1:
        noisy = v + 1e-7 * np.random.default_rng(0).normal(size=v.shape)
        assert judge(run_of("smooth", u, noisy)).kind is not Kind.PERIODIC


def turning(number: float, shrinks: float = 0.0, count: int = 600) -> tuple[Any, Any]:
    """A section that turns steadily, and maybe spirals inwards."""
    j = np.arange(count)
    t, size = 2.0 * np.pi * number * j, np.exp(-shrinks * j)
    return 0.3 * size * np.cos(t), 0.4 * size * np.sin(t) - 1.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("walls", "q", "on"),
    [("smooth", 3, {}), *(("rigid", q, {"a": 0.93, "gamma": 0.0, "damping": 0.0}) for q in (1, 3))],
)
def test_states_that_repeat_without_an_orbit_that_closes_are_not_locked(walls, q, on) -> None:
    u, v = turning(1 / q, count=201)
    if walls == "rigid":
        u, v = u[:, None], v[:, None]
    found = judge(run_of(walls, u, v, hits=[0], **on))
    assert found.kind is Kind.UNDECIDED, str(found)
    assert "finds no closed orbit" in found.reason


def test_spiral_is_undecided() -> None:
    found = judge(run_of("smooth", *turning(GOLDEN, 2e-3)))
    assert found.kind is Kind.UNDECIDED
    assert "size changes" in found.reason


def test_noise_is_undecided_for_nothing_here_tells_it_from_chaos() -> None:
    u, v = np.random.default_rng(0).normal(size=(2, 300))
    assert judge(run_of("smooth", 0.2 * u, 0.2 * v - 1.0)).kind is Kind.UNDECIDED
