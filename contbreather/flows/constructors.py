"""Where cycles come from: a simulation, samples of an orbit, the Hopf point of an equilibrium."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from ..checks import check_kind, number, numbers, shown
from ..continuation.curve import Curve
from ..continuation.equilibria import branch_point, fold, hopf
from ..continuation.lift import Lift
from ..continuation.newton import Array, Undefined
from ..continuation.point import Counting, Event, Point
from ..continuation.problem import Problem
from ..continuation.segment import tangent_at
from ..errors import BadInput, NotConverged
from .collocation import Collocation, Flight, fitted
from .cycle_events import doubled, events_of
from .equations import Equations, named, sizes_of
from .flow import Flow, Function, Params, slopes, values
from .integrate import Trajectory, integrate
from .orbit import problem_of

_RETURNS = 24  # so many flows back is looked for a return
_BACK = 0.1  # of its size: an orbit that comes back no closer than this is none
_NEARLY = 3.0  # the first return that is nearly as close as the closest is the period
_CLOSE = 1e-3  # of the size: all returns this close are as good
_AT_REST = 1e-6  # a speed, or an extent, this small against its size is none
_WAIT = 100.0  # how long a return is waited for at first, where no time to settle was given
_SAMPLES = 8  # looks into each step of a simulation for a return
_AMPLITUDES = (1e-2, 3e-3, 1e-3, 1e-4)  # of a first cycle beside a Hopf point, in its size


def cycle(
    flows: Flow | Function | Sequence[Flow],
    start: Mapping[str, float] | tuple[Any, Any],
    params: Mapping[str, float],
    *,
    period: float | Callable[[Params], float] | None = None,
    t0: float = 0.0,
    settle: float = 0.0,
    collocation: Collocation | None = None,
    events: Iterable[Event] | None = None,
    label: str = "",
) -> Problem:
    """A periodic orbit of a smooth, forced or hybrid system as a problem to trace.

    Simulated from a state until it has settled, then closed by Newton's iteration: the orbit need
    not be stable if the start is close to it and `settle` is short.

    Parameters
    ----------
    flows : callable, Flow, sequence of Flow or Filippov
        ``f(t, x, p) -> dx/dt``, or flows that follow each other. One without `until` is a limit
        cycle or, with `period`, a forced response; with a mirror as `reset` the half of a
        symmetric one.
    start : dict or tuple of arrays
        Name and value of each state; or samples ``(t, x)``, shapes (m,) and (n, m), of one period
        of a smooth orbit.
    params : dict
        Name and value of each parameter.
    period : float or callable, optional
        Of the forcing, a number or ``period(p)``. The orbit may take several of them, as the
        simulation tells. Without it nothing may depend on the time, and the period is unknown.
    t0 : float
        The time of the start.
    settle : float
        How long to simulate before a periodic orbit is expected.
    collocation : Collocation, optional
        Intervals and points, ``Collocation(intervals=20, points=6)`` by default.
    events : iterable of Event, optional
        What a walk looks for by default: LP, BP, PD and NS, and where flows have conditions or
        walls VI (an impact loses its velocity) and GR (a wall is touched in between).
    label : str, optional
        Shown in tables.

    Returns
    -------
    Problem
        ``point.solution`` is a `Cycle`. Columns are ``period``, ``unstable`` (multipliers outside
        of the unit circle), ``max(x)`` and ``min(x)`` of each state, ``trivial`` (how far that
        multiplier is off 1) of autonomous ones.

    Raises
    ------
    BadInput
        Where functions do not fit the states, or names clash.
    NotConverged
        Where no periodic orbit is found: the simulation runs to an equilibrium, does not return,
        or Newton's iteration fails.

    Examples
    --------
    >>> import contbreather as cb
    >>> oscillator = cb.cycle(lambda t, x, p: [x[1], p["mu"] * (1 - x[0]**2) * x[1] - x[0]],
    ...                       start={"x": 2.0, "v": 0.0}, params={"mu": 1.0}, settle=50)
    >>> round(oscillator.start["period"], 9)
    6.663286859
    """
    if isinstance(start, tuple):
        flights, parts, names = _sampled(flows, start, params, collocation or Collocation())
        forcing = _period(period)
    else:
        state, params, names = _state(start), _params(params), tuple(start)
        named(names, params)
        forcing, run = _period(period), partial(integrate, flows, params=params)
        settled = _settled(run, state, forcing, params, t0, settle)
        parts, pieces = _once_around(flows, run, settled, forcing, params, settle)
        flights = _fits(pieces, collocation or Collocation(), forcing, params)
    named(names, params)
    whole = sum(flight.duration for flight in flights)
    turns = 1 if forcing is None else max(1, round(whole / _length(forcing, params)))
    made = Equations(parts, flights, forcing, turns, names, sizes_of(flights))
    asked = None if events is None else tuple(events)
    return _closed(made, params, asked, label or "cycle")


def _params(params: Mapping[str, float]) -> dict[str, float]:
    check_kind(params, Mapping, "a dict of parameters")
    return {name: float(numbers(name, value)) for name, value in params.items()}


def _state(start: Mapping[str, float]) -> Array:
    check_kind(start, Mapping, "a dict with the name and value of each state, or samples (t, x),")
    return np.array([float(numbers(name, value)) for name, value in start.items()])


def _period(period: Any) -> Function | None:
    """The period as a function to differentiate, ``period(t, x, p)``."""
    if period is None:
        return None
    if callable(period):
        return lambda t, x, p: period(p)
    length = number(
        "period", period, 0.0, 1e300, "a positive time, or a function of the parameters"
    )
    if not length > 0:
        raise BadInput(f"period = {period}: a positive time was expected")
    return lambda t, x, p: length


def _length(period: Function, params: Params) -> float:
    found = float(values(period, 0.0, np.zeros((1, 1)), params)[0, 0])
    if not 0 < found < math.inf:
        raise BadInput(f"the period is {found}; a positive time was expected")
    return found


# --- from a simulation --------------------------------------------------------------------------


def _settled(
    run: Callable[..., Trajectory], state: Array, period: Function | None, params: Params,
    t0: float, settle: float,
) -> tuple[float, Array, int]:  # fmt: skip
    """Time, state and flow after the time to settle, a whole number of periods."""
    settle = number("settle", settle, 0.0, 1e9, "how long to simulate")
    if period is not None:
        length = _length(period, params)
        settle = math.ceil(settle / length - 1e-9) * length
    if not settle:
        return t0, state, 0
    ran = run(x0=state, time=settle, t0=t0)
    return t0 + settle, ran.final, ran.pieces[-1].number


def _once_around(
    flows: Any, run: Callable[..., Trajectory], at: tuple[float, Array, int],
    period: Function | None, params: Params, settle: float,
) -> tuple[tuple[Flow, ...], list[tuple[Any, float, float]]]:  # fmt: skip
    """The flows of a cycle and its pieces: motion, beginning and end of each."""
    listed = [flows] if isinstance(flows, Flow) or callable(flows) else flows
    alone = isinstance(listed, list | tuple) and len(listed) == 1
    flow = (listed[0] if isinstance(listed[0], Flow) else Flow(listed[0])) if alone else None
    if flow is not None and flow.until is None:
        t, state, _ = at
        if period is not None:
            length = _length(period, params)
            return (flow,), [(run(x0=state, time=length, t0=t), t, t + length)]
        return (flow,), [_returned(flow, run, t, state, params, settle)]
    if isinstance(listed, list | tuple):
        for i, one in enumerate(listed):
            if getattr(one, "until", None) is None:
                raise BadInput(
                    f"flow {i} of {len(listed)} has no `until`: nothing ends it before the next"
                )
    return _hybrid(run, at, period, params)


def _hybrid(
    run: Callable[..., Trajectory], at: tuple[float, Array, int], period: Function | None,
    params: Params,
) -> tuple[tuple[Flow, ...], list[tuple[Any, float, float]]]:  # fmt: skip
    """The last pieces of a simulation after which it repeats itself."""
    t, state, first = at
    ran = run(x0=state, events=2 * _RETURNS, t0=t, first=first)
    last, length = ran.events[-1], None if period is None else _length(period, params)
    size = max(float(abs(event.after).max()) for event in ran.events) or 1.0
    found = []
    for back in range(1, _RETURNS + 1):
        event = ran.events[-1 - back]
        # the same flow ended there, in a state of the same kind
        if ran.pieces[-1 - back].number != ran.pieces[-1].number:
            continue
        if event.after.shape != last.after.shape:
            continue
        off = float(abs(last.after - event.after).max()) / size
        if length is not None:
            turned = (last.time - event.time) / length
            off = max(off, abs(turned - round(turned))) if round(turned) else math.inf
        found.append((off, back))
    back = _first_close(found, ran)
    pieces = ran.pieces[-back:]
    return tuple(p.flow for p in pieces), [(p, float(p.t[0]), float(p.t[-1])) for p in pieces]


def _first_close(found: Sequence[tuple[float, Any]], ran: Trajectory) -> Any:
    """The first return that is nearly as close as the closest of all."""
    least = min((off for off, _ in found), default=math.inf)
    if not least <= _BACK:
        raise NotConverged(
            f"the simulation does not return: within {len(found)} times around it comes back to "
            f"{least:.2g} of its size, at t = {ran.pieces[-1].t[-1]:.4g}; let it settle longer "
            "(settle=), or start closer to the orbit",
            residual=least,
        )
    return next(what for off, what in found if off <= max(_NEARLY * least, _CLOSE))


def _returned(
    flow: Flow, run: Callable[..., Trajectory], t0: float, state: Array, params: Params,
    settle: float,
) -> tuple[Any, float, float]:  # fmt: skip
    """One period of a limit cycle, from a plane across the flow back to it."""
    speed = values(flow.f, t0, state[:, None], params)[:, 0]
    _refuse_rest(speed, state)
    wait = settle or _WAIT
    for _ in range(4):
        ran = run(x0=state, time=wait, t0=t0)
        found, size = _returns(flow, ran, state, speed, params)
        if found and min(off for off, _ in found) <= _BACK * size:
            found = [(off / size, t) for off, t in found]
            return ran, t0, float(_first_close(found, ran))
        _refuse_rest(values(flow.f, t0, ran.final[:, None], params)[:, 0], ran.final)
        wait *= 3
    return ran, t0, float(_first_close([(off / size, t) for off, t in found], ran))


def _returns(
    flow: Flow, ran: Trajectory, state: Array, speed: Array, params: Params
) -> tuple[list[tuple[float, float]], float]:
    """How far from its start it is, and when, each time a simulation comes back to the plane."""
    from scipy.optimize import brentq

    def back(t: Any) -> Array:
        x = ran(t)
        if flow.reset is None:
            return x
        return values(flow.reset, t, x.reshape(len(x), -1), params).reshape(x.shape)

    def ahead(t: Any) -> Any:
        return speed @ (back(t).T - state).T

    knots = ran.t
    inside = knots[:-1, None] + np.diff(knots)[:, None] * np.arange(_SAMPLES) / _SAMPLES
    times = np.append(inside.ravel(), knots[-1])
    orbit = back(times)
    passed = speed @ (orbit - state[:, None])
    found = []
    for j in np.flatnonzero((passed[:-1] < 0) & (passed[1:] >= 0)):
        t = float(brentq(ahead, times[j], times[j + 1], xtol=1e-13))
        found.append((float(abs(back(t) - state).max()), t))
    return found, float(np.ptp(orbit, axis=1).max()) or 1.0


def _refuse_rest(speed: Array, state: Array) -> None:
    if float(abs(speed).max()) <= _AT_REST * (1 + float(abs(state).max())):
        raise NotConverged(
            f"the simulation comes to rest at {shown(state.tolist())}: an equilibrium, not a "
            "cycle. cb.equilibrium continues it; start elsewhere for a cycle"
        )


def _fits(
    pieces: Sequence[tuple[Any, float, float]], collocation: Collocation,
    period: Function | None, params: Params,
) -> tuple[Flight, ...]:  # fmt: skip
    """Flights through the pieces of a simulation; a forced one begins in the first period."""
    check_kind(collocation, Collocation, "collocation=Collocation(intervals=, points=)")
    shift = pieces[0][1] if period is None else 0.0
    if period is not None:
        length = _length(period, params)
        shift = math.floor(pieces[0][1] / length + 1e-9) * length
    found = [fitted(collocation, a, b - a, motion) for motion, a, b in pieces]
    return _adapted([replace(flight, start=flight.start - shift) for flight in found])


def _adapted(flights: Sequence[Flight]) -> tuple[Flight, ...]:
    """The same on meshes that follow them."""
    return tuple(
        flight.adapted(size) for flight, size in zip(flights, sizes_of(flights), strict=True)
    )


def _sampled(
    flows: Any, samples: tuple[Any, Any], params: Params, collocation: Collocation
) -> tuple[tuple[Flight, ...], tuple[Flow, ...], tuple[str, ...]]:
    """The orbit through samples of one period."""
    from scipy.interpolate import CubicSpline

    listed = flows if isinstance(flows, list | tuple) else [flows]
    flow = listed[0] if isinstance(listed[0], Flow) else Flow(listed[0])
    if len(listed) > 1 or flow.until is not None:
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
    spline = CubicSpline(t, x, axis=1)
    flight = fitted(collocation, float(t[0]), float(t[-1] - t[0]), spline)
    return _adapted([flight]), (flow,), tuple(f"x{i}" for i in range(1, len(x) + 1))


def _closed(
    made: Equations, params: Params, events: tuple[Event, ...] | None, label: str
) -> Problem:
    """The problem with its orbit solved for, then once more on a mesh that follows it."""
    for _ in range(2):
        problem = _problem(made, params, events, label)
        try:
            solved, _found = problem.solve(tolerance=1e-10)
        except NotConverged as error:
            raise NotConverged(
                f"no periodic orbit was found from there: {error}", residual=error.residual
            ) from error
        flights = made.flights(solved.x, params)
        _refuse_point(flights)
        made = replace(
            made, start=_adapted(flights), sizes=sizes_of(flights), _recent=[], _linear=[]
        )
    return _problem(made, params, events, label).solve(tolerance=1e-12)[0]


def _problem(
    made: Equations, params: Params, events: tuple[Event, ...] | None, label: str
) -> Problem:
    asked = events_of(made) if events is None else events
    return problem_of(made, made.start, params, asked, {"PD": doubled}, label)


def _refuse_point(flights: Sequence[Flight]) -> None:
    states = np.concatenate([flight.sampled(2)[1].ravel() for flight in flights])
    extent = max(float(np.ptp(flight.sampled(2)[1], axis=1).max()) for flight in flights)
    if extent <= _AT_REST * (1 + float(abs(states).max())):
        raise NotConverged(
            f"what was found is an equilibrium, {shown(flights[0].states[:, 0].tolist())}, not a "
            "cycle: cb.equilibrium continues it; start elsewhere for a cycle"
        )


# --- equilibria, and the cycles that are born there ---------------------------------------------


def equilibrium(
    f: Flow | Function,
    start: Mapping[str, float],
    params: Mapping[str, float],
    *,
    events: Iterable[Event] | None = None,
    collocation: Collocation | None = None,
    label: str = "equilibrium",
) -> Problem:
    """Equilibria of ``dx/dt = f(t, x, p)``, which must not depend on t, as a problem to trace.

    Parameters
    ----------
    f : callable or Flow
    start : dict
        Name and value of each state, close to the equilibrium.
    params : dict
        Name and value of each parameter.
    events : iterable of Event, optional
        LP, BP and HB by default.
    collocation : Collocation, optional
        For the cycles that `switch` follows from a Hopf point.
    label : str, optional

    Returns
    -------
    Problem
        The column ``unstable`` counts the eigenvalues to the right of the imaginary axis.

    Examples
    --------
    >>> import contbreather as cb
    >>> rest = cb.equilibrium(lambda t, x, p: [p["mu"] * x[0] - x[1] - x[0] * (x[0]**2 + x[1]**2),
    ...                                        x[0] + p["mu"] * x[1] - x[1] * (x[0]**2 + x[1]**2)],
    ...                       start={"x": 0.0, "y": 0.0}, params={"mu": -0.5})
    >>> (cycles,) = cb.switch(cb.trace(rest, "mu", within={"mu": (-1, 1)}).first("HB"),
    ...                       within={"mu": (-1, 0.5)})
    >>> orbit = cycles[-1].solution
    >>> bool(abs(orbit.max["x"] - 0.5**0.5) < 1e-9)
    True
    """
    flow = f if isinstance(f, Flow) else Flow(f)
    state, params, names = _state(start), _params(params), tuple(start)
    named(names, params)
    flow.check(0.0, state, params)
    rest = _Rest(flow, names)
    return Problem(
        rest.residual, dict(start), params, derivatives=rest.derivatives,
        events=(fold(), branch_point(), hopf()) if events is None else tuple(events),
        record={"unstable": Counting(_unstable)},
        lifts={"HB": partial(_born, flow, names, collocation or Collocation())}, label=label,
    )  # fmt: skip


class _Rest:
    """``f(0, x, p) = 0``."""

    def __init__(self, flow: Flow, names: tuple[str, ...]) -> None:
        self.flow, self.names = flow, names

    def residual(self, x: Array, p: Params) -> Array:
        return np.asarray(values(self.flow.f, 0.0, x[:, None], p)[:, 0])

    def derivatives(self, x: Array, p: Params, names: tuple[str, ...]) -> Array:
        whole = slopes(self.flow.f, 0.0, x[:, None], p, names)[1][..., 0]
        return np.delete(whole, x.size, axis=1)  # the column of the time


def _unstable(point: Point) -> int:
    return int((point.curve.spectrum(point.z).real > 0).sum())


class _Born(Lift):
    """Small cycles beside a Hopf point: they leave it in the plane of its eigenvectors."""

    @cached_property
    def tangents(self) -> tuple[Array, None]:
        curve = Curve(self.problem, (self.free,))
        orbit = curve.start[curve.slots["orbit"]].reshape(-1, len(_equations(self.problem).states))
        outwards = np.zeros(curve.start.size)
        outwards[: orbit.size] = (orbit - orbit.mean(axis=0)).ravel()
        return tangent_at(curve, curve.start, outwards)[0], None


def _equations(problem: Problem) -> Equations:
    found: Equations = problem.residual.__self__  # type: ignore[attr-defined]
    return found


def _born(flow: Flow, names: tuple[str, ...], collocation: Collocation, point: Point) -> Lift:
    """The cycle of a small amplitude beside a Hopf point, and the direction in which they grow."""
    (free,), rest, params = point.curve.free, np.array(point.x), point.params
    omega = float(point["omega"])
    eigenvalues, vectors = np.linalg.eig(point.jacobian()[:, : rest.size])
    q = vectors[:, int(abs(eigenvalues - 1j * omega).argmin())]
    size = float(np.sqrt(np.mean(rest**2))) or 1.0
    period = 2 * math.pi / omega

    def wave(amplitude: float, t: Array) -> Array:
        turned = q[:, None] * np.exp(1j * omega * t)
        return np.asarray(rest[:, None] + amplitude * turned.real)

    for amplitude in _AMPLITUDES:
        flight = fitted(collocation, 0.0, period, partial(wave, amplitude * size))
        made = Equations((flow,), (flight,), None, 1, names, sizes_of([flight]))
        problem = _problem(made, params, None, "cycle")
        curve = Curve(problem, (free,))
        row = np.zeros(curve.start.size)
        row[: made.orbit] = (flight.states - rest[:, None]).T.ravel()
        try:
            found = curve.newton(curve.start, curve.dual(row), tolerance=1e-11, most=20)
        except Undefined:
            continue
        if found.converged:
            here = Point(curve, found.z)
            made = replace(made, start=made.flights(here.x, here.params), _recent=[], _linear=[])
            return _Born(_problem(made, here.params, None, "cycle"), free, both=False)
    raise Undefined("no small cycle was found beside the Hopf point: it may be degenerate")
