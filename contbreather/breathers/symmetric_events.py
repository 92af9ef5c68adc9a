"""What happens to a symmetric breather on its branch: LP, PF, NS, GR, each with its locus.

The closure equations (11) are blind to pitchfork and Neimark-Sacker points, so each event brings a
test of its own. The loci are exact: one scalar for a fold and for a pitchfork, two equations and
the unknown angle for a Neimark-Sacker point, two and the unknown time for grazing.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contbreather.breathers import closed_loops, pair_loops
from contbreather.breathers.clearance import Watch
from contbreather.breathers.closed_form import SymmetricFlight, flight_slope_of
from contbreather.breathers.grazing import ALIKE, Crest
from contbreather.breathers.grazing import grazing as followed
from contbreather.breathers.multipliers import examine_angle
from contbreather.breathers.normal_form import bends
from contbreather.breathers.orbit import Orbit
from contbreather.breathers.watched import phase
from contbreather.checks import check_kind
from contbreather.continuation import Event, Locus, Point
from contbreather.continuation.curve import Curve
from contbreather.continuation.newton import Undefined
from contbreather.continuation.point import Always, Counting, Judged, Meeting
from contbreather.continuation.points import Points
from contbreather.continuation.strider import Loops
from contbreather.errors import BadInput
from contbreather.lattice import InfiniteChain, Lattice, Ring
from contbreather.lattice.green import response_weights
from contbreather.stability.arc import OnArc, arc_table, on_arc, window
from contbreather.stability.characteristic import D_gradient, Gradient
from contbreather.stability.half_map import even_multipliers
from contbreather.stability.half_period import HalfMap
from contbreather.stability.isolated import closest_approach
from contbreather.stability.pairs import outermost
from contbreather.stability.verdict import THRESHOLD, check_threshold
from contbreather.stability.winding import many_outside, outside, unstable_count

Array = NDArray[np.float64]
Scalar = Callable[[SymmetricFlight], float]
Slope = Callable[[SymmetricFlight, str], float]

# As k -> 1 the angle of a Neimark-Sacker point tends to the edge of the band like (1 - k)^2, and at
# k = 1 there are none: within rounding of the edge the curve cannot be followed.
_ELASTIC = 1.0 - 1e-5
_ALL_BUT = 1.0 - 1e-15
_ROUNDED = 1e-13  # of the entry b and 1: what is left of a difference that is zero
_ZERO = 1e-8  # a located event's own scalar, relative to the terms in it


def saddle_node() -> Event:
    """LP: two breathers meet, eq. (14). The determinant of the closure's Jacobian vanishes.

    ``chi a f''(phi) + q a f'(phi) = 0``; there the half map QS has the multiplier -1.
    """
    loops = partial(_with, closed_loops.fold, closed_loops.fold_slopes)
    return Event("LP", partial(_on_breather, _fold), locus=_scalar_locus(_fold, _fold_slope, loops))


def pitchfork() -> Event:
    """PF: the half map QS has the multiplier +1, ``a f''(phi) = 2 p sigma(gamma)``. The multiplier
    is the end of the band, so no eigenvalue is followed."""
    loops = partial(_with, closed_loops.pitchfork, closed_loops.pitchfork_slopes)
    held = _scalar_locus(_pitchfork, _pitchfork_slope, loops)
    return Event(
        "PF",
        partial(_on_breather, _pitchfork),
        locus=partial(_pitchfork_locus, held),
        examine=_examine_pitchfork,
    )


def neimark_sacker(
    *, on: InfiniteChain | Ring | None = None, threshold: float = THRESHOLD
) -> Event:
    """NS of a symmetric breather on one lattice, whichever it lives on; the infinite chain unless
    given."""
    lattice = InfiniteChain() if on is None else on
    if isinstance(lattice, InfiniteChain):
        event = Event(
            "NS", _off_window, count=_ends_below, locus=_arc_locus, examine=_examine_angle
        )
        about = ""
    else:
        check_kind(lattice, Ring, "InfiniteChain() or Ring(sites)")
        check_threshold(threshold)
        test = partial(_outermost, lattice, threshold)
        locus = partial(_circle_locus, lattice, threshold)
        event = Event("NS", test, locus=locus, examine=_examine_angle)
        about = f"stability of a ring of {lattice.sites}, threshold {threshold:g}"
    own, rows = partial(_unstable_at, lattice, threshold), partial(_rows_unstable, lattice)
    return Judged.judging(event, {"unstable": Counting(own, rows)}, about)


def _unstable_at(lattice: Lattice, threshold: float, point: Point) -> int:
    return unstable(_flight(point), lattice, threshold)


def _rows_unstable(lattice: Lattice, points: Points) -> NDArray[np.int64] | None:
    """Of all points of a branch at once, -1 where each has to be asked; None where none can be."""
    curve = points.curve
    if isinstance(lattice, Ring) or not {*curve.free} <= {"a", "gamma", "k"}:
        return None
    on = _flight(points[0])
    if not isinstance(on.lattice, InfiniteChain) or on.lattice.spring:
        return None
    p, phi, *free = points.z.T
    values = curve.fixed | dict(zip(curve.free, free, strict=True))
    a, gamma, k = (np.broadcast_to(values[name], p.shape) for name in ("a", "gamma", "k"))
    with np.errstate(all="ignore"):
        acceleration = a * on.forcing.d2f(phi) - p * on.lattice.means(gamma, "eta")
        b = 0.5 * (1.0 + k) ** 2 * acceleration / p
    return np.where(p > 0.0, many_outside(gamma, k, b), -1)


def unstable(breather: SymmetricFlight, lattice: Lattice, threshold: float) -> int:
    """Multipliers of QS outside the circle: isolated ones on the infinite chain, those over 2 pi
    beyond the threshold on a ring."""
    if not isinstance(lattice, Ring):
        map = _chain_map(breather)
        return outside(map.gamma, map.k, map.b, map.lattice)
    radius = math.sqrt(threshold)
    return unstable_count(breather.gamma, breather.k, breather.b, lattice, radius=radius).count


def grazing() -> Event:
    """GR: a neighbour (15), site 0 between its impacts (B3), or the far field ``|a f| <= 1``. Where
    the impact itself loses its momentum, p -> 0, all of them graze at once: VI."""
    return followed(_crest, weakly=_weakly)


def _on_breather(test: Scalar, point: Point) -> float:
    return test(_flight(point))


def _flight(point: Point) -> SymmetricFlight:
    flight: SymmetricFlight = point.solution.flight
    return flight


def _breather(curve: Curve, z: Array) -> SymmetricFlight:
    return _flight(Point(curve, z))


def _names(curve: Curve) -> tuple[str, ...]:
    """What the columns of a derivative belong to: p, phi and the freed parameters."""
    return (*curve.problem.start, *curve.free)


# --- fold and pitchfork: one scalar, nothing unknown --------------------------------------------


def _driven(breather: SymmetricFlight, order: int, name: str, t: float) -> float:
    """Derivative of ``a f^(order)(t)`` in a parameter of the forcing or in a."""
    f = breather.forcing
    if name == "a":
        return float((f.f, f.df, f.d2f)[order](t))
    return breather.a * f.f_param(name, t, order) if name in f.params else 0.0


def _fold(breather: SymmetricFlight) -> float:
    f, phi = breather.forcing, breather.phi
    return breather.a * (breather.chi * f.d2f(phi) + breather.q * f.df(phi))


def _fold_slope(breather: SymmetricFlight, name: str) -> float:
    a, f, phi, chi, q = breather.a, breather.forcing, breather.phi, breather.chi, breather.q
    if name == "phi":
        return a * (chi * f.d3f(phi) + q * f.d2f(phi))
    if name == "k":
        return -2.0 * a * f.df(phi) / (1.0 + breather.k) ** 2
    driven = chi * _driven(breather, 2, name, phi) + q * _driven(breather, 1, name, phi)
    return driven + _mean_slope(breather, "chi", name) * a * f.d2f(phi)


def _mean_slope(breather: SymmetricFlight, mean: str, name: str) -> float:
    """Of `chi`, `eta` or `sigma` in a parameter."""
    lattice: Any = breather.lattice
    if name == "spring":
        return float(lattice.by_spring(breather.gamma, mean))
    return float(getattr(lattice, f"d{mean}")(breather.gamma)) if name == "gamma" else 0.0


def _pitchfork(breather: SymmetricFlight, edge: float | None = None) -> float:
    """2p/c^2 times ``b - c^2 psi/2``, which is D(1) without its pole; eta + psi = 2 sigma. Springs,
    with which it has none, add ``2 d^2/tau``."""
    forced = breather.a * breather.forcing.d2f(breather.phi)
    return forced - 2.0 * breather.p * _turning(breather, edge)


def _turning(breather: SymmetricFlight, edge: float | None = None) -> float:
    lattice: Any = breather.lattice
    sigma = lattice.sigma(breather.gamma)
    if edge is None and not lattice.spring:
        return sigma
    return sigma + 0.5 * breather.q**2 / lattice.tau(breather.gamma, edge)


def _turning_slope(breather: SymmetricFlight, name: str) -> float:
    lattice: Any = breather.lattice
    slope = _mean_slope(breather, "sigma", name)
    if lattice.spring and name in ("gamma", "k"):
        gamma, q = breather.gamma, breather.q
        tau = lattice.tau(gamma)
        by_q = -2.0 / (1.0 + breather.k) ** 2 if name == "k" else 0.0
        by_tau = lattice.dtau(gamma) if name == "gamma" else 0.0
        slope += q / tau * (by_q - 0.5 * q / tau * by_tau)
    return slope


def _pitchfork_slope(breather: SymmetricFlight, name: str) -> float:
    if name == "p":
        return -2.0 * _turning(breather)
    if name == "phi":
        return breather.a * breather.forcing.d3f(breather.phi)
    driven = _driven(breather, 2, name, breather.phi)
    return driven - 2.0 * breather.p * _turning_slope(breather, name)


def _pitchfork_locus(held: Always, point: Point) -> Locus:
    """Where the spring varies, with the lower edge of the band, its root, as an unknown: 1/tau
    grows in proportion to that from no spring on, where the curve in the spring has no tangent."""
    if "spring" not in point.curve.free:
        return held(point)
    edge = math.sqrt(_flight(point).lattice.spring)
    return Locus({"edge": edge}, _pitchfork_at_edge, domain={"edge": (0.0, 1.0)})


def _pitchfork_at_edge(curve: Curve, z: Array, extra: Array) -> Array:
    breather, edge = _breather(curve, z), float(extra[0])
    return np.array([_pitchfork(breather, edge), edge * edge - breather.lattice.spring])


def _scalar_locus(value: Scalar, slope: Slope, loops: Callable[[Loops, int], Loops]) -> Always:
    row = partial(_scalar_slope, slope)
    return Always(Locus({}, partial(_scalar, value), row, loops=loops))


def _with(evaluate: Any, derive: Any, closure: Loops, n: int) -> Loops:
    """The closure with another equation, which has the same data."""
    return replace(closure, evaluate=evaluate, derive=derive)


def _scalar(value: Scalar, curve: Curve, z: Array, extra: Array) -> Array:
    return np.array([value(_breather(curve, z))])


def _scalar_slope(slope: Slope, curve: Curve, z: Array, extra: Array) -> Array:
    breather = _breather(curve, z)
    return np.array([[slope(breather, name) for name in _names(curve)]])


def _examine_pitchfork(point: Point) -> str | Mapping[str, Any]:
    breather = _flight(point)
    size = abs(breather.acceleration) + breather.p
    if abs(_pitchfork(breather)) > _ZERO * size:
        return f"a f'' - 2 p sigma = {_pitchfork(breather):.2g} is not zero"
    if abs(_fold(breather)) < _ZERO * size:
        return "a fold of the closure, not a pitchfork"
    return bends(point)


# --- Neimark-Sacker on the infinite chain -------------------------------------------------------


def _b_slope(breather: SymmetricFlight, name: str) -> float:
    """Derivative of the entry b of the saltation matrix (19)."""
    c, p, a, phi = 1.0 + breather.k, breather.p, breather.a, breather.phi
    half = c * c / (2.0 * p)
    if name == "p":
        return -half * a * breather.forcing.d2f(phi) / p
    if name == "phi":
        return half * a * breather.forcing.d3f(phi)
    if name == "k":
        return 2.0 * breather.b / c
    driven = half * _driven(breather, 2, name, phi)
    return driven - 0.5 * c * c * _mean_slope(breather, "eta", name)


def _chain_map(breather: SymmetricFlight) -> HalfMap:
    """Of the infinite chain, be the breather that of a ring."""
    map = breather.map
    return map if map.lattice.sites is None else replace(map, lattice=InfiniteChain())


def _pairs(point: Point) -> tuple[float, int]:
    """How far b is from the values between which a pair is outside, and how many of both ends of
    that window are below b: two that are passed in one step are seen.

    Along a curve in k, elastic impacts are the limit of those before: what is neutral only there
    is no event. Elsewhere they have an end of that window where the pitchfork is: on a curve of
    pitchforks the distance is zero, but for rounding.
    """

    def pairs(z: Array) -> tuple[float, int]:
        map = _chain_map(_flight(point))
        if map.k == 1.0 and "k" in point.curve.varied:
            map = replace(map, k=_ALL_BUT)
        off, below = map.pairs()
        rounded = map.k == 1.0 and abs(off) <= _ROUNDED * (1.0 + abs(map.b))
        return (0.0 if rounded else off), below

    found: tuple[float, int] = point.curve.once("pairs", point.z, pairs)
    return found


def _off_window(point: Point) -> float:
    return _pairs(point)[0]


def _ends_below(point: Point) -> int:
    return _pairs(point)[1]


def _arc_locus(point: Point) -> Locus:
    breather = _flight(point)
    if breather.k == 1.0:
        # two neutral multipliers meet on the circle, beyond the band, and leave it together
        raise Undefined("elastic impacts: no angle in the band, bisection has to do")
    on = breather.gamma, breather.k
    own = window(*on, breather.lattice.spring)
    # the end of the window that is nearer, if it has ends: that is where this curve is
    nu = own.low if breather.b < own.centre else own.high
    nu = nu or closest_approach(*on, breather.b, breather.lattice.spring).nu
    loops = partial(_with_pair, breather.lattice)
    ends = {"k": (0.0, _ELASTIC)}
    return Locus({"nu": nu}, _arc_conditions, _arc_derivative, domain=ends, loops=loops)


def _with_pair(lattice: Lattice, closure: Loops, n: int) -> Loops | None:
    """The closure with both equations of a pair."""
    scratch = pair_loops.TABLE - pair_loops.ETA
    more = [*np.zeros(scratch), *arc_table(), *lattice.expansion("eta")]
    return _lengthened(closure, pair_loops.pair, pair_loops.pair_slopes, more)


def _lengthened(closure: Loops, evaluate: Any, derive: Any, more: Sequence[float]) -> Loops | None:
    """The closure with one more unknown and two more equations, which ask for more from `MORE` on;
    None where a forcing has so many harmonics that these reach there."""
    room = pair_loops.MORE - len(closure.data)
    data = [*closure.data, *room * [0.0], *map(float, more)]
    data[closed_loops.UNKNOWNS] = 1.0
    return Loops(evaluate, derive, tuple(data)) if room >= 0 else None


def _arc_conditions(curve: Curve, z: Array, extra: Array) -> Array:
    value = _chain_map(_breather(curve, z)).on_circle(float(extra[0]))
    return np.array([value.real, value.imag])


def _arc_derivative(curve: Curve, z: Array, extra: Array) -> Array:
    on = _breather(curve, z)
    return _along(curve, on, on_arc(on.gamma, extra[0], on.k, on.b, on.lattice.spring))


def _along(curve: Curve, breather: SymmetricFlight, F: OnArc | Gradient) -> Array:
    """Derivative of F along the curve's columns and the angle, through b and directly."""
    direct = {"gamma": F.d_gamma, "k": F.d_k, "spring": getattr(F, "d_spring", 0.0)}
    columns = [F.d_b * _b_slope(breather, name) + direct.get(name, 0.0) for name in _names(curve)]
    return np.stack([*columns, F.d_nu], axis=-1)


