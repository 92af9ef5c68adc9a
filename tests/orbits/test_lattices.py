"""Orbits on any finite lattice: against closed forms, dense matrices and an event integrator."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import mpmath as mp
import networkx as nx
import numpy as np
import pytest
from scipy import sparse

import contbreather as cb
from contbreather.lattice.conditions import Conditions, Walls
from contbreather.lattice.modal_flow import driven_spectrum, free_multipliers, propagator
from contbreather.orbits.by_impacts import ByImpacts
from contbreather.orbits.clearance import highest_neighbour
from contbreather.orbits.constructors import asymmetric
from contbreather.orbits.orbit import orbit_at
from contbreather.orbits.site_motion import SiteMotion
from contbreather.orbits.symmetries import images_of
from tests.orbits.field import Field, FieldOf

# --- closed forms -----------------------------------------------------------------------------


def special(start, low: float = 0.01, high: float = 0.95) -> dict[str, float]:
    branch = cb.trace(start, "a", within={"a": (low, high)})
    return {point.label: point["a"] for point in branch.special}


def test_ring_by_its_matrix_is_the_ring() -> None:
    """The general lattice against the chain's own closed forms, eigenspaces of two included."""
    ring = cb.Lattice.from_graph(nx.cycle_graph(12))
    own = cb.symmetric(0.6, 0.05, 0.8, lattice=cb.Ring(12))
    other = cb.symmetric(0.6, 0.05, 0.8, lattice=ring)
    assert (other.p, other.phi) == pytest.approx((own.p, own.phi), abs=1e-13)
    t = np.linspace(0, 6, 7)
    assert other.displacement(3, t) == pytest.approx(own.displacement(3, t), abs=1e-12)
    mine, theirs = (np.sort_complex(b.multipliers().round(9)) for b in (other, own))
    assert mine == pytest.approx(theirs, abs=1e-7)
    assert special(other, 0.5)["PF1"] == pytest.approx(special(cb.shooting(own), 0.5)["PF1"])


def test_any_site_of_a_torus_is_like_any_other() -> None:
    torus = cb.Grid(4, 5, periodic=True)
    found = [cb.symmetric(0.6, 0.03, 0.8, lattice=torus, site=n).p for n in (0, 7, 19)]
    assert found == pytest.approx([found[0]] * 3, abs=1e-12)
    grid = [cb.symmetric(0.6, 0.03, 0.8, lattice=cb.Grid(4, 5), site=n).p for n in (0, 7)]
    assert abs(grid[0] - grid[1]) > 1e-3  # corner and inside


# --- parameters of their own ------------------------------------------------------------------


RING = cb.symmetric(0.6, 0.04, 0.8, lattice=cb.Ring(10))
MODES = orbit_at(cb.shooting(RING))
WITHIN = {"a": (0.5, 1.0)}
SLIGHT = {"damping": (0.0, 0.003), "spring": (0.0, 0.08)}


@pytest.mark.parametrize("free", ["damping", "spring"])
def test_an_undamped_ring_is_traced_in_damping_and_spring(free: str) -> None:
    own, wanted = (cb.trace(one, free, within={free: SLIGHT[free]}) for one in (RING, MODES))
    assert [point.label for point in own.special] == [point.label for point in wanted.special]
    assert own.special[1][free] == pytest.approx(wanted.special[1][free], abs=1e-10)  # NS
    assert own[0].solution.p == pytest.approx(RING.p, abs=1e-14)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["PF", "NS", "GR"])
def test_curves_of_an_undamped_ring_free_damping_and_spring(kind: str) -> None:
    seen = [cb.trace(one, "a", within=WITHIN).first(kind) for one in (RING, MODES)]
    for pair in (("damping", "a"), ("a", "spring")):
        own, wanted = (cb.boundary(point, pair, within=SLIGHT | WITHIN) for point in seen)
        assert [point.label for point in own.special] == [point.label for point in wanted.special]
        assert own[-1][pair[1]] == pytest.approx(wanted[-1][pair[1]], abs=1e-9)
    line = cb.boundary(seen[0], ("gamma", "a"), within={"gamma": (0.035, 0.045)})
    there = cb.trace(line[1], "damping", within={"damping": (0.0, 0.001)}, towards="up")
    again = cb.boundary(line[1], ("damping", "a"), within={"damping": (0.0, 0.001)})
    assert there[-1]["a"] == pytest.approx(again[-1]["a"], abs=1e-10)
    assert there[-1]["gamma"] == line[1]["gamma"]


def test_a_curve_that_frees_damping_keeps_its_threshold_and_its_lifted_walls() -> None:
    ns = [cb.neimark_sacker(threshold=1.01)]
    ring = cb.symmetric(0.6, 0.04, 0.8, lattice=cb.Ring(20))
    point = cb.trace(ring, "gamma", within={"gamma": (0.03, 0.05)}, events=ns).first("NS")
    line = cb.boundary(point, ("damping", "gamma"), within={"damping": (0.0, 4e-4)}, events=())
    assert line[-1].stability(threshold=1.01).largest == pytest.approx(1.01, abs=1e-9)
    assert "threshold 1.01" in line.problem.label
    behind = cb.trace(RING, "a", within={"a": (0.5, 1.1)}, inadmissible=True).first("PF")
    assert "margin" in cb.boundary(behind, ("damping", "a"), within=SLIGHT).names


