"""What is clicked is computed in the background, can be stopped, and a script makes it again."""

from __future__ import annotations

import re
import threading
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import contbreather as cb
from contbreather.errors import BadInput, NoSolution
from contbreather.explorer import Explorer, jobs, session
from contbreather.explorer.jobs import Computation, Progress
from contbreather.explorer.state import (
    drawn_columns,
    model_in_words,
    plane_in_words,
    told_apart,
    verdict_in_words,
)

from ..apart import HUNG

WINDOWS = {"gamma": (0.035, 0.045), "a": (0.5, 1.2)}


def do(explorer: Explorer, one: Computation) -> None:
    """Begin work and wait for its end."""
    explorer.begin(one)
    assert explorer.wait(HUNG)
    assert re.fullmatch(rf"{re.escape(one.title)}: done in [\d.]+ s\.", explorer.message)


@pytest.fixture(scope="module")
def told() -> Explorer:
    """A whole story: a breather, its branch, both arms, the pitchfork's boundary, a simulation."""
    explorer = Explorer()
    explorer.choose_at(a=0.7, gamma=0.04)
    do(explorer, jobs.traced(explorer.chosen, "a", (0.6, 0.95)))
    kinds = [point.kind for point in explorer.state.curves["branch1"]]
    explorer.choose_point("branch1", kinds.index("PF"))
    do(explorer, jobs.switched(explorer.chosen))
    do(explorer, jobs.bounded(explorer.chosen, ("gamma", "a"), WINDOWS))
    explorer.choose_point("line3", 3)
    do(explorer, jobs.traced(explorer.chosen, "k", (0.78, 0.82)))
    explorer.choose_point("arms2[0]", 4)
    do(explorer, jobs.simulated(explorer.chosen, 12, 5, 1e-3, (0, 1)))
    return explorer


