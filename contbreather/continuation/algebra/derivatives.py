"""Derivatives of a residual that came without: complex steps where they hold, else differences.

Differences tell as well what is wrong with derivatives that were given.
"""

from __future__ import annotations

import functools
import math
import warnings
from collections.abc import Callable, Collection, Iterable
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .newton import OUT_OF_DOMAIN, Array, Undefined
from .sparse import Pattern, row_sizes

Function = Callable[[Array], Array]
Scheme = Callable[..., Array]  # scheme(function, z, columns=None)

IMAGINARY = 1e-30  # a complex step has no cancellation, so it may be as small as this
RELATIVE = np.finfo(float).eps ** 0.2  # best step of the five-point formula
_FINER = (1.0, 64.0, 64.0**2, 64.0**3)  # what a step is divided by until it suits the function


def differences(
    function: Function,
    z: Array,
    columns: Iterable[int] | None = None,
    *,
    scales: Array | None = None,
    finer: Array | float = 1.0,
    one_sided: bool = False,
    kinks: Collection[int] = (),
    own_side: bool = False,
) -> Array:
    """Five-point central differences, one column for each entry of `z`; about 1e-12 relative.

    Steps are relative to ``max(|z|, scales)`` and divided by `finer`; next to an edge, where a
    step would leave the domain, shorter ones are taken, and with `one_sided` at the edge itself
    steps to one side. Along entries in `kinks` the function may have one at `z`: the mean of both
    sides, each by itself.
    """
    steps = RELATIVE * np.maximum(1.0 if scales is None else scales, abs(z)) / finer
    slopes, kinked = list[Array](), {*map(int, kinks)}

    def to_one_side(part: float) -> Array:
        # over {0..4} h; off by h^4 / 5 of the fifth derivative
        weights, h = (-25 / 12, 4.0, -3.0, 4 / 3, -0.25), part * step
        rows = (w * np.array(function(z + j * h * unit)) for j, w in enumerate(weights))
        return np.asarray(sum(rows) / h)

    for i in range(z.size) if columns is None else columns:
        unit, step = np.eye(1, z.size, i)[0], steps[i]
        if i in kinked:
            slopes.append((to_one_side(0.5) + to_one_side(-0.5)) / 2)
            continue
        try:
            column = shortened(function, z, unit, step, own_side=own_side)
        except OUT_OF_DOMAIN:
            if not one_sided:
                raise
            try:
                column = to_one_side(1 / 64)
            except OUT_OF_DOMAIN:
                column = to_one_side(-1 / 64)
        slopes.append(column)
    return np.stack(slopes, axis=-1)


def shortened(
    function: Function, z: Array, way: Array, step: Any, alike: int | tuple[()] = (), *,
    own_side: bool = True,
) -> Array:  # fmt: skip
    """Differentiate along a way by a step, and by shorter ones where that leaves the domain; on its
    `own_side` also each entry whose differences reach over a kink or a jump beside `z`."""
    slope, uneven = np.array(math.nan), np.array(True)
    for shorter in (1, 64, 4096):
        h = step / shorter
        try:
            change, even = central(function, z, way * h, alike)
        except OUT_OF_DOMAIN:
            if shorter == 4096:
                raise
            continue
        slope = np.where(uneven & (even | ~np.isfinite(slope)), change / h, slope)
        uneven = uneven & ~even
        if not (own_side and uneven.any()) and np.isfinite(slope).all():
            break
    return slope


def directional(function: Function, z: Array, step: Array) -> Array:
    """``step . grad`` of `function` at `z` by the five-point formula over ``z + {-2..2} step``."""
    return central(function, z, step)[0]


def central(
    function: Function, z: Array, step: Array, alike: int | tuple[()] = ()
) -> tuple[Array, NDArray[np.bool_]]:
    """Give the same, and whether both central differences are proportional to the step, but for a
    cube of it, compared with the largest of the places that are `alike`, an axis: they are not
    beside a kink or a jump, nor is NaN, nor rounding."""
    # np.array copies: a function may return the same array each time, written anew
    near = np.array(function(z + step)) - function(z - step)
    far = np.array(function(z + 2 * step)) - function(z - 2 * step)
    even: NDArray[np.bool_] = abs(2 * near - far) <= 1e-3 * abs(near).max(axis=alike, keepdims=True)
    # off by h^4 / 30 of the fifth derivative; rounding, eps / h, is as large at h = eps^(1/5)
    return np.asarray((8 * near - far) / 12), even


