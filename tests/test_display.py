"""Notebooks and terminals: what they show of values and of progress, without anything fetched."""

from __future__ import annotations

import dataclasses
import re
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from xml.etree import ElementTree

import matplotlib as mpl
import nbformat
import numpy as np
import pytest
from IPython.core.completer import provisionalcompleter
from IPython.core.interactiveshell import InteractiveShell
from nbclient import NotebookClient

import contbreather as cb
import contbreather.simulation as sim
from contbreather import progress, studies
from contbreather.certified import certify
from contbreather.errors import BadInput
from contbreather.orbits.multibreathers import multibreathers
from contbreather.orbits.normal_form import pitchfork_form
from contbreather.orbits.zone_diagram import KINDS, Zones
from contbreather.plotting import pictures, plot_orbit, style
from contbreather.plotting.canvas import CYCLE, DASHES, GREY
from contbreather.simulation.classify import judge
from contbreather.tables import Column, HtmlRepr, Sheet
from tests.stability.half import over_reflection, unstable_count

from .apart import HUNG

ON: dict[str, Any] = {"a": 0.5, "gamma": 0.08, "k": 0.8}
LINE: dict[str, Any] = {"residual": lambda x, p: x - p["mu"] * np.arange(1, x.size + 1)}
WORDS_ALONE = ("Zones without curves", "an empty folder", "Verdict", "Admissibility")


