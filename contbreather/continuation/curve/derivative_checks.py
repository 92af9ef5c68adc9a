"""Equations and derivatives of a user, checked where they come in: shapes and differences; and
advice on how to give them."""

from __future__ import annotations

from contextlib import suppress
from typing import Any

import numpy as np

from ...checks import check_double
from ...errors import BadInput
from ..algebra import derivatives
from ..algebra.newton import OUT_OF_DOMAIN, Array, Undefined
from ..algebra.sparse import Pattern, canonical, entry_columns, is_sparse
from .curve import Curve


def check_start(curve: Curve) -> Array:
    """Refuse wrong shapes and wrong derivatives before anything is built on them; the equations at
    the start."""
    problem, z, n = curve.problem, curve.start, curve.size
    try:
        value = curve.equations(z)
    except Undefined as error:
        raise BadInput(
            f"the equations have no value at the start {problem.start_text()}: {error}"
        ) from error
    if value.dtype.kind not in "iuf":  # truth values, objects as SymPy's
        raise BadInput(f"the residual is {value!r}; an array of numbers was expected")
    check_double("the residual", value)
    given, at = list[tuple[str, Any, tuple[int, ...]]](), (z[:n].copy(), curve.params(z))
    try:
        if callable(problem.jacobian):
            given.append(("Jacobian", curve.call(problem.jacobian, *at), (n, n)))
        for name in curve.free if problem.sensitivity is not None else ():
            given.append(("sensitivity", curve.call(problem.sensitivity, *at, name), (n,)))
    except Undefined as error:
        raise BadInput(
            f"the derivatives have no value at the start {problem.start_text()}: {error}"
        ) from error
    for what in given:
        _check_shape(*what)
    if wrong := wrong_derivatives(curve, z):
        raise BadInput(wrong)
    return value


def _check_shape(what: str, value: Any, shape: tuple[int, ...]) -> None:
    sparse = is_sparse(value)
    if sparse and len(shape) == 1:
        raise BadInput(
            f"the {what} is sparse, a {type(value).__name__}; a dense array of shape {shape} was "
            "expected: return its toarray()"
        )
    try:
        if np.iscomplexobj(value):
            raise TypeError
        actual = value.shape if sparse else np.asarray(value, dtype=float).shape
    except (TypeError, ValueError, OverflowError) as error:
        raise BadInput(f"the {what} is {value!r}; an array of real numbers was expected") from error
    if actual != shape:
        kind = "is sparse and has" if sparse else "has"
        raise BadInput(f"the {what} {kind} shape {actual}; {shape} was expected")
    if sparse and (wrong := np.flatnonzero(~np.isfinite((matrix := canonical(value)).data))).size:
        entry = (int(matrix.indices[wrong[0]]), int(entry_columns(matrix)[wrong[0]]))
        raise BadInput(
            f"entry {entry} of the sparse {what} is {matrix.data[wrong[0]]} at the start"
        )


def wrong_derivatives(curve: Curve, z: Array) -> str:
    """Say what is wrong with derivatives that were given, seen at z: empty if nothing is."""
    problem = curve.problem
    if problem.beneath is not None:
        return wrong_derivatives(*problem.beneath(z[: curve.size], curve.params(z), curve.free))
    given = problem.jacobian, problem.sensitivity, problem.derivatives
    if problem.tested or given == (None, None, None):
        return ""
    what = (
        "sparsity pattern" if isinstance(problem.jacobian, Pattern) else "Jacobian that was given"
    )
    wrong = wrong_entry(curve, z)
    return wrong and f"the {what} does not fit the residual: {wrong}"


def wrong_entry(curve: Curve, z: Array) -> str:
    """Name an entry of the derivative at z that differences contradict: empty if there is none."""
    matrix = curve.jacobian(z)
    # one direction through all entries tells whether any is wrong: cos(0), cos(1), ... has no
    # pattern by which several of them would cancel
    direction = np.maximum(curve.scales, abs(z)) * np.cos(np.arange(z.size))
    row = derivatives.wrong_row(curve.residual, z, curve.jacobian, direction)
    if row is None:
        return ""
    if is_sparse(matrix):
        given = curve.problem.jacobian
        return derivatives.wrong_in_row(curve.residual, z, matrix, row, direction, given)
    wanted, doubt, _ = derivatives.estimate(curve.residual, z, curve.scales)
    if (entry := derivatives.misfit(matrix, wanted, doubt)) is None:
        return ""
    return f"its entry {entry} is {matrix[entry]:.8g}, differences give {wanted[entry]:.8g}"


def reconsider(curve: Curve, *places: Array) -> str:
    """Choose anew how derivatives are taken here; say what is wrong with given ones."""
    curve.forget()
    for z in places:
        with suppress(Undefined):
            curve.jacobian(z)
            if wrong := wrong_derivatives(curve, z):
                return wrong
    return ""


def advice(curve: Curve) -> str:
    """Say what would make a large problem cheaper; empty if there is nothing to say."""
    problem = curve.problem
    if curve.size < 500 or problem.derivatives is not None or problem.beneath is not None:
        return ""

    def made(start: Array) -> str:
        with suppress(*OUT_OF_DOMAIN):
            matrix = curve.jacobian(start)
            if not is_sparse(matrix) and np.count_nonzero(matrix) < 0.05 * matrix.size:
                return (
                    f"a derivative of {curve.size} x {curve.size} entries, nearly all of them 0: "
                    "Problem(..., jacobian=pattern), or a sparse jacobian, is faster"
                )
        return ""

    return curve.cached("advice", curve.start, made)
