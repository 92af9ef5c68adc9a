"""Progress of long walks: shown at a terminal after a moment, otherwise silent."""

from __future__ import annotations

import sys
import time
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .point import Point

_PATIENCE = 1.0  # seconds before anything is shown
_INTERVAL = 0.1


class Progress:
    """A status line with the number of points and the free parameter.

    `shown` True or False forces it on or off; None shows it at a terminal only.
    """

    def __init__(self, shown: bool | None, free: str) -> None:
        self.wanted = sys.stderr.isatty() if shown is None else shown
        self.free = free
        self.title = ""
        self.count = 0
        self.began = time.monotonic()
        self.last = self.began + _PATIENCE
        self.status: Any = None

    def __enter__(self) -> Progress:
        return self

    def __exit__(self, *_: object) -> None:
        if self.status is not None:
            self.status.stop()

    def advance(self, point: Point) -> None:
        """Count a point, and show it if enough time has passed."""
        self.count += 1
        if not self.wanted or time.monotonic() < self.last:
            return
        self.last = time.monotonic() + _INTERVAL
        text = f"{self.title}{self.count} points, {self.free} = {point[self.free]:.6g}"
        if self.status is None:
            from rich.console import Console

            self.status = Console(stderr=True).status(text)
            self.status.start()
        self.status.update(text)
