"""Beyond grazing: at GR the branch with the impacts more, at VI the one with the impacts less."""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import numpy as np
import pytest

import contbreather as cb
from contbreather.continuation.branches.switching import NothingToSwitch
from tests.campaigns.beyond import checked, run

CHAINS = {
    "ring": {"gamma": 0.05, "k": 0.8, "damping": 0.02, "lattice": cb.Ring(9)},
    "endless": {"gamma": 0.05, "k": 0.8},
    "grid": {"gamma": 0.03, "k": 0.7, "damping": 0.01, "lattice": cb.Grid(3, 3), "site": 4},
    "open": {"gamma": 0.04, "k": 0.6, "damping": 0.03, "lattice": cb.OpenChain(5), "site": 1},
}


FEW = cb.Steps(most=3)


@cache
def grazing(name: str) -> cb.Point:
    breather = cb.symmetric(0.7, **CHAINS[name])
    return cb.trace(breather, "a", towards="up").first("GR")


def near(end: cb.Point) -> dict[str, tuple[float, float]]:
    return {"a": (end["a"] - 0.02, end["a"] + 0.02)}


@pytest.mark.slow
def test_an_impulse_leads_away_from_grazing_as_far_as_it_was_computed_by_hand():
    # both neighbours of a ring of 9 at once, from a solver of the same orbits of its own
    end = grazing("ring")
    assert end["a"] == pytest.approx(0.9126951531, abs=1e-10)
    (arm,) = cb.switch(end, within={"a": (0.85, 1)})
    assert (arm[0]["beyond"], arm[0]["a"]) == ("fold", end["a"])
    assert arm[1].solution.section.impacts == ((0, 1), (1, 1), (8, 1))
    for J, off, largest in (
        (0.001, -0.000821, 8433),
        (0.004, -0.003283, 2104),
        (0.016, -0.013130, 522),
        (0.06, -0.049228, 135),
    ):
        at = cb.trace(arm[2], "a", events=[cb.user("J2", -J)], within={"a": (0.85, 1)})
        there = at.first("UZ")
        assert there["a"] - end["a"] == pytest.approx(off, abs=6e-7)
        mu = abs(there.solution.multipliers(half=True)).max()
        assert mu == pytest.approx(largest, abs=0.6)
        assert there.residual < 1e-13


def arm_of(end: cb.Point) -> cb.Branch:
    pitchfork = cb.trace(end, "a", within={"a": (0.4, 1.0)}).first("PF")
    return cb.switch(pitchfork, within={"a": (0.4, 1.0)})[0]


