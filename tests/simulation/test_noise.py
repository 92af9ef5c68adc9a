"""White noise on all sites: its strength, its impacts, and what a verdict says under it."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.linalg import toeplitz

import contbreather as cb
from contbreather.simulation import Kind, State, judge

ON: dict[str, Any] = {"a": 0.5, "gamma": 0.05, "k": 0.8, "damping": 0.02}
START = cb.symmetric(0.5, 0.05, 0.8).state(8)


@pytest.mark.slow
def test_noise_of_a_linear_lattice_has_the_covariance_of_its_fluctuation_theorem() -> None:
    """``<v v> = s^2/(2 mu)`` and ``<u u> = s^2/(2 mu) K^-1`` without walls, by 18,000 values."""
    sites, mu, spring, gamma, strength = 900, 0.5, 0.5, 0.1, 0.3
    rest = (np.zeros(sites), np.zeros(sites))
    on = {"a": 1e-9, "gamma": gamma, "k": 0.8, "damping": mu, "spring": spring}
    run = cb.simulate(rest, periods=24, noise=strength, seed=1, walls=(None, None), **on)
    u, v = (states[5:] for states in run.strobe)
    row = np.zeros(sites)
    row[[0, 1, -1]] = spring + 2 * gamma, -gamma, -gamma
    wanted = strength**2 / (2 * mu) * np.linalg.inv(toeplitz(row))[0]
    assert v.var() == pytest.approx(strength**2 / (2 * mu), rel=0.04)
    assert u.var() == pytest.approx(wanted[0], rel=0.04)
    assert (u * np.roll(u, 1, axis=1)).mean() == pytest.approx(wanted[1], rel=0.1)
    assert abs((u * v).mean()) < 0.03 * wanted[0]


def test_noise_at_another_frequency_of_the_drive_is_in_the_units_of_its_damping() -> None:
    rest, omega = np.zeros(900), 2.0
    on = {"a": 1e-9, "gamma": 0.1, "k": 0.8, "damping": 0.5, "spring": 0.5, "omega": omega}
    run = cb.simulate((rest, rest), periods=24, noise=0.3, seed=1, walls=(None, None), **on)
    assert (omega**2 * run.strobe.v[8:].var()) == pytest.approx(0.3**2 / (2 * 0.5), rel=0.04)


def test_the_same_seed_gives_the_same_run_and_another_one_another() -> None:
    one, same, other = (
        cb.simulate(START, periods=7.5, noise=1e-3, seed=seed, **ON) for seed in (3, 3, 4)
    )
    assert np.array_equal(one.strobe.u, same.strobe.u)
    assert np.array_equal(one.final.v, same.final.v)
    assert one.end == 7.5 * 2 * math.pi
    assert abs(one.strobe.u[-1] - other.strobe.u[-1]).max() > 1e-4
    still, plain = (
        cb.simulate(START, periods=7, noise=0.0, **ON),
        cb.simulate(START, periods=7, **ON),
    )
    assert np.array_equal(still.strobe.u, plain.strobe.u)
    weak = cb.simulate(START, periods=7, noise=1e-12, **ON)
    assert weak.strobe.u == pytest.approx(plain.strobe.u, abs=1e-9)
    assert weak.impacts["time"] == pytest.approx(plain.impacts["time"], abs=1e-9)


@pytest.mark.parametrize("k", [0.8, 0.0])
def test_impacts_under_noise_obey_their_law_and_walls_hold(k: float) -> None:
    run = cb.simulate(START, periods=20, noise=0.3, seed=5, **{**ON, "k": k})
    hits = run.impacts
    assert len(np.unique(hits["site"])) == 8
    assert abs(run.strobe.u).max() <= 1.0
    assert (hits["before"] * hits["wall"] > 0.0).all()
    assert hits["after"] == pytest.approx(-k * hits["before"], abs=1e-13)
    assert (np.diff(hits["time"]) > -1e-12).all()
    assert (hits["period"] == np.floor(hits["time"] / (2 * math.pi))).all()
    turn = np.remainder(hits["time"] - hits["phase"] + 1.0, 2 * math.pi) - 1.0
    assert abs(turn).max() < 1e-12
    assert (run.rests.size > 0) == (k == 0.0)


@pytest.mark.slow
def test_under_noise_a_verdict_says_whether_the_breather_is_there_and_no_more(tmp_path: Path):
    found = [judge(cb.simulate(START, periods=50, noise=s, **ON)) for s in (1e-4, 0.5)]
    assert [one.kind for one in found] == [Kind.NOISY, Kind.DELOCALISED]
    assert [one.motion for one in found] == [Kind.NOISY, Kind.NOISY]
    assert "8 of 8 sites hit their walls" in found[1].reason
    assert "under noise of strength 0.5" in found[1].reason
    cb.save(tmp_path / "run.nc", found[1].run)
    assert cb.load(tmp_path / "run.nc").noise == 0.5


@pytest.mark.slow
@pytest.mark.parametrize(
    ("strength", "walls", "kind", "words"),
    [
        (0.1, None, Kind.DELOCALISED, "0 of 8 sites hit their walls regularly, participation"),
        (1e-5, 1.0, Kind.SYNCHRONISED, "no site hits regularly; each within 0.00"),
    ],
)
def test_under_noise_from_rest_no_breather_is_there(strength, walls, kind, words) -> None:
    walls = (None, None) if walls is None else (-walls, walls)
    on = {"a": 0.3, "gamma": 0.05, "k": 0.8, "damping": 0.1, "walls": walls}
    run = cb.simulate(np.zeros((2, 8)), periods=60, noise=strength, seed=4, **on)
    found = judge(run.since(30))
    assert (found.kind, found.motion) == (kind, Kind.NOISY)
    assert found.reason.startswith(words)


@pytest.mark.slow
def test_a_breather_under_noise_hits_regularly_and_others_now_and_then() -> None:
    run = cb.simulate(START, periods=40, noise=1e-4, **ON)
    stray = run.impacts[-7:].copy()
    stray["site"] = range(1, 8)  # all others, once each
    found = judge(replace(run, impacts=np.concatenate([run.impacts, stray])))
    assert found.kind is Kind.NOISY
    assert found.evidence["impacting"] == 8
    assert found.reason.startswith("1 of 8 sites hit their walls regularly, participation ratio 1.")
    every_second = run.impacts[run.impacts["period"] % 2 == 0]
    assert judge(replace(run, impacts=every_second)).kind is Kind.NOISY
    assert judge(replace(run, impacts=stray)).kind is Kind.DELOCALISED
    # regularly, but the energy is all over the lattice
    rng = np.random.default_rng(0)
    broad = State(*(x + rng.normal(size=x.shape) for x in run.strobe))
    assert judge(replace(run, strobe=broad)).kind is Kind.DELOCALISED


# --- impacts everywhere ---------------------------------------------------------------------------


def after(a: float, k: float, damping: float) -> Any:
    rng = np.random.default_rng(1)
    state = rng.uniform(-0.9, 0.9, 6), rng.normal(size=6)
    on = {"a": a, "gamma": 0.2, "k": k, "damping": damping}
    return cb.simulate(state, periods=600, **on).since(300), on


def test_where_the_breather_is_lost_to_a_motion_that_repeats_that_is_said() -> None:
    run, _ = after(0.9, 0.9, 0.01)
    found = judge(run)
    assert (found.kind, found.motion) == (Kind.DELOCALISED, Kind.PERIODIC)
    assert "6 of 6 sites hit their walls" in found.reason
    assert "; periodic, " in found.reason
    # the run itself comes back
    assert abs(run.strobe.u[-1] - run.strobe.u[-2]).max() < 1e-9
    assert found.evidence["periods"] == 1.0
    assert found.evidence["multiplier"] < 1.0


def test_where_it_is_lost_to_chaos_the_exponent_is_that_of_two_runs_side_by_side() -> None:
    run, on = after(1.5, 0.9, 0.02)
    found = judge(run)
    assert (found.kind, found.motion) == (Kind.DELOCALISED, Kind.CHAOTIC)
    exponent, error = (found.evidence[name] for name in ("exponent", "exponent_error"))
    assert f"chaotic, largest exponent {exponent:.2g} ({error:.0e})" in found.reason
    growth = []
    for i in range(0, 280, 4):
        u, v = run.strobe.u[i], run.strobe.v[i]
        pair = [cb.simulate((u, v + push), periods=7, **on) for push in (0.0, 1e-9)]
        apart = abs(pair[0].strobe.u - pair[1].strobe.u).max(axis=1)
        growth.append(math.log(apart[7] / apart[2]) / (10 * math.pi))
    assert np.mean(growth) == pytest.approx(exponent, abs=3 * error)