@np.errstate(over="ignore", invalid="ignore", divide="ignore")
def along(
    function: Function, z: Array, vector: Array, scales: Array, *, ahead: bool = False,
    prepare: Callable[[list[Array]], object] = list,
) -> Array:  # fmt: skip
    """``vector . grad`` of a matrix-valued function, by the step that suits function and vector.

    The first step is relative to the entries that the vector moves; an idle one of size 100 says
    nothing about it. With `ahead` all places are on the side to which the vector points, for a
    function with a kink in z; at an edge of its domain they are on the side that has values.
    What is dear may `prepare` for the places that are asked first. Raises `Undefined` where it has
    no value.
    """
    size = math.sqrt(float(np.sum((vector / np.maximum(scales, abs(z))) ** 2)))
    first, here = 2e-3 / max(size, 1e-300), function(z)
    with suppress(*OUT_OF_DOMAIN):
        prepare([z + first / part * vector for part in (1, -1, 2, -2, 4, -4)])

    def has_value(h: float) -> bool:
        with suppress(*OUT_OF_DOMAIN):
            function(z + h * vector)
            return True
        return False

    # not by shorter steps to both: at an edge of 1 these would end when rounding takes them to 1
    if side := 0 if ahead else has_value(first) - has_value(-first):
        return side * along(function, z, side * vector, scales, ahead=True)
    # a change that is smaller, relative to the function, is measured by the function
    floor = 1e-2 * size * row_sizes(here, scales) + 1e-300

    def difference(h: float) -> list[Array]:
        there = function(z + h * vector)
        behind, width = (here, h) if ahead else (function(z - h * vector), 2 * h)
        return [(there - behind) / width]

    def apart(fine: list[Array], coarse: list[Array]) -> float:
        change = row_sizes(fine[0] - coarse[0], scales)
        return float((change / (row_sizes(fine[0], scales) + floor)).max())

    # an estimate belongs to the next lower order: a change of 1e-6 between two orders is an error
    # of 1e-11
    return extrapolated(difference, apart, first, 1e-6, ratio=2 if ahead else 4)[0]


def extrapolated(
    differences: Callable[[float], list[Any]], apart: Callable[[list[Any], list[Any]], float],
    h: float, agreed: float, *, ratio: int = 4,
) -> list[Any]:  # fmt: skip
    """Extrapolate differences while their step is halved, from a first one on, until two orders
    agree, or rounding makes them part again."""
    best, doubt, before = list[Any](), math.inf, list[list[Any]]()
    for _ in range(24):
        try:
            row = [differences(h)]
        except OUT_OF_DOMAIN:
            before, h = [], h / 8
            continue
        for k, coarse in enumerate(before, 1):
            # Richardson: the error of central differences is a series in h^2, of others in h, and
            # h was halved
            pairs = zip(row[-1], coarse, strict=True)
            row.append([fine + (fine - rough) / (ratio**k - 1) for fine, rough in pairs])
        off = apart(row[-1], before[-1]) if before else 0.0
        if before and off < doubt:
            best, doubt = row[-1], off
        # an agreement to 1e-3 that gets worse was as good as rounding allows
        if doubt < agreed or (doubt < 1e-3 and off > 4 * doubt):
            break
        # what changes this much from one step to its half tells nothing yet
        far = off > 0.1
        before, h = [] if far else row[:3], h / (8 if far else 2)  # four orders
    if not best:
        raise Undefined("the equations have no value around the point")
    return best


def complex_steps(function: Function, z: Array, columns: Iterable[int] | None = None) -> Array:
    """Derivatives by imaginary perturbation, exact to rounding where `function` is analytic.

    Raises `Undefined` where there is none, as of a root at the edge of its domain.
    """
    shifted = z.astype(complex)

    def moved(i: int, step: float) -> Array:
        # Im f(z + ih) / h = f' - h^2 f''' / 6 + ...
        # (W. Squire and G. Trapp, SIAM Rev. 40, 110, 1998)
        shifted[i] += 1j * step
        rows = function(shifted).imag
        shifted[i] = z[i]
        return rows

    columns = range(z.size) if columns is None else [*columns]
    matrix = np.array([moved(i, IMAGINARY) for i in columns]).T.copy() / IMAGINARY
    # the imaginary part of sqrt(ih) is as large, and in no proportion to h
    sizes, large = abs(matrix), 1e-3 / math.sqrt(IMAGINARY)
    if sizes.max(initial=0.0) > large:
        shorter = np.array([moved(i, IMAGINARY / 16) for i in columns]).T * (16 / IMAGINARY)
        if np.any((sizes > large) & (abs(shorter) > 2 * sizes)):
            raise Undefined("the derivatives are not finite")
    return matrix


def choose(function: Function, z: Array, scales: Array, rounding: float = 0.0) -> Scheme:
    """Complex steps if they agree with differences at `z`; anything not analytic does not, but for
    `abs` at its kink: that it is not, is told. Values may be off by `rounding` besides the rounding
    of each."""
    wanted, doubt, finer = estimate(function, z, scales, rounding)
    fallback = functools.partial(differences, scales=scales, finer=finer, own_side=True)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            warnings.simplefilter("error", np.exceptions.ComplexWarning)
            exact = complex_steps(function, z)
    except Exception:  # noqa: BLE001 - what is asked an unheard-of question may raise anything
        return fallback
    return complex_steps if misfit(exact, wanted, doubt) is None else fallback


