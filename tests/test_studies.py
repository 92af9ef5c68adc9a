"""Studies: what their files may say, what is done of it, once, and what an interruption leaves."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import sys
import threading
from collections.abc import Callable
from concurrent.futures import Executor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import contbreather as cb
from contbreather.parameters import window_of
from contbreather.studies import Report, cluster, dry_run, read
from contbreather.studies import run as conduct
from contbreather.studies.tasks import tasks_of

from .apart import HUNG
from .typed import Run

SMALL = """
[branch.symmetric]
free = "a"
gamma = [0.02, 0.04]
k = 0.8
window = [0.7, 0.8]

[arms.arms]
of = "symmetric"
at = "PF1"
within = {a = [0.7, 0.79]}

[boundary.pitchforks]
of = "symmetric"
at = "PF1"
pair = ["gamma", "a"]
within = {gamma = [0.01, 0.05], a = [0.0, 1.0]}

[figure.tree]
draws = ["symmetric", "arms"]
x = "a"
"""


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("study") / "small.toml"
    path.write_text(SMALL)
    return path


@pytest.fixture(scope="module")
def done(study: Path) -> Report:
    return conduct(study, executor=1)


def test_everything_that_is_asked_for_is_in_a_file_of_its_own(done: Report) -> None:
    assert done.computed == [
        f"{name}/gamma={gamma}"
        for name in ("symmetric", "arms", "pitchforks")
        for gamma in (0.02, 0.04)
    ]
    kept = cb.load(done.folder)
    branch = kept["symmetric/gamma=0.04"]
    alone = cb.trace(cb.symmetric(0.7, 0.04, 0.8), "a", within={"a": (0.7, 0.8)})
    assert branch.first("PF")["a"] == pytest.approx(alone.first("PF")["a"], abs=1e-13)
    arm = kept["arms/gamma=0.04/arm1"]
    assert arm[0]["asymmetry"] == pytest.approx(0.0, abs=1e-9)
    assert "asymmetry" in arm.names
    line = kept["pitchforks/gamma=0.02"]
    assert line.free == "gamma"
    assert [path.name for path in done.written] == ["tree.png"]
    assert done.written[0].stat().st_size > 5_000


def test_results_do_not_go_where_a_file_is(study: Path, tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("")
    with pytest.raises(cb.BadInput, match=r"cannot write to .*taken: File exists; name a folder"):
        conduct(study, folder=tmp_path / "taken", executor=1)


@pytest.mark.slow
def test_what_is_finished_is_not_computed_again(study: Path, done: Report) -> None:
    times = {path: path.stat().st_mtime_ns for path in done.folder.rglob("*.nc")}
    again = conduct(study, executor=1)
    assert (again.computed, again.kept) == ([], done.computed)
    assert {path: path.stat().st_mtime_ns for path in times} == times


@pytest.mark.slow
def test_a_part_that_is_lost_is_computed_again_to_the_last_digit(study: Path, done: Report) -> None:
    path = done.folder / "pitchforks" / "gamma=0.04.nc"
    before = cb.load(path)
    path.unlink()
    assert conduct(study, executor=1).computed == ["pitchforks/gamma=0.04"]
    after = cb.load(path)
    assert all(np.array_equal(before[name], after[name], equal_nan=True) for name in before.names)


@pytest.mark.slow
def test_results_of_other_settings_are_replaced_only_on_demand(done: Report) -> None:
    other = done.folder.parent / "other.toml"
    other.write_text(SMALL.replace("[0.01, 0.05]", "[0.01, 0.06]"))
    with pytest.raises(cb.BadInput, match=r"other settings: pitchforks/gamma=0\.02, .*--again"):
        conduct(other, folder=done.folder, executor=1)
    copied = shutil.copytree(done.folder, other.with_suffix(""))
    report = conduct(other, executor=1, again=True)
    assert report.computed == ["pitchforks/gamma=0.02", "pitchforks/gamma=0.04"]
    assert max(cb.load(copied)["pitchforks/gamma=0.02"]["gamma"]) == 0.06


@pytest.mark.slow
def test_another_value_in_a_list_leaves_the_results_of_the_others(done: Report) -> None:
    more = done.folder.parent / "more.toml"
    shutil.copytree(done.folder, more.with_suffix(""))
    more.write_text(SMALL.replace("[0.02, 0.04]", "[0.02, 0.03, 0.04]"))
    report = conduct(more, executor=1)
    assert report.computed == [f"{name}/gamma=0.03" for name in ("symmetric", "arms", "pitchforks")]
    assert report.kept == done.computed


def test_a_figure_is_drawn_without_what_failed_and_says_so(tmp_path: Path) -> None:
    path = tmp_path / "study.toml"
    narrow = ONE.replace("[branch.b]", "[branch.c]") + "window = [1.5, 2]\n"
    path.write_text(f"{ONE}{narrow}" + DRAWN.format("'b', 'c'", ""))
    report = conduct(path, executor=1)
    assert {*report.failed} == {"c", "figure f"}
    assert report.failed["figure f"] == "drawn without c"
    assert [one.name for one in report.written] == ["f.png"]


@pytest.mark.slow
def test_a_figure_that_cannot_be_drawn_leaves_the_others(done: Report) -> None:
    text = '[figure.other]\ndraws = ["symmetric"]\ny = "p2"\n\n[figure.tree]'
    path = done.folder.parent / "figures.toml"
    path.write_text(SMALL.replace("[figure.tree]", text))
    report = conduct(path, folder=done.folder, executor=1)
    assert report.failed["figure other"].startswith("no column 'p2'")
    assert [one.name for one in report.written] == ["tree.png"]


REFUSED = {  # a study, the part that fails, and the library's sentence
    "window = [1.5, 2]": ("b", "no breather with gamma = 0, k = 0.8"),
    "[zones.y]\nk = [1.0]": ("y", "k = 1: zones need 0 < k < 1"),
    "[chain]\ndamping = 0.1": ("b", "on the infinite chain"),
    "[chain]\nlattice = 'open:6'\nsite = 7": ("b", "impact (7, 1): no such site on the open chain"),
    "[chain]\nlattice = 'ring:6'\nthreshold = 0.5": ("b", "threshold = 0.5"),
    "[chain]\nlattice = 'ring:6'\nwalls = ['1,-1']": ("b", "two numbers low < high"),
    "[chain]\nlattice = 'open:3'\nwalls = [1, 'x', 2]": ("b", r"walls[1] = 'x': two numbers"),
}


@pytest.mark.parametrize("text", REFUSED)
def test_what_the_library_refuses_is_the_reason_of_that_part(text: str, tmp_path: Path) -> None:
    path = tmp_path / "study.toml"
    path.write_text(f"{ONE}{text}\n" + DRAWN.format(f"'{REFUSED[text][0]}'", ""))
    failed, (name, sentence) = conduct(path, executor=1).failed, REFUSED[text]
    assert sentence in failed[name]
    assert f"there is nothing of {name}" in failed["figure f"]


def test_what_fails_says_why_and_the_others_go_on(run: Run) -> None:
    text = SMALL.replace("k = 0.8", "k = 0.8\nroot = 5", 1).replace("[0.02, 0.04]", "0.04")
    Path("small.toml").write_text(
        text + '\n[branch.good]\nfree = "a"\ngamma = 0.0\nk = 0.8\nwindow = [0.6, 0.62]\n'
    )
    status, out, err = run("run small.toml --workers 1 --json")
    report = json.loads(out)
    assert status == 1
    assert report["computed"] == ["good"]
    assert "root 5: the solutions of (11) are" in report["failed"]["symmetric"]
    assert report["failed"]["arms"] == "there is no symmetric to start from"
    assert report["failed"]["figure tree"] == "there is nothing of symmetric, arms to draw"
    assert "4 of the study failed: symmetric, arms, pitchforks, figure tree" in err
    status, out, _ = run("run small.toml --workers 1")
    assert status == 1
    assert "0 results computed, 1 were there" in out
    assert re.search(r"symmetric +│ failed +│ root 5", out)


PARTS = """
[branch.s]
free = "a"
gamma = [0.02, 0.04]
k = 0.8
window = [0.77, 0.78]

