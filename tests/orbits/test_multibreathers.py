"""Multibreathers: against direct shooting, brute-force counts of choices, and what ends them."""

from __future__ import annotations

import itertools
import math

import networkx as nx
import numpy as np
import pytest

import contbreather as cb
from contbreather.orbits.branch_switching import lift
from contbreather.orbits.orbit import orbit_at

from .by_hand import run_once

AT = {"a": 0.5, "gamma": 0.03, "k": 0.8}


def test_one_site_is_the_breather() -> None:
    one = cb.multibreather([3], lattice=cb.Ring(12), **AT)
    own = cb.symmetric(lattice=cb.Ring(12), **AT)
    assert (one.p, one.phi) == pytest.approx((own.p, own.phi), abs=1e-11)
    assert one.displacement(3, 0.7) == pytest.approx(own.displacement(0, 0.7), abs=1e-11)


# under the sine the upper root counts its time from +pi down, the lower from -pi up
@pytest.mark.parametrize("drive", [None, "sin(t)"])
def test_each_site_keeps_the_root_it_was_given(drive) -> None:
    mixed = cb.multibreather({0: "upper", 5: "lower"}, lattice=cb.Ring(10), forcing=drive, **AT)
    sites = [one.site for one in mixed.impacts]
    high, low = (0.5 * abs(mixed.impulses[sites.index(n)]) for n in (0, 5))
    upper, lower = (b.p for b in cb.orbits.symmetric_roots(0.5, 0.0, 0.8))
    assert abs(high - upper) < 0.2 < abs(high - lower)
    assert abs(low - lower) < 0.2 < abs(low - upper)


@pytest.fixture(scope="module")
def arm():
    """An asymmetric orbit of the single oscillator, and one of twice the period."""
    branch = cb.trace(
        cb.shooting(cb.symmetric(0.75, 0.0, 0.8), sites=1), "a", within={"a": (0.6, 0.8)}
    )
    return cb.switch(branch.first("PF"), within={"a": (0.6, 0.93)})[0]


def test_asymmetric_orbit_of_one_site_beside_a_symmetric_one(arm) -> None:
    one = min((p.solution for p in arm), key=lambda o: abs(o.a - 0.75))
    given = {"a": one.a, "gamma": 0.001, "k": 0.8, "lattice": cb.Ring(12)}
    mixed = cb.multibreather({0: one, 6: "upper"}, **given)
    named = cb.multibreather({0: one, 6: cb.symmetric(one.a, 0.0, 0.8)}, **given)
    assert mixed.times == pytest.approx(named.times, abs=1e-9)
    assert sorted(n for n, _ in mixed.section.impacts) == [0, 0, 6, 6]
    assert mixed.residual < 1e-12
    at = {impact.wall: impact.time for impact in mixed.impacts if impact.site == 0}
    apart = one.times[1] - one.times[0]  # from the wall +1 to the wall -1
    assert (at[-1] - at[1]) % (2 * np.pi) == pytest.approx(apart, abs=0.02)
    assert abs(apart - np.pi) > 0.15


def test_doubled_orbit_of_one_site() -> None:
    branch = cb.trace(
        cb.shooting(cb.symmetric(0.6, 0.0, 0.95), sites=1), "a", within={"a": (0.5, 0.95)}
    )
    tilted = cb.switch(branch.first("PF"), within={"a": (0.5, 0.95)})[0]
    given = {"lattice": cb.OpenChain(3), "gamma": 0.001, "k": 0.95}
    two = orbit_at(lift(tilted.first("PD")).arm(0.2))
    mixed = cb.multibreather({0: two}, a=two.a, **given)
    assert mixed.period == pytest.approx(4 * np.pi)
    assert len(mixed.section.impacts) == 4
    assert mixed.residual < 1e-12
    # next to its doubling coupling takes it back through that point
    near = orbit_at(lift(tilted.first("PD")).arm(0.02))
    with pytest.raises(cb.NoSolution, match="turns back, into an image of itself"):
        cb.multibreather({0: near}, a=near.a, **given)


def test_roots_half_a_period_apart_may_drift_past_each_other() -> None:
    """Listed in another order, which began with the longest flight, these impacts would come a
    section apart at gamma = 0.1184; by simulation they are an orbit beyond it."""
    conditions = {
        "a": 0.23604852800751247, "k": 0.8540999273268242, "damping": 0.0040156699832900045,
        "spring": 0.012288576416098618, "gamma": 0.15,
    }  # fmt: skip
    choice = {0: "lower", 2: "upper", 1: "lower", 4: "upper"}
    orbit = cb.multibreather(choice, lattice=cb.OpenChain(5), **conditions)
    assert len(orbit.hits) == 8
    assert orbit.admissibility().ok
    assert run_once(orbit) < 1e-10


