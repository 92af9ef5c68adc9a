"""Who takes plain steps: `stride`, as it is or compiled, on the equations of one curve."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import native
from . import stride as plain

Array = NDArray[np.float64]

WIDEST = 13  # entries of z: beyond a dozen unknowns LAPACK is faster than loops
_AT_ONCE = 256  # steps in one call of compiled code
_AS_IT_IS = 16  # and of plain text, after each of which a signal is seen
# Code is loaded, and compiled where it is not kept, once steps have taken as long without, in
# seconds: so no call takes more than twice the time it needs.
_LOADING = 0.0 if native.workers_process() else 0.05
_COMPILING = 3.0

_stride: Callable[..., int] = plain.stride
_settle: Callable[..., int] = plain.settle
_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Loops:
    """The equations of a curve as functions for `stride`.

    Attributes
    ----------
    evaluate, derive : callable
        ``(z, data, out) -> int``: fill in the equations, or their derivatives row by row; 0, or
        anything else where there are none. In the words of `native`.
    data : tuple of float
        What they ask for besides z.
    at_once : bool
        Whether to compile them at their first step, whatever it takes.
    """

    evaluate: Callable[[Any, Any, Any], int]
    derive: Callable[[Any, Any, Any], int]
    data: tuple[float, ...]
    at_once: bool = False


Compilable = Callable[[tuple[str, ...], Mapping[str, float]], Loops | None]


class Strider:
    """Takes the plain steps of one walk.

    Attributes
    ----------
    size, side, longest : float
        After a stretch: the size to try next, the sign of the bordered determinant, and the longest
        step so far.
    bend : ndarray
        How the tangent turns at its end, by arclength.
    """

    def __init__(
        self,
        loops: Loops,
        rules: Sequence[float],
        bounds: Sequence[tuple[int, float, float]],
        metric: Array,
        origin: tuple[Array, Array],
    ) -> None:
        d = metric.size
        self.loops, self.d = loops, d
        edges = [entry for bound in bounds for entry in bound]
        self.fixed = [np.array([*rules, len(bounds), *edges]), metric, np.concatenate(origin)]
        self.data = np.array(loops.data)
        self.state = np.zeros(5)
        self.moving = [np.zeros(d) for _ in range(3)]  # z, tangent, bend
        self.scratch = [np.zeros(d), np.zeros(d), np.zeros(d), *np.zeros((3, 3 * d * d))]
        self.out = np.zeros((_AT_ONCE, 2 * d + 2))
        self.call: Callable[..., int] | None = None

    def go(
        self,
        z: Array,
        tangent: Array,
        bend: Array,
        state: tuple[float, float, float, float],
        most: int,
    ) -> tuple[Array, Array, Array, Array]:
        """As many plain steps as come off, at most so many: their z, tangents, arclengths and
        residuals; `state` is arclength, size, side and longest step."""
        for mine, given in zip(self.moving, (z, tangent, bend), strict=True):
            mine[:] = given
        self.state[:4] = state
        self.call = self.call or self._compiled()
        if self.call is None:
            count = self._as_it_is(min(most, _AS_IT_IS))
        else:
            count = self.call(min(most, _AT_ONCE))
        d, rows = self.d, self.out[:count].copy()
        return rows[:, :d], rows[:, d : 2 * d], rows[:, -2], rows[:, -1]

    @property
    def size(self) -> float:
        return float(self.state[plain.SIZE])

    @property
    def side(self) -> int:
        return int(self.state[plain.SIDE])

    @property
    def longest(self) -> float:
        return float(self.state[plain.LONGEST])

    @property
    def bend(self) -> Array:
        return self.moving[2].copy()

    def _as_it_is(self, most: int) -> int:
        loops = self.loops
        lists = [array.tolist() for array in (*self.fixed, self.state, *self.moving, *self.scratch)]
        out = [0.0] * (most * (2 * self.d + 2))
        data = self.data.tolist()
        try:
            with _timed(loops.evaluate):
                count = _stride(loops.evaluate, loops.derive, data, self.d, most, *lists, out)
        except ArithmeticError:  # an overflow, where compiled code goes on with an infinity
            return 0
        for array, values in zip((self.state, *self.moving), lists[3:7], strict=True):
            array[:] = values
        self.out.reshape(-1)[: len(out)] = out
        return count

    def _compiled(self) -> Callable[[int], int] | None:
        """A call of compiled code for this walk, where that is at hand or has to be."""
        known = machine(self.loops)
        if known is None:
            return None
        arrays = [self.data, *self.fixed, self.state, *self.moving, *self.scratch, self.out]
        at = [array.ctypes.data for array in arrays]
        both = known.evaluate, known.derive
        return lambda most: known.stride(*both, at[0], self.d, most, *at[1:])


class Settler:
    """Solves for single points of a curve."""

    def __init__(self, loops: Loops, metric: Array) -> None:
        d = metric.size
        self.loops, self.d, self.metric = loops, d, metric
        self.data, self.rules, self.state = np.array(loops.data), np.zeros(1), np.zeros(5)
        self.own = [np.zeros(d) for _ in range(4)]  # across, slope, there, ahead
        self.scratch = [*np.zeros((3, 3 * d * d))]
        self.call: Callable[[], int] | None = None

    def settled(
        self, guess: Array, across: Array, slope: Array, tolerance: float
    ) -> tuple[Array, Array, float, int] | None:
        """The point in the plane across a vector, its tangent on the side of another, the residual
        and how many iterations it took; None where the walker's own solvers have to do."""
        self.rules[plain.TOLERANCE] = tolerance
        for mine, given in zip(self.own, (across, slope, guess), strict=False):
            mine[:] = given
        self.call = self.call or self._compiled()
        iterations = self._as_it_is() if self.call is None else self.call()
        if iterations < 0:
            return None
        residual = float(self.state[plain.RESIDUAL])
        return self.own[2].copy(), self.own[3].copy(), residual, iterations

    def _arrays(self) -> list[Array]:
        return [self.data, self.rules, self.metric, self.state, *self.own, *self.scratch]

    def _as_it_is(self) -> int:
        data, *lists = [array.tolist() for array in self._arrays()]
        loops = self.loops
        try:
            with _timed(loops.evaluate):
                status = _settle(loops.evaluate, loops.derive, data, self.d, *lists)
        except ArithmeticError:  # an overflow, where compiled code goes on with an infinity
            return plain.LOOK
        self.state[:], self.own[2][:], self.own[3][:] = lists[2], lists[5], lists[6]
        return status

    def _compiled(self) -> Callable[[], int] | None:
        known = machine(self.loops)
        if known is None:
            return None
        data, *others = [array.ctypes.data for array in self._arrays()]
        return lambda: known.settle(known.evaluate, known.derive, data, self.d, *others)


