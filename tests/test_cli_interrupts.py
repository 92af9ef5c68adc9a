"""Ctrl-C at the command line: one stops it, nothing is half said, what is done is kept."""

from __future__ import annotations

import json
import math
import os
import re
import shlex
import signal
import subprocess
import tomllib
from pathlib import Path
from typing import Any

import pytest

import contbreather as cb
from contbreather.cli import DONE, INTERRUPTED, main
from contbreather.progress import Counter

from .apart import begun, ended, until, workers_of
from .typed import Run

ZONES = "zones --k 0.8 --gamma-window 0.02 0.1 --json --csv zones.csv"
BRANCH = "branch --free a --gamma 0.08 --k 0.8 --json --csv branch.csv -o branch.svg"
LINES = {  # and the part of its work after which it is interrupted, in the midst of the last walk
    ZONES: 0.5,
    BRANCH: 0.5,
    "boundary PF --k 0.8 --json --csv line.csv": 0.9,
    "diagram --free a --gamma 0.04 --k 0.8 --json --csv tree.csv": 0.5,
}
WORDS = "interrupted: cut short"


class Clock:
    """The signal of Ctrl-C at one of the pieces that walks consist of, or at the first question
    that the chain is asked: later ones are asked of compiled code, which counts nothing."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, owner: type = Counter) -> None:
        self.asked, self.last = 0, math.inf
        name = "advance" if owner is Counter else "mean"
        method = getattr(owner, name)

        def counted(*given: Any) -> Any:
            self.asked += 1
            if self.asked == self.last:
                signal.raise_signal(signal.SIGINT)
            return method(*given)

        monkeypatch.setattr(owner, name, counted)


@pytest.mark.slow
@pytest.mark.apart
def test_what_is_done_is_written_and_marked_as_cut_short(run: Run, monkeypatch: pytest.MonkeyPatch):
    clock = Clock(monkeypatch)
    for line, part in LINES.items():
        clock.asked, clock.last = 0, math.inf
        status, out, err = run(line)
        assert (status, err) == (DONE, ""), line
        assert json.loads(out)["interrupted"] is False
        for path in map(Path, os.listdir()):
            assert WORDS not in path.read_text()
            path.unlink()
        clock.asked, clock.last = 0, max(1, int(part * clock.asked))
        status, out, err = run(line)
        assert (status, err) == (
            INTERRUPTED, "contbreather: interrupted: the result is cut short\n"
        ), line  # fmt: skip
        content: dict[str, Any] = json.loads(out)
        assert content["interrupted"] is True
        assert sorted(content["written"]) == sorted(os.listdir())
        for path in map(Path, os.listdir()):
            if path.suffix == ".csv":
                names, *rows, end = path.read_text().splitlines()
                assert end == f"# {WORDS}"
                assert {row.count(",") for row in rows} == {names.count(",")}
            path.unlink()
    # and in tables for people
    clock.asked, clock.last = 0, 24  # of more than forty
    assert "interrupted, curves may be missing." in run(ZONES.replace("--json ", ""))[1]
    Path("zones.csv").unlink()
    # and before there is anything to be said or written
    clock.last, Clock(monkeypatch, cb.InfiniteChain).last = math.inf, 1
    assert run(ZONES) == (INTERRUPTED, "", "contbreather: interrupted\n")
    assert os.listdir() == []


def drawn(monkeypatch: pytest.MonkeyPatch, times: int) -> None:
    """Ctrl-C, so many times, while a figure is drawn."""
    import contbreather.plotting as plotting

    plot = plotting.plot

    def interrupted(branch: cb.Branch, **columns: Any) -> Any:
        for _ in range(times):
            signal.raise_signal(signal.SIGINT)
        return plot(branch, **columns)

    monkeypatch.setattr(plotting, "plot", interrupted)


@pytest.mark.slow
@pytest.mark.apart
def test_while_it_writes_one_interruption_waits_and_a_second_does_not(run, monkeypatch):
    with monkeypatch.context() as patch:
        drawn(patch, 1)
        status, out, err = run(BRANCH)
    assert (status, err) == (INTERRUPTED, "contbreather: interrupted\n")
    content = json.loads(out)
    assert content["interrupted"] is False  # the numbers are complete
    assert sorted(content["written"]) == sorted(os.listdir()) == ["branch.csv", "branch.svg"]
    for name in content["written"]:
        Path(name).unlink()
    drawn(monkeypatch, 2)
    assert run(BRANCH)[:2] == (INTERRUPTED, "")
    assert os.listdir() == ["branch.csv"]


def test_the_handler_of_the_caller_comes_back(run: Run) -> None:
    before = signal.getsignal(signal.SIGINT)
    run(BRANCH)
    assert signal.getsignal(signal.SIGINT) is before


# --- a process of its own -------------------------------------------------------------------------


def process(line: str, where: Path, **options: Any) -> subprocess.CompletedProcess[str]:
    script = options.pop("script", ["-m", "contbreather"])
    return ended(*script, *shlex.split(line), cwd=where, **options)


# In the midst of its work it says so, and waits for Ctrl-C.
AT_WORK = """
import sys, time
from contbreather.__main__ import main
from contbreather.progress import Counter
advance, left = Counter.advance, int(sys.argv.pop(1))

