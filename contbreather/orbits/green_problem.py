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

from contbreather.continuation.boundary import meeting
from contbreather.continuation.curve import Curve
from contbreather.continuation.equilibria import branch_point, fold
from contbreather.continuation.newton import Undefined
from contbreather.continuation.point import Always, DefiningSystem, Event, Point
from contbreather.continuation.problem import Problem
from contbreather.continuation.switching import SwitchingProblem
from contbreather.lattice.chain import Ring
from contbreather.lattice.periodic_green import wave_slope
from contbreather.orbits.branch_switching import from_arms
from contbreather.orbits.grazing import GrazingSite, solution_at
from contbreather.orbits.green_equations import EQUAL, NAMES, AsymmetricEquations, OrbitEquations
from contbreather.orbits.orbit import Orbit
from contbreather.orbits.orbit_events import events_of
from contbreather.orbits.orbit_problem import OrbitProblem, orbit_problem, ring_label, unstable_by
from contbreather.orbits.site_motion import Terms
from contbreather.orbits.symmetries import simpler_than
from contbreather.stability.verdict import THRESHOLD, check_threshold

FloatArray = NDArray[np.float64]

LEAST = 1e-12  # an impulse smaller than this is none


# --- any impacts ----------------------------------------------------------------------------------


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
    optional = {"p": orbit.section.two_impacts, "asymmetry": orbit.section.mirrored}
    record |= {name: attrgetter(f"solution.{name}") for name, has in optional.items() if has}
    return orbit_problem(
        "orbit with impacts",
        partial(type(motion).of, orbit.conditions, orbit.section),
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
    # the harmonic 1/n above the band, 2 sqrt(gamma) < 1/n: a chain without end would radiate it
    edge = 0.25 if equations.lattice.sites is not None else 0.25 / equations.section.turns**2
    domain = {"gamma": (0.0, edge), "k": (0.0, 1.0), "a": (0.0, math.inf)}
    for i, (_, wall) in enumerate(equations.section.impacts):
        domain[f"J{i + 1}"] = (-math.inf, -LEAST) if wall > 0 else (LEAST, math.inf)
    return domain


# --- two impacts of one site ----------------------------------------------------------------------


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
        partial(type(orbit.representation).arm, orbit.conditions, orbit.section),
        orbit,
        threshold,
        _Asymmetric,
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
        label=f"asymmetric breather{ring_label(orbit.lattice, threshold)}",
    )


def _asymmetry(point: Point) -> float:
    return float(point["t2"] - point["t1"] - math.pi)


@dataclass(frozen=True, eq=False, repr=False)
class _Asymmetric(OrbitProblem):
    def images(self, x: FloatArray, params: Mapping[str, float]) -> tuple[FloatArray, ...]:
        p, t1, t2, c = x
        # u(t) -> -u(t + pi): the impacts change places, the offset its sign
        return (np.array((p, t2 - math.pi, t1 + math.pi, -c)),)

    def lift(self, kind: str) -> Callable[[Point], SwitchingProblem] | None:
        return symmetric_again if kind == "PF" else super().lift(kind)


def pitchfork_of_arms() -> Event:
    """PF of an orbit with two impacts: both flights become equal, ``t2 - t1 = pi``.

    Nothing changes sign there but the asymmetry itself: both arms are mirror images.
    """
    return Event(
        "PF", _unequal, locus=Always(DefiningSystem({}, _equal_flights, _equal_flights_slope))
    )


def _unequal(point: Point) -> float:
    return solution_at(point).asymmetry


def _equal_flights(curve: Curve, z: FloatArray, extra: FloatArray) -> FloatArray:
    return np.array([z[curve.slots["t2"]] - z[curve.slots["t1"]] - math.pi])


def _equal_flights_slope(curve: Curve, z: FloatArray, extra: FloatArray) -> FloatArray:
    row = np.zeros((1, z.size))
    row[0, curve.slots["t2"]], row[0, curve.slots["t1"]] = 1.0, -1.0
    return row


