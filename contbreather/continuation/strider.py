"""Who takes plain steps: `stride`, as it is or compiled, on the equations of one curve."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import kernels
from . import stride as plain

Array = NDArray[np.float64]

WIDEST = 13  # entries of z: beyond a dozen unknowns LAPACK is faster than loops
_AT_ONCE = 256  # steps in one call of compiled code
_AS_IT_IS = 16  # and of plain text, after each of which a signal is seen

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Loops:
    """The equations of a curve as functions for `stride`.

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


class _Text:
    """A text of `stride` on the equations of a curve, as it is or compiled; what
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
_known: dict[Any, Machine | None] = {}


def machine(loops: Loops) -> Machine | None:
    """Both texts with the functions of a problem in machine code, None where there is none."""
    evaluate = loops.evaluate
    if evaluate not in _known:
        _known[evaluate] = _machine(loops)
    return _known[evaluate]


def _machine(loops: Loops) -> Machine | None:
    texts: dict[str, Any] = {
        "stride": (plain.stride, plain.KINDS),
        "settle": (plain.settle, plain.SETTLING),
    }
    if loops.at_once:
        from ..compiler import address
    else:
        address = kernels.address
    try:
        at = [address(function, "ppp") for function in (loops.evaluate, loops.derive)]
        called = {
            name: kernels.callable_at(address(*text), text[1]) for name, text in texts.items()
        }
    except kernels.NotCompiled as reason:
        _log.info("steps are taken without compiled code: %s", reason)
        return None
    return {name: partial(call, *at) for name, call in called.items()}