def test_arms_of_an_undamped_ring_are_traced_in_damping() -> None:
    arm = asymmetric(0.8, 0.04, 0.8, lattice=cb.Ring(8))
    for start in (arm, arm.doubled()):
        branch = cb.trace(start, "damping", within={"damping": (0.0, 0.01)}, events=())
        assert branch[-1].solution.residual < 1e-12
        assert branch[0].displacement(2, 1.0) == pytest.approx(arm.displacement(2, 1.0), abs=1e-13)


def test_the_infinite_chain_refuses_damping_and_its_arms_springs() -> None:
    chain, arm = cb.symmetric(0.6, 0.04, 0.8), asymmetric(0.82, 0.04, 0.8)
    for start, free in ((chain, "damping"), (arm, "damping"), (arm, "spring")):
        with pytest.raises(cb.BadInput, match=rf"^{free}: orbits of the infinite chain have no"):
            cb.trace(start, free)
    fork = cb.trace(RING, "a", within=WITHIN).first("PF")
    with pytest.raises(cb.BadInput, match="'mu' is not a parameter here"):
        cb.boundary(fork, ("damping", "mu"))
    with pytest.raises(cb.BadInput, match="'mu' is not a parameter of this problem"):
        cb.trace(fork, "mu")


@pytest.mark.slow
@pytest.mark.parametrize(("threshold", "also"), [(1.0, "NS-LP"), (1.005, None)])
def test_a_curve_of_pairs_ends_once_where_they_become_a_double_multiplier(threshold, also) -> None:
    lossy = cb.symmetric(0.3, 0.215, 0.75, lattice=cb.Ring(12), damping=0.02)
    ns, on = [cb.fold(), cb.neimark_sacker(threshold=threshold)], {"gamma": (0.214, 0.23)}
    branch = cb.trace(lossy, "a", within={"a": (0.09, 0.5)}, events=ns, inadmissible=True)
    line = cb.boundary(branch.first("NS"), ("gamma", "a"), within=on, inadmissible=True)
    assert [point.label for point in line.special] == ["EP1", "R1.1"]
    assert line["nu"].max() <= 1.0
    double, radius = line.first("R1"), math.sqrt(threshold)
    assert double.detail.get("also") == also
    pair = np.sort(abs(double.solution.multipliers(half=True) + radius))[:3]
    assert pair[1] < 1e-6
    assert pair[2] > 0.1
    if also:  # there the curve of folds passes
        folds = cb.boundary(double, ("gamma", "a"), within=on, inadmissible=True, events=())
        assert folds["gamma"].min() == 0.214
        assert abs(folds[0].solution.multipliers(half=True) + 1.0).min() < 1e-6


def test_a_curve_of_pairs_ends_where_coupling_ceases_to_hold_the_sites() -> None:
    """Damping and coupling vanish together there, the damping sooner, to rounding."""
    start = cb.symmetric(0.6, 0.03, 0.7, lattice=cb.OpenChain(3), damping=0.05)
    ns = [cb.neimark_sacker(threshold=1)]
    branch = cb.trace(start, "damping", within={"damping": (0.0, 0.05)}, events=ns)
    within = {"damping": (0.0, 0.1), "gamma": (0.0, 0.05)}
    line = cb.boundary(branch.first("NS"), ("damping", "gamma"), within=within)
    end = min(line[0], line[-1], key=lambda point: point["gamma"])
    assert (end.kind, end["gamma"]) == ("EP", 1e-6)
    assert abs(end["damping"]) < 1e-10


@pytest.mark.parametrize(
    "more", [{}, {"lattice": cb.Ring(12), "damping": 0.02}], ids=["chain", "ring"]
)
def test_a_curve_of_pairs_from_its_meeting_with_folds_goes_past_it_and_names_it(more) -> None:
    start = cb.symmetric(0.2, 0.08, 0.75, **more)
    fold = cb.trace(start, "a", within={"a": (0.05, 0.3)}).first("LP")
    folds = cb.boundary(fold, ("gamma", "a"), within={"gamma": (0.07, 0.16)})
    meeting = folds.first("LP-NS")
    near = {"gamma": (meeting["gamma"] - 0.005, meeting["gamma"] + 0.005)}
    line = cb.boundary(meeting, ("gamma", "a"), within=near)
    place = line.first("NS-LP")
    for name in ("gamma", "a"):
        assert place[name] == pytest.approx(meeting[name], abs=1e-9)
    sides = line["p"][[0, -1]] - place["p"]
    assert sides.min() < 0 < sides.max()