[arms.none]
of = "s/gamma=0.04"
at = "PF2"
optional = true

[arms.further]
of = "none/arm1"
at = "PD1"
optional = true

[boundary.line]
of = "s/gamma=0.040"
at = "PF1"
pair = ["gamma", "a"]
within = {gamma = [0.039, 0.041]}

[figure.absent]
draws = ["none"]

[figure.all]
draws = ["s/gamma=0.04", "none"]
"""


@pytest.fixture(scope="module")
def parts(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A study with optional parts that start from one member of a scan, carried out."""
    path = tmp_path_factory.mktemp("parts") / "parts.toml"
    path.write_text(PARTS)
    return path


@pytest.fixture(scope="module")
def conducted(parts: Path) -> tuple[Report, list[str]]:
    lines: list[str] = []
    return conduct(parts, executor=1, tell=lines.append), lines


def test_an_optional_part_whose_start_does_not_exist_is_absent_and_no_error(parts, conducted, run):
    report, _ = conducted
    assert report.failed == {}
    assert report.absent == {
        "none/gamma=0.04": "s/gamma=0.04 has no PF2; it has EP1, PF1, EP2",
        "further/gamma=0.04": "there is no none/gamma=0.04 to start from",
        "figure absent": "there is nothing of none to draw",
    }
    assert [path.name for path in report.written] == ["all.png"]
    status, out, _ = run(f"run {parts}")
    assert status == 0
    line = r"none/gamma=0.04 +│ absent, which is optional +│ s/gamma=0.04 has no PF2; it has EP1"
    assert re.search(line, out)
    required = parts.with_name("required.toml")
    required.write_text(PARTS.replace("optional = true", ""))
    failed = conduct(required, folder=report.folder, executor=1).failed
    assert {name: failed[name] for name in report.absent} == report.absent


