"""How many multipliers of the half map are outside the unit circle, by a certified winding number.

``D(mu)``, mu = exp(i pi nu), is analytic for |mu| > 1, tends to 1 at infinity, and takes conjugate
values at conjugate mu; its zeros there are the isolated multipliers (theory, (T9) to (T12)). So
their number is minus the turning of D along the circle, run through from outside: minus that along
its upper half, ``nu`` from 0 to 1, over pi. With ``h = sqrt(nu^2 (nu^2 - 4 gamma)) = -1/g``
analytic for Im nu < 0,

    ``F = h D = h [(d + i c R)^2 + B beta] - L/pi``,
    ``L = 2 i c nu (d + i c R) - beta - c^2 nu^2 B``

is continuous up to the circle: its pole at mu = 1 and its branch point at the band's edge are gone.
There

    ``h = -i nu sqrt(4 gamma - nu^2)`` on the band,  ``h = nu sqrt(nu^2 - 4 gamma)`` beyond.

From a real mu > 1 next to 1 (``nu = -i e``, h < 0, D real) to mu = -1 (h > 0, D real) h turns by
pi, and F is real at both ends. Hence, for gamma = 0 too,

    ``count = 1 - (turning of F along nu from 0 to 1)/pi``.

The half circle is covered by balls of nu; the values of F over each are enclosed in a rectangle
that must not hold 0, else the ball is halved. Rectangles are convex, and those of neighbours have a
point in common: F turns as the polygon through such points does, whatever it does in between.

**Sums over aliases.** Those of s = nu + 2m with m = 1, -1 are exact. For |m| >= 2, with
``g = -sum of binomial(2j, j) gamma^j s^-(2j+2)``,

    ``sum of s^-r = +-2 sum over k of binomial(r - 1 + k, k) nu^k 2^-(r+k) (zeta(r + k) - 1)``,

over even k (+) for even r, odd k (-) for odd r. So pi R, pi B, pi C - 1 are power series in nu and
gamma with coefficients of one sign. At nu = 2, gamma = 1/4 they are at most 1 (R telescopes to
``1/sqrt(3) + 1/sqrt(15)``, the others are below ``sum of 1/(r^2 - 1) = 0.6`` over r = 2, 4, 6, 6,
8, 8, ...), so what is cut off from nu^K on is at most 2^-K for nu <= 1. From gamma^(J+1) on it
is at most ``sum over |m| >= 2 of s^2 s^-(2J+2)/(s^2 - 1) <= 5 9^-(J+1)``, as |s| >= 3.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial
from itertools import pairwise
from math import comb

from flint import acb, arb, arb_mat, arb_poly

from contbreather.certified import averages
from contbreather.certified.balls import (
    Ball,
    hull,
    square_root,
    subintervals,
    working,
)

ALIASES = 24  # powers of nu^2 kept
CUT = 2.0 ** (1 - 2 * ALIASES)  # bounds both remainders: 5 9^-41 is far less


# --- sums over aliases --------------------------------------------------------------------------


@lru_cache(maxsize=1)
def _weights() -> tuple[arb_mat, ...]:
    """Coefficients of ``nu^2i gamma^j`` in pi R/nu, pi B and pi C - 1, the sums over |m| >= 2."""
    with working():
        R = [[_weight(2 * j + 1, 2 * i + 1, j) for j in _POWERS] for i in range(ALIASES)]
        B = [[_weight(2 * j + 2, 2 * i, j) for j in _POWERS] for i in range(ALIASES)]
        C = [[-_weight(2 * j, 2 * i, j) if j else 0 for j in _POWERS] for i in range(ALIASES)]
        return arb_mat(R), arb_mat(B), arb_mat(C)


_POWERS = range(averages.J + 1)


def _weight(r: int, k: int, j: int) -> Ball:
    return 2 * comb(2 * j, j) * comb(r - 1 + k, k) * (arb(r + k).zeta() - 1) / arb(2) ** (r + k)


@dataclass(frozen=True)
class Circle:
    """F on the upper half of the circle."""

    gamma: Ball
    k: Ball
    b: Ball

    @cached_property
    def sums(self) -> list[arb_poly]:
        """pi R/nu, pi B and pi C - 1 over |m| >= 2, in powers of nu^2."""
        powers = arb_mat([[self.gamma**j] for j in _POWERS])
        return [arb_poly((weights * powers).entries()) for weights in _weights()]

    def lattice_sums(self, nu: Ball) -> tuple[Ball, Ball, Ball]:
        """R, B and C: the sums over all aliases but nu itself."""
        square, error = nu * nu, arb(0, CUT)
        R, B, C = (total(square) for total in self.sums)
        R, B, C = R * nu + error, B + error, C + error + 1
        for s, sign in ((2 - nu, 1), (2 + nu, -1)):  # m = -1 and 1
            w = (s * s - 4 * self.gamma).sqrt()
            R, B, C = R + sign / w, B + 1 / (s * w), C + 1 - s / w
        return R / arb.pi(), B / arb.pi(), C / arb.pi()

    def value(self, nu: Ball, h: acb) -> acb:
        c, d = 1 + self.k, (1 - self.k) / 2
        R, B, C = self.lattice_sums(nu)
        beta, turn = self.b - c * c * C, acb(d, c * R)
        L = acb(0, 2) * c * nu * turn - beta - c * c * nu * nu * B
        return h * (turn * turn + B * beta) - L / arb.pi()

    def on_band(self, low: float, high: float) -> acb:
        """``nu = 2 sqrt(gamma) sin(pi x/2)``, x from 0 to 1."""
        s, c = (hull(low, high) / 2).sin_cos_pi()
        edge = 2 * square_root(self.gamma)
        nu = edge * s
        return self.value(nu, acb(0, -nu * edge * c.nonnegative_part()))

    def beyond(self, low: float, high: float) -> acb:
        """``nu = 2 sqrt(gamma) + x (1 - 2 sqrt(gamma))``, x from 0 to 1."""
        x, edge = hull(low, high), 2 * square_root(self.gamma)
        nu = edge + x * (1 - edge)
        return self.value(nu, acb(nu * square_root(x * (1 - edge) * (nu + edge))))


# --- the turning --------------------------------------------------------------------------------


def _off_zero(curve: Callable[[float, float], acb], low: float, high: float) -> acb | None:
    """Enclosure of a curve over an arc, None where that holds 0."""
    rectangle = curve(low, high)
    return None if rectangle.contains(0) else rectangle


def count(gamma: Ball, k: Ball, b: Ball) -> tuple[int | None, str]:
    """Isolated multipliers of the half map outside the unit circle, a pair counting two; None with
    the sentence that says so where that is not proved."""
    circle = Circle(gamma, k, b)
    rectangles: list[acb] = []
    for name, curve in (("on the band", circle.on_band), ("beyond the band", circle.beyond)):
        for _, _, rectangle in subintervals(16, partial(_off_zero, curve)):
            if rectangle is None:
                why = f"D may vanish on the circle {name}"
                return None, f"how many multipliers are outside the circle: {why}"
            rectangles.append(rectangle)
    points = [
        complex(
            float(one.real.intersection(other.real).mid()),
            float(one.imag.intersection(other.imag).mid()),
        )
        for one, other in pairwise(rectangles)
    ]
    ends = [math.copysign(1.0, float(rectangles[i].real.mid())) + 0j for i in (0, -1)]
    path = [ends[0], *points, ends[1]]
    turning = sum(cmath.phase(second / first) for first, second in pairwise(path))
    return 1 - round(turning / math.pi), ""