@pytest.mark.slow
def test_pairs_that_pass_each_other_on_the_axis_do_not_end_a_curve() -> None:
    """Of a whole period a symmetric orbit has the squares of i and -i, which do not merge."""
    whole = cb.symmetric(0.2, 0.08, 0.75, lattice=cb.Ring(8), damping=0.02).unfolded()
    ns = [cb.neimark_sacker(threshold=1.0)]
    point = cb.trace(whole, "gamma", within={"gamma": (0.07, 0.1)}, events=ns).first("NS")
    on = {"gamma": (0.07, 0.1), "a": (0.05, 0.3)}
    line = cb.boundary(point, ("gamma", "a"), within=on, towards="up", events=())
    assert line["nu"].min() < 1.0 < line["nu"].max()
    assert line[-1].kind == "EP"
    assert "pass each other" in line.doubtful[0].detail["reason"]


@pytest.mark.slow
def test_a_curve_of_pairs_ends_where_they_merge_however_weak_their_coupling() -> None:
    """Two R2 lie 1.4e-4 apart; the place is that of Newton's method on the sum and the product of
    the pair, of flows by exponentials of matrices."""
    seed = {"t1": -1.89, "t2": -0.14, "t3": 1.25, "t4": 2.99}
    on = {"sequence": [(0, 1), (2, 1), (0, -1), (2, -1)], "a": 0.108, "damping": 0.0034}
    drive = cb.Fourier(cos={1: -1.0, 2: 0.038}, sin={2: -0.036})
    ring = cb.Lattice(2 * np.eye(3) - (1 - np.eye(3)), drive=[0.956, 0.678, 1.166])
    given = {"k": 0.734, "lattice": ring, "forcing": drive}
    start = cb.shooting(seed, gamma=0.0424, spring=0.169, **on, **given)
    point = cb.trace(start, "a", within={"a": (0.1, 0.108)}).first("NS")
    on = {"spring": (0.155, 0.17), "a": (0.1, 0.12)}
    line = cb.boundary(point, ("spring", "a"), within=on, steps=cb.Steps(largest=0.02))
    place = line.first("R2")
    assert place in (line[0], line[-1])
    assert (place["spring"], place["a"]) == pytest.approx((0.15907438, 0.11090285), abs=1e-8)
    assert len(line.special) == 2


# --- lattices ---------------------------------------------------------------------------------


def test_lattice_is_the_same_dense_sparse_or_as_a_graph() -> None:
    dense = cb.OpenChain(6)
    assert cb.Lattice(sparse.csr_array(dense.stiffness)) == dense
    assert cb.Lattice.from_graph(nx.path_graph(6)) == dense
    assert hash(cb.Lattice.from_graph(nx.path_graph(6))) == hash(dense)
    assert cb.OpenChain(6, ends="fixed") != dense


def test_orbit_is_asked_for_its_own_sites_only() -> None:
    orbit = cb.symmetric(0.6, 0.05, 0.8, lattice=cb.OpenChain(5))
    with pytest.raises(cb.BadInput, match="sites of this lattice are 0 to 4"):
        orbit.displacement(5, 0.0)
    assert orbit.displacement([0, 1], [0.1, 0.2]) == pytest.approx(
        [orbit.displacement(0, 0.1), orbit.displacement(1, 0.2)]
    )
    grid = orbit.on(cb.Grid(2, 3))
    with pytest.raises(cb.BadInput, match=r"\(i, j\) of this grid has the number 3 i \+ j; two"):
        grid.displacement((1, 1), 0.0)
    assert np.array_equal(grid.displacement([1, 1], 0.0), 2 * [grid.displacement(1, 0.0)])


# --- walls ------------------------------------------------------------------------------------


def test_everything_scales_with_the_distance_of_the_walls() -> None:
    near = cb.symmetric(0.6, 0.05, 0.8, lattice=cb.OpenChain(5), site=1)
    far = cb.symmetric(1.5, 0.05, 0.8, lattice=cb.OpenChain(5), site=1, walls=(-2.5, 2.5))
    assert (far.p, far.phi) == pytest.approx((2.5 * near.p, near.phi), abs=1e-12)
    assert far.multipliers() == pytest.approx(near.multipliers(), abs=1e-9)
    assert far.admissibility().max_neighbour == pytest.approx(
        2.5 * near.admissibility().max_neighbour
    )
    assert highest_neighbour(far)[2] == pytest.approx(2.5 * highest_neighbour(near)[2])
    found = special(far, 1.2, 2.4)
    assert found == pytest.approx(
        {label: 2.5 * a for label, a in special(near, 0.48, 0.96).items()}, abs=1e-9
    )


def test_walls_are_given_for_each_site_in_turn() -> None:
    on = {"a": 0.9, "gamma": 0.05, "k": 0.8, "lattice": cb.OpenChain(3), "site": 1}
    for given, wanted in (
        ([1.0, 1.2, 0.9], {1: 1.2, 2: (-0.9, 0.9)}),
        (np.array([1.0, 1.2, 1.0]), {1: (-1.2, 1.2)}),
        (np.array([[-1.2, 1.2]] * 3), (-1.2, 1.2)),
        ([(-1, 1), 1.2, None], {1: 1.2, 2: None}),
        ([1, 1, 1], None),
    ):
        orbits = [cb.symmetric(**on, walls=walls) for walls in (given, wanted)]
        assert orbits[0].walls == orbits[1].walls
        assert orbits[0].p == orbits[1].p
    assert cb.symmetric(**on, walls=[1.0, 1.2, 0.9]).walls.at(2) == (-0.9, 0.9)


