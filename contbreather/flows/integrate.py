"""Integration of a sequence of flows in time, from event to event, and zeros within a step."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..checks import MOST, brief, number, numbers, row, whole
from ..columns import Columns
from ..continuation.algebra.newton import Array, Undefined
from ..errors import BadInput, NotConverged
from ..one_thread import one_thread
from ..tables import HtmlRepr, Sheet
from .collocation import AT_REST
from .flow import Clock, Filippov, Flow
from .functions import Function, Params, at_state, place, slopes, values

_METHODS = ("DOP853", "LSODA", "Radau", "BDF")
_FEWEST, _FINEST = 16, 4096  # parts of a step between which a guard is looked at
_EDGE = 1e-12  # a guard this small, relative to what it is made of, is zero


class TooManySteps(NotConverged):
    """More steps than allowed, as a stiff system takes by an explicit method."""


class NeverMet(NotConverged):
    """A motion that goes on and on, and does not meet the condition that ends its flow."""


@dataclass(frozen=True)
class _InTurn:
    """Flows in the order of their list, the first after the last; `Filippov` decides by its state
    which comes next."""

    flows: tuple[Flow, ...]

    def begin(self, t: float, x: Array, p: Params, first: int) -> int:
        self.flows[first].check(t, x, p)
        return first

    def follow(
        self, mode: int, guard: int, t: float, x: Array, p: Params
    ) -> tuple[int, int, Array]:
        """Return which flow ended, the next one and the state in which it begins."""
        flow = self.flows[mode]
        if (name := list(flow.guards)[guard]) != "until":
            raise NotConverged(
                f"{name} of flow {mode} is zero {place(t, x)}: it must stay positive; start "
                "elsewhere, or make it the condition of a flow"
            )
        if flow.reset is not None:
            x = values(flow.reset, t, x[:, None], p)[:, 0]
        following = (mode + 1) % len(self.flows)
        try:
            self.flows[following].check(t, x, p)
        except BadInput as error:
            where = f"the reset of flow {mode} lands" if flow.reset else f"flow {mode} ends"
            raise BadInput(f"where {where}, {error}") from error
        return mode, following, x


@dataclass(frozen=True, eq=False)
class Piece:
    """One flow of a trajectory, from where it began to where it ended.

    Attributes
    ----------
    number : int
        Of the flow in the list that was given.
    flow : Flow
    t : array, shape (m,)
        The steps of the integrator.
    x : array, shape (n, m)
    ended : bool
        Whether its condition ended it, or the run.
    """

    number: int
    flow: Flow
    t: Array
    x: Array
    ended: bool
    _interpolant: Callable[[Any], Array]

    def __call__(self, t: Any) -> Array:
        """The state at times within the piece: shape (n,) or (n, m)."""
        return np.asarray(self._interpolant(t))


@dataclass(frozen=True, eq=False)
class GuardCrossing:
    """End of a flow: its state before and after the reset, and how fast the guard changed:
    negative, 0 at grazing."""

    time: float
    number: int
    before: Array
    after: Array
    rate: float


@dataclass(frozen=True, eq=False, repr=False)
class Trajectory(Columns, HtmlRepr):
    """Result of `integrate`; call it for states at times, after the reset at that of an event.

    Attributes
    ----------
    pieces : tuple of Piece
    events : tuple of GuardCrossing
    final : array, shape (n,)
        The state at the end, after the reset if the run ended with one.
    names : tuple of str
    params : dict
    """

    pieces: tuple[Piece, ...]
    events: tuple[GuardCrossing, ...]
    final: Array
    names: tuple[str, ...]
    params: Mapping[str, float]

    along = "time"

    @property
    def flows(self) -> tuple[Flow, ...]:
        """The flow of each piece: what a cycle is made of."""
        return tuple(piece.flow for piece in self.pieces)

    @cached_property
    def t(self) -> Array:
        """The steps of the integrator; the time of an event stands twice, before and after it."""
        return np.concatenate([piece.t for piece in self.pieces])

    @cached_property
    def x(self) -> Array:
        """States at `t`, shape (n, m)."""
        if len({len(piece.x) for piece in self.pieces}) > 1:
            raise BadInput("the flows differ in their number of states: see .pieces")
        return np.concatenate([piece.x for piece in self.pieces], axis=1)

    def __call__(self, t: Any) -> Array:
        times = numbers("t", t)
        begins = np.array([piece.t[0] for piece in self.pieces])
        end = self.pieces[-1].t[-1]
        if times.size and not (begins[0] <= times.min() and times.max() <= end):
            raise BadInput(f"the trajectory goes from t = {begins[0]:g} to {end:g}, not {brief(t)}")
        number = np.searchsorted(begins, times.ravel(), side="right") - 1
        states = np.empty((len(self.pieces[0].x), times.size))
        for i in np.unique(number):
            states[:, number == i] = self.pieces[i](times.ravel()[number == i])
        return states.reshape(-1, *times.shape)

    def columns(self) -> dict[str, NDArray[Any]]:
        return {"t": self.t, **dict(zip(self.names, self.x, strict=True))}

    def table(self) -> Sheet:
        """Tabulate its span, events and final state."""
        rows: list[Any] = [("from t =", self.pieces[0].t[0]), ("to t =", self.pieces[-1].t[-1])]
        rows += [("events", len(self.events)), *zip(self.names, self.final, strict=False)]
        return Sheet.of(rows)

    def __repr__(self) -> str:
        span = f"t = {self.pieces[0].t[0]:g} to {self.pieces[-1].t[-1]:g}"
        return f"<Trajectory over {span}: {len(self.events)} events>"


@one_thread
def integrate(
    flows: Flow | Function | Sequence[Flow] | Filippov | Any,
    x0: Any = None,
    params: Mapping[str, float] | None = None,
    *,
    periods: float | None = None,
    period: float | Callable[[Any], float] | None = None,
    perturb: Any = None,
    time: float | None = None,
    events: int | None = None,
    t0: float = 0.0,
    first: int = 0,
    tolerance: float | None = None,
    method: str = "DOP853",
    steps: int = 200_000,  # of one run: by an explicit method a stiff system takes more
) -> Trajectory:
    """Follow flows in turn, each until its condition ends it, through the resets between them.

    Each step is one of scipy's. The conditions are looked at within the step, on as many points
    as they need, so that one which falls and rises again in between is seen; events are located
    to rounding. A condition that is zero where a reset landed counts from where it has risen.

    Parameters
    ----------
    flows : Flow, callable, sequence of Flow or Filippov
        A function is a flow without an end. Or a periodic orbit, a problem of `cycle` or `breather`
        or a point of a branch, with its state, parameters and period unless these are given.
    x0 : array_like or dict
        State at the start, of the flow `first`; a dict gives its entries names.
    params : dict
    periods : float, optional
        How many times `period` to go.
    period : float or callable
        A number, or ``period(params)``; 2 pi by default.
    perturb : float or array_like, optional
        What is added to the state at the start: an array, or a size, relative to that of the
        state, in a direction that is always the same.
    time : float, optional
        How long to go, in place of `periods`. With `events`, how long at most.
    events : int, optional
        How many events to go.
    t0 : float
    first : int
        The flow in which the start lies; `Filippov` asks the state: 2 or 3 say that it slides.
    tolerance : float
        Relative, of a step; 1e-12 by default, 1e-13 of a conservative breather.
    method : str
        That of scipy: "DOP853", or for what is stiff "LSODA", "Radau" or "BDF".
    steps : int
        How many there may be.

    Returns
    -------
    Trajectory

    Raises
    ------
    BadInput
        Where functions, state and parameters do not fit, or a state lies behind the condition that
        ends its flow.
    NotConverged
        Where the events accumulate (a chatter), the condition of a flow is never met, or the
        state grows without bound.

    Examples
    --------
    >>> fall = Flow(lambda t, x, p: [x[1], -1.0], until=lambda t, x, p: x[0],
    ...             reset=lambda t, x, p: [x[0], -p["e"] * x[1]])
    >>> run = integrate(fall, {"y": 0.5, "v": 0.0}, {"e": 0.5}, time=2.6)
    >>> [round(event.time, 12) for event in run.events]
    [1.0, 2.0, 2.5]
    """
    if (begin := getattr(flows, "begin_of_orbit", None)) is not None:
        flows, state, own, length, when, exact = begin
        tolerance = exact if tolerance is None else tolerance
        x0, params = x0 if x0 is not None else state, {**own, **(params or {})}
        period, t0 = length if period is None else period, t0 or when
    if x0 is None or params is None:
        raise BadInput("a start x0 and params are needed, of all but a periodic orbit")
    period = 2 * math.pi if period is None else period
    path: _InTurn | Filippov | tuple[Flow, ...] = flows_of(flows, period)
    count = len(path if isinstance(path, tuple) else path.flows)
    if whole("first", first, 0) >= count:
        raise BadInput(f"first = {first}: there are {count} flows, counted from 0")
    path = _InTurn(path) if isinstance(path, tuple) else path
    named = isinstance(x0, Mapping)
    state = row("the start", list(x0.values()) if named else x0, "a number for each state")
    if perturb is not None:
        added = numbers("perturb", perturb)
        if added.shape not in ((), state.shape):
            raise BadInput(
                f"perturb has shape {added.shape}: a size, or one number for each of {state.size} "
                "states was expected"
            )
        way = np.cos(np.arange(1.0, state.size + 1) ** 2)  # no symmetry of anything
        state = state + (added if added.ndim else added * abs(state).max() * way)
    params = {name: float(numbers(name, value)) for name, value in dict(params).items()}
    t0 = number("t0", t0, -1e300, 1e300, "a time")
    if (periods is not None and time is not None) or periods is time is events is None:
        raise BadInput("say how far to go: either periods= (of period=), or time=, or events=")
    end, most = math.inf, math.inf if events is None else whole("events", events, 1)
    if periods is not None:
        length = period(params) if callable(period) else period
        length = number("period", length, 1e-300, 1e300, "a positive time")
        end = t0 + length * number("periods", periods, 1e-300, MOST, "how many, above 0")
    elif time is not None:
        end = t0 + number("time", time, 1e-300, 1e300, "how long, above 0")
    names = tuple(x0 if named else (f"x{i}" for i in range(1, state.size + 1)))
    if method not in _METHODS:
        raise BadInput(f"method = {brief(method)}: one of {', '.join(_METHODS)} was expected")
    tolerance = 1e-12 if tolerance is None else tolerance
    tolerance = number("tolerance", tolerance, 3e-14, 1e-2, "from 3e-14 to 1e-2")
    walk = _Integration(path, params, tolerance, method, whole("steps", steps, 1))
    return walk.run(t0, state, end, most, names, first)


def flows_of(flows: Any, period: Any) -> Any:
    """Make a tuple of flows in turn, with the period of which their clocks strike a part; a system
    that decides by its state which comes next stays as it is."""
    if isinstance(flows, Filippov):
        return flows
    listed = [flows] if isinstance(flows, Flow) or callable(flows) else flows
    if not isinstance(listed, list | tuple) or not listed:
        raise BadInput(f"flows must be a list of Flow, got {brief(flows)}")
    if any(isinstance(flow, Filippov) for flow in listed):
        raise BadInput("a Filippov system has all its flows: give it alone, not in a list")
    return tuple((f if isinstance(f, Flow) else Flow(f)).timed(period) for f in listed)


@dataclass
class _Integration:
    """Integrate pieces one after the other."""

    path: _InTurn | Filippov
    params: Params
    tolerance: float
    method: str
    steps: int
    taken: int = 0

    def run(
        self, t: float, x: Array, end: float, most: float, names: tuple[str, ...], first: int
    ) -> Trajectory:
        pieces: list[Piece] = []
        events: list[GuardCrossing] = []
        mode = self.path.begin(t, x, self.params, first)
        while len(events) < most and t < end:
            flow, number = self.path.flows[mode], mode
            times, states, dense, guard = self.piece(mode, t, x, end)
            t, x = float(times[-1]), states[:, -1]
            if guard is not None:
                slope = slopes([*flow.guards.values()][guard], t, x[:, None], self.params)[1]
                pace = values(flow.f, t, x[:, None], self.params)
                rate = float(slope[0, :, 0] @ np.append(pace, 1.0))  # dh/dt + grad h . f
                before = x
                number, mode, x = self.path.follow(mode, guard, t, x, self.params)
                events.append(GuardCrossing(t, number, before, x, rate))
            flow = self.path.flows[number]
            pieces.append(Piece(number, flow, times, states, guard is not None, dense))
            _refuse_chatter(pieces)
        return Trajectory(tuple(pieces), tuple(events), x, names, self.params)

    def piece(
        self, mode: int, t0: float, x0: Array, end: float
    ) -> tuple[Array, Array, Any, int | None]:
        """Integrate one flow, up to the first of its guards or to the end of the run."""
        from scipy import integrate

        flow = self.path.flows[mode]
        guards, clock = flow.guards, isinstance(flow.until, Clock)
        # when a clock strikes is known beforehand
        struck = flow.until.after(t0, self.params) if isinstance(flow.until, Clock) else math.inf
        end = min(end, struck)
        waited = t0 + 1e20 if guards and math.isinf(end) else end  # in any unit
        if math.isinf(waited):
            raise BadInput("a flow without `until` ends with the run: give periods= or time=")
        solver = getattr(integrate, self.method)(
            lambda t, x: at_state(flow.f, t, x, self.params), t0, x0, waited,
            rtol=self.tolerance, atol=self.tolerance * (abs(x0).max() or 1.0),
        )  # fmt: skip
        guarded = [
            GuardOnPiece(
                name, guard, flow.f, self.params, rough=not self.taken,
                since=t0 + flow.ignored(self.params) if name == "until" else t0,
            )
            for name, guard in guards.items()
            if guard is not flow.until or not clock
        ]  # fmt: skip
        t, x, hit = [t0], [x0], None
        steps: list[Any] = []
        most = 10_000 if guards and math.isinf(end) else self.steps + 1  # some hundred oscillations
        while hit is None and solver.status == "running" and len(steps) < most:
            steps.append(self.step(solver))
            falls = [watch.fall(steps[-1], t[-1], solver.t) for watch in guarded]
            at = min(falls, default=math.inf)
            # of one that falls as late as the first but for rounding: the condition before a wall
            late = at + _EDGE * max(abs(at), solver.t - t[-1])
            i = next((i for i, fall in enumerate(falls) if fall <= late < math.inf), None)
            hit = None if i is None else clock + i
            t.append(solver.t if i is None else falls[i])
            x.append(solver.y if i is None else steps[-1](falls[i]))
        if hit is None and waited < end:
            kind: type[NotConverged] = NeverMet
            why = (
                "a guard is positive inside and zero at the end (cb.integrate waits longer with "
                "time=)"
            )
            late = np.linspace(0.5 * (t0 + t[-1]), t[-1], 16)  # the second half of the time
            moved = np.ptp(integrate.OdeSolution(t, steps)(late), axis=1)
            if moved.max() <= AT_REST * abs(np.array(x)).max():
                kind = NotConverged
                why = f"it has come to rest at x = {brief(x[-1].tolist())}; start elsewhere"
            raise kind(
                f"the condition of flow {mode} was not met within {t[-1] - t0:g} from t = {t0:g}, "
                f"x = {brief(x0.tolist())}, in {len(steps)} steps: {why}"
            )
        if hit is None and struck <= end:
            hit = 0
        return np.array(t), np.stack(x, axis=-1), integrate.OdeSolution(t, steps), hit

    def step(self, solver: Any) -> Any:
        """Take a step, and return the states within it."""
        with np.errstate(all="ignore"):  # a step that leads too far is taken again
            message = solver.step()
            failed = solver.status == "failed"
            step: Any = None if failed else solver.dense_output()
            failed = failed or not np.isfinite([step(solver.t_old), solver.y]).all()
        self.taken += 1
        if failed:
            raise NotConverged(
                f"the solution ends {place(solver.t, solver.y)}: it grows without bound, or f is "
                f"NaN or jumps there ({message or 'not finite'})"
            )
        if self.taken > self.steps:
            raise TooManySteps(
                f"{self.steps} steps of {self.method} did not do, up to t = {solver.t:g} of "
                f"{solver.t_bound:g}: a shorter time does where all is fast (time=, and settle= of "
                "cb.cycle), and what is stiff takes method='LSODA' or 'Radau' (cb.integrate)"
            )
        return step


def _refuse_chatter(pieces: Sequence[Piece]) -> None:
    """Refuse ever shorter flights, four in a row: infinitely many events in finite time."""
    lengths = [float(piece.t[-1] - piece.t[0]) for piece in pieces[-200:]]
    last = lengths[-4:]
    falling = len(last) == 4 and all(b < a for a, b in pairwise(last))
    if falling and last[-1] < 1e-5 * max(lengths):
        raise NotConverged(
            f"the events accumulate before t = {pieces[-1].t[-1]:g} (a chatter): the last pieces "
            f"took {', '.join(f'{length:.1g}' for length in last)}. What comes after is another "
            "flow, a rest on the guard, which has to be given as one"
        )


# --- zeros of guards within a step ---------------------------------------------------------------

Guard = Callable[[Array], Array]  # over times


@dataclass
class GuardOnPiece:
    """A guard along one piece: positive, and zero where the piece ends."""

    name: str
    function: Function
    field: Function
    params: Params
    rough: bool  # a start may lie a little behind it, if it is on its way inside
    since: float  # from when on it counts
    armed: bool = False  # it was seen to be positive

    def fall(self, step: Callable[[Any], Array], a: float, b: float) -> float:
        """Return the first time in a step at which the guard falls through zero, or infinity."""

        def guard(t: Array) -> Array:
            value = values(self.function, t, step(t), self.params)[0]
            if np.isnan(value).any():
                at = float(t[np.isnan(value)][0])
                raise Undefined(f"{self.name} is NaN {place(at, step(at))}")
            return value

        a = max(a, self.since)
        if a >= b:
            return math.inf
        if not self.armed:
            a = self._arm(guard, a, b, self._size(step(a), b, step(b)))
        return _first_fall(guard, a, b) if self.armed else math.inf

    def _size(self, before: Array, b: float, after: Array) -> float:
        """Measure the states that the guard depends on, or its change: those it is made of."""
        moved = after[:, None] + np.diag(1e-6 * np.where(after, after, 1.0))  # another state
        states = np.column_stack([after, moved])
        try:
            level, pace = (values(f, b, states, self.params) for f in (self.function, self.field))
        except Undefined:  # a little further it has no value
            return float(abs(np.append(before, after)).max())
        involved = level[0, 1:] != level[0, 0]
        involved |= (pace[involved, 1:] != pace[involved, :1]).any(axis=0)
        return float(abs(np.append(before[involved], after[involved])).max(initial=0.0))

    def _arm(self, guard: Guard, a: float, b: float, size: float) -> float:
        """Return the time from which the guard is positive: by a reset it may begin at zero."""
        t = np.append(a, a + (b - a) * 2.0 ** np.arange(-40, 1))  # where flights are short, too
        g = guard(t)
        # late, rounding of the time moves what changes within the step
        edge = _EDGE * (size + abs(g).max()) + np.finfo(float).eps * abs(a) / (b - a) * np.ptp(g)
        clear, inside = np.flatnonzero(abs(g) > edge), np.flatnonzero(g > edge)
        if self.rough and inside.size and (np.diff(g[: inside[0] + 1]) >= 0).all():
            clear = inside
        if clear.size and g[clear[0]] < 0:
            look = "look at the start or the reset"
            # from the 500th part of a step on one that is smooth changes from place to place
            if np.count_nonzero(np.diff(g[-10:])) < 5:
                look = "it changes in jumps alone: in place of sign(x[0]) or floor(x[0]) give x[0]"
            raise BadInput(
                f"the state at t = {a:g} lies behind {self.name}, or falls through it at once: "
                f"{self.name} = {g[0]:.3g} there, {g[clear[0]]:.3g} after {t[clear[0]] - a:.1g}. "
                f"It must be positive inside the flow; {look}"
            )
        self.armed = bool(clear.size)
        return float(t[clear[0]]) if clear.size else b


def _first_fall(guard: Guard, a: float, b: float) -> float:
    """Look at twice as many places until the guard is smooth between them."""
    parts, uneven = _FEWEST // 2, True
    while uneven and parts < _FINEST:
        parts *= 2
        # no two parts are alike: an oscillation is not taken for a constant
        t = a + (b - a) * (0.5 - 0.5 * np.cos(np.pi * np.arange(parts + 1) / parts))
        g = guard(t)
        # a cubic through neighbours leaves fourth differences: a tenth of the range may hide dips
        uneven = abs(np.diff(g, 4)).max() > 0.1 * np.ptp(g) + _EDGE * abs(g).max()
    least = np.append(True, g[:-1] > g[1:]) & np.append(g[:-1] <= g[1:], True)
    fallen = np.append(False, (g[1:] <= 0) & (g[:-1] > 0))
    for i in np.flatnonzero(least | fallen).tolist():
        left, right = max(i - 1, 0), min(i + 1, parts)
        if fallen[i]:
            return root(guard, t[left], t[i])
        # A minimum may lie beside the first or the last place; and of two places as far from one
        # the first is lower, or as low: rounding decides. So two places to each side tell its depth
        around = g[max(i - 2, 0) : i + 3]
        if 0 < g[i] < 0.3 * (around.max() - g[i]):  # shallow beside the fall to it
            lowest, value = bottom(guard, t[left], t[right])
            if value <= 0:
                return root(guard, t[left], lowest)
    return math.inf


def bottom(function: Guard, low: float, high: float) -> tuple[float, float]:
    """Find the lowest place of a function between two, and its value there."""
    for _ in range(8):  # to 6e-8 of the way, as close as rounding can tell
        places = np.linspace(low, high, 17)
        found = function(places)
        j = int(found.argmin())
        low, high = places[max(j - 1, 0)], places[min(j + 1, 16)]
    return float(places[j]), float(found[j])


def root(guard: Guard, a: float, b: float) -> float:
    """Locate the fall of a guard between two times to rounding."""
    from scipy.optimize import brentq

    spacing = np.spacing(max(abs(a), abs(b)))  # no time lies in between
    start, end = guard(np.array([a, b]))

    def fallen(s: float) -> float:
        value = float(guard(np.array([a + s]))[0])
        # one that stays zero has fallen where it came to it
        return value if value > 0.0 or end < 0.0 else -float(start)

    # at a double or triple zero it is hardly sooner there than by halving, a few hundred times
    return float(a + brentq(fallen, 0.0, b - a, xtol=spacing, maxiter=10_000))
