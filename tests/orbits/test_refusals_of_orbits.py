"""Seeds, sequences and questions that make no orbit: a sentence each; and those that just do."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import contbreather as cb
from contbreather.errors import BadInput
from contbreather.lattice import InfiniteChain, Ring
from contbreather.orbits.orbit import orbit_at, orbit_of

HERE: dict[str, Any] = {"a": 0.5, "gamma": 0.02, "k": 0.8}
BREATHER, ONE, TWO = cb.symmetric(**HERE), ((0, 1),), ((0, 1), (0, -1))


@pytest.fixture(scope="module")
def half():
    """A symmetric orbit shot over half its period."""
    return orbit_at(cb.shooting(cb.symmetric(**HERE), sites=6))


@pytest.fixture(scope="module")
def whole():
    """The same, shot over all of it."""
    return orbit_at(cb.shooting(cb.symmetric(**HERE), sites=6, symmetric=False))


# what is shot, the keywords besides those of HERE, and what is said; an orbit knows its own
SHOT: list[tuple[Any, dict[str, Any], str]] = [
    (BREATHER, {}, "lives on the infinite chain: say on which ring, sites=N"),
    (BREATHER, {"sites": 5, "lattice": Ring(6)}, r"sites = 5 and the ring of 6: give one of the"),
    ("whole", {"symmetric": True}, "was not shot as a symmetric one"),
    ({"t1": 0.1}, {"sites": 4}, "needs sites=... and sequence"),
    ({"t1": 0.1}, {"sequence": ONE}, "needs sites=... and sequence"),
    (
        {"t2": 0.1},
        {"sites": 4, "sequence": ONE},
        r"one time for each impact, \['t1'\]: missing \['t1'\], not known \['t2'\]",
    ),
    ({"t1": "x"}, {"sites": 4, "sequence": ONE}, "t1 = 'x': a time of impact"),
    (3.0, {"sites": 4}, "a seed is an orbit, .* float"),
    ("ab", {"sites": 4}, "a seed is an orbit, .* str"),
    (([0.1, 0.2], [0.1, 0.2]), {"sites": 3}, "the state has 2 sites, but sites = 3 was asked for"),
    ((["a"], [0.1]), {"sites": 1}, r"a state is a pair \(u, v\) of rows of numbers"),
    (([0.1, 0.2], [0.1]), {}, r"rows of equal length; shapes \(2,\) and \(1,\)"),
    (([0.1, 0.2], [0.1, 0.2]), {"gamma": None}, "this seed does not know gamma: give them by name"),
    (
        ([0.0], [0.0]),
        {"a": 1e-3, "gamma": 0.0},
        r"the seed meets no wall within a section of length 6\.28319 from t = 0: it flies free",
    ),
    *(
        (BREATHER, {"sites": 5, "period": period}, f"period = {period}: the forcing")
        for period in (5.0, math.inf, 0.0)
    ),
    (BREATHER, {"sites": 6, "period": None}, "period = None: .* a multiple of it"),
    (BREATHER.state(6), {"period": 1e300}, r"2 pi n .* up to 10000"),
    (
        {"t1": 0.1},
        {"sites": 4, "sequence": ONE, "symmetric": True, "period": 4 * math.pi},
        r"a symmetric orbit of period 4 pi: .* needs an odd n, .*; n = 2 was given",
    ),
    *(
        ({"t1": 0.1}, {"sites": 4, "sequence": bad}, words)
        for bad, words in (
            ((), "the sequence of impacts is empty"),
            ((1, 2), r"impacts are pairs \(site, wall\)"),
            (0.0, r"sequence = 0\.0: impacts are pairs \(site, wall\)"),
            (((4, 1),), "no such site on the ring of 4; sites are whole numbers from 0 to 3"),
            (((-4, 1),), "no such site on the ring of 4"),
            (((0.5, 1),), "sites are whole numbers"),
            (((True, 1),), "sites are whole numbers"),
            ((((2, 2), 1),), r"site \(2, 2\): .* of a grid has the number i columns \+ j"),
            ((("a", 1),), r"site 'a': .* a node of a graph its place among the nodes"),
            (((0, 2),), r"impact \(0, 2\): walls are \+1 and -1"),
            (((0, True),), r"impact \(0, True\): walls are \+1 and -1"),
            (ONE, r"hits the wall at \+1 only"),
        )
    ),
    *(
        (
            BREATHER,
            {"sites": 5, "walls": {site: (-1, 1)}},
            f"walls of site {site}: there is no such site on the ring of 5; sites are 0 to 4",
        )
        for site in (7, -5)
    ),
    (
        BREATHER,
        {"sites": 5, "walls": {0: (-1, None)}},
        "the walls are not symmetric|has no wall on that side",
    ),
    # meant for two sites, one by one
    (BREATHER, {"sites": 2, "walls": [1, 2]}, "the walls are not symmetric, low = 1 and high = 2:"),
    *(
        (
            BREATHER,
            {"sites": 6, "walls": {site: (None, 0.5)}},
            f"walls of site = {site!r}: a whole number",
        )
        for site in (1.7, "a", True)
    ),
    (BREATHER.state(6), {"t": "0"}, "t = '0': the time of a state, a finite number, was expected"),
    (([2.0] * 6, [0.0] * 6), {}, r"u\[0\] = 2 .*outside the walls"),
    *(
        ({"t1": -3.2, "t2": 0.4, **times}, {"a": 0.82, "sites": 20, "sequence": TWO, **more}, words)
        for times, more, words in (
            ({"t2": -4.0}, {}, r"impacts of site 0 out of order: t1 = -3\.2 does not"),
            ({"t2": 4.0}, {}, r"t2 = 4 does not come before t1 \+ a section = 3\.083"),
            ({"t2": math.nan}, {}, "a time of impact, a finite number"),
            ({}, {"a": -0.8}, "a = -0.8: the amplitude"),
            ({}, {"gamma": 0.3}, r"gamma = 0\.3"),
            ({}, {"k": 1.2}, r"k = 1\.2"),
        )
    ),
]


@pytest.mark.parametrize(("seed", "more", "sentence"), SHOT, ids=[row[-1][:50] for row in SHOT])
def test_what_makes_no_orbit_is_refused(seed: Any, more: dict, sentence: str, whole: Any) -> None:
    given = {} if seed == "whole" or isinstance(seed, cb.Orbit) else HERE
    with pytest.raises(BadInput, match=sentence):
        cb.shooting(whole if seed == "whole" else seed, **{**given, **more})


ON, COUPLED = {**HERE, "lattice": Ring(6)}, "has gamma = 0.02; an orbit of the single oscillator, "
WHOLE = "sites are whole numbers"
QUESTIONS: list[tuple[Callable[..., Any], str]] = [
    (lambda b, o, w: o.displacement(0.5, 0.0), f"n = 0.5: {WHOLE}"),
    (lambda b, o, w: b.displacement([[0, 1], [2]], 0.0), WHOLE),
    (lambda b, o, w: o.velocity(0, math.nan), "finite real numbers were expected"),
    (lambda b, o, w: b.state(6, t=[0.0, 1.0]), r"t = \[0\.0, 1\.0\]: a time, a finite number"),
    (lambda b, o, w: b.state(0), "sites = .*: a whole number, at least 1"),
    (lambda b, o, w: w.phi, "phi belongs to symmetric orbits with one impact in half a period"),
    (lambda b, o, w: w.multipliers(half=True), "not known by half its period: it has no half"),
    (lambda b, o, w: b.multipliers(), r"continuous spectrum; ask for multipliers\(sites=N\)"),
    *(
        (
            lambda b, o, w, given=given: o.stability(threshold=given),
            rf"threshold = {given}: .*, so a finite threshold above 1 is",
        )
        for given in (0.9, math.inf)
    ),
    # many sites
    *(
        (lambda b, o, w, of=of: cb.multibreather(of(b, o), **ON), words)
        for of, words in (
            (lambda b, o: 3, "3: a list of sites is expected, or a dict of sites and orbits"),
            (lambda b, o: [[0, 1], [2]], "a list of sites is expected, or a dict"),
            (lambda b, o: [], "name at least one site"),
            (lambda b, o: [2, 2], "name at least one site"),
            (lambda b, o: [9], "no such site"),
            (lambda b, o: {0: "middle"}, "site 0: 'middle' was given; 'upper', 'lower' or an orb"),
            (lambda b, o: {0: 1.5}, "'upper', 'lower' or an orbit"),
            (lambda b, o: {0: b}, f"{COUPLED}without coupling, is expected"),
            (lambda b, o: {0: o}, f"{COUPLED}without coupling, is expected"),
        )
    ),
    *(
        (
            lambda b, o, w, most=most: cb.multibreathers(Ring(4), most=most, **HERE),
            f"most = {most!r}: a whole number of sites, 1 to 4",
        )
        for most in (0, 5, 1.5, True, "2")
    ),
    *(
        (lambda b, o, w, given=given: o.on(given), r"InfiniteChain\(\) or Ring\(20\), say, is")
        for given in (None, 7, "ring", Ring, np.ones(2))
    ),
    (lambda b, o, w: b.on(InfiniteChain(0.2)), "springs to the ground belong to the motion"),
    (
        lambda b, o, w: cb.symmetric(**HERE, lattice=cb.OpenChain(9), site=6).on(cb.OpenChain(4)),
        r"impact \(6, 1\): no such site on the open chain with free ends, 4 sites",
    ),
    *(
        (lambda b, o, w, more=more: cb.symmetric(**HERE, **more), words)
        for more, words in (
            (
                {"lattice": Ring(6), "damping": np.ones(2)},
                r"damping = array\(\[1\., 1\.\]\) has shape \(2,\); .* for each of 6 sites",
            ),
            ({"site": []}, r"site = \[\].*site 0 impacts"),
        )
    ),
    (lambda b, o, w: orbit_of(None, o.section, [0.0], [-1.0]), "Conditions was expected, got None"),
    (
        lambda b, o, w: orbit_of(o.conditions, ((0, 1),), [0.0], [-1.0]),
        "a Section of impacts was expected, got a tuple",
    ),
    (
        lambda b, o, w: orbit_of(o.conditions, o.section, "0", [-1.0]),
        "times = '0': finite real numbers were expected",
    ),
]


@pytest.mark.parametrize(
    ("made", "sentence"), QUESTIONS, ids=[words[:50] for _, words in QUESTIONS]
)
def test_it_is_refused_in_a_sentence(made, sentence, half, whole):
    with pytest.raises(BadInput, match=sentence):
        made(BREATHER, half, whole)


# --- and what is none of that ---------------------------------------------------------------------


def test_a_sequence_that_the_orbit_has_is_taken(half: Any, whole: Any) -> None:
    for orbit, sequence in ((half, ((0, 1),)), (whole, ((0, 1), (0, -1)))):
        again = orbit_at(cb.shooting(orbit, sequence=sequence))
        assert again.section.impacts == sequence
        assert again.times == pytest.approx(orbit.times, abs=1e-10)


def test_a_symmetric_orbit_is_opened_up(half: Any, whole: Any) -> None:
    opened = orbit_at(cb.shooting(half, symmetric=False))
    assert not opened.symmetric
    assert opened.section.impacts == whole.section.impacts
    assert opened.times == pytest.approx(whole.times, abs=1e-9)
    again = orbit_at(cb.shooting(opened, symmetric=False))  # nothing left to open
    assert again.times == pytest.approx(whole.times, abs=1e-9)


def test_a_breather_is_shot_by_another_listing_of_its_impacts() -> None:
    b = cb.symmetric(**HERE)
    other = orbit_at(cb.shooting(b, sites=6, symmetric=False, sequence=((0, -1), (0, 1))))
    assert other.section.impacts == ((0, -1), (0, 1))
    assert sorted(other.times % (2 * math.pi)) == pytest.approx(
        sorted([b.phi % (2 * math.pi), (b.phi + math.pi) % (2 * math.pi)]), abs=1e-3
    )


def test_a_breather_is_taken_to_a_lattice_it_does_not_know(half: Any) -> None:
    b = cb.symmetric(**HERE)
    open_chain = cb.OpenChain(5)
    taken = orbit_at(cb.shooting(b, lattice=open_chain, sequence=((2, 1),)))
    assert taken.section.impacts == ((2, 1),)
    assert taken.phi == pytest.approx(b.phi, abs=1e-2)
    with pytest.raises(BadInput, match=r"the seed has 1 impacts in a section, the sequence .* 2"):
        cb.shooting(b, lattice=open_chain, sequence=((2, 1), (2, -1)))


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"k": 1.5}, r"^k = 1\.5: the restitution coefficient must be a number with 0 <= k <= 1"),
        ({"gamma": 0.3}, r"^gamma = 0\.3: the coupling must be"),
        ({"a": -1.0}, r"^a = -1\.0: the amplitude of the forcing must be a finite number > 0"),
        ({"a": 0.0}, r"^a = 0\.0: the amplitude"),
        ({"k": 0.0}, r"^k = 0: zones need 0 < k < 1"),
        ({"k": 1.0}, r"^k = 1: zones need 0 < k < 1"),
        # all of several before any is drawn, however they are listed
        ({"k": iter([0.8, 1.0]), "lattice": 3}, r"^k = 1: zones need 0 < k < 1"),
        ({}, r"zones need exactly one of k, gamma and a fixed, got none"),
        (
            {"k": 0.8, "gamma": 0.05, "a": 0.5},
            r"zones need exactly one of k, gamma and a fixed, got",
        ),
        ({"k": 0.8, "gamma": 0.05, "omega": 1.2}, r"zones\(k=0\.8, gamma=0\.05\), without omega="),
        (
            {"k": 0.8, "gamma": 0.09, "within": {"omega": (0.3, 0.5)}},
            r"harmonic 1 of the drive, 0\.5, is in the band of the lattice, 0 to 0\.6;",
        ),
        ({"k": []}, r"zones need a value of k, or several; got none"),
        ({"k": 0.8, "within": {"k": (0.1, 0.2)}}, r"no window for 'k': the plane is that of"),
        *(
            ({"k": 0.8, **more}, "name a lattice|take a ring or another finite lattice")
            for more in ({"damping": 0.1}, {"spring": 0.1}, {"site": 1}, {"walls": (-2, 2)})
        ),
        (
            {"k": 0.8, "lattice": Ring(6), "damping": 0.1, "past_folds": True},
            "past_folds: lower breathers",
        ),
        ({"k": 0.8, "lattice": cb.OpenChain(3), "site": 3}, "no such site"),
        ({"k": 0.8, "lattice": cb.OpenChain(3), "walls": (-1, 2)}, "the walls are not symmetric"),
    ],
)
def test_zones_of_what_cannot_be_are_refused(given: dict[str, Any], words: str) -> None:
    with pytest.raises(BadInput, match=words):
        cb.zones(**given)
