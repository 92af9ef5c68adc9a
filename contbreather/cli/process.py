"""Surroundings of a process: standard streams and environment, made fit for use, and Ctrl-C.

Until anything is computed there is nothing to keep, and the process ends at once. While something
is computed Ctrl-C is a `KeyboardInterrupt`, and the library hands over what it has. While results
are written the first one waits, so that nothing is half written or half said; the second does not.
An import may make another exception of it, or none: then the command ends by it all the same.
"""

from __future__ import annotations

import contextlib
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

COLUMNS = range(20, 10_000)  # with fewer or more the layout of tables and help breaks down
T = TypeVar("T")
P = ParamSpec("P")


class CutShort(KeyboardInterrupt):
    """Ctrl-C, after all that was done by then has been shown."""


class _Interrupts:
    """Handlers of Ctrl-C, and what came of it in this command line."""

    ours = False  # whether it is for us to handle: in the main thread, within `interruptible`
    came = False
    waiting = False  # one came while results were written

    def stop(self, number: int, frame: FrameType | None) -> None:
        self.came = True
        raise KeyboardInterrupt

    def wait(self, number: int, frame: FrameType | None) -> None:
        if self.came:
            raise KeyboardInterrupt
        self.came = self.waiting = True
        line = b"contbreather: interrupted: writing what is done; Ctrl-C once more to leave it\n"
        with contextlib.suppress(OSError):  # `print` may be under way
            os.write(2, line)


_interrupts = _Interrupts()


@contextlib.contextmanager
def interruptible(*, alone: bool) -> Iterator[None]:
    """Take over Ctrl-C for one command line; for good where the process has nothing else to do. One
    that came and has stopped nothing is raised at the end."""
    if threading.current_thread() is not threading.main_thread():
        yield  # signals are the business of the main thread
        return
    _interrupts.ours, _interrupts.came, _interrupts.waiting = True, False, False
    before = signal.getsignal(signal.SIGINT)
    if not alone:  # else what came before this leaves the process until something is computed
        signal.signal(signal.SIGINT, _interrupts.stop)
    try:
        yield
        if _interrupts.came:  # it waited, or somebody else's code has lost it
            raise KeyboardInterrupt
    except (ImportError, AttributeError, SystemError) as error:
        if _interrupts.came:  # what imports and machine code make of any exception
            raise KeyboardInterrupt from error
        raise
    finally:
        signal.signal(signal.SIGINT, signal.SIG_IGN if alone else before)
        _interrupts.ours = False


@contextlib.contextmanager
def computing() -> Iterator[None]:
    """Let Ctrl-C stop a computation; afterwards it waits for what is written."""
    if _interrupts.waiting:
        raise KeyboardInterrupt
    if _interrupts.ours:
        signal.signal(signal.SIGINT, _interrupts.stop)
    try:
        yield
    finally:
        if _interrupts.ours:
            signal.signal(signal.SIGINT, _interrupts.wait)


def until_interrupted(work: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> tuple[T, bool]:
    """Compute, and tell whether Ctrl-C has cut it short; raise `Interrupted` if there is nothing
    yet."""
    try:
        with computing():
            return work(*args, **kwargs), False
    except Interrupted as stop:
        if stop.partial is None:
            raise
        return cast("Any", stop.partial), True


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
    """Let the log of the library go to standard error, if it is wanted."""
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
    """Say what the system refuses, in a sentence; files have names, standard output has none."""
    if isinstance(error, FileNotFoundError) and error.filename is None:  # os.getcwd() says so
        return "the current directory is gone; change to one that exists"
    reason = error.strerror or str(error) or type(error).__name__
    if error.filename is None:
        return f"cannot write to standard output: {reason}"
    return f"the system refuses {os.fspath(error.filename)!r}: {reason}"
