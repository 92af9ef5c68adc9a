"""Where an orbit has a multiplier that decides: PF, PD and NS, one test and one locus for each.

The map of a road says where it has one (`contbreather.stability.section_map.Map`), the road how
that changes along its unknowns. On finite lattices the events are the same whatever the road.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contbreather.checks import real, shown
from contbreather.continuation import Event, Locus, Point
from contbreather.continuation.curve import Curve
from contbreather.continuation.derivatives import RELATIVE, differences
from contbreather.continuation.newton import Undefined
from contbreather.continuation.point import Always, Meeting
from contbreather.errors import BadInput
from contbreather.stability.pairs import REAL

Array = NDArray[np.float64]
Conditions = Callable[[Curve, Array, Array], Array]
Slopes = Callable[[Conditions, Curve, Array, Array], Array]

EPS = float(np.finfo(float).eps)
STEP = 1e-4  # of unknowns of the order of one, and of parameters
DOUBLE = 1e-3  # how far from each other multipliers are that are one, where it is located
AT_ONCE = 1e-6  # impacts less apart than this are at once: mirror images of each other
BLURRED = 1e-4  # of rounding in a multiplier: neither a sign nor a count is to be had from it


def by_differences(
    conditions: Conditions,
    curve: Curve,
    z: Array,
    extra: Array,
    columns: Sequence[int] | None = None,
    step: float = STEP,
) -> Array:
    """To one side where a parameter is at the end of its domain: curves set out from gamma = 0. The
    first unknowns are the times of impacts, which stay in their order: where sites that are
    coupled change it there is a kink."""

    def near(both: Array) -> Array:
        return conditions(curve, both[: z.size], both[z.size :])

    both, scales = np.append(z, extra), np.append(curve.scales, np.ones(extra.size))
    orbit = Point(curve, z).solution
    finer = np.full(both.size, RELATIVE / step)
    finer[: orbit.times.size] = RELATIVE / min(step, _in_order(orbit))
    return differences(near, both, columns, scales=scales, finer=finer, one_sided=True)


def _in_order(orbit: Any) -> float:
    """A relative step of times that keeps impacts in their order, but for those at once."""
    times = np.sort(orbit.times)
    gaps = np.diff(times, append=times[0] + orbit.section.length)
    return float(gaps[gaps > AT_ONCE].min() / (4.0 * max(1.0, abs(times).max())))


@dataclass(frozen=True)
class OnCircle:
    """``radius exp(i pi nu)`` is a multiplier over the section.

    Parameters
    ----------
    slopes : callable, optional
        ``slopes(conditions, curve, z, extra)``, how conditions change along a road's curves.
    radius : float
    nu : float, optional
        0 or 1, for a real multiplier; else one more unknown.
    """

    slopes: Slopes = by_differences
    radius: float = 1.0
    nu: float | None = None

    def locus(self, nu: float | None = None, **more: Any) -> Locus:
        return Locus({} if nu is None else {"nu": nu}, self.conditions, self.derivative, **more)

    def conditions(self, curve: Curve, z: Array, extra: Array) -> Array:
        return self._parts(_map(curve, z).on_circle(self._angle(extra), self.radius))

    def derivative(self, curve: Curve, z: Array, extra: Array) -> Array:
        beside = _map(curve, z).beside(self._angle(extra), self.radius)

        def near(curve: Curve, z: Array, extra: Array) -> Array:
            return self._parts(beside(_map(curve, z), self._angle(extra)))

        return self.slopes(near, curve, z, extra)

    def _angle(self, extra: Array) -> float:
        return float(extra[0]) if self.nu is None else self.nu

    def _parts(self, value: complex) -> Array:
        return np.array([value.real, value.imag] if self.nu is None else [value.real])


def _map(curve: Curve, z: Array) -> Any:
    return Point(curve, z).solution.map


# --- finite lattices ------------------------------------------------------------------------------


def real_multiplier(kind: str, mu: float, slopes: Slopes = by_differences) -> Event:
    """PF or PD: a multiplier over the section is mu, 1 or -1."""
    locus = Always(OnCircle(slopes, nu=0.5 * (1.0 - mu)).locus())
    examine = partial(examine_real, mu)
    return Event(
        kind, partial(crosses, mu), count=partial(beyond, mu), locus=locus, examine=examine
    )


def crosses(mu: float, point: Point) -> float:
    """``det(M - mu)`` over a section, in units of what it is without impacts.

    Each impact brings a pole where its velocity vanishes, which is divided out.
    """
    orbit = point.solution
    if _rounding(orbit) > BLURRED:
        return math.nan
    velocities = orbit.incoming * [one.wall for one in orbit.impacts]
    return float(orbit.map.crosses(mu) * velocities.prod())


def beyond(mu: float, point: Point) -> float:
    orbit = point.solution
    return math.nan if _rounding(orbit) > BLURRED else int(orbit.map.beyond(mu))


def _rounding(orbit: Any) -> float:
    """Of all multipliers: where an impact loses its velocity one grows beyond all bounds."""
    return float(EPS * np.linalg.norm(orbit.map.matrix))


def examine_real(mu: float, point: Point) -> str:
    orbit = point.solution
    value, size = orbit.map.on_circle(0.5 * (1.0 - mu)), np.prod(1.0 + np.abs(orbit.entries))
    return "" if abs(value) < 1e-8 * size else f"D({mu:g}) = {value.real:.2g} is not zero"


def pair_beyond(threshold: float, slopes: Slopes = by_differences) -> Event:
    """NS, by the ring's rule: the first complex pair whose modulus over the whole period passes a
    threshold. More than one pair close to the circle is a ring's usual state, see `Verdict`.
    """
    if not 1.0 <= real(threshold) < math.inf:
        raise BadInput(
            f"threshold = {shown(threshold)}: a finite modulus of at least 1 is expected."
        )
    locus = partial(_outermost_locus, threshold, slopes)
    return Event("NS", partial(_outermost, threshold), locus=locus, examine=examine_angle)


def _outermost(threshold: float, point: Point) -> float:
    orbit = point.solution
    if _rounding(orbit) > REAL:  # no pair can be told from two real ones
        return math.nan
    return float(orbit.map.outermost(_radius(orbit, threshold)))


def _radius(orbit: Any, threshold: float) -> float:
    """The threshold over the whole period, as one over a section."""
    return math.sqrt(threshold) if orbit.symmetric else threshold


def _outermost_locus(threshold: float, slopes: Slopes, point: Point) -> Locus:
    mu = point.solution.map.coupled
    mu = mu[mu.imag > REAL]
    if not mu.size:
        raise Undefined("no complex multipliers on this ring")
    nu = float(np.angle(mu[abs(mu).argmax()])) / math.pi
    circle = OnCircle(slopes, _radius(point.solution, threshold))
    return circle.locus(nu, events=tuple(_ends(circle.radius, point)))


def _ends(radius: float, point: Point) -> Iterator[Event]:
    """R1, R2: the pair has become a double real multiplier; the curve would come back over itself.
    Of half a symmetric orbit both 1 and -1 are 1 over the whole period."""
    known, half = {one.kind: one for one in point.curve.problem.events}, point.solution.symmetric
    one, other = (("R1", "PF"), ("R1", "LP")) if half else (("R1", "LP"), ("R2", "PD"))
    for mu, (kind, meets) in ((1.0, one), (-1.0, other)):
        yield Meeting(
            kind,
            partial(_from_real, mu),
            examine=partial(_is_double, mu * radius),
            ends="branch",
            base=known[meets if radius == 1.0 else "NS"],
        )


def _from_real(mu: float, point: Point) -> float:
    return float(point["nu"] if mu > 0.0 else 1.0 - point["nu"])


def _is_double(mu: float, point: Point) -> str:
    map = point.ground.solution.map
    if np.sort(abs(map.coupled - mu))[1] > DOUBLE:
        return f"{mu:.6g} is not a double multiplier"
    pair = np.linalg.svd(map.matrix - mu * np.eye(len(map.matrix)), compute_uv=False)[-2]
    return "" if pair > DOUBLE else f"two multipliers {mu:.6g} that pass each other and stay a pair"


def examine_angle(point: Point) -> str:
    """A pair outside may also turn real, one of the two coming in through +1 or -1 later on."""
    nu = point.detail.get("nu")
    if nu is None:
        return "a pair was seen to leave or to turn real, but no angle solves the locus"
    if not 2e-6 < abs(float(nu)) < 1.0 - 2e-6:
        return "a real multiplier passes the circle, no pair"
    return ""
