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


@pytest.mark.slow
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


FAINT = {"gamma": 0.0099}


@pytest.mark.parametrize(
    ("on", "k", "a", "says"),
    [
        (SOFT, 0.03, 0.95, "site 0 impacts 4 times a period: stable"),
        (SOFT, 0.02, 0.89, "site 0 impacts 4 times a period: stable"),
        (GRID, 0.03, 0.92, "site 0 impacts 4 times a period: stable"),
        (FAINT, 0.03, 0.915, "site 0 chatters: it comes back to its wall"),
    ],
)
def test_of_a_place_it_is_said_what_simulations_come_to_there(on, k, a, says) -> None:
    """They are begun beyond GR in `test_beyond_grazing`."""
    passing, *_ = cb.orbits.symmetric_roots(a, k=k, **on)
    assert not passing.admissibility().ok
    assert beyond_grazing(passing, 1.005).startswith(says)


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


@pytest.mark.slow
def test_what_is_beyond_is_kept_in_files_and_drawn(elastic, tmp_path) -> None:
    cb.save(tmp_path / "zones.nc", elastic)
    kept = cb.load(tmp_path / "zones.nc")
    assert [region.beyond for region in kept.regions] == [r.beyond for r in elastic.regions]
    texts = [text.get_text() for text in cb.plotting.plot_zones(kept).axes.texts]
    assert "3 sites impact:\nunstable" in texts
    with pytest.raises(cb.BadInput, match="beyond"):
        cb.zones(k=0.8, beyond="yes")
