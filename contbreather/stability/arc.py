"""On the band of the infinite chain: the curve D(mu) traces there, where it meets zero, and how the
breather scatters waves.

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

A small wave of that angle meets the impacting site, which multiplies its even part by
``S = (D continued from inside the circle)/(D from outside)``:

    |S|^2 - 1 = -(8 c d nu/(pi v)) W/|D|^2,   W = (R/nu + B)(c^2 nu R + beta) + d^2,

so more comes back than went in exactly where W < 0: a test without roots or logarithms, and no
ring of any size is unstable where W >= 0 on the whole band. k = 1 (d = 0) gives |S| = 1. A
Neimark-Sacker point is a pole of S. A packet of waves runs round a ring of N sites with
the group velocity ``v_g = sqrt(4 gamma - nu^2)/2`` and meets the site every ``N/v_g``, so that
``N (|mu| - 1) -> pi v_g ln|S|`` on long rings.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from threading import get_ident
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from contbreather.checks import brief, number
from contbreather.errors import BadInput
from contbreather.lattice.band_averages import check_gamma, in_powers_of_x
from contbreather.lattice.chain import InfiniteChain
from contbreather.stability import band_pairs
from contbreather.stability.band_pairs import GRID, ON_ARC, ORDERS, WINDOW, smooth_and_L
from contbreather.stability.characteristic import Gradient, regular, slope_at_zero, tables
from contbreather.stability.saltation import check_finite, check_kb
from contbreather.stability.zeros import steep
from contbreather.tables import Column, HtmlRepr, Sheet

Array = NDArray[Any]


DEPTH = 48  # halvings of one grid interval: down to 1e-16 in alpha
NOISE = 1e-15  # of F's own terms: what their rounding amounts to


class Arc(NamedTuple):
    """Samples on the band: alpha in [0, pi/2], nu, v = nu sqrt(4 gamma - nu^2), R, B, C; or a
    direction in which they change."""

    alpha: Any
    nu: Any
    v: Any
    R: Any
    B: Any
    C: Any


def wave_frequency(gamma: float, alpha: Any, spring: float = 0.0) -> Any:
    """nu, the frequency of the wave ``theta = 2 alpha``."""
    sine = 2.0 * np.sqrt(gamma) * np.sin(alpha)
    return np.sqrt(spring + sine * sine) if spring else sine


def sample(gamma: float, alpha: Array, spring: float = 0.0) -> Arc:
    """R, B, C at ``nu^2 = spring + 4 gamma sin(alpha)^2``."""
    nu = wave_frequency(gamma, alpha, spring)
    # v^2 = (nu^2 - spring)(spring + 4 gamma - nu^2), without a difference next to either edge
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
    smooth, L = smooth_and_L(nu, k, b, (R, B, C))
    # F = v smooth + v (g/pi) L with v g = -i, which is +i from inside
    smooth, pole = v * smooth, -1j / math.pi * L
    return smooth + pole, smooth - pole


def resolved_arc(
    gamma: float, k: float, b: float, spring: float = 0.0, *, inside: bool = False
) -> tuple[Arc, Array, Array]:
    """Samples on the band so close that F = v D turns by less than a radian between them.

    Also v times D continued from the inside; with ``inside`` that, too, is resolved.
    """
    arc = grid(gamma, spring)
    out, into = curve(arc, k, b)
    if gamma == 0.0:
        return arc, out, into
    noise = NOISE * (abs(b) + 1.0)
    for _ in range(DEPTH):
        wide = steep(out, noise) | steep(into, noise) if inside else steep(out, noise)
        i = np.flatnonzero(wide)
        i = i[arc.alpha[i + 1] - arc.alpha[i] > 1e-15]
        if i.size == 0:
            break
        middle = sample(gamma, 0.5 * (arc.alpha[i] + arc.alpha[i + 1]), spring)
        new = curve(middle, k, b)
        out, into = np.insert(out, i + 1, new[0]), np.insert(into, i + 1, new[1])
        arc = Arc(*(np.insert(old, i + 1, x) for old, x in zip(arc, middle, strict=True)))
    return arc, out, into


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
            f"nu = {brief(nu)}: the band of gamma = {gamma} has angles between "
            f"{math.sqrt(spring):.6g} and {math.sqrt(spring + 4.0 * gamma):.6g} (times pi); choose "
            "one of them."
        )
    return x, low, high


def on_arc(gamma: float, nu: float, k: float, b: float, spring: float = 0.0) -> Gradient:
    """The two equations of a Neimark-Sacker point of the infinite chain, with their Jacobian.

    (Re, Im) of F = nu sqrt(4 gamma - nu^2) D, of shape (2,), or (2, ...) for an array of angles.
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
    >>> angle, b = ns_points(0.1, 0.8)[0]
    >>> bool(abs(on_arc(0.1, angle, 0.8, b).value).max() < 1e-14)
    True
    """
    gamma = check_gamma(gamma, spring)
    check_finite(k, b)
    x, *_ = on_band(gamma, nu, spring)
    on, work = band_pairs.ChainWithImpacts(gamma, k, spring), band_workspace(spring, get_ident())
    out = np.empty((x.size, 6, 2))
    for angle, rows in zip(x.ravel().tolist(), out, strict=True):
        ON_ARC(on, work, b, angle, rows)
    return Gradient(*out.transpose(1, 2, 0).reshape(6, 2, *x.shape))


@lru_cache(maxsize=16)
def band_workspace(spring: float, thread: int) -> band_pairs.BandWorkspace:
    """What `band_pairs` ask for, with room for what a thread makes of it."""
    # <w^2j> as a polynomial in 4 gamma; and its slope in the spring, j <w^(2j - 2)>
    moments = InfiniteChain().moments(0) * in_powers_of_x(spring)
    slopes = np.arange(ORDERS)[:, None] * np.roll(moments[:ORDERS], 1, axis=0)
    values, by_spring = (
        np.ascontiguousarray((tables() @ rows[:ORDERS, :ORDERS])[:, ::-1, ::-1])
        for rows in (moments, slopes)
    )
    room = np.empty((3, 3, band_pairs.POWERS)), np.empty(GRID + 1), np.empty((3, 3))
    return band_pairs.BandWorkspace(values, by_spring, *room)


def _window(gamma: float, k: float, spring: float) -> tuple[list[float], list[list[float]]]:
    """What `pair_window` fills in."""
    on, work = band_pairs.ChainWithImpacts(gamma, k, spring), band_workspace(spring, get_ident())
    window, roots = np.empty(4), np.full((2, 2), math.nan)
    WINDOW(on, work, window, roots)
    return window.tolist(), [row for row in roots.tolist() if not math.isnan(row[0])]


def values_at_ends(
    k: Any, b: Any, psi: Any, eta: Any, chi: Any, held: float = 0.0
) -> tuple[Any, ...]:
    """beta0, which has the sign of -D(1), and D(-1), each with the size of its terms."""
    # D(-1) = d^2 + chi (b + c^2 eta/2)/2: there G12 = chi/2
    half_c2, d = 0.5 * (1.0 + k) ** 2, 0.5 * (1.0 - k)
    pitchfork, fold = half_c2 * psi + held, half_c2 * eta
    return (
        b - pitchfork,
        abs(b) + abs(pitchfork),
        d * d + 0.5 * chi * (b + fold),
        d * d + 0.5 * chi * (abs(b) + fold),
    )


def ends_of(gamma: float, k: float, b: float, lattice: Any) -> tuple[float, ...]:
    """`values_at_ends` by the means of a lattice; a spring closes the pole that D has at mu = 1."""
    held = 0.5 * (1.0 - k) ** 2 / lattice.tau(gamma) if lattice.spring else 0.0
    psi, eta, chi = (lattice.mean(gamma, name) for name in ("psi", "eta", "chi"))
    return values_at_ends(k, b, psi, eta, chi, held)


class NeimarkSacker(NamedTuple):
    """One Neimark-Sacker point at given gamma and k: its angle/pi and the b it needs."""

    nu: float
    b: float


def ns_points(gamma: float, k: float, spring: float = 0.0) -> tuple[NeimarkSacker, ...]:
    """All Neimark-Sacker points of the infinite chain at this coupling and restitution.

    They are roots in one variable, the angle, each with an explicit b: no seed is needed. Sorted
    by angle; none, or two (at k = 1 none: the arc is neutral there).

    Examples
    --------
    >>> [round(point.nu, 4) for point in ns_points(0.0969710, 0.8)]
    [0.4875, 0.5581]
    """
    gamma = check_gamma(gamma, spring)
    k, _ = check_kb(k, 0.0)
    if gamma == 0.0 or k == 1.0:
        return ()
    return tuple(sorted(NeimarkSacker(*root) for root in _window(gamma, k, spring)[1]))


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

    def passed(self, b: Any) -> Any:
        """How many of the two ends are below b; without a window what leads from none to both, as
        smoothly as the distance from one allows."""
        off = b - self.centre
        if self.square < 0.0:
            return 1.0 + off / np.sqrt(off * off - self.square)
        half = math.sqrt(self.square)
        return (off > -half) + 1 * (off > half)


@lru_cache(maxsize=64)
def window(gamma: float, k: float, spring: float = 0.0) -> Window:
    """Where a pair is outside at this coupling and restitution.

    At k = 1 there are neutral multipliers between the band and -1. The pair that comes out of the
    band's edge for k < 1 is one of them, and leaves the circle only where two have met: beyond the
    largest b of any; and with springs, which open a gap between the band and +1, short of the least
    b of any there.

    Examples
    --------
    >>> low, high = sorted(point.b for point in ns_points(0.1, 0.8))
    >>> abs(window(0.1, 0.8).miss(low)) < 1e-12 and window(0.1, 0.8).miss(0.5 * (low + high)) < 0
    True
    """
    number("gamma", gamma, -math.inf, math.inf, "a coupling")
    check_finite(k, 0.0)
    if gamma == 0.0:
        return Window(0.0, -1.0)
    if k == 1.0:
        ends = [_neutral_until(gamma, spring), _neutral_from(gamma, spring)]
        if ends[0] >= ends[1]:
            return Window(ends[1], -1.0)
        return Window(0.5 * (ends[0] + ends[1]), 0.25 * (ends[0] - ends[1]) ** 2)
    return Window(*_window(gamma, k, spring)[0])


def _neutral_until(gamma: float, spring: float) -> float:
    """For k = 1 the largest b for which D, real there, has a zero between the band and mu = -1."""
    edge = math.sqrt(spring + 4.0 * gamma)

    def needed(t: Array) -> Array:
        nu = edge + (1.0 - edge) * t * t  # the root at the edge is smooth in t
        # -pi/g = pi sqrt((nu^2 - spring)(nu - edge)(nu + edge))
        inverse = math.pi * np.sqrt((nu * nu - spring) * (1.0 - edge) * (nu + edge)) * t
        return _elastic(gamma, spring, nu, inverse)

    return _highest(needed)


def _neutral_from(gamma: float, spring: float) -> float:
    """For k = 1 the least b for which it has one between the band and mu = 1."""
    if spring == 0.0:  # the band starts there
        return float(4.0 * sample(gamma, np.zeros(1)).C[0])
    floor = math.sqrt(spring)

    def needed(t: Array) -> Array:
        nu = floor * (1.0 - t * t)  # spring - nu^2 = t^2 floor (floor + nu)
        below = floor * (floor + nu)
        inverse = -math.pi * np.sqrt(below * (below * t * t + 4.0 * gamma)) * t
        return -_elastic(gamma, spring, nu, inverse)

    return -_highest(needed)


def _elastic(gamma: float, spring: float, nu: Array, inverse: Array) -> Array:
    """The b with which D has a zero off the band for k = 1; ``inverse = -pi/g``."""
    R, B, C = regular(gamma, nu, None, spring)
    # c = 2, d = 0: D = 0 where beta (1 - pi B/g) = 4 (-pi R^2/g - nu (2 R + nu B)), b = beta + 4 C
    return np.asarray(4.0 * (C + (inverse * R * R - nu * (2.0 * R + nu * B)) / (1.0 + inverse * B)))


def _highest(needed: Callable[[Array], Array]) -> float:
    """Of a function on [0, 1], by a grid that closes in on it."""
    t = np.linspace(0.0, 1.0, GRID + 1)
    values = needed(t)
    for _ in range(4):  # each grid is 32 times finer: to 1e-8 in t, which a maximum feels as 1e-16
        top = int(values.argmax())
        t = np.linspace(t[max(top - 1, 0)], t[min(top + 1, GRID)], GRID + 1)
        values = needed(t)
    return float(values.max())


# --- waves that are scattered ---------------------------------------------------------------------

ZOOMS = 4  # each narrows the bracket of a maximum four times
ROUNDING = 1e-13  # of ln|S|


@dataclass(frozen=True)
class OverReflection(HtmlRepr):
    """How much the breather amplifies waves of the band of the infinite chain.

    ``gain = max ln|S|`` at the angle ``nu`` (times pi), both 0 if nothing is amplified;
    ``growth = max pi v_g ln|S|`` at ``growth_nu``: on long rings the band's multipliers of QS reach
    ``|mu| = 1 + growth/N``.
    """

    over_reflecting: bool
    gain: float
    nu: float
    growth: float
    growth_nu: float

    def table(self) -> Sheet:
        """The gain and the growth, and at which angles they are reached."""
        return Sheet(
            [
                Column("", ["gain", "growth"]),
                Column("largest", [self.gain, self.growth]),
                Column("at nu", [self.nu, self.growth_nu]),
            ],
            title="Waves come back amplified" if self.over_reflecting else "No wave is amplified",
        )


def _margin(arc: Arc, k: float, b: float) -> Array:
    """nu W: negative where more comes back than went in."""
    _, nu, _, R, B, C = arc
    c, d = 1.0 + k, 0.5 * (1.0 - k)
    return np.asarray((R + nu * B) * (c * c * nu * R + b - c * c * C) + nu * d * d)


def _log_gain(arc: Arc, k: float, b: float) -> Array:
    """ln|S| on the arc, exact also where |S| is near 1."""
    # at a Neimark-Sacker point S has a pole; its size is then that of rounding
    out = np.maximum(np.abs(curve(arc, k, b)[0]), 1e-15 * (1.0 + abs(b))) ** 2
    c, d = 1.0 + k, 0.5 * (1.0 - k)
    excess = -8.0 * c * d / math.pi * arc.v * _margin(arc, k, b)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(excess == 0.0, 0.0, excess / out)
    return np.asarray(0.5 * np.log1p(np.maximum(ratio, -1.0)))  # ln|S| = ln(1 + (|S|^2 - 1))/2


def scattering(gamma: float, nu: ArrayLike, k: float, b: float, spring: float = 0.0) -> Array:
    """S at the angles nu (times pi) of the band, 0 < nu < 2 sqrt(gamma): complex, an array for many
    angles. Parameters and errors as of `on_arc`.

    Examples
    --------
    >>> bool(abs(abs(scattering(0.1, 0.3, 1.0, 0.2)) - 1) < 1e-14)  # nothing is lost at k = 1
    True
    """
    gamma = check_gamma(gamma, spring)
    k, b = check_kb(k, b)
    low = on_band(gamma, nu, spring)[1]
    alpha = np.arcsin(np.sqrt(low / (4.0 * gamma)))
    out, into = curve(sample(gamma, alpha, spring), k, b)
    return np.asarray(into / out)


def over_reflects(gamma: float, k: float, b: float, spring: float = 0.0) -> bool:
    """Whether waves of some angle come back larger than they went in: W < 0 somewhere on the band.

    Examples
    --------
    >>> over_reflects(0.08, 0.8, 0.468), over_reflects(0.08, 1.0, 0.468)
    (True, False)
    """
    gamma = check_gamma(gamma, spring)
    k, b = check_kb(k, b)
    if gamma == 0.0 or k == 1.0:  # no waves; nothing lost and nothing won
        return False
    arc = grid(gamma, spring)
    lowest = float(np.min(_margin(arc, k, b)[1:] / arc.nu[1:]))
    if spring == 0.0:  # the limit nu -> 0, the minimum as a rule
        beta0, *_ = ends_of(gamma, k, b, InfiniteChain())
        lowest = min(lowest, slope_at_zero(gamma) * beta0 + 0.25 * (1.0 - k) ** 2)
    return lowest < -ROUNDING * (1.0 + abs(b))


def _speed(gamma: float, arc: Arc, spring: float) -> Array:
    """The group velocity ``v/(2 nu)``."""
    return np.asarray(0.5 * arc.v / arc.nu if spring else math.sqrt(gamma) * np.cos(arc.alpha))


def _zoom(
    gamma: float, k: float, b: float, spring: float, left: Array, right: Array, growth: Array
) -> Array:
    """Maxima of ln|S| (or pi v_g ln|S| where ``growth``) in brackets: rows (value, alpha)."""
    ninths = np.linspace(0.0, 1.0, 9)
    rows = np.arange(left.size)
    for _ in range(ZOOMS):
        alpha = left[:, None] + (right - left)[:, None] * ninths
        arc = sample(gamma, alpha.ravel(), spring)
        values = _log_gain(arc, k, b).reshape(alpha.shape)
        weight = math.pi * _speed(gamma, arc, spring).reshape(alpha.shape)
        values = np.where(growth[:, None], weight * values, values)
        i = np.clip(values.argmax(axis=1), 1, 7)
        left, right = alpha[rows, i - 1], alpha[rows, i + 1]
    low, top, high = values[rows, i - 1], values[rows, i], values[rows, i + 1]
    # the vertex of the parabola through the last three samples
    curvature = low - 2.0 * top + high
    with np.errstate(divide="ignore", invalid="ignore"):
        shift = np.where(curvature < 0.0, 0.5 * (low - high) / curvature, 0.0)
    shift = np.clip(shift, -1.0, 1.0)
    vertex = top - 0.25 * (low - high) * shift
    return np.stack([vertex, alpha[rows, i] + shift * (right - alpha[rows, i])])


def _brackets(values: Array) -> Array:
    """Nodes that are maxima, the best and those not far below it."""
    padded = np.concatenate([[-np.inf], values, [-np.inf]])
    peak = np.flatnonzero((values >= padded[:-2]) & (values > padded[2:]) & (values > 0.0))
    order = np.argsort(values[peak])[::-1][:3]
    return np.clip(peak[order], 1, values.size - 2)


def over_reflection(gamma: float, k: float, b: float, spring: float = 0.0) -> OverReflection:
    """The largest amplification of a wave by the breather, and the growth of long rings it causes.

    If not ``over_reflecting``, no ring of any size is unstable through its band. Parameters and
    errors as of `unstable_count`.

    Examples
    --------
    >>> worst = over_reflection(0.08, 0.8, 0.46823798739267164)  # a = 0.5
    >>> round(worst.gain, 4), round(worst.nu, 4), round(worst.growth, 4)
    (1.257, 0.3685, 0.8488)
    """
    if not over_reflects(gamma, k, b, spring):
        return OverReflection(False, 0.0, 0.0, 0.0, 0.0)
    arc, _, _ = resolved_arc(gamma, k, b, spring)
    gain = _log_gain(arc, k, b)
    gain_at = _brackets(gain)
    growth_at = _brackets(_speed(gamma, arc, spring) * gain)
    if gain_at.size == 0:  # amplified, but by less than rounding shows
        return OverReflection(True, 0.0, 0.0, 0.0, 0.0)
    i = np.concatenate([gain_at, growth_at])
    kind = np.repeat([False, True], [gain_at.size, growth_at.size])
    value, alpha = _zoom(gamma, k, b, spring, arc.alpha[i - 1], arc.alpha[i + 1], kind)
    nu = wave_frequency(gamma, alpha, spring)
    best = int(value[~kind].argmax())
    most = gain_at.size + int(value[kind].argmax())
    return OverReflection(
        True, float(value[best]), float(nu[best]), float(value[most]), float(nu[most])
    )
