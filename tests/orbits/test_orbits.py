"""Orbits with any impacts: a closed form, exact simulation, differences."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from itertools import product

import numpy as np
import pytest

from contbreather.continuation import trace
from contbreather.errors import BadInput, NotConverged
from contbreather.lattice import Fourier, InfiniteChain, Ring
from contbreather.lattice.conditions import Conditions
from contbreather.orbits import symmetric
from contbreather.orbits.branch_switching import lift
from contbreather.orbits.by_impacts import ByImpacts, impact_problem
from contbreather.orbits.constructors import asymmetric, shooting
from contbreather.orbits.orbit import Orbit, orbit_at, orbit_of
from contbreather.orbits.section import Section
from contbreather.orbits.symmetries import images_of, shifted, simpler_than

from .by_hand import in_phase, orbit_from, two_impacts

TWO = Section(((0, 1), (0, -1)))
RICH = Fourier(cos={1: -1.0, 3: 0.4}, sin={1: 0.2, 5: -0.3})


ON_CHAIN = [(None, *row) for row in product([0.0, 0.04, 0.2], [0.2, 0.95], [0.02, 0.3, 0.8])]
ON_RINGS = [(sites, 0.04, 0.8, d) for sites in (7, 12, 20, 60) for d in (0.2, 0.3)]


@pytest.mark.parametrize(("sites", "gamma", "k", "d"), [*ON_CHAIN, *ON_RINGS])
def test_two_impacts_are_the_closed_form_of_asymmetric_breathers(sites, gamma, k, d):
    """The shorter flight, pi - 2d, is centred at t_m; the solver starts well off and knows no d."""
    exact, lattice = two_impacts(d, gamma, k, sites), Ring(sites) if sites else InfiniteChain()
    p, a, t_m, c = (float(getattr(exact, name)) for name in ("p", "a", "middle", "c"))
    t1 = t_m - (math.pi / 2 - d)  # from the wall +1: what the longer one begins at is -1
    off = 1e-2 * d  # closer to the pitchfork the symmetric solution is closer, too
    guess = orbit_of(
        Conditions(a, gamma, k, lattice=lattice),
        TWO,
        [t1 + off, t1 + math.pi - 2 * d - off],
        [-2.02 * p, 2.02 * p],
        [-0.98 * c],
    )
    orbit = orbit_at(impact_problem(guess).solve(tolerance=1e-11)[0])
    close = 1e-12 if sites else 1e-10
    assert orbit.p == pytest.approx(p, abs=0.1 * close if sites else close)
    assert orbit.c == pytest.approx(-c, abs=0.1 * close if sites else close)
    assert orbit.asymmetry == pytest.approx(-2 * d, abs=close)
    assert orbit.impacts[0].time == pytest.approx(t1, abs=close)
    assert sites is None or orbit.residual < 1e-14


def test_mean_impulses_tilt_the_chain_between_two_sites():
    """Two sites with net impulses of opposite sign pull the chain into a straight line between."""
    impacts = [(0, 1, 0.0, -1.0), (0, -1, 3.0, 1.2), (3, 1, 0.5, -1.2), (3, -1, 3.5, 1.0)]
    tilt = 3 * 0.2 / (2 * math.pi * 0.1)
    orbit = orbit_from(impacts, (tilt, 0.0), a=0.3, gamma=0.1)
    flight = orbit.representation
    assert np.abs(flight.equations.residual(flight.x, orbit.conditions.params)[8:]).max() < 1e-14
    assert orbit.motion.offset([-5, 0, 1, 2, 3, 9]) == pytest.approx(
        [tilt, tilt, tilt * 2 / 3, tilt / 3, 0, 0]
    )


@cache
def each_road() -> list[Orbit]:
    """Half and whole sections, one site and two, with damping and walls of all kinds."""
    on = {"a": 0.7, "gamma": 0.05, "k": 0.7}
    still = {"damping": 0.05, "spring": 0.2}
    return [
        symmetric(**on),
        symmetric(**on, lattice=Ring(5)).unfolded(),
        asymmetric(0.82, 0.04, 0.8),
        asymmetric(0.82, 0.04, 0.8).doubled(),
        symmetric(**on, **still, lattice=Ring(5), walls=(-1.2, 1.2)),
        orbit_at(shooting(asymmetric(0.82, 0.04, 0.8), sites=4)),
        orbit_at(shooting({"t1": -2.9, "t2": -2.9}, lattice=Ring(6), sequence=[(0, 1), (3, 1)],
                          symmetric=True, **on, **still)),
        orbit_at(shooting({"t1": 1.0}, lattice=Ring(1), sequence=[(0, 1)], walls={0: (None, 0.58)},
                          a=0.717, gamma=0.0, k=0.5, damping=0.02, spring=2.0)),
    ]  # fmt: skip


@pytest.mark.parametrize("which", range(8))
def test_at_an_impact_the_motion_is_the_one_just_after_it_in_any_period(which: int) -> None:
    orbit = each_road()[which]
    k = orbit.k
    for hit in orbit.hits:
        wall = orbit.walls.position(hit.site, hit.wall)
        assert hit.after == pytest.approx(-k * hit.before, rel=1e-12)
        assert hit.wall * hit.before > 0.0
        for turn in (*range(-7, 8), -1000, 1000):
            t = hit.time + turn * orbit.period
            rounded = 1e-12 * (1 + abs(turn))
            for same in (t, np.nextafter(t, -np.inf)):  # within rounding of it
                after = orbit.velocity(hit.site, same)
                assert isinstance(after, float)
                assert after == pytest.approx(hit.after, abs=1e-11 + rounded)
                bend = orbit.acceleration(hit.site, same)
                assert bend == pytest.approx(hit.acceleration, abs=1e-9)
                if isinstance(orbit.representation, ByImpacts):
                    one = orbit.motion.at(hit.site, same)[:2]
                    assert one == pytest.approx((wall, hit.after), abs=1e-11 + rounded)
                one = orbit.motion.at(hit.site, t + 1e-9)
                assert one == pytest.approx((wall, hit.after, hit.acceleration), abs=1e-6)
            before = np.array([t - 1e-7, t - 1e-8])
            assert orbit.velocity(hit.site, before) == pytest.approx(hit.before, abs=1e-5)
            assert orbit.displacement(hit.site, t) == pytest.approx(wall, abs=1e-11 + rounded)
    # what is asked for at once is what is asked for one by one
    n, t = orbit.hits[0].site + np.arange(3)[:, None] % 2, np.linspace(-9.0, 20.0, 7)
    for asked in (orbit.displacement, orbit.velocity, orbit.acceleration):
        single = [[asked(int(site), float(time)) for time in t] for (site,) in n]
        assert asked(n, t) == pytest.approx(np.array(single), abs=1e-13)


def test_all_sites_obey_the_equation_of_motion():
    orbit = asymmetric(0.82, 0.04, 0.8)
    n, t = np.arange(-2, 4), 1.234
    pull = orbit.displacement(n + 1, t) + orbit.displacement(n - 1, t)
    force = 0.04 * (pull - 2 * orbit.displacement(n, t)) - 0.82 * math.cos(t)
    assert np.abs(orbit.acceleration(n, t) - force).max() < 1e-14


def test_an_impact_that_overtakes_another_site_changes_nothing_but_its_place_in_line():
    early = [(0, 1, 0.1, -1.0), (1, 1, 0.2, -1.1), (0, -1, 3.0, 1.0), (1, -1, 3.1, 1.1)]
    orbit = orbit_at(impact_problem(orbit_from(early)).at(t1=0.3))
    in_order = [early[1], (0, 1, 0.3, -1.0), *early[2:]]
    wanted = orbit_from(in_order)
    assert sorted(k.b for k in orbit.map.kicks) == pytest.approx(
        sorted(k.b for k in wanted.map.kicks)
    )
    assert orbit.map.count().count == wanted.map.count().count
    assert orbit.admissibility().margin == pytest.approx(wanted.admissibility().margin)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"times": [3.0, 2.0]}, r"t1 = 3 does not come before t2 = 2"),
        ({"times": [0.0, 6.5]}, r"t2 = 6\.5 does not come before t1 \+ a section"),
        ({"impulses": [1.0, -1.0]}, r"impulse 1 at the wall \+1: a wall pushes away .* be -1"),
        ({"times": [0.0]}, "2 impacts, 1 times"),
        ({"offsets": [0.0, 0.1]}, "2 offsets for 1 impacting sites"),
        ({"impulses": [-1.0, math.inf]}, "finite"),
        ({"on": Conditions(0.5, 0.1, 1.5)}, r"k = 1\.5"),
        ({"section": replace(TWO, turns=2)}, "radiates"),
        ({"section": Section(((0, -1),)), "times": [0.0], "impulses": [1.0]}, "wall at -1 only"),
    ],
)
def test_guesses_that_make_no_sense_are_refused(change, sentence):
    guess = {"times": [0.0, 3.0], "impulses": [-1.0, 1.0], "section": TWO}
    guess["on"] = Conditions(0.5, 0.1, 0.8)
    with pytest.raises(BadInput, match=sentence):
        orbit_of(**{**guess, **change})


def test_a_guess_without_a_solution_nearby_is_none() -> None:
    weak = orbit_of(Conditions(0.01, 0.1, 0.8), TWO, [0.0, 3.0], [-1.0, 1.0])
    with pytest.raises(NotConverged, match="is not a solution"):
        weak.problem.solve()


def test_questions_about_two_impacts_are_for_two_impacts():
    orbit = orbit_from([(0, -1, 0.0, 1.0), (0, 1, 3.0, -1.0)])
    assert orbit.p == 0.5
    for question in ("phi", "chi", "b"):
        with pytest.raises(BadInput, match="one impact in half a period"):
            getattr(orbit, question)
    assert orbit.asymmetry == pytest.approx(3.0 - math.pi, abs=1e-15)
    with pytest.raises(BadInput, match="second half hits the opposite walls"):
        _ = orbit_from([(0, 1, 0.0, -1.0), (0, 1, 3.0, -1.0), (0, -1, 4.0, 2.0)]).asymmetry
    with pytest.raises(BadInput, match="different momenta"):
        _ = orbit_from([(0, -1, 0.0, 1.0), (0, 1, 3.0, -1.1)]).p


def test_times_count_modulo_the_period():
    b = symmetric(0.5, 0.04, 0.8)
    far = b.unfolded().problem.at(t1=b.phi - 4 * math.pi, t2=b.phi + 3 * math.pi)
    orbit = orbit_at(far)
    assert orbit.asymmetry == pytest.approx(0.0, abs=1e-14)
    assert orbit.residual < 1e-13
    assert orbit.admissibility().margin == pytest.approx(b.admissibility().margin, abs=1e-12)


def twice():
    arm = asymmetric(0.9, 0.0, 0.8, lattice=Ring(1))
    arm = trace(arm, "a", within={"a": (0.9, 0.93)}, towards="up")
    return orbit_at(lift(arm.first("PD")).arm(0.02))


PATTERN = [(0, 1, 0.1, -1.0), (0, -1, 3.0, 1.1), (0, 1, 6.7, -0.9), (0, -1, 9.0, 0.8)]
IMAGES = {
    "arm": (lambda: asymmetric(0.82, 0.04, 0.8), 1),
    "arm, shot": (lambda: orbit_at(shooting(asymmetric(0.82, 0.04, 0.8), sites=20)), 1),
    "two sites": (in_phase, 1),
    "doubled": (twice, 3),
    "no solution": (lambda: orbit_from(PATTERN, (0.05,), 2, a=0.4, gamma=0.03), 3),
}


@pytest.mark.parametrize("name", IMAGES)
def test_images_of_an_orbit_are_its_shifts_that_hit_the_same_walls_in_the_same_order(name) -> None:
    make, count = IMAGES[name]
    orbit, close = make(), 1e-11 if "shot" in name else 1e-12
    images = list(images_of(orbit))
    assert len(images) == count
    assert simpler_than(orbit) is None
    n, t = np.arange(min(3, orbit.lattice.sites or 3))[:, None], np.linspace(0, 12, 15)
    for shift, image in enumerate(images, 1):
        assert image.section.impacts == orbit.section.impacts
        assert image.residual < max(1e-12, 1.1 * orbit.residual)
        assert abs(image.impacts[0].time - orbit.impacts[0].time) < 0.5 * math.pi
        wanted = (-1) ** shift * orbit.displacement(n, t + shift * math.pi)
        assert image.displacement(n, t) == pytest.approx(wanted, abs=close)
    if orbit.section.two_impacts:
        assert images[0].c == pytest.approx(-orbit.c, abs=0.01 * close)
        assert images[0].impulses == pytest.approx(-orbit.impulses[::-1], abs=1e-10)
        for same in (*images_of(images[0]), shifted(orbit, 2)):
            assert same.displacement(n, t) == pytest.approx(orbit.displacement(n, t), abs=1e-10)


def test_an_orbit_whose_mirror_image_hits_other_walls_has_no_image() -> None:
    twice = [(0, 1, 0.0, -1.0), (0, 1, 1.0, -0.5), (0, -1, 3.5, 1.4)]
    assert list(images_of(orbit_from(twice, a=0.4, gamma=0.03))) == []


def test_an_orbit_is_made_of_finite_numbers() -> None:
    b = symmetric(0.5, 0.12, 0.4).unfolded()
    for spoilt in (
        {"offsets": (math.nan,)},
        {"impacts": tuple(one._replace(time=math.inf) for one in b.impacts)},
        {"impacts": tuple(one._replace(impulse=math.nan) for one in b.impacts)},
    ):
        with pytest.raises(BadInput, match="finite numbers are expected"):
            replace(b.representation, **spoilt)
