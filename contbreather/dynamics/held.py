"""Ctrl-C held back for a moment, and SIGTERM where Python hears it: while compiled code runs that
would make another error of it."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def held() -> Iterator[None]:
    """Let signals wait for the end of the block, and then do what it does.

    A signal that arrives in a function that a compiled solver calls comes out as an AttributeError
    or is lost: it passes no exceptions on that are not its own. In the middle of a loop over
    arrays, as it is, a state would be left half advanced.
    """
    if threading.current_thread() is not threading.main_thread():
        yield  # signals are the business of the main thread
        return
    came: list[int] = []
    numbers = [signal.SIGINT]
    if callable(signal.getsignal(signal.SIGTERM)):
        numbers.append(signal.SIGTERM)
    before = {n: signal.signal(n, lambda number, frame: came.append(number)) for n in numbers}
    try:
        yield
    finally:
        for number, handler in before.items():
            # None: a handler that is not Python's, which cannot be put back from here
            signal.signal(number, signal.default_int_handler if handler is None else handler)
        if came:
            signal.raise_signal(came[0])
