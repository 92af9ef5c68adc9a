"""The symmetric breather as a problem to trace, and how it changes along p, phi and its parameters.

Everything that can happen to it has a closed form, so each defining system has exact derivatives:
one scalar for a fold and for a pitchfork, two equations and the unknown angle for a complex pair,
two and the unknown time for a site that grazes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import pairwise
from operator import attrgetter, itemgetter
from threading import get_ident
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from contbreather.continuation.curve.curve import Curve
from contbreather.continuation.curve.point import DefiningSystem, Implied, Point
from contbreather.continuation.curve.problem import Problem
from contbreather.continuation.curve.ties import chained
from contbreather.errors import BadInput
from contbreather.lattice.band_averages import UniformLattice, check_gamma
from contbreather.lattice.chain import InfiniteChain, Ring
from contbreather.lattice.conditions import SpringResponse, restitution_ratio, spring_response
from contbreather.lattice.forcing import Forcing, Harmonic, TrigonometricSeries
from contbreather.lattice.periodic_green import half_period_green, weights_per_impulse
from contbreather.orbits import closure_kernels as kernels
from contbreather.orbits.closure import (
    ClosureTerms,
    closure_derivative,
    closure_equations,
    fold_derivative,
    fold_scalar,
    forcing_at,
    pitchfork_derivative,
    pitchfork_scalar,
    reduced,
    saltation_derivative,
    sprung,
    terms_at,
    terms_derivative,
)
from contbreather.orbits.orbit import Orbit, orbit_at
from contbreather.orbits.orbit_events import events_of, saddle_node
from contbreather.orbits.orbit_problem import (
    OnCircle,
    OrbitProblem,
    of_whole_period,
    ring_label,
    unstable_by,
)
from contbreather.parameters import NEEDED, NUMBERS
from contbreather.stability.one_impact import band_workspace

Array = NDArray[np.float64]
Breather = Any  # `ClosedForm`, whose methods fetch what is here

# An impact of p = 0 is none: there b has a pole, so the branch ends a hair before. With harmonic
# forcing that is at a = 1, where the far field grazes.
DOMAIN = {name: NUMBERS[name].domain for name in NEEDED} | {"p": (1e-14, math.inf)}


class ClosurePoint(NamedTuple):
    """Numbers at which (11) is asked: what a `ClosedForm` has, of any."""

    p: float
    phi: float
    a: float
    gamma: float
    k: float
    forcing: Forcing
    lattice: Any


@dataclass(frozen=True)
class Closure:
    """Equations (11) for one forcing and one lattice, ready for a continuation.

    ``x = (p, phi)``; ``params`` names a, gamma, k and any parameters of the forcing (those left
    out keep the forcing's own value). Each method raises `BadInput` outside the domain: gamma
    outside [0, 1/4), k outside [0, 1], anything not finite.

    Examples
    --------
    >>> from contbreather.orbits.constructors import symmetric
    >>> b = symmetric(0.5, 0.12, 0.4)
    >>> params = {"a": 0.5, "gamma": 0.12, "k": 0.4}
    >>> bool(abs(Closure().residual([b.p, b.phi], params)).max() < 1e-15)
    True
    """

    forcing: Forcing = field(default_factory=Harmonic)
    lattice: UniformLattice = field(default_factory=InfiniteChain)

    def residual(self, x: Array, params: Mapping[str, float]) -> Array:
        """The two equations, shape (2,)."""
        return np.array(closure_equations(terms_at(self._at(x, params), "chi")))

    def jacobian(self, x: Array, params: Mapping[str, float]) -> Array:
        """Derivatives with respect to ``(p, phi)``, shape (2, 2)."""
        return self.derivatives(x, params, ())

    def sensitivity(self, x: Array, params: Mapping[str, float], name: str) -> Array:
        """Derivatives with respect to the parameter ``name``, shape (2,)."""
        return self.derivatives(x, params, (name,))[:, 2]

    def derivatives(self, x: Array, params: Mapping[str, float], names: tuple[str, ...]) -> Array:
        """Derivatives in both and in parameters, beside each other."""
        at = self._at(x, params)
        t, columns = terms_at(at, "chi"), ("p", "phi", *names)
        slopes = [closure_derivative(t, terms_derivative(at, t, name, "chi")) for name in columns]
        return np.array(slopes).T

    def along(self, x: Array, params: Mapping[str, float], way: Mapping[str, float]) -> Array:
        """Derivatives along a direction of the parameters, rates by name."""
        return np.dot(self.derivatives(x, params, (*way,))[:, 2:], [*way.values()])

    def at_phases(self, phi: Array, params: Mapping[str, float]) -> Array:
        """Solutions with given phases, a free: a row p, phi, a for each."""
        series, q = self._without_momentum(params)
        # for each phi (11) is linear in p/a and 1/a
        a = q / series.at(phi, 0)
        return np.column_stack([a * self.forcing.df(phi) / q, phi, a])

    def upper_phases(
        self, params: Mapping[str, float], largest: float
    ) -> Iterator[tuple[float, float]]:
        """Intervals of phases on which a falls to a fold, from the largest a or a fold on."""
        series, q = self._without_momentum(params)
        extrema, level = series.extrema(), q / largest
        for start, end in pairwise([extrema[-1] - 2.0 * math.pi, *extrema]):
            if series.at(end, 0) > max(level, series.at(start, 0)):
                rises = series.at(start, 0) < level
                yield (series.crossing(level, start, end) if rises else start), end

    def _without_momentum(self, params: Mapping[str, float]) -> tuple[TrigonometricSeries, float]:
        """``chi f' + q f`` and q."""
        chi = sprung(self.lattice, self.forcing).mean(params["gamma"], "chi")
        q = restitution_ratio(params["k"])
        return reduced(self.forcing, chi, q), q

    def _at(self, x: Array, params: Mapping[str, float]) -> ClosurePoint:
        p, phi = float(x[0]), float(x[1])
        a, gamma, k = float(params["a"]), float(params["gamma"]), float(params["k"])
        if not (0.0 <= k <= 1.0 and math.isfinite(a) and math.isfinite(p) and math.isfinite(phi)):
            restitution_ratio(k)
            raise BadInput(f"a = {a}, p = {p}, phi = {phi}: the closure needs finite numbers.")
        if not NUMBERS["gamma"].holds(gamma):
            check_gamma(gamma, self.lattice.spring)  # says it
        f = forcing_at(self.forcing, params)
        return ClosurePoint(p, phi, a, gamma, k, f, sprung(self.lattice, f))


def symmetric_problem(breather: Orbit, threshold: float) -> Problem:
    """The closure (11) with the breather as its start, and all its events.

    Columns: p, phi; a, gamma, k and the parameters of the forcing; ``unstable``, the number of
    multipliers of QS outside the circle, on a ring those over 2 pi beyond the threshold; computed
    when asked for. Beside asymmetric breathers it is drawn by their t1, t2, c and ``asymmetry``.
    """
    motion = breather.representation
    on, forcing = breather.conditions, motion.forcing
    lattice = on.lattice
    closure = Closure(forcing, lattice)
    domain, gamma = dict(DOMAIN), NUMBERS["gamma"]
    if "spring" in forcing.params:
        # the band [sqrt(spring), sqrt(spring + 4 gamma)] ends below the drive at 1, along either
        # parameter by itself
        domain["gamma"] = 0.0, gamma.domain[1] - 0.25 * on.spring
        domain["spring"] = 0.0, 1.0 - gamma.margin - 4.0 * on.gamma
    # of asymmetric breathers the first time is an unknown; (3): the wall +1 at phi
    of_arms = {} if "t1" in forcing.params else {"t1": Implied(itemgetter("phi"))}
    of_arms |= of_whole_period(motion.section, ["phi"], forcing.params)
    return SymmetricProblem.of(
        "symmetric breather",
        partial(type(motion).of, forcing, lattice),
        breather,
        threshold,
        closure,
        start={"p": motion.p, "phi": motion.phi},
        params={"a": on.a, "gamma": on.gamma, "k": on.k, **forcing.params},
        events=(saddle_node(), *events_of(motion.section, on, threshold)),
        record={"unstable": unstable_by(threshold), **of_arms},
        domain=domain,
        label=f"symmetric breather{ring_label(lattice, threshold)}",
    )


@dataclass(frozen=True, eq=False, repr=False)
class SymmetricProblem(OrbitProblem):
    """The closure (11) as a problem."""

    derivatives = property(attrgetter("equations.derivatives"))  # all by one evaluation

    @property
    def serialised(self) -> Mapping[str, Any]:
        form = {"forcing": self.equations.forcing, "lattice": self.equations.lattice}
        return {"kind": self.kind, **form, "threshold": self.threshold}

    def walker(self, free: tuple[str, ...], params: Mapping[str, float]) -> tuple[Any, Any] | None:
        data = self.kernel_data(free, params, held=True)
        return data and (kernels.CLOSURE, data)

    def kernel_data(
        self, free: tuple[str, ...], params: Mapping[str, float], extra: int = 0, held: bool = False
    ) -> Any:
        """None for other lattices than chain and ring; `held`: springs, too."""
        on, forcing = self.equations.lattice, self.equations.forcing
        sprung = isinstance(forcing, SpringResponse)
        if type(on) not in (InfiniteChain, Ring) or (sprung and not held):
            return None
        return kernels.closure_data(on, forcing_at(forcing, params), free, params, extra)

    def with_parameters(self, names: tuple[str, ...]) -> Problem:
        """On the infinite chain with the spring, as one of 0; on a ring by its modes."""
        if self.equations.lattice.sites is not None or "spring" not in names or "omega" in names:
            return super().with_parameters(names)
        orbit = orbit_at(self)
        # a spring of 0 changes no response, but it is one of its parameters
        soft = Orbit(replace(orbit.representation, forcing=spring_response(orbit.forcing, 0.0)))
        return symmetric_problem(soft, self.threshold).having(*names)


def defining_system(
    of: OnCircle, point: Point, nu: float | None = None, **more: Any
) -> DefiningSystem:
    """A multiplier of the half map on a circle: -1 is the fold (14), 1 the pitchfork."""
    breather = point.solution.representation
    if nu is not None:
        slopes = partial(_circle_slopes, of)
        walker = _pair_walker if breather.lattice.sites is None else None
        return DefiningSystem({"nu": nu}, of.conditions, slopes, walker=walker, **more)
    if of.nu == 0.0 and "spring" in point.curve.free:
        # with the lower edge of the band, root of the spring, as an unknown: 1/tau grows in
        # proportion to that from no spring on, where the curve in the spring has no tangent
        edge = math.sqrt(breather.lattice.spring)
        return DefiningSystem({"edge": edge}, _pitchfork_at_edge, domain={"edge": (0.0, 1.0)})
    scalar = PITCHFORK if of.nu == 0.0 else FOLD
    return DefiningSystem({}, scalar.conditions, scalar.derivative, walker=scalar.walker)


# --- fold and pitchfork: one scalar, nothing unknown --------------------------------------------


class Scalar(NamedTuple):
    """Quantity that vanishes where a multiplier is 1 or -1, a formula over the terms of (11)."""

    value: Callable[[ClosureTerms], Any]
    derivative_in: Callable[[ClosureTerms, ClosureTerms], Any]
    terms: Callable[[Breather], ClosureTerms]
    terms_in: Callable[[Breather, ClosureTerms, str], ClosureTerms]
    walker: Callable[..., Any]  # of the defining system

    def conditions(self, curve: Curve, z: Array, extra: Array) -> Array:
        return np.array([self.value(self.terms(Point(curve, z).solution.representation))])

    @chained
    def derivative(self, curve: Curve, z: Array, extra: Array) -> Array:
        breather = Point(curve, z).solution.representation
        t = self.terms(breather)
        row = [self.derivative_in(t, self.terms_in(breather, t, name)) for name in curve.slots]
        return np.array([row])


def _turning(breather: Breather, edge: float | None = None) -> ClosureTerms:
    """Terms of the pitchfork."""
    lattice: Any = breather.lattice
    terms = terms_at(breather, "sigma")
    if edge is None and not lattice.spring:
        return terms
    # for one harmonic this is 1/p = chi - 2 sigma - q^2/tau, tau = <cot(pi w/2)/w>
    held = 0.5 * breather.q**2 / lattice.tau(breather.gamma, edge)
    return terms._replace(mean=terms.mean + held)


def _turning_derivative(breather: Breather, t: ClosureTerms, name: str) -> ClosureTerms:
    lattice: Any = breather.lattice
    slope = terms_derivative(breather, t, name, "sigma")
    if not lattice.spring or name not in ("gamma", "k"):
        return slope
    gamma, q, by_q = breather.gamma, breather.q, -2.0 / (1.0 + breather.k) ** 2
    tau = lattice.tau(gamma)
    # the derivative of q^2/(2 tau)
    held = q / tau * by_q if name == "k" else -0.5 * (q / tau) ** 2 * lattice.dtau(gamma)
    return slope._replace(mean=slope.mean + held)


def _pitchfork_at_edge(curve: Curve, z: Array, extra: Array) -> Array:
    breather, edge = Point(curve, z).solution.representation, float(extra[0])
    scalar = pitchfork_scalar(_turning(breather, edge))
    # the square of the edge, for the root of the spring has no derivative at 0
    return np.array([scalar, edge * edge - breather.lattice.spring])


def _scalar_walker(fold: bool, problem: Any, free: Any, params: Mapping[str, float]) -> Any:
    # its pitchfork with springs is no scalar that kernels have
    data = problem.kernel_data(free, params, held=fold)
    mean = data and (data.chi if fold else data.sigma)
    return data and (kernels.SCALAR, kernels.ScalarData(data, mean, fold))


FOLD = Scalar(
    fold_scalar, fold_derivative, partial(terms_at, mean="chi"),
    partial(terms_derivative, mean="chi"), partial(_scalar_walker, True),
)  # fmt: skip
PITCHFORK = Scalar(
    pitchfork_scalar, pitchfork_derivative, _turning, _turning_derivative,
    partial(_scalar_walker, False),
)  # fmt: skip


# --- a pair on a circle -------------------------------------------------------------------------


@chained
def _circle_slopes(of: OnCircle, curve: Curve, z: Array, extra: Array) -> Array:
    """Along the curve's columns, through b and directly, and the angle."""
    orbit = Point(curve, z).solution
    F = orbit.map.gradient(of.angle(extra), of.radius)
    direct = {"gamma": F.d_gamma, "k": F.d_k, "spring": F.d_spring}
    t, columns = terms_at(orbit.representation, "eta"), []
    for name in curve.slots:
        by_b = saltation_derivative(t, terms_derivative(orbit.representation, t, name, "eta"))
        columns.append(F.d_b * by_b + direct.get(name, 0.0))
    # F is complex: its real and its imaginary part are the two equations of a pair
    row = np.array([*columns, F.d_nu])
    return np.array([row.real, row.imag])


def _pair_walker(problem: Any, free: tuple[str, ...], params: Mapping[str, float]) -> Any:
    data = problem.kernel_data(free, params, extra=1)
    work = band_workspace(0.0, get_ident())
    return data and (kernels.PAIR, kernels.PairData(data, work, np.empty(6, complex)))


# --- a site that grazes -------------------------------------------------------------------------


def contact_walker(
    distance: int, wall: float, problem: Any, free: tuple[str, ...], params: Mapping[str, float]
) -> Any:
    """On the infinite chain alone."""
    lattice, data = problem.equations.lattice, problem.kernel_data(free, params, extra=1)
    if data is None or lattice.sites is not None:
        return None
    # the coefficients of a response as polynomials in 4 gamma
    expansions = (weights_per_impulse().T * lattice.moments(distance))[:, ::-1]
    responses = half_period_green(lattice, 0.0, (distance, distance))  # but for its table
    responses = responses._replace(table=np.zeros(responses.table.shape))
    return kernels.CONTACT, kernels.ContactData(data, wall, distance, expansions.copy(), responses)