ONE_WALL = {"gamma": 0.03, "k": 0.7, "spring": 2.3, "damping": 0.1}


def settled(walls, a: float):
    """The orbit that a motion from rest settles on, shot from its state."""
    on = Conditions(a, forcing=cb.Harmonic(), walls=Walls.given(walls), **ONE_WALL)
    x, *_ = Field(cb.OpenChain(3), on).run(np.zeros(6), 0.3, 0.3 + 24 * math.pi)
    state = np.split(x, 2)
    return orbit_at(
        cb.shooting(state, t=0.3, lattice=cb.OpenChain(3), a=a, walls=walls, **ONE_WALL)
    )


@pytest.mark.parametrize(
    ("walls", "impacts"),
    [
        ((None, 0.6), 3),  # one wall for each site
        ({0: (None, 0.6), 1: None, 2: (-4, 4)}, 1),  # one in all
        ((-3.0, 0.6), 3),  # two, one of them out of reach
        ({0: (-0.55, 0.7), 1: None, 2: (-4, 4)}, 2),
    ],
)
def test_orbits_between_any_walls_return_under_the_integrator(walls, impacts: int) -> None:
    orbit = settled(walls, 0.9)
    assert orbit.residual < 1e-12
    FieldOf(orbit).comes_back()
    assert len(orbit.hits) == impacts
    verdict, t = orbit.admissibility(), np.linspace(0, 2 * math.pi, 20001)
    assert verdict.ok
    idle = {0, 1, 2} - {hit.site for hit in orbit.hits}
    gaps = [
        min((high - u).min(), (u - low).min())
        for (low, high), u in ((orbit.walls.at(n), orbit.displacement(n, t)) for n in idle)
    ]
    nearest = min((gap for gap in gaps if math.isfinite(gap)), default=1.0)
    assert verdict.neighbours == pytest.approx(nearest, abs=1e-6)


def test_sites_that_meet_their_walls_at_once_all_bounce_whatever_the_rounding() -> None:
    """A state in which one of three sites is past its wall already, by next to nothing."""
    orbit = settled((None, 0.6), 0.9)
    t, on = orbit.times[0], {"lattice": cb.OpenChain(3), "a": 0.9, "walls": (None, 0.6)}
    for past in (-1e-16, 0.0, 1e-16, 1e-12):
        seed = np.array([0.6, 0.6 + past, 0.6]), np.full(3, orbit.incoming[0])
        again = orbit_at(cb.shooting(seed, t=t, **on, **ONE_WALL))
        assert sorted(again.section.impacts) == [(0, 1), (1, 1), (2, 1)]
        assert again.times == pytest.approx(np.full(3, t), abs=1e-9)


def test_between_unequal_walls_only_shifts_by_whole_periods_make_images() -> None:
    walls = {0: (-0.55, 0.7), 1: None, 2: (-4, 4)}
    once = settled(walls, 0.9)
    assert list(images_of(once)) == []
    on = {"lattice": cb.OpenChain(3), "a": 0.9, "walls": walls, **ONE_WALL}
    twice = orbit_at(cb.shooting(once.state(t=0.3), t=0.3, period=4 * math.pi, **on))
    assert len(twice.hits) == 2 * len(once.hits)
    (image,) = images_of(twice)
    assert image.residual < 1e-12
    assert image.times == pytest.approx(twice.times, abs=1e-12)


def test_sites_that_answer_alike_are_exchanged_only_where_the_idle_ones_cannot_tell() -> None:
    bonds = [(0, 1), (0, 2), (1, 5), (2, 3), (3, 4), (5, 6), (5, 8), (6, 7)]
    tree = nx.to_numpy_array(nx.Graph(bonds), nodelist=range(9))  # 0 and 6 are cospectral
    drive = np.isin(np.arange(9), (0, 6)).astype(float)
    on = {"a": 0.5, "gamma": 0.03, "k": 0.8, "damping": 0.01}
    lattice = cb.Lattice(4 * np.eye(9) - tree, drive=drive)
    mixed = cb.multibreather({0: "upper", 6: "lower"}, lattice=lattice, **on)
    assert list(images_of(mixed)) == []
    path = cb.multibreather({0: "upper", 4: "lower"}, lattice=cb.OpenChain(5), **on)
    (image,) = images_of(path)
    t = np.linspace(0, 2 * math.pi, 50)
    for n in range(5):
        assert image.displacement(n, t) == pytest.approx(path.displacement(4 - n, t), abs=1e-12)


