"""Errors of contbreather: sentences that say what was given, what was wanted, what to do."""

from __future__ import annotations


class ContbreatherError(Exception):
    """Root of every error raised on purpose by contbreather."""


class BadInput(ContbreatherError, ValueError):
    """What was given cannot be worked with; the command line ends with status 2."""


class NoSolution(BadInput):
    """The question is well posed but has no answer, for instance a forcing below the fold."""


class NotConverged(ContbreatherError, RuntimeError):
    """The numerics failed; the command line ends with status 1.

    `residual` is how far they got, `iterations` how many that took and `last` what they ended at,
    None where that is not known.
    """

    def __init__(
        self,
        message: str,
        *,
        residual: float = float("nan"),
        iterations: int | None = None,
        last: object = None,
    ) -> None:
        super().__init__(message)
        self.residual = residual
        self.iterations = iterations
        self.last = last
