"""The motion from which a cycle sets out: what a simulation repeats, or samples of an orbit."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from ..checks import brief, number, numbers
from ..continuation.algebra.newton import Array, Undefined
from ..errors import BadInput, NotConverged
from .collocation import AT_REST
from .flow import Filippov, Flow, contact_of, slid_along
from .functions import Params, values
from .integrate import NeverMet, TooManySteps, Trajectory, integrate, root
from .rotation import Angles
from .rounds import RETURNS

_BACK = 0.1  # of its size: an orbit that comes back no closer than this is none
_ALIKE = 1e-3  # within this of its size all returns are as good
_CLEAR = 100  # periods of the forcing within which a condition is met, or not at all
_WAIT = 100.0  # how long a return is waited for at first, where no time to settle was given

Run = Callable[..., Trajectory]
Begin = tuple[float, Array, int]  # time, state and flow
Motion = tuple[Callable[[Array], Array], float, float]  # states at times, from when to when


def simulated_orbit(
    flows: Any, alone: Flow | None, params: Params, start: tuple[float, Array],
    length: float | None, settle: float, angles: Angles,
) -> tuple[tuple[Flow, ...], list[Motion]]:  # fmt: skip
    """Simulate from a time and a state until it has settled, and then what repeats itself."""
    run, size = partial(_run, flows, params, []), float(abs(start[1]).max())
    t, state, first = _settled(run, start[1], length, start[0], settle)
    begin = t, state - angles.turns(state), first
    if alone is None:
        wait: dict[str, float] = {} if length is None else {"time": _CLEAR * length}
        try:
            ran = run(x0=begin[1], t0=t, first=first, events=1, **wait)
        except NeverMet:
            pass
        else:
            if ran.events:
                return _hybrid(run, begin, length, RETURNS if settle else 1, angles)
            begin = t + wait["time"], ran.final - angles.turns(ran.final), first
        alone = _clear_of(flows, first)
        guards = [values(g, begin[0], begin[1][:, None], params) for g in alone.guards.values()]
        if any((guard < 0).any() for guard in guards):
            raise NotConverged(
                f"the motion of flow {first} does not come to its end any more, and is behind the "
                "condition of another flow with its field: give this to flow "
                f"{first} as one of its walls, and start where it is not met"
            )
        run = partial(_run, (alone,), params, [])
    if length is not None:
        return (alone,), [_forced(alone, run, begin, length, RETURNS if settle else 1, angles)]
    return (alone,), [_smooth(alone, run, params, begin, settle or _WAIT, size, angles)]


def _run(flows: Any, params: Params, stiff: list[str], **how: Any) -> Trajectory:
    """Simulate, stiff systems by an implicit method, from when they are known to be on; a run that
    leaves the domain of its functions finds no orbit."""
    run = partial(integrate, flows, params=params, tolerance=1e-9, **how)  # Newton does the rest
    try:
        if not stiff:
            with suppress(TooManySteps):
                return run(steps=10_000)
            stiff.append("LSODA")  # an explicit method takes too many steps
        return run(method=stiff[0])
    except Undefined as error:
        raise NotConverged(f"no periodic orbit was found from there: {error}") from error


def _settled(run: Run, state: Array, length: float | None, t0: float, settle: float) -> Begin:
    """Simulate for the time to settle, a whole number of periods."""
    settle = number("settle", settle, 0.0, 1e300, "how long to simulate")
    if length is not None:
        settle = math.ceil(settle / length - 1e-9) * length  # whole periods stay as many
    if not settle:
        return t0, state, 0
    ran = run(x0=state, time=settle, t0=t0)
    last = ran.pieces[-1]
    if not ran.events:
        return t0 + settle, ran.final, last.number
    if length is None:
        moved = settle * values(last.flow.f, t0 + settle, ran.final[:, None], ran.params)[:, 0]
        alike = [piece.x for piece in ran.pieces if len(piece.x) == moved.size]
        if (abs(moved) <= AT_REST * abs(np.hstack(alike)).max(axis=1)).all():  # each in its unit
            refuse_rest(0 * moved, ran.final, 0.0, slides=slid_along(last.flow) is not None)
    # its end may be just where the flow ends, too; what is blind is so from its beginning on
    share = 0.5 if last.flow.ignored(ran.params) == 0.0 else 0.0
    again = float((1 - share) * last.t[0] + share * last.t[-1])
    return again, last(again), last.number


def _clear_of(flows: Any, first: int) -> Flow:
    """Make a flow that nothing ends of one whose condition is not met, which is a wall of it, as
    those of others are that have its field."""
    if isinstance(flows, Filippov):
        flow = flows.flows[first]
        if slid_along(flow):
            raise NotConverged(
                "the motion along the surface does not leave it: give the field that it has there, "
                "of one state less"
            )
        walls = [contact_of(flow, flow)]
    else:
        flow, pairs = flows[first], zip(flows, [*flows[1:], flows[0]], strict=True)
        walls = [contact_of(*pair) for pair in pairs if pair[0].f == flow.f]
    return replace(flow, until=None, reset=None, ignore=0.0).walled(walls)


def _hybrid(
    run: Run, begin: Begin, length: float | None, most: int, angles: Angles
) -> tuple[tuple[Flow, ...], list[Motion]]:
    """Return the last pieces of a simulation after which it repeats itself: what repels has left
    it after as many as one that has yet to settle needs, and goes anywhere."""
    t, state, first = begin
    ran = run(x0=state, t0=t, first=first, events=2 * most)
    last = ran.events[-1]
    size = max(float(abs(event.after).max()) for event in ran.events) or 1.0
    returns = []
    for back in range(1, most + 1):
        event = ran.events[-1 - back]
        # the same flow ended there, in a state of the same kind
        if (event.number, event.after.shape) != (last.number, last.after.shape):
            continue
        moved = last.after - event.after
        off = float(abs(moved - angles.turns(moved)).max()) / size
        if length is not None:
            # of a forced system only whole numbers of periods are returns
            turned = (last.time - event.time) / length
            off = max(off, abs(turned - round(turned))) if round(turned) else math.inf
        returns.append((off, back))
    if most < RETURNS and not any(off <= _ALIKE for off, _ in returns):
        return _hybrid(run, begin, length, 2 * most, angles)
    back = _first_close(returns, ran)
    pieces = ran.pieces[-back:]
    *others, ending = (piece.flow for piece in pieces)
    ending = angles.taken_from(ending, last.after - ran.events[-1 - back].after)
    return (*others, ending), [(p, float(p.t[0]), float(p.t[-1])) for p in pieces]


def _first_close(returns: Sequence[tuple[float, Any]], ran: Trajectory) -> Any:
    """Choose the first return that is nearly as close as the closest of all."""
    least = min((off for off, _ in returns), default=math.inf)
    if not returns:
        begin, end = (brief(x.tolist()) for x in (ran.pieces[0].x[:, 0], ran.final))
        raise NotConverged(
            f"the simulation does not return: its state goes from {begin} to {end} at "
            f"t = {ran.pieces[-1].t[-1]:.4g}; a state that is an angle is named with its turn, "
            "wraps={'theta': 2*np.pi}"
        )
    if not least <= _BACK:
        raise NotConverged(
            f"the simulation does not return: within {len(returns)} times around it comes back to "
            f"{least:.2g} of its size, at t = {ran.pieces[-1].t[-1]:.4g}; let it settle longer "
            "(settle=), or start closer to the orbit",
            residual=least,
        )
    return next(what for off, what in returns if off <= max(3 * least, _ALIKE))


def _forced(flow: Flow, run: Run, begin: Begin, length: float, most: int, angles: Angles) -> Motion:
    """Simulate periods of the forcing, as many as a motion takes that has settled. One where it has
    not, as in chaos: which orbit is near is Newton's to find."""
    t0, state, _ = begin
    ran, first, periods = run(x0=state, time=most * length, t0=t0), state[:, None], 1
    if flow.reset is None:  # else it is half of a symmetric orbit, or a rotation
        times = t0 + length * np.arange(1, most + 1)
        moved, states = (x - angles.turns(x - first) for x in (ran(times), ran.x))
        # up to each return: what runs away would dwarf how far off the first ones are
        extent = np.maximum.accumulate(states, axis=1) - np.minimum.accumulate(states, axis=1)
        swing = extent[:, np.searchsorted(ran.t, times, side="right") - 1].max(axis=0)
        off = abs(moved - first).max(axis=0) / np.where(swing, swing, 1.0)
        strides = abs(np.diff(moved, prepend=first)).max(axis=0)
        if off.min() <= _ALIKE:
            periods += int((off <= max(3 * off.min(), _ALIKE)).argmax())
        # what leaves an orbit that repels from beside it is slow against its size
        elif most > 1 and strides[0] > _BACK * abs(state).max() and (np.diff(strides) > 0).all():
            left, end = (brief([float(f"{of:.3g}") for of in x]) for x in (state, moved[:, -1]))
            raise NotConverged(
                f"the simulation runs away, ever faster: its state goes from {left} to {end} in "
                f"{most} periods; let it settle longer (settle=), or start elsewhere"
            )
    return ran, t0, t0 + length * periods


