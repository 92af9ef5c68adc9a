"""Functions that a user gave, compiled by numba for `step`.

They are written for an array and a dict; compiled they get an array and a record, which is indexed
by the names of its fields like a dict.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from .. import compiler
from ..errors import BadInput
from ..kernels import NotCompiled, callable_at
from . import derivatives
from .compiled_steps import Array, Loops

_LOG = logging.getLogger(__name__)
_AGREE = 1e-10  # relative; what is compiled may round otherwise
_DERIVED = 1e-5  # and derivatives by differences at a rim or a fine feature may be this bad


def given_loops(curve: Any, params: Mapping[str, float]) -> Loops | None:
    """The equations of a problem whose functions can be compiled, checked at its start; None where
    they cannot, with the reason as a message of the logger, once."""
    problem, free, start = curve.problem, curve.free, curve.start
    names = (*problem.params,)
    slopes = curve.jacobian(start)  # by then it is known how derivatives are to be taken
    scalar = np.ndim(problem.residual(curve.unknowns(start), curve.params(start))) == 0
    slots = tuple(names.index(name) for name in free)
    functions = _functions(problem.residual, problem.jacobian, names, curve.size, slots, scalar)
    if functions is None:
        return None
    values = [float(params.get(name, 0.0)) for name in names]
    longest = derivatives.RELATIVE * np.maximum(curve.scales, abs(start))
    loops = Loops(*functions, (*values, *(longest / curve.finer).tolist()), at_once=True)
    if not _agrees(_filled(loops, loops.derive, start, slopes), slopes, _DERIVED):
        finer = derivatives.estimate(curve.equations, start, curve.scales)[2]
        loops = replace(loops, data=(*values, *(longest / finer).tolist()))
    _check(loops, start, curve.equations(start), slopes)
    return loops


def _filled(loops: Loops, function: Any, z: Array, wanted: Array) -> Array | None:
    """What one of them fills in, None where it has no values."""
    values = np.zeros(wanted.shape)
    arrays = z.copy(), np.array(loops.data), values
    code = callable_at(compiler.address(function, "ppp"), "ppp")
    status = code(*(array.ctypes.data for array in arrays))
    return None if status else values


def _agrees(values: Array | None, wanted: Array, close: float) -> bool:
    atol = close * (1 + abs(wanted).max())
    return values is not None and np.allclose(values, wanted, rtol=close, atol=atol)


def _check(loops: Loops, z: Array, value: Array, slopes: Array) -> None:
    """Refuse functions that mean something else when they are compiled."""
    for function, wanted, close in (
        (loops.evaluate, value, _AGREE),
        (loops.derive, slopes, _DERIVED),
    ):
        values = _filled(loops, function, z, wanted)
        if not _agrees(values, wanted, close):
            what = "residual" if function is loops.evaluate else "derivative"
            has = "not to be had" if values is None else values.tolist()
            raise BadInput(
                f"compiled, the {what} at the start is {has}; as it is it gives "
                f"{wanted.tolist()}: numba takes it otherwise; leave out compiled=True"
            )


@lru_cache(maxsize=64)
def _functions(*arguments: Any) -> tuple[Any, Any] | None:
    """Both functions for `step`, or None where numba refuses them."""
    try:
        functions = _compiled(*arguments)
        for function in functions:
            compiler.address(function, "ppp")
    except (NotCompiled, ImportError) as reason:
        _LOG.info("steps are taken without compiled code: %s", reason)
        return None
    return functions


def _compiled(
    residual: Callable[..., Any],
    jacobian: Callable[..., Any] | None,
    names: tuple[str, ...],
    n: int,
    slots: tuple[int, ...],
    scalar: bool,
) -> tuple[Any, Any]:
    import numba

    njit = numba.njit(error_model="numpy")
    m, width, by_hand = len(slots), n + len(slots), 0 if jacobian is None else n
    record = _as_record(names)
    # of a single equation a number will do
    entry = numba.njit((lambda value, i: value) if scalar else (lambda value, i: value[i]))
    put = njit(_put(njit(residual), n, entry, record))
    column = njit(_column(put, len(names), n, slots))
    rows = njit(_rows(njit(jacobian), n, width, record) if jacobian else lambda x, data, out: 0)

    def unpack(z: Any, data: Any) -> Any:
        x = np.empty(n)
        for i in range(n):
            x[i] = z[i]
        for j in range(m):
            data[slots[j]] = z[n + j]
        return x

    unpacked = njit(unpack)

    def evaluate(z: Any, data: Any, out: Any) -> Any:
        return put(unpacked(z, data), data, out)

    def derive(z: Any, data: Any, out: Any) -> Any:
        x, slopes = unpacked(z, data), np.empty(n)
        status = rows(x, data, out)
        for c in range(by_hand, width):
            status += column(c, x, data, slopes)
            for i in range(n):
                out[i * width + c] = slopes[i]
        return status

    return njit(evaluate), njit(derive)


def _put(function: Any, n: int, entry: Any, record: Any) -> Callable[..., int]:
    """Fill in the values of a function at x and data; 1 where it raises."""

    def put(x: Any, data: Any, out: Any) -> int:
        try:
            value = function(x, record(data))
        except Exception:  # noqa: BLE001 - numba knows no others
            return 1
        for i in range(n):
            out[i] = entry(value, i)
        return 0

    return put


def _rows(slopes: Any, n: int, width: int, record: Any) -> Callable[..., int]:
    """Fill in the derivative that was given."""

    def rows(x: Any, data: Any, out: Any) -> int:
        try:
            value = slopes(x, record(data))
        except Exception:  # noqa: BLE001 - numba knows no others
            return 1
        for i in range(n):
            for k in range(n):
                out[i * width + k] = value[i][k]
        return 0

    return rows


def _column(put: Any, count: int, n: int, slots: tuple[int, ...]) -> Callable[..., Any]:
    """A column of the derivative by the five-point formula, with steps from behind the parameters:
    powers of complex numbers are not exact to the last digit of a complex step."""

    def column(c: int, x: Any, data: Any, out: Any) -> Any:
        h, moved, status = data[count + c], np.empty(n), 0
        for i in range(n):
            out[i] = 0.0
        for step in (-2, -1, 1, 2):
            # f' = (f(-2h) - 8 f(-h) + 8 f(h) - f(2h)) / 12h
            weight = (8.0 if abs(step) == 1 else -0.5) * step / (12.0 * h)
            if c < n:
                kept = x[c]
                x[c] = kept + step * h
                status += put(x, data, moved)
                x[c] = kept
            else:
                kept = data[slots[c - n]]
                data[slots[c - n]] = kept + step * h
                status += put(x, data, moved)
                data[slots[c - n]] = kept
            for i in range(n):
                out[i] += weight * moved[i]
        return status

    return column


def _as_record(names: tuple[str, ...]) -> Any:
    """The parameters at a pointer as a record, which is indexed by their names."""
    import numba
    from numba.extending import intrinsic

    carray: Any = numba.carray  # type: ignore[attr-defined]
    pointer = numba.types.CPointer(numba.from_dtype(np.dtype([(name, float) for name in names])))

    def pointed(_: Any, where: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            return builder.bitcast(args[0], context.get_value_type(pointer))

        return pointer(where), generate

    cast: Any = intrinsic(pointed)

    def record(where: Any) -> Any:
        return carray(cast(where), 1)[0]

    return numba.njit(record)
