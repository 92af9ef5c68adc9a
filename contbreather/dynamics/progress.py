"""A progress bar for long runs: at a terminal after a moment, silent everywhere else."""

from __future__ import annotations

import sys
import time
from types import TracebackType
from typing import Any

PATIENCE = 1.0  # seconds before anything is shown


class Bar:
    """Counts periods (or whatever the unit is); ``shown`` True or False forces it on or off."""

    def __init__(self, shown: bool | None, total: int, unit: str = "periods") -> None:
        self.wanted = sys.stderr.isatty() if shown is None else shown
        self.total, self.unit = total, unit
        self.began = time.monotonic()
        self.bar: Any = None
        self.task: Any = None

    def __enter__(self) -> Bar:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self.bar is not None:
            self.bar.stop()

    def advance(self, done: int) -> None:
        """Say how many are done."""
        if not self.wanted:
            return
        if self.bar is None:
            if time.monotonic() - self.began < PATIENCE:
                return
            self._open()
        self.bar.update(self.task, completed=done)

    def _open(self) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeRemainingColumn

        columns = (BarColumn(), MofNCompleteColumn(), self.unit, TimeRemainingColumn())
        self.bar = Progress(*columns, console=Console(stderr=True))
        self.bar.start()
        self.task = self.bar.add_task("", total=self.total)