@pytest.mark.slow
def test_the_script_makes_what_is_seen_to_the_last_digit_and_leaves_its_figures(
    told: Explorer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    made: dict[str, Any] = {}
    exec(told.script(), made)
    for code, branch in told.state.curves.items():
        again = eval(code, made)
        for name in ("a", "gamma", "p", "t1", "arclength"):
            if name in branch.names:
                np.testing.assert_array_equal(again[name], branch[name])
        assert [p.label for p in again] == [p.label for p in branch]
    assert told.state.run is not None
    np.testing.assert_array_equal(made["run5"].record.u, told.state.run[1].record.u)
    assert made["here"].p == told.chosen.orbit.p
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {"zones.pdf", "branches.pdf", "simulation.pdf"}


def test_at_a_bifurcation_a_breather_is_called_neither_stable_nor_unstable(told: Explorer) -> None:
    words = verdict_in_words(told.state.curves["branch1"].first("PF").solution)
    assert words == "at the edge of stability on the infinite chain"


def test_axes_are_what_all_drawn_curves_have(told: Explorer) -> None:
    told.change(axes=("a", "phi"))
    assert told.state.columns == ("a", "p")  # arms have no phi, but the times of two impacts
    told.tick(["branch1", "line3", "branch4"])
    assert told.state.columns == ("a", "phi")
    told.tick(told.state.curves)
    told.change(axes=("", ""))
    assert [*told.state.shown] == [*told.state.curves]


def test_what_was_saved_begins_the_next_session(told: Explorer, tmp_path: Path) -> None:
    path = told.save(tmp_path / "run.nc")
    again = Explorer(run=path)
    assert len(again.state.curves) == len(told.state.curves)
    code, branch = next(iter(again.state.curves.items()))
    assert f"cb.load({str(path)!r})" in again.script()
    made: dict[str, Any] = {}
    exec(again.state.lines[0], {"cb": cb}, made)
    np.testing.assert_array_equal(eval(code, made)["a"], branch["a"])


def test_a_file_of_which_nothing_is_drawn_says_so(tmp_path: Path) -> None:
    start = cb.symmetric(0.2, 0.04, 0.8, lattice=cb.Ring(6))
    cb.save(tmp_path / "run.nc", cb.simulate(start, periods=2))
    explorer = Explorer(run=tmp_path / "run.nc")
    explorer.look_at(explorer.state.fixed[1])  # as a page does when it is opened
    assert "no run between rigid walls with a record" in explorer.message
    sample = cb.simulation.Sample((0,), 8)
    cb.save(tmp_path / "run.nc", cb.simulate(start, periods=2, sample=sample))
    assert Explorer(run=tmp_path / "run.nc").message == ""


def test_stopped_work_keeps_what_is_done_and_says_so() -> None:
    explorer = Explorer()
    explorer.choose_at(a=0.5, gamma=0.08)
    whole = cb.trace(cb.symmetric(a=0.5, gamma=0.08, k=0.8), "a", within={"a": (0.05, 0.9)})
    one = jobs.traced(explorer.chosen, "a", (0.05, 0.9))

    def early(progress: Progress) -> Any:
        advance = progress.advance

        def counted(point: Any, count: int = 1) -> None:
            if progress.count >= 9:
                explorer.stop()
            advance(point, count)

        progress.advance = counted  # type: ignore[method-assign]
        return one.job(progress)

    explorer.begin(Computation(one.title, one.name, one.code, early))
    assert explorer.wait(HUNG)
    branch = explorer.state.curves["branch1"]
    assert branch.stop is cb.continuation.Stop.INTERRUPTED
    assert 9 <= len(branch) < len(whole)
    assert "stopped" in explorer.message
    assert explorer.state.lines[0].endswith("# was stopped: what is seen is a piece of it")
    assert not explorer.busy


def test_work_that_is_stopped_before_it_began_has_an_end_too() -> None:
    """Whoever began it waits for that: no button could be pressed again."""
    thread, held, free = jobs.JobThread(), threading.Event(), threading.Event()
    heard: list[Any] = []

    def holds(_: Progress) -> None:
        held.set()
        assert free.wait(HUNG)

    thread.begin(holds, say=str, done=lambda *_: heard.append("first"))
    assert held.wait(HUNG)
    thread.begin(lambda _: 1, say=str, done=lambda *ended: heard.append(ended))
    thread.stop()
    assert heard == [(None, True, "")]
    free.set()
    assert thread.join(HUNG)
    assert heard[1:] == ["first"]


def test_a_simulation_stops_with_the_periods_that_are_done() -> None:
    explorer = Explorer()
    explorer.choose_at(a=0.5, gamma=0.08)
    explorer.listen(lambda _: explorer.stop() if " of " in explorer.progress else None)
    explorer.begin(jobs.simulated(explorer.chosen, 10, 100_000, 0.0, (0,)))
    assert explorer.wait(HUNG)
    assert explorer.state.run is not None
    assert 0 < explorer.state.run[1].periods < 100_000


@pytest.fixture
def busy() -> Iterator[Explorer]:
    explorer, end = Explorer(), threading.Event()
    explorer.begin(Computation("waiting", "it", "it", lambda _: end.wait(HUNG)))
    yield explorer
    end.set()


def test_one_long_work_at_a_time(busy: Explorer) -> None:
    busy.choose_at(a=0.5, gamma=0.08)  # single breathers are looked at meanwhile
    with pytest.raises(BadInput, match="something is under way"):
        busy.begin(jobs.traced(busy.chosen, "a", (0.1, 0.9)))


def test_an_error_of_the_numerics_is_a_sentence_and_the_next_work_goes_on() -> None:
    explorer = Explorer()
    explorer.choose_at(a=0.5, gamma=0.08)
    for wrong, words in (
        (jobs.traced(explorer.chosen, "a", (0.7, 0.9)), "outside"),
        (Computation("x", "x", "x", lambda _: 1 / 0), "an error of the program: ZeroDivisionError"),
    ):
        explorer.begin(wrong)
        assert explorer.wait(HUNG)
        assert words in explorer.message
        assert not explorer.busy
    do(explorer, jobs.traced(explorer.chosen, "a", (0.4, 0.6)))


@pytest.mark.slow
def test_a_diagram_that_is_known_comes_back_at_once() -> None:
    explorer = Explorer(k=0.7)
    explorer.look_at(0.7)
    assert explorer.wait(HUNG)
    known = explorer.state.plane
    assert known is not None
    assert known.fixed == ("k", 0.7)
    assert {"S", "US"} <= {one.verdict for one in known.regions}
    explorer.look_at(0.6)
    assert explorer.wait(HUNG)
    assert explorer.state.plane is not known
    explorer.look_at(0.7)
    assert explorer.state.plane is known
    assert explorer.state.awaited == ""


@pytest.mark.slow
def test_a_diagram_that_comes_late_does_not_take_the_place_of_the_one_that_is_wanted() -> None:
    """As arrow keys held on the slider have it: away, and back before the first has come."""
    explorer = Explorer(k=0.8)
    explorer.look_at(0.8)
    assert explorer.wait(HUNG)
    right = explorer.state.plane
    explorer.look_at(0.6)
    explorer.look_at(0.8)
    assert explorer.wait(HUNG)
    assert explorer.state.plane is right
    assert right is not None
    assert right.fixed == explorer.state.fixed == ("k", 0.8)


def test_a_click_keeps_the_lattice_and_all_else_that_is_set() -> None:
    explorer = Explorer()
    here = {"k": 0.8, "forcing": "", "lattice": "open:9", "damping": 0.01, "spring": 0.1, "site": 4}
    explorer.choose_typed(a=0.5, gamma=0.05, **here)
    explorer.choose_at(a=0.6, gamma=0.06)
    orbit = explorer.chosen.orbit
    assert (orbit.a, orbit.gamma, orbit.damping, orbit.spring) == (0.6, 0.06, 0.01, 0.1)
    assert orbit.lattice.describe() == cb.OpenChain(9).describe()
    assert "cb.OpenChain(9)" in explorer.chosen.code
    assert eval(explorer.chosen.code, {"cb": cb}).p == orbit.p
    assert explorer.lattice_of(explorer.chosen) == "open:9"
    explorer.stop()


@pytest.mark.slow
def test_zones_follow_a_chosen_point_to_what_it_lives_on(monkeypatch: pytest.MonkeyPatch) -> None:
    around_fork = {"gamma": (0.045, 0.055), "a": (0.7, 0.9)}
    monkeypatch.setattr(session, "zones", partial(cb.zones, within=around_fork))
    on = {"lattice": cb.OpenChain(3), "site": 1, "damping": 0.02}
    window = {"a": (0.5, 0.52)}
    there = cb.trace(cb.symmetric(0.5, 0.05, 0.8, **on), "a", within=window)
    explorer = Explorer(there, cb.trace(cb.symmetric(0.5, 0.05, 0.8), "a", within=window))
    small = "open chain with free ends, 3 sites, site 1, damping = 0.02"
    for curve, wanted, words in (("given1", on, small), ("given2", {}, "infinite chain")) * 2:
        explorer.choose_point(curve, 1)
        explorer.choose_point(curve, 2)
        assert explorer.wait(HUNG)
        assert not explorer.state.awaited
        assert explorer.state.plane is not None
        assert plane_in_words(explorer.state.plane) == words
        explorer.choose_at(a=0.3, gamma=0.06)
        assert explorer.chosen.orbit.p == cb.symmetric(0.3, 0.06, 0.8, **wanted).p
    explorer.choose_point("given1", 1)
    said = next(line for line in explorer.script().splitlines() if line.startswith("zones = "))
    assert said == "zones = cb.zones(k=0.8, damping=0.02, site=1, lattice=given1[1].lattice)"
    assert there[1].lattice == on["lattice"]


@pytest.mark.parametrize("more", [{}, {"c3": 0.4}])
def test_a_chosen_point_brings_its_drive_along(monkeypatch: pytest.MonkeyPatch, more) -> None:
    """Its fields give it back, zones are of its drive, and curves of other drives say so."""
    monkeypatch.setattr(session, "zones", partial(cb.zones, within={"gamma": (0.04, 0.06)}))
    drive = cb.Symbolic(f"-cos(t) - {'c3' if more else '0.4'}*cos(3*t)", **more)
    starts = [cb.symmetric(0.5, 0.05, 0.8, forcing=drive), cb.symmetric(0.5, 0.05, 0.8)]
    explorer = Explorer(*(cb.trace(start, "a", within={"a": (0.4, 0.5)}) for start in starts))
    _, names = told_apart(explorer.state.curves)
    assert "given1: " + ("c3 = 0.4" if more else "F = a (-cos(t) - 0.4 * cos(3 * t))") in names
    explorer.choose_point("given1", 2)
    assert explorer.wait(HUNG)
    orbit, typed = explorer.chosen.orbit, explorer.lives_on(explorer.chosen)
    assert model_in_words(orbit) == "infinite chain, F = a (-cos(t) - 0.4 * cos(3 * t))"
    assert plane_in_words(explorer.state.plane) == model_in_words(orbit)
    explorer.choose_typed(a=orbit.a, gamma=orbit.gamma, k=orbit.k, **typed)
    assert explorer.chosen.orbit.p == pytest.approx(orbit.p, abs=1e-14)
    assert explorer.wait(HUNG)


@pytest.mark.slow
def test_zones_of_a_large_coupling_are_there_at_a_large_frequency() -> None:
    explorer = Explorer()
    explorer.look_at(0.2, fixed="gamma")
    explorer.choose_typed(a=2.0, gamma=0.6, k=0.7, forcing="", lattice="", omega=2.0)
    assert explorer.wait(HUNG)
    assert explorer.state.plane is not None
    assert explorer.state.plane.fixed == ("gamma", 0.6)
    assert explorer.state.slider("gamma")[:2] == pytest.approx((0.02, 0.98))


def test_zones_that_take_long_say_how_far_they_are_and_are_stopped(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(session, "PATIENCE", 0.0)
    explorer, said = Explorer(k=0.8), threading.Event()
    explorer.listen(lambda _: said.set() if "points" in explorer.drawing else None)
    explorer.choose_typed(a=0.5, gamma=0.05, k=0.8, forcing="", lattice="open:4", damping=0.02)
    assert said.wait(HUNG)
    assert (explorer.stoppable, explorer.busy) == (True, False)
    assert explorer.state.awaited == "k = 0.8, damping=0.02, lattice=cb.OpenChain(4)"
    explorer.stop()
    assert explorer.wait(HUNG)
    assert "cb.OpenChain(4): stopped; what was done is kept" in explorer.message
    assert (explorer.stoppable, explorer.state.awaited) == (False, "")
    made = "zones = cb.zones(k=0.8, damping=0.02, lattice=cb.OpenChain(4))"
    assert made in explorer.script()
    explorer.look_at(0.8)  # a piece is not taken for the diagram
    assert explorer.state.awaited
    explorer.stop()
    assert explorer.wait(HUNG)


def test_how_far_zones_are_is_not_said_any_more_when_others_are_looked_at(monkeypatch) -> None:
    """Of a ring that was typed and typed away again; they are given up."""
    monkeypatch.setattr(session, "PATIENCE", 0.0)
    explorer, said, heard = Explorer(k=0.8), threading.Event(), list[str]()
    explorer.look_at(0.8)
    assert explorer.wait(HUNG)
    explorer.listen(lambda _: said.set() if "points" in explorer.drawing else None)
    usual = {"a": 0.5, "gamma": 0.05, "k": 0.8, "forcing": ""}
    explorer.choose_typed(**usual, lattice="open:4", damping=0.02)
    assert said.wait(HUNG)
    explorer.choose_typed(**usual, lattice="")
    assert (explorer.drawing, explorer.state.awaited) == ("", "")
    explorer.listen(lambda _: heard.append(explorer.drawing))
    assert explorer.wait(HUNG)
    explorer.tell("later")
    assert {*heard} == {""}
    assert explorer.state.plane is not None
    assert plane_in_words(explorer.state.plane) == "infinite chain"
    explorer.choose_typed(**usual, lattice="open:4", damping=0.02)
    assert explorer.state.awaited  # what was given up was not computed on
    explorer.stop()
    assert explorer.wait(HUNG)


def test_a_place_beyond_grazing_says_what_is_there() -> None:
    explorer = Explorer()
    explorer.look_at(0.8)
    assert explorer.wait(HUNG)
    explorer.choose_at(a=0.95, gamma=0.08)
    assert explorer.message.endswith("; beyond GR 3 sites impact: unstable")
    explorer.choose_at(a=0.5, gamma=0.08)
    assert explorer.message == ""


def test_what_cannot_be_is_refused_with_a_sentence() -> None:
    explorer = Explorer()
    with pytest.raises(BadInput, match="choose a breather first"):
        _ = explorer.chosen
    with pytest.raises(NoSolution, match="smallest"):
        explorer.choose_at(a=0.001, gamma=0.08)
    with pytest.raises(BadInput, match="nothing to save"):
        explorer.save("run.nc")
    explorer.choose_at(a=0.5, gamma=0.08)
    with pytest.raises(BadInput, match="choose one of the labelled points"):
        jobs.switched(explorer.chosen)
    with pytest.raises(BadInput, match="a branch was expected, got a str; a file is given"):
        Explorer("run.nc")
    with pytest.raises(BadInput, match="0 <= k <= 1"):
        Explorer(k=2.0)


def test_points_of_another_problem_are_shown_by_their_numbers(tmp_path: Path) -> None:
    mine = cb.Problem(lambda x, p: np.array([x[0] ** 2 - p["mu"]]), {"x": 1.0}, {"mu": 1.0})
    explorer = Explorer(cb.trace(mine, "mu", within={"x": (-1, 1)}, events=[cb.fold()]))
    explorer.choose_point("given1", 2)
    assert explorer.chosen.orbit is None
    with pytest.raises(BadInput, match="nothing to simulate"):
        jobs.simulated(explorer.chosen, 20, 5, 0.0, (0,))


def test_a_plane_that_cannot_be_is_refused_and_the_last_one_stays() -> None:
    explorer = Explorer()
    explorer.look_at(0.1, fixed="gamma")
    assert explorer.wait(HUNG)
    known = explorer.state.plane
    for name in ("damping", "q"):
        with pytest.raises(BadInput, match=f"'{name}' is fixed in no plane of zones: one of a, "):
            explorer.look_at(0.1, fixed=name)
    with pytest.raises(BadInput, match=r"gamma = 0.1 a place has a and k; k and gamma were"):
        explorer.choose_at(k=0.8, gamma=0.1)
    explorer.look_at(1.0, fixed="k")
    assert explorer.wait(HUNG)
    assert "zones need 0 < k < 1" in explorer.message
    assert explorer.state.plane is known
    assert (explorer.state.fixed, explorer.state.title) == (("gamma", 0.1), "gamma = 0.1")
    explorer.look_at(0.1)
    assert explorer.message == ""


def test_another_root_is_chosen_and_stays_so_at_a_click() -> None:
    explorer = Explorer()
    usual = {"forcing": "", "lattice": ""}
    explorer.choose_typed(a=0.5, gamma=0.08, k=0.8, root=2, **usual)
    assert explorer.chosen.code == "cb.symmetric(a=0.5, gamma=0.08, k=0.8, root=2)"
    lower = explorer.chosen.orbit.p
    assert lower == cb.symmetric(a=0.5, gamma=0.08, k=0.8, root=2).p
    explorer.choose_at(a=0.5, gamma=0.08)
    assert explorer.chosen.orbit.p == lower
    explorer.choose_typed(a=0.5, gamma=0.08, k=0.8, root=None, **usual)
    assert explorer.chosen.orbit.p > lower
    explorer.stop()


def test_a_curve_is_removed_and_everything_taken_back_step_by_step(told: Any) -> None:
    branch = told.state.curves["branch1"]
    explorer = Explorer(branch, branch)
    lines = explorer.state.lines
    explorer.choose_point("given1", 3)
    explorer.remove("given1")
    assert [*explorer.state.curves] == ["given2"]
    assert explorer.chosen.code == "given1[3]"  # as before, and so is the script that makes it
    assert explorer.state.lines == lines
    explorer.undo()
    assert explorer.message == "given1 is back."
    assert [*explorer.state.curves] == ["given1", "given2"]
    explorer.choose_point("given2", 3)
    explorer.undo()
    assert [*explorer.state.curves] == ["given1"]
    assert explorer.message == "given2 is taken back."
    assert explorer.state.chosen is None  # nothing was when it came
    explorer.undo()
    with pytest.raises(BadInput, match="nothing to take back"):
        explorer.undo()


def test_a_curve_in_two_parameters_is_drawn_in_its_plane_until_a_branch_comes(told: Any) -> None:
    line = told.state.curves["line3"]
    branch = told.state.curves["branch1"]
    explorer = Explorer(branch, line)
    assert explorer.state.columns == line.curve.varied
    do(explorer, Computation("later", "later", "...", lambda _: branch))
    assert explorer.state.columns == ("a", "p")


@pytest.mark.parametrize("recorded", ["low", 1j, None])
def test_axes_are_all_columns_of_numbers_and_no_others(recorded: Any) -> None:
    line = cb.Problem(
        lambda x, p: x**2 - p["mu"], {"u": np.ones(3)}, {"mu": 1.0},
        record={"odd": lambda point: recorded, "sum": lambda point: point["u"].sum()},
    )  # fmt: skip
    branch = cb.trace(line, "mu", within={"mu": (0.5, 2)}, events=(), steps=cb.Steps(most=3))
    state = Explorer(branch).state
    assert state.columns == ("mu", "u")
    assert drawn_columns(branch) == ["mu", "sum", "arclength", "residual", "u"]


def test_a_cycle_is_drawn_by_its_period_with_and_without_its_equations(tmp_path: Path) -> None:
    def circle(t: float, x: Any, p: Any) -> Any:
        inward = p["a"] * (1 - x[0] ** 2 - x[1] ** 2)
        return [inward * x[0] - x[1], inward * x[1] + x[0]]

    t = np.linspace(0, 2 * np.pi, 51)
    start = cb.cycle(circle, (t, np.vstack([np.cos(t), np.sin(t)])), {"a": 0.1})
    branch = cb.trace(start, "a", steps=cb.Steps(most=2))
    cb.save(tmp_path / "cycles.nc", branch)
    for known in (branch, cb.load(tmp_path / "cycles.nc")):
        assert Explorer(known).state.columns == ("a", "period")
    assert not {"orbit", "mesh"} & {*drawn_columns(branch)}
