"""Zone diagrams of any finite lattice: the same search, by exact modes."""

from __future__ import annotations

import pytest

import contbreather as cb
from contbreather.orbits.one_site import family_of

WINDOW = {"gamma": (0.03, 0.032), "a": (0.72, 0.95)}


@pytest.fixture(scope="module")
def damped() -> cb.orbits.Zones:
    return cb.zones(
        k=0.8, lattice=cb.OpenChain(3), site=1, damping=0.02, within=WINDOW, progress=False
    )


def test_curves_of_a_damped_chain_are_where_multipliers_and_margins_say(damped) -> None:
    (fork,), (graze,) = damped["PF"], damped["GR"]
    for point in fork[::20]:
        assert abs(point.multipliers(half=True) - 1.0).min() < 1e-7
        assert point.solution.damping == 0.02
    for point in graze[::20]:
        assert abs(point.admissibility().margin) < 1e-9
    assert damped.model["site"] == 1
    counts = {r.verdict for r in damped.regions}
    assert counts == {"S", "US", ""}
    below, above = damped.unstable(0.031, 0.73), damped.unstable(0.031, 0.88)
    assert (below, above) == (0, 1)
    assert cb.symmetric(
        0.88, 0.031, 0.8, lattice=cb.OpenChain(3), site=1, damping=0.02
    ).stability().unstable == 1  # fmt: skip


def test_upper_breathers_of_a_ring_are_the_same_by_modes() -> None:
    for lattice, spring in ((cb.Ring(6), None), (cb.Ring(6), 0.0)):
        found = cb.orbits.symmetric_roots(0.5, 0.1, 0.6, lattice=lattice, spring=spring)
        assert [family_of(orbit) for orbit in found] == ["upper", "lower"]


def test_what_zones_cannot_be_of_is_refused() -> None:
    for given in ({"damping": 0.1}, {"spring": 0.1}, {"site": 1}, {"walls": (-2, 2)}):
        with pytest.raises(cb.BadInput, match="name a lattice"):
            cb.zones(k=0.8, **given)
    with pytest.raises(cb.BadInput, match="past_folds: lower breathers"):
        cb.zones(k=0.8, lattice=cb.Ring(6), damping=0.1, past_folds=True)
    with pytest.raises(cb.BadInput, match="no such site"):
        cb.zones(k=0.8, lattice=cb.OpenChain(3), site=3)
    with pytest.raises(cb.BadInput, match="the walls are not symmetric"):
        cb.zones(k=0.8, lattice=cb.OpenChain(3), walls=(-1, 2))