@pytest.fixture(scope="module")
def values(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """One of each type, the notable ones twice."""
    b = cb.symmetric(**ON)
    branch = cb.trace(b, "a", within={"a": (0.4, 0.9)})
    mine = cb.Problem(**LINE, start={"x": 0.0}, params={"mu": 0.0})
    many = cb.Problem(**LINE, start={"u": np.zeros(9)}, params={"mu": 0.0})
    u, v = sim.Axis("u", 0, [-0.9, 0.9]), sim.Axis("v", 0, [-1.0, 1.0])
    with ThreadPoolExecutor(1) as one:
        basin = sim.attraction(b.state(5), u, v, **ON, periods=2, executor=one)
    kept, empty = (cb.Run(tmp_path_factory.mktemp(name)) for name in ("kept", "empty"))
    kept.keep(branch=branch, back=branch.reversed())
    fork = cb.trace(cb.symmetric(0.77, 0.04, 0.8), "a", within={"a": (0.77, 0.78)})
    walk = {"within": {"mu": (0, 1)}, "events": ()}
    return {
        "Orbit": b,
        "Orbit of a ring": b.on(cb.Ring(12)),
        "Branch": branch,
        "Point": branch[2],
        "special Point": branch.first("GR"),
        "Point of a plain problem": cb.trace(mine, "mu", **walk)[1],
        "Point of an array": cb.trace(many, "mu", **walk)[1],
        "arms": cb.switch(fork.first("PF"), within={"a": (0.77, 0.78)}),
        "Verdict": b.stability(sites=20),
        "Admissibility": b.admissibility(),
        "Verdict on a run": judge(cb.simulate(b.state(4), **ON, periods=30)),
        "Diagram": cb.diagram(mine, "mu", **walk),
        "Zones": cb.zones(k=0.8, within={"gamma": (0, 0.03)}),
        "zones of several values": cb.zones(k=[0.7, 0.8], within={"gamma": (0, 0.03)}),
        "Zones without curves": Zones(("k", 0.8), ("gamma", "a"), dict.fromkeys(KINDS, ())),
        "Run": cb.simulate(b.state(10), **ON, periods=2),
        "Run with a record": cb.simulate(b.state(10), **ON, periods=2, sample=sim.Sample((0, 1))),
        "SmoothRun": sim.simulate_smooth(b.state(4), m=5, **ON, periods=1),
        "Sweep": sim.sweep(b.state(10), "a", [0.5, 0.4], periods=2, **ON),
        "Basin": basin,
        "results on disk": kept,
        "an empty folder": empty,
    }  # fmt: skip


def test_what_a_table_says_is_what_the_result_has(tmp_path: Path) -> None:
    """Of results that are numbers and verdicts alone; notebooks show them without a picture."""
    b, calm = cb.symmetric(**ON), cb.symmetric(a=0.1, gamma=0.05, k=0.8)
    proof, lossy = b.certify(), {"a": 0.1, "gamma": 0.05, "k": 0.8, "damping": 0.02}
    motion = sim.periodic(calm.state(6), **lossy, symmetric=True)
    waves, count = over_reflection(0.08, 0.8, 0.3), unstable_count(0.11, 0.8, 0.3)
    stream = sim.record(tmp_path / "run.nc", b.state(5), **ON, periods=3)
    state, lost = b.state(9), sim.lyapunov(calm.state(3), a=0.1, gamma=0.05, k=0.8, periods=50)
    energy = sim.localisation(*state, a=0.5, gamma=0.08)
    turning = np.exp(0.3j * np.arange(400))
    turns = sim.rotation(turning.real, turning.imag)
    fork = cb.trace(cb.symmetric(0.77, 0.04, 0.8), "a", within={"a": (0.77, 0.78)}).first("PF")
    form = pitchfork_form(fork.solution)
    (alone,) = multibreathers(cb.Ring(4), a=0.5, gamma=0.02, k=0.8, most=1)
    rows = [
        (proof, {"exists": "yes", "the only one within": proof.alone, "admissible": "yes",
                 "multipliers of QS outside": 0, "p": proof.enclosure["p"].text}),
        (motion, {"closes to": motion.residual, "largest |multiplier|": motion.largest,
                  "multipliers outside": motion.unstable, "damping": 0.02}),
        (stream, {"sites": 5, "periods": 3, "until t =": stream.end, "a": 0.5}),
        (count, {"multipliers outside": count.count, "certain": "yes", "at nu": count.nu}),
        (energy, {"states": 1, "largest": energy.participation.max()}),
        (turns, {"rotation number": turns.number, "its error": turns.error}),
        (form, {"criticality": form.criticality, "coefficient": form.coefficient}),
        (alone, {"sites": "0", "choices alike": 4, "reaches gamma": 0.02, "ends with": None}),
    ]  # fmt: skip
    for value, expected in rows:
        there = dict(value.table().rows)
        assert {name: there[name] for name in expected} == expected
    assert waves.table().rows == [
        ("gain", waves.gain, waves.nu), ("growth", waves.growth, waves.growth_nu),
    ]  # fmt: skip
    assert lost.table().rows == list(zip(lost.exponents, lost.error, strict=True))
    for value in (*(value for value, _ in rows), waves, lost):
        assert "<table" in value._repr_html_()
        assert len(pictures_of(value._repr_html_())) == (value is alone)  # that of its orbit


@pytest.mark.slow
def test_a_covering_is_a_line_for_each_count_and_one_for_each_gap() -> None:
    start = cb.symmetric(a=0.5, gamma=0.1, k=0.8)
    over = certify(cb.trace(start, "gamma", within={"gamma": (0.1, 0.13)}, towards="up"))
    rows = over.table().rows
    assert rows == [
        *((interval.text, n) for n in (0, None, 2) for interval in over.counted(n)),
        *(("not proved", why) for why in over.unproved),
    ]
    assert {n for _, n in rows if not isinstance(n, str)} == {0, None, 2}


# what is given to a computation, what a result is made of, and figures
NO_RESULTS = {
    "Tile", "DefiningSystem", "Event", "Problem", "Steps", "SwitchingProblem", "Collocation",
    "Filippov", "Flow", "GuardCrossing", "Piece", "InfiniteChain", "Ring", "Fourier", "Harmonic",
    "Samples", "Symbolic", "Closure", "Region", "Figure2", "MultiplierFigure", "TimeSeries", "Axis",
    "Sample", "SmoothConditions",
}  # fmt: skip


def test_every_other_public_value_has_a_table() -> None:
    parts = (cb.certified, cb.continuation, cb.flows, cb.lattice, cb.orbits, cb.paper,
             cb.simulation, cb.stability, studies)  # fmt: skip
    public = {name: getattr(part, name) for part in parts for name in part.__all__}
    values = {name: each for name, each in public.items() if dataclasses.is_dataclass(each)}
    shown = {name for name, each in values.items() if issubclass(each, HtmlRepr)}
    assert values.keys() - shown == NO_RESULTS
    assert all(values[name].table is not HtmlRepr.table for name in shown)


def test_zones_of_several_values_have_one_table() -> None:
    several = cb.zones(k=[0.7, 0.8], within={"gamma": (0.06, 0.08)})
    rows = [row for diagram in several for row in diagram.table().rows]
    assert [row[:2] for row in rows] == [(0.7, "PF-GR"), (0.8, "PF-GR")]
    assert several.table().rows == rows


def pictures_of(shown: str) -> list[str]:
    return re.findall(r"<svg.*?</svg>", shown, flags=re.DOTALL)


@pytest.mark.slow
def test_each_value_shows_a_picture_and_a_table_and_fetches_nothing(values) -> None:
    for name, value in values.items():
        shown = value._repr_html_()
        page = ElementTree.fromstring(re.sub(r"<svg.*?</svg>", "", shown, flags=re.DOTALL))
        assert page.find(".//table") is not None, name
        pictures = pictures_of(shown)
        drawn = 2 if name == "zones of several values" else name not in WORDS_ALONE
        assert len(pictures) == drawn, name
        for picture in pictures:
            assert len(list(ElementTree.fromstring(picture).iter())) > 50, name
        fetched = re.findall(r"""(?:src|href)=["'](?!#|data:)([^"']*)""", shown)
        assert fetched == [], name
        assert "<script" not in shown
        assert len(shown) < 60_000, name


def table_of(shown: str) -> list[list[str]]:
    """The heading, if there is one, and the rows."""
    page = ElementTree.fromstring(re.sub(r"<svg.*?</svg>", "", shown, flags=re.DOTALL))
    return [["".join(cell.itertext()) for cell in row] for row in page.iterfind(".//tr")]


@pytest.fixture
def without_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pictures, "inline", lambda draw: "")


