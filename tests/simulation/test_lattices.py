"""Simulation on any finite lattice: shot orbits come back, and a general solver agrees."""

from __future__ import annotations

import math

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import sparse

import contbreather as cb
import contbreather.simulation as sim
from contbreather.errors import BadInput
from tests.orbits.field import Field, dense

PI = math.pi


def weighted_graph():
    graph = nx.random_labeled_tree(6, seed=4)
    graph.add_edge(0, 5, weight=0.7)
    rng = np.random.default_rng(4)
    masses, drive = rng.uniform(0.6, 1.6, 6), rng.uniform(0.5, 0.8, 6)
    drive[1] = 1.2
    return cb.Lattice.from_graph(graph, masses=masses, drive=drive)


LATTICES = {
    "ring": (cb.Ring(20), {}),
    "open chain": (cb.OpenChain(9), {}),
    "fixed ends": (cb.OpenChain(9, ends="fixed"), {"damping": 0.01}),
    "grid": (cb.Grid(4, 3), {"spring": 0.2}),
    "torus": (cb.Grid(5, 5, periodic=True), {"damping": 0.05}),
    "graph with masses": (weighted_graph(), {"damping": 0.02, "spring": 0.1}),
    "ring with springs": (cb.Ring(12), {"spring": 0.1, "damping": 0.01}),
    "heavy end": (cb.Lattice(sparse.diags_array([[-1.0] * 3, [1, 2, 2, 1], [-1.0] * 3],
                  offsets=[-1, 0, 1]), masses=[1, 1, 1, 5], drive=[1, 1, 1, 0]), {}),
    "own walls": (cb.OpenChain(5), {"walls": {0: (-0.8, 0.8), 3: None, 4: (-0.9, 2.0)}}),
}  # fmt: skip
A, GAMMA, K = 0.6, 0.05, 0.8


RINGS = [(1, 0.0), (2, 0.1), (4, 0.0), (5, 0.3), (7, 0.6)]


