"""What a process finds around it: standard streams and environment, made fit for use."""

from __future__ import annotations

import contextlib
import errno
import io
import logging
import os
import sys
from collections.abc import Iterator
from typing import Any

COLUMNS = range(20, 10_000)  # with fewer or more the layout of tables and help breaks down


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