def _smooth(
    flow: Flow, run: Run, params: Params, begin: Begin, settle: float, size: float, angles: Angles
) -> Motion:
    """Simulate from a plane across the flow back to it."""
    t0, state, _ = begin
    for wait in np.multiply(settle, (1, 3, 9, 27)):
        ran = run(x0=state, time=float(wait), t0=t0)
        t0, state = t0 + float(wait), ran.final  # if it was not settled yet
        # what is slow has time to settle that is as long
        moved = values(flow.f, t0, state[:, None], params)[:, 0] * max(1.0, wait / _WAIT)
        refuse_rest(moved, state, size)
        returns = _returns(flow, ran, params, angles)
        if min((off for off, _ in returns), default=math.inf) <= _BACK:
            break
    return ran, float(ran.t[0]), float(_first_close(returns, ran))


def _returns(
    flow: Flow, ran: Trajectory, params: Params, angles: Angles
) -> list[tuple[float, float]]:
    """Find the returns to the plane through the start across its velocity: how far off the start
    they are, in the size of the orbit, and when."""
    begin, state = ran.t[0], ran.x[:, :1]
    speed = values(flow.f, begin, state, params)[:, 0]

    def image(t: Array) -> Array:
        x = ran(t) if flow.reset is None else values(flow.reset, t, ran(t), params)
        return np.asarray(x - angles.turns(x - state))

    def behind(t: Array) -> Array:
        return np.asarray(speed @ (state - image(t)))

    orbit = image(ran.t)
    size = float(np.ptp(orbit, axis=1).max()) or 1.0
    off = speed @ (state - orbit)
    off[0] = 0.0  # in the first step it is on its way out
    fallen = np.flatnonzero((off[:-1] > 0) & (off[1:] <= 0))
    times = [root(behind, ran.t[j], ran.t[j + 1]) for j in fallen]
    return [(float(abs(image(np.array([t])) - state).max()) / size, t) for t in times]


