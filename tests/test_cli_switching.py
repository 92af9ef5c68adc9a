"""`contbreather switch` and `contbreather diagram`: the library's branches, told and written."""

from __future__ import annotations

from pathlib import Path
from unittest.mock import MagicMock

import pytest

import contbreather as cb
from contbreather.cli import DONE, FAILED

from .typed import Run, strict, table

SWITCH = "switch --free a --gamma 0.04 --k 0.8"
DIAGRAM = "diagram --free a --gamma 0.04 --k 0.8"


# --- switch ---------------------------------------------------------------------------------------


def test_both_arms_are_told_to_be_stable_alike(run: Run) -> None:
    """They are mirror images. At EP1, the pitchfork, and NS1 a multiplier is on the circle, so that
    no count is told there; no point of the walk lies between NS1 and EP2, and yet that piece is
    described."""
    out = run("switch --a 0.82 --gamma 0.04 --k 0.8 --free k")[1]
    for arm in (1, 2):
        assert f"Arm {arm}, EP1 to NS1: stable on the infinite chain." in out
        rest = f"Arm {arm}, NS1 to EP2: unstable, multipliers outside: 2, on the infinite chain."
        assert rest in out
        for label in ("EP1", "NS1"):
            (row,) = (line for line in out.splitlines() if f"{arm} │ {label} " in line)
            assert row.rstrip("│ ").endswith("–")


def test_arms_in_json_are_those_of_the_library(run: Run) -> None:
    content = strict(run(f"{SWITCH} --json")[1])
    branch = cb.trace(cb.symmetric(0.5, 0.04, 0.8), "a", within={"a": (0.0, 2.0)})
    arms = cb.switch(branch.first("PF"), within={"a": (0.0, 2.0)})
    assert content["at"]["criticality"] == "supercritical"
    assert [arm["image_of"] for arm in content["arms"]] == [None, 1]
    for told, arm in zip(content["arms"], arms, strict=True):
        assert told["special"][-1]["label"] == "GR1"
        assert told["special"][-1]["a"] == pytest.approx(arm[-1]["a"], abs=1e-13)
        assert told["columns"]["c"][-1] == pytest.approx(arm[-1]["c"], abs=1e-12)
        assert told["special"][0]["parent"] == "PF1"
        assert "(site 1 reaches |u| = 1 at t = " in told["end"]


def test_the_start_of_an_arm_has_one_label_on_the_screen_in_tables_and_in_its_file(run: Run):
    out = run(f"{SWITCH} --csv arms.csv --save arms.nc")[1]
    kept = cb.load("arms.nc")["arm1"]
    label = kept[0].label
    assert f"Arm 1, {label} to GR1" in out
    assert f"│   1 │ {label} " in out
    assert table("arms.csv")[0]["label"] == label
    assert kept.first(label)["a"] == kept[0]["a"]


def test_an_arm_that_ends_at_simultaneous_impacts_names_the_sites(run: Run) -> None:
    out = run("switch --a 0.8 --gamma 0.02 --k 0.8 --free gamma --at GR --at BP")[1]
    assert "CC1: ended at a terminal event (sites -1 and 0 hit their walls at once" in out


def test_at_a_grazing_point_it_says_what_becomes_of_the_breather(run: Run) -> None:
    out = run(f"{SWITCH} --at GR --window 0.9 1 --lattice ring:9 --damping 0.02")[1]
    assert "Arm 1, GR1: fold, sites 1, 8 hit a wall; both orbits end here" in " ".join(out.split())


def test_on_a_ring_the_same_arms_are_shot(run: Run) -> None:
    status, out, _ = run(f"{SWITCH} --sites 20 --window 0.7 0.9")
    assert status == DONE
    assert "orbit with impacts, ring of 20, period 2 pi, impacts 0+ 0- in a" in out
    assert "stable on the ring of 20 (threshold 1.005)" in out
    assert out.count("0.877386621674") == 2


@pytest.mark.slow
def test_switching_goes_on_from_branch_to_branch(run: Run) -> None:
    line = "switch --free a --gamma 0 --k 0.8 --at pf --at PD1 --window 0.6 0.99"
    status, out, _ = run(f"{line} -o doubled.png")
    assert status == DONE
    assert "PD1 at a = 0.925512006293, on asymmetric breather" in out
    assert "0.979973549455" in out
    assert Path("doubled.png").exists()


# --- diagram --------------------------------------------------------------------------------------


@pytest.mark.slow
def test_diagram_is_printed_as_a_tree_and_drawn(run: Run) -> None:
    status, out, err = run(f"{DIAGRAM} -o tree.png --csv tree.csv")
    assert (status, err) == (DONE, "")
    assert "3 branches, 6 special points" in out
    assert "branch 2 (image of branch 1): asymmetric breather in a" in out
    assert Path("tree.png").stat().st_size > 10_000
    rows = table("tree.csv")
    assert {row["branch"] for row in rows} == {"0", "1", "2"}
    assert {float(row["asymmetry"]) for row in rows if row["branch"] == "0"} == {0.0}
    assert {row["phi"] == "" for row in rows if row["branch"] == "1"} == {True}


def test_diagram_in_json_is_its_graph(run: Run) -> None:
    content = strict(run(f"{DIAGRAM} --json")[1])
    assert [branch["depth"] for branch in content["branches"]] == [0, 1, 1]
    born = [edge for edge in content["edges"] if edge["relation"] == "born"]
    assert [(edge["from"], edge["to"]) for edge in born] == [
        ("branch 0: PF1", 1),
        ("branch 0: PF1", 2),
    ]
    assert content["points"]["branch 1: GR1"]["a"] == pytest.approx(0.877386621674, abs=1e-11)
    assert content["interrupted"] is False


def test_depth_bounds_the_diagram_and_what_is_left_is_told(run: Run) -> None:
    out = run(f"{DIAGRAM} --depth 0")[1]
    assert "1 branch, 4 special points; 1 point not switched at" in out
    assert "Not switched at: branch 0: PF1; raise --depth." in out


def test_most_bounds_the_diagram_and_what_is_left_is_told(run: Run) -> None:
    point = "diagram --a 0.6 --gamma 0 --k 0.8 --free a --window 0.6 0.99"
    out = run(f"{point} --most 2")[1]
    assert "Not all arms followed of: branch 0: PF1; raise --most." in out
    assert "Not switched at: branch 1: PD1; raise --most." in out
    assert "--depth" not in out
    out = run(f"{point} --most 1")[1]
    assert "Not switched at: branch 0: PF1; raise --most." in out
    assert "Not all arms" not in out


def test_arms_that_fail_are_told_and_have_status_1(run: Run, monkeypatch: pytest.MonkeyPatch):
    fails = MagicMock(side_effect=cb.NotConverged("no first step"))
    monkeypatch.setattr("contbreather.continuation.branches.diagram.follow", fails)
    status, out, err = run(DIAGRAM)
    assert status == FAILED
    assert "2 arms not followed" in out
    assert "not complete: branch 0: PF1: no first step" in err