def test_orbit_whose_neighbours_cannot_follow_is_refused(arm) -> None:
    """Off centre the idle sites come along, and beyond a + |c| = 1 they hit their walls."""
    late = max((p.solution for p in arm), key=lambda o: o.a)
    assert late.a + abs(late.c) > 1
    with pytest.raises(cb.NoSolution, match="without coupling already"):
        cb.multibreather({0: late}, lattice=cb.Ring(12), a=late.a, gamma=0.01, k=0.8)


def test_what_ends_it_is_named_with_its_coupling() -> None:
    with pytest.raises(
        cb.NoSolution, match=r"reaches gamma = 0\.\d+, not 0.24.*site \d"
    ) as refused:
        cb.multibreather([0, 2], a=0.7, gamma=0.24, k=0.8, lattice=cb.Ring(9))
    reached = float(str(refused.value).split("gamma = ")[1].split(",")[0])
    below = cb.multibreather([0, 2], a=0.7, gamma=reached - 1e-4, k=0.8, lattice=cb.Ring(9))
    assert 0 < below.admissibility().margin < 1e-2


def test_catalogue_counts_every_choice_once() -> None:
    """Burnside for the dihedral group of a ring; a path graph has one reflection."""

    def necklaces(n: int, m: int) -> int:
        seen = set()
        for sites in itertools.combinations(range(n), m):
            images = [
                frozenset((side * (s + d)) % n for s in sites)
                for d in range(n) for side in (1, -1)
            ]  # fmt: skip
            seen.add(frozenset(images))
        return len(seen)

    alone = AT | {"gamma": 0.0}
    for n in (5, 6, 8):
        catalogue = cb.multibreathers(cb.Ring(n), most=3, **alone)
        for m in (1, 2, 3):
            copies = [one.copies for one in catalogue if len(one.sites) == m]
            assert len(copies) == necklaces(n, m)
            assert sum(copies) == math.comb(n, m)
    chain = cb.multibreathers(cb.OpenChain(3), most=1, **alone)
    assert [(one.sites, one.copies) for one in chain] == [((0,), 2), ((1,), 1)]
    heavy = cb.Lattice.from_graph(nx.path_graph(3), masses=[1, 1, 2])
    assert len(cb.multibreathers(heavy, most=1, **alone)) == 3
    walls = {0: (-1.2, 1.2)}
    found = cb.multibreathers(cb.Ring(4), walls=walls, most=np.int64(1), **AT)
    assert [(one.sites, one.copies) for one in found] == [((0,), 1), ((1,), 2), ((2,), 1)]


def test_a_site_that_the_drive_does_not_move_is_in_the_catalogue() -> None:
    pair = cb.Lattice([[1.0, -1.0], [-1.0, 1.0]], drive=[1.0, 0.0])
    found = cb.multibreathers(pair, most=1, **AT)
    assert [one.ended for one in found] == ["", "no orbit without coupling"]
    with pytest.raises(cb.NoSolution, match="the forcing does not move it"):
        cb.multibreather([0, 1], lattice=pair, **AT)


def test_an_orbit_of_other_parameters_stands_for_no_site() -> None:
    tripled = cb.Fourier({1: -1.0, 3: 0.1})
    for other in ({"a": 0.51}, {"k": 0.79}, {"spring": 0.01}, {"forcing": tripled}):
        alone = cb.symmetric(**{"a": 0.5, "gamma": 0.0, "k": 0.8, **other})
        with pytest.raises(cb.BadInput, match="one of the same a, k, damping, spring and forcing"):
            cb.multibreather({0: alone}, lattice=cb.Ring(9), **AT)
    alone = cb.symmetric(0.5, 0.0, 0.8)
    with pytest.raises(cb.BadInput, match=r"k = 0\.8, damping = 0\.02, spring = 0 and F"):
        cb.multibreather({0: alone}, lattice=cb.Ring(9), damping=0.02, **AT)
    half = cb.Lattice(cb.OpenChain(2).stiffness, drive=[0.5, 1.0])
    two = cb.multibreather({0: alone, 1: "upper"}, a=1.0, gamma=0.0, k=0.8, lattice=half)
    assert abs(two.times - alone.times[0]).min() < 1e-9


def test_catalogue_says_what_exists_and_what_is_stable() -> None:
    found = cb.multibreathers(
        cb.OpenChain(4), a=0.6, gamma=0.02, k=0.8, damping=0.05, spring=0.1, most=2
    )
    assert sum(one.copies for one in found) == 4 + 6
    for one in found:
        assert one.exists == (one.gamma == 0.02 and not one.ended)
        assert one.orbit.section.impacts == tuple((n, 1) for n in one.sites) or not one.exists
        if one.exists:
            largest = abs(one.orbit.multipliers()).max()
            assert one.stable(1.0) == (largest <= 1.0)
    assert any(one.stable(1.0) for one in found)


