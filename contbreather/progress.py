"""Progress of long calls: shown at a terminal after a moment, otherwise silent."""

from __future__ import annotations

import sys
import time
from typing import Any, Self

PATIENCE = 1.0  # seconds before anything is shown
INTERVAL = 0.1


class _Shown:
    """What both kinds share: `shown` True or False forces it on or off, None asks the terminal."""

    def __init__(self, shown: bool | None) -> None:
        self.wanted = sys.stderr.isatty() if shown is None else shown
        self.after = time.monotonic() + PATIENCE
        self.bar: Any = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self.bar is not None:
            self.bar.stop()

    @property
    def due(self) -> bool:
        """Whether it is wanted, and enough time has passed."""
        return self.wanted and time.monotonic() >= self.after


class Bar(_Shown):
    """Counts periods (or whatever the unit is) up to a known total."""

    def __init__(self, shown: bool | None, total: int, unit: str = "periods") -> None:
        super().__init__(shown)
        self.total, self.unit = total, unit

    def advance(self, done: int) -> None:
        """Say how many are done."""
        if not self.due:
            return
        if self.bar is None:
            from rich.console import Console
            from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeRemainingColumn

            columns = (BarColumn(), MofNCompleteColumn(), self.unit, TimeRemainingColumn())
            self.bar = Progress(*columns, console=Console(stderr=True))
            self.bar.start()
            self.bar.add_task("", total=self.total)
        self.bar.update(self.bar.task_ids[0], completed=done)


class Counter(_Shown):
    """A status line with the number of points of a walk and its free parameter."""

    def __init__(self, shown: bool | None, free: str) -> None:
        super().__init__(shown)
        self.free, self.title, self.count = free, "", 0

    def advance(self, point: Any) -> None:
        """Count a point, and show it if enough time has passed."""
        self.count += 1
        if not self.due:
            return
        self.after = time.monotonic() + INTERVAL
        text = f"{self.title}{self.count} points, {self.free} = {point[self.free]:.6g}"
        if self.bar is None:
            from rich.console import Console

            self.bar = Console(stderr=True).status(text)
            self.bar.start()
        self.bar.update(text)
