"""Runs on disk: cut anywhere, taken up again, the same bits."""

from __future__ import annotations

import os
import signal
import sys
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

import contbreather as cb
from contbreather.errors import BadInput
from contbreather.lattice import Fourier
from contbreather.orbits import symmetric
from contbreather.simulation import RunStop, Sample, open_recording, record, simulate

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
    path = tmp_path / "run.nc"
    recorded = record(path, state, **CONDITIONS, periods=60, sample=sample, t0=1.0)
    assert_same(recorded, run)
    assert_same(open_recording(path), run)
    dense = np.concatenate([s.dense_u.reshape(-1, 2) for s in recorded.chunks()])
    assert np.array_equal(dense, run.record.u)
    assert_same_columns(cb.load(path), run)
    assert_same_columns(recorded.last(7), run.since(53))


def assert_same_columns(one, other):
    assert one.conditions == other.conditions
    for name, (_, values) in other.variables().items():
        assert np.array_equal(one.variables()[name][1], values), name


def test_a_recording_is_read_in_pieces_that_are_the_whole(tmp_path, state):
    """Dense samples make pieces short: here of a few periods each."""
    sample = Sample(sites=(0, 3), per_period=2**16)
    run = simulate(state, **CONDITIONS, periods=17, sample=sample)
    pieces = [*record(tmp_path / "run.nc", state, **CONDITIONS, periods=17, sample=sample).chunks()]
    assert len(pieces) > 2
    assert [piece.first for piece in pieces[1:]] == np.cumsum([p.periods for p in pieces])[
        :-1
    ].tolist()
    assert all(
        set(piece.impacts["period"]) <= {*range(piece.first, piece.first + piece.periods)}
        for piece in pieces
    )
    assert np.array_equal(np.concatenate([piece.impacts for piece in pieces]), run.impacts)
    assert np.array_equal(
        np.concatenate([piece.dense_v.reshape(-1, 2) for piece in pieces]), run.record.v
    )


@pytest.mark.slow
def test_memory_does_not_grow_with_the_length_of_a_recording(tmp_path):
    """A machine that is fast takes the longest chunks there are, of 16 MB each."""
    sample, on = Sample((0,), 2**15), {"a": 0.7, "gamma": 0.06, "k": 0.2}
    state = symmetric(**on).state(4)
    record(tmp_path / "warm.nc", state, **on, periods=1, sample=sample)
    tracemalloc.start()
    recorded = record(tmp_path / "run.nc", state, **on, periods=250, sample=sample)
    longest = sum(len(piece.impacts) for piece in recorded.chunks())
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert longest == 500
    assert (tmp_path / "run.nc").stat().st_size > 250 * 2**15 * 16 > 1.5 * peak


@pytest.mark.parametrize("forcing", [None, Fourier(cos={1: -1.0, 3: 0.1}, sin={5: 0.3})])
def test_run_goes_on_where_it_stopped_with_the_same_bits(tmp_path, state, forcing):
    on = {**CONDITIONS, "forcing": forcing}
    for periods in (0, 13, 13, 40, 100):
        recorded = record(tmp_path / "run.nc", state, **on, periods=periods)
        assert recorded.periods == periods
    assert_same(recorded, simulate(state, **on, periods=100))
    assert record(tmp_path / "run.nc", state, **on, periods=3).periods == 100  # it has more


@pytest.mark.slow
def test_a_run_that_ends_early_says_so_on_disk(tmp_path):
    on = {"a": 0.0, "gamma": 0.0, "k": 1.0, "periods": 3}
    start = [0.0], [1e5]
    run, kept = simulate(start, **on), record(tmp_path / "run.nc", start, **on)
    assert kept.stop is run.stop is RunStop.CHATTER
    again = record(tmp_path / "run.nc", start, **on)
    assert (again.stop, again.last(9).reason) == (RunStop.CHATTER, run.reason)


# --- ends that nobody asked for -------------------------------------------------------------------

RECORDS = """
import resource, signal, sys
import numpy as np
from contbreather.errors import BadInput
from contbreather.simulation import Sample, record
path, conditions, limit = sys.argv[1], eval(sys.argv[2]), int(sys.argv[3])
if limit:
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
state = tuple(np.load(path + ".state.npy"))
sample = Sample((0,), 2**13) if limit else None
try:
    run = record(path, state, **conditions, sample=sample, periods=10**8)
except BadInput as error:
    print(error)
else:
    print(run.interrupted, run.stop.name, run.periods)
"""


def recording_elsewhere(path: Path, state, limit=0):
    """Another process that records without end."""
    np.save(f"{path}.state.npy", state)
    return begun("-c", RECORDS, path, repr(CONDITIONS), str(limit))


def saved(path: Path) -> int:
    return open_recording(path).periods if path.exists() else 0


