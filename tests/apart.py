"""Processes of their own, for what would harm the one that runs the tests: signals that come at any
time, full disks, limits, the end of an interpreter.

Nobody waits until a time is up, for a machine may be slow, but until something has happened.
"""

from __future__ import annotations

import atexit
import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any

import contbreather

HOME = Path(contbreather.__file__).parents[1]
HUNG = 600  # seconds, for what will never happen


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


# --- copies of a process that has loaded what tests load, and done nothing ------------------------

ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1"}  # a process with several is not copied well
PYTEST = ["-n0", "-q", "-p", "no:cacheprovider", "-p", "no:randomly"]


@cache
def original() -> subprocess.Popen[str]:
    """What is copied. It ends with this process."""
    environment = {**os.environ, "PYTHONPATH": str(HOME), **ONE_THREAD}
    one = subprocess.Popen(
        [sys.executable, "-P", __file__], env=environment, text=True, start_new_session=True,
        stdin=subprocess.PIPE, stdout=subprocess.PIPE,
    )  # fmt: skip
    atexit.register(one.communicate)
    return one


def copied(arguments: list[str], where: Path, said: Path) -> int:
    """How pytest ends with these arguments in a copy, which takes a tenth of the time that a fresh
    interpreter does; what it says is written there."""
    one = original()
    assert one.stdin
    assert one.stdout
    print(json.dumps([*map(str, (where, said)), *arguments]), file=one.stdin, flush=True)
    number = int(one.stdout.readline())
    late = threading.Timer(HUNG, os.killpg, (number, signal.SIGKILL))
    late.daemon = True
    late.start()
    try:
        return int(one.stdout.readline())
    except BaseException:  # an interruption: nobody listens to what it says later
        os.killpg(number, signal.SIGKILL)
        one.kill()
        original.cache_clear()
        raise
    finally:
        late.cancel()


def copy_for_each_line() -> None:
    """Say the number of each copy and how it ended."""
    import cyclopts  # noqa: F401
    import numpy as np  # noqa: F401
    import pytest

    answers = os.fdopen(os.dup(1), "w")
    nowhere = os.open(os.devnull, os.O_RDWR)
    os.dup2(nowhere, 1)
    pytest.main([*PYTEST, "--collect-only", __file__])  # no test, but their settings
    for line in sys.stdin:
        if child := os.fork():
            _, status = os.waitpid(child, 0)
            print(os.waitstatus_to_exitcode(status), file=answers, flush=True)
            continue
        os.setsid()
        print(os.getpid(), file=answers, flush=True)
        where, said, *arguments = json.loads(line)
        words = os.open(said, os.O_CREAT | os.O_WRONLY)
        for stream, other in enumerate((nowhere, words, words)):
            os.dup2(other, stream)
        os.chdir(where)
        sys.exit(pytest.main([*PYTEST, *arguments]))


if __name__ == "__main__":
    copy_for_each_line()
