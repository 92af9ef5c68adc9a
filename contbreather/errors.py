"""Errors of contbreather: sentences that say what was given, what was wanted, what to do."""

from __future__ import annotations


class ContbreatherError(Exception):
    """Root of every error raised on purpose by contbreather."""


class BadInput(ContbreatherError, ValueError):
    """What was given cannot be worked with; the command line ends with status 2."""


class NoSolution(BadInput):
    """The question is well posed but has no answer, for instance a forcing below the fold."""


class NotConverged(ContbreatherError, RuntimeError):
    """The numerics failed; the command line ends with status 1. `residual` is how far they got."""

    def __init__(self, message: str, *, residual: float = float("nan")) -> None:
        super().__init__(message)
        self.residual = residual
