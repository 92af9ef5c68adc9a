"""`--lattice`, `--site`, `--damping`, `--spring`, `--walls`: as in the library, or a sentence."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import networkx as nx
import numpy as np
import pytest

import contbreather as cb
from contbreather.cli import BAD_INPUT, DONE

AT = "--gamma 0.05 --k 0.8"
MATRIX = [[1.0, -1.0, 0.0], [-1.0, 3.0, -2.0], [0.0, -2.0, 2.0]]


def content(run: Any, line: str) -> dict[str, Any]:
    status, out, err = run(f"{line} --json")
    assert (status, err) == (DONE, "")
    found: dict[str, Any] = json.loads(out)
    return found


def write_matrix(name: str, rows: Any) -> None:
    Path(name).write_text("\n".join(",".join(map(str, row)) for row in rows), encoding="utf-8")


def star() -> nx.Graph:
    """Four sites around one, one bond stiffer, one site heavier and one not driven."""
    graph = nx.star_graph(4)
    graph.edges[0, 2]["weight"] = 1.5
    graph.nodes[3]["mass"] = 2.0
    graph.nodes[4]["drive"] = 0.0
    return graph


LATTICES = {
    "ring:20": cb.Ring(20),
    "open:9": cb.OpenChain(9),
    "open:9:free": cb.OpenChain(9),
    "open:9:fixed": cb.OpenChain(9, ends="fixed"),
    "grid:5x5": cb.Grid(5, 5),
    "grid:3x4:periodic": cb.Grid(3, 4, periodic=True),
    "m.csv": cb.Lattice(MATRIX),
    "star.graphml": cb.Lattice.from_graph(star()),
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


def test_nothing_is_said_of_the_stability_of_what_goes_through_a_wall(run) -> None:
    line = f"point --a 1.2 {AT} --lattice grid:5x5 --site 2"
    found = content(run, line)
    assert found["admissible"] is False
    assert [found[name] for name in ("stable", "unstable", "largest")] == [None] * 3
    assert "Nothing is said of its stability" in run(line)[1]


def test_a_matrix_may_be_written_with_spaces_or_semicolons(run) -> None:
    Path("a.csv").write_text("1 -1 0\n\n-1 3 -2\n0 -2 2\n", encoding="utf-8")
    Path("b.csv").write_text("1; -1; 0\n-1; 3; -2\n0; -2; 2", encoding="utf-8")
    p = [content(run, f"point --a 0.8 {AT} --lattice {name}.csv")["p"] for name in "ab"]
    assert p == [cb.symmetric(0.8, 0.05, 0.8, lattice=cb.Lattice(MATRIX)).p] * 2


@pytest.mark.parametrize(
    ("typed", "walls"),
    [
        ("-2,2", (-2, 2)),
        ("0:-2,2", {0: (-2, 2)}),
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


def test_branch_and_its_special_points_are_the_library_s(run) -> None:
    found = content(run, f"branch --free a {AT} --lattice open:9 --window 0.55 0.95")
    branch = cb.trace(
        cb.symmetric(0.6, 0.05, 0.8, lattice=cb.OpenChain(9)), "a", within={"a": (0.55, 0.95)}
    )
    assert [one["label"] for one in found["special"]] == [one.label for one in branch.special]
    for one, own in zip(found["special"], branch.special, strict=True):
        assert one["a"] == pytest.approx(own["a"], abs=1e-10)


@pytest.mark.parametrize("free", ["damping", "spring"])
@pytest.mark.parametrize("lattice", ["ring:12", "grid:3x3"])
def test_damping_and_springs_are_parameters_to_vary(run, free: str, lattice: str) -> None:
    found = content(run, f"branch --free {free} --a 0.6 {AT} --lattice {lattice} --window 0 0.02")
    columns = found["columns"]
    assert (columns[free][0], columns[free][-1]) == (0.0, 0.02)
    own = cb.symmetric(0.6, 0.05, 0.8, lattice=LATTICES.get(lattice) or _small(lattice),
                       **{free: 0.02})  # fmt: skip
    assert columns["p"][-1] == pytest.approx(own.p, abs=1e-10)


def _small(typed: str) -> Any:
    return {"ring:12": cb.Ring(12), "grid:3x3": cb.Grid(3, 3)}[typed]


def test_springs_are_a_parameter_on_the_infinite_chain_too(run) -> None:
    line = f"branch --free spring --a 0.6 {AT} --window 0 0.9"
    columns = content(run, line)["columns"]
    for i in (0, -1):
        own = cb.symmetric(0.6, 0.05, 0.8, spring=columns["spring"][i])
        assert columns["p"][i] == pytest.approx(own.p, abs=1e-11)
    assert content(run, f"point --a 0.6 {AT} --spring 0.2")["spring"] == 0.2


def test_boundary_with_damping_ends_at_the_chain_without(run) -> None:
    line = "boundary PF --pair damping a --gamma 0.04 --k 0.8 --lattice ring:20 --window 0 0.04"
    found = content(run, f"{line} --damping 0.02")
    ends = [(one["label"], round(one["a"], 8)) for one in found["special"]]
    assert ends == [("EP1", 0.77763243), ("EP2", 0.79129918)]


def test_switch_and_diagram_leave_the_pitchfork_of_the_lattice(run) -> None:
    lattice = f"{AT} --lattice open:9 --window 0.7 0.95"
    found = content(run, f"switch --free a {lattice}")
    assert found["lattice"] == "open chain with free ends, 9 sites"
    assert found["at"]["a"] == pytest.approx(0.744358992, abs=1e-9)
    assert [arm["image_of"] for arm in found["arms"]] == [None, 1]
    tree = content(run, f"diagram --free a {lattice}")
    assert [branch["depth"] for branch in tree["branches"]] == [0, 1, 1]
    assert (
        "on the open chain with free ends, 9 sites (threshold 1.005)"
        in run(f"switch --free a {lattice}")[1]
    )


def test_a_threshold_is_of_any_finite_lattice(run) -> None:
    line = f"point --a 0.6 {AT} --lattice open:9"
    largest = content(run, line)["largest"]
    assert largest == pytest.approx(1.00954865, abs=1e-8)
    assert content(run, f"{line} --threshold 1.02")["unstable"] == 0
    assert content(run, f"{line} --threshold 1.005")["unstable"] == 4


@pytest.mark.parametrize(
    ("lattice", "kind"),
    [("open:9", "PERIODIC"), ("grid:3x3", "UNDECIDED")],  # it repels
)
def test_a_run_from_the_orbit_of_the_lattice_stays_on_it(run, lattice: str, kind: str) -> None:
    own = {"open:9": cb.OpenChain(9), "grid:3x3": cb.Grid(3, 3)}[lattice]
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
    found = content(run, f"simulate --a 1.2 {AT} --sites 12 --walls -2,2 --periods 3")
    assert found["impacts"]["by_site"] == {"0": 6}
    springs = content(run, f"simulate --a 0.6 {AT} --spring 0.1 --periods 3")
    assert springs["impacts"]["by_site"] == {"0": 6}
    assert springs["sites"] == 20
    smooth = content(run, f"simulate --a 0.1 {AT} --lattice open:9 --smooth 6 --periods 3")
    assert smooth["lattice"] == "open chain with free ends, 9 sites"


POINT = f"point --a 0.6 {AT}"
REFUSED = {
    "no such lattice": (f"{POINT} --lattice cube:3", r"--lattice cube:3: expected ring:20, open"),
    "no size": (f"{POINT} --lattice ring", r"--lattice ring: expected ring:20"),
    "size zero": (f"{POINT} --lattice open:0", r"--lattice open:0: expected"),
    "size negative": (f"{POINT} --lattice open:-3", r"--lattice open:-3: expected"),
    "size no number": (f"{POINT} --lattice grid:5xfive", r"--lattice grid:5xfive: expected"),
    "half a grid": (f"{POINT} --lattice grid:5", r"--lattice grid:5: expected"),
    "unknown ends": (f"{POINT} --lattice open:9:loose", r"--lattice open:9:loose: expected"),
    "ring with ends": (f"{POINT} --lattice ring:9:fixed", r"--lattice ring:9:fixed: expected"),
    "lattice and sites": (f"{POINT} --lattice ring:9 --sites 9", r"give one of the two"),
    "no such file": (f"{POINT} --lattice nowhere.csv", r"cannot read nowhere\.csv: No such file"),
    "no such graph": (f"{POINT} --lattice no.graphml", r"cannot read no\.graphml: No such file"),
    "folder": (f"{POINT} --lattice folder.csv", r"cannot read folder\.csv: it is a directory"),
    "words": (f"{POINT} --lattice words.csv", r"no stiffness matrix in words\.csv: could not conv"),
    "bytes": (f"{POINT} --lattice bytes.csv", r"cannot read bytes\.csv: it is not text"),
    "empty": (f"{POINT} --lattice empty.csv", r"no stiffness matrix in empty\.csv: 0 rows of no"),
    "ragged": (f"{POINT} --lattice ragged.csv", r"2 rows of 1, 2 numbers; a square matrix"),
    "not square": (f"{POINT} --lattice wide.csv", r"2 rows of 3 numbers; a square matrix"),
    "not symmetric": (
        f"{POINT} --lattice lopsided.csv",
        r"stiffness\[0, 1\] = -1 but stiffness\[1, 0\] = -0\.5: .* must be symmetric",
    ),
    "not semidefinite": (
        f"{POINT} --lattice falling.csv",
        r"the stiffness matrix has the eigenvalue -1: it must be positive semidefinite",
    ),
    "not finite": (f"{POINT} --lattice nan.csv", r"stiffness\[0, 0\] = nan is not finite"),
    "no graph": (f"{POINT} --lattice broken.graphml", r"no graph in broken\.graphml: "),
    "graph of another language": (f"{POINT} --lattice page.graphml", r"no graph in page\.graphml"),
    "graph with directions": (f"{POINT} --lattice arrows.graphml", r"an undirected networkx graph"),
    "weights in words": (f"{POINT} --lattice stiff.graphml", r"weights 'weight' of the edges must"),
    "negative weight": (f"{POINT} --lattice push.graphml", r"must be positive semidefinite"),
    "negative mass": (f"{POINT} --lattice heavy.graphml", r"masses\[1\] = -2: every mass must be"),
    "mass in words": (f"{POINT} --lattice lead.graphml", r"one number for each site is expected"),
    "site alone": (
        f"{POINT} --lattice apart.graphml --site 2",
        r"site 2 of this lattice has no bond to any other",
    ),
    "site not there": (f"{POINT} --lattice open:9 --site 9", r"no such site on the open chain"),
    "site not whole": (f"{POINT} --lattice open:9 --site 1.5", r"1\.5 is not a whole number"),
    "walls of a site not there": (
        f"{POINT} --lattice open:9 --walls 12:-1,1",
        r"walls of site 12: there is no such site on the open chain .* sites are 0 to 8",
    ),
    "walls crossed": (f"{POINT} --lattice open:9 --walls 1,-1", r"two numbers low < high"),
    "walls nan": (f"{POINT} --lattice open:9 --walls nan,1", r"two numbers low < high"),
    "half a wall": (f"{POINT} --lattice open:9 --walls 1", r"--walls 1: LOW,HIGH is expected"),
    "walls in words": (
        f"{POINT} --lattice open:9 --walls=up,1",
        r"--walls up,1: LOW,HIGH is expected",
    ),
    "walls of no site": (f"{POINT} --lattice open:9 --walls x:-1,1", r"SITE:LOW,HIGH is expected"),
    "walls twice": (f"{POINT} --lattice open:9 --walls -1,1 --walls -2,2", r"one pair for all"),
    "walls of a site twice": (
        f"{POINT} --lattice open:9 --walls 1:-1,1 --walls 1:-2,2",
        r"one pair for all sites, one for each of them",
    ),
    "one wall": (f"{POINT} --lattice open:9 --walls none,1", r"the walls are not symmetric"),
    "damping negative": (f"{POINT} --lattice open:9 --damping -1", r"damping = -1\.0: at least 0"),
    "damping nan": (f"{POINT} --lattice open:9 --damping nan", r"damping = nan: at least 0"),
    "spring negative": (f"{POINT} --lattice open:9 --spring -0.1", r"spring = -0\.1: at least 0"),
    "spring in resonance": (
        f"{POINT} --lattice open:9 --spring 1",
        r"frequency 1 is in resonance with the orbit: change gamma or spring",
    ),
    "spring above the drive on the infinite chain": (
        f"{POINT} --spring 1.2",
        r"spring = 1\.2: .* below the drive \(above that take a ring of 40 sites\)",
    ),
    "spring that closes the gap of the infinite chain": (
        f"{POINT} --spring 0.9",
        r"gamma = 0\.05, spring = 0\.9: the band .* must stay below 1",
    ),
    "threshold of the infinite chain": (f"{POINT} --threshold 1.01", r"--threshold needs --sites"),
    "damping of the infinite chain": (f"{POINT} --damping 0.1", r"take a ring or another"),
    "site of the infinite chain": (f"{POINT} --site 3", r"on the infinite chain site 0 impacts"),
    "branch with a site not there": (
        f"branch --free a {AT} --lattice open:9 --site 9",
        r"no such site on the open chain",
    ),
    "boundary with walls crossed": (
        f"boundary PF {AT} --lattice open:9 --walls 1,-1",
        r"two numbers low < high",
    ),
    "damping to vary on the infinite chain": (
        f"branch --free damping --a 0.6 {AT} --window 0.01 0.1",
        r"on the infinite chain",
    ),
    "threshold of arms": (
        f"switch --free a {AT} --lattice open:9 --threshold 1.02",
        r"--threshold 1\.02: branches that are switched to are judged by the paper's 1\.005",
    ),
    "threshold of a run": (
        f"simulate --a 0.6 {AT} --sites 9 --threshold 1.02",
        r"--threshold: the verdict on a run has none",
    ),
    "run from a site not there": (
        f"simulate --a 0.6 {AT} --lattice open:9 --site 9",
        r"no such site on the open chain",
    ),
    "run between walls crossed": (
        f"simulate --a 0.6 {AT} --lattice open:9 --walls 1,-1",
        r"two numbers low < high",
    ),
    "smooth walls elsewhere": (
        f"simulate --a 0.6 {AT} --walls -2,2 --smooth 6",
        r"--walls goes with rigid walls only: leave out --smooth",
    ),
    "threshold zero": (f"{POINT} --lattice open:9 --threshold 0", r"threshold = 0"),
    "zones": (
        "zones --lattice open:9",
        r"--lattice is not an option of zones: .* boundary follows",
    ),
    "zones with damping": ("zones --damping 0.1", r"--damping is not an option of zones"),
    "figure": (
        "figure 4 --walls -2,2",
        r"--walls is not an option of figure: the figures are those",
    ),
}


def plant() -> None:
    """Files that are no lattices."""
    write_matrix("lopsided.csv", [[1, -1], [-0.5, 1]])
    write_matrix("falling.csv", [[0, 1], [1, 0]])
    write_matrix("ragged.csv", [[1, -1], [1]])
    write_matrix("wide.csv", [[1, -1, 0], [-1, 1, 0]])
    write_matrix("nan.csv", [["nan", -1], [-1, 1]])
    write_matrix("words.csv", [["one", "two"], [1, 2]])
    Path("bytes.csv").write_bytes(bytes(range(128, 256)))
    Path("empty.csv").touch()
    Path("folder.csv").mkdir()
    Path("broken.graphml").write_text("<graphml><graph", encoding="utf-8")
    Path("page.graphml").write_text("<html/>", encoding="utf-8")
    pair = nx.path_graph(2)
    nx.write_graphml(nx.DiGraph([(0, 1)]), "arrows.graphml")
    for name, edge in (("stiff", "very"), ("push", -1.0)):
        nx.set_edge_attributes(pair, edge, "weight")
        nx.write_graphml(pair, f"{name}.graphml")
    for name, mass in (("heavy", -2.0), ("lead", "a lot")):
        weighed = nx.path_graph(3)
        weighed.nodes[1]["mass"] = mass
        nx.write_graphml(weighed, f"{name}.graphml")
    apart = nx.path_graph(2)
    apart.add_node(2)
    nx.write_graphml(apart, "apart.graphml")


@pytest.mark.parametrize(("line", "sentence"), REFUSED.values(), ids=REFUSED)
def test_what_is_refused_is_one_sentence_and_status_2(run, line: str, sentence: str) -> None:
    plant()
    before = sorted(Path().iterdir())
    status, out, err = run(line)
    assert (status, out) == (BAD_INPUT, ""), err
    assert err.startswith("contbreather: ")
    assert err.count("\n") == 1
    assert re.search(sentence, err), err
    assert sorted(Path().iterdir()) == before


def test_masses_and_drive_of_a_graph_are_those_of_its_nodes() -> None:
    lattice = cb.Lattice.from_graph(star())
    assert np.array_equal(lattice.masses, [1, 1, 1, 2, 1])
    assert np.array_equal(lattice.drive, [1, 1, 1, 1, 0])
    own = cb.Lattice.from_graph(star(), masses=[1, 2, 3, 4, 5])
    assert np.array_equal(own.masses, [1, 2, 3, 4, 5])
