"""Walls at the sites: a breather of which some sites impact, as a cycle of flows.

A flow ends where one of them comes to a wall, and its velocity v becomes -k v; by symmetry several
may come there at once. In which order they do is that of a simulation with a little coupling.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..continuation.algebra.newton import Array
from ..continuation.walk.trace import trace
from ..errors import BadInput, ContbreatherError, NoSolution
from ..flows.collocation import Collocation, TrajectorySegment, fitted
from ..flows.cycle_constructors import cycle
from ..flows.cycle_problem import Cycle, cycle_of
from ..flows.flow import Flow
from ..flows.functions import Params
from .anticontinuum import Uncoupled, forcing_period, single_field
from .oscillator_lattice import SHARE, Oscillators

_VELOCITIES = (0.3, 0.6, 1.0, 1.6)  # with which a single oscillator sets out, in walls times omega
_SETTLES, _SETTLED = 60, 0.8  # periods; and the restitution up to which these do
_LEAST = 0.02  # share of the coupling from which it is walked
_LITTLE = 0.05  # the share of the coupling that tells in which order several sites impact
_SHRUNK, _BEYOND = 1e-5, 0.01  # of a period; and the share where the next order is looked for
_AT_ONCE = 1e-7  # relative to the walls: what is as close to one impacts as well


@dataclass(frozen=True, eq=False)
class WallDistance:
    """How far a site is off a wall, on one side: +1 above, -1 below."""

    chain: Oscillators
    site: int
    side: int
    terminal, direction = True, -1.0  # as an event of a simulation

    def __call__(self, t: Any, x: Any, p: Params) -> Any:
        return self.chain.walls(0.0, p) - self.side * x[self.site]


@dataclass(frozen=True, eq=False)
class Bounce:
    """The state after an impact of some sites: of the first one, and of others that are at their
    walls at once, or, to first order, a little sooner or later."""

    chain: Oscillators
    sites: tuple[int, ...]

    def __call__(self, t: Any, x: Any, p: Params) -> Any:
        chain, k, n = self.chain, self.chain.k(0.0, p), self.chain.sites
        after = np.array(x + 0.0 * k)
        for site in self.sites:
            after[n + site] = -k * x[n + site]
        if others := self.sites[1:]:
            before, behind, wall = chain(t, x, p), chain(t, after, p), chain.walls(0.0, p)
            after = after + 0.0 * behind  # which may be complex
            for site in others:
                left = np.sign(np.real(x[site])) * wall - x[site]
                after[site] = x[site] + (1 + k) * left
                late = left / x[n + site]
                after[n + site] -= late * (k * before[n + site] + behind[n + site])
        return after


def between_walls(chain: Oscillators, walls: Sequence[Any], sites: Sequence[int]) -> Flow:
    """The flow up to the first of these walls, (site, side), where some sites impact; the others
    are watched."""
    met, *others = (WallDistance(chain, *wall) for wall in walls)
    watched = (Flow(chain, until=wall, reset=Bounce(chain, (wall.site,))) for wall in others)
    return Flow(chain, until=met, reset=Bounce(chain, tuple(sites)), walls=tuple(watched))


def between_walls_without_coupling(
    chain: Oscillators, code: dict[int, Any], given: Params, scheme: Collocation
) -> Uncoupled:
    """Flows, and an orbit of them at a share of the coupling, of impacting sites."""
    if chain.drive is None:
        raise BadInput(
            "between walls a driven lattice is needed, drive='a*cos(omega*t)' for instance: orbits "
            "of a conservative one from impact to impact are not looked for"
        )
    if any(value != 1 for value in code.values()):
        raise BadInput(
            f"code = {code!r}: 1 is expected for each site that impacts. All sites follow one "
            "drive: what moves half a period later has -1 in the row drive= of its Lattice."
        )
    orbits = {n: _single(chain, given, n) for n in code}
    first = orbits[next(iter(code))].flights[0]
    begin, x = first.start + 0.5 * first.duration, np.zeros(2 * chain.sites)
    if not chain.bare:  # the others beside rest, whether that attracts or not
        period = forcing_period(0.0, None, given)
        samples = np.linspace(0, period, 9), np.zeros((x.size, 9))
        rest = cycle(chain, samples, {**given, SHARE: 0.0}, period=period, events=())
        x = cycle_of(rest).states(begin)
    for n, orbit in orbits.items():
        x[[n, chain.sites + n]] = orbit.states(begin)
    share = _LITTLE if len(code) > 1 else 0.0
    pieces = _from_impact_to_impact(chain, tuple(code), {**given, SHARE: share}, begin, x, scheme)
    # without any, sites that no potential and no damping holds would be free
    return *pieces, max(share, _LEAST if chain.bare and chain.damping is None else 0.0)


def in_another_order(
    orbit: Cycle, chain: Oscillators, sites: tuple[int, ...], scheme: Collocation
) -> Uncoupled | None:
    """Go on beyond where two sites come to their walls at once: flows, an orbit of them and its
    share of the coupling. None where no flow has shrunk to nothing."""
    if len(sites) == 1 or orbit.durations.min() > _SHRUNK * orbit.period:
        return None
    longest = orbit.flights[int(orbit.durations.argmax())]
    begin = longest.start + 0.5 * longest.duration
    share = min(1.0, orbit.params[SHARE] + _BEYOND)
    p, x = {**orbit.params, SHARE: share}, orbit.states(begin)
    return *_from_impact_to_impact(chain, sites, p, begin, x, scheme), share


def _from_impact_to_impact(
    chain: Oscillators, sites: tuple[int, ...], p: Params, begin: float, x: Array,
    scheme: Collocation,
) -> tuple[tuple[Flow, ...], tuple[TrajectorySegment, ...]]:  # fmt: skip
    """Simulate for a period: the flows of what returns from a state, or next to it."""
    ends = [WallDistance(chain, n, side) for n in range(chain.sites) for side in (1, -1)]
    walls, period = [wall for wall in ends if wall.site in sites], 2 * math.pi / p["omega"]
    if len(sites) > 1:
        x = _returning(chain, walls, p, begin, x, period)
    (motion, _, bounce), *_ = _flown(chain, walls, p, begin, x, period)
    start = motion.t_max, bounce(0.0, motion(motion.t_max), p)
    flights = [*_flown(chain, walls, p, *start, period * (1 + _AT_ONCE))]
    flows, fits, (_, before, _) = [], [], flights[-1]
    for motion, met, bounce in flights:
        if not met:
            raise NoSolution(f"sites {sites}: from impact to impact they do not return")
        near = (*met, *before[1:])  # met with another: it is there to begin with
        watched = (met[0], *(wall for wall in ends if wall not in near))
        flows.append(between_walls(chain, [(w.site, w.side) for w in watched], bounce.sites))
        fits.append(fitted(scheme, motion.t_min, motion.t_max - motion.t_min, motion))
        before = met
    return tuple(flows), tuple(fits)


def _flown(
    chain: Oscillators, walls: list[WallDistance], p: Params, t: float, x: Array, time: float
) -> Iterator[tuple[Any, tuple[WallDistance, ...], Bounce]]:
    """Simulate from impact to impact: each motion, the walls that it meets, and how it goes on. The
    last may meet none."""
    n, near = chain.sites, _AT_ONCE * float(chain.walls(0.0, p))
    end = t + time
    while t < end:
        run = chain.run((t, end), x, p, events=walls)
        t, x = float(run.t[-1]), run.y[:, -1]
        outwards = (w for w in walls if w(t, x, p) < near and w.side * x[n + w.site] > 0)
        met = tuple(outwards) if run.status == 1 else ()
        bounce = Bounce(chain, tuple(wall.site for wall in met))
        yield run.sol, met, bounce
        x = bounce(t, x, p)
        end = t if run.status == 1 and end - t < 2 * _AT_ONCE * time else end


def _returning(
    chain: Oscillators, walls: list[WallDistance], p: Params, t: float, x: Array, period: float
) -> Array:
    """Improve a state that all but comes back after a period."""
    from scipy.optimize import root

    size: float = abs(x).max()

    def off(move: Array) -> Array:
        *_, (motion, _, _) = _flown(chain, walls, p, t, x + size * move, period)
        return np.asarray(motion(motion.t_max) - x - size * move)

    # moves begin at 0, where steps of differences are the root of `eps`
    moved = root(off, np.zeros(x.size), options={"eps": 1e-12, "xtol": 1e-2 * _AT_ONCE}).x
    return np.asarray(x + size * moved)


def _single(chain: Oscillators, p: Params, site: int) -> Cycle:
    """The impacting orbit of one site without coupling: by simulation where impacts lose enough to
    settle, and from there along the restitution."""
    wall, k = float(chain.walls(0.0, p)), float(chain.k(0.0, p))
    field, period = single_field(chain, site, p), forcing_period(0.0, None, p)

    def up_to(side: int) -> Flow:
        return Flow(
            field, until=lambda t, x, p: wall - side * x[0],
            reset=lambda t, x, p: [x[0], -p["k"] * x[1]],
        )  # fmt: skip

    flows = [up_to(1), up_to(-1)]
    how: dict[str, Any] = {"period": period, "settle": _SETTLES * period, "events": ()}
    how["collocation"] = Collocation(6, 6)
    for velocity in _VELOCITIES:
        start = {"u": 0.0, "v": velocity * wall * p["omega"]}
        with suppress(ContbreatherError):
            found = cycle(flows, start, {"k": min(k, _SETTLED)}, **how)
            twice = len(cycle_of(found).flights) == 2
            if twice and k > _SETTLED:
                found = trace(found, "k", within={"k": (0.0, k)}, towards="up")[-1].problem
            if twice and found.params["k"] == k:
                return cycle_of(found)
    raise NoSolution(
        f"site {site}: alone it has no orbit that impacts once on each wall in a period, and "
        f"attracts where impacts keep at most {_SETTLED:g} of their velocity"
    )


def refuse_impacts_apart(orbit: Cycle) -> None:
    """Refuse an orbit in which sites that impacted at once with a little coupling no longer do."""
    resets: list[Any] = [flow.reset for flow in orbit.equations.flows]
    for bounce, flight in zip(resets, orbit.flights, strict=True):
        (first, *others), far = bounce.sites, abs(flight.end)
        for site in others:
            if abs(far[site] - far[first]) > 1e-9 * far[first]:
                raise NoSolution(
                    f"sites {first} and {site} impact at once with a little coupling, and one "
                    "after the other with all of it: which order follows is not known"
                )