PAIR = {"gamma": 0.04, "k": 0.8, "damping": 0.03, "lattice": cb.Ring(8)}
GRAZINGS = {  # with how often new impacts come in a section
    "ring": (lambda: grazing("ring"), 1),
    "endless": (lambda: grazing("endless"), 2),
    "two sites": (lambda: cb.trace(cb.multibreather([0, 3], a=0.7, **PAIR), "a").first("GR"), 1),
    "arm": (lambda: arm_of(cb.symmetric(0.75, 0.04, 0.8)).first("GR"), 1),
    "whole period": (lambda: cb.trace(grazing("ring").solution.unfolded(), "a").first("GR"), 2),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", GRAZINGS)
def test_the_limit_of_mu_times_J_is_where_multipliers_lead(name):
    where, times = GRAZINGS[name]
    end = where()
    within = near(end)
    (arm,) = cb.switch(end, within=within, steps=cb.Steps(first=1e-5, most=1))
    assert arm[0]["beyond"] == ("persists" if name == "arm" else "fold")
    impulses = arm[1].solution.impulses
    new = int(abs(impulses).argmin())
    J = 1e-3 * np.array([4.0, 2.0, 1.0, 0.5])
    at = [cb.user(f"J{new + 1}", float(np.copysign(value, impulses[new]))) for value in J]
    found = cb.trace(arm[1], "a", towards="both", events=at, within=within).special
    orbits = [p.solution for p in found if p.kind == "UZ"]
    orbits.sort(key=lambda orbit: -abs(orbit.impulses[new]))
    assert len(orbits) == len(J)
    limits = [(largest(orbit) ** (1 / times)) * j for orbit, j in zip(orbits, J, strict=True)]
    for order in (2, 4, 8):  # Richardson's: what is left falls as J, J^2, J^3
        limits = [(order * b - a) / (order - 1) for a, b in pairwise(limits)]
    assert arm[0]["|mu| J"] == pytest.approx(limits[0], rel=1e-9)


def largest(orbit: cb.Orbit) -> float:
    if orbit.lattice.sites is None:
        return float(abs(orbit.stability().multipliers).max())
    return float(abs(orbit.multipliers(half=orbit.symmetric)).max())


@pytest.mark.parametrize("name", CHAINS)
def test_grazing_and_the_impact_that_vanishes_are_one_place(name):
    end = grazing(name)
    within = near(end)
    (arm,) = cb.switch(end, within=within, steps=FEW)
    back = cb.trace(arm[2], "a", within=within).first("VI")
    assert abs(back["a"] - end["a"]) < 1e-12
    (less,) = cb.switch(back, within=within, steps=FEW)
    assert less[0].solution.section == end.solution.section
    assert abs(less[0]["a"] - end["a"]) < 1e-12
    assert less[0]["beyond"] == arm[0]["beyond"]
    assert less[0]["|mu| J"] == pytest.approx(arm[0]["|mu| J"], rel=1e-11)


@pytest.mark.parametrize("spring", [0.0, 0.1])
def test_a_site_that_a_mean_of_the_drive_has_moved_hits_beyond_its_grazing(spring):
    """The offset with which it begins is where the mean has put it."""
    on = {"lattice": cb.OpenChain(3, masses=[1, 1.2, 1]), "damping": 0.03, "spring": spring}
    breather = cb.symmetric(0.5, 0.05, 0.8, site=1, **on)
    drive = cb.Fourier(cos={0: 0.03, 1: -1})
    shot = cb.shooting(breather, symmetric=False, forcing=drive)
    end = cb.trace(shot, "a", towards="up").first("GR")
    (arm,) = cb.switch(end, within=near(end), steps=FEW)
    assert arm[1].solution.section.impacts == ((1, 1), (0, 1), (2, 1), (1, -1))
    orbit = arm[2].solution
    run = cb.simulate(orbit, periods=1)
    assert sorted(run.impacts["site"]) == [0, 1, 1, 2]
    np.testing.assert_allclose(run.final, orbit.state(), atol=1e-10)
    back = cb.trace(arm[2], "a", within=near(end)).first("VI")
    assert abs(back["a"] - end["a"]) < 1e-12


@pytest.mark.slow
def test_a_diagram_goes_on_beyond_grazing_when_asked():
    breather, within = cb.symmetric(0.85, **CHAINS["ring"]), {"a": (0.8, 1.0)}
    alone = cb.diagram(breather, "a", within=within)
    tree = cb.diagram(breather, "a", within=within, beyond=True)
    assert not any(place.point.kind == "GR" for place in alone.left)
    born = [birth.place.point.kind for birth in tree.births if birth.place]
    assert len(tree) > len(alone)
    three = tree[1 + born.index("GR")]
    assert three[0]["beyond"] == "fold"
    assert three[1].solution.section.hit == (0, 1, 8)


@pytest.mark.slow
def test_what_random_orbits_become_beyond_grazing_is_flown_by_an_integrator_of_its_own():
    found, wrong = run(3, seed=5)
    assert not wrong
    assert {what for _, what in found} == {"fold", "persists"}


@pytest.mark.parametrize(
    ("on", "says"),
    [
        ({"a": 0.7, "gamma": 0.0, "k": 0.8}, "the far field touches the walls: all sites hit them"),
        ({"a": 0.55, "gamma": 0.02, "k": 0.0}, "site 0 is pushed into the wall: beyond it sticks"),
    ],
)
def test_where_no_orbit_is_beyond_grazing_a_sentence_says_what_is(on, says):
    end = cb.trace(cb.symmetric(**on), "a", within={"a": (0.1, 1.5)}).first("GR")
    with pytest.raises(NothingToSwitch, match=says):
        cb.switch(end)


@pytest.mark.parametrize("gamma", [0.05, 0.12])
def test_a_site_that_grazes_between_its_impacts_hits_twice_in_a_row(gamma):
    breather, within = cb.symmetric(0.55, gamma, 0.01 if gamma < 0.1 else 0.001), {"a": (0.55, 1.5)}
    end = cb.trace(breather, "a", within=within).first("GR")
    (arm,) = cb.switch(end, within=within)
    twice = arm[len(arm) // 2].solution
    assert twice.section.impacts == ((0, 1), (0, 1), (0, -1), (0, -1))
    assert checked(twice) == ""


HARD = {  # and where the third impact is one of infinitely many
    "ring": {"gamma": 0.05, "k": 0.001, "lattice": cb.Ring(9)},
    "open": {"gamma": 0.03, "k": 0.002, "damping": 0.05, "lattice": cb.OpenChain(5), "site": 2},
}


@pytest.mark.parametrize("name", HARD)
def test_where_a_site_chatters_a_sentence_says_so_and_a_simulation_has_it_rest(name):
    within = {"a": (0.55, 1.5)}
    end = cb.trace(cb.symmetric(0.55, **HARD[name]), "a", within=within).first("GR")
    (twice,) = cb.switch(end, within=within)
    with pytest.raises(NothingToSwitch, match=r"site \d chatters: .* at rest on its wall"):
        cb.switch(twice[-1], within=within)
    for off, rests in ((-0.002, set()), (0.002, {HARD[name].get("site", 0)})):
        run = cb.simulate(twice[-1].solution, a=twice[-1]["a"] + off, periods=30)
        assert {*run.rests[run.rests["period"] == 29]["site"].tolist()} == rests


SOFT = {  # small k: site 0 grazes between its impacts, and what is beyond is stable
    "ring": {"gamma": 0.05, "k": 0.03, "damping": 0.02, "lattice": cb.Ring(9)},
    "grid": {"gamma": 0.03, "k": 0.01, "damping": 0.02, "lattice": cb.Grid(3, 3)},
    "open": {"gamma": 0.08, "k": 0.02, "damping": 0.05, "lattice": cb.OpenChain(5)},
}


@pytest.mark.slow
@pytest.mark.parametrize("name", SOFT)
def test_a_simulation_begun_beyond_grazing_comes_to_the_orbit_that_was_switched_to(name):
    within = {"a": (0.1, 1.5)}
    end = cb.trace(cb.symmetric(0.8, **SOFT[name]), "a", within=within).first("GR")
    (arm,) = cb.switch(end, within=within)
    a = 0.5 * (end["a"] + arm[-1]["a"])
    assert a > end["a"] + 1e-3  # the breather itself is nowhere there
    twice = cb.trace(arm[-1], "a", within={"a": (a, 1.5)})[0].solution
    assert (twice.a, twice.stability().stable) == (a, True)
    run = cb.simulate(end.solution, a=a, periods=400)
    assert np.abs(np.subtract(run.final, twice.state())).max() < 1e-11
    last = run.impacts[run.impacts["period"] == 399]
    assert sorted(zip(last["site"], last["wall"], strict=True)) == [(0, -1)] * 2 + [(0, 1)] * 2


LOST = {  # stable up to GR, where both orbits end
    "ring": {"gamma": 0.1, "k": 0.8, "damping": 0.02, "lattice": cb.Ring(9)},
    "grid": {"gamma": 0.06, "k": 0.7, "damping": 0.05, "lattice": cb.Grid(3, 3), "site": 4},
    "open": {"gamma": 0.1, "k": 0.7, "damping": 0.05, "lattice": cb.OpenChain(5), "site": 1},
}


@pytest.mark.parametrize("name", LOST)
def test_beyond_a_nonsmooth_fold_a_simulation_goes_where_its_sentence_says(name):
    within = {"a": (0.5, 1.5)}
    branch = cb.trace(cb.symmetric(0.5, **LOST[name]), "a", within=within)
    end, before = branch.first("GR"), [p for p in branch if p.kind != "GR"][-1].solution
    (arm,) = cb.switch(end, within=within)
    assert arm[0]["says"].endswith("a motion in which more hits its walls")
    hit = {*map(int, arm[0]["says"].partition(" hit")[0].split(maxsplit=1)[1].split(", "))}
    assert hit | {before.section.hit[0]} == {*arm[1].solution.section.hit}
    assert before.stability().stable
    short, beyond = (cb.simulate(before, a=a, periods=800) for a in (before.a, 1.003 * end["a"]))

    def hits(run):
        return {*run.impacts[run.impacts["period"] == 799]["site"].tolist()}

    assert hits(short) == {*before.section.hit}
    assert hits(beyond) >= {*arm[1].solution.section.hit}


@pytest.mark.slow
def test_an_orbit_that_persists_is_unstable_as_its_sentence_says_and_simulations_leave_it():
    within = {"a": (0.4, 1.5)}
    ring = cb.symmetric(0.75, 0.04, 0.8, damping=0.01, lattice=cb.Ring(9))
    (arm,) = cb.switch(arm_of(ring).first("GR"), within=within)
    assert arm[0]["beyond"] == "persists"
    assert "unstable as long as the impulse is small: a simulation leaves it" in arm[0]["says"]
    orbit = arm[1].solution
    largest = abs(orbit.multipliers()).max()
    assert largest > 10
    run = cb.simulate(orbit, periods=100)
    assert np.abs(np.subtract(run.final, orbit.state())).max() > 1e-2


@pytest.mark.slow
def test_what_ends_within_its_first_step_is_followed_to_there():
    """Site 4 comes to its other wall 0.0005 in a after the first."""
    within, parts = {"a": (0.5, 1.3)}, {"k": [0.8, 0.75, 0.8, 0.9, 0.6], "omega": 1.2, "site": 2}
    parts |= {"spring": [0.1, 0.0, 0.2, 0.05, 0.3], "damping": [0.01, 0.03, 0.0, 0.02, 0.01]}
    uneven = cb.symmetric(
        0.9, 0.05, lattice=cb.OpenChain(5), walls=[1, 1.2, 0.9, 1.0, 1.1], **parts
    )
    fork = cb.trace(uneven, "a", within=within).first("PF")
    end = cb.switch(fork, within=within)[0].first("GR")
    (arm,), (fine,) = (
        cb.switch(end, within=within, steps=steps) for steps in (None, cb.Steps(largest=1e-3))
    )
    assert [point.kind for point in arm.special] == ["EP", "GR"]
    assert arm[0]["beyond"] == "persists"
    assert arm[-1]["a"] == pytest.approx(fine.first("GR")["a"], abs=1e-13)


@pytest.mark.slow
def test_a_sentence_says_what_hits_twice_in_a_row_and_what_no_more():
    within = {"a": (0.5, 1.5)}
    end = cb.trace(cb.symmetric(0.8, **SOFT["ring"]), "a", within=within).first("GR")
    (arm,) = cb.switch(end, within=within)
    assert arm[0]["says"].startswith("site 0 hits its wall twice in a row; ")
    back = cb.trace(arm[2], "a", within=within).first("VI")
    (less,) = cb.switch(back, within=within)
    assert less[0]["says"].startswith("site 0 hits its wall twice in a row no more; ")
    uneven = {"lattice": cb.OpenChain(5), "site": 2, "spring": [0.1, 0.2, 0.1, 0.1, 0.1]}
    end = cb.trace(cb.symmetric(0.6, 0.05, 0.8, **uneven), "a", within=within).first("GR")
    assert cb.switch(end, within=within)[0][0]["says"].startswith("site 1 hits a wall; ")
    assert "sites -1, 1 hit a wall; " in cb.switch(grazing("endless"), within=within)[0][0]["says"]


def test_a_site_that_the_diagram_says_sticks_rests_on_its_wall_in_a_simulation():
    on = {"gamma": 0.05, "k": 0.0, "damping": 0.05, "lattice": cb.Ring(5)}
    end = cb.trace(cb.symmetric(0.8, **on), "a", within={"a": (0.1, 1.5)}).first("GR")
    before, beyond = (
        cb.simulate(end.solution, a=end["a"] + more, periods=300) for more in (-0.01, 0.01)
    )
    assert not before.rests["period"].max(initial=0) > 100
    assert {*beyond.rests[beyond.rests["period"] == 299]["site"].tolist()} == {0}


def test_a_diagram_lists_ends_beyond_which_no_orbit_is_with_what_there_is(tmp_path):
    tree = cb.diagram(cb.symmetric(0.55, 0.02, 0.0), "a", within={"a": (0.1, 1.5)}, beyond=True)
    assert tree.failed == ()
    assert {end.place.point.kind for end in tree.ends} == {"GR", "VI"}
    assert any("beyond it sticks" in str(end) for end in tree.ends)
    assert tree.describe().endswith("; 2 ends with no orbit beyond")
    cb.save(tmp_path / "tree.nc", tree)
    assert [*map(str, cb.load(tmp_path / "tree.nc").ends)] == [*map(str, tree.ends)]


def test_elastic_neighbours_that_graze_as_the_breather_hits_are_found():
    end = cb.trace(cb.symmetric(0.75, 0.08, 1.0), "a", towards="up").first("GR")
    (arm,) = cb.switch(end, within={"a": (0.7, 1.5)})
    assert arm[1].solution.section.hit == (-1, 0, 1)
    assert checked(arm[len(arm) // 2].solution) == ""


def test_what_begins_at_grazing_is_kept_in_files(tmp_path):
    (arm,) = cb.switch(grazing("ring"), within={"a": (0.85, 1)})
    cb.save(tmp_path / "arm.nc", arm)
    kept = cb.load(tmp_path / "arm.nc")
    assert kept[0]["beyond"] == "fold"
    assert kept[0].solution.stability().stable is None


@pytest.mark.slow
@pytest.mark.parametrize("largest", [0.08, 0.1])
def test_folds_to_both_sides_of_a_branch_point_are_found_in_one_step(largest: float) -> None:
    """Beyond GR of one of two sites alike: 7e-3 off the branch point the orbit turns, twice."""
    low = cb.multibreather(
        {0: "lower"}, a=0.9, gamma=0.0077, k=0.98, lattice=cb.Ring(2), damping=0.35
    )
    graze = cb.trace(low, "a", within={"a": (0.3, 1.2)}).first("GR")
    beyond = cb.switch(graze, within={"a": (0.3, 1.2)}, steps=cb.Steps(largest=largest))[0]
    assert [point.kind for point in beyond.special[1:-1]] == ["PF", "LP", "BP", "LP", "PF"]
    first, second = (point["a"] for point in beyond.special if point.kind == "LP")
    assert abs(first - second) < 1e-12  # images of each other


@pytest.mark.slow
def test_two_real_multipliers_that_meet_without_coupling_are_no_pair_that_leaves() -> None:
    """Without coupling both neighbours have one and the same, far outside."""
    breather = cb.symmetric(a=0.8, gamma=0.02, k=0.8)
    (three,) = cb.switch(cb.trace(breather, "gamma", towards="up").first("GR"))
    whole = cb.switch(three.first("BP"))[1]
    assert whole[-1]["gamma"] == 0.0
    large = abs(whole[-1].solution.map.unstable_multipliers())
    assert large[0] == pytest.approx(large[1], rel=1e-6)
    assert whole.doubtful == ()
