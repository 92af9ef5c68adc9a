"""Dense matrices as LAPACK factorises them."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@cache
def _lapack() -> Any:
    from scipy.linalg import lapack  # dear to import: looking at a breather needs none

    return lapack


def solve(matrix: Array, right: Array) -> Array | None:
    """Solution of a small dense system, or None where the matrix is singular."""
    _, _, solution, info = _lapack().dgesv(matrix, right)
    return solution if info == 0 else None


class Dense:
    """A dense derivative with a row below, unless that is None, factorised."""

    def __init__(self, matrix: Array, row: Array | None = None) -> None:
        self.row, self.whole = row, matrix
        if row is not None:
            self.whole = np.empty((row.size, row.size))
            self.whole[:-1], self.whole[-1] = matrix, row
        self._factors, self._pivots, info = _lapack().dgetrf(self.whole)
        self.exact = info == 0

    def solve(self, right: Array, last: float = 0.0) -> Array | None:
        """The solution, `last` being the right side of the row; None where it is singular."""
        whole = right if self.row is None else np.append(right, last)
        return _lapack().dgetrs(self._factors, self._pivots, whole)[0] if self.exact else None

    def transposed(self, right: Array) -> Array:
        """The solution for the transpose."""
        return np.asarray(_lapack().dgetrs(self._factors, self._pivots, right, trans=1)[0])

    def sign(self) -> int:
        """Of the determinant; 0 where the matrix is singular."""
        if not self.exact:
            return 0
        # P A = L U, L with ones on its diagonal: det A = det U / det P
        turns = np.count_nonzero(self._pivots != np.arange(self._pivots.size))
        return -1 if (np.count_nonzero(self._factors.diagonal() < 0) + turns) % 2 else 1
