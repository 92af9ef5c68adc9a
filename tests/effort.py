"""How much work something is, on every machine the same: a clock tells of what runs beside it."""

from __future__ import annotations

import sys
import tracemalloc
from collections.abc import Callable
from types import FrameType
from typing import Any, NamedTuple


class Effort(NamedTuple):
    """Functions of Python and C that were called, and the most bytes that were taken at a time."""

    calls: int
    memory: int


def effort(work: Callable[[], object]) -> Effort:
    tracemalloc.start()
    try:
        calls = functions_called(work, "call", "c_call")
        return Effort(calls, tracemalloc.get_traced_memory()[1])
    finally:
        tracemalloc.stop()


def functions_called(work: Callable[[], object], *events: str) -> int:
    """Count the functions that were called, those of Python unless others are named."""
    calls = 0

    def count(_: FrameType, event: str, __: Any) -> None:
        nonlocal calls
        calls += event in (events or ("call",))

    sys.setprofile(count)
    try:
        work()
    finally:
        sys.setprofile(None)
    return calls
