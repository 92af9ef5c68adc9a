"""Long work in a thread of its own: it says how far it is, and can be stopped.

The library asks whatever shows its progress after every point and every few periods, so a stop is
an exception from there, the same as that of Ctrl-C, and what is done by then is kept in the same
way.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

from contbreather.continuation import Point
from contbreather.errors import ContbreatherError, Interrupted
from contbreather.progress import INTERVAL, Bar, Counter
from contbreather.simulation import Run, RunStop

Say = Callable[[str], object]


class Counted(Counter):
    """Points of a walk, counted for `say`; a stop ends the walk."""

    def __init__(self, say: Say, stop: threading.Event) -> None:
        super().__init__(True, "")
        self.say, self.stop, self.after = say, stop, 0.0

    def advance(self, point: Point, count: int = 1) -> None:
        """Count points, or stop the walk."""
        if self.stop.is_set():
            raise KeyboardInterrupt
        self.free = point.curve.free[0]
        super().advance(point, count)

    def show(self, text: str, done: int | None = None) -> None:
        """Say it, unless something was said a moment ago."""
        if self.due:
            self.after = time.monotonic() + INTERVAL
            self.say(text)


class Periods(Bar):
    """Periods of a simulation, counted for `say`; a stop ends the run."""

    def __init__(self, say: Say, stop: threading.Event, total: int) -> None:
        super().__init__(True, total)
        self.say, self.stop, self.after = say, stop, 0.0

    def advance(self, done: int) -> None:
        """Say how many are done, unless that was said a moment ago, or stop the run."""
        if self.stop.is_set():
            raise KeyboardInterrupt
        if self.due:
            self.after = time.monotonic() + INTERVAL
            self.say(f"{done} of {self.total} {self.unit}")


class Progress:
    """What work gets to say how far it is."""

    def __init__(self, say: Say) -> None:
        self.say, self.stop = say, threading.Event()

    def points(self) -> Counted:
        """For walks: `trace`, `switch`, `boundary`, `zones`."""
        return Counted(self.say, self.stop)

    def periods(self, total: int) -> Periods:
        """For `simulate`."""
        return Periods(self.say, self.stop, total)


Job = Callable[[Progress], Any]
Done = Callable[[Any, bool, str], object]  # the result, whether it was cut short, what went wrong


class JobThread:
    """One thread that does one job at a time.

    Of jobs that come while it is busy the last one waits, and only that: a slider that moves asks
    for many diagrams, and the last one counts.
    """

    def __init__(self) -> None:
        self._turn = threading.Condition()
        self._next: tuple[Job, Progress, Done] | None = None
        self._now: Progress | None = None
        self._thread: threading.Thread | None = None

    @property
    def busy(self) -> bool:
        """Whether a job runs or waits."""
        return self._now is not None or self._next is not None

    @property
    def waiting(self) -> bool:
        """Whether a job waits for the one that runs."""
        return self._next is not None

    def begin(self, job: Job, *, say: Say, done: Done) -> None:
        """Do a job as soon as the one before has ended."""
        with self._turn:
            self._next = (job, Progress(say), done)
            if self._thread is None:
                self._thread = threading.Thread(target=self._work, daemon=True, name="explorer")
                self._thread.start()
            self._turn.notify_all()

    def stop(self) -> None:
        """End what runs, and forget what waits; what is done by then is handed over."""
        with self._turn:
            self._next = None
            if self._now is not None:
                self._now.stop.set()

    def join(self, timeout: float | None = None) -> bool:
        """Wait until nothing is left to do; whether that came in time."""
        with self._turn:
            return self._turn.wait_for(lambda: not self.busy, timeout)

    def _work(self) -> None:
        while True:
            with self._turn:
                self._turn.wait_for(lambda: self._next is not None)
                assert self._next is not None
                (job, progress, done), self._next = self._next, None
                self._now = progress
            try:
                done(*_result(job, progress))
            finally:
                with self._turn:
                    self._now = None
                    self._turn.notify_all()


def _result(job: Job, progress: Progress) -> tuple[Any, bool, str]:
    """What a job gives, whether it is a piece only, and why there is nothing."""
    try:
        value = job(progress)
    except Interrupted as stop:
        return stop.partial, True, ""
    except KeyboardInterrupt:
        return None, True, ""
    except ContbreatherError as error:
        return None, False, str(error)
    except Exception as error:  # noqa: BLE001
        # Whatever it is, it is said on the page: the thread is the only one, and if it ended here
        # every button would wait for it for ever.
        return None, False, f"an error of the program: {type(error).__name__}: {error}"
    return value, isinstance(value, Run) and value.stop is RunStop.INTERRUPTED, ""
