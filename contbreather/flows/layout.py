"""Order of the unknowns of a cycle, and of the values of its derivative among its entries."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..continuation.newton import Array
from ..continuation.sparse import Matrix

_DENSE = 400  # unknowns up to which a dense derivative is the faster one

Places = NDArray[np.intp]


class _Pattern(NamedTuple):
    """Places of values among the entries of a matrix, `cells` for those that belong nowhere; of a
    sparse one the row of each, and where columns end."""

    places: Places
    cells: int
    rows: Places
    ends: Places


@dataclass(frozen=True, eq=False)
class Layout:
    """The order of unknowns and equations: states, meshes, durations, and the phase."""

    counts: tuple[tuple[int, ...], ...]  # intervals and states of each flow
    ended: tuple[bool, ...]  # whether a condition ends it
    autonomous: bool
    phased: bool
    _patterns: dict[int, _Pattern] = field(default_factory=dict, init=False)

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
        """Places of the durations."""
        first = self.knots[-1][-1] + 1
        return np.arange(first, first + len(self.counts))

    @cached_property
    def size(self) -> int:
        return int(self.lengths[-1]) + 1 + self.phased

    def matrix(self, values: Array, named: int) -> Matrix:
        """The derivative in unknowns and so many parameters, from the values of all blocks."""
        shape, pattern = (self.size, self.size + named), self._pattern(named)
        # several entries may meet in one place; what is of fixed knots lands beyond the last
        data = np.bincount(pattern.places, values, pattern.cells + 1)[:-1]
        if self.size <= _DENSE:
            return data.reshape(shape)
        from scipy.sparse import csc_array

        return csc_array((data, pattern.rows, pattern.ends), shape=shape)

    def _places(self, named: int) -> Iterator[tuple[Any, Any]]:
        """Rows and columns of all blocks. The column of a knot that is fixed is -1."""
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
        """List the unknowns that each interval depends on, in the order of `FlowEquations`."""
        before = [*self.lengths[:i], *([self.size - 1] if self.phased else [])]
        shared = [self.lengths[i], *before, *range(self.size, self.size + named)]
        inner = np.concatenate([[-1], self.knots[i][:-1], [-1]])
        return np.hstack(
            [
                self.nodes[i], inner[:-1, None], inner[1:, None],
                np.tile(shared, (len(inner) - 1, 1)),
            ]
        )  # fmt: skip

    def _pattern(self, named: int) -> _Pattern:
        """Find the places of the values of all blocks, once."""
        if named not in self._patterns:
            width = self.size + named
            spread = [np.broadcast_arrays(*place) for place in self._places(named)]
            rows, columns = (np.concatenate([at[k].ravel() for at in spread]) for k in range(2))
            if self.size <= _DENSE:
                count, ends = self.size * width, np.empty(0, int)
                places = np.where(columns < 0, count, rows * width + columns)
            else:  # by columns, each entry once; those of fixed knots beyond the last
                cells = np.where(columns < 0, self.size * width, columns * self.size + rows)
                filled, places = np.unique(cells, return_inverse=True)
                count = int(np.searchsorted(filled, self.size * width))
                rows = filled[:count] % self.size
                ends = np.searchsorted(filled[:count], self.size * np.arange(width + 1))
            self._patterns[named] = _Pattern(places, count, rows, ends)
        return self._patterns[named]
