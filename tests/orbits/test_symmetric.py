"""The symmetric breather against the paper's series at 30 digits and against its own motion."""

from __future__ import annotations

import math
from functools import partial
from itertools import pairwise

import mpmath as mp
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from contbreather.errors import BadInput, NoSolution
from contbreather.lattice import Fourier, Harmonic, InfiniteChain, Ring, Samples, Symbolic
from contbreather.orbits import Closure, smallest_amplitude, symmetric, symmetric_roots
from contbreather.orbits.closed_form import ClosedForm
from contbreather.orbits.orbit import Orbit

CHAIN = InfiniteChain()
upper = partial(symmetric, root=1)  # admissible or not
TWO = Fourier.from_response(cos={1: 1.0, 3: 0.3})
GAMMAS = [0.0, 0.04, 0.12, 0.24, 0.2499]
KS = [0.05, 0.4, 0.8, 0.99]


# -------------------------------------------------------------------- p, phi, chi to 1e-13


@pytest.mark.parametrize("gamma", GAMMAS)
@pytest.mark.parametrize("k", KS)
def test_momentum_and_phase_are_those_of_the_paper(paper, gamma, k):
    lowest = smallest_amplitude(gamma, k)
    for a in (1.001 * lowest, 1.1 * lowest, 0.5 * (lowest + 1.0), 1.0):
        b = upper(a, gamma, k)
        with mp.workdps(30):
            p, phi = paper.root(a, gamma, k)
            assert abs(b.p / p - 1) < 1e-13
            assert abs(b.phi / phi - 1) < 1e-13
            assert abs(b.chi / paper.chi(gamma) - 1) < 1e-15


