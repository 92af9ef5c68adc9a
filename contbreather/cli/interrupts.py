"""Ctrl-C at the command line.

Until anything is computed there is nothing to keep, and the process ends at once: an exception in
the middle of an import would come out of it as an ImportError. While something is computed Ctrl-C
is a `KeyboardInterrupt`, and the library hands over what it has. While results are written it
waits, so that nothing is half written or half said; the second one does not wait.
"""

from __future__ import annotations

import contextlib
import enum
import os
import signal
import threading
from collections.abc import Callable, Iterator
from typing import Any, TypeVar, cast

from contbreather.errors import Interrupted

STATUS = 130
T = TypeVar("T")


class Act(enum.Enum):
    """What Ctrl-C does now."""

    LEAVE = enum.auto()
    STOP = enum.auto()
    WAIT = enum.auto()


class CutShort(KeyboardInterrupt):
    """Ctrl-C, after all that was done by then has been shown."""


class _Watch:
    """Ctrl-C in this process: what it does now, and whether one waits."""

    def __init__(self) -> None:
        self.act, self.rest = Act.STOP, Act.STOP
        self.count, self.waiting = 0, False

    def begin(self, *, alone: bool) -> None:
        self.act, self.rest = Act.LEAVE if alone else Act.STOP, Act.WAIT
        self.count, self.waiting = 0, False

    def __call__(self, number: int, frame: object) -> None:
        self.count += 1
        if self.act is Act.LEAVE:
            _tell("interrupted")
            os._exit(STATUS)
        if self.act is Act.STOP or self.count > 1:
            self.waiting = False
            raise KeyboardInterrupt
        self.waiting = True
        _tell("interrupted: writing what is done; Ctrl-C once more to leave it")


_watch = _Watch()


def _tell(line: str) -> None:
    """A line on standard error from within a signal handler, where `print` may be under way."""
    with contextlib.suppress(OSError):
        os.write(2, f"contbreather: {line}\n".encode())


@contextlib.contextmanager
def watched(*, alone: bool) -> Iterator[None]:
    """Take over Ctrl-C for one command line; for good where the process has nothing else to do.

    Raises
    ------
    KeyboardInterrupt
        At the end, if one came while results were written.
    """
    if threading.current_thread() is not threading.main_thread():
        yield  # signals are the business of the main thread
        return
    _watch.begin(alone=alone)
    before = signal.signal(signal.SIGINT, _watch)
    try:
        yield
        if _watch.waiting:
            raise KeyboardInterrupt
    finally:
        signal.signal(signal.SIGINT, signal.SIG_IGN if alone else before)
        _watch.act = _watch.rest = Act.STOP


@contextlib.contextmanager
def computing() -> Iterator[None]:
    """Let Ctrl-C stop a computation; afterwards it waits for what is written."""
    if _watch.waiting:
        raise KeyboardInterrupt
    _watch.act = Act.STOP
    try:
        yield
    finally:
        _watch.act = _watch.rest


def kept(work: Callable[[], T]) -> tuple[T, bool]:
    """What a computation gives, and whether Ctrl-C has cut it short.

    Raises
    ------
    Interrupted
        If there is nothing yet.
    """
    try:
        with computing():
            return work(), False
    except Interrupted as stop:
        if stop.partial is None:
            raise
        return cast("Any", stop.partial), True


def end(cut: bool) -> None:
    """Stop, where Ctrl-C has cut short what was shown."""
    if cut:
        raise CutShort
