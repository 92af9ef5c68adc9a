"""Problems of a few unknowns whose equations are machine code: many steps in one call of `step`."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .. import kernels
from ..kernels import FRAME, Kernel
from .step import CORRECTED, STEPS, TAKEN, Equations, Here, Rules

Array = NDArray[np.float64]

_AT_ONCE = 256  # steps in one call of compiled code
_AS_IT_IS = 16  # and of plain text, after each of which a signal is seen

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Loops:
    """The equations of a curve as functions for `step`.

    Attributes
    ----------
    evaluate, derive : callable
        ``(z, data, out) -> int``: fill in the equations, or their derivatives row by row; 0, or
        anything else where there are none. In the words of `kernels`.
    data : tuple of float
        What they ask for besides z.
    at_once : bool
        Whether to compile them for this session: functions that a user gave.
    """

    evaluate: Callable[[Any, Any, Any], int]
    derive: Callable[[Any, Any, Any], int]
    data: tuple[float, ...]
    at_once: bool = False


class MachineCode(NamedTuple):
    """Addresses of the functions of a problem, and the kernels by machine code."""

    evaluate: int
    derive: int
    code: Mapping[Kernel, Callable[..., int]]


class _Kernels:
    """The kernels on the equations of one curve, as they are or by machine code."""

    def __init__(self, loops: Loops, metric: Array) -> None:
        d, self.machine = metric.size, machine(loops)
        evaluate: Any = self.machine.evaluate if self.machine else loops.evaluate
        derive: Any = self.machine.derive if self.machine else loops.derive
        value, flat = np.zeros((2, 3 * d * d))
        matrix, data = flat[: d * d].reshape(d, d), np.array(loops.data)
        self.eq = Equations(evaluate, derive, data, metric, value, flat, matrix, np.zeros(d))

    def call(self, kernel: Kernel, *values: Any) -> None:
        if self.machine is not None:
            kernel.run(self.machine.code[kernel], (self.eq, *values))
        else:
            kernel.as_it_is(self.eq, *values)


class ManySteps:
    """Steps of one walk, many in one call.

    Attributes
    ----------
    state : ndarray
        After a call: arclength, the size to try next, the sign of the bordered determinant, the
        longest step so far.
    here : Here
        Where it ended.
    """

    def __init__(
        self,
        loops: Loops,
        sizes: tuple[float, float, float, float],
        bounds: Sequence[tuple[int, float, float]],
        metric: Array,
        plane: tuple[Array, Array],
    ) -> None:
        self.loops, self.kernels = loops, _Kernels(loops, metric)
        slots = np.array([slot for slot, _, _ in bounds], dtype=np.int64)
        low, high = (np.array([bound[i] for bound in bounds], dtype=float) for i in (1, 2))
        self.rules = Rules(*sizes, slots, low, high, *plane)
        self.here, self.state = Here(*np.zeros((6, metric.size))), np.zeros(4)

    def take(
        self, start: Sequence[Array], state: Sequence[float], most: int
    ) -> tuple[Array, Array, Array, Array]:
        """As many steps as come off, at most so many: their z, tangents, arclengths and residuals;
        from z, tangent and its bend, and the state there."""
        for buffer, entries in zip(self.here, start, strict=False):
            buffer[:] = entries
        self.state[:] = state
        d, count = self.here.z.size, np.zeros(1, dtype=np.int64)
        out = np.empty((min(most, _AT_ONCE if self.kernels.machine else _AS_IT_IS), 2 * d + 2))
        with suppress(ArithmeticError, ValueError):  # where machine code goes on with an infinity
            self.kernels.call(STEPS, self.rules, self.here, self.state, out, count)
        rows = out[: count[0]].copy()
        return rows[:, :d], rows[:, d : 2 * d], rows[:, -2], rows[:, -1]


class Corrector:
    """Solves for single points of a curve."""

    def __init__(self, loops: Loops, metric: Array) -> None:
        self.kernels, self.here = _Kernels(loops, metric), Here(*np.zeros((6, metric.size)))
        self.answer = np.zeros(3)

    def corrected(
        self, guess: Array, across: Array, slope: Array, tolerance: float
    ) -> tuple[Array, Array, float, int] | None:
        """The point in the plane across a vector, its tangent on the side of another, the residual
        and how many iterations it took; None where the solvers of the curve have to do."""
        here = self.here
        here.there[:] = guess
        try:
            self.kernels.call(CORRECTED, tolerance, across, slope, here, self.answer)
        except (ArithmeticError, ValueError):
            return None
        status, iterations, residual = self.answer.tolist()
        if status != TAKEN:
            return None
        return here.there.copy(), here.ahead.copy(), residual, int(iterations)


_known: dict[Any, MachineCode | None] = {}


def machine(loops: Loops) -> MachineCode | None:
    """Machine code of a problem and of the kernels, None where there is none."""
    evaluate = loops.evaluate
    if evaluate not in _known:
        _known[evaluate] = _machine(loops)
    return _known[evaluate]


def _machine(loops: Loops) -> MachineCode | None:
    if loops.at_once:
        from ..compiler import address
    else:
        address = kernels.address
    try:
        evaluate, derive = address(loops.evaluate, "ppp"), address(loops.derive, "ppp")
        code = {
            kernel: kernels.callable_at(address(kernel.function, ""), FRAME)
            for kernel in (STEPS, CORRECTED)
        }
    except kernels.NotCompiled as reason:
        _log.info("steps are taken without compiled code: %s", reason)
        return None
    return MachineCode(evaluate, derive, code)
