"""Hurwitz's zeta function and binomial coefficients, against scipy's."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import special

from contbreather.lattice.zeta import binomial, zeta


@pytest.mark.parametrize("first", [0.75, 1.0, 1.25, 1.5, 2.0, 4.0])
def test_sums_over_powers_are_zeta_functions_to_rounding(first: float) -> None:
    s = np.arange(2.0, 62.0)
    assert np.allclose(zeta(s, first), special.zeta(s, first), rtol=2e-15, atol=0.0)


def test_binomial_coefficients_are_exact_and_vanish_below_zero() -> None:
    n, m = np.mgrid[-1:40, 0:12]
    assert np.array_equal(binomial(n, m), np.where(n < 0, 0.0, special.comb(n, m, exact=False)))
