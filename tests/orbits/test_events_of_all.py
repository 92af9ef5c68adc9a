"""The events of the front desk on every orbit, whichever way its motion is evaluated."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest

import contbreather as cb
from contbreather.orbits.constructors import asymmetric
from contbreather.orbits.orbit import Orbit, orbit_at

EVENTS: dict[str, Callable[[], cb.Event]] = {
    "LP": cb.fold,
    "PF": cb.pitchfork,
    "PD": cb.period_doubling,
    "NS": cb.neimark_sacker,
    "GR": cb.grazing,
}


def shot(**more) -> Orbit:
    return orbit_at(cb.shooting(cb.symmetric(0.66, 0.04, 0.8), **more))


@cache
def orbits() -> dict[str, tuple[Orbit, dict[str, float]]]:
    """Every representation, with where it meets each of its events on its branch in a."""
    ring, chain = cb.Ring(20), cb.symmetric(0.66, 0.04, 0.8)
    fork, ends = 0.777632425944, 0.930922112522
    arm_ends = 0.877386621676
    return {
        "closed form": (chain, {"PF": fork, "GR": ends}),
        "closed form, ring": (chain.on(ring), {"PF": fork, "GR": ends, "NS": 0.706501432}),
        "arm": (asymmetric(0.8, 0.04, 0.8), {"PF": fork, "GR": arm_ends}),
        "shot": (shot(sites=20), {"PF": fork, "GR": ends, "NS": 0.706501432}),
        "shot arm": (
            orbit_at(cb.shooting(asymmetric(0.8, 0.04, 0.8), sites=20)),
            {"GR": arm_ends, "NS": 0.814583477},
        ),
        "single oscillator": (
            orbit_at(cb.shooting(asymmetric(0.9, 0.0, 0.8, lattice=cb.Ring(1)))),
            {"PD": 0.925512006293},
        ),
        "multibreather": (
            cb.multibreather([0, 6], a=0.5, gamma=0.03, k=0.8, lattice=cb.Ring(12)),
            {},
        ),
    }


NAMES = ("closed form", "closed form, ring", "arm", "shot", "shot arm", "single oscillator")
HAS = {
    "closed form": ("LP", "PF", "NS", "GR"),
    "closed form, ring": ("LP", "PF", "NS", "GR"),
    "arm": ("LP", "PF", "PD", "NS", "GR"),
    "shot": ("LP", "PF", "NS", "GR"),
    "shot arm": ("LP", "PD", "NS", "GR"),
    "single oscillator": ("LP", "PD", "NS", "GR"),
    "multibreather": ("LP", "PF", "NS", "GR"),
}


@pytest.mark.parametrize("kind", EVENTS)
@pytest.mark.parametrize("name", HAS)
def test_an_event_can_be_asked_for_or_the_sentence_says_why_not(name: str, kind: str) -> None:
    orbit, _ = orbits()[name]
    near = {"a": (orbit.a - 1e-3, orbit.a + 1e-3)}
    if kind in HAS[name]:
        assert len(cb.trace(orbit, "a", events=[EVENTS[kind]()], within=near)) > 1
    else:
        with pytest.raises(cb.BadInput, match=rf"no {kind} of this problem .*symmetr"):
            cb.trace(orbit, "a", events=[EVENTS[kind]()], within=near)


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("PF", "only a symmetric orbit, known by half its period, has a pitchfork"),
        ("PD", "a symmetric orbit breaks its symmetry (PF) before it can double its period"),
        ("NS", "a complex pair is looked for in the map of an orbit"),
        ("GR", "only what moves between walls can graze them"),
    ],
)
def test_what_is_no_orbit_has_none_of_them(kind: str, words: str) -> None:
    line = cb.Problem(lambda x, p: x - p["mu"], {"x": 0.0}, {"mu": 0.0}, label="a line")
    with pytest.raises(cb.BadInput) as refused:
        cb.trace(line, "mu", events=[EVENTS[kind]()])
    assert str(refused.value) == f"no {kind} of this problem (a line, no events): {words}."


@pytest.mark.parametrize("name", NAMES)
def test_each_event_is_where_it_is_known_to_be(name: str) -> None:
    orbit, known = orbits()[name]
    for kind, place in known.items():
        down = kind == "PF" and "arm" in name
        found = cb.trace(
            orbit, "a", events=[EVENTS[kind]()], towards="down" if down else "up",
            within={"a": (0.66, 1.2)} if kind != "NS" or "arm" in name else {"a": (0.66, 0.9)},
        )  # fmt: skip
        assert found.first(kind)["a"] == pytest.approx(place, abs=2e-9 if kind == "NS" else 1e-10)


def test_grazing_and_pitchfork_are_followed_from_where_they_were_asked_for() -> None:
    """Of the symmetric breather and of the one that was shot: the same curves."""
    lines = []
    for start in (cb.symmetric(0.66, 0.04, 0.8, lattice=cb.Ring(20)), shot(sites=20)):
        branch = cb.trace(
            start, "a", towards="up", events=[cb.pitchfork(), cb.grazing()], within={"a": (0.6, 1)}
        )
        window = {"gamma": (0.03, 0.05), "a": (0.0, 1.5)}
        lines += [
            cb.boundary(branch.first(kind), ("gamma", "a"), within=window) for kind in ("PF", "GR")
        ]
    for one, other in ((lines[0], lines[2]), (lines[1], lines[3])):
        for end in (0, -1):
            assert one[end]["gamma"] == pytest.approx(other[end]["gamma"], abs=1e-12)
            assert one[end]["a"] == pytest.approx(other[end]["a"], abs=1e-10)


@pytest.mark.parametrize("name", ["closed form, ring", "shot", "shot arm"])
def test_another_threshold_has_its_own_point_and_column(name: str) -> None:
    orbit, _ = orbits()[name]
    event = cb.neimark_sacker(threshold=1.0048)
    branch = cb.trace(orbit, "a", events=[event], within={"a": (0.66, 0.9)})
    point = branch.first("NS")
    size = np.abs(point.solution.multipliers())
    assert np.abs(size - 1.0048).min() < 1e-9
    last = branch[-1]
    assert last["unstable"] == last.solution.stability(threshold=1.0048).unstable


def test_thresholds_and_other_lattices_are_for_those_that_have_them() -> None:
    chain, arm = cb.symmetric(0.66, 0.04, 0.8), orbits()["arm"][0]
    for orbit in (chain, arm):
        with pytest.raises(cb.BadInput, match=r"infinite chain has none.* on=Ring\(N\)"):
            cb.trace(orbit, "a", events=[cb.neimark_sacker(threshold=1.01)])
    with pytest.raises(cb.BadInput, match="of symmetric breathers of chain and ring only"):
        cb.trace(arm, "a", events=[cb.neimark_sacker(on=cb.Ring(20))])
    mine = cb.Problem(lambda x, p: x - p["mu"], {"x": 0.0}, {"mu": 0.0})
    with pytest.raises(cb.BadInput, match=r"no PD of this problem"):
        cb.trace(mine, "mu", events=[cb.period_doubling()], within={"mu": (-1, 1)})


def test_a_map_is_asked_for_its_own_doubling() -> None:
    logistic = cb.FixedPoint(lambda x, p: p["r"] * x * (1 - x), {"x": 0.6}, {"r": 2.5})
    branch = cb.trace(logistic, "r", events=[cb.period_doubling()], within={"r": (2.0, 3.4)})
    assert branch.first("PD")["r"] == pytest.approx(3.0, abs=1e-10)
