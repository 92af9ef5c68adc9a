"""A breather of a lattice of oscillators: its equations, its value, its events, its problem.

A conservative one is half of a time-reversible orbit, from rest to rest.

Where x(t) is a motion of x' = f(x), so is R x(-t), with R what turns velocities around. An orbit
that is at rest as a whole twice a period is its own image: half of it, with

    v(0) = 0,  v(T/2) = 0,

is all of it. These are as many equations as there are states, and isolated in a family once its
frequency or its energy is given, without an unfolding and without a phase; without coupling, too,
where each site has a phase of its own.

Small perturbations of the whole are those of the half, M = R M_half^-1 R M_half. In positions and
momenta the half is a symplectic matrix of four blocks, those of the whole have the stability
indices that are the eigenvalues of one of them,

    M_half = | A  B |,   M = | 1 + 2 B^T C    2 D^T B   |
             | C  D |        |   2 A^T C    1 + 2 C^T B |.

Events are those of pairs of multipliers, as of cycles where something is conserved; at +1 PF, too,
where orbits that are not time-reversible branch off.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial, reduce
from operator import attrgetter
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from ..continuation.algebra.newton import Array, Undefined
from ..continuation.branches.switching import SwitchingProblem
from ..continuation.curve.point import NOTHING, Event, Examined, Point
from ..continuation.curve.problem import Problem
from ..continuation.systems.branch_points import bordered_matrix
from ..continuation.systems.defining_systems import Singular
from ..errors import BadInput
from ..flows.collocation import ROUNDING, Collocation, TrajectorySegment, sizes_of
from ..flows.conservation import Conservation, Unfolded, on_axis, quantities_of
from ..flows.conservative_events import (
    NEAR,
    STEP,
    conservative_events,
    event_at,
    examine_place,
    followed,
)
from ..flows.cycle_events import BRANCH_POINT, FLAT, events_of_cycle, examine_swing, swing
from ..flows.cycle_problem import UNSTABLE, Cycle, CycleProblem, at_crossing, top
from ..flows.equations import FlowEquations
from ..flows.flow import Flow
from ..flows.functions import Params
from ..flows.homoclinic import HOMOCLINIC
from ..flows.sparse_equations import FEW, SparseFlowEquations, sparse_where_large
from ..lattice.chain import Ring
from ..lattice.finite import whole_sites
from ..one_thread import one_thread
from ..stability.verdict import Verdict, verdict
from ..storage.serialise import serialised
from .anticontinuum import exchanged, forcing_period, met, refuse_other_period, resonance
from .oscillator_lattice import SHARE, Oscillators, between_walls

COLUMNS = {"energy": "energy", "max|u|": "farthest"}
COLUMNS |= {name: name for name in ("largest", "action", "omega", "participation")}


def resting(t: Any, x: NDArray[Any], p: Params) -> NDArray[Any]:
    """Reset that puts the velocities where all ends, which vanish there, in the rows of positions,
    and those where it begins in their own."""
    v = x[len(x) // 2 :]
    return np.concatenate([v, 0.0 * v])


def half_period(t: Any, x: Any, p: Params) -> Any:
    return math.pi / p.get("omega", 1.0)  # where it is none the energy is given


def _energy_above(chain: Oscillators, t: Any, x: Any, p: Params) -> Any:
    return chain.energy(x, p) - p.get("energy", 0.0)  # of perturbations it may be any


@dataclass(frozen=True, eq=False)
class HalfOrbit(FlowEquations):
    """Half of an orbit of a lattice of oscillators, discretised, at a given frequency or energy."""

    @property
    def chain(self) -> Oscillators:
        return cast("Oscillators", self.flows[0].f)

    @property
    def standing(self) -> Array:
        return np.repeat([0.0, 1.0], self.chain.sites)

    length, givens = "held", ("omega", "energy")

    @property
    def held(self) -> str:
        return "omega" if self.period else "energy"

    def longer(self, x: Array, p: Params) -> tuple[int, Array] | None:
        if self.held == "energy":
            return None
        change, u = np.zeros(self.layout.size), self.layout.nodes[0][0][: self.chain.sites]
        change[u] = self.chain.gradient(x[u], p)
        return int(self.layout.lengths[0]), change

    def holding(self, name: str) -> HalfOrbit:
        until = None if name == "omega" else partial(_energy_above, self.chain)
        flow = Flow(self.chain, until=until, reset=resting)
        return replace(self, flows=(flow,), period=None if until else half_period)

    def __call__(self, x: Array, p: Params, error: float = ROUNDING) -> Array:
        left = super().__call__(x, p, error)
        self.forces(x, p, error)  # all places of the equations are between its ends
        return left

    @np.errstate(all="ignore")
    def forces(self, x: Array, p: Params, error: float = ROUNDING) -> Array:
        """Evaluate those where the half begins and ends; `Undefined` beyond their domain."""
        (flight,) = self._solved(x, p, error).flights
        u = np.stack([flight.states[0], flight.end], axis=-1)[: self.chain.sites]
        forces: Array = self.chain.gradient(u, p).T
        if not math.isfinite(forces.sum()):
            raise Undefined("where it is at rest forces have no value")
        return forces


@dataclass(frozen=True, eq=False)
class SparseHalfOrbit(HalfOrbit, SparseFlowEquations):
    """Half of an orbit of many sites, of which nothing is eliminated."""

    @property
    def closing(self) -> tuple[Any, Any]:
        u, v = np.split(np.arange(2 * self.chain.sites), 2)
        return u, v


def whole_orbit(
    half: HalfOrbit, flights: tuple[TrajectorySegment, ...], p: Params
) -> FlowEquations:
    """Equations of a conservative orbit that need not be time-reversible, at a given frequency or
    energy."""
    energies, states = quantities_of(half.chain.energy), flights[0].states.T
    flow = Flow(Unfolded.near(half.chain, {"lambda": energies["energy"]}, states))
    kept = Conservation(energies, half.held, np.empty((0, len(states))), "omega")
    whole = FlowEquations((flow,), flights, None, 1, half.parts, half.sizes, kept)
    return sparse_where_large(whole, p)


@dataclass(frozen=True, eq=False)
class Breather(Cycle):
    """A periodic motion of a lattice of oscillators: what ``point.solution`` is on the branches of
    `contbreather.breather`.

    Attributes
    ----------
    energy : float
        Of a conservative lattice that of the orbit, of others its mean over a period.
    action : float
        ``1/(2 pi)`` of the integral of ``m v du`` over a period: ``dE = omega d(action)`` along a
        family.
    participation : float
        ``(sum e)^2 / sum e^2`` of the mean energies of the sites, above those at
        rest: about how many take part.
    largest : float
        The largest modulus of the multipliers.

    Examples
    --------
    >>> import contbreather as cb
    >>> chain = cb.Oscillators(V="u**2/2 + u**4/4", W="c*r**2/2", lattice=cb.Ring(5))
    >>> orbit = cb.breather(chain, {2: 1}, omega=1.5, params={"c": 0.05}).solution
    >>> round(float(orbit.displacement(2, 0.0)), 6), orbit.unstable
    (1.2495, 0)
    """

    @property
    def chain(self) -> Oscillators:
        field = self.equations.flows[0].f
        return cast("Oscillators", field.f if isinstance(field, Unfolded) else field)

    @property
    def lattice(self) -> Any:
        return self.chain.lattice

    @property
    def omega(self) -> float:
        return 2 * math.pi / self.period

    @property
    def begin_of_orbit(self) -> Any:
        flows, state, params, *rest, exact = super().begin_of_orbit
        if self.paired:  # so exact that hundreds of periods keep H
            flows, exact = Flow(self.chain), 1e-13
        return flows, state, {**params, "omega": self.omega}, *rest, exact

    # --- its motion ---------------------------------------------------------------------------

    def displacement(self, n: Any, t: Any) -> Any:
        """The position of a site, or of several, at a time or at times; on a ring modulo its number
        of sites."""
        return self.state(t)[0][self._at(n)]

    def velocity(self, n: Any, t: Any) -> Any:
        """The velocity of a site, or of several, at a time or at times."""
        return self.state(t)[1][self._at(n)]

    def _at(self, n: Any) -> NDArray[np.int64]:
        ring, count = isinstance(self.lattice, Ring), self.chain.sites
        n = np.arange(count)[n] if isinstance(n, slice) else n
        return whole_sites(n, math.inf if ring else count, self.lattice) % count

    def state(self, t: Any = 0.0) -> tuple[Array, Array]:
        """Positions and velocities of all sites at a time, or at times."""
        u, v = np.split(self.states(t), 2)
        return u, v

    @property
    def swings(self) -> Array:
        """About how far each site moves, from end to end: between samples."""
        sampled = np.hstack([f.sampled(4)[1][: self.chain.sites] for f in self.flights])
        return np.asarray(np.ptp(sampled, axis=1))

    @property
    def farthest(self) -> float:
        """The largest displacement of any site at any time."""
        positions = slice(0, self.chain.sites)
        return max(top(f, positions, sign) for f in self.flights for sign in (1.0, -1.0))

    # --- its columns --------------------------------------------------------------------------

    def _means(self, function: Callable[[Array], Array]) -> Array:
        """Integrate a function of states, the columns of an array, over a period, and divide by it:
        by the weights at the Gauss points of each flow."""
        total: Any = 0.0
        for f in self.flights:
            inside = (f.states[:, None] + f.scheme.matrix @ f.slopes).reshape(-1, f.dimension).T
            total += function(inside) @ np.multiply.outer(f.lengths, f.scheme.weights).ravel()
        return np.asarray(total / self.period)

    @cached_property
    def _energies(self) -> Array:
        return self._means(lambda x: self.chain.site_energies(x, self.params))

    @property
    def energy(self) -> float:
        return float(self._energies.sum())

    @cached_property
    def action(self) -> float:
        living = self._means(lambda x: self.chain.masses @ x[self.chain.sites :] ** 2)
        return float(living) / self.omega

    @property
    def participation(self) -> float:
        rest = self.chain.site_energies(np.zeros(2 * self.chain.sites), self.params)
        above = self._energies - rest
        return float(above.sum() ** 2 / (above**2).sum())

    @property
    def largest(self) -> float:
        return float(abs(self.others).max(initial=0.0))

    def _sizes(self) -> dict[str, float]:
        return {name: getattr(self, of) for name, of in COLUMNS.items()}

    # --- its stability, as verdicts ask for it ------------------------------------------------

    sign, over_period = 1, Cycle.multipliers

    @property
    def idle(self) -> float:  # 1 where some multipliers are on the circle
        return float(self.chain.damping is None)

    def unstable_multipliers(self) -> NDArray[np.complex128]:
        return self.multipliers[: self.unstable]

    def stability(self, threshold: float | None = None, sites: None = None) -> Verdict:
        """Is it stable? By the multipliers outside of the unit circle, or beyond a threshold."""
        if sites is not None:
            raise BadInput(f"sites = {sites}: leave it out; this is the {self.lattice.describe()}")
        if threshold is not None:
            return verdict(self, threshold)
        return Verdict(self.lattice.describe(), self.period, None, self.unstable, map=self)

    def __repr__(self) -> str:
        near, inside = resonance(self.chain, self.omega, self.params)
        spread = f"; {near}" if inside and not self.chain.dissipative else ""
        return f"<Breather of frequency {self.omega:.10g}, {self._count}{spread}>"


@dataclass(frozen=True, eq=False, repr=False)
class ReversibleBreather(Breather):
    """A time-reversible one: its equations are those of half of it."""

    mirror = None  # the other half is the way back

    @cached_property
    def own_flights(self) -> tuple[TrajectorySegment, ...]:
        return self.equations.flights(self.x, self.params)

    @cached_property
    def flights(self) -> tuple[TrajectorySegment, ...]:
        """The half, and the way back."""
        (half,) = self.own_flights
        reversor = np.repeat([1.0, -1.0], self.chain.sites)
        ends = np.vstack([half.states[1:], half.end])
        knots = np.concatenate([0.5 * half.knots, 1 - 0.5 * half.knots[-2::-1]])
        states = np.vstack([half.states, reversor * ends[::-1]])
        slopes = np.concatenate([half.slopes, -reversor * half.slopes[::-1, ::-1]])
        twice = 2 * half.duration
        return (replace(half, duration=twice, knots=knots, states=states, slopes=slopes),)

    @property
    def velocities(self) -> list[Array]:
        return [self.chain(0.0, f.states.T, self.params).T for f in self.flights]

    @cached_property
    @one_thread
    def half_map(self) -> Array:
        """The blocks A, B and C, D of small perturbations, in positions and momenta."""
        (piece,), n = self.equations.linearised(self.x, self.params).linear, self.chain.sites
        factors = piece.slopes.ends[:, :, : 2 * n]
        m = np.append(np.ones(n), self.chain.masses)  # to momenta
        whole = m[:, None] * reduce(np.matmul, factors[::-1]) / m
        return np.asarray(whole.reshape(2, n, 2, n).swapaxes(1, 2))

    @cached_property
    def forces(self) -> Array:
        """Those on the orbit where the half begins and ends."""
        half: Any = self.equations
        forces: Array = half.forces(self.x, self.params)
        return forces

    @cached_property
    @one_thread
    def indices(self) -> NDArray[np.complex128]:
        # 1 + 2 B^T C without the pair that is trivial: that of the orbit's own velocity, which ends
        # as such, so that forces at the start are at right angles to all of B^T
        (_, B), (C, _) = self.half_map
        across = np.linalg.qr(self.forces[0][:, None], mode="complete")[0][:, 1:]
        others = np.eye(self.chain.sites - 1) + 2 * across.T @ B.T @ (C @ across)
        return on_axis(np.linalg.eigvals(others))

    @cached_property
    def _spectrum(self) -> tuple[NDArray[np.complex128], Array]:
        root, (start, end) = np.sqrt(self.indices**2 - 1), self.forces
        # by how much the orbit's own velocity grows, 1 but for what the mesh does not resolve
        one = end @ (self.half_map[1, 1] @ start) / (end @ end)
        return np.concatenate([self.indices + root, self.indices - root]), np.array([one, 1 / one])

    @cached_property
    def index_form(self) -> tuple[Array, Array | None]:
        (A, B), (C, _) = self.half_map
        form = -A.T @ C
        return np.eye(len(form)) + 2 * B.T @ C, (form + form.T) / 2

    @cached_property
    @one_thread
    def passing(self) -> tuple[NDArray[np.complex128], Array, Array | None, int]:
        # where its second half is the first with all signs turned, D^T is A, and -A has the indices
        # q of a half, of which the whole has 2 q^2 - 1: there -q and q pass each other as if alone
        (A, _), (C, D) = self.half_map
        first, last = self.forces
        off = abs(A - D.T).max() / abs(A).max(), abs(first + last).max() / abs(first).max()
        if not max(off) < NEAR:
            return super().passing
        across = np.linalg.qr(first[:, None], mode="complete")[0][:, 1:]
        return on_axis(np.linalg.eigvals(-across.T @ A @ across)), -A, (C + C.T) / 2, 2


# --- events -------------------------------------------------------------------------------------


def _block(end: int, begin: int, point: Point) -> Array:
    """A block of the half map. Where A or D is singular an index is -1, for it is that of
    ``2 D^T A - 1``; where B is, bordered by its null vectors of the orbit's own velocity, 1."""
    orbit = point.base_point.solution
    block: Array = orbit.half_map[end, begin]
    if begin == end:
        return block
    first, last = orbit.forces
    return np.block([[block, last[:, None]], [first, np.zeros(1)]])