def estimate(
    function: Function, z: Array, scales: Array, rounding: float = 0.0
) -> tuple[Array, Array, Array]:
    """Differences, how far each can be trusted, and the `finer` that suits each column.

    A column is NaN where the function has no values to either side, or nothing can be told.
    """
    best: Array = np.full((1, z.size), np.nan)
    doubt = np.full((1, z.size), np.inf)
    finer = np.ones(z.size)
    poor = np.arange(z.size)
    for factor in _FINER:
        try:
            coarse = differences(function, z, poor, scales=scales, finer=factor)
            fine = differences(function, z, poor, scales=scales, finer=8 * factor)
        except OUT_OF_DOMAIN:
            continue
        if len(best) != len(fine):  # the first that could be had
            best, doubt = (np.resize(row, (len(fine), z.size)) for row in (best, doubt))
        # an eighth of the step: 8^4 times less of what the formula leaves, 8 times more rounding
        apart = abs(coarse - fine)
        better = apart.max(axis=0) < doubt[:, poor].max(axis=0)
        where = poor[better]
        best[:, where], doubt[:, where] = fine[:, better], apart[:, better]
        finer[where] = 8 * factor if factor > 1 else 1.0
        # differences with two steps agree this well where they can be trusted
        poor = poor[~(apart.max(axis=0) <= 1e-7 * abs(fine).max(axis=0))]
        if not poor.size:
            break
    sizes = np.maximum(scales, abs(z))
    terms = np.nan_to_num(abs(best) * sizes).max(axis=1)  # what each row adds up, and rounds
    # rounding of the terms of a row, divided by the relative step
    terms = 1e-11 * terms + rounding / RELATIVE
    rounded = terms[:, None] * finer / sizes
    # beside a pole two steps have no digit in common
    best[:, 10 * doubt.max(axis=0) > np.maximum(abs(best), rounded).max(axis=0)] = np.nan
    return best, doubt + rounded, finer


def misfit(jacobian: Array, wanted: Array, doubt: Array) -> tuple[int, int] | None:
    """The entry where a Jacobian is furthest off what differences can tell, if any is."""
    wanted, doubt = np.broadcast_to(wanted, jacobian.shape), np.broadcast_to(doubt, jacobian.shape)
    # ten times what differences seem to be off by, and six digits at best
    off = abs(jacobian - wanted) - (10 * doubt + 1e-6 * abs(wanted))
    off[~np.isfinite(jacobian)] = np.inf
    off[~np.isfinite(wanted)] = -np.inf  # differences cannot tell here
    row, column = np.unravel_index(np.argmax(off), off.shape)
    return (int(row), int(column)) if off[row, column] > 0 else None


def wrong_row(
    function: Function, z: Array, jacobian: Callable[[Array], Any], direction: Array
) -> int | None:
    """The row of a derivative that is furthest off what differences tell along a direction.

    One that is made of differences itself is rounded: by as much as it differs at a place all but
    the same.
    """
    wanted, doubt, _ = estimate(lambda t: function(z + t[0] * direction), np.zeros(1), np.ones(1))
    slopes = (jacobian(z) @ direction)[:, None]
    if wrong := misfit(slopes, wanted, doubt):
        rounded = abs((jacobian(z + 1e-9 * direction) @ direction)[:, None] - slopes)
        wrong = misfit(slopes, wanted, doubt + rounded)
    return wrong and wrong[0]


def wrong_in_row(
    function: Function, z: Array, matrix: Any, row: int, direction: Array, given: Any
) -> str:
    """The wrong entry of one row of a derivative, by halving the columns that hold it; where a
    pattern was given, the entry that it misses."""

    def slopes(way: Array) -> tuple[float, float]:
        wanted = differences(lambda t: function(z + t[0] * way), np.zeros(1))
        return float((matrix @ way)[row]), float(wanted[row, 0])

    columns, pattern = np.arange(z.size), given if isinstance(given, Pattern) else None
    if pattern is not None:
        known = pattern.columns[pattern.matrix.indices == row]
        columns = np.setdiff1d(columns[: matrix.shape[0]], known)
    small = 1e-6 * abs(matrix[[row]]).max()
    # log2(n) differences in place of n, which a large problem has many of
    while columns.size > 1:
        half = columns[: (columns.size + 1) // 2]
        slope, wanted = slopes(np.where(np.isin(np.arange(z.size), half), direction, 0.0))
        columns = half if abs(slope - wanted) > small else columns[half.size :]
    entry = (row, int(columns[0]))
    slope, wanted = slopes(np.eye(1, z.size, entry[1])[0])
    if pattern is not None:
        return f"it misses entry {entry}, which is {wanted:.8g} by differences"
    return f"its entry {entry} is {slope:.8g}, differences give {wanted:.8g}"
