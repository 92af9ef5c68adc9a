"""A verdict names its chain and its threshold."""

from __future__ import annotations

import math

import numpy as np
import pytest

from contbreather.lattice import Ring
from contbreather.stability import ns_points, saltation, saltation_entry, stability
from tests.stability.by_hand import b_of, slope
from tests.stability.half import half_multipliers


@pytest.mark.parametrize(("sites", "gamma"), [(200, 0.0824), (400, 0.0916)])
def test_the_papers_rule_is_about_multipliers_over_the_whole_period(sites, gamma):
    """It is passed where the paper says so, to its four digits."""
    for coupling, passed in ((gamma - 5e-5, True), (gamma + 5e-5, False)):
        verdict = stability(coupling, 0.8, b_of(0.2, coupling, 0.8), sites=sites)
        assert verdict.stable == (verdict.largest <= 1.005) == passed


def test_a_verdict_says_what_it_is_about():
    chain = stability(0.11, 0.8, -0.28657)
    assert "infinite chain: unstable, 2 multipliers of QS" in repr(chain)
    assert "infinite chain: stable" in stability(0.08, 0.8, 0.468).describe()
    assert "amplified" in stability(0.08, 0.8, 0.468).describe()
    ring = stability(0.11, 0.8, -0.28657, sites=400, threshold=1.01)
    assert "ring of 400: unstable" in repr(ring)
    assert "1.01" in repr(ring)
    assert repr(stability(0.05, 0.8, 0.9, Ring(100))).startswith("<ring of 100: stable")
    nu, b = ns_points(0.12, 0.8)[0]
    assert f"rounding, at the angle {nu:.6g} pi" in stability(0.12, 0.8, b).describe()


@pytest.mark.parametrize(("a", "gamma"), [(0.8, 0.05), (0.8, 0.045)])
def test_rows_of_a_verdict_are_what_their_names_say(a, gamma):
    """Of nothing where an impact vanishes; the infinite chain has no threshold."""
    b = b_of(a, gamma, 0.8)
    chain, ring = stability(gamma, 0.8, b), stability(gamma, 0.8, b, sites=20)
    for verdict, mu, threshold in (
        (chain, chain.map.unstable_multipliers(), 1.0),
        (ring, half_multipliers(Ring(20), gamma, 0.8, b) ** 2, 1.005),
    ):
        beyond = mu[np.abs(mu) > threshold]
        which = "outside the threshold" if verdict is ring else "of QS outside the unit circle"
        rows = [
            ("lattice", verdict.lattice),
            ("stable", "no" if beyond.size else "yes"),
            (f"multipliers {which}", beyond.size),
        ]
        amplified = [("waves come back amplified", "yes" if chain.over_reflecting else "no")]
        if verdict is ring:
            largest = pytest.approx(np.abs(mu).max())
            rows += [("threshold", 1.005), ("largest |multiplier|", largest)]
        each = [(f"multiplier {i}", pytest.approx(one)) for i, one in enumerate(beyond, 1)]
        assert verdict.table().rows == rows + (amplified if verdict is chain else []) + each
        known = {"threshold": 1.005, "lattice": verdict.lattice}
        assert verdict.blank().table().rows == [(name, known.get(name)) for name, _ in rows]


def test_short_rings_have_no_neutral_modes_to_stop_at():
    assert stability(0.1, 0.3, 0.1, sites=1).largest < 1
    assert stability(0.1, 0.3, 0.35, sites=3).largest == 1.0


def bounced(u: float, v: float, acceleration: float, wall: float, k: float, time: float):
    """State at `time` of a mass under constant acceleration that meets a wall once before."""
    root = math.sqrt(v * v + 2 * acceleration * (wall - u))
    hit = 2 * (wall - u) / (v + root)
    after = -k * root
    rest = time - hit
    return np.array([wall + after * rest + acceleration * rest**2 / 2, after + acceleration * rest])


def test_the_saltation_block_is_the_derivative_of_a_flight_through_an_impact():
    acceleration, k, time = -0.4, 0.7, 0.5
    start = np.array([0.7, 1.5])
    columns = [
        slope(lambda e, x=x: bounced(*(start + e * x), acceleration, 1.0, k, time), 1e-4)
        for x in np.eye(2)
    ]
    w_minus = math.sqrt(1.5**2 + 2 * acceleration * 0.3)
    hit = (w_minus - 1.5) / acceleration
    before, after = (np.array([[1.0, t], [0.0, 1.0]]) for t in (hit, time - hit))
    block = saltation(k, saltation_entry(acceleration, w_minus, k))
    np.testing.assert_allclose(np.array(columns).T, after @ block @ before, atol=1e-10)
    assert np.linalg.det(block) == pytest.approx(k * k)
