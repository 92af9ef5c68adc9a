"""Defining systems: matrices that lose rank, and a problem with such conditions as a longer one.

With the defining system ``g(x, p, y) = 0`` of an event, y what it needs besides (a null vector, an
angle), the equations ``F(x, p) = 0`` become the longer problem of its curve in two parameters::

    | F_x  0    F_p |
    | g_x  g_y  g_p |

of n + m + 1 equations for x, y and p: the points of that curve are regular ones.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import BadInput
from ..algebra import derivatives
from ..algebra.linear_algebra import (
    Bordered,
    LeastSingular,
    by_inverses,
    inverses_between,
    least_singular,
)
from ..algebra.newton import FEW, Array, Undefined
from ..algebra.sparse import Dense, Matrix, above, beside, eliminated_as, is_large, scaled
from ..curve.curve import Curve, Params
from ..curve.point import DefiningSystem, Event, Point
from ..curve.problem import Problem

_EDGE = 1e-9  # how far outside of a step its ends still belong to it
_SQUARES = 4  # a matrix is looked at, and its square, ..., up to its eighth power


# --- matrices that lose rank ------------------------------------------------------------------


@dataclass(frozen=True)
class Singular:
    """A test by a matrix that is singular at the event: its least singular value, with the sign of
    its determinant, or `size`; where it should be singular between two points is looked at."""

    matrix: Callable[[Point], Matrix]
    size: Callable[[Point], float] | None = None

    def __call__(self, point: Point) -> float:
        return signed_smallest(self.matrix(point)) if self.size is None else self.size(point)


def factors_at(matrix: Callable[[Point], Matrix], point: Point) -> Any:
    """A matrix of an event factorised, once for the test at a point of a walk and for both steps
    that meet there; a large one as it is."""

    def make(_: Array) -> Any:
        whole = matrix(point)
        return Dense(whole) if isinstance(whole, np.ndarray) else whole

    return point.curve.cached(matrix, np.array([point.z, point.direction]), make)


def stays_regular(matrix: Callable[[Point], Matrix], first: Point, last: Point) -> bool:
    """Tell whether no interpolation of the matrix of an event between two points is singular; of a
    large one nobody knows."""
    begin, end = factors_at(matrix, first), factors_at(matrix, last)
    change = begin.solve(begin.whole - end.whole) if isinstance(begin, Dense) else None
    return change is not None and bool(_reaches_nothing(change[None])[0])


def regular_between(first: Matrix, stack: Array) -> NDArray[np.bool_]:
    """Tell on which steps between small matrices no interpolation is singular."""
    stack = np.concatenate([[first], stack])
    try:
        return _reaches_nothing(np.linalg.solve(stack[:-1], stack[:-1] - stack[1:]))
    except np.linalg.LinAlgError:
        return np.zeros(len(stack) - 1, dtype=bool)


def _reaches_nothing(power: NDArray[Any]) -> NDArray[np.bool_]:
    """Tell which of several matrices have no eigenvalue of size 1: where a power is smaller."""
    small = np.zeros(len(power), dtype=bool)
    for _ in range(_SQUARES):
        small |= (power * power).sum(axis=(1, 2)) < (1.0 - _EDGE) ** 2**_SQUARES
        if small.all():
            break
        power = power @ power
    return small


def singular_between(first: Matrix, *others: Matrix) -> Array:
    """Find the places from the first of several matrices, 0, to the last, 1, where they are
    singular, by linear interpolation of two or quadratic of three."""
    if isinstance(first, Bordered):
        return _places(inverses_between(first, *others))
    change, turned = _pencil(first, *others), False
    if change is None:  # an event is where the first is: seen from the other end
        change, turned = _pencil(*others[::-1], first), True
    if change is None or not (change * change).sum() < math.inf or _reaches_nothing(change[None]):
        return np.empty(0)
    places = _places(np.linalg.eigvals(change))
    return 1 - places[::-1] if turned else places


def _pencil(first: Array, *others: Array) -> Array | None:
    """A matrix whose eigenvalues are the inverses of these places."""
    middle, last = others[0], others[-1]
    if len(others) == 1:
        return Dense(first).solve(first - last)
    # M(u) = M0 + u (M1 - M0 - Q) + u^2 Q, Q = 2 (M0 - 2 M1/2 + M1): with w = u x
    #     | M0^-1 (M0 - M1 + Q)   -M0^-1 Q |  has the eigenvalues 1 / u where M(u) x = 0
    #     |           1               0    |
    Q = 2 * (first - 2 * middle + last)
    change = Dense(first).solve(np.hstack([first + Q - last, -Q]))
    return change if change is None else np.vstack([change, np.eye(*change.shape)])


def _places(values: NDArray[Any]) -> Array:
    """The inverses of eigenvalues, as far as they are real and from 0 to 1, in order."""
    places = values.real / np.maximum(abs(values) ** 2, 1e-300)  # Re(1 / value), 0 where it is
    # two zeros that are close together may be a little off the real axis
    on_step = (abs(values.imag) < 0.1 * abs(values)) & (abs(places - 0.5) <= 0.5 + _EDGE)
    return np.sort(places[on_step])


def signed_smallest(matrix: Matrix) -> float:
    """Smallest singular value with the sign of the determinant: smooth through a simple zero."""
    if isinstance(matrix, Bordered):
        # close to a zero one turn is enough, and far away none is needed
        return by_inverses(matrix, matrix.row.size, 3)[0]
    if not is_large(matrix):
        return float(signed_smallest_of(matrix[None])[0])
    weak = least_singular(matrix)
    return weak.sign * weak.size


def signed_smallest_of(stack: Array) -> Array:
    """Least singular values of several small matrices, with the signs of their determinants."""
    sizes = np.linalg.svd(stack, compute_uv=False)[:, -1]
    return np.asarray(np.copysign(sizes, np.linalg.slogdet(stack)[0]))


def overlap(point: Point) -> float:
    """The test of a double zero with one eigenvector, where one eigenvalue of F_x is zero all along
    a curve: ``w . v`` of the null vectors as in the adjugate, so that no sign jumps."""
    base, n = point.base_point, point.base_point.curve.size
    if n < 2:
        return math.nan
    weak = least_singular(base.jacobian()[:, :n])
    # adj M = sign (product of the other singular values) v w^T at rank n - 1, and its trace is
    # d det(M + s) / ds: zero where 0 is a double zero of that
    return float(weak.sign * weak.left @ weak.right)


# A fold. The null vector, in the scales of the unknowns, is an unknown like any other
# (G. Moore and A. Spence, SIAM J. Numer. Anal. 17, 567, 1980):
#     | F_x          0       F_p    |
#     | (F_x v)_x   F_x   (F_x v)_p |
#     | 0          2 v^T      0     |
def null_conditions(curve: Curve, z: Array, v: Array) -> Array:
    """``F_x v`` and ``|v|^2 - 1``."""
    scales = curve.scales[: curve.size]
    return np.append(curve.jacobian(z)[:, : curve.size] @ (scales * v), v.dot(v) - 1)


def null_slopes(curve: Curve, z: Array, v: Array) -> Array:
    n, scales = curve.size, curve.scales[: curve.size]
    rows = np.zeros((n + 1, z.size + n))
    # second derivatives are symmetric: d/dz (F_x v) is the derivative of F_z along v
    rows[:n, : z.size] = curve.along(z, scales * v)
    rows[:n, z.size :] = curve.jacobian(z)[:, :n] * scales
    rows[n, z.size :] = 2 * v
    return rows


def least_in_unknowns(curve: Curve, z: Array) -> LeastSingular:
    """The weak end of the derivative in the unknowns, in their scales and balanced."""
    balanced, n = curve.balanced, curve.size
    return curve.cached("weak", z, lambda z: least_singular(balanced(curve.jacobian(z)[:, :n])))


def singular_in_unknowns(curve: Curve, z: Array) -> tuple[float, Array, Array]:
    """Its value and vectors as `rank_locus` takes them."""
    weak = least_in_unknowns(curve, z)
    left, right = weak.left / curve.row_scales, weak.right * curve.scales[: curve.size]
    return weak.sign * weak.size, weak.sign * left, right


def turning(curve: Curve, z: Array) -> tuple[float, Array, Array]:
    """The same of the parameters' part of the kernel of the whole derivative, which is singular at
    folds: also where another mode is about to lose rank, with which F_x has two small values."""
    n, left, sizes, right = curve.size, *np.linalg.svd(curve.balanced(curve.jacobian(z)))
    kernel, inverse = right[n:].T, (right[:n].T / sizes) @ left.T
    first, (*_, size), second = np.linalg.svd(kernel[n:])
    turns = map(np.linalg.det, (left, right, first, second))
    sign = math.copysign(1.0, math.prod(turns))
    # kernel' = -inverse F' kernel, as both stay orthonormal
    row = -sign * (first[:, -1] @ inverse[n:]) / curve.row_scales
    return sign * float(size), row, curve.scales * (kernel @ second[-1])


def rank_locus(weak: Callable[[Curve, Array], tuple[float, Array, Array]]) -> DefiningSystem:
    """The least singular value of a square matrix B is zero: one equation and no unknown.

    ``weak(curve, z)`` gives it with the sign of the determinant, and its vectors w and v, in the
    units of the equations and of the unknowns. It is the scalar of a bordered system whose borders
    are the vectors of each place. B changes as the part in the unknowns of the derivative does.
    """
    return DefiningSystem({}, partial(_least, weak), partial(_slope_of_least, weak))


def _least(weak: Callable[..., Any], curve: Curve, z: Array, extra: Array) -> Array:
    return np.array([weak(curve, z)[0]])


def _slope_of_least(weak: Callable[..., Any], curve: Curve, z: Array, extra: Array) -> Array:
    # sigma' = w^T B' v: as |v| = |w| = 1, what the vectors change by drops out
    _, left, right = weak(curve, z)
    return along_by_difference(curve, z, left, right)[None, :]


def along_by_difference(curve: Curve, z: Array, left: Array, right: Array) -> Array:
    """``left @ curve.along(z, right)`` by one central difference where there are values to both
    sides, to eight digits: a row of Newton's iteration needs no more."""
    way = np.append(right, np.zeros(z.size - right.size))
    size = float(np.linalg.norm(way / np.maximum(curve.scales, abs(z))))
    step = 1e-5 / max(size, 1e-300)  # one of two null vectors may vanish
    places = [z + step * way, z - step * way]
    try:
        curve.prepare(places)
        there, behind = (left @ curve.jacobian(place) for place in places)
    except Undefined:
        return left @ curve.along(z, way)
    return np.asarray((there - behind) / (2 * step))