def _examine_angle(point: Point) -> str:
    return "" if point["k"] == 1.0 else examine_angle(point)


# --- Neimark-Sacker by the paper's rule on a ring -----------------------------------------------


def _upper(breather: SymmetricFlight, ring: Ring) -> NDArray[np.complex128]:
    """Multipliers of QS in the open upper half plane; those of odd modes never leave the circle."""
    if breather.lattice.spring:
        raise BadInput(
            f"on = Ring({ring.sites}): with springs the multipliers on a ring are those "
            f"of the ring's own orbit; trace breather.on(Ring({ring.sites})) instead."
        )
    mu = even_multipliers(ring, breather.gamma, breather.k, breather.b)
    return np.asarray(mu[mu.imag > _ZERO])


def _outermost(ring: Ring, threshold: float, point: Point) -> float:
    return outermost(_upper(_flight(point), ring), math.sqrt(threshold))


def _circle_locus(ring: Ring, threshold: float, point: Point) -> Locus:
    """A multiplier of the ring on the circle of the threshold, at an unknown angle: that of the
    pair farthest out."""
    mu = _upper(_flight(point), ring)
    if not mu.size:
        raise Undefined("no complex multipliers on this ring")
    return _RingWave(ring, threshold).locus(float(np.angle(mu[abs(mu).argmax()])) / math.pi)


