"""Whether the walls are kept off: against dense sampling of the motion, and at the limits."""

from __future__ import annotations

import math
from functools import partial

import mpmath as mp
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq

from contbreather.errors import BadInput
from contbreather.lattice import Fourier, Harmonic, InfiniteChain, Ring, Samples
from contbreather.orbits import (
    centre_margin,
    highest_neighbour,
    neighbour_peak,
    smallest_amplitude,
    symmetric,
    symmetric_roots,
)
from contbreather.orbits.clearance import Clearance, least_margin
from contbreather.orbits.constructors import shooting
from contbreather.orbits.grazing import other_contacts
from contbreather.orbits.orbit import Orbit, orbit_at

from .by_hand import touching

CHAIN = InfiniteChain()
upper = partial(symmetric, root=1)  # admissible or not
TWO = Fourier.from_response(cos={1: 1.0, 3: 0.3})
BUSY = Fourier.from_response(cos={1: 1.0, 9: 0.02, 21: 0.01}, sin={3: 0.2})
FORCINGS = [Harmonic(), TWO, BUSY]
LATTICES = [CHAIN, Ring(1), Ring(2), Ring(3), Ring(20)]


@st.composite
def breathers(draw, forcings=FORCINGS, lattices=LATTICES):
    gamma, k = draw(st.floats(0.0, 0.2499)), draw(st.floats(0.0, 1.0))
    forcing, lattice = draw(st.sampled_from(forcings)), draw(st.sampled_from(lattices))
    lowest = max(smallest_amplitude(gamma, k, forcing, lattice), 0.01)
    a = lowest + draw(st.floats(0.0, 1.0))
    return draw(st.sampled_from(symmetric_roots(a, gamma, k, forcing=forcing, lattice=lattice)))


# --------------------------------------------------------------------------------- neighbours


@pytest.mark.slow
@pytest.mark.parametrize(("gamma", "k"), [(0.2499, 0.4), (0.02, 0.05)])
def test_peak_of_the_neighbour_is_that_of_the_paper_s_series(paper, gamma, k):
    """The maximum of (15) found at 30 digits from the series and its slope."""
    a = 0.5 * (1.0 + smallest_amplitude(gamma, k))
    b = upper(a, gamma, k)
    t, height = neighbour_peak(b)
    with mp.workdps(30):
        p, phi = paper.root(a, gamma, k)

        def slope(s):
            return -a * mp.sin(phi + s) + p * paper.flight(gamma, 1, s)[1]

        since = mp.mpf(t) - phi
        late = since > mp.pi  # the peak of the second half period: -u_1 in the first
        s = mp.findroot(slope, since - (mp.pi if late else 0))
        top = a * mp.cos(phi + s) + p * paper.flight(gamma, 1, s)[0]
        assert abs(height - (-top if late else top)) < 1e-15
        assert abs(t - (phi + s + (mp.pi if late else 0))) < 1e-14


@pytest.mark.slow
@settings(max_examples=60)
@given(breathers())
def test_every_peak_is_the_top_of_the_motion_and_has_no_velocity(b):
    assume(b.lattice.sites != 1)
    t = b.phi + np.linspace(0.0, math.pi, 3001)
    for n in (1, 2, 3):
        if b.lattice.distance(n) == 0:
            continue
        at, height = neighbour_peak(b, n)
        dense = np.abs(b.displacement(n, t)).max()
        assert dense <= height + 4e-15
        assert height - dense < 1e-5
        assert b.displacement(n, at) == pytest.approx(height, abs=1e-14)
        assert abs(b.velocity(n, at)) < 1e-12
        assert min(b.phi, 0.0) <= at < 2 * math.pi


@pytest.mark.slow
@settings(max_examples=50)
@given(breathers(lattices=[CHAIN, Ring(3), Ring(40), Ring(41)]))
def test_no_site_however_far_climbs_higher_than_the_verdict_says(b):
    verdict = b.admissibility()
    t = b.phi + np.linspace(0.0, math.pi, 400)
    sites = [n for n in [*range(1, 21), 33, 64, 65, 300, 301] if b.lattice.distance(n)]
    top = np.abs(b.displacement(np.array(sites)[:, None], t)).max()
    assert top <= 1.0 - min(verdict.neighbours, verdict.far) + 1e-14
    n, at, height = highest_neighbour(b)
    assert 1.0 - height == verdict.neighbours
    assert b.displacement(n, at) == pytest.approx(height, abs=1e-14)


