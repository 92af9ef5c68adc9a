"""The command line as a process of its own: its streams, its signals, what the system refuses."""

from __future__ import annotations

import errno
import io
import json
import math
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any

import pytest

import contbreather.__main__ as entry
from contbreather import cli
from contbreather.cli import BAD_INPUT, DONE, FAILED, INTERRUPTED, main, output
from contbreather.cli.process import (
    CutShort,
    abandon,
    computing,
    interruptible,
    prepare,
    trouble,
    until_interrupted,
)
from contbreather.errors import BadInput, Interrupted, NotConverged
from contbreather.files import write_csv

POINT = ["point", "--a", "0.5", "--gamma", "0.04", "--k", "0.8", "--json"]


@pytest.fixture(autouse=True)
def surroundings(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """What a process of its own would change for good, put back."""
    before = signal.getsignal(signal.SIGINT)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    monkeypatch.setenv("COLUMNS", "80")
    yield
    signal.signal(signal.SIGINT, before)


# --- streams --------------------------------------------------------------------------------------


def test_standard_error_that_is_not_there_takes_anything(monkeypatch) -> None:
    monkeypatch.setattr(sys, "stderr", None)
    prepare()
    print("something, also \u03bc", file=sys.stderr, flush=True)
    sys.stderr.close()


def test_streams_that_are_there_are_kept_and_take_any_letter(monkeypatch) -> None:
    raw = io.BytesIO()
    out, err = io.TextIOWrapper(raw, encoding="ascii"), io.StringIO()
    monkeypatch.setattr(sys, "stdout", out)
    monkeypatch.setattr(sys, "stderr", err)
    prepare()
    assert sys.stdout is out
    assert sys.stderr is err
    print("\u03bc", flush=True)
    assert raw.getvalue() == b"?\n"


@pytest.mark.parametrize(
    ("columns", "kept"),
    [("0", False), ("19", False), ("20", True), ("80", True), ("9999", True), ("10000", False),
     ("9" * 20, False), ("wide", True), ("-5", True), ("", True)],
)  # fmt: skip
def test_a_width_that_cannot_be_laid_out_is_left_to_the_terminal(
    monkeypatch, columns, kept
) -> None:
    monkeypatch.setenv("COLUMNS", columns)
    prepare()
    assert ("COLUMNS" in os.environ) == kept
    monkeypatch.delenv("COLUMNS", raising=False)
    prepare()
    assert "COLUMNS" not in os.environ


def test_figures_of_the_command_line_go_into_files(monkeypatch) -> None:
    monkeypatch.setenv("MPLBACKEND", "TkAgg")
    prepare()
    assert os.environ["MPLBACKEND"] == "agg"


def test_what_a_stream_could_not_take_goes_nowhere_in_the_end() -> None:
    reading, writing = os.pipe()
    os.close(reading)
    stream = open(writing, "w", buffering=1)  # noqa: SIM115
    with pytest.raises(BrokenPipeError):
        stream.write("something\n")
    abandon(stream)
    stream.close()  # without a word
    abandon(io.StringIO())  # has no number


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (FileNotFoundError(errno.ENOENT, "No such file"), "the current directory is gone; change"),
        (OSError(errno.ENOSPC, "No space left"), "cannot write to standard output: No space left"),
        (OSError("odd"), "cannot write to standard output: odd"),
        (OSError(), "cannot write to standard output: OSError"),
        (OSError(errno.EIO, "Input/output error", "/a/b"), "the system refuses '/a/b': Input/out"),
        (FileNotFoundError(errno.ENOENT, "No such file", "/a"), "the system refuses '/a': No such"),
    ],
)
def test_what_the_system_refuses_is_a_sentence(error: OSError, words: str) -> None:
    assert trouble(error).startswith(words)


# --- how a command line ends ----------------------------------------------------------------------


def ending(monkeypatch: pytest.MonkeyPatch, capsys, how: Any) -> tuple[int, str, str]:
    """The status and words of a command line whose command ends like this."""

    def run(tokens: list[str]) -> int:
        print("so far")
        if isinstance(how, BaseException):
            raise how
        return how

    monkeypatch.setattr(cli, "_run", run)
    status = main([])
    out, err = capsys.readouterr()
    return status, out, err


@pytest.mark.parametrize(
    ("how", "status", "words"),
    [
        (DONE, DONE, ""),
        (BadInput("a is missing"), BAD_INPUT, "contbreather: a is missing\n"),
        (NotConverged("no way"), FAILED, "contbreather: no way\n"),
        (CutShort(), INTERRUPTED, "contbreather: interrupted: the result is cut short\n"),
        (KeyboardInterrupt(), INTERRUPTED, "contbreather: interrupted\n"),
        (Interrupted(), INTERRUPTED, "contbreather: interrupted\n"),
        (BrokenPipeError(), FAILED, ""),
        (MemoryError("Unable to allocate 9 TiB"), FAILED,
         "contbreather: the memory is too small for that: Unable to allocate 9 TiB\n"),
        (MemoryError(), FAILED, "contbreather: the memory is too small for that: it is full\n"),
        (OSError(errno.ENOSPC, "No space left"), FAILED,
         "contbreather: cannot write to standard output: No space left\n"),
        (7, 7, ""),
    ],
)  # fmt: skip
def test_every_end_has_its_status_and_its_words(monkeypatch, capsys, how, status, words) -> None:
    assert ending(monkeypatch, capsys, how) == (status, "so far\n", words)


