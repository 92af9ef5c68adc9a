"""On the band of the infinite chain: the curve D(mu) traces there, and where it meets zero.

For mu = exp(i pi nu) on the arc, 0 < nu < 2 sqrt(gamma), R, B, C are real and the in-band alias is
``g = -i/v``, ``v = nu sqrt(4 gamma - nu^2)``. We follow ``F = v D``, bounded on the closed arc:

    F = (v D_r + L_i/pi) + i (v D_i - L_r/pi),
    D_r = d^2 - c^2 R^2 + B beta,  D_i = 2 c d R,  beta = b - c^2 C,
    L_r = -(2 c^2 nu R + beta + c^2 nu^2 B),  L_i = 2 c d nu.

F = 0 is a Neimark-Sacker point. Eliminating beta leaves one real equation for its angle, with
the letter q = 2 d/c of (13),

    (R + nu B)^2 - q (nu/(pi v) - pi v R B) - q^2/4 = 0,   b = c^2 (C - 2 nu R - nu^2 B - pi q v R),

so at given gamma and k the Neimark-Sacker points are roots in one variable, each with an explicit
b. Band angles are sampled as nu = 2 sqrt(gamma) sin(alpha), which resolves the square root at the
edge; R, B, C on a fixed grid in alpha depend on gamma alone and are remembered.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from contbreather.checks import number, shown
from contbreather.errors import BadInput
from contbreather.lattice import InfiniteChain, check_gamma
from contbreather.stability import arc_loops
from contbreather.stability.aliases import regular, regular_by_spring, regular_slopes, tables
from contbreather.stability.saltation import check_finite, check_kb

Array = NDArray[Any]

GRID = 64  # intervals of the remembered grid in alpha; refinement does the rest
COARSE = 24  # of the grid for many windows at once
_ENOUGH = 1e-7  # in alpha, for these
_ON_ARC, _WINDOW = arc_loops.ON_ARC, arc_loops.WINDOW


class Arc(NamedTuple):
    """Samples on the band: alpha in [0, pi/2], nu, v = nu sqrt(4 gamma - nu^2), R, B, C; or a
    direction in which they change."""

    alpha: Any
    nu: Any
    v: Any
    R: Any
    B: Any
    C: Any


def angle(gamma: Any, alpha: Any, spring: float = 0.0) -> Any:
    """nu, the frequency of the wave ``theta = 2 alpha``."""
    sine = 2.0 * np.sqrt(gamma) * np.sin(alpha)
    return np.sqrt(spring + sine * sine) if spring else sine


def sample(gamma: Any, alpha: Array, spring: float = 0.0) -> Arc:
    """R, B, C at ``nu^2 = spring + 4 gamma sin(alpha)^2``."""
    nu = angle(gamma, alpha, spring)
    v = 4.0 * gamma * np.sin(alpha) * np.cos(alpha)
    return Arc(alpha, nu, v, *regular(gamma, nu, None, spring))


@lru_cache(maxsize=64)
def grid(gamma: float, spring: float = 0.0) -> Arc:
    """`sample` on the fixed grid; what a branch in a, k or b uses again and again."""
    arc = sample(gamma, np.linspace(0.0, 0.5 * math.pi, GRID + 1), spring)
    for column in arc:
        column.setflags(write=False)
    return arc


def curve(arc: Arc, k: float, b: float) -> tuple[Array, Array]:
    """F = v D on the arc, and v times the continuation of D from inside the circle (g -> -g)."""
    _, nu, v, R, B, C = arc
    c, d = 1.0 + k, 0.5 * (1.0 - k)
    cc = c * c
    beta = b - cc * C
    smooth = v * (d * d - cc * R * R + B * beta + 2j * c * d * R)
    pole = (2.0 * c * d * nu + 1j * (cc * nu * (2.0 * R + nu * B) + beta)) / math.pi
    return smooth + pole, smooth - pole


def on_band(gamma: float, nu: ArrayLike, spring: float) -> tuple[Array, Array, Array]:
    """Angles inside the band, and how far their squares are from those of its ends."""
    try:
        x = np.asarray(nu, dtype=float)
    except (TypeError, ValueError):
        x = np.array(math.nan)
    low = x * x - spring
    high = 4.0 * gamma - low
    if not np.all((x > 0.0) & (low > 0.0) & (high > 0.0)):
        raise BadInput(
            f"nu = {shown(nu)}: the band of gamma = {gamma} has angles between "
            f"{math.sqrt(spring):.6g} and {math.sqrt(spring + 4.0 * gamma):.6g} (times pi); choose "
            "one of them."
        )
    return x, low, high


class OnArc(NamedTuple):
    """(Re, Im) of F = nu sqrt(4 gamma - nu^2) D at an angle in the band, and its derivatives.

    Each is an array of shape (2,) (or (2, ...) for an array of angles).
    """

    value: Array
    d_nu: Array
    d_gamma: Array
    d_k: Array
    d_b: Array
    d_spring: Array


def on_arc(gamma: float, nu: float, k: float, b: float, spring: float = 0.0) -> OnArc:
    """The two equations of a Neimark-Sacker point of the infinite chain, with their Jacobian.

    F has the zeros of D, the limit from |mu| > 1 at mu = exp(i pi nu), but no poles at the ends
    of the band.

    Parameters
    ----------
    gamma, k, b : float
        Coupling, restitution, off-diagonal entry of the saltation matrix (19).
    nu : float
        Angle/pi inside the band.
    spring : float
        That holds every site to the ground.

    Raises
    ------
    BadInput
        If nu is not inside the band.

    Examples
    --------
    >>> angle, b = neimark_sacker(0.1, 0.8)[0]
    >>> bool(abs(on_arc(0.1, angle, 0.8, b).value).max() < 1e-14)
    True
    """
    gamma = check_gamma(gamma, spring)
    check_finite(k, b)
    x, low, high = on_band(gamma, nu, spring)
    code = _ON_ARC.code() if spring == 0.0 and not x.ndim else None
    if code is not None:
        return OnArc(*_called(code, (gamma, k, 0.0, b, float(x))).reshape(6, 2))
    value, in_nu, in_gamma = regular_slopes(gamma, x, None, spring)
    by_spring = regular_by_spring(gamma, x, spring)
    v, nothing = np.sqrt(low * high), (0.0, 0.0, 0.0)
    arc = Arc(x, x, v, *value)
    directions = (
        (Arc(0.0, 1.0, x * (high - low) / v, *in_nu), 0.0, 0.0),
        (Arc(0.0, 0.0, 2.0 * low / v, *in_gamma), 0.0, 0.0),
        (Arc(0.0, 0.0, 0.0, *nothing), 1.0, 0.0),
        (Arc(0.0, 0.0, 0.0, *nothing), 0.0, 1.0),
        (Arc(0.0, 0.0, 0.5 * (low - high) / v, *by_spring), 0.0, 0.0),
    )
    found = [curve(arc, k, b)[0], *(_slope(arc, k, b, *one) for one in directions)]
    return OnArc(*(np.array([one.real, one.imag]) for one in found))


def _slope(arc: Arc, k: float, b: float, by: Arc, by_k: float, by_b: float) -> Array:
    """The derivative of `curve`, F, in one direction: its product rule, term by term."""
    _, nu, v, R, B, C = arc
    c, d = 1.0 + k, 0.5 * (1.0 - k)
    cc, by_cc, by_cd = c * c, 2.0 * c * by_k, by_k * (d - 0.5 * c)
    a, by_a = d + 1j * c * R, by_k * (1j * R - 0.5) + 1j * c * by.R
    beta, by_beta = b - cc * C, by_b - by_cc * C - cc * by.C
    wave = nu * (2.0 * R + nu * B)
    by_wave = 2.0 * by.nu * (R + nu * B) + nu * (2.0 * by.R + nu * by.B)
    smooth = by.v * (a * a + B * beta) + v * (2.0 * a * by_a + by.B * beta + B * by_beta)
    pole = 2.0 * (by_cd * nu + c * d * by.nu) + 1j * (by_cc * wave + cc * by_wave + by_beta)
    return np.asarray(smooth + pole / math.pi)


def _called(code: Callable[..., int], data: tuple[float, ...]) -> Array:
    """What a function of `arc_loops` fills in."""
    given, scratch, found = np.array(data), np.empty(arc_loops.SIZE), np.zeros(12)
    table = arc_table()
    code(given.ctypes.data, table.ctypes.data, scratch.ctypes.data, found.ctypes.data)
    return found


@lru_cache(maxsize=1)
def arc_table() -> Array:
    """What `arc_loops` ask for besides their data."""
    moments = InfiniteChain().moments(0)[: arc_loops.ORDERS]
    return np.concatenate([tables().ravel(), moments])


def _angle_equation(gamma: Any, arc: Arc, q: Any, spring: float) -> Array:
    """(v/nu) times the equation for a Neimark-Sacker angle: negative at both ends of the band."""
    alpha, nu, v, R, B, _ = arc
    root = v / nu if spring else 2.0 * np.sqrt(gamma) * np.cos(alpha)
    square = (R + nu * B) ** 2 - 0.25 * q * q
    return np.asarray(root * square - q * (1.0 / math.pi - math.pi * v * root * R * B))


def _needed(arc: Arc, k: Any) -> Array:
    """The b that brings D to zero at an angle, where the equation for the angle holds."""
    _, nu, v, R, B, C = arc
    q = (1.0 - k) / (1.0 + k)
    return np.asarray((1.0 + k) ** 2 * (C - nu * (2.0 * R + nu * B) - math.pi * q * v * R))


class NeimarkSacker(NamedTuple):
    """One Neimark-Sacker point at given gamma and k: its angle/pi and the b it needs."""

    nu: float
    b: float


def neimark_sacker(gamma: float, k: float, spring: float = 0.0) -> tuple[NeimarkSacker, ...]:
    """All Neimark-Sacker points of the infinite chain at this coupling and restitution.

    They are roots in one variable, the angle, each with an explicit b: no seed is needed. Sorted
    by angle; none, or two (at k = 1 none: the arc is neutral there).

    Examples
    --------
    >>> [round(point.nu, 4) for point in neimark_sacker(0.0969710, 0.8)]
    [0.4875, 0.5581]
    """
    gamma = check_gamma(gamma, spring)
    k, _ = check_kb(k, 0.0)
    q = (1.0 - k) / (1.0 + k)
    if gamma == 0.0 or q <= 0.0:
        return ()
    alpha, values = grid(gamma, spring).alpha, _on_grid(gamma, q, spring)
    if values.max() <= 0.0:  # a pair of roots between two nodes?
        crest = _crest(gamma, q, values, spring)
        if crest.y[1] <= 0.0:
            return ()
        place = int(np.searchsorted(alpha, crest.arc.alpha[1]))
        alpha, values = (
            np.insert(column, place, at[1])
            for column, at in ((alpha, crest.arc.alpha), (values, crest.y))
        )
    up = np.flatnonzero((values[:-1] > 0.0) != (values[1:] > 0.0))
    found = _roots(gamma, q, alpha[[up, up + 1]], values[[up, up + 1]], spring)
    arc = sample(gamma, found, spring)
    return tuple(map(NeimarkSacker, arc.nu.tolist(), _needed(arc, k).tolist()))


def _on_grid(gamma: float, q: float, spring: float) -> Array:
    values = _angle_equation(gamma, grid(gamma, spring), q, spring)
    values[[0, -1]] = -q / math.pi  # next to gamma = 1/4 rounding of cos(pi/2) would hide it
    return values


class _Crest(NamedTuple):
    """Three neighbouring samples around the crest of the equation for the angle, and its vertex,
    in steps from the middle one."""

    arc: Arc
    y: Array
    bend: float
    vertex: float
    height: float


def _crest(gamma: float, q: float, values: Array, spring: float) -> _Crest:
    """The equation for the angle has one crest; only one next to zero is looked at closely."""
    arc = grid(gamma, spring)
    i = int(np.clip(values.argmax(), 1, GRID - 1))
    found = _parabola(Arc(*(column[i - 1 : i + 2] for column in arc)), values[i - 1 : i + 2])
    step = 0.5 * math.pi / GRID
    while step > 1e-4 and abs(found.height) < found.bend:
        top = float(found.arc.alpha[1]) + step * found.vertex
        step *= 0.05
        top = min(max(top, step), 0.5 * math.pi - step)
        arc = sample(gamma, top + step * np.array([-1.0, 0.0, 1.0]), spring)
        found = _parabola(arc, _angle_equation(gamma, arc, q, spring))
    return found


def _parabola(arc: Arc, y: Array) -> _Crest:
    bend, tilt = float(2.0 * y[1] - y[0] - y[2]), float(y[2] - y[0])
    vertex = min(max(0.5 * tilt / bend, -1.0), 1.0) if bend > 0.0 else 0.0
    return _Crest(arc, y, bend, vertex, float(y[1]) + 0.25 * tilt * vertex)


def _roots(gamma: Any, q: Any, x: Array, y: Array, spring: float, close: float = 4e-16) -> Array:
    """One root in each bracket, columns of x, with the values y there: secants, kept inside."""
    (low, high), rising = x.copy(), y[1] > y[0]
    (old, new), (before, after) = x, y
    for _ in range(80):
        slope = (after - before) / np.where(new == old, 1.0, new - old)
        with np.errstate(divide="ignore", invalid="ignore"):
            step = np.where(after == 0.0, 0.0, new - after / slope)
        step = np.where(after == 0.0, new, step)
        inside = (low <= step) & (step <= high)
        old, before = new, after
        new = np.where(inside | (after == 0.0), step, 0.5 * (low + high))
        if np.all(np.abs(new - old) <= close):
            break
        after = _angle_equation(gamma, sample(gamma, new, spring), q, spring)
        under = (after < 0.0) == rising
        low, high = np.where(under, new, low), np.where(under, high, new)
    return np.asarray(new)


class Window(NamedTuple):
    """The values of b between which a pair is outside: ``(centre - b)^2 < square``.

    Where no b brings a pair out, ``square`` is negative, and grows to zero smoothly up to where
    one does. ``low`` and ``high`` are the angles/pi at both ends, 0 where none is known.
    """

    centre: float
    square: float
    low: float = 0.0
    high: float = 0.0

    def miss(self, b: float) -> float:
        """Negative where a pair is outside, zero at the Neimark-Sacker points, smooth and bounded:
        b runs to infinity where an impact vanishes."""
        return ((b - self.centre) ** 2 - self.square) / (1.0 + b * b)

    def passed(self, b: float) -> int:
        """How many of the two ends are below b."""
        half = math.sqrt(max(self.square, 0.0))
        return int(b > self.centre - half) + int(b > self.centre + half)


@lru_cache(maxsize=64)
def window(gamma: float, k: float, spring: float = 0.0) -> Window:
    """Where a pair is outside at this coupling and restitution.

    At k = 1 there are neutral multipliers between the band and -1. The pair that comes out of the
    band's edge for k < 1 is one of them, and leaves the circle only where two have met: beyond the
    largest b of any; and with springs, which open a gap between the band and +1, short of the least
    b of any there.

    Examples
    --------
    >>> low, high = sorted(point.b for point in neimark_sacker(0.1, 0.8))
    >>> abs(window(0.1, 0.8).miss(low)) < 1e-12 and window(0.1, 0.8).miss(0.5 * (low + high)) < 0
    True
    """
    number("gamma", gamma, -math.inf, math.inf, "a coupling")
    check_finite(k, 0.0)
    if gamma == 0.0:
        return Window(0.0, -1.0)
    if k == 1.0:
        found = [_neutral_until(gamma, spring), _neutral_from(gamma, spring)]
        if found[0] >= found[1]:
            return Window(found[1], -1.0)
        angles = []
    else:
        code = None if spring else _WINDOW.code()
        if code is not None:
            return Window(*_called(code, (gamma, k, (1.0 - k) / (1.0 + k)))[:4].tolist())
        ends = sorted(neimark_sacker(gamma, k, spring), key=lambda point: point.b)
        found, angles = [point.b for point in ends], [point.nu for point in ends]
    if len(found) == 2:
        return Window(0.5 * (found[0] + found[1]), 0.25 * (found[0] - found[1]) ** 2, *angles)
    q = (1.0 - k) / (1.0 + k)
    crest = _crest(gamma, q, _on_grid(gamma, q, spring), spring)
    b, x = _needed(crest.arc, k), crest.vertex
    slope = 0.5 * float(b[2] - b[0])
    centre = float(b[1]) + x * slope + 0.5 * x * x * float(b[0] - 2.0 * b[1] + b[2])
    # b at the two roots of the parabola, were it high enough: centre +- slope sqrt(2 height/bend)
    square = 2.0 * crest.height * slope * slope / crest.bend if crest.bend > 0.0 else -1.0
    return Window(centre, min(square, 0.0))


def windows(gamma: Array, k: Array) -> tuple[Array, Array]:
    """Centre and square of many windows of the chain without springs, to about 1e-7; NaN where
    `window` has to look closer."""
    q, every = (1.0 - k) / (1.0 + k), gamma[:, None]
    alpha = np.linspace(0.0, 0.5 * math.pi, COARSE + 1)
    values = _angle_equation(every, sample(every, alpha), q[:, None], 0.0)
    values[:, 0] = values[:, -1] = -q / math.pi
    passed = (values[:, :-1] > 0.0) != (values[:, 1:] > 0.0)
    passed &= (passed.sum(axis=1) == 2)[:, None]
    row, up = np.nonzero(passed)
    brackets = np.array([up, up + 1])
    found = _roots(gamma[row], q[row], alpha[brackets], values[row, brackets], 0.0, _ENOUGH)
    first, last = _needed(sample(gamma[row], found), k[row]).reshape(-1, 2).T
    centre, square = np.full((2, q.size), math.nan)
    centre[row[::2]], square[row[::2]] = 0.5 * (first + last), 0.25 * (first - last) ** 2
    top = np.clip(values.argmax(axis=1), 1, COARSE - 1)
    before, crest, after = np.take_along_axis(values, top[:, None] + [-1, 0, 1], axis=1).T
    below = crest + 0.5 * (2.0 * crest - before - after) < 0.0  # four times what a parabola asks
    centre[below], square[below] = 0.0, -1.0
    return centre, square


def _neutral_until(gamma: float, spring: float) -> float:
    """For k = 1 the largest b for which D, real there, has a zero between the band and mu = -1."""
    edge = math.sqrt(spring + 4.0 * gamma)

    def needed(t: Array) -> Array:
        nu = edge + (1.0 - edge) * t * t
        inverse = math.pi * np.sqrt((nu * nu - spring) * (1.0 - edge) * (nu + edge)) * t
        return _elastic(gamma, spring, nu, inverse)

    return _highest(needed)


def _neutral_from(gamma: float, spring: float) -> float:
    """For k = 1 the least b for which it has one between the band and mu = 1."""
    if spring == 0.0:  # the band starts there
        return float(4.0 * sample(gamma, np.zeros(1)).C[0])
    floor = math.sqrt(spring)

    def needed(t: Array) -> Array:
        nu = floor * (1.0 - t * t)
        below = floor * (floor + nu)
        inverse = -math.pi * np.sqrt(below * (below * t * t + 4.0 * gamma)) * t
        return -_elastic(gamma, spring, nu, inverse)

    return -_highest(needed)


def _elastic(gamma: float, spring: float, nu: Array, inverse: Array) -> Array:
    """The b with which D has a zero off the band for k = 1; ``inverse = -pi/g``."""
    R, B, C = regular(gamma, nu, None, spring)
    return np.asarray(4.0 * (C + (inverse * R * R - nu * (2.0 * R + nu * B)) / (1.0 + inverse * B)))


def _highest(needed: Callable[[Array], Array]) -> float:
    """Of a function on [0, 1], by a grid that closes in on it."""
    t = np.linspace(0.0, 1.0, GRID + 1)
    values = needed(t)
    for _ in range(4):
        top = int(values.argmax())
        t = np.linspace(t[max(top - 1, 0)], t[min(top + 1, GRID)], GRID + 1)
        values = needed(t)
    return float(values.max())
