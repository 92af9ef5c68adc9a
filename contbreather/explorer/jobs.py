"""What the buttons do, each a computation with the line of the script that does the same, and the
thread that does it: it says how far it is, and can be stopped.

The library asks whatever shows its progress after every point and every few periods, so a stop is
an exception from there, the same as that of Ctrl-C, and what is done by then is kept in the same
way.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from contbreather.checks import number
from contbreather.continuation.branches.boundary import boundary
from contbreather.continuation.branches.switching import switch
from contbreather.continuation.curve.point import Point
from contbreather.continuation.walk.trace import trace
from contbreather.errors import BadInput, ContbreatherError, Interrupted
from contbreather.explorer.state import Chosen, small, watched
from contbreather.lattice.chain import Ring
from contbreather.lattice.parse import as_code, lattice_by, walls_by
from contbreather.orbits.orbit import Orbit
from contbreather.parameters import NEEDED
from contbreather.progress import INTERVAL, Counter
from contbreather.simulation.classify import judge
from contbreather.simulation.integrator import RunStop, Sample
from contbreather.simulation.simulate import SimulationRun, simulate

Say = Callable[[str], object]
Window = tuple[float, float]
MOMENTS = 32  # in a period, at which a simulation is seen
JUDGED = 300  # sites at most of a run that is judged


class Progress(Counter):
    """Counter that tells `say` how far work is, by points of a walk or periods of a run; a stop
    ends it there."""

    def __init__(self, say: Say) -> None:
        super().__init__(True)
        self.say, self.stop, self.after = say, threading.Event(), 0.0

    def advance(self, done: Any, count: int = 1) -> None:
        """Count points, say how many periods are done, or stop the work."""
        if self.stop.is_set():
            raise KeyboardInterrupt
        if isinstance(done, Point):
            super().advance(done, count)
        else:
            self.show(f"{done} of {self.total} {self.unit}")

    def show(self, text: str, done: int | None = None) -> None:
        """Say it, unless something was said a moment ago."""
        if self.due:
            self.after = time.monotonic() + INTERVAL
            self.say(text)


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
        return self._now is not None or self._next is not None

    @property
    def waiting(self) -> bool:
        return self._next is not None

    def begin(self, job: Job, *, say: Say, done: Done) -> None:
        with self._turn:
            self._next = (job, Progress(say), done)
            if self._thread is None:
                self._thread = threading.Thread(target=self._work, daemon=True, name="explorer")
                self._thread.start()
            self._turn.notify_all()

    def stop(self) -> None:
        """End the job that runs, which hands over what is done, and the one that waits, of which
        nothing is."""
        with self._turn:
            waited, self._next = self._next, None
            if self._now is not None:
                self._now.stop.set()
        if waited is not None:
            _, _, done = waited
            done(None, True, "")

    def join(self, timeout: float | None = None) -> bool:
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
    """Run a job: its result, whether it is a piece only, and why there is none."""
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
    return value, isinstance(value, SimulationRun) and value.stop is RunStop.INTERRUPTED, ""


# --- what is computed -----------------------------------------------------------------------------


@dataclass(frozen=True)
class Computation:
    title: str  # what is under way, for people
    name: str  # of its result in the script, without its number
    code: str  # the expression that gives it
    job: Job
    setup: tuple[str, ...] = ()  # lines of the script that come before
    outcome: Callable[[Any], str] = lambda _: ""  # what became of it, in words


@dataclass(frozen=True)
class OnLattice:
    """Lattice, and how the script makes it."""

    lattice: Any
    code: str

    @classmethod
    def typed(cls, text: str) -> OnLattice:
        """Read a lattice as at the command line, or the size of a ring."""
        text = f"ring:{text}" if text.isdecimal() else text
        return cls(small(lattice_by(text or None, option="lattice")), as_code(text) if text else "")


def arguments(on: OnLattice, **values: Any) -> tuple[dict[str, Any], str]:
    """Translate typed values into arguments and code: walls as at the command line; None, and empty
    text, for what was not given."""
    given = {name: value for name, value in values.items() if value not in (None, "")}
    params = {**{name: values[name] for name in NEEDED if name in values}, **given}
    codes = {name: repr(value) for name, value in params.items() if (name, value) != ("site", 0)}
    if on.code:
        params["lattice"], codes["lattice"] = on.lattice, on.code
    if "walls" in params:
        params["walls"] = walls_by(params["walls"].split(), on.lattice.sites)
        codes["walls"] = repr(params["walls"])
    return params, ", ".join(f"{name}={code}" for name, code in codes.items())


def _called(
    title: str, name: str, function: Callable[..., Any], start: Any, code: str, *given: Any,
    **more: Any,
) -> Computation:  # fmt: skip
    """Call a function of the library, with the code of what it starts from."""
    words = [code, *map(repr, given), *(f"{name}={value!r}" for name, value in more.items())]
    return Computation(
        title, name, f"cb.{function.__name__}({', '.join(words)})",
        lambda progress: function(start, *given, **more, progress=progress),
    )  # fmt: skip


def traced(chosen: Chosen, free: str, window: Window) -> Computation:
    start = chosen.orbit if chosen.point is None else chosen.point
    within = {free: window}
    return _called(f"branch in {free}", "branch", trace, start, chosen.code, free, within=within)


def switched(chosen: Chosen) -> Computation:
    point = _special(chosen, "to switch at")
    return _called(f"arms of {point.label}", "arms", switch, point, chosen.code)


def bounded(chosen: Chosen, pair: tuple[str, str], within: Mapping[str, Window]) -> Computation:
    point, code = _special(chosen, "to trace"), chosen.code
    windows = {name: within[name] for name in pair if name in within}
    return _called(
        f"boundary of {point.label}", "line", boundary, point, code, pair, within=windows
    )


def _special(chosen: Chosen, what: str) -> Any:
    if chosen.point is None or not chosen.point.kind:
        raise BadInput(
            f"no special point {what}: choose one of the labelled points of a curve first."
        )
    return chosen.point


def simulated(
    chosen: Chosen, sites: int, periods: int, push: float, sampled: tuple[int, ...]
) -> Computation:
    """Simulate the lattice from its state, with a push to the site that impacts."""
    if chosen.orbit is None:
        raise BadInput("nothing to simulate: choose a breather or a point of its branch first.")
    push = number("push", push, -math.inf, math.inf, "a change of velocity")
    infinite = chosen.orbit.lattice.sites is None
    orbit = chosen.orbit.on(small(Ring(sites))) if infinite else chosen.orbit
    site, sample = orbit.section.hit[0], Sample(watched(orbit, sampled), MOMENTS)

    def job(progress: Progress) -> Any:
        u, v = (np.array(x) for x in orbit.state())
        v[site] += push
        progress.total = periods
        how: dict[str, Any] = {"periods": periods, "sample": sample, "progress": progress}
        return simulate((u, v), **vars(orbit.conditions), **how)

    setup = (
        f"orbit = {chosen.code}" + f".on(cb.Ring({sites}))" * infinite,
        "u, v = (one.copy() for one in orbit.state())",
        f"v[{site}] += {push!r}",
        f"sample = cb.simulation.Sample({sample.sites}, {MOMENTS})",
    )
    code = f"cb.simulate((u, v), **vars(orbit.conditions), periods={periods}, sample=sample)"
    return Computation(
        f"{periods} periods on the {orbit.lattice.describe()}", "run", code, job, setup,
        lambda run: outcome(run, orbit),
    )  # fmt: skip


def outcome(run: SimulationRun, orbit: Orbit) -> str:
    """Say how far a run ends from the orbit that it was pushed off, and the verdict on it where
    that takes no minutes, else how it stopped."""
    away = float(np.abs(run.final.u - orbit.state(t=run.end)[0]).max())
    said = f"in the end {away:.2g} from the breather"
    if run.stop is RunStop.DONE and run.sites <= JUDGED:
        with suppress(BadInput):  # of too few periods
            return f"{said}; {judge(run).kind.value}"
    return said if run.stop is RunStop.DONE else f"{said}; {run.stop.value}"
