"""The paper's rule, against dense eigenvalues of the monodromy matrix (20)."""

from __future__ import annotations

import numpy as np
import pytest

import contbreather as cb
from contbreather.errors import BadInput, NotConverged
from contbreather.orbits import Orbit, neighbour_peak, smallest_amplitude
from contbreather.paper.threshold import neimark_sacker_line, neimark_sacker_point, pitchfork_line
from tests.stability.by_hand import paper_matrix

SITES, THRESHOLD = 40, 1.02  # a short ring: its dense matrix is quick


def monodromy_eigenvalues(breather: Orbit, sites: int) -> np.ndarray:
    half = paper_matrix(sites, breather.gamma, breather.k, breather.b)
    return np.linalg.eigvals(half @ half)


def largest_pair(a: float, gamma: float, k: float) -> float:
    mu = monodromy_eigenvalues(cb.symmetric(a, gamma, k), SITES)
    return float(np.abs(mu[np.abs(mu.imag) > 1e-6]).max())


@pytest.mark.parametrize(("a", "k"), [(0.2, 0.8), (0.6, 0.8), (0.3, 0.4)])
def test_at_the_crossing_a_pair_first_has_the_modulus_of_the_threshold(a: float, k: float) -> None:
    found = neimark_sacker_point(a, k, sites=SITES, threshold=THRESHOLD)
    assert largest_pair(a, found.gamma, k) == pytest.approx(THRESHOLD, abs=1e-10)
    before = np.linspace(0.01, found.gamma - 1e-6, 30)
    assert max(largest_pair(a, gamma, k) for gamma in before) < THRESHOLD
    assert largest_pair(a, found.gamma + 1e-6, k) > THRESHOLD


def test_angle_of_the_crossing_is_that_of_the_largest_multiplier() -> None:
    found = neimark_sacker_point(0.2, 0.8, sites=SITES, threshold=THRESHOLD)
    mu = monodromy_eigenvalues(cb.symmetric(0.2, found.gamma, 0.8), SITES)
    top = mu[np.abs(mu).argmax()]
    assert np.cos(2 * np.pi * found.angle) == pytest.approx(top.real / abs(top), abs=1e-8)


@pytest.mark.slow
def test_long_rings_tend_to_the_isolated_pair_at_the_threshold() -> None:
    """So the rule does not converge to the point where the pair comes out, but passes it."""
    limit = neimark_sacker_point(0.2, 0.8, sites=None).gamma
    breather = cb.symmetric(0.2, limit, 0.8)
    assert np.abs(breather.stability().multipliers) ** 2 == pytest.approx([1.005] * 2, abs=1e-9)
    assert neimark_sacker_point(0.2, 0.8, sites=2000).gamma == pytest.approx(limit, abs=1e-6)
    assert limit > 0.0969711 > neimark_sacker_point(0.2, 0.8, sites=800).gamma


@pytest.fixture(scope="module")
def line():
    return neimark_sacker_line(0.8, points=3, sites=100)


@pytest.mark.slow
def test_every_point_of_the_line_is_on_the_threshold(line) -> None:
    largest = [
        cb.symmetric(float(a), float(gamma), line.k).stability(sites=line.sites).largest
        for a, gamma in zip(line.a, line.gamma, strict=True)
    ]
    assert largest[1:] == pytest.approx([1.005] * 2, abs=1e-11)
    # The first is on the fold: there the phase goes as the root of a, known to rounding.
    assert largest[0] == pytest.approx(1.005, abs=2e-8)


def test_line_runs_from_the_fold_to_the_grazing_of_the_neighbour(line) -> None:
    assert line.a[0] == pytest.approx(smallest_amplitude(line.gamma[0], line.k), abs=1e-12)
    end = cb.symmetric(float(line.a[-1]), float(line.gamma[-1]), line.k)
    assert neighbour_peak(end)[1] == pytest.approx(1.0, abs=1e-10)
    for a, gamma in zip(line.a[1:-1], line.gamma[1:-1], strict=True):
        assert cb.symmetric(float(a), float(gamma), line.k).admissibility().ok


def test_rule_gives_the_verdicts_of_the_simulations_in_section_4() -> None:
    """k = 0.8, gamma = 0.104: a = 0.1 and 0.7 keep the breather, a = 0.2 loses it."""
    critical = {a: neimark_sacker_point(a, 0.8).gamma for a in (0.1, 0.2, 0.7)}
    assert [critical[a] > 0.104 for a in (0.1, 0.2, 0.7)] == [True, False, True]


def test_pitchfork_line_is_where_a_real_eigenvalue_is_the_threshold() -> None:
    line = pitchfork_line(0.8, [0.0, 0.03, 0.07], sites=SITES, threshold=THRESHOLD)
    for a, gamma in zip(line.a, line.gamma, strict=True):
        breather = cb.symmetric(float(a), float(gamma), 0.8)
        mu = monodromy_eigenvalues(breather, SITES)
        real = mu[np.abs(mu.imag) < 1e-9].real
        assert np.abs(real - THRESHOLD).min() < 1e-9


def test_pitchfork_line_hardly_depends_on_the_ring_as_the_paper_says() -> None:
    short, long = (pitchfork_line(0.8, [0.05], sites=n).a[0] for n in (400, 800))
    exact = 1.0 / (cb.InfiniteChain().chi(0.05) - 2.0 * cb.InfiniteChain().sigma(0.05))
    exact *= np.hypot(0.2 / 1.8, 2.0 * cb.InfiniteChain().sigma(0.05))
    assert short == pytest.approx(long, rel=1e-3)
    assert short == pytest.approx(exact, rel=1e-3)


def test_where_no_pair_reaches_a_threshold_there_is_no_crossing() -> None:
    with pytest.raises(NotConverged, match="no pair of multipliers reaches the modulus 50 below"):
        neimark_sacker_point(0.2, 0.8, sites=SITES, threshold=50.0)


@pytest.mark.parametrize("threshold", [1.0, 0.9, float("nan"), float("inf")])
def test_threshold_must_be_above_one(threshold: float) -> None:
    with pytest.raises(BadInput, match="a finite threshold above 1 is expected"):
        neimark_sacker_point(0.2, 0.8, threshold=threshold)


def test_repr_of_a_line_is_one_line_and_names_its_chain() -> None:
    line = pitchfork_line(0.8, [0.05, 0.08])
    sites = "infinite chain" if line.sites is None else f"ring of {line.sites}"
    assert repr(line) == (
        f"<ThresholdLine PF, {sites}, k = 0.8, threshold 1.005: 2 points, gamma 0.05 to 0.08>"
    )
