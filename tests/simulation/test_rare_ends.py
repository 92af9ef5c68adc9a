"""Ends that hardly ever come: of runs, of files under way, of workers; each a sentence."""

from __future__ import annotations

import errno
import json
import os
from typing import Any

import numpy as np
import pytest

import contbreather as cb
from contbreather.errors import BadInput, NotConverged
from contbreather.simulation import (
    RunStop,
    State,
    open_recording,
    periodic,
    record,
    recording,
    simulate,
    simulate_smooth,
)
from contbreather.simulation.integrator import EventDriven, in_chunks

HERE: dict[str, Any] = {"a": 0.2, "gamma": 0.04, "k": 0.8}
STATE = cb.symmetric(**HERE).state(4)


# --- runs -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("status", "sentence"),
    [
        ("WILD", r"the motion blows up in period 0 \(a = 0\.2, k = 0\.8"),
        ("ASTRAY", r"in period 0 the search .* please report it"),
    ],
)
def test_a_run_that_the_loops_give_up_is_an_error(monkeypatch, status, sentence) -> None:
    from contbreather.simulation import event_loop, integrator

    def give_up(*given: Any) -> None:
        given[-1][:] = 0, getattr(event_loop, status), 0

    monkeypatch.setattr(integrator, "EVENT_LOOP", give_up)
    with pytest.raises(NotConverged, match=sentence):
        simulate(STATE, **HERE, periods=2)


def test_a_run_that_ends_in_its_first_chunk_ends_where_it_began(monkeypatch) -> None:
    monkeypatch.setattr("contbreather.simulation.integrator.MOST", 500)
    fast = {"a": 0.5, "gamma": 0.0, "k": 1.0}
    for periods in (3, 0.5, 1.5):
        run = simulate(([0.1], [1e3]), periods=periods, t0=0.3, **fast)
        assert run.stop is RunStop.CHATTER
        assert (run.periods, run.end) == (0, 0.3)
        assert (run.final.u[0], run.final.v[0]) == (0.1, 1e3)
        assert repr(run).startswith("<Run of 1 sites over 0 periods: ")
        assert run.reason in repr(run)


@pytest.mark.parametrize(("room", "most"), [(1, 1), (16, 2), (17, 2), (32, 4), (7, 1)])
def test_a_chunk_holds_what_has_room_and_a_period_at_least(monkeypatch, room, most) -> None:
    """Of four sites a period has eight numbers."""
    monkeypatch.setattr("contbreather.simulation.integrator.CHUNK", room)
    conditions = simulate(STATE, **HERE, periods=0).conditions
    start = State(*(np.array(x) for x in STATE))
    ahead = in_chunks(EventDriven(start, conditions, 0.0), periods=13, progress=False)
    first, *lengths = [one.periods for one in ahead]  # how long a period takes is seen on the first
    assert first + sum(lengths) == 13
    assert max(lengths) == most


def test_where_the_ring_does_not_go_on_a_branch_of_its_motions_ends(monkeypatch) -> None:
    shared = {**HERE, "damping": 0.05}
    own = periodic(simulate(STATE, **shared, periods=60).final, **shared)
    problem = own.problem
    monkeypatch.setattr("contbreather.simulation.integrator.MOST", 0)  # half a period has one
    with pytest.raises(ArithmeticError, match="has more than 0 impacts in period 0"):
        problem.residual(np.concatenate(own.state) + 1e-9, problem.params)
    monkeypatch.undo()
    off = problem.residual(np.concatenate(own.state), problem.params)
    assert np.abs(off).max() < 1e-9


# --- smooth runs ----------------------------------------------------------------------------------


def test_a_smooth_motion_that_blows_up_is_no_equation_to_the_engine() -> None:
    state = simulate_smooth(STATE, **HERE, m=6, damping=0.1, periods=100).final
    problem = periodic(state, **HERE, m=6, damping=0.1).problem

    backwards = {**problem.params, "damping": -1e4}  # amplifies by exp(1e4) in a unit of time
    with pytest.raises(ArithmeticError, match="dop853 cannot go on at t = "):
        problem.residual(np.concatenate(state), backwards)


# --- recordings and the system --------------------------------------------------------------------


