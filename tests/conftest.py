"""What every test finds, and what it leaves behind."""

from __future__ import annotations

import os
import shlex
import signal
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from contbreather import native
from contbreather.cli import main


def pytest_configure() -> None:
    """A shell that starts the tests in the background has them ignore Ctrl-C, children included."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(autouse=True, scope="session")
def code_of_its_own(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Machine code that tests ask for is kept where no other process looks for it."""
    own, usual = tmp_path_factory.getbasetemp() / "code", native._file

    def file(*given: Any) -> Path:
        named = usual(*given)
        return named if "NUMBA_CACHE_DIR" in os.environ else own / named.name

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(native, "_file", file)
        yield


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