def test_one_member_of_a_scan_is_a_start_and_what_comes_of_it_stays(parts, conducted):
    report, _ = conducted
    assert report.computed == ["s/gamma=0.02", "s/gamma=0.04", "line/gamma=0.04"]
    line = cb.load(report.folder)["line/gamma=0.04"]
    assert 0.04 in line["gamma"]
    whole = parts.with_name("whole.toml")
    whole.write_text(PARTS.replace("s/gamma=0.040", "s"))
    asked = dry_run(whole, folder=report.folder)
    assert [task.name for task in asked.left] == ["line/gamma=0.02"]


@pytest.mark.slow
def test_each_part_that_ends_is_a_line_where_there_is_no_terminal(conducted, parts, run):
    _, lines = conducted
    assert [line.partition(",")[0] for line in lines] == [f"{i} of 5" for i in range(1, 6)]
    assert lines[0] == "1 of 5, s/gamma=0.02"
    assert "none/gamma=0.04: none, s/gamma=0.04 has no PF2; it has EP1, PF1, EP2" in lines[2]
    (parts.parent / "parts" / "line" / "gamma=0.04.nc").unlink()
    _, out, err = run(f"run {parts} --workers 1")
    assert "contbreather: 1 of 1, line/gamma=0.04\n" in err
    assert "1 result computed, 2 were there" in out


