"""What a process finds around it: standard streams and environment, made fit for use, and Ctrl-C.

Until anything is computed there is nothing to keep, and the process ends at once. While something
is computed Ctrl-C is a `KeyboardInterrupt`, and the library hands over what it has. While results
are written it waits, so that nothing is half written or half said; the second one does not wait.
An import and a compilation are not interrupted, for the exception would come out as another one or
be lost: Ctrl-C is heard again when they are over, or the process ends where that takes seconds.
"""

from __future__ import annotations

import contextlib
import enum
import errno
import io
import logging
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from types import FrameType
from typing import Any, ParamSpec, TypeVar, cast

from contbreather.errors import Interrupted

STATUS = 130
PAUSE, PATIENCE = 0.01, 300  # seconds, and how often what may not be interrupted is looked at again
COLUMNS = range(20, 10_000)  # with fewer or more the layout of tables and help breaks down
T = TypeVar("T")
P = ParamSpec("P")


class Act(enum.Enum):
    """What Ctrl-C does now."""

    LEAVE = enum.auto()
    STOP = enum.auto()
    WAIT = enum.auto()


class CutShort(KeyboardInterrupt):
    """Ctrl-C, after all that was done by then has been shown."""


class _Interrupts:
    """Ctrl-C in this process: what it does now, and whether one waits."""

    def __init__(self) -> None:
        self.act, self.rest = Act.STOP, Act.STOP
        self.count, self.waiting = 0, False
        self.outside: int | None = None
        self.patience = PATIENCE

    def begin(self, *, alone: bool) -> None:
        self.act, self.rest = Act.LEAVE if alone else Act.STOP, Act.WAIT
        self.count, self.waiting, self.patience = 0, False, PATIENCE
        # a clock of its own only where the process is: others may use the alarm
        self.outside = _deaf(sys._getframe()) if alone and hasattr(signal, "SIGALRM") else None

    def __call__(self, number: int, frame: FrameType | None) -> None:
        self.count += 1
        if self.act is Act.WAIT and self.count == 1:
            self.waiting = True
            _tell("interrupted: writing what is done; Ctrl-C once more to leave it")
            return
        deaf = self.outside is not None and _deaf(frame) > self.outside
        if self.act is Act.LEAVE or (deaf and self.patience == 0):
            _tell("interrupted")
            os._exit(STATUS)
        self.waiting = deaf
        if not deaf:
            raise KeyboardInterrupt
        self.patience -= 1
        signal.signal(signal.SIGALRM, self.again)
        signal.setitimer(signal.ITIMER_REAL, PAUSE)

    def again(self, number: int, frame: FrameType | None) -> None:
        """The same Ctrl-C once more, for whoever listens to it by now."""
        self.count -= 1
        signal.raise_signal(signal.SIGINT)


_interrupts = _Interrupts()


def _deaf(frame: FrameType | None) -> int:
    """How many frames, in and above this one, make another exception of it, or none."""
    count = 0
    while frame is not None:
        count += frame.f_code.co_filename.startswith("<frozen importlib")
        count += str(frame.f_globals.get("__name__")).startswith(("numba.", "llvmlite."))
        frame = frame.f_back
    return count


def _tell(line: str) -> None:
    """A line on standard error from within a signal handler, where `print` may be under way."""
    with contextlib.suppress(OSError):
        os.write(2, f"contbreather: {line}\n".encode())


@contextlib.contextmanager
def interruptible(*, alone: bool) -> Iterator[None]:
    """Take over Ctrl-C for one command line; for good where the process has nothing else to do.

    Raises
    ------
    KeyboardInterrupt
        At the end, if one came while results were written.
    """
    if threading.current_thread() is not threading.main_thread():
        yield  # signals are the business of the main thread
        return
    _interrupts.begin(alone=alone)
    before = signal.signal(signal.SIGINT, _interrupts)
    try:
        yield
        if _interrupts.waiting:
            raise KeyboardInterrupt
    finally:
        signal.signal(signal.SIGINT, signal.SIG_IGN if alone else before)
        if _interrupts.outside is not None:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
        _interrupts.act = _interrupts.rest = Act.STOP


@contextlib.contextmanager
def computing() -> Iterator[None]:
    """Let Ctrl-C stop a computation; afterwards it waits for what is written."""
    if _interrupts.waiting:
        raise KeyboardInterrupt
    _interrupts.act = Act.STOP
    try:
        yield
    finally:
        _interrupts.act = _interrupts.rest


def until_interrupted(work: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> tuple[T, bool]:
    """What a computation gives, and whether Ctrl-C has cut it short.

    Raises
    ------
    Interrupted
        If there is nothing yet.
    """
    try:
        with computing():
            return work(*args, **kwargs), False
    except Interrupted as stop:
        if stop.partial is None:
            raise
        return cast("Any", stop.partial), True


def end(cut: bool) -> None:
    """Stop, where Ctrl-C has cut short what was shown."""
    if cut:
        raise CutShort


# --- streams --------------------------------------------------------------------------------------


class _Closed(io.TextIOBase):
    """Standard output where there is none: whoever writes to it hears so."""

    def write(self, text: str, /) -> int:
        raise OSError(errno.EBADF, "it is closed")


def prepare() -> None:
    """Streams that exist and take any letter, a width that can be laid out, a backend that is."""
    closed: Any = _Closed()
    sys.stdout = sys.stdout or closed
    sys.stderr = sys.stderr or open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")
    width = os.environ.get("COLUMNS", "")
    if width.isdecimal() and int(width) not in COLUMNS:
        del os.environ["COLUMNS"]
    os.environ["MPLBACKEND"] = "agg"  # figures go into files only


@contextlib.contextmanager
def heard(aloud: bool) -> Iterator[None]:
    """What the library logs goes to standard error, if it is wanted."""
    logger, handler = logging.getLogger("contbreather"), logging.StreamHandler()
    before = logger.level
    if aloud:
        logger.setLevel(logging.DEBUG)
        logger.addHandler(handler)
    try:
        yield
    finally:
        logger.setLevel(before)
        logger.removeHandler(handler)


def abandon(stream: Any) -> None:
    """Let what is still to be written to a stream that fails go nowhere, at the end of Python."""
    with contextlib.suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def trouble(error: OSError) -> str:
    """What the system has to say, as a sentence; files have names, standard output has none."""
    if isinstance(error, FileNotFoundError) and error.filename is None:  # os.getcwd() says so
        return "the current directory is gone; change to one that exists"
    reason = error.strerror or str(error) or type(error).__name__
    if error.filename is None:
        return f"cannot write to standard output: {reason}"
    return f"the system refuses {os.fspath(error.filename)!r}: {reason}"
