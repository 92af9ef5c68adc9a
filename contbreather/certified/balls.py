"""Balls: real numbers known to lie in an interval, by FLINT's arb, and Krawczyk's test.

Whatever is computed from balls encloses every exact value that they stand for, rounding included.
A `Jet` is a ball with its derivative in one unknown, arb's power series cut after first order: the
same formulas, read with jets instead of balls, give Jacobians.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, NamedTuple

from contbreather.errors import BadInput

try:
    from flint import arb, arb_mat, arb_series, ctx
except ModuleNotFoundError:
    raise BadInput(
        "certify() computes with python-flint, which is not installed; "
        "pip install 'contbreather[certified]' brings it."
    ) from None

Ball = arb
Jet = arb_series
Value = Any  # a ball or a jet


class Interval(NamedTuple):
    """Numbers from `low` to `high`, both of them floats rounded outwards."""

    low: float
    high: float

    @property
    def width(self) -> float:
        return self.high - self.low

    def __contains__(self, x: object) -> bool:
        return isinstance(x, float | int) and self.low <= x <= self.high

    @property
    def text(self) -> str:
        """In words, with as many digits as tell its ends apart."""
        ends = ((f"{self.low:.{n}g}", f"{self.high:.{n}g}") for n in range(9, 18))
        low, high = next((pair for pair in ends if pair[0] != pair[1]), (repr(self.low),) * 2)
        return f"[{low}, {high}]"


@contextmanager
def working() -> Iterator[None]:
    """Set the precision that the bounds of this package are made for."""
    with ctx.workprec(128):  # bits of a midpoint: the cut series of `averages` are as good
        yield


def hull(low: float, high: float) -> Ball:
    """The ball of all numbers between two floats."""
    return arb(low).union(arb(high))


def interval(x: Ball) -> Interval:
    """Floats that enclose a ball."""
    return Interval(_down(x.lower()), -_down(-x.upper()))


def _down(x: Ball) -> float:
    """The largest float that is surely not above an exact number; the nearest one may be."""
    near = float(x)
    return near if arb(near) <= x else math.nextafter(near, -math.inf)


def square_root(x: Ball) -> Ball:
    """The square root of what is known not to be negative, though its ball may reach below 0."""
    low, high = x.lower(), x.upper()
    return (low.sqrt() if low > 0 else arb(0)).union(high.sqrt())


HALVINGS = 26  # of an interval: the last ones settle 1e-9 of it, 1e-15 where it is quadratic


def subintervals(
    count: int, settled: Callable[[float, float], Any]
) -> Iterator[tuple[float, float, Any]]:
    """Parts of the interval from 0 to 1, in order, each with what is settled of it; one of which
    that is None is halved."""
    stack = [(i / count, (i + 1) / count, 0) for i in reversed(range(count))]
    while stack:
        low, high, depth = stack.pop()
        answer = settled(low, high)
        if answer is None and depth < HALVINGS:
            middle = 0.5 * (low + high)
            stack += [(middle, high, depth + 1), (low, middle, depth + 1)]
        else:
            yield low, high, answer


# --- zeros of equations -------------------------------------------------------------------------

Equations = Callable[[Sequence[Value]], list[Value]]


def jacobian_enclosure(equations: Equations, box: Sequence[Ball]) -> list[list[Ball]]:
    """Enclosures of all partial derivatives over a box, one unknown after the other as a jet."""
    columns = []
    for j in range(len(box)):
        jets = [Jet([x, 1], prec=2) if i == j else x for i, x in enumerate(box)]
        values = equations(jets)
        columns.append([f[1] if isinstance(f, Jet) else arb(0) for f in values])
    return [list(row) for row in zip(*columns, strict=True)]


def newton_step(equations: Equations, point: Sequence[Ball]) -> list[Ball]:
    """Newton's step, to be subtracted from a point: a size, not a bound."""
    slopes = arb_mat(jacobian_enclosure(equations, point)).mid()
    return list(slopes.solve(arb_mat([[f] for f in equations(point)])).entries())


def krawczyk(
    equations: Equations, box: Sequence[Ball], along: int | None = None
) -> list[Ball] | None:
    """Krawczyk's test: a smaller box that holds the one zero that there is in this box.

    With the midpoint m and any matrix Y, each zero z in the box X is in
    ``K = m - Y F(m) + (1 - Y F'(X)) (X - m)``, by the mean value theorem. If K lies in the interior
    of X, X holds exactly one zero: ``z - Y F(z)`` maps X into K and contracts, and F'(z) is regular
    all over X. K is given, or None where the test says nothing.

    One coordinate may be no unknown, `along`, with one equation less: the statement is then about
    all its values in the box. ``F(m)`` is there ``F at its midpoint + F_x(X) (x - its midpoint)``,
    multiplied by Y before the balls are, so that nothing is lost where the curve is flat in another
    coordinate.
    """
    unknown = [i for i in range(len(box)) if i != along]
    middle = [arb(x.mid()) for x in box]
    rows, value = jacobian_enclosure(equations, box), equations(middle)
    slopes = arb_mat([[row[i] for i in unknown] for row in rows])
    try:
        inverse = slopes.mid().inv().mid()
    except ZeroDivisionError:
        return None
    image = arb_mat([[middle[i]] for i in unknown]) - inverse * arb_mat([[f] for f in value])
    identity = arb_mat([[int(i == j) for j in unknown] for i in unknown])
    image += (identity - inverse * slopes) * arb_mat([[box[i] - middle[i]] for i in unknown])
    if along is not None:
        image -= inverse * arb_mat([[row[along]] for row in rows]) * (box[along] - middle[along])
    refined = dict(zip(unknown, image.entries(), strict=True))
    inside = all(box[i].contains_interior(x) for i, x in refined.items())
    return [refined.get(i, x) for i, x in enumerate(box)] if inside else None
