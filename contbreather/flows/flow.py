"""Flows as users bring them: a vector field, the condition that ends it and a reset; two fields
with sliding between them; and the refusal of a period that their functions do not have."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..checks import brief, number, numbers
from ..continuation.algebra.newton import Array, Undefined
from ..errors import BadInput
from .functions import (
    Function,
    Params,
    at_state,
    check_function,
    offset,
    place,
    rows_of,
    slopes,
    undecorated,
    values,
)
from .jacobian import FieldWithJacobian, over_mass

# Central differences of order 8, exact for polynomials of degree 8: of h along a field, where no
# complex step can be taken because the state may be complex already.
STENCIL = ((1, 4 / 5), (2, -1 / 5), (3, 4 / 105), (4, -1 / 280))
_PLUS, _MINUS, _TO_PLUS, _TO_MINUS = range(4)
_GOLDEN = (math.sqrt(5) - 1) / 2  # no part of a period, so that no switching lies there


Wall = Function | tuple["Flow", ...]  # a function, or the flows of an orbit that meets it


@dataclass(frozen=True)
class Clock:
    """Condition ``(t, x, p)`` that ends a flow at a part of the period of a certain number."""

    part: float | Callable[[Any], Any]
    period: float | Callable[[Any], Any] | None = None
    number: int = 0

    def __call__(self, t: Any, x: Any, p: Params) -> Any:
        # falls with slope -1
        return (self.number + value_at(self.part, p)) * value_at(self.period, p) - t

    def since(self, t: Any, x: Any, p: Params) -> Any:
        """Return the time since it struck before."""
        return value_at(self.period, p) - self(t, x, p)

    def after(self, t: float, p: Params) -> float:
        """Return the time at which it strikes next."""
        part, period = value_at(self.part, p), value_at(self.period, p)
        return float((math.floor(t / period - part + 1e-9) + 1 + part) * period)


def value_at(value: Any, p: Params) -> Any:
    """Evaluate a number, or a function of the parameters."""
    return value(p) if callable(value) else value


def value_over(value: Any, t: Any, x: Any, p: Params) -> Any:
    return value_at(value, p)


@dataclass(frozen=True)
class Flow:
    """A vector field, the condition that ends it, and a reset: one piece of a periodic orbit.

    All functions are written ``f(t, x, p)`` as for `scipy.integrate.solve_ivp`: `t` is a number or
    an array of m of them, `x` an array of shape (n,) or (n, m), that is m states at once, `p` a
    dict of parameters. A list is returned as it is written down, ``[x[1], -1.0]``; constants in it
    are broadcast. What cannot take m states at once (an ``if`` on a state, `math.sin`) is called
    state by state, which is slower. Derivatives are taken by complex steps, exact to rounding,
    where a function is analytic, and by differences elsewhere; nothing is to be done for it.

    Parameters
    ----------
    f : callable
        ``f(t, x, p) -> dx/dt``, as many entries as `x`.
    until : callable, optional
        ``until(t, x, p) -> number``: positive inside, the flow ends where it falls through zero.
        Without it the flow ends with the period.
    reset : callable, optional
        ``reset(t, x, p) -> state`` in which the next flow begins; where it ends without it. With
        ``until=None`` and a mirror as reset, ``lambda t, x, p: [-x[0], -x[1]]``, this is half of a
        symmetric orbit.
    at : float or callable, optional
        A part of the period of the forcing, or ``at(p)``, in place of `until`: the flow ends
        whenever a clock that strikes once a period does so. 0 is the time 0, and each period later.
    ignore : float or callable, optional
        How long after the beginning of the flow, or ``ignore(p)``, `until` does not count: a foot
        that scuffs the ground in the middle of its step.
    walls : tuple of callable or Flow, optional
        Further functions that must stay positive inside, as `until` does. In place of one the flow
        that ends at it, by `until` with a `reset`, or a list of two, there and back as at a
        compliant stop: so `switch` knows how an orbit goes on that touches it.
    mass : array_like, shape (n, n), optional
        Constant mass matrix M of ``M dx/dt = f(t, x, p)``; it must be regular.
    jacobian : callable or pattern, optional
        ``jacobian(t, x, p)``, the derivative of `f` in x: shape (n, n), dense or from scipy.sparse,
        and of a dense one (n, n, m) at m states. Or which of its entries may differ from zero, as
        an array, dense or from scipy.sparse: states that share no equation are then moved at once.
        Checked once against differences.

    Raises
    ------
    BadInput
        Where something is no function, the mass matrix is singular, or the jacobian is wrong.

    Examples
    --------
    >>> fall = Flow(lambda t, x, p: [x[1], -1.0], until=lambda t, x, p: x[0],
    ...             reset=lambda t, x, p: [x[0], -p["e"] * x[1]])
    >>> fall.check(0.0, [1.0, 0.0], {"e": 0.8})
    """

    f: Function
    until: Function | None = None
    reset: Function | None = None
    walls: Any = ()  # then a tuple of Wall
    mass: Any = None
    at: float | Callable[[Any], Any] | None = None
    jacobian: Any = None
    ignore: float | Callable[[Any], Any] = 0.0

    def __post_init__(self) -> None:
        keep = partial(object.__setattr__, self)
        alone = callable(self.walls) or isinstance(self.walls, Flow)
        walls = (self.walls,) if alone else self.walls
        if not isinstance(walls, tuple | list):
            raise BadInput(f"walls must be a tuple of functions or flows, got {brief(walls)}")
        keep("walls", tuple(map(_wall, walls)))
        if self.at is not None:
            if self.until is not None:
                raise BadInput("a flow ends by `until`, or `at` a part of the period: not by both")
            keep("until", Clock(self.at if callable(self.at) else float(numbers("at", self.at))))
            keep("at", None)  # it is in until now
        if self.ignore != 0.0:
            if self.until is None or isinstance(self.until, Clock):
                raise BadInput("ignore= is how long `until` does not count: the flow has none")
            if not callable(self.ignore):
                number("ignore", self.ignore, 0.0, 1e300, "a time, or a function of p")
        for name in ("f", "until", "reset"):
            keep(name, undecorated(getattr(self, name)))
        for name, function in self.functions.items():
            if not callable(function):
                raise BadInput(f"{name} must be a function of (t, x, p), got {brief(function)}")
        if self.jacobian is not None:
            keep("f", FieldWithJacobian.of(self.f, self.jacobian))
        if self.mass is not None:
            keep("f", over_mass(_inverse(self.mass), self.f))
        for name in ("jacobian", "mass"):
            keep(name, None)  # they are in f now

    @property
    def guards(self) -> dict[str, Function]:
        """Conditions that must stay positive inside, by name."""
        walls = {f"walls[{i}]": _guard(wall) for i, wall in enumerate(self.walls)}
        return ({"until": self.until} if self.until else {}) | walls

    @property
    def functions(self) -> dict[str, Function]:
        """Field, guards and reset, by name."""
        return {"f": self.f, **self.guards} | ({"reset": self.reset} if self.reset else {})

    def ignored(self, p: Params) -> Any:
        """Evaluate how long `until` does not count."""
        return value_at(self.ignore, p)

    def walled(self, walls: Iterable[Wall]) -> Flow:
        """Add walls, but for those it has."""
        had = [*self.guards.values()]
        return replace(self, walls=(*self.walls, *(w for w in walls if _guard(w) not in had)))

    def meets(self, flow: Flow) -> bool:
        """Tell whether another flow is given as one of its walls."""
        return any(not callable(wall) and wall[0].until == flow.until for wall in self.walls)

    def exchanged(self, flow: Flow) -> Flow:
        """Return another flow, which is one of its walls, with itself as one in its place."""
        own = replace(self, walls=())
        return replace(
            flow, walls=[own if _guard(wall) == flow.until else wall for wall in self.walls]
        )

    def timed(self, period: float | Callable[[Any], Any] | None) -> Flow:
        """Give its clock, and those of its walls, the period of which they strike a part."""
        clock = self.until
        if isinstance(clock, Clock) and clock.period is None:
            if period is None:
                raise BadInput("a flow ends `at` a part of the period; period= was not given")
            clock = replace(clock, period=period)
        walls = (w if callable(w) else tuple(flow.timed(period) for flow in w) for w in self.walls)
        return replace(self, until=clock, walls=tuple(walls))

    def struck(self, t: float, p: Params) -> Flow:
        """Set the clock to the period in which it strikes at a time."""
        if not isinstance(clock := self.until, Clock):
            return self
        number = round(t / value_at(clock.period, p) - value_at(clock.part, p))
        return replace(self, until=replace(clock, number=number))

    def later(self, periods: int) -> Flow:
        """Set the clock so many periods later."""
        if not isinstance(clock := self.until, Clock):
            return self
        return replace(self, until=replace(clock, number=clock.number + periods))

    def check(self, t: float, x: Any, p: Params) -> None:
        """Refuse, with a sentence, functions that do not fit a state: shapes, names, NaN.

        The size of what `reset` returns is up to the flow that follows.
        """
        x = numbers("the state", x)
        if x.ndim != 1 or not x.size:
            raise BadInput(f"a state is a row of numbers; an array of shape {x.shape} was given")
        check_function("f", self.f, (x.size,), float(t), x, p)
        if isinstance(self.f, FieldWithJacobian):
            self.f.check(float(t), x, p)
        for name, guard in self.guards.items():
            check_function(name, guard, (), float(t), x, p)
        if self.reset is not None:
            check_function("reset", self.reset, None, float(t), x, p)


def _wall(wall: Any) -> Wall:
    """Make a tuple of the flows of an orbit that meets a wall; of a function nothing is known."""
    flows = tuple(wall) if isinstance(wall, tuple | list) else (wall,)
    if not flows or not all(isinstance(flow, Flow) for flow in flows):
        return undecorated(wall)
    if len(flows) != (1 if flows[0].reset else 2) or not all(flow.until for flow in flows):
        raise BadInput(
            "a wall is met by a flow with `until` and `reset`, or by two with `until` alone: up to "
            f"it and behind it; got {brief(wall)}"
        )
    if isinstance(flows[0].until, Clock) and flows[0].until.period is None:
        raise BadInput(
            "a clock is no wall: it strikes whatever the state is, and where a flow begins or ends "
            "as it does a branch ends by itself, CC"
        )
    return flows


def _guard(wall: Wall) -> Any:
    return wall[0].until if isinstance(wall, tuple) else wall


def _inverse(mass: Any) -> Array:
    matrix = numbers("the mass matrix", mass)
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1]:
        raise BadInput(f"a mass matrix is square; one of shape {matrix.shape} was given")
    if not np.linalg.cond(matrix) < 1e12:  # condition of a mass matrix: of 16 digits four are left
        raise BadInput(
            "the mass matrix is singular, or all but: the equations are differential-algebraic, "
            "which is not supported. Solve the algebraic ones for their unknowns inside f."
        )
    return np.asarray(np.linalg.inv(matrix))


# --- whole turns of angles, taken back where a flow ends ------------------------------------------


@dataclass(frozen=True, eq=False)
class TurnedBack:
    """Reset that takes whole turns back, after another one."""

    turns: Array  # shape (n,)
    reset: Function | None
    whole: Array | float = math.inf  # a single turn of each state that is an angle, where known

    @property
    def single(self) -> Array:
        """A single turn of each state of which some are taken back, 0 of others."""
        return np.minimum(abs(self.turns), self.whole)

    def __call__(self, t: Any, x: Any, p: Params) -> Any:
        evaluated = at_state if np.ndim(x) == 1 else values
        after = x if self.reset is None else evaluated(self.reset, t, x, p)
        return after - self.turns.reshape(-1, *[1] * (np.ndim(x) - 1))


def plain(flow: Flow) -> Flow:
    """Return a flow without the whole turns that it takes back."""
    reset = flow.reset
    return replace(flow, reset=reset.reset) if isinstance(reset, TurnedBack) else flow


# --- two vector fields and sliding along the surface between them (Filippov 1988) -----------------


@dataclass(frozen=True, eq=False)
class Filippov:
    """A system with two vector fields, one on each side of a surface, and sliding along it.

    Where both fields point at the surface h = 0 the motion stays in it, with the one velocity
    between theirs that is tangent to it,

        f_s = (L- f+  -  L+ f-) / (L- - L+),    L+- = dh/dt + grad h . f+-,    L+ < 0 < L-,

    and leaves it into h > 0 where L+ rises through zero, into h < 0 where L- falls through it.

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
            Flow(self.f_plus, until=partial(self._height, 1)),
            Flow(self.f_minus, until=partial(self._height, -1)),
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

    def _height(self, sign: int, t: Any, x: NDArray[Any], p: Params) -> Any:
        return sign * self.h(t, x, p)

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
        for k, weight in STENCIL:
            ahead = self.h(t + k * step, x + k * step * field, p)
            total = total + weight * (ahead - self.h(t - k * step, x - k * step * field, p))
        return total / step

    def facing(self, flow: Flow) -> Any:
        """Speed at which the other side's field points at the surface: not, where it is crossed."""
        return (self.to_minus if flow == self.plus else self.to_plus).until

    # --- what `integrate` asks: a mode is a flow, but on which side sliding ends is known there

    def begin(self, t: float, x: Array, p: Params, first: int = _PLUS) -> int:
        for name, shape in {"f_plus": (x.size,), "f_minus": (x.size,), "h": ()}.items():
            check_function(name, getattr(self, name), shape, t, x, p)
        h = float(self.h(t, x, p))
        # of the surface, relative to the state: a motion along it may have been known less exactly
        if abs(h) > (1e-8 if slid_along(self.flows[first]) else 1e-12) * (1 + abs(x).max()):
            return _PLUS if h > 0 else _MINUS
        return self._from_surface(t, x, p)

    def follow(
        self, mode: int, guard: int, t: float, x: Array, p: Params
    ) -> tuple[int, int, Array]:
        # what rounding puts to one side goes back onto the surface: x - grad h h / |grad h|^2
        h, slope = slopes(self.h, t, x[:, None], p)
        gradient = slope[0, :-1, 0]
        x = x - gradient * (h[0, 0] / (gradient @ gradient))
        if mode in (_PLUS, _MINUS):
            return mode, self._from_surface(t, x, p, arriving=mode), x
        return (_TO_PLUS, _TO_MINUS)[guard], (_PLUS, _MINUS)[guard], x

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


