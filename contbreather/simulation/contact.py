"""The first time at which a site reaches its wall, with none skipped.

A displacement ``phi(s)`` is known as a formula, and so is a bound J on its third derivative over
the step. From any time on, ``phi(s) <= phi + phi' x + (phi'' + J x_max) x^2/2`` for x <= x_max; up
to the first root of that parabola no wall is reached. Walking from root to root never steps over a
contact, however shallow; it converges quadratically to a crossing and geometrically to a grazing.
"""

from __future__ import annotations

import math

from contbreather.kernels import Matrix
from contbreather.simulation.arguments import Harmonics
from contbreather.simulation.taylor import driven, driven_bound, site_at

CLOSE = 2e-15  # a gap of rounding
STILL = 1e-12  # a velocity of rounding
PUSHED = 1e-9  # an acceleration that is more than rounding
WALKS = 4000  # steps of one search; the usual number is below ten
NUDGE = 1e-11  # moves the search off a point where the gap is rounding; changes it by 1e-22
NOTHING = 1e-100  # its square is no longer a number to reckon with
NEVER = -1.0
LOST = -2.0


def parabola_root(gap: float, slope: float, bend: float) -> float:
    """First x > 0 with ``slope x + bend x^2/2 = gap``, gap > 0; infinity if there is none."""
    if bend <= NOTHING:  # a straight line, or a crest that may stay below
        if slope <= NOTHING:
            return math.inf
        inside = slope * slope + 2.0 * bend * gap
        # not (root - slope)/bend, which cancels
        return 2.0 * gap / (slope + math.sqrt(inside)) if inside >= 0.0 else math.inf
    root = math.sqrt(slope * slope + 2.0 * bend * gap)
    if slope > 0.0:
        return 2.0 * gap / (slope + root)
    return (root - slope) / bend


def safe_advance(gap: float, slope: float, bend: float, jerk: float, longest: float) -> float:
    """How far one may go, at most ``longest``, without reaching the wall."""
    # of x with a root behind it all before x is safe, with one before it all before the root: the
    # best x is where both meet
    best, x = NUDGE, longest
    for _ in range(60):
        root = parabola_root(gap, slope, bend + jerk * x)
        if root >= x:
            return max(best, x)
        best = max(best, root)
        if x <= 2.0 * root:
            break
        x = max(2.0 * root, 0.25 * x)
        if x < NUDGE:
            break
    return best


def first_contact(
    rows: Matrix, n: int, h: float, drive: Harmonics, t: float, sign: float, level: float,
    start: float, limit: float, last: float,
) -> float:  # fmt: skip
    """First s in [start, limit] at which ``sign phi(s)``, in the end ``last``, is up to ``level``.

    ``phi`` is column n of ``rows`` plus ``drive``, t the time at s = 0. Touching from inside with
    a velocity of rounding counts as contact only if the acceleration pushes on; the gap is not
    asked for more than `CLOSE`, or a site lying at its wall would be walked along for ever.

    Returns
    -------
    float
        s, `NEVER`, or `LOST` if the walk did not come to an end.
    """
    jerk = column_bound(rows, n, limit / h, 3) / (h * h * h) + driven_bound(drive, 3)
    s, close = start, CLOSE * max(1.0, abs(level))
    for _ in range(WALKS):
        value, slope, bend = site_at(rows, n, h, s / h)
        forced, forced_slope, forced_bend = driven(drive, t + s)
        gap = level - sign * (value + forced)
        slope = sign * (slope + forced_slope)
        bend = sign * (bend + forced_bend)
        if gap <= close:
            if slope > STILL:  # one step of Newton's method, where it is not mere rounding
                return max(start, s + (gap / slope if slope > 1e-3 else 0.0))
            if slope > -STILL and bend > PUSHED:
                return s
        if s >= limit:
            return NEVER
        # a gap of rounding, of either sign, is taken for one that can be walked off
        s = min(limit, s + safe_advance(max(gap, close), slope, bend, jerk, limit - s))
        if s >= limit and level - last > 2.0 * close:
            return NEVER
    return LOST


def column_bound(rows: Matrix, n: int, x: float, order: int) -> float:
    """h^order times a bound on that derivative of a column, for all times up to x h."""
    total = 0.0
    for j in range(rows.shape[0] - 1, order - 1, -1):
        weight = abs(rows[j, n])
        for i in range(order):
            weight *= j - i
        total = total * x + weight
    return total
