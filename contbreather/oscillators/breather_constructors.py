"""Constructors of breathers: from the limit without coupling to the coupling that is asked for; and
a catalogue of them, one code of each class of codes that symmetries make alike."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from operator import attrgetter
from typing import Any

import numpy as np
from scipy import sparse

from ..checks import check_kind, number, whole
from ..continuation.bifurcations.equilibria import fold
from ..continuation.curve.branch import Stop
from ..continuation.curve.point import Event
from ..continuation.walk.trace import trace
from ..errors import BadInput, NoSolution, NotConverged, partial_result
from ..flows.collocation import Collocation
from ..flows.cycle_constructors import named_state
from ..flows.cycle_events import AT_ONCE, touches
from ..flows.functions import Params
from ..one_thread import one_thread
from ..orbits.multibreathers import classes_of, exchanges_of_sites
from ..tables import HtmlRepr, Sheet
from .anticontinuum import (
    LITTLE,
    Uncoupled,
    between_walls_without_coupling,
    coded,
    driven_without_coupling,
    half_without_coupling,
    in_another_order,
    refuse_other_period,
    resonance,
)
from .breather_problem import COLUMNS, BreatherProblem, discretised, events_of_breather
from .oscillator_lattice import SHARE, Oscillators

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
        and which harmonic is next to the frequencies of small oscillations, or among them.

    Examples
    --------
    >>> import contbreather as cb
    >>> chain = cb.Oscillators(V="u**2/2 + u**4/4", W="c*r**2/2", lattice=cb.Ring(5))
    >>> round(cb.breather(chain, {2: 1}, omega=1.5, params={"c": 0.05}).solution.energy, 9)
    1.477892933
    """
    check_kind(chain, Oscillators, "a lattice of oscillators, Oscillators(V=, W=, lattice=)")
    values = _checked(chain, {} if params is None else params, omega)
    code = coded(chain, code)
    scheme = collocation or WHOLE
    if chain.walls is not None or not chain.dissipative:  # it is made of two halves
        scheme = replace(scheme, intervals=max(2, -(-scheme.intervals // 2)))
    alone: Any = driven_without_coupling if chain.dissipative else half_without_coupling
    alone = between_walls_without_coupling if chain.walls else alone
    start, reached, few = alone(chain, code, values, scheme), None, min(scheme.points, 4)
    with suppress(NoSolution):  # on few points first: they lead there as well
        reached = _walked(chain, code, start, values, replace(scheme, points=few))
    reached = reached or _walked(chain, code, start, values, scheme)
    # once more on a mesh that follows it, of as many intervals as it needs
    flights = reached.residual.flights(reached.x, reached.params)
    finer = [flight.on(flight.knots, scheme) for flight in flights]
    equations = discretised(chain, reached.residual.flows, finer)
    wanted = events_of_breather(equations) if events is None else tuple(events)
    named = BreatherProblem.of(equations, values, wanted, label or "breather")
    problem: Any = named.solve(tolerance=1e-12)[0]
    # errors may be above 1e-10 by the trivial multiplier, or, without, the highest polynomials
    while collocation is None and problem.start["mesh"].size < _MOST:
        orbit = problem.solution
        left = 0.0 if orbit.paired else max(flight.unresolved()[0] for flight in orbit.flights)
        if abs(orbit.trivial - 1) <= _RESOLVED if orbit.paired else left <= _TAIL:
            break
        problem = problem.halved().solve(tolerance=1e-12)[0]
    return problem


def _checked(chain: Oscillators, params: Mapping[str, float], omega: float) -> dict[str, float]:
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
    u = np.linspace(0.1, 0.4, chain.sites)  # anywhere, and shifted as a whole
    here, there = chain.gradient(u, values), chain.gradient(u + 0.3, values)
    low, high = (chain.energy(np.append(s * u, 0.0 * u), values) for s in (0.999, 1.001))
    if not abs(missed := (high - low) / 0.002 - here @ u) <= 1e-3 * (abs(here) @ u):
        raise BadInput(
            f"complex steps miss {missed:.3g} of the slope of V or W, where that is "
            f"{here @ u + missed:.3g}: functions have to be analytic, without abs for instance"
        )
    if not chain.dissipative and abs(there - here).max() <= 1e-12 * abs(here).max():
        raise BadInput(
            "all sites may be shifted together, so that no breather stands alone: hold the "
            "ends, OpenChain(n, ends='fixed'), or give the sites a potential V"
        )
    return values


# --- the walk in the coupling -------------------------------------------------------------------


def _walked(
    chain: Oscillators, code: Any, start: Uncoupled | None, params: Params, scheme: Collocation
) -> BreatherProblem:
    """Walk from no coupling to all of it, beyond where the order of impacts changes."""
    omega = params["omega"]
    while start is not None:
        flows, flights, share = start
        flights = tuple(flight.on(flight.knots, scheme) for flight in flights)
        equations, at = discretised(chain, flows, flights), {**params, SHARE: share}
        first: Any = BreatherProblem.of(equations, at, (), "")
        ends = (replace(fold(), ends="branch"),)
        # of several that impact, first as far as to tell their order
        upto = LITTLE if chain.walls and len(code) > 1 and share < LITTLE else 1.0
        try:
            first, _ = first.solve(tolerance=1e-11)
            branch = trace(first, SHARE, within={SHARE: (0.0, upto)}, towards="up", events=ends)
        except (BadInput, NotConverged) as error:
            raise NoSolution(
                f"{code}: without coupling it cannot be continued: a site at rest is in resonance, "
                f"or it takes more intervals (collocation=); {resonance(chain, omega, at)[0]}"
            ) from error
        last: Any = branch[-1]
        start = in_another_order(last.solution, chain, code, scheme) if chain.walls else None
    # the farthest, also where it turns back without a fold, onto the other arm of a pitchfork
    end = max((*branch.special, *branch), key=lambda point: float(point[SHARE]))
    if chain.walls and (said := _behind(end)):
        share = next(float(point[SHARE]) for point in (*branch, end) if _behind(point))
        raise CouplingEnds(f"{code}: by {share:.4g} of the coupling {said}", share)
    if last[SHARE] == 1.0:
        return last.problem
    back = end.kind == "LP" or last[SHARE] < end[SHARE]
    turns = "it turns back" if back else "its steps shrink to nothing"
    if branch.stop is Stop.DOMAIN:
        turns = f"it {branch.stop.value}: {branch.reason}"
    raise CouplingEnds(
        f"{code} at omega = {omega:.6g} reaches {end[SHARE]:.4g} of the coupling that was asked "
        f"for; there {turns}. Of its harmonics {resonance(chain, omega, end.params)[0]}.",
        float(end[SHARE]),
    )


def _behind(point: Any) -> str:
    """Say which wall the orbit is behind between impacts; nothing where it is not."""
    orbit = point.solution
    touch = min(touches(orbit), key=attrgetter("clearance"))
    if touch.clearance > -AT_ONCE:
        return ""
    wall = orbit.equations.flows[touch.flow].guards[touch.guard]
    t = touch.time % orbit.period
    return f"site {wall.site} is behind a wall, which it would hit, too, at t = {t:.6g}"


# --- catalogue ----------------------------------------------------------------------------------

Code = tuple[tuple[int, Any], ...]


@dataclass(frozen=True)
class CodedBreather(HtmlRepr):
    """One entry of the catalogue: a code, and what becomes of it.

    Attributes
    ----------
    code : dict
        One representative of all codes that are alike.
    copies : int
        How many those are.
    share : float
        The share of the coupling that it reaches, 1 where it exists.
    ended : str
        The sentence that says what ends it; empty where it exists.
    breather : BreatherProblem or None
    """

    code: Mapping[int, Any]
    copies: int
    share: float
    ended: str
    breather: BreatherProblem | None = field(repr=False)

    @property
    def exists(self) -> bool:
        """True where it lives at the coupling that was asked for."""
        return self.breather is not None

    @property
    def problem(self) -> BreatherProblem:
        """What `trace` sets out from: its breather."""
        if self.breather is None:
            raise NoSolution(f"nothing to set out from: {self.ended}")
        return self.breather

    @property
    def unstable(self) -> float | None:
        """Number of its multipliers outside of the unit circle."""
        return None if self.breather is None else self.breather.solution.unstable

    def table(self) -> Sheet:
        """Its code, how far it goes, and what ends it."""
        code = ", ".join(f"{site}: {value}" for site, value in self.code.items())
        rows: list[tuple[str, Any]] = [("code", code), ("codes alike", self.copies)]
        rows += [("share of the coupling", self.share), ("unstable", self.unstable)]
        return Sheet.of([*rows, ("ends with", self.ended or None)])


def breathers(
    chain: Oscillators,
    *,
    omega: float,
    sites: int | Iterable[int] = 2,
    params: Params | None = None,
    **how: Any,
) -> tuple[CodedBreather, ...]:
    """Breathers of all codes of some sites, one for each class of codes that a symmetry of the
    lattice, or a shift by half of the period, maps into each other.

    Parameters
    ----------
    chain, omega, params
        As for `breather`.
    sites : int or iterable of int
        How many sites are coded at most; or which.
    **how
        What else `breather` takes.

    Returns
    -------
    tuple of CodedBreather

    Examples
    --------
    >>> import contbreather as cb
    >>> chain = cb.Oscillators(V="u**2/2 + u**4/4", W="c*r**2/2", lattice=cb.Ring(5))
    >>> for entry in breathers(chain, omega=1.5, sites=2, params={"c": 0.03}):
    ...     print(entry.code, entry.copies, entry.exists, entry.unstable)
    {0: 1} 10 True 0
    {0: 1, 1: 1} 10 True 0
    {0: 1, 1: -1} 10 True 1
    {0: 1, 2: 1} 10 True 1
    {0: 1, 2: -1} 10 True 0
    """
    check_kind(chain, Oscillators, "a lattice of oscillators, Oscillators(V=, W=, lattice=)")
    catalogue: list[CodedBreather] = []
    how |= {"omega": omega, "params": params}
    with partial_result(lambda: tuple(catalogue)):
        for code, copies in _classes(chain, sites, {**(params or {}), "omega": omega}):
            entry = partial(CodedBreather, dict(code), copies)
            try:
                catalogue.append(entry(1.0, "", breather(chain, dict(code), **how)))
            except NoSolution as error:
                share = error.share if isinstance(error, CouplingEnds) else 0.0
                catalogue.append(entry(share, str(error), None))
    return tuple(catalogue)


def _classes(chain: Oscillators, sites: Any, params: Params) -> list[tuple[Code, int]]:
    """Codes up to symmetries, with the size of each class, in their order."""
    if isinstance(sites, Iterable):
        groups = [tuple(sorted(coded(chain, [*sites])))]
    else:
        counts = range(1, min(whole("sites", sites, 1), chain.sites) + 1)
        groups = [g for n in counts for g in itertools.combinations(range(chain.sites), n)]
    values = ("high",) if chain.dissipative else (1, -1)
    codes: list[Code] = [
        tuple(zip(group, signs, strict=True))
        for group in groups
        for signs in itertools.product(values, repeat=len(group))
    ]
    joined = abs(chain.bonds).T @ sparse.diags_array(chain.couplings) @ abs(chain.bonds)
    own = chain.masses, chain.onsite, chain.lattice.dampings, chain.lattice.drive
    r = np.linspace(0.1, 1.0, 5)
    pull, push = chain.W.slope(r, params), chain.W.slope(-r, params)
    # of bonds that tell their ends apart no exchanges are looked for
    even = abs(pull + push).max() <= 1e-12 * abs(pull).max()
    exchanges = [*exchanges_of_sites(joined.toarray(), own)] if even else []
    images: dict[Code, list[Code]] = {}
    for code in codes:  # half a period later, and at other sites
        later = tuple((n, value if isinstance(value, str) else -value) for n, value in code)
        moved = (tuple(sorted((to[n], value) for n, value in code)) for to in exchanges)
        images[code] = [later, *moved]
    return classes_of(images)