def symmetric_again(point: Point) -> SwitchingProblem:
    """The branch of symmetric breathers, in its own problem."""
    breather = simpler_than(solution_at(point))
    if breather is None:
        raise Undefined("the flights are not equal here")
    return SwitchingProblem(breather.problem, point.curve.free[-1])


def fold_of_arms() -> Event:
    """LP of an orbit with two impacts and unequal flights.

    Where its flights become equal the branch turns back as well, but that is its pitchfork. There
    the test of a fold and the asymmetry vanish together, and their ratio does not.
    """
    return replace(_off_pitchfork(fold()), locus=_fold_locus)


def _off_pitchfork(event: Event) -> Event:
    return replace(event, test=partial(_per_asymmetry, event))


def _per_asymmetry(event: Event, point: Point) -> float:
    asymmetry = _unequal(point.base_point)
    # 0/0 at the pitchfork itself
    return math.nan if asymmetry == 0.0 else event.value(point) / asymmetry


def _fold_locus(point: Point) -> DefiningSystem:
    # on its curve, so does the test of a cusp where both folds of mirror images meet
    locus_of = fold().locus
    assert locus_of is not None
    locus = locus_of(point)
    return replace(locus, events=tuple(map(_off_pitchfork, locus.events)))


# --- a site that grazes -------------------------------------------------------------------------


def grazing_site(orbit: Orbit, site: int) -> GrazingSite:
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
    u, v, w = orbit.representation.without_offset(site, t)
    return u + float(share @ orbit.offsets), v, w


def _offset_share(orbit: Orbit, site: int) -> FloatArray:
    """Weights of the offsets in the static displacement of a site.

    On a boundary that runs into gamma = 0 a site keeps to what holds for gamma > 0.
    """
    size = len(orbit.offsets)
    if orbit.gamma == 0.0 and site not in orbit.section.hit:
        return np.zeros(size)
    flight = orbit.representation
    # the static displacement is linear in the offsets: what each of size 1 does
    unit = [replace(flight, offsets=tuple(row)).offset(site) for row in np.eye(size).tolist()]
    return np.array(unit, dtype=float)


def _motion_slopes(
    site: int, share: FloatArray, curve: Curve, orbit: Orbit, t: float
) -> FloatArray:
    """Of displacement and velocity at a fixed time."""
    f, a, impulses = orbit.forcing, orbit.a, orbit.impulses
    answers = orbit.representation.answers(site, t)
    slopes: dict[str, Any] = {"a": (f.f(t), f.df(t)), "k": (0.0, 0.0), "c": (share[0], 0.0)}
    # of two impacts J = -2p and 2p
    slopes["p"] = 2.0 * np.sign(impulses) @ answers[:, :2]
    for i, (row, impulse) in enumerate(zip(answers, impulses, strict=True), start=1):
        # an answer is a function of t - t_i: its derivative in t_i is minus that in t
        slopes[f"J{i}"], slopes[f"t{i}"] = row[:2], -impulse * row[1:]
    slopes |= {f"c{i}": (weight, 0.0) for i, weight in enumerate(share, start=1)}
    if "gamma" in curve.free:
        slopes["gamma"] = impulses @ orbit.representation.answers(site, t, wave_slope)[:, :2]
    for name in {*f.params} & {*curve.free}:
        slopes[name] = a * f.f_param(name, t, 0), a * f.f_param(name, t, 1)
    return np.array([slopes[name] for name in (*curve.problem.start, *curve.free)]).T


def _towards(side: float, point: Point) -> float:
    return side * solution_at(point.base_point).asymmetry


def _while_asymmetric(side: float, point: Point) -> float:
    asymmetry = _towards(side, point)
    # closer to the pitchfork a margin per asymmetry is rounding over rounding
    return asymmetry if asymmetry > EQUAL else math.nan
