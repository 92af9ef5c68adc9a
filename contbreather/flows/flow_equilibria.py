"""Equilibria of a flow, and the small cycles that are born at their Hopf points."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from ..continuation.algebra.newton import Array, Undefined, newton
from ..continuation.algebra.sparse import is_sparse, null_vectors, plus_diagonal
from ..continuation.bifurcations.equilibria import branch_point, fold, hopf, unstable
from ..continuation.branches.switching import SwitchingProblem
from ..continuation.curve.curve import Curve
from ..continuation.curve.point import Event, Point, UnstableDimension
from ..continuation.curve.problem import Problem
from ..continuation.systems import spectrum
from ..errors import BadInput
from .collocation import Collocation, fitted, sizes_of
from .cycle_constructors import named_state, state_names, with_jacobian
from .cycle_events import events_of_cycle, examine_swing
from .cycle_problem import CycleProblem
from .equations import FlowEquations
from .flow import Flow, refuse_false_period
from .functions import Function, Params, at_state
from .jacobian import Exact, FieldWithJacobian
from .rotation import Angles
from .sparse_equations import sparse_where_large

# of a first cycle beside a Hopf point, in its size
_AMPLITUDES = (1e-2, 3e-3, 1e-3, 1e-4, 1e-5, 1e-6)


def equilibrium(
    f: Flow | Function,
    start: Mapping[str, Any],
    params: Mapping[str, float],
    *,
    jacobian: Any = None,
    events: Iterable[Event] | None = None,
    scales: Mapping[str, float] | None = None,
    collocation: Collocation | None = None,
    wraps: Mapping[str, float] | None = None,
    label: str = "equilibrium",
) -> Problem:
    """Equilibria of ``dx/dt = f(t, x, p)``, which must not depend on t, as a problem to trace.

    Parameters
    ----------
    f : callable or Flow
    start : dict
        Name and value of each state, or of a row of them, close to the equilibrium.
    params : dict
        Name and value of each parameter.
    jacobian : callable or pattern, optional
        The derivative of f in x where `f` is a function, as `Flow` takes it.
    events : iterable of Event, optional
        LP, BP and HB by default.
    scales : dict, optional
        Typical size of a state or parameter where that is far from 1, as `Problem` takes it; those
        of parameters are those of the cycles, too.
    collocation : Collocation, optional
        For the cycles that `switch` follows from a Hopf point.
    wraps : dict, optional
        The turn of each state that is an angle, as ``{"theta": 2 * np.pi}``: a branch that comes
        back a turn later is closed.
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
    f = with_jacobian(f, jacobian)
    flow = f if isinstance(f, Flow) else Flow(f)
    state, params = named_state(start, params)
    flow.check(0.0, state, params)
    refuse_false_period([Flow(flow.f)], [state[:, None]], None, params)
    angles = Angles.of(wraps, state_names(start))
    if angles.checked([flow], 0.0, state, params).tied.any():
        raise BadInput("wraps: of equilibria f is to be the same a turn of each angle by itself")
    given: Any = flow.f.jacobian if isinstance(flow.f, FieldWithJacobian) else None
    if given is not None:
        given = partial(given.matrix, 0.0) if isinstance(given, Exact) else given.pattern
    return Equilibrium(
        partial(_velocity, flow.f), dict(start), params, flow=flow, jacobian=given,
        events=(fold(), branch_point(), hopf()) if events is None else tuple(events),
        record={"unstable": UnstableDimension(unstable)}, label=label,
        scales=scales or {}, collocation=collocation or Collocation(), wraps=wraps or {},
    )  # fmt: skip


def _velocity(f: Function, x: Array, p: Params) -> Array:
    return at_state(f, 0.0, x, p)


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Equilibrium(Problem):
    """``f(0, x, p) = 0``, and how finely cycles that are born there are resolved."""

    flow: Flow
    collocation: Collocation
    wraps: Mapping[str, float]
    of_arms = ("orbit", "period")

    def modulo(self, x: Array, params: Params) -> Mapping[str, Any]:
        return self.wraps

    def having(self, *names: str) -> Problem:
        """Free parameters, if the field does not begin to depend on the time with one of these."""
        refuse_false_period([Flow(self.flow.f)], [self.x[:, None]], None, self.params, names)
        return super().having(*names)

    def lift(self, kind: str) -> Callable[[Point], SwitchingProblem] | None:
        return _born if kind == "HB" else None


class _Born(SwitchingProblem):
    """Small cycles beside a Hopf point: they leave it in the plane of its eigenvectors."""

    @cached_property
    def tangents(self) -> tuple[Array, None]:
        curve = Curve(self.problem, (self.free,))
        outwards = np.zeros(curve.start.size)
        cycle: Any = self.problem.residual
        nodes = cycle.layout.nodes[0]
        outwards[nodes] = curve.start[nodes] - curve.start[nodes].mean(axis=0)
        return curve.tangent_at(curve.start, outwards)[0], None


def _born(point: Point) -> SwitchingProblem:
    """The cycle of a small amplitude beside a Hopf point, and the direction in which they grow."""
    (free,), rest, params = point.curve.free, np.array(point.x), point.params
    problem: Any = point.curve.problem
    parts = state_names(problem.start)
    omega = float(point["omega"])
    units, matrix = point.curve.scales[: rest.size], spectrum.flow(point.curve, point.z)
    if is_sparse(matrix):
        q = null_vectors(plus_diagonal(matrix, -1j * omega))[0]
    else:
        eigenvalues, vectors = np.linalg.eig(matrix)
        q = vectors[:, int(abs(eigenvalues - 1j * omega).argmin())]
    q, size = q * units, float(np.sqrt(np.mean((rest / units) ** 2)))
    size = size if size > 1e-12 else 1.0  # or it is the origin, but for rounding
    # x = rest + A Re(q exp(i omega t)), q the eigenvector to i omega: to first order in A a cycle
    period = 2 * math.pi / omega

    def wave(amplitude: float, t: Array) -> Array:
        turned = q[:, None] * np.exp(1j * omega * t)
        return np.asarray(rest[:, None] + amplitude * turned.real)

    born = None
    for amplitude in _AMPLITUDES:
        flight = fitted(problem.collocation, 0.0, period, partial(wave, amplitude * size))
        flows, sizes = (problem.flow,), sizes_of([flight], units)
        equations = FlowEquations(flows, (flight,), None, 1, parts, sizes, units=units)
        equations = sparse_where_large(equations, params)
        events = events_of_cycle(equations)
        curve = Curve(CycleProblem.of(equations, params, events, "cycle", problem.scales), (free,))
        # along the wave the orbit is held, or Newton would fall back on the equilibrium
        row = np.zeros(curve.start.size)
        row[equations.layout.nodes[0]] = flight.states - rest
        try:
            solution = newton(curve, curve.start, curve.metric * row, tolerance=1e-11, most=20)
        except Undefined:
            continue
        if solution.converged:
            first = Point(curve, solution.z)
            equations = replace(equations, start=equations.flights(first.x, first.params))
            cycle = CycleProblem.of(equations, first.params, events, "cycle", problem.scales)
            # beside the origin the orbit says nothing of what it grows to: a hundred times itself
            unit = np.maximum(cycle.scales["orbit"], units * size * amplitude / _AMPLITUDES[0])
            cycle = replace(cycle, scales={**cycle.scales, "orbit": unit})
            born = _Born(cycle, free, both=False)
            # it is as large beside what it may grow to as states are counted from far off
            if not examine_swing(_AMPLITUDES[0], first):
                return born
    if born:
        return born
    raise Undefined("no small cycle was found beside the Hopf point: it may be degenerate")
