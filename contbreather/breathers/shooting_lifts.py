"""The same orbit where its symmetry or its period can break: what leaves a pitchfork or a doubling.

At its pitchfork a symmetric orbit is a branch point of the problem of the whole period, at its
period doubling any orbit is one of the problem of twice the period. There two Jacobians' null
vectors tell where the new orbits are: along them the parameter does not change at first.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from contbreather.breathers.flight_map import Section
from contbreather.breathers.ring_orbit import RingOrbit
from contbreather.breathers.shooting import check_coupling, opened, problem_of, shot_orbit
from contbreather.breathers.shooting_seeds import checked
from contbreather.continuation import Point, Problem
from contbreather.continuation.newton import Undefined, newton
from contbreather.continuation.problem import Curve
from contbreather.continuation.seed import Seed
from contbreather.errors import BadInput, NotConverged

FloatArray = NDArray[np.float64]

SINGULAR = 1e-6  # smallest singular value of the lifted equations, relative to the largest


@dataclass(frozen=True)
class Lift:
    """An orbit at a pitchfork or a period doubling, as a problem that knows the orbits that
    branch off there.

    Attributes
    ----------
    problem : Problem
        Of the whole, or of the doubled, period; its start is the orbit at the bifurcation, for
        this problem a branch point.
    direction : ndarray
        Unit null vector of its Jacobian: the unknowns in which the new orbits branch off. Its
        negative leads to their mirror images, or to the same orbits half a period later.
    parent : ndarray
        Direction of the branch the bifurcation was met on, in the unknowns of `problem` and the
        free parameter.
    free : str
        That parameter.
    """

    problem: Problem
    direction: FloatArray
    parent: FloatArray
    free: str

    def seed(self, side: float = 1.0) -> Seed:
        """Where `switch` sets out, to one side or the other."""
        z = Curve(self.problem, (self.free,)).start
        return Seed(self.problem, z, side * np.append(self.direction, 0.0), self.parent)

    def arm(self, amplitude: float = 0.01, free: str | None = None) -> Problem:
        """The problem started on the new branch, at a distance from the bifurcation.

        Parameters
        ----------
        amplitude : float
            How far to go along `direction`; its sign chooses the arm.
        free : str, optional
            The parameter that gives way, `free` of the lift unless given.

        Raises
        ------
        NotConverged
            If there is no orbit at this amplitude: try another one.
        """
        curve = Curve(self.problem, (free or self.free,))
        row = np.append(self.direction, 0.0)
        guess = curve.start + amplitude * row
        try:
            found = newton(
                curve.equations, curve.jacobian, guess, row=row, tolerance=1e-11, most=20
            )
        except Undefined as error:
            raise NotConverged(
                f"no orbit at the amplitude {amplitude:g} ({self.problem.label}): {error}; try a "
                "smaller one."
            ) from error
        if not found.converged:
            raise NotConverged(
                f"no orbit branches off at the amplitude {amplitude:g} "
                f"({self.problem.label}): residual {found.residual:.3g}; try a smaller one.",
                residual=found.residual,
            )
        values = {name: found.z[at] for name, at in curve.slots.items()}
        started = {k: v if np.ndim(v) else float(v) for k, v in values.items()}
        problem = self.problem.at(**started)
        checked(shot_orbit(problem).section)
        return problem


def unfolded(point: Point) -> Lift:
    """A symmetric orbit at its pitchfork as an orbit that need not be symmetric.

    Parameters
    ----------
    point : Point
        A pitchfork on a branch of symmetric shooting orbits, ``branch.first("PF")``.

    Raises
    ------
    BadInput
        If it is none.

    Examples
    --------
    >>> import contbreather as cb
    >>> from contbreather.breathers.shooting import shooting
    >>> branch = cb.trace(shooting(cb.symmetric(0.7, 0.04, 0.8), sites=20), "a", towards="up",
    ...                   within={"a": (0, 0.8)})
    >>> tilted = shot_orbit(unfolded(branch.first("PF")).arm(0.02))
    >>> abs(tilted.times[1] - tilted.times[0] - math.pi) > 1e-3
    True
    """
    orbit = _orbit_at(point, "PF")
    return _lift(point, opened(orbit.section), "the pitchfork of a symmetric orbit")


def doubled(point: Point) -> Lift:
    """An orbit at its period doubling as one of twice the period, all its impacts twice.

    Parameters
    ----------
    point : Point
        A period doubling on a branch of shooting orbits, ``branch.first("PD")``.

    Raises
    ------
    BadInput
        If it is none.
    """
    section = _orbit_at(point, "PD").section
    itinerary = section.itinerary
    times = np.concatenate([section.t, section.t + itinerary.length])
    twice = replace(section, itinerary=itinerary.doubled(), t=times)
    return _lift(point, twice, "a period doubling")


def _orbit_at(point: Point, kind: str) -> RingOrbit:
    orbit = point.solution
    if not isinstance(orbit, RingOrbit):
        raise BadInput(f"{point!r} is on no branch of shooting orbits; shoot it first.")
    if point.kind != kind:
        raise BadInput(f"a {kind} point was wanted, got {point!r}: see branch.special.")
    return orbit


def _lift(point: Point, section: Section, what: str) -> Lift:
    check_coupling(section.itinerary, section.conditions)
    sizes, vectors = np.linalg.svd(section.jacobian())[1:]
    if sizes[-1] > SINGULAR * sizes[0]:
        raise BadInput(
            f"{point!r} is not {what}: the equations of the longer orbit are regular there, "
            f"smallest singular value {sizes[-1]:.2g}."
        )
    direction, count = vectors[-1], section.t.size
    moved = abs(direction[:count])
    largest = int((moved > 0.999 * moved.max()).argmax())  # the first of those that are equal
    direction = direction * math.copysign(1.0, direction[largest])
    tangent = point.direction
    parent = np.concatenate([np.tile(tangent[: count // 2], 2), tangent[count // 2 :]])
    return Lift(problem_of(RingOrbit(section)), direction, parent, point.curve.free[0])