@dataclass(frozen=True)
class _RingWave:
    """One pair of a ring's multipliers on the circle of the threshold, and where another reaches it
    as well: beyond, the one that was followed is not the first to be there any more, and the
    rule's line goes on with the other."""

    ring: Ring
    threshold: float

    @property
    def radius(self) -> float:
        return math.sqrt(self.threshold)

    def locus(self, angle: float) -> Locus:
        own = neimark_sacker(on=self.ring, threshold=self.threshold)
        base = replace(own, locus=self._next_locus)
        meets = Meeting("NS-NS", self._test, ends="domain", base=base, examine=self._next)
        return Locus({"nu": angle}, self._conditions, self._derivative, events=(meets,))

    def _conditions(self, curve: Curve, z: Array, extra: Array) -> Array:
        map = replace(_breather(curve, z).map, lattice=self.ring)
        value = map.on_circle(float(extra[0]), self.radius)
        return np.array([value.real, value.imag])

    def _derivative(self, curve: Curve, z: Array, extra: Array) -> Array:
        breather = _breather(curve, z)
        nu = extra[0] - 1j * math.log(self.radius) / math.pi  # exp(i pi nu) has this modulus
        gradient = D_gradient(breather.gamma, nu, breather.k, breather.b, self.ring)
        row = _along(curve, breather, gradient)
        return np.array([row.real, row.imag])

    def _others(self, point: Point) -> NDArray[np.complex128]:
        mu = _upper(_flight(point), self.ring)
        own = int(abs(mu - self.radius * cmath.exp(1j * math.pi * point["nu"])).argmin())
        return np.asarray(np.delete(mu, own))

    def _test(self, point: Point) -> float:
        return self.radius - float(abs(self._others(point)).max(initial=0.0))

    def _next(self, point: Point) -> Mapping[str, Any]:
        mu = self._others(point)
        return {"next": float(np.angle(mu[abs(mu).argmax()])) / math.pi}

    def _next_locus(self, point: Point) -> Locus:
        return self.locus(point.detail["next"])


