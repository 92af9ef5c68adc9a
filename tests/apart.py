"""Processes of their own, for what would harm the one that runs the tests: signals that come at any
time, full disks, limits, the end of an interpreter.

Nobody waits until a time is up, for a machine may be slow, but until something has happened.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import contbreather

HOME = Path(contbreather.__file__).parents[1]
HUNG = 600  # seconds, for what will never happen
ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1"}


@contextmanager
def begun(
    *arguments: str | Path, hung: float = HUNG, **options: Any
) -> Iterator[subprocess.Popen[str]]:
    """A fresh interpreter with these arguments, in a session of its own: it and what it began end
    with the block, and do so after a long time within it."""
    environment = {**os.environ, "PYTHONPATH": str(HOME), **options.pop("env", {})}
    settings = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, **options}
    with subprocess.Popen(
        [sys.executable, *map(str, arguments)], env=environment, start_new_session=True, **settings
    ) as child:

        def end() -> None:
            if child.returncode is None:
                os.killpg(child.pid, signal.SIGKILL)

        late = threading.Timer(hung, end)
        late.daemon = True
        late.start()
        try:
            yield child
        finally:
            late.cancel()
            end()


def ended(
    *arguments: str | Path, given: str | None = None, **options: Any
) -> subprocess.CompletedProcess[str]:
    """What a fresh interpreter with these arguments, and this to read, comes to."""
    stdin = subprocess.DEVNULL if given is None else subprocess.PIPE
    with begun(*arguments, stdin=stdin, **options) as child:
        out, err = child.communicate(given)
    return subprocess.CompletedProcess(child.args, child.returncode, out, err)


def until(happened: Callable[[], object]) -> None:
    """Wait for something."""
    since = time.monotonic()
    while not happened():
        assert time.monotonic() - since < HUNG
        time.sleep(0.01)


def workers_of(number: int) -> dict[int, float]:
    """The processes that compute for this one, and for how many seconds they have."""
    found = {}
    for folder in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):  # it has ended meanwhile
            numbers = (folder / "stat").read_text().rpartition(")")[2].split()
            if int(numbers[1]) == number and "popen_loky" in (folder / "cmdline").read_text():
                found[int(folder.name)] = int(numbers[11]) / os.sysconf("SC_CLK_TCK")
    return found
