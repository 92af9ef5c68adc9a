"""Orbits of finite lattices by exact modes: the equations of shooting from impact to impact.

Unknown are the times of all impacts of a section and the state of the lattice just before the
first one. The equations: each impact finds its site on its wall, and the section closes. The state
includes the mean of a ring, which nothing pins between impacts: where the ring comes to sit is part
of the answer, and no mode needs a treatment of its own.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contbreather.continuation.curve import Curve
from contbreather.continuation.derivatives import RELATIVE, directional
from contbreather.continuation.equilibria import fold
from contbreather.continuation.point import DefiningSystem, Point
from contbreather.continuation.problem import Problem
from contbreather.errors import BadInput, NoSolution
from contbreather.lattice.chain import Ring
from contbreather.lattice.conditions import Conditions, restitution_ratio
from contbreather.lattice.forcing import Forcing, Fourier
from contbreather.lattice.modal_flow import propagator
from contbreather.orbits.closure import general_roots
from contbreather.orbits.grazing import GrazingSite
from contbreather.orbits.orbit import Orbit
from contbreather.orbits.orbit_events import branching, events_of
from contbreather.orbits.orbit_problem import (
    Equations,
    OnCircle,
    OrbitProblem,
    by_differences,
    momentum,
    of_whole_period,
    read_by,
    unstable_by,
)
from contbreather.orbits.representation import Impacts, Offsets
from contbreather.orbits.section import WEAK, Section, check_order, check_possible, check_walls
from contbreather.orbits.shooting_equations import SectionTrajectory
from contbreather.orbits.site_motion import ModalMotion
from contbreather.parameters import NUMBERS

FloatArray = NDArray[np.float64]
Params = Mapping[str, float]

STATE_STEP = 1e-3  # of velocities and accelerations at impacts, relative
SLOW = 0.1  # velocity before an impact below which a saltation changes within such a step


@dataclass(frozen=True, eq=False)
class ExactModes(SectionTrajectory):
    """Any impacts on any finite lattice, with losses, springs, masses and walls of its own."""

    @property
    def equations(self) -> ShootingEquations:
        """The equations it solves, as functions of all unknowns and parameters."""
        return ShootingEquations(self.section, self.conditions)

    @staticmethod
    def suits(on: Conditions, section: Section) -> bool:
        return on.lattice.sites is not None

    @classmethod
    def through(
        cls, on: Conditions, section: Section, times: Any, impulses: Any, offsets: Offsets
    ) -> ExactModes:
        check_possible(section, on)
        return cls.from_times(on, section, times)

    @classmethod
    def of(cls, on: Conditions, section: Section, x: FloatArray, params: Params) -> ExactModes:
        """Make the section flown from these unknowns."""
        m = section.count
        q, r = np.split(x[m:], 2)  # x = (t_1 .. t_m, q, r)
        return cls(section, x[:m], q, r, on.at(params))

    @classmethod
    def from_times(cls, on: Conditions, section: Section, times: Any) -> ExactModes:
        """Fit the state that comes closest to all equations, which are linear in it."""
        check_order(section, times)
        still = np.zeros(on.lattice.basis(section.hit).lam.size)
        rest = cls(section, np.array(times, dtype=float), still, still, on)
        matrix = rest.jacobian()[:, section.count :]  # at rest: linear in the state
        # m walls and 2K conditions that the section closes, for 2K amplitudes of K modes
        state: FloatArray = np.linalg.lstsq(matrix, -rest.residual())[0].astype(float)
        return replace(rest, q=state[: still.size], r=state[still.size :])

    @property
    def family(self) -> str:
        """``"upper"`` before a fold of the closure, ``"lower"`` behind it, as of
        `ClosedForm`.

        Examples
        --------
        >>> from contbreather.lattice import Ring
        >>> on = Conditions(0.5, 0.12, 0.4, damping=0.01, lattice=Ring(6))
        >>> [orbit.representation.family for orbit in symmetric_orbits(0, on)]
        ['upper', 'lower']
        """
        *_, chi, loss, forced = _closure(self.section, self.conditions)
        assert forced is not None
        turn = chi * forced.d2f(self.t[0]) + loss * forced.df(self.t[0])
        return "upper" if turn >= 0.0 else "lower"  # the determinant of the closure, over -a

    def rewritten(self, section: Section, impacts: Impacts, offsets: Offsets) -> ExactModes:
        return replace(self, section=section, t=np.array([impact.time for impact in impacts]))

    def locus(
        self, of: OnCircle, point: Point, nu: float | None = None, **more: Any
    ) -> DefiningSystem:
        return of.locus(_by_impacts, nu, **more)

    def grazing_site(self, site: int) -> GrazingSite:
        return GrazingSite(site, partial(_slopes_at, site))

    def speed_slope(self, j: int) -> Any:
        return partial(_speed_slope, j)

    def lifted(self) -> Problem:
        orbit = Orbit(self)
        longer = orbit.unfolded() if self.section.symmetric else orbit.doubled()
        # at gamma = 0 half a period holds the idle sites, by u -> -u, and a whole one does not
        check_possible(longer.section, self.conditions)
        return longer.problem

    def problem(self, threshold: float) -> Problem:
        """The shooting equations with this orbit as their start, and all its events.

        Columns: ``t1, t2, ...`` and the arrays ``q, r`` of unknowns; a, gamma, k, damping, spring
        and the parameters of the forcing; half the momenta, ``p``, that of the first impact, and
        ``p1, p2, ...`` of several; the offset ``c``; where half a symmetric orbit does or may do,
        the ``asymmetry``, and of half an orbit the times of the other half; ``unstable``, the
        number of multipliers beyond the threshold over the whole period, and the condition number
        ``condition``: computed when asked for.
        """
        section, on = self.section, self.conditions
        times = {f"t{j + 1}": float(time) for j, time in enumerate(self.t)}
        # below it idle sites rest anywhere, and the equations are singular; of an orbit that comes
        # back with the opposite sign they rest at 0
        loose = on.spring < WEAK and on.lattice.sites > 1 and not section.symmetric
        bounds = {name: (number.low, number.high) for name, number in NUMBERS.items()}
        return _Shooting.of(
            "shooting",
            self.equations.flight,
            Orbit(self),
            threshold,
            residual=self.equations.residual,
            start={**times, "q": self.q, "r": self.r},
            params=on.params,
            events=(fold(), branching(), *events_of(section, on.lattice, threshold)),
            record=_columns(section, threshold, on.params),
            domain={**bounds, "gamma": (WEAK if loose else 0.0, on.lattice.highest_gamma)},
            label=f"shooting, {on.lattice.describe()}, {section.describe()}",
            equations=self.equations,
        )

    def guess(self) -> Problem:
        return Orbit(self).problem

    @property
    def motion(self) -> ModalMotion:
        return ModalMotion(self)

    def on(self, lattice: Any) -> Orbit | None:
        """From ring to ring the sites around the one that impacts keep their motion, new ones move
        like the farthest."""
        rings = isinstance(lattice, Ring) and isinstance(self.conditions.lattice, Ring)
        if not (rings and self.section.local):
            return None
        return Orbit(self.resized(lattice)).solved()

    def resized(self, ring: Ring) -> ExactModes:
        section, apart = self.section.around(ring.sites), np.arange(ring.sites)
        apart = np.minimum(apart, ring.sites - apart)
        # nothing on the old ring is farther off than half of it
        nearest = np.minimum(apart, self.conditions.lattice.sites // 2)
        rows: list[FloatArray] = []
        for modes in (self.q, self.r):
            profile = np.roll(self.basis.to_sites(modes), -self.section.hit[0])[nearest]
            rows.append(ring.basis(section.hit).from_sites(np.roll(profile, section.hit[0])))
        q, r = rows
        return ExactModes(section, self.t, q, r, replace(self.conditions, lattice=ring))


@dataclass(frozen=True, eq=False)
class ShootingEquations:
    """The equations of one section, as functions of all that can change.

    ``x = (t1 .. tm, q, r)``; `params` names those of the `Conditions`. Steps, tests and locations
    ask for those of one place on curves of their own.
    """

    section: Section
    conditions: Conditions

    def flight(self, x: FloatArray, params: Params) -> ExactModes:
        """The section flown from these unknowns."""
        return _flown(self, np.asarray(x, dtype=float).tobytes(), tuple(params.items()))

    def residual(self, x: FloatArray, params: Params) -> FloatArray:
        return _left(self.flight(x, params))

    def derivatives(self, x: FloatArray, params: Params, names: tuple[str, ...]) -> FloatArray:
        return _derived(self.flight(x, params), names)


@lru_cache(maxsize=64)
def _flown(
    of: ShootingEquations, unknowns: bytes, params: tuple[tuple[str, float], ...]
) -> ExactModes:
    # kept by the unknowns' bits: Newton's method, tests and events ask at the same place
    return ExactModes.of(of.conditions, of.section, np.frombuffer(unknowns), dict(params))


@lru_cache(maxsize=64)
def _left(flight: ExactModes) -> FloatArray:
    residual = flight.residual()
    # it is handed out again: nobody may write into it
    residual.flags.writeable = False
    return residual


@lru_cache(maxsize=8)  # they are large
def _derived(flight: ExactModes, names: tuple[str, ...]) -> FloatArray:
    jacobian = flight.jacobian(names)
    jacobian.flags.writeable = False
    return jacobian


@read_by("shooting", ExactModes.of)
def _read(orbit: Orbit, threshold: float) -> Problem:
    problem: Problem = orbit.representation.problem(threshold)
    return problem


@dataclass(frozen=True, eq=False, repr=False)
class _Shooting(OrbitProblem):
    equations: Any = field(kw_only=True)
    tested = True

    def derivatives(self, x: FloatArray, params: Params, names: tuple[str, ...]) -> FloatArray:
        return self.equations.derivatives(x, params, names)


def _columns(section: Section, threshold: float, params: Params) -> dict[str, Any]:
    """Columns recorded besides the unknowns."""
    count = section.count
    names = {"p": 0}
    if count > 1:
        names |= {f"p{j + 1}": j for j in range(count)}
    columns: dict[str, Any] = {name: partial(momentum, j) for name, j in names.items()}
    if not section.symmetric:
        columns["c"] = attrgetter("solution.c")
    if section.mirrored:
        columns["asymmetry"] = attrgetter("solution.asymmetry")
    columns["unstable"] = unstable_by(threshold)
    columns["condition"] = attrgetter("solution.representation.condition")
    if section.symmetric:
        columns |= of_whole_period(section, [f"t{j + 1}" for j in range(count)], params)
    return columns


def _slopes_at(site: int, curve: Curve, orbit: Orbit, t: float) -> FloatArray:
    slopes = orbit.representation.slopes_at(site, t, curve.free)
    return np.column_stack([slopes, orbit.motion.at(site, t)[1:]])


def _speed_slope(j: int, curve: Curve, z: FloatArray, extra: FloatArray) -> FloatArray:
    flight = Point(curve, z).solution.representation
    return flight.tangents(curve.free).speeds[j : j + 1]


def _by_impacts(
    conditions: Equations, curve: Curve, z: FloatArray, extra: FloatArray
) -> FloatArray:
    """By differences, of exact modes: one perturbation flown once is cheap, and smooth.

    Of the state the map knows velocities and accelerations at the impacts, and these are linear in
    it: one direction for each of them tells what all modes do.
    """
    flight = Point(curve, z).solution.representation
    m, size = flight.t.size, 2 * flight.q.size

    def near(z: FloatArray) -> FloatArray:
        return conditions(curve, z, extra)

    others = [*range(m), *range(m + size, z.size + extra.size)]
    slow = min(abs(impact.velocity) for impact in flight.arrivals)
    step = RELATIVE * min(1.0, slow / SLOW)
    columns = by_differences(conditions, curve, z, extra, others, step)
    rows = np.zeros((len(columns), z.size + extra.size))
    rows[:, others] = columns
    # what the map knows is y = S x, so dF/dx = (dF/dy) S; along a column of pinv(S) one entry of y
    # changes alone
    values = [(abs(impact.velocity), abs(impact.acceleration)) for impact in flight.arrivals]
    sizes = [max(pair[: 1 + i]) for pair in values for i in range(2)]
    for shown, moved, large in zip(
        flight.impact_slopes, np.linalg.pinv(flight.impact_slopes).T, sizes, strict=True
    ):
        along = np.zeros(z.size)
        along[m : m + size] = STATE_STEP * large * moved
        rows[:, m : m + size] += np.multiply.outer(
            directional(near, z, along), shown / (STATE_STEP * large)
        )
    return rows


# --- one site that impacts, in closed form --------------------------------------------------------

# Impulses -2p, +2p half a period apart make each mode answer with a state that recurs with the
# opposite sign, (1 + M) x = -M (0, kick), M its flight over half a period. Its sum over the modes
# at the impacting site gives chi and, with damping, the excess delta of the velocity before the
# impact, and the closure (11) is what it is on the chain, f being the forced motion of that site:
#     p chi = 1 - a f(phi),  p (q + 2 delta) = a f'(phi).

RESONANT = 1e-12  # 2 + trace of a mode that is its own mirror image after half a period


class Resonance(BadInput):
    """A mode of the lattice follows the impacts without bound."""


def symmetric_orbits(site: int, on: Conditions) -> tuple[Orbit, ...]:
    """All symmetric orbits of one impacting site, by descending p.

    Raises
    ------
    BadInput
        In resonance: a mode whose frequency is an odd whole number, without damping.
    NoSolution
        If the forcing is too weak for any.

    Examples
    --------
    >>> from contbreather.lattice import Ring
    >>> orbit = symmetric_orbits(0, Conditions(0.5, 0.12, 0.4, lattice=Ring(20)))[0]
    >>> round(orbit.p, 9), round(orbit.phi, 9)
    (0.680056002, -2.519293143)
    """
    section = Section(((site, 1),), sign=-1).placed(on.lattice)
    (site, _) = section.impacts[0]
    check_walls(section, on)
    width = on.walls.position(site, 1)  # everything scales with it
    q, r, chi, loss, forced = _closure(section, on)
    roots = [] if forced is None else general_roots(on.a / width, chi, loss, forced)
    if not roots:
        weak = "is too weak to bring it to its walls; take a larger a."
        raise NoSolution(
            f"no symmetric orbit of site {site} on the {on.lattice.describe()} at a = {on.a!r} "
            f"(gamma = {on.gamma}, k = {on.k}, damping = {on.damping}, spring = {on.spring}): the "
            f"forcing {'does not move it.' if forced is None else weak}"
        )
    # J = -2p times the state of a unit impulse
    return tuple(
        Orbit(ExactModes(section, np.array([phi]), -2.0 * p * q, -2.0 * p * r, on))
        for p, phi in sorted(((width * p, phi) for p, phi in roots), reverse=True)
    )


def _closure(
    section: Section, on: Conditions
) -> tuple[FloatArray, FloatArray, float, float, Forcing | None]:
    """State of each mode before a unit impulse, chi, q + 2 delta and f of the closure; no f where
    nothing moves the site."""
    still = np.zeros(on.lattice.basis(section.hit).lam.size)
    rest = ExactModes(section, np.zeros(1), still, still, on)  # in its forced motion alone
    (q, r), e, (site, _) = _answer(rest), rest.shapes[0], section.impacts[0]
    # per unit p, J = -2p; without damping r is -1/2 before and 1/2 after a unit impulse
    chi, excess = -2.0 * float(e.dot(q)), float(e.dot(r)) + 0.5
    series = rest.forced.harmonics(site)
    moved = any(A or B for _, A, B in series)
    cos, sin = {m: A for m, A, _ in series}, {m: B for m, _, B in series}
    forced = Fourier.from_response(cos, sin) if moved else None
    return q, r, chi, restitution_ratio(on.k) + 2.0 * excess, forced


def _answer(rest: SectionTrajectory) -> tuple[FloatArray, FloatArray]:
    """State of each mode just before a unit impulse that recurs with alternating sign."""
    fly = propagator(rest.z, rest.section.length, rest.conditions.damping)
    kick = rest.kicks[0]
    # (1 + M) x = -M (0, kick), by Cramer; det(1 + M) = 1 + trace + det
    after = fly.reach * kick, fly.swing * kick
    det = (1.0 + fly.cosine) * (1.0 + fly.swing) + fly.reach * fly.pull
    if (abs(det) < RESONANT).any():
        w = float(np.sqrt(rest.z[abs(det).argmin()]))
        raise Resonance(
            f"a mode of the {rest.conditions.lattice.describe()} with the frequency {w:.9g} is in "
            "resonance with the orbit: change gamma or spring, or give it damping."
        )
    q = -((1.0 + fly.swing) * after[0] - fly.reach * after[1]) / det
    r = -(fly.pull * after[0] + (1.0 + fly.cosine) * after[1]) / det
    return q, r