@pytest.mark.parametrize("above", [1e-4, 1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize(("gamma", "k"), [(0.1, 0.8), (0.2499, 0.05), (0.0, 0.99)])
def test_close_to_the_fold_only_its_conditioning_is_lost(paper, gamma, k, above):
    a = smallest_amplitude(gamma, k) * (1.0 + above)
    b = symmetric(a, gamma, k)
    with mp.workdps(40):
        p, phi = paper.root(a, gamma, k)
        # a relative change e of a moves both by about e/sqrt(2 above)
        allowed = 4e-16 * (1 + 1 / math.sqrt(2 * above))
        assert abs(b.p / p - 1) < allowed
        assert abs(b.phi - phi) < 4 * allowed


def test_the_phase_printed_in_13_is_a_solution_only_for_weak_forcing():
    gamma, k = 0.1, 0.8
    chi, q = CHAIN.chi(gamma), (1 - k) / (1 + k)
    closure = Closure()
    for a, right in ((0.999 * q / chi, True), (1.001 * q / chi, False), (0.6, False)):
        b = symmetric(a, gamma, k)
        printed = -math.asin(b.p * q / a)
        here = {"a": a, "gamma": gamma, "k": k}
        error = np.abs(closure.residual(np.array([b.p, printed]), here)).max()
        assert (error < 1e-12) == right
        assert b.residual < 1e-15


@settings(max_examples=100)
@given(st.floats(0.0, 0.2499), st.floats(0.0, 1.0), st.floats(0.0, 1.5))
def test_both_signs_of_13_solve_the_closure_and_meet_at_the_fold(gamma, k, above):
    a = smallest_amplitude(gamma, k) + above
    assume(a > 1e-6)
    found = symmetric_roots(a, gamma, k)
    assert all(b.residual < 1e-15 * (1 + b.p * b.chi) for b in found)
    assert [b.p for b in found] == sorted((b.p for b in found), reverse=True)
    assert len(found) == (1 if above == 0.0 or a >= 1.0 else 2) or above < 1e-15


# ------------------------------------------------------------------------------- the profile


@pytest.mark.parametrize("n", [0, 1, 10, 300])
@pytest.mark.parametrize(("gamma", "k"), [(0.0, 0.8), (0.12, 0.05), (0.2499, 0.4)])
def test_profile_and_velocity_are_the_paper_s_series_up_to_and_at_the_impacts(paper, gamma, k, n):
    a = 0.5 * (1.0 + smallest_amplitude(gamma, k))
    b = upper(a, gamma, k)
    exact_pi = mp.pi
    with mp.workdps(30):
        p, phi = paper.root(a, gamma, k)
        for shift in (0.0, 1e-9, 1.1, math.pi - 1e-9, math.pi, math.pi + 1e-9, 5.0, -1e-9):
            t = b.phi + shift
            s, sign = mp.mpf(t) - phi, 1
            if abs(s) < 1e-14 or abs(s - exact_pi) < 1e-14:  # at an impact: just after it
                sign, s = (1 if abs(s) < 1 else -1), mp.mpf(10) ** -25
            while s < 0:
                s, sign = s + exact_pi, -sign
            while s > exact_pi:
                s, sign = s - exact_pi, -sign
            v, w = paper.flight(gamma, n, s)
            assert abs(b.displacement(n, t) - (a * mp.cos(t) + sign * p * v)) < 2e-15
            assert abs(b.velocity(n, t) - (-a * mp.sin(t) + sign * p * w)) < 2e-15


def test_shapes_follow_the_arguments():
    b = symmetric(0.5, 0.12, 0.4)
    t = np.linspace(-7.0, 7.0, 11)
    assert isinstance(b.displacement(0, 1.0), float)
    assert isinstance(b.velocity(-3, 1.0), float)
    assert b.displacement(1, t).shape == (11,)
    both = b.displacement(np.arange(-2, 3)[:, None], t)
    assert both.shape == (5, 11)
    for i, n in enumerate(range(-2, 3)):
        np.testing.assert_array_equal(both[i], b.displacement(n, t))
        assert [b.velocity(n, float(x)) for x in t] == pytest.approx(b.velocity(n, t), abs=4e-16)


@settings(max_examples=60)
@given(st.floats(0.0, 0.2499), st.floats(0.0, 1.0), st.integers(-40, 40), st.floats(-50.0, 50.0))
def test_every_site_is_antisymmetric_and_the_breather_even_in_space(gamma, k, n, t):
    b = symmetric(max(0.9, smallest_amplitude(gamma, k)), gamma, k)
    u = b.displacement(n, t)
    assert u == pytest.approx(-b.displacement(n, t + math.pi), abs=2e-14 * (1 + b.incoming[0]))
    assert u == b.displacement(-n, t)


@pytest.mark.parametrize("forcing", [Harmonic(), TWO, Symbolic("-cos(t)/(1+e*cos(2*t))", e=0.4)])
@pytest.mark.parametrize("lattice", [CHAIN, Ring(1), Ring(2), Ring(5)])
def test_profile_obeys_equation_1_between_impacts(forcing, lattice):
    """Second differences of the positions, the neighbours and the force."""
    b = symmetric(0.9, 0.2, 0.5, forcing=forcing, lattice=lattice)
    h = 1e-3
    t = b.phi + np.linspace(0.1, math.pi - 0.1, 9)
    for n in (0, 1, 2, 3):
        near = [b.displacement(n, t + j * h) for j in (-2, -1, 0, 1, 2)]
        bend = (-near[0] + 16 * near[1] - 30 * near[2] + 16 * near[3] - near[4]) / (12 * h * h)
        stretch = 2 * near[2] - b.displacement(n - 1, t) - b.displacement(n + 1, t)
        force = b.a * forcing.d2f(t)
        np.testing.assert_allclose(bend + b.gamma * stretch, force, atol=2e-8)


# --------------------------------------------------------------------------- general forcing


def test_two_harmonics_have_four_roots_right_to_thirty_digits(paper):
    found = symmetric_roots(0.3, 0.12, 0.7, forcing=TWO)
    assert len(found) == 4
    with mp.workdps(30):
        chi, q, a = paper.chi(0.12), (1 - mp.mpf(0.7)) / (1 + mp.mpf(0.7)), mp.mpf(0.3)
        third = mp.mpf(TWO.harmonics[1][1])
        for b in found:
            p, phi = mp.findroot(
                lambda p, x: [
                    p * chi + a * (mp.cos(x) + third * mp.cos(3 * x)) - 1,
                    -a * (mp.sin(x) + 3 * third * mp.sin(3 * x)) - p * q,
                ],
                (b.p, b.phi),
            )
            assert abs(b.p / p - 1) < 1e-13
            assert abs(b.phi / phi - 1) < 1e-13
    best = symmetric(0.3, 0.12, 0.7, forcing=TWO)
    assert best == found[0]
    assert best.p == pytest.approx(0.669089966883616, abs=1e-14)
    assert best.phi == pytest.approx(-3.03379882172877, abs=1e-14)


def signs(forcing, a, gamma, k):
    """The reduced equation at many phases, and the momenta where its sign changes."""
    chi, q = CHAIN.chi(gamma), (1 - k) / (1 + k)
    phi = np.linspace(-math.pi, math.pi, 40001)
    reduced = a * (chi * forcing.df(phi) + q * forcing.f(phi)) - q
    at = np.flatnonzero(reduced[:-1] * reduced[1:] < 0)
    return reduced, (1 - a * forcing.f(phi[at])) / chi


@pytest.mark.slow
@settings(max_examples=60)
@given(
    st.floats(0.0, 0.24),
    st.floats(0.02, 0.98),
    st.floats(0.1, 1.0),
    st.lists(st.floats(-0.6, 0.6), min_size=4, max_size=4),
)
def test_no_root_of_a_general_forcing_is_missed_or_invented(gamma, k, a, c):
    """Counted by the sign changes of the reduced equation on a dense grid."""
    forcing = Fourier.from_response(cos={1: 1.0, 3: c[0], 7: c[1] / 4}, sin={3: c[2], 5: c[3] / 2})
    reduced, impact = signs(forcing, a, gamma, k)
    rate = np.abs(np.diff(reduced)).max()
    crest = (reduced[1:-1] - reduced[:-2]) * (reduced[2:] - reduced[1:-1]) <= 0
    assume(np.abs(reduced[1:-1][crest]).min() > rate)  # no double root to quarrel about
    assume(impact.size == 0 or np.abs(impact).min() > 1e-2)
    count = int(np.sum(impact > 0))
    try:
        found = symmetric_roots(a, gamma, k, forcing=forcing)
    except NoSolution:
        found = ()
    assert len(found) == count
    assert [b.p for b in found] == sorted((b.p for b in found), reverse=True)
    # rounding is as large as the terms that cancel
    assert all(b.residual < 1e-14 * (1.0 + abs(reduced).max()) for b in found)


@pytest.mark.parametrize("gamma", [0.0, 0.2])
@pytest.mark.parametrize("a", [0.9, 1.0 - 1e-6, 1.0 - 1e-12])
def test_the_lower_branch_is_right_down_to_where_its_impacts_die(paper, gamma, a):
    lower = symmetric_roots(a, gamma, 0.6)[1]
    with mp.workdps(60):  # the arccosine of nearly 1 costs half of them
        p, phi = paper.root(a, gamma, 0.6, upper=False)
        assert abs(lower.p / p - 1) < 4e-16
        assert abs(lower.phi / phi - 1) < 4e-16


SAME = Fourier(cos={1: -1.0, 3: 0.0})  # the harmonic one, by the general road
EXACT = [Harmonic(), SAME, TWO, Fourier(cos={1: -1.0, 5: 4.0}, sin={3: 2.0})]
FAINT = Fourier(cos={1: -1.0, 3: -2.7, 31: 1e-11})  # its last one is all but nothing
# a rounded square wave from samples, its harmonics far beyond a companion matrix
SQUARE = Samples(-np.tanh(6 * np.cos(2 * np.pi * np.arange(2048) / 2048)))
PLACES = [(0.1, 0.8), (0.1, 0.6), (0.2499, 0.05), (0.0, 0.3), (0.2, 0.0)]


@pytest.mark.parametrize("forcing", [*EXACT, FAINT, SQUARE])
@pytest.mark.parametrize(("gamma", "k"), PLACES)
def test_the_fold_is_the_smallest_amplitude_and_a_double_root(forcing, gamma, k):
    lowest = smallest_amplitude(gamma, k, forcing)
    at = symmetric_roots(lowest, gamma, k, forcing=forcing)
    assert len(at) == 1
    here = {"a": lowest, "gamma": gamma, "k": k}
    jacobian = Closure(forcing).jacobian(np.array([at[0].p, at[0].phi]), here)
    assert abs(np.linalg.det(jacobian)) < 1e-13
    assert len(symmetric_roots(lowest * (1 + 1e-12), gamma, k, forcing=forcing)) >= 2
    with pytest.raises(NoSolution, match="below the fold") as refusal:
        symmetric(lowest * (1 - 1e-12), gamma, k, forcing=forcing)
    assert repr(lowest) in str(refusal.value)


@settings(max_examples=50)
@given(
    st.floats(0.0, 0.2499),
    st.floats(0.0, 1.0),
    st.floats(1.0 + 1e-9, 60.0),
    st.lists(st.floats(-1.0, 1.0), min_size=3, max_size=3),
)
def test_above_the_fold_there_is_always_a_breather(gamma, k, times, c):
    forcing = Fourier.from_response(cos={1: 1.0, 5: c[0] / 3}, sin={3: c[1], 9: c[2] / 5})
    a = max(smallest_amplitude(gamma, k, forcing), 1e-3) * times
    b = symmetric(a, gamma, k, forcing=forcing)
    assert b.p > 0
    # phi is a float: its last bit moves a f' by eps |phi| a |F|
    strongest = np.abs(forcing.d2f(np.linspace(0, math.pi, 200))).max()
    assert b.residual < 1e-15 * (1 + a * strongest)


@pytest.mark.parametrize(("forcing", "a"), [(SQUARE, 0.5), (FAINT, 0.3)])
def test_forcing_with_many_harmonics_or_a_faint_one_is_solved_too(forcing, a):
    assert forcing.highest > 30
    _, impact = signs(forcing, a, 0.1, 0.6)
    found = symmetric_roots(a, 0.1, 0.6, forcing=forcing)
    assert len(found) == np.sum(impact > 0)
    assert all(b.residual < 1e-14 for b in found)


# ------------------------------------------------------------------------------------ lattices


def test_state_on_a_ring_is_the_ring_s_own_breather():
    chain = symmetric(0.6, 0.2, 0.6)
    ring = symmetric(0.6, 0.2, 0.6, lattice=Ring(5))
    assert abs(chain.p - ring.p) > 1e-3
    for t in (0.0, ring.phi, 2.2):
        u, v = chain.state(5, t)
        assert u.shape == v.shape == (5,)
        np.testing.assert_allclose(u, [ring.displacement(n, t) for n in range(5)], rtol=1e-15)
        np.testing.assert_allclose(v, [ring.velocity(n, t) for n in range(5)], rtol=1e-15)
        np.testing.assert_array_equal(np.stack([u, v]), np.stack(ring.state(5, t)))


def test_state_of_the_lower_branch_stays_on_the_lower_branch():
    upper, lower = symmetric_roots(0.5, 0.12, 0.4)
    expected = symmetric_roots(0.5, 0.12, 0.4, lattice=Ring(20))[1]
    assert lower.on(Ring(20)) == expected
    assert lower.on(CHAIN) is lower
    assert upper.on(Ring(20)).p > lower.on(Ring(20)).p


# ---------------------------------------------------------------------------------- the edge


def test_the_rim_of_the_domain_works():
    stick = symmetric(0.9, 0.1, 0.0)
    assert stick.velocity(0, stick.phi) == pytest.approx(0.0, abs=1e-15)
    elastic = symmetric(0.4, 0.1, 1.0)
    assert elastic.p == pytest.approx(1.4 / elastic.chi, rel=1e-15)
    assert abs(elastic.phi) == pytest.approx(math.pi, abs=1e-15)
    free = symmetric(0.5, 0.0, 0.8)
    assert free.displacement(7, 0.3) == pytest.approx(0.5 * math.cos(0.3), abs=1e-16)
    for k in (0.0, 1.0):
        for gamma in (0.0, 0.2499):
            for b in symmetric_roots(1.0, gamma, k):
                assert b.residual < 1e-14
    assert len(symmetric_roots(1e-9, 0.1, 1.0)) == 2  # without losses any forcing will do


LATTICES = ({}, {"lattice": Ring(33)}, {"lattice": Ring(12), "spring": 1e-3})  # the last by modes


@pytest.mark.parametrize("on", LATTICES)
def test_the_breather_is_the_largest_root_that_is_admissible(on):
    for a, gamma in ((0.5, 0.1), (0.79, 0.2), (0.95, 0.05), (0.3, 0.12)):
        found = symmetric_roots(a, gamma, 0.8, **on)
        admissible = [one for one in found if one.admissibility().ok]
        assert symmetric(a, gamma, 0.8, **on).p == admissible[0].p
        for i, one in enumerate(found, start=1):
            assert symmetric(a, gamma, 0.8, root=i, **on).p == one.p
    upper, lower = symmetric_roots(0.79, 0.2, 0.8, **on)
    assert not upper.admissibility().ok
    assert symmetric(0.79, 0.2, 0.8, **on).p == lower.p


def test_where_no_root_is_admissible_the_largest_says_why():
    (found,) = symmetric_roots(1.2, 0.1, 0.8)
    assert symmetric(1.2, 0.1, 0.8).p == found.p
    assert not symmetric(1.2, 0.1, 0.8).admissibility().ok


@pytest.mark.parametrize("root", [0, 3, 1.5, "upper"])
def test_a_root_that_is_not_there_is_refused_with_those_that_are(root):
    with pytest.raises(BadInput, match=r"the solutions of \(11\) are 1: p = .*, 2: p = "):
        symmetric(0.5, 0.1, 0.8, root=root)


@pytest.mark.parametrize("forcing", [Harmonic(), TWO, Fourier(cos={1: -1.0, 3: -2.0, 5: 3.0})])
def test_no_lower_breather_is_stable_and_families_alternate(forcing):
    for a in np.linspace(0.2, 0.9, 8) / forcing.peak():
        found = sorted(symmetric_roots(a, 0.12, 0.7, forcing=forcing), key=lambda b: b.phi)
        families = [b.representation.family for b in found]
        assert all(one != other for one, other in pairwise(families))
        for b in found:
            assert b.representation.family == "upper" or b.stability().unstable >= 1


# ------------------------------------------------------------------------------------- errors


GOOD = {"a": 0.5, "gamma": 0.12, "k": 0.4}


def test_a_breather_put_together_by_hand_says_how_wrong_it_is():
    assert Orbit(ClosedForm(**GOOD, p=0.68, phi=-2.5)).residual > 1e-3


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"gamma": 0.25}, "gamma"),
        ({"gamma": -1e-12}, "gamma"),
        ({"gamma": math.nan}, "gamma"),
        ({"k": 1.0 + 1e-12}, "k <= 1"),
        ({"k": math.nan}, "k <= 1"),
        ({"a": math.inf}, "finite"),
    ],
)
def test_the_kernels_of_the_continuation_refuse_what_lies_beyond_the_rim(change, says):
    closure, x = Closure(), np.array([0.68, -2.5])
    params = {"a": 0.5, "gamma": 0.12, "k": 0.4} | change
    for kernel in (
        closure.residual,
        closure.jacobian,
        lambda x, params: closure.sensitivity(x, params, "a"),
    ):
        with pytest.raises(BadInput, match=says):
            kernel(x, params)


def test_the_kernels_refuse_what_is_not_finite_or_unknown():
    closure, params = Closure(TWO), {"a": 0.5, "gamma": 0.12, "k": 0.4}
    with pytest.raises(BadInput, match="finite"):
        closure.residual(np.array([math.nan, 0.0]), params)
    with pytest.raises(BadInput, match=r"unknown forcing parameter 'c9'.*c1, c3"):
        closure.sensitivity(np.array([0.6, 0.0]), params, "c9")


def test_a_state_of_many_sites_is_that_of_each():
    """Of more than are written down at once; beyond 18 bonds only the first harmonic is left."""
    b = symmetric(0.2, 0.2, 0.8, lattice=Ring(6001))
    state, sites = np.array(b.state(t=0.3)), [0, 1, 18, 19, 4095, 4096, 5990, 6000]
    each = [[one(n, 0.3) for n in sites] for one in (b.displacement, b.velocity)]
    np.testing.assert_allclose(state[:, sites], each, rtol=1e-15)
    far = 0.2 * np.array([Harmonic().f(0.3), Harmonic().df(0.3)])
    np.testing.assert_allclose(state[:, 3000], far, rtol=1e-15)
