"""What keeps breathers off their walls: always on, for any forcing, and told where it is lifted."""

from __future__ import annotations

import math

import numpy as np
import pytest

import contbreather as cb
from contbreather.orbits import saddle_node

from ..campaigns.existence import plain
from ..effort import effort
from .by_hand import distance

PLACE = ("gamma", "a", "p", "phi")
WELLS = cb.Fourier(cos={1: -1, 3: -0.23}, sin={3: 2.62})
TIED = cb.Fourier(cos={1: -1, 3: 1.82})  # at gamma = 0 two crests of every site graze at once


def reach(breather: cb.Orbit) -> float:
    """Largest |u| wherever there is no impact, by brute force: over times and sites."""
    return 1.0 + plain(breather, 4000)


def random_forcing(seed: int) -> cb.Fourier:
    rng = np.random.default_rng(seed)
    orders = [(3,), (5,), (3, 5)][rng.integers(3)]
    cos = {1: -1.0} | {m: float(rng.normal(0, 3)) for m in orders}
    return cb.Fourier(cos=cos, sin={m: float(rng.normal(0, 3)) for m in orders})


# --- zones of any forcing ---------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(
    ("k", "forcing", "window"),
    [
        (0.94, TIED, (0.0, 0.05)),
        (0.8, WELLS, (0.235, 0.2499)),
        (0.06, cb.Fourier(cos={1: -1.0, 3: -6.66}), (0.249, 0.2499)),
    ],
)
def test_no_point_of_a_grazing_curve_is_behind_another_wall(k, forcing, window):
    lines = cb.zones(k=k, forcing=forcing, within={"gamma": window})["GR"]
    assert lines
    for line in lines:
        assert not line.stop.failed
        assert line.began is None or not line.began.failed
        for point in list(line)[::8]:
            assert reach(point.solution) < 1 + 1e-9, point


@pytest.mark.slow
def test_where_a_lower_crest_grazes_no_more_the_higher_one_takes_over() -> None:
    within = {"gamma": (0.235, 0.245)}
    diagram = cb.zones(k=0.8, forcing=WELLS, within=within, past_folds=True)
    (corner,) = (point for point in diagram.special if point.kind == "GR-GR")
    arcs = [line for line in diagram["GR"] if corner in (line[0], line[-1])]
    touching = [line for line in diagram["GR"] if distance((line,), corner, *PLACE) < 1e-9]
    assert len(arcs) == 1
    assert len(touching) == 2  # one arc ends there, another begins
    breather = corner.solution
    times = [line[1]["t"] for line in touching]
    heights = [abs(breather.displacement(1, line[-1]["t"] if line[-1] is corner else line[0]["t"]))
               for line in touching]  # fmt: skip
    assert heights == pytest.approx([1.0, 1.0], abs=1e-9)
    assert abs(math.remainder(times[0] - times[1], math.pi)) > 0.1  # two crests of one site


@pytest.mark.slow
def test_breathers_that_are_all_but_mirror_images_have_a_curve_each() -> None:
    """Near k = 1 time reversal makes pairs that are alike in a and p, but not in phi."""
    within = {"gamma": (0.149, 0.151)}
    diagram = cb.zones(k=0.94, forcing=TIED, within=within, past_folds=True)
    seen: list[cb.continuation.Point] = []
    for root in cb.orbits.symmetric_roots(0.6, 0.15, 0.94, forcing=TIED):
        point = cb.trace(root, "a", towards="up").special[-1]
        if root.admissibility().ok and point.kind == "GR" and point["p"] > 1e-6:
            assert distance(diagram["GR"], point, *PLACE) < 0.01
            seen.append(point)
    apart = [
        (abs(one["p"] - two["p"]), abs(one["phi"] - two["phi"])) for one in seen for two in seen
    ]
    assert any(p < 1e-3 and phi > 1 for p, phi in apart)


def test_the_far_field_alone_is_never_what_grazes_first() -> None:
    """Far out neighbours differ by one harmonic of alternating sign: one of two climbs higher."""
    for seed in range(4):
        forcing = random_forcing(seed)
        for breather in cb.orbits.symmetric_roots(0.6 / forcing.peak(), 0.1, 0.7, forcing=forcing):
            margins = breather.admissibility()
            assert margins.neighbours <= margins.far + 1e-15


# --- folds ------------------------------------------------------------------------------------


@pytest.mark.slow
def test_folds_are_passed_on_request_and_not_passed_on_request() -> None:
    within = {"gamma": (0.11, 0.14)}
    beyond = cb.zones(k=0.8, within=within, past_folds=True)["NS"]
    ended = cb.zones(k=0.8, within=within)["NS"]
    (fold,) = (point for line in ended for point in line.special if point.kind == "NS-LP")
    assert min(line["p"].min() for line in ended) > fold["p"] - 1e-9
    assert min(line["p"].min() for line in beyond) < fold["p"] - 0.01


