"""Fixed points and cycles of anybody's map: LP, BP, PD and NS, their curves and resonances.

The equations are ``G(x) - x = 0`` with G the map, or its iterate for a cycle: its multipliers are
the eigenvalues of F_x + 1.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import BadInput
from . import events as static
from . import normal_forms
from .boundary import met
from .branch import Point
from .codim2 import CROSSED, cusp, oriented_overlap, without
from .crossing import along
from .cycles import Iterate, Map, cycle, generic, multiplier_matrix, shorter, units, with_period
from .events import (
    Event,
    Locus,
    branch_point,
    branches_cross,
    frame,
    least_with_sign,
    signed_smallest,
)
from .newton import OUT_OF_DOMAIN, Undefined
from .problem import Curve, Params, Problem
from .seed import Seed

Array = NDArray[np.float64]

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
        ``jacobian(x, params) -> (n, n) array``, the derivative of the map itself.
    events : iterable of Event, optional
        LP, BP, PD and NS by default.
    record, domain, scales, label
        As of a `Problem`. The column ``unstable``, the number of multipliers outside the unit
        circle, is always there.

    Returns
    -------
    Problem
        To trace, to switch, to follow as boundaries. ``point.solution`` is a `Cycle`. A located
        PD knows the coefficient ``detail["c"]`` of its normal form, NS ``detail["angle"]`` and
        ``detail["d"]``, both their ``detail["criticality"]``. Boundaries meet, under the names of
        the field, CP, R1, R2, R3, R4, LPPD (fold-flip), LPNS, PDNS, GPD and CH.

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
    if isinstance(period, bool) or not isinstance(period, int | np.integer) or period < 1:
        raise BadInput(f"a period is a positive integer, got {period!r}")
    iterate = Iterate(map_, int(period), jacobian)
    return Problem(
        iterate,
        start,
        params,
        jacobian=None if jacobian is None else iterate.jacobian,
        events=EVENTS if events is None else tuple(events),
        record={**(record or {}), "unstable": lambda point: point.solution.unstable},
        domain=domain or {},
        scales=scales or {},
        interpret=cycle,
        images=iterate.phases,
        simpler=shorter,
        label=label or generic(iterate.period),
    )


# --- the events on a branch -------------------------------------------------------------------


def _with_multiplier_one(event: Event) -> Event:
    """An event at which a multiplier is 1, verified for that too: along cycles with multipliers far
    apart in size the derivative may look singular where it is not."""

    def verify(point: Point) -> str:
        assert event.verify is not None
        sizes = np.linalg.svd(units(point) - np.eye(point.curve.size), compute_uv=False)
        if sizes[-1] > _RANK * max(1.0, sizes[0]):
            return f"no multiplier is 1: the nearest is {sizes[-1]:.2g} off"
        return event.verify(point)

    return replace(event, verify=verify)


def _flip_test(point: Point) -> float:
    return signed_smallest(units(point) + np.eye(point.curve.size))


def _flip_places(*points: Point) -> Array:
    return static.singular_between(*(units(p) + np.eye(p.curve.size) for p in points))


def _null(matrix: Array, scales: Array) -> Array:
    """Unit null vector, or nearly so, of a matrix between unknowns in their scales."""
    vector = np.linalg.svd(matrix)[2][-1] * scales
    return np.asarray(vector / np.linalg.norm(vector))


def _flip_locus(point: Point) -> Locus:
    n = point.curve.size
    null = _null(units(point) + np.eye(n), point.curve.scales[:n])
    ends = (_GENERALISED_FLIP, _R2_ON_FLIP)
    return Locus({"null": null}, _flip_conditions, _flip_derivative, events=ends)


def _flip_conditions(curve: Curve, z: Array, null: Array) -> Array:
    return np.append(curve.jacobian(z)[:, : curve.size] @ null + 2 * null, null.dot(null) - 1)


def _flip_derivative(curve: Curve, z: Array, null: Array) -> Array:
    n = curve.size
    rows = np.zeros((n + 1, z.size + n))
    rows[:n, : z.size] = along(curve, z, null)
    rows[:n, z.size :] = curve.jacobian(z)[:, :n] + 2 * np.eye(n)
    rows[n, z.size :] = 2 * null
    return rows


def _flip_verify(point: Point) -> str:
    sizes = np.linalg.svd(units(point) + np.eye(point.curve.size), compute_uv=False)
    if sizes[-1] > _RANK * max(1.0, sizes[0]):
        return f"no multiplier is -1: the nearest is {sizes[-1]:.2g} off"
    if sizes.size > 1 and sizes[-2] < _RANK * max(1.0, sizes[0]):
        return "two multipliers are -1, with two eigenvectors: not a simple period doubling"
    return ""


def _flip_analysis(point: Point) -> Mapping[str, Any]:
    ground = point.ground
    try:
        c = normal_forms.flip(ground.curve, ground.z)
    except OUT_OF_DOMAIN as error:
        return {"criticality": f"unknown: {error}"}
    kind = normal_forms.criticality(c, stable_if_negative=False)
    return {"c": c.value.real, "criticality": kind}


def _doubled(point: Point) -> tuple[Seed, ...]:
    """The cycle of twice the period. Its two phases set out in opposite directions: one arm."""
    problem = point.problem
    iterate: Iterate = problem.residual  # type: ignore[assignment]
    curve = point.curve
    n = curve.size
    null = _null(units(point) + np.eye(n), curve.scales[:n])
    parent = point.tangent if point.tangent.size == n + 1 else None
    return (Seed(with_period(problem, 2 * iterate.period), point.z, np.append(null, 0.0), parent),)


def _pairs(values: NDArray[np.complex128]) -> tuple[Any, Any, NDArray[np.complex128]]:
    """All pairs of multipliers and by how much their product misses 1."""
    first, second = np.triu_indices(values.size, 1)
    return first, second, values[first] * values[second] - 1


def _rotation_test(point: Point) -> float:
    """The smallest ``mu_i mu_j - 1`` with the sign of the product of all of them."""
    matrix = units(point)
    return _least_gap(matrix, np.linalg.eigvals(matrix).astype(complex))


def _least_gap(matrix: Array, values: NDArray[np.complex128]) -> float:
    if values.size < 2:
        return math.nan
    first, second, gaps = _pairs(values)
    rounding = _ROUNDING * float(np.linalg.norm(matrix))
    return least_with_sign(gaps, rounding * (abs(values[first]) + abs(values[second])))


def _circle_pair(point: Point) -> tuple[float, Array, Array]:
    """cos(angle) of the pair nearest the unit circle, and two vectors of its plane."""
    matrix = multiplier_matrix(point)
    values, vectors = np.linalg.eig(matrix)
    for sign in (1.0, -1.0):
        if (abs(values - sign) < _ZERO * max(1.0, float(np.linalg.norm(matrix, 2)))).sum() == 2:
            shifted = matrix - sign * np.eye(len(matrix))
            null = np.linalg.svd(shifted)[2][-1]
            return sign, np.linalg.lstsq(shifted, null)[0], null
    upper = np.flatnonzero(values.imag > 0)
    if not upper.size:
        raise Undefined("no complex pair of multipliers: a neutral saddle, not NS")
    nearest = upper[np.argmin(abs(abs(values[upper]) - 1))]
    vector, mu = vectors[:, nearest], values[nearest]
    return float(mu.real / abs(mu)), vector.real, vector.imag


def _rotation_locus(point: Point) -> Locus:
    """``(A^2 - 2 cos(angle) A + 1) v = 0`` in the plane of the pair."""
    cosine, real, imaginary = _circle_pair(point)
    null, reference = frame(real, imaginary)

    def conditions(curve: Curve, z: Array, extra: Array) -> Array:
        null, cosine = extra[:-1], extra[-1]
        matrix = curve.jacobian(z)[:, : curve.size] + np.eye(curve.size)
        turned = matrix @ null
        own = matrix @ turned - 2 * cosine * turned + null
        return np.concatenate([own, [null.dot(null) - 1, reference.dot(null)]])

    def derivative(curve: Curve, z: Array, extra: Array) -> Array:
        null, cosine, n = extra[:-1], extra[-1], curve.size
        matrix = curve.jacobian(z)[:, :n] + np.eye(n)
        turned = matrix @ null
        change = along(curve, z, null)
        rows = np.zeros((n + 2, z.size + n + 1))
        rows[:n, : z.size] = along(curve, z, turned) + matrix @ change - 2 * cosine * change
        rows[:n, z.size : -1] = matrix @ matrix - 2 * cosine * matrix + np.eye(n)
        rows[:n, -1] = -2 * turned
        rows[n, z.size : -1], rows[n + 1, z.size : -1] = 2 * null, reference
        return rows

    return Locus({"null": null, "cosine": cosine}, conditions, derivative, events=_ON_ROTATION)


def _rotation_verify(point: Point) -> str:
    """Of the two multipliers with product 1: are they a complex pair?"""
    values = np.linalg.eigvals(multiplier_matrix(point)).astype(complex)
    first, second, gaps = _pairs(values)
    nearest = int(abs(gaps).argmin())
    pair = values[[first[nearest], second[nearest]]]
    for sign, name in ((1, "R1"), (-1, "R2")):
        if (abs(pair - sign) < 1e-4).all():
            return f"both multipliers are {sign}: the resonance {name}"
    if not pair.imag.any():
        return f"a neutral saddle: the multipliers {pair[0].real:.4g} and {pair[1].real:.4g}"
    return ""


def _rotation_analysis(point: Point) -> Mapping[str, Any]:
    ground = point.ground
    angle = math.acos(max(-1.0, min(1.0, point.detail.get("cosine", _circle_pair(ground)[0]))))
    try:
        d = normal_forms.rotation(ground.curve, ground.z, angle)
    except OUT_OF_DOMAIN as error:
        return {"angle": angle, "criticality": f"unknown: {error}"}
    kind = normal_forms.criticality(d, stable_if_negative=True)
    return {"angle": angle, "d": complex(d.value), "criticality": kind}


# --- what their curves in two parameters meet -------------------------------------------------


def _fold_locus(point: Point) -> Locus:
    locus = static.fold().locus(point)  # type: ignore[misc]  # a fold has one
    return replace(locus, events=(cusp(), _R1_ON_FOLD))


def _overlap(sign: int) -> Callable[[Point], float]:
    """Zero where the multiplier of a curve of folds (1) or doublings (-1) is double."""

    def test(point: Point) -> float:
        matrix = multiplier_matrix(point.ground)
        return oriented_overlap(matrix - sign * np.eye(len(matrix)))

    return test


def _double_verify(sign: int) -> Callable[[Point], str]:
    """Two multipliers there, with one eigenvector."""

    def verify(point: Point) -> str:
        matrix = units(point.ground)
        size = max(1.0, float(np.linalg.norm(matrix, 2)))
        near = abs(np.linalg.eigvals(matrix) - sign) < 1e-4 * size
        if near.sum() != 2:
            return f"{near.sum()} multipliers are {sign}; two were wanted"
        sizes = np.linalg.svd(matrix - sign * np.eye(len(matrix)), compute_uv=False)
        if sizes[-2] < _RANK * size:
            return f"two multipliers are {sign}, with two eigenvectors"
        return ""

    return verify


def _double_one_analysis(point: Point) -> Mapping[str, Any]:
    return {"degenerate": CROSSED} if branches_cross(point.ground) else {}


def _on_circle(wanted: str, *, fold: bool = False) -> Callable[[Point], str]:
    """Whether the multipliers on the unit circle are those of `wanted`: of ``+1``, ``-1`` and
    ``pair`` each at most once. With `fold` the multiplier 1 must be that of a fold."""

    def verify(point: Point) -> str:
        if fold and branches_cross(point.ground):
            return "a branch point, not a fold"
        values = np.linalg.eigvals(units(point.ground)).astype(complex)
        on = values[abs(abs(values) - 1) < 1e-4]
        found = ["+1"] * int((abs(on - 1) < 1e-3).sum()) + ["-1"] * int((abs(on + 1) < 1e-3).sum())
        found += ["pair"] * ((len(on) - len(found)) // 2)
        if sorted(found) != sorted(wanted.split()):
            shown = np.array2string(on, precision=6)
            return f"on the unit circle are {shown}, where {wanted.replace(' ', ' and ')} are meant"
        return ""

    return verify


def _flip_coefficient(point: Point) -> float:
    """c without its poles, at R2 and fold-flips."""
    ground = point.ground
    poles = _overlap(-1)(point) if ground.curve.size > 1 else 1.0
    c = normal_forms.value_or_nan(lambda: normal_forms.flip(ground.curve, ground.z))
    return c * poles * signed_smallest(units(ground) - np.eye(ground.curve.size))


def _generalised_flip_verify(point: Point) -> str:
    ground = point.ground
    c = normal_forms.flip(ground.curve, ground.z)
    if abs(c.value.real) > 1e-6 * (c.size + _unit(ground)):
        return f"the coefficient c = {c.value.real:.2g} is not zero"
    return ""


def _unit(ground: Point) -> float:
    """Size of a cubic coefficient of order one, in the units of the point."""
    return normal_forms.Forms(ground.curve, ground.z).reach ** -2


def _rotation_coefficient(point: Point) -> float:
    """Re d without its pole where a fold is met; no value at R1, R2 and R3, where the normal form
    is another."""
    ground, cosine = point.ground, point["cosine"]
    if not -1 < cosine < 1:
        return math.nan
    d = normal_forms.value_or_nan(
        lambda: normal_forms.rotation(ground.curve, ground.z, math.acos(cosine))
    )
    return d * signed_smallest(units(ground) - np.eye(ground.curve.size))


def _chenciner_verify(point: Point) -> str:
    ground = point.ground
    d = normal_forms.rotation(ground.curve, ground.z, math.acos(point["cosine"]))
    if abs(d.value.real) > 1e-6 * (d.size + _unit(ground)):
        return f"Re d = {d.value.real:.2g} is not zero"
    return ""


def _resonance(k: int) -> Event:
    """Rk on a curve of NS: multipliers ``exp(+-2 pi i / k)``."""
    cosine = math.cos(2 * math.pi / k)
    return Event(f"R{k}", lambda point: point["cosine"] - cosine, verify=_on_circle("pair"))


_PLAIN_FOLD = replace(_with_multiplier_one(static.fold()), locus=_fold_locus)
_PLAIN_FLIP = Event(
    "PD",
    _flip_test,
    places=_flip_places,
    locus=_flip_locus,
    verify=_flip_verify,
    analysis=_flip_analysis,
    arms=_doubled,
)
_PLAIN_ROTATION = Event(
    "NS",
    _rotation_test,
    locus=_rotation_locus,
    verify=_rotation_verify,
    analysis=_rotation_analysis,
)


def _meeting(
    kind: str,
    on: str,
    event: Event,
    wanted: str,
    test: Callable[[Point], float] | None = None,
) -> dict[str, tuple[Event, ...]]:
    """On the boundary `on`, what meeting `event` there is called."""
    verify = _on_circle(wanted, fold="+1" in wanted and on != "BP")
    named = replace(met(on, event), kind=kind, verify=verify, analysis=None, arms=None)
    return {on: (named if test is None else replace(named, test=test),)}


def _pair_beside(multiplier: int) -> Callable[[Point], float]:
    """The test of NS on a curve of folds (1) or doublings (-1), for all other multipliers."""

    def test(point: Point) -> float:
        matrix = units(point.ground)
        values = np.linalg.eigvals(matrix).astype(complex)
        return _least_gap(matrix, without(values, multiplier))

    return test


def _beside_pair(multiplier: int) -> Callable[[Point], float]:
    """Zero where one of the multipliers beside the pair on a curve of NS is 1 or -1."""

    def test(point: Point) -> float:
        cosine = point["cosine"]
        if not -1 < cosine < 1:
            return math.nan
        pair = cosine + 1j * math.sqrt(1 - cosine**2)
        values = np.linalg.eigvals(units(point.ground)).astype(complex)
        others = without(values, pair, pair.conjugate())
        return least_with_sign(others - multiplier, 0.0) if others.size else math.nan

    return test


_R1_ON_FOLD = Event("R1", _overlap(1), verify=_double_verify(1), met=_PLAIN_ROTATION)
_R2_ON_FLIP = Event("R2", _overlap(-1), verify=_double_verify(-1), met=_PLAIN_ROTATION)
_GENERALISED_FLIP = Event("GPD", _flip_coefficient, verify=_generalised_flip_verify)
_ON_ROTATION = (
    # beyond R1 and R2 the multipliers are real, their product still 1: neutral saddles
    Event(
        "R1",
        lambda point: 1 - point["cosine"],
        terminal=True,
        positive=True,
        verify=_double_verify(1),
        analysis=_double_one_analysis,
        met=_PLAIN_FOLD,
    ),
    Event(
        "R2",
        lambda point: 1 + point["cosine"],
        terminal=True,
        positive=True,
        verify=_double_verify(-1),
        met=_PLAIN_FLIP,
    ),
    _resonance(3),
    _resonance(4),
    Event("CH", _rotation_coefficient, verify=_chenciner_verify),
)

_FOLD_OF_MAP = replace(
    _PLAIN_FOLD,
    meets={
        **_PLAIN_FOLD.meets,
        **_meeting("LPPD", "PD", _PLAIN_FOLD, "+1 -1"),
        **_meeting("LPNS", "NS", _PLAIN_FOLD, "+1 pair", _beside_pair(1)),
    },
)
_FLIP = replace(
    _PLAIN_FLIP,
    meets={
        **_meeting("LPPD", "LP", _PLAIN_FLIP, "+1 -1"),
        **_meeting("PDNS", "NS", _PLAIN_FLIP, "-1 pair", _beside_pair(-1)),
        **_meeting("BP-PD", "BP", _PLAIN_FLIP, "+1 -1"),
    },
)
_ROTATION = replace(
    _PLAIN_ROTATION,
    meets={
        **_meeting("LPNS", "LP", _PLAIN_ROTATION, "+1 pair", _pair_beside(1)),
        **_meeting("PDNS", "PD", _PLAIN_ROTATION, "-1 pair", _pair_beside(-1)),
        "BP": (
            replace(_R1_ON_FOLD, analysis=_double_one_analysis),
            *_meeting("BP-NS", "BP", _PLAIN_ROTATION, "+1 pair", _pair_beside(1))["BP"],
        ),
    },
)
EVENTS = (_FOLD_OF_MAP, _with_multiplier_one(branch_point()), _FLIP, _ROTATION)


def fixed_point_fold() -> Event:
    """LP of a map: two cycles meet, a multiplier is +1.

    As a curve it meets CP, R1 (the multiplier is double), LPPD (another one is -1: fold-flip) and
    LPNS (a pair is on the unit circle).

    Examples
    --------
    >>> import contbreather as cb
    >>> mine = FixedPoint(lambda x, p: x + p["h"] - x * x, {"x": 0.5}, {"h": 0.25},
    ...                   events=[fixed_point_fold()])
    >>> point = cb.trace(mine, "h", within={"x": (-0.5, 1)}).first("LP")
    >>> abs(point["h"]) < 1e-12
    True
    """
    return _FOLD_OF_MAP


def period_doubling() -> Event:
    """PD of a map: a multiplier is -1, and a cycle of twice the period leaves, which `switch`
    follows.

    ``detail["c"]`` is the coefficient of ``u -> -u + c u^3`` (for the eigenvector of length 1);
    positive: the doubled cycle is born stable (on the centre manifold), ``detail["criticality"]``
    is ``"supercritical"``. As a curve it meets GPD (c vanishes), R2, LPPD and PDNS.

    Examples
    --------
    >>> import contbreather as cb
    >>> mine = FixedPoint(lambda x, p: -(1 + p["m"]) * x - x**2, {"x": 0.0}, {"m": -0.1},
    ...                   events=[period_doubling()])
    >>> point = cb.trace(mine, "m", within={"m": (-0.5, 0.5)}).first("PD")
    >>> round(point.detail["c"], 9), point.detail["criticality"]
    (1.0, 'supercritical')
    """
    return _FLIP


def neimark_sacker() -> Event:
    """NS of a map: a complex pair of multipliers is on the unit circle.

    ``detail["angle"]`` is its angle, ``detail["d"]`` the coefficient of
    ``w -> exp(i angle) w (1 + d |w|^2)``; its real part negative: a closed curve is born stable,
    ``detail["criticality"]`` is ``"supercritical"``. Two real multipliers with product 1 (a
    neutral saddle) are told apart. As a curve, on which ``cosine`` is that of the angle, it meets
    R3, R4, CH (Re d vanishes), LPNS and PDNS, and ends at R1 and R2.

    Examples
    --------
    >>> import contbreather as cb, numpy as np
    >>> mine = FixedPoint(lambda u, p: np.array([p["r"] * u[0] * (1 - u[1]), u[0]]),
    ...                   {"x": 0.4, "y": 0.4}, {"r": 1.7}, events=[neimark_sacker()])
    >>> point = cb.trace(mine, "r", within={"r": (1.5, 2.5)}).first("NS")
    >>> round(point["r"], 9), round(point.detail["angle"] / np.pi, 9)
    (2.0, 0.333333333)
    """
    return _ROTATION
