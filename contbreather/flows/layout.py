"""Order of the unknowns of a cycle, and of the values of its derivative among its entries."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..continuation.algebra.newton import Array
from ..continuation.algebra.sparse import Matrix

Places = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Layout:
    """The order of unknowns and equations: states, meshes, durations, and the phase."""

    counts: tuple[tuple[int, ...], ...]  # intervals and states of each flow
    ended: tuple[bool, ...]  # whether a condition ends it
    autonomous: bool
    phased: bool
    _cells: dict[int, Places] = field(default_factory=dict, init=False)

    @cached_property
    def nodes(self) -> tuple[Places, ...]:
        """Places of the states of each flow among the unknowns, shape (intervals, n)."""
        ends = np.cumsum([k * n for k, n in self.counts])
        return tuple(
            np.arange(end - k * n, end).reshape(k, n)
            for (k, n), end in zip(self.counts, ends, strict=True)
        )

    @cached_property
    def orbit(self) -> int:
        """Number of unknowns that are states."""
        return sum(node.size for node in self.nodes)

    @cached_property
    def knots(self) -> tuple[Places, ...]:
        """Places of the mesh of each flow, its inner knots and the logarithm of its path, shape
        (intervals,)."""
        counts = [count for count, _ in self.counts]
        ends = self.orbit + np.cumsum(counts)
        return tuple(np.arange(end - m, end) for m, end in zip(counts, ends, strict=True))

    @cached_property
    def lengths(self) -> Places:
        first = self.knots[-1][-1] + 1
        return np.arange(first, first + len(self.counts))

    @cached_property
    def size(self) -> int:
        return int(self.lengths[-1]) + 1 + self.phased

    def matrix(self, values: Array, named: int) -> Matrix:
        """Assemble the derivative in unknowns and so many parameters from the values of all blocks,
        of which several may meet in one entry; those of fixed knots are in a column beyond."""
        width = self.size + named + 1
        if named not in self._cells:
            spread = [np.broadcast_arrays(*place) for place in self._places(named)]
            rows, columns = (np.concatenate([at[k].ravel() for at in spread]) for k in range(2))
            self._cells[named] = rows * width + columns % width
        cells = self._cells[named]
        if self.size <= 400:  # unknowns: up to there a dense derivative is the faster one
            entries = np.bincount(cells, values, self.size * width)
            return entries.reshape(self.size, width)[:, :-1]
        from scipy.sparse import csc_array

        return csc_array((values, np.divmod(cells, width)), (self.size, width))[:, :-1]

    def _places(self, named: int) -> Iterator[tuple[Any, Any]]:
        """Rows and columns of all blocks."""
        diagonal, width = np.arange(self.orbit), self.size + named
        whole = np.append(self.lengths, np.arange(self.size, width))
        yield diagonal, diagonal
        for i, node in enumerate(self.nodes):
            columns = self.columns(i, named)
            yield node[1:, :, None], columns[:-1, None]
            yield self.nodes[(i + 1) % len(self.counts)][0][:, None], columns[-1:]
            yield self.knots[i][:, None], columns
            yield self.knots[i], self.knots[i][-1]
            if self.ended[i]:
                yield self.lengths[i], columns[-1]
            else:
                yield self.lengths[i], node.ravel() if self.autonomous else whole
        if self.phased:
            yield self.size - 1, whole

    def columns(self, i: int, named: int) -> Places:
        """List the unknowns that each interval depends on, -1 for a knot that is fixed: its state,
        the knots at both ends, the duration, what the beginning of the flow is the sum of, and the
        parameters."""
        before = [*self.lengths[:i], *([self.size - 1] if self.phased else [])]
        shared = [self.lengths[i], *before, *range(self.size, self.size + named)]
        inner = np.concatenate([[-1], self.knots[i][:-1], [-1]])
        return np.hstack(
            [
                self.nodes[i], inner[:-1, None], inner[1:, None],
                np.tile(shared, (len(inner) - 1, 1)),
            ]
        )  # fmt: skip
