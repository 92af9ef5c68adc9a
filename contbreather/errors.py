"""Errors of contbreather: sentences that say what was given, what is expected, what to do; and
interruptions, with what is done by then, or put off until what must not be cut in two is over."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any


class ContbreatherError(Exception):
    """Root of every error raised on purpose by contbreather."""


class BadInput(ContbreatherError, ValueError):
    """Nothing can be done with what was given; the command line ends with status 2."""


class NoSolution(BadInput):
    """The question is well posed but has no answer, for instance a forcing below the fold."""


class NotConverged(ContbreatherError, RuntimeError):
    """The numerics failed; the command line ends with status 1.

    `residual` is how far they got, `iterations` how many that took and `last` what they ended at,
    None where that is not known.
    """

    def __init__(
        self,
        message: str,
        *,
        residual: float = float("nan"),
        iterations: int | None = None,
        last: object = None,
    ) -> None:
        super().__init__(message)
        self.residual = residual
        self.iterations = iterations
        self.last = last


class Interrupted(KeyboardInterrupt):
    """Ctrl-C, with what was done by then; the command line ends with status 130.

    It is a `KeyboardInterrupt`, so that it ends a loop around the call as well. `partial` is what
    the outermost call of this package would have returned, as far as it got and marked as cut
    short; None if there is nothing yet. (`asyncio.IncompleteReadError.partial` is the model.)
    """

    def __init__(self, message: str = "", *, partial: object = None) -> None:
        state = (
            "nothing is done yet" if partial is None else f".partial is what was done: {partial!r}"
        )
        super().__init__(message or f"interrupted; {state}")
        self.partial = partial


@contextmanager
def partial_result(partial: Callable[[], object] = lambda: None) -> Iterator[None]:
    """Make of any interruption of a block one that carries what the call around it has by then.

    Interruptions of inner calls are `KeyboardInterrupt`, too: what a caller gets is never the piece
    of a piece.

    Examples
    --------
    >>> done = [1, 2]
    >>> try:
    ...     with partial_result(lambda: tuple(done)):
    ...         raise KeyboardInterrupt
    ... except Interrupted as stop:
    ...     stop.partial
    (1, 2)
    """
    try:
        yield
    except KeyboardInterrupt:
        raise Interrupted(partial=partial()) from None


@contextmanager
def add_partial_result(add: Callable[[Any], object]) -> Iterator[None]:
    """Add what an interrupted inner call has by then to what the call around it has."""
    try:
        yield
    except Interrupted as stop:
        if stop.partial is not None:
            add(stop.partial)
        raise


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