@pytest.mark.slow
def test_one_wall_ends_where_the_other_is_touched() -> None:
    start = settled({0: (-1.2, 0.6), 1: (-2, 2), 2: (-2, 2)}, 0.9)
    assert start.section.impacts == ((0, 1),)
    branch = cb.trace(start, "a", within={"a": (0.9, 3.0)}, towards="up")
    assert branch[-1].kind == "GR"
    end, t = branch[-1].solution, np.linspace(0, 2 * math.pi, 40001)
    reached = [abs(end.displacement(n, t) - end.walls.at(n)[0]).min() for n in range(3)]
    assert min(reached) < 1e-7
    free = cb.trace(
        settled({0: (None, 0.6), 1: (-2, 2), 2: (-2, 2)}, 0.9), "a",
        within={"a": (0.9, end.a + 0.01)}, towards="up",
    )  # fmt: skip
    assert free[-1]["a"] == end.a + 0.01  # without that wall it goes on
    assert free[-1].solution.displacement(0, t).min() < -1.2


def test_impossible_walls_are_refused() -> None:
    on = {"a": 0.75, "gamma": 0.03, "k": 0.7, "spring": 0.3}
    for walls, sequence, more, says in (
        ("ab", [(0, 1)], {}, "low < high"),
        ((-1e-9, 1e-9), [(0, 1)], {}, "everything scales with them.*in a larger or smaller unit"),
        ({2: (None, 1e5)}, [(0, 1)], {}, "walls.2. = .* from 1e-06 to 10000 away"),
        ((-1, None), [(0, 1)], {}, "has no wall on that side"),
        ((-1, 2), [(0, 1)], {"symmetric": True}, "no half section and no pitchfork"),
    ):
        with pytest.raises(cb.BadInput, match=says):
            cb.shooting(
                {"t1": -2.8}, lattice=cb.OpenChain(3), sequence=sequence, walls=walls, **on, **more
            )
    for walls in ((-1, 2), (-1, None), (0, None)):
        with pytest.raises(cb.BadInput, match="no half section"):
            cb.symmetric(0.6, 0.05, 0.8, lattice=cb.OpenChain(5), walls=walls)


# --- from one lattice to another --------------------------------------------------------------


def test_orbit_goes_to_any_lattice_and_back() -> None:
    start = cb.symmetric(0.7, 0.04, 0.8, lattice=cb.Ring(24), damping=0.0)
    branch = cb.trace(cb.shooting(start), "a", within={"a": (0.6, 0.85)})
    arm = cb.switch(branch.first("PF"), within={"a": (0.6, 0.85)})[0][-1].solution
    for there in (cb.Ring(40), cb.OpenChain(24), cb.InfiniteChain()):
        back = arm.on(there).on(cb.Ring(24))
        t = np.linspace(0, 6, 9)
        assert back.displacement(0, t) == pytest.approx(arm.displacement(0, t), abs=1e-9)
    chain = arm.on(cb.InfiniteChain())
    assert chain.c == pytest.approx(arm.c, abs=1e-6)
    assert abs(chain.impulses) == pytest.approx(abs(arm.impulses), abs=1e-6)
    damped = cb.symmetric(0.7, 0.04, 0.8, lattice=cb.Ring(24), damping=0.1)
    with pytest.raises(cb.BadInput, match="no damping, and springs only"):
        damped.on(cb.InfiniteChain())
    with pytest.raises(cb.BadInput, match=r"lattice = 40: .* Ring\(20\), say, is expected"):
        damped.on(40)
    own = cb.symmetric(0.7, 0.04, 0.8, lattice=cb.Ring(40), damping=0.1)
    assert damped.stability(sites=40).largest == pytest.approx(own.stability().largest)
    # over a period, the modes that no impact sees as well
    assert own.stability().largest == pytest.approx(abs(own.multipliers()).max(), rel=1e-12)
    assert damped.multipliers(sites=40).size == 80


def test_an_arm_is_not_taken_where_there_is_none_yet() -> None:
    """On the torus the pitchfork comes later: Newton would end at the symmetric orbit."""
    arm, torus = asymmetric(0.863, 0.04, 0.8), cb.Grid(5, 5, periodic=True)
    with pytest.raises(cb.NotConverged, match="second half repeats the first") as refused:
        arm.on(torus)
    assert refused.value.last.asymmetry == pytest.approx(0.0, abs=1e-9)
    assert abs(arm.on(cb.Ring(12)).asymmetry) > 0.1
    whole = cb.symmetric(0.863, 0.04, 0.8).unfolded()
    assert whole.on(torus).p == pytest.approx(cb.symmetric(0.863, 0.04, 0.8, lattice=torus).p)


def test_no_pitchfork_is_seen_where_sites_come_apart() -> None:
    """At gamma = 0 every idle site has the multiplier 1, and nothing happens to the breather."""
    uneven = cb.Lattice(cb.OpenChain(3).stiffness, springs=[1.0, 0.9, 1.1])
    for lattice in (cb.OpenChain(9), uneven):
        start = cb.symmetric(0.5, 0.03, 0.8, lattice=lattice)
        branch = cb.trace(start, "gamma", within={"gamma": (0.0, 0.05)})
        assert branch[0]["gamma"] == 0.0
        assert branch[0].kind == "EP"
        assert branch.doubtful == ()


