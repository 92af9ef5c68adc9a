"""What every test finds, and what it leaves behind."""

from __future__ import annotations

import os
import shlex
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path

import pytest

from contbreather import bare, kernels
from contbreather.cli import main


def pytest_configure() -> None:
    """A shell that starts the tests in the background has them ignore Ctrl-C, children included.

    Loops that were edited since the installation are compiled before the first test, and nothing
    is behind it.
    """
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    place = kernels.place()
    if os.environ.get(kernels.ASKED) != "0" and place is not None and find_spec("numba"):
        os.environ[kernels.ASKED] = "0"  # of other processes, those of xdist among them
        subprocess.run([sys.executable, bare.__file__, place], check=True)


@pytest.fixture(autouse=True)
def close_figures() -> Iterator[None]:
    """Once some test has imported pyplot it keeps every figure, and warns of many."""
    yield
    pyplot = sys.modules.get("matplotlib.pyplot")
    if pyplot is not None:
        pyplot.close("all")


@pytest.fixture
def run(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Callable[[str], tuple[int, str, str]]:
    """Run a command line in an empty directory: status, standard output, standard error."""
    monkeypatch.chdir(tmp_path)

    def line(command: str) -> tuple[int, str, str]:
        status = main(shlex.split(command))
        out, err = capsys.readouterr()
        return status, out, err

    return line
