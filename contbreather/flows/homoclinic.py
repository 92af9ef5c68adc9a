"""HOM: the period grows without bound, for the cycle comes to rest at equilibria.

A cycle of a long period T is as good as the homoclinic orbit. The parameter is off by about
``exp(-a T)`` with a the smaller one, in size, of the leading eigenvalues +-a and -+b, one to each
side, while the orbit comes as close as ``d = exp(-a b T / (a + b))``: so by ``d^(1 + a / b)``, or,
where what is contracted on the way around makes it less, as the tangent of the branch tells. Beyond
rounding and the mesh decide where it folds. So it is found where a branch ends, and followed in two
parameters at the period it has there. Before a saddle-node, u' = m + u^2, it is off by m, and m T^2
is pi^2. Where the orbit comes to rest more than once a period, how
the time is shared is as undetermined: that is told less closely.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..continuation.algebra.newton import Array
from ..continuation.curve.curve import Curve
from ..continuation.curve.point import NOTHING, DefiningSystem, Event, Examined, Point
from ..continuation.systems.defining_systems import linear_condition
from .collocation import AT_REST, sizes_of
from .cycle_problem import ONE, Cycle
from .equations import equations_of
from .flow import TurnedBack, slid_along
from .functions import Function, kink, slopes, values
from .rotation import PERIODIC

# of its pace: the square of its speed relative to that around a circle as large, in as long a time
_SLOW, _FAST = 1e-2, 0.1  # it may rest, and it is on its way again
_LOOKS, _MOSTLY = 400, 0.5  # or it is there for most of its time: one is about to appear
_ITERATIONS, _SOLVED = 30, 1e-12
_MOVES_STILL = 1e-3  # a parameter that moves by more while the period grows by itself is at no end
_GROWS = "the period grows without bound"


@dataclass(frozen=True, eq=False)
class _Passage:
    """Place where an orbit is slowest on its way from fast to fast: its pace, the flow, the state,
    how much the states of that flow move, and the place where it sets off again."""

    pace: float
    orbit: Cycle
    flow: int
    state: Array
    sizes: Array
    leaves: _Passage | None = None
    passed: Array = field(default_factory=lambda: np.empty((0, 0)))  # states on the way here

    @property
    def surface(self) -> Function | None:
        """Function that is zero where it slides: equilibria there are of neither field."""
        system = slid_along(self.orbit.equations.flows[self.flow])
        return None if system is None else system.h

    def near(self, states: Array, place: Array, most: float = 1e-2) -> Any:
        """Tell which states are as close as `most`, in its size."""
        return np.linalg.norm((states - place) / self.sizes, axis=-1) < most

    def off(self, most: float) -> float:
        """Evaluate ln of d^(1 + a/b) over the most that it may be."""
        rest, d = self.rest if self.pace < _SLOW else None, self.pace  # where it is fast none is
        if rest:
            d = float(np.linalg.norm((self.state - rest.state) / self.sizes))
        # before a saddle-node, or beside what is none; a sink or a source is as far off as p
        sizes = np.array([0.0 if rest and self.stops else 0.5, 1.0])
        if rest and rest.leading.size:
            sizes = abs(rest.leading.real)
        return float((1 + sizes.min() / sizes.max()) * math.log(max(d, 1e-300)) - math.log(most))

    @cached_property
    def rest(self) -> _Rest | None:
        """The equilibrium close by, by Newton's iteration from there; None if there is none."""
        return self.equilibrium(1e-2)

    @cached_property
    def stops(self) -> str:
        """Say whether its flow ends at a sink, or begins at a source, as after a reset; empty
        elsewhere."""
        states, rest = self.orbit.flights[self.flow].states, self.rest
        if not rest or rest.leading.size or not rest.more_in:
            return ""
        how, end = ("ends", -1) if rest.more_in > 0 else ("begins", 0)
        return how if (self.state == states[end]).all() else ""

    @cached_property
    def ahead(self) -> _Rest | None:
        """The saddle to which it comes long after, along a slow direction: somewhere on its way it
        is all but off it that way alone."""
        saddle = self.leaves.equilibrium(1.0) if self.leaves else None
        if saddle is None or not saddle.leading.size:
            return None
        sizes = saddle.at.sizes
        off = (saddle.at.passed - saddle.state) / sizes
        out = off @ (saddle.outwards * sizes / sizes[:, None]).T
        shares = np.linalg.norm(out, axis=1) / np.linalg.norm(off, axis=1)
        return saddle if shares.min() < 0.1 and not saddle.cut_off else None

    @property
    def swings(self) -> bool:
        """Tell whether the slower way, in to its equilibrium or out, is around it (Shilnikov)."""
        rest = self.rest or self.ahead
        return bool(
            rest and rest.leading.size and min(rest.leading, key=lambda v: abs(v.real)).imag
        )

    def equilibrium(self, most: float) -> _Rest | None:
        f, x, sizes = self.orbit.equations.flows[self.flow].f, self.state, self.sizes
        last = math.inf
        for _ in range(_ITERATIONS):
            velocity, derivative = slopes(f, 0.0, x[:, None], self.orbit.params)
            matrix = derivative[:, : x.size, 0]
            rows, off = matrix, velocity
            if self.surface:
                h, slope = slopes(self.surface, 0.0, x[:, None], self.orbit.params)
                rows, off = np.vstack([matrix, slope[:, : x.size, 0]]), np.vstack([velocity, h])
            if not np.isfinite(rows).all():  # beyond its domain
                return None
            step = np.linalg.lstsq(rows, off[:, 0])[0]  # some states may always stay
            x, size = x - step, float(np.linalg.norm(step / sizes))
            # where there is none they wander about, and may come to another one by chance
            if not (size < last and self.near(x, self.state, most)):
                return None
            last = size
            if (abs(step) <= _SOLVED * (sizes + abs(x))).all():
                break
        else:
            return None
        values, ways = np.linalg.eig(matrix)
        least = 1e-9 * abs(values).max()  # less is of what stays constant
        inwards, outwards = values[values.real < -least], values[values.real > least]
        if self.surface and not inwards.size:  # orbits come to the surface in a finite time
            inwards = np.array([-math.inf])
        leading = np.empty(0, complex)
        if inwards.size and outwards.size:
            leading = np.array([inwards[inwards.real.argmax()], outwards[outwards.real.argmin()]])
        state = np.where(abs(x) > _SOLVED * sizes, x, 0.0)
        out = (ways * (values.real > least) @ np.linalg.pinv(ways)).real
        return _Rest(self, state, leading, inwards.size - outwards.size, out)