def counted(*given):
    global left
    left -= 1
    if left == 0:
        print("at work", file=sys.stderr, flush=True)
        time.sleep(600)
    return advance(*given)

Counter.advance = counted
sys.exit(main())
"""


@pytest.mark.slow
def test_a_process_ends_with_its_status_and_a_sentence(tmp_path: Path) -> None:
    line = "zones --k 0.8 --k 0.4 --k 0.9 --json --csv zones.csv"
    with begun("-c", AT_WORK, "20", *line.split(), cwd=tmp_path) as one:
        assert one.stderr.readline() == "at work\n"
        one.send_signal(signal.SIGINT)
        out, err = one.communicate()
    assert one.returncode == INTERRUPTED
    assert err.startswith("contbreather: interrupted")
    assert "Traceback" not in err
    assert json.loads(out)["written"] == os.listdir(tmp_path)
    assert json.loads(out)["interrupted"]


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="processes are looked up there")
@pytest.mark.parametrize(
    ("line", "to_all"),
    [("atlas --k 0.3:0.9:400 --workers 2", True), ("run study.toml --workers 2", False)],
)
def test_sigterm_ends_workers_too_and_leaves_nothing_to_clean_up(tmp_path, line, to_all):
    (tmp_path / "study.toml").write_text("[zones.z]\nk = {from = 0.3, to = 0.9, count = 400}\n")
    with begun("-m", "contbreather", *shlex.split(line), cwd=tmp_path) as one:
        until(lambda: workers_of(one.pid) or one.poll() is not None)
        workers = {*workers_of(one.pid)}
        os.killpg(one.pid, signal.SIGTERM) if to_all else one.terminate()
        _, err = one.communicate()  # until nobody has its streams open any more
    assert one.returncode == 143
    # but for what a study says of each part that is done
    assert re.fullmatch(r"(contbreather: \d+ of 400, z/k=[\d.]+\n)*", err)
    assert workers
    assert not any(Path(f"/proc/{number}").exists() for number in workers)


# When Ctrl-C comes a module is imported that makes any exception an ImportError, as those written
# in C do.
AMID_IMPORT = """
import signal, sys
wanted = [sys.argv.pop(1)]

class Finder:
    def find_spec(self, name, path=None, target=None):
        if name in wanted:
            wanted.remove(name)
            try:
                signal.raise_signal(signal.SIGINT)
            except BaseException as error:
                raise ImportError("it failed") from error

