"""The derivative of a vector field in its state, as users give it: a function, or its pattern."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np

from ..checks import brief, numbers
from ..continuation.algebra import derivatives
from ..continuation.algebra.newton import OUT_OF_DOMAIN, Array, Undefined
from ..continuation.algebra.sparse import Matrix, Pattern, canonical, entry_columns, is_sparse
from ..errors import BadInput
from .functions import (
    ROUNDING,
    Function,
    Params,
    offset,
    place,
    rows_of,
    slopes_along,
    undecorated,
    values,
)

Slopes = tuple[Array, Any, Array]  # values (n, K), derivatives in states, in time and parameters


@dataclass(frozen=True)
class Exact:
    """A derivative as a function ``(t, x, p)``: (n, n) or sparse, at K states (n, n, K)."""

    function: Function

    def slopes(self, f: Function, t: Any, x: Array, p: Params, names: tuple[str, ...]) -> Slopes:
        """Evaluate a field at K states and differentiate it, in the state (n, n, K)."""
        (n, count), t = x.shape, np.broadcast_to(t, x.shape[1:])
        value, other = slopes_along(f, t, x, p, names, np.empty((n, 0)))
        if is_sparse(self.matrix(t[0], x[:, 0], p)):
            at = [self.matrix(*place, p).toarray() for place in zip(t, x.T, strict=True)]
            return value, np.stack(at, axis=-1), other
        return value, values(self._entries, t, x, p).reshape(n, n, count), other

    def entries(self, f: Function, t: Any, x: Array, p: Params, names: tuple[str, ...]) -> Slopes:
        """Evaluate a field at K states and differentiate it: rows, columns and values of what is
        not zero in one matrix with K blocks on its diagonal."""
        (n, _), t = x.shape, np.broadcast_to(t, x.shape[1:])
        value, other = slopes_along(f, t, x, p, names, np.empty((n, 0)))
        blocks = [canonical(self.matrix(*place, p)) for place in zip(t, x.T, strict=True)]
        rows = [block.indices + k * n for k, block in enumerate(blocks)]
        columns = [entry_columns(block) + k * n for k, block in enumerate(blocks)]
        parts = rows, columns, [block.data for block in blocks]
        return value, [np.concatenate(part) for part in parts], other

    def matrix(self, t: float, x: Array, p: Params) -> Matrix:
        return self.function(t, x, p)

    def is_sparse(self, t: float, x: Array, p: Params) -> bool:
        return is_sparse(self.matrix(t, x, p))

    @cached_property
    def _entries(self) -> Function:
        return partial(_entries, self.function)

    def check(self, f: Function, t: float, x: Array, p: Params) -> Matrix:
        n = x.size
        try:
            matrix = self.matrix(t, x.copy(), p)
            shape = matrix.shape if is_sparse(matrix) else np.asarray(matrix, dtype=float).shape
        except (*OUT_OF_DOMAIN, KeyError, TypeError, IndexError) as error:
            raise BadInput(
                f"jacobian raises {type(error).__name__}: {error}, {place(t, x, p)}"
            ) from error
        if shape != (n, n):
            raise BadInput(
                f"jacobian returns shape {shape}; {(n, n)} was expected {place(t, x, p)}, and "
                f"{(n, n, 'm')} for m states at once"
            )
        return canonical(matrix)


def _entries(function: Function, t: Any, x: Any, p: Params) -> Any:
    """List the rows of a derivative one after the other, as rows of one function."""
    matrix = function(t, x, p)
    if isinstance(matrix, np.ndarray):
        return matrix.reshape(-1, *matrix.shape[2:])
    return [entry for row in matrix for entry in row]


@dataclass(frozen=True)
class Coloured:
    """A derivative whose pattern is known: states that share no equation are moved at once."""

    pattern: Pattern

    def slopes(self, f: Function, t: Any, x: Array, p: Params, names: tuple[str, ...]) -> Slopes:
        n, count = x.shape
        value, entries, other = self._entries(f, t, x, p, names)
        matrix = np.zeros((n, n, count))
        matrix[self.pattern.matrix.indices, self.pattern.columns] = entries
        return value, matrix, other

    def entries(self, f: Function, t: Any, x: Array, p: Params, names: tuple[str, ...]) -> Slopes:
        """As of one that is exact."""
        value, entries, other = self._entries(f, t, x, p, names)
        first = len(x) * np.arange(x.shape[1])[:, None]
        places = first + self.pattern.matrix.indices, first + self.pattern.columns
        return value, (*(place.ravel() for place in places), entries.T.ravel()), other

    def is_sparse(self, t: float, x: Array, p: Params) -> bool:
        return True

    def _entries(self, f: Function, t: Any, x: Array, p: Params, names: tuple[str, ...]) -> Slopes:
        """Evaluate a field and differentiate it, in states by the entries of the pattern, shape
        (entries, K)."""
        colours, columns = self.pattern.colours, self.pattern.columns
        # states move in proportion to their sizes, but what is only rounding
        sizes = abs(x).max(axis=1)
        steps = np.where(sizes > ROUNDING * sizes.max(), sizes, 1.0)
        ways = np.where(colours[:, None] == np.arange(colours.max() + 1), steps[:, None], 0.0)
        value, slope = slopes_along(f, t, x, p, names, ways)
        along, other = np.split(slope, [ways.shape[1]], axis=1)
        entries = along[self.pattern.matrix.indices, colours[columns]] / steps[columns, None]
        return value, entries, other

    def check(self, f: Function, t: float, x: Array, p: Params) -> Matrix:
        shape, n = self.pattern.matrix.shape, x.size
        if shape != (n, n):
            raise BadInput(f"the sparsity pattern has shape {shape}; {(n, n)} was expected")
        from scipy.sparse import csc_array

        entries, where = self._entries(f, t, x[:, None], p, ())[1], self.pattern.matrix
        return csc_array((entries[:, 0], where.indices, where.indptr), shape=shape)


@dataclass(frozen=True)
class FieldWithJacobian:
    """A vector field with its derivative in the state as it was given."""

    f: Function
    jacobian: Exact | Coloured

    @classmethod
    def of(cls, f: Function, jacobian: Any) -> FieldWithJacobian:
        """Take a function (t, x, p), or a pattern of its entries, dense or from scipy.sparse."""
        if callable(jacobian):
            return cls(f, Exact(undecorated(jacobian)))
        if not (is_sparse(jacobian) or isinstance(jacobian, np.ndarray | list | tuple)):
            raise BadInput(
                "jacobian must be a function of (t, x, p), or a pattern of its entries; got "
                f"{brief(jacobian)}"
            )
        entries = jacobian if is_sparse(jacobian) else numbers("jacobian", jacobian)
        if entries.ndim != 2:
            raise BadInput(f"the sparsity pattern has shape {entries.shape}; (n, n) was expected")
        return cls(f, Coloured(Pattern(entries)))

    def __post_init__(self) -> None:  # by which errors call it
        object.__setattr__(self, "__qualname__", getattr(self.f, "__qualname__", brief(self.f)))

    def __call__(self, t: Any, x: Any, p: Params) -> Any:
        return self.f(t, x, p)

    def check(self, t: float, x: Array, p: Params) -> None:
        """Refuse a derivative that differences beside a state contradict: at the origin terms of
        second order are not seen."""
        try:
            self._check(t, x + offset(x[:, None]), p)
        except Undefined:  # outside of its domain
            self._check(t, x, p)

    def _check(self, t: float, x: Array, p: Params) -> None:
        matrix = self.jacobian.check(self, t, x, p)

        def field(x: Array) -> Array:
            return values(self, t, x[:, None], p)[:, 0]

        # one direction through all entries tells whether any is wrong, as in `wrong_entry`
        direction = np.maximum(abs(x), abs(x).max() or 1.0) * np.cos(np.arange(x.size))
        row = derivatives.wrong_row(
            field, x, lambda x: self.jacobian.check(self, t, x, p), direction
        )
        if row is None:
            return
        what, given = "jacobian that was given", None
        if isinstance(self.jacobian, Coloured):
            what, given = "sparsity pattern", self.jacobian.pattern
        entry = derivatives.wrong_in_row(field, x, matrix, row, direction, given)
        raise BadInput(f"the {what} does not fit f: {entry}, {place(t, x)}")


def at_other_time(through: Any, f: Function) -> Function:
    """The function ``through(f, t, x, p)``, with the derivative that was given of f."""
    if not isinstance(f, FieldWithJacobian):
        return partial(through, f)
    given = f.jacobian
    if isinstance(given, Exact):
        given = Exact(partial(through, given.function))
    return FieldWithJacobian(partial(through, f.f), given)


def over_mass(inverse: Array, f: Function) -> Function:
    """The function ``M^-1 f``, with the derivative that was given of f."""
    if not isinstance(f, FieldWithJacobian):
        return partial(_divided, inverse, f)
    given = f.jacobian
    if isinstance(given, Exact):
        given = Exact(partial(_divided_matrix, inverse, given.function))
    else:
        given = Coloured(Pattern((inverse != 0) @ given.pattern.matrix))
    return FieldWithJacobian(partial(_divided, inverse, f.f), given)


def _divided(inverse: Array, f: Function, t: Any, x: Any, p: Params) -> Any:
    return inverse @ rows_of(f(t, x, p), x)  # the columns of x stay columns


def _divided_matrix(inverse: Array, jacobian: Function, t: Any, x: Any, p: Params) -> Any:
    # at several states one by one, as what is sparse is
    return np.asarray(inverse @ jacobian(t, x, p))
