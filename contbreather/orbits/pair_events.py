"""NS: a complex pair of multipliers leaves the unit circle, or a larger one on a finite lattice;
its defining system, and where the curve of that ends."""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contbreather.continuation.algebra.newton import Undefined
from contbreather.continuation.curve.branch import Points
from contbreather.continuation.curve.point import CodimensionTwo, DefiningSystem, Event, Many, Point
from contbreather.orbits.orbit import Orbit
from contbreather.orbits.orbit_problem import OnCircle, breathers_along
from contbreather.orbits.section import WEAK
from contbreather.stability.modal_map import ModalMap
from contbreather.stability.one_impact import RingHalfMap
from contbreather.stability.verdict import check_threshold
from contbreather.stability.zeros import REAL, nearest_pair, passing, upper

DOUBLE = 1e-3  # how far from each other multipliers are that are one, where it is located

# As k -> 1 the angle of a Neimark-Sacker point tends to the edge of the band like (1 - k)^2, on an
# arm to its pitchfork like sqrt(1 - k): within rounding of that the curve cannot be followed.
_ELASTIC = 1.0 - 1e-5
COUPLED = {"gamma": (WEAK, math.inf)}  # domain of curves of multipliers where coupling alone holds


def held_by_neighbours(orbit: Orbit) -> bool:
    """Tell whether idle sites have the multiplier 1 without coupling, wherever they rest."""
    return type(orbit.map) is ModalMap and orbit.lattice.sites > 1 and orbit.spring < WEAK


def is_blurred(orbit: Any) -> bool:
    """Test whether multipliers mean nothing: they have a pole where an impact vanishes."""
    if orbit.vanishing is not None:
        return True
    # of a multiplier with such rounding neither a sign nor a count is to be had
    return isinstance(orbit.map, ModalMap) and orbit.map.rounding > 1e-4


def pair_leaves(lattice: Any, threshold: float, *, every: bool = False) -> Event:
    """NS: a complex pair leaves the unit circle of the infinite chain; on a finite lattice, whose
    band is on that circle, the first to pass a threshold over the whole period; with `every` any
    pair, after the first one, too."""
    endless = lattice.sites is None
    if not endless:
        check_threshold(threshold, neutral=False)
    pair = _Pair(threshold, every)
    count = pair.passed if endless or every else None
    many = pair.many if endless and not every else None
    # where one outside turns real the test of a finite lattice goes on with the next
    return Event(
        "NS", pair.test, many=many, count=count, locus=pair.locus, examine=_examine_angle,
        may_jump=not endless,
    )  # fmt: skip


@dataclass(frozen=True)
class _Pair:
    """The complex multipliers that are nearest to leaving a circle."""

    threshold: float  # their modulus over the whole period on a finite lattice
    every: bool = False  # whether each one that passes it counts, not the first; of those by modes

    def radius(self, map: Any) -> float:
        """Radius of the circle over a section, which may be half the period."""
        if map.lattice.sites is None:
            return 1.0
        # multipliers over the period are the squares of those over half of it
        return math.sqrt(self.threshold) if map.sign < 0 else self.threshold

    def test(self, point: Point) -> float:
        if point.solution.vanishing is not None:
            return math.nan
        map = point.solution.map
        if map.lattice.sites is None:
            return self._on_chain(map, point)[0]
        if self.every and not is_blurred(point.solution):
            return passing(map.coupled, self.radius(map))[0]
        return float(map.pairs(self.radius(map))[0])

    def many(self, points: Points) -> Many | None:
        along = breathers_along(points)
        return None if along is None else along.map.pairs()

    def passed(self, point: Point) -> float:
        if point.solution.vanishing is not None:
            return math.nan
        map = point.solution.map
        if self.every:
            return passing(map.coupled, self.radius(map))[1]
        return self._on_chain(map, point)[1]

    def _on_chain(self, map: Any, point: Point) -> tuple[float, int]:
        # along a curve in k elastic impacts are the limit of those before: what is neutral only
        # there is no event
        if map.k == 1.0 and map.sign > 0:
            # what is on the circle at k = 1 is inside by more than rounding
            map = replace(map, k=1.0 - 1e-9)
        elif "k" in point.curve.varied and _is_elastic(map):
            map = replace(map, k=1.0 - 1e-15)
        answer: tuple[float, int] = map.pairs()
        return answer

    def locus(self, point: Point) -> DefiningSystem:
        map = point.solution.map
        if map.lattice.sites is None and map.gamma == 0.0:
            raise Undefined("at gamma = 0 there is no band for a pair to come out of")
        if _is_elastic(map):
            # two neutral multipliers meet on the circle, beyond the band, and leave it together
            raise Undefined("elastic impacts: no angle in the band, bisection has to do")
        angle = nearest_pair(map.coupled, self.radius(map)) if self.every else map.nearest()
        if math.isnan(angle):
            raise Undefined("no complex multipliers on this ring")
        return self.following(point, angle)

    def following(self, point: Point, angle: float) -> DefiningSystem:
        map, representation = point.solution.map, point.solution.representation
        circle = OnCircle(self.radius(map))
        if map.lattice.sites is None:
            return representation.locus(circle, point, angle, domain={"k": (0.0, _ELASTIC)})
        if not isinstance(map, RingHalfMap):
            ends = tuple(_turns_real(circle.radius, point))
        else:
            # what is closer is on the circle, as both pairs are where they meet
            others, beyond = _others(map, circle.radius, angle), circle.radius * (1.0 + 1e-8)
            outside = passing(others, beyond)[1] + _real_pairs(others, beyond)
            ends = (_Next(self, circle.radius, outside).event(),)
        domain = COUPLED if held_by_neighbours(point.solution) else {}
        return representation.locus(circle, point, angle, events=ends, domain=domain)


