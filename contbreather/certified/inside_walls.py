"""That a breather keeps off the walls, for all times and all sites.

Time is counted from the middle of a flight, ``t = phi + pi/2 + y``; the other half of the motion is
its mirror image. A ball of times with middle y and radius r is settled by Taylor's theorem,

    ``u(y + s) = u(y) + u'(y) s + u''(y + s*) s^2/2,  |s*| <= |s| <= r``,

with the last term enclosed over the whole ball, and else halved. Nothing is sampled.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from flint import arb, arb_poly

from contbreather.certified import averages
from contbreather.certified.averages import force_response, turned
from contbreather.certified.balls import Ball, subintervals

HALF = math.nextafter(0.5 * math.pi, 2.0)  # a float beyond pi/2
FARTHEST = 400  # sites looked at one by one


@dataclass(frozen=True)
class ProvenMotion:
    """``sum of C cos(m y) + S sin(m y) + P(y) + error``, its derivatives with it."""

    harmonics: tuple[tuple[int, Ball, Ball], ...]
    polynomials: tuple[arb_poly, ...]
    errors: tuple[Ball, ...]

    @property
    def highest(self) -> int:
        return max(m for m, _, _ in self.harmonics)

    def at(self, y: Ball, order: int) -> Ball:
        total = self.polynomials[order](y) + self.errors[order]
        for m, cosine, sine in self.harmonics:
            total += turned(cosine, sine, m * y, order) * m**order
        return total

    def over(self, middle: float, radius: float) -> Ball:
        """Displacement over a ball of times, by Taylor's theorem."""
        y = arb(middle)
        curvature = self.at(arb(middle, radius), 2) * arb(0.5 * radius**2, 0.5 * radius**2)
        return self.at(y, 0) + self.at(y, 1) * arb(0, radius) + curvature


def far_field(values: Mapping[str, Ball]) -> ProvenMotion:
    """``a f``, what sites far away do."""
    a, middle = values["a"], values["phi"] + arb.pi() / 2
    harmonics = [
        (m, *(a * turned(cosine, sine, m * middle, order) for order in (0, 1)))
        for m, cosine, sine in force_response(values)
    ]
    nothing = arb_poly([0])
    return ProvenMotion(tuple(harmonics), (nothing,) * 3, (arb(0),) * 3)


def motion_enclosure(values: Mapping[str, Ball], n: int) -> ProvenMotion:
    """Site n of the breather."""
    drive, p = far_field(values), values["p"]
    amplitude, powers, errors = averages.free_flight_enclosure(values["gamma"], n)
    harmonics = {m: (c, s) for m, c, s in drive.harmonics}
    cosine, sine = harmonics.get(1, (arb(0), arb(0)))
    harmonics[1] = (cosine, sine - p * amplitude)
    path = p * powers
    return ProvenMotion(
        tuple((m, *pair) for m, pair in harmonics.items()),
        (path, path.derivative(), path.derivative().derivative()),
        tuple(p * e for e in errors),
    )


# --- covering all times -------------------------------------------------------------------------


def everywhere(
    settled: Callable[[float, float], bool | None], pieces: int
) -> tuple[bool | None, float]:
    """Test whether something holds on all balls of times that cover the flight, halving those on
    which it is not settled; and where it does not."""

    def at(low: float, high: float) -> bool | None:
        # balls overlap: no time is lost to the rounding of their middles
        return settled(HALF * (1.0 - low - high), HALF * (high - low) + 1e-13)

    for low, high, answer in subintervals(pieces, at):
        if not answer:
            return answer, HALF * (1.0 - low - high)
    return True, 0.0


def below(path: ProvenMotion, ceiling: Ball, pieces: int) -> tuple[bool | None, float]:
    """Test whether ``|u| < ceiling`` at all times."""
    return everywhere(lambda middle, radius: _under(path, ceiling, middle, radius), pieces)


def _under(path: ProvenMotion, ceiling: Ball, middle: float, radius: float) -> bool | None:
    if abs(path.over(middle, radius)) < ceiling:
        return True
    return False if abs(path.at(arb(middle), 0)) > ceiling else None


def inside(path: ProvenMotion, pieces: int) -> tuple[bool | None, float]:
    """Test whether site 0 is off both walls between the impact at +1 and the next, at -1.

    At both ends of its flight it is at a wall. On a ball of times that holds an end it is proved
    to move from +1 towards -1: ``u' < 0`` or, after the impact, which it leaves with exactly
    ``u' = -k w <= 0``, ``u'' < 0``. So it is off the wall of that end, and off the other because
    the next ball, which has times in common with this one, says so.
    """
    wall = arb(1)

    def settled(middle: float, radius: float) -> bool | None:
        if abs(middle) + radius < HALF:
            return _under(path, wall, middle, radius)
        y = arb(middle, radius)
        return path.at(y, 1) < 0 or (middle < 0 and path.at(y, 2) < 0) or None

    return everywhere(settled, pieces)


# --- all sites ----------------------------------------------------------------------------------


def admissible(values: Mapping[str, Ball]) -> tuple[bool | None, str]:
    """Test whether all sites keep off the walls at all times, except site 0 at its impacts. True
    and False are proved, None is neither; with it goes what was found or is missing.

    Far sites are bounded together: from site N on, ``|u_n| <= a max |f| + p reach(N)``. The sites
    before N are settled one by one.
    """
    if not values["p"] > 0:
        return None, "that the impact has p > 0 is not proved"
    drive = far_field(values)
    pieces = 12 * drive.highest  # to half a period of the highest harmonic, before any is halved
    holds, when = inside(motion_enclosure(values, 0), pieces)
    if holds is not True:
        return _verdict(holds, "site 0 between its impacts", when)
    far, when = below(drive, arb(1), pieces)
    if far is not True:  # sites far out come as close to it as you like
        return _verdict(far, "the far field", when)
    # half way from the highest value of the far field on a fine grid to the wall: only a choice of
    # how many sites are looked at one by one
    count = 64 * drive.highest
    grid = (HALF * (2.0 * i / count - 1.0) for i in range(count))
    ceiling = 0.5 * (1.0 + max(float(abs(drive.at(arb(y), 0)).mid()) for y in grid))
    for n in range(1, FARTHEST):
        room = 1 - values["p"] * averages.reach(values["gamma"], n)
        if room > ceiling and below(drive, room, pieces)[0]:
            return True, ""
        holds, when = below(motion_enclosure(values, n), arb(1), pieces)
        if holds is not True:
            return _verdict(holds, f"site {n}", when)
    return None, f"sites beyond {FARTHEST}: the far field is too close to the walls"


def _verdict(holds: bool | None, what: str, when: float) -> tuple[bool | None, str]:
    if holds is False:
        return False, f"{what} goes through a wall, {when + HALF:.9g} after an impact"
    return None, f"{what} comes too close to a wall, {when + HALF:.9g} after an impact"
