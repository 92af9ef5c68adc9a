"""Progress of long calls: shown at a terminal or in a notebook after a moment, otherwise silent, or
a line now and then where that was asked for."""

from __future__ import annotations

import os
import sys
import threading
import time
from html import escape
from importlib import import_module
from typing import Any, Self

from .checks import flag

PATIENCE = 1.0  # seconds before anything is shown
INTERVAL = 0.1  # seconds between two drawings
SELDOM = 20.0  # seconds between two lines of a log, which is kept
ASKED = "CONTBREATHER_PROGRESS"  # in the environment; 1: also where nobody looks on, into a log


def in_notebook() -> bool:
    """Tell whether this runs in a kernel, whose output is a page rather than a terminal."""
    ipython = sys.modules.get("IPython")
    return ipython is not None and hasattr(ipython.get_ipython(), "kernel")


class _Terminal:
    """A line at the terminal, with a bar where the total is known."""

    def __init__(self, total: int | None, unit: str) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeRemainingColumn

        console = Console(stderr=True)
        if total is None:
            self.line: Any = console.status("")
        else:
            columns = (BarColumn(), MofNCompleteColumn(), unit, TimeRemainingColumn())
            self.line = Progress(*columns, console=console)
            self.line.add_task("", total=total)
        self.line.start()

    def show(self, text: str, done: int | None) -> None:
        if done is None:
            self.line.update(text)
        else:
            self.line.update(self.line.task_ids[0], completed=done)

    def stop(self) -> None:
        self.line.stop()


class _Page:
    """Bar below a cell of a notebook, in plain HTML: no widgets are needed."""

    def __init__(self, total: int | None) -> None:
        self.display = import_module("IPython.display")  # a notebook has it
        self.total = total
        self.handle = self.display.display(self.display.HTML(""), display_id=True)

    def show(self, text: str, done: int | None) -> None:
        bar = "" if done is None else f'<progress value="{done}" max="{self.total}"></progress> '
        self.handle.update(self.display.HTML(bar + escape(text)))

    def stop(self) -> None:
        self.handle.update(self.display.HTML(""))


class _Log:
    """Lines below each other, where standard error goes into a file."""

    said = ""

    def show(self, text: str, done: int | None) -> None:
        if text != self.said:
            print(text, file=sys.stderr, flush=True)
        self.said = text

    def stop(self) -> None:
        """The last line stays."""


class _Progress:
    """Common part of both: `shown` True or False forces it on or off, None asks where it is; the
    line of an outer call goes on."""

    latest: tuple[str, int | None] = "", None

    def __init__(
        self, shown: bool | Self | None, total: int | None = None, unit: str = "periods"
    ) -> None:
        self.outer = shown if isinstance(shown, _Progress) else None
        self.page = in_notebook()
        if shown is None:
            asked = os.environ.get(ASKED, "0") not in ("", "0")
            self.wanted = asked or self.page or sys.stderr.isatty()
        else:
            self.wanted = self.outer is None and flag("progress", shown)
        self.after = time.monotonic() + PATIENCE
        self.total, self.unit = total, unit
        self.line: _Page | _Terminal | _Log | None = None
        self.lock = threading.Lock()

    def __enter__(self) -> Self:
        if self.wanted:  # machine code may have to be made before anything is done
            self.first = threading.Timer(PATIENCE, self.draw)
            self.first.daemon = True
            self.first.start()
        return self.outer or self

    def __exit__(self, *_: object) -> None:
        if self.wanted:
            self.first.cancel()
            self.first.join()
        if self.line is not None:
            self.line.show(*self.latest)
            self.line.stop()

    @property
    def due(self) -> bool:
        return self.wanted and time.monotonic() >= self.after

    def show(self, text: str, done: int | None = None) -> None:
        """Write it over what was there, unless that was a moment ago."""
        self.latest = text, done
        self.draw()

    def draw(self) -> None:
        with self.lock:
            if not self.due:
                return
            if self.line is None:
                plain = _Terminal(self.total, self.unit) if sys.stderr.isatty() else _Log()
                self.line = _Page(self.total) if self.page else plain
            pause = SELDOM if isinstance(self.line, _Log) else INTERVAL
            self.after = time.monotonic() + pause
            self.line.show(*self.latest)


class Bar(_Progress):
    """Counts periods (or whatever the unit is) up to a known total."""

    def __init__(self, shown: bool | Self | None, total: int, unit: str = "periods") -> None:
        super().__init__(shown, total, unit)
        self.latest = f"0/{total} {unit}", 0

    def advance(self, done: int) -> None:
        if self.wanted:
            self.show(f"{done}/{self.total} {self.unit}", done)


class Counter(_Progress):
    """A status line with the number of points of a walk and its free parameter."""

    title, remark, count = "", "", 0
    latest = "no points yet", None

    def advance(self, point: Any, count: int = 1) -> None:
        self.count += count
        if self.wanted:
            free, remark = point.curve.free[0], self.remark and f"; {self.remark}"
            self.show(f"{self.title}{self.count} points, {free} = {point[free]:.6g}{remark}")