def test_rows_of_a_table_are_what_their_names_say(values, without_pictures) -> None:
    """Numbers with eight digits, those of a sweep with five, of what the value itself has."""
    shown = {name: table_of(value._repr_html_()) for name, value in values.items()}
    numbers: dict[str, dict[str, float]] = {
        name: {row[0]: float(row[1]) for row in rows if re.fullmatch(r"-?[\d.]+(e-?\d+)?", row[-1])}
        for name, rows in shown.items()
    }
    near = partial(pytest.approx, rel=1e-7, abs=1e-15)
    b, special, run = values["Orbit"], values["special Point"], values["Run"]
    assert numbers["Orbit"] == near({
        **ON, "p": b.p, "phi": b.phi, "chi": b.chi, "max |u_1|": b.admissibility().max_neighbour,
    })  # fmt: skip
    corner = cb.symmetric(a=0.6, gamma=0.05, k=0.7, lattice=cb.Grid(3, 3), site=1)
    highest = max(abs(corner.displacement(n, np.linspace(0, 7, 2000))).max() for n in (0, 2, 4))
    assert dict(corner.table().rows)["max |u| of its neighbours"] == pytest.approx(highest, 1e-4)
    alone = cb.symmetric(a=0.6, gamma=0.05, k=0.7, lattice=cb.Ring(1)).table()
    assert [name for name, _ in alone.rows] == ["a", "gamma", "k", "p", "phi", "chi"]
    words = dict(shown["Orbit"][7:])
    assert [row[1] for row in shown["Orbit"] if row[0] == "impact of site 0"] == [
        f"wall {hit.wall:+d}, t = {hit.time:.6g}, velocity {hit.before:.6g}" for hit in b.hits
    ]
    assert words["forcing"] == b.conditions.forcing.describe()
    assert words["admissible"] in repr(b.admissibility())
    margins = b.admissibility()
    assert margins.table().title == f"admissible: {margins.reason}"
    assert words["stability"] == repr(b.stability()).strip("<>")
    for sites, judged in ((100, True), (101, False)):
        on_ring = b.on(cb.Ring(sites))._repr_html_()
        assert (">stability<" in on_ring) == judged
    own = {n: special[n] for n in (*special.curve.problem.names, *special.curve.problem.record)}
    own |= {"arclength": special.arclength, "residual": float(f"{special.residual:.1e}")}
    own |= {name: value for name, value in special.detail.items() if np.isscalar(value)}
    assert numbers["special Point"] == near(own)
    tree, zones, swept = values["Diagram"], values["Zones"], values["Sweep"]
    assert shown["Diagram"] == [["branch", "born at", "points", "special", "end"]] + [
        [str(i), birth.place.name if birth.place else "", str(len(one)),
         " ".join(point.label for point in one.special), one.stop.value]
        for i, (one, birth) in enumerate(zip(tree, tree.births, strict=True))
    ]  # fmt: skip
    assert shown["Zones"][0] == ["k", "meeting", *(names := ["gamma", "a", "p", "phi"])]
    assert [row[1] for row in shown["Zones"][1:]] == zones.meetings()
    for row, point in zip(shown["Zones"][1:], zones.special, strict=True):
        assert [float(cell) for cell in row[2:]] == near([point[n] for n in names])
    names = ["value", "p", "amplitude", "participation", "tilt", "change"]
    assert shown["Sweep"][0] == ["a", *names[1:]]
    for i, row in enumerate(shown["Sweep"][1:]):
        exact = [float(f"{getattr(swept, name)[i]:.5g}") for name in names]
        assert [float(cell) for cell in row] == pytest.approx(exact, nan_ok=True)
    assert numbers["Run"] == near({
        "sites": 10, "periods": 2, "impacts": len(run.impacts), "until t =": run.end,
        "then |u| <=": abs(run.final.u).max(), "a": 0.5, "gamma": 0.08, "k": 0.8, "damping": 0.0,
    })  # fmt: skip
    assert "impacts" not in numbers["SmoothRun"]
    assert shown["results on disk"][0] == ["name", "what", "points"]
    assert shown["results on disk"][1:] == [
        [name, value.describe(), ", ".join(point.label for point in value.special)]
        for name, value in values["results on disk"].items()
    ]
    basin, outcomes = values["Basin"], dict(shown["Basin"])
    assert float(outcomes.pop("share that returned")) == pytest.approx(basin.share, rel=1e-3)
    there = {outcome.words: str(np.sum(basin.outcome == outcome)) for outcome in sim.Outcome}
    assert outcomes == {outcome: count for outcome, count in there.items() if count != "0"}


