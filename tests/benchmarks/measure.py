"""What a row of the table is, and how its time is taken."""

from __future__ import annotations

import os
import subprocess
import sys
import time
import timeit
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]


@dataclass(frozen=True)
class Row:
    """One line: what was measured, beside what, and whether the aim is met.

    `ratio` is given where the aim is a ratio (or the comparison one of time); `met` is None
    where there is no aim. `note` carries the evidence that both sides computed the same thing.
    """

    what: str
    figure: str
    compares_with: str
    ratio: float | None = None
    aim: str = ""
    met: bool | None = None
    note: str = ""


class Absent(Exception):
    """What a row needs is not on this machine; the sentence says what."""


def best_of(
    run: Callable[[], Any], repeat: int = 3, clock: Callable[[], float] = time.perf_counter
) -> float:
    """Shortest time of `run` in seconds: on a shared machine the least disturbed one.

    Where one side takes a thousand times as long as the other it is disturbed more often; give
    both the processor's own time, `time.process_time`, if neither has threads or waits.
    """
    return min(timeit.repeat(run, "gc.enable()", clock, repeat, 1))


def within(what: str, seconds: float, aim: float, note: str = "") -> Row:
    """A time that is promised by itself."""
    return Row(what, span(seconds), "-", aim=f"≤ {span(aim)}", met=seconds <= aim, note=note)


def faster(what: str, ours: float, named: str, theirs: float, aim: float, note: str = "") -> Row:
    """A time that is to be so many times shorter than that of another road."""
    ratio = theirs / ours
    wanted = f"≥ {aim:g} times faster"
    return Row(what, span(ours), f"{named}: {span(theirs)}", ratio, wanted, ratio >= aim, note)


def walked(what: str, walk: Callable[[], Any], aim: float) -> Row:
    """Processor time that a point of a branch takes, and the special points of the branch."""
    branch = walk()
    seconds = best_of(walk, clock=time.process_time) / len(branch)
    labels = ", ".join(f"{point.label} at a = {point['a']:.9f}" for point in branch.special)
    return within(f"{what}, a point of {len(branch)}", seconds, aim, labels)


def each(run: Callable[[Any], Any], fresh: Iterable[Any]) -> float:
    """Seconds a call, over items none of which has been seen before: no cache can help.

    The median: one interruption by another process is not the program's time.
    """
    times = []
    for item in fresh:
        start = time.perf_counter()
        run(item)
        times.append(time.perf_counter() - start)
    return sorted(times)[len(times) // 2]


def process(
    command: Sequence[str | Path], *, cwd: Path = ROOT, env: dict[str, str] | None = None
) -> tuple[float, str]:
    """Wall time and standard output of a whole process; Absent if it cannot be run."""
    # compiled files are written, as they are where a package is installed (empty: unset)
    full = {**os.environ, "PYTHONDONTWRITEBYTECODE": "", **(env or {})}
    start = time.perf_counter()
    try:
        run = subprocess.run(
            [str(part) for part in command],
            cwd=cwd,
            env=full,
            capture_output=True,
            text=True,
            stdin=subprocess.DEVNULL,
            check=False,
        )
    except FileNotFoundError as error:
        raise Absent(f"{command[0]} is not installed") from error
    seconds = time.perf_counter() - start
    if run.returncode:
        last = (run.stderr.strip() or run.stdout.strip() or "no output").splitlines()[-1]
        raise Absent(f"{Path(command[0]).name} ended with status {run.returncode}: {last}")
    return seconds, run.stdout


def python(code: str, *, executable: str = sys.executable, **settings: Any) -> tuple[float, str]:
    """`process` for a few lines of Python with this source tree on its path."""
    env = {"PYTHONPATH": str(ROOT), **settings.pop("env", {})}
    return process([executable, "-c", code], env=env, **settings)


def micro(seconds: float) -> str:
    return f"{seconds * 1e6:.3g} µs"


def span(seconds: float) -> str:
    """Seconds in the unit that suits them."""
    if seconds < 1e-3:
        return micro(seconds)
    return f"{seconds * 1e3:.3g} ms" if seconds < 1 else f"{seconds:.3g} s"