def linear_condition(places: Any, weights: Array, total: float, **more: Any) -> DefiningSystem:
    """Entries of z at these places, weighted, add up to a total: one equation and no unknown."""
    sum_of, row = partial(_sum_less, places, weights, total), partial(_row_of, places, weights)
    return DefiningSystem({}, sum_of, row, **more)


def _sum_less(
    places: Any, weights: Array, total: float, curve: Curve, z: Array, extra: Array
) -> Array:
    return np.array([weights @ z[places] - total])


def _row_of(places: Any, weights: Array, curve: Curve, z: Array, extra: Array) -> Array:
    row = np.zeros((1, z.size))
    row[0, places] = weights
    return row


# --- problem and defining system together -------------------------------------------------------


class Extended:
    """Residual of a problem and the conditions of a locus together.

    The unknowns are those of the problem, the extra ones of the locus, then a parameter that is
    `released`: the conditions determine it. `base` is the curve of the problem with this parameter
    free, and perhaps another one that is to be free in the longer problem.
    """

    def __init__(self, base: Curve, locus: DefiningSystem, event: Event | None = None) -> None:
        self.locus = locus
        self.event = event
        self.problem = base.problem
        self.released, *others = base.free
        self.free = tuple(others)
        self.n = base.size
        self._curves = {self.free: base}

    def beneath(self, x: Array, params: Params, free: tuple[str, ...]) -> tuple[Curve, Array]:
        """The curve of the shorter problem, and the point on it."""
        z = np.concatenate([x[: self.n], x[-1:], [params[name] for name in free]])
        curve = self._curves.get(free)
        # made anew where a parameter that is not free has another value
        fixed = (name for name in params if name not in free)
        if curve is None or any(curve.fixed[name] != params[name] for name in fixed):
            values = {name: x[slot] for name, slot in self.problem.slots.items()}
            base = self.problem.at(**values, **params, **{self.released: float(x[-1])})
            curve = self._curves[free] = Curve(base, (self.released, *free))
        return curve, z

    def __call__(self, x: Array, params: Params) -> Array:
        """The equations of the curve and behind them the conditions."""
        (curve, z), extra = self.beneath(x, params, self.free), x[self.n : -1]
        values = curve.equations(z)
        if self.locus.unfolding is not None:
            values = values + self.locus.unfolding(curve, z, extra)[0]
        conditions = np.asarray(self.locus.conditions(curve, z, extra))
        if conditions.shape != (extra.size + 1,):
            raise BadInput(
                f"a locus with {extra.size} extra unknowns needs {extra.size + 1} conditions, "
                f"it gave {conditions.shape}"
            )
        return np.concatenate([values, conditions])

    def derivatives(self, x: Array, params: Params, free: tuple[str, ...]) -> Matrix:
        """Their derivative, columns in the order: unknowns, extra, parameters."""
        (curve, z), extra, n = self.beneath(x, params, free), x[self.n : -1], self.n
        matrix, locus = curve.jacobian(z), self.locus
        if locus.derivative is not None:
            rows = np.asarray(locus.derivative(curve, z, extra))
        else:
            # apart: conditions that ask for derivatives of the problem at one z get those they had
            difference = partial(derivatives.differences, one_sided=True)
            conditions, ways = partial(locus.conditions, curve), np.eye(z.size)
            units = np.maximum(curve.scales, abs(z))
            if z.size > FEW and locus.unfolding is None:
                # rows of F' added to those of g change neither solutions nor determinants of both:
                # all that counts is along the null vectors of F', where it is weakest, and the way
                # to F = 0
                weak = least_singular(scaled(matrix, 1 / curve.row_scales, units))
                off = weak.rest(curve.equations(z) / curve.row_scales)
                ways = np.vstack([weak.plane, off / (np.linalg.norm(off) or 1.0)])
            way = np.zeros(len(ways))
            rows = difference(lambda t: conditions(z + units * (t @ ways), extra), way)
            rows = rows @ ways / units
            if extra.size:
                in_extra = difference(lambda y: conditions(z, y), extra)
                rows = np.hstack([rows, in_extra])
        middle = np.zeros((n, extra.size))
        if locus.unfolding is not None:
            middle = locus.unfolding(curve, z, extra)[1]
        # y the extra unknowns, r the released parameter, u the unfolding
        # | F_x  u_y  F_r  F_p |
        # | g_x  g_y  g_r  g_p |
        below = np.hstack([rows[:, :n], rows[:, z.size :], rows[:, n : z.size]])
        whole = above(beside(beside(matrix[:, :n], middle), matrix[:, n:]), below)
        return eliminated_as(whole, matrix, range(n, n + extra.size + 1))

    # --- events of the shorter problem, asked at places of the longer one ---

    def lifted(self, locus: DefiningSystem, suffix: str) -> DefiningSystem:
        """The locus of such an event as one on the longer problem, its unknowns renamed."""
        return replace(
            locus,
            extra={f"{name}{suffix}": value for name, value in locus.extra.items()},
            conditions=partial(self._beneath, locus.conditions),
            derivative=locus.derivative and partial(self._slopes_beneath, locus.derivative),
            events=(),
            walker=None,
        )

    def _beneath(
        self, function: Callable[..., Array], curve: Curve, z: Array, extra: Array
    ) -> Array:
        base, place = self.beneath(z[: curve.size], curve.params(z), curve.free)
        return np.asarray(function(base, place, extra))

    def _slopes_beneath(
        self, derivative: Callable[..., Array], curve: Curve, z: Array, extra: Array
    ) -> Array:
        rows, n = self._beneath(derivative, curve, z, extra), self.n
        between = np.zeros((len(rows), curve.size - n - 1))  # its extra unknowns
        return np.hstack([rows[:, :n], between, rows[:, n:]])