def refuse_rest(moved: Array, state: Array, size: float, *, slides: bool = False) -> None:
    """Refuse an equilibrium, by its speed or its extent; beside 0 only the size of what came
    before tells how small is none."""
    size = max(size, float(abs(state).max()))
    if float(abs(moved).max()) <= AT_REST * size:
        place = [float(f"{x:.6g}") if abs(x) > AT_REST * size else 0.0 for x in state.tolist()]
        kind, more = "an equilibrium", "cb.equilibrium continues it"
        if slides:
            kind, more = "a pseudo-equilibrium", "the motion along the surface comes to rest there"
        raise NotConverged(
            f"there is {kind} at {brief(place)}, not a cycle: {more}; start elsewhere for a cycle"
        )


def sampled_orbit(
    flow: Flow | None, samples: tuple[Any, Any], params: Params
) -> tuple[Flow, list[Motion], tuple[str, ...]]:
    """Interpolate samples of one period of a flow that nothing ends."""
    from scipy.interpolate import CubicSpline

    if flow is None:
        raise BadInput("samples (t, x) are taken of one flow without `until`; start from a state")
    if len(samples) != 2:
        raise BadInput(f"samples are given as (t, x); got {len(samples)} arrays")
    t, x = numbers("t", samples[0]), np.atleast_2d(numbers("x", samples[1]))
    if t.ndim != 1 or t.size < 4 or x.shape[1:] != t.shape or not (np.diff(t) > 0).all():
        raise BadInput(
            f"samples of shapes {t.shape} and {x.shape}: increasing times (m,) and states (n, m) "
            "were expected, m at least 4"
        )
    flow.check(float(t[0]), x[:, 0], params)
    whole = CubicSpline(t, x, axis=1), float(t[0]), float(t[-1])
    return flow, [whole], tuple(f"x{i}" for i in range(1, len(x) + 1))