def test_names_in_brackets_are_completed_by_the_tab_key(values: dict[str, Any]) -> None:
    shell = InteractiveShell()
    for name, begun, whole in (
        ("Branch", "asy", "asymmetry"), ("special Point", "gam", "gamma"),
        ("Zones", "N", "NS"), ("results on disk", "bac", "back"),
    ):  # fmt: skip
        shell.user_ns["it"], typed = values[name], f'it["{begun}'
        with provisionalcompleter():
            found = shell.Completer.completions(typed, len(typed))
            assert [one.text for one in found] == [whole]


def test_of_a_long_table_the_first_rows_are_shown_and_the_rest_is_counted(without_pictures) -> None:
    jumps = [cb.user("mu", 0.02 * i) for i in range(1, 40)]
    line = cb.Problem(**LINE, start={"x": 0.0}, params={"mu": 0.0})
    branch = cb.trace(line, "mu", within={"mu": (0, 1)}, events=jumps)
    shown = branch._repr_html_()
    assert len(table_of(shown)) == 1 + 30
    assert f"<p>and {len(branch.special) - 30} more</p>" in shown


@pytest.mark.parametrize("more", [-1, 0, 1, 2])
def test_one_row_beyond_a_table_is_counted_and_none_is_not(more: int) -> None:
    rows = [(f"row {i}", "1") for i in range(5 + more)]
    shown = Sheet.of(rows).html(most=5)
    assert shown.count("<tr>") == min(len(rows), 5)
    assert shown.endswith(f"<p>and {more} more</p>" if more > 0 else "</table>")


