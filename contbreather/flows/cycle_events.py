"""Events of cycles along a branch: LP, BP, PD, NS, and where it ends: HB, a cycle that shrinks to a
point; VI, an impact that loses its velocity; GR, a wall that is touched in between; CC, conditions
that are met at once; SL, an orbit of a Filippov system that begins to slide, or to cross where it
slid. Curves of folds end at GH.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import chain
from typing import Any, NamedTuple

import numpy as np

from ..continuation.algebra.derivatives import RELATIVE, directional
from ..continuation.algebra.newton import OUT_OF_DOMAIN, Array
from ..continuation.algebra.sparse import shortest
from ..continuation.bifurcations.equilibria import fold
from ..continuation.bifurcations.multiplier_events import linked, unresolved
from ..continuation.curve.curve import Curve
from ..continuation.curve.point import (
    NOTHING,
    CodimensionTwo,
    DefiningSystem,
    Event,
    Examined,
    Point,
)
from ..continuation.systems import normal_forms
from ..continuation.systems.branch_points import bordered_matrix, branch_point_test, crossing_event
from ..continuation.systems.defining_systems import Singular, least_in_unknowns, linear_condition
from .collocation import TrajectorySegment
from .conservative_events import conservative_events
from .cycle_beyond import LEAVES, SHORTEST
from .cycle_problem import ONE, Cycle
from .equations import FlowEquations, equations_of
from .flow import Clock, flow_between, plain, slid_along, system_of, value_at, value_over
from .functions import Function, Params, slopes, values
from .homoclinic import HOMOCLINIC
from .integrate import bottom
from .rotation import moves
from .rounds import REPEATS, RETURNS

_AT_REST = 1e-5  # an orbit that swings by this, relative to its size, ends at an equilibrium
_LOOKS = 16  # around it
_CLOSER = 8  # steps of Newton's iteration from the mean of an orbit to the equilibrium in it
FLAT = 3e-3  # and where the fourth power of it is to be told from rounding
_FOLDED = 5e-3  # and on a curve of folds, where rounding over its square moves one along the curve


# --- where a cycle shrinks to an equilibrium ---------------------------------------------------


def _amplitude(equations: FlowEquations, curve: Curve, z: Array) -> float:
    """Measure the swing of the orbit the way it did at first, relative to the size of orbits on its
    curve: beyond an equilibrium the curve goes on as the same cycles half a turn later."""
    nodes = equations.layout.nodes[0].ravel()
    return float(equations.swing @ (z[nodes] / curve.scales[nodes])) / math.sqrt(nodes.size)


def swing(least: float, point: Point) -> float:
    """Measure the swing, less that of an equilibrium."""
    base = point.base_point
    return _amplitude(equations_of(base), base.curve, base.z) - least


def _shrunk(point: Point) -> float:
    equations = equations_of(base := point.base_point)
    return _amplitude(equations, base.curve, base.z) - _AT_REST if equations.shrinks else math.nan


def examine_swing(least: float, point: Point) -> Examined:
    """Refuse an orbit that is large, and only has nothing of the first one's way: what is small
    turns as the linear equations have it, x' = J x, but for the square of its size."""
    orbit: Cycle = point.base_point.solution
    states, parts = _around(orbit)
    turns = np.fft.fft(states)
    times = 1 + int(np.linalg.norm(turns[:, 1 : _LOOKS // 2], axis=0).argmax())
    turn = turns[:, times]
    along = _slopes_at(orbit, states.mean(axis=1))[1] @ turn
    turned = 2j * math.pi * times / (parts * orbit.period) * turn
    square = np.vdot(turned, turned).real
    small = np.linalg.norm(along - turned) <= least * math.sqrt(square)
    # it grows, along folds, by the fourth power of its size
    return "" if small and abs(np.vdot(turned, along).imag) <= FLAT * square else NOTHING


def _around(orbit: Cycle) -> tuple[Array, int]:
    """States around an orbit, and of how many parts: each the mirror image of the one before."""
    rounds = [first := orbit.flights[0].at(np.arange(_LOOKS) / _LOOKS)]
    same = REPEATS * np.ptp(first, axis=1).max()
    while orbit.mirror and len(rounds) < RETURNS:  # of a half, or a smaller part, the whole
        image = values(orbit.mirror, orbit.flights[0].last, rounds[-1], orbit.params)
        if abs(image - first).max() <= same:
            break
        rounds.append(image)
    # a reset leads from the end of a part to its beginning: it comes to those before
    return np.hstack([first, *rounds[:0:-1]]), len(rounds)


def _slopes_at(orbit: Cycle, x: Array) -> tuple[Array, Array]:
    """Evaluate the field and its derivative in the states."""
    rate, slope = slopes(orbit.equations.flows[0].f, 0.0, x[:, None], orbit.params)
    return rate[:, 0], slope[:, : x.size, 0]


def _nonlinear_swing(point: Point) -> float:
    """Estimate the swing at which all terms are as large, by that of a fold and the growth beside
    the equilibrium inside it, per radian: the fourth power of how much smaller it is."""
    orbit, size = point.solution, abs(swing(0.0, point))
    states, parts = _around(orbit)
    x = states.mean(axis=1)
    with suppress(*OUT_OF_DOMAIN), np.errstate(all="ignore"):  # of most that are large
        for _ in range(_CLOSER):
            rate, matrix = _slopes_at(orbit, x)
            x = x - shortest(matrix, rate)
        rates = np.linalg.eigvals(matrix)
        rate = rates[abs(rates - 2j * math.pi / (parts * orbit.period)).argmin()]
        return size / float(abs(rate.real / rate)) ** 0.25
    return size


def _examine_generalised(point: Point) -> Examined:
    """The end of a curve of folds, and where that is: the parameters are off by c A^2, so by half
    of A dp/dA."""
    # its pace is off by the square of its size, perhaps in a smaller unit
    if reason := examine_swing(_FOLDED**0.25, point):
        return reason
    curve, equations = point.base_point.curve, equations_of(point.base_point)
    left = _amplitude(equations, curve, z := point.z)
    left /= _amplitude(equations, curve, tangent := point.direction)
    names, slots = curve.free, point.curve.slots
    places = (float(z[slots[name]] - 0.5 * left * tangent[slots[name]]) for name in names)
    where = ", ".join(f"{name} = {at:.8g}" for name, at in zip(names, places, strict=True))
    return {"said": f"the folds end at a generalised Hopf point, {where}"}


_SHRUNK = Event("HB", _shrunk, examine=partial(examine_swing, _AT_REST), ends="branch")
_GENERALISED = Event("GH", partial(swing, _FOLDED), examine=_examine_generalised, ends="branch")


# --- where a multiplier is 1 --------------------------------------------------------------------


def _without_unit(point: Point) -> Examined:
    """Say where no multiplier but the trivial one is 1; nothing of what a reset forgets."""
    base = point.base_point
    off = base.solution.off_one
    if math.isnan(off):  # at VI: of a fold the state at each start moves, unless a reset forgets it
        null, starts = least_in_unknowns(base.curve, base.z).right, equations_of(base).layout.nodes
        return NOTHING if min(abs(null[of[0]]).max() for of in starts) < 1e-6 else ""
    return "" if off < ONE else f"no multiplier is 1: the nearest is {off:.2g} off"


def _ends_there(point: Point) -> bool:
    """Tell whether a branch ends at VI there: velocities of the other sign may solve its equations,
    too, as of a relay without forcing, on curves that turn at it or cross there."""
    return len(point.curve.free) == 1 and math.isnan(point.solution.off_one)


def _examine_crossing(point: Point) -> Examined:
    assert _CROSSING.examine is not None
    if _ends_there(point):
        return NOTHING
    # orbits that are shifted in time cross the branch where their phase is not measured
    return unresolved(point) or _without_unit(point) or _CROSSING.examine(point)


def _examine_fold(point: Point) -> Examined:
    assert _PLAIN.examine is not None
    if _ends_there(point):
        return NOTHING
    # where a branch is steep, as at a canard, rounding turns its parameter back, too
    if reason := unresolved(point) or _PLAIN.examine(point) or _without_unit(point):
        return reason
    with suppress(*OUT_OF_DOMAIN):  # u -> u + b u^2, and the direction of u is free
        b = normal_forms.cubic_at_cusp(point)[0]
        return {} if b.degenerate else {"b": abs(b.value)}  # of a canard it is rounding
    return ""


def _fold_locus(point: Point) -> DefiningSystem:
    assert _PLAIN.locus is not None
    locus = _PLAIN.locus(point)
    if not equations_of(point).shrinks:
        return locus
    ends = replace(_GENERALISED, test=partial(swing, _FOLDED * _nonlinear_swing(point)))
    return replace(locus, events=(*locus.events, ends))


_PLAIN = fold()
_CIRCLE = linked(replace(_PLAIN, locus=_fold_locus, examine=_examine_fold))
_CROSSING = crossing_event(_CIRCLE.meetings("BP"))
BRANCH_POINT = replace(
    _CROSSING,
    test=Singular(bordered_matrix, branch_point_test),
    many=None,  # which would be the other test
    count=None,
    examine=_examine_crossing,
)


# --- where flows end ----------------------------------------------------------------------------


AT_ONCE = 1e-8  # of margins: what is as close to a wall touches it as well


class Margin(NamedTuple):
    """Distance of an orbit from one end of its branch, the equations of the end, a sentence, the
    flow that comes to it, which of its guards does, and where in the flow."""

    value: float
    system: Callable[[], DefiningSystem]
    said: str
    flow: int
    guard: str = ""
    place: float = 0.0


def _none(orbit: Cycle) -> Iterable[Margin]:
    return ()


@dataclass(frozen=True, eq=False)
class _Nearest:
    """Test of an event: the least of some margins of an orbit."""

    kind: str
    margins: Callable[[Cycle], Iterable[Margin]]
    further: Callable[[Cycle], Iterable[Margin]] = _none  # of another event of this kind

    def __call__(self, point: Point) -> float:
        return min((margin.value for margin in self._of(point)), default=math.nan)

    def locus(self, point: Point) -> DefiningSystem:
        beside = _Beside(self.kind, self.margins, self.further, followed=self._least(point))
        once = beside(point) < AT_ONCE  # by a symmetry, all along
        return beside.followed.system() if once else beside.system()

    def examine(self, point: Point) -> Examined:
        least = self._least(point)
        guard = {"guard": least.guard} if least.guard else {}
        # by a symmetry others come to their ends with it
        others = self.margins(point.base_point.solution)
        once = {
            (other.flow, other.guard): other.said
            for other in others
            if other.value < AT_ONCE and (other.guard or self.kind in ("VI", "SL"))
        }
        more = {"at once": "; ".join(once.values())} if len(once) > 1 else {}
        # where a coarse mesh has its lowest place the equations of a touch may not hold
        touch = {**least.system().extra, **point.detail}
        return {**touch, "said": least.said, "flow": least.flow, **guard, **more}

    def event(self) -> Event:
        return Event(self.kind, self, locus=self.locus, examine=self.examine, ends="domain")

    def _of(self, point: Point) -> Iterable[Margin]:
        return self.margins(point.base_point.solution)

    def _least(self, point: Point) -> Margin:
        return min(self._of(point), key=lambda margin: margin.value)


@dataclass(frozen=True, eq=False)
class _Beside(_Nearest):
    """Test of what ends a curve of such an event: the least of all other margins."""

    followed: Margin = field(kw_only=True)

    def system(self) -> DefiningSystem:
        """The equations of what is followed, with the end of its curve."""
        kind, base = f"{self.kind}-{self.kind}", self.event()
        met = CodimensionTwo(kind, self, examine=self.examine, ends="domain", base=base)
        system = self.followed.system()
        return replace(system, events=(*system.events, met))

    def locus(self, point: Point) -> DefiningSystem:
        return replace(self, followed=self._least(point)).system()

    def _of(self, point: Point) -> Iterable[Margin]:
        orbit: Cycle = point.base_point.solution
        margins, slot = [*self.margins(orbit)], point.curve.slots.get("touch")
        place = self.followed.place if slot is None else float(point.z[slot])
        own = [m for m in margins if (m.flow, m.guard) == (self.followed.flow, self.followed.guard)]
        turn = 1.0 if _goes_round(orbit.equations) else math.inf
        gone = min(own, key=lambda m: abs(math.remainder(m.place - place, turn)), default=None)
        others = [margin for margin in margins if margin is not gone]
        # next to nothing of a flow that shrinks all is small
        return others + [m for m in self.further(orbit) if m.flow != self.followed.flow]


def _goes_round(equations: FlowEquations) -> bool:
    """Tell whether beyond the end of its one flow an orbit is where it began."""
    return equations.smooth and not moves(equations.flows[0])


@dataclass(frozen=True, eq=False)
class _Reached:
    """A wall, and how fast it changes along the flow, at a place of a flow: at an unknown one both
    vanish where it is touched."""

    equations: FlowEquations
    flow: int
    wall: Function
    place: float | None  # 1 the end of the flow
    rows: slice  # which of both vanish there
    since: float | Callable[[Params], Any] | None = None  # instead, a time after the beginning
    first: float = 0.0  # the first place at which it may be touched

    def system(self, **extra: float) -> DefiningSystem:
        # where it ends the flow its own condition is touched along VI, too: in between is a cube;
        # so where that of the flow before begins it
        ends = self.wall == self.equations.flows[self.flow].until
        domain = self.first, 1.0 - LEAVES * ends
        inside = {} if _goes_round(self.equations) else dict.fromkeys(extra, domain)
        return DefiningSystem(extra, self.conditions, self.derivative, domain=inside)

    def vanishing(self) -> DefiningSystem:
        """The equations of VI, up to an inflection: beyond the condition is passed before."""
        said = {"said": f"the condition of flow {self.flow} has an inflection where that ends"}
        bends = Event("VI-GR", self._bent, examine=lambda point: said, ends="domain")
        return replace(self.system(), events=(bends,))

    def arriving(self, following: int) -> DefiningSystem:
        """The equations of SL, up to where the edge is touched by the flow that follows, which at
        that edge goes on as the other side's field has it: what slides is to come inside, what
        crosses to go away from the surface."""
        said = {"said": f"flow {following} touches the edge of sliding where it begins"}
        along, sign = (flow := self.equations.flows[following]).f, 1.0 if slid_along(flow) else -1.0

        def rate(point: Point) -> float:
            orbit: Cycle = point.base_point.solution
            flight, p = orbit.flights[self.flow], orbit.params
            at = flight.last, flight.end[:, None], p
            way = np.append(values(along, *at)[:, 0], 1.0)
            return sign * float(slopes(self.wall, *at)[1][0, :, 0] @ way)

        turns = Event("SL-GR", rate, examine=lambda point: said, ends="domain")
        return replace(self.system(), events=(turns,))

    def _bent(self, point: Point) -> float:
        return self.bend(point.base_point.solution)

    def bend(self, orbit: Cycle) -> float:
        """Evaluate the second derivative of the condition along the flow, where that ends."""
        flight, p = orbit.flights[self.flow], orbit.params
        t, x, field = flight.last, flight.end, self.equations.flows[self.flow].f
        way = np.append(values(field, t, x[:, None], p)[:, 0], 1.0)
        return float(self._both(t, x, p, ())[1][1] @ way)

    def conditions(self, curve: Curve, z: Array, extra: Array) -> Array:
        x, p = z[: curve.size], curve.params(z)
        s = self._place(extra, x, p)
        t, state = self.equations.place(self.flow, s, x, p)
        return self._both(t, state, p, ())[0][self.rows]

    def derivative(self, curve: Curve, z: Array, extra: Array) -> Array:
        x, p, names = z[: curve.size], curve.params(z), curve.free
        s = self._place(extra, x, p)
        t, state = self.equations.place(self.flow, s, x, p)
        local, n = self._both(t, state, p, names)[1], state.size + 1  # and the time
        total = local[:, :n] @ self.equations.place_slopes(self.flow, s, x, p, names)
        total[:, curve.size : -1] += local[:, n:]
        if self.since is not None:  # s = since / T
            long = self.equations.layout.lengths[self.flow]
            total[:, long] -= total[:, -1] * s / x[long]
            ignored = partial(value_over, self.since)
            slope = slopes(ignored, 0.0, np.zeros((1, 1)), p, names)[1][0, 2:, 0]
            total[:, curve.size : -1] += np.outer(total[:, -1], slope / x[long])
        return total[self.rows] if self.place is None else total[self.rows, :-1]

    def _place(self, extra: Array, x: Array, p: Params) -> float:
        if self.since is not None:
            return float(value_at(self.since, p) / x[self.equations.layout.lengths[self.flow]])
        around = extra % 1.0 if _goes_round(self.equations) else extra
        return float(around[0]) if self.place is None else self.place

    def _both(self, t: float, x: Array, p: Params, names: tuple[str, ...]) -> tuple[Array, Array]:
        """Evaluate both at a time and a state, and their derivatives, in parameters too."""

        def gradient(z: Array) -> Array:
            return slopes(self.wall, z[-1], z[:-1, None], p, names)[1][0, :, 0]

        at, n = np.append(x, t), x.size
        field = self.equations.flows[self.flow].f
        f, df = (of[..., 0] for of in slopes(field, t, x[:, None], p, names))
        grad, way = gradient(at), np.append(f, 1.0)
        # (grad w . f)' = w'' f + grad w . f', and w'' f is how the gradient changes along f
        step = RELATIVE * (1 + np.linalg.norm(at)) / np.linalg.norm(way)
        turned = directional(gradient, at, step * way) / step
        value = values(self.wall, t, x[:, None], p)[0, 0]
        return np.array([value, grad[: n + 1] @ way]), np.stack([grad, turned + grad[:n] @ df])


class Touch(NamedTuple):
    """A low place of a wall along its flow: how far off it is, of which flow, when (in its
    duration, and in time), which of its guards, whether the flow begins off that."""

    clearance: float
    flow: int
    place: float
    time: float
    guard: str
    apart: bool


def touches(orbit: Cycle) -> Iterator[Touch]:
    """Find where an orbit comes closest to each wall of its flows, at the ends of these, too, and
    to the condition that ends one before it does."""
    for i, (flow, flight) in enumerate(zip(orbit.equations.flows, orbit.flights, strict=True)):
        sampled = flight.sampled(8)  # into each interval for a wall that is touched
        own: list[float] = []  # where its condition is low: a wall that is the same is so, too
        for name, wall in flow.guards.items():
            if not isinstance(wall, Clock):
                ends = _ends(orbit, i, name)
                found = [*_touches_of(orbit, i, name, ends, *sampled[:2])]
                if name == "until":
                    own = [touch.place for touch in found]
                elif ends:
                    found = [at for at in found if not np.isclose(at.place, own, atol=1e-6).any()]
                yield from found


def _ends(orbit: Cycle, i: int, name: str) -> bool:
    """Tell whether a guard is what ends the flow, or zero there at other parameters, too."""
    flow, flight, p = orbit.equations.flows[i], orbit.flights[i], orbit.params
    wall, until = flow.guards[name], flow.until
    if wall == until or until is None or isinstance(until, Clock):
        return wall == until
    at = flight.last, flight.end[:, None], p
    (value, own), (ended, other) = (slopes(of, *at, tuple(p)) for of in (wall, until))
    (own, other), size = (own[0, :, 0], other[0, :, 0]), np.append(flight.end, at[0])
    larger = np.linalg.norm(own) / np.linalg.norm(other)
    error = 1e-9 * abs(own[: size.size]) @ abs(size) + 10 * larger * abs(ended[0, 0])
    across = own - other * (own @ other) / (other @ other)
    return bool(abs(value[0, 0]) <= error and np.linalg.norm(across) <= 1e-6 * np.linalg.norm(own))


def _touches_of(
    orbit: Cycle, i: int, name: str, ends: bool, s: Array, states: Array
) -> Iterator[Touch]:
    """Find where one flow comes closest to one of its walls, of which places and states are
    samples."""
    flow, before, flight = (flows := orbit.equations.flows)[i], flows[i - 1], orbit.flights[i]
    wall, around = flow.guards[name], _goes_round(orbit.equations)
    if waits := flow.ignored(orbit.params) if name == "until" else 0.0:
        ignored = waits / flight.duration
        s = np.append(ignored, s[s > ignored])
        states = flight.at(s)
    t = flight.start + flight.duration * s
    v = values(wall, t, states, orbit.params)[0]
    beside = values(wall, t, np.nextafter(states, math.inf), orbit.params)[0]
    # of what it is a difference of, too: a flow that shrinks to nothing stays next to it
    size = max(abs(v).max(), abs(beside - v).max() / np.finfo(float).eps)
    slides, leaves = (ends and slid_along(of) for of in (flow, before))
    # without a reset it begins where another ended: the walls of sliding are zero there
    if ends:
        # after sliding, always on the surface, which is off zero by rounding of larger states
        begins = waits > 0.0 or (not leaves and _apart(orbit, i, wall, size))
    else:
        off = before.reset is not None and _apart(orbit, i, wall, size)
        begins = flow.until is None or off
    on = ends and not (begins or slides or leaves)
    height = partial(_height, wall, flight, orbit.params, around, on=on)
    # where no place is low this one is far from it, but of sliding, and of what leaves the
    # surface after it, both of which shrink to nothing
    places = [] if slides or leaves else [s[v.argmax()]]
    least = 2 * LEAVES if leaves else SHORTEST if slides else 0.0
    if flight.duration >= least * orbit.period:  # of one that hardly lasts all places are low
        if on:  # zero at both ends: a touch next to the beginning shows where s is divided out
            s = np.append([LEAVES, 2 * LEAVES], s[s > 2 * LEAVES])
            v = height(s) / s
        if around:  # what is low where it begins is so where it ends
            s, v = np.append(s[-2] - 1, s), np.append(v[-2], v)
        for j in _lows(v, s, size, begins and not around, ends, around):
            low, high = s[max(j - 1, 0)], s[min(j + 1, s.size - 1)]
            places.append(bottom(partial(height, divided=ends), low, high)[0])
    found = np.array(places) % 1.0 if around else np.array(places)
    for at, off in zip(found, height(found) if places else found, strict=True):
        time = flight.start + flight.duration * at
        yield Touch(float(off), i, float(at), float(time), name, bool(begins))


def _height(
    wall: Function,
    flight: TrajectorySegment,
    p: Params,
    around: bool,
    s: Array,
    divided: bool = False,
    on: bool = False,
) -> Array:
    """Evaluate a wall along a flight, that goes around where its orbit does; divided by 1 - s where
    it ends the flow, but there, and by s where it begins on it."""
    s = s % 1.0 if around else s
    v = values(wall, flight.start + flight.duration * s, flight.at(s), p)[0]
    v = v / s if divided and on else v
    return np.divide(v, 1 - s, out=np.full_like(v, math.inf), where=s < 1) if divided else v


def _apart(orbit: Cycle, i: int, until: Function, size: float) -> bool:
    """Tell whether a flow begins off its own condition, not on it as after an impact: by more than
    the error of the end of the flow before. Where sliding begins SL is looked for."""
    flows, before, p = orbit.equations.flows, orbit.flights[i - 1], orbit.params
    if slid_along(flows[i]):
        return False
    reset, ended, state = flows[i - 1].reset, flows[i - 1].until, before.end[:, None]
    after = state if reset is None else values(reset, before.last, state, p)
    off = abs(values(until, before.last, after, p)[0, 0])
    error = abs(values(ended, before.last, state, p)[0, 0]) if ended else 0.0
    if off > 1e-9 * size + 10 * error:  # of its size, or by more than the end before
        return True
    return ended is not None and _by_chance(orbit, i, until, ended)


def _by_chance(orbit: Cycle, i: int, until: Function, ended: Function) -> bool:
    """Tell whether a flow that begins on its own condition does so at this orbit alone, as a relay
    at no hysteresis: not wherever the flow before ends, at other parameters, too, as after an
    impact, nor while that lasts, as after rest."""
    before, flow, p = orbit.flights[i - 1], orbit.equations.flows[i - 1], orbit.params
    x, m = before.end[:, None], before.dimension

    def gradient(function: Function, x: Array) -> Array:  # in state, time, parameters
        return np.asarray(slopes(function, before.last, x, p, tuple(p))[1][..., 0])

    own, other = gradient(until, orbit.flights[i].states[0][:, None])[0], gradient(ended, x)[0]
    terms = own
    if flow.reset is not None:
        n = orbit.flights[i].dimension
        lands, rest = gradient(flow.reset, x), np.append(np.zeros(m), own[n:])
        # these cancel where a reset that forgets all lands on it, whatever the parameters
        terms = abs(own[:n]) @ abs(lands) + abs(rest)
        own = own[:n] @ lands + rest
    rate = own[: m + 1] @ np.append(values(flow.f, before.last, x, p)[:, 0], 1.0)
    across = own - other * (own @ other) / (other @ other)
    least = 1e-6 * np.linalg.norm(terms)
    # or the reset forgets all, and lands where parameters say
    passes = abs(rate) > least or np.linalg.norm(own[: m + 1]) <= least
    return bool(np.linalg.norm(across) > least and passes)


def _lows(v: Array, s: Array, size: float, begins: bool, ends: bool, around: bool) -> list[int]:
    """Find the minima of a wall, those at the two ends of its flow among them.

    What ends the flow is zero there, so that is divided out: where it is touched before, v = 0 and
    v' = 0 as ever, but a minimum of v / (1 - s) comes into being while it is positive, and none
    does where the end itself grazes, at VI.
    """
    if ends:
        v = v[:-1] / (1 - s[:-1])
    beside = np.concatenate([[math.inf], v, [math.inf]])
    depth = np.maximum(beside[:-2], beside[2:]) - v
    # less deep is rounding
    low = (v <= beside[:-2]) & (v < beside[2:]) & (depth > 1e-12 * size)
    low[0] &= begins
    low[-1] &= not (ends or around)
    return [int(j) for j in np.flatnonzero(low)]


def _clearances(orbit: Cycle) -> Iterator[Margin]:
    """Measure how far the orbit is off touching a wall."""
    # there the next wall is reached as the one before: that is CC
    short = [m.flow for m in _collisions(orbit) if m.value < 0.5 * SHORTEST]
    once = [orbit.flights[i].start / orbit.period for i in short]
    for touch in touches(orbit):
        part = touch.time / orbit.period
        if any(abs(math.remainder(part - at, 1.0)) < SHORTEST for at in once):
            continue
        flow, duration = orbit.equations.flows[touch.flow], orbit.flights[touch.flow].duration
        reached = partial(_Reached, orbit.equations, touch.flow, flow.guards[touch.guard])
        first = 0.0 if touch.apart else LEAVES
        system = partial(reached(None, slice(2), first=first).system, touch=touch.place)
        waits = flow.ignored(orbit.params)
        if touch.guard == "until" and waits and touch.place == waits / duration:
            system = partial(reached(touch.place, slice(1), since=flow.ignore).system)
        elif touch.place in (0.0, 1.0) and not _goes_round(orbit.equations):
            system = partial(reached(touch.place, slice(1)).system)
        words = getattr(flow.guards[touch.guard], "words", (f"flow {touch.flow}", touch.guard))
        said = f"{words[0]} touches {words[1]} at t = {touch.time % orbit.period:.6g}"
        yield Margin(touch.clearance, system, said, touch.flow, touch.guard, touch.place)


def _rates(orbit: Cycle) -> Iterator[Margin]:
    """Measure how fast each condition falls where it ends its flow."""
    for i, (rate, _) in orbit.paces.items():
        flow, flight = orbit.equations.flows[i], orbit.flights[i]
        assert flow.until is not None
        system = _Reached(orbit.equations, i, flow.until, 1.0, slice(1, 2)).vanishing  # no change
        words = getattr(flow.until, "words", (f"flow {i}", "its end"))
        said = f"{words[0]} only just reaches {words[1]} at t = {flight.last % orbit.period:.6g}"
        yield Margin(rate, system, said, i)


def arrivals(orbit: Cycle) -> Iterator[Margin]:
    """Measure the field of the other side where an orbit comes to the surface: it points away from
    it where the orbit crosses, and at it where it slides."""
    flows, flights = [*map(plain, orbit.equations.flows)], orbit.flights
    for i, (flow, flight) in enumerate(zip(flows, flights, strict=True)):
        system, following = system_of(flow), (i + 1) % len(flows)
        if system is None or slid_along(flow):
            continue  # it leaves the surface there
        field = system.facing(flow)
        value = float(values(field, flight.last, flight.end[:, None], orbit.params)[0, 0])
        if not slid_along(flows[following]):
            value = -value
        elif flows[following].until == field:  # zero with the time it slides, too: that is another
            lasts = flights[following].duration
            value = value / lasts if lasts > SHORTEST * orbit.period else math.inf
        reached = _Reached(orbit.equations, i, field, 1.0, slice(1))
        said = f"flow {i} ends at the edge of sliding at t = {flight.last:.6g}"
        yield Margin(value, partial(reached.arriving, following), said, i, "sliding")


def shares(orbit: Cycle) -> Iterator[Margin]:
    """Measure the share of the orbit, beyond what counts as none, of flows that begin where a
    condition without a reset is all but touched: where two flows meet at a tangency one comes into
    being, as short as the root of how far the parameter is beyond. And of those that do at an edge
    of sliding, as short as that."""
    flows, lengths = [*map(plain, orbit.equations.flows)], orbit.equations.layout.lengths
    if all(moves(flow) or not flow.until for flow in flows):
        return
    for i, (flow, flight) in enumerate(zip(flows, orbit.flights, strict=True)):
        before, after = (i - 1) % len(flows), flows[(i + 1) % len(flows)]
        edge = flow_between(flows[before], after) == flow
        leaves = slid_along(flows[before])  # always at a tangency
        tangent = flows[before].until and not moves(flows[before]) and _touches(orbit, before)
        if leaves or tangent or edge:
            least = LEAVES if leaves else 0.0 if edge and slid_along(flow) else SHORTEST
            shrunk = partial(linear_condition, lengths, np.eye(len(flows))[i] - least, 0.0)
            where = "at the edge of sliding" if edge else "at a tangency"
            said = f"flow {i} shrinks to nothing, it begins {where}"
            yield Margin(flight.duration / orbit.period - least, shrunk, said, i)


def _touches(orbit: Cycle, flow: int) -> bool:
    """Tell whether the condition that ends a flow is all but touched, as at a tangency or VI: it
    falls slowly against its largest rate, and while the next flow lasts that changes it."""
    rate, pace = orbit.paces[flow]
    if pace >= 1e-2:
        return False
    equations, until = orbit.equations, orbit.equations.flows[flow].until
    assert until is not None
    lasts = orbit.flights[(flow + 1) % len(orbit.flights)].duration
    bend = abs(_Reached(equations, flow, until, 1.0, slice(1)).bend(orbit))
    return bool(1e-2 * abs(rate) < bend * abs(lasts))


def _collisions(orbit: Cycle) -> Iterator[Margin]:
    """Measure how far apart in time two conditions are met that come at once at a border collision:
    how long the flow between them lasts, and, of one that a clock ends, by how much it begins after
    the stroke before, at which it would end."""
    flows, flights, equations = orbit.equations.flows, orbit.flights, orbit.equations
    for i, (flow, flight) in enumerate(zip(flows, flights, strict=True)):
        number, clock = (i - 1) % len(flows), flow.until
        before = flows[number]
        if len(flows) == 1 or not before.until or system_of(before) or _touches(orbit, number):
            continue
        lengths = equations.layout.lengths
        shrunk = partial(linear_condition, lengths, np.eye(len(flows))[i], 0.0)
        said = f"flow {i} ends as it begins, at t = {flight.start:.6g}"
        yield Margin(flight.duration / orbit.period, shrunk, said, i, "until")
        if isinstance(clock, Clock) and not isinstance(before.until, Clock):
            late = float(clock.since(flight.start, None, orbit.params))
            system = _Reached(equations, i, clock.since, 0.0, slice(1)).system
            said = f"flow {i} begins as its clock strikes, at t = {flight.start:.6g}"
            yield Margin(late, system, said, i, "clock")


# --- all of them --------------------------------------------------------------------------------


def events_of_cycle(equations: FlowEquations) -> tuple[Event, ...]:
    """List the events of a cycle of these flows, and of those that follow where it meets walls."""
    flows, (lp, pd, ns) = equations.flows, (_CIRCLE.events[kind] for kind in ("LP", "PD", "NS"))
    free = max(flight.dimension for flight in equations.start) - equations.autonomous
    if free < 4:
        ns = replace(ns, count=None)  # without two pairs none leave the circle together
    if free < 3:
        pd = replace(pd, count=None)  # nor two that are real, where volumes shrink
    of_pairs = conservative_events(BRANCH_POINT) if equations.conservation else ()
    events = [*(of_pairs or (lp, BRANCH_POINT, pd, ns))]
    if equations.autonomous:  # beyond its conditions an orbit that meets them may shrink, too
        events += [_SHRUNK, HOMOCLINIC]
    if any(flow.guards for flow in flows):  # beyond a wall others follow, which have all of these
        met = chain(flows, *(wall for flow in flows for wall in flow.walls if not callable(wall)))
        slides = any(map(system_of, met))
        ends = [
            _Nearest("VI", _rates),
            _Nearest("CC", _collisions),
            _Nearest("GR", _clearances, _none if slides else shares),
            _Nearest("SL", shares, arrivals) if slides else _Nearest("GR", shares, _clearances),
        ]
        ends += [_Nearest("SL", arrivals, shares)] if slides else []
        events += [end.event() for end in ends]
    return tuple(events)