def _is_elastic(map: Any) -> bool:
    """Test whether pairs meet beyond the band, over half a period."""
    return map.lattice.sites is None and map.sign < 0 and map.k == 1.0


@dataclass(frozen=True)
class _Next:
    """Point at which another pair of a ring reaches the circle as well: beyond, the one that was
    followed is not the first to be there any more, and the rule's line goes on with the other. Of
    other pairs so many were `outside` where it set out, two real multipliers alike in sign counting
    as one: where these become a complex pair nothing ends."""

    pair: _Pair
    radius: float
    outside: int

    def event(self) -> Event:
        base = Event("NS", self.pair.test, locus=self.locus, examine=_examine_angle)
        return CodimensionTwo("NS-NS", self.test, ends="domain", base=base, examine=self.examine)

    def others(self, point: Point) -> NDArray[np.complex128]:
        return _others(point.solution.map, self.radius, point["nu"])

    def test(self, point: Point) -> float:
        mu = self.others(point)
        pairs = np.sort(abs(upper(mu)))[::-1]
        known = max(self.outside - _real_pairs(mu, self.radius), 0)
        return self.radius - float(pairs[known:].max(initial=0.0))

    def examine(self, point: Point) -> Mapping[str, Any]:
        return {"next": nearest_pair(self.others(point), self.radius)}

    def locus(self, point: Point) -> DefiningSystem:
        return self.pair.following(point, point.detail["next"])


def _others(map: Any, radius: float, angle: float) -> NDArray[np.complex128]:
    """The multipliers but for a pair on a circle."""
    followed = radius * cmath.exp(1j * math.pi * angle)
    pair = [int(abs(map.coupled - mu).argmin()) for mu in (followed, followed.conjugate())]
    return np.asarray(np.delete(map.coupled, pair))


def _real_pairs(mu: NDArray[np.complex128], radius: float) -> int:
    """Count the pairs that the real multipliers outside a circle may become."""
    real = mu[abs(mu.imag) <= REAL].real
    return sum(int(np.count_nonzero(side * real > radius)) // 2 for side in (1, -1))


def _turns_real(radius: float, point: Point) -> Iterator[Event]:
    """R1, R2: the pair has become a double real multiplier; the curve would come back over itself.
    Of half a symmetric orbit both 1 and -1 are 1 over the whole period."""
    events, half = {e.kind: e for e in point.curve.problem.events}, point.solution.symmetric
    plus, minus = (("R1", "PF"), ("R1", "LP")) if half else (("R1", "LP"), ("R2", "PD"))
    for mu, (kind, meets) in ((1.0, plus), (-1.0, minus)):
        yield CodimensionTwo(
            kind,
            partial(_from_real, mu),
            examine=partial(_is_double, mu * radius),
            ends="branch",
            # on another circle than that of modulus 1 no LP, PF or PD meets it
            base=events[meets if radius == 1.0 else "NS"],
        )


def _from_real(mu: float, point: Point) -> float:
    return float(point["nu"] if mu > 0.0 else 1.0 - point["nu"])


def _is_double(mu: float, point: Point) -> str:
    map = point.solution.map
    if np.sort(abs(map.coupled - mu))[1] > DOUBLE:
        return f"{mu:.6g} is not a double multiplier"
    # a Jordan block has one null vector; two multipliers that only pass each other have two
    pair = np.linalg.svd(map.matrix - mu * np.eye(len(map.matrix)), compute_uv=False)[-2]
    return "" if pair > DOUBLE else f"two multipliers {mu:.6g} that pass each other and stay a pair"


def _examine_angle(point: Point) -> str:
    """A pair outside may also turn real, one of the two coming in through +1 or -1 later on."""
    nu = point.detail.get("nu")
    if nu is None:
        if _is_elastic(point.solution.map):
            return ""
        return "a pair was seen to leave or to turn real, but no angle solves the locus"
    # exp(i pi nu) is real at nu = 0 and 1
    if not 2e-6 < abs(float(nu)) < 1.0 - 2e-6:
        return "a real multiplier passes the circle, no pair"
    return ""
