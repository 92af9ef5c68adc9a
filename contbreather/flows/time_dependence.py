"""Whether functions of the time have the period that was given: orbits are false where not."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from typing import Any

import numpy as np

from ..continuation.newton import Array, Undefined
from ..errors import BadInput
from .collocation import TrajectorySegment
from .flow import (
    Clock,
    Flow,
    Function,
    Params,
    at_state,
    check_function,
    slopes,
    undecorated,
    values,
)

_LOOKS = 16  # states and times at which a function is compared
_GOLDEN = (math.sqrt(5) - 1) / 2  # no part of a period, so that no switching lies there
_SAME = 1e-6  # relative to the size of a function: a period of seven digits is one
_FLOOR = 1e-4  # of the size of the states: a function that is smaller may be made of rounding
_MOVED = 0.01  # how far parameters are moved, relative
_MOMENTS = np.array([0.0, 0.7, 1.9])  # at which a field without a period is compared


def refuse_false_period(
    flows: Sequence[Flow],
    flights: Sequence[TrajectorySegment],
    period: Function | None,
    p: Params,
    names: tuple[str, ...] = (),
) -> None:
    """Refuse functions that do not have the period along an orbit; with names, not when these
    parameters move, one by one and together."""
    names = tuple(name for name in names if name in p)
    for moved in dict.fromkeys([(), *((name,) for name in names), names]):
        at = {**p, **{name: p[name] + _MOVED * (abs(p[name]) or 1.0) for name in moved}}
        with suppress(Undefined):  # the parameter was moved out of a domain
            what = next(_unlike(flows, flights, period, at), None)
            if what is None:
                continue
            if period is None:
                raise BadInput(f"{what} depends on t: say period=, which is that of the forcing")
            if moved:
                raise BadInput(
                    f"the period of {what} changes with {', '.join(moved)}, period= does not as "
                    f"it should: give a function, as period=lambda p: 2*np.pi/p[{moved[0]!r}]"
                )
            raise BadInput(
                f"{what} is not periodic in t with the period {period_at(period, p):g}: give that "
                "of the forcing, a number or a function, as period=lambda p: 2*np.pi/p['w']"
            )


def refuse_period(flows: Sequence[Flow], flights: Sequence[TrajectorySegment], p: Params) -> None:
    """Refuse a period where nothing asks for the time along an orbit, kicks by a clock aside."""
    kicked = any(isinstance(flow.until, Clock) or (flow.reset and not flow.until) for flow in flows)
    moved = {name: value + _MOVED * (abs(value) or 1.0) for name, value in p.items()}
    if not kicked and not any(
        _asks_time(function, x, at)
        for flow, flight in zip(flows, flights, strict=True)
        for function in flow.functions.values()
        for x in flight.at((np.arange(_LOOKS) + 0.5) / _LOOKS).T
        for at in (p, moved)  # what a parameter switches off may be switched on by the next
    ):
        raise BadInput(
            "the system does not depend on time, its period is unknown: leave `period=` out"
        )


class _Unasked:
    """A time that may be shifted, as by differences, and vanish in a product with zero: whatever
    does more with it asks for it."""

    __array_ufunc__ = None  # arrays leave sums and products to it

    def __add__(self, other: Any) -> _Unasked:
        return self

    __radd__ = __sub__ = __add__

    def __mul__(self, other: Any) -> Any:
        if np.any(other):
            raise TypeError("the time is asked for")
        return other

    __rmul__ = __mul__


def _asks_time(function: Function, x: Array, p: Params) -> bool:
    """Whether a function does anything with its time, which is none here."""
    try:
        np.asarray(undecorated(function)(_Unasked(), x, p), dtype=float)
    except Exception:  # noqa: BLE001 - what is done with it may raise anything
        return True
    return False


def _unlike(
    flows: Sequence[Flow], flights: Sequence[TrajectorySegment], period: Function | None, p: Params
) -> Iterator[str]:
    """The functions that are not the same a period later; without one, at another time."""
    whole = sum(flight.duration for flight in flights)
    later = _GOLDEN * whole if period is None else period_at(period, p)
    least = _FLOOR * max(float(abs(flight.states).max()) for flight in flights)
    for i, (flow, flight) in enumerate(zip(flows, flights, strict=True)):
        x = flight.at((np.arange(_LOOKS) + 0.5) / _LOOKS)
        t = flight.start + whole * (_GOLDEN * np.arange(1, _LOOKS + 1) % 1)
        for name, function in flow.functions.items():
            if isinstance(function, Clock):
                continue
            now, then = values(function, t, x, p), values(function, t + later, x, p)
            if _same(now, then, least):
                continue
            if name == "f" and period is not None and _mirrored(flow, flight, t, x, p, later, now):
                continue
            yield name if len({*flows}) == 1 else f"{name} of flow {i}"


def _mirrored(
    flow: Flow, flight: TrajectorySegment, t: Any, x: Array, p: Params, later: float, now: Array
) -> bool:
    """Half of a symmetric orbit has half of the period, after which f is its mirror image."""
    if flow.reset is None:
        return False
    n, end = len(x), flight.end[:, None]
    if flow.until is None:  # the reset is the mirror
        mirror = slopes(flow.reset, flight.last, end, p)[1][:, :n, 0]
        return _same(mirror @ now, values(flow.f, t + later, mirror @ x, p))
    after = values(flow.reset, flight.last, end, p)  # beside an impact -x, which the wall tells
    turned = after.shape == end.shape and np.isclose(after, -end, rtol=_SAME, atol=0)[end != 0]
    unknown = not flight.slopes.any()  # a start alone is beside no impact
    return (unknown or bool(np.any(turned))) and _same(-now, values(flow.f, t + later, -x, p))


def _same(now: Array, then: Array, least: float = 0.0) -> bool:
    """NaN, outside of a domain, says nothing."""
    with np.errstate(invalid="ignore"):
        off = abs(then - now)
    size = np.maximum(np.nanmax(abs(now), axis=1, initial=0.0), least)[:, None]
    return not (off > _SAME * size).any()


def period_at(period: Function, params: Params) -> float:
    """The period at these parameters, or what is wrong with it."""
    check_function("period", period, (), 0.0, np.zeros(1), params)
    length = float(at_state(period, 0.0, np.zeros(1), params)[0])
    if not length > 0:
        raise BadInput(f"the period is {length}; a positive time was expected")
    return length


def refuse_time(f: Function, t: float, x: Array, p: Params, names: tuple[str, ...] = ()) -> None:
    """Refuse a field that depends on the time, beside a state and parameters."""
    names = tuple(name for name in names if name in p)
    at = np.repeat(x[:, None], _MOMENTS.size, axis=1)
    with suppress(Undefined), np.errstate(invalid="ignore"):
        value, slope = slopes(f, t + _MOMENTS, at, p, names)
        # of x cos t the value is zero at the origin, and that of p cos t where p = 0; of the sign
        # of cos t it is the slopes
        whole = np.concatenate([slope, value[:, None]], axis=1)
        off = abs(whole - whole[..., :1])
        off[:, x.size] = abs(slope[:, x.size])
        if (off > _SAME * np.nanmax(abs(whole), initial=0.0)).any():
            raise BadInput(
                "f depends on t: say period=, which is that of the forcing (cb.cycle(..., "
                "period=); a forced system has no equilibria)"
            )
