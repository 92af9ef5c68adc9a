"""What happens to a shot orbit on its branch: LP, BP, PF, PD, NS and GR.

The shooting equations themselves are singular where the section has the multiplier that it closes
with: +1, or -1 on half a symmetric orbit. Folds and branch points are the engine's own. All other
multipliers are looked for in the monodromy matrix of the section.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from contbreather.breathers.clearance import Terms
from contbreather.breathers.grazing import Crest, grazing
from contbreather.breathers.modal_flight import EPS, ModalFlight
from contbreather.breathers.normal_form import bends
from contbreather.breathers.orbit import Orbit
from contbreather.breathers.section import Section
from contbreather.continuation import Event, Locus, Point, branch_point, fold
from contbreather.continuation.branch_points import bordered
from contbreather.continuation.curve import Curve
from contbreather.continuation.derivatives import differences, directional
from contbreather.continuation.loci import Singular
from contbreather.continuation.newton import Undefined
from contbreather.errors import BadInput
from contbreather.stability.pairs import REAL
from contbreather.stability.section_map import ModalMap
from contbreather.stability.verdict import THRESHOLD

FloatArray = NDArray[np.float64]
Conditions = Callable[[Curve, FloatArray, FloatArray], FloatArray]

STEP = 1e-3  # of velocities and accelerations at impacts, relative, for differences
ADRIFT = 1e-6  # coupling below which idle sites cannot be told from free ones
VANISHED = 1e-12  # an impact this slow has a saltation that is all rounding


def events_of(section: Section, threshold: float = THRESHOLD) -> tuple[Event, ...]:
    """All events of an orbit with these impacts.

    Examples
    --------
    >>> [event.kind for event in events_of(Section(((0, 1), (0, -1))))]
    ['LP', 'BP', 'PD', 'NS', 'GR']
    """
    own = symmetry_breaking() if section.symmetric else period_doubling()
    return (fold(), branching(), own, ring_neimark_sacker(threshold), contact())


def symmetry_breaking() -> Event:
    """PF, on half a symmetric orbit: its half map has the multiplier +1."""
    count = partial(_beyond, 1.0)
    return Event("PF", _symmetry_test, count=count, locus=_symmetry_locus, examine=bends)


def _symmetry_test(point: Point) -> float:
    # without coupling idle sites have it all along, wherever they are
    lost = _loose(point) and point["gamma"] < ADRIFT
    return math.nan if lost else determinant(_flight(point), 1.0)


def _symmetry_locus(point: Point) -> Locus:
    own = _null_locus(1.0, point)
    return replace(own, domain={"gamma": (ADRIFT, math.inf)}) if _loose(point) else own


def _beyond(mu: float, point: Point) -> int:
    return _map(point).beyond(mu)


def _loose(point: Point) -> bool:
    """Whether idle sites are held by their neighbours alone."""
    orbit: Orbit = point.solution
    return orbit.spring < ADRIFT and orbit.lattice.sites > 1


def period_doubling() -> Event:
    """PD: a multiplier -1 over the period."""
    count, locus = partial(_beyond, -1.0), partial(_null_locus, -1.0)
    return Event("PD", _doubling_test, count=count, locus=locus)


def _doubling_test(point: Point) -> float:
    return determinant(_flight(point), -1.0)


def branching() -> Event:
    """BP: another curve of solutions of the same equations crosses; as the engine's own, but with
    a determinant for its test, which large rings can afford."""
    test = Singular(bordered, _branching_test)
    return replace(branch_point(), test=test, count=_beyond_closing)


def _branching_test(point: Point) -> float:
    if point.tangent is None:
        return math.nan
    flight = _flight(point)
    whole = np.vstack([point.curve.jacobian(point.z), point.curve.dual(point.tangent)])
    return flight.map.in_units_of_flight(whole, flight.section.sign)


def _beyond_closing(point: Point) -> int:
    return _beyond(point.solution.section.sign, point)


def ring_neimark_sacker(threshold: float = THRESHOLD) -> Event:
    """NS, by the ring's rule: the first complex pair whose modulus over the whole period passes a
    threshold. More than one pair close to the circle is a ring's usual state, see `Verdict`.
    """
    if not 1.0 <= threshold < math.inf:
        raise BadInput(f"threshold = {threshold}: a finite modulus of at least 1 is expected.")
    locus = partial(_circle_locus, threshold)
    return Event("NS", partial(_outermost, threshold), locus=locus)


def _outermost(threshold: float, point: Point) -> float:
    flight = _flight(point)
    # where an impact loses its velocity one multiplier grows beyond all bounds, and with it
    # the rounding of all others: no pair can be told from that
    if EPS * np.linalg.norm(flight.map.matrix) > REAL:
        return math.nan
    return flight.map.outermost(_radius(flight, threshold))


def contact() -> Event:
    """GR: a site comes to touch a wall without an impact; VI: an impact loses its velocity."""
    return grazing(_crest, shallow=_shallow_locus)


def _flight(point: Point) -> ModalFlight:
    flight: ModalFlight = point.solution.flight
    return flight


def _map(point: Point) -> ModalMap:
    return _flight(point).map


def _at(curve: Curve, z: FloatArray) -> ModalFlight:
    return _flight(Point(curve, z))


# --- real multipliers -----------------------------------------------------------------------


def determinant(flight: ModalFlight, mu: float) -> float:
    """``det(M - mu)`` over a section, in units of what it is without impacts.

    Each impact brings a pole where its velocity vanishes, which is divided out.
    """
    velocities = [one.velocity * one.wall for one in flight.arrivals]
    if min(map(abs, velocities)) < VANISHED:
        return math.nan  # the end of the branch, where rounding decides
    return flight.map.crosses(mu) * math.prod(velocities)


def _null_locus(mu: float, point: Point) -> Locus:
    """``(M - mu) y = 0, |y| = 1``, with y as an unknown: no determinant."""
    matrix, vector = _map(point).matrix, _NullVector(mu)
    null = np.linalg.svd(matrix - mu * np.eye(len(matrix)))[2][-1]
    return Locus({"null": null}, vector.conditions, vector.derivative)


@dataclass(frozen=True)
class _NullVector:
    mu: float

    def conditions(self, curve: Curve, z: FloatArray, y: FloatArray) -> FloatArray:
        moved = _at(curve, z).map.applied(y)
        return np.append(moved - self.mu * y, y.dot(y) - 1.0)

    def derivative(self, curve: Curve, z: FloatArray, y: FloatArray) -> FloatArray:
        rows = np.empty((y.size + 1, z.size + y.size))
        rows[:, : z.size] = _in_z(self.conditions, curve, z, y)
        rows[:-1, z.size :] = _at(curve, z).map.matrix - self.mu * np.eye(y.size)
        rows[-1, z.size :] = 2.0 * y
        return rows


def _in_z(conditions: Conditions, curve: Curve, z: FloatArray, extra: FloatArray) -> FloatArray:
    """Derivative in z by differences: one perturbation flown once is cheap, and smooth.

    Of the state the map knows velocities and accelerations at the impacts, and these are linear in
    it: one direction for each of them tells what all modes do.
    """
    flight = _at(curve, z)
    m, size = flight.t.size, 2 * flight.q.size

    def near(z: FloatArray) -> FloatArray:
        return conditions(curve, z, extra)

    others = [*range(m), *range(m + size, z.size)]
    columns = differences(near, z, others, scales=curve.scales)
    rows = np.zeros((len(columns), z.size))
    rows[:, others] = columns
    values = [(abs(one.velocity), abs(one.acceleration)) for one in flight.arrivals]
    sizes = [max(pair[: 1 + i]) for pair in values for i in range(2)]
    for shown, moved, large in zip(
        flight.impact_slopes, np.linalg.pinv(flight.impact_slopes).T, sizes, strict=True
    ):
        step = np.zeros(z.size)
        step[m : m + size] = STEP * large * moved
        rows[:, m : m + size] += np.multiply.outer(
            directional(near, z, step), shown / (STEP * large)
        )
    return rows


# --- complex multipliers --------------------------------------------------------------------


def _radius(flight: ModalFlight, threshold: float) -> float:
    """The threshold over the whole period, as one over a section."""
    return math.sqrt(threshold) if flight.section.symmetric else threshold


def _circle_locus(threshold: float, point: Point) -> Locus:
    """``(M - mu) y = 0`` for a complex y of length 1 and a multiplier mu on the circle of the
    threshold, at an unknown angle ``nu pi``."""
    values, vectors = np.linalg.eig(_map(point).matrix)
    upper = np.flatnonzero(values.imag > REAL)
    if not upper.size:
        raise Undefined("no complex multipliers on this ring")
    outermost = upper[abs(values[upper]).argmax()]
    y = vectors[:, outermost] / np.linalg.norm(vectors[:, outermost])
    largest = int(abs(y).argmax())
    y = y * np.exp(-1j * np.angle(y[largest]))  # a phase of its own: y[largest] is real
    wave = _CircleWave(threshold, largest)
    start = np.concatenate([y.real, y.imag])
    nu = float(np.angle(values[outermost])) / math.pi
    return Locus({"wave": start, "nu": nu}, wave.conditions, wave.derivative)


@dataclass(frozen=True)
class _CircleWave:
    threshold: float
    largest: int

    def _multiplier(self, flight: ModalFlight, extra: FloatArray) -> complex:
        return _radius(flight, self.threshold) * cmath.exp(1j * math.pi * float(extra[-1]))

    def conditions(self, curve: Curve, z: FloatArray, extra: FloatArray) -> FloatArray:
        flight = _at(curve, z)
        both = extra[:-1].reshape(2, -1)
        mu = self._multiplier(flight, extra)
        off = flight.map.applied(both.T).T
        off -= np.array([[mu.real, -mu.imag], [mu.imag, mu.real]]) @ both
        return np.concatenate(
            [off[0], off[1], [both.ravel().dot(both.ravel()) - 1.0, both[1, self.largest]]]
        )

    def derivative(self, curve: Curve, z: FloatArray, extra: FloatArray) -> FloatArray:
        flight = _at(curve, z)
        mu, (re, im) = self._multiplier(flight, extra), extra[:-1].reshape(2, -1)
        size = re.size
        rows = np.zeros((2 * size + 2, z.size + extra.size))
        rows[:, : z.size] = _in_z(self.conditions, curve, z, extra)
        own = rows[:, z.size :]
        one, M = np.eye(size), flight.map.matrix
        own[:size, :size] = own[size:-2, size:-1] = M - mu.real * one
        own[:size, size:-1], own[size:-2, :size] = mu.imag * one, -mu.imag * one
        own[:size, -1] = math.pi * (mu.imag * re + mu.real * im)
        own[size:-2, -1] = math.pi * (mu.imag * im - mu.real * re)
        own[-2, :-1], own[-1, size + self.largest] = 2.0 * extra[:-1], 1.0
        return rows


# --- contacts -------------------------------------------------------------------------------


def _crest(orbit: Orbit, site: int) -> Crest:
    return Crest(partial(_motion, site), partial(_slopes, site))


def _motion(site: int, orbit: Orbit, t: float) -> Terms:
    terms: Terms = orbit.flight.at(site, t)
    return terms


def _slopes(site: int, curve: Curve, orbit: Orbit, t: float) -> FloatArray:
    found: FloatArray = orbit.flight.watched(site, t, curve.free)[:2, 1:]
    return found


def _shallow_locus(orbit: Orbit) -> Locus:
    """An impact whose incoming velocity vanishes."""
    if orbit.k == 0.0:
        raise Undefined("with k = 0 a site rests on its wall: no orbit of impacts continues")
    velocities = [abs(one.velocity) for one in orbit.flight.arrivals]
    # a single number: differences of it cost little
    return Locus({}, partial(_velocity, int(np.argmin(velocities))))


def _velocity(j: int, curve: Curve, z: FloatArray, extra: FloatArray) -> FloatArray:
    return np.array([_at(curve, z).arrivals[j].velocity])
