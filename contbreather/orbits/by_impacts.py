"""Orbits of any lattice by their impacts: times, impulses and offsets, a representation.

The lattice answers between them as its response says, see `contbreather.lattice.response`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contbreather.continuation.algebra.derivatives import RELATIVE, differences
from contbreather.continuation.bifurcations.equilibria import FOLD_OF_ALIKE, branch_point, fold
from contbreather.continuation.branches.boundary import codim_two
from contbreather.continuation.curve.curve import Curve
from contbreather.continuation.curve.point import DefiningSystem, Point
from contbreather.continuation.curve.problem import Problem
from contbreather.continuation.curve.ties import chained
from contbreather.errors import BadInput, NoSolution
from contbreather.lattice.chain import Ring
from contbreather.lattice.conditions import Conditions, Walls, restitution_ratio
from contbreather.lattice.finite import highest_k
from contbreather.lattice.forcing import Fourier
from contbreather.lattice.periodic_green import check_coupling
from contbreather.lattice.response import Resonance, Resonant
from contbreather.orbits.asymmetric_breather import (
    EQUAL,
    asymmetric_problem,
    pitchfork_of_arms,
)
from contbreather.orbits.closure import fold_amplitudes, general_roots
from contbreather.orbits.grazing import GrazingSite, in_unknowns
from contbreather.orbits.orbit import Orbit
from contbreather.orbits.orbit_equations import OrbitEquations, equations_on, resonant_modes
from contbreather.orbits.orbit_events import events_of, from_arms
from contbreather.orbits.orbit_problem import (
    OnCircle,
    OrbitProblem,
    momentum,
    of_whole_period,
    read_by,
    unstable_by,
)
from contbreather.orbits.section import (
    AT_ONCE,
    Impact,
    Section,
    check_order,
    check_possible,
)
from contbreather.parameters import NAMES, NEEDED, NUMBERS, parameter
from contbreather.stability.chain_map import OrbitMap
from contbreather.stability.modal_map import ModalMap, middle_of_longest, section_map
from contbreather.stability.saltation import Saltation
from contbreather.stability.verdict import THRESHOLD

FloatArray = NDArray[np.float64]
Params = Mapping[str, float]


@dataclass(frozen=True)
class ByImpacts:
    """The motion with any impacts, on any lattice: a solution of `OrbitEquations`. Times count
    modulo the period; the infinite chain has no damping and no springs.
    """

    conditions: Conditions
    section: Section
    impacts: tuple[Impact, ...]  # of one section
    offsets: tuple[float, ...]  # of each impacting site, from left to right; none of half an orbit
    resonant: Resonant = ()  # modes that may have a harmonic of the orbit for their frequency
    amplitudes: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        on, _ = self.conditions, self.equations  # or a sentence why there are none
        if not np.isfinite(self.x).all():
            raise BadInput(
                f"impacts {self.impacts}, offsets {self.offsets}: finite numbers are expected."
            )
        if on.lattice.sites is not None:
            return
        parameter("a", on.a)
        restitution_ratio(on.k)
        check_coupling(on.lattice, on.gamma, self.section.turns)

    @classmethod
    def of(cls, on: Conditions, section: Section, x: Any, params: Params) -> ByImpacts:
        """Make the orbit of these unknowns on a curve that set out from certain conditions."""
        equations = equations_on(on, section)
        times, impulses, offsets, amplitudes = equations.split(np.asarray(x, dtype=float))
        named = zip(section.impacts, times.tolist(), impulses.tolist(), strict=True)
        impacts = tuple(Impact(*impact, t, J) for impact, t, J in named)
        moving = equations.resonant, tuple(amplitudes.tolist())
        return cls(on.at(params), section, impacts, tuple(offsets.tolist()), *moving)

    @classmethod
    def arm(cls, on: Conditions, section: Section, x: Any, params: Params) -> ByImpacts:
        """Make the orbit of ``p, t1, t2, c`` of two impacts."""
        p, t1, t2, c = x
        # (4): -2p on the wall +1, 2p on the wall -1
        return cls.of(on, section, (t1, t2, -2.0 * p, 2.0 * p, c), params)

    @classmethod
    def through(
        cls, on: Conditions, section: Section, times: Any, impulses: Any, offsets: Sequence[float]
    ) -> ByImpacts:
        if not section.count == len(times) == len(impulses):
            raise BadInput(
                f"{section.count} impacts, {len(times)} times, {len(impulses)} impulses: one time "
                "and one impulse for each impact is expected."
            )
        size = 0 if section.symmetric else len(section.hit)
        offsets = tuple(offsets) if size else ()
        for i, ((_, wall), impulse) in enumerate(zip(section.impacts, impulses, strict=True), 1):
            if on.lattice.sites is None and wall * impulse > 0.0:
                raise BadInput(
                    f"impact {i} has the impulse {impulse:.6g} at the wall {wall:+d}: a wall "
                    f"pushes away from itself, so the sign must be {-wall:+d}."
                )
        if size and on.lattice.sites is None:
            offsets = offsets or (0.0,) * size
        if offsets and len(offsets) != size:
            raise BadInput(
                f"{len(offsets)} offsets for {size} impacting sites {list(section.hit)}: one for "
                "each is expected."
            )
        return cls.closest(on, section, times, impulses, offsets)

    @classmethod
    def closest(cls, on: Conditions, section: Section, *given: Any) -> ByImpacts:
        """Fit what is not given of times, impulses, offsets, linear in all equations."""
        if on.lattice.sites is not None:
            check_possible(section, on)
        check_order(section, given[0])
        equations = equations_on(on, section)
        known = np.concatenate([np.asarray(values, dtype=float) for values in given])
        x = np.append(known, np.zeros(equations.size - known.size))
        if x.size > known.size:
            matrix = equations.jacobian(x, on.params)[:, known.size :]
            x[known.size :] += np.linalg.lstsq(matrix, -equations.residual(x, on.params))[0]
        return cls.of(on, section, x, on.params)

    # ------------------------------------------------------------------------ what it solves

    @cached_property
    def equations(self) -> OrbitEquations:
        """The equations it solves, as functions of all unknowns and parameters."""
        return equations_on(self.conditions, self.section, self.resonant)

    @cached_property
    def x(self) -> FloatArray:
        """The unknowns of `equations`."""
        times, impulses = zip(*((hit.time, hit.impulse) for hit in self.impacts), strict=True)
        return np.array([*times, *impulses, *self.offsets, *self.amplitudes], dtype=float)

    @cached_property
    def terms(self) -> Any:
        """Responses and forced motion at the impacts."""
        return self.equations.terms(self.x, self.conditions.params)

    @property
    def response(self) -> Any:
        return self.equations.response(self.conditions.params)

    @property
    def error(self) -> float:
        return float(np.abs(self.equations.residual(self.x, self.conditions.params)).max())

    @property
    def condition(self) -> float:
        """Condition number of Newton's matrix: large where the section's map closes on it."""
        return float(np.linalg.cond(self.equations.jacobian(self.x, self.conditions.params)))

    # ------------------------------------------------------------------------ motion

    @property
    def c(self) -> float:
        if self.section.symmetric:
            return 0.0
        sites = self.conditions.lattice.sites
        if sites is not None:
            shares = self.response.profile(np.arange(sites)).mean(axis=0)
            lifted = self.conditions.a * self.response.still()[0].mean()
            return float(shares @ self.offsets + lifted)
        if len(self.offsets) > 1:
            raise BadInput(f"this orbit has an offset for each of {len(self.offsets)} sites.")
        return self.offsets[0]

    @property
    def chi(self) -> float:
        """Place of the impact of one site, without its forced motion, per unit p; of the response
        to an impulse, as p may be 0."""
        response = equations_on(self.conditions, self.section, ()).response(self.conditions.params)
        try:
            h = response.interactions(np.zeros(1))[0, 0, 0]
        except Resonance:
            return math.inf
        return float(-2.0 * h)

    @property
    def family(self) -> str:
        """``"upper"`` before a fold, ``"lower"`` behind it, as of `ClosedForm`: a fold is where the
        determinant of the equations changes its sign, whether amplitudes of modes are among
        the unknowns, or not: these multiply it by sums of squares."""
        matrix = self.equations.jacobian(self.x, self.conditions.params)
        return "upper" if np.linalg.det(matrix) >= 0.0 else "lower"

    @cached_property
    def accelerations(self) -> FloatArray:
        return np.asarray(self.terms.f[2] + self.terms.h[2] @ self.terms.impulses)

    # ------------------------------------------------------------------------ perturbations

    @cached_property
    def map(self) -> OrbitMap | ModalMap:
        """The map of small perturbations over one section, of a finite lattice by its modes."""
        orbit = Orbit(self)
        return self.map_at(self.conditions, orbit.times, orbit.gains, orbit.speeds)

    @cached_property
    def _between(self) -> float:
        """Time where maps of a section begin: of neighbours as of its own, whose longest flight may
        be another one, or vectors of the one say nothing about the others."""
        times, T = Orbit(self).times, self.section.length
        return middle_of_longest(sorted((times[0] + (times - times[0]) % T).tolist()), T)

    def map_at(self, on: Conditions, times: FloatArray, *b_and_speeds: FloatArray) -> Any:
        """The map of other times and entries of its saltations, in units of speeds if given."""
        # all within one section from the first one on
        T = self.section.length
        columns = times[0] + (times - times[0]) % T, *b_and_speeds
        named = zip(self.equations.sites, *(x.tolist() for x in columns), strict=True)
        kicks = tuple(Saltation(*kick) for kick in named)
        if on.lattice.sites is None:
            in_order = tuple(sorted(kicks, key=lambda kick: kick.time))
            return OrbitMap(on.gamma, on.k, in_order, self.section.turns)
        held, sign = (on.gamma, on.spring, on.damping), self.section.sign
        return section_map(on.lattice, held, on.k, kicks, T, sign, start=self._between)

    def kick_slopes(self, names: tuple[str, ...]) -> dict[str, FloatArray]:
        """Derivatives of gains and speeds, one below the other, by names of unknowns and of
        parameters."""
        at, on, share = self.terms, self.conditions, self.equations.shares
        orbit, J, w = Orbit(self), at.impulses, self.accelerations
        c, damping, walls = 1.0 + on.k * share, orbit.at_impacts("damping"), orbit.sides
        i = np.arange(at.times.size)
        jerk = at.h[3].copy()
        jerk[i, i] = 0.0
        for n, other in _at_once(orbit):  # of coupled sites it jumps: the mean
            sides = np.outer((-2.0, 2.0), np.full(i.size, AT_ONCE))
            jerk[n, other] = self.response.at(self.equations.sites[n], sides)[3, :, other].mean()
        # of the accelerations, w = a f'' + sum of h'' J
        by_time = -jerk * J
        by_time[i, i] = at.f[3] + jerk @ J
        slopes = {f"t{j + 1}": column for j, column in enumerate(by_time.T)}
        slopes |= {f"J{j + 1}": column for j, column in enumerate(at.h[2].T)}
        if self.resonant:
            slopes["modes"] = self.response.swing(self.equations.sites, at.times)[2]
        for name in names:
            slopes[name] = self.equations.moved(at, {name: 1.0})[2]
        # towards the wall: speeds -J/(1 + k), gains (1 + k) w - damping J
        gains = {name: ((walls * c) * column.T).T for name, column in slopes.items()}
        speeds = {name: np.zeros_like(column) for name, column in gains.items()}
        for j, own in enumerate(np.eye(J.size)):
            gains[f"J{j + 1}"] -= walls * damping * own
            speeds[f"J{j + 1}"] -= walls / c * own
        if "k" in names:
            gains["k"] += walls * share * w
            speeds["k"] = walls * share * J / c**2
        if "damping" in names:
            gains["damping"] -= walls * on.lattice.dampings[list(self.equations.sites)] * J
        return {name: np.concatenate([gains[name], speeds[name]]) for name in gains}

    # --------------------------------------------------------------------- as a representation

    @staticmethod
    def suits(on: Conditions, section: Section) -> bool:
        plain = not (on.damping or on.spring) and on.walls == Walls() and section.sign > 0
        return on.lattice.sites is not None or plain

    def problem(self, threshold: float) -> Problem:
        orbit, on = Orbit(self), self.conditions
        plain = not (on.damping or on.spring or self.resonant) and on.walls == Walls()
        alike = on.lattice.sites is None or isinstance(on.lattice, Ring)
        arms = plain and alike and on.symmetric
        if arms and self.section.two_impacts and abs(orbit.asymmetry) > EQUAL:
            return asymmetric_problem(orbit, threshold)
        return impact_problem(orbit, threshold)

    def guess(self, threshold: float) -> Problem:
        return impact_problem(Orbit(self), threshold)

    def locus(
        self, of: OnCircle, point: Point, nu: float | None = None, **more: Any
    ) -> DefiningSystem:
        extra = {} if nu is None else {"nu": nu}
        return DefiningSystem(extra, of.conditions, partial(_circle_slopes, of), **more)

    def grazing_site(self, site: int) -> GrazingSite:
        """A site with its share of the offsets as it is where the curve sets out: on a boundary
        that runs into gamma = 0 it keeps to what holds for gamma > 0.

        The grazing of an arm ends at its pitchfork, on the side of the arm. There that of the other
        arm begins: the margin of the mirrored maximum vanishes together with the asymmetry, and
        their ratio does not. So that this end is known by one name, margins are those per
        asymmetry.
        """
        on = self.conditions
        followed = GrazingSite(site, self.response.profile(site))
        if self.section.symmetric:
            return followed
        arm = self.section.two_impacts and on.symmetric
        asymmetry = Orbit(self).asymmetry if arm else 0.0
        if abs(asymmetry) <= EQUAL:
            return replace(followed, meets={"PF": ()})
        side = math.copysign(1.0, asymmetry)
        pitchfork = codim_two("GR", pitchfork_of_arms())
        end = replace(pitchfork, test=partial(_towards, side), ends="domain")
        scale = partial(_while_asymmetric, side)
        return replace(followed, further=(end,), scale=scale, meets={"PF": ()})

    def speed_slope(self, j: int) -> Any:
        return partial(_speed_slope, j)

    def lifted(self) -> Problem:
        orbit = Orbit(self)
        longer = orbit.unfolded() if self.section.symmetric else orbit.doubled()
        return longer.problem

    def on(self, lattice: Any) -> None:
        """Its impacts are as good a guess as any."""


# --- as a problem to trace ------------------------------------------------------------------------


def impact_problem(orbit: Orbit, threshold: float = THRESHOLD) -> Problem:
    """The equations of an orbit with any impacts, with the orbit as their start.

    Columns: t1..tm, J1..Jm and, of a whole period, c (c1, c2, ... where several sites take
    impacts); ``modes``, an array, where amplitudes of modes are unknowns; a, gamma, k and the
    parameters of the forcing, on finite lattices damping and spring; ``unstable``, the number of
    multipliers outside; half the momenta, ``p``, that of the first impact, and on finite lattices
    ``p1, p2, ...`` of several, their mean offset ``c`` and the condition number ``condition``;
    ``asymmetry`` where half a symmetric orbit does or may do. Every branch point of the equations
    is BP, on a branch of symmetric breathers their pitchfork, too; from an arm it is PF.
    """
    motion, on, section = orbit.representation, orbit.conditions, orbit.section
    if motion.resonant != resonant_modes(on.lattice, section, on.gamma, on.spring):
        motion = ByImpacts.closest(on, section, orbit.times, orbit.impulses)
    equations, endless = motion.equations, on.lattice.sites is None
    params = {"a": on.a, "gamma": on.gamma, "k": on.k, **on.forcing.params}
    return OrbitProblem.of(
        "orbit with impacts",
        partial(ByImpacts.of, on, section),
        orbit,
        threshold,
        equations,
        start=equations.named(motion.x),
        params=params if endless else on.params,
        events=(
            fold() if section.local else FOLD_OF_ALIKE,
            from_arms(branch_point()),
            *events_of(section, on, threshold),
        ),
        record=_columns(on, section, threshold),
        domain=_domain(equations, on),
        label="orbit with impacts"
        + ("" if endless else f", {on.lattice.describe()}, {section.describe()}"),
    )


def _columns(on: Conditions, section: Section, threshold: float) -> dict[str, Any]:
    """Columns recorded besides the unknowns."""
    columns: dict[str, Any] = {"p": partial(momentum, 0)}
    endless = on.lattice.sites is None
    if section.count > 1 and not endless:
        columns |= {f"p{j + 1}": partial(momentum, j) for j in range(section.count)}
    if not (section.symmetric or section.local or endless):
        columns |= {} if "c" in on.forcing.params else {"c": attrgetter("solution.c")}
    if section.mirrored:
        columns["asymmetry"] = attrgetter("solution.asymmetry")
    columns["unstable"] = unstable_by(threshold)
    if not endless:
        columns["condition"] = attrgetter("solution.representation.condition")
    if section.symmetric:
        times = [f"t{j + 1}" for j in range(section.count)]
        columns |= of_whole_period(section, times, on.params)
    return columns


def _domain(equations: OrbitEquations, on: Conditions) -> dict[str, tuple[float, float]]:
    """Domain: parameters mean something."""
    if on.lattice.sites is not None:
        bounds = {n: (NUMBERS[n].low, NUMBERS[n].high) for n in NAMES if n in on.params}
        highest = {"gamma": on.lattice.highest_gamma, "k": highest_k(on.lattice)}
        return bounds | {name: (0.0, most) for name, most in highest.items()}
    domain = {name: NUMBERS[name].domain for name in NEEDED}
    # the harmonic 1/n above the band, 2 sqrt(gamma) < 1/n: a chain without end would radiate it
    domain["gamma"] = (0.0, domain["gamma"][1] / equations.section.turns**2)
    return domain


read_by("asymmetric breather", ByImpacts.arm, asymmetric_problem)
read_by("orbit with impacts", ByImpacts.of, impact_problem)


# --- a site that grazes, an impact that vanishes ------------------------------------------------


def _towards(side: float, point: Point) -> float:
    return side * point.solution.asymmetry


def _while_asymmetric(side: float, point: Point) -> float:
    asymmetry = _towards(side, point)
    # closer to the pitchfork a margin per asymmetry is rounding over rounding
    return asymmetry if asymmetry > EQUAL else math.nan


@chained
def _speed_slope(j: int, curve: Curve, z: FloatArray, extra: FloatArray) -> FloatArray:
    orbit = Point(curve, z).solution
    share = float(orbit.representation.equations.shares[j])
    row, c = np.zeros((1, z.size + extra.size)), 1.0 + orbit.k * share  # u' = -J/(1 + k)
    row[0, curve.slots[f"J{j + 1}"]] = -1.0 / c
    if "k" in curve.free:
        row[0, curve.slots["k"]] = share * orbit.impulses[j] / c**2
    return row


# --- a multiplier on a circle ---------------------------------------------------------------------

STEP = 1e-4  # of times, gains and speeds of the order of one, and of parameters
OF_MAPS = "gamma", "k", "damping", "spring"


@chained
def _circle_slopes(of: OnCircle, curve: Curve, z: FloatArray, extra: FloatArray) -> FloatArray:
    """Along a curve, through times, gains and speeds of impacts, which are all that a map knows of
    an orbit. In gains and speeds the condition is linear, each by itself; in times, and in
    parameters of the map, slopes are differences next to a place.

    To one side where a parameter is at the end of its domain: curves set out from gamma = 0. Times
    of impacts stay in their order: where sites that are coupled change it there is a kink. Of
    impacts at once it is the mean of both sides.
    """
    orbit = Point(curve, z).solution
    flight, on, m = orbit.representation, orbit.conditions, orbit.times.size
    names = [name for name in curve.free if name in OF_MAPS]
    end = m + len(names)
    value, step = orbit.map.beside(of.angle(extra), of.radius), STEP
    if extra.size and orbit.lattice.sites is None:  # keep off the edge of the band, a root
        map = orbit.map
        steepness = 4.0 * map.periods**2 / map.edge  # of the edge, as nu, in gamma
        room = 0.02 * abs(2.0 * map.edge - float(extra[0])) / (1.0 + steepness)
        step = min(STEP, max(room, 1e-8))

    kicks = np.concatenate([orbit.gains, orbit.speeds])

    def near(y: FloatArray, kicks: FloatArray = kicks) -> FloatArray:
        params = dict(zip(names, y[m:end].tolist(), strict=True))
        map = flight.map_at(on.at(params), y[:m], kicks[:m], kicks[m:])
        return of.real_parts(value(map, of.angle(y[end:])))

    here = np.concatenate([orbit.times, [getattr(on, name) for name in names], extra])
    scales = np.ones(here.size)
    scales[m:end] = [curve.scales[curve.slots[name]] for name in names]
    finer = np.full(here.size, RELATIVE / step)  # what `differences` divides its own step by
    finer[:m] = RELATIVE / min(step, _in_order(orbit))
    by = differences(
        near, here, scales=scales, finer=finer, one_sided=True, kinks=_at_once(orbit)[:, 0]
    )
    by_kicks = np.stack([near(here, kicks + unit) for unit in np.eye(2 * m)], axis=1)
    by_kicks -= near(here)[:, None]
    unknowns = (*curve.problem.start, *curve.free)
    moved = in_unknowns(orbit, flight.kick_slopes(curve.free), unknowns)
    out = np.hstack([by_kicks @ moved, by[:, end:]])
    slots = [curve.slots[name] for name in (*(f"t{j + 1}" for j in range(m)), *names)]
    out[:, slots] += by[:, :end]
    return out


def _at_once(orbit: Orbit) -> NDArray[np.intp]:
    """Pairs of impacts at the same time, by index."""
    late = abs(orbit.times[:, None] - orbit.times) < AT_ONCE
    return np.argwhere(late & ~np.eye(orbit.times.size, dtype=bool))


def _in_order(orbit: Orbit) -> float:
    """A relative step of times that keeps impacts in their order, but for those at once."""
    times = np.sort(orbit.times)
    # two steps, which is as far as five points go, are then half the shortest gap at most
    gaps = np.diff(times, append=times[0] + orbit.section.length)
    return float(gaps[gaps > AT_ONCE].min() / (4.0 * max(1.0, abs(times).max())))


# --- one site that impacts, in closed form --------------------------------------------------------

# A unit impulse that recurs with alternating sign leaves its site at h(0), with a velocity that has
# the mean h' of both sides. So with J = -2p the closure (11) is what it is on the chain, f being
# the forced motion of that site: p chi = 1 - a f(phi), p (q + 2 h') = a f'(phi), chi = -2 h(0).


def symmetric_orbits(site: int, on: Conditions) -> tuple[Orbit, ...]:
    """Symmetric orbits of one impacting site of a finite lattice, by descending p: `BadInput` in
    resonance, a mode with an odd whole number for its frequency, without damping.
    """
    section = Section(((site, 1),), sign=-1).placed(on.lattice)
    (site, _) = section.impacts[0]
    check_possible(section, on)
    width, chi, loss, forced = _closure(section, on)
    moved = forced is not None
    roots = [] if forced is None else general_roots(on.a / width, chi, loss, forced)
    if not roots:
        weak = "is too weak to bring it to its walls; take a larger a."
        raise NoSolution(
            f"no symmetric orbit of site {site} on the {on.lattice.describe()} at a = {on.a!r} "
            f"(gamma = {on.gamma}, k = {on.k}, damping = {on.damping}, spring = {on.spring}): the "
            f"forcing {weak if moved else 'does not move it.'}"
        )
    return tuple(
        Orbit(ByImpacts.closest(on, section, [phi], [-2.0 * p]))
        for p, phi in sorted(((width * p, phi) for p, phi in roots), reverse=True)
    )


def symmetric_folds(breather: Orbit) -> list[float]:
    """Amplitudes of all folds of symmetric orbits like this one, as `folds` on the chain."""
    width, chi, loss, forced = _closure(breather.section, breather.conditions)
    return [] if forced is None else [width * a for a in fold_amplitudes(forced, chi, loss)]


def _closure(section: Section, on: Conditions) -> tuple[float, float, float, Fourier | None]:
    """The wall, which everything scales with, chi and q + 2 h', and f, None where it is 0."""
    (site, _) = section.impacts[0]
    response = equations_on(on, section, ()).response(on.params)
    h, slope, *_ = response.interactions(np.zeros(1))[:, 0, 0].tolist()
    series = response.harmonics(site)
    cos, sin = {m: A for m, A, _ in series}, {m: B for m, _, B in series}
    loss = restitution_ratio(float(on.at_sites("k", site))) + 2.0 * slope
    forced = Fourier.from_response(cos, sin) if any((*cos.values(), *sin.values())) else None
    return on.walls.position(site, 1), -2.0 * h, loss, forced