@pytest.mark.slow
def test_ctrl_c_keeps_every_finished_period(tmp_path, state):
    path = tmp_path / "run.nc"
    with recording_elsewhere(path, state) as child:
        until(lambda: child.poll() is not None or saved(path))
        child.send_signal(signal.SIGINT)
        told = child.communicate()[0]
    first = open_recording(path)
    assert told.split() == ["True", RunStop.INTERRUPTED.name, str(first.periods)]
    assert_same(first, simulate(state, **CONDITIONS, periods=first.periods))


@pytest.mark.slow
def test_a_killed_process_leaves_what_it_saved_and_the_run_goes_on_from_there(tmp_path, state):
    path = tmp_path / "run.nc"
    with recording_elsewhere(path, state) as child:
        until(lambda: child.poll() is not None or saved(path))  # reading meanwhile is free
        assert child.poll() is None
        child.send_signal(signal.SIGKILL)
    done = open_recording(path).periods
    recorded = record(path, state, **CONDITIONS, periods=done + 10)
    assert_same(recorded, simulate(state, **CONDITIONS, periods=done + 10))


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="limits of Linux")
def test_a_full_disk_is_a_sentence_and_what_was_saved_is_kept(tmp_path, state):
    """HDF5 itself ends the interpreter where it cannot write."""
    path, limit = tmp_path / "run.nc", 2**25  # bytes: beyond what is held in memory
    with recording_elsewhere(path, state, limit) as child:
        told, err = child.communicate()
    assert (child.returncode, err) == (0, "")
    assert told == f"cannot write {path}: File too large; choose another place\n"
    assert_same(open_recording(path), simulate(state, **CONDITIONS, periods=saved(path)))
    assert {p.name for p in tmp_path.iterdir()} == {"run.nc", "run.nc.state.npy"}


# --- other files ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changed", "sentence"),
    [
        ({"a": 0.21}, "holds another run: a is 0.2 there and 0.21 here"),
        ({"sample": Sample((0,), 4)}, "holds another run: sample is None there"),
        (
            {"forcing": Fourier(cos={1: -1.0, 3: 0.1})},
            "holds another run: forcing is .* there and .*0.1",
        ),
        ({"state": np.zeros((2, 12))}, "holds a run from another state"),
    ],
)
def test_file_of_another_run_is_refused(tmp_path, state, changed, sentence):
    record(tmp_path / "run.nc", state, **CONDITIONS, periods=2)
    other = {**CONDITIONS, "periods": 4, "state": state, **changed}
    with pytest.raises(BadInput, match=sentence):
        record(tmp_path / "run.nc", **other)
    assert open_recording(tmp_path / "run.nc").periods == 2


def test_places_that_hold_no_recording_are_refused(tmp_path, state):
    with pytest.raises(BadInput, match="No such file"):
        open_recording(tmp_path / "run.nc")
    with pytest.raises(BadInput, match="there is no directory"):
        record(tmp_path / "none" / "run.nc", state, **CONDITIONS, periods=2)
    (tmp_path / "note.txt").write_text("a note, and no run")
    cb.save(tmp_path / "saved.nc", simulate(state, **CONDITIONS, periods=2))
    for name, words in (
        (".", "is a folder, as versions before recorded into; a recording is one file"),
        ("note.txt", "it is not a netCDF-4 file"),
        ("saved.nc", "holds no recording: it was saved"),
    ):
        with pytest.raises(BadInput, match=words):
            record(tmp_path / name, state, **CONDITIONS, periods=2)


def test_damaged_recording_is_refused_in_a_sentence(tmp_path, state):
    path = tmp_path / "run.nc"
    kept = record(path, state, **CONDITIONS, periods=9)
    sound, rng = path.read_bytes(), np.random.default_rng(1)
    flipped = [bytearray(sound) for _ in range(40)]
    for image in flipped:
        image[rng.integers(len(image))] ^= 1 << int(rng.integers(8))
    cut = [sound[: rng.integers(len(sound))] for _ in range(10)]
    for image in (*flipped, *cut, sound + rng.bytes(40), b""):
        path.write_bytes(image)
        for read in (lambda: open_recording(path), lambda: kept.impacts, lambda: kept.last(3)):
            with pytest.raises(BadInput, match=r"is damaged|lost its end|not a netCDF-4 file"):
                read()
    path.unlink()
    os.mkfifo(path)  # which would be waited for
    with pytest.raises(BadInput, match="not an ordinary file"):
        open_recording(path)


def test_an_empty_recording_is_where_it_starts(tmp_path, state):
    kept = record(tmp_path / "run.nc", state, **CONDITIONS, periods=0, t0=0.5)
    again = open_recording(tmp_path / "run.nc")
    for run in (kept, again):
        assert (run.periods, run.end, run.stop, run.sample) == (0, 0.5, RunStop.DONE, None)
        assert np.array_equal(run.final, run.start)
        assert len(run.impacts) == 0
        assert run.strobe(0).u.shape == (1,)
        assert run.strobe().u.shape == (1, 12)
    assert again.conditions == kept.conditions
