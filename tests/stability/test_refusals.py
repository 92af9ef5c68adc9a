"""Questions about multipliers that have no answer, or one in another place; and orders of lists."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from contbreather import stability
from contbreather.errors import BadInput, NotConverged
from contbreather.lattice import InfiniteChain, Ring
from contbreather.stability import counting, unstable_count, unstable_multipliers
from contbreather.stability.chain_map import OrbitMap
from contbreather.stability.characteristic import D, D_gradient
from contbreather.stability.counting import closest_approach
from contbreather.stability.modal_map import ring_map
from contbreather.stability.ring_multipliers import dense_half_map, even_multipliers
from contbreather.stability.saltation import Saltation
from contbreather.stability.verdict import verdict

UNSTABLE = (0.11, 0.8, -0.28657)  # two multipliers of the infinite chain outside


ORBIT = [(0, 0.0, 0.5), (0, 3.0, 0.5)]
REFUSED = [
    # couplings
    *((lambda g=g: stability.G(g, 0.3 - 0.1j), "gamma") for g in (-0.1, 0.25, math.nan, "x")),
    *((lambda g=g: stability.ns_points(g, 0.8), "gamma") for g in (-1e-9, 0.25, 0.3)),
    (lambda: unstable_count(0.3, 0.8, 0.1), "gamma"),
    (lambda: stability.stability(0.25, 0.8, 0.1), "gamma"),
    (lambda: InfiniteChain(0.7).chi(0.08), "must stay below 1"),
    (lambda: InfiniteChain(1.2).chi(0.01), "spring"),
    (lambda: InfiniteChain(-0.1).chi(0.1), "spring"),
    (lambda: closest_approach(0.0, 0.8, 0.3), "gamma = 0: without coupling there is no band to"),
    # losses and entries
    (lambda: unstable_count(0.1, 1.2, 0.1), "restitution"),
    (lambda: even_multipliers(Ring(12), 0.1, -0.1, 0.0), "restitution"),
    (lambda: unstable_count(0.1, "much", 0.1), "real numbers"),
    (lambda: unstable_count(0.1, 0.8, math.nan), "finite"),
    (lambda: stability.stability(0.1, 0.8, math.inf, sites=10), "finite"),
    (lambda: stability.saltation_entry(1.0, 0, 0.8), "w_minus = 0: a finite velocity other than 0"),
    # places
    *(
        (lambda nu=nu, of=of: of(0.1, nu, 0.8, 0.1), "band")
        for nu in (0.0, -0.1, 0.64, 0.7, math.nan)
        for of in (stability.on_arc, stability.scattering)
    ),
    (lambda: D(0.1, 0.0, 0.8, 0.3), "pole"),
    (lambda: stability.G(0.1, np.array([0.2 - 1j, 0.0]), Ring(5)), "pole"),
    *(
        (lambda nu=nu: D_gradient(0.1, nu, 0.8, 0.3, Ring(9)), r"known for \|Im nu\| <= 1 only")
        for nu in (0.4 - 1.001j, 0.4 + 1.001j)
    ),
    # lattices, circles and thresholds
    (lambda: stability.G(0.1, 0.3 - 0.1j, "ring"), "lattice"),
    *((lambda n=n: stability.stability(0.1, 0.8, 0.1, sites=n), "sites") for n in (0, -3, 2.5)),
    *(
        (lambda r=r, on=on: unstable_count(0.1, 0.8, 0.3, on, radius=r), "radius")
        for r in (0.99, 0.9, 0.0, -1.0, math.nan, math.inf, "1")
        for on in (InfiniteChain(), Ring(5))
    ),
    (lambda: unstable_count(0.1, 0.8, 0.1, Ring(40)), "band on that circle"),
    *(
        (lambda x=x: stability.stability(0.1, 0.8, 0.1, sites=40, threshold=x), "threshold")
        for x in (1.0, 0.5, math.inf, math.nan)
    ),
    (
        lambda: verdict(ring_map(Ring(5), 0.1, 0.8, tuple(map(Saltation._make, ORBIT))), 1.0),
        "threshold",
    ),
    (lambda: Ring(10**9), "sites = 1000000000: a ring has at most 10000000"),
    (lambda: dense_half_map(5001, 0.1, 0.8, 0.3), "written down for rings of up to 5000"),
    (lambda: even_multipliers(Ring(10**6), 0.1, 0.8, 0.3), "rings of up to 100000"),
    (lambda: unstable_count(0.1, 0.8, 0.3, Ring(10**6), radius=1.1), "rings of up to 262144"),
    # orbits
    (lambda: OrbitMap(0.1, 0.8, []), "without impacts"),
    (lambda: OrbitMap(0.1, 0.8, ORBIT[::-1]), "in order of time"),
    (lambda: OrbitMap(0.1, 0.8, [(0, 0.0, 0.5), (0, 7.0, 0.5)]), "in order of time"),
    (lambda: OrbitMap(0.1, 0.8, [(0, 0.0, math.nan)]), "finite"),
    (lambda: OrbitMap(0.1, 1.2, ORBIT), r"k = 1\.2"),
    (lambda: OrbitMap(0.1, 0.8, ORBIT, periods=2), "radiates"),
    (lambda: OrbitMap(0.1, 0.8, [*ORBIT[:1], (1, 1.0, 0.5)]).crosses(1.0), "several sites"),
]


@pytest.mark.parametrize(("ask", "says"), REFUSED, ids=lambda one: one if str(one) == one else "")
def test_a_question_without_an_answer_is_refused(ask: Callable[[], object], says: str) -> None:
    with pytest.raises(BadInput, match=says):
        ask()


def test_derivatives_reach_to_the_rim_of_their_domain() -> None:
    for nu in (0.4 - 1.0j, 0.4 - 0.999j):
        found = D_gradient(0.1, nu, 0.8, 0.3, Ring(9))
        assert found.value == pytest.approx(D(0.1, nu, 0.8, 0.3, Ring(9)), rel=1e-12)


@pytest.mark.parametrize("bad", [math.nan, math.inf, "x", None])
@pytest.mark.parametrize(
    ("ask", "name"),
    [
        (lambda bad: stability.D(0.1, bad, 0.8, 0.3), "nu"),
        (lambda bad: stability.D(0.1, 0.3, bad, 0.3), "k"),
        (lambda bad: stability.D_slope(0.1, [0.3, bad], 0.8, 0.3), "nu"),
        (lambda bad: stability.D_slope(0.1, 0.3, 0.8, bad), "b"),
        (lambda bad: stability.D_gradient(0.1, 0.3, 0.8, bad), "b"),
        (lambda bad: stability.G(0.1, bad), "nu"),
        (lambda bad: stability.on_arc(0.1, bad, 0.8, 0.3), "nu"),
        (lambda bad: stability.on_arc(0.1, 0.3, bad, 0.3), "k"),
        (lambda bad: stability.on_arc(0.1, 0.3, 0.8, 0.3, bad), "spring"),
        (lambda bad: stability.scattering(0.1, bad, 0.8, 0.3), "nu"),
        (lambda bad: stability.window(bad, 0.8), "gamma"),
        (lambda bad: stability.window(0.1, bad), "k"),
        (lambda bad: stability.ns_points(0.1, bad), "k"),
        (lambda bad: stability.ns_points(0.1, 0.8, bad), "spring"),
        (lambda bad: closest_approach(0.1, 0.8, 0.3, bad), "spring"),
        (lambda bad: dense_half_map(5, 0.1, 0.8, bad), "b"),
        (lambda bad: stability.apply_half_map(Ring(3), 0.1, bad, 0.3, np.zeros(6)), "k"),
        (lambda bad: stability.saltation(0.8, bad), "b"),
        (lambda bad: stability.saltation_entry(bad, 0.5, 0.8), "acceleration"),
        (lambda bad: stability.saltation_entry(-0.2, bad, 0.8), "w_minus"),
    ],
)
def test_what_is_no_finite_number_is_named(ask, name: str, bad: object) -> None:
    with pytest.raises(BadInput, match=rf"{name} = .*(number|band|expected|lies between)"):
        ask(bad)


def test_next_to_no_coupling_there_is_a_band_to_approach() -> None:
    near = closest_approach(1e-6, 0.8, 0.3)
    assert 0.0 < near.nu < 2e-3
    assert near.distance > 0.0


def test_a_stable_orbit_has_no_multiplier_outside() -> None:
    assert OrbitMap(0.04, 0.8, ORBIT).unstable_multipliers().size == 0


def test_newton_is_held_to_the_winding_number(monkeypatch) -> None:
    assert unstable_count(*UNSTABLE).count == 2
    looks = []

    def nothing(*given: float) -> np.ndarray:
        looks.append(given[-1])
        return np.empty(0, dtype=complex)

    monkeypatch.setattr(counting, "_zeros", nothing)
    with pytest.raises(NotConverged, match=r"the winding number says 2 .* found 0") as caught:
        unstable_multipliers(*UNSTABLE)
    assert looks == sorted(looks)  # each time from more starts
    assert len(looks) >= 3
    assert caught.value.residual > 0.0
    sure = counting.unstable_count
    monkeypatch.setattr(counting, "unstable_count", lambda *at: replace(sure(*at), certain=False))
    assert unstable_multipliers(*UNSTABLE).size == 0  # on the circle to within rounding


def test_more_than_the_winding_number_says_is_cut_to_it(monkeypatch) -> None:
    own = counting._zeros
    real = unstable_multipliers(*UNSTABLE)
    on_circle = np.exp(1j * np.array([0.4, -0.4]))
    monkeypatch.setattr(counting, "_zeros", lambda *at: np.concatenate([own(*at), on_circle]))
    assert unstable_multipliers(*UNSTABLE) == pytest.approx(real)


def test_a_count_that_turns_too_fast_is_refused(monkeypatch) -> None:
    monkeypatch.setattr(counting, "MOST", 100)
    with pytest.raises(NotConverged, match=r"D turns too fast on the circle of radius 1\.0000001"):
        unstable_count(0.1, 0.8, 0.3, Ring(20), radius=1.0 + 1e-7)


@pytest.mark.parametrize("sites", [8, 9, 20, 50])
def test_zeros_a_circle_are_listed_from_the_largest_in_pairs(sites: int) -> None:
    gamma, k, b = UNSTABLE
    whole = np.linalg.eigvals(dense_half_map(sites, gamma, k, b))
    for radius in (1.0025, 1.02):
        found = unstable_multipliers(gamma, k, b, Ring(sites), radius=radius)
        outside = whole[np.abs(whole) > radius]
        assert found.size == outside.size == unstable_count(gamma, k, b, Ring(sites),
                                                            radius=radius).count  # fmt: skip
        assert np.sort(np.abs(found)) == pytest.approx(np.sort(np.abs(outside)), abs=1e-9)
        assert (np.diff(np.abs(found)) <= 1e-9).all()
        complexes = found[found.imag != 0.0]
        assert complexes[1::2] == pytest.approx(complexes[::2].conj())
        assert (complexes[::2].imag > 0.0).all()


def test_on_the_chain_they_are_listed_from_the_largest_in_pairs_too() -> None:
    found = unstable_multipliers(*UNSTABLE)
    assert found.size == 2
    assert found[0] == pytest.approx(found[1].conj(), abs=1e-12)
    assert found[0].imag > 0.0
    assert abs(D(UNSTABLE[0], np.log(found[0]) / (1j * math.pi), *UNSTABLE[1:])) < 1e-10
    larger = unstable_multipliers(*UNSTABLE, radius=float(abs(found[0])) + 1e-6)
    assert larger.size == 0
    assert unstable_multipliers(0.0, 0.8, 1.1)[0].imag == 0.0


@pytest.mark.parametrize(
    ("gamma", "k", "b"), [(0.1, 0.8, 0.1), (0.08, 0.7, -0.05), (0.15, 0.8, 0.3), (0.1, 0.5, 0.3)]
)
def test_the_angle_of_a_count_is_where_the_circle_is_nearest_to_a_zero(gamma, k, b) -> None:
    found = unstable_count(gamma, k, b)
    arc, F, _ = counting.resolved_arc(gamma, k, b)
    size = np.abs(F[1:-1]) / (abs(b) + 1.0)
    if found.distance == pytest.approx(float(size.min()), rel=1e-12):
        assert found.nu == arc.nu[1:-1][int(size.argmin())]
    else:
        assert found.nu in (0.0, 1.0)
        assert found.distance < size.min()