def _least_two(matrix: Callable[[Point], Array], point: Point) -> float:
    """Multiply the two least singular values, with the sign of the determinant. That is smooth
    where two curves of singular matrices cross, too, as of modes of different symmetry."""
    whole = matrix(point)
    least = np.linalg.svd(whole, compute_uv=False)[-2:]
    return float(np.copysign(least.prod(), np.linalg.slogdet(whole)[0]))


def _examine_flip(point: Point) -> Examined:
    """By both at once, as of an orbit that is its own image, it touches -1 and leaves no circle."""
    sizes = np.linalg.svd(point.base_point.solution.half_map[[0, 1], [0, 1]], compute_uv=False)
    flat = (sizes[:, -1] < NEAR * sizes[:, 0]).all()
    return NOTHING if flat else examine_place(-1.0, "", point)


def _free(point: Point) -> bool:
    """Tell whether an index is so little off 1 that it is that of a motion which nothing holds
    back."""
    off = abs(point.base_point.solution.indices - 1).min(initial=math.inf)
    return bool(off < 1e-8)


def _crosses(point: Point) -> float:
    """The test of BP; NaN where its sign is rounding. Next to the band a breather may move along a
    ring all but freely: anywhere there is a solution, to the error of Newton's iteration."""
    assert BRANCH_POINT.test is not None
    return math.nan if _free(point) else BRANCH_POINT.test(point)


