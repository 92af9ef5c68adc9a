"""The command line as a process of its own: its streams, its signals, what the system refuses."""

from __future__ import annotations

import errno
import json
import math
import os
import signal
import sys
from collections.abc import Iterator
from contextlib import nullcontext
from unittest.mock import Mock

import pytest

import contbreather.__main__ as entry
from contbreather.cli import BAD_INPUT, DONE, FAILED, INTERRUPTED, main, output
from contbreather.cli.process import CutShort
from contbreather.errors import Interrupted, NotConverged

from .apart import ended

POINT = ["point", "--a", "0.5", "--gamma", "0.04", "--k", "0.8", "--json"]


@pytest.fixture(autouse=True)
def surroundings(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """What a process of its own would change for good, put back."""
    before = signal.getsignal(signal.SIGINT)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    monkeypatch.setenv("COLUMNS", "80")
    yield
    signal.signal(signal.SIGINT, before)


# --- how a command line ends ----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("how", "status", "words"),
    [
        (NotConverged("no way"), FAILED, "no way"),
        (MemoryError("Unable to allocate 9 TiB"), FAILED,
         "the memory is too small for that: Unable to allocate 9 TiB"),
        (MemoryError(), FAILED, "the memory is too small for that: it is full"),
        (OSError(errno.EIO, "Input/output error", "/a/b"), FAILED,
         "the system refuses '/a/b': Input/output error"),
        (Interrupted(), INTERRUPTED, "interrupted"),
    ],
)  # fmt: skip
def test_every_end_has_its_status_and_its_words(monkeypatch, capsys, how, status, words) -> None:
    monkeypatch.setattr("contbreather.orbits.symmetric_roots", Mock(side_effect=how))
    assert main(POINT) == status
    assert capsys.readouterr() == ("", f"contbreather: {words}\n")


@pytest.mark.slow
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


# --- what is written ------------------------------------------------------------------------------


BRANCH = "branch --free a --gamma 0.08 --k 0.8 --window 0.5 0.55 --csv -"


@pytest.mark.slow
def test_a_table_on_standard_output_has_it_to_itself() -> None:
    done = ended("-m", "contbreather", *BRANCH.split())
    header, *rows = done.stdout.splitlines()
    assert header == "label,a,gamma,k,unstable,t1,t2,c,asymmetry,arclength,residual,p,phi"
    assert all(row.count(",") == header.count(",") for row in rows)
    assert "6 points; reached the edge of the window" in " ".join(done.stderr.split())


@pytest.mark.slow
def test_a_table_may_go_to_standard_output_whatever_that_is() -> None:
    with open("/dev/full", "w") as full:  # as any other device, a terminal for instance
        done = ended("-m", "contbreather", *BRANCH.split(), stdout=full)
    said = "contbreather: cannot write /dev/stdout: No space left on device; choose another place\n"
    assert (done.returncode, done.stderr) == (BAD_INPUT, said)


@pytest.mark.slow
def test_a_table_into_the_file_that_standard_output_is_is_refused(tmp_path) -> None:
    line = ["zones", "--k", "0.8", "--csv", "zones.csv"]
    with (tmp_path / "zones.csv").open("w") as out:
        done = ended("-m", "contbreather", *line, stdout=out, cwd=tmp_path)
    both = "standard output and --csv both name zones.csv; give different names"
    assert (done.returncode, done.stderr) == (BAD_INPUT, f"contbreather: {both}\n")
    assert (tmp_path / "zones.csv").read_text() == ""


def test_a_picture_that_was_cut_short_says_so_above(tmp_path) -> None:
    from matplotlib.figure import Figure

    into = output.Output(output=str(tmp_path / "t.svg"))
    for cut, stopped in ((False, nullcontext()), (True, pytest.raises(CutShort))):
        figure = Figure()
        for drawn in (figure, figure.add_subplot()):
            with stopped:
                into.leave(output.Result(dict, list, tuple, lambda drawn=drawn: drawn), cut=cut)
        assert figure.get_suptitle() == ("interrupted: cut short" if cut else "")


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
