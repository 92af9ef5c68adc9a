"""Where a new curve sets out: the problem that has it, and the directions in which it leaves."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..errors import NotConverged
from .curve import Curve
from .newton import Array, Undefined, newton
from .point import Point
from .problem import Problem
from .rank import weakest

_SINGULAR = 1e-6  # least singular value of balanced equations where curves cross
_ALIKE = 0.999  # entries of a direction that are equal but for rounding
_KINK = 1e-3  # how far directions differ where a curve has a kink
_STRIDE = 1e-3  # from a point to where the direction of an arm with a kink is looked for


class Seed(NamedTuple):
    """The start of one arm: its problem, the point z in it, the direction in which it leaves, and
    that of the branch it leaves from, which it must not follow."""

    problem: Problem
    z: Array
    tangent: Array
    parent: Array | None = None


@dataclass(frozen=True)
class Lift:
    """A problem in which other curves leave a point, its start and its parameters those of the
    point.

    Where its equations are regular, one curve passes the point and leaves it to both sides. Where
    they lose rank, as a symmetry of a larger problem breaks, the curve that leaves is the one along
    which the free parameter does not change at first.

    Parameters
    ----------
    problem : Problem
        That of the arms: the branch's own, or a larger one that knows both flights of an
        asymmetric breather, or a doubled cycle.
    free : str
        The parameter in which the branch was followed.
    by : sequence of str
        Of these unknowns the first that moves as far as any says which arm comes first: along that
        one it becomes smaller. All of them unless given.
    both : bool
        Whether the two sides are different curves; of a doubled cycle they are one, a period
        apart.

    Examples
    --------
    >>> import numpy as np
    >>> pitchfork = Problem(lambda x, p: np.array([x[0] * (p["mu"] - x[0] ** 2)]),
    ...                     {"x": 0.0}, {"mu": 0.0})
    >>> round(Lift(pitchfork, "mu").arm(0.1).params["mu"], 12)
    0.01
    """

    problem: Problem
    free: str
    by: Sequence[str] = ()
    both: bool = True

    @property
    def direction(self) -> Array:
        """Unit vector of the unknowns in which the first arm leaves."""
        tangent = self.tangents[0][:-1]
        return np.asarray(tangent / np.linalg.norm(tangent))

    @cached_property
    def tangents(self) -> tuple[Array, Array | None]:
        """The tangent of the first arm, and that of the branch where it solves the problem, too."""
        curve = Curve(self.problem, (self.free,))
        weak = weakest(curve.balanced(curve.jacobian(curve.start)))
        plane = weak.plane * curve.scales
        if weak.size > _SINGULAR * max(1.0, weak.largest):
            return self._oriented(plane[1], curve), None
        one, other = plane[:, -1]
        if not math.hypot(one, other) > _SINGULAR * np.linalg.norm(plane):
            raise Undefined("the parameter changes along no curve at first: they fold there")
        return self._oriented(other * plane[0] - one * plane[1], curve), plane[:, -1] @ plane

    def _oriented(self, tangent: Array, curve: Curve) -> Array:
        slots = [curve.slots[name] for name in self.by or self.problem.start]
        moved = np.concatenate([np.atleast_1d(tangent[slot]) for slot in slots])
        first = moved[int((abs(moved) >= _ALIKE * abs(moved).max()).argmax())]
        return np.asarray(-math.copysign(1.0, first) * tangent)

    def seeds(self) -> tuple[Seed, ...]:
        """Where the arms set out."""
        (tangent, parent), z = self.tangents, Curve(self.problem, (self.free,)).start
        sides = (1.0, -1.0) if self.both else (1.0,)
        return tuple(Seed(self.problem, z, side * tangent, parent) for side in sides)

    def arm(self, amplitude: float = 0.01, free: str | None = None) -> Problem:
        """The problem started on an arm, at a distance along `direction`; its sign chooses the arm,
        and `free` is the parameter that gives way.

        Raises
        ------
        NotConverged
            If there is not a solution at this amplitude: try another one.
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
                f"no orbit branches off at the amplitude {amplitude:g} ({self.problem.label}): "
                f"residual {found.residual:.3g}; try a smaller one.",
                residual=found.residual,
            )
        return Point(curve, found.z).problem


def across(point: Point) -> tuple[Seed, ...]:
    """Both directions of the curve that crosses the one the point was found on."""
    if "tangents" not in point.detail:
        raise Undefined("no directions are known here: other curves set out where curves cross")
    row = point.curve.dual(point.direction)
    other = min(point.detail["tangents"], key=lambda tangent: abs(float(tangent.dot(row))))
    return tuple(
        Seed(point.problem, point.z, _beside(point, side * other), point.tangent)
        for side in (-1, 1)  # the leading unknown of a tangent grows along it: first where it falls
    )


def _beside(point: Point, tangent: Array) -> Array:
    """A direction, or that of solutions found beside the point where a curve has a kink there: as
    where two impacts at once come apart, in another order on either side."""
    curve, near = point.curve, []
    row = curve.dual(tangent)
    for distance in (_STRIDE, 2 * _STRIDE):
        try:
            found = curve.newton(point.z + distance * tangent, row)
        except Undefined:
            return tangent
        if not found.converged:
            return tangent
        near.append(found.z)
    secant = curve.normalised(4.0 * near[0] - near[1] - 3.0 * point.z)
    off = curve.length(secant - tangent)
    follows = curve.length(secant - float(row @ point.direction) * point.direction) < off
    return tangent if follows or off < _KINK else secant