def test_a_dry_run_lists_what_would_be_computed_and_does_nothing(tmp_path: Path, run: Run):
    path = tmp_path / "dry.toml"
    path.write_text("[chain]\nlattice = 'ring:6'\ndamping = 0.1\n" + PARTS)
    status, out, err = run(f"run {path} --dry-run --json")
    assert (status, err, list(tmp_path.iterdir())) == (0, "", [path])
    listed = json.loads(out)
    assert listed["on"] == "ring of 6, F = -a cos t, damping = 0.1"
    assert [(one["name"], one["conditions"]) for one in listed["parts"]] == [
        ("s/gamma=0.02", "branch in a at k = 0.8, gamma = 0.02, a from 0.77 to 0.78"),
        ("s/gamma=0.04", "branch in a at k = 0.8, gamma = 0.04, a from 0.77 to 0.78"),
        ("none/gamma=0.04", "arms of PF2 on s/gamma=0.04"),
        (
            "line/gamma=0.04",
            "boundary of PF1 on s/gamma=0.04 in (gamma, a), gamma from 0.039 to 0.041",
        ),
        ("further/gamma=0.04", "arms of PD1 on none/gamma=0.04/arm1"),
    ]
    assert {one["state"] for one in listed["parts"]} == {"to compute"}
    assert "5 of 5 parts to compute, on the ring of 6" in run(f"run {path} --dry-run")[1]


# --- mistakes -------------------------------------------------------------------------------------

WRONG = """
[chain]
forcing = "cos(t) + c3*cos(3*t)"
parameters = {c3 = 0.1}

[branch.one]
free = "a"
gama = 0.04
k = 1.8

[zones.two]
k = []
within = {a = [0.5]}

[atlas.three]
k = 0.8
over.c4 = [0.1]

[arms.four]
of = "none"

[figure.five]
draws = ["nix"]
file = "x.gif"
"""


CHAIN = """
[chain]
lattice = "opn:6"
site = 7
[branch.one]
mistake = 1
free = "c"
gamma = 0.04
k = 0.8
a = 1
[arms.two]
of = "one"
at = "PF1"
[atlas.r]
gamma = [0.1, 2]  # which that lattice may take
"""

MISTAKES = {
    "wrong": (WRONG, [
        (8, "branch.one.gama: unknown here; did you mean gamma?"),
        (9, "branch.one.k: k = 1.8: the restitution coefficient"),
        (12, "zones.two.k: []: at least one number was expected"),
        (13, "zones.two.within.a: List should have at least 2 items"),
        (17, "atlas.three.over: unknown forcing parameter 'c4'"),
        (19, "arms.four: at is missing"),
        (23, "figure.five.draws: nothing is called 'nix'"),
        (24, "figure.five.file: one of .png, .pdf, .svg was expected, got 'x.gif'"),
    ]),
    "chain": (CHAIN, [
        (2, "chain: lattice opn:6: expected ring:20"),
        (6, "branch.one.mistake: unknown here"),
    ]),
    "keys": ("[chain]\nlatice = 'ring:6'\nsitee = 3\ndamping = 'no'\n[zones.z]\nk = 2.0", [
        (2, "chain.latice: unknown here; did you mean lattice?"),
        (3, "chain.sitee: unknown here; did you mean site?"),
        (4, "chain.damping: values = 'no': finite real numbers were expected"),
        (6, "zones.z.k: k = 2"),
    ]),
}  # fmt: skip


@pytest.mark.parametrize("name", MISTAKES)
def test_all_mistakes_are_said_at_once_each_with_its_line(name: str, tmp_path: Path) -> None:
    path = tmp_path / f"{name}.toml"
    text, wanted = MISTAKES[name]
    path.write_text(text)
    with pytest.raises(cb.BadInput) as refused:
        read(path)
    first, *lines = str(refused.value).splitlines()
    assert first == f"{name}.toml has {len(wanted)} mistakes:"
    for (number, reason), line in zip(wanted, lines, strict=True):
        assert line.strip().startswith(f"line {number}, {reason}")


