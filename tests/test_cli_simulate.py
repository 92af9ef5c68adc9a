"""`contbreather simulate`: the library's run, a verdict, streams that go on, refusals."""

from __future__ import annotations

import json
import re
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

import contbreather as cb
from contbreather.cli import BAD_INPUT, DONE, INTERRUPTED
from contbreather.simulation.integrator import EventDriven

from .typed import table

STABLE = "simulate --a 0.1 --gamma 0.08 --k 0.8 --damping 0.02"
LOST = "simulate --a 0.2 --gamma 0.104 --k 0.8 --damping 0.005"


def state_of(content) -> np.ndarray:
    return np.array([content["final"]["u"], content["final"]["v"]])


# --- the run --------------------------------------------------------------------------------------


def test_run_is_that_of_the_library_to_the_last_digit(run):
    status, out, err = run(f"{LOST} --periods 20 --sites 12 --json --csv s.csv --impacts i.csv")
    own = cb.simulate(
        cb.symmetric(0.2, 0.104, 0.8).state(12),
        a=0.2, gamma=0.104, k=0.8, damping=0.005, periods=20,
    )  # fmt: skip
    content = json.loads(out)
    assert (status, err) == (DONE, "")
    assert np.array_equal(state_of(content), own.final)
    assert content["impacts"]["total"] == len(own.impacts)
    rows = table("s.csv")
    sites = [f"{name}_{n}" for name in "uv" for n in range(12)]
    assert list(rows[0]) == ["period", "time", *sites]
    assert [float(row["time"]) for row in rows] == own.times.tolist()
    assert [float(row["u_3"]) for row in rows] == own.strobe.u[:, 3].tolist()
    assert [float(row["v_11"]) for row in rows] == own.strobe.v[:, 11].tolist()
    assert [float(row["phase"]) for row in table("i.csv")] == own.impacts["phase"].tolist()
    assert content["written"] == ["i.csv", "s.csv"]


def test_breather_that_is_lost_is_said_to_be_and_when(run):
    content = json.loads(run(f"{LOST} --periods 160 --json")[1])
    assert content["verdict"]["kind"] == "DELOCALISED"
    assert len(content["impacts"]["by_site"]) > 5
    lost = content["lost_after"]
    start = cb.symmetric(0.2, 0.104, 0.8).state(20)
    own = cb.simulate(start, a=0.2, gamma=0.104, k=0.8, damping=0.005, periods=lost)
    assert set(own.impacts["site"]) == {0}
    _, said, aside = run(f"{LOST} --periods 160")
    assert f"{lost} periods" in said
    assert "--lattice ring:20 starts on the one with damping" in aside


@pytest.mark.parametrize("stream", ["", " --stream s.nc"])
def test_rests_on_a_wall_are_counted_after_chatters_whose_last_impacts_are_not(run, stream):
    Path("one.json").write_text('{"u": [0.1], "v": [0.3]}')
    line = "simulate --a 8 --gamma 0.02 --k 0.3 --lattice open:1 --periods 20 --start one.json"
    own = cb.simulate(([0.1], [0.3]), a=8, gamma=0.02, k=0.3, lattice=cb.OpenChain(1), periods=20)
    count = np.count_nonzero(own.rests["begins"])
    assert count >= 40
    assert re.search(rf"came to rest on a wall *│ *{count} times", run(line + stream)[1])
    assert "rest on a wall" not in run(f"{STABLE} --periods 5")[1]


@pytest.mark.parametrize(
    ("periods", "length", "few"),
    [
        ("0.5", "0.5 periods", "0.5 periods are too few"),
        ("1", "1 period", "1 period is too few"),
        ("2", "2 periods", "2 periods are too few"),
    ],
)
def test_length_is_said_as_it_was(run, periods, length, few):
    _, out, _ = run(f"{STABLE} --sites 4 --periods {periods}")
    assert out.startswith(f"Ring of 4, rigid walls, {length}\n")
    assert f"No verdict: {few}, give at least 100." in out
    out = run(f"{STABLE} --sites 4 --periods {periods} --json")[1]
    assert json.loads(out)["periods"] == float(periods)


# --- starts ---------------------------------------------------------------------------------------


def test_last_state_starts_the_next_run_at_its_own_time(run):
    run(f"{LOST} --periods 3.25 --final here.json")
    content = json.loads(run(f"{LOST} --periods 2.75 --start here.json --json")[1])
    whole = json.loads(run(f"{LOST} --periods 6 --json")[1])
    np.testing.assert_allclose(state_of(content), state_of(whole), atol=1e-11)
    assert content["final"]["t"] == pytest.approx(whole["final"]["t"], abs=1e-12)
    assert "lost_after" not in content  # nobody said that it began as a breather


def test_two_columns_are_a_state_and_set_the_length_of_the_ring(run):
    run("--version")
    Path("state.csv").write_text("u,v\n0.1,0.2\n0.0,-0.3\n-0.5,0\n")
    content = json.loads(run(f"{LOST} --periods 1 --start state.csv --json")[1])
    own = cb.simulate(
        ([0.1, 0.0, -0.5], [0.2, -0.3, 0.0]), a=0.2, gamma=0.104, k=0.8, damping=0.005, periods=1
    )
    assert content["sites"] == 3
    assert np.array_equal(state_of(content), own.final)


def test_push_is_of_the_size_given_and_the_same_for_the_same_seed(run):
    def final(extra: str) -> np.ndarray:
        return state_of(json.loads(run(f"{STABLE} --periods 0 --json {extra}")[1]))

    still = final("")
    pushed, again = final("--perturb 1e-3 --seed 4"), final("--perturb 1e-3 --seed 4")
    other = final("--perturb 1e-3 --seed 5")
    assert np.array_equal(pushed, again)
    assert not np.array_equal(pushed, other)
    assert np.std(pushed - still) == pytest.approx(1e-3, rel=0.3)