def system_of(flow: Flow) -> Filippov | None:
    """The Filippov system that a flow is one of, if it is."""
    system = getattr(getattr(flow.until, "func", None), "__self__", None)
    return system if isinstance(system, Filippov) and plain(flow) in system.flows else None


def slid_along(flow: Flow) -> Filippov | None:
    """The system along whose surface a flow slides; None of any other flow."""
    system = system_of(flow)
    return system if system and flow.f == system.sliding else None


def contact_of(flow: Flow, following: Flow) -> tuple[Flow, ...]:
    """The flows of a contact that begins where a flow ends: its own reset, or the one that follows,
    which of a Filippov system is that along the surface."""
    system = None if slid_along(flow) else system_of(flow)
    if system:
        following = system.flows[system.flows.index(flow) + 2]
    return (flow,) if flow.reset else (flow, following)


def flow_between(before: Flow, after: Flow) -> Flow | None:
    """The flow that comes to be between two of a Filippov system at the edge of sliding: along the
    surface where it was crossed, on the other side where it was slid along."""
    if not (system := system_of(before)) or slid_along(before) or after not in system.flows:
        return None
    other = 1 - system.flows.index(before)
    slides = after == system.flows[other]
    return system.flows[other + 2 * slides] if slides or slid_along(after) else None


