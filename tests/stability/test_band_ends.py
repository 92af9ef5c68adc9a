"""Where the band of a whole period begins, reaches -1 and +1, at these ends and beside them.

`tests/campaigns/band_ends.py` asks thousands of random orbits and half maps; these are a few.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

import contbreather as cb
from contbreather.errors import BadInput
from contbreather.lattice import InfiniteChain
from contbreather.stability.chain_map import OrbitMap
from tests.campaigns.band_ends import by_modes
from tests.stability.half import determinant, unstable_count, unstable_multipliers

OFF = (0.0, 1e-16, 1e-14, 1e-12, 1e-10, 1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("gamma", [0.0625, 0.06255])
def test_two_sites_are_told_stable_or_not_where_their_band_passes_minus_one(gamma: float) -> None:
    orbit = cb.multibreather([0, 3], a=0.4, gamma=gamma, k=0.8, lattice=cb.Ring(30)).unfolded()
    told = orbit.on(cb.InfiniteChain()).stability()
    assert told.certain
    assert told.unstable == 4
    # what grows as fast as that does not come round on a long ring
    ring = cb.multibreather([0, 3], a=0.4, gamma=gamma, k=0.8, lattice=cb.Ring(240)).unfolded()
    sizes = np.abs(ring.stability().multipliers)
    for size in np.abs(told.multipliers):
        assert np.abs(sizes - size).min() < 1e-4


def drawn(seed: int) -> tuple[float, list[tuple[int, float, float]], int]:
    rng = np.random.default_rng(seed)
    n, m = 1 + seed % 2, 1 + seed % 4
    times = np.sort(rng.uniform(0, 2 * np.pi * n, m))
    sites = rng.integers(0, (1, 2, 5)[seed % 3], m)
    kicks = zip(sites.tolist(), times.tolist(), rng.normal(size=m).tolist(), strict=True)
    return float(rng.uniform(0, 1)), list(kicks), n


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("end", [0.0625, 0.25])
def test_counts_are_the_same_next_to_an_end_of_the_band_and_at_it(end: float, seed: int) -> None:
    k, kicks, n = drawn(seed)
    sides = (1, -1) if end < 0.25 else (-1,)
    scaled = [min(end + side * off, np.nextafter(0.25, 0.0)) for side in sides for off in OFF]
    maps = [OrbitMap(float(x) / n**2, k, kicks, n) for x in scaled]
    counts = [map.count() for map in maps]
    # that the chain leaves +1 again at 1/4 is a matter of rounding there
    assert all(c.certain for c, x in zip(counts, scaled, strict=True) if x < 0.25 - 1e-13)
    assert len({(count.count, count.pairs) for count in counts}) == 1
    assert maps[0].unstable_multipliers().size == counts[0].count
    values = np.array([map.crosses(-1.0) for map in maps])
    assert np.abs(values - values[0]).max() < 0.02 * (1.0 + np.abs(values).max())


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("scaled", [1e-4, 0.0625, 0.06255, 0.25 - 1e-12])
def test_next_to_the_ends_the_determinant_is_that_of_the_modes(scaled: float, seed: int) -> None:
    k, kicks, n = drawn(seed)
    map = OrbitMap(scaled / n**2, k, kicks, n)
    kappa = np.array([0.0, map.edge % 1.0, 1.0 - map.edge, 0.5]) - 0.01j
    wanted = by_modes(map, kappa)
    assert np.abs(determinant(map, kappa) - wanted).max() < 1e-10 * np.abs(wanted).max()


def test_waves_between_two_sites_that_amplify_them_are_many_multipliers() -> None:
    """They are found, however close to the circle, in a band that narrow."""
    kicks = [(7, 2.9271, -0.0879), (0, 5.6057, -0.3604)]
    map = OrbitMap(6.9444e-6, 0.6888, kicks, 2)
    assert map.count().count == 14 == map.unstable_multipliers().size
    assert np.all(np.abs(map.unstable_multipliers()) > 1.0)


def test_what_is_on_the_circle_to_within_rounding_is_not_told_for_certain() -> None:
    kicks = [(18, 5.289, 1.883), (22, 5.289, 5.276)]  # waves that are hardly let out
    count = OrbitMap(3.61e-11, 0.0, kicks).count()
    assert not count.certain


def test_a_coupling_inside_the_room_that_a_spring_leaves_is_one_for_every_mean() -> None:
    """1 - spring - 4 gamma is positive, their sum 1 to within rounding."""
    for spring in (2.072554122649074e-13, 1.1767414326163081e-06, 0.3, 0.9):
        gamma = float(np.nextafter(0.25 * (1.0 - spring), 0.0))
        chain = InfiniteChain(spring)
        values = [getattr(chain, name)(gamma) for name in ("chi", "eta", "sigma", "psi", "tau")]
        assert np.all(np.isfinite(values))
        count = unstable_count(gamma, 0.8, 0.3, chain).count
        assert count == unstable_count(gamma - 1e-8, 0.8, 0.3, chain).count
        with pytest.raises(BadInput, match="must stay below 1"):
            chain.chi(0.25 * (1.0 - spring))


@pytest.mark.parametrize(
    ("gamma", "k", "b", "spring"),
    [
        (0.24999999999982234, 0.5876509241089787, -0.4157997176344173, 0.0),
        (0.2242982038174352, 1.0, -9.062501072380527, 0.10280718472948636),
    ],
)
def test_multipliers_are_found_without_a_step_from_the_end_of_the_band(gamma, k, b, spring) -> None:
    chain = InfiniteChain(spring)
    assert unstable_multipliers(gamma, k, b, chain).size == unstable_count(gamma, k, b, chain).count
    assert math.isfinite(unstable_count(gamma, k, b, chain).distance)
