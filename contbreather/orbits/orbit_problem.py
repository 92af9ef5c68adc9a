"""An orbit as a problem to trace: what that has on every representation, besides its equations."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from operator import attrgetter, itemgetter
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from contbreather.continuation.algebra.newton import Undefined
from contbreather.continuation.branches.switching import SwitchingProblem
from contbreather.continuation.curve.branch import Points
from contbreather.continuation.curve.curve import Curve
from contbreather.continuation.curve.point import Implied, Point, UnstableDimension
from contbreather.continuation.curve.problem import Problem, TiedProblem
from contbreather.continuation.curve.ties import Ties
from contbreather.errors import BadInput
from contbreather.lattice.chain import Chains
from contbreather.lattice.conditions import Conditions, SpringResponse
from contbreather.lattice.forcing import peak_of
from contbreather.lattice.periodic_green import half_period_tables
from contbreather.orbits.beyond_grazing import past_grazing
from contbreather.orbits.branch_switching import lift, relisted
from contbreather.orbits.clearance import measured_margins, single
from contbreather.orbits.closure import ClosureTerms, saltation_of
from contbreather.orbits.margins import Along
from contbreather.orbits.orbit import Orbit, orbit_at, suitable
from contbreather.orbits.section import VANISHED, Section
from contbreather.orbits.site_motion import Motion
from contbreather.orbits.symmetries import images_of, simpler_than
from contbreather.parameters import NUMBERS, POWERS
from contbreather.stability.one_impact import HalfMap
from contbreather.storage.serialise import from_dict, serialised

FloatArray = NDArray[np.float64]
Params = Mapping[str, float]
At = Callable[[FloatArray, Params], Any]


@dataclass(frozen=True, eq=False, repr=False)
class OrbitProblem(Problem):
    """A `Problem` with orbits for its points."""

    kind: str = field(kw_only=True)  # by which files make it again, see `read_by`
    motion_at: At = field(kw_only=True)  # the representation with given unknowns and parameters
    conditions: Conditions = field(kw_only=True)  # of the orbit it was made for
    section: Section = field(kw_only=True)
    threshold: float = field(kw_only=True)  # of its events, on finite lattices
    equations: Any = field(kw_only=True)  # which know their derivatives in the parameters, too
    tested: ClassVar[bool] = True
    shown: ClassVar[tuple[str, ...]] = ("p",)
    parting: ClassVar[tuple[str, ...]] = ("asymmetry", "t1")

    @classmethod
    def of(
        cls, kind: str, at: At, orbit: Orbit, threshold: float, equations: Any, **more: Any
    ) -> Problem:
        """The problem of an orbit with these equations, events and columns."""
        return cls(
            residual=equations.residual,
            kind=kind,
            motion_at=at,
            conditions=orbit.conditions,
            section=orbit.section,
            threshold=threshold,
            equations=equations,
            **more,
        )

    @property
    def serialised(self) -> Mapping[str, Any]:
        names = ("kind", "conditions", "section", "threshold")
        return {name: getattr(self, name) for name in names}

    def interpret(self, point: Point) -> Orbit:  # type: ignore[override]
        return Orbit(self.motion_at(point.x, point.params))

    def along(self, x: FloatArray, params: Params, rates: Sequence[Params]) -> FloatArray:
        """Derivatives in the unknowns, and along directions of the parameters: rates by name."""
        of = self.equations
        columns = [of.along(x, params, way) for way in rates]
        return np.column_stack([of.jacobian(x, params), *columns])

    def derivatives(self, x: FloatArray, params: Params, free: tuple[str, ...]) -> FloatArray:
        """Derivatives in the unknowns and in parameters, side by side."""
        return self.along(x, params, [{name: 1.0} for name in free])

    def images(self, x: FloatArray, params: Params) -> tuple[FloatArray, ...]:
        orbit = Orbit(self.motion_at(x, params))
        found = (image.representation.x for image in images_of(orbit))
        # next to a resonance that this curve did not set out from they have other unknowns
        return tuple(image for image in found if image.size == x.size)

    def simpler(self, point: Point) -> Problem | None:
        """By fewer impacts; or as any two of one site by the four equations that they have."""
        orbit: Orbit = point.solution
        smaller = (simpler_than(orbit) or orbit).problem
        return smaller if len(smaller.start) < len(self.start) else None

    def lift(self, kind: str) -> Callable[[Point], SwitchingProblem] | None:
        beyond = {"GR": past_grazing, "VI": past_grazing, "CC": relisted}
        if kind in beyond:
            return beyond[kind]
        # half a symmetric orbit has lost its symmetry before it can double its period
        return lift if kind == ("PF" if self.section.symmetric else "PD") else None

    def said_at_end(self, point: Point) -> str:
        """Name what touches a wall there, or impacts at once."""
        kinds = point.kind.split("-")
        if kinds == ["CC"]:
            return str(point.detail["impacts"])
        if not {"GR", "VI"} & set(kinds):
            return ""
        if "impacts" in point.detail:
            return f"impacts {point.detail['impacts']}"
        margins = point.solution.admissibility()
        by_margin = getattr(margins, "places", {})  # of any impacts: the worst place only
        # two margins that are as small as this vanish together
        places = [by_margin[name] for name in by_margin if getattr(margins, name) < 1e-6]
        if kinds == ["GR", "GR"] and len(places) > 1:
            *several, last = (
                "the far field" if site is None else f"site {site} at t = {time:.6g}"
                for site, time in places
            )
            return f"{', '.join(several)} and {last} graze at once"
        return str(margins.reason).removeprefix("at the limit: ")

    def at_frequency(self, omega: float, /, **given: float) -> DrivenProblem:
        """These equations in the time in which the drive has this frequency, a parameter; others
        that are known in it are given."""
        scales = {n: omega ** POWERS.get(n, 0) for n in self.params}
        params = {n: given.get(n, self.params[n] * scale) for n, scale in scales.items()}
        scaled = {n: edges for n, edges in self.domain.items() if n in POWERS}
        domain = {n: edges for n, edges in self.domain.items() if n not in POWERS}
        ties = _TiesOfDrive(self, {n: itemgetter(n) for n in self.params}, scaled)
        return DrivenProblem(
            partial(_in_users_units, ties.of(self.residual)), self.start,
            {**params, "omega": omega}, events=self.events, label=self.label, record=self.record,
            domain={**domain, "omega": NUMBERS["omega"].domain}, scales=self.scales, ties=ties,
            kind="orbit at a frequency", motion_at=self.motion_at, section=self.section,
            conditions=self.conditions.at_frequency(omega, **params), threshold=self.threshold,
            equations=self.equations,
        )  # fmt: skip

    def with_parameters(self, names: tuple[str, ...]) -> Problem:
        if "omega" in names:
            others: Any = self.having(*(name for name in names if name != "omega"))
            return others.at_frequency(1.0)
        # in another representation, where its own lacks these
        orbit = orbit_at(self)
        on, section = orbit.conditions, orbit.section
        wanted = [name for name in names if name in on.params]
        if not wanted:
            return self
        for kind in suitable(on, section):
            motion = kind.through(on, section, orbit.times, orbit.impulses, orbit.offsets)
            problem = motion.guess(self.threshold)
            if problem.params.keys() >= {*wanted}:
                return problem
        raise BadInput(
            f"{' and '.join(wanted)}: orbits of the infinite chain have no damping, and springs "
            "only where, in equal flights, one site hits its walls in turn; take a finite "
            "lattice, a ring of 100 sites for instance."
        )


def _in_users_units(asked: Callable[..., Any], *given: Any) -> Any:
    """Ask what ends with the parameters in question: where the drive comes to the band of chain or
    ring its refusal is about that, in the unit of time of omega."""
    try:
        return asked(*given)
    except (BadInput, Undefined) as error:
        params = next(part for part in given if isinstance(part, Mapping) and "omega" in part)
        omega, gamma, spring = (params.get(name, 0.0) for name in ("omega", "gamma", "spring"))
        low, high = (math.sqrt(max(0.0, edge)) for edge in (spring, spring + 4.0 * gamma))
        if not high >= 0.999 * omega:
            raise
        if omega < low:
            raise type(error)(f"in the unit of time in which omega is 1, {error}") from error
        held = f", spring = {spring:.6g}" if spring else ""
        raise type(error)(
            f"harmonic 1 of the drive, omega = {omega:.6g}, comes to the band of the lattice, "
            f"{low:.6g} to {high:.6g} at gamma = {gamma:.6g}{held}"
        ) from error


class _TiesOfDrive(Ties):
    """Ties by powers of omega: of the functions only the names count."""

    def __call__(self, params: Params) -> dict[str, Any]:
        omega = params["omega"]
        return {n: params[n] / omega ** POWERS.get(n, 0) for n in self.functions}

    def within(self, params: Params) -> dict[str, Any]:
        return _in_users_units(super().within, params)

    def slopes(self, params: Params, free: tuple[str, ...]) -> dict[str, FloatArray]:
        ways = [self.rates(params, name) for name in free]
        names = [name for name in self.functions if any(name in way for way in ways)]
        return {name: np.array([way.get(name, 0.0) for way in ways]) for name in names}

    def rates(self, params: Params, name: str) -> dict[str, float]:
        """Rates at which parameters of the base change with one."""
        omega = params["omega"]
        if name != "omega":
            return {name: omega ** -POWERS.get(name, 0)}
        by = {
            n: -power * params[n] / omega ** (power + 1)
            for n, power in POWERS.items()
            if n in params
        }
        return {n: rate for n, rate in by.items() if rate}


@dataclass(frozen=True, eq=False, repr=False)
class DrivenProblem(TiedProblem, OrbitProblem):  # type: ignore[override]
    """Orbits under a drive of any frequency, by the equations in the time of the drive."""

    walker = property(attrgetter("base.walker"))
    kernel_data = property(attrgetter("base.kernel_data"), doc="Data of kernels: these know omega.")
    lift = property(attrgetter("base.lift"))

    @property
    def serialised(self) -> Mapping[str, Any]:
        form = dict(self.base.serialised or {})
        return {"kind": self.kind, "of": form.pop("kind"), "form": form}

    def interpret(self, point: Point) -> Orbit:  # type: ignore[override]
        params = point.params
        return Orbit(self.motion_at(point.x, self.ties(params)), params["omega"], params)

    def domain_along(self, free: tuple[str, ...]) -> Mapping[str, tuple[float, float]]:
        omega = self.params["omega"]
        slow, fast = self.domain["omega"] if "omega" in free else (omega, omega)
        tied = self.ties.domain.items()
        ends = {n: (low * slow ** POWERS[n], high * fast ** POWERS[n]) for n, (low, high) in tied}
        return {**self.domain, **ends}

    def derivatives(self, x: FloatArray, params: Params, free: tuple[str, ...]) -> FloatArray:
        ties: Any = self.ties
        base = self.base
        return base.along(x, ties.within(params), [ties.rates(params, name) for name in free])

    def with_parameters(self, names: tuple[str, ...]) -> Problem:
        base: Any = self.base.at(**self.start, **self.ties(self.params)).having(*names)
        return base.at_frequency(self.params["omega"], **self.params)


@serialised("orbit at a frequency")
def _driven_from_dict(
    *, of: str, form: Mapping[str, Any], start: Mapping[str, Any], params: Params
) -> Problem:
    omega, own = params["omega"], {n: v for n, v in params.items() if n != "omega"}
    own |= {n: own[n] / omega ** POWERS[n] for n in POWERS if n in own}
    base = from_dict({"kind": of, **form}, start=start, params=own)
    driven: Problem = base.at_frequency(omega, **params)
    return driven


def read_by(kind: str, of: Callable[..., Any], problem: Callable[..., Problem]) -> None:
    """Enter what makes a problem of the serialised form of a kind: orbits by `of`."""
    serialised(kind)(partial(_from_dict, of, problem))


def _from_dict(
    of: Callable[..., Any],
    problem: Callable[..., Problem],
    *,
    conditions: Conditions,
    section: Mapping[str, Any],
    threshold: float,
    start: Mapping[str, Any],
    params: Params,
) -> Problem:
    # a dict keeps its order, which is that of the unknowns
    x = np.concatenate([np.ravel(value) for value in start.values()])
    # by where the curve set out, which decides what its unknowns are: next to a resonance
    # amplitudes of modes are among them
    begun = of(conditions, Section(**section), x, conditions.params)
    return problem(Orbit(begun), threshold).at(**start, **params)


def ring_label(lattice: Any, threshold: float) -> str:
    """The ring in a label; nothing for the infinite chain, whose counts have no threshold."""
    sites = lattice.sites
    return "" if sites is None else f" (ring of {sites}, threshold {threshold:g})"


def momentum(j: int, point: Point) -> float:
    """Half of what an impact transfers, by its number."""
    # (4): an impact transfers 2p
    return 0.5 * abs(float(point.solution.impulses[j]))


def of_whole_period(section: Section, times: Sequence[str], params: Params) -> dict[str, Implied]:
    """Columns that arms of a symmetric orbit have, unless a parameter has that name."""
    later = {
        f"t{section.count + j}": partial(_later, name, section.length)
        for j, name in enumerate(times, start=1)
    }
    columns: dict[str, Any] = {**later, "c": _none, "asymmetry": _none}
    return {name: Implied(column) for name, column in columns.items() if name not in params}


def _later(name: str, by: float, point: Point) -> float:
    return float(point[name]) + by


def _none(point: Point) -> float:
    return 0.0


def unstable_by(threshold: float) -> UnstableDimension:
    """The column of multipliers outside the circle, or beyond the threshold."""
    return UnstableDimension(partial(_unstable, threshold), _rows)


def _unstable(threshold: float, point: Point) -> float:
    if point.solution.vanishing is not None:  # (19) has a pole there: no count means anything
        return math.nan
    count: float = point.solution.map.unstable(threshold)
    return count


def _rows(points: Points) -> NDArray[np.int64] | None:
    """Counts at points of a branch, -1 where an impact vanishes; None where each must be asked."""
    along = breathers_along(points)
    return None if along is None else np.where(along.p > VANISHED, along.map.unstable(1.0), -1)


# --- many symmetric breathers at once -------------------------------------------------------------

# One by one most of the time goes into making them. For tests along a branch in a, gamma or omega
# they are one breather with arrays for its amplitude, coupling and spring, momentum and phase.


@dataclass(frozen=True, eq=False)
class BreathersAlong:
    """Symmetric breathers of the infinite chain under drives of one shape, in its time."""

    first: Orbit
    p: FloatArray
    phi: FloatArray
    a: FloatArray
    gamma: Any  # arrays where they differ in these
    spring: Any

    @cached_property
    def waves(self) -> FloatArray:
        """Harmonics m, A and B of the forced motions at unit amplitude, (1 or n, harmonics, 3)."""
        drive = self.first.representation.forcing
        if not np.ndim(self.spring):
            return np.array([drive.harmonics], dtype=float)
        return np.array([SpringResponse(drive.of, s).harmonics for s in self.spring.tolist()])

    @cached_property
    def map(self) -> HalfMap:
        """Map of all of them, with arrays for b and gamma; events ask."""
        chains, k = self.first.map.lattice, self.first.k
        if np.ndim(self.gamma):
            chains = Chains(self.gamma, self.spring)
        m, A, B = np.moveaxis(self.waves, 2, 0)
        turn = m * self.phi[:, None]
        w = -self.a * (m * m * (A * np.cos(turn) + B * np.sin(turn))).sum(axis=1)
        b = saltation_of(ClosureTerms(self.p, k, chains.mean(self.gamma, "eta"), w=w))
        return replace(self.first.map, b=b, gamma=self.gamma, lattice=chains)

    def margins(self) -> FloatArray:
        """The least margin of each, as `clearance.least_margin` has it of one."""
        motion = self.first.motion
        return measured_margins(motion, motion.idle, only_closest=True, along=self._along).least

    def _along(self, motion: Motion) -> tuple[Along, FloatArray]:
        # (4): a momentum of 2p is lost on the wall +1 at phi, and gained on -1 half a period later
        times = np.stack([self.phi, self.phi + np.pi], axis=1)
        impulses = np.stack([-2.0 * self.p, 2.0 * self.p], axis=1)
        one = single(motion)._replace(a=self.a, times=times, impulses=impulses)
        if np.ndim(self.gamma):
            of = self.first.motion
            apart = tuple(of.lattice.distance(n - of.hit[0]) for n in (*of.hit, *of.idle))
            tables, largest = half_period_tables(self.gamma, self.spring, apart)
            one = one._replace(tables=tables, largest=largest)
        peaks = [peak_of(tuple((int(m), A, B) for m, A, B in rows)) for rows in self.waves.tolist()]
        _, A, B = np.moveaxis(self.waves, 2, 0).copy()
        one = one._replace(cosines=A[:, None], sines=B[:, None], peaks=np.array(peaks))
        return one, 1.0 - self.a * one.peaks  # the far field is a f


def breathers_along(points: Points) -> BreathersAlong | None:
    """The breathers of points, kept by their curve; None where they are no such breathers."""
    make = partial(_breathers, points)
    breathers: BreathersAlong | None = points.curve.cached("breathers", points.z, make)
    return breathers


def _breathers(points: Points, z: FloatArray) -> BreathersAlong | None:
    curve: Any = points.curve
    (free, *others), first = curve.free, points[0].solution
    if others or free not in ("a", "gamma", "omega"):
        return None
    if not isinstance(curve.problem, OrbitProblem):  # tied, its parameters are not the chain's
        return None
    # with p <= 0 the wall +1 would pull at its site
    if not first.symmetric or first.lattice.sites is not None or not (z[:, 0] > 0.0).all():
        return None
    p, phi, value = np.ascontiguousarray(z.T)
    on = {"omega": 1.0, "spring": 0.0, **curve.fixed, free: value}
    square = on["omega"] ** 2
    a = np.broadcast_to(on["a"] / square, p.shape).copy()
    held = on["spring"] / square if on["spring"] else 0.0
    return BreathersAlong(first, p, phi, a, on["gamma"] / square, held)


# --- a multiplier on a circle ---------------------------------------------------------------------

# The defining system of PF, PD and NS. The map of an orbit says where it has a multiplier
# (`contbreather.stability.modal_map.Map`), its representation how that changes along its unknowns.


@dataclass(frozen=True)
class OnCircle:
    """``radius exp(i pi nu)`` is a multiplier over the section."""

    radius: float = 1.0
    nu: float | None = None  # 0 or 1, for a real multiplier; else one more unknown

    def conditions(self, curve: Curve, z: FloatArray, extra: FloatArray) -> FloatArray:
        map = Point(curve, z).solution.map
        return self.real_parts(map.on_circle(self.angle(extra), self.radius))

    def angle(self, extra: FloatArray) -> float:
        return float(extra[0]) if self.nu is None else self.nu

    def real_parts(self, value: complex) -> FloatArray:
        return np.array([value.real, value.imag] if self.nu is None else [value.real])
