"""Constructors of breathers: from the limit without coupling to the coupling that is asked for."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from ..checks import check_kind, number
from ..continuation.algebra.newton import Array
from ..continuation.bifurcations.equilibria import fold
from ..continuation.curve.branch import Branch
from ..continuation.curve.point import Event
from ..continuation.walk.trace import trace
from ..errors import BadInput, NoSolution, NotConverged
from ..flows.collocation import Collocation, TrajectorySegment, sizes_of
from ..flows.cycle_constructors import named_state
from ..flows.equations import FlowEquations
from ..flows.flow import Flow
from ..flows.sparse_equations import FEW
from ..one_thread import one_thread
from ..storage.serialise import serialised
from .anticontinuum import (
    Uncoupled,
    coded,
    driven_without_coupling,
    forcing_period,
    half_without_coupling,
    refuse_other_period,
    resonance,
)
from .breather_events import events_of_breather
from .breather_problem import COLUMNS, Breather, BreatherProblem
from .half_orbit import HalfOrbit, Resting, SparseHalfOrbit, half_period
from .impacting import (
    between_walls,
    between_walls_without_coupling,
    in_another_order,
    refuse_impacts_apart,
)
from .oscillator_lattice import SHARE, Oscillators
from .potentials import Params

WHOLE = Collocation(12, 6)  # errors about 1e-11 where few harmonics matter
_RESOLVED, _TAIL = 1e-10, 1e-4
_MOST = 400  # intervals that are not made finer


class CouplingEnds(NoSolution):
    """The walk in the coupling ends on its way, at a share of what was asked for."""

    def __init__(self, reason: str, share: float) -> None:
        super().__init__(reason)
        self.share = share


@one_thread
def breather(
    chain: Oscillators,
    code: Any,
    *,
    omega: float,
    params: Mapping[str, float] | None = None,
    collocation: Collocation | None = None,
    events: Iterable[Event] | None = None,
    label: str = "",
) -> BreatherProblem:
    """A breather of a lattice of oscillators, as a problem to trace.

    Without coupling each site of the code is the single oscillator at that frequency, all others
    rest. From there the coupling is walked up to what was asked for.

    Parameters
    ----------
    chain : Oscillators
    code : dict
        ``{site: 1}``, with -1 for one that is half a period later, or an amplitude, where the
        single oscillator has several of one frequency: that nearest to it.
    omega : float
        The frequency, a parameter of the breather.
    params : dict
        Name and value of each parameter of the formulas.
    collocation : Collocation, optional
        Intervals of a whole period and points in each; by default as many as errors of about 1e-10
        need, from ``Collocation(intervals=12, points=6)`` on.
    events : iterable of Event, optional
        What a walk looks for by default.
    label : str, optional
        Shown in tables.

    Returns
    -------
    BreatherProblem
        ``.solution``, and that of each point, is a `Breather`. Of a conservative lattice "energy"
        may be the free parameter in place of "omega", which is a column then.

    Raises
    ------
    BadInput
        Where the code or the parameters do not fit the lattice, or rest is no equilibrium of it.
    NoSolution
        Where no site has that frequency, or the breather ends on the way: the sentence says where,
        and which harmonic is in the band of small oscillations, or next to it.

    Examples
    --------
    >>> import contbreather as cb
    >>> chain = cb.Oscillators(V="u**2/2 + u**4/4", W="c*r**2/2", lattice=cb.Ring(5))
    >>> round(cb.breather(chain, {2: 1}, omega=1.5, params={"c": 0.05}).solution.energy, 9)
    1.477892933
    """
    check_kind(chain, Oscillators, "a lattice of oscillators, Oscillators(V=, W=, lattice=)")
    values = _params(chain, {} if params is None else params, omega)
    code = coded(chain, code)
    scheme = collocation or WHOLE
    if chain.walls is not None or not chain.dissipative:  # it is made of two halves
        scheme = replace(scheme, intervals=max(2, -(-scheme.intervals // 2)))
    reached = None
    with suppress(NoSolution):  # on few points first: they lead there as well
        reached = _walked(chain, code, values, replace(scheme, points=min(scheme.points, 4)))
    reached = reached or _walked(chain, code, values, scheme)
    # once more on a mesh that follows it, of as many intervals as it needs
    flights = reached.residual.flights(reached.x, reached.params)
    sizes = sizes_of(flights)
    start = tuple(
        flight.on(flight.knots, scheme).adapted(size)
        for flight, size in zip(flights, sizes, strict=True)
    )
    equations = replace(reached.residual, start=start, sizes=sizes)
    wanted = events_of_breather(equations) if events is None else tuple(events)
    named = BreatherProblem.of(equations, values, wanted, label or "breather")
    problem: Any = named.solve(tolerance=1e-12)[0]
    while collocation is None and _coarse(problem.solution) and problem.start["mesh"].size < _MOST:
        problem = problem.halved().solve(tolerance=1e-12)[0]
    return problem


def _coarse(orbit: Breather) -> bool:
    """Tell whether errors may be above 1e-10: by the trivial multiplier, or where there is none by
    the highest term of its polynomials."""
    if orbit.paired:
        return abs(orbit.trivial - 1) > _RESOLVED
    return max(flight.unresolved()[0] for flight in orbit.flights) > _TAIL


def _params(chain: Oscillators, params: Mapping[str, float], omega: float) -> dict[str, float]:
    """Check parameters, and what the lattice does with them at rest."""
    _, values = named_state({"u": 0.0}, params, *COLUMNS, "unstable")
    values["omega"] = number("omega", omega, 1e-300, 1e300, "a frequency above 0")
    if missing := [name for name in chain.names if name not in values]:
        raise BadInput(f"params has no {missing[0]!r}, on which the lattice depends: {chain!r}")
    if chain.written and (more := [name for name in params if name not in chain.names]):
        raise BadInput(f"params has {more[0]!r}, which is in no formula of the lattice: {chain!r}")
    if chain.walls is not None:
        number("walls", float(chain.walls(0.0, values)), 1e-300, 1e300, "where they are, above 0")
        number("k", float(chain.k(0.0, values)), 0.0, 1.0, "a restitution from 0 to 1")
    force = abs(chain.gradient(np.zeros(chain.sites), values))
    if not force.max() <= 1e-12:
        n = int(force.argmax())
        raise BadInput(
            f"u = 0 is no equilibrium: the force on site {n} is {force[n]:.3g} there; write the "
            "potentials so that all sites rest at 0"
        )
    refuse_other_period(chain, values)
    if chain.walls is None and not chain.dissipative:
        u = np.linspace(0.1, 0.4, chain.sites)  # anywhere, and shifted as a whole
        here, there = chain.gradient(u, values), chain.gradient(u + 0.3, values)
        if abs(there - here).max() <= 1e-12 * abs(here).max():
            raise BadInput(
                "all sites may be shifted together, so that no breather stands alone: hold the "
                "ends, OpenChain(n, ends='fixed'), or give the sites a potential V"
            )
    return values


def _walked(chain: Oscillators, code: Any, params: Params, scheme: Collocation) -> BreatherProblem:
    """Walk from no coupling to all of it."""
    walls = chain.walls is not None
    alone = driven_without_coupling if chain.dissipative else half_without_coupling
    start = (between_walls_without_coupling if walls else alone)(chain, code, params, scheme)
    while (branch := _with_more_coupling(chain, code, start, params))[-1][SHARE] < 1.0:
        other = in_another_order(branch[-1].solution, chain, tuple(code), scheme)
        if other is None:
            raise _refusal(chain, code, branch, params["omega"])
        start = other
    if walls:
        refuse_impacts_apart(branch[-1].solution)
    problem: Any = branch[-1].problem
    return problem


def _with_more_coupling(chain: Oscillators, code: Any, begin: Uncoupled, params: Params) -> Branch:
    """Walk from a share of the coupling, as far as this orbit goes."""
    flows, flights, share = begin
    params, sizes = {**params, SHARE: share}, sizes_of(flights)
    start = tuple(flight.adapted(size) for flight, size in zip(flights, sizes, strict=True))
    equations = _equations(chain, flows, start, sizes)
    try:
        first = BreatherProblem.of(equations, params, (), "").solve(tolerance=1e-11)[0]
    except NotConverged as error:
        raise NoSolution(
            f"{code}: without coupling it cannot be continued; "
            f"{resonance(chain, params['omega'], params)}"
        ) from error
    ends = (replace(fold(), ends="branch"),)
    return trace(first, SHARE, within={SHARE: (0.0, 1.0)}, towards="up", events=ends)


def _equations(
    chain: Oscillators, flows: tuple[Flow, ...], start: tuple[TrajectorySegment, ...],
    sizes: tuple[Array, ...], turns: int = 1,
) -> FlowEquations:  # fmt: skip
    names = tuple(f"{letter}{n}" for letter in "uv" for n in range(chain.sites))
    kind, period = FlowEquations, forcing_period
    if not chain.dissipative:
        kind, period = (SparseHalfOrbit if len(names) >= FEW else HalfOrbit), half_period
    return kind(flows, start, period, turns, names, sizes)


@serialised("breather")
def _from_dict(
    *, label: str, chain: Oscillators, turns: int, begin: float, flights: Any,
    start: Mapping[str, Any], params: Params,
) -> BreatherProblem:  # fmt: skip
    """Make the equations of a breather again, which begin at these unknowns."""
    unknowns, t = [np.ravel(value) for value in start.values()], start.get("phase", begin)
    intervals, n = np.cumsum([count for count, *_ in flights]), 2 * chain.sites
    (orbit, mesh, durations), flows, segments = unknowns[:3], [], []
    smooth = Flow(chain, reset=None if chain.dissipative else Resting("vv"))
    pieces = np.split(orbit, n * intervals), np.split(mesh, intervals), durations
    for flight, states, inner, duration in zip(flights, *pieces, strict=False):
        count, points, rounds, _, walls, sites = flight
        flows.append(between_walls(chain, walls, sites) if walls else smooth)
        knots, none = np.concatenate([[0.0], inner[:-1], [1.0]]), np.zeros((count, points, n))
        scheme, x = Collocation(count, points), states.reshape(-1, n)
        segments.append(TrajectorySegment(scheme, knots, t, duration, x, none, rounds))
        t += duration
    sizes = tuple(np.array(flight[3]) for flight in flights)
    equations = _equations(chain, tuple(flows), tuple(segments), sizes, turns)
    if isinstance(equations, HalfOrbit) and "energy" in params:
        equations = equations.holding("energy")
    equations = replace(equations, start=equations.flights(np.concatenate(unknowns), params))
    return BreatherProblem.of(equations, params, events_of_breather(equations), label)


def _refusal(chain: Oscillators, code: Any, branch: Branch, omega: float) -> CouplingEnds:
    """Say how far a breather reaches, and why not farther."""
    end = max((*branch.special, branch[-1]), key=lambda point: float(point[SHARE]))
    turns = "it turns back" if end.kind == "LP" else "its steps shrink to nothing"
    return CouplingEnds(
        f"{code} at omega = {omega:.6g} reaches {end[SHARE]:.4g} of the coupling that was asked "
        f"for; there {turns}. Of its harmonics {resonance(chain, omega, end.params)}.",
        float(end[SHARE]),
    )
