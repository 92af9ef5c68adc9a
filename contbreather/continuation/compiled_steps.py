"""Problems of a few unknowns whose equations are machine code: many steps in one call of `step`.

Functions that a user gave are compiled by numba for this session. They are written for an array and
a dict; compiled they get an array and a record, which is indexed by the names of its fields like a
dict.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .. import compiler, kernels
from ..errors import BadInput
from ..kernels import EQUATIONS, FRAME, Kernel, callable_at, kernel_of
from ..machine_code import NotCompiled
from . import derivatives
from .step import ACCEPTED, CORRECTED, STEPS, CompiledEquations, CompiledPoint, Rules

Array = NDArray[np.float64]

_AT_ONCE = 256  # steps in one call of compiled code
_AS_IT_IS = 16  # and of plain text, after each of which a signal is seen

_AGREE = 1e-10  # relative; what is compiled may round otherwise
_DERIVED = 1e-5  # and derivatives by differences at a edge or a fine feature may be this bad

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Loops:
    """The equations of a curve as functions for `step`.

    Attributes
    ----------
    evaluate, derive : callable
        ``(z, data, out) -> int``: fill in the equations, or their derivatives row by row; 0, or
        anything else where there are none. In the words of `kernels`.
    data : NamedTuple or sequence of float
        What they ask for besides z: numbers for functions that a user gave, for others what their
        kernels are listed with.
    at_once : bool
        Whether to compile them for this session: functions that a user gave.
    """

    evaluate: Callable[[Any, Any, Any], int]
    derive: Callable[[Any, Any, Any], int]
    data: Any
    at_once: bool = False


class MachineCode(NamedTuple):
    """Addresses of the functions of a problem, and the kernels by machine code."""

    evaluate: int
    derive: int
    code: Mapping[Kernel, Callable[..., int]]


class CompiledCurve:
    """The equations of a curve, and the kernels on them: by machine code, or as they are.

    Attributes
    ----------
    loops : Loops
    point : CompiledPoint
        Where the latest of many steps ended.
    """

    def __init__(self, loops: Loops, metric: Array) -> None:
        d, self.loops, self.machine = metric.size, loops, machine_code(loops)
        evaluate: Any = self.machine.evaluate if self.machine else loops.evaluate
        derive: Any = self.machine.derive if self.machine else loops.derive
        value, flat = np.zeros((2, 3 * d * d))
        matrix = flat[: d * d].reshape(d, d)
        data: Any = np.array(loops.data) if loops.at_once else loops.data
        if self.machine and not loops.at_once:
            data = kernel_of(loops.evaluate, EQUATIONS).framed(data)
        self.eq = CompiledEquations(
            evaluate, derive, data, metric, value, flat, matrix, np.zeros(d)
        )
        self.point, self.answer = CompiledPoint(*np.zeros((6, d))), np.zeros(3)

    def _call(self, kernel: Kernel, *values: Any) -> None:
        if self.machine is not None:
            kernel.run(self.machine.code[kernel], (self.eq, *values))
        else:
            kernel.as_it_is(self.eq, *values)

    def steps(
        self, rules: Rules, start: Sequence[Array], state: Array, most: int
    ) -> tuple[Array, Array, Array, Array]:
        """As many steps as come off, at most so many: their z, tangents, arclengths and residuals;
        from z, tangent and curvature, and the state there: arclength, the size to try next, the
        sign of the bordered determinant, the longest step so far; it becomes that of the last."""
        for buffer, entries in zip(self.point, start, strict=False):
            buffer[:] = entries
        d, count = self.point.z.size, np.zeros(1, dtype=np.int64)
        out = np.empty((min(most, _AT_ONCE if self.machine else _AS_IT_IS), 2 * d + 2))
        with suppress(ArithmeticError, ValueError):  # where machine code goes on with an infinity
            self._call(STEPS, rules, self.point, state, out, count)
        rows = out[: count[0]].copy()
        return rows[:, :d], rows[:, d : 2 * d], rows[:, -2], rows[:, -1]

    def corrected(
        self, guess: Array, across: Array, slope: Array, tolerance: float
    ) -> tuple[Array, Array, float, int] | None:
        """The point in the plane across a vector, its tangent on the side of another, the residual
        and how many iterations it took; None where the solvers of the curve have to do."""
        point = self.point
        point.end[:] = guess
        try:
            self._call(CORRECTED, tolerance, across, slope, point, self.answer)
        except (ArithmeticError, ValueError):
            return None
        status, iterations, residual = self.answer.tolist()
        if status != ACCEPTED:
            return None
        return point.end.copy(), point.end_tangent.copy(), residual, int(iterations)


_known: dict[Any, MachineCode | None] = {}


def machine_code(loops: Loops) -> MachineCode | None:
    """Machine code of a problem and of the kernels, None where there is none."""
    if loops.evaluate in _known:
        return _known[loops.evaluate]
    address, code = compiler.compiled_address if loops.at_once else kernels.address, None
    try:
        evaluate, derive = address(loops.evaluate, EQUATIONS), address(loops.derive, EQUATIONS)
        entries = {k: callable_at(address(k.function, ""), FRAME) for k in (STEPS, CORRECTED)}
        code = MachineCode(evaluate, derive, entries)
    except NotCompiled as reason:
        _log.info("steps are taken without compiled code: %s", reason)
    _known[loops.evaluate] = code
    return code


# --- functions that a user gave ---------------------------------------------------------------


def compiled_equations(curve: Any, params: Mapping[str, float]) -> Loops | None:
    """The equations of a problem whose functions can be compiled, checked at its start; None where
    they cannot, with the reason as a message of the logger, once."""
    problem, free, start = curve.problem, curve.free, curve.start
    names = (*problem.params,)
    slopes = curve.jacobian(start)  # by then it is known how derivatives are to be taken
    scalar = np.ndim(problem.residual(start[: curve.size].copy(), curve.params(start))) == 0
    slots = tuple(names.index(name) for name in free)
    jacobian = problem.jacobian if callable(problem.jacobian) else None  # or a pattern
    functions = _functions(problem.residual, jacobian, names, curve.size, slots, scalar)
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
    code = callable_at(compiler.compiled_address(function, EQUATIONS), EQUATIONS)
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
            compiler.compiled_address(function, EQUATIONS)
    except (NotCompiled, ImportError) as reason:
        _log.info("steps are taken without compiled code: %s", reason)
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
    entry = njit((lambda value, i, k: value) if scalar else (lambda value, i, k: value[i]))
    slope = njit(lambda value, i, k: value[i][k])
    put = njit(_put(njit(residual), (n, 1, 1), entry, record))
    column = njit(_column(put, len(names), n, slots))
    given = jacobian and _put(njit(jacobian), (n, n, width), slope, record)
    rows = njit(given or (lambda x, data, out: 0))

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


def _put(function: Any, shape: tuple[int, int, int], entry: Any, record: Any) -> Callable[..., int]:
    """Fill in the values of a function at x and data, so many rows and columns of an array of so
    many columns; 1 where it raises."""
    n, columns, width = shape

    def put(x: Any, data: Any, out: Any) -> int:
        try:
            value = function(x, record(data))
        except Exception:  # noqa: BLE001 - numba knows no others
            return 1
        for i in range(n):
            for k in range(columns):
                out[i * width + k] = entry(value, i, k)
        return 0

    return put


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

    carray: Any = numba.carray  # type: ignore[attr-defined]
    fields = np.dtype([(name, float) for name in names])
    as_record = compiler.pointer_to(numba.from_dtype(fields))

    def record(where: Any) -> Any:
        return carray(as_record(where), 1)[0]

    return numba.njit(record)
