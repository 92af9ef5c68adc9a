"""The command line keeps what it computes, shows it again, and goes on with it."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

import contbreather as cb

from .typed import Run

BRANCH = "branch --free a --gamma 0.04 --k 0.8 --window 0.7 0.76 --save b.nc"


@pytest.fixture
def kept(run: Run) -> Run:
    """In a folder with a branch."""
    status, out, _ = run(BRANCH)
    assert (status, "Wrote b.nc." in out) == (0, True)
    return run


def test_branch_goes_on_where_it_is_kept(kept: Run) -> None:
    short = cb.load("b.nc")
    status, out, _ = kept("extend b.nc --window 0.7 0.8 --end last")
    assert (status, "PF1" in out) == (0, True)
    longer = cb.load("b.nc")
    assert np.array_equal(longer["p"][: len(short) - 1], short["p"][:-1])
    assert longer.first("PF")["a"] == pytest.approx(0.777632425944, abs=1e-12)
    assert "criticality = supercritical" in kept("show b.nc PF1")[1]


def test_one_result_of_a_file_goes_on_and_others_stay(kept: Run) -> None:
    branch = cb.load("b.nc")
    cb.save("two.nc", one=branch, other=branch)
    Path("b.nc").unlink()
    status, out, _ = kept("extend two.nc other --window 0.68 0.76 --end first --most 1")
    assert (status, "raise --most of contbreather extend to go on" in out) == (0, True)
    assert "Steps" not in out
    run = cb.load("two.nc")
    assert (len(run["one"]), list(run)) == (len(branch), ["one", "other"])
    assert run["other"].began is cb.continuation.Stop.MOST
    status, out, _ = kept("show . --json")
    assert (status, list(json.loads(out)["results"])) == (0, ["two/one", "two/other"])


@pytest.mark.parametrize(
    ("command", "sentence"),
    [
        ("show", "parameter RUN requires an argument"),
        ("show nothing.nc", "cannot read nothing.nc: No such file"),
        ("show bad.nc", "cannot read bad.nc: it is not a netCDF-4 file"),
        ("show folder", "there is no file in it that `save` wrote"),
        ("show b.nc PF7", r"no 'PF7' in b.nc; there are \['branch'\] and points \['EP1', 'EP2'\]"),
        ("extend b.nc", "goes no further: at its last point it is at the edge of its window"),
        (
            "extend b.nc --window 0.7 0.8 --end first",
            r"a in \(0\.7, 0\.76\), at a = 0\.7, and \(0\.7, 0\.8\) was asked for: ",
        ),
        ("extend b.nc --window 0.9 0.7", r"the window of 'a' is empty: \(0\.9, 0\.7\)"),
        ("extend b.nc EP1", "name a branch or a boundary of b.nc to extend: there is branch; "),
        ("extend b.nc --window 0.9 1", "the start has a=0.76, outside"),
        (f"{BRANCH[:-4]}b.nc --csv b.nc", "--csv and --save both name b.nc"),
        (f"{BRANCH[:-4]}nowhere/b.nc", "there is no directory nowhere"),
        ("point --a 0.5 --gamma 0.04 --k 0.8 --save x.nc", "save"),
        (
            "simulate --a 0.5 --gamma 0.04 --k 0.8 --periods 2 --stream s.nc --save x.nc",
            "--stream: a stream is without noise and kept in its own file",
        ),
    ],
)
def test_what_cannot_be_is_one_sentence(kept: Run, command: str, sentence: str) -> None:
    Path("bad.nc").write_text("nothing of the kind")
    Path("folder").mkdir()
    before = Path("b.nc").read_bytes()
    status, out, err = kept(command)
    assert (status, out) == (2, "")
    assert re.search(sentence, err)
    assert err.count("\n") == 1
    assert Path("b.nc").read_bytes() == before


def test_branches_of_a_diagram_have_numbers(run: Run) -> None:
    run("diagram --free a --gamma 0.04 --k 0.8 --window 0.76 0.8 --depth 1 --save tree.nc")
    tree = cb.Run("tree.nc")
    for i, branch in enumerate(tree["diagram"]):
        assert repr(tree[f"diagram/{i}"]) == repr(branch)
        for point in branch.special:
            assert tree[f"diagram/{i}/{point.label}"]["a"] == point["a"]
    status, out, _ = run("show tree.nc diagram/1")
    assert (status, "asymmetric breather" in out) == (0, True)
    for words in ("extend tree.nc", "extend tree.nc diagram/1"):
        status, _, err = run(words)
        assert (
            status,
            "to extend: there is none; a branch of a diagram is extended from" in err,
        ) == (2, True)
    with pytest.raises(cb.BadInput, match=r"'EP1' is a point of several: diagram/0, diagram/1"):
        tree["EP1"]
    with pytest.raises(cb.BadInput, match="no 'diagram/3' in"):
        tree["diagram/3"]


def test_a_null_vector_is_shown_by_the_names_of_its_unknowns(run: Run) -> None:
    ring = "--lattice ring:6 --gamma 0.05 --k 0.8 --damping 0.01"
    run(f"branch --free a {ring} --window 0.05 0.1 --a 0.09 --save ring.nc")
    line = next(one for one in run("show ring.nc LP1")[1].splitlines() if one.startswith("null"))
    assert re.fullmatch(r"null = t1 -?0\.\d+, J1 -?0\.\d+\.", line)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("command", "name"),
    [
        ("branch --free a --gamma 0.04 --k 0.8 --window 0.5 0.51 --lattice open:4 --spring 0.1",
         "branch"),
        ("branch --free a --gamma 0 --k 0.8 --window 0.5 0.51 --sites 3 --walls=-2,2", "branch"),
        ("switch --free a --gamma 0.04 --k 0.8 --window 0.76 0.78", "arm1"),
        ("diagram --free a --gamma 0.04 --k 0.8 --window 0.76 0.78 --depth 1", "diagram"),
        ("zones --k 0.8 --k 0.7 --gamma-window 0.03 0.031", "zones2"),
        ("boundary NS --gamma 0.1 --k 0.8 --window 0.1 0.101", "boundary"),
        ("simulate --a 0.5 --gamma 0.04 --k 0.8 --sites 4 --periods 2", "run"),
    ],
)  # fmt: skip
def test_what_is_shown_of_a_file_is_what_the_command_that_made_it_left(run, command, name):
    """All that it said in JSON but where it wrote to, of what is in the file; the same table."""
    status, out, _ = run(f"{command} --json --csv first.csv --save kept.nc -o first.png")
    first = json.loads(out)
    again = json.loads(run("show kept.nc --json --csv again.csv -o again.png")[1])
    assert status == 0
    for key in {*first} - {"written", "branch", "lost_after"}:
        assert again[key] == first[key], key
    assert Path("again.csv").read_text() == Path("first.csv").read_text()
    if name != "arm1":  # of arms their branch is drawn too, which is not in the file
        assert Path("again.png").read_bytes() == Path("first.png").read_bytes()
    assert (again["path"], first["written"]) == ("kept.nc", ["kept.nc", "first.csv", "first.png"])
    assert name in cb.Run("kept.nc")
    status, out, _ = run("show kept.nc")
    assert (status, len(out) > 40) == (0, True)
    if name in ("zones2", "run"):
        assert "--x p: " in run("show kept.nc --x p -o other.png")[2]  # it was left aside
    if name == "zones2":
        assert "Points on the curves at k = 0.7: " in run("show kept.nc zones2")[1]


def test_what_is_shown_of_a_file_says_the_drive_and_the_walls(run: Run) -> None:
    """Also where the parameter of the formula is free, whose value at the start says nothing."""
    drive = "--forcing cos(t)+c3*cos(3*t) --set c3=0.2"
    run(f"branch --free c3 --a 0.5 --gamma 0.04 --k 0.8 --window 0 0.2 {drive} --save b.nc")
    assert "\nF = a (cos(t) + c3 * cos(3 * t)).\n" in run("show b.nc")[1]
    run("branch --free a --gamma 0.04 --k 0.8 --window 0.5 0.51 --sites 3 --walls=-2,2 --save b.nc")
    assert "\nwalls -2.0,2.0.\n" in run("show b.nc")[1]


def test_steps_are_as_long_as_they_are_asked_to_be(kept: Run) -> None:
    usual = cb.load("b.nc")
    line = f"{BRANCH} --first 0.001 --largest 0.002 --smallest 1e-8 --most 10"
    assert kept(line)[0] == 0
    short = cb.load("b.nc")
    assert short.settings.steps == cb.Steps(first=0.001, largest=0.002, smallest=1e-8, most=10)
    # arclength, which is that of the Hermite interpolants, is longer than the chords
    assert max(np.diff(short["arclength"])) < 0.00201 < max(np.diff(usual["arclength"]))
    assert short.stop is cb.continuation.Stop.MOST
    kept("boundary NS --gamma 0.1 --k 0.8 --window 0.1 0.102 --largest 0.001 --save b.nc")
    assert max(np.diff(cb.load("b.nc")["arclength"])) < 0.00101


def test_branches_of_other_equations_are_shown_without_a_lattice(run: Run) -> None:
    mine = cb.Problem(lambda x, p: x * (p["mu"] - x**2), {"x": 0.0}, {"mu": -1.0})
    cross = cb.trace(mine, "mu", within={"mu": (-1, 1), "x": (-1, 1)}, events=[cb.branch_point()])
    arms = cb.switch(cross.first("BP"), within={"mu": (-1, 1)})
    cb.save("mine.nc", **dict(zip(("arm1", "arm2"), arms, strict=True)))
    status, out, err = run("show mine.nc --json --csv mine.csv")
    assert (status, err) == (0, "")
    found = json.loads(out)["results"]
    assert list(found) == ["arm1", "arm2"]
    assert found["arm1"]["free"] == "mu"
    assert "forcing" not in found["arm1"]
    assert Path("mine.csv").read_text().startswith("name,label,mu,")
    growth = cb.FixedPoint(lambda x, p: p["c"] * x * (1 - x), {"x": 0.6}, {"c": 2.5})
    cb.save("growth.nc", cb.trace(growth, "c", within={"c": (2.5, 3.2)}))
    point = cb.load("growth.nc").first("PD")
    assert "\nc of PD = 9.\n" in run("show growth.nc PD1")[1]  # not `c`, which is 3
    shown = json.loads(run("show growth.nc PD1 --json")[1])
    assert (shown["c"], shown["c of PD"]) == (point["c"], point["c of PD"])
