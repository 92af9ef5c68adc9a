"""What an orbit is asked to be: its impacts, its turns and its sign; and its other descriptions."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import contbreather as cb
from contbreather.errors import BadInput
from contbreather.orbits.constructors import asymmetric
from contbreather.orbits.orbit import orbit_at
from contbreather.orbits.section import Section
from contbreather.orbits.symmetries import images_of, simpler_than

HERE: dict[str, Any] = {"a": 0.5, "gamma": 0.02, "k": 0.8}
TWO = ((0, 1), (0, -1))


# --- sections -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("impacts", "turns", "sign", "length", "period", "local", "two"),
    [
        (TWO, 1, 1, 2 * math.pi, 2 * math.pi, True, True),
        (((0, -1), (0, 1)), 2, 1, 4 * math.pi, 4 * math.pi, True, False),
        (TWO, 3, -1, 3 * math.pi, 6 * math.pi, True, False),
        (((0, 1), (3, 1), (0, -1)), 1, -1, math.pi, 2 * math.pi, False, False),
    ],
)
def test_a_section_knows_how_long_it_is_and_who_hits(
    impacts, turns, sign, length, period, local, two
) -> None:
    own = Section(impacts, turns, sign)
    assert (own.length, own.period) == pytest.approx((length, period))
    assert own.symmetric == (sign < 0)
    assert own.count == len(impacts)
    assert own.hit == tuple(sorted({n for n, _ in impacts}))
    assert (own.local, own.two_impacts) == (local, two)


def test_half_a_symmetric_section_is_unfolded_upside_down() -> None:
    half = Section(((0, 1), (2, -1)), 3, -1)
    assert half.unfolded() == Section(((0, 1), (2, -1), (0, -1), (2, 1)), 3)
    whole = Section(TWO)
    assert whole.unfolded() is whole
    assert whole.doubled() == Section(TWO * 2, 2)
    with pytest.raises(BadInput, match="a symmetric orbit does not double its period; break its"):
        half.doubled()


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ((TWO, 0), r"turns = 0: periods are 2 pi n with a whole n >= 1"),
        ((TWO, -1), r"turns = -1: periods are"),
        ((TWO, 1.0), r"turns = 1\.0: periods are"),
        ((TWO, True), r"turns = True: periods are"),
        ((TWO, 1, 0), r"sign must be 1 or -1, got 0"),
        ((TWO, 1, 2), r"sign must be 1 or -1, got 2"),
    ],
)
def test_sections_that_cannot_be_are_refused(given, words) -> None:
    with pytest.raises(BadInput, match=words):
        Section(*given)


def test_sites_of_a_section_are_looked_up_on_its_lattice() -> None:
    own = Section(((-1, 1), (2, -1)))
    assert own.placed(cb.Ring(5)).impacts == ((4, 1), (2, -1))
    assert own.placed(cb.InfiniteChain()) is own
    assert Section(((4, 1),)).placed(cb.Ring(5)).impacts == ((4, 1),)
    assert Section(((-4, 1),)).placed(cb.Ring(5)).impacts == ((1, 1),)


# --- other descriptions of an orbit ---------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("lattice", [cb.Ring(9), cb.Grid(4, 4)], ids=repr)
def test_mirror_images_of_arms_of_several_sites_are_recognised(lattice) -> None:
    two = cb.multibreather([0, 3], a=0.7, gamma=0.02, k=0.8, lattice=lattice, damping=0.01)
    tree = cb.diagram(two, "a", within={"a": (0.7, 0.76)}, depth=1)
    assert [birth.image_of for birth in tree.births] == [None, None, 1, None, 3]
    one, other = (tree[i][-1].solution for i in (1, 2))
    t = np.linspace(0.0, 6.0, 7)
    for n in (0, 3, 5):
        assert other.displacement(n, t) == pytest.approx(
            -one.displacement(n, t + math.pi), abs=1e-7
        )


def test_sites_that_are_alike_are_exchanged_and_others_are_not() -> None:
    for sites, lattice, walls, wanted in (
        ([0, 3], cb.Ring(9), None, 1),
        ([0, 3, 6], cb.Ring(9), None, 5),
        ([0, 8], cb.OpenChain(9), None, 1),
        ([0, 8], cb.OpenChain(9), {8: (-1.01, 1.01)}, 0),
        ([0, 8], cb.OpenChain(9), {1: (-1.01, 1.01)}, 0),  # ends one arm before its image
        ([0, 3], cb.OpenChain(9), None, 0),
        ([0, 8], cb.Lattice(np.diag([1.0] * 8, 1) @ np.diag([-1.0] * 9) + np.diag([-1.0] * 8, -1)
         + np.diag([1.0, *[2.0] * 7, 1.0]), masses=[2.0, *[1.0] * 8]), None, 0),
    ):  # fmt: skip
        orbit = cb.multibreather(sites, a=0.6, gamma=0.02, k=0.8, lattice=lattice, walls=walls)
        images = list(images_of(orbit))
        assert len(images) == wanted
        for image in images:  # a symmetric orbit of equal sites is its own
            assert image.representation.x == pytest.approx(orbit.representation.x, abs=1e-9)
        whole = 2 * (wanted + 1) - 1
        assert len(list(images_of(orbit.unfolded()))) == whole


def test_sites_of_the_infinite_chain_are_exchanged_with_their_offsets() -> None:
    two = cb.multibreather([0, 3], a=0.6, gamma=0.02, k=0.8, lattice=cb.Ring(20))
    chain = two.unfolded().on(cb.InfiniteChain())
    how = {"within": {"a": (0.6, 0.9)}, "events": [cb.branch_point()]}
    fork = cb.trace(chain, "a", **how).first("BP")
    arm = cb.switch(fork, **how)[0][-1].solution
    assert abs(np.subtract(*arm.offsets)) < 1e-9 < abs(arm.offsets[0])
    images = list(images_of(arm))
    assert len(images) == 3
    assert max(image.residual for image in images) < 1e-12


def test_half_a_symmetric_orbit_is_its_own_image() -> None:
    half = orbit_at(cb.shooting(cb.symmetric(**HERE), sites=6))
    assert list(images_of(half)) == []
    assert simpler_than(half) is None


@pytest.mark.parametrize("parts", [2, 3])
def test_a_symmetric_orbit_written_several_times_is_known_as_once(parts: int) -> None:
    b = cb.symmetric(**HERE)
    times = {f"t{j + 1}": b.phi + j * math.pi for j in range(2 * parts)}
    long = orbit_at(
        cb.shooting(times, sites=4, sequence=TWO * parts, period=2 * math.pi * parts, **HERE)
    )
    simple = simpler_than(long)
    assert simple is not None
    assert simple.section.turns == 1
    assert simple.times == pytest.approx(long.times[:2], abs=1e-7)
    half = simpler_than(simple)
    assert half is not None
    assert half.symmetric
    assert half.times == pytest.approx(long.times[:1], abs=1e-7)
    assert len(list(images_of(long))) == 2 * parts - 1

    def by_problem(orbit: cb.Orbit) -> Any:
        point = cb.trace(orbit, "a", within={"a": (0.49, 0.51)}, events=())[0]
        return point.curve.problem.simpler(point)

    assert not orbit_at(by_problem(long)).symmetric
    assert orbit_at(by_problem(long)).period == pytest.approx(2 * math.pi)
    assert orbit_at(by_problem(simple)).symmetric
    assert by_problem(half) is None


def test_an_arm_written_over_twice_its_period_is_known_for_its_half() -> None:
    once = asymmetric(0.82, 0.04, 0.8)
    half = simpler_than(once.doubled())
    assert half is not None
    assert half.section == once.section
    for one, other in zip(half.impacts, once.impacts, strict=True):
        assert one == pytest.approx(other, abs=1e-15)
    assert simpler_than(once) is None


@pytest.mark.slow
def test_arms_of_arms_are_known_as_images_however_short_their_first_steps_are() -> None:
    """That of the second one is 5e-6 long: so close to the branch point Newton's iteration finds
    the place on the first one, its image, to a thousandth of that."""
    seed = {"t1": -2.9, "t2": -2.9}
    on = {"a": 0.6, "gamma": 0.01, "k": 0.8, "damping": 0.01}
    start = cb.shooting(seed, sites=9, sequence=((0, 1), (3, 1)), symmetric=True, **on)
    tree = cb.diagram(start, "a", within={"a": (0.6, 0.8)}, depth=2)
    births = [(birth.depth, birth.image_of) for birth in tree.births]
    assert births == [(0, None), (1, None), (1, 1), (1, None), (1, 3), (2, None), (2, 5)]
