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


class Interrupted(KeyboardInterrupt):
    """Ctrl-C, with what was done by then; the command line ends with status 130.

    It is a `KeyboardInterrupt`, so that it ends a loop around the call as well. `partial` is what
    the outermost call of this package would have returned, as far as it got and marked as cut
    short; None if there is nothing yet. (`asyncio.IncompleteReadError.partial` is the model.)

    A function that calls others which may be interrupted catches `KeyboardInterrupt`, of which
    this is one, takes what it can use from the `partial` of the inner call, and raises one of its
    own: what a caller gets is never the piece of a piece.
    """

    def __init__(self, message: str = "interrupted", *, partial: object = None) -> None:
        super().__init__(message)
        self.partial = partial
