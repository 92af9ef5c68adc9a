"""Springs, dampings and restitution of each site."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import contbreather as cb
from contbreather.orbits.constructors import orbit_at, shooting
from tests.campaigns import uneven
from tests.stability.by_hand import slope

RNG = np.random.default_rng(39)
N = 7
SPRING, DAMPING, K = ((mean * RNG.uniform(0.5, 1.5, N)).tolist() for mean in (0.25, 0.02, 0.6))
PARTS: dict[str, Any] = {"spring": SPRING, "damping": DAMPING, "k": K}
ON: dict[str, Any] = {"a": 0.4, "gamma": 0.05, "lattice": cb.OpenChain(N), "site": 2, **PARTS}


def test_orbits_of_random_chains_return_under_another_integrator() -> None:
    """Every draw that keeps off its walls returns, with impacts and multipliers; most do."""
    said = [uneven.answer(np.random.default_rng([4, i]), i) for i in range(12)]
    assert not [one for one in said if one.startswith("WRONG")]
    assert said.count("right") >= 6


def test_the_parameters_are_means_and_the_lattice_knows_the_rest() -> None:
    orbit = cb.symmetric(**ON)
    for name, given in PARTS.items():
        assert getattr(orbit, name) == pytest.approx(np.mean(given), rel=1e-14)
        own = orbit.conditions.at_sites(name, range(N))
        assert own == pytest.approx(given, rel=1e-14)


@pytest.mark.parametrize("name", ["gamma", "spring", "damping", "k", "a"])
@pytest.mark.parametrize(("symmetric", "spring"), [(True, SPRING), (False, SPRING), (False, 0.0)])
def test_slopes_in_parameters_are_those_of_differences(
    name: str, symmetric: bool, spring: Any
) -> None:
    walls = None if symmetric else {2: (-0.97, 1.0)}
    # what no spring holds drifts
    problem = shooting(cb.symmetric(**ON | {"spring": spring}), symmetric=symmetric, walls=walls)
    motion = orbit_at(problem).representation
    params = motion.conditions.params

    def moved(h: float) -> Any:
        return motion.equations.residual(motion.x, {**params, name: params[name] + h})

    differences = slope(moved, 1e-4)
    assert motion.equations.along(motion.x, params, {name: 1.0}) == pytest.approx(
        differences, abs=1e-9 * max(1.0, abs(differences).max())
    )


def test_the_slope_along_the_pace_is_the_sum_of_those_in_all_three_parameters() -> None:
    motion = cb.symmetric(**ON, omega=1.1).representation
    params, state = motion.conditions.params, {"gamma": 2.0, "spring": 2.0, "damping": 1.0}
    way = {name: power * params[name] for name, power in state.items()}
    each = [rate * motion.equations.along(motion.x, params, {n: 1.0}) for n, rate in way.items()]
    found = motion.equations.along(motion.x, params, way)
    assert found == pytest.approx(sum(each), abs=1e-12)


def test_branches_in_each_parameter_keep_the_proportions() -> None:
    for name in ("gamma", "spring", "damping", "k"):
        start = cb.symmetric(**ON)
        value = getattr(start, name)
        branch = cb.trace(start, name, within={name: (0.9 * value, 1.1 * value)})
        end = branch.points[-1].solution
        scale = getattr(end, name) / value
        given = ON[name] if name == "gamma" else np.array(ON[name])
        on = {**ON, name: given * scale}
        assert cb.symmetric(**on).p == pytest.approx(end.p, rel=1e-9)


def test_a_simulation_repeats_it() -> None:
    orbit = cb.symmetric(**ON)
    on = {name: value for name, value in ON.items() if name != "site"}
    run = cb.simulate(orbit.state(), periods=2, **on)
    assert abs(run.final.u - orbit.state()[0]).max() < 1e-12
    assert len(run.impacts) == 4


def test_one_number_for_each_that_is_the_same_is_one_number() -> None:
    for lattice in (cb.Ring(6), cb.OpenChain(6)):
        on = {"a": 0.5, "gamma": 0.05, "lattice": lattice}
        one = cb.symmetric(k=0.8, spring=0.1, damping=0.01, **on)
        each = cb.symmetric(k=[0.8] * 6, spring=[0.1] * 6, damping=[0.01] * 6, **on)
        assert each.lattice == lattice
        assert (each.p, each.phi) == (one.p, one.phi)


def test_nearly_even_parts_are_nearly_those_of_modes() -> None:
    """Whole chains by complex eigenvectors, and by normal modes."""
    on = {"a": 0.5, "gamma": 0.05, "lattice": cb.OpenChain(6), "k": 0.8}
    one = cb.symmetric(spring=0.1, damping=0.01, **on)
    off = 1e-9 * np.array([1, -1, 1, -1, 1, -1])
    near = cb.symmetric(spring=0.1 + off, damping=0.01 + off, **on)
    assert (near.p, near.phi) == pytest.approx((one.p, one.phi), abs=1e-7)
    assert near.stability().largest == pytest.approx(one.stability().largest, rel=1e-6)


def test_smooth_walls_refuse_them() -> None:
    orbit = cb.symmetric(**ON)
    with pytest.raises(cb.BadInput, match="smooth walls take one"):
        cb.simulation.simulate_smooth(orbit, periods=1, m=20, k=0.8)


def test_two_sites_and_their_symmetries() -> None:
    """On a ring with one other spring, sites are alike at equal distances from that alone."""
    on = {"a": 0.5, "gamma": 0.03, "k": 0.8, "lattice": cb.Ring(6)}
    spring = [0.1, 0.1, 0.1, 0.3, 0.1, 0.1]
    alike = cb.multibreathers(most=1, **on)
    own = cb.multibreathers(most=1, **on, spring=spring)
    assert [entry.sites for entry in alike] == [(0,)]
    assert [entry.sites for entry in own] == [(0,), (1,), (2,), (3,)]
    assert [entry.copies for entry in own] == [1, 2, 2, 1]
    assert all(entry.exists for entry in own)