def test_on_the_lower_branch_it_is_the_second_neighbour_that_comes_closest():
    """Appendix B proves u_1 the highest only on the upper limit of the upper branch."""
    upper, lower = symmetric_roots(0.9, 0.12, 0.8)
    assert highest_neighbour(upper)[0] == 1
    assert highest_neighbour(lower)[0] == 2
    assert neighbour_peak(lower, 2)[1] > neighbour_peak(lower, 1)[1] + 0.015
    assert lower.admissibility().neighbours == 1.0 - neighbour_peak(lower, 2)[1]


@settings(max_examples=60)
@given(st.floats(0.001, 0.2499), st.floats(0.1, 1.0))
def test_on_the_upper_limit_of_the_upper_branch_it_is_the_first(gamma, k):
    """The paper's (B2), at the grazing it was proved for."""
    lowest = max(smallest_amplitude(gamma, k), 1e-3)

    def above(a):
        return neighbour_peak(upper(a, gamma, k))[1] - 1.0

    assume(above(lowest * 1.001) < 0)
    a = brentq(above, lowest * 1.001, 1.0 + 1e-9, xtol=1e-14)
    verdict = upper(a, gamma, k).admissibility()
    assert abs(1.0 - highest_neighbour(upper(a, gamma, k))[2]) < 1e-12
    assert verdict.margin == pytest.approx(0.0, abs=1e-12)
    assert verdict.far > -1e-9


def test_of_two_crests_nearly_as_high_the_higher_is_found():
    """Without coupling u_1 = a f, so its peak is the forcing's own; two crests of f tie at tilt 0.

    On the grid the wrong one of the two looks higher for about half of these.
    """
    for tilt in np.linspace(-1e-5, 1e-5, 15):
        angle = math.pi / 3 + tilt
        first = {1: 0.2 * math.cos(angle)}
        forcing = Fourier.from_response(cos={3: 1.0, **first}, sin={1: 0.2 * math.sin(angle)})
        b = upper(0.6, 0.0, 0.7, forcing=forcing)
        assert neighbour_peak(b)[1] == pytest.approx(0.6 * forcing.peak(), abs=1e-15)


def test_upper_limit_of_the_theory_notes():
    for off in (-1e-10, 0.0, 1e-10):
        verdict = upper(0.806417833236 + off, 0.1, 0.8).admissibility()
        assert abs(verdict.margin) < 1.2 * abs(off) + 2e-12
        assert verdict.reason.startswith("at the limit: site 1 reaches |u| = 1 at t = ")
    inside, outside = (upper(a, 0.1, 0.8).admissibility() for a in (0.80641, 0.80642))
    assert inside.ok
    said = "every site keeps off its walls; closest to the limit: site 1 reaches |u| = 0.99999"
    assert inside.reason.startswith(said)
    assert not outside.ok
    assert "(15) is broken" in outside.reason
    assert (outside.site, bool(inside), bool(outside)) == (1, True, False)


# ------------------------------------------------------------------------------------- centre


@pytest.mark.slow
@settings(max_examples=60)
@given(breathers())
def test_centre_margin_is_positive_exactly_where_site_0_stays_between_its_walls(b):
    assume(b.k > 1e-3)
    s = math.pi * np.linspace(0.0, 1.0, 6001)[1:-1] ** 1.5
    u = b.displacement(0, b.phi + s)
    ratio = (1 - u**2) / ((s + b.k) * s * (math.pi - s))
    scale = (math.pi / 2 + b.k) * math.pi**2 / 4
    ends = [2 * b.incoming[0] / math.pi, 2 * b.incoming[0] / (math.pi * (math.pi + b.k))]
    dense = scale * min(ratio.min(), *ends)
    margin = centre_margin(b)
    assert margin <= dense + 1e-7
    assert margin == pytest.approx(dense, abs=2e-3 * scale * (1 + abs(dense)))
    if abs(margin) > 1e-4:
        assert (margin > 0) == bool(np.all(np.abs(u) < 1.0))