# --- streams --------------------------------------------------------------------------------------


@pytest.mark.slow
def test_stream_goes_on_and_ends_like_one_run(run):
    first = json.loads(run(f"{LOST} --stream run.nc --periods 60 --json")[1])
    line = f"{LOST} --stream run.nc --periods 160 --json --csv all.csv --impacts i.csv"
    second, whole = json.loads(run(line)[1]), json.loads(run(f"{LOST} --periods 160 --json")[1])
    assert first["periods"] == 60
    assert np.array_equal(state_of(second), state_of(whole))
    for name in ("impacts", "lost_after", "periods"):
        assert second[name] == whole[name]
    assert second["verdict"]["kind"] == whole["verdict"]["kind"]
    rows = table("all.csv")
    assert [int(row["period"]) for row in rows] == list(range(161))
    assert len(table("i.csv")) == whole["impacts"]["total"]


def test_stream_of_another_run_is_refused(run):
    run(f"{LOST} --stream run.nc --periods 2")
    status, _, err = run(f"{STABLE} --stream run.nc --periods 2")
    assert status == BAD_INPUT
    assert "run.nc holds another run: a is 0.2 there and 0.1 here" in err


def interrupt(monkeypatch, periods):
    """Have Ctrl-C come after so many periods of a run."""
    advance = EventDriven.advance

    def stopped(self, count, first, **more):
        if first >= periods:
            raise KeyboardInterrupt
        return advance(self, count, first, **more)

    monkeypatch.setattr(EventDriven, "advance", stopped)


def test_interrupted_stream_keeps_what_it_has_and_the_same_command_finishes_it(run, monkeypatch):
    advance = EventDriven.advance
    interrupt(monkeypatch, 10)
    status, out, _ = run(f"{STABLE} --stream run.nc --periods 150 --final f.json")
    assert status == INTERRUPTED
    assert re.search(r"Interrupted after \d+ of 150 periods; the same command goes on", out)
    assert Path("f.json").exists()
    monkeypatch.setattr(EventDriven, "advance", advance)
    status, out, _ = run(f"{STABLE} --stream run.nc --periods 150 --json")
    whole = json.loads(run(f"{STABLE} --periods 150 --json")[1])
    assert status == DONE
    assert np.array_equal(state_of(json.loads(out)), state_of(whole))


@pytest.mark.parametrize("stream", ["", " --stream run.nc"])
def test_files_of_an_interrupted_run_say_so_in_a_last_line_and_how_far_it_got(
    run, monkeypatch, stream
):
    interrupt(monkeypatch, 12)
    line = f"{STABLE} --sites 4 --periods 1000000 --csv s.csv --impacts i.csv"
    status, out, _ = run(line + stream)
    done = int(re.search(r"Interrupted after (\d+) of 1000000 periods", out)[1])
    assert status == INTERRUPTED
    assert done >= 12
    for path in (Path("s.csv"), Path("i.csv")):
        assert path.read_text().splitlines()[-1] == (
            f"# interrupted: cut short after {done} of 1000000 periods"
        )
    assert table("s.csv")[-2]["period"] == str(done)


def test_second_interruption_while_judging_leaves_all_but_the_verdict(run, monkeypatch):
    def again(_):
        raise KeyboardInterrupt

    interrupt(monkeypatch, 120)
    monkeypatch.setattr(import_module("contbreather.simulation.classify"), "judge", again)
    line = f"{STABLE} --sites 4 --periods 100000 --csv s.csv --final f.json"
    status, out, err = run(line)
    assert status == INTERRUPTED
    assert "interrupted: writing, then judging what there is; Ctrl-C while judging: no" in err
    assert "No verdict: interrupted before it was found." in out
    assert "Wrote s.csv." in out
    assert len(table("s.csv")) > 100
    assert state_of({"final": json.loads(Path("f.json").read_text())}).shape == (2, 4)


# --- files, refusals ------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(
    "more",
    ["--gamma 0.02 --periods 30 --smooth 6", "--gamma 0 --periods 30 --sites 1",
     "--gamma 0.02 --periods 0"],
)  # fmt: skip
def test_picture_of_a_run_is_drawn(run, more):
    status, out, err = run(f"simulate --a 0.3 --k 0.8 -o p.png {more}")
    assert (status, err) == (DONE, "")
    assert "Wrote p.png." in out
    assert Path("p.png").stat().st_size > 10_000


@pytest.mark.slow
def test_drawn_sites_reach_their_walls(run, monkeypatch):
    drawn, motion = [], cb.plotting.plot_motion
    monkeypatch.setattr(
        cb.plotting, "plot_motion", lambda *run, **where: drawn.append(motion(*run, **where))
    )
    assert run(f"{STABLE} --periods 10 -o p.png")[0] == DONE
    u = drawn[0].axes.get_lines()[0].get_ydata()
    assert (min(u), max(u)) == (-1.0, 1.0)


def test_help_says_that_a_run_is_kept_at_its_end_and_not_that_it_can_be_extended(run) -> None:
    status, out, _ = run("simulate --help")
    assert status == DONE
    words = " ".join(out.replace("│", " ").split())
    assert "Keep the run in this file when it has ended, for show and load" in words
    assert "extend" not in words
    assert "extend follows branches" in " ".join(run("branch --help")[1].replace("│", " ").split())