ONE = "[branch.b]\nfree = 'a'\ngamma = 0\nk = 0.8\n"
ARMS = "[arms.x]\nof = '{}'\nat = 'PF1'\n"
DRAWN = "[figure.f]\ndraws = [{}]\n{}\n"
ZONES, ATLAS = "[zones.z]\nk = 0.8\n", "[atlas.z]\nk = 0.8\n"
LINE = "[boundary.y]\nof = 'b'\nat = 'PF1'\npair = ['{}', '{}']\n"
RING = "[chain]\nlattice = 'ring:6'\n"


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "nothing is asked for"),
        ("[branch", "is not TOML"),
        # types
        ("[chain]\nsite = 0.5\n" + ONE, "chain.site: Input should be a valid integer, got 0.5"),
        ("[zones.z]\nk = [[0.8]]\n", "zones.z.k: [[0.8]]: at least one number was expected"),
        ("[branch]\nfree = 'a'", "line 2, branch.free: a table [branch.NAME] was expected"),
        ("chain = 3\n" + ONE, "line 1, chain: a table [chain] was expected, got 3"),
        (ONE + DRAWN.format("", ""), "f.draws: List should have at least 1 item"),
        ("[colours]\nred = 1\n" + ZONES, "colours: unknown here; there are title"),
        ("[zones.z]\nk = {from = 0.3, to = 0.9}", "from, to and count were expected"),
        ("[zones.z]\nk = 'high'", "finite real numbers were expected"),
        ("[zones.z]\nk = [0.8, 0.80]", "line 2, zones.z.k: [0.8, 0.8]: at least one number was"),
        (ONE + "window = [0.9, 0.1]", "line 5, branch.b.window: low < high was expected, got [0.9"),
        (ZONES + "within = {a = [nan, inf]}", "within.a: low < high was expected, got [nan, inf]"),
        (ATLAS + "within = {k = [0, 1]}", "line 3, atlas.z.within.k: the plane is that of gamma"),
        (ONE + "window = [false, true]", "window.0: Input should be a valid number, got False"),
        (ONE + f"window = [0, 1{'0' * 400}]", "b.window.1: "),
        (ONE + ARMS.format("b/k=x"), "NAME/gamma=0.02/arm1 was expected"),
        (ONE + ARMS.format("b/"), "'b/': NAME, NAME/gamma=0.02 or NAME/gamma"),
        # what the library says
        ("[chain]\nthreshold = 1.01\n" + ONE, "line 1, chain: threshold = 1.01: the infinite"),
        ("[chain]\nforcing = 'cos(t'\n" + ONE, "line 1, chain"),
        ("[branch.q]\nfree = 'q'\na = 1\ngamma = 0\nk = 1", "line 2, branch.q.free: the param"),
        (ONE + "over.c4 = 0.1", "line 5, branch.b.over: unknown forcing parameter 'c4'"),
        (ONE + LINE.format("k", "kk"), "line 8, boundary.y.pair: the parameter must be"),
        (ONE + LINE.format("k", "k"), "pair: a boundary needs two different parameters"),
        (ONE + "largest = -0.1", "b.largest: Input should be greater than 0, got -0.1"),
        # how tables fit together
        ("[zones.z]\nk = 0.8\ngamma = 0.1", "values of exactly one of k, gamma and a"),
        ("[branch.b]\nfree = 'a'", "k and gamma missing"),
        (ZONES + ATLAS, "'z' is there already, as zones"),
        (ONE + DRAWN.format("'b'", "file='g.png'") + "[figure.g]\ndraws=['b']", "f is written to"),
        (ARMS.format("y"), "no branch, arms or boundary 'y'; there are x"),
        (ONE + ARMS.format("b/arm1"), "arms.x.of: 'b' was expected"),
        (ARMS.format("y/arm1") + "[arms.y]\nof = 'x/arm1'\nat = 'PD1'", "itself"),
        (ZONES + ARMS.format("z"), "no branch, arms or boundary 'z'"),
        (RING + "threshold = 1.01\n" + ONE + ARMS.format("b"),
         "line 3, chain.threshold: arms are judged by the paper's 1.005; leave threshold out"),
        (ONE + ATLAS + DRAWN.format("'z','b'", ""), "an atlas is drawn alone"),
        (ONE + ZONES + DRAWN.format("'b','z'", ""), "draws: zones are drawn beside zones only"),
        ("[zones.z]\nk=2\n" + DRAWN.format("'y'", ""), "nothing is called 'y'; there are z"),
        (ZONES + DRAWN.format("'z'", "x='a'"), "line 5, figure.f.x: x and y are columns of branch"),
        (ATLAS + DRAWN.format("'z'", "y='a'"), "leave y out of a figure of atlas"),
        (ONE + DRAWN.format("'b'", "at={k=0.8}"), "leave at out of a figure of branch"),
    ],
)  # fmt: skip
def test_a_study_with_a_mistake_is_refused(text: str, reason: str, tmp_path: Path) -> None:
    path = tmp_path / "study.toml"
    path.write_text(text)
    with pytest.raises(cb.BadInput) as refused:
        read(path)
    assert reason in str(refused.value)