sys.meta_path.insert(0, Finder())
from contbreather.__main__ import main
sys.exit(main())
"""
SIMULATE = "simulate --a 0.1 --gamma 0.04 --k 0.8 --periods 3 --json"
IMPORTED = [
    (SIMULATE, "cyclopts"),
    (SIMULATE, "llvmlite.binding"),
    ("branch --free a --gamma 0.08 --k 0.8 --window 0.5 0.55 -o b.png", "matplotlib.figure"),
]


@pytest.mark.slow
@pytest.mark.parametrize(("line", "module"), IMPORTED)
def test_one_that_comes_during_an_import_is_not_lost(tmp_path: Path, line: str, module: str):
    one = process(line, tmp_path, script=["-c", AMID_IMPORT, module])
    assert one.returncode == INTERRUPTED
    out, err = one.stdout, one.stderr
    first, *_ = err.splitlines()
    assert first.startswith("contbreather: interrupted")
    assert "Error" not in err
    assert ("Wrote b.png" in out) == (tmp_path / "b.png").exists()


def test_the_console_script_hears_it_from_the_start() -> None:
    project = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text())["project"]
    assert project["scripts"] == {"contbreather": "contbreather.__main__:main"}


POINT = "point --a 0.5 --gamma 0.04 --k 0.8"


@pytest.mark.parametrize("line", [POINT, "--help", ""])
def test_a_full_or_closed_standard_output_is_a_sentence(tmp_path: Path, line: str) -> None:
    with open("/dev/full", "w") as full:
        closed = {"stdout": None, "preexec_fn": lambda: os.close(1)}
        one = process(line or POINT, tmp_path, **({"stdout": full} if line else closed))
    why = "No space left on device" if line else "it is closed"
    said = f"contbreather: cannot write to standard output: {why}\n"
    assert (one.returncode, one.stderr) == (1, said)


@pytest.mark.slow
def test_a_full_or_closed_standard_error_keeps_the_status(tmp_path: Path) -> None:
    with open("/dev/full", "w") as full:
        one = process("point --a 1 --gamma 1 --k 1", tmp_path, stderr=full)
    closed: dict[str, Any] = {"stderr": None, "preexec_fn": lambda: os.close(2)}
    other = process("point --a 1 --gamma 1 --k 1", tmp_path, **closed)
    assert one.returncode == other.returncode == 2


ODD = [
    ("--help", {"COLUMNS": "9" * 20}),
    ("branch --free a --gamma 0.08 --k 0.8 --window 0.5 0.55 -o b.png",
     {"COLUMNS": "0", "PYTHONIOENCODING": "ascii", "MPLBACKEND": "nonsense"}),
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(("line", "env"), ODD)
def test_odd_terminals_and_settings_do_no_harm(tmp_path: Path, line: str, env: dict[str, str]):
    one = process(line, tmp_path, env=env)
    assert (one.returncode, one.stderr) == (DONE, "")
    assert one.stdout


def test_json_is_right_in_any_encoding(tmp_path: Path) -> None:
    line = f"{POINT} --json --forcing '-cos(t) - \u00b5*cos(3*t)' --set \u00b5=0.1"
    one = process(line, tmp_path, env={"PYTHONIOENCODING": "ascii"})
    assert (one.returncode, one.stderr) == (DONE, "")
    assert "\u03bc" in json.loads(one.stdout)["forcing"]  # Python's own normal form of the letter


def test_a_directory_that_is_gone_is_said_to_be(tmp_path: Path) -> None:
    (tmp_path / "gone").mkdir()
    one = process(
        f"branch --free a --gamma 0.08 --k 0.8 --csv {'b.csv'}",
        tmp_path / "gone",
        preexec_fn=lambda: os.rmdir(os.getcwd()),
    )
    assert one.returncode in (1, 2)
    assert (one.stdout, one.stderr.count("\n")) == ("", 1)
    assert one.stderr.startswith("contbreather: ")


def test_json_nested_too_deep_is_no_state(tmp_path: Path) -> None:
    deep = tmp_path / "deep.json"
    deep.write_text('{"u": ' + "[" * 100_000 + "]" * 100_000 + "}")
    arguments = ["--a", "0.5", "--gamma", "0.08", "--k", "0.8", "--start", str(deep)]
    assert main(["simulate", *arguments]) == 2
