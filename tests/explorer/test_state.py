"""What the page says of curves and orbits is what the library says of them."""

from __future__ import annotations

import contbreather as cb
from contbreather.explorer import state

B = cb.symmetric(a=0.5, gamma=0.08, k=0.8)


def test_curves_are_named_by_what_not_all_of_them_share() -> None:
    window = {"a": (0.49, 0.51), "gamma": (0.07, 0.09)}
    curves = {
        f"branch{i}": cb.trace(orbit, free, within={free: window[free]})
        for i, (orbit, free) in enumerate([(B, "a"), (B.on(cb.Ring(12)), "a"), (B, "gamma")])
    }
    assert [*state.names(curves)] == [
        "branch0: in a, infinite chain, gamma = 0.08",
        "branch1: in a, ring of 12, gamma = 0.08",
        "branch2: in gamma, infinite chain, a = 0.5",
    ]
    del curves["branch2"]
    assert [*state.names(curves)] == ["branch0: infinite chain", "branch1: ring of 12"]
    del curves["branch1"]
    assert state.names(curves) == {"branch0": "branch0"}


def test_verdicts_are_those_of_the_library() -> None:
    said = dict(state.verdicts(B, 400))
    assert said["own lattice"] == B.stability().describe()
    assert said["ring of 400"] == B.stability(sites=400).describe()
    assert f"{B.stability().over_reflection.growth:.6g}/N" in said["over-reflection"]
    assert said["admissible"] == B.admissibility().reason


def test_nothing_is_said_of_the_stability_of_what_goes_through_a_wall() -> None:
    through = cb.symmetric(a=0.9, gamma=0.08, k=0.8, root=1)
    said = dict(state.verdicts(through, 400))
    assert said["not admissible"] == through.admissibility().reason
    assert said["stability"].startswith("nothing is said of it")
    assert len(said) == 2


def test_arms_are_described_by_their_impacts() -> None:
    arm = cb.switch(
        cb.trace(cb.symmetric(a=0.7, gamma=0.04, k=0.8), "a", within={"a": (0.7, 0.9)}).first("PF")
    )[0]
    names = [name for name, _ in arm[3].solution.table().rows]
    assert names == ["a", "gamma", "k", "t1", "impulse 1", "t2", "impulse 2", "c"]
    assert "over-reflection" not in dict(state.verdicts(arm[3].solution, 60))
