"""Functions whose machine code is taken once it pays."""

from __future__ import annotations

import logging
from collections.abc import Callable

from contbreather import native

# Code is loaded, 0.02 s, and compiled, some seconds, once as many calls were made without as would
# have paid for it: so nothing takes more than twice the time it needs.
LOADING = 1 if native.workers_process() else 200
COMPILING = 40_000

_log = logging.getLogger("contbreather")


KERNELS: list[Kernel] = []  # all there are, for those who want them compiled at once


class Kernel:
    """A function in the words of `native`, which has a slower twin.

    Parameters
    ----------
    function : callable
    kinds : str
        As for `native.address`.

    Examples
    --------
    >>> from contbreather.breathers import clearance_loops
    >>> Kernel(clearance_loops.margin, "pppp").code() is None  # the first time nobody waits for it
    True
    """

    def __init__(self, function: Callable[..., int], kinds: str) -> None:
        self.function, self.kinds = function, kinds
        KERNELS.append(self)
        self._asked = 0
        self._code: Callable[..., int] | None = None

    def code(self) -> Callable[..., int] | None:
        """The machine code, to be called with addresses and whole numbers; None where the twin has
        to do, still or for good."""
        if self._code is not None:
            return self._code
        self._asked += 1
        due = self._asked == LOADING and native.is_kept(self.function, self.kinds)
        if due or self._asked == COMPILING:
            self.ready()
        return self._code

    def ready(self) -> bool:
        """Have the machine code at once, whatever that takes; False where it cannot be had."""
        try:
            self._code = native.function(self.function, self.kinds)
        except native.NotCompiled as reason:
            _log.info("%s goes on without compiled code: %s", self.function.__name__, reason)
        return self._code is not None
