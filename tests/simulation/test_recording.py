"""Runs on disk: cut anywhere, taken up again, the same bits."""

from __future__ import annotations

import math
import os
import shutil
import signal
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

import contbreather
from contbreather.errors import BadInput
from contbreather.lattice import Fourier
from contbreather.orbits import symmetric
from contbreather.simulation import RunStop, Sample, open_recording, record, recording, simulate

from ..apart import begun, until

CONDITIONS = {"a": 0.2, "gamma": 0.11, "k": 0.8, "damping": 0.005}


@pytest.fixture
def state():
    rng = np.random.default_rng(7)
    u, v = symmetric(0.2, 0.11, 0.8).state(12)
    return u + rng.normal(0, 1e-3, 12), v


def assert_same(recorded, run):
    assert (recorded.periods, recorded.end) == (run.periods, run.end)
    assert np.array_equal(recorded.strobe().u, run.strobe.u)
    assert np.array_equal(recorded.strobe().v, run.strobe.v)
    assert np.array_equal(recorded.strobe(1).u, run.strobe.u[:, 1])
    assert np.array_equal(recorded.final.u, run.final.u)
    assert np.array_equal(recorded.impacts, run.impacts)


def test_run_on_disk_is_the_run_in_memory(tmp_path, state):
    sample = Sample(sites=(0, 1), per_period=8)
    run = simulate(state, **CONDITIONS, periods=60, sample=sample, t0=1.0)
    recorded = record(tmp_path / "run", state, **CONDITIONS, periods=60, sample=sample, t0=1.0)
    assert_same(recorded, run)
    assert_same(open_recording(tmp_path / "run"), run)
    dense = np.concatenate([s.dense_u.reshape(-1, 2) for s in recorded.chunks()])
    assert np.array_equal(dense, run.record.u)


def test_memory_does_not_grow_with_the_length_of_a_recording(tmp_path, monkeypatch):
    monkeypatch.setattr(recording, "LARGEST", 50_000)
    monkeypatch.setattr(recording, "EVERY", math.inf)  # seconds
    monkeypatch.setattr(contbreather.simulation.integrator, "CHUNK", 2**14)
    monkeypatch.setattr(contbreather.simulation.integrator, "MOMENT", math.inf)
    state = symmetric(0.7, 0.06, 0.2).state(20)
    peaks = []
    for name, periods in (("warm", 10), ("short", 3000), ("long", 30000)):
        tracemalloc.start()
        settings = {"a": 0.7, "gamma": 0.06, "k": 0.2, "periods": periods}
        recorded = record(tmp_path / name, state, **settings, sample=Sample((0,), 4))
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        assert recorded.periods == periods
    assert peaks[2] < 1.5 * peaks[1]


@pytest.mark.parametrize("forcing", [None, Fourier(cos={1: -1.0, 3: 0.1}, sin={5: 0.3})])
def test_run_goes_on_where_it_stopped_with_the_same_bits(tmp_path, state, forcing, monkeypatch):
    monkeypatch.setattr(recording, "EVERY", math.inf)  # seconds
    on = {**CONDITIONS, "forcing": forcing}
    for periods in (13, 13, 40, 100):
        recorded = record(tmp_path / "run", state, **on, periods=periods)
        assert recorded.periods == periods
    assert len(recorded.files) == 3
    assert_same(recorded, simulate(state, **on, periods=100))


def test_interrupted_recording_keeps_every_finished_period(tmp_path, state, monkeypatch):
    advance = contbreather.simulation.integrator.EventDriven.advance
    calls = []

    def interrupted(self, *args, **kwargs):
        calls.append(1)
        if len(calls) == 4:
            raise KeyboardInterrupt
        return advance(self, *args, **kwargs)

    monkeypatch.setattr(contbreather.simulation.integrator.EventDriven, "advance", interrupted)
    first = record(tmp_path / "run", state, **CONDITIONS, periods=1000)
    assert (first.interrupted, first.stop) == (True, RunStop.INTERRUPTED)
    assert 0 < first.periods < 1000
    second = record(tmp_path / "run", state, **CONDITIONS, periods=1000)
    assert (second.interrupted, second.stop) == (False, RunStop.DONE)
    assert_same(second, simulate(state, **CONDITIONS, periods=1000))


def recording_elsewhere(tmp_path: Path, state):
    """Another process that records into ``run``, a file every 0.02 s, until it is killed."""
    np.savez(tmp_path / "state.npz", u=state[0], v=state[1])
    script = (
        "import numpy as np\n"
        "from contbreather.simulation import recording\n"
        "recording.EVERY = 0.02\n"
        f"state = tuple(np.load(r'{tmp_path}/state.npz')[x] for x in 'uv')\n"
        f"recording.record(r'{tmp_path}/run', state, **{CONDITIONS!r}, periods=10**6)\n"
    )
    return begun("-c", script)


@pytest.mark.parametrize(
    ("changed", "sentence"),
    [
        ({"a": 0.21}, "holds another run: a is 0.2 there and 0.21 here"),
        ({"sample": Sample((0,), 4)}, "holds another run: sample is None there"),
        (
            {"forcing": Fourier(cos={1: -1.0, 3: 0.1})},
            "holds another run: forcing is .* there and .*0.1",
        ),
        ({"state": ([0.0], [0.0])}, "holds a run from another state"),
    ],
)
def test_folder_of_another_run_is_refused(tmp_path, state, changed, sentence):
    record(tmp_path / "run", state, **CONDITIONS, periods=2)
    other = {**CONDITIONS, "periods": 4, "state": state, **changed}
    with pytest.raises(BadInput, match=sentence):
        record(tmp_path / "run", **other)
    assert open_recording(tmp_path / "run").periods == 2


