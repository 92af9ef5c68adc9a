"""What the package has built comes back from a file with its equations, from numbers and names."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import contbreather as cb
from contbreather.continuation.branches.diagram import Diagram
from contbreather.continuation.walk.checkpoint import branch_to_dict
from contbreather.lattice.conditions import Conditions, Walls, spring_response
from contbreather.orbits.constructors import asymmetric
from contbreather.storage import netcdf
from contbreather.storage.serialise import from_dict, to_dict

EVIL = {"kind": "formula", "formula": "__import__('os').abort()", "values": {}}
AROUND = {"a": (0.74, 0.84)}  # the pitchfork of the case below is at 0.7776
SHORT = cb.Steps(largest=0.05)


def symmetric(**more: Any) -> cb.Orbit:
    return cb.symmetric(0.76, 0.04, 0.8, **more)


def formula() -> cb.Branch:
    forcing = cb.Symbolic("-cos(t) - c*cos(3*t)", c=0.1)
    start = cb.symmetric(0.5, 0.05, 0.8, forcing=forcing)
    return cb.trace(start, "c", within={"c": (0.05, 0.15)}, steps=SHORT)


def sprung_chain() -> cb.Branch:
    start = cb.symmetric(0.5, 0.05, 0.8, spring=0.0)
    return cb.trace(start, "spring", within={"spring": (0.0, 0.05)}, steps=SHORT)


def asked_for() -> cb.Branch:
    """On a ring, with the paper's rule and a level looked for."""
    events = [cb.neimark_sacker(threshold=1.01), cb.user("p", 1.0), cb.pitchfork()]
    return cb.trace(symmetric().on(cb.Ring(20)), "a", within={"a": (0.6, 0.84)}, events=events)


def open_chain() -> cb.Branch:
    walls = {0: (-1.0, 1.0), 3: (None, 1.5)}
    held_chain = {"lattice": cb.OpenChain(5), "site": 0, "damping": 0.01, "spring": 0.2}
    start = cb.symmetric(0.6, 0.05, 0.8, **held_chain)
    shot = cb.shooting(start, symmetric=False, walls=walls)
    return cb.trace(shot, "damping", within={"damping": (0.0, 0.02)}, steps=SHORT)


def multibreather() -> cb.Branch:
    two = cb.multibreather([0, 6], a=0.5, gamma=0.03, k=0.8, lattice=cb.Ring(12))
    return cb.trace(two, "a", within={"a": (0.48, 0.52)})


def doubled() -> cb.Branch:
    arm = asymmetric(0.9, 0.0, 0.8, lattice=cb.Ring(1))
    branch = cb.trace(arm, "a", towards="up", within={"a": (0.9, 0.93)})
    return cb.switch(branch.first("PD"), within={"a": (0.92, 0.935)})[0]


def waves() -> cb.Branch:
    twice = symmetric().unfolded().doubled()
    return cb.trace(twice, "a", within={"a": (0.75, 0.77)}, events=())


BRANCHES: dict[str, Callable[[], cb.Branch]] = {
    "closed form": lambda: cb.trace(symmetric(), "a", within=AROUND),
    "ring": lambda: cb.trace(symmetric(lattice=cb.Ring(12)), "a", within=AROUND),
    "beyond walls": lambda: cb.trace(
        symmetric(), "a", within={"a": (0.7, 1.0)}, inadmissible=True, steps=SHORT
    ),
    "asked for": asked_for,
    "formula": formula,
    "spring": sprung_chain,
    "shooting": lambda: cb.trace(cb.shooting(symmetric(), sites=8), "a", within=AROUND),
    "walls": open_chain,
    "multibreather": multibreather,
    "doubled": doubled,
    "waves": waves,
    "even drive": lambda: cb.trace(
        cb.shooting(symmetric(lattice=cb.Ring(3)), symmetric=False,
                    forcing=cb.Fourier(cos={0: 0.002, 1: -1.0, 2: 0.01})),
        "c0", within={"c0": (0.0, 0.004)}, steps=SHORT,
    ),
    "frequency": lambda: cb.trace(symmetric(), "omega", within={"omega": (0.97, 1.03)}),
    "each site": lambda: cb.trace(
        cb.symmetric(0.4, 0.05, 0.6, lattice=cb.OpenChain(3), spring=[0.1, 0.3, 0.2],
                     damping=[0.02, 0.01, 0.03]), "a", within={"a": (0.35, 0.45)}
    ),
}  # fmt: skip


def same(one: Any, other: Any) -> None:
    """Bit by bit, and by what was found at each point."""
    assert repr(one) == repr(other)
    for name in one.names:
        assert np.array_equal(one[name], other[name], equal_nan=True)
    for before, after in zip(one, other, strict=True):
        assert np.array_equal(before.z, after.z)
        assert np.array_equal(before.tangent, after.tangent)
        assert (before.event is None) == (after.event is None)
        assert before.event is None or before.event.kind == after.event.kind
    middle = len(one) // 2
    assert repr(one[middle].solution) == repr(other[middle].solution)