# --- rings ------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def ring() -> cb.orbits.Zones:
    return cb.zones(k=0.8, lattice=cb.Ring(16), within={"gamma": (0.0, 0.2)})


@pytest.mark.slow
def test_the_line_of_the_papers_rule_on_a_ring_is_whole(ring: cb.orbits.Zones) -> None:
    """Against the envelope that Newton's method finds for all pairs at once."""
    from contbreather.paper.threshold import neimark_sacker_line

    whole = neimark_sacker_line(0.8, sites=16, points=8)
    for gamma, a in zip(whole.gamma, whole.a, strict=True):
        assert distance(ring["NS"], {"gamma": gamma, "a": a}, "gamma", "a") < 1e-4


def test_the_pieces_of_that_line_join_end_to_end(ring: cb.orbits.Zones) -> None:
    ends = [end for line in ring["NS"] for end in (line[0], line[-1])]
    joints = [end for end in ends if end.kind == "NS-NS"]
    assert len(joints) >= 6
    for end in joints:
        twins = [o for o in ends if abs(o["a"] - end["a"]) + abs(o["gamma"] - end["gamma"]) < 1e-8]
        assert len(twins) == 2
    assert sorted(end.kind for end in ends if end.kind != "NS-NS") == ["NS-GR", "NS-LP"]
    assert all(point.kind != "NS-NS" for point in ring.special)


def test_regions_of_a_ring_are_lettered_by_its_own_multipliers(ring: cb.orbits.Zones) -> None:
    assert {region.verdict for region in ring.regions} >= {"S", "US"}
    for region in ring.regions:
        if region.verdict:
            breather = cb.symmetric(region.y, region.x, 0.8, lattice=cb.Ring(16))
            assert breather.stability().stable == (region.verdict == "S")