def test_places_that_hold_no_run_are_refused(tmp_path, state):
    with pytest.raises(BadInput, match="no run in"):
        open_recording(tmp_path)
    (tmp_path / "note.txt").touch()
    with pytest.raises(BadInput, match="is not empty and holds no run"):
        record(tmp_path, state, **CONDITIONS, periods=2)


def test_progress_is_shown_on_standard_error_and_only_if_wanted(state, monkeypatch, capsys):
    monkeypatch.setattr("contbreather.progress.PATIENCE", 0.0)
    simulate(state, **CONDITIONS, periods=20)
    assert capsys.readouterr() == ("", "")  # no terminal here
    simulate(state, **CONDITIONS, periods=20, progress=True)
    shown = capsys.readouterr()
    assert shown.out == ""
    assert "20/20 periods" in shown.err


# --- damage, and two at once ----------------------------------------------------------------------


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    """A run in five files, and another one."""
    folder = tmp_path_factory.mktemp("recordings")
    own, other = (symmetric(0.2, 0.11, 0.8).state(12, t) for t in (0.0, 0.3))
    for periods in (4, 8, 12, 16, 20):
        record(folder / "sound", own, **CONDITIONS, periods=periods)
    record(folder / "other", other, **CONDITIONS, periods=4)
    return folder


def flip(path, rng):
    data = bytearray(path.read_bytes())
    data[rng.integers(len(data))] ^= 1 << int(rng.integers(8))
    path.write_bytes(data)


def cut(path, rng):
    path.write_bytes(path.read_bytes()[: rng.integers(path.stat().st_size)])


def grow(path, rng):
    path.write_bytes(path.read_bytes() + rng.bytes(40))


def change_one_number(path, rng):
    with np.load(path) as file:
        arrays = {name: file[name] for name in file.files}
    arrays["u"] = arrays["u"] + 1e-12
    np.savez(path, **arrays)


def put_another_run_in(path, rng):
    first = next((path.parents[1] / "other").glob("0*.npz"))
    path.write_bytes((first.with_name("start.npz") if "start" in path.name else first).read_bytes())


def put_a_later_piece_in(path, rng):
    path.write_bytes(max(path.parent.glob("0*.npz")).read_bytes())


def remove(path, rng):
    path.unlink()


def replace_by_a_pipe(path, rng):
    path.unlink()
    os.mkfifo(path)


def replace_by_a_directory(path, rng):
    path.unlink()
    path.mkdir()


DAMAGES = [
    *(20 * [flip]), *(6 * [cut]), grow, change_one_number, put_another_run_in,
    put_a_later_piece_in, remove, replace_by_a_pipe, replace_by_a_directory,
]  # fmt: skip


@pytest.mark.parametrize("which", [0, 1, 3])  # the start, the first file, an inner one
def test_damaged_recording_is_refused_in_a_sentence(sound, tmp_path, which):
    rng = np.random.default_rng(which)
    for j, damage in enumerate(DAMAGES):
        shutil.copytree(sound, tmp_path / f"{j}")
        path = [tmp_path / f"{j}/sound/start.npz", *sorted(tmp_path.glob(f"{j}/sound/0*.npz"))][
            which
        ]
        damage(path, rng)
        with pytest.raises(BadInput, match=r"is damaged: |no run in"):
            _ = open_recording(path.parent).impacts


def test_missing_inner_file_is_noticed_before_anything_is_read(sound, tmp_path):
    shutil.copytree(sound, tmp_path / "all")
    folder = tmp_path / "all" / "sound"
    sorted(folder.glob("0*.npz"))[2].unlink()
    with pytest.raises(BadInput, match=r"does not follow on from .*, which ends at period 8"):
        open_recording(folder)


def test_run_goes_on_after_what_is_damaged_was_taken_away(sound, tmp_path):
    shutil.copytree(sound, tmp_path / "all")
    folder = tmp_path / "all" / "sound"
    kept = open_recording(folder)
    whole = simulate(kept.start, **CONDITIONS, periods=20)
    flip(kept.files[-1], np.random.default_rng(0))
    with pytest.raises(BadInput, match="remove it and all files after it to go on"):
        record(folder, kept.start, **CONDITIONS, periods=24)
    kept.files[-1].unlink()
    assert_same(record(folder, kept.start, **CONDITIONS, periods=20), whole)


def test_two_processes_do_not_write_to_one_folder_and_a_killed_one_lets_go(tmp_path, state):
    with recording_elsewhere(tmp_path, state) as child:
        until(lambda: child.poll() is not None or len([*(tmp_path / "run").glob("0*.npz")]) > 2)
        with pytest.raises(BadInput, match="is being written to by another run"):
            record(tmp_path / "run", state, **CONDITIONS, periods=10**6)
        assert open_recording(tmp_path / "run").periods > 0  # reading is free
        assert child.poll() is None
        child.send_signal(signal.SIGKILL)
    done = open_recording(tmp_path / "run").periods
    recorded = record(tmp_path / "run", state, **CONDITIONS, periods=done + 10)
    assert_same(recorded, simulate(state, **CONDITIONS, periods=done + 10))
