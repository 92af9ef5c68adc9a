"""Every column of every problem of breathers and orbits: there, and what its name says."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

import contbreather as cb
from contbreather.continuation import Problem
from contbreather.orbits.branch_switching import lift
from contbreather.orbits.by_impacts import impact_problem
from contbreather.orbits.constructors import asymmetric, shooting

BASE = {"a", "gamma", "k", "arclength", "residual", "unstable"}


def unfolded_arm() -> Problem:
    start = shooting(cb.symmetric(0.7, 0.04, 0.8), sites=8)
    point = cb.trace(start, "a", towards="up", within={"a": (0.0, 0.8)}).first("PF")
    return lift(point).arm(0.05)


CASES: dict[str, tuple[Callable[[], Problem], set[str]]] = {
    "breather": (
        lambda: cb.symmetric(0.5, 0.05, 0.8).problem,
        {"p", "phi", "t1", "t2", "c", "asymmetry"},
    ),
    "arm": (lambda: asymmetric(0.8, 0.04, 0.8).problem, {"p", "t1", "t2", "c", "asymmetry"}),
    "general": (
        lambda: impact_problem(cb.symmetric(0.5, 0.05, 0.8).unfolded()),
        {"t1", "t2", "J1", "J2", "c", "p", "asymmetry"},
    ),
    "shot": (
        lambda: shooting(cb.symmetric(0.5, 0.05, 0.8), sites=8),
        {"t1", "t2", "J1", "p", "c", "asymmetry", "condition"},
    ),
    "shot, open": (
        unfolded_arm,
        {"t1", "t2", "J1", "J2", "p", "p1", "p2", "c", "asymmetry", "condition"},
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_columns_are_those_of_the_kind_of_orbit_and_each_can_be_read(name: str) -> None:
    make, own = CASES[name]
    problem = make()
    a = problem.params["a"]
    branch = cb.trace(problem, "a", within={"a": (a - 0.004, a + 0.004)}, events=())
    shown = set(branch.names)
    assert own <= shown
    extra = shown - own - BASE
    assert not {"asymmetry", "c", "t2", "p1", "p2", "J1"} & extra, extra
    for column in branch.names:
        assert np.isfinite(branch[column]).all(), column
    if "asymmetry" in own:
        np.testing.assert_allclose(
            branch["asymmetry"], branch["t2"] - branch["t1"] - math.pi, atol=1e-13
        )
    if "J1" in own:
        np.testing.assert_allclose(branch["p"], -branch["J1"] / 2, atol=1e-13)
    solutions = [point.solution for point in branch]
    if "c" in own:
        np.testing.assert_allclose(branch["c"], [one.c for one in solutions], atol=1e-13)
    np.testing.assert_array_equal(branch["gamma"], problem.params["gamma"])


@pytest.mark.parametrize("k", [-0.01, 1.01, 2.0])
def test_no_orbit_is_shot_with_a_restitution_that_cannot_be(k: float) -> None:
    problem = shooting(cb.symmetric(0.5, 0.04, 0.8), sites=8)
    assert cb.trace(problem.at(k=1.0), "a", within={"a": (0.45, 0.55)})["k"].tolist()[0] == 1.0
    with pytest.raises(cb.BadInput, match=rf"the start has k={k:g}, outside \(0, 1\)"):
        cb.trace(problem.at(k=k), "a", within={"a": (0.45, 0.55)})


FIXED = cb.symmetric(0.75, 0.04, 0.8, lattice=cb.OpenChain(5), site=2, spring=0.05, damping=0.02)
TWO = cb.multibreather([0, 3], a=0.7, gamma=0.02, k=0.8, lattice=cb.Ring(9), damping=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("start", [FIXED, TWO], ids=["springs", "two sites"])
def test_arms_of_finite_lattices_have_asymmetry_and_all_momenta_and_come_back_to_pf(start) -> None:
    within = {"a": (0.7, 0.85)}
    fork = cb.trace(start, "a", within=within).first("PF")
    arm = cb.switch(fork, within=within)[0]
    orbit, m = arm[-1].solution, start.section.count
    lags = (orbit.times[m:] - orbit.times[:m]) % orbit.period - math.pi
    assert arm[-1]["asymmetry"] == orbit.asymmetry
    assert abs(orbit.asymmetry) == abs(lags).max()
    halves = [arm[-1][f"p{j + 1}"] for j in range(2 * m)]
    assert halves == pytest.approx(0.5 * abs(orbit.impulses), abs=1e-15)
    assert (abs(halves[0] - halves[m]) > 1e-3) == (start.spring > 0.0)  # else one pays the other
    back = cb.trace(arm[len(arm) // 2], "a", within=within, towards="down")
    there = back.first("PF")
    assert there["a"] == pytest.approx(fork["a"], abs=1e-12)
    assert abs(there["asymmetry"]) < 1e-9
    assert "goes on as its own image" in back.reason  # along the other arm
    for other in cb.switch(there, within=within):
        assert abs(other["asymmetry"]).max() < 1e-6


def test_a_pitchfork_from_an_arm_is_one_in_files_too(tmp_path) -> None:
    within = {"a": (0.75, 0.85)}
    arm = cb.switch(cb.trace(FIXED, "a", within=within).first("PF"), within=within)[0]
    back = cb.trace(arm[len(arm) // 2], "a", within=within, towards="down")
    cb.save(tmp_path / "back.nc", back)
    again = cb.load(tmp_path / "back.nc")
    assert [point.label for point in again.special] == [point.label for point in back.special]
    (one, *_) = cb.switch(again.first("PF"), within=within)
    assert abs(one["asymmetry"]).max() < 1e-6


def test_what_is_followed_from_where_two_crests_graze_is_grazing() -> None:
    start = cb.symmetric(0.6, 0.1, 0.05)
    point = cb.trace(start, "a", towards="up", within={"a": (0.0, 1.2)}).first("GR")
    line = cb.boundary(point, ("gamma", "a"), within={"gamma": (0.0, 0.24)})
    met = next(p for p in line.special if p.kind == "GR-GR")
    assert cb.boundary(met, ("gamma", "a"), within={"gamma": (0.0, 0.24)}).problem.label == (
        "GR boundary"
    )


def test_where_damping_ends_there_is_no_count_for_the_circle_itself() -> None:
    start = cb.symmetric(0.6, 0.05, 0.8, lattice=cb.Ring(9), damping=0.01)
    event = cb.neimark_sacker(threshold=1.0)
    branch = cb.trace(
        start, "damping", within={"damping": (0, 0.1)}, towards="both", events=[event]
    )
    loose = branch["damping"] == 0.0
    assert loose.any()
    assert np.array_equal(np.isnan(branch["unstable"]), loose)
    assert branch["unstable"][~loose][-1] == 0


HALVES = {
    "closed form": cb.symmetric(0.5, 0.04, 0.8),
    "ring": cb.symmetric(0.5, 0.04, 0.8).on(cb.Ring(12)),
    "losses": FIXED,
    "two sites": TWO,
    "wall -1 first": cb.multibreather({0: "upper", 4: "lower"}, a=0.6, gamma=0.02, k=0.8,
                                      damping=0.01, lattice=cb.Ring(9)),
}  # fmt: skip


@pytest.mark.parametrize("name", HALVES)
def test_a_symmetric_branch_has_the_columns_of_its_arms(name: str) -> None:
    """Those of the whole period, of which it is half; asymmetry and offset are none."""
    start = HALVES[name]
    branch = cb.trace(start, "a", within={"a": (start.a - 0.01, start.a + 0.01)})
    assert start.symmetric
    for point in branch:
        whole = point.solution.unfolded()
        named = [point[f"t{i + 1}"] for i in range(whole.section.count)]
        np.testing.assert_allclose(named, whole.times, atol=1e-13)
        assert point["p"] == pytest.approx(0.5 * abs(whole.impulses[0]), abs=1e-13)
    assert not {*branch["asymmetry"], *branch["c"]} - {0.0}
    if start.section.count == 1:
        assert branch["t2"] == pytest.approx(branch["t1"] + math.pi, abs=1e-13)
    # a table to be read has what has been solved for
    printed = {column.heading for column in branch.table().columns}
    assert not {"asymmetry", "c", f"t{2 * start.section.count}"} & printed


@pytest.mark.parametrize("start", [cb.symmetric(0.7, 0.04, 0.8), FIXED, TWO])
def test_an_arm_sets_out_from_the_columns_of_its_branch(start) -> None:
    within = {"a": (0.7, 0.85)}
    fork = cb.trace(start, "a", within=within).first("PF")
    for arm in cb.switch(fork, within=within):
        times = [f"t{i + 1}" for i in range(2 * start.section.count)]
        for name in (*times, "asymmetry", "p", "a"):
            assert arm[0][name] == pytest.approx(fork[name], abs=1e-8), name


def test_a_parameter_of_a_forcing_keeps_its_name_where_a_column_has_it() -> None:
    class Pushed(cb.Harmonic):
        """A forcing with a parameter c that does nothing."""

        @property
        def params(self) -> dict[str, float]:
            return {"c": 0.25}

        def at(self, /, **params: float) -> Pushed:
            return self

        def slope_harmonics(self, name: str) -> tuple[()]:
            return ()

    branch = cb.trace(cb.symmetric(0.5, 0.05, 0.8, forcing=Pushed()), "a", within={"a": (0.5, 0.6)})
    assert {*branch["c"]} == {0.25}
    assert {*branch["asymmetry"]} == {0.0}