def test_a_member_of_a_scan_that_is_not_in_it_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "study.toml"
    path.write_text(ONE + ARMS.format("b/gamma=0.1"))
    with pytest.raises(cb.BadInput, match=r"x\.of: there is no b/gamma=0\.1; there are b$"):
        dry_run(path)


def test_the_file_of_a_lattice_is_looked_for_beside_the_study(tmp_path: Path) -> None:
    (tmp_path / "spring.csv").write_text("1, -1\n-1, 1\n")
    path = tmp_path / "study.toml"
    for rows in ("", ":masses=1,2"):
        path.write_text(f'[chain]\nlattice = "spring.csv{rows}"\n' + ONE)
        assert read(path).chain.place.masses.tolist() == [1, 2 if rows else 1]


def test_walls_of_each_site_are_typed_or_numbers(tmp_path: Path) -> None:
    path = tmp_path / "walls.toml"
    for walls in ("['1,1.2,0.9']", "[1, 1.2, 0.9]", "[[-1, 1], 1.2, 0.9]"):
        path.write_text(f"[chain]\nlattice = 'open:3'\nwalls = {walls}\n" + ONE)
        own = {1: 1.2, 2: 0.9}
        orbit, wanted = (
            cb.symmetric(0.6, 0.04, 0.8, **{**read(path).chain.on, **more})
            for more in ({}, {"walls": own})
        )
        assert orbit.walls == wanted.walls
    path.write_text("[chain]\nlattice = 'open:3'\nwalls = 1.2\n" + ONE)
    assert read(path).chain.on["walls"] == 1.2


def test_values_are_a_grid(tmp_path: Path) -> None:
    path = tmp_path / "grid.toml"
    path.write_text(
        '[chain]\nforcing = "cos(t) + c3*cos(3*t)"\nparameters = {c3 = 0.0}\n'
        "[atlas.all]\nk = {from = 0.5, to = 0.6, count = 3}\nover = {c3 = [0.0, 0.1]}\n"
    )
    labels = [task.label for task in tasks_of(read(path))]
    assert labels[:3] == ["k=0.5,c3=0.0", "k=0.5,c3=0.1", "k=0.55,c3=0.0"]


ALL = """
[chain]
lattice = "open:5:masses=1,1.1,0.9,1,1:restitutions=1,1,0.98,1,1"
forcing = "-cos(t) + c3*cos(3*t)"
parameters = {c3 = 0.05}
damping = 0.002
spring = 0.02
site = 2
walls = ["-1,1", "3:-1.5,1.5"]

[branch.ways]
free = "a"
gamma = 0.04
k = 0.8
root = 1
largest = 0.05
window = [0.7, 0.85]
over = {c3 = [0.01]}

[branch.fixed]
free = "gamma"
a = 0.6
gamma = 0.03
k = 0.9

[arms.arms]
of = "ways"
at = "PF1"
within = {a = [0.75, 0.83]}

[boundary.fork]
of = "ways"
at = "PF1"
pair = ["k", "a"]
within = {k = [0.79, 0.81]}
largest = 0.003
"""