@dataclass(frozen=True, eq=False)
class _Rest:
    """An equilibrium, and of a saddle the eigenvalues next to the imaginary axis on either side."""

    at: _Passage
    state: Array
    leading: NDArray[np.complex128]
    more_in: int  # how many more ways lead in than out
    outwards: Array  # projection onto the ways out

    def __str__(self) -> str:
        shown = " and ".join(
            f"{v.real:.6g}" + (f" +- {abs(v.imag):.6g}i" if v.imag else "") for v in self.leading
        )
        return f"leading eigenvalues {shown}, saddle quantity {self.leading.sum().real:.6g}"

    @property
    def cut_off(self) -> bool:
        """Tell whether the field has a pole, or a jump, on the straight way from there."""
        orbit, start = self.at.orbit, self.at.state[:, None]
        f, way = orbit.equations.flows[self.at.flow].f, self.state[:, None] - start
        times = np.linspace(0.0, 1.0, _LOOKS)
        return kink(f, lambda t: start + t * way, times, orbit.params) is not None

    def images(self) -> Iterator[_Rest]:
        """This one, and of half a symmetric orbit its mirror image."""
        yield self
        if (mirror := self.at.orbit.mirror) is not None:
            image = values(mirror, 0.0, self.state[:, None], self.at.orbit.params)[:, 0]
            yield replace(self, state=image + 0.0)

    def same(self, other: _Rest) -> bool:
        """Tell whether both are one place, or one some turns later, to which the field is blind."""
        orbit, flows = self.at.orbit, self.at.orbit.equations.flows
        if (f := flows[self.at.flow].f) != flows[other.at.flow].f:
            return False
        if self.at.near(self.state, other.state):
            return True
        there = orbit.flights[self.at.flow].states.T
        moved = there + (other.state - self.state)[:, None]
        here, later = (values(f, 0.0, x, orbit.params) for x in (there, moved))
        turns = any(isinstance(flow.reset, TurnedBack) for flow in flows)
        return turns and bool(abs(later - here).max() <= PERIODIC * (1.0 + abs(here).max()))