@pytest.mark.parametrize("name", BRANCHES)
def test_branch_comes_back_with_its_equations(name: str, tmp_path: Path) -> None:
    branch = BRANCHES[name]()
    cb.save(tmp_path / "run.nc", branch)
    again = cb.load(tmp_path / "run.nc")
    same(branch, again)
    assert again.settings.within == branch.settings.within
    low, high = branch[branch.free].min(), branch[branch.free].max()
    free, inside = branch.free, {branch.free: (low, high)}
    start = again[len(again) // 2]
    one, other = (
        cb.trace(point, free, within=inside, events=(), steps=SHORT)
        for point in (branch[len(branch) // 2], start)
    )
    assert np.array_equal(one[free], other[free])


@pytest.fixture(scope="module")
def branch() -> cb.Branch:
    return cb.trace(symmetric(), "a", within=AROUND)


@pytest.fixture(scope="module")
def line(branch: cb.Branch) -> cb.Branch:
    return cb.boundary(branch.first("PF"), ("gamma", "a"), within={"gamma": (0.03, 0.05)})


def test_work_goes_on_from_any_label_of_a_folder(branch, line, tmp_path):
    run = cb.Run(tmp_path / "study")
    run.keep(symmetric=branch, pitchforks=line)
    found = cb.load(tmp_path / "study")
    assert sorted(found) == ["pitchforks", "symmetric"]
    arms = cb.switch(branch.first("PF"), within=AROUND)
    again = cb.switch(found["PF1"], within=AROUND)
    for one, other in zip(arms, again, strict=True):
        same(one, other)
    same(line, cb.boundary(found["PF1"], ("gamma", "a"), within={"gamma": (0.03, 0.05)}))
    crossed = cb.trace(found["pitchforks"][2], "a", within=AROUND)
    there = found["pitchforks"][2]
    assert crossed.first("PF")["a"] == pytest.approx(there["a"], abs=1e-12)
    assert crossed.origin is there


def test_arm_comes_back_with_the_point_it_left(branch: cb.Branch, tmp_path: Path) -> None:
    arm = cb.switch(branch.first("PF"), within=AROUND)[1]
    cb.save(tmp_path / "arm.nc", arm)
    again = cb.load(tmp_path / "arm.nc")
    same(arm, again)
    assert (again[0].parent.label, again[0].parent.event.kind) == ("PF1", "PF")
    assert again[0].parent is again.origin
    same(arm, cb.switch(again.origin, within=AROUND)[1])


def test_a_branch_with_a_mode_among_its_unknowns_comes_back_from_where_there_is_none(
    tmp_path: Path,
) -> None:
    chain = cb.OpenChain(4, ends="fixed")
    held = cb.symmetric(0.5, 0.05, 0.8, damping=0.03, spring=0.1, lattice=chain, site=1)
    branch = cb.trace(held, "gamma", within={"gamma": (0.0, 0.06)})
    assert "modes" in branch.problem.start  # and not at gamma = 0, where it begins
    cb.save(tmp_path / "held.nc", branch)
    kept = cb.load(tmp_path / "held.nc")
    assert kept[0]["gamma"] == 0.0
    assert (kept.points.z == branch.points.z).all()
    assert kept[3].solution.p == branch[3].solution.p


def test_boundary_goes_on_from_a_file(line: cb.Branch, tmp_path: Path) -> None:
    cb.save(tmp_path / "line.nc", line)
    again = cb.load(tmp_path / "line.nc")
    same(line, again)
    assert again.origin["a"] == line.origin["a"]
    longer, wanted = (cb.extend(one, within={"gamma": (0.01, 0.1)}) for one in (again, line))
    same(wanted, longer)
    assert [point.kind for point in longer.special] == ["EP", "PF-GR"]
    assert len(longer) > len(line)


def test_extended_branch_is_the_one_that_was_walked_further(branch: cb.Branch, tmp_path: Path):
    cb.save(tmp_path / "short.nc", branch)
    longer = cb.extend(cb.load(tmp_path / "short.nc"), within={"a": (0.6, 1.0)})
    whole = cb.trace(symmetric(), "a", within={"a": (0.6, 1.0)})
    assert [p.kind for p in longer.special] == [p.kind for p in whole.special]
    for one, other in zip(longer.special, whole.special, strict=True):
        assert one["a"] == pytest.approx(other["a"], abs=1e-12)
    assert (np.diff(longer["arclength"]) > 0).all()
    last = cb.extend(branch, end="last", within={"a": (0.6, 1.0)})
    assert (last["a"].min(), last.stop) == (AROUND["a"][0], cb.continuation.Stop.EVENT)


def test_ends_go_on_one_after_the_other_in_the_same_wider_window(branch: cb.Branch) -> None:
    wide = {"a": (0.7, 0.85)}
    first = cb.extend(branch, end="first", within=wide)
    both = cb.extend(first, end="last")
    assert both["a"][[0, -1]] == pytest.approx([0.7, 0.85], abs=1e-12)
    with pytest.raises(cb.BadInput, match=r"edge of its window, a in \(0\.7, 0\.85\)"):
        cb.extend(both)


def test_what_cannot_go_on_says_why_at_both_ends(branch: cb.Branch) -> None:
    wide = cb.trace(symmetric(), "a", towards="up")
    for call, sentence in (
        (lambda: cb.extend(branch), r"last point it is at the edge of its window, a in \(0\.74, 0"),
        (lambda: cb.extend(wide, end="last"), "nothing to follow beyond the event"),
        (lambda: cb.extend(branch, end="up"), "'both', 'last' or 'first', got 'up'"),
        (lambda: cb.extend(branch[3]), "a Branch is expected|Branch"),
    ):
        with pytest.raises(cb.BadInput, match=sentence):
            call()


def test_zones_come_back_whole(tmp_path: Path) -> None:
    zones = cb.zones(k=0.8, within={"gamma": (0.02, 0.06), "a": (0.5, 1.2)}, progress=False)
    cb.save(tmp_path / "zones.nc", zones)
    again = cb.load(tmp_path / "zones.nc")
    assert repr(again) == repr(zones)
    for (kind, one), (other_kind, other) in zip(zones, again, strict=True):
        assert kind == other_kind
        same(one, other)
    assert [p.label for p in again.special] == [p.label for p in zones.special]


def test_diagram_comes_back_with_its_tree(tmp_path: Path) -> None:
    tree = cb.diagram(symmetric(), "a", within=AROUND, depth=1, save=tmp_path / "tree.nc")
    again = cb.load(tmp_path / "tree.nc")
    assert isinstance(again, Diagram)
    assert again.describe() == tree.describe()
    assert [p.label for p in again.special] == [p.label for p in tree.special]
    assert sorted(map(str, again.graph.edges)) == sorted(map(str, tree.graph.edges))
    assert again[1][0].parent is again[0].first("PF")
    for one, other in zip(tree, again, strict=True):
        same(one, other)


VALUES = (
    cb.Harmonic(), cb.Fourier(cos={1: -1.0, 3: 0.1 / 3}, sin={5: 1e-7}),
    cb.Symbolic("-cos(t)/(1 + e*cos(2*t))", e=0.1), spring_response(cb.Fourier(sin={1: 1.0}), 0.3),
    cb.Samples(-np.cos(2 * np.pi * np.arange(16) / 16)), cb.InfiniteChain(0.1), cb.Ring(7),
    cb.Grid(2, 3, periodic=True),
    cb.Lattice([[2.0, -1 / 3], [-1 / 3, 1.0]], [1.0, 2.0], [0.5, 1.0]),
    Walls.given({2: (None, 0.8)}), Walls.given((-2.0, None)),
    Conditions(0.1, 0.2, 0.3, 0.4, 0.5, cb.Fourier(cos={3: 1.0}), lattice=cb.OpenChain(3)),
)  # fmt: skip


@pytest.mark.parametrize("value", VALUES, ids=str)
def test_values_are_the_same_after_json(value: Any) -> None:
    assert from_dict(json.loads(json.dumps(to_dict(value), allow_nan=False))) == value


class Mine(cb.Harmonic):
    """Somebody's own forcing."""


def test_equations_of_somebody_s_own_ask_for_the_problem(tmp_path: Path) -> None:
    start = cb.symmetric(0.5, 0.05, 0.8, forcing=Mine())
    branch = cb.trace(start, "a", within={"a": (0.45, 0.55)}, events=())
    cb.save(tmp_path / "own.nc", branch)
    bare = cb.load(tmp_path / "own.nc")
    assert np.array_equal(bare["unstable"], branch["unstable"])
    with pytest.raises(cb.BadInput, match="was loaded without its equations; load"):
        cb.trace(bare[3], "a")
    again = cb.load(tmp_path / "own.nc", problem=start)
    same(branch, again)


def test_breather_of_another_forcing_is_refused(branch: cb.Branch, tmp_path: Path) -> None:
    cb.save(tmp_path / "run.nc", branch)
    other = cb.symmetric(0.76, 0.04, 0.8, forcing=cb.Symbolic("-cos(t) - 0.1*cos(3*t)"))
    with pytest.raises(cb.BadInput, match=r"run\.nc: the points of the file do not solve this"):
        cb.load(tmp_path / "run.nc", problem=other)
    with pytest.raises(cb.BadInput, match="a Problem was expected"):
        cb.load(tmp_path / "run.nc", problem=3)  # type: ignore[call-overload, arg-type, unused-ignore]


@pytest.mark.parametrize(
    ("equations", "sentence"),
    [
        ({"kind": "symmetric breather", "forcing": EVIL}, "which no formula may"),
        (
            {"kind": "symmetric breather", "forcing": {"kind": "os.system"}},
            "is of no kind that is known here",
        ),
        ({"kind": "symmetric breather"}, "cannot be made again"),
    ],
)
def test_nothing_in_a_file_is_executed(branch, tmp_path, equations, sentence):
    """A formula that calls, and a kind that is the name of a function."""
    content = branch_to_dict(branch) | {"equations": equations}
    netcdf.write_file(tmp_path / "evil.nc", {"evil": content}, alone=True)
    with pytest.raises(cb.BadInput, match=sentence):
        cb.load(tmp_path / "evil.nc")
