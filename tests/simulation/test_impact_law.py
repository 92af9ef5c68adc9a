"""Restitution that depends on the speed of an impact, beside integrators of others and k itself."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

import contbreather as cb
import contbreather.simulation as sim
from contbreather.errors import BadInput
from contbreather.lattice.conditions import Conditions
from tests.orbits.field import Field

ON = {"a": 0.5, "gamma": 0.08}
LAWS = {
    "softer when fast": lambda speed: 1.0 / (1.0 + 0.4 * speed),
    "of spheres": lambda speed: 1.0 - 0.3 * speed**0.2,
    "plastic beyond a speed": lambda speed: 0.9 * min(1.0, (0.3 / max(speed, 1e-9)) ** 0.25),
}


@pytest.fixture
def state():
    u, v = cb.symmetric(**ON, k=0.8).state(5)
    return u + 0.01 * np.arange(5), v


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
@pytest.mark.parametrize("damping", [0.0, 0.05])
def test_it_is_that_of_an_integrator_from_impact_to_impact(state, law, damping):
    run = sim.simulate(state, **ON, restitution=law, damping=damping, periods=4.4)
    field = Field(cb.Ring(5), run.conditions, law)
    end, hits, _ = field.run(np.concatenate(state), 0.0, 4.4 * 2.0 * math.pi)
    assert len(run.impacts) == len(hits) > 7
    found = run.impacts[["site", "time", "wall", "before"]].tolist()
    np.testing.assert_allclose(found, hits, atol=1e-9)
    after = [-law(abs(before)) * before for *_, before in hits]
    np.testing.assert_allclose(run.impacts["after"], after, atol=1e-9)
    np.testing.assert_allclose(np.concatenate(run.final), end, atol=1e-9)


def test_a_function_that_is_constant_is_the_number_bit_for_bit(state):
    """Dense samples, a chatter that ends in a rest, and noise among what periods are asked for."""
    for start, on, k, more in (
        (state, ON, 0.8, {"sample": sim.Sample((0, 2), 16), "periods": 20.5}),
        (([0.2, 0.0], [0.0, 0.0]), {"a": 3.0, "gamma": 0.05}, 0.3, {"periods": 30}),
        (state, ON, 0.8, {"periods": 5, "noise": 0.01}),
    ):
        one = sim.simulate(start, **on, k=k, **more)
        other = sim.simulate(start, **on, restitution=lambda _, k=k: k, **more)
        for name, (_, values) in one.variables().items():
            assert np.array_equal(other.variables()[name][1], values), name
        assert on is ON or len(one.rests) > 10


@dataclass
class Fading:
    """A law with numbers of its own, compared by these, so that it has no hash."""

    loss: float

    def __call__(self, speed: float) -> float:
        return 1.0 / (1.0 + self.loss * speed)


def test_an_object_with_numbers_of_its_own_is_as_good_as_a_function(state):
    one = sim.periodic(state, **ON, restitution=Fading(0.4), damping=0.05)
    other = sim.periodic(state, **ON, restitution=LAWS["softer when fast"], damping=0.05)
    assert np.array_equal(one.state, other.state)


def test_sites_have_their_shares_of_it_as_of_k():
    law, shares = LAWS["softer when fast"], np.array([1.0, 0.5, 0.9])
    lattice = cb.Lattice([[1, -1, 0], [-1, 2, -1], [0, -1, 1]], restitutions=shares)
    state, on = (np.array([0.2, -0.4, 0.5]), np.array([1.0, 2.0, -1.5])), {**ON, "lattice": lattice}
    hits = sim.simulate(state, **on, restitution=law, periods=2).impacts
    assert set(hits["site"]) == {0, 1, 2}
    ratios = np.array([law(speed) for speed in abs(hits["before"])]) * shares[hits["site"]]
    np.testing.assert_allclose(hits["after"], -ratios * hits["before"], rtol=1e-14)
    alike = sim.simulate(state, **on, restitution=lambda speed: 0.8, periods=1)
    number = sim.simulate(state, **on, k=0.8, periods=1)
    np.testing.assert_allclose(sim.variation(alike), sim.variation(number), rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize("of", [{"k": 0.9}, {"restitution": LAWS["of spheres"]}], ids=["k", "law"])
def test_no_site_gains_by_its_share(state, of):
    lattice = cb.Lattice(np.zeros((5, 5)), restitutions=[1, 1, 1.2, 1, 1])
    with pytest.raises(BadInput, match=r"^k = 1\.\d+: the restitution coefficient"):
        sim.simulate(state, **ON, **of, lattice=lattice, periods=1)
    sim.simulate(state, **ON, k=0.8, lattice=lattice, periods=1)
    with pytest.raises(BadInput, match=r"^k = 1\.08: "):
        sim.sweep(state, "k", [0.8, 0.9], **ON, lattice=lattice, periods=2)


def test_many_sites_that_hit_together_have_each_its_own_speed():
    u, v = np.array([1.0, 1.0, 0.5]), np.array([0.4, 0.8, 0.0])
    law = LAWS["softer when fast"]
    run = sim.simulate((u, v), a=0.1, gamma=0.0, restitution=law, periods=0.01)
    assert run.impacts["site"].tolist() == [0, 1]
    np.testing.assert_allclose(run.impacts["after"], [-law(x) * x for x in (0.4, 0.8)], rtol=1e-14)


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
def test_perturbations_grow_as_differences_say(state, law):
    on = {**ON, "restitution": law, "damping": 0.03, "periods": 2.3}
    matrix, x, h = sim.variation(sim.simulate(state, **on)), np.concatenate(state), 1e-5
    for j in range(len(x)):
        ends = [
            np.concatenate(sim.simulate(np.split(x + s * h * np.eye(len(x))[j], 2), **on).final)
            for s in (1.0, -1.0)
        ]
        np.testing.assert_allclose(matrix[:, j], (ends[0] - ends[1]) / (2.0 * h), atol=2e-7)


def test_periodic_motions_have_multipliers_of_the_law():
    law = LAWS["softer when fast"]
    found = sim.periodic(cb.symmetric(**ON, k=0.8).state(5), **ON, restitution=law, damping=0.1)
    hits = found.run().impacts
    assert found.residual < 1e-12
    ratios = -found.conditions.laws_at(hits["before"], hits["site"])[1]
    k = law(np.abs(hits["before"]))
    # Liouville: volumes shrink by damping between impacts, and by k (-R') at each of them
    volume = math.exp(-0.1 * 5 * 2.0 * math.pi) * np.prod(k * ratios)
    assert np.prod(found.multipliers).real == pytest.approx(volume, rel=1e-8)
    rates = sim.lyapunov(found.state, **ON, restitution=law, damping=0.1, periods=200, count=1)
    assert rates.exponents[0] == pytest.approx(found.growth, abs=1e-3)
    branch = cb.trace(found, "a", within={"a": (0.49, 0.51)}, towards="both")
    assert branch["a"].tolist()[0] == 0.49


def test_slopes_are_those_of_the_velocity_after():
    law, v, sites = LAWS["softer when fast"], np.array([0.01, -0.7, 3.0]), np.zeros(3, dtype=int)
    _, slopes = Conditions(**ON, k=math.nan, restitution=law, lattice=cb.Ring(5)).laws_at(v, sites)
    # -v/(1 + c |v|) has the slope -1/(1 + c |v|)^2
    np.testing.assert_allclose(slopes, -((1.0 + 0.4 * abs(v)) ** -2), rtol=1e-10)
    _, slopes = Conditions(**ON, k=0.8, lattice=cb.Ring(5)).laws_at(v, sites)
    assert slopes.tolist() == [-0.8, -0.8, -0.8]


def test_what_is_no_law_is_a_sentence(state, tmp_path):
    law = LAWS["of spheres"]
    for on, words in (
        ({"k": 0.8, "restitution": law}, "in place of k and on rigid walls; leave out k"),
        ({"restitution": 0.8}, r"^restitution = 0\.8: a function of the speed"),
        (
            {"restitution": lambda speed: 1.0 + speed},
            r"^restitution\(.*\) = 1\.\d+: a number from 0",
        ),
        ({"restitution": lambda speed: None}, r"^restitution\(.*\) = None: a number from 0 to 1"),
        ({}, "missing k"),
    ):
        with pytest.raises(BadInput, match=words):
            sim.simulate(state, **ON, **on, periods=1)
    with pytest.raises(BadInput, match="on rigid walls; leave out k and m"):
        sim.simulate_smooth(state, **ON, m=6, restitution=law, periods=1)
    with pytest.raises(BadInput, match="a file holds numbers only"):
        sim.record(tmp_path / "run.nc", state, **ON, restitution=law, periods=1)
    assert not list(tmp_path.iterdir())
    with pytest.raises(BadInput, match="in place of k"):
        cb.simulation.sweep(state, "k", [0.8, 0.7], **ON, restitution=law, periods=2)


def test_an_orbit_is_let_go_under_another_law():
    orbit, law = cb.symmetric(**ON, k=0.8, lattice=cb.Ring(5)), LAWS["softer when fast"]
    run = sim.simulate(orbit, restitution=law, periods=2)
    assert np.array_equal(
        run.final, sim.simulate(orbit.state(), **ON, restitution=law, periods=2).final
    )
    assert "nan" not in str(run.table())


@pytest.mark.slow
def test_an_arm_in_a_file_is_what_it_was_of_the_motion_that_is_given_again(tmp_path: Path) -> None:
    law = lambda speed: 0.9 / (1.0 + 0.15 * speed)  # noqa: E731
    start = cb.symmetric(0.7, 0.04, 0.8).state(4)
    on = {"a": 0.7, "gamma": 0.04, "damping": 0.02, "restitution": law}
    found = sim.periodic(start, symmetric=True, **on)
    branch = cb.trace(found, "a", within={"a": (0.7, 0.82)}, towards="up")
    (arm,) = cb.switch(branch.first("PF"), steps=cb.Steps(most=3))
    cb.save(tmp_path / "arm.nc", arm)
    again = cb.load(tmp_path / "arm.nc", problem=found)
    assert repr(again) == repr(arm)
    kinds = [[event.kind for event in one.problem.events] for one in (again, arm)]
    assert kinds[0] == kinds[1]
    assert "PD" in kinds[0]