def _examine_reversal(found: Examined, point: Point) -> Examined:
    """A pair that passes +1 is off it a little before and after. Next to no coupling, where sites
    move apart from each other all but freely, one is there, and rounding tells on which side."""
    base = point.base_point
    if base.tangent is not None:
        steps = (sign * STEP * base.direction for sign in (1, -1))
        if all(_free(Point(base.curve, base.z + step)) for step in steps):
            return NOTHING
    return examine_place(1.0, found, point)


def _born(point: Point) -> Examined:
    """The end of a family at rest, and the mode of which it is there."""
    if reason := examine_swing(FLAT, point):
        return reason
    orbit = point.base_point.solution
    modes = orbit.chain.frequencies(orbit.params)
    nearest = int(abs(modes - orbit.omega).argmin())
    ranks = {0: "the lowest", modes.size - 1: "the highest"}  # of a defect: outside of the band
    rank = f"{ranks.get(nearest, f'number {nearest + 1} from below')} of {modes.size}"
    mode = f"the mode of frequency {modes[nearest]:.9g}, {rank}"
    return {"said": f"it shrinks to rest: the family is born there from {mode}"}


def events_of_breather(equations: FlowEquations) -> tuple[Event, ...]:
    """List the events of a breather of these equations."""
    if not isinstance(equations, HalfOrbit):
        return events_of_cycle(equations)
    crossing = replace(BRANCH_POINT, test=Singular(bordered_matrix, _crosses))
    lp, turn, branch_point, pd, kc = conservative_events(crossing)
    said = {"said": "orbits branch off that are not their own images under a reversal of time"}
    turned, *ends = (partial(_block, *at) for at in ((0, 1), (0, 0), (1, 1)))
    loci = [partial(followed, partial(_least_two, block)) for block in (turned, *ends)]
    pf = replace(
        event_at(1.0, "PF", Singular(turned), said),
        locus=loci[0], examine=partial(_examine_reversal, said),
    )  # fmt: skip
    flips = [
        replace(pd, test=Singular(block), locus=locus, examine=_examine_flip)
        for block, locus in zip(ends, loci[1:], strict=True)
    ]
    born = Event("HB", partial(swing, FLAT), examine=_born, ends="branch")
    return lp, turn, branch_point, pf, *flips, kc, born, HOMOCLINIC