def test_of_two_dips_of_the_centre_the_deeper_is_found():
    """Right after the impact lies a narrow dip that looks the shallower of two on any grid."""
    forcing = Fourier(cos={1: -1.0, 9: -1.62, 21: -4.41}, sin={3: -1.8})
    b = upper(0.4116339640522913, 0.0, 0.029542562745261687, forcing=forcing)
    s = np.linspace(1e-3, math.pi - 1e-3, 400001)
    u = b.displacement(0, b.phi + s)
    dense = np.min((1 - u**2) / ((s + b.k) * s * (math.pi - s)))
    dense *= (math.pi / 2 + b.k) * math.pi**2 / 4
    assert centre_margin(b) == pytest.approx(dense, abs=1e-8)


def test_site_0_meets_its_wall_again_for_small_k_as_the_paper_found():
    verdict = upper(0.99, 0.0, 0.005).admissibility()
    assert not verdict.ok
    assert verdict.site == 0
    assert "(B3) is broken" in verdict.reason
    assert abs(upper(0.99, 0.0, 0.005).displacement(0, verdict.time)) > 1.0
    for k in (0.1, 0.4, 1.0):
        for gamma in (0.0, 0.1, 0.2499):
            for a in np.linspace(smallest_amplitude(gamma, k), 1.0, 8)[1:]:
                assert centre_margin(upper(float(a), gamma, k)) > 0.0


def test_the_zero_of_the_centre_s_margin_is_a_graze():
    def margin(k):
        return centre_margin(upper(0.97, 0.0, k))

    k = brentq(margin, 0.005, 0.1, xtol=1e-15)
    b = upper(0.97, 0.0, k)
    t = b.admissibility().time
    assert b.displacement(0, t) == pytest.approx(1.0, abs=1e-12)
    assert b.velocity(0, t) == pytest.approx(0.0, abs=1e-6)
    assert 0.01 < k < 0.06


@pytest.mark.parametrize(
    ("a", "gamma", "says"), [(0.56, 0.0, "pushed inwards"), (0.99, 0.1, "so it sticks")]
)
def test_without_rebound_it_is_the_acceleration_that_decides(a, gamma, says):
    b = upper(a, gamma, 0.0)
    assert b.velocity(0, b.phi) == pytest.approx(0.0, abs=1e-15)
    inwards = b.accelerations[0] < 0
    assert inwards == ("inwards" in says)
    verdict = b.admissibility()
    assert (verdict.centre > 0) == inwards
    s = np.linspace(1e-3, math.pi - 1e-3, 2000)
    assert np.all(np.abs(b.displacement(0, b.phi + s)) < 1) == inwards
    if not inwards:
        assert says in verdict.reason


@pytest.mark.parametrize(("a", "gamma"), [(0.6, 0.0), (0.99, 0.1), (0.7, 0.2)])
def test_centre_margin_has_no_jump_where_the_rebound_dies(a, gamma):
    limit = centre_margin(upper(a, gamma, 0.0))
    for k in (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-9):
        # it rises like sqrt(k): the flight starts flat for about so long
        assert abs(centre_margin(upper(a, gamma, k)) - limit) < 3 * math.sqrt(k) + 1e-4


def test_a_dip_between_the_last_of_the_grid_and_the_impact_is_found_at_its_bottom() -> None:
    forcing = Fourier(cos={1: -1.0, 3: 1.8}, sin={3: -1.5})
    rest = np.linspace(1e-4, 0.2, 200001)
    for k in np.linspace(0.6, 0.95, 8).tolist():
        b = upper(0.45, 0.2, k, forcing=forcing)
        s = math.pi - rest
        ratio = (1 - b.displacement(0, b.phi + s) ** 2) / ((s + k) * s * rest)
        verdict = b.admissibility()
        deepest = int(ratio.argmin())
        assert 0 < deepest < rest.size - 1
        when = b.phi + float(s[deepest])
        assert verdict.places["centre"] == (0, pytest.approx(when, abs=1e-5))
        norm = (math.pi / 2 + k) * math.pi**2 / 4
        assert verdict.centre == pytest.approx(norm * float(ratio[deepest]), abs=1e-9)
        whole = b.unfolded().admissibility()
        site, time = whole.places["centre"]
        own = verdict.places["centre"][1]
        assert (site, math.remainder(time - own, math.pi)) == (0, pytest.approx(0.0, abs=1e-7))
        assert whole.centre == pytest.approx(verdict.centre, abs=1e-12)


