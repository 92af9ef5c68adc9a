"""Many independent pieces of work: over the cores of this machine, or by an executor that is given.

Anything with the interface of `concurrent.futures.Executor` will do, that of a cluster as well.
What a piece of work comes to depends on its item alone: results are the same whoever computes.
"""

from __future__ import annotations

import math
import os
import pickle
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import partial
from itertools import chain
from multiprocessing import Pipe
from queue import SimpleQueue
from typing import Any

from .checks import whole
from .errors import (
    BadInput,
    ContbreatherError,
    NotConverged,
    add_partial_result,
    deferred,
    partial_result,
)
from .progress import Bar

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")

UNSENT = "this cannot be sent to another process: {}. With executor=1 it stays in this one"
UNKNOWN = "a fresh process does not have it: {}. With executor=1 it stays in this one"
LOST = "the workers of the executor ended before its result, and did not come back for it"
DIED = "the process that computed it ended before its result, and again when it was alone"


@dataclass(frozen=True, eq=False)
class Failed:
    """A piece of work that came to no result, in its place among the others.

    Attributes
    ----------
    item : object
        What was to be worked on.
    error : Exception
        Why it failed; ``reason`` is its sentence.
    """

    item: Any
    error: Exception

    @property
    def reason(self) -> str:
        return str(self.error)

    def __repr__(self) -> str:
        return f"<Failed {type(self.error).__name__}: {self.reason}>"


def each(
    work: Callable[[Any], Any],
    items: Iterable[Any],
    *,
    executor: Executor | int | None = None,
    progress: bool | None = None,
    unit: str,
    together: int = 8,
    ended: Callable[[Any, Any], object] | None = None,
) -> Iterator[Any]:
    """Apply a function to each of many items, in their order, as they come.

    Parameters
    ----------
    work : callable
        ``work(item)``.
    items : iterable
    executor : concurrent.futures.Executor or int, optional
        Who computes: an executor, or a number of processes, 1 for this one, at most as many as
        there are cores. All cores unless given, where there is more than a second of work.
    progress : bool, optional
        Show how many are done; by default at a terminal or in a notebook only.
    unit : str
        What the items are, in the plural.
    together : int
        At most so many are sent at a time.
    ended : callable, optional
        ``ended(item, result)`` as soon as there is one, whatever the order.

    Yields
    ------
    object
        What `work` returned, or `Failed` where it raised an error of this package, or where the
        process that computed it died twice.

    Raises
    ------
    BadInput
        Where something cannot be sent to another process.
    Interrupted
        On Ctrl-C; its ``partial`` is a tuple of the results up to there.

    Examples
    --------
    >>> from operator import neg
    >>> list(each(neg, [1, 2, 3], unit="numbers", executor=1))
    [-1, -2, -3]
    """
    if isinstance(executor, int):
        whole("executor", executor, 1)
    elif executor is not None and not hasattr(executor, "submit"):
        raise BadInput(
            f"executor = {executor!r}: a number of processes was expected, or an executor as "
            "concurrent.futures has them"
        )
    if not (callable(work) and isinstance(items, Iterable)):
        raise BadInput(f"a function and what it works on were expected, got {work!r}, {items!r}")
    queue = _Work(work, tuple(items), together)

    def shown() -> Iterator[Any]:
        reported = 0
        with Bar(progress, len(queue.items), unit) as bar, partial_result(queue.so_far):
            for _ in queue.done(executor):
                bar.advance(len(queue.results))
                if ended is not None:
                    for number in list(queue.results)[reported:]:  # in the order in which they came
                        ended(queue.items[number], queue.results[number])
                    reported = len(queue.results)
                yield from queue.next()

    return shown()  # what was given has been checked before the first is asked for


