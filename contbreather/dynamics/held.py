"""Ctrl-C held back for a moment: while compiled code runs that would make another error of it."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def held() -> Iterator[None]:
    """Let Ctrl-C wait for the end of the block, and then do what it does.

    A signal that arrives in a function that a compiled solver calls comes out as an AttributeError
    or is lost: it passes no exceptions on that are not its own. In the middle of a loop over
    arrays, as it is, a state would be left half advanced.
    """
    if threading.current_thread() is not threading.main_thread():
        yield  # signals are the business of the main thread
        return
    came: list[int] = []
    before = signal.signal(signal.SIGINT, lambda number, frame: came.append(number))
    try:
        yield
    finally:
        # None: a handler that is not Python's, which cannot be put back from here
        signal.signal(signal.SIGINT, signal.default_int_handler if before is None else before)
        if came:
            signal.raise_signal(signal.SIGINT)