@dataclass(frozen=True, eq=False, repr=False)
class ExtendedProblem(Problem):
    """As a problem: `residual` knows its derivatives."""

    residual: Extended
    derivatives = property(attrgetter("residual.derivatives"))
    beneath = property(attrgetter("residual.beneath"))
    totals = property(attrgetter("residual.problem.totals"))

    @property
    def internals(self) -> frozenset[str]:
        extra = self.residual.locus.extra.items()
        vectors = {name for name, value in extra if np.ndim(value)}
        return self.residual.problem.internals | vectors

    def walker(self, free: tuple[str, ...], params: Params) -> Any:
        both = self.residual
        if both.problem.walker is None or both.locus.walker is None:
            return None
        return both.locus.walker(both.problem, (both.released, *free), params)

    def modulo(self, x: Array, params: Params) -> Mapping[str, Any]:
        curve, z = self.beneath(x, params, ())
        return curve.problem.modulo(z[: curve.size], curve.params(z))

    def phases(self, x: Array, params: Params) -> tuple[Array, ...]:
        (curve, z), written = self.beneath(x, params, ()), list[Array]()
        extra, event = self.residual.locus.extra, self.residual.event
        for place in curve.problem.phases(z[: curve.size], curve.params(z)):
            if any(map(np.ndim, extra.values())) and event and event.locus:
                # of null vectors in this phase, too, which may come back with the other sign
                own = event.locus(Point(curve, np.append(place, z[curve.size :]))).extra
                null = np.concatenate([*map(np.ravel, own.values())])
                written += [np.concatenate([place, way * null, x[-1:]]) for way in (1, -1)]
            else:
                written.append(np.append(place, x[self.residual.n :]))
        return tuple(written)

    def unresolved(self, point: Point, on: str = "") -> str:
        event, base = self.residual.event, point.base_point
        return base.problem.unresolved(base, event.kind if event else "")


