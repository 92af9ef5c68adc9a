"""What `zones(..., beyond=True)` says of regions beyond GR."""

from __future__ import annotations

import pytest

import contbreather as cb
from contbreather.orbits.zone_diagram import beyond_grazing
from tests.campaigns.beyond import checked

WINDOW = {"gamma": (0.02, 0.1)}


@pytest.fixture(scope="module")
def elastic() -> cb.orbits.Zones:
    return cb.zones(k=0.8, within=WINDOW, beyond=True)


def test_beyond_grazing_three_sites_impact_and_are_unstable(elastic) -> None:
    (region,) = (region for region in elastic.regions if any(region.beyond))
    assert {*region.beyond} == {"3 sites impact: unstable"}
    assert region.counts == (None,) * 5
    assert region.describe().endswith("; beyond GR 3 sites impact: unstable")
    # the whole branch beyond GR, with no window at the place that was asked about
    end = cb.trace(cb.symmetric(0.6, region.x, 0.8), "a", towards="up").first("GR")
    assert end["a"] < region.y
    (arm,) = cb.switch(end, within={"a": (0.01, 1.5)}, events=[cb.user("a", region.y)])
    there = [point.solution for point in arm.special if point.kind == "UZ"]
    assert {orbit.section.hit for orbit in there} == {(-1, 0, 1)}
    assert not any(orbit.stability().stable for orbit in there)
    assert [checked(orbit) for orbit in there] == [""] * len(there)


SOFT = {"gamma": 0.05, "damping": 0.02, "lattice": cb.Ring(9)}
GRID = {"gamma": 0.03, "damping": 0.02, "lattice": cb.Grid(3, 3)}


@pytest.mark.parametrize(
    ("on", "k", "a"), [(SOFT, 0.03, 0.95), (SOFT, 0.02, 0.89), (GRID, 0.03, 0.92)]
)
def test_a_simulation_does_what_is_said_of_the_place_where_it_begins(on, k, a) -> None:
    passing, *_ = cb.orbits.symmetric_roots(a, k=k, **on)
    assert not passing.admissibility().ok
    assert beyond_grazing(passing, 1.005) == "site 0 impacts 4 times a period: stable"
    end = cb.trace(cb.symmetric(0.85, k=k, **on), "a", towards="up").first("GR")
    run = cb.simulate(end.solution, a=a, periods=250)
    assert run.impacts[run.impacts["period"] == 249]["site"].tolist() == [0] * 4


def test_where_a_site_is_said_to_chatter_it_comes_to_rest_in_a_simulation() -> None:
    passing, *_ = cb.orbits.symmetric_roots(0.915, 0.0099, 0.03)
    assert beyond_grazing(passing, 1.005).startswith("site 0 chatters: it comes back to its wall")
    on = {"gamma": 0.0099, "damping": 0.05, "lattice": cb.Ring(5)}
    inside = cb.symmetric(0.89, k=0.03, **on)
    run = cb.simulate(inside, a=0.915, periods=250)
    assert {*run.rests[run.rests["period"] == 249]["site"].tolist()} == {0}


def test_elsewhere_nothing_is_said(elastic) -> None:
    assert not any(any(region.beyond) for region in elastic.regions if region.verdict)
    (below,) = (r for r in elastic.regions if not r.verdict and not any(r.beyond))
    assert below.y < 0.1
    assert below.beyond == ("",) * 5
    assert "beyond GR" not in below.describe()
    assert elastic.beyond_grazing(0.05, 0.5) == ""  # a breather is there
    silent = cb.zones(k=0.8, within=WINDOW)
    assert {region.beyond for region in silent.regions} == {()}


def test_a_diagram_without_GR_says_so() -> None:
    low = cb.zones(k=0.8, within={**WINDOW, "a": (0.01, 0.3)}, beyond=True)
    assert [*low.sentences()] == ["No curve of GR is there, beyond which other orbits could be"]


def test_what_is_beyond_is_kept_in_files_and_drawn(elastic, tmp_path) -> None:
    cb.save(tmp_path / "zones.nc", elastic)
    kept = cb.load(tmp_path / "zones.nc")
    assert [region.beyond for region in kept.regions] == [r.beyond for r in elastic.regions]
    texts = [text.get_text() for text in cb.plotting.plot_zones(kept).axes.texts]
    assert "3 sites impact:\nunstable" in texts
    with pytest.raises(cb.BadInput, match="beyond"):
        cb.zones(k=0.8, beyond="yes")
