"""What cannot be answered is refused in a sentence: what was given, what was expected, and help."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import Any

import networkx as nx
import numpy as np
import pytest
from scipy import sparse

import contbreather as cb
from contbreather.checks import MOST, check_kind, kind_of, number, numbers, real, row, whole
from contbreather.continuation import Event
from contbreather.errors import BadInput
from contbreather.lattice import Fourier, Harmonic, InfiniteChain, Ring
from contbreather.lattice.conditions import Conditions, Walls
from contbreather.lattice.parse import lattice_by, walls_by
from contbreather.orbits import find_symmetric, neighbour_peak
from contbreather.orbits.constructors import asymmetric
from contbreather.orbits.orbit import orbit_of
from contbreather.simulation import judge, open_recording, periodic

LINE: dict[str, Any] = {
    "residual": lambda x, p: x - p["mu"],
    "start": {"x": 0.0},
    "params": {"mu": 0.0},
}


def problem(**changed: Any) -> cb.Problem:
    return cb.Problem(**{**LINE, **changed})


def grown(x: Any, p: Any) -> Any:
    return p["r"] * x * (1.0 - x)


def swing() -> cb.Problem:
    return cb.cycle(
        lambda t, x, p: [x[1], -p["b"] * x[0]], {"u": 1.0, "v": 0.0}, {"b": 1.0},
        conserves=lambda x, p: (x[1] ** 2 + p["b"] * x[0] ** 2) / 2,
    )  # fmt: skip


PAIR = np.array([[1.0, -1.0], [-1.0, 1.0]])
APART = np.array([[1.0, -1.0, 0.0], [-1.0, 1.0, 0.0], [0.0, 0.0, 1.0]])

CASES: list[tuple[Callable[[], Any], str]] = [
    # parameters; of a family the period is free in place of the energy, or the energy of the period
    (lambda: cb.trace(swing(), "energi"), r"'energi' is not .*it has \['b', 'period', 'energy'\]"),
    # problems
    (lambda: problem(residual=3.0), r"residual must be a function, got 3\.0"),
    (
        lambda: problem(jacobian=3.0),
        r"jacobian must be a function, or a pattern of its entries; got 3\.0",
    ),
    (lambda: problem(start=[1.0]), r"start must be a dict of names and values, got \[1\.0\]"),
    (lambda: problem(params=2.0), r"params must be a dict of names and values"),
    (lambda: problem(scales=[1.0]), r"scales must be a dict of names and values"),
    (lambda: problem(domain=[1.0]), r"domain must be a dict of names and values"),
    (lambda: problem(record=[1.0]), r"record must be a dict of names and values"),
    (lambda: problem(start={}), r"at least one unknown: start is empty"),
    (lambda: problem(params={"x": 1.0}), r"\['x'\] are named both as unknowns and as parameters"),
    (
        lambda: problem(params={"mu": 1.0, "size": 2.0}, record={"size": lambda point: 0.0}),
        r"\['size'\] are columns of this problem: give the parameters, .* other names",
    ),
    (lambda: problem(record={"r": 5}), r"record\['r'\] must be a function of a point, got 5"),
    (
        lambda: cb.trace(problem(jacobian=lambda x, p: [[1.0 / p["mu"]]]), "mu"),
        "the derivatives have no value at the start .*: ",
    ),
    *(
        (
            lambda kind=kind: cb.Event(kind, float),
            "the kind of an event is .*: a label was expected",
        )
        for kind in ("", "EP", 3)
    ),
    (lambda: cb.Event("XX", "x - 1"), "event XX: its test and all else must be functions of a po"),
    (lambda: problem(scales={"x": 0.0}), r"scale of 'x' must be finite and positive, got 0\.0"),
    (lambda: problem(scales={"x": math.inf}), r"scale of 'x' must be finite and positive"),
    (lambda: problem(scales={"y": 1.0}), r"no 'y' in this problem; it has \['x', 'mu'\]"),
    (lambda: cb.user(3, 0.1), r"user\(3, \.\.\.\): the name of an unknown or a parameter"),
    (lambda: cb.user("mu", math.nan), r"value = nan: one level"),
    # maps
    (lambda: cb.FixedPoint(3.0, {"x": 0.6}, {"r": 2.5}), r"a map, and its jacobian, are functions"),
    (
        lambda: cb.FixedPoint(grown, {"x": 0.6}, {"r": 2.5}, jacobian=1.0),
        r"a map, and its jacobian, are functions; got .* and 1\.0",
    ),
    (
        lambda: cb.FixedPoint(grown, {"x": 0.6}, {"r": 2.5}, record=[1]),
        r"record must be a dict of names and functions, got \[1\]",
    ),
    *(
        (
            lambda period=period: cb.FixedPoint(grown, {"x": 0.6}, {"r": 2.5}, period=period),
            rf"^period = {period!r}: a whole number, at least 1",
        )
        for period in (0, -1, 1.5, True, "2")
    ),
    # lattices
    (lambda: cb.Lattice([[1.0, "a"], [0.0, 1.0]]), "the stiffness is not a matrix of numbers"),
    (lambda: cb.Lattice([[1.0, 2.0]]), r"\(1, 2\); a square matrix.*Lattice\.from_graph\(graph\)"),
    (lambda: cb.OpenChain(0), "at least 1"),
    (lambda: cb.OpenChain(4, ends="loose"), "'free' or 'fixed'"),
    (lambda: cb.Grid(2.5, 3), "rows = 2.5"),
    (lambda: cb.symmetric(1e-3, 0.05, 0.8, lattice=cb.OpenChain(9)), "too weak"),
    (lambda: cb.Lattice(np.zeros((0, 0))), r"the stiffness has shape \(0, 0\)"),
    (lambda: cb.Lattice([1.0, 2.0]), r"the stiffness has shape \(2,\)"),
    (lambda: cb.Lattice([[1.0, 0.0], [0.0, math.nan]]), r"stiffness\[1, 1\] = nan is not finite"),
    (
        lambda: cb.Lattice([[1.0, -0.5], [-1.0, 1.0]]),
        r"stiffness\[0, 1\] = -0\.5 but stiffness\[1, 0\] = -1: a spring pulls both ends alike",
    ),
    (lambda: cb.Lattice(-PAIR), r"has the eigenvalue -2: it must be positive semidefinite"),
    (lambda: cb.Lattice(PAIR, masses=[1.0, 0.0]), r"masses\[1\] = 0: every mass must be positive"),
    (lambda: cb.Lattice(PAIR, masses=[1.0]), r"masses = .* has shape \(1,\); .* for each of 2"),
    (
        lambda: cb.Lattice(PAIR, drive=[1.0, 1.0, 1.0]),
        r"drive = .* has shape \(3,\); a number, or one for each",
    ),
    (lambda: cb.Lattice(PAIR, drive=["a", "b"]), r"drive = \['a', 'b'\]: one number for each site"),
    (lambda: cb.Lattice(PAIR, drive=[1.0, math.inf]), r"drive = \[1\.0, inf\]: finite numbers"),
    (lambda: cb.Lattice.from_graph(3), r"graph = 3: an undirected networkx graph with at least"),
    (lambda: cb.Lattice.from_graph(nx.DiGraph([(0, 1)])), r"an undirected networkx graph"),
    (lambda: cb.Lattice.from_graph(nx.Graph()), r"an undirected networkx graph with at least one"),
    (
        lambda: cb.Lattice.from_graph(nx.Graph([(0, 1, {"weight": "heavy"})])),
        r"the weights 'weight' of .* be numbers, their stiffnesses; that from 0 to 1 is 'heavy'\.$",
    ),
    (
        lambda: cb.Lattice(APART).basis((1, 2)),
        r"site 2 of this lattice has no bond to any other: alone it is a single oscillator",
    ),
    # forcings
    (lambda: Fourier(cos=[1.0]), r"cos = \[1\.0\]: coefficients by harmonic were expected"),
    (lambda: Fourier(cos={}, sin=3.0), r"sin = 3\.0: coefficients by harmonic were expected"),
    (lambda: Fourier(sin={1: "a"}), r"sin harmonic 1: its coefficient 'a' is not a finite"),
    (lambda: Fourier(cos={1: 1e-200}), r"too little to be computed with; .* scale it up"),
    (lambda: Harmonic().slope_harmonics("c3"), r"unknown forcing parameter 'c3': this forcing"),
    (lambda: Fourier(cos={1: -1.0}).at(c3=0.1), r"unknown forcing parameter 'c3': .* has c1"),
]


HERE = {"a": 0.5, "gamma": 0.02, "k": 0.8}
STATE = [0.1, 0.2, 0.3], [0.0, 0.1, 0.0]


def alone() -> Any:
    return cb.symmetric(**HERE)


def pair() -> Any:
    """Two sites of the infinite chain, with an offset each."""
    ring = cb.multibreather([0, 3], **HERE, lattice=Ring(12)).unfolded()
    on = Conditions(**HERE)
    return orbit_of(on, ring.section, ring.times, ring.impulses, (0.0, 0.0))


def told_as(value: Any) -> Any:
    """Equations whose solutions stand for a value."""

    class Told(cb.Problem):
        def interpret(self, point: Any) -> Any:
            return value

    return Told(**LINE)


CASES += [
    # events and points
    (lambda: Event("X", None), "an event of kind X needs a test, or at least a count"),
    (lambda: Event("X", float, ends="all"), "ends='all': '', 'branch' or 'domain' was expected"),
    (
        lambda: replace(cb.trace(alone(), "a", steps=cb.Steps(most=2))[1], tangent=None).direction,
        r"^Point\(p=.*\) has no tangent: it is not on a walk",
    ),
    (
        lambda: cb.trace(told_as(3), "mu", events=[cb.neimark_sacker(threshold=1.01)]),
        r"a threshold is for orbits; got 3\.",
    ),
    (
        lambda: cb.neimark_sacker(threshold=1.01, every="yes"),
        "every = 'yes': True or False was expected",
    ),
    # orbits
    (lambda: alone().state(), "the infinite chain has no end: ask for state"),
    (lambda: pair().c, "this orbit has an offset for each of 2 sites"),
    (
        lambda: alone().unfolded().representation.equations.along(np.ones(5), HERE, {"nu": 1.0}),
        "unknown forcing parameter 'nu': this forcing",
    ),
    (
        lambda: alone().unfolded().problem.residual(np.full(5, math.nan), HERE),
        r"a = 0\.5, x = \[nan nan nan nan nan\]: the orbit needs finite numbers",
    ),
    (
        lambda: asymmetric(0.87, 0.04, 0.8).problem.residual(np.full(4, math.nan), HERE),
        r"a = 0\.5, x = \[nan nan nan nan\]: the breather needs finite numbers",
    ),
    (
        lambda: cb.symmetric(**HERE, spring="0.1", lattice=cb.OpenChain(9), site=0),
        "^spring = '0.1': the on-site stiffness must be a number",
    ),
    (
        lambda: cb.symmetric(**HERE, spring=1.0, lattice=cb.OpenChain(9), site=0),
        "9 sites with 1 times the frequency of the drive is in resonance with the orbit: change "
        "gamma, spring or omega",
    ),
    (
        lambda: cb.symmetric(
            a=0.5, gamma=0.0, k=0.8, spring=[0.5, 0.2, 9.0], lattice=cb.OpenChain(3), site=0
        ),
        "springs .* with 3 times the frequency of the drive is in resonance with the orbit",
    ),
    # what is larger than anything, or not even text
    (lambda: cb.OpenChain(10**400), "^sites is above 9007199254740992: no computer counts"),
    (lambda: cb.OpenChain(10_001), "^sites = 10001: a lattice by its matrix has at most"),
    (lambda: cb.Grid(10**400, 2), "^rows is above 9007199254740992"),
    (lambda: cb.Grid(200, 200), "^rows x columns = 40000: a lattice by its matrix has at most"),
    (lambda: cb.Lattice(sparse.eye_array(10**6)), "^sites = 1000000: a lattice by its matrix"),
    (lambda: cb.Lattice(10**400), "^the stiffness is not a matrix of numbers"),
    (lambda: Ring(10**5000), "^sites is above 9007199254740992"),
    (lambda: Ring(-(10**5000)), r"^sites = about -2\*\*16610: a whole number, at least 1"),
    (lambda: number("a", "x" * 10**6, 0, 1, "a share"), r"^a = 'x{199}\.\.\. \(1000002 char"),
    (lambda: cb.FixedPoint(grown, {"x": 0.5}, {"r": 2.0}, period=10**400), "^period is above"),
    (lambda: cb.trace(problem(), "mu", steps=np.zeros(2)), "^steps must be given as Steps"),
    (
        lambda: cb.trace(cb.trace(problem(), "mu", steps=cb.Steps(most=2)), "mu"),
        r"^trace starts at one point, got a whole branch: give branch\[0\], or branch.first",
    ),
    (lambda: cb.trace(problem(), "mu", towards=np.zeros(2)), "^towards must be 'both', 'up' or"),
    (lambda: cb.trace(problem(), "mu", inadmissible=np.zeros(2)), "^inadmissible = .*: True or F"),
    (lambda: cb.trace(problem(), "mu", progress="no"), "^progress = 'no': True or False was"),
    (lambda: cb.trace(problem(domain={"mu": 3}), "mu"), "^the window of 'mu' must be a pair"),
    (lambda: problem(events=[1]), r"^events must be a list of them, got \[1\]"),
    (lambda: problem().solve(tolerance="x"), "^tolerance = 'x': a relative size"),
    (
        lambda: cb.trace(cb.FixedPoint(lambda x, p: None, {"x": 0.5}, {"r": 2.0}), "r"),
        r"the map makes array\(\[None\], .* of array\(\[0\.5\]\); 1 numbers were expected",
    ),
    (lambda: find_symmetric("b", (0, 1), **HERE), "^the parameter must be 'a', 'gamma', 'k', "),
    (lambda: find_symmetric("a", (0, 1), k=0.8), "^a breather needs gamma, too"),
    (lambda: find_symmetric("a", 3, **HERE), "^the window of 'a' must be a pair"),
    (lambda: find_symmetric("a", (0.9, 0.1), **HERE), "^the window of 'a' is empty"),
    (
        lambda: cb.trace(alone(), "a", within={"gamma": (0.5, 1)}),
        r"^the window of 'gamma' is empty: \(0\.5, 1\), outside 0 to 0\.2499$",
    ),
    (lambda: neighbour_peak(3), "^an orbit was expected, got an int"),
    (lambda: cb.zones(k=[[1], [2, 3]]), r"^k = \[1\]: the restitution coefficient must be"),
    (lambda: InfiniteChain().chi("x"), "^gamma = 'x': the coupling must be a number"),
    (lambda: judge(3), "^a run of simulate was expected, got an int"),  # type: ignore[arg-type]
    (lambda: periodic(alone().state(4), **HERE, m=6, walls=(-1, 2)), "^smooth walls are at -1"),
    (lambda: open_recording(3), "^3 is not the name of a file"),  # type: ignore[arg-type]
    (lambda: cb.plotting.new_figure(0), "^rows = 0: a whole number, at least 1"),
    (lambda: cb.zones(k=0.8, lattice=Ring(3), site="x"), "^site = 'x': a whole number was"),
    *(
        (
            lambda bad=bad: cb.plot(cb.trace(problem(), "mu", steps=cb.Steps(most=2)), ax=bad()),
            "^matplotlib Axes to draw in were expected",
        )
        for bad in (lambda: 3, lambda: cb.plotting.new_figure()[0])
    ),
    (lambda: cb.plotting.plot_energy(problem()), "^a branch of breathers was expected, got a"),
    *(
        (lambda make=make, bad=bad: make(forcing=bad), "forcing = .* was expected")
        for bad in (3, Harmonic, {1: -1.0}, [1.0])
        for make in (partial(cb.symmetric, **HERE), partial(cb.simulate, STATE, **HERE, periods=1))
    ),
    *(
        (lambda make=make, bad=bad: make(lattice=bad),
         r"Ring\(20\).*OpenChain\(9\), Grid\(5, 5\), Lattice\(stiffness\)")
        for bad in (20, Ring, "open:9")
        for make in (partial(cb.symmetric, **HERE), partial(cb.zones, k=0.8))
    ),
    # as they are typed
    *(
        (lambda typed=typed: lattice_by(typed, None), f"^--lattice {typed}: expected ring:20")
        for typed in (
            "ring", "ring:", "ring:0", "ring:5x5", "ring:9:free", "ring:9999999999", "open:9:loose",
            "open:-3", "open:9:free:fixed", "grid:5", "grid:5x5:fixed", "grid:5x5x5", "torus:5",
            "open:2:weights=1,2", "masses=1,2",
        )
    ),
    *(
        (lambda typed=typed: lattice_by(typed, None), f"^{sentence}")
        for typed, sentence in {
            "open:2:masses=1,x": "--lattice open:2:masses=1,x: masses=1,x: numbers apart by commas",
            "open:2:drive=": "--lattice open:2:drive=: drive=: numbers apart by commas",
            "open:2:masses=1,2:masses=1,2": "--lattice .*: masses are given twice",
            "open:2:masses=1": r"masses = \[1.0\] has shape \(1,\)",
            "ring:2:masses=1,0": r"masses\[1\] = 0: every mass must be positive",
            "open:2:springs=1,-1": r"springs\[1\] = -1: none may be negative",
        }.items()
    ),
    (lambda: lattice_by("ring:5", 5), "^--lattice ring:5 and --sites 5: give one of the two"),
    *(
        (lambda typed=typed: walls_by(typed, None), f"^walls {' '.join(typed)}: one pair for all")
        for typed in (("-1,1", "0,2"), ("3:-1,1", "3:0,2"))
    ),
    (lambda: walls_by(["1,2,1", "0:2"], 3), "^walls 1,2,1 0:2: each site has its own already"),
    (lambda: Walls.given([1.0] * 8).placed(cb.OpenChain(9)),
     "^walls of 8 sites are given one by one: .* for all, or one for each of 9 sites"),
    (lambda: Walls.given([1.0] * 8).placed(cb.lattice.InfiniteChain()),
     "^walls of 8 sites are given one by one: .* for all is expected on the infinite"),
    *(
        (lambda walls=walls: Walls.given(walls), f"^{name} = .*, or a number above 0 for both")
        for walls, name in ((-1, "walls"), ([1, 0, 1], r"walls\[1\]"), ("2", "walls"))
    ),
    *(
        (lambda typed=typed: walls_by([typed], None), f"^walls {typed}: LOW,HIGH is expected")
        for typed in ("low", "1,,1", "low,1", "3:")
    ),
    *(
        (lambda typed=typed: walls_by([typed], None), f"^walls {typed}: SITE:LOW,HIGH is exp")
        for typed in (":-1,1", "a:-1,1", "-1:-1,1", "1.5:-1,1")
    ),
]  # fmt: skip


def test_lattices_and_walls_are_those_that_are_typed() -> None:
    lattices = {
        "ring:20": Ring(20), "RING:3": Ring(3), "open:9": cb.OpenChain(9),
        "open:9:free": cb.OpenChain(9), "open:9:fixed": cb.OpenChain(9, ends="fixed"),
        "grid:5x4": cb.Grid(5, 4), "grid:5x4:periodic": cb.Grid(5, 4, periodic=True),
    }  # fmt: skip
    for typed, lattice in lattices.items():
        assert lattice_by(typed, None) == lattice
    assert (lattice_by(None, 7), lattice_by(None, None)) == (Ring(7), InfiniteChain())
    assert walls_by([], 3) is None
    assert walls_by(["-1,2"], 3) == (-1.0, 2.0)
    assert walls_by(["2:none,0.5"], 3) == walls_by(["2:none,0.5"], None) == {2: (None, 0.5)}
    every = {0: (-1.0, 1.0), 1: (None, 0.5), 2: (-1.0, 1.0)}
    assert walls_by(["1:none,0.5", "-1,1"], 3) == every


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        ("1,a\n-1,1", "could not convert string to float: 'a'"),
        ("1 -1", "1 rows of 2 numbers; a square matrix is expected"),
        ("1;-1\n-1 1 0\n", "2 rows of 2, 3 numbers"),
        ("\n", "0 rows of no numbers"),
    ],
)
def test_a_file_without_a_stiffness_matrix_is_refused(content: str, reason: str, tmp_path: Path):
    (tmp_path / "m.csv").write_text(content)
    with pytest.raises(BadInput, match=rf"^no stiffness matrix in .*m\.csv: {re.escape(reason)}"):
        lattice_by(str(tmp_path / "m.csv"), None)
    (tmp_path / "m.graphml").write_text(content)
    with pytest.raises(BadInput, match=r"^no graph in .*m\.graphml: "):
        lattice_by(str(tmp_path / "m.graphml"), None)
    (tmp_path / "M.CSV").write_text("1, -1\n\n-1; 1\n")
    assert np.array_equal(lattice_by(str(tmp_path / "M.CSV"), None).stiffness, PAIR)


@pytest.mark.parametrize(("made", "sentence"), CASES, ids=[words[:40] for _, words in CASES])
def test_it_is_refused_in_a_sentence(made: Callable[[], Any], sentence: str) -> None:
    with pytest.raises(BadInput, match=sentence):
        made()


# --- numbers as they come in ----------------------------------------------------------------------


def test_a_start_behind_a_wall_is_refused_with_the_site_that_is() -> None:
    orbit = cb.orbits.symmetric_roots(0.99, 0.2, 0.8)[0]
    most = abs(orbit.displacement(1, np.linspace(0.0, 2.0 * np.pi, 10001))).max()
    with pytest.raises(BadInput, match=rf"beyond GR: no breather: site 1 reaches .* {most:.5f}"):
        cb.trace(orbit, "a")


def test_real_takes_numbers_and_nothing_that_looks_like_one() -> None:
    for good in (2, 2.0, np.float32(2), np.int8(2), Fraction(2), np.array(2.0)):
        assert real(good) == 2.0
        assert type(real(good)) is float
    for bad in ("2", b"2", bytearray(b"2"), True, np.True_, None, 2j, [2.0], np.array([2.0]), {}):
        assert math.isnan(real(bad))
    assert math.isnan(real(10**400))


def test_a_number_is_within_its_range_ends_included() -> None:
    for value in (0.0, 1, 0.5):
        assert number("k", value, 0.0, 1.0, "a share") == value
    for value in (-1e-9, 1.0000001, math.nan, math.inf, -math.inf, "0.5"):
        with pytest.raises(BadInput, match=r"^k = .*: a share, a finite number, was expected\."):
            number("k", value, 0.0, 1.0, "a share")
    with pytest.raises(BadInput):
        number("a", math.inf, 0.0, math.inf, "an amplitude")


def test_a_whole_number_is_one_that_can_be_counted() -> None:
    assert [whole("n", value, 1) for value in (1, 7, np.int64(3), MOST)] == [1, 7, 3, MOST]
    assert type(whole("n", np.int64(3), 1)) is int
    for value in (0, -5, 2.0, 1.5, True, "3", None):
        with pytest.raises(BadInput, match=r"^n = .*: a whole number, at least 1, was expected\."):
            whole("n", value, 1)
    with pytest.raises(BadInput, match=rf"^n is above {MOST}: no computer counts that far\."):
        whole("n", MOST + 1, 1)
    with pytest.raises(BadInput, match="no computer counts that far"):
        whole("n", 10**400, 1)


def test_numbers_keep_their_shape() -> None:
    assert numbers("u", [[1, 2], [3, 4]]).shape == (2, 2)
    assert numbers("u", 3).shape == ()
    assert numbers("u", np.arange(3, dtype=np.uint8)).dtype == float
    assert numbers("u", [Fraction(1, 2), 2]).tolist() == [0.5, 2.0]
    wrong = ([1.0, math.nan], [math.inf], ["1"], [True, False], [1j], [[1.0], [1.0, 2.0]], None)
    for value in (*wrong, [object()], [10**400]):
        with pytest.raises(BadInput, match=r"^u.* = .*: finite real numbers were expected\."):
            numbers("u", value)


def test_a_row_has_one_number_at_least() -> None:
    assert row("u", 3.0, "a row of it").tolist() == [3.0]
    assert row("u", (1, 2), "a row of it").tolist() == [1.0, 2.0]
    for value in ([], [[1.0, 2.0]]):
        with pytest.raises(BadInput, match=r"^u = .*: a row of it, a row of finite numbers"):
            row("u", value, "a row of it")


def test_kinds_are_called_with_their_article() -> None:
    assert [kind_of(one) for one in (None, 1, [], "a", np.zeros(1), Ring(3))] == [
        "None", "an int", "a list", "a str", "a ndarray", "a Ring",
    ]  # fmt: skip
    check_kind(1, (int, str), "a word or a number")
    check_kind("a", (int, str), "a word or a number")
    with pytest.raises(BadInput, match=r"^a word or a number was expected, got a list$"):
        check_kind([], (int, str), "a word or a number")


# --- branches -------------------------------------------------------------------------------------


def test_a_branch_is_asked_by_name_or_by_number_alone() -> None:
    branch = cb.trace(problem(), "mu", within={"mu": (-1, 1)}, events=())
    for wrong in (1.5, None, (0, 1)):
        with pytest.raises(BadInput, match=r"^branch\[.*\]: the name of a column or the number of"):
            branch[wrong]
    with pytest.raises(BadInput, match="'nu'"):
        branch["nu"]