def undone(contact: Clearance, b: Orbit, site: int) -> float:
    """The margin m of ``m/(|m| + d)``, d the root mean square difference of two motions."""
    t = b.phi + math.pi / 8 * np.arange(16)
    moves = b.displacement(contact.site, t)
    other = b.a * b.forcing.f(t) if contact.site == site else b.displacement(site, t)
    d = float(np.sqrt(np.mean((moves - other) ** 2)))
    return d * contact.margin / (1 - abs(contact.margin))


GRAZING = [Harmonic(), TWO, Fourier(cos={1: -1.0, 3: -0.15}, sin={3: 0.3, 5: 0.2})]


@pytest.mark.parametrize("forcing", GRAZING)
@pytest.mark.parametrize("gamma", [0.0, 0.05])
def test_besides_the_graze_of_site_0_the_least_of_its_own_flight_is_told(forcing, gamma) -> None:
    k = brentq(lambda k: centre_margin(upper(0.97, gamma, k, forcing=forcing)), 0.0, 0.4)
    b = upper(0.97, gamma, k, forcing=forcing)
    site, t = b.admissibility().places["centre"]
    assert site == 0
    dip = t - b.phi
    s = np.linspace(0, math.pi, 200001)[1:-1]
    s = s[abs(s - dip) > 1e-2]
    room = (s + k) * s * (math.pi - s) * (s - dip) ** 2
    ratio = (1 - b.displacement(0, b.phi + s) ** 2) / room
    own = other_contacts(b.motion, 0, t)[0]
    assert own.site == 0
    assert undone(own, b, 0) == pytest.approx(float(ratio.min()), rel=1e-3)
    # both a dip and the very end, where it falls off, may be the least
    assert own.time - b.phi == pytest.approx(float(s[ratio.argmin()]), abs=1e-3)


@pytest.mark.parametrize("forcing", GRAZING)
@pytest.mark.parametrize("site", [1, 2])
def test_besides_the_graze_of_a_neighbour_the_least_of_its_own_motion_is_told(forcing, site):
    gamma, k = 0.1, 0.8
    low = 1.1 * smallest_amplitude(gamma, k, forcing)
    b, t = touching(site, gamma, k, low, forcing=forcing)
    wall = math.copysign(1.0, float(b.displacement(site, t)))
    s = np.linspace(1e-2, 2 * math.pi - 1e-2, 100001)
    ratio = (1 - wall * b.displacement(site, t + s)) / (1 - np.cos(s))
    own = other_contacts(b.motion, site, t)[0]
    assert own.site == site
    assert undone(own, b, site) == pytest.approx(float(ratio.min()), rel=1e-5)
    apart = (own.time - t - float(s[ratio.argmin()]) + math.pi) % (2 * math.pi) - math.pi
    assert abs(apart) < 1e-2


# ------------------------------------------------------------------- besides a grazing crest


# ---------------------------------------------------------------------------------- far field


def test_the_far_field_is_a_limit_of_its_own():
    weak = upper(0.5, 0.12, 0.4).admissibility()
    assert weak.far == 0.5
    strong = upper(1.05, 0.12, 0.4).admissibility()
    assert strong.far == pytest.approx(-0.05, abs=1e-15)
    lower = symmetric_roots(0.99, 0.0, 0.4)[1]
    assert lower.admissibility().far == pytest.approx(0.01, abs=1e-15)
    # a square wave's answer is not as high as its coefficients say
    t = 2 * np.pi * np.arange(64) / 64
    forcing = Samples(-np.cos(t) + 9 * 0.1 * np.cos(3 * t))
    b = upper(0.9, 0.05, 0.5, forcing=forcing)
    dense = np.abs(forcing.f(np.linspace(0, 7, 20001))).max()
    assert b.admissibility().far == pytest.approx(1 - 0.9 * dense, abs=1e-6)


