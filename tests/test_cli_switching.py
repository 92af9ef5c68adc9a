"""`contbreather switch` and `contbreather diagram`: the library's branches, told and written."""

from __future__ import annotations

from pathlib import Path
from unittest.mock import MagicMock

import pytest

import contbreather as cb
from contbreather.cli import DONE, FAILED, INTERRUPTED

from .typed import Run, strict, table

SWITCH = "switch --free a --gamma 0.04 --k 0.8"
DIAGRAM = "diagram --free a --gamma 0.04 --k 0.8"


# --- switch ---------------------------------------------------------------------------------------


def test_both_arms_are_told_with_normal_form_stability_and_end(run: Run) -> None:
    status, out, err = run(f"{SWITCH} -o arms.png")
    assert (status, err) == (DONE, "")
    for sentence in (
        "PF1 at a = 0.777632425944, on symmetric breather in a",
        "Supercritical: (t2 - t1 - pi)^2 / (a - 0.777632) -> 8.761463",
        "Arm 1, EP1 to GR1: stable on the infinite chain.",
        "Arm 1, GR1: ended at a terminal event (site 1 reaches |u| = 1 at t = 0.01765",
        "Arm 2, GR1: ended at a terminal event (site 1 reaches |u| = 1 at t = 3.15925",
        "Arm 2, the mirror image of arm 1.",
        "Wrote arms.png.",
    ):
        assert sentence in out
    assert out.count("0.877386621674") == 2
    assert Path("arms.png").stat().st_size > 10_000


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


def test_arms_as_a_table_are_told_apart(run: Run) -> None:
    run(f"{SWITCH} --csv arms.csv")
    rows = table("arms.csv")
    assert {row["arm"] for row in rows} == {"1", "2"}
    ends = [float(row["c"]) for row in rows if row["label"] == "GR1"]
    assert ends[0] == pytest.approx(-ends[1], abs=1e-12)
    assert {"a", "p", "t1", "t2", "asymmetry", "unstable"} < set(rows[0])


def test_on_a_ring_the_same_arms_are_shot(run: Run) -> None:
    status, out, _ = run(f"{SWITCH} --sites 20 --window 0.7 0.9")
    assert status == DONE
    assert "orbit with impacts, ring of 20, period 2 pi, impacts 0+ 0- in a" in out
    assert "stable on the ring of 20 (threshold 1.005)" in out
    assert out.count("0.877386621674") == 2


def test_switching_goes_on_from_branch_to_branch(run: Run) -> None:
    line = "switch --free a --gamma 0 --k 0.8 --at pf --at PD1 --window 0.6 0.99"
    status, out, _ = run(f"{line} -o doubled.png")
    assert status == DONE
    assert "PD1 at a = 0.925512006293, on asymmetric breather" in out
    assert "0.979973549455" in out
    assert Path("doubled.png").exists()


# --- diagram --------------------------------------------------------------------------------------


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


def arms_end(monkeypatch: pytest.MonkeyPatch, how: BaseException) -> None:
    """Have arms that are followed end like this."""
    monkeypatch.setattr(
        "contbreather.continuation.branches.diagram.follow", MagicMock(side_effect=how)
    )


def test_an_interrupted_diagram_is_shown_and_has_its_own_status(run, monkeypatch):
    arms_end(monkeypatch, KeyboardInterrupt())
    status, out, err = run(f"{DIAGRAM} --json")
    assert (status, err) == (INTERRUPTED, "contbreather: interrupted: the result is cut short\n")
    assert strict(out)["interrupted"] is True
    assert strict(out)["left"] == ["branch 0: PF1"]


def test_arms_that_fail_are_told_and_have_status_1(run: Run, monkeypatch: pytest.MonkeyPatch):
    arms_end(monkeypatch, cb.NotConverged("no first step"))
    status, out, err = run(DIAGRAM)
    assert status == FAILED
    assert "2 arms not followed" in out
    assert "not complete: branch 0: PF1: no first step" in err


# --- figures of several branches ------------------------------------------------------------------


def test_branches_of_different_problems_share_a_figure_and_the_name_of_their_point() -> None:
    tree = cb.diagram(cb.symmetric(0.5, 0.04, 0.8), "a", within={"a": (0.1, 0.9)})
    ax = cb.plotting.plot_diagram(tree).axes
    assert ax.get_ylabel() == "asymmetry"
    words = [text.get_text() for text in ax.texts]
    assert words.count("PF1") == 1
    assert words.count("GR1") == 2
    of_breathers = cb.plotting.plot_diagram(tree, y="phi").axes  # arms have no such column
    assert [text.get_text() for text in of_breathers.texts].count("PF1") == 1
    with pytest.raises(cb.BadInput, match="no branch has a column 'q'; there are"):
        cb.plotting.plot_diagram(tree, y="q")
    with pytest.raises(cb.BadInput, match="a function of a point, was expected, got"):
        cb.plotting.plot_diagram(tree, y=3)  # type: ignore[arg-type]
    with pytest.raises(cb.BadInput, match="no branch to draw"):
        cb.plotting.plot_diagram([])


def test_a_figure_of_any_number_that_points_have() -> None:
    def height(point: cb.continuation.Point) -> float:
        return float(point.displacement(1, 0.0))

    branch = cb.trace(cb.symmetric(0.5, 0.04, 0.8), "a", within={"a": (0.4, 0.6)})
    ax = cb.plotting.plot_diagram([branch], y=height).axes
    assert ax.get_ylabel() == "height"
    x, y = ax.get_lines()[0].get_data()
    assert y[0] == pytest.approx(cb.symmetric(x[0], 0.04, 0.8).displacement(1, 0.0), abs=1e-12)


def test_counts_of_a_stretch_are_listed_once_each_from_the_lowest(run: Run) -> None:
    out = run(f"{SWITCH} --lattice ring:6")[1]
    on = "on the ring of 6 (threshold 1.005)"
    for arm in (1, 2):
        assert f"Arm {arm}, EP1 to NS1: stable {on}." in out
        assert f"Arm {arm}, NS1 to GR1: unstable, multipliers outside: 2, 4, {on}." in out