@pytest.mark.slow
def test_threshold_of_a_ring_is_what_the_zones_are_about() -> None:
    within = {"gamma": (0.03, 0.06), "a": (0.1, 0.4)}
    lattice = cb.Ring(20)
    strict, lenient = (
        cb.zones(k=0.8, lattice=lattice, within=within, threshold=t) for t in (1.005, 1.02)
    )
    for diagram in (strict, lenient):
        for line in diagram["NS"]:
            largest = line[len(line) // 2].solution.stability().largest
            assert largest == pytest.approx(diagram.threshold, abs=1e-9)
        for gamma, a in ((0.058, 0.35), (0.05, 0.2), (0.035, 0.3), (0.032, 0.12)):
            orbit = cb.symmetric(a, gamma, 0.8, lattice=lattice)
            wanted = orbit.stability(threshold=diagram.threshold).unstable
            assert diagram.unstable(gamma, a) == wanted


# --- walls are always on ----------------------------------------------------------------------


def start() -> cb.Orbit:
    return cb.symmetric(a=0.5, gamma=0.04, k=0.8)


@pytest.mark.parametrize("events", [(), [cb.fold()], [cb.pitchfork(), cb.user("a", 0.6)]])
def test_events_that_are_asked_for_come_on_top_of_the_walls(events: list[cb.Event]) -> None:
    branch, whole = (cb.trace(start(), "a", events=e) for e in (events, None))
    assert branch[-1].kind == whole[-1].kind == "GR"
    assert branch[-1]["a"] == pytest.approx(whole[-1]["a"], abs=1e-12)
    assert all(reach(point.solution) < 1 + 1e-9 for point in list(branch)[1:-1:5])
    assert "walls" not in branch.describe()


def test_a_wall_that_is_asked_for_is_there_once() -> None:
    branch = cb.trace(start(), "a", towards="up", events=[cb.grazing()])
    assert [point.kind for point in branch.special] == ["EP", "GR"]


def test_a_start_behind_a_wall_is_refused_and_told_how_to_go_on() -> None:
    behind = cb.symmetric(0.97, 0.04, 0.8, root=1)
    with pytest.raises(cb.BadInput, match="inadmissible=True"):
        cb.trace(behind, "a", events=[cb.fold()])
    branch = cb.trace(behind, "a", within={"a": (0.9, 1.2)}, inadmissible=True)
    assert branch["a"].max() == 1.2


def lifted() -> cb.Branch:
    return cb.trace(start(), "a", within={"a": (0.3, 1.5)}, inadmissible=True)


def test_a_branch_without_walls_says_so_in_its_repr_and_in_a_column() -> None:
    branch = lifted()
    assert "walls lifted" in repr(branch)
    assert [point.kind for point in branch.special] == ["EP", "PF", "EP"]
    for point in branch:
        assert point["margin"] == pytest.approx(point.solution.admissibility().margin, abs=1e-15)
    beyond = branch["margin"] < 0
    assert 0 < beyond.sum() < len(branch)
    for point, behind in zip(branch, beyond, strict=True):
        assert (reach(point.solution) > 1 + 1e-9) == behind
    assert "margin" not in cb.trace(start(), "a").names


@pytest.mark.slow
def test_a_plot_shows_what_is_behind_a_wall() -> None:
    branch = lifted()
    ax = cb.plot(branch).axes
    dotted = [line for line in ax.get_lines() if line.get_linestyle() == ":"]
    (line,) = dotted
    first = branch["a"][branch["margin"] < 0].min()
    spacing = np.diff(branch["a"]).max()
    assert abs(line.get_xdata().min() - first) <= spacing
    assert line.get_xdata().max() == pytest.approx(1.5)
    words = [text.get_text() for text in ax.get_legend().get_texts()]
    assert any("wall" in word for word in words)
    plain = cb.plot(cb.trace(start(), "a")).axes
    assert not [line for line in plain.get_lines() if line.get_linestyle() == ":"]


def test_curves_and_arms_from_a_branch_without_walls_have_none_either() -> None:
    point = lifted().first("PF")
    line = cb.boundary(point, ("gamma", "a"), within={"a": (0.1, 1.5)})
    assert "walls lifted" in repr(line)
    assert line["margin"].min() < 0
    assert "GR" not in {kind for one in line.special for kind in one.kind.split("-")}
    walled = cb.boundary(cb.trace(start(), "a").first("PF"), ("gamma", "a"))
    assert walled.special[-1].kind == "PF-GR"
    arm = cb.switch(point, within={"a": (0.5, 1.0)})[0]
    assert arm["a"].max() == 1.0
    assert arm["margin"].min() < 0


def test_a_boundary_keeps_its_walls_whatever_events_are_asked_for() -> None:
    point = cb.trace(start(), "a").first("PF")
    line = cb.boundary(point, ("gamma", "a"), events=[saddle_node()])
    assert line.special[-1].kind == "PF-GR"
    beyond = cb.boundary(point, ("gamma", "a"), within={"a": (0.1, 1.5)}, inadmissible=True)
    assert beyond["margin"].min() < 0


def test_lifting_walls_of_a_problem_that_has_none_changes_nothing() -> None:
    mine = cb.Problem(lambda x, p: np.array([x[0] ** 2 - p["mu"]]), {"x": 1.0}, {"mu": 1.0})
    plain, free = (
        cb.trace(mine, "mu", within={"x": (-1, 2)}, events=[cb.fold()], inadmissible=flag)
        for flag in (False, True)
    )
    np.testing.assert_array_equal(plain["x"], free["x"])
    assert plain.names == free.names


# --- quiet neighbours -------------------------------------------------------------------------


@pytest.mark.parametrize(("a", "gamma", "k"), [(2e-5, 1e-6, 0.999999), (1e-7, 1e-6, 1.0)])
def test_quiet_neighbours_are_judged_as_fast_as_loud_ones(a: float, gamma: float, k: float) -> None:
    quiet, loud = cb.symmetric(a, gamma, k), cb.symmetric(0.5, 0.08, 0.8)
    assert effort(quiet.admissibility).calls < 8 * effort(loud.admissibility).calls
    assert effort(quiet.admissibility).memory < 8 * effort(loud.admissibility).memory
    margins = quiet.admissibility()
    s = quiet.phi + np.linspace(0, 2 * math.pi, 20001)
    assert margins.max_neighbour < 1e-4
    assert margins.max_neighbour == pytest.approx(abs(quiet.displacement(1, s)).max(), rel=1e-6)


@pytest.mark.parametrize("c3", [0.05, 0.3])
def test_grazing_is_followed_from_where_there_is_no_coupling(c3: float) -> None:
    """There the crest lies on the grid on which margins are looked at: 0/0 but for rounding."""
    start = cb.symmetric(0.5, 0.0, 0.8, forcing=cb.Fourier(cos={1: -1, 3: c3}))
    line = cb.boundary(cb.trace(start, "a").first("GR"), ("gamma", "a"), within={"gamma": (0, 0.1)})
    assert line[-1]["gamma"] == 0.1
    assert all(point.solution.admissibility().margin > -1e-9 for point in line)


@pytest.mark.parametrize("damping", [0.0, 0.01])
@pytest.mark.parametrize("site", [15, 31])
def test_walls_of_any_one_site_of_a_ring_are_looked_at(site: int, damping: float) -> None:
    """A mirror image of one that is looked at, and one so far away that it follows the drive."""
    on = {"a": 0.6, "gamma": 0.04, "k": 0.8, "lattice": cb.Ring(32), "damping": damping}
    verdict = cb.symmetric(**on, walls={site: 0.55}).admissibility()
    assert (verdict.ok, verdict.site) == (False, site)


@pytest.mark.parametrize("walls", [1, (-1, 1)])
def test_walls_at_one_are_those_of_the_infinite_chain_written_down_or_not(walls) -> None:
    assert cb.symmetric(0.5, 0.04, 0.8, walls=walls) == cb.symmetric(0.5, 0.04, 0.8)