def test_lattices_of_the_same_numbers_keep_their_names() -> None:
    chain, grid = cb.OpenChain(4), cb.Grid(1, 4)
    assert chain == grid
    for lattice in (chain, grid):
        orbit = cb.symmetric(0.6, 0.03, 0.8, lattice=lattice)
        assert orbit.stability().lattice == lattice.describe()


def test_a_number_of_sites_names_a_ring_only() -> None:
    orbit = cb.symmetric(0.6, 0.03, 0.8, lattice=cb.Grid(5, 5), site=12)
    for ask in (orbit.stability, orbit.multipliers):
        with pytest.raises(cb.BadInput, match="lives on the grid of 5 x 5"):
            ask(sites=20)
    assert orbit.multipliers().size == 50
    chain = cb.InfiniteChain()
    for make in (cb.multibreather, lambda _, **on: cb.multibreathers(**on)):
        with pytest.raises(cb.BadInput, match="a finite one is expected"):
            make([0], a=0.5, gamma=0.03, k=0.8, lattice=chain)


# --- the ring of the chain's own closed forms as an oracle ------------------------------------


def test_where_impacts_vanish_with_losses_all_sites_swing_as_one() -> None:
    """Without impacts a chain that is driven alike swings with the amplitude a/sqrt(1 + mu^2)."""
    low = cb.orbits.symmetric_roots(0.9, 0.03, 0.8, lattice=cb.OpenChain(4), damping=0.0136)[-1]
    end = cb.trace(low, "a", within={"a": (0.8, 1.2)}).first("VI")
    window = {"gamma": (0.0, 0.1), "k": (0.5, 0.9), "damping": (0.01, 0.05)}
    for other in window:
        line = cb.boundary(end, (other, "a"), within=window)
        assert len(line) > 2
        for point in line:
            assert point["a"] == pytest.approx(np.hypot(1.0, point.solution.damping), abs=1e-12)


@pytest.mark.parametrize(
    ("lattice", "site"), [(cb.OpenChain(9), 0), (cb.OpenChain(5), 2), (cb.Grid(3, 3), 4)]
)
def test_grazing_is_followed_where_several_sites_move_alike(lattice, site: int) -> None:
    start = cb.symmetric(0.6, 0.05, 0.8, lattice=lattice, site=site)
    graze = cb.trace(start, "a", towards="up").first("GR")
    line = cb.boundary(graze, ("gamma", "a"), within={"gamma": (0.03, 0.06)})
    assert [line[0]["gamma"], line[-1]["gamma"]] == [0.03, 0.06]
    t = np.linspace(0, 2 * math.pi, 4001)
    others = np.delete(np.arange(lattice.sites), site)[:, None]
    for point in line:
        assert abs(point.solution.displacement(others, t)).max() == pytest.approx(1.0, abs=1e-6)


@pytest.fixture(scope="module")
def opposite() -> tuple[Any, Any]:
    """Two arms of a pitchfork, without coupling: mirror images half a period later."""
    on = {"k": 0.8, "damping": 0.03, "spring": 0.1, "lattice": cb.Ring(1)}
    alone = cb.trace(cb.symmetric(0.65, 0.0, **on), "a", within={"a": (0.65, 0.8)})
    up, down = (arm[5] for arm in cb.switch(alone.first("PF"), within={"a": (0.65, 0.9)}))
    return up, down


SWINGS = {"k": 0.8, "damping": 0.03, "spring": 0.1}


