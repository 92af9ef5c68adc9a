"""Who takes plain steps: `stride`, as it is or compiled, on the equations of one curve."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
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


class _Text:
    """A text of `stride` on the equations of a curve, as it is, or compiled once that pays; what
    follows `d` in its arguments are `arrays`, and those of a call."""

    def __init__(self, name: str, loops: Loops, d: int, arrays: Sequence[Array]) -> None:
        self.name, self.loops, self.d, self.arrays = name, loops, d, arrays
        self.data = np.array(loops.data)
        self.code: Callable[..., int] | None = None

    def is_compiled(self) -> bool:
        """Whether machine code is called, which is looked for here."""
        known = None if self.code else machine(self.loops)
        if known is not None:
            self.code = partial(known[self.name], self.data.ctypes.data, self.d)
            self.at = [array.ctypes.data for array in self.arrays]
        return self.code is not None

    def __call__(self, *most: int, out: tuple[Array, ...] = ()) -> int:
        if self.is_compiled() and self.code is not None:
            return self.code(*most, *self.at, *(array.ctypes.data for array in out))
        loops, arrays = self.loops, (*self.arrays, *out)
        lists = [array.ravel().tolist() for array in arrays]
        given = loops.evaluate, loops.derive, self.data.tolist(), self.d
        try:
            with _timed(loops.evaluate):
                status: int = getattr(plain, self.name)(*given, *most, *lists)
        except ArithmeticError:  # an overflow, where compiled code goes on with an infinity
            return plain.LOOK
        for array, values in zip(arrays, lists, strict=True):
            array.reshape(-1)[:] = values
        return status


class Strider:
    """Takes the plain steps of one walk.

    Attributes
    ----------
    state : ndarray
        After a stretch: arclength, the size to try next, the sign of the bordered determinant, the
        longest step so far, and the residual.
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
        fixed = [np.array([*rules, len(bounds), *edges]), metric, np.concatenate(origin)]
        self.state = np.zeros(5)
        self.moving = [np.zeros(d) for _ in range(3)]  # z, tangent, bend
        self.bend = self.moving[2]
        scratch = [*np.zeros((3, d)), *np.zeros((3, 3 * d * d))]
        self.text = _Text("stride", loops, d, [*fixed, self.state, *self.moving, *scratch])

    def go(
        self, moving: Sequence[Array], state: Sequence[float], most: int
    ) -> tuple[Array, Array, Array, Array]:
        """As many plain steps as come off, at most so many: their z, tangents, arclengths and
        residuals; `moving` are z, tangent and bend, `state` arclength, size, side, longest step."""
        for mine, given in zip(self.moving, moving, strict=True):
            mine[:] = given
        self.state[:4] = state
        most = min(most, _AT_ONCE if self.text.is_compiled() else _AS_IT_IS)
        d, out = self.d, np.empty((most, 2 * self.d + 2))
        rows = out[: max(self.text(most, out=(out,)), 0)].copy()
        return rows[:, :d], rows[:, d : 2 * d], rows[:, -2], rows[:, -1]


class Settler:
    """Solves for single points of a curve."""

    def __init__(self, loops: Loops, metric: Array) -> None:
        d = metric.size
        self.rules, self.state = np.zeros(1), np.zeros(5)
        self.own = [np.zeros(d) for _ in range(4)]  # across, slope, there, ahead
        arrays = [self.rules, metric, self.state, *self.own, *np.zeros((3, 3 * d * d))]
        self.text = _Text("settle", loops, d, arrays)

    def settled(
        self, guess: Array, across: Array, slope: Array, tolerance: float
    ) -> tuple[Array, Array, float, int] | None:
        """The point in the plane across a vector, its tangent on the side of another, the residual
        and how many iterations it took; None where the walker's own solvers have to do."""
        self.rules[plain.TOLERANCE] = tolerance
        for mine, given in zip(self.own, (across, slope, guess), strict=False):
            mine[:] = given
        iterations = self.text()
        if iterations < 0:
            return None
        residual = float(self.state[plain.RESIDUAL])
        return self.own[2].copy(), self.own[3].copy(), residual, iterations


# Texts by name, to be called from `data` on: the functions of the problem are bound to them.
Machine = Mapping[str, Callable[..., int]]
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
    """Both texts with the functions of a problem in machine code, None where it does not pay yet or
    cannot be had."""
    evaluate = loops.evaluate
    if evaluate in _known:
        return _known[evaluate]
    texts: dict[str, Any] = {
        "stride": (plain.stride, plain.KINDS),
        "settle": (plain.settle, plain.SETTLING),
    }
    functions = (evaluate, "ppp"), (loops.derive, "ppp")
    if not (loops.at_once or _eager):
        if sum(_spent.values()) < _LOADING:
            return None
        paid = _spent.get(evaluate, 0.0) >= _COMPILING
        if not (paid or all(native.is_kept(*part) for part in (*texts.values(), *functions))):
            return None
    try:
        calls = {name: native.function(*text) for name, text in texts.items()}
        at = [native.address(*function) for function in functions]
        _known[evaluate] = {name: partial(call, *at) for name, call in calls.items()}
    except native.NotCompiled as reason:
        _log.info("steps are taken without compiled code: %s", reason)
        _known[evaluate] = None
    return _known[evaluate]