@dataclass(frozen=True)
class Machine:
    """Machine code: two functions to call, and where those of the problem are."""

    stride: Callable[..., int]
    settle: Callable[..., int]
    evaluate: int
    derive: int


_spent: dict[Any, float] = {}  # seconds without code, by equations
_known: dict[Any, Machine | None] = {}


_eager: list[bool] = []  # not empty where everything is compiled at once


@contextmanager
def eagerly() -> Iterator[None]:
    """Compile all that steps use at once within a block, whatever it takes."""
    _eager.append(True)
    try:
        yield
    finally:
        _eager.pop()


def compiled() -> int:
    """Of how many sets of equations machine code is at hand in this session."""
    return sum(known is not None for known in _known.values())


@contextmanager
def _timed(equations: Any) -> Iterator[None]:
    start = time.perf_counter()
    try:
        yield
    finally:
        _spent[equations] = _spent.get(equations, 0.0) + time.perf_counter() - start


def machine(loops: Loops) -> Machine | None:
    """Both texts and both functions of a problem in machine code, None where it does not pay yet or
    cannot be had."""
    evaluate, derive = loops.evaluate, loops.derive
    if evaluate in _known:
        return _known[evaluate]
    texts = (plain.stride, plain.KINDS), (plain.settle, plain.SETTLING)
    functions = (evaluate, "ppp"), (derive, "ppp")
    if not (loops.at_once or _eager):
        if sum(_spent.values()) < _LOADING:
            return None
        paid = _spent.get(evaluate, 0.0) >= _COMPILING
        if not (paid or all(native.is_kept(*part) for part in (*texts, *functions))):
            return None
    try:
        calls, at = [native.function(*t) for t in texts], [native.address(*f) for f in functions]
        _known[evaluate] = Machine(calls[0], calls[1], at[0], at[1])
    except native.NotCompiled as reason:
        _log.info("steps are taken without compiled code: %s", reason)
        _known[evaluate] = None
    return _known[evaluate]