PLANE = """
[chain]
lattice = "ring:3"
threshold = 1.01
spring = 0.0

[branch.soft]
free = "a"
gamma = 0.04
k = 0.7
window = [0.3, 0.6]

[zones.plane]
k = 0.8
within = {gamma = [0.005, 0.006], a = [0.7, 0.9]}
beyond = true
"""


@pytest.mark.slow
def test_every_key_of_a_study_reaches_the_library(tmp_path: Path) -> None:
    """Its results are those of the library, asked for the same; unsaid is the library's default."""
    results: dict[str, Any] = {}
    for name, text in (("all", ALL), ("plane", PLANE)):
        path = tmp_path / f"{name}.toml"
        path.write_text(text)
        results |= cb.load(conduct(path, executor=1).folder)
    find = cb.orbits.find_symmetric
    walls = dict.fromkeys(range(5), (-1.0, 1.0)) | {3: (-1.5, 1.5)}
    rows = {"masses": [1, 1.1, 0.9, 1, 1], "restitutions": [1, 1, 0.98, 1, 1]}
    lattice = cb.OpenChain(5, **rows)
    on = {"lattice": lattice, "site": 2, "damping": 0.002, "spring": 0.02, "walls": walls}
    ways, fixed = (cb.Symbolic("-cos(t) + c3*cos(3*t)", c3=c3) for c3 in (0.01, 0.05))
    start = find("a", (0.7, 0.85), root=1, gamma=0.04, k=0.8, **on, forcing=ways)
    branch = cb.trace(start, "a", within={"a": (0.7, 0.85)}, steps=cb.Steps(largest=0.05))
    one, other = cb.switch(branch.first("PF"), within={"a": (0.75, 0.83)})
    still = find("gamma", (0.03, 0.03), a=0.6, gamma=0.03, k=0.9, **on, forcing=fixed)
    ring = {"lattice": cb.Ring(3), "spring": 0.0}
    soft = find("a", (0.3, 0.6), gamma=0.04, k=0.7, **ring).problem_beyond(1.01).having("a")
    fork = {"within": {"k": (0.79, 0.81)}, "steps": cb.Steps(largest=0.003)}
    wanted = {
        "ways": branch,
        "fixed": cb.trace(still, "gamma", within={"gamma": window_of("gamma")}),
        "arms/arm1": one,
        "arms/arm2": other,
        "fork": cb.boundary(branch.first("PF"), ("k", "a"), **fork),
        "soft": cb.trace(soft, "a", within={"a": (0.3, 0.6)}),
    }
    assert {*results} == {*wanted, "plane"}
    for name, own in wanted.items():
        assert results[name].settings == own.settings
        assert repr(results[name]) == repr(own)
        for column in own.names:
            assert np.array_equal(results[name][column], own[column], equal_nan=True)
    window = {"gamma": (0.005, 0.006), "a": (0.7, 0.9)}
    plane = cb.zones(k=0.8, **ring, threshold=1.01, within=window)
    tables = [one.to_csv(tmp_path / "z.csv").read_text() for one in (results["plane"], plane)]
    assert tables[0] == tables[1]
    assert (results["plane"].beyond, plane.beyond) == (True, False)


# --- interruptions and clusters -------------------------------------------------------------------


@pytest.mark.slow
def test_an_interrupted_study_says_what_is_done_and_goes_on(study: Path, tmp_path: Path) -> None:
    def stopping(line: str) -> None:
        if line.startswith("3 of 6"):
            raise KeyboardInterrupt

    with pytest.raises(cb.errors.Interrupted) as stopped:
        conduct(study, folder=tmp_path, executor=1, tell=stopping)
    partial: Any = stopped.value.partial
    assert (partial.interrupted, len(partial.computed)) == (True, 3)
    report = conduct(study, folder=tmp_path, executor=1)
    assert (report.kept, len(report.computed)) == (partial.computed, 3)


