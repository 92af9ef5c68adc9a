"""How close is close: on either side of every tolerance of forcings, waves and the closure.

What is well beyond one is refused or told apart, what is well within is taken: neither may be ten
thousand times larger or smaller.
"""

from __future__ import annotations

import math

import mpmath as mp
import numpy as np
import pytest

import contbreather as cb
from contbreather.errors import BadInput
from contbreather.lattice import Fourier, InfiniteChain, Samples, Symbolic
from tests.lattice.by_hand import slope_of

GRID = 2 * np.pi * np.arange(64) / 64
CHAIN = InfiniteChain()


# --- samples --------------------------------------------------------------------------------------


def test_samples_are_antisymmetric_to_nine_digits() -> None:
    assert Samples(np.cos(GRID) + 1e-11).symmetric
    assert Samples(np.cos(GRID) + 1e-8).harmonics[0] == (0, pytest.approx(1e-8, rel=1e-6), 0.0)


def test_samples_resolve_their_harmonics_to_ten_digits() -> None:
    assert Samples(np.cos(GRID) + 1e-12 * np.cos(21 * GRID)).highest == 21
    with pytest.raises(BadInput, match=r"above 16 still reach 1\.0e-08 of the largest"):
        Samples(np.cos(GRID) + 1e-8 * np.cos(21 * GRID))


def test_a_small_harmonic_of_samples_is_no_rounding() -> None:
    found = {m: (a, b) for m, a, b in Samples(-np.cos(GRID) - 1e-13 * np.cos(3 * GRID)).harmonics}
    assert found[3][0] == pytest.approx(1e-13 / 9, rel=0.01, abs=0)


@pytest.mark.parametrize("many", [11, 12, 13])
def test_few_and_many_harmonics_are_summed_alike(many: int) -> None:
    rng = np.random.default_rng(many)
    cos = {2 * i + 1: float(x) for i, x in enumerate(rng.normal(size=many))}
    forcing, t = Fourier(cos=cos), 0.7
    for order, of in enumerate((forcing.f, forcing.df, forcing.d2f, forcing.d3f)):
        exact = mp.fsum(
            -mp.mpf(c) * mp.mpf(m) ** (order - 2) * mp.cos(m * mp.mpf(t) + order * mp.pi / 2)
            for m, c in cos.items()
        )
        assert of(t) == pytest.approx(float(exact), rel=1e-12)
        assert of(np.array([t]))[0] == pytest.approx(float(exact), rel=1e-12)


def test_the_peak_between_two_crests_of_nearly_equal_height_is_the_higher_one() -> None:
    """The grid sees the lower crest better; both are polished."""
    for phase in (0.0, 0.013, 0.029, 0.045):
        forcing = Fourier.from_response(cos={1: 1.0}, sin={3: 0.3 + 0.01 * phase, 1: phase})
        t = np.linspace(0, math.pi, 400001)
        assert forcing.peak() == pytest.approx(np.abs(forcing.f(t)).max(), abs=1e-10)


def test_the_peak_of_a_flat_top_is_its_height() -> None:
    """``f = cos t - cos(3t)/9``: its curvature vanishes at the crest, where the search begins."""
    assert Fourier(cos={1: -1.0, 3: 1.0}).peak() == pytest.approx(8 / 9, rel=1e-14)


def test_a_flat_top_that_touches_is_one_root() -> None:
    """Without losses ``p chi = 1 - a f`` where f' = 0, of third order at the flat top."""
    flat = Fourier.from_response(cos={1: 1.0, 3: -1 / 9})
    for a in (0.3, 0.7):
        found = cb.orbits.symmetric_roots(a, 0.1, 1.0, forcing=flat)
        wanted = [(1 + side * a * 8 / 9) / CHAIN.chi(0.1) for side in (1, -1)]
        assert [b.p for b in found] == pytest.approx(wanted, rel=1e-14)
        assert [math.cos(b.phi) for b in found] == pytest.approx([-1.0, 1.0], abs=1e-12)
        assert max(abs(b.phi) % math.pi for b in found[1:]) < 1e-7


# --- formulas -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "m", "coefficient", "rounding"),
    [
        ("-cos(t) - s*cos(3*t)", 3, 1e-14, 2e-16),
        # on 32 samples cos(33 t) looks like cos(t)
        ("(-cos(t) - 1e3*s*cos(33*t))/(1 + 1e-5*cos(2*t))", 33, 1e-11, 1e-14),
    ],
)
def test_a_small_term_of_a_formula_is_kept_to_rounding(text, m, coefficient, rounding) -> None:
    found = {m: a for m, a, _ in Symbolic(text, s=1e-14).harmonics}
    assert m**2 * found[m] == pytest.approx(coefficient, rel=0, abs=rounding)


def test_a_small_slope_of_a_formula_is_kept() -> None:
    own = Symbolic("-cos(t) - s*cos(3*t)*1e-14", s=1.0)
    assert slope_of(own, "s", 0.0, 0) == pytest.approx(1e-14 / 9, rel=1e-9, abs=0)