@pytest.mark.parametrize(
    ("lattice", "on"), [*LATTICES.values(), *((cb.Ring(n), {"damping": mu}) for n, mu in RINGS)]
)
def test_any_motion_is_that_of_a_general_solver_with_events(lattice, on):
    rng = np.random.default_rng(3)
    u, v = rng.uniform(-0.7, 0.7, lattice.sites), rng.normal(0.0, 1.0, lattice.sites)
    run = sim.simulate((u, v), a=0.7, gamma=0.2, k=0.7, lattice=lattice, periods=0.8, t0=1.0, **on)
    end, hits, whole = Field(lattice, run.conditions).run(np.append(u, v), 1.0, 1.0 + 1.6 * PI)
    assert len(hits) >= min(3, 2 * lattice.sites)
    found = run.impacts[["site", "time", "wall", "before"]].tolist()
    assert np.allclose(found, hits, rtol=0, atol=1e-10)
    assert np.allclose(np.concatenate(run.final), end, rtol=0, atol=1e-10)
    assert np.allclose(sim.variation(run), whole, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize(
    ("k", "size", "damping"),
    [(1.0, 1.0, 0.05), (0.8, 1.0, 0.0), (0.4, 1.0, 0.05), (0.05, 1.0, 0.05), (0.0, 0.3, 0.0)],
)
def test_a_ring_written_as_a_matrix_moves_like_the_ring_rests_included(k, size, damping, seed):
    """Long rings expand anew only what an impact can reach; lattices by their matrix all sites."""
    rng = np.random.default_rng(seed)
    state = rng.uniform(-0.9, 0.9, 60), size * rng.normal(size=60)
    on = {"a": 1.2, "gamma": 0.2, "k": k, "damping": damping, "periods": 0.75}
    lattice = cb.Lattice(dense(cb.Ring(60)))
    runs = [sim.simulate(state, **on, lattice=one) for one in (None, lattice)]
    assert len(runs[0].impacts) == len(runs[1].impacts) > 60
    assert len(runs[0].rests) == len(runs[1].rests)
    assert (len(runs[0].rests) > 0) == (k < 0.1)
    hits = [np.sort(run.impacts, order=["site", "time"]) for run in runs]
    assert np.allclose(hits[0]["time"], hits[1]["time"], rtol=0, atol=1e-9)
    assert np.abs(np.subtract(runs[0].final, runs[1].final)).max() < 1e-9
    if seed == 0:
        late = (sim.simulate(state, t0=0.1, **on, lattice=one) for one in (None, lattice))
        one, other = map(sim.variation, late)
        assert np.abs(one - other).max() <= 1e-6 * np.abs(one).max()


def test_a_site_at_rest_is_let_go_when_spring_and_drive_of_its_own_pull_it_off():
    """k = 0: it sticks at its wall of 0.8 until a d cos t < -(spring u + gamma (u - 0))."""
    lattice = cb.Lattice([[1.0, -1.0], [-1.0, 1.0]], drive=[0.5, 0.0], masses=[1.0, 1e12])
    on = {"a": 2.0, "gamma": 0.1, "k": 0.0, "spring": 0.25, "lattice": lattice}
    run = sim.simulate(([0.8, 0.0], [0.0, 0.0]), walls={0: (-5.0, 0.8)}, t0=PI, periods=0.5, **on)
    assert run.rests["begins"].tolist() == [False]
    wanted = math.acos(-(0.25 + 0.1) * 0.8 / 1.0)  # after t = pi the push falls through it
    assert run.rests["time"][0] == pytest.approx(2 * PI - wanted, abs=1e-9)


@settings(max_examples=25)
@given(
    seed=st.integers(0, 10**6),
    gamma=st.floats(0.0, 1.0),
    k=st.floats(0.0, 0.95),
    spring=st.sampled_from([0.0, 0.3, 7.0]),
    damping=st.sampled_from([0.0, 0.05, 1.0]),
)
def test_no_site_is_ever_beyond_a_wall_of_its_own(seed, gamma, k, spring, damping):
    rng = np.random.default_rng(seed)
    graph = nx.gnp_random_graph(int(rng.integers(2, 8)), 0.5, seed=seed)
    sites = len(graph)
    lattice = cb.Lattice.from_graph(
        graph, masses=rng.uniform(0.3, 3.0, sites), drive=rng.uniform(-1.0, 2.0, sites)
    )
    low, high = -rng.uniform(0.2, 2.0, sites), rng.uniform(0.2, 2.0, sites)
    walls = {n: (low[n], high[n] if rng.uniform() < 0.7 else None) for n in range(sites)}
    high[[walls[n][1] is None for n in range(sites)]] = np.inf
    u = np.where(rng.uniform(size=sites) < 0.3, low, rng.uniform(low, np.minimum(high, 1.0)))
    run = sim.simulate(
        (u, rng.normal(size=sites)), a=1.5, gamma=gamma, k=k, spring=spring, damping=damping,
        lattice=lattice, walls=walls, periods=2, sample=sim.Sample(range(sites), 200),
    )  # fmt: skip
    assert np.all(run.record.u <= high + 1e-12)
    assert np.all(run.record.u >= low - 1e-12)
    assert np.allclose(run.impacts["after"], -k * run.impacts["before"], rtol=0, atol=1e-13)


def test_everything_scales_with_the_walls():
    lattice, rng = cb.Grid(3, 3), np.random.default_rng(0)
    state = rng.uniform(-0.9, 0.9, 9), rng.normal(size=9)
    one = sim.simulate(state, a=0.5, gamma=0.1, k=0.8, lattice=lattice, periods=2)
    far = sim.simulate(
        np.multiply(state, 1000.0), a=500.0, gamma=0.1, k=0.8, lattice=lattice, periods=2,
        walls=(-1000.0, 1000.0),
    )  # fmt: skip
    assert len(one.impacts) == len(far.impacts)
    assert np.abs(np.subtract(far.final, np.multiply(one.final, 1000.0))).max() < 1e-8


def test_streams_sweeps_and_verdicts_know_the_lattice(tmp_path):
    lattice = weighted_graph()
    on = {"gamma": 0.05, "k": 0.8, "damping": 0.1, "spring": 0.1, "lattice": lattice}
    orbit = cb.symmetric(0.6, site=1, **on)
    state = orbit.state(t=0.1)
    shared = {"a": 0.6, "t0": 0.1, **on}
    whole = sim.simulate(state, periods=30, **shared)
    sim.record(tmp_path / "run.nc", state, periods=10, **shared)
    assert np.array_equal(
        sim.record(tmp_path / "run.nc", state, periods=30, **shared).final, whole.final
    )
    kept = sim.open_recording(tmp_path / "run.nc")
    assert kept.conditions.lattice == lattice
    assert len(kept.impacts) == len(whole.impacts)
    with pytest.raises(BadInput, match=r"lattice is graph, 6 sites, masses .* there and ring of 6"):
        sim.record(tmp_path / "run.nc", state, periods=40, **{**shared, "lattice": None})
    other = cb.Lattice.from_graph(nx.path_graph(6))
    with pytest.raises(BadInput, match=r"masses 1.54 .* there and graph, 6 sites here"):
        sim.record(tmp_path / "run.nc", state, periods=40, **{**shared, "lattice": other})
    found = sim.classify(state, settle=300, periods=100, **shared)
    assert found.kind is sim.Kind.PERIODIC
    largest = np.abs(orbit.multipliers()).max()
    assert found.evidence["multiplier"] == pytest.approx(largest, rel=1e-6)
    rates = sim.lyapunov(state, periods=1500, settle=200, count=1, **shared)
    assert rates.exponents[0] == pytest.approx(math.log(largest) / (2 * PI), abs=1e-4)
    own = sim.periodic(state, symmetric=True, **shared)
    assert np.abs(np.subtract(own.state, state)).max() < 1e-10
    down = sim.sweep(state, "spring", [0.1, 0.15, 0.2], periods=200, **shared)
    shifted = cb.symmetric(0.6, site=1, **{**on, "spring": 0.2})
    assert np.abs(np.subtract(down.final, shifted.state(t=0.1))).max() < 1e-6
    assert down.p[-1] == pytest.approx(shifted.p, abs=1e-6)


def test_energy_is_all_of_the_lattice_and_falls_along_its_bonds():
    lattice = weighted_graph()
    rng = np.random.default_rng(2)
    u, v = rng.normal(size=(2, 6))
    seen = sim.localisation(u, v, a=0.0, gamma=0.3, spring=0.2, lattice=lattice)
    kinetic = 0.5 * lattice.masses @ v**2
    pull = 0.3 * lattice.stiffness + 0.2 * np.diag(lattice.masses)
    assert seen.energy.sum() == pytest.approx(kinetic + 0.5 * u @ pull @ u, rel=1e-13)
    chain = cb.symmetric(0.5, gamma=0.08, k=0.8, lattice=cb.OpenChain(21), site=10)
    far = sim.localisation(*chain.state(), a=0.5, gamma=0.08, lattice=cb.OpenChain(21))
    infinite = cb.symmetric(0.5, gamma=0.08, k=0.8)
    near = sim.localisation(*infinite.state(21), a=0.5, gamma=0.08)
    assert int(far.centre) == 10
    assert far.decay() == pytest.approx(near.decay(), rel=0.02)


def test_smooth_walls_harden_into_the_rigid_ones_on_any_lattice():
    lattice, on = LATTICES["graph with masses"]
    orbit = cb.symmetric(A, gamma=GAMMA, k=K, lattice=lattice, site=1, **on)
    state = orbit.state(t=0.3)
    off = []
    for m in (10, 40, 160):
        run = sim.simulate_smooth(
            state, a=A, gamma=GAMMA, k=K, m=m, periods=1, t0=0.3, lattice=lattice, **on
        )
        off.append(np.abs(np.subtract(run.final, state)).max())
    assert off[2] < 0.4 * off[1] < 0.16 * off[0] * 1.5
    assert off[2] < 0.02


def test_rotation_of_a_torus_on_an_open_chain():
    """Far from any impact the modes turn: the slowest one of them with its own frequency."""
    lattice, gamma = cb.OpenChain(2), 0.2
    run = sim.simulate(
        ([0.1, -0.1], [0.0, 0.0]), a=0.0, gamma=gamma, k=0.5, lattice=lattice, periods=500
    )
    turns = math.sqrt(2 * gamma)
    assert sim.rotation(*run.strobe).number == pytest.approx(min(turns, 1 - turns), abs=1e-9)