def _passages(orbit: Cycle) -> list[_Passage]:
    """List the slow passages, the slowest first; at least one."""
    # by its own motion, however far from zero: beside its values a small one would be slow
    sizes = sizes_of(orbit.flights, orbit.equations.units, AT_REST)
    moved = zip(orbit.velocities, sizes, strict=True)
    speeds = np.concatenate([np.vecdot(v := way / size, v) for way, size in moved])
    pace = speeds * (orbit.period / math.pi) ** 2
    places = [(i, state, sizes[i]) for i, f in enumerate(orbit.flights) for state in f.states]

    def at(j: int, *more: Any) -> _Passage:
        return _Passage(float(pace[j]), orbit, *places[j], *more)

    def passage(s: NDArray[np.intp]) -> _Passage:
        passed = [places[k][1] for k in s if places[k][0] == places[s[-1]][0]]
        return at(min(s, key=pace.item), at(s[-1], None, np.array(passed)))

    if pace.min() >= _SLOW:  # one will do
        return [at(int(pace.argmin()))]
    around = np.roll(np.arange(pace.size), -int(pace.argmax()))
    pieces = np.split(around, np.flatnonzero(pace[around] > _FAST))
    slowest = sorted((passage(s) for s in pieces if s.size), key=attrgetter("pace"))
    return [passage for passage in slowest if passage.pace < _SLOW]


def _pace(point: Point) -> float:
    first, *more = _passages(point.solution)
    # how far off the parameter is, but for a factor, where it has come to rest, and a second time.
    # Where it swings no tangent tells more, and a turn of the period brings it closer by little
    off = _off(point, first, 1e-6 if first.pace < _SLOW and first.swings else 1e-8)
    for passage in more:
        off = min(off, passage.off(1e-6))
    # of most orbits none is close: the sign is known
    return off if off > 0 else max(off, _moves(point) - math.log(_MOVES_STILL))


def _off(point: Point, slowest: _Passage, most: float) -> float:
    """Evaluate ln of how far off the parameter is over the most that it may be: no more than what
    the saddle says, which is without what is contracted on the way around.

    As a Poincare map has it u_1 = p + F(u_0), and a cycle u_0 (1 - mu) = p, while p is off by u_0,
    or mu u_0 if that is more: the tangent of the branch tells p. Where F swings, the branch
    does so, too, and p is off by more than that at each of its folds.
    """
    off = slowest.off(most)
    # at a fold both the tangent and 1 - mu vanish: their ratio is rounding
    if off <= 0 or slowest.pace > _SLOW or slowest.orbit.off_one < ONE:
        return off
    mu = slowest.orbit.others
    held = np.log(np.maximum(abs(mu), 1.0) / abs(1 - mu)).sum()
    known = _moves(point) + float(held) - math.log(most)
    return known if known < off and not slowest.swings else off


def _moves(point: Point) -> float:
    """Evaluate ln of T dp/dT, relative to the parameter: a cycle may pass close by saddles without
    an orbit that is homoclinic, as where it runs along two axes."""
    equations = equations_of(base := point.base_point)
    curve, tangent, lengths = base.curve, point.tangent, equations.layout.lengths
    if base is not point:  # in two parameters the period stays: along a branch in the first
        curve = Curve(base.problem, base.curve.free[:1])
        tangent = curve.tangent_at(z := curve.start, np.eye(1, z.size, lengths[0])[0])[0]
    if tangent is None:
        return math.nan  # changes neither the least nor the largest of what else is known
    if not (names := {*curve.free} - {"period", *equations.givens[:1]}):
        return math.nan  # a time comes to no limit
    moved = 0.0
    for name in names:
        known = point[name], curve.start[curve.slots[name]], curve.problem.scales.get(name, 0.0)
        moved = max(moved, abs(tangent[curve.slots[name]]) / (np.abs(known).max() or 1.0))
    longer = float(abs(tangent[lengths].sum())) / base.solution.period
    return math.log(max(float(moved), 1e-300) / max(longer, 1e-300))


