"""Arms that leave an orbit at a pitchfork or a doubling, where its symmetry or its period breaks.

At its pitchfork a symmetric orbit is a singular point of the problem of its whole period, at its
period doubling any orbit is one of the problem of twice the period: one section and the next as
one. The null vector there tells where the new orbits are: along it the parameter does not change
at first.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from contbreather.checks import check_kind
from contbreather.continuation.algebra.derivatives import directional
from contbreather.continuation.branches.switching import Seed, SwitchingProblem, leaving
from contbreather.continuation.curve.curve import Curve
from contbreather.continuation.curve.point import Point
from contbreather.continuation.curve.problem import Problem
from contbreather.errors import BadInput, NotConverged
from contbreather.orbits.orbit import Orbit, in_order, orbit_at
from contbreather.orbits.section import AT_ONCE, Impact

FloatArray = NDArray[np.float64]

SINGULAR = 1e-6  # how far off the equations of the longer orbit may be


@dataclass(frozen=True)
class OrbitSwitching(SwitchingProblem):
    """An orbit at a pitchfork or a period doubling, as a problem that knows the orbits that
    branch off there: of the whole, or of the doubled, period. Along `direction` the first impact
    comes earlier; its negative leads to their mirror images, or to the same orbits a period later.
    """

    # the tangent of the branch there, where on the arms neighbours that hit their walls at once do
    # so in one order or the other: then they leave with a kink
    along: FloatArray | None = None

    def seeds(self) -> tuple[Seed, ...]:
        """Starts of the arms, each in its own order of impacts."""
        seeds, along = super().seeds(), self.along
        if along is None:
            return seeds
        curve = Curve(self.problem, (self.free,))
        return tuple(
            seed._replace(tangent=leaving(curve, seed.z, seed.tangent, along)) for seed in seeds
        )

    def arm(self, amplitude: float = 0.01, free: str | None = None) -> Problem:
        """As there, for amplitudes at which the solution is a sequence of impacts."""
        problem = super().arm(amplitude, free)
        try:
            in_order(orbit_at(problem))
        except BadInput as error:
            raise NotConverged(f"no orbit at the amplitude {amplitude:g}: {error}") from error
        return problem


def lift(point: Point) -> OrbitSwitching:
    """The orbit of a pitchfork or a period doubling with one section and the next as one.

    Parameters
    ----------
    point : Point
        A located PF or PD on a branch of orbits, ``branch.first("PF")``.

    Raises
    ------
    BadInput
        If it is none, or if orbits of twice the period radiate: on the infinite chain from
        gamma = 1/(16 n^2) on.
    NotConverged
        If the equations of the longer orbit are regular there.

    Examples
    --------
    >>> import contbreather as cb
    >>> branch = cb.trace(cb.symmetric(0.7, 0.04, 0.8), "a", towards="up", within={"a": (0, 0.8)})
    >>> arm = orbit_at(lift(branch.first("PF")).arm(0.02))
    >>> round(arm.asymmetry, 3)
    0.028
    """
    orbit, free = _orbit_at(point), point.curve.free[-1]
    problem = _lifted(orbit).having(free)
    times = [name for name in problem.start if name[0] == "t" and name[1:].isdigit()]
    switching = OrbitSwitching(problem, free, times, both=point.kind == "PF")
    curve, (tangent, _) = Curve(problem, (free,)), switching.tangents
    # at a branch point the longer orbit solves its equations, and its null vector leaves the
    # parameter as it is
    off = max(float(abs(curve.equations(curve.start)).max()), abs(float(tangent[-1])))
    if off > SINGULAR:
        raise NotConverged(
            f"{point!r} is not a {point.kind}: there the equations of the longer orbit do not "
            f"hold, or are regular, by {off:.2g}",
            residual=off,
        )
    if not changes_order(orbit_at(problem), switching.direction):
        return switching
    return replace(switching, along=tangent_in(curve, point, _lifted))


def _lifted(orbit: Orbit) -> Problem:
    return orbit.driven(orbit.representation.lifted())


# --- impacts of neighbours at once ----------------------------------------------------------------

# What the first one does to the velocity of the second grows like the square of the time between
# them: second derivatives of the equations are others where their order is.


def changes_order(orbit: Orbit, v: FloatArray) -> bool:
    """Test whether impacts at once, of neighbours, come apart along a direction."""
    if orbit.gamma == 0.0:
        return False
    sites = np.array([impact.site for impact in orbit.impacts])
    first, second = np.triu_indices(sites.size, 1)
    late = orbit.times[second] - orbit.times[first]
    late -= orbit.period * np.round(late / orbit.period)
    apart = abs(v[second] - v[first]) > SINGULAR * abs(v[: sites.size]).max()
    pairs = np.flatnonzero((abs(late) < AT_ONCE) & apart)
    return any(sites[second[i]] in orbit.lattice.beside(int(sites[first[i]])) for i in pairs)


def tangent_in(curve: Curve, point: Point, longer: Callable[[Orbit], Problem]) -> FloatArray:
    """The tangent of the branch of a point in a longer problem, whose solutions it is among."""

    hits = 2 * orbit_at(curve.problem).section.count  # times and impulses

    def place(z: FloatArray) -> FloatArray:
        there = longer(Point(point.curve, z).solution)
        return np.append(Curve(there, ()).start[:hits], z[-1])

    step = 1e-3 / np.linalg.norm(point.direction)  # of a difference of places on it
    known = directional(place, point.z, step * point.direction) / step
    # the rest follows by linear equations; amplitudes of modes are not unknowns everywhere near by
    matrix = curve.jacobian(curve.start)
    pull = matrix[:, :hits] @ known[:-1] + matrix[:, -1] * known[-1]
    rest = np.linalg.lstsq(matrix[:, hits:-1], -pull)[0]
    return np.concatenate([known[:-1], rest, known[-1:]])


def _orbit_at(point: Point) -> Orbit:
    """The orbit of a point that others of a longer section leave."""
    check_kind(point, Point, "a point of a branch")
    if point.kind not in ("PF", "PD"):
        raise BadInput(
            f"{point!r} is {'a ' + point.kind if point.kind else 'not a special point'}: a "
            "located PF or PD of a branch of orbits was expected, see branch.special."
        )
    if not point.located:
        raise BadInput(f"{point!r} was seen but not located: nothing can start there.")
    orbit = point.solution
    if not isinstance(orbit, Orbit):
        raise BadInput(f"{point!r} is on no branch of orbits with impacts.")
    if orbit.symmetric != (point.kind == "PF"):
        raise BadInput(
            f"{point!r}: with half a section a symmetric orbit has pitchforks, and must break its "
            "symmetry first to double its period; other orbits have period doublings."
        )
    return orbit


# --- impacts that catch up with those of the next section -----------------------------------------


@dataclass(frozen=True)
class Relisted(SwitchingProblem):
    """An orbit at CC by the same impacts, the last one a section before; `along` it goes on."""

    along: FloatArray = field(kw_only=True)

    def seeds(self) -> tuple[Seed, ...]:
        return (Seed(self.problem, Curve(self.problem, (self.free,)).start, self.along),)


def relisted(point: Point) -> Relisted:
    """List the impacts of an orbit at CC with those a section before which come at once with the
    first of the next one, two of them where both neighbours do: beyond, these are in order."""
    threshold, free = point.curve.problem.threshold, point.curve.free[-1]
    since_first = point.solution.times - point.solution.times.min()
    late = np.flatnonzero(since_first >= point.solution.section.length - AT_ONCE)

    def from_the_last(orbit: Orbit) -> Problem:
        section, impacts = orbit.section, [*orbit.impacts]
        for j in late:
            site, wall, t, J = impacts.pop(j)
            before = t - section.length, section.sign * J
            # those of a site are in order, and where it may p stays that of the same impact
            own_first = impacts[0].site == site
            impacts.insert(not own_first, Impact(site, section.sign * wall, *before))
        section = replace(section, impacts=tuple(impact[:2] for impact in impacts))
        _, _, times, impulses = zip(*impacts, strict=True)
        on, motion = orbit.representation.conditions, type(orbit.representation)
        listed = motion.through(on, section, times, impulses, orbit.offsets)
        return replace(orbit, representation=listed).problem_beyond(threshold)

    problem = from_the_last(point.solution).having(free)
    along = tangent_in(Curve(problem, (free,)), point, from_the_last)
    return Relisted(problem, free, along=along)
