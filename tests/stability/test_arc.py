"""Neimark-Sacker points of the infinite chain: two equations on the arc, and their solutions."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from contbreather.stability import ns_points
from contbreather.stability.one_impact import window
from tests.stability.by_hand import b_of, slope
from tests.stability.half import D, on_arc, unstable_count


def test_the_two_equations_are_D_without_its_poles():
    for gamma, k, b in [(0.1, 0.8, 0.1), (0.2, 0.3, -2.0), (0.01, 0.0, 0.5)]:
        edge = 2 * math.sqrt(gamma)
        nu = edge * np.linspace(0.02, 0.98, 25)
        value = D(gamma, nu, k, b) * nu * np.sqrt(4 * gamma - nu**2)
        found = [on_arc(gamma, float(one), k, b).value for one in nu]
        np.testing.assert_allclose(found, value, atol=1e-13)


@pytest.mark.parametrize(
    "at", [(0.1, 0.4, 0.8, 0.1), (0.22, 0.9, 0.3, -1.4), (0.02, 0.05, 1.0, 0.3)]
)
def test_the_jacobian_on_the_arc_is_that_of_finite_differences(at):
    exact = on_arc(*at)
    for name, direction in zip(("d_gamma", "d_nu", "d_k", "d_b"), np.eye(4), strict=True):
        wanted = slope(lambda e, along=direction: on_arc(*(np.array(at) + e * along)).value, 1e-4)
        np.testing.assert_allclose(getattr(exact, name), wanted, rtol=1e-8, atol=1e-9, err_msg=name)


@pytest.mark.parametrize(
    ("a", "k", "gamma", "nu"),
    [  # theory section 3, here from its shifted path with 30 digits (600 nodes, h = 0.4 and 0.5)
        (0.2, 0.8, 0.096970946606878851, 0.55807871008107372),
        (0.5, 0.8, 0.11443142093956957, 0.42132882906363460),
        (0.2, 0.4, 0.17639129022626295, 0.67638791079194071),
    ],
)
def test_the_points_of_theory_are_found_by_their_explicit_b(a, k, gamma, nu):
    def gap(coupling: float) -> float:
        wanted = b_of(a, coupling, k)
        return min((point.b - wanted for point in ns_points(coupling, k)), key=abs)

    root = brentq(gap, gamma - 1e-4, gamma + 1e-4, xtol=1e-16)
    assert root == pytest.approx(gamma, abs=1e-14)
    angle = min(ns_points(root, k), key=lambda p: abs(p.b - b_of(a, root, k))).nu
    assert angle == pytest.approx(nu, abs=1e-13)
    below, above = (unstable_count(g, k, b_of(a, g, k)).count for g in (root - 1e-9, root + 1e-9))
    assert (below, above) == (0, 2)


def test_two_points_about_to_meet_are_still_told_apart():
    # at gamma = 0.1 they meet at k = 0.78176...
    k = brentq(lambda k: len(ns_points(0.1, k)) - 1, 0.77, 0.79, xtol=1e-12)
    nu = [point.nu for point in ns_points(0.1, k + 1e-9)]
    assert len(nu) == 2
    assert 0 < nu[1] - nu[0] < 1e-3
    assert ns_points(0.1, k - 1e-9) == ()


def test_without_coupling_or_losses_there_is_no_neimark_sacker_point():
    assert ns_points(0.0, 0.5) == ()
    assert ns_points(0.1, 1.0) == ()


# --- the window of b ------------------------------------------------------------------------------


RANDOM = np.random.default_rng(3)
PLACES = [(0.24 * x + 1e-3, y) for x, y in RANDOM.random((40, 2))]
# a pair of roots just opened, or not yet, between two nodes of the grid
# where two roots have met, to seven digits of k, and opened: both between two nodes
PLACES += [(0.1, 0.781761944709733 + 1e-7), (0.1, 0.781761944709733 + 1e-5)]
PLACES += [(0.0969, 0.8), (0.09514, 0.8), (0.0951, 0.8), (1e-6, 0.9), (0.2499, 0.5)]


@pytest.mark.parametrize(("gamma", "k"), PLACES)
def test_the_window_of_b_in_which_a_pair_is_outside_ends_where_f_vanishes(gamma: float, k: float):
    found, points = window(gamma, k), ns_points(gamma, k)
    if found.square < 0.0:
        assert points == ()
        return
    low, high = sorted(points, key=lambda point: point.b)
    assert (found.low, found.high) == (low.nu, high.nu)
    for nu, b in points:
        assert abs(found.miss(b)) < 1e-13 * (1.0 + abs(found.centre))
        F = on_arc(gamma, nu, k, b)
        assert abs(F.value) < 1e-13 * (1.0 + abs(b)) + 4e-16 * abs(F.d_nu)
