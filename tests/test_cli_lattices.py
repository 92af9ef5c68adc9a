"""`--lattice`, `--sites`, `--site`, `--damping`, `--spring`, `--walls`: as in the library."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import networkx as nx
import numpy as np
import pytest

import contbreather as cb
from contbreather.cli import DONE

from .typed import write_matrix

AT = "--gamma 0.05 --k 0.8"
RING = "--sites 20 --threshold 1.02"
MATRIX = [[1.0, -1.0, 0.0], [-1.0, 3.0, -2.0], [0.0, -2.0, 2.0]]


def content(run: Any, line: str) -> dict[str, Any]:
    status, out, err = run(f"{line} --json")
    assert (status, err) == (DONE, "")
    found: dict[str, Any] = json.loads(out)
    return found


def star() -> nx.Graph:
    """Four sites around one, one bond stiffer, one site heavier and one not driven."""
    graph = nx.star_graph(4)
    graph.edges[0, 2]["weight"] = 1.5
    graph.nodes[3]["mass"] = 2.0
    graph.nodes[4]["drive"] = 0.0
    return graph


LATTICES = {
    "ring:12": cb.Ring(12),
    "open:9": cb.OpenChain(9),
    "open:9:free": cb.OpenChain(9),
    "open:9:fixed": cb.OpenChain(9, ends="fixed"),
    "grid:3x3": cb.Grid(3, 3),
    "grid:3x4:periodic": cb.Grid(3, 4, periodic=True),
    "m.csv": cb.Lattice(MATRIX),
    "star.graphml": cb.Lattice.from_graph(star()),
    "open:3:fixed:masses=1,2,1": cb.OpenChain(3, ends="fixed", masses=[1, 2, 1]),
    "m.csv:springs=1,0.5,2:drive=1,0,1": cb.Lattice(MATRIX, springs=[1, 0.5, 2], drive=[1, 0, 1]),
    "star.graphml:restitutions=1,1,0.9,1,1:dampings=1,2,1,2,1": cb.Lattice.from_graph(
        star(), restitutions=[1, 1, 0.9, 1, 1], dampings=[1, 2, 1, 2, 1]
    ),
    "ring:4:masses=1,2,1.5,1": cb.Lattice.from_graph(
        nx.cycle_graph(4), masses=[1, 2, 1.5, 1], name="ring"
    ),
}


@pytest.mark.parametrize("typed", LATTICES)
def test_point_on_each_lattice_is_the_library_s(run, typed: str) -> None:
    write_matrix("m.csv", MATRIX)
    nx.write_graphml(star(), "star.graphml")
    lattice = LATTICES[typed]
    site = 2
    line = f"point --a 0.6 {AT} --lattice {typed} --site {site} --damping 0.02 --spring 0.1"
    found = content(run, line)
    own = cb.symmetric(0.6, 0.05, 0.8, lattice=lattice, site=site, damping=0.02, spring=0.1)
    verdict = own.stability()
    for name in ("a", "gamma", "k", "damping", "spring", "p", "phi"):
        assert found[name] == getattr(own, name)
    assert found["lattice"] == lattice.describe()
    assert (found["sites"], found["site"]) == (lattice.sites, site)
    assert (found["stable"], found["unstable"]) == (verdict.stable, verdict.unstable)
    assert (found["largest"], found["threshold"]) == (verdict.largest, 1.005)
    assert found["admissible"] is own.admissibility().ok is True
    assert lattice.describe() in run(line)[1].lower()


@pytest.mark.parametrize(
    ("typed", "walls"),
    [
        ("-2,2", (-2, 2)),
        ("2", (-2, 2)),
        ("0:-2,2", {0: (-2, 2)}),
        ("2,1,1,1,1,1,1,1,1", {0: (-2, 2)}),
        ("-2,2 --walls 1:none,none", {0: (-2, 2), 1: None, **dict.fromkeys(range(2, 9), (-2, 2))}),
    ],
)
def test_walls_are_the_library_s(run, typed: str, walls: Any) -> None:
    found = content(run, f"point --a 1.2 {AT} --lattice open:9 --walls {typed}")
    own = cb.symmetric(1.2, 0.05, 0.8, lattice=cb.OpenChain(9), walls=walls)
    assert found["p"] == own.p
    assert found["margin"] == own.admissibility().margin


def test_a_ring_of_a_lattice_is_that_of_sites(run) -> None:
    line = f"branch --free a {AT} --window 0.5 0.9"
    assert content(run, f"{line} --lattice ring:20") == content(run, f"{line} --sites 20")


@pytest.mark.parametrize(("free", "lattice"), [("damping", "ring:12"), ("spring", "grid:3x3")])
def test_damping_and_springs_are_parameters_to_vary(run, free: str, lattice: str) -> None:
    found = content(run, f"branch --free {free} --a 0.6 {AT} --lattice {lattice} --window 0 0.02")
    columns = found["columns"]
    assert (columns[free][0], columns[free][-1]) == (0.0, 0.02)
    own = cb.symmetric(0.6, 0.05, 0.8, lattice=LATTICES[lattice], **{free: 0.02})
    assert columns["p"][-1] == pytest.approx(own.p, abs=1e-10)


@pytest.mark.slow
def test_switch_and_diagram_leave_the_pitchfork_of_the_lattice(run) -> None:
    lattice = f"{AT} --lattice open:9 --window 0.7 0.95"
    found = content(run, f"switch --free a {lattice}")
    assert found["lattice"] == "open chain with free ends, 9 sites"
    assert found["at"]["a"] == pytest.approx(0.744358992, abs=1e-9)
    assert [arm["image_of"] for arm in found["arms"]] == [None, 1]
    tree = content(run, f"diagram --free a {lattice}")
    assert [branch["depth"] for branch in tree["branches"]] == [0, 1, 1]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("lattice", "kind"),
    [("open:9", "PERIODIC"), ("grid:3x3", "UNDECIDED")],  # it repels
)
def test_a_run_from_the_orbit_of_the_lattice_stays_on_it(run, lattice: str, kind: str) -> None:
    own = LATTICES[lattice]
    line = f"simulate --a 0.6 {AT} --lattice {lattice} --site 4 --damping 0.02 --spring 0.1"
    found = content(run, f"{line} --periods 100 --impacts i.csv -o run.png")
    more = {"damping": 0.02, "spring": 0.1, "lattice": own}
    orbit = cb.symmetric(0.6, 0.05, 0.8, site=4, **more)
    motion = cb.simulate(orbit.state(t=0.0), a=0.6, gamma=0.05, k=0.8, periods=100, **more)
    assert (found["lattice"], found["sites"]) == (own.describe(), 9)
    assert np.array_equal([found["final"]["u"], found["final"]["v"]], motion.final)
    assert found["impacts"] == {"total": 200, "by_site": {"4": 200}}
    assert found["lost_after"] is None
    assert found["verdict"]["kind"] == kind
    assert Path("run.png").stat().st_size > 10_000
    assert "of them at site 4" in run(line)[1]


def test_a_run_between_far_walls_and_one_without_a_lattice(run) -> None:
    on = "--sites 12 --walls -2,2 --spring 0.01 --omega 1.05"
    found = content(run, f"simulate --a 1.2 {AT} {on} --periods 3 --save run.nc")
    assert found["impacts"]["by_site"] == {"0": 6}
    for one in (found, json.loads(run("show run.nc --json")[1])):
        assert (one["walls"], one["spring"], one["omega"]) == ([-2, 2], 0.01, 1.05)
    springs = content(run, f"simulate --a 0.6 {AT} --spring 0.1 --periods 3")
    assert springs["impacts"]["by_site"] == {"0": 6}
    assert springs["sites"] == 20
    smooth = content(run, f"simulate --a 0.1 {AT} --lattice open:9 --smooth 6 --periods 3")
    assert smooth["lattice"] == "open chain with free ends, 9 sites"


# --- rings ---------------------------------------------------------------------------------------


def on_ring(a: float, gamma: float) -> cb.Orbit:
    return cb.symmetric(a, gamma, 0.8, lattice=cb.Ring(20))


def test_boundary_is_of_the_ring(run) -> None:
    line = "--gamma 0.05 --k 0.8 --window 0.04 0.06"
    found = content(run, f"boundary NS {line} {RING}")
    assert (found["sites"], found["threshold"]) == (20, 1.02)
    columns = found["columns"]
    for a, gamma in list(zip(columns["a"], columns["gamma"], strict=True))[::4]:
        largest = on_ring(float(a), float(gamma)).stability().largest
        assert largest == pytest.approx(1.02, abs=1e-9)
    assert "ring of 20, threshold 1.02" in run(f"boundary PF {line} {RING}")[1]