# --- whether functions of the time have the period: else the orbits would be false ----------------


def refuse_false_period(
    flows: Sequence[Flow],
    places: Sequence[Array],
    period: Function | None,
    p: Params,
    names: tuple[str, ...] = (),
) -> None:
    """Refuse functions that are not the same a period later, beside states of their flows, shape
    (n, m); without a period, at another time. With names, when these parameters move, too."""
    names = tuple(name for name in names if name in p)
    # a function that is smaller may be made of rounding
    least = 1e-4 * max(float(abs(x).max()) for x in places)
    for moved in dict.fromkeys([(), *((name,) for name in names), names]):
        at = {**p, **{name: p[name] + 0.01 * (abs(p[name]) or 1.0) for name in moved}}
        with suppress(Undefined):  # the parameter was moved out of a domain
            later = 2 * _GOLDEN if period is None else period_at(period, at)
            for i, (flow, x) in enumerate(zip(flows, places, strict=True)):
                for name, function in flow.functions.items():
                    if isinstance(function, Clock) or _repeats(flow, function, x, at, later, least):
                        continue
                    what = name if len({*flows}) == 1 else f"{name} of flow {i}"
                    raise BadInput(_refusal(what, period, p, moved))


def _repeats(
    flow: Flow, function: Function, x: Array, p: Params, later: float, least: float
) -> bool:
    """Compare f(t + T) with f(t); half of a symmetric orbit has half of the period, after which f
    is its mirror image."""
    i = np.arange(16)  # times at which functions are compared
    t = later * (_GOLDEN * (i + 0.5) % 1)  # not 0, where waves of a drive jump
    x = np.take(x, i * x.shape[1] // i.size, axis=1)
    x = x + offset(x)[:, None]  # at the origin x cos t vanishes
    now = values(function, t, x, p)
    if _same(now, values(function, t + later, x, p), least):
        return True
    if function is not flow.f or flow.until or not flow.reset:
        return False
    mirror = slopes(flow.reset, t, x, p)[1][:, : len(x), 0]
    return _same(mirror @ now, values(function, t + later, mirror @ x, p))


def _same(now: Array, then: Array, least: float = 0.0) -> bool:
    """Compare rows of values; NaN, outside of a domain, says nothing."""
    size = np.maximum(np.nanmax(abs(now), axis=1, initial=0.0), least)[:, None]
    return not (abs(then - now) > 1e-6 * size).any()  # a period of seven digits is one


def _refusal(what: str, period: Function | None, p: Params, moved: tuple[str, ...]) -> str:
    if period is None:
        return (
            f"{what} depends on t: say period=, which is that of the forcing (cb.cycle(..., "
            "period=); a forced system has no equilibria)"
        )
    if moved:
        return (
            f"the period of {what} changes with {', '.join(moved)}, period= does not as it "
            f"should: give a function, as period=lambda p: 2*np.pi/p[{moved[0]!r}]"
        )
    return (
        f"{what} is not periodic in t with the period {period_at(period, p):g}: give that of the "
        "forcing, a number or a function, as period=lambda p: 2*np.pi/p['w']"
    )


def period_at(period: Function, params: Params) -> float:
    """Return the period at these parameters, or refuse it."""
    check_function("period", period, (), 0.0, np.zeros(1), params)
    length = float(at_state(period, 0.0, np.zeros(1), params)[0])
    if not length > 0:
        raise BadInput(f"the period is {length}; a positive time was expected")
    return length
