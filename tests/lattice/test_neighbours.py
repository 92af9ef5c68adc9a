"""Who is coupled to whom, on every lattice, and what each calls itself."""

from __future__ import annotations

import networkx as nx
import numpy as np
import pytest

import contbreather as cb

STAR = cb.Lattice.from_graph(nx.star_graph(3))


@pytest.mark.parametrize(
    ("lattice", "neighbours"),
    [
        (cb.Ring(1), {0: ()}),
        (cb.Ring(2), {0: (1,), 1: (0,)}),
        (cb.Ring(3), {0: (1, 2), 1: (0, 2), 2: (0, 1)}),
        (cb.Ring(6), {0: (1, 5), 2: (1, 3), 5: (0, 4)}),
        (cb.InfiniteChain(), {0: (-1, 1), 7: (6, 8), -3: (-4, -2)}),
        (cb.OpenChain(4), {0: (1,), 1: (0, 2), 3: (2,)}),
        (cb.OpenChain(4, ends="fixed"), {0: (1,), 1: (0, 2), 3: (2,)}),
        (cb.Grid(2, 3), {0: (1, 3), 1: (0, 2, 4), 5: (2, 4)}),
        (cb.Grid(3, 3, periodic=True), {0: (1, 2, 3, 6), 4: (1, 3, 5, 7)}),
        (STAR, {0: (1, 2, 3), 2: (0,)}),
    ],
    ids=lambda one: one.describe() if hasattr(one, "describe") else "",
)
def test_the_sites_beside_a_site_are_those_it_is_coupled_to(lattice, neighbours) -> None:
    for n, beside in neighbours.items():
        assert tuple(lattice.beside(n)) == beside, n


def test_every_lattice_says_what_it_is() -> None:
    assert cb.Ring(6).describe() == "ring of 6"
    assert cb.InfiniteChain().describe() == "infinite chain"
    assert STAR.describe() == "graph, 4 sites"
    assert cb.Lattice([[1.0]]).describe() == "lattice, 1 site"
    heavy = cb.OpenChain(3, masses=[2.0, 2.0, 2.0])
    assert heavy.describe() == "open chain with free ends, 3 sites, masses 2"
    defect = cb.OpenChain(16, masses=[1, 1, 1, 1, 3] + [1] * 11)
    assert defect.describe() == "open chain with free ends, 16 sites, masses 1 but 3 at site 4"
    unlike = cb.OpenChain(9, masses=np.linspace(0.9, 1.1, 9))
    assert unlike.describe().endswith("masses 0.9 0.925 0.95 0.975 ...")
    dimer = cb.OpenChain(6, masses=[1, 2] * 3, drive=[1, -1] * 3)
    said = "open chain with free ends, 6 sites, masses 1 2 1 2 1 2, drive 1 -1 1 -1 1 -1"
    assert dimer.describe() == said
    # as titles have it, of zones for instance
    assert said in cb.symmetric(0.5, 0.05, 0.8, lattice=dimer).problem.label
    assert repr(STAR) == "<graph, 4 sites>"
    assert cb.Lattice.from_graph(nx.star_graph(3)) == STAR
    assert hash(STAR) == hash(cb.Lattice.from_graph(nx.star_graph(3)))
    assert cb.Lattice.from_graph(nx.path_graph(4)) != STAR
    assert cb.OpenChain(4) != "something else"


def test_ends_that_are_fixed_are_held_by_a_bond_more() -> None:
    free, fixed = cb.OpenChain(4).stiffness, cb.OpenChain(4, ends="fixed").stiffness
    assert (fixed - free).tolist() == np.diag([1.0, 0.0, 0.0, 1.0]).tolist()
    assert free.sum(axis=1) == pytest.approx(np.zeros(4))
    closed = cb.Grid(1, 5, periodic=True).stiffness
    ring = 2 * np.eye(5) - np.roll(np.eye(5), 1, axis=0) - np.roll(np.eye(5), -1, axis=0)
    assert closed == pytest.approx(ring)


@pytest.mark.parametrize("weight", [0.5, 2.0])
def test_bonds_of_a_graph_are_as_stiff_as_their_weights(weight: float) -> None:
    graph = nx.Graph()
    graph.add_edge("a", "b", weight=weight, other=3.0)
    graph.add_edge("b", "c")
    made = cb.Lattice.from_graph(graph)
    assert made.stiffness == pytest.approx(
        np.array([[weight, -weight, 0.0], [-weight, weight + 1.0, -1.0], [0.0, -1.0, 1.0]])
    )
    assert cb.Lattice.from_graph(graph, weight="other").stiffness[0, 0] == 3.0


def test_a_grid_is_known_by_its_bonds() -> None:
    for rows in (2, 3, 5):
        for columns in (2, 3, 4):
            for periodic in (False, True):
                assert cb.Grid(rows, columns, periodic=periodic).shape == (rows, columns)
    cylinder = nx.grid_2d_graph(3, 5, periodic=(True, False))
    assert cb.Lattice.from_graph(cylinder).shape == (3, 5)
    hexagons = nx.hexagonal_lattice_graph(2, 2)
    cut = nx.grid_2d_graph(3, 5)
    cut.remove_edge((1, 2), (1, 3))
    for graph in (nx.complete_graph(6), nx.cycle_graph(6), hexagons, cut):
        assert cb.Lattice.from_graph(graph).shape is None
    for lattice in (STAR, cb.OpenChain(6), cb.OpenChain(1), cb.Grid(1, 5), cb.Grid(5, 1)):
        assert lattice.shape is None
