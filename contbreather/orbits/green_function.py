"""Orbits of the infinite chain and of rings by the periodic Green's function: problems to trace."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contbreather.continuation import Event, Lift, Locus, Point, Problem, branch_point, fold
from contbreather.continuation.boundary import meeting
from contbreather.continuation.curve import Curve
from contbreather.continuation.newton import Undefined
from contbreather.continuation.point import Always
from contbreather.errors import BadInput
from contbreather.lattice import InfiniteChain, Ring
from contbreather.lattice.conditions import Conditions, Walls
from contbreather.lattice.periodic_green import Wave, wave, wave_slope
from contbreather.orbits.asymmetric import NAMES, AsymmetricEquations
from contbreather.orbits.branch_switching import from_arms, lift
from contbreather.orbits.grazing import GrazingSite, solution_at
from contbreather.orbits.green_equations import GreenFlight, OrbitEquations, Params
from contbreather.orbits.on_circle import OnCircle, by_differences, off_the_edge
from contbreather.orbits.orbit import Orbit, orbit_of
from contbreather.orbits.orbit_events import events_of
from contbreather.orbits.orbit_problem import on_ring, orbit_problem, read_by, unstable_by
from contbreather.orbits.representation import Impacts, Offsets, Representation, representation
from contbreather.orbits.section import Impact, Section, check_order
from contbreather.orbits.site_motion import GreenMotion, Terms, moved
from contbreather.orbits.symmetries import simpler_than
from contbreather.stability.verdict import THRESHOLD, check_threshold

FloatArray = NDArray[np.float64]

EQUAL = 1e-9  # flights that differ by less are equal
LEAST = 1e-12  # an impulse smaller than this is none
ACROSS = Section(((0, 1), (0, -1)))


@representation(2)
@dataclass(frozen=True)
class GreensFunction(GreenFlight):
    """Any impacts, by the waves they send along chain or ring."""

    @staticmethod
    def suits(on: Conditions, section: Section) -> bool:
        plain = not (on.damping or on.spring) and on.walls == Walls()
        return plain and section.sign > 0 and isinstance(on.lattice, InfiniteChain | Ring)

    @classmethod
    def through(
        cls, on: Conditions, section: Section, times: Any, impulses: Any, offsets: Offsets
    ) -> GreensFunction:
        if not section.count == len(times) == len(impulses):
            raise BadInput(
                f"{section.count} impacts, {len(times)} times, {len(impulses)} impulses: one time "
                "and one impulse for each impact is expected."
            )
        check_order(section, times)
        offsets = offsets or (0.0,) * len(section.hit)
        return cls.of(on, section, [*times, *impulses, *offsets], on.params)

    @classmethod
    def of(cls, on: Conditions, section: Section, x: Any, params: Params) -> GreensFunction:
        """With these times, impulses and offsets."""
        m, values = section.count, np.asarray(x, dtype=float).tolist()
        named = zip(section.impacts, values[:m], values[m : 2 * m], strict=True)
        impacts = tuple(Impact(*impact, t, J) for impact, t, J in named)
        return cls(on.at(params), section, impacts, tuple(values[2 * m :]))

    @classmethod
    def arm(cls, on: Conditions, section: Section, x: Any, params: Params) -> GreensFunction:
        """With ``p, t1, t2, c`` of two impacts."""
        p, t1, t2, c = x
        return cls.of(on, section, (t1, t2, -2.0 * p, 2.0 * p, c), params)

    def problem(self, threshold: float) -> Problem:
        orbit = Orbit(self)
        if self.section.two_impacts and abs(orbit.asymmetry) > EQUAL:
            return asymmetric_problem(orbit, threshold)
        return impact_problem(orbit, threshold)

    def guess(self) -> Problem:
        return impact_problem(Orbit(self))

    @property
    def motion(self) -> GreenMotion:
        return GreenMotion(Orbit(self))

    def weakly(self) -> None:
        """Where there is no coupling, the closest site is meant."""

    def locus(self, of: OnCircle, point: Point, nu: float | None = None, **more: Any) -> Locus:
        endless = self.conditions.lattice.sites is None
        return of.locus(by_differences if nu is None or not endless else off_the_edge, nu, **more)

    def crest(self, site: int) -> GrazingSite:
        return _crest(Orbit(self), site)

    def speed_slope(self, j: int) -> None:
        """An impulse of 0 pushes away from no wall."""

    def lifted(self) -> Problem:
        return Orbit(self).doubled().problem

    def rewritten(
        self, section: Section, impacts: Impacts, offsets: Offsets
    ) -> Representation | None:
        if not section.symmetric:
            return replace(self, section=section, impacts=tuple(impacts), offsets=tuple(offsets))
        if section.count > 1 or section.impacts[0] != (0, 1):
            return None
        (one,) = impacts
        return orbit_of(self.conditions, section, [one.time], [one.impulse]).representation

    def on(self, lattice: Any) -> None:
        """Its impacts are as good a guess as any."""


# --- any impacts ----------------------------------------------------------------------------------


@read_by("orbit with impacts", GreensFunction.of)
def impact_problem(orbit: Orbit, threshold: float = THRESHOLD) -> Problem:
    """The equations of an orbit with any impacts, with the orbit as their start.

    Columns: t1..tm, J1..Jm and c (c1, c2, ... where several sites take impacts); a, gamma, k and
    the parameters of the forcing; ``unstable``, the number of multipliers outside; for two impacts
    ``p``, and ``asymmetry`` where half a symmetric orbit may do. Every branch point of the
    equations is BP, on a branch of symmetric breathers their pitchfork, too; from an arm it is PF.
    """
    motion = orbit.representation
    equations: OrbitEquations = motion.equations
    record: dict[str, Any] = {"unstable": unstable_by(threshold)}
    own = {"p": orbit.section.two_impacts, "asymmetry": orbit.section.mirrored}
    record |= {name: attrgetter(f"solution.{name}") for name, there in own.items() if there}
    return orbit_problem(
        "orbit with impacts",
        partial(GreensFunction.of, orbit.conditions, orbit.section),
        orbit,
        threshold,
        residual=equations.residual,
        start=dict(zip(equations.names, motion.x.tolist(), strict=True)),
        params=_params(orbit),
        jacobian=equations.jacobian,
        sensitivity=equations.sensitivity,
        events=(
            fold(),
            from_arms(branch_point()),
            *_events(orbit, threshold),
        ),
        record=record,
        domain=domain_of(equations),
        label="orbit with impacts",
    )


def _events(orbit: Orbit, threshold: float) -> tuple[Event, ...]:
    if isinstance(orbit.lattice, Ring):
        check_threshold(threshold)
    return events_of(orbit.section, orbit.lattice, threshold)


def _params(orbit: Orbit) -> dict[str, float]:
    """a, gamma, k and the parameters of the forcing."""
    held = ("damping", "spring")
    return {name: v for name, v in orbit.conditions.params.items() if name not in held}


def domain_of(equations: OrbitEquations) -> dict[str, tuple[float, float]]:
    """Where the parameters mean something, and each impulse pushes away from its wall."""
    edge = 0.25 if equations.lattice.sites is not None else 0.25 / equations.section.turns**2
    domain = {"gamma": (0.0, edge), "k": (0.0, 1.0), "a": (0.0, math.inf)}
    for i, (_, wall) in enumerate(equations.section.impacts):
        domain[f"J{i + 1}"] = (-math.inf, -LEAST) if wall > 0 else (LEAST, math.inf)
    return domain


# --- two impacts of one site ----------------------------------------------------------------------


@read_by("asymmetric breather", GreensFunction.arm)
def asymmetric_problem(orbit: Orbit, threshold: float = THRESHOLD) -> Problem:
    """The four equations with an orbit of two impacts as their start, and all its events.

    Columns: p, t1, t2, c; a, gamma, k and the parameters of the forcing; ``asymmetry`` is
    t2 - t1 - pi, ``unstable`` the number of multipliers outside.
    """
    first = orbit.impacts[0].time
    times = first, first + math.pi + orbit.asymmetry  # times count modulo the period
    equations = AsymmetricEquations(orbit.forcing, orbit.lattice)
    return orbit_problem(
        "asymmetric breather",
        partial(GreensFunction.arm, orbit.conditions, orbit.section),
        orbit,
        threshold,
        residual=equations.residual,
        start=dict(zip(NAMES, (orbit.p, *times, orbit.c), strict=True)),
        params=_params(orbit),
        jacobian=equations.jacobian,
        sensitivity=equations.sensitivity,
        events=(pitchfork_of_arms(), fold_of_arms(), *_events(orbit, threshold)),
        record={"asymmetry": _asymmetry, "unstable": unstable_by(threshold)},
        domain={
            "gamma": (0.0, 0.25),
            "k": (0.0, 1.0),
            "a": (0.0, math.inf),
            "p": (LEAST, math.inf),
        },
        images=_mirror_image,
        lifts={"PF": symmetric_again, "PD": lift},
        label=f"asymmetric breather{on_ring(orbit.lattice, threshold)}",
    )


def _asymmetry(point: Point) -> float:
    return float(point["t2"] - point["t1"] - math.pi)


def _mirror_image(x: FloatArray, params: Mapping[str, float]) -> tuple[FloatArray, ...]:
    p, t1, t2, c = x
    return (np.array((p, t2 - math.pi, t1 + math.pi, -c)),)


def pitchfork_of_arms() -> Event:
    """PF of an orbit with two impacts: both flights become equal, ``t2 - t1 = pi``.

    Nothing changes sign there but the asymmetry itself: both arms are mirror images.
    """
    return Event("PF", _unequal, locus=Always(Locus({}, _equal_flights, _equal_flights_slope)))


def _unequal(point: Point) -> float:
    return solution_at(point).asymmetry


def _equal_flights(curve: Curve, z: FloatArray, extra: FloatArray) -> FloatArray:
    return np.array([z[curve.slots["t2"]] - z[curve.slots["t1"]] - math.pi])


def _equal_flights_slope(curve: Curve, z: FloatArray, extra: FloatArray) -> FloatArray:
    row = np.zeros((1, z.size))
    row[0, curve.slots["t2"]], row[0, curve.slots["t1"]] = 1.0, -1.0
    return row


def symmetric_again(point: Point) -> Lift:
    """The branch of symmetric breathers, in its own problem."""
    breather = simpler_than(solution_at(point))
    if breather is None:
        raise Undefined("the flights are not equal here")
    return Lift(breather.problem, point.curve.free[-1])


def fold_of_arms() -> Event:
    """LP of an orbit with two impacts and unequal flights.

    Where its flights become equal the branch turns back as well, but that is its pitchfork. There
    the test of a fold and the asymmetry vanish together, and their ratio does not.
    """
    return replace(_off_pitchfork(fold()), locus=_fold_locus)


def _off_pitchfork(event: Event) -> Event:
    return replace(event, test=partial(_per_asymmetry, event))


def _per_asymmetry(event: Event, point: Point) -> float:
    asymmetry = _unequal(point.ground)
    return math.nan if asymmetry == 0.0 else event.value(point) / asymmetry


def _fold_locus(point: Point) -> Locus:
    # on its curve, so does the test of a cusp where both folds of mirror images meet
    own = fold().locus
    assert own is not None
    locus = own(point)
    return replace(locus, events=tuple(map(_off_pitchfork, locus.events)))


# --- a site that grazes -------------------------------------------------------------------------


def _crest(orbit: Orbit, site: int) -> GrazingSite:
    """A site with its share of the offsets as it is where the curve sets out.

    The grazing of an arm ends at its pitchfork, on the side of the arm. There that of the other arm
    begins: the margin of the mirrored crest vanishes together with the asymmetry, and their ratio
    does not. So that this end is known by one name, margins are those per asymmetry.
    """
    share = _offset_share(orbit, site)
    followed = GrazingSite(
        site, partial(_motion_slopes, site, share), partial(_motion, site, share)
    )
    asymmetry = orbit.asymmetry if orbit.section.two_impacts else 0.0
    if abs(asymmetry) <= EQUAL:
        return replace(followed, meets={"PF": ()})
    side = math.copysign(1.0, asymmetry)
    pitchfork = meeting("GR", pitchfork_of_arms())
    end = replace(pitchfork, test=partial(_towards, side), ends="domain")
    scale = partial(_while_asymmetric, side)
    return replace(followed, further=(end,), scale=scale, meets={"PF": ()})


def _motion(site: int, share: FloatArray, orbit: Orbit, t: float) -> Terms:
    u, v, w = moved(orbit, site, t)
    return u + float(share @ orbit.offsets), v, w


def _offset_share(orbit: Orbit, site: int) -> FloatArray:
    """Weights of the offsets in the static displacement of a site.

    On a boundary that runs into gamma = 0 a site keeps to what holds for gamma > 0.
    """
    size = len(orbit.offsets)
    if orbit.gamma == 0.0 and site not in orbit.section.hit:
        return np.zeros(size)
    flight = orbit.representation
    unit = [replace(flight, offsets=tuple(row)).offset(site) for row in np.eye(size).tolist()]
    return np.array(unit, dtype=float)


def _motion_slopes(
    site: int, share: FloatArray, curve: Curve, orbit: Orbit, t: float
) -> FloatArray:
    """Of displacement and velocity at a fixed time."""
    f, a, impulses = orbit.forcing, orbit.a, orbit.impulses
    answers = _answers(orbit, site, t, wave)
    slopes: dict[str, Any] = {"a": (f.f(t), f.df(t)), "k": (0.0, 0.0), "c": (share[0], 0.0)}
    slopes["p"] = 2.0 * np.sign(impulses) @ answers[:, :2]
    for i, (row, impulse) in enumerate(zip(answers, impulses, strict=True), start=1):
        slopes[f"J{i}"], slopes[f"t{i}"] = row[:2], -impulse * row[1:]
    slopes |= {f"c{i}": (own, 0.0) for i, own in enumerate(share, start=1)}
    if "gamma" in curve.free:
        slopes["gamma"] = impulses @ _answers(orbit, site, t, wave_slope)[:, :2]
    for name in {*f.params} & {*curve.free}:
        slopes[name] = a * f.f_param(name, t, 0), a * f.f_param(name, t, 1)
    return np.array([slopes[name] for name in (*curve.problem.start, *curve.free)]).T


def _answers(orbit: Orbit, site: int, t: float, make: Callable[..., Wave]) -> FloatArray:
    """What a unit impulse of each impact does to a site: value, slope, curvature."""
    lattice, found = orbit.lattice, []
    for one in orbit.impacts:
        distance = lattice.distance(site - one.site)
        answer = make(lattice, orbit.gamma, distance, orbit.section.turns)
        found.append(answer.at(t - one.time)[:3])
    return np.array(found)


def _towards(side: float, point: Point) -> float:
    return side * solution_at(point.ground).asymmetry


def _while_asymmetric(side: float, point: Point) -> float:
    asymmetry = _towards(side, point)
    return asymmetry if asymmetry > EQUAL else math.nan