def extended(
    base: Curve,
    locus: DefiningSystem,
    event: Event | None = None,
    make: Callable[..., ExtendedProblem] = ExtendedProblem,
) -> ExtendedProblem:
    """The problem of a curve with the conditions of `locus` added, and the first of its free
    parameters made unknown; `event` is what the locus is of, where that is a boundary."""
    problem, released = base.problem, base.free[0]
    clash = set(locus.extra) & set(problem.names)
    if clash:
        raise BadInput(f"rename {sorted(clash)} in the problem: the locus needs these names")
    # an angle or a squared frequency is measured by its size: it is not what the steps are about
    scalars = {n: abs(float(value)) for n, value in locus.extra.items() if np.ndim(value) == 0}
    sizes = {name: size for name, size in scalars.items() if size > 1.0}
    return make(
        Extended(base, locus, event),
        {**problem.start, **locus.extra, released: problem.params[released]},
        {name: value for name, value in problem.params.items() if name != released},
        domain={
            **problem.domain_along(base.free),
            **{n: d for n, d in locus.domain.items() if n in base.free or n in locus.extra},
        },
        scales={**sizes, **problem.scales},
    )


def event_of(problem: Problem) -> Event | None:
    """The event whose boundary a problem is of, if it is one."""
    return problem.residual.event if isinstance(problem, ExtendedProblem) else None