def test_what_a_user_calls_things_is_text_in_a_page_not_markup() -> None:
    label = "<script>alert(1)</script>"
    mine = cb.Problem(**LINE, start={"x": 0.0}, params={"mu": 0.0}, label=label)
    assert "<script>" not in cb.trace(mine, "mu", within={"mu": (0, 1)}, events=())._repr_html_()


def test_representations_are_one_short_line(values) -> None:
    more = {
        "Record": values["Run with a record"].record,
        "State": values["Run"].final,
        "strobe": values["Run"].strobe,
        "Localisation": sim.localisation(
            *values["Run"].strobe, values["Run"].times, a=0.5, gamma=0.08
        ),
        "Curve": values["Branch"].curve,
        "Points": values["Branch"].points,
        "Lattice": cb.Lattice(np.diag(np.full(40, 2.0))),
    }
    for name, value in (values | more).items():
        assert re.fullmatch(r".{5,260}", repr(value)), name
        assert " object at 0x" not in repr(value), name


# --- pieces of a branch ---------------------------------------------------------------------------


def test_a_slice_of_a_branch_is_a_branch_that_says_where_it_was_cut(values) -> None:
    branch = values["Branch"]
    piece = branch[2:-1]
    assert isinstance(piece, cb.Branch)
    assert piece.points == branch.points[2:-1]
    assert piece["a"].tolist() == branch["a"][2:-1].tolist()
    assert (piece.began, piece.stop) == (cb.continuation.Stop.CUT, cb.continuation.Stop.CUT)
    assert (branch[:3].began, branch[3:].stop) == (branch.began, branch.stop)
    assert branch[-2:].first("GR") is branch.first("GR")
    assert branch[:].points == branch.points
    assert branch[::2].points == branch.points[::2]
    whole = branch[:3].join(branch[2:])
    assert (len(whole), whole.stop, whole.began) == (len(branch), branch.stop, branch.began)


@pytest.mark.parametrize("empty", [slice(5, 5), slice(900, None), slice(None, None, -1)])
def test_a_piece_without_points_is_refused(values, empty: slice) -> None:
    with pytest.raises(BadInput, match=r"of \d+ points: a piece has at least one point"):
        values["Branch"][empty]


# --- one orbit in time ----------------------------------------------------------------------------


def test_an_orbit_is_drawn_between_its_walls_with_its_impacts_on_them(values) -> None:
    orbit = values["Orbit"]
    ax = plot_orbit(orbit, sites=(0, 1)).axes
    for n, line in enumerate(ax.get_lines()[:2]):
        t = 2 * np.pi * line.get_xdata()
        assert np.ptp(t) == pytest.approx(2 * np.pi)
        np.testing.assert_allclose(line.get_ydata(), orbit.displacement(n, t), atol=1e-12)
    dots = [line for line in ax.get_lines() if line.get_marker() == "o"]
    assert [dot.get_ydata()[0] for dot in dots] == [hit.wall for hit in orbit.hits]
    for dot in dots:
        at = orbit.displacement(0, 2 * np.pi * dot.get_xdata()[0])
        assert at == pytest.approx(dot.get_ydata()[0])
    looks = [(line.get_color(), line.get_linestyle()) for line in ax.get_lines()[:2]]
    assert looks == [*zip(CYCLE[:2], DASHES[:2], strict=True)]  # told apart in grey, too
    walls = [line for line in ax.get_lines() if line.get_color() == GREY and line not in dots]
    assert {line.get_ydata()[0] for line in walls} == {-1.0, 1.0}
    assert plot_orbit(values["Point"], ax=ax).axes is ax