def test_a_ring_has_no_far_field_and_a_single_oscillator_no_neighbours():
    alone = upper(1.3, 0.1, 0.6, lattice=Ring(1)).admissibility()
    assert alone.ok
    assert (alone.max_neighbour, alone.neighbours, alone.far) == (0.0, 1.0, 1.0)
    assert alone.site == 0
    assert neighbour_peak(upper(1.3, 0.1, 0.6, lattice=Ring(1)))[1] == 0.0
    assert highest_neighbour(upper(1.3, 0.1, 0.6, lattice=Ring(1)))[2] == 0.0
    for sites in (1, 6):  # with walls farther off than a far field is ever
        wide = symmetric_roots(3.0, 0.02, 0.8, lattice=Ring(sites), walls=(-5, 5))[0]
        verdict = wide.admissibility()
        there = {"neighbours", "centre"} if sites > 1 else {"centre"}
        assert verdict.margin == min(getattr(verdict, name) for name in there) > 1.0
        assert verdict.margin == pytest.approx(least_margin(wide.motion), abs=1e-13)
        assert f"site {verdict.site} " in verdict.reason
    pair = upper(0.5, 0.1, 0.6, lattice=Ring(2)).admissibility()
    assert pair.max_neighbour == neighbour_peak(upper(0.5, 0.1, 0.6, lattice=Ring(2)))[1]


# ----------------------------------------------------------------------------------- verdicts


@pytest.mark.parametrize("name", ["a", "gamma", "k"])
def test_margins_are_continuous_along_a_branch(name):
    """Halving the step halves the largest change: no jumps, also where the worst site changes."""
    where = {"a": (0.35, 1.1), "gamma": (0.0, 0.249), "k": (0.0, 1.0)}[name]
    changes = []
    for count in (100, 200, 400):
        margins = []
        for value in np.linspace(*where, count + 1):
            point = {"a": 0.9, "gamma": 0.15, "k": 0.2} | {name: float(value)}
            verdict = upper(**point).admissibility()
            margins.append((verdict.margin, verdict.neighbours, verdict.centre, verdict.far))
        changes.append(np.abs(np.diff(margins, axis=0)).max(axis=0))
    # (the fold at the start of a branch in a has a square root: 1.3 and not 1.8)
    assert np.all(changes[0] >= 1.3 * changes[1] - 1e-12)
    assert np.all(changes[1] >= 1.3 * changes[2] - 1e-12)


@pytest.mark.parametrize("n", [0, 5, -10])
def test_the_impacting_site_has_no_peak_to_ask_for(n):
    with pytest.raises(BadInput, match="impacting site"):
        neighbour_peak(upper(0.5, 0.12, 0.4, lattice=Ring(5)), n)


def test_repr_is_one_line_with_the_verdict_and_what_is_closest() -> None:
    good, bad = upper(0.5, 0.04, 0.8).admissibility(), upper(0.95, 0.1, 0.8).admissibility()
    for verdict, word in ((good, "ok"), (bad, "not ok")):
        shown = repr(verdict)
        assert shown.startswith(f"<Admissibility {word}, margin {verdict.margin:.6g}: ")
        assert verdict.reason.rstrip(".") in shown
        assert "\n" not in shown


@pytest.mark.parametrize("wall", [1, -1])
def test_an_orbit_upside_down_keeps_off_its_one_wall_as_well(wall: int) -> None:
    on = {"a": 0.717, "gamma": 0.0, "k": 0.5, "damping": 0.02, "spring": 2.0, "lattice": Ring(1)}
    pair = (None, 0.58) if wall > 0 else (-0.58, None)
    start = 1.0 if wall > 0 else 1.0 + math.pi
    orbit = orbit_at(shooting({"t1": start}, sequence=[(0, wall)], walls={0: pair}, **on))
    s = np.linspace(0, orbit.period, 4001)[1:-1]
    room = 0.58 - wall * orbit.displacement(0, orbit.times[0] + s)
    ratio = room / ((s + 0.5) * s * (orbit.period - s))
    scale = 0.25 * orbit.period**2 * (0.5 * orbit.period + 0.5)
    ends = abs(orbit.incoming[0]) / orbit.period / np.array([1.0, orbit.period + 0.5])
    assert orbit.admissibility().margin == pytest.approx(scale * min(ratio.min(), *ends), abs=1e-6)
