"""Fixed points and cycles of anybody's map: LP, BP, PD and NS, their curves and resonances.

The equations are ``G(x) - x = 0`` with G the map, or its iterate for a cycle: its multipliers are
the eigenvalues of F_x + 1.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..checks import whole
from ..errors import BadInput
from . import defining_systems as systems
from . import normal_forms
from .boundary import meeting
from .branch_points import branches_cross, crossed, crossing_event
from .curve import Params
from .equilibria import cusp, fold
from .point import CodimensionTwo, DefiningSystem, Event, Examined, Point, UnstableDimension
from .problem import Problem
from .settings import all_of
from .sparse import is_sparse
from .switching import SwitchingProblem

Array = NDArray[np.float64]
Map = Callable[[Array, Params], Array]

_SAME = 1e-7  # relative distance at which a cycle has closed
_RANK = 1e-7  # a multiplier this close to +1 or -1 is there
_ZERO = 1e-5  # double multipliers split by a root
_ROUNDING = 2e-13  # relative error of a multiplier: area preserving maps have products of 1


def FixedPoint(
    map_: Map,
    start: Mapping[str, Any],
    params: Params,
    *,
    period: int = 1,
    jacobian: Callable[[Array, Params], Array] | None = None,
    events: Iterable[Event] | None = None,
    record: Mapping[str, Callable[[Point], float]] | None = None,
    domain: Mapping[str, tuple[float, float]] | None = None,
    scales: Mapping[str, float] | None = None,
    label: str = "",
) -> Problem:
    """Fixed points of a map, or its cycles, as a problem: ``map^period(x) - x = 0``.

    Parameters
    ----------
    map_ : callable
        ``map_(x, params) -> array``, the next x; `x` is a one-dimensional array in the order of
        `start`. An angle is left unwrapped, with what it gains in a period taken off.
    start, params : dict
        As of a `Problem`: names and values, a start close to a solution.
    period : int
        Number of iterates after which the orbit closes.
    jacobian : callable, optional
        ``jacobian(x, params) -> (n, n) array``, the derivative of the map itself, dense.
    events : iterable of Event, optional
        LP, BP, PD and NS by default.
    record, domain, scales, label
        As of a `Problem`. The column ``unstable``, the number of multipliers outside the unit
        circle, is always there.

    Returns
    -------
    Problem
        To trace, to switch, to follow as boundaries. ``point.solution`` is a `MapCycle`. A located
        PD knows the coefficient ``detail["c"]`` of ``u -> -u + c u^3``, NS its ``detail["angle"]``
        and ``detail["d"]`` of ``w -> exp(i angle) w (1 + d |w|^2)``, for eigenvectors of length 1,
        and both their ``detail["criticality"]``: supercritical where what is born is stable on the
        centre manifold. Two real multipliers with product 1, a neutral saddle, are distinguished.
        Boundaries meet, under the names of the field, CP, R1, R2, R3, R4, LPPD (fold-flip), LPNS,
        PDNS, GPD and CH.

    Raises
    ------
    BadInput
        If `period` is not a positive integer, or as `Problem`.

    Examples
    --------
    The first period doubling of the logistic map, and the cycle that is born there:

    >>> import contbreather as cb, numpy as np
    >>> logistic = FixedPoint(lambda x, p: p["r"] * x * (1 - x), {"x": 0.6}, {"r": 2.5})
    >>> point = cb.trace(logistic, "r", within={"r": (1.5, 4)}).first("PD")
    >>> round(point["r"], 12), point.detail["criticality"]
    (3.0, 'supercritical')
    """
    period = whole("period", period, 1)
    if not callable(map_) or not (jacobian is None or callable(jacobian)):
        raise BadInput(f"a map, and its jacobian, are functions; got {map_!r} and {jacobian!r}")
    if not (record is None or isinstance(record, Mapping)):
        raise BadInput(f"record must be a dict of names and functions, got {record!r}")
    iterate = Iterate(map_, period, jacobian)
    return MapCycleProblem(
        iterate,
        start,
        params,
        jacobian=None if jacobian is None else iterate.jacobian,
        events=EVENTS if events is None else all_of(events) or (),
        record={**(record or {}), "unstable": UnstableDimension(attrgetter("solution.unstable"))},
        domain={} if domain is None else domain,
        scales={} if scales is None else scales,
        interpret=cycle_at,
        label=generic(iterate.period) if label == "" else label,
    )


# --- cycles as solutions ----------------------------------------------------------------------


def generic(period: int) -> str:
    return "fixed point" if period == 1 else f"cycle of period {period}"


@dataclass(frozen=True, eq=False)
class Iterate:
    """``G(x) - x`` with G the iterate of a map."""

    map: Map
    period: int
    derivative: Callable[[Array, Params], Array] | None = None

    def __call__(self, x: Array, params: Params) -> Array:
        image = x
        for _ in range(self.period):
            image = self.image(image, params)
        return image - x

    def image(self, x: Array, params: Params) -> Array:
        """One iterate; a map may write to what it is given, and return one array each time."""
        image = np.array(self.map(x.copy(), params))
        if image.shape != x.shape or not np.issubdtype(image.dtype, np.number):
            raise BadInput(f"the map makes {image!r} of {x!r}; {x.size} numbers were expected")
        return image

    def phases(self, x: Array, params: Params) -> tuple[Array, ...]:
        """The other points of the cycle, each a start of the same one."""
        points = []
        for _ in range(self.period - 1):
            x = self.image(x, params)
            points.append(x)
        return tuple(points)

    def jacobian(self, x: Array, params: Params) -> Array:
        """By the chain rule from the derivative of the map."""
        assert self.derivative is not None
        product = np.eye(x.size)  # DG^m = DG(x_m-1) ... DG(x_1) DG(x_0)
        for _ in range(self.period):
            slopes = self.derivative(x.copy(), params)
            if is_sparse(slopes):
                raise BadInput("the Jacobian of a map is sparse; give its toarray() instead")
            if np.shape(slopes) != product.shape:
                raise BadInput(
                    f"the Jacobian of the map has shape {np.shape(slopes)}; {product.shape} was "
                    "expected"
                )
            product = np.asarray(slopes) @ product
            x = self.image(x, params)
        return product - np.eye(x.size)


@dataclass(frozen=True)
class MapCycle:
    """A fixed point or cycle: its points, and its multipliers over one period."""

    points: Array  # (period, n)
    matrix: Array  # derivative of the iterate
    params: Mapping[str, float]

    @cached_property
    def multipliers(self) -> NDArray[np.complex128]:
        """Eigenvalues of the iterate, the largest first."""
        values = np.linalg.eigvals(self.matrix).astype(complex)
        return values[np.argsort(-abs(values), kind="stable")]

    @property
    def period(self) -> int:
        return len(self.points)

    @property
    def unstable(self) -> int:
        """Multipliers outside the unit circle."""
        return int((abs(self.multipliers) > 1).sum())


def cycle_at(point: Point) -> MapCycle:
    iterate: Iterate = point.curve.problem.residual
    points = np.array([point.x, *iterate.phases(point.x, point.params)])
    return MapCycle(points, multiplier_matrix(point), point.params)


def multiplier_matrix(point: Point) -> Array:
    n = point.curve.size
    # F = G - x: its derivative is that of G but for 1
    return np.asarray(point.jacobian()[:, :n] + np.eye(n))


def with_period(problem: Problem, period: int) -> Problem:
    """The same orbit as one of another period."""
    iterate: Iterate = problem.residual  # type: ignore[assignment]
    other = replace(iterate, period=period)
    unnamed = problem.label == generic(iterate.period)
    return replace(
        problem,
        residual=other,
        jacobian=None if problem.jacobian is None else other.jacobian,
        label=generic(period) if unnamed else problem.label,
    )


def shorter(point: Point) -> Problem | None:
    """The cycle as one of the smallest period it has, if that is not the one it is written in."""
    iterate: Iterate = point.curve.problem.residual
    size = 1 + float(np.linalg.norm(point.x))
    x = point.x
    for period in range(1, iterate.period):
        x = iterate.image(x, point.params)
        if iterate.period % period == 0 and np.linalg.norm(x - point.x) <= _SAME * size:
            return with_period(point.problem, period)
    return None


def units(point: Point) -> Array:
    """Derivative of the iterate between unknowns in their scales, which keeps the multipliers."""
    scales = point.curve.scales[: point.curve.size]
    # S^-1 A S
    return multiplier_matrix(point) * scales / scales[:, None]


@dataclass(frozen=True, eq=False, repr=False)
class MapCycleProblem(Problem):
    """Fixed points or cycles of a map."""

    residual: Iterate

    @property
    def period(self) -> int:
        return self.residual.period

    def images(self, x: Array, params: Params) -> tuple[Array, ...]:
        return self.residual.phases(x, params)

    def simpler(self, point: Point) -> Problem | None:
        return shorter(point)

    def lift(self, kind: str) -> Callable[[Point], SwitchingProblem] | None:
        return _doubled if kind == "PD" else None


# --- the events on a branch -------------------------------------------------------------------


def _examine_one(plain: Event, point: Point) -> Examined:
    """An event at which a multiplier is 1 is verified for that too: along cycles with multipliers
    far apart in size the derivative may look singular where it is not."""
    sizes = np.linalg.svd(units(point) - np.eye(point.curve.size), compute_uv=False)
    if sizes[-1] > _RANK * max(1.0, sizes[0]):
        return f"no multiplier is 1: the nearest is {sizes[-1]:.2g} off"
    assert plain.examine is not None
    return plain.examine(point)


def _flip_matrix(point: Point) -> Array:
    return units(point) + np.eye(point.curve.size)


def _flip_locus(point: Point) -> DefiningSystem:
    # (A + 1) v = 0 with A = F_x + 1
    null = systems.null_vector(_flip_matrix(point), point.curve.scales[: point.curve.size])
    on_flip = (_GENERALISED_FLIP, _R2_ON_FLIP)
    return replace(systems.null_locus(null, 2.0), events=on_flip, meets=MEETINGS["PD"])


def _examine_flip(point: Point) -> Examined:
    sizes = np.linalg.svd(_flip_matrix(point), compute_uv=False)
    if sizes[-1] > _RANK * max(1.0, sizes[0]):
        return f"no multiplier is -1: the nearest is {sizes[-1]:.2g} off"
    if sizes.size > 1 and sizes[-2] < _RANK * max(1.0, sizes[0]):
        return "two multipliers are -1, with two eigenvectors: not a simple period doubling"
    return normal_forms.criticality("c", lambda: normal_forms.flip(point), stable_if_negative=False)


def _doubled(point: Point) -> SwitchingProblem:
    """The cycle of twice the period. Its two phases set out in opposite directions: one arm."""
    twice = with_period(point.problem, 2 * point.curve.problem.period)
    return SwitchingProblem(twice, point.curve.free[0], both=False)


def _off_circle(everywhere: tuple[float, ...], point: Point) -> float:
    """The smallest ``mu_i mu_j - 1`` of all multipliers but those that the curve has
    `everywhere`, with the sign of the product of all of them."""
    matrix = units(point.base_point)
    values = np.linalg.eigvals(matrix).astype(complex)
    first, second = systems.pairs(systems.without(values, *everywhere))
    if not first.size:
        return math.nan
    # mu_i mu_j are the eigenvalues of the bialternate product of A with itself; an error e in each
    # multiplier moves a product by e (|mu_i| + |mu_j|)
    rounding = _ROUNDING * float(np.linalg.norm(matrix))
    return systems.least_with_sign(first * second - 1, rounding * (abs(first) + abs(second)))


def _multipliers(point: Point) -> NDArray[np.complex128]:
    return np.linalg.eigvals(units(point.base_point)).astype(complex)


def _circle_pair(point: Point) -> tuple[float, Array, Array]:
    """cos(angle) of the pair nearest the unit circle, and two vectors of its plane."""
    matrix = multiplier_matrix(point)
    small = _ZERO * max(1.0, float(np.linalg.norm(matrix, 2)))
    mu, first, second = systems.critical_plane(
        matrix, (1.0, -1.0), small, lambda values: np.abs(np.abs(values) - 1)
    )
    return mu.real / abs(mu), first, second


def _rotation_locus(point: Point) -> DefiningSystem:
    """``(A^2 - 2 cos(angle) A + 1) v = 0`` in the plane of the pair."""
    cosine, first, second = _circle_pair(point)
    # A^2 - 2 cos(angle) A + 1 = (A - mu) (A - conj(mu)) with |mu| = 1
    locus = systems.pair_locus("cosine", cosine, (first, second), 1.0, b=(0, -2), c=(1, 0))
    return replace(locus, events=_ON_ROTATION, meets=MEETINGS["NS"])


def _examine_rotation(point: Point) -> Examined:
    """Of the two multipliers with product 1: are they a complex pair?"""
    values = np.linalg.eigvals(multiplier_matrix(point)).astype(complex)
    first, second = systems.pairs(values)
    nearest = int(abs(first * second - 1).argmin())
    pair = np.array([first[nearest], second[nearest]])
    for sign, name in ((1, "R1"), (-1, "R2")):
        if (abs(pair - sign) < 1e-4).all():
            return f"both multipliers are {sign}: the resonance {name}"
    if not pair.imag.any():
        return f"a neutral saddle: the multipliers {pair[0].real:.4g} and {pair[1].real:.4g}"
    ground = point.base_point
    angle = math.acos(max(-1.0, min(1.0, point.detail.get("cosine", _circle_pair(ground)[0]))))
    return {"angle": angle} | normal_forms.criticality(
        "d", lambda: normal_forms.rotation_coefficient(point, angle), stable_if_negative=True
    )


# --- what their curves in two parameters meet -------------------------------------------------


def _fold_locus(point: Point) -> DefiningSystem:
    assert _PLAIN_FOLD.locus is not None
    return replace(_PLAIN_FOLD.locus(point), events=(cusp(), _R1_ON_FOLD), meets=MEETINGS["LP"])


def _examine_double(sign: int, point: Point) -> Examined:
    """Two multipliers there, with one eigenvector."""
    matrix = units(point.base_point)
    size = max(1.0, float(np.linalg.norm(matrix, 2)))
    critical = abs(np.linalg.eigvals(matrix) - sign) < 1e-4 * size
    if critical.sum() != 2:
        return f"{critical.sum()} multipliers are {sign}; two were expected"
    # rank n - 2 is two eigenvectors, rank n - 1 a Jordan block
    sizes = np.linalg.svd(matrix - sign * np.eye(len(matrix)), compute_uv=False)
    return f"two multipliers are {sign}, with two eigenvectors" if sizes[-2] < _RANK * size else {}


def _examine_double_one(point: Point) -> Examined:
    """Where it has to be distinguished from that: whether branches cross as well."""
    return _examine_double(1, point) or crossed(point.base_point)


def _on_circle(wanted: str, fold: bool, point: Point) -> Examined:
    """Whether the multipliers on the unit circle are those of `wanted`: of ``+1``, ``-1`` and
    ``pair`` each at most once. With `fold` the multiplier 1 must be that of a fold."""
    if fold and branches_cross(point.base_point):
        return "a branch point, not a fold"
    values = _multipliers(point)
    on = values[abs(abs(values) - 1) < 1e-4]
    critical = ["+1"] * int((abs(on - 1) < 1e-3).sum()) + ["-1"] * int((abs(on + 1) < 1e-3).sum())
    critical += ["pair"] * ((len(on) - len(critical)) // 2)
    if sorted(critical) != sorted(wanted.split()):
        shown, these = np.array2string(on, precision=6), wanted.replace(" ", " and ")
        return f"on the unit circle are {shown}, where {these} are expected"
    return ""


def _flip_coefficient(point: Point) -> float:
    """c without its poles, at R2 and fold-flips."""
    ground = point.base_point
    # <p, q> = 0 at R2, where -1 is double; F_x, which c is solved with, is singular at a fold-flip
    poles = systems.overlap(2.0, point) if ground.curve.size > 1 else 1.0
    c = normal_forms.value_or_nan(lambda: normal_forms.flip(point))
    return c * poles * systems.signed_smallest(units(ground) - np.eye(ground.curve.size))


def _examine_generalised_flip(point: Point) -> str:
    return normal_forms.not_zero("the coefficient c =", normal_forms.flip(point), point)


def _rotation_coefficient(point: Point) -> float:
    """Re d without its pole where it meets a fold; no value at R1, R2 and R3, where the normal form
    is another."""
    # d has a pole where 1 is a multiplier, det(A - 1) = 0: the test is their product
    ground, cosine = point.base_point, point["cosine"]
    if not -1 < cosine < 1:
        return math.nan
    d = normal_forms.value_or_nan(
        lambda: normal_forms.rotation_coefficient(point, math.acos(cosine))
    )
    return d * systems.signed_smallest(units(ground) - np.eye(ground.curve.size))


def _examine_chenciner(point: Point) -> str:
    d = normal_forms.rotation_coefficient(point, math.acos(point["cosine"]))
    return normal_forms.not_zero("Re d =", d, point)


def _resonance(k: int) -> Event:
    """Rk on a curve of NS: multipliers ``exp(+-2 pi i / k)``."""
    test = partial(_from_angle, 1, math.cos(2 * math.pi / k))
    return Event(f"R{k}", test, examine=partial(_on_circle, "pair", False))


def _from_angle(sign: int, cosine: float, point: Point) -> float:
    # the cosine is an unknown of the curve: no eigenvalue has to be asked for
    return float(sign * (point["cosine"] - cosine))


def _beside_pair(multiplier: int, point: Point) -> float:
    """Zero where one of the multipliers beside the pair on a curve of NS is 1 or -1."""
    cosine = point["cosine"]
    if not -1 < cosine < 1:
        return math.nan
    # on the circle: mu = cos(angle) + i sin(angle)
    pair = cosine + 1j * math.sqrt(1 - cosine**2)
    others = systems.without(_multipliers(point), pair, pair.conjugate())
    return systems.least_with_sign(others - multiplier, 0.0) if others.size else math.nan


_PLAIN_FOLD = fold()
_FOLD = replace(_PLAIN_FOLD, locus=_fold_locus, examine=partial(_examine_one, _PLAIN_FOLD))
_FLIP = Event("PD", systems.Singular(_flip_matrix), locus=_flip_locus, examine=_examine_flip)
_ROTATION = Event("NS", partial(_off_circle, ()), locus=_rotation_locus, examine=_examine_rotation)
_DOUBLE_ONE, _DOUBLE_MINUS_ONE = (partial(_examine_double, sign) for sign in (1, -1))
_R1_ON_FOLD = CodimensionTwo(
    "R1", partial(systems.overlap, 0.0), examine=_DOUBLE_ONE, base=_ROTATION
)
_R2_ON_FLIP = CodimensionTwo(
    "R2", partial(systems.overlap, 2.0), examine=_DOUBLE_MINUS_ONE, base=_ROTATION
)
_GENERALISED_FLIP = Event("GPD", _flip_coefficient, examine=_examine_generalised_flip)
_ON_ROTATION = (
    # beyond R1 and R2 the multipliers are real, their product still 1: neutral saddles
    CodimensionTwo(
        "R1", partial(_from_angle, -1, 1.0), examine=_examine_double_one, ends="domain", base=_FOLD
    ),
    CodimensionTwo(
        "R2", partial(_from_angle, 1, -1.0), examine=_DOUBLE_MINUS_ONE, ends="domain", base=_FLIP
    ),
    _resonance(3),
    _resonance(4),
    Event("CH", _rotation_coefficient, examine=_examine_chenciner),
)


def _named(
    on: str, event: Event, kind: str, wanted: str, test: Callable[[Point], float] | None = None
) -> CodimensionTwo:
    examine = partial(_on_circle, wanted, "+1" in wanted and on != "BP")
    plain = meeting(on, event)
    return replace(plain, kind=kind, examine=examine, test=test or plain.test)


# On the boundary of one kind, what the meeting with another is called, which multipliers are on
# the unit circle there, and the test of the other for those that the boundary has not.
MEETINGS: dict[str, Mapping[str, tuple[Event, ...]]] = {
    "LP": {
        "PD": (_named("LP", _FLIP, "LPPD", "+1 -1"),),
        "NS": (_named("LP", _ROTATION, "LPNS", "+1 pair", partial(_off_circle, (1,))),),
    },
    "PD": {
        "LP": (_named("PD", _FOLD, "LPPD", "+1 -1"),),
        "NS": (_named("PD", _ROTATION, "PDNS", "-1 pair", partial(_off_circle, (-1,))),),
    },
    "NS": {
        "LP": (_named("NS", _FOLD, "LPNS", "+1 pair", partial(_beside_pair, 1)),),
        "PD": (_named("NS", _FLIP, "PDNS", "-1 pair", partial(_beside_pair, -1)),),
    },
    "BP": {
        "PD": (_named("BP", _FLIP, "BP-PD", "+1 -1"),),
        "NS": (
            replace(_R1_ON_FOLD, examine=_examine_double_one),
            _named("BP", _ROTATION, "BP-NS", "+1 pair", partial(_off_circle, (1,))),
        ),
    },
}
_PLAIN_BRANCH_POINT = crossing_event(MEETINGS["BP"])
_BRANCH_POINT = replace(_PLAIN_BRANCH_POINT, examine=partial(_examine_one, _PLAIN_BRANCH_POINT))
EVENTS = (_FOLD, _BRANCH_POINT, _FLIP, _ROTATION)