class Killing(Executor):
    """Another executor, and a worker of it that is killed once it has work."""

    def __init__(self, inner: Executor, victim: int) -> None:
        self.inner, self.sent = inner, 0
        self.blow = threading.Timer(0.3, os.kill, (victim, signal.SIGKILL))

    def submit(self, call: Callable[..., Any], *given: Any, **more: Any) -> Any:
        self.sent += 1
        if self.sent == 2:
            self.blow.start()
        return self.inner.submit(call, *given, **more)


@pytest.mark.slow
@pytest.mark.apart
def test_a_worker_of_a_cluster_that_is_killed_costs_nothing(tmp_path: Path) -> None:
    """Two local workers, one of them killed in the middle: the same results to the last digit."""
    study = tmp_path / "branches.toml"
    study.write_text(SMALL.partition("[arms")[0].replace("[0.02, ", "[0.02, 0.03, "))
    done = conduct(study, executor=1)
    distributed = pytest.importorskip("distributed")
    waiting = ("connect", "tcp")
    distributed.dask.config.set({f"distributed.comm.timeouts.{one}": HUNG for one in waiting})
    local = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None}
    with distributed.LocalCluster(**local) as two, cluster(two.scheduler_address, HUNG) as executor:
        with distributed.Client(two) as client:
            victim = next(iter(client.run(os.getpid).values()))
        killing = Killing(executor, victim)
        report = conduct(study, folder=tmp_path / "far", executor=killing)
        killing.blow.join()
    assert (report.failed, report.computed) == ({}, done.computed)
    here, there = cb.load(done.folder), cb.load(report.folder)
    for name in here:
        assert np.array_equal(here[name]["a"], there[name]["a"])
        assert np.array_equal(here[name]["p"], there[name]["p"], equal_nan=True)


def test_a_study_takes_couplings_up_to_the_band_of_its_frequency(tmp_path: Path) -> None:
    """Not to 1/4, which is that of the frequency 1; what is computed is the scaled breather."""
    path, free = tmp_path / "fast.toml", 'free = "a"\ngamma = 0.6\nk = 0.7\nwindow = [2, 2.1]'
    path.write_text(f"[chain]\nomega = 2.0\n[branch.b]\n{free}\n")
    assert dry_run(path).on.endswith("F = -a cos t, omega = 2")
    assert conduct(path, executor=1).failed == {}
    start = cb.load(tmp_path / "fast")["b"][0]
    assert start["p"] == pytest.approx(cb.symmetric(start["a"] / 4, 0.15, 0.7).p, abs=1e-12)
    path.write_text(f"[branch.b]\n{free}\n")
    with pytest.raises(cb.BadInput, match=r"line 3, branch.b.gamma: gamma = 0.6: the coupling"):
        read(path)


def test_a_cluster_that_does_not_answer_is_refused() -> None:
    pytest.importorskip("distributed")
    for address in ("tcp://127.0.0.1:9", "nonsense://x"):
        with pytest.raises(cb.BadInput, match="no cluster answers at"), cluster(address, 0.1):
            pass


def test_a_cluster_without_its_extra_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with (
        pytest.raises(cb.BadInput, match=r"pip install 'contbreather\[cluster\]'"),
        cluster("tcp://x:1"),
    ):
        pass


# --- examples -------------------------------------------------------------------------------------

EXAMPLES = sorted((Path(__file__).parents[1] / "examples").glob("*.toml"))


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_the_studies_that_are_shipped_are_without_mistakes(path: Path) -> None:
    assert len(EXAMPLES) == 3
    assert read(path).figure


@pytest.mark.slow
@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_the_studies_that_are_shipped_run(path: Path, tmp_path: Path) -> None:
    report = conduct(path, folder=tmp_path, executor=1)
    assert report.failed == {}
    assert all(made.stat().st_size > 10_000 for made in report.written)