@pytest.mark.slow
def test_grazing_is_followed_where_another_site_is_the_mirror_image_half_a_period_later(
    opposite,
) -> None:
    both = cb.multibreather(
        dict(enumerate(opposite, 1)), a=opposite[0]["a"], gamma=0.02, lattice=cb.OpenChain(4),
        **SWINGS,
    )  # fmt: skip
    touch = cb.trace(both, "a", within={"a": (0.7, 1.0)}).first("GR")
    line = cb.boundary(touch, ("gamma", "a"), within={"gamma": (0.001, 0.08)})
    assert (line["gamma"].min(), line["gamma"].max()) == (0.001, 0.08)
    assert [point.kind for point in line.special] == ["EP", "EP"]
    times = np.linspace(0, 2 * np.pi, 20_001)
    for point in (line[1], line[len(line) // 2]):  # each of the two at one wall
        u = point.solution.displacement(np.array([[0], [3]]), times)
        tops = sorted([*u.max(axis=1), *-u.min(axis=1)])
        assert tops[2:] == pytest.approx([1.0, 1.0], abs=1e-7)


@pytest.mark.slow
def test_a_mirror_image_touches_where_walls_are_images_too(opposite) -> None:
    """Each of the two has a low wall only, the second farther in than it swings at the first."""
    both = cb.multibreather(
        dict(enumerate(opposite, 1)), a=opposite[0]["a"], gamma=0.0085, lattice=cb.OpenChain(4),
        walls={0: (-1.0, None), 3: (-0.985, None)}, **SWINGS,
    )  # fmt: skip
    touch = cb.trace(both, "a", within={"a": (0.7, 1.0)}).first("GR")
    line = cb.boundary(touch, ("gamma", "a"), within={"gamma": (0.007, 0.009)})
    end = line.first("GR-GR")
    u = end.solution.displacement(np.array([[0], [3]]), np.linspace(0, 2 * np.pi, 20_001))
    assert u.min(axis=1) == pytest.approx([-1.0, -0.985], abs=1e-6)


def test_a_site_that_moves_alike_touches_where_its_walls_are_alike_too(opposite) -> None:
    on, walls = {"gamma": 0.001, "lattice": cb.OpenChain(3)}, {0: (-1.0, None), 2: (None, 0.997877)}
    one = cb.multibreather({1: opposite[0]}, a=opposite[0]["a"], walls=walls, **on, **SWINGS)
    touch = cb.trace(one, "a", within={"a": (0.7, 1.0)}).first("GR")
    end = cb.boundary(touch, ("k", "a"), within={"k": (0.79, 0.81)}).first("GR-GR")
    u = end.solution.displacement(np.array([[0], [2]]), np.linspace(0, 2 * np.pi, 20_001))
    assert [u[0].min(), u[1].max()] == pytest.approx([-1.0, 0.997877], abs=1e-6)


def test_grazing_is_followed_where_another_site_has_the_opposite_drive() -> None:
    chain = cb.OpenChain(4, drive=[1, 1, -1, -1])
    both = cb.multibreather([1, 2], a=0.65, gamma=0.02, lattice=chain, **SWINGS)
    touch = cb.trace(both, "a", within={"a": (0.6, 0.9)}).first("GR")
    line = cb.boundary(touch, ("gamma", "a"), within={"gamma": (0.015, 0.025)})
    assert [point.kind for point in line.special] == ["EP", "EP"]


def test_sites_that_take_turns_are_images_a_period_later() -> None:
    """No orbit, but the motion of one beyond PD: harder impacts of one site, then of the other."""
    one = cb.multibreather([1, 2], a=0.65, gamma=0.02, lattice=cb.OpenChain(4), **SWINGS)
    (_, _, t, J), on = one.impacts[0], one.representation.conditions
    section = replace(one.section, impacts=((1, 1), (2, 1)) * 2, turns=2, sign=1)
    times, impulses = [t, t, t + 2 * np.pi, t + 2 * np.pi], [1.1 * J, J, J, 1.1 * J]
    motion = SiteMotion(ByImpacts.through(on, section, times, impulses, (0.0, 0.0)))
    assert motion.differences([3], 0) < 1e-12
    assert motion.differences([1], 0) > 1e-2


@pytest.mark.slow
def test_a_curve_of_grazing_ends_where_the_impact_itself_vanishes() -> None:
    """Of two coupled sites: the second just follows where the half period turns their difference
    back into itself, 2 gamma - damping^2 / 4 = 1, and both come to their walls under the drive."""
    damping = 0.3
    start = cb.symmetric(0.6, 0.3, 0.8, lattice=cb.OpenChain(2), damping=damping)
    graze = cb.trace(start, "a", towards="up").first("GR")
    line = cb.boundary(graze, ("gamma", "a"), within={"gamma": (0.2, 0.6)}, towards="up", events=())
    assert line[-1].label == "GR-VI1", (line.stop, line.reason)
    assert abs(line[-1]["gamma"] - (1 + damping**2 / 4) / 2) < 1e-9
    assert abs(line[-1]["a"] - math.hypot(1, damping)) < 1e-9


def test_nothing_is_seen_where_an_impact_vanishes_but_its_end() -> None:
    """The saltation has a pole there: no multiplier passes the circle."""
    start = cb.symmetric(0.35, 0.02, 0.8, lattice=cb.Ring(6), spring=0.5)
    branch = cb.trace(start, "a")
    assert branch[0].kind == "VI"
    assert not [point for point in (*branch.special, *branch.doubtful) if point.kind == "PF"]


def test_where_an_impact_vanishes_chi_is_that_of_the_lattice() -> None:
    """The mean of tan(pi w/2)/w over the modes, here of two coupled sites."""
    start = cb.symmetric(0.3, 0.04, 0.8, lattice=cb.OpenChain(2), spring=0.1)
    end = cb.trace(start, "a").first("VI").solution
    chi = np.mean([math.tan(0.5 * math.pi * w) / w for w in np.sqrt([0.1, 0.18])])
    assert (end.p, end.chi) == pytest.approx((0.0, chi), abs=1e-12)


def test_flights_with_heavy_damping_neither_overflow_nor_cancel() -> None:
    for damping in (1e-9, 1e-6, 3.0, 1e3):
        fly = propagator(np.array([0.0, 0.2]), math.pi, damping)
        assert fly.reach[0] == pytest.approx(-math.expm1(-damping * math.pi) / damping, rel=1e-12)
        assert np.isfinite(np.concatenate(fly)).all()


@pytest.mark.parametrize("damping", [0.0, 1e-6, 0.3, 2.0, 5.0])
def test_flights_are_exact_where_modes_drift_turn_and_creep(damping: float) -> None:
    """Against thirty digits."""
    t = 1.7

    def exact(z: Any, d: Any) -> list[Any]:
        """C, S, z S and C - d S."""
        root = mp.sqrt(mp.mpc(z - d * d / 4))
        s = mp.exp(-d * t / 2) * mp.sin(root * t) / root
        c = mp.exp(-d * t / 2) * mp.cos(root * t) + d * s / 2
        return [c, s, z * s, c - d * s]

    x = np.array([-4.0, -1.0, -0.251, -0.249, -1e-3, -1e-9, 1e-9, 1e-3, 0.1, 0.249, 0.251, 1.0, 30])
    z = x / t**2 + 0.25 * damping**2
    z = z[z >= 0.0]
    fly = propagator(z, t, damping)
    with mp.workdps(40):
        for i, one in enumerate(map(mp.mpf, z.tolist())):
            got, scale = [float(column[i]) for column in fly], 1.0 + 0.1 * float(abs(one))
            wanted = [float(mp.re(w)) for w in exact(one, mp.mpf(damping))]
            assert got == pytest.approx(wanted, abs=2e-14 * scale)
    one, other = free_multipliers(z, damping, t)
    matrix = np.array([[fly.cosine, fly.reach], [-fly.pull, fly.swing]]).transpose(2, 0, 1)
    assert one + other == pytest.approx(np.trace(matrix, axis1=1, axis2=2), abs=1e-13)
    assert one * other == pytest.approx(np.linalg.det(matrix), abs=1e-13)


def test_a_drive_is_in_resonance_to_rounding_only() -> None:
    """One mode, driven with its frequency 1: of f = cos t it makes (cos t)/(1 - spring)."""
    for off in (1e-10, -1e-10):
        forced = driven_spectrum(cb.Ring(3), cb.Harmonic(), 0.1, 1.0 + off, 0.0)
        assert forced.everywhere(0.0, 0)[0] == pytest.approx(-1.0 / off, rel=1e-5)
    with pytest.raises(cb.BadInput, match="has the frequency 1 of one of its harmonics"):
        driven_spectrum(cb.Ring(3), cb.Harmonic(), 0.1, 1.0 + 1e-13, 0.0).everywhere(0.0, 0)
    assert math.isfinite(
        driven_spectrum(cb.Ring(3), cb.Harmonic(), 0.1, 1.0, 1e-6).everywhere(0.0, 0)[0]
    )
    third = driven_spectrum(cb.Ring(3), cb.Fourier(cos={1: -1.0, 3: 1.0}), 0.1, 9.0 + 1e-10, 0.0)
    assert third.everywhere(0.0, 0)[0] == pytest.approx(1e10, rel=1e-4)


@pytest.mark.slow
def test_the_boundary_of_an_arm_where_it_comes_back_is_one_of_pitchforks(tmp_path) -> None:
    start = cb.symmetric(0.7, 0.02, 0.8, lattice=cb.OpenChain(5), site=2)
    fork = cb.trace(start, "a", within={"a": (0.7, 0.75)}).first("PF")
    arm = cb.switch(fork, within={"a": (0.72, 0.75)})[0]
    back = cb.trace(arm[2], "a", within={"a": (0.72, 0.75)}).first("PF")
    steps = cb.Steps(most=2)
    line = cb.boundary(back, ("gamma", "a"), steps=steps)
    assert line.problem.label == "PF boundary"
    cb.save(tmp_path / "line.nc", line)
    assert cb.load(tmp_path / "line.nc").problem.label == "PF boundary"


@pytest.mark.parametrize(
    ("lattice", "site"), [(cb.Ring(9), 4), (cb.OpenChain(21), 10), (cb.Ring(21), 20)]
)
def test_a_breather_of_any_site_is_site_0_of_the_infinite_chain(lattice, site) -> None:
    far = cb.symmetric(a=0.5, gamma=0.05, k=0.8, lattice=lattice, site=site)
    there, wanted = far.on(cb.InfiniteChain()), cb.symmetric(a=0.5, gamma=0.05, k=0.8)
    assert there.section == wanted.section
    assert there.p == pytest.approx(wanted.p, abs=1e-14)
    assert far.p == pytest.approx(wanted.p, abs=1e-8)


def test_a_part_that_no_bond_reaches_changes_nothing() -> None:
    parts = cb.Lattice.from_graph(nx.disjoint_union(nx.path_graph(3), nx.path_graph(2)))
    whole, alone = (
        cb.trace(cb.symmetric(0.8, 0.05, 0.8, lattice=lattice, site=0), "a", towards="up")
        for lattice in (parts, cb.OpenChain(3))
    )
    assert whole.first("GR")["a"] == pytest.approx(alone.first("GR")["a"], abs=1e-14)
