"""Orbits with any impacts: a closed form, exact simulation, differences."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import mpmath as mp
import numpy as np
import pytest

from contbreather.continuation import trace
from contbreather.errors import BadInput, NotConverged
from contbreather.lattice import Fourier, InfiniteChain, Ring
from contbreather.lattice.conditions import Conditions
from contbreather.orbits import symmetric
from contbreather.orbits.constructors import asymmetric, shooting
from contbreather.orbits.exact_modes import ExactModes
from contbreather.orbits.green_equations import OrbitEquations
from contbreather.orbits.green_function import impact_problem
from contbreather.orbits.orbit import Orbit, orbit_at, orbit_of
from contbreather.orbits.section import Section
from contbreather.orbits.symmetries import SAME, images_of, shifted, simpler_than

from .by_hand import derivatives, orbit_from, repeats

TWO = Section(((0, 1), (0, -1)))
RICH = Fourier(cos={1: -1.0, 3: 0.4}, sin={1: 0.2, 5: -0.3})


@cache
def mean_responses(gamma, d):
    """A and B of the closed form: means over the band."""
    with mp.workdps(25):
        g, d = mp.mpf(gamma), mp.mpf(d)

        def A(w):
            if w == 0:
                return (mp.pi**2 - 4 * d * d) / (2 * mp.pi)
            return (mp.cos(2 * w * d) - mp.cos(mp.pi * w)) / (w * mp.sin(mp.pi * w))

        def B(w):
            return 2 * d / mp.pi if w == 0 else mp.sin(2 * w * d) / mp.sin(mp.pi * w)

        def mean(f):
            if g == 0:
                return f(mp.mpf(0))
            return mp.quad(lambda x: f(2 * mp.sqrt(g) * mp.sin(x / 2)), [0, 1, 2, mp.pi]) / mp.pi

        return mean(A), mean(B)


def closed_form(gamma, k, d):
    """(p, a, t_m, |c|) of the breather with the flights pi -+ 2d: ``p = 1/(A - B cot d)``, ..."""
    A, B = mean_responses(gamma, d)
    with mp.workdps(25):
        k, d = mp.mpf(k), mp.mpf(d)
        q = (1 - k) / (1 + k)
        p = 1 / (A - B * mp.cot(d))
        x, y = p * q / mp.cos(d), -p * B / mp.sin(d)
        c = p * q * mp.tan(d)
        return tuple(float(value) for value in (p, mp.hypot(x, y), mp.atan2(y, x), c))


@pytest.mark.parametrize("gamma", [0.0, 1e-4, 0.04, 0.12, 0.2])
@pytest.mark.parametrize("k", [0.2, 0.8, 0.95])
@pytest.mark.parametrize("d", [0.02, 0.3, 0.55, 0.8])
def test_two_impacts_are_the_closed_form_of_asymmetric_breathers(gamma, k, d):
    """The shorter flight, pi - 2d, is centred at t_m; the solver starts well off and knows no d."""
    p, a, t_m, c = closed_form(gamma, k, d)
    # the wall that the shorter flight starts from is a matter of taste: here +1
    equations = OrbitEquations(TWO)
    params = {"a": a, "gamma": gamma, "k": k}
    found = []
    for sign in (1, -1):
        for turn in (0.0, math.pi):
            t1 = t_m + turn - (math.pi / 2 - d)
            x = np.array([t1, t1 + math.pi - 2 * d, -2 * p, 2 * p, sign * c])
            found.append((np.abs(equations.residual(x, params)).max(), t1, sign))
    residual, t1, sign = min(found)
    assert residual < 1e-10  # one of the four readings solves the equations

    off = 1e-2 * d  # closer to the pitchfork the symmetric solution is closer, too
    guess = orbit_of(
        Conditions(**params),
        TWO,
        [t1 + off, t1 + math.pi - 2 * d - off],
        [-2.02 * p, 2.02 * p],
        [sign * 0.98 * c],
    )
    orbit = orbit_at(impact_problem(guess).solve(tolerance=1e-11)[0])
    assert orbit.p == pytest.approx(p, abs=1e-10)
    assert orbit.c == pytest.approx(sign * c, abs=1e-10)
    assert orbit.asymmetry == pytest.approx(-2 * d, abs=1e-10)
    assert orbit.impacts[0].time == pytest.approx(t1, abs=1e-10)


def test_symmetric_breather_is_an_instance():
    for lattice in (InfiniteChain(), Ring(7)):
        for forcing in (None, RICH):
            b = symmetric(0.7, 0.08, 0.8, forcing=forcing, lattice=lattice)
            orbit = b.unfolded()
            assert orbit.residual < 1e-14
            assert orbit.entries == pytest.approx([b.b, b.b], rel=1e-12)
            assert orbit.incoming == pytest.approx([b.incoming[0], -b.incoming[0]])
            n, t = np.arange(4)[:, None], np.linspace(-3, 9, 23)
            assert np.abs(orbit.displacement(n, t) - b.displacement(n, t)).max() < 3e-15
            assert np.abs(orbit.velocity(n, t) - b.velocity(n, t)).max() < 5e-15
            solved = impact_problem(orbit).solve(tolerance=1e-11)[0]
            assert orbit_at(solved).p == pytest.approx(b.p, abs=1e-14)


CASES = [
    (InfiniteChain(), ((0, 1), (0, -1)), 1, None, 0.1),
    (InfiniteChain(), ((0, 1), (2, 1), (0, -1), (2, -1)), 1, RICH, 0.1),
    (InfiniteChain(), ((0, 1), (0, -1), (0, 1), (0, -1)), 2, None, 0.05),
    (Ring(5), ((1, 1), (3, -1), (1, -1), (3, 1), (4, 1), (4, -1)), 1, RICH, 0.2),
    (Ring(6), ((0, 1), (0, -1), (2, 1), (0, 1), (2, -1), (0, -1)), 2, None, 0.21),
]


@pytest.mark.parametrize(("lattice", "sequence", "periods", "forcing", "gamma"), CASES)
def test_derivatives_are_those_of_the_residual(lattice, sequence, periods, forcing, gamma):
    rng = np.random.default_rng(0)
    own = {} if forcing is None else {"forcing": forcing}
    equations = OrbitEquations(Section(sequence, periods), lattice=lattice, **own)
    m = len(sequence)
    times = np.sort(rng.uniform(0, 2 * np.pi * periods, m))
    impulses = -equations.walls * rng.uniform(1, 2, m)
    x = np.concatenate([times, impulses, rng.normal(size=len(equations.section.hit))])
    params = {"a": 0.7, "gamma": gamma, "k": 0.6, **equations.forcing.params}
    for name, found, wanted in derivatives(equations, x, params, 4e-5):
        assert np.abs(found - wanted).max() < (1e-8 if name else 1e-9) * np.abs(wanted).max()
    assert len(equations.names) == x.size


@pytest.mark.parametrize("sites", [6, 21])
@pytest.mark.parametrize(("bonds", "wall"), [(1, 1), (1, -1), (2, -1), (3, 1)])
def test_breathers_on_two_sites_are_repeated_by_the_simulated_ring(sites, bonds, wall):
    b = symmetric(0.5, 0.08, 0.8)
    orbit = orbit_of(
        b.conditions,
        Section(((0, 1), (bonds, wall), (0, -1), (bonds, -wall))),
        [b.phi, b.phi + 1e-3, b.phi + math.pi, b.phi + math.pi + 1e-3],
        [-2 * b.p, -2 * b.p * wall, 2 * b.p, 2 * b.p * wall],
    ).solved()
    assert orbit.admissibility().ok
    assert repeats(orbit, sites)[0] < 1e-13


def test_asymmetric_breather_is_repeated_by_the_simulated_ring():
    for forcing, a in ((None, 0.82), (Fourier(cos={1: -1.0, 3: -0.15}), 0.81)):
        orbit = asymmetric(a, 0.04, 0.8, forcing=forcing)
        assert orbit.admissibility().ok
        assert abs(orbit.c) > 0.01
        assert repeats(orbit, 20)[0] < 1e-13
        assert repeats(orbit, 3)[0] < 1e-13


def test_mean_impulses_tilt_the_chain_between_two_sites():
    """Two sites with net impulses of opposite sign pull the chain into a straight line between."""
    impacts = [(0, 1, 0.0, -1.0), (0, -1, 3.0, 1.2), (3, 1, 0.5, -1.2), (3, -1, 3.5, 1.0)]
    tilt = 3 * 0.2 / (2 * math.pi * 0.1)
    orbit = orbit_from(impacts, (tilt, 0.0), a=0.3, gamma=0.1)
    flight = orbit.representation
    assert np.abs(flight.equations.residual(flight.x, orbit.conditions.params)[8:]).max() < 1e-14
    assert flight.offset([-5, 0, 1, 2, 3, 9]) == pytest.approx(
        [tilt, tilt, tilt * 2 / 3, tilt / 3, 0, 0]
    )
    ring = OrbitEquations(orbit.section, lattice=Ring(9))
    # on a ring half of the pull goes the other way round: both ways in parallel
    assert ring.links[0, 1] == pytest.approx(1 / 3 + 1 / 6)


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
                if isinstance(orbit.representation, ExactModes):
                    one = orbit.representation.at(hit.site, same)[:2]
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


def test_general_problem_sees_the_pitchfork_of_symmetric_breathers_as_a_branch_point():
    start = impact_problem(symmetric(0.74, 0.04, 0.8).unfolded())
    branch = trace(start, "a", towards="up", within={"a": (0.7, 0.8)})
    assert branch.first("BP")["a"] == pytest.approx(0.777632425944, abs=1e-11)
    assert np.abs(branch["asymmetry"]).max() < 1e-9
    assert [int(count) for count in branch["unstable"][[0, -1]]] == [0, 1]


def test_general_problem_meets_the_fold_of_symmetric_breathers():
    start = impact_problem(symmetric(0.1, 0.1, 0.8).unfolded())
    branch = trace(start, "a", towards="down", within={"a": (0.01, 0.2)})
    assert branch.first("LP")["a"] == pytest.approx(0.057029037182, abs=1e-11)


@pytest.mark.parametrize(
    ("sequence", "sentence"),
    [
        ([(0, 1), (0, 1)], r"hits the wall at \+1 only"),
        ([(0, -1)], r"hits the wall at -1 only"),
        ([(0, 1), (7, -1)], r"impact \(7, -1\): no such site on the ring of 7"),
    ],
)
def test_sequences_that_cannot_be_are_refused(sequence, sentence):
    m = len(sequence)
    impacts = [(n, w, t, -w) for t, (n, w) in zip(range(m), sequence, strict=True)]
    for lattice in (InfiniteChain(), Ring(7)):
        if lattice.sites or "ring" not in sentence:
            with pytest.raises(BadInput, match=sentence):
                orbit_from(impacts, gamma=0.1, lattice=lattice)


def test_guesses_that_make_no_sense_are_refused():
    def guess(**change):
        given = {"times": [0.0, 3.0], "impulses": [-1.0, 1.0]}
        on = replace(
            Conditions(0.5, 0.1, 0.8), **{n: change.pop(n) for n in ("a", "k") if n in change}
        )
        section = replace(TWO, turns=change.pop("turns", 1))
        return orbit_of(on, section, **{**given, **change})

    with pytest.raises(BadInput, match=r"t1 = 3 does not come before t2 = 2"):
        guess(times=[3.0, 2.0])
    with pytest.raises(BadInput, match=r"t2 = 6\.5 does not come before t1 \+ a section"):
        guess(times=[0.0, 6.5])
    with pytest.raises(BadInput, match=r"impulse 1 at the wall \+1: a wall pushes away .* be -1"):
        guess(impulses=[1.0, -1.0])
    with pytest.raises(BadInput, match="2 impacts, 1 times"):
        guess(times=[0.0])
    with pytest.raises(BadInput, match="2 offsets for 1 impacting sites"):
        guess(offsets=[0.0, 0.1])
    with pytest.raises(BadInput, match="finite"):
        guess(impulses=[-1.0, math.inf])
    with pytest.raises(BadInput, match=r"k = 1\.5"):
        guess(k=1.5)
    with pytest.raises(BadInput, match="radiates"):
        guess(turns=2)
    with pytest.raises(NotConverged, match="is not a solution"):
        guess(a=0.01).problem.solve()


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
    with pytest.raises(BadInput, match="whole numbers"):
        orbit.displacement(0.5, 0.0)
    with pytest.raises(BadInput, match="finite real numbers"):
        orbit.displacement(0, math.nan)
    with pytest.raises(BadInput, match="continuous spectrum"):
        orbit.multipliers()
    with pytest.raises(BadInput, match="fall together on a lattice of 2"):
        orbit_from([(0, 1, 0.0, -1.0), (2, -1, 1.0, 1.0)], (0.0, 0.1)).on(Ring(2))


def test_times_count_modulo_the_period():
    b = symmetric(0.5, 0.04, 0.8)
    far = b.unfolded().problem.at(t1=b.phi - 4 * math.pi, t2=b.phi + 3 * math.pi)
    orbit = orbit_at(far)
    assert orbit.asymmetry == pytest.approx(0.0, abs=1e-14)
    assert orbit.residual < 1e-13
    assert orbit.admissibility().margin == pytest.approx(b.admissibility().margin, abs=1e-12)


def test_images_of_an_orbit_are_its_shifts_that_hit_the_same_walls_in_the_same_order() -> None:
    for orbit in (asymmetric(0.82, 0.04, 0.8), asymmetric(0.82, 0.04, 0.8).on(Ring(5))):
        (image,) = images_of(orbit)
        assert image.section.impacts == orbit.section.impacts
        assert image.residual < 1e-12
        assert image.c == pytest.approx(-orbit.c, abs=1e-14)
        n, t = np.arange(3)[:, None], np.linspace(0, 7, 15)
        wanted = -orbit.displacement(n, t + math.pi)
        assert image.displacement(n, t) == pytest.approx(wanted, abs=1e-12)
        assert abs(image.impacts[0].time - orbit.impacts[0].time) <= math.pi
        assert image.impulses == pytest.approx(-orbit.impulses[::-1], abs=1e-10)
        for same in (*images_of(image), shifted(orbit, 2)):
            assert same.displacement(n, t) == pytest.approx(orbit.displacement(n, t), abs=1e-10)


def test_images_over_several_periods_begin_as_close_to_the_orbit_as_they_can() -> None:
    pattern = [(0, 1, 0.1, -1.0), (0, -1, 3.0, 1.1), (0, 1, 6.7, -0.9), (0, -1, 9.0, 0.8)]
    orbit = orbit_from(pattern, (0.05,), 2, a=0.4, gamma=0.03)
    images = list(images_of(orbit))
    assert len(images) == 3
    t = np.linspace(0, 12, 13)
    for shift, image in enumerate(images, 1):
        assert image.section.impacts == orbit.section.impacts
        wanted = (-1) ** shift * orbit.displacement(0, t + shift * math.pi)
        assert image.displacement(0, t) == pytest.approx(wanted, abs=1e-12)
        assert abs(image.impacts[0].time - orbit.impacts[0].time) < 0.5 * math.pi


def test_an_orbit_whose_mirror_image_hits_other_walls_has_no_image() -> None:
    twice = [(0, 1, 0.0, -1.0), (0, 1, 1.0, -0.5), (0, -1, 3.5, 1.4)]
    assert list(images_of(orbit_from(twice, a=0.4, gamma=0.03))) == []


def moved(orbit, impact, late):
    """The orbit with one of its impacts late."""
    impacts = list(orbit.impacts)
    impacts[impact] = impacts[impact]._replace(time=impacts[impact].time + late)
    return Orbit(replace(orbit.representation, impacts=tuple(impacts)))


def test_an_orbit_written_over_twice_its_period_is_known_for_its_half() -> None:
    once = asymmetric(0.82, 0.04, 0.8)
    twice = once.doubled()
    half = simpler_than(twice)
    assert half is not None
    assert half.section == once.section
    for one, other in zip(half.impacts, once.impacts, strict=True):
        assert one == pytest.approx(other, abs=1e-15)
    assert simpler_than(once) is None
    assert simpler_than(moved(twice, 3, 1e-4)) is None


def test_an_orbit_of_two_alike_flights_is_known_for_a_symmetric_breather() -> None:
    b = symmetric(0.5, 0.04, 0.8)
    known = simpler_than(b.unfolded())
    assert known is not None
    assert known.section == b.section
    assert (known.p, known.phi) == pytest.approx((b.p, b.phi), abs=1e-14)
    # one that is symmetric but for rounding: its impacts are put to equal distances
    known = simpler_than(moved(b.unfolded(), 1, 0.8 * SAME))
    assert known is not None
    assert known.section == b.section
    assert known.phi - b.phi == pytest.approx(0.4 * SAME, abs=1e-3 * SAME)
    assert simpler_than(moved(b.unfolded(), 1, 1.2 * SAME)) is None


def test_an_orbit_is_made_of_finite_numbers() -> None:
    b = symmetric(0.5, 0.12, 0.4).unfolded()
    for spoilt in (
        {"offsets": (math.nan,)},
        {"impacts": tuple(one._replace(time=math.inf) for one in b.impacts)},
        {"impacts": tuple(one._replace(impulse=math.nan) for one in b.impacts)},
    ):
        with pytest.raises(BadInput, match="finite numbers are expected"):
            replace(b.representation, **spoilt)