@dataclass(frozen=True, eq=False, repr=False)
class BreatherProblem(CycleProblem):
    """The problem of a breather; its `solution` is the orbit at which it starts."""

    shown = ("max|u|", "energy")

    @property
    def solution(self) -> Breather:
        return self.orbit(self.x, self.params)

    @property
    def serialised(self) -> Mapping[str, Any] | None:
        equations, chain = self.residual, self.solution.chain
        if equations.conservation:  # whose phase is that of the orbit it began with
            return None
        # of each flow intervals and points, how many times around, sizes for its mesh, and the
        # impacts that end it
        flights = []
        for flow, f, sizes in zip(equations.flows, equations.start, equations.sizes, strict=True):
            met = [[*impact] for impact in cast("Any", flow.reset).impacts] if chain.walls else []
            flights.append([len(f.states), f.scheme.points, f.rounds, sizes.tolist(), met])
        about = {"turns": equations.turns, "begin": equations.start[0].start, "label": self.label}
        about["scales"] = dict(self.scales)  # of the orbit it began with, for steps as long
        return {"kind": "breather", **about, "chain": chain, "flights": flights}

    def orbit(self, x: Array, params: Params) -> Breather:
        kind = ReversibleBreather if isinstance(self.residual, HalfOrbit) else Breather
        return kind(self.residual, x, params)

    def having(self, *names: str) -> Problem:
        """Refuse a drive that has another period where the frequency moves."""
        if "omega" in names:
            omega = 1.01 * self.params.get("omega", 1.0)
            refuse_other_period(self.solution.chain, {**self.params, "omega": omega})
        return super().having(*names)

    def ends_near(self, point: Point) -> str:
        orbit: Breather = point.solution
        near, _ = resonance(orbit.chain, orbit.omega, orbit.params)
        return f"|u| is at most {orbit.farthest:.3g} there, and of its harmonics {near}"

    def invariants(self, point: Point) -> Array | None:
        numbers, orbit = super().invariants(point), point.solution
        if numbers is None or orbit.chain.walls is None:
            return numbers
        impacts = met(orbit)  # at CC those of both orders are one orbit
        first = min(impacts[i:] + impacts[:i] for i in range(len(impacts)))
        return np.append(numbers, [number for at in first for impact in at for number in impact])

    def lift(self, kind: str) -> Callable[[Point], SwitchingProblem] | None:
        if isinstance(self.residual, HalfOrbit):
            return {"PD": _doubled_half, "PF": _whole}.get(kind)
        return super().lift(kind)

    def exchanged(self, orbit: Breather, shrunk: Array) -> Any:  # type: ignore[override]
        return exchanged(orbit, orbit.chain, shrunk)  # which knows who impacts together

    @staticmethod
    def recorded(equations: FlowEquations, known: Iterable[str]) -> dict[str, Any]:
        gone = {*known, *(["action"] if not isinstance(equations, HalfOrbit) else [])}
        getters = {n: attrgetter(f"solution.{of}") for n, of in COLUMNS.items() if n not in gone}
        return {"unstable": UNSTABLE, **getters}


