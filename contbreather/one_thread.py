"""Linear algebra by one thread, for as long as something is computed here.

OpenBLAS hands parts of small systems to other threads, the second right side of a pair of equations
and much of a few hundred: they take longer to wake than to solve them, and by far where cores are
shared. Larger dense systems than these nobody asks for: such ones are sparse.
"""

from __future__ import annotations

import threading
from contextlib import ContextDecorator
from functools import cache
from typing import Any


class OneThread(ContextDecorator):
    """Block, or decorator of a function, that computes by one thread; one within another as well.

    How many threads there may be belongs to the process, whichever thread of Python says so: the
    last one to leave gives back what the first one found.
    """

    def __init__(self) -> None:
        self._lock, self._inside, self._found = threading.Lock(), 0, list[int]()

    def __enter__(self) -> None:
        with self._lock:
            libraries = _libraries()
            if not self._inside:
                self._found = [library.num_threads for library in libraries]
                _allow([1] * len(libraries))
            self._inside += 1

    def __exit__(self, *raised: object) -> None:
        with self._lock:
            self._inside -= 1
            if not self._inside:
                _allow(self._found)


one_thread = OneThread()


@cache
def _libraries() -> list[Any]:
    """Controllers of numpy's and of scipy's BLAS, which has to be loaded to be told."""
    import scipy.linalg  # noqa: F401
    from threadpoolctl import ThreadpoolController

    return list(ThreadpoolController().select(user_api="blas").lib_controllers)


def _allow(threads: list[int]) -> None:
    from threadpoolctl import OpenBLASController

    for library, most in zip(_libraries(), threads, strict=True):
        library.set_num_threads(most)
    # another thread of Python may be the last to leave, and nobody else could set them meanwhile
    OpenBLASController.clear_controlling_thread()