# --- the style ------------------------------------------------------------------------------------


def test_the_style_is_a_file_that_matplotlib_finds() -> None:
    with style():
        here = {name: mpl.rcParams[name] for name in ("font.size", "pdf.fonttype")}
        looks = [(look["color"], look["linestyle"]) for look in mpl.rcParams["axes.prop_cycle"]]
    assert looks == [(colour, dashes) for dashes in DASHES for colour in CYCLE]
    import matplotlib.style

    with matplotlib.style.context("contbreather.plotting.journal"):
        assert {name: mpl.rcParams[name] for name in here} == here == {
            "font.size": 8.0, "pdf.fonttype": 42,
        }  # fmt: skip


# --- a notebook -----------------------------------------------------------------------------------

CELLS = [
    "import contbreather as cb, contbreather.progress as progress, sys\n"
    "progress.PATIENCE = progress.INTERVAL = 0.0",
    "branch = cb.trace(cb.symmetric(0.5, 0.04, 0.8), 'a', within={'a': (0.5, 0.6)})",
    "assert 'matplotlib.pyplot' not in sys.modules\ncb.plot(branch);",
    "branch",
    "with progress.Bar(True, 7, 'rows') as bar:\n    bar.advance(3)",
    "cb.plotting.plot_orbit(branch[0]);",
]


@pytest.mark.slow
def test_a_fresh_notebook_shows_progress_the_first_plot_and_values(monkeypatch) -> None:
    """No widgets, no magic command, no import of pyplot."""
    monkeypatch.delenv("MPLBACKEND", raising=False)  # a notebook's own
    book = nbformat.v4.new_notebook(cells=list(map(nbformat.v4.new_code_cell, CELLS)))
    seen: list[str] = []

    class Watching(NotebookClient):
        def process_message(self, msg: Any, cell: Any, cell_index: int) -> Any:
            seen.append(str(msg["content"].get("data", {}).get("text/html", "")))
            return super().process_message(msg, cell, cell_index)

    Watching(book, timeout=HUNG, startup_timeout=HUNG, kernel_name="python3").execute()
    shown = [[out.get("data", {}) for out in cell.outputs] for cell in book.cells]
    assert any("points, a = " in html for html in seen)
    assert [data["text/html"] for data in shown[1]] == [""]  # and is gone when it is done
    assert ["image/png" in data for data in shown[2]] == [True]
    assert "<svg" in shown[3][0]["text/html"]
    assert shown[3][0]["text/plain"].startswith("<Branch ")
    assert any('<progress value="3" max="7"></progress> 3/7 rows' in html for html in seen)
    assert ["image/png" in data for data in shown[5]] == [True]
    assert not any("ipywidgets" in str(cell.outputs) for cell in book.cells)


def test_progress_begins_after_a_second_and_is_said_ten_times_a_second_at_most(monkeypatch) -> None:
    clock, shown = [0.0], []
    line = SimpleNamespace(
        show=lambda text, done: shown.append((clock[0], text, done)),
        stop=lambda: shown.append("stop"),
    )
    monkeypatch.setattr(progress, "_Terminal", lambda *asked: shown.append(asked) or line)
    monkeypatch.setattr(progress.sys.stderr, "isatty", lambda: True)
    monkeypatch.setattr(progress.time, "monotonic", lambda: clock[0])
    moments = [0.0, 0.5, 0.999, 1.0, 1.05, 1.0999, 1.11, 1.2, 1.22]
    with progress.Bar(True, 9, "rows") as bar:
        for done, clock[0] in enumerate(moments):
            bar.advance(done)
    lines = [(t, f"{moments.index(t)}/9 rows", moments.index(t)) for t in (1.0, 1.11, 1.22)]
    assert shown == [(9, "rows"), *lines, lines[-1], "stop"]