def _doubled_half(point: Point) -> SwitchingProblem:
    """Make half of the orbit of twice the period: once around, from where the perturbation that
    changes its sign is at rest, which is at one end of the half or at the other."""
    problem, half, orbit = point.curve.problem, point.curve.problem.residual, point.solution
    (whole,), k = orbit.flights, len(half.start[0].states)
    # at rest where the half begins and without displacement where it ends, or the other way around
    A, D = (np.linalg.svd(orbit.half_map[i, i], compute_uv=False)[-1] for i in range(2))
    if D < A:
        parts = whole.states, whole.slopes, whole.steps
        states, slopes, steps = (np.roll(part, -k, axis=0) for part in parts)
        knots = np.append(0.0, np.cumsum(steps))
        whole = replace(whole, knots=knots / knots[-1], states=states, slopes=slopes)
    params = dict(point.params)
    if half.held == "omega":
        params["omega"] /= 2
    twice = problem.of_flows(replace(half, start=(whole,)), params)
    return at_crossing(twice, point, both=False)


def _whole(point: Point) -> SwitchingProblem:
    """Make the whole orbit one of a family that need not be time-reversible."""
    problem, orbit, p = point.curve.problem, point.solution, point.params
    u = orbit.flights[0].states[:, : orbit.chain.sites].T
    forces = orbit.chain.gradient(u, p)
    if abs(forces - orbit.chain.gradient(u, {**p, SHARE: 0.0})).max() < NEAR * abs(forces).max():
        raise Undefined("without coupling each site has a phase of its own, and no curve sets out")
    equations = whole_orbit(problem.residual, orbit.flights, p)
    events = events_of_cycle(equations)
    family = BreatherProblem.of(equations, point.params, events, problem.label)
    return at_crossing(family, point, both=True)