def _examine(point: Point) -> Examined:
    """Name the equilibria: a relaxation oscillation is slow without one."""
    orbit: Cycle = point.base_point.solution
    if point.tangent is not None and point.tangent[orbit.equations.layout.lengths].sum() <= 0:
        return NOTHING  # states that grow without bound are as slow, beside their size
    if coarse := orbit.coarse():
        return coarse
    slow, *more = _passages(orbit)
    if slow.pace >= _SLOW:
        return NOTHING
    saddles = [rest for passage in (slow, *more) if (rest := passage.rest) and rest.leading.size]
    if slow.rest in saddles:
        return _description(saddles)
    if slow.rest and slow.stops:
        said = f"{_GROWS}: a flow {slow.stops} at the equilibrium {_named(orbit, slow.rest.state)}"
        return {"equilibrium": slow.rest.state, "said": said}
    flight = orbit.flights[slow.flow]
    there = slow.near(flight.at(np.linspace(0.0, 1.0, _LOOKS)).T, slow.state)
    if there.mean() * flight.duration >= _MOSTLY * orbit.period:
        kind = "a pseudo-equilibrium" if slow.surface else "an equilibrium"
        said = f"{_GROWS}: {kind} is about to appear on it, at {_named(orbit, slow.state)}"
        return {"equilibrium": slow.state, "said": said}
    # along a slow direction it comes to the saddle long after the parameter has come to its limit
    if slow.ahead and slow.ahead.leading.size:
        return _description([slow.ahead])
    return "it is slow without an equilibrium"


def _description(rests: list[_Rest]) -> dict[str, Any]:
    """Describe the end of a cycle that rests at these, the longest at the first."""
    first, saddles = rests[0], list[_Rest]()
    for saddle in (image for rest in rests for image in rest.images()):
        if not any(map(saddle.same, saddles)):
            saddles.append(saddle)
    orbit = first.at.orbit
    if len(saddles) > 1:
        names = " and ".join(f"{_named(orbit, s.state)} ({s})" for s in saddles)
        said = f"{_GROWS}, to a heteroclinic cycle between the saddles {names}"
        return {"equilibrium": first.state, "said": said}
    kind = "saddle-focus" if first.leading.imag.any() else "saddle"
    kind = f"pseudo-{kind}" if first.at.surface else kind
    times = f", which it passes {len(rests)} times" if len(rests) > 1 else ""
    said = f"to an orbit homoclinic to the {kind} {_named(orbit, first.state)}{times}; {first}"
    # Re lambda_s + Re lambda_u: its sign decides which cycles come from the orbit
    quantity = float(first.leading.sum().real)
    return {"equilibrium": first.state, "saddle_quantity": quantity, "said": f"{_GROWS}, {said}"}


def _named(orbit: Cycle, state: Array) -> str:
    return ", ".join(f"{n} = {v:.6g}" for n, v in zip(orbit.equations.states, state, strict=False))


def _long(point: Point) -> DefiningSystem:
    """Cycles of the period that the one has that is as good as homoclinic."""
    lengths = equations_of(base := point.base_point).layout.lengths
    total = float(base.z[lengths].sum())
    # multipliers are 0 or without bound
    nothing = dict.fromkeys(("LP", "BP", "PF", "PD", "NS", "KC"), ())
    return linear_condition(lengths, np.ones(lengths.size), total, events=(_MOVES,), meets=nothing)


def _rests(point: Point) -> float:
    # where the parameter is off by more, but for a factor, it is as good as homoclinic no more
    return _off(point, _passages(point.base_point.solution)[0], 1e-4)


def _examine_moving(point: Point) -> Examined:
    return {"said": "it comes to rest no more: this period is too short here, trace a longer one"}


_MOVES = Event("HOM", _rests, examine=_examine_moving, ends="branch")
HOMOCLINIC = Event("HOM", _pace, locus=_long, examine=_examine, ends="branch")
