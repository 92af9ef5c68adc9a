"""What every test finds, and what it leaves behind."""

from __future__ import annotations

import gc
import os
import shlex
import signal
import subprocess
import sys
import tempfile
from collections.abc import Generator, Iterator
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, settings
from threadpoolctl import ThreadpoolController

import contbreather as cb
from contbreather import machine_code
from contbreather.cli import main
from contbreather.workers import THREADS

from .apart import ended

# a machine that is slow fails no test
settings.register_profile("tests", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("tests")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--as-a-user", action="store_true", help="no number of threads is set")
    parser.addoption("--here", action="store_true", help="tests marked `apart` in this process")


def pytest_configure(config: pytest.Config) -> None:
    """A shell that starts the tests in the background has them ignore Ctrl-C, children included.

    Loops that were edited since the installation are compiled before the first test, and nothing
    is behind it. Each worker of xdist has a core: a second thread of the linear algebra that tests
    do themselves would only wait for that of another. Hundreds of tests begin a process, and each
    would compile every module again where nobody may write down what came of it.
    """
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    sys.dont_write_bytecode = False
    if not config.getoption("--as-a-user"):
        for name in THREADS:
            os.environ.setdefault(name, "1")
        ThreadpoolController().limit(limits=1)  # what is loaded by now has not seen that
    config.addinivalue_line("markers", "apart: in a process of its own, for what it does to it")
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    if find_spec("numba") and "PYTEST_XDIST_WORKER" not in os.environ:
        subprocess.run(machine_code.COMPILE.replace("python", sys.executable).split(), check=True)


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, Any, Any]:
    """Imports and tests stay: to look through them for garbage takes a fifth of the collection."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.enable()


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Files with slow tests come first, so that no worker is left with one when the others end."""
    slow = {item.path for item in items if item.get_closest_marker("slow")}
    items.sort(key=lambda item: item.path not in slow)
    for item in items:
        if item.get_closest_marker("apart") and not config.getoption("here"):
            item.setup, item.runtest = lambda: None, partial(in_its_own_process, item)  # type: ignore[method-assign]
    gc.freeze()  # half a million objects stay to the end: not to be looked through for garbage


def in_its_own_process(item: pytest.Item) -> None:
    """Run a test by another pytest, with nothing of it here."""
    options = ["-n0", "-q", "-rs", "-p", "no:cacheprovider", "-p", "no:randomly", "--here"]
    root = item.config.rootpath
    with tempfile.TemporaryDirectory() as folder:
        done = ended(
            "-m", "pytest", *options, f"--basetemp={folder}/pytest", f"--rootdir={root}",
            root / item.nodeid, cwd=item.config.invocation_params.dir,
        )  # fmt: skip
    words = done.stdout + done.stderr
    if done.returncode != pytest.ExitCode.OK:
        pytest.fail(f"it ends with {done.returncode}\n{words}", pytrace=False)
    if "\n1 skipped" in words:
        pytest.skip(words)


@pytest.hookimpl(wrapper=True)
def one_test_only(item: pytest.Item) -> Generator[None, Any, Any]:
    """Let an interruption fail the test that it hits. In a worker of xdist it is never the user's,
    which the process that began the workers hears."""
    try:
        return (yield)
    except KeyboardInterrupt as stray:
        if not hasattr(item.config, "workerinput"):
            raise
        raise RuntimeError("an interruption from elsewhere") from stray


pytest_runtest_setup = pytest_runtest_call = pytest_runtest_teardown = one_test_only


@pytest.fixture(autouse=True)
def close_figures() -> Iterator[None]:
    """Once some test has imported pyplot it keeps every figure, and warns of many."""
    yield
    pyplot = sys.modules.get("matplotlib.pyplot")
    if pyplot is not None:
        pyplot.close("all")


@pytest.fixture(scope="session")
def in_a() -> cb.Branch:
    """A branch with a fold, a pitchfork and a wall, to look at."""
    return cb.trace(cb.symmetric(0.5, 0.04, 0.8), "a", within={"a": (0.0, 0.99)})


@pytest.fixture(scope="session")
def diagram() -> cb.orbits.Zones:
    """The zones of the paper's figure 2 (a), to look at."""
    return cb.zones(k=0.8)


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Run a command line in an empty directory: status, standard output, standard error."""
    monkeypatch.chdir(tmp_path)

    def line(command: str) -> tuple[int, str, str]:
        status = main(shlex.split(command))
        out, err = capsys.readouterr()
        return status, out, err

    return line
