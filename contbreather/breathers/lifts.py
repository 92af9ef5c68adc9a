"""The same orbit where its symmetry or its period can break: what leaves a pitchfork or a doubling.

At its pitchfork a symmetric orbit is a singular point of the problem of its whole period, at its
period doubling any orbit is one of the problem of twice the period: one section and the next as
one. The null vector there tells where the new orbits are: along it the parameter does not change
at first.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contbreather.breathers.orbit import Orbit, checked, orbit_at
from contbreather.continuation import Point, Problem
from contbreather.continuation.newton import Undefined, newton
from contbreather.continuation.problem import Curve
from contbreather.continuation.seed import Seed
from contbreather.errors import BadInput, NotConverged

FloatArray = NDArray[np.float64]

SINGULAR = 1e-6  # smallest singular value of the lifted equations, relative to the largest
FIRST = 0.999  # of times that move alike the first one says which arm comes first


@dataclass(frozen=True)
class Lift:
    """An orbit at a pitchfork or a period doubling, as a problem that knows the orbits that
    branch off there.

    Attributes
    ----------
    problem : Problem
        Of the whole, or of the doubled, period; its start is the orbit at the bifurcation.
    direction : ndarray
        Unit null vector of its Jacobian: the unknowns in which the new orbits branch off, the
        first impact earlier. Its negative leads to their mirror images, or to the same orbits a
        period later.
    parent : ndarray or None
        Direction of the branch that the point is on, in the unknowns of `problem` and the free
        parameter; None if that branch does not solve this problem.
    free : str
        That parameter.
    """

    problem: Problem
    direction: FloatArray
    parent: FloatArray | None
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
        try:
            checked(orbit_at(problem))
        except BadInput as error:
            raise NotConverged(f"no orbit at the amplitude {amplitude:g}: {error}") from error
        return problem


def lift(point: Point) -> Lift:
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
    curve = Curve(orbit.road.lifted(), (free,))
    z = curve.start
    _, sizes, right = np.linalg.svd(curve.in_unknowns(z))
    off = max(float(abs(curve.equations(z)).max()), float(sizes[-1] / sizes[0]))
    if off > SINGULAR:
        raise NotConverged(
            f"{point!r} is not a {point.kind}: there the equations of the longer orbit do not "
            f"hold, or are regular, by {off:.2g}",
            residual=off,
        )
    direction = right[-1]
    times = [slot for name, slot in curve.slots.items() if name[0] == "t" and name[1:].isdigit()]
    moved = abs(direction[times])
    first = times[int((moved > FIRST * moved.max()).argmax())]
    direction = -direction * math.copysign(1.0, direction[first])
    return Lift(curve.problem, direction, _parent(curve, z, direction), free)


def _orbit_at(point: Point) -> Orbit:
    """The orbit of a point that others of a longer section leave."""
    if point.kind not in ("PF", "PD"):
        raise BadInput(
            f"{point!r} is {'a ' + point.kind if point.kind else 'no special point'}: a located PF "
            "or PD of a branch of orbits was wanted, see branch.special."
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


def _parent(curve: Curve, z: FloatArray, direction: FloatArray) -> FloatArray | None:
    """Of the null vectors of the equations, the parameter included, the other one."""
    _, sizes, right = np.linalg.svd(curve.jacobian(z))
    if sizes[-1] > SINGULAR * sizes[0]:
        return None
    plane, own = right[-2:], np.append(direction, 0.0)
    rest = plane - np.multiply.outer(plane @ own, own)
    other: FloatArray = rest[int(np.linalg.norm(rest, axis=1).argmax())]
    return other / np.linalg.norm(other)