def test_statuses_are_those_that_scripts_know() -> None:
    assert (DONE, FAILED, BAD_INPUT, INTERRUPTED) == (0, 1, 2, 130)
    assert entry.INTERRUPTED == 130


@pytest.mark.apart
def test_a_process_of_its_own_reads_its_arguments_and_ignores_ctrl_c_at_its_end(
    monkeypatch, capsys
) -> None:
    monkeypatch.setattr(sys, "argv", ["contbreather", *POINT])
    monkeypatch.setenv("COLUMNS", "3")
    assert entry.main() == DONE
    out, err = capsys.readouterr()
    assert json.loads(out)["a"] == 0.5
    assert err == ""
    assert "COLUMNS" not in os.environ
    assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN


@pytest.mark.apart
def test_before_anything_is_imported_ctrl_c_ends_the_process(monkeypatch) -> None:
    heard: dict[str, Any] = {}

    def run() -> int:
        heard["handler"] = signal.getsignal(signal.SIGINT)
        return DONE

    monkeypatch.setattr(cli, "main", run)
    said, left = [], []
    monkeypatch.setattr(os, "write", lambda number, words: said.append((number, words)))
    monkeypatch.setattr(os, "_exit", left.append)
    assert entry.main() == DONE
    heard["handler"](signal.SIGINT, None)
    assert said == [(2, b"contbreather: interrupted\n")]
    assert left == [130]


# --- the watch ------------------------------------------------------------------------------------


@pytest.fixture
def spoken(monkeypatch) -> list[str]:
    words: list[str] = []
    monkeypatch.setattr(os, "write", lambda number, line: words.append(line.decode()))
    return words


class Left(Exception):
    """In place of the end of the process."""


@pytest.fixture
def leaving(monkeypatch) -> None:
    def left(status: int) -> None:
        raise Left(status)

    monkeypatch.setattr(os, "_exit", left)


@pytest.mark.apart
def test_until_something_is_computed_a_process_of_its_own_ends_at_once(
    spoken, leaving, monkeypatch
) -> None:
    def command() -> None:
        with interruptible(alone=True):
            signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(cli, "main", command)
    with pytest.raises(Left, match="130"):
        entry.main()
    assert spoken == ["contbreather: interrupted\n"]
    assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN


@pytest.mark.apart
def test_in_somebody_elses_process_it_is_an_exception_from_the_start(spoken, leaving) -> None:
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt), interruptible(alone=False):
        signal.raise_signal(signal.SIGINT)
    assert spoken == []
    assert signal.getsignal(signal.SIGINT) is before


def interrupted_after_computing(*then: Callable[[], Any], alone: bool = True) -> None:
    with interruptible(alone=alone):
        with computing():
            pass
        signal.raise_signal(signal.SIGINT)
        for step in then:
            step()


@pytest.mark.apart
def test_after_a_computation_it_waits_and_is_heard_at_the_end(spoken, leaving) -> None:
    done: list[str] = []
    with pytest.raises(KeyboardInterrupt):
        interrupted_after_computing(lambda: done.append("written"))
    assert done == ["written"]
    assert spoken == [
        "contbreather: interrupted: writing what is done; Ctrl-C once more to leave it\n"
    ]


@pytest.mark.apart
def test_one_that_waits_stops_the_next_computation(spoken, leaving) -> None:
    done: list[str] = []

    def compute() -> None:
        with computing():
            done.append("computed")

    with pytest.raises(KeyboardInterrupt):
        interrupted_after_computing(compute)
    assert done == []


@pytest.mark.apart
def test_a_new_command_line_knows_nothing_of_the_last_one(spoken, leaving) -> None:
    for _ in range(2):
        with pytest.raises(KeyboardInterrupt):
            interrupted_after_computing(alone=False)
    assert len(spoken) == 2
    with interruptible(alone=False):
        pass


@pytest.mark.apart
@pytest.mark.parametrize("kind", [ImportError, AttributeError, SystemError])
def test_what_imports_and_machine_code_make_of_it_is_an_interruption(kind) -> None:
    def working(interrupted: bool) -> None:
        with interruptible(alone=False), computing():
            try:
                if interrupted:
                    signal.raise_signal(signal.SIGINT)
            finally:
                raise kind("it failed")

    with pytest.raises(KeyboardInterrupt):
        working(True)
    with pytest.raises(kind, match="it failed"):
        working(False)


