"""The shell around commands: what they say aloud, and how the tab key completes them."""

from __future__ import annotations

import json
import logging
import re
import subprocess
from pathlib import Path

import cyclopts
import pytest
from cyclopts.completion import ShellDetectionError

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


@pytest.fixture
def written_once(monkeypatch) -> None:
    """The words of a shell, which are not ours, take a second each time: the same ones again."""
    write = cyclopts.App.generate_completion
    made: dict[str, str] = {}

    def kept(app: cyclopts.App, *, shell: str) -> str:
        return made[shell] if shell in made else made.setdefault(shell, write(app, shell=shell))

    monkeypatch.setattr(cyclopts.App, "generate_completion", kept)


@pytest.mark.usefixtures("written_once")
@pytest.mark.parametrize("shell", ["zsh", "fish"])
def test_the_tab_key_is_taught_once(shell, tmp_path: Path, monkeypatch, capsys) -> None:
    for name in ("XDG_DATA_HOME", "XDG_CONFIG_HOME", "ZDOTDIR"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("HOME", str(tmp_path))
    left = []
    for _ in range(2):
        assert main(["--install-completion", "--shell", shell]) == 0
        left.append({path: path.read_text() for path in tmp_path.rglob("*") if path.is_file()})
        path = Path(capsys.readouterr().out.split(";")[0].removeprefix("Wrote "))
        assert "--window" in path.read_text()
    assert left[0] == left[1]


@pytest.mark.usefixtures("written_once")
def test_bash_completes_commands_and_options(tmp_path: Path, monkeypatch, capsys) -> None:
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


def test_a_shell_that_is_not_known_is_refused_in_a_sentence(monkeypatch, capsys) -> None:
    def lost(*_: object, **__: object) -> None:
        raise ShellDetectionError("no shell")

    monkeypatch.setattr(cyclopts.App, "install_completion", lost)
    assert main(["--install-completion"]) == 2
    assert capsys.readouterr().err == (
        "contbreather: this shell is not known; name one, as in --install-completion --shell bash\n"
    )
