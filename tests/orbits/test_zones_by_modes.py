"""Zone diagrams of any finite lattice: the same search, by exact modes."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import pytest

import contbreather as cb

WINDOW = {"gamma": (0.03, 0.032), "a": (0.72, 0.95)}
FAR = {"gamma": (0.03, 0.032), "a": (1.4, 1.9)}


@pytest.fixture(scope="module")
def damped() -> cb.orbits.Zones:
    return cb.zones(
        k=0.8, lattice=cb.OpenChain(3), site=1, damping=0.02, within=WINDOW, progress=False
    )


@pytest.mark.slow
def test_the_picture_names_the_site_and_walls(damped) -> None:
    far = cb.zones(k=0.8, lattice=cb.Ring(3), walls=(-2, 2), within=FAR, progress=False)
    for zones, said in ((damped, "3 sites, site 1, damping 0.02"), (far, "3, walls -2.0,2.0")):
        title = cb.plotting.plot_zones(zones).axes.get_title(loc="left").replace("\n", " ")
        assert f"{said}, threshold" in title


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


def test_every_pair_that_passes_the_threshold_has_its_curve(tmp_path: Path) -> None:
    """Where one pair is outside a second one follows, and the first comes back."""
    model = {"lattice": cb.OpenChain(4), "site": 1, "damping": 0.03, "spring": 0.1}
    branch = cb.trace(
        cb.symmetric(0.6, 0.11, 0.8, **model), "a", within={"a": (0.6, 0.7)},
        events=[cb.neimark_sacker(every=True)],
    )  # fmt: skip
    assert [point.kind for point in branch.special] == ["EP", "NS", "NS", "NS", "GR"]
    middles = [0.5 * (p["a"] + q["a"]) for p, q in pairwise(branch.special)]
    counts = [cb.symmetric(a, 0.11, 0.8, **model).stability().unstable for a in middles]
    assert counts == [2, 4, 2, 0]
    second = cb.boundary(branch.special[2], ("gamma", "a"), within={"gamma": (0.109, 0.111)})
    cb.save(tmp_path / "second.nc", second)
    for line in (second, cb.load(tmp_path / "second.nc")):
        assert all(abs(p.multipliers(half=True)).max() > 1.005**0.5 + 1e-5 for p in line)
        assert abs(line.curve.equations(line[-1].z)).max() < 1e-9
    for orbit in (cb.symmetric(0.6, 0.11, 0.8), cb.symmetric(0.6, 0.11, 0.8, lattice=cb.Ring(9))):
        with pytest.raises(cb.BadInput, match="every=True counts the multipliers of exact modes"):
            cb.trace(orbit, "a", events=[cb.neimark_sacker(every=True)])


@pytest.mark.slow
def test_damped_rings_without_springs_have_a_diagram_from_gamma_0_on() -> None:
    """At gamma = 0 idle sites rest anywhere: the pitchfork there does not begin its curve."""
    k, model = 0.7, {"lattice": cb.Ring(4), "damping": 0.02}
    window = {"gamma": (0.0, 0.002), "a": (0.68, 0.76)}
    drawn = cb.zones(k=k, **model, within=window, progress=False)
    (fork,) = drawn["PF"]
    assert fork["gamma"].min() == pytest.approx(1e-6)
    assert fork["gamma"].max() == 0.002
    for gamma, a in ((0.0005, 0.7), (0.0015, 0.75)):
        counted = cb.symmetric(a, gamma, k, **model).stability().unstable
        assert drawn.unstable(gamma, a) == counted == int(a > 0.72)


def test_pitchforks_without_coupling_are_refused_where_idle_sites_rest_anywhere() -> None:
    model = {"lattice": cb.Ring(3), "damping": 0.02, "progress": False}
    window = {"k": (0.7, 0.71), "a": (0.68, 0.76)}
    why = "gamma = 0: there PF cannot be traced, but up to gamma = 1e-06; take a point there"
    with pytest.raises(cb.BadInput, match=why):
        cb.zones(gamma=0.0, **model, within=window)
    on = {"lattice": cb.Ring(3), "damping": 0.02}
    bare, next_to = (
        cb.trace(cb.symmetric(0.7, gamma, 0.7, **on), "a", within=window) for gamma in (0.0, 1e-6)
    )
    for pair in (("gamma", "a"), ("k", "a")):
        with pytest.raises(cb.BadInput, match=why):
            cb.boundary(bare.first("PF"), pair)
        assert len(cb.boundary(next_to.first("PF"), pair, steps=cb.Steps(most=2))) > 1


def test_a_family_ends_at_the_fold_whatever_modes_are_unknowns() -> None:
    """Lower breathers next to their fold were taken for upper ones, and had a curve of NS."""
    light = cb.OpenChain(5, masses=[3, 0.5, 3, 0.5, 3])
    start = cb.symmetric(0.12, 0.1, 0.7, lattice=light, site=1, damping=0.02)
    assert start.representation.resonant
    within, steps = {"a": (0.1, 0.13)}, cb.Steps(largest=0.02)
    branch = cb.trace(start, "a", within=within, events=[cb.fold()], steps=steps)
    fold = branch.first("LP")
    others = [point for point in branch if point.label != "LP1"]
    families = [point.solution.representation.family for point in others]
    assert families == ["upper" if point["p"] > fold["p"] else "lower" for point in others]
    assert {*families} == {"upper", "lower"}


@pytest.mark.slow
def test_planes_of_k_go_up_to_where_the_hardest_site_loses_nothing() -> None:
    """They were refused, with a k that nobody gave."""
    lattice = cb.OpenChain(3, restitutions=[1.0, 0.9, 1.06])
    window = {"a": (0.2, 1.0), "k": (0.5, 0.999)}
    diagram = cb.zones(gamma=0.05, lattice=lattice, site=2, damping=0.02, within=window)
    highest = 0.999 / 1.06
    assert diagram["GR"][0]["k"].max() == pytest.approx(highest, abs=1e-12)
    assert diagram.box(window)[0][1] == pytest.approx(highest, abs=1e-12)


@pytest.mark.slow
def test_a_window_of_one_parameter_leaves_the_other_whole_at_another_frequency() -> None:
    """Pictures ended at gamma = 0.2499, which is for omega = 1."""
    diagram = cb.zones(k=0.8, omega=2.0, progress=False)
    whole, cut = diagram.box(), diagram.box({"a": (0.0, 3.0)})
    assert cut[0][1] == pytest.approx(4 * 0.2499) == whole[0][1]


@pytest.mark.slow
def test_curves_between_two_folds_that_no_amplitude_of_the_comb_hits_are_found() -> None:
    """At a fold the map is that of its coupling alone: where a pair has the threshold's modulus on
    one, it has on all of them, and a curve of NS sets out from each."""
    drive = cb.Symbolic("-cos(t) - 0.5*cos(3*t) + 0.3*sin(5*t)")
    chain, window = cb.OpenChain(4, drive=[0.2, 1.0, 0.1, 0.0]), {"gamma": (0.105, 0.107)}
    found = cb.zones(
        k=0.75, lattice=chain, site=1, damping=0.03, spring=0.1, forcing=drive,
        within=window | {"a": (0.06, 0.12)}, progress=False,
    )  # fmt: skip
    meetings = [p["a"] for fold in found["LP"] for p in fold.special if p.kind == "LP-NS"]
    ends = [p["a"] for curve in found["NS"] for p in curve.special if p.kind == "NS-LP"]
    assert len(meetings) == 3
    assert sorted(ends) == pytest.approx(sorted(meetings), rel=1e-9)
