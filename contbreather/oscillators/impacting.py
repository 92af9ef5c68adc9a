"""Walls at the sites: a breather of which one site impacts, as a cycle of two flows.

The flows end where the site comes to its walls, first the upper and then the lower one, and its
velocity v becomes -k v. All other walls are watched, but not met.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from ..continuation.algebra.newton import Array
from ..errors import BadInput, ContbreatherError, NoSolution
from ..flows.collocation import Collocation, TrajectorySegment, fitted
from ..flows.cycle_constructors import cycle
from ..flows.cycle_problem import Cycle, cycle_of
from ..flows.flow import Flow
from .anticontinuum import coded, together
from .attractors import DrivenOscillator
from .oscillator_lattice import Oscillators
from .potentials import Params

_VELOCITIES = (0.3, 0.6, 1.0, 1.6)  # with which a single oscillator sets out, in walls times omega
_SETTLES = 60  # periods


@dataclass(frozen=True, eq=False)
class WallDistance:
    """How far a site is off a wall, on one side: +1 above, -1 below."""

    chain: Oscillators
    site: int
    side: int

    def __call__(self, t: Any, x: Any, p: Params) -> Any:
        return self.chain.walls(0.0, p) - self.side * x[self.site]


@dataclass(frozen=True, eq=False)
class Bounce:
    """The state after an impact of a site."""

    chain: Oscillators
    site: int

    def __call__(self, t: Any, x: Any, p: Params) -> Any:
        after, v = np.array(x + 0.0 * self.chain.k(0.0, p)), self.chain.sites + self.site
        after[v] = -self.chain.k(0.0, p) * x[v]
        return after


def flows_between_walls(chain: Oscillators, site: int) -> tuple[Flow, Flow]:
    """The flows of a lattice of which one site impacts, up to its upper wall and to its lower."""
    ends = [WallDistance(chain, n, side) for n in range(chain.sites) for side in (1, -1)]
    mine, others = ends[2 * site : 2 * site + 2], ends[: 2 * site] + ends[2 * site + 2 :]
    upper, lower = (
        Flow(chain, until=end, reset=Bounce(chain, site), walls=tuple(others)) for end in mine
    )
    return upper, lower


def between_walls_without_coupling(
    chain: Oscillators, code: Any, p: Params, scheme: Collocation
) -> tuple[tuple[Flow, ...], tuple[TrajectorySegment, ...]]:
    """The flows, and the orbit of them, of a single impacting site."""
    sites = [*coded(chain, code)]
    if len(sites) > 1 or chain.drive is None:
        raise BadInput(
            f"code = {code!r}: with walls a driven lattice is needed, and one site that impacts; "
            "several impact at once without coupling, and their order is not known"
        )
    (site,) = sites
    orbit = _single(chain, site, p)
    resting = {n: DrivenOscillator(chain, n, p).periodic() for n in range(chain.sites) if n != site}
    flights = []
    for flight in orbit.flights:
        motions = {n: partial(_taken_back, motion, 2 * math.pi / p["omega"])
                   for n, motion in resting.items()}  # fmt: skip
        motions[site] = partial(_along, flight)
        states = partial(together, chain.sites, motions)
        flights.append(fitted(scheme, flight.start, flight.duration, states, flight.knots))
    upper, lower = flows_between_walls(chain, site)
    rises = orbit.flights[0].end[0] > 0
    return (upper, lower) if rises else (lower, upper), tuple(flights)


def _along(flight: TrajectorySegment, t: Array) -> Array:
    return flight.at((t - flight.start) / flight.duration)


def _taken_back(motion: Any, period: float, t: Array) -> Any:
    return motion(np.mod(t, period))


def _single(chain: Oscillators, site: int, p: Params) -> Cycle:
    """The impacting orbit of one site without coupling, by simulation."""
    alone, wall = DrivenOscillator(chain, site, p), float(chain.walls(0.0, p))
    k, period = float(chain.k(0.0, p)), alone.period

    def bounce(t: Any, x: Any, p: Params) -> Any:
        return [x[0], -k * x[1]]

    def field(t: Any, x: Any, p: Params) -> Any:
        return alone.field(t, x)

    flows = [
        Flow(field, until=lambda t, x, p: wall - x[0], reset=bounce),
        Flow(field, until=lambda t, x, p: wall + x[0], reset=bounce),
    ]
    for velocity in _VELOCITIES:
        start = {"u": 0.0, "v": velocity * wall * p["omega"]}
        try:
            found = cycle(
                flows, start, {}, period=period, settle=_SETTLES * period,
                collocation=Collocation(6, 6), events=(),
            )  # fmt: skip
        except ContbreatherError:
            continue
        if len(cycle_of(found).flights) == 2:
            return cycle_of(found)
    raise NoSolution(
        f"site {site}: alone it has no attractor that impacts once on each wall in a period"
    )