@pytest.mark.apart
def test_while_results_are_written_the_second_one_leaves(spoken) -> None:
    """Also where the first one stopped the computation."""
    done: list[str] = []

    def both(during: int, after: int) -> None:
        with interruptible(alone=False):
            with suppress(KeyboardInterrupt), computing():
                for _ in range(during):
                    signal.raise_signal(signal.SIGINT)
            for _ in range(after):
                signal.raise_signal(signal.SIGINT)
            done.append("written")

    for during, after in ((1, 1), (0, 2)):
        with pytest.raises(KeyboardInterrupt):
            both(during, after)
    with pytest.raises(KeyboardInterrupt):  # which was not taken for the end of the command
        both(1, 0)
    assert done == ["written"]
    assert len(spoken) == 1


def test_what_a_computation_gives_is_kept_with_whether_it_was_cut_short() -> None:
    def cut() -> Any:
        raise Interrupted(partial="half of it")

    def nothing() -> Any:
        raise Interrupted()

    assert until_interrupted(lambda: "all of it") == ("all of it", False)
    assert until_interrupted(cut) == ("half of it", True)
    with pytest.raises(Interrupted):
        until_interrupted(nothing)


# --- what is written ------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["-", "/dev/fd/1"])
def test_a_table_on_standard_output_has_it_to_itself(name: str) -> None:
    line = ["branch", "--free", "a", "--gamma", "0.08", "--k", "0.8", "--window", "0.5", "0.55"]
    command = [sys.executable, "-m", "contbreather", *line, "--csv", name]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    header, *rows = done.stdout.splitlines()
    assert header == "label,a,gamma,k,unstable,t1,t2,c,asymmetry,arclength,residual,p,phi"
    assert all(row.count(",") == header.count(",") for row in rows)
    assert "6 points; reached the edge of the window" in " ".join(done.stderr.split())


def test_a_table_may_go_to_standard_output_whatever_that_is() -> None:
    line = ["branch", "--free", "a", "--gamma", "0.08", "--k", "0.8", "--window", "0.5", "0.55"]
    with open("/dev/full", "w") as full:  # as any other device, a terminal for instance
        done = subprocess.run(
            [sys.executable, "-m", "contbreather", *line, "--csv", "-"],
            stdout=full, stderr=subprocess.PIPE, text=True, check=False,
        )  # fmt: skip
    said = "contbreather: cannot write /dev/stdout: No space left on device; choose another place\n"
    assert (done.returncode, done.stderr) == (BAD_INPUT, said)


def test_a_table_into_the_file_that_standard_output_is_is_refused(tmp_path) -> None:
    line = ["zones", "--k", "0.8", "--csv", "zones.csv"]
    with (tmp_path / "zones.csv").open("w") as out:
        done = subprocess.run(
            [sys.executable, "-m", "contbreather", *line],
            stdout=out, stderr=subprocess.PIPE, text=True, check=False, cwd=tmp_path,
        )  # fmt: skip
    said = "contbreather: --csv zones.csv: standard output goes there; give --csv another file\n"
    assert (done.returncode, done.stderr) == (BAD_INPUT, said)
    assert (tmp_path / "zones.csv").read_text() == ""


def test_a_table_that_was_cut_short_says_so_in_its_last_line(tmp_path) -> None:
    rows = [(math.nan, 0.1, None), ("x", 1, None)]
    for cut in (False, True):
        path = write_csv(tmp_path / "t.csv", ["b", "a", "c"], rows, output.CUT if cut else "")
        lines = path.read_text().splitlines()
        assert lines[:3] == ["b,a,c", ",0.1,", "x,1,"]
        assert lines[3:] == (["# interrupted: cut short"] if cut else [])


def test_a_picture_that_was_cut_short_says_so_above(tmp_path) -> None:
    from matplotlib.figure import Figure

    for cut in (False, True):
        figure = Figure()
        axes = figure.add_subplot()
        for drawn in (figure, axes):
            path = output.to_figure(str(tmp_path / "t.svg"), lambda drawn=drawn: drawn, cut=cut)
            assert path.exists()
        title = figure.get_suptitle()
        assert title == ("interrupted: cut short" if cut else "")


def test_nothing_is_said_where_there_is_nothing_to_say(capsys) -> None:
    output.say("one", "two")
    assert capsys.readouterr().out.split() == ["one", "two"]
    output.say()
    assert capsys.readouterr().out == ""


def test_an_interruption_says_what_it_brings() -> None:
    assert str(Interrupted()) == "interrupted; nothing is done yet"
    assert str(Interrupted(partial=[1])) == "interrupted; .partial is what was done: [1]"
    assert str(Interrupted("enough")) == "enough"
    assert Interrupted().partial is None
    failed = NotConverged("no way")
    assert math.isnan(failed.residual)
    assert (failed.iterations, failed.last) == (None, None)


def test_a_reader_that_has_seen_enough_is_no_failure_to_speak_of(monkeypatch, capsys) -> None:
    reading, writing = os.pipe()
    os.close(reading)
    with open(writing, "w") as pipe:
        monkeypatch.setattr(sys, "stdout", pipe)
        status = main(POINT)
        monkeypatch.undo()
        assert (status, capsys.readouterr().err) == (FAILED, "")
