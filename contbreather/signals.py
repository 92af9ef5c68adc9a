"""Signals that wait until what must not be cut in two is over."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def deferred(*signals: signal.Signals) -> Iterator[None]:
    """Let these wait for the end of the block, and then do what they do; Ctrl-C unless named.

    In a function that a compiled solver calls an exception out of a signal becomes an
    AttributeError or is lost, in the middle of a loop over arrays a state is left half advanced,
    and of a process that is being started half of what it is to read is sent.
    """
    if threading.current_thread() is not threading.main_thread():
        yield  # signals are the business of the main thread
        return
    came: list[int] = []
    wanted = signals or (signal.SIGINT,)
    before = {s: signal.signal(s, lambda number, frame: came.append(number)) for s in wanted}
    try:
        yield
    finally:
        for waiting, handler in before.items():
            # None: a handler that is not Python's, which cannot be put back from here
            usual = signal.default_int_handler if waiting is signal.SIGINT else signal.SIG_DFL
            signal.signal(waiting, usual if handler is None else handler)
        for number in dict.fromkeys(came):
            signal.raise_signal(number)