def test_progress_is_shown_before_the_first_item_is_done(monkeypatch, capsys) -> None:
    monkeypatch.setattr(progress, "PATIENCE", 0.0)
    with progress.Bar(True, 7, "rows") as bar:
        bar.first.join()
    assert "0/7 rows" in capsys.readouterr().err
    with progress.Bar(False, 7, "rows"):
        pass
    assert capsys.readouterr().err == ""


def test_a_table_is_one_wherever_it_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    branch = cb.trace(cb.symmetric(0.6, 0.04, 0.8), "a", within={"a": (0.5, 0.8)})
    print(branch.table())
    out = capsys.readouterr().out
    assert "PF1" in out
    assert "Column(" not in out
    assert branch.table()._repr_html_().startswith("<table>")


# --- tables: whole numbers, in the room there is --------------------------------------------------

THIRD, NAMES = Column("third", [1 / 3, 200 / 3]), Column("label", ["LP1", "a longer word"])
SPARE = Column("spare", [2.0, None], spare=True)


def cells(sheet: Sheet, width: int | None = None) -> dict[str, list[str]]:
    return {column.header: list(column.cells) for column in sheet.table(width).columns}


def test_where_there_is_room_numbers_have_twelve_digits() -> None:
    found = cells(Sheet([NAMES, THIRD, SPARE]))
    assert found["third"] == ["0.333333333333", "66.6666666667"]
    assert found["spare"] == ["2", "–"]
    assert found["label"] == ["LP1", "a longer word"]


def test_what_is_spare_goes_first_then_digits_down_to_four() -> None:
    sheet = Sheet([NAMES, THIRD, SPARE])
    whole = 1 + (13 + 3) + (14 + 3) + (5 + 3)
    assert list(cells(sheet, whole)) == ["label", "third", "spare"]
    assert list(cells(sheet, whole - 1)) == ["label", "third"]
    assert cells(sheet, whole - 1)["third"][0] == "0.333333333333"
    assert cells(sheet, whole - 8 - 3)["third"] == ["0.333333333", "66.6666667"]
    assert cells(sheet, 5)["third"] == ["0.3333", "66.67"]


def test_where_four_digits_are_too_many_columns_go_from_the_right_and_the_caption_says_so() -> None:
    names, numbers = Column("label", ["LP1"]), [Column(name, [-1 / 3]) for name in "abc"]
    table = Sheet([names, *numbers]).table(8 + 2 * 10 + 1)
    assert [column.header for column in table.columns] == ["label", "a", "b"]
    assert table.caption == "No room for c."


def test_a_column_may_ask_for_fewer_digits() -> None:
    few = Column("few", [1 / 3], digits=5)
    assert cells(Sheet([few]))["few"] == ["0.33333"]
    assert cells(Sheet([few]), 3)["few"] == ["0.3333"]


def test_numbers_lean_to_the_right_and_words_to_the_left() -> None:
    assert (THIRD.leaning, NAMES.leaning, SPARE.leaning) == ("right", "left", "right")
    assert Column("x", [1.0], right=False).leaning == "left"
    justified = {c.header: c.justify for c in Sheet([NAMES, THIRD]).table().columns}
    assert justified == {"label": "left", "third": "right"}


@pytest.mark.parametrize("width", [None, 30])
def test_the_title_is_the_one_given(width: int | None) -> None:
    made = Sheet([THIRD], "above").table(width)
    assert (made.title, made.caption) == ("above", None)
    assert Sheet([THIRD]).table().title is None


def test_complex_numbers_keep_both_parts() -> None:
    assert cells(Sheet([Column("mu", [0.5 - 0.25j])]))["mu"] == ["0.5-0.25j"]