def test_without_coupling_it_is_the_choice_itself() -> None:
    two = cb.multibreather([0, 2], a=0.5, gamma=0.0, k=0.8, lattice=cb.Ring(5))
    assert two.gamma == 0.0
    assert two.p == pytest.approx(cb.symmetric(0.5, 0.0, 0.8).p, abs=1e-12)


@pytest.mark.parametrize("lattice", [cb.Ring(3), cb.OpenChain(2), cb.OpenChain(5)])
def test_orbits_without_coupling_stand_for_a_site_wherever_they_are(lattice: cb.AnyLattice) -> None:
    alone = cb.symmetric(0.5, 0.0, 0.8, lattice=lattice)
    found = cb.multibreather({0: alone}, lattice=cb.Ring(10), **AT)
    assert found.times == pytest.approx(cb.multibreather([0], lattice=cb.Ring(10), **AT).times)


def test_where_there_is_one_root_the_lower_one_is_it() -> None:
    alone = {"a": 1.1, "gamma": 0.0, "k": 0.8, "lattice": cb.Ring(1)}
    assert len(cb.orbits.symmetric_roots(**alone)) == 1
    assert cb.multibreather({0: "lower"}, **alone).p == pytest.approx(cb.symmetric(**alone).p)


@pytest.mark.parametrize(
    ("lattice", "sites"), [(cb.OpenChain(5), [0, 1]), (cb.Ring(9), [0, 1, 3])], ids=str
)
def test_pitchforks_of_neighbours_are_followed_where_their_impacts_are_close(lattice, sites):
    """Differences in the times must not reverse the order of impacts 0.003 apart: a kink."""

    def fork(gamma):
        start = cb.multibreather(sites, a=0.6, gamma=gamma, k=0.85, lattice=lattice, damping=0.005)
        return cb.trace(start, "a", within={"a": (0.6, 0.67)}).first("PF")

    first = fork(0.04)
    assert 0.0 < np.diff(np.sort(first.solution.times)).min() < 4e-3
    line = cb.boundary(first, ("gamma", "a"), within={"gamma": (0.04, 0.045)})
    assert line[-1]["gamma"] == 0.045
    assert line[-1]["a"] == pytest.approx(fork(0.045)["a"], abs=1e-10)


def test_a_point_of_a_branch_of_the_single_oscillator_stands_for_a_site() -> None:
    branch = cb.trace(cb.symmetric(0.5, 0.0, 0.8), "a", within={"a": (0.5, 0.6)})
    point = branch.first("EP")
    found, wanted = (
        cb.multibreather({0: one, 3: one}, a=point["a"], gamma=0.02, k=0.8, lattice=cb.Ring(9))
        for one in (point, point.solution)
    )
    assert found.times.tolist() == wanted.times.tolist()
    refused = r"^sites 0 \(period 2 pi, impacts 0\+, half of a symmetric orbit\), 3 \(upper\): this"
    with pytest.raises(cb.NoSolution, match=refused):
        cb.multibreather({0: point, 3: "upper"}, a=point["a"], gamma=0.2, k=0.8, lattice=cb.Ring(9))


@pytest.mark.parametrize("spring", [0.0, 0.1])
def test_folds_of_sites_that_are_alike_are_followed_to_that_of_one_alone(spring: float) -> None:
    """There all others of them come together with it, first of all BP, 1e-6 off at gamma = 0.01."""
    on = {"a": 0.6, "k": 0.7, "damping": 0.1, "spring": spring}
    two = cb.multibreather([0, 3], gamma=0.0122, lattice=cb.Ring(6), **on)
    one = cb.symmetric(gamma=0.0, lattice=cb.Ring(1), **on)
    folds = [cb.trace(orbit, "a", within={"a": (0.05, 0.6)}).first("LP") for orbit in (two, one)]
    line = cb.boundary(folds[0], ("gamma", "a"), within={"gamma": (0.0, 0.05)})
    end = line[0]
    assert (end.kind, end["gamma"], line.doubtful) == ("EP", 0.0, ())
    assert end["a"] == pytest.approx(folds[1]["a"], abs=1e-8)


def test_a_branch_sets_out_from_an_entry_of_a_catalogue() -> None:
    """The same as from the orbit that is found alone, where the entry exists."""
    ring = cb.Ring(6)
    starts = [*cb.multibreathers(ring, most=1, **AT), cb.multibreather([0], lattice=ring, **AT)]
    ends = [cb.trace(one, "a", within={"a": (0.3, 0.8)})[-1]["p"] for one in starts]
    assert ends[0] == pytest.approx(ends[1], rel=1e-10)
    (ended,) = cb.multibreathers(ring, most=1, **AT | {"a": 0.7, "gamma": 0.15})
    with pytest.raises(cb.NoSolution, match=r"nothing to set out from: gamma = 0\.140806, GR"):
        cb.trace(ended, "a")
