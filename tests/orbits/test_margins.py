"""Margins, of orbits in every representation: against dense sampling of the motion, and the same
bits whether they are compiled or not."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import contbreather as cb
from contbreather.kernels import Kernel
from contbreather.lattice.conditions import Conditions
from contbreather.orbits.clearance import highest_neighbour, least_margin, neighbour_peak
from contbreather.orbits.constructors import asymmetric
from contbreather.orbits.grazing import other_contacts
from contbreather.orbits.orbit import Orbit, orbit_of
from contbreather.orbits.section import Section

from .by_hand import orbit_from


def two_sites() -> Orbit:
    """On the infinite chain, with an offset for each site."""
    found = cb.multibreather([0, 3], a=0.5, gamma=0.02, k=0.8, lattice=cb.Ring(12)).unfolded()
    on = Conditions(0.5, 0.02, 0.8)
    return orbit_of(on, found.section, found.times, found.impulses, (0.0, 0.0)).solved()


def guessed(bonds: int) -> Orbit:
    """Of two sites; margins do not ask whether it solves anything."""
    b = cb.symmetric(0.5, 0.2, 0.8, root=1)
    times = [b.phi, b.phi + 0.01, b.phi + math.pi, b.phi + math.pi + 0.01]
    section = Section(((0, 1), (bonds, -1), (0, -1), (bonds, 1)))
    return orbit_of(b.conditions, section, times, [-2 * b.p, 2 * b.p, 2 * b.p, -2 * b.p])


def resonant() -> Orbit:
    """On a ring whose modes are summed one by one; far from any solution."""
    impacts = [(0, 1, 0.0, -1.0), (0, -1, 3.0, 0.8), (0, 1, 6.5, -0.7), (0, -1, 9.0, 0.9)]
    return orbit_from(impacts, turns=2, gamma=0.2, lattice=cb.Ring(12))


DAMPED = {"a": 0.5, "gamma": 0.05, "k": 0.8, "damping": 0.02, "spring": 0.2}
ORBITS = [
    cb.symmetric(0.5, 0.12, 0.4),
    cb.symmetric(0.99, 0.01, 0.02),
    cb.orbits.symmetric_roots(0.9, 0.12, 0.8)[1],  # where the second neighbour climbs highest
    cb.symmetric(0.7, 0.0, 0.0, root=1),
    cb.symmetric(0.6, 0.07, 0.7, forcing="cos(t) + 0.3*cos(3*t)"),
    cb.symmetric(0.5, 0.05, 0.8, spring=0.2),
    *(cb.symmetric(0.5, 0.05, 0.8, lattice=cb.Ring(sites)) for sites in (1, 2, 5)),
    cb.orbits.symmetric_roots(1.2, 0.1, 0.03)[0],  # beyond its limits
    cb.symmetric(0.99, 0.0, 0.02, root=1).unfolded(),  # pushed back onto the wall it just left
    asymmetric(0.87, 0.04, 0.8),
    asymmetric(1.1, 0.1, 0.5, inadmissible=True).on(cb.Ring(7)),
    *map(guessed, (1, 2, 6)),
    asymmetric(0.8, 0.04, 0.8).doubled(),
    cb.symmetric(0.5, 0.08, 0.0).unfolded(),
    two_sites(),
    resonant(),
    cb.symmetric(**DAMPED, lattice=cb.OpenChain(9), site=0),
    cb.symmetric(**DAMPED, lattice=cb.OpenChain(30), site=4).unfolded(),
    cb.symmetric(0.6, 0.04, 0.0, lattice=cb.Grid(3, 4), site=5),
    cb.multibreather([0, 3], a=0.5, gamma=0.02, k=0.8, lattice=cb.Ring(12)),
]


@pytest.fixture
def uncompiled(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Kernel, "code", lambda kernel: None)


@pytest.mark.parametrize("orbit", ORBITS, ids=repr)
def test_the_least_margin_is_the_least_of_those_that_are_told(orbit: Orbit) -> None:
    verdict = orbit.admissibility()
    assert least_margin(orbit.motion) == pytest.approx(verdict.margin, abs=1e-13)
    assert verdict.margin == min(verdict.neighbours, verdict.centre, verdict.far)


@pytest.mark.parametrize("orbit", ORBITS, ids=repr)
def test_no_site_climbs_higher_than_the_one_that_is_named(orbit: Orbit) -> None:
    site, time, height = highest_neighbour(orbit)
    idle = list(orbit.motion.idle)
    if not idle:
        assert height == 0.0
        return
    t = orbit.times[0] + orbit.period * np.linspace(0.0, 1.0, 4001)
    dense = abs(orbit.displacement(np.array(idle)[:, None], t)).max()
    assert dense - 1e-13 <= height <= dense + 1e-5
    assert abs(orbit.displacement(site, time)) == pytest.approx(height, abs=1e-13)
    assert abs(orbit.velocity(site, time)) < 1e-11


@pytest.mark.parametrize("orbit", ORBITS, ids=repr)
def test_between_impacts_no_ratio_is_less_than_the_margin(orbit: Orbit) -> None:
    hits = orbit.hits
    least = math.inf
    for hit in hits:
        later = ((one.time - hit.time) % orbit.period for one in hits if one.site == hit.site)
        length = min((since for since in later if since > 0.0), default=orbit.period)
        s = length * np.linspace(0.0, 1.0, 20001)[1:-1]  # closer, k = 0, rounding is all of 1 - u^2
        u = orbit.displacement(hit.site, hit.time + s)
        ratio = (1.0 - u * u) / ((s + orbit.k) * s * (length - s))
        least = min(least, float(ratio.min()) * (0.5 * length + orbit.k) * length * length / 4.0)
    if orbit.residual < 1e-9:  # otherwise nobody is at a wall at an impact
        assert orbit.admissibility().centre == pytest.approx(least, abs=1e-3 * (1.0 + abs(least)))


@pytest.mark.parametrize("orbit", ORBITS, ids=repr)
def test_margins_are_the_same_bits_compiled_or_not(orbit: Orbit, request) -> None:
    def all_of() -> list[object]:
        highest = highest_neighbour(orbit)
        site, time, _ = highest
        found: list[object] = [least_margin(orbit.motion)]
        if site in orbit.motion.idle:
            found += other_contacts(orbit.motion, site, time)
        place = orbit.admissibility().places["centre"]
        return [*found, *other_contacts(orbit.motion, *place), highest]

    compiled = all_of()
    request.getfixturevalue("uncompiled")
    assert all_of() == compiled


def test_a_flat_crest_that_newton_s_step_leaves_is_climbed() -> None:
    """Without coupling neighbours follow the forcing, here one with all but straight flanks."""
    cos = {m: 0.97**m / m**2 for m in range(1, 60, 2)}
    forcing = cb.Fourier.from_response(cos=cos)
    for k in (0.3, 0.6, 0.9):
        b = cb.symmetric(0.6, 0.0, k, forcing=forcing, root=1)
        t, height = neighbour_peak(b)
        assert height == pytest.approx(0.6 * sum(cos.values()), abs=1e-14)
        assert math.remainder(t, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-9)


def test_of_sites_that_are_mirror_images_the_first_is_named() -> None:
    """Not the one that rounding favours."""
    for a in np.linspace(0.45, 0.55, 7).tolist():
        orbit = cb.multibreather([0, 3], a=a, gamma=0.02, k=0.8, lattice=cb.Ring(12))
        assert highest_neighbour(orbit)[0] == 4  # as high as 11
        assert orbit.admissibility().places["centre"][0] == 0


def test_two_impacts_of_a_site_at_one_wall_in_the_wrong_order_have_no_margin_left() -> None:
    impacts = [(0, 1, 0.1, -0.4), (0, 1, 0.3, -0.4), (0, -1, 3.2, 0.8)]
    orbit = orbit_from(impacts, gamma=0.05)
    for late in (0.0, 0.1):
        first, second, third = orbit.representation.impacts
        moved = first, second._replace(time=first.time - late), third
        wrong = Orbit(replace(orbit.representation, impacts=moved))
        assert wrong.admissibility().centre <= -late
        assert least_margin(wrong.motion) <= -late


# --- of orbits with two impacts ------------------------------------------------------------------


def test_far_field_carries_the_offset():
    orbit = asymmetric(0.82, 0.04, 0.8)
    far = 1 - 0.82 - abs(orbit.c)
    assert orbit.admissibility().far == pytest.approx(far, abs=1e-14)
    when = orbit.admissibility().places["far"][1]
    assert abs(orbit.displacement(300, when)) == pytest.approx(1 - far, abs=1e-14)
    assert orbit.on(cb.Ring(12)).admissibility().far == 1.0
    # without coupling nothing lifts the other sites
    assert asymmetric(0.82, 0.0, 0.8).admissibility().far == pytest.approx(1 - 0.82, abs=1e-14)


def test_a_crest_and_its_mirror_image_between_impacts_are_one_contact() -> None:
    """Of the image rounding was left, which ended curves of the whole period after a few steps."""
    start = cb.symmetric(0.8, 0.05, 0.02, lattice=cb.OpenChain(3), damping=0.02)
    within = {"k": (0.005, 0.1), "a": (0.7, 1.0)}
    ends = []
    for problem in (start.problem, start.unfolded().problem):
        branch = cb.trace(problem, "a", towards="up", within={"a": (0.7, 0.95)})
        curve = cb.boundary(branch.first("GR"), ("k", "a"), within=within)
        ends.append([(point.kind, point["k"], point["a"]) for point in curve.special])
    assert [kind for kind, *_ in ends[0]] == [kind for kind, *_ in ends[1]] == ["EP", "GR-GR"]
    assert np.allclose([end[1:] for end in ends[0]], [end[1:] for end in ends[1]], atol=1e-8)
