"""Margins of orbits: those of the symmetric breather where both apply, brute force elsewhere."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from contbreather.lattice import Fourier, InfiniteChain, Ring
from contbreather.orbits import centre_margin, highest_neighbour, symmetric, symmetric_roots
from contbreather.orbits.constructors import asymmetric
from contbreather.orbits.orbit import Orbit, orbit_of
from contbreather.orbits.section import Section

from .by_hand import orbit_from


@pytest.mark.parametrize("lattice", [InfiniteChain(), Ring(1), Ring(2), Ring(5), Ring(40)])
def test_of_a_symmetric_breather_they_are_its_own(lattice):
    rng = np.random.default_rng(5)
    seen = set()
    for _ in range(12):
        gamma, k, a = rng.uniform(0, 0.24), rng.choice([0.0, 0.05, 0.5, 0.9]), rng.uniform(0.5, 1.2)
        forcing = Fourier(cos={1: -1.0, 3: rng.uniform(-1, 1)})
        for b in symmetric_roots(a, gamma, k, forcing=forcing, lattice=lattice)[:2]:
            wanted, found = b.admissibility(), b.unfolded().admissibility()
            seen.add(found.ok)
            assert found.ok == wanted.ok
            assert found.neighbours == pytest.approx(wanted.neighbours, abs=1e-12)
            assert found.centre == pytest.approx(wanted.centre, abs=1e-10)
            assert found.far == pytest.approx(wanted.far, abs=1e-12)
    assert seen == {True, False}


def test_a_dip_between_the_last_of_the_grid_and_an_impact_is_found_at_its_bottom() -> None:
    forcing = Fourier(cos={1: -1.0, 3: 1.8}, sin={3: -1.5})
    for k in np.linspace(0.6, 0.95, 8).tolist():
        b = symmetric(0.45, 0.2, k, forcing=forcing)
        wanted = b.admissibility()
        since = wanted.places["centre"][1] - b.phi
        assert 0.9 * math.pi < since < math.pi - 1e-3
        found = b.unfolded().admissibility()
        site, time = found.places["centre"]
        assert site == 0
        assert (time - b.phi) % math.pi == pytest.approx(since, abs=1e-7)
        assert found.centre == pytest.approx(wanted.centre, abs=1e-12)


def brute(orbit, reach=40):
    """Highest |u| of all idle sites by dense sampling."""
    ring = orbit.lattice.sites
    sites = range(-reach, reach) if ring is None else range(ring)
    idle = [n for n in sites if n not in orbit.section.hit]
    t = np.linspace(0, orbit.period, 4001)
    return max(float(np.abs(orbit.displacement(n, t)).max()) for n in idle)


def test_the_highest_idle_site_is_found_among_all():
    beyond = asymmetric(1.1, 0.1, 0.5, inadmissible=True)
    orbits = [asymmetric(0.82, 0.04, 0.8), beyond.on(Ring(7))]
    b = symmetric(0.5, 0.2, 0.8, root=1)
    for bonds in (1, 2, 6):
        # the margins do not ask whether it solves anything
        guess = orbit_of(
            b.conditions,
            Section(((0, 1), (bonds, -1), (0, -1), (bonds, 1))),
            [b.phi, b.phi + 0.01, b.phi + math.pi, b.phi + math.pi + 0.01],
            [-2 * b.p, 2 * b.p, 2 * b.p, -2 * b.p],
        )
        orbits.append(guess)
    for orbit in orbits:
        site, time, height = highest_neighbour(orbit)
        assert height == pytest.approx(brute(orbit), abs=1e-5)
        assert height >= brute(orbit) - 1e-12
        assert abs(orbit.displacement(site, time)) == pytest.approx(height, abs=1e-12)
        assert abs(orbit.velocity(site, time)) < 1e-9


def test_a_ring_in_resonance_looks_at_every_site():
    impacts = [(0, 1, 0.0, -1.0), (0, -1, 3.0, 0.8), (0, 1, 6.5, -0.7), (0, -1, 9.0, 0.9)]
    orbit = orbit_from(impacts, turns=2, gamma=0.2, lattice=Ring(30))
    assert len(orbit.motion.idle) == 15  # of two alike one
    assert highest_neighbour(orbit)[2] == pytest.approx(brute(orbit), abs=1e-4)


def test_motion_is_displacement_velocity_and_acceleration():
    orbit = asymmetric(0.82, 0.04, 0.8)
    for site in (0, 1, -4, 300):
        values = orbit.motion.at(site, 1.7)
        exact = (orbit.displacement, orbit.velocity, orbit.acceleration)
        assert values == pytest.approx([of(site, 1.7) for of in exact], abs=1e-14)


def test_far_field_carries_the_offset():
    orbit = asymmetric(0.82, 0.04, 0.8)
    far = 1 - 0.82 - abs(orbit.c)
    assert orbit.admissibility().far == pytest.approx(far, abs=1e-14)
    when = orbit.admissibility().places["far"][1]
    assert abs(orbit.displacement(300, when)) == pytest.approx(1 - far, abs=1e-14)
    assert orbit.on(Ring(12)).admissibility().far == 1.0
    # without coupling nothing lifts the other sites
    assert asymmetric(0.82, 0.0, 0.8).admissibility().far == pytest.approx(1 - 0.82, abs=1e-14)


def test_an_orbit_through_its_own_wall_is_called_none():
    # small k: the site is pushed back onto the wall it has just left
    orbit = symmetric(0.99, 0.0, 0.02, root=1).unfolded()
    verdict = orbit.admissibility()
    assert not verdict
    assert verdict.site == 0
    assert "no breather: site 0 between its impacts" in verdict.reason
    t = np.linspace(orbit.impacts[0].time, orbit.impacts[1].time, 2001)[1:-1]
    assert np.abs(orbit.displacement(0, t)).max() > 1


def test_an_impact_that_loses_its_velocity_is_a_limit():
    good = asymmetric(0.82, 0.04, 0.8)
    first, second = good.impacts
    margins = []
    for speed in (1.0, 0.1, 0.001):
        slow = first._replace(impulse=speed * first.impulse)
        weak = Orbit(replace(good.representation, impacts=(slow, second)))
        margins.append(centre_margin(weak))
    assert margins[0] > 0.5
    assert margins[2] < 0.01


def test_margins_are_continuous_along_an_arm():
    from contbreather.continuation import Steps, trace
    from contbreather.continuation.switching import switch

    start = symmetric(0.7, 0.04, 0.8)
    point = trace(start, "a", towards="up", within={"a": (0.7, 0.8)}).first("PF")
    arm = switch(point, steps=Steps(largest=0.01))[0]
    margins = np.array([point.solution.admissibility().margin for point in arm])
    assert np.abs(np.diff(margins)).max() < 0.02
    assert margins[0] > 0.1
    assert abs(margins[-1]) < 1e-12
