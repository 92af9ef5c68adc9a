"""Refusal of a period that functions of the time do not have: the orbits would be false."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress

import numpy as np

from ..continuation.algebra.newton import Array, Undefined
from ..errors import BadInput
from .flow import Clock, Flow, Function, Params, at_state, check_function, offset, slopes, values

_GOLDEN = (math.sqrt(5) - 1) / 2  # no part of a period, so that no switching lies there


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
    t = later * (_GOLDEN * i % 1)
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
