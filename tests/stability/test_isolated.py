"""The isolated multipliers outside the circle."""

from __future__ import annotations

import numpy as np
import pytest

from contbreather.stability import (
    D,
    closest_approach,
    neimark_sacker,
    unstable_count,
    unstable_multipliers,
)
from tests.stability.by_hand import b_of

FIG_3B = -0.2447945960 + 1.0231123432j
FIG_4B = 1.0627500064


def test_leading_multipliers_of_figures_3b_and_4b():
    pair = unstable_multipliers(0.11, 0.8, b_of(0.2, 0.11, 0.8))
    np.testing.assert_allclose(pair, [FIG_3B, np.conj(FIG_3B)], rtol=0, atol=1e-10)
    alone = unstable_multipliers(0.045, 0.8, b_of(0.8, 0.045, 0.8))
    np.testing.assert_allclose(alone, [FIG_4B], rtol=0, atol=1e-10)


def test_newton_finds_all_that_the_winding_number_counts_and_each_is_a_zero():
    rng = np.random.default_rng(7)
    for _ in range(150):
        gamma = rng.choice(
            [rng.uniform(0, 0.25), 10 ** rng.uniform(-12, -1), 0.25 - 10 ** rng.uniform(-8, -1)]
        )
        k = rng.choice([rng.uniform(), 0.0, 1.0])
        b = rng.choice([0.3, 1.5, 30.0]) * rng.normal()
        mu = unstable_multipliers(gamma, k, b)
        assert mu.size == unstable_count(gamma, k, b).count
        assert np.all(np.abs(mu) > 1)
        assert np.allclose(np.sort_complex(mu), np.sort_complex(mu.conj()), rtol=1e-14, atol=0)
        if mu.size:
            nu = np.log(mu) / (1j * np.pi)
            step = np.abs(D(gamma, nu, k, b)) * 2e-8
            step /= np.abs(D(gamma, nu + 1e-8, k, b) - D(gamma, nu - 1e-8, k, b))
            assert step.max() < 1e-12


@pytest.mark.parametrize(("gamma", "k"), [(0.12, 0.8), (0.2, 0.4), (0.24, 0.1), (0.05, 0.95)])
def test_the_closest_approach_points_at_the_neimark_sacker_angle(gamma, k):
    for point in neimark_sacker(gamma, k):
        at = closest_approach(gamma, k, point.b)
        assert at.nu == pytest.approx(point.nu, abs=1e-9)
        assert at.distance < 1e-9
        near = closest_approach(gamma, k, point.b + 1e-3)
        assert near.nu == pytest.approx(point.nu, abs=0.02)
        assert near.distance < 0.01