@pytest.mark.parametrize(
    ("call", "code", "sentence"),
    [
        ("fcntl.flock", errno.ENOLCK, r"^cannot lock .*run: No locks available; choose another"),
        ("fcntl.flock", errno.EAGAIN, "is being written to by another run; wait for its end"),
        ("fcntl.flock", errno.EACCES, "is being written to by another run; wait for its end"),
        ("pathlib.Path.iterdir", errno.EIO, r"^cannot read .*run: Input/output error; choose"),
        ("builtins.open", errno.EIO, r"start\.npz is damaged: Input/output error; bring it back"),
    ],
)
def test_what_the_system_refuses_is_a_sentence(tmp_path, monkeypatch, call, code, sentence) -> None:
    def refuse(*given: Any, **more: Any) -> Any:
        raise OSError(code, os.strerror(code))

    record(tmp_path / "run", STATE, **HERE, periods=1)
    monkeypatch.setattr(call, refuse)
    with pytest.raises(BadInput, match=sentence):
        record(tmp_path / "run", STATE, **HERE, periods=1)


def test_a_folder_that_cannot_be_made_is_a_sentence(tmp_path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(BadInput, match=r"^cannot write .*file/run: Not a directory; choose"):
        record(tmp_path / "file" / "run", STATE, **HERE, periods=1)
    deep = record(tmp_path / "one" / "two", STATE, **HERE, periods=1)  # these are made
    assert deep.periods == 1


def test_a_file_that_this_version_does_not_write_is_refused(tmp_path) -> None:
    """Sound by its checksum, yet with another content: what is missing, or what is out of range."""
    kept = record(tmp_path / "run", STATE, **HERE, periods=2)
    start = tmp_path / "run" / "start.npz"
    about = json.loads(str(np.load(start)["about"]))
    for changed, words in (
        ({"gamma": 0.3}, r"^gamma = 0\.3"),
        ({"damping": -1.0}, r"^damping = -1\.0"),
        ({"forcing": {"kind": "fourier", "cos": [[2, 1.0]], "sin": []}}, "must be antisymmetric"),
        ({"forcing": {"kind": "of somebody"}}, "'of somebody' is of no kind that is known here"),
    ):
        conditions = {**about["conditions"], **changed}
        text = np.array(json.dumps({**about, "conditions": conditions}))
        recording.save_part(start, {"about": text, **kept.start._asdict()})
        with pytest.raises(BadInput, match=words):
            open_recording(tmp_path / "run")
    for missing, word in (("conditions", "walls"), ("t0", "t0"), ("sample", "sample")):
        text = np.array(json.dumps({k: v for k, v in about.items() if k != missing}))
        recording.save_part(start, {"about": text, **kept.start._asdict()})
        with pytest.raises(BadInput, match=rf"does not write such a file \('{word}'\)"):
            open_recording(tmp_path / "run")
    recording.save_part(start, {"about": np.array("no json"), **kept.start._asdict()})
    with pytest.raises(BadInput, match="this version does not write such a file"):
        open_recording(tmp_path / "run")


def test_a_file_under_the_name_of_another_is_refused(tmp_path) -> None:
    kept = record(tmp_path / "run", STATE, **HERE, periods=2)
    (path,) = kept.files
    path.rename(path.with_name("000000000000-000000000003.npz"))
    with pytest.raises(BadInput, match=r"\(its name is that of another file\)"):
        _ = open_recording(tmp_path / "run").impacts


@pytest.mark.parametrize("name", ["left.part", "lock"])
def test_what_a_killed_process_left_does_not_stand_in_the_way(tmp_path, name: str) -> None:
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / name).write_text("half of it")
    assert record(tmp_path / "run", STATE, **HERE, periods=1).periods == 1


def test_an_empty_recording_is_where_it_starts(tmp_path) -> None:
    kept = record(tmp_path / "run", STATE, **HERE, periods=0, t0=0.5)
    assert (kept.periods, kept.files, kept.end, kept.stop) == (0, [], 0.5, RunStop.DONE)
    assert kept.final is kept.start
    assert len(kept.impacts) == 0
    assert kept.strobe(0).u.shape == (1,)
    assert kept.strobe().u.shape == (1, 4)
    again = open_recording(tmp_path / "run")
    assert (again.t0, again.sample, again.interrupted) == (0.5, None, False)
    assert again.conditions == kept.conditions
