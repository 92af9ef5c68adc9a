"""Maps of small perturbations answer alike, whichever way they are evaluated."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from contbreather.lattice import InfiniteChain, Ring
from contbreather.lattice.modal_flow import propagator
from contbreather.stability.modal_map import ModalMap, ModalSaltation
from contbreather.stability.one_impact import HalfMap, half_map
from contbreather.stability.verdict import verdict
from contbreather.stability.zeros import outermost


def half_by_modes(sites: int, gamma: float, k: float, b: float, damping: float = 0.0) -> ModalMap:
    """Half a period, mode by mode."""
    basis = Ring(sites).basis((0,))
    z, (shape,) = gamma * basis.lam, basis.at(np.array([0]))
    turns = (propagator(z, 0.0, damping), propagator(z, math.pi, damping))
    blow = ModalSaltation(shape, shape, k, b)
    return ModalMap(
        Ring(sites), gamma, damping, z, gamma * basis.unseen, turns, (blow,), math.pi, sign=-1
    )


@pytest.mark.parametrize("b", [-0.8, 0.3, 1.4])
def test_half_a_ring_and_its_modes_have_the_same_multipliers_and_verdict(b: float) -> None:
    half, modes = half_map(0.11, 0.8, b, Ring(30)), half_by_modes(30, 0.11, 0.8, b)
    assert np.sort(abs(half.coupled)) == pytest.approx(np.sort(abs(modes.coupled)), abs=1e-10)
    first = outermost(half.coupled[half.coupled.imag > 0.0], 1.001)
    assert first == pytest.approx(modes.outermost(1.001), abs=1e-10)
    assert half.idle == modes.idle == 1.0
    one, other = verdict(half), verdict(modes)
    # of a ring nu is NaN, which is not equal to itself
    assert replace(one, nu=0.0) == replace(other, nu=0.0)
    assert math.isnan(one.nu)
    assert math.isnan(other.nu)
    assert one.describe() == other.describe()
    assert one.period == pytest.approx(2 * math.pi)
    assert modes.multipliers().size == 60


def test_a_count_on_a_ring_is_that_of_its_verdict_even_with_multipliers_on_the_circle() -> None:
    half = half_map(0.11, 0.8, -0.3385, Ring(30))
    sizes = np.unique(abs(half.over_period))
    for threshold in sizes[sizes > 1.0001].tolist():
        assert half.unstable(threshold) == verdict(half, threshold).unstable


@pytest.mark.parametrize("mu", [1.0, -1.0])
@pytest.mark.parametrize("spring", [0.0, 0.2])
def test_scalars_change_sign_where_the_count_does(mu: float, spring: float) -> None:
    maps = [HalfMap(0.1, 0.8, b, InfiniteChain(spring)) for b in np.linspace(-4, 4, 160)]
    signs = np.sign([map.crosses(mu) for map in maps])
    real = [map.count().count - 2 * map.count().pairs for map in maps]
    assert np.count_nonzero(np.diff(signs)) == 1
    changed = np.flatnonzero(np.diff(signs))[0]
    assert abs(real[changed + 1] - real[changed]) == 1


@pytest.mark.parametrize("damping", [0.0, 0.07])
def test_scalars_of_modes_have_the_phase_of_determinants_and_vanish_with_them(damping: float):
    modes = half_by_modes(12, 0.11, 0.8, 0.7, damping)
    n = len(modes.matrix)
    rng = np.random.default_rng(2)
    x = rng.normal(size=(n, 3))
    assert modes.applied(x) == pytest.approx(modes.matrix @ x)
    assert modes.on_circle(0.37) == modes.on_circle(0.37, 1.0)  # the unit circle, unless asked
    slow = replace(modes, blows=(modes.blows[0]._replace(b=0.7e-3, speed=1e-3),))  # the same entry
    assert slow.applied(x) == pytest.approx(modes.applied(x))
    for angle, radius in rng.uniform((-1.0, 0.7), (1.0, 1.5), size=(20, 2)):
        mu = radius * np.exp(1j * math.pi * angle)
        value, whole = modes.on_circle(angle, radius), np.linalg.det(modes.matrix - mu * np.eye(n))
        assert value / abs(value) == pytest.approx(whole / abs(whole))
        # without the pole of an impact that vanishes the matrix is bordered by its time
        for map in (modes, slow):
            off = map.less(mu, np.eye(n + 1))
            assert np.linalg.det(off) == pytest.approx(whole * map.blows[0].speed)
            size = np.linalg.norm(np.linalg.inv(off), 2)
            assert abs(map.on_circle(angle, radius)) == pytest.approx(1.0 / size)
    for mu in (1.0, -1.0):
        signed = np.linalg.det(modes.matrix - mu * np.eye(n))
        assert np.sign(modes.crosses(mu)) == np.sign(signed)
        assert slow.crosses(mu) == pytest.approx(1e-3 * modes.crosses(mu))
        assert modes.beyond(mu) == np.count_nonzero(
            (modes.coupled.imag == 0.0) & (modes.coupled.real * mu > 1.0)
        )
    upper = modes.coupled[modes.coupled.imag > 0.0]
    for radius in (1.0, 0.9, 1.01):
        first = modes.outermost(radius)
        assert first == pytest.approx(outermost(upper, radius), abs=1e-12)
        assert (first > 0.0) == bool(np.count_nonzero(abs(upper) > radius))


def test_losses_let_every_mode_decay() -> None:
    modes = half_by_modes(9, 0.1, 0.8, 0.4, damping=0.1)
    assert modes.idle == pytest.approx(math.exp(-0.1 * math.pi))  # over the period
    assert abs(np.prod(modes.multipliers())) == pytest.approx(0.64 * math.exp(-0.9 * math.pi))
