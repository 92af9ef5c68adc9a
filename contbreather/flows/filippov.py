"""Two vector fields and the surface between them, with sliding along it (Filippov 1988).

Where both fields point at the surface h = 0 the motion stays in it, with the one velocity between
theirs that is tangent to it,

    f_s = (L- f+  -  L+ f-) / (L- - L+),    L+- = dh/dt + grad h . f+-,    L+ < 0 < L-,

and leaves it into h > 0 where L+ rises through zero, into h < 0 where L- falls through it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..checks import brief
from ..continuation.algebra.newton import Array
from ..errors import BadInput
from .flow import Flow, Function, Params, check_function, place, rows_of, slopes, undecorated

# Central differences of order 8, exact for polynomials of degree 8: of h along a field, where no
# complex step can be taken because the state may be complex already.
_STENCIL = ((1, 4 / 5), (2, -1 / 5), (3, 4 / 105), (4, -1 / 280))
_PLUS, _MINUS, _TO_PLUS, _TO_MINUS = range(4)


@dataclass(frozen=True, eq=False)
class Filippov:
    """A system with two vector fields, one on each side of a surface, and sliding along it.

    `integrate` follows it, and the flows of its pieces are what a cycle is made of: `plus` and
    `minus` on the two sides, `to_plus` and `to_minus` along the surface up to where that side is
    entered. So stick-slip and relay orbits are cycles of these four flows.

    Parameters
    ----------
    f_plus, f_minus : callable
        Vector fields ``f(t, x, p)`` as for `Flow`, for h > 0 and for h < 0.
    h : callable
        ``h(t, x, p) -> number``; the surface is where it is zero.

    Raises
    ------
    BadInput
        Where something is no function; by `integrate` where a state lies on the surface between
        fields that both point away from it, so that it has more than one future.

    Examples
    --------
    A relay that pushes back is at rest on the surface after a finite time:

    >>> from contbreather.flows import integrate
    >>> relay = Filippov(lambda t, x, p: [-p["u"]], lambda t, x, p: [p["u"]], lambda t, x, p: x[0])
    >>> run = integrate(relay, {"y": 1.0}, {"u": 0.5}, time=3.0)
    >>> [round(event.time, 12) for event in run.events], run.final.tolist()
    ([2.0], [0.0])
    >>> run.flows == (relay.plus, relay.to_plus)
    True
    """

    f_plus: Function
    f_minus: Function
    h: Function

    def __post_init__(self) -> None:
        for name in ("f_plus", "f_minus", "h"):
            if not callable(function := getattr(self, name)):
                raise BadInput(f"{name} must be a function of (t, x, p), got {brief(function)}")
            object.__setattr__(self, name, undecorated(function))  # they are asked inside of others

    @cached_property
    def flows(self) -> tuple[Flow, Flow, Flow, Flow]:
        """`plus`, `minus`, `to_plus` and `to_minus`."""
        leaves = {sign: partial(self._inwards, sign) for sign in (1, -1)}
        return (
            Flow(self.f_plus, until=self.h),
            Flow(self.f_minus, until=self._below),
            Flow(self.sliding, until=leaves[1], walls=(leaves[-1],)),
            Flow(self.sliding, until=leaves[-1], walls=(leaves[1],)),
        )

    plus = property(lambda self: self.flows[_PLUS], doc="In h > 0, up to the surface.")
    minus = property(lambda self: self.flows[_MINUS], doc="In h < 0, up to the surface.")
    to_plus = property(lambda self: self.flows[_TO_PLUS], doc="Along it, until f_plus leaves.")
    to_minus = property(lambda self: self.flows[_TO_MINUS], doc="Along it, until f_minus leaves.")

    def sliding(self, t: Any, x: NDArray[Any], p: Params) -> NDArray[Any]:
        """The velocity along the surface, between those of both sides."""
        up, down = self._fields(t, x, p)
        rise, fall = self._along(up, t, x, p), self._along(down, t, x, p)
        return np.asarray((fall * up - rise * down) / (fall - rise))

    def _fields(self, t: Any, x: NDArray[Any], p: Params) -> tuple[NDArray[Any], NDArray[Any]]:
        return rows_of(self.f_plus(t, x, p), x), rows_of(self.f_minus(t, x, p), x)

    def _below(self, t: Any, x: NDArray[Any], p: Params) -> Any:
        return -self.h(t, x, p)

    def _inwards(self, sign: int, t: Any, x: NDArray[Any], p: Params) -> Any:
        """Rate at which the field of a side points at the surface: ``-L+`` or ``L-``."""
        field = self._fields(t, x, p)[0 if sign > 0 else 1]
        return -sign * self._along(field, t, x, p)

    def _along(self, field: NDArray[Any], t: Any, x: NDArray[Any], p: Params) -> Any:
        """dh/dt + grad h . field."""
        size, speed = np.maximum(1.0, abs(x.real).max(axis=0)), abs(field.real).max(axis=0)
        # x moves by 0.01 of its size at most: 1e-16 of truncation, 1e-14 of rounding
        step = 0.01 * size / np.maximum(speed, size)
        total = 0.0
        for k, weight in _STENCIL:
            ahead = self.h(t + k * step, x + k * step * field, p)
            total = total + weight * (ahead - self.h(t - k * step, x - k * step * field, p))
        return total / step

    # --- what `integrate` asks: a mode is a flow, but that sliding ends on either side

    def begin(self, t: float, x: Array, p: Params) -> int:
        for name, shape in {"f_plus": (x.size,), "f_minus": (x.size,), "h": ()}.items():
            check_function(name, getattr(self, name), shape, t, x, p)
        h = float(self.h(t, x, p))
        if abs(h) > 1e-12 * (1 + abs(x).max()):  # of the surface, relative to the state
            return _PLUS if h > 0 else _MINUS
        return self._from_surface(t, x, p)

    def ended(self, mode: int, guard: int) -> int:
        """Tell the four flows apart, now that it is known how sliding ended."""
        return mode if mode in (_PLUS, _MINUS) else (_TO_PLUS, _TO_MINUS)[guard]

    def follow(self, mode: int, guard: int, t: float, x: Array, p: Params) -> tuple[int, Array]:
        x = self._on_surface(t, x, p)
        if mode in (_PLUS, _MINUS):
            return self._from_surface(t, x, p, arriving=mode), x
        return (_PLUS, _MINUS)[guard], x

    def _from_surface(self, t: float, x: Array, p: Params, arriving: int | None = None) -> int:
        """Through the surface, along it, or away from it."""
        rise, fall = (float(self._along(field, t, x, p)) for field in self._fields(t, x, p))
        # what arrives points at the surface, where it grazes but for rounding
        rise = -math.inf if arriving == _PLUS else rise
        fall = math.inf if arriving == _MINUS else fall
        if rise > 0 > fall:
            raise BadInput(
                f"{place(t, x)} both fields point away from the surface (dh/dt = {rise:.3g} above, "
                f"{fall:.3g} below): start on one side of it"
            )
        if rise < 0 < fall:
            return _TO_PLUS  # L+ < 0 < L-: both fields point at the surface
        return _PLUS if rise + fall > 0 else _MINUS

    def _on_surface(self, t: float, x: Array, p: Params) -> Array:
        """Take off the rounding that would put it to one side."""
        h, slope = slopes(self.h, t, x[:, None], p)
        gradient = slope[0, :-1, 0]
        return x - gradient * (h[0, 0] / (gradient @ gradient))  # x - grad h h/|grad h|^2


def slid_along(flow: Flow) -> Filippov | None:
    """The system along whose surface a flow slides; None of any other flow."""
    f: Any = flow.f
    return f.__self__ if getattr(f, "__func__", None) is Filippov.sliding else None
