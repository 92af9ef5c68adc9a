"""Counts of multipliers and the events that change them: the same from anywhere, with any steps."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np
import pytest

import contbreather as cb
from contbreather.orbits.orbit import orbit_at, orbit_of
from contbreather.orbits.section import Section
from contbreather.stability import ns_points
from contbreather.stability.one_impact import window

from ..campaigns import branches, rims
from ..effort import effort

SMALL = cb.Steps(largest=0.01, most=20000)


def places(branch: cb.Branch, kind: str, name: str = "a") -> list[float]:
    return [point[name] for point in branch.special if point.kind == kind]


# --- windows within one step ----------------------------------------------------------------------


@pytest.mark.parametrize("a", [0.1, 0.65])
@pytest.mark.parametrize("steps", [None, SMALL])
def test_a_window_of_instability_is_seen_from_any_start_with_any_steps(a, steps):
    branch = cb.trace(cb.symmetric(a, 0.015, 0.99), "a", steps=steps)
    assert places(branch, "NS") == pytest.approx([0.590121666762, 0.611547452632], abs=1e-11)
    needed = sorted(point.b for point in ns_points(0.015, 0.99))
    found = sorted(p.solution.b for p in branch.special if p.kind == "NS")
    assert found == pytest.approx(needed, rel=1e-11)


def test_no_window_is_smoothly_next_to_an_empty_one():
    """Where no b brings a pair out the float stays positive, small next to where one does."""
    low, high = 0.094, 0.096  # the line has its least gamma between
    sizes = []
    for gamma in np.linspace(low, high, 41):
        found = window(float(gamma), 0.8)
        assert (found.square > 0) == bool(ns_points(float(gamma), 0.8))
        sizes.append(found.square)
    assert sizes[0] < 0 < sizes[-1]
    assert np.abs(np.diff(sizes, 2)).max() < 0.05 * np.abs(np.diff(sizes)).max()


@pytest.mark.slow
def test_random_branches_have_the_same_special_points_from_anywhere_and_as_a_scan():
    seen = Counter()
    for number in range(8, 12):
        *_, said, specials = branches.check(np.random.default_rng([0, number]), 2)
        assert said == []
        seen += specials
    assert set(seen) == {"LP", "PF", "NS"}


# --- the rims -----------------------------------------------------------------------------------


def test_counts_next_to_a_quarter_are_no_nonsense_and_not_called_certain():
    rng = np.random.default_rng(0)
    for _ in range(60):
        gamma = 0.25 - 10 ** rng.uniform(-16, -11)
        k = float(rng.choice([1.0, rng.random()]))
        b = cb.symmetric(10 ** rng.uniform(-3, 3), gamma, k)
        verdict = b.stability()
        assert 0 <= verdict.unstable <= 3
        assert not verdict.certain
        assert "uncertain" in verdict.describe()


@pytest.mark.parametrize("room", [5e-7, 8e-9, 1.3e-9])
def test_multipliers_next_to_a_quarter_are_as_many_as_counted(room):
    gamma = 0.25 - room
    for k in (0.3, 0.9, 1.0):
        for a in (1e-4, 0.3, 2.0, 1e4):
            try:
                verdict = cb.symmetric(a, gamma, k, root=1).stability()
            except cb.NoSolution:
                continue
            assert verdict.multipliers.size == verdict.unstable


@pytest.mark.slow
def test_random_parameters_up_to_the_rims_get_an_answer_or_a_sentence():
    rng = np.random.default_rng(2)
    for _ in range(80):
        case, told = rims.drawn(rng), []
        work = effort(lambda case=case, told=told: told.append(rims.answer(*case)))
        assert told[0] in rims.ANSWERED, case
        assert work.calls < 50_000, case  # a hundredth of a second
        assert work.memory < 2e7


def test_a_branch_in_k_to_elastic_impacts_has_one_and_the_same_end():
    """A pair that is outside for k < 1 and neutral at k = 1 itself is no event there."""
    for start in (0.8, 0.95, 0.999):
        branch = cb.trace(cb.symmetric(0.09, 0.1, start), "k", within={"k": (0.6, 1.0)})
        assert [point.kind for point in branch.special] == ["EP", "LP", "NS", "EP"]
        assert branch.special[-1]["k"] == 1.0
        assert not branch.doubtful


# --- several sites, boundaries, starts at events ------------------------------------------------


def test_two_neighbouring_sites_are_counted_or_said_to_be_uncertain():
    b = cb.symmetric(0.6, 0.04, 0.8)
    times = [b.phi, b.phi + 1e-3, b.phi + math.pi, b.phi + math.pi + 1e-3]
    section = Section(((0, 1), (1, 1), (0, -1), (1, -1)))
    impulses = [-2 * b.p, -2 * b.p, 2 * b.p, 2 * b.p]
    both = orbit_of(b.conditions, section, times, impulses).solved()
    branch = cb.trace(both, "a", within={"a": (0.4, 0.75)})
    assert branch["a"][[0, -1]] == pytest.approx([0.4, 0.75])
    certain = [point.solution.map.count().certain for point in branch]
    assert sum(certain) > len(branch) // 2
    crossings = [point for point in branch.special if point.kind == "BP"]
    assert len(crossings) == 2  # there a multiplier is on the circle
    said = [point.solution.map.count() for point in crossings]
    assert all(not count.certain or count.distance < 1e-6 for count in said)


@pytest.mark.parametrize("kind", ["LP", "PF", "NS"])
def test_on_its_own_boundary_a_count_is_no_number(kind):
    point = cb.trace(cb.symmetric(0.5, 0.1, 0.8), "a").special
    start = next((p for p in point if p.kind == kind), None)
    if start is None:
        start = cb.trace(cb.symmetric(0.7, 0.04, 0.8), "a").first(kind)
    line = cb.boundary(start, ("gamma", "a"), within={"gamma": (0.02, 0.12), "a": (0.01, 1)})
    assert np.isnan(line["unstable"]).all()


def test_a_branch_that_starts_at_its_pitchfork_counts_it_once():
    pitchfork = cb.trace(cb.symmetric(0.7, 0.04, 0.8), "a").first("PF")
    for start in (cb.symmetric(pitchfork["a"], 0.04, 0.8), pitchfork):
        branch = cb.trace(start, "a", within={"a": (0.5, 0.9)})
        assert [point.label for point in branch.special] == ["EP1", "PF1", "EP2"]


@pytest.mark.parametrize(
    ("lattice", "site"), [(cb.InfiniteChain(), 0), (cb.Ring(12), 0), (cb.OpenChain(5), 2)]
)
def test_where_an_impact_vanishes_counts_and_multipliers_are_blank(lattice, site: int) -> None:
    """The saltation has a pole there; the site that is named is the one that impacts."""
    branch = cb.trace(cb.symmetric(0.7, 0.03, 0.8, lattice=lattice, site=site), "a")
    end, grazing = branch.first("VI"), branch.first("GR")  # that end is no grazing
    assert end.label == branch[0].label == "VI1"
    assert abs(end.solution.impulses).max() < 2e-9
    assert abs(grazing.solution.impulses).min() > 2
    assert grazing.solution.admissibility().max_neighbour == pytest.approx(1, abs=1e-12)
    assert end.detail["site"] == site
    assert f"the impact of site {site} itself vanishes" in end.admissibility().reason
    assert math.isnan(end["unstable"])
    assert branch["unstable"][-2] >= 0
    assert math.isnan(branch["unstable"][0])
    assert math.isnan(branch.to_dataframe()["unstable"][0])
    assert dict(end.table().rows)["unstable"] is None
    verdict = end.stability()
    assert verdict.stable is None
    assert math.isnan(verdict.largest)
    assert not verdict.multipliers.size
    assert repr(verdict).endswith("nothing is said of stability where an impact vanishes>")
    if lattice.sites is not None:
        assert np.isnan(end.multipliers()).all()
        assert end.multipliers().shape == branch[-1].multipliers().shape


def test_a_count_is_blank_in_the_table_of_a_point_as_in_that_of_its_branch() -> None:
    branch = cb.trace(cb.symmetric(0.7, 0.04, 0.8), "a", within={"a": (0.7, 0.8)})
    assert [dict(point.table().rows)["unstable"] for point in branch.special] == [0, None, 1]
    (column,) = [one for one in branch.table().columns if one.heading == "unstable"]
    assert list(column.cells) == [0, None, 1]


def test_a_point_at_a_fold_goes_to_a_ring() -> None:
    """There Newton's matrix is singular; the point solves the ring's equations but for rounding."""
    fold = cb.trace(cb.symmetric(0.7, 0.04, 0.8), "a").first("LP")
    orbit = orbit_at(cb.shooting(fold, sites=20))
    assert orbit.residual < 1e-12
    assert orbit.p == pytest.approx(fold["p"], rel=1e-6)


def test_the_angle_of_a_pair_is_known_from_its_window() -> None:
    start = cb.symmetric(a=0.2, gamma=0.05, k=0.8)
    found = cb.trace(start, "gamma", within={"gamma": (0.0, 0.2)}).first("NS")
    ends = sorted(ns_points(found["gamma"], 0.8), key=lambda point: point.b)
    own = window(found["gamma"], 0.8)
    assert abs(own.miss(found.solution.representation.b)) < 1e-10
    assert [own.low, own.high] == pytest.approx([point.nu for point in ends], abs=1e-12)
