"""The shell around commands: what they say aloud, and how the tab key completes them."""

from __future__ import annotations

import json
import logging
import re
import subprocess
from pathlib import Path

import contbreather as cb
from contbreather.cli import main

BRANCH = [
    "branch", "--free", "a", "--a", "0.5", "--gamma", "0.08", "--k", "0.8", "--window", "0.4", "0.9"
]  # fmt: skip
STEP = re.compile(r"step of \S+ to a = \S+: (\d+) Newton iterations, residual \S+")


def test_verbose_logs_each_step_with_its_newton_iterations(capsys) -> None:
    """On standard error, so that a program still reads JSON; special points are named."""
    assert main([*BRANCH, "--json", "--verbose"]) == 0
    printed = capsys.readouterr()
    steps = STEP.findall(printed.err)
    points = json.loads(printed.out)["columns"]["a"]
    assert len(points) - 1 - printed.err.count("found GR") <= len(steps) <= len(points) + 2
    assert all(1 <= int(count) <= 8 for count in steps)
    assert printed.err.count("found GR: Point(") == 1
    assert main([*BRANCH, "--json"]) == 0
    assert capsys.readouterr().err == ""


def test_the_logger_says_the_same_in_python_and_nothing_unless_asked(caplog) -> None:
    branch = cb.trace(cb.symmetric(0.5, 0.08, 0.8), "a", within={"a": (0.4, 0.6)}, events=())
    assert caplog.records == []
    with caplog.at_level(logging.DEBUG, "contbreather"):
        again = cb.trace(branch[3].solution, "a", within={"a": (0.4, 0.6)}, events=())
    steps = [record for record in caplog.records if STEP.fullmatch(record.getMessage())]
    assert len(steps) == len(again) - 1
    assert {record.levelname for record in steps} == {"DEBUG"}


def test_the_tab_key_is_taught_once_and_completes(tmp_path: Path, monkeypatch, capsys) -> None:
    monkeypatch.delenv("XDG_DATA_HOME", raising=False)
    monkeypatch.setenv("HOME", str(tmp_path))
    left = []
    for _ in range(2):
        assert main(["--install-completion", "--shell", "bash"]) == 0
        left.append({path: path.read_text() for path in tmp_path.rglob("*") if path.is_file()})
    assert left[0] == left[1]
    (script,) = (path for path in left[0] if path.name == "contbreather")
    ask = (
        f'source "{script}"\n'
        'COMP_WORDS=(contbreather bou); COMP_CWORD=1; _contbreather; echo "${COMPREPLY[@]}"\n'
        'COMP_WORDS=(contbreather branch --to); COMP_CWORD=2; _contbreather; echo "${COMPREPLY[@]}"'
    )
    run = subprocess.run(["bash", "-c", ask], capture_output=True, text=True, check=True)
    assert run.stdout.split() == ["boundary", "--towards"]