@dataclass
class _Work:
    """A function, its items, and what became of them by number; `next` yields that in order."""

    work: Callable[[Any], Any]
    items: Sequence[Any]
    together: int
    results: dict[int, Any] = field(default_factory=dict)
    passed: int = 0  # how many were yielded

    def next(self) -> Iterator[Any]:
        while self.passed in self.results:
            self.passed += 1
            yield self.results[self.passed - 1]

    def so_far(self) -> tuple[Any, ...] | None:
        whole = min(self.left, default=len(self.items))
        return tuple(self.results[number] for number in range(whole)) or None

    @property
    def left(self) -> list[int]:
        return [number for number in range(len(self.items)) if number not in self.results]

    def done(self, executor: Executor | int | None) -> Iterator[None]:
        """Work, and pause whenever there are new results."""
        cores = os.cpu_count() or 1
        if executor is None or executor == 1:
            # a second of work is worth the start of other processes
            yield from self._here(math.inf if executor == 1 or cores == 1 else 1.0)
        if executor is None or isinstance(executor, int):
            yield from self._by_processes(min(executor or cores, cores))
            return
        # once more, one by one, what was lost with its workers
        workers = getattr(executor, "_max_workers", None) or cores
        yield from self._sent(executor, self._chunks(workers))
        yield from self._sent(executor, [[number] for number in self.left])
        for number in self.left:
            self.results[number] = Failed(self.items[number], NotConverged(LOST))
        yield

    def _here(self, worth: float) -> Iterator[None]:
        """In this process, until what is left seems worth the start of others."""
        begun = time.monotonic()
        for number, item in enumerate(self.items):
            spent = time.monotonic() - begun
            # the rest is estimated from 0.2 seconds of work
            if number and spent > 0.2 and spent * (len(self.items) / number - 1) > worth:
                return
            with add_partial_result(partial(self.results.__setitem__, number)):
                self.results[number] = _attempt(self.work, item)
            yield

    def _by_processes(self, most: int) -> Iterator[None]:
        """Work in pools: where one worker dies all of its pool do. Another pool follows, after what
        was in hand has been done again, each item in a process of its own, to see whether it was
        this that ended the first."""
        while self.left:
            chunks = self._chunks(most)
            with processes(min(most, len(chunks))) as pool:
                yield from self._sent(pool, chunks, packed=True)
            # portions are handed out in order: those in hand come first
            lost = [numbers for numbers in chunks if numbers[0] not in self.results]
            for number in chain.from_iterable(lost[:most]):
                with processes(1) as pool:
                    yield from self._sent(pool, [[number]], packed=True)
                if number not in self.results:
                    self.results[number] = Failed(self.items[number], NotConverged(DIED))
                    yield

    def _sent(
        self, pool: Executor, chunks: Iterable[Sequence[int]], *, packed: bool = False
    ) -> Iterator[None]:
        """Work on portions by an executor; what is lost with its worker is left.

        A pool of processes ends with an item that its workers cannot unpack, so its items are
        `packed` by us, and then each fault is a sentence.
        """
        sent: dict[Future[Any], Sequence[int]] = {}
        ended: SimpleQueue[Future[Any]] = SimpleQueue()
        try:
            for numbers in chunks:
                call = self.work, [self.items[number] for number in numbers]
                sending = (_unpacked, _packed(*call)) if packed else (_several, *call)
                with suppress(BrokenExecutor), _unbroken():
                    future = pool.submit(*sending)
                    sent[future] = numbers
                    future.add_done_callback(ended.put)
            for _ in range(len(sent)):
                future = ended.get()
                with _losing(), _unbroken():
                    self.results.update(zip(sent[future], future.result(), strict=True))
                yield
        finally:
            for future in () if packed else sent:  # a pool that ends complains of what is cancelled
                future.cancel()

    def _chunks(self, workers: int) -> list[list[int]]:
        left, chunks = self.left, []
        while left:
            size = max(1, min(self.together, len(left) // (8 * workers)))
            chunks.append(left[:size])
            left = left[size:]
        return chunks


def _attempt(work: Callable[[Any], Any], item: Any) -> Any:
    try:
        return work(item)
    except ContbreatherError as error:
        return Failed(item, error)


def _several(work: Callable[[Any], Any], items: Sequence[Any]) -> list[Any]:
    return [_attempt(work, item) for item in items]


def _packed(*call: Any) -> bytes:
    import cloudpickle

    try:
        packed: bytes = cloudpickle.dumps(call)
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise BadInput(UNSENT.format(error)) from error
    return packed


def _unpacked(packed: bytes) -> list[Any]:
    try:
        work, items = pickle.loads(packed)
    except (ImportError, AttributeError) as error:
        raise BadInput(UNKNOWN.format(error)) from error
    return _several(work, items)


# Signals are deferred while a future is locked: what they raise would leave it locked, and its pool
# would never end. So waiting is done by a queue, and all else that is asked of futures waits.
_unbroken = partial(deferred, signal.SIGINT, signal.SIGTERM)


@contextmanager
def _losing() -> Iterator[None]:
    """Leave what was lost with its worker for another time; a cluster has an error of its own."""
    try:
        yield
    except (BrokenExecutor, CancelledError):
        pass
    except Exception as error:
        if type(error).__name__ == "KilledWorker":
            return
        if "pickle" in str(error) and not isinstance(error, ContbreatherError):
            raise BadInput(UNSENT.format(error)) from error
        raise


# --- processes ------------------------------------------------------------------------------------


@contextmanager
def processes(most: int) -> Iterator[Executor]:
    """Fresh processes, each with one thread, that end at once with the block, or with this process.

    Those of loky are sent what a script, a notebook or a prompt has defined, lambdas too, and do
    not read the script. The end of a pipe tells them to leave, in the middle of what they do, when
    this process is killed. SIGTERM ends the block, too: left to the system it would end this
    process alone, and its semaphores would be for others to clean up, who complain.
    """
    from loky import ProcessPoolExecutor

    ended, ending = Pipe(duplex=False)
    with _leaving_in_order():
        pool = ProcessPoolExecutor(
            most, initializer=_begin, initargs=(ended,), env=dict.fromkeys(THREADS, "1")
        )
        try:
            with suppress(BrokenExecutor), _begun_quietly():
                pool.submit(os.getpid)  # all of them start with the first that is wanted
            yield pool
        finally:
            with _unbroken():
                ending.close()
                pool.shutdown(kill_workers=True)


@contextmanager
def _leaving_in_order() -> Iterator[None]:
    """Within, SIGTERM is an exit with its usual status, unless it has another meaning already."""
    ours = threading.current_thread() is threading.main_thread()
    ours = ours and signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
    if ours:
        signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(128 + number))
    try:
        yield
    finally:
        if ours:
            signal.signal(signal.SIGTERM, signal.SIG_DFL)


@contextmanager
def _begun_quietly() -> Iterator[None]:
    """Leave Ctrl-C, which reaches all processes of a terminal, to the one that waits for what is
    started within; nothing is half started when a signal comes."""
    masking = getattr(signal, "pthread_sigmask", None)  # not on Windows
    # the mask is for what is started; here another thread, as BLAS has, may still hear of them
    mask = masking and masking(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM})
    try:
        with _unbroken():
            yield
    finally:
        if masking:
            masking(signal.SIG_SETMASK, mask)


def _begin(ended: Any) -> None:
    """In a worker: leave when the other end of the pipe is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(signal, "pthread_sigmask"):  # a pool ends its workers by SIGTERM
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGTERM})

    def leave() -> None:
        ended.poll(None)
        os._exit(1)

    threading.Thread(target=leave, daemon=True).start()