def discretised(
    chain: Oscillators, flows: Sequence[Flow], flights: Sequence[TrajectorySegment],
    sizes: tuple[Array, ...] = (), turns: int = 1,
) -> FlowEquations:  # fmt: skip
    """Make the equations of an orbit, a smooth one without flows; without sizes on meshes that
    follow it."""
    if not sizes:
        sizes = sizes_of(flights)
        flights = [flight.adapted(size) for flight, size in zip(flights, sizes, strict=True)]
    names = tuple(f"{letter}{n}" for letter in "uv" for n in range(chain.sites))
    kind, period = FlowEquations, forcing_period
    if not chain.dissipative:
        kind, period = (SparseHalfOrbit if len(names) >= FEW else HalfOrbit), half_period
    flows = tuple(flows) or (Flow(chain, reset=None if chain.dissipative else resting),)
    parts = {name: (name,) for name in names}
    return kind(flows, tuple(flights), period, turns, parts, sizes)


@serialised("breather")
def _from_dict(
    *, label: str, chain: Oscillators, turns: int, begin: float, flights: Any,
    scales: Mapping[str, float], start: Mapping[str, Any], params: Params,
) -> BreatherProblem:  # fmt: skip
    """Make the equations of a breather again, which begin at these unknowns."""
    segments, n = list[TrajectorySegment](), 2 * chain.sites
    for count, points, rounds, *_ in flights:
        knots, rest = np.linspace(0.0, 1.0, count + 1), np.zeros((count, 1 + points, n))
        states = rest[:, 0], rest[:, 1:]  # until the unknowns are known
        scheme = Collocation(count, points)
        segments.append(TrajectorySegment(scheme, knots, begin, 1.0, *states, rounds))
    sizes = tuple(np.array(flight[3]) for flight in flights)
    met = [tuple(map(tuple, flight[4])) for flight in flights]
    flows = between_walls(chain, met) if chain.walls else ()
    equations = discretised(chain, flows, segments, sizes, turns)
    if isinstance(equations, HalfOrbit) and "energy" in params:
        equations = equations.holding("energy")
    x = np.concatenate([np.ravel(value) for value in start.values()])
    equations = replace(equations, start=equations.flights(x, params))
    problem = BreatherProblem.of(equations, params, events_of_breather(equations), label)
    return replace(problem, scales=scales)
