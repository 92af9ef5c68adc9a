"""Normal form of the pitchfork: which way the arms that break the symmetry bend, and how strongly.

In every representation the whole period of a symmetric orbit solves ``G(x, parameter) = 0``, with
null vectors v and w of ``G_x`` at its pitchfork. Along an arm ``x = x_0 + s v + s^2 h + ...`` and
``parameter = its value + s^2 curvature``, hence

    ``G_x h + G_parameter curvature = -G_xx v v/2``,
    ``w (G_xx v h + G_x,parameter v curvature) = -w G_xxx v v v/6``:

one linear system, for by symmetry neither right side of the first equation has a share of w.

Where neighbours hit their walls at the same time and come apart along v, the order of their impacts
is another one on either side: what the first does to the velocity of the second grows like the
square of the time between them, so that G_xx jumps. By symmetry ``w G_xx v v`` then changes sign
with s, and the bifurcation equation is

    ``s (alpha (parameter - its value) + beta |s|) = 0``,
    ``alpha = w (G_xx v x' + G_x,parameter v)``, ``beta = w G_xx v v/2`` on the side of v,

x' being the derivative along the symmetric orbits: arms that leave linearly, and no square root.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contbreather.continuation.algebra.newton import OUT_OF_DOMAIN, Undefined
from contbreather.continuation.branches.switching import leaving
from contbreather.continuation.curve.curve import Curve, Params
from contbreather.continuation.curve.point import Point
from contbreather.continuation.curve.problem import Problem, TiedProblem
from contbreather.continuation.systems.normal_forms import Forms, solve
from contbreather.errors import BadInput
from contbreather.orbits.branch_switching import changes_order, tangent_in
from contbreather.orbits.orbit import Orbit
from contbreather.orbits.orbit_problem import OrbitProblem
from contbreather.tables import Cell, HtmlRepr, Sheet

FloatArray = NDArray[np.float64]

NAMES = "criticality", "coefficient", "power"  # of what a located pitchfork knows
_SINGULAR = 1e-6  # least singular value of G_x, relative to its largest


@dataclass(frozen=True)
class PitchforkForm(HtmlRepr):
    """Normal form of a pitchfork: how the arms leave it.

    Attributes
    ----------
    free : str
        The parameter.
    coefficient : float
        Limit of ``|t2 - t1 - pi|^power/(parameter - its value at the pitchfork)``; of several
        impacts in half a period the one that is shifted most.
    supercritical : bool
        The arms exist where the symmetric orbit has lost its stability.
    power : int
        2; 1 where on the arms neighbours that hit their walls at once do so one after the other.
    """

    free: str
    coefficient: float
    supercritical: bool
    power: int = 2

    @property
    def criticality(self) -> str:
        return "supercritical" if self.supercritical else "subcritical"

    def table(self) -> Sheet:
        """The coefficient, and on which side the arms are."""
        rows: list[tuple[str, Cell]] = [("criticality", self.criticality), ("in", self.free)]
        return Sheet.of([*rows, ("coefficient", self.coefficient), ("power", self.power)])


def pitchfork_form(orbit: Orbit, free: str = "a") -> PitchforkForm:
    """Criticality and coefficient of the pitchfork of a symmetric orbit, in any representation.

    Parameters
    ----------
    orbit : Orbit
        At its pitchfork, ``branch.first("PF").solution``.
    free : str
        Any of its parameters.

    Raises
    ------
    BadInput
        If there is no such parameter, or this orbit is at no pitchfork.
    Undefined
        Where a second multiplier is 1, or no orbit is beside this one.

    Examples
    --------
    At gamma = 0 everything is elementary:

    >>> import contbreather as cb, math
    >>> a = 2 * math.sqrt(4 + (math.pi / 9) ** 2) / (math.pi**2 - 4)
    >>> form = pitchfork_form(cb.symmetric(a, 0.0, 0.8))
    >>> form.criticality, round(form.coefficient, 3)
    ('supercritical', 9.166)
    """
    curve = Curve(orbit.problem.having(free), (free,))
    upwards = np.eye(1, curve.start.size, curve.size)[0]
    along, _ = curve.tangent_at(curve.start, upwards)
    return _form(Point(curve, curve.start, along))


def detail_of_pitchfork(point: Point) -> dict[str, Any]:
    """Its normal form on a branch in one parameter, or why it is not known."""
    try:
        form = _form(point)
    except OUT_OF_DOMAIN as error:
        return {"criticality": f"unknown: {error}"}
    return {name: getattr(form, name) for name in NAMES}


def _form(point: Point) -> PitchforkForm:
    orbit: Orbit = point.solution
    if not orbit.section.symmetric:
        raise BadInput(f"{orbit.describe()}: only half a symmetric orbit has a pitchfork.")
    whole = orbit.unfolded()
    problem = _in_parameters(point.curve.problem, point.params, whole.problem)
    curve = Curve(problem.having(*point.curve.free), point.curve.free)
    matrix = curve.jacobian(curve.start)
    left, sizes, right = np.linalg.svd(matrix[:, :-1])
    if sizes[-1] > _SINGULAR * sizes[0]:
        raise BadInput(
            f"{orbit!r} is no pitchfork: the least singular value of its equations is "
            f"{sizes[-1]:.2g}, not 0."
        )
    if sizes[-2] <= _SINGULAR * sizes[0]:
        raise Undefined("a second multiplier is 1, as of idle sites without coupling")
    m = orbit.section.count  # unknowns begin with the times in both halves of the period
    shifts = right[-1][m : 2 * m] - right[-1][:m]
    # so that s is the asymmetry
    v, w = right[-1] / shifts[abs(shifts).argmax()], left[:, -1]  # G_x v = 0, w G_x = 0
    kink = changes_order(whole, v)
    bend = _slope(curve, point, v) if kink else _curvature(curve, matrix, v, w)
    power = 1 if kink else 2
    return PitchforkForm(curve.free[0], 1.0 / bend, bend * _loss(point) > 0.0, power)


def _in_parameters(of: Problem, params: Params, problem: Problem) -> Problem:
    """A problem of orbits in the parameters of another, which may be tied."""
    if isinstance(of, OrbitProblem) or not isinstance(of, TiedProblem):
        return problem
    ties = of.ties
    base = _in_parameters(ties.base, ties(params), problem).having(*ties.functions)
    return base.tied(ties.functions, **params)


def _slope(curve: Curve, point: Point, v: FloatArray) -> float:
    """Slope of the parameter along the arms where they leave with a kink."""
    along = tangent_in(curve, point, lambda orbit: orbit.unfolded().problem)
    return float(leaving(curve, curve.start, np.append(v, 0.0), along / along[-1])[-1])


def _curvature(curve: Curve, matrix: FloatArray, v: FloatArray, w: FloatArray) -> float:
    n = v.size
    change = curve.along(curve.start, v)
    # a third derivative is a second difference of Jacobians, which are exact
    _, bent = Forms(Point(curve, curve.start)).jet(v)
    whole, right = np.zeros((n + 2, n + 2)), np.zeros(n + 2)
    # G_x       w  G_a        h             -G_xx v v/2
    # v         0  0        ( 0         ) = 0
    # w G_xx v  0  w G_xa v   curvature     -w G_xxx v v v/6
    whole[:n, :n], whole[:n, n], whole[:n, -1] = matrix[:, :-1], w, matrix[:, -1]
    whole[n, :n] = v  # h has no share of v
    row = w @ change
    whole[-1, :n], whole[-1, -1] = row[:-1], row[-1]
    right[:n], right[-1] = -0.5 * (change[:, :-1] @ v), -(w @ bent @ v) / 6.0
    curvature = float(solve(whole, right)[-1])  # h and, last, the parameter per s^2
    if abs(curvature) > 1e9:  # a curvature beyond it is rounding over rounding
        raise Undefined("the multiplier touches 1 and does not pass it: no normal form")
    return curvature


def _loss(point: Point) -> int:
    """1 where stability is lost with a growing parameter, -1 where it is gained."""
    along = point.direction
    # a little off the pitchfork, to both sides
    step = math.copysign(1e-3, along[-1]) / np.linalg.norm(along) * along
    counts = [_outside(point.curve, point.z + side * step) for side in (-1.0, 1.0)]
    # where there is no orbit, as at the end of a domain, there is one more or one less
    others = [1 if not n else n - 1 for n in reversed(counts)]
    low, high = (other if n is None else n for n, other in zip(counts, others, strict=True))
    if low == high:
        raise Undefined("no real multiplier passes 1 there: no normal form of this kind")
    return 1 if high > low else -1


def _outside(curve: Curve, z: FloatArray) -> int | None:
    try:
        # multipliers of a free mean are at 1 to rounding
        return int(Point(curve, z).solution.map.beyond(1.0 + 1e-6))
    except OUT_OF_DOMAIN:
        return None