# --- grazing --------------------------------------------------------------------------------------


def _crest(orbit: Orbit, site: int) -> Crest:
    loops = partial(_with_contact, orbit.lattice, orbit.lattice.distance(site))
    return Crest(site, partial(_slopes, site), loops=loops)


def _with_contact(
    lattice: Lattice, distance: int, wall: float, closure: Loops, n: int
) -> Loops | None:
    """The closure with a contact on the infinite chain."""
    if lattice.sites is not None:
        return None
    room = [0.0] * (pair_loops.MOMENTS - pair_loops.OWN)
    weights = response_weights().ravel()
    more = [wall, distance, *room, *lattice.moments(distance), *weights, *6 * [0.0]]
    return _lengthened(closure, pair_loops.contact, pair_loops.contact_slopes, more)


def _slopes(site: int, curve: Curve, orbit: Orbit, t: float) -> Array:
    rows = [_motion_slope(orbit.flight, site, t, name) for name in _names(curve)]
    return np.array(rows).T


def _weakly(orbit: Orbit) -> Watch:
    watch: Watch = replace(orbit.flight, gamma=ALIKE).watch
    return watch


def _motion_slope(breather: SymmetricFlight, site: int, t: float, name: str) -> tuple[float, float]:
    """Derivative of displacement and velocity at a fixed time."""
    if name not in ("p", "phi", "gamma", "spring"):
        return _driven(breather, 0, name, t), _driven(breather, 1, name, t)
    y, sign = phase(breather, t)
    flight = breather.flight(site)
    if name == "p":
        return sign * flight.value(y), sign * flight.slope(y)
    p = sign * breather.p
    if name == "phi":
        return -p * flight.slope(y), -p * flight.curvature(y)
    own = (breather.lattice, breather.gamma, breather.lattice.distance(site))
    slope = flight_slope_of(*own, name)
    u, v = p * slope.value(y), p * slope.slope(y)
    if name == "spring":
        u, v = u + _driven(breather, 0, name, t), v + _driven(breather, 1, name, t)
    return u, v
